"""Commands about the world: vessels, seas, motions, case files."""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .motion_arguments import add_motion_arguments as add_motion_arguments
    from .sea_arguments import add_sea_arguments as add_sea_arguments
    from .vessel_arguments import add_vessel_arguments as add_vessel_arguments
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
