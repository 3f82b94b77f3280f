"""Limits on signals of motor, drive and rope: rms, continuous rating, peak, minimum, power.

Peaks and continuous ratings follow one rule: |static| + loss + k sigma <= bound, with
k = sqrt(2 ln(T / T_z)), the most probable maximum of a Gaussian signal of mean period T_z in
the time T (Rice 1945, Longuet-Higgins 1952), of a case the time whose most probable maximum is
exceeded as seldom as it asks (`models.rig.Limits.equivalent_exposure`);
sqrt(static^2 + loss^2 + sigma^2) <= rating.  The loss is what switches with the direction of
motion: friction and the gear's losses carry a signal so far to either side of its static value,
never further, whatever the sea.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np
from scipy.special import ndtr
from typing_extensions import override

from models.basics import check_range

from ..loop import at_least, mapped
from .limits import Limit, Symbols

if TYPE_CHECKING:
    from ..loop import Assessment

_STILL = 1e-12  # a speed's variance over the base speed squared that is none


class Peaks(Protocol):
    """What a largest value is measured of: a loop, a search's symbols, or seas by their moments."""

    def peak(self, output: str, duration: float) -> Any:
        """Return the most probable maximum of `output` in `duration` [s], without its mean."""


@dataclass(frozen=True, kw_only=True)
class _OfOneSignal(Limit):
    """A limit on one output, by default named after it and the limit's kind."""

    output: str
    drive: ClassVar[bool] = True
    kind: ClassVar[str]

    def __post_init__(self) -> None:
        if not self.name:
            object.__setattr__(self, "name", f"{self.output}.{self.kind}")


@dataclass(frozen=True, kw_only=True)
class Rms(_OfOneSignal):
    """Standard deviation of `output` at most `bound`."""

    kind: ClassVar[str] = "rms"

    def __post_init__(self) -> None:
        check_range("Rms", "bound", self.bound, low=0.0, open_low=True)
        super().__post_init__()

    @override
    def rows(self, symbols: Symbols, bound: Any) -> Any:
        return symbols.moment(self.output, 0) / (bound * bound) - 1.0

    @override
    def measure(self, loop: Assessment) -> float:
        return loop.sigma(self.output)


@dataclass(frozen=True, kw_only=True)
class Continuous(_OfOneSignal):
    """sqrt(static^2 + loss^2 + sigma^2) of `output` at most the rating `bound`."""

    static: float = 0.0
    loss: float = 0.0
    kind: ClassVar[str] = "continuous"

    @override
    def rows(self, symbols: Symbols, bound: Any) -> Any:
        steady = self.static**2 + self.loss**2
        return (steady + symbols.moment(self.output, 0)) / (bound * bound) - 1.0

    @override
    def measure(self, loop: Assessment) -> float:
        return math.hypot(self.static, self.loss, loop.sigma(self.output))


@dataclass(frozen=True, kw_only=True)
class Thermal(Continuous):
    """E[(T/T_c)^2] at most one, for a continuous torque T_c that falls above a speed.

    T_c is `bound` up to the motor speed `base_speed` [rad/s] and falls as 1/speed above (constant
    power).  Of torque and speed that are Gaussian together, the speed of standard deviation
    base_speed/x,

        E[max(1, u^2/x^2)]     = 1 + 2 (f/x + Q (1/x^2 - 1)),
        E[u^2 max(1, u^2/x^2)] = 1 + 2 (3 f/x + Q (3/x^2 - 1))

    with u of standard deviation one, f its density and Q its tail beyond x.  The second is the
    factor on that part of the torque's variance that goes with the speed, their covariance squared
    over the speed's variance; the first that on all the rest and on the mean square, as an even
    function of the speed has no mean product with the torque itself.  Where the speed hardly ever
    passes the base speed both are one.
    """

    speed: str = "motor.speed"
    base_speed: float

    @property
    @override
    def outputs(self) -> tuple[str, ...]:
        return (self.output, self.speed)

    @override
    def rows(self, symbols: Symbols, bound: Any) -> Any:
        torque, speed = symbols.moment(self.output, 0), symbols.moment(self.speed, 0)
        both = symbols.covariance(self.output, self.speed)
        return self._heat(torque, speed, both) / (bound * bound) - 1.0

    @override
    def measure(self, loop: Assessment) -> float:
        torque, speed = loop.sigma(self.output) ** 2, loop.sigma(self.speed) ** 2
        if not np.isfinite(torque + speed):
            return np.inf
        both = loop.covariance(self.output, self.speed)
        return float(np.sqrt(self._heat(torque, np.array(speed), both)))

    def _heat(self, torque: Any, speed: Any, both: Any) -> Any:
        """Return the mean square over T_c, times `bound` squared, of variances and covariance."""
        share = speed / self.base_speed**2
        along = both * both / (at_least(share, _STILL) * self.base_speed**2)
        across = self.static**2 + self.loss**2 + torque - along
        return across * mapped(share, *_STEADY) + along * mapped(share, *_MOVING)


def _tail(share: Any) -> tuple[Any, Any, Any]:
    """Return x, density and tail beyond it of a speed's variance over the base speed squared."""
    x = 1.0 / np.sqrt(np.maximum(share, _STILL))
    return x, np.exp(-0.5 * x * x) / np.sqrt(2.0 * np.pi), ndtr(-x)


def _steady(share: Any) -> Any:
    x, f, Q = _tail(share)
    return 1.0 + 2.0 * (f / x + Q * (share - 1.0))


def _steady_slope(share: Any, _: Any) -> Any:
    x, f, Q = _tail(share)
    return 2.0 * (x * f + Q)


def _moving(share: Any) -> Any:
    x, f, Q = _tail(share)
    return 1.0 + 2.0 * (3.0 * f / x + Q * (3.0 * share - 1.0))


def _moving_slope(share: Any, _: Any) -> Any:
    x, f, Q = _tail(share)
    return 2.0 * ((x**3 + 3.0 * x) * f + 3.0 * Q)


# Factors on the mean square and on the variance, and their slopes, over the speed's variance in
# units of the base speed squared.
_STEADY, _MOVING = (_steady, _steady_slope), (_moving, _moving_slope)


@dataclass(frozen=True, kw_only=True)
class Peak(_OfOneSignal):
    """|static| + loss + k sigma of `output` at most `bound` in `duration` [s]."""

    static: float = 0.0
    loss: float = 0.0
    duration: float = 10800.0
    kind: ClassVar[str] = "peak"

    def __post_init__(self) -> None:
        check_range("Peak", "duration", self.duration, low=0.0, unit="s", open_low=True)
        super().__post_init__()

    @override
    def rows(self, symbols: Symbols, bound: Any) -> Any:
        return self.measure(symbols) / bound - 1.0

    @override
    def measure(self, loop: Peaks) -> Any:
        return abs(self.static) + self.loss + loop.peak(self.output, self.duration)


@dataclass(frozen=True, kw_only=True)
class Amplification(Peak):
    """(static + loss + k sigma)/static of `output` at most `bound`: a dynamic amplification factor.

    The largest tension over that at rest (the DAF of DNV-RP-N103).
    """

    kind: ClassVar[str] = "daf"

    @override
    def measure(self, loop: Peaks) -> Any:
        return super().measure(loop) / self.static


@dataclass(frozen=True, kw_only=True)
class Minimum(_OfOneSignal):
    """static - loss - k sigma of `output` at least `bound` in `duration` [s]: a taut rope."""

    static: float
    loss: float = 0.0
    duration: float = 10800.0
    at_least: ClassVar[bool] = True
    kind: ClassVar[str] = "least"

    @override
    def rows(self, symbols: Symbols, bound: Any) -> Any:
        return (bound - self.measure(symbols)) / abs(self.static)

    @override
    def measure(self, loop: Peaks) -> Any:
        return self.static - self.loss - loop.peak(self.output, self.duration)

    @override
    def use(self, value: float) -> float:
        # What is used of the room between the static value and the bound.
        room = self.static - self.bound
        return (self.static - value) / room if room > 0.0 else np.inf


@dataclass(frozen=True, kw_only=True)
class Power(Limit):
    """(|static| + loss + k_T sigma_T) k_Omega sigma_Omega, torque times speed, at most `bound` [W].

    Their peaks need not coincide, so the value is an upper bound of the shaft power on the
    k-sigma box of torque and speed: on the safe side of a drive's constant-power region.
    """

    torque: str
    speed: str
    static: float = 0.0
    loss: float = 0.0
    duration: float = 10800.0
    name: str = "motor.power.peak"
    unit: str = "W"
    drive: ClassVar[bool] = True

    @property
    @override
    def outputs(self) -> tuple[str, ...]:
        return (self.torque, self.speed)

    @override
    def rows(self, symbols: Symbols, bound: Any) -> Any:
        return self.measure(symbols) / bound - 1.0

    @override
    def measure(self, loop: Peaks) -> Any:
        torque = abs(self.static) + self.loss + loop.peak(self.torque, self.duration)
        return torque * loop.peak(self.speed, self.duration)


@dataclass(frozen=True, kw_only=True)
class Breakdown(Power):
    """(|static| + loss + k_T sigma_T) (k_Omega sigma_Omega/base_speed)^2 at most `bound` [N m].

    The breakdown torque of an induction motor, `bound` at `base_speed` [rad/s], falls as 1/speed^2:
    like the power it is held at the corner of the k-sigma box of torque and speed.
    """

    base_speed: float
    name: str = "motor.torque.breakdown"
    unit: str = "N m"

    @override
    def measure(self, loop: Peaks) -> Any:
        fast = loop.peak(self.speed, self.duration) / self.base_speed
        return super().measure(loop) / self.base_speed * fast
