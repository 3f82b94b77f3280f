"""One sample of the nonlinear winch with its forces found by Newton's method, as a simulation."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy.linalg

from models.basics import SolverError
from mpc.nonlinear.stage import Stage

FloatArray = npt.NDArray[np.float64]

_NEWTON = 50  # iterations
_EXACT = 1e-12  # of the forces, over the static tension


def advanced(stage: Stage, x: FloatArray, d: float, ends: FloatArray, c: FloatArray) -> FloatArray:
    """State a sample later, of the state (n,), the input [N m], the hook's ends and the constants.

    The ends are z, z' of the hook at the start and at the end of the sample, (4,); constants (2,).
    """
    M, winch = stage.substeps, stage.winch
    ahead = winch.A @ x + winch.B[:, 0] * d + winch.from_hook @ ends + winch.from_constants @ c
    if not stage.channels:
        return np.asarray(ahead)
    known = stage.C @ x + stage.D * d + stage.C_hook @ ends + stage.C_constants @ c
    known += np.tile(stage.rest, M)
    n = np.zeros(stage.own.shape[1])
    for _ in range(_NEWTON):
        found, J = stage.forces((known + stage.own @ n).reshape(M, -1))
        slope = scipy.linalg.block_diag(*J)
        step = np.linalg.solve(np.eye(n.size) - slope @ stage.own, found.ravel() - n)
        n += step
        if np.abs(step).max() <= _EXACT * winch.rest_tension:
            return np.asarray(ahead + stage.from_forces @ n)
    raise SolverError("the forces of a sample were not found")
