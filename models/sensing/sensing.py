"""Sensors and telemetry as a recursion in CasADi symbols: the plant as a controller sees it.

    plant --> payload sensors --> telemetry: a register of messages --> held values --+
          --> encoder, load cell, the drive's own torque -----------------------------+--> m
    hook --> motion reference unit (computed before the run, a row of numbers) -------+

All that depends on the plant is here, so that it becomes part of the compiled loop; all that does
not (noise, which message arrives, the reference unit) is drawn before the run and comes in as a
row: `models.sensing.telemetry`, `models.sensing.mru`.  The low-pass filters of the payload's
sensors and of the link are states of the plant itself, as in the design.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np
import numpy.typing as npt
from scipy.linalg import solve_continuous_lyapunov

from ..basics import FloatArray, check_seed
from ..case import Case
from ..plant import ShapingFilter, late_hold, noisy_hold, weighed_tension
from ..rig import Encoder, LoadCell, PayloadSensor
from .control import HEARD
from .draws import SENSOR_NOISE, draw
from .mru import MruBlock
from .plant import payload_noise
from .telemetry import Late, TelemetryBlock, TelemetrySchedule

#: What the sensors take from the plant, by name; the payload's signals behind its filters.
RAW = (
    "measured.acceleration",
    "measured.velocity",
    "measured.displacement",
    "motor.angle",
    "drum.haul",
    "motor.speed",
    "motor.torque",
    "rope.tension",
)
#: Columns of the table of standard normal numbers that a run needs.
NOISE = ("noise.acceleration", "noise.velocity", "noise.displacement", "noise.tension")
_SENT = ("acceleration", "velocity", "displacement")
_MRU = ("mru.heave", "mru.heave_rate", "mru.valid", "mru.age")
_REFERENCE = ("reference.displacement", "reference.velocity", "reference.acceleration")
_SWITCHES = ("operator.enable", "operator.reset", "encoder.valid", "load_cell.valid")
_ROUNDS = 100  # of Riccati's recursion, whose error falls at least to a third in each
_ROUNDING = 1e-9  # of a sample and of a reading: as many of one make the other, whatever is rounded
_SPEED_WINDOW = 0.01  # time over which a drive counts pulses for the speed [s]


@dataclass(frozen=True, kw_only=True, eq=False)
class SensorModel:
    """Sensors and telemetry of a case at one sample time.

    Notes
    -----
    Payload: the signal of a latency before is interpolated between samples; bias and noise are
    added, the sum is rounded to the resolution and sent, or held and sent again until the next
    reading.  White noise of one-sided density N per root hertz, sampled every Ts, has the standard
    deviation N/sqrt(2 Ts), where Ts is the time between readings if there are such; noise that
    has passed low-passes is sampled exactly (`_innovations`) and not interpolated.  The newest
    `lags.stop` messages are remembered; where something fresh has arrived their weighted mean is
    what is known, else the last value is held.  A message of weight zero is not touched, so that a
    broken sensor's NaN stays where it is.

    Encoder: the angle is rounded to counts, and the haul is off by as much.  The drive counts
    over 10 ms for the speed, whatever the controller's sample time: the speed is rounded to one
    count per 10 ms.  (Differences of the rounded angle would be rougher the shorter the sample.)

    Load cell: first-order low-pass, exact for a tension that is linear between samples, and
    independent noise at every sample.  Encoder and load cell that give no numbers show 0.
    """

    sample_time: float  #: Time between control samples [s].
    payload: PayloadSensor  #: Motion sensors at the payload.
    #: What the noise of payload signals passes, by the signal's name; white noise has none.
    filters: Mapping[str, ShapingFilter] = field(default_factory=dict)
    #: Ages in samples that a message may have when it is used (`TelemetrySchedule.lags`).
    lags: range
    #: None for perfect ones.
    encoder: Encoder | None
    load_cell: LoadCell | None
    haul_per_angle: float  #: Haul of the drum per angle of the motor [m/rad].
    #: Rope tension at the drum at rest [N], which the load cell's noise is a fraction of.
    static_tension: float

    @classmethod
    def from_case(cls, case: Case, sample_time: float, late: Sequence[Late] = ()) -> SensorModel:
        """Return the sensors of a case at a sample time [s], behind a link that may be late."""
        sensors = case.sensors
        noises = {name: payload_noise(sensors, name) for name in _SENT}
        return cls(
            sample_time=sample_time,
            payload=sensors.payload,
            filters={k: v for k, v in noises.items() if isinstance(v, ShapingFilter)},
            # They are the same for every seed.
            lags=TelemetrySchedule(sensors.telemetry, sample_time, seed=0, late=late).lags,
            encoder=sensors.encoder,
            load_cell=sensors.load_cell,
            haul_per_angle=case.haul_radius / case.winch.gearbox.ratio,
            static_tension=case.static_tension,
        )

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states: sensors' own, messages remembered, values held, the load cell's."""
        own = (name for signal in _SENT for name in self._own_states(signal))
        messages = (f"sent.{j}.{name}" for j in range(1, self.lags.stop) for name in _SENT)
        cell = ("load_cell.tension", "load_cell.before") if self.load_cell is not None else ()
        return (*own, *messages, *(f"held.{name}" for name in _SENT), *cell)

    @property
    def row(self) -> tuple[str, ...]:
        """Names of the numbers that a sample takes from outside."""
        weights = (f"telemetry.weight.{j}" for j in self.lags)
        return (
            *NOISE,
            *weights,
            "telemetry.fresh",
            "telemetry.valid",
            "telemetry.age",
            *_MRU,
            *_REFERENCE,
            *_SWITCHES,
        )

    @staticmethod
    def raw(signals: Mapping[str, ca.SX]) -> ca.SX:
        """Return the vector of `RAW` from the plant's signals by name."""
        cell = {"rope.tension": signals[weighed_tension(signals)]}
        return ca.vertcat(*({**signals, **cell}[name] for name in RAW))

    @cached_property
    def noisy(self) -> bool:
        """Whether any sensor has noise; else that of `noise` plays no part."""
        weighed = self.load_cell is not None and self.load_cell.noise_fraction > 0.0
        return weighed or any(self.noise_rms(name) > 0.0 for name in _SENT)

    @staticmethod
    def noise(seed: int, start: int, count: int) -> FloatArray:
        """Return the noise of the samples from `start` on (count, 4), the columns of `NOISE`."""
        return draw(check_seed("sensors", seed), SENSOR_NOISE, start, count, len(NOISE))

    def rows(
        self,
        noise: FloatArray,
        telemetry: TelemetryBlock,
        mru: MruBlock,
        references: FloatArray,
        switches: FloatArray | tuple[float, ...] = (1.0, 0.0, 1.0, 1.0),
    ) -> FloatArray:
        """Return the rows of a stretch of samples (n, len(row)) from what was drawn for them.

        The references are displacement, velocity and acceleration asked of the payload (n, 3), the
        switches 1 where the controller is enabled, is reset, hears encoder and load cell (n, 4).
        """
        switched = np.broadcast_to(switches, (len(noise), len(_SWITCHES)))
        link = (telemetry.weights, telemetry.fresh, telemetry.valid, telemetry.age)
        unit = (mru.heave, mru.heave_rate, mru.valid, mru.age)
        return np.column_stack((noise, *link, *unit, references, switched))

    def initial(self, raw: npt.ArrayLike) -> FloatArray:
        """Return the state of sensors that have long seen values of `RAW` (8,) at rest."""
        values = np.asarray(raw, dtype=np.float64)
        sent = [
            float(self._rounded(name, values[i] + self._bias(name))) for i, name in enumerate(_SENT)
        ]
        own: list[float] = []
        for i, name in enumerate(_SENT):
            quiet = self._noise_order(name) + (self.lags.stop - 1 if name in self.filters else 0)
            own += [0.0] * quiet + [values[i]] * self._late(name)[0]
            if self._holds(name):  # the first sample is a reading
                own += [1.0 - self.sample_time * (self.payload.rate(name) or 0.0), sent[i]]
        tension = values[RAW.index("rope.tension")]
        cell = [tension, tension] if self.load_cell is not None else []
        return np.array([*own, *(sent * self.lags.stop), *cell], dtype=np.float64)

    @cached_property
    def function(self) -> ca.Function:
        """casadi.Function (s, raw, row, applied) -> (s_next, m), m in the order of `HEARD`.

        `applied` is the command that the drive has followed over the last sample.
        """
        s = ca.SX.sym("s", len(self.states))
        raw = ca.SX.sym("raw", len(RAW))
        row = ca.SX.sym("row", len(self.row))
        applied = ca.SX.sym("applied")
        state, plant, given = (
            dict(zip(names, ca.vertsplit(values), strict=True))
            for names, values in ((self.states, s), (RAW, raw), (self.row, row))
        )
        after: dict[str, ca.SX] = {}
        seen: dict[str, ca.SX] = {
            "payload.age": given["telemetry.age"],
            "payload.valid": given["telemetry.valid"],
            "motor.torque": plant["motor.torque"],
            "drive.applied": applied,
            **{name: given[name] for name in (*_MRU, *_REFERENCE, *_SWITCHES)},
        }
        for name in _SENT:
            true, drawn = plant[f"measured.{name}"], given[f"noise.{name}"]
            now, off, own = self._shown(name, true, drawn, state)
            after |= own
            messages = [now, *(state[f"sent.{j}.{name}"] for j in range(1, self.lags.stop))]
            after |= {f"sent.{j}.{name}": messages[j - 1] for j in range(1, self.lags.stop)}
            arrived = ca.SX(0)
            for j in self.lags:
                weight = given[f"telemetry.weight.{j}"]
                arrived += ca.if_else(weight == 0, 0, weight * messages[j])
            if name in self.filters:
                arrived = self._rounded(name, arrived + self._of_newest(name, off, given, state))
                after |= {
                    f"sent.{j}.{name}.noise": state[f"sent.{j - 1}.{name}.noise"] if j > 1 else off
                    for j in range(1, self.lags.stop)
                }
            known = ca.if_else(given["telemetry.fresh"] == 0, state[f"held.{name}"], arrived)
            after[f"held.{name}"] = seen[f"payload.{name}"] = known
        seen |= {name: given["encoder.valid"] * v for name, v in self._encoded(plant).items()}
        tension = plant["rope.tension"]
        if self.load_cell is not None:
            filtered = self._weighed(state, tension)
            after |= {"load_cell.tension": filtered, "load_cell.before": tension}
            rms = self.load_cell.noise_fraction * self.static_tension
            tension = filtered + rms * given["noise.tension"]
        seen["rope.tension"] = given["load_cell.valid"] * tension
        return ca.Function(
            "sensors",
            [s, raw, row, applied],
            [
                ca.densify(ca.vertcat(*(after[name] for name in self.states))),
                ca.densify(ca.vertcat(*(seen[name] for name in HEARD))),
            ],
            ["s", "raw", "row", "applied"],
            ["s_next", "m"],
        )

    def noise_rms(self, name: str) -> float:
        """Return the deviation of the noise on ``velocity`` or another signal, before rounding."""
        if name in self.filters:
            return float(math.sqrt(_stationary(self.filters[name])[1]))
        density = float(getattr(self.payload, f"{name}_noise"))
        rate = self.payload.rate(name)
        between = self.sample_time if rate is None else max(self.sample_time, 1.0 / rate)
        return density / math.sqrt(2.0 * between)

    def _noise_order(self, name: str) -> int:
        return self.filters[name].order if name in self.filters else 0

    def _holds(self, name: str) -> bool:
        """Return whether a reading outlasts a sample."""
        rate = self.payload.rate(name)
        return rate is not None and rate * self.sample_time < 1.0 - _ROUNDING

    def _late(self, name: str) -> tuple[int, float]:
        """Return how many true values are remembered, and the weight of the oldest of them."""
        return late_hold(self.payload.latency(name) / self.sample_time)

    def _own_states(self, name: str) -> list[str]:
        """Return the names of the states of one payload sensor, in the order of `initial`."""
        found = [f"noise.{name}.{i}" for i in range(self._noise_order(name))]
        if name in self.filters:
            found += [f"sent.{j}.{name}.noise" for j in range(1, self.lags.stop)]
        found += [f"before.{i + 1}.{name}" for i in range(self._late(name)[0])]
        return found + ([f"clock.{name}.phase", f"reading.{name}"] if self._holds(name) else [])

    def _shown(
        self, name: str, true: ca.SX, drawn: ca.SX, state: Mapping[str, ca.SX]
    ) -> tuple[ca.SX, ca.SX, dict[str, ca.SX]]:
        """Return what a payload sensor sends, noise that is apart, and its states after the sample.

        `drawn` is a standard normal number.  Noise that has passed a low-pass is sent apart: what
        is known between two samples is interpolated, which would take away from it.
        """
        after: dict[str, ca.SX] = {}
        off = ca.SX(0)
        count, share = self._late(name)
        if count:
            values = [true, *(state[f"before.{i + 1}.{name}"] for i in range(count))]
            after |= {f"before.{i + 1}.{name}": values[i] for i in range(count)}
            true = share * values[-1]
            if share < 1.0:
                true += (1.0 - share) * values[-2]
        value = true + self._bias(name)
        if name in self.filters:
            over, gain, row, size = _innovations(self.filters[name], self.sample_time)
            x = ca.vertcat(*(state[f"noise.{name}.{i}"] for i in range(len(over))))
            off = ca.mtimes(ca.DM(row), x) + size * drawn
            following = ca.mtimes(ca.DM(over), x) + ca.DM(gain) * drawn
            after |= {f"noise.{name}.{i}": following[i] for i in range(len(over))}
        else:
            if self.noise_rms(name) > 0.0:
                value = value + self.noise_rms(name) * drawn
            value = self._rounded(name, value)
        if self._holds(name):
            phase = state[f"clock.{name}.phase"]
            phase = phase + self.sample_time * (self.payload.rate(name) or 0.0)
            due = phase > 1.0 - _ROUNDING
            value = ca.if_else(due, value, state[f"reading.{name}"])
            after |= {f"clock.{name}.phase": phase - due, f"reading.{name}": value}
        return value, off, after

    def _of_newest(
        self, name: str, now: ca.SX, given: Mapping[str, ca.SX], state: Mapping[str, ca.SX]
    ) -> ca.SX:
        """Return the noise of the newest of the messages that what has arrived is made of."""
        found, before = ca.SX(0), ca.SX(0)
        for j in self.lags:
            weight = given[f"telemetry.weight.{j}"]
            first = ca.logic_and(weight != 0, before == 0)
            found += ca.if_else(first, state[f"sent.{j}.{name}.noise"] if j else now, 0)
            before = weight
        return found

    def _bias(self, name: str) -> float:
        return float(getattr(self.payload, f"{name}_bias"))

    def _rounded(self, name: str, value: ca.SX) -> ca.SX:
        step = float(getattr(self.payload, f"{name}_resolution"))
        return _rounded(value, step) if step > 0.0 else value

    def _encoded(self, plant: Mapping[str, ca.SX]) -> dict[str, ca.SX]:
        """Return haul and motor speed as the encoder shows them."""
        angle, haul, speed = plant["motor.angle"], plant["drum.haul"], plant["motor.speed"]
        if self.encoder is not None:
            count = 2.0 * math.pi / self.encoder.counts_per_turn
            haul = haul + self.haul_per_angle * (_rounded(angle, count) - angle)
            speed = _rounded(speed, count / _SPEED_WINDOW)
        return {"drum.haul": haul, "motor.speed": speed}

    def _weighed(self, state: Mapping[str, ca.SX], tension: ca.SX) -> ca.SX:
        """Return the tension behind the load cell's low-pass."""
        x = (self.load_cell.bandwidth if self.load_cell is not None else 0.0) * self.sample_time
        stays = math.exp(-x)
        # Of a step and of a ramp over the sample; expm1 keeps the digits at short samples.
        full = -math.expm1(-x)
        new = 1.0 - full / x
        before = full - new
        return (
            stays * state["load_cell.tension"] + before * state["load_cell.before"] + new * tension
        )


def _rounded(value: ca.SX, step: float) -> ca.SX:
    """Return the nearest multiple of a step."""
    return step * ca.floor(value / step + 0.5)


def _stationary(noise: ShapingFilter) -> tuple[FloatArray, float]:
    """Return the covariance of a filter's state, (n, n), and the variance of its signal."""
    P = np.asarray(solve_continuous_lyapunov(noise.A, -noise.B @ noise.B.T), dtype=np.float64)
    return P, float((noise.C @ P @ noise.C.T)[0, 0])


def _innovations(
    noise: ShapingFilter, step: float
) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Return x' = over x + gain e, n = row x + size e of a noise each step [s], e standard normal.

    Its samples have the covariances of the filter's signal at all lags: the innovations of its
    exact sampling, of which each is one number (B. D. O. Anderson and J. B. Moore, Optimal
    Filtering, 1979, section 9.2).
    """
    over, added = noisy_hold(noise.A, noise.B, step)
    row, P = noise.C, _stationary(noise)[0]
    for _ in range(_ROUNDS):  # towards what is left unknown of the state once all before is known
        variance = float((row @ P @ row.T)[0, 0])
        gain = over @ P @ row.T / variance
        P = over @ P @ over.T + added - gain @ gain.T * variance
    size = math.sqrt(float((row @ P @ row.T)[0, 0]))
    return over, over @ P @ row.T / size, row, size
