"""`sh.compare`: common random numbers, processes, what is kept, and what it concludes."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import signal

import numpy as np
import pytest
from designs import thesis_design
from former_cases import load_case
from shown import terminal_text

import stillhook as sh
from models.sensing import HEARD, Measurement
from stillhook.comparison import Comparison, comparison_report, sentences_of
from stillhook.comparison import run as compare_run
from stillhook.comparison import store as compare_store
from stillhook.comparison.bench import CellBench, CellTask
from stillhook.comparison.cell import Cell, ComparisonQuestion, Prepared
from stillhook.comparison.figures import heights, worst_moment
from stillhook.comparison.mismatch import Mismatch
from stillhook.comparison.store import STORE
from stillhook.controllers import ALL, CONTENDERS, DEFAULTS, StoredDesign, contenders_of
from synth.controllers import LinearFeedback

CASE = load_case("thesis-1975").replace({"sea.significant_height": 0.5})
NOISY = CASE.replace({"sensors.mru": {"noise_floor": 0.02, "delay": 0.1}})
FAST = {"seeds": 2, "duration": 30.0, "traces": False}


class Listener:
    """Holds the load, adds a wobble of its own, and remembers what it is shown."""

    def __init__(self, case: sh.Case, name: str, sample_time: float, wobble: float) -> None:
        self.name, self.sample_time, self.wobble = name, sample_time, wobble
        inner = sh.ConstantTension(case)
        self.rest = inner.step(Measurement.of({"rope.tension": case.static_tension}), 0.0)
        self.heard: list[np.ndarray] = []

    def reset(self) -> None:
        self.heard = []

    def step(self, measurement: Measurement, time: float) -> float:
        self.heard.append(measurement.values.copy())
        return self.rest + self.wobble * math.sin(time)


def listener(case: sh.Case) -> Listener:
    return Listener(case, "listener", 0.05, 0.0)


def deadly(case: sh.Case) -> Listener:
    os.kill(os.getpid(), signal.SIGKILL)
    return listener(case)


class Clumsy(Listener):
    def step(self, measurement: Measurement, time: float) -> float:
        if time > 5.0:
            raise RuntimeError("stepped on the cable")
        return super().step(measurement, time)


def clumsy(case: sh.Case) -> Listener:
    return Clumsy(case, "clumsy", 0.05, 0.0)


def unmade(case: sh.Case) -> Listener:
    raise KeyError("torque")


def asked(case: sh.Case = CASE, **changes: object) -> ComparisonQuestion:
    given = {"duration": 30.0, "settle": 15.0, "mismatch": Mismatch.read(None), **changes}
    return ComparisonQuestion(case=case, **given)


def numbers(found: Comparison) -> list[dict]:
    """Return all cells without what a clock has measured."""
    clean = []
    for cell in found.cells:
        content = {**cell.to_dict(), "wall": 0.0, "step": {}}
        clean.append(json.dumps(content, sort_keys=True))
    return clean


def tasks_done(monkeypatch) -> list[CellTask]:
    """Return a list to which every task is added that is done from now on."""
    done: list[CellTask] = []
    do = CellBench.do

    def noted(self, task, progress=None):
        done.append(task)
        return do(self, task)

    monkeypatch.setattr(CellBench, "do", noted)
    return done


# common random numbers


def test_every_contender_meets_the_same_hook_motion_whatever_its_sample_time():
    law = StoredDesign.of(thesis_design())
    question = asked()
    shown = {}
    for name in ("none", "feed-forward", "thesis"):
        prepared = Prepared(question, CONTENDERS[name], 0.5, law)
        shown[name] = prepared.trace(3, 15.0)
    own = Prepared(question, contenders_of([("listener", listener)])[0], 0.5, None).trace(3, 15.0)
    mine, heave = np.round(own.time, 6), own.signals["hook.heave"]
    assert mine.size == 601
    assert np.ptp(heave) > 0.2
    # Samples of 20 ms meet those of 50 ms every tenth of a second, samples of 10 ms all of them.
    for name, count in (("none", 301), ("feed-forward", 301), ("thesis", 601)):
        theirs = np.round(shown[name].time, 6)
        at, here = np.isin(theirs, mine), np.isin(mine, theirs)
        assert at.sum() == count
        seen = shown[name].signals["hook.heave"][at]
        # The brake's record grows out of rest by its own easing, the others' by the simulator's.
        np.testing.assert_allclose(seen, heave[here], rtol=0.0, atol=3e-7)


def test_contenders_with_one_sample_time_are_shown_the_same_noise_to_the_bit():
    both = [Listener(NOISY, name, 0.05, wobble) for name, wobble in (("a", 0.0), ("b", 5.0))]
    for each in both:
        Prepared(asked(NOISY), contenders_of([each])[0], 0.5, None).run(7)
    first, second = (np.array(each.heard) for each in both)
    assert np.array_equal(first[:, 5:8], second[:, 5:8])
    assert not np.allclose(first[:, 2], second[:, 2], atol=1e-3)
    other = Listener(NOISY, "c", 0.05, 0.0)
    Prepared(asked(NOISY), contenders_of([other])[0], 0.5, None).run(8)
    assert not np.allclose(np.array(other.heard)[:, 5], first[:, 5], atol=1e-3)


def test_a_run_is_that_of_simulate_with_the_same_seed():
    found = sh.compare(CASE, ["feed-forward", "thesis"], jobs=1, **FAST)
    for name in ("feed-forward", "thesis"):
        named = "feedback" if name == "thesis" else name
        runs = sh.simulate(CASE, named, seeds=2, duration=30.0, settle=15.0)
        for cell, run in zip(found.of(name, 0.5), runs, strict=True):
            assert cell.rms == run.statistics.value("tracking error rms")
            assert cell.quantities["motor torque rms"] == run.statistics.value("motor torque rms")


@pytest.mark.ci
def test_runs_shared_by_processes_are_those_of_one_process_to_the_bit():
    who = ["none", "feed-forward", ("listener", listener)]
    alone = sh.compare(CASE, who, jobs=1, **FAST)
    shared = sh.compare(CASE, who, jobs=2, **FAST)
    assert alone.complete
    assert len(alone.cells) == 6
    assert numbers(alone) == numbers(shared)
    assert all(cell.step for cell in shared.of("listener", 0.5))


# what is kept


def test_a_comparison_that_was_stopped_goes_on_and_ends_the_same(tmp_path, monkeypatch):
    whole = sh.compare(CASE, ["none", "feed-forward"], jobs=1, **FAST)

    def stop(what: str, done: int, total: int) -> None:
        if done >= 2:
            raise KeyboardInterrupt

    first = sh.compare(CASE, ["none", "feed-forward"], jobs=1, out=tmp_path, progress=stop, **FAST)
    assert not first.complete
    assert len(first.cells) == 2
    done: list[CellTask] = []
    do = CellBench.do
    monkeypatch.setattr(
        CellBench, "do", lambda self, task, p=None: done.append(task) or do(self, task)
    )
    then = sh.compare(CASE, ["none", "feed-forward"], jobs=1, out=tmp_path, **FAST)
    assert [(task.name, task.seed) for task in done] == [("none", 1), ("feed-forward", 1)]
    assert then.complete
    assert numbers(then) == numbers(whole)
    assert then.table.drop(columns=["step median"]).equals(
        whole.table.drop(columns=["step median"])
    )
    done.clear()
    more = sh.compare(CASE, ["none", "feed-forward"], jobs=1, out=tmp_path, **{**FAST, "seeds": 3})
    assert [(task.name, task.seed) for task in done] == [("none", 2), ("feed-forward", 2)]
    assert numbers(more)[:2] == numbers(whole)[:2]


def test_a_first_answer_of_everybody_comes_before_a_second_seed_and_any_design(monkeypatch):
    done, seen = tasks_done(monkeypatch), []
    law = StoredDesign.of(thesis_design())
    monkeypatch.setattr("stillhook.comparison.bench.design_law", lambda *given: law)
    sh.compare(
        CASE, ["combined", "none", "feed-forward"], jobs=1, told=lambda f: seen.append(f), **FAST
    )
    order = [(task.kind, task.name, task.seed) for task in done]
    assert order[:2] == [("run", "none", 0), ("run", "feed-forward", 0)]
    assert order[2] == ("design", "combined", -1)
    assert [len(found.cells) for found in seen] == [1, 2, 3, 4, 5, 6]
    assert seen[1].pooled("feed-forward", 0.5) > 0.0


def cell_of(task, told):
    """Return the cell of a task that was completed with some quantities."""
    return Cell(
        contender=task.name,
        height=task.height,
        seed=task.seed,
        status="completed",
        quantities=told,
    )


def test_each_kind_takes_part_once_unless_others_are_named(monkeypatch):
    asked = []

    def noted(self, task, progress=None):
        asked.append(task)
        told = {"tracking error rms": 0.1, "tracking error largest": 0.3, "saturated share": 1.0}
        if task.kind == "design":
            return StoredDesign.of(thesis_design())
        return cell_of(task, told)

    monkeypatch.setattr(CellBench, "do", noted)
    found = sh.compare(CASE, jobs=1, traces=False)
    assert [each.name for each in found.contenders] == list(DEFAULTS)
    assert (len(found.seeds), found.question.duration, found.question.starts) == (6, 300.0, 1)
    assert len(found.of("mpc", 0.5)) == 6
    assert [cell.seed for cell in found.of("clairvoyant", 0.5)] == [0, 1, 2]
    assert asked[-1].name == "clairvoyant"
    every = sh.compare(CASE, "all", jobs=1, traces=False)
    assert [each.name for each in every.contenders] == list(ALL)
    assert (every.question.starts, len(every.of("clairvoyant", 0.5))) == (8, 6)
    own = sh.compare(CASE, design=("mine", thesis_design()), jobs=1, traces=False)
    names = [each.name for each in own.contenders]
    assert "combined" not in names
    assert names[5] == "mine"
    without = CASE.replace({"gains": None})
    assert "thesis" not in [each.name for each in sh.compare(without, jobs=1).contenders]
    with pytest.raises(sh.InputError, match="design is for the usual contenders"):
        sh.compare(CASE, ["none"], design=thesis_design())


@pytest.mark.parametrize(
    ("share", "lost", "computed"), [(0.05, False, False), (0.2, False, True), (90.0, True, False)]
)
def test_there_is_no_floor_where_no_drive_is_at_its_limits(monkeypatch, share, lost, computed):
    def noted(self, task, progress=None):
        told = {"tracking error rms": 0.1, "tracking error largest": 0.3, "saturated share": 0.0}
        if task.name == "mpc":
            told |= {"saturated share": share} | ({"lost lock at": 10.0} if lost else {})
        return cell_of(task, told)

    monkeypatch.setattr(CellBench, "do", noted)
    found = sh.compare(CASE, ["feed-forward", "clairvoyant", "mpc"], jobs=1, **FAST)
    assert bool(found.of("clairvoyant", 0.5)) is computed
    shown = " ".join(terminal_text(comparison_report(found), width=300).split())
    reason = "clairvoyant did not take part: no drive is at its limits for over 0.1 % of the time"
    assert (reason in shown) is not computed


def test_a_floor_that_is_next_to_nothing_makes_no_ratio():
    found = fabricated({"feed-forward": [0.1, 0.3], "clairvoyant": [1e-10, 2e-10]})
    assert found.floor_at(0.5) is None
    assert math.isnan(found.table.iloc[0]["over the floor"])
    shown = " ".join(terminal_text(comparison_report(found), width=300).split())
    assert "no floor at H_s 0.5 m: everything known in advance leaves under a thousandth" in shown
    low, high = heights(found).axes[0].get_xlim()
    assert high / low < 1e3


def test_a_line_that_a_crash_cut_short_is_made_again(tmp_path):
    whole = sh.compare(CASE, ["none"], jobs=1, out=tmp_path, **FAST)
    store = tmp_path / STORE
    data = store.read_bytes()
    assert data.count(b"\n") == 3
    for cut in (1, 40, len(data.splitlines()[-1])):
        store.write_bytes(data[:-cut])
        again = sh.compare(CASE, ["none"], jobs=1, out=tmp_path, **FAST)
        assert numbers(again) == numbers(whole)
        assert store.read_bytes().count(b"\n") == 3


def test_a_spoilt_or_foreign_store_is_refused(tmp_path):
    sh.compare(CASE, ["none"], jobs=1, out=tmp_path, **FAST)
    store = tmp_path / STORE
    data = store.read_bytes()
    at = data.index(b'"payload rms": ') + len(b'"payload rms": ') + 3
    digit = b"1" if data[at : at + 1] != b"1" else b"2"
    store.write_bytes(data[:at] + digit + data[at + 1 :])
    with pytest.raises(sh.InputError, match=r"line 2 is not as it was written: the file is"):
        sh.compare(CASE, ["none"], jobs=1, out=tmp_path, **FAST)
    for foreign in (b"my notes\n", b'{"a": 1}\n', b"no end", b'{"crc": 1, "of": {}}\n'):
        store.write_bytes(foreign)
        with pytest.raises(sh.InputError, match=r"is not a|is not as it was written"):
            sh.compare(CASE, ["none"], jobs=1, out=tmp_path, **FAST)
        assert store.read_bytes() == foreign


def test_a_store_that_answers_another_question_is_refused_and_told_apart(tmp_path):
    sh.compare(CASE, ["none"], jobs=1, out=tmp_path, **FAST)
    data = (tmp_path / STORE).read_bytes()
    for changes, told in (
        ({"duration": 40.0}, r"duration is 30.0, not 40.0"),
        ({"mismatch": "delay=+50 ms"}, r"mismatch.delay is not given, not \+50 ms"),
    ):
        with pytest.raises(sh.InputError, match=told):
            sh.compare(CASE, ["none"], jobs=1, out=tmp_path, **{**FAST, **changes})
    heavier = CASE.replace({"payload.mass": 40000.0})
    with pytest.raises(sh.InputError, match=r"holds another comparison: case.payload.mass is 36"):
        sh.compare(heavier, ["none"], jobs=1, out=tmp_path, **FAST)
    assert (tmp_path / STORE).read_bytes() == data


def test_a_store_of_other_code_is_refused(tmp_path, monkeypatch):
    sh.compare(CASE, ["none"], jobs=1, out=tmp_path, **FAST)
    own = compare_store.versions(compare_store.CellBench)
    monkeypatch.setattr(compare_store, "versions", lambda entry: {**own, "code": "0123456789"})
    with pytest.raises(sh.InputError, match="another version of Stillhook's own code"):
        sh.compare(CASE, ["none"], jobs=1, out=tmp_path, **FAST)


def test_two_comparisons_do_not_write_into_one_store(tmp_path):
    pytest.importorskip("fcntl")
    said = []

    def meddle(what: str, done: int, total: int) -> None:
        if not said:
            with pytest.raises(sh.InputError, match="another process writes this") as refused:
                sh.compare(CASE, ["none"], jobs=1, out=tmp_path, **FAST)
            said.append(refused.value)

    assert sh.compare(CASE, ["none"], jobs=1, out=tmp_path, progress=meddle, **FAST).complete
    assert len(said) == 1


def test_another_contender_of_the_same_name_is_run_anew(tmp_path, monkeypatch):
    first = Listener(CASE, "own", 0.05, 0.0)
    sh.compare(CASE, [first], jobs=1, out=tmp_path, **FAST)
    done = []
    do = CellBench.do
    monkeypatch.setattr(
        CellBench, "do", lambda self, task, p=None: done.append(task) or do(self, task)
    )
    sh.compare(CASE, [Listener(CASE, "own", 0.05, 5.0)], jobs=1, out=tmp_path, **FAST)
    assert len(done) == 2


# contenders that fail


@pytest.mark.ci
def test_a_process_that_dies_costs_its_own_runs_only_and_is_tried_twice(monkeypatch):
    made = []
    begin = compare_run.Processes.submit
    monkeypatch.setattr(
        compare_run.Processes,
        "submit",
        lambda self, task: made.append(task.name) or begin(self, task),
    )
    found = sh.compare(CASE, ["none", ("deadly", deadly)], jobs=2, **{**FAST, "seeds": 1})
    assert found.complete
    assert made.count("deadly") == 2
    assert {cell.status for cell in found.of("none", 0.5)} == {"completed"}
    for cell in found.of("deadly", 0.5):
        assert (cell.status, cell.message) == ("died", "its process was ended by SIGKILL, twice")
    row = found.table.set_index("contender").loc["deadly"]
    assert (row["failed"], row["runs"]) == (1, 1)


def test_a_contender_that_cannot_take_part_is_a_row_with_its_reason():
    case = load_case("subsea-crane")
    found = sh.compare(
        case, ["none", "thesis", ("unmade", unmade), ("clumsy", clumsy)], jobs=1, **FAST
    )
    height = case.sea.significant_height
    assert found.refused["thesis", height] == (
        "the case subsea-crane has no gains in use: optimise them, or give them"
    )
    assert found.refused["unmade", height] == "KeyError: 'torque'"
    notes = found.table.set_index("contender")["note"]
    assert notes["clumsy"] == "RuntimeError: stepped on the cable"
    assert found.lost("clumsy", height) == 2
    assert "thesis did not take part: the case subsea-crane has no gains" in terminal_text(
        comparison_report(found), width=300
    )
    assert list(found.table["runs"]) == [2, 0, 0, 2]


def test_who_may_take_part_is_checked_at_once():
    with pytest.raises(sh.InputError, match=r"no controller 'thesys'; there are: none, constant-t"):
        sh.compare(CASE, ["thesys"])
    with pytest.raises(sh.InputError, match="must have names that differ, got 'none' twice"):
        sh.compare(CASE, ["none", "none"])
    with pytest.raises(sh.InputError, match="at least one controller is wanted"):
        sh.compare(CASE, [])
    with pytest.raises(sh.InputError, match=r"must be a name, a design, .*; got float"):
        sh.compare(CASE, [1.5])
    with pytest.raises(sh.InputError, match="heights must be"):
        sh.compare(CASE, ["none"], heights=[-1.0])
    with pytest.raises(sh.InputError, match="design_at must be one of each, case"):
        sh.compare(CASE, ["none"], design_at="never")
    assert set(DEFAULTS) < set(CONTENDERS)
    for each in CONTENDERS.values():
        assert each.what
        assert each.knows


def test_a_design_that_is_given_is_the_same_law_as_its_gains():
    found = sh.compare(CASE, ["thesis", ("mine", thesis_design())], jobs=1, **FAST)
    for one, other in zip(found.of("thesis", 0.5), found.of("mine", 0.5), strict=True):
        assert one.quantities == other.quantities


def test_a_function_at_the_prompt_runs_here_and_is_never_taken_from_the_store(tmp_path):
    seen = []

    def made(case: sh.Case) -> Listener:
        seen.append(case)
        return listener(case)

    for jobs in (1, 2):
        found = sh.compare(
            CASE, ["none", ("mine", made)], jobs=jobs, out=tmp_path, mismatch="payload=+30%", **FAST
        )
    assert found.complete
    assert len(found.cells) == 4
    assert [case.payload.mass for case in seen] == [CASE.payload.mass] * 2


# laws and mismatch


def test_a_law_survives_json_to_the_last_bit():
    rng = np.random.default_rng(5)
    values = {k: rng.standard_normal(s).tolist() for k, s in (("A", (2, 2)), ("B", (2, 1)))}
    values |= {"C": rng.standard_normal((1, 2)).tolist(), "D": rng.standard_normal((1, 1)).tolist()}
    values["A"] = (np.array(values["A"]) - 5.0 * np.eye(2)).tolist()
    values |= {"measurements": ["payload.velocity"], "inputs": ["drive.command"]}
    law = StoredDesign(values=values, ok=True)
    again = StoredDesign(**json.loads(json.dumps(law.to_dict())))
    assert again.digest == law.digest
    for name in "ABCD":
        assert np.array_equal(getattr(again.law, name), np.array(values[name]))
    one, other = (LinearFeedback(CASE, each.law) for each in (law, again))
    assert one.dynamic
    shown = np.random.default_rng(6).standard_normal((4, len(HEARD)))
    commands = [
        [each.step(Measurement(row), 0.01 * i) for i, row in enumerate(shown)]
        for each in (one, other)
    ]
    assert np.ptp(commands[0]) > 0.0
    assert commands[0] == commands[1]


def test_a_mismatch_changes_the_plant_and_not_the_controller():
    question = asked(mismatch=Mismatch.read("payload=+30%,E=-30%,delay=+50 ms,sea=+0.1 m"))
    true, known = question.true(0.5), question.known(0.5)
    assert known == CASE
    assert true.payload.mass == pytest.approx(1.3 * CASE.payload.mass, rel=1e-12)
    mass = true.payload.virtual_mass / CASE.payload.virtual_mass
    assert mass == pytest.approx(1.3, rel=1e-12)
    assert true.payload.submerged_weight == CASE.payload.submerged_weight
    assert true.rope.stiffness == pytest.approx(0.7 * CASE.rope.stiffness, rel=1e-12)
    assert true.sensors.telemetry.delay == pytest.approx(0.05)
    assert true.sea.significant_height == pytest.approx(0.6)
    # less than what hangs in the water cannot move: the water gives way
    light = Mismatch.read("payload=-30%,weight=-20%").apply(CASE).payload
    assert light.virtual_mass == pytest.approx(0.7 * CASE.payload.virtual_mass, rel=1e-12)
    assert light.mass * 9.80665 >= light.submerged_weight
    assert light.submerged_weight == pytest.approx(0.8 * CASE.payload.submerged_weight, rel=1e-12)
    other = Mismatch.read("spectrum=jonswap, winch.motor.inertia=120").apply(CASE)
    assert other.sea.spectral_peak_period == pytest.approx(CASE.sea.spectral_peak_period)
    assert (other.sea.spectrum, other.winch.motor.inertia) == ("jonswap", 120.0)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("foo=1", "there is no 'foo'; there are payload, weight, stiffness"),
        ("payload", r"must be NAME=VALUE, as in payload=\+30%"),
        ("payload=1,payload=2", "payload is given twice"),
        ("delay=-50 ms", r"telemetry.delay: must be a time in \[0, 60\] s"),
        ("delay=+3 kg", "must be a time"),
        ("rope.lumping=+3%", "is not a number in the case"),
    ],
)
def test_a_mismatch_that_makes_no_sense_is_refused(text, told):
    with pytest.raises(sh.InputError, match=told):
        sh.compare(CASE, ["none"], mismatch=text, **FAST)


def test_a_mismatch_is_felt():
    plain = sh.compare(CASE, ["thesis"], jobs=1, **FAST)
    off = sh.compare(CASE, ["thesis"], jobs=1, mismatch="delay=+50 ms", **FAST)
    assert off.pooled("thesis", 0.5) > 1.2 * plain.pooled("thesis", 0.5)


# what it concludes


def fabricated(rms: dict[str, list[float]], lost: tuple[str, ...] = ()) -> Comparison:
    who = contenders_of(list(rms))
    cells = []
    for name, values in rms.items():
        for seed, value in enumerate(values):
            told = {"tracking error rms": value, "tracking error largest": 3.0 * value}
            if name in lost:
                told["lost lock at"] = 12.0
            cells.append(
                Cell(
                    contender=name,
                    height=0.5,
                    seed=seed,
                    status="completed",
                    quantities=told,
                    worst=20.0,
                )
            )
    return Comparison(
        case=CASE,
        contenders=who,
        heights=(0.5,),
        seeds=tuple(range(len(next(iter(rms.values()))))),
        question=asked(),
        cells=tuple(cells),
    )


def test_rms_and_ratios_are_pooled_and_their_intervals_logarithmic():
    values = [0.1, 0.3, 0.2, 0.25]
    found = fabricated({"feed-forward": values, "clairvoyant": [0.05, 0.1, 0.1, 0.1]})
    row = found.table.iloc[0]
    squares, student = np.square(values), 3.182446305284263  # 3 degrees, 97.5 %
    # of a mean of four, and half of it as the root is taken
    half = student * squares.std(ddof=1) / squares.mean() / 2.0 / 2.0
    rms = math.sqrt(0.2025 / 4.0)
    assert row["payload rms"] == pytest.approx(rms, rel=1e-12)
    assert row["payload rms low"] == pytest.approx(rms * math.exp(-half), rel=1e-9)
    assert row["payload rms high"] == pytest.approx(rms * math.exp(half), rel=1e-9)
    assert row["over the floor"] == pytest.approx(math.sqrt(0.2025 / 0.0325), rel=1e-12)
    other = np.square([0.05, 0.1, 0.1, 0.1])
    spread = (squares / squares.mean() - other / other.mean()).std(ddof=1)
    high = row["over the floor"] * math.exp(student * spread / 2.0 / 2.0)
    assert row["over the floor high"] == pytest.approx(high, rel=1e-9)
    assert (row["worst seed"], row["worst seed rms"]) == (1, 0.3)


def test_the_floor_is_compared_on_the_seeds_that_both_have():
    found = fabricated({"feed-forward": [0.1, 0.3], "clairvoyant": [0.05, math.nan]})
    assert found.table.iloc[0]["over the floor"] == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("predicted", "told"),
    [
        ([0.05, 0.11, 0.16, 0.19], "0.50 (0.47 to 0.53) times the rms of mpc-clipped; it helps"),
        ([0.2, 0.45, 0.6, 0.81], "2.0 (1.9 to 2.2) times the rms of mpc-clipped; it does not"),
        ([0.1, 0.22, 0.31, 0.40], "times the rms of mpc-clipped; it does not help"),
        ([0.01, 0.22, 0.02, 0.6], "; whether it helps cannot be told from so few seeds"),
    ],
)
def test_what_planning_is_worth_is_read_off_the_numbers(predicted, told):
    found = fabricated({"mpc-clipped": [0.1, 0.22, 0.31, 0.39], "mpc": predicted})
    (sentence,) = sentences_of(found)
    assert sentence.startswith("H_s 0.5 m: planning within the limits: mpc has ")
    assert told in sentence


def test_sensors_filter_and_plan_are_credited_apart_and_against_the_stillest_rival():
    rms = {
        "none": [1.0, 1.1],
        "feed-forward": [0.2, 0.21],
        "thesis": [0.3, 0.31],
        "combined": [0.1, 0.11],
        "mpc-clipped": [0.04, 0.05],
        "mpc": [0.02, 0.021],
        "mpc-preview": [0.01, 0.011],
        "clairvoyant": [0.008, 0.009],
    }
    values = {"measurements": ["payload.velocity", "mru.heave"]}
    law = StoredDesign(values=values, ok=True)
    found = dataclasses.replace(fabricated(rms), laws={("combined", 0.5): law})
    parts = [
        (text.split(": ")[1], text.split(": ")[2].split(" ")[0], text.split(" of ")[-1][:12])
        for text in sentences_of(found)[1:]
    ]
    assert [(what, who) for what, who, _ in parts] == [
        ("hearing payload and reference unit", "combined"),
        ("the filter of MPC, without its plan", "mpc-clipped"),
        ("planning within the limits", "mpc"),
        ("filter and plan", "mpc"),
        ("knowing the future", "mpc-preview"),
        ("the rest to the floor", "clairvoyant"),
    ]
    rivals = ["feed-forward", "combined", "mpc-clipped", "combined", "mpc", "mpc"]
    for text, rival in zip(sentences_of(found)[1:], rivals, strict=True):
        assert f" times the rms of {rival}" in text
    # A combined design that is worse than feed-forward gets nobody any credit.
    worse = dataclasses.replace(
        fabricated(rms | {"combined": [0.5, 0.51]}), laws={("combined", 0.5): law}
    )
    told = sentences_of(worse)
    assert "combined has 2.5 (2.0 to 3.0) times the rms of feed-forward; it does not" in told[1]
    assert "mpc-clipped has 0.22 (" in told[2]
    assert "times the rms of feed-forward; it helps" in told[2]
    assert "filter, plan and a second sensor: mpc has 0.10" in told[4]
    assert "times the rms of feed-forward; it helps" in told[4]


def test_a_single_seed_is_not_called_a_difference():
    found = fabricated({"feed-forward": [0.2], "mpc": [0.1]})
    assert "mpc has 0.50 times the rms of feed-forward, in a single sea" in sentences_of(found)[1]


def test_who_loses_the_load_is_said():
    found = fabricated({"none": [0.5, 0.5], "thesis": [1.0, 2.0]}, lost=("thesis",))
    assert found.cliff("thesis") == 0.5
    assert math.isnan(found.cliff("none"))
    assert "though it loses the load in 2 of 2 runs" in sentences_of(found)[0]
    assert "3.2 (0.070 to 143) times that with the drum held" in sentences_of(found)[0]


def test_a_run_that_diverged_is_infinitely_bad():
    cell = Cell(contender="none", height=0.5, seed=0, status="diverged")
    assert cell.rms == math.inf
    assert cell.lost


def test_folder_and_figures_say_what_was_found(tmp_path):
    found = sh.compare(
        CASE,
        ["none", "feed-forward", "thesis"],
        seeds=2,
        duration=30.0,
        heights=[0.4, 3.0],
        jobs=1,
        out=tmp_path,
    )
    assert {trace.contender for trace in found.traces} == {"none", "feed-forward", "thesis"}
    height, seed, moment = found.worst_moment
    assert height == 3.0
    best = found.best(3.0, ("linear",))
    trace = next(t for t in found.traces if t.contender == best)
    at = int(np.argmin(np.abs(trace.time - moment)))
    worst = found.of(best, 3.0)[seed].quantities["tracking error largest"]
    assert abs(trace.signals["payload.displacement"][at]) == pytest.approx(worst, rel=1e-9)
    written = {path.name for path in sh.write_comparison(tmp_path, found)}
    figures = {f"{name}.{kind}" for name in ("heights", "worst") for kind in ("svg", "png")}
    tables = {"case.yaml", "table.csv", "runs.csv", "traces.csv", "summary.json", "summary.md"}
    assert written == figures | tables - {"traces.csv"}
    assert not (tmp_path / "traces.csv").exists()
    again = {path.name for path in sh.write_comparison(tmp_path, found, traces=True)}
    assert again == figures | tables
    content = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert [row["contender"] for row in content["table"]] == [
        name for name in ("none", "feed-forward", "thesis") for _ in range(2)
    ]
    assert content["sentences"] == list(sentences_of(found))
    assert len(content["runs"]) == 12
    report = (tmp_path / "summary.md").read_text(encoding="utf-8")
    for each in found.contenders:
        assert each.what in report
    axes = heights(found).axes[0]
    assert axes.get_yscale() == "log"
    lines = {line.get_label(): line for line in axes.lines}
    shown = lines["feed-forward"].get_ydata()
    assert shown[1] / shown[0] == pytest.approx(
        found.pooled("feed-forward", 3.0) / found.pooled("feed-forward", 0.4)
    )
    assert "first loses the load" in lines
    assert len(worst_moment(found).axes) == 4


def test_without_runs_there_is_nothing_to_draw():
    empty = dataclasses.replace(fabricated({"none": [0.1]}), cells=())
    with pytest.raises(sh.InputError, match="no runs to draw"):
        heights(empty)
    with pytest.raises(sh.InputError, match="no traces to draw"):
        worst_moment(empty)
    assert sentences_of(empty) == ()


@pytest.mark.slow
def test_no_controller_beats_the_floor_and_preview_beats_the_brake():
    found = sh.compare(
        CASE.replace({"sea.significant_height": 1.9}),
        ["none", "feed-forward", "mpc-preview", "clairvoyant"],
        seeds=2,
        duration=120.0,
        jobs=1,
        traces=False,
    )
    floor = found.pooled("clairvoyant", 1.9)
    for name in ("none", "feed-forward", "mpc-preview"):
        assert found.pooled(name, 1.9) > floor
    assert found.pooled("mpc-preview", 1.9) < 0.2 * found.pooled("none", 1.9)


@pytest.mark.parametrize("name", ["study", "floor", "mismatch", "calm"])
def test_a_table_of_the_documentation_is_that_of_the_study(name):
    import sys
    from pathlib import Path

    root = Path(__file__).resolve().parents[3]
    sys.path.insert(0, str(root / "docs" / "make"))
    try:
        import comparison
    finally:
        sys.path.pop(0)
    page = (root / "docs" / "compare.md").read_text(encoding="utf-8")
    _, _, after = page.partition(f"<!-- {name}: begin -->\n")
    assert after.partition(f"\n<!-- {name}: end -->")[0] == comparison.TABLES[name](
        comparison.load()
    )
