"""Structures side by side as figure and table: how still the payload is, and what is in the way."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from models.basics import InputError

from ..text import (
    AFTER,
    BEFORE,
    DRUM,
    HOOK,
    REFERENCE,
    Axes,
    Column,
    Drawing,
    Figure,
    Report,
    ReportSection,
    Table,
    columns,
    count,
    delay_margin,
    drawn,
    headline,
    new_figure,
    pairs,
    quantity,
    typeset,
)
from .bound_text import bound_cell, bound_figure, bounds_note
from .summary import SHARES, share_names, share_of, unit_notes

if TYPE_CHECKING:
    from synth.design import Design

_TORQUE = "motor.torque.peak"
_COLOURS = {"sea": AFTER, "MRU": "#e69f00", "noise": "#cc79a7", "losses": "#56b4e9"}
_BEST = "best with its sensors"
_MARK: Mapping[str, Any] = {"marker": "|", "color": "black", "ms": 15.0, "mew": 2.2}
_LABELS = {
    "sea": "from the sea",
    "MRU": "from the reference unit",
    "noise": "from other sensors",
    "losses": "from losses of the drive",
}


@drawn
def structures(designs: Sequence[Design], *, bound: bool = True) -> Figure:
    """Return the comparison of structures on a case; those without a stable loop are empty rows.

    Left: payload rms on a logarithmic axis, coloured by shares of its variance, hatched where the
    design is not ok; if `bound`, a mark at the least that any linear controller leaves with the
    same sensors.  Right: M_s.

    Raises InputError if there is no design, or none of them is stable.
    """
    stable = [design for design in designs if math.isfinite(design.payload_rms)]
    if not stable:
        raise InputError("structures: there is no stable design to draw")
    before, hook = 1e3 * stable[0].payload_rms_before, 1e3 * stable[0].hook_rms
    values = [1e3 * design.payload_rms for design in stable]
    marks = {d.structure: bound_figure(d) if bound else math.nan for d in stable}
    least = [1e3 * value for value in marks.values() if math.isfinite(value)]
    low = 0.5 * min([*values, *least, hook])
    high = 3.0 * max([*values, before])
    figure = new_figure(9.2, 1.9 + 0.38 * len(designs))
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(3.2, 1.0))
    seen: set[str] = set()
    for place, design in enumerate(designs):
        rms = 1e3 * design.payload_rms
        if not math.isfinite(rms):
            left.text(1.1 * low, place, "no stable controller", va="center", fontsize=9.0)
            continue
        # Shares of the variance as shares of the bar's length on the page.
        span, at = math.log(rms / low), 0.0
        for name in SHARES:
            share = share_of(design, name)
            if share <= 0.0:
                continue
            begin, end = (low * math.exp(span * edge) for edge in (at, at + share))
            left.barh(
                place,
                end - begin,
                left=begin,
                height=0.62,
                color=_COLOURS[name],
                alpha=1.0 if design.ok else 0.45,
                hatch=None if design.ok else "///",
                edgecolor="white",
                linewidth=0.0,
                label=_LABELS[name] if name not in seen else None,
            )
            seen.add(name)
            at += share
        left.text(
            1.06 * rms,
            place,
            quantity(1e-3 * rms, "m"),
            va="center",
            fontsize=9.0,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0},
        )
        if math.isfinite(value := marks[design.structure]):
            shown = _BEST if _BEST not in seen else None
            left.plot([1e3 * value], [place], linestyle="none", label=shown, **_MARK)
            seen.add(_BEST)
        if design.margins is not None:
            right.plot(design.margins.max_sensitivity, place, "o", color=DRUM)
    for value, colour, text in ((before, BEFORE, "drum held"), (hook, HOOK, "hook")):
        left.axvline(value, color=colour, linewidth=1.2, label=text)
    _frame(left, right, designs, (low, high))
    best = min(stable, key=lambda design: (not design.ok, design.payload_rms))
    held = quantity(best.payload_rms, "m")
    finding = f"{best.structure} holds the payload stillest: {held} rms"
    return headline(figure, finding)


def structures_table(designs: Sequence[Design], *, bound: bool = True) -> Table:
    """Return the designs, one a row; `bound` asks for the bounds beside them too."""
    names = share_names(designs)
    shares = "".join(f"; {name} [%]" for name in names)
    heads = (
        *columns(f"structure; payload_rms=payload [m]; over best{shares}; max_sensitivity=M_s"),
        Column("delay", write=delay_margin),
        *columns("torque [%]; limited_by=limited by <"),
    )
    return Table(
        columns=heads,
        rows=[_row(design, names, bound=bound) for design in designs],
        notes=(bounds_note(),) if bound else (),
        broken=tuple(k for k, design in enumerate(designs) if not design.ok),
    )


def structures_report(designs: Sequence[Design], *, bound: bool = True) -> Report:
    """Return the comparison: a table, what limits each, and the figure."""
    first = designs[0]
    held, hook = (quantity(v, "m") for v in (first.payload_rms_before, first.hook_rms))
    table = structures_table(designs, bound=bound)
    # Below, not beside: the names of limits are too long for a column on 80.
    limits = pairs([(row[0], row[-1]) for row in table.rows])
    table = replace(table, columns=table.columns[:-1], rows=[row[:-1] for row in table.rows])
    stable = any(math.isfinite(design.payload_rms) for design in designs)
    caption = "The payload's motion with each structure"
    drawing = Drawing("structures", caption, lambda: structures(designs, bound=bound))
    failed = [f"{d.structure}: {d.status}" for d in designs if not d.ok]
    return Report(
        name=first.case.name,
        about=count(len(designs), "structure"),
        status=f"hook {hook} rms; with the drum held the payload moves {held} rms",
        sections=[
            ReportSection("", [table, *([drawing] * stable)]),
            ReportSection("Limited by", [limits, *failed, *unit_notes(designs)]),
        ],
    )


def limited_by(design: Design) -> str:
    """Return what binds, or why the design is not ok."""
    if not design.ok:
        return design.status.partition(":")[0].partition(";")[0]
    binding = ", ".join(design.binding)
    if binding:
        return binding
    if design.at_bounds:
        return f"none; end of the search: {', '.join(design.at_bounds)}"
    if not design.shares:
        return "nothing"
    # With no limit in the way it is what disturbs most that decides.
    largest = max(SHARES, key=lambda name: share_of(design, name))
    return {
        "sea": "the structure itself",
        "MRU": "the MRU's error",
        "noise": "noise",
        "losses": "losses of the drive",
    }[largest]


def _row(design: Design, names: Sequence[str], *, bound: bool) -> tuple[float | str, ...]:
    margins, torque = design.margins, design.limits.get(_TORQUE)
    found = math.isfinite(design.payload_rms)
    return (
        design.structure,
        design.payload_rms if found else "-",
        bound_cell(design) if bound else "-",
        *(share_of(design, name) if found else "-" for name in names),
        margins.max_sensitivity if margins is not None else "-",
        margins.delay if margins is not None else "-",
        torque.use if torque is not None else "-",
        limited_by(design),
    )


def _frame(left: Axes, right: Axes, designs: Sequence[Design], span: tuple[float, float]) -> None:
    left.set_xscale("log")
    left.set_xlim(*span)
    left.set_yticks(range(len(designs)), [design.structure for design in designs])
    left.invert_yaxis()
    left.grid(visible=False, axis="y")
    left.set_xlabel("payload motion [mm rms]   (hatched: not ok)")
    left.legend(loc="upper center", bbox_to_anchor=(0.5, -0.22), ncols=4, frameon=False)
    bounds = [d.limits["max_sensitivity"].bound for d in designs if "max_sensitivity" in d.limits]
    if bounds:
        right.axvline(bounds[0], color=REFERENCE, linewidth=1.2)
    right.set_xlim(0.9, 1.05 * max([right.get_xlim()[1], *bounds]))
    right.set_xlabel(typeset("M_s"))
