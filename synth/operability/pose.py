"""Operability question of a design or a case: its systems and criteria at one rope length."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from models.basics import InputError, SolverError
from models.case import Case
from models.sensing import SET_POINT

from ..design import Design
from ..limits import LOWER_TENSION, Limit
from ..loop import Assessment
from ..question import HOOK, PAYLOAD, DesignQuestion, Values, on_enough_masses, pose
from .criteria import Stability, case_criteria, outputs_of
from .systems import VELOCITY, HeldSystem, LoopSystem, PerfectSystem, System

_HELD = {PAYLOAD, VELOCITY, "rope.tension", LOWER_TENSION}
_WINCH = ("motor.torque", "motor.speed", "motor.current", "motor.voltage")


@dataclass(frozen=True, kw_only=True, eq=False)
class OperabilityQuestion:
    """One rope length: what is moved, and what must be kept."""

    case: Case  #: The case, its limits reported rather than enforced.
    #: The hook with the drum held, and a winch that holds the rope's upper end still.
    held: HeldSystem
    perfect: PerfectSystem
    loop: LoopSystem | None  #: The design's loop; None where a case alone was asked about.
    #: By name of the system, ``held``, ``perfect`` and ``loop``: stability first.
    criteria: dict[str, tuple[Limit, ...]]
    masses: int = 1  #: Rope masses of the loop.
    #: The loop in the case's own sea, with this length of rope; None where it has no stationary
    #: motion, or where a case alone was asked about.
    own: Assessment | None = None

    @property
    def systems(self) -> dict[str, System]:
        """The systems by name."""
        found: dict[str, System] = {"held": self.held, "perfect": self.perfect}
        return found if self.loop is None else {**found, "loop": self.loop}


def pose_operability(
    source: Case | Design, wanted: Sequence[Limit], *, length: float | None = None
) -> OperabilityQuestion:
    """Return what is asked of a design, whose gains or parameters are kept, or of a case alone.

    At another length of rope than the case's [m] the drum is on the layer, and the rope as stiff,
    as it is at that length; and the rope has the masses that a design made there asks for, so that
    a limit is kept here if it is kept there.

    Raises InputError if the design has no controller, or the drum does not hold so much rope.
    """
    case = source if isinstance(source, Case) else source.case
    changes: dict[str, object] = {"limits.drive": "report"}
    if length is not None:
        changes["rope.length"] = length
    reported = case.variant(changes)
    own: Assessment | None = None
    if isinstance(source, Case):
        question = pose(reported)
    elif source.margins is None:
        raise InputError("operability: the design has no stabilising controller")
    elif reported.rope.length == case.rope.length:
        question = pose(reported, source.structure, source.masses, built_for=source.built_for)
        own = _stationary(question, source.parameters)
    else:
        question, own, _ = on_enough_masses(
            pose(reported, source.structure, built_for=source.built_for), source.parameters, _loop
        )
    of_case = case_criteria(reported, question.plant)
    every = (Stability(), *wanted, *of_case)
    held = tuple(c for c in every if set(c.outputs) <= _HELD)
    winch = tuple(c for c in of_case if set(c.outputs) <= set(_WINCH))
    drag = question.drag
    slope = drag.slope if drag is not None else 0.0
    loop = None
    if not isinstance(source, Case):
        noises = tuple(d for d in question.problem.disturbances if d.name != HOOK)
        loop = LoopSystem(
            outputs=tuple(dict.fromkeys((PAYLOAD, VELOCITY, *outputs_of(every)))),
            slope=slope,
            reference=drag.reference if drag is not None else question.drag_before,
            noises=noises,
            loss=question.loss,
            mru=reported.sensors.mru if any(n.name == "mru.error" for n in noises) else None,
            switching=question.spectra.get(SET_POINT),
            plant=question.plant,
            controller=question.controller(source.parameters),
            drag=drag,
        )
    return OperabilityQuestion(
        case=reported,
        held=HeldSystem(
            outputs=tuple(dict.fromkeys((PAYLOAD, VELOCITY, *outputs_of(held)))),
            slope=slope,
            reference=question.drag_before,
            data=question.data,
        ),
        perfect=PerfectSystem(
            outputs=outputs_of(winch), slope=0.0, reference=0.0, data=question.data
        ),
        loop=loop,
        criteria={"held": held, "perfect": winch, "loop": every},
        masses=question.masses,
        own=None if loop is None or loop.swings else own,
    )


def _stationary(question: DesignQuestion, parameters: Mapping[str, float]) -> Assessment | None:
    """Return the loop in the case's own sea; None where it has no stationary motion."""
    loop = _loop(question, question.values(parameters))
    return loop if loop is not None and loop.stable else None


def _loop(question: DesignQuestion, values: Values) -> Assessment | None:
    loop = question.problem.assess(values)
    try:
        return loop if min(loop.coefficients, default=0.0) >= 0.0 else None
    except SolverError:
        return None  # no drag agrees with the motion
