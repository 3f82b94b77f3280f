"""Scenarios in open water: holding, engaging, moving the set-point, and what fails meanwhile.

Recipes of the library in `models.operation.scenarios`; those with a seabed, a deck or the surface
are in `models.operation.contact_scenarios`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from ..case import Case
from ..casefile import Quantity
from .options import (
    Option,
    ScenarioRecipe,
    Values,
    WordOption,
    acceleration_option,
    begin,
    duration_after,
    length_option,
    lowering_speed,
    move,
    rope_left,
    speed_option,
    time_option,
)
from .profile import Profile

_AFTER = 240.0  # [s] in which a failure's consequences are seen


def _hold(case: Case, values: Values) -> dict[str, Any]:
    del case
    return {"duration": begin(values) + 1200.0, "settle": begin(values) + 60.0}


def _engage(case: Case, values: Values) -> dict[str, Any]:
    del case
    end = begin(values) + values["hold"]
    return {"duration": end + values["ramp"] + 60.0, "disengage_at": end}


def _lower(case: Case, values: Values) -> dict[str, Any]:
    del case
    profile = Profile(moves=(move(values, begin(values), -values["distance"]),))
    return {"duration": duration_after(profile), "profile": profile}


def _steps(case: Case, values: Values) -> dict[str, Any]:
    del case
    moves = tuple(
        move(
            values,
            begin(values) + i * values["interval"],
            values["size"] if i % 2 == 0 else -values["size"],
        )
        for i in range(round(values["count"]))
    )
    profile = Profile(moves=moves)
    return {"duration": duration_after(profile, values["interval"]), "profile": profile}


def _brake_trip(case: Case, values: Values) -> dict[str, Any]:
    del case
    period = _failure(values)
    return {"duration": period[1] + _AFTER, "brake_trips": (period,)}


def _sensor_loss(case: Case, values: Values) -> dict[str, Any]:
    del case
    period = _failure(values)
    which = {"telemetry": "telemetry_outages", "sensor": "sensor_failures", "mru": "mru_outages"}
    return {"duration": period[1] + _AFTER, which[values["lost"]]: (period,)}


def _power_limit(case: Case, values: Values) -> dict[str, Any]:
    power, changes = case.winch.power_limit, {}
    if math.isinf(power):
        # A drive without a limit of its power gets one that it cannot reach, to be lowered.
        power = case.winch.drive.torque_peak * case.winch.speed_limit
        changes = {"winch.drive.power": power}
    low, high = _failure(values)
    return {
        "duration": high + _AFTER,
        "parameter_changes": {
            low: {"drive.power_limit": values["power"] * power},
            high: {"drive.power_limit": None},
        },
        "case_changes": changes,
    }


def _failure(values: Values) -> tuple[float, float]:
    return begin(values), begin(values) + values["lasting"]


def _lasting(default: float, text: str) -> Option:
    quantity = Quantity("time", 0.0, 1e6, open_low=True)
    return Option(quantity=quantity, default=default, text=text)


_SET_POINT: Mapping[str, Option] = {
    "speed": speed_option(lowering_speed),
    "acceleration": acceleration_option(0.1),
    "wait": time_option(60.0, "time at rest before it, with the controller engaged"),
}
_WAIT = time_option(120.0, "time before it")

STATION_SCENARIOS: Mapping[str, ScenarioRecipe] = {
    "hold": ScenarioRecipe(
        description="hold station, the controller engaged from the start",
        build=_hold,
        options={},
    ),
    "engage": ScenarioRecipe(
        description="warm up with the brake on, engage, hold, disengage",
        build=_engage,
        options={"hold": time_option(300.0, "time from engaged to disengaging")},
        warm_up=60.0,
        ramp=20.0,
    ),
    "lower": ScenarioRecipe(
        description="lower the payload at constant speed",
        build=_lower,
        options={
            "distance": length_option(lambda case: min(20.0, 0.5 * rope_left(case)), "how far"),
            **_SET_POINT,
        },
    ),
    "steps": ScenarioRecipe(
        description="raise and lower the payload in steps",
        build=_steps,
        options={
            "size": length_option(0.5, "size of a step"),
            "count": Option(quantity=Quantity("count", 1, 1000), default=4, text="steps"),
            "interval": time_option(60.0, "time from step to step"),
            **_SET_POINT,
        },
    ),
    "brake-trip": ScenarioRecipe(
        description="the brake trips, and opens again",
        build=_brake_trip,
        options={"lasting": _lasting(30.0, "how long the brake is on"), "wait": _WAIT},
        ramp=10.0,
    ),
    "sensor-loss": ScenarioRecipe(
        description="the link from the payload, its sensor or the motion reference unit is lost",
        build=_sensor_loss,
        options={
            "lost": WordOption(words=("telemetry", "sensor", "mru"), text="what is lost"),
            "lasting": _lasting(10.0, "how long"),
            "wait": _WAIT,
        },
    ),
    "power-limit": ScenarioRecipe(
        description="the vessel has little power for the winch for a while",
        build=_power_limit,
        options={
            "power": Option(
                quantity=Quantity("ratio", 0.0, 1.0, open_low=True),
                default=0.5,
                text="share of the drive's power that is left",
            ),
            "lasting": _lasting(120.0, "how long"),
            "wait": _WAIT,
        },
    ),
}
