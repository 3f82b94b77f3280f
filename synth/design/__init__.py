"""The designs: what a case or a plant is answered with.

`tune` answers for any linear plant, `optimise_gains` and `evaluate_gains` for a case.  Out comes a
design with its figures, the use and price of each limit, and the verdict of `synth.verify`.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .design import SOURCE_NAMES, SWITCHING_LOSS, Design
    from .infeasible import shortfall
    from .loads import RARE, EndLoads, Loads, RopeLoads, design_loads
    from .nested import gains_in_use
    from .optimise import design_of, evaluate_gains, optimise_gains, verified
    from .tuning import LimitUse, Tuning, few_starts, limit_uses, tune, tuning_of
    from .view import Look, View, prepare
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
