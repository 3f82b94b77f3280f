"""The search for the parameters of a structure.

In comes a `Problem`, out comes `Found`: the best of many starts by IPOPT, polished until no limit
is broken between the nodes, and every start's record.  Nothing in it is verified yet.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .family_search import FamilyFound as FamilyFound
    from .family_search import search_family as search_family
    from .multistart import Found as Found
    from .multistart import Progress as Progress
    from .multistart import Start as Start
    from .multistart import least_violation as least_violation
    from .multistart import resume as resume
    from .multistart import search as search
    from .nodes import cost_nodes as cost_nodes
    from .nodes import margin_nodes as margin_nodes
    from .polishing import KEPT as KEPT
    from .polishing import assess as assess
    from .polishing import assessment_of as assessment_of
    from .polishing import polish as polish
    from .polishing import thinned as thinned
    from .programme import Programme as Programme
    from .programme import Solution as Solution
    from .programme import SolverPace as SolverPace
    from .starts import begin_points as begin_points
    from .starts import briskest as briskest
    from .starts import coarse_programme as coarse_programme
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
