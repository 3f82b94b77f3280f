"""Limits of the design, and the gains, as sections of the case file."""

import math
from collections.abc import Iterator
from typing import Annotated, Literal

from ..casefile import Quantity, Section

MOST_PROBABLE = 1.0 - math.exp(-1.0)
"""Probability that the largest of many maxima exceeds the most probable one, 0.632."""

_Length = Annotated[float, Quantity("length", -12000.0, 12000.0)]


class LowFrequencyLimit(Section):
    """How still the payload must be held in slow motion of the hook (swell, tide)."""

    below: Annotated[float, Quantity("frequency", 0.0, 10.0, open_low=True)]
    """Frequency up to which the limit holds."""
    ratio: Annotated[float, Quantity("gain", 0.0, 10.0, open_low=True)]
    """Largest payload motion over hook motion, |P/Z|."""


class Limits(Section):
    """What a design has to respect."""

    max_sensitivity: Annotated[float, Quantity("gain", 1.0, 100.0, open_low=True)] = 2.0
    """Largest sensitivity peak M_s = max |1/(1 + L)|."""
    gain_margin_up: Annotated[float, Quantity("gain", 1.0, 1000.0, open_low=True)] | None = None
    """Factor by which the loop gain may grow without instability."""
    gain_margin_down: Annotated[float, Quantity("gain", 0.0, 1.0, open_high=True)] | None = None
    """Factor to which the loop gain may fall without instability (0.5 is 6 dB down)."""
    delay_margin: Annotated[float, Quantity("time", 0.0, 60.0)] | None = None
    """Delay that may be added to the loop without instability."""
    low_frequency: LowFrequencyLimit | None = None
    """How still the payload must be held in slow motion of the hook."""
    roll_off: Annotated[float, Quantity("gain", 0.0, 1.0, open_low=True)] | None = None
    """Largest loop gain |L| beyond the rope modes that the design plant holds."""
    drive: Literal["enforce", "report"] = "enforce"
    """Whether torque, speed, voltage, current and power limits bind the design or are only
    reported."""
    exposure_time: Annotated[float, Quantity("time", 60.0, 1e8)] = 10800.0
    """Time for which largest values are taken."""
    exceedance: Annotated[float, Quantity("ratio", 0.0, 1.0, open_low=True, open_high=True)] = (
        MOST_PROBABLE
    )
    """Probability that a largest value is exceeded in that time; by default that of the most
    probable maximum, 1 - 1/e = 0.632."""
    minimum_tension: Annotated[float, Quantity("force", 0.0, 1e9)] | None = None
    """Smallest rope tension, so that the rope does not go slack; by default a tenth of the least
    submerged weight (after the criterion of DNV-RP-N103 for the wave zone, by analogy at the
    load's end), of all falls together. At the payload the least weight counts."""
    tension_ends: Literal["both", "drum"] = "both"
    """Where `minimum_tension` holds: at both ends of the rope, or, as in older designs, at the drum
    alone, whose share of the rope's weight hides a slack lower end, and only if it is given."""
    rope_tension_peak: Annotated[float, Quantity("force", 0.0, 1e9, open_low=True)] | None = None
    """Largest rope tension, of each fall, such as the breaking load over a safety factor."""
    stroke: tuple[_Length, _Length] | None = None
    """Lowest and highest haul of the drum while it holds the load, as the load moves with it (the
    rope taken in over falls); negative is paid out. It is
    for the simulation: a design does not know it."""

    @property
    def equivalent_exposure(self) -> float:
        """Time whose most probable maximum is exceeded in `exposure_time` as often as asked [s].

        With Rayleigh maxima the largest of N = T/T_z is above k sigma with the probability
        p = 1 - exp(-N exp(-k^2/2)), so k = sqrt(2 ln(N / -ln(1 - p))): the most probable maximum
        of the time T / -ln(1 - p) (DNV-RP-C205 3.3.4).
        """
        return self.exposure_time / -math.log1p(-self.exceedance)

    def _faults(self) -> Iterator[tuple[str, str]]:
        low, high = self.minimum_tension, self.rope_tension_peak
        if low is not None and high is not None and low >= high:
            text = f"must be below rope_tension_peak, {high:g} N, got {low:g} N"
            yield ("minimum_tension", text)
        if self.stroke is not None:
            lowest, highest = self.stroke
            if not (lowest <= 0.0 <= highest and lowest < highest):
                text = (
                    "must be [low, high] with low < high and 0 within, "
                    f"got [{lowest:g}, {highest:g}] m"
                )
                yield ("stroke", text)


_Number = Annotated[float, Quantity("number")]


class Gains(Section):
    """Gains in use: command = set-point - A (a P'' + a1 P' + a2 P).

    With a DC motor in V s2/m, V s/m and V/m; with an AC motor the command is a speed [rad/s] or a
    torque [N m] and takes the place of the volt.
    """

    A: _Number = 1.0
    """Amplifier gain."""
    a: _Number
    """Gain on the payload's acceleration."""
    a1: _Number
    """Gain on the payload's velocity."""
    a2: _Number
    """Gain on the payload's displacement."""

    @property
    def products(self) -> tuple[float, float, float]:
        """The products A a, A a1 and A a2, which alone the loop knows."""
        return (self.A * self.a, self.A * self.a1, self.A * self.a2)


class GainBounds(Section):
    """Lowest and highest value of the products A a, A a1 and A a2."""

    a: tuple[_Number, _Number] | None = None
    """Bounds of A a."""
    a1: tuple[_Number, _Number] | None = None
    """Bounds of A a1."""
    a2: tuple[_Number, _Number] | None = None
    """Bounds of A a2."""

    def _faults(self) -> Iterator[tuple[str, str]]:
        for name in ("a", "a1", "a2"):
            bounds = getattr(self, name)
            if bounds is not None and bounds[0] >= bounds[1]:
                text = f"must be [low, high] with low < high, got [{bounds[0]:g}, {bounds[1]:g}]"
                yield (name, text)
