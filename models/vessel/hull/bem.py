"""Added mass, damping and wave forces of a hull, by Capytaine.

The one door to Capytaine (extra `bem`), a linear potential flow solver with panels.  Its
convention (time factor e^{-i omega t}, forces and motions about the rotation centre) ends here:
everything leaves conjugated, about the frame's origin.

A closed hull with a free surface inside would answer at the "irregular" frequencies of that inner
water, which no ship has: where water sloshing inside it would resonate, the equations have no
single answer.  A lid of panels on it keeps them out.

Coefficients are cached: the same hull in the same waves is never solved twice.  A file per
computation in the user's cache folder, under a digest of everything that the numbers depend on:
panels, frequencies, headings, point, depth, density, lid, and the versions of the packages.  Mass
and damping of roll are not among them, so that another loading of the same hull costs nothing.  A
file that is damaged or of another make is computed again, and one that cannot be written is done
without.
"""

import contextlib
import hashlib
import json
import logging
import math
import os
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ...basics import (
    GRAVITY,
    SEA_WATER_DENSITY,
    ComplexArray,
    FloatArray,
    InputError,
    SolverError,
    cache_folder,
    check_ascending,
    check_range,
    how_to_install,
    keep_latest,
    replace_atomically,
    wave_frequency,
    wave_number,
)
from ..crane import Point
from ..raos import MODES
from .hull import Hull, panel_areas, patch, quadrature_rule
from .hydrodynamics import Hydrodynamics

Progress = Callable[[int, int], None]

_NAMES = tuple(mode.capitalize() for mode in MODES)

KEPT = 64  #: Computations kept; the ones longest unused go first.

_ARRAYS = ("omega", "heading", "added_mass", "damping", "excitation")
_FORMAT = 4  # goes up when what is computed from the same inputs changes


def capytaine() -> Any:
    """Return the imported package.

    Raises InputError if it is not installed, or older than version 3.
    """
    try:
        import capytaine as found
    except ImportError as error:
        raise InputError(
            f"a hull is computed by Capytaine, which is not installed: {how_to_install('bem')}"
        ) from error
    if int(found.__version__.partition(".")[0]) < 3:
        raise InputError(
            f"a hull is computed by Capytaine 3 or later, got {found.__version__}: "
            f"{how_to_install('bem')}"
        )
    return found


def versions() -> dict[str, str]:
    """Return the versions that the numbers depend on."""
    return {"capytaine": str(capytaine().__version__), "numpy": str(np.__version__)}


def solve_hull(
    hull: Hull,
    *,
    omega: npt.ArrayLike,
    heading: npt.ArrayLike,
    point: Point = (0.0, 0.0, 0.0),
    depth: float = math.inf,
    density: float = SEA_WATER_DENSITY,
    lid: bool = True,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Hydrodynamics:
    """Return the hydrodynamic coefficients of a hull at rest.

    Parameters
    ----------
    hull
        Its wetted surface.
    omega
        Frequencies (k,) [rad/s], strictly ascending.
    heading
        Where the waves travel towards (h,) [rad].
    point
        About which forces and motions hold [m].
    depth
        Water depth [m].
    density
        Of the water [kg/m3].
    lid
        Whether to keep irregular frequencies out.
    threads
        How many the computation may use; what the environment says if left out.
    progress
        Called with (frequencies done, of how many).

    Raises
    ------
    InputError
        If Capytaine is missing, or a figure is out of range.
    SolverError
        If Capytaine fails.
    """
    from threadpoolctl import threadpool_limits

    cpt = capytaine()
    frequencies = np.atleast_1d(check_ascending("hull", "omega", np.asarray(omega)))
    check_range("hull", "omega", frequencies[0], low=1e-3, unit="rad/s")
    check_range("hull", "omega", frequencies[-1], high=20.0, unit="rad/s")
    headings = np.atleast_1d(check_ascending("hull", "heading", np.asarray(heading)))
    if not math.isinf(depth):
        check_range("hull", "depth", depth, low=1.01 * hull.draught, unit="m")
    with quiet(), threadpool_limits(limits=threads):
        try:
            mesh = capytaine_mesh(hull)
            body = cpt.FloatingBody(
                mesh=mesh,
                lid_mesh=_lid(hull, mesh) if lid else None,
                dofs=cpt.rigid_body_dofs(rotation_center=point),
            )
            # The potential itself as unknown, not sources: with a lid the more exact of the two,
            # three times so in the heave that waves make, at a few hundred panels.
            solver = cpt.BEMSolver(method="direct")
            rows = []
            for done, frequency in enumerate(frequencies):
                if progress is not None:
                    progress(done, frequencies.size)
                rows.append(_row(cpt, solver, body, float(frequency), headings, depth, density))
        except (ArithmeticError, LookupError, ValueError, RuntimeError) as error:
            if isinstance(error, InputError):
                raise
            raise SolverError(f"{hull.name}: Capytaine failed: {error}") from error
    if progress is not None:
        progress(frequencies.size, frequencies.size)
    undisturbed = np.array(
        [
            froude_krylov(
                hull, omega=float(w), heading=headings, point=point, depth=depth, density=density
            )
            for w in frequencies
        ]
    )
    return Hydrodynamics(
        omega=frequencies,
        heading=headings,
        added_mass=np.array([row[0] for row in rows]),
        damping=np.array([row[1] for row in rows]),
        excitation=np.array([row[2] for row in rows]) + undisturbed,
        point=point,
        depth=depth,
        density=density,
    )


def _lid(hull: Hull, mesh: Any) -> Any:
    """Return the lid: over the whole waterplane, or of Capytaine's squares where that cannot be."""
    panels = waterplane_lid(hull)
    return mesh.generate_lid() if panels is None else _mesh(panels, f"lid of {hull.name}")


def capytaine_mesh(hull: Hull) -> Any:
    """Return the hull as Capytaine's mesh."""
    return _mesh(hull.panels, hull.name)


def _mesh(panels: FloatArray, name: str) -> Any:
    # Corners that two panels share are found, and merged, by Capytaine.
    return capytaine().Mesh.from_list_of_faces(panels.tolist(), name=name, auto_check=False)


def waterplane_lid(hull: Hull) -> FloatArray | None:
    """Return panels that cover the waterplane (n, 4, 3), or nothing if it is no simple one.

    Panels on the inner water settle what happens at irregular frequencies if they cover it whole:
    with gaps along the hull, as a lid of squares has them, the first of those frequencies still
    show.  So the lid is spanned between the two sides of the waterline.  A simple one is cut twice
    by every line across the ship; not so for a catamaran, a moonpool or a hull that is wholly
    submerged.
    """
    segments = _waterline(hull)
    if not len(segments):
        return None
    low, high = float(segments[..., 0].min()), float(segments[..., 0].max())
    size = math.sqrt(panel_areas(hull.panels).mean())
    length = high - low
    corners = np.unique(np.round(segments[..., 0], 6))
    # The hull's own stations where they are as far apart as its panels.
    if 0.5 * length / size < corners.size < 2.0 * length / size + 2.0:
        stations = corners
    else:
        stations = np.linspace(low, high, 2 + math.ceil(length / size))
    nudge = 1e-7 * length
    inside = np.clip(stations + nudge, low + nudge, high - nudge)
    sides = []
    for x in inside:
        a, b = segments[:, 0], segments[:, 1]
        crossed = (np.minimum(a[:, 0], b[:, 0]) <= x) & (x < np.maximum(a[:, 0], b[:, 0]))
        a, b = a[crossed], b[crossed]
        part = (x - a[:, 0]) / (b[:, 0] - a[:, 0])
        y = np.sort(a[:, 1] + part * (b[:, 1] - a[:, 1]))
        if y.size != 2:
            return None
        sides.append(y)
    across = np.array(sides)
    # An even number, so that a panel is on one side of a symmetric ship or on the other.
    count = 2 * max(1, round(float(np.ptp(across, axis=1).max()) / size / 2.0))
    t = np.linspace(0.0, 1.0, count + 1)
    y = across[:, :1] * (1.0 - t) + across[:, 1:] * t
    points = np.stack([np.broadcast_to(stations[:, None], y.shape), y, np.zeros_like(y)], axis=-1)
    return patch(points)


def _waterline(hull: Hull) -> FloatArray:
    """Return the panels' edges that lie in the waterline, each once (n, 2, 3)."""
    panels = hull.panels
    tolerance = 1e-6 * max(hull.length, hull.beam)
    edges = np.stack([panels, np.roll(panels, -1, axis=1)], axis=2).reshape(-1, 2, 3)
    long = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1) > tolerance
    there = np.all(edges[..., 2] > -tolerance, axis=1)
    return np.asarray(edges[long & there])


def _row(
    cpt: Any,
    solver: Any,
    body: Any,
    frequency: float,
    headings: FloatArray,
    depth: float,
    density: float,
) -> tuple[FloatArray, FloatArray, ComplexArray]:
    """Return added mass, damping (6, 6) and diffraction force (h, 6) at one frequency."""
    given = {"omega": frequency, "water_depth": depth, "rho": density, "g": GRAVITY, "body": body}
    added, damping = np.empty((6, 6)), np.empty((6, 6))
    # Short waves are told in our own words, once for the hull and not once a problem.
    for j, name in enumerate(_NAMES):
        problem = cpt.RadiationProblem(radiating_dof=name, **given)
        result = solver.solve(problem, keep_details=False, _check_wavelength=False)
        for i, other in enumerate(_NAMES):
            added[i, j] = result.added_mass[other]
            damping[i, j] = result.radiation_damping[other]
    force = np.empty((headings.size, 6), dtype=np.complex128)
    for j, heading in enumerate(headings):
        problem = cpt.DiffractionProblem(wave_direction=float(heading), **given)
        result = solver.solve(problem, keep_details=False, _check_wavelength=False)
        force[j] = [result.forces[name] for name in _NAMES]
    return added, damping, np.conj(force)


def froude_krylov(
    hull: Hull,
    *,
    omega: float,
    heading: npt.ArrayLike,
    point: Point = (0.0, 0.0, 0.0),
    depth: float = math.inf,
    density: float = SEA_WATER_DENSITY,
) -> ComplexArray:
    """Return force and moment of the undisturbed wave per metre of amplitude (h, 6) [N/m, N].

    It could come from the panel method, by the pressure in the middle of each panel.  For roll that
    is not good enough: the moment of long waves is a small difference of large parts, as is the
    metacentric height, and eight panels across the beam put it off by 4 %.  Here the pressure is
    integrated by a rule that is exact for polynomials of the second degree, as the hydrostatics
    are, so that long waves roll the ship as they must, whatever the panels.

    Parameters are those of :func:`solve_hull`, at one frequency; the time factor is e^{+i omega t},
    against the elevation at the frame's origin.
    """
    k = float(wave_number(omega, depth))
    direction = np.atleast_1d(np.asarray(heading, dtype=np.float64))
    points, normals = quadrature_rule(hull.panels)
    arms = np.cross(points - np.asarray(point), normals)
    generalised = np.concatenate([normals, arms], axis=1)  # (q, 6), with the weights
    z = points[:, 2]
    if math.isinf(depth) or k * depth > 20.0:
        decay = np.exp(k * z)
    else:
        decay = np.cosh(k * (z + depth)) / math.cosh(k * depth)
    along = points[:, 0] * np.cos(direction)[:, None] + points[:, 1] * np.sin(direction)[:, None]
    pressure = density * GRAVITY * decay * np.exp(-1j * k * along)
    # Pressure pushes inwards, against the outward normal.
    force: ComplexArray = -(pressure @ generalised)
    return force


def shortest_wave(hull: Hull, depth: float = math.inf) -> float:
    """Return the frequency of a wave that is four panels long, the shortest to trust [rad/s]."""
    return float(wave_frequency(2.0 * math.pi / (4.0 * hull.panel_size), depth))


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Keep Capytaine's log to itself: what matters is checked here and told in our words."""
    log = logging.getLogger("capytaine")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        yield
    finally:
        log.setLevel(level)


def cached_hydrodynamics(
    hull: Hull,
    *,
    threads: int | None = None,
    progress: Progress | None = None,
    cache: bool = True,
    **asked: Any,
) -> tuple[Hydrodynamics, bool]:
    """Return the coefficients of :func:`models.vessel.hull.bem.solve_hull`, and if they were kept.

    `asked` is what they depend on: frequencies, headings, depth, density, lid.
    """
    folder = cache_folder() / "hulls"
    place = folder / f"{_digest(hull, asked)}.npz"
    if cache:
        found = _read(place)
        if found is not None:
            with contextlib.suppress(OSError):
                os.utime(place)
            return found, True
    solved = solve_hull(hull, **asked, threads=threads, progress=progress)
    if cache:
        with contextlib.suppress(OSError, InputError):
            folder.mkdir(parents=True, exist_ok=True)
            replace_atomically(place, lambda path: _write(path, solved))
            keep_latest(folder, "*.npz", KEPT)
    return solved, False


def _digest(hull: Hull, asked: Mapping[str, Any]) -> str:
    """Return the digest of everything that the coefficients depend on."""
    inputs = {name: np.asarray(value).tolist() for name, value in asked.items()}
    about = {"format": _FORMAT, "hull": hull.digest, "gravity": GRAVITY, "versions": versions()}
    words = json.dumps(about | inputs, sort_keys=True)
    return hashlib.sha256(words.encode()).hexdigest()[:40]


def _write(place: Path, solved: Hydrodynamics) -> None:
    with place.open("wb") as file:  # by an open file: numpy would add its own ending to the name
        np.savez_compressed(file, **{f.name: getattr(solved, f.name) for f in fields(solved)})


def _read(place: Path) -> Hydrodynamics | None:
    """Return what is in a file of the cache, or nothing if it is not whole."""
    try:
        with place.open("rb") as raw, np.load(raw, allow_pickle=False) as file:
            x, y, z = file["point"].tolist()
            return Hydrodynamics(
                **{name: file[name] for name in _ARRAYS},
                point=(x, y, z),
                depth=float(file["depth"]),
                density=float(file["density"]),
            )
    except (OSError, ValueError, LookupError, TypeError, EOFError, zipfile.BadZipFile, zlib.error):
        return None
