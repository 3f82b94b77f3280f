"""Sweeps: a design or a controller on thousands of cases, kept on disk, and what came of them.

What is varied stands in `models.spread`, the vectorised engine of the frequency domain in
`synth.sweeps`; here are runs in time on any number of cores, and the report of both.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .figures import sweep_figures as sweep_figures
    from .report import place_of as place_of
    from .report import sweep_data as sweep_data
    from .report import sweep_report as sweep_report
    from .report import write_sweep as write_sweep
    from .store import ATTRIBUTE as ATTRIBUTE
    from .store import stored_question as stored_question
    from .sweeping import resume_sweep as resume_sweep
    from .sweeping import spread_of as spread_of
    from .sweeping import sweep as sweep
    from .time_metrics import STATUS as STATUS
    from .usual import fault_spread as fault_spread
    from .usual import usual_spread as usual_spread
    from .words import SweepSummary as SweepSummary
    from .words import case_at as case_at
    from .words import varied_paths as varied_paths
    from .words import worst_cases as worst_cases
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
