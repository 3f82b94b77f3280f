"""The search for the parameters of a structure.

In comes a `Problem`, out comes `Found`: the best of many descents by sequential quadratic
programming, polished until no limit is broken between the nodes, and every start's record.
Nothing in it is verified yet.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .multistart import Found, Progress, Start, least_violation, search, with_bests
    from .nodes import cost_nodes, glanced, margin_nodes
    from .polishing import KEPT, assess, polish, settle, stated
    from .programme import GainProgramme, Solution
    from .starts import begin_points, briskest, hardest, start_coefficients
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
