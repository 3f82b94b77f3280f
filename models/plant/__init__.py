"""The plant: equations of winch, rope and payload, and the linear plants made of them.

Equations of winch, rope and payload in CasADi symbols come out of a case (`build_plant`); at rest
they give a `LinearPlant` with its responses, poles and sampled form, the exact line
(`line_response`) and the drag that is consistent with the motion. Synthesis, control and
simulation know the world by these alone.
"""

from typing import TYPE_CHECKING

from ..basics.lazy import lazy_face

if TYPE_CHECKING:
    from .discrete import hermite_hold, late_hold, noisy_hold, root_of, zero_order_hold
    from .drag import consistent_drag, settled_drag, stochastic_equivalent
    from .drive import SPEED_BAND, DriveLimits
    from .equations import MEASUREMENTS, MOTION, parameter_values, weighed_tension
    from .line import line_response, rope_transfers
    from .linear import LinearPlant, late_and_held
    from .pade import pade_bank
    from .payout import DrumTravel
    from .plant import MEAN_LOSSES, OperatingPoint, Plant, build_plant
    from .plant_data import PlantData, masses_for_bandwidth
    from .resolvent import Resolvent, Transfer
    from .response import PlantResponse
    from .rope import (
        MAX_BRANCHES,
        MAX_MASSES,
        RopeLumps,
        first_root,
        fixed_top_modes,
        lump_rope,
        lumped_modes,
        skin_drag_share,
        zener_branches,
    )
    from .shaping import ShapingFilter, controllable_form, fit_shaping_filter, sampled_density
    from .surroundings import Deck, Seabed, SplashZone, Surroundings
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
