r"""Forces of seabed, deck and water surface on the payload.

Forces on the payload beside those of rope and open water, as CasADi expressions that stand inside
the plant's right-hand side.  Coordinates are the plant's: P is the payload's displacement from
where it hangs at rest at the start, up positive; `below` says how far under the payload's
underside the seabed, the deck or the still water lies then.

Contact (seabed and deck) is a spring with a damper that grows with the penetration d,

    F = max(0, k d + b d' sqrt(d))   for d > 0, else 0

(University of Agder, MAS409 crane assignment): without a jump at touchdown, and never pulling.

The splash zone is the simplified method of DNV-RP-N103 for a prism that crosses the surface.  With
s in [0, 1] the submerged share, w', w'' the water's vertical velocity and acceleration, and v the
speed at which the surface comes up at the payload:

    -(1 - s) B                   buoyancy that is missing (the plant's weight is the submerged one)
    (s rho V + A33(h)) w''       Froude-Krylov, and the added mass with the water's acceleration
    A33(h) - A33                 added mass that is missing, from the plant's virtual mass
    s, P' - w'                   factor on the plant's quadratic drag, and the velocity it acts on
    (dA33/dh) v^2                slamming, while entering: v > 0

The added mass A33(h) of a prism immersed by h grows by rho A C_s / 2 for each metre until all of it
is there, so that a slam has the strength rho C_s A v^2 / 2 of the rule and ends when the water that
moves with the payload has its speed: force and added mass are one momentum.  Where C_s A is so
small that it would not be there at full immersion, it grows evenly over the height.  Leaving the
water has no such term.  The water's motion is that of the surface, decaying with depth as
exp(-k depth).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import ClassVar

import casadi as ca

from ..basics import GRAVITY, SEA_WATER_DENSITY, check_range

MotionSymbols = tuple[ca.SX, ca.SX, ca.SX]
"""Displacement, velocity and acceleration of a second body or of the surface."""

# sqrt(d) has no slope at touchdown; d / sqrt(d + this) has one, and is the same beyond a micron.
_SMALLEST_PENETRATION = 1e-12  # [m]

# Half the width over which the submerged share bends from one straight line into the next, of the
# prism's height: spray and run-up have no sharp edge either, and the integrator sees no kink.
_ROUNDING = 0.05

# The hardest landing that the step of the integrator is chosen for.
_HARDEST_LANDING = 2.0  # [m/s]


@dataclass(frozen=True, kw_only=True)
class Ground:
    """What the payload may touch, at a height `below` its underside at the start [m].

    The contact force has k [N/m] and b [N s/m^1.5].
    """

    name: ClassVar[str]
    below: float
    stiffness: float
    damping: float

    def __post_init__(self) -> None:
        check_range(self.name, "below", self.below, unit="m")
        check_range(self.name, "stiffness", self.stiffness, low=0.0, unit="N/m", open_low=True)
        check_range(self.name, "damping", self.damping, low=0.0, unit="N s/m^1.5")


@dataclass(frozen=True, kw_only=True)
class Seabed(Ground):
    """The seabed under the payload, which does not begin below it."""

    name = "seabed"
    stiffness: float = 1.8e6
    damping: float = 6.5e5

    def __post_init__(self) -> None:
        super().__post_init__()
        check_range("seabed", "below", self.below, low=0.0, unit="m")


@dataclass(frozen=True, kw_only=True)
class Deck(Ground):
    """The deck of a second vessel, or a fixed platform; it moves as the motion ``deck`` of the run.

    A payload that stands on it at the start has a negative `below`, the deck pressed in by that.
    """

    name = "deck"
    stiffness: float = 5e6
    damping: float = 2e6
    moving: bool = True


@dataclass(frozen=True, kw_only=True)
class SplashZone:
    """The water's surface, and the payload as a prism that crosses it."""

    name: ClassVar[str] = "water"
    #: Height of the payload's underside above still water at the start [m]; negative where it
    #: starts in the water, -`height` where it starts just submerged.
    below: float
    height: float  #: Height of the prism [m].
    buoyancy: float  #: Weight in air less submerged weight [N].
    #: Added mass A33 when submerged [kg], as it is in the plant's virtual mass.
    added_mass: float = 0.0
    #: A [m2] and C_s [-] of the slamming force: how fast the added mass grows.
    slamming_area: float = 0.0
    slamming_coefficient: float = 5.0
    water_density: float = SEA_WATER_DENSITY  #: rho [kg/m3].
    #: k of the decay with depth [1/m]; 0: the water at depth moves like the surface.
    wave_number: float = 0.0

    def __post_init__(self) -> None:
        owner = "splash zone"
        check_range(owner, "below", self.below, unit="m")
        for name, unit in (("height", "m"), ("water_density", "kg/m3")):
            check_range(owner, name, getattr(self, name), low=0.0, unit=unit, open_low=True)
        for name, unit in (
            ("buoyancy", "N"),
            ("added_mass", "kg"),
            ("slamming_area", "m2"),
            ("slamming_coefficient", ""),
            ("wave_number", "1/m"),
        ):
            check_range(owner, name, getattr(self, name), low=0.0, unit=unit)


@dataclass(frozen=True, kw_only=True, eq=False)
class SurroundingForces:
    """What the surroundings do to the payload, as expressions for the plant's equations."""

    force: ca.SX  #: Added to the forces on the payload, up positive [N].
    virtual_mass_change: ca.SX  #: Added to the payload's virtual mass [kg].
    drag_factor: ca.SX  #: Multiplies the plant's own drag [-].
    relative_velocity: ca.SX  #: The velocity that this drag acts on [m/s].
    #: Signals by name, in the order of :attr:`Surroundings.output_units`.
    outputs: Mapping[str, ca.SX]


@dataclass(frozen=True, kw_only=True)
class Surroundings:
    """Seabed or deck, and the water's surface; every part may be missing."""

    ground: Seabed | Deck | None = None
    water: SplashZone | None = None

    @property
    def motions(self) -> tuple[str, ...]:
        """Names of the motions that `build` needs: ``deck``, ``surface``."""
        deck = ("deck",) if isinstance(self.ground, Deck) and self.ground.moving else ()
        return (*deck, *(("surface",) if self.water is not None else ()))

    @property
    def parameters(self) -> Mapping[str, float]:
        """Numbers by dotted name, such as ``deck.stiffness``; `build` takes symbols for them."""
        return {
            f"{part.name}.{field.name}": float(getattr(part, field.name))
            for part in (self.ground, self.water)
            if part is not None
            for field in fields(part)
            if field.name != "moving"
        }

    @property
    def output_units(self) -> Mapping[str, str]:
        """Units of the signals that `build` returns, by name.

        ``contact.force`` [N] acts on the payload, up positive; ``contact.gap`` [m] is the
        payload's height above seabed or deck, negative in contact; ``contact.closing_speed``
        [m/s] is positive when they approach; ``water.force`` [N] is all that the water does but
        for drag and the added mass's resistance to the payload's own acceleration.
        """
        units: dict[str, str] = {}
        if self.ground is not None:
            units |= {"contact.force": "N", "contact.gap": "m", "contact.closing_speed": "m/s"}
        if isinstance(self.ground, Deck):
            units |= {"deck.displacement": "m", "deck.velocity": "m/s"}
        if self.water is not None:
            units |= {"water.force": "N", "water.surface": "m", "water.submergence": "-"}
        return units

    @property
    def rest_force(self) -> float:
        """Force on the payload at the start, P = 0, everything at rest [N].

        The plant hangs at rest with the submerged weight W at P = 0.  With these surroundings it
        does so with W - `rest_force` instead.
        """
        zero = ca.SX(0.0)
        still = dict.fromkeys(self.motions, (zero, zero, zero))
        return float(ca.DM(ca.evalf(self.build(zero, zero, still).force)))

    def stiffness_rates(self, payload_mass: float) -> tuple[float, ...]:
        """Return the fastest rates that contact adds to the plant [rad/s].

        Of a free payload of this mass [kg] on the contact's spring, sqrt(k/m), and of its damper,
        b sqrt(d)/m with d the penetration of a landing at 2 m/s onto the spring alone.  A rope
        that pulls from above is not in them.
        """
        contact = self.ground
        if contact is None:
            return ()
        rate = math.sqrt(contact.stiffness / payload_mass)
        sag = GRAVITY / rate**2
        deepest = sag + math.hypot(sag, _HARDEST_LANDING / rate)
        return (rate, contact.damping * math.sqrt(deepest) / payload_mass)

    def build(
        self,
        displacement: ca.SX,
        velocity: ca.SX,
        motions: Mapping[str, MotionSymbols],
        parameters: Mapping[str, ca.SX] | None = None,
    ) -> SurroundingForces:
        """Return the forces as expressions of the payload's P [m], P' [m/s] and :attr:`motions`.

        Those of :attr:`parameters` that have no symbols become constants.
        """
        p: dict[str, ca.SX] = {name: ca.SX(value) for name, value in self.parameters.items()}
        p |= parameters or {}
        force, outputs = ca.SX(0.0), dict[str, ca.SX]()
        mass_change, drag_factor, relative = ca.SX(0.0), ca.SX(1.0), velocity
        if self.ground is not None:
            name, still = self.ground.name, ca.SX(0.0)
            ground, ground_rate, _ = motions.get(name, (still, still, still))
            gap = displacement + p[f"{name}.below"] - ground
            closing = ground_rate - velocity
            contact = _contact_force(-gap, closing, p[f"{name}.stiffness"], p[f"{name}.damping"])
            force = force + contact
            outputs |= {
                "contact.force": contact,
                "contact.gap": gap,
                "contact.closing_speed": closing,
            }
            if isinstance(self.ground, Deck):
                outputs |= {"deck.displacement": ground, "deck.velocity": ground_rate}
        if self.water is not None:
            surface, surface_rate, surface_acceleration = motions["surface"]
            height = p["water.height"]
            depth = (surface - displacement - p["water.below"]) / height  # of the underside
            share = _rounded_ramp(depth) - _rounded_ramp(depth - 1.0)
            middle = height * (_rounded_ramp(depth) - 0.5 * share)  # of the submerged part
            decay = ca.exp(-p["water.wave_number"] * middle)
            relative = velocity - decay * surface_rate
            added, growth = _entering_mass(depth, p)
            mass_change, drag_factor = added - p["water.added_mass"], share
            missing = -(1.0 - share) * p["water.buoyancy"]
            moved = share * p["water.buoyancy"] / GRAVITY + added
            waves = moved * decay * surface_acceleration
            slamming = growth * ca.fmax(0.0, surface_rate - velocity) ** 2
            force = force + missing + waves + slamming
            outputs |= {
                "water.force": p["water.buoyancy"] + missing + waves + slamming,
                "water.surface": surface,
                "water.submergence": share,
            }
        return SurroundingForces(
            force=force,
            virtual_mass_change=mass_change,
            drag_factor=drag_factor,
            relative_velocity=relative,
            outputs=outputs,
        )


def _contact_force(penetration: ca.SX, rate: ca.SX, stiffness: ca.SX, damping: ca.SX) -> ca.SX:
    """Return max(0, k d + b d' sqrt(d)), with a finite slope at d = 0."""
    deep = ca.fmax(0.0, penetration)
    root = deep / ca.sqrt(deep + _SMALLEST_PENETRATION)
    return ca.fmax(0.0, stiffness * deep + damping * rate * root)


def _rounded_ramp(x: ca.SX) -> ca.SX:
    """Return max(0, x) with its corner rounded by a parabola over +-_ROUNDING."""
    within = ca.fmin(ca.fmax(x, -_ROUNDING), _ROUNDING)
    return (within + _ROUNDING) ** 2 / (4.0 * _ROUNDING) + ca.fmax(0.0, x - _ROUNDING)


def _ramp_slope(x: ca.SX) -> ca.SX:
    """Return the slope of :func:`_rounded_ramp`."""
    return ca.fmin(ca.fmax((x + _ROUNDING) / (2.0 * _ROUNDING), 0.0), 1.0)


def _entering_mass(depth: ca.SX, p: Mapping[str, ca.SX]) -> tuple[ca.SX, ca.SX]:
    """Return the added mass A33(h) [kg] and dA33/dh [kg/m] of a prism that enters the water.

    `depth` is h over the prism's height.  The growth begins and ends over the same rounded corners
    as the submerged share, of which it is the exact slope.
    """
    whole, height = p["water.added_mass"], p["water.height"]
    area = p["water.slamming_coefficient"] * p["water.slamming_area"]
    rate = ca.fmax(0.5 * p["water.water_density"] * area, whole / height)
    until = whole / ca.fmax(rate * height, 1e-9)  # no mass and no area: nothing grows
    added = rate * height * (_rounded_ramp(depth) - _rounded_ramp(depth - until))
    return added, rate * (_ramp_slope(depth) - _ramp_slope(depth - until))
