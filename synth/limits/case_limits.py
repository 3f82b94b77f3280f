"""The limits that a case states: on the loop, and on motor, drive and rope."""

import math
from collections.abc import Callable

import numpy as np

from models.basics import InputError
from models.case import Case
from models.plant import LinearPlant, PlantData

from .frequency_limits import LowFrequency, MaxSensitivity, RollOff
from .limits import Limit
from .margin_limits import DelayMargin, GainMargin, GainMarginDown
from .signal_limits import Breakdown, Continuous, Minimum, Peak, Power, Thermal

PAYLOAD = "payload.displacement"
HOOK = "hook.heave"
LOWER_TENSION = "rope.lower_tension"
_HELD = 0.05  # a rope mode within this share of its exact frequency counts as modelled


def loop_limits(case: Case, data: PlantData, masses: int) -> tuple[Limit, ...]:
    """Return the limits on the loop, for a plant of `masses` rope masses."""
    wanted = case.limits
    limits: list[Limit] = [MaxSensitivity(bound=wanted.max_sensitivity)]
    if wanted.gain_margin_up is not None:
        limits.append(GainMargin(bound=wanted.gain_margin_up))
    if wanted.gain_margin_down is not None:
        limits.append(GainMarginDown(bound=wanted.gain_margin_down))
    if wanted.delay_margin:
        limits.append(DelayMargin(bound=wanted.delay_margin))
    if wanted.low_frequency is not None:
        limits.append(
            LowFrequency(
                bound=wanted.low_frequency.ratio,
                below=wanted.low_frequency.below,
                output=PAYLOAD,
                disturbance=HOOK,
            )
        )
    above = modelled_bandwidth(data, masses)
    if wanted.roll_off is not None and math.isfinite(above):
        limits.append(RollOff(bound=wanted.roll_off, above=above))
    return tuple(limits)


def drive_limits(case: Case, plant: LinearPlant) -> tuple[Limit, ...]:
    """Return the limits on motor, drive and rope.

    Raises InputError if they are to be enforced and the load at rest breaks one already.
    """
    drive, wanted = case.winch.drive, case.limits
    static, loss = plant.static, plant.loss
    time = wanted.equivalent_exposure
    limits: list[Limit] = []

    def add(kind: Callable[..., Limit], output: str, bound: float | None, **more: float) -> None:
        if bound is not None:
            more["loss"] = loss.get(output, 0.0)
            unit = plant.units[output]
            limits.append(
                kind(bound=bound, output=output, static=static[output], unit=unit, **more)
            )

    add(Peak, "motor.torque", drive.torque_peak, duration=time)
    if math.isinf(case.winch.cooled_speed):
        add(Continuous, "motor.torque", drive.torque_continuous)
    else:
        cooled = case.winch.cooled_speed
        add(Thermal, "motor.torque", drive.torque_continuous, base_speed=cooled)
    add(Peak, "motor.speed", case.winch.speed_limit, duration=time)
    if case.winch.motor.type == "dc":
        add(Peak, "motor.voltage", drive.voltage, duration=time)
        add(Peak, "motor.current", drive.current_peak, duration=time)
        add(Continuous, "motor.current", drive.current_continuous)
    if case.winch.power_limit is not None and math.isfinite(case.winch.power_limit):
        limits.append(
            Power(
                bound=case.winch.power_limit,
                torque="motor.torque",
                speed="motor.speed",
                static=static["motor.torque"],
                loss=loss.get("motor.torque", 0.0),
                duration=time,
            )
        )
    if math.isfinite(case.winch.breakdown_limit):
        base = case.winch.cooled_speed
        limits.append(
            Breakdown(
                bound=case.winch.breakdown_limit / base**2,
                base_speed=base,
                torque="motor.torque",
                speed="motor.speed",
                static=static["motor.torque"],
                loss=loss.get("motor.torque", 0.0),
                duration=time,
            )
        )
    add(Peak, "rope.tension", wanted.rope_tension_peak, duration=time)
    least = case.least_tension
    add(Minimum, "rope.tension", least and least / case.rope.falls, duration=time)
    if least is not None and wanted.tension_ends == "both":
        lightest = case.payload.least_weight
        limits.append(
            Minimum(bound=least, output=LOWER_TENSION, static=lightest, duration=time, unit="N")
        )
    _check_static(case, limits)
    return tuple(limits)


def _check_static(case: Case, limits: list[Limit]) -> None:
    """Refuse limits that the load at rest breaks already, if they are to be enforced."""
    if case.limits.drive != "enforce":
        return
    for limit in limits:
        if not isinstance(limit, Peak | Continuous):
            continue
        least = abs(limit.static) + limit.loss
        if isinstance(limit, Continuous):
            least = math.hypot(limit.static, limit.loss)
        if least >= limit.bound:
            raise InputError(
                f"{case.label}: {limit.name} must be above the static load with its losses, "
                f"{least:.6g} {limit.unit}, got {limit.bound:.6g} {limit.unit}"
            )


def modelled_bandwidth(data: PlantData, masses: int) -> float:
    """Return the frequency up to which `masses` hold every axial mode [rad/s]."""
    if data.one_spring:
        return math.inf
    lumped = data.lumped_axial_modes(masses)
    exact = data.axial_modes(lumped.size + 1)
    good = np.abs(lumped / exact[:-1] - 1.0) <= _HELD
    first_bad = int(np.argmin(good)) if not good.all() else lumped.size
    return float(exact[first_bad])
