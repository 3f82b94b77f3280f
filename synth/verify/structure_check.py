"""The second look at a structure's design: all of `verify_tuning`, and on twice the rope."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from models.basics import one_thread
from models.plant import MAX_MASSES, LinearPlant
from models.sensing import sensed_plant

from ..limits import MaxSensitivity
from ..question import PAYLOAD
from .recheck import (
    TIGHT,
    closed_loop_marks,
    guarded,
    loop_margins,
    pole_check,
    winding_check,
    winding_of_plant,
)
from .recompute import LawMatrices, Loop, Source, moments
from .tuning_check import verify_tuning
from .verification import Check, Verification, agreement, bounded

if TYPE_CHECKING:
    from ..design import StructureDesign

_DECAY = 1e-7  # slowest decay that counts as stable [1/s]
_ROPE = 0.02  # what twice the masses may add to M_s, or change in the rms


@one_thread()
def verify_structure(design: StructureDesign) -> Verification:
    """Check a structure's design by code that the optimiser did not use.

    Parameters
    ----------
    design
        The design, with its claims.

    Returns
    -------
    Verification
        `ok` only if the loop is stable on its plant and on one of twice the rope masses, its
        sensitivity keeps its bound there too, and every claim was met.
    """
    first = verify_tuning(design.tuning())
    checks = list(first.checks)
    if not first.ok and all(check.name != "cost" for check in checks):
        return first  # not stable on its own plant
    data = design.posed.question.data
    more = min(2 * design.masses, MAX_MASSES)
    if data.lumping != "thesis" and more > design.masses:
        checks += guarded("rope", lambda: _on_more_rope(design, more))
    checks += guarded("claims", lambda: _claims(design))
    on = f"and on a rope of {more} masses" if data.lumping != "thesis" else "on the one spring"
    counted = sum(check.counts for check in checks)
    return Verification.of(
        checks, f"verified: stable with the exact delays {on}, {counted} checks passed"
    )


def _claims(design: StructureDesign) -> list[Check]:
    """Return the checks of what the design says besides the answer itself."""
    question, fixed = design.posed.question, design.case.payload.fixed_drag
    total = math.sqrt(sum(rms**2 for rms in design.parts.values()))
    checks = [
        agreement("parts", design.payload_rms, total, TIGHT, "[m], root of the sum of squares"),
        agreement("hook_rms", design.hook_rms, float(question.hook.displacement.rms), TIGHT),
        agreement(
            "payload_rms_before", design.payload_rms_before, question.payload_rms_before, TIGHT
        ),
    ]
    if fixed is not None:
        checks.append(agreement("drag", design.drag, fixed, TIGHT, "[N s/m], given"))
    return checks


def _on_more_rope(design: StructureDesign, masses: int) -> list[Check]:
    posed = design.posed
    plant = _plant(design, masses)
    law = LawMatrices.of(design.controller, plant)
    marks = closed_loop_marks(plant, law)
    on = f"a rope of {masses} masses"
    checks = [
        winding_check(winding_of_plant(plant, law, marks), on),
        pole_check("poles", plant, law, on, _DECAY),
    ]
    checks = [replace(check, name=f"rope.{check.name}") for check in checks]
    if not all(check.ok for check in checks):
        return checks
    loop = Loop(plant=plant.response_at, law=law, marks=marks)
    for limit in posed.limits:
        if isinstance(limit, MaxSensitivity):
            found = loop_margins(loop).max_sensitivity
            bound = max(limit.bound, design.limits[limit.name].value)
            checks.append(bounded(f"rope.{limit.name}", bound, found, _ROPE, f"on {on}"))
    sources = [
        Source(name=d.name, density=d.density, band=d.band, splits=d.splits)
        for d in posed.problem(()).disturbances
    ]
    delay = max(plant.delays, default=0.0)
    variance = moments(loop, [PAYLOAD], sources, orders=(0,), delay=delay)[PAYLOAD][0]
    rms = agreement(
        "rope.payload_rms", design.payload_rms, float(np.sqrt(variance)), _ROPE, f"[m] on {on}"
    )
    return [*checks, rms]


def _plant(design: StructureDesign, masses: int) -> LinearPlant:
    """Return the sensed plant on other masses, with the drag of the design."""
    plant = sensed_plant(design.case, masses=masses, drag=design.drag)
    return plant.select(measurements=design.posed.structure.measurements)
