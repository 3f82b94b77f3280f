from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from vessel_tables import mirrored

from models.vessel import heave_operators
from models.vessel.readers import bundled_vessels, check_long_waves, read_raos

DATA = Path(__file__).parents[4] / "shared" / "data" / "mss" / "supply.mat"
PLACE = Path(__file__).parents[3] / "models" / "vessel" / "data" / "osv-83m.csv"


def test_the_bundled_vessel_keeps_the_limits_of_long_waves() -> None:
    raos = read_raos("osv-83m")
    assert "osv-83m" in dict(bundled_vessels())
    assert raos.heading.size == 24
    assert (raos.omega[0], raos.omega[-1]) == (0.15, 2.0)
    check = check_long_waves(raos)
    assert check.ok
    assert check.error < 0.05


def test_it_says_what_it_was_made_from() -> None:
    text = PLACE.read_text(encoding="utf-8")
    assert PLACE.stat().st_size < 300_000
    for words in (
        "stillhook vessel hull --length 82.8",
        "capytaine 3",
        "8 % of critical",
        "digest",
    ):
        assert words in text


def test_it_rolls_heaves_and_pitches_as_a_ship_of_its_size() -> None:
    raos = read_raos("osv-83m")
    beam = int(np.argmin(np.abs(raos.heading - math.pi / 2.0)))
    head = int(np.argmin(np.abs(raos.heading - math.pi)))
    roll = np.abs(raos.mode("roll")[:, beam])
    period = 2.0 * math.pi / raos.omega[int(np.argmax(roll))]
    assert 10.0 < period < 12.0
    assert 5.0 < math.degrees(float(roll.max())) < 10.0
    assert float(np.abs(raos.mode("roll")[:, head]).max()) < 1e-4
    assert 1.2 < float(np.abs(raos.mode("heave")[:, beam]).max()) < 1.6
    assert 2.0 < math.degrees(float(np.abs(raos.mode("pitch")[:, head]).max())) < 3.0


def test_port_and_starboard_are_mirror_images() -> None:
    raos = read_raos("osv-83m")
    assert np.allclose(mirrored(raos).values, raos.values, atol=1e-12)


def jonswap(omega: np.ndarray, period: float) -> np.ndarray:
    """The shape of a JONSWAP sea with gamma 3.3, without its height."""
    peak = 2.0 * math.pi / period
    width = np.where(omega < peak, 0.07, 0.09)
    sea = omega**-5.0 * np.exp(-1.25 * (peak / omega) ** 4)
    return sea * 3.3 ** np.exp(-0.5 * ((omega - peak) / width / peak) ** 2)


@pytest.mark.parametrize(("period", "lines"), [(7.0, 0.22), (9.0, 0.13), (12.0, 0.07)])
def test_from_every_second_row_the_fourier_series_finds_the_others(
    period: float, lines: float
) -> None:
    raos = read_raos("osv-83m")
    half = replace(raos, heading=raos.heading[::2], values=raos.values[:, ::2])
    hook, weight = (-32.0, 12.0, 20.0), jonswap(raos.omega, period)[:, None]

    def rms(heave: np.ndarray) -> np.ndarray:
        return np.sqrt(np.trapezoid(weight * np.abs(heave) ** 2, raos.omega, axis=0))

    between = raos.heading[1::2]
    true = heave_operators(raos, hook, raos.heading)
    exact = rms(true[:, 1::2])
    assert np.max(np.abs(rms(heave_operators(half, hook, between)) / exact - 1.0)) < 0.03
    # The lines of before, by hand: the six motions halfway, which are then taken to the hook.
    values = 0.5 * (half.values + np.roll(half.values, -1, axis=1))
    halfway = replace(half, heading=between, values=values)
    worst = np.min(rms(heave_operators(halfway, hook, between)) / exact - 1.0)
    assert worst == pytest.approx(-lines, abs=0.005)


@pytest.mark.skipif(not DATA.is_file(), reason="the shared example files are not here")
def test_heave_and_pitch_are_those_of_another_ship_of_the_same_dimensions() -> None:
    # Other lines, another program (strip theory), the same length, beam and draught.  Roll is not
    # compared: that ship is damped three times as much.
    other, ours = read_raos(DATA, speed=0.0), read_raos("osv-83m")
    omega = np.linspace(0.2, 1.6, 57)
    for heading in (90, 120, 135, 150, 180):
        for index in (2, 4):
            theirs, found = (
                np.abs(r.response(omega, math.radians(heading))[:, index]) for r in (other, ours)
            )
            if heading > 90 or index == 2:
                off = np.sqrt(np.mean((found - theirs) ** 2) / np.mean(theirs**2))
                assert off < 0.2, (heading, index)
            if heading > 120:
                assert found.max() == pytest.approx(theirs.max(), rel=0.2)


@pytest.mark.skipif(not DATA.is_file(), reason="the shared example files are not here")
@pytest.mark.parametrize(
    ("heading", "side", "period", "share"),
    [(180, 15.0, 9.0, 0.07), (180, 15.0, 13.0, 0.03), (150, -15.0, 9.0, 0.03)],
)
def test_a_hook_moves_as_far_as_on_that_ship(
    heading: float, side: float, period: float, share: float
) -> None:
    other, ours = read_raos(DATA, speed=0.0), read_raos("osv-83m")
    omega = np.linspace(0.2, 1.9, 600)
    sea = jonswap(omega, period)
    theirs, found = (
        float(np.sqrt(np.trapezoid(sea * np.abs(heave) ** 2, omega)))
        for heave in (
            raos.at((-25.0, side, raos.origin[2])).response(omega, math.radians(heading))[:, 2]
            for raos in (other, ours)
        )
    )
    assert found == pytest.approx(theirs, rel=share)
