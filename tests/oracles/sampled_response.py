"""Answer of a sampled loop to a sine of the hook or of the reference, exact at the samples."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import scipy.linalg

from models.basics import ComplexArray, FloatArray
from models.case import Case
from models.plant import MEASUREMENTS
from models.sensing import HEARD
from synth.structures import SampledLoop
from synth.structures.sampling import WINCH

HOOK = ("hook.heave", "hook.heave_rate")
REFERENCE = ("reference.displacement", "reference.velocity", "reference.acceleration")


def sampled_response(
    case: Case,
    loop: SampledLoop,
    outputs: Sequence[str],
    omega: npt.ArrayLike,
    *,
    source: str = "hook.heave",
) -> dict[str, ComplexArray]:
    """Return outputs at the samples per unit of a sine, (k,) each, by name.

    Parameters
    ----------
    case
        For its motion reference unit.
    loop
        The loop of a controller on its plant.
    outputs
        Performance outputs of the plant by name.
    omega
        Angular frequencies, (k,) [rad/s].
    source
        ``hook.heave`` or ``reference.displacement``; its rates follow of themselves.
    """
    rows = [loop.plant.outputs.index(name) for name in outputs]
    points = np.asarray(omega, dtype=np.float64).reshape(-1)
    found = np.array([_answer(case, loop, source, rows, 1j * w) for w in points])
    return {name: found[:, i] for i, name in enumerate(outputs)}


def _answer(
    case: Case, loop: SampledLoop, source: str, rows: list[int], s: complex
) -> ComplexArray:
    """Solve e^{sT} v = matrix v + what the sine e^{st} puts in during one sample."""
    p, w, c, T = loop.plant, loop.world, loop.controller, loop.sample_time
    of_hook = source == "hook.heave"
    hook = np.array([1.0, s]) if of_hook else np.zeros(2, dtype=np.complex128)
    columns = [p.disturbances.index(name) for name in HOOK]
    measured, moved = np.zeros(len(HEARD), dtype=np.complex128), np.zeros(len(w.A), dtype=complex)
    for name in WINCH:
        if name != "rope.tension" or not math.isfinite(loop.load_cell_bandwidth):
            row = p.Fz[p.outputs.index(name), columns]
            measured[HEARD.index(name)] = row @ hook
    n = len(w.continuous)
    late = (len(w.A) - n - 1) // 3
    for i, name in enumerate(MEASUREMENTS):
        felt = p.F[p.measurements.index(name), columns] @ hook
        if late:
            moved[n + i] = felt
        else:
            measured[HEARD.index(name)] = felt
    mru = case.sensors.mru
    shown = np.exp(-s * (mru.delay if mru else 0.0))
    if mru is not None and mru.heave_filter_period:
        corner = 2.0 * math.pi / mru.heave_filter_period
        shown *= s**2 / (s**2 + math.sqrt(2.0) * corner * s + corner**2)
    for name, value in zip(("mru.heave", "mru.heave_rate"), hook, strict=True):
        measured[HEARD.index(name)] = value * shown
    if not of_hook:
        for power, name in enumerate(REFERENCE):
            measured[HEARD.index(name)] = s**power
    # The integral of exp(A (T - t)) E hook e^{st} dt, by one exponential.
    driven = np.zeros((n + 1, n + 1), dtype=np.complex128)
    driven[:n, :n], driven[:n, n], driven[n, n] = w.continuous, _shaken(loop) @ hook, s
    moved += w.B[:, 0] * (c.on_measured @ measured)
    moved[:n] += scipy.linalg.expm(driven * T)[:n, n]
    into = np.concatenate([moved, c.into_measured @ measured])
    state = np.linalg.solve(np.exp(s * T) * np.eye(into.size) - loop.matrix, into)
    x, last_command = state[: len(p.A)], state[len(w.A) - 1]
    result = p.Cz[rows] @ x + p.Dz[rows, 0] * last_command + p.Fz[np.ix_(rows, columns)] @ hook
    return np.asarray(result, dtype=np.complex128)


def _shaken(loop: SampledLoop) -> FloatArray:
    """Return what the hook's heave and heave rate do to the states, the load cell's with them."""
    p, cell = loop.plant, loop.load_cell_bandwidth
    columns = [p.disturbances.index(name) for name in HOOK]
    if not math.isfinite(cell):
        return np.asarray(p.E[:, columns])
    tension = p.outputs.index("rope.tension")
    return np.vstack([p.E[:, columns], cell * p.Fz[np.ix_([tension], columns)]])
