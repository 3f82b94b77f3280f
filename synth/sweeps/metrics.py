"""Metrics of a sweep: names, units, and the outputs of the plant that they need."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from models.basics import FloatArray, InputError
from models.casefile import suggestion

from ..limits import LOWER_TENSION
from .design_rows import SolvedRows

DEFAULT = ("payload_rms", "residual", "torque_rms", "speed_rms", "max_sensitivity")


@dataclass(frozen=True, kw_only=True)
class FrequencyMetric:
    """One number of a case."""

    #: For the dataset.
    name: str
    unit: str
    long_name: str
    output: str = ""  #: The plant's output it is about, if any.
    #: ``rms``, ``residual`` (over the hook's rms), ``peak`` (largest in the exposure time, from
    #: rest, with losses), ``least``, ``period`` (mean zero-crossing), ``loop`` or ``static``.
    kind: str = "rms"


# name, unit, output, kind, words
_ROWS = (
    ("payload_rms", "m", "payload.displacement", "rms",
     "standard deviation of the payload's motion"),
    ("residual", "1", "payload.displacement", "residual",
     "standard deviation of the payload's motion over that of the hook's"),
    ("velocity_rms", "m/s", "payload.velocity", "rms",
     "standard deviation of the payload's velocity"),
    ("torque_rms", "N m", "motor.torque", "rms",
     "standard deviation of the motor's torque, without the switching loss"),
    ("speed_rms", "rad/s", "motor.speed", "rms", "standard deviation of the motor's speed"),
    ("haul_rms", "m", "drum.haul", "rms", "standard deviation of the drum's haul"),
    ("tension_rms", "N", "rope.tension", "rms",
     "standard deviation of the rope's tension at the drum"),
    ("current_rms", "", "motor.current", "rms",
     "standard deviation of the motor's current (of an AC motor: its torque)"),
    ("command_rms", "", "drive.command", "rms", "standard deviation of the drive's command"),
    ("voltage_rms", "V", "motor.voltage", "rms", "standard deviation of the armature's voltage"),
    ("torque_peak", "N m", "motor.torque", "peak",
     "largest torque in the exposure time, static torque and losses included"),
    ("speed_peak", "rad/s", "motor.speed", "peak",
     "largest speed of the motor in the exposure time"),
    ("tension_peak", "N", "rope.tension", "peak",
     "largest tension at the drum in the exposure time"),
    ("tension_least", "N", "rope.tension", "least",
     "smallest tension at the drum in the exposure time"),
    ("lower_tension_rms", "N", LOWER_TENSION, "rms",
     "standard deviation of the rope's tension at the payload"),
    ("lower_tension_least", "N", LOWER_TENSION, "least",
     "smallest tension at the payload, of its least weight, in the exposure time"),
    ("payload_period", "s", "payload.displacement", "period",
     "mean zero-crossing period of the payload's motion"),
    ("max_sensitivity", "1", "", "loop", "largest sensitivity M_s of the loop"),
    ("drag", "N s/m", "", "static", "linear drag coefficient that agrees with the response"),
    ("static_torque", "N m", "", "static",
     "motor torque that hauls the load at rest, losses of gear and friction included"),
    ("static_tension", "N", "", "static", "rope tension at the drum at rest"),
)  # fmt: skip

METRICS: Mapping[str, FrequencyMetric] = {
    name: FrequencyMetric(name=name, unit=unit, output=output, kind=kind, long_name=words)
    for name, unit, output, kind, words in _ROWS
}
"""Every metric by its name; `stable` is always there."""


def chosen_metrics(names: Sequence[str] | None, *, dc: bool) -> tuple[FrequencyMetric, ...]:
    """Return the metrics of a sweep.

    Raises InputError if a name is unknown, or the motor has none of it.
    """
    wanted = DEFAULT if names is None else tuple(dict.fromkeys(n for n in names if n != "stable"))
    for name in wanted:
        if name not in METRICS:
            raise InputError(f"sweep: metric {name!r} is unknown; {suggestion(name, [*METRICS])}")
        if name == "voltage_rms" and not dc:
            raise InputError("sweep: voltage_rms is of a DC motor; an AC motor has command_rms")
    return tuple(METRICS[name] for name in wanted)


def finished(
    metrics: Sequence[FrequencyMetric], loops: SolvedRows, exposure: float
) -> dict[str, FloatArray]:
    """Return metrics of loops, (n,) each; NaN where a loop is unstable.

    Most probable extremes are those of the exposure [s], `Limits.equivalent_exposure`.
    """
    alone: dict[str, Callable[[], Any]] = {
        "max_sensitivity": lambda: loops.peak,
        "drag": lambda: loops.drag,
        "static_torque": lambda: sum(side["motor.torque"] for side in loops.holding),
        "static_tension": lambda: loops.holding[0]["rope.tension"],
    }
    found = {}
    for metric in metrics:
        if not metric.output:
            value = alone[metric.name]()
        elif metric.kind == "period":
            value = loops.period(metric.output)
        else:
            value = loops.sigma(metric.output)
        if metric.kind == "residual":
            value = value / loops.heave
        if metric.kind in ("peak", "least"):
            rest, loss = (side.get(metric.output, np.zeros(1)) for side in loops.holding)
            # The most probable maximum of a Gaussian signal (Rice 1945), as
            # `models.basics.metrics`.
            with np.errstate(all="ignore"):
                each = [
                    np.sqrt(2.0 * np.log(np.maximum(_cycles(both, exposure), np.exp(0.5))))
                    * np.sqrt(both[:, 0])
                    for both in loops.signed(metric.output)
                ]
            reach = np.max(each, axis=0) + loss
            value = rest - reach
            if metric.kind == "peak":
                value = np.abs(rest) + reach
        found[metric.name] = np.where(loops.stable, value, np.nan)
    return found


def _cycles(both: FloatArray, exposure: float) -> FloatArray:
    """Return how often a signal swings in a time [s], from variances (n, 2)."""
    return np.asarray(exposure / (2.0 * np.pi) * np.sqrt(both[:, 1] / both[:, 0]))
