"""The rope masses that a loop asks for, by its crossover and by the rope as it is.

Few masses have their higher modes in the wrong place.  What they place within a few percent is
enough where the loop is weak; but a mode far above all crossovers may carry the peak of S, and
then what is kept on the masses is broken on the rope.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from models.basics import FloatArray, InputError
from models.plant import MAX_MASSES, PlantResponse, masses_for_bandwidth
from models.sensing import sensed_line_at

from ..limits import MaxSensitivity
from ..loop import Assessment, LinearController, LoopResponses, refine_minima
from .problem import Values
from .question import DesignQuestion, with_masses

_MODES = 5.0  # every rope mode below this many crossovers belongs in the plant
_ONE_MODE = 1.05  # ratio of frequencies on the same mode
_ON_MODE = 64  # points about such a mode
_HARMLESS = 0.05  # share by which |S| on a mode lies below its peak
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
        wanted = masses_for_bandwidth(data, _MODES * _crossover(loop))
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


def on_enough_masses(
    question: DesignQuestion,
    parameters: Mapping[str, float],
    assess: Callable[[DesignQuestion, Values], Assessment | None],
    finer: Callable[[DesignQuestion, int], DesignQuestion] = with_masses,
) -> tuple[DesignQuestion, Assessment | None, float]:
    """Return a question on the masses that given parameters ask for, their loop and its growth.

    Parameters
    ----------
    question, parameters
        The question, and the structure's parameters by name.
    assess
        From a question and the law's parameters to the loop; None where no drag agrees with it.
    finer
        From the question to that on more masses.

    Returns
    -------
    tuple
        The question, the loop (None where it is not stable) and the largest real part of its poles
        [1/s] with the drag before compensation.
    """
    values = question.values(parameters)
    growth = question.problem.growth(values)
    if growth > 0.0 and question.masses < MAX_MASSES and question.data.masses is None:
        # Few masses do not have their modes where the rope does: made on it, a loop may hold there.
        most = finer(question, MAX_MASSES)
        if (there := most.problem.growth(values)) <= 0.0:
            question, growth = most, there
    while growth <= 0.0:
        loop = assess(question, values)
        if loop is None or not question.problem.held(values, loop.coefficient):
            break
        if (masses := masses_for(question, loop)) <= question.masses:
            return question, loop, growth
        question = finer(question, masses)
        growth = question.problem.growth(values)
    return question, None, growth


def _crossover(loop: Assessment) -> float:
    """Return the highest crossover [rad/s] that is not one of two on the same harmless mode.

    A mode with hardly any damping stands out above a gain of one far above the bandwidth.  Its
    place matters where |S| on it is about its peak; else the rope itself is looked at anyhow.
    """
    found = list(loop.margins.crossovers)
    while len(found) > 2 and found[-1] < _ONE_MODE * found[-2]:
        mode = np.geomspace(found[-2] / _ONE_MODE, found[-1] * _ONE_MODE, _ON_MODE)
        nearest = _distance(loop.plant.response_at(1j * mode), loop.controller).min()
        if loop.max_sensitivity * nearest < 1.0 + _HARMLESS:
            break
        del found[-2:]
    return float(found[-1])


def _sensitivity_on_the_rope(question: DesignQuestion, loop: Assessment, above: float) -> float:
    """Return the largest peak of |S| on the distributed rope that lies above a value."""
    controller, grid = loop.controller, loop.grid
    drag = question.drag_in(loop)

    def distance(omega: FloatArray) -> FloatArray:
        line = sensed_line_at(question.case, 1j * omega, drag=drag, data=question.data)
        return _distance(line, controller)

    near = distance(grid)
    return float(1.0 / refine_minima(distance, grid, near, near < 1.0 / above)[1].min())


def _distance(plant: PlantResponse, controller: LinearController) -> FloatArray:
    """Return |1 + L| of the loop that comes nearest to -1 with it, at the plant's points."""
    found = LoopResponses.of(plant.select(measurements=controller.measurements), controller)
    loops = range(len(controller.inputs))
    return np.asarray(np.min([np.abs(found.difference(i)) for i in loops], axis=0))
