"""The glossary: every field of a result, every signal, quantity and column that a user can meet."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from reference_pages import pages

import stillhook as sh

TEXT = (Path(__file__).parents[2] / "docs" / "glossary.md").read_text(encoding="utf-8")
CLASSES = [
    path
    for match in re.finditer(r"^```\{made\} fields (.+)$", TEXT, re.MULTILINE)
    for path in match[1].split()
]


@pytest.fixture(scope="module")
def told():
    text = pages.filled(TEXT)
    assert "{made}" not in text
    return text


@pytest.mark.parametrize("path", CLASSES)
def test_every_field_of_a_result_has_a_meaning(path):
    for names, text in pages.field_texts(path):
        assert text, f"{path}: {', '.join(names)}: nothing is said of it"


def test_words_of_its_own_are_of_fields_that_exist():
    fields = {
        f"{path.rpartition('.')[2]}.{name}"
        for path in CLASSES
        for names, _ in pages.field_texts(path)
        for name in names
    }
    assert set(pages.OWN_WORDS) <= fields


def test_columns_of_tables_are_told(told):
    found = pages.columns_of_tables()
    assert {"payload_rms", "limited_by", "max_sensitivity"} <= set(found)
    for name in found:
        assert f"| `{name}` |" in told


def named_in_tables(text: str) -> set[str]:
    """Everything in backticks in the first cell of a row."""
    rows = re.findall(r"^\| (`.+?) \|", text, re.MULTILINE)
    return {name for row in rows for name in re.findall(r"`([^`]+)`", row)}


def test_signals_and_quantities_of_a_run_are_told():
    case = sh.load_case("subsea-crane")
    run = sh.simulate(case, "feed-forward", seeds=1, duration="20 s")[0]
    names = named_in_tables(TEXT)
    assert set(run.signals) | set(run.statistics.signals) <= names
    assert set(run.statistics.quantities) <= names


def test_columns_of_a_comparison_are_told():
    found = sh.compare(
        sh.load_case("thesis-1975"), ["none", "feed-forward"], seeds=2, duration="1 min", jobs=1
    )
    names = named_in_tables(TEXT)
    ends = re.compile(r" (low|high)$")
    assert {ends.sub("", str(name)) for name in found.table} <= names


def test_variables_of_operability_are_told():
    design = sh.evaluate_gains(
        sh.load_case("thesis-1975"), {"A": 200, "a": 50, "a1": 100, "a2": 100}
    )
    study = sh.operability(design, periods=[8.0, 10.0], payload_rms="5 cm", scatter="example")
    data = study.dataset
    names = named_in_tables(TEXT)
    for name in (*data.data_vars, *data.coords):
        assert re.sub(r"_(held|perfect)$", "", str(name)) in names, name
