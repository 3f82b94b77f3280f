"""The controller of a design on rows of a spread: its response and poles, whatever its structure.

A design's controller stays what it is while the world varies: the structure is bound to the
design's own plant, and only the parameters that the spread names move.  `ParametrisedController`
states C(s, p) in plain arithmetic, so columns of parameters give all rows at once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from models.basics import ComplexArray, FloatArray, IndexArray
from models.spread import GAINS, Spread

from ..question import GAINS as THESIS
from ..question import DesignQuestion
from ..structures import ParametrisedController
from .numbers import at_rows, part_of

_NUDGE = 0.01  # of a parameter's size, to see whether the controller's poles move with it
_SAME = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class LawColumns:
    """A controller's parameters as columns."""

    #: The structure bound to its plant, and what it hears, in its plant's order.
    law: ParametrisedController
    measurements: tuple[str, ...]
    #: Column of each parameter, (n,) or (1,); `synth.loop.Dual` numbers of one loop too.
    values: tuple[FloatArray, ...]
    poles: ComplexArray  #: The controller's own poles, (n, p) or (1, p) [1/s].

    def part(self, index: IndexArray) -> LawColumns:
        """Return some of the rows."""
        values = tuple(part_of(column, index) for column in self.values)
        return replace(self, values=values, poles=part_of(self.poles, index))

    @property
    def swiftest(self) -> float:
        """Size of the largest of the poles [1/s]."""
        return float(np.abs(self.poles).max(initial=0.0))

    def response(self, rows: IndexArray, s: ComplexArray) -> dict[str, Any]:
        """Return C of each measurement of some rows at s, each (1 or m, 1 or k)."""
        found = self.law.response([at_rows(v, rows) for v in self.values], s)[0]
        return dict(zip(self.measurements, found, strict=True))

    def without_poles(self, rows: IndexArray, s: ComplexArray) -> Any:
        """Return the factor that takes the controller's poles out of a function of s.

        prod (s - p)/(s + |p|): what had them has neither poles nor new zeros in the right half
        plane, and nothing that is narrow because the controller is.
        """
        factor: Any = 1.0
        for column in self.poles.T:
            p = column[rows, None] if len(column) > 1 else column
            size = np.abs(p)
            factor = factor * ((s - p) / (s + np.where(size > _SAME, size, 1.0)))
        return factor


class DesignLaw:
    """A structure, bound to its plant, with its parameters, asked about rows of a spread."""

    def __init__(self, question: DesignQuestion, parameters: Mapping[str, float]) -> None:
        self.law, self.amplifier = question.law, question.amplifier or 1.0
        self._own = dict(parameters)
        self.measurements = tuple(question.structure.measurements)
        self._names = [p.name for p in self.law.parameters]
        self._own_poles = poles = self._poles(self._row(self._own))
        self._fixed = {
            p.name
            for p in self.law.parameters
            if self._still(poles, p.name, self._own[p.name] + _NUDGE * p.scale)
        }

    def columns(self, spread: Spread, rows: FloatArray) -> LawColumns:
        """Return the parameters of a spread's rows, (n, d)."""
        own = {name: np.array([value]) for name, value in self._own.items()}
        moved = set()
        for j, path in enumerate(spread.paths):
            if path.startswith(GAINS):
                name = path.removeprefix(GAINS)
                own[name] = rows[:, j]
                moved.add(name)
        values = tuple(np.broadcast_arrays(*self._row(own)) if "A" in moved else self._row(own))
        if moved & {*self._names} <= self._fixed:
            poles = self._own_poles[None]
        else:
            table = np.stack(np.broadcast_arrays(*values), axis=1)
            poles = np.array([self._poles(row) for row in table])
        return LawColumns(law=self.law, measurements=self.measurements, values=values, poles=poles)

    def _row(self, own: Mapping[str, Any]) -> list[Any]:
        """Return the law's parameters of named ones; the amplifier A multiplies every gain."""
        scale = own.get("A", self.amplifier) / self.amplifier
        return [scale * own[name] if name in THESIS else own[name] for name in self._names]

    def _poles(self, values: Sequence[float]) -> ComplexArray:
        A = self.law.controller([float(v) for v in values]).A
        return np.asarray(np.linalg.eigvals(A), dtype=np.complex128)

    def _still(self, poles: ComplexArray, name: str, value: float) -> bool:
        """Return whether the controller has the same poles with another parameter."""
        moved = self._poles(self._row({**self._own, name: value}))
        gap = np.abs(moved[:, None] - poles).min(axis=1, initial=np.inf)
        return bool(np.all(gap <= _SAME * max(np.abs(poles).max(initial=0.0), 1.0)))
