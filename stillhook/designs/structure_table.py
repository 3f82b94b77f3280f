"""All structures of a case side by side: the rows of the table, for terminal and file.

StructureDesigns -> StructureRows -> terminal | markdown | figure
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..text import bound_cell, bounds_note, number, percent, quantity

if TYPE_CHECKING:
    from synth.design import StructureDesign

HEADINGS = (
    "structure",
    "payload",
    "over best",
    "sea",
    "MRU",
    "noise",
    "M_s",
    "delay",
    "torque",
    "limited by",
)
#: Which disturbances make up a share of the payload's variance, by its name.
SHARES = {"sea": ("hook.heave",), "MRU": ("mru.error",), "noise": ()}
_TORQUE = "motor.torque.peak"


@dataclass(frozen=True, kw_only=True)
class StructureRow:
    """One structure in figures that are ready to print.

    Attributes
    ----------
    name, payload, best
        Its name; the payload's rms; that over the best possible with the same sensors.
    shares
        Shares of the variance from sea, reference unit and other sensors.
    max_sensitivity, delay, torque
        M_s, delay margin, share of the peak torque that is used.
    limited
        What binds, or why it is not ok.
    ok
        Whether it is.
    """

    name: str
    payload: str
    best: str
    shares: tuple[str, str, str]
    max_sensitivity: str
    delay: str
    torque: str
    limited: str
    ok: bool

    @property
    def cells(self) -> tuple[str, ...]:
        """Texts under `HEADINGS`."""
        margins = (self.max_sensitivity, self.delay, self.torque)
        return (self.name, self.payload, self.best, *self.shares, *margins, self.limited)


def structure_rows(designs: Sequence[StructureDesign], *, bound: bool = True) -> list[StructureRow]:
    """Return the rows of some designs, in their order; `bound` asks for their bounds too."""
    return [_row(design, bound=bound) for design in designs]


def share_of(design: StructureDesign, name: str) -> float:
    """Return the share of the payload's variance from ``sea``, ``MRU`` or ``noise``."""
    squares = {source: rms**2 for source, rms in design.parts.items()}
    total = sum(squares.values())
    known = [source for names in SHARES.values() for source in names]
    chosen = SHARES[name] or [source for source in squares if source not in known]
    part = sum(squares.get(source, 0.0) for source in chosen)
    return part / total if total > 0.0 else 0.0


def markdown(designs: Sequence[StructureDesign], *, bound: bool = True) -> str:
    """Return the comparison as a table in Markdown, with what its column of bounds means."""
    lines = ["| " + " | ".join(HEADINGS) + " |", "|" + " --- |" * len(HEADINGS)]
    lines += ["| " + " | ".join(row.cells) + " |" for row in structure_rows(designs, bound=bound)]
    if bound:
        lines += ["", f"{bounds_note(designs)}."]
    return "\n".join(lines) + "\n"


def _row(design: StructureDesign, *, bound: bool) -> StructureRow:
    margins, torque = design.margins, design.limits.get(_TORQUE)
    late = margins.delay if margins is not None else math.nan
    found = math.isfinite(design.payload_rms)
    shares = [percent(share_of(design, name)) if found else "-" for name in SHARES]
    return StructureRow(
        name=design.structure,
        payload=quantity(design.payload_rms, "m") if found else "-",
        best=bound_cell(design) if bound else "-",
        shares=(shares[0], shares[1], shares[2]),
        max_sensitivity=number(margins.max_sensitivity) if margins is not None else "-",
        delay=("any" if math.isinf(late) else quantity(late, "s")) if margins is not None else "-",
        torque=percent(torque.use) if torque is not None else "-",
        limited=_limited(design),
        ok=design.ok,
    )


def _limited(design: StructureDesign) -> str:
    if not design.ok:
        return design.status.partition(":")[0].partition(";")[0]
    binding = ", ".join(design.binding)
    if binding:
        return binding
    if design.at_bounds:
        return f"bounds of {', '.join(design.at_bounds)}"
    if not design.parts:
        return "nothing"
    # With no limit in the way it is what disturbs most that decides.
    largest = max(SHARES, key=lambda name: share_of(design, name))
    return {"sea": "the structure itself", "MRU": "the MRU's error", "noise": "noise"}[largest]
