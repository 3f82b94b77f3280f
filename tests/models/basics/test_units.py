"""Quantities as text: every unit against its definition, every trap against its message."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
import scipy.constants as const
from hypothesis import example, given
from hypothesis import strategies as st

from models import InputError, parse_quantity
from models.basics import KINDS, units_of
from models.casefile import Quantity

EVERY_UNIT = [(kind, unit) for kind in KINDS for unit in units_of(kind) if unit != "dB"]

# Against scipy's constants and definitions, not against our own factors.
KNOWN = [
    ("44 mm", "length", 0.044),
    ("8 ft", "length", 2.4384),
    ("3 in", "length", 3 * const.inch),
    ("1 nmi", "length", const.nautical_mile),
    ("20 m2", "area", 20.0),
    ("20 m^2", "area", 20.0),
    ("20 m**2", "area", 20.0),
    ("20 m²", "area", 20.0),
    ("2.5 t", "mass", 2500.0),
    ("2.5 te", "mass", 2500.0),
    ("2.5 tonnes", "mass", 2500.0),
    ("100 lb", "mass", 100 * const.pound),
    ("1.025 t/m3", "density", 1025.0),
    ("10 tf", "force", 1e4 * const.g),
    ("10 kN", "force", 1e4),
    ("1 kip", "force", 1000 * const.pound_force),
    ("80 kN/m", "stiffness", 8e4),
    ("80kN/m", "stiffness", 8e4),
    ("80 kN / m", "stiffness", 8e4),
    ("69.06 N/m", "force per length", 69.06),
    ("8.1 kg/m", "mass per length", 8.1),
    ("1 lb/ft", "mass per length", const.pound / const.foot),
    ("105 GPa", "pressure", 1.05e11),
    ("100 psi", "pressure", 100 * const.psi),
    ("3 bar", "pressure", 3 * const.bar),
    ("25.7 ms", "time", 0.0257),
    ("3 h", "time", 10800.0),
    ("0.1 Hz", "frequency", 0.2 * math.pi),
    ("0.1 rad/s", "frequency", 0.1),
    ("1200 rpm", "angular speed", 40.0 * math.pi),
    ("20 knots", "speed", 20 * const.knot),
    ("20 kn", "speed", 20 * const.knot),
    ("36 km/h", "speed", 10.0),
    ("180 deg", "angle", math.pi),
    ("-90°", "angle", -math.pi / 2),
    ("5.94 kN m", "torque", 5940.0),
    ("5.94 kNm", "torque", 5940.0),
    ("5.94 kN·m", "torque", 5940.0),
    ("5.94 kN*m", "torque", 5940.0),
    ("5.94 kN.m", "torque", 5940.0),
    ("1000 hp", "power", 1000 * const.hp),
    ("1.2 MW", "power", 1.2e6),
    ("805 V", "voltage", 805.0),
    ("1.023 kA", "current", 1023.0),
    ("74 mohm", "resistance", 0.074),
    ("0.074 Ω", "resistance", 0.074),
    ("2 mH", "inductance", 2e-3),
    ("98 kg m2", "inertia", 98.0),
    ("98 kg·m²", "inertia", 98.0),
    ("40 t m2", "inertia", 4e4),
    ("1.2 kN s/m", "damping", 1200.0),
    ("0.47 N m s/rad", "rotary damping", 0.47),
    ("0.47 N m s", "rotary damping", 0.47),
    ("5.8 N m/A", "torque constant", 5.8),
    ("5.8 V s/rad", "back-EMF constant", 5.8),
    ("0.6 V/rpm", "back-EMF constant", 0.6 * 60 / (2 * math.pi)),
    ("-20 mm/s2", "acceleration", -0.02),
    ("2 mg", "acceleration", 2e-3 * const.g),
    ("80 K", "temperature difference", 80.0),
    ("80 °C", "temperature difference", 80.0),
    ("25 µg/sqrt(Hz)", "acceleration noise", 25e-6 * const.g),
    ("1 mm/s^2/sqrt(Hz)", "acceleration noise", 1e-3),
    ("1 mm / s / sqrt(Hz)", "velocity noise", 1e-3),
    ("3 um/sqrt(Hz)", "displacement noise", 3e-6),
    ("5 %", "ratio", 0.05),
    ("1.05 m/m", "ratio", 1.05),
    ("0.5", "ratio", 0.5),
    ("6 dB", "gain", 10 ** (6 / 20)),
    ("-6 dB", "gain", 10 ** (-6 / 20)),
    (" 1.6e8 N ", "force", 1.6e8),
    ("+.5 m", "length", 0.5),
    ("5. m", "length", 5.0),
    (1.5, "length", 1.5),
    (7, "mass", 7.0),
    (np.float64(2.5), "time", 2.5),
    (np.int64(3), "number", 3.0),
]


@pytest.mark.parametrize(("value", "kind", "si"), KNOWN, ids=lambda x: str(x))
def test_known_values(value, kind, si):
    assert parse_quantity(value, kind) == pytest.approx(si, rel=1e-14)


def test_decimal_prefixes_round_once():
    # 36 * 1e-3 is 0.036000000000000004, which a user would find in the saved case.
    assert [parse_quantity(f"{n} mm", "length") for n in (36, 44, 75)] == [0.036, 0.044, 0.075]


def test_hertz_and_radians_are_told_apart_by_the_field():
    assert parse_quantity("1 Hz", "frequency") == pytest.approx(2 * math.pi)
    assert parse_quantity("1 rad/s", "frequency") == 1.0
    with pytest.raises(InputError, match=re.escape("got '1 Hz', which is a frequency")):
        parse_quantity("1 Hz", "angular speed")
    with pytest.raises(InputError, match="which is a frequency"):
        parse_quantity("0.1 Hz", "time")


@given(
    st.sampled_from(EVERY_UNIT),
    st.floats(-1e12, 1e12, allow_nan=False),
    st.sampled_from(["", " ", "  "]),
)
def test_number_and_unit_is_number_times_factor(entry, number, gap):
    kind, unit = entry
    expected = number * KINDS[kind].units[unit]
    assert parse_quantity(f"{number!r}{gap}{unit}", kind) == pytest.approx(expected, rel=1e-14)


@given(st.sampled_from(EVERY_UNIT), st.floats(1e-9, 1e9))
def test_writing_in_any_unit_and_reading_gives_the_value_back(entry, si):
    kind, unit = entry
    text = f"{si / KINDS[kind].units[unit]!r} {unit}"
    assert parse_quantity(text, kind) == pytest.approx(si, rel=1e-13)


@given(st.sampled_from(sorted(KINDS)), st.floats(allow_nan=False, allow_infinity=False))
def test_plain_numbers_are_si(kind, number):
    assert parse_quantity(number, kind) == number


@given(st.sampled_from(sorted(KINDS)), st.text(max_size=20))
@example("length", "1 m/s")
@example("gain", "1e6 dB")
@example("length", "1e999 m")
def test_any_text_is_read_or_refused_in_a_sentence(kind, text):
    message, value = "", 0.0
    try:
        value = parse_quantity(text, kind)
    except InputError as error:
        message = str(error)
    assert math.isfinite(value)
    if message:
        assert message.startswith(f"must be {KINDS[kind].label}")
        assert repr(text)[:57] in message


def test_units_mean_the_same_in_every_kind():
    # `kn` must not be knots for one field and something else for another.
    meanings: dict[str, set[float]] = {}
    for kind, unit in EVERY_UNIT:
        meanings.setdefault(unit, set()).add(KINDS[kind].units[unit])
    assert {unit for unit, factors in meanings.items() if len(factors) > 1} == set()


TROUBLES = [
    ("50 mt", "mass", "mt is ambiguous (metric tonne, millitonne or megatonne?); write t for 1000"),
    ("5 MT", "mass", "MT is ambiguous (metric tonne"),
    ("5 mT", "mass", "mT is ambiguous (metric tonne"),
    ("5 tons", "mass", "tons is ambiguous (metric, long or short ton?); write t for 1000 kg"),
    ("3 1/s", "frequency", "1/s is ambiguous; write Hz or rad/s"),
    ("5 nm", "torque", "nm is ambiguous; write N m for a torque"),
    ("80 kn/m", "stiffness", "unknown unit 'kn/m'; units are case-sensitive, did you mean kN/m?"),
    ("10 kn", "force", "which is a speed (kn is knots; did you mean kN?)"),
    ("10 KG", "mass", "unknown unit 'KG'; units are case-sensitive, did you mean kg?"),
    ("0.1 hz", "frequency", "units are case-sensitive, did you mean Hz?"),
    ("44 kg", "length", "must be a length [m], got '44 kg', which is a mass"),
    ("44 parsec", "length", "unknown unit 'parsec'; use one of m, mm, cm, km, in, ft, fathom, nmi"),
    ("5 m m", "length", "unknown unit 'm m'"),
    ("44", "length", "got '44', which has no unit (a number without quotes is in m)"),
    ("3", "number", "got '3': write the number without quotes"),
    ("3 m", "number", "must be a plain number, got '3 m', which is a length"),
    ("3 x", "number", "got '3 x', which has a unit where none is wanted"),
    ("3 dB", "ratio", "got '3 dB', which is a gain"),
    ("1_000 m", "length", "got '1_000 m': write numbers as 1234.5 or 1.2345e3, without separators"),
    ("1,5 m", "length", "got '1,5 m': write numbers as 1234.5"),
    ("1.2.3 m", "length", "got '1.2.3 m': write numbers as 1234.5"),
    ("", "length", "must be a length [m], got ''"),
    ("nan m", "length", "must be a length [m], got 'nan m'"),
    ("1e400 m", "length", "got '1e400 m', which is not finite"),
    (math.nan, "length", "must be a length [m], got nan, which is not finite"),
    (-math.inf, "mass", "must be a mass [kg], got -inf, which is not finite"),
    (10**400, "mass", "which is not finite"),
    (True, "mass", "must be a mass [kg], got True"),
    (None, "mass", "must be a mass [kg], got nothing"),
    ([1.0], "mass", "must be a mass [kg], got [1.0]"),
]


@pytest.mark.parametrize(("value", "kind", "message"), TROUBLES, ids=lambda x: str(x)[:30])
def test_refused(value, kind, message):
    with pytest.raises(InputError) as caught:
        parse_quantity(value, kind)
    assert message in str(caught.value)


def test_ranges():
    diameter = Quantity("length", 0.005, 0.3)
    assert diameter.read("44 mm") == 0.044
    with pytest.raises(InputError) as caught:
        diameter.read("44 cm")
    assert str(caught.value) == "must be a length in [0.005, 0.3] m, got '44 cm' (0.44 m)"
    positive = Quantity("time", 0.0, open_low=True)
    with pytest.raises(InputError, match="must be a time above 0 s, got 0"):
        positive.read(0)
    with pytest.raises(InputError, match="must be a mass of at least 0 kg, got -3"):
        Quantity("mass", 0.0).read(-3)


def test_counts_and_words():
    masses = Quantity("count", 1, 40, word="auto")
    assert masses.read("auto") == "auto"
    assert isinstance(masses.read(4), int)
    for wrong in (0, 41, 2.5, "Auto", "3 m"):
        with pytest.raises(InputError, match=r"must be 'auto' or a whole number in \[1, 40\]"):
            masses.read(wrong)
