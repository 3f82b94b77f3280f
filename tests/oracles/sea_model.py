"""The hook's motion and what the reference unit shows of it, as one sampled linear model.

`SeaPredictor` filters with it.  States: those of the shaping filter, in coordinates of unit
variance; two of the unit's high-pass; what was shown a sample before, where the delay is no
multiple of the sample time; two of the unit's error.  Everything is exact at the samples, but
that the unit's own model sees the path between them as a cubic (`models.sensing.mru`), a difference
of the fourth order of the sample time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from models.basics import FloatArray, read_only
from models.hook import HookMotion
from models.plant import ShapingFilter
from models.sensing import MruModel, low_pass_noise, unit_response

_PANEL = 0.25  # [rad/s], of the quadrature over the true spectrum
_BUTTERWORTH = math.sqrt(2.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class SeenHook:
    """x[k+1] = F x + w, shown y = H x + r, true hook one `whole` delay ago D x.

    Parameters
    ----------
    F, G
        Step of the state and covariance of what it adds, (n, n).
    H, R
        Shown heave [m] and heave rate [m/s], and the covariance of their white noise, (2, n),
        (2, 2).
    D
        Displacement [m] and velocity [m/s] of the hook at the time that is shown, (2, n).
    whole, share
        Delay in samples: whole ones, and the rest.
    errors
        Number of states of the unit's error, the last ones: 0 or 2.
    stationary
        Covariance of the state without any measurement (n, n).
    """

    F: FloatArray
    G: FloatArray
    H: FloatArray
    R: FloatArray
    D: FloatArray
    whole: int
    share: float
    errors: int
    stationary: FloatArray

    def __post_init__(self) -> None:
        for name in ("F", "G", "H", "R", "D", "stationary"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.F)

    def outputs(self, count: int) -> FloatArray:
        """Return displacement, then velocity, at `count` leads from the state, (2 count, n)."""
        rows = np.empty((count, 2, self.order))
        row = self.D @ np.linalg.matrix_power(self.F, self.whole)
        for k in range(count):
            rows[k] = row
            row = row @ self.F
        return read_only(np.concatenate((rows[:, 0], rows[:, 1])))


def seen_hook(shaping: ShapingFilter, unit: MruModel, noise: FloatArray) -> SeenHook:
    """Return the model of a hook behind a reference unit.

    Parameters
    ----------
    shaping
        Filter of the displacement.
    unit
        The unit; its sample time is the model's.
    noise
        Standard deviations of white noise on what it shows [m], [m/s], (2,).
    """
    T = unit.sample_time
    A, B, true, shown = _continuous(shaping, unit)
    m = len(A)
    # Van Loan (1978): the step and the covariance that white noise adds over it.
    block = np.block([[-A, B @ B.T], [np.zeros((m, m)), A.T]])
    exponential = scipy.linalg.expm(block * T)
    Phi = exponential[m:, m:].T
    added = Phi @ exponential[:m, m:]
    samples = unit.delay / T
    whole = math.floor(samples + 1e-6)
    share = max(samples - whole, 0.0)
    share = share if share > 1e-6 else 0.0
    before, errors = (2 if share else 0), (2 if unit.error_rms > 0.0 else 0)
    n = m + before + errors
    F, G, H, D = np.zeros((n, n)), np.zeros((n, n)), np.zeros((2, n)), np.zeros((2, n))
    F[:m, :m], G[:m, :m], D[:, :m] = Phi, added, true
    H[:, :m] = (1.0 - share) * shown
    if before:
        F[m : m + 2, :m], H[:, m : m + 2] = shown, share * np.eye(2)
    if errors and unit.mru is not None:
        width = unit.mru.noise_bandwidth
        scale = unit.error_rms * np.diag([1.0, width])
        last = slice(n - 2, n)
        over, added = low_pass_noise(width, T)
        inverse = np.linalg.inv(scale)
        F[last, last] = inverse @ over @ scale
        G[last, last] = unit.error_rms**2 * inverse @ added @ inverse
        H[:, last] = scale
    G = 0.5 * (G + G.T)
    stationary = np.asarray(scipy.linalg.solve_discrete_lyapunov(F, G), dtype=np.float64)
    return SeenHook(
        F=F,
        G=G,
        H=H,
        R=np.diag(np.square(noise)),
        D=D,
        whole=whole,
        share=share,
        errors=errors,
        stationary=0.5 * (stationary + stationary.T),
    )


def _continuous(
    shaping: ShapingFilter, unit: MruModel
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return A and B of shaping filter and high-pass, the true and the shown motion (2, m)."""
    # Unit variance in every direction: a companion form of order 8 spans ten decades.
    P = scipy.linalg.solve_continuous_lyapunov(shaping.A, -shaping.B @ shaping.B.T)
    root = np.linalg.cholesky(P)
    A = np.linalg.solve(root, shaping.A @ root)
    B = np.linalg.solve(root, shaping.B)
    heave = shaping.C @ root
    true = np.vstack((heave, heave @ A))
    period = None if unit.mru is None else unit.mru.heave_filter_period
    if period is None:
        return A, B, true, true
    # q'' + sqrt(2) w q' + w^2 q = heave; shown = heave - sqrt(2) w q' - w^2 q = q''.  The states
    # are w q and q' over the heave's rms, which keeps them near unit variance too.
    w, n, rms = 2.0 * math.pi / period, len(A), float(np.linalg.norm(heave))
    A_all, B_all = np.zeros((n + 2, n + 2)), np.vstack((B, np.zeros((2, 1))))
    A_all[:n, :n] = A
    A_all[n, n + 1] = w
    A_all[n + 1, :n] = heave[0] / rms
    A_all[n + 1, n:] = (-w, -_BUTTERWORTH * w)
    true = np.hstack((true, np.zeros((2, 2))))
    shown = true.copy()
    shown[0, n:] = (-w * rms, -_BUTTERWORTH * w * rms)
    # The rate is the derivative: every state's share moves by A.
    shown[1] = shown[0] @ A_all
    return A_all, B_all, true, shown


def true_variances(
    model: SeenHook,
    gain: FloatArray,
    closed: FloatArray,
    outputs: FloatArray,
    hook: HookMotion,
    unit: MruModel,
    leads: FloatArray,
) -> FloatArray:
    """Return the variances of the forecasts' errors in the true spectrum, by quadrature.

    The filter x[k] = closed x[k-1] + gain y[k] is linear and does not change, so a harmonic
    of the hook leaves a harmonic of the error; the unit's error and the white noise add theirs.

    Parameters
    ----------
    model
        What the filter believes; only its error and noise are taken as true.
    gain, closed
        The steady filter, (n, 2), (n, n).
    outputs
        Displacement, then velocity, at the leads (2k, n).
    hook
        The true motion.
    unit
        The unit.
    leads
        Leads [s], (k,).

    Returns
    -------
    ndarray
        Variances of displacement [m2], then velocity [m2/s2], (2k,).
    """
    omega, weight = _nodes(hook)
    turn = np.exp(-1j * omega * unit.sample_time)
    shown = unit_response(unit.mru, 1j * omega) * np.exp(1j * omega * unit.delay)
    shown = shown * turn**model.whole * (1.0 - model.share + model.share * turn)
    seen = gain[:, 0, None] * shown + gain[:, 1, None] * (1j * omega * shown)
    modes, basis = np.linalg.eig(closed)
    states = basis @ (np.linalg.solve(basis, seen) / (1.0 - modes[:, None] * turn))
    ahead = np.exp(1j * np.outer(leads, omega))
    truth = np.vstack((ahead, 1j * omega * ahead))
    from_hook = np.square(np.abs(truth - outputs @ states)) @ weight
    return np.asarray(from_hook + _from_noise(model, gain, closed, outputs))


def _from_noise(
    model: SeenHook, gain: FloatArray, closed: FloatArray, outputs: FloatArray
) -> FloatArray:
    """Return the variances that the unit's error and the white noise leave in the forecasts."""
    n, e = model.order, model.errors
    step = np.zeros((n + e, n + e))
    step[:n, :n] = closed
    drive = gain @ model.R @ gain.T
    added = np.zeros((n + e, n + e))
    added[:n, :n] = drive
    if e:
        F, H, G = model.F[-e:, -e:], model.H[:, -e:], model.G[-e:, -e:]
        step[:n, n:], step[n:, n:] = gain @ H @ F, F
        into = np.vstack((gain @ H, np.eye(e)))
        added += into @ G @ into.T
    covariance = scipy.linalg.solve_discrete_lyapunov(step, added)[:n, :n]
    return np.asarray(((outputs @ covariance) * outputs).sum(axis=1))


def _nodes(hook: HookMotion) -> tuple[FloatArray, FloatArray]:
    """Return Gauss-Legendre nodes over the band [rad/s] and weights times density [m2]."""
    low, high = hook.band
    panels = math.ceil((high - low) / _PANEL)
    edges = np.unique(np.concatenate((np.linspace(low, high, panels + 1), hook.splits)))
    x, w = np.polynomial.legendre.leggauss(8)
    half = 0.5 * np.diff(edges)[:, None]
    omega = (edges[:-1, None] + half * (1.0 + x)).ravel()
    return omega, (half * w).ravel() * hook.density(omega)
