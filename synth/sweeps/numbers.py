"""The plant's numbers of many cases at once: columns of a spread -> columns of `PlantData`.

A thousand checked cases take seconds, a thousand columns of arithmetic microseconds.  So the fields
of a case are columns here, unchecked, from which `PlantData.from_case` makes columns; these are
compared with the checked cases of some of the rows.  Where a formula asks which value it has, which
columns refuse to answer, or there is any difference, every row goes through its own checked case.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any, TypeVar

import numpy as np

from models.basics import ComplexArray, FloatArray, IndexArray, InputError
from models.case import Case
from models.operation import PREFIX as FAULTS
from models.plant import MAX_BRANCHES, PlantData, first_root, zener_branches
from models.spread import DRAG, GAINS, Spread, with_payload

from ..loop import Dual

Column = TypeVar("Column", FloatArray, ComplexArray)
Numbers = Mapping[str, Any]
"""Numbers of plants with their sensors by name, in SI: (n,), or (1,) where all have the same, so
that arithmetic on what does not vary costs nothing.  `columns_of` says which."""

_AGREE = 1e-12

# Paths that nothing of a case's plant depends on.
_ELSEWHERE = ("sea.", "vessel.", "limits.", FAULTS, GAINS, DRAG)
# What the other sensors are made of, and how sure the weight is, by path.
_SENSED = {
    "acceleration_noise": "sensors.payload.acceleration_noise",
    "velocity_noise": "sensors.payload.velocity_noise",
    "displacement_noise": "sensors.payload.displacement_noise",
    **{
        f"{name}_{end}": f"sensors.payload.{name}_{end}"
        for name in ("acceleration", "velocity", "displacement")
        for end in ("rate", "latency")
    },
    "mru_period": "sensors.mru.heave_filter_period",
    "mru_gain": "sensors.mru.gain_error",
    "mru_phase": "sensors.mru.phase_error",
    "mru_drift": "sensors.mru.drift",
    "mru_drift_period": "sensors.mru.drift_period",
    "mru_noise": "sensors.mru.noise",
    "mru_output": "sensors.mru.bandwidth",
    "mru_floor": "sensors.mru.noise_floor",
    "mru_fraction": "sensors.mru.noise_fraction",
    "mru_bandwidth": "sensors.mru.noise_bandwidth",
    "mru_delay": "sensors.mru.delay",
    "cell_bandwidth": "sensors.load_cell.bandwidth",
    "cell_noise": "sensors.load_cell.noise_fraction",
    "weight_uncertainty": "payload.weight_uncertainty",
}
NOISE_OF = {
    "payload.acceleration": ("acceleration_noise",),
    "payload.velocity": ("velocity_noise",),
    "payload.displacement": ("displacement_noise",),
    "mru.heave": ("mru_floor", "mru_fraction", "mru_gain", "mru_phase", "mru_drift", "mru_noise"),
    "rope.tension": ("cell_noise",),
}
"""Numbers of the sensors by what is measured; zero or NaN where it is without noise."""
_PLAIN = tuple(
    f.name
    for f in fields(PlantData)
    if f.name not in ("damping_law", "masses", "lumping", "motor", "friction_speed", "switching")
)
BRANCH_GAINS = tuple(f"branch_gain_{j}" for j in range(MAX_BRANCHES))
BRANCH_TIMES = tuple(f"branch_time_{j}" for j in range(MAX_BRANCHES))
"""Shares k_j and times of a hysteretic rope's branches, zero where there are fewer."""


def columns_of(case: Case) -> dict[str, FloatArray]:
    """Return what the loops of a case are made of, (1,) each; (n,) if its fields are columns.

    The fields of `PlantData` and its plain properties by their names, and beside them

    * ``haul``: h = r/n, rope hauled by a turn of the motor [m]; ``load``: h (1/eta + eta)/2 [m];
      ``reeved``: tension at the drum over that of all falls, mean of both ways [-];
    * ``phi``, ``beta``, ``lag``: torque per command, torque per speed, and the lag of the motor
      with its drive [s];
    * ``damping_time``, ``slow`` and the gains and times [s] of its branches: the rope's EA(s)/EA,
      by `PlantData.damping_time` and `PlantData.branches`;
    * ``fixed_drag``: linear drag coefficient [N s/m]; NaN where it agrees with the response;
    * ``friction``: what losses that switch come to, zero before it is found [N m s/rad];
    * the sensors' numbers; NaN where there is no such sensor;
    * ``noise_passes``: 1 where noise of the payload's signals passes their low-passes, else 0.
    """
    data, drag = PlantData.from_case(case), case.payload.fixed_drag
    found = {name: getattr(data, name) for name in _PLAIN}
    derived = "stiffness", "rope_mass", "static_tension", "hung_weight"
    found |= {name: getattr(data, name) for name in derived}
    haul = data.drum_radius / data.gear_ratio
    found |= {"haul": haul, "load": data.mean_gear_factor * haul}
    found["reeved"] = data.mean_sheaves_factor / data.falls
    phi: Any
    if data.motor == "dc":
        phi = data.torque_constant / data.resistance
        beta, lag = phi * data.back_emf_constant, data.inductance / data.resistance
    else:
        beta, lag = data.speed_gain, 1.0 / data.torque_bandwidth
        # Without a speed regulator the command is the torque itself.
        phi = np.where(np.asarray(beta) > 0.0, beta, 1.0)
    found |= {"phi": phi, "beta": beta, "lag": lag, "switches": float(data.switching)}
    found |= {**_rope(data), "fixed_drag": math.nan if drag is None else drag, "friction": 0.0}
    found["noise_passes"] = float(case.sensors.payload.noise_enters == "before-filter")
    for name, path in _SENSED.items():
        value: Any = case
        for key in path.split("."):
            value = getattr(value, key, None)
        found[name] = math.nan if value is None else value
    return {name: np.atleast_1d(np.asarray(v, dtype=np.float64)) for name, v in found.items()}


def _rope(data: PlantData) -> dict[str, Any]:
    """Return what the damping law of a rope is made of, its data columns or not."""
    zeta = data.damping_ratio
    found: dict[str, Any] = {"damping_time": 0.0, "slow": 1.0}
    found |= dict.fromkeys([*BRANCH_GAINS, *BRANCH_TIMES], 0.0)
    if not np.any(zeta):
        return found
    wave = np.sqrt(data.axial_stiffness / np.maximum(data.mass_per_length, 1e-300))
    nu = first_root(np.asarray(data.rope_mass / (data.payload_mass + data.block_mass)))
    if data.damping_law != "hysteretic":
        return found | {"damping_time": 2.0 * zeta * data.rope_length / (nu * wave)}
    first = nu * wave / data.rope_length
    found["slow"], gains, times = zener_branches(zeta, first, data.highest_mode(first))
    found |= dict(zip(BRANCH_GAINS, gains, strict=True))
    return found | dict(zip(BRANCH_TIMES, times, strict=True))


def at_rest(numbers: Numbers) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    """Return what holding the load takes, and its loss to both sides, by output, (n,) or (1,).

    As `LinearPlant.static` and `LinearPlant.loss`.
    """
    tension, over = numbers["static_tension"], numbers["sheaves_efficiency"]
    eta, switches = numbers["gear_efficiency"] * over, numbers["switches"]

    def of_ways(mean: FloatArray, hauled: FloatArray) -> tuple[FloatArray, FloatArray]:
        return switches * mean + (1.0 - switches) * hauled, switches * (hauled - mean)

    hung = numbers["hung_weight"]
    held, loss = of_ways(hung * numbers["load"], hung * numbers["haul"] / eta)
    loss = loss + switches * numbers["coulomb_friction"]
    drum, reeved = of_ways(tension * numbers["reeved"], tension / over)

    def drive(torque: FloatArray) -> dict[str, FloatArray]:
        current = torque / numbers["torque_constant"]
        voltage = current * numbers["resistance"]
        return {"motor.torque": torque, "motor.current": current, "motor.voltage": voltage}

    lowest = numbers["payload_weight"] * (1.0 - numbers["weight_uncertainty"])
    ends = {"rope.tension": drum, "rope.lower_tension": lowest}
    return {**ends, **drive(held)}, {"rope.tension": reeved, **drive(loss)}


def numbers_of(
    case: Case, spread: Spread, rows: FloatArray, *, columns: bool | None = None
) -> tuple[Numbers, bool]:
    """Return the plants of a spread's rows, (n, d), and whether columns sufficed.

    `columns` tells whether they do; if left out all rows are compared with their checked cases.

    Raises InputError if a row is no valid case; its values are named.
    """
    found: Numbers = {}
    if columns is not False:
        try:
            found = columns_of(_with_columns(case, spread, rows))
            if columns is None:
                columns = _agree(found, spread, rows)
        except (TypeError, ValueError):
            columns = False
    if not columns:
        found = _one_by_one(case, spread, rows)
    if DRAG in spread.paths:
        found = {**found, "fixed_drag": rows[:, spread.paths.index(DRAG)]}
    return found, columns


def _agree(quick: Numbers, spread: Spread, rows: FloatArray) -> bool:
    """Return whether plants by column arithmetic are those of their checked cases."""
    table = np.stack(np.broadcast_arrays(*quick.values(), np.zeros(len(rows)))[:-1], axis=1)
    for row, own in zip(rows, table, strict=True):
        exact = np.concatenate(list(columns_of(_case_at(spread, row)).values()))
        if not np.allclose(own, exact, rtol=_AGREE, atol=0.0, equal_nan=True):
            return False
    return True


def _case_at(spread: Spread, row: FloatArray) -> Case:
    try:
        return spread.case_at(row)
    except InputError as error:
        named = ", ".join(f"{p} = {v:.6g}" for p, v in zip(spread.paths, row, strict=True))
        raise InputError(f"sweep: no case at {named}: {error}") from None


def _one_by_one(like: Case, spread: Spread, rows: FloatArray) -> Numbers:
    """Return the plants of rows, each through its own checked case."""
    cases = [_case_at(spread, row) for row in rows]
    kinds = {(c.winch.motor.type, c.rope.lumping, c.rope.masses) for c in [like, *cases]}
    if len(kinds) > 1:
        raise InputError("sweep: the motor's kind and the rope's lumping cannot vary within one")
    parts = [columns_of(own) for own in cases]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _with_columns(case: Case, spread: Spread, rows: FloatArray) -> Any:
    """Return the case with the columns of rows as its fields, and nothing checked."""
    pairs = zip(spread.paths, rows.T, strict=True)
    given = {path: column for path, column in pairs if not path.startswith(_ELSEWHERE)}
    if "rope.length" in given and case.winch.drum.radius is None:
        paid_out = case.rope.falls * given["rope.length"]
        given.setdefault("winch.drum.radius", _radius(case, paid_out))
    changed: Any = case
    for path, column in with_payload(case, given).items():
        changed = _with(changed, path.split("."), column)
    return changed


def _with(section: Any, keys: Sequence[str], value: Any) -> Any:
    """Return a section with a field below it changed, and nothing checked."""
    key = keys[0]
    below = value if len(keys) == 1 else _with(getattr(section, key), keys[1:], value)
    fields = {name: getattr(section, name) for name in type(section).model_fields}
    for group in section.alternatives if len(keys) == 1 else ():
        if key in group:
            fields |= dict.fromkeys(group)
    # Constructed anew and not copied: a copy would keep what was computed of the old fields.
    return type(section).model_construct(**{**fields, key: below})


def _radius(case: Case, length: FloatArray) -> FloatArray:
    """Return the drum's radius of the layer in use, as `Drum.radius_at` does."""
    drum, diameter = case.winch.drum, case.rope.diameter
    total = drum.total(diameter)
    if np.any(length > total):
        raise InputError(
            f"sweep: rope.length must be at most what the drum holds, {total:.4g} m, "
            f"got {length.max():g} m"
        )
    lays = drum.lays(diameter)  # innermost first: from which length on a radius holds
    inside = [length >= start for start, _ in lays]
    return np.select(inside, [radius for _, radius in lays], lays[-1][1])


def part_of(column: Column, rows: IndexArray) -> Column:
    """Return a column's values of some rows; the one value where all rows have the same.

    A `Dual` number is of one loop, and stays what it is.
    """
    return column if isinstance(column, Dual) or len(column) == 1 else column[rows]


def at_rows(column: Any, rows: IndexArray) -> Any:
    """Return a column's values of some rows, (m, 1); (1, 1) where all rows have the same."""
    return part_of(column, rows)[:, None]
