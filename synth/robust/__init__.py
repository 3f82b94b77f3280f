"""Robust design: one set of gains for a family of plants and seas, and how far it may be off.

A case and what varies come in (`Family`); gains for all of it (`optimise_robust`), gains over the
rope's length (`schedule_gains`), the nearest unstable values of what is uncertain (`robustness`)
and the exact radius of errors of the gains (`gain_radius`) go out.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .family import DiscreteValues, Family, SeaState, sea_states
    from .perturbation import GainRadius, gain_radius
    from .robust import RobustDesign, ScenarioResult, optimise_robust
    from .schedule import GainSchedule, schedule_gains
    from .worst_parameters import Robustness, robustness
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
