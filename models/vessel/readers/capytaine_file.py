"""RAOs from Capytaine: stored in its NetCDF file, or solved from the coefficients there.

A file may hold the RAO itself, or the coefficients it follows from: added mass, radiation
damping, wave force, and beside them mass and hydrostatic stiffness.  With coefficients, damping of
roll can be added, without which a ship rolls as no ship does.  Bodies beside the one that is asked
for, and modes beside the six, take part in the equation of motion.

Capytaine's time factor is e^{-i omega t} and its wave directions are where the waves go, so the
complex conjugate of everything is all that it takes to get to the project's convention.  Neither
Capytaine nor its packages are needed.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ...basics import ComplexArray, FloatArray, InputError, check_finite, check_range
from ..assemble import finished
from ..crane import Point
from ..hull import FloatingBody, Hydrodynamics, centre_of_mass, solved_motions
from ..raos import MODES, VesselRaos
from .capytaine_dataset import CapytaineData

_ROLL = MODES.index("roll")


def parse_capytaine(
    owner: str,
    data: bytes,
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

    Arguments are those of `read_raos`.  With a damping of roll the motions are computed anew, even
    if the file has them.  They are those of the rotation centre, which `origin` is where the file
    does not tell it; inertia and stiffness are about it, surge to yaw.

    Raises InputError if the file is not one of Capytaine's, is damaged, or lacks what it takes.
    """
    body = None if body is None else str(body)
    if roll_damping is not None:
        check_range(owner, "roll_damping", roll_damping, low=0.0, high=1.0)
    file = CapytaineData(owner, data, chosen={"water_depth": depth, "forward_speed": speed})
    notes = [f"written by Capytaine {file.version}: time factor e^(-i omega t), conjugated"]
    moving = file.number("forward_speed") or 0.0
    point = _origin(file, origin, notes)
    stored = next((name for name in ("RAO", "rao") if file.has(name)), None)
    if moving != 0.0 and (stored is None or roll_damping is not None):
        raise InputError(
            f"{owner}: motions at forward speed ({moving:g} m/s) are read where the file has them "
            "(a variable RAO), not computed from coefficients"
        )
    if stored is not None and roll_damping is None:
        omega, heading, values = _stored(file, stored, body, notes)
    else:
        omega, heading, values = _computed(
            file, body, roll_damping, inertia, stiffness, point, notes
        )
    water = file.number("water_depth")
    return finished(
        VesselRaos(
            name=Path(owner).stem,
            omega=omega,
            heading=heading,
            values=values,
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
    place = _places(data, body, notes)
    values = data.table(name, ("frequency", "wave_direction", "dof"))
    order = _kept_rows(data, values)
    notes.append(f"the RAO as the file has it ({name})")
    heading, first = _turned_headings(data)
    return data.omega[order], heading, _six(np.conj(values[order][:, first]), place, 1)


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
    _need(data, ("added_mass", "radiation_damping"))
    place = _places(data, body, notes)
    added, damping = (
        data.table(name, ("frequency", "influenced_dof", "radiating_dof"))
        for name in ("added_mass", "radiation_damping")
    )
    force = _wave_force(data)
    order = _kept_rows(data, force, added, damping)
    heading, first = _turned_headings(data)
    omega, force = data.omega[order], np.conj(force[order][:, first])
    added, damping = added[order].real, damping[order].real
    mass = _square_matrix(data, "inertia_matrix", inertia, "inertia", place)
    spring = _square_matrix(data, "hydrostatic_stiffness", stiffness, "stiffness", place)
    share = 0.0 if roll_damping is None else roll_damping
    # A motion that the file lacks has a mass of one: it is zero, and the matrix not singular.
    held = np.diag([float(mode not in place) for mode in MODES])
    alone = FloatingBody(
        hydrodynamics=Hydrodynamics(
            omega=omega,
            heading=heading,
            added_mass=_six(added, place, 2),
            damping=_six(damping, place, 2),
            excitation=_six(force, place, 1),
            point=point,
        ),
        mass=_six(mass, place, 2) + held,
        stiffness=_six(spring, place, 2),
        centre=centre_of_mass(_six(mass, place, 2) + held, point),
        roll_damping=share,
    )
    if share:
        column = place.get("roll")
        if column is None:
            raise InputError(f"{data.owner}: roll_damping is given, but nothing rolls")
        damping = damping.copy()
        damping[:, column, column] += share * alone.critical_roll_damping
    # Other bodies, and modes that bend, are in the equation too.
    solved = solved_motions(omega, mass + added, damping, spring, force, owner=data.owner)
    if len(data.dofs) == len(place) == len(MODES):
        notes.extend(_missed(alone))
    notes.append(
        "computed from the file's coefficients"
        + ("" if inertia is None else ", with the mass that was given")
        + ("" if stiffness is None else ", with the stiffness that was given")
    )
    if share:
        notes.append(f"{100.0 * share:g} % of critical damping added to roll")
    elif "roll" in place:
        notes.append("no damping of roll but that of the waves: its resonance is far too high")
    return omega, heading, _six(solved, place, 1)


def _six(table: npt.NDArray[Any], place: dict[str, int], axes: int) -> npt.NDArray[Any]:
    """Return a table of the body's six motions along its last axes; one that it lacks is zero."""
    lacking: int = table.shape[-1]
    columns = [place.get(mode, lacking) for mode in MODES]
    for axis in range(-axes, 0):
        nothing = np.zeros_like(np.take(table, [0], axis))
        table = np.take(np.concatenate([table, nothing], axis), columns, axis)
    return table


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


def _places(data: CapytaineData, body: str | None, notes: list[str]) -> dict[str, int]:
    """Return where each motion of the body stands, with a note of those that do not."""
    bodies: dict[str, dict[str, int]] = {}
    for column, dof in enumerate(data.dofs):
        # The name of its body may stand before it, as in barge__Roll.
        name, _, motion = dof.rpartition("__")
        mode = motion.strip().lower()
        if mode not in MODES:
            continue
        if mode in bodies.setdefault(name, {}):
            raise InputError(f"{data.owner}: {mode} is there twice: {', '.join(data.dofs)}")
        bodies[name][mode] = column
    if not bodies:
        raise InputError(
            f"{data.owner}: none of the degrees of freedom is one of {', '.join(MODES)}: "
            f"{', '.join(data.dofs)}"
        )
    if body is None:
        if len(bodies) > 1:
            raise InputError(f"{data.owner}: say which body: {', '.join(bodies)}")
        body = next(iter(bodies))
    if body not in bodies and not (len(bodies) == 1 and "" in bodies):
        raise InputError(f"{data.owner}: body must be one of {', '.join(bodies)}, got {body!r}")
    place = bodies.get(body, bodies.get("", {}))
    missing = [mode for mode in MODES if mode not in place]
    if missing:
        notes.append(f"the file has no {', '.join(missing)}: taken as held")
    return place


def _kept_rows(data: CapytaineData, *tables: npt.NDArray[np.generic]) -> npt.NDArray[np.intp]:
    """Return the rows to keep, ascending: frequencies 0 and infinity make no waves."""
    finite = np.isfinite(data.omega) & (data.omega > 0.0)
    if np.any(np.isnan(data.omega)) or np.any(data.omega < 0.0):
        raise InputError(f"{data.owner}: frequencies must be at least 0 rad/s, got {data.omega}")
    for table in tables:
        whole = np.isfinite(table).reshape(table.shape[0], -1).all(axis=1)
        bad = np.flatnonzero(finite & ~whole)
        if bad.size:
            raise InputError(
                f"{data.owner}: there are numbers that are not finite at "
                f"{data.omega[bad[0]]:g} rad/s"
            )
    keep = np.flatnonzero(finite)
    order = keep[np.argsort(data.omega[keep], kind="stable")]
    if order.size < 2:
        raise InputError(f"{data.owner}: at least 2 frequencies are needed, got {order.size}")
    return order


def _turned_headings(data: CapytaineData) -> tuple[FloatArray, npt.NDArray[np.intp]]:
    """Return headings in [0, 2 pi), and where each stands in the file; one that is twice, once."""
    turned = np.mod(data.headings(), 2.0 * math.pi)
    turned = np.where(2.0 * math.pi - turned < 1e-7, 0.0, turned)
    _, first = np.unique(np.round(turned, 7), return_index=True)
    return turned[first], first


def _need(data: CapytaineData, names: tuple[str, ...], instead: str = "") -> None:
    """Refuse a file that lacks a variable without which there is no equation of motion."""
    missing = [name for name in names if not data.has(name)]
    if missing:
        raise InputError(
            f"{data.owner}: the motions cannot be computed: {' and '.join(missing)} missing"
            f"{instead}; the file has {data.names()}"
        )


def _wave_force(data: CapytaineData) -> ComplexArray:
    """Return the wave force (k, h, n), in the file's convention."""
    whole = data.has("excitation_force")
    parts = ("excitation_force",) if whole else ("diffraction_force", "Froude_Krylov_force")
    _need(data, parts, ", and no excitation_force")
    axes = ("frequency", "wave_direction", "influenced_dof")
    return np.asarray(sum(data.table(n, axes) for n in parts), dtype=np.complex128)


def _square_matrix(
    data: CapytaineData,
    name: str,
    given: npt.ArrayLike | None,
    argument: str,
    place: dict[str, int],
) -> FloatArray:
    """Return mass or stiffness over all degrees of freedom, from the caller or the file."""
    if given is not None:
        six = check_finite(data.owner, argument, given)
        if six.shape != (6, 6) or len(place) != len(data.dofs):
            raise InputError(
                f"{data.owner}: {argument} must be 6 by 6, for a file of one rigid body; got "
                f"{six.shape} and {len(data.dofs)} degrees of freedom"
            )
        modes = sorted(place, key=lambda mode: place[mode])
        index = [MODES.index(mode) for mode in modes]
        return np.asarray(six[np.ix_(index, index)])
    if not data.has(name):
        raise InputError(
            f"{data.owner}: the motions cannot be computed: the file has neither a RAO nor the "
            f"variable {name}; give it as {argument}=, or add it with Capytaine's "
            "assemble_dataset of a body with a centre of mass"
        )
    found = data.table(name, ("influenced_dof", "radiating_dof"))
    if not np.all(np.isfinite(found)):
        raise InputError(f"{data.owner}: {name} must be finite numbers")
    return np.asarray(found.real, dtype=np.float64)
