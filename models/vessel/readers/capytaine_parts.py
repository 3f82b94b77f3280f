"""What the equation of motion takes from a Capytaine file: rows, headings, forces, matrices.

Between `capytaine_dataset`, which knows the file, and `capytaine_file`, which knows the motions.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from ...basics import ComplexArray, FloatArray, InputError, check_finite
from ..raos import MODES
from .capytaine_dataset import CapytaineData, mode_of


def places(data: CapytaineData, dofs: tuple[str, ...], body: str | None) -> dict[str, int]:
    """Return where each motion of the body stands."""
    bodies: dict[str, dict[str, int]] = {}
    for column, dof in enumerate(dofs):
        name, mode = mode_of(dof)
        if mode is None:
            continue
        if mode in bodies.setdefault(name, {}):
            raise InputError(f"{data.owner}: {mode} is there twice: {', '.join(dofs)}")
        bodies[name][mode] = column
    if not bodies:
        raise InputError(
            f"{data.owner}: none of the degrees of freedom is one of {', '.join(MODES)}: "
            f"{', '.join(dofs)}"
        )
    if body is None:
        if len(bodies) > 1:
            raise InputError(f"{data.owner}: say which body: {', '.join(bodies)}")
        return next(iter(bodies.values()))
    if body not in bodies and not (len(bodies) == 1 and "" in bodies):
        raise InputError(f"{data.owner}: body must be one of {', '.join(bodies)}, got {body!r}")
    return bodies.get(body, bodies.get("", {}))


def kept_rows(data: CapytaineData, *tables: npt.NDArray[np.generic]) -> npt.NDArray[np.intp]:
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


def turned_headings(data: CapytaineData) -> tuple[FloatArray, npt.NDArray[np.intp]]:
    """Return headings in [0, 2 pi), and where each stands in the file; one that is twice, once."""
    turned = np.mod(data.headings(), 2.0 * math.pi)
    turned = np.where(2.0 * math.pi - turned < 1e-7, 0.0, turned)
    _, first = np.unique(np.round(turned, 7), return_index=True)
    return turned[first], first


def wave_force(data: CapytaineData, dofs: tuple[str, ...]) -> ComplexArray:
    """Return the wave force (k, h, n), in the file's convention."""
    axes = ("frequency", "wave_direction", "influenced_dof")
    if data.has("excitation_force"):
        return data.table("excitation_force", axes, dofs).astype(np.complex128)
    parts = ("diffraction_force", "Froude_Krylov_force")
    missing = [n for n in parts if not data.has(n)]
    if missing:
        raise InputError(
            f"{data.owner}: the motions cannot be computed: {' and '.join(missing)} missing, and "
            f"no excitation_force; the file has {data.names()}"
        )
    return np.asarray(sum(data.table(n, axes, dofs) for n in parts), dtype=np.complex128)


def square_matrix(
    data: CapytaineData,
    name: str,
    given: npt.ArrayLike | None,
    argument: str,
    dofs: tuple[str, ...],
    place: dict[str, int],
) -> FloatArray:
    """Return mass or stiffness over all degrees of freedom, from the caller or the file."""
    if given is not None:
        six = check_finite(data.owner, argument, given)
        if six.shape != (6, 6) or len(place) != len(dofs):
            raise InputError(
                f"{data.owner}: {argument} must be 6 by 6, for a file of one rigid body; got "
                f"{six.shape} and {len(dofs)} degrees of freedom"
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
    found = data.table(name, ("influenced_dof", "radiating_dof"), dofs)
    if not np.all(np.isfinite(found)):
        raise InputError(f"{data.owner}: {name} must be finite numbers")
    return np.asarray(found.real, dtype=np.float64)
