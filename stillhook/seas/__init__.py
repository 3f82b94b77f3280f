"""Seas, vessels and operability as figures and words."""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .hook_plot import motion_figure as motion_figure
    from .hook_plot import spectra_figure as spectra_figure
    from .hull_plot import hull_figure as hull_figure
    from .operability_plot import capability_figure as capability_figure
    from .operability_plot import contour_figure as contour_figure
    from .operability_plot import depth_figure as depth_figure
    from .operability_site_plot import heading_figure as heading_figure
    from .operability_site_plot import scatter_figure as scatter_figure
    from .operability_text import netcdf as netcdf
    from .operability_text import show_operability as show_operability
    from .operability_text import workable_csv as workable_csv
    from .rao_plot import rao_figure as rao_figure
    from .sea_plot import spectrum_figure as spectrum_figure
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
