"""Seas: spectra and their parts, spreading over headings, records of buoys, scatter diagrams.

`models.sea.sea.SeaSpectrum` is the sea of a case; the rooms here hold what it is made of.
"""

from typing import TYPE_CHECKING

from ..basics.lazy import lazy_face

if TYPE_CHECKING:
    from .records import SeaRecords as SeaRecords
    from .records import read_seas as read_seas
    from .scatter import Scatter as Scatter
    from .scatter_files import read_scatter as read_scatter
    from .scatter_files import write_scatter as write_scatter
    from .sea import SeaSpectrum as SeaSpectrum
    from .sea_section import Sea as Sea
    from .spreading import Spreading as Spreading
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
