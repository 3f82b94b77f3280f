"""Designs that several test files look at, each made once per process."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

from former_cases import load_case

from models.case import Case
from synth import Design, evaluate_gains
from synth.design import LimitUse
from synth.question import pose

#: A reference unit and a load cell without errors, as changes of a case.
PERFECT_MRU = {"sensors.mru": {"noise_floor": 0.0, "noise_fraction": 0.0}}
PERFECT_CELL = {"sensors.load_cell": {"bandwidth": 1e5}}
THESIS_GAINS = {"A": 200.0, "a": 50.0, "a1": 100.0, "a2": 100.0}


@cache
def thesis_design() -> Design:
    """The thesis's own gains on its own model: stable, M_s 5.15 against a limit of 2."""
    return evaluate_gains(load_case("thesis-1975"), THESIS_GAINS)


@cache
def unstable_design() -> Design:
    """The same with the sign of the amplifier turned."""
    return evaluate_gains(load_case("thesis-1975"), {**THESIS_GAINS, "A": -200.0})


@cache
def loopless_design() -> Design:
    """What a search that finds nothing stable hands over: no gains, no margins."""
    status = "no stabilising gains were found"
    return replace(unstable_design(), parameters={}, status=status, verification=None)


@cache
def infeasible_design() -> Design:
    """A design for a calmer sea than asked for, with what the drive would have to be."""
    calm = load_case("thesis-1975").replace({"sea.significant_height": 0.5})
    design = evaluate_gains(calm, {"A": 200.0, "a": 21.908422, "a1": 12.003924, "a2": 68.339717})
    limits = {
        name: replace(use, enforced=True) if name.startswith("motor") else use
        for name, use in design.limits.items()
    }
    torque: LimitUse = limits["motor.torque.peak"]
    limits["motor.torque.peak"] = replace(torque, value=torque.bound, use=1.0)
    return replace(
        design,
        case=load_case("thesis-1975"),
        ok=False,
        status="not feasible at H_s 2.44 m: motor.torque.peak breaks first",
        limits=limits,
        required={"motor.torque.peak": 13012.0},
    )


def structure_design(
    case: Case, structure: str, parameters: Mapping[str, float], masses: int | None = None
) -> Design:
    """Parameters of a structure as a design, found by nobody and not verified."""
    question = pose(case, structure, masses)
    view = question.assess(parameters)
    drag, friction = question.equivalents(view.coefficients)
    return Design(
        case=case,
        structure=structure,
        parameters=dict(parameters),
        units={p.name: p.unit for p in question.law.parameters},
        ok=True,
        status="given",
        significant_height=case.sea.significant_height,
        payload_rms=view.sigma("payload.displacement"),
        payload_rms_before=question.payload_rms_before,
        hook_rms=float(question.hook.displacement.rms),
        shares={},
        margins=view.margins if view.stable else None,
        limits={},
        drag=drag,
        friction=friction,
        drag_before=question.drag_before,
        masses=question.masses,
    )
