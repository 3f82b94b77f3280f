"""The library of operations by name, with figures that fit the case.

`scenario_named("landing", case, height="5 m")` gives a `Scenario`.  Each has options with a unit, a
range and a default that follows from the case: speeds from what the winch can do, waves and a
supply boat's motion from its sea, slack from their height.  The recipes themselves are in
`models.operation.station_scenarios` and `models.operation.contact_scenarios`.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Any

from ..basics import InputError
from ..case import Case
from .contact_scenarios import CONTACT_SCENARIOS
from .options import Option, ScenarioRecipe, WordOption
from .scenario import Scenario
from .station_scenarios import STATION_SCENARIOS

_RECIPES: Mapping[str, ScenarioRecipe] = {**STATION_SCENARIOS, **CONTACT_SCENARIOS}


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

    Raises
    ------
    InputError
        If there is no such scenario.
    """
    return _recipe(name).all_options


def scenario_named(name: str, case: Case, **options: object) -> Scenario:
    """Return a scenario of the library.

    Parameters
    ----------
    name
        One of `scenario_names()`.
    case
        What its default figures follow from.
    **options
        Those of `scenario_options(name)`: numbers in SI, or texts with a unit such as `5 m`.

    Raises
    ------
    InputError
        If there is no such scenario or option, or a value is out of range.

    Examples
    --------
    >>> from models import load_case
    >>> landing = scenario_named("landing", load_case("subsea-crane"), height="6 m")
    >>> landing.surroundings.seabed.below, landing.profile.moves[0].distance
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
        near = difflib.get_close_matches(name, _RECIPES, n=1, cutoff=0.6)
        hint = f"did you mean {near[0]!r}? " if near else ""
        raise InputError(f"scenario: there is no {name!r}; {hint}there are: {', '.join(_RECIPES)}")
    return _RECIPES[name]
