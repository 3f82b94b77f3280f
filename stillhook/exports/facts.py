"""What is told of an exported law: rows of names and values, for headers and the README."""

from __future__ import annotations

import math

import numpy as np

from synth.design import Design
from synth.loop import Margins

from .._version import __version__
from ..designs import label_of
from ..text import number, percent, quantity
from .law import Law
from .margins import LawMargins, margins_at


def facts_of(law: Law, communication_step: float | None = None) -> list[tuple[str, str]]:
    """Return what there is to tell of a law, as names and values.

    The margins at a communication step of a co-simulation [s] are among them if one is given.
    """
    case, design = law.case, law.design
    rows = [
        ("written by", f"Stillhook {__version__}"),
        ("case", f"{case.name}, SHA-256 {case.digest}"),
        ("law", law.inner.name if design is None else design.structure),
        ("sample time", quantity(law.sample_time, "s")),
        ("command", f"[{law.unit}], within +-{number(law.highest, 6)} {law.unit}"),
        ("command at rest", f"{number(law.rest['drive.applied'], 6)} {law.unit}"),
        ("taking over", f"in {quantity(law.ramp, 's')}, set point at most "
         f"{_most(law.rate, 'm/s')}, command at most {_most(law.slew, law.unit + ' per s')}"),
    ]  # fmt: skip
    if design is not None:
        rows += _of_design(design)
    margins = margins_at(law, communication_step)
    return rows if margins is None else [*rows, *_of_margins(margins)]


def _of_design(design: Design) -> list[tuple[str, str]]:
    parameters = ", ".join(
        f"{name} = {value!r} {design.units.get(name, '')}".rstrip()
        for name, value in design.parameters.items()
    )
    rows = [
        ("parameters", parameters),
        ("design", design.status),
        (
            "load",
            f"{quantity(design.payload_rms, 'm')} rms where the hook moves "
            f"{quantity(design.hook_rms, 'm')} rms",
        ),
    ]
    for use in design.limits.values():
        kept = percent(use.use) if math.isfinite(use.use) else "-"
        most = f"{number(use.value, 4)} of {number(use.bound, 4)} {use.unit}".rstrip()
        rows.append((label_of(design, use.name), f"{most}, {kept}"))
    return rows


def _of_margins(margins: LawMargins) -> list[tuple[str, str]]:
    """Return the margins in continuous time, as sampled and a communication step later."""
    rows = []
    if margins.continuous is not None:
        rows.append(("margins of the design", _told(margins.continuous)))
    rows.append((f"margins as sampled every {quantity(margins.sample_time, 's')}",
                 _told(margins.sampled)))  # fmt: skip
    if margins.communication_step is not None:
        later = quantity(margins.communication_step, "s")
        text = _told(margins.communicated)
        text += f"; {margins.warning}" if margins.warning else ""
        rows.append((f"margins with a command {later} later (a parallel master)", text))
    return rows


def _told(margins: Margins | None) -> str:
    if margins is None:
        return "not stable"
    return (
        f"M_s {margins.max_sensitivity:.3f}, gain x {margins.gain_down:.3g} to "
        f"{margins.most_gain}, phase {np.degrees(margins.phase):.1f} deg, delay "
        f"{margins.delay_text}"
    )


def _most(value: float, unit: str) -> str:
    return "as fast as it comes" if math.isinf(value) else f"{number(value, 4)} {unit}"
