"""What follows from a case before any controller is thought of: rope, payload, waves and winch.

    case -> stiffness, masses, modes and their place among the waves, drag, tensions, drive
         -> SystemFacts

Numbers, in SI, of what `stillhook check` and a report tell.  Everything is at rest or with the drum
held; nothing of it is a matter of gains.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from models.case import Case
from models.hook import HookDemand, HookMotion
from models.plant import PlantData

from .held import held_modes, uncompensated

_MODES = 3  # of the chain that are told of
_STANDS = 1e-9  # of a pole's size: an imaginary part that is none

#: Where a mode lies: below the band of the waves, in it, or above it.
Place = Literal["below", "in", "above"]


@dataclass(frozen=True, kw_only=True, eq=False)
class WaveBand:
    """Where the hook's motion has its energy."""

    #: Frequencies between which 90 % of the variance of the hook's displacement lies [rad/s].
    low: float
    high: float
    peak: float  #: Frequency at which the density of its displacement is highest [rad/s].


@dataclass(frozen=True, kw_only=True, eq=False)
class AxialMode:
    """A mode of tip, rope, slings and payload with the drum held."""

    number: int  #: Its number, 1 is the lowest.
    #: Natural frequency without damping [rad/s], and its period [s].
    frequency: float
    period: float
    #: Fraction of critical damping, of rope and drag [-]; 1 where drag keeps it from swinging.
    damping_ratio: float
    place: Place  #: Where the natural frequency lies: below the waves' band, in it or above it.
    #: Density of the hook's displacement there over its largest [-].
    relative_density: float


@dataclass(frozen=True, kw_only=True, eq=False)
class RopeFacts:
    """Springs and masses below the drum.

    Tip, rope and slings are springs in series, one below the other (DNV-RP-N103).
    """

    falls: int  #: Parallel parts of rope.
    axial_stiffness: float  #: EA of each of them [N].
    stiffness: float  #: K = EA/L of all of them [N/m].
    #: Of the crane's tip and of the slings [N/m]; infinite: rigid.
    tip_stiffness: float
    sling_stiffness: float
    series_stiffness: float  #: Of tip, rope and slings in series [N/m].
    #: Shares of the tip and of the slings in the stretch of one force through all of them [-].
    tip_share: float
    sling_share: float
    #: Of the payload in air, its added mass, the hook block and all of the rope [kg].
    payload_mass: float
    added_mass: float
    block_mass: float
    rope_mass: float
    rope_share: float  #: Share of the rope's mass that moves with the payload in one spring [-].
    moving_mass: float  #: M: payload, added mass, block and the share of the rope [kg].
    #: Stretch at rest [m], by which the load hangs lower than it would on a rigid chain, and what
    #: of it is the rope's, the tip's and the slings'.  The rope stretches by what hangs on it and
    #: by half its own weight.
    stretch: float
    rope_stretch: float
    tip_stretch: float
    sling_stretch: float
    travel_time: float  #: Time of an axial wave from end to end, L sqrt(m/EA) [s].


@dataclass(frozen=True, kw_only=True, eq=False)
class HeldFacts:
    """The payload's motion with the drum held."""

    #: Linear drag coefficient [N s/m], and how it is found: ``given``, of equal ``energy`` in a
    #: given sine, or ``stochastic``, consistent with the payload's own speed in the sea.
    drag: float
    drag_method: str
    #: Standard deviations of payload and hook [m], and the first over the second [-], no number in
    #: a sea that does not move the hook.  Infinite where nothing damps the payload.
    payload_rms: float
    hook_rms: float
    factor: float


@dataclass(frozen=True, kw_only=True, eq=False)
class WinchFacts:
    """What the winch holds at rest, and what following the hook would ask of it."""

    drum_radius: float  #: To the rope's centre, rope paid out [m].
    #: Tension at the drum at rest, of each fall [N]: mean of hauling in and paying out over the
    #: sheaves, as the lightest load is paid out, and as the stated one is hauled in.
    drum_tension: float
    drum_tension_least: float
    drum_tension_hauling: float
    #: Tension at the load at rest [N], of the stated weight and of the least.
    load_tension: float
    load_tension_least: float
    #: `drum_tension_hauling` over what the rope may carry [-], and what is to stay in all falls
    #: together [N]; None without a limit.
    tension_share: float | None
    tension_to_stay: float | None
    #: Motor torque that hauls the load at rest, losses included [N m], over its rating and peak.
    static_torque: float
    rating_share: float
    peak_share: float
    rope_speed: float  #: Fastest speed of the rope at the drum [m/s].
    #: Most probable largest speed of the hook in the exposure time [m/s], and that of the rope that
    #: follows it over the fastest [-].
    hook_speed: float
    speed_share: float
    #: Of everything that turns, at the motor's shaft [kg m2], and as a mass that moves with the
    #: load [kg].
    inertia: float
    equivalent_mass: float
    #: Power of the drive that follows the hook: static tension at that speed, with losses [W].
    following_power: float


@dataclass(frozen=True, kw_only=True, eq=False)
class SystemFacts:
    """What follows from a case, in numbers."""

    rope: RopeFacts
    modes: tuple[AxialMode, ...]  #: From the lowest; one spring has one.
    waves: WaveBand
    held: HeldFacts
    winch: WinchFacts


def system_facts(case: Case, hook: HookMotion | None = None) -> SystemFacts:
    """Return what follows from a case: rope, payload, waves and winch, in numbers.

    The hook's motion is that of the case, unless it is known already.

    Examples
    --------
    The 1975 thesis's first case: one spring of 80 kN/m below the band of its waves.

    >>> from models import load_case
    >>> facts = system_facts(load_case("thesis-1975"))
    >>> (mode,) = facts.modes
    >>> round(mode.frequency**2, 3), round(mode.damping_ratio, 4), mode.place
    (0.89, 0.007, 'in')
    """
    hook = HookMotion.from_case(case) if hook is None else hook
    data = PlantData.from_case(case)
    drag, rms = uncompensated(case, data, hook)
    low, high = hook.energetic_band
    waves = WaveBand(low=low, high=high, peak=hook.peak_frequency)
    moves = hook.displacement.rms
    return SystemFacts(
        rope=_rope(case, data),
        modes=_modes(data, drag, hook, waves),
        waves=waves,
        held=HeldFacts(
            drag=drag,
            drag_method=case.payload.drag.method,
            payload_rms=rms,
            hook_rms=moves,
            factor=rms / moves if moves > 0.0 else math.nan,
        ),
        winch=_winch(case, data, hook),
    )


def _rope(case: Case, data: PlantData) -> RopeFacts:
    rope, payload, rigging = case.rope, case.payload, case.rigging
    hung = payload.submerged_weight + rigging.block_weight
    # Of the load's weight, and half the rope's own; of tip and slings by what hangs on them.
    rope_stretch = (hung + 0.5 * rope.submerged_weight) / rope.stiffness
    tip_stretch = case.hung_weight / case.crane.stiffness
    sling_stretch = payload.submerged_weight / rigging.sling_stiffness
    return RopeFacts(
        falls=rope.falls,
        axial_stiffness=rope.ea,
        stiffness=rope.stiffness,
        tip_stiffness=case.crane.stiffness,
        sling_stiffness=rigging.sling_stiffness,
        series_stiffness=case.chain_stiffness,
        tip_share=case.chain_stiffness / case.crane.stiffness,
        sling_share=case.chain_stiffness / rigging.sling_stiffness,
        payload_mass=payload.mass,
        added_mass=payload.hydrodynamic_mass,
        block_mass=rigging.block_mass,
        rope_mass=rope.mass,
        rope_share=data.rope_share,
        moving_mass=case.moving_mass,
        stretch=rope_stretch + tip_stretch + sling_stretch,
        rope_stretch=rope_stretch,
        tip_stretch=tip_stretch,
        sling_stretch=sling_stretch,
        travel_time=rope.travel_time,
    )


def _modes(
    data: PlantData, drag: float, hook: HookMotion, waves: WaveBand
) -> tuple[AxialMode, ...]:
    frequencies = data.axial_modes(_MODES)
    poles = held_modes(data, drag, frequencies.size)
    swings = poles.imag > _STANDS * np.abs(poles)
    ratios = np.where(swings, -poles.real / np.abs(poles), 1.0)
    largest = float(hook.density(np.array([waves.peak]))[0])
    densities = hook.density(frequencies) / (largest or 1.0)
    return tuple(
        AxialMode(
            number=number,
            frequency=frequency,
            period=2.0 * math.pi / frequency,
            damping_ratio=ratio,
            place=_place(frequency, waves),
            relative_density=density,
        )
        for number, frequency, ratio, density in zip(
            range(1, frequencies.size + 1),
            frequencies.tolist(),
            ratios.tolist(),
            densities.tolist(),
            strict=True,
        )
    )


def _place(frequency: float, waves: WaveBand) -> Place:
    if frequency < waves.low:
        return "below"
    return "above" if frequency > waves.high else "in"


def _winch(case: Case, data: PlantData, hook: HookMotion) -> WinchFacts:
    winch, payload, drive = case.winch, case.payload, case.winch.drive
    lightest = case.hung_weight - payload.submerged_weight + payload.least_weight
    allowed = case.limits.rope_tension_peak
    hauling, torque = case.static_tension_budget, case.static_torque_budget
    rope_speed = winch.speed_limit * case.drum_radius / winch.gearbox.ratio
    demand = HookDemand.from_case(case, hook=hook)
    fastest = demand.velocity.most_probable_maximum(demand.duration)
    return WinchFacts(
        drum_radius=case.drum_radius,
        drum_tension=data.mean_sheaves_factor * case.static_tension,
        drum_tension_least=lightest / case.rope.falls * case.rope.sheaves_efficiency,
        drum_tension_hauling=hauling,
        load_tension=payload.submerged_weight,
        load_tension_least=payload.least_weight,
        tension_share=None if allowed is None else hauling / allowed,
        tension_to_stay=case.least_tension,
        static_torque=torque,
        rating_share=torque / drive.torque_continuous,
        peak_share=torque / drive.torque_peak,
        rope_speed=rope_speed,
        hook_speed=fastest,
        speed_share=fastest * case.rope.falls / rope_speed,
        inertia=winch.inertia,
        equivalent_mass=winch.inertia * (winch.gearbox.ratio / case.haul_radius) ** 2,
        following_power=demand.drive_power,
    )
