"""Commands about runs in time."""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .simulate_arguments import add_simulate_arguments as add_simulate_arguments
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
