"""Criteria of an operation: limits of drive and rope, and how still the load must be.

Each is a limit as a design has it (`synth.limits`), looked at in many sea states at once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from typing_extensions import override

from models.basics import InputError, check_range, parse_quantity
from models.case import Case
from models.plant import LinearPlant

from ..limits import (
    LOWER_TENSION,
    PAYLOAD,
    Amplification,
    Limit,
    Minimum,
    Peak,
    Rms,
    Symbols,
    drive_limits,
)

if TYPE_CHECKING:
    from ..loop import Assessment


@dataclass(frozen=True, kw_only=True)
class Significant(Rms):
    """Significant double amplitude, 4 sigma, of `output` at most `bound`."""

    kind: ClassVar[str] = "significant"

    @override
    def rows(self, symbols: Symbols, bound: Any) -> Any:
        return super().rows(symbols, bound / 4.0)

    @override
    def measure(self, loop: Assessment) -> float:
        return 4.0 * super().measure(loop)


@dataclass(frozen=True, kw_only=True)
class Stability(Limit):
    """A stationary motion at all: kept wherever there are moments to look at."""

    bound: float = math.nan
    name: str = "stability"

    @override
    def rows(self, symbols: Symbols, bound: Any) -> Any:
        return -1.0

    @override
    def measure(self, loop: Assessment) -> float:
        return math.nan


def payload_criteria(
    case: Case,
    *,
    rms: float | str | None = None,
    significant: float | str | None = None,
    maximum: float | str | None = None,
    speed: float | str | None = None,
    daf: float | None = None,
    snap: float | str | None = None,
) -> tuple[Limit, ...]:
    """Return how still the payload must be held, and how evenly its rope loaded, as criteria.

    The largest standard deviation, significant double amplitude (4 sigma) and largest amplitude of
    its motion in the case's exposure time are in metres, or text with a unit; its largest velocity
    in that time is in m/s or text with a unit.  `daf` is the largest tension at the load's end in
    that time over the load's submerged weight [-]; `snap` the share of its least weight up to
    which the dynamic tension there may go before the rope is slack and snaps taut, a number or text
    in %.

    Raises InputError if a value is not above zero, or has another unit.
    """
    time = case.limits.equivalent_exposure

    def read(name: str, value: float | str, kind: str, unit: str) -> float:
        try:
            number = parse_quantity(value, kind)
        except (ValueError, TypeError) as error:
            raise InputError(f"operability: {name}: {error}") from None
        return check_range("operability", name, number, low=0.0, unit=unit, open_low=True)

    found: list[Limit] = []
    for kind, value in ((Rms, rms), (Significant, significant)):
        if value is not None:
            bound, name = read(f"payload_{kind.kind}", value, "length", "m"), f"payload.{kind.kind}"
            found.append(kind(bound=bound, output=PAYLOAD, unit="m", name=name))
    for end, value, output, quantity, unit in (
        ("max", maximum, PAYLOAD, "length", "m"),
        ("speed", speed, "payload.velocity", "speed", "m/s"),
    ):
        if value is not None:
            bound, name = read(f"payload_{end}", value, quantity, unit), f"payload.{end}"
            found.append(Peak(bound=bound, output=output, duration=time, unit=unit, name=name))
    load, end = case.payload, LOWER_TENSION
    if daf is not None:
        bound = check_range("operability", "daf", daf, low=1.0, high=10.0, open_low=True)
        weight = load.submerged_weight
        found.append(Amplification(bound=bound, output=end, static=weight, duration=time))
    if snap is not None:
        share = read("snap", snap, "ratio", "")
        check_range("operability", "snap", share, high=1.0)
        lightest, name = load.least_weight, f"{end}.snap"
        least = (1.0 - share) * lightest
        found.append(
            Minimum(bound=least, output=end, static=lightest, duration=time, unit="N", name=name)
        )
    return tuple(found)


def case_criteria(case: Case, plant: LinearPlant) -> tuple[Limit, ...]:
    """Return the limits of motor, drive and rope of a case, whether it enforces them or not.

    Where the least tension is no limit (`limits.tension_ends` is ``drum`` and none is given), the
    rope must not go slack at the drum: its bound is zero.  The plant is for the static values.
    """
    # A load at rest that breaks a limit is no error here: the limiting H_s is then zero.
    limits = list(drive_limits(case.variant({"limits.drive": "report"}), plant))
    if not any(isinstance(limit, Minimum) for limit in limits):
        limits.append(
            Minimum(
                bound=0.0,
                output="rope.tension",
                static=plant.static["rope.tension"],
                loss=plant.loss.get("rope.tension", 0.0),
                duration=case.limits.equivalent_exposure,
                unit="N",
            )
        )
    return tuple(limits)


def outputs_of(criteria: Sequence[Limit]) -> tuple[str, ...]:
    """Return the signals that criteria need, each once."""
    return tuple(dict.fromkeys(output for c in criteria for output in c.outputs))
