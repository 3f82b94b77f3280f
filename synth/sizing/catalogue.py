"""Catalogue of motors: the smallest that meets the target behind some gear.

    CSV -> CatalogueMotor, by rated power -> least factor on its limits over the gear -> ChosenMotor

A catalogue is a table with a heading: `name`, and fields of a case's motor and drive as a case file
names them, each cell a number in SI or a text with a unit:

    name,    torque_continuous, torque_peak, base_speed, maximum_speed, inertia
    A-315,   2.1 kN m,          4.2 kN m,    1500 rpm,   3000 rpm,      4.5 kg m2

What a table leaves out follows the family of the case's motor (`synth.sizing.motor`): friction,
resistance and currents with the torque, the gain of the drive's speed regulator with the inertia;
the power of an AC motor goes with its torque and base speed.
"""

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from models.basics import InputError
from models.case import Case
from models.rig import ACMotor, DCMotor, Drive

from ..question import Goal
from ..search import Progress
from .follow import Answer, follow, posed
from .motor import MotorData, motor_changes
from .point import with_target

_GEARS = 7  # that a motor is tried behind
_NEEDED = ("torque_continuous", "torque_peak", "inertia")


@dataclass(frozen=True, kw_only=True)
class CatalogueMotor:
    """One motor of a catalogue: its name, and the changes by dotted path that put it in a case."""

    name: str
    changes: Mapping[str, Any]


@dataclass(frozen=True, kw_only=True, eq=False)
class ChosenMotor:
    """The motor chosen out of a catalogue."""

    #: Which, its figures, and the ratio of its gear.
    name: str
    motor: MotorData
    gear: float
    case: Case  #: The case with it, all limits enforced.
    spare: float  #: Share of its limits that is left, at the tightest.
    answer: Answer  #: Where its gains begin from.
    smaller: tuple[str, ...]  #: Names of smaller motors that do not do it.


def read_catalogue(
    motors: str | Path | Sequence[Mapping[str, Any]], case: Case
) -> tuple[CatalogueMotor, ...]:
    """Return the motors of a CSV file or of rows, the smallest rated power first.

    They must be of the kind of the case's own, AC or DC.

    Raises InputError if the table cannot be read, a column is missing or unknown, or a figure is
    wrong.
    """
    source = str(motors) if isinstance(motors, str | Path) else "motors"
    rows = _rows(Path(motors)) if isinstance(motors, str | Path) else list(motors)
    if not rows:
        raise InputError(f"{source}: must have at least one motor, got none")
    kind = DCMotor if case.winch.motor.type == "dc" else ACMotor
    places = {name: f"winch.drive.{name}" for name in Drive.model_fields}
    places |= {name: f"winch.motor.{name}" for name in kind.model_fields}
    found: list[tuple[float, CatalogueMotor]] = []
    for k, row in enumerate(rows, 1):
        given = {str(n).strip(): v for n, v in row.items() if v is not None and str(v).strip()}
        name = str(given.pop("name", "")).strip()
        where = f"{source}: motor {k}" + (f" ({name})" if name else "")
        if not name:
            raise InputError(f"{where}: must have a name, got none")
        unknown = sorted(set(given) - set(places))
        missing = [n for n in _NEEDED if n not in given]
        if unknown or missing:
            wrong = f"unknown column {unknown[0]!r}" if unknown else f"no {missing[0]}"
            raise InputError(f"{where}: must have figures of a motor or a drive, got {wrong}")
        if given.get("type", case.winch.motor.type) != case.winch.motor.type:
            raise InputError(
                f"{where}: type must be that of the case's motor, {case.winch.motor.type}, "
                f"got {given['type']}"
            )
        own = {places[n]: _value(v) for n, v in given.items() if n != "type"}
        try:
            changes = _completed(case, own)
            put = case.variant(changes)
        except InputError as error:
            raise InputError(f"{where}: {error}") from None
        motor = CatalogueMotor(name=name, changes=changes)
        found.append((MotorData.of(put).power, motor))
    return tuple(motor for _, motor in sorted(found, key=lambda pair: pair[0]))


def choose(
    case: Case,
    structure: str,
    target: float,
    catalogue: Sequence[CatalogueMotor],
    gears: tuple[float, float],
    *,
    masses: int,
    near: Answer,
    tell: Progress,
) -> ChosenMotor | str:
    """Return the smallest motor of a catalogue that meets a target [m rms], or why there is none.

    Motors come the smallest first, gears by their lowest and highest ratio; `near` is an answer to
    begin from.
    """
    smaller: list[str] = []
    for k, motor in enumerate(catalogue):
        tell("motors of the catalogue", k, len(catalogue))
        best: tuple[float, float, Answer, Case] | None = None
        answer = near
        step = (gears[1] / gears[0]) ** (1.0 / (_GEARS - 1))
        for i in range(_GEARS):
            gear = float(f"{gears[0] * step**i:.3g}")
            put = case.variant({**motor.changes, "winch.gearbox.ratio": gear})
            question = posed(put, structure, masses)
            problem = with_target(question, target)
            relaxed = [
                m.name for m in question.drive if not m.at_least and not m.name.startswith("rope.")
            ]
            begins = dict.fromkeys((answer, near))
            tried = (follow(problem, [b], goal=Goal.RELAX, relaxed=relaxed) for b in begins)
            found = next((a for a in tried if a is not None), None)
            if found is None:
                continue
            answer = found
            if best is None or found.solved.extra < best[0]:
                best = (found.solved.extra, gear, found, put)
        if best is None or best[0] > 0.0:
            smaller.append(motor.name)
            continue
        return ChosenMotor(
            name=motor.name,
            motor=MotorData.of(best[3]),
            gear=best[1],
            case=best[3].variant({"limits.drive": "enforce"}),
            spare=1.0 - math.exp(best[0]),
            answer=best[2],
            smaller=tuple(smaller),
        )
    return f"none of the {len(catalogue)} motors of the catalogue does it behind any of these gears"


def _completed(case: Case, own: Mapping[str, Any]) -> dict[str, Any]:
    """Return the changes of a row with what it leaves out, from the family of the case's motor."""
    given = case.variant(own).winch
    scale = given.drive.torque_continuous / case.winch.drive.torque_continuous
    changes: dict[str, Any] = {**motor_changes(case, scale), **own}
    motor, before, box = given.motor, case.winch.motor, case.winch.gearbox.inertia
    if isinstance(motor, ACMotor) and isinstance(before, ACMotor):
        share = (motor.inertia + box) / (before.inertia + box)
        changes["winch.gearbox.inertia"] = box
        if "winch.motor.speed_gain" not in own:
            changes["winch.motor.speed_gain"] = before.speed_gain * share
        for path in ("winch.drive.power", "winch.drive.speed"):
            if path not in own:
                changes[path] = None
    return changes


def _rows(path: Path) -> list[dict[str, str]]:
    try:
        with path.open(encoding="utf-8", newline="") as file:
            lines = [line for line in file if line.strip() and not line.lstrip().startswith("#")]
            return list(csv.DictReader(lines, skipinitialspace=True, restkey="beyond the heading"))
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: the catalogue cannot be read: {reason}") from error


def _value(value: Any) -> Any:
    if not isinstance(value, str):
        return value
    try:
        return float(value)
    except ValueError:
        return value.strip()
