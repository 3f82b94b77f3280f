r"""Linear model predictive control: the whole controller, one step a sample.

    m --> Estimator --> chi --> one matrix product --> gradient, bounds --> QP --> torque --> u

`LinearMPC` is a controller for the simulator (`models.sensing.control.Controller`): it hears what
the sensors show, and commands the drive.
"""

from __future__ import annotations

import math
import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from models.basics import FloatArray, InputError, check_range
from models.case import Case
from models.plant import SPEED_BAND, DriveLimits
from models.sensing import Measurement
from models.sensing.control import MEASURED as HEARD

from ..forecast import AdaptiveAR, PerfectPreview
from ..programme import SoftQP, Solved, kkt_residual
from ..winch import (
    Estimator,
    PredictionModel,
    Weights,
    plan_model,
    prediction_model,
    regulator,
    tune_weights,
    with_noise,
)
from .condensed import condense, default_blocking
from .drive_window import DriveWindow, TorqueBudget
from .fallback import Fallback
from .products import Products

if TYPE_CHECKING:
    from models.operation import Motion

    from ..forecast import Predictor


_OWNER = "predictive control"
_QUADRATIC, _LINEAR = 1e4, 1e2  # price of a soft row, over its scale, in units of the cost
_CLEAR = 1.5 * SPEED_BAND  # of the highest speed, kept clear of the drive's own overspeed cut
_HORIZON, _PREVIEWED = 8.0, 14.0  # [s]
_PROVED = 1e-6  # residual of the optimality conditions
_SAME = 1e-3  # of the peak torque
_IN_BAND = 3.0  # [rad/s]
_LEAST = 0.1  # of the static tension, that is to stay in the rope
_UNIT, _TORQUE = HEARD.index("mru.valid"), HEARD.index("motor.torque")
_HEAVE, _RATE = HEARD.index("mru.heave"), HEARD.index("mru.heave_rate")
_REFERENCE = HEARD.index("reference.displacement")


class LinearMPC:
    r"""A predictive controller of the linear winch within the limits of its drive.

    At every sample k, with the estimate chi of winch x, constants c and sea from
    `mpc.winch.estimator.Estimator`,

    .. math::

        \min_{d_0 \ldots d_{N-1}} \;& \sum_{j=1}^{N-1} (p_j - r_j)^2
            + \rho \sum_{j=0}^{N-1} (d_j - d_\infty c)^2
            + x_N' P x_N + 2 x_N' N_\zeta \zeta_N + \text{price of the soft limits} \\
        \text{subject to} \;& x_{j+1} = A x_j + B d_j
            + \Gamma_w (z_j, \dot z_j, z_{j+1}, \dot z_{j+1}) + \Gamma_c c, \quad x_0 = \hat x, \\
        & |d_j + \tau_0| \le \tau(\omega_j), \qquad |u_0| \le V \quad \text{(hard)}, \\
        & |\omega_j| \le \omega_{max}, \quad F_j \ge F_{min}, \quad |u_j| \le V,
            \quad |p_j - r_j| \le p_{max} \quad \text{(soft)}, \\
        & |d_{j+1} - d_j| \le \dot\tau T \quad \text{(hard, if asked for)}, \qquad
            d \text{ constant over each block,}

    and the first torque is asked of the drive by the command u = u_rest + K omega + d_0 / b.

    Symbols (sizes; units):

    * x, (nx): winch, rope and sensors' filters, deviations from rest; A, B, Gamma: `SampledWinch`
    * d, (N): torque over the one at rest, at the start of a sample [N m]; nb blocks of it are free
    * p, (N): payload's displacement [m]; r: what the operator asks for [m]
    * z, (N + 1): the hook's predicted displacement [m]
    * c, (2): estimated force on the payload [N], torque at the motor [N m]
    * omega, F, u: motor speed [rad/s], tension at the drum [N], drive command
    * tau_0, tau(omega): torque at rest; peak torque, or less at the power limit and where the
      motor's thermal budget is used up [N m]
    * rho: weight on the input [m2/(N m)2]; P, N_zeta: value function (`mpc.winch.regulation`)

    A, B and Gamma are those of a rope that is stiffer than the estimator's (`mpc.winch.planning`),
    so that a saturated loop stays stable on loads and ropes that are not as in the case.

    Parameters
    ----------
    case
        Vessel, sea, rope, payload, winch and sensors.
    horizon
        Length of the prediction [s]; by default 8, or 14 with perfect preview, which can use more.
    sample_time
        T [s].
    blocking
        Length of each block of moves in samples; their sum is the horizon.  By default some thirty
        blocks that grow.
    weights
        What is weighed; by default tuned for the case, which takes some seconds
        (`mpc.winch.weights.tune_weights`); with perfect preview the plan is then made on the rope
        that is there.
    predictor
        Where the hook's path comes from: ``kalman`` (the estimator's own sea), ``ar`` (learnt on
        line, no knowledge of the spectrum), ``preview`` (the record itself, for reference only), or
        a `mpc.forecast.forecast.Predictor` of the same sample time and horizon.
    masses
        Masses along the rope; by default those of the case.
    minimum_tension
        Least tension at the drum that is aimed at [N]; by default that of the case, else a tenth of
        the static one.
    excursion
        Largest displacement of the payload that is aimed at [m]; by default none.
    torque_rate
        Highest rate at which the torque may be asked to change [N m/s]; by default none.
    thermal
        Whether the torque is cut back before the motor's windings get hotter than rated.
    deadline
        Longest time for one step [s]; by default none, so that runs can be repeated to the bit.
    prove
        Whether every answer is checked against its optimality conditions; those that fail are
        counted as ``unproved``.
    limits
        Limits of the drive; by default those of the case.
    name
        What it is called; by default after the predictor.

    Raises
    ------
    InputError
        If an argument is out of its range.
    SolverError
        If no weights are stable.

    Examples
    --------
    >>> from models import load_case
    >>> from mpc.winch import ProcessNoise
    >>> weights = Weights(torque=0.02, noise=ProcessNoise(force=0.1, torque=0.05, rope=0.1))
    >>> controller = LinearMPC(load_case("thesis-1975"), weights=weights)
    >>> controller.name, controller.horizon, len(controller.programme.blocks)
    ('mpc', 8.0, 32)
    """

    def __init__(
        self,
        case: Case,
        *,
        horizon: float | None = None,
        sample_time: float = 0.05,
        blocking: Sequence[int] | None = None,
        weights: Weights | None = None,
        predictor: Literal["kalman", "ar", "preview"] | Predictor = "kalman",
        masses: int | None = None,
        minimum_tension: float | None = None,
        excursion: float | None = None,
        torque_rate: float | None = None,
        thermal: bool = False,
        deadline: float | None = None,
        prove: bool = False,
        limits: DriveLimits | None = None,
        name: str | None = None,
    ) -> None:
        T = check_range(_OWNER, "sample_time", sample_time, low=0.0, unit="s", open_low=True)
        if horizon is None:
            horizon = _PREVIEWED if predictor == "preview" else _HORIZON
        blocks = default_blocking(horizon, T) if blocking is None else tuple(blocking)
        least = _least_tension(case) if minimum_tension is None else minimum_tension
        check_range(_OWNER, "minimum_tension", least, low=0.0, unit="N")
        if torque_rate is not None:
            check_range(_OWNER, "torque_rate", torque_rate, low=0.0, unit="N m/s", open_low=True)
        if deadline is not None:
            check_range(_OWNER, "deadline", deadline, low=0.0, unit="s", open_low=True)
        if weights is None:
            weights = tune_weights(case, sample_time=T, masses=masses)
            if predictor == "preview":  # who knows the future may know the rope
                weights = replace(weights, stiffness=1.0)
        self.case, self.sample_time, self.weights = case, T, weights
        believed = with_noise(prediction_model(case, sample_time=T, masses=masses), weights.noise)
        self.model = plan_model(believed, weights.stiffness)
        self.regulator = regulator(self.model, weights.torque)
        self.estimator = Estimator(believed)
        limits = DriveLimits.from_case(case) if limits is None else limits
        self.soft_limits = _soft_limits(self.model, limits, least, excursion)
        self.programme = condense(self.model, self.regulator, blocks, tuple(self.soft_limits))
        p = self.programme
        self.predictor, word = _predictor(case, predictor, T, p.steps * T)
        self.name = word if name is None else name
        covariance = None if self.predictor is None else self.estimator.sea_covariance
        self.products = Products.of(self.model, p, self.soft_limits, covariance, believed)
        self.qp = SoftQP(
            p.H,
            self.products.rows,
            quadratic=_QUADRATIC,
            linear=_LINEAR,
            hard=None
            if torque_rate is None
            else np.eye(len(blocks))[1:] - np.eye(len(blocks))[:-1],
            time_limit=0.0 if deadline is None else deadline,
        )
        self._lengths = np.array(p.blocks[:-1], dtype=np.float64)
        self._deadline = math.inf if deadline is None else deadline
        self._window = DriveWindow(self.model.winch, limits, len(p.blocks), p.unit)
        # Change of torque from each move to the next, and over one sample.
        steps = np.zeros(0) if torque_rate is None else torque_rate * T * self._lengths / p.unit
        self._rates = (-steps, steps)
        self._at_most = math.inf if torque_rate is None else torque_rate * T
        self._prove = prove
        self._budget = TorqueBudget(case, T, self.horizon) if thermal else None
        self._fallback = Fallback(p.blocks)
        self.reset()

    @property
    def horizon(self) -> float:
        """Length of the prediction [s]."""
        return self.programme.steps * self.sample_time

    @property
    def counts(self) -> Mapping[str, int]:
        """Steps, iterations of the solver, and how often which fallback was used."""
        return dict(self._counts)

    def reset(self) -> None:
        """Forget every earlier measurement."""
        self.estimator.reset()
        self.qp.reset()
        self._fallback.reset()
        if self._budget is not None:
            self._budget.reset()
        if self.predictor is not None:
            self.predictor.reset()
        self._speeds = np.zeros(len(self.programme.blocks))
        self._changes = np.zeros(len(self.programme.blocks))
        self._asked = self.model.winch.rest_torque  # of the drive at the sample before [N m]
        self._kept = math.nan
        self._counts = dict.fromkeys(
            ("steps", "iterations", "late", "shifted", "safe", "unproved"), 0
        )
        self.question: tuple[FloatArray, FloatArray, FloatArray] | None = None
        self.solved: Solved | None = None

    def foresee(self, motion: Motion) -> None:
        """Give the record to come to a predictor that needs it."""
        given = getattr(self.predictor, "foresee", None)
        if given is not None:
            given(motion)

    def step(self, measurement: Measurement, time: float) -> float:
        """Return the drive command, its static part included [V, rad/s or N m]."""
        began = clock.perf_counter()
        shown, winch, products = measurement.values, self.model.winch, self.products
        self._counts["steps"] += 1
        chi = self.estimator.update(measurement, self._held(float(shown[_TORQUE])))
        ahead, gradient, free = products.known(chi)
        self.estimator.advance(ahead)
        reference = shown[_REFERENCE : _REFERENCE + 2]
        if reference.any():
            gradient, free = products.shifted(gradient, free, reference)
        if self.predictor is not None:
            heave, rate = float(shown[_HEAVE]), float(shown[_RATE])
            self.predictor.update(heave, rate, bool(shown[_UNIT] > 0.5), time)
            gradient, free = products.along(gradient, free, self.predictor.forecast())
        speed = self.estimator.speed
        cap = math.inf
        if self._budget is not None:
            # Over a sample the torque falls or rises with the speed: the larger end counts.
            cap = self._budget.update(max(abs(float(shown[_TORQUE])), abs(self._asked)))
        # Only its own limits does the drive keep by itself.
        leaning = cap >= self._window.peak and self._at_most == math.inf
        low, high = self._window.bounds(
            speed, self._speeds, cap, self._changes if leaning else None
        )
        if self._at_most < math.inf:
            low, high = self._window.within(
                low, high, self._asked - winch.rest_torque, self._at_most
            )
        question = products.question(gradient, free, low, high, self._rates)
        move = self._solve(question, began)
        if self.solved is not None:
            self._speeds = products.speeds(chi, self.solved.v)
            self._changes[:-1] = (self._speeds[1:] - self._speeds[:-1]) / self._lengths
        if move is None:
            move = self._otherwise(speed)
        if leaning:
            torque, self._kept = self._window.asked(
                move, float(low[0]), float(high[0]), float(self._changes[0])
            )
        else:
            torque, self._kept = min(max(move, low[0]), high[0]) * self.programme.unit, math.nan
        command = winch.command(torque, speed)
        self._asked = min(max(torque + winch.rest_torque, -self._window.peak), self._window.peak)
        return min(max(command, -self._window.voltage), self._window.voltage)

    def _held(self, torque: float) -> float:
        """Return the torque that the drive has held over the last sample, NaN if it did not.

        It was asked to hold its peak, and shows that it still did at the end [N m].
        """
        rest = self.model.winch.rest_torque
        if abs(torque - rest - self._kept) < _SAME * self._window.peak:
            return self._kept
        return math.nan

    def _solve(
        self, question: tuple[FloatArray, FloatArray, FloatArray], began: float
    ) -> float | None:
        """Return the first move of the answer, None if there is none that is good."""
        self.question, self.solved = question, None
        if not all(math.isfinite(float(part.sum())) for part in question):
            self.estimator.reset()
            return None
        solved = self.qp.solve(*question)
        self._counts["iterations"] += solved.iterations
        if not (solved.ok and math.isfinite(float(solved.v.sum()))):
            self.qp.reset()
            return None
        if self._prove and kkt_residual(self.qp, *question, solved) > _PROVED:
            self._counts["unproved"] += 1
        if clock.perf_counter() - began > self._deadline:
            self._counts["late"] += 1
            return None
        self.solved = solved
        self._fallback.keep(solved.v)
        return float(solved.v[0])

    def _otherwise(self, speed: float) -> float:
        """Return the move of the last plan, or the one that holds the drum."""
        move = self._fallback.shifted()
        if move is not None:
            self._counts["shifted"] += 1
            return move
        self._counts["safe"] += 1
        winch = self.model.winch
        return winch.torque(winch.rest_command, speed) / self.programme.unit


def _least_tension(case: Case) -> float:
    given = case.limits.minimum_tension
    return _LEAST * case.static_tension if given is None else float(given)


def _soft_limits(
    model: PredictionModel, limits: DriveLimits, least: float, excursion: float | None
) -> dict[str, tuple[float, float]]:
    """Return the soft limits by signal, as deviations from rest: (lowest, highest)."""
    winch = model.winch
    found = {"tension": (least - winch.rest_tension, math.inf)}
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
    case: Case, given: str | Predictor, sample_time: float, horizon: float
) -> tuple[Predictor | None, str]:
    """Return the predictor, None for the estimator's own sea, and the controller's name."""
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
    if given == "ar":
        unit = case.sensors.mru
        if unit is None:
            return AdaptiveAR(sample_time=sample_time, horizon=horizon), "mpc-ar"
        # An error within the band of the waves cannot be told from them.
        error = unit.noise_floor if unit.noise_bandwidth < _IN_BAND else 0.0
        learnt = AdaptiveAR(sample_time=sample_time, horizon=horizon, delay=unit.delay, error=error)
        return learnt, "mpc-ar"
    if given == "preview":
        return PerfectPreview(sample_time=sample_time, horizon=horizon), "mpc-preview"
    raise InputError(
        f"{_OWNER}: predictor must be one of kalman, ar, preview or a Predictor, got {given!r}"
    )
