"""Figures of a sweep: what hangs on what, how far it spreads, how near the loops come to -1.

    Dataset (and the design) -> scatter_matrix, violins, cumulative_share, nyquist_cloud

Cases that are not stable are shown as such and enter no distribution.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from models.basics import FloatArray, InputError, share

from ..text import AFTER, BROKEN, HOOK, REFERENCE, new_figure, number, quantity, styled, typeset
from .cloud_figure import nyquist_cloud
from .figure_parts import numbers_in, stable_of, thinned, title, unit_of, words_of
from .scatter_figure import scatter_matrix

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from synth.design import GainDesign, StructureDesign


_MEASURES = ("payload_rms", "torque_rms", "speed_rms", "max_sensitivity")


def sweep_figures(
    result: xr.Dataset, design: GainDesign | StructureDesign | None = None
) -> dict[str, Figure]:
    """Return every figure that a result has, by the name of its file.

    Parameters
    ----------
    result
        What a sweep returned.
    design
        The design it is about; without it the nominal values and the Nyquist cloud are missing.
    """
    found = {"scatter": scatter_matrix(result)}
    if stable_of(result).sum() > 1:
        found["violins"] = violins(result, design)
        found["share"] = cumulative_share(result, design=design)
    if design is not None and result.attrs.get("mode") == "frequency":
        found["nyquist"] = nyquist_cloud(result, design)
    return found


def violins(
    result: xr.Dataset,
    design: GainDesign | StructureDesign | None = None,
    names: Sequence[str] | None = None,
) -> Figure:
    """Return how far each number spreads among the stable cases, over its nominal value.

    Parameters
    ----------
    result
        What a sweep returned.
    design
        Gives the nominal values; the median stands for them if left out.
    names
        Variables; by default payload, torque and speed rms and M_s, those there are.

    Raises
    ------
    InputError
        If no case is stable, or a name is unknown.
    """
    chosen = [n for n in _MEASURES if n in result] if names is None else list(names)
    stable = stable_of(result)
    if not stable.any():
        raise InputError("sweep: no case is stable, so there is no distribution to show")
    own = _nominal(result, design, chosen)
    with styled():
        figure = new_figure(2.4 + 1.5 * len(chosen), 4.4)
        axes = figure.add_subplot()
        for k, name in enumerate(chosen):
            values = numbers_in(result, name)[stable]
            values = values[np.isfinite(values)]
            middle = own.get(name) or float(np.median(values))
            _violin(axes, k, values / middle)
            unit = str(result[name].attrs.get("units", "1"))
            told = quantity(middle, unit) if unit != "1" else number(middle)
            axes.annotate(
                told, (k, 0.0), (0.0, 4.0), xycoords=("data", "axes fraction"),
                textcoords="offset points", ha="center", fontsize=8.5, color="#555555",
            )  # fmt: skip
        axes.axhline(1.0, color=REFERENCE, linewidth=1.0)
        axes.set_yscale("log")
        _plain_log(axes)
        axes.set_xticks(range(len(chosen)), [typeset(words_of(n)) for n in chosen])
        axes.set_ylabel("over the nominal value" if own else "over the median")
        axes.grid(axis="x", visible=False)
        low, high = axes.get_ylim()
        axes.set_ylim(low / 1.12, high)
        title(figure, axes, result, "How far the numbers spread; bars hold 90 % of the cases")
    return figure


def cumulative_share(
    result: xr.Dataset,
    name: str = "payload_rms",
    *,
    design: GainDesign | StructureDesign | None = None,
) -> Figure:
    """Return the share of all cases that stays below a value; unstable ones never do.

    Parameters
    ----------
    result
        What a sweep returned.
    name
        A variable of it.
    design
        Gives the nominal value.

    Raises
    ------
    InputError
        If no case is stable, or there is no such variable.
    """
    if name not in result:
        raise InputError(f"sweep: there is no {name!r} in this result")
    stable = stable_of(result)
    values = np.sort(numbers_in(result, name)[stable])
    values = values[np.isfinite(values)]
    if not values.size:
        raise InputError("sweep: no case is stable, so there is no distribution to show")
    total = result.sizes["case"]
    factor, unit = unit_of(result, name, float(np.median(values)))
    shares = np.arange(1, values.size + 1) / total
    steps = thinned(values.size, 4000)
    steps = np.unique(np.append(steps, values.size - 1))
    certain = share(int(stable.sum()), total)
    with styled():
        figure = new_figure()
        axes = figure.add_subplot()
        axes.step(values[steps] / factor, 100.0 * shares[steps], where="post", color=AFTER)
        if not stable.all():
            axes.axhspan(100.0 * certain.value, 100.0, color=BROKEN, alpha=0.15, lw=0.0)
            axes.annotate(
                f"unstable: {100.0 * (1.0 - certain.value):.3g} %", (0.02, 100.0), (0.0, -4.0),
                xycoords=("axes fraction", "data"), textcoords="offset points", va="top",
                fontsize=9.0, color=BROKEN,
            )  # fmt: skip
        own = _nominal(result, design, [name]).get(name)
        if own is not None:
            axes.axvline(own / factor, color=REFERENCE, linewidth=1.2, label="nominal")
        for part, style in ((0.5, ":"), (0.95, "--")):
            if part <= shares[-1]:
                at = values[int(np.searchsorted(shares, part))] / factor
                label = f"{100 * part:.0f} % of all cases: {number(at)} {unit}".rstrip()
                axes.axvline(at, color=HOOK, linestyle=style, linewidth=1.2, label=label)
        axes.set_xscale("log" if values[-1] > 4.0 * values[0] else "linear")
        if axes.get_xscale() == "log":
            _plain_log(axes, "x")
        axes.set_ylim(0.0, 102.0)
        axes.set_xlabel(typeset(f"{words_of(name)} [{unit}]" if unit else words_of(name)))
        axes.set_ylabel("share of all cases [%]")
        axes.legend(loc="lower right")
        finding = (
            f"{100.0 * certain.value:.4g} % of {total} cases are stable "
            f"(95 % interval {100.0 * certain.low:.4g} to {100.0 * certain.high:.4g} %)"
        )
        title(figure, axes, result, finding)
    return figure


def _violin(axes: Axes, at: int, values: FloatArray) -> None:
    """Draw a distribution on a logarithmic axis: its density is that of the logarithm."""
    low, high = np.quantile(values, [0.001, 0.999])
    inside = np.log(values[(values >= low) & (values <= high)])
    if inside.size > 1 and np.ptp(inside) > 1e-9:
        edges = np.linspace(inside.min(), inside.max(), 41)
        seen, _ = np.histogram(inside, edges)
        smooth = np.convolve(np.pad(seen, 2, mode="edge"), [0.1, 0.25, 0.3, 0.25, 0.1], "valid")
        half = 0.38 * smooth / smooth.max()
        middle = np.exp(0.5 * (edges[1:] + edges[:-1]))
        axes.fill_betweenx(middle, at - half, at + half, color=AFTER, alpha=0.35, linewidth=0.0)
    p5, p50, p95 = np.quantile(values, [0.05, 0.5, 0.95])
    axes.plot([at, at], [p5, p95], color=AFTER, linewidth=2.4, solid_capstyle="butt")
    axes.plot([at], [p50], marker="o", color="white", markeredgecolor=AFTER, markersize=6)


def _nominal(
    result: xr.Dataset, design: GainDesign | StructureDesign | None, names: Sequence[str]
) -> dict[str, float]:
    """Return the nominal case's own numbers, as the sweep computes them."""
    if design is None or result.attrs.get("mode") != "frequency":
        return {}
    from synth.sweeps import METRICS, FrequencyEngine, spread_of

    engine = FrequencyEngine(design, spread_of(result), metrics=[n for n in names if n in METRICS])
    row = np.array([[engine.spread.nominal[path] for path in engine.spread.paths]])
    found = engine.evaluate(row)
    return {n: float(found[n][0]) for n in found if n != "stable" and found["stable"][0]}


def _plain_log(axes: Axes, which: str = "y") -> None:
    """Write a logarithmic axis of a decade or less in plain numbers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis: Any = axes.yaxis if which == "y" else axes.xaxis
    axis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0)))
    axis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
    axis.set_minor_formatter(NullFormatter())
