"""The controller structures: from a few named parameters to C(s).

A structure bound to a plant is a `ParametrisedController`: its parameters with sizes and bounds,
its response, its state space, and candidates for a search.  Here too is what samples a
controller and makes a recursion of it, which `synth.controllers` builds on.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .blocks import series
    from .broken_loop import BrokenLoop, margins_of, sampled_margins
    from .drum_speed import DrumSpeedLoop, SteadyMotion
    from .fixed import Fixed
    from .low_order import LowOrder, LowOrderFeedback, LowOrderLaw
    from .lqg import LqgEstimator, LqgRegulator, estimator, reduced, regulator, shaped, weighing
    from .recursive import (
        RecursiveController,
        Signals,
        Stepper,
        at_rest,
        checked_sample_time,
        make_recursion,
        signals_of,
    )
    from .sampling import Matrices, SampledLoop, sampled, sampled_loop, tracking_gain
    from .structure import (
        Parameter,
        ParametrisedController,
        PayloadFeedback,
        StaticGain,
        Structure,
        pace,
    )
    from .winch_diagram import TRANSPARENT, WinchLaw, WinchStructure
    from .winch_structures import (
        structure_aboard,
        structure_named,
        structure_names,
        structures_aboard,
    )
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
