"""Waves met at another frequency: energy is moved along the axis, none is lost, none is made."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest
from barge import barge_case
from hypothesis import given
from hypothesis import strategies as st

from models.basics import GRAVITY, PhysicsWarning, wave_number
from models.hook import Encounter, HookMotion
from models.hook.encounter import speed_along
from models.sea import SeaSpectrum
from models.vessel import HeaveRao

SEA = SeaSpectrum(kind="jonswap", significant_height=2.0, peak_period=9.0)
FLAT = HeaveRao(omega=[0.2, 2.0], amplitude=[1.0, 1.0], below="hold", beyond="hold")
RAO = HeaveRao(omega=[0.2, 0.6, 0.9, 1.4, 2.0], amplitude=[1.0, 1.1, 0.7, 0.2, 0.05])
WAVES = np.geomspace(*SEA.band, 400_001)


def met(along, rao=RAO, weights=None, depth=math.inf) -> HookMotion:
    along = np.atleast_1d(np.asarray(along, dtype=float))
    weights = np.full(along.size, 1.0 / along.size) if weights is None else weights
    return HookMotion(
        sea=SEA, rao=rao, encounter=Encounter(along=along, weights=weights, depth=depth)
    )


def by_quadrature(along: float, order: int, highest: float, rao=RAO, depth=math.inf) -> float:
    """Moment over the waves' own frequency, with the frequency of encounter as weight."""
    frequency = np.abs(WAVES - wave_number(WAVES, depth) * along)
    energy = rao.gain(WAVES) ** 2 * SEA.density(WAVES) * (frequency <= highest)
    return float(np.trapezoid(energy * frequency**order * WAVES, np.log(WAVES)))


@pytest.mark.parametrize("along", [-12.0, -5.0, -1.0, -1e-3, 1e-3, 1.0, 3.0, 6.0, 9.0, 14.0])
def test_no_energy_is_lost_whatever_the_speed(along):
    motion = met(along)
    still = HookMotion(sea=SEA, rao=RAO)
    assert motion.displacement.m0 == pytest.approx(still.displacement.m0, rel=2e-7)
    assert motion.density([0.0])[0] == 0.0
    assert np.all(motion.density(np.linspace(0.0, 8.0, 4001)) >= 0.0)


@pytest.mark.parametrize("along", [-5.0, -1.0, 1.0, 3.0, 6.0])
def test_speed_and_acceleration_against_direct_quadrature(along):
    motion = met(along)
    top = motion.band[1]
    for order, statistics, rtol in (
        (2, motion.velocity, 4e-4),
        (4, motion.acceleration, 1.5e-3),
    ):
        wanted = by_quadrature(along, order, top)
        assert statistics.m0 == pytest.approx(wanted, rel=rtol), order


@pytest.mark.parametrize("along", [-4.0, -1.0, 0.5])
def test_one_wave_at_each_frequency_gives_the_closed_form(along):
    # Without a fold: S_e(omega_e) = S(omega) / |d omega_e / d omega|.
    motion = met(along, rao=FLAT)
    omega = np.linspace(0.45, 1.6, 60)
    frequency = omega - omega**2 * along / GRAVITY
    wanted = SEA.density(omega) / np.abs(1.0 - 2.0 * omega * along / GRAVITY)
    found = motion.density(frequency)
    np.testing.assert_allclose(found, wanted, atol=0.006 * wanted.max())


def test_three_waves_at_one_frequency_are_added():
    # Astern at 6 m/s: below the fold at 0.41 rad/s one longer, one shorter and one overtaken.
    along, w = 6.0, 0.3
    a = along / GRAVITY
    root, over = math.sqrt(1.0 - 4.0 * a * w), math.sqrt(1.0 + 4.0 * a * w)
    waves = np.array([(1 - root) / (2 * a), (1 + root) / (2 * a), (1 + over) / (2 * a)])
    np.testing.assert_allclose(np.abs(waves - a * waves**2), w, rtol=1e-12)
    wanted = float(np.sum(SEA.density(waves) / np.abs(1.0 - 2.0 * a * waves)))
    assert met(along, rao=FLAT).density([w])[0] == pytest.approx(wanted, rel=0.01)


@given(along=st.floats(-15.0, 15.0), share=st.floats(0.01, 0.99))
def test_energies_of_headings_add_up(along, share):
    both = met([along, -2.0], weights=np.array([share, 1.0 - share]))
    total = both.met.energy[-1]
    parts = share * met(along).met.energy[-1] + (1.0 - share) * met(-2.0).met.energy[-1]
    assert total == pytest.approx(parts, rel=1e-6)


def test_shallow_water():
    motion = met(-3.0, depth=25.0)
    wanted = by_quadrature(-3.0, 2, motion.band[1], depth=25.0)
    assert motion.velocity.m0 == pytest.approx(wanted, rel=4e-4)
    # Waves are shorter there, and so are met more often.
    assert motion.velocity.m0 > 1.02 * met(-3.0).velocity.m0


@given(along=st.floats(-8.0, 8.0), omega=st.floats(0.05, 0.5))
def test_the_longest_wave_of_a_frequency(along, omega):
    encounter = Encounter(along=[along], weights=[1.0])
    if 2.0 * omega * along < GRAVITY:  # this side of the fold
        there = float(encounter.frequency([omega])[0, 0])
        assert float(encounter.wave_frequency(there)) == pytest.approx(omega, rel=1e-9)


def test_the_record_has_the_variances_of_the_spectrum():
    for along in (-4.0, 5.0):
        motion = met(along)
        record = motion.record(10800.0, step=0.25, seed=8)
        for name in ("displacement", "velocity", "acceleration"):
            wanted = getattr(motion, name).rms
            assert np.std(getattr(record, name)) == pytest.approx(wanted, rel=0.05), name


def test_a_vessel_at_rest_is_left_alone(tmp_path):
    case = barge_case(tmp_path)
    assert Encounter.from_case(case) is None
    same = case.replace({"vessel.speed": 0.0, "vessel.current": {"speed": 0.0, "heading": 1.0}})
    assert Encounter.from_case(same) is None
    omega = np.linspace(0.2, 3.0, 200)
    np.testing.assert_array_equal(
        HookMotion.from_case(case).density(omega), HookMotion.from_case(same).density(omega)
    )
    crawling = HookMotion.from_case(case.replace({"vessel.speed": 1e-6}))
    assert crawling.velocity.rms == pytest.approx(HookMotion.from_case(case).velocity.rms, rel=1e-4)


def test_speed_and_current_along_the_waves(tmp_path):
    case = barge_case(tmp_path, vessel_speed="6 knots")
    speed = 6.0 * 1852.0 / 3600.0
    headings = np.radians([0.0, 90.0, 180.0])
    np.testing.assert_allclose(speed_along(case, headings), [speed, 0.0, -speed], atol=1e-12)
    # A vessel that drifts with the water meets the waves as one that lies in still water.
    drifting = case.replace({"vessel.current": {"speed": speed, "heading": 0.0}})
    np.testing.assert_allclose(speed_along(drifting, headings), 0.0, atol=1e-12)
    # One that holds its place in a current from ahead meets those from ahead sooner.
    held = case.replace(
        {"vessel.speed": None, "vessel.current": {"speed": 1.0, "heading": math.pi}}
    )
    np.testing.assert_allclose(speed_along(held, headings), [1.0, 0.0, -1.0], atol=1e-12)


def test_head_seas_are_met_faster_and_following_seas_slower(tmp_path):
    def speed(heading, knots):
        wanted = {"vessel.heading": math.radians(heading), "vessel.speed": f"{knots} knots"}
        return HookMotion.from_case(case.replace(wanted)).velocity.rms

    case = barge_case(tmp_path)
    assert speed(180.0, 5) > 1.1 * speed(180.0, 0)
    assert speed(0.0, 5) < 0.8 * speed(0.0, 0)
    assert speed(90.0, 5) == pytest.approx(speed(90.0, 0), rel=1e-3)


def test_a_speed_that_the_file_knows_nothing_of_is_told(tmp_path):
    case = barge_case(tmp_path, vessel_speed="12 knots")
    with pytest.warns(PhysicsWarning, match=r"vessel\.speed: the RAOs of .* hold for 0 m/s"):
        HookMotion.from_case(case)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        HookMotion.from_case(case, warn=False)
