"""The page of validation: its rows, what they say anew, and the tests that it names."""

from __future__ import annotations

import ast
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest
import validation as page
from stored import read_rows
from validation_checks import CHECKS, COMPUTED, STORED, TESTED, Check, computed

ROOT = Path(__file__).parents[2]
ROWS = read_rows(page.CSV)
NAMED = sorted({check.test for check in CHECKS})
STUDY = [check for check in CHECKS if check.how == STORED]


def row_of(check: Check) -> dict[str, str]:
    (row,) = (row for row in ROWS if row["quantity"] == check.quantity)
    return row


@cache
def functions(path: str) -> frozenset[str]:
    """Return the tests that pytest finds in a file, by their names."""
    tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    bodies = [tree.body]
    bodies += [
        node.body
        for node in tree.body
        if isinstance(node, ast.ClassDef) and node.name[:4] == "Test"
    ]
    return frozenset(
        node.name
        for body in bodies
        for node in body
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
    )


def test_the_page_holds_the_table_of_the_rows():
    text = page.PAGE.read_text(encoding="utf-8")
    begin, end = (f"<!-- validation: {which} -->" for which in ("begin", "end"))
    assert text.split(begin)[1].split(end)[0].strip() == page.section(ROWS)


def test_every_comparison_has_its_row():
    assert [row["quantity"] for row in ROWS] == [check.quantity for check in CHECKS]
    for check, row in zip(CHECKS, ROWS, strict=True):
        assert (row["test"], row["how"], row["source"]) == (check.test, check.how, check.source)
        assert float(row["accepted"]) == pytest.approx(check.accepted, rel=1e-5)
        assert bool(row["difference"]) == (check.work is not None)


def test_what_is_computed_is_as_near_as_is_accepted():
    assert not [r["quantity"] for r in ROWS if r["how"] == COMPUTED and page.missed(r)]


def test_there_is_something_of_every_kind():
    counts = {name: sum(c.subject == name for c in CHECKS) for name in {c.subject for c in CHECKS}}
    assert min(counts.values()) >= 4
    sources = {c.source.partition(",")[0] for c in CHECKS if c.subject.startswith("Published")}
    assert len(sources) >= 6
    assert {c.how for c in CHECKS} == {COMPUTED, STORED, TESTED}


@pytest.mark.parametrize("name", NAMED)
def test_a_test_that_is_named_is_there(name):
    path, _, function = name.partition("::")
    assert path.startswith("tests/")
    assert function in functions(path)


@pytest.mark.ci
def test_every_test_that_is_named_is_collected():
    files = sorted({name.partition("::")[0] for name in NAMED})
    words = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-m", "", *files]
    found = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stdout[-2000:]
    collected = {line.partition("[")[0] for line in found.stdout.splitlines() if "::" in line}
    # A test in a class has its class between the two.
    collected |= {f"{line.split('::')[0]}::{line.split('::')[-1]}" for line in collected}
    assert not set(NAMED) - collected


@pytest.mark.parametrize("check", computed(quick=True), ids=lambda check: check.quantity)
def test_a_row_that_takes_moments_comes_out_again(check):
    anew, row = check.row(), row_of(check)
    assert not page.missed(anew)
    if row["ours"]:
        assert float(anew["ours"]) == pytest.approx(float(row["ours"]), rel=1e-4, abs=1e-6)
        assert float(anew["other"]) == pytest.approx(float(row["other"]), rel=1e-6)


@pytest.mark.ci
@pytest.mark.parametrize(
    "check", [c for c in computed(quick=False) if not c.quick], ids=lambda check: check.quantity
)
def test_a_row_that_takes_seconds_comes_out_again(check):
    assert not page.missed(check.row())
    assert float(check.row()["difference"]) <= check.accepted


@pytest.mark.parametrize("check", STUDY, ids=lambda check: check.quantity)
def test_the_study_in_simulation_is_told_as_it_is(check):
    # Of the stored runs: what is missed is told as missed.
    anew, row = check.row(), row_of(check)
    assert {name: row[name] for name in anew} == anew
    assert ("**missed**" in page.table([row])) == page.missed(row)


def test_what_is_missed_says_so_and_the_bar_of_a_modulus_ends_no_cell():
    row = {**ROWS[0], "quantity": "|P/Z|", "difference": "0.5", "accepted": "0.1"}
    told = page.table([row])
    assert "| \\|P/Z\\| |" in told
    assert "**missed**" in told
