"""The figures of runs: they show what the runs hold, and nothing is lost on the way."""

from __future__ import annotations

import io
import itertools
from dataclasses import replace
from functools import cache

import matplotlib as mpl
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from PIL import Image

import stillhook as sh
from models.basics import PhysicsWarning
from models.run import Event, NamedQuantity
from stillhook.runs import runs_report
from stillhook.runs.figures import comparison, exceedance
from stillhook.runs.strip import Scene, strip
from stillhook.runs.trace_figure import traces
from stillhook.runs.window import Window, envelope, runs_of_true, window_of
from stillhook.text import picture


def figures_of(runs: sh.Runs) -> set[str]:
    return {drawing.name for drawing in runs_report([runs]).drawings}


@cache
def calm() -> sh.Runs:
    """Feedback in a small sea: the payload moves a fiftieth of what the hook does."""
    case = sh.load_case("thesis-1975").replace({"sea.significant_height": 0.6})
    return sh.simulate(case, "feedback", seeds=3, duration="3 min", settle=40.0)


@cache
def held() -> sh.Runs:
    case = sh.load_case("thesis-1975").replace({"sea.significant_height": 0.6})
    return sh.simulate(case, "none", seeds=3, duration="3 min", settle=40.0)


@cache
def landing() -> sh.Runs:
    return sh.simulate(sh.load_case("landing"), "feed-forward", scenario="landing")


@cache
def splash() -> sh.Runs:
    with pytest.warns(PhysicsWarning, match="phase is missing"):
        return sh.simulate(sh.load_case("thesis-1975"), "feed-forward", scenario="splash")


@cache
def lost_link() -> sh.Runs:
    case = sh.load_case("thesis-1975").replace({"sea.significant_height": 0.3})
    return sh.simulate(case, "feedback", scenario="sensor-loss", duration="3 min")


MAKERS = {
    "traces of a payload at rest": lambda: traces(calm().worst),
    "traces of a landing": lambda: traces(landing()[0]),
    "traces of a lost link": lambda: traces(lost_link()[0]),
    "strip of a landing": lambda: strip(landing()[0], landing().scenario),
    "strip of a splash": lambda: strip(splash()[0], splash().scenario),
    "comparison": lambda: comparison([calm(), held()]),
    "exceedance": lambda: exceedance([calm()]),
}


@cache
def figure_of(name: str):
    figure = MAKERS[name]()
    figure.draw_without_rendering()
    return figure


def panel(figure, text: str):
    """The axes of both columns whose label on the left begins with a text."""
    rows = [axes for axes in figure.axes if axes.get_ylabel().startswith(text)]
    (left,) = rows
    place = figure.axes.index(left)
    return left, figure.axes[place + 1]


def curves(axes) -> list[np.ndarray]:
    """Lines with as many points as a trace has."""
    return [line for line in axes.get_lines() if len(line.get_xdata()) > 50]


# every figure


@pytest.mark.parametrize("name", MAKERS)
def test_texts_are_large_enough_and_stay_inside(name):
    figure = figure_of(name)
    texts = [
        text
        for text in figure.findobj(mpl.text.Text)
        if text.get_text() and text.get_visible() and text.get_window_extent().width > 0.0
    ]
    assert min(text.get_fontsize() for text in texts) >= 9.0
    whole = figure.get_window_extent()
    assert len(figure.get_suptitle()) > 20
    headings = [text for text in texts if text.get_text() == figure.get_suptitle()]
    headings += [axes._left_title for axes in figure.axes]
    headings += [axes.yaxis.label for axes in figure.axes] + list(figure.legends)
    for text in headings:
        box = text.get_window_extent()
        assert box.x0 >= whole.x0 - 1.0
        assert box.x1 <= whole.x1 + 1.0
    for left, right in itertools.pairwise(figure.axes):
        a, b = left._left_title, right._left_title
        if a.get_text() and b.get_text():
            assert not a.get_window_extent().overlaps(b.get_window_extent())


@pytest.mark.parametrize("name", MAKERS)
def test_every_axis_has_a_label_with_its_unit(name):
    figure = figure_of(name)
    labels = [axes.get_ylabel() for axes in figure.axes if axes.get_ylabel()]
    assert labels
    assert all("[" in label and label.endswith("]") for label in labels)
    lowest = [axes.get_xlabel() for axes in figure.axes if axes.get_xlabel()]
    assert lowest or name == "comparison"  # whose places have names


@pytest.mark.parametrize("name", ["traces of a payload at rest", "strip of a splash", "comparison"])
def test_no_picture_is_blank(name):
    image = np.asarray(Image.open(io.BytesIO(picture(figure_of(name), "png"))).convert("L"))
    dark = (image < 200).mean()
    assert 0.005 < dark < 0.6
    # Something is drawn in every quarter of it.
    height, width = image.shape
    for rows in (slice(None, height // 2), slice(height // 2, None)):
        for columns in (slice(None, width // 2), slice(width // 2, None)):
            assert (image[rows, columns] < 200).mean() > 1e-3


def test_the_same_runs_give_the_same_file():
    one, other = (picture(comparison([calm(), held()]), "svg") for _ in range(2))
    assert one == other


# traces


def test_the_window_shows_the_run_itself():
    run = calm().worst
    _, right = panel(figure_of("traces of a payload at rest"), "payload")
    (line,) = curves(right)
    window = window_of(run)
    rows = window.rows(run.time)
    assert np.array_equal(line.get_xdata(), run.time[rows])
    assert np.allclose(np.asarray(line.get_ydata()), 1e3 * run["payload.displacement"][rows])
    assert right.get_xlim() == pytest.approx((window.start, window.end), abs=0.02)


def test_the_envelope_on_the_left_keeps_every_peak():
    run = calm().worst
    left, _ = panel(figure_of("traces of a payload at rest"), "payload")
    (band,) = [c for c in left.collections if len(c.get_paths()[0].vertices) > 100]
    heights = band.get_paths()[0].vertices[:, 1]
    assert heights.max() == pytest.approx(1e3 * run["payload.displacement"].max())
    assert heights.min() == pytest.approx(1e3 * run["payload.displacement"].min())


def test_a_payload_that_hardly_moves_has_a_scale_of_its_own():
    labels = [axes.get_ylabel() for axes in figure_of("traces of a payload at rest").axes]
    assert "hook\n[mm]" in labels
    assert "payload\n[mm]" in labels
    labels = [axes.get_ylabel() for axes in figure_of("traces of a landing").axes]
    assert labels[0] == "hook, payload\n[m]"
    assert {"payload's error\n[mm]", "clearance below\n[m]"} <= set(labels)


def test_the_torque_limit_is_drawn_where_it_is():
    left, _ = panel(figure_of("traces of a payload at rest"), "motor torque")
    levels = [line.get_ydata()[0] for line in left.get_lines() if len(line.get_xdata()) == 2]
    assert 11.88 in [pytest.approx(level) for level in levels]  # 2 x 5.94 kN m
    static = calm().case.static_torque
    assert 1e-3 * static in [pytest.approx(level) for level in levels]
    assert left.get_ylim()[1] > 11.88


def test_events_are_numbered_and_told():
    figure = figure_of("traces of a lost link")
    run = lost_link()[0]
    event, blind = run.events  # the link goes, and a second later the law is blind
    assert figure.get_supxlabel() == f"1  at {event}\n2  at {blind}"
    first = figure.axes[0]
    assert [text.get_text() for text in first.texts] == ["1", "2"]
    assert any(list(line.get_xdata()) == [event.time] * 2 for line in first.get_lines())


def test_states_are_bars_over_their_periods():
    figure = figure_of("traces of a lost link")
    run = lost_link()[0]
    states = next(axes for axes in figure.axes if axes.get_yticklabels()[0].get_text() == "brake")
    names = [label.get_text() for label in states.get_yticklabels()]
    assert names == ["brake", "no link", "saturated"]
    (bar,) = states.collections[1].get_paths()
    start, end = bar.vertices[:, 0].min(), bar.vertices[:, 0].max()
    # Values count as missing when they are a second older than the link makes them.
    assert (start, end) == pytest.approx((121.0, 130.0), abs=0.1)
    assert run["payload.age"].max() == pytest.approx(10.0, abs=0.1)


def test_a_run_without_traces_has_no_figures():
    bare = replace(calm()[0], time=np.zeros(0), values=np.zeros((0, len(calm()[0].signals))))
    for make in (traces, strip):
        with pytest.raises(sh.InputError, match="the run with seed 0 has no time traces to draw"):
            make(bare)
    assert figures_of(replace(calm(), runs=(bare,))) == {"exceedance"}
    assert figures_of(calm()) == {"traces", "strip", "exceedance"}


def test_a_run_that_diverged_can_be_drawn():
    run = calm()[0]
    values = run.values.copy()
    values[-50:] = np.inf
    values[-20:] = np.nan
    message = "the simulation diverged at 179 s: the loop is unstable and nothing limits it"
    wild = replace(run, values=values, status="diverged", message=message)
    figure = traces(wild)
    assert figure.get_suptitle() == f"T{message[1:]}"
    picture(figure, "png")
    picture(strip(wild), "png")


# windows


def test_the_window_is_where_the_error_is_largest():
    run = calm()[0]
    window = window_of(run)
    settled = run.time >= 40.0
    at = run.time[settled][np.argmax(np.abs(run["payload.displacement"][settled]))]
    assert window.start <= at <= window.end
    assert window.end - window.start == pytest.approx(60.0)


def test_the_window_is_about_touchdown_or_trouble():
    run = landing()[0]
    touched = run.statistics.value("touch-down at")
    window = window_of(run)
    assert 0.5 * (window.start + window.end) == pytest.approx(touched)
    assert window.why == "touchdown"
    window = window_of(lost_link()[0])
    assert (window.start, window.why) == (pytest.approx(105.0), "about 120 s")


def test_the_window_shows_what_came_first_trouble_or_loss_of_lock():
    run = calm()[0]
    lost = {**run.statistics.quantities, "lost lock at": NamedQuantity(value=90.0, unit="s")}
    fallen = replace(run, statistics=replace(run.statistics, quantities=lost))
    assert window_of(fallen).why == "loss of lock"
    for time, why in ((80.0, "about 80 s"), (100.0, "loss of lock")):
        event = Event(time=time, kind="stroke", text="the drum is at its end")
        assert window_of(replace(fallen, events=(event,))).why == why


def test_a_short_run_is_shown_whole():
    run = sh.simulate(calm().case, "none", duration=20.0)[0]
    assert window_of(run) == Window(start=0.0, end=20.0, why="the whole run")
    assert len({axes.get_xlim() for axes in traces(run).axes}) == 1


@given(
    values=arrays.arrays(
        np.float64,
        st.integers(2, 400),
        elements=st.floats(-1e6, 1e6, allow_nan=False),
    ),
    bins=st.integers(1, 40),
)
def test_every_sample_lies_within_the_envelope(values, bins):
    time = 0.1 * np.arange(values.size)
    at, low, high = envelope(time, values, bins)
    assert (low <= high).all()
    assert (low.min(), high.max()) == (values.min(), values.max())
    assert at.size <= 2 * bins + 1
    assert (np.diff(at) > 0.0).all()
    # Part by part: those of a value's own time hold it.
    each = max(1, values.size // bins) if values.size // bins >= 2 else 1
    part = np.minimum(np.arange(values.size) // each, at.size - 1)
    assert ((low[part] <= values) & (values <= high[part])).all()


@given(flags=st.lists(st.booleans(), max_size=60))
def test_periods_cover_what_is_true(flags):
    time, flag = np.arange(float(len(flags))), np.array(flags, dtype=np.bool_)
    covered = np.zeros(len(flags), dtype=np.bool_)
    for start, end in runs_of_true(time, flag):
        covered |= (time >= start) & ((time < end) | (time == time[-1]))
    assert np.array_equal(covered & flag, flag)
    assert not (covered & ~flag)[:-1].any()


# strip


def test_the_strip_is_drawn_to_one_scale():
    run = calm().worst
    window = Window(start=100.0, end=130.0, why="test")
    scene = Scene.of(run, window)
    assert np.allclose(np.diff(scene.hook), np.diff(run["hook.heave"][window.rows(run.time)]))
    assert np.array_equal(scene.payload, run["payload.displacement"][window.rows(run.time)])
    assert scene.hook.min() > scene.payload.max()  # the ship does not touch its load
    assert np.allclose(scene.angle * run.case.drum_radius, run["drum.haul"][window.rows(run.time)])


def test_the_ground_is_under_the_payload_and_the_water_where_the_scenario_has_it():
    run = landing()[0]
    scene = Scene.of(run, Window(start=0.0, end=200.0, why="test"))
    assert scene.ground is not None
    assert np.allclose(scene.ground, -7.5, atol=1e-9)  # what the landing begins above
    assert scene.payload[-1] == pytest.approx(-7.5, abs=0.1)
    run, scenario = splash()[0], splash().scenario
    scene = Scene.of(run, Window(start=0.0, end=100.0, why="test"), scenario)
    assert scene.water is not None
    assert scene.water.mean() == pytest.approx(-scenario.surroundings.water.below, abs=0.3)
    assert scene.bottom < scene.water.min()


def test_slack_rope_is_told_in_the_strip():
    texts = [text.get_text() for text in figure_of("strip of a landing").axes[0].texts]
    assert "slack" in texts
    assert any(text.endswith(" kN") for text in texts)


# over seeds


def test_bars_are_means_and_dots_are_seeds():
    axes = figure_of("comparison").axes[0]
    factor = 1e-3 if "mm" in axes.get_ylabel() else 1.0
    tops = [bar.get_y() + bar.get_height() for bar in axes.patches]
    means = [runs.summary["payload rms"].mean for runs in (calm(), held())]
    assert factor * np.array(tops) == pytest.approx(means)
    dots = [line for line in axes.get_lines() if line.get_marker() == "."]
    values = [run.statistics.value("payload rms") for run in (*calm(), *held())]
    shown = np.concatenate([factor * np.asarray(line.get_ydata()) for line in dots])
    assert shown == pytest.approx(values)
    assert axes.get_yscale() == "log"  # the controllers differ by more than a factor of ten
    assert figure_of("comparison").get_suptitle().startswith("feedback holds best, ")


def test_controllers_that_the_seeds_cannot_tell_apart_share_the_first_place():
    runs = sh.simulate(calm().case, "feed-forward", seeds=3, duration="2 min")
    renamed = replace(runs, runs=tuple(replace(run, controller="twin") for run in runs))
    assert comparison([runs, renamed]).get_suptitle().startswith("feed-forward and twin hold best")


def test_dots_of_exceedance_count_crests():
    axes = figure_of("exceedance").axes[0]
    (dots,) = [line for line in axes.get_lines() if line.get_marker() == "."]
    level, time = float(dots.get_ydata()[-1]), float(dots.get_xdata()[-1])
    each = [run.statistics["payload.error"] for run in calm()]
    assert 1e-3 * level == pytest.approx(max(float(s.crests.max()) for s in each), rel=1e-6)
    assert time == pytest.approx(sum(run.statistics.duration for run in calm()))
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels == ["crests of the payload", "Rayleigh"]


def test_rayleighs_line_is_sigma_times_the_peak_factor():
    axes = figure_of("exceedance").axes[0]
    (line,) = [each for each in axes.get_lines() if each.get_label() == "Rayleigh"]
    time, level = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
    each = [run.statistics["payload.error"] for run in calm()]
    sigma = np.sqrt(np.mean([s.standard_deviation**2 for s in each]))
    period = np.average([s.period for s in each], weights=[s.cycles for s in each])
    expected = 1e3 * sigma * np.sqrt(2.0 * np.log(time / period))
    assert level == pytest.approx(expected, rel=1e-9)


def test_gumbels_line_has_its_interval_at_the_exposure_time():
    runs = sh.simulate(calm().case, "none", seeds=3, duration="65 min", settle=60.0, traces="worst")
    figure = exceedance([runs])
    axes = figure.axes[0]
    (line,) = [each for each in axes.get_lines() if each.get_label() == "Gumbel"]
    estimate = runs.extremes["payload up"]
    factor = 1.0 if "[m]" in axes.get_ylabel() else 1e-3
    found = np.interp(
        np.log(10800.0), np.log(line.get_xdata()), factor * np.asarray(line.get_ydata())
    )
    assert found == pytest.approx(estimate.value, rel=1e-9)
    assert "in 3 h by Gumbel" in figure.get_suptitle()
