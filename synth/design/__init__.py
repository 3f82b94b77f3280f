"""The designs: what a case or a plant is answered with.

`tune` answers for any linear plant, `optimise_gains`, `evaluate_gains` and `optimise_structure`
for a case.  Out comes a design with its figures, the use and price of each limit, and the
verdict of `synth.verify`.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .design import GainDesign
    from .infeasible import shortfall
    from .optimise import evaluate_gains, optimise_gains
    from .structure_design import SOURCE_NAMES, StructureDesign
    from .structure_search import design_of, optimise_structure, verified
    from .tuning import LimitUse, Tuning, limit_uses, tune, tuning_of
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
