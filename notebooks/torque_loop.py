r"""The loop broken at the motor's torque, where a drive's limit acts.

::

    demand --> [ clip at the torque limit ] --> torque --> winch, rope, load --+
       ^                                                                        |
       +-- drive <-- command <-- law <------------------------------------------+

A limit of the torque takes away more than gain of the feedback: the drive's own damping, a DC
motor's back-EMF or an AC drive's speed regulator, goes with it.  Margins of the loop broken at
the command say nothing of that.  With d the torque that answers the command at once and P_tu its
whole response,

    1 + L_tau = (1 + L_u) d / P_tu.

`limit_cycles` asks where this loop oscillates once the torque is clipped.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from models.basics import ComplexArray, FloatArray, InputError, check_range
from models.case import Case
from models.plant import DriveLimits, LinearPlant, build_plant
from synth.loop import LinearController, Margins, closed_loop_poles, frequency_grid, loop_margins

_OWNER = "torque loop"


def torque_alone(limit: float) -> DriveLimits:
    """Return a drive that is limited by its torque [N m] and by nothing else."""
    return DriveLimits(torque=limit)


@dataclass(frozen=True, kw_only=True, eq=False)
class TorqueLoop:
    """A plant and a law with the loop broken at the torque; `from_case` makes it.

    Parameters
    ----------
    plant
        The linear plant without drag; its torque answers the command at once.
    law
        The controller u = +C(s) y.
    limit
        The torque stays within [-limit, limit] [N m].
    static
        Torque that holds the load [N m].
    quadratic
        q of the payload's drag q v|v| [N s2/m2].
    late
        Delay of the command, such as half a sample for which it is held [s].
    """

    plant: LinearPlant
    law: LinearController
    limit: float
    static: float
    quadratic: float
    late: float = 0.0

    @classmethod
    def from_case(
        cls,
        case: Case,
        law: LinearController,
        *,
        limit: float | None = None,
        masses: int | None = None,
        sample_time: float = 0.0,
    ) -> TorqueLoop:
        """Return the loop of a case.

        Parameters
        ----------
        case, law
            The case and its controller.
        limit
            Highest torque, above the static one [N m]; by default that of the case's drive.
        masses
            Masses along the rope; by default those of the case.
        sample_time
            Time for which a command is held [s].

        Raises
        ------
        InputError
            If a number is out of its range, or the torque does not answer the command at once.
        """
        plant = build_plant(case, masses)
        static = plant.operating_point({"winch.gear_direction": 0.0}).torque
        peak = case.winch.drive.torque_peak if limit is None else limit
        loop = cls(
            plant=plant.linearise(drag=0.0),
            law=law,
            limit=check_range(_OWNER, "limit", peak, low=abs(static), unit="N m", open_low=True),
            static=static,
            quadratic=plant.data.quadratic_drag,
            late=0.5 * check_range(_OWNER, "sample_time", sample_time, low=0.0, unit="s"),
        )
        if loop.direct == 0.0:
            raise InputError(
                f"{_OWNER}: the motor's torque must answer the command at once; in "
                f"{case.name} it lags behind it"
            )
        return loop

    @property
    def direct(self) -> float:
        """Torque that answers the command at once, d [N m per unit of the command]."""
        return float(self.plant.Dz[self.plant.outputs.index("motor.torque"), 0])

    @property
    def grid(self) -> FloatArray:
        """Frequencies dense enough to see every crossing [rad/s]."""
        poles = [self.plant.poles(), closed_loop_poles(self.plant.without_delays(), self.law)]
        return frequency_grid(np.concatenate(poles))

    def responses(
        self, omega: npt.ArrayLike, drag: float = 0.0
    ) -> tuple[ComplexArray, ComplexArray]:
        """Return L_tau [-] and the payload's displacement per torque [m/(N m)], (k,) each.

        Parameters
        ----------
        omega
            Frequencies (k,) [rad/s].
        drag
            Linear drag coefficient of the payload [N s/m].
        """
        found = self.plant.response(np.asarray(omega, dtype=np.float64))
        force = found.disturbances.index("payload.force")
        torque, payload, speed = (
            found.outputs.index(name)
            for name in ("motor.torque", "payload.displacement", "payload.velocity")
        )
        # Drag is a force fed back from the payload's speed: a rank-one change of every response.
        braking = -drag * found.zu[:, speed, 0] / (1.0 + drag * found.zw[:, speed, force])
        z = found.zu[:, :, 0] + found.zw[:, :, force] * braking[:, None]
        y = found.yu[:, :, 0] + found.yw[:, :, force] * braking[:, None]
        heard = y[:, [found.measurements.index(name) for name in self.law.measurements]]
        law = self.law.response_at(found.s)[:, 0, :]
        command = np.sum(law * heard, axis=1) * np.exp(-found.s * self.late)
        return self.direct * (1.0 - command) / z[:, torque] - 1.0, z[:, payload] / z[:, torque]

    def margins(self, drag: float) -> Margins:
        """Return the margins of the loop; it must be stable while nothing is clipped.

        Parameters
        ----------
        drag
            Linear drag coefficient of the payload [N s/m].
        """

        def gain(omega: FloatArray) -> ComplexArray:
            return self.responses(omega, drag)[0]

        grid = self.grid
        return loop_margins(gain, grid, gain(grid))

    def offset(self, demand: float) -> float:
        """Return the mean of the payload's displacement at a mean demand of torque [m].

        On average the torque is the static one, whatever is asked for: the difference is made by
        a payload that hangs off its place.  NaN for a law that does not hear the displacement.
        """
        if "payload.displacement" not in self.law.measurements:
            return math.nan
        at = self.law.measurements.index("payload.displacement")
        gain = self.direct * float(self.law.response_at([0.0])[0, 0, at].real)
        return (demand - self.static) / gain if gain != 0.0 else math.nan
