"""The question that a synthesis answers: a case prepared for the search.

In come a case and a structure; out comes a `Problem`: plant responses, spectra of the hook and
the noises, weights and limits, in numbers and as the symbols of a programme.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from ..limits import HOOK, PAYLOAD
    from .family_problem import FamilyLoop, FamilyProblem, Objective
    from .family_question import (
        PAYLOAD_FEEDBACK,
        FamilyQuestion,
        PosedFamily,
        difference_text,
        least_damping_text,
        pose_family,
    )
    from .held import (
        HeldMotion,
        held_modes,
        held_motion,
        held_poles,
        held_responses,
        held_transfers,
        locked_response,
        uncompensated,
    )
    from .loop_numbers import LoopNumbers, Point, moment_weights, on_sides
    from .problem import Goal, Problem, Values
    from .question import (
        GAINS,
        DesignQuestion,
        SampledNoise,
        controller_for,
        equivalent_elements,
        heard_spectra,
        loaded_plant,
        pose,
        with_masses,
    )
    from .rope_masses import masses_for, on_common_masses, on_enough_masses
    from .system import (
        AxialMode,
        HeldFacts,
        RopeFacts,
        SystemFacts,
        WaveBand,
        WinchFacts,
        system_facts,
    )
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
