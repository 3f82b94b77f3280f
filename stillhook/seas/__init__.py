"""Seas, vessels, hooks and operability as figures, reports and files.

In come a sea, a vessel, a hook's motion or a study of operability; out a `Report` and figures.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .hook import motion_figure as motion_figure
    from .hook import motion_report as motion_report
    from .hook import own_place as own_place
    from .hull import hull_figure as hull_figure
    from .hull import hull_report as hull_report
    from .operability import operability_report as operability_report
    from .operability import workable_table as workable_table
    from .operability import write_operability as write_operability
    from .operability_figures import capability_figure as capability_figure
    from .operability_figures import contour_figure as contour_figure
    from .operability_figures import depth_figure as depth_figure
    from .operability_site import heading_figure as heading_figure
    from .operability_site import scatter_figure as scatter_figure
    from .raos import long_wave_verdict as long_wave_verdict
    from .raos import rao_figure as rao_figure
    from .raos import rao_report as rao_report
    from .sea import records_report as records_report
    from .sea import records_table as records_table
    from .sea import sea_report as sea_report
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
