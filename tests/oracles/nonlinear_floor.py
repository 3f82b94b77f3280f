r"""The clairvoyant floor once more, on the nonlinear plant: one record by a nonlinear programme.

    Clairvoyant (hold="command") --> `refine` (IPOPT) --> Refinement --> `Replay` in a simulation

The quadratic programme knows a linear drag, a rope that never goes slack and one loss of the gear.
Here the plant is that of the simulation: quadratic drag, springs that carry no pressure, losses of
the gear both ways, dry friction, constant power as it is.  Direct multiple shooting with one
command per sample, two or more Runge-Kutta steps within it and the hook as in the quadratic
programme; exact first and second derivatives by CasADi; solved by IPOPT from the clairvoyant's own
motion.

The drive's limits are kept at both ends of each sample, so that the drive has nothing to cut and a
simulation that replays the commands shows the same motion.  It is a local optimum: what it proves
is that so much can be had on the nonlinear plant, and how far the linear floor is from that.
"""

from __future__ import annotations

import math
import time as clock
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from models.basics import FloatArray, InputError, ReadOnlyArrays, SolverError, check_range
from models.plant import MEAN_LOSSES, Plant, PlantData, build_plant
from models.sensing import Measurement
from mpc.floor.certificate import rollout
from mpc.floor.floor import Clairvoyant
from mpc.floor.problem import RHO, RHO_START

_OWNER = "record refinement"
_REACH = 0.25  # of the fastest pole times a Runge-Kutta step
_GEAR_TURN = 1.0  # motor speed over which the gear's losses change sides [rad/s]


@dataclass(frozen=True, kw_only=True, eq=False)
class Replay:
    """A controller that repeats commands, whatever it sees; the last one is held.

    Parameters
    ----------
    commands
        One for each sample, (N,) [unit of the command].
    sample_time
        [s].
    name
        What it is called in results.
    """

    commands: FloatArray
    sample_time: float
    name: str = "replay"

    def reset(self) -> None:
        """Forget nothing: there is nothing to forget."""

    def step(self, measurement: Measurement, time: float) -> float:
        """Return the command of this time."""
        del measurement
        return float(self.commands[min(round(time / self.sample_time), len(self.commands) - 1)])


@dataclass(frozen=True, kw_only=True, eq=False)
class Refinement(ReadOnlyArrays):
    """The optimum of a record on the nonlinear plant.

    Attributes
    ----------
    floor
        The clairvoyant that it began from.
    payload_rms
        Of the nonlinear optimum, from `settle` on [m].
    warm_rms
        What the clairvoyant's own commands do on the nonlinear plant [m].
    time, payload, command
        (N+1,) [s], (N+1,) [m], (N,) [unit of the command].
    torque_peak
        Largest demand [N m].
    status, iterations, seconds
        IPOPT's.
    """

    floor: Clairvoyant
    payload_rms: float
    warm_rms: float
    time: FloatArray
    payload: FloatArray
    command: FloatArray
    torque_peak: float
    status: str
    iterations: int
    seconds: float

    @property
    def difference(self) -> float:
        """Nonlinear optimum over the linear floor, less one [-]."""
        return self.payload_rms / self.floor.payload_rms - 1.0

    @cached_property
    def controller(self) -> Replay:
        """The commands as a controller, to be simulated."""
        return Replay(commands=self.command, sample_time=self.floor.problem.plant.sample_time)

    def __str__(self) -> str:
        """Return a small tree of the numbers."""
        return (
            f"Refinement over {self.time[-1]:g} s: {1e3 * self.payload_rms:.4g} mm rms on the "
            f"nonlinear plant, {100 * self.difference:+.2g} % from the linear floor\n"
            f"├ linear floor, commands held: {1e3 * self.floor.payload_rms:.4g} mm rms; its "
            f"commands on the nonlinear plant: {1e3 * self.warm_rms:.4g} mm rms\n"
            f"├ demand: {self.torque_peak / 1e3:.4g} kN m at most\n"
            f"└ IPOPT: {self.status}, {self.iterations} steps, {self.seconds:.3g} s"
        )


def refine(floor: Clairvoyant, *, max_iterations: int = 300, tolerance: float = 1e-8) -> Refinement:
    """Return the optimum on the nonlinear plant, from a clairvoyant's motion.

    Parameters
    ----------
    floor
        A clairvoyant with ``hold="command"``; start and settling time are its own.
    max_iterations
        Of IPOPT.
    tolerance
        Of IPOPT's scaled optimality conditions.

    Raises
    ------
    InputError
        If the clairvoyant does not hold its commands.
    SolverError
        If IPOPT does not converge.
    """
    if floor.hold != "command":
        raise InputError(f"{_OWNER}: floor must be made with hold='command', got {floor.hold!r}")
    check_range(_OWNER, "max_iterations", max_iterations, low=1)
    check_range(_OWNER, "tolerance", tolerance, low=0.0, open_low=True)
    began = clock.perf_counter()
    problem, linear = floor.problem, floor.problem.plant
    N, n = problem.samples, len(linear.states)
    plant = _plant(floor)
    advance, limits = _functions(floor, plant)
    y = rollout(problem, floor.solution.start, floor.solution.inputs)
    # Deviations from the motion that holds the payload still, in the linear plant's units: next to
    # zero where no limit binds.
    still = problem.still.T
    ends = np.stack([problem.heave[:-1], problem.rate[:-1], problem.heave[1:], problem.rate[1:]])
    unit = linear.peak / linear.command_gain
    base = linear.static_command + unit * problem.still_inputs[:, 0]
    X, U = ca.MX.sym("X", n, N + 1), ca.MX.sym("U", 1, N)
    whole, commands = X + still, ca.DM(base).T + unit * U
    following = advance.map(N)(whole[:, :-1], commands, ends)
    gaps = ca.vec(following - whole[:, 1:])
    rows = [ca.vec(limits.map(N)(whole[:, k : k + N], commands, ends)) for k in (0, 1)]
    payload = X[linear.states.index("payload.displacement"), problem.first :]
    cost = 0.5 * ca.sumsqr(payload) + 0.5 * RHO * ca.sumsqr(U)
    cost += 0.5 * RHO_START * ca.sumsqr(X[:, 0])
    variables, constraints = ca.veccat(X, U), ca.vertcat(gaps, *rows)
    size = rows[0].numel()
    high = np.concatenate([np.zeros(gaps.numel()), np.ones(2 * size)])
    low = np.concatenate([np.zeros(gaps.numel()), -np.ones(2 * size)])
    bound = np.full(variables.numel(), math.inf)
    floor_bound = -bound
    if problem.start is not None:
        bound[:n] = floor_bound[:n] = problem.start - problem.still[0]
    options: dict[str, Any] = {
        "ipopt.print_level": 0,
        "print_time": False,
        "ipopt.sb": "yes",
        "ipopt.max_iter": int(max_iterations),
        "ipopt.tol": tolerance,
        # The barrier begins small and pushes the start hardly off its bounds: the clairvoyant's
        # motion lies on them most of the time, and is nearly the answer.
        "ipopt.mu_init": 1e-5,
        "ipopt.warm_start_init_point": "yes",
        "ipopt.bound_push": 1e-6,
        "ipopt.obj_scaling_factor": 10.0,
        "error_on_fail": False,
    }
    solver = ca.nlpsol("refine", "ipopt", {"x": variables, "f": cost, "g": constraints}, options)
    first = np.concatenate([y.ravel(), floor.solution.inputs[:, 0]])
    answer = solver(x0=first, lbx=floor_bound, ubx=bound, lbg=low, ubg=high)
    status = str(solver.stats()["return_status"]).replace("_", " ").lower()
    if not solver.stats()["success"] and "acceptable" not in status:
        raise SolverError(f"{_OWNER}: IPOPT found no optimum: {status}")
    found = np.asarray(answer["x"]).ravel()
    states = found[: n * (N + 1)].reshape(N + 1, n) + problem.still
    command = base + unit * found[n * (N + 1) :]
    at = linear.states.index("payload.displacement")

    # both motions once more, sample by sample, from the commands alone
    def replayed(start: FloatArray, commands: FloatArray) -> FloatArray:
        run = advance.mapaccum(N)
        after = np.asarray(run(start, commands[None], ends))
        return np.append(start[at], after[at])

    shown = replayed(states[0], command)
    warm = replayed(y[0] + problem.still[0], base + unit * floor.solution.inputs[:, 0])
    counted = slice(problem.first, None)
    values = np.asarray(limits.map(N)(states[:-1].T, command[None], ends))
    return Refinement(
        floor=floor,
        payload_rms=float(np.sqrt(np.mean(shown[counted] ** 2))),
        warm_rms=float(np.sqrt(np.mean(warm[counted] ** 2))),
        time=floor.time,
        payload=shown,
        command=command,
        torque_peak=float(np.abs(values[0]).max()) * linear.peak,
        status=status,
        iterations=int(solver.stats()["iter_count"]),
        seconds=clock.perf_counter() - began,
    )


def _plant(floor: Clairvoyant) -> Plant:
    """Return the nonlinear plant without the sensors' filters, which move nothing."""
    masses = sum(name.endswith("displacement") for name in floor.problem.plant.states)
    data = PlantData.from_case(floor.case)
    bare = replace(data, sensor_bandwidth=math.inf, telemetry_bandwidth=math.inf)
    return build_plant(bare, masses)


def _functions(floor: Clairvoyant, plant: Plant) -> tuple[ca.Function, ca.Function]:
    """Return one sample, (x, command, hook ends) -> x, and limits at a state, of size one."""
    linear = floor.problem.plant
    changes = {}
    if plant.data.gear_efficiency < 1.0:
        changes["winch.gear_switching"] = 1.0 / _GEAR_TURN
    if plant.data.coulomb_friction > 0.0:
        changes["winch.coulomb_friction"] = plant.data.coulomb_friction
    p = plant.parameter_vector(changes)
    rest = plant.operating_point(MEAN_LOSSES)
    fastest = float(np.abs(plant.linearise(drag=0.0).poles()).max())
    steps = max(2, math.ceil(fastest * linear.sample_time / _REACH))
    dt, h = linear.sample_time, linear.sample_time / steps
    n = len(linear.states)
    x, u, ends = ca.SX.sym("x", n), ca.SX.sym("u"), ca.SX.sym("ends", 4)
    z0, v0, z1, v1 = ca.vertsplit(ends)

    def hook(s: float) -> ca.SX:
        """Displacement and velocity at a share of the sample: cubic Hermite."""
        rise = z1 - z0
        c2 = 3.0 * rise - dt * (2.0 * v0 + v1)
        c3 = -2.0 * rise + dt * (v0 + v1)
        moved = z0 + s * (dt * v0 + s * (c2 + s * c3))
        return ca.vertcat(moved, v0 + s * (2.0 * c2 + 3.0 * s * c3) / dt)

    def rate(state: ca.SX, s: float) -> ca.SX:
        w = ca.vertcat(hook(s), ca.SX.zeros(len(plant.disturbances) - 2))
        return plant.function(rest.x + linear.scale * state, u, w, p)[0] / linear.scale

    state = x
    for j in range(steps):
        s, half, end = j / steps, (j + 0.5) / steps, (j + 1.0) / steps
        k1 = rate(state, s)
        k2 = rate(state + 0.5 * h * k1, half)
        k3 = rate(state + 0.5 * h * k2, half)
        k4 = rate(state + h * k3, end)
        state = state + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
    advance = ca.Function("advance", [x, u, ends], [state])

    demand = linear.static_demand + linear.command_gain / linear.peak * (
        u - linear.static_command - ca.dot(ca.DM(linear.command_feedback), x)
    )
    speed = ca.dot(ca.DM(linear.speed), x)
    rows = [a * demand + b * speed for a, b in linear.windows]
    if math.isfinite(floor.limits.power):
        rows.append(linear.peak * demand * speed / floor.limits.power)
    limits = ca.Function("limits", [x, u, ends], [ca.vertcat(*rows)])
    return advance, limits
