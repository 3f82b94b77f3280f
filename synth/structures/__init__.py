"""The controller structures: from a few named parameters to C(s).

A structure bound to a plant is a `ParametrisedController`: its parameters with sizes and bounds,
its response, its state space, and candidates for a search.  Here too is what samples a
controller and makes a recursion of it, which `synth.controllers` builds on.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .drum_speed import DrumSpeedLoop as DrumSpeedLoop
    from .drum_speed import SteadyMotion as SteadyMotion
    from .low_order import LowOrder as LowOrder
    from .low_order import LowOrderFeedback as LowOrderFeedback
    from .lqg import LqgEstimator as LqgEstimator
    from .lqg import LqgRegulator as LqgRegulator
    from .lqg import reduced as reduced
    from .lqg import weighing as weighing
    from .recursive import RecursiveController as RecursiveController
    from .recursive import Signals as Signals
    from .recursive import checked_sample_time as checked_sample_time
    from .recursive import make_recursion as make_recursion
    from .sampled_controller import Matrices as Matrices
    from .sampled_controller import low_pass_matrices as low_pass_matrices
    from .sampled_controller import sampled as sampled
    from .sampled_controller import tracking_gain as tracking_gain
    from .sampling import SampledLoop as SampledLoop
    from .sampling import sampled_loop as sampled_loop
    from .structure import Parameter as Parameter
    from .structure import ParametrisedController as ParametrisedController
    from .structure import PayloadFeedback as PayloadFeedback
    from .structure import StaticGain as StaticGain
    from .structure import Structure as Structure
    from .structure import pace as pace
    from .winch_diagram import TRANSPARENT as TRANSPARENT
    from .winch_diagram import WinchLaw as WinchLaw
    from .winch_diagram import WinchStructure as WinchStructure
    from .winch_structures import structure_named as structure_named
    from .winch_structures import structure_names as structure_names
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
