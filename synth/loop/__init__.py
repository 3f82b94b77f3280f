"""The closed loop of a plant and a linear controller.

In come a linear plant, a controller in state space and the spectra of the disturbances; out come
responses, poles, variances, stability margins and the drag that agrees with the motion.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .assess import Assessment, consistent_coefficients, frequency_grid, integration_band
    from .controller import LinearController, closed_loop_matrix, closed_loop_poles
    from .disturbance import CoherentError, Disturbance, disturbances
    from .dual import (
        Dual,
        at_least,
        conj,
        constant,
        exp,
        imag,
        joined,
        log,
        mapped,
        real,
        sqrt,
        squared,
        value_of,
        where,
    )
    from .elements import (
        Coefficients,
        DragElement,
        Element,
        LossElement,
        switching_friction,
        with_elements,
        without_losses,
    )
    from .loop_model import DECAY, LoopModel, abscissa, lively_poles
    from .margins import Margins, least_distances, level_ends, loop_margins, refine_minima
    from .pole_region import PoleRegion, counted_poles, with_delay_models
    from .responses import Closing, LoopBlocks, LoopResponses, Shaking
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
