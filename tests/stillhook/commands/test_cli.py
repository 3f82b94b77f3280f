"""The command line: what it prints, what it writes, and how it ends, whatever it is given."""

from __future__ import annotations

import json
import os
import re
import shlex
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from designs import infeasible_design, loopless_design, thesis_design, unstable_design
from endings import Ending

import stillhook as sh
from models import SolverError, load_case, template_text
from stillhook import cli
from stillhook.commands import gains_text, parse_gains
from stillhook.commands.working import kept_in
from stillhook.designs import design_report
from stillhook.text import console, progress, show, told_once
from stillhook.text.folder import LIST

THREE = ("--structure", "payload-feedback")
THESIS = "A=200,a=50,a1=100,a2=100"
CASE = load_case("thesis-1975").to_yaml()


@pytest.fixture
def handed_over(monkeypatch):
    """Let `optimise` and `evaluate` hand over a design that is made already."""

    def hand(design):
        monkeypatch.setattr("stillhook.text.images.picture", lambda figure, kind, **_: b"a picture")
        monkeypatch.setattr("synth.optimise_gains", lambda case, *structure, **rest: design)
        monkeypatch.setattr("synth.evaluate_gains", lambda case, gains, structure: design)

    return hand


@pytest.fixture(scope="module")
def optimised(tmp_path_factory):
    """One real run of `stillhook optimise`, in a process of its own."""
    folder = tmp_path_factory.mktemp("optimise")
    done = subprocess.run(
        [sys.executable, "-m", "stillhook", "optimise", "thesis-1975", *THREE],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    return folder / "out" / "thesis-1975", done


# optimise


def test_optimise_ends_well_and_fills_its_folder(optimised):
    folder, done = optimised
    assert (done.returncode, done.stderr) == (0, "")
    assert {Path(name).suffix for name in kept_in(folder)} == {".yaml", ".md", ".svg", ".png"}
    assert len(kept_in(folder)) == 11
    assert sh.load_design(folder / "design.yaml").ok
    assert sh.load_case(folder / "case.yaml") == load_case("thesis-1975")


def test_optimise_prints_a_summary_that_fits_a_terminal(optimised):
    _, done = optimised
    summary, _, after = done.stdout.partition("\nNext:\n")
    assert max(map(len, summary.splitlines())) <= 80
    assert "\x1b" not in done.stdout  # no colour in a pipe
    for text in (
        "ok: optimal within the limits",
        "payload, drum held",
        "5.99 m",
        "30.6 mm",
        "sensitivity peak M_s",
        "█",
        "price",
        "starts agree",
        "verified on",
    ):
        assert text in summary
    assert len(after.splitlines()) >= 6


def test_optimise_hands_on_members_objective_and_fixed_parameters(run, monkeypatch):
    asked = {}

    def made(case, structure, **settings):
        asked.update(settings)
        return infeasible_design()

    monkeypatch.setattr("synth.optimise_gains", made)
    family = ["--member", "rope.length=1500; payload.mass=40 t", "--member", "rope.length=1 km"]
    words = [*family, "--objective", "mean", "--fix", "a=50"]
    ending = run("optimise", "thesis-1975", *THREE, *words, "--no-bound")
    assert [case.rope.length for case in asked["members"]] == [1500.0, 1000.0]
    assert asked["members"][0].payload.mass == 40e3
    assert asked["objective"] == "mean"
    assert asked["fixed"] == {"a": 50.0}
    again = "--member 'rope.length=1500; payload.mass=40 t' --member 'rope.length=1 km'"
    assert f"{again} --objective mean --fix a=50" in re.sub(r"\s+", " ", ending.out)


def test_optimise_suggests_commands_that_work(optimised, run):
    folder, done = optimised
    lines = done.stdout.partition("\nNext:\n")[2].splitlines()
    commands = [line.strip() for line in lines if line.startswith("  stillhook ")]
    names = ["optimise", "evaluate", "operability", "sweep", "check"]
    assert [command.split()[1] for command in commands] == names
    for command in commands:
        words = shlex.split(command)[1:]
        cli.build_parser().parse_args(words)
    again = run(*shlex.split(commands[1])[1:])
    # The printed gains keep the limits that the search ended at.
    assert again.status == 0
    assert f"{sh.load_design(folder / 'design.yaml').payload_rms * 1e3:.1f} mm" in again.out
    looser = shlex.split(commands[0])
    assert looser[3:5] == ["--set", "limits.max_sensitivity=2.20"]


def test_quiet_prints_the_verdict_only(run, handed_over):
    handed_over(thesis_design())
    ending = run("optimise", "thesis-1975", *THREE, "--quiet")
    assert ending == Ending(status=1, out="thesis-1975: stable; breaks max_sensitivity\n", err="")
    assert Path("out/thesis-1975/design.yaml").exists()


def test_an_infeasible_case_leads_with_the_verdict_and_ends_with_1(run, handed_over):
    handed_over(infeasible_design())
    ending = run("optimise", "thesis-1975", *THREE, "--out", "here")
    assert ending.status == 1
    assert ending.out.splitlines()[2].startswith("NOT OK: not feasible at H_s 2.44 m")
    assert re.search(r"motor torque, peak +11\.9 kN m +13\.0 kN m", ending.out)
    assert "All figures below are those in H_s 0.5 m" in ending.out
    assert "stillhook optimise thesis-1975 --set sea.significant_height=0.500" in ending.out
    assert "stillhook optimise thesis-1975 --set winch.drive.torque_peak=13100" in ending.out


def test_a_changed_case_is_kept_and_used_in_the_next_commands(run, handed_over):
    handed_over(thesis_design())
    ending = run(
        "optimise", "thesis-1975", *THREE, "--set", "rope.length=1900 m", "--out", "with space"
    )
    assert sh.load_case("with space/case.yaml").rope.length == 2000.0  # the design's own case
    assert "stillhook check 'with space/case.yaml'" in ending.out


def test_no_stabilising_gains_end_with_1(run):
    bounds = [f"--set=gain_bounds.{name}=[-2, -1]" for name in ("a", "a1", "a2")]
    ending = run("optimise", "thesis-1975", *THREE, "--set=gains=null", *bounds, "--starts", "2")
    assert ending.status == 1
    assert "NOT OK: no stabilising gains were found" in ending.out
    assert ending.err == ""


@pytest.mark.slow
def test_the_thesis_winch_on_a_rope_is_not_feasible(run):
    ending = run("optimise", "thesis-1975-rope", *THREE, "--quiet")
    assert ending.status == 1
    assert "not feasible at H_s 2.44 m" in ending.out


@pytest.mark.slow
def test_readme_shows_the_real_demo(run):
    readme = (Path(__file__).parents[3] / "README.md").read_text(encoding="utf-8")
    shown = readme.partition("```text\n")[2].partition("```")[0]
    ending = run("optimise", "subsea-crane")
    assert ending.status == 0
    real = ending.out.partition("\nWritten to")[0]
    head, real = ([line.rstrip() for line in text.strip().splitlines()] for text in (shown, real))
    assert len(head) > 15
    assert head == real[: len(head)]


# evaluate


def test_evaluate_gives_the_figures_of_the_thesis(run, monkeypatch):
    monkeypatch.setattr("stillhook.text.images.picture", lambda figure, kind, **_: b"a picture")
    ending = run("evaluate", "thesis-1975", "--gains", THESIS, "--out", "here")
    assert ending.status == 1
    assert ending.err == ""
    for figure in ("11.7 mm", "5.99 m", "5.15", "11.3 deg", "25.7 ms", "x 0.0919", "257 %"):
        assert figure in ending.out
    assert "NOT OK: stable; breaks max_sensitivity" in ending.out
    assert max(map(len, ending.out.splitlines())) <= 80
    assert (Path("here") / "summary.md").exists()
    assert (
        run("evaluate", "thesis-1975").out.partition("Next")[0]
        == (
            ending.out.partition("Written")[0]  # the case's own gains, and no folder
        )
    )


def test_evaluate_ends_with_0_if_the_limits_are_kept(run):
    ending = run("evaluate", "thesis-1975", "--set", "limits.max_sensitivity=5.2", "--quiet")
    assert ending == Ending(status=0, out="thesis-1975: stable; keeps every limit\n", err="")


def test_evaluate_says_how_fast_an_unstable_loop_grows(run):
    ending = run("evaluate", "thesis-1975", "--gains", "A=-200,a=50,a1=100,a2=100")
    assert ending.status == 1
    assert "NOT OK: unstable: grows by a factor e every" in ending.out
    assert "no stable loop: the payload's motion has no standard deviation" in ending.out


def test_the_amplifier_may_be_left_out(run):
    whole = run("evaluate", "thesis-1975", "--gains", THESIS, "--quiet")
    assert run("evaluate", "thesis-1975", "--gains", "a=50,a1=100,a2=100", "--quiet") == whole


def test_printed_gains_are_read_back():
    gains = {"A": 200.0, "a": -0.012345678, "a1": 1e-9, "a2": 12345.678}
    assert parse_gains(gains_text(gains)) == pytest.approx(gains, rel=1e-7)


@pytest.mark.parametrize(
    "make", [thesis_design, unstable_design, loopless_design, infeasible_design]
)
@pytest.mark.parametrize("name", ["x", "a name of more than eighty characters, " * 2 + "and more"])
def test_no_summary_is_wider_than_80_columns(make, name, capsys):
    design = make()
    case = design.case.replace({"name": name, "description": "word " * 60})
    show(design_report(replace(design, case=case)), console())
    assert max(map(len, capsys.readouterr().out.splitlines())) <= 80


def test_names_are_not_read_as_markup(capsys):
    case = thesis_design().case.replace({"name": "[red]crane[/red] :warning:"})
    show(design_report(replace(thesis_design(), case=case)), console())
    assert capsys.readouterr().out.startswith("[red]crane[/red] :warning:: The 1975")


# check, cases, new, schema


def test_check_shows_what_follows_from_a_case(run):
    ending = run("check", "thesis-1975")
    assert (ending.status, ending.err) == (0, "")
    for text in (
        "80.0 kN/m",  # K = EA/L
        "89.9 t",  # M
        "6.66 s",  # 2 pi / sqrt(0.89)
        "85.0 % of the rating, 42.5 % of the peak",  # 5.05 of 5.94 and 11.88 kN m
        "594 mm",
        "2.38 m",
        "5.99 m",
        "no errors",
    ):
        assert text in ending.out
    assert max(map(len, ending.out.splitlines())) <= 80


def test_check_says_that_nothing_damps_a_load_in_words(run):
    ending = run("check", "thesis-1975", "--set", "payload.drag.coefficient=0")
    assert "nothing damps" in ending.out
    assert " inf " not in ending.out


def test_check_warns_once_about_each_thing(run):
    ending = run("check", "thesis-1975", "--set", "sea.significant_height=12")
    assert ending.status == 0
    assert ending.err == (
        "warning: thesis-1975: sea.significant_height: 12 m with a peak period of 8.5 s is steeper "
        "than breaking: steepness 2 pi H_s/(g T_p^2) is 0.106, seas stay below 0.065 "
        "(DNV-RP-C205)\n"
    )


def test_a_spectrum_outside_the_rao_is_a_warning_with_the_share_cut(run):
    cut = ["--set", "vessel.beyond=zero", "--set", "sea.significant_period=3.5 s"]
    ending = run("check", "thesis-1975", "--set", "sea.significant_height=0.5", *cut)
    assert ending.status == 0
    assert re.fullmatch(
        r"warning: vessel\.heave_rao: [\d.]+% of the hook's displacement variance lies outside the "
        r"table \(0\.34 to 1\.46 rad/s\): [\d.]+% above 1\.46 rad/s is cut\n",
        ending.err,
    )


def test_cases_lists_all(run):
    ending = run("cases")
    assert ending.status == 0
    for name, _ in sh.bundled_cases():
        assert f"  {name} " in ending.out


def test_new_writes_a_case_that_runs_and_never_overwrites(run):
    ending = run("new", "my case.yaml")
    assert ending.status == 0
    assert Path("my case.yaml").read_text(encoding="utf-8") == template_text()
    assert "stillhook check 'my case.yaml'" in ending.out
    assert run("check", "my case.yaml").status == 0
    Path("my case.yaml").write_text("mine")
    long = run("new", "a" * 300)
    assert (long.status, long.out) == (2, "")
    assert long.err.endswith(": cannot be written: File name too long\n")
    again = run("new", "my case.yaml")
    assert again == Ending(
        status=2, out="", err="my case.yaml: exists already; --force overwrites it\n"
    )
    assert Path("my case.yaml").read_text() == "mine"
    assert run("new", "my case.yaml", "--force").status == 0
    assert Path("my case.yaml").read_text(encoding="utf-8") == template_text()


def test_schema_is_json_on_the_terminal_and_in_a_file(run):
    printed = run("schema")
    assert json.loads(printed.out)["title"] == "Stillhook case file"
    ending = run("schema", "schema.json")
    assert ending.status == 0
    assert Path("schema.json").read_text(encoding="utf-8") == printed.out
    assert "yaml-language-server: $schema=schema.json" in ending.out
    assert run("schema", "schema.json").status == 2
    assert run("schema", "schema.json", "--force").status == 0


def test_version_and_help(run):
    assert run("--version").out.startswith(f"stillhook {sh.__version__}")
    for words in (["--help"], ["optimise", "--help"], ["evaluate", "--help"], ["check", "--help"]):
        ending = run(*words)
        assert ending.status == 0
        assert max(map(len, ending.out.splitlines())) <= 80
    nothing = run()
    assert nothing.status == 2
    assert nothing.err.startswith("usage: stillhook")


# bad input


def rao(omega: str) -> tuple[str, str]:
    (line,) = [x for x in CASE.splitlines() if x.strip().startswith("omega:")]
    return re.search(rf"{re.escape(line)}\n( .*\n)*?(?=    amplitude)", CASE)[0], omega  # type: ignore[index]


WRONG_FILES = {
    "not YAML": (("sea:", "sea: ["), r"my\.yaml:\d+: is not YAML: .*"),
    "unknown key": (
        ("  diameter:", "  diamter: 3\n  diameter:"),
        r"my\.yaml:\d+: rope\.diamter: unknown key; did you mean 'diameter'\?",
    ),
    "wrong dimension": (
        ("diameter: 0.044", "diameter: 44 kg"),
        r"my\.yaml:\d+: rope\.diameter: must be a length in \[0\.005, 0\.3\] m, got '44 kg', "
        r"which is a mass",
    ),
    "negative mass": (
        ("  mass: 36844.0", "  mass: -36844.0"),
        r"my\.yaml:\d+: payload\.mass: must be a mass in \[1, 1e\+08\] kg, got -36844\.0",
    ),
    "zero period": (
        ("significant_period: 8.1", "significant_period: 0"),
        r"my\.yaml:\d+: sea\.significant_period: must be a time in \[0.5, 60\] s, got 0",
    ),
    "not a number": (
        ("length: 2000.0", "length: .nan"),
        r"my\.yaml:\d+: rope\.length: must be a length in \[1, 12000\] m, got nan, .*not finite",
    ),
    "RAO out of order": (
        ("[0.34, 0.43,", "[0.43, 0.34,"),
        r"my\.yaml:\d+: vessel\.heave_rao\.omega: must be strictly ascending, got 0\.43 followed "
        r"by 0\.34 \(out of order, index 1\)",
    ),
    "RAO with a frequency twice": (
        ("[0.34, 0.43,", "[0.43, 0.43,"),
        r"my\.yaml:\d+: vessel\.heave_rao\.omega: must be strictly ascending, got 0\.43 followed "
        r"by 0\.43 \(repeated, index 1\)",
    ),
    "a limit below the static load": (
        ("  drive: report", "  drive: enforce\n  rope_tension_peak: 400e3"),
        r"my\.yaml:\d+: limits\.rope_tension_peak: must be at least the static rope tension at the "
        r"winch, 452\.2 kN, got 400 kN",
    ),
    "a rating below the static load": (
        ("  drive: report", "  drive: enforce"),
        r"my\.yaml:\d+: winch\.drive\.torque_continuous: must be at least the static motor torque, "
        r"5\.048 kN m \(rope tension 452\.2 kN on a drum radius of 0\.413 m through a gear of 37\),"
        r" got 4 kN m",
    ),
}


@pytest.mark.parametrize("command", ["check", "optimise"])
@pytest.mark.parametrize("name", WRONG_FILES)
def test_wrong_case_files_end_with_2_and_one_sentence(command, name, run):
    (old, new), message = WRONG_FILES[name]
    text = CASE
    if name.startswith("a rating"):
        text = text.replace("torque_continuous: 5940.0", "torque_continuous: 4e3")
    assert text.count(old) == 1
    Path("my.yaml").write_text(text.replace(old, new))
    ending = run(command, "my.yaml")
    assert (ending.status, ending.out) == (2, "")
    assert re.fullmatch(message + "\n", ending.err)
    assert [path.name for path in Path().iterdir()] == ["my.yaml"]  # nothing was begun


def test_all_errors_of_a_file_come_at_once(run):
    text = CASE.replace("length: 2000.0", "length: -1").replace("area: 20.0", "area: big")
    Path("my.yaml").write_text(text)
    ending = run("optimise", "my.yaml")
    assert ending.status == 2
    fields = [line.split(": ")[1] for line in ending.err.splitlines()]
    assert fields == ["rope.length", "payload.area"]


WRONG_WORDS = {
    "missing file": (
        "check none.yaml",
        "none.yaml: no such case file or bundled case; known here: .*",
    ),
    "nearly a name": ("optimise subsea-crne", ".*did you mean 'subsea-crane'\\?"),
    "a folder": ("check .", r"\.: is a folder; a file is wanted"),
    "change without value": (
        "check thesis-1975 --set rope.length",
        "--set: must be PATH=VALUE, as in rope.length=800, got 'rope.length'",
    ),
    "change given twice": (
        "check thesis-1975 --set rope.length=1 --set rope.length=2",
        "--set: rope.length is given twice",
    ),
    "change of what is not there": (
        "check thesis-1975 --set rope.lenght=1",
        "thesis-1975: .*rope.lenght is unknown; did you mean 'length'\\?",
    ),
    "change that is no YAML": (
        "check thesis-1975 --set rope.length=[1",
        "--set rope.length:1: is not YAML: .*",
    ),
    "change out of range": (
        "optimise thesis-1975 --set limits.max_sensitivity=0.5",
        r"thesis-1975: limits.max_sensitivity: must be a gain in \(1, 100\], got 0.5",
    ),
    "gain that is none": (
        "evaluate thesis-1975 --gains A=1,b=2",
        "--gains: must be numbers for A, a, a1 and a2, as in A=1,a=0,a1=0,a2=0.5, got 'b=2'",
    ),
    "gain without value": ("evaluate thesis-1975 --gains a,a1=2", "--gains: must be .*, got 'a'"),
    "gain twice": (
        "evaluate thesis-1975 --gains a=1,a=2,a1=3,a2=4",
        "--gains: a is given twice",
    ),
    "gain in words": (
        "evaluate thesis-1975 --gains a=much,a1=3,a2=4",
        "--gains: a must be a finite number, got 'much'",
    ),
    "gain without end": (
        "evaluate thesis-1975 --gains a=inf,a1=3,a2=4",
        "--gains: a must be a finite number, got 'inf'",
    ),
    "gains missing": (
        "evaluate thesis-1975 --gains a=1",
        "--gains: a1 and a2 must be given too, got 'a=1'",
    ),
    "no starts": (
        "optimise thesis-1975 --starts 0",
        r"optimise: --starts must be in \[1, 4096\], got 0",
    ),
    "no reference unit": (
        "optimise thesis-1975 --structure feed-forward",
        "thesis-1975: feed-forward hears mru.heave, which is not aboard: add sensors.mru, or take "
        "one of payload-feedback, .*, low-order-4",
    ),
    "no load cell": (
        "structures thesis-1975 --structures payload-feedback,constant-tension",
        "thesis-1975: constant-tension hears rope.tension, which is not aboard: add "
        "sensors.load_cell, or take one of payload-feedback, .*",
    ),
    "no member": (
        "optimise thesis-1975 --member rope.length",
        r"--member: must be PATH=VALUE\[;PATH=VALUE..\], as in rope.damping_ratio=0.0002, got "
        "'rope.length'",
    ),
    "no number": ("optimise thesis-1975 --fix a=x", "--fix: a must be a finite number, got 'x'"),
    "no seed": ("optimise thesis-1975 --seed -1", "optimise: --seed must be at least 0, got -1"),
    "a new case nowhere": ("new none/my.yaml", "none/my.yaml: cannot be written: No such file .*"),
}


@pytest.mark.parametrize("name", WRONG_WORDS)
def test_wrong_words_end_with_2_and_one_sentence(name, run):
    words, message = WRONG_WORDS[name]
    ending = run(*words.split())
    assert (ending.status, ending.out) == (2, "")
    assert re.fullmatch(message + "\n", ending.err)
    assert list(Path().iterdir()) == []


@pytest.mark.parametrize("words", ["optimice x", "optimise", "optimise x --start 3", "check x y"])
def test_words_that_the_parser_refuses_end_with_2(words, run):
    ending = run(*words.split())
    assert (ending.status, ending.out) == (2, "")
    assert ending.err.startswith("usage: stillhook")


def never(*arguments, **rest):
    raise AssertionError("the computation began")


@pytest.mark.parametrize(
    ("folder", "reason"),
    [
        ("file", "a file is there"),
        ("file/more", "part of the path is a file"),
        ("/proc/none/out", "No such file or directory"),
    ],
)
@pytest.mark.parametrize("command", ["optimise", "evaluate"])
def test_a_folder_that_cannot_be_written_ends_before_the_computation(
    folder, reason, command, run, monkeypatch
):
    monkeypatch.setattr("synth.optimise_gains", never)
    monkeypatch.setattr("synth.evaluate_gains", never)
    Path("file").touch()
    ending = run(command, "thesis-1975", "--out", folder)
    assert ending == Ending(
        status=2, out="", err=f"{folder}: the output folder cannot be made: {reason}\n"
    )


def test_a_folder_that_may_not_be_written_to_is_found_out_first(run, monkeypatch):
    monkeypatch.setattr("synth.optimise_gains", never)
    write = Path.write_bytes

    def refuse(path, data):
        if path.parent.name == "locked":
            raise PermissionError(13, "Permission denied")
        return write(path, data)

    monkeypatch.setattr(Path, "write_bytes", refuse)
    ending = run("optimise", "thesis-1975", *THREE, "--out", "locked")
    assert ending.status == 2
    assert re.fullmatch(r"locked/\.\d+\.probe: cannot be written: Permission denied\n", ending.err)


# interrupts and errors of our own


def test_an_interrupted_search_keeps_the_case(run, monkeypatch):
    def interrupted(case, structure, *, starts, progress, **rest):
        progress("starts", 3, starts)
        raise KeyboardInterrupt

    monkeypatch.setattr("synth.optimise_gains", interrupted)
    ending = run("optimise", "thesis-1975", *THREE, "--out", "here")
    assert ending == Ending(
        status=130,
        out="",
        err="stillhook: interrupted; no design was finished; kept in here: case.yaml\n",
    )
    assert kept_in(Path("here")) == ["case.yaml"]
    assert sh.load_case("here/case.yaml") == load_case("thesis-1975")


def test_an_interrupted_search_says_that_other_files_are_old(run, monkeypatch):
    Path("here").mkdir()
    sh.save_design(unstable_design(), "here/design.yaml")
    Path("here", LIST).write_text("design.yaml\n")
    old = Path("here/design.yaml").read_bytes()

    def interrupted(case, structure, **rest):
        raise KeyboardInterrupt

    monkeypatch.setattr("synth.optimise_gains", interrupted)
    ending = run("optimise", "thesis-1975", *THREE, "--out", "here")
    assert ending.err.endswith(
        "kept in here: case.yaml, design.yaml (all but case.yaml are from an earlier run)\n"
    )
    assert Path("here/design.yaml").read_bytes() == old


def test_an_interrupt_while_drawing_keeps_what_is_finished(run, handed_over, monkeypatch):
    handed_over(thesis_design())
    drawn = []

    def interrupted(figure, kind, **_):
        drawn.append(kind)
        if len(drawn) == 4:
            raise KeyboardInterrupt
        return b"a picture"

    monkeypatch.setattr("stillhook.text.images.picture", interrupted)
    ending = run("optimise", "thesis-1975", *THREE, "--out", "here")
    assert ending.status == 130
    kept = {"case.yaml", "design.yaml", "payload_spectrum.svg", "payload_spectrum.png"}
    assert {*kept_in(Path("here"))} == kept | {"responses.svg"}
    assert sh.load_design("here/design.yaml").gains == thesis_design().gains
    assert "the design is finished, its report is not; kept in here: case.yaml, " in ending.err


main_thread = pytest.mark.skipif(
    threading.current_thread() is not threading.main_thread() or not hasattr(signal, "setitimer"),
    reason="signals are for the main thread, timers for Unix",
)


@pytest.mark.ci
@main_thread
def test_ctrl_c_in_the_midst_of_the_search(tmp_path):
    started = subprocess.Popen(
        # every structure of the crane: a search of some minutes
        [sys.executable, "-m", "stillhook", "optimise", "subsea-crane"],
        cwd=tmp_path,
        # A shell in the background hands on that interrupts are ignored.
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    kept = tmp_path / "out" / "subsea-crane" / "case.yaml"
    patience = time.monotonic() + 60.0
    while not kept.exists() and time.monotonic() < patience:
        time.sleep(0.05)
    time.sleep(1.5)  # into the search
    started.send_signal(signal.SIGINT)
    out, err = started.communicate(timeout=60)
    assert started.returncode == 130
    assert out == ""
    assert err.endswith("no design was finished; kept in out/subsea-crane: case.yaml\n")
    assert "Traceback" not in err
    assert kept_in(kept.parent) == ["case.yaml"]


@pytest.mark.parametrize(
    ("error", "status", "message"),
    [
        (
            ZeroDivisionError("float division by zero\nsecond line"),
            3,
            "stillhook: unexpected error, ZeroDivisionError: float division by zero; run the "
            "command again with --debug to see where\n",
        ),
        (
            SolverError("quadrature: no end"),
            1,
            "stillhook: the computation failed: quadrature: no end; run the command again with "
            "--debug to see where\n",
        ),
    ],
)
def test_errors_of_our_own_are_one_line_unless_debug_asks_for_more(
    error, status, message, run, monkeypatch
):
    def broken(case, gains, structure):
        raise error

    monkeypatch.setattr("synth.evaluate_gains", broken)
    assert run("evaluate", "thesis-1975") == Ending(status=status, out="", err=message)
    for words in (["--debug", "evaluate", "thesis-1975"], ["evaluate", "thesis-1975", "--debug"]):
        with pytest.raises(type(error)):
            run(*words)


def test_a_reader_that_goes_away_is_no_error(tmp_path):
    command = f"{shlex.quote(sys.executable)} -m stillhook schema | head -c 10"
    done = subprocess.run(
        ["bash", "-o", "pipefail", "-c", command],
        cwd=tmp_path,
        capture_output=True,
        timeout=60,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, b"")


def test_threads_are_limited_before_numpy_is_there():
    script = (
        "import os, sys, stillhook.cli; "
        "print(os.environ['OPENBLAS_NUM_THREADS'], os.environ['OMP_NUM_THREADS'], "
        "'numpy' in sys.modules)"
    )
    clean = {k: v for k, v in os.environ.items() if not k.endswith("_NUM_THREADS")}
    for given, shown in ({}, "1 1 False"), ({"OPENBLAS_NUM_THREADS": "2"}, "2 1 False"):
        done = subprocess.run(
            [sys.executable, "-c", script],
            env=clean | given,
            capture_output=True,
            text=True,
            timeout=60,
            check=True,
        )
        assert done.stdout.strip() == shown


# the terminal


def test_progress_is_for_terminals(capsys):
    with progress(shown=True) as tell:
        tell("starts", 1, 16)
    assert capsys.readouterr() == ("", "")


def test_progress_names_the_stage_and_leaves_nothing_behind(monkeypatch, capsys):
    import rich.console

    def terminal(*, stderr=False):
        return rich.console.Console(stderr=stderr, force_terminal=True, width=80)

    monkeypatch.setattr("stillhook.text.terminal.console", terminal)
    with progress(shown=True) as tell:
        tell("starts", 3, 16)
        tell("polish", 0, 2)
        tell("something new", 1, 2)
    seen = capsys.readouterr()
    assert seen.out == ""
    assert "something new" in seen.err
    assert seen.err.endswith("\x1b[1A\x1b[2K")  # the last line is erased


def test_colour_is_for_terminals(monkeypatch):
    import io

    import rich.console

    target = io.StringIO()
    monkeypatch.delenv("NO_COLOR", raising=False)
    shown = rich.console.Console(
        file=target, force_terminal=True, width=80, markup=False, color_system="standard"
    )
    show(design_report(thesis_design()), shown)
    assert "\x1b[1;31mNOT OK" in target.getvalue()


def test_other_warnings_go_where_they_always_go():
    import warnings

    with pytest.warns(UserWarning, match="something else"), told_once():
        warnings.warn("something else", stacklevel=1)
