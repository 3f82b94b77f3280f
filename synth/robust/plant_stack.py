"""Stacks of plants, and of the loops that a controller closes around them: thousands at once.

    members of a family -> numbers of each -> Jacobians of one symbolic plant, mapped -> PlantStack

Building a plant takes some twenty milliseconds, nearly all of it for symbols, checks and the
point of rest.  The linear plant depends on none of these: its matrices are the Jacobians at any
taut rope, functions of the plant's numbers alone, and CasADi evaluates them for all draws in
one call.

    PlantStack + one controller -> closed-loop matrices -> eigenvalues and residues -> LoopStack

One eigendecomposition of each closed loop says whether it is stable, and turns every response
into a sum over modes, H(s) = F + sum_k r_k/(s - p_k), that costs a few additions per
frequency.  Delays are Pade models of order six.  Nothing here is used to find a design: the
searches close loops node by node (`synth.loop.loop`), so this is a second opinion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from models.basics import BoolArray, ComplexArray, FloatArray, IndexArray, Quadrature, peak_factor
from models.case import Case
from models.plant import LinearPlant, PlantData, build_plant, pade_bank, parameter_values

from ..loop import LinearController
from ..verify import LawMatrices
from .family import Family, Member

_PADE = 6
_SHORTEST = 1e-4  # of a delay that has a Pade model [s]
_BLOCKS = ("A", "B", "E", "C", "D", "F", "Cz", "Dz", "Fz")
_CHECKED = 8  # members whose numbers are compared with those of the checked case
_CHUNK = 400  # loops whose responses are evaluated at once
_ZOOM = np.array([-1.0, -0.6, -0.3, -0.1, 0.1, 0.3, 0.6, 1.0])
_NEAR = np.array([-3.0, -1.5, -0.7, -0.3, 0.0, 0.3, 0.7, 1.5, 3.0])
_ROUNDS = 6  # of zooming into the peak of the sensitivity
_DRAG_ROUNDS = 30
_PEAKS = 3  # of each sensitivity that are zoomed into
_STEP = 1.5  # of the logarithm of a drag coefficient, at most
_AGREE = 3e-5  # of a drag coefficient with its response


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

    def part(self, index: slice | IndexArray) -> PlantStack:
        """Return some of the plants."""
        rows = (*_BLOCKS, "delays", "quadratic_drag", "linear_drag")
        return replace(
            self,
            static={name: values[index] for name, values in self.static.items()},
            **{name: getattr(self, name)[index] for name in rows},
        )

    def with_drag(self, coefficient: FloatArray) -> PlantStack:
        """Return the plants with other linear drag, (m,) [N s/m]: force = -C velocity."""
        v = self.like.outputs.index("payload.velocity")
        f = self.like.disturbances.index("payload.force")
        more = (self.linear_drag - coefficient)[:, None, None]
        row = self.Cz[:, v : v + 1]
        return replace(
            self,
            A=self.A + more * self.E[:, :, f : f + 1] @ row,
            C=self.C + more * self.F[:, :, f : f + 1] @ row,
            Cz=self.Cz + more * self.Fz[:, :, f : f + 1] @ row,
            linear_drag=coefficient,
        )

    def without_delays(self) -> PlantStack:
        """Return the plants with Pade models in the delays' place, one for each measurement.

        At the input where all measurements are equally late, as `LinearPlant.without_delays`.
        """
        if not self.delays.any():
            return self
        late = np.maximum(self.delays, _SHORTEST)
        changed: dict[str, Any] = {}
        m, n = self.A.shape[:2]
        equal = bool((late == late[:, :1]).all()) and self.B.shape[2] == 1
        keys = [tuple(row[:1].tolist() if equal else row.tolist()) for row in late]
        banks = {key: pade_bank(key, _PADE) for key in dict.fromkeys(keys)}
        chosen = [banks[key] for key in keys]
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
        return replace(self, delays=np.zeros_like(self.delays), **changed)


def stacked_members(family: Family, members: Sequence[Member], masses: int) -> PlantStack:
    """Return the plants of members of a family, all with so many rope masses.

    Their linear drag is the case's fixed one, or zero where it is solved with the response.  The
    noise in each measurement is a disturbance, named as `models.sensing.sensed_plant` names it.
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
    noises = {f"{name}_noise": first.units[name] for name in first.measurements}
    return PlantStack(
        like=replace(
            first,
            disturbances=(*first.disturbances, *noises),
            units={**first.units, **noises},
            **_noisy({"E": first.E, "F": first.F, "Fz": first.Fz}),
        ),
        delays=np.array([[d.delay] * len(first.measurements) for d in data]),
        static=_static(data),
        quadratic_drag=np.array([d.quadratic_drag if fixed is None else 0.0 for d in data]),
        linear_drag=drag,
        **(blocks | _noisy(blocks)),
    )


def _noisy(blocks: Mapping[str, FloatArray]) -> dict[str, Any]:
    """Return E, F and Fz, (.., rows, columns), with one input more for each measurement's noise."""
    count = blocks["F"].shape[-2]
    found = {}
    for name, added in (("E", np.zeros(())), ("F", np.eye(count)), ("Fz", np.zeros(()))):
        block = blocks[name]
        more = np.broadcast_to(added, (*block.shape[:-1], count))
        found[name] = np.concatenate([block, more], axis=-1)
    return found


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


class LoopStack:
    """Closed loops of one controller around many plants.

    Parameters
    ----------
    plants
        The plants, with the drag that is to count.
    controller
        u = +C y, the same for all.
    """

    def __init__(self, plants: PlantStack, controller: LinearController) -> None:
        self.plants = plants
        bare = plants.without_delays()
        law = LawMatrices.of(controller, plants.like)
        m = len(bare)
        eye = np.eye(bare.B.shape[2])
        inner = np.linalg.inv(eye - law.D @ bare.D)
        on_plant, on_law = inner @ law.D @ bare.C, inner @ law.C
        direct, nk = inner @ law.D @ bare.F, len(law.A)
        heard = np.concatenate([bare.C + bare.D @ on_plant, bare.D @ on_law], axis=2)
        own = np.concatenate([np.zeros((nk, bare.A.shape[1])), law.A], axis=1)
        upper = np.concatenate([bare.A + bare.B @ on_plant, bare.B @ on_law], axis=2)
        A = np.concatenate([upper, law.B @ heard + own], axis=1)
        E = [bare.E + bare.B @ direct, law.B @ (bare.F + bare.D @ direct)]
        self._E = np.concatenate(E, axis=1)
        self._F = bare.Fz + bare.Dz @ direct
        self._Cz = np.concatenate([bare.Cz + bare.Dz @ on_plant, bare.Dz @ on_law], axis=2)
        # The command that a test signal at the drive causes: S = 1/(1 + L), first loop.
        self._B = np.concatenate([bare.B @ inner, law.B @ bare.D @ inner], axis=1)[:, :, :1]
        self._Cu = np.concatenate([on_plant, on_law], axis=2)[:, :1]
        self._Du = np.broadcast_to(inner, (m, *eye.shape))[:, 0, 0]
        self.poles, self._modes = np.linalg.eig(A)
        self._inverse = np.linalg.inv(self._modes)

    @property
    def growth(self) -> FloatArray:
        """Largest real part of a pole of each loop, (m,) [1/s]."""
        return np.asarray(self.poles.real.max(axis=1), dtype=np.float64)

    @property
    def stable(self) -> BoolArray:
        """Whether each loop is stable, (m,)."""
        return np.asarray(self.growth < -1e-10 * np.abs(self.poles).max(axis=1))

    def max_sensitivity(self) -> FloatArray:
        """Return M_s of each loop, broken at the first input, (m,)."""
        # S = D + sum_k r_k / (s - p_k); its peaks stand near poles, whose widths are their damping.
        left, right = self._Cu @ self._modes, self._inverse @ self._B
        residues = left[:, 0] * right[:, :, 0]
        found = np.empty(len(self.poles))
        for part in _chunks(len(found)):
            poles, r = self.poles[part], residues[part]
            sizes = np.abs(poles)
            low = 0.1 * np.sort(sizes, axis=1)[:, :1]
            common = np.geomspace(1e-3, 1e3, 240)[None] * np.ones((len(poles), 1))
            damping = np.minimum(np.abs(poles.real), 0.3 * np.abs(poles.imag))
            near = np.abs(poles.imag)[:, :, None] + damping[:, :, None] * _NEAR
            omega = np.concatenate([common, near.reshape(len(poles), -1), low], axis=1)
            omega = np.sort(np.maximum(omega, 1e-6), axis=1)
            size = self._size(poles, r, part, omega)
            inner = np.zeros(size.shape, dtype=bool)
            inner[:, 1:-1] = (size[:, 1:-1] >= size[:, :-2]) & (size[:, 1:-1] >= size[:, 2:])
            ranked = np.argsort(np.where(inner, size, -np.inf), axis=1)[:, -_PEAKS:]
            rows = np.arange(len(poles))
            peak = size.max(axis=1)
            for chosen in ranked.T:  # the highest on the grid need not be the highest
                at, best = omega[rows, chosen], size[rows, chosen]
                right_end = omega[rows, np.minimum(chosen + 1, omega.shape[1] - 1)]
                width = np.maximum(right_end - omega[rows, np.maximum(chosen - 1, 0)], 1e-9)
                for _ in range(_ROUNDS):
                    closer = np.maximum(at[:, None] + width[:, None] * _ZOOM, 1e-6)
                    around = self._size(poles, r, part, closer)
                    k = np.argmax(around, axis=1)
                    at = np.where(around[rows, k] > best, closer[rows, k], at)
                    best = np.maximum(best, around[rows, k])
                    width = 0.4 * width
                peak = np.maximum(peak, best)
            found[part] = peak
        return found

    def _size(
        self, poles: ComplexArray, residues: ComplexArray, part: slice, omega: FloatArray
    ) -> FloatArray:
        total = self._Du[part][:, None] + np.zeros(omega.shape, dtype=np.complex128)
        for k in range(poles.shape[1]):  # a loop over modes keeps the arrays flat
            total += residues[:, k, None] / (1j * omega - poles[:, k, None])
        return np.asarray(np.abs(total), dtype=np.float64)

    def moments(
        self, outputs: Sequence[str], nodes: Quadrature, densities: Mapping[str, FloatArray]
    ) -> dict[str, tuple[FloatArray, FloatArray]]:
        """Return m_0 and m_2 of outputs, (m,) each.

        Parameters
        ----------
        outputs
            Performance outputs.
        nodes
            Common quadrature nodes [rad/s].
        densities
            By name of a disturbance: its density at the nodes in each loop, (m, k).
        """
        like, omega = self.plants.like, nodes.omega
        rows = [like.outputs.index(name) for name in outputs]
        left = self._Cz[:, rows] @ self._modes  # (m, z, n)
        zero = np.zeros((len(self.poles), len(rows)))
        second = zero.copy()
        for name, density in densities.items():
            base = like.disturbances.index(name)
            rates = [like.disturbances.index(r) for r, of in like.rates.items() if of == name]
            into = (self._inverse @ self._E[:, :, [base]])[:, :, 0]
            rate = (self._inverse @ self._E[:, :, rates]).sum(axis=2)
            through = self._F[:, rows, base]
            late = self._F[:, rows][:, :, rates].sum(axis=2)
            for part in _chunks(len(zero)):
                gap = 1.0 / (1j * omega - self.poles[part][:, :, None])  # (m, n, k)
                driven = (into[part][:, :, None] + rate[part][:, :, None] * 1j * omega) * gap
                response = left[part] @ driven + through[part][:, :, None]
                response = response + late[part][:, :, None] * 1j * omega
                spectrum = np.abs(response) ** 2 * (density[part] * nodes.weights)[:, None]
                zero[part] += spectrum.sum(axis=2)
                second[part] += spectrum @ omega**2
        return {name: (zero[:, j], second[:, j]) for j, name in enumerate(outputs)}


@dataclass(frozen=True, kw_only=True)
class StackAssessment:
    """One loop of a stack as the limits see it (`synth.limits.limits.Limit.measure`)."""

    max_sensitivity: float
    sigmas: Mapping[str, tuple[float, float]]

    def sigma(self, output: str) -> float:
        """Return the standard deviation of an output."""
        return float(np.sqrt(self.sigmas[output][0]))

    def peak(self, output: str, duration: float) -> float:
        """Return the most probable maximum of an output in `duration` [s]."""
        m0, m2 = self.sigmas[output]
        period = 2.0 * np.pi * np.sqrt(m0 / m2) if m2 > 0.0 else np.inf
        return peak_factor(float(period), duration) * self.sigma(output)


def consistent_stack(
    plants: PlantStack,
    controller: LinearController,
    nodes: Quadrature,
    densities: Mapping[str, FloatArray],
    start: float,
) -> LoopStack:
    """Return the loops with the drag that agrees with each one's own response.

    C = q sqrt(8/pi) sigma_v(C), by the secant rule on logarithms, which the right side's slow
    fall suits; where a loop is unstable it is given more drag.
    """
    loops = LoopStack(plants, controller)
    if not plants.quadratic_drag.any():
        return loops
    slope = plants.quadratic_drag * np.sqrt(8.0 / np.pi)
    x = np.full(len(plants), np.log(max(start, 1.0)))
    x_before, gap_before = np.full_like(x, np.nan), np.full_like(x, np.nan)
    open_still = np.ones(len(plants), dtype=bool)
    for _ in range(_DRAG_ROUNDS):
        at = np.flatnonzero(open_still)
        some = LoopStack(plants.part(at).with_drag(np.exp(x[at])), controller)
        own = {name: density[at] for name, density in densities.items()}
        variance = some.moments(["payload.velocity"], nodes, own)["payload.velocity"][0]
        gap = np.log(np.maximum(slope[at] * np.sqrt(variance), 1e-300)) - x[at]
        gap = np.where(some.stable, np.clip(gap, -_STEP, _STEP), _STEP)
        rise = (gap - gap_before[at]) / (x[at] - x_before[at])
        # The gap falls with a slope between -2 and -1/2 at any sound loop.
        rise = np.where(np.isfinite(rise) & some.stable, np.clip(rise, -2.0, -0.5), -1.5)
        x_before[at], gap_before[at] = x[at], gap
        x[at] -= gap / rise
        open_still[at[np.abs(gap) < _AGREE]] = False
        if not open_still.any():
            break
    C = np.exp(x)
    return LoopStack(plants.with_drag(C), controller)


def _chunks(count: int) -> list[slice]:
    return [slice(at, min(at + _CHUNK, count)) for at in range(0, count, _CHUNK)]
