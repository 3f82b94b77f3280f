"""`Limit`: a bound on a design, as rows of a nonlinear programme and as a figure in reports.

Each limit says the same thing twice: `rows` for the optimiser (CasADi, at most zero when it
is kept, with the bound as a symbol so that its price comes out of the same solve), and
`measure` for the report (numbers on refined frequencies, `synth.loop.assess`).  `critical` gives
the frequencies at which a design presses against it, for the exchange of nodes.

Two kinds: on the loop (`synth.limits.margin_limits`), and on signals
(`synth.limits.signal_limits`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np

from models.basics import FloatArray

if TYPE_CHECKING:
    from ..loop import Assessment, Phasor


class Symbols(Protocol):
    """The symbols of a programme that a limit's rows are made of."""

    @property
    def differences(self) -> Sequence[Phasor]:
        """1 + L of every loop at the margin frequencies."""

    @property
    def omega(self) -> Any:
        """The margin frequencies [rad/s] as a CasADi constant."""

    @property
    def omega_values(self) -> FloatArray:
        """The same in numbers, (k,)."""

    @property
    def module_margin(self) -> float:
        """Radius of the disc about -1 that a limit on the sensitivity keeps clear; 0 without."""

    def response(self, output: str, disturbance: str) -> Phasor:
        """Return the closed-loop response at the margin frequencies."""

    def moment(self, output: str, order: int) -> Any:
        """Return the spectral moment m_order of `output`."""

    def peak(self, output: str, duration: float) -> Any:
        """Return the most probable maximum of `output` in `duration` [s]."""


@dataclass(frozen=True, kw_only=True)
class Limit(ABC):
    """A bound on something that a design does.

    Parameters
    ----------
    bound
        The value that may not be exceeded (or, where `at_least` is true, undercut).
    name
        How reports call it; each kind has a default.
    """

    bound: float
    name: str = ""
    unit: str = ""

    at_least: ClassVar[bool] = False
    drive: ClassVar[bool] = False  #: depends on the size of the disturbance

    @property
    def outputs(self) -> tuple[str, ...]:
        """The outputs whose variances the limit needs."""
        return (getattr(self, "output"),) if self.drive else ()  # noqa: B009

    @abstractmethod
    def rows(self, symbols: Symbols, bound: Any) -> Any:
        """Return a CasADi vector that is at most 0 where the limit is kept."""

    @abstractmethod
    def measure(self, loop: Assessment) -> float:
        """Return the value that is compared with the bound."""

    def critical(self, loop: Assessment) -> FloatArray:
        """Return frequencies [rad/s] at which the rows should have nodes."""
        del loop
        return np.zeros(0)

    @property
    def edges(self) -> tuple[float, ...]:
        """Frequencies [rad/s] at which the limit begins or ends to hold."""
        return ()

    def worst(self, loop: Assessment) -> FloatArray:
        """Return the frequencies [rad/s] at which the limit is broken, for good."""
        del loop
        return np.zeros(0)

    def use(self, value: float) -> float:
        """Return the share of the limit that `value` uses; above 1 it is broken."""
        if self.at_least:
            return self.bound / value if value > 0.0 else np.inf
        if self.bound == 0.0:
            return 0.0 if value <= 0.0 else np.inf
        return value / self.bound
