"""The plant: equations of winch, rope and payload, and the linear plants made of them.

Equations of winch, rope and payload in CasADi symbols come out of a case (`build_plant`); at rest
they give a `LinearPlant` with its responses, poles and sampled form, the exact line
(`line_response`) and the drag that is consistent with the motion. Synthesis, control and
simulation know the world by these alone.
"""

from typing import TYPE_CHECKING

from ..basics.lazy import lazy_face

if TYPE_CHECKING:
    from .discrete import DiscretePlant as DiscretePlant
    from .discrete import zero_order_hold as zero_order_hold
    from .drag import consistent_drag as consistent_drag
    from .drag import energy_equivalent as energy_equivalent
    from .drag import stochastic_equivalent as stochastic_equivalent
    from .drive import SPEED_BAND as SPEED_BAND
    from .drive import DriveLimits as DriveLimits
    from .equations import MEASUREMENTS as MEASUREMENTS
    from .equations import MOTION as MOTION
    from .equations import displacement_names as displacement_names
    from .equations import parameter_values as parameter_values
    from .line import line_response as line_response
    from .line import line_response_at as line_response_at
    from .line import rope_transfers as rope_transfers
    from .linear import LinearPlant as LinearPlant
    from .pade import pade_bank as pade_bank
    from .payout import DrumTravel as DrumTravel
    from .plant import MEAN_LOSSES as MEAN_LOSSES
    from .plant import OperatingPoint as OperatingPoint
    from .plant import Plant as Plant
    from .plant import build_plant as build_plant
    from .plant_data import PlantData as PlantData
    from .plant_data import masses_for_bandwidth as masses_for_bandwidth
    from .response import PlantResponse as PlantResponse
    from .rope import MAX_MASSES as MAX_MASSES
    from .rope import RopeLumps as RopeLumps
    from .rope import fixed_top_modes as fixed_top_modes
    from .rope import lump_rope as lump_rope
    from .rope import lumped_modes as lumped_modes
    from .shaping import ShapingFilter as ShapingFilter
    from .shaping import controllable_form as controllable_form
    from .shaping import fit_shaping_filter as fit_shaping_filter
    from .shaping import sampled_density as sampled_density
    from .surroundings import Deck as Deck
    from .surroundings import Seabed as Seabed
    from .surroundings import SplashZone as SplashZone
    from .surroundings import Surroundings as Surroundings
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
