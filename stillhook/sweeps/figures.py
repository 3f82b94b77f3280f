"""Figures of a sweep: what hangs on what, how far it spreads, how near the loops come to -1.

    Dataset (and the design) -> scatter_matrix, violins, cumulative_share, nyquist_cloud

Cases that are not stable are shown as such and enter no distribution.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from models.basics import FloatArray, InputError, share

from ..text import (
    AFTER,
    BROKEN,
    HOOK,
    REFERENCE,
    Axes,
    Figure,
    drawn,
    headline,
    logarithmic,
    new_figure,
    number,
    panel,
    quantity,
    scale,
    typeset,
)

if TYPE_CHECKING:
    import xarray as xr

    from synth.design import Design


_MEASURES = ("payload_rms", "torque_rms", "speed_rms", "max_sensitivity")
_POINTS = 1500
_COLUMNS = 6
_WIDE = 20.0  # M_s above which its logarithm is shown
_CURVES = 150
_BAND = (0.02, 200.0, 5000)  # ends [rad/s] and points: circles of light rope modes look round
_AT_ONCE = 16  # curves
OWN = ("case", "seed")  # coordinates that are not varied
_PLAIN = ("mass", "length", "coefficient", "radius", "inertia", "ratio", "efficiency", "bandwidth")
_DIGITS = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)  # marks of a logarithmic axis


def sweep_figures(result: xr.Dataset, design: Design | None = None) -> dict[str, Figure]:
    """Return every figure that a result has, by the name of its file.

    Without the design that it is about the nominal values and the Nyquist cloud are missing.
    """
    found = {"scatter": scatter_matrix(result)}
    if stable_of(result).sum() > 1:
        found["violins"] = violins(result, design)
        found["share"] = cumulative_share(result, design=design)
    if design is not None and result.attrs.get("mode") == "frequency":
        found["nyquist"] = nyquist_cloud(result, design)
    return found


@drawn
def violins(
    result: xr.Dataset, design: Design | None = None, names: Sequence[str] | None = None
) -> Figure:
    """Return how far each number spreads among the stable cases, over its nominal value.

    The design gives that; the median stands for it if left out.  Names are by default payload,
    torque and speed rms and M_s, those there are.

    Raises InputError if no case is stable, or a name is unknown.
    """
    chosen = [n for n in _MEASURES if n in result] if names is None else list(names)
    stable = stable_of(result)
    if not stable.any():
        raise InputError("sweep: no case is stable, so there is no distribution to show")
    own = _nominal(result, design, chosen)
    figure, axes = panel(2.4 + 1.5 * len(chosen), 4.4)
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
    logarithmic(axes, "y", _DIGITS)
    axes.set_xticks(range(len(chosen)), [typeset(words_of(n)) for n in chosen])
    axes.set_ylabel("over the nominal value" if own else "over the median")
    axes.grid(axis="x", visible=False)
    low, high = axes.get_ylim()
    axes.set_ylim(low / 1.12, high)
    finding = "How far the numbers spread; bars hold 90 % of the cases"
    return headline(figure, finding, _about(result))


@drawn
def cumulative_share(
    result: xr.Dataset, name: str = "payload_rms", *, design: Design | None = None
) -> Figure:
    """Return the share of all cases that stays below a value; unstable ones never do.

    The nominal value is that of the design.

    Raises InputError if no case is stable, or there is no such variable.
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
    figure, axes = panel()
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
    if values[-1] > 4.0 * values[0]:
        logarithmic(axes, "x", _DIGITS)
    axes.set_ylim(0.0, 102.0)
    axes.set_xlabel(typeset(f"{words_of(name)} [{unit}]" if unit else words_of(name)))
    axes.set_ylabel("share of all cases [%]")
    axes.legend(loc="lower right")
    finding = (
        f"{100.0 * certain.value:.4g} % of {total} cases are stable "
        f"(95 % interval {100.0 * certain.low:.4g} to {100.0 * certain.high:.4g} %)"
    )
    return headline(figure, finding, _about(result))


@drawn
def scatter_matrix(result: xr.Dataset, names: Sequence[str] | None = None) -> Figure:
    """Return every pair of what varied and what came of it.

    Names are those of coordinates and variables; by default what varied, those that the payload's
    motion hangs on most if there are many, and payload rms and M_s.

    Raises InputError if a name is unknown.
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
    bad = "" if stable.all() else "; in vermilion those that are not"
    return headline(figure, f"{certain.count} of {certain.total} cases are stable{bad}")


@drawn
def nyquist_cloud(result: xr.Dataset, design: Design) -> Figure:
    """Return Nyquist curves of cases in the frequency domain around -1, the design's own on top."""
    from synth.sweeps import FrequencyEngine, spread_of

    engine = FrequencyEngine(design, spread_of(result), metrics=[])
    at = shown(stable_of(result), _CURVES)
    paths = engine.spread.paths
    rows = np.stack([numbers_in(result, p)[at] for p in paths], axis=1)
    nominal = np.array([[engine.spread.nominal[p] for p in paths]])
    omega = np.geomspace(*_BAND)
    parts = [engine.loop_gain(rows[k : k + _AT_ONCE], omega) for k in range(0, len(rows), _AT_ONCE)]
    gains = np.concatenate(parts)
    own = engine.loop_gain(nominal, omega)[0]
    stable = stable_of(result)[at]
    bound = engine.case.limits.max_sensitivity
    half = 2.2
    figure, axes = panel(6.4, 5.9)
    for gain, sound in zip(gains, stable, strict=True):
        hidden = np.where(np.abs(gain) > 8.0 * half, np.nan, gain)
        axes.plot(
            hidden.real,
            hidden.imag,
            color=AFTER if sound else BROKEN,
            alpha=0.18 if sound else 0.6,
            linewidth=0.8,
        )
    hidden = np.where(np.abs(own) > 8.0 * half, np.nan, own)
    axes.plot(hidden.real, hidden.imag, color=REFERENCE, linewidth=2.0, label="the design")
    axes.plot([], [], color=AFTER, label=f"{int(stable.sum())} stable cases")
    if not stable.all():
        axes.plot([], [], color=BROKEN, label=f"{int((~stable).sum())} that are not")
    turn = np.linspace(0.0, 2.0 * np.pi, 361)
    axes.plot(
        -1.0 + np.cos(turn) / bound, np.sin(turn) / bound, color=HOOK, linewidth=1.2,
        linestyle="--", label=f"M_s = {bound:.3g}".replace("M_s", "$M_s$"),
    )  # fmt: skip
    axes.plot([-1.0], [0.0], marker="+", color=REFERENCE, markersize=11, markeredgewidth=2.0)
    axes.set_xlim(-1.0 - 0.8 * half, -1.0 + 1.2 * half)
    axes.set_ylim(-half, half)
    axes.set_aspect("equal")
    axes.set_xlabel("real part of L(iω)")
    axes.set_ylabel("imaginary part of L(iω)")
    axes.legend(loc="lower right", fontsize=8.5)
    near = float(np.nanmin(np.abs(1.0 + gains[stable]))) if stable.any() else 0.0
    finding = f"The curves that are stable stay {number(near)} away from -1"
    return headline(figure, finding if stable.any() else "No curve is stable", _about(result))


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


def _nominal(result: xr.Dataset, design: Design | None, names: Sequence[str]) -> dict[str, float]:
    """Return the nominal case's own numbers, as the sweep computes them."""
    if design is None or result.attrs.get("mode") != "frequency":
        return {}
    from synth.sweeps import METRICS, FrequencyEngine, spread_of

    engine = FrequencyEngine(design, spread_of(result), metrics=[n for n in names if n in METRICS])
    row = np.array([[engine.spread.nominal[path] for path in engine.spread.paths]])
    found = engine.evaluate(row)
    return {n: float(found[n][0]) for n in found if n != "stable" and found["stable"][0]}


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
    # Ten thousand points: as pixels, in figures of lines too.
    style: Any = {"linewidths": 0.0, "rasterized": True}
    axes.scatter(x[stable], y[stable], s=4, color=AFTER, alpha=0.35, **style)
    axes.scatter(x[~stable], y[~stable], s=7, color=BROKEN, alpha=0.8, **style)


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


def stable_of(result: xr.Dataset) -> npt.NDArray[np.bool_]:
    """Return which cases are stable, (n,)."""
    return np.asarray(result["stable"].to_numpy() == 1)


def numbers_in(result: xr.Dataset, name: str) -> FloatArray:
    """Return a variable or coordinate as numbers, (n,)."""
    return np.asarray(result[name].to_numpy(), dtype=np.float64)


def thinned(count: int, most: int) -> npt.NDArray[np.intp]:
    """Return indices spread evenly over what there is: a Sobol sequence stays one."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.intp))


def shown(stable: npt.NDArray[np.bool_], most: int) -> npt.NDArray[np.intp]:
    """Return the cases that are shown, in their order: a share of both kinds, if rare all."""
    bad, good = np.flatnonzero(~stable), np.flatnonzero(stable)
    rare = min(bad.size, max(most // 10, int(most * bad.size / stable.size)))
    kept = [good[thinned(good.size, most - rare)] if good.size else good]
    kept.append(bad[thinned(bad.size, rare)] if rare else bad[:0])
    return np.sort(np.concatenate(kept))


def unit_of(result: xr.Dataset, name: str, typical: float) -> tuple[float, str]:
    """Return what to divide a variable by, and the unit it is then in."""
    unit = str(result[name].attrs.get("units", "1"))
    return (1.0, "") if unit in ("1", "") else scale(unit, typical)


def words_of(name: str) -> str:
    """Return a name as one says it."""
    if name == "max_sensitivity":
        return "M_s"
    if name.startswith("gains."):
        return f"gain {name.removeprefix('gains.')}"
    *sections, short = name.split(".")
    if short in _PLAIN and sections:
        short = f"{sections[-1]} {short}"
    return short.replace("_", " ")


def _about(result: xr.Dataset) -> str:
    """Return what varied."""
    paths = [words_of(str(n)) for n in result.coords if str(n) not in OWN]
    return f"varying {', '.join(paths[:6])}{', ..' if len(paths) > 6 else ''}"
