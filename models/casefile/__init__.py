"""Building blocks of a case file: quantities with units, sections, dotted paths, YAML.

Text with units comes in; sections in SI go out, or one sentence for each error, with the field that
it is about and its line.
"""

from typing import TYPE_CHECKING

from ..basics.lazy import lazy_face

if TYPE_CHECKING:
    from .data_file import FOLDER, DataFile
    from .messages import Path, line_of, message_line, suggestion
    from .paths import plain, replaced
    from .quantity import LINE, LINES, Quantity
    from .section import Section, describe, problems
    from .yaml_lines import case_text, read_yaml, yaml_text
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
