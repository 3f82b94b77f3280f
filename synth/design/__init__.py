"""The designs: what a case or a plant is answered with.

`tune` answers for any linear plant, `optimise_gains`, `evaluate_gains` and `optimise_structure`
for a case.  Out comes a design with its figures, the use and price of each limit, and the
verdict of `synth.verify`.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .design import GainDesign as GainDesign
    from .infeasible import shortfall as shortfall
    from .optimise import evaluate_gains as evaluate_gains
    from .optimise import optimise_gains as optimise_gains
    from .structure_design import SOURCE_NAMES as SOURCE_NAMES
    from .structure_design import StructureDesign as StructureDesign
    from .structure_search import design_of as design_of
    from .structure_search import optimise_structure as optimise_structure
    from .structure_search import verified as verified
    from .tuning import LimitUse as LimitUse
    from .tuning import Tuning as Tuning
    from .tuning import limit_uses as limit_uses
    from .tuning import tune as tune
    from .tuning import tuning_of as tuning_of
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
