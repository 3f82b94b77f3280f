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
    "RecordMotion": "models.record_file",
    "SineMotion": "models.excitation",
    "SixDofMotion": "models.six_dof",
    "Run": "models.run",
    "Scenario": "models.scenario",
    "Bound": "synth.bound",
    "bound_for": "synth.bound_case",
    "GainDesign": "synth",
    "evaluate_gains": "synth",
    "exact_sensors": "synth.bound_beside",
    "Family": "synth.family",
    "optimise_robust": "synth.robust",
    "pareto_front": "synth.pareto",
    "Robustness": "synth.mu",
    "robustness": "synth.mu",
    "morris_screening": "synth.sensitivities.screening",
    "sobol_indices": "synth.sensitivities.global_indices",
    "Sensitivity": "synth.sensitivities",
    "sensitivity": "synth.sensitivities",
    "schedule_gains": "synth.schedule",
    "optimise_gains": "synth",
    "tune": "synth",
    "co_design": "synth.co_design",
    "size_winch": "synth.sizing",
    "worth": "synth.purchase",
    "StructureDesign": "synth.structure_design",
    "optimise_structure": "synth.structure_search",
    "Clairvoyant": "mpc.clairvoyant",
    "clairvoyant": "mpc.clairvoyant",
    "NonlinearMPC": "mpc.nonlinear",
    "Doubts": "mpc.doubts",
    "LinearMPC": "mpc.linear",
    "Weights": "mpc.weights",
    "tune_weights": "mpc.weights",
    "BrakeOn": "synth.brake_on",
    "ConstantTension": "synth.constant_tension",
    "LinearFeedback": "synth.linear_feedback",
    "VelocityFeedForward": "synth.feed_forward",
    "Runs": "stillhook.runs",
    "simulate": "stillhook.simulation",
    "Comparison": "stillhook.comparison",
    "compare": "stillhook.compare_run",
    "write_runs": "stillhook.run_report",
    "cable_study": "stillhook.cables",
    "load_design": "stillhook.design_file",
    "load_structure": "stillhook.structure_file",
    "save_structure": "stillhook.structure_file",
    "save_design": "stillhook.design_file",
    "Spread": "models.spreads",
    "VesselRaos": "models.vessels",
    "read_raos": "models.vessels",
    "write_raos": "models.vessels",
    "bundled_vessels": "models.vessels",
    "sweep": "stillhook.sweeps.sweep",
    "resume_sweep": "stillhook.sweeps.sweep",
    "operability": "synth.operability",
    "Operability": "synth.operability.result",
    "Scatter": "models.seas.scatter",
    "read_scatter": "models.seas.scatter",
    "hook_motion": "models.hook_survey",
    "HookSurvey": "models.hook_survey",
    "HookDemand": "models.hook_demand",
    "read_seas": "models.seas.records",
    "gain_tolerance": "synth.sweeps.gain_tolerance",
    "usual_spread": "stillhook.sweeps.usual",
    "fault_spread": "stillhook.sweeps.usual",
    "vessel_from_hull": "models.vessels.hull_vessel",
    "ShipLines": "models.vessels.hull_lines",
    "box_hull": "models.vessels.hull",
    "read_hull": "models.vessels.hull_files",
    "Uniform": "models.spreads",
    "Normal": "models.spreads",
    "Triangular": "models.spreads",
    "LogNormal": "models.spreads",
    "Samples": "models.spreads",
    "write_report": "stillhook.report",
}

__all__ = [
    "Bound",
    "BrakeOn",
    "Case",
    "Clairvoyant",
    "Comparison",
    "ConstantTension",
    "Doubts",
    "Family",
    "GainDesign",
    "HookDemand",
    "HookSurvey",
    "InputError",
    "LinearFeedback",
    "LinearMPC",
    "LogNormal",
    "NonlinearMPC",
    "Normal",
    "Operability",
    "PhysicsWarning",
    "RecordMotion",
    "Robustness",
    "Run",
    "Runs",
    "Samples",
    "Scatter",
    "Scenario",
    "Sensitivity",
    "ShipLines",
    "SineMotion",
    "SixDofMotion",
    "SolverError",
    "Spread",
    "StillhookError",
    "StructureDesign",
    "SynthesisError",
    "Triangular",
    "Uniform",
    "VelocityFeedForward",
    "VesselRaos",
    "Weights",
    "__version__",
    "bound_for",
    "box_hull",
    "bundled_cases",
    "bundled_vessels",
    "cable_study",
    "case_schema",
    "clairvoyant",
    "co_design",
    "compare",
    "evaluate_gains",
    "exact_sensors",
    "fault_spread",
    "gain_tolerance",
    "hook_motion",
    "load_case",
    "load_design",
    "load_structure",
    "morris_screening",
    "operability",
    "optimise_gains",
    "optimise_robust",
    "optimise_structure",
    "pareto_front",
    "read_hull",
    "read_raos",
    "read_scatter",
    "read_seas",
    "resume_sweep",
    "robustness",
    "save_design",
    "save_structure",
    "sensitivity",
    "simulate",
    "size_winch",
    "sobol_indices",
    "sweep",
    "tune",
    "tune_weights",
    "usual_spread",
    "vessel_from_hull",
    "worth",
    "write_raos",
    "write_report",
    "write_runs",
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
    from models.excitation import SineMotion as SineMotion
    from models.hook_demand import HookDemand as HookDemand
    from models.hook_survey import HookSurvey as HookSurvey
    from models.hook_survey import hook_motion as hook_motion
    from models.record_file import RecordMotion as RecordMotion
    from models.run import Run as Run
    from models.scenario import Scenario as Scenario
    from models.seas.records import read_seas as read_seas
    from models.seas.scatter import Scatter as Scatter
    from models.seas.scatter import read_scatter as read_scatter
    from models.six_dof import SixDofMotion as SixDofMotion
    from models.spreads import LogNormal as LogNormal
    from models.spreads import Normal as Normal
    from models.spreads import Samples as Samples
    from models.spreads import Spread as Spread
    from models.spreads import Triangular as Triangular
    from models.spreads import Uniform as Uniform
    from models.vessels import VesselRaos as VesselRaos
    from models.vessels import bundled_vessels as bundled_vessels
    from models.vessels import read_raos as read_raos
    from models.vessels import write_raos as write_raos
    from models.vessels.hull import box_hull as box_hull
    from models.vessels.hull_files import read_hull as read_hull
    from models.vessels.hull_lines import ShipLines as ShipLines
    from models.vessels.hull_vessel import vessel_from_hull as vessel_from_hull
    from mpc.clairvoyant import Clairvoyant as Clairvoyant
    from mpc.clairvoyant import clairvoyant as clairvoyant
    from mpc.doubts import Doubts as Doubts
    from mpc.linear import LinearMPC as LinearMPC
    from mpc.nonlinear import NonlinearMPC as NonlinearMPC
    from mpc.weights import Weights as Weights
    from mpc.weights import tune_weights as tune_weights
    from stillhook.sweeps.sweep import resume_sweep as resume_sweep
    from stillhook.sweeps.sweep import sweep as sweep
    from stillhook.sweeps.usual import fault_spread as fault_spread
    from stillhook.sweeps.usual import usual_spread as usual_spread
    from synth import GainDesign as GainDesign
    from synth import evaluate_gains as evaluate_gains
    from synth import optimise_gains as optimise_gains
    from synth import tune as tune
    from synth.bound import Bound as Bound
    from synth.bound_beside import exact_sensors as exact_sensors
    from synth.bound_case import bound_for as bound_for
    from synth.brake_on import BrakeOn as BrakeOn
    from synth.co_design import co_design as co_design
    from synth.constant_tension import ConstantTension as ConstantTension
    from synth.family import Family as Family
    from synth.feed_forward import VelocityFeedForward as VelocityFeedForward
    from synth.linear_feedback import LinearFeedback as LinearFeedback
    from synth.mu import Robustness as Robustness
    from synth.mu import robustness as robustness
    from synth.operability import operability as operability
    from synth.operability.result import Operability as Operability
    from synth.pareto import pareto_front as pareto_front
    from synth.purchase import worth as worth
    from synth.robust import optimise_robust as optimise_robust
    from synth.schedule import schedule_gains as schedule_gains
    from synth.sensitivities import Sensitivity as Sensitivity
    from synth.sensitivities import sensitivity as sensitivity
    from synth.sensitivities.global_indices import sobol_indices as sobol_indices
    from synth.sensitivities.screening import morris_screening as morris_screening
    from synth.sizing import size_winch as size_winch
    from synth.structure_design import StructureDesign as StructureDesign
    from synth.structure_search import optimise_structure as optimise_structure
    from synth.sweeps.gain_tolerance import gain_tolerance as gain_tolerance

    from .cables import cable_study as cable_study
    from .compare_run import compare as compare
    from .comparison import Comparison as Comparison
    from .design_file import load_design as load_design
    from .design_file import save_design as save_design
    from .report import write_report as write_report
    from .run_report import write_runs as write_runs
    from .runs import Runs as Runs
    from .simulation import simulate as simulate
    from .structure_file import load_structure as load_structure
    from .structure_file import save_structure as save_structure


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'stillhook' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
