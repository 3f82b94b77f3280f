"""Sweeps: a design or a controller on thousands of cases, kept on disk, and what came of them.

What is varied stands in `models.spread`, the vectorised engine of the frequency domain in
`synth.sweeps`; here are runs in time on any number of cores, and the report of both.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .figures import cumulative_share, sweep_figures, violins
    from .report import place_of, sweep_data, sweep_report, write_sweep
    from .store import stored_question
    from .sweeping import resume_sweep, spread_of, sweep
    from .time_metrics import STATUS, UNKNOWN
    from .usual import fault_spread, usual_spread
    from .words import SweepSummary, varied_paths, worst_cases
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
