"""Operability: in which seas a winch can work, which limit binds, and how much of the year that is.

A design or a case, periods, headings and perhaps a scatter diagram come in; an `Operability` goes
out, with the limiting H_s of every limit as contours and the workable share of the year; with a
series of seas, `WeatherWindows`.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .alpha import Alpha, alpha_factor
    from .contour import Contour
    from .criteria import payload_criteria
    from .depths import AtDepth
    from .recheck import ContourCheck
    from .record_limits import VesselHeading
    from .result import Operability
    from .study import example_series, operability
    from .windows import (
        HOUR,
        LEAST_WINDOWS,
        RecordCheck,
        Spell,
        SystemWindows,
        WeatherWindows,
        recheck_records,
        weather_windows,
        window_times,
    )
    from .workable import rule_shares
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
