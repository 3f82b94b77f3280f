"""Faults in mid-run by name, with their ranges, and scenarios with faults in them.

    names and sizes (a row of a spread) --> with_faults --> Scenario --> simulation

A fault has a path like a field of the case (``fault.delay_step``), so that it can be varied, drawn
and named like one.  What is wrong during the whole run is a field of the case itself: the share
of lost messages is ``sensors.telemetry.dropout``, the bias of a payload sensor
``sensors.payload.displacement_bias``.
"""

import math
from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from ..basics import InputError, check_range
from ..case import Case
from ..casefile import Quantity, suggestion
from ..plant import DriveLimits
from .scenario import Scenario

PREFIX = "fault."  #: What the path of a fault begins with.


@dataclass(frozen=True)
class FaultField(Quantity):
    """One number of a fault, of a kind and in a range."""

    _: KW_ONLY
    nominal: float = 0.0  #: Its value where nothing is said: none of the faults, or the usual time.
    text: str  #: What it is.


_LONG = 86400.0
_SPIKES, _SPIKE = 2.0, 0.05  # from one spike to the next, and how long one lasts [s]

FAULTS: Mapping[str, FaultField] = MappingProxyType(
    {
        "at": FaultField("time", 0.0, _LONG, nominal=120.0, text="when the faults begin"),
        "lasting": FaultField(
            "time", 0.0, _LONG, nominal=60.0, text="how long steps, biases and cuts last"
        ),
        "telemetry_outage": FaultField("time", 0.0, _LONG, text="how long no message comes"),
        "sensor_outage": FaultField(
            "time", 0.0, _LONG, text="how long the payload's sensor gives no numbers"
        ),
        "stuck_readings": FaultField(
            "time", 0.0, _LONG, text="how long the payload's sensors show the same number"
        ),
        "mru_outage": FaultField(
            "time", 0.0, _LONG, text="how long the motion reference unit gives no numbers"
        ),
        "encoder_outage": FaultField(
            "time", 0.0, _LONG, text="how long the drum's encoder gives no numbers"
        ),
        "load_cell_outage": FaultField(
            "time", 0.0, _LONG, text="how long the load cell gives no numbers"
        ),
        "brake_trip": FaultField("time", 0.0, _LONG, text="how long the brake is on"),
        "delay_step": FaultField("time", 0.0, 60.0, text="by how much the messages are later"),
        "mru_heave_bias": FaultField(
            "length", -100.0, 100.0, text="how much the heave shows too much"
        ),
        "mru_rate_bias": FaultField(
            "speed", -100.0, 100.0, text="how much the heave rate shows too much"
        ),
        "mru_spike": FaultField(
            "length", -100.0, 100.0, text="how much the heave is off for 0.05 s of every 2 s"
        ),
        "torque_limit": FaultField(
            "ratio",
            1e-3,
            1.0,
            nominal=1.0,
            text="share of the drive's torque and current that is left",
        ),
        "power_limit": FaultField(
            "ratio", 1e-3, 1.0, nominal=1.0, text="share of the drive's power that is left"
        ),
    }
)
"""Every fault by its name, without the prefix."""

_PERIODS = {
    "telemetry_outage": "telemetry_outages",
    "sensor_outage": "sensor_failures",
    "stuck_readings": "stuck_readings",
    "mru_outage": "mru_outages",
    "encoder_outage": "encoder_outages",
    "load_cell_outage": "load_cell_outages",
    "brake_trip": "brake_trips",
}


def fault_of(path: str) -> FaultField:
    """Return the fault that a path such as ``fault.delay_step`` means.

    Raises InputError if there is none of that name.
    """
    name = path.removeprefix(PREFIX)
    if not path.startswith(PREFIX) or name not in FAULTS:
        raise InputError(f"{path} is unknown; {suggestion(name, list(FAULTS))}")
    return FAULTS[name]


def with_faults(
    scenario: Scenario, faults: Mapping[str, float], case: Case, duration: float
) -> Scenario:
    """Return a scenario in which something fails, within the duration of the run [s].

    Faults are sizes by path (``fault.delay_step``); a size that is no fault changes nothing.  The
    drive's limits are those of the case that is simulated.

    Raises InputError if a path is unknown, a size out of its range, or the faults begin after the
    run.

    Examples
    --------
    >>> from models import load_case
    >>> from models.operation.scenarios import scenario_named
    >>> case = load_case("thesis-1975")
    >>> found = with_faults(
    ...     scenario_named("hold", case), {"fault.delay_step": 0.1, "fault.at": 30.0}, case, 120.0)
    >>> found.telemetry_delays
    ((30.0, 90.0, 0.1),)
    """
    if not faults:
        return scenario
    size = {name: field.nominal for name, field in FAULTS.items()}
    for path, value in faults.items():
        field = fault_of(path)
        size[path.removeprefix(PREFIX)] = check_range(
            "faults", path, value, low=field.low, high=field.high
        )
    at, until = size["at"], size["at"] + size["lasting"]
    if at >= duration:
        raise InputError(
            f"faults: fault.at must be before the end of the run, {duration:g} s, got {at:g} s"
        )
    changes: dict[str, Any] = {}
    for name, periods in _PERIODS.items():
        if size[name] > 0.0:
            changes[periods] = (*getattr(scenario, periods), (at, at + size[name]))
    if until > at:
        if size["delay_step"] > 0.0:
            late = (at, until, size["delay_step"])
            changes["telemetry_delays"] = (*scenario.telemetry_delays, late)
        if size["mru_heave_bias"] or size["mru_rate_bias"]:
            bias = (at, until, size["mru_heave_bias"], size["mru_rate_bias"])
            changes["mru_biases"] = (*scenario.mru_biases, bias)
        if size["mru_spike"]:
            spikes = [
                (time, time + _SPIKE, size["mru_spike"], 0.0)
                for time in np.arange(at, until, _SPIKES).tolist()
            ]
            changes["mru_biases"] = (*changes.get("mru_biases", scenario.mru_biases), *spikes)
        changes |= _limits(scenario, size, case, at, until)
    return replace(scenario, **changes) if changes else scenario


def _limits(
    scenario: Scenario, size: Mapping[str, float], case: Case, at: float, until: float
) -> dict[str, Any]:
    """Return the changes of a scenario in which the drive's limits are cut for a while."""
    cut: dict[str, float] = {}
    own = DriveLimits.from_case(scenario.case_for(case)).parameters
    changed: dict[str, Any] = dict(scenario.case_changes)
    if size["torque_limit"] < 1.0:
        for name in ("drive.torque_limit", "drive.current_limit"):
            if name in own:
                cut[name] = size["torque_limit"] * own[name]
    if size["power_limit"] < 1.0:
        power, given = limited_power(case)
        changed |= given
        cut["drive.power_limit"] = size["power_limit"] * power
    if not cut:
        return {}
    planned = scenario.parameter_changes
    back: dict[str, float | None] = dict.fromkeys(cut, None)
    return {
        "parameter_changes": {
            **planned,
            at: {**planned.get(at, {}), **cut},
            until: {**planned.get(until, {}), **back},
        },
        "case_changes": changed,
    }


def limited_power(case: Case) -> tuple[float, dict[str, float]]:
    """Return the drive's power limit [W], and the changes of a case that give it one.

    A drive without a limit gets one that it cannot reach, to be lowered.
    """
    power = case.winch.power_limit
    if not math.isinf(power):
        return power, {}
    power = case.winch.drive.torque_peak * case.winch.speed_limit
    return power, {"winch.drive.power": power}
