"""The vessel section of a case: two forms, their fields, and what is said when they are mixed."""

from __future__ import annotations

import math
import os
import re
import warnings
from dataclasses import replace

import numpy as np
import pytest
from barge import barge, barge_case, barge_file

from models import Case, InputError, load_case
from models.basics import PhysicsWarning
from models.hook import HookMotion
from models.operation.contact_scenarios import boat_motion, surface_motion
from models.sea import Spreading
from models.vessel import heave_operators, hook_rao, vessel_raos
from models.vessel.readers import read_raos, write_raos

VESSEL = """\
vessel:
  raos: barge.csv
  hook: {x: -25 m, y: 14 m}
  heading: 150 deg
"""


@pytest.fixture
def write(tmp_path):
    """Write a case with another vessel section, next to a RAO file, and return its path."""
    barge_file(tmp_path)
    text = load_case("subsea-crane").to_yaml()
    head, _, rest = text.partition("vessel:\n")
    tail = rest[rest.index("\nrope:") + 1 :]

    def run(vessel: str):
        path = tmp_path / "my.yaml"
        path.write_text(head + vessel + tail)
        return path

    return run


def test_a_file_beside_the_case_is_found_from_anywhere(write, tmp_path, monkeypatch):
    path = write(VESSEL)
    monkeypatch.chdir(os.path.dirname(os.__file__))
    case = load_case(path)
    assert case.vessel.raos == str(tmp_path / "barge.csv")
    assert case.vessel.hook_point == (-25.0, 14.0, 0.0)
    assert Case.from_dict(case.to_dict()) == case
    assert HookMotion.from_case(case).displacement.rms > 0.2


def test_a_crane_in_place_of_a_hook(write):
    crane = VESSEL.replace(
        "hook: {x: -25 m, y: 14 m}",
        "crane: {x: -25, y: 4, z: 10, slew: 90 deg, boom_length: 20 m, boom_angle: 60 deg}",
    )
    case = load_case(write(crane))
    assert case.vessel.hook_point == pytest.approx((-25.0, 14.0, 10.0 + 20.0 * math.sqrt(0.75)))
    by_hook = HookMotion.from_case(load_case(write(VESSEL)))
    assert HookMotion.from_case(case).velocity.rms == pytest.approx(by_hook.velocity.rms, rel=1e-9)
    knuckle = case.replace({"vessel.crane.jib_length": 5.0, "vessel.crane.jib_angle": "-30 deg"})
    assert knuckle.vessel.hook_point[1] == pytest.approx(14.0 + 5.0 * math.sqrt(0.75))


TABLE = "vessel:\n  heave_rao: {omega: [0.3, 1.0], amplitude: [1, 0.5]}\n"

WRONG = {
    "none of the two": (
        "vessel:\n  below: hold\n",
        "vessel.heave_rao: is missing: give it, the heave of the hook, or raos with hook and "
        "heading",
    ),
    "fields of the one form alone": (
        "vessel:\n  heading: 1 rad\n  speed: 2 kn\n",
        "vessel.heave_rao: is missing: give it, the heave of the hook, or raos with hook and "
        "heading; heading, speed alone do not do",
    ),
    "both": (
        TABLE + "  raos: barge.csv\n",
        "vessel.raos: goes with raos; heave_rao is that of one hook in one heading already",
    ),
    "a heading for one table": (
        TABLE + "  heading: 90 deg\n",
        "vessel.heading: goes with raos; heave_rao is that of one hook in one heading already",
    ),
    "no hook": (
        VESSEL.replace("  hook: {x: -25 m, y: 14 m}\n", ""),
        "vessel.hook: is missing: raos need the place of the hook, or a crane",
    ),
    "no heading": (
        VESSEL.replace("  heading: 150 deg\n", ""),
        "vessel.heading: is missing: raos need the heading of the waves (180 deg: head sea)",
    ),
    "hook and crane": (
        VESSEL + "  crane: {x: 0, y: 0, slew: 0, boom_length: 9, boom_angle: 1}\n",
        "vessel.crane: must not be given beside hook: both say where the tip is",
    ),
    "degrees without their unit": (
        VESSEL.replace("150 deg", "150"),
        "vessel.heading: must be an angle in [-7, 7] rad, got 150",
    ),
    "no such file": (
        VESSEL.replace("barge.csv", "large.csv"),
        "vessel.raos: no such file: 'large.csv' (looked for ",
    ),
    "no such place": (
        VESSEL.replace("y: 14 m", "z: 14 m"),
        "vessel.hook.y: is missing; it must be a length in [-200, 200] m",
    ),
    "a word that is none": (
        VESSEL.replace("heading", "headding"),
        "vessel.headding: unknown key; did you mean 'heading'?",
    ),
    "too fast": (
        VESSEL + "  speed: 80 kn\n",
        "vessel.speed: must be a speed in [-10, 25] m/s, got '80 kn' (41.1556 m/s)",
    ),
    "a current without its heading": (
        VESSEL + "  current: {speed: 1}\n",
        "vessel.current.heading: is missing; it must be an angle in [-7, 7] rad",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_told_with_its_field(write, name):
    text, sentence = WRONG[name]
    with pytest.raises(InputError) as caught:
        load_case(write(text))
    assert sentence in str(caught.value)
    assert "my.yaml:" in str(caught.value)


def test_a_file_of_another_kind_is_told_with_its_field(write, tmp_path):
    case = load_case(write(VESSEL))
    (tmp_path / "barge.csv").write_text("nothing,of,the,kind\n")
    with pytest.raises(InputError, match=r"my\.yaml: vessel\.raos: .*stillhook vessel import"):
        HookMotion.from_case(case)


def test_a_heading_that_was_not_computed_is_told_with_its_field(write, tmp_path):
    from dataclasses import replace

    found = barge()
    some = replace(found, heading=found.heading[:7], values=found.values[:, :7])
    write_raos(tmp_path / "barge.csv", some)
    path = write(VESSEL.replace("150 deg", "200 deg"))
    write_raos(tmp_path / "barge.csv", some)
    with pytest.raises(InputError, match=r"vessel\.heading: .*no RAO for waves towards 200 deg"):
        HookMotion.from_case(load_case(path))


def test_setting_one_form_drops_the_other(tmp_path):
    case = barge_case(tmp_path, vessel_speed=1.0)
    table = {"omega": [0.2, 2.0], "amplitude": [1.0, 0.3]}
    back = case.replace({"vessel.heave_rao": table})
    assert (back.vessel.raos, back.vessel.hook, back.vessel.speed) == (None, None, None)
    again = back.replace(
        {
            "vessel.raos": case.vessel.raos,
            "vessel.hook": {"x": -25.0, "y": 14.0, "z": 20.0},
            "vessel.heading": "150 deg",
            "vessel.speed": 1.0,
        }
    )
    assert again == case


def test_a_file_that_changes_is_read_again(tmp_path):
    from dataclasses import replace

    case = barge_case(tmp_path)
    first = vessel_raos(case.vessel)
    assert vessel_raos(case.vessel) is first  # read once
    before = HookMotion.from_case(case).displacement.rms
    write_raos(tmp_path / "barge.csv", replace(first, values=0.5 * first.values))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PhysicsWarning)  # half a barge floats strangely
        after = HookMotion.from_case(case).displacement.rms
    assert after == pytest.approx(0.5 * before, rel=0.02)


def test_the_operator_is_that_of_the_wave_at_the_hook(tmp_path):
    case = barge_case(tmp_path)
    rao = hook_rao(case.vessel)
    found = heave_operators(barge(), (-25.0, 14.0, 20.0), np.radians([150.0]))[:, 0]
    np.testing.assert_allclose(rao.response(barge().omega), found, atol=1e-5)
    assert abs(complex(rao.response(0.01)) - 1.0) < 0.02


def test_short_crested_seas_mix_the_headings(tmp_path):
    case = barge_case(tmp_path, sea__spreading={"kind": "cos-2s", "exponent": 10.0})
    rao = hook_rao(case.vessel, case.sea.to_spectrum().spreading)
    # By hand, with another rule than the law's own nodes.
    angles = np.linspace(-math.pi, math.pi, 721)[:-1]
    weights = Spreading(kind="cos-2s", exponent=10.0).density(angles) * (angles[1] - angles[0])
    operators = heave_operators(barge(), (-25.0, 14.0, 20.0), math.radians(150.0) + angles)
    squares = np.abs(operators) ** 2 @ weights
    np.testing.assert_allclose(rao.amplitude**2, squares, atol=0.004 * squares.max())
    by_hand = np.trapezoid(squares * HookMotion.from_case(case).sea.density(rao.omega), rao.omega)
    assert HookMotion.from_case(case).displacement.m0 == pytest.approx(by_hand, rel=3e-3)
    narrow = barge_case(tmp_path, sea__spreading={"kind": "cos-2s", "exponent": 500.0})
    long = HookMotion.from_case(barge_case(tmp_path)).displacement.rms
    assert HookMotion.from_case(narrow).displacement.rms == pytest.approx(long, rel=0.01)
    assert HookMotion.from_case(case).displacement.rms != pytest.approx(long, rel=0.01)


def test_what_else_moves_in_the_sea_meets_the_same_waves(tmp_path):
    still, moving = barge_case(tmp_path), barge_case(tmp_path, vessel_speed=2.0)
    for make in (boat_motion, lambda case: surface_motion(case, 4.0)):
        at_rest, met = make(still).hook, make(moving).hook
        assert met.displacement.rms == pytest.approx(at_rest.displacement.rms, rel=1e-6)
        assert met.velocity.rms > 1.1 * at_rest.velocity.rms


def test_much_outside_the_table_is_told_with_the_right_field(tmp_path):
    case = barge_case(tmp_path, sea__peak_period=3.2, sea__significant_height=0.4)
    with pytest.warns(PhysicsWarning, match=r"vessel\.raos: .* lies outside the table"):
        HookMotion.from_case(case)


def test_lines_between_coarse_headings_are_told_with_their_error(write, tmp_path):
    ship = read_raos("osv-83m")
    coarse = replace(ship, heading=ship.heading[::3], values=ship.values[:, ::3])
    write_raos(tmp_path / "coarse.csv", coarse)
    vessel = "vessel:\n  raos: coarse.csv\n  hook: {x: -32, y: 12, z: 20}\n  heading: 105 deg\n"
    case = load_case(write(vessel))
    with pytest.warns(PhysicsWarning, match="up to 45 deg apart") as told:
        found = HookMotion.from_case(case).displacement.rms
    (words,) = (str(w.message) for w in told)
    full = load_case(write(vessel.replace("coarse.csv", "osv-83m")))
    true = HookMotion.from_case(full).displacement.rms
    error = float(re.search(r"are ([\d.]+)% low", words)[1]) / 100.0
    assert 0.2 < 1.0 - found / true < 0.24
    assert 0.13 < error < 0.17
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        HookMotion.from_case(load_case(write(vessel.replace("105", "180"))))  # a row of the table
