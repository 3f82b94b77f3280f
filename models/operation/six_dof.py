r"""The hook's motion from records of a vessel's six degrees of freedom.

Surge, sway and heave of a reference point and the angles roll, pitch and yaw about it, measured or
from another program, become the vertical motion of the crane's tip, a fixed point of the vessel.
Axes: x forward, y to port, z up; a positive roll lifts the port side, a positive pitch lowers the
bow.  For small angles

    z_tip = heave - x pitch + y roll

and exactly, for the rotation matrix R = R_z(yaw) R_y(pitch) R_x(roll),

    z_tip = heave - x sin(pitch) + y cos(pitch) sin(roll) + z (cos(pitch) cos(roll) - 1).

Surge, sway and yaw move the tip sideways only.  `models.operation.record_file` reads files of them.
"""

import warnings
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from ..basics import FloatArray, InputError, PhysicsWarning, check_finite

_LARGEST_ANGLE = 0.8  # [rad], 46 degrees: beyond it the angles are probably in degrees


def tip_heave(
    heave: npt.ArrayLike,
    roll: npt.ArrayLike,
    pitch: npt.ArrayLike,
    *,
    tip: Sequence[float],
    exact: bool = False,
    source: str = "six-dof",
) -> FloatArray:
    """Return the tip's vertical displacement from its place on the vessel at rest.

    Parameters
    ----------
    heave, roll, pitch
        Motions of the reference point [m], and the angles about it [rad], (n,).
    tip
        The tip's place from the reference point: forward, to port, up [m].
    exact
        Whether to rotate exactly, or linearly in the angles as RAOs do.
    source
        What to call it in messages.

    Returns
    -------
    FloatArray
        Up positive, (n,) [m].

    Raises
    ------
    InputError
        If the tip is not three numbers, or the motions do not fit or are not finite.

    Warns
    -----
    PhysicsWarning
        If an angle is so large that it is probably in degrees.
    """
    place = check_finite(source, "tip", tip)
    if place.shape != (3,):
        raise InputError(f"{source}: tip must be x, y and z [m], got {place.size} numbers")
    x, y, z = place
    up, phi, theta = (
        check_finite(source, name, values)
        for name, values in (("heave", heave), ("roll", roll), ("pitch", pitch))
    )
    if not up.shape == phi.shape == theta.shape:
        raise InputError(
            f"{source}: heave, roll and pitch must be equally long, got {up.size}, {phi.size} and "
            f"{theta.size}"
        )
    for name, angle in (("roll", phi), ("pitch", theta)):
        largest = float(np.max(np.abs(angle), initial=0.0))
        if largest > _LARGEST_ANGLE:
            warnings.warn(
                f"{source}: {name} reaches {largest:.3g} rad; angles are in rad, a column of a "
                f"file in degrees has the header '{name} [deg]'",
                PhysicsWarning,
                stacklevel=2,
            )
    if not exact:
        return np.asarray(up - x * theta + y * phi)
    turned = y * np.cos(theta) * np.sin(phi) + z * (np.cos(theta) * np.cos(phi) - 1.0)
    return np.asarray(up - x * np.sin(theta) + turned)
