"""Exports: a controller, or the plant, as others run it: C, FMU, structured text, state space.

A design, a case or a controller comes in; folders go out that need nothing of Stillhook, each with
a README and the proof that it is the law that was simulated.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .exported import Exported
    from .exporting import KINDS, Export, asked_kinds, export
    from .law import Law, law_of
    from .recording import EVENTS, Recording, record
    from .signals import SIGNALS, STATUS_TEXTS, Signal
    from .state_space import to_python_control
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
