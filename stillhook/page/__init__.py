"""The design page: a design in the browser, its sliders and what they do, on this machine alone.

A case comes in; out comes a page on 127.0.0.1 that answers every move of a slider by the warm view
of `synth.design.prepare`, and asks worker processes for what takes longer.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .files import StartFolder
    from .server import NO_PAGE, DoorPlate, can_serve, serve_page
    from .state import State
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
