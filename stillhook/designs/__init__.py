"""Designs and studies of designs as files, figures and reports.

A design, a front, a sizing or a study of `synth` comes in; out come a `Report` for the terminal and
for files, figures, and design files that load again.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .bound_text import bound_sentence as bound_sentence
    from .design_file import design_data as design_data
    from .design_file import design_text as design_text
    from .design_file import load_design as load_design
    from .design_file import load_structure as load_structure
    from .design_file import save_design as save_design
    from .design_file import save_structure as save_structure
    from .design_file import structure_text as structure_text
    from .pareto import pareto_report as pareto_report
    from .report import design_report as design_report
    from .report import write_report as write_report
    from .robust import robust_report as robust_report
    from .robust import scenario_table as scenario_table
    from .robust import schedule_report as schedule_report
    from .sensitivity import Wide as Wide
    from .sensitivity import indices_table as indices_table
    from .sensitivity import moved_table as moved_table
    from .sensitivity import sensitivity_report as sensitivity_report
    from .sizing import co_design_report as co_design_report
    from .sizing import size_report as size_report
    from .sizing import worth_report as worth_report
    from .structures import structures_report as structures_report
    from .structures import structures_table as structures_table
    from .summary import AT_LEAST as AT_LEAST
    from .summary import LIMITS as LIMITS
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
