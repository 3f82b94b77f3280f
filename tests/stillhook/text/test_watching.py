"""Progress in Python: a bar on a terminal and in a notebook, nothing in a pipe, and the switch."""

from __future__ import annotations

import inspect
import os
import re
import subprocess
import sys

import pytest

import stillhook as sh

pty = pytest.importorskip("pty", reason="a terminal of one's own is for Unix")

#: A call within a call: the bar of the outer one tells of both, after half a second.
NESTED = """
import time, sys
import stillhook as sh
from models.basics import shows_progress

@shows_progress("within")
def within(*, progress=None):
    time.sleep(0.7)
    print("printed")
    if progress is not None:
        progress(0.5)
    time.sleep(0.3)

@shows_progress("without")
def without(*, progress=None):
    if progress is not None:
        progress("first", 1, 2)
    within()

"""
LINEAR_MPC = "import stillhook as sh; sh.LinearMPC(sh.load_case('thesis-1975')); print('made')"


def ran(program, *, terminal, **environment):
    """Run a program with standard error on a terminal or in a pipe; return what it wrote."""
    clean = {k: v for k, v in os.environ.items() if k not in ("STILLHOOK_PROGRESS", "NO_COLOR")}
    clean |= {"TERM": "xterm", "COLUMNS": "80", **environment}
    command = [sys.executable, "-c", program]
    if not terminal:
        done = subprocess.run(command, capture_output=True, timeout=120, env=clean, check=True)
        return done.stdout.decode(), done.stderr.decode()
    ours, theirs = pty.openpty()
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=theirs, env=clean)
    os.close(theirs)
    seen = b""
    try:
        while part := os.read(ours, 4096):
            seen += part
    except OSError:  # Linux: the other end is closed
        pass
    os.close(ours)
    out, _ = process.communicate(timeout=120)
    assert process.returncode == 0
    return out.decode(), seen.decode()


def plain(text):
    return re.sub(r"\x1b\[[?0-9;]*[A-Za-z]", "", text)


def test_a_terminal_shows_one_bar_for_calls_within_calls():
    out, seen = ran(NESTED + "without()", terminal=True)
    assert out == "printed\n"  # where it was piped to
    text = plain(seen)
    assert "first" in text
    assert "within" in text
    assert "50/100" in text
    assert seen.count("\x1b[?25l") == 1  # the cursor is hidden once: one bar
    assert seen.endswith("\x1b[1A\x1b[2K")  # and the line is erased


def test_a_pipe_shows_nothing():
    assert ran(NESTED + "without()", terminal=False) == ("printed\n", "")


def test_what_is_quick_shows_nothing():
    program = NESTED.replace("0.7", "0.1").replace("0.3", "0.0") + "without()"
    assert ran(program, terminal=True) == ("printed\n", "")


@pytest.mark.parametrize(
    "words",
    [
        {"program": NESTED + "without()", "STILLHOOK_PROGRESS": "0"},
        {"program": NESTED + "sh.show_progress(False); without()"},
        {"program": NESTED + "sh.show_progress(False); without()", "STILLHOOK_PROGRESS": "1"},
        {"program": NESTED + "without()", "TERM": "dumb"},
        {"program": NESTED + "without(progress=lambda *far: None)"},
    ],
    ids=["environment", "call", "call over environment", "dumb", "own"],
)
def test_a_terminal_shows_nothing_where_it_is_not_wanted(words):
    assert ran(**words, terminal=True) == ("printed\n", "")


@pytest.mark.parametrize(
    "words",
    [
        {"program": NESTED + "without()", "STILLHOOK_PROGRESS": "1"},
        {"program": NESTED + "sh.show_progress(); without()"},
        {"program": NESTED + "sh.show_progress(); without()", "STILLHOOK_PROGRESS": "0"},
    ],
    ids=["environment", "call", "call over environment"],
)
def test_a_pipe_shows_a_bar_where_it_is_wanted(words):
    out, seen = ran(**words, terminal=False)
    assert out == "printed\n"
    assert "50/100" in plain(seen)


def test_none_is_the_default_again():
    program = NESTED + "sh.show_progress(True); sh.show_progress(None); without()"
    assert ran(program, terminal=False) == ("printed\n", "")


def test_a_notebook_shows_a_bar():
    program = NESTED + (
        "class OutStream(type(sys.stderr)): pass\n"
        "OutStream.__module__ = 'ipykernel.iostream'\n"
        "sys.stderr = OutStream(open(2, 'wb', closefd=False), write_through=True)\n"
        "without()"
    )
    out, seen = ran(program, terminal=False, COLUMNS="20")  # of where the server was started
    assert out == "printed\n"
    assert "50/100" in plain(seen)
    assert max(map(len, re.split(r"[\r\n]", plain(seen)))) <= 80


@pytest.mark.ci
def test_predictive_control_shows_its_tuning():
    out, seen = ran(LINEAR_MPC, terminal=True)
    assert out == "made\n"
    assert re.search(r"tuning the weights .*\d+/100", plain(seen))
    assert ran(LINEAR_MPC, terminal=False) == ("made\n", "")


@pytest.mark.ci
def test_the_command_lines_own_bar_is_the_only_one(tmp_path):
    program = (
        "import sys; from stillhook.cli import main\n"
        "main(['simulate', 'thesis-1975', '--controller', 'mpc', '--duration', '20 s', "
        "'--no-figures', '--out', sys.argv[-1], QUIET])"
    )
    program = program.replace("sys.argv[-1]", repr(str(tmp_path)))
    shown = program.replace("QUIET", "'--force'")
    _, seen = ran(shown, terminal=True)
    assert seen.count("\x1b[?25l") == 1
    assert re.search(r"tuning mpc, \d+%", plain(seen))
    assert ran(shown, terminal=True, STILLHOOK_PROGRESS="0")[1] == ""
    assert ran(program.replace("QUIET", "'--quiet', '--force'"), terminal=True)[1] == ""


SECONDS = [
    *("tune_weights", "optimise_gains", "optimise_robust", "tune", "schedule_gains", "robustness"),
    *("simulate", "compare", "sweep", "resume_sweep", "failure_modes", "operability", "export"),
    *("sensitivity", "sobol_indices", "morris_screening", "size_winch", "co_design", "worth"),
    *("pareto_front", "write_report", "write_design", "write_runs", "write_comparison"),
    *("vessel_from_hull", "bound_for", "clairvoyant"),
]


@pytest.mark.parametrize("name", SECONDS)
def test_what_takes_seconds_is_shown(name):
    """All that has a `progress`, and what takes seconds without one."""
    function, layers = getattr(sh, name), []
    while hasattr(function, "__wrapped__"):
        layers.append(function.__code__.co_qualname)
        function = function.__wrapped__
    assert "shows_progress.<locals>.mark.<locals>.shown" in layers


def test_all_that_has_a_progress_is_shown():
    found = [name for name in sh.__all__ if inspect.isfunction(getattr(sh, name))]
    with_one = {n for n in found if "progress" in inspect.signature(getattr(sh, n)).parameters}
    assert with_one <= {*SECONDS}
