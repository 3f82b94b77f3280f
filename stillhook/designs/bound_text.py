"""The best possible beside a design in words: for its summary, the table of structures, its figure.

A case whose sensors are exact has no bound worth printing, and none is computed.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from models.basics import StillhookError
from synth.bound import BestPossible, exact_sensors

from ..text import number

if TYPE_CHECKING:
    from synth.design import Design

_CLEAR = 3.0  # from so many times the bound on it is told as a multiple


def bound_rows(design: Design) -> list[tuple[str, str]]:
    """Return how far a design is from the best possible, in words; nothing without a loop.

    That takes some ten seconds, for the best controller found within the M_s.
    """
    if not _has_loop(design):
        return []
    if heard := exact_sensors(design.case, design.measurements):
        return [("bound", f"the sensors are exact ({', '.join(heard)}): no meaningful bound")]
    try:
        best = design.bound
        rows = [("bound", "; ".join(best.sentences))]
    except StillhookError as error:
        return [("bound", f"not computed: {error}")]
    return [*rows, ("feedback", str(best.bode))] if str(best.bode or "") else rows


def bound_cell(design: Design) -> str:
    """Return the design over the bound with its own sensors, for a table."""
    best = _meaningful(design)
    if best is None:
        return "-"
    if best.factor >= _CLEAR:
        return f"x {number(best.factor)}"
    return f"{number(100.0 * (best.factor - 1.0), 2)} %"


def bound_figure(design: Design) -> float:
    """Return the bound with its own sensors [m]; NaN where it means nothing."""
    best = _meaningful(design)
    return best.free.value if best is not None else math.nan


def bounds_note() -> str:
    """Return what the column of bounds means."""
    return (
        "over best: the payload's rms over the least that any linear controller leaves with the "
        "same sensors and the drive's encoder, whatever its margins; - where these are exact"
    )


def _meaningful(design: Design) -> BestPossible | None:
    if not _has_loop(design) or exact_sensors(design.case, design.measurements):
        return None
    try:
        best = design.bound
    except StillhookError:
        return None
    return best if best.meaningful else None


def _has_loop(design: Design) -> bool:
    return design.margins is not None and math.isfinite(design.payload_rms)
