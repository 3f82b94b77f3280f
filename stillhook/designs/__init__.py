"""Designs as files, figures and reports."""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .design_file import design_text as design_text
    from .design_file import load_design as load_design
    from .design_file import save_design as save_design
    from .indices_plot import indices_figure as indices_figure
    from .pareto_plot import finding as finding
    from .pareto_plot import pareto_figure as pareto_figure
    from .pareto_plot import value_text as value_text
    from .report import write_report as write_report
    from .robust_plot import robust_figure as robust_figure
    from .robust_plot import schedule_figure as schedule_figure
    from .size_plot import size_figure as size_figure
    from .size_plot import step_text as step_text
    from .size_plot import worth_figure as worth_figure
    from .structure_file import load_structure as load_structure
    from .structure_file import save_structure as save_structure
    from .structure_file import structure_text as structure_text
    from .structure_plot import structures as structures
    from .structure_table import HEADINGS as HEADINGS
    from .structure_table import markdown as markdown
    from .structure_table import structure_rows as structure_rows
    from .tornado_plot import tornado_figure as tornado_figure
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
