"""Gain synthesis: structures, limits, the optimiser, and what checks it. Knows no MPC."""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from models.basics import SolverError as SolverError
    from models.basics import SynthesisError as SynthesisError
    from models.basics import White as White

    from .design import GainDesign as GainDesign
    from .design import LimitUse as LimitUse
    from .design import Tuning as Tuning
    from .design import evaluate_gains as evaluate_gains
    from .design import optimise_gains as optimise_gains
    from .design import tune as tune
    from .limits import Continuous as Continuous
    from .limits import DelayMargin as DelayMargin
    from .limits import GainMargin as GainMargin
    from .limits import GainMarginDown as GainMarginDown
    from .limits import Limit as Limit
    from .limits import LowFrequency as LowFrequency
    from .limits import MaxSensitivity as MaxSensitivity
    from .limits import Minimum as Minimum
    from .limits import Peak as Peak
    from .limits import Power as Power
    from .limits import Rms as Rms
    from .limits import RollOff as RollOff
    from .loop import Assessment as Assessment
    from .loop import DragElement as DragElement
    from .loop import LinearController as LinearController
    from .loop import Margins as Margins
    from .loop import closed_loop_poles as closed_loop_poles
    from .structures import LowOrder as LowOrder
    from .structures import PayloadFeedback as PayloadFeedback
    from .structures import StaticGain as StaticGain
    from .structures import Structure as Structure
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
