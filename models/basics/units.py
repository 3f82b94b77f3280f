"""Quantities as text: `44 mm`, `20 knots`, `2.5 t`, read into SI numbers.

This is the only place where units other than SI exist on the way in.  The table below is an
exact, case-sensitive whitelist: a general unit library reads `50 mt` as fifty millitonnes,
`5 MT` as megateslas and `0.1 Hz` as 0.1 rad/s, and each of these has bitten somebody.  What a
field wants is its *kind* (a length, a frequency, ...), so `0.1 Hz` becomes 0.628 rad/s where a
frequency is wanted and is refused where a time is.  A plain number is always SI.
"""

import math
import numbers
import re
from collections.abc import Mapping
from dataclasses import dataclass

from .checks import InputError


@dataclass(frozen=True, kw_only=True)
class Kind:
    """What a field wants: its name in a sentence, its SI unit and the units it accepts."""

    label: str  #: With its article, as in `a length`.
    unit: str  #: The SI unit that a plain number is in; empty for a pure number.
    units: Mapping[str, float]  #: Accepted spellings and the factor that turns them into SI.
    decibel: bool = False  #: Whether `dB` is accepted, as 20 log10 of an amplitude ratio.


def _kind(label: str, unit: str, units: Mapping[str, float], decibel: bool = False) -> Kind:
    # `Nm` is as good as `N m`; the reverse is not true (`m m` is no millimetre), so the
    # compact spelling is added to the table and no space is ever dropped from the input.
    spelled = dict(units)
    for name, factor in units.items():
        spelled.setdefault(name.replace(" ", ""), factor)
    return Kind(label=label, unit=unit, units=spelled, decibel=decibel)


_INCH, _FOOT, _POUND, _G = 0.0254, 0.3048, 0.45359237, 9.80665
_LBF = _POUND * _G
_RPM = 2.0 * math.pi / 60.0
_DEG = math.pi / 180.0
_KNOT = 1852.0 / 3600.0

_FORCE_PER_LENGTH = {
    "N/m": 1.0, "kN/m": 1e3, "MN/m": 1e6, "N/mm": 1e3, "kN/mm": 1e6, "kgf/m": _G,
    "tf/m": 1e3 * _G, "lbf/ft": _LBF / _FOOT,
}  # fmt: skip

KINDS: Mapping[str, Kind] = {
    "number": _kind("a plain number", "", {}),
    "count": _kind("a whole number", "", {}),
    "ratio": _kind("a ratio", "", {"%": 0.01, "m/m": 1.0}),
    "gain": _kind("a gain", "", {"%": 0.01}, decibel=True),
    "length": _kind("a length", "m", {
        "m": 1.0, "mm": 1e-3, "cm": 1e-2, "km": 1e3, "in": _INCH, "ft": _FOOT,
        "fathom": 6.0 * _FOOT, "nmi": 1852.0}),
    "area": _kind("an area", "m2", {
        "m2": 1.0, "cm2": 1e-4, "mm2": 1e-6, "in2": _INCH**2, "ft2": _FOOT**2}),
    "mass": _kind("a mass", "kg", {
        "kg": 1.0, "g": 1e-3, "t": 1e3, "te": 1e3, "tonne": 1e3, "tonnes": 1e3, "lb": _POUND}),
    "density": _kind("a density", "kg/m3", {"kg/m3": 1.0, "t/m3": 1e3, "g/cm3": 1e3}),
    "force": _kind("a force", "N", {
        "N": 1.0, "kN": 1e3, "MN": 1e6, "kgf": _G, "tf": 1e3 * _G, "lbf": _LBF,
        "kip": 1e3 * _LBF}),
    "force per length": _kind("a force per length", "N/m", _FORCE_PER_LENGTH),
    "stiffness": _kind("a stiffness", "N/m", _FORCE_PER_LENGTH),
    "mass per length": _kind("a mass per length", "kg/m", {
        "kg/m": 1.0, "kg/km": 1e-3, "t/m": 1e3, "t/km": 1.0, "g/m": 1e-3,
        "lb/ft": _POUND / _FOOT}),
    "pressure": _kind("a pressure", "Pa", {
        "Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "bar": 1e5, "N/m2": 1.0, "N/mm2": 1e6,
        "kN/mm2": 1e9, "psi": _LBF / _INCH**2}),
    "time": _kind("a time", "s", {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0}),
    "frequency": _kind("a frequency", "rad/s", {
        "rad/s": 1.0, "Hz": 2.0 * math.pi, "mHz": 2e-3 * math.pi, "kHz": 2e3 * math.pi}),
    "angular speed": _kind("an angular speed", "rad/s", {
        "rad/s": 1.0, "rpm": _RPM, "r/min": _RPM, "rev/min": _RPM, "deg/s": _DEG}),
    "speed": _kind("a speed", "m/s", {
        "m/s": 1.0, "mm/s": 1e-3, "m/min": 1.0 / 60.0, "km/h": 1.0 / 3.6, "ft/s": _FOOT,
        "knots": _KNOT, "knot": _KNOT, "kn": _KNOT, "kt": _KNOT}),
    "acceleration": _kind("an acceleration", "m/s2", {
        "m/s2": 1.0, "mm/s2": 1e-3, "mg": 1e-3 * _G, "ug": 1e-6 * _G, "ft/s2": _FOOT}),
    "angle": _kind("an angle", "rad", {"rad": 1.0, "mrad": 1e-3, "deg": _DEG}),
    "torque": _kind("a torque", "N m", {
        "N m": 1.0, "kN m": 1e3, "MN m": 1e6, "kgf m": _G, "lbf ft": _LBF * _FOOT}),
    "power": _kind("a power", "W", {
        "W": 1.0, "kW": 1e3, "MW": 1e6, "hp": 550.0 * _LBF * _FOOT}),
    "voltage": _kind("a voltage", "V", {"V": 1.0, "mV": 1e-3, "kV": 1e3}),
    "current": _kind("a current", "A", {"A": 1.0, "mA": 1e-3, "kA": 1e3}),
    "resistance": _kind("a resistance", "ohm", {"ohm": 1.0, "mohm": 1e-3, "kohm": 1e3}),
    "inductance": _kind("an inductance", "H", {"H": 1.0, "mH": 1e-3, "uH": 1e-6}),
    "inertia": _kind("a moment of inertia", "kg m2", {
        "kg m2": 1.0, "t m2": 1e3, "kg cm2": 1e-4}),
    "damping": _kind("a damping", "N s/m", {"N s/m": 1.0, "kN s/m": 1e3, "MN s/m": 1e6}),
    "rotary damping": _kind("a rotary damping", "N m s/rad", {
        "N m s/rad": 1.0, "N m s": 1.0, "kN m s/rad": 1e3, "kN m s": 1e3,
        "N m/rpm": 1.0 / _RPM}),
    "torque constant": _kind("a torque constant", "N m/A", {"N m/A": 1.0, "kN m/A": 1e3}),
    "back-EMF constant": _kind("a back-EMF constant", "V s/rad", {
        "V s/rad": 1.0, "V s": 1.0, "V/rpm": 1.0 / _RPM}),
    # Of a sea's elevation.  "m2 s" is refused: people write it for both.
    "spectral density": _kind("a spectral density", "m2 s/rad", {
        "m2 s/rad": 1.0, "m2/Hz": 0.5 / math.pi, "cm2/Hz": 0.5e-4 / math.pi}),
    "temperature difference": _kind("a temperature difference", "K", {"K": 1.0, "degC": 1.0}),
    # Amplitude spectral densities: the square root of a one-sided variance density per hertz.
    "acceleration noise": _kind("an acceleration noise density", "m/s2/sqrt(Hz)", {
        "m/s2/sqrt(Hz)": 1.0, "mm/s2/sqrt(Hz)": 1e-3, "mg/sqrt(Hz)": 1e-3 * _G,
        "ug/sqrt(Hz)": 1e-6 * _G}),
    "velocity noise": _kind("a velocity noise density", "m/s/sqrt(Hz)", {
        "m/s/sqrt(Hz)": 1.0, "mm/s/sqrt(Hz)": 1e-3, "um/s/sqrt(Hz)": 1e-6}),
    "displacement noise": _kind("a displacement noise density", "m/sqrt(Hz)", {
        "m/sqrt(Hz)": 1.0, "mm/sqrt(Hz)": 1e-3, "um/sqrt(Hz)": 1e-6}),
}  # fmt: skip

# Spellings that different people read differently, and what to write instead.
_AMBIGUOUS: Mapping[str, str] = {
    **dict.fromkeys(
        ("mt", "MT", "mT", "Mt"),
        "is ambiguous (metric tonne, millitonne or megatonne?); write t for 1000 kg",
    ),
    **dict.fromkeys(
        ("T", "ton", "tons"), "is ambiguous (metric, long or short ton?); write t for 1000 kg"
    ),
    **dict.fromkeys(("nm", "NM", "nM"), "is ambiguous; write N m for a torque, nmi for a mile"),
    **dict.fromkeys(("1/s", "s-1"), "is ambiguous; write Hz or rad/s"),
}

_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_SAME = str.maketrans(
    {
        "²": "2",
        "³": "3",
        "·": " ",
        "°": "deg",
        "\N{GREEK CAPITAL LETTER OMEGA}": "ohm",
        "\N{OHM SIGN}": "ohm",
        "\N{MICRO SIGN}": "u",
        "\N{GREEK SMALL LETTER MU}": "u",
    }
)


def units_of(kind: str) -> tuple[str, ...]:
    """Return the unit spellings that a kind accepts, the SI unit first."""
    wanted = KINDS[kind]
    names = sorted(wanted.units, key=lambda name: name != wanted.unit)
    return (*names, "dB") if wanted.decibel else tuple(names)


def parse_quantity(value: object, kind: str) -> float:
    """Read a number (SI already) or a text such as `44 mm` as a quantity of a kind of `KINDS`.

    Raises InputError if it is no finite number, has no unit or an unknown one, or is of another
    kind.

    Examples
    --------
    >>> parse_quantity("44 mm", "length")
    0.044
    >>> round(parse_quantity("0.1 Hz", "frequency"), 4)
    0.6283
    """
    try:
        return read_quantity(value, kind)
    except InputError as error:
        wanted = KINDS[kind]
        unit = f" [{wanted.unit}]" if wanted.unit else ""
        raise InputError(f"must be {wanted.label}{unit}, got {error}") from None


def read_quantity(value: object, kind: str) -> float:
    """Do as `parse_quantity`, with an error that holds only what came and what is wrong with it.

    Raises
    ------
    InputError
        The part of the sentence that follows "got".
    """
    if isinstance(value, str):
        number = _read_text(value, kind)
    elif isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise InputError(_short(value))
    else:
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
    if not math.isfinite(number):
        raise InputError(f"{_short(value)}, which is not finite")
    return number


def _read_text(text: str, kind: str) -> float:
    wanted = KINDS[kind]
    shown = _short(text)
    match = _NUMBER.match(text.strip())
    if match is None:
        raise InputError(shown)
    number, unit = float(match.group()), _spelling(text.strip()[match.end() :])
    if re.match(r"[_,][0-9]|\.[0-9]", unit):
        raise InputError(f"{shown}: write numbers as 1234.5 or 1.2345e3, without separators")
    if not unit:
        if not wanted.units:
            raise InputError(f"{shown}: write the number without quotes")
        if not wanted.unit:
            return number
        raise InputError(
            f"{shown}, which has no unit (a number without quotes is in {wanted.unit})"
        )
    if unit == "dB" and wanted.decibel:
        return math.inf if number > 6000.0 else float(10.0 ** (number / 20.0))
    if unit not in wanted.units:
        raise InputError(f"{shown}{_why_not(unit, kind)}")
    factor = wanted.units[unit]
    # 36 mm is 0.036, not 36 * 1e-3 = 0.036000000000000004: dividing by 1000 rounds only once.
    divisor = round(1.0 / factor) if factor < 1.0 else 1
    return number / divisor if divisor > 1 and 1.0 / divisor == factor else number * factor


def _spelling(unit: str) -> str:
    """Bring the spellings `m^2`, `m**2`, `N*m` and `N.m` to those of the table."""
    plain = re.sub(r"(?:\*\*|\^)(?=[0-9])", "", unit.translate(_SAME))
    plain = re.sub(r"(?<=[A-Za-z0-9])[.*](?=[A-Za-z])", " ", plain)
    return re.sub(r"\s+", " ", re.sub(r"\s*/\s*", "/", plain)).strip()


def _why_not(unit: str, kind: str) -> str:
    wanted = KINDS[kind]
    if unit in _AMBIGUOUS:
        return f": {unit} {_AMBIGUOUS[unit]}"
    twins = [name for name in wanted.units if name.casefold() == unit.casefold()]
    others = [k.label for k in KINDS.values() if unit in k.units or (k.decibel and unit == "dB")]
    if others:
        meaning = f", which is {' or '.join(dict.fromkeys(others[:2]))}"
        twin = f" ({unit} is knots; did you mean {twins[0]}?)" if twins and unit == "kn" else ""
        return meaning + twin
    if twins:
        return f": unknown unit {unit!r}; units are case-sensitive, did you mean {twins[0]}?"
    if not wanted.units:
        return ", which has a unit where none is wanted"
    some = ", ".join(dict.fromkeys(name for name in units_of(kind) if not _compact(name, wanted)))
    return f": unknown unit {unit!r}; use one of {some}"


def _compact(name: str, wanted: Kind) -> bool:
    return any(other != name and other.replace(" ", "") == name for other in wanted.units)


def _short(value: object) -> str:
    text = "nothing" if value is None else repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
