r"""Model error of a bound: the LQG optimum of a rational model on true spectra and delays.

A Riccati equation needs rational models: a fitted factor of the sea, a Pade model of a delay.
Their optimum X (the closed loop's response from the measurements' noise to the command) is not
the optimum of the true problem, but it yields a bound of it all the same.  Every controller of
the true loop is X + D for some stable D, and its cost is a quadratic of D,

.. math::

    J(X + D) = J(X) + 2 Re \int tr(D G) d\omega
               + \int tr(W_u D \Phi_y D^H) d\omega ,\qquad
    G = P_{yw} \Phi F^H W P_{zu}, \quad
    W_u = P_{zu}^H W P_{zu}, \quad \Phi_y = P_{yw} \Phi P_{yw}^H .

The model's optimality says that the model's own G~, in place of G, integrates to zero for every
such D.  So G may be replaced by G - G~, and completing the square at every frequency gives

.. math::  J(any) \ge J(X) - \int tr(W_u^{-1} (G - G~)^H \Phi_y^{-1} (G - G~)) d\omega .

J(X) is taken on the true spectra and exact delays; what is subtracted is of second order in the
misfit, and zero where the models are exact.  The bound is a theorem whatever the fit; a bad fit
makes it low, never wrong.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from models.basics import ComplexArray, FloatArray, IndexArray, SynthesisError, one_thread
from models.plant import LinearPlant, PlantResponse, ShapingFilter

from ..loop import Disturbance, LinearController
from ..structures import LqgEstimator, LqgRegulator
from ..verify import LawMatrices, Loop, Source, closed_matrices, moments, panels
from .dual import Dual, DualPoint
from .spectral_factor import SpectralFactor

_ORDER = 12  # Gauss-Legendre nodes a panel
_LOWEST = 1e-6  # [rad/s]: further down integrators leave no digits of what cancels
_TAIL = 8  # panels of 1/omega above all features
_BELOW = 1e-3  # of the slowest pole: from there on to zero the densities are constant
_BEYOND = 30.0  # ... which begin this far above the fastest pole
_PADE = 6  # of the delays, where a controller's poles are looked at
_QUADRATURE = 1e-7  # of the variances of a controller
_LOYAL, _FAINT = 0.3, 1e-5  # weight of a spectrum's own fit, and its floor over the peak


def frequencies(
    sources: Sequence[Disturbance], marks: ComplexArray
) -> tuple[FloatArray, FloatArray]:
    """Return nodes [rad/s] and weights of integrals over the half line, (k,) each.

    `marks` are poles [1/s] near which something happens.
    """
    sizes = np.abs(marks)
    sizes = sizes[sizes > 1e-6]
    ends = [w for s in sources for w in (*(s.band or ()), *s.splits)]
    low = max(_LOWEST, min([_BELOW * float(sizes.min(initial=1.0)), *(0.1 * w for w in ends)]))
    high = max([_BEYOND * float(sizes.max(initial=1.0)), *ends])
    edges = panels(low, high, ends, marks)
    rule, weight = np.polynomial.legendre.leggauss(_ORDER)
    half = 0.5 * np.diff(edges)
    omega = ((edges[:-1] + half)[:, None] + half[:, None] * rule).ravel()
    weights = (half[:, None] * weight).ravel()
    inverse = np.linspace(0.0, 1.0 / high, _TAIL + 1)
    half = 0.5 * np.diff(inverse)
    v = ((inverse[:-1] + half)[:, None] + half[:, None] * rule).ravel()
    beyond = (half[:, None] * weight).ravel() / v**2
    # Towards zero the density is even.
    return np.concatenate([[low], omega, 1.0 / v]), np.concatenate([[low], weights, beyond])


def lqg_poles(plant: LinearPlant, feedback: LqgRegulator, kalman: LqgEstimator) -> ComplexArray:
    """Return the poles of an LQG loop [1/s]: those of the state feedback and of the filter."""
    return np.concatenate(
        [
            np.linalg.eigvals(plant.A + plant.B @ feedback.gain),
            np.linalg.eigvals(plant.A - kalman.gain @ plant.C),
        ]
    )


def optimal_response(
    plant: LinearPlant, feedback: LqgRegulator, kalman: LqgEstimator, omega: FloatArray
) -> ComplexArray:
    """Return X, (k, nu, ny), of an LQG loop: from noise on the measurements to the inputs.

    The innovations see the noise through I - C (s - A + LC)^-1 L, and the command sees the
    innovations through K (s - A - BK)^-1 L (the separation principle).
    """
    K, L, C = feedback.gain, kalman.gain, plant.C
    ny, nu = len(plant.measurements), len(plant.inputs)
    commanded = filter_plant(plant.A + plant.B @ K, L, K, np.zeros((nu, ny))).response(omega).yu
    innovated = filter_plant(plant.A - L @ C, L, -C, np.eye(ny)).response(omega).yu
    return np.asarray(commanded @ innovated, dtype=np.complex128)


@dataclass(frozen=True, kw_only=True, eq=False)
class TrueCost:
    """Variances of the outputs by name, and, with weights, the cost and what a model missed."""

    variances: dict[str, float]
    cost: float
    missed: float


@dataclass(frozen=True, kw_only=True, eq=False)
class TrueProblem:
    """A plant with its exact delays and spectra on nodes, next to its rational model."""

    #: Responses at the nodes, with the same signals.
    plant: PlantResponse
    model: PlantResponse
    weights: FloatArray  #: Of the quadrature, (k,).
    #: One-sided densities of the disturbances, true and of the model, (nw, k).
    spectra: FloatArray
    fitted: FloatArray

    def variances(self, X: ComplexArray) -> dict[str, float]:
        """Return the variance of every output with the closed-loop response X."""
        F = self._closed(self.plant, X)
        found = np.einsum("kzw,wk,k->z", np.abs(F) ** 2, self.spectra, self.weights)
        return dict(zip(self.plant.outputs, (float(v) for v in found), strict=True))

    def judge(self, X: ComplexArray, charge: FloatArray) -> TrueCost:
        """Return what X does and what its model missed, for weights of the outputs, (nz,)."""
        variances = self.variances(X)
        use = np.flatnonzero(charge)
        G = self._gradient(self.plant, X, self.spectra, use, charge)
        G -= self._gradient(self.model, X, self.fitted, use, charge)
        heard, unit, moved = self._weights(charge)
        G = G / unit[:, :, None]
        lost = np.linalg.solve(heard, G)
        spare = np.linalg.solve(moved, np.swapaxes(G.conj(), 1, 2))
        density = np.einsum("kuy,kyu->k", spare, lost).real
        return TrueCost(
            variances=variances,
            cost=float(charge @ np.array([variances[name] for name in self.plant.outputs])),
            missed=float(np.maximum(density, 0.0) @ self.weights),
        )

    def importance(self, X: ComplexArray, charge: FloatArray, source: int) -> FloatArray:
        """Return what a squared error of one fitted density costs at every node, (k,)."""
        use = np.flatnonzero(charge)
        F = self._closed(self.plant, X)[:, use, source]
        effect = np.einsum("kz,z,kzu->ku", F.conj(), charge[use], self.plant.zu[:, use])
        y, unit, moved = self._weights(charge)
        heard = self.plant.yw[:, :, source] / unit
        cost = np.einsum(
            "ku,ku->k", effect, np.linalg.solve(moved, effect.conj()[..., None])[..., 0]
        )
        seen = np.einsum("ky,ky->k", heard.conj(), np.linalg.solve(y, heard[..., None])[..., 0])
        return np.asarray(np.maximum(cost.real * seen.real, 0.0))

    def _weights(self, charge: FloatArray) -> tuple[ComplexArray, FloatArray, ComplexArray]:
        """Return Phi_y in units of each measurement's own size, these units, and W_u.

        The measurements differ by many decades.
        """
        use, yw = np.flatnonzero(charge), self.plant.yw
        heard = np.einsum("kyw,wk,kvw->kyv", yw, self.spectra, yw.conj())
        unit = np.sqrt(np.maximum(np.einsum("kyy->ky", heard).real, 1e-300))
        zu = self.plant.zu[:, use]
        moved = np.einsum("kzu,z,kzv->kuv", zu.conj(), charge[use], zu)
        return heard / unit[:, :, None] / unit[:, None, :], unit, moved

    @staticmethod
    def _closed(blocks: PlantResponse, X: ComplexArray) -> ComplexArray:
        return np.asarray(blocks.zw + blocks.zu @ (X @ blocks.yw), dtype=np.complex128)

    def _gradient(
        self,
        blocks: PlantResponse,
        X: ComplexArray,
        spectra: FloatArray,
        use: IndexArray,
        charge: FloatArray,
    ) -> ComplexArray:
        """Return G, (k, ny, nu)."""
        F = self._closed(blocks, X)[:, use]
        effect = np.einsum("kzw,z,kzu->kwu", F.conj(), charge[use], blocks.zu[:, use])
        return np.asarray(blocks.yw @ (spectra.T[:, :, None] * effect), dtype=np.complex128)


def filter_plant(A: FloatArray, B: FloatArray, C: FloatArray, D: FloatArray) -> LinearPlant:
    """Return x' = Ax + Bu, y = Cx + Du as a plant that nothing shakes."""
    return LinearPlant(A=A, B=B, E=np.zeros((len(A), 0)), C=C, D=D)


def banded(source: Disturbance) -> Source:
    """Return a disturbance that is zero outside its band."""
    if source.band is None:
        return Source(name=source.name, density=source.density, band=None, splits=source.splits)
    low, high = source.band

    def density(omega: FloatArray) -> FloatArray:
        return np.where((omega >= low) & (omega <= high), source.density(omega), 0.0)

    return Source(
        name=source.name, density=density, band=source.band, splits=(low, *source.splits, high)
    )


def densities(sources: tuple[Disturbance, ...], omega: FloatArray) -> FloatArray:
    """Return the densities of all sources, zero outside their bands, (nw, k)."""
    return np.stack([banded(source).density(omega) for source in sources])


@one_thread()
def controller_rms(
    plant: LinearPlant,
    sources: Sequence[Disturbance],
    controller: LinearController,
    names: Sequence[str],
) -> dict[str, float]:
    """Return what a controller makes of outputs on true spectra and exact delays, rms by name.

    Raises SynthesisError if its loop is unstable.
    """
    law = LawMatrices.of(controller, plant)
    rational = plant.without_delays(_PADE, at="measurements")
    poles = np.linalg.eigvals(closed_matrices(rational, law)[0])
    if poles.real.max(initial=-1.0) >= 0.0:
        raise SynthesisError(
            f"bound: the controller's loop is unstable (growth rate {poles.real.max():.3g} 1/s)"
        )
    marks = np.concatenate([poles, plant.poles(), np.linalg.eigvals(law.A)])
    loop = Loop(plant=plant, law=law, marks=marks)
    # Only a controller with a direct path makes a delayed loop ring.
    late = max(plant.delays, default=0.0) if np.any(law.D) else 0.0
    inside = [banded(source) for source in sources]
    found = moments(loop, names, inside, orders=(0,), delay=late, rtol=_QUADRATURE)
    return {name: math.sqrt(value[0]) for name, value in found.items()}


def truth_of(
    plant: LinearPlant,
    model: LinearPlant,
    sources: tuple[Disturbance, ...],
    filters: Mapping[str, ShapingFilter | float],
    dual: Dual,
    point: DualPoint,
) -> tuple[TrueProblem, ComplexArray]:
    """Return both problems on nodes, and the closed-loop response of the model's optimum."""
    augmented, kalman = dual.plant, dual.estimator
    marks = np.concatenate([lqg_poles(augmented, point.regulator, kalman), plant.poles()])
    omega, weights = frequencies(sources, marks)
    names = [source.name for source in sources]
    fitted = [
        f.density(omega) if isinstance(f, ShapingFilter) else np.full(omega.shape, f / np.pi)
        for f in filters.values()
    ]
    truth = TrueProblem(
        plant=plant.response(omega).select(disturbances=names),
        model=model.response(omega).select(disturbances=names),
        weights=weights,
        spectra=densities(sources, omega),
        fitted=np.stack(fitted),
    )
    return truth, optimal_response(augmented, point.regulator, kalman, omega)


def refitted(
    factors: Mapping[str, SpectralFactor | ShapingFilter | float],
    sources: tuple[Disturbance, ...],
    truth: TrueProblem,
    X: ComplexArray,
    charge: FloatArray,
) -> dict[str, SpectralFactor | ShapingFilter | float]:
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
