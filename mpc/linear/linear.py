r"""Linear model predictive control of the winch, one quadratic programme a sample: `LinearMPC`.

    m --> WinchEstimator --> chi --> one matrix product --> gradient, bounds --> QP --> torque --> u

`LinearMPC` is a controller for the simulator (`models.sensing.control.Controller`): it hears what
the sensors show, and commands the drive.
"""

import math
import time as clock

import numpy as np
from typing_extensions import Unpack, override

from models.basics import check_range
from models.case import Case
from models.sensing import HEARD, Measurement

from .winch_mpc import WinchMPC, WinchOptions

_SAME = 1e-3  # of the peak torque
_TORQUE, _SPEED = HEARD.index("motor.torque"), HEARD.index("motor.speed")


class LinearMPC(WinchMPC):
    r"""A predictive controller of the linear winch within the limits of its drive.

    At every sample k, with the estimate chi of winch x, constants c and sea from
    `mpc.winch.estimator.WinchEstimator`,

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
    * omega, F, u: motor speed [rad/s], tension at the payload [N], drive command
    * tau_0, tau(omega): torque at rest; peak torque, or less at the power limit and where the
      motor's thermal budget is used up [N m]
    * rho: weight on the input [m2/(N m)2]; P, N_zeta: value function (`mpc.programme.regulator`)

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
        Where the hook's path comes from: ``bank`` (Wiener forecasts of the sea that is told and of
        others, by the errors they make), ``kalman`` (the estimator's own sea, which it holds to be
        as told), ``ar`` (learnt on line from the hook as the filter knows it), ``preview`` (the
        record itself, for reference only), or a `mpc.forecast.forecast.Predictor` of the same
        sample time and horizon, which is shown what the estimator knows of the hook if it has
        ``fused = True``, else what the unit shows.
    preview
        What somebody else foretells of the hook, such as a wave radar: a predictor of the horizon
        or less, fused by its standard deviations with `predictor`, which must not be ``kalman``.
    masses
        Masses along the rope; by default those of the case.
    minimum_tension
        Least tension at the payload that is aimed at [N], with its least weight; by default that of
        the case, else a tenth of this weight.
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
    fallback
        Who commands where the programme has no answer in time: any controller of the same sample
        time, which hears every sample; by default the programme's own law without limits.

    Raises
    ------
    InputError
        If an argument is out of its range.
    SolverError
        If no weights are stable.

    Examples
    --------
    >>> from models import load_case
    >>> from mpc.winch import ProcessNoise, Weights
    >>> weights = Weights(torque=0.02, noise=ProcessNoise(force=0.1, torque=0.05, rope=0.1))
    >>> controller = LinearMPC(load_case("thesis-1975"), weights=weights)
    >>> controller.name, controller.horizon, len(controller.programme.blocks)
    ('mpc', 8.0, 32)
    """

    def __init__(
        self, case: Case, *, torque_rate: float | None = None, **options: Unpack[WinchOptions]
    ) -> None:
        if torque_rate is not None:
            check_range(
                "predictive control",
                "torque_rate",
                torque_rate,
                low=0.0,
                unit="N m/s",
                open_low=True,
            )
        super().__init__(case, **options)
        free = np.eye(len(self._blocks))
        links = None if torque_rate is None else free[1:] - free[:-1]
        self.programme = p = self._condense(self.model, links=links)
        self.products, self.qp = self._products(self.model, p), p.qp
        self._lengths = np.array(p.blocks[:-1], dtype=np.float64)
        # Change of torque from each move to the next, and over one sample.
        self._at_most = math.inf if torque_rate is None else torque_rate * self.sample_time
        steps = np.zeros(0) if torque_rate is None else self._at_most * self._lengths / p.unit
        self._rates = (-steps, steps)
        self.reset()

    @override
    def reset(self) -> None:
        """Forget every earlier measurement."""
        super().reset()
        self._changes = np.zeros(len(self.programme.blocks))
        # Of each command on its way, the newest first: the torque it holds, and itself.
        self._past = [(math.nan, 0.0)] * (self.model.winch.waiting + 1)
        self._before = 0.0  # the motor's speed at the last sample [rad/s]

    @override
    def step(self, measurement: Measurement, time: float) -> float:
        """Return the drive command, its static part included [V, rad/s or N m]."""
        began = clock.perf_counter()
        shown, winch, products = measurement.values, self.model.winch, self.products
        chi = self._hear(measurement, time, self._held(float(shown[_TORQUE]), float(shown[_SPEED])))
        ahead, gradient, free = products.known(chi)
        self.estimator.advance(ahead)
        if winch.waiting:
            self._before = float(winch.speed @ chi[: winch.size])
        reference = self._reference(shown)
        if reference.any():
            gradient, free = products.shifted(gradient, free, reference)
        forecast = self._forecast(shown, time)
        if forecast is not None:
            gradient, free = products.along(gradient, free, forecast)
        speed, cap = self.estimator.speed, self._cap(shown)
        # Only its own limits does the drive keep by itself.
        leaning = cap >= self.window.peak and self._at_most == math.inf
        low, high = self.window.bounds(speed, self._speeds, cap, self._changes if leaning else None)
        if self._at_most < math.inf:
            low, high = self.window.within(
                low, high, self._asked - winch.rest_torque, self._at_most
            )
        turns = self.inertia.turns(self.programme.unit)
        lower, upper = turns.planned(low), turns.planned(high)
        rates = self._rates[0] / turns.ratio, self._rates[1] / turns.ratio
        # The bounds at speeds of the last plan make a convex programme of one that is not: torque
        # times speed is limited, and the plan changes little from sample to sample.
        question = self.programme.question(gradient, free, lower, upper, rates)
        move = self._solve(question, began)
        if self.solved is not None:
            self._speeds = products.speeds(chi, self.solved.v)
            self._changes[:-1] = (self._speeds[1:] - self._speeds[:-1]) / self._lengths
        if move is None and math.isfinite(self._other):
            command = self._passed_on()
            self._past = [(math.nan, command), *self._past[:-1]]
            return command
        if move is None:
            move = self._otherwise(chi, reference)
        move = turns.asked(move)
        # At the edge of its window the drive is asked for more than its peak, so that it holds it
        # though the speed rises over the sample; the estimator is told so at the next one.
        if leaning:
            torque, kept = self.window.asked(
                move, float(low[0]), float(high[0]), float(self._changes[0])
            )
        else:
            torque, kept = min(max(move, low[0]), high[0]) * self.programme.unit, math.nan
        command = self._given(winch.command(torque, speed))
        self._past = [(kept, command), *self._past[:-1]]
        self._tell(min(max(torque + winch.rest_torque, -self.window.peak), self.window.peak))
        return command

    def _held(self, torque: float, speed: float) -> float:
        """Return the command that does as much as the torque held over the last sample.

        The drive was asked to hold its peak, and shows that it still did at the end [N m], at a
        motor speed [rad/s]; NaN if it did not.  Of late commands that is said of the newest one, as
        the drive says what it has cut.
        """
        winch, share = self.model.winch, self._share
        before = self._before if winch.waiting else self.estimator.speed
        (kept, oldest), (other, next_one) = self._past[-1], self._past[-2 if share < 1.0 else -1]
        if kept != other or not abs(torque - winch.rest_torque - kept) < _SAME * self.window.peak:
            return math.nan
        told = share * oldest + (1.0 - share) * next_one
        # A torque that is held does as much as one that falls to as much below it.
        fall = 0.5 * winch.gain * winch.back * (speed - before)
        return winch.command(kept + fall, before) + (self._past[0][1] - told)
