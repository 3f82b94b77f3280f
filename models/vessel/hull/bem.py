"""Added mass, damping and wave forces of a hull, by Capytaine.

The one door to Capytaine (extra `bem`), a linear potential flow solver with panels.  Its
convention (time factor e^{-i omega t}, forces and motions about the rotation centre) ends here:
everything leaves conjugated, about the frame's origin.

A closed hull with a free surface inside would answer at the "irregular" frequencies of that inner
water, which no ship has.  A lid of panels on it keeps them out.
"""

from __future__ import annotations

import contextlib
import logging
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from ...basics import (
    GRAVITY,
    SEA_WATER_DENSITY,
    FloatArray,
    InputError,
    SolverError,
    check_ascending,
    check_range,
    wave_frequency,
)
from ..crane import Point
from ..raos import MODES
from .froude_krylov import froude_krylov
from .hull import Hull
from .hydrodynamics import Hydrodynamics
from .lid import waterplane_lid

Progress = Callable[[int, int], None]

_NAMES = tuple(mode.capitalize() for mode in MODES)


def capytaine() -> Any:
    """Return the imported package.

    Raises
    ------
    InputError
        If it is not installed, or older than version 3.
    """
    try:
        import capytaine as found
    except ImportError as error:
        raise InputError(
            "a hull is computed by Capytaine, which is not installed: pip install 'stillhook[bem]'"
        ) from error
    if int(found.__version__.partition(".")[0]) < 3:
        raise InputError(
            f"a hull is computed by Capytaine 3 or later, got {found.__version__}: "
            "pip install --upgrade 'stillhook[bem]'"
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
    cpt = capytaine()
    frequencies = np.atleast_1d(check_ascending("hull", "omega", np.asarray(omega)))
    check_range("hull", "omega", frequencies[0], low=1e-3, unit="rad/s")
    check_range("hull", "omega", frequencies[-1], high=20.0, unit="rad/s")
    headings = np.atleast_1d(check_ascending("hull", "heading", np.asarray(heading)))
    if not math.isinf(depth):
        check_range("hull", "depth", depth, low=1.01 * hull.draught, unit="m")
    with quiet(), _limited(threads):
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


def _row(
    cpt: Any,
    solver: Any,
    body: Any,
    frequency: float,
    headings: FloatArray,
    depth: float,
    density: float,
) -> tuple[FloatArray, FloatArray, npt.NDArray[np.complex128]]:
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


@contextlib.contextmanager
def _limited(threads: int | None) -> Iterator[None]:
    """Let the computation use this many threads."""
    if threads is None:
        yield
        return
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=threads):
        yield
