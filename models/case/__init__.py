"""Case: all sections of a case file together.

A file, a bundled name or plain data comes in; a checked and frozen `Case` goes out, which can be
changed by dotted paths and written again.
"""

from typing import TYPE_CHECKING

from ..basics.lazy import lazy_face

if TYPE_CHECKING:
    from .case import Case as Case
    from .case_file import bundled_cases as bundled_cases
    from .case_file import case_schema as case_schema
    from .case_file import load_case as load_case
    from .case_file import template_text as template_text
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
