"""The fair comparison of controllers in the same seas.

In come a case and contenders (names, designs, controllers of one's own); out goes a `Comparison`,
kept run by run, with a report of who holds the load better and how sure that is.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .comparison import Comparison
    from .report import comparison_data, comparison_report, write_comparison
    from .run import compare
    from .words import sentences_of
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
