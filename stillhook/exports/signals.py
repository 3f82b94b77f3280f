"""The signals of an exported controller: unit, sign, and what to feed where a sensor is missing."""

from __future__ import annotations

from dataclasses import dataclass

from models.sensing import HEARD, STATUSES


@dataclass(frozen=True, kw_only=True)
class Signal:
    """One number that goes into a controller."""

    name: str  #: As in `models.sensing.HEARD`.
    unit: str  #: SI; empty for that of the command, ``-`` for a flag.
    meaning: str  #: What it is, with its sign.
    missing: str  #: What to feed where there is no such sensor, or it has failed.

    @property
    def identifier(self) -> str:
        """The name with underscores, as C, structured text and FMU's variables have it."""
        return self.name.replace(".", "_")


_OF_LOAD = "the last value, with payload.valid 0 and payload.age growing"
_OF_UNIT = "the last value, with mru.valid 0"
_OF_DRUM = "any number, with encoder.valid 0"

_TOLD = {
    "payload.acceleration": ("m/s2", "payload's acceleration, up positive", _OF_LOAD),
    "payload.velocity": ("m/s", "payload's velocity against the earth, up positive", _OF_LOAD),
    "payload.displacement": (
        "m",
        "payload's displacement from where it hung at rest at first, up positive",
        _OF_LOAD,
    ),
    "payload.age": (
        "s",
        "age of the payload's three signals: delay of the link and time since the last message",
        "a large number, such as 1000",
    ),
    "payload.valid": ("-", "1 in a sample in which a message has just arrived, else 0", "0"),
    "mru.heave": ("m", "heave of the hook (the crane tip), up positive", _OF_UNIT),
    "mru.heave_rate": ("m/s", "heave rate of the hook, up positive", _OF_UNIT),
    "mru.valid": ("-", "1 while the motion reference unit gives numbers, else 0", "0"),
    "drum.haul": (
        "m",
        "rope hauled in since the load hung at rest at first, over the falls; paying out negative",
        _OF_DRUM,
    ),
    "motor.speed": ("rad/s", "speed of the motor's shaft, hauling in positive", _OF_DRUM),
    "rope.tension": (
        "N",
        "tension of the rope at the drum, its static part included",
        "any number, with load_cell.valid 0",
    ),
    "motor.torque": (
        "N m",
        "torque of the motor, hauling in positive, its static part included",
        "the static torque (the value at rest)",
    ),
    "drive.applied": (
        "",
        "the command that the drive has really followed since the last sample, within its limits",
        "the command asked for at the sample before",
    ),
    "reference.displacement": ("m", "set point of the payload's displacement, up positive", "0"),
    "reference.velocity": ("m/s", "how fast the set point moves, up positive", "0"),
    "reference.acceleration": ("m/s2", "how that changes, up positive", "0"),
    "operator.enable": ("-", "1 while the controller is to command the drive, else 0", "0"),
    "operator.reset": ("-", "1 in a sample in which the controller is to forget all", "0"),
    "mru.age": ("s", "age of the motion reference unit's numbers", "0"),
    "encoder.valid": ("-", "1 while the drum's encoder gives numbers, else 0", "0"),
    "load_cell.valid": ("-", "1 while the load cell gives numbers, else 0", "0"),
}

SIGNALS: tuple[Signal, ...] = tuple(
    Signal(name=name, unit=_TOLD[name][0], meaning=_TOLD[name][1], missing=_TOLD[name][2])
    for name in HEARD
)
"""Every signal, in the order in which a controller takes them."""

STATUS_TEXTS: tuple[tuple[str, str], ...] = tuple(
    (name, text or usual)
    for (name, text), usual in zip(
        STATUSES.items(),
        (
            "the law commands the drive",
            "the drive does not follow the whole command, as it is at a limit",
            *[""] * 5,
            "the command goes over from holding the drum to the law",
            "",
            "",
            "the drum has been stopped without its encoder: set the brake",
        ),
        strict=True,
    )
)
"""Every status by its number: name and meaning."""
