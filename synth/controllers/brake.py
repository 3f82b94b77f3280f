"""The drum held by its brake: no controller, which every controller is compared with."""

from dataclasses import dataclass

import casadi as ca

from models.case import Case

from ..structures import RecursiveController


@dataclass(frozen=True, kw_only=True, eq=False, init=False)
class BrakeOn(RecursiveController):
    """No compensation at all: the brake is on and the drive is off.

    Zero is no voltage, no speed and no torque, whichever the drive is told: a standing motor then
    carries nothing and stays cold.  A sample lasts T [s].  Nothing of the case is needed, but every
    controller is made from one.

    Raises InputError if the sample time is out of its range.
    """

    def __init__(self, case: Case, *, sample_time: float = 0.02) -> None:
        del case
        self._set(brake=True)
        self._adopt("none", sample_time, (), lambda xc, m: (xc, ca.SX(0.0)))
