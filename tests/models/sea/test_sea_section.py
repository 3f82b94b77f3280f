"""The sea in a case file: every kind, its errors, and changing it by path."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest

from models import Case, InputError, load_case
from models.sea import Spreading
from models.sea.sea import SPECTRA
from models.sea.sea_section import MeasuredSea, SumSea
from models.sea.shapes import WIND_TABLE

TABLE = {"omega": [0.4, 0.6, 0.8, 1.5], "density": [0.0, 1.0, 0.5, 0.02]}
PARTS = [
    {"spectrum": "jonswap", "significant_height": "1.5 m", "peak_period": "6 s"},
    {
        "spectrum": "gaussian-swell",
        "significant_height": "2 m",
        "peak_period": "14 s",
        "width": "5 mHz",
    },
]
SECTIONS = {
    "bretschneider-1975": {"significant_height": 2.0, "significant_period": 8.0},
    "bretschneider": {"significant_height": 2.0, "peak_period": 8.0},
    "pierson-moskowitz": {"significant_height": 2.0},
    "jonswap": {"significant_height": 2.0, "peak_period": 8.0, "gamma": "auto"},
    "tma": {"significant_height": 2.0, "peak_period": 8.0, "depth": "25 m"},
    "torsethaugen": {"significant_height": 2.0, "peak_period": 8.0},
    "ochi-hubble": {"significant_height": 2.0, "peak_period": 8.0, "order": 3},
    "gaussian-swell": {"significant_height": 2.0, "peak_period": 14.0, "width": "0.03 rad/s"},
    "measured": {"table": TABLE},
    "sum": {"parts": PARTS},
}


@pytest.fixture(scope="module")
def crane():
    return load_case("subsea-crane")


def with_sea(case, **fields):
    return case.replace({"sea": fields})


def test_there_is_a_section_of_every_kind():
    assert set(SECTIONS) == set(SPECTRA)


@pytest.mark.parametrize("kind", SPECTRA)
def test_every_kind_comes_back_from_its_yaml_and_takes_another_height(crane, kind, tmp_path):
    case = with_sea(crane, spectrum=kind, **SECTIONS[kind])
    sea = case.sea.to_spectrum()
    assert sea.kind == kind
    assert case.sea.significant_height == pytest.approx(sea.significant_height)
    assert case.sea.spectral_peak_period == pytest.approx(2.0 * math.pi / sea.peak_frequency)
    assert 0.0 < case.sea.steepness < 0.1
    path = tmp_path / "again.yaml"
    path.write_text(case.to_yaml(), encoding="utf-8")
    again = load_case(path)
    assert again == case
    assert again.sea.to_spectrum() == sea
    assert pickle.loads(pickle.dumps(case)).sea.to_spectrum() == sea
    higher = case.replace({"sea.significant_height": "3 m"})
    assert higher.sea.to_spectrum().significant_height == 3.0
    assert higher.sea.to_spectrum().statistics.m0 == pytest.approx(9.0 / 16.0, rel=0.02)
    if kind not in ("pierson-moskowitz", "torsethaugen", "jonswap"):  # whose shape follows H_s
        omega = np.geomspace(0.3, 5.0, 40)
        ratio = (3.0 / sea.significant_height) ** 2
        np.testing.assert_allclose(higher.sea.to_spectrum()(omega), ratio * sea(omega), 1e-9)


def test_what_follows_from_other_fields_is_not_written(crane):
    for kind in ("measured", "sum", "pierson-moskowitz"):
        tree = with_sea(crane, spectrum=kind, **SECTIONS[kind]).to_dict()["sea"]
        assert set(tree) <= {"spectrum", *SECTIONS[kind]}


@pytest.mark.parametrize("kind", ["bretschneider-1975", "bretschneider", "pierson-moskowitz"])
@pytest.mark.parametrize("row", range(len(WIND_TABLE)))
def test_a_sea_by_its_wind_is_that_of_the_thesis(crane, kind, row):
    knots, feet, average = WIND_TABLE[row]
    case = with_sea(crane, spectrum=kind, wind_speed=f"{knots} knots")
    assert case.sea.significant_height == pytest.approx(0.3048 * feet, rel=1e-12)
    if kind == "bretschneider-1975":
        assert case.sea.significant_period == pytest.approx(math.sqrt(2.0) * average, rel=1e-12)
    again = case.replace({"sea.wind_speed": "21 knots"})
    assert again.sea.significant_height == pytest.approx(0.3048 * 9.0, rel=1e-12)
    lower = case.replace({"sea.significant_height": 1.0})
    assert lower.sea.significant_height == 1.0
    assert lower.sea.spectral_peak_period == pytest.approx(case.sea.spectral_peak_period)
    sea = lower.sea.to_spectrum()
    assert 2.0 * math.pi / sea.peak_frequency == pytest.approx(case.sea.spectral_peak_period)


def test_the_design_sea_of_the_thesis_is_its_wind_of_20_knots():
    thesis = load_case("thesis-1975")
    wind = with_sea(thesis, spectrum="bretschneider-1975", wind_speed="20 knots")
    assert wind.sea.significant_height == pytest.approx(thesis.sea.significant_height, rel=1e-12)
    # The table's average period is rounded to 5.7 s, so T_S is only known to 1 %.
    assert wind.sea.significant_period == pytest.approx(thesis.sea.significant_period, rel=0.01)


def test_gamma_by_itself(crane):
    for height, period, gamma in ((4.0, 7.0, 5.0), (4.0, 10.5, 1.0), (4.0, 9.0, math.exp(0.575))):
        sea = {"significant_height": height, "peak_period": period, "gamma": "auto"}
        found = with_sea(crane, spectrum="jonswap", **sea).sea.to_spectrum()
        # exp(5.75 - 1.15 T_p/sqrt(H_s)) between 3.6 and 5 (DNV-RP-C205).
        assert found.gamma == pytest.approx(gamma, rel=1e-12)
    rougher = with_sea(crane, spectrum="jonswap", **sea).replace({"sea.significant_height": 6.0})
    assert rougher.sea.to_spectrum().gamma == pytest.approx(
        math.exp(5.75 - 1.15 * 9.0 / math.sqrt(6.0))
    )


def test_a_file_is_found_beside_the_case(crane, tmp_path, monkeypatch):
    header = "#YY MM DD hh mm " + " ".join(f".{i:02d}00" for i in range(5, 30, 5))
    rows = ["2020 01 01 00 00 0.1 4.0 1.0 0.3 0.1", "2020 01 01 01 00 0.2 9.0 2.0 0.5 0.2"]
    (tmp_path / "buoy.txt").write_text("\n".join([header, *rows]), encoding="utf-8")
    tree = crane.to_dict()
    tree["sea"] = {"spectrum": "measured", "file": "buoy.txt", "record": 1, "beyond": "zero"}
    path = tmp_path / "my.yaml"
    path.write_text(Case.from_dict(tree, folder=tmp_path).to_yaml(), encoding="utf-8")
    text = path.read_text().replace(str(tmp_path / "buoy.txt"), "buoy.txt")
    assert "file: buoy.txt" in text
    path.write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path.parent)
    case = load_case(path)
    assert case.sea.file == str(tmp_path / "buoy.txt")
    first = case.replace({"sea.record": 0})
    variance = {k: (0.05 * np.trapezoid(row)) for k, row in enumerate(
        ([0.1, 4.0, 1.0, 0.3, 0.1], [0.2, 9.0, 2.0, 0.5, 0.2]))}  # fmt: skip
    assert case.sea.significant_height == pytest.approx(4.0 * math.sqrt(variance[1]), rel=1e-9)
    assert first.sea.significant_height == pytest.approx(4.0 * math.sqrt(variance[0]), rel=1e-9)
    assert case.sea.spectral_peak_period == pytest.approx(10.0)
    # A file that changes under its name is read again.
    (tmp_path / "buoy.txt").write_text("\n".join([header, rows[0], rows[0]]), encoding="utf-8")
    with pytest.raises(InputError, match=r"record must be in \[0, 0\] in .*buoy.txt, got 1"):
        load_case(path)


def test_spreading(crane):
    assert crane.sea.to_spectrum().spreading is None
    case = crane.replace({"sea.spreading": {"kind": "cos-n", "exponent": 4}})
    assert case.sea.to_spectrum().spreading == Spreading(kind="cos-n", exponent=4.0)
    with pytest.raises(InputError, match=r"sea\.spreading\.kind: must be 'cos-2s' or 'cos-n'"):
        crane.replace({"sea.spreading": {"kind": "cosine", "exponent": 4}})


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"spectrum": "jonswap", "peak_period": 8}, "sea.significant_height: is missing"),
        (
            {"spectrum": "tma", "significant_height": 2, "peak_period": 8},
            "sea.depth: is missing: the tma spectrum needs it",
        ),
        (
            {"spectrum": "jonswap", "significant_height": 2, "peak_period": 8, "depth": 20},
            "sea.depth: is not for the jonswap spectrum, which takes peak_period",
        ),
        (
            {"spectrum": "pierson-moskowitz", "significant_height": 2, "peak_period": 8},
            "sea.peak_period: is not for the pierson-moskowitz spectrum, which takes no period",
        ),
        (
            {
                "spectrum": "gaussian-swell",
                "significant_height": 2,
                "peak_period": 10,
                "width": "0.1 Hz",
            },
            r"sea.width: must be in \[0.00314159, 0.10472\] rad/s, got 0.62",
        ),
        (
            {"spectrum": "tma", "significant_height": 2, "peak_period": 8, "depth": "1 um"},
            r"sea.depth: must be a length in \[1, 12000\] m, got '1 um'",
        ),
        ({"spectrum": "measured"}, "sea.table: is missing: the measured spectrum needs a table or"),
        (
            {"spectrum": "measured", "table": {"omega": [1, 2, 2], "density": [1, 1, 1]}},
            "sea.table.omega: must be strictly ascending, got 2 followed by 2",
        ),
        (
            {"spectrum": "measured", "table": {"omega": [1, 2, 3], "density": [1, 1]}},
            r"sea.table.density: must have as many rows as omega \(3\), got 2",
        ),
        (
            {"spectrum": "measured", "table": {"omega": [1, 2, 3], "density": [0, 0, 0]}},
            "sea.table: must hold some energy",
        ),
        ({"spectrum": "measured", "file": "none.txt"}, "sea.file: no such file: 'none.txt'"),
        ({"spectrum": "measured", "table": TABLE, "record": 3}, "sea.record: is for a file"),
        ({"spectrum": "sum"}, "sea.parts: is missing: the sum spectrum needs it"),
        (
            {"spectrum": "sum", "parts": [{"spectrum": "jonswap", "peak_period": 8}]},
            r"sea.parts\[0\].significant_height: is missing",
        ),
        (
            {"spectrum": "sum", "parts": [*PARTS, {"spectrum": "sum"}]},
            r"sea.parts\[2\].spectrum: must not be a sum itself",
        ),
        (
            {"spectrum": "pierson-moskowitz", "wind_speed": "12 knots"},
            "sea.wind_speed: must be 18 to 24.5 knots .*got 12 knots .* rows .* below 18 knots are "
            "lost",
        ),
        (
            {"spectrum": "bretschneider", "wind_speed": "30 knots"},
            "sea.wind_speed: must be 18 to 24.5 knots .*got 30 knots .*Table 3 ends there",
        ),
        (
            {"spectrum": "bretschneider", "wind_speed": "20 knots", "peak_period": 8},
            "sea.peak_period: is not for a sea by its wind_speed, which gives the period",
        ),
        (
            {"spectrum": "jonswap", "wind_speed": "20 knots"},
            "sea.wind_speed: is not for the jonswap spectrum: it is for bretschneider-1975, ",
        ),
        (
            {"spectrum": "measured", "table": {"omega": [1, 2, 3], "density": [900, 900, 900]}},
            r"sea.significant_height: must be in \(0, 30\] m, got 1.* from the data",
        ),
    ],
)
def test_one_clear_sentence_for_each_mistake(crane, fields, message):
    with pytest.raises(InputError, match=message) as caught:
        with_sea(crane, **fields)
    assert len(str(caught.value).splitlines()) == 1


def test_units_of_a_measured_density(crane):
    one = with_sea(crane, spectrum="measured", table=TABLE)
    hertz = {
        "omega": [f"{w / (2.0 * math.pi)!r} Hz" for w in TABLE["omega"]],
        "density": [f"{2.0 * math.pi * s!r} m^2/Hz" for s in TABLE["density"]],
    }
    other = with_sea(crane, spectrum="measured", table=hertz)
    assert other.sea.significant_height == pytest.approx(one.sea.significant_height, rel=1e-12)
    with pytest.raises(InputError, match=r"sea\.table\.density\[1\]: .*unknown unit 'm2 s'"):
        with_sea(crane, spectrum="measured", table={**TABLE, "density": [0, "1 m2 s", 1, 0]})


def test_a_section_alone(tmp_path):
    sea = SumSea(spectrum="sum", parts=PARTS)
    assert sea.significant_height == 2.5
    assert sea.to_spectrum() is sea.to_spectrum()
    with pytest.raises(InputError, match="must be the path of a file of wave spectra, got the"):
        MeasuredSea(spectrum="measured", file=str(tmp_path))


def test_a_part_of_a_sum_is_changed_by_its_path(crane):
    case = with_sea(crane, spectrum="sum", parts=PARTS)
    other = case.replace({"sea.parts.0.significant_height": "1.2 m"})
    assert other.sea.significant_height == pytest.approx(math.hypot(1.2, 2.0))
    assert other.sea.to_spectrum().parts[0].significant_height == 1.2
