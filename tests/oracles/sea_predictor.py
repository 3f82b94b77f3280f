r"""The hook's motion foretold by who knows the sea: a Kalman filter on a shaping filter.

    case --> spectrum of the hook --> shaping filter --+
                    MRU: high-pass, error, delay ------+--> steady-state Kalman filter --> Forecast

The hook's displacement is the answer of a rational filter to white noise (`sea_fit`);
the reference unit's high-pass and error (`models.sensing.mru`) are states beside it, and what it
shows is heave and heave rate together.  Everything is Gaussian and linear, so the filter's forecast
is the best there is for the fitted spectrum; how much the fit costs against the true one is known
too, and the standard deviations stated are those for the *true* spectrum.

Delay.  Whole samples cost nothing: the hook's states are estimated at the time that is being
shown, and foretold for lead + delay.  The rest of a sample is linear interpolation in the unit's
model, so the sample before is carried as two states.  The error is not late and needs neither.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg
from sea_fit import fit_for_forecast
from sea_model import SeenHook, seen_hook, true_variances

from models.basics import FloatArray, SolverError, check_range, read_only
from models.hook import HookMotion
from models.sensing import MruModel
from mpc.forecast import Forecast
from mpc.forecast.forecast import leads_of

if TYPE_CHECKING:
    from models.case import Case


_SETTLED = 0.02  # excess of a variance over the steady one, of the motion's, that no longer counts
_CHECK_EVERY = 10  # samples between two looks whether it has settled
_LARGEST = 1e3  # times the rms: what is larger is no measurement


class SeaPredictor:
    """Steady-state Kalman filter for the hook's motion in the case's sea.

    Parameters
    ----------
    case
        Sea, vessel and MRU.  A case without an MRU has a perfect one, and `floor` is all the
        noise there is.
    sample_time
        Time between samples and between leads [s].
    horizon
        Last lead [s].
    order
        Order of the shaping filter: 10 or 12, fitted for forecasting (`sea_fit`), or
        at most 4, 6 or 8, fitted to the spectrum (`models.plant.shaping`): the one of these that is
        nearest in the L1 norm.
    floor
        Standard deviation of white noise that the filter assumes on top of the unit's error, of
        heave and of heave rate times the hook's rms displacement and velocity [-].  Without any
        noise an analytic signal could be foretold for ever, from derivatives that no unit shows.
    hook
        The hook's motion; None for that of the case's sea.

    Attributes
    ----------
    shaping
        The fitted filter, with its `shape_error` and `variance_error`.
    displacement_rms, velocity_rms
        Standard deviations of the hook's motion [m], [m/s].

    Raises
    ------
    InputError
        If a number is out of its range.
    SolverError
        If no filter can be fitted, or the Riccati equation has no solution.

    Notes
    -----
    After `reset` and after missing samples the gain is not the steady one: until the forecast is
    within 2 % of the motion's variance of its steady quality, the covariance is carried along
    (some 40 us a sample instead of 5), and `forecast` states the standard deviation of that
    moment.  The Riccati equation is that of the filtered covariance, with the correlation of
    state and measurement noise that it brings, so that noise-free heave and rate with a smooth
    error are no singular case (Anderson and Moore, *Optimal Filtering*, 1979, sec. 5.3).
    """

    def __init__(
        self,
        case: Case,
        *,
        sample_time: float,
        horizon: float,
        order: int = 12,
        floor: float = 1e-3,
        hook: HookMotion | None = None,
    ) -> None:
        owner = "sea predictor"
        self._leads = leads_of(owner, sample_time, horizon)
        self._sample_time = float(sample_time)
        self.floor = check_range(owner, "floor", floor, low=0.0, high=1.0, open_low=True)
        motion = HookMotion.from_case(case) if hook is None else hook
        self.displacement_rms = motion.displacement.rms
        self.velocity_rms = motion.velocity.rms
        unit = MruModel(case.sensors.mru, self._sample_time, self.displacement_rms, 0)
        noise = self.floor * np.array([self.displacement_rms, self.velocity_rms])

        def disturbance(omega: FloatArray) -> FloatArray:
            """Return the density of the error, and of the white noise of both signals."""
            heave, rate = noise**2 * self._sample_time / math.pi
            white = 1.0 / (1.0 / heave + omega**2 / rate)
            return np.asarray(white + unit.noise_density(omega))

        self.shaping = fit_for_forecast(motion.density, motion.band, disturbance, order)
        self._model = seen_hook(self.shaping, unit, noise)
        self._gain, self._settled = _riccati(self._model)
        step = self._model
        self._closed = read_only((np.eye(step.order) - self._gain @ step.H) @ step.F)
        self._outputs = step.outputs(self._leads.size)
        self._variances = true_variances(
            step, self._gain, self._closed, self._outputs, motion, unit, self._leads
        )
        steady = self._std(self._variances)
        self._steady = (steady[: self._leads.size], steady[self._leads.size :])
        self._limits = _LARGEST * max(self.displacement_rms, self.velocity_rms)
        self.reset()

    @property
    def sample_time(self) -> float:
        """Time between samples and between leads [s]."""
        return self._sample_time

    @property
    def leads(self) -> FloatArray:
        """Leads from 0 to the horizon [s], (n,)."""
        return self._leads

    @property
    def steady(self) -> tuple[FloatArray, FloatArray]:
        """Standard deviations [m], [m/s], (n,) each, once it has settled, in the true spectrum."""
        return self._steady

    def reset(self) -> None:
        """Forget every earlier sample: the motion may be anything that the sea allows."""
        self._state = np.zeros(self._model.order)
        self._covariance: FloatArray | None = self._model.stationary.copy()
        self._until_check = _CHECK_EVERY

    def update(self, heave: float, rate: float, valid: bool, time: float) -> None:
        """Take what the unit shows: heave [m], heave rate [m/s]; `time` plays no part."""
        del time
        model = self._model
        seen = valid and abs(heave) <= self._limits and abs(rate) <= self._limits
        if self._covariance is None:
            if seen:
                self._state = self._closed @ self._state + self._gain @ (heave, rate)
                return
            self._covariance = self._settled.copy()
        P = model.F @ self._covariance @ model.F.T + model.G
        x = model.F @ self._state
        if seen:
            cross = P @ model.H.T
            gain = cross @ _inverse(model.H @ cross + model.R)
            x += gain @ ((heave, rate) - model.H @ x)
            P -= gain @ cross.T
            P = 0.5 * (P + P.T)
        self._state, self._covariance = x, P
        self._until_check -= 1
        if self._until_check <= 0:
            self._until_check = _CHECK_EVERY
            if seen and self._excess().max() < _SETTLED:
                self._covariance = None

    def forecast(self) -> Forecast:
        """Return the motion now and at the leads, one product of a matrix and the state."""
        n = self._leads.size
        mean = self._outputs @ self._state
        if self._covariance is None:
            return Forecast(mean[:n], mean[n:], *self._steady)
        spread = self._std(self._variances + np.maximum(self._unexplained(), 0.0))
        return Forecast(mean[:n], mean[n:], spread[:n], spread[n:])

    def __str__(self) -> str:
        """Return a small tree of what it knows and how well it does."""
        shaping = self.shaping
        rms = (self.displacement_rms, self.velocity_rms)
        lines = [
            f"SeaPredictor, sampled every {self._sample_time:g} s, "
            f"horizon {self._leads[-1]:g} s, {self._model.order} states",
            f"├ shaping filter: order {shaping.order}, fit error {shaping.shape_error:.1%} of the "
            f"variance (L1), variance {shaping.variance_error:+.1%}",
            f"├ assumed noise beyond the unit's own: {self.floor:.2%} of the motion",
        ]
        at = np.unique(np.searchsorted(self._leads, self._leads[-1] * np.array([0, 0.25, 0.5, 1])))
        for i in at:
            share = (self._steady[0][i] / rms[0], self._steady[1][i] / rms[1])
            lines.append(
                f"{'└' if i == at[-1] else '├'} {self._leads[i]:g} s ahead: standard deviation "
                f"{share[0]:.1%} of the displacement's, {share[1]:.1%} of the velocity's"
            )
        return "\n".join(lines)

    def _unexplained(self) -> FloatArray:
        """Return what the present covariance adds to the steady variances, (2n,)."""
        assert self._covariance is not None
        more = self._covariance - self._settled
        return np.asarray(((self._outputs @ more) * self._outputs).sum(axis=1))

    def _excess(self) -> FloatArray:
        """Return the same over the variance of displacement and velocity [-]."""
        scale = np.repeat((self.displacement_rms, self.velocity_rms), self._leads.size)
        return np.asarray(self._unexplained() / scale**2)

    def _std(self, variances: FloatArray) -> FloatArray:
        """Return standard deviations, read-only."""
        found = np.sqrt(variances)
        found.setflags(write=False)
        return found


def _inverse(matrix: FloatArray) -> FloatArray:
    """Return the inverse of a 2 x 2 matrix: a tenth of the time of a general one."""
    (a, b), (c, d) = matrix.tolist()
    over = 1.0 / (a * d - b * c)
    return np.array([[d * over, -b * over], [-c * over, a * over]])


def _riccati(model: SeenHook) -> tuple[FloatArray, FloatArray]:
    """Return the steady gain and the covariance after a measurement."""
    seen = model.H @ model.F
    cross = model.G @ model.H.T
    innovation = model.H @ cross + model.R
    try:
        P = scipy.linalg.solve_discrete_are(model.F.T, seen.T, model.G, innovation, s=cross)
    except (np.linalg.LinAlgError, ValueError) as error:
        raise SolverError(f"sea predictor: Riccati equation has no solution ({error})") from error
    before = model.F @ P @ model.F.T + model.G
    ahead = before @ model.H.T
    gain = np.linalg.solve((model.H @ ahead + model.R).T, ahead.T).T
    closed = np.abs(np.linalg.eigvals((np.eye(model.order) - gain @ model.H) @ model.F)).max()
    if not (math.isfinite(closed) and closed < 1.0):
        raise SolverError(f"sea predictor: filter is not stable, spectral radius {closed:.6g}")
    return read_only(gain), read_only(0.5 * (P + P.T))
