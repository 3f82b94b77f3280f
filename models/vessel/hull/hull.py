"""The wetted surface of a hull in panels: `Hull`, its integrals, and the box.

First stop on the way from main dimensions, or from a mesh, to motions:

    Hull -> hydrostatics -> coefficients by panels (models.vessel.hull.bem) -> VesselRaos

A `Hull` is nothing but panels, whoever made them: a box here, a ship in `lines`, a file in
`files`.  They are checked where they enter: a surface that is not closed below the waterline,
or whose panels look inwards, gives forces that no later step would notice to be wrong.

Frame: x forward, y to port, z up, z = 0 at the still waterline.
"""

import hashlib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from ...basics import FloatArray, InputError, check_finite, check_range, read_only
from ..crane import Point

_OPEN = 0.02  # of the volume by which its three expressions may differ for the surface to be closed


@dataclass(frozen=True, kw_only=True, eq=False)
class Hull:
    """The wetted surface of a floating hull, in panels of four corners.

    Raises InputError if a corner is not finite or above the waterline, or the surface is not closed
    below it.
    """

    name: str  #: What it is called.
    #: Corners of the panels (n, 4, 3) [m], all at or below z = 0; seen from the water they go round
    #: counter-clockwise.  A triangle has its last corner twice.
    panels: FloatArray
    #: What it was made from, for the provenance of what is computed with it.
    inputs: Mapping[str, object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the surface, turn it outwards if all of it looks inwards."""
        owner = f"hull {self.name!r}"
        panels = check_finite(owner, "panels", self.panels)
        if panels.ndim != 3 or panels.shape[1:] != (4, 3) or panels.shape[0] < 1:
            raise InputError(f"{owner}: panels must have the shape (n, 4, 3), got {panels.shape}")
        top = float(panels[..., 2].max())
        size = float(np.ptp(panels.reshape(-1, 3), axis=0).max())
        if top > 1e-6 * max(size, 1.0):
            raise InputError(
                f"{owner}: panels must lie at or below the waterline z = 0 m, got a corner at "
                f"{top:g} m"
            )
        panels = np.array(panels)
        panels[..., 2] = np.minimum(panels[..., 2], 0.0)
        by_axis = volumes(panels)
        if by_axis[2] < 0.0:
            panels = panels[:, ::-1, :]
            by_axis = -by_axis
        panels = _triangles_last(panels)
        if not (by_axis[2] > 0.0 and np.ptp(by_axis) <= _OPEN * by_axis[2]):
            told = ", ".join(f"{v:.4g}" for v in by_axis)
            raise InputError(
                f"{owner}: the surface is not closed below the waterline, or some of its panels "
                f"look inwards: its volume comes out as {told} m3 from panels that face along x, y "
                "and z, which should be the same"
            )
        object.__setattr__(self, "panels", read_only(panels))
        object.__setattr__(self, "inputs", MappingProxyType(dict(self.inputs)))

    @property
    def length(self) -> float:
        """Length of what is wet [m]."""
        return float(np.ptp(self.panels[..., 0]))

    @property
    def beam(self) -> float:
        """Breadth of what is wet [m]."""
        return float(np.ptp(self.panels[..., 1]))

    @property
    def draught(self) -> float:
        """Depth of the lowest point below the waterline [m]."""
        return -float(self.panels[..., 2].min())

    @property
    def count(self) -> int:
        """Number of panels."""
        return int(self.panels.shape[0])

    @property
    def panel_size(self) -> float:
        """The longest edge of any panel [m]; waves should be several times as long."""
        edges = np.linalg.norm(np.roll(self.panels, -1, axis=1) - self.panels, axis=2)
        return float(edges.max())

    @property
    def symmetric(self) -> bool:
        """Whether port and starboard are each other's mirror image, panel by panel."""
        triangle = np.all(self.panels[:, 3] == self.panels[:, 2], axis=1)
        centres = np.where(
            triangle[:, None], self.panels[:, :3].mean(axis=1), self.panels.mean(axis=1)
        )
        scale = 1e-6 * max(self.length, self.beam, 1.0)
        here = np.round(centres / scale).astype(np.int64)
        there = np.round(centres * (1.0, -1.0, 1.0) / scale).astype(np.int64)
        order, mirrored = np.lexsort(here.T), np.lexsort(there.T)
        return bool(np.all(np.abs(here[order] - there[mirrored]) <= 2))

    @property
    def digest(self) -> str:
        """A digest of the panels."""
        # To the micrometre: the last digits are those of the machine.
        rounded = np.round(self.panels, 6) + 0.0
        return hashlib.sha256(np.ascontiguousarray(rounded).tobytes()).hexdigest()


def volumes(panels: FloatArray) -> FloatArray:
    """Return the enclosed volume three times, from panels (n, 4, 3) facing along x, y and z [m3].

    By the divergence theorem the integrals of x n_x, y n_y and z n_z over a closed surface are
    each its volume.  The missing waterplane at z = 0 adds to none of them.
    """
    points, normals = quadrature_rule(panels)
    return np.asarray((points * normals).sum(axis=0))


def quadrature_rule(panels: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return points (q, 3), and outward normals times weights (q, 3), of integrals over panels.

    Each panel is two flat triangles, in the mean over both ways to cut it, so that mirrored panels
    have mirrored integrals.  The rule with the middles of a triangle's edges is exact for
    polynomials up to the second degree.
    """
    points, normals = [], []
    for corners in ((0, 1, 2), (0, 2, 3), (0, 1, 3), (1, 2, 3)):
        a, b, c = (panels[:, k, :] for k in corners)
        normal = 0.25 * np.cross(b - a, c - a)  # half its area, half its weight
        for middle in (a + b, b + c, c + a):
            points.append(0.5 * middle)
            normals.append(normal / 3.0)
    return np.concatenate(points), np.concatenate(normals)


def panel_areas(panels: FloatArray) -> FloatArray:
    """Return the areas of panels (n,) [m2]: half the cross product of the diagonals."""
    cross = np.cross(panels[:, 2] - panels[:, 0], panels[:, 3] - panels[:, 1])
    return np.asarray(0.5 * np.linalg.norm(cross, axis=1))


def patch(points: FloatArray) -> FloatArray:
    """Return the panels (n, 4, 3) of a grid of points (r, c, 3) [m], those without area left out.

    With rows counted downwards and columns to the right on the page, they look at the reader.
    """
    panels = np.stack(
        [points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]], axis=2
    ).reshape(-1, 4, 3)
    area = panel_areas(panels)
    found: FloatArray = panels[area > 1e-9 * max(float(area.max(initial=0.0)), 1e-30)]
    return found


def _triangles_last(panels: FloatArray) -> FloatArray:
    """Return the panels with the corner that a triangle has twice at the end."""
    found = np.array(panels)
    size = np.ptp(panels.reshape(-1, 3), axis=0).max()
    for turn in range(3):
        twice = np.linalg.norm(panels[:, turn] - panels[:, turn + 1], axis=1) < 1e-9 * size
        found[twice] = np.roll(panels[twice], 2 - turn, axis=1)
    ends = np.linalg.norm(panels[:, 3] - panels[:, 0], axis=1) < 1e-9 * size
    found[ends] = np.roll(panels[ends], -1, axis=1)
    return found


def box_hull(
    length: float, beam: float, draught: float, *, panels: int = 400, name: str | None = None
) -> Hull:
    """Return the wetted surface of a box: a barge.

    Parameters
    ----------
    length, beam, draught
        Main dimensions [m]; the origin is amidships, on the centreline, in the waterline.
    panels
        How many panels, about.
    name
        What it is called; after its dimensions if left out.

    Examples
    --------
    >>> hull = box_hull(100.0, 20.0, 5.0, panels=200)
    >>> hull.count, hull.length, hull.beam, hull.draught
    (158, 100.0, 20.0, 5.0)
    """
    owner = "box"
    check_range(owner, "length", length, low=0.1, high=1000.0, unit="m")
    check_range(owner, "beam", beam, low=0.1, high=1000.0, unit="m")
    check_range(owner, "draught", draught, low=0.01, high=200.0, unit="m")
    check_range(owner, "panels", panels, low=20, high=20_000)
    size = math.sqrt((length * beam + 2.0 * (length + beam) * draught) / panels)
    # An even number across, so that no panel lies astride the centreline.
    x = np.linspace(-length / 2.0, length / 2.0, 1 + max(2, round(length / size)))
    y = np.linspace(-beam / 2.0, beam / 2.0, 1 + 2 * max(1, round(beam / size / 2.0)))
    z = np.linspace(0.0, -draught, 1 + max(1, round(draught / size)))

    def face(
        rows: FloatArray, columns: FloatArray, point: Callable[[float, float], Point]
    ) -> FloatArray:
        return patch(np.array([[point(r, c) for c in columns] for r in rows]))

    surface = np.concatenate(
        [
            face(z, x, lambda r, c: (c, -beam / 2.0, r)),  # starboard, seen from starboard
            face(z, x[::-1], lambda r, c: (c, beam / 2.0, r)),  # port
            face(z, y, lambda r, c: (length / 2.0, c, r)),  # the bow, from ahead
            face(z, y[::-1], lambda r, c: (-length / 2.0, c, r)),  # the stern
            face(y, x, lambda r, c: (c, r, -draught)),  # the bottom, from below
        ]
    )
    return Hull(
        name=name or f"box {length:g} x {beam:g} x {draught:g} m",
        panels=surface,
        inputs={
            "shape": "box",
            "length": float(length),
            "beam": float(beam),
            "draught": float(draught),
            "panels": int(panels),
        },
    )
