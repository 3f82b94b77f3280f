"""Commands on a case that names no design: the best one is found, once, and is named."""

from __future__ import annotations

import argparse
from pathlib import Path

import pytest
from designs import loopless_design, thesis_design

from stillhook.commands.given_design import given_design, with_design
from stillhook.text import Report

OUT = "out/thesis-1975"
LOUDER = ("--gains", "A=200,a=50,a1=100,a2=99")
BARE = ("thesis-1975", "--set", "gains=null")
FOUND = "design: payload-feedback, found for this case"
COMMANDS = {
    "evaluate": ("--no-bound",),
    "margins": ("--draws", "0"),
    "sweep": ("--samples", "4"),
    "sensitivity": ("--second", "0"),
    "operability": ("--tp", "8"),
}


@pytest.fixture
def searches(monkeypatch):
    """Return the structures that were searched for; the answer is the design of 1975."""
    asked = []

    def found(case, structure, **rest):
        asked.append(structure)
        return thesis_design()

    monkeypatch.setattr("synth.optimise_gains", found)
    return asked


@pytest.mark.ci
@pytest.mark.parametrize("command", COMMANDS)
def test_the_best_design_is_found_and_named(command, run, searches):
    ending = run(command, *BARE, *COMMANDS[command], "--no-figures")
    assert searches == [None]
    assert FOUND in ending.out
    assert "give --design to use another" in " ".join(ending.out.split())


@pytest.mark.ci
@pytest.mark.parametrize("command", [*COMMANDS, "simulate", "compare"])
def test_every_command_says_the_option_of_the_design_that_was_optimised(command, run, monkeypatch):
    monkeypatch.setattr("stillhook.controllers.contenders.DEFAULTS", ("none", "thesis"))
    run_short = {
        "simulate": ("--duration", "20 s"),
        "compare": ("--seeds", "1", "--duration", "20 s", "--jobs", "1"),
    }
    run("evaluate", "thesis-1975", *LOUDER, "--no-bound", "--no-figures", "--out", OUT)
    words = (COMMANDS | run_short)[command]
    ending = run(command, "thesis-1975", *words, "--no-figures")
    assert f"--design {OUT}/design.yaml" in " ".join(ending.out.split())


def told(design, case, **given):
    """Return what a report says of its design in the folder at hand."""
    about = argparse.Namespace(**({"design": None, "gains": None, "structure": None} | given))
    bare = Report(name="")
    return [str(i) for s in with_design(bare, design, case, about).sections for i in s.items]


def test_a_design_that_lies_there_is_told_where_it_is_another_for_this_case(run):
    design = thesis_design()
    assert told(design, design.case) == []
    run("evaluate", "thesis-1975", *LOUDER, "--no-bound", "--no-figures", "--out", OUT)
    use = "design: the gains that the case has in use; give --design "
    use += f"{OUT}/design.yaml to use another"
    assert told(design, design.case) == [use]
    assert told(None, design.case) == [use]
    assert told(design, design.case, gains="A=1") == []
    assert told(design, design.case.replace({"rope.length": 1900.0})) == []
    Path(OUT, "design.yaml").write_text("nonsense")
    assert told(design, design.case) == []
    run("evaluate", "thesis-1975", "--no-bound", "--no-figures", "--out", OUT)
    assert told(design, design.case) == []


def chosen(case, **given):
    """Return the design that a command takes with some of its options."""
    about = {"command": "margins", "design": None, "gains": None, "structure": None}
    return given_design(case, argparse.Namespace(quiet=True, **(about | given)))


def test_the_same_question_is_searched_once_and_another_anew(searches):
    bare = thesis_design().case.replace({"gains": None})
    first, again = chosen(bare), chosen(bare)
    assert searches == [None]
    assert first.parameters == again.parameters
    chosen(bare, structure="payload-feedback")
    chosen(bare.replace({"sea.significant_height": 1.0}))
    assert searches == [None, "payload-feedback", None]


def test_a_design_that_is_named_is_not_searched_for(searches):
    case = thesis_design().case
    own = chosen(case)
    given = chosen(case.replace({"gains": None}), gains="A=200,a=50,a1=100,a2=100")
    assert own.parameters == given.parameters
    assert searches == []


def test_a_structure_alone_is_searched_for_though_the_case_has_gains(searches):
    chosen(thesis_design().case, structure="payload-feedback")
    assert searches == ["payload-feedback"]


def test_where_no_design_is_found_the_reason_is_told(run, monkeypatch):
    monkeypatch.setattr("synth.optimise_gains", lambda case, *named, **rest: loopless_design())
    ending = run("margins", *BARE)
    assert (ending.status, ending.out) == (1, "")
    assert "no design was found for thesis-1975: no stabilising gains were found" in ending.err
