"""Seas as figures and reports: the records of a file, their scatter diagram, one spectrum."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from models.basics import FloatArray
from models.sea import LONGEST_GAP, Scatter, SeaRecords, SeaSeries, SeaSpectrum

from ..text import (
    AFTER,
    BEFORE,
    HOOK,
    Drawing,
    Figure,
    Item,
    Report,
    ReportSection,
    Table,
    annotate,
    columns,
    data_table,
    drawn,
    duration,
    headline,
    pairs,
    panel,
    percent,
    quantity,
    typeset,
)

_MOST_CELLS = 350  # beyond, the numbers in the cells would not be legible


@drawn
def scatter_figure(
    scatter: Scatter, *, name: str, height_step: float = 0.5, period_step: float = 1.0
) -> Figure:
    """Return a scatter diagram with the share of each class of H_s and T_p, so wide [m], [s]."""
    heights, periods, table = scatter.matrix(height_step, period_step)
    shown = np.where(table > 0.0, 100.0 * table, np.nan)
    often = np.unravel_index(int(np.argmax(table)), table.shape)
    figure, axes = panel(height=max(3.4, min(7.0, 1.8 + 0.26 * len(heights))))
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
    return headline(figure, finding, name)


@drawn
def spectrum_figure(sea: SeaSpectrum, *, name: str) -> Figure:
    """Return a spectrum, beside the Bretschneider form of the same H_s and T_p."""
    peak, height = sea.peak_frequency, sea.significant_height
    period = 2.0 * math.pi / peak
    low, high = sea.band
    right = min(high, max(4.0 * peak, _holding(sea, 0.995)))
    corners = [corner for corner in sea.splits if corner < right]  # of a measured spectrum
    omega = np.union1d(np.linspace(low, right, 2000), corners)
    figure, axes = panel()
    plain = SeaSpectrum(kind="bretschneider", significant_height=height, peak_period=period)
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
    return headline(figure, finding, name)


def sea_report(sea: SeaSpectrum, *, name: str, extra: Sequence[tuple[str, str]] = ()) -> Report:
    """Return one sea, with its figure; `extra` facts stand below the others."""
    drawing = Drawing(
        "spectrum", "Spectrum", lambda: spectrum_figure(sea, name=f"{name}: {sea.kind}")
    )
    items: list[Item] = [pairs([*_facts(sea), *extra]), drawing]
    height = quantity(sea.significant_height, "m")
    return Report(
        name=name, status=f"{sea.kind}, H_s {height}", sections=[ReportSection("", items)]
    )


def records_report(
    records: SeaRecords, chosen: int, sea: SeaSpectrum, *, name: str, steps: Mapping[str, float]
) -> Report:
    """Return what a file holds: what was kept and why, its statistics, its scatter, one spectrum.

    That is of the record `chosen`; `steps` are widths of classes, as `scatter_figure` takes them.
    """
    file, at = Path(name).name, _when(records, chosen)
    drawings = [
        Drawing(
            "scatter",
            "Scatter diagram",
            lambda: scatter_figure(
                records.scatter(**steps), name=f"{file}: {len(records)} records", **steps
            ),
        ),
        Drawing(
            "spectrum",
            "Spectrum",
            lambda: spectrum_figure(sea, name=f"{file}, record {chosen}: {at}"),
        ),
    ]
    return Report(
        name=name,
        about=records.file_format,
        status=str(records.quality),
        sections=[
            ReportSection("", [_quality(records)]),
            ReportSection("", _statistics(records)),
            ReportSection(f"Record {chosen}, {at}", [pairs(_facts(sea)), *drawings]),
        ],
    )


@drawn
def series_figure(series: SeaSeries, *, name: str) -> Figure:
    """Return H_s and T_p over time; gaps of more than three hours stay empty."""
    figure, axes = panel(9.2, 4.2)
    axes.remove()
    above, below = figure.subplots(2, 1, sharex=True)
    gaps = np.flatnonzero(np.diff(series.time).astype(np.float64) > LONGEST_GAP) + 1
    time = np.insert(series.time, gaps, np.datetime64("NaT"))
    for panel_, values, colour, label in (
        (above, series.significant_height, AFTER, "H_s [m]"),
        (below, series.peak_period, HOOK, "T_p [s]"),
    ):
        panel_.plot(time, np.insert(values, gaps, np.nan), color=colour, linewidth=0.8)
        panel_.set_ylim(bottom=0.0)
        panel_.set_ylabel(typeset(label))
    above.set_xlim(series.time[0], series.time[-1])
    top = int(np.argmax(series.significant_height))
    day = str(series.time[top]).partition("T")[0]
    height = quantity(float(series.significant_height[top]), "m")
    return headline(
        figure, f"H_s up to {height} on {day}, T_p {series.peak_period[top]:.3g} s", name
    )


def series_report(series: SeaSeries, *, name: str, steps: Mapping[str, float]) -> Report:
    """Return what a file of sea states in time holds: its account, statistics, figures.

    `steps` are widths of classes, as `scatter_figure` takes them.
    """
    file = f"{Path(name).name}: {len(series)} records"
    drawings = [
        Drawing("series", "H_s and T_p in time", lambda: series_figure(series, name=file)),
        Drawing(
            "scatter",
            "Scatter diagram",
            lambda: scatter_figure(series.scatter(**steps), name=file, **steps),
        ),
    ]
    first, last = (str(time).replace("T", " ") for time in series.time[[0, -1]])
    known = series.direction is not None and bool(np.isfinite(series.direction).any())
    facts: list[Item] = [
        f"{first} to {last} UTC, a record every {duration(series.usual_step)}, directions "
        f"{'known' if known else 'unknown'}",
        _summary(("H_s [m]", series.significant_height), ("T_p [s]", series.peak_period)),
    ]
    return Report(
        name=name,
        about=series.file_format,
        status=str(series.quality),
        sections=[
            ReportSection("", [_quality(series)]),
            ReportSection("", [*facts, *drawings]),
        ],
    )


def records_table(records: SeaRecords | SeaSeries) -> Table:
    """Return the records as data."""
    rows = []
    crossing, place = np.full(len(records), np.nan), tuple[str, ...]()
    if isinstance(records, SeaRecords):
        crossing, place = records.zero_crossing_period, records.place
    for k in range(len(records)):
        bearing = math.nan if records.direction is None else math.degrees(records.direction[k])
        figures = (records.significant_height, records.peak_period, crossing)
        rows.append(
            (
                k,
                "" if np.isnat(records.time[k]) else str(records.time[k]),
                place[k] if place else "",
                *(float(values[k]) for values in figures),
                None if math.isnan(bearing) else round(bearing, 1),
            )
        )
    names = ("record", "time", "place", "significant_height [m]", "peak_period [s]")
    return data_table([*names, "zero_crossing_period [s]", "from [deg]"], rows)


def _when(records: SeaRecords, index: int) -> str:
    time = records.time[index]
    place = f", {records.place[index]}" if records.place else ""
    text = "no time" if np.isnat(time) else f"{str(time).replace('T', ' ')} UTC"
    return f"{text}{place}"


def _quality(records: SeaRecords | SeaSeries) -> Table:
    quality = records.quality
    rows: list[tuple[str, int, str]] = [("read", quality.read, "")]
    rows += [(f"rejected: {one.reason}", one.count, one.example) for one in quality.rejections]
    rows.append(("kept", quality.kept, ""))
    heads = columns("records; count=; first <")
    return Table(columns=heads, rows=rows, notes=tuple(quality.notes))


def _statistics(records: SeaRecords) -> list[Item]:
    items: list[Item] = []
    times = records.time[~np.isnat(records.time)]
    if times.size:
        first, last = (str(time).replace("T", " ") for time in (times[0], times[-1]))
        low, high = records.omega[0] / (2.0 * math.pi), records.omega[-1] / (2.0 * math.pi)
        items.append(
            f"{first} to {last} UTC, {records.omega.size} frequencies from {low:.3g} to "
            f"{high:.3g} Hz"
        )
    table = _summary(
        ("H_s [m]", records.significant_height),
        ("T_p [s]", records.peak_period),
        ("T_z [s]", records.zero_crossing_period),
    )
    return [*items, table]


def _summary(*quantities: tuple[str, FloatArray]) -> Table:
    rows = [
        (label, *(float(f(values)) for f in (np.mean, np.min, np.median, np.max)))
        for label, values in quantities
    ]
    return Table(columns=columns("quantity=; mean; lowest; median; highest"), rows=rows)


def _facts(sea: SeaSpectrum) -> list[tuple[str, str]]:
    statistics = sea.statistics
    found = [
        ("H_s", quantity(sea.significant_height, "m")),
        ("T_p", quantity(2.0 * math.pi / sea.peak_frequency, "s")),
        ("T_z, T_1", f"{quantity(statistics.zero_crossing_period, 's')}, "
                     f"{quantity(statistics.mean_period, 's')}"),
        ("highest crest in 3 h", quantity(statistics.most_probable_maximum(), "m")),
        ("band", f"{sea.band[0]:.3g} to {sea.band[1]:.3g} rad/s"),
    ]  # fmt: skip
    if sea.table is not None:
        found.append(
            ("above the last frequency", f"{percent(sea.table.tail_share)} of the variance")
        )
    if sea.spreading is not None:
        law = sea.spreading
        spread = f"{law.kind}, exponent {law.exponent:g}: {math.degrees(law.deviation):.0f} deg"
        found.append(("spreading", spread))
    return found


def _holding(sea: SeaSpectrum, share: float) -> float:
    """Return the frequency below which that share of the variance lies [rad/s]."""
    q = sea.quadrature(rtol=1e-6)
    cumulated = np.cumsum(q.weights * sea(q.omega))
    return float(np.interp(share * cumulated[-1], cumulated, q.omega))
