"""Statistics of a run (`Statistics`), by signal and as named quantities.

Made by `Accumulator` in `models/run/statistics.py`, kept by `Run`, compared over seeds in
`models/run/metrics.py`.  A quantity has a name in words ("payload rms", "snap load"), a value in
SI and a unit, so that a table of them needs nothing else.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from ..basics import FloatArray, InputError, ReadOnlyArrays
from .online import Cycles, FirstTime, Flow, Slack, Touchdown

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
    """Statistics of one signal, in its unit u.

    Attributes
    ----------
    name, unit
        What it is called, and its unit u.
    mean, standard_deviation, minimum, maximum
        Over all samples counted [u]; the deviation has n, not n - 1, in its denominator.
    minimum_time, maximum_time
        When the extremes came first [s].
    level
        What the cycles are counted about [u]; NaN for a signal without cycles.
    cycles
        Number of whole cycles, from one up-crossing of the level to the next.
    period
        Their mean length [s]; NaN without cycles.
    crest, trough, height
        Highest crest and deepest trough (negative) of a cycle from the level, and the largest
        double amplitude within one cycle [u].
    significant
        Mean height of the highest third of the cycles [u], or four standard deviations.
    significant_source
        "cycles", or "4 sigma" if there were none or too many to keep.
    crests, troughs
        Crest and trough of every cycle from the level (cycles,) [u], in single precision; empty
        if they were too many to keep.
    """

    name: str
    unit: str
    mean: float
    standard_deviation: float
    minimum: float
    minimum_time: float
    maximum: float
    maximum_time: float
    level: float = math.nan
    cycles: int = 0
    period: float = math.nan
    crest: float = math.nan
    trough: float = math.nan
    height: float = math.nan
    significant: float = math.nan
    significant_source: str = "4 sigma"
    crests: npt.NDArray[np.float32] = field(default_factory=lambda: np.zeros(0, np.float32))
    troughs: npt.NDArray[np.float32] = field(default_factory=lambda: np.zeros(0, np.float32))

    @classmethod
    def of(
        cls,
        *,
        standard_deviation: float,
        cycles: Cycles | None,
        sample_time: float,
        **about: Any,
    ) -> SignalStatistics:
        """Return the statistics of a signal, with its cycles if they were counted.

        Name, unit, mean and extremes are as the attributes.
        """
        about |= {"standard_deviation": standard_deviation, "significant": 4.0 * standard_deviation}
        if cycles is None:
            return cls(**about)
        count, crests, troughs = cycles.count, cycles.crests, cycles.troughs
        for array in (crests, troughs):
            array.setflags(write=False)
        about |= {
            "level": cycles.level,
            "cycles": count,
            "crest": cycles.crest,
            "trough": cycles.trough,
            "height": cycles.height,
            "crests": crests,
            "troughs": troughs,
        }
        if count:
            about["period"] = (cycles.last_at - cycles.first_at) * sample_time / count
            if cycles.stored:
                heights = np.sort(crests.astype(np.float64) - troughs)
                about["significant"] = float(heights[-math.ceil(count / 3) :].mean())
                about["significant_source"] = "cycles"
        return cls(**about)

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
    """Statistics of a run from `settle` on.

    Attributes
    ----------
    sample_time
        Time between samples [s].
    settle
        Samples before this time were not counted [s].
    samples
        Number of samples counted.
    end
        Time of the run's last sample [s].
    signals
        Statistics by signal; `payload.error` is the tracking error.
    quantities
        What they say about the operation, by name: ``statistics.value("payload rms")``.
    block, blocks
        Length of a block [s], and the extremes of chosen signals in each whole block.
    """

    sample_time: float
    settle: float
    samples: int
    end: float
    signals: Mapping[str, SignalStatistics]
    quantities: Mapping[str, NamedQuantity]
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
            raise InputError(unknown("run statistics", "signal", name, self.signals))
        return self.signals[name]

    def value(self, name: str) -> float:
        """Return a quantity by its name; an `InputError` names those there are."""
        if name not in self.quantities:
            raise InputError(unknown("run statistics", "quantity", name, self.quantities))
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


def unknown(owner: str, kind: str, name: str, names: Iterable[str]) -> str:
    """Return a sentence about a name that there is not, with the closest ones that there are."""
    known = list(names)
    near = difflib.get_close_matches(str(name), known, n=3, cutoff=0.5)
    if near:
        hint = f"did you mean {' or '.join(repr(n) for n in near)}?"
    else:
        hint = f"there are {', '.join(known)}" if known else "there are none"
    return f"{owner}: no {kind} {name!r}; {hint}"


def quantities_of(
    signals: Mapping[str, SignalStatistics],
    *,
    duration: float,
    time: Callable[[float], float],
    sample_time: float,
    power: Flow | None,
    slack: Slack | None,
    lost: FirstTime | None,
    touch: Touchdown | None,
    hottest: float | None,
) -> dict[str, NamedQuantity]:
    """Return the named quantities that the signals at hand allow; `time` dates a sample."""
    found: dict[str, NamedQuantity] = {}

    def put(name: str, value: float, unit: str) -> None:
        found[name] = NamedQuantity(value=float(value), unit=unit)

    hook, payload = signals.get("hook.heave"), signals.get("payload.displacement")
    if hook:
        put("hook rms", hook.standard_deviation, "m")
    if payload:
        error = signals[ERROR]
        put("payload rms", payload.standard_deviation, "m")
        put("payload significant", payload.significant, "m")
        put("payload largest", payload.largest, "m")
        put("tracking error rms", error.rms, "m")
        put("tracking error largest", error.largest, "m")
        if hook and hook.standard_deviation > 0.0:
            ratio = error.standard_deviation / hook.standard_deviation
            put("residual", 100.0 * ratio, "%")
            put("attenuation", -20.0 * math.log10(ratio) if ratio > 0.0 else math.inf, "dB")
    if lost:
        put("lost lock at", time(lost.at), "s")
    if "rope.tension" in signals:
        put("rope tension largest", signals["rope.tension"].maximum, "N")
    if slack:
        put("rope tension smallest", signals["rope.minimum_tension"].minimum, "N")
        put("slack time", slack.slack * sample_time, "s")
        put("slack share", 100.0 * slack.slack / slack.samples if slack.samples else math.nan, "%")
        put("slack events", slack.events, "")
        put("first slack at", time(slack.first_at), "s")
        put("snap load", slack.snap, "N")
        put("snap load at", time(slack.snap_at), "s")
    if "motor.torque" in signals:
        put("motor torque rms", signals["motor.torque"].rms, "N m")
        put("motor torque largest", signals["motor.torque"].largest, "N m")
    if hottest is not None:
        put("motor torque thermal equivalent", math.sqrt(hottest), "N m")
    if "motor.speed" in signals:
        put("motor speed largest", signals["motor.speed"].largest, "rad/s")
    if "drive.saturated" in signals:
        put("saturated share", 100.0 * signals["drive.saturated"].mean, "%")
    if power:
        forth = power.forth / power.samples if power.samples else math.nan
        back = power.back / power.samples if power.samples else math.nan
        put("motor power mean", forth - back, "W")
        put("motor power largest", max(signals["motor.power"].maximum, 0.0), "W")
        put("regenerated power mean", back, "W")
        put("regenerated power largest", max(0.0 - signals["motor.power"].minimum, 0.0), "W")
        put("energy per hour, motoring", 3600.0 * forth, "J/h")
        put("energy per hour, regenerated", 3600.0 * back, "J/h")
        put("energy per hour, net", 3600.0 * (forth - back), "J/h")
    if "motor.temperature" in signals:
        put("motor temperature rise largest", signals["motor.temperature"].maximum, "K")
    if "drum.haul" in signals:
        put("drum haul lowest", signals["drum.haul"].minimum, "m")
        put("drum haul highest", signals["drum.haul"].maximum, "m")
    if touch:
        put("touch-downs", touch.count, "")
        put("touch-down at", time(touch.first_at), "s")
        put("touch-down speed", touch.speed, "m/s")
        put("hardest touch-down", touch.hardest, "m/s")
    put("time counted", duration, "s")
    return found
