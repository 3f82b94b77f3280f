"""The linear plant of a case with every sensor of its winch, and the spectra of their noise.

    case -> plant -> + reference unit, encoder, load cell -> LinearPlant
    case -> sea, error of the reference unit, sensors' noise -> spectra by name

The thesis feeds back what the payload does; other structures (`synth.structures.winch_structures`)
also hear the ship, the drum and the rope.  Everything of synthesis that takes a linear plant and
spectra takes these.  The names are those of a simulation's measurements (`models.sensing.control`),
so what is designed here runs there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from ..basics import FloatArray, White
from ..case import Case
from ..hook import HookMotion
from ..plant import (
    MEASUREMENTS,
    LinearPlant,
    PlantData,
    PlantResponse,
    build_plant,
    line_response,
)
from ..rig import MRU, Sensors
from .mru import PERFECT, error_density, unit_response

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
#: What disturbs the sensors, besides the plant's own disturbances.
NOISES = (
    "mru.error",
    "mru.error_rate",
    *(f"{name}_noise" for name in MEASUREMENTS),
    "rope.tension_noise",
)
_ABOARD = (*ENCODER, "rope.tension")  # measured outputs of the plant
_OF_PLANT = [MEASURED.index(name) for name in (*MEASUREMENTS, *_ABOARD)]
DRIFT_BAND = 1e-6  # lower end of the band in which a drift is looked at [rad/s]
SAMPLE_TIME = 0.01  # of the load cell's noise, which a data sheet gives per sample [s]


@dataclass(frozen=True, kw_only=True, eq=False)
class UnitError:
    """What a reference unit shows too much of a hook's heave, as a spectrum.

    Attributes
    ----------
    unit
        The unit.
    hook
        Motion of the hook, which gain and phase error are of.
    """

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


def sensed_plant(
    case: Case | PlantData,
    *,
    masses: int | None = None,
    drag: float,
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
    sensors
        The sensors, by default those of the case (`models.rig.sensors.Sensors`).

    Returns
    -------
    LinearPlant
        Outputs are those of `models.plant.plant`.  Measurements are `MEASURED`: the payload's
        motion late by the telemetry, the hook's heave and its rate behind the high-pass of the
        reference unit and late by its delay, haul and motor speed (encoder, taken as exact), and
        the tension behind the load cell's low-pass.  Each of `NOISES` adds to its measurement; the
        error of the heave rate is the derivative of that of the heave.

    Raises
    ------
    InputError
        If a number is out of its range.
    """
    if isinstance(case, Case) and sensors is None:
        sensors = case.sensors
    return with_sensors(build_plant(case, masses).linearise(drag=drag), sensors)


def with_sensors(plant: LinearPlant, sensors: Sensors | None) -> LinearPlant:
    """Return a linear plant of `models.plant.plant` with the sensors besides the payload's own.

    Every matrix of the answer is affine in those of `plant`.

    Parameters
    ----------
    plant
        The plant, as `Plant.linearise` gives it.
    sensors
        The sensors of a case; None for exact ones.

    Returns
    -------
    LinearPlant
        As `sensed_plant` describes it.
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
    shown = [plant.outputs.index(name) for name in _ABOARD]
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

    delays = dict.fromkeys(MEASUREMENTS, plant.delays[0])
    delays |= {"mru.heave": unit.delay, "mru.heave_rate": unit.delay}
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
        delays=tuple(delays.get(name, 0.0) for name in MEASURED),
        rates={**plant.rates, "mru.error_rate": "mru.error"},
        units={**plant.units, **units},
    )


def aboard(case: Case) -> tuple[str, ...]:
    """Return what is measured aboard, of `MEASURED`: what the case names, and the encoder."""
    missing = [name for name, sensor in SENSORS.items() if getattr(case.sensors, sensor) is None]
    return tuple(name for name in MEASURED if name not in missing)


def sensed_line_at(
    case: Case, s: npt.ArrayLike, *, drag: float, data: PlantData | None = None
) -> PlantResponse:
    """Return the exact response of a case's rope, drive and sensors, delays and all.

    Parameters
    ----------
    case
        The case.
    s
        Points [1/s], (k,), none of them a pole (s = 0 is one).
    drag
        Equivalent linear drag coefficient of the payload [N s/m].
    data
        The case's numbers, where they are at hand.

    Returns
    -------
    PlantResponse
        With the names of `sensed_plant`, on the distributed rope (`models.plant.line_response`).
    """
    line, sensors = line_response(data or case, s, drag=drag), case.sensors
    points, nw, at = line.s, len(line.disturbances), MEASURED.index
    noises = tuple(name for name in NOISES if name != "mru.error_rate")
    yw = np.zeros((points.size, len(MEASURED), nw + len(noises)), complex)
    yu = np.zeros((points.size, len(MEASURED), len(line.inputs)), complex)
    shown = [line.outputs.index(name) for name in _ABOARD]
    yw[:, _OF_PLANT, :nw] = np.concatenate([line.yw, line.zw[:, shown]], axis=1)
    yu[:, _OF_PLANT] = np.concatenate([line.yu, line.zu[:, shown]], axis=1)
    if sensors.load_cell is not None:
        weighed = 1.0 / (1.0 + points / sensors.load_cell.bandwidth)
        for block in (yw, yu):
            block[:, at("rope.tension")] *= weighed[:, None]
    unit = sensors.mru or PERFECT
    passed, late = unit_response(unit, points), np.exp(-points * unit.delay)
    for name, rate in (("mru.heave", 1.0), ("mru.heave_rate", points)):
        yw[:, at(name), line.disturbances.index("hook.heave")] = rate * passed
        yw[:, at(name), nw + noises.index("mru.error")] = rate * late
    sent = np.exp(-points * sensors.telemetry.delay)
    for name in (*MEASUREMENTS, "rope.tension"):
        noise = 1.0 if name == "rope.tension" else sent
        yw[:, at(name), nw + noises.index(f"{name}_noise")] = noise
    still = np.zeros((points.size, len(line.outputs), len(noises)))
    return replace(
        line,
        zw=np.concatenate([line.zw, still], axis=2),
        yw=yw,
        yu=yu,
        disturbances=(*line.disturbances, *noises),
        measurements=MEASURED,
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
        The hook's motion, the error of the reference unit (`UnitError`) and the
        white noises, for `synth.design.tuning`; those that are zero are left out.  A one-sided
        amplitude density N per root hertz is white noise of intensity N^2/2; an independent error
        of rms s at every sample is one of intensity s^2 times the sample time.
    """
    sensors = case.sensors
    found: dict[str, Any] = {"hook.heave": hook}
    error = UnitError(unit=sensors.mru or PERFECT, hook=hook)
    if error.there:
        found["mru.error"] = error
    for name in MEASUREMENTS:
        density = float(getattr(sensors.payload, f"{name.removeprefix('payload.')}_noise"))
        if density > 0.0:
            found[f"{name}_noise"] = White(0.5 * density**2)
    if sensors.load_cell is not None and sensors.load_cell.noise_fraction > 0.0:
        rms = sensors.load_cell.noise_fraction * case.static_tension
        found["rope.tension_noise"] = White(rms**2 * sample_time)
    return found
