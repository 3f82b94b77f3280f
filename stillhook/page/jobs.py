"""What a worker process does: searches, the capability, runs in time, the report.

    (name, arguments) --> one function here, with `tell(stage, done, total)` --> what it returns

These take seconds to minutes.  A worker has nothing of the page: a case and a design go in as
values, plain results come out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from models.basics import InputError
from models.case import Case
from synth.design import Design

from ..text import Progress
from .strip import Moving, moving_of

_PERIODS = 8  # of the capability
_SHORTEST, _LONGEST = 5.0, 16.0  # of them [s]


@dataclass(frozen=True, kw_only=True)
class Capability:
    """The limiting H_s over T_p of one design on one rope."""

    periods: tuple[float, ...]  #: Peak periods, ascending (p,) [s]; none where there is no answer.
    heights: tuple[float, ...]  #: Limiting H_s (p,) [m]; infinite where nothing binds.
    held: tuple[float, ...]  #: The same with the drum held (p,) [m].
    binding: tuple[str, ...]  #: Name of the limit that binds (p,).
    note: str = ""  #: Why there is none.


def optimise(
    case: Case,
    structure: str | None,
    parameters: Mapping[str, float] | None,
    starts: int,
    tell: Progress,
) -> Design:
    """Return the best design of a structure, or of those that are tried where none is named.

    The parameters on the page are one of the starts, so that the answer is never worse.
    """
    from synth.design import optimise_gains

    guesses = () if parameters is None else (parameters,)
    return optimise_gains(case, structure, starts=starts, progress=tell, guesses=guesses)


def verified(case: Case, structure: str, parameters: Mapping[str, float], tell: Progress) -> Design:
    """Return a design of given parameters, checked by code that the search does not use."""
    from synth.design import evaluate_gains

    tell("check", 0, 1)
    return evaluate_gains(case, parameters, structure)


def capability(
    case: Case, structure: str, parameters: Mapping[str, float], tell: Progress
) -> Capability:
    """Return in which seas a design can work, at the case's own heading and depth."""
    from synth.design import prepare
    from synth.operability import operability

    look = prepare(case, structure).evaluate(parameters)
    if not look.stable:
        return _no_capability("no stable loop, so there is no capability")
    own = case.sea.spectral_peak_period
    periods = np.linspace(min(_SHORTEST, own), max(_LONGEST, own), _PERIODS)
    headings = None if case.vessel.heading is None else [case.vessel.heading]
    try:
        study = operability(look, periods=periods.tolist(), headings=headings, progress=tell)
    except InputError as error:
        return _no_capability(str(error))
    found, held = (study.own_depth.contours[name] for name in ("loop", "held"))
    return Capability(
        periods=tuple(float(p) for p in found.periods),
        heights=tuple(float(h) for h in found.limit[0]),
        held=tuple(float(h) for h in held.limit[0]),
        binding=tuple(str(name) for name in found.binding[0]),
    )


def moving(
    case: Case, structure: str, parameters: Mapping[str, float], tell: Progress
) -> tuple[Moving, ...]:
    """Return a minute of hook, drum and load, with the design and then with predictive control."""
    from synth.design import prepare

    from ..runs import simulate

    look = prepare(case, structure).evaluate(parameters)
    if not look.stable:
        raise InputError("page: the loop is not stable, so there is nothing to simulate")
    found = []
    for name, controller in (("These gains", look), ("Predictive control (MPC)", "mpc")):

        def share(done: float, name: str = name) -> None:
            tell(name, round(100.0 * done), 100)

        share(0.0)
        try:
            runs = simulate(case, controller, duration=180.0, store_step=0.1, progress=share)
        except InputError as error:
            # Not every case has the sensors that predictive control hears.
            if controller is look:
                raise
            found.append(Moving.missing(name, str(error)))
            continue
        found.append(moving_of(name, runs[0]))
    return tuple(found)


def report(
    case: Case, structure: str, parameters: Mapping[str, float], folder: str, tell: Progress
) -> bytes:
    """Return the report on a design as HTML; `folder` is an empty one to write it in."""
    from synth.design import evaluate_gains

    from ..report import write_report

    tell("check", 0, 1)
    design = evaluate_gains(case, parameters, structure)
    write_report(folder, design=design, bound=False, progress=tell)
    return Path(folder, "report.html").read_bytes()


JOBS: Mapping[str, Callable[..., Any]] = {
    "optimise": optimise,
    "verified": verified,
    "capability": capability,
    "moving": moving,
    "report": report,
}


def _no_capability(why: str) -> Capability:
    return Capability(periods=(), heights=(), held=(), binding=(), note=why)
