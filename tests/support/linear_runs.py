"""A controller on a linear plant, stepped in time: RK4 between samples, `step` at each."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from models import Case
from models.plant import MEAN_LOSSES, build_plant
from models.sensing import Controller, Measurement

FloatArray = npt.NDArray[np.float64]
Motion = Callable[[float], tuple[float, float]]

PAYLOAD = ("payload.acceleration", "payload.velocity", "payload.displacement")
WINCH = ("drum.haul", "motor.speed", "motor.torque", "rope.tension")


def still(time: float) -> tuple[float, float]:
    """A hook that does not move."""
    del time
    return 0.0, 0.0


def swell(omega: float, amplitude: float = 1.0) -> Motion:
    """A hook that heaves as a sine."""
    return lambda t: (
        amplitude * math.sin(omega * t),
        amplitude * omega * math.cos(omega * t),
    )


def linear_run(
    case: Case,
    controller: Controller,
    heave: Motion,
    *,
    duration: float,
    drag: float,
    reference: Motion = still,
    limits: tuple[float, float] = (-math.inf, math.inf),
    mru_valid: Callable[[float], bool] = lambda t: True,
    start: dict[str, float] | None = None,
    substeps: int = 8,
) -> dict[str, FloatArray]:
    """Return outputs, command and time at the samples; `limits` cut the command's deviation.

    The MRU is late but has no heave filter.
    """
    plant = build_plant(case)
    lin, rest = plant.linearise(drag=drag), plant.operating_point(MEAN_LOSSES)
    T = controller.sample_time
    h, n = T / substeps, len(lin.states)
    cell = case.sensors.load_cell.bandwidth if case.sensors.load_cell else math.inf
    mru_delay = case.sensors.mru.delay if case.sensors.mru else 0.0
    late = math.ceil(max(lin.delays) / T - 1e-9)
    hook = [lin.disturbances.index(name) for name in ("hook.heave", "hook.heave_rate")]
    row = {name: lin.outputs.index(name) for name in lin.outputs}
    tension = row["rope.tension"]
    x = np.zeros(n + 1)  # the last one is what the load cell shows
    for name, value in (start or {}).items():
        x[lin.states.index(name)] = value
    u, held, shown = 0.0, (0.0, 0.0), [np.zeros(3)] * late
    static = {"motor.torque": rest.torque, "rope.tension": rest.tension}

    # The load cell is one state more; then RK4 of a linear system, all at once: what it makes of
    # the state and of the forces at the step's beginning, middle and end.
    A, E = np.zeros((n + 1, n + 1)), np.zeros((n + 1, 2))
    B = np.append(lin.B[:, 0], cell * lin.Dz[tension, 0] if math.isfinite(cell) else 0.0)
    A[:n, :n], E[:n] = lin.A, lin.E[:, hook]
    if math.isfinite(cell):
        A[n, :n], A[n, n], E[n] = cell * lin.Cz[tension], -cell, cell * lin.Fz[tension, hook]

    def rk4(x: FloatArray, first: FloatArray, middle: FloatArray, last: FloatArray) -> FloatArray:
        k1 = A @ x + first
        k2 = A @ (x + h / 2 * k1) + middle
        k3 = A @ (x + h / 2 * k2) + middle
        k4 = A @ (x + h * k3) + last
        return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    one, none = np.eye(n + 1), np.zeros((n + 1, n + 1))
    parts = [rk4(none, *(one if i == j else none for j in range(3))) for i in range(3)]
    advance = np.column_stack(
        [rk4(one, none, none, none), *(part @ E for part in parts), sum(parts) @ B]
    )

    controller.reset()
    found: dict[str, list[float]] = {name: [] for name in (*lin.outputs, "command", "time")}
    for k in range(round(duration / T)):
        t = k * T
        w = np.array(heave(t))
        z = lin.Cz @ x[:n] + lin.Dz[:, 0] * u + lin.Fz[:, hook] @ w
        y = lin.C @ x[:n] + lin.D[:, 0] * u + lin.F[:, hook] @ w
        shown.append(y)
        valid = mru_valid(t)
        held = heave(t - mru_delay) if valid else held
        seen = dict(zip(PAYLOAD, shown.pop(0), strict=True))
        seen |= {name: z[row[name]] + static.get(name, 0.0) for name in WINCH}
        if math.isfinite(cell):
            seen["rope.tension"] = x[n] + rest.tension
        place, speed = reference(t)
        seen |= {
            "payload.valid": 1.0,
            "payload.age": late * T,
            "mru.heave": held[0],
            "mru.heave_rate": held[1],
            "mru.valid": float(valid),
            "drive.applied": rest.command + u,
            "reference.displacement": place,
            "reference.velocity": speed,
        }
        for name in lin.outputs:
            found[name].append(z[row[name]])
        found["time"].append(t)
        asked = controller.step(Measurement.of(seen), t) - rest.command
        found["command"].append(asked)
        u = min(max(asked, limits[0]), limits[1])
        for j in range(substeps):
            at = t + j * h
            x = advance @ np.array([*x, *heave(at), *heave(at + h / 2), *heave(at + h), u])
    return {name: np.array(values) for name, values in found.items()}


def sine_part(time: FloatArray, values: FloatArray, omega: float) -> complex:
    """Return c of Im(c e^{i omega t}), by least squares beside a constant."""
    columns = [np.sin(omega * time), np.cos(omega * time), np.ones_like(time)]
    (of_sine, of_cosine, _), *_ = np.linalg.lstsq(np.stack(columns, axis=1), values, rcond=None)
    return complex(of_sine, of_cosine)
