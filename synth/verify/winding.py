r"""The winding number: how many poles a closed loop has in the right half plane, delays exact.

The return difference D(s) = det(I - C P_yu), for one loop 1 + L(s), is the closed loop's
characteristic function over the open loop's.  By the argument principle its phase along a
contour around the right half plane counts the closed loop's zeros less the open loop's poles
in there (Nyquist 1932), whatever D is made of: delays, waves on a rope, any order.

::

        iR +-----__            up the imaginary axis, a half circle to the right around
           |        \\          every open-loop pole on it, back on a large arc; the lower
     i w_p  )        |         half is the mirror image
           |         |
         0  )        | R

Three things make the number certain rather than likely.  Points are added until neither phase
nor size of D jumps between neighbours, and every interval is cut once more to see that.  What
the half circles leave out is counted by a full circle.  And the large arc is moved out until L
is small on it and beyond, so that by the maximum principle nothing lies further out.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.linalg

from models.basics import ComplexArray, FloatArray, SolverError

Function = Callable[[ComplexArray], ComplexArray]

_TURN = 0.5  # largest phase step between neighbours [rad]
_GROWTH = 1.0  # largest step of the logarithm of the size
_INDENT = 1e-8  # radius of an indentation over the pole's own size
_AT_ORIGIN = 1e-5  # ... and over the smallest pole's, for the one around the origin
_TAIL, _LOOSE_TAIL = 0.1, 0.9  # |D/D(inf) - 1| beyond the contour: wanted, and enough
_MOST_POINTS = 200_000
_PER_DECADE = 40


@dataclass(frozen=True, kw_only=True)
class Winding:
    """The count of a closed loop's poles in the right half plane."""

    #: Poles of the closed loop in the open right half plane; -1 if the count failed.
    unstable: int = -1
    #: Poles of the closed loop so close to an open-loop pole on the imaginary axis that they count
    #: as on the axis themselves, such as an integrator that the controller cannot see.
    marginal: int = 0
    open_loop: int = 0  #: Poles of the open loop in the open right half plane.
    radius: float = np.inf  #: Radius of the large arc [1/s].
    tail: float = np.inf  #: Largest |D/D(inf) - 1| seen on it and beyond.
    points: int = 0  #: Evaluations of D that it took.
    failure: str = ""  #: Why there is no count; empty if there is one.

    @property
    def stable(self) -> bool:
        """Whether the closed loop was proved to have no pole on or right of the axis."""
        return not self.failure and self.unstable == 0 and self.marginal == 0


def trace(
    function: Function,
    path: Callable[[FloatArray], ComplexArray],
    start: npt.ArrayLike,
    *,
    loop_floor: float | None = None,
) -> tuple[FloatArray, ComplexArray]:
    """Follow a function along a path, on as many points as its phase needs.

    Parameters
    ----------
    function
        s (k,) [1/s] -> D (k,).
    path
        Path coordinate (k,) -> s (k,).
    start
        Coordinates to begin with, (m,), at least two; they have to be close enough to see every
        resonance, which is what `lively` is for.
    loop_floor
        If given, L = D - 1 is followed in the same way wherever |L| is above this.

    Returns
    -------
    tuple
        Path coordinates, ascending (k,), and the function there (k,).

    Raises
    ------
    SolverError
        If the phase cannot be followed.
    """
    t = np.unique(np.asarray(start, dtype=np.float64))
    values = function(path(t))
    confirmed = np.zeros(t.size - 1, dtype=np.bool_)
    while True:
        if not np.all(np.isfinite(values)) or np.any(values == 0.0):
            raise SolverError("a pole lies on the contour")
        smooth = _smooth(values)
        if loop_floor is not None:
            small = np.maximum(np.abs(values[1:] - 1.0), np.abs(values[:-1] - 1.0)) < loop_floor
            smooth &= small | _smooth(values - 1.0)
        cut = np.flatnonzero(~(smooth & confirmed))
        if not cut.size:
            return t, values
        width = np.abs(path(t[cut + 1]) - path(t[cut]))
        if np.any((width < 1e-13 * np.abs(path(t[cut]))) & ~smooth[cut]):
            where = complex(path(t[cut[[int(np.argmin(width))]]])[0])
            raise SolverError(f"a pole lies on the contour at s = {where:.6g} 1/s")
        if t.size + cut.size > _MOST_POINTS:
            raise SolverError(f"the phase cannot be followed with {_MOST_POINTS} points")
        middle = 0.5 * (t[cut] + t[cut + 1])
        # Both halves of an interval that looked smooth are its proof, if they are smooth too.
        confirmed[cut] = smooth[cut]
        confirmed = np.insert(confirmed, cut, smooth[cut])
        values = np.insert(values, cut + 1, function(path(middle)))
        t = np.insert(t, cut + 1, middle)


def turn(
    function: Function, path: Callable[[FloatArray], ComplexArray], start: FloatArray
) -> float:
    """Return the change of a function's phase along a path [rad], followed as by `trace`.

    Raises SolverError if the phase cannot be followed.
    """
    _, values = trace(function, path, start)
    return float(np.angle(values[1:] / values[:-1]).sum())


def count_unstable(
    function: Function,
    *,
    poles: npt.ArrayLike,
    marks: npt.ArrayLike = (),
    at_infinity: complex = 1.0,
    per_decade: int = _PER_DECADE,
) -> Winding:
    """Count the closed loop's poles in the right half plane.

    Parameters
    ----------
    function
        The return difference D: s (k,) -> (k,), with D(conj s) = conj D(s).
    poles
        Open-loop poles [1/s]: all that are unstable or on the imaginary axis, with their
        multiplicity, an integrator as an exact 0.  Others are used as marks.
    marks
        Further points [1/s] near which D may change quickly: other poles, open or closed loop.
    at_infinity
        What D tends to for large |s|; 1 if the loop gain falls off.
    per_decade
        Points per decade to begin with; more where there may be modes that no mark tells of.
    """
    poles = np.asarray(poles, dtype=np.complex128).reshape(-1)
    marks = np.concatenate([poles, np.asarray(marks, dtype=np.complex128).reshape(-1)])
    sizes = np.abs(marks)[np.abs(marks) > 1e-12 * np.abs(marks).max(initial=0.0)]
    smallest, largest = (float(sizes.min()), float(sizes.max())) if sizes.size else (1.0, 1.0)
    origin = _AT_ORIGIN * smallest
    inside = np.abs(poles) < origin
    clusters = axis_clusters(poles[~inside])
    taken = [np.abs(poles - 1j * w) < r for w, r, _ in clusters]
    taken += [np.abs(poles + 1j * w) < r for w, r, _ in clusters]
    out = inside | (np.any(taken, axis=0) if taken else False)
    open_loop = int(np.sum((poles.real > 0.0) & ~out))
    points = 0

    def scaled(s: ComplexArray) -> ComplexArray:
        nonlocal points
        points += s.size
        return np.asarray(function(s) / at_infinity, dtype=np.complex128)

    radius, tail = _radius(scaled, 10.0 * largest)

    discs = [(0.0, origin, int(np.sum(inside))), *clusters]
    unstable, marginal, failure = -1, 0, ""
    try:
        if tail > _LOOSE_TAIL:
            raise SolverError(
                f"the loop gain does not fall off: |D/D(inf) - 1| is still {tail:.3g}"
            )
        # Circles first: closed-loop poles that the indented contour leaves out.
        for at, size, count in discs:
            stretch = np.pi if at == 0.0 else 2.0 * np.pi  # at the origin, half is the mirror image
            around = turn(scaled, _arc(at, size), np.linspace(0.0, stretch, 17)) / stretch
            zeros = _whole(count + around, f"the circle around {at:.4g} rad/s")
            marginal += zeros * (1 if at == 0.0 else 2)
        pieces = _contour(discs, radius, marks, per_decade)
        turned = sum(turn(scaled, path, start) for path, start in pieces)
        # Clockwise, and both halves turn alike: Z - P = -(2 turn) / (2 pi).
        unstable = _whole(open_loop - turned / np.pi, "the contour")
    except SolverError as error:
        failure = str(error)
    return Winding(
        unstable=unstable,
        marginal=marginal,
        open_loop=open_loop,
        radius=radius,
        tail=tail,
        points=points,
        failure=failure,
    )


def _whole(zeros: float, what: str) -> int:
    """Return a number of poles that a closed path has counted."""
    if abs(zeros - round(zeros)) > 0.05:
        raise SolverError(f"{what} does not close: {zeros:.3f} poles")
    return round(zeros)


def open_loop_poles(A: npt.ArrayLike) -> ComplexArray:
    """Return the eigenvalues of a matrix, (n,), integrators as exact zeros.

    A chain of integrators comes out of an eigenvalue solver as a ring of small poles, half of
    them unstable.  So the null space is deflated first, as often as there is one: what is left
    is the map on the quotient space, with the other eigenvalues.
    """
    rest: FloatArray = scipy.linalg.matrix_balance(np.array(A, dtype=float), permute=False)[0]
    order = len(rest)
    while len(rest):
        basis, triangle, _ = scipy.linalg.qr(rest.T, pivoting=True)
        sizes = np.abs(np.diag(triangle))
        rank = int(np.sum(sizes > 1e-13 * sizes[0]))
        if rank == len(rest):
            break
        kept = basis[:, :rank]
        rest = kept.T @ rest @ kept
    poles = np.zeros(order, dtype=np.complex128)
    poles[: len(rest)] = np.linalg.eigvals(rest)
    return poles


def lively(
    low: float, high: float, marks: npt.ArrayLike, per_decade: int = _PER_DECADE
) -> FloatArray:
    """Return frequencies [rad/s] from `low` to `high`, denser at the `marks` [1/s], (k,)."""
    points = np.asarray(marks, dtype=np.complex128).reshape(-1)
    count = max(2, int(np.ceil(per_decade * np.log10(high / low))) + 1)
    steps = np.array([0.3, 0.7, 1.2, 2.0, 3.5, 7.0, 14.0])
    steps = np.concatenate([-steps[::-1], [0.0], steps])
    at = np.abs(points.imag)
    width = np.maximum(np.abs(points.real), 1e-9 * at)
    light = (at > 0.0) & (width < at)
    near = (at[light, None] + width[light, None] * steps).ravel()
    grid = np.concatenate([np.geomspace(low, high, count), near[(near > low) & (near < high)]])
    grid[0], grid[count - 1] = low, high
    return np.unique(grid)


def _smooth(values: ComplexArray) -> npt.NDArray[np.bool_]:
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        step = values[1:] / values[:-1]
        near = np.abs(step.imag) <= np.tan(_TURN) * step.real
        size = step.real**2 + step.imag**2
    return np.asarray(near & (size <= np.exp(2.0 * _GROWTH)) & (size >= np.exp(-2.0 * _GROWTH)))


def axis_clusters(poles: ComplexArray) -> list[tuple[float, float, int]]:
    """Return centre [rad/s], radius and number of poles that lie on the axis above the origin."""
    on = poles[(np.abs(poles.real) < 0.5 * _INDENT * np.abs(poles)) & (poles.imag > 0.0)]
    clusters: list[tuple[float, float, int]] = []
    for w in np.sort(on.imag):
        if clusters and w - clusters[-1][0] < 4.0 * clusters[-1][1]:
            at, size, count = clusters[-1]
            clusters[-1] = (at, max(size, 2.0 * (w - at)), count + 1)
        else:
            clusters.append((float(w), _INDENT * float(w), 1))
    return clusters


def _radius(scaled: Function, first: float) -> tuple[float, float]:
    """Return a radius on and beyond which D is close to its limit, and how close."""
    radius, before = first, np.inf
    around = np.exp(1j * np.linspace(0.0, 0.5 * np.pi, 91))
    directions = np.concatenate([around, 1j * np.geomspace(1.0, 100.0, 401)])
    for _ in range(20):
        with np.errstate(over="ignore", invalid="ignore"):
            distance = np.abs(scaled(np.asarray(radius * directions)) - 1.0)
        tail = float(np.max(np.nan_to_num(distance, nan=np.inf)))
        # A loop gain that only tends to a number below one (a direct path, delayed) will do.
        if tail <= _TAIL or _LOOSE_TAIL > tail > 0.8 * before:
            break
        radius, before = 4.0 * radius, tail
    return radius, tail


def _contour(
    discs: Sequence[tuple[float, float, int]],
    radius: float,
    marks: ComplexArray,
    per_decade: int,
) -> list[tuple[Callable[[FloatArray], ComplexArray], FloatArray]]:
    """Return the pieces of the contour's upper half, as path and first points."""

    def axis(t: FloatArray) -> ComplexArray:
        return np.asarray(1j * np.exp(t), dtype=np.complex128)

    def back(t: FloatArray) -> ComplexArray:
        return np.asarray(radius * np.exp(1j * (0.5 * np.pi - t)), dtype=np.complex128)

    pieces: list[tuple[Callable[[FloatArray], ComplexArray], FloatArray]] = []
    low = 0.0
    for at, size, _ in discs:
        if at > 0.0:
            pieces.append((axis, np.log(lively(low, at - size, marks, per_decade))))
        pieces.append((_arc(at, size), np.linspace(-0.5 * np.pi if at else 0.0, 0.5 * np.pi, 17)))
        low = at + size
    pieces.append((axis, np.log(lively(low, radius, marks, per_decade))))
    pieces.append((back, np.linspace(0.0, 0.5 * np.pi, 33)))
    return pieces


def _arc(at: float, size: float) -> Callable[[FloatArray], ComplexArray]:
    def arc(t: FloatArray) -> ComplexArray:
        return np.asarray(1j * at + size * np.exp(1j * t), dtype=np.complex128)

    return arc
