"""The spread of a case, its correlations and the rows drawn from it: `Spread`.

    Spread({...}) or file -> .on(case) -> .sample(n) rows (n, d) -> .changes(row) -> case.replace

A spread is a description until it meets a case (`Spread.on`): percentages and texts with units
become numbers, every path is checked, and the ends of every range are tried on the case.  A file is
YAML with `vary:` and, if wanted, `correlations:`:

    vary:
      payload.mass: 20 %                          # uniform, 20 % of the case's value either way
      sensors.telemetry.delay: [10 ms, 60 ms]     # uniform in between
      rope.axial_stiffness: {normal: {sd: 10 %}}  # about the case's own
      sea.significant_height: {samples: [1.2 m, 1.5 m, 2.1 m]}
    correlations:
      - [payload.mass, rope.axial_stiffness, 0.4]
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from ..basics import FloatArray, InputError, check_range
from ..case import Case
from ..casefile import Path as Place
from ..casefile import case_text, line_of, message_line, read_yaml, suggestion, yaml_text
from ..operation import PREFIX as FAULTS
from .distributions import KINDS, Distribution, Samples, Uniform, at_ends
from .fields import ALIASES, DRAG, GAINS, Field, field_of, resolved
from .sampling import copula_factor, correlated, counted, unit_points

Pairs = Mapping[tuple[str, str], float]


@dataclass(frozen=True, eq=False)
class Spread:
    """What varies about a case.

    Raises InputError if nothing varies, a path is given twice, or correlations contradict each
    other.

    Examples
    --------
    >>> from models import load_case
    >>> from models.spread import Uniform
    >>> spread = Spread({"payload.mass": Uniform("10 %"), "delay": Uniform("0 ms", "50 ms")})
    >>> rows = spread.on(load_case("thesis-1975")).sample(4, "corners")
    >>> rows[0].round(1).tolist(), rows[-1].round(3).tolist()
    ([33159.6, 0.0], [40528.4, 0.05])
    """

    #: By dotted path of the case, by an alias (`stiffness`, `payload`, `delay`, ..), by ``gains.``
    #: and the name of a gain, or ``drag`` (the design's linear drag coefficient). A text or a
    #: number alone is `Uniform` of that width about the case's own value.
    distributions: Mapping[str, Any]
    #: Rank correlation (Spearman's) of pairs of paths, each in (-1, 1); the others are independent.
    correlations: Pairs | None = None
    fields: tuple[Field, ...] = ()  #: What the paths are on a case; `on` fills it in.
    case: Case | None = None  #: That case.

    def __post_init__(self) -> None:
        if not self.distributions:
            raise InputError("spread: must name what varies, got nothing")
        own = {}
        for name, given in self.distributions.items():
            path = ALIASES.get(name, name)
            if path in own:
                raise InputError(f"spread: {path} is given twice")
            try:
                own[path] = _distribution(given)
            except InputError as error:
                raise InputError(f"spread: {path} {error}") from None
        pairs = {}
        for (one, other), value in (self.correlations or {}).items():
            pair = ALIASES.get(one, one), ALIASES.get(other, other)
            unknown = [p for p in pair if p not in own]
            if unknown or pair[0] == pair[1]:
                raise InputError(
                    f"spread: a correlation must be of two paths that vary, got {one} and {other}"
                )
            pairs[pair] = check_range(
                "spread",
                f"correlation of {one} and {other}",
                value,
                low=-1.0,
                high=1.0,
                open_low=True,
                open_high=True,
            )
        object.__setattr__(self, "distributions", MappingProxyType(own))
        object.__setattr__(self, "correlations", MappingProxyType(pairs))
        object.__setattr__(self, "_factor", copula_factor(self.paths, pairs))

    @classmethod
    def from_dict(
        cls, data: Any, *, source: str = "spread", lines: Mapping[Place, int] | None = None
    ) -> Spread:
        """Make a spread from the contents of a spread file: `vary` and, if wanted, `correlations`.

        Messages name the file's `source` and `lines`.

        Raises InputError if it is not one; the message names the path.
        """

        def refused(path: Place, text: object) -> InputError:
            return InputError(message_line(source, line_of(path, lines), path, str(text)))

        if not isinstance(data, Mapping) or not isinstance(data.get("vary"), Mapping):
            raise InputError(
                f"{source}: must hold a section `vary:` with what varies, by path of the case"
            )
        for key in data:
            if key not in ("vary", "correlations"):
                hint = suggestion(key, ["vary", "correlations"])
                raise refused((str(key),), f"is unknown; {hint}")
        found = {}
        for name, value in data["vary"].items():
            try:
                found[str(name)] = _distribution(value)
            except InputError as error:
                raise refused(("vary", str(name)), error) from None
        pairs: dict[tuple[str, str], float] = {}
        given = data.get("correlations") or ()
        if not isinstance(given, list | tuple):
            raise refused(("correlations",), f"must be a list, got {given!r:.60}")
        for k, entry in enumerate(given):
            if not isinstance(entry, list | tuple) or len(entry) != 3:
                text = f"must be [path, path, rank correlation], got {entry!r}"
                raise refused(("correlations", k), text)
            pairs[str(entry[0]), str(entry[1])] = entry[2]
        try:
            return cls(found, pairs)
        except InputError as error:
            where = ("correlations",) if found else ("vary",)
            raise refused(where, str(error).removeprefix("spread: ")) from None

    @classmethod
    def from_yaml(cls, path: str | Path) -> Spread:
        """Read a spread file, see docs/sweeps.md.

        Raises InputError if there is no such file or it is no spread; file and line are named.
        """
        data, lines = read_yaml(case_text(path), str(path))
        return cls.from_dict(data, source=str(path), lines=lines)

    @property
    def paths(self) -> tuple[str, ...]:
        """What varies, without aliases, in the order of the columns."""
        return tuple(self.distributions)

    @property
    def units(self) -> dict[str, str]:
        """SI unit of each path; empty for pure numbers."""
        return {field.path: field.unit for field in self._known()}

    @property
    def nominal(self) -> dict[str, float]:
        """The case's own value of each path."""
        return {field.path: field.nominal for field in self._known()}

    def on(
        self, case: Case, gains: Mapping[str, float] | None = None, drag: float | None = None
    ) -> Spread:
        """Return the spread in plain numbers on a case, every path and end of a range checked.

        The gains are the design's (or a structure's parameters), by default the case's own; `drag`
        is the design's linear drag coefficient [N s/m], for the path ``drag``.

        Raises InputError if a path is unknown, a value has the wrong unit, or an end of a range is
        refused.
        """
        if gains is None and case.gains is not None:
            gains = {name: getattr(case.gains, name) for name in type(case.gains).model_fields}
        fields, own = [], {}
        for path, distribution in self.distributions.items():
            try:
                field = field_of(case, path, gains or {}, drag)
                found = resolved(distribution, field).within(field.low, field.high)
            except InputError as error:
                raise InputError(f"spread: {path}: {error}") from None
            fields.append(field)
            own[path] = found
        changed = Spread(own, self.correlations, tuple(fields), case)
        changed._try_ends()
        return changed

    def sample(
        self,
        samples: int | None,
        method: str = "sobol",
        seed: int = 0,
        *,
        start: int = 0,
        stop: int | None = None,
    ) -> FloatArray:
        """Return rows of values in SI, (n, d), in the order of `paths`.

        Row i depends on (seed, i) and the method alone; of a Latin hypercube on `samples` too.

        Parameters
        ----------
        samples
            How many rows; a grid has at most so many, the corners all of theirs.  None with
            ``given``: as many as were given.
        method
            ``sobol`` (scrambled Sobol sequence), ``lhs`` (Latin hypercube), ``random`` (Monte
            Carlo), ``grid``, ``corners`` (ends of all ranges; three standard deviations where
            there is no end), ``given`` (row i holds the i-th of every list of samples).  Grid
            and corners go through all combinations, whatever the correlations.
        seed
            Of the random numbers, at least 0.
        start, stop
            Which rows of the design are wanted; all by default.

        Raises
        ------
        InputError
            If the method is unknown, or values are not numbers yet (call `on` first).
        """
        if seed < 0:
            raise InputError(f"spread: seed must be at least 0, got {seed!r}")
        wanted = self.count(samples, method)
        last = wanted if stop is None else min(stop, wanted)
        first = min(start, last)
        if method == "given":
            columns = [d.numbers[first:last] for d in self._lists()]
            return np.stack(columns, axis=1)
        if not all(d.numeric for d in self.distributions.values()):
            raise InputError("spread: it has units or percentages; call Spread.on(case) first")
        dimensions = len(self.paths)
        total = wanted if samples is None else samples
        points = unit_points(method, total, dimensions, seed, first, last)
        own = list(self.distributions.values())
        if method in ("grid", "corners"):
            return np.stack([at_ends(d, points[:, j]) for j, d in enumerate(own)], axis=1)
        factor: FloatArray | None = getattr(self, "_factor", None)
        if factor is not None:
            points = correlated(points, factor)
        return np.stack([d.quantile(points[:, j]) for j, d in enumerate(own)], axis=1)

    def count(self, samples: int | None, method: str = "sobol") -> int:
        """Return how many rows `sample` gives.

        Raises InputError if the method is unknown, or `samples` is wanted and missing.
        """
        if method == "given":
            given = {len(d.values) for d in self._lists()}
            if len(given) > 1:
                raise InputError(
                    "spread: lists of samples must be equally long to be taken row by row, got "
                    f"{', '.join(map(str, sorted(given)))}"
                )
            return min(given) if samples is None else min(min(given), samples)
        if samples is None and method != "corners":
            raise InputError(f"spread: method {method!r} needs a number of samples")
        return counted(method, 1 if samples is None else samples, len(self.paths))

    def changes(self, row: npt.ArrayLike) -> dict[str, Any]:
        """Return a row's changes of the case by path, as `Case.replace` takes them.

        Gains and ``drag`` are no part of the case and left out, see `gains` and `drag`.  Added
        mass and submerged weight grow with ``payload.mass`` unless they vary themselves, as in
        a family.
        """
        own = self._named(row)
        plain = (p for p in own if p != DRAG and not p.startswith((GAINS, FAULTS)))
        found: dict[str, Any] = {path: own[path] for path in plain}
        if self.case is not None:
            found = with_payload(self.case, found)
        counts = {field.path for field in self.fields if field.kind == "count"}
        return {path: round(v) if path in counts else v for path, v in found.items()}

    def gains(self, row: npt.ArrayLike) -> dict[str, float]:
        """Return a row's gains by name, those that vary."""
        own = self._named(row)
        return {p.removeprefix(GAINS): v for p, v in own.items() if p.startswith(GAINS)}

    def drag(self, row: npt.ArrayLike) -> float | None:
        """Return a row's linear drag coefficient [N s/m], if it varies."""
        return self._named(row).get(DRAG)

    def case_at(self, row: npt.ArrayLike) -> Case:
        """Return the case of a row, without words about implausible physics.

        Raises InputError if the spread has met no case, or the values are not valid together.
        """
        if self.case is None:
            raise InputError("spread: it has met no case; call Spread.on(case) first")
        return self.case.variant(self.changes(row))

    def to_dict(self) -> dict[str, Any]:
        """Return the spread as in a file."""
        found: dict[str, Any] = {"vary": {p: d.to_dict() for p, d in self.distributions.items()}}
        if self.correlations:
            found["correlations"] = [[a, b, r] for (a, b), r in self.correlations.items()]
        return found

    def to_yaml(self) -> str:
        """Return the spread as YAML text; reading it gives an equal spread."""
        return yaml_text(self.to_dict())

    def __str__(self) -> str:
        """Return the spread as a small tree."""
        lines = ["Spread"]
        units = {field.path: field.unit for field in self.fields}
        for path, d in self.distributions.items():
            text = ", ".join(_words(k, v) for k, v in d.to_dict().items())
            lines.append(f"├ {path}: {text} {units.get(path, '')}".rstrip())
        lines += [
            f"├ rank correlation of {a} and {b}: {r:g}"
            for (a, b), r in (self.correlations or {}).items()
        ]
        lines[-1] = "└" + lines[-1][1:]
        return "\n".join(lines)

    def _named(self, row: npt.ArrayLike) -> dict[str, float]:
        values = np.asarray(row, dtype=np.float64).reshape(-1)
        if values.size != len(self.paths):
            raise InputError(f"spread: a row must have {len(self.paths)} values, got {values.size}")
        return dict(zip(self.paths, (float(v) for v in values), strict=True))

    def _known(self) -> tuple[Field, ...]:
        if not self.fields:
            raise InputError("spread: it has met no case; call Spread.on(case) first")
        return self.fields

    def _lists(self) -> list[Samples]:
        lists = [d for d in self.distributions.values() if isinstance(d, Samples) and d.numeric]
        if len(lists) < len(self.distributions):
            raise InputError("spread: method 'given' wants lists of numbers for every path")
        return lists

    def _try_ends(self) -> None:
        """Try the ends of every range, one path at a time, on the case."""
        for field, (path, distribution) in zip(
            self.fields, self.distributions.items(), strict=True
        ):
            for end in dict.fromkeys(distribution.ends):
                if not field.low <= end <= field.high:
                    raise InputError(
                        f"spread: {path} must stay in [{field.low:g}, {field.high:g}] "
                        f"{field.unit}".rstrip()
                        + f", got {end:g}"
                    )
                if path == DRAG or path.startswith(GAINS):
                    continue
                alone = Spread({path: Samples([end])}, None, (field,), self.case)
                try:
                    alone.case_at([end])
                except InputError as error:
                    raise InputError(f"spread: {path} cannot be {end:g}: {error}") from None


def with_payload(case: Case, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return changes of a case with what grows with the payload's mass, if that is changed.

    Those are added mass and submerged weight, unless they are changed themselves.
    """
    if "payload.mass" not in changes:
        return dict(changes)
    payload = case.payload
    share = changes["payload.mass"] / payload.mass
    return {
        **changes,
        "payload.added_mass": share * payload.hydrodynamic_mass,
        "payload.submerged_weight": share * payload.submerged_weight,
        **changes,
    }


def _words(kind: str, values: Any) -> str:
    """Return a distribution in words."""
    if isinstance(values, dict):
        inner = ", ".join(f"{k} {_short(v)}" for k, v in values.items())
    elif len(values) > 4:
        inner = f"{len(values)} values"
    else:
        inner = ", ".join(_short(v) for v in values)
    return f"{kind} ({inner})"


def _short(value: Any) -> str:
    """Return a value as a sentence shows it: six digits at the most."""
    return f"{value:.6g}" if isinstance(value, int | float) else str(value)


def _distribution(value: Any) -> Distribution:
    """Return the distribution that an entry of `vary:` stands for."""
    if isinstance(value, Distribution):
        return value
    if isinstance(value, str | int | float) and not isinstance(value, bool):
        return Uniform(value)
    if isinstance(value, list | tuple):
        if len(value) != 2:
            raise InputError(
                f"must be [low, high] or {{samples: [...]}}, got a list of {len(value)}"
            )
        return Uniform(*value)
    if not isinstance(value, Mapping) or len(value) != 1:
        raise InputError(f"must be one of {', '.join(KINDS)} with its values, got {value!r}")
    (name, inner), *_ = value.items()
    if name not in KINDS:
        raise InputError(f"{name!r} is unknown; {suggestion(name, list(KINDS))}")
    kind: Any = KINDS[name]
    if kind is Samples:
        if not isinstance(inner, list | tuple):
            raise InputError(f"samples must be a list of values, got {inner!r}")
        return Samples(inner)
    if isinstance(inner, list | tuple):
        return _made(kind, name, dict(zip((f.name for f in fields(kind)), inner, strict=False)))
    if not isinstance(inner, Mapping):
        return _made(kind, name, {_width(kind): inner})
    return _made(kind, name, dict(inner))


def _made(kind: Any, name: str, values: dict[str, Any]) -> Distribution:
    known = [f.name for f in fields(kind)]
    for key in values:
        if key not in known:
            raise InputError(f"{name}: {key} is unknown; {suggestion(key, known)}")
    try:
        made: Distribution = kind(**values)
    except TypeError:
        raise InputError(f"{name}: needs {', '.join(known)}; got {', '.join(values)}") from None
    return made


def _width(kind: Any) -> str:
    """Return the field that a single value stands for."""
    return {"normal": "sd", "lognormal": "sigma"}.get(kind.name, fields(kind)[0].name)
