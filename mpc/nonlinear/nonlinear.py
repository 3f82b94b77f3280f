r"""Nonlinear model predictive control: a Gauss-Newton step a sample, in the place of a linear QP.

    last plan --> Shooting.linearise --> H, rows                                preparation
    m --> WinchEstimator --> chi --> Shooting.free --> gradient, bounds --> QP --> u   feedback

`NonlinearMPC` differs from `LinearMPC` in its model of the winch alone: cost, limits, estimator and
the path of the hook are those of `WinchMPC`.
"""

import math
import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from typing_extensions import Unpack, override

from models.basics import FloatArray, SolverError, check_range
from models.case import Case
from models.plant import DrumTravel
from models.sensing import HEARD, Measurement

from ..linear import WinchMPC, WinchOptions, path_of_sea, winch_signals
from .mean_torque import start_torque
from .responses import with_drift
from .shooting import Known, Linearisation, Shooting
from .stage import force_law, make_stage

_OWNER = "nonlinear predictive control"
_APPLIED = HEARD.index("drive.applied")
_NONE = (0.0, 0.0, -1.0)  # a command of which the drive cuts nothing


class NonlinearMPC(WinchMPC):
    r"""A predictive controller of the nonlinear winch within the limits of its drive.

    At every sample, with cost, limits and symbols of `LinearMPC`,

    .. math::

        \min_{d} \; J(x, d) \quad \text{subject to} \quad
        & x_{j+1} = A x_j + B d_j + \Gamma_w w_j + \Gamma_c c + F n_j, \\
        & n_j = \varphi(C x_j + D d_j + C_w w_j + C_c c + O n_j + y_{rest}), \\
        & \text{the limits of } \texttt{LinearMPC},
            \qquad |(\tau_0 + d_j) \, \omega_j| \le P_{max},

    where the forces n are quadratic drag, slack rope, layers of the drum (`mpc.nonlinear.stage`).
    It is solved by multiple shooting: the forces are linearised at the plan of the sample before, a
    sample on; what follows is a quadratic programme of the moves, and its answer is one
    Gauss-Newton step (M. Diehl, H. G. Bock and J. P. Schloeder, "A real-time iteration scheme for
    nonlinear optimization in optimal feedback control", SIAM J. Control Optim. 43, 2005).
    Linearising and condensing need no measurement and are done at the end of the step before; when
    the measurement is there, a few products of matrices with vectors and the solver are left.

    * n_j, (M m): forces that the linear plant lacks [N], [N m]; F, O: what they do
    * phi: forces as functions of a few numbers y (velocity of the payload, tensions, motor speed)
    * P_max: power of the drive [W]; a soft row for every block, hard for the first

    Parameters
    ----------
    case
        Vessel, sea, rope, payload, winch and sensors.
    horizon, sample_time, blocking, weights, predictor, masses
        As for `LinearMPC`.
    minimum_tension, excursion, thermal, deadline, prove, limits
        As for `LinearMPC`; the deadline is that of the feedback.
    iterations
        Gauss-Newton steps in a sample.
    drag, slack, travel
        What is nonlinear, as for `mpc.nonlinear.stage.force_law`.
    mean_torque
        Whether a move is the mean torque of a sample, which the drive can hold at its peak
        (`mpc.nonlinear.mean_torque`), else that at its start, as in `LinearMPC`.
    compiled
        Whether the forces are evaluated in C; by default where there is a compiler.
    name
        What it is called; by default after the predictor.

    Attributes
    ----------
    plan
        What the forces depend on over the horizon, by the last plan, (K my,).
    seconds
        What the last step took for feedback and preparation [s].

    Raises
    ------
    InputError
        If an argument is out of its range.
    SolverError
        If no weights are stable, or C was demanded and there is no compiler.

    Examples
    --------
    >>> from models import load_case
    >>> from mpc.winch import ProcessNoise, Weights
    >>> weights = Weights(torque=0.02, noise=ProcessNoise(force=0.1, torque=0.05, rope=0.1))
    >>> controller = NonlinearMPC(load_case("thesis-1975"), weights=weights)
    >>> controller.name, controller.stage.channels
    ('nonlinear-mpc', ('drag', 'slack.0'))
    """

    plan: FloatArray
    _moves: FloatArray

    def __init__(
        self,
        case: Case,
        *,
        iterations: int = 1,
        drag: bool = True,
        slack: Sequence[int] | None = None,
        travel: DrumTravel | None = None,
        mean_torque: bool = True,
        compiled: bool | None = None,
        **options: Unpack[WinchOptions],
    ) -> None:
        check_range(_OWNER, "iterations", iterations, low=1, high=1000)
        super().__init__(case, **options)
        if options.get("name") is None:
            self.name = f"nonlinear-{self.name}"
        self.iterations = int(iterations)
        winch = self.model.winch
        law = force_law(winch, drag=drag, slack=slack, travel=travel)
        self.stage = make_stage(winch, law, mean=mean_torque, compiled=compiled)
        model = self.model
        if mean_torque:
            model = replace(model, winch=self.stage.winch)
        signals = with_drift(winch_signals(winch), self.stage)
        self.programme = p = self._condense(model, signals)
        self.products = products = self._products(model, p)
        self.shooting = Shooting(
            model,
            self.regulator,
            p,
            products,
            self.stage,
            self._sea_covariance,
            self.estimator.model,
        )
        powers = self._further = len(p.blocks) - 1 if self.window.narrows else 0
        self._low = np.concatenate([p.row_low, -np.ones(powers)])
        self._high = np.concatenate([p.row_high, np.ones(powers)])
        self._ends = path_of_sea(self.model, 1)
        self._starts = np.array(p.horizon.starts, dtype=np.float64)
        self._rows = np.vstack([p.qp.rows, np.zeros((powers, len(p.blocks)))])
        # Where a plan has left all sense, its slopes are not to be trusted with the solver.
        reach = [_reach(name, self.model.winch.rest_tension) for name in self.stage.arguments]
        span = np.tile(reach, self.shooting.nodes)
        self._sane = self.shooting.rest - span, self.shooting.rest + span
        self._resting = self.shooting.linearise(np.array(self.shooting.rest))
        self.qp = p.solver(self._rows)
        self.reset()

    @override
    def reset(self) -> None:
        """Forget every earlier measurement."""
        self.qp.change(self._resting.H, self._rows.copy())
        super().reset()
        self._counts["forgotten"] = 0
        self._cuts = [_NONE] * (self.model.winch.waiting + 1)
        self.seconds: Mapping[str, float] = {"feedback": 0.0, "preparation": 0.0}
        self._forget()
        self._prepare()

    @override
    def step(self, measurement: Measurement, time: float) -> float:
        """Return the drive command, its static part included [V, rad/s or N m]."""
        began = clock.perf_counter()
        shown, winch, shooting = measurement.values, self.model.winch, self.shooting
        uncut, partly = self._uncut(float(shown[_APPLIED])), self._cuts[-1] is not _NONE
        chi = self._hear(measurement, time, uncut, partly=partly)
        ahead, known = shooting.known(chi)
        self.estimator.advance(ahead)
        reference = self._reference(shown)
        if reference.any():
            known = shooting.shifted(known, reference)
        forecast = self._forecast(shown, time)
        if forecast is not None:
            known = shooting.along(known, forecast.displacement, forecast.velocity)
            ends = np.array([forecast.displacement[:2], forecast.velocity[:2]]).T.ravel()
        else:  # of the estimator's own sea, at both ends of this sample
            ends = self._ends @ chi[self.model.sea_at]
        speed = self.estimator.speed
        turns = self.inertia.turns(self.programme.unit)
        low, high = (
            turns.planned(bound)
            for bound in self.hard_bounds(speed + self._gain_of_speed(chi, ends), self._cap(shown))
        )
        move: float | None = None
        # The first step is on what was prepared after the last sample; only further ones have to
        # linearise while the drive waits.
        for k in range(self.iterations):
            if k > 0:
                self._prepare()
            found = self._feedback(known, low, high, began)
            if found is None:
                break
            move = found
        if move is None and math.isfinite(self._other):
            self._cuts = [_NONE, *self._cuts[:-1]]
            command = self._passed_on()
        else:
            if move is None:
                move = self._otherwise(chi, reference)
            move = min(max(move, float(low[0])), float(high[0]))
            torque = turns.asked(move) * self.programme.unit
            # What the torque falls by over the sample goes with the speed that is planned.
            over = self._drift(chi, move * self.programme.unit, ends)
            command = self._given(self._command(torque, speed, over))
            self._tell(torque + winch.rest_torque)
        answered = clock.perf_counter()
        # The command is known; the rest needs no measurement, and has what is left of the time.
        self.prepare()
        done = clock.perf_counter()
        self.seconds = {"feedback": answered - began, "preparation": done - answered}
        return command

    def prepare(self) -> None:
        """Linearise and condense at the last plan, a sample on: all that needs no measurement."""
        self.plan = self.shooting.later(self.plan)
        moves = np.append(np.repeat(self._moves, self.programme.blocks), self._moves[-1])
        self._moves = moves[1:][self._starts.astype(int)]
        self._speeds = np.interp(self._starts + 1.0, self._starts, self._speeds)
        self._prepare()

    def optimise(
        self, chi: FloatArray, *, iterations: int = 50, tolerance: float = 1e-8
    ) -> FloatArray:
        """Return the moves (nb,) for a state chi (n,), iterated until they change no more.

        Where a slack rope leaves the soft row of the tension no way to be kept, rounding of the
        programme's data alone (1e-15) moves its answer by 1e-9: a finer tolerance is never met.

        Raises
        ------
        SolverError
            If they still change by more than the tolerance.
        """
        _, known = self.shooting.known(chi)
        speed = float(self.model.winch.reckoned @ chi[: self.model.winch.size])
        low, high = self.hard_bounds(speed)
        moves = np.full(len(self.programme.blocks), math.inf)
        for _ in range(iterations):
            self._prepare(exact=True)
            if self._feedback(known, low, high, clock.perf_counter()) is None:
                break
            if float(np.abs(self._moves - moves).max()) <= tolerance:
                return self._moves
            moves = self._moves
        raise SolverError(f"{_OWNER}: the moves have not settled in {iterations} iterations")

    def hard_bounds(self, speed: float, cap: float = math.inf) -> tuple[FloatArray, FloatArray]:
        """Return the lowest and highest moves (nb,) at a motor speed [rad/s] and a cap [N m].

        The power of later moves has rows of its own, but for one that was learnt of a drive that
        is told to have no limit of it.
        """
        speeds = np.zeros(len(self.programme.blocks)) if self._further else self._speeds
        return self.window.bounds(speed, speeds, cap)

    def _drift(self, chi: FloatArray, torque: float, ends: FloatArray) -> float:
        """Return what a move [N m] has at the start of the sample over its mean [N m]."""
        of = self.model.constants_at.start
        return self.stage.drift(chi[: self.model.winch.size], torque, ends, chi[of : of + 2])

    def _command(self, torque: float, speed: float, over: float) -> float:
        """Return the drive command that gives a mean torque, and so much more at first [N m]."""
        winch = self.model.winch
        self._cuts = [_NONE, *self._cuts[:-1]]
        if over == 0.0 or not math.isfinite(over):
            return winch.command(torque, speed)
        window, rest = self.window, winch.rest_torque
        peak = float(window.limits.top(speed, window.peak))
        # A held command lets the torque fall with the speed; where it starts beyond the peak, the
        # drive cuts it, and what it then does is no longer linear in the command.
        asked = winch.command(start_torque(torque + rest, over, peak) - rest, speed)
        same = winch.command(torque + over, speed)
        if asked != same:
            self._cuts[0] = (asked, same, 3.0 * abs(over / winch.gain))
        return asked

    def _power(self) -> FloatArray:
        """Return the highest power of later moves at the plan's speeds, breakdown included [W]."""
        limits, fast = self.window.limits, np.maximum(np.abs(self._speeds[1:]), 1e-9)
        return np.minimum(limits.power, limits.breakdown / fast)

    def _gain_of_speed(self, chi: FloatArray, ends: FloatArray) -> float:
        """Return the mean motor speed of the sample over that at its start, as planned [rad/s]."""
        winch = self.model.winch
        over = self._drift(chi, self.programme.unit * float(self._moves[0]), ends)
        falls = winch.gain * winch.back
        return over / falls if falls > 0.0 and math.isfinite(over) else 0.0

    def _uncut(self, applied: float) -> float:
        """Return the command that, never cut, has the torque's mean of the last sample.

        A drive that cut the torque for a part of the sample says what it applies at the end of it.
        NaN where it cut nothing, or says something else: a brake, another hand on the drive.  Of
        late commands it is said of the newest, as the drive says what it has cut.
        """
        asked, same, reach = self._cuts[-1]
        if self.model.winch.waiting:
            other, meant, far = self._cuts[-2 if self._share < 1.0 else -1]
            more = self._share * (same - asked) + (1.0 - self._share) * (meant - other)
            asked, reach = self.estimator.given, max(reach, far)
            same = asked + more
        return same if abs(applied - asked) <= reach else math.nan

    def _prepare(self, *, exact: bool = False) -> None:
        """Linearise and condense at arguments, moves and speeds of the plan."""
        if math.isfinite(float(self.plan.sum())):
            np.clip(self.plan, *self._sane, out=self.plan)
            self._prepared: Linearisation = self.shooting.linearise(self.plan, exact=exact)
            if self._condensed():
                return
        # A plan that is beyond all numbers is forgotten.
        self._counts["forgotten"] += 1
        self._forget()
        self._prepared = self._resting
        self._condensed()

    def _forget(self) -> None:
        """Forget the plan: the load hangs at rest."""
        self.plan = np.array(self.shooting.rest)
        self._moves = np.zeros(len(self.programme.blocks))
        self._speeds = np.zeros(len(self.programme.blocks))

    def _condensed(self) -> bool:
        """Give the linearisation to the solver; return whether it takes it."""
        p, S = self.programme, self._prepared.outputs
        rows = np.empty_like(self.qp.rows)
        count = len(p.at)
        rows[:count] = S[self.shooting.rows]
        if len(rows) > count:
            # (tau_0 + d) omega is a product of two things that the moves change: linearised at the
            # plan's torques and speeds, over the power.
            power = self._power()
            torque = self.model.winch.rest_torque + p.unit * self._moves
            rows[count:] = (torque[1:] / power)[:, None] * S[self.shooting.speeds][1:]
            later = np.arange(1, len(p.blocks))
            rows[count + later - 1, later] += p.unit / power * self._speeds[1:]
        return self.qp.change(self._prepared.H, rows)

    def _feedback(
        self, known: Known, low: FloatArray, high: FloatArray, began: float
    ) -> float | None:
        """Return the first move of one Gauss-Newton step, None if there is none that is good."""
        shooting, prepared, p = self.shooting, self._prepared, self.programme
        gradient, o, n = shooting.free(prepared, known)
        free = o[shooting.rows]
        if len(self._low) > len(free):
            # (tau0 + d) omega, linearised, over the power
            rest, power = self.model.winch.rest_torque, self._power()
            moves, speeds = p.unit * self._moves[1:], self._speeds[1:]
            value = (rest + moves) * o[shooting.speeds][1:] - moves * speeds
            free = np.concatenate([free, value / power])
        lower = np.concatenate([low, self._low - free])
        upper = np.concatenate([high, self._high - free])
        move = self._solve((gradient, lower, upper), began)
        if move is None or self.solved is None:
            return None
        v = self.solved.v
        self.plan = shooting.arguments(prepared, known, n, v)
        self._moves = v
        self._speeds = o[shooting.speeds] + prepared.outputs[shooting.speeds] @ v
        return move


def _reach(argument: str, tension: float) -> float:
    """Return how far from rest an argument may be: 20 m/s, five times the static tension."""
    if argument.startswith("spring."):
        return 5.0 * tension
    return 20.0 if argument == "payload.velocity" else math.inf
