"""The commands of the command line, one module each, with `run(arguments) -> exit status`."""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .given import case_words as case_words
    from .given import gains_text as gains_text
    from .given import given_case as given_case
    from .given import parse_gains as parse_gains
    from .given_design import given_design as given_design
    from .working import Stop as Stop
    from .working import conclude as conclude
    from .working import counting as counting
    from .working import interruptible as interruptible
    from .working import kept_in as kept_in
    from .working import stoppable as stoppable
    from .working import tidy as tidy
    from .working import working as working
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
