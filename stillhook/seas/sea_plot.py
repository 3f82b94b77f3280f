"""Figures of seas: the scatter diagram of a file's records, and one spectrum."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..text import AFTER, BEFORE, HOOK, annotate, new_figure, percent, quantity, styled, typeset

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from models.sea import Scatter, SeaSpectrum

_MOST_CELLS = 350  # beyond, the numbers in the cells would not be legible


def scatter_figure(
    scatter: Scatter, *, name: str, height_step: float = 0.5, period_step: float = 1.0
) -> Figure:
    """Return a scatter diagram with the share of each class of H_s and T_p.

    Parameters
    ----------
    scatter
        The sea states.
    name
        What they are, for the line under the title.
    height_step, period_step
        Widths of the classes [m], [s].
    """
    heights, periods, table = scatter.matrix(height_step, period_step)
    shown = np.where(table > 0.0, 100.0 * table, np.nan)
    often = np.unravel_index(int(np.argmax(table)), table.shape)
    with styled():
        figure = new_figure(height=max(3.4, min(7.0, 1.8 + 0.26 * len(heights))))
        axes = figure.add_subplot()
        axes.grid(visible=False)
        mesh = axes.pcolormesh(periods, heights, shown, cmap="Blues", vmin=0.0)
        if np.count_nonzero(table) <= _MOST_CELLS and table.size <= 4 * _MOST_CELLS:
            dark = 0.6 * float(np.nanmax(shown))
            for row, col in np.argwhere(table > 0.0):
                share = shown[row, col]
                axes.text(
                    0.5 * (periods[col] + periods[col + 1]),
                    0.5 * (heights[row] + heights[row + 1]),
                    f"{share:.1f}" if share < 9.95 else f"{share:.0f}",
                    ha="center",
                    va="center",
                    fontsize=8.0,
                    color="white" if share > dark else "#222222",
                )
        axes.set_xlim(periods[0], periods[-1])
        axes.set_ylim(heights[0], heights[-1])
        axes.set_xlabel(typeset("peak period T_p [s]"))
        axes.set_ylabel(typeset("significant height H_s [m]"))
        figure.colorbar(mesh, ax=axes, label="share of the time [%]", pad=0.02)
        low, left = heights[often[0]], periods[often[1]]
        finding = (
            f"Most often H_s {low:g} to {low + height_step:g} m with T_p {left:g} to "
            f"{left + period_step:g} s: {percent(float(table[often]))} of the time"
        )
        figure.suptitle(typeset(finding), x=0.012, ha="left", fontsize=11.0, weight="bold")
        axes.set_title(typeset(name), fontsize=9.5, color="#555555", pad=6.0)
    return figure


def spectrum_figure(sea: SeaSpectrum, *, name: str) -> Figure:
    """Return a spectrum, beside the Bretschneider form of the same H_s and T_p.

    Parameters
    ----------
    sea
        The sea.
    name
        What it is, for the line under the title.
    """
    from models.sea import SeaSpectrum as Spectrum

    peak, height = sea.peak_frequency, sea.significant_height
    period = 2.0 * math.pi / peak
    low, high = sea.band
    right = min(high, max(4.0 * peak, _holding(sea, 0.995)))
    omega = np.unique(np.concatenate([np.linspace(low, right, 2000), *_inside(sea, right)]))
    with styled():
        figure = new_figure()
        axes = figure.add_subplot()
        plain = Spectrum(kind="bretschneider", significant_height=height, peak_period=period)
        if sea.kind != "bretschneider":
            label = "Bretschneider of the same H_s and T_p"
            axes.plot(omega, plain(omega), color=HOOK, linewidth=1.2, label=typeset(label))
        for index, part in enumerate(sea.parts or ()):
            axes.plot(
                omega,
                part(omega),
                color=BEFORE,
                linestyle=("--", ":", "-.")[index % 3],
                linewidth=1.2,
                label=part.kind,
            )
        axes.plot(omega, sea(omega), color=AFTER, label=sea.kind)
        top = float(np.max(sea(omega)))
        annotate(axes, typeset(f"T_p {period:.3g} s"), (peak, top), (24.0, -4.0))
        axes.set_xlim(0.0, right)
        axes.set_ylim(bottom=0.0)
        axes.set_xlabel("frequency [rad/s]")
        axes.set_ylabel("density of the elevation [m² s/rad]")
        axes.legend(loc="upper right")
        z = sea.statistics.zero_crossing_period
        finding = f"H_s {quantity(height, 'm')}, T_p {period:.3g} s, T_z {z:.3g} s"
        figure.suptitle(
            typeset(finding).replace("T_z", "$T_z$"),
            x=0.012,
            ha="left",
            fontsize=11.0,
            weight="bold",
        )
        axes.set_title(typeset(name), fontsize=9.5, color="#555555", pad=6.0)
    return figure


def _holding(sea: SeaSpectrum, share: float) -> float:
    """Return the frequency below which that share of the variance lies [rad/s]."""
    q = sea.quadrature(rtol=1e-6)
    cumulated = np.cumsum(q.weights * sea(q.omega))
    return float(np.interp(share * cumulated[-1], cumulated, q.omega))


def _inside(sea: SeaSpectrum, right: float) -> list[np.ndarray[tuple[int], np.dtype[np.float64]]]:
    """Return the rows of a measured spectrum: its corners are to be corners."""
    return [np.array([omega for omega in sea.splits if omega < right])]
