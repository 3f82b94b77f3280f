"""Seas: spectra of the surface elevation, spreading, records, series in time, scatter diagrams.

The sea of a case file, a file of measured spectra, of sea states in time or a scatter diagram comes
in; spectra, their statistics, series and the shares of the sea states go out.
"""

from typing import TYPE_CHECKING

from ..basics.lazy import lazy_face

if TYPE_CHECKING:
    from .records import SeaRecords, read_seas
    from .scatter import Scatter
    from .scatter_files import read_scatter, write_scatter
    from .sea import SHORTEST, SeaSpectrum, highest_of
    from .sea_section import Sea
    from .series import LONGEST_GAP, SeaSeries, relative_heading
    from .series_files import holds_series, read_series
    from .shapes import breaking_height
    from .spreading import Spreading
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
