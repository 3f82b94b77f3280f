"""The noise in process and sensors that a filter reckons with beyond what the case says.

A filter that trusts a model of a lightly damped rope to the last digit is right on that rope and
unstable on one that is a little softer.  Noise on rope, load and drive, and sensors that are
trusted less than they might be, buy robustness with a little of the performance;
`mpc.winch.weights` finds how much of each, `mpc.winch.prediction.with_noise` puts it into a model.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

from models.basics import check_range


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
