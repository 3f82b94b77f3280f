"""What no linear controller can do better than, and the best that was found."""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .bound import Bound as Bound
    from .case import DesignBound as DesignBound
    from .case import bound_beside as bound_beside
    from .case import bound_for as bound_for
    from .case import exact_sensors as exact_sensors
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
