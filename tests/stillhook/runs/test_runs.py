"""`sh.simulate` and `Runs`: any controller over seeds, and what the seeds say together."""

from __future__ import annotations

import csv
import math
import sys
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from designs import thesis_design
from former_cases import load_case
from scipy import stats

import stillhook as sh
from models.operation import scenario_named
from models.plant import build_plant
from models.sensing import Measurement
from models.simulation import prepare
from stillhook.runs import headline_of, keep_worst
from stillhook.runs.runs import EXTREMES
from stillhook.runs.table import Estimate, QuantityRow, rows_of, tables_of

THESIS = {"A": 200.0, "a": 50.0, "a1": 100.0, "a2": 100.0}


@cache
def calm() -> sh.Case:
    return load_case("thesis-1975").replace({"sea.significant_height": 0.3})


@cache
def three() -> sh.Runs:
    return sh.simulate(calm(), "feedback", seeds=3, duration="1 min", settle=20.0)


class Stepped:
    """A controller of this package that does not show its recursion."""

    name = "stepped"

    def __init__(self, inner):
        self._inner = inner
        self.sample_time = inner.sample_time
        self.resets = 0

    def reset(self):
        self.resets += 1
        self._inner.reset()

    def step(self, measurement, time):
        return self._inner.step(measurement, time)


class Broken(Stepped):
    """Goes wrong from a time on, as told."""

    def __init__(self, inner, since, answer):
        super().__init__(inner)
        self._since, self._answer = since, answer

    def step(self, measurement, time):
        if time >= self._since:
            return self._answer()
        return super().step(measurement, time)


def rms(runs: sh.Runs) -> list[float]:
    return [run.statistics.value("payload rms") for run in runs]


# which runs


def test_seeds_are_counted_from_zero_or_named():
    assert three().seeds == (0, 1, 2)
    named = sh.simulate(calm(), "feedback", seeds=[2, 0], duration="1 min", settle=20.0)
    assert named.seeds == (2, 0)
    assert rms(named) == [rms(three())[2], rms(three())[0]]


def test_runs_are_a_sequence():
    runs = three()
    assert len(runs) == 3
    assert [run.seed for run in runs] == [0, 1, 2]
    assert runs[-1] is runs.runs[2]
    assert runs[:2] == runs.runs[:2]
    assert (runs.controller, runs.case, runs.completed) == ("feedback", runs[0].case, True)


def test_everything_is_prepared_once_for_all_seeds(monkeypatch):
    import stillhook.runs.simulation as module

    prepared = []
    original = module.prepare

    def counted(*arguments, **rest):
        prepared.append(1)
        return original(*arguments, **rest)

    monkeypatch.setattr(module, "prepare", counted)
    sh.simulate(calm(), "none", seeds=4, duration=5.0)
    assert len(prepared) == 1


def test_a_name_a_design_and_gains_are_the_same_feedback():
    how = {"duration": "1 min", "settle": 20.0}
    by_name = sh.simulate(calm(), "feedback", gains=THESIS, **how)
    by_design = sh.simulate(calm(), thesis_design(), **how)
    with_design = sh.simulate(calm(), "feedback", design=thesis_design(), **how)
    assert rms(by_name) == rms(by_design) == rms(with_design) == rms(three())[:1]


def test_a_controller_in_python_gives_what_the_compiled_one_does():
    controller = Stepped(sh.LinearFeedback(calm(), THESIS))
    stepped = sh.simulate(calm(), controller, seeds=3, duration="1 min", settle=20.0)
    assert rms(stepped) == pytest.approx(rms(three()), rel=1e-9)
    assert controller.resets >= 3
    assert stepped[0].timings.controller_median > 0.0


def test_the_traces_of_the_worst_run_alone_can_be_kept():
    runs = sh.simulate(calm(), "feedback", seeds=3, duration="1 min", settle=20.0, traces="worst")
    largest = [run.statistics.value("tracking error largest") for run in three()]
    assert [run.time.size > 0 for run in runs] == [x == max(largest) for x in largest]
    assert runs.worst.seed == three().worst.seed == int(np.argmax(largest))
    assert rms(runs) == rms(three())


def test_a_run_that_diverged_is_worse_than_any_other():
    runs = three()
    first = replace(runs[0], status="diverged")
    kept = keep_worst([first, *runs.runs[1:]])
    assert [run.time.size > 0 for run in kept] == [True, False, False]


def test_progress_rises_from_run_to_run():
    told: list[float] = []
    sh.simulate(calm(), "none", seeds=2, duration=20.0, progress=told.append)
    assert told == sorted(told)
    assert told[-1] == 1.0
    assert 0.5 in told


# what is judged


def test_an_operation_with_a_warm_up_is_judged_after_it():
    runs = sh.simulate(
        calm(), "none", scenario="engage", options={"hold": "1 min"}, duration="3 min"
    )
    assert runs[0].statistics.settle == 80.0  # 60 s with the brake on, 20 s of ramp
    assert not runs.stays


def test_lock_is_watched_at_the_significant_height_of_the_hook():
    from models.hook import HookMotion

    height = HookMotion.from_case(calm()).displacement.significant_height
    assert three().lock_limit == pytest.approx(height, rel=1e-9)
    assert sh.simulate(calm(), "none", duration=5.0).lock_limit is None
    assert sh.simulate(calm(), "feedback", scenario="lower", duration=5.0).lock_limit is None
    assert sh.simulate(calm(), "feedback", duration=5.0, lock_limit=0.04).lock_limit == 0.04


def test_the_error_before_touchdown_is_that_of_the_traces():
    runs = sh.simulate(
        load_case("landing"),
        "feed-forward",
        scenario="landing",
        options={"height": 3.0, "stop": 2.0},
    )
    run = runs[0]
    touched = run.statistics.value("touch-down at")
    # Contact begins where the clearance is used up.
    assert touched == run.time[np.argmax(run["contact.gap"] <= 0.0)]
    part = (run.time >= run.statistics.settle) & (run.time < touched)
    error = (run["payload.displacement"] - run["reference.displacement"])[part]
    found = run.statistics.value("error before touch-down rms")
    assert found == pytest.approx(math.sqrt(float(np.mean(error**2))), rel=1e-12)
    assert run.statistics.value("error before touch-down largest") == np.abs(error).max()
    assert run.statistics.value("tracking error largest") > 2.0 * np.abs(error).max()
    assert rows_of([runs])[0].name == "error before touch-down rms"


def test_a_lift_is_made_with_the_weight_in_air(monkeypatch):
    # The controller's static command is that of the lift, not of the case: the load would fall.
    case = load_case("thesis-1975")
    lift = scenario_named("lift-off", case)
    made = []

    def spy(case, controller, *rest):
        made.append(controller)
        return prepare(case, controller, *rest)

    monkeypatch.setattr("stillhook.runs.simulation.prepare", spy)
    sh.simulate(case, "feed-forward", scenario=lift, duration=1.0)
    held = build_plant(lift.case_for(case)).operating_point().command
    under_water = build_plant(case).operating_point().command
    assert held != pytest.approx(under_water, rel=0.1)
    (controller,) = made
    seen = Measurement.of({"drive.applied": held, "rope.tension": 4e5})
    assert controller.step(seen, 0.0) == pytest.approx(held, rel=0.05)


# the summary


def test_the_summary_has_students_interval_over_the_seeds():
    found = three().summary["payload rms"]
    values = np.array(rms(three()))
    half = stats.t.ppf(0.975, 2) * values.std(ddof=1) / math.sqrt(3.0)
    assert found.mean == pytest.approx(values.mean(), rel=1e-12)
    assert (found.low, found.high) == pytest.approx((values.mean() - half, values.mean() + half))


def test_extremes_are_those_of_gumbel():
    runs = sh.simulate(calm(), "none", seeds=3, duration="65 min", settle=60.0, traces="worst")
    assert set(runs.extremes) == set(EXTREMES)
    up, down = runs.extremes["payload up"], runs.extremes["payload down"]
    assert up.count == 9  # three blocks of 20 minutes in each run
    assert up.low < up.value < up.high
    assert down.value < 0.0 < up.value
    largest = max(run.statistics["payload.error"].maximum for run in runs)
    assert 0.7 * largest < up.value < 1.4 * largest
    rows = {row.name: row for row in rows_of([runs])}
    assert rows["payload up, gumbel"].figures[0].mean == up.value
    assert "Rayleigh" in rows["payload up, gumbel"].note


def test_a_payload_that_is_moved_has_no_extremes_of_three_hours():
    runs = sh.simulate(calm(), "feedback", scenario="lower", duration="1 min")
    assert runs.extremes == {}
    assert [row.group for row in rows_of([runs]) if "probable" in row.group] == []


def test_the_drum_held_is_what_others_are_measured_by():
    held = sh.simulate(calm(), "none", seeds=3, duration="1 min", settle=20.0)
    rows = {row.name: row for row in rows_of([three(), held])}
    ratios = [100.0 * a / b for a, b in zip(rms(three()), rms(held), strict=True)]
    figures = rows["residual held"].figures
    assert figures[0].mean == pytest.approx(np.mean(ratios), rel=1e-12)
    assert math.isnan(figures[1].mean)


def test_the_cells_of_a_row_share_a_unit():
    held = sh.simulate(calm(), "none", seeds=3, duration="1 min", settle=20.0)
    (row,) = (row for row in rows_of([three(), held]) if row.name == "motor torque largest")
    assert row.shown_unit == "kN m"
    row = rows_of([three(), held])[0]
    factor = {"m": 1.0, "mm": 1e-3}[row.shown_unit]
    shown = [float(row.cell(at)) * factor for at in (0, 1)]
    assert shown == pytest.approx([np.mean(rms(three())), np.mean(rms(held))], rel=6e-3)
    (alone,) = (table for table in tables_of([three()]) if table.title == "payload")
    assert alone.cells(0)[1] == f"{row.cell(0)} {row.shown_unit}"


def test_printed_runs_are_a_small_tree():
    lines = str(three()).splitlines()
    assert lines[0] == "thesis-1975, feedback, hold: 3 runs of 1 min, all completed"
    assert lines[1].startswith("├ payload ")
    assert "of the hook's motion" in lines[1]
    assert lines[-1].startswith("└ compiled, ")
    assert max(map(len, lines)) < 100


# faults


def test_a_controller_without_answer_is_told_and_the_load_is_held():
    controller = Broken(sh.LinearFeedback(calm(), THESIS), since=30.0, answer=lambda: math.nan)
    runs = sh.simulate(calm(), controller, duration="1 min")
    assert runs.completed
    assert runs[0].timings.fallbacks == {"not a number": 6001}
    assert "6001 commands of the controller could not be used" in str(runs)
    assert "at 30 s: the controller returned no number" in str(runs)


def interrupt() -> float:
    raise KeyboardInterrupt


def test_an_interrupt_keeps_the_runs_that_there_are():
    controller = Broken(sh.LinearFeedback(calm(), THESIS), since=100.0, answer=interrupt)
    runs = sh.simulate(calm(), controller, seeds=5, duration=120.0)
    assert [run.status for run in runs] == ["interrupted"]
    assert not runs.completed
    assert "1 interrupted" in headline_of(runs)
    assert str(runs)


def test_a_run_cut_short_does_not_count_if_others_are_whole():
    cut = replace(three()[2], status="interrupted")
    runs = replace(three(), runs=(*three().runs[:2], cut))
    assert runs.summary.count == 2
    assert runs.judged == three().runs[:2]
    alone = replace(three(), runs=(cut,))
    assert alone.judged == (cut,)


def test_the_brake_that_ends_a_run_is_counted():
    case = calm().replace({"limits.stroke": [-0.01, 0.01]})
    runs = sh.simulate(case, "feedback", seeds=2, duration="1 min")
    assert runs.tripped == 2
    assert "ended by the brake: 2 of 2 runs" in str(runs)
    (row,) = (row for row in rows_of([runs]) if row.name == "tripped")
    assert row.figures[0].mean == 100.0


# bad input


class Half:
    name = "half"
    sample_time = 0.1


WRONG = {
    "no seeds": ({"seeds": 0}, "simulate: seeds must be at least 1, got 0"),
    "a seed twice": ({"seeds": [1, 1]}, r"simulate: seeds must be distinct .*, got \[1, 1\]"),
    "a negative seed": ({"seeds": [-1]}, "simulate: seed must be a whole number of at least 0"),
    "no scenario": ({"scenario": "holding"}, "did you mean 'hold'"),
    "an option of another kind": (
        {"scenario": "lower", "options": {"distance": "5 kg"}},
        "scenario lower: distance must be a length",
    ),
    "no duration": (
        {"duration": "3 m"},
        r"simulate: duration must be a time in .*, got '3 m', which is a length",
    ),
    "a negative duration": ({"duration": -1.0}, "simulate: duration must be a time in .*, got -1"),
    "no controller": ({"controller": "feedbak"}, "there is no controller 'feedbak'"),
    "half a controller": (
        {"controller": Half()},
        "simulate: controller must be a name, a design, or an object with name, sample_time, "
        "reset, step; got Half, which has no reset and no step",
    ),
    "a time for a controller that has one": (
        {"controller": Stepped(sh.BrakeOn(calm())), "sample_time": 0.1},
        "simulate: sample_time is for a controller by its name; stepped has its own, 0.02 s",
    ),
    "gains for a controller of one's own": (
        {"controller": Stepped(sh.BrakeOn(calm())), "gains": THESIS},
        "simulate: design and gains are for a controller by its name",
    ),
    "options for a scenario of one's own": (
        {"scenario": scenario_named("hold", calm()), "options": {"ramp": 1.0}},
        "simulate: options are for a scenario by its name",
    ),
    "some of the traces": ({"traces": "best"}, "simulate: traces must be one of all, worst; got"),
}


@pytest.mark.parametrize("name", WRONG)
def test_bad_input_is_one_sentence(name):
    arguments, message = WRONG[name]
    with pytest.raises(sh.InputError, match=message) as caught:
        sh.simulate(calm(), **{"duration": 5.0, **arguments})
    assert "\n" not in str(caught.value)


def test_no_runs_are_no_result():
    with pytest.raises(sh.InputError, match="at least one run is wanted, got none"):
        replace(three(), runs=())
    with pytest.raises(sh.InputError, match="at least one set of runs is wanted, got none"):
        sh.write_runs("nowhere", [])


def test_controllers_of_the_same_name_are_not_written_over_each_other(tmp_path):
    message = "controllers must have different names, got feedback, feedback"
    with pytest.raises(sh.InputError, match=message):
        sh.write_runs(tmp_path / "here", [three(), three()])
    assert not (tmp_path / "here").exists()


def test_a_format_whose_package_is_missing_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    message = "format parquet: the package pyarrow is not installed; use csv"
    with pytest.raises(sh.InputError, match=message):
        sh.write_runs(tmp_path, [three()], format="parquet", figures=False)


# files


def test_saved_runs_can_be_read_again(tmp_path):
    written = sh.write_runs(tmp_path / "here", [three()], format="csv", figures=False)
    assert all(path.exists() for path in written)
    with open(tmp_path / "here" / "runs" / "seed-002.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    tension = np.array([float(row["rope.tension [N]"]) for row in rows])
    assert np.array_equal(tension, three()[2]["rope.tension"])
    with pytest.raises(sh.InputError, match="format must be one of csv, parquet, netcdf, none"):
        sh.write_runs(tmp_path, [three()], format="xls")  # type: ignore[arg-type]


def test_a_file_in_the_way_is_one_sentence(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(sh.InputError, match="the output folder cannot be made: a file is there"):
        sh.write_runs(tmp_path / "file", [three()], figures=False)


def test_a_snap_on_a_rope_too_short_for_more_masses_leaves_the_run() -> None:
    short = load_case("thesis-1975-rope").replace({"rope.length": 1.0})
    (run,) = sh.simulate(short, "none", duration=5.0)
    assert run.statistics.value("snap load") > 0.0
    assert "snap load on more masses" not in run.statistics.quantities


def test_an_interval_without_an_upper_end_says_at_least() -> None:
    figures = (Estimate(0.0, 0.0, math.inf), Estimate(20.0, 3.0, 724.0))
    row = QuantityRow("payload", "fall time", "time to loss of lock", "s", figures)
    assert [row.interval(0), row.interval(1)] == ["at least 0", "3.00 to 724"]


def test_a_snap_load_is_told_on_more_masses_too() -> None:
    # A light load under a brake: the rope goes slack, and few masses blunt the snap.
    light = {
        "payload.mass": 8e3,
        "payload.added_mass": 30e3,
        "payload.submerged_weight": 60e3,
        "sea.significant_height": 3.2,
    }
    case = load_case("subsea-crane").replace(light)
    runs = sh.simulate(case, "none", seeds=[1, 2], duration=600.0, masses=7)
    calm, snapped = runs
    assert "snap load on more masses" not in calm.statistics.quantities
    coarse = snapped.statistics.value("snap load")
    finer = snapped.statistics.value("snap load on more masses")
    again = sh.simulate(case, "none", seeds=[2], duration=600.0, masses=40)
    assert finer == again[0].statistics.value("snap load") > 1.05 * coarse
    assert "snap load on more masses" not in again[0].statistics.quantities
    share = f"uncertain by {100.0 * (finer / coarse - 1.0):.0f} %"
    (event,) = (event for event in snapped.events if event.kind == "snap")
    assert event.time == snapped.statistics.value("snap load at")
    assert "on 7 masses" in event.text
    assert event.text.endswith(share)
    assert event.text in str(runs)
