"""Operations in time: scenarios, what excites them, contact, payout, faults.

A name and its options, or a `Scenario` of one's own, say what the operator asks and what fails; a
`MotionSource` says what moves the hook. Out go a `Schedule` of rows and motions over time for the
simulation.
"""

from typing import TYPE_CHECKING

from ..basics.lazy import lazy_face

if TYPE_CHECKING:
    from .excitation import Motion, MotionSource, SineMotion, SpectrumMotion
    from .faults import FAULTS, PREFIX, fault_of, with_faults
    from .hermite import MotionBlock
    from .options import Option, WordOption
    from .profile import Move, Profile
    from .record_file import RecordMotion
    from .scenario import Scenario
    from .scenarios import scenario_named, scenario_names, scenario_options
    from .schedule import Schedule
    from .six_dof import tip_heave
    from .touch_down import TouchDown
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
