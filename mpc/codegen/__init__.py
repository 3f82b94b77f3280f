"""Predictive control as C99: what `LinearMPC.step` does, for a drive, a PLC or another simulator.

    LinearMPC --> tables of numbers, and hand-written C --> `NativeLaw`

The C in the folder `c` repeats the Python class by class; its names begin with ``mpc``, for which
the prefix of each law is put.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .export import native_mpc
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
