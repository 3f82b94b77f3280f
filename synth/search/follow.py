r"""Sequential quadratic programming from one answer of a programme to one close to it.

.. math::

    \min_d \tfrac12 d^T H d + \nabla f^T d \quad\text{s.t. } g + J d \le 0

Sequential quadratic programming with exact derivatives (Nocedal and Wright, Numerical
Optimization, 2nd ed., ch. 18), each quadratic programme by the dual active-set method of DAQP.
An interior-point method cannot make much of a good start; this one needs three or four steps,
since of some hundred rows it is always the same few that bind.  It only works near an answer:
where a step does not help it gives up, and the caller asks IPOPT.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from models.basics import FloatArray

_STEPS = 12  # quadratic programmes before it gives up
_HALVINGS = 4  # of a step that does not help
_REACH = 0.3  # how far, relatively, a step may move a variable
_LEAST = 1e-2  # share of the largest variable that each may move by all the same
_FLAT = 1e-8  # least curvature, relative to the largest
_ARRIVED = 1e-7  # relative length of a step that is no step
_KEPT = 1e-9  # row that counts as kept
_STIFF = 1.5  # weight of the rows in the merit, over the largest multiplier


class Follower:
    """The quadratic model of a programme, and steps by it.

    Parameters
    ----------
    statement
        The programme as `casadi.nlpsol` takes it, its objective without the guard.
    """

    def __init__(self, statement: dict[str, Any]) -> None:
        x, p, f, g = (statement[key] for key in ("x", "p", "f", "g"))
        lam = ca.MX.sym("lam", g.shape[0])
        lagrangian = f + ca.dot(lam, g)
        curvature, slope = ca.hessian(lagrangian, x)
        del slope
        first = [f, g, ca.gradient(f, x), ca.jacobian(g, x)]
        self._values = ca.Function("values", [x, p], [f, g])
        self._model = ca.Function("model", [x, p, lam], [*first, curvature])
        self._prices = ca.Function("prices", [x, p, lam], [ca.gradient(lagrangian, p)])
        shapes = {"h": ca.Sparsity.dense(x.shape[0], x.shape[0])}
        shapes["a"] = ca.Sparsity.dense(g.shape[0], x.shape[0])
        self._qp = ca.conic("step", "daqp", shapes, {"error_on_fail": False})

    def answer(
        self,
        start: FloatArray,
        bounds: FloatArray,
        lam: FloatArray,
        box: tuple[FloatArray, FloatArray],
        lowest: FloatArray,
        stable: Any,
    ) -> tuple[FloatArray, FloatArray, float, int] | None:
        """Return variables, multipliers of the rows, objective and steps; None if none is near.

        Parameters
        ----------
        start, bounds
            The programme's vector to begin with, and the bounds of its limits.
        lam
            Multipliers of the rows, of an answer near by.
        box
            Least and greatest values of the variables.
        lowest
            Lower bounds of the rows: minus infinity, or zero of an equality.
        stable
            Says of the programme's vector whether the loop is stable.
        """
        x = np.clip(start, *box)
        if not stable(x):
            return None
        for k in range(_STEPS):
            cost, g, slope, rows, curvature = (
                np.array(part, dtype=np.float64) for part in self._model(x, bounds, lam)
            )
            f, g, slope = float(cost.item()), g.ravel(), slope.ravel()
            if not (np.isfinite(f) and np.all(np.isfinite(rows))):
                return None
            # The model holds near x only; a variable near zero gets a share of the largest's room.
            room = _REACH * np.maximum(np.abs(x), _LEAST * np.abs(x).max())
            answer = self._qp(
                h=_convex(curvature),
                g=slope,
                a=rows,
                lba=lowest - g,
                uba=-g,
                lbx=np.maximum(box[0] - x, -room),
                ubx=np.minimum(box[1] - x, room),
            )
            if not self._qp.stats()["success"]:
                return None
            step = np.array(answer["x"], dtype=np.float64).ravel()
            lam = np.array(answer["lam_a"], dtype=np.float64).ravel()
            broken = _broken(g, lowest)
            small = np.abs(step).max() <= _ARRIVED * np.abs(x).max()
            if small and broken < _KEPT:
                return x, lam, f, k + 1
            # An exact penalty: with a weight above the largest multiplier the merit has its
            # minimum where the programme has.
            weight = _STIFF * float(np.abs(lam).max(initial=0.0))
            ahead = self._shorter(x, step, bounds, lowest, f + weight * broken, weight, stable)
            if ahead is None:
                return None
            x = ahead
        return None

    def prices(self, x: FloatArray, bounds: FloatArray, lam: FloatArray) -> FloatArray:
        """Return minus the slope of the optimum over the bounds, as IPOPT has it."""
        return -np.array(self._prices(x, bounds, lam), dtype=np.float64).ravel()

    def _shorter(
        self,
        x: FloatArray,
        step: FloatArray,
        bounds: FloatArray,
        lowest: FloatArray,
        merit: float,
        weight: float,
        stable: Any,
    ) -> FloatArray | None:
        """Return where a step, or a part of it, leads to; None if it makes nothing better."""
        share = 1.0
        for _ in range(_HALVINGS):
            ahead = np.asarray(x + share * step, dtype=np.float64)
            if stable(ahead):
                f, g = self._values(ahead, bounds)
                found = float(f) + weight * _broken(np.array(g, dtype=np.float64).ravel(), lowest)
                # A hair of slack: at the answer itself the merit only rounds.
                if found <= merit + 1e-10 * (1.0 + abs(merit)):
                    return ahead
            share *= 0.5
        return None


def _broken(rows: FloatArray, lowest: FloatArray) -> float:
    """Return by how much the rows are broken, all together."""
    over = np.maximum(rows, 0.0) + np.where(
        np.isfinite(lowest), np.maximum(lowest - rows, 0.0), 0.0
    )
    return float(over.sum())


def _convex(curvature: FloatArray) -> FloatArray:
    """Return a positive definite matrix: negative curvatures count as positive ones."""
    sizes, axes = np.linalg.eigh(0.5 * (curvature + curvature.T))
    sizes = np.maximum(np.abs(sizes), _FLAT * np.abs(sizes).max(initial=1.0))
    return np.asarray((axes * sizes) @ axes.T, dtype=np.float64)
