"""The fair comparison of controllers in the same seas.

In come a case and contenders (names, designs, controllers of one's own); out goes a `Comparison`,
kept run by run, with a report of who holds the load better and how sure that is.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .comparison import Comparison as Comparison
    from .report import comparison_data as comparison_data
    from .report import comparison_report as comparison_report
    from .report import write_comparison as write_comparison
    from .run import compare as compare
    from .words import sentences_of as sentences_of
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
