r"""Controllers drawn as a block diagram: weighted sums of measurements behind filter sections.

::

    y --> weights --> sections --+
                                 +--> u
    y --> weights --> sections --+

A `Branch` is a weighted sum of measurements behind filters of its own, so that an integrator which
several signals share is there once (two of them side by side would have a mode that no input
moves).  `DiagramLaw` makes of the branches what the search wants of any structure: response and
state space.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from models.basics import FloatArray, pick
from models.plant import LinearPlant

from ..loop import LinearController, closed_loop_matrix
from .blocks import FilterSection
from .structure import Bounds, Parameter, ParametrisedController, check_bounds

#: From the parameters by name to the weight of a measurement; sums and products only.
Weight = Callable[[Mapping[str, Any]], Any]


@dataclass(frozen=True, kw_only=True)
class Branch:
    """A weighted sum of measurements behind filter sections."""

    weights: Mapping[str, Weight]
    sections: tuple[FilterSection, ...] = ()


class DiagramLaw(ParametrisedController):
    """The law of a diagram with one command, the sum of its branches.

    Measurements of the plant that the diagram does not name are not heard.  `gains` are the
    parameters that the weights speak of; `bounds` replace those of parameters, by name.
    """

    def __init__(
        self,
        plant: LinearPlant,
        branches: Sequence[Branch],
        gains: Sequence[Parameter],
        bounds: Bounds,
    ) -> None:
        self._plant = plant
        self._branches = tuple(branches)
        self.sections = {s.name: s for branch in branches for s in branch.sections}
        every = [*gains, *(p for section in self.sections.values() for p in section.parameters)]
        check_bounds("structure", bounds, [p.name for p in every])
        ranges = [bounds.get(p.name, (p.low, p.high)) for p in every]
        self.parameters = tuple(
            replace(p, low=low, high=high) for p, (low, high) in zip(every, ranges, strict=True)
        )
        self._slices: dict[str, slice] = {}
        at = len(gains)
        for name, section in self.sections.items():
            self._slices[name] = slice(at, at + len(section.parameters))
            at += len(section.parameters)
        self._gains = tuple(p.name for p in gains)
        self.heard = tuple(dict.fromkeys(y for branch in branches for y in branch.weights))
        columns = pick("structure", "measurement", plant.measurements, self.heard)
        self._columns = dict(zip(self.heard, columns, strict=True))
        self._kept: dict[tuple[str, ...], npt.NDArray[np.intp]] = {}
        self.dimensions = len(self.parameters) + 1

    def response(self, values: Sequence[Any], s: Any) -> list[list[Any]]:
        """Return C(s), one list of ny entries."""
        row: list[Any] = [0.0] * len(self._plant.measurements)
        for weights, sections in self._numbered(values):
            through: Any = None
            for section, own in sections:
                step = section.response(own, s)
                through = step if through is None else through * step
            for k, weight in weights.items():
                term = weight if through is None else through * weight
                row[k] = term if isinstance(row[k], float) else term + row[k]
        return [row]

    def controller(self, values: Sequence[float]) -> LinearController:
        """Return the controller in state space; it has zeros for what it does not hear."""
        ny = len(self._plant.measurements)
        branches = [
            (weights, [section.matrices([float(v) for v in own]) for section, own in sections])
            for weights, sections in self._numbered(values)
        ]
        n = sum(len(part[0]) for _, parts in branches for part in parts)
        A, B, C, D = (np.zeros(shape) for shape in ((n, n), (n, ny), (1, n), (1, ny)))
        at = 0
        for weights, parts in branches:
            # The signal behind each section, of the states and of what is measured.
            of_states, of_measured = np.zeros(n), np.zeros(ny)
            of_measured[list(weights)] = list(weights.values())
            for own, into, out, direct in parts:
                states = slice(at, at + len(own))
                A[states] = into * of_states
                A[states, states] = own
                B[states] = into * of_measured
                of_states, of_measured = of_states * direct[0, 0], of_measured * direct[0, 0]
                of_states[states] = out[0]
                at = states.stop
            C[0] += of_states
            D[0] += of_measured
        names = self._plant.measurements, self._plant.inputs
        return LinearController(A=A, B=B, C=C, D=D, measurements=names[0], inputs=names[1])

    def _numbered(
        self, values: Sequence[Any]
    ) -> Iterator[tuple[dict[int, Any], list[tuple[FilterSection, Sequence[Any]]]]]:
        """Return the weights of each branch by measurement, and its sections with their values."""
        gains = dict(zip(self._gains, values[: len(self._gains)], strict=True))
        for branch in self._branches:
            weights = {self._columns[y]: weight(gains) for y, weight in branch.weights.items()}
            yield weights, [(s, values[self._slices[s.name]]) for s in branch.sections]

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


def _closure(pattern: npt.NDArray[np.bool_], start: npt.NDArray[np.bool_]) -> Any:
    """Return what can be reached from a set of states; `pattern` [i, j] leads from j to i."""
    found = start.copy()
    while True:
        more = found | np.any(pattern[:, found], axis=1)
        if np.array_equal(more, found):
            return found
        found = more
