"""Runs in time as figures, words and files, and `simulate`."""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .json import summary_of as summary_of
    from .report import RunFolder as RunFolder
    from .report import write_runs as write_runs
    from .runs import TRIPS as TRIPS
    from .runs import Runs as Runs
    from .runs import keep_worst as keep_worst
    from .series import Series as Series
    from .simulation import seconds_of as seconds_of
    from .simulation import seeds_of as seeds_of
    from .simulation import simulate as simulate
    from .terminal import Ticker as Ticker
    from .terminal import run_progress as run_progress
    from .terminal import show_comparison as show_comparison
    from .terminal import show_events as show_events
    from .terminal import show_runs as show_runs
    from .window import error_of as error_of
    from .words import headline_of as headline_of
    from .words import tree as tree
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
