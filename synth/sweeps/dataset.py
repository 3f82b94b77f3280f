"""Dataset of a sweep, which says what it answers, and the way back to its cases.

One dimension, "case"; a coordinate for every path that varied, with its unit; a variable for
every metric; case, design and spread as YAML and JSON in the attributes, so that a file of it is
enough to run any of its cases again.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from models.basics import FloatArray, InputError
from models.case import Case
from models.casefile import read_yaml
from models.spread import Samples, Spread

from ..design import Design
from .metrics import FrequencyMetric

if TYPE_CHECKING:
    import xarray as xr


_LISTED = 1000  # samples that are written into the attributes


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
    coordinates: dict[str, Any] = {
        "case": ("case", np.arange(first, first + len(rows)), {"long_name": "number of the case"})
    }
    units, nominal = spread.units, spread.nominal
    for j, path in enumerate(spread.paths):
        about = {"units": units[path] or "1", "long_name": path, "nominal": nominal[path]}
        coordinates[path] = ("case", rows[:, j].copy(), about)
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
        coords=coordinates,
        attrs={
            "title": f"sweep of {case.name} in the frequency domain",
            "mode": "frequency",
            "case_yaml": case.to_yaml(),
            # Long lists of samples stand in the coordinates already.
            "spread_yaml": spread.to_yaml() if _short(spread) else "",
            "structure": design.structure,
            "gains": json.dumps(dict(design.parameters)),
            "drag": float(design.drag),
            "masses": int(design.masses),
            **notes,
        },
    )


def gains_of(dataset: xr.Dataset) -> dict[str, float]:
    """Return the design's gains that a dataset speaks of."""
    found: dict[str, float] = json.loads(_attribute(dataset, "gains"))
    return found


def spread_of(dataset: xr.Dataset) -> Spread:
    """Return the spread of a dataset, on its case."""
    data, _ = read_yaml(_attribute(dataset, "case_yaml"), "dataset")
    case = Case.from_dict(data, source=str(data.get("name", "dataset")))
    drag = float(dataset.attrs.get("drag", 0.0))
    text = _attribute(dataset, "spread_yaml")
    if text:
        written, _ = read_yaml(text, "dataset")
        found = Spread.from_dict(written, source="dataset")
    else:
        varied = [str(name) for name in dataset.coords if name != "case"]
        found = Spread({path: Samples(dataset[path].values) for path in varied})
    return found.on(case, gains_of(dataset), drag)


def case_of(dataset: xr.Dataset, number: int) -> Case:
    """Return the case of one entry along "case", its gains in it where they are the three.

    Parameters
    ----------
    dataset
        A sweep's dataset, or a part of it.
    number
        The case's number, a value of the coordinate "case".

    Raises
    ------
    InputError
        If there is no such case, or the dataset is not one of a sweep.
    """
    at = np.flatnonzero(dataset["case"].values == number)
    if not at.size:
        raise InputError(f"sweep: there is no case number {number} in this dataset")
    spread = spread_of(dataset)
    row = [float(dataset[path].values[at[0]]) for path in spread.paths]
    case = spread.case_at(row)
    gains = {**gains_of(dataset), **spread.gains(row)}
    changes: dict[str, Any] = {"name": f"{case.name} ({number})"[:100]}
    if set(gains) == {"A", "a", "a1", "a2"}:
        changes["gains"] = gains
    drag = spread.drag(row)
    if drag is not None:
        changes["payload.drag"] = {"method": "given", "coefficient": drag}
    return case.replace(changes)


def _short(spread: Spread) -> bool:
    lists = [d for d in spread.distributions.values() if isinstance(d, Samples)]
    return sum(len(d.values) for d in lists) <= _LISTED


def _attribute(dataset: xr.Dataset, name: str) -> str:
    found = dataset.attrs.get(name)
    if not isinstance(found, str):
        raise InputError(f"sweep: the dataset has no attribute {name!r}; it is none of a sweep")
    return found
