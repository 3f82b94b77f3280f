"""Figures of weather windows: by month, and in time as a calendar."""

import math
from pathlib import Path

import numpy as np

from models.basics import FloatArray
from synth.operability import HOUR, WeatherWindows

from ..text import AFTER, BEFORE, REFERENCE, Figure, drawn, duration, headline, new_figure

_SYSTEMS = {"held": (BEFORE, "drum held"), "loop": (AFTER, "with the design")}
_DAY = 24.0 * HOUR
_PALE = 0.35  # of what is workable but too short


@drawn
def months_figure(windows: WeatherWindows) -> Figure:
    """Return share, number of windows and wait by month, before and after compensation."""
    names = [name for name in _SYSTEMS if name in windows.systems]
    figure = new_figure(8.4, 7.0)
    share, count, wait = figure.subplots(3, 1, sharex=True, height_ratios=(3, 2, 3))
    width = 0.8 / len(names)
    for k, name in enumerate(names):
        colour, label = _SYSTEMS[name]
        months = windows.months(name)
        x = np.array([one.month or 0 for one in months]) - 0.4 + (k + 0.5) * width
        workable = [100.0 * m.workable for m in months]
        share.bar(x, workable, width=0.92 * width, color=_mixed(colour))
        inside = [100.0 * m.inside for m in months]
        share.bar(x, inside, width=0.92 * width, color=colour, label=label)
        count.bar(x, [m.count for m in months], width=0.92 * width, color=colour)
        mean = [m.mean_wait / _DAY for m in months]
        low, middle, high = np.array([m.waits for m in months]).T / _DAY
        style = {"color": colour, "linestyle": "none"}
        wait.plot(x, mean, marker="o", markersize=5.0, **style)
        wait.plot(x, middle, marker="_", markersize=11.0, markeredgewidth=2.0, **style)
        wait.plot(x, low, marker="_", markersize=6.0, **style)
        wait.plot(x, high, marker="_", markersize=6.0, **style)
        wait.vlines(x, low, np.where(np.isnan(high), np.maximum(mean, middle), high), color=colour)
        open_ = [not math.isclose(m.cut_off, 0.0, abs_tol=1e-9) for m in months]
        wait.plot(x[open_], np.array(mean)[open_], marker="^", markersize=9.0, mfc="none", **style)
    share.set_ylabel("share of the month [%]")
    share.set_ylim(0.0, 125.0)  # with room for the legend
    share.set_yticks(range(0, 101, 20))
    share.bar([0.0], [0.0], color=_mixed(REFERENCE), label="pale: workable, but too short")
    share.legend(loc="upper left", fontsize=8.5, ncols=len(names) + 1)
    count.set_ylabel("windows")
    wait.set_ylabel("wait [days]")
    wait.set_ylim(bottom=0.0)
    wait.set_xlim(0.4, 12.6)
    wait.set_xticks(range(1, 13), list("JFMAMJJASOND"))
    text = "dot: mean; strokes: 10, 50, 90 %; triangle: at least, the series ends before"
    wait.set_xlabel(text, fontsize=8.5)
    for axes in (share, count, wait):
        axes.grid(axis="x", visible=False)
    return headline(figure, _finding(windows), _about(windows))


@drawn
def calendar_figure(windows: WeatherWindows) -> Figure:
    """Return when work is possible, hour by hour: a row for each month, the days across.

    Of several years it is the one with the most records.
    """
    from matplotlib.colors import ListedColormap, to_rgb
    from matplotlib.patches import Patch

    names = [name for name in _SYSTEMS if name in windows.systems]
    years = windows.seas.time.astype("datetime64[Y]")
    values, counts = np.unique(years, return_counts=True)
    year = values[int(counts.argmax())]
    figure = new_figure(9.6, 1.0 + 3.0 * len(names))
    panels = np.atleast_1d(figure.subplots(len(names), 1, sharex=True))
    for axes, name in zip(panels, names, strict=True):
        colour, label = _SYSTEMS[name]
        shades = ListedColormap([to_rgb(c) for c in ("#ffffff", "#d9d9d9", _mixed(colour), colour)])
        axes.imshow(
            _hours(windows, name, year),
            cmap=shades,
            vmin=-0.5,
            vmax=3.5,
            aspect="auto",
            interpolation="nearest",
            extent=(1.0, 32.0, 12.5, 0.5),
        )
        axes.set_yticks(range(1, 13), list("JFMAMJJASOND"))
        axes.grid(visible=False)
        handles = [
            Patch(color=colour, label=f"window of {duration(windows.needed)} or longer"),
            Patch(color=_mixed(colour), label="workable, but too short"),
            Patch(color="#d9d9d9", label="not workable"),
        ]
        title = f"{label}: {len(windows.windows(name))}"
        axes.legend(
            handles=handles, title=title, loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8.5
        )
    panels[-1].set_xlabel(f"day of the month, {year}")
    panels[-1].set_xticks(range(1, 32, 5))
    return headline(figure, _finding(windows), _about(windows))


def _hours(windows: WeatherWindows, name: str, year: np.datetime64) -> FloatArray:
    """Return what each hour of a year is (12, 744): 0 unknown, 1 no, 2 too short, 3 a window."""
    seas, works = windows.seas, windows.works(name)
    now = (seas.time - seas.time[0]).astype(np.float64)
    found = np.zeros((12, 31 * 24))
    for month in range(12):
        first = (year.astype("datetime64[M]") + month).astype("datetime64[h]")
        last = (year.astype("datetime64[M]") + month + 1).astype("datetime64[h]")
        hours = np.arange(first, last)
        middle = (hours.astype("datetime64[s]") - seas.time[0]).astype(np.float64) + 0.5 * HOUR
        k = np.searchsorted(now, middle, side="right") - 1
        known = (k >= 0) & (middle < (now + seas.spans)[k])
        windows_ = windows.windows(name)
        w = np.searchsorted(windows_[:, 0], middle, side="right") - 1
        inside = (w >= 0) & (middle < np.append(windows_[:, 1], 0.0)[w])
        state = np.where(inside, 3.0, np.where(works[k], 2.0, 1.0))
        found[month, : hours.size] = np.where(known, state, 0.0)
    return found


def _mixed(colour: str) -> tuple[float, float, float]:
    from matplotlib.colors import to_rgb

    red, green, blue = to_rgb(colour)
    return tuple(1.0 - _PALE + _PALE * c for c in (red, green, blue))  # type: ignore[return-value]


def _finding(windows: WeatherWindows) -> str:
    main = windows.whole(windows.main)
    text = f"{main.count} windows of {duration(windows.needed)} or longer"
    if windows.main == "loop":
        text += f", {windows.whole('held').count} with the drum held"
    return f"{text}; mean wait {main.mean_wait / _DAY:.1f} days"


def _about(windows: WeatherWindows) -> str:
    first, last = (str(time).partition("T")[0] for time in windows.seas.time[[0, -1]])
    return f"{windows.case}: {Path(windows.seas.source).name}, {first} to {last}, {windows.heading}"
