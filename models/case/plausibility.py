"""Checks across sections: contradictions (errors) and implausible figures (warnings).

The static load comes first: a drive whose rating lies below it can hold nothing, and no gains
will change that.
"""

import math
from collections.abc import Iterator

from ..basics import InputError
from ..rig import ACMotor, DCMotor
from .contents import Contents

Finding = tuple[str, str]

_STRETCH = 0.05  # of its length that a rope is stretched at rest: wire has parted by then
_SOFT = 0.05  # of the rope's stiffness, below which what is in series with it is implausible


def contradictions(case: Contents) -> list[Finding]:
    """Return what makes the case impossible, as pairs of a dotted path and a sentence."""
    try:
        overloads = _overloads(case)
    except InputError as error:
        return [("winch.drum", str(error))]
    found = list(_static_limits(case))
    if case.limits.drive == "enforce":
        found += [(at, f"must be at least {load}, got {rating}") for at, load, rating in overloads]
    return found


def remarks(case: Contents) -> Iterator[Finding]:
    """Yield what is implausible, as pairs of a dotted path and a sentence."""
    sea, delay = case.sea, case.sensors.telemetry.delay
    if sea.steepness > sea.breaking_steepness:
        yield (
            "sea.significant_height",
            f"{sea.significant_height:g} m with a peak period of {sea.spectral_peak_period:.3g} s "
            f"is steeper than breaking: steepness 2 pi H_s/(g T_p^2) is {sea.steepness:.3f}, seas "
            f"stay below {sea.breaking_steepness:.3f} (DNV-RP-C205)",
        )
    if delay > sea.spectral_peak_period / 4.0:
        yield (
            "sensors.telemetry.delay",
            f"{delay:g} s is more than a quarter of the sea's peak period, "
            f"{sea.spectral_peak_period:.3g} s: feedback cannot act on the waves",
        )
    table = case.vessel.heave_rao
    phase = (table.phase if table is not None else None) or ()
    if any(abs(angle) > 2.0 * math.pi for angle in phase):
        largest = max(phase, key=abs)
        yield (
            "vessel.heave_rao.phase",
            f"{largest:g} rad is more than a turn: numbers are in radians, write '{largest:g} deg' "
            "for degrees",
        )
    if case.limits.minimum_tension is not None and "weight_uncertainty" not in (
        case.payload.model_fields_set
    ):
        yield (
            "limits.minimum_tension",
            f"{case.limits.minimum_tension / 1e3:.4g} kN holds at both ends of the rope, at the "
            f"payload with {case.payload.weight_uncertainty:.3g} of its weight less; say "
            "payload.weight_uncertainty",
        )
    yield from _soft(case)
    rope = case.rope
    hung = case.payload.submerged_weight + case.rigging.block_weight + 0.5 * rope.submerged_weight
    stretch = hung / rope.stiffness / rope.length
    if stretch > _STRETCH:
        yield (
            "rope.axial_stiffness" if rope.modulus is None else "rope.modulus",
            f"the load at rest stretches the rope by {100.0 * stretch:.2g} % of its length: wire "
            f"parts at 2 %, fibre ropes work below {100.0 * _STRETCH:g} %",
        )
    if rope.damping_measured is not None:
        lowest, highest = rope.damping_measured
        if not lowest <= rope.damping_ratio <= highest:
            yield (
                "rope.damping_ratio",
                f"{rope.damping_ratio:g} is not between {lowest:g} and {highest:g}, which "
                "damping_measured says",
            )
    motor, drive = case.winch.motor, case.winch.drive
    if isinstance(motor, DCMotor):
        back_emf = motor.back_emf_constant * case.winch.speed_limit
        if drive.voltage is not None and drive.voltage < back_emf:
            yield (
                "winch.drive.voltage",
                f"{drive.voltage:g} V is below the back-EMF at the highest speed, "
                f"{back_emf:.4g} V: the motor cannot reach it",
            )
    brake = case.winch.brake
    if brake is not None and brake.torque is not None and brake.torque < case.static_torque:
        yield (
            "winch.brake.torque",
            f"{brake.torque / 1e3:.4g} kN m is below the static torque at the motor, "
            f"{case.static_torque / 1e3:.4g} kN m: the brake slips under the load",
        )
    if case.limits.drive == "report":
        for at, load, rating in _overloads(case):
            yield at, f"{rating} is below {load}"


def _soft(case: Contents) -> Iterator[Finding]:
    """Yield what stands in series with the rope and is so soft that the rope hardly matters."""
    rope = case.rope.stiffness
    for path, what, stiffness in (
        ("crane.tip_stiffness", "the crane's tip", case.crane.stiffness),
        ("rigging.stiffness", "the slings", case.rigging.sling_stiffness),
    ):
        if stiffness < _SOFT * rope:
            yield (
                path,
                f"{stiffness:.4g} N/m is {stiffness / rope:.2g} of the rope's {rope:.4g} N/m: "
                f"nearly all of the stretch is that of {what}; numbers are in N/m",
            )


def changed_meanings(case: Contents) -> Iterator[Finding]:
    """Yield what a case file says nothing of and once meant otherwise, as `remarks` does."""
    payload = case.sensors.payload
    passed = isinstance(payload.bandwidth, float) or case.sensors.telemetry.bandwidth is not None
    if passed and "noise_enters" not in payload.model_fields_set:
        noisy = [n for n in ("acceleration", "velocity", "displacement") if payload.noisy(n)]
        if noisy:
            yield (
                "sensors.payload.noise_enters",
                f"is not given: noise of {', '.join(noisy)} now passes the low-pass of its sensor "
                "(`before-filter`); it was added behind it (`after-filter`) before",
            )
    rope = case.rope
    if rope.damping_ratio > 0.0 and "damping_law" not in rope.model_fields_set:
        yield (
            "rope.damping_law",
            f"is not given: {rope.damping_ratio:g} is now the fraction in every mode of the rope "
            "(`hysteretic`), and a design holds with less of it too; it rose with a mode's "
            "frequency (`kelvin-voigt`) before",
        )
    motor = case.winch.motor
    if isinstance(motor, ACMotor) and "kind" not in motor.model_fields_set:
        yield (
            "winch.motor.kind",
            "is not given: neither a breakdown torque nor a rating that falls above the base speed "
            "is held; say `induction` or `permanent-magnet`",
        )


def _overloads(case: Contents) -> list[tuple[str, str, str]]:
    """Return the drive ratings below the static load: field, the static load, the rating."""
    drive, constant = case.winch.drive, case.winch.torque_constant
    gear, static = case.winch.gearbox, case.static_torque_budget
    sheaves, lossy = case.rope.sheaves, case.rope.sheaves_efficiency < 1.0
    why = (
        f"rope tension {case.static_tension / 1e3:.4g} kN on a drum radius of "
        f"{case.drum_radius:.4g} m through a gear of {gear.ratio:g}"
        + (f" and efficiency {gear.efficiency:g}" if gear.efficiency < 1.0 else "")
        + (
            f" over {sheaves} sheaves of efficiency {case.rope.sheave_efficiency:g}"
            if lossy
            else ""
        )
    )
    found = []
    for name in ("torque_continuous", "torque_peak"):
        rating = getattr(drive, name)
        if rating < static:
            load = f"the static motor torque, {static / 1e3:.4g} kN m ({why})"
            found.append((f"winch.drive.{name}", load, f"{rating / 1e3:.4g} kN m"))
    for name in ("current_continuous", "current_peak"):
        rating = getattr(drive, name)
        if rating is not None and rating < static / constant:
            load = f"the static motor current, {static / constant:.4g} A ({why})"
            found.append((f"winch.drive.{name}", load, f"{rating:.4g} A"))
    return found


def _static_limits(case: Contents) -> Iterator[Finding]:
    """Yield the rope tension limits that the tension at rest breaks already."""
    limits, tension = case.limits, case.static_tension_budget / 1e3
    if limits.rope_tension_peak is not None and limits.rope_tension_peak / 1e3 < tension:
        yield (
            "limits.rope_tension_peak",
            f"must be at least the static rope tension at the winch, {tension:.4g} kN, "
            f"got {limits.rope_tension_peak / 1e3:.4g} kN",
        )
    if limits.minimum_tension is not None:
        payload, both = case.payload, limits.tension_ends == "both"
        lowest = (payload.least_weight if both else payload.submerged_weight) / 1e3
        if limits.minimum_tension / 1e3 > lowest:
            yield (
                "limits.minimum_tension",
                f"must be at most the least static tension at the payload, {lowest:.4g} kN, "
                f"got {limits.minimum_tension / 1e3:.4g} kN",
            )
