"""A measured spectrum: a table over frequency, linear between its rows.

A line between two rows stays within what was measured and adds no peak.  Below its first row the
spectrum is zero.  Above its last one it is what the case chooses: `decay` falls as omega^-5, the
tail of every wind sea (buoys stop at 0.4 to 0.6 Hz, and a resonant loop still answers beyond), and
`zero` is nothing.  `tail_share` tells how much hangs on that.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..basics import FloatArray, InputError, ascending_fault, check_choice, check_finite

BEYOND = ("decay", "zero")
"""What a measured spectrum may be above its last row: falling with omega^-5, or zero."""

MOST_ROWS = 1000  #: Rows that a table may have: each one begins a panel of every quadrature.

_TAIL_END = 60.0


@dataclass(frozen=True, kw_only=True)
class SpectrumTable:
    """Variance densities at frequencies.

    Raises InputError if the table is unsorted, too short or too long, holds a negative or no
    number, or nothing.

    Examples
    --------
    >>> table = SpectrumTable(omega=(0.5, 1.0, 1.5), density=(0.0, 0.4, 0.0))
    >>> table.variance
    0.2
    """

    #: Frequencies, strictly ascending from zero or above (k,), 3 to 1000 of them [rad/s].
    omega: tuple[float, ...]
    density: tuple[float, ...]  #: S at each (k,), at least zero [m^2 s/rad].
    beyond: str = "decay"  #: One of :data:`BEYOND`.

    def __post_init__(self) -> None:
        """Check the table and hold it as tuples of floats."""
        owner = "measured spectrum"
        omega = _flat(owner, "omega", self.omega)
        density = _flat(owner, "density", self.density)
        if not 3 <= omega.size <= MOST_ROWS:
            raise InputError(f"{owner}: must have 3 to {MOST_ROWS} rows, got {omega.size}")
        for name, fault in row_faults(omega, density):
            raise InputError(f"{owner}: {f'{name} {fault}'.lstrip()}")
        if omega[0] < 0.0 or omega[-1] > _TAIL_END:
            wrong = omega[0] if omega[0] < 0.0 else omega[-1]
            raise InputError(f"{owner}: omega must be in [0, {_TAIL_END:g}] rad/s, got {wrong:g}")
        if np.any(density < 0.0):
            i = int(np.argmax(density < 0.0))
            raise InputError(
                f"{owner}: density must be at least 0 m^2 s/rad, got {density[i]:g} at index {i}"
            )
        check_choice(owner, "beyond", self.beyond, BEYOND)
        object.__setattr__(self, "omega", tuple(omega.tolist()))
        object.__setattr__(self, "density", tuple(density.tolist()))

    def __call__(self, omega: FloatArray) -> FloatArray:
        """Return the density at frequencies of any shape [m^2 s/rad]."""
        rows, values = self._arrays
        result: FloatArray = np.interp(omega, rows, values, left=0.0, right=0.0)
        if self.beyond == "decay":
            tail = values[-1] * (rows[-1] / np.maximum(omega, rows[-1])) ** 5
            result = np.where((omega > rows[-1]) & (omega <= _TAIL_END), tail, result)
        return result

    @property
    def band(self) -> tuple[float, float]:
        """Band that holds the spectrum [rad/s]: the table's, and the tail's where it has one."""
        # Integrals are taken in log-frequency, which has no zero.
        low = self.omega[0] if self.omega[0] > 0.0 else 1e-3 * self.omega[1]
        tail = self.beyond == "decay" and self.density[-1] > 0.0
        return low, _TAIL_END if tail else self.omega[-1]

    @property
    def peak_frequency(self) -> float:
        """Frequency of the highest row [rad/s]."""
        at = int(np.argmax(self._arrays[1]))
        return self.omega[at] or 0.5 * self.omega[1]

    @cached_property
    def variance(self) -> float:
        """Variance of the elevation, tail included [m^2]: the integral, exactly."""
        rows, values = self._arrays
        return float(np.trapezoid(values, rows)) + self._tail

    @property
    def tail_share(self) -> float:
        """Share of the variance that lies above the last row [-]."""
        return self._tail / self.variance

    @cached_property
    def _arrays(self) -> tuple[FloatArray, FloatArray]:
        return np.array(self.omega), np.array(self.density)

    @property
    def _tail(self) -> float:
        if self.beyond == "zero":
            return 0.0
        last = self.omega[-1]
        return 0.25 * self.density[-1] * last * (1.0 - (last / _TAIL_END) ** 4)


def row_faults(omega: FloatArray, density: FloatArray) -> list[tuple[str, str]]:
    """Return what is wrong with rows [rad/s], [m^2 s/rad]: a column, or none, and words."""
    fault = ascending_fault(omega)
    if fault:
        return [("omega", fault)]
    if density.size != omega.size:
        text = f"must have as many rows as omega ({omega.size}), got {density.size}"
        return [("density", text)]
    variance = float(np.trapezoid(density, omega))
    if not 0.0 < variance < math.inf:
        return [("", f"must hold some energy, got a variance of {variance:g}")]
    return []


def _flat(owner: str, name: str, values: Sequence[float]) -> FloatArray:
    array = check_finite(owner, name, values)
    if array.ndim != 1:
        raise InputError(f"{owner}: {name} must be a list of numbers, got shape {array.shape}")
    return array
