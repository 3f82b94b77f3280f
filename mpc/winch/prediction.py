r"""The prediction model: winch, sea and sensors' errors in one state.

    chi[k+1] = A chi + B d + G n        n: white, covariance one
    y[k]     = C chi + v                v: white, covariance R

The state chi holds, in this order,

* the states of the winch and its rope (`mpc.winch.sampled`);
* those of a filter whose white-noise response has the spectrum of the hook's motion
  (`models.plant.shaping`), so that to predict the state is to predict the sea, and beside it,
  where another sea is reckoned with, those of a little swell: what is slower than any wave that
  was told would else be taken for an error of the reference unit;
* the error of the reference unit as the case states it (`models.sensing.mru`): drift, or noise in
  the band of the waves, behind a Butterworth low-pass of second order; gain and phase error as a
  second sea, independent of the first, so many times as small; white noise is one of the
  measurement; and a slow one, of which the case does not speak (`ProcessNoise.unit`);
* constants that are to be estimated: a force on the payload, a torque at the motor, the bias of
  the accelerometer and of the tension.  Without them a load of another weight would be held off
  its place.  (Where the payload's zero is, a heavier load has stretched the rope by more: seen from
  there it is the tension that is off);
* what telemetry and reference unit have on their way: earlier values of what they show.  A reading
  that is held is as old as it is in the mean, and what its age is off by is error.

`mpc.winch.estimator` makes a Kalman filter of it, `mpc.linear.winch_programme` the quadratic
programme.

A filter that trusts a model of a lightly damped rope to the last digit is right on that rope and
unstable on one that is a little softer.  Noise on rope, load and drive, and sensors that are
trusted less than they might be, buy robustness with a little of the performance;
`mpc.winch.weights` finds how much of each, `with_noise` puts it into a model.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
import scipy.linalg

from models.basics import (
    FloatArray,
    ReadOnlyArrays,
    SolverError,
    check_range,
    read_only,
    solve_discrete_lyapunov,
)
from models.case import Case
from models.hook import HookMotion
from models.plant import MEASUREMENTS, ShapingFilter, fit_shaping_filter, noisy_hold, root_of
from models.sea import SeaSpectrum
from models.sensing import MEASURED, MruModel, SensorModel, low_pass_noise

from ..programme import ages, kalman_gain, late_row, prediction_covariance, remember
from .sampled import SampledWinch

_OWNER = "prediction model"
CONSTANTS = ("payload.force", "motor.torque", "payload.acceleration_bias", "rope.tension_bias")
#: What comes late, in the order of the first measurements.
LATE = (*MEASUREMENTS, "mru.heave", "mru.heave_rate")
_GRAVITY = 9.81
_SLOW = 0.12  # frequency below which that lies, over the mean one of the hook
_SWELLS = (10.0, 12.0, 14.5, 17.5)  # peaks of the swell that was not told [s]
_SPARE = 2  # samples by which the telemetry may be later than the case says
# How far the constants wander in so many seconds, over `constant_scales`: what is estimated has to
# drift a little, or the filter would stop listening to it.
_DRIFT, _DRIFT_TIME = (0.02, 0.02, 2e-4, 0.005), 1000.0
_SPEED_WINDOW = 0.01  # in which a drive counts an encoder's pulses [s]


@dataclass(frozen=True, kw_only=True)
class ProcessNoise:
    """Standard deviations of what the model leaves out.

    Raises
    ------
    InputError
        If one is negative, or `sensors` is not above zero.
    """

    #: White force on the payload that adds up to this in a second, over the static tension.
    force: float = 1e-4
    torque: float = 1e-3  #: The same at the motor, over the peak torque.
    #: Change of speed of each mass along the rope in a second, over the rms speed of the hook.
    rope: float = 1e-4
    #: Error at every sample of a sensor, besides what the case says of it, over the rms of the
    #: hook's motion (for a tension: over the static one).
    sensors: float = 1e-4
    #: Slow error of the reference unit, of which the case says nothing, over the rms of the hook's
    #: motion.  A filter that holds it to be impossible takes it for a sea of thirty standard
    #: deviations.
    unit: float = 0.05

    def __post_init__(self) -> None:
        for field in fields(self):
            above = field.name == "sensors"
            check_range(
                "process noise", field.name, getattr(self, field.name), low=0.0, open_low=above
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class PredictionModel(ReadOnlyArrays):
    """Matrices of the augmented state; `prediction_model` makes it."""

    winch: SampledWinch  #: The sampled plant.
    sea: ShapingFilter  #: The shaping filter of the hook's motion, the swell's states last.
    swell: float  #: Variance of the swell that was not told, over that of the sea that was.
    waves: tuple[float, ...]  #: Its rms displacement, velocity and acceleration [m], [m/s], [m/s2].
    #: How many states the errors of the reference unit have, those of the slow one last.
    errors: int
    #: (n, n), (n, 1), (n, ng).
    A: FloatArray
    B: FloatArray
    G: FloatArray
    #: How many columns of G are of the sea and the reference unit; the others are what the model
    #: does not know (`with_noise`).
    known: int
    #: Noise over a sample of a slow error of the reference unit of one metre rms, (2, 2).
    slow: FloatArray
    now: FloatArray  #: Rows of what telemetry and reference unit take in at a sample, (5, n).
    #: Of each late signal: where its earlier values begin in chi, and how many there are.
    first: Mapping[str, int]
    depth: Mapping[str, int]
    #: Rows of the measurements, in the order of `models.sensing.plant.MEASURED`, (ny, n).
    C: FloatArray
    R: FloatArray  #: Variances of their white errors, (ny,).
    hook: FloatArray  #: Rows of the hook's displacement and velocity, (2, n).

    @property
    def size(self) -> int:
        """Number of states."""
        return len(self.A)

    @property
    def sea_at(self) -> slice:
        """Where in chi the sea is."""
        return slice(self.winch.size, self.winch.size + self.sea.order)

    @property
    def constants_at(self) -> slice:
        """Where in chi the constants are."""
        first = self.winch.size + self.sea.order + self.errors
        return slice(first, first + len(CONSTANTS))

    @property
    def load_noise(self) -> list[int]:
        """Columns of G that shake payload and rope (`ProcessNoise.force`, `ProcessNoise.rope`)."""
        rope = range(self.known + 2 + len(CONSTANTS), self.G.shape[1] - self.slow.shape[1])
        return [self.known, *rope]

    @cached_property
    def scale(self) -> FloatArray:
        """Size of each state, for the numerics: its standard deviation in the model, or one."""
        return read_only(_scales(self))

    @cached_property
    def covariance(self) -> FloatArray:
        """Covariance of the filter's steady one-step prediction from all signals, (n, n).

        Raises SolverError if there is none.
        """
        return read_only(prediction_covariance(self.A, self.C, self.G, self.R, self.scale))

    @cached_property
    def gain(self) -> FloatArray:
        """The filter's steady gain for all signals, (n, ny)."""
        return read_only(kalman_gain(self.C, self.R, self.covariance))

    @property
    def sea_covariance(self) -> FloatArray:
        """Covariance of the sea's state once the sample is known, (nh, nh)."""
        kept = (self.covariance - self.gain @ self.C @ self.covariance)[self.sea_at, self.sea_at]
        return np.array(0.5 * (kept + kept.T))


def prediction_model(winch: SampledWinch, *, swell: float = 0.0) -> PredictionModel:
    """Return the prediction model of a winch, next to certain of the world: see `with_noise`.

    It reckons with a swell of which the case says nothing, of so much of the hook's variance.

    Raises SolverError if the hook's spectrum cannot be fitted.
    """
    case = winch.case
    hook, T, n = HookMotion.from_case(case), winch.sample_time, winch.size
    sea = sea_filter(hook)
    sea_A, sea_Q = noisy_hold(sea.A, sea.B, T)
    error_A, error_root, error_C = _unit_error(case, hook, T, (sea_A, sea_Q, sea))
    if swell > 0.0:
        sea = _beside(sea, _swell_filter(hook, swell))
        sea_A, sea_Q = noisy_hold(sea.A, sea.B, T)
    errors = error_C.shape[1]
    late = ages(winch.plant, T)[: len(LATE)]
    later = np.repeat([case.sensors.telemetry.jitter / T + _SPARE, 0.0], [len(MEASUREMENTS), 2])
    depth = dict(zip(LATE, np.ceil(late + later - 1e-6).astype(int).tolist(), strict=True))
    sea_at = slice(n, n + sea.order)
    error_at = slice(sea_at.stop, sea_at.stop + errors)
    constants_at = slice(error_at.stop, error_at.stop + len(CONSTANTS))
    first, end = {}, constants_at.stop
    for name in LATE:
        first[name], end = end, end + depth[name]

    # Displacement and velocity of the hook are outputs of the sea's state, and so everything that
    # the hook moves is linear in it.
    shown = np.vstack([sea.C, sea.C @ sea.A])
    now = _present(winch, shown, sea_at, constants_at, end)
    now[len(MEASUREMENTS) :, error_at] = error_C
    A = np.zeros((end, end))
    A[:n, :n] = winch.A
    # The winch feels the hook at both ends of the sample; that at the end is where the sea's state
    # goes, but for the noise that comes in between (in G).
    A[:n, sea_at] = winch.from_hook[:, :2] @ shown + winch.from_hook[:, 2:] @ shown @ sea_A
    A[sea_at, sea_at] = sea_A
    A[error_at, error_at] = error_A
    A[:n, constants_at.start : constants_at.start + 2] = winch.from_constants
    A[constants_at, constants_at] = np.eye(len(CONSTANTS))
    remember(A, now, first.values(), depth.values())

    hook_rows = np.zeros((2, end))
    hook_rows[:, sea_at] = shown
    rows = [late_row(now[k], first[n], depth[n], late[k]) for k, n in enumerate(LATE)]
    other = np.zeros((len(MEASURED) - len(LATE), end))
    other[:, : n - winch.waiting] = winch.plant.C[len(LATE) :]
    other[:, sea_at] = winch.plant.F[len(LATE) :, :2] @ shown
    other[-1, constants_at.start + 3] = 1.0
    sea_root = root_of(sea_Q)
    G = np.zeros((end, sea_root.shape[1] + error_root.shape[1]))
    # What a sample adds to the sea moves the hook at its end, and with it the winch.
    G[sea_at, : sea_root.shape[1]] = sea_root
    G[:n, : sea_root.shape[1]] = winch.from_hook[:, 2:] @ shown @ sea_root
    G[error_at, sea_root.shape[1] :] = error_root
    parts = (hook.displacement, hook.velocity, hook.acceleration)
    model = PredictionModel(
        winch=winch,
        sea=sea,
        swell=swell,
        waves=tuple(float(part.rms) for part in parts),
        errors=errors,
        A=A,
        B=np.vstack([winch.B, np.zeros((end - n, 1))]),
        G=G,
        known=G.shape[1],
        slow=root_of(_slow_error(hook, T)[1]),
        now=now,
        first=first,
        depth=depth,
        C=np.vstack([*rows, other]),
        R=np.ones(len(MEASURED)),
        hook=hook_rows,
    )
    return with_noise(model, ProcessNoise(unit=0.0))


def with_noise(model: PredictionModel, noise: ProcessNoise) -> PredictionModel:
    """Return the model with other noise in process and sensors."""
    winch = model.winch
    n, T = winch.size, winch.sample_time
    shaken = [k for k, name in enumerate(winch.plant.states) if _is_mass(name)]
    scales = constant_scales(model)
    slow, first = model.slow, 2 + len(scales) + len(shaken)
    columns = np.zeros((model.size, first + slow.shape[1]))
    # An independent error over every sample that adds up to the given rms in a second.
    unknown = scales[:2] * [noise.force, noise.torque] / math.sqrt(T)
    columns[:n, :2] = winch.from_constants * unknown
    drift = np.array(_DRIFT) * scales * math.sqrt(T / _DRIFT_TIME)
    columns[model.constants_at, 2 : 2 + len(scales)] = np.diag(drift)
    kick = noise.rope * model.waves[1] * math.sqrt(T)
    columns[shaken, 2 + len(scales) + np.arange(len(shaken))] = kick
    # The slow error of the unit is next to the constants.
    columns[model.constants_at.start - 2 : model.constants_at.start, first:] = (
        noise.unit * model.waves[0] * slow
    )
    return replace(
        model, G=np.hstack([model.G[:, : model.known], columns]), R=_variances(model, noise.sensors)
    )


def constant_scales(model: PredictionModel) -> FloatArray:
    """Return what the constants are measured by: weight, peak torque, gravity, weight, (4,)."""
    weighed, falls = model.winch.rest_tension, model.winch.data.falls
    peak = model.winch.case.winch.drive.torque_peak
    return np.array([falls * weighed, peak, _GRAVITY, weighed])


def _is_mass(name: str) -> bool:
    """Return whether a state is the velocity of a mass along the rope, the payload's included."""
    return name.endswith(".velocity") and name.split(".")[0] in ("rope", "payload")


def _variances(model: PredictionModel, share: float) -> FloatArray:
    """Return the variances of the white errors, (ny,)."""
    case, T = model.winch.case, model.winch.sample_time
    sensors = SensorModel.from_case(case, T)
    heave, rate, acceleration = model.waves
    sizes = {
        "payload.acceleration": acceleration,
        "payload.velocity": rate,
        "payload.displacement": heave,
        "mru.heave": heave,
        "mru.heave_rate": rate,
        "drum.haul": heave,
        "motor.speed": rate / sensors.haul_per_angle,
        "rope.tension": case.static_tension,
    }
    rms = {name: share * size for name, size in sizes.items()}
    for name in MEASUREMENTS:
        own = name.removeprefix("payload.")
        step = float(getattr(sensors.payload, f"{own}_resolution"))
        rms[name] = math.hypot(rms[name], sensors.noise_rms(own), step / math.sqrt(12.0))
    # What is held tells once what it shows at several samples, and is older or younger than in the
    # mean by up to half of them: off by as much as a load that moves like the hook, at the most.
    changes = (acceleration**2 / rate, acceleration, rate)
    for name, change, hold in zip(MEASUREMENTS, changes, model.winch.plant.holds, strict=False):
        if (samples := hold / T) > 1.0:
            off = change * T * math.sqrt((samples**2 - 1.0) / 12.0)
            rms[name] = math.hypot(math.sqrt(samples) * rms[name], off)
    unit = MruModel(case.sensors.mru, T, heave, seed=0)
    for process in (p for p in unit.processes if p.white):
        over, _ = low_pass_noise(process.corner, T)
        change = process.rms * math.sqrt(2.0 * (1.0 - over[0, 0])) / T
        rms["mru.heave"] = math.hypot(rms["mru.heave"], process.rms)
        rms["mru.heave_rate"] = math.hypot(rms["mru.heave_rate"], change)
    if case.sensors.encoder is not None:
        count = 2.0 * math.pi / case.sensors.encoder.counts_per_turn / math.sqrt(12.0)
        rms["drum.haul"] = math.hypot(rms["drum.haul"], sensors.haul_per_angle * count)
        rms["motor.speed"] = math.hypot(rms["motor.speed"], count / _SPEED_WINDOW)
    if case.sensors.load_cell is not None:
        noise = case.sensors.load_cell.noise_fraction * case.static_tension
        rms["rope.tension"] = math.hypot(rms["rope.tension"], noise)
    return np.array([rms[name] ** 2 for name in MEASURED])


def sea_filter(hook: HookMotion) -> ShapingFilter:
    """Return the shaping filter that fits a hook's motion best, of order 4, 6 or 8.

    Raises SolverError if none fits.
    """
    fits = []
    for order in (4, 6, 8):
        try:
            fits.append(fit_shaping_filter(hook.density, hook.band, order))
        except SolverError:
            continue
    if not fits:
        raise SolverError(f"{_OWNER}: no filter fits the spectrum of the hook's motion")
    return _even(min(fits, key=lambda fit: fit.shape_error))


def _swell_filter(hook: HookMotion, share: float) -> ShapingFilter:
    """Return the shaping filter of long waves of any period, of so much of the hook's variance."""
    swells = [
        replace(
            hook,
            sea=SeaSpectrum(kind="jonswap", significant_height=1.0, peak_period=peak, gamma=1.0),
        )
        for peak in _SWELLS
    ]
    band = min(each.band[0] for each in swells), max(each.band[1] for each in swells)
    sizes = [share / len(swells) * float(each.displacement.rms) ** -2 for each in swells]
    variance = float(hook.displacement.rms) ** 2

    def density(omega: FloatArray) -> FloatArray:
        each = (size * one.density(omega) for size, one in zip(sizes, swells, strict=True))
        return np.asarray(variance * np.sum(list(each), axis=0))

    return _even(fit_shaping_filter(density, band, 4))


def _beside(sea: ShapingFilter, other: ShapingFilter) -> ShapingFilter:
    """Return the filter of the sum of two independent signals."""
    return replace(
        sea,
        A=scipy.linalg.block_diag(sea.A, other.A),
        B=scipy.linalg.block_diag(sea.B, other.B),
        C=np.hstack([sea.C, other.C]),
    )


def _even(found: ShapingFilter) -> ShapingFilter:
    """Return the filter with states of covariance one.

    Those of a companion form differ by many powers of ten.
    """
    root = scipy.linalg.cholesky(
        scipy.linalg.solve_continuous_lyapunov(found.A, -found.B @ found.B.T), lower=True
    )
    return replace(
        found,
        A=np.linalg.solve(root, found.A @ root),
        B=np.linalg.solve(root, found.B),
        C=found.C @ root,
    )


def _unit_error(
    case: Case, hook: HookMotion, T: float, sea: tuple[FloatArray, FloatArray, ShapingFilter]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the errors of the reference unit over a sample: A, G, and heave and rate of them.

    The slow one, of which the case does not speak, comes last, without noise.
    """
    unit = MruModel(case.sensors.mru, T, float(hook.displacement.rms), seed=0)
    stated = [low_pass_noise(p.corner, T, p.rms) for p in unit.processes if not p.white]
    if not stated:
        stated = [low_pass_noise(1.0, T, 0.0)]
    rows = [np.eye(2)] * len(stated)
    if unit.coherent and case.sensors.mru is not None:
        # Of unknown sign it is a sea of its own, but for the heave filter, whose period is long.
        over, added, shaped = sea
        stated.append((over, case.sensors.mru.coherent**2 * added))
        rows.append(np.vstack([shaped.C, shaped.C @ shaped.A]))
    slow = _slow_error(hook, T)[0]
    A = scipy.linalg.block_diag(*(over for over, _ in stated), slow)
    G = scipy.linalg.block_diag(*(root_of(added) for _, added in stated), np.zeros((2, 0)))
    return A, G, np.hstack([*rows, np.eye(2)])


def _slow_error(hook: HookMotion, T: float) -> tuple[FloatArray, FloatArray]:
    """Return a slow error of the unit (e, e') over a sample, and what adds up to an rms of one."""
    return low_pass_noise(_SLOW * float(hook.velocity.rms / hook.displacement.rms), T)


def _present(
    winch: SampledWinch, shown: FloatArray, sea_at: slice, constants_at: slice, size: int
) -> FloatArray:
    """Return the rows of what telemetry and reference unit take in."""
    rows = np.zeros((len(LATE), size))
    rows[:, : winch.size - winch.waiting] = winch.plant.C[: len(LATE)]
    rows[:, sea_at] = winch.plant.F[: len(LATE), :2] @ shown
    # A force on the payload is felt by its accelerometer at once.
    rows[: len(MEASUREMENTS), constants_at.start] = winch.force_felt
    rows[0, constants_at.start + 2] = 1.0
    return rows


def _scales(model: PredictionModel) -> FloatArray:
    """Return the rms of each state when the drum is held, roughly; one where it has none."""
    n, w = model.winch.size, model.sea_at.stop
    heave = max(float(np.linalg.norm(model.hook[0])), 1e-6)
    sizes = np.ones(model.size)
    sizes[:n] = heave * np.maximum(np.abs(model.winch.moved).max(axis=1), 1e-6)
    force, torque = model.winch.rest_tension, abs(model.winch.rest_torque)
    by_signal = {"tension": 0.1 * force, "torque": 0.1 * torque, "current": 0.1 * torque}
    for k, name in enumerate(model.winch.plant.states):
        if not model.winch.moved[k].any():
            sizes[k] = by_signal.get(name.rsplit(".", 1)[-1], heave)
    rest = max(abs(model.winch.rest_command), abs(model.winch.rest_torque / model.winch.gain))
    sizes[n - model.winch.waiting : n] = 0.1 * rest
    # What one sample adds to an error is next to nothing in a filter's displacement.
    error = slice(w, w + model.errors)
    lasting = solve_discrete_lyapunov(model.A[error, error], (model.G @ model.G.T)[error, error])
    assert lasting is not None
    rms = np.sqrt(np.diag(lasting))
    sizes[error] = np.where(rms > 0.0, rms, 1.0)
    sizes[model.constants_at] = [0.1 * force, 0.1 * torque, 0.1 * _GRAVITY, 0.1 * force]
    for name in LATE:
        at = slice(model.first[name], model.first[name] + model.depth[name])
        sizes[at] = heave
    return sizes
