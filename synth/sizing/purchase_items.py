"""The figures of a case that money, or robustness, can change: limits, sensors, delays, gear.

    limits of the programme, case, what the structure hears -> Items

A limit is changed where it stands, by its bound, so that more torque does not bring power with it;
everything else is changed in the case, so that plant and spectra follow.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from models.basics import InputError
from models.case import Case

from ..limits import Limit
from .follow import Posed
from .motor import changed, motor_changes

_RPM = 0.10471975511965977
_NOISE = ("acceleration", "velocity", "displacement")
#: Natural steps of a limit by its unit [SI].
_STEPS = {"N m": 1e3, "rad/s": 100.0 * _RPM, "W": 1e5, "V": 100.0, "A": 100.0, "N": 1e4}


@dataclass(frozen=True, kw_only=True, eq=False)
class Item:
    """One figure that could be another.

    Attributes
    ----------
    name, kind
        What it is called; ``drive``, ``rope``, ``sensor``, ``link``, ``gear`` or ``margin``.
    value, unit
        What it is [SI].
    better
        1 if more is better, -1 if less is, 0 if that has to be found out.
    step
        A natural step of it [SI], as 10 ms of delay.
    limit
        Name of the limit whose bound it is, if it is one.
    changes
        Returns the changes of the case, by dotted path, that make it so many times as large.
    """

    name: str
    kind: str
    value: float
    unit: str
    better: int
    step: float
    limit: str | None = None
    changes: Callable[[float], dict[str, float]] | None = None

    @property
    def sold(self) -> bool:
        """Whether it can be bought: a margin is given away, a gear is chosen."""
        return self.kind not in ("margin", "gear")

    def case(self, case: Case, factor: float) -> Case | None:
        """Return the case with the figure times a factor; None if there is no such case."""
        if self.changes is None:
            return None
        try:
            return changed(case, {"limits.drive": "report", **self.changes(factor)})
        except InputError:
            return None


def limit_items(limits: Sequence[Limit]) -> list[Item]:
    """Return the limits of a programme as items."""
    found = []
    for limit in limits:
        kind = "margin"
        if limit.drive:
            kind = "rope" if limit.name.startswith("rope.") else "drive"
        found.append(
            Item(
                name=limit.name,
                kind=kind,
                value=limit.bound,
                unit=limit.unit,
                better=-1 if limit.at_least else 1,
                step=_STEPS.get(limit.unit, 0.1 * limit.bound),
                limit=limit.name,
            )
        )
    return found


def part_items(case: Case, heard: Sequence[str], posed: Posed) -> list[Item]:
    """Return gear, motor, sensors and delays that a structure's design depends on.

    Parameters
    ----------
    case
        The case.
    heard
        Measurements that the structure hears.
    posed
        The case posed for it.
    """
    ratio = case.winch.gearbox.ratio
    items = [
        Item(
            name="gear ratio",
            kind="gear",
            value=ratio,
            unit="",
            better=0,
            step=0.1 * ratio,
            changes=lambda f: {"winch.gearbox.ratio": ratio * f},
        )
    ]
    if case.limits.drive == "enforce":
        torque = case.winch.drive.torque_continuous
        items.append(
            Item(
                name="motor, all of it",
                kind="drive",
                value=torque,
                unit="N m",
                better=1,
                step=1e3,
                changes=lambda f: motor_changes(case, f),
            )
        )
    if any(name.startswith("payload.") for name in heard):
        items += _payload_items(case, heard)
    if any(name.startswith("mru.") for name in heard) and case.sensors.mru is not None:
        items += _mru_items(case, posed)
    cell = case.sensors.load_cell
    if "rope.tension" in heard and cell is not None:
        share = cell.noise_fraction
        path = "sensors.load_cell.noise_fraction"
        items.append(_scaled("load cell noise", "sensor", path, share, "", -1, 0.01))
        width = cell.bandwidth
        path = "sensors.load_cell.bandwidth"
        items.append(_scaled("load cell bandwidth", "sensor", path, width, "rad/s", 1, 10.0))
    return items


def _payload_items(case: Case, heard: Sequence[str]) -> list[Item]:
    link, sensor = case.sensors.telemetry, case.sensors.payload
    delay = "sensors.telemetry.delay"
    items = [_scaled("telemetry delay", "link", delay, link.delay, "s", -1, 0.01)]
    if link.bandwidth is not None:
        path = "sensors.telemetry.bandwidth"
        items.append(_scaled("telemetry bandwidth", "link", path, link.bandwidth, "rad/s", 1, 10.0))
    if sensor.bandwidth != "perfect":
        path = "sensors.payload.bandwidth"
        width = float(sensor.bandwidth)
        items.append(_scaled("payload sensor bandwidth", "sensor", path, width, "rad/s", 1, 10.0))
    for name in _NOISE:
        value = float(getattr(sensor, f"{name}_noise"))
        if value > 0.0 and f"payload.{name}" in heard:
            path = f"sensors.payload.{name}_noise"
            step = 0.1 * value
            items.append(_scaled(f"payload {name} noise", "sensor", path, value, "", -1, step))
    return items


def _mru_items(case: Case, posed: Posed) -> list[Item]:
    mru = case.sensors.mru
    assert mru is not None
    heave = float(posed.question.question.hook.displacement.rms)
    error = max(mru.noise_floor, mru.noise_fraction * heave)
    floor, share = mru.noise_floor, mru.noise_fraction
    items = []
    if error > 0.0:
        items.append(
            Item(
                name="MRU error",
                kind="sensor",
                value=error,
                unit="m",
                better=-1,
                step=0.01,
                changes=lambda f: {
                    "sensors.mru.noise_floor": floor * f,
                    "sensors.mru.noise_fraction": share * f,
                },
            )
        )
    items.append(_scaled("MRU delay", "sensor", "sensors.mru.delay", mru.delay, "s", -1, 0.01))
    if mru.heave_filter_period is not None:
        path, period = "sensors.mru.heave_filter_period", mru.heave_filter_period
        items.append(_scaled("MRU heave filter", "sensor", path, period, "s", 0, 10.0))
    return items


def _scaled(
    name: str, kind: str, path: str, value: float, unit: str, better: int, step: float
) -> Item:
    return Item(
        name=name,
        kind=kind,
        value=value,
        unit=unit,
        better=better,
        step=step,
        changes=lambda factor: {path: value * factor},
    )
