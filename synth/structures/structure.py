"""Controller structures: from a handful of named parameters to a controller.

A structure says which controllers are searched.  Bound to a plant it becomes a
`ParametrisedController`, which knows its parameters (names, sizes, bounds), its response C(s, p)
(for numbers and with slopes alike) and its state-space form, and proposes candidates to start a
search from.

Signs: u = +C y.  The thesis's feedback E_a = -A (a P'' + a_1 P' + a_2 P) is
C = -A [a, a_1, a_2].
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol

import numpy as np

from models.basics import ComplexArray, FloatArray, InputError, check_range, pick
from models.plant import MEASUREMENTS, LinearPlant

from ..loop import Disturbance, LinearController, closed_loop_matrix
from .lqg import designs, projected, whitened

Bounds = Mapping[str, tuple[float, float]]

_DECADES = 3.0  # candidates' loop gains spread over this many decades, both signs
_PADE = 4  # of the delays, in the state feedback that is projected
_TOP = 3.0  # ... up to this loop gain at the candidate crossover


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One free number of a structure: name, unit, typical size and bounds, all in `unit`."""

    name: str
    scale: float
    low: float = -np.inf
    high: float = np.inf
    unit: str = ""


class GeneralisedPlant(Protocol):
    """A plant with what shakes it and what is to be small: what guesses are made from."""

    @property
    def plant(self) -> LinearPlant:
        """The plant."""

    @property
    def disturbances(self) -> Sequence[Disturbance]:
        """What shakes it."""

    @property
    def minimise(self) -> Mapping[str, float]:
        """Weights on the variances of its outputs, by name."""


class ParametrisedController(ABC):
    """A structure bound to a plant: what the optimiser sees of it."""

    parameters: tuple[Parameter, ...]
    dimensions: int  #: how many uniform numbers `draw` wants for one candidate

    @abstractmethod
    def response(self, values: Sequence[Any], s: Any) -> list[list[Any]]:
        """Return C(s), nu lists of ny entries, for parameter `values` at points `s` (k,) [1/s].

        The values are numbers, arrays that broadcast against `s`, or `synth.loop.Dual` numbers
        with slopes: write it with + - * / alone, and 0.0 where an entry is always zero.
        """

    @abstractmethod
    def controller(self, values: Sequence[float]) -> LinearController:
        """Return the controller of numerical parameter `values`."""

    def guesses(self, problem: GeneralisedPlant, omega: FloatArray) -> FloatArray:
        """Return candidates, (m, number of parameters), that the whole question suggests.

        `omega` (k,) are frequencies at which the loop may cross over [rad/s].
        """
        del problem, omega
        return np.zeros((0, len(self.parameters)))

    def others(self, problem: GeneralisedPlant, omega: FloatArray, seed: int) -> FloatArray:
        """Return candidates of another kind, which starts are taken from in turn with the rest.

        As `guesses`; for a law whose guesses may all lie about one optimum of several.
        """
        del problem, omega, seed
        return np.zeros((0, len(self.parameters)))

    @abstractmethod
    def draw(self, points: FloatArray, omega: FloatArray, yu: ComplexArray) -> FloatArray:
        """Return candidates, (m, number of parameters), from uniform `points`, (m, dimensions).

        `omega` (k,) and `yu` (k, ny, nu) are the plant's response where its dynamics are.
        """

    def closed_loop_matrix(self, plant: LinearPlant, values: Sequence[float]) -> FloatArray:
        """Return the closed loop's state matrix on `plant`, a rational model of the law's own."""
        return closed_loop_matrix(plant, self.controller(values))

    def clipped(self, values: FloatArray) -> FloatArray:
        """Return candidates, (m, number of parameters), within the bounds."""
        low = [p.low for p in self.parameters]
        high = [p.high for p in self.parameters]
        return np.asarray(np.clip(values, low, high), dtype=np.float64)

    def named(self, values: Sequence[float]) -> dict[str, float]:
        """Return the parameters by name."""
        return {p.name: float(v) for p, v in zip(self.parameters, values, strict=True)}


class Structure(ABC):
    """A family of controllers; `bind` fits it to a plant."""

    @abstractmethod
    def bind(self, plant: LinearPlant) -> ParametrisedController:
        """Return the law for `plant`.

        Raises InputError if the plant lacks a signal that the structure needs.
        """


@dataclass(frozen=True, kw_only=True)
class StaticGain(Structure):
    """Static output feedback u = K y, every entry free."""

    #: Which entries are free, (nu, ny) of true and false; all if left out.  The others are 0.
    mask: tuple[tuple[bool, ...], ...] | None = None
    #: Bounds by parameter name; the entry of input i and measurement j is ``K[i,j]`` with the
    #: signals' names, e.g. ``K[u1,y2]``.
    bounds: Bounds = field(default_factory=dict)

    def bind(self, plant: LinearPlant) -> ParametrisedController:
        """Return the law; see `Structure.bind`."""
        nu, ny = len(plant.inputs), len(plant.measurements)
        mask = np.ones((nu, ny), dtype=bool) if self.mask is None else np.array(self.mask)
        if mask.shape != (nu, ny):
            raise InputError(f"StaticGain: mask must have the shape {(nu, ny)}, got {mask.shape}")
        entries = [(int(i), int(j)) for i, j in np.argwhere(mask)]
        names = [f"K[{plant.inputs[i]},{plant.measurements[j]}]" for i, j in entries]
        return _GainLaw(plant, entries, names, np.ones(len(entries)), self.bounds)


@dataclass(frozen=True, kw_only=True)
class PayloadFeedback(Structure):
    """The thesis's feedback u = -A (a P'' + a1 P' + a2 P), 1975 thesis eq. 30."""

    name: ClassVar[str] = "payload-feedback"
    hears_payload: ClassVar[bool] = True
    #: The fixed gain A.  Only the products A a, A a1, A a2 act on the plant: with A free too, the
    #: scale would be redundant and the Hessian singular.
    amplifier: float = 1.0
    #: Names of P'', P', P among the plant's measurements.
    measurements: tuple[str, ...] = MEASUREMENTS
    #: Bounds of ``a``, ``a1``, ``a2``, in their own units (command per measurement over A).
    bounds: Bounds = field(default_factory=dict)

    def bind(self, plant: LinearPlant) -> ParametrisedController:
        """Return the law; see `Structure.bind`."""
        check_range("PayloadFeedback", "amplifier", self.amplifier, low=0.0, open_low=True)
        if len(plant.inputs) != 1:
            raise InputError(
                f"PayloadFeedback: the plant must have one input, got {len(plant.inputs)}"
            )
        columns = pick("PayloadFeedback", "measurement", plant.measurements, self.measurements)
        return _GainLaw(
            plant,
            [(0, j) for j in columns],
            ["a", "a1", "a2"],
            np.full(3, -self.amplifier),
            self.bounds,
        )


class _GainLaw(ParametrisedController):
    """Entries of a gain matrix, each a parameter times a fixed factor."""

    def __init__(
        self,
        plant: LinearPlant,
        entries: Sequence[tuple[int, int]],
        names: Sequence[str],
        factors: FloatArray,
        bounds: Bounds,
    ) -> None:
        check_bounds("structure", bounds, names)
        self._plant = plant
        self._entries = tuple(entries)
        self._factors = factors
        scales = gain_scales(plant, entries) / np.abs(factors)
        limits = [bounds.get(name, (-np.inf, np.inf)) for name in names]
        units = [gain_unit(plant, plant.inputs[i], plant.measurements[j]) for i, j in self._entries]
        self.parameters = tuple(
            Parameter(name=name, scale=float(scale), low=float(low), high=float(high), unit=unit)
            for name, scale, (low, high), unit in zip(names, scales, limits, units, strict=True)
        )
        self.dimensions = len(entries) + 1

    def response(self, values: Sequence[Any], s: Any) -> list[list[Any]]:
        del s  # a static gain is the same at every frequency
        nu, ny = len(self._plant.inputs), len(self._plant.measurements)
        gain: list[list[Any]] = [[0.0] * ny for _ in range(nu)]
        for k, (i, j) in enumerate(self._entries):
            gain[i][j] = values[k] * float(self._factors[k])
        return gain

    def controller(self, values: Sequence[float]) -> LinearController:
        gain = np.zeros((len(self._plant.inputs), len(self._plant.measurements)))
        for k, (i, j) in enumerate(self._entries):
            gain[i, j] = values[k] * self._factors[k]
        return LinearController.static(gain, self._plant.measurements, self._plant.inputs)

    def guesses(self, problem: GeneralisedPlant, omega: FloatArray) -> FloatArray:
        """Return state feedback, projected on what is measured.

        The best reproduction of u = K x in the mean square of the loop that K makes, exact
        where the measurements hold the state.
        """
        plant = whitened(self._plant.without_delays(_PADE), problem.disturbances)
        mask = np.zeros((len(plant.inputs), len(plant.measurements)), dtype=np.bool_)
        rows, columns = (list(index) for index in zip(*self._entries, strict=True))
        mask[rows, columns] = True
        gains = [projected(plant, d, mask) for d in designs(plant, problem.minimise, omega)[0]]
        found = [gain[rows, columns] / self._factors for gain in gains]
        return self.clipped(np.reshape(found, (-1, len(self._entries))))

    def draw(self, points: FloatArray, omega: FloatArray, yu: ComplexArray) -> FloatArray:
        # Every candidate picks a crossover and spreads its loop gain there over the entries:
        # the size of a gain means something only against the plant it closes the loop with.
        at = np.minimum((points[:, 0] * omega.size).astype(int), omega.size - 1)
        signed = 2.0 * points[:, 1:] - 1.0
        loop_gain = np.sign(signed) * _TOP * 10.0 ** (_DECADES * (np.abs(signed) - 1.0))
        sizes = np.stack([np.abs(yu[:, j, i]) for i, j in self._entries], axis=1)
        largest = sizes.max(axis=0)
        # Where an input does not reach a measurement there is no loop gain to go by.
        usual = 1.0 / (np.array([p.scale for p in self.parameters]) * np.abs(self._factors))
        sizes = np.where(largest > 1e-6 * usual, np.maximum(sizes, 1e-12 * largest), usual)
        drawn = loop_gain / (sizes[at] * np.abs(self._factors))
        return self.clipped(drawn)


def check_bounds(owner: str, bounds: Bounds, names: Sequence[str]) -> None:
    """Check that bounds belong to known parameters and leave them room.

    Raises InputError if a name is unknown, or a lower bound is not below the upper one.
    """
    for name, (low, high) in bounds.items():
        if name not in names:
            raise InputError(
                f"{owner}: there is no parameter {name!r} to bound; there are: {', '.join(names)}"
            )
        if not low < high:
            raise InputError(
                f"{owner}: bounds of {name} must be (low, high) with low below high, "
                f"got ({low!r}, {high!r})"
            )


def pace(plant: LinearPlant) -> float:
    """Return a frequency amid the plant's dynamics [rad/s]; 1 if it only integrates."""
    sizes = np.abs(plant.poles())
    moving = sizes[sizes > 1e-9 * max(1.0, float(sizes.max(initial=1.0)))]
    return float(np.exp(np.mean(np.log(moving)))) if moving.size else 1.0


def gain_unit(plant: LinearPlant, command: str, measurement: str) -> str:
    """Return the unit of a gain from a measurement to a command."""
    return f"({plant.units.get(command, '-')})/({plant.units.get(measurement, '-')})"


def gain_scales(plant: LinearPlant, entries: Sequence[tuple[int, int]]) -> FloatArray:
    """Return the gain of each entry (input, measurement) that makes its own loop gain one.

    At frequencies amid the plant's dynamics.  Where an input does not reach a measurement, the
    gain is that of a path which is as strong as the others of that input and measurement.
    """
    # A hair off the imaginary axis, so that an undamped pole cannot be hit.
    omega = pace(plant) * np.geomspace(0.3, 3.0, 7)
    sizes = np.abs(plant.response_at((1e-3 + 1j) * omega).yu)
    size = np.exp(np.mean(np.log(sizes + 1e-300), axis=0))
    if float(size.max(initial=0.0)) < 1e-200:
        return np.ones(len(entries))
    # log size = (measurement's) + (input's), by least squares over the paths that there are.
    ny, nu = size.shape
    there = np.argwhere(size > 1e-9 * size.max())
    rows = np.zeros((len(there), ny + nu))
    rows[np.arange(len(there)), there[:, 0]] = 1.0
    rows[np.arange(len(there)), ny + there[:, 1]] = 1.0
    parts = np.linalg.lstsq(rows, np.log(size[there[:, 0], there[:, 1]]), rcond=None)[0]
    usual = np.exp(parts[:ny, None] + parts[None, ny:])
    return np.array([1.0 / max(size[j, i], 0.03 * usual[j, i]) for i, j in entries])
