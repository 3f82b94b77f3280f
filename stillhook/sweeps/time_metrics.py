"""Status and metrics of one run of a sweep, with units and long names.

Run --> status_of, numbers_of --> one row of the result
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from models.basics import pick
from models.run import Run

from ..runs import TRIPS, error_of

STATUS: Mapping[str, int] = MappingProxyType(
    {
        "not run": -1,
        "completed": 0,
        "diverged": 1,
        "limit cycle": 2,
        "brake": 3,
        "failed": 4,
        "died": 5,
    }
)
"""What became of a case, and its code: ran to its end; the state was no number any more; the
payload moves more than the hook with the drive saturated; the supervisor closed the brake; there
is no such case or controller; its process was killed, twice: nothing is known, and it is tried
again when the sweep goes on."""
UNKNOWN = (STATUS["not run"], STATUS["died"])  #: Codes of cases that no share counts.

# Share of the second half of a run in which a limit cycle has its drive saturated.
_SATURATED = 0.05
_WORSE = 1.0  # of the hook's rms is the payload's error in a limit cycle


@dataclass(frozen=True, kw_only=True)
class Metric:
    """A number of a run."""

    quantity: str  #: Its name in `models.run.summary`, or a signal whose standard deviation it is.
    unit: str  #: SI unit.
    text: str  #: What it is, in a line.
    factor: float = 1.0  #: What the quantity is multiplied by.

    def of(self, run: Run) -> float:
        """Return the number of a run; NaN where it has none."""
        found = run.statistics.quantities.get(self.quantity)
        if found is not None:
            return self.factor * found.value
        signal = run.statistics.signals.get(self.quantity)
        return math.nan if signal is None else self.factor * signal.standard_deviation


def _m(quantity: str, unit: str, text: str, factor: float = 1.0) -> Metric:
    return Metric(quantity=quantity, unit=unit, text=text, factor=factor)


METRICS: Mapping[str, Metric] = MappingProxyType(
    {
        "payload_rms": _m("payload rms", "m", "standard deviation of the payload's motion"),
        "payload_significant": _m(
            "payload significant", "m", "mean of the highest third of the payload's heights"
        ),
        "payload_largest": _m("payload largest", "m", "largest displacement of the payload"),
        "error_rms": _m("tracking error rms", "m", "rms of the payload's distance from its place"),
        "hook_rms": _m("hook rms", "m", "standard deviation of the hook's heave"),
        "residual": _m("residual", "1", "payload rms over hook rms", 0.01),
        "velocity_rms": _m("payload.velocity", "m/s", "standard deviation of payload velocity"),
        "torque_rms": _m("motor.torque", "N m", "standard deviation of the motor's torque"),
        "speed_rms": _m("motor.speed", "rad/s", "standard deviation of the motor's speed"),
        "tension_rms": _m(
            "rope.tension", "N", "standard deviation of the rope's tension at the drum"
        ),
        "saturated_share": _m(
            "saturated share", "1", "share of the time with the drive saturated", 0.01
        ),
        "torque_effective": _m(
            "motor torque rms", "N m", "rms of the motor's torque, static torque included"
        ),
        "torque_largest": _m("motor torque largest", "N m", "largest motor torque"),
        "speed_largest": _m("motor speed largest", "rad/s", "largest motor speed"),
        "power_mean": _m("motor power mean", "W", "mean shaft power of the motor"),
        "power_largest": _m("motor power largest", "W", "largest shaft power of the motor"),
        "energy_per_hour": _m(
            "energy per hour, net", "J/h", "shaft energy per hour, less what comes back"
        ),
        "tension_largest": _m("rope tension largest", "N", "largest rope tension at the drum"),
        "tension_smallest": _m(
            "rope tension smallest", "N", "smallest rope tension anywhere along the rope"
        ),
        "slack_share": _m("slack share", "1", "share of the time with slack rope", 0.01),
        "slack_events": _m("slack events", "1", "how often the rope went slack"),
        "snap_load": _m("snap load", "N", "largest tension after slack rope; NaN without"),
        "lost_lock_at": _m("lost lock at", "s", "when the payload was lost; NaN if it never was"),
    }
)
"""What can be kept, by name."""


def names_of(wanted: Sequence[str] | None) -> tuple[str, ...]:
    """Return the metrics that are wanted, all of them by default.

    Raises InputError if one is unknown.
    """
    if wanted is None:
        return tuple(METRICS)
    names = tuple(dict.fromkeys([*wanted, "payload_rms"]))
    pick("sweep", "metric", tuple(METRICS), names)
    return names


def numbers_of(run: Run, names: Sequence[str]) -> dict[str, float]:
    """Return the numbers of a run; NaN of one that diverged, and of what did not happen."""
    if run.status == "diverged":
        return dict.fromkeys(names, math.nan)
    return {name: METRICS[name].of(run) for name in names}


def status_of(run: Run) -> str:
    """Return what became of a run, one of `STATUS`.

    A limit cycle is told from the second half of the run: the payload is farther from its place
    than the hook from its own, in rms, and the drive is saturated for a twentieth of the time.
    """
    if run.status == "diverged":
        return "diverged"
    if any(event.kind in TRIPS for event in run.events):
        return "brake"
    late = run.time >= 0.5 * (run.statistics.settle + run.duration)
    if "drive.saturated" not in run or not late.any():
        return "completed"
    error, hook = error_of(run)[late], run["hook.heave"][late]
    worse = math.sqrt(np.mean(error**2)) > _WORSE * float(hook.std())
    if worse and float(run["drive.saturated"][late].mean()) > _SATURATED:
        return "limit cycle"
    return "completed"
