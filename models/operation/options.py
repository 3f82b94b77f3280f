"""Options of the scenarios of the library, with defaults that follow from the case.

An option has a kind and a range, as the fields of a case file have, so that `height="5 m"` and
`height=5.0` are the same and a wrong unit is told.  Its default is a number or a figure of the
case: a speed that the winch has to spare, a length of rope that the drum holds, a wave height.
The recipes of `models.operation.scenarios` and `models.operation.contact_scenarios` are
made of them.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

from ..basics import GRAVITY, InputError
from ..case import Case
from ..casefile import Quantity
from .profile import Move, Profile

Values: TypeAlias = Mapping[str, Any]  #: Values of a scenario's options by name, in SI.

Default: TypeAlias = float | Callable[[Case], float]


@dataclass(frozen=True, kw_only=True)
class Option:
    """A quantity that a scenario may be given."""

    quantity: Quantity  #: Kind and range.
    default: Default  #: Value in SI, or how it follows from the case.
    text: str  #: What it is.

    def value(self, given: object, case: Case) -> float:
        """Return the value in SI: a number, a text with a unit, or None for the default.

        Raises InputError if it is of another kind, or out of range.
        """
        if given is None:
            return self.default(case) if callable(self.default) else self.default
        return float(self.quantity.read(given))


@dataclass(frozen=True, kw_only=True)
class WordOption:
    """One of a few words that a scenario may be given."""

    words: tuple[str, ...]  #: The words, the default first.
    text: str  #: What it is.
    motion: bool = False  #: Whether a source of motion may be given instead.

    def value(self, given: object, case: Case) -> object:
        """Return the word, the default if None is given, or the source of motion.

        Raises InputError if it is neither.
        """
        del case
        if given is None:
            return self.words[0]
        if isinstance(given, str) and given in self.words:
            return given
        if self.motion and hasattr(given, "motion"):
            return given
        beside = " or a source of motion" if self.motion else ""
        raise InputError(f"must be one of {', '.join(self.words)}{beside}, got {given!r}")


@dataclass(frozen=True, kw_only=True)
class ScenarioRecipe:
    """How a scenario of the library is made."""

    description: str  #: What it is, in one line.
    #: From the case and the options' values to the fields of a `Scenario` that are its own.
    build: Callable[[Case, Values], dict[str, Any]]
    options: Mapping[str, Option | WordOption]  #: Its options by name.
    #: Defaults of the two options that every scenario has [s].
    warm_up: float = 0.0
    ramp: float = 0.0

    @property
    def all_options(self) -> dict[str, Option | WordOption]:
        """Its own options and those that every scenario has."""
        return {
            **self.options,
            "warm_up": time_option(self.warm_up, "time with the brake on at the start"),
            "ramp": time_option(self.ramp, "time in which the command is ramped in, and out"),
        }


def length_option(default: Default, text: str, low: float = 0.0) -> Option:
    """Return an option for a length [m], above zero or at least `low`."""
    return Option(
        quantity=Quantity("length", low, 5000.0, open_low=low == 0.0), default=default, text=text
    )


def time_option(default: float, text: str) -> Option:
    """Return an option for a time [s]."""
    return Option(quantity=Quantity("time", 0.0, 1e6), default=default, text=text)


def speed_option(default: Default, text: str = "speed of the set-point") -> Option:
    """Return an option for a speed [m/s]."""
    return Option(quantity=Quantity("speed", 0.0, 20.0, open_low=True), default=default, text=text)


def set_point_options(
    speed: Default | None = None, acceleration: float = 0.1, wait: float = 60.0
) -> dict[str, Option]:
    """Return the options of a set-point that moves: speed, acceleration, and the wait before it."""
    text = "acceleration of the set-point"
    allowed = Quantity("acceleration", 0.0, 10.0, open_low=True)
    return {
        "speed": speed_option(lowering_speed if speed is None else speed),
        "acceleration": Option(quantity=allowed, default=acceleration, text=text),
        "wait": time_option(wait, "time at rest before it, with the controller engaged"),
    }


# ---- figures of the case ---------------------------------------------------------------------


def lowering_speed(case: Case) -> float:
    """Return a speed to lower at [m/s]: a fifth of the winch's, the rest is for the waves."""
    return min(0.5, 0.2 * _line_speed(case))


def lifting_speed(case: Case) -> float:
    """Return a speed at which to get away from a heaving deck [m/s]."""
    return min(1.0, 0.4 * _line_speed(case))


def rope_left(case: Case) -> float:
    """Return how far the rope left on the drum lets the load down [m], infinite if not known."""
    return case.winch.drum.total(case.rope.diameter) / case.rope.falls - case.rope.length


def wave_height(case: Case) -> float:
    """Return H_s [m]."""
    return case.sea.significant_height


def payload_side(case: Case) -> float:
    """Return the side of the payload's plan [m], taken as a square."""
    shape = case.payload.shape
    return shape.prism_side if shape is not None else max(math.sqrt(case.payload.area), 0.5)


def payload_height(case: Case) -> float:
    """Return the height of the payload [m]; as its side where it is not known."""
    shape = case.payload.shape
    return shape.prism_height if shape is not None else payload_side(case)


def weight_in_air(case: Case) -> float:
    """Return the payload's weight in air [N]."""
    return case.payload.mass * GRAVITY


def _line_speed(case: Case) -> float:
    """Return the load's speed at the motor's highest [m/s]."""
    return case.winch.speed_limit * case.haul_radius / case.winch.gearbox.ratio


# ---- times -----------------------------------------------------------------------------------


def begin(values: Values) -> float:
    """Return when the operation itself begins [s]: after warm-up, ramp and wait."""
    start: float = values["warm_up"] + values["ramp"] + values.get("wait", 0.0)
    return start


def move(
    values: Values, distance: float, *, start: float | None = None, speed: float | None = None
) -> Move:
    """Return a move of the set-point, by default when the operation begins and as fast as told."""
    return Move(
        start=begin(values) if start is None else start,
        distance=distance,
        speed=values["speed"] if speed is None else speed,
        acceleration=values["acceleration"],
    )


def moving(*moves: Move, tail: float = 60.0) -> dict[str, Any]:
    """Return set-point and duration of moves, some time after the last in whole tens of seconds."""
    profile = Profile(moves=moves)
    return {"profile": profile, "duration": 10.0 * math.ceil((profile.end + tail) / 10.0)}
