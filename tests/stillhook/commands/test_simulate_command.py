"""`stillhook simulate`: what it prints and writes, and how it ends, whatever it is given."""

from __future__ import annotations

import csv
import json
import os
import re
import resource
import shlex
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from designs import loopless_design, thesis_design

import stillhook as sh
from models.hook import HookMotion
from models.operation import scenario_names
from stillhook import cli
from stillhook.commands.given import parse_options
from stillhook.commands.run import simulate as command
from stillhook.commands.run.simulate_given import parse_controllers
from stillhook.commands.working import kept_in
from stillhook.controllers import CONTROLLER_TEXTS

CONTROLLERS = tuple(name for name in CONTROLLER_TEXTS if "mpc" not in name)
CALM = ("thesis-1975", "--set", "sea.significant_height=0.3")
SHORT = ("--duration", "40 s", "--no-figures")


def summary(folder: str = "here") -> dict:
    return json.loads((Path(folder) / "summary.json").read_text(encoding="utf-8"))


# one controller


def test_a_simulation_ends_well_and_fills_its_folder(run):
    ending = run("simulate", *CALM, "--seeds", "2", "--duration", "40 s", "--out", "here")
    assert not Path("here/runs").exists()
    words = ("--seeds", "2", "--duration", "40 s", "--out", "here", "--traces", "csv")
    ending = run("simulate", *CALM, *words)
    assert (ending.status, ending.err) == (0, "")
    figures = {f"{n}.{k}" for n in ("traces", "strip", "exceedance") for k in ("svg", "png")}
    words = {"case.yaml", "summary.json", "summary.md", "events.csv", "runs"}
    assert {*kept_in(Path("here"))} == words | figures
    assert [p.name for p in sorted(Path("here/runs").iterdir())] == ["seed-000.csv", "seed-001.csv"]
    assert sh.load_case("here/case.yaml").sea.significant_height == 0.3
    report = Path("here/summary.md").read_text(encoding="utf-8")
    assert report.startswith("# thesis-1975, feedback, hold\n\n2 runs of 40 s, all completed\n")
    for name in re.findall(r"!\[[^\]]+\]\(([^)]+)\)", report):
        assert (Path("here") / name).exists()


def test_the_table_fits_a_terminal_and_says_what_came_of_it(run):
    ending = run("simulate", *CALM, "--seeds", "2", *SHORT, "--traces", "csv")
    case = sh.load_case("thesis-1975").replace({"sea.significant_height": 0.3})
    hook = HookMotion.from_case(case).displacement
    table, _, after = ending.out.partition("\nWritten to out/thesis-1975-hold: ")
    assert max(map(len, table.splitlines())) <= 80
    assert "\x1b" not in ending.out
    for text in (
        "thesis-1975, feedback, hold: 2 runs of 40 s, all completed",
        "mean  95 % interval",
        "payload, rms",
        "of the hook's motion",
        "runs that lost lock",
        f"beyond {1e3 * hook.significant_height:.0f} mm",
        "rating 5.94 kN m",
        "limit 1200 rpm",
        "no extremes of the payload: they take 8 blocks of 20 min, these runs have 0",
        "step 5.00 ms, sample 5.00 ms",
    ):
        assert text in table, text
    assert after.startswith("summary.md, summary.json, events.csv, 2 time traces of ")


def test_the_rms_of_the_table_is_that_of_the_traces(run):
    words = ("--settle", "10 s", "--store-step", "5 ms", "--traces", "csv", "--out", "here")
    run("simulate", *CALM, *SHORT, *words)
    with open("here/runs/seed-000.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    payload = np.array([float(row["payload.displacement [m]"]) for row in rows])
    clock = np.array([float(row["time [s]"]) for row in rows])
    found = summary()["controllers"]["feedback"]["summary"]["payload rms"]
    assert found["mean"] == pytest.approx(payload[clock > 9.9999].std(), rel=1e-9)
    assert (found["unit"], found["runs"], found["low"]) == ("m", 1, None)


def test_the_summary_for_programs_keeps_question_and_answer(run):
    run("simulate", *CALM, *SHORT, "--seeds", "2", "--first-seed", "7", "--out", "here")
    content = summary()
    assert content["case"] == "thesis-1975"
    assert content["duration"] == 40.0
    assert content["question"]["seeds"] == [7, 8]
    assert set(content["versions"]) >= {"stillhook", "numpy", "casadi"}
    runs = content["controllers"]["feedback"]["runs"]
    assert [each["seed"] for each in runs] == [7, 8]
    assert {each["status"] for each in runs} == {"completed"}
    assert content["controllers"]["feedback"]["shares"]["lost lock"]["of"] == 2


def test_the_same_question_gives_the_same_numbers_and_another_seed_others(run):
    for folder, seed in (("a", "3"), ("b", "3"), ("c", "4")):
        run("simulate", *CALM, *SHORT, "--first-seed", seed, "--out", folder, "--traces", "none")
    a, b, c = (summary(f)["controllers"]["feedback"]["runs"][0]["quantities"] for f in "abc")
    assert a == b
    assert a["payload rms"] != c["payload rms"]


def test_without_a_compiler_the_numbers_are_the_same(run):
    for folder, how in (("a", ()), ("b", ("--no-compile",))):
        run("simulate", *CALM, "--duration", "10 s", "--no-figures", "--out", folder, *how)
    a, b = (summary(folder)["controllers"]["feedback"] for folder in "ab")
    assert b["compiled"] is False
    rms = [each["runs"][0]["quantities"]["payload rms"] for each in (a, b)]
    assert rms[0] == pytest.approx(rms[1], rel=1e-9)


def test_quiet_prints_one_line(run):
    ending = run("simulate", *CALM, *SHORT, "--quiet")
    assert ending.status == 0
    assert re.fullmatch(
        r"thesis-1975, feedback, hold: 1 run of 40 s, completed; payload [\d.]+ mm rms, "
        r"residual [\d.]+ % of the hook's motion\n",
        ending.out,
    )


@pytest.mark.parametrize(("name", "suffix"), [("parquet", "parquet"), ("netcdf", "nc")])
def test_traces_come_in_other_formats(name, suffix, run):
    run("simulate", *CALM, *SHORT, "--traces", name, "--store-step", "1 s", "--out", "here")
    path = Path(f"here/runs/seed-000.{suffix}")
    data = xr.load_dataset(path, engine="scipy") if name == "netcdf" else pd.read_parquet(path)
    assert data["payload.displacement"].shape == (41,)


def test_an_earlier_simulation_leaves_nothing_behind(run, monkeypatch):
    monkeypatch.setattr("stillhook.text.images.picture", lambda figure, kind, **_: b"a picture")
    words = ("--duration", "20 s", "--traces", "csv", "--out", "here")
    run("simulate", *CALM, *words, "--seeds", "3")
    Path("here/runs/mine.csv").write_text("mine")
    run("simulate", *CALM, *words, "--no-figures")
    assert sorted(p.name for p in Path("here/runs").iterdir()) == ["mine.csv", "seed-000.csv"]
    assert list(Path("here").glob("*.png")) == []


def test_gains_come_from_the_command_or_a_design(run):
    sh.save_design(thesis_design(), "design.yaml")
    gains = "A=200,a=50,a1=100,a2=100"
    found = []
    for words in (
        (),
        ("--gains", gains),
        ("--design", "design.yaml"),
        ("--gains", "a=0,a1=0,a2=1"),
    ):
        run("simulate", *CALM, *SHORT, "--traces", "none", "--out", "here", *words)
        quantities = summary()["controllers"]["feedback"]["runs"][0]["quantities"]
        found.append(quantities["payload rms"])
    assert found[0] == found[1] == found[2]  # the case's own are those of 1975
    assert found[3] > found[0]


def test_a_design_for_another_case_is_a_warning(run):
    sh.save_design(thesis_design(), "design.yaml")
    ending = run("simulate", *CALM, "--set", "name=mine", *SHORT, "--design", "design.yaml")
    assert ending.err == "warning: design.yaml: is a design for thesis-1975, not mine\n"


def test_a_case_without_gains_gets_the_best_design_first(run, monkeypatch):
    asked = []

    def found(case, structure, **rest):
        asked.append(structure)
        return thesis_design()

    monkeypatch.setattr("synth.optimise_gains", found)
    ending = run("simulate", *CALM, "--set", "gains=null", *SHORT, "--out", "here")
    assert ending.status == 0
    said = " ".join(ending.out.split())
    assert "design: payload-feedback, found for this case, NOT OK (stable; breaks" in said
    assert "give --design to use another" in said
    assert asked == [None]
    assert sh.load_design("here/design.yaml").gains == thesis_design().gains
    assert "--design here/design.yaml" in ending.out


def test_a_case_without_stabilising_gains_ends_with_1(run, monkeypatch):
    monkeypatch.setattr("synth.optimise_gains", lambda case, *named, **rest: loopless_design())
    ending = run("simulate", *CALM, "--set", "gains=null", *SHORT)
    assert (ending.status, ending.out) == (1, "")
    assert "no design for the feedback: no stabilising gains were found" in ending.err


# hook and scenarios


def test_a_sine_moves_the_hook(run):
    run("simulate", *CALM, *SHORT, "--sine", "0.5 m, 8 s", "--settle", "32 s", "--out", "here")
    quantities = summary()["controllers"]["feedback"]["runs"][0]["quantities"]
    # One whole period, in which the sine is at its full size.
    assert quantities["hook rms"] == pytest.approx(0.5 / np.sqrt(2.0), rel=2e-3)
    assert summary()["question"]["hook"] == "sine of 0.5 m and 8 s"


def test_a_record_moves_the_hook_for_as_long_as_it_lasts(run):
    clock = np.arange(0.0, 45.01, 0.1)
    rows = [f"{t:.1f},{30.0 * np.sin(0.7 * t):.6f}" for t in clock]
    Path("heave.csv").write_text("\n".join(["time [s],displacement [cm]", *rows]))
    ending = run("simulate", *CALM, "--no-figures", "--hook", "heave.csv", "--out", "here")
    assert ending.status == 0
    assert summary()["duration"] == pytest.approx(44.9)
    quantities = summary()["controllers"]["feedback"]["runs"][0]["quantities"]
    assert quantities["hook rms"] == pytest.approx(0.2, abs=0.03)
    too_long = run("simulate", *CALM, "--hook", "heave.csv", "--duration", "2 min")
    assert too_long.status == 2
    assert "a record is not repeated" in too_long.err


def test_six_motions_of_the_vessel_move_the_hook(run):
    clock = np.arange(0.0, 45.01, 0.1)
    rows = [f"{t:.1f},0,0,{np.degrees(0.01 * np.sin(0.7 * t)):.6f}" for t in clock]
    Path("ship.csv").write_text("\n".join(["time,heave,roll,pitch [deg]", *rows]))
    words = ("--hook", "ship.csv", "--tip=-30,0,20", "--out", "here")
    run(
        "simulate",
        *CALM,
        *SHORT,
        *words,
        "--settle",
        "35 s",
        "--store-step",
        "10 ms",
        "--traces",
        "csv",
    )
    with open("here/runs/seed-000.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    heave = np.array([float(row["hook.heave [m]"]) for row in rows])
    clock = np.array([float(row["time [s]"]) for row in rows])
    late = clock > 31.0  # the motion has grown out of rest
    # z_tip = heave - x pitch, with x = -30 m, less the mean of the record
    expected = 0.3 * np.sin(0.7 * clock[late])
    assert np.allclose(heave[late] - heave[late].mean(), expected - expected.mean(), atol=1e-4)


def test_a_landing_tells_its_error_and_its_speed(run):
    words = ("landing", "--scenario", "landing", "--controller", "feed-forward", "--no-figures")
    ending = run("simulate", *words, "--option", "height=3 m", "--option", "stop=2 m")
    assert ending.status == 0
    for text in ("error before touchdown", "touchdown speed", "runs with slack rope", "at 62 s: "):
        assert text in ending.out
    events = Path("out/landing-landing/events.csv").read_text().splitlines()
    assert events[0] == "controller,seed,time [s],kind,event"
    assert events[1].startswith("feed-forward,0,62.0,reference,lower by 1 m at ")


def test_the_end_of_the_stroke_is_told(run):
    ending = run("simulate", *CALM, "--set", "limits.stroke=[-0.01, 0.01]", *SHORT)
    assert ending.status == 0
    assert "runs ended by the brake" in ending.out
    assert re.search(r"at [\d.]+ s: haul of -?[\d.]+ m is at the end of the stroke", ending.out)


# several controllers


def test_all_controllers_meet_in_one_table(run):
    words = ("--controller", "all", "--seeds", "2", "--traces", "csv", "--out", "here")
    ending = run("simulate", *CALM, *SHORT, *words)
    assert ending.status == 0
    table = ending.out.partition("\nWritten to")[0]
    assert max(map(len, table.splitlines())) <= 80
    controllers = summary()["controllers"]
    assert list(controllers) == [name for name in CONTROLLERS if name != "feedback-no-antiwindup"]
    assert "left out: feedback-no-antiwindup: static gains have no state" in table
    assert re.search(r"residual, drum .*\n +held \[%\]", table)  # labels give way, figures do not
    assert all((Path("here") / name / "runs" / "seed-001.csv").exists() for name in controllers)
    row = next(line for line in table.splitlines() if "payload, rms" in line)
    unit = {"m": 1.0, "mm": 1e-3}[re.search(r"\[(m+)\]", row)[1]]
    shown = [float(text) * unit for text in row.split("]")[1].split()]
    means = [each["summary"]["payload rms"]["mean"] for each in controllers.values()]
    assert shown == pytest.approx(means, rel=6e-3)  # to three digits


def test_controllers_are_compared_in_figures_and_folders(run, monkeypatch):
    monkeypatch.setattr("stillhook.text.images.picture", lambda figure, kind, **_: b"a picture")
    words = ("--controller", "feed-forward,none", "--duration", "20 s", "--out", "here")
    ending = run("simulate", *CALM, *words)
    assert ending.status == 0
    for path in ("comparison.png", "exceedance.svg", "none/traces.svg", "feed-forward/strip.png"):
        assert (Path("here") / path).exists()
    report = Path("here/summary.md").read_text(encoding="utf-8")
    for name in re.findall(r"!\[[^\]]+\]\(([^)]+)\)", report):
        assert (Path("here") / name).exists()


# how it ends


def diverging(monkeypatch, seed: int) -> None:
    from models.simulation import run_simulation

    def stub(simulation, **rest):
        run = run_simulation(simulation, **rest)
        if run.seed != seed:
            return run
        return replace(run, status="diverged", message="the simulation diverged at 12 s")

    monkeypatch.setattr("stillhook.runs.simulation.run_simulation", stub)


def test_a_run_that_diverges_ends_with_1(run, monkeypatch):
    diverging(monkeypatch, seed=1)
    ending = run("simulate", *CALM, *SHORT, "--seeds", "3", "--out", "here")
    assert ending.status == 1
    assert "3 runs of 40 s, 2 completed, 1 diverged" in ending.out
    runs = summary()["controllers"]["feedback"]["runs"]
    assert [each["status"] for each in runs] == ["completed", "diverged", "completed"]
    assert summary()["controllers"]["feedback"]["completed"] is False


WRONG = {
    "no such scenario": (
        "thesis-1975 --scenario holding",
        r"scenario: there is no 'holding'; did you mean 'hold'\?",
    ),
    "no such option": (
        "thesis-1975 --scenario landing --option hight=5",
        r"scenario landing: there is no option 'hight'; there are: height, .*",
    ),
    "option of another kind": (
        "thesis-1975 --scenario landing --option 'height=5 kg'",
        r"scenario landing: height must be a length in .*, got '5 kg', which is a mass",
    ),
    "option without value": (
        "thesis-1975 --option height",
        r"--option: must be KEY=VALUE, as in 'height=6 m', got 'height'",
    ),
    "option twice": (
        "thesis-1975 --scenario landing --option height=5 --option height=6",
        "--option: height is given twice",
    ),
    "no such controller": (
        "thesis-1975 --controller feedbak",
        r"--controller: there is no controller 'feedbak'; there are: feedback, .*",
    ),
    "a controller twice": (
        "thesis-1975 --controller none,none",
        "--controller: each may be named once, got 'none,none'",
    ),
    "a step too coarse": (
        "thesis-1975-rope --step 0.05 --sample-time 0.05",
        r"integration: step must be at most 0\.0\d+ s, which the plant's fastest mode, at "
        r"[\d.]+ rad/s, allows, got 0\.05",
    ),
    "no file": ("thesis-1975 --hook none.csv", "none.csv: no such file"),
    "a bad file": (
        "thesis-1975 --hook bad.csv",
        "bad.csv:3: displacement must be a finite number, got 'x'",
    ),
    "half a sine": (
        "thesis-1975 --sine '0.5 m'",
        "simulate: --sine: must be AMPLITUDE,PERIOD, as in '0.5 m, 8 s', got '0.5 m'",
    ),
    "a sine of another kind": (
        "thesis-1975 --sine '0.5 m, 8 kg'",
        r"simulate: --sine: period must be a time in .*, got '8 kg', which is a mass",
    ),
    "a tip without motions": (
        "thesis-1975 --tip 1,2,3",
        "--tip: belongs to --hook, a file with heave, roll and pitch",
    ),
    "a flat tip": (
        "thesis-1975 --hook bad.csv --tip 1,2",
        "simulate: --tip must be 3 numbers with commas between, got '1,2'",
    ),
    "no seeds": ("thesis-1975 --seeds 0", r"simulate: --seeds must be in \[1, 10000\], got 0"),
    "no hours": ("thesis-1975 --hours -1", r"simulate: --hours must be in \(0, 10000\], got '-1'"),
    "duration of another kind": (
        "thesis-1975 --duration '3 m'",
        r"simulate: --duration must be a time in .*, got '3 m', which is a length",
    ),
    "too many masses": (
        "thesis-1975 --masses 100",
        r"plant: masses must be in \[1, \d+\], got 100",
    ),
    "no design": ("thesis-1975 --design none.yaml", "none.yaml: no such design file"),
    "half the gains": (
        "thesis-1975 --gains a=1",
        "--gains: a1 and a2 must be given too, got 'a=1'",
    ),
    "settled after the end": (
        "thesis-1975 --settle '1 h' --duration '1 min'",
        r"simulation: settle must be in \[0, 60\] s, got 3600.0",
    ),
    "no state to wind up": (
        "thesis-1975 --controller feedback-no-antiwindup",
        "feedback-no-antiwindup: static gains have no state that could wind up, .*",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_bad_input_ends_with_2_one_sentence_and_no_folder(name, run):
    words, message = WRONG[name]
    Path("bad.csv").write_text("time,displacement\n0,1\n1,x\n")
    ending = run("simulate", *shlex.split(words))
    assert (ending.status, ending.out) == (2, "")
    assert re.fullmatch(message + "\n", ending.err)
    assert [path.name for path in Path().iterdir()] == ["bad.csv"]


@pytest.mark.parametrize(
    "words",
    ["--hours 1 --duration '1 h'", "--gains a=1 --design x", "--sine 1,8 --hook x", "--traces xls"],
)
def test_words_that_the_parser_refuses_end_with_2(words, run):
    ending = run("simulate", "thesis-1975", *shlex.split(words))
    assert (ending.status, ending.out) == (2, "")
    assert ending.err.startswith("usage: stillhook simulate")


@contextmanager
def small_disk(largest: int):
    """Let no file grow beyond so many bytes: what a full disk does to the one that fills it."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (largest, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("format", ["csv", "parquet", "netcdf"])
def test_a_full_disk_is_one_sentence_and_leaves_no_half_of_a_file(format, run):
    with small_disk(200_000):
        ending = run("simulate", *CALM, *SHORT, "--out", "here", "--traces", format)
    suffix = {"netcdf": "nc"}.get(format, format)
    assert (ending.status, ending.out) == (2, "")
    assert ending.err == f"here/runs/seed-000.{suffix}: cannot be written: File too large\n"
    assert [path for path in Path("here").rglob("[!.]*") if path.is_file()] == []


def stopping(monkeypatch, after: int) -> None:
    """Ask to stop when the computation has asked so often whether it should."""

    @contextmanager
    def stub():
        asked = 0

        def stop() -> bool:
            nonlocal asked
            asked += 1
            return asked > after

        yield stop

    monkeypatch.setattr(command, "stoppable", stub)


def test_an_interrupt_between_two_runs_keeps_the_first(run, monkeypatch):
    # Asked before each run and once or more in it.
    stopping(monkeypatch, after=3)
    words = ("--seeds", "50", "--traces", "csv", "--out", "here")
    ending = run("simulate", *CALM, *SHORT, *words)
    assert ending.status == 130
    runs = summary()["controllers"]["feedback"]["runs"]
    done = [each for each in runs if each["status"] == "completed"]
    assert 1 <= len(done) < 50
    assert ending.err == (
        f"stillhook: interrupted; {len(done)} of 50 runs went to the end; all there is was "
        "written to here\n"
    )
    assert "payload, rms" in ending.out
    assert len(list(Path("here/runs").iterdir())) == len(runs)


def test_an_interrupt_within_a_run_keeps_what_was_simulated_of_it(run, monkeypatch):
    stopping(monkeypatch, after=2)
    words = ("--duration", "1000 s", "--no-figures", "--settle", "10 s", "--out", "here")
    ending = run("simulate", *CALM, *words, "--store-step", "1 s", "--traces", "csv")
    assert ending.status == 130
    (only,) = summary()["controllers"]["feedback"]["runs"]
    assert only["status"] == "interrupted"
    reached = float(re.fullmatch(r"interrupted at ([\d.]+) s", only["message"])[1])
    assert 0.0 < reached < 1000.0
    rows = Path("here/runs/seed-000.csv").read_text().splitlines()
    assert len(rows) - 1 == pytest.approx(reached, abs=1.0)
    assert "0 of 1 run went to the end" in ending.err


def test_an_interrupt_before_anything_was_simulated_says_so(run, monkeypatch):
    stopping(monkeypatch, after=0)
    ending = run("simulate", *CALM, *SHORT, "--out", "here")
    assert (ending.status, ending.out) == (130, "")
    assert ending.err == "stillhook: interrupted; nothing was simulated; kept in here: nothing\n"


def test_an_interrupt_while_the_gains_are_sought_says_what_is_kept(run, monkeypatch):
    def interrupted(case, structure, *, progress):
        progress("starts", 3, 16)
        raise AssertionError("the search went on")

    stopping(monkeypatch, after=0)
    monkeypatch.setattr("synth.optimise_gains", interrupted)
    ending = run("simulate", *CALM, "--set", "gains=null", *SHORT, "--out", "here")
    assert (ending.status, ending.out) == (130, "")
    assert ending.err == "stillhook: interrupted; kept in here: nothing\n"


@pytest.mark.skipif(os.name != "posix", reason="signals as Unix has them")
def test_ctrl_c_stops_in_order(tmp_path):
    words = ["simulate", *CALM, "--hours", "1", "--seeds", "9000", "--no-figures"]
    words += ["--traces", "csv"]
    started = subprocess.Popen(
        [sys.executable, "-m", "stillhook", *words],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    second = tmp_path / "out" / "thesis-1975-hold" / "runs" / "seed-001.csv"
    patience = time.monotonic() + 60.0
    while not second.exists() and time.monotonic() < patience:
        time.sleep(0.05)
    started.send_signal(signal.SIGINT)
    out, err = started.communicate(timeout=60)
    assert started.returncode == 130
    assert "Traceback" not in err
    assert re.search(r"interrupted; \d+ of 9000 runs went to the end; all there is", err)
    assert "payload, rms" in out
    content = json.loads((second.parents[1] / "summary.json").read_text())
    files = {path.name for path in second.parent.iterdir()}
    seeds = [each["seed"] for each in content["controllers"]["feedback"]["runs"]]
    assert files == {f"seed-{seed:03d}.csv" for seed in seeds}


# what comes next, and lists


def test_commands_to_go_on_with_work(run):
    words = ("--seeds", "2", "--scenario", "lower", "--option", "distance=1 m", "--hours", "0.02")
    ending = run("simulate", *CALM, "--no-figures", "--out", "with space", *words)
    lines = ending.out.partition("\nNext:\n")[2].splitlines()
    found = [shlex.split(line)[1:] for line in lines if line.startswith("  stillhook ")]
    assert [each[0] for each in found] == ["simulate", "simulate", "scenarios"]
    parsed = [cli.build_parser().parse_args(each) for each in found]
    assert parsed[0].case == "with space/case.yaml"
    assert parsed[0].controller == "all"
    assert parsed[1].seeds == 10
    assert parsed[1].option == ["distance=1 m"]
    assert parsed[1].hours == 0.02
    again = run(*found[1], "--quiet", "--no-figures", "--traces", "none")
    assert again.status == 0
    assert "10 runs of 72 s" in again.out


def test_scenarios_lists_operations_and_controllers(run):
    ending = run("scenarios")
    assert ending.status == 0
    for name in (*scenario_names(), *CONTROLLER_TEXTS):
        assert re.search(rf"^  {name} +\S", ending.out, re.MULTILINE)
    assert max(map(len, ending.out.splitlines())) <= 80


@pytest.mark.parametrize("name", scenario_names())
def test_the_options_of_a_scenario_are_shown_with_an_example_that_works(name, run):
    ending = run("scenarios", name)
    assert ending.status == 0
    example = re.search(r"--option '(.+)'", ending.out)[1]
    case = sh.load_case("subsea-crane")
    from models.operation import scenario_named

    assert scenario_named(name, case, **parse_options([example])).name == name


def test_an_unknown_scenario_has_no_options(run):
    ending = run("scenarios", "landng")
    assert ending.status == 2
    assert "did you mean 'landing'?" in ending.err


def test_help_fits_a_terminal(run):
    for words in (["simulate", "--help"], ["scenarios", "--help"], ["--help"]):
        ending = run(*words)
        assert ending.status == 0
        assert max(map(len, ending.out.splitlines())) <= 80


def test_names_of_controllers_are_read():
    assert parse_controllers("all") == tuple(CONTROLLERS)
    assert parse_controllers("none, feedback") == ("none", "feedback")
