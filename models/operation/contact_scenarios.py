"""Scenarios in which the payload meets something: the seabed, a deck, the water's surface.

Recipes of the library in `models.operation.scenarios`.  Lifts from and onto a deck are made in air,
with little rope out and the payload's whole weight on it: those are changes of the case, and
feedback gains for the case in deep water are not gains for it.  In the splash zone, also with
little rope out, the case keeps its submerged payload, and the surroundings take off what is not in
the water.  What moves beside the hook, a supply boat's deck and the water's surface, is drawn as
the hook's motion is: a spectrum times an RAO, from a seed.
"""

import math
import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..basics import GRAVITY, InputError, PhysicsWarning
from ..case import Case
from ..casefile import Quantity
from ..hook import Encounter, HookMotion
from ..plant import Deck, PlantData, Seabed, SplashZone, Surroundings
from ..vessel import HeaveRao
from .excitation import HOOK, SECOND_BODY, MotionSource, SpectrumMotion
from .options import (
    Default,
    Option,
    ScenarioRecipe,
    Values,
    WordOption,
    length_option,
    lifting_speed,
    lowering_speed,
    move,
    moving,
    payload_height,
    payload_side,
    set_point_options,
    speed_option,
    wave_height,
    weight_in_air,
)
from .touch_down import MODES, TouchDown


def _landing(case: Case, values: Values) -> dict[str, Any]:
    height, stop = values["height"], values["stop"]
    if stop >= height:
        raise InputError(
            f"scenario landing: stop must be below height, {height:g} m, got {stop:g} m"
        )
    down = move(values, stop - height)
    rest, last = down.end + values["wait"], -stop - values["slack"]
    touch = move(values, last, start=rest, speed=values["landing_speed"])
    seabed = Seabed(below=height, stiffness=values["stiffness"], damping=values["damping"])
    return {
        **moving(down, touch),
        # A payload that stands can no longer be lowered: a feedback from it would pay out rope
        # for ever.
        "disengage_at": touch.end,
        "surroundings": Surroundings(ground=seabed),
        **_touching_down(
            values,
            touch.end,
            case.payload.submerged_weight * PlantData.from_case(case).chain_compliance,
            armed_below=stop - height,
            slack=values["slack"],
        ),
    }


def _touching_down(
    values: Values, end: float, stretch: float, armed_below: float, slack: float
) -> dict[str, Any]:
    """Return the touch-down phase of a scenario whose set-point is down at a time [s], if any.

    The load stretches the chain by so much [m], which has to be paid out as well as the slack.
    A drum that has paid out slack is left to its brake; a rope that is kept taut needs the drive.
    """
    if values["touchdown"] == "none":
        return {}
    own = TouchDown(
        mode=values["touchdown"],
        slack=slack,
        speed=values["release_speed"],
        armed_below=armed_below,
        **{name: values[name] for name in ("unloaded", "unloaded_for", "kept_tension")},
    )
    released = end + (own.slack + stretch) / own.speed
    return {"touch_down": own, "disengage_at": released if own.mode == "release" else None}


def _lift_off(case: Case, values: Values) -> dict[str, Any]:
    weight = weight_in_air(case)
    # The rope carries nothing at the start: the drum has let out all stretch, and the slack.
    stretch = weight * _compliance(case, values)
    return {
        **moving(move(values, values["height"])),
        "initial_haul": -(stretch + values["slack"]),
        **_on_deck(case, values, -weight / values["stiffness"]),
    }


def _compliance(case: Case, values: Values) -> float:
    """Return the compliance of tip, rope and slings of a scenario at rest [m/N]."""
    return PlantData.from_case(case.replace({"rope.length": values["rope"]})).chain_compliance


def _set_down(case: Case, values: Values) -> dict[str, Any]:
    down = move(values, -values["height"] - values["slack"])
    return {
        **moving(down),
        **_on_deck(case, values, values["height"]),
        **_touching_down(
            values,
            down.end,
            weight_in_air(case) * _compliance(case, values),
            armed_below=0.0,
            # A boat that takes the load on a crest sinks away from under it.
            slack=values["slack"] * (1.0 if values["deck"] == "platform" else 2.0),
        ),
    }


def _on_deck(case: Case, values: Values, below: float) -> dict[str, Any]:
    """Return what a lift in air from or onto a deck has in common."""
    source: MotionSource | None = None
    if values["deck"] == "boat":
        source = boat_motion(case)
    elif values["deck"] != "platform":
        source = values["deck"]
    deck = Deck(below=below, stiffness=values["stiffness"], moving=source is not None)
    return {
        "surroundings": Surroundings(ground=deck),
        "motions": {} if source is None else {"deck": source},
        "case_changes": {
            "rope.length": values["rope"],
            "payload.submerged_weight": weight_in_air(case),
            "payload.added_mass": 0.0,
            "payload.drag_coefficient": 0.0,
        },
    }


def _splash(case: Case, values: Values) -> dict[str, Any]:
    payload = case.payload
    water = SplashZone(
        below=values["height"],
        height=payload_height(case),
        buoyancy=max(0.0, weight_in_air(case) - payload.submerged_weight),
        added_mass=payload.hydrodynamic_mass,
        slamming_area=payload.area,
        slamming_coefficient=values["slamming_coefficient"],
        water_density=payload.water_density,
        wave_number=case.sea.to_spectrum().peak_frequency ** 2 / GRAVITY,
    )
    surroundings = Surroundings(water=water)
    return {
        **moving(move(values, -values["height"] - values["depth"])),
        "surroundings": surroundings,
        "motions": {"surface": surface_motion(case, payload_side(case))},
        # Hauled in by what the rope stretches more under the weight in air, so that P is 0.
        "initial_haul": -surroundings.rest_force * _compliance(case, values),
        "case_changes": {"rope.length": values["rope"]},
    }


_DECK: Mapping[str, Option | WordOption] = {
    "deck": WordOption(words=("boat", "platform"), text="what the deck is part of", motion=True),
    "stiffness": Option(
        quantity=Quantity("stiffness", 1e3, 1e9), default=5e6, text="stiffness of the deck"
    ),
    "rope": length_option(40.0, "rope from the drum to the payload at the start", low=1.0),
}

_SHARE = Quantity("ratio", 0.0, 1.0, open_low=True)


def _touch_down_options(speed: Default) -> dict[str, Option | WordOption]:
    return {
        "touchdown": WordOption(
            words=(*MODES, "none"), text="what the winch does once the ground has the load"
        ),
        "unloaded": Option(
            quantity=_SHARE, default=0.3, text="lack of tension, of the weight, that is a touchdown"
        ),
        "unloaded_for": Option(
            quantity=Quantity("time", 0.0, 60.0), default=0.2, text="how long it must be lacking"
        ),
        "kept_tension": Option(
            quantity=_SHARE, default=0.5, text="tension that is kept, of the weight"
        ),
        "release_speed": speed_option(speed, "speed at which slack is paid out"),
    }


CONTACT_SCENARIOS: Mapping[str, ScenarioRecipe] = {
    "landing": ScenarioRecipe(
        description="lower the payload to above the seabed, wait, and land it",
        build=_landing,
        options={
            # University of Agder, MAS409: hold 7.5 m above the seabed, lower to 5 m, land
            "height": length_option(7.5, "height of the payload above the seabed at the start"),
            "stop": length_option(5.0, "height at which it waits before it lands"),
            # Less than the hook may rise, and the payload would be lifted again.
            "slack": length_option(wave_height, "rope paid out beyond touchdown"),
            "landing_speed": speed_option(
                lambda case: 0.5 * lowering_speed(case), "speed of the set-point at touchdown"
            ),
            "stiffness": Option(
                quantity=Quantity("stiffness", 1e3, 1e9),
                default=1.8e6,
                text="stiffness of the seabed",
            ),
            "damping": Option(
                quantity=Quantity("number", 0.0, 1e9),
                default=6.5e5,
                text="damping of the seabed [N s/m^1.5]",
            ),
            **_touch_down_options(lowering_speed),
            **set_point_options(),
        },
        ramp=2.0,
    ),
    "lift-off": ScenarioRecipe(
        description="lift the payload, in air, off a supply boat or a platform",
        build=_lift_off,
        options={
            "height": length_option(6.0, "how far the payload is raised"),
            # Less than the boat may sink from under it, and it would be lifted too early.
            "slack": length_option(wave_height, "slack rope at the start"),
            **_DECK,
            **set_point_options(lifting_speed, 0.5, wait=10.0),
        },
        warm_up=10.0,
        ramp=5.0,
    ),
    "set-down": ScenarioRecipe(
        description="set the payload, in air, down on a supply boat or a platform",
        build=_set_down,
        options={
            "height": length_option(5.0, "height of the payload above the deck at the start"),
            "slack": length_option(wave_height, "rope paid out beyond the deck's mean height"),
            **_DECK,
            **_touch_down_options(lifting_speed),
            **set_point_options(lifting_speed, 0.5),
        },
    ),
    "splash": ScenarioRecipe(
        description="lower the payload through the splash zone",
        build=_splash,
        options={
            "height": length_option(
                lambda case: 1.5 * wave_height(case), "height above still water at the start"
            ),
            "depth": length_option(
                lambda case: payload_height(case) + 2.0 * wave_height(case),
                "depth of the payload's underside at the end",
            ),
            "rope": length_option(30.0, "rope from the drum to the payload at the start", low=1.0),
            "slamming_coefficient": Option(
                quantity=Quantity("ratio", 0.0, 50.0), default=5.0, text="slamming coefficient"
            ),
            **set_point_options(),
        },
    ),
}


def boat_motion(case: Case, cut_off: float = 0.9) -> SpectrumMotion:
    """Return the heave of a supply boat's deck in the sea of a case.

    An illustrative small boat: it follows waves that are long against it and not those that are
    short, |RAO| = 1/sqrt(1 + (omega/omega_c)^8).  Its waves have the spectrum of the case but are
    drawn by themselves: how far it lies from the vessel is not known.  The cut-off omega_c [rad/s]
    of 0.9 is that of a wave of 76 m, the length of a supply boat.
    """
    omega = np.linspace(0.1, 4.0, 40) * cut_off
    amplitude = 1.0 / np.sqrt(1.0 + (omega / cut_off) ** 8)
    rao = HeaveRao(omega=omega, amplitude=amplitude, below="unity", beyond="decay")
    return SpectrumMotion(hook=_in_the_sea_of(case, rao), purpose=SECOND_BODY)


def surface_motion(case: Case, side: float) -> SpectrumMotion:
    """Return the water's surface under the hook, averaged over the payload's plan, `side` long [m].

    Its waves are those that move the hook, whose RAO refers to the wave at the hook.  Long-crested
    waves of wave number k over a side a average to sin(ka/2)/(ka/2); from the first zero on there
    is nothing left of them.  A hook whose RAO has no phases follows the surface without a lag: a
    warning says so, as nothing else in the toolkit asks for both motions in the same waves.
    """
    table = case.vessel.heave_rao
    if table is not None and table.phase is None and not case.quiet:
        warnings.warn(
            f"{case.label}: vessel.heave_rao: phase is missing and taken as zero: the hook moves "
            "with the water's surface, and their relative motion comes out too small",
            PhysicsWarning,
            stacklevel=2,
        )
    half = np.linspace(0.0, math.pi, 64)[1:]
    omega = np.sqrt(2.0 * GRAVITY * half / side)
    amplitude = np.maximum(np.sinc(half / math.pi), 0.0)
    rao = HeaveRao(omega=omega, amplitude=amplitude, below="unity", beyond="zero")
    return SpectrumMotion(hook=_in_the_sea_of(case, rao), purpose=HOOK)


def _in_the_sea_of(case: Case, rao: HeaveRao) -> HookMotion:
    """Return a motion in the waves of a case, as they are met where its vessel is."""
    met = Encounter.from_case(case, hook=False)
    return HookMotion(sea=case.sea.to_spectrum(), rao=rao, encounter=met)
