"""RAO files of other programs and our own, each read into one convention.

A path goes in; a `VesselRaos` comes out, checked against the limits of long waves, with notes of
what was found and converted.
"""

from typing import TYPE_CHECKING

from ...basics.lazy import lazy_face

if TYPE_CHECKING:
    from .files import ENDINGS, bundled_vessels, read_raos, write_raos
    from .long_waves import LongWaveCheck, check_long_waves
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
