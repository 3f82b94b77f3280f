"""What is worth buying: elasticities by two routes, the order, and what is for sale."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from former_cases import load_case

import stillhook as sh
from synth.sizing import Worth
from synth.sizing.follow import follow, posed
from synth.sizing.purchase import part_items
from synth.structures import structure_named

pytestmark = pytest.mark.ci  # whole optimisations in fixtures

LATE = {"sensors.telemetry.delay": "50 ms"}
HARD = {
    "sea.significant_height": 1.0,
    "limits.drive": "enforce",
    "winch.drive.torque_peak": 13e3,  # so that the current alone binds, not both at once
}


@pytest.fixture(scope="module")
def late() -> Worth:
    return sh.worth(load_case("thesis-1975").replace(LATE), starts=8)


def test_elasticities_are_the_multipliers_of_the_limits() -> None:
    case = load_case("thesis-1975").replace(HARD)
    design = sh.optimise_gains(case, "payload-feedback", starts=2)
    problem = posed(case, "payload-feedback", design.masses).problem
    here = follow(problem, [np.array(design.question.values(design.parameters))])
    assert here is not None
    found = sh.worth(design, starts=1)
    (current,) = (row for row in found.rows if row.item.name == "motor.current.peak")
    # A few per cent are what the curve bends over a step of 5 %.
    assert abs(current.elasticity) > 0.1
    assert abs(current.elasticity) == pytest.approx(abs(here.prices["motor.current.peak"]), rel=0.1)


def test_elasticities_are_what_optimising_anew_gives(late: Worth) -> None:
    assert late.first is not None
    assert late.first.item.name == "telemetry delay"
    less = load_case("thesis-1975").replace({"sensors.telemetry.delay": 0.05 * math.exp(-0.05)})
    design = sh.optimise_gains(less, "payload-feedback", starts=8)
    share = math.log(design.payload_rms / late.payload_rms) / -0.05
    assert late.first.elasticity == pytest.approx(share, rel=1e-2)


def test_the_first_thing_to_buy_is_the_delay_and_no_margin(late: Worth) -> None:
    assert late.ok
    assert late.first is not None
    assert late.first.item.name == "telemetry delay"
    assert late.rows[0].item.kind == "margin"  # larger, but not for sale
    assert "buy first: telemetry delay" in late.status
    gains = [row.gain for row in late.rows]
    assert gains == sorted(gains, reverse=True)
    assert late.to_csv().count("\n") == len(late.rows) + 1


def test_twice_as_good_is_the_optimum_of_that_case(late: Worth) -> None:
    half = load_case("thesis-1975").replace({"sensors.telemetry.delay": "25 ms"})
    design = sh.optimise_gains(half, "payload-feedback", starts=8)
    assert late.first is not None
    assert late.first.twice_rms == pytest.approx(design.payload_rms, rel=1e-3)
    # 10 ms less: near the slope, with what the curve bends
    ten = load_case("thesis-1975").replace({"sensors.telemetry.delay": "40 ms"})
    less = sh.optimise_gains(ten, "payload-feedback", starts=8).payload_rms
    assert late.first.per_step == pytest.approx(less - late.payload_rms, rel=0.1)


def test_what_is_for_sale_is_what_the_structure_hears() -> None:
    case = load_case("subsea-crane")
    names = {}
    for name in ("payload-feedback", "feed-forward", "constant-tension"):
        heard = structure_named(name, case).measurements
        names[name] = {item.name for item in part_items(case, heard, 0.5)}
    assert "telemetry delay" in names["payload-feedback"]
    assert "MRU error" not in names["payload-feedback"]
    assert {"MRU error", "MRU delay"} <= names["feed-forward"]
    assert "telemetry delay" not in names["feed-forward"]
    assert "load cell noise" in names["constant-tension"]
    assert all("gear ratio" in found for found in names.values())
    assert all("motor, all of it" in found for found in names.values())


def test_a_drive_that_is_too_small_is_said_before_anything_is_priced() -> None:
    small = {"limits.drive": "enforce", "winch.drive.torque_peak": "5.95 kN m"}
    result = sh.worth(load_case("thesis-1975").replace(small), starts=1)
    assert not result.ok
    assert result.rows == ()
    assert "motor.torque.peak breaks first" in result.status


def test_nothing_that_is_sold_is_worth_it_where_only_margins_bind(late: Worth) -> None:
    kept = tuple(row for row in late.rows if not row.item.sold)
    assert replace(late, rows=kept).first is None
    assert all(math.isfinite(row.gain) for row in late.rows)
