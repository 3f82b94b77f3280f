"""The bound beside a design in words: for its summary, the table of structures and their figure.

A case whose sensors are exact has no bound worth printing, and none is computed.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from models.basics import StillhookError
from synth.bound import DesignBound, exact_sensors

from ..text import number, quantity

if TYPE_CHECKING:
    from collections.abc import Sequence

    from synth.design import GainDesign, StructureDesign

_CLEAR = 3.0  # from so many times the bound on it is told as a multiple


def bound_sentence(design: GainDesign | StructureDesign) -> str:
    """Return how far a design is from the best possible, in words; empty without a loop."""
    if not _has_loop(design):
        return ""
    heard = exact_sensors(design.case, design.measurements)
    if heard and exact_sensors(design.case):
        return f"the case's sensors are exact ({', '.join(heard)}): no meaningful bound"
    try:
        bound = design.bound
    except StillhookError as error:
        return f"not computed: {error}"
    parts = []
    for value, exact, sensors in (
        (bound.heard.value, bound.exact_heard, "with these sensors"),
        (bound.every.value, bound.exact_every, "with all sensors of the case"),
    ):
        if exact:
            parts.append(f"no meaningful bound {sensors}: {', '.join(exact)} exact")
        elif not 0.0 < value < math.inf:
            parts.append(f"no bound above zero {sensors}")
        else:
            best = quantity(value, "m")
            parts.append(f"{_far(bound.rms / value)} the best possible {sensors}, {best}")
    gap = max(bound.heard.gap, bound.every.gap)
    return (
        f"{'; '.join(parts)}; duality gap {gap:.0e}; for linear controllers, whatever their margins"
    )


def bound_cell(design: StructureDesign) -> str:
    """Return the design over the bound with its own sensors, for a table."""
    bound = _meaningful(design)
    if bound is None:
        return "-"
    return f"x {number(bound.factor)}" if bound.factor >= _CLEAR else _percent(bound.factor)


def bound_figures(design: StructureDesign) -> tuple[float, float]:
    """Return the bounds with its own and with all sensors [m]; NaN where they mean nothing."""
    bound = _meaningful(design)
    if bound is None:
        return math.nan, math.nan
    every = bound.every.value
    return bound.heard.value, math.nan if bound.exact_every or every <= 0.0 else every


def bounds_note(designs: Sequence[StructureDesign]) -> str:
    """Return what the column of bounds means, with the least of those with all sensors."""
    found = [bound_figures(design) for design in designs]
    text = "over best: the payload's rms over the least that any linear controller leaves with "
    text += "the same sensors; - where these are exact"
    least = [every for _, every in found if math.isfinite(every)]
    return f"{text}; with all sensors of the case {quantity(min(least), 'm')}" if least else text


def _meaningful(design: StructureDesign) -> DesignBound | None:
    if not _has_loop(design) or exact_sensors(design.case, design.measurements):
        return None
    try:
        bound = design.bound
    except StillhookError:
        return None
    return bound if 0.0 < bound.heard.value < math.inf else None


def _has_loop(design: GainDesign | StructureDesign) -> bool:
    return design.margins is not None and math.isfinite(design.payload_rms)


def _far(factor: float) -> str:
    return f"{number(factor)} times" if factor >= _CLEAR else f"within {_percent(factor)} of"


def _percent(factor: float) -> str:
    return f"{number(100.0 * (factor - 1.0), 2)} %"
