"""Integrals over frequency by other panels than the optimiser's, for the verification.

The optimiser integrates with `models.basics.quadrature`, by longer and longer rules on each panel.
Here the band is cut into panels of another kind, all of them are integrated at once by Gauss's and
Kronrod's rules, and those are halved where the two differ.
"""

from collections.abc import Callable, Sequence

import numpy as np

from models.basics import BoolArray, ComplexArray, FloatArray, SolverError

_PIECES = 40  # of each panel at most, on average, with 15 nodes each
_HALVINGS = 40  # of any panel at most: what has no integral has none at its end either
_PANELS_PER_DECADE = 4.0
_RINGING = 1e-7  # accuracy of integrals to infinity
# QUADPACK's ``qk15``, Kronrod's rule on [-1, 1]: weights from the middle outwards, at the nodes of
# Gauss's rule of seven and between them, and the nodes between them.
_WEIGHTS = [0.209482141084727828, 0.190350578064785410, 0.140653259715525919, 0.063092092629978553]
_BETWEEN = [0.204432940075298892, 0.169004726639267903, 0.104790010322250184, 0.022935322010529225]
_PLACES = [0.207784955007898468, 0.586087235467691130, 0.864864423359769073, 0.991455371120812639]
_GAUSS, _COARSE = np.polynomial.legendre.leggauss(7)
_NODES = np.concatenate([_GAUSS, _PLACES, np.negative(_PLACES)])
_FINE = np.concatenate([_WEIGHTS[:0:-1], _WEIGHTS, _BETWEEN, _BETWEEN])


def integrate(
    density: Callable[[FloatArray], FloatArray],
    edges: FloatArray,
    *,
    rtol: float,
    tail_panels: int = 0,
) -> FloatArray:
    """Return integrals over frequency, (m,).

    The density leads from omega (k,) [rad/s] to integrands (m, k); `edges` are those of panels,
    ascending [rad/s]; the accuracy `rtol` is relative to each integral.  If `tail_panels` is above
    zero, it goes on from the first edge to zero, and from the last to infinity in so many panels of
    1/omega: a few for a smooth tail, many for one that rings.

    Raises SolverError if it does not converge: the integral does not exist, or an integrand is
    wild.
    """
    half_line = tail_panels > 0
    start = np.append(0.0, edges[:-1]) if half_line else edges[:-1]
    width = np.diff(np.append(0.0, edges) if half_line else edges)
    # The tail in v = 1/omega.
    step = 1.0 / (max(1, tail_panels) * float(edges[-1]))
    start = np.append(start, step * np.arange(float(tail_panels)))
    width = np.append(width, np.full(tail_panels, step))
    ends = np.arange(start.size) >= start.size - tail_panels

    def measured(spans: FloatArray, turned: BoolArray) -> tuple[FloatArray, FloatArray]:
        """Return the integrals over spans of omega or v, (k, 2), and their errors, (m, k) each."""
        middle, half = spans.mean(axis=1), 0.5 * np.diff(spans)
        at = middle[:, None] + half * _NODES
        omega = np.where(turned[:, None], 1.0 / at, at)
        weight = half * np.where(turned[:, None], omega**2, 1.0)
        values = np.asarray(density(omega.ravel())).reshape(-1, *omega.shape) * weight
        fine, coarse = values @ _FINE, values[..., :7] @ _COARSE
        return fine, np.abs(fine - coarse)

    spans = np.column_stack([start, start + width])
    sums, errors = measured(spans, ends)
    most = _PIECES * len(spans)
    # What is left of the ringing is far below the accuracy that it makes hard to prove.
    wanted = max(rtol, _RINGING) if half_line else rtol
    for _ in range(_HALVINGS):
        whole = sums.sum(axis=1, keepdims=True)
        # The difference is the coarser rule's error; what the finer one's is, QUADPACK says so.
        relative = (errors / np.where(whole > 0.0, whole, 1.0)).max(axis=0)
        left_over = np.minimum(relative, (200.0 * relative) ** 1.5)
        if left_over.sum() <= wanted or not np.all(np.isfinite(sums)):
            break
        cut = left_over > 0.5 * wanted / len(spans)
        if len(spans) + cut.sum() > most:
            break
        middle = spans[cut].mean(axis=1)
        halves = np.concatenate(
            [np.column_stack([spans[cut, 0], middle]), np.column_stack([middle, spans[cut, 1]])]
        )
        new = measured(halves, np.tile(ends[cut], 2))
        spans = np.concatenate([spans[~cut], halves])
        ends = np.concatenate([ends[~cut], np.tile(ends[cut], 2)])
        sums, errors = (
            np.concatenate([old[:, ~cut], found], axis=1)
            for old, found in zip((sums, errors), new, strict=True)
        )
    missed = left_over.sum() > (100.0 * wanted if half_line else wanted)
    if missed or not np.all(np.isfinite(sums)):
        raise SolverError("verification: the quadrature of a spectral integral does not converge")
    return np.asarray(sums.sum(axis=1), dtype=np.float64)


def panels(
    low: float,
    high: float,
    splits: Sequence[float],
    marks: ComplexArray,
    longest: float = np.inf,
) -> FloatArray:
    """Return panel edges [rad/s]: even in log-frequency, at the kinks, denser near poles.

    Band, kinks (`splits`) and the length that no panel exceeds are in rad/s; `marks` are poles
    [1/s], and no panel is longer than twice its distance from one.
    """
    count = int(np.ceil(_PANELS_PER_DECADE * np.log10(high / low))) + 1
    kinks = np.asarray(splits, dtype=np.float64)
    edges = np.concatenate([np.geomspace(low, high, count), kinks])
    edges = np.unique(edges[(edges >= low) & (edges <= high)])
    at, off = np.abs(marks.imag), np.maximum(np.abs(marks.real), 1e-9 * np.abs(marks))
    at, off = at[off > 0.0], off[off > 0.0]  # an integrator is no feature above zero
    looked_at = np.column_stack([edges[:-1], edges[1:]])
    for _ in range(60):
        a, b = looked_at[:, :1], looked_at[:, 1:]
        away = np.hypot(np.maximum(np.maximum(a - at, at - b), 0.0), off)
        long = 0.5 * (b - a)[:, 0] > away.min(axis=1, initial=0.5 * longest)
        if not long.any():
            break
        middle = looked_at[long].mean(axis=1)
        edges = np.append(edges, middle)
        low, high = looked_at[long].T
        looked_at = np.concatenate([np.column_stack(p) for p in ((low, middle), (middle, high))])
    return np.sort(edges)
