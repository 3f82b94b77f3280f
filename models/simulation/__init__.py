"""Simulation in time: the closed loop as one recursion, compiled and run.

Case, controller, scenario and `SimulationOptions` come in; `prepare` writes plant, sensors, drive
and brake as one compiled recursion, and `run_simulation` makes a `Run` of it for every seed.
"""

from typing import TYPE_CHECKING

from ..basics.lazy import lazy_face

if TYPE_CHECKING:
    from .kernel import Kernel as Kernel
    from .simulate import Progress as Progress
    from .simulate import run_simulation as run_simulation
    from .simulation import EASE as EASE
    from .simulation import Simulation as Simulation
    from .simulation import SimulationOptions as SimulationOptions
    from .simulation import prepare as prepare
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
