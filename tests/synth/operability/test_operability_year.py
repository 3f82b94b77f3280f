"""Operability over the year: shares by hand, headings, data sets, files, figures, the command."""

from __future__ import annotations

import csv
import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from designs import thesis_design
from hypothesis import given, settings
from hypothesis import strategies as st

from models import InputError, load_case
from models.sea import Scatter, write_scatter
from stillhook.cli import main
from stillhook.commands import axis
from stillhook.seas import (
    capability_figure,
    contour_figure,
    depth_figure,
    heading_figure,
    scatter_figure,
)
from stillhook.seas.operability import netcdf, operability_report
from stillhook.text import Table
from synth.operability import Contour, Operability, operability
from synth.operability.contour import heading_shares
from synth.operability.criteria import Stability
from synth.operability.study import example_scatter
from synth.operability.workable import RULES, class_width, rule_shares, workable

pytestmark = pytest.mark.filterwarnings("ignore::models.basics.checks.PhysicsWarning")

TURN = 2.0 * math.pi


def contour(limits: list[list[float]], headings: list[float] | None = None) -> Contour:
    """A contour with one criterion, at 6 and 10 s."""
    heights = np.array([limits])
    return Contour(
        criteria=(Stability(),),
        periods=np.array([6.0, 10.0]),
        headings=None if headings is None else np.radians(headings),
        heights=heights,
        drag=np.zeros(heights.shape[1:]),
    )


@cache
def study() -> Operability:
    return operability(
        thesis_design(), periods=[6.0, 9.0, 12.0], payload_rms=0.05, scatter="example"
    )


@cache
def turning() -> Operability:
    case = load_case("thesis-1975").replace(
        {
            "vessel.raos": "osv-83m",
            "vessel.hook": {"x": -25.0, "y": -15.0, "z": 20.0},
            "vessel.heading": "150 deg",
        }
    )
    return operability(
        case, periods=[6.0, 9.0, 12.0], payload_rms="300 mm", scatter="example", depths=[1500, 2000]
    )


def test_shares_are_sums_over_the_states_below_the_limit() -> None:
    # The limit is 1 m at 6 s and 3 m at 10 s, so 2 m at 8 s; 12 s is not on the contour.
    site = Scatter(
        significant_height=np.array([0.9, 1.2, 1.95, 2.05, 2.9, 0.5]),
        peak_period=np.array([6.0, 6.0, 8.0, 8.0, 10.0, 12.0]),
        occurrence=np.array([10.0, 20.0, 30.0, 15.0, 5.0, 20.0]),
        month=np.array([1, 1, 1, 7, 7, 7]),
    )
    assert class_width(site) == 0.0  # heights at no multiples of a step
    found = workable(contour([[1.0, 3.0]]), site)
    assert found.share == pytest.approx(0.10 + 0.30 + 0.05)
    assert found.outside == pytest.approx(0.20)
    assert found.by_month == pytest.approx({1: 40.0 / 60.0, 7: 5.0 / 40.0})
    assert found.binding == pytest.approx({"stability": 0.35})
    assert found.best_heading is None


def test_a_limit_within_a_class_makes_its_part_workable() -> None:
    heights = np.array([0.25, 0.75, 1.25, 1.75])
    site = Scatter(
        significant_height=heights, peak_period=np.full(4, 8.0), occurrence=np.full(4, 25.0)
    )
    assert class_width(site) == pytest.approx(0.5)
    assert workable(contour([[1.1, 1.1]]), site).share == pytest.approx(0.25 * (1 + 1 + 0.2))
    # The same sea cut fifty times finer, state by state.
    fine = np.concatenate([h - 0.25 + 0.5 * (np.arange(50) + 0.5) / 50 for h in heights])
    assert np.mean(fine <= 1.1) == pytest.approx(0.25 * 2.2, abs=0.005)


@settings(max_examples=40, deadline=None)
@given(st.floats(0.05, 9.0), st.floats(1.0, 2.0))
def test_a_higher_limit_never_loses_a_day(limit: float, factor: float) -> None:
    site = example_scatter()
    low, high = (workable(contour([[v, v]]), site).share for v in (limit, factor * limit))
    assert high >= low - 1e-12


def test_headings_of_the_diagram_and_of_the_vessel_meet() -> None:
    axis = [0.0, 90.0, 180.0, 270.0]
    limits = contour([[1.0, 1.0], [2.0, 2.0], [3.0, 3.0], [2.0, 2.0]], axis)
    head, beam = math.radians(180.0), math.radians(90.0)
    site = Scatter(
        significant_height=np.array([2.5, 2.5]),
        peak_period=np.array([8.0, 8.0]),
        occurrence=np.array([60.0, 40.0]),
        heading=np.array([head, beam]),
    )
    found = workable(limits, site)
    assert found.share == pytest.approx(0.6)
    assert found.best_heading == pytest.approx(1.0)
    # With the bow turned by 270 deg, the beam seas become head seas and the others beam seas.
    assert found.by_heading[math.radians(270.0)] == pytest.approx(0.4)
    assert workable(limits, site, math.radians(270.0)).share == pytest.approx(0.4)
    # Without directions, the heading is that of the waves.
    plain = Scatter(significant_height=[2.5], peak_period=[8.0], occurrence=[1.0])
    assert workable(limits, plain, beam).share == 0.0
    assert workable(limits, plain, head).share == 1.0


@settings(max_examples=60, deadline=None)
@given(st.floats(-10.0, 10.0))
def test_values_between_headings_go_round_the_circle(angle: float) -> None:
    axis = np.radians([0.0, 60.0, 120.0, 180.0, 240.0, 300.0])
    rows = np.array([[1.0], [4.0], [2.0], [7.0], [3.0], [5.0]])
    found = (rows * heading_shares(axis, [angle])).sum(axis=0)
    wound = np.append(rows[:, 0], rows[0, 0])
    expected = np.interp(angle % TURN, np.append(axis, TURN), wound)
    assert found[0] == pytest.approx(expected, abs=1e-6)


def test_headings_that_do_not_go_round_are_not_made_up() -> None:
    axis, rows = np.radians([90.0, 135.0, 180.0]), np.array([[1.0, 1.0], [2.0, 2.0], [3.0, 3.0]])
    assert (rows * heading_shares(axis, np.radians([100.0, 180.0]))).sum(axis=0)[1] == 3.0
    with pytest.raises(InputError, match="must reach 200 deg or go round, got 90 to 180 deg"):
        heading_shares(axis, np.radians([200.0]))
    with pytest.raises(InputError, match="has no headings"):
        contour([[1.0, 1.0]]).at([8.0], [0.0])


def test_one_heading_alone_is_that_of_all_waves_without_directions() -> None:
    limits = contour([[2.0, 2.0]], [45.0])
    plain = Scatter(significant_height=[1.5], peak_period=[8.0], occurrence=[1.0])
    assert workable(limits, plain, math.radians(150.0)).share == 1.0
    towards = Scatter(
        significant_height=[1.5], peak_period=[8.0], occurrence=[1.0], heading=[math.radians(90.0)]
    )
    with pytest.raises(InputError, match="must reach 90 deg"):
        workable(limits, towards)


def test_a_vessel_that_turns_works_at_least_as_much() -> None:
    for at in turning().depths:
        for share in at.workable.values():
            assert share.best_heading is not None
            assert share.best_heading >= max(share.by_heading.values()) - 1e-12
            assert share.share <= share.best_heading + 1e-12


def test_the_design_holds_what_the_single_evaluations_say() -> None:
    checks = study().verify(3)
    assert len(checks) == 3
    assert all(check.ok and check.difference < 1e-8 for check in checks)


def test_the_rules_of_thumb_are_the_thesiss_table() -> None:
    table = (
        Path(__file__).parents[4] / "shared" / "thesis" / "tables" / "table2_operating_limits.csv"
    )
    if not table.exists():
        pytest.skip("the thesis's tables are not here")
    with open(table, encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    for (safe, marginal), row in zip(RULES.values(), rows, strict=True):
        assert safe == float(row["safe_max_m"]) == float(row["marginal_min_m"])
        assert marginal == float(row["marginal_max_m"]) == float(row["dangerous_above_m"])


def test_shares_of_the_rules_are_those_of_the_distribution() -> None:
    # The example's H_s is Weibull in each month: the exact share below a height is known.
    scales = (3.0, 2.8, 2.5, 2.0, 1.6, 1.4, 1.3, 1.4, 1.8, 2.3, 2.6, 2.9)
    days = (31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31)
    for name, *shares in rule_shares(example_scatter()):
        for limit, share in zip(np.array(RULES[name]) / 1.27, shares, strict=True):
            exact = sum(
                d / 365.0 * (1.0 - math.exp(-((limit / s) ** 1.5)))
                for d, s in zip(days, scales, strict=True)
            )
            assert share == pytest.approx(exact, abs=0.015)


def test_the_data_set_says_what_everything_is_and_survives_a_file(tmp_path: Path) -> None:
    for found in (study(), turning()):
        data = found.dataset
        for name, variable in data.variables.items():
            if name not in ("limit", "unit"):
                assert variable.attrs["long_name"], name
            if variable.dtype.kind == "f" and name != "bound":
                assert variable.attrs["units"], name
        path = tmp_path / "o.nc"
        path.write_bytes(netcdf(data))
        with xr.open_dataset(path, engine="h5netcdf") as read:
            xr.testing.assert_allclose(read.height_held, data.height_held)
            assert list(read.binding_held.values.ravel()) == list(data.binding_held.values.ravel())
            assert read.attrs["sea"] == "bretschneider-1975"
    assert turning().dataset.height_held.dims == ("rope_length", "heading", "peak_period")
    months = turning().dataset.workable_by_month_held
    assert months.dims == ("rope_length", "month")
    whole = study().dataset
    site = example_scatter()
    assert site.month is not None
    parts = [float(site.occurrence[site.month == m].sum()) for m in range(1, 13)]
    assert float(whole.workable) == pytest.approx(float(parts @ whole.workable_by_month.values))


def test_the_tree_and_the_table_hold_every_contour() -> None:
    text = str(study())
    assert "no headings" in text
    assert "with the drum held" in text
    lines = list(csv.reader(study().to_csv().splitlines()))
    assert len(lines) == 1 + 3 * 3
    assert lines[0][:3] == ["rope_length_m", "drum_layer", "system"]
    height = lines[0].index("height_m")
    for row in lines[1:]:
        lowest = min(float(v) for v in row[height + 2 :] if v)
        assert float(row[height]) == pytest.approx(lowest)


def test_tables_end_where_figures_do_at_the_steepest_seas() -> None:
    """At 6 s seas of more than 3.75 m break, at 9 s of 7.9 m, at 12 s of 11.56 m."""
    (at,) = study().depths
    heights = np.full_like(at.contours["loop"].heights, np.inf)
    heights[0] = 24.0, 2.0, 30.0
    steep = replace(at, contours={**at.contours, "loop": replace(at.main, heights=heights)})
    tall = replace(study(), depths=(steep,))
    (table,) = [
        item
        for section in operability_report(tall).sections
        for item in section.items
        if isinstance(item, Table) and item.headings[0] == "T_p"
    ]
    names = [column.name for column in table.columns]
    loop = names.index("loop")
    first = at.main.criteria[0].name.removeprefix("motor.")
    assert [row[loop : loop + 2] for row in table.rows] == [
        (">3.75", "steepest seas"),
        ("2.00", first),
        (">11.56", "steepest seas"),
    ]
    assert f"H_s 2 m to the steepest seas, set by {at.main.criteria[0].name}" in str(tall)


@pytest.mark.parametrize("rules", [False, True])
def test_rules_of_thumb_are_told_where_asked(rules: bool) -> None:
    items = [i for s in operability_report(study(), rules=rules).sections for i in s.items]
    told = [i for i in items if isinstance(i, Table) and "rules of thumb" in i.headings[0]]
    assert len(told) == int(rules)


@pytest.mark.parametrize("kind", ["contour", "capability", "scatter", "headings", "depths"])
def test_every_figure_can_be_drawn(kind: str) -> None:
    from stillhook.text import picture

    draw = {
        "contour": contour_figure,
        "capability": capability_figure,
        "scatter": scatter_figure,
        "headings": heading_figure,
        "depths": depth_figure,
    }[kind]
    both = [turning()] if kind in ("headings", "depths") else [study(), turning()]
    for found in both:
        assert picture(draw(found), "png").startswith(b"\x89PNG")


def test_roses_can_be_drawn_where_no_sea_can_be_worked_in() -> None:
    from stillhook.text import picture

    (at,) = turning().depths[:1]
    flat = {
        name: replace(found, heights=np.zeros_like(found.heights))
        for name, found in at.contours.items()
    }
    nowhere = replace(turning(), depths=(replace(at, contours=flat),))
    assert picture(heading_figure(nowhere), "png").startswith(b"\x89PNG")


def test_axes_are_read_as_ranges_and_lists() -> None:
    assert axis(1.0)("--tp", "5..7") == [5.0, 6.0, 7.0]
    assert axis(30.0)("--headings", "0..90/45") == [0.0, 45.0, 90.0]
    assert axis(0.5, 1.0, 40.0)("--tp", "6..7.5") == [6.0, 6.5, 7.0, 7.5]
    for text in ("7..5", "a,b", "5..6/0", "1..2..3", "nan", "1..1e9/1e-3"):
        with pytest.raises(InputError, match="--tp: must be"):
            axis(1.0)("--tp", text)
    with pytest.raises(InputError, match="HIGH/STEP, at most"):
        axis(None)("--depths", "100..200")


@pytest.mark.ci
def test_the_command_writes_tables_and_figures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    site, out = tmp_path / "site.csv", tmp_path / "out"
    write_scatter(site, example_scatter())
    words = ["operability", "thesis-1975", "--tp", "6..12/3", "--payload-rms", "5 cm"]
    assert main([*words, "--scatter", str(site), "--rules", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "is beyond the limit" in said
    assert "3 points of the contour by single evaluations" in said
    assert "ship-mounted derrick" in said
    assert "no headings" in said
    names = {path.name for path in out.iterdir()}
    wanted = {"operability.csv", "operability.nc", "workable.csv", "contour.svg", "scatter.png"}
    assert wanted | {"case.yaml", "capability.svg"} <= names
    assert "headings.svg" not in names
    # A run without a diagram leaves nothing of it behind.
    words = ["operability", "thesis-1975", "--tp", "8", "--held", "--quiet", "--out", str(out)]
    assert main(words) == 0
    assert "scatter.png" not in {path.name for path in out.iterdir()}


def test_the_command_refuses_in_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ["--out", str(tmp_path)]
    assert main(["operability", "thesis-1975", "--rules", *out]) == 2
    assert "--rules goes with --scatter" in capsys.readouterr().err
    assert main(["operability", "thesis-1975", "--held", "--reoptimise", *out]) == 2
    assert "--held goes without" in capsys.readouterr().err
    assert main(["operability", "thesis-1975", "--headings", "0..90", *out]) == 2
    assert "has no headings" in capsys.readouterr().err
    assert main(["operability", "thesis-1975", "--scatter", str(tmp_path / "no.csv"), *out]) == 2
    assert "no.csv" in capsys.readouterr().err
    unstable = "A=-200,a=50,a1=100,a2=100"
    assert main(["operability", "thesis-1975", "--gains", unstable, *out]) == 2
    assert "no stabilising controller" in capsys.readouterr().err
