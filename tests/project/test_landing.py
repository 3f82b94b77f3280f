"""The stored landing study: complete, told correctly, and repeatable."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest

import stillhook as sh

sys.path.insert(0, str(Path(__file__).parents[2] / "docs" / "make"))
try:
    import landing
finally:
    sys.path.pop(0)

NAMES = (*landing.CONTROLLERS, *landing.LIMITS)


@pytest.fixture(scope="module")
def rows():
    return landing.load()


def test_complete(rows):
    expected = [(name, seed) for name in NAMES for seed in range(landing.SEEDS)]
    assert [(row["controller"], row["seed"]) for row in rows] == expected
    columns = "controller seed within rms largest touchdown_speed bounce slack_events snap_load"
    assert list(rows[0]) == [*columns.split(), "least_haul"]


def columns_of(table):
    return [cell.strip() for cell in table.splitlines()[0].strip("|").split("|")]


def test_columns_of_the_tables(rows):
    assert columns_of(landing.held_table(rows, landing.CONTROLLERS)) == [
        "controller",
        "time within 4 cm [%]",
        "rms [mm]",
        "largest [mm]",
        "never beyond 4 cm",
    ]
    landed = landing.landed_table(rows)
    assert columns_of(landed) == [
        "controller",
        "touchdown speed [mm/s]",
        "fastest [mm/s]",
        "off again [mm]",
        "slack events",
        "runs with a snap",
        "largest snap load [kN]",
    ]
    assert "| none |" not in landed  # a closed brake does not land


@pytest.mark.parametrize("name", NAMES)
def test_two_seeds_again(rows, name):
    stored = [row for row in rows if row["controller"] == name]
    for now in landing.rows_of(name, [0, 7]):
        (then,) = (row for row in stored if row["seed"] == now["seed"])
        for number in ("within", "rms", "largest", "touchdown_speed"):
            wanted = pytest.approx(then[number], rel=1e-3, abs=1e-3, nan_ok=True)
            assert now[number] == wanted, (number, now["seed"])


def test_numbers_of_a_run_by_hand():
    runs = landing.runs_of("feed-forward", [3])
    (run,) = runs
    found = landing.numbers(run, runs.scenario)
    down, touch = runs.scenario.profile.moves
    kept = landing.held(run, runs.scenario)
    assert run.time[kept][0] >= 12.0
    assert run.time[kept][-1] < touch.start
    assert not np.any(kept & (run.time >= down.start) & (run.time < down.end + 10.0))
    assert np.ptp(run["reference.displacement"][kept & (run.time > down.end)]) == 0.0
    error = run["payload.displacement"] - run["reference.displacement"]
    assert found["rms"] == pytest.approx(np.hypot(error[kept].mean(), error[kept].std()))
    assert found["within"] == pytest.approx(np.mean(np.abs(error[kept]) <= 0.04))
    first = int(np.argmax(run["contact.gap"] <= 0.0))
    assert found["touchdown_speed"] == pytest.approx(-run["payload.velocity"][first], rel=0.05)


def test_what_the_page_says(rows):
    def mm(name, number="rms"):
        return 1e3 * landing.mean(rows, name, number).mean

    # "None of them keeps within 4 cm", "the feedback comes closest".
    for name in landing.CONTROLLERS:
        assert max(landing.values(rows, name, "largest")) > landing.TOLERANCE
        assert mm("feedback") <= mm(name)
    # "With perfect sensors the module moves as much."
    assert mm("feedback, perfect sensors") == pytest.approx(mm("feedback"), rel=0.02)
    # Feed-forward: the share alone, the MRU alone, and without both.
    assert mm("feed-forward of 0.9, perfect MRU") == pytest.approx(36.0, abs=1.0)
    assert mm("feed-forward of 1") > 5.0 * mm("feed-forward of 1, perfect MRU")
    assert max(landing.values(rows, "feed-forward of 1 with lead, perfect MRU", "largest")) <= (
        landing.TOLERANCE
    )
    assert max(landing.values(rows, "feed-forward of 1, MRU of 1 cm", "largest")) > 0.04
    assert mm("feed-forward-lead") > mm("feed-forward")
    # "Constant tension does nothing."
    assert mm("constant-tension") == pytest.approx(mm("lowered without compensation"), rel=0.05)
    # Payload feedback pays out rope that nobody asked for.
    assert max(landing.values(rows, "feedback", "least_haul")) < -20.0
    assert min(landing.values(rows, "feed-forward", "least_haul")) > -10.5
    assert all(math.isnan(v) for v in landing.values(rows, "none", "touchdown_speed"))


def test_the_page_shows_these_rows(rows):
    assert landing.PAGE.read_text(encoding="utf-8") == landing.page(rows)
    assert landing.FIGURE.exists()


def test_asking_for_a_row_that_is_not_there(rows):
    with pytest.raises(KeyError, match="no row of 'autopilot'"):
        landing.mean(rows, "autopilot", "rms")


@pytest.mark.slow
def test_the_gains_are_the_optimum_and_the_margins_what_the_page_says():
    case = sh.load_case("landing").replace(landing.LAW)
    design = sh.optimise_gains(case, "payload-feedback")
    assert dict(design.gains) == pytest.approx(landing.GAINS, rel=2e-3)
    assert "max_sensitivity, gain_margin_down bind" in design.status
    stored = 1e3 * landing.mean(landing.load(), "feedback", "rms").mean
    assert 1e3 * design.payload_rms == pytest.approx(stored, rel=0.05)
    prompt = sh.evaluate_gains(case.replace({"sensors.telemetry.delay": 0.0}), landing.GAINS)
    assert prompt.margins.max_sensitivity == pytest.approx(5.1, abs=0.1)
