"""The hook's motion: spectra, numbers and time series from vessel and sea.

A sea's spectrum and a vessel's operators come in; the motion of the hook (`HookMotion`) goes out,
as spectra, moments, most probable maxima and random records, with what it asks of a winch.
"""

from typing import TYPE_CHECKING

from ..basics.lazy import lazy_face

if TYPE_CHECKING:
    from .encounter import Encounter
    from .hook import HookMotion, HookRecord
    from .hook_demand import HookDemand
    from .hook_survey import HookSurvey, hook_motion
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
