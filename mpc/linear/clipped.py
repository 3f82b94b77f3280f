"""Predictive control that does not know its limits, for reference: `ClippedMPC`.

    filter, cost and horizon of `LinearMPC` --> answer without limits --> cut to the drive's window

What the filter does for the load, and what planning within the limits does, are two things: this
has the one and not the other.
"""

import numpy as np
from typing_extensions import Unpack, override

from models.case import Case

from ..programme import Question
from .linear import LinearMPC
from .winch_mpc import WinchOptions


class ClippedMPC(LinearMPC):
    """The law of `LinearMPC` without its limits, cut off at what the drive can give.

    The filter is told what the drive gave, so that it does not wind up.  Options are those of
    `LinearMPC`; limits that a plan alone could keep, on speed, tension and excursion, do nothing.
    """

    def __init__(self, case: Case, **options: Unpack[WinchOptions]) -> None:
        super().__init__(case, **({"name": "mpc-clipped"} | options))
        self._law = self.programme.law[0]

    @override
    def _solve(self, question: Question, began: float) -> float | None:
        """Return the first move of the answer without limits, within those of the drive."""
        del began
        gradient, lower, upper = question
        self.question = question
        move = float(self._law @ gradient)
        # What is not finite, of a forecast, falls back as a failed plan does.
        self._answered = bool(np.isfinite(move))
        return min(max(move, float(lower[0])), float(upper[0])) if self._answered else None
