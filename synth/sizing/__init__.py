"""Sizing of a winch: motors, gears and drums together with the gains, and what they are worth.

A case and a target come in; the smallest motor (`size_winch`), the best gear and drum
(`co_design`), the worth of each limit and sensor (`worth`) or a front of the payload's motion
against another quantity (`pareto_front`) go out, every design verified.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .codesign import CoDesign, co_design
    from .follow import Answer
    from .pareto import ParetoFront, best_of_each, pareto_front
    from .purchase import Worth, WorthRow, worth
    from .sizing import Sizing, size_winch
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
