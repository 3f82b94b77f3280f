r"""A plant as far as loops are closed through it, in as few states as that takes.

A search asks at every step whether its loops are stable, and eigenvalues cost the cube of the
states.  Many of these no loop goes through, or any other would do: sensors of the ship's motion,
a delay model for each of three signals that differ by factors of s, the branches of every piece
of a hysteretic rope, whose poles lie side by side.  All of these are well damped.  So a plant is
split into its lively modes, which stay as they are, and its damped ones (real Schur form and a
Sylvester equation), of which a balanced realisation keeps what rounding leaves to be seen between
inputs and measurements (B. C. Moore, IEEE Trans. Automat. Contr. 26 (1981) 17; its Gramians are
integrals over frequency here, whose factors keep the digits that a Lyapunov equation loses)::

    A --> lively A_1, as it is
      --> damped A_2 --> W^T A_2 V, as many states as Hankel singular values above rounding

A closed loop has the same poles on both but for damped ones of the plant that no loop moves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy.linalg

from models.basics import ComplexArray, FloatArray
from models.plant import LinearPlant

from .controller import LinearController, closed_loop_matrix
from .elements import Element
from .pole_region import with_delay_models

DECAY = 1e-9  # a pole must lie this far left, relative to the size of the largest one
_DAMPED = 0.35  # damping ratio from which a mode may be left out
_STILL = 1e-9  # size of a pole at zero, relative to the largest
_PER_DECADE, _BEYOND = 3, 3.0  # frequencies of the Gramians, and how far beyond the poles
_SEEN = 1e-13  # least Hankel singular value, relative to the largest
_ALIKE = 1e-6  # error of a response, relative to its largest value, with which a model is trusted
_PROBES = 8


@dataclass(frozen=True, kw_only=True, eq=False)
class LoopModel:
    """A rational plant x' = A x + B u, y = C x + D u for the poles of loops around it.

    `LoopModel.of` makes it; its states are no physical ones.
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray

    @classmethod
    def of(cls, plant: LinearPlant) -> LoopModel:
        """Return the model of a plant without delays, its inputs to its measurements."""
        whole = cls(A=plant.A, B=plant.B, C=plant.C, D=plant.D)
        try:
            few = whole._reduced()
        except np.linalg.LinAlgError:
            return whole
        return few if few._responds_as(whole) else whole

    def closed(self, controller: LinearController, gains: Sequence[float]) -> FloatArray:
        """Return the state matrix of a loop around it, (n + nk, n + nk).

        The controller is around the first inputs and measurements, each gain from one of the other
        measurements to one of the other inputs, in their order.
        """
        (nu, ny), nk, more = controller.D.shape, len(controller.A), len(gains)
        B, C = np.zeros((nk, ny + more)), np.zeros((nu + more, nk))
        D = np.zeros((nu + more, ny + more))
        B[:, :ny], C[:nu], D[:nu, :ny] = controller.B, controller.C, controller.D
        D[range(nu, nu + more), range(ny, ny + more)] = gains
        every = LoopModel(A=controller.A, B=B, C=C, D=D)
        return closed_loop_matrix(self, every)

    def _reduced(self) -> LoopModel:
        balanced, (scale, _) = scipy.linalg.matrix_balance(self.A, permute=False, separate=True)
        nothing = _STILL * float(np.abs(np.linalg.eigvals(balanced)).max(initial=0.0))

        def lively(real: float, imaginary: float) -> bool:
            return real >= -max(_DAMPED * float(np.hypot(real, imaginary)), nothing)

        T, Q, n = scipy.linalg.schur(balanced, output="real", sort=lively)
        if n == len(T) or not self.B.size or not self.C.size:
            return self
        A1, A2 = T[:n, :n], T[n:, n:]
        B, C = Q.T @ (self.B / scale[:, None]), (self.C * scale) @ Q
        beside = -T[:n, n:]
        if n:
            beside, shrunk, fault = scipy.linalg.lapack.dtrsyl(A1, A2, beside, isgn=-1)
            if fault:
                return self
            beside /= shrunk
        B1, B2, C1, C2 = B[:n] - beside @ B[n:], B[n:], C[:, :n], C[:, n:] + C[:, :n] @ beside
        triangle, turn = scipy.linalg.rsf2csf(A2, np.eye(len(A2)))
        sizes = np.abs(triangle.diagonal())
        low, high = sizes.min() / _BEYOND, sizes.max() * _BEYOND
        omega = np.geomspace(low, high, 1 + int(_PER_DECADE * np.log10(high / low)))
        reached = _factor(triangle, turn, B2 / _sizes(B), omega)
        heard = _factor(triangle.T, turn.conj(), C2.T / _sizes(C.T), omega)
        U, seen, V = np.linalg.svd(heard.T @ reached)
        kept = int(np.count_nonzero(seen > _SEEN * seen[0]))
        root = np.sqrt(seen[:kept])
        left, right = heard @ (U[:, :kept] / root), reached @ (V[:kept].T / root)
        return LoopModel(
            A=scipy.linalg.block_diag(A1, left.T @ A2 @ right),
            B=np.vstack([B1, left.T @ B2]),
            C=np.hstack([C1, C2 @ right]),
            D=self.D,
        )

    def _responds_as(self, whole: LoopModel) -> bool:
        """Return whether every response is that of another model."""
        sizes = np.abs(np.linalg.eigvals(self.A))
        moving = sizes[sizes > _STILL * sizes.max(initial=0.0)]
        if not moving.size:
            return True
        low, high = 0.3 * moving.min(), 3.0 * moving.max()
        points = (0.03 + 1j) * np.geomspace(low, high, _PROBES)
        own, right = self._response(points), whole._response(points)
        error, size = np.abs(own - right).max(axis=0), np.abs(right).max(axis=0)
        return bool(np.all((error <= _ALIKE * size) | (size == 0.0)))

    def _response(self, points: ComplexArray) -> ComplexArray:
        inside = np.multiply.outer(points, np.eye(len(self.A))) - self.A
        states = np.linalg.solve(inside, np.broadcast_to(self.B, (points.size, *self.B.shape)))
        return np.asarray(self.C @ states)


@lru_cache(maxsize=16)
def _loop_model(plant: LinearPlant, elements: tuple[Element, ...]) -> LoopModel:
    """Return the model of a plant with delay models, its elements' loops open and the last."""
    for element in elements:
        plant = plant.opened(element.velocity, element.force)
    return LoopModel.of(with_delay_models(plant)[0])


@lru_cache(maxsize=64)
def lively_poles(
    plant: LinearPlant,
    controller: LinearController,
    elements: tuple[Element, ...],
    coefficients: tuple[float, ...],
) -> ComplexArray:
    """Return the closed loop's poles [1/s], without damped ones of the plant that no loop moves."""
    gains = [e.reference - c for e, c in zip(elements, coefficients, strict=True)]
    closed = _loop_model(plant, elements).closed(controller, gains)
    found = np.linalg.eigvals(closed).astype(np.complex128)
    found.setflags(write=False)
    return found


def abscissa(poles: ComplexArray) -> float:
    """Return the largest real part over the size of the largest pole."""
    size = max(1.0, float(np.abs(poles).max(initial=1.0)))
    return float(poles.real.max(initial=-1.0)) / size


def _factor(T: ComplexArray, Q: ComplexArray, B: FloatArray, omega: FloatArray) -> FloatArray:
    """Return Z with Z Z^T near the Gramian of Q T Q^H and B, by its integral over log frequency.

    T is triangular, Q unitary, and their product is real.
    """
    lower = not np.any(np.triu(T, 1))
    inside, turned = -T, Q.conj().T @ B
    through = np.empty((len(omega), *B.shape), np.complex128)
    for states, at in zip(through, omega, strict=True):
        np.fill_diagonal(inside, 1j * at - T.diagonal())
        states[:] = scipy.linalg.solve_triangular(inside, turned, lower=lower, check_finite=False)
    through = Q @ through * np.sqrt(omega)[:, None, None]
    both = np.concatenate([through.real, through.imag], axis=2)
    return np.asarray(both.transpose(1, 0, 2).reshape(len(T), -1))


def _sizes(B: FloatArray) -> FloatArray:
    """Return the length of each column; 1 for one of zeros."""
    found = np.linalg.norm(B, axis=0)
    return np.where(found == 0.0, 1.0, found)
