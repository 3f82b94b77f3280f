"""The benchmark measures what it says: its peers' loops are ours, and a small run ends in rows."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from former_cases import load_case

from synth import evaluate_gains

FOLDER = Path(__file__).parents[2] / "benchmarks"
MADE = FOLDER.parent / "docs" / "make"


@pytest.fixture(scope="module")
def synthesis():
    for folder in (FOLDER, MADE):
        sys.path.insert(0, str(folder))
    try:
        import synthesis

        yield synthesis
    finally:
        for folder in (FOLDER, MADE):
            sys.path.remove(str(folder))


@pytest.fixture(scope="module")
def peers(synthesis):
    return sys.modules["peers"]


THREE = {"A": 1.0, "a": 16.0, "a1": 44.0, "a2": 6.4}
COMBINED = {
    "payload.acceleration_gain": 0.98162,
    "payload.velocity_gain": 1.6166,
    "payload.position_gain": 2.8879,
    "drum.position_gain": 0.65588,
    "heave.gain": 0.93224,
    "rolloff.corner": 20.741,
    "rolloff.damping": 1.0217,
    "heave.lead": 0.028445,
    "heave.bandwidth": 7.3838,
}
GAINS = {"payload-feedback": THREE, "combined": COMBINED}


def plain(synthesis):
    return load_case(synthesis.CASE).replace(synthesis.PLAIN)


@pytest.fixture(scope="module")
def lines(synthesis, peers):
    return {name: peers.SampledLine(synthesis.pose(plain(synthesis), name)) for name in GAINS}


@pytest.mark.parametrize("structure", GAINS)
def test_a_sampled_loop_is_the_verified_one(structure, lines, synthesis):
    line = lines[structure]
    design = evaluate_gains(plain(synthesis), GAINS[structure], structure)
    found = line.measure(np.array([line.question.values(GAINS[structure])]))
    assert found.stable[0]
    assert design.verification is not None
    on_the_rope = {check.name: check.found for check in design.verification.checks}
    assert np.exp(found.log_rms[0]) == pytest.approx(on_the_rope["payload_rms.rope"], rel=1e-4)
    for limit, excess in zip(line.question.limits, found.excess[:, 0], strict=True):
        value = design.limits[limit.name].value
        if limit.name != "gain_margin_down" or value > 0.0:
            use = limit.use(value)
            assert np.exp(excess) == pytest.approx(use, rel=1e-2 if use < 0.9 else 3e-3)


@pytest.mark.parametrize("structure", GAINS)
def test_stability_on_the_exact_rope_is_that_of_many_masses(structure, lines):
    line = lines[structure]
    middle = np.array(line.question.values(GAINS[structure]))
    draws = np.random.default_rng(3).uniform(-1.0, 1.0, (60, middle.size))
    values = middle * 6.0**draws
    values[::4, 0] *= -1.0
    values[1::4, 2] *= -1.0
    found = line.measure(values)
    problem = line.question.problem
    # On the masses with the drag of the drum held: where that is clearly right or wrong.
    growth = np.array([problem.growth(row) for row in values])
    clear = np.abs(growth) > 0.02
    assert np.count_nonzero(clear & (growth > 0.0)) > 5
    assert np.count_nonzero(clear & (growth < 0.0)) > 5
    assert np.mean(found.stable[clear] == (growth < 0.0)[clear]) > 0.95


def test_one_loop_is_that_of_a_generation(lines):
    line = lines["combined"]
    values = np.array(line.question.values(COMBINED))
    many = values * np.linspace(0.9, 1.1, 100)[:, None]
    together = line.measure(many).objective
    alone = [float(line.measure(row[None]).objective[0]) for row in many[::30]]
    assert together[::30] == pytest.approx(alone, rel=1e-9)


def test_python_control_makes_the_same_loop(lines, peers):
    line = lines["payload-feedback"]
    values = np.array(line.question.values(THREE))
    log_rms, rows = peers.ControlLoops(line.question).measure(values)
    found = line.measure(values[None])
    assert log_rms == pytest.approx(found.log_rms[0], abs=5e-4)  # on seven masses
    limits = line.question.limits
    kept = dict(zip([limit.name for limit in limits[1:]], rows[1 - len(limits) :], strict=True))
    for limit, excess in zip(limits[1:], found.excess[1:, 0], strict=True):
        if np.exp(excess) > 1e-6:
            assert kept[limit.name] == pytest.approx(-excess, abs=0.02), limit.name
    assert rows[0] > 0.0  # stable
    assert -rows[1 : 1 - len(limits)].min() == pytest.approx(found.excess[0, 0], abs=0.02)


@pytest.mark.ci
def test_a_small_run_ends_in_rows_and_tables(synthesis, tmp_path):
    (tmp_path / "data").mkdir()
    rows = synthesis.run(synthesis.QUICK, tmp_path)
    assert {row.by for row in rows} >= {"ours", "evolution", "SLSQP"}
    assert all(row.seconds > 0.0 for row in rows)
    ours = rows[0]
    assert ours.excess < 1e-3
    assert ours.rms == pytest.approx(0.5526, rel=1e-3)
    stored = sys.modules["stored"].read_rows(tmp_path / "data" / "synthesis.csv")
    again = [synthesis.Row.of(cells) for cells in stored]
    assert [row.cells() for row in again] == [row.cells() for row in rows]
    assert synthesis.tables(again).count("| payload-feedback |") == 2


def test_a_result_that_is_worse_is_told(synthesis):
    ours = synthesis.Row(
        question="q",
        by="ours",
        seed=0,
        seconds=2.0,
        loops=0,
        rms=1.0,
        excess=0.0,
        starts=8,
        parameters=(1.0,),
    )

    def verdict(best, **hand):
        seeds = [
            replace(ours, by="evolution", seed=k, seconds=30.0, rms=best + 0.1 * k)
            for k in range(3)
        ]
        slsqp = [replace(ours, by="SLSQP", seconds=50.0, **hand)] if hand else []
        return synthesis.Verdict.of("q", [ours, *seeds, *slsqp])

    assert verdict(1.0).worse == 0.0
    assert verdict(0.99).worse > synthesis.WORSE
    assert verdict(1.2).worse < 0.0
    assert verdict(1.0, rms=0.9).worse > synthesis.WORSE
    assert verdict(1.0, rms=0.9, excess=0.1).worse == 0.0  # it breaks a limit
    told = verdict(1.0, rms=1.0)
    assert (told.there, told.seeds, told.ten_seeds, told.all_starts) == (1, 3, 300.0, 400.0)


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


def test_the_docs_page_shows_the_stored_answers(synthesis):
    sys.path.insert(0, str(MADE))
    from stored import read_rows

    docs = FOLDER.parent / "docs"
    rows = [synthesis.Row.of(cells) for cells in read_rows(docs / "data" / "synthesis.csv")]
    assert synthesis.tables(rows) in (docs / "performance.md").read_text(encoding="utf-8")
