"""Bars of Sobol's indices: what of a figure's variance each number is to blame for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from synth.sensitivity import SobolIndices

from ..text import AFTER, HOOK, new_figure, styled, typeset

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAMES = {
    "payload_rms": "rms of the payload",
    "modulus_margin": "1/M_s, the loop's distance to -1",
    "torque_rms": "rms of the motor torque",
    "speed_rms": "rms of the motor speed",
}


def indices_figure(studies: Sequence[SobolIndices], about: str) -> Figure:
    """Return one panel for each figure: first-order and total indices with their intervals.

    Parameters
    ----------
    studies
        Indices over the same ranges, one for each figure, at least one.
    about
        What they are of, in small print.
    """
    paths = studies[0].paths
    order = np.argsort(studies[0].total)
    place = np.arange(float(len(paths)))
    with styled():
        figure = new_figure(width=3.0 + 2.6 * len(studies), height=1.8 + 0.36 * max(len(paths), 3))
        panels = figure.subplots(1, len(studies), sharey=True, squeeze=False)[0]
        for axes, study in zip(panels, studies, strict=True):
            for offset, values, interval, colour, label in (
                (0.2, study.total, study.total_interval, AFTER, "total"),
                (-0.2, study.first, study.first_interval, HOOK, "alone"),
            ):
                low, high = interval[order].T
                middle = values[order]
                axes.barh(
                    place + offset,
                    middle,
                    height=0.4,
                    color=colour,
                    label=label,
                    xerr=np.clip([middle - low, high - middle], 0.0, None),
                    ecolor="#333333",
                )
            axes.set_xlim(0.0, 1.05)
            axes.grid(visible=False, axis="y")
            axes.set_xlabel("share of the variance")
            axes.set_title(typeset(NAMES.get(study.figure, study.figure)), fontsize=10.0)
        panels[0].set_yticks(place, [paths[k] for k in order])
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=2)
        text = f"{paths[int(order[-1])]} is to blame for {100.0 * studies[0].total.max():.0f} %"
        figure.suptitle(f"{text}\n{about}", x=0.012, ha="left", fontsize=10.5, weight="bold")
    return figure
