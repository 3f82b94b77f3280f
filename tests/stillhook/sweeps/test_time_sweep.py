"""Sweeps in the time domain: the same numbers as single runs, on every engine, whoever dies."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import warnings

import numpy as np
import pytest
import sweep_pilots
from hypothesis import given
from hypothesis import strategies as st

import stillhook as sh
from models.basics import InputError, SolverError
from models.spread import Spread, Uniform
from stillhook.controllers import recipe_of
from stillhook.keeper import Cluster, Processes
from stillhook.runs import simulate
from stillhook.sweeps import STATUS, SweepSummary, sweep, sweep_report, worst_cases
from stillhook.sweeps.time_cases import CaseTask, TimeQuestion, seed_of
from stillhook.sweeps.time_metrics import METRICS
from stillhook.sweeps.trim import shift_between, static_of, trimmed
from synth.controllers import LinearFeedback

CASE = sh.load_case("thesis-1975").replace({"sea.significant_height": 0.3})
GAINS = {name: getattr(CASE.gains, name) for name in ("A", "a", "a1", "a2")}
DESIGN = sh.evaluate_gains(CASE, GAINS)
SPREAD = {
    "payload.mass": Uniform("20 %"),
    "payload.drag_coefficient": Uniform("50 %"),
    "sensors.telemetry.delay": Uniform(0.0, 0.02),
}
HOW = {"mode": "time", "duration": 40.0, "seed": 5}


def same(one, other):
    """The variables in which two results differ, to the last bit."""
    assert set(one.variables) == set(other.variables)
    return [
        name
        for name in one.variables
        if not np.array_equal(one[name], other[name], equal_nan=one[name].dtype.kind == "f")
    ]


@pytest.fixture(scope="module")
def alone():
    return sweep(DESIGN, SPREAD, samples=12, engine="serial", **HOW)


def test_a_sweep_is_the_single_runs_to_the_bit(alone):
    nominal = LinearFeedback(CASE, GAINS)
    static = static_of(CASE)
    for case_number in range(4):
        case = alone.sweep.case(case_number)
        controller = trimmed(nominal, shift_between(static, static_of(case)))
        seed = int(alone["seed"][case_number])
        (run,) = simulate(case, controller, seeds=[seed], duration=40.0)
        for name, metric in METRICS.items():
            wanted = metric.of(run)
            assert np.array_equal(float(alone[name][case_number]), wanted, equal_nan=True), name


def test_a_known_weight_is_a_controller_made_for_that_weight():
    # Another route: the controller made for a case that differs in the weight alone.
    heavy = CASE.replace({"payload.submerged_weight": 340e3})
    shifted = trimmed(LinearFeedback(CASE, GAINS), shift_between(static_of(CASE), static_of(heavy)))
    found = [
        simulate(heavy, controller, seeds=[3], duration=60.0)[0]["payload.displacement"]
        for controller in (shifted, LinearFeedback(heavy, GAINS), LinearFeedback(CASE, GAINS))
    ]
    assert np.abs(found[0] - found[1]).max() < 1e-9
    # Unknown, it hangs lower by what the position gain makes of the voltage that is missing.
    missing = shift_between(static_of(CASE), static_of(heavy)).command
    offset = (found[2] - found[1])[-500:].mean()
    assert offset == pytest.approx(-missing / (GAINS["A"] * GAINS["a2"]), rel=0.02)


def test_a_trimmed_controller_in_python_does_what_the_compiled_one_does():
    heavy = CASE.replace({"payload.submerged_weight": 330e3})
    shift = shift_between(static_of(CASE), static_of(heavy))
    own = LinearFeedback(CASE, GAINS, sample_time=0.02)

    class Plain:  # the same law without its recursion
        name, sample_time = own.name, own.sample_time
        reset, step = staticmethod(own.reset), staticmethod(own.step)

    runs = [
        simulate(heavy, trimmed(each, shift), seeds=[1], duration=20.0)[0]
        for each in (own, Plain())
    ]
    assert np.abs(runs[0]["drive.command"] - runs[1]["drive.command"]).max() < 1e-9
    assert trimmed(own, shift_between(static_of(CASE), static_of(CASE))) is own


def test_the_pool_gives_the_same_to_the_bit(alone):
    pooled = sweep(DESIGN, SPREAD, samples=12, jobs=2, **HOW)
    assert same(alone, pooled) == []
    assert (alone.attrs["engine"], pooled.attrs["engine"]) == ("serial", "processes")


def test_a_process_that_is_killed_loses_nothing(alone):
    engine, killed = Processes(2), []

    def kill(what, done, total):
        if engine.pids and not killed:
            killed.append(engine.pids[0])
            os.kill(engine.pids[0], signal.SIGKILL)

    found = sweep(DESIGN, SPREAD, samples=12, engine=engine, progress=kill, **HOW)
    assert killed
    assert same(alone, found) == []


@pytest.mark.ci
def test_a_case_that_kills_every_process_is_told_left_out_and_tried_again(tmp_path, monkeypatch):
    spread = {"payload.mass": Uniform(36e3, 44e3)}

    def swept():
        return sweep(
            ("killer", sweep_pilots.killer),
            spread,
            case=CASE,
            samples=3,
            mode="time",
            duration=5.0,
            design_follows=True,
            jobs=2,
            store=tmp_path,
        )

    found = swept()
    heavy = found["payload.mass"].to_numpy() > 40e3
    assert 0 < heavy.sum() < 3
    died = found["status"].to_numpy() == STATUS["died"]
    assert (died == heavy).all()
    assert np.isnan(found["payload_rms"].to_numpy()[heavy]).all()
    assert found.attrs["complete"] == 1
    assert "its process was ended by SIGKILL, twice" in found.attrs["messages"][0]
    # Nothing is known of it, so it is neither unstable nor among the worst.
    summary = SweepSummary.of(found)
    assert (summary.cases, summary.stable.total) == (3 - heavy.sum(), 3 - heavy.sum())
    assert summary.stable.count == summary.stable.total
    assert summary.statuses == {"died": heavy.sum()}
    assert "left out" in summary.sentences[1]
    assert not {*worst_cases(found, 3)} & {*found["case"].to_numpy()[heavy]}
    assert sweep_report(found, "it").ok is False
    # Nor is that final.
    assert len((tmp_path / "journal.jsonl").read_text().splitlines()) == 1 + 3 - heavy.sum()
    monkeypatch.setenv("SPARED", "1")
    again = swept()
    assert (again["status"] == STATUS["completed"]).all()
    assert same(again.isel(case=~heavy), found.isel(case=~heavy)) == []


@pytest.mark.ci
def test_a_sweep_of_which_every_case_dies_says_so():
    found = sweep(
        ("killer", sweep_pilots.killer),
        {"payload.mass": Uniform(41e3, 44e3)},
        case=CASE,
        samples=1,
        mode="time",
        duration=5.0,
        design_follows=True,
        engine=Processes(1),
    )
    with pytest.raises(SolverError, match=r"run to its end: case 0: .* ended by SIGKILL, twice"):
        SweepSummary.of(found)


def test_a_cluster_whose_processes_do_not_start_is_told_and_nothing_is_lost(tmp_path):
    distributed = pytest.importorskip("distributed")
    del distributed
    ended = threading.Event()

    def kill() -> None:
        while not ended.wait(0.01):
            for child in multiprocessing.active_children():
                child.kill()

    killer = threading.Thread(target=kill)
    killer.start()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with pytest.raises(InputError, match="cluster 'local:1': its processes did not start"):
                sweep(DESIGN, SPREAD, samples=2, engine="local:1", store=tmp_path, **HOW)
    finally:
        ended.set()
        killer.join()
    found = sweep(DESIGN, SPREAD, samples=2, engine="serial", store=tmp_path, **HOW)
    assert found.attrs["complete"] == 1


@pytest.mark.slow  # a cluster takes its time to start
def test_dask_gives_the_same_to_the_bit_though_a_worker_is_killed(alone):
    distributed = pytest.importorskip("distributed")
    with (
        warnings.catch_warnings(),
        distributed.LocalCluster(
            n_workers=2,
            threads_per_worker=1,
            processes=True,
            dashboard_address="127.0.0.1:0",
            silence_logs=50,
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        warnings.simplefilter("ignore")
        pids = [worker["pid"] for worker in client.run(worker_state).values()]
        killed = []

        def kill(what, done, total):
            if done >= 2 and not killed:
                killed.append(pids[0])
                os.kill(pids[0], signal.SIGKILL)

        found = sweep(
            DESIGN, SPREAD, samples=12, engine=Cluster(client=client), progress=kill, **HOW
        )
    assert killed
    assert same(alone, found) == []
    assert found.attrs["engine"] == "cluster"


def worker_state():
    return {"pid": os.getpid()}


@pytest.mark.slow
def test_a_local_cluster_is_started_and_ended_with_the_sweep(alone):
    pytest.importorskip("distributed")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = sweep(DESIGN, SPREAD, samples=12, engine="local:2", **HOW)
    assert same(alone, found) == []


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("local:0", r"cluster 'local:0': number of processes must be in \[1, 512\]"),
        ("local:x", r"must be in \[1, 512\], got 0"),
        ("10.0.0.1:8786", "must be local:N or the address of a dask scheduler such as tcp://"),
    ],
)
def test_an_address_that_is_none_is_refused(address, message):
    with pytest.raises(InputError, match=message):
        sweep(DESIGN, SPREAD, samples=2, engine=address, **HOW)


@given(st.integers(0, 10**6), st.integers(0, 10**9), st.integers(0, 10**9))
def test_seeds_depend_on_sweep_and_case_alone(seed, one, other):
    assert seed_of(seed, one) == seed_of(seed, one)
    assert seed_of(seed, one, common=True) == seed_of(seed, other, common=True)
    assert 0 <= seed_of(seed, one) < 2**32


def test_a_longer_sweep_begins_with_the_shorter_one(alone):
    short = sweep(DESIGN, SPREAD, samples=3, engine="serial", **HOW)
    assert same(short, alone.isel(case=slice(0, 3))) == []


def test_the_parts_of_a_sweep_are_those_of_the_whole(alone):
    part = sweep(DESIGN, SPREAD, samples=3, first=4, engine="serial", **HOW)
    assert same(part, alone.isel(case=slice(4, 7))) == []
    with pytest.raises(InputError, match="a part of a sweep is of sobol or random, got 'lhs'"):
        sweep(DESIGN, SPREAD, samples=3, first=4, sampling="lhs", **HOW)


def test_the_controller_is_made_for_the_nominal_case_unless_it_follows():
    spread = Spread({"payload.mass": Uniform(30e3, 40e3)}).on(CASE)
    row = spread.sample(1)[0]
    task = CaseTask(index=0, seed=1, changes=spread.changes(row))
    case = CASE.replace(task.changes)
    for follows, mass in ((False, CASE.payload.mass), (True, case.payload.mass)):
        question = TimeQuestion(
            case=CASE,
            recipe=recipe_of(("told", sweep_pilots.told), "sweep"),
            metrics=("payload_rms",),
            duration=5.0,
            design_follows=follows,
        )
        made = question.controller(case, task)
        assert made.name == f"made for {mass:.6g} kg"


def test_gains_vary_about_those_of_the_design():
    found = sweep(
        DESIGN,
        {"gains.a2": Uniform("10 %")},
        samples=2,
        engine="serial",
        common_seed=True,
        **HOW,
    )
    for case_number in range(2):
        gains = {**GAINS, "a2": float(found["gains.a2"][case_number])}
        seed = int(found["seed"][case_number])
        (run,) = simulate(CASE, LinearFeedback(CASE, gains), seeds=[seed], duration=40.0)
        assert float(found["payload_rms"][case_number]) == run.statistics.value("payload rms")
    assert found["seed"][0] == found["seed"][1]


@pytest.mark.ci
def test_what_became_of_a_case_is_told():
    # In its own sea the thesis's loop saturates, and the payload moves more than the hook.
    rough = sweep(
        "feedback", {"sea.significant_height": Uniform(2.4, 2.5)}, case=CASE, samples=1, **HOW
    )
    assert int(rough["status"][0]) == STATUS["limit cycle"]
    assert float(rough["payload_rms"][0]) > float(rough["hook_rms"][0])
    assert int(rough["stable"][0]) == 0
    held = sweep("none", {"sea.significant_height": Uniform(2.4, 2.5)}, case=CASE, samples=1, **HOW)
    assert int(held["status"][0]) == STATUS["completed"]  # no better than the hook, not saturated
    broken = sweep(
        ("breaker", sweep_pilots.breaker),
        {"payload.mass": Uniform("1 %")},
        case=CASE,
        samples=1,
        engine="serial",
        **HOW,
    )
    assert int(broken["status"][0]) == STATUS["failed"]
    assert "KeyError" in broken.attrs["messages"][0]


def test_a_cut_torque_limit_ends_in_the_brake():
    # Less torque than the load's weight takes: it runs away until the supervisor stops it.
    found = sweep(
        DESIGN,
        {"fault.torque_limit": Uniform(0.2, 0.3), "fault.at": Uniform(20.0, 21.0)},
        samples=1,
        engine="serial",
        **HOW,
    )
    assert int(found["status"][0]) == STATUS["brake"]


def test_every_number_has_a_unit_and_a_long_name(alone):
    for name, variable in alone.variables.items():
        assert variable.attrs["long_name"], name
    for name, metric in METRICS.items():
        assert alone[name].attrs["units"] == metric.unit
    assert alone["payload.mass"].attrs["units"] == "kg"
    assert alone["payload.mass"].attrs["nominal"] == CASE.payload.mass
    assert alone["payload_rms"].dims == ("case",)


def test_ctrl_c_leaves_what_was_done():
    def stop(what, done, total):
        if done == 3:
            raise KeyboardInterrupt

    found = sweep(DESIGN, SPREAD, samples=12, engine="serial", progress=stop, **HOW)
    assert found.attrs["complete"] == 0
    assert int((found["status"] == STATUS["completed"]).sum()) == 3
    assert found.sweep.summary().cases == 3
    assert found.sweep.summary().statuses["not run"] == 9


@pytest.mark.parametrize(
    ("spread", "more", "message"),
    [
        ({"drag": Uniform(0.0, 10.0)}, {}, "drag"),
        ({"gains.a": Uniform("5 %")}, {"design_follows": True}, "gains.a cannot vary where"),
        ({"fault.at": Uniform(10.0, 50.0)}, {}, r"before the end of the run, 40 s, got up to 50 s"),
        ({"fault.nothing": Uniform(0.0, 1.0)}, {}, "fault.nothing is unknown"),
        (SPREAD, {"metrics": ["beauty"]}, "beauty"),
        (SPREAD, {"samples": 0}, r"samples must be in \[1, 1e\+09\]"),
        (SPREAD, {"engine": "abacus"}, "engine must be serial, processes, local:N"),
        (SPREAD, {"duration": "-3 s"}, "sweep: duration"),
        (SPREAD, {"jobs": 0, "engine": "processes"}, r"jobs must be in \[1, 512\]"),
    ],
)
def test_what_cannot_be_swept_is_said_at_once(spread, more, message):
    with pytest.raises(InputError, match=message):
        sweep(DESIGN, spread, **{"samples": 2, **HOW, **more})


def test_a_controller_that_cannot_leave_its_process_is_run_in_it():
    made = LinearFeedback(CASE, GAINS)

    def local(case):
        return made

    spread = {"payload.drag_coefficient": Uniform("5 %")}
    found = sweep(("local", local), spread, case=CASE, samples=1, **HOW)
    assert found.attrs["engine"] == "serial"
    with pytest.raises(InputError, match="local cannot be sent to another process"):
        sweep(("local", local), spread, case=CASE, samples=1, engine="processes", **HOW)


def test_a_controller_without_a_case_wants_one():
    with pytest.raises(InputError, match="'mpc' knows of no case: say case="):
        sweep("mpc", SPREAD, samples=1, **HOW)
