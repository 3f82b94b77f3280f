"""`Limit`: a bound on a design, as rows of a nonlinear programme and as a figure in reports.

Each limit says the same thing twice: `rows` for the optimiser (at most zero when it is kept,
of dual numbers so that their slopes come along), and
`measure` for the report (numbers on refined frequencies, `synth.loop.assess`).

On the loop: stability margins (`synth.limits.margin_limits`), sizes at every frequency
(`synth.limits.frequency_limits`) and poles (`synth.limits.pole_limits`); and on signals
(`synth.limits.signal_limits`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np

from models.basics import BoolArray, FloatArray

if TYPE_CHECKING:
    from ..loop import Assessment

#: From frequencies [rad/s] and what a curve is there to what is to be small, (k,) each.
Size = Callable[[FloatArray, Any], FloatArray]


class Symbols(Protocol):
    """What a limit's rows are made of: arrays, or `synth.loop.Dual` arrays with their slopes.

    Without a batch the arrays are vectors; of many parameter vectors they have leading axes.
    """

    @property
    def differences(self) -> Sequence[Any]:
        """1 + L of every loop at the margin frequencies, (k,) each."""

    def curves(self, limit: Limit) -> Sequence[tuple[FloatArray, Any]]:
        """Return the curves that a limit is on: of its channel, or 1 + L of every loop.

        Frequencies [rad/s] and values of pieces of them, (k,) each: at the margin frequencies and,
        where margins are held as they are measured, at the peaks between that a limit `followed`.
        """

    @property
    def poles(self) -> tuple[Any, BoolArray, BoolArray]:
        """The closed loop's poles [1/s], (n,), and which count for damping and for frequency."""

    @property
    def on_axis(self) -> Any | None:
        """L of all loops where it crosses the negative real axis, (c,); None on a grid."""

    @property
    def turning_delays(self) -> Any | None:
        """Delay at each crossover that turns L to -1 [s], (c,); None on a grid."""

    @property
    def omega(self) -> FloatArray:
        """The margin frequencies [rad/s], (k,)."""

    @property
    def module_margin(self) -> float:
        """Radius of the disc about -1 that a limit on the sensitivity keeps clear; 0 without."""

    def moment(self, output: str, order: int) -> Any:
        """Return the spectral moment m_order of `output`, (1,), or by combination of signs."""

    def covariance(self, one: str, other: str) -> Any:
        """Return the covariance of two outputs, (1,), or by combination of signs."""

    def peak(self, output: str, duration: float) -> Any:
        """Return the most probable maximum of `output` in `duration` [s], as its moments are."""

    @property
    def signed(self) -> Symbols:
        """The same by combination of the signs that sensors' errors may have, or this."""


@dataclass(frozen=True, kw_only=True)
class Limit(ABC):
    """A bound on something that a design does."""

    bound: float  #: The value that may not be exceeded (or, where `at_least` is true, undercut).
    name: str = ""  #: How reports call it; each kind has a default.
    unit: str = ""

    at_least: ClassVar[bool] = False
    drive: ClassVar[bool] = False  #: depends on the size of the disturbance

    @property
    def outputs(self) -> tuple[str, ...]:
        """The outputs whose variances the limit needs."""
        return (getattr(self, "output"),) if self.drive else ()  # noqa: B009

    @property
    def channel(self) -> tuple[str, str] | None:
        """Output and disturbance of the closed-loop response that the limit is on, if any."""
        return None

    @property
    def followed(self) -> tuple[Size, float] | None:
        """A size of the curve that the limit is on, and above what its peaks are followed."""
        return None

    @property
    def signals(self) -> tuple[str, ...]:
        """The outputs that the limit speaks of."""
        return self.outputs if self.channel is None else (self.channel[0],)

    @abstractmethod
    def rows(self, symbols: Symbols, bound: Any) -> Any:
        """Return a vector that is at most 0 where the limit is kept."""

    @abstractmethod
    def measure(self, loop: Assessment) -> float:
        """Return the value that is compared with the bound."""

    def worst_rows(self, symbols: Symbols, bound: Any) -> Any:
        """Return the rows for whatever signs sensors' errors may have."""
        return self.rows(symbols.signed if self.drive else symbols, bound)

    def worst(self, loop: Assessment) -> float:
        """Return what is measured with the worst signs that sensors' errors may have."""
        if not self.drive:
            return self.measure(loop)
        found = [self.measure(one) for one in loop.members]
        return min(found) if self.at_least else max(found)

    @property
    def edges(self) -> tuple[float, ...]:
        """Frequencies [rad/s] at which the limit begins or ends to hold."""
        return ()

    def use(self, value: float) -> float:
        """Return the share of the limit that `value` uses; above 1 it is broken."""
        if self.at_least:
            return self.bound / value if value > 0.0 else np.inf
        if self.bound == 0.0:
            return 0.0 if value <= 0.0 else np.inf
        return value / self.bound
