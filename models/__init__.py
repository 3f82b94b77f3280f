"""The physical world: sea, vessel, rope, payload, winch. Knows nothing of controller design.

Names are imported when they are first used: a case file can be checked without loading the
symbolic plant.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

_HOME = {
    "Case": "case",
    "DiscretePlant": "discrete",
    "HeaveRao": "vessel",
    "HookMotion": "hook",
    "HookRecord": "hook",
    "InputError": "checks",
    "LinearPlant": "linear",
    "PhysicsWarning": "physics_warning",
    "Plant": "plant",
    "PlantData": "plant_data",
    "PlantResponse": "response",
    "SeaSpectrum": "sea",
    "SolverError": "checks",
    "StillhookError": "checks",
    "SynthesisError": "checks",
    "build_plant": "plant",
    "bundled_cases": "case_file",
    "case_schema": "case_file",
    "fixed_top_modes": "rope",
    "line_response": "line",
    "load_case": "case_file",
    "parse_quantity": "units",
    "template_text": "case_file",
    "write_text_atomically": "files",
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
    from .case import Case as Case
    from .case_file import bundled_cases as bundled_cases
    from .case_file import case_schema as case_schema
    from .case_file import load_case as load_case
    from .case_file import template_text as template_text
    from .checks import InputError as InputError
    from .checks import SolverError as SolverError
    from .checks import StillhookError as StillhookError
    from .checks import SynthesisError as SynthesisError
    from .discrete import DiscretePlant as DiscretePlant
    from .files import write_text_atomically as write_text_atomically
    from .hook import HookMotion as HookMotion
    from .hook import HookRecord as HookRecord
    from .line import line_response as line_response
    from .linear import LinearPlant as LinearPlant
    from .physics_warning import PhysicsWarning as PhysicsWarning
    from .plant import Plant as Plant
    from .plant import build_plant as build_plant
    from .plant_data import PlantData as PlantData
    from .response import PlantResponse as PlantResponse
    from .rope import fixed_top_modes as fixed_top_modes
    from .sea import SeaSpectrum as SeaSpectrum
    from .units import parse_quantity as parse_quantity
    from .vessel import HeaveRao as HeaveRao


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'models' has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value
