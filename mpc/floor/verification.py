"""Verification of a record's optimum: the linear plant once more, by another route.

The programme samples the plant in its own coordinates by a matrix exponential; here the plant of
`Plant.linearise` is integrated in time with short Runge-Kutta steps, in its own units, under the
command that the demand comes to, the hook read from SciPy's cubic Hermite spline.  The two share
nothing but the plant's matrices.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from models.basics import FloatArray
from models.case import Case
from models.plant import PlantData, build_plant

from .problem import RecordProblem, RecordSolution

_REACH = 0.1  # of the plant's fastest pole times the step
_PAYLOAD, _LIMITS = 1e-5, 1e-5  # allowed [m], and share of a limit [-]


@dataclass(frozen=True, kw_only=True)
class RecordVerification:
    """What another simulation of the same demand says."""

    payload_rms: float  #: Found by the other route [m].
    payload_error: float  #: Largest difference of the payload's displacement at the samples [m].
    excess: float  #: Largest excess over a limit, at the samples, as a share of the limit [-].
    passed: bool  #: Whether rms and limits are confirmed.

    def __str__(self) -> str:
        """Return it in a sentence."""
        return (
            f"{'confirmed' if self.passed else 'NOT confirmed'}: "
            f"{1e3 * self.payload_rms:.4g} mm rms by another route, at most "
            f"{1e6 * self.payload_error:.2g} um apart; limits kept to {self.excess:.1e}"
        )


def verify_record(
    case: Case,
    problem: RecordProblem,
    solution: RecordSolution,
    *,
    payload: FloatArray,
    payload_rms: float,
) -> RecordVerification:
    """Simulate a solution's demand, and compare with the claimed payload (N+1,) [m] and rms [m]."""
    sampled, N, dt = problem.plant, problem.samples, problem.plant.sample_time
    count = sum(name.endswith("displacement") for name in sampled.states)
    linear = build_plant(PlantData.from_case(case).viscous, count).linearise(drag=sampled.drag)
    hook = [linear.disturbances.index(name) for name in ("hook.heave", "hook.heave_rate")]
    at = [linear.states.index(name) for name in sampled.states]
    out = {name: linear.outputs.index(name) for name in ("payload.displacement", "motor.speed")}
    inputs = solution.inputs + problem.still_inputs

    # demand = gain command - gain slope speed, so a line of demand is a command that follows speed
    x = np.zeros(len(linear.states))
    x[at] = (solution.start + problem.still[0]) * sampled.scale
    law = np.zeros(len(x))
    law[at] = sampled.command_feedback / sampled.scale
    per_demand = sampled.peak / sampled.command_gain
    A, B, E = linear.A, linear.B[:, 0] * per_demand, linear.E[:, hook]
    if sampled.hold == "line":
        A = A + np.outer(linear.B[:, 0], law)
    fastest = float(np.abs(np.linalg.eigvals(A)).max())
    steps = math.ceil(fastest * dt / _REACH)
    h = dt / steps
    clock = dt * np.arange(N + 1)
    spline = CubicHermiteSpline(clock, problem.heave, problem.rate)
    rate = spline.derivative()
    parts = np.linspace(0.0, 1.0, 2 * steps + 1)
    when = clock[:-1, None] + dt * parts
    moved = np.stack([spline(when), rate(when)], axis=-1) @ E.T
    start, end = inputs[:, :1], inputs[:, -1:]
    pushed = moved + ((1.0 - parts) * start + parts * end)[:, :, None] * B

    states = np.empty((N + 1, len(x)))
    states[0] = x
    for k in range(N):
        force = pushed[k]
        for j in range(steps):
            first, middle, last = force[2 * j], force[2 * j + 1], force[2 * j + 2]
            k1 = A @ x + first
            k2 = A @ (x + 0.5 * h * k1) + middle
            k3 = A @ (x + 0.5 * h * k2) + middle
            k4 = A @ (x + h * k3) + last
            x = x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        states[k + 1] = x
    shown = states @ linear.Cz[out["payload.displacement"]]
    speed = states @ linear.Cz[out["motor.speed"]]
    excess = 0.0
    for end_of in (0, 1):
        own = slice(end_of, end_of + N)
        demand = sampled.static_demand + inputs[:, end_of if sampled.hold == "line" else 0]
        if sampled.hold == "command":
            demand = demand - states[own] @ law / per_demand
        rows = np.stack([demand, speed[own]], axis=1) @ sampled.windows.T
        excess = max(excess, float(np.abs(rows).max()) - 1.0)
    tension = linear.Cz[linear.outputs.index("rope.tension")]
    feed = linear.Fz[linear.outputs.index("rope.tension"), hook]
    ends = np.stack([problem.heave, problem.rate], axis=1)
    falls = case.rope.falls
    top = falls * (states @ tension + ends @ feed)[:N] + sampled.static_tensions[-1]
    excess = max(
        excess, float(((problem.minimum_tension - top) / sampled.static_tensions[-1]).max())
    )
    error = float(np.abs(shown - payload).max())
    rms = float(np.sqrt(np.mean(shown[problem.first :] ** 2)))
    near = abs(rms - payload_rms) <= _PAYLOAD and error <= 10.0 * _PAYLOAD
    return RecordVerification(
        payload_rms=rms,
        payload_error=error,
        excess=max(excess, 0.0),
        passed=bool(near and excess <= _LIMITS),
    )
