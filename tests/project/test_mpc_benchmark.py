"""The benchmark of predictive control: all are asked the same, and what they answer is told."""

from __future__ import annotations

import csv
import math
import os
import sys
from dataclasses import fields, replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from stored import read_rows

from mpc.linear import LinearMPC
from mpc.nonlinear import NonlinearMPC

FOLDER = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def bench():
    sys.path.insert(0, str(FOLDER))
    try:
        import mpc_speed

        yield mpc_speed
    finally:
        sys.path.remove(str(FOLDER))


@pytest.fixture(scope="module")
def solvers(bench):
    return sys.modules["mpc_solvers"]


@pytest.fixture(scope="module")
def words(bench):
    return sys.modules["mpc_report"]


@pytest.fixture(scope="module")
def recordings(bench):
    return {
        (blocked, kind): bench.recorded("rough", 1.5, 30, blocked=blocked, kind=kind, settle=28.0)
        for blocked in (True, False)
        for kind in (LinearMPC, NonlinearMPC)
    }


def test_no_benchmark_has_the_name_of_a_package():
    # A script's folder comes first where it looks for modules.
    for package in ("mpc", "models", "synth", "stillhook"):
        assert not (FOLDER / f"{package}.py").exists()


def test_a_recording_is_of_a_loop_that_meets_its_limits(recordings):
    recording = recordings[True, LinearMPC]
    assert recording.steps == 30
    assert len(recording.times) == len(recording.measurements) == len(recording.commands) == 590
    assert recording.limited > 0.5


@pytest.mark.parametrize("kind", [LinearMPC, NonlinearMPC])
def test_a_recording_can_be_gone_through_again(bench, recordings, kind):
    recording = recordings[True, kind]
    replay = bench.own_replay(recording)
    for _ in range(2):
        processor, wall, moves = replay()
        assert len(processor) == len(wall) == 30
        assert processor.min() > 0.0
        assert np.array_equal(moves, recording.moves)
    other = replace(recording, commands=recording.commands + 1.0)
    with pytest.raises(ValueError, match="cannot be repeated"):
        bench.own_replay(other)()


@pytest.mark.parametrize("blocked", [True, False])
def test_both_statements_have_the_answers_that_were_recorded(recordings, bench, blocked):
    recording = recordings[blocked, LinearMPC]
    statements, right = sys.modules["mpc_statements"], sys.modules["mpc_reference"]
    dense = right.tight_answers(statements.slack_statement(recording))
    staged = right.tight_answers(statements.stage_statement(recording))
    assert dense == pytest.approx(recording.moves, abs=1e-8)
    assert staged == pytest.approx(recording.moves, abs=1e-8)
    assert bench.reference(recording) == pytest.approx(dense, abs=0.0)


def test_every_exact_solver_that_is_installed_agrees(recordings, solvers):
    recording = recordings[True, LinearMPC]
    asked = set()
    for solver in solvers.SOLVERS:
        if solver.name.startswith(("OSQP", "ProxQP")) or not solvers.version_of(solver.package):
            continue  # of the first order, which fail where limits are met
        ask = solver.prepare(recording)
        moves = [ask(k) for k in range(12)]
        off = 1e-6 if solver.package == "daqp" else 5e-3
        assert moves == pytest.approx(recording.moves[:12], abs=off), solver
        asked.add(solver.package)
    assert asked >= {"daqp", "piqp", "casadi", "cvxpy"}


@pytest.mark.parametrize("kind", [LinearMPC, NonlinearMPC])
@pytest.mark.parametrize("blocked", [True, False])
def test_the_peers_problem_is_ours(bench, recordings, kind, blocked):
    recording = recordings[blocked, kind]
    answers = bench.peer_replay(partial(bench.ipopt_peer, tight=True), recording, 12)()[2]
    # One Gauss-Newton step is not yet the optimum of the nonlinear problem.
    assert answers == pytest.approx(recording.moves[:12], abs=1e-6 if kind is LinearMPC else 2e-3)


def test_do_mpc_agrees(bench, recordings, solvers):
    if solvers.version_of("do-mpc") is None:
        pytest.skip("do-mpc is not installed")
    for (blocked, kind), recording in recordings.items():
        answers = bench.peer_replay(bench.do_mpc_peer, recording, 5)()[2]
        assert answers == pytest.approx(recording.moves[:5], abs=2e-3), (blocked, kind)


def test_acados_agrees(bench, recordings, solvers):
    if solvers.version_of("comma-deps-acados") is None:
        pytest.skip("acados is not installed")
    recording = recordings[False, LinearMPC]
    answers = bench.peer_replay(bench.acados_peer, recording, 12)()[2]
    assert answers == pytest.approx(recording.moves[:12], abs=1e-4)
    with pytest.raises(ValueError, match="a move for every sample"):
        bench.acados_peer(bench.Horizon(recordings[True, LinearMPC].controller))


def task_of(bench, name, begin, right):
    shown = {"statement": "", "package": "daqp", "sea": "rough", "horizon": 6.0, "moves": 27}
    return bench.Task(name=name, begin=begin, reference=right, **shown)


def test_whoever_crashes_or_errs_takes_nobody_along(bench):
    right = np.array([1.0, 2.0, 3.0])

    def good():
        return lambda: (np.full(3, 1e-6), np.full(3, 2e-6), np.array([1.0, 2.5, math.nan]))

    def fails():
        raise RuntimeError("no licence\nfor this")

    def crashes():
        return lambda: os._exit(3)

    tasks = [task_of(bench, f.__name__, f, right) for f in (good, fails, crashes)]
    found = bench.measure(tasks, repetitions=3, enough=1.0)
    assert [one.trouble for one in found] == [
        "",
        "RuntimeError: no licence",
        "crashed (exit code 3)",
    ]
    one = found[0]
    assert (one.median, one.wall, one.repetitions) == pytest.approx((1.0, 2.0, 3))
    assert (one.failed, one.questions, one.error) == (2, 3, 0.5)
    assert math.isnan(found[1].median)


def test_nobody_repeats_for_longer_than_is_enough(bench):
    def slow():
        return lambda: (np.full(2, 0.3), np.full(2, 0.3), np.zeros(2))

    found = bench.measure([task_of(bench, "slow", slow, np.zeros(2))], repetitions=9, enough=1.0)
    assert found[0].repetitions == 2


@pytest.fixture(scope="module")
def results(words):
    def timing(name, median, sea="rough", moves=27, **more):
        more = {"horizon": 6.0, "p99": 2.0 * median, "largest": 3.0 * median, **more}
        return words.Timing(
            name=name, sea=sea, moves=moves, median=median, questions=9, repetitions=3, **more
        )

    return words.Results(
        solvers=(
            timing("OSQP, 1e-3", 500.0, version="1.1.3", failed=4, error=1.0),
            timing("DAQP, soft rows", 12.3, version="0.11.0", error=2e-8),
            words.Timing(
                name="QOCO", sea="rough", horizon=6.0, moves=27, trouble="crashed (exit code 1)"
            ),
        ),
        steps=(
            timing("LinearMPC", 50.0),
            timing("do-mpc", 6000.0, version="5.1.2"),
            timing("LinearMPC, no blocking", 100.0, moves=120),
            timing("acados, solution alone", 900.0, moves=120),
        ),
        nonlinear=(timing("NonlinearMPC", 500.0), timing("do-mpc", 25_000.0)),
        minutes=(words.Minutes(sea="rough", minutes=20.0, setup=0.3, processor=2.0, wall=3.0),),
        limited={"rough": 0.9},
        load=(1.0, 2.0),
        absent=("proxsuite",),
    )


def test_the_tables_say_what_was_measured(words, results):
    table = words.solver_table(results.solvers, "rough", 27)
    assert [line[0] for line in table[1:]] == ["DAQP, soft rows", "OSQP, 1e-3", "QOCO"]
    assert table[2][5:] == ["40.7", "1e+00", "4 of 9"]
    assert table[3][-1] == "crashed (exit code 1)"
    assert words.step_table(results)[1][-2:] == ["6 000", "120"]
    assert words.plain_table(results)[1][-2:] == ["9.00", ""]
    assert [line[6] for line in words.nonlinear_table(results.nonlinear)[1:]] == ["1.00", "50.0"]
    text = words.report(results)
    assert "Not installed: proxsuite." in text
    assert "DAQP 0.11.0, do-mpc 5.1.2, OSQP 1.1.3" in text
    assert "| rough | 20 | 0.30 | 2.00 | 3.00 |" in text


def test_what_is_not_as_wanted_is_told(words, results):
    assert words.missed(results) == ()
    slow = replace(results.steps[0], median=61.0)
    near = replace(results.steps[1], median=4900.0)
    late = replace(results.minutes[0], processor=11.0)
    other = replace(results, steps=(slow, near), minutes=(late,))
    assert words.missed(other) == (
        "a step in the rough sea: 61.0 us, p99 100 us, wanted 60 and 250",
        "do-mpc, rough, 6 s: 80.3 times as long, wanted 100",
        "20 min of the rough sea took 11.0 s",
    )


def test_files_hold_every_row_and_a_figure(words, results, tmp_path):
    for folder in ("data", "images"):
        (tmp_path / folder).mkdir()
    page = tmp_path / "performance.md"
    page.write_text(f"a\n{words.BEGIN}\nold\n{words.END}\nz\n", encoding="utf-8")
    words.write_files(tmp_path, results)
    words.write_files(tmp_path, results)
    text = page.read_text(encoding="utf-8")
    assert text.startswith("a\n")
    assert text.endswith("z\n")
    assert "old" not in text
    rows = sys.modules["stored"].read_rows(tmp_path / "data" / "mpc_steps.csv")
    assert [row["name"] for row in rows][-1] == "do-mpc"
    assert float(rows[0]["median"]) == 50.0
    drawn = (tmp_path / "images" / "mpc-speed.svg").read_text(encoding="utf-8")
    assert drawn.startswith("<?xml")
    with pytest.raises(ValueError, match="must hold"):
        words.between("no marks", "new")


@pytest.mark.parametrize(
    ("value", "text"),
    [(9974.0, "9 970"), (72.04, "72.0"), (6.996, "7.00"), (0.2749, "0.275"), (99.97, "100")],
)
def test_three_digits_are_shown(value, text, words):
    assert words._micro(value) == text


def test_the_docs_hold_the_marks_and_the_data(words):
    docs = FOLDER.parent / "docs"
    page = (docs / "performance.md").read_text(encoding="utf-8")
    assert page.count(words.BEGIN) == page.count(words.END) == 1
    for name in ("mpc_solvers.csv", "mpc_steps.csv"):
        lines = (docs / "data" / name).read_text(encoding="utf-8").splitlines()
        rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
        assert {row["sea"] for row in rows} >= {"calm", "rough"}
        assert all(float(row["median"]) > 0.0 for row in rows if not row["trouble"])


def test_the_docs_page_shows_the_stored_times(words):
    docs = FOLDER.parent / "docs"
    page = (docs / "performance.md").read_text(encoding="utf-8")

    def timings(name):
        kinds = {"float": float, "int": int, "str": str}
        return tuple(
            words.Timing(**{f.name: kinds[f.type](row[f.name]) for f in fields(words.Timing)})
            for row in read_rows(docs / "data" / name)
        )

    solvers, every = timings("mpc_solvers.csv"), timings("mpc_steps.csv")
    first = next(k for k, one in enumerate(every) if one.name == "NonlinearMPC")
    results = words.Results(
        solvers=solvers, steps=every[:first], nonlinear=every[first:], minutes=(), limited={},
        load=(0.0, 0.0),
    )  # fmt: skip
    tables = [words.solver_table(solvers, *asked) for asked in {(s.sea, s.moves) for s in solvers}]
    tables += [words.step_table(results), words.plain_table(results)]
    tables += [words.nonlinear_table(results.nonlinear)]
    for table in tables:
        assert words.markdown(table) in page, table[1]
