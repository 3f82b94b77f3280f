"""The physical world: sea, vessel, rope, payload, winch. Knows nothing of controller design.

Names are imported when they are first used: a case file can be checked without loading the
symbolic plant.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

_HOME = {
    "Case": "case.case",
    "DiscretePlant": "plant.discrete",
    "HeaveRao": "vessel.vessel",
    "HookMotion": "hook.hook",
    "HookRecord": "hook.hook",
    "InputError": "basics.checks",
    "LinearPlant": "plant.linear",
    "PhysicsWarning": "basics.physics_warning",
    "Plant": "plant.plant",
    "PlantData": "plant.plant_data",
    "PlantResponse": "plant.response",
    "SeaSpectrum": "sea.sea",
    "SolverError": "basics.checks",
    "StillhookError": "basics.checks",
    "SynthesisError": "basics.checks",
    "build_plant": "plant.plant",
    "bundled_cases": "case.case_file",
    "case_schema": "case.case_file",
    "fixed_top_modes": "plant.rope",
    "line_response": "plant.line",
    "load_case": "case.case_file",
    "parse_quantity": "basics.units",
    "template_text": "case.case_file",
    "write_text_atomically": "basics.files",
}

__all__ = [
    "Case",
    "DiscretePlant",
    "HeaveRao",
    "HookMotion",
    "HookRecord",
    "InputError",
    "LinearPlant",
    "PhysicsWarning",
    "Plant",
    "PlantData",
    "PlantResponse",
    "SeaSpectrum",
    "SolverError",
    "StillhookError",
    "SynthesisError",
    "build_plant",
    "bundled_cases",
    "case_schema",
    "fixed_top_modes",
    "line_response",
    "load_case",
    "parse_quantity",
    "template_text",
    "write_text_atomically",
]

if TYPE_CHECKING:
    from .basics.checks import InputError as InputError
    from .basics.checks import SolverError as SolverError
    from .basics.checks import StillhookError as StillhookError
    from .basics.checks import SynthesisError as SynthesisError
    from .basics.files import write_text_atomically as write_text_atomically
    from .basics.physics_warning import PhysicsWarning as PhysicsWarning
    from .basics.units import parse_quantity as parse_quantity
    from .case.case import Case as Case
    from .case.case_file import bundled_cases as bundled_cases
    from .case.case_file import case_schema as case_schema
    from .case.case_file import load_case as load_case
    from .case.case_file import template_text as template_text
    from .hook.hook import HookMotion as HookMotion
    from .hook.hook import HookRecord as HookRecord
    from .plant.discrete import DiscretePlant as DiscretePlant
    from .plant.line import line_response as line_response
    from .plant.linear import LinearPlant as LinearPlant
    from .plant.plant import Plant as Plant
    from .plant.plant import build_plant as build_plant
    from .plant.plant_data import PlantData as PlantData
    from .plant.response import PlantResponse as PlantResponse
    from .plant.rope import fixed_top_modes as fixed_top_modes
    from .sea.sea import SeaSpectrum as SeaSpectrum
    from .vessel.vessel import HeaveRao as HeaveRao


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'models' has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value
