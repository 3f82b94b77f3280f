"""The controller's protocol: a measurement in, a drive command out, once in a sample.

    HEARD --> Measurement --> Controller.step --> command --> drive

A controller sees the vector `HEARD` and nothing else: what sensors and telemetry made of
the world (`models/sensing/sensing.py`), not the world itself.  A controller that is a `Recursion`,
a CasADi function of its state and that vector, becomes part of the compiled loop; any other object
with `reset` and `step` is called from Python, one sample at a time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Protocol, runtime_checkable

import casadi as ca
import numpy as np

from ..basics import FloatArray, InputError, check_finite, pick, read_only

#: Names of the measurement vector, in its order; SI, and `drive.applied` in the command's unit.
#:
#: The payload's signals are those received last, `payload.age` their age (delay and time held)
#: and `payload.valid` 1 where a message has just arrived.  `drive.applied` is the command that
#: the drive has really followed over the last sample, within its limits; of a command that takes
#: its time to the drive, the one asked for last as far as the drive is not at a limit.  The
#: references are what the operator asks of the payload: set point, its rate, and how that changes.
#: `operator.enable` is 1 while the controller is to command the drive, `operator.reset` 1 where it
#: is to forget all; encoder and load cell have no age, as they answer at once or not at all.
HEARD: tuple[str, ...] = (
    "payload.acceleration",
    "payload.velocity",
    "payload.displacement",
    "payload.age",
    "payload.valid",
    "mru.heave",
    "mru.heave_rate",
    "mru.valid",
    "drum.haul",
    "motor.speed",
    "rope.tension",
    "motor.torque",
    "drive.applied",
    "reference.displacement",
    "reference.velocity",
    "reference.acceleration",
    "operator.enable",
    "operator.reset",
    "mru.age",
    "encoder.valid",
    "load_cell.valid",
)

_USUAL = ("operator.enable", "encoder.valid", "load_cell.valid")

#: What a step of a controller may have been, and how a run tells of it; the first two are usual,
#: the last asks for the brake.
STATUSES: Mapping[str, str] = MappingProxyType(
    {
        "engaged": "",
        "limited": "",
        "gated": "the controller did not believe a sensor",
        "misfit": "the sea is not as the controller was told, which goes by others",
        "derated": "the drive gives less torque than its limits say",
        "blind": "the controller has heard nothing of the payload for a second",
        "fallback": "the controller had no answer in time and fell back on a simpler law",
        "blending": "",
        "held": "the controller is not enabled and holds the drum",
        "stopping": "the drum's encoder is lost, and the controller stops the drum",
        "braked": "",
    }
)

_AT = {name: i for i, name in enumerate(HEARD)}


@dataclass(frozen=True, eq=False, slots=True)
class Measurement:
    """One sample of what a controller sees, in the order of `HEARD`, (n,).

    It is not copied, as a loop makes thousands.

    Examples
    --------
    >>> seen = Measurement.of({"rope.tension": 4.5e5, "payload.valid": 1.0})
    >>> seen["rope.tension"], seen["payload.displacement"]
    (450000.0, 0.0)
    """

    values: FloatArray

    def __getitem__(self, name: str) -> float:
        """Return one value by name.

        Raises InputError if there is no such measurement.
        """
        at = _AT.get(name)
        if at is None:
            at = pick("measurement", "signal", HEARD, (name,))[0]
        return float(self.values[at])

    @classmethod
    def of(cls, named: Mapping[str, float]) -> Measurement:
        """Return the measurement with these values, zero where none is given.

        A controller is enabled, and hears encoder and load cell, unless it is said otherwise.

        Raises InputError if a name is unknown.
        """
        values = np.zeros(len(HEARD))
        values[[_AT[name] for name in _USUAL]] = 1.0
        values[pick("measurement", "signal", HEARD, tuple(named))] = list(named.values())
        return cls(values)


@runtime_checkable
class Controller(Protocol):
    """Anything that makes drive commands out of measurements.

    These are optional: `recursion`, a `Recursion` that does what `step` does, lets
    the whole loop be compiled; `brake`, true for a controller that holds the drum with its
    brake instead of its motor; `status`, one of `STATUSES`, says what the last step was;
    `deaf_after`, the age of the payload's signals from which it is blind [s];
    `masses`, the masses along the rope on which it was found to hold, of which a simulation then
    has as many; `commanded(command)` tells it what went to the drive instead of its last command.
    """

    @property
    def name(self) -> str:
        """What it is called in results."""

    @property
    def sample_time(self) -> float:
        """Time from one `step` to the next [s]."""

    def reset(self) -> None:
        """Forget every earlier measurement."""

    def step(self, measurement: Measurement, time: float) -> float:
        """Return the drive command, its static part included [V, rad/s or N m].

        The drive holds it until the next step.
        """


@dataclass(frozen=True, kw_only=True, eq=False)
class Recursion:
    """A controller as a function: (xc, m) -> (xc_next, u), a casadi.Function, from an initial xc.

    The state xc is (nxc, 1) and may be empty; the measurements m are in the order of `HEARD`.

    Raises InputError if the function's shapes are others, or the initial state is not finite.
    """

    function: ca.Function
    initial: FloatArray
    status: int | None = None  #: Which number of the state says what the step was, if one does.

    def __post_init__(self) -> None:
        initial = check_finite("recursion", "initial", self.initial)
        object.__setattr__(self, "initial", read_only(initial.reshape(-1)))
        f, n = self.function, self.initial.size
        wanted = [[n, len(HEARD)], [n, 1]]
        got = [[f.numel_in(i) for i in range(f.n_in())], [f.numel_out(i) for i in range(f.n_out())]]
        if got != wanted:
            raise InputError(
                f"recursion: function must take {wanted[0]} and return {wanted[1]} numbers "
                f"(state and measurements, state and command), got {got[0]} and {got[1]}"
            )


class ControllerAround:
    """A controller in Python around another; whatever else that has, this has too."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):  # while it is copied or unpickled there is no controller yet
            raise AttributeError(name)
        return getattr(self._controller, name)

    @property
    def name(self) -> str:
        """What the controller within is called in results."""
        return self._controller.name

    @property
    def sample_time(self) -> float:
        """That of the controller within [s]."""
        return self._controller.sample_time

    def reset(self) -> None:
        """Forget every earlier measurement."""
        self._controller.reset()


def recursion_of(controller: Controller) -> Recursion | None:
    """Return the controller's recursion; None if it has to be stepped from Python."""
    found = getattr(controller, "recursion", None)
    return found if isinstance(found, Recursion) else None


def heard_by(controller: Controller) -> frozenset[str]:
    """Return which of `HEARD` a controller hears; one in Python may hear all of them."""
    recursion = recursion_of(controller)
    if recursion is None:
        return frozenset(HEARD)
    f = recursion.function
    xc, m = ca.SX.sym("xc", f.numel_in(0)), ca.SX.sym("m", f.numel_in(1))
    out = ca.vertcat(*f(xc, m))
    return frozenset(name for i, name in enumerate(HEARD) if ca.depends_on(out, m[i]))


def holds_brake(controller: Controller) -> bool:
    """Return whether the controller holds the drum with its brake."""
    return bool(getattr(controller, "brake", False))
