"""Reading the NetCDF files that Capytaine writes.

A file may hold the RAO itself, or the coefficients it follows from: added mass, radiation
damping, wave force, and beside them mass and hydrostatic stiffness.  With coefficients, damping of
roll can be added, without which a ship rolls as no ship does.  Bodies beside the one that is asked
for, and modes beside the six, take part in the equation of motion.

Capytaine's time factor is e^{-i omega t} and its wave directions are where the waves go, so the
complex conjugate of everything is all that it takes to get to the project's convention.  Neither
Capytaine nor its packages are needed.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ...basics import ComplexArray, FloatArray, InputError, check_finite, check_hdf5, check_range
from ..assemble import finished, read_bytes
from ..hull import FloatingBody, Hydrodynamics, centre_of_mass, solved_motions
from ..raos import MODES, VesselRaos
from .capytaine_dataset import CapytaineData
from .capytaine_parts import kept_rows, places, square_matrix, turned_headings, wave_force

Point = tuple[float, float, float]

_ROLL = MODES.index("roll")


def read_capytaine(
    path: str | Path,
    *,
    roll_damping: float | None = None,
    body: int | str | None = None,
    depth: float | None = None,
    speed: float | None = None,
    inertia: npt.ArrayLike | None = None,
    stiffness: npt.ArrayLike | None = None,
    origin: Point | None = None,
) -> VesselRaos:
    """Return the motions that a Capytaine NetCDF holds, or that follow from what it holds.

    Parameters
    ----------
    path
        The file.
    roll_damping
        Damping of roll beyond that of the waves it makes, over the critical [-].  Given, the
        motions are computed anew even if the file has them.
    body
        Which body, where there are several.
    depth, speed
        Which water depth [m] and forward speed [m/s], where there are several.
    inertia, stiffness
        Mass and hydrostatic stiffness (6, 6) about the rotation centre, surge to yaw, where the
        file has none.
    origin
        The rotation centre [m], where the file does not tell it.

    Returns
    -------
    VesselRaos
        Motions of the rotation centre; `notes` tell what was done.

    Raises
    ------
    InputError
        If the file is not one of Capytaine's, is damaged, or lacks what it takes.
    """
    owner = str(path)
    body = None if body is None else str(body)
    if roll_damping is not None:
        check_range(owner, "roll_damping", roll_damping, low=0.0, high=1.0)
    content = read_bytes(path)
    check_hdf5(path)
    data = CapytaineData(owner, content, chosen={"water_depth": depth, "forward_speed": speed})
    notes = [f"written by Capytaine {data.version}: time factor e^(-i omega t), conjugated"]
    moving = data.number("forward_speed") or 0.0
    point = _origin(data, origin, notes)
    stored = next((name for name in ("RAO", "rao") if data.has(name)), None)
    if moving != 0.0 and (stored is None or roll_damping is not None):
        raise InputError(
            f"{owner}: motions at forward speed ({moving:g} m/s) are read where the file has them "
            "(a variable RAO), not computed from coefficients"
        )
    if stored is not None and roll_damping is None:
        omega, heading, values = _stored(data, stored, body, notes)
    else:
        omega, heading, values = _computed(
            data, body, roll_damping, inertia, stiffness, point, notes
        )
    order = np.argsort(heading)
    water = data.number("water_depth")
    return finished(
        VesselRaos(
            name=Path(path).stem,
            omega=omega,
            heading=heading[order],
            values=values[:, order],
            origin=point,
            phase_origin=(0.0, 0.0),
            depth=math.inf if water is None else water,
            speed=moving,
            source=owner,
            notes=tuple(notes),
        )
    )


def _stored(
    data: CapytaineData, name: str, body: str | None, notes: list[str]
) -> tuple[FloatArray, FloatArray, ComplexArray]:
    """Return frequencies, headings and motions as they stand in the file."""
    axis = "radiating_dof"
    try:
        data.dofs(axis)
    except InputError:
        axis = "influenced_dof"
    dofs = data.dofs(axis)
    place = places(data, dofs, body)
    values = data.table(name, ("frequency", "wave_direction", axis), dofs)
    order = kept_rows(data, values)
    found = np.zeros((order.size, values.shape[1], 6), dtype=np.complex128)
    for mode, column in place.items():
        found[:, :, MODES.index(mode)] = values[order][:, :, column]
    _tell_missing(place, notes)
    notes.append(f"the RAO as the file has it ({name})")
    heading, first = turned_headings(data)
    return data.omega[order], heading, np.conj(found[:, first])


def _computed(
    data: CapytaineData,
    body: str | None,
    roll_damping: float | None,
    inertia: npt.ArrayLike | None,
    stiffness: npt.ArrayLike | None,
    point: Point,
    notes: list[str],
) -> tuple[FloatArray, FloatArray, ComplexArray]:
    """Return frequencies, headings and motions, from the coefficients."""
    missing = [n for n in ("added_mass", "radiation_damping") if not data.has(n)]
    if missing:
        raise InputError(
            f"{data.owner}: the motions cannot be computed: {' and '.join(missing)} missing; the "
            f"file has {data.names()}"
        )
    dofs = data.dofs()
    place = places(data, dofs, body)
    square = ("influenced_dof", "radiating_dof")
    added = data.table("added_mass", ("frequency", *square), dofs)
    damping = data.table("radiation_damping", ("frequency", *square), dofs)
    force = wave_force(data, dofs)
    order = kept_rows(data, force, added, damping)
    heading, first = turned_headings(data)
    omega, force = data.omega[order], np.conj(force[order][:, first])
    added, damping = added[order].real, damping[order].real
    mass = square_matrix(data, "inertia_matrix", inertia, "inertia", dofs, place)
    spring = square_matrix(data, "hydrostatic_stiffness", stiffness, "stiffness", dofs, place)
    columns = [place.get(mode) for mode in MODES]
    share = 0.0 if roll_damping is None else roll_damping
    if len(dofs) > len(place) or None in columns:
        # Other bodies, modes that bend, or a body that is held: the equation of them all.
        if share:
            six = _six(mass, spring, added, damping, columns, omega, heading, share, point)
            column = place.get("roll")
            if column is None:
                raise InputError(f"{data.owner}: roll_damping is given, but nothing rolls")
            damping = damping.copy()
            damping[:, column, column] += share * six.critical_roll_damping
        solved = solved_motions(omega, mass + added, damping, spring, force, owner=data.owner)
        values = np.zeros((omega.size, heading.size, 6), dtype=np.complex128)
        for mode, column in place.items():
            values[:, :, MODES.index(mode)] = solved[:, :, column]
        _tell_missing(place, notes)
    else:
        six = _six(mass, spring, added, damping, columns, omega, heading, share, point, force)
        values = six.motions()
        notes.extend(_missed(six))
    notes.append(
        "computed from the file's coefficients"
        + ("" if inertia is None else ", with the mass that was given")
        + ("" if stiffness is None else ", with the stiffness that was given")
    )
    if share:
        notes.append(f"{100.0 * share:g} % of critical damping added to roll")
    elif "roll" in place:
        notes.append("no damping of roll but that of the waves: its resonance is far too high")
    return omega, heading, values


def _six(
    mass: FloatArray,
    spring: FloatArray,
    added: FloatArray,
    damping: FloatArray,
    columns: list[int | None],
    omega: FloatArray,
    heading: FloatArray,
    share: float,
    point: Point,
    force: ComplexArray | None = None,
) -> FloatingBody:
    """Return one body with six motions; one that the file lacks has mass alone."""
    there = [i for i, c in enumerate(columns) if c is not None]
    picked = [c for c in columns if c is not None]
    M, C = np.eye(6), np.zeros((6, 6))
    A, B = np.zeros((omega.size, 6, 6)), np.zeros((omega.size, 6, 6))
    F = np.zeros((omega.size, heading.size, 6), dtype=np.complex128)
    M[np.ix_(there, there)] = mass[np.ix_(picked, picked)]
    C[np.ix_(there, there)] = spring[np.ix_(picked, picked)]
    for k in range(omega.size):
        A[k][np.ix_(there, there)] = added[k][np.ix_(picked, picked)]
        B[k][np.ix_(there, there)] = damping[k][np.ix_(picked, picked)]
    if force is not None:
        F[:, :, there] = force[:, :, picked]
    order = np.argsort(heading)
    water = Hydrodynamics(
        omega=omega,
        heading=heading[order],
        added_mass=A,
        damping=B,
        excitation=F[:, order],
        point=point,
    )
    centre = centre_of_mass(M, point)
    found = FloatingBody(
        hydrodynamics=water, mass=M, stiffness=C, centre=centre, roll_damping=share
    )
    return found


def _missed(body: FloatingBody) -> list[str]:
    """Return a remark if the file's frequencies are too far apart for the resonance of roll."""
    omega = body.hydrodynamics.omega
    natural = 2.0 * math.pi / body.natural_periods().roll
    if not omega[0] < natural < omega[-1]:
        return []
    damping = float(np.interp(natural, omega, body.hydrodynamics.damping[:, _ROLL, _ROLL]))
    critical = body.critical_roll_damping
    # Between the half-power points.
    width = 2.0 * natural * (body.roll_damping + damping / critical)
    after = int(np.searchsorted(omega, natural))
    step = float(omega[after] - omega[after - 1])
    if step <= width:
        return []
    return [
        f"roll resonates at {natural:.3g} rad/s over a width of {width:.2g} rad/s, where the "
        f"file's frequencies are {step:.2g} rad/s apart: its peak is missed, or taken for too wide"
    ]


def _origin(data: CapytaineData, given: Point | None, notes: list[str]) -> Point:
    """Return the point whose motions these are."""
    if given is not None:
        x, y, z = (float(v) for v in check_finite(data.owner, "origin", given))
        return x, y, z
    found = data.place("rotation_center")
    if found is not None:
        return found
    notes.append("the file does not tell its rotation centre: taken as the frame's origin")
    return 0.0, 0.0, 0.0


def _tell_missing(place: dict[str, int], notes: list[str]) -> None:
    missing = [mode for mode in MODES if mode not in place]
    if missing:
        notes.append(f"the file has no {', '.join(missing)}: taken as held")
