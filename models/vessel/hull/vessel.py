"""The vessel of a hull and its loading: `vessel_from_hull`.

    hull --panels--> coefficients --mass, stiffness, damping of roll--> motions --> VesselRaos

The motions are those of the frame's origin: amidships, on the centreline, in the waterline for a
hull of our own lines.  Coefficients are computed on few frequencies, as they are smooth; the
motions are tabulated wherever they bend, above all around the resonance of roll, so that straight
lines between the rows are as good as the table.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...basics import (
    GRAVITY,
    SEA_WATER_DENSITY,
    FloatArray,
    InputError,
    check_ascending,
    check_range,
    shows_progress,
)
from ..raos import VesselRaos
from .bem import Progress, cached_hydrodynamics, shortest_wave, versions
from .hull import Hull
from .hydrodynamics import FloatingBody, NaturalPeriods
from .hydrostatics import Loading, Waterplane, mass_matrix, stiffness_matrix

_BEND = 0.005  # of a motion's largest value that a straight line between two rows may be off
_ROWS = 160  # of the table of motions, at most
_ENERGY = 0.1  # by which the waves made and felt may disagree before it is told
_TURN = 1.6  # rad that forces may turn from one frequency to the next for a spline to follow
_CLOSEST = 0.006  # rad/s between two of them: a motion that passes zero bends at any scale


@dataclass(frozen=True, kw_only=True, eq=False)
class HullVessel:
    """A hull, how it floats and how it moves."""

    hull: Hull  #: Its wetted surface.
    #: Volume and waterplane; mass, centre of gravity, radii of gyration.
    waterplane: Waterplane
    loading: Loading
    body: FloatingBody  #: Coefficients, mass and stiffness about the frame's origin.
    raos: VesselRaos  #: The motions of the frame's origin.
    warnings: tuple[str, ...] = ()  #: What the figures should be taken with care for.
    kept: bool = False  #: Whether the coefficients came from the cache.

    @property
    def natural_periods(self) -> NaturalPeriods:
        """Undamped natural periods [s]."""
        return self.body.natural_periods()

    @property
    def metacentric_heights(self) -> tuple[float, float]:
        """Of roll and of pitch [m]."""
        return self.loading.metacentric_heights(self.waterplane)


@shows_progress("frequencies")
def vessel_from_hull(
    hull: Hull,
    *,
    kg: float | None = None,
    gm: float | None = None,
    radii: tuple[float | None, float | None, float | None] = (None, None, None),
    roll_damping: float = 0.05,
    omega: npt.ArrayLike | None = None,
    heading_step: float = math.radians(15.0),
    depth: float = math.inf,
    density: float = SEA_WATER_DENSITY,
    lid: bool = True,
    name: str | None = None,
    command: str = "",
    threads: int | None = None,
    cache: bool = True,
    progress: Progress | None = None,
) -> HullVessel:
    """Compute the motions of a hull in waves.

    Parameters
    ----------
    hull
        A box, a ship of our own lines, or a mesh.
    kg, gm
        One of them: height of the centre of gravity above the lowest point, or transverse
        metacentric height [m].
    radii
        Radii of gyration of roll, pitch and yaw [m]; usual values where left out.
    roll_damping
        Damping of roll beyond that of the waves it makes, over the critical [-].
    omega
        Frequencies of the coefficients [rad/s]; :func:`usual_frequencies` if left out.
    heading_step
        Headings all round at this step [rad].
    depth, density
        Of the water [m], [kg/m3].
    lid
        Whether to keep irregular frequencies out.
    name, command
        What the vessel is called, and how it was made, for the file.
    threads, cache, progress
        As for :func:`models.vessel.hull.bem.cached_hydrodynamics`.

    Raises
    ------
    InputError
        If a figure is out of range, the vessel would not float upright, or Capytaine is missing.
    SolverError
        If Capytaine fails.
    """
    check_range("hull", "roll_damping", roll_damping, low=0.0, high=1.0)
    check_range(
        "hull", "heading_step", heading_step, low=math.radians(1.0), high=math.pi / 2.0, unit="rad"
    )
    count = round(2.0 * math.pi / heading_step)
    if abs(count * heading_step - 2.0 * math.pi) > 1e-6:
        raise InputError(
            f"hull: heading_step must divide the circle, got {math.degrees(heading_step):g} deg"
        )
    frequencies = np.atleast_1d(
        check_ascending(
            "hull", "omega", usual_frequencies(hull) if omega is None else np.asarray(omega)
        )
    )
    if frequencies.size < 4:
        raise InputError(f"hull: omega must have at least 4 rows, got {frequencies.size}")
    waterplane = Waterplane.of(hull)
    loading = Loading.of(waterplane, kg=kg, gm=gm, radii=radii, density=density)
    headings = np.linspace(0.0, 2.0 * math.pi, count, endpoint=False)
    # A ship with two like sides needs only the waves from one of them.
    alike = hull.symmetric and abs(loading.centre[1]) < 1e-6 * hull.beam
    solved, kept = cached_hydrodynamics(
        hull,
        omega=frequencies,
        heading=headings[headings <= math.pi + 1e-9] if alike else headings,
        depth=depth,
        density=density,
        lid=lid,
        threads=threads,
        progress=progress,
        cache=cache,
    )
    water = solved.mirrored() if alike else solved
    body = FloatingBody(
        hydrodynamics=water,
        mass=mass_matrix(loading),
        stiffness=stiffness_matrix(waterplane, loading),
        centre=loading.centre,
        roll_damping=roll_damping,
    )
    rows = well_spaced(body)
    raos = VesselRaos(
        name=name or hull.name,
        omega=rows,
        heading=water.heading,
        values=body.motions(rows),
        depth=depth,
        source=f"Capytaine {versions()['capytaine']}",
        notes=_provenance(hull, loading, body, lid, command),
    )
    return HullVessel(
        hull=hull,
        waterplane=waterplane,
        loading=loading,
        body=body,
        raos=raos,
        warnings=_warnings(hull, body, loading.metacentric_heights(waterplane)[0], radii),
        kept=kept,
    )


def usual_frequencies(hull: Hull, low: float = 0.15, high: float = 2.0) -> FloatArray:
    """Return frequencies for the coefficients of a hull from low to high (k,) [rad/s].

    At equal steps of 0.05 rad/s or less, so that the wave's phase at the ends of the hull turns by
    no more than a radian from one to the next: what is between them is interpolated.
    """
    step = min(0.05, GRAVITY / (high * hull.length))
    return np.linspace(low, high, max(4, 1 + math.ceil((high - low) / step - 1e-9)))


def well_spaced(body: FloatingBody) -> FloatArray:
    """Return frequencies at which the motions tell all their bends.

    Beginning with those of the coefficients, the middle of two rows is added wherever a motion
    there differs from what straight lines of amplitude and phase would give.
    """
    rows = np.array(body.hydrodynamics.omega)
    values = body.motions(rows)
    scale = np.abs(values).max(axis=(0, 1))
    scale = np.where(scale > 0.0, scale, 1.0)
    # A round halves gaps: eight bring one of 1 rad/s below the closest.
    for _ in range(8):
        middle = 0.5 * (rows[:-1] + rows[1:])
        exact = body.motions(middle)
        a, b = values[:-1], values[1:]
        amplitude = 0.5 * (np.abs(a) + np.abs(b))
        straight = amplitude * np.exp(1j * (np.angle(a) + 0.5 * np.angle(b * np.conj(a))))
        off = (np.abs(exact - straight) / scale).max(axis=(1, 2))
        wanted = np.flatnonzero((off > _BEND) & (np.diff(rows) > 2.0 * _CLOSEST))
        # The worst first, so that the limit on rows cuts where it matters least.
        wanted = wanted[np.argsort(off[wanted])[::-1][: max(0, _ROWS - rows.size)]]
        if not wanted.size:
            break
        order = np.argsort(np.concatenate([rows, middle[wanted]]))
        values = np.concatenate([values, exact[wanted]])[order]
        rows = np.concatenate([rows, middle[wanted]])[order]
    return np.round(rows, 9)


def _provenance(
    hull: Hull, loading: Loading, body: FloatingBody, lid: bool, command: str
) -> tuple[str, ...]:
    """Return what the numbers were made from, a sentence each."""
    inputs = ", ".join(f"{key} {_told(value)}" for key, value in hull.inputs.items())
    x, y, z = (round(v, 3) + 0.0 for v in loading.centre)
    roll, pitch, yaw = loading.radii
    water = body.hydrodynamics
    omega = water.omega
    packages = ", ".join(f"{name} {version}" for name, version in versions().items())
    found = [
        f"hull: {inputs}; {hull.count} panels, digest {hull.digest[:16]}",
        f"loading: {loading.mass:.6g} kg, centre of gravity at ({x:g}, {y:g}, {z:g}) m from the "
        f"origin in the waterline, radii of gyration {roll:.4g}, {pitch:.4g}, {yaw:.4g} m",
        f"roll: {100.0 * body.roll_damping:g} % of critical damping added to that of the waves",
        f"water: {water.density:g} kg/m3, "
        + ("deep" if math.isinf(water.depth) else f"{water.depth:g} m")
        + f"; coefficients at {omega.size} frequencies, {omega[0]:g} to {omega[-1]:g} rad/s, "
        f"{'with' if lid else 'without'} a lid against irregular ones",
        f"by linear potential theory at zero speed: {packages}",
    ]
    if command:
        found.append(f"made by: {command}")
    return tuple(found)


def _told(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _warnings(
    hull: Hull, body: FloatingBody, metacentric_height: float, radii: Sequence[float | None]
) -> tuple[str, ...]:
    """Return what the figures should be taken with care for."""
    found = []
    water = body.hydrodynamics
    omega = water.omega
    last = float(omega[-1])
    reach = shortest_wave(hull, water.depth)
    if reach < last:
        found.append(
            f"above {reach:.3g} rad/s a wave is shorter than four panels ({hull.panel_size:.3g} "
            "m): take more panels, or those figures for rough ones"
        )
    turn = float(np.diff(omega**2).max()) / GRAVITY * hull.length / 2.0
    if turn > _TURN:
        found.append(
            f"from one frequency to the next the wave turns by {turn:.2g} rad at the ends of the "
            f"hull: take {usual_frequencies(hull, float(omega[0]), last).size} frequencies, or "
            "those between them for rough ones"
        )
    if body.roll_damping == 0.0:
        found.append(
            "no damping of roll but that of the waves: near its natural period the vessel rolls "
            "several times as far as a real one; 0.03 to 0.10 of critical is usual"
        )
    period = body.natural_periods().roll
    if not 2.0 * math.pi / period >= float(omega[0]):
        found.append(
            f"roll has its natural period, {period:.3g} s, beyond the table's lowest frequency: "
            "its resonance is not in the table"
        )
    if metacentric_height < 0.15:
        found.append(
            f"a metacentric height of {metacentric_height:.3g} m is less than the 0.15 m that any "
            "seagoing vessel must have"
        )
    error = water.energy_error(body.roll_damping * body.critical_roll_damping)
    if error > _ENERGY:
        found.append(
            f"waves made and waves felt disagree by {100.0 * error:.0f} %: take more panels"
        )
    missing = [n for n, r in zip(("roll", "pitch", "yaw"), radii, strict=True) if r is None]
    if missing:
        found.append(
            f"radii of gyration of {', '.join(missing)}: usual values taken (0.37 of the beam for "
            "roll, 0.25 of the length for pitch and yaw)"
        )
    return tuple(found)
