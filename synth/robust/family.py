"""Family of plants and seas: what one set of gains has to hold.

    case + what varies + sea states -> Family -> corners, grid, random draws -> cases

Parameters of the case are named by their dotted paths; a list of numbers stands for the whole
range between its ends, `DiscreteValues` for its values alone.  The sea states are few and each
has an occurrence, as in a scatter diagram.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from models.basics import FloatArray, InputError, check_range, parse_quantity
from models.case import Case
from models.sea import Scatter
from models.spread import ALIASES, Samples, Spread, Uniform, field_of, with_payload

_MOST_CORNERS = 4096


@dataclass(frozen=True, kw_only=True)
class SeaState:
    """A sea state: H_s [m], T_p [s] (None: the case's own), and its occurrence."""

    significant_height: float
    peak_period: float | None = None
    occurrence: float = 1.0

    def __post_init__(self) -> None:
        check_range("sea state", "occurrence", self.occurrence, low=0.0)

    def changes(self, case: Case) -> dict[str, float]:
        """Return the sea's fields as changes of a case, in the variables of its spectrum."""
        period = {} if self.peak_period is None else case.sea.peaking_at(self.peak_period)
        return {**period, "sea.significant_height": self.significant_height}

    def __str__(self) -> str:
        """Return the state in a few characters."""
        period = "" if self.peak_period is None else f", T_p {self.peak_period:.3g} s"
        return f"H_s {self.significant_height:.3g} m{period}"


def sea_states(scatter: Scatter) -> list[SeaState]:
    """Return the sea states of a scatter diagram, those of all its months and headings as one."""
    shares: dict[tuple[float, float], float] = {}
    columns = (scatter.significant_height, scatter.peak_period, scatter.occurrence)
    for height, period, share in zip(*(column.tolist() for column in columns), strict=True):
        shares[height, period] = shares.get((height, period), 0.0) + share
    return [
        SeaState(significant_height=height, peak_period=period, occurrence=share)
        for (height, period), share in shares.items()
    ]


@dataclass(frozen=True)
class DiscreteValues:
    """Values of a parameter with nothing in between: layers of a drum, types of a load."""

    values: tuple[Any, ...]

    def __init__(self, *values: Any) -> None:
        object.__setattr__(self, "values", values)


@dataclass(frozen=True, kw_only=True)
class Axis:
    """One parameter that varies: its path, its values, and whether it takes those between."""

    path: str
    values: tuple[Any, ...]
    continuous: bool

    @property
    def low(self) -> float:
        """Lower end of a continuous axis."""
        return float(min(self.values))

    @property
    def high(self) -> float:
        """Upper end of a continuous axis."""
        return float(max(self.values))


@dataclass(frozen=True, kw_only=True)
class Member:
    """A point of the parameters, in their axes' order, in a sea state by its index."""

    point: tuple[Any, ...]
    sea: int = 0


@dataclass(frozen=True, kw_only=True, eq=False)
class Family:
    """All plants and seas that a case stands for."""

    case: Case  #: The case that is varied.
    axes: tuple[Axis, ...]  #: What varies.
    seas: tuple[SeaState, ...]  #: Sea states with their occurrence.

    @classmethod
    def of(
        cls,
        case: Case,
        vary: Mapping[str, Sequence[Any] | DiscreteValues],
        seas: Sequence[SeaState | Sequence[float]] | None = None,
    ) -> Family:
        """Return the family of a case.

        Parameters
        ----------
        case
            The case.
        vary
            By dotted path (or `depth`, `payload`, `added_mass`, `stiffness`, `radius`,
            `delay`): values, of which numbers span a range, or a `DiscreteValues`.  Added mass and
            submerged weight grow with `payload.mass` unless they are varied themselves.
        seas
            `SeaState`, (H_s, T_p) or (H_s, T_p, occurrence); the case's own if left out.

        Raises
        ------
        InputError
            If a path is unknown, a value is not valid, or there is nothing to vary.
        """
        axes = tuple(_axis(case, ALIASES.get(path, path), v) for path, v in vary.items())
        paths = [axis.path for axis in axes]
        if len(set(paths)) < len(paths):
            raise InputError(f"family: a path is given twice, got {', '.join(paths)}")
        states = [_sea(s) for s in seas] if seas else [_own_sea(case)]
        if not sum(s.occurrence for s in states) > 0.0:
            raise InputError("family: at least one sea state must have an occurrence above 0")
        return cls(case=case, axes=axes, seas=tuple(s for s in states if s.occurrence > 0.0))

    @property
    def occurrence(self) -> FloatArray:
        """Occurrence of each sea state, adding up to 1."""
        weights = np.array([s.occurrence for s in self.seas])
        return np.asarray(weights / weights.sum())

    @property
    def continuous(self) -> tuple[int, ...]:
        """Indices of the axes that take every value between their ends."""
        return tuple(i for i, a in enumerate(self.axes) if a.continuous and a.low < a.high)

    def corners(self) -> list[Member]:
        """Return the ends of all ranges and all choices, in every sea state.

        Raises InputError if there are more than 4096.
        """
        ends = [(a.low, a.high) if a.continuous else a.values for a in self.axes]
        return list(self._product(ends))

    def grid(self) -> list[Member]:
        """Return all combinations of the values given, in every sea state."""
        return list(self._product([a.values for a in self.axes]))

    def nominal(self) -> list[Member]:
        """Return the case's own point, moved into the ranges, in every sea state."""
        point = []
        for axis in self.axes:
            own = value_at(self.case, axis.path)
            if axis.continuous:
                middle = 0.5 * (axis.low + axis.high)
                point.append(min(max(middle if own is None else own, axis.low), axis.high))
            else:
                point.append(own if own in axis.values else axis.values[0])
        return [Member(point=tuple(point), sea=k) for k in range(len(self.seas))]

    def draw(self, count: int, seed: int) -> list[Member]:
        """Return random members: uniform in the ranges and choices, seas by occurrence."""
        return self.at(np.random.default_rng(seed).random((count, len(self.axes) + 1)))

    def at(self, points: FloatArray) -> list[Member]:
        """Return the members at points of the unit cube, (n, axes + 1); the last is the sea's."""
        columns: list[list[Any]] = []
        for axis, share in zip(self.axes, points.T, strict=False):
            if axis.continuous:
                columns.append((axis.low + share * (axis.high - axis.low)).tolist())
            else:
                columns.append([axis.values[int(u * len(axis.values))] for u in share])
        edges = np.cumsum(self.occurrence)
        edges[-1] = np.inf  # whatever rounding has left of one
        seas = np.searchsorted(edges, points[:, -1], side="right")
        found = zip(*columns, strict=True) if columns else [()] * len(points)
        return [Member(point=p, sea=int(k)) for p, k in zip(found, seas, strict=True)]

    def case_at(self, member: Member) -> Case:
        """Return the case of a member.

        Raises InputError if the values are not valid together.
        """
        sea = self.seas[member.sea].changes(self.case)
        return self.case.replace({**self.changes(member), **sea})

    def changes(self, member: Member) -> dict[str, Any]:
        """Return a member's parameters by path, without its sea."""
        given = dict(zip((a.path for a in self.axes), member.point, strict=True))
        return with_payload(self.case, given)

    def kind(self, member: Member) -> tuple[Any, ...]:
        """Return what a member shares with those that differ from it in numbers alone."""
        chosen = [v for a, v in zip(self.axes, member.point, strict=True) if not a.continuous]
        return (*chosen, *self.seas[member.sea].changes(self.case))

    def spread(self, like: Member) -> Spread:
        """Return the numbers in which members of one kind differ, as a spread on the case of one.

        First the ranges, then the sea.
        """
        varied: dict[str, Any] = {a.path: Uniform(a.low, a.high) for a in self.axes if a.continuous}
        shared = self.kind(like)
        for path in self.seas[like.sea].changes(self.case):
            changes = (s.changes(self.case) for s in self.seas)
            varied[path] = Samples([c[path] for c in changes if set(c) <= set(shared)])
        return Spread(varied).on(self.case_at(like))

    def row(self, member: Member) -> list[float]:
        """Return a member's numbers in the order of `spread`."""
        pairs = zip(self.axes, member.point, strict=True)
        own = [float(v) for a, v in pairs if a.continuous]
        return [*own, *self.seas[member.sea].changes(self.case).values()]

    def name_of(self, member: Member) -> str:
        """Return a member's values in words."""
        parts = [f"{a.path} {_text(v)}" for a, v in zip(self.axes, member.point, strict=True)]
        if len(self.seas) > 1 or not parts:
            parts.append(str(self.seas[member.sea]))
        return ", ".join(parts)

    def _product(self, values: Sequence[Sequence[Any]]) -> Iterator[Member]:
        distinct = [tuple(dict.fromkeys(v)) for v in values]
        total = math.prod(len(v) for v in distinct) * len(self.seas)
        if total > _MOST_CORNERS:
            raise InputError(
                f"family: at most {_MOST_CORNERS} combinations can be listed, got {total}; "
                "vary fewer parameters"
            )
        for point in itertools.product(*distinct):
            for k in range(len(self.seas)):
                yield Member(point=point, sea=k)


def _axis(case: Case, path: str, values: Sequence[Any] | DiscreteValues) -> Axis:
    """Return an axis, its values read like those of a case file."""
    if path.startswith(("sea.", "vessel.")):
        raise InputError(f"family: {path} cannot be varied; sea states are given as seas")
    choice = isinstance(values, DiscreteValues)
    raw = values.values if isinstance(values, DiscreteValues) else tuple(values)
    if not raw:
        raise InputError(f"family: {path} must have at least one value, got none")
    read = [_read(case, path, v) if isinstance(v, str) and not choice else v for v in raw]
    numbers = all(isinstance(v, int | float) and not isinstance(v, bool) for v in read)
    axis = Axis(path=path, values=tuple(read), continuous=numbers and not choice)
    probe = Family(case=case, axes=(axis,), seas=(_own_sea(case),))
    for value in axis.values:
        probe.case_at(Member(point=(value,)))  # a wrong path or value is told here
    return axis


def _read(case: Case, path: str, text: Any) -> Any:
    """Return a value with a unit in SI; a text as it is where there is no number."""
    try:
        kind = field_of(case, path, {}, None).kind
    except InputError:
        return text
    return parse_quantity(text, kind)


def value_at(case: Case, path: str) -> Any:
    """Return the value at a dotted path, None where there is none."""
    found: Any = case
    for part in path.split("."):
        found = found[int(part)] if part.isdigit() else getattr(found, part, None)
    if path == "payload.added_mass" and found is None:
        return case.payload.hydrodynamic_mass
    return found


def _sea(given: SeaState | Sequence[float]) -> SeaState:
    if isinstance(given, SeaState):
        return given
    if not 2 <= len(given) <= 3:
        raise InputError(f"family: a sea must be (H_s, T_p[, occurrence]), got {tuple(given)}")
    names = ("significant_height", "peak_period", "occurrence")
    return SeaState(**dict(zip(names, map(float, given), strict=False)))


def _own_sea(case: Case) -> SeaState:
    return SeaState(significant_height=case.sea.significant_height)


def _text(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, int | float) else str(value)
