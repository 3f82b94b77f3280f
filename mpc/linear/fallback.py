"""What to do when there is no plan: the last one, a sample further on; then hold the drum.

A programme may fail, be late, or have nothing finite to start from.  The drive then gets the move
that the last good plan had for this moment, and when that plan has run out, the command that holds
a load at rest: a DC drive brakes by its back-EMF, a speed regulator holds the drum.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from models.basics import FloatArray


class Fallback:
    """The last plan and how old it is.

    Parameters
    ----------
    blocks
        Length of each move in samples.
    """

    def __init__(self, blocks: Sequence[int]) -> None:
        self._of = np.repeat(np.arange(len(blocks)), blocks)
        self.reset()

    def reset(self) -> None:
        """Forget the plan."""
        self._plan: FloatArray | None = None
        self._age = 0

    def keep(self, moves: FloatArray) -> None:
        """Keep a good plan, which begins now."""
        self._plan, self._age = moves, 0

    def shifted(self) -> float | None:
        """Return the move of the last plan for the sample after the last asked; None without."""
        self._age += 1
        if self._plan is None or self._age >= len(self._of):
            return None
        return float(self._plan[self._of[self._age]])
