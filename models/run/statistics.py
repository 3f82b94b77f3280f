"""The statistics of a run, gathered while it runs: `Accumulator` takes samples, `Statistics` tells.

    blocks of samples --> Accumulator.update ... --> Accumulator.result() --> Statistics

The simulation hands over every sample, in blocks of any length; what is kept is bounded, so a day
costs no more memory than an hour.  Inside, samples are worked off in stretches of one fixed length,
so the result is the same to the last bit however the run was cut into blocks.  Everything is
counted from `settle` on, but for touch-down, which is an event of the whole run.

A cycle runs from one up-crossing of a signal's level to the next (zero for motions, the static
value for torque and tension); its height is crest minus trough.  "Significant" is the mean height
of the highest third of the cycles (Sverdrup and Munk 1947), not four standard deviations; where
the cycles were too many to be kept it is.
"""

import copy
import math
import sys
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from ..basics import FloatArray, attenuation, check_range
from .online import BlockExtremes, Cycles, Moments, Slack, Touchdown
from .summary import ERROR, Blocks, NamedQuantity, SignalStatistics, Statistics

# Samples worked off at once: few enough to stay in the cache, many enough for numpy.
_STRETCH = 4096
_TILE = 256

# Crossed about zero unless the caller names other levels.
_MOTIONS = (
    "hook.heave",
    "hook.heave_rate",
    "payload.displacement",
    "payload.velocity",
    "payload.acceleration",
    "drum.haul",
    "motor.speed",
    ERROR,
)
_BLOCK_SIGNALS = ("hook.heave", "payload.displacement", ERROR, "motor.torque", "rope.tension")


class Accumulator:
    """Gathers the statistics of a run from consecutive blocks of all its samples.

    Parameters
    ----------
    signals
        Names of the signals, in the order of a block's columns.
    sample_time
        Time between samples [s].
    settle
        Samples before this time are not counted [s].
    units
        Units by signal, where known.
    levels
        Level whose up-crossings make the cycles, by signal: the static value of torque and
        tension.  Motions are crossed about zero unless named here; other signals have no cycles
        unless named here.  `payload.error` is payload.displacement less reference.displacement.
    lock_limit
        Beyond this size of `payload.error` lock is lost [m]; None: not watched.
    slack_tension
        At or below this smallest tension along the rope it counts as slack [N].
    snap_window
        A snap is the largest tension so long after slack [s].
    block
        Length of the blocks whose extremes are kept [s].
    block_signals
        Signals whose block extremes are kept.
    thermal_time
        Time constant of the motor's heating [s], ten samples or more, for the thermally
        equivalent torque: the steady one that would heat the motor as far as it got, warm from
        its static torque.  None: not wanted.
    cooled_speed
        Motor speed above which that torque falls as 1/speed [rad/s].
    cycle_capacity
        Largest number of cycles kept of a signal.

    Raises
    ------
    InputError
        If `lock_limit` or `thermal_time` is out of its range.

    Examples
    --------
    >>> gather = Accumulator(["payload.displacement"], 0.1)
    >>> time = 0.1 * np.arange(6001)
    >>> gather.update(np.sin(0.8 * time)[:, np.newaxis])
    >>> found = gather.result()
    >>> payload = found["payload.displacement"]
    >>> payload.cycles, round(payload.period * 0.8 / math.pi, 4), round(payload.significant, 2)
    (75, 2.0, 2.0)
    >>> round(found.value("payload rms"), 3)
    0.707
    """

    def __init__(
        self,
        signals: Sequence[str],
        sample_time: float,
        *,
        settle: float = 0.0,
        units: Mapping[str, str] | None = None,
        levels: Mapping[str, float] | None = None,
        lock_limit: float | None = None,
        slack_tension: float = 1.0,
        snap_window: float = 1.0,
        block: float = 1200.0,
        block_signals: Sequence[str] | None = None,
        thermal_time: float | None = None,
        cooled_speed: float = math.inf,
        cycle_capacity: int = 100_000,
    ) -> None:
        owner = "run statistics"
        self.signals = tuple(signals)
        self.sample_time, self.settle = sample_time, settle
        if lock_limit is not None:
            check_range(owner, "lock_limit", lock_limit, low=0.0, unit="m", open_low=True)
        if thermal_time is not None:
            check_range(owner, "thermal_time", thermal_time, low=10.0 * sample_time, unit="s")
        self._has_error = "payload.displacement" in self.signals
        self.names = (*self.signals, ERROR) if self._has_error else self.signals
        self._at = {name: i for i, name in enumerate(self.names)}
        self.units = {name: (units or {}).get(name, "") for name in self.signals}
        if self._has_error:
            self.units[ERROR] = self.units["payload.displacement"]
        crossed = {name: 0.0 for name in _MOTIONS if name in self._at} | dict(levels or {})
        kept = block_signals if block_signals is not None else _present(_BLOCK_SIGNALS, self.names)
        static_torque = crossed.get("motor.torque", 0.0)
        self._first = 0  # number of the first sample not yet worked off
        self._settled = math.ceil(settle / sample_time - 1e-6)  # number of the first that counts
        self._waiting = np.empty((len(self.names), _STRETCH))
        self._filled = 0
        self._moments = Moments(len(self.names))
        self._cycles = {name: Cycles(level, cycle_capacity) for name, level in crossed.items()}
        self._blocks = BlockExtremes(len(kept), round(block / self.sample_time))
        self._block_rows = np.array([self._at[name] for name in kept], dtype=np.intp)
        self._block_names = tuple(kept)
        self._power = np.zeros(2)  # sum of what flows out of the motor, and of what flows back
        self._slack = (
            Slack(slack_tension, round(snap_window / self.sample_time))
            if "rope.minimum_tension" in self._at
            else None
        )
        self._lock_limit = lock_limit if self._has_error else None
        self._lost_at = -1
        self._touch = Touchdown() if {"contact.gap", "contact.force"} & set(self._at) else None
        self._thermal_time = thermal_time if "motor.torque" in self._at else None
        self._cooled_speed = cooled_speed
        self._heat = self._hottest = static_torque**2

    def update(self, block: npt.ArrayLike) -> None:
        """Take the next samples (n, signals), each a row; the first of all is at time zero."""
        rows = np.asarray(block, dtype=np.float64)
        taken = 0
        while taken < len(rows):
            # A tile at a time: rows into columns goes fastest where both fit into the cache.
            count = min(_TILE, _STRETCH - self._filled, len(rows) - taken)
            into = self._waiting[: len(self.signals), self._filled : self._filled + count]
            into[...] = rows[taken : taken + count].T
            self._filled += count
            taken += count
            if self._filled == _STRETCH:
                self._work_off()

    def result(self) -> Statistics:
        """Return the statistics of all samples so far; more may follow."""
        end = copy.deepcopy(self)
        end._work_off()
        for cycles in end._cycles.values():
            cycles.finish()
        with np.errstate(invalid="ignore", over="ignore"):
            return end._statistics()

    def _work_off(self) -> None:
        """Hand the waiting samples to every part."""
        values = self._waiting[:, : self._filled]
        if self._filled == 0:
            return
        if self._has_error:
            reference = self._at.get("reference.displacement")
            asked = 0.0 if reference is None else values[reference]
            values[-1] = values[self._at["payload.displacement"]] - asked
        # A run that diverges goes through inf on its way; that is told, not warned about.
        with np.errstate(invalid="ignore", over="ignore"):
            self._touchdowns(values)
            skipped = min(max(self._settled - self._first, 0), self._filled)
            if skipped < self._filled:
                self._count(values[:, skipped:], self._first + skipped)
        self._first += self._filled
        self._filled = 0

    def _count(self, values: FloatArray, first: int) -> None:
        self._moments.add(values, first)
        for name, cycles in self._cycles.items():
            cycles.add(values[self._at[name]], first)
        if self._block_names:
            self._blocks.add(values[self._block_rows])
        if "motor.power" in self._at:
            power = values[self._at["motor.power"]]
            self._power += np.maximum([power, -power], 0.0).sum(axis=1)
        if self._lock_limit is not None and self._lost_at < 0:
            beyond = ~(np.abs(values[self._at[ERROR]]) <= self._lock_limit)  # a NaN is beyond any
            if beyond.any():
                self._lost_at = first + int(beyond.argmax())
        if self._slack:
            smallest = values[self._at["rope.minimum_tension"]]
            ends = _present(("rope.tension", "rope.lower_tension"), self.names)
            tension = values[[self._at[name] for name in ends]].max(axis=0) if ends else smallest
            self._slack.add(smallest, tension, first)
        if self._thermal_time is not None:
            torque = values[self._at["motor.torque"]]
            if self._cooled_speed < math.inf and "motor.speed" in self._at:
                fast = np.abs(values[self._at["motor.speed"]]) / self._cooled_speed
                torque = torque * np.maximum(1.0, fast)
            self._heat_up(torque, self._thermal_time)

    def _heat_up(self, torque: FloatArray, thermal_time: float) -> None:
        """Take the square of the torque through a first-order lag, as the winding's heat goes."""
        # heat[k] = stay heat[k-1] + (1 - stay) u[k], summed up: all terms are positive, and the
        # powers stay in range because the time constant is at least ten samples.
        rate = self.sample_time / thermal_time
        powers = np.exp(-rate * np.arange(1.0, torque.size + 1.0))
        inflow = -math.expm1(-rate) * np.cumsum(torque**2 / powers)
        heat = powers * (self._heat + inflow)
        self._heat = float(heat[-1])
        self._hottest = max(self._hottest, float(heat.max()))

    def _touchdowns(self, values: FloatArray) -> None:
        """Contact is a gap that has closed, or a force; what is touched may rise to meet it."""
        if self._touch is None:
            return
        if "contact.gap" in self._at:
            touching = values[self._at["contact.gap"]] <= 0.0
        else:
            touching = values[self._at["contact.force"]] > 0.0
        if "contact.closing_speed" in self._at:
            approach = values[self._at["contact.closing_speed"]]
        elif "payload.velocity" in self._at:
            approach = -values[self._at["payload.velocity"]]
        else:
            approach = np.full(values.shape[1], math.nan)
        self._touch.add(touching, approach, self._first)

    def _time(self, number: float) -> float:
        """Time of sample `number` [s]; NaN for a sample that never came."""
        return number * self.sample_time if number >= 0 else math.nan

    def _statistics(self) -> Statistics:
        moments, found = self._moments, {}
        for i, name in enumerate(self.names):
            deviation = float(moments.deviation[i])
            cycles = self._cycles.get(name)
            about = {
                "mean": float(moments.mean[i]) if moments.samples else math.nan,
                "standard_deviation": deviation,
                "minimum": float(moments.low[i]) if moments.samples else math.nan,
                "minimum_time": self._time(float(moments.low_at[i])),
                "maximum": float(moments.high[i]) if moments.samples else math.nan,
                "maximum_time": self._time(float(moments.high_at[i])),
                "significant": 4.0 * deviation,
                **(cycles.figures(self.sample_time) if cycles else {}),
            }
            found[name] = SignalStatistics(name=name, unit=self.units[name], **about)
        blocks = self._blocks.found()
        return Statistics(
            sample_time=self.sample_time,
            settle=self.settle,
            samples=moments.samples,
            end=self._time(self._first - 1),
            signals=found,
            quantities=self._quantities(found),
            block=self._blocks.length * self.sample_time,
            blocks={
                name: Blocks(maxima=blocks[:, 0, i], minima=blocks[:, 1, i])
                for i, name in enumerate(self._block_names)
            },
        )

    def _quantities(self, signals: Mapping[str, SignalStatistics]) -> dict[str, NamedQuantity]:
        """Return the named quantities that the signals at hand allow."""
        found, samples = dict[str, NamedQuantity](), self._moments.samples

        def put(name: str, value: float, unit: str) -> None:
            # A drive that is off decays down to the least number there is, and is at nought.
            nought = abs(value) < sys.float_info.min
            found[name] = NamedQuantity(value=0.0 if nought else float(value), unit=unit)

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
                put("attenuation", attenuation(ratio), "dB")
        if self._lock_limit is not None:
            put("lost lock at", self._time(self._lost_at), "s")
        if "rope.tension" in signals:
            put("rope tension largest", signals["rope.tension"].maximum, "N")
        if (slack := self._slack) is not None:
            put("rope tension smallest", signals["rope.minimum_tension"].minimum, "N")
            put("slack time", slack.slack * self.sample_time, "s")
            put("slack share", 100.0 * slack.slack / samples if samples else math.nan, "%")
            put("slack events", slack.events, "")
            put("first slack at", self._time(slack.first_at), "s")
            put("snap load", slack.snap, "N")
            put("snap load at", self._time(slack.snap_at), "s")
        if "motor.torque" in signals:
            put("motor torque rms", signals["motor.torque"].rms, "N m")
            put("motor torque largest", signals["motor.torque"].largest, "N m")
        if self._thermal_time is not None:
            put("motor torque thermal equivalent", math.sqrt(self._hottest), "N m")
        if "motor.speed" in signals:
            put("motor speed largest", signals["motor.speed"].largest, "rad/s")
        if "drive.saturated" in signals:
            put("saturated share", 100.0 * signals["drive.saturated"].mean, "%")
        if "motor.power" in signals:
            forth, back = self._power / samples if samples else (math.nan, math.nan)
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
        if (touch := self._touch) is not None:
            put("touch-downs", touch.count, "")
            put("touch-down at", self._time(touch.first_at), "s")
            put("touch-down speed", touch.speed, "m/s")
            put("hardest touch-down", touch.hardest, "m/s")
        put("time counted", samples * self.sample_time, "s")
        return found


def _present(wanted: Sequence[str], names: Sequence[str]) -> tuple[str, ...]:
    return tuple(name for name in wanted if name in names)
