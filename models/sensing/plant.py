"""The linear plant of a case with every sensor of its winch, and the spectra of their noise.

    case -> plant -> + reference unit, encoder, load cell -> LinearPlant
    case -> sea, error of the reference unit, sensors' noise -> spectra by name

The thesis feeds back what the payload does; other structures (`synth.structures.winch_structures`)
also hear the ship, the drum and the rope.  Everything of synthesis that takes a linear plant and
spectra takes these.  The names are those of a simulation's measurements (`models.sensing.control`),
so what is designed here runs there.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from ..basics import ComplexArray, FloatArray, White
from ..case import Case
from ..hook import HookMotion
from ..plant import (
    MEASUREMENTS,
    LinearPlant,
    PlantData,
    PlantResponse,
    ShapingFilter,
    build_plant,
    late_and_held,
    line_response,
    weighed_tension,
)
from ..rig import MRU, PayloadSensor, Sensors
from .mru import PERFECT, coherent_error, error_density, low_pass, unit_response
from .switching import SET_POINT, SwitchingNoise

#: What is measured, in the order of the plant's measurements.
MEASURED = (
    *MEASUREMENTS,
    "mru.heave",
    "mru.heave_rate",
    "drum.haul",
    "motor.speed",
    "rope.tension",
)
#: The section of `sensors` that puts a measurement aboard; the others always are.
SENSORS = {"mru.heave": "mru", "mru.heave_rate": "mru", "rope.tension": "load_cell"}
#: What the drive's own encoder shows.
ENCODER = ("drum.haul", "motor.speed")
LOAD = "motor.load"  # torque on the motor's shaft, a disturbance where losses switch
#: What disturbs the sensors, besides the plant's own disturbances.
NOISES = (
    "mru.error",
    "mru.error_rate",
    *(f"{name}_noise" for name in MEASUREMENTS),
    "rope.tension_noise",
)
_OF_PLANT = [MEASURED.index(name) for name in (*MEASUREMENTS, *ENCODER, "rope.tension")]
DRIFT_BAND = 1e-6  # lower end of the band in which a drift is looked at [rad/s]
SAMPLE_TIME = 0.01  # of the load cell's noise, which a data sheet gives per sample [s]


@dataclass(frozen=True, kw_only=True, eq=False)
class UnitError:
    """What a reference unit shows too much of a hook's heave, as a spectrum."""

    unit: MRU
    hook: HookMotion

    @property
    def there(self) -> bool:
        """Whether there is an error at all."""
        unit = self.unit
        return max(unit.coherent, unit.drift, unit.noise, unit.noise_floor, unit.noise_fraction) > 0

    @property
    def lowest(self) -> float:
        """Frequency below which there is nothing of it [rad/s]; infinite without a drift."""
        return DRIFT_BAND if self.unit.drift > 0.0 else math.inf

    @property
    def splits(self) -> tuple[float, ...]:
        """Kinks of the density [rad/s]."""
        return tuple(self.hook.splits) if self.unit.coherent > 0.0 else ()

    def __call__(self, omega: npt.ArrayLike) -> FloatArray:
        """Return the one-sided density [m2 s/rad] at `omega` [rad/s]."""
        frequency = np.asarray(omega, dtype=np.float64)
        heave = np.asarray(self.hook.density(frequency))
        return error_density(self.unit, frequency, heave, float(self.hook.displacement.rms))

    def coherent(self, omega: npt.ArrayLike) -> ComplexArray:
        """Return gain and phase error over the hook's heave (`coherent_error`), (0 to 2, n)."""
        return coherent_error(self.unit, np.asarray(omega, dtype=np.float64))


def sensed_plant(
    case: Case | PlantData,
    *,
    masses: int | None = None,
    drag: float,
    friction: float = 0.0,
    sensors: Sensors | None = None,
) -> LinearPlant:
    """Return the plant linearised at rest, with all that the winch's sensors show.

    Parameters
    ----------
    case
        The case; or the plant's numbers alone, with the `sensors` of a case.
    masses
        Masses along the rope; by default those of the case.
    drag
        Equivalent linear drag coefficient of the payload [N s/m].
    friction
        Viscous friction at the motor beside its own, that of losses which switch [N m s/rad].
    sensors
        The sensors, by default those of the case (`models.rig.sensors.Sensors`).

    Returns
    -------
    LinearPlant
        Outputs are those of `models.plant.plant`.  Measurements are `MEASURED`: the payload's
        motion held between readings and late by latency and telemetry, the hook's heave and its
        rate behind the high-pass of the reference unit and late by its delay, haul and motor speed
        (encoder, taken as exact), and the tension behind the load cell's low-pass.  Each of
        `NOISES` adds to its measurement; the error of the heave rate is the derivative of that of
        the heave.  All are late by the command's own delay besides.

    Raises
    ------
    InputError
        If a number is out of its range.
    """
    if isinstance(case, Case) and sensors is None:
        sensors = case.sensors
    plant = build_plant(case, masses)
    linear = plant.linearise(drag=drag)
    if friction:
        linear = with_loads(linear, plant.data).with_element("motor.speed", LOAD, -friction)
    return with_sensors(linear, sensors, plant.data.command_delay)


def with_loads(plant: LinearPlant, data: PlantData) -> LinearPlant:
    """Return a linear plant of `models.plant.plant` with `LOAD`, a torque on the motor's shaft.

    It stands for losses that switch with the direction.  The drive's signals are told without what
    they take of it (`LinearPlant.loss`): it is no part of what is Gaussian in them.
    """
    return plant.with_disturbance(LOAD, {"motor.speed": 1.0 / data.inertia}, data.per_torque)


def with_sensors(plant: LinearPlant, sensors: Sensors | None, command_delay: float) -> LinearPlant:
    """Return a plant of `Plant.linearise` with the other sensors too; None stands for exact ones.

    Every matrix of the answer is affine in those of `plant`.  Every measurement carries the delay
    from the command to the drive [s].
    """
    sensors = sensors or Sensors()
    unit, cell = sensors.mru or PERFECT, sensors.load_cell
    n, nw = len(plant.states), len(plant.disturbances)
    hook = [plant.disturbances.index(name) for name in ("hook.heave", "hook.heave_rate")]
    period = unit.heave_filter_period
    filters = ["mru.low", "mru.low_rate"] if period is not None else []
    states = [*plant.states, *filters, *(["load_cell.tension"] if cell is not None else [])]
    more = len(states) - n

    A = np.zeros((len(states), len(states)))
    A[:n, :n] = plant.A
    B = np.vstack([plant.B, np.zeros((more, plant.B.shape[1]))])
    E = np.zeros((len(states), nw + len(NOISES)))
    E[:n, :nw] = plant.E
    C = np.zeros((len(MEASURED), len(states)))
    D = np.zeros((len(MEASURED), len(plant.inputs)))
    F = np.zeros((len(MEASURED), nw + len(NOISES)))
    shown = _aboard(plant.outputs)
    C[_OF_PLANT, :n] = np.vstack([plant.C, plant.Cz[shown]])
    D[_OF_PLANT] = np.vstack([plant.D, plant.Dz[shown]])
    F[_OF_PLANT, :nw] = np.vstack([plant.F, plant.Fz[shown]])

    at = {name: k for k, name in enumerate(MEASURED)}
    heave, rate, tension = at["mru.heave"], at["mru.heave_rate"], at["rope.tension"]
    F[heave, hook[0]] = F[rate, hook[1]] = 1.0
    if period is not None:
        # l'' + sqrt(2) w l' + w^2 l = Z; shown are Z - sqrt(2) w l' - w^2 l = l'' and l'''.
        w, d = 2.0 * math.pi / period, math.sqrt(2.0)
        low, low_rate = n, n + 1
        A[low, low_rate] = 1.0
        A[low_rate, [low, low_rate]] = -(w**2), -d * w
        E[low_rate, hook[0]] = 1.0
        C[heave, [low, low_rate]] = -(w**2), -d * w
        C[rate] = -d * w * C[heave]
        C[rate, low_rate] -= w**2
        F[rate, hook[0]] = -d * w
    if cell is not None:
        b = cell.bandwidth
        A[-1], B[-1], E[-1] = b * C[tension], b * D[tension], b * F[tension]
        A[-1, -1] = -b
        C[tension] = D[tension] = F[tension] = 0.0
        C[tension, -1] = 1.0
    heard_by = {"mru.error": "mru.heave", "mru.error_rate": "mru.heave_rate"}
    for k, name in enumerate(NOISES):
        F[at[heard_by.get(name, name.removesuffix("_noise"))], nw + k] = 1.0

    holds = payload_holds(sensors.payload)
    delays = {name: plant.delays[0] + late for name, late in _payload_delays(sensors).items()}
    delays |= dict.fromkeys(("mru.heave", "mru.heave_rate"), unit.delay + command_delay)
    units = {"mru.heave": "m", "mru.heave_rate": "m/s", "mru.error": "m", "mru.error_rate": "m/s"}
    units |= {f"{name}_noise": plant.units[name] for name in (*MEASUREMENTS, "rope.tension")}
    return replace(
        plant,
        A=A,
        B=B,
        E=E,
        C=C,
        D=D,
        F=F,
        Cz=np.hstack([plant.Cz, np.zeros((len(plant.Cz), more))]),
        Fz=np.hstack([plant.Fz, np.zeros((len(plant.Fz), len(NOISES)))]),
        states=tuple(states),
        disturbances=(*plant.disturbances, *NOISES),
        measurements=MEASURED,
        delays=tuple(delays.get(name, command_delay) for name in MEASURED),
        holds=tuple(holds.get(name, 0.0) for name in MEASURED),
        rates={**plant.rates, "mru.error_rate": "mru.error"},
        units={**plant.units, **units},
    )


def _aboard(outputs: Sequence[str]) -> list[int]:
    """Return which outputs of a plant encoder and load cell measure."""
    return [outputs.index(name) for name in (*ENCODER, weighed_tension(outputs))]


def payload_noise(sensors: Sensors, name: str) -> White | ShapingFilter | None:
    """Return the noise of a signal, such as ``velocity``, as the telemetry sends it, or None.

    Noise of the element passes the low-passes of sensor and link.  That of readings, of which a
    data sheet says how they scatter, is independent from one to the next and passes no low-pass,
    but is held with them; so it is as white as they carry it, up to half their rate.  None without
    noise.
    """
    payload = sensors.payload
    intensity = 0.5 * float(getattr(payload, f"{name}_noise")) ** 2
    if intensity == 0.0:
        return None
    corners = (payload.bandwidth, sensors.telemetry.bandwidth)
    passed = [corner for corner in corners if isinstance(corner, float)]
    if not passed or payload.noise_enters == "after-filter" or payload.rate(name) is not None:
        return White(intensity)
    order = 2 * len(passed)
    A, B, C = np.zeros((order, order)), np.zeros((order, 1)), np.zeros((1, order))
    for k, corner in enumerate(passed):  # each is driven by the one before
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = low_pass(corner)
        if k:
            A[2 * k + 1, 2 * k - 2] = corner**2
    B[1, 0], C[0, order - 2] = passed[0] ** 2 * math.sqrt(intensity), 1.0
    return ShapingFilter(A=A, B=B, C=C, variance_error=0.0, shape_error=0.0)


def payload_holds(payload: PayloadSensor) -> dict[str, float]:
    """Return for how long a reading of each payload signal is held [s]; 0 for no hold."""
    rates = {name: payload.rate(name.removeprefix("payload.")) for name in MEASUREMENTS}
    return {name: 0.0 if rate is None else 1.0 / rate for name, rate in rates.items()}


def _payload_delays(sensors: Sensors) -> dict[str, float]:
    """Return by how much each payload signal is late besides the telemetry [s]."""
    return {
        name: sensors.payload.latency(name.removeprefix("payload.")) + 0.5 * hold
        for name, hold in payload_holds(sensors.payload).items()
    }


def aboard(case: Case) -> tuple[str, ...]:
    """Return what is measured aboard, of `MEASURED`: what the case names, and the encoder."""
    missing = [name for name, sensor in SENSORS.items() if getattr(case.sensors, sensor) is None]
    return tuple(name for name in MEASURED if name not in missing)


def sensed_line_at(
    case: Case,
    s: npt.ArrayLike,
    *,
    drag: float,
    friction: float = 0.0,
    data: PlantData | None = None,
    measurements: Sequence[str] | None = None,
    disturbances: Sequence[str] | None = None,
    masses: int = 0,
) -> PlantResponse:
    """Return the exact response of a case's rope, drive and sensors at points s (k,) [1/s].

    No point is a pole (s = 0 is one).  The payload's equivalent linear drag is in N s/m, the
    friction that of losses which switch, beside the motor's own [N m s/rad].  Names are those of
    `sensed_plant`, the rope `models.plant.line_response`.  Measurements and disturbances may be
    named, by default all are there.  With `masses`, two or more, the rope is lumped in them.
    """
    data = PlantData.from_case(case) if data is None else data
    heard = MEASURED if measurements is None else tuple(measurements)
    noises = tuple(name for name in NOISES if name != "mru.error_rate")
    if disturbances is not None:
        noises = tuple(name for name in noises if name in disturbances)
        disturbances = [name for name in disturbances if name not in noises]
    if friction:
        data = replace(data, viscous_friction=data.viscous_friction + friction)
    line = line_response(data, s, drag=drag, disturbances=disturbances, masses=masses)
    sensors = case.sensors
    points, names = line.s, (*line.disturbances, *noises)
    own, unit = 1 + len(line.disturbances), sensors.mru or PERFECT
    # By row, column (the command's, then the disturbances') and point.
    z, rows = (
        np.zeros((count, 1 + len(names), points.size), np.complex128)
        for count in (len(line.outputs), len(heard))
    )
    z[:, :1], z[:, 1:own] = line.zu.transpose(1, 2, 0), line.zw.transpose(1, 2, 0)
    if friction:
        # Signals of the drive without what losses take, see `with_loads`.
        speed = line.outputs.index("motor.speed")
        for name, per in data.per_torque.items():
            z[line.outputs.index(name)] -= friction * per * z[speed]
    shown = dict(zip((*ENCODER, "rope.tension"), _aboard(line.outputs), strict=True))
    for row, name in zip(rows, heard, strict=True):
        if name in shown:
            row[:] = z[shown[name]]
        elif name in MEASUREMENTS:
            at = line.measurements.index(name)
            row[:1], row[1:own] = line.yu[:, at].T, line.yw[:, at].T
        else:
            rate = points if name == "mru.heave_rate" else 1.0
            if "hook.heave" in names:
                row[1 + names.index("hook.heave")] = rate * unit_response(unit, points)
            if "mru.error" in noises:
                row[1 + names.index("mru.error")] = rate * np.exp(-points * unit.delay)
        if name == "rope.tension" and sensors.load_cell is not None:
            row /= 1.0 + points / sensors.load_cell.bandwidth
        if (noise := f"{name}_noise") in noises:
            sent = 0.0 if name == "rope.tension" else data.delay + data.command_delay
            row[1 + names.index(noise)] = np.exp(-points * sent)
    # The payload's rows are late by telemetry and command already, the others by neither.
    further, holds = _payload_delays(sensors), payload_holds(sensors.payload)
    turned = late_and_held(
        points[:, None],
        [further.get(name, data.command_delay) for name in heard],
        [holds.get(name, 0.0) for name in heard],
    )
    rows *= np.ascontiguousarray(turned.T)[:, None]
    z, y = z.transpose(2, 0, 1), rows.transpose(2, 0, 1)
    return replace(
        line,
        zw=z[:, :, 1:],
        zu=z[:, :, :1],
        yw=y[:, :, 1:],
        yu=y[:, :, :1],
        disturbances=names,
        measurements=heard,
    )


def sensed_spectra(
    case: Case, hook: HookMotion, *, sample_time: float = SAMPLE_TIME
) -> Mapping[str, Any]:
    """Return the spectra of what disturbs a case and its sensors, by name of the disturbance.

    Parameters
    ----------
    case
        The case.
    hook
        Motion of the hook.
    sample_time
        Time between samples [s], for the load cell, whose noise is given per sample.

    Returns
    -------
    Mapping
        The hook's motion, the error of the reference unit (`UnitError`) and the noises, for
        `synth.design.tuning`; those that are zero are left out.  A one-sided amplitude density N
        per root hertz is white noise of intensity N^2/2, behind the low-passes that it has to pass
        (`payload_noise`); an independent error of rms s at every sample is one of intensity s^2
        times the sample time.
    """
    sensors = case.sensors
    found: dict[str, Any] = {"hook.heave": hook}
    error = UnitError(unit=sensors.mru or PERFECT, hook=hook)
    if error.there:
        found["mru.error"] = error
    remnant = SwitchingNoise.of(PlantData.from_case(case), hook)
    if remnant is not None:
        found[SET_POINT] = remnant
    for name in MEASUREMENTS:
        noise = payload_noise(sensors, name.removeprefix("payload."))
        if noise is not None:
            found[f"{name}_noise"] = noise
    if sensors.load_cell is not None and sensors.load_cell.noise_fraction > 0.0:
        rms = sensors.load_cell.noise_fraction * case.static_tension
        found["rope.tension_noise"] = White(rms**2 * sample_time)
    return found
