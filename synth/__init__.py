"""Gain synthesis: structures, limits, the optimiser, and what checks it. Knows no MPC."""

from models.basics.checks import SolverError as SolverError
from models.basics.checks import SynthesisError as SynthesisError

from .design.design import GainDesign as GainDesign
from .design.optimise import evaluate_gains as evaluate_gains
from .design.optimise import optimise_gains as optimise_gains
from .design.tuning import LimitUse as LimitUse
from .design.tuning import Tuning as Tuning
from .design.tuning import tune as tune
from .limits.limits import Limit as Limit
from .limits.margin_limits import DelayMargin as DelayMargin
from .limits.margin_limits import GainMargin as GainMargin
from .limits.margin_limits import GainMarginDown as GainMarginDown
from .limits.margin_limits import LowFrequency as LowFrequency
from .limits.margin_limits import MaxSensitivity as MaxSensitivity
from .limits.margin_limits import RollOff as RollOff
from .limits.signal_limits import Continuous as Continuous
from .limits.signal_limits import Least as Least
from .limits.signal_limits import Peak as Peak
from .limits.signal_limits import Power as Power
from .limits.signal_limits import Rms as Rms
from .loop.assess import Assessment as Assessment
from .loop.controller import Controller as Controller
from .loop.controller import closed_loop_poles as closed_loop_poles
from .loop.disturbance import White as White
from .loop.element import DragElement as DragElement
from .loop.margins import Margins as Margins
from .structures.low_order import LowOrder as LowOrder
from .structures.structure import PayloadFeedback as PayloadFeedback
from .structures.structure import StaticGain as StaticGain
from .structures.structure import Structure as Structure
