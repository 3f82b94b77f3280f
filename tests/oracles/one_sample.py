"""One sample of the nonlinear winch with its forces found by Newton's method, as a simulation."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from models.basics import SolverError
from mpc.nonlinear.stage import Stage

FloatArray = npt.NDArray[np.float64]

_NEWTON = 50  # iterations
_EXACT = 1e-12  # of the forces, over the static tension


def advanced(stage: Stage, x: FloatArray, d: float, ends: FloatArray, c: FloatArray) -> FloatArray:
    """State a sample later, of the state (n,), the input [N m], the hook's ends and the constants.

    The ends are z, z' of the hook at the start and at the end of the sample, (4,); constants (2,).
    """
    winch = stage.winch
    ahead = winch.A @ x + winch.B[:, 0] * d + winch.from_hook @ ends + winch.from_constants @ c
    if not stage.channels:
        return np.asarray(ahead)
    known = stage.C @ x + stage.D * d + stage.C_hook @ ends + stage.C_constants @ c
    known += stage.rest
    n = np.zeros(stage.own.shape[1])
    for _ in range(_NEWTON):
        found, J = stage.forces((known + stage.own @ n)[None])
        step = np.linalg.solve(np.eye(n.size) - J[0] @ stage.own, found[0] - n)
        n += step
        if np.abs(step).max() <= _EXACT * winch.rest_tension:
            return np.asarray(ahead + stage.from_forces @ n)
    raise SolverError("the forces of a sample were not found")
