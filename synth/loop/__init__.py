"""The closed loop of a plant and a linear controller.

In come a linear plant, a controller in state space and the spectra of the disturbances; out come
responses (for numbers and for CasADi symbols alike), poles, variances, stability margins and the
drag that agrees with the motion.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .assess import Assessment as Assessment
    from .assess import frequency_grid as frequency_grid
    from .assess import integration_band as integration_band
    from .controller import LinearController as LinearController
    from .controller import closed_loop_matrix as closed_loop_matrix
    from .controller import closed_loop_poles as closed_loop_poles
    from .disturbance import Disturbance as Disturbance
    from .disturbance import disturbances as disturbances
    from .loop import DragElement as DragElement
    from .loop import Phasor as Phasor
    from .loop import PlantBlocks as PlantBlocks
    from .loop import close_scalar as close_scalar
    from .loop import closed_loop as closed_loop
    from .loop import determinant as determinant
    from .loop import numeric_blocks as numeric_blocks
    from .loop import return_differences as return_differences
    from .loop import with_drag as with_drag
    from .margins import Margins as Margins
    from .margins import loop_margins as loop_margins
    from .margins import refine_minima as refine_minima
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
