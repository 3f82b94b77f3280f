"""The question that a synthesis answers: a case prepared for the search.

In come a case and a structure; out comes a `Problem`: plant responses, spectra of the hook and
the noises, weights and limits, in numbers and as the symbols of a programme.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from ..limits import HOOK as HOOK
    from ..limits import PAYLOAD as PAYLOAD
    from .family_problem import FamilyLoop as FamilyLoop
    from .family_problem import FamilyProblem as FamilyProblem
    from .family_problem import Objective as Objective
    from .problem import Goal as Goal
    from .problem import Problem as Problem
    from .problem import Values as Values
    from .question import DesignQuestion as DesignQuestion
    from .question import assess_gains as assess_gains
    from .question import locked_response as locked_response
    from .question import pose as pose
    from .question import uncompensated as uncompensated
    from .question import with_masses as with_masses
    from .structure_question import SampledNoise as SampledNoise
    from .structure_question import StructureQuestion as StructureQuestion
    from .structure_question import pose_structure as pose_structure
    from .symbols import LoopSymbols as LoopSymbols
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
