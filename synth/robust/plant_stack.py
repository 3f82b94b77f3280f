"""Thousands of linear plants at once: stacked matrices of a case's random draws.

    members of a family -> numbers of each -> Jacobians of one symbolic plant, mapped -> PlantStack

Building a plant takes some twenty milliseconds, nearly all of it for symbols, checks and the
point of rest.  The linear plant depends on none of these: its matrices are the Jacobians at any
taut rope, functions of the plant's numbers alone, and CasADi evaluates them for all draws in
one call.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from models.basics import FloatArray
from models.case import Case
from models.plant import LinearPlant, PlantData, build_plant, pade_bank, parameter_values

from .family import Family, Member

_PADE = 6
_SHORTEST = 1e-4  # of a delay that has a Pade model [s]
_BLOCKS = ("A", "B", "E", "C", "D", "F", "Cz", "Dz", "Fz")
_CHECKED = 8  # members whose numbers are compared with those of the checked case


@dataclass(frozen=True, kw_only=True, eq=False)
class PlantStack:
    """Matrices of m plants of one kind, (m, rows, columns); names are those of `like`.

    Attributes
    ----------
    like
        One of them, for the names and the rates.
    delays
        Delay of each measurement, (m, ny) [s].
    static
        Values at rest of those outputs that limits speak of, (m,) each.
    quadratic_drag, linear_drag
        q [N s2/m2] and the C that the matrices hold [N s/m], (m,).
    """

    like: LinearPlant
    A: FloatArray
    B: FloatArray
    E: FloatArray
    C: FloatArray
    D: FloatArray
    F: FloatArray
    Cz: FloatArray
    Dz: FloatArray
    Fz: FloatArray
    delays: FloatArray
    static: Mapping[str, FloatArray]
    quadratic_drag: FloatArray
    linear_drag: FloatArray

    @classmethod
    def of(cls, plants: Sequence[LinearPlant]) -> PlantStack:
        """Return the stack of plants that have been built one by one, without drag to solve."""
        first = plants[0]
        blocks = {name: np.stack([getattr(p, name) for p in plants]) for name in _BLOCKS}
        return cls(
            like=first,
            delays=np.array([p.delays for p in plants]),
            static={
                name: np.array([p.static.get(name, 0.0) for p in plants]) for name in first.outputs
            },
            quadratic_drag=np.zeros(len(plants)),
            linear_drag=np.zeros(len(plants)),
            **blocks,
        )

    def __len__(self) -> int:
        return len(self.A)

    def part(self, index: slice | npt.NDArray[np.intp]) -> PlantStack:
        """Return some of the plants."""
        return PlantStack(
            like=self.like,
            **{name: getattr(self, name)[index] for name in (*_BLOCKS, "delays")},
            static={name: values[index] for name, values in self.static.items()},
            quadratic_drag=self.quadratic_drag[index],
            linear_drag=self.linear_drag[index],
        )

    def with_drag(self, coefficient: FloatArray) -> PlantStack:
        """Return the plants with other linear drag, (m,) [N s/m]: force = -C velocity."""
        v = self.like.outputs.index("payload.velocity")
        f = self.like.disturbances.index("payload.force")
        more = (self.linear_drag - coefficient)[:, None, None]
        row = self.Cz[:, v : v + 1]
        changed: dict[str, Any] = {name: getattr(self, name) for name in _BLOCKS}
        changed["A"] = self.A + more * self.E[:, :, f : f + 1] @ row
        changed["C"] = self.C + more * self.F[:, :, f : f + 1] @ row
        changed["Cz"] = self.Cz + more * self.Fz[:, :, f : f + 1] @ row
        return PlantStack(
            like=self.like,
            delays=self.delays,
            static=self.static,
            quadratic_drag=self.quadratic_drag,
            linear_drag=coefficient,
            **changed,
        )

    def without_delays(self) -> PlantStack:
        """Return the plants with Pade models in the delays' place, one for each measurement.

        At the input where all measurements are equally late, as `LinearPlant.without_delays`.
        """
        if not self.delays.any():
            return self
        late = np.maximum(self.delays, _SHORTEST)
        changed: dict[str, Any] = {name: getattr(self, name) for name in _BLOCKS}
        m, n = self.A.shape[:2]
        equal = bool((late == late[:, :1]).all()) and self.B.shape[2] == 1
        banks: dict[tuple[float, ...], Any] = {}
        for row in late:
            key = (float(row[0]),) if equal else tuple(float(v) for v in row)
            banks.setdefault(key, pade_bank(key, _PADE))
        chosen = [banks[(float(r[0]),) if equal else tuple(float(v) for v in r)] for r in late]
        A2, B2, C2, D2 = (np.stack([bank[k] for bank in chosen]) for k in range(4))
        k = A2.shape[1]
        if equal:
            changed["A"] = np.block([[self.A, self.B @ C2], [np.zeros((m, k, n)), A2]])
            changed["B"] = np.concatenate([self.B @ D2, B2], axis=1)
            changed["E"] = np.concatenate([self.E, np.zeros((m, k, self.E.shape[2]))], axis=1)
            changed["C"] = np.concatenate([self.C, self.D @ C2], axis=2)
            changed["D"] = self.D @ D2
            changed["Cz"] = np.concatenate([self.Cz, self.Dz @ C2], axis=2)
            changed["Dz"] = self.Dz @ D2
        else:
            changed["A"] = np.block([[self.A, np.zeros((m, n, k))], [B2 @ self.C, A2]])
            changed["B"] = np.concatenate([self.B, B2 @ self.D], axis=1)
            changed["E"] = np.concatenate([self.E, B2 @ self.F], axis=1)
            changed["C"] = np.concatenate([D2 @ self.C, C2], axis=2)
            changed["D"], changed["F"] = D2 @ self.D, D2 @ self.F
            changed["Cz"] = np.concatenate([self.Cz, np.zeros((m, self.Cz.shape[1], k))], axis=2)
        return PlantStack(
            like=self.like,
            delays=np.zeros_like(self.delays),
            static=self.static,
            quadratic_drag=self.quadratic_drag,
            linear_drag=self.linear_drag,
            **changed,
        )


def stacked_members(family: Family, members: Sequence[Member], masses: int) -> PlantStack:
    """Return the plants of members of a family, all with so many rope masses.

    Their linear drag is the case's fixed one, or zero where it is solved with the response.
    """
    data = numbers_of(family, members)
    plant = build_plant(data[0], masses)
    fixed = family.case.payload.fixed_drag
    drag = np.full(len(members), 0.0 if fixed is None else float(fixed))
    rows = []
    for one, C in zip(data, drag, strict=True):
        values = parameter_values(one) | {"payload.linear_drag": float(C)}
        rows.append([values[name] for name in plant.parameters])
    m = len(members)
    zeros = [np.zeros((k, m)) for k in (len(plant.states), 1, len(plant.disturbances))]
    found = plant.jacobians.map(m)(*zeros, np.array(rows).T)
    blocks = {}
    for name, block in zip(_BLOCKS, found, strict=True):
        full = np.asarray(block.full(), dtype=np.float64)
        blocks[name] = np.ascontiguousarray(
            full.reshape(full.shape[0], m, full.shape[1] // m).transpose(1, 0, 2)
        )
    first = plant.linearise(drag=float(drag[0]))
    return PlantStack(
        like=first,
        delays=np.array([[d.delay] * len(first.measurements) for d in data]),
        static=_static(data),
        quadratic_drag=np.array([d.quadratic_drag if fixed is None else 0.0 for d in data]),
        linear_drag=drag,
        **blocks,
    )


def numbers_of(family: Family, members: Sequence[Member]) -> list[PlantData]:
    """Return the plant's numbers of each member, checked case by case only where it pays.

    The ends of the ranges have been checked; what lies between is put into the sections as it
    is.  A few members are compared with those of the checked case, and all are made that way
    if any differs.
    """
    quick = [PlantData.from_case(_unchecked(family.case, family.changes(m))) for m in members]
    for k in np.linspace(0, len(members) - 1, min(_CHECKED, len(members))).astype(int):
        if PlantData.from_case(family.case_at(members[k])) != quick[k]:
            return [PlantData.from_case(family.case_at(m)) for m in members]
    return quick


def _unchecked(case: Case, changes: Mapping[str, Any]) -> Any:
    """Return a case with fields changed but nothing checked."""
    changed: Any = case
    for path, value in changes.items():
        changed = _with(changed, path.split("."), value)
    return changed


def _with(section: Any, keys: Sequence[str], value: Any) -> Any:
    key = keys[0]
    below = value if len(keys) == 1 else _with(getattr(section, key), keys[1:], value)
    fields = {name: getattr(section, name) for name in type(section).model_fields}
    if len(keys) == 1:
        for group in section.alternatives:
            if key in group:
                fields |= dict.fromkeys(set(group) - {key})
    # Constructed anew and not copied: a copy would keep what was computed of the old fields.
    return type(section).model_construct(**{**fields, key: below})


def _static(data: Sequence[PlantData]) -> dict[str, FloatArray]:
    """Return what hauling the load at rest takes, by the formulas of a hand calculation."""
    tension = np.array([d.static_tension for d in data])
    arm = np.array([d.drum_radius / (d.gear_ratio * d.gear_efficiency) for d in data])
    current = tension * arm / np.array([d.torque_constant for d in data])
    found = {"rope.tension": tension, "motor.torque": tension * arm, "motor.current": current}
    if data[0].motor == "dc":
        found["motor.voltage"] = current * np.array([d.resistance for d in data])
    return found
