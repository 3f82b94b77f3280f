"""Controllers simulated over seeds: `simulate`, its runs, and what they say.

A case, a controller and a scenario come in; out come `Runs`, their report, figures and files.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .data import runs_data as runs_data
    from .report import RunFolder as RunFolder
    from .report import runs_report as runs_report
    from .report import write_runs as write_runs
    from .runs import TRIPS as TRIPS
    from .runs import Runs as Runs
    from .runs import headline_of as headline_of
    from .runs import keep_worst as keep_worst
    from .runs import tree as tree
    from .series import Series as Series
    from .simulation import seconds_of as seconds_of
    from .simulation import seeds_of as seeds_of
    from .simulation import simulate as simulate
    from .window import error_of as error_of
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
