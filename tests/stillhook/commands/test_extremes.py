"""Extreme but legal cases through every command: a sensible answer or a sentence, in a minute."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable
from pathlib import Path

import pytest
from extremes import EXTREMES, asked, extreme_case, pairs

from stillhook.cli import COMMANDS

pytestmark = pytest.mark.skipif(not hasattr(os, "memfd_create"), reason="forks, as Linux does")

#: Processor time after which a question is ended [s]: twice the minute that is promised.
SECONDS = 120

SINGLE, PAIRS = tuple(EXTREMES), tuple(pairs(6))

OF_A_CASE = ("check CASE", "motion CASE --tp 8")
OF_GAINS = (
    "evaluate CASE --no-bound",
    "margins CASE --draws 10",
    "sensitivity CASE --second 0",
    "operability CASE --tp 6,12 --payload-rms '1 m'",
    "sweep CASE --samples 16 --vary payload.drag_coefficient=30%",
    "report CASE --no-bound --out out/report "
    "--without comparison,operability,sweep,sensitivity,robustness,failures,simulation",
    "export CASE --to c,st,json",
)
IN_TIME = (
    "simulate CASE --duration '30 s' --controller feedback,none,feed-forward,constant-tension",
    "sweep CASE --mode time --samples 2 --duration '20 s' --jobs 1 --out out/time "
    "--vary payload.drag_coefficient=30%",
    "compare CASE --controllers none,feed-forward,thesis --seeds 1 --duration '20 s' --jobs 1",
    "report CASE --no-bound --seeds 1 --out out/whole "
    "--without comparison,operability,sweep,sensitivity,robustness",
)
SEARCHES = (
    "optimise CASE --structure payload-feedback --no-bound",
    "structures CASE --structures payload-feedback,drum-feedback --starts 1 --no-bound",
    "robust CASE --vary sensors.telemetry.delay=0..0.01 --starts 1 --draws 20",
    "pareto CASE --points 2",
    "size CASE --target '150 mm' --points 3 --starts 1",
    "worth CASE --starts 1",
    "bound CASE",
    "simulate CASE --controller mpc --duration '20 s'",
)
#: Of the crane, whose searches all together take too long for so many cases.
OF_THE_CRANE = (
    "optimise CASE --structure feed-forward --no-bound",
    "simulate CASE --controller mpc --duration '20 s'",
)
#: What takes minutes, as docs/mpc.md says: a telegram of 5 s ago is a model of hundreds of states.
LONG = ("delay of 5 s", "--controller mpc")

#: Commands that take no case of one's own with a load, a rope and a winch, and the one that serves
#: until it is stopped.
NONE = (
    "page",
    "scenarios",
    "sea",
    "vessel import",
    "vessel hull",
    "vessel list",
    "cases",
    "new",
    "schema",
    "completion",
)

NOT_A_NUMBER = re.compile(r"(?<![\w.-])[+-]?(nan|inf|NaN|Infinity|None)(?![\w-])")


def wrong_with(folder: Path, lines: Iterable[str]) -> list[str]:
    """Ask all lines; return what is no answer: a crash, a warning of Python's, no number."""
    found = []
    for line, ending, used in asked(lines, folder, seconds=SECONDS):
        status, out, err = ending.status, ending.out, ending.err
        said = f"{line}: status {status} after {used:.0f} s: {err.strip()[-300:]}"
        if status not in (0, 1, 2) or "Traceback" in err or "Warning: " in err:
            found.append(said)
        elif not (out.strip() if status == 0 else f"{out}{err}".strip()):
            found.append(f"{said}: said nothing")
        elif "--json" in line and status < 2 and out:
            json.loads(out, parse_constant=lambda name, said=said: found.append(f"{said}: {name}"))
        elif number := NOT_A_NUMBER.search(out):
            around = out[max(0, number.start() - 150) : number.end() + 50]
            found.append(f"{said}: says {number[0]}: ...{around}...")
    return found


def kept(folder: Path, base: str, name: str) -> str:
    """Write an extreme case, and return the name of its file."""
    path = folder / f"{base} {name}.yaml".replace(" ", "-")
    path.write_text(extreme_case(base, name).to_yaml(), encoding="utf-8")
    return path.name


def questions(lines: Iterable[str], case: str) -> list[str]:
    return [f"{line.replace('CASE', case)} --no-figures" for line in lines]


def test_every_command_that_takes_a_case_is_asked():
    lines = (*OF_A_CASE, *OF_GAINS, *IN_TIME, *SEARCHES)
    of_a_case = {name for name, room, _ in COMMANDS if room and name not in NONE}
    assert {line.split()[0] for line in lines} == of_a_case


@pytest.mark.filterwarnings("ignore::models.PhysicsWarning")
def test_extremes_are_read_and_evaluated(tmp_path):
    lines = []
    for name in SINGLE:
        case = kept(tmp_path, "thesis-1975", name)
        lines += questions(("check CASE --json", "evaluate CASE --no-bound"), case)
    assert wrong_with(tmp_path, lines) == []


@pytest.mark.ci
@pytest.mark.filterwarnings("ignore::models.PhysicsWarning")
@pytest.mark.parametrize("name", [*SINGLE, *PAIRS])
def test_extremes_are_studied(name, tmp_path):
    case = kept(tmp_path, "thesis-1975", name)
    plain = questions((*OF_A_CASE, *OF_GAINS), case)
    assert wrong_with(tmp_path, [*plain, *(f"{line} --json" for line in plain)]) == []


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::models.PhysicsWarning")
@pytest.mark.parametrize("name", [*SINGLE, *PAIRS])
@pytest.mark.parametrize("base", ["thesis-1975", "subsea-crane"])
def test_extremes_are_simulated_and_designed_for(base, name, tmp_path):
    lines = (*IN_TIME, *SEARCHES) if base == "thesis-1975" else OF_THE_CRANE
    lines = [line for line in lines if not (LONG[0] in name and LONG[1] in line)]
    assert wrong_with(tmp_path, questions(lines, kept(tmp_path, base, name))) == []
