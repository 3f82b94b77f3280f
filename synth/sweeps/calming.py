r"""From which linear drag on a loop is stable: where its last pole leaves the right half plane.

The characteristic function is affine in the drag, closed = c0 + C c1, so a pole is on the axis at
i omega for the C that makes it zero there, C = -c0/c1, wherever that is real and positive.  The
largest of them is the boundary: with more drag no pole is on the axis any more, and with drag
without end the payload stands still and the loop is open, which is stable.  All but a slow drift:
where closed(0) is not above zero, a real pole is in the right half plane whatever the drag.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from models.basics import FloatArray

from .chain import ChainLoops
from .winding_count import frequencies

Index = npt.NDArray[np.intp]

_STEP = 64
_ROUNDS = 50


def calming_drag(loops: ChainLoops) -> FloatArray:
    """Return the drag beyond which each loop is stable, (n,) [N s/m]; 0 if it needs none.

    Infinite where no drag makes it so.
    """
    found = np.zeros(len(loops))
    bare, unit = loops.with_drag(np.zeros(1)), loops.scale
    more = loops.with_drag(np.array([unit]))

    def parts(rows: Index, omega: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return Im(c0 conj c1), zero where C is real, and that C."""
        s = np.asarray(1j * omega, dtype=np.complex128)
        c0 = bare.responses(rows, s)[0]
        c1 = (more.responses(rows, s)[0] - c0) / unit
        both = c0 * c1.conj()
        with np.errstate(all="ignore"):
            size = c1.real**2 + c1.imag**2
            return np.asarray(both.imag), np.asarray(-both.real / size)

    for at in range(0, len(loops), _STEP):
        rows = np.arange(at, min(at + _STEP, len(loops)))
        omega = frequencies(bare, rows)
        turn, C = parts(rows, omega)
        change = (turn[:, :-1] > 0.0) != (turn[:, 1:] > 0.0)
        # Only what might beat the others: C hardly changes within an interval.
        change &= np.maximum(C[:, :-1], C[:, 1:]) > 0.0
        loop, k = np.nonzero(change)
        low, high = omega[loop, k], omega[loop, k + 1]
        left = turn[loop, k] > 0.0
        for _ in range(_ROUNDS):
            if not loop.size:
                break
            middle = 0.5 * (low + high)
            same = (parts(rows[loop], middle[:, None])[0][:, 0] > 0.0) == left
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        if loop.size:
            value = parts(rows[loop], high[:, None])[1][:, 0]
            np.maximum.at(found, rows[loop], np.where(np.isfinite(value), value, 0.0))
        drift = bare.responses(rows, np.zeros(1, dtype=np.complex128))[0][:, 0].real
        found[rows[drift <= 0.0]] = np.inf
    return found
