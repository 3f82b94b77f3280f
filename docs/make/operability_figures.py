"""Figures of `docs/operability.md`, and its figures: `python docs/make/operability_figures.py`.

A present-day winch (`subsea-crane`) over the starboard quarter of the bundled supply vessel, with
the gains of the structure `combined`, against the made-up scatter diagram; and the thesis's winch.
About ten minutes.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Sequence
from functools import cache

import numpy as np
from said import QUICK, Effort, Saying, sayings_parser, tell
from stored import docs_folder

import stillhook as sh
from models.basics import PhysicsWarning
from stillhook.seas import (
    capability_figure,
    contour_figure,
    depth_figure,
    heading_figure,
    scatter_figure,
)
from stillhook.text import picture
from synth.operability import Operability, operability, rule_shares

PAGE, FILE = "operability.md", "said_operability.csv"
VESSEL = {
    "vessel.raos": "osv-83m",
    "vessel.hook": {"x": -25.0, "y": -15.0, "z": 20.0},
    "vessel.heading": "165 deg",
}
HEAD = 165.0  # deg
DEPTHS = (300.0, 500.0, 1000.0, 1300.0)
RULE = "platform building, ship-mounted derrick"
THESIS = {"A": 200, "a": 50, "a1": 100, "a2": 100}


@cache
def design(effort: Effort) -> sh.Design:
    """Return the winch's gains."""
    case = sh.load_case("subsea-crane").replace(VESSEL)
    return sh.optimise_gains(case, "feed-forward" if effort == QUICK else "combined", starts=1)


@cache
def year(effort: Effort) -> tuple[Operability, float]:
    """Return the contours over all headings, and how long they took [s of the processor]."""
    own, begun = design(effort), time.process_time()
    found = operability(
        own,
        headings=np.radians(np.arange(0.0, 360.0, 90.0 if effort == QUICK else 15.0)),
        payload_rms="50 mm",
        scatter="example",
    )
    return found, time.process_time() - begun


@cache
def deep(effort: Effort) -> Operability:
    """Return the contours of the same gains at four lengths of rope."""
    return operability(
        design(effort),
        periods=np.arange(5.0, 16.0, 5.0 if effort == QUICK else 1.0),
        headings=[np.radians(HEAD)],
        payload_rms="50 mm",
        depths=DEPTHS,
    )


def limits(effort: Effort) -> dict[str, float]:
    """Return the limiting H_s in head seas at 11 s: all limits, the power, the payload [m]."""
    at = year(effort)[0].dataset.sel(heading=HEAD, peak_period=11.0, method="nearest")
    return {
        "height": float(at.height),
        "power": float(at.height_limit.sel(limit="motor.power.peak")),
        "payload": float(at.height_limit.sel(limit="payload.rms")),
    }


def shares(effort: Effort) -> dict[str, float]:
    """Return the shares of the year that are workable [%], and how long that took."""
    study, seconds = year(effort)
    data = study.dataset
    return {
        "held": 100.0 * float(data.workable_held),
        "head": 100.0 * float(data.workable),
        "best": 100.0 * float(data.workable_best_heading),
        "perfect": 100.0 * float(data.workable_perfect),
        "perfect_best": 100.0 * float(data.workable_best_heading_perfect),
        "seas": data.height.size,
        "seconds": seconds,
    }


def rule(effort: Effort) -> dict[str, float]:
    """Return the share of the year for platform building from a ship-mounted derrick [%]."""
    scatter = year(effort)[0].scatter
    assert scatter is not None
    (safe,) = (share for name, share, _ in rule_shares(scatter) if name.startswith(RULE))
    return {"safe": 100.0 * safe}


def depths(effort: Effort) -> dict[str, float]:
    """Return the M_s of the same gains at other lengths of rope."""
    data = deep(effort).depths
    return {f"at{at.length:g}": at.max_sensitivity for at in data}


@cache
def thesis(effort: Effort) -> dict[str, float]:
    """Return the limiting H_s of the thesis's winch [m], with its gains and with others."""
    own = sh.evaluate_gains(sh.load_case("thesis-1975"), THESIS)
    seven, twelve = np.ravel(operability(own, periods=[7.0, 12.0]).dataset.height)
    again = operability(own, periods=[8.0], payload_rms="50 mm", reoptimise=effort != QUICK).dataset
    anew = again.height_reoptimised if effort != QUICK else again.height
    return {
        "seven": float(seven),
        "twelve": float(twelve),
        "kept": float(np.ravel(again.height)[0]),
        "anew": float(np.ravel(anew)[0]),
    }


SAYINGS = [
    Saying(
        page=PAGE,
        name="limits",
        template="""
            At 11 s the limit is {height:2} m: the inverter's 1.2 MW would hold up to {power:2} m,
            the payload's 50 mm up to {payload:2} m.
        """,
        work=limits,
    ),
    Saying(
        page=PAGE,
        name="thesis",
        template="works up to $H_s$ {seven:2} m at 7 s and {twelve:2} m at 12 s:",
        work=thesis,
    ),
    Saying(
        page=PAGE,
        name="shares",
        template="""
            With 50 mm rms at the payload, {held:.0f} % of that year are workable with the drum
            held, {head:.0f} % with the design in head seas 15 deg off the bow, {best:.0f} % in the
            best heading, and {perfect:.0f} % ({perfect_best:.0f} %) for a winch of the same size
            that followed the hook perfectly.
        """,
        work=shares,
    ),
    Saying(page=PAGE, name="rule", template="would have {safe:.0f} % of", work=rule),
    Saying(
        page=PAGE,
        name="depths",
        template="""
            the design above, made for 1000 m, has an $M_s$ of {at1000:2} there; with 500 m of rope
            it is {at500:2}, with 300 m {at300:2}, with 1300 m {at1300:2}, and where it is infinite
            it works in no sea
        """,
        work=depths,
    ),
    Saying(
        page=PAGE,
        name="anew",
        template="gets from {kept:2} to {anew:2} m at 8 s:",
        work=thesis,
    ),
    Saying(
        page=PAGE,
        name="seconds",
        template="{seas:.0f} seas of a design, all limits of three systems, in {seconds:.0f} s",
        work=shares,
    ),
]


def draw(effort: Effort) -> None:
    """Draw the figures, and print what is beside them."""
    images = docs_folder(effort == QUICK) / "images"
    study, other = year(effort)[0], deep(effort)
    print(design(effort), study, other, sep="\n")
    for check in (*study.verify(), *other.verify(1)):
        print(check)
    for name, figure in (
        ("contour", contour_figure(study)),
        ("headings", heading_figure(study)),
        ("year", scatter_figure(study)),
        ("capability", capability_figure(study)),
        ("depths", depth_figure(other)),
    ):
        (images / f"operability-{name}.svg").write_bytes(picture(figure, "svg"))


def main(argv: Sequence[str] | None = None) -> int:
    """Find the design and its contours, draw them, and say what the page says."""
    warnings.simplefilter("ignore", PhysicsWarning)
    given = sayings_parser(__doc__).parse_args(argv)
    if not given.words:
        draw(QUICK if given.quick else Effort())
    return tell(SAYINGS, FILE, given)


if __name__ == "__main__":
    raise SystemExit(main())
