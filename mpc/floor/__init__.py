"""The floor under every controller: the optimum of a record that is known from beginning to end.

A case and a record of the hook's motion come in; the least that any command within the drive's
limits leaves of the payload's motion goes out, with a certificate, a lower bound and a simulation
by another route.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .clairvoyance import clairvoyant
    from .floor import Clairvoyant
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
