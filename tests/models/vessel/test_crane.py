"""Where the hook is: crane angles, and the heave of a rigid vessel at any place."""

from __future__ import annotations

import math

import numpy as np
import pytest
from barge import barge, motions
from hypothesis import given
from hypothesis import strategies as st

from models.basics import InputError, wave_number
from models.vessel import across, equivalent, heave_operators, place_text
from models.vessel.vessel_section import Crane

ANGLES = st.floats(-3.1, 3.1)
LENGTHS = st.floats(0.1, 50.0)


@given(slew=ANGLES, boom=LENGTHS, up=st.floats(-1.6, 1.6), jib=LENGTHS, down=ANGLES)
def test_a_tip_is_two_turned_booms_from_its_heel(slew, boom, up, jib, down):
    # The other route: matrices that turn a boom of (length, 0, 0) up, then round.
    def turned(length, angle):
        lift = np.array([[math.cos(angle), 0, 0], [0, 1, 0], [math.sin(angle), 0, 0]])
        c, s = math.cos(slew), math.sin(slew)
        return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ lift @ [length, 0.0, 0.0]

    heel = np.array([-20.0, 6.0, 9.0])
    angles = {"boom_angle": up, "jib_angle": down}
    crane = Crane(x=-20, y=6, z=9, slew=slew, boom_length=boom, jib_length=jib, **angles)
    np.testing.assert_allclose(crane.tip, heel + turned(boom, up) + turned(jib, down), atol=1e-12)


def test_a_boom_over_each_quarter():
    def tip(degrees):
        angle = math.radians(degrees)
        return Crane(x=-10, y=0, z=5, slew=angle, boom_length=10, boom_angle=0).tip

    np.testing.assert_allclose(tip(0.0), (0.0, 0.0, 5.0), atol=1e-12)
    np.testing.assert_allclose(tip(90.0), (-10.0, 10.0, 5.0), atol=1e-12)
    np.testing.assert_allclose(tip(180.0), (-20.0, 0.0, 5.0), atol=1e-12)
    assert across(tip(90.0)) == pytest.approx(tip(-90.0), abs=1e-12)
    assert place_text(tip(-90.0)) == "x -10 m, y -10 m (starboard)"


def test_an_angle_that_is_no_number_is_refused():
    with pytest.raises(InputError, match="Crane: slew: must be an angle in"):
        Crane(x=0, y=0, slew=math.nan, boom_length=10, boom_angle=0)


@given(x=st.floats(-60.0, 60.0), y=st.floats(-30.0, 30.0), row=st.integers(0, 60))
def test_a_hook_heaves_with_heave_pitch_and_roll(x, y, row):
    raos = barge()
    headings = raos.heading[[3, 10]]
    found = heave_operators(raos, (x, y, 12.0), headings)[row]
    omega = raos.omega[row]
    own = motions(np.array(omega), headings)
    by_hand = own[:, 2] - x * own[:, 4] + y * own[:, 3]
    # Against the wave at the hook, which is that amidships, later by the way there.
    way = x * np.cos(headings) + y * np.sin(headings)
    by_hand = by_hand * np.exp(1j * wave_number(omega) * way)
    np.testing.assert_allclose(found, by_hand, rtol=1e-10, atol=1e-12)


def test_a_ship_alike_on_both_sides_moves_alike_in_mirrored_waves():
    raos = barge()
    headings = np.radians([15.0, 90.0, 150.0])
    there = heave_operators(raos, (-25.0, 14.0, 0.0), headings)
    across_it = heave_operators(raos, (-25.0, -14.0, 0.0), -headings)
    np.testing.assert_allclose(there, across_it, atol=1e-12)
    # And not alike in the same waves: beam seas lift one side with the roll, one against it.
    assert np.ptp(np.abs([there[:, 1], across_it[:, 1]])) > 0.1
    other = heave_operators(raos, (-25.0, -14.0, 0.0), headings)
    assert np.abs(np.abs(there[:, 1]) - np.abs(other[:, 1])).max() > 0.3


def test_long_waves_lift_every_hook_as_they_lift_the_water():
    raos = barge()
    for x, y in ((-40.0, 0.0), (0.0, 20.0), (-25.0, -14.0)):
        operators = heave_operators(raos, (x, y, 30.0), raos.heading)
        np.testing.assert_allclose(operators[0], 1.0, atol=0.09)


def test_the_equivalent_operator_keeps_energy_and_tends_to_one_heading():
    rng = np.random.default_rng(3)
    operators = rng.standard_normal((7, 5)) + 1j * rng.standard_normal((7, 5))
    weights = np.array([0.1, 0.2, 0.4, 0.2, 0.1])
    amplitude, _ = equivalent(operators, weights)
    energy = sum(w * abs(column) ** 2 for w, column in zip(weights, operators.T, strict=True))
    np.testing.assert_allclose(amplitude**2, energy, rtol=1e-13)
    amplitude, phase = equivalent(operators, np.array([0.0, 0.0, 1.0, 0.0, 0.0]))
    np.testing.assert_allclose(amplitude * np.exp(1j * phase), operators[:, 2], rtol=1e-13)


def test_between_the_headings_of_a_table_the_hook_follows_the_vessel():
    # Half-way between rows 15 degrees apart, where most of a sea's energy is; the chord between
    # two phases of the wave at the hook would be 5 % short.
    raos = barge()
    place = (-32.0, 12.0, 20.0)
    for degrees in (37.5, 97.5, 157.5):
        heading = np.radians([degrees])
        found = heave_operators(raos, place, heading)[:, 0]
        exact = motions(raos.omega, np.broadcast_to(heading, raos.omega.shape))
        exact = exact[:, 2] + 32.0 * exact[:, 4] + 12.0 * exact[:, 3]
        rows = (raos.omega > 0.3) & (raos.omega < 0.8)
        np.testing.assert_allclose(np.abs(found[rows]), np.abs(exact[rows]), atol=0.031)
