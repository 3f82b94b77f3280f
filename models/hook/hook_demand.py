r"""Demands of a hook's motion on a winch, before any controller is thought of.

A winch that keeps the load still pays out and hauls in what the hook moves: the rope's speed and
acceleration are those of the hook, and power is the tension times the speed.  So the spectra alone
tell whether a drive is of the right size.

Statistics of a Gaussian motion, from its spectral moments m_n: standard deviation, significant
amplitude 2 sigma, mean zero-crossing period T_z, and the spectral width
:math:`\nu = \sqrt{m_0 m_2 / m_1^2 - 1}` (Longuet-Higgins 1975; 0 is a sine).  With Rayleigh
maxima the largest of N = T/T_z stays below x with the probability exp(-N exp(-x^2/(2 sigma^2))), so

.. math:: x_p = \sigma \sqrt{2 \ln N - 2 \ln \ln (1/p)},

which is the most probable maximum, :math:`\sigma\sqrt{2 \ln N}`, at p = 1/e = 0.37 (DNV-RP-C205
3.3.4).  A limit for a lift is usually set at a fractile of 0.9 or more.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..basics import THREE_HOURS, FloatArray, check_range, peak_factor, zero_crossing_period
from ..case import Case
from .hook import HookMotion

ORDERS = np.arange(7.0)[:, np.newaxis]
"""Orders of the displacement's moments that the figures of all three motions are made of (7, 1)."""

_MOTIONS = (("displacement", "m"), ("velocity", "m/s"), ("acceleration", "m/s2"))


def fractile_factor(t_z: float, probability: float, duration: float = THREE_HOURS) -> float:
    """Return what the largest maximum stays below with a probability, in units of sigma.

    Parameters
    ----------
    t_z
        Mean zero-crossing period [s], above zero; infinite for a signal at rest.
    probability
        p, between 0 and 1.
    duration
        Exposure time [s].

    Raises
    ------
    InputError
        If a figure is out of range.

    Examples
    --------
    >>> round(fractile_factor(8.0, 0.9), 3), round(fractile_factor(8.0, math.exp(-1.0)), 3)
    (4.349, 3.797)
    """
    p = check_range(
        "extremes", "fractile", probability, low=0.0, high=1.0, open_low=True, open_high=True
    )
    return math.sqrt(max(peak_factor(t_z, duration) ** 2 - 2.0 * math.log(-math.log(p)), 0.0))


@dataclass(frozen=True, kw_only=True)
class MotionFigures:
    """One motion in figures.

    Attributes
    ----------
    name, unit
        Which motion, `displacement`, `velocity` or `acceleration`, and its unit u.
    m0, m1, m2
        Its spectral moments [u^2 (rad/s)^n].
    duration
        Exposure time of the extremes [s].
    """

    name: str
    unit: str
    m0: float
    m1: float
    m2: float
    duration: float = THREE_HOURS

    @property
    def rms(self) -> float:
        """Standard deviation [u]."""
        return math.sqrt(max(self.m0, 0.0))

    @property
    def zero_crossing_period(self) -> float:
        """T_z [s]."""
        return zero_crossing_period(max(self.m0, 0.0), max(self.m2, 0.0))

    @property
    def width(self) -> float:
        """Spectral width [-]."""
        if self.m1 <= 0.0:
            return 0.0
        return math.sqrt(max(self.m0 * self.m2 / self.m1**2 - 1.0, 0.0))

    @property
    def significant_amplitude(self) -> float:
        """2 sigma [u]."""
        return 2.0 * self.rms

    @property
    def largest(self) -> float:
        """Most probable maximum in the exposure time [u]."""
        return self.rms * peak_factor(self.zero_crossing_period, self.duration)

    def fractile(self, probability: float) -> float:
        """Return what the largest maximum stays below with this probability [u]."""
        return self.rms * fractile_factor(self.zero_crossing_period, probability, self.duration)


@dataclass(frozen=True, kw_only=True, eq=False)
class HookDemand:
    """A hook's motion in figures, and what it asks of a winch that keeps the load still.

    Attributes
    ----------
    moments
        Spectral moments of order 0 to 6 of the displacement (7,) [m^2 (rad/s)^n].
    tension
        Static rope tension at the winch [N].
    duration
        Exposure time [s].
    probability
        Fractile of the extremes beside the most probable one.

    Examples
    --------
    >>> from models import load_case
    >>> demand = HookDemand.from_case(load_case("subsea-crane"))
    >>> round(demand.displacement.rms, 2), round(demand.velocity.rms, 2)
    (0.46, 0.34)
    >>> round(1e-6 * demand.peak_power, 2)  # MW
    0.67
    """

    moments: FloatArray
    tension: float
    duration: float = THREE_HOURS
    probability: float = 0.9

    @classmethod
    def from_motion(
        cls,
        hook: HookMotion,
        *,
        tension: float,
        duration: float = THREE_HOURS,
        probability: float = 0.9,
    ) -> HookDemand:
        """Return the figures of a motion.

        Parameters
        ----------
        hook
            The motion.
        tension
            Static rope tension at the winch [N].
        duration
            Exposure time [s].
        probability
            Fractile, between 0 and 1.
        """
        check_range("hook", "tension", tension, low=0.0, unit="N")
        nodes = hook.quadrature
        moments = nodes.integrate(nodes.omega**ORDERS * hook.density(nodes.omega))
        fractile_factor(1.0, probability)  # tells if it is out of range
        return cls(moments=moments, tension=tension, duration=duration, probability=probability)

    @classmethod
    def from_case(cls, case: Case, *, probability: float = 0.9) -> HookDemand:
        """Return the figures of a case's hook, with its static tension and exposure time."""
        return cls.from_motion(
            HookMotion.from_case(case),
            tension=case.static_tension,
            duration=case.limits.exposure_time,
            probability=probability,
        )

    @cached_property
    def motions(self) -> tuple[MotionFigures, ...]:
        """Displacement [m], velocity [m/s] and acceleration [m/s2]."""
        return tuple(
            MotionFigures(name=name, unit=unit, m0=m0, m1=m1, m2=m2, duration=self.duration)
            for (name, unit), (m0, m1, m2) in zip(
                _MOTIONS, (map(float, self.moments[n : n + 3]) for n in (0, 2, 4)), strict=True
            )
        )

    @property
    def displacement(self) -> MotionFigures:
        """The displacement [m]."""
        return self.motions[0]

    @property
    def velocity(self) -> MotionFigures:
        """The velocity [m/s]: the rope's speed at the winch."""
        return self.motions[1]

    @property
    def acceleration(self) -> MotionFigures:
        """The acceleration [m/s2]."""
        return self.motions[2]

    @property
    def peak_power(self) -> float:
        """Static tension times the most probable largest speed [W]."""
        return self.tension * self.velocity.largest

    @property
    def fractile_power(self) -> float:
        """Static tension times the fractile of the largest speed [W]."""
        return self.tension * self.velocity.fractile(self.probability)

    @property
    def mean_power(self) -> float:
        """Mean of the power's modulus, T sigma sqrt(2/pi): to and fro, nearly nothing net [W]."""
        return self.tension * self.velocity.rms * math.sqrt(2.0 / math.pi)
