"""The peer of the simulation: the same plant and controller, integrated by SciPy's `solve_ivp`.

Two ways to ask for it, both with RK45 at a relative tolerance of 1e-6:

* `sampled`: the work that ours does.  The drive holds its command over a sample, so the
  integration is started anew at each.
* `continuous`: what suits `solve_ivp` better.  The controller acts at every moment instead, and
  one call integrates the whole interval.

Both are written to be fast.  The right-hand side is the plant's own CasADi function without the
outputs that are not asked for, bound to fixed buffers; in the second way the controller is part
of it.  The hook's motion is interpolated in plain Python between values that are computed in
advance, and nothing is logged.  `sampled(plain=True)` calls the function as CasADi's manual does
instead, which takes forty times as long.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt
import scipy.integrate

from models.plant import DriveLimits, Plant, build_plant
from models.sensing import HEARD, Measurement, recursion_of
from models.simulation import Simulation

__all__ = ["Answer", "Peer"]

FloatArray = npt.NDArray[np.float64]
Derivative = Callable[[float, FloatArray], FloatArray]

RTOL = 1e-6
_PAYLOAD = ("payload.acceleration", "payload.velocity", "payload.displacement")


@dataclass(frozen=True, kw_only=True, eq=False)
class Answer:
    """What a peer found.

    `payload` is its displacement at every control sample, (n,) [m]; `seconds` the processor's
    time for `duration` seconds of simulation; `evaluations` counts those of the right-hand side.
    """

    payload: FloatArray
    seconds: float
    duration: float
    evaluations: int

    @property
    def speed(self) -> float:
        """Simulated seconds for a second of processor time."""
        return self.duration / self.seconds


class Peer:
    """`solve_ivp` on the plant of a simulation, with its controller, hook motion and start.

    Parameters
    ----------
    simulation
        One that holds station with perfect sensors, with a controller without states that asks
        for nothing but the payload's motion.
    seed, duration
        Of the hook's motion; the length [s].
    """

    def __init__(self, simulation: Simulation, *, seed: int, duration: float) -> None:
        case, loop = simulation.case, simulation.loop
        plant = build_plant(case, limits=DriveLimits.from_case(case))
        nx = len(plant.states)
        if loop.states[:nx] != tuple(f"plant.{name}" for name in plant.states):
            raise ValueError(f"the simulation is of another plant: {loop.states[:nx]}")
        self._plant, self._controller = plant, simulation.controller
        self._p = np.array(list(loop.parameters.values()))[: len(plant.parameters)]
        rows = simulation.rows(seed, duration)
        self._start = simulation.start(rows)[:nx]
        motion = rows.motions[0]
        z, v, a = motion.block(0, motion.rows)
        self._hook = _interpolated(z, v, a, motion.step)
        # As much as the hook does is much for every part of the plant.
        turn = loop.parameters["winch.gear_ratio"] / loop.parameters["winch.drum_radius"]
        size = {"angle": turn * z.std(), "speed": turn * v.std()}
        size |= {"displacement": z.std(), "velocity": v.std()}
        self._atol = RTOL * np.array([size[name.split(".")[-1]] for name in plant.states])
        self._times = loop.sample_time * np.arange(float(simulation.samples(duration)))
        self._payload = plant.states.index("payload.displacement")

    def sampled(self, *, plain: bool = False) -> Answer:
        """Return the answer with the command held over each sample."""
        call = _Plain if plain else _Bound
        plant, hook, controller = self._plant, self._hook, self._controller
        x, u, w, p = _symbols(plant)
        rate, measured, _ = plant.function(x, u, w, p)
        rhs = call(ca.Function("rate", [x, u, w, p], [rate]), self._p)
        look = call(ca.Function("look", [x, u, w, p], [measured]), self._p)
        seen = np.zeros(len(HEARD))
        at = [HEARD.index(name) for name in _PAYLOAD]
        controller.reset()

        def derivative(time: float, state: FloatArray) -> FloatArray:
            return rhs(state, command, hook(time))

        state, path, count = self._start, np.empty(self._times.size), 0
        command = 0.0  # the motor is yet at rest: no measurement depends on it
        step = float(self._times[1])
        began = clock.process_time()
        for k, time in enumerate(self._times.tolist()):
            path[k] = state[self._payload]
            seen[at] = look(state, command, hook(time))
            command = controller.step(Measurement(seen), time)
            state, evaluations = self._solved(derivative, time, time + step, state)
            count += evaluations
        return self._answer(path, clock.process_time() - began, count)

    def continuous(self) -> Answer:
        """Return the answer with the controller acting at every moment, in one call."""
        plant, hook = self._plant, self._hook
        recursion = recursion_of(self._controller)
        if recursion is None or recursion.initial.size:
            raise ValueError("the controller must be a recursion without states")
        x, u, w, p = _symbols(plant)
        seen = ca.SX.zeros(len(HEARD))
        for at, value in zip(_PAYLOAD, ca.vertsplit(plant.function(x, 0, w, p)[1]), strict=True):
            seen[HEARD.index(at)] = value
        _, command = recursion.function(ca.SX(0, 1), seen)
        rate = plant.function(x, command, w, p)[0]
        rhs = _Bound(ca.Function("rate", [x, u, w, p], ca.cse([rate])), self._p)

        def derivative(time: float, state: FloatArray) -> FloatArray:
            return rhs(state, 0.0, hook(time))

        began = clock.process_time()
        path, count = self._path(derivative)
        return self._answer(path, clock.process_time() - began, count)

    def _solved(
        self, derivative: Derivative, start: float, end: float, state: FloatArray
    ) -> tuple[FloatArray, int]:
        """Return the state at the end, and the number of evaluations."""
        found = scipy.integrate.solve_ivp(
            derivative, (start, end), state, method="RK45", rtol=RTOL, atol=self._atol
        )
        if not found.success:
            raise RuntimeError(f"solve_ivp: {found.message}")
        return found.y[:, -1], int(found.nfev)

    def _path(self, derivative: Derivative) -> tuple[FloatArray, int]:
        """Return the payload's displacement at the samples, and the number of evaluations."""
        found = scipy.integrate.solve_ivp(
            derivative,
            (0.0, float(self._times[-1])),
            self._start,
            method="RK45",
            t_eval=self._times,
            rtol=RTOL,
            atol=self._atol,
        )
        if not found.success:
            raise RuntimeError(f"solve_ivp: {found.message}")
        return found.y[self._payload], int(found.nfev)

    def _answer(self, path: FloatArray, seconds: float, evaluations: int) -> Answer:
        return Answer(
            payload=path,
            seconds=seconds,
            duration=float(self._times[-1]),
            evaluations=evaluations,
        )


class _Plain:
    """(x, u, w, p) -> one vector, as a plain call of the function."""

    def __init__(self, function: ca.Function, p: FloatArray) -> None:
        self._function, self._p = function, p
        self._moved = np.zeros(function.numel_in(2))

    def __call__(self, state: FloatArray, command: float, moved: tuple[float, float]) -> FloatArray:
        self._moved[0], self._moved[1] = moved
        return np.asarray(self._function(state, command, self._moved, self._p)).ravel()


class _Bound:
    """(x, u, w, p) -> one vector, with all addresses bound once: a call takes microseconds."""

    def __init__(self, function: ca.Function, p: FloatArray) -> None:
        buffer: Any  # CasADi's stubs ask for an address and a size
        buffer, self._evaluate = function.buffer()
        given = [np.zeros(function.numel_in(i)) for i in range(3)]
        self._state, self._command, self._moved = given
        self._result = np.zeros(function.numel_out(0))
        self._kept = buffer, p
        for i, array in enumerate((*given, p)):
            buffer.set_arg(i, array.data)
        buffer.set_res(0, self._result.data)

    def __call__(self, state: FloatArray, command: float, moved: tuple[float, float]) -> FloatArray:
        self._state[:] = state
        self._command[0] = command
        self._moved[0], self._moved[1] = moved
        self._evaluate()
        return self._result.copy()


def _symbols(plant: Plant) -> list[ca.SX]:
    sizes = (len(plant.states), 1, len(plant.disturbances), len(plant.parameters))
    return [ca.SX.sym(name, size) for name, size in zip("xuwp", sizes, strict=True)]


def _interpolated(
    z: FloatArray, v: FloatArray, a: FloatArray, step: float
) -> Callable[[float], tuple[float, float]]:
    """Return displacement and velocity at any time, by cubics between rows `step` [s] apart.

    The displacement's cubic has the velocities at its ends, the velocity's the accelerations,
    as in `models.simulation.integrate.hermite_midpoint`.
    """
    table = np.column_stack((_cubic(z, v, step), _cubic(v, a, step))).tolist()
    last = len(table) - 1

    def at(time: float) -> tuple[float, float]:
        place = time / step
        k = min(int(place), last)
        u = place - k
        z0, z1, z2, z3, v0, v1, v2, v3 = table[k]
        return ((z3 * u + z2) * u + z1) * u + z0, ((v3 * u + v2) * u + v1) * u + v0

    return at


def _cubic(value: FloatArray, rate: FloatArray, step: float) -> FloatArray:
    """Return the coefficients of 1, u, u^2, u^3 in every interval (n - 1, 4), u from 0 to 1."""
    rise = np.diff(value)
    before, after = step * rate[:-1], step * rate[1:]
    return np.column_stack(
        (value[:-1], before, 3.0 * rise - 2.0 * before - after, before + after - 2.0 * rise)
    )
