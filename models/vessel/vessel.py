"""Heave of the hook per metre of wave, over frequency: `HeaveRao`.

A sea's spectrum times |RAO|^2 is the hook motion's spectrum.  The
vessel is one response amplitude operator (RAO) of heave at the hook, a table over frequency: given
in the case, or made of the RAOs of the vessel's six motions (`models.vessel`) for the place of the
hook and the headings of the sea.

Between the rows, amplitude and unwrapped phase are each interpolated linearly.  Linear on the
complex number would cut the corner between two rows whose phases differ and read too low an
amplitude; a smooth curve would invent a peak that nobody measured.  A line stays within the
printed values, keeps a constant amplitude constant, and gives the same numbers in every tool.

A table has ends, and a spectrum reaches beyond them.  What the RAO is out there is a choice of
the case, `below` and `beyond`, and :meth:`HeaveRao.share_outside` tells how much hangs on it.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from ..basics import (
    ComplexArray,
    FloatArray,
    InputError,
    SpectralDensity,
    adaptive_nodes,
    check_ascending,
    check_choice,
    check_finite,
    read_only,
)

BELOW = ("unity", "hold", "zero")
"""What the RAO may be below its table: linear to 1 at zero frequency, its first value, or 0."""

BEYOND = ("hold", "zero", "decay")
"""What the RAO may be above its table: its last value, 0, or falling with omega^-2."""


@dataclass(frozen=True, kw_only=True)
class OutsideShare:
    """Shares of a variance below the first and beyond the last frequency of a RAO's table [-].

    Where the RAO is cut to zero the share is what holding its end value would have given.
    """

    below: float
    beyond: float

    @property
    def total(self) -> float:
        """Both ends together [-]."""
        return self.below + self.beyond


@dataclass(frozen=True, kw_only=True, eq=False)
class HeaveRao:
    """Heave of the hook per metre of wave amplitude, a table over frequency.

    Time factor e^{+i omega t}, heave positive up, against a wave elevation that has zero phase at
    the RAO's origin.

    Raises InputError if the table is unsorted, has unequal lengths or fewer than two rows, or a
    value is negative, NaN or unknown.

    Examples
    --------
    >>> rao = HeaveRao(omega=[0.5, 1.0], amplitude=[1.0, 0.4], below="unity", beyond="decay")
    >>> [float(a) for a in abs(rao.response([0.25, 0.75, 2.0])).round(3)]
    [1.0, 0.7, 0.1]
    """

    omega: FloatArray  #: Frequencies, strictly ascending (k,), k >= 2 [rad/s].
    amplitude: FloatArray  #: Amplitudes (k,) [m/m].
    #: Phases, positive where heave leads the wave (k,) [rad]; zero if left out.
    phase: FloatArray | None = None
    #: What the operator is outside the table: one of :data:`BELOW` and one of :data:`BEYOND`.
    below: str = "unity"
    beyond: str = "decay"
    #: The field of the case that the table comes from, for messages.
    owner: str = "vessel.heave_rao"

    def __post_init__(self) -> None:
        """Check the table and make its arrays read-only."""
        owner = self.owner
        omega = check_ascending(owner, "omega", self.omega)
        if omega.ndim != 1 or omega.size < 2:
            raise InputError(f"{owner}: omega must have at least 2 rows, got {omega.size}")
        if omega[0] < 0.0:
            raise InputError(f"{owner}: omega must be at least 0 rad/s, got {omega[0]:g}")
        amplitude = check_finite(owner, "amplitude", self.amplitude)
        phase = check_finite(
            owner, "phase", np.zeros(omega.size) if self.phase is None else self.phase
        )
        for name, column in (("amplitude", amplitude), ("phase", phase)):
            if column.shape != omega.shape:
                raise InputError(
                    f"{owner}: {name} must have as many rows as omega ({omega.size}), "
                    f"got {column.size}"
                )
        if np.any(amplitude < 0.0):
            i = int(np.argmax(amplitude < 0.0))
            raise InputError(
                f"{owner}: amplitude must be at least 0 m/m, got {amplitude[i]:g} at index {i}"
            )
        check_choice("vessel", "below", self.below, BELOW)
        check_choice("vessel", "beyond", self.beyond, BEYOND)
        object.__setattr__(self, "omega", read_only(omega))
        object.__setattr__(self, "amplitude", read_only(amplitude))
        object.__setattr__(self, "phase", read_only(phase))

    def response(self, omega: npt.ArrayLike) -> ComplexArray:
        """Return hook heave per wave elevation [m/m] at frequencies, at least zero [rad/s]."""
        frequency = np.asarray(omega, dtype=np.float64)
        phases = self._phases
        phase = np.interp(frequency, self.omega, phases)
        if self.below == "unity":
            # Long waves lift the vessel as they lift the water: amplitude 1, phase 0.
            under = frequency < self.omega[0]
            phase = np.where(under, phases[0] * self._part_below(frequency), phase)
        result: ComplexArray = self.gain(frequency) * np.exp(1j * phase)
        return result

    def gain(self, omega: npt.ArrayLike) -> FloatArray:
        """Return the operator's amplitude [m/m], all that a spectrum asks for."""
        frequency = np.asarray(omega, dtype=np.float64)
        rows, amplitudes = self.omega, self.amplitude
        # np.interp holds the end values, which is `hold`.
        amplitude = np.interp(frequency, rows, amplitudes)
        under, over = frequency < rows[0], frequency > rows[-1]
        if self.below == "zero":
            amplitude = np.where(under, 0.0, amplitude)
        elif self.below == "unity":
            part = self._part_below(frequency)
            amplitude = np.where(under, 1.0 + (amplitudes[0] - 1.0) * part, amplitude)
        if self.beyond == "zero":
            amplitude = np.where(over, 0.0, amplitude)
        elif self.beyond == "decay":
            part = np.divide(rows[-1], frequency, out=np.ones_like(frequency), where=over)
            amplitude = np.where(over, amplitudes[-1] * part**2, amplitude)
        return np.asarray(amplitude, dtype=np.float64)

    def __call__(self, omega: npt.ArrayLike) -> ComplexArray:
        """Return :meth:`response`."""
        return self.response(omega)

    @property
    def splits(self) -> tuple[float, ...]:
        """Frequencies at which the operator has a kink: the table's rows [rad/s]."""
        return tuple(float(w) for w in self.omega)

    def share_outside(self, spectrum: SpectralDensity, derivative: int = 0) -> OutsideShare:
        """Return the share of the variance of derivative 0, 1 or 2 from outside the table."""
        # What is cut to zero cannot be measured; hold the end value to see what is missing.
        filled = replace(
            self,
            below="hold" if self.below == "zero" else self.below,
            beyond="hold" if self.beyond == "zero" else self.beyond,
        )

        def variance(omega: FloatArray) -> FloatArray:
            energy = np.abs(filled.response(omega)) ** 2 * spectrum.density(omega)
            return np.asarray(energy * omega ** (2 * derivative))

        nodes = adaptive_nodes(
            variance, *spectrum.band, splits=(*spectrum.splits, *self.splits), rtol=1e-8
        )
        values = variance(nodes.omega)
        first, last = self.splits[0], self.splits[-1]
        total = float(nodes.integrate(values))
        if total == 0.0:
            return OutsideShare(below=0.0, beyond=0.0)
        return OutsideShare(
            below=float(nodes.integrate(np.where(nodes.omega < first, values, 0.0))) / total,
            beyond=float(nodes.integrate(np.where(nodes.omega > last, values, 0.0))) / total,
        )

    def _part_below(self, omega: FloatArray) -> FloatArray:
        """Return frequencies over the table's first one, and 1 from there on."""
        first = self.omega[0]
        part: FloatArray = np.divide(omega, first, out=np.ones_like(omega), where=omega < first)
        return part

    @property
    def _phases(self) -> FloatArray:
        """The phases unwrapped, the first in (-pi, pi] [rad]."""
        phase = np.zeros_like(self.omega) if self.phase is None else np.unwrap(self.phase)
        turns = math.ceil((phase[0] - math.pi) / (2.0 * math.pi))
        return np.asarray(phase - 2.0 * math.pi * turns)
