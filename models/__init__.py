"""The physical world: sea, vessel, rope, payload, winch. Knows nothing of controller design.

Names are imported when they are first used: a case file can be checked without loading the
symbolic plant.
"""

from typing import TYPE_CHECKING

from .basics.lazy import lazy_face

if TYPE_CHECKING:
    from .basics import (
        InputError,
        PhysicsWarning,
        SolverError,
        StillhookError,
        SynthesisError,
        parse_quantity,
        write_text_atomically,
    )
    from .case import Case, bundled_cases, case_schema, load_case, template_text
    from .hook import HookMotion, HookRecord
    from .plant import (
        LinearPlant,
        Plant,
        PlantData,
        PlantResponse,
        build_plant,
        fixed_top_modes,
        line_response,
    )
    from .sea import SeaSpectrum
    from .vessel import HeaveRao
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
