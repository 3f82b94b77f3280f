"""Gain synthesis: structures, limits, the optimiser, and what checks it. Knows no MPC."""

from models.checks import SolverError as SolverError
from models.checks import SynthesisError as SynthesisError

from .assess import Assessment as Assessment
from .controller import Controller as Controller
from .controller import closed_loop_poles as closed_loop_poles
from .design import GainDesign as GainDesign
from .disturbance import White as White
from .element import DragElement as DragElement
from .limits import Limit as Limit
from .low_order import LowOrder as LowOrder
from .margin_limits import DelayMargin as DelayMargin
from .margin_limits import GainMargin as GainMargin
from .margin_limits import GainMarginDown as GainMarginDown
from .margin_limits import LowFrequency as LowFrequency
from .margin_limits import MaxSensitivity as MaxSensitivity
from .margin_limits import RollOff as RollOff
from .margins import Margins as Margins
from .optimise import evaluate_gains as evaluate_gains
from .optimise import optimise_gains as optimise_gains
from .signal_limits import Continuous as Continuous
from .signal_limits import Least as Least
from .signal_limits import Peak as Peak
from .signal_limits import Power as Power
from .signal_limits import Rms as Rms
from .structure import PayloadFeedback as PayloadFeedback
from .structure import StaticGain as StaticGain
from .structure import Structure as Structure
from .tune import LimitUse as LimitUse
from .tune import Tuning as Tuning
from .tune import tune as tune
