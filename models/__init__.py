"""The physical world: sea, vessel, rope, payload, winch. Knows nothing of controller design.

Names are imported when they are first used: a case file can be checked without loading the
symbolic plant.
"""

from typing import TYPE_CHECKING

from .basics.lazy import lazy_face

if TYPE_CHECKING:
    from .basics import InputError as InputError
    from .basics import PhysicsWarning as PhysicsWarning
    from .basics import SolverError as SolverError
    from .basics import StillhookError as StillhookError
    from .basics import SynthesisError as SynthesisError
    from .basics import parse_quantity as parse_quantity
    from .basics import write_text_atomically as write_text_atomically
    from .case import Case as Case
    from .case import bundled_cases as bundled_cases
    from .case import case_schema as case_schema
    from .case import load_case as load_case
    from .case import template_text as template_text
    from .hook import HookMotion as HookMotion
    from .hook import HookRecord as HookRecord
    from .plant import DiscretePlant as DiscretePlant
    from .plant import LinearPlant as LinearPlant
    from .plant import Plant as Plant
    from .plant import PlantData as PlantData
    from .plant import PlantResponse as PlantResponse
    from .plant import build_plant as build_plant
    from .plant import fixed_top_modes as fixed_top_modes
    from .plant import line_response as line_response
    from .sea import SeaSpectrum as SeaSpectrum
    from .vessel import HeaveRao as HeaveRao
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
