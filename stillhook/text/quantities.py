"""Numbers as people read them: a few digits, the unit of the trade, no powers of ten.

Inside the toolkit everything is SI; here is where figures leave it, for the terminal and for
the report: torques in kN m, motor speeds in rpm, small motions in mm.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from models.basics import LONGEST_DELAY

if TYPE_CHECKING:
    from models.rig import Limits

# The largest factor that leaves a figure of at least one is taken; the last entry otherwise.
_SCALES: dict[str, tuple[tuple[float, str], ...]] = {
    "m": ((1.0, "m"), (1e-3, "mm")),
    "m/s": ((1.0, "m/s"), (1e-3, "mm/s")),
    "m/s2": ((1.0, "m/s2"), (1e-3, "mm/s2")),
    "s": ((1.0, "s"), (1e-3, "ms")),
    "N": ((1e6, "MN"), (1e3, "kN"), (1.0, "N")),
    "N m": ((1e3, "kN m"), (1.0, "N m")),
    "N/m": ((1e6, "MN/m"), (1e3, "kN/m"), (1.0, "N/m")),
    "N s/m": ((1e3, "kN s/m"), (1.0, "N s/m")),
    "W": ((1e6, "MW"), (1e3, "kW"), (1.0, "W")),
    "kg": ((1e3, "t"), (1.0, "kg")),
    "kg m2": ((1e3, "t m2"), (1.0, "kg m2")),
    "rpm": ((2.0 * math.pi / 60.0, "rpm"),),  # from rad/s
}
_PLAIN = (1e-4, 1e7)  # sizes that are written without a power of ten


def number(value: float, digits: int = 3) -> str:
    """Return a number with so many significant digits, without a power of ten if it can be.

    Examples
    --------
    >>> number(0.0372296), number(2.0), number(6206.99), number(1.2e-7), number(-0.0)
    ('0.0372', '2.00', '6207', '1.20e-07', '0')
    """
    if math.isinf(value):
        return "-inf" if value < 0.0 else "inf"
    if value == 0.0 or math.isnan(value):
        return "0" if value == 0.0 else "nan"
    if not _PLAIN[0] <= abs(value) < _PLAIN[1]:
        return f"{value:.{digits - 1}e}"
    # Rounded first: 9.996 with three digits is 10.0, which has one decimal and not two.
    rounded = float(f"{value:.{digits - 1}e}")
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(rounded))))
    return f"{value:.{decimals}f}"


def scale(unit: str, size: float) -> tuple[float, str]:
    """Return factor and name of the unit in which a figure of that size [SI] is written."""
    choices = _SCALES.get(unit, ((1.0, unit),))
    for factor, name in choices:
        if abs(size) >= factor * (1.0 - 1e-12) and math.isfinite(size):
            return factor, name
    return choices[0 if size == 0.0 or not math.isfinite(size) else -1]


def delay_margin(seconds: float) -> str:
    """Return a delay margin; a dash where it is beyond all delays that a plant has, a minute.

    Examples
    --------
    >>> delay_margin(0.0152), delay_margin(1574.0)
    ('15.2 ms', '-')
    """
    return quantity(seconds, "s") if seconds <= LONGEST_DELAY else "-"


def quantity(value: float, unit: str, digits: int = 3, *, size: float | None = None) -> str:
    """Return a figure with its unit; `size` [SI] chooses the unit's multiple, if given.

    Examples
    --------
    >>> quantity(0.3723, "m"), quantity(6206.99, "N m"), quantity(209.44, "rpm")
    ('372 mm', '6.21 kN m', '2000 rpm')
    >>> quantity(6206.99, "N m", size=14.4), quantity(2.0, "")
    ('6207 N m', '2.00')
    """
    factor, name = scale(unit, value if size is None else size)
    return f"{number(value / factor, digits)} {name}".strip()


def percent(share: float) -> str:
    """Return a share in percent.

    Examples
    --------
    >>> percent(0.75649), percent(1.0), percent(3.6804), percent(25.0), percent(0.0031)
    ('75.6 %', '100 %', '368 %', '2500 %', '0.3 %')
    """
    value = 100.0 * share
    if not math.isfinite(value):
        return "inf %"
    # 99.97 is not 100: a limit that is all but used up must not read as broken or as met.
    return f"{value:.1f} %" if abs(value) < 99.95 else f"{value:.0f} %"


def decibels(factor: float) -> str:
    """Return a factor in dB.

    Examples
    --------
    >>> decibels(2.0), decibels(0.5), decibels(0.0), decibels(math.inf)
    ('6.0 dB', '-6.0 dB', '-inf dB', 'inf dB')
    """
    if factor <= 0.0:
        return "-inf dB"
    return "inf dB" if math.isinf(factor) else f"{20.0 * math.log10(factor):.1f} dB"


def duration(seconds: float) -> str:
    """Return a time span in the unit that suits it.

    Examples
    --------
    >>> duration(10800.0), duration(600.0), duration(90.0), duration(5400.0)
    ('3 h', '10 min', '90 s', '1.5 h')
    """
    for size, name in ((3600.0, "h"), (60.0, "min")):
        # A minute and a half is 90 s to everybody, an hour and a half is 1.5 h.
        if seconds >= size and (2.0 * seconds / size).is_integer() and seconds != 90.0:
            return f"{seconds / size:g} {name}"
    return f"{seconds:g} s"


def largest_in(limits: Limits, what: str = "largest") -> str:
    """Return what largest values are of: the exposure time, and how often they are exceeded.

    Examples
    --------
    >>> from models.rig import Limits
    >>> largest_in(Limits()), largest_in(Limits(exceedance=0.1))
    ('largest in 3 h', 'largest in 3 h (exceeded in 10.0 % of cases)')
    """
    text = f"{what} in {duration(limits.exposure_time)}"
    if limits.exceedance == type(limits).model_fields["exceedance"].default:
        return text
    return f"{text} (exceeded in {percent(limits.exceedance)} of cases)"


def count(number_of: int, noun: str) -> str:
    """Return a number of things, with an s where English wants one.

    Examples
    --------
    >>> count(1, "rope mass"), count(16, "start")
    ('1 rope mass', '16 starts')
    """
    plural = f"{noun}es" if noun.endswith("s") else f"{noun}s"
    return f"{number_of} {noun if number_of == 1 else plural}"


def listed(parts: Sequence[str]) -> str:
    """Return things as a sentence lists them.

    Examples
    --------
    >>> listed(["mass"]), listed(["mass", "drag", "delay"])
    ('mass', 'mass, drag and delay')
    """
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"
