"""Operability: in which seas a winch can work, which limit binds, and how much of the year that is.

A design or a case, periods, headings and perhaps a scatter diagram come in; an `Operability` goes
out, with the limiting H_s of every limit as contours and the workable share of the year.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .contour import Contour as Contour
    from .criteria import Criterion as Criterion
    from .depths import AtDepth as AtDepth
    from .recheck import ContourCheck as ContourCheck
    from .result import Operability as Operability
    from .study import operability as operability
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
