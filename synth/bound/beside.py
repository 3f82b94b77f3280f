r"""The bound beside a design: how far from the best possible it is, on the same terms.

    design -> its plant, drag, sensors, noise, limits -> bound with the sensors that it hears
                                                      -> bound with all sensors of the case
           -> its own rms on these terms              -> DesignBound

The bound is below the design by construction: both live on one plant with one linear drag, are
shaken by the same spectra, and no limit of the bound is tighter than what the design itself
uses.  So that a direct gain on white noise has a variance, the design's law stands behind a
low-pass far above its loop.  Sensors that the case calls exact, and the force on the payload,
have the faint noise of `synth.bound.case`, here in the design's rms as well.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from models.basics import White, one_thread
from models.case import Case
from models.hook import HookMotion
from models.plant import LinearPlant
from models.sensing import MEASURED, sensed_plant, sensed_spectra

from ..limits import Limit
from ..loop import Controller, closed_loop_poles, disturbances
from ..question import PAYLOAD
from ..verify import LawMatrices, Loop, moments
from .bound import Bound, lqg_bound
from .case import command_limit, faint_noise, rms_limits
from .check import banded
from .shaped import with_input_outputs
from .spectral_factor import SpectralFactor, spectral_factor

_FAINT = 1e-3  # noise of an exact sensor, see `bound_case.bound_for`
_LONGER = 2.0  # T_z of any signal over that of the hook, at most
_RTOL = 1e-7
_REFITS = 1
_PADE = 6
_PROPER = 1e4  # corner of the low-pass before a direct gain [rad/s]
_SIGNALS = ("acceleration", "velocity", "displacement")


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
    def meaningful(self) -> bool:
        """Whether every sensor that the design hears has a noise of its own."""
        return not self.exact_heard

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
    controller: Controller,
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
    plant: LinearPlant, controller: Controller, spectra: Mapping[str, Any], signals: Sequence[str]
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


def _proper(controller: Controller) -> Controller:
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
