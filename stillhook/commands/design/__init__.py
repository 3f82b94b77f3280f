"""Commands about a design."""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .robust_arguments import add_pareto_arguments as add_pareto_arguments
    from .robust_arguments import add_robust_arguments as add_robust_arguments
    from .size_arguments import add_size_arguments as add_size_arguments
    from .size_arguments import add_worth_arguments as add_worth_arguments
    from .vary import parse_range as parse_range
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
