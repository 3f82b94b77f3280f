"""What nobody could do better on a record: the clairvoyant optimum."""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .clairvoyance import clairvoyant as clairvoyant
    from .floor import Clairvoyant as Clairvoyant
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
