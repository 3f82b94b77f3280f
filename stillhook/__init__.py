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
from models.basics.progress import show_by_default  # noqa: E402

from ._version import __version__ as __version__  # noqa: E402

if TYPE_CHECKING:
    from models.basics import (
        InputError,
        PhysicsWarning,
        SolverError,
        StillhookError,
        SynthesisError,
    )
    from models.case import Case, bundled_cases, case_schema, load_case
    from models.hook import HookDemand, HookSurvey, hook_motion
    from models.operation import RecordMotion, Scenario, SineMotion, tip_heave
    from models.run import Run
    from models.sea import Scatter, SeaSeries, read_scatter, read_seas, read_series
    from models.spread import LogNormal, Normal, Samples, Spread, Triangular, Uniform
    from models.vessel import VesselRaos
    from models.vessel.hull import ShipLines, box_hull, read_hull, vessel_from_hull
    from models.vessel.readers import bundled_vessels, read_raos, write_raos
    from mpc.floor import Clairvoyant, clairvoyant
    from mpc.linear import LinearMPC
    from mpc.nonlinear import NonlinearMPC
    from mpc.winch import ProcessNoise, Weights, tune_weights
    from synth.bound import BestPossible, Bound, bound_for, exact_sensors
    from synth.controllers import BrakeOn, ConstantTension, LinearFeedback, VelocityFeedForward
    from synth.design import Design, Look, View, evaluate_gains, optimise_gains, prepare, tune
    from synth.operability import (
        Operability,
        VesselHeading,
        WeatherWindows,
        operability,
        weather_windows,
    )
    from synth.question import SystemFacts, system_facts
    from synth.robust import Family, Robustness, optimise_robust, robustness, schedule_gains
    from synth.sensitivity import Sensitivity, morris_screening, sensitivity, sobol_indices
    from synth.sizing import co_design, pareto_front, size_winch, worth

    from .comparison import Comparison, compare, write_comparison
    from .designs import load_design, save_design, write_design
    from .exports import Export, export
    from .report import Revision, TitleBlock, write_report
    from .runs import FailureModes, Runs, failure_modes, simulate, write_runs
    from .seas import load_windows, save_windows
    from .sweeps import fault_spread, resume_sweep, sweep, usual_spread
    from .text import show_progress
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)

    def _watched(what):
        """Show a call that takes seconds where somebody watches; imported when there is one."""
        from .text.watching import where_watched

        return where_watched(what)

    show_by_default(_watched)
