"""Statistics of a run (`Statistics`), by signal and as named quantities.

Made by `Accumulator` in `models/run/statistics.py`, kept by `Run`, compared over seeds in
`models/run/metrics.py`.  A quantity has a name in words ("payload rms", "snap load"), a value in
SI and a unit, so that a table of them needs nothing else.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from ..basics import FloatArray, InputError, ReadOnlyArrays
from ..casefile import suggestion

ERROR = "payload.error"
"""Name of the tracking error, payload.displacement less reference.displacement."""


@dataclass(frozen=True, kw_only=True)
class NamedQuantity:
    """A number with a unit; NaN says that what it measures did not happen."""

    value: float
    unit: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Blocks(ReadOnlyArrays):
    """Extremes of a signal in each whole block of a run: `maxima` and `minima` (blocks,)."""

    maxima: FloatArray
    minima: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class SignalStatistics:
    """Statistics of one signal, in its unit u."""

    name: str  #: What it is called.
    unit: str  #: Its unit u.
    mean: float  #: Over all samples counted [u].
    standard_deviation: float  #: With n, not n - 1, in its denominator [u].
    minimum: float  #: The least [u].
    minimum_time: float  #: When it came first [s].
    maximum: float  #: The largest [u].
    maximum_time: float  #: When it came first [s].
    #: What the cycles are counted about [u]; NaN for a signal without cycles.
    level: float = math.nan
    cycles: int = 0  #: Number of whole cycles, from one up-crossing of the level to the next.
    period: float = math.nan  #: Their mean length [s]; NaN without cycles.
    crest: float = math.nan  #: Highest crest of a cycle from the level [u].
    trough: float = math.nan  #: Deepest trough (negative) from the level [u].
    height: float = math.nan  #: The largest double amplitude within one cycle [u].
    #: Mean height of the highest third of the cycles [u]; four standard deviations if there were
    #: none, or too many to keep.
    significant: float = math.nan
    #: Crest of every cycle from the level (cycles,) [u], in single precision; empty if they were
    #: too many to keep.
    crests: npt.NDArray[np.float32] = field(default_factory=lambda: np.zeros(0, np.float32))
    #: The same of troughs.
    troughs: npt.NDArray[np.float32] = field(default_factory=lambda: np.zeros(0, np.float32))

    @property
    def rms(self) -> float:
        """Root mean square about zero [u]: what heats a motor, if the signal is its torque."""
        return math.hypot(self.mean, self.standard_deviation)

    @property
    def largest(self) -> float:
        """Largest size, of either sign [u]."""
        return float(np.fmax(abs(self.minimum), abs(self.maximum)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Statistics:
    """Statistics of a run from `settle` on."""

    sample_time: float  #: Time between samples [s].
    settle: float  #: Samples before this time were not counted [s].
    samples: int  #: Number of samples counted.
    end: float  #: Time of the run's last sample [s].
    #: Statistics by signal; `payload.error` is the tracking error.
    signals: Mapping[str, SignalStatistics]
    #: What they say about the operation, by name: ``statistics.value("payload rms")``.
    quantities: Mapping[str, NamedQuantity]
    #: Length of a block [s], and the extremes of chosen signals in each whole block.
    block: float
    blocks: Mapping[str, Blocks]

    def __post_init__(self) -> None:
        """Make the mappings read-only."""
        for name in ("signals", "quantities", "blocks"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    @property
    def duration(self) -> float:
        """Time counted [s]."""
        return self.samples * self.sample_time

    def __getitem__(self, name: str) -> SignalStatistics:
        """Return the statistics of a signal; an `InputError` names those there are."""
        if name not in self.signals:
            near = suggestion(name, list(self.signals))
            raise InputError(f"run statistics: no signal {name!r}; {near}")
        return self.signals[name]

    def value(self, name: str) -> float:
        """Return a quantity by its name; an `InputError` names those there are."""
        if name not in self.quantities:
            near = suggestion(name, list(self.quantities))
            raise InputError(f"run statistics: no quantity {name!r}; {near}")
        return self.quantities[name].value

    def table(self) -> tuple[tuple[str, float, str], ...]:
        """Return rows of quantity, value and unit: the named ones first, then signal by signal."""
        rows = [(name, q.value, q.unit) for name, q in self.quantities.items()]
        for name, s in self.signals.items():
            rows += [
                (f"{name} mean", s.mean, s.unit),
                (f"{name} standard deviation", s.standard_deviation, s.unit),
                (f"{name} minimum", s.minimum, s.unit),
                (f"{name} maximum", s.maximum, s.unit),
            ]
            if not math.isnan(s.level):
                rows += [
                    (f"{name} significant", s.significant, s.unit),
                    (f"{name} crest", s.crest, s.unit),
                    (f"{name} trough", s.trough, s.unit),
                    (f"{name} cycles", float(s.cycles), ""),
                    (f"{name} mean period", s.period, "s"),
                ]
        return tuple(rows)

    def __str__(self) -> str:
        """Return the quantities as a small tree."""
        lines = [f"Statistics of {self.duration:.6g} s, from {self.settle:g} s on"]
        shown = {n: q for n, q in self.quantities.items() if not math.isnan(q.value)}
        for name, q in shown.items():
            mark = "└" if name == next(reversed(shown)) else "├"
            lines.append(f"{mark} {name}: {q.value:.4g} {q.unit}".rstrip())
        return "\n".join(lines)
