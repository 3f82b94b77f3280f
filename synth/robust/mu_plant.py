r"""M-Delta form of a case's linear plant: its uncertain numbers, pulled out.

    case, shares -> plants at the corners of the ranges -> LFT, delta_k real and repeated
                 -> + a disc for every uncertain delay -> UncertainPlant -> M(i omega)

A physical parameter enters the plant's matrices as a ratio of two linear functions: a stiffness
as k (1 + r delta), a mass as 1/(m (1 + r delta)).  With eta = delta/(1 + c delta), c fitted, they
are linear in each eta, so the 2^p corners say all about them; each eta is then pulled out over
the column space of what it multiplies (Cockburn and Morton, "Linear fractional representations
of uncertain systems", Automatica 33, 1997).  For masses, stiffnesses, inertias, drag and radii
that is exact; what it misses is measured against the plants themselves, and told.

A delay that is longer or shorter by up to d is exp(-i omega tau) times 1 + W Delta with W = omega
d and |Delta| <= 1, as |exp(-i omega k d) - 1| <= k omega d for every k: a disc of complex
numbers, in which the true delays are a curve.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.linalg

from models.basics import ComplexArray, FloatArray, InputError, check_range, parse_quantity
from models.case import Case
from models.plant import LinearPlant, PlantData
from models.sensing import sensed_plant
from models.spread import field_of, with_payload

from ..loop import LinearController
from ..verify import LawMatrices
from .mu_structured_value import UncertaintyBlock

#: Paths of delays, and the measurements that they make late.
DELAYS: Mapping[str, str] = {"sensors.telemetry.delay": "payload.", "sensors.mru.delay": "mru."}
DRAG = "drag"
_MOST = 6  # real parameters at once: 64 corners
_RANK = 1e-9  # singular values below this share of the largest do not count
_SAMPLES = 4  # plants that the LFT is compared with


@dataclass(frozen=True, kw_only=True)
class UncertainNumber:
    """One uncertain number: its path, its value in the case, how far it may be off.

    ``drag`` is the linear drag coefficient of the design [N s/m]; the others are fields of the
    case.
    """

    path: str
    nominal: float
    half: float

    def at(self, delta: float) -> float:
        """Return the value at delta; 1 is the upper end of the range, -1 the lower one."""
        return self.nominal + self.half * delta

    @property
    def delay(self) -> bool:
        """Whether it is a delay, and so a disc."""
        return self.path in DELAYS

    @property
    def least(self) -> float:
        """The least delta: a delay of nothing can only grow."""
        return 0.0 if self.delay and self.nominal == 0.0 else -1.0

    @property
    def furthest(self) -> float:
        """The delta of either sign at which the value would be zero."""
        return self.nominal / self.half if self.nominal > 0.0 else np.inf


def uncertain_numbers(
    case: Case, drag: float, uncertainty: Mapping[str, Any]
) -> tuple[UncertainNumber, ...]:
    """Return what is uncertain about a case.

    Parameters
    ----------
    case
        The case.
    drag
        Linear drag coefficient of the design [N s/m].
    uncertainty
        By path (or an alias of `synth.robust.family`, or ``drag``): a share of the value, as 0.3
        for 30 % either way, or a text with a unit, as "20 ms" either way.

    Raises
    ------
    InputError
        If there is nothing, a path is unknown or no number, or a share is out of its range.
    """
    if not uncertainty:
        raise InputError("robustness: uncertainty must name what may be off, got nothing")
    found = []
    for name, width in uncertainty.items():
        if not isinstance(width, str):
            check_range("robustness", f"uncertainty[{name}]", width, low=0.0, open_low=True)
        try:
            field = field_of(case, name, {}, drag)
            path, own = field.path, field.nominal
            half = parse_quantity(width, field.kind) if isinstance(width, str) else width * own
        except InputError as error:
            raise InputError(f"robustness: {name}: {error}") from None
        if half <= 0.0:
            raise InputError(
                f"robustness: {path} is {own:g} in this case, so a share of it is nothing; give "
                'a value with its unit, as "20 ms"'
            )
        if half >= own and path != DRAG and path not in DELAYS:
            raise InputError(
                f"robustness: {path} must be less uncertain than its value {own:g}, got {half:g}"
            )
        found.append(UncertainNumber(path=path, nominal=own, half=half))
    if len({d.path for d in found}) < len(found):
        raise InputError("robustness: a path is given twice")
    if sum(not d.delay for d in found) > _MOST:
        raise InputError(f"robustness: at most {_MOST} parameters besides delays at once")
    return tuple(found)


def plant_of(
    case: Case, doubts: Sequence[UncertainNumber], delta: Sequence[float], masses: int, drag: float
) -> LinearPlant:
    """Return the true plant at some deltas; the rope's damping time stays the nominal one."""
    values = {d.path: d.at(float(x)) for d, x in zip(doubts, delta, strict=True)}
    drag = values.pop(DRAG, drag)
    changed = case.variant(with_payload(case, values))
    data, nominal = PlantData.from_case(changed), PlantData.from_case(case)
    if data.damping_time > 0.0:
        ratio = data.damping_ratio * nominal.damping_time / data.damping_time
        data = replace(data, damping_ratio=min(ratio, 1.0))
    return sensed_plant(data, masses=masses, drag=drag, sensors=changed.sensors)


@dataclass(frozen=True, kw_only=True, eq=False)
class UncertainLoop:
    """A controller around an uncertain plant.

    Attributes
    ----------
    case, masses, drag
        The nominal plant.
    controller
        u = +C y.
    doubts
        What is uncertain: parameters first, delays last.
    plant
        Nominal plant; its disturbances and outputs are the channels of the parameters.
    sizes
        How many channels each parameter has.
    error
        Largest distance of the loop gain from that of the true plants over |1 + L|, at a few
        random points of the ranges.
    """

    case: Case
    masses: int
    drag: float
    controller: LinearController
    doubts: tuple[UncertainNumber, ...]
    plant: LinearPlant
    sizes: tuple[int, ...]
    error: float = 0.0

    @cached_property
    def blocks(self) -> tuple[UncertaintyBlock, ...]:
        """The blocks of Delta."""
        late = len(self.doubts) - len(self.sizes)
        return (
            *(UncertaintyBlock(size=n) for n in self.sizes),
            *(UncertaintyBlock(real=False) for _ in range(late)),
        )

    @cached_property
    def law(self) -> LawMatrices:
        """The controller on the plant's measurements."""
        return LawMatrices.of(self.controller, self.plant)

    def spread(self, delta: npt.ArrayLike) -> FloatArray:
        """Return the diagonal of Delta, without the delays, for the parameters' deltas."""
        return np.repeat(np.asarray(delta, dtype=np.float64)[: len(self.sizes)], self.sizes)

    def matrix(self, omega: FloatArray) -> ComplexArray:
        """Return M at frequencies [rad/s], (k, m, m): what Delta sees of the closed loop."""
        s = np.asarray(1j * omega, dtype=np.complex128)
        blocks, C = self.plant.response_at(s), self.law(s)
        late = [d for d in self.doubts if d.delay]
        # Delta of a delay adds to the command what the late signals make of it.
        picks = np.array([self._hears(d) for d in late]).reshape(len(late), C.shape[2])
        part = C * picks[None]  # (k, late, ny) for the one input
        weight = np.array([d.half for d in late])[None, :, None] * omega[:, None, None]
        inner = 1.0 / (1.0 - C @ blocks.yu)
        ones = np.ones((1, 1, len(late)))
        into_u = np.concatenate([inner * (C @ blocks.yw), inner * ones], axis=2)
        zero = np.zeros((len(s), blocks.zw.shape[1], len(late)))
        into_z = np.concatenate([blocks.zw, zero], axis=2) + blocks.zu @ into_u
        zero = np.zeros((len(s), blocks.yw.shape[1], len(late)))
        into_y = np.concatenate([blocks.yw, zero], axis=2) + blocks.yu @ into_u
        return np.concatenate([into_z, weight * (part @ into_y)], axis=1)

    def determinant(self, omega: FloatArray, delta: npt.ArrayLike) -> ComplexArray:
        """Return det(I - M Delta), (k,), the delays in it as they are: zero at a pole."""
        x = np.asarray(delta, dtype=np.float64)
        count = len(self.sizes)
        width = np.array([d.half for d in self.doubts if d.delay])
        angle = omega[:, None] * width
        turned = np.expm1(-1j * angle * x[count:]) / np.where(angle > 0.0, angle, 1.0)
        spread = np.broadcast_to(self.spread(x), (len(omega), sum(self.sizes)))
        diagonal = np.concatenate([spread, turned], axis=1)
        whole = np.eye(diagonal.shape[1]) - self.matrix(omega) * diagonal[:, None, :]
        return np.asarray(np.linalg.det(whole), dtype=np.complex128)

    def difference(self, omega: FloatArray, delta: FloatArray) -> ComplexArray:
        """Return 1 + L of the perturbed loop, (k,), its delays changed as they are."""
        s = np.asarray(1j * omega, dtype=np.complex128)
        blocks, C = self.plant.response_at(s), self.law(s)
        spread = self.spread(delta)
        yu = blocks.yu
        if spread.size:
            inner = np.eye(spread.size) - blocks.zw * spread[None, None, :]
            yu = yu + (blocks.yw * spread[None, None, :]) @ np.linalg.solve(inner, blocks.zu)
        turned = C[:, 0] * np.exp(-s[:, None] * self._later(delta))
        return np.asarray(1.0 - np.einsum("ky,ky->k", turned, yu[:, :, 0]))

    def plant_at(self, delta: Sequence[float]) -> LinearPlant:
        """Return the true plant at some deltas, built anew from the case, delays exact.

        Raises
        ------
        InputError
            If a value is out of the range that the plant takes.
        """
        found = plant_of(self.case, self.doubts, delta, self.masses, self.drag)
        return found.select(measurements=self.controller.measurements, outputs=())

    def quick(self, delta: Sequence[float]) -> LinearPlant:
        """Return the plant at some deltas from the M-Delta form, delays exact."""
        plant, spread = self.plant, self.spread(delta)
        closed = spread[:, None] * np.linalg.inv(np.eye(spread.size) - plant.Fz * spread)
        late = np.array(plant.delays) + self._later(delta)
        return LinearPlant(
            A=plant.A + plant.E @ closed @ plant.Cz,
            B=plant.B + plant.E @ closed @ plant.Dz,
            E=np.zeros((len(plant.A), 0)),
            C=plant.C + plant.F @ closed @ plant.Cz,
            D=plant.D + plant.F @ closed @ plant.Dz,
            inputs=plant.inputs,
            measurements=plant.measurements,
            delays=tuple(float(v) for v in np.maximum(late, 0.0)),
        )

    def _later(self, delta: npt.ArrayLike) -> FloatArray:
        """Return by how much later each measurement comes, (ny,) [s]."""
        late = np.zeros(len(self.plant.measurements))
        for doubt, d in zip(self.doubts, np.asarray(delta, dtype=np.float64), strict=True):
            if doubt.delay:
                late += doubt.half * d * self._hears(doubt)
        return late

    def _hears(self, doubt: UncertainNumber) -> FloatArray:
        start = DELAYS[doubt.path]
        return np.array([float(name.startswith(start)) for name in self.plant.measurements])


def uncertain_loop(
    case: Case,
    controller: LinearController,
    doubts: Sequence[UncertainNumber],
    *,
    masses: int,
    drag: float,
    seed: int = 0,
) -> UncertainLoop:
    """Return the M-Delta form of a controller around a case's uncertain plant.

    The time constant of the rope's damping stays that of the nominal rope.

    Raises
    ------
    InputError
        If the controller has several inputs, does not hear what an uncertain delay makes late, or
        a parameter's range is not valid.
    """
    if len(controller.inputs) != 1:
        raise InputError("robustness: the controller must have one input")
    real = [d for d in doubts if not d.delay]
    ordered = (*real, *(d for d in doubts if d.delay))
    for doubt in ordered[len(real) :]:
        if not any(name.startswith(DELAYS[doubt.path]) for name in controller.measurements):
            raise InputError(f"robustness: {doubt.path} delays nothing that the design hears")

    def plant_at(delta: Sequence[float]) -> LinearPlant:
        full = plant_of(case, real, delta, masses, drag)
        return full.select(measurements=controller.measurements, outputs=())

    count = len(real)
    corners = {
        chosen: plant_at([float(k in chosen) for k in range(count)])
        for n in range(count + 1)
        for chosen in itertools.combinations(range(count), n)
    }
    nominal = corners[()]
    scale = _scale(nominal)
    rates = []
    for k in range(count):
        up = _stacked(corners[(k,)]) - _stacked(nominal)
        other = plant_at([-float(j == k) for j in range(count)])
        rates.append(_rate(up, _stacked(other) - _stacked(nominal), scale))
    parts = _multilinear({c: _stacked(p) for c, p in corners.items()}, rates)
    plant, sizes = _pulled_out(nominal, parts, rates, scale)
    loop = UncertainLoop(
        case=case,
        masses=masses,
        drag=drag,
        controller=controller,
        doubts=ordered,
        plant=plant,
        sizes=sizes,
    )
    return replace(loop, error=_error(loop, seed))


def _stacked(plant: LinearPlant) -> FloatArray:
    """Return [A B; C D], (n + ny, n + nu)."""
    return np.block([[plant.A, plant.B], [plant.C, plant.D]])


def _scale(plant: LinearPlant) -> tuple[FloatArray, FloatArray]:
    """Return sizes of rows and columns of [A B; C D], for comparing its entries."""
    _, (states, _) = scipy.linalg.matrix_balance(plant.A, permute=False, separate=True)
    inputs = np.abs(plant.B / states[:, None]).max(axis=0, initial=1e-300)
    heard = np.abs(plant.C * states).max(axis=1, initial=1e-300)
    return np.concatenate([states, heard]), np.concatenate([1.0 / states, inputs])


def _rate(up: FloatArray, down: FloatArray, scale: tuple[FloatArray, FloatArray]) -> float:
    """Return the c of eta = delta/(1 + c delta) from the changes at delta = 1 and -1.

    a/(1 + c) and -a/(1 - c): minus their ratio is (1 - c)/(1 + c).
    """
    weigh = 1.0 / np.outer(*scale)
    up, down = up * weigh, down * weigh
    size = float(np.sum(down**2))
    if size == 0.0:
        return 0.0
    ratio = -float(np.sum(up * down)) / size
    return (1.0 - ratio) / (1.0 + ratio) if ratio > 0.0 else 0.0


def _multilinear(
    corners: Mapping[tuple[int, ...], FloatArray], rates: Sequence[float]
) -> dict[tuple[int, ...], FloatArray]:
    """Return the coefficients of products of etas from the matrices at the corners."""
    found = {}
    for chosen in corners:
        total = np.zeros_like(corners[()])
        for n in range(len(chosen) + 1):
            for part in itertools.combinations(chosen, n):
                total += (-1.0) ** (len(chosen) - n) * corners[part]
        # eta = 1/(1 + c) at delta = 1.
        found[chosen] = total * np.prod([1.0 + rates[k] for k in chosen])
    return found


def _pulled_out(
    nominal: LinearPlant,
    parts: Mapping[tuple[int, ...], FloatArray],
    rates: Sequence[float],
    scale: tuple[FloatArray, FloatArray],
) -> tuple[LinearPlant, tuple[int, ...]]:
    """Return the plant with a channel for everything that an eta multiplies, and their counts.

    One eta after the other: what it multiplies is U Q, with Q linear in the later etas; the
    rows of Q join the matrix, and w = eta z with z = Q (x, u) comes back through U.
    """
    rows, columns = scale
    matrices = dict(parts)
    entries: list[FloatArray] = []
    height = len(rows)
    for k in range(len(rates)):
        inside = {c: m for c, m in matrices.items() if k in c}
        wide = np.hstack([m / rows[:, None] / columns for m in inside.values()])
        left, sizes, _ = np.linalg.svd(wide, full_matrices=False)
        rank = int(np.sum(sizes > _RANK * max(float(sizes[0]), _RANK)))
        U = left[:, :rank]
        more = {tuple(j for j in c if j != k): (U.T / rows) @ m for c, m in inside.items()}
        outside = {c: m for c, m in matrices.items() if k not in c}
        matrices = {
            c: np.vstack([m, more.get(c, np.zeros((rank, m.shape[1])))]) for c, m in outside.items()
        }
        entries.append(rows[:, None] * U)
        rows = np.concatenate([rows, np.ones(rank)])
    whole = matrices[()]
    counts = tuple(U.shape[1] for U in entries)
    total = sum(counts)
    into = np.zeros((len(whole), total))
    at = 0
    for U, rate in zip(entries, rates, strict=True):
        width = U.shape[1]
        into[: len(U), at : at + width] = U
        # w = eta z is w = delta (z - c w).
        own = height + at + np.arange(width)
        into[own, at + np.arange(width)] -= rate
        at += width
    n, ny = len(nominal.states), len(nominal.measurements)
    names = tuple(f"doubt.{k}" for k in range(total))
    plant = LinearPlant(
        A=nominal.A,
        B=nominal.B,
        E=into[:n],
        C=nominal.C,
        D=nominal.D,
        F=into[n : n + ny],
        Cz=whole[height:, :n],
        Dz=whole[height:, n:],
        Fz=into[height:],
        states=nominal.states,
        inputs=nominal.inputs,
        disturbances=names,
        measurements=nominal.measurements,
        outputs=tuple(f"seen.{k}" for k in range(total)),
        delays=nominal.delays,
    )
    return plant, counts


def _error(loop: UncertainLoop, seed: int) -> float:
    """Return the largest distance from the true loops at random points of the ranges."""
    rng = np.random.default_rng(seed)
    marks = np.abs(loop.plant.poles())
    marks = marks[marks > 1e-6]
    omega = np.geomspace(0.1 * marks.min(initial=1.0), min(10.0 * marks.max(initial=1.0), 1e3), 200)
    worst = 0.0
    for _ in range(_SAMPLES):
        delta = [float(rng.uniform(d.least, 1.0)) for d in loop.doubts]
        law = loop.law(np.asarray(1j * omega))
        heard = loop.plant_at(delta).response(omega).yu
        true = 1.0 - np.einsum("kuy,kyv->kuv", law, heard)[:, 0, 0]
        ours = loop.difference(omega, np.array(delta))
        worst = max(worst, float(np.max(np.abs(ours - true) / np.abs(true))))
    return worst
