"""Building blocks of a case file: quantities with units, sections, dotted paths, YAML.

Text with units comes in; sections in SI go out, or one sentence for each error, with the field that
it is about and its line.
"""

from typing import TYPE_CHECKING

from ..basics.lazy import lazy_face

if TYPE_CHECKING:
    from .data_file import FOLDER as FOLDER
    from .data_file import DataFile as DataFile
    from .messages import Path as Path
    from .messages import line_of as line_of
    from .messages import message_line as message_line
    from .messages import suggestion as suggestion
    from .paths import plain as plain
    from .paths import replaced as replaced
    from .quantity import Quantity as Quantity
    from .quantity import custom_error as custom_error
    from .section import Section as Section
    from .section import describe as describe
    from .section import problems as problems
    from .yaml_lines import read_yaml as read_yaml
    from .yaml_lines import yaml_text as yaml_text
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
