"""`stillhook check`: what was read from a case, as the figures that follow from it.

Errors and warnings are those of reading the case.  The table is for a second look: a stiffness
with a slipped decimal, a winch that is loaded to the limit at rest, a drum too slow for the sea.
"""

from __future__ import annotations

import argparse
import math
import shlex
from dataclasses import asdict
from typing import TYPE_CHECKING

from ...text import (
    Report,
    ReportSection,
    duration,
    heading_words,
    largest_in,
    number,
    percent,
    quantity,
    remarks,
)
from ..declare import CASE
from ..given import case_words, given_case
from ..working import conclude

if TYPE_CHECKING:
    from models import Case
    from models.hook import HookMotion
    from synth.question import RopeFacts, SystemFacts, WaveBand

Rows = list[tuple[str, str, str]]

#: Where the period of a mode lies, by where its frequency does.
_PLACES = {
    "below": ("longer", "than the hook's band"),
    "in": ("in", "the hook's band"),
    "above": ("shorter", "than the hook's band"),
}
_DIGITS = 12  # of a case's hash that are shown

ARGUMENTS = (CASE,)
EXAMPLES = (
    ("stillhook check subsea-crane", "what follows from a case before any gain is chosen"),
    ("stillhook check thesis-1975 --set 'rope.length=1500 m'", "the same with one number changed"),
)


def run(arguments: argparse.Namespace) -> int:
    """Read the case and show what follows from it; return 0."""
    from models.hook import HookMotion
    from synth.question import system_facts

    case = given_case(arguments)
    hook = HookMotion.from_case(case)
    facts = system_facts(case, hook)
    report = check_report(case, hook, facts)
    words = case_words(arguments)
    following = [("the gains for it", f"stillhook optimise {words}")]
    if case.gains is not None:
        following.append(("the gains in use", f"stillhook evaluate {words}"))
    sea = f"stillhook check {shlex.quote(arguments.case)} --set sea.significant_height=1.5"
    following.append(("another sea", sea))
    result = {"digest": case.digest, "system": asdict(facts)}
    return conclude(report, arguments, following=following, result=result)


def check_report(case: Case, hook: HookMotion, facts: SystemFacts) -> Report:
    """Return what follows from a case, as tables of label, figure and remark."""
    tables = [
        remarks("case", _case(case)),
        remarks("sea and hook", _sea(case, hook, facts.waves)),
        remarks("rope and payload", _rope(case, facts)),
        remarks("winch", _winch(case, facts)),
        remarks("sensors and limits", _limits(case)),
    ]
    about = " ".join(case.description.split())
    return Report(
        name=case.name, about=about, status="no errors", sections=[ReportSection("", tables)]
    )


def _case(case: Case) -> Rows:
    digits = case.digest
    return [("hash", digits[:_DIGITS], f"of its contents: {_DIGITS} digits of {len(digits)}")]


def _sea(case: Case, hook: HookMotion, waves: WaveBand) -> Rows:
    sea, statistics = case.sea, hook.sea.statistics
    moved, speed = hook.displacement, hook.velocity
    time = case.limits.exposure_time
    outside = hook.rao.share_outside(hook.sea).total
    shortest, longest, most = (
        quantity(2.0 * math.pi / omega, "s") for omega in (waves.high, waves.low, waves.peak)
    )
    rows = [
        (
            "sea",
            f"H_s {quantity(sea.significant_height, 'm')}",
            f"{sea.spectrum}, peak period {quantity(sea.spectral_peak_period, 's')}, "
            f"T_z {quantity(statistics.zero_crossing_period, 's')}",
        ),
        (
            "steepness",
            number(sea.steepness, 2),
            f"seas stay below {number(sea.breaking_steepness, 2)}",
        ),
        *_vessel(case),
        ("hook, rms", quantity(moved.rms, "m"), f"T_z {quantity(moved.zero_crossing_period, 's')}"),
        ("hook, significant height", quantity(moved.significant_height, "m"), "4 rms"),
        (
            f"hook, largest in {duration(time)}",
            quantity(moved.most_probable_maximum(time), "m"),
            "most probable, from the mean",
        ),
        (
            "hook speed, rms",
            quantity(speed.rms, "m/s"),
            f"largest in {duration(time)} {quantity(speed.most_probable_maximum(time), 'm/s')}",
        ),
    ]
    if moved.rms > 0.0:
        remark = f"of its variance from {shortest} to {longest}, peak {most}"
        rows.append(("hook, band", "90 %", remark))
    if outside > 5e-4:
        remark = f"of the variance: below {case.vessel.below}, beyond {case.vessel.beyond}"
        rows.append(("outside the RAO's table", percent(outside), remark))
    return rows


def _vessel(case: Case) -> Rows:
    """Return the vessel, the heading of the waves and the hook's place, where the case has them."""
    from models.vessel import place_text, vessel_raos

    vessel, place = case.vessel, case.vessel.hook_point
    if place is None or vessel.heading is None:
        return []
    raos = vessel_raos(vessel, case.label)
    heading = f"{math.degrees(vessel.heading) % 360.0:.4g} deg"
    return [
        ("vessel", raos.name, f"hook at {place_text(place)}"),
        ("waves towards", heading, heading_words(vessel.heading)),
    ]


def _rope(case: Case, facts: SystemFacts) -> Rows:
    rope, held = facts.rope, facts.held
    first, *others = facts.modes
    periods = ", ".join(quantity(mode.period, "s") for mode in others)
    of = "" if rope.falls == 1 else f", {rope.falls} falls"
    masses = [f"payload {quantity(rope.payload_mass, 'kg')}"]
    masses += [f"added {quantity(rope.added_mass, 'kg')}"]
    masses += [f"rope {quantity(rope.rope_mass, 'kg')}"]
    if rope.block_mass:
        masses += [f"hook block {quantity(rope.block_mass, 'kg')}"]
    moves = "with the drum held"
    if held.hook_rms > 0.0:
        moves = f"{number(held.factor)} times the hook's, {moves}"
    fixed = case.payload.fixed_drag is not None
    return [
        (
            "stiffness K = EA/L",
            quantity(rope.stiffness, "N/m"),
            f"EA {quantity(rope.axial_stiffness, 'N')}{of}",
        ),
        *_rig(rope),
        ("mass that moves, M", quantity(rope.moving_mass, "kg"), ", ".join(masses)),
        (
            "natural period",
            quantity(first.period, "s"),
            f"drum held; next {periods}" if periods else "drum held, one spring",
        ),
        *_among_waves(facts),
        (
            "stretch at rest",
            quantity(rope.stretch, "m"),
            f"axial waves need {quantity(rope.travel_time, 's')} end to end",
        ),
        (
            "linear drag",
            quantity(held.drag, "N s/m"),
            "fixed by the case" if fixed else "with the drum held",
        ),
        ("payload, rms", quantity(held.payload_rms, "m"), moves)
        if math.isfinite(held.payload_rms)
        else ("payload, rms", "-", "without bound with the drum held: nothing damps it"),
    ]


def _among_waves(facts: SystemFacts) -> Rows:
    """Return where the natural periods lie among those of the hook."""
    if facts.held.hook_rms == 0.0:
        return []
    first, *others = facts.modes
    figure, remark = _PLACES[first.place]
    remark += f", at {percent(first.relative_density)} of its peak"
    if others:
        remark += f"; next {', '.join(_PLACES[mode.place][0] for mode in others)}"
    return [("... in the waves", figure, remark)]


def _winch(case: Case, facts: SystemFacts) -> Rows:
    winch = facts.winch
    share, stays = winch.tension_share, winch.tension_to_stay
    kind = "DC" if case.winch.motor.type == "dc" else "AC"
    return [
        ("drum radius", quantity(winch.drum_radius, "m"), "to the rope's centre, rope paid out"),
        (
            "static rope tension",
            quantity(winch.drum_tension_hauling, "N"),
            "" if share is None else f"{percent(share)} of what it may",
        ),
        (
            "... at the load, least",
            quantity(winch.load_tension_least, "N"),
            "" if stays is None else f"{quantity(stays, 'N')} are to stay in the rope",
        ),
        (
            "static motor torque",
            quantity(winch.static_torque, "N m"),
            f"{percent(winch.rating_share)} of the rating, {percent(winch.peak_share)} of the peak",
        ),
        (
            "fastest rope",
            quantity(winch.rope_speed, "m/s"),
            f"the hook's largest speed is {percent(winch.speed_share)} of it",
        ),
        (
            "inertia",
            quantity(winch.inertia, "kg m2"),
            f"at the motor ({kind}); {quantity(winch.equivalent_mass, 'kg')} at the rope",
        ),
        (
            "power to follow the hook",
            quantity(winch.following_power, "W"),
            "of the drive: static tension times that speed, with losses",
        ),
    ]


def _limits(case: Case) -> Rows:
    sensors, limits = case.sensors, case.limits
    bandwidth = sensors.payload.bandwidth
    seen = "perfect" if isinstance(bandwidth, str) else f"{number(bandwidth)} rad/s"
    slow = limits.low_frequency
    kept = "enforced" if limits.drive == "enforce" else "reported only"
    rows = [
        ("payload sensor", seen, "bandwidth"),
        ("telemetry", quantity(sensors.telemetry.delay, "s"), "delay"),
        ("sensitivity peak M_s", number(limits.max_sensitivity), "at most"),
        ("drive limits", kept, largest_in(limits, "largest values")),
    ]
    if slow is not None:
        remark = f"at most, up to {slow.below:g} rad/s"
        rows.append(("|P/Z| at low frequency", number(slow.ratio), remark))
    return rows


def _rig(rope: RopeFacts) -> Rows:
    """Return what gives besides the rope, and all of it in series."""
    rows = []
    for name, stiffness, share in (
        ("... crane's tip", rope.tip_stiffness, rope.tip_share),
        ("... slings", rope.sling_stiffness, rope.sling_share),
    ):
        if math.isfinite(stiffness):
            rows.append((name, quantity(stiffness, "N/m"), f"{percent(share)} of the stretch"))
    if rows:
        series = "tip, rope and slings, one below the other"
        rows.append(("... in series", quantity(rope.series_stiffness, "N/m"), series))
    return rows
