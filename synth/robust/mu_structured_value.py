r"""Structured singular value of a matrix, bounded from above by scalings.

    mu(M) = 1 / min { k : det(I - k M Delta) = 0, Delta = diag(delta_i I), |delta_i| <= 1 }

Each delta_i is real or complex, and may repeat.  What can be computed is a bound from above, by
scalings that commute with Delta (Fan, Tits and Doyle, "Robustness in the presence of mixed
parametric uncertainty and unmodeled dynamics", IEEE TAC 36, 1991):

.. math::

    \mu(M) \le \beta \quad\text{if}\quad
    M^H D M + j (G M - M^H G) - \beta^2 D \le 0, \qquad D = D^H > 0, \; G = G^H,

G only for real blocks.  The least beta is a convex problem; here it is approached by a
quasi-Newton method on a smoothed largest eigenvalue, which takes milliseconds where a
semidefinite programme takes seconds.  Every pair (D, G) is a proof, however it was found: the
bound that is returned is that of the pair.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.linalg
from scipy.optimize import minimize

from models.basics import ComplexArray, FloatArray, IndexArray, InputError, check_range

_SHARPER = (10.0, 40.0, 160.0, 640.0)  # of the smoothed largest eigenvalue, in turn
_STEPS = 150  # of each
_SWEEPS = 20  # of balancing
_DEFECTIVE = 1e8  # condition of modes that are no coordinates
_GAIN = 1e-3  # relative gain of a stage below which a sharper one is not worth its time
_LARGEST = 10.0  # logarithm of a scaling's diagonal, over the one that it begins with
_WORTH = 2.0  # over the best, up to which other scalings are worth a search


@dataclass(frozen=True, kw_only=True)
class UncertaintyBlock:
    """A repeated scalar of Delta: how often it stands there, and whether it is real."""

    size: int = 1
    real: bool = True

    def __post_init__(self) -> None:
        check_range("Block", "size", self.size, low=1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Scaling:
    """Scalings that commute with Delta, and the bound that they prove.

    Attributes
    ----------
    bound
        mu is at most this for the matrix that they were made for.
    root
        R of D = R R^H, (m, m), block diagonal.
    G
        (m, m), Hermitian, zero where a block is complex.
    """

    bound: float
    root: ComplexArray
    G: ComplexArray

    def __post_init__(self) -> None:
        for name in ("root", "G"):
            held = np.array(getattr(self, name), dtype=np.complex128)
            held.setflags(write=False)
            object.__setattr__(self, name, held)

    def bounds(self, M: ComplexArray) -> FloatArray:
        """Return what the scalings prove for matrices M, (k, m, m) -> (k,)."""
        squares = np.linalg.eigvalsh(_pencil(M, self.root, self.G))[..., -1]
        return np.asarray(np.sqrt(np.maximum(squares, 0.0)), dtype=np.float64)


def mu_upper(
    M: npt.ArrayLike,
    blocks: Sequence[UncertaintyBlock],
    *,
    begin: Scaling | None = None,
    enough: float = 0.0,
) -> Scaling:
    """Return an upper bound on mu with the scalings that prove it.

    Parameters
    ----------
    M
        Matrix, (m, m).
    blocks
        The blocks of Delta in order; their sizes add up to m.
    begin
        Scalings to begin with, such as those of a neighbouring frequency.
    enough
        Bound at which the search may end.

    Returns
    -------
    Scaling

    Raises
    ------
    InputError
        If M is not square or the blocks do not fill it.
    """
    matrix = np.asarray(M, dtype=np.complex128)
    m = sum(block.size for block in blocks)
    if matrix.shape != (m, m):
        raise InputError(f"mu: M must have the shape ({m}, {m}) of its blocks, got {matrix.shape}")
    if not np.all(np.isfinite(matrix)):
        raise InputError("mu: M must be finite")
    best = _improved(matrix, blocks, _balanced(matrix, np.eye(m, dtype=np.complex128)), enough)
    if best.bound > enough and any(block.size > 1 for block in blocks):
        # Where a parameter stands often, in the coordinates of what it does alone: its modes.
        modal = _balanced(matrix, _modes(matrix, blocks))
        single = [UncertaintyBlock(real=block.real) for block in blocks for _ in range(block.size)]
        other = _improved(matrix, single, modal, enough)
        best = min(best, _improved(matrix, blocks, other, enough), key=lambda s: s.bound)
    if begin is not None and best.bound > enough:
        here = float(begin.bounds(matrix[None])[0])
        other = Scaling(bound=here, root=begin.root, G=begin.G)
        if here < _WORTH * best.bound:
            other = _improved(matrix, blocks, other, enough)
        best = min(best, other, key=lambda scaling: scaling.bound)
    return best


def _improved(
    matrix: ComplexArray, blocks: Sequence[UncertaintyBlock], best: Scaling, enough: float
) -> Scaling:
    """Return better scalings than those given, if there are any."""
    if best.bound <= enough:
        return best
    # In the coordinates of the first scaling all that remains is of size one.
    m, size = len(matrix), max(best.bound, 1e-300)
    base = np.asarray(best.root)
    inverse = np.linalg.inv(base)
    inner = base.conj().T @ matrix @ inverse.conj().T / size
    start = inverse @ np.asarray(best.G) @ inverse.conj().T / size
    shape = _Shape(blocks)
    turned = np.asarray(0.5 * (start + start.conj().T), dtype=np.complex128)
    x = shape.pack(np.eye(m, dtype=np.complex128), turned)
    for sharp in _SHARPER:
        found = minimize(
            shape.guarded,
            x,
            args=(inner, sharp),
            jac=True,
            method="L-BFGS-B",
            bounds=shape.bounds,
            options={"maxiter": _STEPS, "maxcor": 30, "ftol": 1e-9, "gtol": 1e-8},
        )
        if not np.all(np.isfinite(found.x)):
            break
        x = found.x
        root, G = shape.unpack(x)
        back = Scaling(bound=0.0, root=base @ root, G=size * base @ G @ base.conj().T)
        reached = float(back.bounds(matrix[None])[0])
        gain = best.bound - reached
        if gain > 0.0:
            best = Scaling(bound=reached, root=back.root, G=back.G)
        if best.bound <= enough or (sharp > _SHARPER[0] and gain < _GAIN * best.bound):
            break
    return best


class _Shape:
    """Scalings as a vector: the lower triangle of each L, its diagonal as logarithms, and G."""

    def __init__(self, blocks: Sequence[UncertaintyBlock]) -> None:
        self._parts: list[tuple[slice, bool, tuple[IndexArray, ...]]] = []
        at = 0
        for block in blocks:
            inside = slice(at, at + block.size)
            self._parts.append((inside, block.real, np.tril_indices(block.size, -1)))
            at += block.size
        self.size = at
        bounds: list[tuple[float | None, float | None]] = []
        for block in blocks:
            n, off = block.size, block.size * (block.size - 1)
            bounds += [(-_LARGEST, _LARGEST)] * n + [(None, None)] * off
            bounds += [(None, None)] * (n + off) * block.real
        self.bounds = bounds

    def pack(self, root: ComplexArray, G: ComplexArray) -> FloatArray:
        """Return the vector of L and G."""
        found: list[FloatArray] = []
        for inside, real, low in self._parts:
            L, g = root[inside, inside], G[inside, inside]
            found += [np.log(np.diag(L).real), L[low].real, L[low].imag]
            if real:
                found += [np.diag(g).real, g[low].real, g[low].imag]
        return np.concatenate(found)

    def unpack(self, x: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Return L and G."""
        root = np.zeros((self.size, self.size), dtype=np.complex128)
        G = np.zeros_like(root)
        at = 0
        for inside, real, low in self._parts:
            n, off = inside.stop - inside.start, low[0].size
            L, at = _triangle(x, at, n, off, low)
            L[np.diag_indices(n)] = np.exp(np.diag(L).real)
            root[inside, inside] = L
            if real:
                g, at = _triangle(x, at, n, off, low)
                G[inside, inside] = g + np.tril(g, -1).conj().T
        return root, G

    def guarded(self, x: FloatArray, M: ComplexArray, sharp: float) -> tuple[float, FloatArray]:
        """Return the same, or a large number where it cannot be computed."""
        with np.errstate(over="ignore", invalid="ignore"):
            try:
                value, slope = self.value(x, M, sharp)
            except np.linalg.LinAlgError:
                return 1e100, np.zeros(x.size)
        if np.isfinite(value) and np.all(np.isfinite(slope)):
            return value, slope
        return 1e100, np.zeros(x.size)

    def value(self, x: FloatArray, M: ComplexArray, sharp: float) -> tuple[float, FloatArray]:
        """Return the smoothed largest eigenvalue of the pencil, and its gradient."""
        # log-sum-exp of the eigenvalues, from above within log(m)/sharp: the largest alone has no
        # gradient where two of them meet, and there the optimum lies.
        root, G = self.unpack(x)
        squares, vectors = np.linalg.eigh(_pencil(M[None], root, G)[0])
        shifted = sharp * (squares - squares[-1])
        weights = np.exp(shifted)
        total = float(weights.sum())
        weights /= total
        # d lambda_i = v_i^H (M^H dD M - lambda_i dD + j(dG M - M^H dG)) v_i with v = L^-H times
        # the pencil's eigenvectors; D = L L^H makes dD of dL.
        v = scipy.linalg.solve_triangular(root, vectors, lower=True, trans="C")
        w = M @ v
        into_D = (w * weights) @ w.conj().T - (v * (weights * squares)) @ v.conj().T
        cross = (w * weights) @ v.conj().T
        into_G = 1j * (cross - cross.conj().T)
        slope = 2.0 * into_D @ root
        found: list[FloatArray] = []
        for inside, real, low in self._parts:
            s, L = slope[inside, inside], root[inside, inside]
            found += [np.diag(s).real * np.diag(L).real, s[low].real, s[low].imag]
            if real:
                g = into_G[inside, inside]
                found += [np.diag(g).real, 2.0 * g[low].real, 2.0 * g[low].imag]
        return float(squares[-1] + np.log(total) / sharp), np.concatenate(found)


def _triangle(
    x: FloatArray, at: int, n: int, off: int, low: tuple[IndexArray, ...]
) -> tuple[ComplexArray, int]:
    """Return a lower triangle with a real diagonal from a vector, and where it ends."""
    found = np.zeros((n, n), dtype=np.complex128)
    found[np.diag_indices(n)] = x[at : at + n]
    found[low] = x[at + n : at + n + off] + 1j * x[at + n + off : at + n + 2 * off]
    return found, at + n + 2 * off


def _pencil(M: ComplexArray, root: ComplexArray, G: ComplexArray) -> ComplexArray:
    """Return L^-1 (M^H D M + j (G M - M^H G)) L^-H, (k, m, m); M is (k, m, m)."""
    scaled = root.conj().T @ M
    turned = G @ M
    inner = np.swapaxes(scaled.conj(), -1, -2) @ scaled
    inner = inner + 1j * (turned - np.swapaxes(turned.conj(), -1, -2))
    inverse = np.linalg.inv(root)
    return np.asarray(inverse @ inner @ inverse.conj().T, dtype=np.complex128)


def _modes(M: ComplexArray, blocks: Sequence[UncertaintyBlock]) -> ComplexArray:
    """Return R whose coordinates R^H M R^-H make the inside of every repeated block diagonal."""
    found = np.eye(len(M), dtype=np.complex128)
    at = 0
    for block in blocks:
        inside = slice(at, at + block.size)
        at += block.size
        if block.size > 1:
            _, vectors = np.linalg.eig(M[inside, inside])
            if np.linalg.cond(vectors) < _DEFECTIVE:
                found[inside, inside] = np.linalg.inv(vectors).conj().T
    return found


def _balanced(M: ComplexArray, base: ComplexArray) -> Scaling:
    """Return scalings that balance rows and columns in the coordinates of a base (Osborne 1960)."""
    size = np.abs(base.conj().T @ M @ np.linalg.inv(base).conj().T) ** 2
    np.fill_diagonal(size, 0.0)
    d = np.ones(len(M))
    floor = 1e-24 * float(size.max(initial=0.0)) + 1e-200
    for _ in range(_SWEEPS):
        for i in range(len(M)):
            row, column = float(size[i] @ (1.0 / d**2)), float(size[:, i] @ d**2)
            d[i] = ((column + floor) / (row + floor)) ** 0.25
    d /= np.exp(np.mean(np.log(d)))
    root = base * d
    zero = np.zeros_like(root)
    first = Scaling(bound=0.0, root=root, G=zero)
    return Scaling(bound=float(first.bounds(M[None])[0]), root=root, G=zero)
