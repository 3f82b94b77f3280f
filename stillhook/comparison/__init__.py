"""The fair comparison of controllers in the same seas."""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .comparison import Comparison as Comparison
    from .run import compare as compare
    from .words import HEADINGS as HEADINGS
    from .words import LEGEND as LEGEND
    from .words import headline_of as headline_of
    from .words import left_out as left_out
    from .words import rows_at as rows_at
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
