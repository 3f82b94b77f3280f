r"""Controllers drawn as a block diagram: weighted sums of measurements behind filter sections.

::

    y --> weights --> sections --+
                                 +--> sections --> u
    y --> weights --> sections --+

A `Branch` is a weighted sum of measurements behind filters of its own; a `Group` adds branches
and filters what comes out, so that an integrator which two signals share is there once (two of
them side by side would have a mode that no input moves).  `DiagramLaw` makes of it what the
search wants of any structure: response, characteristic polynomial, state space.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from models.basics import FloatArray, pick
from models.plant import LinearPlant

from ..loop import LinearController, closed_loop_matrix
from .blocks import FilterSection, Matrices, series
from .structure import Bounds, Parameter, ParametrisedController, check_bounds

#: From the parameters by name to the weight of a measurement; sums and products only.
Weight = Callable[[Mapping[str, Any]], Any]


@dataclass(frozen=True, kw_only=True)
class Branch:
    """A weighted sum of measurements behind filter sections."""

    weights: Mapping[str, Weight]
    sections: tuple[FilterSection, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Group:
    """A sum of branches behind filter sections that they share."""

    branches: tuple[Branch, ...]
    sections: tuple[FilterSection, ...] = ()


class DiagramLaw(ParametrisedController):
    """The law of a diagram with one command.

    Parameters
    ----------
    plant
        The plant; measurements that the diagram does not name are not heard.
    groups
        The diagram; the command is the sum of the groups.
    gains
        Parameters that the weights speak of.
    bounds
        Bounds that replace those of parameters, by name.
    """

    def __init__(
        self,
        plant: LinearPlant,
        groups: Sequence[Group],
        gains: Sequence[Parameter],
        bounds: Bounds | None = None,
    ) -> None:
        self._plant = plant
        self._groups = tuple(groups)
        sections: dict[str, FilterSection] = {}
        for group in self._groups:
            for section in (*group.sections, *(s for b in group.branches for s in b.sections)):
                sections[section.name] = section
        self.sections = sections
        every = [*gains, *(p for section in sections.values() for p in section.parameters)]
        given = dict(bounds or {})
        check_bounds("structure", given, [p.name for p in every])
        self.parameters = tuple(_bounded(p, given.get(p.name)) for p in every)
        self._slices: dict[str, slice] = {}
        at = len(gains)
        for name, section in sections.items():
            self._slices[name] = slice(at, at + len(section.parameters))
            at += len(section.parameters)
        self._gains = tuple(p.name for p in gains)
        self.heard = tuple(
            dict.fromkeys(y for g in self._groups for b in g.branches for y in b.weights)
        )
        columns = pick("structure", "measurement", plant.measurements, self.heard)
        self._columns = dict(zip(self.heard, columns, strict=True))
        self._kept: dict[tuple[str, ...], npt.NDArray[np.intp]] = {}
        self.dimensions = len(self.parameters) + 1

    def response(self, values: Sequence[Any], s: Any) -> list[list[Any]]:
        """Return C(s), one list of ny entries."""
        row: list[Any] = [0.0] * len(self._plant.measurements)
        gains = dict(zip(self._gains, values[: len(self._gains)], strict=True))
        for group in self._groups:
            outer = self._chain(group.sections, values, s)
            for branch in group.branches:
                inner = self._chain(branch.sections, values, s, outer)
                for name, weight in branch.weights.items():
                    k = self._columns[name]
                    term = weight(gains) if inner is None else inner * weight(gains)
                    row[k] = term if isinstance(row[k], float) else term + row[k]
        return [row]

    def _chain(
        self, sections: Sequence[FilterSection], values: Sequence[Any], s: Any, start: Any = None
    ) -> Any:
        for section in sections:
            step = section.response(values[self._slices[section.name]], s)
            start = step if start is None else start * step
        return start

    def controller(self, values: Sequence[float]) -> LinearController:
        """Return the controller in state space; it has zeros for what it does not hear."""
        gains = dict(zip(self._gains, values[: len(self._gains)], strict=True))
        A, B, C, D = _parallel([self._group(group, values, gains) for group in self._groups])
        names = self._plant.measurements, self._plant.inputs
        return LinearController(A=A, B=B, C=C, D=D, measurements=names[0], inputs=names[1])

    def _group(self, group: Group, values: Sequence[float], gains: Mapping[str, float]) -> Matrices:
        parts, ny = [], len(self._plant.measurements)
        for branch in group.branches:
            row = np.zeros((1, ny))
            for name, weight in branch.weights.items():
                row[0, self._columns[name]] += weight(gains)
            empty = np.zeros((0, 0)), np.zeros((0, ny)), np.zeros((1, 0)), row
            parts.append(self._behind(empty, branch.sections, values))
        return self._behind(_parallel(parts), group.sections, values)

    def _behind(
        self, matrices: Matrices, sections: Sequence[FilterSection], values: Sequence[float]
    ) -> Matrices:
        for section in sections:
            own = [float(v) for v in values[self._slices[section.name]]]
            matrices = series(matrices, section.matrices(own))
        return matrices

    def closed_loop_matrix(self, plant: LinearPlant, values: Sequence[float]) -> FloatArray:
        """Return the state matrix of the loop, without what stands before or behind it.

        States that the command does not reach (the reference unit's filter) and states that
        the controller does not hear (sensors that it has no use for) keep their own poles,
        which `_looped` has checked.
        """
        whole = closed_loop_matrix(plant, self.controller(values))
        inside = np.append(self._looped(plant), np.arange(len(plant.A), len(whole)))
        return np.asarray(whole[np.ix_(inside, inside)])

    def _looped(self, plant: LinearPlant) -> npt.NDArray[np.intp]:
        """Return the states of the plant that are part of the loop."""
        if plant.states not in self._kept:
            pattern = plant.A != 0.0
            heard = [plant.measurements.index(name) for name in self.heard]
            reached = _closure(pattern, np.any(plant.B != 0.0, axis=1))
            seen = _closure(pattern.T, np.any(plant.C[heard] != 0.0, axis=0))
            inside = reached & seen
            outside = plant.A[np.ix_(~inside, ~inside)]
            slowest = np.linalg.eigvals(outside).real.max(initial=-np.inf)
            if not slowest < 0.0:
                inside[:] = True
            self._kept[plant.states] = np.flatnonzero(inside)
        return self._kept[plant.states]

    def with_sections(self, values: FloatArray, points: FloatArray) -> FloatArray:
        """Return candidates whose sections' parameters are drawn, clipped to the bounds."""
        for name, section in self.sections.items():
            at = self._slices[name]
            values[:, at] = section.guess(points[:, at])
        return self.clipped(values)

    def index(self, name: str) -> int:
        """Return the position of a parameter."""
        return [p.name for p in self.parameters].index(name)


def _bounded(parameter: Parameter, limits: tuple[float, float] | None) -> Parameter:
    if limits is None:
        return parameter
    return replace(parameter, low=limits[0], high=limits[1])


def _parallel(parts: Sequence[Matrices]) -> Matrices:
    """Return the sum of systems with the same inputs and one output."""
    A, B, C, D = parts[0]
    for A2, B2, C2, D2 in parts[1:]:
        n, m = len(A), len(A2)
        A = np.block([[A, np.zeros((n, m))], [np.zeros((m, n)), A2]])
        B, C, D = np.vstack([B, B2]), np.hstack([C, C2]), D + D2
    return A, B, C, D


def _closure(pattern: npt.NDArray[np.bool_], start: npt.NDArray[np.bool_]) -> Any:
    """Return what can be reached from a set of states; `pattern` [i, j] leads from j to i."""
    found = start.copy()
    while True:
        more = found | np.any(pattern[:, found], axis=1)
        if np.array_equal(more, found):
            return found
        found = more
