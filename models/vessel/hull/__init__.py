"""Hulls in panels, and the motions of the vessels they make, by Capytaine.

Main dimensions or a mesh file and a loading go in; hydrostatics, hydrodynamic coefficients and a
`VesselRaos` come out.
"""

from typing import TYPE_CHECKING

from ...basics.lazy import lazy_face

if TYPE_CHECKING:
    from .files import read_hull
    from .hull import Hull, box_hull
    from .hydrodynamics import FloatingBody, Hydrodynamics, solved_motions
    from .hydrostatics import centre_of_mass
    from .lines import ShipLines
    from .vessel import HullVessel, usual_frequencies, vessel_from_hull
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
