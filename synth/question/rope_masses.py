"""The rope masses that a loop asks for, by its crossover and by the rope as it is.

Few masses have their higher modes in the wrong place.  What they place within a few percent is
enough where the loop is weak; but a mode far above all crossovers may carry the peak of S, and
then what is kept on the masses is broken on the rope.
"""

from __future__ import annotations

import math

import numpy as np

from models.basics import FloatArray, InputError
from models.plant import MAX_MASSES, masses_for_bandwidth
from models.sensing import sensed_line_at

from ..limits import MaxSensitivity
from ..loop import Assessment, numeric_blocks, refine_minima, return_differences
from .question import DesignQuestion

_MODES = 5.0  # every rope mode below this many crossovers belongs in the plant
_KEPT = 1e-3  # relative excess on the rope as it is over a limit that its masses keep


def masses_for(question: DesignQuestion, loop: Assessment) -> int:
    """Return the rope masses that a stable loop asks for, where the case leaves them open.

    Every mode below five crossovers has its place, and a limit on the sensitivity that is kept is
    kept on the distributed rope too, to a thousandth.  Never fewer than the question's own.
    """
    data, crossovers = question.data, loop.margins.crossovers
    if data.masses is not None or not crossovers.size:
        return question.masses
    try:
        wanted = masses_for_bandwidth(data, _MODES * float(crossovers.max()))
    except InputError:
        return MAX_MASSES
    if wanted > question.masses or data.lumping == "thesis":
        return max(wanted, question.masses)
    most = next(lim.bound for lim in question.loop if isinstance(lim, MaxSensitivity))
    if loop.max_sensitivity <= most * (1.0 + _KEPT):
        excess = _sensitivity_on_the_rope(question, loop, most) / most - 1.0
        if excess > _KEPT:
            # The error of a lumped rope's modes falls with the square of its masses.
            finer = math.ceil(question.masses * math.sqrt(excess / _KEPT))
            return min(max(finer, question.masses + 1), MAX_MASSES)
    return question.masses


def _sensitivity_on_the_rope(question: DesignQuestion, loop: Assessment, above: float) -> float:
    """Return the largest peak of |S| on the distributed rope that lies above a value."""
    controller, grid = loop.controller, loop.grid
    drag = question.drag_before if question.drag is None else loop.coefficient

    def distance(omega: FloatArray) -> FloatArray:
        line = sensed_line_at(question.case, 1j * omega, drag=drag, data=question.data)
        blocks = numeric_blocks(line.select(measurements=controller.measurements))
        law = np.moveaxis(controller.response_at(1j * omega), 0, -1)
        differences = return_differences(blocks, [list(row) for row in law])
        return np.asarray(np.min(np.abs(differences), axis=0))

    near = distance(grid)
    return float(1.0 / refine_minima(distance, grid, near, near < 1.0 / above)[1].min())
