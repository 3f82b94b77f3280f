"""The middle chapters of a report: the controller, its stability, limits and loads.

Design, stability, utilisation of limits, loads.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from models.rig import DCMotor
from synth.design import Design

from ..designs import AT_LEAST, command_text
from ..text import (
    Column,
    Drawing,
    ReportSection,
    Sentence,
    Table,
    Written,
    columns,
    count,
    decibels,
    delay_margin,
    duration,
    percent,
)
from .data import LARGEST_LAW, Told
from .diagram import block_diagram
from .findings import Findings
from .sources import Sources, cited_table, quoted, step
from .wording import (
    DESIGN,
    OWN,
    RESULTS,
    chapter,
    degrees,
    names_of,
    rows_table,
    times,
)

#: What a signal is, and which way it counts, by its name.
SIGNALS = {
    "payload.acceleration": ("acceleration of the load", "positive upwards"),
    "payload.velocity": ("velocity of the load", "positive upwards"),
    "payload.displacement": ("load's place from where it is to hang", "positive upwards"),
    "mru.heave": ("heave of the crane's tip by the motion reference unit", "positive upwards"),
    "mru.heave_rate": ("its rate", "positive upwards"),
    "drum.haul": ("rope hauled in by the drum, from its encoder", "positive when hauling in"),
    "motor.speed": ("speed of the motor", "positive when hauling in"),
    "motor.torque": ("torque of the motor", "positive when it lifts"),
    "rope.tension": ("rope tension at the drum, by the load cell", "positive in tension"),
    "drive.command": ("set point of the drive", "positive when hauling in"),
}
_MARGINS = f"{DESIGN}#/margins"
_FORMS = (
    ("continuous", "Continuous form: dx/dt and u by x and y", "x' = A x + B y, u = C x + D y"),
    ("discrete", "Discrete form: the next x, and u, by x and y", "x+ = A x + B y, u = C x + D y"),
)


def design_chapter(s: Sources, findings: Findings) -> ReportSection:
    """Return the controller: block diagram, parameters, both forms, signals and their signs."""
    design = findings.design
    at = f"{RESULTS}/controller"
    told = design.structure
    drawing = Drawing(
        "block-diagram", f"Block diagram of the loop, {told}", lambda: block_diagram(design)
    )
    values = Table(
        title="Parameters",
        columns=columns("parameter; value; unit <"),
        rows=[
            (
                name,
                s.cite(f"{DESIGN}#/parameters{step(name)}", write=lambda value: f"{value:.6g}"),
                design.units.get(name, "").replace("-", ""),
            )
            for name in design.parameters
        ],
    )
    controller = s.value(at)
    names = [one["name"] for one in controller["signals"]]
    states = [f"x_{k + 1}" for k in range(controller["states"])]
    heads = (Column("row", ""), *(Column(name) for name in (*states, *names)))
    rows = [*(f"x_{k + 1}" for k in range(len(states))), "u"]
    forms: list[Any] = []
    if len(states) <= LARGEST_LAW:
        for form, name, words in _FORMS:
            forms.append(f"`{words}`")
            forms.append(Table(title=name, columns=heads, rows=[
                (label, *(s.cite(f"{at}/{form}/{r}/{c}", write=_entry)
                          for c in range(len(states) + len(names))))
                for r, label in enumerate(rows)
            ]))  # fmt: skip
    else:
        forms.append(
            s.say("The controller has {} states; its matrices stand in report.json at "
                  "/results/controller.", s.cite(f"{at}/states"))
        )  # fmt: skip
    sampled = s.say(
        "The discrete form is the continuous one by Tustin's rule, sampled every {}; u is added to "
        "the static command, and y counts from where the operator wants the load.",
        s.cite(f"{at}/sample_time", "s"),
    )
    return chapter(
        "Design",
        f"`{command_text(design)}`",
        drawing,
        values,
        *forms,
        sampled,
        _signals(s, design),
    )


def _entry(value: float) -> str:
    return f"{value:.6g}" if value else "0"  # and not -0


def _signals(s: Sources, design: Design) -> Table:
    at = f"{RESULTS}/controller"
    rows: list[tuple[Any, ...]] = []
    for k, one in enumerate(s.value(f"{at}/signals")):
        what, sign = SIGNALS.get(one["name"], (names_of(one["name"]), ""))
        delay = s.cite(f"{at}/signals/{k}/delay", "s")
        rows.append((one["name"], "in", what, one["unit"], sign, delay))
    command = s.value(f"{at}/command")
    what, sign = SIGNALS["drive.command"]
    if isinstance(design.case.winch.motor, DCMotor):
        what = "armature voltage"
    rows.append((command["name"], "out", what, command["unit"], sign, ""))
    heads = columns("signal=signal; way=<; what=what it is <; unit <; sign <; delay")
    return Table(title="Signals", columns=heads, rows=rows)


def stability(s: Sources, told: Told, findings: Findings) -> ReportSection:
    """Return the margins of the loop, in every member of the design's family."""
    design = findings.design
    if design.margins is None:
        return chapter(
            "Stability", s.say("There is no stable loop: {}.", s.cite(f"{DESIGN}#/status"))
        )
    rows = [
        (
            "sensitivity peak M_s",
            _margin(s, "max_sensitivity"),
            _margin(s, "peak", "rad/s", "at {}"),
        ),
        ("gain may grow", _margin(s, "gain", write=times), _margin(s, "gain", write=decibels)),
        ("gain may fall", _margin(s, "gain_down", write=_fall), ""),
        ("phase margin", _margin(s, "phase", write=_phase), ""),
        ("delay margin", _margin(s, "delay", write=delay_margin), "further delay of the command"),
        ("disk margin", _margin(s, "disk"), "gain and phase together"),
    ]
    members = [
        (s.cite(f"{RESULTS}/motion/members/{k}", "m"), *_member(s, k))
        for k in range(len(design.members))
    ]
    family = None
    if members:
        family = Table(
            title="Further members of the family, with the same controller",
            columns=columns("payload_rms=load's rms; M_s; gain=gain may grow; status=<"),
            rows=members,
        )
    return chapter(
        "Stability", rows_table(rows, "name=; figure=; remark=<"), family, told.drawing("nyquist")
    )


def _margin(s: Sources, name: str, unit: str = "", words: str = "{}", write: Any = None) -> Any:
    figure = s.cite(f"{_MARGINS}/{name}", unit, write=write)
    return figure if words == "{}" else s.say(words, figure)


def _fall(factor: float) -> str:
    return times(factor) if factor > 0.0 else "to nothing"


def _phase(angle: float) -> str:
    return "no bound" if math.isinf(angle) else degrees(angle)


def _member(s: Sources, k: int) -> tuple[Any, ...]:
    place = f"{DESIGN}#/members/{k}"
    if not s.has(f"{place}/margins"):
        return "", "", s.cite(f"{place}/status")
    return (
        s.cite(f"{place}/margins/max_sensitivity"),
        s.cite(f"{place}/margins/gain", write=times),
        s.cite(f"{place}/status"),
    )


def utilisation(s: Sources, told: Told, findings: Findings) -> ReportSection:
    """Return how much of each limit is used, and what it costs the load."""
    design = findings.design
    rows: list[tuple[Any, ...]] = []
    broken: list[int] = []
    for name, use in sorted(design.limits.items(), key=lambda pair: not pair[1].enforced):
        place, label = f"{DESIGN}#/limits{step(name)}", f"{RESULTS}/labels{step(name)}"
        unit = "rpm" if use.name.startswith("motor.speed") else use.unit
        sign = "at least" if use.name in AT_LEAST else "at most"
        if use.enforced and not use.kept:
            broken.append(len(rows))
        price = s.cite(f"{place}/price", "m", digits=2) if name in design.binding else ""
        rows.append(
            (
                quoted(s.value(label), OWN, label.partition("#")[2]),
                _measured(s, f"{place}/value", unit),
                s.say("{} {}", sign, _measured(s, f"{place}/bound", unit)),
                s.cite(f"{place}/use", write=percent),
                price,
                "" if use.enforced else "reported only",
            )
        )  # fmt: skip
    heads = columns("limit; value; bound; use; price; remark=<")
    notes = ("price: by how much the load's rms would fall if the bound were a hundredth looser",)
    table = Table(columns=heads, rows=rows, broken=tuple(broken), notes=notes)
    further = [
        cited_table(told.tables[name], OWN, f"/results/tables/{name}")
        for name in ("expected", "shares")
        if name in told.tables
    ]
    return chapter("Utilisation of limits", table, told.drawing("limits"), *further)


def _measured(s: Sources, place: str, unit: str) -> Written:
    value = s.value(place)
    if isinstance(value, float) and math.isinf(value):
        return s.cite(place, write=lambda _: "no bound")
    return s.cite(place, unit, digits=4)


def loads(s: Sources) -> ReportSection:
    """Return DAF, hook load, least tension at both ends, and the chance of a snap."""
    at = f"{RESULTS}/loads"
    words = s.say(
        "Loads of {} in H_s {}. The hook load is the tension at the load's end of the rope. "
        "Largest and least are most probable extremes with the losses as they switch, rare ones "
        "are exceeded with a probability of {}; values on the safe side are those that the limits "
        "have, with the losses in full.",
        s.cite(f"{at}/exposure_time", "s", write=duration),
        s.cite(f"{at}/significant_height", "m"),
        s.cite(f"{at}/rare", write=percent),
    )
    places = [
        (condition, end, f"{at}/{key}/{name}")
        for condition, key in (("drum held", "held"), ("compensated", "compensated"))
        if s.has(f"{at}/{key}")
        for end, name in (("hook load", "hook_load"), ("at the drum, each fall", "drum"))
    ]
    heads = [Column("quantity", "")]
    heads += [Column(place.rpartition("results")[2], f"{end}, {c}") for c, end, place in places]
    rows = [
        (label, *(_load(s, f"{place}/{field}", unit) for _, _, place in places))
        for label, field, unit in _LOADS
    ]
    table = Table(columns=tuple(heads), rows=rows)
    return chapter("Loads", words, table, *_snaps(s))


def _load(s: Sources, place: str, unit: str) -> Written:
    if unit == "%":
        return s.cite(place, write=_chance)
    return s.cite(place, unit)


def _chance(share: float) -> str:
    """Return a probability in percent, a small one by its power of ten."""
    return percent(share) if share == 0.0 or share >= 1e-3 else f"{100.0 * share:.0e} %"


def _snaps(s: Sources) -> Iterator[Sentence]:
    """Say what the simulations saw of slack rope and snap loads, where there are some."""
    for who, words in (("held", "the drum held"), ("design", "the design at work")):
        place = f"{RESULTS}/operation/{who}"
        if s.has(place):
            said = (
                "Simulated with {}, the rope was slack in {} of {} of {}; largest tension at the "
                "drum {}, least in the rope {}"
            )
            figures = [
                s.cite(f"{place}/shares/slack/count"),
                s.cite(f"{place}/shares/slack/total", write=lambda n: count(n, "run")),
                s.cite(f"{place}/duration", "s", write=duration),
                s.cite(f"{place}/largest/rope tension largest", "N"),
                s.cite(f"{place}/least/rope tension smallest", "N"),
            ]
            if s.has(f"{place}/largest/snap load"):
                said += ", largest snap load {}"
                figures.append(s.cite(f"{place}/largest/snap load", "N"))
            yield s.say(f"{said}.", words, *figures)


#: Label, field of the loads at an end, unit.
_LOADS = (
    ("static", "static", "N"),
    ("standard deviation", "rms", "N"),
    ("mean zero-crossing period", "period", "s"),
    ("largest, most probable", "largest", "N"),
    ("least, most probable", "least", "N"),
    ("largest, rare", "largest_rare", "N"),
    ("least, rare", "least_rare", "N"),
    ("largest, on the safe side", "safe_largest", "N"),
    ("least, on the safe side", "safe_least", "N"),
    ("... with the lightest load", "safe_least_light", "N"),
    ("dynamic amplification factor (DAF)", "daf", ""),
    ("standard deviations from rest to slack", "margin", ""),
    ("... with the lightest load", "margin_light", ""),
    ("probability of slack rope, and so of a snap", "slack_probability", "%"),
    ("... with the lightest load", "slack_probability_light", "%"),
)
