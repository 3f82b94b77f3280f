"""Seas: spectra of the surface elevation, spreading, records of buoys, scatter diagrams.

The sea of a case file, a file of measured spectra or a scatter diagram comes in; spectra, their
statistics and the shares of the sea states go out.
"""

from typing import TYPE_CHECKING

from ..basics.lazy import lazy_face

if TYPE_CHECKING:
    from .records import SeaRecords, read_seas
    from .scatter import Scatter
    from .scatter_files import read_scatter, write_scatter
    from .sea import SeaSpectrum
    from .sea_section import Sea
    from .shapes import breaking_steepness
    from .spreading import Spreading
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
