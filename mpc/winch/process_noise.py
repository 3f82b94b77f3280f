"""What a prediction model does not know of the world, as noise that its filter reckons with.

A filter that trusts a model of a lightly damped rope to the last digit is right on that rope and
unstable on one that is a little softer.  Noise on rope, load and drive, and sensors that are
trusted less than they might be, buy robustness with a little of the performance;
`mpc.winch.weights` finds how much of each.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

import numpy as np

from models.basics import FloatArray, check_range
from models.plant import MEASUREMENTS
from models.sensing import MEASURED, SensorModel

if TYPE_CHECKING:
    from .prediction import PredictionModel


# How far the constants wander in so many seconds, over `constant_scales`.
_DRIFT, _DRIFT_TIME = (0.02, 0.02, 2e-4, 0.005), 1000.0
#: What is not known of them at the beginning.
AT_FIRST = (0.3, 0.1, 0.01, 0.3)
_GRAVITY = 9.81
_SPEED_WINDOW = 0.01  # in which a drive counts an encoder's pulses [s]


@dataclass(frozen=True, kw_only=True)
class ProcessNoise:
    """Standard deviations of what the model leaves out.

    Parameters
    ----------
    force
        White force on the payload that adds up to this in a second, over the static tension.
    torque
        The same at the motor, over the peak torque.
    rope
        Change of speed of each mass along the rope in a second, over the rms speed of the hook.
    sensors
        Error at every sample of a sensor, besides what the case says of it, over the rms of the
        hook's motion (for a tension: over the static one).
    unit
        Slow error of the reference unit, of which the case says nothing, over the rms of the hook's
        motion.  A filter that holds it to be impossible takes it for a sea of thirty standard
        deviations.

    Raises
    ------
    InputError
        If one is negative, or `sensors` is not above zero.
    """

    force: float = 1e-4
    torque: float = 1e-3
    rope: float = 1e-4
    sensors: float = 1e-4
    unit: float = 0.05

    def __post_init__(self) -> None:
        for field in fields(self):
            above = field.name == "sensors"
            check_range(
                "process noise", field.name, getattr(self, field.name), low=0.0, open_low=above
            )


def with_noise(model: PredictionModel, noise: ProcessNoise) -> PredictionModel:
    """Return the model with other noise in process and sensors."""
    winch = model.winch
    n, T = winch.size, winch.sample_time
    shaken = [k for k, name in enumerate(winch.plant.states) if _is_mass(name)]
    scales = constant_scales(model)
    slow, first = model.slow, 2 + len(scales) + len(shaken)
    columns = np.zeros((model.size, first + slow.shape[1]))
    # An independent error over every sample that adds up to the given rms in a second.
    unknown = scales[:2] * [noise.force, noise.torque] / math.sqrt(T)
    columns[:n, :2] = winch.from_constants * unknown
    drift = np.array(_DRIFT) * scales * math.sqrt(T / _DRIFT_TIME)
    columns[model.constants_at, 2 : 2 + len(scales)] = np.diag(drift)
    kick = noise.rope * model.waves[1] * math.sqrt(T)
    columns[shaken, 2 + len(scales) + np.arange(len(shaken))] = kick
    # The slow error of the unit is next to the constants.
    columns[model.constants_at.start - 2 : model.constants_at.start, first:] = (
        noise.unit * model.waves[0] * slow
    )
    return replace(
        model,
        G=np.hstack([model.G[:, : model.known], columns]),
        R=_variances(model, noise.sensors),
    )


def constant_scales(model: PredictionModel) -> FloatArray:
    """Return what the constants are measured by: weight, peak torque, gravity, weight, (4,)."""
    weight = model.winch.rest_tension
    return np.array([weight, model.winch.case.winch.drive.torque_peak, _GRAVITY, weight])


def _is_mass(name: str) -> bool:
    """Return whether a state is the velocity of a mass along the rope, the payload's included."""
    return name.endswith(".velocity") and name.split(".")[0] in ("rope", "payload")


def _variances(model: PredictionModel, share: float) -> FloatArray:
    """Return the variances of the white errors, (ny,)."""
    case, T = model.winch.case, model.winch.sample_time
    sensors = SensorModel.from_case(case, T)
    heave, rate, acceleration = model.waves
    sizes = {
        "payload.acceleration": acceleration,
        "payload.velocity": rate,
        "payload.displacement": heave,
        "mru.heave": heave,
        "mru.heave_rate": rate,
        "drum.haul": heave,
        "motor.speed": rate / sensors.haul_per_angle,
        "rope.tension": case.static_tension,
    }
    rms = {name: share * size for name, size in sizes.items()}
    for name in MEASUREMENTS:
        own = name.removeprefix("payload.")
        step = float(getattr(sensors.payload, f"{own}_resolution"))
        rms[name] = math.hypot(rms[name], sensors.noise_rms(own), step / math.sqrt(12.0))
    if case.sensors.encoder is not None:
        count = 2.0 * math.pi / case.sensors.encoder.counts_per_turn / math.sqrt(12.0)
        rms["drum.haul"] = math.hypot(rms["drum.haul"], sensors.haul_per_angle * count)
        rms["motor.speed"] = math.hypot(rms["motor.speed"], count / _SPEED_WINDOW)
    if case.sensors.load_cell is not None:
        noise = case.sensors.load_cell.noise_fraction * case.static_tension
        rms["rope.tension"] = math.hypot(rms["rope.tension"], noise)
    return np.array([rms[name] ** 2 for name in MEASURED])
