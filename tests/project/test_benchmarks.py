"""The benchmark measures what it says: its peers' loops are ours, and a small run ends in a row."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def synthesis():
    sys.path.insert(0, str(FOLDER))
    try:
        import synthesis

        yield synthesis
    finally:
        sys.path.remove(str(FOLDER))


@pytest.fixture(scope="module")
def peers(synthesis):
    return sys.modules["peers"]


@pytest.fixture(scope="module")
def spring(synthesis):
    return synthesis.question(
        "spring", synthesis.SPRING, 0.05, synthesis.SPRING_BOX, slow_motion=True
    )


@pytest.fixture(scope="module")
def rope(synthesis):
    return synthesis.question("rope", synthesis.ROPE, 0.05, synthesis.ROPE_BOX, slow_motion=True)


# Gains that are stable, with M_s from 1.3 to 2.8 and drag from a third to once that of before.
SPRING_GAINS = np.array([[2116.0, 1077.0, 3797.0], [1500.0, -150.0, 80.0], [2600.0, 900.0, 2500.0]])
ROPE_GAINS = np.array([[155.1, 186.3, 155.0], [90.0, 150.0, 60.0]])


@pytest.mark.parametrize(("name", "gains"), [("spring", SPRING_GAINS), ("rope", ROPE_GAINS)])
def test_sampled_loop_is_the_exact_one(name, gains, peers, request):
    task = request.getfixturevalue(name)
    log_rms, peaks, decay, slow = peers.SampledLoop(task).measure(gains.T)
    bound = task.low_frequency.bound
    for k, row in enumerate(gains):
        exact = task.exact(row)
        assert np.exp(log_rms[k]) == pytest.approx(exact.rms, rel=1e-4)
        assert peaks[k] == pytest.approx(exact.max_sensitivity, rel=1e-3)
        excess = max(peaks[k] / task.max_sensitivity, slow[k] / bound) - 1.0
        assert excess == pytest.approx(exact.excess, abs=2e-3)
        assert decay[k] < 0.0


def test_sampled_loop_sees_instability(spring, rope, peers):
    for task, gains in ((spring, SPRING_GAINS), (rope, ROPE_GAINS)):
        loop = peers.SampledLoop(task)
        # Ten times the gain is beyond what the delay allows.
        values = loop.objective(np.stack([gains[0], 10.0 * gains[0]], axis=1), 2.0)
        assert values[0] < 5.0
        assert values[1] > 500.0


def test_one_evaluation_is_that_of_a_generation(spring, peers):
    loop = peers.SampledLoop(spring)
    together = loop.objective(SPRING_GAINS.T, 2.0)
    alone = [float(loop.objective(row, 2.0)) for row in SPRING_GAINS]
    assert together == pytest.approx(alone, rel=1e-10)


@pytest.mark.parametrize(("name", "gains"), [("spring", SPRING_GAINS), ("rope", ROPE_GAINS)])
def test_python_control_makes_the_same_loop(name, gains, peers, request):
    task = request.getfixturevalue(name)
    log_rms, peaks, decay, slow = peers.SampledLoop(task).measure(gains[:1].T)
    by_control = peers.PythonControlLoop(task).measure(gains[0])
    assert by_control[0] == pytest.approx(log_rms[0], abs=1e-5)
    assert 1.0 / by_control[1].min() == pytest.approx(peaks[0], rel=0.02)  # on a coarser grid
    assert by_control[2] == pytest.approx(decay[0], rel=1e-4)
    assert by_control[3] == pytest.approx(slow[0], rel=1e-4)


@pytest.mark.ci
def test_fixed_drag_is_the_plants_own(rope, peers):
    fixed = replace(rope, drag=None)
    log_rms, *_ = peers.SampledLoop(fixed).measure(ROPE_GAINS[:1].T)
    assert np.exp(log_rms[0]) == pytest.approx(fixed.exact(ROPE_GAINS[0]).rms, rel=1e-4)
    # Less motion, less drag: the payload moves more than with the drag of before compensation.
    assert rope.exact(ROPE_GAINS[0]).rms > 1.01 * np.exp(log_rms[0])


@pytest.mark.ci
def test_small_run_ends_in_a_row_of_each_table(spring, synthesis):
    effort = synthesis.Effort(
        runs=1,
        starts=3,
        seeds=1,
        slsqp_starts=1,
        slsqp_iterations=3,
        popsize=4,
        generations=8,
        verify=False,
    )
    row = synthesis.compare(spring, effort, by_hand=True)
    assert row.ours.excess < 1e-4
    assert row.ours.rms == pytest.approx(spring.exact(row.gains).rms)
    assert row.found.rms == pytest.approx(spring.exact(row.found_gains).rms)
    assert min(row.seconds, row.evolution, row.single, row.slsqp) > 0.0
    assert row.slsqp_run == 1
    for table in (synthesis.quality_table([row]), synthesis.time_table([row])):
        assert {len(line) for line in table} == {len(table[0])}
        assert synthesis.plain(table).splitlines()[2].startswith("spring")
        assert synthesis.markdown(table).splitlines()[2].startswith("| spring |")


def test_a_result_that_is_worse_is_told(synthesis, peers):
    def row(ours, found, excess=0.0):
        exact = peers.Exact(rms=ours, max_sensitivity=2.0, excess=excess)
        return synthesis.Row(
            name="row",
            ours=exact,
            gains=np.zeros(3),
            seconds=1.0,
            agreed=1,
            verification=0.0,
            found=replace(exact, rms=found),
            found_gains=np.zeros(3),
            hits=1,
            seeds=1,
            evolution=30.0,
            single=60.0,
        )

    assert row(1.0009, 1.0).kept
    assert not row(1.0011, 1.0).kept
    assert row(0.5, 1.0).kept
    assert not row(0.5, 1.0, excess=1e-3).kept
    assert not replace(row(1.0, 1.0), slsqp_found=0.99).kept


def test_tables_replace_what_is_between_the_marks(synthesis, tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"before\n{synthesis.BEGIN}\nold\n{synthesis.END}\nafter\n", encoding="utf-8")
    synthesis.write_into(page, "new")
    synthesis.write_into(page, "newer")
    expected = f"before\n{synthesis.BEGIN}\n\nnewer\n\n{synthesis.END}\nafter\n"
    assert page.read_text(encoding="utf-8") == expected
    page.write_text("no marks", encoding="utf-8")
    with pytest.raises(ValueError, match="must hold"):
        synthesis.write_into(page, "new")


def test_the_docs_page_holds_the_marks(synthesis):
    page = (FOLDER.parent / "docs" / "performance.md").read_text(encoding="utf-8")
    assert page.count(synthesis.BEGIN) == page.count(synthesis.END) == 1
