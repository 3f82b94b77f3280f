"""The stored studies of structures, random starts and robust design: complete, told correctly."""

from __future__ import annotations

import importlib
import itertools
import sys
from pathlib import Path

import numpy as np
import pytest
from wiener import Wiener

from models.basics import one_thread
from models.hook import HookMotion
from models.operation import SpectrumMotion
from models.sensing import MruModel
from synth.loop import Assessment
from synth.question import pose
from synth.verify import LawMatrices, winding_of_plant
from synth.verify.recheck import closed_loop_marks

FOLDER = Path(__file__).parents[2] / "docs" / "make"
SVG = b"<?xml"


def _module(name):
    sys.path.insert(0, str(FOLDER))
    try:
        return importlib.import_module(name)
    finally:
        sys.path.remove(str(FOLDER))


MAIN = ("payload-feedback", "payload-feedback-rolloff", "drum-feedback", "combined", "feed-forward")

structures = _module("structures")
page = _module("structures_page")
starts = _module("random_starts")
figures = _module("robust_figures")
preview = _module("preview")


@pytest.fixture(scope="module")
def rows():
    return structures.read(structures.OUTPUT)


@pytest.fixture(scope="module")
def random_rows():
    return starts.read()


def test_every_question_is_answered_and_every_design_verified(rows):
    names = tuple(sorted({row.structure for row in rows.values()}))
    assert set(MAIN) <= set(names) <= set(structures.STRUCTURES)
    asked = structures.questions(names, page.ROPES)
    assert {row.key for row in asked} == set(rows)
    # In brackets in the table: deep down three gains keep no limits on quick telemetry.
    failed = {row.key for row in rows.values() if not row.ok}
    assert failed <= {("2000", "payload-feedback", "given", delay) for delay in (0.0, 0.025, 0.05)}
    for row in rows.values():
        if row.key in failed:
            continue
        assert row.checks > 10, row.key
        assert row.max_sensitivity <= 2.0 * (1.0 + 1e-4), row.key
        assert row.gain_margin_down <= 0.5 * (1.0 + 1e-4), row.key


def test_the_page_holds_the_table_of_the_data(rows):
    text = page.PAGE.read_text(encoding="utf-8")
    stored = text.split(page.BEGIN)[1].split(page.END)[0].strip()
    assert stored == page.table(rows)
    assert "not computed" not in stored


@pytest.mark.parametrize(
    ("outer", "inner"),
    [
        ("combined", "drum-feedback"),
        ("combined", "feed-forward"),
    ],
)
def test_a_structure_is_no_worse_than_what_it_contains(rows, outer, inner):
    compared = 0
    for row in rows.values():
        if row.structure != outer:
            continue
        link = "any" if inner in structures.HEARS_NO_PAYLOAD else row.link
        within = [
            other
            for other in rows.values()
            if (other.structure, other.rope, other.link) == (inner, row.rope, link)
            and (link == "any" or other.delay == row.delay)
        ]
        assert len(within) == 1
        assert row.payload_rms <= within[0].payload_rms * (1.0 + 2e-3), row.key
        compared += 1
    assert compared == 24


def test_the_issue_s_number_at_2000_m_and_50_ms(rows):
    row = rows["2000", "combined", "given", 0.05]
    assert row.payload_rms <= 2.5e-3
    assert np.hypot(row.from_sea, row.from_reference_unit) == pytest.approx(
        row.payload_rms, rel=1e-5
    )


@pytest.mark.parametrize(
    "key",
    [
        ("one spring", "drum-feedback", "given", 0.05),
        ("300", "combined", "given", 0.025),
    ],
)
def test_a_stored_design_does_what_its_row_says(rows, key):
    row = rows[key]
    posed = pose(structures.case_of(row), row.structure, row.masses)
    problem = posed.problem_with(posed.loop)
    controller = posed.law.controller([row.parameters[p.name] for p in posed.law.parameters])
    with one_thread():
        view = Assessment(
            problem.plant, controller, problem.disturbances, elements=problem.elements
        )
        assert view.sigma("payload.displacement") == pytest.approx(row.payload_rms, rel=1e-4)
        assert view.max_sensitivity == pytest.approx(row.max_sensitivity, rel=1e-4)
        law = LawMatrices.of(controller, view.plant)
        winding = winding_of_plant(view.plant, law, closed_loop_marks(view.plant, law))
    assert winding.stable


def test_rows_survive_being_written(rows, tmp_path):
    structures.write(tmp_path / "structures.csv", rows)
    assert structures.read(tmp_path / "structures.csv") == rows


def test_no_accepted_random_start_is_unstable(random_rows):
    names = [row.question for row in random_rows]
    assert {name: names.count(name) for name in set(names)} == dict.fromkeys(starts.QUESTIONS, 1000)
    accepted = [row for row in random_rows if row.accepted]
    assert len(accepted) > 0.8 * len(random_rows)
    assert all(row.unstable == 0 for row in random_rows)
    assert all(np.isfinite(row.cost) for row in accepted)


def test_random_starts_of_a_small_run_are_stable_and_end_in_a_figure():
    rows, total = starts.rows_of("thesis-1975", 6, seed=4)
    assert total >= len(rows) == 6
    assert [row.start for row in rows] == list(range(6))
    assert all(row.unstable == 0 for row in rows)
    assert "of 6 accepted, 0 of them unstable" in starts.summary(rows)
    assert starts.figure(rows).startswith(SVG)


def test_fronts_are_whole_and_fall():
    stored = figures.read("pareto.csv")
    for against in ("torque", "max_sensitivity", "delay_margin"):
        own = [row for row in stored if row["against"] == against]
        assert len(own) == 100
        rms = [float(row["payload_rms"]) for row in own]
        falling = against != "delay_margin"
        for one, other in itertools.pairwise(rms):
            assert (other <= one * (1.0 + 1e-4)) if falling else (one <= other * (1.0 + 1e-4))
        assert sum(row["knee"] == "yes" for row in own) == 1


def test_each_objective_is_best_at_its_own():
    stored = figures.read("robust.csv")
    worst = {}
    for row in stored:
        assert row["ok"] == "yes"
        name = row["objective"]
        worst[name] = max(worst.get(name, 0.0), float(row["payload_rms"]))
    assert worst["worst"] <= min(worst.values()) * (1.0 + 1e-3)


def test_no_design_is_below_its_bound():
    stored = figures.read("structure_bounds.csv")
    assert len(stored) >= 9
    for row in stored:
        design, same, every = (
            float(row[key])
            for key in ("on_the_bound_s_terms", "bound_same_sensors", "bound_all_sensors")
        )
        assert every <= same * (1.0 + 1e-3)
        assert same <= design


@pytest.mark.parametrize("make", ["pareto", "robust", "structure_bounds"])
def test_figures_draw_what_is_stored(make):
    assert getattr(figures, make)().startswith(SVG)


def test_the_figure_of_structures_draws(rows):
    assert page.figure(rows).startswith(SVG)


def test_a_longer_and_a_truer_preview_leaves_less_and_the_page_says_so():
    stored = preview.read_rows(preview.DOCS / "data" / "preview.csv")
    assert preview.table(stored) in (preview.DOCS / "mpc.md").read_text(encoding="utf-8")
    left = {(row["lead"], float(row["error"])): float(row["rms"]) for row in stored}
    for error in preview.ERRORS:
        by_lead = [left[str(lead), error] for lead in preview.LEADS]
        assert by_lead == sorted(by_lead, reverse=True)
    for lead in preview.LEADS:
        by_error = [left[str(lead), error] for error in preview.ERRORS]
        assert by_error == sorted(by_error)
        assert left["all", 0.0] < by_error[0] < by_error[-1] < left["0", 0.0]


def test_the_tables_of_other_seas_are_those_of_their_rows():
    seas = _module("other_seas")
    told = seas.PAGE.read_text(encoding="utf-8")
    rows = seas.read_rows(seas.PAGE.parent / "data" / "other_seas.csv")
    assert seas.page(told, rows) == told
    for sea in seas.SEAS:
        for span in range(len(seas.SPANS)):
            own = [seas.of(rows, sea, who, span) for who in ("bank", "hook", "feed-forward")]
            assert all(part.size == seas.SEEDS for part in own)
            # Worse than the load that hangs still, or than who knows nothing of what is to come?
            assert np.all(own[0] < np.minimum(own[1], 1.2 * own[2]))
    assert sum(row["part"] == "alarm" for row in rows) == seas.HOURS


def test_the_best_forecast_of_the_past_is_the_optimal_predictor():
    seas = _module("other_seas")
    best, hook = seas.BestOfPast(seas.winch(1.9)), HookMotion.from_case(seas.winch(1.9))
    exact = MruModel(None, best.sample_time, hook.displacement.rms, 0)
    leads = np.array([0.5, 1.0, 3.0, 8.0])
    at = np.round(leads / best.sample_time).astype(int)
    oracle = Wiener(hook, exact, past=80.0, floor=seas.EXACT)
    np.testing.assert_allclose(best.errors[:, at], oracle.errors(leads), rtol=2e-3)
    # And it errs by what it says.
    motion = SpectrumMotion(hook=hook).motion(900.0, best.sample_time, 3)
    best.foresee(motion)
    z, _, _ = motion.block(0, motion.rows)
    off = []
    for now in range(seas.PAST, motion.rows - at[-1], 40):
        best.update(np.nan, np.nan, False, now * best.sample_time)
        off.append(best.forecast().displacement[at] - z[now + at])
    np.testing.assert_allclose(np.std(off, axis=0), best.errors[0, at], rtol=0.15)
