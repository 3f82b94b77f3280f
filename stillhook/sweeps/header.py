"""What a stored sweep answers, as plain data in its attributes, and the same question again.

    TimeQuestion, Spread, how they were drawn --> header_of --> attributes --> question_from

The header holds everything that the numbers hang on: case, controller with its gains, spread,
seeds, the run's options, and the versions of the code.  So a store can be gone on with from itself
alone, and one that answers another question is known.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from models.basics import InputError
from models.case import Case
from models.spread import Spread

from ..keeper import difference, versions
from .pilots import pilot_from
from .time_cases import TimeQuestion

ATTRIBUTE = "stillhook_sweep"
"""Name of the attribute."""

FORMAT = 1
"""Version of its contents."""

_TOLD = ("versions.python",)  # is told, and may differ


@dataclass(frozen=True, kw_only=True)
class Draw:
    """How the cases are drawn.

    Attributes
    ----------
    samples
        Number of cases.
    sampling
        Method of `Spread.sample`.
    seed
        Of the draws and of the runs.
    common
        Whether all runs have the same seed.
    first
        Number of the first case: a part of a longer sweep.
    """

    samples: int
    sampling: str
    seed: int
    common: bool
    first: int = 0


def header_of(question: TimeQuestion, spread: Spread, draw: Draw) -> dict[str, Any]:
    """Return what a store says about itself, as plain data."""
    found: dict[str, Any] = {
        "format": FORMAT,
        "mode": "time",
        "case": question.case.to_dict(),
        "controller": question.pilot.to_dict(),
        "spread": spread.to_dict(),
        "samples": draw.samples,
        "first": draw.first,
        "sampling": draw.sampling,
        "seed": draw.seed,
        "common_seed": draw.common,
        "metrics": list(question.metrics),
        "duration": question.duration,
        "settle": question.settle,
        "scenario": question.scenario,
        "options": {str(key): value for key, value in question.options.items()},
        "masses": question.masses,
        "compiled": question.compiled,
        "design_follows": question.design_follows,
        "weighed": question.weighed,
        "starts": question.starts,
        "versions": versions(TimeQuestion),
    }
    plain: dict[str, Any] = json.loads(text_of(found))
    return plain


def text_of(header: Mapping[str, Any]) -> str:
    """Return a header as JSON; infinities are written as JavaScript has them."""
    return json.dumps(_plain(header), ensure_ascii=True)


def read_header(path: Path) -> dict[str, Any]:
    """Return the header of a Zarr store.

    Raises
    ------
    InputError
        If there is no store, or it is none of a sweep.
    """
    import zarr

    if not path.exists():
        raise InputError(f"{path}: there is no sweep to go on with")
    try:
        attributes = dict(zarr.open_group(path, mode="r").attrs)
        header = json.loads(str(attributes[ATTRIBUTE]))
        known = header["format"] == FORMAT
    except Exception as error:  # whatever a reader makes of what is no store
        raise InputError(
            f"{path}: is not a sweep that Stillhook has written ({type(error).__name__}); take "
            "another folder"
        ) from None
    if not known:
        raise InputError(
            f"{path}: was written by another version of Stillhook (format {header['format']}, "
            f"this is {FORMAT}); take another folder"
        )
    return dict(header)


def question_from(header: Mapping[str, Any], source: str) -> tuple[TimeQuestion, Spread, Draw]:
    """Return the question that a header tells of, its spread and how the cases are drawn.

    Raises
    ------
    InputError
        If it cannot be asked again: its controller was Python code, or something is missing.
    """
    try:
        case = Case.from_dict(header["case"], source=source)
        pilot = pilot_from(header["controller"])
        question = TimeQuestion(
            case=case,
            pilot=pilot,
            metrics=tuple(header["metrics"]),
            duration=float(header["duration"]),
            settle=header["settle"],
            scenario=header["scenario"],
            options=header["options"],
            masses=header["masses"],
            compiled=header["compiled"],
            design_follows=header["design_follows"],
            weighed=header["weighed"],
            starts=header["starts"],
        )
        spread = Spread.from_dict(header["spread"], source=source).on(case, pilot.gains)
        draw = Draw(
            samples=int(header["samples"]),
            sampling=header["sampling"],
            seed=int(header["seed"]),
            common=bool(header["common_seed"]),
            first=int(header["first"]),
        )
    except InputError as error:
        raise InputError(f"{source}: {error}") from error
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{source}: its attributes are spoilt ({error!r})") from error
    return question, spread, draw


def differences(there: Mapping[str, Any], asked: Mapping[str, Any]) -> list[str]:
    """Return in words where two headers differ; of each entry the first place."""
    found = []
    for key in asked:
        if key == "versions":
            found += _versions(there.get(key, {}), asked[key])
        elif text := difference(key, there.get(key), asked[key]):
            found.append(text)
    return found


def _versions(there: Mapping[str, str], asked: Mapping[str, str]) -> list[str]:
    for name, version in asked.items():
        if f"versions.{name}" not in _TOLD and there.get(name) != version:
            what = "Stillhook's own code" if name == "code" else name
            return [
                f"it was computed with another version of {what} ({there.get(name)}, now "
                f"{version}), and the numbers may not belong together"
            ]
    return []


def _plain(value: Any) -> Any:
    """Return plain data, what is no JSON as text."""
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    if isinstance(value, float) and math.isnan(value):
        return None
    return value if value is None or isinstance(value, str | int | float | bool) else str(value)
