"""Results of a sweep in memory and in a journal (`Results`), and the question they answer.

    TimeQuestion, Draw --> header_of --> journal and attributes --> stored_question
    CaseResult --> Results.put --> journal.jsonl --> Results --> what is there already --> result.nc

The header holds everything that the numbers hang on: case, controller with its gains, spread,
seeds, the run's options, and the versions of the code.  So a sweep can be gone on with from its
journal alone, and one that answers another question is known.  A file for other tools is written
from the journal at the end.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_type_hints

import numpy as np
from pydantic import TypeAdapter

from models.basics import BoolArray, InputError, check_range
from models.case import Case
from models.spread import Spread
from synth.sweeps import ATTRIBUTE

from ..controllers import recipe_from
from ..keeper import Journal, question_in, versions
from .export import ENDINGS, check_writable
from .time_cases import TimeQuestion, seed_of
from .time_metrics import STATUS, names_of

if TYPE_CHECKING:
    import xarray as xr

JOURNAL, RESULT = "journal.jsonl", "result.nc"  #: Names of the files in the folder of a sweep.

_WHAT = "sweep"


@dataclass(frozen=True, kw_only=True)
class Draw:
    """How the cases are drawn."""

    spread: Spread  #: What varies, on the nominal case.
    samples: int  #: Number of cases.
    sampling: str  #: Method of `Spread.sample`.
    seed: int  #: Of the draws and of the runs.
    common_seed: bool  #: Whether all runs have the same seed.
    first: int = 0  #: Number of the first case: a part of a longer sweep.

    def seeds(self, indices: Iterable[int]) -> list[int]:
        """Return the seeds of the runs of cases, which depend on nothing but these."""
        return [seed_of(self.seed, index, common=self.common_seed) for index in indices]


# What a question and its draw hold as plain data: all but these.
_RICH = ("case", "recipe", "spread")
_QUESTION, _DRAW = (
    [each.name for each in fields(kind) if each.name not in _RICH] for kind in (TimeQuestion, Draw)
)


def header_of(question: TimeQuestion, draw: Draw) -> dict[str, Any]:
    """Return what a store says about itself, as plain data."""
    found: dict[str, Any] = {
        "mode": "time",
        "case": question.case.to_dict(),
        "controller": question.recipe.to_dict(),
        "spread": draw.spread.to_dict(),
        **{name: getattr(draw, name) for name in _DRAW},
        **{name: getattr(question, name) for name in _QUESTION},
        "versions": versions(TimeQuestion),
    }
    plain: dict[str, Any] = json.loads(text_of(found))
    return plain


def text_of(header: Mapping[str, Any]) -> str:
    """Return a header as JSON, what JSON does not know as text."""
    return json.dumps(header, default=str)


def places_of(store: str | Path) -> tuple[Path, Path]:
    """Return where the journal of a store is, and the file for other tools.

    A store is a folder with both, or that file, with the journal beside it.

    Raises InputError if the folder cannot be made, or the file is there without a journal.
    """
    place = Path(store)
    if place.suffix not in ENDINGS:
        return place / JOURNAL, place / RESULT
    journal = place.with_suffix(".jsonl")
    if check_writable(place).exists() and not journal.exists():
        raise InputError(
            f"{place}: is there, but not its journal {journal.name}: no sweep of this version of "
            "Stillhook to go on with; take another file, or remove it"
        )
    return journal, place


def stored_question(store: str | Path) -> tuple[TimeQuestion, Draw]:
    """Return the question of a stored sweep, and how its cases are drawn.

    Raises InputError if there is none, or it cannot be asked again: its controller was Python code,
    or something is missing.
    """
    path, _ = places_of(store)
    header, source = question_in(path, _WHAT), str(path)
    try:
        case = Case.from_stored(header["case"], source=source)
        recipe = recipe_from(header["controller"])
        asked, drawn = _typed(TimeQuestion, header, _QUESTION), _typed(Draw, header, _DRAW)
        asked["metrics"] = names_of(asked["metrics"])
        spread = Spread.from_dict(header["spread"], source=source).on(case, recipe.gains)
        check_range("sweep", "samples", drawn["samples"], low=1, high=10**9)
        check_range("sweep", "seed", drawn["seed"], low=0)
        check_range("sweep", "first", drawn["first"], low=0)
        draw = Draw(spread=spread, **drawn)
        return TimeQuestion(case=case, recipe=recipe, **asked), draw
    except InputError as error:
        raise InputError(f"{source}: {error}") from error
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        what = " ".join(f"{type(error).__name__}: {error}".split())
        raise InputError(f"{source}: its question is spoilt ({what:.120})") from error


def _typed(kind: type, header: Mapping[str, Any], names: Iterable[str]) -> dict[str, Any]:
    """Return fields of a dataclass from a header, of the types that their annotations say.

    Raises ValueError if one is of another; KeyError if it is missing.
    """
    hints = get_type_hints(kind)
    return {
        name: TypeAdapter(hints[name]).validate_json(json.dumps(header[name]), strict=True)
        for name in names
    }


class Results:
    """Results of a sweep, in memory and, if it is kept, in a journal.

    The template is the result with nothing in it yet: coordinates, variables along "case",
    attributes with the header.  Without a path nothing is kept.

    Raises InputError as for `Journal`.
    """

    def __init__(self, template: xr.Dataset, path: Path | None = None) -> None:
        self._template = template
        self._values = {str(n): template[n].to_numpy().copy() for n in template.data_vars}
        self._first = int(template["case"][0])
        self.journal: Journal | None = None
        if path is not None:
            header = json.loads(template.attrs[ATTRIBUTE])
            self.journal = Journal(path, _WHAT, header, self._take)

    @property
    def done(self) -> BoolArray:
        """Which cases are there (n,)."""
        return np.asarray(self._values["status"] != STATUS["not run"])

    def put(self, index: int, row: Mapping[str, float], *, final: bool = True) -> None:
        """Keep the numbers of a case, by variable; not final ones in memory alone."""
        self._take(index, row)
        if final and self.journal is not None:
            self.journal.add(index, row)

    def dataset(self) -> xr.Dataset:
        """Return the results so far."""
        own = self._template
        return own.assign(
            {name: (own[name].dims, v.copy(), own[name].attrs) for name, v in self._values.items()}
        )

    def _take(self, index: int, row: Mapping[str, float]) -> None:
        place = index - self._first
        if not 0 <= place < self._template.sizes["case"]:
            raise IndexError(f"there is no case {index}")
        for name, values in self._values.items():
            values[place] = row[name]
