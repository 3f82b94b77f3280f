"""Demands of a hook's motion on a winch, before any controller is thought of.

A winch that keeps the load still pays out and hauls in what the hook moves: the rope's speed and
acceleration are those of the hook, and power is the tension times the speed.  So the spectra alone
tell whether a drive is of the right size.  A limit for a lift is usually set at a fractile of 0.9
or more of the largest speed: the most probable one is exceeded in six exposures of ten.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

from ..basics import THREE_HOURS, FloatArray, SpectrumStatistics, fractile_factor
from ..case import Case
from .hook import HookMotion, motion_statistics


@dataclass(frozen=True, kw_only=True, eq=False)
class HookDemand:
    """A hook's motion in figures, and what it asks of a winch that keeps the load still.

    Examples
    --------
    >>> from models import load_case
    >>> demand = HookDemand.from_case(load_case("subsea-crane"))
    >>> round(demand.displacement.rms, 2), round(demand.velocity.rms, 2)
    (0.46, 0.34)
    >>> round(1e-6 * demand.peak_power, 2)  # MW
    0.67
    """

    #: Spectral moments of order 0 to 8 of the displacement (9,) [m^2 (rad/s)^n].
    moments: FloatArray
    tension: float  #: Static tension of all falls [N].
    #: What a drive that hauls feels of it, with losses and the load's uncertain weight [N].
    drive_tension: float = math.nan
    duration: float = THREE_HOURS  #: Exposure time [s].
    probability: float = 0.9  #: Fractile of the extremes beside the most probable one.

    @classmethod
    def from_case(
        cls, case: Case, *, probability: float = 0.9, hook: HookMotion | None = None
    ) -> HookDemand:
        """Return the figures of a case's hook, with its static tension and exposure time.

        The hook's motion is that of the case, unless it is known already.

        Raises InputError if the probability does not lie between 0 and 1.
        """
        fractile_factor(1.0, probability)  # tells if it is out of range
        return cls(
            moments=(HookMotion.from_case(case) if hook is None else hook).moments,
            tension=case.hung_weight,
            drive_tension=case.static_torque_budget * case.winch.gearbox.ratio / case.haul_radius,
            duration=case.limits.exposure_time,
            probability=probability,
        )

    @cached_property
    def motions(self) -> tuple[SpectrumStatistics, ...]:
        """Displacement [m], velocity [m/s] and acceleration [m/s2]."""
        return motion_statistics(self.moments)

    @property
    def displacement(self) -> SpectrumStatistics:
        """The displacement [m]."""
        return self.motions[0]

    @property
    def velocity(self) -> SpectrumStatistics:
        """The velocity [m/s]: the rope's speed at the winch."""
        return self.motions[1]

    @property
    def acceleration(self) -> SpectrumStatistics:
        """The acceleration [m/s2]."""
        return self.motions[2]

    @property
    def peak_power(self) -> float:
        """Static tension times the most probable largest speed [W]."""
        return self.tension * self.velocity.most_probable_maximum(self.duration)

    @property
    def drive_power(self) -> float:
        """What the drive has to give at that speed, losses and uncertain weight included [W]."""
        return self.drive_tension * self.velocity.most_probable_maximum(self.duration)

    @property
    def fractile_power(self) -> float:
        """Static tension times the fractile of the largest speed [W]."""
        return self.tension * self.velocity.fractile(self.probability, self.duration)

    @property
    def mean_power(self) -> float:
        """Mean of the power's modulus, T sigma sqrt(2/pi) [W]; what is hauled is paid out again."""
        return self.tension * self.velocity.rms * math.sqrt(2.0 / math.pi)
