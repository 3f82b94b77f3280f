"""Dataset of a sweep, which says what it answers, and the way back to its cases.

One dimension, "case"; a coordinate for every path that varied, with its unit; a variable for
every metric; case, design and spread as JSON in an attribute, so that a file of it is enough to run
any of its cases again.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from models.basics import FloatArray, InputError
from models.case import Case
from models.spread import Samples, Spread

from ..design import Design
from .metrics import FrequencyMetric

if TYPE_CHECKING:
    import xarray as xr


ATTRIBUTE = "stillhook_sweep"
"""Name of the attribute with the question, as JSON: case, spread, controller."""

_LISTED = 1000  # samples that are written into it


def dataset_of(
    design: Design,
    spread: Spread,
    rows: FloatArray,
    columns: Mapping[str, npt.NDArray[Any]],
    metrics: Sequence[FrequencyMetric],
    *,
    first: int,
    notes: Mapping[str, Any],
) -> xr.Dataset:
    """Return the dataset of evaluated rows, (n, d), whose first is case number `first`."""
    import xarray as xr

    case = design.sea_case
    current = "A" if case.winch.motor.type == "dc" else "N m"
    speed = getattr(case.winch.motor, "speed_gain", 0.0) > 0.0
    command = "V" if case.winch.motor.type == "dc" else "rad/s" if speed else "N m"
    own = {"current_rms": current, "command_rms": command}
    variables: dict[str, Any] = {
        "stable": ("case", columns["stable"], {"long_name": "whether the loop is stable"})
    }
    for m in metrics:
        about = {"units": m.unit or own.get(m.name, "1"), "long_name": m.long_name}
        variables[m.name] = ("case", columns[m.name], about)
    return xr.Dataset(
        variables,
        coords=coordinates_of(spread, rows, first),
        attrs={
            "title": f"sweep of {case.name} in the frequency domain",
            "mode": "frequency",
            "structure": design.structure,
            "masses": int(design.masses),
            ATTRIBUTE: json.dumps(_header(design, spread)),
            **notes,
        },
    )


def coordinates_of(spread: Spread, rows: FloatArray, first: int) -> dict[str, Any]:
    """Return the number of each case, the first of them being `first`, and what varied of it."""
    found: dict[str, Any] = {
        "case": ("case", np.arange(first, first + len(rows)), {"long_name": "number of the case"})
    }
    units, nominal = spread.units, spread.nominal
    for j, path in enumerate(spread.paths):
        about = {"units": units[path] or "1", "long_name": path, "nominal": nominal[path]}
        found[path] = ("case", rows[:, j].copy(), about)
    return found


def _header(design: Design, spread: Spread) -> dict[str, Any]:
    """Return the question of a sweep as plain data."""
    law = {"structure": design.structure, "parameters": dict(design.parameters)}
    return {
        "case": design.sea_case.to_dict(),
        # Long lists of samples stand in the coordinates already.
        "spread": spread.to_dict() if _short(spread) else None,
        "controller": {"law": law | {"drag": float(design.drag)}},
    }


def spread_of(dataset: xr.Dataset) -> Spread:
    """Return the spread of a dataset, on its case."""
    header = _question(dataset)
    case = Case.from_stored(header["case"], source="dataset")
    if header["spread"] is not None:
        found = Spread.from_dict(header["spread"], source="dataset")
    else:
        varied = [str(name) for name in dataset.coords if name != "case"]
        found = Spread({path: Samples(dataset[path].values) for path in varied})
    law = header["controller"].get("law") or {}
    return found.on(case, law.get("parameters"), law.get("drag"))


def law_of(dataset: xr.Dataset, number: int) -> tuple[str, dict[str, float]]:
    """Return the structure and the parameters of one entry along "case"; empty without a design.

    Raises InputError as `case_of`.
    """
    law = _question(dataset)["controller"].get("law") or {}
    spread = spread_of(dataset)
    varied = spread.gains(_row(dataset, spread, number))
    return law.get("structure", ""), {**law.get("parameters", {}), **varied}


def case_of(dataset: xr.Dataset, number: int) -> Case:
    """Return the case of one entry, a value of "case", its gains in it where they are the three.

    Faults, which are no part of a case, are left out.

    Raises InputError if there is no such case, or the dataset is not one of a sweep.
    """
    spread = spread_of(dataset)
    row = _row(dataset, spread, number)
    case = spread.case_at(row)
    changes: dict[str, Any] = {"name": f"{case.name} ({number})"[:100]}
    structure, parameters = law_of(dataset, number)
    if structure == "payload-feedback":
        changes["gains"] = parameters
    drag = spread.drag(row)
    if drag is not None:
        changes["payload.drag"] = {"method": "given", "coefficient": drag}
    return case.variant(changes)


def _row(dataset: xr.Dataset, spread: Spread, number: int) -> list[float]:
    """Return what varied of one entry, in the spread's order."""
    at = np.flatnonzero(dataset["case"].values == number)
    if not at.size:
        raise InputError(f"sweep: there is no case number {number} in this dataset")
    return [float(dataset[path].values[at[0]]) for path in spread.paths]


def _short(spread: Spread) -> bool:
    lists = [d for d in spread.distributions.values() if isinstance(d, Samples)]
    return sum(len(d.values) for d in lists) <= _LISTED


def _question(dataset: xr.Dataset) -> Any:
    """Return the question of a dataset as plain data."""
    found = dataset.attrs.get(ATTRIBUTE)
    if not isinstance(found, str):
        raise InputError(
            f"sweep: the dataset has no attribute {ATTRIBUTE!r}; it is none of a sweep"
        )
    return json.loads(found)
