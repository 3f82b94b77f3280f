"""`stillhook check`: what was read from a case, as the figures that follow from it.

Errors and warnings are those of reading the case.  The table is for a second look: a stiffness
with a slipped decimal, a winch that is loaded to the limit at rest, a drum too slow for the sea.
"""

from __future__ import annotations

import argparse
import math
import shlex
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

Rows = list[tuple[str, str, str]]

ARGUMENTS = (CASE,)


def run(arguments: argparse.Namespace) -> int:
    """Read the case and show what follows from it; return 0."""
    from models.hook import HookMotion

    case = given_case(arguments)
    hook = HookMotion.from_case(case)
    report = check_report(case, hook)
    words = case_words(arguments)
    following = [("the gains for it", f"stillhook optimise {words}")]
    if case.gains is not None:
        following.append(("the gains in use", f"stillhook evaluate {words}"))
    sea = f"stillhook check {shlex.quote(arguments.case)} --set sea.significant_height=1.5"
    following.append(("another sea", sea))
    return conclude(report, arguments, following=following)


def check_report(case: Case, hook: HookMotion) -> Report:
    """Return what follows from a case, as tables of label, figure and remark."""
    tables = [
        remarks("sea and hook", _sea(case, hook)),
        remarks("rope and payload", _rope(case, hook)),
        remarks("winch", _winch(case, hook)),
        remarks("sensors and limits", _limits(case)),
    ]
    about = " ".join(case.description.split())
    return Report(
        name=case.name, about=about, status="no errors", sections=[ReportSection("", tables)]
    )


def _sea(case: Case, hook: HookMotion) -> Rows:
    sea, statistics = case.sea, hook.sea.statistics
    moved, speed = hook.displacement, hook.velocity
    time = case.limits.exposure_time
    outside = hook.rao.share_outside(hook.sea).total
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


def _rope(case: Case, hook: HookMotion) -> Rows:
    from models.plant import PlantData
    from synth.question import uncompensated

    rope, payload = case.rope, case.payload
    # Of the load's weight, and half the rope's own; of tip and slings by what hangs on them.
    hung = payload.submerged_weight + case.rigging.block_weight
    stretch = (hung + 0.5 * rope.submerged_weight) / rope.stiffness
    stretch += case.hung_weight / case.crane.stiffness
    stretch += payload.submerged_weight / case.rigging.sling_stiffness
    drag, rms = uncompensated(case, PlantData.from_case(case), hook)
    modes = _modes(case)
    periods = [quantity(2.0 * math.pi / mode, "s") for mode in modes]
    held = f"drum held; next {', '.join(periods[1:])}" if periods[1:] else "drum held, one spring"
    of = "" if rope.falls == 1 else f", {rope.falls} falls"
    masses = [f"payload {quantity(payload.mass, 'kg')}"]
    masses += [f"added {quantity(payload.hydrodynamic_mass, 'kg')}"]
    masses += [f"rope {quantity(rope.mass, 'kg')}"]
    if case.rigging.block_mass:
        masses += [f"hook block {quantity(case.rigging.block_mass, 'kg')}"]
    moves = f"{number(rms / hook.displacement.rms)} times the hook's, with the drum held"
    how = "fixed by the case" if payload.fixed_drag is not None else "with the drum held"
    return [
        ("stiffness K = EA/L", quantity(rope.stiffness, "N/m"), f"EA {quantity(rope.ea, 'N')}{of}"),
        *_rig(case),
        ("mass that moves, M", quantity(case.moving_mass, "kg"), ", ".join(masses)),
        ("natural period", periods[0], held),
        (
            "stretch at rest",
            quantity(stretch, "m"),
            f"axial waves need {quantity(rope.travel_time, 's')} end to end",
        ),
        ("linear drag", quantity(drag, "N s/m"), how),
        ("payload, rms", quantity(rms, "m"), moves)
        if math.isfinite(rms)
        else ("payload, rms", "-", "without bound with the drum held: nothing damps it"),
    ]


def _winch(case: Case, hook: HookMotion) -> Rows:
    from models.hook import HookDemand

    winch, drive = case.winch, case.winch.drive
    torque = case.static_torque_budget
    mass = winch.inertia * (winch.gearbox.ratio / case.haul_radius) ** 2
    rope_speed = winch.speed_limit * case.drum_radius / winch.gearbox.ratio
    fastest = hook.velocity.most_probable_maximum(case.limits.exposure_time)
    tension = case.limits.rope_tension_peak
    allowed = (
        "" if tension is None else f"{percent(case.static_tension_budget / tension)} of what it may"
    )
    least = case.least_tension
    taut = "" if least is None else f"{quantity(least, 'N')} are to stay in the rope"
    kind = "DC" if winch.motor.type == "dc" else "AC"
    return [
        ("drum radius", quantity(case.drum_radius, "m"), "to the rope's centre, rope paid out"),
        ("static rope tension", quantity(case.static_tension_budget, "N"), allowed),
        ("... at the load, least", quantity(case.payload.least_weight, "N"), taut),
        (
            "static motor torque",
            quantity(torque, "N m"),
            f"{percent(torque / drive.torque_continuous)} of the rating, "
            f"{percent(torque / drive.torque_peak)} of the peak",
        ),
        (
            "fastest rope",
            quantity(rope_speed, "m/s"),
            f"the hook's largest speed is {percent(fastest * case.rope.falls / rope_speed)} of it",
        ),
        (
            "inertia",
            quantity(winch.inertia, "kg m2"),
            f"at the motor ({kind}); {quantity(mass, 'kg')} at the rope",
        ),
        (
            "power to follow the hook",
            quantity(HookDemand.from_case(case).drive_power, "W"),
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


def _modes(case: Case) -> list[float]:
    """Return the natural frequencies with the drum held [rad/s]: the first three."""
    from models.plant import PlantData

    return [float(w) for w in PlantData.from_case(case).axial_modes(3)]


def _rig(case: Case) -> Rows:
    """Return what gives besides the rope, and all of it in series."""
    crane, rigging = case.crane.tip_stiffness, case.rigging.stiffness
    rows = []
    for name, stiffness in (("... crane's tip", crane), ("... slings", rigging)):
        if stiffness is not None:
            share = percent(case.chain_stiffness / stiffness)
            rows.append((name, quantity(stiffness, "N/m"), f"{share} of the stretch"))
    if rows:
        series = "tip, rope and slings, one below the other"
        rows.append(("... in series", quantity(case.chain_stiffness, "N/m"), series))
    return rows
