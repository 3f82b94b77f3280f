"""Six complex RAOs: between the rows, at another point, mirrored, and as waveresponse sees them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import waveresponse as wr
from hypothesis import given, settings
from hypothesis import strategies as st
from vessel_tables import mirrored, swinging

from models.basics import InputError, wave_number
from models.vessel import MODES, VesselRaos
from models.vessel.raos import MIRRORED
from models.vessel.symmetry import completed, looks_symmetric

RAOS = swinging()
COORDINATE = st.floats(-80.0, 80.0)


def test_wave_numbers_satisfy_the_dispersion_relation_at_any_depth() -> None:
    omega = np.geomspace(1e-4, 15.0, 300)
    for depth in (0.3, 8.0, 40.0, 300.0, 1e4):
        k = wave_number(omega, depth)
        assert np.allclose(9.80665 * k * np.tanh(k * depth), omega**2, rtol=1e-12, atol=0.0)
    assert np.allclose(wave_number(omega, 1e9), omega**2 / 9.80665, rtol=1e-12)
    assert float(wave_number(0.0, 30.0)) == 0.0


def test_the_rows_come_back_exactly() -> None:
    omega, heading = np.meshgrid(RAOS.omega, RAOS.heading, indexing="ij")
    assert np.array_equal(RAOS.response(omega, heading), RAOS.values)
    away = replace(RAOS, phase_origin=(37.0, -11.0))
    assert np.allclose(away.response(omega, heading), away.values, rtol=1e-12, atol=0.0)
    # Rounded and wound headings are the same headings.
    turned = RAOS.response(RAOS.omega[2], RAOS.heading[3] - 4.0 * math.pi + 1e-12)
    assert np.array_equal(turned, RAOS.values[2, 3])


def test_between_frequencies_amplitude_and_phase_are_linear() -> None:
    a, b = RAOS.values[3, 5], RAOS.values[4, 5]
    middle = RAOS.response(0.6, RAOS.heading[5])
    assert np.allclose(np.abs(middle), 0.5 * (np.abs(a) + np.abs(b)), rtol=1e-12)
    # The bisector of two unit vectors halves their angle.
    half = a / np.abs(a) + b / np.abs(b)
    assert np.allclose(middle / np.abs(middle), half / np.abs(half), atol=1e-12)


def waving(headings: np.ndarray, order: int) -> VesselRaos:
    """Motions that are trigonometric polynomials of the heading, heave even and roll odd."""
    values = np.zeros((2, headings.size, 6), dtype=np.complex128)
    for row, factor in enumerate((1.0, 0.4 - 0.2j)):
        values[row, :, 2] = factor * (1.0 + np.cos(headings) - 0.7j * np.cos(order * headings))
        values[row, :, 3] = factor * (np.sin(headings) + 0.3j * np.sin(order * headings))
    return VesselRaos(name="waves", omega=[0.5, 1.0], heading=headings, values=values)


@pytest.mark.parametrize(("count", "first"), [(12, 0.0), (13, 0.0), (24, 0.0), (36, 0.07)])
def test_even_headings_are_the_samples_of_a_fourier_series(count: int, first: float) -> None:
    order = (count - 1) // 2
    raos = waving(first + 2.0 * math.pi * np.arange(count) / count, order)
    assert raos.even
    between = np.linspace(-7.0, 7.0, 101)
    found = raos.response(np.array([[0.5], [1.0]]), between)
    wanted = waving(np.linspace(0.0, 6.2, 63), order)
    wanted_values = waving(np.sort(np.mod(between, 2.0 * math.pi)), order).values
    there = np.argsort(np.mod(between, 2.0 * math.pi))
    assert np.allclose(found[:, there], wanted_values, rtol=0.0, atol=1e-12)
    assert not np.allclose(raos.response(0.5, wanted.heading)[:, 2].real, 1.0)


def test_a_symmetric_vessel_stays_symmetric_between_the_headings() -> None:
    ship = swinging(symmetric=True)
    port = ship.response(0.65, np.radians([7.0, 100.0, 171.0]))
    starboard = ship.response(0.65, -np.radians([7.0, 100.0, 171.0]))
    assert np.allclose(port, starboard * MIRRORED, rtol=0.0, atol=1e-14)
    # From dead ahead there is no roll: the sines of the series are zero there.
    assert np.all(np.abs(ship.response(0.65, [0.0, math.pi])[:, [1, 3, 5]]) < 1e-14)


def test_between_coarse_and_uneven_headings_the_complex_number_is_linear_round_the_circle() -> None:
    coarse = swinging(8)
    last, first = coarse.values[4, -1], coarse.values[4, 0]
    between = coarse.response(0.7, math.radians(337.5))
    assert np.allclose(between, 0.5 * (last + first), rtol=1e-12)
    keep = np.delete(np.arange(12), 5)
    uneven = replace(RAOS, heading=RAOS.heading[keep], values=RAOS.values[:, keep])
    assert not coarse.even
    assert not uneven.even
    between = uneven.response(0.7, math.radians(140.0))
    assert np.allclose(between, (2.0 * RAOS.values[4, 4] + RAOS.values[4, 6]) / 3.0, rtol=1e-12)


def test_a_curve_instead_of_lines_is_nearer_to_a_smooth_vessel() -> None:
    coarse = waving(2.0 * math.pi * np.arange(8) / 8, 2)
    b = np.radians(np.arange(10.0, 350.0, 7.0))
    exact = waving(b, 2).values[1]
    lines, curve = (np.abs(coarse.response(1.0, b, smooth=s) - exact).max() for s in (False, True))
    assert curve < 0.4 * lines
    assert np.array_equal(coarse.response(1.0, coarse.heading, smooth=True), coarse.values[1])


def test_a_distant_phase_origin_changes_nothing_but_the_phase_between_headings() -> None:
    omega = np.linspace(0.09, 1.6, 40)[:, None]
    heading = np.linspace(0.0, 6.2, 30)
    near = RAOS.response(omega, heading)
    far = RAOS.with_phase_origin((150.0, -60.0)).response(omega, heading)
    along = 150.0 * np.cos(heading) - 60.0 * np.sin(heading)
    shift = np.exp(1j * RAOS.wave_number(omega) * along)
    assert np.allclose(far, near * shift[..., None], rtol=1e-9, atol=1e-12)


def test_outside_the_table_long_waves_lift_and_turn_it_and_short_ones_fade() -> None:
    below = RAOS.response(1e-6, 0.5 * math.pi)
    assert below[2] == pytest.approx(1.0, abs=1e-4)
    k = float(RAOS.wave_number(0.04) / RAOS.wave_number(0.08))
    assert np.allclose(RAOS.response(0.04, 0.0)[3:], RAOS.values[0, 0, 3:] * k)
    assert np.allclose(RAOS.response(3.4, 0.0), RAOS.values[-1, 0] / 4.0)


def test_a_gap_of_headings_is_no_table() -> None:
    half = replace(RAOS, heading=RAOS.heading[:7], values=RAOS.values[:, :7])
    assert half.response(0.5, math.pi).shape == (6,)
    with pytest.raises(InputError, match=r"no heading between 180 and 0 deg"):
        half.response(0.5, math.radians(200.0))


@given(x=COORDINATE, y=COORDINATE, z=COORDINATE)
@settings(max_examples=25, deadline=None)
def test_the_transfer_to_a_point_is_that_of_waveresponse(x: float, y: float, z: float) -> None:
    start = replace(RAOS, origin=(1.5, -0.5, 2.0))
    moved = start.at((x, y, z))
    theirs = RAOS.to_waveresponse()
    t = np.array([x, y, z]) - np.array(start.origin)
    surge, sway, heave = wr.rigid_transform(t, *(theirs[mode] for mode in MODES))
    scale = 1.0 + abs(x) + abs(y) + abs(z)
    for name, rao in (("surge", surge), ("sway", sway), ("heave", heave)):
        _, _, values = rao.grid(freq_hz=False, degrees=False)
        assert np.allclose(moved.mode(name), values, rtol=0.0, atol=1e-14 * scale)
    assert moved.origin == (x, y, z)
    assert np.array_equal(moved.values[:, :, 3:], start.values[:, :, 3:])


def test_heave_at_a_point_is_heave_less_x_pitch_plus_y_roll() -> None:
    heave, roll, pitch = RAOS.values[:, 4, 2], RAOS.values[:, 4, 3], RAOS.values[:, 4, 4]
    found = RAOS.heave_at((-25.0, 15.0, 30.0), RAOS.heading[4])
    assert np.allclose(found, heave + 25.0 * pitch + 15.0 * roll, rtol=1e-12)


@given(x=COORDINATE, y=COORDINATE)
@settings(max_examples=20, deadline=None)
def test_moving_away_and_back_is_the_identity(x: float, y: float) -> None:
    there = RAOS.at((x, y, 7.0)).with_phase_origin((y, x))
    back = there.at(RAOS.origin).with_phase_origin(RAOS.phase_origin)
    assert np.allclose(back.values, RAOS.values, rtol=1e-10, atol=1e-12)


def test_a_mirror_twice_is_the_vessel_and_a_symmetric_one_is_its_own_mirror() -> None:
    again = mirrored(mirrored(RAOS))
    assert np.allclose(again.heading, RAOS.heading)
    assert np.array_equal(again.values, RAOS.values)
    ship = swinging(symmetric=True)
    assert np.allclose(mirrored(ship).values, ship.values, atol=1e-15)
    # A hook to port in waves from starboard is a hook to starboard in waves from port.
    port = RAOS.heave_at((-20.0, 12.0, 0.0), RAOS.heading[2])
    starboard = mirrored(RAOS).heave_at((-20.0, -12.0, 0.0), -RAOS.heading[2])
    assert np.allclose(port, starboard)


def test_the_mirror_is_that_of_waveresponse() -> None:
    ship = swinging(12, symmetric=True)
    half = replace(ship, heading=ship.heading[:7], values=ship.values[:, :7])
    for mode, rao in half.to_waveresponse().items():
        full = wr.mirror(rao, mode, sym_plane="xz")
        _, heading, values = full.grid(freq_hz=False, degrees=False)
        assert np.allclose(heading, ship.heading)
        assert np.allclose(values, ship.mode(mode), atol=1e-15)
    assert looks_symmetric(half)
    assert np.allclose(completed(half, "xz plane").values, ship.values, atol=1e-15)


def test_a_vessel_without_symmetry_is_not_taken_for_half_of_one() -> None:
    bent = RAOS.values[:, :7].copy()
    bent[:, 0, 3] += 0.3 * np.abs(bent[:, :, 3]).max()
    assert not looks_symmetric(replace(RAOS, heading=RAOS.heading[:7], values=bent))
    assert not looks_symmetric(RAOS)


def test_a_body_of_revolution_answers_every_heading_from_one() -> None:
    one = swinging(1, symmetric=True)
    whole = completed(one, "circular")
    # At rest in waves to port it does what it does in following waves, turned by a quarter.
    astern, abeam = whole.response(0.5, 0.0), whole.response(0.5, 0.5 * math.pi)
    assert np.allclose(abeam[1], astern[0])
    assert np.allclose(abeam[3], -astern[4])
    assert np.allclose(abeam[[2, 5]], astern[[2, 5]])
    with pytest.raises(InputError, match="must have 1 heading"):
        completed(RAOS, "circular")


@pytest.mark.parametrize(("clockwise", "coming_from"), [(True, True), (True, False), (False, True)])
def test_waveresponse_objects_come_and_go_in_any_wave_convention(
    clockwise: bool, coming_from: bool
) -> None:
    theirs = RAOS.to_waveresponse()
    for rao in theirs.values():
        rao.set_wave_convention(clockwise=clockwise, waves_coming_from=coming_from)
    back = VesselRaos.from_waveresponse(theirs, name="swing")
    assert np.allclose(back.heading, RAOS.heading)
    assert np.allclose(back.values, RAOS.values, rtol=1e-12)
    partly = VesselRaos.from_waveresponse({"heave": theirs["heave"]})
    assert not np.any(partly.mode("roll"))
    with pytest.raises(InputError, match="got bounce"):
        VesselRaos.from_waveresponse({"bounce": theirs["heave"]})


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"omega": RAOS.omega[::-1]}, "strictly ascending"),
        ({"omega": RAOS.omega - 0.08}, "omega must be above 0 rad/s"),
        ({"heading": RAOS.heading + 1.0}, r"heading must be in \[0, 6.28319\) rad"),
        ({"values": RAOS.values[:-1]}, r"shape \(frequencies, headings, 6\) = \(8, 12, 6\)"),
        ({"values": np.where(RAOS.values == RAOS.values[3, 2, 4], np.nan, RAOS.values)}, "pitch"),
        ({"origin": (1.0, 2.0)}, "origin must be 3 numbers"),
        ({"depth": 0.0}, "depth must be above 0 m"),
        ({"speed": math.nan}, "speed"),
    ],
)
def test_a_table_that_is_none_is_refused(change: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        replace(RAOS, **change)
