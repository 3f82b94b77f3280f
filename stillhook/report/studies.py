"""The last chapters of a report: what the studies of the design came to, and how it was checked.

Robustness, operability, alternatives, energy and heat, failure modes, verification, appendix.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..sweeps import cumulative_share, violins
from ..text import (
    Drawing,
    Item,
    Listing,
    Report,
    ReportSection,
    Table,
    Written,
    columns,
    count,
    duration,
    number,
)
from .data import Told
from .findings import Findings
from .sources import Sources, cited, cited_section, cited_table
from .wording import CASE, DESIGN, OWN, RESULTS, chapter, not_part, rows_table

if TYPE_CHECKING:
    import xarray as xr

    from synth.design import Design


def _study(s: Sources, report: Report, name: str, title: str) -> ReportSection:
    """Return a study's report as a part of a chapter: its verdict, then what it has."""
    place = f"/results/reports/{name}"
    found = cited(report, OWN, place)
    items: list[Item] = []
    if report.about:
        items.append(s.say("Asked: {}.", s.cite(f"{OWN}#{place}/about")))
    if report.status:
        mark = "NOT ok: {}." if report.ok is False else "{}."
        items.append(s.say(mark, s.cite(f"{OWN}#{place}/status")))
    for section in found.sections:
        plain = not str(section.title)
        items += section.items if plain else [section]
    return ReportSection(title, items)


def robustness(s: Sources, told: Told, findings: Findings) -> ReportSection:
    """Return sensitivities, how far numbers may be off, and the design on many cases."""
    parts = []
    for report, name, title in (
        (told.sensitivity, "sensitivity", "Sensitivity to each input"),
        (told.robustness, "robustness", "How far the numbers may be off together"),
        (told.sweep, "sweep", "The design on many plants"),
    ):
        if report is not None:
            parts.append(_study(s, report, name, title))
    if not parts:
        return not_part("Robustness", "neither sensitivity nor a sweep was given")
    figures = [] if findings.sweep is None else _sweep_drawings(findings.sweep, findings.design)
    return chapter("Robustness", *parts, *figures)


def _sweep_drawings(result: xr.Dataset, own: Design) -> list[Drawing]:
    design = None if result.attrs.get("mode") == "time" else own
    return [
        Drawing("sweep-violins", "How far the figures spread", lambda: violins(result, design)),
        Drawing(
            "sweep-share",
            "Share of the plants within each motion",
            lambda: cumulative_share(result, design=design),
        ),
    ]


def operability(s: Sources, told: Told) -> ReportSection:
    """Return in which seas the winch can work, and the weather windows."""
    if told.operability is None:
        return not_part("Operability", "no study of operability was given")
    parts: list[Item] = [_study(s, told.operability, "operability", "Limiting seas")]
    if told.windows is None:
        parts.append("No series of seas was given: there are no weather windows in this issue.")
    else:
        parts.append(cited_section(told.windows, OWN, "/results/reports/windows"))
    return chapter("Operability", *parts)


def alternatives(s: Sources, told: Told) -> ReportSection:
    """Return other structures, other controllers in the same seas, and the best possible."""
    parts: list[Item] = []
    if "structures" in told.tables:
        table = cited_table(told.tables["structures"], OWN, "/results/tables/structures")
        parts.append(ReportSection("Other structures", [table]))
    if told.bound.sections and told.bound.sections[0].items:
        section = cited(told.bound, OWN, "/results/reports/bound").sections[0]
        parts.append(ReportSection("The best possible", section.items))
    if told.comparison is not None:
        parts.append(
            _study(s, told.comparison, "comparison", "Other controllers, and the floor, in time")
        )
    else:
        parts.append("No comparison with predictive control was given for this issue.")
    return chapter("Alternatives", *parts)


_KWH = 3.6e6  # [J]
#: What is told of energy and heat: label, quantity of the runs, unit.
_ENERGY = (
    ("mean power", "motor power mean", "W"),
    ("largest power", "motor power largest", "W"),
    ("mean power fed back", "regenerated power mean", "W"),
    ("largest power fed back", "regenerated power largest", "W"),
    ("energy per hour, motoring", "energy per hour, motoring", "J/h"),
    ("energy per hour, fed back", "energy per hour, regenerated", "J/h"),
    ("energy per hour, net", "energy per hour, net", "J/h"),
    ("motor torque, rms", "motor torque rms", "N m"),
    ("motor torque, thermal equivalent", "motor torque thermal equivalent", "N m"),
    ("motor temperature above ambient", "motor temperature rise largest", "K"),
)


def energy(s: Sources) -> ReportSection:
    """Return power, energy and heat of the motor, from runs in time."""
    at = f"{RESULTS}/operation/design"
    if not s.has(at):
        return not_part("Energy and heat", "no simulation was given")
    rows = []
    for label, name, unit in _ENERGY:
        place = f"{at}/means/{name}"
        if s.has(f"{place}/value"):
            between: Any = ""
            if s.has(f"{place}/low") and s.has(f"{place}/high"):
                ends = (_spent(s, f"{place}/{end}", unit) for end in ("low", "high"))
                between = s.say("{} to {}", *ends)
            rows.append((label, _spent(s, f"{place}/value", unit), between))
    runs = s.say(
        "Mean over {} of {} each in the case's own sea, with the intervals of that mean.",
        s.cite(f"{at}/seeds", write=lambda seeds: count(len(seeds), "run")),
        s.cite(f"{at}/duration", "s", write=duration),
    )
    table = rows_table(rows, "name=quantity; figure=mean; between=interval")
    return chapter("Energy and heat", runs, table)


def _spent(s: Sources, place: str, unit: str) -> Written:
    if unit == "J/h":
        return s.cite(place, unit, write=lambda value: f"{number(value / _KWH)} kWh/h")
    return s.cite(place, unit)


def failures(s: Sources, told: Told) -> ReportSection:
    """Return what the load does when something fails: in the first seconds, and after."""
    if "sheet" not in told.tables:
        return not_part("Failure modes", "failures were not simulated")
    at = f"{RESULTS}/failures"
    words = s.say(
        "With the design at work one thing at a time fails for {}, in {} of the case's own sea, at "
        "the moment at which the drum turns fastest. Undisturbed the load moves {} rms and {} at "
        "most, with the drum held {} and {}.",
        s.cite(f"{at}/lasting", "s", write=duration),
        s.cite(f"{at}/seeds", write=lambda seeds: count(len(seeds), "seed")),
        *(
            s.cite(f"{at}/{who}/{what}", "m")
            for who in ("undisturbed", "held")
            for what in ("rms", "largest")
        ),
    )
    tables = [
        cited_table(told.tables[name], OWN, f"/results/tables/{name}")
        for name in ("sheet", "failures")
    ]
    return chapter("Failure modes", words, *tables)


def verification(s: Sources) -> ReportSection:
    """Return each figure by two routes, and their difference."""
    at = f"{RESULTS}/verification"
    if not s.has(at):
        return not_part("Verification", "the design was not checked")
    rows: list[tuple[Any, ...]] = []
    broken: list[int] = []
    checks = s.value(f"{at}/checks")
    for k, check in enumerate(checks):
        place = f"{at}/checks/{k}"
        if not check["ok"] and check["counts"]:
            broken.append(len(rows))
        verdict = "ok" if check["ok"] else ("NOT ok" if check["counts"] else "told")
        rows.append(
            (
                check["name"],
                s.cite(f"{place}/claimed", digits=6),
                s.cite(f"{place}/found", digits=6),
                s.cite(f"{place}/difference", write=lambda share: f"{share:.1e}"),
                s.cite(f"{place}/note") if check["note"] else "",
                verdict,
            )
        )
    table = Table(
        columns=columns("quantity=quantity; route_1=route 1, as claimed; route_2=route 2; "
                        "difference; how=by which route <; verdict <"),
        rows=rows,
        broken=tuple(broken),
    )  # fmt: skip
    words = (
        "Route 1 is what the design claims; route 2 is other code, which shares neither plant, "
        "quadrature nor search with it. In SI units; of a bound that is kept, route 1 is the "
        "bound, and no difference is told."
    )
    return chapter(
        "Verification",
        s.say("{}.", s.cite(f"{DESIGN}#/verification/status")),
        words,
        table,
    )


def appendix(s: Sources, told: Told) -> ReportSection:
    """Return the case and the design as their files have them."""
    brief = told.design_text.split("\nstarts:")[0]
    return chapter(
        "Appendix",
        "The files that figures are read from lie beside this document: case.yaml and design.yaml "
        "load again in Stillhook, report.json holds every figure with the file and the field that "
        "it came from, and the folder tables each table as CSV, by chapter.",
        Listing(CASE, told.findings.case.to_yaml()),
        Listing(f"{DESIGN}, its first part", brief),
    )
