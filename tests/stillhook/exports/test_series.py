"""A run's winch as series of other programs: lengths, rates and signs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stillhook as sh
from models import load_case
from models.basics import InputError
from models.run import Run
from stillhook.exports.series import SERIES_KINDS, as_series, read_table, winch_motion


@pytest.fixture(scope="module")
def run() -> Run:
    return sh.simulate(load_case("subsea-crane"), "feed-forward", seeds=[0], duration=20.0)[0]


def changed(run: Run, **columns: np.ndarray) -> Run:
    values = run.values.copy()
    for name, column in columns.items():
        values[:, run.signals.index(name.replace("__", "."))] = column
    return replace(run, values=values)


@pytest.mark.parametrize("kind", SERIES_KINDS)
@pytest.mark.parametrize("step", [None, 0.05])
def test_each_kind_is_proved(run: Run, kind: str, step: float | None) -> None:
    made = as_series(run, kind, step=step)
    assert made.proved, made.proof
    assert made.kind == kind
    assert "Paying out is positive" in made.about
    assert "feed-forward" in made.about


def test_paying_out_is_the_haul_turned_and_the_rate_the_motor_s(run: Run) -> None:
    case = run.case
    table = read_table(str(as_series(run, "csv").files["winch.csv"]), ",")
    np.testing.assert_array_equal(table["time [s]"], run.time)
    np.testing.assert_allclose(table["payout [m]"], -run["drum.haul"], atol=1e-15)
    np.testing.assert_allclose(table["length [m]"], case.rope.length - run["drum.haul"], rtol=1e-15)
    rope_speed = run["motor.speed"] / case.winch.gearbox.ratio * case.drum_radius / case.rope.falls
    np.testing.assert_allclose(table["payout rate [m/s]"], -rope_speed, rtol=1e-12)
    np.testing.assert_allclose(table["heave of the hook [m]"], run["hook.heave"], atol=1e-15)
    np.testing.assert_allclose(
        table["heave rate of the hook [m/s]"], run["hook.heave_rate"], atol=1e-15
    )
    # A winch that follows pays out as the hook rises.
    assert np.corrcoef(table["payout [m]"], table["heave of the hook [m]"])[0, 1] > 0.9


def test_rate_is_the_derivative_of_the_length_at_any_time(run: Run) -> None:
    motion = winch_motion(run)
    time = np.random.default_rng(1).uniform(0.1, 19.9, 500)
    h = 1e-6
    difference = (motion.payout(time + h) - motion.payout(time - h)) / (2.0 * h)
    np.testing.assert_allclose(motion.payout_rate(time), difference, atol=1e-8)
    # And what a rate adds up to is the length, over any time.
    dense = np.linspace(2.0, 9.0, 70_001)
    way = np.trapezoid(motion.payout_rate(dense), dense)
    assert way == pytest.approx(float(np.diff(motion.length(np.array([2.0, 9.0])))[0]), abs=1e-8)
    assert motion.by_speed


def test_with_falls_the_drum_pays_out_as_many_times(run: Run) -> None:
    case = load_case("subsea-crane").replace({"rope.falls": 2, "rope.length": 700.0})
    falls = sh.simulate(case, "feed-forward", seeds=[0], duration=5.0)[0]
    made = as_series(falls, "csv")
    assert made.proved, made.proof
    table = read_table(str(made.files["winch.csv"]), ",")
    drum = falls["motor.speed"] / case.winch.gearbox.ratio * case.drum_radius
    np.testing.assert_allclose(2.0 * table["payout rate [m/s]"], -drum, rtol=1e-12)
    np.testing.assert_allclose(table["payout at the drum [m]"], 2.0 * table["payout [m]"])
    assert "of which there are 2" in made.about
    assert winch_motion(falls).by_speed


def test_tables_of_the_programs_hold_the_same(run: Run, tmp_path: Path) -> None:
    csv = read_table(str(as_series(run, "csv").files["winch.csv"]), ",")
    orcaflex = as_series(run, "orcaflex").files
    winch = read_table(str(orcaflex["orcaflex_winch.txt"]), "\t")
    assert list(winch) == ["Time", "Payout", "Payout rate", "Length"]
    np.testing.assert_array_equal(winch["Length"], csv["length [m]"])
    assert list(read_table(str(orcaflex["orcaflex_hook.txt"]), "\t")) == [
        "Time",
        "Heave",
        "Heave rate",
    ]
    files = as_series(run, "moordyn").files
    for name, text in files.items():
        (tmp_path / name).write_text(str(text))
    t, L, Ldot, delta = np.loadtxt(tmp_path / "moordyn_line.txt", unpack=True)
    np.testing.assert_array_equal(t, csv["time [s]"])
    np.testing.assert_array_equal(L, csv["length [m]"])
    np.testing.assert_array_equal(Ldot, csv["payout rate [m/s]"])
    np.testing.assert_allclose(L - delta, run.case.rope.length, rtol=1e-15)


def test_program_of_the_moordyn_readme_sets_length_and_rate(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = as_series(run, "moordyn")
    (tmp_path / "moordyn_line.txt").write_text(str(made.files["moordyn_line.txt"]))
    monkeypatch.chdir(tmp_path)

    class Told:
        """Stands for the package `moordyn`."""

        calls: list[tuple[str, float]] = []  # noqa: RUF012

        def SetLineUnstretchedLength(self, line: str, value: float) -> None:
            self.calls.append((line, value))

        def SetLineUnstretchedLengthVel(self, line: str, value: float) -> None:
            self.calls.append((line, value))

    program = made.about.split("```python\n")[1].split("```")[0].replace(", moordyn", "")
    names: dict[str, object] = {"moordyn": Told()}
    exec(compile(program, "readme", "exec"), names)
    names["set_length"]("a line", 7.123)  # type: ignore[operator]
    motion, at = winch_motion(run), np.array([7.123])
    (line, length), (_, rate) = Told.calls
    assert line == "a line"
    assert length == pytest.approx(float(motion.length(at)[0]), rel=1e-12)
    assert rate == pytest.approx(float(motion.payout_rate(at)[0]), rel=1e-6)


def test_steps_are_even_and_within_the_run(run: Run) -> None:
    table = read_table(str(as_series(run, "csv", step=0.3).files["winch.csv"]), ",")
    time = table["time [s]"]
    np.testing.assert_allclose(np.diff(time), 0.3)
    assert time[0] == run.time[0]
    assert run.time[-1] - 0.3 < time[-1] <= run.time[-1]


def test_another_length_may_be_given(run: Run) -> None:
    table = read_table(str(as_series(run, "csv", length=50.0).files["winch.csv"]), ",")
    np.testing.assert_allclose(table["length [m]"] + run["drum.haul"], 50.0)


def test_a_drum_of_another_layer_has_the_slopes_of_a_spline(run: Run) -> None:
    motion = winch_motion(changed(run, motor__speed=1.5 * run["motor.speed"]))
    assert not motion.by_speed
    time = np.linspace(1.0, 19.0, 400)
    np.testing.assert_allclose(
        motion.payout_rate(time), winch_motion(run).payout_rate(time), atol=5e-3
    )
    about = as_series(changed(run, motor__speed=1.5 * run["motor.speed"]), "csv").about
    assert "The drum has changed its layer in this run" in about


def test_what_cannot_be_written_is_refused(run: Run) -> None:
    with pytest.raises(InputError, match="kind"):
        as_series(run, "sesam")
    with pytest.raises(InputError, match="step"):
        as_series(run, "csv", step=20.0)
    with pytest.raises(InputError, match="length"):
        as_series(run, "csv", length=0.0)
    with pytest.raises(InputError, match=r"m are hauled in of a rope of 0\.01 m: say how long"):
        as_series(run, "csv", length=0.01)
    blind = changed(run, drum__haul=np.full(run.time.size, np.nan))
    with pytest.raises(InputError, match="has samples without numbers: it is completed"):
        as_series(blind, "csv")
    short = replace(run, time=run.time[:1], values=run.values[:1])
    with pytest.raises(InputError, match="must have two samples at least"):
        as_series(short, "csv")


def test_a_drum_that_stands_still_is_written(run: Run) -> None:
    still = np.zeros(run.time.size)
    made = as_series(changed(run, drum__haul=still, motor__speed=still), "csv")
    assert made.proved, made.proof
