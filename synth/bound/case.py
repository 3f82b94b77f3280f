r"""Bound of a case, alone (`bound_for`) or beside a design on the same terms (`bound_beside`).

    case -> plant with all sensors, spectra of sea and noise, drive limits -> `lqg_bound`
    design -> its plant, drag, sensors, noise, limits -> bound with the sensors that it hears
                                                      -> bound with all sensors of the case
           -> its own rms on these terms              -> DesignBound

Everything is put on the side that makes the bound lower: peaks become limits on the rms with the
smallest k = sqrt(2 ln(T/T_z)) that is plausible, limits on power and on the loop's margins are
left out, and what a case calls an exact sensor has only a faint, stated noise.

Beside a design the bound is below it by construction: both live on one plant with one linear drag,
are shaken by the same spectra, and no limit of the bound is tighter than what the design itself
uses.  So that a direct gain on white noise has a variance, the design's law stands behind a
low-pass far above its loop.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from models.basics import InputError, White, check_range, one_thread
from models.case import Case
from models.hook import HookMotion
from models.plant import LinearPlant, PlantData
from models.sensing import MEASURED, sensed_plant, sensed_spectra

from ..limits import Continuous, Limit, Minimum, Peak, Rms
from ..loop import LinearController, closed_loop_poles, disturbances
from ..question import PAYLOAD, pose
from ..verify import LawMatrices, Loop, moments
from .bound import Bound, lqg_bound
from .dual import with_input_outputs
from .spectral_factor import SpectralFactor, spectral_factor
from .truth import banded

_FAINT = 1e-3  # noise of an exact sensor, see `bound_for`
_LONGER = 2.0  # T_z of any signal over that of the hook, at most
_RTOL = 1e-7  # of the design's own variances
_REFITS = 1
_PADE = 6  # of the delays, for the design's poles: marks of its quadrature
_PROPER = 1e4  # corner of the low-pass before a direct gain [rad/s]
_SIGNALS = ("acceleration", "velocity", "displacement")
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
    faint: float = _FAINT,
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
        elif isinstance(limit, Peak | Minimum):
            period = periods.get(limit.output, longest)
            k = math.sqrt(2.0 * math.log(max(limit.duration / period, math.e**0.5)))
            least = isinstance(limit, Minimum)
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


@dataclass(frozen=True, kw_only=True, eq=False)
class DesignBound:
    """A design next to the best that any linear controller could do.

    Attributes
    ----------
    rms
        The design's payload rms on the terms of the bounds [m]: with the noise of all sensors
        that it hears, a faint one where they are exact.
    heard, every
        The bounds for a controller with the same sensors, and with all sensors of the case.
    exact_heard, exact_every
        The sensors among either that tell of payload or ship and that the case calls exact:
        with these the bound hangs on the faint noise, and means little.
    """

    rms: float
    heard: Bound
    every: Bound
    exact_heard: tuple[str, ...]
    exact_every: tuple[str, ...]

    @property
    def factor(self) -> float:
        """The design's rms over the bound with the sensors that it hears; infinite without one."""
        return self.rms / self.heard.value if self.heard.value > 0.0 else math.inf

    @property
    def sentence(self) -> str:
        """How far the design is from the best with the sensors that it hears."""
        return _sentence(self.rms, self.heard, self.exact_heard)

    def __str__(self) -> str:
        """Return a small tree."""
        every = _sentence(self.rms, self.every, self.exact_every)
        gaps = f"duality gap {self.heard.gap:.1e} and {self.every.gap:.1e}"
        return (
            f"DesignBound: payload {1e3 * self.rms:.4g} mm rms\n"
            f"├ {self.sentence}\n"
            f"├ {every.replace('these sensors', 'all sensors of the case')}\n"
            f"├ {gaps}\n"
            f"└ {'; '.join(self.heard.assumptions[-3:])}"
        )


@one_thread()
def bound_beside(
    case: Case,
    hook: HookMotion,
    controller: LinearController,
    *,
    masses: int,
    drag: float,
    limits: Sequence[Limit],
) -> DesignBound:
    """Return a design beside the bounds of its case.

    Parameters
    ----------
    case, hook
        The case and its hook motion.
    controller
        The design's, stable on this case.
    masses, drag
        Rope masses and linear drag coefficient of the design [N s/m].
    limits
        Limits that the design had to keep; those on margins and power are left out, which
        lowers the bound.

    Returns
    -------
    DesignBound

    Raises
    ------
    SolverError
        If a Riccati equation has no stabilising solution.
    InputError
        If a limit leaves no room above the static load.
    """
    plant, shaken, added = faint_noise(
        case,
        sensed_plant(case, masses=masses, drag=drag),
        hook,
        sensed_spectra(case, hook),
        _FAINT,
    )
    command, top = command_limit(case, plant)
    plant = with_input_outputs(plant, [command])
    longest = _LONGER * float(hook.displacement.zero_crossing_period)
    named = [limit.output for limit in limits if hasattr(limit, "output")]
    signals = list(dict.fromkeys([PAYLOAD, command, *(n for n in named if n in plant.outputs)]))
    rms = _rms(plant, controller, shaken, signals)
    room = rms_limits(limits, {}, longest)
    room[command] = min(top, room.get(command, math.inf))
    if not math.isfinite(room[command]):
        room[command] = rms[command]
    # What the design itself uses is allowed: else it might not be among those compared with.
    room = {name: max(bound, rms[name]) for name, bound in room.items()}
    said = (
        f"drag {drag:.4g} N s/m; {masses} rope masses",
        "peaks as rms; no limits on margins or power",
        f"faint noise ({_FAINT:g}) of {', '.join(added)}" if added else "no faint noise",
    )
    factors = _factors(plant, shaken)

    def bound_with(names: Sequence[str], begin: Mapping[str, float] | None) -> Bound:
        return lqg_bound(
            plant.select(measurements=names),
            _heard_by(shaken, names),
            {PAYLOAD: 1.0},
            room,
            refits=_REFITS,
            assumptions=said,
            factors=factors,
            begin=begin,
        )

    heard = bound_with(controller.measurements, None)
    every = bound_with(MEASURED, heard.multipliers)
    return DesignBound(
        rms=rms[PAYLOAD],
        heard=heard,
        every=every,
        exact_heard=exact_sensors(case, controller.measurements),
        exact_every=exact_sensors(case),
    )


def exact_sensors(case: Case, measurements: Sequence[str] = MEASURED) -> tuple[str, ...]:
    """Return the sensors that tell of payload or ship and to which a case gives no noise.

    Parameters
    ----------
    case
        The case.
    measurements
        What is heard; by default everything.
    """
    payload, mru = case.sensors.payload, case.sensors.mru
    noise = {f"payload.{name}": getattr(payload, f"{name}_noise") for name in _SIGNALS}
    noise["mru.heave"] = 0.0 if mru is None else mru.noise_floor + mru.noise_fraction
    noise["mru.heave_rate"] = noise["mru.heave"]
    return tuple(name for name in measurements if noise.get(name, 1.0) == 0.0)


def _rms(
    plant: LinearPlant,
    controller: LinearController,
    spectra: Mapping[str, Any],
    signals: Sequence[str],
) -> dict[str, float]:
    """Return the rms of signals in the design's loop."""
    plant = plant.select(measurements=controller.measurements)
    controller = _proper(controller)
    law = LawMatrices.of(controller, plant)
    poles = closed_loop_poles(plant.without_delays(_PADE), controller)
    loop = Loop(
        plant=plant.response_at,
        law=law,
        marks=np.concatenate([poles, plant.poles(), np.linalg.eigvals(law.A)]),
    )
    sources = disturbances(
        _heard_by(spectra, controller.measurements), plant.independent_disturbances
    )
    inside = [banded(source) for source in sources]
    found = moments(loop, signals, inside, orders=(0,), rtol=_RTOL)
    return {name: math.sqrt(value[0]) for name, value in found.items()}


def _proper(controller: LinearController) -> LinearController:
    """Return a controller behind a first-order low-pass, if it has a direct path."""
    if not np.any(controller.D):
        return controller
    nu = len(controller.inputs)
    return replace(
        controller,
        A=np.block(
            [
                [controller.A, np.zeros((len(controller.A), nu))],
                [_PROPER * controller.C, -_PROPER * np.eye(nu)],
            ]
        ),
        B=np.vstack([controller.B, _PROPER * controller.D]),
        C=np.hstack([np.zeros_like(controller.C), np.eye(nu)]),
        D=np.zeros_like(controller.D),
    )


def _factors(plant: LinearPlant, spectra: Mapping[str, Any]) -> dict[str, SpectralFactor]:
    """Return the spectral factors of what is not white, for both bounds."""
    coloured = {name: s for name, s in spectra.items() if not isinstance(s, White)}
    sources = disturbances(coloured, plant.independent_disturbances)
    return {source.name: spectral_factor(source) for source in sources}


def _heard_by(spectra: Mapping[str, Any], measurements: Sequence[str]) -> dict[str, Any]:
    """Return the spectra without those of sensors that are not heard."""
    heard = set(measurements)
    sensors = {f"{name}{end}": name for name in MEASURED for end in ("_noise", ".faint")}
    if not heard & {"mru.heave", "mru.heave_rate"}:
        sensors["mru.error"] = "mru.heave"
        heard.discard("mru.heave")
    return {
        name: value
        for name, value in spectra.items()
        if name not in sensors or sensors[name] in heard
    }


def _sentence(rms: float, bound: Bound, exact: Sequence[str]) -> str:
    if exact:
        return f"{', '.join(exact)} exact: no meaningful bound with these sensors"
    return f"{bound.sentence(rms)}, {1e3 * bound.value:.4g} mm"
