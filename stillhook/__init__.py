"""Stillhook keeps the load on a vessel's hook still.

>>> import stillhook as sh
>>> case = sh.load_case("thesis-1975")
>>> as_is = sh.evaluate_gains(case, {"A": 200, "a": 50, "a1": 100, "a2": 100})
>>> round(1e3 * as_is.payload_rms, 1)  # millimetres
11.7

Names are imported when they are first used, so that ``import stillhook`` and ``stillhook
--help`` cost nothing.
"""

from typing import TYPE_CHECKING

from ._distribution import check_siblings

check_siblings()

from models.basics.lazy import lazy_face  # noqa: E402, once the packages are known to be ours

from ._version import __version__ as __version__  # noqa: E402

if TYPE_CHECKING:
    from models.basics import InputError as InputError
    from models.basics import PhysicsWarning as PhysicsWarning
    from models.basics import SolverError as SolverError
    from models.basics import StillhookError as StillhookError
    from models.basics import SynthesisError as SynthesisError
    from models.case import Case as Case
    from models.case import bundled_cases as bundled_cases
    from models.case import case_schema as case_schema
    from models.case import load_case as load_case
    from models.hook import HookDemand as HookDemand
    from models.hook import HookSurvey as HookSurvey
    from models.hook import hook_motion as hook_motion
    from models.operation import RecordMotion as RecordMotion
    from models.operation import Scenario as Scenario
    from models.operation import SineMotion as SineMotion
    from models.operation import SixDofMotion as SixDofMotion
    from models.run import Run as Run
    from models.sea import Scatter as Scatter
    from models.sea import read_scatter as read_scatter
    from models.sea import read_seas as read_seas
    from models.spread import LogNormal as LogNormal
    from models.spread import Normal as Normal
    from models.spread import Samples as Samples
    from models.spread import Spread as Spread
    from models.spread import Triangular as Triangular
    from models.spread import Uniform as Uniform
    from models.vessel import VesselRaos as VesselRaos
    from models.vessel.hull import ShipLines as ShipLines
    from models.vessel.hull import box_hull as box_hull
    from models.vessel.hull import read_hull as read_hull
    from models.vessel.hull import vessel_from_hull as vessel_from_hull
    from models.vessel.readers import bundled_vessels as bundled_vessels
    from models.vessel.readers import read_raos as read_raos
    from models.vessel.readers import write_raos as write_raos
    from mpc.floor import Clairvoyant as Clairvoyant
    from mpc.floor import clairvoyant as clairvoyant
    from mpc.linear import LinearMPC as LinearMPC
    from mpc.nonlinear import NonlinearMPC as NonlinearMPC
    from mpc.winch import ProcessNoise as ProcessNoise
    from mpc.winch import Weights as Weights
    from mpc.winch import tune_weights as tune_weights
    from synth.bound import Bound as Bound
    from synth.bound import bound_for as bound_for
    from synth.bound import exact_sensors as exact_sensors
    from synth.controllers import BrakeOn as BrakeOn
    from synth.controllers import ConstantTension as ConstantTension
    from synth.controllers import LinearFeedback as LinearFeedback
    from synth.controllers import VelocityFeedForward as VelocityFeedForward
    from synth.design import GainDesign as GainDesign
    from synth.design import StructureDesign as StructureDesign
    from synth.design import evaluate_gains as evaluate_gains
    from synth.design import optimise_gains as optimise_gains
    from synth.design import optimise_structure as optimise_structure
    from synth.design import tune as tune
    from synth.operability import Operability as Operability
    from synth.operability import operability as operability
    from synth.robust import Family as Family
    from synth.robust import Robustness as Robustness
    from synth.robust import optimise_robust as optimise_robust
    from synth.robust import robustness as robustness
    from synth.robust import schedule_gains as schedule_gains
    from synth.sensitivity import Sensitivity as Sensitivity
    from synth.sensitivity import morris_screening as morris_screening
    from synth.sensitivity import sensitivity as sensitivity
    from synth.sensitivity import sobol_indices as sobol_indices
    from synth.sizing import co_design as co_design
    from synth.sizing import pareto_front as pareto_front
    from synth.sizing import size_winch as size_winch
    from synth.sizing import worth as worth
    from synth.sweeps import gain_tolerance as gain_tolerance

    from .comparison import Comparison as Comparison
    from .comparison import compare as compare
    from .comparison import write_comparison as write_comparison
    from .designs import load_design as load_design
    from .designs import load_structure as load_structure
    from .designs import save_design as save_design
    from .designs import save_structure as save_structure
    from .designs import write_report as write_report
    from .runs import Runs as Runs
    from .runs import simulate as simulate
    from .runs import write_runs as write_runs
    from .sweeps import fault_spread as fault_spread
    from .sweeps import resume_sweep as resume_sweep
    from .sweeps import sweep as sweep
    from .sweeps import usual_spread as usual_spread
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
