"""Hydrostatics of a hull: volume, centres, metacentric heights, mass and stiffness matrices.

All of it is integrals over the panels, by the divergence theorem and exact for flat triangles.
Mass and stiffness are made about one point that is given, never about a point that a library
picked: matrices about two different points in one equation of motion are an error that no number
betrays.

Capytaine has hydrostatics of its own, which the tests hold these against.  They take each panel as
flat and as one point, or as four: with 1 m of metacentric height and 160 panels the roll stiffness
of a box comes out 40 % too small, that of a ship of 430 panels 5 % (1e-4 with four points).  The
Froude-Krylov force here goes by the same triangles as these integrals, so that the righting moment
and the moment of long waves balance whatever the panels; taken from elsewhere, they would not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...basics import GRAVITY, SEA_WATER_DENSITY, FloatArray, InputError, check_range
from ..crane import Point, transport
from .hull import Hull, quadrature_rule


@dataclass(frozen=True, kw_only=True)
class Waterplane:
    """Displaced volume and waterplane of a hull."""

    volume: float  #: Displaced volume [m3].
    centre_of_buoyancy: Point  #: Its centre [m].
    area: float  #: Area of the waterplane [m2].
    first: tuple[float, float]  #: First moments of the waterplane: integrals of x and of y [m3].
    second: tuple[float, float, float]  #: Second moments: integrals of x^2, y^2 and x y [m4].
    #: Of what is wet [m].
    length: float
    beam: float
    draught: float

    @classmethod
    def of(cls, hull: Hull) -> Waterplane:
        """Return that of a hull.

        The waterplane closes the surface, so that integrals of n_z over it are those over the
        hull with the sign turned.
        """
        points, normals = quadrature_rule(hull.panels)
        x, y, z = points.T
        n = normals[:, 2]
        volume = float(z @ n)
        return cls(
            volume=volume,
            centre_of_buoyancy=(
                float((x * z) @ n) / volume,
                float((y * z) @ n) / volume,
                float(0.5 * z**2 @ n) / volume,
            ),
            area=-float(n.sum()),
            first=(-float(x @ n), -float(y @ n)),
            second=(-float(x**2 @ n), -float(y**2 @ n), -float((x * y) @ n)),
            length=hull.length,
            beam=hull.beam,
            draught=hull.draught,
        )

    @property
    def block(self) -> float:
        """Block coefficient: volume over length x beam x draught [-]."""
        return self.volume / (self.length * self.beam * self.draught)

    @property
    def metacentric_radii(self) -> tuple[float, float]:
        """Of roll and of pitch, from the waterplane's moments about its own centre [m]."""
        x, y = (moment / self.area for moment in self.first)
        return (
            (self.second[1] - self.area * y**2) / self.volume,
            (self.second[0] - self.area * x**2) / self.volume,
        )


@dataclass(frozen=True, kw_only=True)
class Loading:
    """How the mass of a floating vessel is distributed."""

    mass: float  #: That of the displaced water [kg].
    centre: Point  #: Centre of gravity [m], above the centre of buoyancy.
    radii: Point  #: Radii of gyration about axes through it, of roll, pitch and yaw [m].

    @classmethod
    def of(
        cls,
        waterplane: Waterplane,
        *,
        kg: float | None = None,
        gm: float | None = None,
        radii: tuple[float | None, float | None, float | None] = (None, None, None),
        density: float = SEA_WATER_DENSITY,
    ) -> Loading:
        """Return the loading of a vessel that floats upright and level, of its KG or GM [m].

        Radii of gyration of roll, pitch, yaw [m] are the usual ones where left out: 0.37 of the
        beam, and a quarter of the length.  The water's density is in kg/m3.

        Raises InputError if not exactly one of `kg` and `gm` is given, the vessel would not float
        upright, or a figure is out of range.
        """
        if (kg is None) == (gm is None):
            came = "neither" if kg is None else "both"
            raise InputError(
                "hull: give either the height of the centre of gravity above the keel (kg) or the "
                f"metacentric height (gm), got {came}"
            )
        check_range("hull", "density", density, low=900.0, high=1100.0, unit="kg/m3")
        buoyancy = waterplane.centre_of_buoyancy
        metacentre = buoyancy[2] + waterplane.metacentric_radii[0]
        if gm is not None:
            check_range("hull", "gm", gm, low=0.0, high=1000.0, unit="m", open_low=True)
            height = metacentre - gm
        else:
            assert kg is not None
            check_range("hull", "kg", kg, low=0.0, high=1000.0, unit="m")
            height = kg - waterplane.draught
            if height >= metacentre:
                raise InputError(
                    f"hull: kg must be below the metacentre, {metacentre + waterplane.draught:.3f} "
                    f"m above the keel, for the vessel to float upright; got {kg:g} m"
                )
        usual = 0.37 * waterplane.beam, 0.25 * waterplane.length, 0.25 * waterplane.length
        size = max(waterplane.length, waterplane.beam)
        chosen = [usual[i] if given is None else float(given) for i, given in enumerate(radii)]
        for name, radius in zip(("roll", "pitch", "yaw"), chosen, strict=True):
            field = f"radius of gyration of {name}"
            check_range("hull", field, radius, low=0.01 * size, high=2.0 * size, unit="m")
        return cls(
            mass=density * waterplane.volume,
            centre=(buoyancy[0], buoyancy[1], height),
            radii=(chosen[0], chosen[1], chosen[2]),
        )

    def metacentric_heights(self, waterplane: Waterplane) -> tuple[float, float]:
        """Return those of roll and of pitch [m]."""
        above = self.centre[2] - waterplane.centre_of_buoyancy[2]
        roll, pitch = waterplane.metacentric_radii
        return roll - above, pitch - above


def moved(matrix: FloatArray, origin: Point, point: Point) -> FloatArray:
    """Return a matrix (..., 6, 6) of mass, damping or stiffness about another point [m].

    A congruence T' M T, with x_origin = T x_point; forces then move along with motions.
    """
    arm = (point[0] - origin[0], point[1] - origin[1], point[2] - origin[2])
    T = transport(arm)
    return np.asarray(T.T @ matrix @ T)


def mass_matrix(loading: Loading, point: Point = (0.0, 0.0, 0.0)) -> FloatArray:
    """Return the rigid body's mass matrix about a point (6, 6) [kg, kg m, kg m2]."""
    about_centre = loading.mass * np.diag([1.0, 1.0, 1.0, *(r**2 for r in loading.radii)])
    return moved(about_centre, loading.centre, point)


def centre_of_mass(mass: FloatArray, point: Point = (0.0, 0.0, 0.0)) -> Point:
    """Return the centre of gravity that a mass matrix about `point` tells [m].

    Examples
    --------
    >>> loading = Loading(mass=2.0, centre=(1.0, 0.5, -3.0), radii=(1.0, 1.0, 1.0))
    >>> centre_of_mass(mass_matrix(loading))
    (1.0, 0.5, -3.0)
    """
    m = float(mass[0, 0])
    if m == 0.0:
        return point
    arm = mass[1, 5] / m, -mass[0, 5] / m, mass[0, 4] / m
    return point[0] + float(arm[0]), point[1] + float(arm[1]), point[2] + float(arm[2])


def stiffness_matrix(waterplane: Waterplane, loading: Loading) -> FloatArray:
    """Return the hydrostatic stiffness of a freely floating body about the origin (6, 6).

    Newman, Marine Hydrodynamics (1977), section 6.16, with weight equal to buoyancy.  Heave, roll
    and pitch only; [N/m, N, N m].
    """
    area = waterplane.area
    x, y = waterplane.first
    xx, yy, xy = waterplane.second
    # Weight and buoyancy are equal: their moment is the same about any height.
    below = waterplane.volume * (waterplane.centre_of_buoyancy[2] - loading.centre[2])
    found = np.zeros((6, 6))
    found[2:5, 2:5] = [[area, y, -x], [y, yy + below, -xy], [-x, -xy, xx + below]]
    return loading.mass / waterplane.volume * GRAVITY * found


def undamped_period(inertia: float, stiffness: float) -> float:
    """Return 2 pi sqrt(inertia / stiffness) [s]; infinite without stiffness."""
    if stiffness <= 0.0:
        return math.inf
    return 2.0 * math.pi * math.sqrt(inertia / stiffness)
