"""What there is to say about runs, in figures: one table for terminal and report.

    Runs, or several to compare --> rows --> `stillhook.runs.terminal`, `stillhook.runs.report`

A row is one quantity, with a mean and its 95 % interval for each controller; all cells of a row
are in the same unit, so that they can be compared.  Nothing here decides how it looks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from models.basics import Interval, Share, share
from models.case import Case
from models.run import ExtremeEstimate

from ..text import duration, number, quantity, scale
from .runs import Runs

_KWH = 3.6e6  # [J]
_UNITS = {"rad/s": "rpm"}  # motors are rated in rpm

# Quantities of `models.run.summary` by group: name, label, key of the note beside it.
_Wanted = tuple[str, str, str]
_STAYS: tuple[_Wanted, ...] = (
    ("payload rms", "payload, rms", ""),
    ("payload significant", "significant height", ""),
    ("tracking error largest", "largest displacement", "from its place"),
)
_MOVES: tuple[_Wanted, ...] = (
    ("tracking error rms", "payload's error, rms", "from what is asked"),
    ("tracking error largest", "largest error", ""),
)
_RESIDUAL: tuple[_Wanted, ...] = (
    ("residual", "residual", "of the hook's motion"),
    ("attenuation", "attenuation", ""),
)
_LANDS: tuple[_Wanted, ...] = (
    ("error before touch-down rms", "error before touchdown", "rms, from what is asked"),
    ("error before touch-down largest", "largest before touchdown", ""),
    ("touch-down speed", "touchdown speed", "the first"),
    ("hardest touch-down", "hardest touchdown", ""),
    ("touch-downs", "touchdowns", ""),
)
_HOOK: tuple[_Wanted, ...] = (("hook rms", "hook, rms", ""),)
_DRIVE: tuple[_Wanted, ...] = (
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
_ROPE: tuple[_Wanted, ...] = (
    ("rope tension largest", "rope tension, largest", "tension"),
    ("rope tension smallest", "rope tension, least", "least"),
    ("slack share", "rope slack", "of the time"),
    ("snap load", "snap load", "after slack"),
    ("drum haul lowest", "drum haul, lowest", "stroke"),
    ("drum haul highest", "drum haul, highest", "stroke"),
)
_EXTREMES = {
    "payload up": "payload highest",
    "payload down": "payload lowest",
    "rope tension": "largest tension",
}
_METHODS = {"gumbel": "Gumbel", "pareto": "peaks"}  # over a threshold


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A figure with the ends of its 95 % interval, in the row's unit; NaN where there is none."""

    mean: float = math.nan
    low: float = math.nan
    high: float = math.nan

    @property
    def known(self) -> bool:
        """Whether there is a figure at all."""
        return not math.isnan(self.mean)


@dataclass(frozen=True, kw_only=True)
class TableRow:
    """One quantity, for each of the runs that are compared.

    Attributes
    ----------
    group
        What it is about: "payload", "drive", "rope", or "most probable in 3 h".
    name
        Name in the summary of the runs.
    label
        What people call it.
    unit
        SI unit, or what `quantities.scale` makes of it.
    figures
        One for each.
    note
        A remark, such as the limit.
    """

    group: str
    name: str
    label: str
    unit: str
    figures: tuple[Figure, ...]
    note: str = ""

    @property
    def shown_unit(self) -> str:
        """The unit that the cells are in."""
        return self._scale[1]

    def cell(self, at: int) -> str:
        """Return a mean as text, without its unit; nothing if there is none."""
        figure = self.figures[at]
        return number(figure.mean / self._scale[0]) if figure.known else ""

    def interval(self, at: int) -> str:
        """Return an interval as text, nothing if there is none."""
        figure, factor = self.figures[at], self._scale[0]
        if math.isnan(figure.low) or math.isnan(figure.high):
            return ""
        return f"{number(figure.low / factor)} to {number(figure.high / factor)}"

    def full(self, at: int) -> str:
        """Return a mean with its unit."""
        return f"{self.cell(at)} {self.shown_unit}".strip() if self.figures[at].known else ""

    @property
    def _scale(self) -> tuple[float, str]:
        sizes = [abs(f.mean) for f in self.figures if math.isfinite(f.mean)]
        size = max(sizes, default=0.0)
        return scale(self.unit, size) if size > 0.0 else (1.0, self.unit)


def rows_of(compared: Sequence[Runs]) -> list[TableRow]:
    """Return the rows of a table of one or more controllers on the same case and scenario."""
    first = compared[0]
    if main_quantity(compared) == _LANDS[0][0]:
        # What is asked after touchdown is below the ground: nobody can follow.
        where = _LANDS
    else:
        where = (*(_STAYS if first.stays else _MOVES), *_RESIDUAL)
    rows = _quantities(compared, "payload", (*where, *_HOOK))
    rows += _against_none(compared)
    rows += _shares(compared, "payload", "lost lock", "runs that lost lock", _lock_note(first))
    rows += _fall_times(compared)
    rows += _trips(compared)
    rows += _quantities(compared, "drive", _DRIVE)
    rope = _quantities(compared, "rope", _ROPE)
    slack = _shares(compared, "rope", "slack", "runs with slack rope", "")
    return rows + rope + slack + _extremes(compared)


def main_quantity(compared: Sequence[Runs]) -> str:
    """Return the name of the quantity that tells controllers apart, a standard deviation [m]."""
    if compared[0].stays:
        return _STAYS[0][0]
    name = _LANDS[0][0]
    lands = any(name in runs.summary.means and runs.summary[name].count for runs in compared)
    return name if lands else _MOVES[0][0]


def _quantities(compared: Sequence[Runs], group: str, wanted: Sequence[_Wanted]) -> list[TableRow]:
    rows = []
    for name, label, note in wanted:
        intervals = [runs.summary.means.get(name) for runs in compared]
        found = next((i for i in intervals if i is not None and i.count), None)
        if found is None:
            continue
        factor, unit = (_KWH, "kWh") if found.unit == "J/h" else (1.0, found.unit)
        rows.append(
            TableRow(
                group=group,
                name=name,
                label=label,
                unit=_UNITS.get(unit, unit),
                figures=tuple(_figure(interval, factor) for interval in intervals),
                note=_note(note, compared[0].case),
            )
        )
    return rows


def _against_none(compared: Sequence[Runs]) -> list[TableRow]:
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
            figures.append(Figure())
            continue
        both = Summary.of([run for run, _ in pairs], uncompensated=[other for _, other in pairs])
        figures.append(_figure(both.means["residual of uncompensated"]))
    return [
        TableRow(
            group="payload",
            name="residual of uncompensated",
            label="of the drum held",
            unit="%",
            figures=tuple(figures),
            note="of the payload's motion with the brake on",
        )
    ]


def _shares(
    compared: Sequence[Runs], group: str, name: str, label: str, note: str
) -> list[TableRow]:
    shares = [runs.summary.shares.get(name) for runs in compared]
    if all(found is None for found in shares):
        return []
    figures = tuple(_share_figure(found) for found in shares)
    return [TableRow(group=group, name=name, label=label, unit="%", figures=figures, note=note)]


def _share_figure(found: Share | None) -> Figure:
    if found is None:
        return Figure()
    return Figure(mean=100.0 * found.value, low=100.0 * found.low, high=100.0 * found.high)


def _fall_times(compared: Sequence[Runs]) -> list[TableRow]:
    """Return how long lock is kept on average, where any run has lost it."""
    times = [runs.summary.fall_time for runs in compared]
    if not any(time is not None and time.falls for time in times):
        return []
    figures = []
    for time in times:
        mean, low, high = (math.nan,) * 3 if time is None or not time.falls else time.mean
        figures.append(Figure(mean=mean, low=low, high=high))
    return [
        TableRow(
            group="payload",
            name="fall time",
            label="time to loss of lock",
            unit="s",
            figures=tuple(figures),
            note="mean, at a constant rate",
        )
    ]


def _trips(compared: Sequence[Runs]) -> list[TableRow]:
    """Return how often the brake ended the controller's work, where it did at all."""
    if not any(runs.tripped for runs in compared):
        return []
    shares = [share(runs.tripped, len(runs.judged)) for runs in compared]
    return [
        TableRow(
            group="payload",
            name="tripped",
            label="runs ended by the brake",
            unit="%",
            figures=tuple(_share_figure(each) for each in shares),
            note="the drum left its range",
        )
    ]


def _extremes(compared: Sequence[Runs]) -> list[TableRow]:
    rows = []
    group = f"most probable in {duration(compared[0].case.limits.exposure_time)}"
    for name, label in _EXTREMES.items():
        for method, called in _METHODS.items():
            found = [runs.extremes[name][method] if runs.extremes else None for runs in compared]
            known = [e for e in found if e is not None and not math.isnan(e.value)]
            if not known:
                continue
            unit = "N" if name == "rope tension" else "m"
            note = f"Rayleigh {quantity(known[0].rayleigh, unit)}" if len(compared) == 1 else ""
            rows.append(
                TableRow(
                    group=group,
                    name=f"{name}, {method}",
                    label=f"{label}, {called}",
                    unit=unit,
                    figures=tuple(_extreme_figure(e) for e in found),
                    note=note,
                )
            )
    return rows


def _extreme_figure(estimate: ExtremeEstimate | None) -> Figure:
    if estimate is None:
        return Figure()
    return Figure(mean=estimate.value, low=estimate.low, high=estimate.high)


def _figure(interval: Interval | None, factor: float = 1.0) -> Figure:
    if interval is None or not interval.count:
        return Figure()
    return Figure(
        mean=interval.mean / factor, low=interval.low / factor, high=interval.high / factor
    )


def _lock_note(runs: Runs) -> str:
    return "" if runs.lock_limit is None else f"beyond {quantity(runs.lock_limit, 'm')}"


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
        "least": (limits.minimum_tension, "N", "limit"),
    }
    if key == "stroke":
        return "" if stroke is None else f"stroke {stroke[0]:g} to {stroke[1]:g} m"
    if key not in bounds:
        return key
    value, unit, word = bounds[key]
    known = value is not None and math.isfinite(value)
    return f"{word} {quantity(value or 0.0, unit)}" if known else ""
