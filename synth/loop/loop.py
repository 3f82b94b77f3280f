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

For reports; the optimiser, which wants slopes too, has them in `synth.question.loop_numbers`, and
the verification uses neither.

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

import numpy as np
import numpy.typing as npt

from models.basics import check_range
from models.plant import LinearPlant, PlantResponse

Complex = Any  # a vector over the nodes, or a number
Matrix = list[list[Complex]]


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


def numeric_blocks(response: PlantResponse) -> PlantBlocks:
    """Return the blocks of a response as vectors over the nodes."""

    def nested(block: npt.NDArray[np.complex128]) -> Matrix:
        rows, columns = block.shape[1:]
        return [[block[:, i, j] for j in range(columns)] for i in range(rows)]

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
        total = x * y + total
    return total


def _solve(matrix: Matrix, right: Sequence[Complex]) -> list[Complex]:
    """Solve a small system whose entries are vectors over the nodes, without pivoting."""
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
