"""The physical numbers that the plant is made of, and nothing else.

A case knows drum layers, shapes and units of input; the plant needs the radius, the mass and
the drag that come out of them.  `PlantData.from_case` is the one place where the two meet, so
that the symbolic plant, the exact rope and the tests share one flat list of numbers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from ..basics import ComplexArray, FloatArray, InputError, check_range, read_only
from .rope import (
    MAX_MASSES,
    fixed_top_modes,
    lump_rope,
    lumped_modes,
    skin_drag_share,
    zener_branches,
)

if TYPE_CHECKING:
    from ..case import Case

# Without a design there is no crossover yet.  A loop through a rope and a motor seldom
# crosses above 8 rad/s; five times that is what `masses: auto` holds until told better.
DEFAULT_BANDWIDTH = 40.0  # [rad/s]
MODE_TOLERANCE = 0.05  # a mode is "in the model" if its frequency is met this well [-]
# Pieces of rope h meet waves so well up to omega h / c of this, where sin(x/2) / (x/2) = 0.95.
_PIECE = 1.1
_STIFFER = 1e-4  # relative, of a difference for the rope's share of a mode
_ITERATIONS = 4  # each wins the damping ratio's power: 1e-10 for one per cent


@dataclass(frozen=True, kw_only=True)
class PlantData:
    """Numbers of rope, payload, winch and sensors, in SI units.

    Notes
    -----
    Nothing is checked here: the numbers come from a case (`from_case`), which has checked them.
    """

    #: EA [N], its real part at the first axial mode, length paid out [m], mass per length [kg/m];
    #: with falls of all of them together.
    axial_stiffness: float
    rope_length: float
    mass_per_length: float
    rope_weight: float = 0.0  #: Submerged weight of the rope per length [N/m].
    #: Parallel parts of rope: the tension at the drum is that of one of them [-].
    falls: float = 1.0
    #: Tension behind the sheaves over that before them where the rope runs [-].
    sheaves_efficiency: float = 1.0
    damping_ratio: float = 0.002  #: Fraction of critical damping of the first axial mode [-].
    #: ``kelvin-voigt``: the fraction rises with a mode's frequency; ``hysteretic``: all modes have
    #: the same, see `zener_branches`.
    damping_law: str = "kelvin-voigt"
    #: Masses along the rope, the payload's included, 1 to 40; None: chosen for 40 rad/s.
    masses: int | None = None
    lumping: str = "distributed"  #: ``distributed`` or ``thesis``, see `lump_rope`.
    #: Of the crane's tip, in series with the rope's upper end [N/m]; infinite: rigid.
    tip_stiffness: float = math.inf
    #: Of the slings below the rope [N/m], infinite: rigid; mass [kg] and submerged weight [N] of
    #: the hook block between the two.
    sling_stiffness: float = math.inf
    block_mass: float = 0.0
    block_weight: float = 0.0
    #: Mass with added mass [kg], submerged weight [N].
    payload_mass: float
    payload_weight: float
    #: q = 1/2 rho C_D A of the drag force q v|v| [N s2/m2], the rope's share of it included
    #: (`skin_drag_share`), as a linear plant has it.
    quadratic_drag: float = 0.0
    #: 1/2 rho C_t pi d of the drag along the rope, per length, of all falls [N s2/m3].
    skin_drag: float = 0.0
    #: r, what the load moves with a radian of the drum [m] (with one fall the radius to the rope's
    #: centre, else that over the falls), n motor over drum [-], eta in (0, 1] [-].
    drum_radius: float
    gear_ratio: float
    gear_efficiency: float = 1.0
    #: I [kg m2] and B [N m s/rad], everything referred to the motor shaft.
    inertia: float
    viscous_friction: float = 0.0
    #: Dry friction T_c [N m] at the motor shaft, T_c tanh(speed / friction_speed [rad/s]).  In a
    #: linear plant it is part of `LinearPlant.loss` alone.
    coulomb_friction: float = 0.0
    friction_speed: float = 1.0
    #: Whether the losses switch with the direction in what a linear plant says of rest; else it is
    #: hauling, without dry friction.
    switching: bool = True
    #: ``dc``: command is the armature voltage.  ``ac``: command is the speed reference [rad/s] if
    #: `speed_gain` is above zero, else the torque demand [N m].
    motor: str = "dc"
    #: DC motor: R [ohm], K_T [N m/A], K_omega [V s/rad], L [H].  The torque constant of an AC motor
    #: is one: its current is its torque.
    resistance: float = math.nan
    torque_constant: float = 1.0
    back_emf_constant: float = 0.0
    inductance: float = 0.0
    #: AC motor: bandwidth of the torque loop [rad/s], inf for none; gain of the drive's speed
    #: regulator [N m s/rad].
    torque_bandwidth: float = math.inf
    speed_gain: float = 0.0
    #: Second-order Butterworth low-passes on the payload's signals [rad/s], inf for none.
    sensor_bandwidth: float = math.inf
    telemetry_bandwidth: float = math.inf
    delay: float = 0.0  #: Delay of the payload's signals [s].
    #: Delay from the command to the drive [s], which a linear plant has in its measurements.
    command_delay: float = 0.0

    @property
    def payload_drag(self) -> float:
        """The payload's own q [N s2/m2]: the rope has its own where it moves."""
        if self.skin_drag == 0.0:
            return self.quadratic_drag
        return self.quadratic_drag - self.lumped_skin_drag

    @property
    def lumped_skin_drag(self) -> float:
        """The q that does as much to the first mode at the load as the rope's drag [N s2/m2]."""
        load = self.payload_mass + self.block_mass
        share: Any = skin_drag_share(np.asarray(self.rope_mass / load))[()]
        found: float = self.skin_drag * self.rope_length * share
        return found

    @property
    def stiffness(self) -> float:
        """K = EA/L of the rope paid out [N/m]."""
        return self.axial_stiffness / self.rope_length

    @property
    def rope_mass(self) -> float:
        """Mass of the rope paid out [kg]."""
        return self.mass_per_length * self.rope_length

    @property
    def static_tension(self) -> float:
        """Tension below the sheaves at rest, of each fall [N]."""
        return self.hung_weight / self.falls

    @property
    def hung_weight(self) -> float:
        """Weight of payload, hook block and rope, submerged [N]."""
        return self.payload_weight + self.block_weight + self.rope_weight * self.rope_length

    @property
    def chain_compliance(self) -> float:
        """Of tip, rope and slings in series, at rest [m/N]."""
        rope = self.rope_length / self.slow_stiffness
        return 1.0 / self.tip_stiffness + rope + 1.0 / self.sling_stiffness

    @property
    def first_mode(self) -> float:
        """First exact axial mode of the rope with its load on a rigid rig [rad/s].

        Where the rope's damping is told: a property of the rope, whatever crane it hangs from.
        """
        rope = (self.axial_stiffness, self.rope_length, self.mass_per_length)
        return float(fixed_top_modes(*rope, self.payload_mass + self.block_mass, 1)[0])

    @property
    def one_spring(self) -> bool:
        """Whether the rope has no modes of its own: massless, or lumped as in the thesis."""
        return self.lumping == "thesis" or self.mass_per_length == 0.0

    @property
    def hung_mass(self) -> float:
        """Mass that moves in the first mode, about [kg]: load, hook block, a share of the rope."""
        return self.payload_mass + self.block_mass + self.rope_share * self.rope_mass

    @property
    def rope_share(self) -> float:
        """Share of the rope that moves with the load in the first mode, about [-].

        A third, or all of it with the lumping of the thesis.
        """
        return 1.0 if self.lumping == "thesis" else 1.0 / 3.0

    def axial_modes(self, count: int) -> FloatArray:
        """Return exact axial modes of the chain, the vessel held, from the lowest [rad/s].

        As many as there are, where the rope has none of its own (`one_spring`).
        """
        if self.lumping == "thesis":
            return self.lumped_axial_modes(1, "thesis")[:count]
        if self.one_spring:
            both = self.block_mass > 0.0 and not math.isinf(self.sling_stiffness)
            count = min(count, 2 if both else 1)
        rope = (self.axial_stiffness, self.rope_length, self.mass_per_length)
        return fixed_top_modes(*rope, self.payload_mass, count, **self._rig)

    def lumped_axial_modes(self, masses: int, lumping: str = "distributed") -> FloatArray:
        """Return the axial modes of the chain with so many rope masses [rad/s]."""
        rope = (self.axial_stiffness, self.rope_length, self.mass_per_length)
        return _lumped_modes(masses, lumping, *rope, self.payload_mass, **self._rig)

    @property
    def _rig(self) -> dict[str, float]:
        return {
            "tip_stiffness": self.tip_stiffness,
            "sling_stiffness": self.sling_stiffness,
            "block_mass": self.block_mass,
        }

    @property
    def damping_time(self) -> float:
        """Kelvin-Voigt time tau of the rope, EA (strain + tau strain rate) [s].

        tau = 2 zeta / omega_1, so that the first exact axial mode with the upper end held has
        the fraction zeta of critical damping; higher modes have zeta omega_j / omega_1.  Zero for
        a hysteretic rope, whose damping is all in its `branches`.
        """
        if self.damping_law == "hysteretic":
            return 0.0
        return 2.0 * self.damping_ratio / self.first_mode

    @cached_property
    def branches(self) -> tuple[float, FloatArray, FloatArray]:
        """k_0, k_j and tau_j [s] of EA(s) = EA (k_0 + sum_j k_j s tau_j / (1 + s tau_j)).

        Those of `zener_branches` for a hysteretic rope; one, and none, for another.
        """
        if self.damping_law != "hysteretic":
            return 1.0, np.zeros(0), np.zeros(0)
        first = self.first_mode
        highest = float(self.highest_mode(first))
        slow, gains, times = _kept_branches(self.damping_ratio, first, highest)
        there = gains[:, 0] > 0.0
        return float(slow[0]), gains[there, 0], times[there, 0]

    def highest_mode(self, first_mode: FloatArray | float) -> FloatArray | float:
        """Return up to where a hysteretic rope's loss factor must hold [rad/s].

        The modes below 40 rad/s, which `masses: auto` holds, and those that more masses hold
        where the data give their number; never less than the first mode.  A property of the rope
        and not of its lumping: a design on other masses has the same rope.
        """
        held = 0.0
        if self.masses is not None and self.lumping != "thesis":
            pieces = self.masses - 0.5
            held = (
                _PIECE
                * pieces
                * np.sqrt(self.axial_stiffness / np.maximum(self.mass_per_length, 1e-300))
                / self.rope_length
            )
        return np.maximum(first_mode, np.maximum(held, DEFAULT_BANDWIDTH))

    @property
    def slow_stiffness(self) -> float:
        """EA_0 of a slow pull [N]: the rope at rest; that of a Kelvin-Voigt rope is EA."""
        return self.branches[0] * self.axial_stiffness

    def rope_modulus(self, s: ComplexArray) -> ComplexArray:
        """Return EA(s) of the rope's damping law [N], as `s` [1/s]."""
        return self.axial_stiffness * self.modulus_ratio(s)

    def modulus_ratio(self, s: ComplexArray) -> ComplexArray:
        """Return EA(s)/EA of the rope's damping law, as `s` [1/s]."""
        slow, gains, times = self.branches
        found = slow + s * self.damping_time
        for gain, time in zip(gains, times, strict=True):
            found = found + gain * (s * time / (1.0 + s * time))
        return found

    def damped_modes(self, count: int) -> ComplexArray:
        """Return the poles [1/s] that the rope's damping makes of `axial_modes`.

        To first order in the damping for Kelvin-Voigt; for a hysteretic rope by iterating s =
        i omega sqrt(EA(s)/EA), whose stiffness follows the frequency as well.  Of what tip and
        slings store of a mode's energy nothing is lost: the rope's share is 2 dln omega/dln EA.
        """
        modes = self.axial_modes(count)
        share: FloatArray | float = 1.0
        if not (math.isinf(self.tip_stiffness) and math.isinf(self.sling_stiffness)):
            stiffer = replace(self, axial_stiffness=self.axial_stiffness * (1.0 + _STIFFER))
            share = 2.0 * np.log(stiffer.axial_modes(count) / modes) / math.log1p(_STIFFER)
        if self.damping_law != "hysteretic":
            return np.asarray(-0.5 * self.damping_time * share * modes**2 + 1j * modes)
        s = np.asarray(1j * modes)
        for _ in range(_ITERATIONS):
            s = 1j * modes * np.sqrt(self.modulus_ratio(s)) ** share
        return np.asarray(s)

    @property
    def viscous(self) -> PlantData:
        """The same rope with Kelvin-Voigt damping of the same ratio at the first mode."""
        return replace(self, damping_law="kelvin-voigt")

    @property
    def mean_gear_factor(self) -> float:
        """(1/eta + eta)/2: what one newton of rope costs the motor, mean of both ways [-].

        The motor feels 1/eta of the load's torque when it hauls and eta of it when the load
        drives it, eta being that of gear and sheaves.  A linear plant has one factor; the mean of
        both meets the work of a cycle.
        """
        return _mean_of_ways(self.gear_efficiency * self.sheaves_efficiency)

    @property
    def switching_torque(self) -> float:
        """What losses that switch come to at the motor to either side of their mean [N m]."""
        eta = self.gear_efficiency * self.sheaves_efficiency
        held = self.hung_weight * self.drum_radius / self.gear_ratio
        return held * (1.0 / eta - self.mean_gear_factor) + self.coulomb_friction

    def torque_per_command(self, s: ComplexArray) -> ComplexArray:
        """Return the torque per command of a motor that stands, at points `s` [1/s], (k,)."""
        if self.motor == "dc":
            return np.asarray(self.torque_constant / (self.resistance + self.inductance * s))
        # An infinite bandwidth has no lag.
        return np.asarray((self.speed_gain or 1.0) / (1.0 + s / self.torque_bandwidth))

    @property
    def mean_sheaves_factor(self) -> float:
        """Rope tension at the drum over that below the sheaves, mean of both ways [-]."""
        return _mean_of_ways(self.sheaves_efficiency)

    @property
    def per_torque(self) -> dict[str, float]:
        """What a torque at the motor's shaft makes of the signals of the drive at rest, by name."""
        found = {"motor.torque": 1.0, "motor.current": 1.0 / self.torque_constant}
        if self.motor == "dc":
            found["motor.voltage"] = self.resistance / self.torque_constant
        return found

    def chosen_masses(self, masses: int | None = None) -> int:
        """Return `masses`, or the number in the data, or the one that holds 40 rad/s."""
        if masses is not None:
            return int(check_range("plant", "masses", masses, low=1, high=MAX_MASSES))
        if self.masses is not None:
            return self.masses
        return masses_for_bandwidth(self, DEFAULT_BANDWIDTH)

    @classmethod
    def from_case(cls, case: Case) -> PlantData:
        """Return the numbers of a case: radius of the layer in use, virtual mass, drag.

        Raises InputError if the drum does not hold the rope that is paid out.
        """
        rope, payload, winch, sensors = case.rope, case.payload, case.winch, case.sensors
        motor = winch.motor
        kept: tuple[str, ...] = ("torque_bandwidth", "speed_gain")
        if motor.type == "dc":
            kept = ("resistance", "torque_constant", "back_emf_constant", "inductance")
        bandwidth, telemetry = sensors.payload.bandwidth, sensors.telemetry
        found = cls(
            axial_stiffness=rope.falls * rope.ea,
            rope_length=rope.length,
            mass_per_length=rope.falls * rope.mass_per_length,
            rope_weight=rope.submerged_weight / rope.length,
            falls=float(rope.falls),
            sheaves_efficiency=rope.sheaves_efficiency,
            damping_ratio=rope.damping_ratio,
            damping_law=rope.damping_law,
            masses=None if rope.masses == "auto" else rope.masses,
            lumping=rope.lumping,
            tip_stiffness=case.crane.stiffness,
            sling_stiffness=case.rigging.sling_stiffness,
            block_mass=case.rigging.block_mass,
            block_weight=case.rigging.block_weight,
            payload_mass=payload.virtual_mass,
            payload_weight=payload.submerged_weight,
            quadratic_drag=payload.quadratic_drag,
            skin_drag=0.5 * payload.water_density * rope.skin_drag_area,
            drum_radius=case.haul_radius,
            gear_ratio=winch.gearbox.ratio,
            gear_efficiency=winch.gearbox.efficiency,
            inertia=winch.inertia,
            viscous_friction=winch.viscous_friction,
            coulomb_friction=motor.coulomb_friction,
            friction_speed=motor.friction_speed,
            switching=winch.losses == "switching",
            motor=motor.type,
            **{name: getattr(motor, name) for name in kept},
            sensor_bandwidth=math.inf if isinstance(bandwidth, str) else bandwidth,
            telemetry_bandwidth=math.inf if telemetry.bandwidth is None else telemetry.bandwidth,
            delay=telemetry.delay,
            command_delay=winch.drive.command_delay,
        )
        if not np.any(found.skin_drag):
            return found
        return replace(found, quadratic_drag=found.quadratic_drag + found.lumped_skin_drag)


@lru_cache(maxsize=256)
def _lumped_modes(masses: int, lumping: str, *rope: float, **rig: float) -> FloatArray:
    """Return `lumped_modes`, the same array if asked again: few masses are tried at every look."""
    return read_only(lumped_modes(lump_rope(masses, lumping), *rope, **rig))


def _mean_of_ways(efficiency: float) -> float:
    """Return the mean of hauling in, 1/efficiency, and paying out, efficiency."""
    return 0.5 * (1.0 / efficiency + efficiency)


def as_plant_data(source: Case | PlantData) -> PlantData:
    """Return `source` itself, or the numbers of a case."""
    return source if isinstance(source, PlantData) else PlantData.from_case(source)


def masses_for_bandwidth(data: PlantData, omega_max: float) -> int:
    """Return the fewest masses that hold every axial mode below `omega_max` [rad/s].

    The rule: each exact mode (upper end held) below `omega_max` has its counterpart of the
    same number in the lumped rope within 5 % of its frequency.  At least two masses, as one
    has no second mode even to miss; a ``thesis`` lumping with its number of masses given is
    left as it is.

    Raises InputError if more than 40 masses would be needed.
    """
    if data.lumping == "thesis" and data.masses is not None:
        return data.masses
    if data.mass_per_length == 0.0:
        return 2
    # the modes' spacing tends to pi c / L from below
    wave_speed = math.sqrt(data.axial_stiffness / data.mass_per_length)
    count = int(omega_max * data.rope_length / (math.pi * wave_speed)) + 2
    slings = 0 if math.isinf(data.sling_stiffness) else 1  # one more mode than the rope's
    if count <= 2 * MAX_MASSES:
        exact = data.axial_modes(count + slings)
        exact = exact[exact < omega_max]
        for n in range(max(2, exact.size - slings), MAX_MASSES + 1):
            lumped = data.lumped_axial_modes(n, data.lumping)[: exact.size]
            if np.all(np.abs(lumped / exact - 1.0) <= MODE_TOLERANCE):
                return n
    raise InputError(
        f"rope: {MAX_MASSES} masses do not hold the {count - 1} or so axial modes that lie below "
        f"{omega_max:.4g} rad/s on {data.rope_length:g} m of rope; a loop as fast as that cannot "
        "be designed on a lumped rope: lower its bandwidth or set rope.masses"
    )


_kept_branches = lru_cache(maxsize=64)(zener_branches)  # of one rope, whatever else differs
