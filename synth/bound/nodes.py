"""Nodes for a bound: the true problem and its model side by side, and filters fitted to it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from models.basics import ComplexArray, FloatArray
from models.plant import LinearPlant, ShapingFilter

from ..loop import Disturbance
from .dual import Dual, DualPoint
from .spectral_factor import SpectralFactor
from .truth import Truth, frequencies, optimal_response

_LOYAL, _FAINT = 0.3, 1e-5  # weight of a spectrum's own fit, and its floor over the peak


def densities(sources: tuple[Disturbance, ...], omega: FloatArray) -> FloatArray:
    """Return the one-sided densities, (nw, k), zero outside their bands."""
    rows = []
    for source in sources:
        density = np.asarray(source.density(omega), dtype=np.float64)
        if source.band is not None:
            density = np.where((omega >= source.band[0]) & (omega <= source.band[1]), density, 0.0)
        rows.append(density)
    return np.stack(rows)


def truth_of(
    plant: LinearPlant,
    model: LinearPlant,
    sources: tuple[Disturbance, ...],
    filters: Mapping[str, ShapingFilter | float],
    dual: Dual,
    point: DualPoint,
) -> tuple[Truth, ComplexArray]:
    """Return both problems on nodes, and the closed-loop response of the model's optimum."""
    augmented, kalman = dual.plant, dual.estimator
    marks = np.concatenate(
        [
            np.linalg.eigvals(augmented.A + augmented.B @ point.regulator.gain),
            np.linalg.eigvals(augmented.A - kalman.gain @ augmented.C),
            plant.poles(),
        ]
    )
    omega, weights = frequencies(sources, marks)
    names = [source.name for source in sources]
    fitted = [
        f.density(omega) if isinstance(f, ShapingFilter) else np.full(omega.shape, f / np.pi)
        for f in filters.values()
    ]
    truth = Truth(
        plant=plant.response(omega).select(disturbances=names),
        model=model.response(omega).select(disturbances=names),
        weights=weights,
        spectra=densities(sources, omega),
        fitted=np.stack(fitted),
    )
    return truth, optimal_response(augmented, point.regulator, kalman, omega)


def refitted(
    factors: Mapping[str, SpectralFactor | float],
    sources: tuple[Disturbance, ...],
    truth: Truth,
    X: ComplexArray,
    charge: FloatArray,
) -> dict[str, SpectralFactor | float]:
    """Return the factors fitted to what the bound loses by them."""
    result = dict(factors)
    for k, source in enumerate(sources):
        factor = factors[source.name]
        if isinstance(factor, SpectralFactor):
            target = truth.spectra[k]
            importance = truth.importance(X, charge, k)
            # ... and a little to the spectrum itself, which the limits feel.
            lost = float(importance @ (truth.weights * target**2))
            plain = 1.0 / (target + _FAINT * target.max())
            share = _LOYAL * lost / float(plain @ (truth.weights * target**2))
            weights = (importance + share * plain) * truth.weights
            result[source.name] = factor.refitted(truth.plant.omega, target, weights)
    return result
