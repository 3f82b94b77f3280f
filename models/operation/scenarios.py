"""The library of operations by name, with figures that fit the case.

`scenario_named("landing", case, height="5 m")` gives a `Scenario`.  Each has options with a unit, a
range and a default that follows from the case: speeds from what the winch can do, waves and a
supply boat's motion from its sea, slack from their height.  The recipes in open water are here:
holding, engaging, moving the set-point, and what fails meanwhile; those with a seabed, a deck or
the surface are in `models.operation.contact_scenarios`.
"""

import math
from collections.abc import Mapping
from typing import Any

from ..basics import InputError
from ..case import Case
from ..casefile import Quantity, suggestion
from .contact_scenarios import CONTACT_SCENARIOS
from .faults import limited_power
from .options import (
    Option,
    ScenarioRecipe,
    Values,
    WordOption,
    begin,
    length_option,
    lowering_speed,
    move,
    moving,
    rope_left,
    set_point_options,
    time_option,
)
from .scenario import Scenario

_AFTER = 240.0  # [s] in which a failure's consequences are seen


def _hold(case: Case, values: Values) -> dict[str, Any]:
    on, off, reset = (values[name] for name in ("engage", "disengage", "reset"))
    begun = begin(values) + on
    found = {"duration": begun + 1200.0, "settle": begun + 60.0}
    if on > 0.0 or off < math.inf or reset < math.inf:
        found |= {"enabled": ((on, off),), "rate": lowering_speed(case)}
        found["resets"] = (reset,) if reset < math.inf else ()
    if off < math.inf:
        found["duration"] = off + values["ramp"] + 60.0
    return found


def _engage(_: Case, values: Values) -> dict[str, Any]:
    end = begin(values) + values["hold"]
    return {"duration": end + values["ramp"] + 60.0, "disengage_at": end}


def _lower(_: Case, values: Values) -> dict[str, Any]:
    return moving(move(values, -values["distance"]))


def _steps(_: Case, values: Values) -> dict[str, Any]:
    interval, size = values["interval"], values["size"]
    moves = (
        move(values, -size if i % 2 else size, start=begin(values) + i * interval)
        for i in range(round(values["count"]))
    )
    return moving(*moves, tail=interval)


def _brake_trip(_: Case, values: Values) -> dict[str, Any]:
    begun, (at, until) = begin(values) - values["wait"], _failure(values)
    worst = values["moment"] == "worst" and values["wait"] > 0.0
    return {
        "duration": until + _AFTER,
        "brake_trips": () if worst else ((at, until),),
        "worst_trip": (begun, at, until - at) if worst else None,
    }


def _sensor_loss(_: Case, values: Values) -> dict[str, Any]:
    period = _failure(values)
    which = {
        "telemetry": "telemetry_outages",
        "sensor": "sensor_failures",
        "stuck": "stuck_readings",
        "mru": "mru_outages",
        "encoder": "encoder_outages",
        "load-cell": "load_cell_outages",
    }
    return {"duration": period[1] + _AFTER, which[values["lost"]]: (period,)}


def _power_limit(case: Case, values: Values) -> dict[str, Any]:
    power, changes = limited_power(case)
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


_WAIT = time_option(120.0, "time before it")

_RECIPES: Mapping[str, ScenarioRecipe] = {
    "hold": ScenarioRecipe(
        description="hold station, the controller engaged from the start unless told otherwise",
        build=_hold,
        options={
            "engage": time_option(0.0, "when the operator enables the controller"),
            "disengage": time_option(math.inf, "when the operator disables it"),
            "reset": time_option(math.inf, "when the operator resets it"),
        },
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
            **set_point_options(),
        },
    ),
    "steps": ScenarioRecipe(
        description="raise and lower the payload in steps",
        build=_steps,
        options={
            "size": length_option(0.5, "size of a step"),
            "count": Option(quantity=Quantity("count", 1, 1000), default=4, text="steps"),
            "interval": time_option(60.0, "time from step to step"),
            **set_point_options(),
        },
    ),
    "brake-trip": ScenarioRecipe(
        description="the brake trips, and opens again",
        build=_brake_trip,
        options={
            "moment": WordOption(
                words=("worst", "stated"),
                text="at the drum's largest speed during the wait, or at its end",
            ),
            "lasting": _lasting(30.0, "how long the brake is on"),
            "wait": time_option(600.0, "time in which the worst moment is sought, or before it"),
        },
        ramp=10.0,
    ),
    "sensor-loss": ScenarioRecipe(
        description="link from the payload, one of the sensors lost, or the payload's stuck",
        build=_sensor_loss,
        options={
            "lost": WordOption(
                words=("telemetry", "sensor", "stuck", "mru", "encoder", "load-cell"),
                text="what is lost",
            ),
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
    **CONTACT_SCENARIOS,
}


def scenario_names() -> dict[str, str]:
    """Return a one-line description of each scenario by its name.

    Examples
    --------
    >>> print(*scenario_names(), sep=", ")
    hold, engage, lower, steps, brake-trip, sensor-loss, power-limit, landing, lift-off, set-down,
    splash
    """
    return {name: recipe.description for name, recipe in _RECIPES.items()}


def scenario_options(name: str) -> Mapping[str, Option | WordOption]:
    """Return the options of a scenario by name.

    Raises InputError if there is no such scenario.
    """
    return _recipe(name).all_options


def scenario_named(name: str, case: Case, **options: object) -> Scenario:
    """Return a scenario of the library, one of `scenario_names()`, with figures that fit a case.

    Options, of `scenario_options(name)`, are numbers in SI, or texts with a unit such as `5 m`.

    Raises InputError if there is no such scenario or option, or a value is out of range.

    Examples
    --------
    >>> from models import load_case
    >>> landing = scenario_named("landing", load_case("subsea-crane"), height="6 m")
    >>> landing.surroundings.ground.below, landing.profile.moves[0].distance
    (6.0, -1.0)
    """
    recipe = _recipe(name)
    known = recipe.all_options
    for key in options:
        if key not in known:
            raise InputError(
                f"scenario {name}: there is no option {key!r}; there are: {', '.join(known)}"
            )
    values: dict[str, Any] = {}
    for key, option in known.items():
        try:
            values[key] = option.value(options.get(key), case)
        except InputError as error:
            raise InputError(f"scenario {name}: {key} {error}") from None
    own = recipe.build(case, values)
    return Scenario(
        name=name,
        description=recipe.description,
        warm_up=values["warm_up"],
        ramp=values["ramp"],
        **{"settle": values["warm_up"] + values["ramp"], **own},
    )


def _recipe(name: str) -> ScenarioRecipe:
    if name not in _RECIPES:
        raise InputError(f"scenario: there is no {name!r}; {suggestion(name, list(_RECIPES))}")
    return _RECIPES[name]
