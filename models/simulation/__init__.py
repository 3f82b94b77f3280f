"""Simulation in time: the closed loop as one recursion, compiled and run.

Case, controller, scenario and `SimulationOptions` come in; `prepare` writes plant, sensors, drive
and brake as one compiled recursion, and `run_simulation` makes a `Run` of it for every seed.
"""

from typing import TYPE_CHECKING

from ..basics.lazy import lazy_face

if TYPE_CHECKING:
    from .closed_loop import STATUS, own_parameters
    from .compiler import Compiler, compile_into, find_compiler
    from .integrate import braked_step, disturbances
    from .kernel import Kernel
    from .simulate import Progress, run_simulation
    from .simulation import (
        EASE,
        SimulatedPlant,
        Simulation,
        SimulationOptions,
        prepare,
        simulated_plant,
    )
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
