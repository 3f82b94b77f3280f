"""The equation of motion of a floating body: `Hydrodynamics` and `FloatingBody`.

    [ -omega^2 (M + A) + i omega (B + B_roll) + C ] x = F,      time factor e^{+i omega t}

Second half of the way from a hull to its RAOs, and what stands between a file of hydrodynamic
coefficients and `VesselRaos`.  Coefficients are smooth over frequency while motions are not, so
they may be computed on few frequencies and the motions on many.

Potential theory knows no friction and no eddies, without which a ship would roll several times
as far at its natural period.  They come in as a linear moment against the roll rate, a fraction
of the critical damping

    B_c = 2 sqrt((I_44 + A_44) C_44),

about the centre of gravity, A_44 at the natural frequency of roll.  It is a couple, and so the
same about any point.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from ...basics import (
    GRAVITY,
    SEA_WATER_DENSITY,
    ComplexArray,
    FloatArray,
    InputError,
    ReadOnlyArrays,
    check_ascending,
    check_range,
)
from ..crane import Point
from ..raos import MIRRORED, MODES
from ..symmetry import joined
from .hydrostatics import moved, undamped_period

_ROLL = MODES.index("roll")
_SAME = 1e-6  # rad from ahead or astern


@dataclass(frozen=True, kw_only=True)
class NaturalPeriods:
    """Undamped natural periods of the uncoupled motions about the centre of gravity [s]."""

    heave: float
    roll: float
    pitch: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Hydrodynamics(ReadOnlyArrays):
    """Coefficients of a body in waves, about one point."""

    omega: FloatArray  #: Frequencies (k,) [rad/s], strictly ascending.
    #: Where the waves travel towards (h,) [rad], strictly ascending in [0, 2 pi).
    heading: FloatArray
    #: (k, 6, 6), from motion (last axis) to force [kg, kg m, kg m2] and the same per second.
    added_mass: FloatArray
    damping: FloatArray
    #: Wave force per metre of amplitude (k, h, 6), phase against the elevation at the frame's
    #: origin, time factor e^{+i omega t} [N/m, N].
    excitation: ComplexArray
    point: Point = (0.0, 0.0, 0.0)  #: The point about which they hold [m].
    #: Of the water [m], [kg/m3].
    depth: float = math.inf
    density: float = SEA_WATER_DENSITY

    def __post_init__(self) -> None:
        """Check shapes and numbers, make arrays read-only."""
        owner = "hydrodynamics"
        omega = check_ascending(owner, "omega", self.omega)
        heading = check_ascending(owner, "heading", self.heading)
        k, h = omega.size, heading.size
        shapes = {"added_mass": (k, 6, 6), "damping": (k, 6, 6), "excitation": (k, h, 6)}
        for name, shape in shapes.items():
            found = np.asarray(getattr(self, name))
            if found.shape != shape or not np.all(np.isfinite(found)):
                raise InputError(
                    f"{owner}: {name} must be finite numbers of shape {shape}, got {found.shape}"
                )
        super().__post_init__()

    def resampled(self, omega: npt.ArrayLike) -> Hydrodynamics:
        """Return the coefficients at other frequencies (n,) [rad/s], by cubic splines.

        Raises InputError if a frequency lies outside the table.
        """
        from scipy.interpolate import CubicSpline  # here: whoever reads RAOs needs none of it

        wanted = np.atleast_1d(check_ascending("hydrodynamics", "omega", np.asarray(omega)))
        low, high = float(self.omega[0]), float(self.omega[-1])
        slack = 1e-9 * high
        check_range("hydrodynamics", "omega", wanted[0], low=low - slack, unit="rad/s")
        check_range("hydrodynamics", "omega", wanted[-1], high=high + slack, unit="rad/s")
        at = np.clip(wanted, low, high)
        return replace(
            self,
            omega=wanted,
            added_mass=CubicSpline(self.omega, self.added_mass)(at),
            damping=CubicSpline(self.omega, self.damping)(at),
            excitation=CubicSpline(self.omega, self.excitation)(at),
        )

    def energy_error(self, roll_damping: float = 0.0) -> float:
        """Return how far waves made and waves felt are from belonging together [-].

        By Haskind and Newman (Newman, J. Ship Res. 6, 1962) the damping by radiated waves follows
        from the wave forces of all headings, in deep water

            B_ii = k / (8 pi rho g c_g) integral of |F_i|^2 over headings,

        while here one comes from radiation and the other from diffraction: their difference is that
        of the panels from a smooth hull.  The largest is returned of heave, roll and pitch, over
        the largest damping of that motion.  Headings must be all round; frequencies whose forces
        turn too fast with heading are left out.  `roll_damping` is what roll has beside that of the
        waves [N m s], part of what it is measured by.
        """
        step = np.diff(self.heading)
        if self.heading.size < 8 or np.ptp(step) > 1e-6 or math.isfinite(self.depth):
            return math.nan
        count = round(2.0 * math.pi / float(step[0]))
        if count != self.heading.size:
            return math.nan
        # Forces turn with heading as fast as the ends of the hull are apart in waves: of |F|^2 the
        # sum over headings is exact while k L is below their number, and L is some 4.5 arms of
        # pitch.
        lever = np.sqrt(self.added_mass[:, 4, 4] / np.maximum(self.added_mass[:, 2, 2], 1e-30))
        k = self.omega**2 / GRAVITY
        fits = k * 4.5 * lever < count
        if not np.any(fits):
            return math.nan
        group = GRAVITY / (2.0 * self.omega)
        squared = (np.abs(self.excitation) ** 2).mean(axis=1) * 2.0 * math.pi
        wanted = (k / (8.0 * math.pi * self.density * GRAVITY * group))[:, None] * squared
        found = np.einsum("kii->ki", self.damping)
        worst = 0.0
        for mode in (2, _ROLL, 4):
            size = float(np.abs(wanted[fits, mode]).max()) + (
                roll_damping if mode == _ROLL else 0.0
            )
            off = float(np.abs(found[fits, mode] - wanted[fits, mode]).max())
            worst = max(worst, off / size if size > 0.0 else 0.0)
        return worst

    def mirrored(self) -> Hydrodynamics:
        """Return the table with the headings of the other side, of a hull with two like sides."""
        # Seas from ahead and astern are their own mirror image, but for the last digits.
        own = np.abs(np.sin(self.heading)) <= _SAME
        force = np.where(own[:, None] & (MIRRORED < 0.0), 0.0, self.excitation)
        heading, force = joined(self.heading, force, -self.heading, MIRRORED * force)
        # Two like sides never couple a motion that the mirror keeps with one that it turns round.
        coupled = np.where(np.outer(MIRRORED, MIRRORED) > 0.0, 1.0, 0.0)
        return replace(
            self,
            heading=heading,
            added_mass=self.added_mass * coupled,
            damping=self.damping * coupled,
            excitation=force,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class FloatingBody(ReadOnlyArrays):
    """A body's mass and stiffness beside its hydrodynamics, all about the same point."""

    hydrodynamics: Hydrodynamics  #: Added mass, damping and wave force.
    #: (6, 6), about `hydrodynamics.point`.
    mass: FloatArray
    stiffness: FloatArray
    centre: Point  #: Centre of gravity [m].
    #: Damping of roll beyond that of the waves it makes, over the critical [-].
    roll_damping: float = 0.0

    def __post_init__(self) -> None:
        """Check the matrices."""
        for name in ("mass", "stiffness"):
            found = np.asarray(getattr(self, name), dtype=np.float64)
            if found.shape != (6, 6) or not np.all(np.isfinite(found)):
                raise InputError(
                    f"floating body: {name} must be 6 by 6 finite numbers, got {found.shape}"
                )
        super().__post_init__()
        check_range("floating body", "roll_damping", self.roll_damping, low=0.0, high=1.0)

    def natural_periods(self) -> NaturalPeriods:
        """Return the natural periods, each with the added mass at its own frequency."""
        heave, roll, pitch = (self._natural(i)[0] for i in (2, 3, 4))
        return NaturalPeriods(heave=heave, roll=roll, pitch=pitch)

    @property
    def critical_roll_damping(self) -> float:
        """Critical damping of roll about the centre of gravity [N m s]."""
        _, inertia, stiffness = self._natural(_ROLL)
        return 2.0 * math.sqrt(inertia * max(stiffness, 0.0))

    def motions(self, omega: npt.ArrayLike | None = None) -> ComplexArray:
        """Return the motions of `hydrodynamics.point` per metre of wave (k, h, 6).

        At frequencies [rad/s], those of the coefficients if left out.
        """
        water = self.hydrodynamics
        if omega is not None:
            water = water.resampled(omega)
        damping = np.array(water.damping)
        damping[:, _ROLL, _ROLL] += self.roll_damping * self.critical_roll_damping
        return solved_motions(
            water.omega, self.mass + water.added_mass, damping, self.stiffness, water.excitation
        )

    def _natural(self, mode: int) -> tuple[float, float, float]:
        """Return period [s], inertia and stiffness of an uncoupled motion."""
        water = self.hydrodynamics
        mass = float(moved(self.mass, water.point, self.centre)[mode, mode])
        stiffness = float(moved(self.stiffness, water.point, self.centre)[mode, mode])
        added = moved(water.added_mass, water.point, self.centre)[:, mode, mode]
        inertia = mass + float(added[0])
        # The added mass is that of the frequency which it decides: a few rounds settle the two.
        for _ in range(50):
            period = undamped_period(inertia, stiffness)
            frequency = 2.0 * math.pi / period
            inertia = mass + float(np.interp(frequency, water.omega, added))
        return undamped_period(inertia, stiffness), inertia, stiffness


def solved_motions(
    omega: FloatArray,
    inertia: FloatArray,
    damping: FloatArray,
    stiffness: FloatArray,
    force: ComplexArray,
    *,
    owner: str = "floating body",
) -> ComplexArray:
    """Return what the equation of motion says, for any number n of degrees of freedom (k, h, n).

    Frequencies are (k,) [rad/s], mass with added mass and damping (k, n, n), stiffness (n, n), the
    force (k, h, n) with the time factor e^{+i omega t}; messages name the owner.

    Raises InputError if the equation has no finite solution.
    """
    w = omega[:, None, None]
    matrix = -(w**2) * inertia + 1j * w * damping + stiffness
    try:
        found = np.linalg.solve(matrix[:, None], force[..., None])[..., 0]
    except np.linalg.LinAlgError:
        found = np.full(force.shape, np.nan + 0j)
    if not np.all(np.isfinite(found)):
        raise InputError(
            f"{owner}: mass, damping and stiffness make no equation of motion that can be solved"
        )
    return np.asarray(found, dtype=np.complex128)
