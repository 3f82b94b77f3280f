"""Signals: the names, delays and rates that they go by, and white noise."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from .arrays import FloatArray
from .checks import InputError, check_range

LONGEST_DELAY = 60.0
"""Longest delay that sensors and telemetry have [s]; a delay margin beyond it means nothing."""


@dataclass(frozen=True)
class White:
    """White noise of E[w(t) w(t+s)] = intensity * delta(s) as a spectrum.

    It disturbs sensors and drives shaping filters.  It has the same ``density`` as a sea or a
    hook's motion, but no finite variance and no band.

    Its one-sided density is intensity/pi per rad/s: twice the two-sided density
    intensity/(2 pi), so that a filter h has the output variance intensity * integral h(t)^2.
    An intensity has the unit of w, squared, times s.
    """

    intensity: float = 1.0

    def __post_init__(self) -> None:
        check_range("White", "intensity", self.intensity, low=0.0)

    def density(self, omega: npt.ArrayLike) -> FloatArray:
        """Return the one-sided density per rad/s at `omega`."""
        return np.full(np.shape(omega), self.intensity / np.pi)


def pick(owner: str, kind: str, names: Sequence[str], wanted: Sequence[str]) -> list[int]:
    """Return the positions of the `wanted` names.

    Raises InputError if a name is unknown; those that exist are listed.
    """
    known = list(names)
    for name in wanted:
        if name not in known:
            raise InputError(
                f"{owner}: there is no {kind} {name!r}; there are: {', '.join(known) or 'none'}"
            )
    return [known.index(name) for name in wanted]


def signal_names(
    owner: str, kind: str, names: Sequence[str], letter: str, count: int
) -> tuple[str, ...]:
    """Return `count` names: those given, or letter1, letter2... if none are.

    Raises InputError if their number is another one, or a name comes twice.
    """
    if isinstance(names, str):
        names = (names,)
    if not len(names):
        return tuple(f"{letter}{i + 1}" for i in range(count))
    if len(names) != count:
        raise InputError(f"{owner}: {kind} must be {count} names, got {len(names)}")
    if len(set(names)) != count:
        twice = next(name for name in names if list(names).count(name) > 1)
        raise InputError(f"{owner}: {kind} must have names that differ, got {twice!r} twice")
    return tuple(names)


def signal_delays(
    owner: str, measurements: Sequence[str], delays: Sequence[float] | Mapping[str, float]
) -> tuple[float, ...]:
    """Return one delay for each measurement [s] from numbers in order or by name.

    Raises InputError if their number or a name is wrong, or a delay is negative.
    """
    if isinstance(delays, Mapping):
        pick(owner, "measurement (in delays)", measurements, list(delays))
        delays = [delays.get(name, 0.0) for name in measurements]
    values = list(delays) if len(delays) else [0.0] * len(measurements)
    if len(values) != len(measurements):
        raise InputError(
            f"{owner}: delays must be {len(measurements)} numbers, one for each "
            f"measurement, got {len(values)}"
        )
    return tuple(
        check_range(owner, f"delay of {name}", value, low=0.0, unit="s")
        for name, value in zip(measurements, values, strict=True)
    )


def signal_rates(
    owner: str, disturbances: Sequence[str], rates: Mapping[str, str]
) -> Mapping[str, str]:
    """Return the checked mapping of rates to the disturbances they are the derivative of.

    Raises InputError if a name is unknown, or a rate is that of another rate.
    """
    pick(owner, "disturbance (in rates)", disturbances, [*rates, *rates.values()])
    for rate, base in rates.items():
        if base in rates:
            raise InputError(
                f"{owner}: rates must name the disturbance itself, got {rate!r} as the rate "
                f"of {base!r}, which is a rate too"
            )
    return MappingProxyType(dict(rates))
