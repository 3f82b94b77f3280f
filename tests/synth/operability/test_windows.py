"""Weather windows: against counting by hand, and the limits of records against single seas."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from designs import thesis_design
from hypothesis import given, settings
from hypothesis import strategies as st

from models import InputError, load_case
from models.sea import SeaSeries
from stillhook.cli import main
from stillhook.seas import (
    calendar_figure,
    load_windows,
    months_figure,
    save_windows,
    window_list,
    windows_table,
)
from synth.design import evaluate_gains
from synth.operability import (
    Operability,
    VesselHeading,
    WeatherWindows,
    alpha_factor,
    example_series,
    operability,
    recheck_records,
    weather_windows,
    window_times,
)
from synth.operability.columns import sea_column
from synth.operability.contour import contour_of
from synth.operability.criteria import payload_criteria
from synth.operability.pose import pose_operability
from synth.operability.recheck import evaluate_in
from synth.operability.record_limits import study_axes
from synth.operability.study import example_scatter
from synth.operability.windows import HOUR, SystemWindows

pytestmark = pytest.mark.filterwarnings("ignore::models.basics.checks.PhysicsWarning")

HOURS = np.timedelta64(1, "h")
GAINS = {"A": 200.0, "a": 20.0, "a1": 12.0, "a2": 60.0}


def series(hours: list[float], height: list[float] | None = None) -> SeaSeries:
    time = np.datetime64("2020-01-01T00", "s") + np.round(3600.0 * np.array(hours)).astype(
        "timedelta64[s]"
    )
    size = [1.0] * len(hours) if height is None else height
    return SeaSeries.from_arrays(time, size, np.full(len(hours), 8.0))


def counted(seas: SeaSeries, limit: float, planned: float, spare: float = 0.0) -> WeatherWindows:
    """Windows below one limit in all seas."""
    rows = np.full(len(seas), limit)
    one = SystemWindows(
        limit=rows, allowed=rows, heading=np.full(len(seas), np.nan),
        binding=np.full(len(seas), "payload.rms"),
    )  # fmt: skip
    return WeatherWindows(
        case="made up",
        seas=seas,
        planned=planned * HOUR,
        contingency=spare * HOUR,
        heading="",
        alpha="none: 1",
        alpha_beyond=0.0,
        criteria=(),
        systems={"held": one},
    )


def rough(seed: int, records: int = 2000, gaps: bool = True) -> SeaSeries:
    """A slowly changing sea, hourly with some records missing."""
    rng = np.random.default_rng(seed)
    noise = np.zeros(records)
    for k in range(1, records):
        noise[k] = 0.97 * noise[k - 1] + rng.normal() * 0.25
    keep = np.ones(records, dtype=bool)
    if gaps:
        for start in rng.integers(1, records - 20, 12):
            keep[start : start + int(rng.integers(1, 7))] = False
    hours = np.arange(records)[keep]
    return series(hours.tolist(), np.exp(0.4 * noise[keep]).tolist())


def by_hand(
    seas: SeaSeries, limit: float, needed: float
) -> tuple[list[tuple[float, float]], list[float]]:
    """Windows and waits [h] by walking through the records one by one, on a grid of hours."""
    hours = [int(h) for h in ((seas.time - seas.time[0]) / HOURS)]
    good: set[int] = set()  # hours that are workable
    for k, hour in enumerate(hours):
        step = hours[k + 1] - hour if k + 1 < len(hours) else 1
        step = 1 if step > 3 else step
        if seas.significant_height[k] <= limit:
            good |= set(range(hour, hour + step))
    last = hours[-1] + 1
    windows, hour = [], 0
    while hour < last:
        end = hour
        while end in good:
            end += 1
        if end - hour >= needed:
            windows.append((float(hour), float(end)))
        hour = max(end, hour + 1)
    waits = []
    for hour in hours:
        start = hour
        while start < last and not all(h in good for h in range(start, start + int(needed))):
            start += 1
        waits.append(float(start - hour))
    return windows, waits


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("needed", [6, 24])
def test_windows_and_waits_are_those_of_counting_by_hand(seed: int, needed: int) -> None:
    seas = rough(seed)
    found = counted(seas, 1.0, needed)
    windows, waits = by_hand(seas, 1.0, needed)
    assert len(windows) > 3
    np.testing.assert_allclose(found.windows("held") / HOUR, windows)
    ours, cut = found.waits("held")
    np.testing.assert_allclose(ours / HOUR, waits)
    assert np.all(np.flatnonzero(cut) >= np.flatnonzero(~cut)[-1])
    whole = found.whole("held")
    spans = seas.spans / HOUR
    assert whole.workable == pytest.approx(spans @ (seas.significant_height <= 1.0) / spans.sum())
    inside = sum(end - begin for begin, end in windows)
    assert whole.inside == pytest.approx(inside / spans.sum())
    assert whole.inside < whole.workable  # some times are too short
    assert whole.count == len(windows)
    lengths = np.diff(windows, axis=1)
    assert (whole.mean_length, whole.longest) == pytest.approx(
        (lengths.mean() * HOUR, lengths.max() * HOUR)
    )
    assert whole.mean_wait == pytest.approx(np.average(waits, weights=spans) * HOUR)
    for month in found.months("held"):
        mine = seas.month == month.month
        begun = [
            b for b, _ in windows
            if (seas.time[0] + np.timedelta64(int(b), "h")).astype(object).month == month.month
        ]  # fmt: skip
        assert month.count == len(begun)
        own, weights = np.array(waits)[mine], spans[mine]
        assert month.mean_wait == pytest.approx(np.average(own, weights=weights) * HOUR)
        # Each quantile is the least wait that so much of the time does not exceed.
        for q, value in zip((0.1, 0.5), month.waits, strict=False):
            below = weights[own * HOUR <= value + 1.0].sum() / weights.sum()
            under = weights[own * HOUR < value - 1.0].sum() / weights.sum()
            assert under < q <= below + 1e-9
        assert math.isnan(month.waits[2]) == (len(begun) < 30)


def test_thirty_windows_say_what_ninety_per_cent_of_the_waits_are() -> None:
    height = ([0.5] * 8 + [2.0] * 12) * 36  # 36 windows within 30 days
    found = counted(series(list(range(720)), height), 1.0, 6)
    (january,) = found.months("held")
    assert january.count == 36
    # Within 20 hours: 3 starts at once (8 h window, 6 h needed), then waits of 17, 16, ..
    assert january.waits[2] == 15.0 * HOUR
    fewer = counted(series(list(range(560)), height[:560]), 1.0, 6)
    assert fewer.months("held")[0].count == 28
    assert math.isnan(fewer.months("held")[0].waits[2])


def test_a_gap_of_more_than_three_hours_ends_a_window() -> None:
    near = counted(series([0, 1, 2, 5, 6, 7]), 1.0, 6)
    np.testing.assert_allclose(near.windows("held"), [[0.0, 8.0 * HOUR]])
    far = counted(series([0, 1, 2, 5.5, 6.5, 7.5]), 1.0, 3)
    np.testing.assert_allclose(far.windows("held") / HOUR, [[0.0, 3.0], [5.5, 8.5]])
    assert len(counted(series([0, 1, 2, 5.5, 6.5, 7.5]), 1.0, 4).windows("held")) == 0


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 1000), st.floats(0.4, 2.0), st.floats(1.0, 1.5), st.integers(1, 30))
def test_calmer_work_waits_longer(seed: int, limit: float, more: float, needed: int) -> None:
    seas = rough(seed, 300)
    low, high = counted(seas, limit, needed), counted(seas, more * limit, needed)
    longer = counted(seas, limit, needed + 5)
    assert low.whole("held").workable <= high.whole("held").workable + 1e-12
    assert np.all(low.waits("held")[0] >= high.waits("held")[0] - 1e-6)
    assert np.all(longer.waits("held")[0] >= low.waits("held")[0] - 1e-6)
    # Whoever waits can start: the time from then on is a window's.
    wait, cut = low.waits("held")
    begin = (seas.time - seas.time[0]).astype(float) + wait
    for start in begin[~cut]:
        assert any(
            a <= start + 1e-6 and start + needed * HOUR <= b + 1e-6 for a, b in low.windows("held")
        )


def test_the_window_is_planned_time_and_contingency_and_at_most_72_hours() -> None:
    assert window_times("12h") == (12 * HOUR, 12 * HOUR)
    assert window_times("30 h", "42 h") == (30 * HOUR, 42 * HOUR)
    assert window_times(3600.0, 0.0) == (3600.0, 0.0)
    for words, message in (
        (("37 h",), "must be at most 72 h, got 37 h .* 37 h = 74 h"),
        (("60 h", "13 h"), "must be at most 72 h, got 60 h .* 13 h = 73 h"),
        (("0 h",), r"duration must be above 0 s, got 0"),
        (("12 m",), "duration: .*time"),
        (("12 h", "-1 h"), "contingency must be at least 0 s, got -3600"),
    ):
        with pytest.raises(InputError, match=message):
            window_times(*words)


TABLE = """\
# source: made up for this test
# edition: 1st, 2024
H_s [m], T_POP [h], level, alpha
1, 12, A, 0.6
3, 12, A, 0.8
1, 24, A, 0.5
3, 24, A, 0.7
1, 24, B, 0.4
"""


def test_alpha_is_a_number_or_a_table_with_its_source(tmp_path: Path) -> None:
    assert alpha_factor(0.8, 3600.0)(np.array([0.3, 9.0])).tolist() == [0.8, 0.8]
    path = tmp_path / "alpha.csv"
    path.write_text(TABLE, encoding="utf-8")
    found = alpha_factor(path, 12 * HOUR, "A")
    np.testing.assert_allclose(
        found(np.array([0.5, 1.0, 2.0, 3.0, 9.0])), [0.6, 0.6, 0.7, 0.8, 0.8]
    )
    assert "source: made up for this test, edition: 1st, 2024" in found.text
    assert "T_POP up to 12 h, forecast level A" in found.text
    # The next longer planned time counts.
    assert alpha_factor(path, 13 * HOUR, "A")(np.array([1.0])) == 0.5
    assert found.beyond(np.array([0.5, 2.0, np.inf])) == 0.5
    for text, words, message in (
        (TABLE, (HOUR, None), "forecast level must be one of A, B; got none"),
        (TABLE, (HOUR, "C"), "forecast level must be one of A, B; got 'C'"),
        (TABLE, (25 * HOUR, "A"), "T_POP must be at most 24 h, got 25 h"),
        (TABLE.replace("# source", "# by"), (HOUR, "A"), "in a line '# source: ...'"),
        (TABLE.replace("# edition", "# of"), (HOUR, "A"), "in a line '# edition: ...'"),
        (TABLE.replace("alpha", "f"), (HOUR, "A"), "must have the columns .*; alpha is missing"),
        (TABLE + "1, 12, A, 0.9\n", (HOUR, "A"), "has two rows for one H_s"),
        (TABLE + "1, 12, A, 1.9\n", (HOUR, "A"), r"alpha.csv:9: alpha must be in \(0, 1\]"),
        (TABLE + "1, 12\n", (HOUR, "A"), "must have 4 columns, got 2"),
    ):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(InputError, match=message):
            alpha_factor(path, *words)
    for number, level, message in (
        (1.2, None, r"alpha must be in \(0, 1\], got 1.2"),
        (0.8, "A", "forecast_level is for a table of alpha"),
        ("nowhere.csv", None, "nowhere.csv: no such file"),
    ):
        with pytest.raises(InputError, match=message):
            alpha_factor(number, HOUR, level)


def year(records: int = 400, seed: int = 5) -> SeaSeries:
    rng = np.random.default_rng(seed)
    height = rough(seed, records, gaps=False).significant_height
    period = np.clip(6.5 + 1.5 * height + rng.normal(0.0, 1.0, records), 5.5, 12.0)
    time = np.datetime64("2020-05-20T00") + np.arange(records) * HOURS
    bearing = np.radians(240.0 + 50.0 * np.sin(np.arange(records) / 40.0))
    return SeaSeries.from_arrays(time, height, period, bearing, source="made-up.csv")


@cache
def turning() -> Operability:
    """The thesis's winch over the side of a supply vessel, with gains of its own."""
    case = load_case("thesis-1975").replace(
        {
            "vessel.raos": "osv-83m",
            "vessel.hook": {"x": -25.0, "y": -15.0, "z": 20.0},
            "vessel.heading": "150 deg",
        }
    )
    angles = np.radians(np.arange(0.0, 360.0, 30.0))
    design = evaluate_gains(case, GAINS)
    return operability(design, payload_rms="300 mm", seas=year(), headings=angles)


def test_limits_of_records_are_those_of_single_seas() -> None:
    study, seas = turning(), year()
    rule = VesselHeading(bow=math.radians(200.0))
    found = weather_windows(study, seas, "6 h", heading=rule)
    checks = recheck_records(study, found, 12)
    assert len(checks) == 12
    assert max(check.difference for check in checks) < 0.01
    # On both sides of the limit a record is as its own sea says, but where it is as close as that.
    own = found.systems["loop"]
    design = study.design
    assert design is not None
    works, agreed = found.works("loop"), 0
    for k in range(0, len(seas), 16):
        sea = {
            "sea.significant_height": float(seas.significant_height[k]),
            "vessel.heading": float(own.heading[k] % math.tau),
        }
        changes = study.case.sea.peaking_at(float(seas.peak_period[k]))
        case = study.own_depth.case.variant(changes).replace(sea)
        loop = evaluate_in(design, case, study.own_depth.masses)
        criteria = [c for c in study.own_depth.contours["loop"].criteria if c.outputs]
        worst = max(c.use(c.worst(loop)) for c in criteria)
        if abs(seas.significant_height[k] / own.limit[k] - 1.0) > 0.02:
            assert works[k] == (worst <= 1.0)
            agreed += 1
    assert agreed > 15


def test_a_fine_contour_is_the_coarse_one_between_its_points() -> None:
    at = turning().own_depth
    coarse = at.contours["held"]
    fine = at.fine["held"]
    assert coarse.headings is not None
    assert fine.headings is not None
    for h, angle in enumerate(coarse.headings):
        for p, period in enumerate(coarse.periods):
            same = fine.heights[
                :, int(np.abs(fine.headings - angle).argmin()),
                int(np.abs(fine.periods - period).argmin()),
            ]  # fmt: skip
            np.testing.assert_allclose(same, coarse.heights[:, h, p], rtol=1e-9)
    # And between them that of a contour that was found there.
    question = pose_operability(at.case, payload_criteria(at.case, rms="300 mm"))
    apart = []
    for period, angle in ((7.3, 100.0), (8.1, 130.0), (9.7, 165.0), (10.9, 200.0)):
        column = sea_column(at.case, period, [math.radians(angle)])
        exact = contour_of(question.held, question.criteria["held"], [column]).limit[0, 0]
        looked = fine.at([period], [math.radians(angle)])[0]
        linear = coarse.at([period], [math.radians(angle)])[0]
        apart.append((abs(looked / exact - 1.0), abs(linear / exact - 1.0)))
    assert max(near for near, _ in apart) < 0.01
    assert sum(near for near, _ in apart) < 0.1 * sum(far for _, far in apart)


def test_the_vessel_lies_as_it_is_told() -> None:
    study, seas = turning(), year()
    own = weather_windows(study, seas, "6 h")
    assert np.allclose(own.systems["held"].heading, math.radians(150.0))
    assert own.heading == "the case's own heading to the waves, in every sea"
    fixed = weather_windows(study, seas, "6 h", heading=VesselHeading(bow=math.radians(240.0)))
    assert seas.direction is not None
    # The bow is where the waves come from on average: head seas within 50 deg.
    away = np.degrees(fixed.systems["held"].heading) - 180.0
    np.testing.assert_allclose(away, 240.0 - np.degrees(seas.direction), atol=1e-6)
    turned = weather_windows(
        study, seas, "6 h", heading=VesselHeading(bow=math.radians(240.0), within=math.radians(20))
    )
    best = weather_windows(study, seas, "6 h", heading=VesselHeading(within=math.pi))
    for name in ("held", "loop"):
        limits = [w.systems[name].limit for w in (fixed, turned, best)]
        assert np.all(limits[1] >= limits[0] - 1e-12)
        # A turn of 5 deg does not hit the best heading of every sea.
        assert np.all(limits[2] >= 0.99 * limits[1])
    off = np.abs(turned.systems["loop"].heading - fixed.systems["loop"].heading)
    assert np.degrees(off.max()) <= 20.0 + 1e-9
    assert str(VesselHeading(within=0.5)).startswith("best within 28.65 deg of head seas")


def test_records_without_a_direction_are_left_out_where_one_is_needed() -> None:
    whole = year()
    assert whole.direction is not None
    bearing = whole.direction.copy()
    bearing[10:12] = np.nan
    seas = SeaSeries.from_arrays(
        whole.time, whole.significant_height, whole.peak_period, bearing, source="made-up.csv"
    )
    rule = VesselHeading(bow=1.0)
    found = weather_windows(turning(), seas, "6 h", heading=rule)
    assert len(found.seas) == 398
    assert [r.reason for r in found.seas.quality.rejections] == ["no direction"]
    assert len(weather_windows(turning(), seas, "6 h").seas) == 400
    blind = SeaSeries.from_arrays(whole.time, whole.significant_height, whole.peak_period)
    with pytest.raises(InputError, match="has no directions for a vessel's compass heading"):
        weather_windows(turning(), blind, "6 h", heading=rule)
    with pytest.raises(InputError, match=r"within must be in \[0, 3.14159\] rad, got 4"):
        VesselHeading(within=4.0)


def test_axes_reach_every_sea_and_no_sector_that_none_comes_from() -> None:
    case, seas = turning().case, year()
    periods, angles = study_axes(case, seas, VesselHeading(bow=math.radians(240.0)))
    assert periods[0] <= seas.peak_period.min() <= seas.peak_period.max() <= periods[-1]
    assert angles is not None
    np.testing.assert_allclose(np.degrees(angles), np.arange(120.0, 241.0, 30.0))
    assert study_axes(case, seas, VesselHeading(within=math.pi))[1] is None


def test_alpha_lowers_what_is_allowed_and_is_told(tmp_path: Path) -> None:
    (tmp_path / "alpha.csv").write_text(TABLE, encoding="utf-8")
    study, seas = turning(), year()
    plain = weather_windows(study, seas, "6 h")
    less = weather_windows(study, seas, "6 h", alpha=tmp_path / "alpha.csv", forecast_level="A")
    limit = plain.systems["loop"].limit
    np.testing.assert_array_equal(less.systems["loop"].limit, limit)
    expected = np.interp(limit, [1.0, 3.0], [0.6, 0.8]) * limit
    np.testing.assert_allclose(less.systems["loop"].allowed, expected)
    assert less.whole("loop").workable < plain.whole("loop").workable
    assert "edition: 1st, 2024" in less.dataset.attrs["alpha"]
    assert 0.0 <= less.alpha_beyond <= 1.0


def test_windows_come_back_from_a_file(tmp_path: Path) -> None:
    found = weather_windows(
        turning(), year(), "6 h", contingency="2 h", heading=VesselHeading(bow=1.0), alpha=0.9
    )
    again = load_windows(save_windows(tmp_path / "windows.nc", found))
    for name in ("case", "planned", "contingency", "heading", "alpha", "alpha_beyond", "criteria"):
        assert getattr(again, name) == getattr(found, name)
    assert list(again.systems) == list(found.systems)
    for name in found.systems:
        assert again.months(name) == pytest.approx(found.months(name)) or str(
            again.months(name)
        ) == str(found.months(name))
        np.testing.assert_array_equal(again.windows(name), found.windows(name))
        assert list(again.systems[name].binding) == list(found.systems[name].binding)
    assert str(again) == str(found)
    (tmp_path / "other.nc").write_bytes(b"\x89HDF\r\n\x1a\nrubbish")
    with pytest.raises(InputError, match=r"other\.nc"):
        load_windows(tmp_path / "other.nc")
    (tmp_path / "text.nc").write_text("text")
    with pytest.raises(InputError, match=r"text\.nc: is no NetCDF 4 file of weather windows"):
        load_windows(tmp_path / "text.nc")
    found.dataset.assign_attrs(format="another").to_netcdf(tmp_path / "x.nc", engine="h5netcdf")
    with pytest.raises(InputError, match=r"x\.nc: holds no weather windows: .*format must be"):
        load_windows(tmp_path / "x.nc")


def test_tables_and_figures_show_what_was_counted() -> None:
    found = weather_windows(turning(), year(), "6 h")
    table = windows_table(found)
    names = [column.name for column in table.columns]
    rows = [dict(zip(names, row, strict=True)) for row in table.rows]
    whole = found.whole("loop")
    (row,) = (r for r in rows if r["system"] == "loop" and r["month"] is None)
    assert row["workable"] == whole.workable
    assert row["mean_wait_h"] == whole.mean_wait / HOUR
    assert [r["month"] for r in rows if r["system"] == "loop"] == [5, 6, None]
    listed = window_list(found)
    assert len(listed.rows) == sum(len(found.windows(name)) for name in found.systems)
    assert months_figure(found).axes[1].get_ylabel() == "windows"
    image = calendar_figure(found).axes[1].images[0].get_array()
    # Every hour of the record stands in the calendar once.
    assert int(np.count_nonzero(image)) == 400
    inside = sum(round((b - a) / HOUR) for a, b in found.windows("loop"))
    assert int(np.count_nonzero(image == 3.0)) == inside


def test_the_end_at_the_load_has_its_own_criteria() -> None:
    case = load_case("subsea-crane")
    daf, snap = payload_criteria(case, daf=1.3, snap="90%")
    assert (daf.name, daf.bound) == ("rope.lower_tension.daf", 1.3)
    assert snap.bound == pytest.approx(case.payload.taut_tension)
    study = operability(thesis_design(), periods=[8.0, 11.0], daf=1.019, snap=0.02)
    contour = study.own_depth.contours["loop"]
    named = {c.name: k for k, c in enumerate(contour.criteria)}
    d, s = (contour.heights[named[f"rope.lower_tension.{end}"], 0] for end in ("daf", "snap"))
    assert np.all((d > 0.0) & (d < 30.0))
    # Both are 1.9 % of the weight, which is doubted by 5 %.
    assert study.case.payload.weight_uncertainty == 0.05
    np.testing.assert_allclose(d, s, rtol=1e-6)
    # By hand, in the sea of the limit.
    criterion = contour.criteria[named["rope.lower_tension.daf"]]
    changes = study.case.sea.peaking_at(8.0)
    sea = study.own_depth.case.variant(changes).replace({"sea.significant_height": float(d[0])})
    loop = evaluate_in(thesis_design(), sea, study.own_depth.masses)
    dynamic = loop.peak("rope.lower_tension", criterion.duration)
    assert dynamic / study.case.payload.submerged_weight == pytest.approx(0.019, rel=1e-6)
    assert criterion.measure(loop) == pytest.approx(1.019, rel=1e-6)
    for words, message in (
        ({"daf": 1.0}, r"daf must be in \(1, 10\], got 1"),
        ({"snap": 1.2}, "snap must be"),
        ({"snap": 0.0}, "snap must be"),
    ):
        with pytest.raises(InputError, match=message):
            payload_criteria(case, **words)


def test_what_cannot_be_counted_is_refused() -> None:
    study = operability(load_case("thesis-1975"), periods=[6.0, 12.0], payload_rms="300 mm")
    with pytest.raises(InputError, match="vessel: has no headings"):
        weather_windows(study, year(), "6 h", heading=VesselHeading(within=0.5))
    assert weather_windows(study, year(), "6 h").heading == "none: the vessel has no headings"
    slow = series([0, 6, 12, 18])
    with pytest.raises(InputError, match="records must be at most 3 h apart"):
        weather_windows(study, slow, "6 h")
    with pytest.raises(InputError, match="has no peak_period of its own"):
        operability(
            load_case("thesis-1975").replace(
                {"sea": {"spectrum": "pierson-moskowitz", "significant_height": 2.0}}
            ),
            seas=year(),
        )


def test_the_year_of_the_example_is_of_its_site() -> None:
    seas, site = example_series(), example_scatter()
    assert len(seas) == 8760
    assert seas.quality.rejected == 0
    assert seas.direction is not None
    # One year of a site is not its long-term average, but near it.
    mean = float(seas.significant_height.mean())
    assert mean == pytest.approx(site.mean_significant_height, rel=0.15)
    low, high = np.percentile(seas.peak_period, [1, 99])
    assert (low, high) == pytest.approx((5.0, 13.5), abs=1.5)
    # An hour later the sea is much the same.
    height = np.log(seas.significant_height)
    assert np.corrcoef(height[1:], height[:-1])[0, 1] > 0.95


def test_the_command_counts_windows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    seas = year(200)
    assert seas.direction is not None
    with open("year.csv", "w", encoding="utf-8") as file:
        print("time,Hs,Tp,from", file=file)
        for k in range(len(seas)):
            row = (seas.significant_height[k], seas.peak_period[k], math.degrees(seas.direction[k]))
            print(seas.time[k], *(f"{value:.3f}" for value in row), sep=",", file=file)
    (tmp_path / "alpha.csv").write_text(TABLE, encoding="utf-8")
    words = ["operability", "thesis-1975", "--held", "--payload-rms", "500 mm"]
    told = ["--seas", "year.csv", "--duration", "6h", "--out", "out"]
    assert main([*words, *told, "--alpha", "alpha.csv", "--forecast-level", "A"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "T_R 12 h = T_POP 6 h + T_C 6 h" in said
    assert "source: made up for this test, edition: 1st, 2024" in said
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"windows.csv", "window_list.csv", "windows.nc", "windows-months.svg"} <= names
    assert load_windows("out/windows.nc").needed == 12 * HOUR
    for extra, message in (
        (["--duration", "6h"], "--duration is for weather windows; give --seas FILE, too"),
        (["--seas", "year.csv"], "--seas needs --duration"),
        ([*told, "--heading", "north"], "--heading must be DEG, DEG+-X, +-X or best"),
        ([*told, "--contingency", "70 h"], "must be at most 72 h, got 6 h + 70 h = 76 h"),
        ([*told, "--heading", "20+-10"], "vessel: has no headings"),
        ([*told, "--alpha", "alpha.csv"], "forecast level must be one of A, B; got none"),
        ([*told, "--place", "1,2"], "is of one place, so that none can be chosen; got '1,2'"),
        (["--daf", "0.9"], "--daf must be in (1, 10]"),
    ):
        assert main([*words, *extra]) == 2
        assert message in " ".join(capsys.readouterr().err.split())
    # Windows of an earlier run do not stay behind as if they were of this one.
    assert main([*words, "--out", "out", "--tp", "8", "--no-figures"]) == 0
    assert not {"windows.csv", "windows.nc"} & {p.name for p in (tmp_path / "out").iterdir()}
