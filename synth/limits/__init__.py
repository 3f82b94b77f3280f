"""The limits of a design, on its loop and on its signals.

A limit says the same thing twice: as rows of a nonlinear programme and as a figure of an assessed
loop.  `loop_limits` and `drive_limits` read those that a case states.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .case_limits import (
        HOOK,
        LOWER_TENSION,
        PAYLOAD,
        drive_limits,
        loop_limits,
        modelled_bandwidth,
    )
    from .frequency_limits import (
        DiskMargin,
        LowFrequency,
        MaxSensitivity,
        RollOff,
        WeightedResponse,
    )
    from .limits import Limit, Size, Symbols
    from .margin_limits import DelayMargin, GainMargin, GainMarginDown
    from .pole_limits import HighestFrequency, LeastDamping, LeastDecay
    from .signal_limits import (
        Amplification,
        Breakdown,
        Continuous,
        Minimum,
        Peak,
        Peaks,
        Power,
        Rms,
        Thermal,
    )
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
