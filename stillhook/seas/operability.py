"""Operability as a report, and its tables as data."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING

from models.sea import breaking_height
from synth.operability import AtDepth, Contour, ContourCheck, Operability, rule_shares

from ..text import (
    Column,
    Drawing,
    Item,
    Report,
    ReportSection,
    Table,
    columns,
    data_table,
    pairs,
    percent,
)
from .operability_figures import (
    capability_figure,
    contour_figure,
    depth_figure,
    heading_figure,
    scatter_figure,
)

if TYPE_CHECKING:
    import xarray as xr

MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")
WHO = {"held": "drum held", "loop": "design", "reoptimised": "anew", "perfect": "perfect"}
"""The systems, as tables call them."""
_ROWS = 20
FIGURES = ("contour", "capability", "headings", "depths", "scatter")
"""Names of the figures, of which a study has some."""


def operability_report(
    study: Operability, checks: Sequence[ContourCheck] = (), *, rules: bool = False
) -> Report:
    """Return a study: a table for each length of rope, the shares of the year, the figures.

    With `rules` the shares of the year by the rules of thumb of 1975 stand beside its own.
    """
    sections = []
    for at in study.depths:
        margin = [study.margin_text(at)] if study.design is not None else []
        sections.append(ReportSection(f"rope {at}", [*margin, _contours(at)]))
    if study.headings is None:
        note = "no headings: the vessel is given by the heave of its hook alone"
        sections.insert(0, ReportSection("", [note]))
    if study.scatter is not None:
        source = study.scatter.source
        sections.append(ReportSection(f"workable share of the year, {source}", _shares(study)))
        if rules:
            heads = "operation=rules of thumb, 1975 thesis, Table 2; safe [%]; or marginal [%]"
            table = Table(columns=columns(heads), rows=rule_shares(study.scatter))
            sections.append(ReportSection("", [table]))
    rows = []
    if checks:
        worst = max(check.difference for check in checks)
        good = "" if all(check.ok for check in checks) else ", which is NOT within 1e-06"
        points = f"{len(checks)} points of the contour by single evaluations"
        rows.append(("checked", f"{points}: the limit is met to {worst:.0e}{good}"))
    if not study.wanted:
        rows.append(("payload", "no bound on its motion was given: --payload-rms, --payload-max"))
    rows.append(("perfect", "a winch that holds the rope's upper end still, by its own limits"))
    sections.append(ReportSection("", [pairs(rows), *_drawings(study)]))
    works = any(float(at.main.limit.max()) > 0.0 for at in study.depths)
    return Report(
        name=study.case.name,
        status=study.status,
        ok=works and all(check.ok for check in checks),
        sections=sections,
    )


def workable_table(study: Operability) -> Table:
    """Return the shares of the year as data: a row for each length of rope and system."""
    head = ["rope_length_m", "system", "workable", "best_heading", "outside_the_contour"]
    rows = [
        (
            *(at.length, name, share.share, share.best_heading, share.outside),
            *(share.by_month.get(month) for month in range(1, 13)),
        )
        for at in study.depths
        for name, share in at.workable.items()
    ]
    return data_table([*head, *MONTHS], rows)


def netcdf(dataset: xr.Dataset) -> bytes:
    """Return a data set as the bytes of a NetCDF file."""
    plain = dataset.copy()
    for name, variable in plain.variables.items():
        if variable.dtype == object:
            plain[name] = variable.astype(str)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the libraries below, on what nobody can change here
        return bytes(plain.to_netcdf(engine="h5netcdf"))


def _drawings(study: Operability) -> list[Drawing]:
    found = [
        Drawing("contour", "H_s over T_p", lambda: contour_figure(study)),
        Drawing("capability", "What the winch can follow", lambda: capability_figure(study)),
    ]
    if study.headings is not None and study.headings.size > 1:
        found.append(Drawing("headings", "Over the heading", lambda: heading_figure(study)))
    if len(study.depths) > 1:
        found.append(Drawing("depths", "At all lengths of rope", lambda: depth_figure(study)))
    if study.scatter is not None:
        found.append(Drawing("scatter", "Over the year", lambda: scatter_figure(study)))
    return found


def _contours(at: AtDepth) -> Table:
    names = [n for n in WHO if n in at.contours]
    heads = [Column("peak_period", "T_p", write=lambda period: f"{period:.3g} s")]
    for name in names:
        heads += columns(f"{name}={WHO[name]}; {name}_set_by=set by <")
    rows = []
    for p, period in enumerate(at.main.periods):
        rows.append((float(period), *(c for n in names for c in _cells(at.contours[n], p))))
    turns = "H_s [m] in the worst and the best heading; what binds in the worst"
    notes = (turns,) if at.main.headings is not None else ()
    return Table(columns=tuple(heads), rows=rows, notes=notes, most=_ROWS)


def _cells(contour: Contour, p: int) -> tuple[str, str]:
    worst = int(contour.limit[:, p].argmin())
    ends = [float(contour.limit[worst, p]), float(contour.limit[:, p].max())]
    # Of seas that break nobody wants to know what they would do to a winch.
    breaking = float(breaking_height(contour.periods)[p])
    most = min(breaking, contour.highest)
    top = f">{most:.2f}" if breaking < contour.highest else f">{most:g}"
    texts = [top if h >= most else f"{h:.2f}" for h in ends]
    several = contour.limit.shape[0] > 1
    by = _plain(str(contour.binding[worst, p]))
    by = "steepest seas" if ends[0] >= breaking else by
    return "..".join(texts if several else texts[:1]), by


def _plain(name: str) -> str:
    """Return the name of a limit without the machine it belongs to."""
    return name.removeprefix("motor.").removeprefix("rope.")


def _shares(study: Operability) -> list[Item]:
    first = study.depths[0]
    names = [n for n in WHO if n in first.workable]
    rows: list[tuple[float | str, ...]] = []
    for at in study.depths:
        lost = at.workable["loop" if "loop" in names else "held"].binding
        most = ", ".join(f"{_plain(n)} {percent(v)}" for n, v in list(lost.items())[:2])
        rows.append((at.length, *(at.workable[n].share for n in names), most))
        if study.headings is not None:
            best = [at.workable[n].best_heading or 0.0 for n in names]
            rows.append(("  best heading", *best, ""))
    heads = (
        Column("rope", write=lambda length: f"{length:g} m"),
        *(Column(n, WHO[n], write=percent) for n in names),
        *columns("lost to <"),
    )
    outside = first.workable["held"].outside
    beyond = f"{percent(outside)} of the time has periods outside the contour: not workable"
    notes = (beyond,) if outside > 5e-4 else ()
    items: list[Item] = [Table(columns=heads, rows=rows, notes=notes)]
    months = {n: s.by_month for n, s in first.workable.items() if s.by_month}
    if months:
        known = sorted(next(iter(months.values())))
        shares = [
            (WHO[n], *(months[n][m] for m in known))
            for n in ("held", "loop", "reoptimised")
            if n in months
        ]
        each = [Column(MONTHS[m - 1], write=lambda v: f"{100.0 * v:.0f}") for m in known]
        note = f"% of each month with {first.length:g} m of rope"
        items.append(Table(columns=(Column("system", ""), *each), rows=shares, notes=(note,)))
    return items
