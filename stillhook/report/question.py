"""The first chapters of a report: which document it is, its verdict, and what the design rests on.

Identification, summary, basis of design, vessel and sea, system.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from typing import Any

from models.case import Case, case_schema

from ..text import (
    ReportSection,
    Sentence,
    Table,
    Written,
    columns,
    heading_words,
    number,
    percent,
    scale,
)
from .data import Told
from .findings import Findings
from .sources import Sources, cited, step
from .wording import (
    CASE,
    DESIGN,
    OWN,
    RESULTS,
    chapter,
    degrees,
    exact,
    exposure,
    names_of,
    rows_table,
)

_ID = f"{RESULTS}/identification"
_MOTION = f"{RESULTS}/motion"
_MOTIONS = {"hook": "hook", "load, drum held": "held", "load, compensated": "compensated"}
_BRIEF = {
    "title": "title",
    "project": "project",
    "client": "client",
    "document": "document",
    "date": "date",
    "prepared by": "author",
    "checked by": "checker",
    "approved by": "approver",
}
_ASSUMPTIONS = (
    "Figures hold for the inputs of the basis of design, in long-crested or spread seas as stated "
    "there; seas, sensor noise and motion are Gaussian, and largest values are those of the "
    "exposure time with the probability of exceedance that the limits state.",
    "The loop is linear about the static operating point, with drag and the losses of gear and dry "
    "friction linearised stochastically; the time simulations are not linear.",
    "The rope's damping is not known to better than a factor: the design holds at the least "
    "damping that the case states, too.",
    "The document is calculated, not measured: commissioning has to show that inputs and response "
    "are as stated here. It is no safety assessment, and the controller is no safety function.",
)


def identification(s: Sources) -> ReportSection:
    """Return which document this is: case, code, seeds, revisions, status and assumptions."""
    rows: list[tuple[str, Any]] = []
    for label, name in _BRIEF.items():
        if s.value(f"{_ID}/{name}"):
            rows.append((label, s.cite(f"{_ID}/{name}")))
    rows += [
        ("case", s.say("{}: {}", s.cite(f"{_ID}/case"), s.cite(f"{_ID}/description"))),
        ("hash of the case (SHA-256)", s.cite(f"{_ID}/digest")),
        ("hash of the design file (SHA-256)", s.cite(f"{_ID}/design_digest")),
        (
            "computed with",
            s.say(
                "Stillhook {}, Python {}", *(s.cite(f"{_ID}/{n}") for n in ("stillhook", "python"))
            ),
        ),
    ]
    for what in s.value(f"{_ID}/seeds"):
        numbers = s.value(f"{_ID}/seeds{step(what)}")
        cites = [s.cite(f"{_ID}/seeds{step(what)}/{k}") for k in range(len(numbers))]
        rows.append((f"seeds, {what}", s.say(", ".join(["{}"] * len(cites)), *cites)))
    revisions = s.value(f"{_ID}/revisions")
    names = ("mark", "date", "text", "author", "checker", "approver")
    table = Table(
        title="Revisions",
        columns=columns("mark=revision <; date <; text=status <; author=prepared <; "
                        "checker=checked <; approver=approved <"),
        rows=[
            [s.cite(f"{_ID}/revisions/{k}/{name}") if revision[name] else "" for name in names]
            for k, revision in enumerate(revisions)
        ],
    )  # fmt: skip
    return chapter(
        "Identification",
        rows_table(rows, "name=; text=<"),
        table,
        ReportSection("Status and assumptions", [
            s.say("Status: {}.", s.cite(f"{_ID}/status")), *_ASSUMPTIONS
        ]),
    )  # fmt: skip


def summary(s: Sources, findings: Findings) -> ReportSection:
    """Return the verdict, the load's motion against what is required, and what limits it."""
    moves = f"{_MOTION}/compensated"
    verdict = s.say("The design is NOT ok: {}.", s.cite(f"{_ID}/status"))
    if s.value(f"{_ID}/ok"):
        verdict = s.say(
            "The design keeps every limit in H_s {}: the load moves {} rms, {} of the hook's "
            "motion.",
            s.cite(f"{DESIGN}#/significant_height", "m"),
            s.cite(f"{DESIGN}#/payload_rms", "m"),
            s.cite(f"{_MOTION}/residual", write=percent),
        )
    rows = []
    for name, key in _MOTIONS.items():
        place = f"{_MOTION}/{key}"
        if s.has(place):
            rows.append(
                (name, *(s.cite(f"{place}/{n}", "m") for n in ("rms", "significant", "largest")))
            )
    motion = Table(
        columns=columns("motion=vertical motion; rms; significant=significant double amplitude; "
                        "largest=most probable maximum (MPM)"),
        rows=rows,
        notes=(
            s.say("largest in {}, probability of exceedance {}", exposure(s),
                  s.cite(f"{_MOTION}/exceedance", write=percent)),
        ),
    )  # fmt: skip
    residual = None
    if s.has(moves):
        residual = s.say(
            "Residual motion: {} of the hook's ({}), {} of the load's with the drum held ({}).",
            s.cite(f"{_MOTION}/residual", write=percent),
            s.cite(f"{_MOTION}/attenuation", write=_dB),
            s.cite(f"{_MOTION}/residual_held", write=percent),
            s.cite(f"{_MOTION}/attenuation_held", write=_dB),
        )
    return chapter("Summary", verdict, motion, residual, _required(s), *_limiting(s, findings))


def _dB(value: float) -> str:
    return f"{value:.1f} dB"


def _required(s: Sources) -> Table | str:
    rows, broken = [], []
    for k, one in enumerate(s.value(f"{RESULTS}/requirement")):
        place, unit = f"{RESULTS}/requirement/{k}", one["unit"]
        broken += [] if one["kept"] else [k]
        rows.append((
            names_of(one["name"]),
            s.cite(f"{place}/bound", unit),
            s.cite(f"{place}/value", unit),
            "kept" if one["kept"] else "NOT kept",
        ))  # fmt: skip
    if not rows:
        return (
            "No requirement on the load's motion was stated: the verdict is on the limits of the "
            "case alone, see the utilisation of limits."
        )
    heads = columns("criterion=requirement; required; reached; verdict <")
    note = "reached: with the worst signs that the sensors' errors may have, as limits are held to"
    return Table(columns=heads, rows=rows, broken=tuple(broken), notes=(note,))


def _limiting(s: Sources, findings: Findings) -> Iterator[Sentence]:
    binding = findings.design.binding
    if binding:
        names = ", ".join(names_of(name) for name in binding)
        yield s.say(f"What limits the design, the highest price first: {names}.")
    place = f"{RESULTS}/reports/operability/status"
    if s.has(place):
        yield s.say("Operability: {}.", s.cite(place))


def basis(s: Sources, case: Case) -> ReportSection:
    """Return every input with its unit and source."""
    units = dict(_units(case_schema()))
    sections = []
    for name in s.value(f"{CASE}#"):
        if name in ("stillhook", "name", "description", "sources"):
            continue
        rows = []
        for path, value in _leaves(s.value(f"{CASE}#/{name}"), (name,)):
            place, unit = (
                f"{CASE}#{''.join(step(part) for part in path)}",
                units.get(tuple(part for part in path if not part.isdigit()), ""),
            )
            told: Written | Sentence
            if isinstance(value, list):
                each = [_input(s, f"{place}/{k}", one, unit) for k, one in enumerate(value)]
                told = s.say(", ".join(["{}"] * len(each)), *each)
            else:
                told = _input(s, place, value, unit)
            rows.append((_path(path[1:]), told, _source(case, path)))
        if rows:
            table = rows_table(rows, "input=field; value; source <")
            sections.append(ReportSection(_titled(name), [table]))
    words = (
        "Every input of the case as its file has it, with the unit that the field has and the "
        "name of its source, which is told in full below; what has none is stated in the file."
    )
    return chapter("Basis of design", words, *sections, *_sources(s, case))


def _titled(name: str) -> str:
    text = name.replace("_", " ")
    return f"{text[:1].upper()}{text[1:]}"


def _sources(s: Sources, case: Case) -> Iterator[ReportSection]:
    if case.sources:
        rows = [(name, s.cite(f"{CASE}#/sources{step(name)}")) for name in case.sources]
        yield ReportSection("Sources", [rows_table(rows, "source; text=what it is <")])


def _input(s: Sources, place: str, value: Any, unit: str) -> Written:
    if isinstance(value, bool | str):
        return s.cite(place, write=lambda given: str(given))
    if unit == "rad":
        return s.cite(place, unit, write=_exact_degrees)
    if unit == "rad/s" and "speed" in place:
        unit = "rpm"  # of a motor
    factor, name = scale(unit, value)
    return s.cite(place, unit, write=lambda given: f"{exact(given / factor)} {name}".strip())


def _exact_degrees(angle: float) -> str:
    return f"{exact(round(math.degrees(angle), 8))} deg"


def _path(path: tuple[str, ...]) -> str:
    return re.sub(r"\.(\d+)", r"[\1]", ".".join(path)) or "value"


def _leaves(tree: Any, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Any]]:
    if isinstance(tree, Mapping):
        for name, item in tree.items():
            yield from _leaves(item, (*path, str(name)))
    elif isinstance(tree, list) and any(isinstance(item, Mapping) for item in tree):
        for k, item in enumerate(tree):
            yield from _leaves(item, (*path, str(k)))
    else:
        yield path, tree  # a list of numbers reads as one


def _units(schema: Mapping[str, Any]) -> Iterator[tuple[tuple[str, ...], str]]:
    """Yield the unit of each field of a case file by its path, from the file's schema."""
    defined = schema.get("$defs", {})

    def walk(node: Any, path: tuple[str, ...], seen: tuple[str, ...]) -> Iterator[Any]:
        if not isinstance(node, Mapping):
            return
        name = str(node.get("$ref", "")).rpartition("/")[2]
        if name and name not in seen:
            yield from walk(defined[name], path, (*seen, name))
        if node.get("x-unit"):
            yield path, node["x-unit"]
        for part in (*node.get("anyOf", ()), *node.get("oneOf", ()), *node.get("allOf", ())):
            yield from walk(part, path, seen)
        for key in ("items", "additionalProperties"):
            yield from walk(node.get(key), path, seen)
        for part in node.get("prefixItems", ()):
            yield from walk(part, path, seen)
        for field, part in node.get("properties", {}).items():
            yield from walk(part, (*path, field), seen)

    yield from walk(schema, (), ())


def _source(case: Case, path: tuple[str, ...]) -> str:
    """Return the name of the source that a field comes from: of the case's the closest."""
    words = {_stem(word) for part in path for word in part.split("_")}
    best, said = 0, ""
    for name in case.sources or {}:
        wanted = {_stem(word) for word in re.split(r"[\s_.]+", name)}
        if wanted <= words:
            place = max(k for k, part in enumerate(path)
                        if wanted & {_stem(word) for word in part.split("_")})  # fmt: skip
            rank = 10 * (place + 1) + len(wanted)
            if rank > best:
                best, said = rank, name
    return said


def _stem(word: str) -> str:
    return word.lower().removesuffix("s")


def vessel_and_sea(s: Sources, told: Told) -> ReportSection:
    """Return the sea, and how the crane's tip moves in it."""
    sea = f"{RESULTS}/sea"
    rows: list[tuple[str, Any]] = [
        (
            "sea",
            s.say("H_s {}, T_p {}, T_z {}, {}",
                  s.cite(f"{sea}/significant_height", "m"), s.cite(f"{sea}/peak_period", "s"),
                  s.cite(f"{sea}/zero_crossing_period", "s"), s.cite(f"{sea}/spectrum")),
        ),
        (
            "steepness",
            s.say("{}, seas stay below {}", s.cite(f"{sea}/steepness", digits=2),
                  s.cite(f"{sea}/breaking_steepness", digits=2)),
        ),
    ]  # fmt: skip
    if s.has(f"{sea}/heading"):
        heading = s.cite(f"{sea}/heading", "rad", write=heading_words)
        angle = s.cite(f"{sea}/heading", "rad", write=degrees)
        rows.append(("waves towards", s.say("{} from the bow: {}", angle, heading)))
    rows.append(
        ("share of the hook's variance outside the operator's table",
         s.cite(f"{sea}/outside_table", write=percent))
    )  # fmt: skip
    tip = Table(
        title="Vertical motion of the crane's tip",
        columns=columns("motion; rms; significant=significant double amplitude; period=T_z; "
                        "largest=most probable maximum (MPM)"),
        rows=[
            (
                name,
                s.cite(f"{place}/rms", one["unit"]),
                s.cite(f"{place}/significant", one["unit"]),
                s.cite(f"{place}/zero_crossing_period", "s"),
                s.cite(f"{place}/largest", one["unit"]),
            )
            for name, one in s.value(f"{sea}/tip_motions").items()
            for place in (f"{sea}/tip_motions/{name}",)
        ],
        notes=(s.say("largest in {}", exposure(s)),),
    )  # fmt: skip
    operator = Table(
        title="Response amplitude operator (RAO) of the tip's heave",
        columns=columns("period=wave period; amplitude=amplitude per metre of wave; phase"),
        rows=[
            (
                s.cite(f"{sea}/tip_operator/{k}/period", "s"),
                s.cite(f"{sea}/tip_operator/{k}/amplitude", write=lambda x: f"{number(x)} m/m"),
                s.cite(f"{sea}/tip_operator/{k}/phase", "rad", write=degrees),
            )
            for k in range(len(s.value(f"{sea}/tip_operator")))
        ],
    )
    survey = cited(told.hook, OWN, "/results/reports/hook")
    first, *others = survey.sections
    # Its first table is the one above, in words of its own.
    rest = [*first.items[1:], *others]
    return chapter("Vessel and sea", rows_table(rows, "name=; text=<"), tip, operator, *rest)


def system(s: Sources) -> ReportSection:
    """Return what hangs on the hook: stiffness, modes and their place in the wave band, drag."""
    at = f"{RESULTS}/system"
    tables = []
    for title, part, fields in _FACTS:
        rows = []
        for label, field, unit in fields:
            place = f"{at}/{part}/{field}"
            if not s.has(place):
                continue
            share = unit == "%"
            figure = s.cite(place, "" if share else unit, write=percent if share else None)
            rows.append((label, figure))
        tables.append(ReportSection(title, [rows_table(rows, "name=; figure=<")]))
    band = [s.cite(f"{at}/waves/{name}", "rad/s") for name in ("low", "high", "peak")]
    modes = Table(
        columns=columns(
            "mode; period; frequency; damping=damping ratio; place=in the waves' band <; "
            "density=density of the hook's motion there over its largest"
        ),
        rows=[
            (
                s.cite(f"{place}/number"),
                s.cite(f"{place}/period", "s"),
                s.cite(f"{place}/frequency", "rad/s"),
                s.cite(f"{place}/damping_ratio", write=lambda ratio: f"{100.0 * ratio:.2g} %"),
                {"below": "below it", "in": "IN it", "above": "above it"}[mode["place"]],
                s.cite(f"{place}/relative_density", digits=2),
            )
            for k, mode in enumerate(s.value(f"{at}/modes"))
            for place in (f"{at}/modes/{k}",)
        ],
        notes=(
            s.say(
                "the waves' band holds nine tenths of the variance of the hook's motion: {} to {}, "
                "its peak at {}",
                *band,
            ),
        ),
    )
    chain, *rest = tables
    return chapter("System", chain, ReportSection("Axial modes, drum held", [modes]), *rest)


#: By title and part of the system's facts: label, field, unit.
_FACTS: tuple[tuple[str, str, tuple[tuple[str, str, str], ...]], ...] = (
    (
        "Chain of tip, rope and slings",
        "rope",
        (
            ("parallel falls", "falls", ""),
            ("axial stiffness of the rope EA", "axial_stiffness", "N"),
            ("stiffness of the rope K = EA/L, all falls", "stiffness", "N/m"),
            ("stiffness of the crane's tip", "tip_stiffness", "N/m"),
            ("stiffness of the slings", "sling_stiffness", "N/m"),
            ("stiffness of all in series", "series_stiffness", "N/m"),
            ("share of the tip in the stretch", "tip_share", "%"),
            ("mass of the load in air", "payload_mass", "kg"),
            ("added mass", "added_mass", "kg"),
            ("mass of the hook block", "block_mass", "kg"),
            ("mass of the rope", "rope_mass", "kg"),
            ("mass that moves, M", "moving_mass", "kg"),
            ("stretch at rest, which set-down gives back", "stretch", "m"),
            ("of it the rope's", "rope_stretch", "m"),
            ("travel time of an axial wave, end to end", "travel_time", "s"),
        ),
    ),
    (
        "Load with the drum held",
        "held",
        (
            ("linear drag", "drag", "N s/m"),
            ("how it is found", "drag_method", ""),
            ("motion of the load, rms", "payload_rms", "m"),
            ("over the hook's", "factor", ""),
        ),
    ),
    (
        "Winch at rest, and what following the hook asks of it",
        "winch",
        (
            ("drum radius, rope paid out", "drum_radius", "m"),
            ("static tension at the drum, each fall", "drum_tension", "N"),
            ("... paying out the lightest load", "drum_tension_least", "N"),
            ("... hauling in", "drum_tension_hauling", "N"),
            ("... of what the rope may carry", "tension_share", "%"),
            ("static tension at the load", "load_tension", "N"),
            ("... of the lightest load", "load_tension_least", "N"),
            ("tension that is to stay in the rope", "tension_to_stay", "N"),
            ("static motor torque, hauling in", "static_torque", "N m"),
            ("... of the rating", "rating_share", "%"),
            ("... of the peak", "peak_share", "%"),
            ("fastest rope", "rope_speed", "m/s"),
            ("hook's largest speed, most probable", "hook_speed", "m/s"),
            ("... of the fastest rope", "speed_share", "%"),
            ("inertia at the motor", "inertia", "kg m2"),
            ("... as a mass at the load", "equivalent_mass", "kg"),
            ("power to follow the hook", "following_power", "W"),
        ),
    ),
)
