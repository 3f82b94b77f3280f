"""Numbers as C: `Tables` of sizes, constants and arrays, which become headers and sources."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from models.basics import FloatArray
from models.sensing import numbers

_ROW = 6  # numbers on a line


class Tables:
    """What a law knows, by name, in three files: sizes, declarations and the arrays themselves.

    Names are written with the prefix ``mpc``, as in the hand-written C.
    """

    def __init__(self) -> None:
        self._sizes: list[str] = []
        self._constants: list[str] = []
        self._declared: list[str] = []
        self._arrays: list[str] = []
        #: The long ones, by name.
        self.tables: dict[str, tuple[FloatArray, ...]] = {}

    def size(self, name: str, value: int) -> None:
        """Add a size, of which the memory is made."""
        self._sizes.append(f"#define MPC_{name} {int(value)}")

    def constant(self, name: str, value: float) -> None:
        """Add a constant; it may be infinite."""
        if math.isinf(value):
            text = "INFINITY" if value > 0.0 else "-INFINITY"
        else:
            text = repr(float(value))
        self._constants.append(f"#define MPC_{name} ({text})")

    def array(self, name: str, values: npt.ArrayLike, *, parts: bool = False) -> None:
        """Add an array of doubles, row by row; with `parts` one for each of the first index."""
        given = np.asarray(values, dtype=np.float64)
        shape = f"[{len(given)}][{given[0].size}]" if parts else f"[{max(given.size, 1)}]"
        body = _braces(given.reshape(len(given), -1)) if parts else _lines(given)
        self._add(f"const double mpc_{name}{shape}", body)

    def whole(self, name: str, values: npt.ArrayLike) -> None:
        """Add an array of whole numbers."""
        given = [int(value) for value in np.ravel(np.asarray(values))]
        text = ", ".join(map(str, given))
        self._add(f"const int mpc_{name}[{len(given)}]", f"{{{text}}}")

    def large(self, name: str, parts: Sequence[FloatArray]) -> None:
        """Add arrays that are too long for one source: how `NativeLaw.tables` has them."""
        self._declared.append(f"extern const double *mpc_{name}[{len(parts)}];")
        self.tables[f"mpc_{name}"] = tuple(np.ascontiguousarray(part) for part in parts)

    @property
    def files(self) -> dict[str, str]:
        """Headers and sources by name."""
        data = [*self._constants, "", *self._declared]
        return {
            "mpc_sizes.h": _header("MPC_SIZES_H", self._sizes),
            "mpc_data.h": _header("MPC_DATA_H", ['#include "mpc_sizes.h"', "", *data]),
            "mpc_data.c": "\n".join(['#include "mpc_data.h"', "", *self._arrays, ""]),
        }

    def _add(self, declared: str, body: str) -> None:
        self._declared.append(f"extern {declared};")
        self._arrays.append(f"{declared} = {body};")


def _lines(values: FloatArray) -> str:
    """Return numbers in braces, some on a line."""
    flat = values.ravel().tolist() or [0.0]
    rows = [numbers(flat[k : k + _ROW]) for k in range(0, len(flat), _ROW)]
    return "{\n" + ",\n".join(rows) + "}"


def _braces(values: FloatArray) -> str:
    return "{" + ",\n".join(_lines(row) for row in values) + "}"


def _header(guard: str, lines: Sequence[str]) -> str:
    return "\n".join([f"#ifndef {guard}", f"#define {guard}", "", *lines, "", "#endif", ""])
