"""Sensitivity as figures and report: elasticities, steps of a size, variance over whole ranges."""

import math
from collections.abc import Sequence

import numpy as np

from synth.sensitivity import Moved, Screening, Sensitivity, SobolIndices

from ..text import (
    AFTER,
    BEFORE,
    HOOK,
    Column,
    Drawing,
    Figure,
    Report,
    ReportSection,
    Table,
    Written,
    columns,
    data_table,
    drawn,
    headline,
    new_figure,
    number,
    panel,
    quantity,
    typeset,
)

Wide = tuple[Sequence[SobolIndices], Screening]
"""Sobol's indices, one study for each figure, and Morris's effects over the same ranges."""

_ROWS = 16  # of the table of elasticities
_NAMES = {
    "payload_rms": "rms of the payload",
    "modulus_margin": "1/M_s, the loop's distance to -1",
    "torque_rms": "rms of the motor torque",
    "speed_rms": "rms of the motor speed",
}
_BARS = 16
_SMALL = 0.01  # elasticity below which nobody looks


@drawn
def tornado_figure(study: Sensitivity, *, bars: int = _BARS) -> Figure:
    """Return bars of the elasticities of the payload's rms and of M_s.

    At most so many; numbers that move neither by 0.01 % are left out.
    """

    def size(k: int) -> float:
        entry = study.elasticities[k]
        return max(abs(entry.payload_rms), abs(entry.max_sensitivity))

    order = sorted(range(len(study.elasticities)), key=size, reverse=True)
    shown = [study.elasticities[k] for k in order if size(k) >= _SMALL][:bars]
    shown.sort(key=lambda e: abs(e.payload_rms))
    place = np.arange(float(len(shown)))
    figure, axes = panel(height=1.7 + 0.26 * max(len(shown), 4))
    for offset, name, colour, label in (
        (0.2, "payload_rms", AFTER, "rms of the payload"),
        (-0.2, "max_sensitivity", BEFORE, "M_s, the sensitivity's peak"),
    ):
        values = [getattr(entry, name) for entry in shown]
        axes.barh(place + offset, values, height=0.4, color=colour, label=typeset(label))
    axes.set_yticks(place, [entry.label for entry in shown])
    axes.axvline(0.0, color="#666666", linewidth=0.8)
    axes.grid(visible=False, axis="y")
    axes.set_xlabel("change for one per cent more [%]")
    figure.legend(loc="outside lower center", ncols=2)
    return headline(figure, _finding(study), f"{study.design.case.name}: {_about(study)}")


@drawn
def indices_figure(studies: Sequence[SobolIndices], about: str) -> Figure:
    """Return one panel for each figure: first-order and total indices with their intervals.

    The studies are over the same ranges, at least one; `about` stands in small print.
    """
    paths = studies[0].paths
    order = np.argsort(studies[0].total)
    place = np.arange(float(len(paths)))
    figure = new_figure(width=3.0 + 2.6 * len(studies), height=1.8 + 0.36 * max(len(paths), 3))
    panels = figure.subplots(1, len(studies), sharey=True, squeeze=False)[0]
    for axes, study in zip(panels, studies, strict=True):
        for offset, values, interval, colour, label in (
            (0.2, study.total, study.total_interval, AFTER, "total"),
            (-0.2, study.first, study.first_interval, HOOK, "alone"),
        ):
            low, high = interval[order].T
            middle = values[order]
            axes.barh(
                place + offset,
                middle,
                height=0.4,
                color=colour,
                label=label,
                xerr=np.clip([middle - low, high - middle], 0.0, None),
                ecolor="#333333",
            )
        axes.set_xlim(0.0, 1.05)
        axes.grid(visible=False, axis="y")
        axes.set_xlabel("share of the variance")
        axes.set_title(typeset(_NAMES.get(study.figure, study.figure)), fontsize=10.0)
    panels[0].set_yticks(place, [paths[k] for k in order])
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2)
    text = f"{paths[int(order[-1])]} is to blame for {100.0 * studies[0].total.max():.0f} %"
    return headline(figure, f"{text}\n{about}")


def sensitivity_report(study: Sensitivity, moved: Sequence[Moved], wide: Wide | None) -> Report:
    """Return elasticities, what larger steps do, and indices over ranges where there are any."""
    idle = len(study.without_effect)
    notes = []
    if len(study.elasticities) > _ROWS:
        rest = f"{len(study.elasticities) - _ROWS} more with less effect, {idle} without any"
        notes.append(f"{rest} (all in the table written)")
    notes += [f"{p}: something steps at its value, so that it has no elasticity" for p in
              study.stepping]  # fmt: skip
    moves = ("payload_rms", "max_sensitivity", "torque_rms", "speed_rms")
    heads = map(Column, moves, ("payload rms", "M_s", "torque", "speed"))
    rows = [
        (
            entry.label,
            *(Written(v, f"{v:+.3f} %") for v in (getattr(entry, name) for name in moves)),
        )
        for entry in study.elasticities[:_ROWS]
    ]
    elasticities = Table(
        columns=(Column("path", "one per cent more of"), *heads), rows=rows, notes=tuple(notes)
    )
    tornado = Drawing("tornado", "One per cent more of each", lambda: tornado_figure(study))
    sections = [ReportSection("", [elasticities, tornado])]
    if moved:
        sections.append(ReportSection("", [_moved(moved)]))
    if wide is not None:
        studies, cases = wide[0], f"{wide[0][0].evaluations} cases each"
        about = f"{cases}, {studies[0].unstable} unstable and left out"
        indices = Drawing("indices", "Indices", lambda: indices_figure(studies, about))
        sections.append(ReportSection("", [_indices(wide), indices]))
    return Report(
        name=study.design.case.name, about=_about(study), status=_finding(study), sections=sections
    )


def moved_table(moved: Sequence[Moved]) -> Table:
    """Return what larger steps do, as data."""
    names = ("path", "share", "payload_rms [m]", "max_sensitivity")
    rows = [(m.path, m.share, m.payload_rms, m.max_sensitivity) for m in moved]
    return data_table(names, rows)


def indices_table(wide: Wide) -> Table:
    """Return Sobol's indices with their intervals and Morris's effects, as data."""
    studies, screening = wide
    rows = []
    for study in studies:
        own = study.figure == screening.figure
        for k, path in enumerate(study.paths):
            first = (study.first[k], *study.first_interval[k])
            total = (study.total[k], *study.total_interval[k])
            effects = (screening.mean_size[k], screening.spread[k]) if own else (None, None)
            rows.append((study.figure, path, *first, *total, *effects))
    names = "figure,path,first,first_low,first_high,total,total_low,total_high,mu_star,sigma"
    return data_table(names.split(","), rows)


def _moved(moved: Sequence[Moved]) -> Table:
    share = f"{100.0 * moved[0].share:+.3g} % on"
    heads = columns(f"path={share}; payload_rms=payload rms [m 4]; max_sensitivity=M_s")
    rows = [
        (m.path, *((m.payload_rms, m.max_sensitivity) if math.isfinite(m.payload_rms) else
                   ("unstable", "")))
        for m in moved
    ]  # fmt: skip
    return Table(columns=heads, rows=rows)


def _indices(wide: Wide) -> Table:
    studies, screening = wide
    order = sorted(range(len(screening.paths)), key=lambda k: -studies[0].total[k])
    rows = [
        (
            screening.paths[k],
            *(float(v) for s in studies for v in (s.first[k], s.total[k])),
            float(screening.mean_size[k]),
        )
        for k in order
    ]
    lost = f"{studies[0].unstable} of {studies[0].evaluations} cases are unstable"
    heads = (
        *columns("path=over its range; rms_first=rms: alone [%]; rms_total=in all [%]"),
        *columns("modulus_first=1/M_s: alone [%]; modulus_total=in all [%]"),
        Column("mu_star", "Morris mu*", write=lambda value: f"{value:.3f}"),
    )
    notes = (f"{lost}{', and left out' if studies[0].unstable else ''}",)
    return Table(columns=heads, rows=rows, notes=notes)


def _about(study: Sensitivity) -> str:
    rms = quantity(study.payload_rms, "m")
    return f"payload {rms} rms, M_s {number(study.max_sensitivity)}"


def _finding(study: Sensitivity) -> str:
    """Return what the study says, in a sentence."""
    physical = [e for e in study.elasticities if not e.path.startswith(("gains.", "sea."))]
    if not physical or abs(physical[0].payload_rms) < _SMALL:
        return "no number of the plant moves the payload's rms by 0.01 % for a per cent"
    first = physical[0]
    return f"{first.path} matters most of the plant: {first.payload_rms:+.2f} % rms a per cent"
