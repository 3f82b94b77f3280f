"""Weather windows as a command is asked for them: the seas, the operation, the vessel's heading."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING

from models.basics import InputError

from .declare import options

if TYPE_CHECKING:
    from models.sea import SeaSeries
    from synth.operability import Operability, VesselHeading, WeatherWindows

WEATHER = options(
    """
    weather windows:
    --seas FILE  H_s, T_p and direction in time (`stillhook sea FILE` tells what is read);
        `example` is a made-up year
    --place PLACE  one place of a file that has several, as LAT,LON of a grid
    --duration TIME  planned time of the operation T_POP, as in 12h
    --contingency TIME  contingency T_C (default: T_POP); the window T_R = T_POP + T_C is 72 h
        at most
    --heading DEG|DEG+-X|+-X|best  the bow by the compass, or the best within so much of it, of
        head seas, or of all (default: the case's heading to the waves)
    --alpha NUMBER|FILE  factor on the limiting H_s, or your table of it (default: 1)
    --forecast-level LEVEL  level of the weather forecast in that table
    """,
)


def asked_weather(arguments: argparse.Namespace) -> tuple[VesselHeading | None, SeaSeries | None]:
    """Return the vessel's heading and the seas that windows are counted in, None without.

    Whatever can be wrong about them is told before anything is computed.
    """
    words = ("place", "duration", "contingency", "heading", "alpha", "forecast_level")
    if arguments.seas is None:
        given = [word for word in words if getattr(arguments, word) is not None]
        if given:
            name = given[0].replace("_", "-")
            raise InputError(
                f"{arguments.command}: --{name} is for weather windows; give --seas FILE, too"
            )
        return None, None
    if arguments.duration is None:
        raise InputError(
            f"{arguments.command}: --seas needs --duration, the planned time, as in 12h"
        )
    from models.sea import read_series
    from synth.operability import alpha_factor, example_series, window_times

    planned, _ = window_times(arguments.duration, arguments.contingency)
    alpha_factor(arguments.alpha or 1.0, planned, arguments.forecast_level)
    rule = _heading(arguments)
    if arguments.seas == "example":
        seas = example_series()
    else:
        seas = read_series(arguments.seas, place=arguments.place)
    if rule.bow is not None:
        seas.relative(rule.bow)
    return rule, seas


def _heading(arguments: argparse.Namespace) -> VesselHeading:
    """Return how the vessel lies, from DEG, DEG+-X, +-X or `best`."""
    from synth.operability import VesselHeading

    text = arguments.heading
    if text is None:
        return VesselHeading()
    if text == "best":
        return VesselHeading(within=math.pi)
    bow, sign, within = text.replace("\u00b1", "+-").partition("+-")
    try:
        angles = [math.radians(float(part)) if part.strip() else None for part in (bow, within)]
    except ValueError:
        angles = [None, None]
    if angles == [None, None] or (sign and angles[1] is None):
        raise InputError(
            f"{arguments.command}: --heading must be DEG, DEG+-X, +-X or best, in degrees; "
            f"got {text!r}"
        )
    return VesselHeading(bow=angles[0], within=angles[1] or 0.0)


def found_windows(
    study: Operability,
    seas: SeaSeries,
    rule: VesselHeading | None,
    arguments: argparse.Namespace,
) -> WeatherWindows:
    """Return the weather windows that the arguments ask for."""
    from synth.operability import weather_windows

    return weather_windows(
        study,
        seas,
        arguments.duration,
        contingency=arguments.contingency,
        heading=rule,
        alpha=arguments.alpha or 1.0,
        forecast_level=arguments.forecast_level,
    )
