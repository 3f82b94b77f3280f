"""The limits of a design, on its loop and on its signals.

A limit says the same thing twice: as rows of a nonlinear programme and as a figure of an assessed
loop.  `loop_limits` and `drive_limits` read those that a case states.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .case_limits import HOOK as HOOK
    from .case_limits import PAYLOAD as PAYLOAD
    from .case_limits import drive_limits as drive_limits
    from .case_limits import loop_limits as loop_limits
    from .case_limits import modelled_bandwidth as modelled_bandwidth
    from .limits import Limit as Limit
    from .limits import Symbols as Symbols
    from .margin_limits import DelayMargin as DelayMargin
    from .margin_limits import GainMargin as GainMargin
    from .margin_limits import GainMarginDown as GainMarginDown
    from .margin_limits import LowFrequency as LowFrequency
    from .margin_limits import MaxSensitivity as MaxSensitivity
    from .margin_limits import RollOff as RollOff
    from .signal_limits import Continuous as Continuous
    from .signal_limits import Minimum as Minimum
    from .signal_limits import Peak as Peak
    from .signal_limits import Power as Power
    from .signal_limits import Rms as Rms
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
