"""The recipe that linear and nonlinear predictive control of the winch share: `WinchMPC`.

    case --> model, weights, regulator, estimator, limits          once
    m --> WinchEstimator --> chi ; set point, forecast, thermal cap      every sample
    question --> QP --> first move, or that of the unconstrained law  every sample

What the two put to the solver, and what command they make of its answer, is their own.

A programme may fail, be late, or have nothing finite to start from.  The drive then gets what the
programme would give without limits, the regulator's feedback of the same estimate, or, where limits
held the last good plan, for a second the move that this had for the moment.  A controller that was
handed in as a fallback hears all the time, and its command is passed on instead.

`DriveWindow` bounds the moves by the drive's torque, power, voltage and temperature.

    motor speeds, thermal budget --> lowest and highest torque of each move

Peak torque and current are constants; the power limit narrows the window with the speed, which is
taken from the last plan; the voltage of a DC drive bounds the first move by the speed that is there
now.  The windings' temperature follows from the torque that the drive reports.  So do peak and
power, where the drive reports that it follows less; and by what it can brake with that power the
plan keeps the speed of lowering.
"""

import math
import time as clock
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal, TypedDict

import numpy as np

from models.basics import FloatArray, InputError, check_range
from models.case import Case
from models.operation import Motion
from models.plant import SPEED_BAND, DriveLimits, late_hold
from models.sensing import HEARD, Controller, Measurement

from ..forecast import AdaptiveAR, Forecast, PerfectPreview, Predictor, SeaBank, fused
from ..programme import (
    Condensed,
    QPSolution,
    Question,
    Signals,
    SoftQP,
    default_blocking,
    kkt_residual,
)
from ..winch import (
    MotorInertia,
    PredictionModel,
    SampledWinch,
    Weights,
    WinchEstimator,
    feedback_row,
    plan_model,
    prediction_model,
    regulator,
    sampled_winch,
    tune_weights,
    with_noise,
)
from .products import Products
from .winch_programme import winch_programme

_OWNER = "predictive control"
_CLEAR = 1.5 * SPEED_BAND  # of the highest speed, kept clear of the drive's own overspeed cut
_HORIZON, _PREVIEWED = 8.0, 14.0  # [s]
_SWELL = 0.05  # reckoned with though not told, of the hook's variance
_PROVED = 1e-6  # residual of the optimality conditions
_STALE = 1.0  # of a plan [s]
_UNIT, _TORQUE = HEARD.index("mru.valid"), HEARD.index("motor.torque")
_HEAVE, _RATE = HEARD.index("mru.heave"), HEARD.index("mru.heave_rate")
_APPLIED, _SPEED = HEARD.index("drive.applied"), HEARD.index("motor.speed")
_REFERENCE = HEARD.index("reference.displacement")

_EDGE = 1e-7  # of a move that is at its bound
_MOST = 0.2  # of the peak: half of what the torque may fall by over a sample
_MORE = 0.2  # of the fall, so that the drive stays at its peak though the plan is off
_STATIC = 1.2  # of the static torque: never less, whatever the temperature
_BRAKES = 1.05  # of the static torque, which there is to be at any speed of lowering
_SHORT = 3  # samples in a row that a drive gives less than asked, until that is its limit
_SEEN = 5e-3  # of a limit: what is less is no difference
_LAGS = 0.03  # of the power: a torque that comes late to its limit as the speed falls shows less
_PROBE = 0.01  # of a limit learnt, by which a drive that follows there is asked for more
_LEAST = 0.3  # of what it could give: who gives less is not engaged


class WinchOptions(TypedDict, total=False):
    """What linear and nonlinear predictive control are both asked; `LinearMPC` explains it."""

    horizon: float | None
    sample_time: float
    blocking: Sequence[int] | None
    weights: Weights | None
    predictor: Literal["bank", "kalman", "ar", "preview"] | Predictor
    preview: Predictor | None
    masses: int | None
    minimum_tension: float | None
    excursion: float | None
    thermal: bool
    deadline: float | None
    limits: DriveLimits | None
    name: str | None
    prove: bool
    fallback: Controller | None


class WinchMPC(ABC):
    """What predictive control of a winch is made of, whatever its model of the plant.

    Parameters
    ----------
    case, horizon, sample_time, blocking, weights, predictor, preview, masses
        As for `LinearMPC`.
    minimum_tension, excursion, thermal, deadline, prove, limits, name, fallback
        As for `LinearMPC`.

    Attributes
    ----------
    model, regulator, estimator, predictor
        The model that plans are made on, its regulator, the filter, and where the hook's path comes
        from: None for the estimator's own sea.
    soft_limits
        Lowest and highest deviation from rest by signal.
    window, inertia
        What torque the drive can give, as bounds on the moves, and what turns at the motor, over
        that of the case.
    programme, products, qp
        The condensed programme, what of a step does not change, and the solver.
    question, solved
        What the solver was asked last, and its answer; None where there was none.

    Raises
    ------
    InputError
        If an argument is out of its range.
    SolverError
        If no weights are stable.
    """

    programme: Condensed
    products: Products
    qp: SoftQP
    _further = 0  # rows that the solver is asked after those of the programme

    def __init__(
        self,
        case: Case,
        *,
        horizon: float | None = None,
        sample_time: float = 0.05,
        blocking: Sequence[int] | None = None,
        weights: Weights | None = None,
        predictor: Literal["bank", "kalman", "ar", "preview"] | Predictor = "bank",
        preview: Predictor | None = None,
        masses: int | None = None,
        minimum_tension: float | None = None,
        excursion: float | None = None,
        thermal: bool = False,
        deadline: float | None = None,
        limits: DriveLimits | None = None,
        name: str | None = None,
        prove: bool = False,
        fallback: Controller | None = None,
    ) -> None:
        T = check_range(_OWNER, "sample_time", sample_time, low=0.0, unit="s", open_low=True)
        if horizon is None:
            horizon = _PREVIEWED if predictor == "preview" else _HORIZON
        blocks = default_blocking(_OWNER, horizon, T) if blocking is None else tuple(blocking)
        if not blocks or min(blocks) < 1:
            raise InputError(
                f"{_OWNER}: blocking must be whole numbers of at least 1, got {blocks}"
            )
        least = case.least_tension if minimum_tension is None else minimum_tension
        if least is None:
            least = case.payload.taut_tension
        check_range(_OWNER, "minimum_tension", least, low=0.0, unit="N")
        if deadline is not None:
            check_range(_OWNER, "deadline", deadline, low=0.0, unit="s", open_low=True)
        if weights is None:
            weights = tune_weights(case, sample_time=T, masses=masses)
            if predictor == "preview":  # who knows the future may know the rope
                weights = replace(weights, stiffness=1.0)
        self.case, self.sample_time, self.weights = case, T, weights
        # Two models: the estimator believes the case, and plans are made on a stiffer rope.
        winch = sampled_winch(case, sample_time=T, masses=masses)
        other = _SWELL if predictor == "bank" else 0.0  # of another sea than is told
        believed = with_noise(prediction_model(winch, swell=other), weights.noise)
        self.model = plan_model(believed, weights.stiffness)
        self.regulator = regulator(self.model, weights.torque)
        self.estimator = WinchEstimator(believed)
        limits = DriveLimits.from_case(case) if limits is None else limits
        self.soft_limits = _soft_limits(self.model, limits, least, excursion)
        self._blocks = tuple(int(b) for b in blocks)
        self._shows = np.ascontiguousarray(believed.hook[:, believed.sea_at])  # of the sea's state
        known = self._shows @ believed.sea_covariance @ self._shows.T
        z, v = np.sqrt(np.diag(known)).tolist()
        self.predictor, word = _predictor(case, predictor, T, self.horizon, (z, v))
        self.preview = preview
        if preview is not None:
            short = len(preview.leads) <= round(self.horizon / T) + 1
            if not (short and self.predictor is not None and math.isclose(preview.sample_time, T)):
                raise InputError(
                    f"{_OWNER}: preview must forecast every {T:g} s, for no longer than the "
                    f"horizon of {self.horizon:g} s, beside a predictor that is not kalman"
                )
        self.name = word if name is None else name
        # Who is handed the record is named so, whatever its predictor is called.
        told = any(hasattr(source, "foresee") for source in (self.predictor, preview))
        if told and "preview" not in self.name:
            self.name += "-preview"
        # A path that comes from outside tells where the sea is at its end, if it is known how well
        # the estimator knows it at the start.
        self._sea_covariance = None if self.predictor is None else believed.sea_covariance
        unit = case.winch.drive.torque_peak
        self.window = DriveWindow(self.model.winch, limits, len(blocks), unit)
        self.inertia = MotorInertia(winch)
        if fallback is not None and not math.isclose(fallback.sample_time, T):
            raise InputError(
                f"{_OWNER}: fallback must have the sample time {T:g} s, got "
                f"{fallback.sample_time:g} s"
            )
        self._of = np.repeat(np.arange(len(blocks)), self._blocks)  # block of each sample
        self._stale = min(round(_STALE / T), len(self._of))
        self._fallback, self._unlimited = fallback, feedback_row(self.regulator, self.model)
        self._deadline = math.inf if deadline is None else deadline
        self._prove = prove
        # For how much of a sample the oldest command on its way still acts.
        self._share = late_hold(case.winch.drive.command_delay / T)[1]
        self._budget = TorqueBudget(case, T, self.horizon) if thermal else None

    @property
    def horizon(self) -> float:
        """Length of the prediction [s]."""
        return sum(self._blocks) * self.sample_time

    @property
    def counts(self) -> Mapping[str, int]:
        """Steps, iterations of the solver, answers that were late or unproved, and statuses."""
        return dict(self._counts)

    @property
    def status(self) -> str:
        """What the last step was, as `models.sensing.STATUSES` has it."""
        if not self._answered:
            return "fallback"
        if self.estimator.blind:
            return "blind"
        if self.estimator.gated:
            return "gated"
        if self.window.derated:
            return "derated"
        if getattr(self.predictor, "misfit", False):
            return "misfit"
        full = abs(self._asked) >= self.window.peak * (1.0 - _EDGE)
        return "limited" if full else "engaged"

    def foresee(self, motion: Motion) -> None:
        """Give the record to come to a predictor, or a preview, that needs it."""
        for source in (self.predictor, self.preview):
            given = getattr(source, "foresee", None)
            if given is not None:
                given(motion)

    def reset(self) -> None:
        """Forget every earlier measurement."""
        self.estimator.reset()
        self.window.reset()
        self.inertia.reset()
        self.qp.reset()
        if self._budget is not None:
            self._budget.reset()
        for source in (self.predictor, self.preview):
            if source is not None:
                source.reset()
        self._plan: FloatArray | None = None  # the last good moves if limited, how old they are
        self._age = 0
        if self._fallback is not None:
            self._fallback.reset()
        self._speeds = np.zeros(len(self._blocks))  # at the start of each move, by the last plan
        self._asked = self.model.winch.rest_torque  # of the drive at the sample before [N m]
        self._sent = math.nan  # the command of the sample before
        self._set_point = np.zeros(2)  # displacement [m] and velocity [m/s], the last finite one
        self._counts = dict.fromkeys(
            (
                "steps",
                "iterations",
                "late",
                "unproved",
                "gated",
                "derated",
                "blind",
                "misfit",
                "fallback",
            ),
            0,
        )
        self.question: Question | None = None
        self.solved: QPSolution | None = None
        self._answered = True  # whether the last step had its command of the programme

    def commanded(self, command: float) -> None:
        """Take note of what went to the drive, maybe instead of the last command."""
        self._sent = command
        if self.model.winch.waiting:
            self.estimator.given = command

    @abstractmethod
    def step(self, measurement: Measurement, time: float) -> float:
        """Return the drive command, its static part included [V, rad/s or N m]."""

    def _condense(
        self,
        model: PredictionModel,
        signals: Signals | None = None,
        links: FloatArray | None = None,
    ) -> Condensed:
        """Return the programme of the controller's cost, blocks and limits on a model."""
        return winch_programme(
            model,
            self.regulator,
            self._blocks,
            self.soft_limits,
            signals,
            links=links,
            time_limit=0.0 if self._deadline == math.inf else self._deadline,
        )

    def _products(self, model: PredictionModel, programme: Condensed) -> Products:
        return Products.of(model, programme, self._sea_covariance, self.estimator.model)

    def _forecast(self, shown: FloatArray, time: float) -> Forecast | None:
        """Return the predictor's forecast, None where the hook moves as the estimator's sea."""
        if self.predictor is None:
            return None
        heave, rate, valid = float(shown[_HEAVE]), float(shown[_RATE]), bool(shown[_UNIT] > 0.5)
        if self.preview is not None:
            self.preview.update(heave, rate, valid, time)
        of_filter = getattr(self.predictor, "fused", False)
        if of_filter:
            at = self.model.sea_at
            heave, rate = (self._shows @ self.estimator.state[at]).tolist()
            valid = not self.estimator.blind
        self.predictor.update(heave, rate, valid, time)
        own = self.predictor.forecast()
        if of_filter:
            own = own.begun_at(heave, rate, self.sample_time)
        if self.preview is None:
            return own
        return fused(own, self.preview.forecast(), self.sample_time)

    def _reference(self, shown: FloatArray) -> FloatArray:
        """Return the displacement [m] and velocity [m/s] that are asked for, (2,).

        A set point that is not finite keeps its last place, at rest there.
        """
        asked = shown[_REFERENCE : _REFERENCE + 2]
        if math.isfinite(float(asked.sum())):
            self._set_point = asked.copy()  # whose array the next sample may be written into
        else:
            self._set_point = np.array([self._set_point[0], 0.0])
        return self._set_point

    def _cap(self, shown: FloatArray) -> float:
        """Return the highest torque that the windings' temperature allows [N m]."""
        if self._budget is None:
            return math.inf
        # Over a sample the torque falls or rises with the speed: the larger end counts.
        return self._budget.update(max(abs(float(shown[_TORQUE])), abs(self._asked)))

    def _solve(self, question: Question, began: float) -> float | None:
        """Return the first move of the answer, None if there is none that is good."""
        question = self._braked(question)
        self.question, self.solved, self._answered = question, None, False
        # The estimate is finite (`WinchEstimator`): it is the forecast that is not.
        if not all(math.isfinite(float(part.sum())) for part in question):
            return None
        solved = self.qp.solve(*question)
        self._counts["iterations"] += solved.iterations
        if not (solved.ok and math.isfinite(float(solved.v.sum()))):
            self.qp.reset()
            return None
        if self._prove and kkt_residual(self.qp, *question, solved) > _PROVED:
            self._counts["unproved"] += 1
        # The drive needs its command by then: what comes later is not used.
        if clock.perf_counter() - began > self._deadline:
            self._counts["late"] += 1
            return None
        self.solved, self._answered = solved, True
        soon = solved.multipliers[: self._of[self._stale - 1] + 1]
        self._plan, self._age = solved.v if soon.any() else None, 0
        return float(solved.v[0])

    def _braked(self, question: Question) -> Question:
        """Return a question whose plan lowers no faster than the drive's power can brake."""
        told = self.soft_limits.get("speed", (0.0, 0.0))[0]
        if self.window.lowering >= -told:
            return question
        p, (gradient, lower, upper) = self.programme, question
        speed = np.flatnonzero(p.kind == p.signals.names.index("speed"))
        lower = lower.copy()
        at = len(lower) - self._further - len(p.kind) + speed
        lower[at] += (-self.window.lowering - told) * p.scale[speed]
        return gradient, lower, upper

    def _given(self, command: float) -> float:
        """Return a command within the voltage, of which note is taken."""
        command = min(max(command, -self.window.voltage), self.window.voltage)
        self.commanded(command)
        return command

    def _otherwise(self, chi: FloatArray, reference: FloatArray) -> float:
        """Return the move where the programme has no answer in time.

        It is that of the law without limits, which the programme is as long as nothing limits it;
        where the last plan was limited, that of the plan for this moment, for a second: cut off at
        the limits the law swings without end.
        """
        winch = self.model.winch
        self._age += 1
        if self._plan is not None and self._age < self._stale:
            return float(self._plan[self._of[self._age]])
        asked = self._unlimited[: winch.size] @ winch.moved @ reference
        return float(asked - self._unlimited @ chi) / self.programme.unit

    def _hear(
        self, measurement: Measurement, time: float, applied: float, *, partly: bool = False
    ) -> FloatArray:
        """Return the estimate of a sample, (n,), and let the fallback hear it too.

        Where the drive was to cut the torque for a part of it, the end tells nothing of the mean.
        """
        self._counts["steps"] += 1
        shown = measurement.values
        left_out = self._sent - float(shown[_APPLIED])
        cut = self.window.follow(float(shown[_TORQUE]), left_out, float(shown[_SPEED]))
        self.inertia.update(shown, cut, partly)
        self._other = math.nan
        if self._fallback is not None:
            self._other = float(self._fallback.step(measurement, time))
        return self.estimator.update(measurement, applied=applied)

    def _passed_on(self) -> float:
        """Return the command of the fallback for this sample."""
        winch, peak = self.model.winch, self.window.peak
        torque = winch.torque(self._other, self.estimator.speed) + winch.rest_torque
        self._tell(min(max(torque, -peak), peak))
        return self._given(self._other)

    def _tell(self, torque: float) -> None:
        """Take note of the torque asked of the drive [N m], and count what the step was."""
        self._asked = torque
        if (status := self.status) in self._counts:
            self._counts[status] += 1


def _soft_limits(
    model: PredictionModel, limits: DriveLimits, least: float, excursion: float | None
) -> dict[str, tuple[float, float]]:
    """Return the soft limits by signal, as deviations from rest: (lowest, highest)."""
    winch = model.winch
    found = {"tension": (least - winch.case.payload.least_weight, math.inf)}
    if limits.speed < math.inf:
        top = (1.0 - _CLEAR) * limits.speed
        found["speed"] = (-top, top)
    if excursion is not None:
        check_range(_OWNER, "excursion", excursion, low=0.0, unit="m", open_low=True)
        found["payload"] = (-excursion, excursion)
    if winch.dc and limits.voltage < math.inf:
        found["command"] = (
            -limits.voltage - winch.rest_command,
            limits.voltage - winch.rest_command,
        )
    return found


def _predictor(
    case: Case,
    given: str | Predictor,
    sample_time: float,
    horizon: float,
    known: tuple[float, float],
) -> tuple[Predictor | None, str]:
    """Return the predictor, None for the estimator's own sea, and the controller's name.

    `known`: standard deviations of the hook's displacement [m] and velocity [m/s] in the estimator.
    """
    if not isinstance(given, str):
        wanted = round(horizon / sample_time) + 1
        leads = np.asarray(given.leads)
        if leads.size != wanted or not math.isclose(given.sample_time, sample_time):
            raise InputError(
                f"{_OWNER}: predictor must forecast {wanted} leads every {sample_time:g} s, got "
                f"{leads.size} every {given.sample_time:g} s"
            )
        return given, "mpc"
    if given == "kalman":
        return None, "mpc"
    if given == "bank":
        return SeaBank(case, sample_time=sample_time, horizon=horizon, error=known), "mpc"
    if given == "ar":
        return _LearntHook(sample_time=sample_time, horizon=horizon), "mpc-ar"
    if given == "preview":
        return PerfectPreview(sample_time=sample_time, horizon=horizon), "mpc-preview"
    raise InputError(
        f"{_OWNER}: predictor must be one of bank, kalman, ar, preview or a Predictor, "
        f"got {given!r}"
    )


class _LearntHook(AdaptiveAR):
    """An autoregression of the hook as the filter knows it, from all sensors.

    What the unit shows has its errors within the band of the waves: the load would follow them.
    """

    fused = True


class DriveWindow:
    """Bounds on so many moves, in units of a torque [N m], by the limits of a drive."""

    def __init__(self, winch: SampledWinch, limits: DriveLimits, moves: int, unit: float) -> None:
        self._winch, self._unit = winch, unit
        constant = winch.data.torque_constant if winch.dc else 1.0
        self._moves, self._peak = moves, min(limits.torque, constant * limits.current)
        self.voltage = limits.voltage if winch.dc else math.inf
        self._told = limits
        # A power of which the drive has no use is no limit.
        self._full = min(limits.power, self._peak * limits.speed)
        #: What the torque of a held command falls by for each rad/s that the motor gets faster.
        self.fall = winch.gain * winch.back
        self.reset()

    def reset(self) -> None:
        """Hold the drive's limits to be what they were told to be."""
        self.limits = self._told  #: Those told, but for the power learnt.
        # Torque and power while it gives less than asked, of the last samples in a row.
        self._short: list[tuple[float, float]] = []
        self._take(self._peak)

    @property
    def derated(self) -> bool:
        """Whether the drive gives less than its peak, or its power, was told to be."""
        return self.peak < self._peak or self.limits.power < self._told.power

    @property
    def narrows(self) -> bool:
        """Whether a fast motor has less torque."""
        return min(self.limits.power, self.limits.breakdown) < math.inf

    @property
    def lowering(self) -> float:
        """Highest speed of lowering at which the power can brake the load [rad/s].

        Beyond it a load runs away: the faster it is, the less torque there is to hold it.
        """
        return self.limits.power / (_BRAKES * abs(self._winch.rest_torque))

    def follow(self, torque: float, left_out: float, speed: float) -> bool:
        """Learn peak and power from what the drive follows; return whether it left some out.

        Where it gives less than asked, and less than its limits say, for some samples, it is at a
        limit, that of its power if this stays the same rather than its torque.  Where it then gives
        as much as it is asked for, that limit is probed a little higher.

        Parameters
        ----------
        torque
            What the drive gives [N m].
        left_out
            The command asked for at the sample before over the one that it follows.
        speed
            The motor's [rad/s].
        """
        given, power, known = abs(torque), abs(torque * speed), self.limits.power
        if math.copysign(self._winch.gain, torque) * left_out > _SEEN * self._peak:
            self._short = [*self._short[1 - _SHORT :], (given, power)]
            if len(self._short) == _SHORT and math.isfinite(power):
                self._learn(given, power, abs(speed))
            return True
        self._short = []
        if self.peak < self._peak and given > (1.0 - _SEEN) * self.peak:
            self._take((1.0 + _PROBE) * max(given, self.peak))
        if known < self._told.power and power > (1.0 - _SEEN) * known:
            self._take_power((1.0 + _PROBE) * max(power, known))
        return False

    def _learn(self, given: float, power: float, speed: float) -> None:
        """Learn from a drive that gives less than asked what its peak is, or its power.

        Which of the two it is shows as the speed changes.  A torque that has the power which is
        known already tells nothing of the peak.
        """
        top, known = float(self._told.top(speed, self._peak)), self.limits.power
        if not _LEAST * top < given:
            return
        # Near its highest speed the drive's own window closes.
        below = speed < (1.0 - _CLEAR) * self._told.speed and given < (1.0 - _SEEN) * top
        of_power = power > (1.0 - _LAGS) * known or _steadier_power(self._short)
        # What it gives it can give, whatever was thought before.
        if (below and not of_power) or given > self.peak:
            self._take(given)
        less = below and power < (1.0 - _LAGS) * self._told.power
        if (less and of_power) or power > known:
            self._take_power(power)

    def _take(self, peak: float) -> None:
        """Take a torque as the drive's peak [N m], at most what was told.

        It is never less than what holds the load, without which no plan has a way to go.
        """
        rest = self._winch.rest_torque
        self.peak = min(max(peak, abs(rest)), self._peak)
        self._low = np.full(self._moves, (-self.peak - rest) / self._unit)
        self._high = np.full(self._moves, (self.peak - rest) / self._unit)

    def _take_power(self, power: float) -> None:
        """Take a power as the drive's limit [W], that told if it is no less."""
        less = power < self._full
        self.limits = replace(self._told, power=power) if less else self._told

    def bounds(
        self, speed: float, speeds: FloatArray, cap: float, changes: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return the lowest and the highest value of each move.

        A move is the torque at the start of a sample, from which a held command lets it fall as the
        drum gets faster.  A drive that is asked for more holds its peak to the end of the sample:
        the peak is then the mean, and the move that stands for it half the fall higher.  Motor
        speeds are that now, and those at the start of each move, by the last plan [rad/s], (n,);
        `cap` is the highest torque for now, such as that of the thermal budget [N m].  Without
        `changes` of speed over the first sample of each move (n,), by the last plan, the torque at
        the start of a sample stays within the peak.
        """
        low, high = self._low, self._high
        rest, unit = self._winch.rest_torque, self._unit
        if cap < self.peak:
            low = np.maximum(low, (-cap - rest) / unit)
            high = np.minimum(high, (cap - rest) / unit)
        if self.narrows:
            there = np.abs(speeds)
            there[0] = abs(speed)
            top = self.limits.top(there, self.peak)
            low, high = np.maximum(low, (-top - rest) / unit), np.minimum(high, (top - rest) / unit)
        if changes is not None:
            most = _MOST * self.peak
            fall = np.clip(0.5 * self.fall * changes, -most, most) / unit
            low, high = low + fall, high + fall
        if self.voltage < math.inf:
            # u = u_rest + K omega + d / b within the voltage
            middle = self._winch.rest_command + self._winch.back * speed
            gain = self._winch.gain / unit
            first_low = (-self.voltage - middle) * gain
            first_high = (self.voltage - middle) * gain
            low, high = low.copy(), high.copy()
            # Where the two leave nothing, the speed is beyond what the voltage can brake: the
            # torque's bound counts, and the drive cuts the rest.
            low[0] = min(max(float(low[0]), first_low), float(high[0]))
            high[0] = max(min(float(high[0]), first_high), float(low[0]))
        return low, high

    def within(
        self, low: FloatArray, high: FloatArray, last: float, step: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return the bounds with the first move within a step [N m] of the last input [N m]."""
        low, high = low.copy(), high.copy()
        first = (last - step) / self._unit, (last + step) / self._unit
        # Where the window has moved away from the last torque, the window counts.
        low[0], high[0] = (min(max(float(e), first[0]), first[1]) for e in (low[0], high[0]))
        return low, high

    def asked(self, move: float, low: float, high: float, change: float) -> tuple[float, float]:
        """Return the input to ask of the drive, and the torque it then holds over the sample.

        A move at the edge of the window asks for as much more as keeps the drive at its peak to the
        end of the sample; elsewhere the held torque is NaN.  Its arguments are the first move, its
        bounds, and the change of speed over the sample, as planned [rad/s].
        """
        torque = min(max(move, low), high) * self._unit
        fall = min(max(self.fall * change, -2.0 * _MOST * self.peak), 2.0 * _MOST * self.peak)
        for edge, side in ((high, 1.0), (low, -1.0)):
            if abs(move - edge) < _EDGE:
                held = side * self.peak - self._winch.rest_torque
                more = max(0.0, side * 0.5 * fall) + _MORE * abs(fall)
                return torque + side * more, held
        return torque, math.nan


def _steadier_power(shown: list[tuple[float, float]]) -> bool:
    """Return whether power rather than torque stayed the same over samples of (torque, power)."""
    torques, powers = zip(*shown, strict=True)
    of_torque, of_power = max(torques) - min(torques), max(powers) - min(powers)
    return bool(of_power * max(torques) < of_torque * max(powers))


class TorqueBudget:
    """The motor's temperature, and the torque that keeps it below its rated rise.

    A winding of one time constant, theta' = ((tau / tau_rated)^2 - theta) / T_th, starting cold;
    the cap is the torque which, held over the horizon, would just bring it to its rated rise.
    """

    def __init__(self, case: Case, sample_time: float, horizon: float) -> None:
        constant = case.winch.motor.thermal_time_constant
        self._rated = case.winch.drive.torque_continuous
        self._share = -math.expm1(-sample_time / constant)
        self._ahead = -math.expm1(-horizon / constant)
        self._least = _STATIC * abs(case.static_torque_budget)
        self.reset()

    def reset(self) -> None:
        """Let the motor be cold."""
        self.rise = 0.0

    def update(self, torque: float) -> float:
        """Return the cap [N m] after a sample with a torque [N m]."""
        if math.isfinite(torque):
            self.rise += self._share * ((torque / self._rated) ** 2 - self.rise)
        left = (1.0 - self.rise * (1.0 - self._ahead)) / self._ahead
        return max(self._rated * math.sqrt(max(left, 0.0)), self._least)
