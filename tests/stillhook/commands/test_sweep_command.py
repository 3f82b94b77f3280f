"""`stillhook sweep`: both domains at the command line, what is written, and what is refused."""

from __future__ import annotations

import json
import shlex

import numpy as np
import pytest

import stillhook as sh
from stillhook.cli import main
from stillhook.commands.study.sweep import parse_ranges
from stillhook.sweeps import SweepSummary, sweep, worst_cases

CALM = ["--set", "sea.significant_height=0.3"]
TIME = ["--mode", "time", "--duration", "10 s", "--jobs", "1"]


def run(*words):
    return main(["sweep", *(str(word) for word in words)])


def test_a_sweep_in_time_is_written_and_told(tmp_path, capsys):
    folder = tmp_path / "out"
    status = run(
        "thesis-1975", *CALM, *TIME, "--samples", 6, "--vary", "payload.mass=10 %", "--out", folder
    )
    out = capsys.readouterr().out
    assert status == 0
    assert "6 of 6 cases hold the payload: 100 % (95 % interval 54.07 to 100 %)" in out
    names = {path.name for path in folder.iterdir()}
    assert names >= {"result.nc", "journal.jsonl", "cases.csv", "cases.parquet", "spread.yaml"}
    assert names >= {"summary.json", "worst.yaml", "worst-5.yaml", "scatter.png", "scatter.svg"}
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["stable"]["count"] == 6
    assert summary["quantiles"]["payload_rms"]["unit"] == "m"
    # The worst case is a case file, and its command finds the same number again.
    command = next(line.strip() for line in out.splitlines() if "stillhook simulate" in line)
    assert main([*shlex.split(command)[1:], "--out", str(tmp_path / "again")]) == 0
    again = json.loads((tmp_path / "again" / "summary.json").read_text())
    text = json.dumps(again)
    rms = summary["quantiles"]["payload_rms"]["largest"]
    assert f"{rms:.10g}"[:8] in text


@pytest.mark.ci
@pytest.mark.parametrize("resumed", [False, True])
def test_the_worst_case_of_a_structure_carries_its_own_parameters(resumed, tmp_path, capsys):
    folder = tmp_path / "out"
    gains = (
        "heave.gain=0.9,heave.lead=0.02,heave.bandwidth=9,drum.speed_gain=9,drum.position_gain=1"
    )
    run(
        "thesis-1975", *CALM, *TIME, "--samples", 4, "--vary", "payload.mass=10 %",
        "--set", "sensors.mru={noise_floor: 0, noise_fraction: 0}",
        "--structure", "feed-forward", "--gains", gains,
        "--vary", "gains.heave.gain=20 %", "--no-figures", "--out", folder,
    )  # fmt: skip
    if resumed:
        capsys.readouterr()
        main(["sweep", "--resume", str(folder), "--jobs", "1", "--no-figures"])
    out = capsys.readouterr().out
    command = next(line.strip() for line in out.splitlines() if "stillhook simulate" in line)
    assert main([*shlex.split(command)[1:], "--out", str(tmp_path / "again")]) == 0
    rms = json.loads((folder / "summary.json").read_text())["quantiles"]["payload_rms"]
    assert f"{rms['largest']:.10g}"[:8] in (tmp_path / "again" / "summary.json").read_text()


def test_a_sweep_in_the_frequency_domain_is_written_and_told(tmp_path, capsys):
    folder = tmp_path / "out"
    assert run("thesis-1975", "--samples", 64, "--seed", 1, "--no-figures", "--out", folder) in (
        0,
        1,
    )
    out = capsys.readouterr().out
    assert "of 64 cases are stable" in out
    assert "--mode time" in out
    names = {path.name for path in folder.iterdir()}
    assert {"result.nc", "cases.csv", "worst.yaml", "spread.yaml", "summary.json"} <= names
    worst = sh.load_case(folder / "worst.yaml")
    assert worst.payload.mass != sh.load_case("thesis-1975").payload.mass


def test_the_command_and_the_library_agree(tmp_path):
    folder = tmp_path / "out"
    words = [*CALM, *TIME, "--samples", 4, "--vary", "delay=0 ms..20 ms", "--quiet", "--no-figures"]
    run("thesis-1975", *words, "--out", folder)
    import pandas as pd

    table = pd.read_csv(folder / "cases.csv", float_precision="round_trip")
    case = sh.load_case("thesis-1975").replace({"sea.significant_height": 0.3})
    design = sh.evaluate_gains(case, {n: getattr(case.gains, n) for n in ("A", "a", "a1", "a2")})
    found = sweep(
        design,
        {"delay": parse_ranges(["delay=0 ms..20 ms"])["delay"]},
        samples=4,
        mode="time",
        duration=10.0,
        jobs=1,
    )
    assert np.array_equal(table["payload_rms"], found["payload_rms"])
    assert np.array_equal(table["sensors.telemetry.delay"], found["sensors.telemetry.delay"])


@pytest.mark.ci
def test_a_case_that_does_not_hold_is_told_by_the_exit_status(tmp_path, capsys):
    words = ["--samples", 2, "--vary", "sea.significant_height=2.4..2.5", "--no-figures"]
    status = run("thesis-1975", "--mode", "time", "--duration", "1 min", *words, "--out", tmp_path)
    assert status == 1
    assert "2 cases ended in a limit cycle" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "say which case, or --resume"),
        (["thesis-1975", "--resume", "x"], "give no CASE"),
        (["thesis-1975", "--controller", "mpc"], "--controller goes with --mode time"),
        (["thesis-1975", "--faults", "outages"], "--faults: only with --mode time"),
        (["thesis-1975", "--jobs", "2", "--follow"], "--follow, --jobs: only with --mode time"),
        (["thesis-1975", *TIME, "--faults", "hail"], "hail"),
        (["thesis-1975", *TIME, "--vary", "payload.mass"], "--vary: must be PATH=WIDTH"),
        (["thesis-1975", *TIME, "--vary", "a=1", "--vary", "a=2"], "a is given twice"),
        (["thesis-1975", *TIME, "--vary", "payload.mas=1 %"], "payload.mas is unknown"),
        (["thesis-1975", *TIME, "--samples", "0"], "samples must be in"),
        (["thesis-1975", *TIME, "--option", "x"], "--option: must be KEY=VALUE"),
        (["thesis-1975", *TIME, "--scenario", "dance"], "there is no 'dance'"),
        (["thesis-1975", *TIME, "--cluster", "here"], "engine must be serial, processes, local:N"),
        (["thesis-1975", *TIME, "--faults", "delay-jumps"], "fault.at must be before the end"),
        (["thesis-1975", "--worst", "-1"], r"--worst must be in"),
        (["landing", "--set", "sensors.mru=null", "--structure", "feed-forward"], "hears mru"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(words, message, tmp_path, capsys):
    assert run(*words, "--out", tmp_path / "out") == 2
    error = capsys.readouterr().err
    assert message in error
    assert "Traceback" not in error


def test_the_default_of_a_case_is_shown_by_the_help(capsys):
    with pytest.raises(SystemExit) as stop:
        run("--help")
    assert stop.value.code == 0
    out = capsys.readouterr().out
    assert "--resume DIR" in out
    assert "local:4" in out


def test_the_worst_cases_come_first_and_what_was_not_run_does_not_come():
    import xarray as xr

    result = xr.Dataset(
        {
            "status": ("case", np.array([0, 2, 0, -1, 1, 4], np.int8)),
            "stable": ("case", np.array([1, 0, 1, 0, 0, 0], np.int8)),
            "payload_rms": ("case", np.array([0.2, 3.0, 0.5, np.nan, np.nan, np.nan])),
        },
        coords={"case": np.arange(6)},
    )
    assert worst_cases(result, 6) == [4, 1, 2, 0]
    summary = SweepSummary.of(result)
    assert (summary.cases, summary.stable.count, summary.stable.total) == (5, 2, 5)
    assert summary.quantiles["payload_rms"][-1] == 0.5
    assert dict(summary.statuses) == {"not run": 1, "diverged": 1, "limit cycle": 1, "failed": 1}
    assert summary.sentences[1].startswith("1 case was not run, 1 case diverged, 1 case ended in")
