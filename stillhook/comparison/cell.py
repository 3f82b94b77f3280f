"""One run of a comparison (`Cell`): a contender in a sea with a seed, as plain data.

    question, Contender, H_s, StoredDesign --> Prepared (a controller) or Floor
                                           --> run(seed) --> Cell (plain data)

Common random numbers: every contender meets the same motion of the hook, to the last bit at the
nodes that it is drawn at, growing out of rest in the same way, and is judged over the same time.
Noise of sensors, telemetry and reference unit comes from the same seed; contenders with the same
sample time are shown the very same numbers, others the same noise sampled more or less often.
The clairvoyant floor sees the same motion of the hook and is judged over the same time; its plant
is linear, and every command within the drive's limits is open to it.
"""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from models.basics import FloatArray, InputError
from models.case import Case
from models.operation import Motion, SpectrumMotion, scenario_named
from models.run import ERROR, Run
from models.sensing import holds_brake
from models.simulation import EASE, Progress, SimulationOptions

from ..controllers import Contender, StoredDesign, controller_of
from ..runs import TRIPS, Series
from .mismatch import Mismatch

TRACED = (
    "hook.heave",
    "payload.displacement",
    "motor.torque",
    "motor.speed",
    "rope.minimum_tension",
    "drive.saturated",
)
"""Signals that are kept around the worst moment."""

WINDOW = 60.0  #: Time that is kept around the worst moment [s].

_ROUNDING = 1e-6  # of a limit that counts as broken
_SAMPLE = 0.05  # of the floor's demand, which may bend in any way from one to the next [s]


@dataclass(frozen=True, kw_only=True, eq=False)
class ComparisonQuestion:
    """What all contenders are asked."""

    case: Case  #: The case that the controllers are made for.
    #: Length of a run, and when its statistics begin [s].
    duration: float
    settle: float
    mismatch: Mismatch  #: What of the plant is not as in the case.
    masses: int | None = None  #: Masses along the rope of the plant; None for those of the case.
    compiled: bool | None = None  #: Whether the plant runs as C; None: if there is a compiler.
    #: "each": linear laws are designed for every sea; "case": once, for that of the case.
    design_at: str = "each"
    starts: int = 8  #: Starts of the searches for designs.

    def known(self, height: float) -> Case:
        """Return the case with a significant height [m], as the controllers know it."""
        if height == self.case.sea.significant_height:
            return self.case
        return self.case.replace({"sea.significant_height": height})

    def true(self, height: float) -> Case:
        """Return the case that is simulated."""
        return self.mismatch.apply(self.known(height))

    def design_height(self, height: float) -> float:
        """Return the significant height that a law for a sea is designed in [m]."""
        return height if self.design_at == "each" else float(self.case.sea.significant_height)


@dataclass(frozen=True, kw_only=True, eq=False)
class Cell:
    """What is kept of one run, as plain data."""

    #: Which run: name, significant height [m], seed.
    contender: str
    height: float
    seed: int
    #: As in `models.run.run.Run`; "failed" if there is no run at all.
    status: str
    message: str = ""
    #: Quantities of `models.run.summary` by name, SI.
    quantities: Mapping[str, float] = field(default_factory=dict)
    #: How often the brake ended the controller's work, by kind.
    trips: Mapping[str, int] = field(default_factory=dict)
    #: Share of the stored samples in which a limit was broken, by its name [1].
    broken: Mapping[str, float] = field(default_factory=dict)
    #: What had to be replaced by the simulator, and what the controller counted itself.
    fallbacks: Mapping[str, int] = field(default_factory=dict)
    counts: Mapping[str, float] = field(default_factory=dict)
    #: Wall time of a step of a controller in Python: median, p99, max [s]; empty if compiled.
    step: Mapping[str, float] = field(default_factory=dict)
    worst: float = math.nan  #: When the payload was farthest from its place [s].
    #: Sample time of the controller, and time that the run took [s].
    sample_time: float = math.nan
    wall: float = math.nan

    @property
    def rms(self) -> float:
        """Root mean square of the payload's distance from its place [m]; inf if it diverged."""
        if self.status == "diverged":
            return math.inf
        return self.quantities.get("tracking error rms", math.nan)

    @property
    def lost(self) -> bool:
        """Whether the controller lost the payload: lock lost, brake, divergence, no run."""
        if self.status in ("diverged", "failed", "died") or self.trips:
            return True
        return not math.isnan(self.quantities.get("lost lock at", math.nan))

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain data."""
        return asdict(self)


@dataclass(frozen=True, kw_only=True, eq=False)
class Trace:
    """Time traces of one run around a moment: `time` (n,) [s], `signals` (n,) by name."""

    contender: str
    time: FloatArray
    signals: Mapping[str, FloatArray]


@dataclass(frozen=True, kw_only=True, eq=False)
class CommonSea(SpectrumMotion):
    """The hook's motion that every contender meets: drawn for the whole run, whatever the step.

    That run lasts `lasting` [s], no multiple of every sample.  In the first `ease` [s] the motion
    grows out of rest, where the simulation does not see to that: with the brake on.
    """

    lasting: float
    ease: float = 0.0

    def motion(self, duration: float, step: float, seed: int) -> Motion:
        """Return the motion; it lasts a little longer than was asked for."""
        return super().motion(max(duration, self.lasting), step, seed).eased(self.ease)


class Prepared:
    """A contender in one sea, ready to run.

    Raises InputError, SynthesisError, SolverError if there is no such controller for the case.
    """

    def __init__(
        self,
        question: ComparisonQuestion,
        contender: Contender,
        height: float,
        law: StoredDesign | None,
    ) -> None:
        if contender.recipe is None:
            raise InputError("the floor is no controller")
        self._contender, self._height = contender, height
        controller = contender.recipe.controller(question.known(height), law)
        true = question.true(height)
        sea = SpectrumMotion.from_case(true).hook
        self._settle = question.settle
        options = SimulationOptions(
            hook=CommonSea(
                hook=sea, lasting=question.duration, ease=EASE if holds_brake(controller) else 0.0
            ),
            duration=question.duration,
            settle=question.settle,
            masses=question.masses,
            compiled=question.compiled,
        )
        self._series = Series.prepare(
            true, controller_of(controller, true), scenario_named("hold", true), options
        )

    def run(self, seed: int, progress: Progress | None = None) -> Cell:
        """Run with one seed.

        Raises KeyboardInterrupt if the run was interrupted: half a run is worth nothing.
        """
        return self._cell(self._run(seed, progress), seed)

    def trace(self, seed: int, moment: float, progress: Progress | None = None) -> Trace:
        """Run once more, and return the traces around a moment [s]."""
        run = self._run(seed, progress)
        near = np.abs(run.time - moment) <= 0.5 * WINDOW
        return Trace(
            contender=self._contender.name,
            time=run.time[near].copy(),
            signals={name: run[name][near].copy() for name in TRACED if name in run},
        )

    def _run(self, seed: int, progress: Progress | None) -> Run:
        run = self._series.run(seed, progress)
        if run.status == "interrupted":
            raise KeyboardInterrupt
        return run

    def _cell(self, run: Run, seed: int) -> Cell:
        timings, error = run.timings, run.statistics.signals.get(ERROR)
        step = {
            "median": timings.controller_median,
            "p99": timings.controller_p99,
            "max": timings.controller_max,
        }
        worst = math.nan
        if error is not None:
            up = error.maximum >= -error.minimum
            worst = error.maximum_time if up else error.minimum_time
        # One that ran as C has counted nothing itself; its statuses have been counted for it.
        simulation = self._series.simulation
        counts = getattr(simulation.controller, "counts", None)
        if counts and simulation.fused:
            counts = timings.statuses
        return Cell(
            contender=self._contender.name,
            height=self._height,
            seed=seed,
            status=run.status,
            message=run.message,
            quantities={name: q.value for name, q in run.statistics.quantities.items()},
            trips=dict(Counter(event.kind for event in run.events if event.kind in TRIPS)),
            broken=_broken(run, self._settle),
            fallbacks=dict(timings.fallbacks),
            counts={str(k): float(v) for k, v in counts.items()} if counts else {},
            step={} if math.isnan(step["median"]) else step,
            worst=worst,
            sample_time=run.sample_time,
            wall=timings.wall_seconds,
        )


class Floor:
    """The clairvoyant floor in one sea: no controller, and no nonlinear plant."""

    def __init__(self, question: ComparisonQuestion, contender: Contender, height: float) -> None:
        self._name, self._height, self._question = contender.name, height, question
        self._case = question.true(height)
        self._hook = SpectrumMotion.from_case(self._case).hook

    def run(self, seed: int, progress: Progress | None = None) -> Cell:
        """Return the floor of one seed."""
        del progress
        sea = CommonSea(hook=self._hook, lasting=self._question.duration, ease=EASE)
        motion = sea.motion(self._question.duration, _SAMPLE, seed)
        from mpc.floor import clairvoyant

        found = clairvoyant(
            self._case,
            motion,
            sample_time=_SAMPLE,
            settle=self._question.settle,
            masses=self._question.masses,
        )
        time = np.asarray(found.time, dtype=np.float64)
        payload = np.asarray(found.payload, dtype=np.float64)
        counted = payload[time >= self._question.settle - 1e-9]
        quantities = {
            "tracking error rms": float(np.sqrt(np.mean(counted**2))),
            "tracking error largest": float(np.abs(counted).max()),
            "payload rms": float(counted.std()),
            "payload significant": 4.0 * float(counted.std()),
        }
        return Cell(
            contender=self._name,
            height=self._height,
            seed=seed,
            status="completed",
            message=str(getattr(found, "status", "")),
            quantities=quantities,
            worst=float(time[int(np.argmax(np.abs(payload)))]),
        )


def _broken(run: Run, settle: float) -> dict[str, float]:
    """Return the share of the stored samples in which each limit was broken."""
    limits, winch = run.case.limits, run.case.winch
    counted = run.time >= settle
    if not counted.any():
        return {}

    def share(name: str, low: float | None, high: float | None) -> float:
        if name not in run:
            return 0.0
        values = run[name][counted]
        out = np.zeros(values.size, dtype=np.bool_)
        if low is not None:
            out |= values < low - _ROUNDING * abs(low)
        if high is not None:
            out |= values > high + _ROUNDING * abs(high)
        return float(out.mean())

    speed, torque = winch.speed_limit, winch.drive.torque_peak
    return {
        "speed": share("motor.speed", -speed, speed),
        "torque": share("motor.torque", -torque, torque),
        "tension low": share("rope.minimum_tension", run.case.least_tension, None),
        "tension high": share("rope.tension", None, limits.rope_tension_peak),
    }
