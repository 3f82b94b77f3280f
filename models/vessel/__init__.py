"""The vessel: six complex RAOs over frequency and heading, and the heave of its hook.

    RAO file (CSV, WAMIT, OrcaFlex, Capytaine, MSS, ShipX) -> read_raos -> VesselRaos -> the hook

Each reader turns what its program writes into the project's convention, and nothing after it has
to know another one: z up; x forward, y to port; angles by the right hand rule; time factor
e^{+i omega t}; headings are where the waves travel towards, 0 following, 180 deg head sea.
"""

from typing import TYPE_CHECKING

from ..basics.lazy import lazy_face

if TYPE_CHECKING:
    from .crane import Point as Point
    from .crane import across as across
    from .crane import place_text as place_text
    from .crane import side_of as side_of
    from .hook_operator import equivalent as equivalent
    from .hook_operator import heave_operators as heave_operators
    from .hook_operator import hook_operators as hook_operators
    from .hook_operator import hook_rao as hook_rao
    from .hook_operator import sea_directions as sea_directions
    from .hook_operator import speed_remark as speed_remark
    from .hook_operator import vessel_raos as vessel_raos
    from .raos import MODES as MODES
    from .raos import VesselRaos as VesselRaos
    from .vessel import HeaveRao as HeaveRao
    from .vessel import OutsideShare as OutsideShare
    from .vessel_section import HeaveTable as HeaveTable
    from .vessel_section import Vessel as Vessel
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
