"""The report that leaves the house: one document with every number's origin, as HTML and PDF.

A design and the studies of it come in, with a title block; out come a folder with ``report.html``,
``report.pdf`` and ``report.json``, and the files that their numbers are read from.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .data import verdict
    from .findings import Findings, Revision, TitleBlock, requirement_of
    from .pages import can_typeset
    from .write import NO_PDF, belongs_to, write_report
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
