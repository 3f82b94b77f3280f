r"""Controllers of high order within margins, by Youla's parametrisation: `youla_design`.

    Bound -> its LQG controller as the observer -> Q(s) from innovations to command
      -> cone programme on frequency nodes (cvxpy, Clarabel) -> Controller

Every stabilising controller is an observer with state feedback whose innovations drive the command
through a stable Q, and every closed-loop response is affine in Q.  Variances, limits on rms
values, M_s and roll-off are then convex, and with Q in a Laguerre basis a second-order cone
programme (Boyd and Barratt, *Linear Controller Design*, 1991).  The answer is achievable, so it
lies above the best possible and falls with the number of functions; a bound it is not.

    u = K x^ + v,  v = Q (y - C x^ - D u):  X = [K (s - A - BK)^-1 L + M Q] N

x^ is the observer's state, M = I + K (s - A - BK)^-1 B, N = I - C (s - A + LC)^-1 L, and X the
response from noise on the measurements to the command.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import cvxpy
import numpy as np
from scipy.linalg import block_diag

from models.basics import (
    ComplexArray,
    FloatArray,
    InputError,
    SolverError,
    SynthesisError,
    balanced_truncation,
    check_range,
    one_thread,
    solve_lyapunov,
)
from models.plant import LinearPlant

from ..loop import Assessment, LinearController, Margins, closed_loop_poles
from ..verify import (
    Check,
    LawMatrices,
    Verification,
    agreement,
    bounded,
    closed_matrices,
    lyapunov_variances,
)
from .bound import Bound
from .check import weighted_rms
from .truth import densities, filter_plant, frequencies, lqg_poles

cp: Any = cvxpy  # its functions come through a star import that mypy does not follow
_POINTS, _DENSE = 200, 2000  # at which M_s holds at first, and is looked at
_EXCHANGES = 5
_ABOVE = 1.5  # times the mean frequency of the sea: the functions' pole
_INSIDE = 0.998  # of a limit between them
_PADE = 6  # of the delays, in the verification
_TIME, _SPREAD = 0.03, 5e-3  # agreement with the fitted sea, and of a margin


def laguerre(a: float, count: int, channels: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return A, B of Laguerre functions sqrt(2a)/(s+a) ((s-a)/(s+a))^k of every channel, C of ones.

    The states are the functions themselves, channel by channel.
    """
    A = -a * np.eye(count) - 2.0 * a * np.tril(np.ones((count, count)), -1)
    B = math.sqrt(2.0 * a) * np.ones((count, 1))
    return block_diag(*[A] * channels), block_diag(*[B] * channels), np.ones((1, count * channels))


class AffineLoop:
    """Responses of the closed loop that are affine in Q."""

    def __init__(self, bound: Bound) -> None:
        plant = bound.dual.plant
        K, L = bound.point.regulator.gain, bound.dual.estimator.gain
        AK, AL = plant.A + plant.B @ K, plant.A - L @ plant.C
        ny, nu = len(plant.measurements), len(plant.inputs)
        own = lqg_poles(plant, bound.point.regulator, bound.dual.estimator)
        self.marks = np.concatenate([own, bound.plant.poles()])
        self.plant = bound.plant
        self.shaking = [source.name for source in bound.sources]

        self.from_innovations = filter_plant(AK, L, K, np.zeros((nu, ny)))
        self.from_command = filter_plant(AK, plant.B, K, np.eye(nu))
        self.innovations = filter_plant(AL, L, -plant.C, np.eye(ny))

    def response(
        self, omega: FloatArray, columns: ComplexArray
    ) -> tuple[ComplexArray, ComplexArray]:
        """Return X at Q = 0, (k, ny), and its columns, (k, q, ny)."""
        N = self.innovations.response(omega).yu
        X = (self.from_innovations.response(omega).yu @ N)[:, 0]
        M = self.from_command.response(omega).yu[:, 0, 0]
        # Function k of channel j: M phi_k N[j, :]
        each = M[:, None, None, None] * columns[:, None, :, None] * N[:, :, None, :]
        return X, each.reshape(len(omega), -1, N.shape[2])

    def outputs(
        self, omega: FloatArray, columns: ComplexArray
    ) -> tuple[ComplexArray, ComplexArray]:
        """Return F at Q = 0, (k, nz, nw), and its columns, (k, nz, q, nw)."""
        X, each = self.response(omega, columns)
        blocks = self.plant.response(omega).select(disturbances=self.shaking)
        constant = blocks.zw + blocks.zu @ (X[:, None] @ blocks.yw)
        slope = blocks.zu[:, :, 0, None, None] * (each @ blocks.yw)[:, None]
        return constant, slope

    def sensitivity(
        self, omega: FloatArray, columns: ComplexArray
    ) -> tuple[ComplexArray, ComplexArray]:
        """Return S = 1 + X P_yu at Q = 0, (k,), and its columns, (k, q)."""
        X, each = self.response(omega, columns)
        yu = self.plant.response(omega).yu[:, :, 0]
        return 1.0 + np.einsum("ky,ky->k", X, yu), np.einsum("kqy,ky->kq", each, yu)


def basis(omega: FloatArray, a: float, count: int) -> ComplexArray:
    """Return the Laguerre functions at frequencies, (k, count)."""
    s = 1j * omega[:, None]
    return np.asarray(math.sqrt(2.0 * a) / (s + a) * ((s - a) / (s + a)) ** np.arange(count))


def compressed(
    constant: ComplexArray, slope: ComplexArray, spectra: FloatArray, row: int
) -> tuple[FloatArray, FloatArray]:
    """Return R, r with ||R q + r||^2 the variance of an output; few rows for many nodes."""
    weight = spectra.T  # (k, nw)
    r = (constant[:, row] * weight).ravel()
    R = np.moveaxis(slope[:, row] * weight[:, None], 1, 2).reshape(r.size, -1)
    stacked = np.column_stack([R, r])
    triangle: FloatArray = np.linalg.qr(np.vstack([stacked.real, stacked.imag]))[1]
    return triangle[:, :-1], triangle[:, -1]


def realised(
    plant: LinearPlant, K: FloatArray, L: FloatArray, Aq: FloatArray, Bq: FloatArray, Cq: FloatArray
) -> LinearController:
    """Return the observer with Q as one controller."""
    A, B, C, D = plant.A, plant.B, plant.C, plant.D
    seen = C + D @ K
    return LinearController(
        A=np.block([[A + B @ K - L @ seen, (B - L @ D) @ Cq], [-Bq @ seen, Aq - Bq @ D @ Cq]]),
        B=np.vstack([L, Bq]),
        C=np.hstack([K, Cq]),
        D=np.zeros((len(plant.inputs), len(plant.measurements))),
        measurements=plant.measurements,
        inputs=plant.inputs,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class YoulaDesign:
    """A controller of high order, and what it achieves.

    Attributes
    ----------
    bound
        The question, and the bound from below.
    value
        Root of the weighted variance on the true spectra: an upper value of the best possible.
    rms
        Of what is limited, by name.
    max_sensitivity
        The M_s that was asked for, or infinity.
    margins
        Of the loop with its exact delays.
    functions
        Laguerre functions of each measurement.
    controller
        The controller, u = +C y.
    """

    bound: Bound
    value: float
    rms: Mapping[str, float]
    max_sensitivity: float
    margins: Margins
    functions: int
    controller: LinearController

    def reduced(self, order: int) -> LinearController:
        """Return the controller truncated to at most `order` states.

        The states of least weight in the closed loop are dropped: reached as the disturbances
        drive them there, heard in what is minimised and limited and in the command.  It need not
        be stabilising: a start for a search, or to be looked at with `Bound.of`.
        """
        heard, reached = self._gramians
        left, right = balanced_truncation(heard, reached, order)
        given = self.controller
        return replace(given, A=left @ given.A @ right, B=left @ given.B, C=given.C @ right)

    @cached_property
    def _gramians(self) -> tuple[FloatArray, FloatArray]:
        """Observability and controllability of the controller's states in the closed loop."""
        plant, point = self.bound.dual.plant, self.bound.point
        given = self.controller
        A, E, Cz, _ = closed_matrices(plant, LawMatrices.of(given, plant))
        n = len(plant.states)
        reached = solve_lyapunov(A, E @ E.T)
        moved = np.hstack([np.zeros((len(plant.inputs), n)), given.C])
        charge = self.bound.dual.charge(point.multipliers)
        cost = float(charge @ np.sum((Cz @ reached) * Cz, axis=1))
        effort = np.sum((moved @ reached) * moved, axis=1)
        rows = np.vstack([np.sqrt(charge)[:, None] * Cz, np.sqrt(cost / effort)[:, None] * moved])
        heard = solve_lyapunov(A.T, rows.T @ rows)
        return heard[n:, n:], reached[n:, n:]

    def lowest(self, *, within: float = 0.1, most: int = 20) -> LinearController:
        """Return the controller of lowest order that is stable and loses at most a share `within`.

        Raises
        ------
        SynthesisError
            If there is none of at most `most` states.
        """
        for order in range(1, most + 1):
            controller = self.reduced(order)
            try:
                found = weighted_rms(self.bound, controller)
            except SynthesisError:
                continue
            if found <= (1.0 + within) * self.value:
                return controller
        raise SynthesisError(
            f"Youla: no truncation to at most {most} states keeps within {100 * within:g} %"
        )

    @one_thread()
    def verify(self) -> Verification:
        """Check stability, M_s and variance of the realised controller by other routes."""
        bound, plant = self.bound, self.bound.plant
        rational = plant.without_delays(_PADE, at="measurements")
        growth = float(closed_loop_poles(rational, self.controller).real.max())
        checks = [Check(name="poles", ok=growth < 0.0, found=growth, note="Pade delays")]
        if growth < 0.0:
            law = LawMatrices.of(self.controller, rational)
            by_time = lyapunov_variances(rational, law, bound.filters)
            rms = math.sqrt(sum(w * by_time[n] for n, w in bound.minimise.items()))
            worst = max([0.0, *bound.fits.values()])
            checks.append(
                agreement("value.time", self.value, rms, _TIME + worst, "Lyapunov, fitted sea")
            )
            checks.append(
                agreement("value", self.value, weighted_rms(bound, self.controller), 1e-3, "exact")
            )
            checks.append(bounded("bound", bound.value, self.value, 0.0, "", at_least=True))
            found = Assessment(plant, self.controller, bound.sources).margins.max_sensitivity
            checks.append(
                bounded("max_sensitivity", self.max_sensitivity, found, _SPREAD, "exact delays")
            )
        return Verification.of(checks, f"verified: {len(checks)} checks passed")

    def __str__(self) -> str:
        """Return a small tree."""
        return (
            f"YoulaDesign: {self.value:.5g} rms of {self.bound.whole}, "
            f"{self.bound.sentence(self.value)}\n"
            f"├ order {len(self.controller.A)}, {self.functions} functions a measurement\n"
            f"└ M_s {self.margins.max_sensitivity:.3f}, delay margin {self.margins.delay:.4g} s"
        )


@one_thread()
def youla_design(
    bound: Bound,
    *,
    max_sensitivity: float = math.inf,
    roll_off: tuple[float, float] | None = None,
    functions: int = 8,
    pace: float | None = None,
) -> YoulaDesign:
    """Return the best controller with a Q of so many functions.

    Parameters
    ----------
    bound
        The question: plant with one input, spectra, weights, rms limits.
    max_sensitivity
        Limit on M_s of the loop, broken at the input.
    roll_off
        (bound, above): |L| at most `bound` from the frequency `above` on [rad/s].
    functions
        Laguerre functions for each measurement.
    pace
        Their pole [rad/s]; by default half as much again as the mean frequency of the sea.

    Raises
    ------
    InputError
        If a number is out of range.
    SynthesisError
        If no such controller keeps the limits, or the plant has more than one input.
    """
    if len(bound.plant.inputs) != 1:
        raise SynthesisError("Youla: the plant must have one input")
    if not max_sensitivity > 1.0:
        raise InputError(f"Youla: max_sensitivity must be above 1, got {max_sensitivity!r}")
    check_range("Youla", "functions", functions, low=1, high=60)
    dual, point = bound.dual, bound.point
    plant, K, L = dual.plant, point.regulator.gain, dual.estimator.gain
    parts = AffineLoop(bound)
    marks = parts.marks
    a = pace or _pace(bound, marks)
    Aq, Bq, Cq = laguerre(a, functions, len(plant.measurements))
    omega, weights = frequencies(bound.sources, marks)
    omega, weights = omega[1:], weights[1:]
    columns = basis(omega, a, functions)
    q = cp.Variable(Cq.shape[1])
    constant, slope = parts.outputs(omega, columns)
    spectra = np.sqrt(densities(bound.sources, omega) * weights)
    names = list(bound.plant.outputs)
    # Unit columns, as the measurements differ by many decades.
    rows = {
        n: compressed(constant, slope, spectra, names.index(n))
        for n in dict.fromkeys([*bound.minimise, *bound.limits])
    }
    scale = np.sqrt(sum(w * np.sum(rows[n][0] ** 2, axis=0) for n, w in bound.minimise.items()))
    scale = 1.0 / np.maximum(scale, 1e-12 * scale.max())
    unit = bound.attained or 1.0
    stacked = cp.hstack(
        [
            math.sqrt(w) / unit * (rows[n][0] * scale @ q + rows[n][1])
            for n, w in bound.minimise.items()
        ]
    )
    limits = [
        cp.norm(rows[n][0] * (scale / b) @ q + rows[n][1] / b) <= _INSIDE
        for n, b in bound.limits.items()
    ]
    if roll_off is not None:
        level, above = roll_off
        high = np.geomspace(above, 100.0 * above, 100)
        base, moved = parts.sensitivity(high, basis(high, a, functions))
        # |L| <= b wherever |T| <= b/(1 + b), and T = 1 - S is affine.
        limits.append(_size(base - 1.0, moved * scale, q) <= _INSIDE * level / (1.0 + level))
    dense = np.unique(np.concatenate([np.geomspace(0.002 * a, 200.0 * a, _DENSE), *_around(marks)]))
    base, moved = parts.sensitivity(dense, basis(dense, a, functions))
    moved, chosen = moved * scale, np.zeros(dense.size, dtype=np.bool_)
    chosen[:: _DENSE // _POINTS] = math.isfinite(max_sensitivity)
    # |S| on all of the dense grid would be thousands of cones: those that are broken join in turn.
    for _ in range(_EXCHANGES):
        held = list(limits)
        if chosen.any():
            held.append(_size(base[chosen], moved[chosen], q) <= _INSIDE * max_sensitivity)
        _solve(cp.Problem(cp.Minimize(cp.norm(stacked)), held), q)
        broken = np.abs(base + moved @ q.value) > max_sensitivity
        if not broken.any():
            break
        chosen |= broken
    values = np.asarray(q.value, dtype=np.float64) * scale
    controller = realised(plant, K, L, Aq, Bq, Cq * values)
    assessment = Assessment(bound.plant, controller, bound.sources)
    if not assessment.stable:
        raise SynthesisError("Youla: the realised controller does not stabilise the true plant")
    rms = {n: float(np.linalg.norm(r @ values + r0)) for n, (r, r0) in rows.items()}
    return YoulaDesign(
        bound=bound,
        value=math.sqrt(sum(w * rms[n] ** 2 for n, w in bound.minimise.items())),
        rms={n: rms[n] for n in bound.limits},
        max_sensitivity=max_sensitivity,
        margins=assessment.margins,
        functions=functions,
        controller=controller,
    )


def _solve(problem: Any, q: Any) -> None:
    """Solve a cone programme with Clarabel."""
    try:
        with warnings.catch_warnings():
            # An inaccurate solution is a controller all the same, and is looked at as such.
            warnings.simplefilter("ignore", UserWarning)
            problem.solve(solver=cp.CLARABEL)
    except cvxpy.error.SolverError as error:
        raise SolverError(f"Youla: Clarabel failed: {error}") from error
    if q.value is None or problem.status not in ("optimal", "optimal_inaccurate"):
        raise SynthesisError(f"Youla: no controller with {q.size} free numbers keeps the limits")


def _size(base: ComplexArray, moved: ComplexArray, q: Any) -> Any:
    """Return |base + moved q|, (k,)."""
    real, imaginary = moved.real @ q + base.real, moved.imag @ q + base.imag
    return cp.norm(cp.vstack([real, imaginary]), 2, axis=0)


def _around(marks: ComplexArray) -> list[FloatArray]:
    """Return frequencies about lightly damped poles [rad/s]."""
    light = marks[(marks.imag > 0.0) & (np.abs(marks.real) < 0.3 * marks.imag)]
    steps = np.linspace(-4.0, 4.0, 17)
    found = [m.imag + max(abs(m.real), 1e-4 * m.imag) * steps for m in light]
    return [at[at > 0.0] for at in found]


def _pace(bound: Bound, marks: ComplexArray) -> float:
    """Return a frequency amid what there is to be done [rad/s]: somewhat above the sea's mean."""
    found = []
    for source in bound.sources:
        if source.band is not None:
            edges = np.geomspace(*source.band, 500)
            density = source.density(edges)
            found.append(np.trapezoid(edges * density, edges) / np.trapezoid(density, edges))
    if found:
        return _ABOVE * float(max(found))
    sizes = np.abs(marks)
    return float(np.exp(np.median(np.log(sizes[sizes > 1e-3]))))
