"""`sh.failure_modes`: what the load does when a sensor, the link, drive, power or brake fails.

    case, controller --> undisturbed, drum held, one failure at a time (KINDS), over seeds
                     --> FailureModes --> table, sheet, data (`stillhook.runs.failure_tables`)

The load is held in its place in the case's own sea, and in one seed every failure meets the same
waves and the same noise.  It begins at the moment at which the undisturbed drum of that seed turns
fastest: at another the first seconds would be a matter of luck.  All are judged over the same
windows, beside the undisturbed load and the load on a drum that its brake holds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from models.basics import InputError, StillhookError, check_range, one_thread, shows_progress
from models.case import Case
from models.casefile import suggestion
from models.operation import Scenario, scenario_named
from models.run import Event, Run
from models.sensing import STATUSES, Controller, heard_by, holds_brake
from models.simulation import EASE, SimulationOptions

from ..controllers import controller_of
from ..text import count, duration, number, quantity
from .failure_effects import (
    FIRST,
    MISHAPS,
    Afterwards,
    FirstSeconds,
    Reference,
    Seen,
    after_of,
    first_of,
    severity_of,
    trips_of,
)
from .failure_kinds import KINDS, FailureKind, concerns, safeguard
from .simulation import Series, seconds_of, seeds_of
from .window import error_of

if TYPE_CHECKING:
    from synth.design import Design, Tuning

    from ..text import Progress

RETURN = 120.0  #: Time after its end in which the load may come back [s].
BEGIN = 2.0 * EASE  #: From when on the moment of a failure is sought [s].
BACK = 2.0  #: A load is back once it moves so many times its undisturbed rms at most.

_SHORT_OF = 0.01  # of the time more that the drive does less than asked: worth telling [-]
_TOLD = 0.1  # of a controller's status, more than undisturbed: worth telling [s]
_LONGEST = 86400.0


@dataclass(frozen=True, kw_only=True)
class FailureMode:
    """One thing that fails, and what comes of it.

    What the controller does not hear is not run: then the numbers are None, and texts about them
    are empty.
    """

    identifier: str  #: A word for programs, such as ``mru-lost``.
    item: str  #: What fails.
    failure: str  #: How it fails.
    not_run: str = ""  #: Why it was not run; empty if it was.
    shows: str = ""  #: How it shows: the flag of the signal, then what the controller told in runs.
    safeguard: str = ""  #: What our own logic does about it.
    lasting: float = math.nan  #: How long it lasted [s]; infinite if it does not end.
    first: FirstSeconds | None = None
    after: Afterwards | None = None
    #: Time from its end until the load is back, the longest of the seeds [s]: until its rms over a
    #: peak period of the sea is at most twice the undisturbed; None if it is not two minutes later.
    recovery: float | None = None
    #: By numbers.  "none": distances and rms are at most 1.2 times the undisturbed; "minor": at
    #: most those of the load with the drum held; "major": beyond; "critical": in more seeds than
    #: undisturbed the rope went slack or beyond the limit of its tension, lock was lost, the brake
    #: had to stop the drum, or the run diverged.
    severity: str = ""
    effect: str = ""  #: What the load does in the first 5 s, and after.

    @property
    def ran(self) -> bool:
        """Whether it was run."""
        return self.first is not None


@dataclass(frozen=True, kw_only=True, eq=False)
class FailureModes:
    """What the load does when one thing at a time fails."""

    case: Case
    controller: str  #: Name of the controller.
    seeds: tuple[int, ...]
    moments: tuple[float, ...]  #: When things failed, in each seed [s].
    lasting: float  #: How long a failure lasts that ends [s].
    duration: float  #: Length of a run [s].
    undisturbed: Reference  #: Nothing fails.
    held: Reference  #: The drum is held by its brake from the start.
    modes: tuple[FailureMode, ...]

    def __getitem__(self, identifier: str) -> FailureMode:
        """Return a failure by its identifier; an `InputError` names the closest there are."""
        found = {mode.identifier: mode for mode in self.modes}
        if identifier not in found:
            near = suggestion(identifier, list(found))
            raise InputError(f"failure modes: there is no {identifier!r}; {near}")
        return found[identifier]

    @property
    def complete(self) -> bool:
        """Whether everything that concerns the controller was run: Ctrl-C leaves out the rest."""
        return not any(mode.not_run == _INTERRUPTED for mode in self.modes)

    def __str__(self) -> str:
        """Return the failures as a small tree."""
        lines = [headline(self), *(references(self))]
        for mode in self.modes:
            told = f"{mode.severity}; {mode.effect}" if mode.ran else mode.not_run
            lines.append(f"{mode.item}, {mode.failure}: {told}")
        marks = ["", *["├ "] * (len(lines) - 2), "└ "]
        return "\n".join(mark + line for mark, line in zip(marks, lines, strict=True))


_INTERRUPTED = "not run: interrupted"


def headline(modes: FailureModes) -> str:
    """Return what was asked."""
    ran = count(sum(mode.ran for mode in modes.modes), "failure")
    seeds = count(len(modes.seeds), "seed")
    return (
        f"{modes.case.name}, {modes.controller}: {ran} of {duration(modes.lasting)} in {seeds}, "
        "each where the drum turns fastest"
    )


def references(modes: FailureModes) -> list[str]:
    """Return a line about the undisturbed load, and one about the drum held."""
    return [
        f"{name}: {quantity(each.rms, 'm')} rms, {quantity(each.largest, 'm')} at most"
        for name, each in (("undisturbed", modes.undisturbed), ("drum held", modes.held))
    ]


@shows_progress("failures")
def failure_modes(
    case: Case,
    controller: str | Design | Tuning | Controller = "feedback",
    *,
    seeds: int | Sequence[int] = 3,
    lasting: float | str = 60.0,
    wait: float | str = 180.0,
    compiled: bool | None = None,
    progress: Progress | None = None,
) -> FailureModes:
    """Let one thing at a time fail while the load is held in its place, and see what it does.

    Three seeds of a linear controller take under half a minute of processor time on the bundled
    cases, and some seconds more where its loops are not compiled yet; predictive control, whose
    steps are Python's, takes one or two minutes.

    Parameters
    ----------
    case
        Vessel, sea, rope, payload, winch and sensors.
    controller
        As for `sh.simulate`: a name, a design, or an object.
    seeds
        How many runs of each failure, or their seeds.
    lasting
        How long a failure lasts [s], 5 s at the least, or a text with a unit.  An encoder or a
        drive that is lost stays so.
    wait
        Until when the moment of the failure is sought [s], from 60 s on.
    compiled
        As for `sh.simulate`.
    progress
        Called as progress(what, done, total), in runs.

    Returns
    -------
    FailureModes
        After Ctrl-C with the failures that there are, if the undisturbed load and the drum held
        are among them.

    Raises
    ------
    InputError
        If an argument is out of range, or a name is unknown.
    SynthesisError
        If the controller is not stable on the linear plant of the case.
    SolverError
        If there is no static operating point, or the controller's recursion fails.
    KeyboardInterrupt
        If Ctrl-C comes before there is anything to compare a failure with.

    Notes
    -----
    The undisturbed runs are those of ``sh.simulate(case, controller, seeds=..., duration=...)``
    with the `duration` of the result, wait + lasting + 120 s; the drum held is controller "none".

    Examples
    --------
    >>> import stillhook as sh
    >>> case = sh.load_case("thesis-1975").replace({"sea.significant_height": 0.5})
    >>> found = sh.failure_modes(case, "feed-forward", seeds=1, lasting=20.0, wait=90.0)
    >>> found["mru-lost"].severity, found["payload-lost"].not_run
    ('minor', 'not heard by this controller')
    """
    owner = "failure_modes"
    numbers = seeds_of(owner, seeds)
    lasting = seconds_of(f"{owner}: lasting", lasting, high=_LONGEST)
    check_range(owner, "lasting", lasting, low=FIRST, unit="s")
    wait = seconds_of(f"{owner}: wait", wait, high=_LONGEST)
    check_range(owner, "wait", wait, low=BEGIN, unit="s", open_low=True)
    own = controller_of(controller, case)
    heard = heard_by(own)
    why = {kind.identifier: concerns(kind, own, heard) for kind in KINDS}
    total = len(numbers) * (1 + (not holds_brake(own)) + sum(not text for text in why.values()))
    bench = _Bench(
        case, own, numbers, lasting, wait + lasting + RETURN, compiled, progress or _quiet, total
    )
    modes: list[FailureMode] = []
    with one_thread():
        undisturbed, held = bench.references(wait)
        for kind in KINDS:
            mode = _unrun(kind, case, why[kind.identifier])
            try:
                if not mode.not_run:
                    mode = bench.mode(kind, undisturbed, held)
            except KeyboardInterrupt:
                break
            modes.append(mode)
    modes += [
        _unrun(kind, case, why[kind.identifier] or _INTERRUPTED) for kind in KINDS[len(modes) :]
    ]
    return FailureModes(
        case=case,
        controller=own.name,
        seeds=numbers,
        moments=tuple(bench.moments),
        lasting=lasting,
        duration=bench.duration,
        undisturbed=undisturbed,
        held=held,
        modes=tuple(modes),
    )


def _quiet(what: str, done: int, total: int) -> None:
    """Tell nobody."""


def _unrun(kind: FailureKind, case: Case, why: str) -> FailureMode:
    """Return a failure that was not run, and why."""
    return FailureMode(
        identifier=kind.identifier, item=kind.item, failure=kind.told(case), not_run=why
    )


class _Bench:
    """Runs of one controller, each loop prepared once, and what the undisturbed ones were."""

    def __init__(
        self,
        case: Case,
        controller: Controller,
        seeds: tuple[int, ...],
        lasting: float,
        duration: float,
        compiled: bool | None,
        progress: Progress,
        total: int,
    ) -> None:
        self.duration, self.moments = duration, list[float]()
        self._case, self._controller, self._seeds, self._lasting = case, controller, seeds, lasting
        self._compiled, self._progress, self._total, self._done = compiled, progress, total, 0
        self._known: list[Series] = []
        self._lost_beyond = math.inf  # distance [m]
        # Of the undisturbed runs, by seed: rms, what the controller told, how far the drive obeyed.
        self._rms: list[float] = []
        self._told: list[dict[str, float]] = []
        self._short: list[float] = []

    def references(self, wait: float) -> tuple[Reference, Reference]:
        """Return the load undisturbed, and the load with the drum held; find every moment."""
        series = self._series(scenario_named("hold", self._case))
        usual = self._undisturbed(series, wait)
        held = usual if holds_brake(self._controller) else self._held()
        limit = series.simulation.options.lock_limit
        if limit is not None:
            self._lost_beyond = max(limit, *(each.largest for each in held))
        return self._reference(usual), self._reference(held)

    def _undisturbed(self, series: Series, wait: float) -> list[Seen]:
        """Run with nothing failing, and find the moment of every seed."""
        runs = []
        for seed in self._seeds:
            run = self._run(series, seed, "undisturbed")
            among = np.flatnonzero((run.time >= BEGIN) & (run.time < wait))
            fastest = np.argmax(np.abs(run["motor.speed"][among])) if among.size else 0
            moment = float(run.time[among[fastest]]) if among.size else BEGIN
            self.moments.append(moment)
            self._rms.append(run.statistics.value("tracking error rms"))
            self._told.append(_told(run))
            self._short.append(_short(run, moment, self._lasting))
            runs.append(Seen.of(run, moment, self._lasting))
        return runs

    def _held(self) -> list[Seen]:
        """Run with the drum held by its brake."""
        brake = controller_of("none", self._case)
        hold = scenario_named("hold", self._case)
        series = Series.prepare(self._case, brake, hold, self._options(brake))
        runs = []
        for seed, moment in zip(self._seeds, self.moments, strict=True):
            run = self._run(series, seed, "drum held")
            runs.append(Seen.of(run, moment, self._lasting))
        return runs

    def _reference(self, seen: Sequence[Seen]) -> Reference:
        return Reference(
            rms=float(np.mean([each.rms for each in seen])),
            largest=max(each.largest for each in seen),
            first=first_of([each.first for each in seen]),
            after=after_of(seen, self._lost_beyond),
        )

    def mode(self, kind: FailureKind, undisturbed: Reference, held: Reference) -> FailureMode:
        """Run one failure over the seeds; what cannot be simulated says why."""
        seen, recoveries, shown = [], list[float | None](), dict[str, list[float]]()
        short, trips = [], list[Event]()
        try:
            for k, (seed, moment) in enumerate(zip(self._seeds, self.moments, strict=True)):
                scenario = kind.scenario(self._case, moment, self._lasting, self.duration)
                run = self._run(self._series(scenario), seed, kind.item)
                seen.append(Seen.of(run, moment, self._lasting))
                recoveries.append(self._recovery(kind, run, k))
                for text, seconds in _told(run).items():
                    usual = self._told[k].get(text, 0.0)
                    # What is told before, and only here, is of how the brake's kind begins: ramped.
                    if usual or not _told_before(run, text, moment):
                        shown.setdefault(text, []).append(seconds - usual)
                short.append(_short(run, moment, self._lasting) - self._short[k])
                trips += trips_of(run, moment)[:1]
        except StillhookError as error:
            return _unrun(kind, self._case, f"cannot be simulated: {error}")
        first, after = first_of([each.first for each in seen]), after_of(seen, self._lost_beyond)
        back = None if None in recoveries else max(r for r in recoveries if r is not None)
        mode = FailureMode(
            identifier=kind.identifier,
            item=kind.item,
            failure=kind.told(self._case),
            shows="; ".join([kind.flag, *_shows(shown, short, trips, len(seen))]),
            safeguard=safeguard(kind, self._controller),
            lasting=self._lasting if kind.ends else math.inf,
            first=first,
            after=after,
            recovery=back,
            severity=severity_of(first, after, undisturbed, held),
        )
        return replace(mode, effect=_effect(mode, first, after, undisturbed, held, len(seen)))

    def _options(self, controller: Controller) -> SimulationOptions:
        # Every sample is kept: a tension has its peaks between those that usually are.
        return SimulationOptions(
            duration=self.duration, store_step=controller.sample_time, compiled=self._compiled
        )

    def _series(self, scenario: Scenario) -> Series:
        """Return runs of a scenario, by a loop that is there already if one serves."""
        for series in self._known:
            if series.simulation.serves(scenario):
                simulation = series.simulation.with_scenario(scenario)
                return replace(series, simulation=simulation)
        options = self._options(self._controller)
        made = Series.prepare(self._case, self._controller, scenario, options)
        self._known.append(made)
        return made

    def _run(self, series: Series, seed: int, what: str) -> Run:
        """Run once; raises KeyboardInterrupt if Ctrl-C cut it short, as half a run says nothing."""
        self._progress(what, self._done, self._total)
        run = series.run(seed)
        if run.status == "interrupted":
            raise KeyboardInterrupt
        self._done += 1
        self._progress(what, self._done, self._total)
        return run

    def _recovery(self, kind: FailureKind, run: Run, k: int) -> float | None:
        """Return how long after its end the load is back in a run [s]; None if it is not."""
        if not kind.ends or run.status == "diverged" or trips_of(run, self.moments[k]):
            return None
        since = self.moments[k] + self._lasting
        after = (run.time >= since) & (run.time <= since + RETURN)
        length = max(1, round(self._case.sea.spectral_peak_period / run.sample_time))
        # Rms over each stretch of a peak period, from the sums of squares up to its two ends.
        sums = np.concatenate([[0.0], np.cumsum(error_of(run)[after] ** 2)])
        mean = (sums[length:] - sums[:-length]) / length
        calm = np.flatnonzero(mean <= (BACK * self._rms[k]) ** 2)
        return float(calm[0]) * run.sample_time if calm.size else None


def _told(run: Run) -> dict[str, float]:
    """Return for how long the controller was not as usual [s], by what it told."""
    told = {STATUSES[name]: n for name, n in run.timings.statuses.items()}
    told |= {f"a command could not be used: {k}": n for k, n in run.timings.fallbacks.items()}
    return {text: n * run.sample_time for text, n in told.items()}


def _told_before(run: Run, text: str, moment: float) -> bool:
    """Return whether a controller told something before a moment [s]."""
    told = (event for event in run.events if event.time < moment)
    return any(event.kind == "controller" and event.text.startswith(text) for event in told)


def _short(run: Run, moment: float, lasting: float) -> float:
    """Return for which share of a failure the drive did less than it was asked for."""
    during = (run.time > moment) & (run.time <= moment + lasting) & (run["engaged"] > 0.0)
    return float(run["drive.saturated"][during].mean()) if during.any() else 0.0


def _shows(
    told: dict[str, list[float]], short: Sequence[float], trips: Sequence[Event], seeds: int
) -> list[str]:
    """Return what the runs told, beyond what they tell undisturbed."""
    found = []
    for text, times in told.items():
        longest = max(times)
        if longest > _TOLD:
            found.append(f"{text} (up to {number(longest, 2)} s)")
    share = max(short)
    if share > _SHORT_OF:
        found.append(f"the drive does less than asked for {number(100.0 * share, 2)} % of the time")
    if trips:
        found.append(f"in {len(trips)} of {count(seeds, 'seed')}: {trips[0].text}")
    return found


def _effect(
    mode: FailureMode,
    first: FirstSeconds,
    after: Afterwards,
    undisturbed: Reference,
    held: Reference,
    seeds: int,
) -> str:
    """Return what the load does, in a sentence."""
    usual, brake = undisturbed.after, held.after
    text = (
        f"in the first 5 s up to {quantity(first.largest, 'm')} from its place (undisturbed "
        f"{quantity(undisturbed.first.largest, 'm')}) at up to {quantity(first.speed, 'm/s')}, "
        f"{quantity(first.drum_tension_least, 'N')} to "
        f"{quantity(first.drum_tension_largest, 'N')} at the drum; then "
        f"{quantity(after.rms, 'm')} rms (undisturbed {quantity(usual.rms, 'm')}, drum held "
        f"{quantity(brake.rms, 'm')}), {quantity(after.largest, 'm')} at most"
    )
    for name, what in MISHAPS.items():
        happened = getattr(after, name)
        if happened > getattr(usual, name):
            text += f"; {what} in {happened} of {count(seeds, 'seed')}"
    if math.isinf(mode.lasting):
        return f"{text}; the drum stays held"
    if mode.recovery is None:
        return f"{text}; not back {duration(RETURN)} after its end"
    if mode.recovery == 0.0:
        return f"{text}; back at its end"
    return f"{text}; back {quantity(mode.recovery, 's')} after its end"
