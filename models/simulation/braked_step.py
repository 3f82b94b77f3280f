"""One integration step of the plant, with the drum's brake.

    state, command, motions at both ends, how far the brake is closed --> state

A locked drum has no speed and no torque to show, so its brake is no smooth friction but is decided
at the start of every integration step.  A drum at rest stays there while the torques on it are
within the brake's; a moving one is slowed by the brake's torque, and rests when its speed would
change sign (stick and slip after D. Karnopp, "Computer simulation of stick-slip friction in
mechanical dynamic systems", ASME J. Dyn. Syst. Meas. Control 107, 1985).
`models.simulation.closed_loop` strings the steps of a control sample together.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from ..plant import Plant
from .integrate import hermite_midpoint, rk4_step

Ends = Sequence[tuple[ca.SX, ca.SX, ca.SX]]
"""Displacement, velocity and acceleration of every motion at one moment, the hook's first."""


def braked_step(plant: Plant, parameters: Sequence[str], motions: int, step: float) -> ca.Function:
    """Return the step as a function.

    Parameters
    ----------
    plant
        The plant, whose parameters come first among `parameters`.
    parameters
        Names of p; ``brake.torque`` [N m] is among them.
    motions
        How many motions there are, the hook's included.
    step
        Length of the step [s].

    Returns
    -------
    casadi.Function
        (x, u, ends, brake, p) -> x, with `ends` displacement, velocity and acceleration of every
        motion at the beginning, then at the end, (6 motions,), and `brake` in [0, 1].
    """
    x, u = ca.SX.sym("x", len(plant.states)), ca.SX.sym("u")
    ends, brake = ca.SX.sym("ends", 6 * motions), ca.SX.sym("brake")
    p = ca.SX.sym("p", len(parameters))
    of_plant = p[: len(plant.parameters)]
    angle, speed = plant.states.index("motor.angle"), plant.states.index("motor.speed")
    inertia = p[parameters.index("winch.inertia")]
    capacity = brake * p[parameters.index("brake.torque")]

    first, last = _moved(ends, 0, motions), _moved(ends, 3 * motions, motions)
    middle: Ends = [_between(*pair, step) for pair in zip(first, last, strict=True)]

    def free(at: ca.SX, moved: Ends) -> ca.SX:
        return plant.function(at, u, disturbances(moved), of_plant)[0]

    net = inertia * free(x, first)[speed]
    resting = x[speed] == 0
    held = ca.logic_and(resting, ca.logic_and(capacity > 0, ca.fabs(net) <= capacity))
    turning = ca.if_else(resting, ca.sign(net), ca.sign(x[speed]))
    friction = capacity * turning / inertia

    def rhs(at: ca.SX, moved: Ends) -> ca.SX:
        rate = ca.SX(free(at, moved))
        rate[speed] = ca.if_else(held, 0, rate[speed] - friction)
        rate[angle] = ca.if_else(held, 0, rate[angle])
        return rate

    after = ca.SX(rk4_step(rhs, x, first, middle, last, step))
    braking = ca.logic_and(capacity > 0, ca.logic_not(resting))
    stops = ca.logic_and(braking, after[speed] * x[speed] <= 0)
    after[speed] = ca.if_else(stops, 0, after[speed])
    (dense,) = ca.cse([ca.densify(after)])
    return ca.Function("braked_step", [x, u, ends, brake, p], [dense])


def disturbances(moved: Ends) -> ca.SX:
    """Return the plant's w: heave, heave rate, no force, no set-point, whatever else moves."""
    (heave, rate, _), *others = moved
    return ca.vertcat(heave, rate, 0, 0, *(end for other in others for end in other))


def _moved(ends: ca.SX, at: int, motions: int) -> list[tuple[ca.SX, ca.SX, ca.SX]]:
    return [(ends[k], ends[k + 1], ends[k + 2]) for k in range(at, at + 3 * motions, 3)]


def _between(
    first: tuple[ca.SX, ca.SX, ca.SX], last: tuple[ca.SX, ca.SX, ca.SX], step: float
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return a motion in the middle of a step; its acceleration is that of the velocity's cubic."""
    (_, v0, a0), (_, v1, a1) = first, last
    z, v = hermite_midpoint(*first, *last, step)
    return z, v, 1.5 * (v1 - v0) / step - 0.25 * (a0 + a1)
