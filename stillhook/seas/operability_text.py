"""Operability as text: tables for the terminal, the shares as CSV, the data set as bytes."""

from __future__ import annotations

import csv
import io
import math
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING

from synth.operability import AtDepth, Operability

from ..text import pairs, percent
from ..text.terminal import _put, _table

if TYPE_CHECKING:
    import xarray as xr
    from rich.console import Console

    from synth.operability import Contour, ContourCheck

_MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")
_WHO = {"held": "drum held", "loop": "design", "reoptimised": "anew", "perfect": "perfect"}
_ROWS = 20


def show_operability(study: Operability, checks: Sequence[ContourCheck], out: Console) -> None:
    """Write a study: the verdict, a table for each length of rope, the shares of the year."""
    out.print(f"{study.case.name}: {study.status}", soft_wrap=True)
    if study.headings is None:
        out.print("no headings: the vessel is given by the heave of its hook alone")
    for at in study.depths:
        out.print()
        out.print(f"rope {at.rope}", style="bold", soft_wrap=True)
        if study.design is not None:
            out.print(f"  {study.margin_text(at)}")
        _show_contours(at, out)
    if study.scatter is not None:
        out.print()
        _show_shares(study, out)
    out.print()
    rows = []
    if checks:
        worst = max(check.difference for check in checks)
        good = all(check.ok for check in checks)
        rows.append(
            (
                "checked",
                f"{len(checks)} points of the contour by single evaluations: the limit is met to "
                f"{worst:.0e}" + ("" if good else ", which is NOT within 1e-06"),
            )
        )
    if not study.wanted:
        rows.append(("payload", "no bound on its motion was given: --payload-rms, --payload-max"))
    rows.append(("perfect", "a winch that holds the rope's upper end still, by its own limits"))
    pairs(rows, out)
    out.print()


def workable_csv(study: Operability) -> str:
    """Return the shares of the year as CSV: a line for each length of rope and system."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    head = ["rope_length_m", "system", "workable", "best_heading", "outside_the_contour"]
    writer.writerow([*head, *_MONTHS])
    for at in study.depths:
        for name, share in at.workable.items():
            best = "" if share.best_heading is None else f"{share.best_heading:.6f}"
            row = [f"{at.rope.length:g}", name, f"{share.share:.6f}", best, f"{share.outside:.6f}"]
            months = [share.by_month.get(m) for m in range(1, 13)]
            writer.writerow([*row, *("" if v is None else f"{v:.6f}" for v in months)])
    return out.getvalue()


def netcdf(dataset: xr.Dataset) -> bytes:
    """Return a data set as the bytes of a NetCDF file."""
    plain = dataset.copy()
    for name, variable in plain.variables.items():
        if variable.dtype == object:
            plain[name] = variable.astype(str)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the libraries below, on what nobody can change here
        return bytes(plain.to_netcdf(engine="h5netcdf"))


def _show_contours(at: AtDepth, out: Console) -> None:
    names = [n for n in _WHO if n in at.contours]
    turns = at.main.headings is not None
    headings = ["T_p"]
    for name in names:
        headings += [_WHO[name], "set by"]
    table = _table(*headings, left=tuple(range(2, len(headings), 2)))
    every = max(1, -(-at.main.periods.size // _ROWS))
    for p in range(0, at.main.periods.size, every):
        row = [f"{at.main.periods[p]:.3g} s"]
        for name in names:
            row += _cells(at.contours[name], p)
        table.add_row(*row)
    _put(table, out)
    if turns:
        out.print("  H_s [m] in the worst and the best heading; what binds in the worst")


def _cells(contour: Contour, p: int) -> list[str]:
    worst = int(contour.limit[:, p].argmin())
    low, high = float(contour.limit[worst, p]), float(contour.limit[:, p].max())
    text = _height(low, contour.highest)
    if contour.limit.shape[0] > 1:
        text += f"..{_height(high, contour.highest)}"
    return [text, _short(str(contour.binding[worst, p]))]


def _short(name: str) -> str:
    """Return the name of a limit without the machine it belongs to."""
    return name.removeprefix("motor.").removeprefix("rope.")


def _height(value: float, highest: float) -> str:
    return f">{highest:g}" if math.isinf(value) else f"{value:.2f}"


def _show_shares(study: Operability, out: Console) -> None:
    assert study.scatter is not None
    turns = study.headings is not None
    names = [n for n in _WHO if n in study.depths[0].workable]
    out.print(f"workable share of the year, {study.scatter.source}", style="bold", soft_wrap=True)
    titles = ["rope", *(_WHO[n] for n in names), "lost to"]
    table = _table(*titles, left=(0, len(titles) - 1))
    for at in study.depths:
        lost = at.workable["loop" if "loop" in names else "held"].binding
        most = ", ".join(f"{_short(n)} {percent(v)}" for n, v in list(lost.items())[:2])
        shares = [percent(at.workable[n].share) for n in names]
        table.add_row(f"{at.rope.length:g} m", *shares, most)
        if turns:
            best = [percent(at.workable[n].best_heading or 0.0) for n in names]
            table.add_row("  best heading", *best, "")
    _put(table, out)
    months = {n: s.by_month for n, s in study.depths[0].workable.items() if s.by_month}
    if months:
        known = sorted(next(iter(months.values())))
        table = _table("", *(_MONTHS[m - 1] for m in known))
        for name in [n for n in ("held", "loop", "reoptimised") if n in months]:
            table.add_row(_WHO[name], *(f"{100.0 * months[name][m]:.0f}" for m in known))
        _put(table, out)
        out.print(f"  % of each month with {study.depths[0].rope.length:g} m of rope")
    outside = study.depths[0].workable["held"].outside
    if outside > 5e-4:
        out.print(f"  {percent(outside)} of the time has periods outside the contour: not workable")
    table = _table("rules of thumb, 1975 thesis, Table 2", "safe", "or marginal")
    for rule, safe, marginal in study.rules():
        table.add_row(rule.operation, percent(safe), percent(marginal))
    out.print()
    _put(table, out)
