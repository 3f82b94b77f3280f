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
    "RecordMotion": "models.operation.record_file",
    "SineMotion": "models.operation.excitation",
    "SixDofMotion": "models.operation.six_dof",
    "Run": "models.run.run",
    "Scenario": "models.operation.scenario",
    "Bound": "synth.bound.bound",
    "bound_for": "synth.bound.case",
    "GainDesign": "synth",
    "evaluate_gains": "synth",
    "exact_sensors": "synth.bound.beside",
    "Family": "synth.robust.family",
    "optimise_robust": "synth.robust.robust",
    "pareto_front": "synth.sizing.pareto",
    "Robustness": "synth.robust.mu",
    "robustness": "synth.robust.mu",
    "morris_screening": "synth.sensitivity.screening",
    "sobol_indices": "synth.sensitivity.global_indices",
    "Sensitivity": "synth.sensitivity",
    "sensitivity": "synth.sensitivity",
    "schedule_gains": "synth.robust.schedule",
    "optimise_gains": "synth",
    "tune": "synth",
    "co_design": "synth.sizing.codesign",
    "size_winch": "synth.sizing.sizing",
    "worth": "synth.sizing.purchase",
    "StructureDesign": "synth.design.structure_design",
    "optimise_structure": "synth.design.structure_search",
    "Clairvoyant": "mpc.floor.clairvoyance",
    "clairvoyant": "mpc.floor.clairvoyance",
    "NonlinearMPC": "mpc.nonlinear.nonlinear",
    "Doubts": "mpc.winch.doubts",
    "LinearMPC": "mpc.linear.linear",
    "Weights": "mpc.winch.weights",
    "tune_weights": "mpc.winch.weights",
    "BrakeOn": "synth.controllers.brake_on",
    "ConstantTension": "synth.controllers.constant_tension",
    "LinearFeedback": "synth.controllers.linear_feedback",
    "VelocityFeedForward": "synth.controllers.feed_forward",
    "Runs": "stillhook.runs.runs",
    "simulate": "stillhook.runs.simulation",
    "Comparison": "stillhook.comparison.comparison",
    "compare": "stillhook.comparison.run",
    "write_runs": "stillhook.runs.report",
    "load_design": "stillhook.designs.design_file",
    "load_structure": "stillhook.designs.structure_file",
    "save_structure": "stillhook.designs.structure_file",
    "save_design": "stillhook.designs.design_file",
    "Spread": "models.spread",
    "VesselRaos": "models.vessel",
    "read_raos": "models.vessel",
    "write_raos": "models.vessel",
    "bundled_vessels": "models.vessel",
    "sweep": "stillhook.sweeps.sweeping",
    "resume_sweep": "stillhook.sweeps.sweeping",
    "operability": "synth.operability",
    "Operability": "synth.operability.result",
    "Scatter": "models.sea.scatter",
    "read_scatter": "models.sea.scatter",
    "hook_motion": "models.hook.hook_survey",
    "HookSurvey": "models.hook.hook_survey",
    "HookDemand": "models.hook.hook_demand",
    "read_seas": "models.sea.records",
    "gain_tolerance": "synth.sweeps.tolerance",
    "usual_spread": "stillhook.sweeps.usual",
    "fault_spread": "stillhook.sweeps.usual",
    "vessel_from_hull": "models.vessel.hull.vessel",
    "ShipLines": "models.vessel.hull.lines",
    "box_hull": "models.vessel.hull.hull",
    "read_hull": "models.vessel.hull.files",
    "Uniform": "models.spread",
    "Normal": "models.spread",
    "Triangular": "models.spread",
    "LogNormal": "models.spread",
    "Samples": "models.spread",
    "write_report": "stillhook.designs.report",
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
    from models.hook.hook_demand import HookDemand as HookDemand
    from models.hook.hook_survey import HookSurvey as HookSurvey
    from models.hook.hook_survey import hook_motion as hook_motion
    from models.operation.excitation import SineMotion as SineMotion
    from models.operation.record_file import RecordMotion as RecordMotion
    from models.operation.scenario import Scenario as Scenario
    from models.operation.six_dof import SixDofMotion as SixDofMotion
    from models.run.run import Run as Run
    from models.sea.records import read_seas as read_seas
    from models.sea.scatter import Scatter as Scatter
    from models.sea.scatter import read_scatter as read_scatter
    from models.spread import LogNormal as LogNormal
    from models.spread import Normal as Normal
    from models.spread import Samples as Samples
    from models.spread import Spread as Spread
    from models.spread import Triangular as Triangular
    from models.spread import Uniform as Uniform
    from models.vessel import VesselRaos as VesselRaos
    from models.vessel import bundled_vessels as bundled_vessels
    from models.vessel import read_raos as read_raos
    from models.vessel import write_raos as write_raos
    from models.vessel.hull.files import read_hull as read_hull
    from models.vessel.hull.hull import box_hull as box_hull
    from models.vessel.hull.lines import ShipLines as ShipLines
    from models.vessel.hull.vessel import vessel_from_hull as vessel_from_hull
    from mpc.floor.clairvoyance import Clairvoyant as Clairvoyant
    from mpc.floor.clairvoyance import clairvoyant as clairvoyant
    from mpc.linear.linear import LinearMPC as LinearMPC
    from mpc.nonlinear.nonlinear import NonlinearMPC as NonlinearMPC
    from mpc.winch.doubts import Doubts as Doubts
    from mpc.winch.weights import Weights as Weights
    from mpc.winch.weights import tune_weights as tune_weights
    from synth import GainDesign as GainDesign
    from synth import evaluate_gains as evaluate_gains
    from synth import optimise_gains as optimise_gains
    from synth import tune as tune
    from synth.bound.beside import exact_sensors as exact_sensors
    from synth.bound.bound import Bound as Bound
    from synth.bound.case import bound_for as bound_for
    from synth.controllers.brake_on import BrakeOn as BrakeOn
    from synth.controllers.constant_tension import ConstantTension as ConstantTension
    from synth.controllers.feed_forward import VelocityFeedForward as VelocityFeedForward
    from synth.controllers.linear_feedback import LinearFeedback as LinearFeedback
    from synth.design.structure_design import StructureDesign as StructureDesign
    from synth.design.structure_search import optimise_structure as optimise_structure
    from synth.operability import operability as operability
    from synth.operability.result import Operability as Operability
    from synth.robust.family import Family as Family
    from synth.robust.mu import Robustness as Robustness
    from synth.robust.mu import robustness as robustness
    from synth.robust.robust import optimise_robust as optimise_robust
    from synth.robust.schedule import schedule_gains as schedule_gains
    from synth.sensitivity import Sensitivity as Sensitivity
    from synth.sensitivity import sensitivity as sensitivity
    from synth.sensitivity.global_indices import sobol_indices as sobol_indices
    from synth.sensitivity.screening import morris_screening as morris_screening
    from synth.sizing.codesign import co_design as co_design
    from synth.sizing.pareto import pareto_front as pareto_front
    from synth.sizing.purchase import worth as worth
    from synth.sizing.sizing import size_winch as size_winch
    from synth.sweeps.tolerance import gain_tolerance as gain_tolerance

    from .comparison.comparison import Comparison as Comparison
    from .comparison.run import compare as compare
    from .designs.design_file import load_design as load_design
    from .designs.design_file import save_design as save_design
    from .designs.report import write_report as write_report
    from .designs.structure_file import load_structure as load_structure
    from .designs.structure_file import save_structure as save_structure
    from .runs.report import write_runs as write_runs
    from .runs.runs import Runs as Runs
    from .runs.simulation import simulate as simulate
    from .sweeps.sweeping import resume_sweep as resume_sweep
    from .sweeps.sweeping import sweep as sweep
    from .sweeps.usual import fault_spread as fault_spread
    from .sweeps.usual import usual_spread as usual_spread


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'stillhook' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
