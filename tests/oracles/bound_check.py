"""Recomputation of a bound, `verify_bound`, and other controllers on its terms, `weighted_rms`.

The value came from Riccati equations and Gauss quadrature; here the controller's loop goes
through a Lyapunov equation, its true spectra through another quadrature, and a rival has to stay
above.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from models.basics import FloatArray, one_thread
from synth.bound import Bound
from synth.bound.dual import DualPoint
from synth.bound.truth import banded, controller_rms, densities, lqg_poles, optimal_response
from synth.loop import LinearController
from synth.verify import (
    LawMatrices,
    Verification,
    agreement,
    bounded,
    lyapunov_variances,
    panels,
)

_TIME = 1e-3  # cost by a Lyapunov equation, in which much cancels
_SPECTRAL = 3e-4  # variance by another quadrature
_NEAR, _FAR = 2e-3, 1e3  # times the slowest and the fastest pole
_RIVAL = 3.0  # by which the rival's multipliers differ


@one_thread()
def verify_bound(bound: Bound) -> Verification:
    """Check the figures of a bound by other routes."""
    dual, point = bound.dual, bound.point
    charge = dual.charge(point.multipliers)
    model = bound.plant.without_delays(bound.pade, at="measurements")
    law = LawMatrices.of(bound.controller, model)
    by_time = lyapunov_variances(model, law, bound.filters)
    charged = {n: c for n, c in zip(model.outputs, charge, strict=True) if c > 0.0}
    time = sum(c * by_time[n] for n, c in charged.items())
    checks = [
        agreement("model.cost", point.cost, time, _TIME, "closed loop by a Lyapunov equation"),
        agreement(
            "model.dual",
            dual.value(point),
            sum(w * by_time[n] for n, w in bound.minimise.items()),
            max(1e-4, 2.0 * bound.gap),
            "controller's own variance: the duality gap",
            scale=1e-300,
        ),
    ]
    names = sorted({*bound.minimise, *bound.limits})
    found = _variances(bound, names, point)
    attained = math.sqrt(sum(w * found[name] for name, w in bound.minimise.items()))
    checks.append(
        agreement("attained", bound.attained, attained, _SPECTRAL, "true spectra, exact delays")
    )
    checks += [
        agreement(f"rms.{name}", bound.rms[name], math.sqrt(found[name]), _SPECTRAL, "")
        for name in bound.limits
    ]
    if bound.feasible:
        # Any controller's Lagrangian lies above the bound, so a rival's has to.
        lagrangian = sum(c * found[n] for n, c in charged.items())
        squares = np.array(list(bound.limits.values())) ** 2
        price = float(point.multipliers @ squares)
        checks.append(
            bounded("value", math.sqrt(max(lagrangian - price, 0.0)), bound.value, 1e-9, "optimum")
        )
        for factor in (_RIVAL, 1.0 / _RIVAL):
            rival = dual.at(point.multipliers * factor) if bound.limits else point
            there = _variances(bound, names, rival)
            value = sum(c * there[n] for n, c in charged.items())
            checks.append(
                bounded(
                    f"rival x {factor:.3g}",
                    math.sqrt(max(value - price, 0.0)),
                    bound.value,
                    1e-9,
                    "another controller's Lagrangian",
                )
            )
    return Verification.of(checks, f"verified: {len(checks)} checks passed")


def weighted_rms(bound: Bound, controller: LinearController) -> float:
    """Return the root of the weighted variance of another controller on a bound's terms.

    Raises
    ------
    SynthesisError
        If its loop is unstable.
    """
    found = controller_rms(bound.plant, bound.sources, controller, list(bound.minimise))
    return math.sqrt(sum(w * found[name] ** 2 for name, w in bound.minimise.items()))


def _variances(bound: Bound, names: list[str], point: DualPoint) -> dict[str, float]:
    """Return variances of the true loop whose response from noise to command is the model's."""
    model, kalman = bound.dual.plant, bound.dual.estimator
    shaking = [source.name for source in bound.sources]

    def density(omega: FloatArray) -> FloatArray:
        X = optimal_response(model, point.regulator, kalman, omega)
        blocks = bound.plant.response(omega).select(outputs=names, disturbances=shaking)
        gains = np.abs(blocks.zw + blocks.zu @ X @ blocks.yw) ** 2
        return np.asarray(np.einsum("kzw,wk->zk", gains, densities(bound.sources, omega)))

    marks = np.concatenate([lqg_poles(model, point.regulator, kalman), bound.plant.poles()])
    sizes = np.abs(marks)
    splits = [w for source in bound.sources for w in banded(source).splits]
    low = min([_NEAR * float(sizes[sizes > 1e-6].min(initial=1.0)), *splits])
    high = max([_FAR * float(sizes.max(initial=1.0)), *splits])
    # Simpson's rule on ever finer panels in log-frequency, with Richardson's extrapolation:
    # nothing of the Gauss rule that the bound rests on.
    edges = panels(low, high, splits, marks)
    coarse, fine = (_simpson(density, edges, count) for count in (8, 16))
    found = fine + (fine - coarse) / 15.0
    # Even towards zero; towards infinity no faster than 1/omega^2.
    ends = np.array([low, high])
    found += density(ends) @ ends
    return dict(zip(names, (float(v) for v in found), strict=True))


def _simpson(
    density: Callable[[FloatArray], FloatArray], edges: FloatArray, count: int
) -> FloatArray:
    """Return integrals, (m,), by Simpson's rule on `count` intervals a panel."""
    share = np.linspace(0.0, 1.0, count + 1)
    weight = np.ones(count + 1)
    weight[1:-1:2], weight[2:-1:2] = 4.0, 2.0
    width = np.diff(edges)
    # A band's edge is a jump: its nodes belong to the panel that they end.
    inside = np.clip(share, 1e-9, 1.0 - 1e-9)
    omega = edges[:-1, None] + width[:, None] * inside
    weights = width[:, None] * weight / (3.0 * count)
    return np.asarray(density(omega.ravel()) @ weights.ravel(), dtype=np.float64)
