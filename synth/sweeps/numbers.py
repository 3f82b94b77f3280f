"""The plant's numbers of many cases at once: columns of a spread -> columns of `PlantData`.

A thousand checked cases take seconds, a thousand columns of arithmetic microseconds.  So the fields
of a case are columns here, unchecked, from which `PlantData.from_case` makes columns; these are
compared with the checked cases of some of the rows.  Where a formula asks which value it has, which
columns refuse to answer, or there is any difference, every row goes through its own checked case.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

import numpy as np

from models.basics import ComplexArray, FloatArray, IndexArray, InputError
from models.case import Case
from models.operation import PREFIX as FAULTS
from models.plant import PlantData
from models.spread import DRAG, GAINS, Spread, with_payload

Column = TypeVar("Column", FloatArray, ComplexArray)

_AGREE = 1e-12
_NEWTON = 30

# Paths that nothing of a case's plant depends on.
_ELSEWHERE = ("sea.", "vessel.", "limits.", FAULTS, GAINS, DRAG)
# What the other sensors are made of, by path; nothing of a case's plant depends on them.
_SENSED = {
    "acceleration_noise": "sensors.payload.acceleration_noise",
    "velocity_noise": "sensors.payload.velocity_noise",
    "displacement_noise": "sensors.payload.displacement_noise",
    "mru_period": "sensors.mru.heave_filter_period",
    "mru_floor": "sensors.mru.noise_floor",
    "mru_fraction": "sensors.mru.noise_fraction",
    "mru_bandwidth": "sensors.mru.noise_bandwidth",
    "mru_delay": "sensors.mru.delay",
    "cell_bandwidth": "sensors.load_cell.bandwidth",
    "cell_noise": "sensors.load_cell.noise_fraction",
}
NOISE_OF = {
    "payload.acceleration": "acceleration_noise",
    "payload.velocity": "velocity_noise",
    "payload.displacement": "displacement_noise",
    "mru.heave": "mru_error",
    "rope.tension": "cell_noise",
}
"""Number of the sensors by what is measured; zero or NaN where it is without noise."""
_PLAIN = tuple(
    f.name
    for f in fields(PlantData)
    if f.name not in ("masses", "lumping", "motor", "coulomb_friction", "friction_speed")
)


@dataclass(frozen=True, kw_only=True, eq=False)
class PlantNumbers:
    """Numbers of n plants of one kind, in SI, named as in `PlantData`.

    Attributes
    ----------
    count
        How many plants, n.
    values
        By name of a field of `PlantData`: (n,), or (1,) where all plants have the same, so that
        arithmetic on what does not vary costs nothing.
    like
        The plant of the case itself: its kind of motor, how its rope is lumped.
    fixed_drag
        Linear drag coefficient [N s/m]; NaN where it agrees with the response.
    sensors
        Numbers of the sensors besides those of the payload's signals, likewise; NaN where there
        is no such sensor.
    """

    count: int
    values: Mapping[str, FloatArray]
    like: PlantData
    fixed_drag: FloatArray
    sensors: Mapping[str, FloatArray]

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, name: str) -> FloatArray:
        return self.values[name]

    def part(self, index: IndexArray) -> PlantNumbers:
        """Return some of the plants."""
        return replace(
            self,
            count=len(index),
            values={name: part_of(column, index) for name, column in self.values.items()},
            fixed_drag=part_of(self.fixed_drag, index),
            sensors={name: part_of(column, index) for name, column in self.sensors.items()},
        )

    @property
    def stiffness(self) -> FloatArray:
        """K = EA/L [N/m]."""
        return self["axial_stiffness"] / self["rope_length"]

    @property
    def rope_mass(self) -> FloatArray:
        """Mass of the rope paid out [kg]."""
        return self["mass_per_length"] * self["rope_length"]

    @property
    def static_tension(self) -> FloatArray:
        """Rope tension at the drum at rest [N]."""
        return self["payload_weight"] + self["rope_weight"] * self["rope_length"]

    @property
    def at_rest(self) -> dict[str, FloatArray]:
        """What hauling the load at rest takes, by output, (n,) or (1,)."""
        tension = self.static_tension
        torque = tension * self["drum_radius"] / (self["gear_ratio"] * self["gear_efficiency"])
        current = torque / self["torque_constant"]
        return {
            "rope.tension": tension,
            "motor.torque": torque,
            "motor.current": current,
            "motor.voltage": current * self["resistance"],
        }

    @property
    def gear_factor(self) -> FloatArray:
        """(1/eta + eta)/2, see `PlantData.mean_gear_factor` [-]."""
        eta = self["gear_efficiency"]
        return 0.5 * (1.0 / eta + eta)

    @property
    def drive(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Torque per command, torque per speed, and the lag of the motor with its drive [s]."""
        if self.like.motor == "dc":
            phi = self["torque_constant"] / self["resistance"]
            return phi, phi * self["back_emf_constant"], self["inductance"] / self["resistance"]
        lag = 1.0 / self["torque_bandwidth"]
        if self.like.speed_gain > 0.0:
            return self["speed_gain"], self["speed_gain"], lag
        return np.ones(1), np.zeros(1), lag

    @property
    def damping_time(self) -> FloatArray:
        """Kelvin-Voigt time of the rope, 2 zeta over the first exact mode [s]."""
        zeta = self["damping_ratio"]
        if not np.any(zeta):
            return np.zeros(1)
        wave = np.sqrt(self["axial_stiffness"] / np.maximum(self["mass_per_length"], 1e-300))
        nu = _first_root(self.rope_mass / self["payload_mass"])
        return 2.0 * zeta * self["rope_length"] / (nu * wave)


def numbers_of(
    case: Case, spread: Spread, rows: FloatArray, *, columns: bool | None = None
) -> tuple[PlantNumbers, bool]:
    """Return the plants of a spread's rows, (n, d), and whether columns sufficed.

    `columns` tells whether they do; if left out all rows are compared with their checked cases.

    Raises
    ------
    InputError
        If a row is no valid case; its values are named.
    """
    drag = rows[:, spread.paths.index(DRAG)] if DRAG in spread.paths else None
    like = PlantData.from_case(case)
    if columns is None:
        try:
            columns = _agree(_columns(like, spread, rows), spread, rows)
        except (TypeError, ValueError):
            columns = False
    made = _columns(like, spread, rows) if columns else _one_by_one(like, spread, rows)
    return made if drag is None else replace(made, fixed_drag=drag), columns


def _agree(quick: PlantNumbers, spread: Spread, rows: FloatArray) -> bool:
    """Return whether plants by column arithmetic are those of their checked cases."""
    for k, row in enumerate(rows):
        exact = PlantData.from_case(_case_at(spread, row))
        for name in _PLAIN:
            value, own = getattr(exact, name), float(quick[name][k % quick[name].size])
            same = value == own or abs(value - own) <= _AGREE * abs(value)
            if not (same or (math.isnan(value) and math.isnan(own))):
                return False
    return True


def _case_at(spread: Spread, row: FloatArray) -> Case:
    try:
        return spread.case_at(row)
    except InputError as error:
        named = ", ".join(f"{p} = {v:.6g}" for p, v in zip(spread.paths, row, strict=True))
        raise InputError(f"sweep: no case at {named}: {error}") from None


def _one_by_one(like: PlantData, spread: Spread, rows: FloatArray) -> PlantNumbers:
    """Return the plants of rows, each through its own checked case."""
    data, fixed = [], []
    for row in rows:
        own = _case_at(spread, row)
        data.append(PlantData.from_case(own))
        drag = own.payload.fixed_drag
        fixed.append(math.nan if drag is None else drag)
    values = {name: np.array([getattr(d, name) for d in data]) for name in _PLAIN}
    kinds = {(d.motor, d.lumping, d.masses) for d in data}
    if kinds != {(like.motor, like.lumping, like.masses)}:
        raise InputError("sweep: the motor's kind and the rope's lumping cannot vary within one")
    return PlantNumbers(
        count=len(rows),
        values=values,
        like=like,
        fixed_drag=np.array(fixed),
        sensors=_sensors(spread, rows),
    )


def _sensors(spread: Spread, rows: FloatArray) -> dict[str, FloatArray]:
    """Return the sensors' numbers, NaN where the case has no such sensor."""

    def of(path: str) -> FloatArray:
        if path in spread.paths:
            return rows[:, spread.paths.index(path)]
        found: Any = spread.case
        for key in path.split("."):
            found = getattr(found, key, None)
        return np.array([math.nan if found is None else float(found)])

    found = {name: of(path) for name, path in _SENSED.items()}
    return {**found, "mru_error": np.maximum(found["mru_floor"], found["mru_fraction"])}


def _columns(like: PlantData, spread: Spread, rows: FloatArray) -> PlantNumbers:
    """Return the plants of rows by column arithmetic.

    Raises
    ------
    TypeError, ValueError
        If something on the way is no plain arithmetic.
    """
    case = spread.case
    assert case is not None
    pairs = zip(spread.paths, rows.T, strict=True)
    given = {path: column for path, column in pairs if not path.startswith(_ELSEWHERE)}
    if "rope.length" in given and case.winch.drum.radius is None:
        given.setdefault("winch.drum.radius", _radius(case, given["rope.length"]))
    changed: Any = case
    for path, column in with_payload(case, given).items():
        changed = _with(changed, path.split("."), column)
    data, fixed = PlantData.from_case(changed), changed.payload.fixed_drag
    return PlantNumbers(
        count=len(rows),
        values={name: np.atleast_1d(getattr(data, name)) for name in _PLAIN},
        like=like,
        fixed_drag=np.atleast_1d(math.nan if fixed is None else fixed),
        sensors=_sensors(spread, rows),
    )


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


def _first_root(eps: FloatArray) -> FloatArray:
    """Return the root of nu tan nu = eps in (0, pi/2), by Newton's rule; sqrt(eps) for small."""
    nu = np.sqrt(3.0 * eps / (3.0 + eps))
    nu = np.minimum(nu, 0.5 * np.pi * eps / (1.0 + eps) + 1e-3)
    for _ in range(_NEWTON):
        value = nu * np.sin(nu) - eps * np.cos(nu)
        slope = np.sin(nu) + nu * np.cos(nu) + eps * np.sin(nu)
        step = value / slope
        nu = np.clip(nu - step, 0.25 * nu, 0.5 * np.pi)
        if np.all(np.abs(step) <= 1e-15 * nu):
            break
    return nu


def part_of(column: Column, rows: IndexArray) -> Column:
    """Return a column's values of some rows; the one value where all rows have the same."""
    return column[rows] if len(column) > 1 else column


def at_rows(column: FloatArray, rows: IndexArray) -> FloatArray:
    """Return a column's values of some rows, (m, 1); (1, 1) where all rows have the same."""
    return part_of(column, rows)[:, None]
