"""Gain synthesis: structures, limits, the optimiser, and what checks it. Knows no MPC."""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from models.basics import SolverError, SynthesisError, White

    from .design import Design, LimitUse, Tuning, evaluate_gains, optimise_gains, tune
    from .limits import (
        Continuous,
        DelayMargin,
        DiskMargin,
        GainMargin,
        GainMarginDown,
        HighestFrequency,
        LeastDamping,
        LeastDecay,
        Limit,
        LowFrequency,
        MaxSensitivity,
        Minimum,
        Peak,
        Power,
        Rms,
        RollOff,
        WeightedResponse,
    )
    from .loop import Assessment, DragElement, LinearController, Margins, closed_loop_poles
    from .structures import LowOrder, PayloadFeedback, StaticGain, Structure
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
