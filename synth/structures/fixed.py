"""A structure some of whose parameters are held: `Fixed`, what `tune(..., fixed=...)` searches."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from typing_extensions import override

from models.basics import ComplexArray, FloatArray, InputError, check_range
from models.plant import LinearPlant

from ..loop import LinearController
from .structure import GeneralisedPlant, ParametrisedController, Structure


@dataclass(frozen=True, kw_only=True)
class Fixed(Structure):
    """A structure with some of its parameters held at given values."""

    structure: Structure  #: The structure.
    values: Mapping[str, float]  #: The values held, by name of a parameter.

    def bind(self, plant: LinearPlant) -> ParametrisedController:
        """Return the law; see `Structure.bind`.

        Raises
        ------
        InputError
            Also if a name is unknown, a value is outside its bounds, or nothing is left free.
        """
        return _FixedLaw(self.structure.bind(plant), self.values)


class _FixedLaw(ParametrisedController):
    """A law with some of its parameters held."""

    def __init__(self, law: ParametrisedController, values: Mapping[str, float]) -> None:
        known = {p.name: p for p in law.parameters}
        for name, value in values.items():
            if name not in known:
                raise InputError(
                    f"fixed: there is no parameter {name!r}; there are: {', '.join(known)}"
                )
            check_range("fixed", name, value, low=known[name].low, high=known[name].high)
        self._law = law
        self._free = [i for i, name in enumerate(known) if name not in values]
        if not self._free:
            raise InputError("fixed: at least one parameter must be left free")
        self._held = np.array([values.get(name, 0.0) for name in known])
        self.parameters = tuple(law.parameters[i] for i in self._free)
        self.dimensions = law.dimensions

    def _every(self, values: Sequence[Any]) -> list[Any]:
        every: list[Any] = self._held.tolist()
        for i, value in zip(self._free, values, strict=True):
            every[i] = value
        return every

    @override
    def response(self, values: Sequence[Any], s: Any) -> list[list[Any]]:
        return self._law.response(self._every(values), s)

    @override
    def controller(self, values: Sequence[float]) -> LinearController:
        return self._law.controller(self._every(values))

    @override
    def guesses(self, problem: GeneralisedPlant, omega: FloatArray) -> FloatArray:
        return self._law.guesses(problem, omega)[:, self._free]

    @override
    def others(self, problem: GeneralisedPlant, omega: FloatArray, seed: int) -> FloatArray:
        return self._law.others(problem, omega, seed)[:, self._free]

    @override
    def draw(self, points: FloatArray, omega: FloatArray, yu: ComplexArray) -> FloatArray:
        return self._law.draw(points, omega, yu)[:, self._free]

    @override
    def named(self, values: Sequence[float]) -> dict[str, float]:
        """Return all parameters by name, those that are held among them."""
        return self._law.named(self._every(values))
