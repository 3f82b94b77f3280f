"""Weather windows: how often, for how long and after what wait an operation can be done.

    study, series of seas, planned time, contingency, alpha, heading
        -> limit of each record -> works or not -> windows -> by month -> WeatherWindows

A record stands for the sea until the next one, and for its usual step before a gap of more than
three hours; such a gap ends a window.  A window is a time without a break in which H_s stays at or
below alpha times the limit at the record's own T_p and heading, for T_R = T_POP + T_C or longer.
The wait at a record is the time until the first moment from which so much of a window is left.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from models.basics import (
    BoolArray,
    FloatArray,
    InputError,
    ReadOnlyArrays,
    check_range,
    parse_quantity,
)
from models.sea import LONGEST_GAP, SeaSeries

from .alpha import Alpha, alpha_factor
from .depths import STAGES
from .limiting import LOWEST
from .recheck import evaluate_in
from .record_limits import VesselHeading, known_directions, limits_at
from .result import Operability

if TYPE_CHECKING:
    from pathlib import Path

    import xarray as xr

HOUR = 3600.0
LONGEST = 72.0 * HOUR  #: Longest T_R that windows are counted for [s].
LEAST_WINDOWS = 30  #: Windows of a month below which its 90 % wait is not told.
QUANTILES = (0.1, 0.5, 0.9)  #: Of the wait.
_FORMAT = "stillhook weather windows 1"
_ROUND = 1e-9


@dataclass(frozen=True, kw_only=True)
class Spell:
    """Figures of weather windows over a month of all years, or over everything."""

    month: int | None  #: 1 to 12; None for all months together.
    hours: float  #: Time that records stand for [s].
    workable: float  #: Share of it in which the limit is kept [-].
    inside: float  #: Share of it within windows [-].
    count: int  #: Windows that begin in it.
    mean_length: float  #: Mean length of these [s]; NaN without any.
    longest: float  #: The longest of them [s]; NaN without any.
    mean_wait: float  #: Mean wait [s].
    #: The wait that is not exceeded in 10, 50 and 90 % of the time [s]; NaN for the last where
    #: fewer than `LEAST_WINDOWS` windows say it.
    waits: tuple[float, float, float]
    #: Share of the time whose wait the end of the series cuts off [-]: it counts as far as it goes.
    cut_off: float


@dataclass(frozen=True, kw_only=True)
class RecordCheck:
    """One record of a series, evaluated by itself."""

    #: The sea: its time, T_p [s], heading [rad] or None, the limiting H_s that was looked up [m].
    time: np.datetime64
    period: float
    heading: float | None
    limit: float
    criterion: str  #: What binds there, by the single evaluation.
    use: float  #: How much of its bound is used in that sea, by the single evaluation [-].

    @property
    def difference(self) -> float:
        """Relative distance of what binds from its bound, where it should be at it [-]."""
        return abs(self.use - 1.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class SystemWindows(ReadOnlyArrays):
    """What the seas of a series are to one system, as the drum held or the design."""

    limit: FloatArray  #: Limiting H_s of each record, before alpha (n,) [m].
    allowed: FloatArray  #: The same times alpha (n,) [m]; NaN where nothing is known.
    #: Where the waves travel to, counter-clockwise from the bow (n,) [rad]; NaN without headings.
    heading: FloatArray
    binding: npt.NDArray[np.str_]  #: Name of the criterion that sets the limit (n,).


@dataclass(frozen=True, kw_only=True, eq=False)
class WeatherWindows:
    """Weather windows of an operation in a series of seas."""

    case: str  #: Name of the case.
    seas: SeaSeries  #: The records that were counted, of n.
    planned: float  #: T_POP [s].
    contingency: float  #: T_C [s].
    heading: str  #: How the vessel lies, in words.
    alpha: str  #: The alpha factor and its source, in words.
    alpha_beyond: float  #: Share of the limits that lie beyond the heights of alpha's table [-].
    criteria: tuple[
        str, ...
    ]  #: What was wanted of the load beside the case's own limits, in words.
    systems: Mapping[str, SystemWindows]  #: By name, as `STAGES` has them.

    @property
    def needed(self) -> float:
        """Least length of a window, T_R = T_POP + T_C [s]."""
        return self.planned + self.contingency

    @property
    def main(self) -> str:
        """Name of the system that matters: the design, or the drum held without one."""
        return "loop" if "loop" in self.systems else "held"

    def works(self, system: str) -> BoolArray:
        """Return in which records the limit is kept (n,)."""
        allowed = self.systems[system].allowed
        known = np.where(np.isfinite(allowed), allowed, -1.0)
        return np.asarray(self.seas.significant_height <= known * (1.0 + _ROUND))

    def windows(self, system: str) -> FloatArray:
        """Return beginning and end of each window, since the first record (w, 2) [s]."""
        found = self._runs(system)
        return found[found[:, 1] - found[:, 0] >= self.needed * (1.0 - _ROUND)]

    def months(self, system: str) -> tuple[Spell, ...]:
        """Return the figures of each month that the series has."""
        return tuple(self._spell(system, int(m)) for m in np.unique(self.seas.month))

    def whole(self, system: str) -> Spell:
        """Return the figures of the whole series."""
        return self._spell(system, None)

    def waits(self, system: str) -> tuple[FloatArray, BoolArray]:
        """Return the wait at each record (n,) [s], and where the series ends before it does."""
        windows, now = self.windows(system), self._seconds
        latest = windows[:, 1] - self.needed  # a start is possible until then
        first = np.searchsorted(latest * (1.0 + _ROUND) + _ROUND, now, side="left")
        cut = first >= len(windows)
        begin = np.append(windows[:, 0], now[-1] + self.seas.spans[-1])[first]
        return np.maximum(begin - now, 0.0), np.asarray(cut)

    @cached_property
    def dataset(self) -> xr.Dataset:
        """Everything as an xarray Dataset; `from_dataset` makes the same of it again."""
        import xarray as xr

        names = list(self.systems)

        def over(name: str, unit: str, text: str) -> Any:
            rows = np.array([getattr(one, name) for one in self.systems.values()])
            return ("system", "time"), rows, {"units": unit, "long_name": text}

        seas, months = self.seas, range(1, 13)
        data: dict[str, Any] = {
            "significant_height": (
                "time", seas.significant_height,
                {"units": "m", "long_name": "significant wave height H_s"},
            ),
            "peak_period": (
                "time", seas.peak_period, {"units": "s", "long_name": "peak period T_p"}
            ),
            "limit": over("limit", "m", "limiting significant wave height, before alpha"),
            "allowed": over("allowed", "m", "limiting significant wave height times alpha"),
            "heading": over("heading", "rad", "where the waves travel to, from the bow"),
        }  # fmt: skip
        bound = np.array([one.binding for one in self.systems.values()]).astype(object)
        data["binding"] = ("system", "time"), bound, {"long_name": "what sets the limit"}
        if seas.direction is not None:
            about = {"units": "rad", "long_name": "where the waves come from, clockwise from north"}
            data["direction"] = "time", seas.direction, about
        for name, unit, text in (
            ("workable", "1", "share of the month that is workable"),
            ("inside", "1", "share of the month within windows"),
            ("count", "1", "windows that begin in the month"),
            ("mean_wait", "s", "mean wait"),
        ):
            rows = np.full((len(names), 12), np.nan)
            for k, system in enumerate(names):
                for spell in self.months(system):
                    rows[k, (spell.month or 1) - 1] = getattr(spell, name)
            data[f"{name}_by_month"] = ("system", "month"), rows, {"units": unit, "long_name": text}
        return xr.Dataset(
            data,
            coords={
                "time": seas.time.astype("datetime64[ns]"),
                "system": names,
                "month": list(months),
            },
            attrs={
                "title": f"Weather windows of {self.case}",
                "format": _FORMAT,
                "case": self.case,
                "planned_time": self.planned,
                "contingency": self.contingency,
                "vessel_heading": self.heading,
                "alpha": self.alpha,
                "alpha_beyond": self.alpha_beyond,
                "criteria": "\n".join(self.criteria),
                "source": seas.source,
                "source_format": seas.file_format,
            },
        )

    @classmethod
    def from_dataset(cls, data: xr.Dataset) -> WeatherWindows:
        """Return the windows of a data set that `dataset` made.

        Raises InputError if it is none.
        """
        about = data.attrs
        if about.get("format") != _FORMAT:
            raise InputError(f"weather windows: the format must be {_FORMAT!r}, got "
                             f"{about.get('format')!r}")  # fmt: skip
        seas = SeaSeries.from_arrays(
            data["time"].values,
            data["significant_height"].values,
            data["peak_period"].values,
            data["direction"].values if "direction" in data else None,
            source=str(about["source"]),
            file_format=str(about["source_format"]),
        )
        systems = {
            str(name): SystemWindows(
                **{
                    field: np.asarray(data[field].sel(system=name).values, dtype=np.float64)
                    for field in ("limit", "allowed", "heading")
                },
                binding=data["binding"].sel(system=name).values.astype(str),
            )
            for name in data["system"].values
        }
        return cls(
            case=str(about["case"]),
            seas=seas,
            planned=float(about["planned_time"]),
            contingency=float(about["contingency"]),
            heading=str(about["vessel_heading"]),
            alpha=str(about["alpha"]),
            alpha_beyond=float(about["alpha_beyond"]),
            criteria=tuple(str(about["criteria"]).split("\n")) if about["criteria"] else (),
            systems=systems,
        )

    def __str__(self) -> str:
        """Return a small tree."""
        lines = [
            f"Weather windows of {self.case}: {self.needed / HOUR:g} h ({self.planned / HOUR:g} h "
            f"planned, {self.contingency / HOUR:g} h contingency), {len(self.seas)} records"
        ]
        for name in self.systems:
            found = self.whole(name)
            lines.append(
                f"  {STAGES[name]}: workable {100.0 * found.workable:.1f} % of the time, "
                f"{found.count} windows, {100.0 * found.inside:.1f} % of the time, mean wait "
                f"{found.mean_wait / HOUR:.0f} h"
            )
        marks = ["", *["├ "] * (len(lines) - 2), "└ "]
        return "\n".join(mark + line for mark, line in zip(marks, lines, strict=True))

    @property
    def _seconds(self) -> FloatArray:
        """Times since the first record (n,) [s]."""
        return np.asarray((self.seas.time - self.seas.time[0]).astype(np.float64))

    def _runs(self, system: str) -> FloatArray:
        """Return beginning and end of every time without a break that is workable (r, 2) [s]."""
        works, begin = self.works(system), self._seconds
        end = begin + self.seas.spans
        joined = np.append(np.diff(begin) <= LONGEST_GAP, False)
        starts = works & ~np.insert((works & joined)[:-1], 0, False)
        stops = works & ~(joined & np.append(works[1:], False))
        return np.column_stack([begin[starts], end[stops]])

    def _spell(self, system: str, month: int | None) -> Spell:
        seas, spans = self.seas, self.seas.spans
        mine = np.ones(len(seas), dtype=np.bool_) if month is None else seas.month == month
        share = spans[mine] / spans[mine].sum()
        windows, now = self.windows(system), self._seconds
        place = np.searchsorted(windows[:, 0], now, side="right") - 1
        within = (place >= 0) & (now < np.append(windows[:, 1], 0.0)[place])
        at = np.searchsorted(now, windows[:, 0])
        begun = windows[mine[at]]
        lengths = begun[:, 1] - begun[:, 0]
        waits, cut = self.waits(system)
        waits, cut = waits[mine], cut[mine]
        order = np.argsort(waits, kind="stable")
        grown = np.cumsum(share[order])
        found = [
            float(
                waits[order][min(int(np.searchsorted(grown, q * (1.0 - _ROUND))), waits.size - 1)]
            )
            for q in QUANTILES
        ]
        if len(begun) < LEAST_WINDOWS and month is not None:
            found[-1] = math.nan
        return Spell(
            month=month,
            hours=float(spans[mine].sum()),
            workable=float(share @ self.works(system)[mine]),
            inside=float(share @ within[mine]),
            count=len(begun),
            mean_length=float(lengths.mean()) if lengths.size else math.nan,
            longest=float(lengths.max()) if lengths.size else math.nan,
            mean_wait=float(share @ waits),
            waits=(found[0], found[1], found[2]),
            cut_off=float(share @ cut),
        )


def weather_windows(
    study: Operability,
    seas: SeaSeries,
    duration: float | str,
    *,
    contingency: float | str | None = None,
    heading: VesselHeading | None = None,
    alpha: float | str | Path = 1.0,
    forecast_level: str | None = None,
) -> WeatherWindows:
    """Return the weather windows of an operation in a series, before and after compensation.

    Parameters
    ----------
    study
        The contours, best of ``operability(..., seas=...)``, which reach every sea of the series;
        where there are several lengths of rope, the one nearest the case's counts.
    seas
        H_s, T_p and direction in time.
    duration
        The planned time T_POP, in s or text with a unit.
    contingency
        The contingency time T_C; as long as the planned time if left out.
    heading
        How the vessel lies; as the case has it if left out.
    alpha
        Factor on the limiting H_s, or a table of it; see `alpha_factor`.
    forecast_level
        Level of the forecast in that table.

    Raises
    ------
    InputError
        If T_R = T_POP + T_C is above 72 h, a value is out of range, the records are more than three
        hours apart, or directions or headings are wanted that are not there.
    """
    planned, spare = window_times(duration, contingency)
    if math.isnan(seas.usual_step):
        raise InputError(
            f"{seas.source}: records must be at most {LONGEST_GAP / HOUR:g} h apart for weather "
            f"windows; no two of the {len(seas)} are"
        )
    at, rule = study.own_depth, heading or VesselHeading()
    if at.main.headings is None and (rule.bow is not None or rule.within):
        raise InputError(
            f"{study.case.label}: vessel: has no headings, as it is given by the heave of its hook "
            "alone; give raos for a vessel's heading"
        )
    counted = known_directions(seas, rule)
    factor: Alpha = alpha_factor(alpha, planned, forecast_level)
    relative, systems = rule.relative(counted, study.case), {}
    for name, contour in at.fine.items():
        limit, turned, binding = limits_at(contour, counted, relative)
        systems[name] = SystemWindows(
            limit=limit, allowed=factor(limit) * limit, heading=turned, binding=binding
        )
    main = systems.get("loop", systems["held"])
    return WeatherWindows(
        case=study.case.name,
        seas=counted,
        planned=planned,
        contingency=spare,
        heading=str(rule) if at.main.headings is not None else "none: the vessel has no headings",
        alpha=factor.text,
        alpha_beyond=factor.beyond(main.limit),
        criteria=tuple(f"{c.name} {c.bound:.6g} {c.unit}".rstrip() for c in study.wanted),
        systems=systems,
    )


def recheck_records(
    study: Operability, windows: WeatherWindows, count: int
) -> tuple[RecordCheck, ...]:
    """Return what the design does in the seas of records whose H_s is nearest the limit.

    Each is put into the case at the limiting H_s that was looked up for it, and evaluated by
    itself.  Nothing without a design, or of records that no limit binds.
    """
    if study.design is None or "loop" not in windows.systems:
        return ()
    at, own, seas = study.own_depth, windows.systems["loop"], windows.seas
    criteria = [c for c in at.contours["loop"].criteria if c.outputs]
    with np.errstate(divide="ignore", invalid="ignore"):
        away = np.abs(np.log(seas.significant_height / own.allowed))
    usable = np.isfinite(away) & (own.limit > LOWEST) & (own.limit < at.main.highest)
    usable &= own.binding != "stability"
    found = []
    for k in np.argsort(np.where(usable, away, np.inf), kind="stable")[: min(count, usable.sum())]:
        heading = None if np.isnan(own.heading[k]) else float(own.heading[k] % math.tau)
        sea: dict[str, float] = {"sea.significant_height": float(own.limit[k])}
        sea |= {} if heading is None else {"vessel.heading": heading}
        period = at.case.sea.peaking_at(float(seas.peak_period[k]))
        loop = evaluate_in(study.design, at.case.variant(period).replace(sea), at.masses)
        uses = {c.name: c.use(c.worst(loop)) for c in criteria}
        worst = max(uses, key=lambda name: uses[name])
        found.append(
            RecordCheck(
                time=seas.time[k],
                period=float(seas.peak_period[k]),
                heading=heading,
                limit=float(own.limit[k]),
                criterion=worst,
                use=uses[worst],
            )
        )
    return tuple(found)


def window_times(
    duration: float | str, contingency: float | str | None = None
) -> tuple[float, float]:
    """Return T_POP and T_C [s], the second as long as the first where it is None.

    Raises InputError if one is out of range, or their sum above 72 h.
    """
    planned = _time("duration", duration)
    spare = planned if contingency is None else _time("contingency", contingency, zero=True)
    needed = planned + spare
    if needed > LONGEST * (1.0 + _ROUND):
        raise InputError(
            f"operability: the window T_R = T_POP + T_C must be at most {LONGEST / HOUR:g} h, got "
            f"{planned / HOUR:g} h + {spare / HOUR:g} h = {needed / HOUR:g} h"
        )
    return planned, spare


def _time(name: str, value: float | str, *, zero: bool = False) -> float:
    try:
        seconds = parse_quantity(value, "time")
    except (ValueError, TypeError) as error:
        raise InputError(f"operability: {name}: {error}") from None
    return check_range("operability", name, seconds, low=0.0, unit="s", open_low=not zero)
