"""How far the numbers about a design may be off: `sh.robustness` and `stillhook margins`."""

from __future__ import annotations

import math
from functools import cache

import pytest
from designs import unstable_design

import stillhook as sh
from models import load_case
from models.basics import InputError
from stillhook.cli import main
from synth.robust import robustness

GAINS = {"A": 1.0, "a": 4394.0, "a1": 2393.0, "a2": 13691.0}
RANGES = {"payload.mass": 0.3, "stiffness": 0.2, "drag": 0.5, "delay": 0.5}


@cache
def late_design() -> sh.Design:
    case = load_case("thesis-1975").replace({"sensors.telemetry.delay": 0.02})
    return sh.evaluate_gains(case, GAINS)


def test_delay_alone_reaches_the_delay_margin() -> None:
    design = late_design()
    found = robustness(design, {"delay": 0.5}, draws=0)
    assert design.margins is not None
    later = found.critical["sensors.telemetry.delay"] - 0.02
    assert later == pytest.approx(design.margins.delay, rel=1e-6)
    assert found.found == pytest.approx(design.margins.delay / 0.01, rel=1e-6)
    assert found.confirmed
    assert found.ok
    assert found.stable is None


def test_gains_alone_reach_their_exact_radius() -> None:
    found = robustness(late_design(), {"gains": 0.1}, draws=200)
    assert found.gain_radius is not None
    assert found.found == pytest.approx(found.gain_radius.box / 0.1, rel=1e-6)
    own = late_design().question.amplifier  # the law's gains go with its own A
    assert own is not None
    nearest = {name.removeprefix("gains."): a / own for name, a in found.critical.items()}
    assert nearest == pytest.approx(dict(found.gain_radius.worst_box), rel=1e-5)
    assert found.omega == pytest.approx(2.145, rel=1e-2)
    one = robustness(late_design(), {"gains.a": 0.1}, draws=0)
    assert one.found > found.found


def test_nearest_plant_is_unstable_and_none_within_is() -> None:
    found = robustness(late_design(), RANGES, draws=2000)
    assert found.confirmed
    assert found.growth > 0.0
    assert not found.ok
    assert "unstable within the ranges" in str(found)
    assert found.stable is not None
    assert found.stable.count == found.stable.total == 2000
    assert found.worst_rms > found.payload_rms == late_design().payload_rms
    assert found.margins.disk == late_design().margins.disk
    # The critical case, written down as anyone would: unstable a little beyond, stable before.
    nominal = {path: 0.5 * (low + high) for path, (low, high) in found.ranges.items()}
    for times, stable in ((1.02, False), (0.97, True)):
        values = {path: own + times * (found.critical[path] - own) for path, own in nominal.items()}
        drag = values.pop("drag")
        virtual = values["payload.mass"] / late_design().case.payload.mass
        values["payload.added_mass"] = virtual * late_design().case.payload.hydrodynamic_mass
        values["payload.drag"] = {"method": "given", "coefficient": drag}
        there = sh.evaluate_gains(late_design().case.variant(values), GAINS)
        assert (there.margins is not None) == stable


def test_no_local_search_finds_a_nearer_one() -> None:
    # By the structured singular value: proved stable up to 0.6929 times the ranges, and the
    # nearest zero of det(I - M Delta) by sequential programming at 0.7203114 times.
    found = robustness(late_design(), RANGES, draws=0)
    assert found.found == pytest.approx(0.7203114, rel=1e-5)


def test_nearest_values_within_a_face_are_found_from_any_seed() -> None:
    ranges = {"payload.mass": 0.1, "delay": "60 ms", "gains.a": 0.3}
    one, other = (robustness(late_design(), ranges, draws=0, seed=seed) for seed in (0, 7))
    assert one.found == pytest.approx(other.found, rel=1e-5)
    off = {
        path: (one.critical[path] - 0.5 * (low + high)) / (0.5 * one.found * (high - low))
        for path, (low, high) in one.ranges.items()
    }
    assert min(abs(x) for x in off.values()) < 0.5 < max(abs(x) for x in off.values())


@pytest.mark.slow
def test_none_of_ten_thousand_draws_inside_is_unstable() -> None:
    found = robustness(late_design(), RANGES, draws=10_000, seed=3)
    assert found.stable is not None
    assert (found.stable.total, found.stable.count) == (10_000, 10_000)


def test_ranges_that_nothing_can_upset() -> None:
    found = robustness(late_design(), {"payload.drag_coefficient": 0.01}, draws=20)
    assert math.isinf(found.found)
    assert found.ok
    assert (found.critical, found.confirmed) == ({}, None)
    assert "up to 20 times them" in found.status


@pytest.mark.slow
def test_a_structure_is_analysed_as_gains_are() -> None:
    case = load_case("thesis-1975").replace({"sensors.telemetry.delay": 0.02})
    design = sh.optimise_gains(case, "payload-feedback", starts=2)
    ranges = {"payload.mass": 0.2, "drag": 0.5, "gains": 0.1}
    one = robustness(design, ranges, draws=20)
    other = robustness(sh.evaluate_gains(case, design.parameters), ranges, draws=20)
    assert one.found == pytest.approx(other.found, rel=1e-6)


@pytest.mark.parametrize(
    ("ranges", "message"),
    [
        ({}, "must name what may be off"),
        ({"payload.colour": 0.1}, "payload.colour is unknown"),
        ({"payload.mass": 1.5}, r"uncertainty\[payload.mass\] must be"),
        ({"payload.mass": -0.1}, r"uncertainty\[payload.mass\] must be"),
        ({"payload.mass": "5 s"}, "robustness: payload.mass"),
        ({"payload.mass": 0.1, "payload": 0.2}, "given twice"),
        ({"gains.b": 0.1}, "gains.b is unknown"),
        ({"sensors.mru.delay": 0.1}, "sensors.mru.delay"),
    ],
)
def test_ranges_without_meaning_are_refused(ranges: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        robustness(late_design(), ranges)


def test_an_unstable_design_and_a_share_of_nothing_are_refused() -> None:
    with pytest.raises(InputError, match="must be stable"):
        robustness(unstable_design(), {"payload.mass": 0.1})
    no_delay = sh.evaluate_gains(load_case("thesis-1975"), GAINS)
    with pytest.raises(InputError, match="a share of it is nothing"):
        robustness(no_delay, {"delay": 0.5})
    late = robustness(no_delay, {"delay": "5 ms"}, draws=0)
    assert late.ranges == {"sensors.telemetry.delay": (0.0, 0.005)}


def test_margins_command(capsys: pytest.CaptureFixture[str]) -> None:
    gains = ",".join(f"{k}={v:g}" for k, v in GAINS.items())
    words = ["margins", "thesis-1975", "--gains", gains, "--draws", "20"]
    assert main([*words, "--off", "payload.mass=0.1", "--off", "drag=0.2"]) == 0
    told = capsys.readouterr().out
    assert "stable over the ranges; the nearest unstable" in told
    assert "20 of 20 random draws inside are stable" in told
    assert "--vary payload.mass=" in told
    assert main([*words, "--off", "payload.mass=0.4", "--off", "stiffness=0.4", "--quiet"]) == 1
    assert "unstable within the ranges" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["thesis-1975", "--off", "payload.mass"], "--off: must be PATH=SHARE"),
        (["thesis-1975", "--off", "a=1", "--off", "a=2"], "a is given twice"),
        (["thesis-1975", "--draws", "-1"], "--draws must be"),
        (["thesis-1975", "--design", "x", "--gains", "a=1,a1=1,a2=1"], "not both"),
    ],
)
def test_margins_command_refuses(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["margins", *words]) == 2
    assert message in capsys.readouterr().err


def test_ranges_from_the_command_line(capsys: pytest.CaptureFixture[str]) -> None:
    off = ["--off", "payload.mass=0.3", "--off", "delay = 20 ms"]
    assert main(["margins", "thesis-1975", *off, "--draws", "10"]) == 1
    told = capsys.readouterr().out
    assert "payload.mass: 25790.8 to 47897.2" in told
    assert "sensors.telemetry.delay: 0 to 0.02" in told
