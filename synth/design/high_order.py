"""High-order controllers of a case as parameters of a structure: `high_order_gains`.

    case -> `synth.bound.high_order_for` -> drag and limits on signals as they are in that loop
      -> once more with those -> DesignQuestion and parameters

The convex programme behind knows one drag, peaks by a period that is guessed, and no power.  So
what its loop makes of them is measured, and asked of the next one, until all limits are kept.
"""

import math
from collections.abc import Mapping

from models.basics import SynthesisError
from models.case import Case
from models.plant import MAX_MASSES

from ..bound import high_order_for
from ..limits import Breakdown, Continuous, Minimum, Peak, Power
from ..loop import Assessment
from ..question import DesignQuestion, pose
from ..search import Progress
from ..structures import LowOrderLaw

_ROUNDS = 10
_SPARE = 0.98  # of the rms that would just keep a limit


def high_order_gains(
    case: Case, order: int | None = None, progress: Progress | None = None
) -> tuple[DesignQuestion, Mapping[str, float]]:
    """Return the question of a controller of high order, and its parameters.

    It may break a limit, as one on power or on the delay, that no round could mend.

    The controller has at most `order` states, by default as many as it takes.  `progress` is called
    as progress(stage, done, total).

    Raises SynthesisError if no such controller is found.
    """
    masses = 1 if case.rope.lumping == "thesis" else MAX_MASSES
    question = pose(case, "high-order", masses)
    rooms: dict[str, float] = {}
    made: dict[str, float] = {}  # of the signals in `rooms`, by the controller found last
    best: tuple[float, DesignQuestion, Mapping[str, float]] | None = None
    drag = question.drag_before
    friction = sum(element.begin for element in question.elements if not element.lasting)
    for done in range(_ROUNDS):
        if progress is not None:
            progress("high order", done, _ROUNDS)
        try:
            found = high_order_for(
                case,
                measurements=question.structure.measurements,
                drag=drag,
                friction=friction,
                rooms=rooms,
                states=order,
            )
        except SynthesisError:
            if best is None:
                raise
            # What was asked for cannot be had: half of the way to it.
            rooms = {name: math.sqrt(room * made[name]) for name, room in rooms.items()}
            continue
        question = pose(case, f"high-order-{found.order}", masses)
        assert isinstance(question.law, LowOrderLaw)
        parameters = question.named([float(v) for v in question.law.values(found.controller)])
        view = question.assess(parameters)
        if question.drag is not None:
            drag = question.equivalents(view.coefficients)[0]
        friction = question.equivalents(view.coefficients)[1]
        use = max(limit.use(limit.worst(view)) for limit in question.limits)
        if best is None or use < best[0]:
            best = use, question, parameters
        if use <= 1.0:
            break
        rooms |= _rooms(question, view)
        made = {name: view.sigma(name) for name in rooms}
    assert best is not None
    return best[1], best[2]


def _rooms(question: DesignQuestion, view: Assessment) -> dict[str, float]:
    """Return the rms at which each limit on a signal that is broken would just be kept."""
    found: dict[str, float] = {}
    for limit in question.limits:
        if not isinstance(limit, Peak | Continuous | Minimum | Power):
            continue
        value = limit.worst(view)
        if limit.use(value) <= 1.0:
            continue
        static = abs(limit.static) + limit.loss
        if isinstance(limit, Minimum):
            static = limit.static - limit.loss
        if isinstance(limit, Power):
            # The speed is that of the hook, so it is the torque that has to give.
            fast = view.peak(limit.speed, limit.duration)
            if isinstance(limit, Breakdown):
                fast = (fast / limit.base_speed) ** 2
            name, share = limit.torque, (limit.bound / fast - static) / (value / fast - static)
        elif isinstance(limit, Continuous):
            name = limit.output
            steady = limit.static**2 + limit.loss**2
            share = ((limit.bound**2 - steady) / (value**2 - steady)) ** 0.5
        else:
            name, share = limit.output, (limit.bound - static) / (value - static)
        found[name] = min(found.get(name, 1.0), max(share, 0.1))
    return {name: _SPARE * share * view.sigma(name) for name, share in found.items()}
