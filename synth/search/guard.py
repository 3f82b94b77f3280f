"""The guard of a programme: what keeps IPOPT's line search among stable loops.

`synth.search.programme` says why a guard and not inequalities on the characteristic polynomial.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np
from typing_extensions import override

from models.basics import FloatArray

_PATIENCE = 60  # rejected trial points before a solve is given up


class Guard(ca.Callback):
    """Zero where the loop is stable, not a number elsewhere; its derivative is zero.

    Parameters
    ----------
    stable
        Says of the programme's vector, (size,), whether the loop (or every loop) is stable.
    size
        Length of that vector.
    """

    def __init__(self, stable: Callable[[FloatArray], bool], size: int) -> None:
        ca.Callback.__init__(self)
        self._stable = stable
        self._size = size
        self._jacobian: ca.Function | None = None
        self.rejected = 0
        self.construct("guard", {})

    @override
    def get_n_in(self) -> int:
        return 1

    @override
    def get_n_out(self) -> int:
        return 1

    @override
    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        del i
        return ca.Sparsity.dense(self._size, 1)

    @override
    def eval(self, arg: Sequence[Any]) -> list[float]:
        if self.rejected > _PATIENCE:
            return [np.nan]  # ends the solve: its line search finds nothing stable any more
        x = np.array(arg[0], dtype=np.float64).ravel()
        if not np.all(np.isfinite(x)):
            return [np.nan]
        stable = self._stable(x)
        self.rejected += not stable
        return [0.0 if stable else np.nan]

    @override
    def has_jacobian(self) -> bool:
        return True

    @override
    def get_jacobian(
        self, name: str, inames: Sequence[str], onames: Sequence[str], opts: Mapping[str, Any]
    ) -> ca.Function:
        x, out = ca.MX.sym("x", self._size), ca.MX.sym("out", 1)
        zero = ca.MX(ca.Sparsity(1, self._size))
        self._jacobian = ca.Function(name, [x, out], [zero], inames, onames, opts)
        return self._jacobian


def solver_options(tolerance: float, max_iterations: int) -> dict[str, Any]:
    """Return the options of IPOPT that every programme here shares."""
    return {
        "print_time": False,
        "show_eval_warnings": False,
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        "ipopt.tol": tolerance,
        "ipopt.acceptable_tol": 10.0 * tolerance,
        "ipopt.max_iter": max_iterations,
    }
