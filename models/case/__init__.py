"""Case: all sections of a case file together.

A file, a bundled name or plain data comes in; a checked and frozen `Case` goes out, which can be
changed by dotted paths and written again.
"""

from typing import TYPE_CHECKING

from ..basics.lazy import lazy_face

if TYPE_CHECKING:
    from .case import Case
    from .case_file import bundled_cases, case_schema, load_case, template_text
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
