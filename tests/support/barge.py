"""A barge whose six motions are closed formulas, for tests of what is made of RAOs.

Froude-Krylov averages of the wave over the waterplane, with a resonance in roll: not a real vessel,
but complex, smooth, with roll that leads and lags, and right in long waves.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from former_cases import load_case

from models import Case
from models.basics import wave_number
from models.vessel import VesselRaos
from models.vessel.readers import write_raos

LENGTH, BEAM = 80.0, 18.0
ROLL, DAMPING = 0.62, 0.08  # natural frequency [rad/s], share of the critical damping


def motions(omega: np.ndarray, heading: np.ndarray) -> np.ndarray:
    """Six motions (..., 6) of the barge about amidships, for omega and heading broadcast."""
    omega, heading = np.broadcast_arrays(omega, heading)
    k = wave_number(omega)
    kx, ky = k * np.cos(heading), k * np.sin(heading)
    along, across = np.sinc(kx * LENGTH / (2 * math.pi)), np.sinc(ky * BEAM / (2 * math.pi))
    mean = along * across
    r = omega / ROLL
    resonance = 1.0 / (1.0 - r**2 + 2j * DAMPING * r)
    return np.stack(
        [
            -1j * np.cos(heading) * mean,
            -1j * np.sin(heading) * mean,
            mean * np.exp(-0.3j * omega**2),
            -1j * ky * across * resonance,
            1j * kx * along * np.exp(-0.4j * omega**2),
            0.0 * mean,
        ],
        axis=-1,
    )


def barge(rows: int = 61, headings: int = 24) -> VesselRaos:
    omega = np.linspace(0.15, 2.0, rows)
    heading = 2.0 * math.pi * np.arange(headings) / headings
    return VesselRaos(
        name="barge", omega=omega, heading=heading, values=motions(omega[:, None], heading)
    )


def barge_file(folder: Path, headings: int = 24) -> Path:
    return write_raos(folder / "barge.csv", barge(headings=headings))


def barge_case(folder: Path, *, headings: int = 24, **changes: Any) -> Case:
    """The bundled crane on the barge: over port aft, waves from starboard ahead."""
    vessel = {
        "raos": str(barge_file(folder, headings)),
        "hook": {"x": -25.0, "y": 14.0, "z": 20.0},
        "heading": math.radians(150.0),
    }
    vessel |= {key.removeprefix("vessel_"): v for key, v in changes.items() if "vessel_" in key}
    other = {key: value for key, value in changes.items() if "vessel_" not in key}
    wanted = {f"vessel.{key}": value for key, value in vessel.items()}
    wanted["winch.motor.kind"] = "induction"  # stated, or who loads its file is told
    return load_case("subsea-crane").replace(
        wanted | {k.replace("__", "."): v for k, v in other.items()}
    )
