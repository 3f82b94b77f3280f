"""The commands of the command line, one module each, with `run(arguments) -> exit status`."""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .given import case_words, gains_text, given_case, parse_gains
    from .lists import axis
    from .working import Stop, conclude, counting, kept_in, stoppable, tidy, working
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
