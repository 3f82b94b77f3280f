"""The simulation's benchmark measures what it says: its peer does the same work as ours."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from stored import read_rows

from models.simulation import run_simulation
from models.simulation.compiler import find_compiler
from models.simulation.integrate import hermite_midpoint

FOLDER = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def simulation():
    sys.path.insert(0, str(FOLDER))
    try:
        import simulation

        yield simulation
    finally:
        sys.path.remove(str(FOLDER))


@pytest.fixture(scope="module")
def peers(simulation):
    return sys.modules["simulation_peers"]


@pytest.fixture(scope="module")
def words(simulation):
    return sys.modules["simulation_report"]


@pytest.fixture(scope="module")
def effort(simulation):
    return simulation.Effort(
        runs=1, duration=20.0, on_machine=20.0, peer_runs=1, peer_duration=4.0, hours=0.01
    )


@pytest.fixture(scope="module")
def results(simulation, effort):
    if find_compiler() is None:
        pytest.skip("there is no C compiler")
    return simulation.measured(effort, (simulation.SPRING, simulation.QUESTIONS[-1]))


def payloads(question, peers, duration=40.0):
    """Return the peer, and what our simulation finds for the payload."""
    prepared = question.prepared()
    step = prepared.loop.sample_time
    run = run_simulation(prepared.with_options(duration=duration, store_step=step), seed=3)
    return peers.Peer(prepared, seed=3, duration=duration), run["payload.displacement"]


def test_the_peer_does_the_same_work(simulation, peers):
    peer, ours = payloads(simulation.SPRING, peers)
    answer = peer.sampled()
    assert answer.payload == pytest.approx(ours, abs=1e-4 * ours.std())
    assert answer.evaluations >= 7 * len(ours)
    assert answer.speed == pytest.approx(40.0 / answer.seconds)


def test_plain_calls_are_slower_and_give_the_same(simulation, peers):
    peer, _ = payloads(simulation.SPRING, peers, duration=2.0)
    bound, plain = peer.sampled(), peer.sampled(plain=True)
    np.testing.assert_array_equal(bound.payload, plain.payload)
    assert plain.seconds > 1.5 * bound.seconds


def test_a_continuous_controller_is_that_of_ever_shorter_samples(simulation, peers):
    apart = []
    for sample_time in (0.002, 0.001):
        question = replace(simulation.SPRING, sample_time=sample_time)
        peer, ours = payloads(question, peers)
        answer = peer.continuous()
        apart.append(np.abs(answer.payload - ours).max() / ours.std())
    # Half a sample of delay: the difference is of first order in its length.
    assert apart[0] < 0.02
    assert apart[1] == pytest.approx(apart[0] / 2.0, rel=0.1)


def test_the_peers_hook_moves_as_ours_between_the_rows(peers):
    rng = np.random.default_rng(4)
    z, v, a = rng.standard_normal((3, 6))
    at = peers._interpolated(z, v, a, 0.1)
    for k in range(5):
        assert at(0.1 * k) == pytest.approx((z[k], v[k]), abs=1e-12)
        ends = (z[k], v[k], a[k], z[k + 1], v[k + 1], a[k + 1])
        assert at(0.1 * k + 0.05) == pytest.approx(hermite_midpoint(*ends, 0.1), abs=1e-12)
    assert at(0.5) == pytest.approx((z[5], v[5]), abs=1e-12)


def test_a_controller_with_a_state_is_no_question_for_the_continuous_peer(simulation, peers):
    prepared = simulation.SPRING.prepared()
    hidden = replace(prepared, controller=simulation.StepsOnly(prepared.controller))
    with pytest.raises(ValueError, match="a recursion without states"):
        peers.Peer(hidden, seed=1, duration=1.0).continuous()
    with pytest.raises(ValueError, match="of another plant"):
        peers.Peer(simulation.QUESTIONS[1].prepared(), seed=1, duration=1.0)


def test_the_stopwatch_counts_every_moment_once(simulation, monkeypatch):
    now = 0.0
    monkeypatch.setattr(simulation.clock, "process_time", lambda: now)

    class Worker:
        def outer(self):
            nonlocal now
            now += 1.0
            self.inner()
            now += 2.0
            return "made"

        def inner(self):
            nonlocal now
            now += 4.0

    watch = simulation.Stopwatch()
    with watch.watching({(Worker, "outer"): "a", (Worker, "inner"): "b"}):
        assert Worker().outer() == "made"
        Worker().inner()
    Worker().outer()  # no longer watched
    assert watch.seconds == {"a": 3.0, "b": 8.0}


def test_small_runs_end_in_a_row_of_each_table(results, simulation, words):
    speeds, found, memory = results
    assert [(s.name, s.compiled) for s in speeds] == [
        ("one spring", True),
        ("one spring", False),
        ("one spring, controller in Python", True),
        ("one spring, controller in Python", False),
    ]
    for speed in speeds:
        assert speed.status == "completed"
        assert speed.samples == round(20.0 / (0.05 if "Python" in speed.name else 0.01)) + 1
        assert speed.whole > 0.0
        assert min(speed.parts.values()) > 0.0
        assert set(speed.parts) <= set(words.PART_NAMES)
        assert ("controller" in speed.parts) == ("Python" in speed.name)
        assert speed.kernel_steps == pytest.approx(speed.steps / speed.parts["kernel"])
    # C and the virtual machine simulate the same.
    for one, other in ((speeds[0], speeds[1]), (speeds[2], speeds[3])):
        assert one.payload_rms == pytest.approx(other.payload_rms, rel=1e-8)
    tables = (
        words.speed_table(speeds),
        words.parts_table(speeds),
        words.peer_table(found),
    )
    for table, rows in zip(tables, (4, 2, 3), strict=True):
        assert len(table) == rows + 1
        assert {len(line) for line in table} == {len(table[0])}
    text = words.report(speeds, found, memory, simulation.markdown)
    assert "| one spring | C |" in text
    assert [c.same_work for c in found] == [True, True, False]
    assert max(c.difference for c in found if c.same_work) < 1e-4


def test_rows_say_what_was_measured(results, simulation, words, tmp_path):
    simulation.store(tmp_path / "simulation.csv", results)
    again = words.results_of(read_rows(tmp_path / "simulation.csv"))
    assert words.report(*again, simulation.markdown) == words.report(*results, simulation.markdown)


def test_the_docs_page_shows_the_stored_times(simulation, words):
    page = (FOLDER.parent / "docs" / "performance.md").read_text(encoding="utf-8")
    speeds, found, memory = words.results_of(
        read_rows(FOLDER.parent / "docs" / "data" / "simulation.csv")
    )
    _, _, told = words.report(speeds, found, memory, simulation.markdown).partition("times.\n\n")
    assert told in page


def test_memory_is_that_of_a_process_of_its_own(results, words):
    _, _, memory = results
    assert 30.0 < memory.imported < memory.peak < words.WANTED_MEMORY
    assert memory.hours == 0.01


@pytest.mark.parametrize("at", range(4))
def test_every_question_is_one_of_a_loop_that_holds(at, simulation):
    run = run_simulation(simulation.QUESTIONS[at].prepared().with_options(duration=200.0), seed=1)
    assert run.status == "completed"
    assert run["engaged"][-1] == 1.0
    assert run["drive.saturated"][len(run.time) // 2 :].mean() < 0.01


def test_what_is_not_as_wanted_is_told(words):
    speed = words.Speed(
        name="slow",
        compiled=True,
        wanted=1000.0,
        duration=100.0,
        steps=10_000,
        samples=10_001,
        whole=0.11,
        parts={"kernel": 0.01},
        payload_rms=0.1,
        status="completed",
    )
    peer = words.Comparison(
        name="way",
        same_work=True,
        real_time=10.0,
        evaluations=600.0,
        ours=990.0,
        kernel=5000.0,
        difference=1e-6,
    )
    memory = words.Memory(hours=24.0, imported=100.0, peak=201.0)
    assert words.missed([speed], [peer], memory) == (
        "slow: completed, 909 x real time, wanted 1 000",
        "solve_ivp, way: 99.0 times, wanted 100; differs by 1.0e-06 of the rms",
        "201 MB, wanted 200 MB",
    )
    fine = replace(speed, whole=0.1), replace(peer, ours=1000.0), replace(memory, peak=199.0)
    assert words.missed([fine[0]], [fine[1]], fine[2]) == ()
    assert not replace(fine[0], status="diverged").kept
    assert replace(speed, compiled=False).kept
    assert not replace(fine[1], difference=0.01).kept
    assert replace(peer, same_work=False).kept


@pytest.mark.parametrize(
    ("value", "text"),
    [(9974.0, "9 970"), (58349.0, "58 300"), (72.04, "72.0"), (6.996, "7.00"), (0.0, "0")],
)
def test_three_digits_are_shown(value, text, words):
    assert words._rounded(value) == text


def test_tables_replace_what_is_between_the_marks(words, tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"a\n{words.BEGIN}\nold\n{words.END}\nz\n", encoding="utf-8")
    words.write_into(page, "new")
    words.write_into(page, "newer")
    expected = f"a\n{words.BEGIN}\n\nnewer\n\n{words.END}\nz\n"
    assert page.read_text(encoding="utf-8") == expected
    page.write_text("no marks", encoding="utf-8")
    with pytest.raises(ValueError, match="must hold"):
        words.write_into(page, "new")


def test_the_docs_page_holds_the_marks(words):
    page = (FOLDER.parent / "docs" / "performance.md").read_text(encoding="utf-8")
    assert page.count(words.BEGIN) == page.count(words.END) == 1
