"""Stillhook keeps the load on a vessel's hook still.

>>> import stillhook as sh
>>> case = sh.load_case("thesis-1975")
>>> as_is = sh.evaluate_gains(case, {"A": 200, "a": 50, "a1": 100, "a2": 100})
>>> round(1e3 * as_is.payload_rms, 1)  # millimetres
11.7

Names are imported when they are first used, so that ``import stillhook`` and ``stillhook
--help`` cost nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from ._distribution import check_siblings

check_siblings()

__version__ = "0.1.0"

_HOME = {
    "Case": "models",
    "InputError": "models",
    "PhysicsWarning": "models",
    "SolverError": "models",
    "StillhookError": "models",
    "SynthesisError": "models",
    "bundled_cases": "models",
    "case_schema": "models",
    "load_case": "models",
    "GainDesign": "synth",
    "evaluate_gains": "synth",
    "optimise_gains": "synth",
    "tune": "synth",
    "cable_study": "stillhook.cables",
    "load_design": "stillhook.design_file",
    "save_design": "stillhook.design_file",
    "write_report": "stillhook.report",
}

__all__ = [
    "Case",
    "GainDesign",
    "InputError",
    "PhysicsWarning",
    "SolverError",
    "StillhookError",
    "SynthesisError",
    "__version__",
    "bundled_cases",
    "cable_study",
    "case_schema",
    "evaluate_gains",
    "load_case",
    "load_design",
    "optimise_gains",
    "save_design",
    "tune",
    "write_report",
]

if TYPE_CHECKING:
    from models import Case as Case
    from models import InputError as InputError
    from models import PhysicsWarning as PhysicsWarning
    from models import SolverError as SolverError
    from models import StillhookError as StillhookError
    from models import SynthesisError as SynthesisError
    from models import bundled_cases as bundled_cases
    from models import case_schema as case_schema
    from models import load_case as load_case
    from synth import GainDesign as GainDesign
    from synth import evaluate_gains as evaluate_gains
    from synth import optimise_gains as optimise_gains
    from synth import tune as tune

    from .cables import cable_study as cable_study
    from .design_file import load_design as load_design
    from .design_file import save_design as save_design
    from .report import write_report as write_report


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'stillhook' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
