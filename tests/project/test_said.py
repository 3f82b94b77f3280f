"""The figures in sentences of the docs: each is that of a stored row, which a script replaces."""

from __future__ import annotations

import importlib
import math
import re
from pathlib import Path

import pytest
import said

DOCS = Path(__file__).parents[2] / "docs"
SCRIPTS = ("said_structures", "said_mpc", "operability_figures", "windows_figures")


@pytest.mark.parametrize("name", SCRIPTS)
def test_the_pages_say_what_is_stored(name):
    script = importlib.import_module(name)
    rows = {row["name"]: row for row in said.stored_sayings(script.FILE)}
    assert list(rows) == [saying.name for saying in script.SAYINGS]
    for saying in script.SAYINGS:
        row = rows[saying.name]
        assert row["page"] == saying.page
        assert row["words"] == saying.words(said.numbers_of(row)), saying.name
        assert said.holds((DOCS / saying.page).read_text(encoding="utf-8"), row["words"])


def test_no_page_waits_for_a_figure():
    for page in DOCS.glob("*.md"):
        assert not re.search(r"\{\{[a-z-]+\}\}", page.read_text(encoding="utf-8")), page.name


PARAGRAPH = """# A page

* One thing of
  12 mm
  is said here, with [a link](there.md) and `some code`.
* Another thing.

| a | b |
| --- | --- |
| 1 | 2 |
"""


def test_words_are_replaced_within_their_paragraph():
    told = said.replaced(PARAGRAPH, "thing of 12 mm is", f"thing of {'very ' * 30}many mm is")
    before, after = told.split("* Another")
    assert after == PARAGRAPH.split("* Another")[1]
    assert all(len(line) <= 100 for line in before.splitlines())
    assert all(line.startswith("  ") for line in before.splitlines()[3:])
    assert said.holds(told, "many mm is said here, with [a link](there.md)")
    assert said.replaced(told, f"{'very ' * 30}many", "12").split() == PARAGRAPH.split()


def test_no_line_begins_with_a_mark_or_a_unit():
    for length in range(60, 100):
        told = said.replaced("It is so.\n", "so.", f"{'x' * length} 5 %, 3 mm, a - b and 4. it")
        assert all(line[0] not in "%-4m" for line in told.splitlines()), told


def test_a_table_is_replaced_as_it_stands():
    told = said.replaced(PARAGRAPH, "| 1 | 2 |", "| 3 | 4 |\n| 5 | 6 |")
    assert told == PARAGRAPH.replace("| 1 | 2 |", "| 3 | 4 |\n| 5 | 6 |")


@pytest.mark.parametrize("words", ["of 13 mm", "thing"])
def test_words_that_are_not_there_once_are_told(words):
    with pytest.raises(ValueError, match="has these words"):
        said.replaced(PARAGRAPH, words, "nothing")


@pytest.mark.parametrize(
    ("template", "value", "words"),
    [
        ("{a}", 12345.6, "12300"),
        ("{a}", 0.061588, "0.0616"),
        ("{a:2}", 99.96, "100"),
        ("{a:2}", 9.04, "9.0"),
        ("{a:1}", 0.00091, "0.0009"),
        ("{a:.0f}", 16.9, "17"),
        ("{a:2}", math.inf, "infinite"),
    ],
)
def test_digits_of_a_number(template, value, words):
    saying = said.Saying(page="", name="", template=template, work=lambda effort: {})
    assert saying.words({"a": said.Number(value)}) == words


def test_a_script_stores_and_replaces(tmp_path, monkeypatch, capsys):
    for folder in ("data", "images"):
        (tmp_path / folder).mkdir()
    page = tmp_path / "page.md"
    page.write_text("It is {{size}} long.\n", encoding="utf-8")
    monkeypatch.setattr(said, "DOCS", tmp_path)
    monkeypatch.setattr(said, "docs_folder", lambda quick: tmp_path)
    for value in (3.0, 4.0):
        saying = said.Saying(
            page="page.md", name="size", template="{a} m", work=lambda effort, v=value: {"a": v}
        )
        assert said.tell([saying], "said_mpc.csv", said.sayings_parser("").parse_args([])) == 0
        assert page.read_text(encoding="utf-8") == f"It is {value:.2f} m long.\n"
    saying = said.Saying(page="page.md", name="size", template="{a:1} metres", work=saying.work)
    given = said.sayings_parser("").parse_args(["--words"])
    assert said.tell([saying], "said_mpc.csv", given) == 0
    assert page.read_text(encoding="utf-8") == "It is 4 metres long.\n"
    page.write_text("It is short.\n", encoding="utf-8")
    assert said.tell([saying], "said_mpc.csv", given) == 1
    assert "has these words 0 times" in capsys.readouterr().out
