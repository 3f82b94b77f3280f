"""What the programme knows, as tables for the C; its Hessian is factorised once."""

from __future__ import annotations

import numpy as np

from models.basics import FloatArray

from ..linear import LinearMPC, winch_mpc
from ..programme import SoftQP
from .tables import Tables

_WIDE = 1e20  # no limit


def add_programme(tables: Tables, controller: LinearMPC) -> None:
    """Add the products of a step, the limits, and the programme as a least distance."""
    p, of = controller.programme, controller.products
    winch, qp = controller.model.winch, controller.qp
    moves, rows, links = len(p.blocks), len(p.kind), len(qp.hard)
    tables.size("NB", moves)
    tables.size("NR", rows)
    tables.size("NL", links)
    tables.size("NM", moves + links + rows)
    # As many may be active: the moves, the rows whose slacks are free, and one.
    tables.size("NA", moves + rows + 1)
    lowest = controller.soft_limits.get("speed", (0.0, 0.0))[0]
    for name, value in {
        "HOLD": controller._share,
        "AT_MOST": controller._at_most,
        "LOWEST_SPEED": lowest,
        "BRAKES": winch_mpc._BRAKES,
        "CLEAR": winch_mpc._CLEAR,
        "PRICE": float(np.max(qp.linear)),
        "CURVATURE": float(np.max(qp.quadratic)),
    }.items():
        tables.constant(name, value)
    tables.size("STALE", controller._stale)
    speed = p.kind == p.signals.names.index("speed")
    unlimited = controller._unlimited
    for name, values in {
        "products": of.matrix,
        "shifted": np.vstack([of.moved_gradient, of.moved_free]),
        "speed_known": of.speed_known,
        "speed_moves": of.speed_moves,
        "lengths": controller._lengths,
        "motor_speed": winch.speed,
        "unlimited": unlimited,
        "unlimited_moved": unlimited[: winch.size] @ winch.moved,
        "row_low": p.row_low,
        "row_high": p.row_high,
        "speed_scale": np.where(speed, p.scale, 0.0),
        "rate_steps": controller._rates[1],
    }.items():
        tables.array(name, values)
    tables.whole("block_of", controller._of)
    tables.array("qp_H", qp.H)
    tables.array("qp_given", np.vstack([qp.hard, qp.rows]))
    inverse = inverse_by_solver(p.solver(qp.rows))
    root, scaled, scaling = least_distance(inverse, np.vstack([qp.hard, qp.rows]))
    tables.array("qp_root", root[np.triu_indices(moves)])
    tables.array("qp_rows", scaled)
    tables.array("qp_scaling", scaling)


def inverse_by_solver(qp: SoftQP) -> FloatArray:
    """Return H^-1 as the Python's solver has found it, (n, n).

    The Hessian's condition is some 1e8, and what the solver rounds in its factors shows in a move
    ten times as much as all other rounding.  So the C begins with the same factors.
    """
    n, bound = len(qp.H), np.full(len(qp.H) + len(qp.hard) + len(qp.rows), _WIDE)
    found = np.array([-qp.solve(unit, -bound, bound).v for unit in np.eye(n)])
    return np.asarray(0.5 * (found + found.T))


def least_distance(
    inverse: FloatArray, rows: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a programme's rows as those of a least distance, each of norm one, as DAQP has them.

    With H^-1 = U U', U an upper triangle: the rows of the moves themselves, U, (n, n); those of
    other rows, (m, n); and what each is multiplied with, (n + m,).
    """
    root = np.linalg.cholesky(inverse[::-1, ::-1])[::-1, ::-1]
    others = rows @ root
    scaling = 1.0 / np.linalg.norm(np.vstack([root, others]), axis=1)
    n = len(root)
    return root * scaling[:n, None], others * scaling[n:, None], np.asarray(scaling)
