"""FMUs: controller and plant as slaves of FMI 2.0 for Co-Simulation, with their OSP descriptions.

A `Law` or a case comes in; a zip of description, C sources and a library goes out, validated and
replayed by FMPy.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .controller import as_fmu
    from .plant import plant_as_fmu
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
