"""`SimulationRequest`: the request of `stillhook simulate`, read and checked before any run."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from typing import TYPE_CHECKING

from models import Case
from models.basics import InputError, pick

from ...controllers import CONTROLLER_TEXTS
from ...text import told_once
from ..given import given_case, parse_gains, parse_options
from ..lists import quantity

if TYPE_CHECKING:
    from models.operation import MotionSource, Scenario
    from models.simulation import SimulationOptions
    from synth.design import Design

TIME = quantity("time", 0.0, 1e8, open_low=True)  #: Reads a time span [s].


@dataclass(frozen=True, kw_only=True)
class SimulationRequest:
    """What is to be simulated."""

    #: Case and operation.
    case: Case
    scenario: Scenario
    controllers: tuple[str, ...]  #: Names of the controllers.
    #: Whether all were asked for, so that one that the case does not allow may be left out.
    every: bool
    #: Seeds of the runs, and their length [s].
    seeds: range
    duration: float
    design: Design | None  #: Of the feedback, if given.
    sample_time: float | None  #: Of the controllers [s]; None: their own.
    how: SimulationOptions  #: How to simulate.


def asked_of(arguments: argparse.Namespace) -> SimulationRequest:
    """Return what the arguments ask for.

    Raises InputError if any of it is wrong.
    """
    from models.operation import scenario_named
    from models.simulation import SimulationOptions

    names = parse_controllers(arguments.controller)
    options = parse_options(arguments.option)
    case = given_case(arguments)
    scenario = scenario_named(arguments.scenario, case, **options)
    hook = _hook(arguments)
    lasting = arguments.duration
    if arguments.hours is not None:
        lasting = 3600.0 * arguments.hours
    if lasting is None:
        lasting = _fitting(scenario.duration, hook, arguments.sample_time)
    first = arguments.first_seed
    return SimulationRequest(
        case=case,
        scenario=scenario,
        controllers=names,
        every=arguments.controller == "all",
        seeds=range(first, first + arguments.seeds),
        duration=lasting,
        design=_design(arguments, case),
        sample_time=arguments.sample_time,
        how=SimulationOptions(
            hook=hook,
            duration=lasting,
            masses=arguments.masses,
            compiled=None if arguments.compile else False,  # as the machine can
            step=arguments.step,
            settle=arguments.settle,
            store_step=arguments.store_step,
            lock_limit=arguments.lock_limit,
        ),
    )


def parse_controllers(text: str) -> tuple[str, ...]:
    """Return names of controllers from a text: one, several with commas between, or all.

    All are those that need no tuning: the predictive ones have to be named.

    Raises InputError if there is no such controller, or one is named twice.
    """
    known = tuple(CONTROLLER_TEXTS)
    if text == "all":
        return tuple(name for name in known if "mpc" not in name)
    names = tuple(name.strip() for name in text.split(","))
    pick("--controller", "controller", known, names)
    if len(set(names)) != len(names):
        raise InputError(f"--controller: each may be named once, got {text!r}")
    return names


def sine(option: str, text: str) -> MotionSource:
    """Return a sine from a text AMPLITUDE,PERIOD."""
    from models.operation import SineMotion

    parts = text.split(",")
    if len(parts) != 2:
        raise InputError(f"{option}: must be AMPLITUDE,PERIOD, as in '0.5 m, 8 s', got {text!r}")
    amplitude = quantity("length", 0.0, 1e5, open_low=True)(f"{option}: amplitude", parts[0])
    return SineMotion(amplitude=amplitude, period=TIME(f"{option}: period", parts[1]))


def _hook(arguments: argparse.Namespace) -> MotionSource | None:
    from models.operation import RecordMotion

    if arguments.tip is not None and arguments.hook is None:
        raise InputError("--tip: belongs to --hook, a file with heave, roll and pitch")
    if arguments.hook is None:
        found: MotionSource | None = arguments.sine
        return found
    with told_once():
        return RecordMotion.read(arguments.hook, tip=arguments.tip)


def _fitting(lasting: float, hook: MotionSource | None, sample_time: float | None) -> float:
    """Return the length of a run that a record is long enough for."""
    length = getattr(hook, "duration", None)
    if length is None:
        return lasting
    # The last sample needs the motion up to its end.
    return float(min(lasting, length - max(0.1, 2.0 * (sample_time or 0.0))))


def _design(arguments: argparse.Namespace, case: Case) -> Design | None:
    if arguments.design is None:
        if arguments.gains is None:
            return None
        from synth import evaluate_gains

        structure = arguments.structure or "payload-feedback"
        return evaluate_gains(case, parse_gains(arguments.gains, structure), structure)
    if arguments.structure is not None:
        raise InputError("simulate: give --design, or --structure and --gains, not both")
    import sys

    from ...designs import load_design

    design = load_design(arguments.design)
    if design.case.name != case.name:
        print(
            f"warning: {arguments.design}: is a design for {design.case.name}, not {case.name}",
            file=sys.stderr,
        )
    return design
