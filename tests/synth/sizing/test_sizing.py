"""Sizing: the family of motors, the smallest one for a target, what stops it, and a catalogue."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest
from former_cases import load_case

import stillhook as sh
from models.basics import InputError
from synth.sizing import Sizing
from synth.sizing.catalogue import read_catalogue
from synth.sizing.motor import MotorData, with_motor
from synth.sizing.point import _next, target_of

pytestmark = pytest.mark.ci  # whole optimisations in fixtures

TARGET = 0.15
CALM = {"sea.significant_height": 1.0}
ROWS = [
    {"name": "small", "torque_continuous": 4.0e3, "torque_peak": 8.0e3, "inertia": 40.0},
    {"name": "large", "torque_continuous": 12.0e3, "torque_peak": 24.0e3, "inertia": 150.0},
    {"name": "middle", "torque_continuous": 8.0e3, "torque_peak": 18.0e3, "inertia": 98.0},
]


@pytest.fixture(scope="module")
def case() -> sh.Case:
    return load_case("thesis-1975").replace(CALM)


@pytest.fixture(scope="module")
def sizing(case: sh.Case) -> Sizing:
    return sh.size_winch(case, target=TARGET, gear=(24.0, 31.0), points=3, starts=2)


def test_a_motor_of_scale_one_is_the_case_itself() -> None:
    for name in ("thesis-1975", "subsea-crane"):
        case = load_case(name)
        assert with_motor(case, 1.0, case.winch.gearbox.ratio) == case


@pytest.mark.parametrize("scale", [0.8, 3.0])
def test_motors_of_the_family_keep_what_makes_them_similar(scale: float) -> None:
    for name in ("thesis-1975", "subsea-crane"):
        case = load_case(name).replace({"limits.drive": "report"})
        made = with_motor(case, scale, 50.0)
        old, new = MotorData.of(case), MotorData.of(made)
        assert made.winch.gearbox.ratio == 50.0
        assert new.power / old.power == pytest.approx(scale)
        assert new.speed == old.speed
        assert new.torque_peak / new.torque_continuous == pytest.approx(
            old.torque_peak / old.torque_continuous
        )
        # l^3 and l^5 of the same linear size
        assert (new.inertia / old.inertia) ** (1 / 5) == pytest.approx(scale ** (1 / 3))
        motor, before = made.winch.motor, case.winch.motor
        if motor.type == "dc" and before.type == "dc":
            current, rated = made.winch.drive.current_peak, case.winch.drive.current_peak
            assert current is not None
            assert rated is not None
            drop, was = motor.resistance * current, before.resistance * rated
            assert drop == pytest.approx(was)  # the same share of the same voltage
        elif motor.type == "ac" and before.type == "ac":
            box = case.winch.gearbox.inertia / before.inertia
            pace = motor.speed_gain / motor.inertia / (1.0 + box)
            assert pace == pytest.approx(before.speed_gain / before.inertia / (1.0 + box))


def test_a_target_is_a_length_a_share_or_a_reduction() -> None:
    assert target_of("20 mm", 0.5) == pytest.approx(0.02)
    assert target_of(0.02, 0.5) == 0.02
    assert target_of("4 %", 0.5) == pytest.approx(0.02)
    assert target_of("20 dB", 0.5) == pytest.approx(0.05)
    assert target_of("-20 dB", 0.5) == pytest.approx(0.05)
    for wrong in ("20 kg", "much", "x %", -0.1, 0.0):
        with pytest.raises(InputError, match="target"):
            target_of(wrong, 0.5)


def _first_root(function: object, start: float, rest: float = -10.0) -> float | None:
    known: list[tuple[float, float]] = []
    size: float | None = start
    for _ in range(40):
        assert size is not None
        over = function(size)  # type: ignore[operator]
        known.append((size, over))
        if abs(over) < 1e-3:
            return size
        size = _next(known, rest)
        if size is None:
            return None
    return None


@pytest.mark.parametrize("start", [-0.5, 0.0, 0.6, 1.0, 1.4, 3.0])
def test_the_smaller_of_two_scales_that_just_do_is_found(start: float) -> None:
    # f falls while the motor gains torque, and rises when its rotor takes it: roots 0.7 and 1.3
    root = _first_root(lambda x: (x - 0.7) * (x - 1.3), start)
    assert root is not None
    assert root == pytest.approx(0.7, abs=0.01) or start > 1.3
    assert root in (pytest.approx(0.7, abs=0.01), pytest.approx(1.3, abs=0.01))


@pytest.mark.parametrize("start", [-0.5, 0.0, 1.0, 2.0])
def test_a_motor_whose_rotor_takes_all_it_gains_is_given_up(start: float) -> None:
    assert _first_root(lambda x: (x - 1.0) ** 2 + 0.1, start) is None


def test_the_smallest_motor_meets_the_target_and_a_smaller_one_does_not(
    case: sh.Case, sizing: Sizing
) -> None:
    assert sizing.ok, sizing.status
    assert sizing.chosen is not None
    assert sizing.design is not None
    assert sizing.design.verification is not None
    assert sizing.design.verification.ok
    assert sizing.design.payload_rms <= TARGET * (1.0 + 1e-5)
    # The other route: a search from anywhere, on the motor itself.
    calm = case.replace({"limits.drive": "report"})
    for share, does in ((1.02, True), (0.97, False)):
        near = with_motor(calm, sizing.chosen.scale * share, sizing.chosen.gear)
        design = sh.optimise_gains(
            near.replace({"limits.drive": "enforce"}), "payload-feedback", starts=2
        )
        assert (design.ok and design.payload_rms <= TARGET) is does, (share, design.status)


def test_the_curve_falls_to_the_chosen_gear_and_rises_behind_it(sizing: Sizing) -> None:
    scales = [p.scale for p in sizing.points]
    at = scales.index(min(scales))
    assert all(a >= b for a, b in itertools.pairwise(scales[: at + 1]))
    assert all(a <= b for a, b in itertools.pairwise(scales[at:]))
    assert sizing.points[0].binding[0].startswith("motor.")
    assert len(scales) == 3
    assert sizing.chosen is not None
    assert min(scales) == sizing.chosen.scale  # the motor that the status tells
    assert "end of the range" not in sizing.status
    text = sizing.to_csv()
    assert text.count("\n") == len(sizing.points) + 1


def test_an_answer_at_the_end_of_the_range_says_so(case: sh.Case) -> None:
    found = sh.size_winch(case, target=TARGET, gear=(24.0, 26.0), points=4, starts=1)
    assert found.ok
    assert "; the gear stands at an end of the range, 24 to 26" in found.status
    assert [point.gear for point in found.points] == pytest.approx(
        [24.0, 24.649, 25.315, 26.0], 1e-4
    )


def test_gears_beyond_one_that_no_motor_can_do_are_told_too(case: sh.Case) -> None:
    found = sh.size_winch(case, target=TARGET, gear=(24.0, 60.0), points=6, starts=1)
    assert len(found.points) == 6
    assert [point.binding for point in found.points[-3:]] == [("motor.inertia",)] * 3


@pytest.mark.slow
def test_the_winch_as_it_is_meets_the_target_up_to_its_highest_sea(
    case: sh.Case, sizing: Sizing
) -> None:
    height = sizing.highest_height
    assert 0.0 < height < 1.0
    for share, does in ((0.99, True), (1.03, False)):
        sea = {"sea.significant_height": height * share, "limits.drive": "enforce"}
        design = sh.optimise_gains(case.replace(sea), "payload-feedback", starts=2)
        assert (design.ok and design.payload_rms <= TARGET) is does
    assert sizing.given_rms > TARGET


def test_a_target_below_what_margins_leave_is_met_by_no_motor(case: sh.Case) -> None:
    none = sh.size_winch(case, target="5 mm", gear=(24.0, 31.0), points=3, starts=2)
    assert not none.ok
    assert none.chosen is None
    assert none.unlimited_rms > 0.005
    assert "no motor" in none.status
    assert "max_sensitivity" in none.status


@pytest.mark.slow
def test_the_smallest_motor_that_does_it_is_taken_out_of_a_catalogue(case: sh.Case) -> None:
    found = sh.size_winch(
        case, target=TARGET, gear=(24.0, 31.0), points=3, starts=2, motors=ROWS[:2]
    )
    assert found.choice is not None, found.status
    assert found.choice.name == "large"
    assert found.choice.smaller == ("small",)
    assert found.ok, found.status
    assert found.sized_case is not None
    assert found.sized_case.winch.drive.torque_continuous == 12.0e3


def test_a_catalogue_is_read_smallest_first_and_wrong_rows_are_named(
    case: sh.Case, tmp_path: Path
) -> None:
    assert [m.name for m in read_catalogue(ROWS, case)] == ["small", "middle", "large"]
    path = tmp_path / "motors.csv"
    path.write_text(
        "# illustrative\nname, torque_continuous, torque_peak, inertia\n"
        "M, 8 kN m, 18 kN m, 98 kg m2\nS, 4 kN m, 8 kN m, 40 kg m2\n"
    )
    read = read_catalogue(path, case)
    assert [m.name for m in read] == ["S", "M"]
    for wrong, said in (
        ([], "at least one"),
        ([{**ROWS[0], "name": ""}], "name"),
        ([{**ROWS[0], "colour": 3}], "colour"),
        ([{"name": "x", "inertia": 2.0}], "torque_continuous"),
        ([{**ROWS[0], "type": "ac"}], "type"),
        ([{**ROWS[0], "inertia": "heavy"}], "inertia"),
    ):
        with pytest.raises(InputError, match=said):
            read_catalogue(wrong, case)
    with pytest.raises(InputError, match=r"missing\.csv"):
        read_catalogue(tmp_path / "missing.csv", case)


def test_ranges_that_fall_are_refused(case: sh.Case) -> None:
    with pytest.raises(InputError, match="gear"):
        sh.size_winch(case, target=0.1, gear=(30.0, 20.0))
    with pytest.raises(InputError, match="points"):
        sh.size_winch(case, target=0.1, points=1)
