"""Integration of the plant over a control sample: Runge-Kutta steps, their length, and the brake.

The classical fourth-order method, several steps to a control sample.  The hook's motion is
given at the ends of a step only; a cubic through displacement, velocity and acceleration
stands for it in the middle, so that the method keeps its order.  `rk4_step` builds one step,
in symbols or numbers, from any right-hand side; `choose_step` says how many a sample takes
and refuses a step that would blur the plant's fastest mode.

A locked drum has no speed and no torque to show, so its brake is no smooth friction but is decided
at the start of every step (`braked_step`).  A drum at rest stays there while the torques on it are
within the brake's; a moving one is slowed by the brake's torque, and rests when its speed would
change sign (stick and slip after D. Karnopp, "Computer simulation of stick-slip friction in
mechanical dynamic systems", ASME J. Dyn. Syst. Meas. Control 107, 1985).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias, TypeVar

import casadi as ca
import numpy as np

from ..basics import FloatArray, InputError, check_range
from ..plant import Plant

# casadi.SX, casadi.MX, an array or a float: the formulas are the same.
Value: TypeAlias = Any
# What moves the plant over a step, as the right-hand side takes it.
Driven = TypeVar("Driven")

MAX_SUBSTEPS = 1000
_ROUNDING = 1e-9  # [-] of a frequency, or of a ratio of times


def hermite_midpoint(
    z0: Value, v0: Value, a0: Value, z1: Value, v1: Value, a1: Value, h: float
) -> tuple[Value, Value]:
    """Return displacement [m] and velocity [m/s] in the middle of a step of length `h` [s].

    Cubic Hermite interpolation, of the displacement from the velocities and of the velocity
    from the accelerations: z = (z0 + z1)/2 + h/8 (v0 - v1), v = (v0 + v1)/2 + h/8 (a0 - a1);
    the errors are h^4/384 times the fourth derivative.
    """
    displacement = 0.5 * (z0 + z1) + (h / 8.0) * (v0 - v1)
    velocity = 0.5 * (v0 + v1) + (h / 8.0) * (a0 - a1)
    return displacement, velocity


def rk4_step(
    rhs: Callable[[Value, Driven], Value],
    x: Value,
    motions0: Driven,
    motions_mid: Driven,
    motions1: Driven,
    h: float,
) -> Value:
    """Return the state x after one step h [s] of the classical Runge-Kutta method.

    x' is rhs(x, motions).  What moves the plant (displacement and velocity of every motion, say) is
    given at the beginning, in the middle (`hermite_midpoint`) and at the end; all else is held.
    """
    k1 = rhs(x, motions0)
    k2 = rhs(x + (0.5 * h) * k1, motions_mid)
    k3 = rhs(x + (0.5 * h) * k2, motions_mid)
    k4 = rhs(x + h * k3, motions1)
    return x + (h / 6.0) * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


def braked_step(plant: Plant, parameters: Sequence[str], motions: int, step: float) -> ca.Function:
    """Return a step [s] of the plant with the drum's brake: (x, u, ends, brake, p) -> x.

    `ends` are displacement, velocity and acceleration of every motion, the hook's included, at the
    beginning, then at the end, (6 motions,), `brake` is in [0, 1], and p has the plant's parameters
    first and ``brake.torque`` [N m] among the others.
    """
    x, u = ca.SX.sym("x", len(plant.states)), ca.SX.sym("u")
    ends, brake = ca.SX.sym("ends", 6 * motions), ca.SX.sym("brake")
    p = ca.SX.sym("p", len(parameters))
    of_plant = p[: len(plant.parameters)]
    angle, speed = plant.states.index("motor.angle"), plant.states.index("motor.speed")
    inertia = p[parameters.index("winch.inertia")]
    capacity = brake * p[parameters.index("brake.torque")]

    first, last = ends[: 3 * motions], ends[3 * motions :]
    middle = _between(first, last, step)

    def free(at: ca.SX, moved: ca.SX) -> ca.SX:
        return plant.function(at, u, disturbances(moved), of_plant)[0]

    # What the brake would have to hold, and whether it can, is asked once, at the start of the
    # step: within it the friction keeps its sign, and Runge-Kutta sees no kink.
    net = inertia * free(x, first)[speed]
    resting = x[speed] == 0
    held = ca.logic_and(resting, ca.logic_and(capacity > 0, ca.fabs(net) <= capacity))
    turning = ca.if_else(resting, ca.sign(net), ca.sign(x[speed]))
    friction = capacity * turning / inertia

    def rhs(at: ca.SX, moved: ca.SX) -> ca.SX:
        rate = ca.SX(free(at, moved))
        rate[speed] = ca.if_else(held, 0, rate[speed] - friction)
        rate[angle] = ca.if_else(held, 0, rate[angle])
        return rate

    after = ca.SX(rk4_step(rhs, x, first, middle, last, step))
    braking = ca.logic_and(capacity > 0, ca.logic_not(resting))
    # Friction stops a drum and does not turn it round: at a change of sign it rests.
    stops = ca.logic_and(braking, after[speed] * x[speed] <= 0)
    after[speed] = ca.if_else(stops, 0, after[speed])
    (dense,) = ca.cse([ca.densify(after)])
    return ca.Function("braked_step", [x, u, ends, brake, p], [dense])


def disturbances(moved: ca.SX) -> ca.SX:
    """Return the plant's w: heave, heave rate, no force, no set-point, whatever else moves.

    Of displacement, velocity and acceleration of every motion, the hook's first (3 motions,).
    """
    return ca.vertcat(moved[:2], 0, 0, moved[3:])


def _between(first: ca.SX, last: ca.SX, step: float) -> ca.SX:
    """Return the motions in the middle of a step; an acceleration is of the velocity's cubic."""
    motions = first.numel() // 3
    z0, v0, a0 = ca.vertsplit(ca.reshape(first, 3, motions))
    z1, v1, a1 = ca.vertsplit(ca.reshape(last, 3, motions))
    z, v = hermite_midpoint(z0, v0, a0, z1, v1, a1, step)
    return ca.vec(ca.vertcat(z, v, 1.5 * (v1 - v0) / step - 0.25 * (a0 + a1)))


@dataclass(frozen=True, kw_only=True)
class StepChoice:
    """How a control sample is divided into integration steps."""

    sample_time: float  #: Control sample [s].
    substeps: int  #: Steps to a sample.
    step: float  #: Length of a step, sample_time / substeps [s].
    #: Longest step that is allowed, before it was made to divide the sample [s]; at most the sample
    #: itself.
    largest: float
    fastest: float  #: The mode that sets it [rad/s]; zero if nothing but the sample does.


def choose_step(
    A: FloatArray,
    sample_time: float,
    step: float | None = None,
    *,
    extra_rates: Sequence[float] = (),
) -> StepChoice:
    """Return the integration step [s]: the longest allowed that divides the sample, or `step`.

    A step is allowed if no eigenvalue lambda has h |lambda| above one.  The plant's Jacobian is (n,
    n) [1/s], or several (k, n, n), such as over rope lengths.  Rates [rad/s] that it does not show
    are extra: friction about zero speed, the stiffness of a contact.

    Raises InputError if `step` is too long or does not divide the sample, or the sample takes too
    many.

    Notes
    -----
    Over a step h the method adds (h w)^5/144 to the damping ratio of a mode w and slows it by
    the part (h w)^4/120.  With h w = 1 the fastest mode itself gets 0.6 % of critical damping
    (it loses 3.8 % of its amplitude in a period) and is 0.6 % slow; one at a fifth of it,
    where the loop's crossover may be, gets 2e-6 and 1e-5.  Kelvin-Voigt damping gives the
    fast modes of a rope more than that in truth.  What decays in truth decays in the simulation
    too: the method is stable up to h |lambda| of at least 2.6 on every ray of the left half-plane.
    """
    fastest = float(max([*np.abs(np.linalg.eigvals(A)).ravel(), *extra_rates]))
    bound = fastest * sample_time > 1.0
    longest = 1.0 / fastest if bound else float(sample_time)
    if step is None:
        substeps = max(1, math.ceil(sample_time / longest * (1.0 - _ROUNDING)))
    else:
        check_range("integration", "step", step, low=0.0, unit="s", open_low=True)
        why = f"the plant's fastest mode, at {fastest:.4g} rad/s," if bound else "the sample time"
        most = f"be at most {longest:.4g} s, which {why} allows, got {step!r}"
        if step > longest * (1.0 + _ROUNDING):
            raise InputError(f"integration: step must {most}")
        substeps = round(sample_time / step)
        if abs(sample_time / step - substeps) > _ROUNDING * sample_time / step:
            raise InputError(
                f"integration: step must divide the sample time {sample_time:g} s into a whole "
                f"number of steps and {most}"
            )
    if substeps > MAX_SUBSTEPS:
        raise InputError(
            f"integration: a sample of {sample_time:g} s would take {substeps} steps, at most "
            f"{MAX_SUBSTEPS} are allowed; the plant's fastest mode is at {fastest:.4g} rad/s and "
            f"allows {longest:.3g} s a step"
        )
    return StepChoice(
        sample_time=float(sample_time),
        substeps=substeps,
        step=sample_time / substeps,
        largest=longest,
        fastest=fastest,
    )
