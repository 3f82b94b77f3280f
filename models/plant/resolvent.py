"""The resolvent (s I - A)^-1 of a state matrix, what every response of a plant is made of.

By modes where the eigenvectors are far enough from parallel, one matrix product for all
points, by back-substitution in the Schur form elsewhere::

    C (s I - A)^-1 B = sum_k c_k b_k / (s - lambda_k),  c_k = C v_k,  b_k = (V^-1 B)_k

A conjugate pair is taken together, r/(s - lambda) + r*/(s - lambda*) =
(2 Re(r) s - 2 Re(r lambda*)) / ((s - lambda)(s - lambda*)), so that all products are of real
matrices; a real pole, of which a hysteretic rope's branches bring many, costs one division a point.
"""

from collections.abc import Callable
from functools import cached_property

import numpy as np
import scipy.linalg

from ..basics import BoolArray, ComplexArray, FloatArray

Transfer = Callable[[ComplexArray], ComplexArray | None]

_CHUNK = 512  # points solved at a time: keeps the stacked (n, k, columns) states in the cache
# Modes count as sound below these: condition of the eigenvectors (of unit length, A balanced),
# and residual of the resolvent over |s I - A| times its own size, where a stable solver leaves
# 1e-16 to 1e-15.
_CONDITION, _RESIDUAL = 1e4, 1e-14
_ROUNDING = 8.0 * float(np.finfo(float).eps)  # of an eigenvalue, relative to itself
_UNDAMPED = 1e-12  # damping ratio of a pole that has none but for rounding
_PROBES = 5  # points at which the residual is looked at


class Resolvent:
    """(s I - A)^-1 of a real matrix A, (n, n), decomposed once when first asked for."""

    def __init__(self, A: FloatArray) -> None:
        self.A = A

    def between(self, C: FloatArray, B: FloatArray) -> Transfer:
        """Return the function of points s, (k,), to C (s I - A)^-1 B, (k, rows, columns).

        It returns None where a point is an eigenvalue of A.
        """
        shape = C.shape[0], B.shape[1]
        if not len(self.A):
            return lambda s: np.zeros((s.size, *shape), dtype=np.complex128)
        if self.modes is None:
            return self._by_back_substitution(C, B)
        return self._by_modes(self.modes, C, B)

    def _by_modes(
        self, modes: tuple[ComplexArray, ComplexArray, ComplexArray], C: FloatArray, B: FloatArray
    ) -> Transfer:
        poles, V, W = modes
        residues = (C @ V).T[:, :, None] * (W @ B)[:, None, :] * self._paths(C, B)
        residues = residues.reshape(len(poles), -1)
        some = np.flatnonzero(residues.any(axis=0))  # no path leads elsewhere
        real, upper = np.flatnonzero(poles.imag == 0.0), np.flatnonzero(poles.imag > 0.0)
        slow, pairs = residues[np.ix_(real, some)].real, residues[np.ix_(upper, some)]
        at, above, width = poles[real].real, poles[upper], some.size
        swing, on = 2.0 * pairs.real, 2.0 * (pairs * above.conj()[:, None]).real
        plain = np.vstack([np.hstack([-slow, -at[:, None] * slow]), np.hstack([swing, -on])])
        turned = np.hstack([swing, on])
        nothing = _ROUNDING * np.abs(above)
        near = (_ROUNDING * at) ** 2, (nothing * np.maximum(2.0 * above.imag, nothing)) ** 2

        def some_of(points: ComplexArray) -> ComplexArray | None:
            """1/(s - p) and 1/((s - lambda)(s - lambda*)) are conjugates over squares."""
            x, y = points.real[:, None], points.imag[:, None]
            right = x - above.real
            across, along = right**2 + (above.imag - y) * (above.imag + y), 2.0 * y * right
            size, sizes = (x - at) ** 2 + y**2, across**2 + along**2
            if (size <= near[0]).any() or (sizes <= near[1]).any():
                return None
            both = np.concatenate([1.0 / size, across / sizes], axis=1) @ plain
            twisted = (along / sizes) @ turned
            found = np.empty((points.size, width), dtype=np.complex128)
            found.real = y * twisted[:, :width] + both[:, width:]
            found.imag = y * both[:, :width] + twisted[:, width:]
            if x.any():
                found += x * (both[:, :width] + 2.0 * (1.0 / size) @ slow)
                found -= 1j * x * twisted[:, :width]
            return found

        def transfer(s: ComplexArray) -> ComplexArray | None:
            found = np.zeros((s.size, residues.shape[1]), dtype=np.complex128)
            for start in range(0, s.size, _CHUNK):
                own = some_of(s[start : start + _CHUNK])
                if own is None:
                    return None
                found[start : start + _CHUNK, some] = own
            return found.reshape(s.size, len(C), B.shape[1])

        return transfer

    def _by_back_substitution(self, C: FloatArray, B: FloatArray) -> Transfer:
        T, into, out_of = self._triangular
        right, left, paths = into @ B, C @ out_of, self._paths(C, B)
        # From the side with fewer columns: the transpose, upside down, is upper triangular too.
        turned = len(C) < B.shape[1]
        matrix, known = (T[::-1, ::-1].T, left[:, ::-1].T) if turned else (T, right)

        def transfer(s: ComplexArray) -> ComplexArray | None:
            found = np.empty((s.size, len(C), B.shape[1]), dtype=np.complex128)
            for start in range(0, s.size, _CHUNK):
                x = _back_substituted(matrix, known, s[start : start + _CHUNK])
                if x is None:
                    return None
                part = x[:, ::-1].transpose(0, 2, 1) @ right if turned else left @ x
                found[start : start + _CHUNK] = part
            return found * paths

        return transfer

    @cached_property
    def poles(self) -> ComplexArray:
        """The eigenvalues of A, (n,): those of `modes` where they are at hand."""
        modes = self.__dict__.get("modes")
        found = np.linalg.eigvals(self.A) if modes is None else modes[0]
        found = np.array(found, dtype=np.complex128)
        found.setflags(write=False)
        return found

    @cached_property
    def undamped(self) -> list[float]:
        """Frequencies above zero of the poles on the imaginary axis."""
        swinging = self.poles[self.poles.imag > 0.0]
        on_axis = np.abs(swinging.real) <= _UNDAMPED * np.abs(swinging)
        return [float(at) for at in swinging.imag[on_axis]]

    def _paths(self, C: FloatArray, B: FloatArray) -> BoolArray:
        """Tell which inputs reach which outputs at all, (rows, columns).

        A winch does not move the ship: such a response is zero, and no sum that rounds to it.
        """
        return np.asarray((C != 0.0) @ self._reach @ (B != 0.0))

    @cached_property
    def _reach(self) -> BoolArray:
        """Whether a state, (row), hears another one, (column), through however many others."""
        reach: BoolArray = (self.A != 0.0) | np.eye(len(self.A), dtype=np.bool_)
        for _ in range(len(self.A).bit_length()):
            reach = (ones := reach.astype(np.float32)) @ ones > 0.0  # far faster than of booleans
        return reach

    @cached_property
    def modes(self) -> tuple[ComplexArray, ComplexArray, ComplexArray] | None:
        """Lambda (n,), V and V^-1 (n, n) with A = V diag(lambda) V^-1; None if not to be trusted.

        A chain of integrators (a drum in torque mode) or a delay model of high order has
        eigenvectors so nearly parallel that the sum over modes loses its digits.
        """
        balanced, scale = self._balanced
        poles, V = (np.asarray(part, dtype=np.complex128) for part in np.linalg.eig(balanced))
        if np.linalg.cond(V) > _CONDITION:
            return None
        W = np.linalg.inv(V)
        sizes = np.abs(poles)
        sizes = sizes[sizes > 1e-9 * sizes.max()] if sizes.any() else np.ones(1)
        eye = np.eye(len(poles))
        for omega in np.geomspace(0.3 * sizes.min(), 3.0 * sizes.max(), _PROBES):
            s = (0.03 + 1j) * omega
            shifted, inverse = s * eye - balanced, (V / (s - poles)) @ W
            allowed = _RESIDUAL * np.linalg.norm(shifted) * np.linalg.norm(inverse)
            if np.linalg.norm(shifted @ inverse - eye) > allowed:
                return None
        return poles, scale[:, None] * V, np.asarray(W / scale, dtype=np.complex128)

    @cached_property
    def _triangular(self) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """T, U, V with A = V T U, T upper triangular and U = V^-1, (n, n) each."""
        balanced, scale = self._balanced
        T, Q = scipy.linalg.schur(balanced, output="complex")
        return np.asarray(T), Q.conj().T / scale, scale[:, None] * Q

    @cached_property
    def _balanced(self) -> tuple[FloatArray, FloatArray]:
        balanced, (scale, _) = scipy.linalg.matrix_balance(self.A, permute=False, separate=True)
        return np.asarray(balanced), np.asarray(scale)


def _back_substituted(T: ComplexArray, right: ComplexArray, s: ComplexArray) -> ComplexArray | None:
    """Solve (s I - T) x = right for every point s, (k, n, columns); None at an eigenvalue."""
    n = len(T)
    x = np.empty((n, s.size, right.shape[1]), dtype=np.complex128)
    for i in range(n - 1, -1, -1):
        pivot = s - T[i, i]
        if not np.all(pivot):
            return None
        x[i] = (right[i] + np.tensordot(T[i, i + 1 :], x[i + 1 :], axes=1)) / pivot[:, None]
    return x.transpose(1, 0, 2)
