r"""How the linear plant's matrices move with a number of the case.

::

    number -> PlantData -> p            short formulas: differences of fourth order
                           p -> A, B .. automatic differentiation of the nonlinear plant
    number -> sensors ->  filters       short formulas again

The payload's drag coefficient is a parameter p of the plant too.  Where it is linearised with the
response it moves with every other number; that is `elasticity`'s matter, here its own slope is
returned beside the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from models.basics import FloatArray
from models.case import Case
from models.plant import MEAN_LOSSES, LinearPlant, Plant, PlantData, build_plant, parameter_values
from models.sensing import with_sensors

from .differences import derivative
from .fields import Number

BLOCKS = ("A", "B", "E", "C", "D", "F", "Cz", "Dz", "Fz")
"""The matrices of a linear plant, in the order of `Plant.jacobians`."""

_DRAG = "payload.linear_drag"


@dataclass(frozen=True, kw_only=True, eq=False)
class MatrixSlope:
    """Derivatives of a linear plant with respect to one number.

    Attributes
    ----------
    blocks
        Derivative of each of `BLOCKS`, in its shape.
    delays
        Derivatives of the delays, (ny,) [s per unit].
    """

    blocks: dict[str, FloatArray]
    delays: FloatArray

    @property
    def is_zero(self) -> bool:
        """Whether nothing moves."""
        return not (self.delays.any() or any(block.any() for block in self.blocks.values()))


class PlantSlopes:
    """Slopes of the plant of a case with its sensors.

    Parameters
    ----------
    case
        The case.
    masses
        Rope masses.
    drag
        Linear drag coefficient of the payload at which the slopes are taken [N s/m].
    measurements
        What the controller hears.
    """

    def __init__(
        self, case: Case, *, masses: int, drag: float, measurements: Sequence[str]
    ) -> None:
        self.case = case
        self._measurements = measurements
        self._model = build_plant(case, masses)
        self._drag = drag
        self._bare = self._model.linearise(drag=drag)
        self._by_parameter = _jacobian(self._model, drag)
        self._nominal = _parameters(case, self._model)

    @property
    def plant(self) -> LinearPlant:
        """The plant itself."""
        return self._heard(self._bare, self.case)

    def of_drag(self) -> MatrixSlope:
        """Return the slopes in the drag coefficient [per N s/m]."""
        unit = np.zeros(len(self._nominal))
        unit[list(self._model.parameters).index(_DRAG)] = 1.0
        return self._slope(self.case, unit, np.zeros(len(self.plant.delays)))

    def of(self, number: Number) -> MatrixSlope:
        """Return the slopes in a number of the case [per its unit]."""

        def parameters(value: float) -> FloatArray:
            other = changed(self.case, number, value)
            return np.append(_parameters(other, self._model), _delays(other, self.plant))

        count = len(self._nominal)
        both = np.asarray(derivative(parameters, number.value), dtype=np.float64)
        slope = self._slope(self.case, both[:count], both[count:])
        if not number.path.startswith("sensors."):
            return slope

        def filters(value: float) -> FloatArray:
            heard = self._heard(self._bare, changed(self.case, number, value))
            return np.concatenate([getattr(heard, name).ravel() for name in BLOCKS])

        own = np.asarray(derivative(filters, number.value, common=True), dtype=np.float64)
        return MatrixSlope(blocks=_add(slope.blocks, own), delays=slope.delays)

    def _slope(self, case: Case, direction: FloatArray, delays: FloatArray) -> MatrixSlope:
        """Return the slopes for a direction of the plant's parameters; the sensors are affine."""
        moved = {
            name: getattr(self._bare, name) + jacobian @ direction
            for name, jacobian in self._by_parameter.items()
        }
        here, there = self.plant, self._heard(replace(self._bare, **moved), case)
        blocks = {name: getattr(there, name) - getattr(here, name) for name in BLOCKS}
        return MatrixSlope(blocks=blocks, delays=delays)

    def _heard(self, bare: LinearPlant, case: Case) -> LinearPlant:
        return with_sensors(bare, case.sensors).select(measurements=self._measurements)


def changed(case: Case, number: Number, value: float) -> Case:
    """Return the case with another value of a number; implausible values are not remarked on."""
    return case.variant(number.change(value))


def _parameters(case: Case, model: Plant) -> FloatArray:
    """Return the plant's p of a case on the given lumping, a given drag coefficient included."""
    data = replace(PlantData.from_case(case), masses=model.masses)
    values = parameter_values(data)
    values[_DRAG] = case.payload.fixed_drag or 0.0
    return np.array([values[name] for name in model.parameters])


def _delays(case: Case, plant: LinearPlant) -> FloatArray:
    unit = case.sensors.mru
    late = {"mru.heave", "mru.heave_rate"}
    return np.array(
        [
            (unit.delay if unit else 0.0)
            if name in late
            else case.sensors.telemetry.delay
            if name.startswith("payload.")
            else 0.0
            for name in plant.measurements
        ]
    )


def _jacobian(model: Plant, drag: float) -> dict[str, FloatArray]:
    """Return d block / d p for every block at rest, (rows, columns, np), by CasADi."""
    rest = model.operating_point({_DRAG: drag, **MEAN_LOSSES})
    p = ca.SX.sym("p", rest.p.size)
    blocks = model.jacobians(rest.x, rest.u, np.zeros(len(model.disturbances)), p)
    found = {}
    for name, block in zip(BLOCKS, blocks, strict=True):
        slope = ca.Function("slope", [p], [ca.jacobian(ca.vec(ca.SX(block)), p)])
        values = np.asarray(slope(rest.p).full(), dtype=np.float64)
        # CasADi counts down the columns.
        found[name] = values.reshape((*reversed(block.shape), rest.p.size)).transpose(1, 0, 2)
    return found


def _add(blocks: dict[str, FloatArray], flat: FloatArray) -> dict[str, FloatArray]:
    result, start = {}, 0
    for name, block in blocks.items():
        result[name] = block + flat[start : start + block.size].reshape(block.shape)
        start += block.size
    return result
