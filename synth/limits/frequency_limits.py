"""Limits on a size at every frequency: sensitivity, disk margin, roll-off, weighted responses."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from typing_extensions import override

from models.basics import FloatArray, InputError, check_finite, check_range

from ..loop import joined, log, squared
from .limits import Limit, Size, Symbols

if TYPE_CHECKING:
    from ..loop import Assessment

_FOLLOWED = 1.5  # peaks above the bound over this are followed between the nodes
_FAINT = 1e-12  # of a square: its logarithm bounds the slope far from the bound


@dataclass(frozen=True, kw_only=True)
class _AtEveryFrequency(Limit):
    """A bound on a size of 1 + L, or of a closed-loop response, times a weight."""

    @abstractmethod
    def squared_size(self, value: Any) -> Any:
        """Return the square of what is to be small, of 1 + L or of the response."""

    def weights(self, omega: FloatArray) -> FloatArray:
        """Return the weight at frequencies [rad/s]; where it is zero nothing is asked for."""
        return np.ones_like(omega)

    def size(self, omega: FloatArray, value: Any) -> FloatArray:
        """Return what is to be small at frequencies [rad/s], of 1 + L or of the response."""
        return np.asarray(np.sqrt(self.squared_size(value)) * self.weights(omega))

    @property
    @override
    def followed(self) -> tuple[Size, float]:
        return self.size, (1.0 / self.bound if self.at_least else self.bound) / _FOLLOWED

    @override
    def measure(self, loop: Assessment) -> float:
        return loop.largest(self.size, self.weights, self.edges, self.channel)

    @override
    def rows(self, symbols: Symbols, bound: Any) -> Any:
        # The logarithm keeps |L| of 1e6 at low frequency from dwarfing what matters.
        level = bound if self.at_least else 1.0 / bound
        rows = []
        for omega, value in symbols.curves(self):
            weights = self.weights(omega)
            at = np.flatnonzero(weights > 0.0)
            weighted = self.squared_size(value[..., at]) * weights[at] ** 2
            rows.append(log(weighted * (level * level) + _FAINT))
        return joined(rows)


@dataclass(frozen=True, kw_only=True)
class MaxSensitivity(_AtEveryFrequency):
    """|S| = 1/|1 + L| at most `bound` at every frequency (module margin 1/bound)."""

    name: str = "max_sensitivity"

    def __post_init__(self) -> None:
        check_range("MaxSensitivity", "bound", self.bound, low=1.0, open_low=True)

    @override
    def squared_size(self, value: Any) -> Any:
        return 1.0 / squared(value)

    @override
    def measure(self, loop: Assessment) -> float:
        return loop.max_sensitivity


@dataclass(frozen=True, kw_only=True)
class DiskMargin(_AtEveryFrequency):
    """The balanced disk margin 1/max|S - 1/2| at least `bound`, between 0 and 2.

    Gain and phase may then change at once, by any complex factor (1 + d/2)/(1 - d/2) with
    |d| < bound (Seiler, Packard and Gahinet, IEEE Control Systems 40, 2020, skew 0): the gain
    alone by (2 + bound)/(2 - bound) up and down, the phase by 2 arctan(bound/2).
    """

    name: str = "disk_margin"
    at_least: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_range(
            "DiskMargin", "bound", self.bound, low=0.0, high=2.0, open_low=True, open_high=True
        )

    @override
    def squared_size(self, value: Any) -> Any:
        return squared((2.0 - value) / value) * 0.25  # S - 1/2 = (1 - L)/(2 (1 + L))

    @override
    def measure(self, loop: Assessment) -> float:
        return loop.margins.disk


@dataclass(frozen=True, kw_only=True)
class RollOff(_AtEveryFrequency):
    """|L| at most `bound` from the frequency `above` [rad/s] on."""

    above: float
    name: str = "roll_off"

    @property
    @override
    def edges(self) -> tuple[float, ...]:
        return (self.above,)

    @override
    def weights(self, omega: FloatArray) -> FloatArray:
        return np.where(omega >= self.above, 1.0, 0.0)

    @override
    def squared_size(self, value: Any) -> Any:
        return squared(value - 1.0)


@dataclass(frozen=True, kw_only=True)
class _OfOneChannel(_AtEveryFrequency):
    """A bound on the response of `output` to `disturbance`."""

    output: str
    disturbance: str

    @property
    @override
    def channel(self) -> tuple[str, str]:
        return (self.output, self.disturbance)

    @override
    def squared_size(self, value: Any) -> Any:
        return squared(value)


@dataclass(frozen=True, kw_only=True)
class LowFrequency(_OfOneChannel):
    """|output / disturbance| at most `bound` up to the frequency `below` [rad/s].

    Without it the optimum drops the displacement gain, and the load drifts with tide and swell.
    """

    below: float
    name: str = "low_frequency"

    @property
    @override
    def edges(self) -> tuple[float, ...]:
        return (self.below,)

    @override
    def weights(self, omega: FloatArray) -> FloatArray:
        return np.where(omega <= self.below, 1.0, 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class WeightedResponse(_OfOneChannel):
    """|W output / disturbance| at most `bound` at every frequency.

    Parameters
    ----------
    output, disturbance
        The ends of the channel; the disturbance need not have a spectrum.
    weight
        W: a callable of omega (k,) [rad/s], a table (omega, size) that is joined by straight lines
        on logarithmic axes and asks for nothing outside, or a continuous transfer function with
        one input and one output of SciPy or python-control.
    bound
        1 if left out.

    Raises
    ------
    InputError
        If the bound is not above 0, or the weight is none of these.
    """

    weight: Any
    bound: float = 1.0

    def __post_init__(self) -> None:
        check_range("WeightedResponse", "bound", self.bound, low=0.0, open_low=True)
        if not self.name:
            object.__setattr__(self, "name", f"{self.output}/{self.disturbance}.weighted")
        if np.any(np.asarray(getattr(self.weight, "dt", None) or 0.0)):
            raise InputError(
                "WeightedResponse: weight must be continuous in time, got a sampled one"
            )
        sizes = self.weights(np.array([0.5, 1.0, 2.0]))
        if sizes.shape != (3,):
            raise InputError(
                "WeightedResponse: weight must give one number a frequency, got an array of shape "
                f"{sizes.shape} for 3"
            )

    @property
    @override
    def edges(self) -> tuple[float, ...]:
        if self._table is not None:
            return tuple(self._table[0])
        poles = getattr(self.weight, "poles", ())
        sizes = np.abs(np.ravel(poles() if callable(poles) else poles))
        return tuple(sizes[sizes > 0.0])

    @override
    def weights(self, omega: FloatArray) -> FloatArray:
        return np.asarray(np.abs(self._response(omega)), dtype=np.float64)

    @cached_property
    def _response(self) -> Callable[[FloatArray], Any]:
        weight = self.weight
        if hasattr(weight, "frequency_response"):  # python-control
            return lambda omega: np.asarray(weight(1j * omega))
        if hasattr(weight, "freqresp"):  # SciPy
            return lambda omega: np.asarray(weight.freqresp(omega)[1])
        if self._table is None:
            return lambda omega: np.asarray(weight(omega)) * np.ones_like(omega)
        at, sizes = (np.log(column) for column in self._table)

        def between(omega: FloatArray) -> FloatArray:
            inside = np.interp(np.log(np.maximum(omega, 1e-300)), at, sizes, -np.inf, -np.inf)
            return np.asarray(np.exp(inside))

        return between

    @cached_property
    def _table(self) -> FloatArray | None:
        if callable(self.weight) or hasattr(self.weight, "freqresp"):
            return None
        found = check_finite("WeightedResponse", "weight", self.weight)
        if (
            found.ndim != 2
            or len(found) != 2
            or not (np.all(found > 0.0) and np.all(np.diff(found[0]) > 0.0))
        ):
            raise InputError(
                "WeightedResponse: weight must be a callable, a transfer function or a table "
                "(omega, size) of numbers above 0, omega rising"
            )
        return found
