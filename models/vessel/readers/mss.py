"""RAOs from the Marine Systems Simulator (MSS): the `vessel` structure of a `.mat` file.

`vessel.motionRAO.amp{1:6}` and `.phase{1:6}` are tables (frequency, heading, speed); phases [rad]
lead with the time factor e^{+i omega t}; `vessel.headings` [rad] are where the waves travel
towards, 180 deg head sea.  Fossen's axes: x forward, y to starboard, z down, so that heave is -1
in long waves and headings grow clockwise seen from above (T. I. Fossen, *Handbook of Marine Craft
Hydrodynamics and Motion Control*, 2nd ed., 2021, and `HYDRO/utils/readdata` of MSS).

Unused speeds are columns of zeros: MSS keeps room for ten.
"""

import io
from pathlib import Path
from typing import Any

import numpy as np

from ...basics import FloatArray, InputError, check_range
from ..assemble import finished, grid
from ..convention import Convention
from ..raos import VesselRaos
from .shipx import chosen_speed

MSS = Convention(
    phase_unit="radians",
    sway="starboard",
    heave="down",
    pitch="bow up",
    yaw="bow to starboard",
    turning="clockwise",
)
"""What the numbers of an MSS vessel mean."""


_NO_NAMES = ("", "input", "vessel")  # what `veres2vessel` makes of the run's file `input.re1`


def parse_mss(
    owner: str,
    data: bytes,
    *,
    speed: float | None = None,
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> VesselRaos:
    """Return the motions at one speed; arguments are those of `read_raos`.

    The origin is where the point CO of MSS is, in the frame that the hook is given in [m].

    Raises InputError if the file is no MATLAB file, is cut off, or holds no vessel with motion
    RAOs.
    """
    vessel = _structure(owner, data)
    rao = _field(owner, vessel, "vessel", "motionRAO")
    omega = _array(owner, rao, "vessel.motionRAO", "w").ravel()
    headings = _array(owner, vessel, "vessel", "headings").ravel()
    speeds = _array(owner, vessel, "vessel", "velocities").ravel()
    amplitude = _modes(owner, rao, "amp", omega.size, headings.size, speeds.size)
    phase = _modes(owner, rao, "phase", omega.size, headings.size, speeds.size)
    for what, column, high in (("w", omega, 1e3), ("headings", np.abs(headings), 20.0)):
        if not column.size or not np.all(np.isfinite(column)) or column.max() > high:
            raise InputError(
                f"{owner}: vessel {what} must be finite numbers up to {high:g}, got {column[:3]}.."
            )
    check_range(owner, "lowest frequency", omega.min(), low=0.0, unit="rad/s", open_low=True)
    chosen, told = chosen_speed(owner, speeds.tolist(), speed)
    at = int(np.argmin(np.abs(speeds - chosen)))
    if not np.any(amplitude[:, :, at]):
        raise InputError(f"{owner}: all motion RAOs at {chosen:g} m/s are zero")
    values = MSS.values(amplitude[:, :, at], phase[:, :, at], np.ones((omega.size, headings.size)))
    w, b = np.meshgrid(omega, MSS.directions(np.degrees(headings)), indexing="ij")
    rows = grid(owner, w.ravel(), b.ravel(), values.reshape(-1, 6))
    notes = [
        f"MSS .mat: {MSS.words()}; turned half a circle about x",
        "the file does not say where its point CO is: positions count from there"
        + ("" if not any(origin) else f", taken to be at {origin} m"),
        *told,
    ]
    return finished(
        VesselRaos(
            name=_name(owner, vessel), omega=rows[0], heading=rows[1], values=rows[2],
            origin=origin, phase_origin=origin[:2], speed=chosen, source=owner, notes=tuple(notes),
        )
    )  # fmt: skip


def _structure(owner: str, data: bytes) -> Any:
    """Return the structure `vessel`."""
    from scipy.io import loadmat

    if data[:20].startswith(b"MATLAB 7.3"):
        raise InputError(
            f"{owner}: MATLAB files of version 7.3 are not read; save it again with "
            "save('file.mat', 'vessel', '-v7')"
        )
    found = loadmat(
        io.BytesIO(data),  # type: ignore[arg-type]  # the stubs know of file names only
        squeeze_me=True,
        struct_as_record=False,
        variable_names=["vessel"],
    )
    vessel = found.get("vessel")
    if not hasattr(vessel, "_fieldnames"):
        raise InputError(f"{owner}: there is no MSS structure 'vessel' in this MATLAB file")
    return vessel


def _field(owner: str, holder: Any, path: str, name: str) -> Any:
    found = getattr(holder, name, None)
    if found is None:
        raise InputError(f"{owner}: {path} has no field {name!r}; is this an MSS vessel?")
    return found


def _array(owner: str, holder: Any, path: str, name: str) -> FloatArray:
    """Return a field as numbers."""
    try:
        return np.atleast_1d(np.asarray(_field(owner, holder, path, name), dtype=np.float64))
    except (TypeError, ValueError) as error:
        raise InputError(f"{owner}: {path}.{name} must be numbers") from error


def _modes(owner: str, rao: Any, name: str, k: int, h: int, v: int) -> FloatArray:
    """Return the six tables of one kind (k, h, speeds, 6)."""
    path = f"vessel.motionRAO.{name}"
    cells = np.atleast_1d(np.asarray(_field(owner, rao, "vessel.motionRAO", name), dtype=object))
    if cells.shape[:1] != (6,):
        raise InputError(f"{owner}: {path} must be a cell of 6 tables, got {cells.shape}")
    found = []
    for i in range(6):
        try:
            table = np.asarray(cells[i], dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise InputError(f"{owner}: {path}{{{i + 1}}} must be numbers") from error
        if table.ndim == 2:
            table = table[:, :, None]
        if table.ndim != 3 or table.shape[:2] != (k, h) or table.shape[2] < v:
            raise InputError(
                f"{owner}: {path}{{{i + 1}}} must have the shape (frequencies, headings, speeds) = "
                f"({k}, {h}, {v}), got {table.shape}"
            )
        found.append(table[:, :, :v])
    return np.stack(found, axis=-1)


def _name(owner: str, vessel: Any) -> str:
    """Return what the vessel is called: after the file where MSS calls it as it does every one."""
    name = getattr(getattr(vessel, "main", None), "name", "")
    own = name.strip() if isinstance(name, str) else ""
    return Path(owner).stem if own.lower() in _NO_NAMES else own
