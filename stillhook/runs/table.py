"""Tables of runs: one quantity a row, a mean and its 95 % interval for each controller.

    Runs, or several to compare --> rows --> Tables, one for each group of quantities

All cells of a row are in the same unit, so that they can be compared.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from models.basics import Interval, Share, share
from models.case import Case

from ..text import Column, Table, Written, columns, duration, number, quantity, scale
from .runs import FINER_SNAP, Runs, main_quantity

_KWH = 3.6e6  # [J]
_UNITS = {"rad/s": "rpm"}  # motors are rated in rpm
_LONG = 11  # characters of a heading that is not broken

# Quantities of `models.run.summary` by group: name, label, key of the note beside it.
_Listed = tuple[str, str, str]
_STAYS: tuple[_Listed, ...] = (
    ("payload rms", "payload, rms", ""),
    ("payload significant", "significant height", ""),
    ("tracking error largest", "largest displacement", "from its place"),
)
_MOVES: tuple[_Listed, ...] = (
    ("tracking error rms", "payload's error, rms", "from what is asked"),
    ("tracking error largest", "largest error", ""),
)
_RESIDUAL: tuple[_Listed, ...] = (
    ("residual", "residual", "of the hook's motion"),
    ("attenuation", "attenuation", ""),
)
_LANDS: tuple[_Listed, ...] = (
    ("error before touch-down rms", "error before touchdown", "rms, from what is asked"),
    ("error before touch-down largest", "largest before touchdown", ""),
    ("touch-down speed", "touchdown speed", "the first"),
    ("hardest touch-down", "hardest touchdown", ""),
    ("touch-downs", "touchdowns", ""),
)
_HOOK: tuple[_Listed, ...] = (("hook rms", "hook, rms", ""),)
_DRIVE: tuple[_Listed, ...] = (
    ("motor speed largest", "motor speed, largest", "speed"),
    ("motor torque rms", "motor torque, rms", "rating"),
    ("motor torque thermal equivalent", "motor torque, thermal", "rating"),
    ("motor torque largest", "motor torque, largest", "peak"),
    ("saturated share", "drive saturated", "of the time"),
    ("motor power mean", "power, mean", ""),
    ("motor power largest", "power, largest", "power"),
    ("regenerated power largest", "power fed back, largest", ""),
    ("energy per hour, net", "energy, net", "in an hour"),
    ("motor temperature rise largest", "motor's temperature rise", ""),
)
_ROPE: tuple[_Listed, ...] = (
    ("rope tension largest", "rope tension, largest", "tension"),
    ("rope tension smallest", "rope tension, least", "least"),
    ("slack share", "rope slack", "of the time"),
    ("snap load", "snap load", "after slack"),
    (FINER_SNAP, "the largest on 40 masses", "the same seed again"),
    ("drum haul lowest", "drum haul, lowest", "stroke"),
    ("drum haul highest", "drum haul, highest", "stroke"),
)
_EXTREMES = {
    "payload up": "payload highest",
    "payload down": "payload lowest",
    "rope tension": "largest tension",
}


class Estimate(NamedTuple):
    """A figure with the ends of its 95 % interval, in the row's unit; NaN where there is none."""

    mean: float = math.nan
    low: float = math.nan
    high: float = math.nan


_NONE = Estimate()


@dataclass(frozen=True)
class QuantityRow:
    """One quantity, for each of the runs that are compared."""

    group: str  #: What it is about: "payload", "drive", "rope", or "most probable in 3 h".
    name: str  #: Name in the summary of the runs.
    label: str  #: What people call it.
    unit: str  #: SI unit, or what `quantities.scale` makes of it.
    figures: tuple[Estimate, ...]  #: One for each.
    note: str = ""  #: A remark, such as the limit.

    @property
    def shown_unit(self) -> str:
        """The unit that the cells are in."""
        return self._scale[1]

    def cell(self, at: int) -> str:
        """Return a mean as text, without its unit; nothing if there is none."""
        mean = self.figures[at].mean
        return "" if math.isnan(mean) else number(mean / self._scale[0])

    def interval(self, at: int) -> str:
        """Return an interval as text, nothing if there is none."""
        (_, low, high), factor = self.figures[at], self._scale[0]
        if math.isnan(low) or math.isnan(high):
            return ""
        if math.isinf(high):  # nothing speaks against any more: a single loss, at once
            return f"at least {number(low / factor)}"
        return f"{number(low / factor)} to {number(high / factor)}"

    @property
    def _scale(self) -> tuple[float, str]:
        sizes = [abs(f.mean) for f in self.figures if math.isfinite(f.mean)]
        size = max(sizes, default=0.0)
        return scale(self.unit, size) if size > 0.0 else (1.0, self.unit)


def tables_of(compared: Sequence[Runs]) -> list[Table]:
    """Return a table for each group of quantities, of one controller or of several."""
    groups: dict[str, list[QuantityRow]] = {}
    for row in rows_of(compared):
        groups.setdefault(row.group, []).append(row)
    if len(compared) > 1:
        return [_beside(group, rows, compared) for group, rows in groups.items()]
    several = len(compared[0].judged) > 1
    mean, interval = ("mean", "95 % interval") if several else ("", "")
    heads = columns(f"quantity=; mean={mean}; interval={interval}; note=<")
    return [
        Table(
            title=group,
            columns=heads,
            rows=[
                (
                    row.label,
                    Written(row.figures[0].mean, f"{row.cell(0)} {row.shown_unit}".strip()),
                    row.interval(0),
                    row.note,
                )
                for row in rows
            ],
        )
        for group, rows in groups.items()
    ]


def _beside(group: str, rows: Sequence[QuantityRow], compared: Sequence[Runs]) -> Table:
    """Return means side by side, and the intervals of what tells controllers apart."""
    every, cells = range(len(compared)), []
    for place, row in enumerate(rows):
        unit = f" [{row.shown_unit}]" if row.shown_unit else ""
        means = (Written(row.figures[at].mean, row.cell(at) or "-") for at in every)
        cells.append((f"{row.label}{unit}", *means))
        intervals = [row.interval(at).replace(" to ", " to\n") for at in every]
        if group == "payload" and place == 0 and any(intervals):
            cells.append(("  95 % interval", *intervals))
    names = [runs.controller for runs in compared]
    heads = [name if len(name) <= _LONG else name.replace("-", "-\n") for name in names]
    columns = (Column("quantity", ""), *map(Column, names, heads))
    return Table(title=group, columns=columns, rows=cells)


def rows_of(compared: Sequence[Runs]) -> list[QuantityRow]:
    """Return the rows of a table of one or more controllers on the same case and scenario."""
    first = compared[0]
    if main_quantity(compared) == _LANDS[0][0]:
        # What is asked after touchdown is below the ground: nobody can follow.
        where = _LANDS
    else:
        where = (*(_STAYS if first.stays else _MOVES), *_RESIDUAL)
    rows = _quantities(compared, "payload", (*where, *_HOOK))
    rows += _against_none(compared)
    beyond = "" if first.lock_limit is None else f"beyond {quantity(first.lock_limit, 'm')}"
    rows += _shares(compared, "payload", "lost lock", "runs that lost lock", beyond)
    rows += _fall_times(compared)
    rows += _trips(compared)
    rows += _quantities(compared, "drive", _DRIVE)
    rope = _quantities(compared, "rope", _ROPE)
    slack = _shares(compared, "rope", "slack", "runs with slack rope", "")
    return rows + rope + slack + _extremes(compared)


def _quantities(
    compared: Sequence[Runs], group: str, wanted: Sequence[_Listed]
) -> list[QuantityRow]:
    rows = []
    for name, label, note in wanted:
        intervals = [runs.summary.means.get(name) for runs in compared]
        found = next((i for i in intervals if i is not None and i.count), None)
        if found is None:
            continue
        factor, unit = (_KWH, "kWh") if found.unit == "J/h" else (1.0, found.unit)
        rows.append(
            QuantityRow(
                group,
                name,
                label,
                _UNITS.get(unit, unit),
                tuple(_estimate(interval, factor) for interval in intervals),
                _note(note, compared[0].case),
            )
        )
    return rows


def _against_none(compared: Sequence[Runs]) -> list[QuantityRow]:
    """Return what is left of the payload's motion with the brake on, where that was simulated."""
    from models.run import Summary

    held = next((runs for runs in compared if runs.controller == "none"), None)
    if held is None or len(compared) < 2 or not held.stays:
        return []
    figures = []
    before = {run.seed: run for run in held.judged}
    for runs in compared:
        pairs = [(run, before[run.seed]) for run in runs.judged if run.seed in before]
        if runs is held or not pairs:
            figures.append(_NONE)
            continue
        both = Summary.of([run for run, _ in pairs], held=[other for _, other in pairs])
        figures.append(_estimate(both.means["residual held"]))
    note = "of the payload's with the drum held"
    return [
        QuantityRow("payload", "residual held", "residual, drum held", "%", tuple(figures), note)
    ]


def _shares(
    compared: Sequence[Runs], group: str, name: str, label: str, note: str
) -> list[QuantityRow]:
    shares = [runs.summary.shares.get(name) for runs in compared]
    if all(found is None for found in shares):
        return []
    return [QuantityRow(group, name, label, "%", tuple(map(_percentage, shares)), note)]


def _fall_times(compared: Sequence[Runs]) -> list[QuantityRow]:
    """Return how long lock is kept on average, where any run has lost it."""
    times = [runs.summary.fall_time for runs in compared]
    if not any(time is not None and time.falls for time in times):
        return []
    figures = tuple(Estimate(*time.mean) if time and time.falls else _NONE for time in times)
    label, note = "time to loss of lock", "mean, at a constant rate"
    return [QuantityRow("payload", "fall time", label, "s", figures, note)]


def _trips(compared: Sequence[Runs]) -> list[QuantityRow]:
    """Return how often the brake ended the controller's work, where it did at all."""
    if not any(runs.tripped for runs in compared):
        return []
    shares = tuple(_percentage(share(runs.tripped, len(runs.judged))) for runs in compared)
    label, note = "runs ended by the brake", "the drum left its range"
    return [QuantityRow("payload", "tripped", label, "%", shares, note)]


def _extremes(compared: Sequence[Runs]) -> list[QuantityRow]:
    rows = []
    group = f"most probable in {duration(compared[0].case.limits.exposure_time)}"
    for name, label in _EXTREMES.items():
        found = [runs.extremes[name] if runs.extremes else None for runs in compared]
        known = [e for e in found if e is not None and not math.isnan(e.value)]
        if not known:
            continue
        unit = "N" if name == "rope tension" else "m"
        note = f"Rayleigh {quantity(known[0].rayleigh, unit)}" if len(compared) == 1 else ""
        figures = tuple(Estimate(e.value, e.low, e.high) if e else _NONE for e in found)
        rows.append(QuantityRow(group, f"{name}, gumbel", f"{label}, Gumbel", unit, figures, note))
    return rows


def _percentage(found: Share | None) -> Estimate:
    return Estimate(*(100.0 * x for x in (found.value, found.low, found.high))) if found else _NONE


def _estimate(interval: Interval | None, factor: float = 1.0) -> Estimate:
    if interval is None or not interval.count:
        return _NONE
    return Estimate(*(x / factor for x in (interval.mean, interval.low, interval.high)))


def _note(key: str, case: Case) -> str:
    """Return a remark: the limit that a key stands for, or the key itself."""
    drive, limits = case.winch.drive, case.limits
    stroke = limits.stroke
    bounds = {
        "speed": (case.winch.speed_limit, "rpm", "limit"),
        "rating": (drive.torque_continuous, "N m", "rating"),
        "peak": (drive.torque_peak, "N m", "limit"),
        "power": (case.winch.power_limit, "W", "limit"),
        "tension": (limits.rope_tension_peak, "N", "limit"),
        "least": (case.least_tension, "N", "limit"),
    }
    if key == "stroke":
        return "" if stroke is None else f"stroke {stroke[0]:g} to {stroke[1]:g} m"
    if key not in bounds:
        return key
    value, unit, word = bounds[key]
    known = value is not None and math.isfinite(value)
    return f"{word} {quantity(value or 0.0, unit)}" if known else ""
