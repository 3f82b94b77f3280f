r"""Sequential quadratic programming on few variables and many rows.

.. math::

    \min_{d, s} \tfrac12 d^T H d + \nabla f^T d + \rho s \quad\text{s.t. }
    g + J d \le s, \; |h + A d| \le s, \; s \ge 0

An exact penalty on the largest row (Nocedal and Wright, *Numerical Optimization*, 2nd ed., ch. 17
and 18): the slack keeps every quadratic programme feasible, so that a start may break its limits.
The Hessian of the Lagrangian is the model of the curvature that comes with each evaluation, and
what the slopes tell beyond it by the symmetric rank-one formula.  Steps keep within a box that
grows and shrinks with how well they were foretold; rows that cannot come into play within it stay
out of the quadratic programme, which DAQP solves by a dual active set.  Points at which the loop is
unstable are never evaluated: a spectral integral is finite there too.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

import daqp
import numpy as np
from scipy.linalg import eigh
from typing_extensions import override

from models.basics import BoolArray, FloatArray

_SLACK = 1e-8  # curvature of the slack, which the quadratic programme wants positive
_FLAT = 1e-8  # least curvature of the model
_FLOOR = 1e-4  # of the model, relative to its mean curvature
_SHARE, _LEAST_SHARE = 1e-3, 1e-9  # of the model's curvature that every direction has, at first
_LEAST = 0.1  # a variable near zero is given this share of the size that moves something by one
_ROOM, _LEAST_ROOM = 0.5, 1e-9  # how far, relatively, a variable may move at first and at last
_MOST_ROOM = 4.0
_CLOSER, _STALLED = 0.3, 12  # of the room, after a step that failed; such steps in a row at most
_SOUND = 1e-4  # share of the reduction promised that a step must keep
_FIRST_WEIGHT, _LIGHTER = 10.0, 0.3  # of the rows, and how fast it falls
_STIFF, _LEAST_PRICE = 1.5, 0.1  # weight over the sum of the multipliers, and that sum at least
_HEAVY = 1e4  # of the penalty: if rows are broken still, nothing near mends them
_HOPELESS = 0.999  # share of what rows are broken by that is left where nothing near mends them
INFEASIBLE = "the limits exclude each other"
UNFINISHED = "maximum of iterations"
_SOME = 15  # steps after which a descent must be worth going on with
_CREEPS, _CREPT = 10, 1e-6  # steps that together gain less than this have arrived
_NOTHING = 1e-7  # of the objective, promised where no step helps: slopes and values round
_KEPT = 1e-8  # row that counts as kept
# No pole can pass the axis between two points so near to each other that both keep the rows so far:
# there |1 + L| would be none.  Where descents were asked, no step of half the size did.
_SHORT, _NEARLY_KEPT = 0.2, 0.02
_SKIPPED = 1e-6  # an update along less than this share of a step is left out


@dataclass(frozen=True, kw_only=True, eq=False)
class Glance:
    """A programme at a point: objective, rows (m,) at most zero, equations (e,).

    `costs` (k,) are what the objective is made of, for who wants to know them at the end.
    """

    objective: float
    rows: FloatArray
    equations: FloatArray
    costs: FloatArray = field(default_factory=lambda: np.zeros(0))

    @property
    def broken(self) -> float:
        """The largest row or equation; 0 where all are kept."""
        return max(
            0.0, float(self.rows.max(initial=0.0)), float(np.abs(self.equations).max(initial=0.0))
        )

    @property
    def finite(self) -> bool:
        """Whether everything is a number."""
        parts = (self.objective, self.rows, self.equations)
        return all(bool(np.all(np.isfinite(part))) for part in parts)


@dataclass(frozen=True, kw_only=True, eq=False)
class Evaluation(Glance):
    """A programme at a point with its slopes.

    Shapes: slope (n,), jacobian (m, n), firm (m,), slopes of the equations (e, n).  A `firm` row is
    held while others are broken still: beyond it no point may be evaluated.  `curvature` (n, n),
    positive semidefinite, is a model of the objective's Hessian from its slopes alone
    (Gauss-Newton).
    """

    slope: FloatArray
    jacobian: FloatArray
    firm: BoolArray
    equation_slopes: FloatArray
    curvature: FloatArray

    @property
    @override
    def finite(self) -> bool:
        parts = (self.slope, self.jacobian)
        return super().finite and all(bool(np.all(np.isfinite(part))) for part in parts)

    def lagrangian_slope(self, prices: FloatArray, equation_prices: FloatArray) -> FloatArray:
        """Return the slope of objective + prices . rows + prices . equations, (n,)."""
        return np.asarray(
            self.slope + prices @ self.jacobian + equation_prices @ self.equation_slopes
        )


_Seen = TypeVar("_Seen", bound=Glance)


@dataclass(frozen=True, kw_only=True, eq=False)
class Descent:
    """Where a descent ended: the point, its evaluation, the multipliers, and how."""

    x: FloatArray
    at: Evaluation
    prices: FloatArray
    converged: bool
    message: str
    steps: int


def descend(
    evaluate: Callable[[FloatArray], Evaluation],
    glance: Callable[[FloatArray], Glance],
    stable: Callable[[FloatArray], bool],
    start: FloatArray,
    low: FloatArray,
    high: FloatArray,
    *,
    logarithmic: BoolArray,
    tolerance: float = 1e-8,
    most: int = 60,
    worth: float = np.inf,
    guarded: bool = False,
) -> Descent:
    """Return the point near a start where nothing gets better within the rows.

    `evaluate` gives the programme at a vector (n,), `glance` the same without slopes for less, and
    `stable` says whether it may be evaluated.
    The start and the ends of each variable are (n,); so is `logarithmic`, which of them are
    logarithms, of size one.  A step must promise more than `tolerance` of the objective to be
    taken; there are at most `most`, and no more than some where the objective is above `worth`
    still.  If the rows keep |1 + L| off zero, it is `guarded`: a short step between points that
    keep them is taken as stable.
    """
    x = np.clip(start, low, high)
    prices, equation_prices = np.zeros(0), np.zeros(0)
    if not stable(x):
        none = np.zeros(0)
        empty = Evaluation(
            objective=np.inf,
            slope=np.zeros_like(x),
            rows=none,
            jacobian=np.zeros((0, x.size)),
            firm=np.zeros(0, np.bool_),
            equations=none,
            equation_slopes=np.zeros((0, x.size)),
            curvature=np.zeros((x.size, x.size)),
        )
        return _ended(x, empty, none, "the start is unstable", 0)
    at = evaluate(x)
    if not at.finite:
        return _ended(x, at, np.zeros(at.rows.size), "no number", 0)
    rest = np.zeros((x.size, x.size))  # of the Hessian beside the model of the curvature
    room, weight, stalled, stiff = _ROOM, _FIRST_WEIGHT, 0, _SHARE
    prices, equation_prices = np.zeros(at.rows.size), np.zeros(at.equations.size)
    reached: list[float] = []  # objectives since the rows are kept
    bends = False  # whether the last step was a bent one
    for k in range(most):
        if k == _SOME and at.objective > worth:
            break
        size = np.where(logarithmic, 1.0, _sizes(x, at))
        hessian = at.curvature + rest
        reach = room * size
        box = np.maximum(low - x, -reach), np.minimum(high - x, reach)
        found = _quadratic(at, at.rows, at.equations, hessian, box, weight, stiff)
        if found is None:
            return _ended(x, at, prices, "no quadratic programme", k)
        step, slack, new_prices, new_equation_prices = found
        total = float(np.abs(new_prices).sum() + np.abs(new_equation_prices).sum())
        if at.broken > _KEPT and slack > max(_KEPT, 0.9 * at.broken):
            if weight < _HEAVY:
                weight *= 10.0
                continue
            if slack > _HOPELESS * at.broken and np.all(np.abs(step) < 0.5 * reach):
                return _ended(x, at, prices, INFEASIBLE, k)
        prices, equation_prices = new_prices, new_equation_prices
        if slack <= _KEPT:
            # No heavier than it must be: a stiff penalty creeps along rows that are curved.
            enough = _STIFF * max(total, _LEAST_PRICE)
            weight = (
                2.0 * enough if weight < enough else max(_LIGHTER * weight, min(weight, enough))
            )
        model = float(at.slope @ step + 0.5 * step @ hessian @ step)
        promised = weight * (at.broken - slack) - model
        if promised <= tolerance:
            if at.broken <= _KEPT * 10.0:
                return _ended(x, at, prices, "", k + 1)
            if weight >= _HEAVY or slack > _KEPT:
                return _ended(x, at, prices, INFEASIBLE, k)
        # A step that will be bent need not have slopes where it leads at first.
        look = glance if bends else evaluate
        short = guarded and bool(np.all(np.abs(step) <= _SHORT * size))
        near = short and at.broken <= _NEARLY_KEPT
        moved, new, share = _tried(
            evaluate, look, stable, x, step, weight, promised, at, hessian, box, stiff, near
        )
        bends = not np.array_equal(moved, x + step)
        length = float(np.max(np.abs(moved - x) / size))
        if new is not None:  # what a step that failed tells of the curvature is worth as much
            rest = _updated(rest, moved - x, at, new, prices, equation_prices)
        if new is None or share < _SOUND:
            room, stiff = _CLOSER * min(room, length), min(_SHARE, 10 * stiff)
            stalled += 1
            if room < _LEAST_ROOM or stalled > _STALLED:
                small = promised <= max(1e2 * tolerance, _NOTHING) and at.broken <= 1e2 * _KEPT
                done = "" if small else "no step helps"
                return _ended(x, at, prices, done, k + 1)
            continue
        stalled = 0
        if share > 0.75:
            stiff = max(_LEAST_SHARE, 0.1 * stiff)  # the model errs on the stiff side
            if np.any(np.abs(step) >= 0.99 * reach):
                room = min(_MOST_ROOM, 2.0 * room)
        elif share < 0.25:
            room = 0.5 * min(room, length)
        x, at = moved, new
        reached = [*reached, at.objective] if at.broken <= max(_KEPT, tolerance) else []
        if len(reached) > _CREEPS and reached[-_CREEPS - 1] - at.objective < max(_CREPT, tolerance):
            return _ended(x, at, prices, "", k + 1)
        if prices.size != at.rows.size:
            prices = np.zeros(at.rows.size)
    return _ended(x, at, prices, UNFINISHED, most)


def _sizes(x: FloatArray, at: Evaluation) -> FloatArray:
    """Return the size of each variable: its own, or, near zero, what moves something by one."""
    slopes = np.vstack([at.slope[None], at.jacobian, at.equation_slopes])
    steepest = np.abs(slopes).max(axis=0)
    return np.asarray(np.maximum(np.abs(x), _LEAST / np.maximum(steepest, 1.0)))


def _ended(
    x: FloatArray,
    at: Evaluation,
    prices: FloatArray,
    message: str,
    steps: int,
) -> Descent:
    return Descent(
        x=x,
        at=at,
        prices=prices,
        converged=not message,
        message=message or "solved",
        steps=steps,
    )


def _quadratic(
    at: Evaluation,
    rows: FloatArray,
    equations: FloatArray,
    hessian: FloatArray,
    box: tuple[FloatArray, FloatArray],
    weight: float,
    stiff: float,
) -> tuple[FloatArray, float, FloatArray, FloatArray] | None:
    """Return the step, its slack, and the multipliers of rows and equations."""
    n = at.slope.size
    reach = np.maximum(np.maximum(np.abs(box[0]), np.abs(box[1])), 1e-300)
    # A row that no step within the box can bring to zero stays out.
    near = np.flatnonzero(rows + np.abs(at.jacobian) @ reach > 0.0)
    e = equations.size
    slopes = np.vstack([at.slope[None], at.jacobian, at.equation_slopes])
    # Of what can change within the box, or what a small box changes would be lost in tolerances.
    unit = min(1.0, float((np.abs(slopes) @ reach).max()))
    H = np.zeros((n + 1, n + 1))
    # In shares of the reach, so that the sizes of the variables do not matter.
    model = at.curvature * np.outer(reach, reach)
    H[:n, :n] = _convex(hessian * np.outer(reach, reach), model, stiff) / unit
    H[n, n] = _SLACK
    f = np.append(at.slope * reach / unit, weight)
    A = np.zeros((near.size + 2 * e, n + 1))
    A[: near.size, :n] = at.jacobian[near] * reach
    A[near.size : near.size + e, :n] = at.equation_slopes * reach
    A[near.size + e :, :n] = -at.equation_slopes * reach
    A /= unit
    A[:, n] = -1.0
    # A firm row is broken by as much as it is now, whatever the others are.
    firm = np.flatnonzero(at.firm[near])
    A[firm, n] = -np.maximum(at.rows[near][firm], 0.0) / max(at.broken, 1e-300)
    upper = np.concatenate([-rows[near], -equations, equations]) / unit
    most = np.append(box[1] / reach, 1e6 / unit)
    least = np.append(box[0] / reach, 0.0)
    kinds = np.zeros(n + 1 + upper.size, dtype=np.intc)
    # The solver's tolerances are of curvatures of one.  Rows that nearly coincide can make its
    # active set go round in circles; proximal steps that hold back the slack most do not.
    ones = np.ones(n + 1)
    for own, proximal in ((np.sqrt(H.diagonal()), 0.0), (ones, 1e-6), (ones, 1e-3)):
        answer, _, flag, info = daqp.solve(
            H / np.outer(own, own),
            f / own,
            A / own,
            np.append(most * own, upper),
            np.append(least * own, np.full(upper.size, -1e30)),
            kinds,
            primal_tol=1e-10,
            eps_prox=proximal,
        )
        if flag >= 1:
            break
    else:
        return None
    lam = np.asarray(info["lam"], dtype=np.float64)[n + 1 :]
    prices = np.zeros(rows.size)
    prices[near] = lam[: near.size]
    equation_prices = lam[near.size : near.size + e] - lam[near.size + e :]
    answer = np.asarray(answer, dtype=np.float64) / own
    return answer[:n] * reach, unit * max(0.0, float(answer[n])), prices, equation_prices


def _tried(
    evaluate: Callable[[FloatArray], Evaluation],
    look: Callable[[FloatArray], Glance],
    stable: Callable[[FloatArray], bool],
    x: FloatArray,
    step: FloatArray,
    weight: float,
    promised: float,
    at: Evaluation,
    hessian: FloatArray,
    box: tuple[FloatArray, FloatArray],
    stiff: float,
    near: bool,
) -> tuple[FloatArray, Evaluation | None, float]:
    """Return where a step leads to, what is there, and the share of what it promised that it kept.

    There is nothing where the loop is unstable; what is `near` is stable if its rows say so.
    `look` is `evaluate`, or does without slopes.
    """
    merit = at.objective + weight * at.broken

    def found_at(there: FloatArray, how: Callable[[FloatArray], _Seen]) -> _Seen | None:
        seen = how(there) if near or stable(there) else None
        if seen is None or not seen.finite:
            return None
        return seen if not near or seen.broken <= _NEARLY_KEPT or stable(there) else None

    def kept(new: Glance) -> float:
        # A hair of slack: at the answer itself the merit only rounds.
        gained = merit - new.objective - weight * new.broken + 1e-12 * (1.0 + abs(merit))
        return gained / promised

    there = x + step
    new = found_at(there, look)
    if new is None:
        return there, None, -np.inf
    share = kept(new)
    if (
        share < (0.75 if at.broken < 1e-2 else 0.25)
        and new.rows.size == at.rows.size
        and weight * new.broken > 0.1 * promised
    ):
        # Rows curve: a second step takes up what the first one left broken.
        rows = new.rows - at.jacobian @ step
        equations = new.equations - at.equation_slopes @ step
        again = _quadratic(at, rows, equations, hessian, box, weight, stiff)
        bent = None if again is None else found_at(x + again[0], evaluate)
        if again is not None and bent is not None and kept(bent) > share:
            return x + again[0], bent, kept(bent)
    return there, new if isinstance(new, Evaluation) else evaluate(there), share


def _convex(curvature: FloatArray, model: FloatArray, share: float) -> FloatArray:
    """Return a positive definite matrix: where a curvature is negative a share of the model's.

    The shares are taken along the axes that make both matrices diagonal.
    """
    floor = max(_FLAT, _FLOOR * float(np.trace(model)) / len(model))
    metric = model + floor * np.eye(len(model))
    sizes, axes = eigh(0.5 * (curvature + curvature.T), metric)
    back = metric @ axes
    return np.asarray((back * np.maximum(sizes, share)) @ back.T, dtype=np.float64)


def _updated(
    rest: FloatArray,
    step: FloatArray,
    old: Evaluation,
    new: Evaluation,
    prices: FloatArray,
    equation_prices: FloatArray,
) -> FloatArray:
    """Return the rest of the Hessian after a step, by the symmetric rank-one formula."""
    if new.rows.size != old.rows.size:
        return rest
    change = new.lagrangian_slope(prices, equation_prices) - old.lagrangian_slope(
        prices, equation_prices
    )
    missing = change - (new.curvature + rest) @ step
    along = float(missing @ step)
    if abs(along) <= _SKIPPED * float(np.linalg.norm(missing) * np.linalg.norm(step)):
        return rest
    return np.asarray(rest + np.outer(missing, missing) / along)
