"""The figures of a robust design and of a gain schedule."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from synth.robust import GainSchedule, RobustDesign

from ..text import (
    AFTER,
    BEFORE,
    DRUM,
    HOOK,
    REFERENCE,
    new_figure,
    quantity,
    scale,
    styled,
    typeset,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SHOWN = 24  # scenarios


def robust_figure(design: RobustDesign) -> Figure:
    """Return payload motion and M_s of the scenarios, and the random draws' distribution.

    Parameters
    ----------
    design
        A design with at least one stable scenario.
    """
    shown = design.scenarios[:_SHOWN]
    rms = np.array([s.payload_rms for s in shown])
    size, unit = scale("m", float(np.median(rms)))
    at = np.arange(len(shown))[::-1]
    with styled():
        figure = new_figure(9.0, 2.6 + 0.22 * len(shown))
        left, right = figure.subplots(1, 2, width_ratios=(3, 1), sharey=True)
        before = np.array([s.payload_rms_before for s in shown]) / size
        left.scatter(before, at, color=BEFORE, marker="|", s=60, label="drum held")
        left.scatter(rms / size, at, color=AFTER, s=24, label="these gains")
        own = [(s.best_rms, k) for s, k in zip(shown, at, strict=True) if s.best_rms is not None]
        if own:
            values, rows = zip(*own, strict=True)
            label = "gains of its own"
            left.scatter(np.array(values) / size, rows, color=DRUM, marker="x", s=24, label=label)
        if design.check is not None and design.check.payload_rms.size:
            low, high = np.quantile(design.check.payload_rms, [0.005, 0.995]) / size
            label = f"99 % of {design.check.stable} random draws"
            left.axvspan(low, high, color=HOOK, alpha=0.2, label=label)
        left.set_xscale("log")
        left.set_xlabel(f"payload rms [{unit}]")
        left.set_yticks(at, [s.name for s in shown], fontsize=7.5)
        figure.legend(loc="outside lower left", ncols=4, fontsize=8.0)
        right.scatter([s.max_sensitivity for s in shown], at, color=AFTER, s=24)
        bound = shown[0].limits.get("max_sensitivity")
        if bound is not None:
            right.axvline(bound.bound, color=BEFORE, linewidth=1.2)
        right.set_xlabel(typeset("M_s"))
        title = (
            f"One set of gains: {quantity(float(rms.max()), 'm')} rms at most in "
            f"{len(design.scenarios)} scenarios"
        )
        figure.suptitle(title, x=0.012, ha="left", fontsize=11.0, weight="bold")
        left.set_title(design.case.name, fontsize=9.5, color="#555555", pad=6.0)
    return figure


def schedule_figure(schedule: GainSchedule) -> Figure:
    """Return the gains over the rope's length, and the payload's motion with them.

    Parameters
    ----------
    schedule
        A schedule that has been looked at.
    """
    lengths = np.geomspace(schedule.lengths[0], schedule.lengths[-1], 200)
    lengths[[0, -1]] = schedule.lengths[[0, -1]]
    table = [schedule.at(float(v)) for v in lengths]
    with styled():
        figure = new_figure(7.2, 2.0 + 1.3 * len(schedule.names))
        panels = figure.subplots(1 + len(schedule.names), 1, sharex=True)
        for axes, k, name in zip(panels, range(len(schedule.names)), schedule.names, strict=False):
            axes.plot(lengths, [row[name] for row in table], color=AFTER)
            axes.plot(schedule.lengths, schedule.gains[:, k], "o", color=REFERENCE, markersize=4)
            axes.set_ylabel(name)
        last = panels[-1]
        at = [p.length for p in schedule.points]
        last.plot(at, [1e3 * p.payload_rms for p in schedule.points], color=AFTER, label="schedule")
        best = [1e3 * p.best_rms for p in schedule.points]
        last.plot(at, best, color=DRUM, linestyle="--", label="gains of its own")
        last.set_ylabel("payload rms [mm]")
        last.set_xlabel("rope length [m]")
        last.legend(loc="best")
        last.set_xscale("log")
        title = f"Gains over the rope's length, {len(schedule.lengths)} nodes"
        figure.suptitle(title, x=0.012, ha="left", fontsize=11.0, weight="bold")
        panels[0].set_title(schedule.case.name, fontsize=9.5, color="#555555", pad=6.0)
    return figure
