"""Every reader against a table that was written in its format, and against real files."""

from __future__ import annotations

import io
import math
import re
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.io import savemat
from vessel_tables import (
    DATA,
    aqwa_text,
    mirrored,
    mss_vessel,
    orcaflex_text,
    shipx_text,
    swinging,
    wamit_listing_text,
    wamit_text,
)

from models.basics import InputError, PhysicsWarning
from models.sea import SeaSpectrum
from models.vessel import VesselRaos
from models.vessel.assemble import grid
from models.vessel.readers import bundled_vessels, check_long_waves, read_raos, write_raos
from models.vessel.readers.orcaflex import parse_orcaflex

RAOS = swinging()
SHIP = swinging(symmetric=True)
MSS = DATA / "mss"
OFX = DATA / "mafredo"
needs_mss = pytest.mark.skipif(not MSS.is_dir(), reason="the real files are not here")
needs_ofx = pytest.mark.skipif(not OFX.is_dir(), reason="the real files are not here")


def put(folder: Path, name: str, content: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def mat(raos: VesselRaos, speeds: int = 1) -> bytes:
    target = io.BytesIO()
    savemat(target, mss_vessel(raos, speeds))
    return target.getvalue()


def same(found: VesselRaos, wanted: VesselRaos, tolerance: float = 1e-7) -> None:
    assert np.allclose(found.omega, wanted.omega, rtol=1e-7)
    assert np.allclose(found.heading, wanted.heading, atol=1e-8)
    assert np.allclose(found.values, wanted.values, rtol=tolerance, atol=1e-9)


WRITERS: dict[str, tuple[str, Callable[[VesselRaos], str | bytes]]] = {
    "wamit": ("swing.4", wamit_text),
    "orcaflex": ("swing.yml", orcaflex_text),
    "shipx": ("swing.re1", lambda raos: shipx_text({0.0: raos})),
    "mss": ("swing.mat", mat),
}


@pytest.mark.parametrize("kind", WRITERS)
def test_a_table_in_any_format_is_read_back_by_contents_alone(kind: str, tmp_path: Path) -> None:
    name, write = WRITERS[kind]
    found = read_raos(put(tmp_path, name, write(RAOS)))
    same(found, RAOS)
    assert found.notes
    # The name may be any.
    same(read_raos(put(tmp_path, "table.dat", write(RAOS))), RAOS)


@pytest.mark.parametrize("kind", WRITERS)
def test_half_of_a_symmetric_vessel_is_completed(kind: str, tmp_path: Path) -> None:
    half = replace(SHIP, heading=SHIP.heading[:7], values=SHIP.values[:, :7])
    found = read_raos(put(tmp_path, WRITERS[kind][0], WRITERS[kind][1](half)))
    if kind == "orcaflex":  # its files tell, and this one tells of none
        assert found.heading.size == 7
        return
    same(found, SHIP)
    assert any("taken as symmetric" in note for note in found.notes)


@pytest.mark.parametrize("suffix", [".csv", ".nc"])
def test_what_is_written_reads_back_to_the_last_digit(suffix: str, tmp_path: Path) -> None:
    raos = replace(
        RAOS, origin=(1.25, -0.1, 3.0), phase_origin=(7.0, 0.3), depth=48.5, speed=2.5,
        notes=("first: a, b", "second"),
    )  # fmt: skip
    found = read_raos(write_raos(tmp_path / f"out{suffix}", raos), check=False)
    assert np.array_equal(found.values, raos.values)
    assert np.array_equal(found.omega, raos.omega)
    assert np.allclose(found.heading, raos.heading, rtol=1e-15, atol=1e-15)
    for field in ("name", "origin", "phase_origin", "depth", "speed", "notes", "source"):
        assert getattr(found, field) == getattr(raos, field)
    with pytest.raises(InputError, match=r"must end in \.csv, \.4, \.yml, \.nc"):
        write_raos(tmp_path / "out.txt", raos)


@pytest.mark.parametrize("suffix", [".4", ".yml"])
def test_what_is_written_for_other_programs_reads_back(suffix: str, tmp_path: Path) -> None:
    raos = replace(
        RAOS, name='tug "A": 1', origin=(1.25, -0.1, 3.0), phase_origin=(7.0, 0.3), depth=48.5
    )
    path = write_raos(tmp_path / f"out{suffix}", raos)
    told = {"origin": raos.origin, "depth": raos.depth} if suffix == ".4" else {}
    found = read_raos(path, check=False, **told)
    same(found, raos.with_phase_origin(raos.origin[:2]), 1e-9)
    assert found.origin == raos.origin
    assert found.depth == 48.5
    if suffix == ".yml":
        assert found.name == raos.name
    with pytest.raises(InputError, match=r"has no forward speed, got 2\.5 m/s"):
        write_raos(path, replace(RAOS, speed=2.5))


def test_a_listing_of_aqwa_is_read_to_its_digits(tmp_path: Path) -> None:
    placed = replace(RAOS, origin=(-3.0, 0.5, 1.5), phase_origin=(-3.0, 0.5), depth=1000.0)
    text = aqwa_text(placed)
    found = read_raos(put(tmp_path, "barge.LIS", text))
    assert np.allclose(found.omega, RAOS.omega, rtol=6e-4)
    assert np.allclose(found.heading, RAOS.heading, atol=1e-4)
    assert np.allclose(found.values, RAOS.values, rtol=0.0, atol=3e-4)
    assert (found.name, found.origin, found.depth) == ("barge", (-3.0, 0.5, 1.5), 1000.0)
    assert found.phase_origin == (-3.0, 0.5)
    two = put(tmp_path, "two.LIS", text + aqwa_text(replace(placed, depth=1000.0), structure=2))
    with pytest.raises(InputError, match="there are structures 1, 2: say which, as in body=1"):
        read_raos(two)
    assert np.allclose(read_raos(two, body=2).values, found.values)
    with pytest.raises(InputError, match="body must be one of 1, 2, got 3"):
        read_raos(two, body=3)


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("2023 R1", "19.0", r"a listing of AQWA 19\.0: those of 2023 R1 are read"),
        ("VERSION", "EDITION", "a listing of AQWA of unknown version"),
        ("       9.810", "      32.174", "GRAVITY must be that of metres, 9.81, got 32.174"),
        ("   R.A.O.S-", "   F.A.O.S-", "no table R.A.O.S-VARIATION WITH WAVE PERIOD/FREQUENCY"),
        ("PERIOD   FREQ   DIR", "FREQ   PERIOD   DIR", "columns must be PERIOD, FREQ, DIRECTION"),
        ("STRUCTURE C.O.G.", "STRUCTURE", "line STRUCTURE C.O.G. of structure 1 is missing"),
        ("WATER  DEPTH  . . . . . . . . . . . . . . . . =   1000.0000", "", "WATER DEPTH must be"),
    ],
)
def test_a_listing_of_aqwa_that_is_wrong_is_answered(
    before: str, after: str, words: str, tmp_path: Path
) -> None:
    text = aqwa_text(RAOS)
    assert before in text
    with pytest.raises(InputError, match=words):
        read_raos(put(tmp_path, "a.LIS", text.replace(before, after)))


def test_the_two_tables_of_aqwa_are_held_against_each_other(tmp_path: Path) -> None:
    lines = aqwa_text(RAOS).splitlines()
    row = next(n for n, line in enumerate(lines) if line.startswith("   78.54"))
    lines[row] = f"{lines[row][:27]}    0.5000{lines[row][37:]}"
    with pytest.raises(InputError, match=r"two tables of RAOs differ at 78\.54 s, direction 0"):
        read_raos(put(tmp_path, "a.LIS", "\n".join(lines)))
    lines = aqwa_text(RAOS).splitlines()
    lines[row] = lines[row][:60]
    with pytest.raises(InputError, match=r"amplitude and phase of six motions, got \d+ numbers"):
        read_raos(put(tmp_path, "b.LIS", "\n".join(lines)))


def test_a_listing_of_wamit_has_phases_to_a_degree(tmp_path: Path) -> None:
    text = wamit_listing_text(replace(RAOS, depth=400.0), length=90.0, place=(5.0, 0.0, 2.0, 0.0))
    found = read_raos(put(tmp_path, "tanker.out", text), check=False)
    away = replace(RAOS, depth=400.0, phase_origin=(-5.0, 0.0)).with_phase_origin((0.0, 0.0))
    assert np.allclose(found.omega, RAOS.omega, rtol=1e-6)
    assert np.all(np.abs(found.values - away.values) <= 0.0088 * np.abs(away.values) + 1e-6)
    assert (found.name, found.origin, found.depth) == ("tanker", (0.0, 0.0, 2.0), 400.0)
    assert any("phases to a degree; the .4 file has more" in note for note in found.notes)
    assert check_long_waves(read_raos(put(tmp_path, "b.out", wamit_listing_text(RAOS)))).ok


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("RESPONSE AMPLITUDE OPERATORS", "", "no RESPONSE AMPLITUDE OPERATORS in this listing of"),
        ("9.81000", "32.1740", "Gravity must be that of metres, 9.81, got 32.174"),
        ("PHIBODY =   0.0", "PHIBODY =  90.0", "PHIBODY must be 0, .* got 90 deg"),
        ("XBODY", "ZBODY", "there is no XBODY of body 1"),
        ("Length scale", "Length", "Length scale must be above 0, got nothing"),
    ],
)
def test_a_listing_of_wamit_that_is_wrong_is_answered(
    before: str, after: str, words: str, tmp_path: Path
) -> None:
    text = wamit_listing_text(RAOS)
    assert before in text
    with pytest.raises(InputError, match=words):
        read_raos(put(tmp_path, "a.out", text.replace(before, after)))


def test_a_csv_of_ones_own_tells_its_convention_in_remarks(tmp_path: Path) -> None:
    lines = [
        "# a table from a model test", "# name: tug", "# origin: -3, 0, 1.5", "# phase: lags",
        "# heave: down", "# headings: from", "# turning: clockwise", "# depth: 60",
        "period [s]; heading [deg]; heave_amp; heave_phase [rad]; roll_amp [deg/m]; roll_phase",
    ]  # fmt: skip
    k = float(replace(RAOS, depth=60.0).wave_number(2.0 * math.pi / 40.0))
    for period in (40.0, 10.0):
        for heading in range(0, 360, 45):
            # Down is the other sign; from starboard is towards port, where roll is -i k.
            size = math.degrees(k) * abs(math.sin(math.radians(heading)))
            late = 0.5 * math.pi if heading < 180 else -0.5 * math.pi
            lines.append(f"{period}; {heading}; 0.9; {math.pi}; {size}; {late}")
    raos = read_raos(put(tmp_path, "tug.csv", "\n".join(lines)))
    assert raos.name == "tug"
    assert raos.origin == (-3.0, 0.0, 1.5)
    assert raos.depth == 60.0
    towards_port = raos.response(raos.omega[0], 0.5 * math.pi)
    assert towards_port[2] == pytest.approx(0.9)
    assert towards_port[3] == pytest.approx(-1j * k)
    assert any("no columns for surge, sway, pitch, yaw" in note for note in raos.notes)


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("heave_real", "heaves_real", r"a column must be .* or a motion .*; got 'heaves_real'"),
        ("heave_imag", "heave_real", "each once"),
        (
            "omega [rad/s]",
            "omega [furlongs]",
            r"a column must be omega .* got 'omega \[furlongs\]'",
        ),
        ("omega [rad/s],", "yaw_amplitude,", "there must be a column omega .* 'Period .s.'"),
        ("heading [deg]", "course", "got 'course'.*'Heave amp .m/m.', 'Heave phase .deg.' will do"),
        ("roll_real", "roll_real [inch]", r"unit \[inch\] of roll_real is not known"),
        ("# depth: inf", "# depth: shallow", "depth must be in .*, got 'shallow'"),
        ("# origin: 0.0, 0.0, 0.0", "# origin: 0.0, 0.0", "origin must be 3 numbers"),
        ("# speed: 0.0", "# speed: 0.0\n# phase: early", "phase must be one of leads, lags"),
    ],
)
def test_a_csv_that_is_wrong_is_answered_by_field(
    before: str, after: str, words: str, tmp_path: Path
) -> None:
    text = write_raos(tmp_path / "a.csv", RAOS).read_text()
    assert before in text
    with pytest.raises(InputError, match=words):
        read_raos(put(tmp_path, "b.csv", text.replace(before, after, 1)), file_format="csv")


TABLE = [(40.0, 1.0, -1.0), (14.0, 0.8, -12.5), (8.0, 0.25, -60.0), (5.0, 0.05, 100.0)]


@pytest.mark.parametrize(
    ("head", "mark", "comma"),
    [
        ("Period (s); Heading (deg); Heave amp (m/m); Heave phase (deg)", ";", True),
        ("Period [s],Wave direction [deg],Heave RAO [m/m],Heave phase [deg]", ",", False),
        (
            "sep=;\nT (s);Dir (\N{DEGREE SIGN});Heave Ampl. (-);Heave Phase (\N{DEGREE SIGN})",
            ";",
            False,
        ),
        ('"Wave period (s)"\t"beta"\t"Amplitude heave"\t"Phase heave"', "\t", True),
        ("Heave amp; Heave phase (deg); Heading; Period (s)", ";", True),
        ("Period (s); Heave amp (m/m); Heave phase (deg)", ";", True),
        ("# heading: 180\nPeriod (s), Heave amp (m/m), Heave phase (deg)", ",", False),
    ],
)
def test_a_table_is_read_by_the_names_that_people_write(
    head: str, mark: str, comma: bool, tmp_path: Path
) -> None:
    lines = [head]
    for period, size, phase in TABLE:
        cells = [str(period), "180", str(size), str(phase)]
        if head.startswith("Heave"):
            cells = [*cells[2:], cells[1], cells[0]]
        if not re.search("(?i)heading [(]|heading;|dir|beta", head):
            del cells[1]
        lines.append(mark.join(cells).replace(".", "," if comma else "."))
    path = put(tmp_path, "tug.csv", "\n".join(lines).encode())
    bare = head.startswith("Period (s); Heave")
    found = read_raos(path, heading=180.0) if bare else read_raos(path)
    assert found.heading_deg == pytest.approx([180.0])
    assert 2.0 * math.pi / found.omega[::-1] == pytest.approx([p for p, _, _ in TABLE][::-1])
    heave = found.mode("heave")[:, 0]
    assert np.abs(heave) == pytest.approx([size for _, size, _ in TABLE])
    assert np.degrees(np.angle(heave)) == pytest.approx([phase for *_, phase in TABLE])
    if bare:
        with pytest.raises(InputError, match=r"no column of headings .* --heading 180, or a line"):
            read_raos(path)
    elif "# heading" not in head:
        with pytest.raises(InputError, match="heading must not be given: the file has a column"):
            read_raos(path, heading=180.0)


def test_mss_keeps_the_vessels_name(tmp_path: Path) -> None:
    assert read_raos(put(tmp_path, "a.mat", mat(RAOS))).name == "swing"
    # What every vessel is called that came by a file input.re1.
    held = mss_vessel(RAOS)
    held["vessel"]["main"]["name"] = "input"  # type: ignore[index]
    target = io.BytesIO()
    savemat(target, held)
    assert read_raos(put(tmp_path, "supply.mat", target.getvalue())).name == "supply"


def test_wamit_takes_frequencies_a_length_limits_and_several_bodies(tmp_path: Path) -> None:
    by_frequency = wamit_text(RAOS, length=246.0, frequency=True)
    same(read_raos(put(tmp_path, "a.4", by_frequency), length=246.0), RAOS)
    with pytest.raises(InputError, match=r"a length of 2\d\d m"):
        read_raos(tmp_path / "a.4")
    limits = " -1.0 0.0 3 1.0 0.0 1.0 0.0\n 0.0 0.0 3 0.0 0.0 0.0 0.0\n"
    found = read_raos(put(tmp_path, "b.4", limits + wamit_text(RAOS)))
    same(found, RAOS)
    assert any("2 rows of zero or infinite period left out" in note for note in found.notes)
    second = re.sub(r"(?m)^(\S+ \S+) +(\d)", lambda m: f"{m[1]} {int(m[2]) + 6}", wamit_text(SHIP))
    both = put(tmp_path, "c.4", wamit_text(RAOS) + second)
    same(read_raos(both, body=1), RAOS)
    same(read_raos(both, body=2), SHIP)
    with pytest.raises(InputError, match="2 bodies"):
        read_raos(both)
    with pytest.raises(InputError, match="body must be one of 1, 2, got 3"):
        read_raos(both, body=3)


def test_wamit_forces_are_no_motions(tmp_path: Path) -> None:
    # Forces over rho g A L^n: as large as the water plane in long waves, nothing in short ones.
    forces = wamit_text(replace(RAOS, values=RAOS.values * 63.0))
    for suffix in (".3", ".2"):
        with pytest.raises(InputError, match=f"WAMIT writes exciting forces.* to a {suffix} file"):
            read_raos(put(tmp_path, f"a{suffix}", forces))
    headed = " WAMIT Numeric Output -- Filename  ellipsoid.3    06-Dec-2016\n" + forces
    with pytest.raises(InputError, match=r"b\.4: is called 'ellipsoid\.3' inside"):
        read_raos(put(tmp_path, "b.4", headed))
    bare = put(tmp_path, "c.4", forces)
    with pytest.raises(InputError, match="heave must be near 1 in the longest waves"):
        read_raos(bare)
    with pytest.raises(InputError, match="heave must be at most 50 m/m, got 6"):
        read_raos(bare, waves="period")
    assert np.abs(read_raos(bare, waves="period", check=False).mode("heave")).max() > 50.0


def test_wamit_of_short_waves_alone_asks_what_its_first_column_is(tmp_path: Path) -> None:
    short = replace(RAOS, omega=RAOS.omega[5:], values=0.5 * RAOS.values[5:])
    path = put(tmp_path, "a.4", wamit_text(short))
    with pytest.raises(InputError, match=r"all short\? In that case say waves=period"):
        read_raos(path)
    with pytest.warns(PhysicsWarning, match="too short for the check"):
        assert np.allclose(read_raos(path, waves="period").omega, short.omega)


def test_wamit_says_which_body_is_read_and_which_is_left_out(tmp_path: Path) -> None:
    second = re.sub(r"(?m)^(\S+ \S+) +(\d)", lambda m: f"{m[1]} {int(m[2]) + 6}", wamit_text(SHIP))
    alone = read_raos(put(tmp_path, "a.4", second))
    assert any("body 2: modes 7 to 12, the only ones in the file" in n for n in alone.notes)
    both = read_raos(put(tmp_path, "b.4", wamit_text(RAOS) + second), body=1)
    assert any("body 1: modes 1 to 6; left out: body 2" in note for note in both.notes)
    assert not any(
        "body" in note for note in read_raos(put(tmp_path, "c.4", wamit_text(RAOS))).notes
    )


def test_what_a_file_does_not_tell_can_be_told(tmp_path: Path) -> None:
    # Headings of one side that neither begin at 0 nor end at 180 deg.
    part = replace(SHIP, heading=SHIP.heading[2:6], values=SHIP.values[:, 2:6])
    path = put(tmp_path, "a.4", wamit_text(part))
    assert read_raos(path).heading.size == 4
    told = read_raos(path, symmetry="xz plane", waves="period", depth=70.0, origin=(3.0, 0.0, 1.0))
    assert told.heading_deg == pytest.approx([60, 90, 120, 150, 210, 240, 270, 300])
    assert np.allclose(told.values, SHIP.values[:, [2, 3, 4, 5, 7, 8, 9, 10]], rtol=1e-7)
    assert (told.depth, told.origin, told.phase_origin) == (70.0, (3.0, 0.0, 1.0), (3.0, 0.0))
    with pytest.raises(InputError, match="symmetry must be one of none, xz plane"):
        read_raos(path, symmetry="nearly")
    with pytest.raises(InputError, match="waves must be one of period, frequency; got 'length'"):
        read_raos(path, waves="length")
    away = replace(RAOS, phase_origin=(60.0, 0.0), depth=30.0)
    text = orcaflex_text(away, phase_origin="[60, 0, 0]")
    shallow = read_raos(put(tmp_path, "a.yml", text), depth=30.0, check=False)
    assert np.allclose(shallow.values, away.with_phase_origin((0.0, 0.0)).values, rtol=1e-7)


def test_shipx_and_mss_give_the_speed_that_is_asked_for(tmp_path: Path) -> None:
    fast = replace(RAOS, values=RAOS.values * np.linspace(1.0, 0.6, 8)[:, None, None])
    ship = put(tmp_path, "a.re1", shipx_text({0.0: RAOS, 5.144: fast}))
    same(read_raos(ship), RAOS)
    found = read_raos(ship, speed=5.144)
    same(found, fast)
    assert found.speed == 5.144
    with pytest.raises(InputError, match=r"speed must be one of 0, 5\.144 m/s, got 3 m/s"):
        read_raos(ship, speed=3.0)
    vessel = put(tmp_path, "a.mat", mat(RAOS, speeds=2))
    assert read_raos(vessel, speed=1.0).speed == 1.0


@pytest.mark.parametrize("wave", ["amplitude", "max wave slope", "wave steepness"])
@pytest.mark.parametrize("waves", ["period (s)", "frequency (rad/s)", "frequency (Hz)"])
@pytest.mark.parametrize("key", ["RAOPeriodOrFrequency", "RAOPeriodOrFreq"])
def test_orcaflex_units_of_waves_and_angles(
    wave: str, waves: str, key: str, tmp_path: Path
) -> None:
    for angles in ("degrees", "radians"):
        text = orcaflex_text(RAOS, wave=wave, waves=waves, key=key, angles=angles)
        same(read_raos(put(tmp_path, "a.yml", text)), RAOS)


@pytest.mark.parametrize(
    ("units", "metres"),
    [
        ("SI", 1.0),
        ("US", 0.3048),
        ("User\n  LengthUnits: m\n  MassUnits: kg\n  ForceUnits: N", 1.0),
        ("User\n  LengthUnits: ft\n  MassUnits: te", 0.3048),
        ("User\n  LengthUnits: km", 1000.0),
    ],
)
@pytest.mark.parametrize("wave", ["amplitude", "max wave slope"])
def test_orcaflex_lengths_are_in_the_unit_of_the_file(
    units: str, metres: float, wave: str, tmp_path: Path
) -> None:
    placed = replace(RAOS, origin=(4.0, -1.0, 2.0), phase_origin=(4.0, -1.0), depth=120.0)
    text = orcaflex_text(placed, wave=wave, units=units, metres=metres, depth=120.0)
    found = read_raos(put(tmp_path, "a.yml", text), check=False)
    same(found, placed)
    assert found.origin == pytest.approx((4.0, -1.0, 2.0))
    assert found.phase_origin == pytest.approx((4.0, -1.0))
    assert found.depth == pytest.approx(120.0)
    assert any("converted" in note for note in found.notes) == (metres != 1.0)
    # What a user says of the depth goes before what the file does.
    assert read_raos(tmp_path / "a.yml", check=False, depth=70.0).depth == 70.0


def test_orcaflex_long_waves_are_those_of_the_files_water_depth(tmp_path: Path) -> None:
    # A right table for 12 m of water: surge and sway are twelve times what they are in deep water.
    shallow = replace(RAOS, depth=12.0)
    k, deep = shallow.wave_number(shallow.omega), RAOS.wave_number(RAOS.omega)
    sweep, turn = 1.0 / np.tanh(12.0 * k)[:, None], (k / deep)[:, None]
    ones = np.ones_like(turn)
    scale = np.stack([sweep, sweep, ones, turn, turn, turn], axis=-1)
    text = orcaflex_text(replace(shallow, values=RAOS.values * scale), depth=12.0)
    check = check_long_waves(read_raos(put(tmp_path, "a.yml", text)))
    assert check.ok
    assert {row.verdict for row in check.rows} == {"ok"}


@pytest.mark.parametrize("sense", ["leads", "lags"])
@pytest.mark.parametrize(
    "relative_to", ["crest", "trough", "zero up-crossing", "zero down-crossing"]
)
def test_orcaflex_phases_and_positive_directions(
    sense: str, relative_to: str, tmp_path: Path
) -> None:
    for n, phases in enumerate(("degrees", "radians")):
        signs = (-1, 1, -1, 1, 1, -1) if n else (1, -1, 1, -1, -1, 1)
        text = orcaflex_text(
            RAOS, sense=sense, relative_to=relative_to, phases=phases, signs=signs,
            spread_out=bool(n),
        )  # fmt: skip
        same(read_raos(put(tmp_path, "a.yml", text)), RAOS)


@pytest.mark.parametrize(
    ("symmetry", "directions"),
    [
        ("xz plane", [0, 1, 2, 3, 4, 5, 6]),
        ("xz plane", [6, 9, 8, 7, 10, 11, 0]),
    ],
)
def test_orcaflex_symmetry_gives_the_other_side(
    symmetry: str, directions: list[int], tmp_path: Path
) -> None:
    text = orcaflex_text(SHIP, symmetry=symmetry, directions=directions)
    same(read_raos(put(tmp_path, "a.yml", text)), SHIP)


def test_orcaflex_two_planes_make_a_circle_of_a_quadrant(tmp_path: Path) -> None:
    box = replace(SHIP, values=SHIP.values.copy())
    values = box.values.copy()
    values[:, :, 2] = values[:, 3:4, 2]  # as high ahead as astern
    box = replace(box, values=values)
    text = orcaflex_text(box, symmetry="xz and yz planes", directions=[0, 1, 2, 3])
    same(read_raos(put(tmp_path, "a.yml", text)), box)


def test_orcaflex_phase_origin_is_another_point_than_the_rao_origin(tmp_path: Path) -> None:
    placed = replace(RAOS, origin=(4.0, -1.0, 2.0), phase_origin=(4.0, -1.0))
    away = placed.with_phase_origin((30.0, 5.0))
    text = orcaflex_text(away, phase_origin="[30, 5, ~]")
    found = read_raos(put(tmp_path, "a.yml", text))
    same(found, placed)
    assert found.origin == (4.0, -1.0, 2.0)
    assert found.phase_origin == (4.0, -1.0)
    assert any("x = 30 m, y = 5 m" in note for note in found.notes)


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("    RAOPhaseConvention: leads\n", "", "RAOPhaseConvention is missing"),
        ("RAOWaveUnit: amplitude", "RAOWaveUnit: furlong", "RAOWaveUnit must be one of amplitude"),
        ("UnitsSystem: SI", "UnitsSystem: CGS", "UnitsSystem must be one of SI, US, User"),
        ("UnitsSystem: SI", "UnitsSystem: User", "LengthUnits is missing"),
        ("UnitsSystem: SI", "UnitsSystem: User\n  LengthUnits: kg", "such as m, km, ft; got 'kg'"),
        ("General:", "Environment:\n  WaterDepth: deep\nGeneral:", "WaterDepth must be .* 'deep'"),
        ("VesselTypes:", "VesselKinds:", "no list of VesselTypes"),
        ("DisplacementRAOs:", "OtherRAOs:", "it may have load RAOs only"),
        ("RAODirection: 30", "RAODirection: north", "RAODirection must be a finite number"),
        ("Symmetry: None", "Symmetry: Circular", "must have 1 heading, got 12"),
    ],
)
def test_an_orcaflex_file_that_is_wrong_is_answered_by_key(
    before: str, after: str, words: str, tmp_path: Path
) -> None:
    text = orcaflex_text(RAOS)
    assert before in text
    with pytest.raises(InputError, match=words):
        read_raos(put(tmp_path, "a.yml", text.replace(before, after, 1)))


def test_what_is_no_rao_file_is_said_to_be_none(tmp_path: Path) -> None:
    for name, content, words in (
        ("a.yml", "name: subsea-crane\nsea: {}\n", "no RAO file of a kind that is known"),
        ("a.csv", "Tp;Heave\n8;1\n", "a table has columns such as 'Period"),
        ("a.bin", bytes(range(256)) * 4, "no RAO file, but a binary file of no kind"),
        ("a.csv", b"PK\x03\x04\x14\x00xl/workbook.xml\x00", "no RAO file, but an Excel workbook"),
        ("a.4", b"\x89PNG\r\n\x1a\n\x00", r"no RAO file, but a picture \(PNG\)"),
        ("a.txt", "   \n", "the file is empty"),
        ("a.re8", shipx_text({0.0: RAOS}).replace("MOTION", "FORCE"), "holds forces"),
        ("a.mat", b"MATLAB 7.3 MAT-file" + bytes(600), "version 7.3 are not read"),
    ):
        with pytest.raises(InputError, match=words):
            read_raos(put(tmp_path, name, content))
    with pytest.raises(InputError, match="no such file"):
        read_raos(tmp_path / "lost.csv")
    with pytest.raises(InputError, match="no bundled vessel of this name"):
        read_raos("queen-mary")
    with pytest.raises(InputError, match="format must be one of csv"):
        read_raos(put(tmp_path, "a.4", wamit_text(RAOS)), file_format="nemoh")
    with pytest.raises(InputError, match="draught says nothing about a wamit file"):
        read_raos(tmp_path / "a.4", draught="deep")
    known = r"ulen says nothing .* \(its options: body, depth, length, origin, waves\)"
    with pytest.raises(InputError, match=known):
        read_raos(tmp_path / "a.4", ulen=80.0)
    with pytest.raises(InputError, match="is a folder"):
        read_raos(tmp_path)
    with pytest.raises(InputError, match="no bundled vessel of this name"):
        read_raos("a" * 300)
    with pytest.raises(InputError, match="no text, as was expected, but an Excel workbook"):
        read_raos(tmp_path / "a.csv", file_format="wamit")


@pytest.mark.parametrize("kind", ["wamit", "shipx", "orcaflex"])
def test_a_file_that_was_cut_off_says_so(kind: str, tmp_path: Path) -> None:
    name, write = WRITERS[kind]
    text = str(write(RAOS))
    lines = text.splitlines(keepends=True)
    end = len(lines) * 2 // 3
    with pytest.raises(InputError, match=r"cut off|missing|YAML"):
        read_raos(put(tmp_path, name, "".join(lines[:end])))


def test_a_wamit_line_that_contradicts_itself_is_found(tmp_path: Path) -> None:
    lines = wamit_text(RAOS).splitlines()
    words = lines[40].split()
    words[4] = str(float(words[4]) + 180.0)
    with pytest.raises(InputError, match="contradicts itself"):
        read_raos(put(tmp_path, "a.4", "\n".join([*lines[:40], " ".join(words), *lines[41:]])))


def test_a_heading_that_is_there_twice_must_say_the_same() -> None:
    rows = np.ones((4, 6))
    omega = [0.3, 0.6, 0.3, 0.6]
    turn = 2.0 * math.pi
    w, b, table = grid("file", omega, [0.0, 0.0, turn, turn - 1e-9], rows)
    assert (w.size, b.size, table.shape) == (2, 1, (2, 1, 6))
    rows[2] *= 1.5
    with pytest.raises(InputError, match="is there twice, with other numbers"):
        grid("file", omega, [0.0, 0.0, turn, turn], rows)


# Real files.


@needs_mss
def test_the_supply_vessel_of_mss_and_of_shipx_is_one() -> None:
    text, matlab = read_raos(MSS / "supply.re1"), read_raos(MSS / "supply.mat")
    assert text.values.shape == matlab.values.shape == (36, 36, 6)
    assert np.allclose(text.heading, matlab.heading, atol=1e-12)
    assert np.allclose(text.values, matlab.values, rtol=0.0, atol=1e-12)
    assert text.name == "Supply"
    assert matlab.name == "supply"
    assert text.origin == pytest.approx((-5.38592, 0.0, 0.0))


@needs_mss
@pytest.mark.parametrize("file", ["supply.re1", "supply.mat"])
@pytest.mark.parametrize(
    ("heading", "y", "period", "sigma", "velocity"),
    [
        (180.0, 15.0, 7.0, 0.357, 0.313),
        (180.0, -15.0, 9.0, 0.516, 0.372),
        (180.0, 15.0, 13.0, 0.602, 0.327),
        (150.0, 15.0, 9.0, 0.419, 0.317),
        (150.0, -15.0, 9.0, 0.691, 0.494),
        (90.0, 15.0, 9.0, 0.385, 0.324),
        (90.0, -15.0, 9.0, 0.967, 0.714),
    ],
)
def test_the_crane_tip_of_the_supply_vessel_moves_as_others_computed(
    file: str, heading: float, y: float, period: float, sigma: float, velocity: float
) -> None:
    # JONSWAP, gamma 3.3, H_s 2.5 m, the tip 25 m abaft the point whose motions the RAOs are.
    raos = read_raos(MSS / file)
    sea = SeaSpectrum(kind="jonswap", significant_height=2.5, peak_period=period, gamma=3.3)
    omega = np.linspace(raos.omega[0], raos.omega[-1], 4001)
    rows = raos.heave_at((raos.origin[0] - 25.0, y, 10.0), math.radians(heading))

    def deviations(heave: np.ndarray) -> tuple[float, float]:
        density = np.abs(heave) ** 2 * sea.density(omega)
        rate = np.trapezoid(omega**2 * density, omega)
        return math.sqrt(np.trapezoid(density, omega)), math.sqrt(rate)

    # They went straight from row to row in the complex plane: the same figures to their digits.
    straight = np.interp(omega, raos.omega, rows.real) + 1j * np.interp(
        omega, raos.omega, rows.imag
    )
    assert deviations(straight) == pytest.approx((sigma, velocity), rel=0.006)
    # That cuts the corners of a phase which turns 60 deg a row where T_p is 7 s: 3 % too little.
    ours = deviations(
        raos.at((raos.origin[0] - 25.0, y, 0.0)).response(omega, math.radians(heading))[:, 2]
    )
    assert ours == pytest.approx((sigma, velocity), rel=0.035 if period == 7.0 else 0.02)
    assert ours == pytest.approx(deviations(CubicSpline(raos.omega, rows)(omega)), rel=0.005)


@needs_mss
def test_the_tanker_of_wamit_keeps_the_limits_of_long_waves() -> None:
    tanker = read_raos(MSS / "tanker.4")
    k = tanker.wave_number(tanker.omega[0])
    assert tanker.omega[0] == pytest.approx(2.0 * math.pi / 163.88)
    head, beam = tanker.response(tanker.omega[0], [math.pi, 0.5 * math.pi])
    assert head[2] == pytest.approx(1.0, abs=2e-3)
    assert head[4] / k == pytest.approx(-1j, abs=6e-3)
    assert beam[3] / k == pytest.approx(-1j, abs=1e-2)


BEM = DATA / "bemrosetta"
needs_bem = pytest.mark.skipif(not BEM.is_dir(), reason="the real files are not here")


@needs_bem
def test_the_exciting_forces_of_an_ellipsoid_are_refused() -> None:
    with pytest.raises(
        InputError, match=r"ellipsoid\.3: WAMIT writes exciting forces to a \.3 file"
    ):
        read_raos(BEM / "ellipsoid.3")


@needs_bem
def test_a_box_of_aqwa_keeps_the_limits_of_long_waves() -> None:
    box = read_raos(BEM / "aqwa_box1.LIS")
    check = check_long_waves(box)
    assert check.ok
    assert {row.verdict for row in check.rows} == {"ok"}
    assert (box.origin, box.depth, box.heading.size) == ((0.0, 2.0, -1.0), 70.0, 4)
    # Phases relative to the crest above the centre of gravity: 2 m to port would turn them 12 deg.
    sway = box.response(1.0, 0.5 * math.pi)[1]
    assert complex(sway) == pytest.approx(-0.9091j, abs=1e-4)


@needs_bem
def test_a_listing_of_wamit_without_motions_says_what_it_has() -> None:
    with pytest.raises(InputError, match="it has diffraction exciting forces and moments"):
        read_raos(BEM / "ellipsoid.out")


@needs_bem
def test_an_orcaflex_vessel_in_units_of_the_users_own_is_the_one_in_si() -> None:
    with pytest.warns(PhysicsWarning, match="no usual mistake"):  # odd in both
        si, own = (read_raos(BEM / f"RunB_{name}.yml") for name in ("SI", "m_kg_kN"))
    assert np.allclose(si.values, own.values, rtol=1e-6, atol=1e-9)
    assert (si.depth, own.depth) == (1000.0, 1000.0)


@needs_bem
def test_an_orcaflex_file_tells_its_water_depth() -> None:
    raos = read_raos(BEM / "Orca.flex.yml")
    assert raos.depth == 100.0
    check = check_long_waves(raos)
    assert check.ok
    assert {row.verdict for row in check.rows} == {"ok"}


def loads(name: str) -> VesselRaos:
    """Read the wave loads [kN] of a file, which has them by the conventions of its motions."""
    text = (OFX / name).read_text("utf-8-sig").replace("DisplacementRAOs:", "Motions:")
    return parse_orcaflex(name, text.replace("LoadRAOs:", "DisplacementRAOs:"))


@needs_ofx
def test_two_conventions_of_orcaflex_give_the_same_complex_loads() -> None:
    files = ("refcase_ofx_lags.yml", "refcase_ofx_leads_zero_down.yml")
    lags, leads = (loads(name) for name in files)
    largest = np.abs(lags.values).max()
    assert np.allclose(lags.values, leads.values, rtol=0.0, atol=1e-12 * largest)
    # Another reader has 324.2107 - 54.6653i kN/m for heave at 1 rad/s, with e^{-i omega t}.
    row = int(np.argmin(np.abs(lags.omega - 1.0)))
    found = lags.values[row, 2, 2]
    assert lags.heading_deg[2] == pytest.approx(90.0)
    assert complex(found) == pytest.approx(324.2107 + 54.6653j, abs=1e-3)


@needs_ofx
def test_the_barge_of_orcaflex_feels_the_loads_that_capytaine_computed() -> None:
    import h5py

    # One barge, two programs, two meshes.  Its middle is at (2.53, 0) in OrcaFlex's file, where
    # load and phase refer to, and at (0, 0) in Capytaine's.
    orcaflex = loads("barge_100x30x4_q1.yml")
    assert orcaflex.origin == pytest.approx((2.53, 0.0, -1.974))
    with h5py.File(OFX / "barge_100x30x4.nc") as file:
        parts = [file[key][()] for key in ("diffraction_force", "Froude_Krylov_force")]
        omega = file["omega"][()]
        degrees = np.degrees(file["wave_direction"][()])
        dofs = [name.decode() for name in file["influenced_dof"][()]]
    total = parts[0] + parts[1]
    force = np.conj(total[0] + 1j * total[1])  # Capytaine's time factor is e^{-i omega t}
    rows = np.flatnonzero((orcaflex.omega > 0.25) & (orcaflex.omega < 1.1))
    assert rows.size == 11
    for name, mode in (("Surge", 0), ("Sway", 1), ("Heave", 2)):
        largest = np.abs(force[:, :, dofs.index(name)]).max()
        for column, heading in enumerate(degrees):
            if round(float(heading), 6) % 45.0:
                continue  # not a row of both
            theirs = CubicSpline(omega, force[:, column, dofs.index(name)])(orcaflex.omega[rows])
            ours = 1e3 * orcaflex.response(orcaflex.omega[rows], math.radians(heading))[:, mode]
            assert np.abs(ours - theirs).max() < 0.035 * largest, (name, heading)


def test_the_bundled_vessel_is_read_by_name_and_keeps_the_limits() -> None:
    names = [name for name, _ in bundled_vessels()]
    assert "osv-83m" in names
    vessel = read_raos("osv-83m")
    assert vessel.name == "osv-83m"
    assert vessel.heading.size >= 24
    assert np.allclose(mirrored(vessel).values, vessel.values, atol=1e-3)


@needs_mss
@needs_ofx
def test_reading_takes_less_than_a_second() -> None:
    read_raos(MSS / "supply.mat")  # the first import
    for path in (MSS / "supply.mat", MSS / "supply.re1", MSS / "tanker.4"):
        start = time.process_time()
        read_raos(path)
        assert time.process_time() - start < 1.0
    start = time.process_time()
    loads("refcase_ofx_lags.yml")
    assert time.process_time() - start < 1.0
