"""The stored landing study: complete, told correctly, and repeatable."""

from __future__ import annotations

import math

import landing
import landing_page
import numpy as np
import pytest
from stored import read_rows

import stillhook as sh

NAMES = (*landing.CONTROLLERS, *landing.LIMITS, *landing.PHASES)


@pytest.fixture(scope="module")
def rows():
    return landing.load()


@pytest.fixture(scope="module")
def designs():
    return read_rows(landing.DESIGNS)


def test_complete(rows, designs):
    expected = [(name, seed) for name in NAMES for seed in range(landing.seeds_of(name))]
    assert [(row["controller"], row["seed"]) for row in rows] == expected
    columns = "controller seed within rms largest minute_before touchdown_speed bounce lifted"
    assert list(rows[0]) == [
        *columns.split(),
        "touchdowns",
        "hardest",
        "slack_events",
        "snap_load",
        "end_haul",
    ]
    structures = "payload-feedback payload-feedback-rolloff drum-feedback feed-forward combined"
    assert [row["structure"] for row in designs] == structures.split()


def columns_of(table):
    return [cell.strip() for cell in table.splitlines()[0].strip("|").split("|")]


def test_columns_of_the_tables(rows, designs):
    assert columns_of(landing_page.held_table(rows, landing.CONTROLLERS)) == [
        "controller",
        "time within 4 cm [%]",
        "rms [mm]",
        "largest [mm]",
        "never beyond 4 cm",
    ]
    assert columns_of(landing_page.designs_table(rows, designs)) == [
        "structure",
        "ok",
        "by design, rms [mm]",
        "simulated, rms [mm]",
        "what binds",
    ]
    landed = landing_page.landed_table(rows, landing_page.landers(rows))
    assert columns_of(landed) == [
        "controller",
        "minute before, rms [mm]",
        "touchdown speed [mm/s]",
        "fastest [mm/s]",
        "touchdowns",
        "hardest [mm/s]",
        "off again [mm]",
        "slack events",
        "runs with a snap",
        "largest load after slack [kN]",
    ]
    assert "| none |" not in landed  # a closed brake does not land


@pytest.mark.parametrize(
    "name",
    # The weights of predictive control are tuned anew: half a minute.
    [pytest.param(name, marks=pytest.mark.ci) if "mpc" in name else name for name in NAMES],
)
def test_two_seeds_again(rows, name):
    stored = [row for row in rows if row["controller"] == name]
    # Tuned weights hang on the last digits, which other processors' kernels have others: what
    # those leave was 2 mm and 4 mm/s off.
    rel, near = (5e-2, 3e-3) if "mpc" in name else (1e-3, 1e-3)
    for now in landing.rows_of(name, [0, 7]):
        (then,) = (row for row in stored if row["seed"] == now["seed"])
        for number in ("within", "rms", "largest", "minute_before", "touchdown_speed"):
            wanted = pytest.approx(then[number], rel=rel, abs=near, nan_ok=True)
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


def test_a_module_is_lifted_on_the_brake_or_before():
    runs = sh.simulate(
        *landing.made("constant-tension"),
        scenario="landing",
        seeds=[1],
        options={"touchdown": "none"},
    )
    (run,) = runs
    found = landing.numbers(run, runs.scenario)
    landed = run.time > run.time[np.argmax(run["contact.gap"] <= 0.0)]
    before = run.time <= runs.scenario.disengage_at
    assert found["bounce"] == run["contact.gap"][landed & before].max() > 0.1
    assert found["lifted"] == run["contact.gap"][~before].max() > 0.1
    assert found["touchdowns"] > 1.0
    assert found["hardest"] >= found["touchdown_speed"]
    assert found["end_haul"] == run["drum.haul"][-1]


def rows_with(rows, controller, **changed):
    """Return the rows, other numbers in each of a controller's."""
    return [row | changed if row["controller"] == controller else row for row in rows]


def test_who_keeps_within_the_tolerance_is_read_from_the_rows(rows):
    assert landing_page.keepers(rows) == ["mpc", "nonlinear-mpc"]
    told = landing_page.verdict(rows)
    assert "**Within 4 cm all the time, in every run: `mpc`, `nonlinear-mpc`.**" in told
    worse = rows_with(rows_with(rows, "mpc", largest=0.041), "nonlinear-mpc", largest=0.041)
    assert landing_page.keepers(worse) == []
    assert "**None of them keeps within 4 cm** all the time." in landing_page.verdict(worse)
    still = rows_with(rows, "none", rms=1e-3, largest=2e-3)
    told = landing_page.verdict(still)
    assert "in every run: `mpc`, `nonlinear-mpc`, `none`.**" in told
    assert "`none` is the stillest with 1.0 mm rms and at most 2 mm. Next is `mpc` with" in told


def test_snaps_are_counted_above_the_load_at_rest(rows):
    static = sh.load_case("landing").static_tension
    assert landing_page.snaps(rows_with(rows, "mpc", snap_load=static + 1.0), "mpc") == 20
    assert landing_page.snaps(rows_with(rows, "mpc", snap_load=static - 1.0), "mpc") == 0
    assert landing_page.snaps(rows_with(rows, "mpc", snap_load=math.nan), "mpc") == 0


def test_what_the_page_says(rows, designs):
    def mm(name):
        return 1e3 * landing.mean(rows, name, "rms").mean

    # Who is still, in this order: predictive, both together, feedback, feed-forward.
    assert landing_page.by_stillness(rows)[:2] == ["mpc", "nonlinear-mpc"]
    assert landing_page.by_stillness(rows)[2] == "combined"
    assert mm("combined") < 0.5 * mm("drum-feedback")
    assert mm("mpc-ar") > mm("feed-forward")  # less than three minutes to learn the sea
    # "sh.optimise_gains answers with"; the others are ok too, though one does next to nothing.
    assert designs[-1]["structure"] == "combined"
    assert all(row["ok"] == "yes" for row in designs)
    assert mm("payload-feedback") > 0.9 * mm("lowered without compensation")
    # What a design promises is simulated: 20 runs of 100 s are within 3 %.
    for row in designs:
        name = row["structure"].replace("feed-forward", "feed-forward, designed")
        assert mm(name) == pytest.approx(1e3 * float(row["payload_rms"]), rel=0.03)
    # "Payload feedback is limited by its own loop": better sensors do not help.
    perfect = "payload-feedback-rolloff, perfect payload sensors"
    assert mm(perfect) == pytest.approx(mm("payload-feedback-rolloff"), rel=0.02)
    assert mm("combined, perfect MRU") < mm("combined, perfect payload sensors") < mm("combined")
    # Feed-forward: the share alone, the MRU alone, and without both.
    assert mm("feed-forward of 0.9, perfect MRU") == pytest.approx(36.0, abs=1.0)
    assert mm("feed-forward of 1") > 5.0 * mm("feed-forward of 1, perfect MRU")
    assert mm("feed-forward of 1, MRU that drifts by 5 cm") < 0.8 * mm("feed-forward of 1")
    with_lead = "feed-forward of 1 with lead, perfect MRU"
    assert landing_page.inside(rows, with_lead) == "20 of 20"
    assert landing_page.inside(rows, "feed-forward of 1, MRU of 1 cm") != "20 of 20"
    assert mm("feed-forward-lead") > mm("feed-forward")
    # "Constant tension does nothing."
    assert mm("constant-tension") == pytest.approx(mm("lowered without compensation"), rel=0.05)
    # The touch-down phase: what was before, and that it stops.
    without = landing.values(rows, "mpc, touchdown none", "lifted")
    assert np.median(without) > 0.3
    assert landing.mean(rows, "mpc, touchdown none", "slack_events").mean > 1.0
    assert landing_page.snaps(rows, "mpc, touchdown none") > 10  # of 20
    assert max(landing.values(rows, "mpc, touchdown none", "hardest")) > 1.0
    for name in landing_page.landers(rows):
        assert landing_page.snaps(rows, name) == 0, name
    for name in landing.PHASES:
        if name.endswith("tension"):
            assert landing_page.snaps(rows, name) == 0, name
    # It begins after the first touchdown, which is as it was.
    for name in ("mpc", "combined", "feed-forward"):
        for number in ("within", "rms", "minute_before", "touchdown_speed"):
            before = landing.values(rows, f"{name}, touchdown none", number)
            assert landing.values(rows, name, number) == pytest.approx(before, rel=1e-5)
    assert max(landing.values(rows, "mpc", "touchdown_speed")) < 0.2
    assert all(math.isnan(v) for v in landing.values(rows, "none", "touchdown_speed"))


def test_the_page_shows_these_rows(rows, designs):
    told = landing_page.PAGE.read_text(encoding="utf-8")
    assert told == landing_page.page(rows, designs)
    assert landing_page.FIGURE.exists()


def test_asking_for_a_row_that_is_not_there(rows):
    with pytest.raises(KeyError, match="no row of 'autopilot'"):
        landing.mean(rows, "autopilot", "rms")


def test_stored_designs_are_ok_with_what_they_promise(designs):
    case = sh.load_case("landing")
    row = designs[-1]
    again = sh.evaluate_gains(case, landing.parameters_of(row), row["structure"])
    assert again.ok, again.status
    assert again.payload_rms == pytest.approx(float(row["payload_rms"]), rel=1e-5)


@pytest.mark.slow
def test_the_designs_are_the_optima(designs):
    for now, then in zip(landing.design_rows(sh.load_case("landing")), designs, strict=True):
        assert (now["structure"], now["ok"]) == (then["structure"], then["ok"])
        assert now["status"] == then["status"]
        assert float(now["payload_rms"]) == pytest.approx(float(then["payload_rms"]), rel=2e-3)
