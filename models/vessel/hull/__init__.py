"""Hulls in panels, and the motions of the vessels they make, by Capytaine.

Main dimensions or a mesh file and a loading go in; hydrostatics, hydrodynamic coefficients and a
`VesselRaos` come out.
"""

from typing import TYPE_CHECKING

from ...basics.lazy import lazy_face

if TYPE_CHECKING:
    from .files import read_hull as read_hull
    from .hull import Hull as Hull
    from .hull import box_hull as box_hull
    from .hydrodynamics import FloatingBody as FloatingBody
    from .hydrodynamics import Hydrodynamics as Hydrodynamics
    from .hydrodynamics import solved_motions as solved_motions
    from .hydrostatics import centre_of_mass as centre_of_mass
    from .lines import ShipLines as ShipLines
    from .vessel import HullVessel as HullVessel
    from .vessel import usual_frequencies as usual_frequencies
    from .vessel import vessel_from_hull as vessel_from_hull
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
