"""The test vector of an export: what a law heard and commanded in a simulation, sample by sample.

    law, case --> one run in the case's sea, with everything that may happen --> Recording

The run is that of the nonlinear plant with its sensors.  In it the operator enables, disables and
resets the controller and moves the set point, and every sensor is lost once, so that a replay goes
through each branch of the law.  The commands are those of the controller that was simulated: who
replays the measurements must find the same ones.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from models.basics import FloatArray
from models.operation import Move, Profile, Scenario
from models.sensing import STATUSES, ControllerAround, Measurement

from ..runs import simulate
from .law import Law
from .signals import SIGNALS

EVENTS: tuple[tuple[float, str], ...] = (
    (2.0, "the operator enables the controller"),
    (10.0, "the set point rises by 0.3 m"),
    (15.0, "the drive gives a little less torque than holds the load, for 1.5 s"),
    (20.0, "no message from the payload for 3 s"),
    (25.0, "the payload's sensors give no numbers for 1 s"),
    (28.0, "the motion reference unit is lost for 3 s"),
    (33.0, "the load cell is lost for 2 s"),
    (37.0, "the operator resets the controller"),
    (42.0, "the operator disables the controller for 2 s"),
    (50.0, "the drum's encoder is lost for 0.5 s, and is back"),
    (55.0, "the drum's encoder is lost, and the brake set"),
)
"""What happens in the run: time [s] and what."""

_DURATION = 60.0  # [s]
_TORQUE = "drive.torque_limit"
_LEFT = 0.95  # of the static torque, where the drive gives hardly enough


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording:
    """Measurements, commands and statuses of a run, from the controller's first sample on."""

    measured: FloatArray  #: In the order of `SIGNALS`, (n, 21); no number where there was none.
    commands: FloatArray  #: (n,), in the command's unit.
    statuses: FloatArray  #: Number of each step's status, (n,).
    sample_time: float  #: [s]

    def csv(self) -> str:
        """Return it as CSV, each number with the digits that read back to the last bit."""
        names = [signal.identifier for signal in SIGNALS]
        lines = [",".join(("time", *names, "command", "status"))]
        for k, (row, command, status) in enumerate(
            zip(self.measured.tolist(), self.commands.tolist(), self.statuses, strict=True)
        ):
            cells = [repr(round(k * self.sample_time, 9)), *map(_cell, row), _cell(command)]
            lines.append(",".join((*cells, str(int(status)))))
        return "\n".join(lines) + "\n"


def record(law: Law, *, seed: int = 0) -> Recording:
    """Return the recording of a law in the sea of its case.

    Raises SolverError, InputError as `sh.simulate`.
    """
    heard = _Heard(law)
    left = min(_LEFT * abs(law.rest["motor.torque"]), law.case.winch.drive.torque_peak)
    scenario = Scenario(
        name="recording",
        description="everything that may happen to a controller",
        duration=_DURATION,
        profile=Profile(moves=(Move(start=10.0, distance=0.3, speed=0.1, acceleration=0.1),)),
        enabled=((2.0, 42.0), (44.0, math.inf)),
        resets=(37.0,),
        telemetry_outages=((20.0, 23.0),),
        sensor_failures=((25.0, 26.0),),
        mru_outages=((28.0, 31.0),),
        load_cell_outages=((33.0, 35.0),),
        encoder_outages=((50.0, 50.5), (55.0, _DURATION)),
        parameter_changes={15.0: {_TORQUE: left}, 16.5: {_TORQUE: None}},
    )
    simulate(law.case, heard, scenario=scenario, seeds=[seed], duration=_DURATION)
    return heard.recording()


class _Heard(ControllerAround):
    """A controller that is called from Python, and what goes in and out of it."""

    recursion = None  # so that it is

    def __init__(self, law: Law) -> None:
        super().__init__(law.controller)
        self.reset()

    def reset(self) -> None:
        super().reset()
        self._rows: list[FloatArray] = []
        self._commands: list[float] = []
        self._statuses: list[int] = []

    def as_c(self, prefix: str) -> None:
        """Return none: a compiled loop would call it unheard."""
        del prefix

    def step(self, measurement: Measurement, time: float) -> float:
        """Return the command of the controller within."""
        self._rows.append(measurement.values.copy())
        command = float(self._controller.step(measurement, time))
        self._commands.append(command)
        self._statuses.append(_NAMES.index(self._controller.status))  # type: ignore[attr-defined]
        return command

    def recording(self) -> Recording:
        """Return what was heard since the reset."""
        return Recording(
            measured=np.array(self._rows),
            commands=np.array(self._commands),
            statuses=np.array(self._statuses, dtype=np.float64),
            sample_time=self.sample_time,
        )


_NAMES = tuple(STATUSES)


def _cell(value: float) -> str:
    return "nan" if math.isnan(value) else repr(value)
