"""Cases and weights that the tests of predictive control share."""

from __future__ import annotations

import math
from functools import lru_cache

from former_cases import load_case

from models import Case
from mpc.linear import LinearMPC
from mpc.winch import ProcessNoise, Weights

#: White noise of 1 % of the heave's rms sampled at 4 Hz (`docs/structures.md`).
NOISY_UNIT = {"noise_floor": 0.0, "noise_fraction": 0.01, "noise_bandwidth": 11.31}
WEIGHTS = {
    "thesis-1975": Weights(
        torque=0.03, noise=ProcessNoise(force=0.06, torque=0.01, rope=0.5, sensors=2e-4)
    ),
    "thesis-1975-rope": Weights(
        torque=0.03, noise=ProcessNoise(force=0.03, torque=0.02, rope=0.5, sensors=5e-3)
    ),
    "subsea-crane": Weights(
        torque=0.03, noise=ProcessNoise(force=0.06, torque=0.02, rope=0.7, sensors=3e-4)
    ),
}


@lru_cache
def case_of(name: str, height: float | None = None, delay: float | None = None) -> Case:
    changes: dict[str, object] = {}
    if name.startswith("thesis"):
        changes["sensors.mru"] = NOISY_UNIT
    if height is not None:
        changes["sea.significant_height"] = height
    if delay is not None:
        changes["sensors.telemetry.delay"] = delay
    return load_case(name).replace(changes)


def controller_of(name: str, height: float | None = None, **options: object) -> LinearMPC:
    options = {"weights": WEIGHTS[name], **options}
    return LinearMPC(case_of(name, height), **options)  # type: ignore[arg-type]


def off(case: Case, inertia: float = 1.0, torque: float = 1.0) -> Case:
    """A case whose motor is another; a DC motor's current goes with its torque."""
    winch = case.winch
    return case.replace(
        {
            "winch.motor.inertia": inertia * winch.motor.inertia,
            "winch.gearbox.inertia": inertia * winch.gearbox.inertia,
            "winch.drive.torque_peak": torque * winch.drive.torque_peak,
            "winch.drive.current_peak": torque * (winch.drive.current_peak or math.nan),
        }
    )
