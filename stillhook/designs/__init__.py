"""Designs and studies of designs as files, figures and reports.

A design, a front, a sizing or a study of `synth` comes in; out come a `Report` for the terminal and
for files, figures, and design files that load again.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .bound_text import bound_rows
    from .design_file import design_data, design_text, is_design_file, load_design, save_design
    from .kept_design import best_design, keep_best
    from .motion import MotionView
    from .report import design_report, write_design
    from .robust import robust_report, scenario_table, schedule_report
    from .sensitivity import Wide, indices_table, moved_table, sensitivity_report
    from .sizing import co_design_report, pareto_report, size_report, worth_report
    from .structures import structures_report, structures_table
    from .summary import (
        AT_LEAST,
        LIMITS,
        about_of,
        alternatives_table,
        command_of,
        command_text,
        expected_table,
        has_loop,
        heard,
        label_of,
        share_table,
    )
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
