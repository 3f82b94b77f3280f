"""Operations in time: scenarios, what excites them, contact, payout, faults.

A name and its options, or a `Scenario` of one's own, say what the operator asks and what fails; a
`MotionSource` says what moves the hook. Out go a `Schedule` of rows and motions over time for the
simulation.
"""

from typing import TYPE_CHECKING

from ..basics.lazy import lazy_face

if TYPE_CHECKING:
    from .excitation import Motion as Motion
    from .excitation import MotionSource as MotionSource
    from .excitation import SineMotion as SineMotion
    from .excitation import SpectrumMotion as SpectrumMotion
    from .faults import FAULTS as FAULTS
    from .faults import PREFIX as PREFIX
    from .faults import fault_of as fault_of
    from .faults import with_faults as with_faults
    from .hermite import MotionBlock as MotionBlock
    from .options import Option as Option
    from .options import WordOption as WordOption
    from .record_file import RecordMotion as RecordMotion
    from .scenario import Scenario as Scenario
    from .scenarios import scenario_named as scenario_named
    from .scenarios import scenario_names as scenario_names
    from .scenarios import scenario_options as scenario_options
    from .schedule import Schedule as Schedule
    from .six_dof import SixDofMotion as SixDofMotion
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
