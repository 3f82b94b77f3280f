"""The README of an export: what it is, how it is built and tested, signs, and missing sensors."""

from __future__ import annotations

from collections.abc import Sequence

from models.sensing import heard_by

from .exported import Exported
from .law import Law
from .recording import EVENTS, Recording
from .signals import SIGNALS, STATUS_TEXTS

SAFETY = (
    "**This is no safety function.** It holds a load still; it does not protect people, rope or "
    "crane. Overload protection, overspeed, end stops, emergency stop and the brake need a safety "
    "system of their own, which acts whatever this controller says. Nothing here has been "
    "certified."
)
"""What each README says first."""

_SIGNS = """\
All is in SI units. Motions are vertical, up positive, from where the load hung at rest at first.
Haul and motor speed are positive hauling in, and so is the motor's torque, which includes the
static part that holds the load; a drum that pays out as the hook rises hauls by a negative rate.
Rope tension is positive. The command includes what holds the load at rest."""

_VECTOR = """\
`vector.csv` holds {count} samples, one every {period}: time [s], the {signals} signals in the order
of the table below, the command [{unit}] and the number of the status. It is the record of a
simulation of the nonlinear plant in the sea of the case, behind its sensors, in which this happens:

{events}

Start from a reset controller, hand it the signals row by row, and compare. A cell `nan` stands for
a sensor that gave no number."""


def readme(
    exported: Exported,
    *,
    law: Law | None = None,
    recording: Recording | None = None,
    facts: Sequence[tuple[str, str]] = (),
) -> str:
    """Return the README of one export as Markdown.

    Of a law it has the signals, of a recording what is in it.
    """
    parts = [f"# {exported.title}", SAFETY]
    if facts:
        parts.append(_table(("", ""), facts))
    parts.append(exported.about.strip())
    parts += ["## How it was checked", exported.proof]
    if law is not None and recording is not None and "vector.csv" in exported.files:
        period = f"{1e3 * law.sample_time:g} ms"
        text = _VECTOR.format(
            count=len(recording.commands),
            period=period,
            signals=len(SIGNALS),
            unit=law.unit,
            events="\n".join(f"- {time:g} s: {what}" for time, what in EVENTS),
        )
        parts += ["## The test vector", text]
    parts += ["## Signs and units", _SIGNS]
    if law is not None:
        heard = heard_by(law.inner)
        rows = [
            (
                str(i),
                f"`{s.name}`" + ("" if s.name in heard else " *"),
                s.unit or law.unit,
                s.meaning,
                s.missing,
            )
            for i, s in enumerate(SIGNALS)
        ]
        head = ("", "signal", "unit", "what it is", "where there is no such sensor")
        star = "\\* not heard by this law itself; the operator's interface may hear it."
        parts += ["## Signals", _table(head, rows), star]
        numbered = [(str(i), name, text) for i, (name, text) in enumerate(STATUS_TEXTS)]
        parts += ["## Status", _table(("", "status", "what it says"), numbered)]
    return "\n\n".join(parts) + "\n"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(c.replace("|", "\\|") for c in row) + " |" for row in lines)
