"""Controllers simulated over seeds: `simulate`, its runs, and what they say.

A case, a controller and a scenario come in; out come `Runs`, their report, figures and files.
`failure_modes` lets one thing at a time fail, and says what the load does.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .data import runs_data
    from .failure_effects import SEVERITIES, Afterwards, FirstSeconds, Reference
    from .failure_tables import failure_data, failure_report, failure_sheet, failure_table
    from .failures import FailureMode, FailureModes, failure_modes
    from .report import TraceFormat, runs_report, write_runs, write_summary, write_traces
    from .runs import TRIPS, Runs, headline_of, keep_worst, tree
    from .simulation import Series, seconds_of, seeds_of, simulate
    from .window import error_of
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
