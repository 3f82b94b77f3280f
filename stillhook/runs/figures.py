"""The figures of runs over seeds: what is left of the motion, and how often a level is reached.

Each function returns a matplotlib `Figure`; nothing is shown, saved or kept.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from models.basics import FloatArray, InputError, peak_factor
from models.run import ERROR

from ..text import (
    AFTER,
    BEFORE,
    DRUM,
    HOOK,
    REFERENCE,
    Axes,
    Figure,
    decibels,
    drawn,
    duration,
    headline,
    logarithmic,
    panel,
    quantity,
    scale,
)
from .runs import MAIN, Runs, main_quantity

_COLOURS = {"none": BEFORE, "feedback": AFTER, "constant-tension": "#cc79a7"}
_OTHERS = (DRUM, "#56b4e9", "#e69f00", HOOK)
_MARKS = (60.0, 300.0, 1200.0, 3600.0, 10800.0, 36000.0, 86400.0)  # on the axis of time [s]
_DOTS, _LAST = 200, 30  # crests shown: evenly over the axis, and those of the rarest
_SCATTER = 0.16  # of the width of a bar, over which the seeds' dots are spread


@drawn
def comparison(compared: Sequence[Runs]) -> Figure:
    """Return what is left of the motion with each controller: bars, intervals, a dot for each seed.

    Standard deviation of the payload's error [m or mm], logarithmic where controllers differ by
    more than a factor of ten.

    Raises InputError if no run has any statistics.
    """
    name = main_quantity(compared)
    values = [_values(runs, name) for runs in compared]
    known = np.concatenate(values)
    if known.size == 0:
        raise InputError("comparison: no run has come far enough to say anything")
    factor, unit = scale("m", float(known.max()))
    wide = float(known.max()) > 10.0 * float(known.min())
    colours = _colours(compared)
    figure, axes = panel(max(7.2, 1.2 + 1.15 * len(compared)), 4.2)
    floor = 0.5 * float(known.min()) / factor if wide else 0.0
    for place, (runs, found) in enumerate(zip(compared, values, strict=True)):
        if found.size == 0:
            continue
        mean = runs.summary[name]
        axes.bar(
            place,
            mean.mean / factor - floor,
            bottom=floor,
            width=0.62,
            color=colours[place],
            alpha=0.55,
        )
        if found.size > 1:
            spread = place + _SCATTER * np.linspace(-1.0, 1.0, found.size)
            axes.plot(spread, found / factor, ".", color=REFERENCE, markersize=4, alpha=0.7)
        if math.isfinite(mean.low):
            low = max(mean.low, 0.0 if not wide else floor * factor) / factor
            ends = (low, mean.mean / factor, mean.high / factor)
            _interval(axes, place + 0.24, ends, REFERENCE)
    if wide:
        logarithmic(axes)
        axes.set_ylim(bottom=floor)
    axes.set_xticks(
        range(len(compared)), [runs.controller.replace("-", "-\n") for runs in compared]
    )
    axes.set_xlim(-0.6, len(compared) - 0.4)
    axes.grid(visible=False, axis="x")
    axes.set_ylabel(f"{MAIN[name]}, rms [{unit}]")
    return headline(figure, _comparison_finding(compared, values), _about(compared))


@drawn
def exceedance(compared: Sequence[Runs]) -> Figure:
    """Return how often the payload's crests reach a level, with Rayleigh's and Gumbel's lines.

    A dot is a crest of the payload's motion that was reached once in the time below it.  The dashed
    line is what a Gaussian motion of the same deviation and period would do; the solid line, with
    its interval at the exposure time, follows from the largest of every twenty minutes.  Level [m
    or mm] over the time in which it is reached once, of runs in which the payload stays in its
    place.

    Raises InputError if no run has any crests.
    """
    curves = [_crests(runs) for runs in compared]
    sizes = [float(levels.max()) for levels, _, _ in curves if levels.size]
    if not sizes:
        raise InputError("exceedance: the runs have no crests of the payload's motion")
    factor, unit = scale("m", max(sizes))
    several = len(compared) > 1
    colours = _colours(compared)
    reach = max(
        compared[0].case.limits.exposure_time, *(float(t.max(initial=0)) for _, t, _ in curves)
    )
    figure, axes = panel(7.2, 4.4)
    for runs, colour, (levels, times, law) in zip(compared, colours, curves, strict=True):
        if not levels.size:
            continue
        label = runs.controller if several else "crests of the payload"
        axes.plot(times, levels / factor, ".", color=colour, markersize=5, label=label)
        deviation, period = law
        reached = np.geomspace(2.0 * period, 1.2 * reach, 200)
        rayleigh = np.array([deviation * peak_factor(period, float(t)) for t in reached])
        axes.plot(
            reached,
            rayleigh / factor,
            color=colour,
            linewidth=1.2,
            linestyle=(0, (4, 3)),
            label=None if several else "Rayleigh",
        )
        _gumbel_line(axes, runs, colour, factor, reach, None if several else "Gumbel")
    axes.set_xscale("log")
    low = min(float(t.min()) for _, t, _ in curves if t.size)
    axes.set_xlim(0.9 * low, 1.3 * reach)
    marks = [mark for mark in _MARKS if low <= mark <= 1.3 * reach]
    axes.set_xticks(marks, [duration(mark) for mark in marks])
    axes.set_xticks([], minor=True)
    if max(sizes) > 10.0 * min(sizes):
        logarithmic(axes)
        axes.set_ylim(bottom=0.2 * min(sizes) / factor)
    else:
        axes.set_ylim(bottom=0.0)
    axes.set_xlabel("time in which the level is reached once")
    axes.set_ylabel(f"payload above its place [{unit}]")
    axes.legend(loc="upper left")
    return headline(figure, _exceedance_finding(compared), _about(compared))


def _gumbel_line(
    axes: Axes, runs: Runs, colour: str, factor: float, reach: float, label: str | None
) -> None:
    """Draw Gumbel's line from a block on, and the interval at the exposure time."""
    estimate = runs.extremes["payload up"] if runs.extremes else None
    if estimate is None or math.isnan(estimate.value):
        return
    block = runs[0].statistics.block
    times = np.geomspace(block, 1.2 * reach, 50)
    levels = estimate.value + estimate.scale * np.log(times / estimate.duration)
    axes.plot(times, levels / factor, color=colour, linewidth=1.6, label=label)
    ends = (estimate.low / factor, estimate.value / factor, estimate.high / factor)
    _interval(axes, estimate.duration, ends, colour)


def _interval(axes: Axes, x: float, ends: tuple[float, float, float], colour: str) -> None:
    """Draw an interval, of which the lower end, the middle and the upper end are given."""
    low, middle, high = ends
    arms = [[middle - low], [high - middle]]
    axes.errorbar(x, middle, yerr=arms, color=colour, capsize=4, linewidth=1.4)


def _crests(runs: Runs) -> tuple[FloatArray, FloatArray, tuple[float, float]]:
    """Return levels, the times in which each was reached once, deviation and period."""
    sound = [run.statistics for run in runs.judged if run.status != "diverged"]
    each = [s[ERROR] for s in sound]
    crests = np.sort(np.concatenate([s.crests.astype(np.float64) for s in each] or [np.zeros(0)]))
    if crests.size == 0:
        return crests, crests, (math.nan, math.nan)
    exposure = sum(s.duration for s in sound)
    times = exposure / np.arange(crests.size, 0, -1.0)
    cycles = np.array([s.cycles for s in each], dtype=np.float64)
    deviation = math.sqrt(float(np.mean([s.standard_deviation**2 for s in each])))
    period = float(np.average([s.period if s.cycles else 0.0 for s in each], weights=cycles))
    # The commonest crests would lie on top of each other by the thousand.
    even = np.searchsorted(times, np.geomspace(times[0], times[-1] * (1.0 - 1e-12), _DOTS))
    last = np.arange(max(0, crests.size - _LAST), crests.size)
    shown = np.unique(np.concatenate([even, last]))
    return crests[shown], times[shown], (deviation, period)


def _values(runs: Runs, name: str) -> FloatArray:
    """Return a quantity of every run that has it (n,)."""
    found = [run.statistics.quantities.get(name) for run in runs.judged]
    values = np.array([q.value for q in found if q is not None])
    finite: FloatArray = values[np.isfinite(values)]
    return finite


def _colours(compared: Sequence[Runs]) -> list[str]:
    others = iter(_OTHERS * (1 + len(compared) // len(_OTHERS)))
    return [_COLOURS.get(runs.controller) or next(others) for runs in compared]


def _about(compared: Sequence[Runs]) -> str:
    runs = compared[0]
    seeds = f"{len(runs)} x " if len(runs) > 1 else ""
    about = f"{runs.case.name}, {runs.scenario.name}, {seeds}{duration(runs[0].duration)}"
    return f"{about}, {runs.controller}" if len(compared) == 1 else about


def _comparison_finding(compared: Sequence[Runs], values: Sequence[FloatArray]) -> str:
    means: Mapping[str, float] = {
        runs.controller: float(found.mean())
        for runs, found in zip(compared, values, strict=True)
        if found.size
    }
    best = min(means, key=lambda name: means[name])
    # Those that the seeds cannot tell apart share the first place.
    name = main_quantity(compared)
    ends = {runs.controller: runs.summary.means[name].high for runs in compared}
    equal = [name for name, mean in means.items() if mean <= max(ends[best], means[best])]
    names = " and ".join(equal) if len(equal) < 3 else f"{len(equal)} controllers"
    verb = "holds" if len(equal) == 1 else "hold"
    text = f"{names} {verb} best, {quantity(means[best], 'm')} rms"
    if "none" in means and "none" not in equal:
        text += f": {decibels(means['none'] / means[best])} less than with the drum held"
    return text


def _exceedance_finding(compared: Sequence[Runs]) -> str:
    known = {
        runs.controller: runs.extremes["payload up"]
        for runs in compared
        if runs.extremes and not math.isnan(runs.extremes["payload up"].value)
    }
    if not known:
        return "How high the payload comes, and how often"
    name = min(known, key=lambda each: known[each].value)
    estimate = known[name]
    lasting = duration(estimate.duration)
    return (
        f"{name}: {quantity(estimate.value, 'm')} in {lasting} by Gumbel, "
        f"{quantity(estimate.rayleigh, 'm')} by Rayleigh"
    )
