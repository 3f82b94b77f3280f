"""Seas, vessels, hooks and operability as figures, reports and files.

In come a sea, a vessel, a hook's motion, a study of operability or weather windows; out a `Report`
and figures.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .hook import motion_figure, motion_report, own_place
    from .operability import FIGURES, netcdf, operability_report, workable_table
    from .operability_figures import (
        capability_figure,
        contour_figure,
        depth_figure,
        heading_figure,
        scatter_figure,
    )
    from .sea import records_report, records_table, sea_report, series_report
    from .vessel import hull_figure, hull_report, long_wave_verdict, rao_figure, rao_report
    from .window_figures import calendar_figure, months_figure
    from .windows import (
        WINDOW_FIGURES,
        load_windows,
        save_windows,
        window_list,
        windows_section,
        windows_table,
    )
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
