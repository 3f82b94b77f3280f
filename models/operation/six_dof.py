r"""The hook's motion from records of a vessel's six degrees of freedom.

Surge, sway and heave of a reference point and the angles roll, pitch and yaw about it, measured or
from another program, become the vertical motion of the crane's tip, a fixed point of the vessel.
Axes: x forward, y to port, z up; a positive roll lifts the port side, a positive pitch lowers the
bow.  For small angles

    z_tip = heave - x pitch + y roll

and exactly, for the rotation matrix R = R_z(yaw) R_y(pitch) R_x(roll),

    z_tip = heave - x sin(pitch) + y cos(pitch) sin(roll) + z (cos(pitch) cos(roll) - 1).

Surge, sway and yaw move the tip sideways only.  The result is a record
(`models.operation.record_file`).
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt

from ..basics import FloatArray, InputError, PhysicsWarning, check_finite
from .excitation import Motion
from .record_file import RecordMotion, read_columns

_KINDS = {
    "time": "time",
    "surge": "length",
    "sway": "length",
    "heave": "length",
    "roll": "angle",
    "pitch": "angle",
    "yaw": "angle",
}
_TURNS = ("roll", "pitch")
_LARGEST_ANGLE = 0.8  # [rad], 46 degrees: beyond it the angles are probably in degrees


@dataclass(frozen=True, kw_only=True, eq=False)
class SixDofMotion:
    """Vertical motion of the crane's tip on a vessel with known motions.

    Attributes
    ----------
    record
        The tip's vertical motion.
    tip
        The tip's place from the reference point, (x, y, z) [m].
    """

    record: RecordMotion
    tip: tuple[float, float, float]

    @classmethod
    def read(
        cls,
        path: str | Path,
        *,
        tip: Sequence[float],
        exact: bool = False,
        detrend: Literal["none", "mean", "linear"] = "mean",
        high_pass: float | None = None,
    ) -> SixDofMotion:
        """Read a file with the columns time, heave, roll and pitch; surge, sway, yaw may be there.

        Columns are in SI, angles in rad, unless their header says otherwise: `roll [deg]`.

        Parameters
        ----------
        path
            The file, as in `models.operation.record_file`.
        tip, exact, detrend, high_pass
            As in `from_arrays`.

        Raises
        ------
        InputError
            As `RecordMotion.read`.

        Warns
        -----
        PhysicsWarning
            If an angle is so large that it is probably in degrees.
        """
        columns = read_columns(path, _KINDS, required=("time", "heave", *_TURNS))
        return cls.from_arrays(
            **{name: columns[name] for name in ("time", "heave", *_TURNS)},
            tip=tip,
            exact=exact,
            detrend=detrend,
            high_pass=high_pass,
            source=Path(path).name,
        )

    @classmethod
    def from_arrays(
        cls,
        time: npt.ArrayLike,
        heave: npt.ArrayLike,
        roll: npt.ArrayLike,
        pitch: npt.ArrayLike,
        *,
        tip: Sequence[float],
        exact: bool = False,
        detrend: Literal["none", "mean", "linear"] = "mean",
        high_pass: float | None = None,
        source: str = "six-dof",
    ) -> SixDofMotion:
        """Return the tip's motion.

        Parameters
        ----------
        time
            Times in equal steps (n,) [s].
        heave, roll, pitch
            Of the reference point [m], and the angles about it [rad], (n,).
        tip
            The tip's place from the reference point: forward, to port, up [m].
        exact
            Whether to rotate exactly, or linearly in the angles as RAOs do.
        detrend, high_pass, source
            As in `RecordMotion.from_arrays`.

        Raises
        ------
        InputError
            As `RecordMotion.from_arrays`, or if the tip is not three numbers.
        """
        place = check_finite(source, "tip", tip)
        if place.shape != (3,):
            raise InputError(f"{source}: tip must be x, y and z [m], got {place.size} numbers")
        x, y, z = (float(value) for value in place)
        motions = {
            name: check_finite(source, name, values)
            for name, values in (("heave", heave), ("roll", roll), ("pitch", pitch))
        }
        sizes = {name: values.size for name, values in motions.items()}
        if len(set(sizes.values())) > 1:
            raise InputError(f"{source}: heave, roll and pitch must be equally long, got {sizes}")
        for name in _TURNS:
            largest = float(np.max(np.abs(motions[name]), initial=0.0))
            if largest > _LARGEST_ANGLE:
                warnings.warn(
                    f"{source}: {name} reaches {largest:.3g} rad; angles are in rad, a column of a "
                    f"file in degrees has the header '{name} [deg]'",
                    PhysicsWarning,
                    stacklevel=2,
                )
        vertical = tip_heave(**motions, tip=(x, y, z), exact=exact)
        record = RecordMotion.from_arrays(
            time, vertical, detrend=detrend, high_pass=high_pass, source=source
        )
        return cls(record=record, tip=(x, y, z))

    @property
    def description(self) -> str:
        """Where it comes from."""
        x, y, z = self.tip
        return f"{self.record.description}, tip at ({x:g}, {y:g}, {z:g}) m"

    def motion(self, duration: float, step: float, seed: int) -> Motion:
        """Return the tip's vertical motion; the seed plays no part.

        Raises
        ------
        InputError
            If the record is shorter than the duration.
        """
        return self.record.motion(duration, step, seed)


def tip_heave(
    heave: npt.ArrayLike,
    roll: npt.ArrayLike,
    pitch: npt.ArrayLike,
    *,
    tip: tuple[float, float, float],
    exact: bool = False,
) -> FloatArray:
    """Return the tip's vertical displacement from its place on the vessel at rest.

    Parameters
    ----------
    heave, roll, pitch
        Motions of the reference point [m], [rad], [rad], any shape.
    tip
        The tip's place (x, y, z) [m].
    exact
        Whether to rotate exactly, or linearly in the angles.

    Returns
    -------
    FloatArray
        Up positive, same shape [m].
    """
    x, y, z = tip
    up, phi, theta = (np.asarray(values, dtype=np.float64) for values in (heave, roll, pitch))
    result: FloatArray = up - x * theta + y * phi
    if exact:
        result = (
            up
            - x * np.sin(theta)
            + y * np.cos(theta) * np.sin(phi)
            + z * (np.cos(theta) * np.cos(phi) - 1.0)
        )
    return result
