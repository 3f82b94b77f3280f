"""Operability: in which seas a winch can work, which limit binds, and how much of the year that is.

    design, seas -> limiting H_s for every limit -> contours -> against a scatter diagram

`study.operability` is the door (`sh.operability`).  `systems` are the loops whose motion is looked
at, `responses` their responses with the drag as a variable, `columns` the seas of one period,
`limiting` the search for the limiting H_s, `contour` the answer over period and heading.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .contour import Contour as Contour
    from .criteria import Criterion as Criterion
    from .recheck import ContourCheck as ContourCheck
    from .result import AtDepth as AtDepth
    from .result import Operability as Operability
    from .study import operability as operability
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
