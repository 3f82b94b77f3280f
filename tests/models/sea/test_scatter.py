"""Scatter diagrams: classes, files and their errors."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.basics import InputError
from models.sea import Scatter, SeaSpectrum, read_scatter, write_scatter
from models.sea.scatter_files import zero_crossing_ratio

LIST = """\
# a site
H_s [m], T_p [s], occurrence
0.5, 5.5, 30

1.5, 6.5, 10
2.5, 9.5, 0
"""


def written(folder, text, name="site.csv"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def states_of(site):
    columns = (site.significant_height, site.peak_period, site.occurrence)
    return list(zip(*(column.tolist() for column in columns), strict=True))


def test_a_list(tmp_path):
    site = read_scatter(written(tmp_path, LIST))
    assert states_of(site) == [(0.5, 5.5, 0.75), (1.5, 6.5, 0.25)]
    assert site.total == 40.0
    assert site.mean_significant_height == 0.75
    assert [site.share_below(h) for h in (0.4, 0.5, 2.0)] == [0.0, 0.75, 1.0]
    with pytest.raises(ValueError, match="read-only"):
        site.occurrence[0] = 1.0


@pytest.mark.parametrize(
    "text",
    [
        "significant_height,peak_period,occurrence\n0.5,5.5,30\n1.5,6.5,10\n",
        "Hs;Tp;n\n0,5;5,5;30\n1,5;6,5;10\n",
        "Tp\tHm0\tPercent\n5.5\t0.5\t75\n6.5\t1.5\t25\n",
        "hs,tp,count\nm,s,-\n0.5,5.5,30\n1.5,6.5,10\n",
        "\ufeffH_s (cm), T_p (s), share\r\n50, 5.5, .3\r\n150, 6.5, .1\r\n",
        "H_s [m] \\ T_p [s], 5-6, 6-7, sum\n0-1, 30, 0, 30\n1-2, , 10, 10\nsum, 30, 10, 40\n",
        "Tp/Hs, 0.5, 1.5\n5.5, 30, 0\n6.5, 0, 10\n",
    ],
)
def test_the_same_diagram_in_many_forms(tmp_path, text):
    site = read_scatter(written(tmp_path, text))
    np.testing.assert_allclose(site.significant_height, [0.5, 1.5], rtol=1e-12)
    np.testing.assert_allclose(site.peak_period, [5.5, 6.5], rtol=1e-12)
    np.testing.assert_allclose(site.occurrence, [0.75, 0.25], rtol=1e-12)


@pytest.mark.parametrize("gamma", [1.0, 2.0, 3.3, 5.0, 7.0])
def test_zero_crossing_periods_become_peak_periods(tmp_path, gamma):
    sea = SeaSpectrum(kind="jonswap", significant_height=2.0, peak_period=9.0, gamma=gamma)
    # DNV's fit is within 0.5 % of the spectrum itself over a band that ends at 60 rad/s.
    ratio = sea.statistics.zero_crossing_period / 9.0
    assert zero_crossing_ratio(gamma) == pytest.approx(ratio, rel=5e-3)
    path = written(tmp_path, "H_s [m] \\ T_z [s], 6-7, 7-8\n0-1, 10, 30\n")
    site = read_scatter(path, gamma=gamma)
    np.testing.assert_allclose(site.peak_period * zero_crossing_ratio(gamma), [6.5, 7.5])


def test_months_and_headings_survive_a_file(tmp_path):
    site = Scatter(
        significant_height=[1.0, 2.0, 1.0],
        peak_period=[6.0, 8.0, 6.0],
        occurrence=[1, 2, 3],
        month=[1, 1, 7],
        heading=[0.0, math.pi, 1.0],
        source="a site",
    )
    again = read_scatter(write_scatter(tmp_path / "out.csv", site))
    for name in ("significant_height", "peak_period", "occurrence", "month", "heading"):
        np.testing.assert_allclose(getattr(again, name), getattr(site, name), rtol=1e-14)


@given(
    states=st.lists(
        st.tuples(st.floats(0.05, 12.0), st.floats(2.0, 20.0), st.integers(1, 12)),
        min_size=1,
        max_size=60,
    ),
    height_step=st.floats(0.1, 3.0),
    period_step=st.floats(0.1, 4.0),
)
def test_classes_lose_no_time(states, height_step, period_step):
    heights, periods, months = zip(*states, strict=True)
    steps = {"height_step": height_step, "period_step": period_step}
    every = Scatter.from_records(heights, periods, month=months, height_step=None, period_step=None)
    binned = Scatter.from_records(heights, periods, month=months, **steps)
    assert len(every) == len(states)
    assert binned.occurrence.sum() == pytest.approx(1.0, rel=1e-12)
    assert binned.total == len(states)
    assert abs(binned.mean_significant_height - np.mean(heights)) <= 0.5 * height_step + 1e-9
    for month in set(months):
        share = float(binned.occurrence[binned.month == month].sum())
        assert share == pytest.approx(months.count(month) / len(months), rel=1e-12)
    rows, columns, table = every.matrix(**steps)
    assert table.shape == (rows.size - 1, columns.size - 1)
    assert table.sum() == pytest.approx(1.0, rel=1e-12)


def test_records_without_a_sea_are_left_out():
    site = Scatter.from_records([1.0, math.nan, 0.0, 2.0], [6.0, 7.0, 8.0, math.inf])
    assert len(site) == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("H_s,T_p\n1,2\n", "must have the columns .*; occurrence is missing"),
        ("H_s,count\n1,2\n", r"peak_period \(or zero_crossing_period\) is missing"),
        ("H_s,T_p,n,n\n1,2,3,4\n", "has two columns of occurrence"),
        ("H_s,T_p,n\n1,2,3\n1,x,3\n", r"site\.csv:3: peak_period must be a finite number, got 'x'"),
        ("H_s,T_p,n\n1,2,3\n1,2\n", r"site\.csv:3: must have 3 columns, got 2"),
        ("H_s,T_p,n\n1,2,-3\n", r"row 1: occurrence must be at least 0, got -3"),
        ("H_s,T_p,n\n1,2,0\n", "at least one row with an occurrence above 0"),
        ("H_s,T_p,n\n1,0,3\n", r"row 1: peak_period must be in \(0, 60\] s, got 0"),
        ("H_s,T_p,n\n99,8,3\n", r"row 1: significant_height must be in \(0, 30\] m, got 99"),
        ("H_s [s],T_p,n\n1,2,3\n", "unit of significant_height must be one of m, .*got 's'"),
        ("H_s,T_p,n,heading\n1,2,3,4\n", "column of headings must say its unit"),
        ("H_s,T_p,n,month\n1,2,3,13\n", r"month must be whole numbers in \[1, 12\]"),
        ("H_s,T_p,n\n1,2,inf\n", "occurrence must be a finite number"),
        ("H_s/T_p,4,5\n1,2\n", r"site\.csv:2: must have 2 occurrences, got 1"),
        ("H_s/T_p,4,5\n", "must have at least one row and one column"),
        ("H_s/T_p,4,b\n1,2,3\n", "a class of the matrix must be a finite number, got 'b'"),
        ('H_s,T_p,n\n"1,2,3\n', "is not a row of a CSV file"),
        ("H_s,T_p,n\n1,2,\0\n", "is not a text file"),
    ],
)
def test_errors(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        read_scatter(written(tmp_path, text))


def test_no_file(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_scatter(tmp_path / "none.csv")
    with pytest.raises(InputError, match="is a folder"):
        read_scatter(tmp_path)


@pytest.mark.parametrize("seed", range(4))
def test_damaged_files_are_told_in_our_words(tmp_path, seed):
    rng = np.random.default_rng(seed)
    whole = [LIST.encode(), b"H_s/T_z, 4-5, 5-6\n0-1, 3, 4\n1-2, 5, 6\n"]
    for index in range(150):
        raw = bytearray(whole[index % 2])
        if index % 3 == 0:
            raw = raw[: rng.integers(0, len(raw))]
        for at in rng.integers(0, max(len(raw), 1), rng.integers(0, 8)):
            if raw:
                raw[at] = rng.integers(0, 256)
        path = tmp_path / "damaged.csv"
        path.write_bytes(bytes(raw))
        try:
            site = read_scatter(path)
        except InputError:
            continue
        assert site.occurrence.sum() == pytest.approx(1.0)


@pytest.mark.parametrize(
    "text",
    [
        "Hs \\ Tp,<5,5-7,7-9,>9\n<1,1,2,3,4\n1-2,5,6,7,8\n>2,9,10,11,12\n",
        "Hs \\ Tp,up to 5,6,8,9+\nbelow 1,1,2,3,4\n1.5,5,6,7,8\n>= 2,9,10,11,12\n",
    ],
)
def test_open_classes_are_as_wide_as_their_neighbours(tmp_path, text):
    if "1.5" in text:
        # One centre alone does not say how wide its class is.
        with pytest.raises(InputError, match="the open class '>= 2' must have a class beside"):
            read_scatter(written(tmp_path, text))
        text = text.replace("\n1.5", "\n1-2")
    site = read_scatter(written(tmp_path, text))
    assert sorted(set(site.significant_height)) == [0.5, 1.5, 2.5]
    assert sorted(set(site.peak_period)) == [4.0, 6.0, 8.0, 10.0]
    assert site.total == 78.0


def test_open_classes_in_a_list(tmp_path):
    text = "H_s [cm],T_p,n\n<100,6,1\n100-300,6,1\n>300,>8,1\n300-500,6-8,1\n"
    site = read_scatter(written(tmp_path, text))
    # The lowest class does not reach below a flat sea.
    assert site.significant_height.tolist() == pytest.approx([0.5, 2.0, 4.0, 4.0])
    assert site.peak_period.tolist() == [6.0, 6.0, 9.0, 7.0]
    with pytest.raises(InputError, match="peak_period must be a finite number, got '<x'"):
        read_scatter(written(tmp_path, "H_s,T_p,n\n1,<x,1\n"))
