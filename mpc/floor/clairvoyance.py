r"""The floor under every controller on a record that is known beforehand: `clairvoyant`.

    case, hook record --> record plant --> quadratic programme --> Clairvoyant

Of all demands on the drive, one for every moment of a record that is known from beginning to end,
those that minimise the payload's mean square displacement within the drive's limits.  No
controller, causal or not, keeps the payload stiller on the linear plant.  Everything uncertain
stands on the side that makes the floor lower: the demand may bend any way from sample to sample
(`mpc.floor.plant`), the payload may start anywhere, and nothing is asked of the end.

The drag of the linear plant is the linear equivalent of the quadratic drag in the motion of the
*answer*, found by substitution: a payload that is held still has next to none, and the drag of the
open-loop motion would damp it for nothing.  ``drag=0`` tells how little hangs on it.

`Clairvoyant.verify` simulates the answer by another route, and `mpc.floor.certificate` proves it;
the tests refine it on the nonlinear plant (`nonlinear_floor`).
"""

import math
import time as clock
from collections.abc import Callable

import numpy as np

from models.basics import FloatArray, InputError, check_choice, check_range, shows_progress
from models.case import Case
from models.operation import Motion
from models.plant import DriveLimits, PlantData, stochastic_equivalent

from .certificate import rollout
from .floor import Clairvoyant, Start, floor_of
from .plant import HOLDS, Hold, RecordPlant, record_plant
from .problem import RecordProblem, RecordSolution
from .qp import solve_record

_Pose = Callable[[float], RecordProblem]

_OWNER = "clairvoyant"
_STARTS = ("free", "hook")
_ROUNDS = 5  # of drag and motion
_AGREED = 0.05  # relative change of the drag that ends them


@shows_progress("the optimum of the record")
def clairvoyant(
    case: Case,
    record: Motion,
    *,
    sample_time: float = 0.05,
    settle: float = 0.0,
    masses: int | None = None,
    drag: float | None = None,
    limits: DriveLimits | None = None,
    minimum_tension: float | None = None,
    start: Start = "free",
    hold: Hold = "line",
) -> Clairvoyant:
    """Return the floor of a record: the stillest payload with everything known in advance.

    Parameters
    ----------
    case
        Rope, payload, winch and drive.
    record
        Motion of the hook, at the sample time or a whole fraction of it.
    sample_time
        [s].
    settle
        Time from which the payload counts [s].
    masses
        Rope masses; by default the case's.
    drag
        Linear drag coefficient [N s/m]; by default that which agrees with the answer's motion.
    limits
        Drive limits; by default the case's.
    minimum_tension
        Tension that the rope keeps [N], -inf for none; by default the case's, else zero.
    start
        ``free``: any first state, a floor under every start.  ``hook``: drum at rest, rope and
        payload move with the hook, where a simulation starts.
    hold
        ``line``: a demand that is a straight line over each sample, the floor.  ``command``: a
        command that is held and keeps the limits at both ends, which the drive can follow.

    Raises
    ------
    InputError
        If an argument is out of range, or record and sample time do not fit.
    SolverError
        If there is no motion within the limits, or the solver fails.

    Examples
    --------
    >>> from models import load_case
    >>> from models.operation.excitation import SpectrumMotion
    >>> case = load_case("thesis-1975")
    >>> sea = SpectrumMotion.from_case(case).motion(60.0, 0.05, 1)
    >>> floor = clairvoyant(case, sea)
    >>> floor.lower_bound <= floor.payload_rms < 0.2 * floor.hook_rms
    True
    """
    began = clock.perf_counter()
    check_range(_OWNER, "sample_time", sample_time, low=0.0, unit="s", open_low=True)
    check_choice(_OWNER, "start", start, _STARTS)
    check_choice(_OWNER, "hold", hold, HOLDS)
    if drag is not None:
        check_range(_OWNER, "drag", drag, low=0.0, unit="N s/m")
    limits = DriveLimits.from_case(case) if limits is None else limits
    heave, rate, acceleration = _rows(record, sample_time)
    samples = len(heave) - 1
    check_range(_OWNER, "settle", settle, low=0.0, high=samples * sample_time, unit="s")
    tension = case.limits.minimum_tension or 0.0 if minimum_tension is None else minimum_tension
    if not tension < math.inf:
        raise InputError(f"{_OWNER}: minimum_tension must be a number or -inf, got {tension!r} N")

    def problem(coefficient: float) -> RecordProblem:
        plant = record_plant(
            case, sample_time=sample_time, drag=coefficient, masses=masses, limits=limits, hold=hold
        )
        return RecordProblem(
            plant=plant,
            heave=heave,
            rate=rate,
            acceleration=acceleration,
            first=math.ceil(settle / sample_time - 1e-9),
            minimum_tension=tension,
            start=None if start == "free" else _with_hook(plant, heave[0], rate[0]),
        )

    posed, solution = _solved(problem(drag or 0.0), problem, case if drag is None else None)
    return floor_of(case, limits, start, settle, posed, solution, began)


def _rows(record: Motion, sample_time: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return displacement, velocity and acceleration at the samples."""
    every = round(sample_time / record.step)
    if every < 1 or abs(every * record.step - sample_time) > 1e-9 * sample_time:
        raise InputError(
            f"{_OWNER}: the record's step must be the sample time, {sample_time:g} s, or a whole "
            f"fraction of it, got {record.step:g} s"
        )
    samples = (record.rows - 1) // every
    if samples < 2:
        raise InputError(f"{_OWNER}: the record must have 3 samples or more, got {samples + 1}")
    z, v, a = record.block(0, samples * every + 1)
    return z[::every].copy(), v[::every].copy(), a[::every].copy()


def _with_hook(plant: RecordPlant, heave: float, rate: float) -> FloatArray:
    """Return the state in which rope and payload move with the hook and the drum does not."""
    state = np.zeros(len(plant.states))
    for at, name in enumerate(plant.states):
        if not name.startswith("motor."):
            state[at] = heave if name.endswith("displacement") else rate
    return state


def _solved(
    posed: RecordProblem, problem: _Pose, case: Case | None
) -> tuple[RecordProblem, RecordSolution]:
    """Return problem and answer; with a case, drag and motion agree."""
    solution = solve_record(posed)
    quadratic = 0.0 if case is None else PlantData.from_case(case).quadratic_drag
    if quadratic == 0.0:
        return posed, solution
    for _ in range(_ROUNDS):
        y = rollout(posed, solution.start, solution.inputs)
        velocity = y[posed.first :, posed.plant.states.index("payload.velocity")]
        found = stochastic_equivalent(quadratic, float(np.sqrt(np.mean(velocity**2))))
        before = posed.plant.drag
        # A drag that moves the payload by less than the programme resolves is as good as none.
        if abs(found - before) <= _AGREED * found or found < 1e-3 * quadratic:
            break
        posed = problem(found)
        solution = solve_record(posed)
    return posed, solution
