"""The second look at a design, by code that the search did not use.

In come a tuning or a design (`synth.verify.claims` says what of it), its case and its plant; out
comes a `Verification`: each claim with the figure found by other formulas, SciPy's quadrature and
SciPy's Lyapunov equation.  It imports only `models`.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .integrals import panels
    from .recheck import winding_of_plant
    from .recompute import LawMatrices, Loop, Source, closed_matrices, lyapunov_variances, moments
    from .tuning_check import verify_tuning
    from .verification import Check, Verification, agreement, bounded
    from .verify import verify_design
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
