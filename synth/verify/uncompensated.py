"""The payload's motion with the drum held, for the verification.

What a design compares itself with: the drum held, on the distributed rope or on the thesis's
one spring, from the rope's closed form written out here once more.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from models.basics import ComplexArray, FloatArray, SolverError
from models.plant import PlantData, fixed_top_modes

from .integrals import integrate, panels
from .recompute import Source, imaginary

_RTOL = 1e-8
_MODES = 40


@dataclass(frozen=True, kw_only=True, eq=False)
class HeldDrum:
    """Rope and payload with the drum held.

    Attributes
    ----------
    data
        The plant's numbers.
    source
        The hook's motion.
    """

    data: PlantData
    source: Source

    def hook_variance(self) -> float:
        """Return the variance of the hook's motion [m^2]."""
        return float(self._integral(np.ones_like, np.zeros(0, dtype=np.complex128))[0])

    def moments(self, drag: float) -> tuple[float, float]:
        """Return m0 [m^2] and m2 [m^2/s^2] of the payload's motion for a drag C [N s/m]."""

        def gain(omega: FloatArray) -> FloatArray:
            return np.asarray(np.abs(self.transfer(imaginary(omega), drag)) ** 2)

        m0, m2 = self._integral(gain, self._poles(drag))
        return float(m0), float(m2)

    def transfer(self, s: ComplexArray, drag: float) -> ComplexArray:
        """Return P/Z, (k,): 1/(cosh gamma + D l sinh(gamma)/gamma), or that of one spring."""
        data = self.data
        stretch = 1.0 + s * data.damping_time
        if data.lumping == "thesis" or data.mass_per_length == 0.0:
            spring = data.stiffness * stretch
            return np.asarray(spring / (self._mass * s**2 + drag * s + spring))
        load = (data.payload_mass * s**2 + drag * s) / (data.stiffness * stretch)
        speed = math.sqrt(data.axial_stiffness / data.mass_per_length)
        gamma = s * data.rope_length / (speed * np.sqrt(stretch))
        return np.asarray(1.0 / (np.cosh(gamma) + load * np.sinh(gamma) / gamma))

    @property
    def _mass(self) -> float:
        """Moving mass of the one-spring model [kg]."""
        rope = self.data.rope_mass if self.data.lumping == "thesis" else 0.0
        return self.data.payload_mass + rope

    def _poles(self, drag: float) -> ComplexArray:
        """Return about where the poles are [1/s], the upper half."""
        data = self.data
        if data.lumping == "thesis" or data.mass_per_length == 0.0:
            modes = np.array([math.sqrt(data.stiffness / self._mass)])
        else:
            rope = (data.axial_stiffness, data.rope_length, data.mass_per_length)
            modes = fixed_top_modes(*rope, data.payload_mass, _MODES)
        # The payload hardly moves in the higher modes, so drag only damps the first.
        decay = 0.5 * data.damping_time * modes**2
        decay[0] += 0.5 * drag / self._mass
        return np.asarray(-decay + 1j * modes, dtype=np.complex128)

    def _integral(
        self, gain: Callable[[FloatArray], FloatArray], poles: ComplexArray
    ) -> FloatArray:
        """Return the integrals of gain (k,) times the hook's density, and times omega^2."""
        if self.source.band is None:
            raise SolverError("verification: the hook's motion has no band")
        low, high = self.source.band

        def density(omega: FloatArray) -> FloatArray:
            spectrum = gain(omega) * self.source.density(omega)
            return np.stack([spectrum, omega**2 * spectrum])

        return integrate(density, panels(low, high, self.source.splits, poles), rtol=_RTOL)
