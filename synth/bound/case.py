r"""The bound of a case: the best that its winch could do with its sensors.

    case -> plant with all sensors, spectra of sea and noise, drive limits -> `lqg_bound`

Everything is put on the side that makes the bound lower: peaks become limits on the rms with the
smallest k = sqrt(2 ln(T/T_z)) that is plausible, limits on power and on the loop's margins are
left out, and what a case calls an exact sensor has only a faint, stated noise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from models.basics import InputError, White, check_range
from models.case import Case
from models.hook import HookMotion
from models.plant import LinearPlant, PlantData
from models.sensing import sensed_plant, sensed_spectra

from ..limits import Continuous, Least, Limit, Peak, Rms
from ..question import PAYLOAD, pose
from .bound import Bound, lqg_bound

_LONGER = 2.0  # T_z of any signal over that of the hook, at most
_SAMPLE = 0.01  # of the faint noise [s]
_SHAKEN = "payload.force"
_FORCE = 0.1  # of the faint noise, on the payload


def bound_for(
    case: Case,
    *,
    masses: int | None = None,
    drag: float | None = None,
    measurements: Sequence[str] | None = None,
    spectra: Mapping[str, Any] | None = None,
    periods: Mapping[str, float] | None = None,
    faint: float = 1e-3,
    pade: int = 2,
    order: int = 8,
) -> Bound:
    """Return a lower bound on the payload's rms motion for any linear controller of a case.

    Parameters
    ----------
    case
        The case.
    masses
        Rope masses; by default the case's, or a number that suits a quick loop.
    drag
        Linear drag coefficient [N s/m], such as a design's; by default that with the drum held.
    measurements
        What the controller hears (`models.sensing.plant.MEASURED`); by default everything.
    spectra
        Further disturbances, or others than the case's (`models.sensing.plant.sensed_spectra`).
    periods
        Mean period T_z of signals by name [s], such as a design's; by default twice the hook's.
        The longer, the smaller the k of peak limits and the lower the bound.
    faint
        Noise of a sensor that the case calls exact: an independent error every 10 ms, over the
        rms of the hook's motion (for a tension: over the static one).  A tenth of it, over the
        static tension, is a force on the payload.
    pade, order
        See `lqg_bound`.

    Raises
    ------
    InputError
        If a name is unknown or a limit lies below the static load.
    """
    check_range("bound", "faint", faint, low=0.0, open_low=True)
    question = pose(case, masses)
    hook = question.hook
    coefficient = question.drag_before if drag is None else drag
    plant = sensed_plant(case, masses=question.masses, drag=coefficient)
    if measurements is not None:
        plant = plant.select(measurements=measurements)
    given = {**sensed_spectra(case, hook), **(spectra or {})}
    known = _heard(plant)
    given = {k: v for k, v in given.items() if k not in known or known[k] in plant.measurements}
    longest = _LONGER * float(hook.displacement.zero_crossing_period)
    rms = rms_limits(question.limits, periods or {}, longest)
    command, top = command_limit(case, plant)
    rms = {**{command: top}, **rms} if command not in rms else rms
    plant, given, added = faint_noise(case, plant, hook, given, faint)
    said = [
        f"drag {coefficient:.4g} N s/m; {question.masses} rope masses",
        f"peaks as rms with T_z {'of the design' if periods else f'{longest:.3g} s'}; no limits on "
        "margins or power",
    ]
    if added:
        said.append(f"faint noise ({faint:g}) of {', '.join(added)}")
    return lqg_bound(
        plant, given, {PAYLOAD: 1.0}, rms, pade=pade, order=order, assumptions=tuple(said)
    )


def rms_limits(
    limits: Sequence[Limit], periods: Mapping[str, float], longest: float
) -> dict[str, float]:
    """Return the limits on signals as limits on their rms by name; others are left out.

    |static| + k sigma <= bound with k = sqrt(2 ln(T/T_z)), and sqrt(static^2 + sigma^2) <= bound.

    Parameters
    ----------
    limits
        As of a case.
    periods
        T_z of a signal by name [s].
    longest
        T_z of the others [s].

    Raises
    ------
    InputError
        If a limit is not above the static load.
    """
    found: dict[str, float] = {}
    for limit in limits:
        if isinstance(limit, Rms):
            room = limit.bound
        elif isinstance(limit, Continuous):
            room = math.sqrt(max(limit.bound**2 - limit.static**2, 0.0))
        elif isinstance(limit, Peak | Least):
            period = periods.get(limit.output, longest)
            k = math.sqrt(2.0 * math.log(max(limit.duration / period, math.e**0.5)))
            least = isinstance(limit, Least)
            room = (limit.static - limit.bound if least else limit.bound - abs(limit.static)) / k
        else:
            continue
        if room <= 0.0:
            raise InputError(f"bound: {limit.name} leaves no room above the static load")
        found[limit.output] = min(room, found.get(limit.output, math.inf))
    return found


def faint_noise(
    case: Case,
    plant: LinearPlant,
    hook: HookMotion,
    spectra: Mapping[str, Any],
    faint: float,
) -> tuple[LinearPlant, dict[str, Any], tuple[str, ...]]:
    """Return the plant and its spectra with a faint white noise where there is none.

    On every measurement that hears no white noise of its own, and as a force on the payload, which
    shakes the modes at zero frequency that a sea leaves at rest.
    """
    white = [plant.disturbances.index(n) for n, s in spectra.items() if isinstance(s, White)]
    exact = [n for n, row in zip(plant.measurements, plant.F, strict=True) if not row[white].any()]
    names = tuple(f"{name}.faint" for name in exact)
    m = len(names)
    columns = np.zeros((len(plant.measurements), m))
    for k, name in enumerate(exact):
        columns[plant.measurements.index(name), k] = 1.0
    noisy = replace(
        plant,
        E=np.hstack([plant.E, np.zeros((len(plant.A), m))]),
        F=np.hstack([plant.F, columns]),
        Fz=np.hstack([plant.Fz, np.zeros((len(plant.Cz), m))]),
        disturbances=(*plant.disturbances, *names),
    )
    scales = _scales(case, hook)
    result = dict(spectra)
    for name, of in zip(names, exact, strict=True):
        result[name] = White((faint * scales[of]) ** 2 * _SAMPLE)
    added = list(exact)
    if _SHAKEN not in result:
        result[_SHAKEN] = White((_FORCE * faint * case.static_tension) ** 2 * _SAMPLE)
        added.append("the force on the payload")
    return noisy, result, tuple(added)


def _scales(case: Case, hook: HookMotion) -> dict[str, float]:
    """Return the size of each measured signal if the payload is held still."""
    heave, rate = float(hook.displacement.rms), float(hook.velocity.rms)
    per_haul = case.winch.gearbox.ratio / PlantData.from_case(case).drum_radius
    return {
        "payload.acceleration": float(hook.acceleration.rms),
        "payload.velocity": rate,
        "payload.displacement": heave,
        "mru.heave": heave,
        "mru.heave_rate": rate,
        "drum.haul": heave,
        "motor.speed": rate * per_haul,
        "rope.tension": float(case.static_tension),
    }


def command_limit(case: Case, plant: LinearPlant) -> tuple[str, float]:
    """Return the input and what its rms cannot exceed, whatever the drive does."""
    name = plant.inputs[0]
    motor, drive = case.winch.motor, case.winch.drive
    if motor.type == "dc":
        return name, float(drive.voltage or math.inf)
    if getattr(motor, "speed_gain", 0.0):
        return name, float(case.winch.speed_limit or math.inf)
    return name, float(drive.torque_peak or math.inf)


def _heard(plant: LinearPlant) -> dict[str, str]:
    """Return which measurement each sensor's own noise belongs to."""
    noises = {n: n.removesuffix("_noise") for n in plant.disturbances if n.endswith("_noise")}
    if "mru.error" in plant.disturbances:
        heard = "mru.heave" if "mru.heave" in plant.measurements else "mru.heave_rate"
        noises["mru.error"] = heard
    return noises
