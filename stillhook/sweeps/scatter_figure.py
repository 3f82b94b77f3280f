"""The scatter matrix of a sweep: every pair of what varied and what came of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from models.basics import FloatArray, InputError, share

from ..text import AFTER, BROKEN, new_figure, styled, typeset
from .figure_parts import OWN, numbers_in, shown, stable_of, thinned, unit_of, words_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_POINTS = 1500
_COLUMNS = 6
_WIDE = 20.0  # M_s above which its logarithm is shown


def scatter_matrix(result: xr.Dataset, names: Sequence[str] | None = None) -> Figure:
    """Return every pair of what varied and what came of it.

    Parameters
    ----------
    result
        What a sweep returned.
    names
        Coordinates and variables; by default what varied, those that the payload's motion hangs
        on most if there are many, and payload rms and M_s.

    Raises
    ------
    InputError
        If a name is unknown.
    """
    chosen = _chosen(result) if names is None else list(names)
    for name in chosen:
        if name not in result.variables:
            raise InputError(f"sweep: there is no {name!r} in this result")
    at = shown(stable_of(result), _POINTS)
    stable = stable_of(result)[at]
    columns, labels = [], []
    for name in chosen:
        values, label = _scaled(result, name)
        # A few loops near the edge would press all others against the axis.
        wide = name == "max_sensitivity" and np.nanmax(values, initial=1.0) > _WIDE
        columns.append(np.log10(values) if wide else values)
        labels.append(f"log10 {label}" if wide else label)
    count = len(chosen)
    with styled():
        figure = new_figure(1.2 + 1.55 * count, 1.4 + 1.45 * count)
        panels = figure.subplots(count, count, squeeze=False)
        for i in range(count):
            for j in range(count):
                axes = panels[i, j]
                if j > i:
                    axes.axis("off")
                    continue
                if i == j:
                    _histogram(axes, columns[i], stable_of(result))
                else:
                    _cloud(axes, columns[j][at], columns[i][at], stable)
                _tidy(axes, i, j, count, labels)
        certain = share(int(stable_of(result).sum()), result.sizes["case"])
        figure.suptitle(
            f"{certain.count} of {certain.total} cases are stable"
            + ("" if stable.all() else "; in vermilion those that are not"),
            x=0.012,
            ha="left",
            fontsize=11.0,
            fontweight="bold",
        )
    return figure


def _chosen(result: xr.Dataset) -> list[str]:
    """Return what a scatter matrix shows: what matters most for the first measure, and measures."""
    paths = [str(name) for name in result.coords if str(name) not in OWN]
    measures = [n for n in ("payload_rms", "max_sensitivity") if n in result]
    most = _COLUMNS - len(measures)
    if len(paths) > most and measures:
        from scipy.stats import rankdata

        stable = stable_of(result)
        at = np.flatnonzero(stable)[thinned(int(stable.sum()), 5000)]
        ranks = rankdata(numbers_in(result, measures[0])[at])

        def tied(path: str) -> float:
            own = rankdata(numbers_in(result, path)[at])
            if own.std() == 0.0 or ranks.std() == 0.0:
                return 0.0
            return -abs(float(np.corrcoef(own, ranks)[0, 1]))

        kept = set(sorted(paths, key=tied)[:most])
        paths = [path for path in paths if path in kept]
    return paths + measures


def _histogram(axes: Axes, values: FloatArray, stable: npt.NDArray[np.bool_]) -> None:
    seen = values[np.isfinite(values)]
    if not seen.size:
        return
    edges = np.histogram_bin_edges(seen, bins=24)
    good = values[stable & np.isfinite(values)]
    bad = values[~stable & np.isfinite(values)]
    axes.hist([good, bad], bins=edges.tolist(), stacked=True, color=[AFTER, BROKEN], alpha=0.8)
    axes.set_yticks([])
    axes.grid(visible=False)


def _cloud(axes: Axes, x: FloatArray, y: FloatArray, stable: npt.NDArray[np.bool_]) -> None:
    axes.scatter(x[stable], y[stable], s=4, color=AFTER, alpha=0.35, linewidths=0.0)
    axes.scatter(x[~stable], y[~stable], s=7, color=BROKEN, alpha=0.8, linewidths=0.0)


def _tidy(axes: Axes, i: int, j: int, count: int, labels: Sequence[str]) -> None:
    axes.tick_params(labelsize=7.0)
    axes.locator_params(axis="x", nbins=3)
    if i != j:
        axes.locator_params(axis="y", nbins=3)
    if i == count - 1:
        axes.set_xlabel(typeset(labels[j]), fontsize=8.0)
    else:
        axes.set_xticklabels([])
    if j == 0 and i > 0:
        axes.set_ylabel(typeset(labels[i]), fontsize=8.0)
    elif i != j:
        axes.set_yticklabels([])


def _scaled(result: xr.Dataset, name: str) -> tuple[FloatArray, str]:
    values = numbers_in(result, name)
    seen = values[np.isfinite(values)]
    factor, unit = unit_of(result, name, float(np.median(np.abs(seen))) if seen.size else 1.0)
    label = words_of(name)
    return values / factor, f"{label}\n[{unit}]" if unit else label
