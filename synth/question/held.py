"""Rope and payload with the drum held: responses, poles, drag, and what a sea makes of them.

What every design is measured against, and what a winch with its brake on does.  All of it is on the
exact distributed rope (the lumped one spring with the thesis's lumping), linear in the drag.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from models.basics import (
    ComplexArray,
    FloatArray,
    adaptive_nodes,
    peak_factor,
    zero_crossing_period,
)
from models.case import Case
from models.hook import HookMotion
from models.plant import PlantData, rope_transfers, settled_drag

from ..limits import LOWER_TENSION, PAYLOAD

_SHOWN = (PAYLOAD, "rope.tension", LOWER_TENSION)
_ORDERS = np.array([0.0, 2.0])[:, np.newaxis, np.newaxis]  # of the spectral moments
_RTOL = 1e-8  # of those
_STEPS, _ROUNDS = 8, 30  # in which drag is raised, and of Newton's method at most at each
_ARRIVED, _FINE = 1e-12, 1e-6  # relative, of a last step of it, and of a difference for the slope


@dataclass(frozen=True, kw_only=True, eq=False)
class HeldMotion:
    """Payload and rope in a sea with the drum held, as Gaussian signals.

    They are ``payload.displacement`` [m], and ``rope.tension`` at the drum, of each fall, and
    ``rope.lower_tension`` at the load [N].
    """

    #: Spectral moments m_0 and m_2 of each signal; infinite where nothing damps the payload.
    moments: Mapping[str, tuple[float, float]]

    @property
    def members(self) -> tuple["HeldMotion", ...]:
        """The motion itself: no sensor's error is in it."""
        return (self,)

    def sigma(self, output: str) -> float:
        """Return the standard deviation of a signal, in its unit."""
        return math.sqrt(self.moments[output][0])

    def mean_period(self, output: str) -> float:
        """Return the mean zero-crossing period of a signal [s]; infinite without a motion."""
        m0, m2 = self.moments[output]
        return zero_crossing_period(m0, m2) if math.isfinite(m0) else math.inf

    def peak(self, output: str, duration: float) -> float:
        """Return the most probable maximum of a signal in `duration` [s], without its mean."""
        return peak_factor(self.mean_period(output), duration) * self.sigma(output)


def held_motion(data: PlantData, hook: HookMotion, drag: float) -> HeldMotion:
    """Return payload and rope in a sea with the drum held, for a drag C [N s/m]."""
    poles = held_poles(data, drag, hook.band[1])
    if poles[0].real >= 0.0:  # an undamped resonance has no stationary motion
        return HeldMotion(moments=dict.fromkeys(_SHOWN, (math.inf, math.inf)))

    def integrands(omega: FloatArray) -> FloatArray:
        found = held_responses(data, np.asarray(1j * omega, dtype=np.complex128), drag)
        shown = np.abs(np.array([found[name][0] for name in _SHOWN])) ** 2
        both = omega**_ORDERS * shown * hook.density(omega)
        return np.asarray(both.reshape(-1, omega.size))

    nodes = adaptive_nodes(
        integrands,
        *hook.band,
        splits=hook.splits,
        poles=[complex(pole) for pole in poles if pole.real < 0.0],
        rtol=_RTOL,
    )
    m0, m2 = nodes.integrate(integrands(nodes.omega)).reshape(2, -1).tolist()
    return HeldMotion(moments=dict(zip(_SHOWN, zip(m0, m2, strict=True), strict=True)))


def uncompensated(
    case: Case, data: PlantData, hook: HookMotion, near: float = 0.0
) -> tuple[float, float]:
    """Return drag coefficient [N s/m] and rms payload motion [m] with the drum held.

    On the exact distributed rope (the lumped one spring with the thesis's lumping); drag that
    is stochastically linearised agrees with the motion.  It is looked for `near` a value, if given.
    """

    def about(C: float) -> Callable[[float], tuple[float, float]]:
        """Return a function of the drag to rms motion and velocity, on nodes that suit one."""
        poles = held_poles(data, C, hook.band[1])
        if poles[0].real >= 0.0:
            return lambda other: (math.inf, math.inf)  # undamped resonance: no stationary motion

        def responses(omega: FloatArray) -> tuple[ComplexArray, ComplexArray, FloatArray]:
            s = np.asarray(1j * omega, dtype=np.complex128)
            P_Y, P_F, *_ = held_transfers(data, s, C)
            return P_Y, s * P_F, np.array([np.ones_like(omega), omega**2]) * hook.density(omega)

        def spectra(omega: FloatArray) -> FloatArray:
            P_Y, _, shaken = responses(omega)
            return np.asarray(np.abs(P_Y) ** 2 * shaken)

        nodes = adaptive_nodes(
            spectra,
            *hook.band,
            splits=hook.splits,
            poles=[complex(pole) for pole in poles if pole.real < 0.0],
            rtol=1e-9,
        )
        moved, slowed, shaken = responses(nodes.omega)
        weights = shaken * nodes.weights

        def rms(other: float) -> tuple[float, float]:
            # More drag is a force on the payload that its velocity makes.
            variances = weights @ np.abs(moved / (1.0 + (other - C) * slowed)) ** 2
            motion, velocity = np.sqrt(variances).tolist()
            return motion, velocity

        return rms

    fixed = case.payload.fixed_drag
    if fixed is None and data.quadratic_drag > 0.0:
        tried: list[Callable[[float], tuple[float, float]]] = []

        def velocity(C: float) -> Callable[[float], float]:
            tried.append(rms := about(C))
            return lambda other: rms(other)[1]

        fixed = settled_drag(data.quadratic_drag, velocity, near)
        return fixed, tried[-1](fixed)[0]
    fixed = fixed or 0.0
    return fixed, about(fixed)(fixed)[0]


def held_poles(data: PlantData, drag: float, highest: float) -> ComplexArray:
    """Return about where the poles are with the drum held [1/s], the upper half.

    The drag coefficient [N s/m] damps the first mode, as the payload hardly moves in others.  Modes
    are wanted up to the highest frequency [rad/s].
    """
    count = 1 if math.isinf(data.sling_stiffness) else 2
    if not data.one_spring:
        wave = math.sqrt(data.axial_stiffness / data.mass_per_length)
        count += int(highest / (math.pi / data.rope_length * wave))
    poles = data.damped_modes(count)
    poles[0] -= 0.5 * drag / data.hung_mass
    return poles


def held_modes(data: PlantData, drag: float, count: int) -> ComplexArray:
    """Return where the poles of the lowest modes are with the drum held [1/s], the upper half.

    Zeros of Y/P in the rope's closed form, by Newton's method: of its damping and of the drag
    coefficient [N s/m] nothing is neglected.  The drag is raised in steps, so that each mode is
    followed from that of `PlantData.damped_modes`; (modes,), as many of `count` as there are.  A
    pole on the real axis is that of a mode which drag keeps from swinging.
    """
    begin = s = data.damped_modes(count)

    def excess(s: ComplexArray, drag: float) -> ComplexArray:
        found = 1.0 / held_transfers(data, s, drag)[0]
        return np.where(np.isfinite(found), found, 0.0)  # P/Y has no value right at a pole

    with np.errstate(all="ignore"):
        for share in np.linspace(0.0, 1.0, _STEPS + 1):
            for _ in range(_ROUNDS):
                step = _FINE * s
                slope = excess(s + step, share * drag) - excess(s - step, share * drag)
                move = 2.0 * step * excess(s, share * drag) / slope
                s = s - move
                if np.all(np.abs(move) <= _ARRIVED * np.abs(s)):
                    break
    # What wave and load swallow altogether is nowhere to be found: told as without drag.
    return np.where(np.isfinite(s), s.real + 1j * np.abs(s.imag), begin)


def held_transfers(
    data: PlantData, s: ComplexArray, drag: float
) -> tuple[ComplexArray, ComplexArray, ComplexArray, ComplexArray]:
    """Return P/Y, P/F, T/Y and T/F with the drum held: one spring, or the exact rope."""
    return rope_transfers(data, s, drag, spring=data.lumping == "thesis")


def held_responses(
    data: PlantData, s: ComplexArray, drag: float
) -> dict[str, tuple[ComplexArray, ComplexArray]]:
    """Return what payload and rope do with the drum held at points `s` (k,) [1/s], by signal.

    By the hook's heave [m] and by a force on the payload [N], (k,) each: displacement and velocity
    of the payload, the tension at the drum, of each fall and with the mean of the sheaves' losses,
    and that at the load.  The drag coefficient is C [N s/m].
    """
    P_Y, P_F, T_Y, T_F = held_transfers(data, s, drag)
    reeved = data.mean_sheaves_factor / data.falls
    D = data.payload_mass * s**2 + drag * s
    return {
        PAYLOAD: (P_Y, P_F),
        "payload.velocity": (s * P_Y, s * P_F),
        "rope.tension": (reeved * T_Y, reeved * T_F),
        LOWER_TENSION: (D * P_Y, D * P_F - 1.0),
    }


def locked_response(case: Case, omega: FloatArray, drag: float) -> ComplexArray:
    """Return P/Z with the drum held at frequencies [rad/s], (k,), for a drag C [N s/m]."""
    s = 1j * np.asarray(omega, dtype=np.complex128)
    return held_transfers(PlantData.from_case(case), s, drag)[0]
