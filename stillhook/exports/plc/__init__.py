"""IEC 61131-3: a law as a function block in structured text, and as PLCopen XML.

CasADi function -> graph -> block -> text, XML;     text -> interpreter -> commands, compared
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .structured_text import as_structured_text
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
