r"""The closed loop on frequency nodes: every response from one diagram, exact delays included.

::

                 w ---->+-----------+----> z
                        |   plant   |
              +--> u -->|           |----> y --+
              |         +-----------+          |
              |                                |
              +----------- C(s) <--------------+

    z = zw w + zu u,  y = yw w + yu u,  u = C y
    F = zw + zu (I - C yu)^-1 C yw          closed loop from w to z
    L = -C yu                               loop gain broken at u
    1 + L_i = det(I - C yu) / minor_ii      loop i broken, all others closed; S_i its inverse

The formulas are stated once, for NumPy's complex arrays and for `Phasor` symbols (CasADi knows
only reals): the optimiser and the reports thus cannot disagree on what a loop is.  (The
verification uses none of this.)

Quadratic drag enters as an equivalent linear element: stochastic linearisation replaces the force
q |v| v of a Gaussian velocity by C v, C = q sqrt(8/pi) sigma_v (Caughey 1963; Roberts and Spanos,
*Random Vibration and Statistical Linearization*, 1990, ch. 5).  sigma_v is the closed loop's own,
so C is solved together with the gains: one more variable and one equality in the programme, a
fixed point elsewhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from models.basics import check_range
from models.plant import LinearPlant, PlantResponse

# What both kinds of number share; NumPy and CasADi have no common static type.
Complex = Any
Matrix = list[list[Complex]]


@dataclass(frozen=True)
class Phasor:
    """A vector of complex numbers as two CasADi vectors (or scalars) of equal shape."""

    re: Any
    im: Any

    def __add__(self, other: Complex) -> Phasor:
        b = _phasor(other)
        return Phasor(self.re + b.re, self.im + b.im)

    __radd__ = __add__

    def __neg__(self) -> Phasor:
        return Phasor(-self.re, -self.im)

    def __sub__(self, other: Complex) -> Phasor:
        b = _phasor(other)
        return Phasor(self.re - b.re, self.im - b.im)

    def __rsub__(self, other: Complex) -> Phasor:
        return _phasor(other) - self

    def __mul__(self, other: Complex) -> Phasor:
        b = _phasor(other)
        return Phasor(self.re * b.re - self.im * b.im, self.re * b.im + self.im * b.re)

    __rmul__ = __mul__

    def __truediv__(self, other: Complex) -> Phasor:
        b = _phasor(other)
        scale = 1.0 / (b.re * b.re + b.im * b.im)
        return Phasor(
            (self.re * b.re + self.im * b.im) * scale, (self.im * b.re - self.re * b.im) * scale
        )

    def __rtruediv__(self, other: Complex) -> Phasor:
        return _phasor(other) / self

    def squared(self) -> Any:
        """Return the squared magnitude."""
        return self.re * self.re + self.im * self.im


def _phasor(value: Complex) -> Phasor:
    if isinstance(value, Phasor):
        return value
    if isinstance(value, complex | np.complexfloating):
        return Phasor(value.real, value.imag)
    return Phasor(value, 0.0)


def constant(values: npt.NDArray[np.complex128]) -> Phasor:
    """Return numbers, (k,), as a phasor of CasADi constants."""
    return Phasor(
        ca.DM(np.ascontiguousarray(values.real)), ca.DM(np.ascontiguousarray(values.imag))
    )


@dataclass(frozen=True, kw_only=True)
class PlantBlocks:
    """A plant's response at the nodes, as nested lists of vectors over the nodes."""

    zw: Matrix
    zu: Matrix
    yw: Matrix
    yu: Matrix
    outputs: tuple[str, ...]
    disturbances: tuple[str, ...]

    def row(self, output: str) -> int:
        """Return the position of an output."""
        return self.outputs.index(output)

    def column(self, disturbance: str) -> int:
        """Return the position of a disturbance."""
        return self.disturbances.index(disturbance)


def numeric_blocks(response: PlantResponse, *, symbolic: bool = False) -> PlantBlocks:
    """Return the blocks of a response, as NumPy vectors or as CasADi constants."""

    def nested(block: npt.NDArray[np.complex128]) -> Matrix:
        rows, columns = block.shape[1:]
        make = constant if symbolic else np.asarray
        return [[make(block[:, i, j]) for j in range(columns)] for i in range(rows)]

    return PlantBlocks(
        zw=nested(response.zw),
        zu=nested(response.zu),
        yw=nested(response.yw),
        yu=nested(response.yu),
        outputs=response.outputs,
        disturbances=response.disturbances,
    )


def closed_loop(
    blocks: PlantBlocks, law: Matrix, wanted: Sequence[tuple[str, str]]
) -> Mapping[tuple[str, str], Complex]:
    """Return the closed-loop responses of the wanted (output, disturbance) pairs."""
    difference = _difference(blocks, law)
    commands: dict[int, list[Complex]] = {}  # per disturbance: the commands u it causes
    result: dict[tuple[str, str], Complex] = {}
    for output, disturbance in wanted:
        row, column = blocks.row(output), blocks.column(disturbance)
        if column not in commands:
            heard = [_dot(line, [y[column] for y in blocks.yw]) for line in law]
            commands[column] = _solve(difference, heard)
        result[output, disturbance] = blocks.zw[row][column] + _dot(
            blocks.zu[row], commands[column]
        )
    return result


def return_differences(blocks: PlantBlocks, law: Matrix) -> list[Complex]:
    """Return 1 + L_i for each loop i broken at its input with all other loops closed."""
    difference = _difference(blocks, law)
    count = len(difference)
    if count == 1:
        return [difference[0][0]]
    result = []
    for i in range(count):
        unit = [1.0 if k == i else 0.0 for k in range(count)]
        result.append(1.0 / _solve(difference, unit)[i])
    return result


def determinant(blocks: PlantBlocks, law: Matrix) -> Complex:
    """Return det(I - C yu): closed-loop over open-loop characteristic function."""
    rows = [list(line) for line in _difference(blocks, law)]
    result: Complex = rows[0][0]
    for k in range(len(rows) - 1):
        for i in range(k + 1, len(rows)):
            ratio = rows[i][k] / rows[k][k]
            for j in range(k + 1, len(rows)):
                rows[i][j] = rows[i][j] - ratio * rows[k][j]
        result = result * rows[k + 1][k + 1]
    return result


def close_scalar(blocks: PlantBlocks, output: str, disturbance: str, gain: Any) -> PlantBlocks:
    """Return the blocks with `disturbance` = ... + gain * `output` closed around the plant.

    This is how an equivalent linear element (drag: force = -C velocity) enters with a
    coefficient that is itself unknown: a rank-one update of every block,
    ``P_ab + P_af gain (1 - P_vf gain)^-1 P_vb`` (Woodbury).
    """
    v, f = blocks.row(output), blocks.column(disturbance)
    factor = gain / (1.0 - blocks.zw[v][f] * gain)
    to_z = [blocks.zw[i][f] * factor for i in range(len(blocks.zw))]
    to_y = [blocks.yw[i][f] * factor for i in range(len(blocks.yw))]

    def updated(block: Matrix, out: list[Complex], row: list[Complex]) -> Matrix:
        return [
            [entry + out[i] * row[j] for j, entry in enumerate(line)]
            for i, line in enumerate(block)
        ]

    return PlantBlocks(
        zw=updated(blocks.zw, to_z, blocks.zw[v]),
        zu=updated(blocks.zu, to_z, blocks.zu[v]),
        yw=updated(blocks.yw, to_y, blocks.zw[v]),
        yu=updated(blocks.yu, to_y, blocks.zu[v]),
        outputs=blocks.outputs,
        disturbances=blocks.disturbances,
    )


def _difference(blocks: PlantBlocks, law: Matrix) -> Matrix:
    """Return I - C yu."""
    columns = range(len(law))
    return [
        [(1.0 if i == j else 0.0) - _dot(line, [y[j] for y in blocks.yu]) for j in columns]
        for i, line in enumerate(law)
    ]


def _dot(a: Sequence[Complex], b: Sequence[Complex]) -> Complex:
    total: Complex = 0.0
    for x, y in zip(a, b, strict=True):
        if isinstance(x, float | int) and x == 0.0:
            continue  # a structural zero costs nothing
        total = y * x + total  # the response first: it knows complex arithmetic
    return total


def _solve(matrix: Matrix, right: Sequence[Complex]) -> list[Complex]:
    """Solve a small system whose entries are vectors over the nodes (no pivoting: symbols)."""
    count = len(matrix)
    rows = [list(line) for line in matrix]
    b = list(right)
    for k in range(count):
        for i in range(k + 1, count):
            ratio = rows[i][k] / rows[k][k]
            for j in range(k + 1, count):
                rows[i][j] = rows[i][j] - ratio * rows[k][j]
            b[i] = b[i] - ratio * b[k]
    for i in reversed(range(count)):
        for j in range(i + 1, count):
            b[i] = b[i] - rows[i][j] * b[j]
        b[i] = b[i] / rows[i][i]
    return b


@dataclass(frozen=True, kw_only=True)
class DragElement:
    """Quadratic drag as force = -C velocity, C = quadratic sqrt(8/pi) sigma of the velocity.

    Parameters
    ----------
    quadratic
        q of the drag force q |v| v [N s2/m2].
    velocity
        Name of the velocity among the plant's outputs.
    force
        Name of the force among the plant's disturbances.
    reference
        The coefficient that the plant already holds [N s/m]; the element adds C minus this.
    """

    quadratic: float
    velocity: str = "payload.velocity"
    force: str = "payload.force"
    reference: float = 0.0

    def __post_init__(self) -> None:
        check_range("DragElement", "quadratic", self.quadratic, low=0.0, unit="N s2/m2")
        check_range("DragElement", "reference", self.reference, low=0.0, unit="N s/m")

    @property
    def slope(self) -> float:
        """C per sigma of the velocity [N s2/m2]."""
        return self.quadratic * float(np.sqrt(8.0 / np.pi))


def with_drag(plant: LinearPlant, element: DragElement, coefficient: float) -> LinearPlant:
    """Return the plant with the element's drag at `coefficient` [N s/m].

    Raises
    ------
    InputError
        If a name is unknown or the velocity is no pure state of the plant (has a direct term).
    """
    gain = element.reference - coefficient
    return plant.with_element(element.velocity, element.force, gain)
