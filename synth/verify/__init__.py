"""The second look at a design, by code that the search did not use.

In come a tuning or a design (`synth.verify.claims` says what of it), its case and its plant; out
comes a `Verification`: each claim with the figure found by other formulas, SciPy's quadrature and
SciPy's Lyapunov equation.  It imports only `models`.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .integrals import panels as panels
    from .recheck import winding_of_plant as winding_of_plant
    from .recompute import LawMatrices as LawMatrices
    from .recompute import Loop as Loop
    from .recompute import Source as Source
    from .recompute import closed_matrices as closed_matrices
    from .recompute import lyapunov_variances as lyapunov_variances
    from .recompute import moments as moments
    from .tuning_check import verify_tuning as verify_tuning
    from .verification import Check as Check
    from .verification import Verification as Verification
    from .verification import agreement as agreement
    from .verification import bounded as bounded
    from .verify import verify_design as verify_design
    from .verify import verify_structure as verify_structure
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
