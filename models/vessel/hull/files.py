"""Hulls from mesh files: STL, and the formats of panel programs.

STL is read here, text or binary; GDF (WAMIT), PNL (HAMS), HST (HydroStar) and MAR (Nemoh) by
Capytaine's readers.  What is above the waterline is cut off, and a lid that the file brings along
is left out.  The waterline is the file's z = 0, unless the draught is given.
"""

import math
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from ...basics import FloatArray, InputError, binary_name, check_range, read_bytes, stl_facets
from .hull import Hull, panel_areas

FORMATS = (".stl", ".gdf", ".pnl", ".hst", ".mar")  #: Endings of the files that are read.

MOST_PANELS = 6000  #: Most panels: the matrices of the panel method have as many rows and columns.

_NUMBER = rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_VERTEX = re.compile(
    rb"^\s*vertex\s+(" + _NUMBER + rb")\s+(" + _NUMBER + rb")\s+(" + _NUMBER + rb")\s*$",
    re.MULTILINE,
)


def read_hull(
    path: str | Path, *, scale: float = 1.0, draught: float | None = None, name: str | None = None
) -> Hull:
    """Return the wetted surface of the hull in a mesh file.

    Parameters
    ----------
    path
        The file; its ending tells the format, one of :data:`FORMATS`.
    scale
        Metres per unit of length of the file: 0.001 for millimetres.
    draught
        Where the waterline is, above the lowest point [m]; at the file's z = 0 if left out.
    name
        What the hull is called; after the file if left out.

    Raises
    ------
    InputError
        If it is no such file, damaged, not closed below the waterline, not floating, or has too
        many panels.
    """
    place = Path(path)
    owner = str(path)
    ending = place.suffix.lower()
    if ending not in FORMATS:
        raise InputError(
            f"{owner}: a mesh must be one of {', '.join(FORMATS)}, got "
            f"{place.suffix or 'no ending'}"
        )
    check_range(owner, "scale", scale, low=1e-6, high=1e6)
    data = read_bytes(path)
    panels = _stl(owner, data) if ending == ".stl" else _by_capytaine(owner, data, ending[1:])
    panels = panels * scale
    if not np.all(np.isfinite(panels)):
        raise InputError(f"{owner}: corners of panels must be finite numbers")
    low = float(panels[..., 2].min())
    if draught is not None:
        check_range(owner, "draught", draught, low=0.0, open_low=True, unit="m")
        panels = panels - np.array([0.0, 0.0, low + draught])
        low = -draught
    if not low < 0.0:
        raise InputError(
            f"{owner}: the whole mesh is above the waterline z = 0 (its lowest point is at "
            f"{low:g} m); give the draught"
        )
    wet = _wet(owner, panels)
    if len(wet) > MOST_PANELS:
        raise InputError(
            f"{owner}: at most {MOST_PANELS} panels below the waterline, got {len(wet)}: coarsen "
            "the mesh; 500 to 1500 are enough"
        )
    return Hull(
        name=name or place.stem,
        panels=wet,
        inputs={
            "shape": f"mesh {place.name}",
            "scale": float(scale),
            **({} if draught is None else {"draught": float(draught)}),
        },
    )


def _stl(owner: str, data: bytes) -> FloatArray:
    """Return the triangles of an STL file as panels (n, 4, 3)."""
    count = int.from_bytes(data[80:84], "little") if len(data) >= 84 else 0
    if stl_facets(data):
        kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
        corners = np.frombuffer(data, dtype=kind, offset=84)["corners"].astype(np.float64)
    elif data.lstrip()[:5].lower() == b"solid":
        if b"endsolid" not in data:
            raise InputError(f"{owner}: the STL file is cut off: there is no endsolid")
        found = _VERTEX.findall(data)
        facets = len(re.findall(rb"^\s*facet\b", data, re.MULTILINE))
        if not found or len(found) != 3 * facets:
            raise InputError(
                f"{owner}: the STL file has {facets} facets and {len(found)} vertices that are "
                "three numbers; there must be three to a facet"
            )
        corners = np.array([[float(v) for v in row] for row in found]).reshape(-1, 3, 3)
    elif len(data) >= 84 and count > 0 and 84 + 50 * count > len(data):
        raise InputError(
            f"{owner}: the STL file is cut off, or is none: {84 + 50 * count} bytes are told, "
            f"{len(data)} are there"
        )
    else:
        raise InputError(f"{owner}: this is no STL file, neither text nor binary")
    return np.concatenate([corners, corners[:, 2:]], axis=1)


def _by_capytaine(owner: str, data: bytes, kind: str) -> FloatArray:
    """Return the panels (n, 4, 3) of a file that Capytaine reads."""
    from io import StringIO

    from .bem import capytaine, quiet

    cpt = capytaine()
    name = binary_name(data)
    if name or b"\x00" in data:
        raise InputError(
            f"{owner}: this is no text, as was expected, but {name or 'a binary file'}"
        )
    text = StringIO(data.decode("utf-8", "replace"))
    try:
        with quiet(), warnings.catch_warnings():
            warnings.simplefilter("error")  # a row of too few columns is one to numpy
            mesh: Any = cpt.load_mesh(text, file_format=kind)
            merged = mesh.merged() if hasattr(mesh, "merged") else mesh
            found = np.asarray(merged.vertices[np.asarray(merged.faces)], dtype=np.float64)
    # What a damaged file makes the readers raise is anybody's guess.
    except Exception as error:
        words = " ".join(str(error).split())[:160]
        raise InputError(f"{owner}: this {kind.upper()} file cannot be read: {words}") from error
    if found.ndim != 3 or found.shape[1:] != (4, 3) or not len(found):
        raise InputError(f"{owner}: this {kind.upper()} file has no panels")
    return found


def _wet(owner: str, panels: FloatArray) -> FloatArray:
    """Return what of the panels is below z = 0, without a lid on it."""
    size = float(np.ptp(panels.reshape(-1, 3), axis=0).max())
    tolerance = 1e-6 * size
    pieces = [p for panel in panels for p in _cut(panel, tolerance)]
    if not pieces:
        raise InputError(f"{owner}: no panel is below the waterline")
    found = np.array(pieces)
    lid = np.all(found[..., 2] > -tolerance, axis=1)
    return np.asarray(found[~lid & (panel_areas(found) > 1e-12 * size**2)])


def _cut(panel: FloatArray, tolerance: float) -> list[FloatArray]:
    """Return what of a panel is below z = 0, in panels of four corners.

    A clip by one plane (Sutherland and Hodgman, 1974): four corners leave up to five, which are a
    quadrangle and a triangle.
    """
    z = np.where(np.abs(panel[:, 2]) < tolerance, 0.0, panel[:, 2])
    if np.all(z <= 0.0):
        return [np.column_stack([panel[:, :2], z])]
    if np.all(z >= 0.0):
        return []
    kept: list[FloatArray] = []
    for i in range(4):
        j = (i + 1) % 4
        here, there = panel[i], panel[j]
        if z[i] <= 0.0:
            kept.append(np.array([here[0], here[1], z[i]]))
        if z[i] * z[j] < 0.0:
            crossing = here + (there - here) * (z[i] / (z[i] - z[j]))
            kept.append(np.array([crossing[0], crossing[1], 0.0]))
    distinct = [p for k, p in enumerate(kept) if math.dist(p, kept[k - 1]) > tolerance]
    if len(distinct) < 3:
        return []
    if len(distinct) == 3:
        return [np.array([*distinct, distinct[2]])]
    found = [np.array(distinct[:4])]
    if len(distinct) == 5:
        found.append(np.array([distinct[3], distinct[4], distinct[0], distinct[0]]))
    return found
