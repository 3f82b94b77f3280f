"""The vessel: six complex RAOs over frequency and heading, and the heave of its hook.

    RAO file (CSV, WAMIT, OrcaFlex, Capytaine, MSS, ShipX) -> read_raos -> VesselRaos -> the hook

Each reader turns what its program writes into the project's convention, and nothing after it has
to know another one: z up; x forward, y to port; angles by the right hand rule; time factor
e^{+i omega t}; headings are where the waves travel towards, 0 following, 180 deg head sea.
"""

from typing import TYPE_CHECKING

from ..basics.lazy import lazy_face

if TYPE_CHECKING:
    from .crane import Point, across, place_text, side_of
    from .hook_operator import (
        equivalent,
        heading_remark,
        heave_operators,
        hook_operators,
        hook_rao,
        rao_of_hook,
        sea_directions,
        speed_remark,
        vessel_raos,
    )
    from .raos import MODES, VesselRaos
    from .vessel import HeaveRao, OutsideShare
    from .vessel_section import HeaveTable, Vessel
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
