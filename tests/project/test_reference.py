"""The reference: every public name once, with an example that runs, and all fields of a case."""

from __future__ import annotations

import contextlib
import importlib.util
import inspect
import re
from pathlib import Path

import pytest
from reference_pages import pages

import stillhook as sh
from models.case import Case

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "reference"
EXAMPLE = re.compile(r"(?P<slow><!-- takes [^\n]+ -->\n)?```python\n(?P<code>.*?)\n```", re.DOTALL)
ALL = (*pages.GROUPS, pages.LOWER)


def text_of(page: str) -> str:
    return (FOLDER / f"{page}.md").read_text(encoding="utf-8")


def test_every_public_name_is_in_one_of_eight_groups():
    assert len(pages.GROUPS) == 8
    found = [name for page in pages.GROUPS for name in pages.names_on(page)]
    assert sorted(found) == sorted(sh.__all__)


@pytest.mark.parametrize("page", ALL)
def test_every_name_has_a_line_and_an_example(page):
    parts = re.split(r"^## ", text_of(page), flags=re.MULTILINE)[1:]
    for name, part in zip(pages.names_on(page), parts, strict=True):
        assert part.startswith(f"`{name}`")
        assert EXAMPLE.search(part), name
        assert pages.one_line(name).endswith((".", ";", ":")), name


def run_examples(page: str, folder: Path, *, slow: bool) -> None:
    namespace: dict[str, object] = {"__name__": "__main__"}
    text = text_of(page)
    with contextlib.chdir(folder):
        for match in EXAMPLE.finditer(text):
            if match["slow"] and not slow:
                continue
            if "extra bem" in (match["slow"] or "") and not importlib.util.find_spec("capytaine"):
                continue
            before = text.count("\n", 0, match.start("code"))
            exec(compile("\n" * before + match["code"], f"{page}.md", "exec"), namespace)


@pytest.mark.parametrize("page", ["cases", "vessels-and-seas", "sweeps"])
def test_quick_examples_run(page, tmp_path):
    run_examples(page, tmp_path, slow=False)


@pytest.mark.ci
@pytest.mark.parametrize("page", [p for p in ALL if p not in ("cases", "sweeps")])
def test_all_examples_run(page, tmp_path):
    run_examples(page, tmp_path, slow=True)


def test_private_modules_are_nowhere():
    for page in FOLDER.glob("*.md"):
        assert "automodule" not in page.read_text(encoding="utf-8"), page.name
    for page in pages.GROUPS:
        assert not any(name.startswith("_") or "." in name for name in pages.names_on(page))


def test_the_overview_tells_every_name():
    told = pages.filled(text_of("index"))
    for name in sh.__all__:
        assert f"[`sh.{name}`](" in told
    assert "{made}" not in told


def test_a_heading_is_followed_by_its_signature():
    told = pages.filled("## `load_case`\n\n## `InputError`\n\n## `Case`")
    assert ".. autofunction:: stillhook.load_case" in told
    assert ".. autoexception:: stillhook.InputError" in told
    assert ".. autoclass:: stillhook.Case" in told


def schema_fields() -> set[tuple[str, str]]:
    """Every section of the schema by its description, with its fields."""
    schema = sh.case_schema()
    sections = [schema, *schema["$defs"].values()]
    return {
        (" ".join(section["description"].split()), field)
        for section in sections
        for field in section["properties"]
    }


def test_every_field_of_the_schema_is_on_the_page_of_case_files():
    told = {
        (" ".join(inspect.getdoc(section).split()), field.name)
        for _, section, fields in pages.case_sections()
        for field in fields
    }
    assert told == schema_fields()
    text = pages.filled(text_of("case-file"))
    for path, _, fields in pages.case_sections():
        part = text.partition(f"\n## `{path or 'at the top'}`\n")[2].partition("\n## ")[0]
        for field in fields:
            assert f"`{field.name}` -- {field.wants}; {field.default}" in part
            assert field.text
            assert field.text in part


def test_fields_say_type_unit_range_and_default():
    found = {path: {f.name: f for f in fields} for path, _, fields in pages.case_sections()}
    rope = found["rope"]
    assert rope["diameter"].wants == "a length, in [0.005, 0.3] m"
    assert rope["diameter"].default == "must be given"
    assert rope["falls"].default == "default `1`"
    jonswap = found["sea (spectrum: jonswap)"]
    assert jonswap["gamma"].wants.startswith("`auto` or a ratio")
    assert found["limits"]["stroke"].wants.startswith("a list of 2, each a length")
    assert found["limits"]["drive"].wants == "`enforce` or `report`"
    assert set(found[""]) == set(Case.model_fields)


def test_index_of_the_site_has_four_groups_and_every_page():
    text = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    captions = re.findall(r"^:caption: (.+)$", text, re.MULTILINE)
    assert captions == ["Start here", "Do a job", "Understand", "Look up"]
    listed = set(re.findall(r"^(?:[^<\n]+ <)?([a-z_/-]+)>?$", text, re.MULTILINE))
    folder = ROOT / "docs"
    pages_there = {path.stem for path in folder.glob("*.md")} - {"index"}
    pages_there |= {f"examples/{path.stem}" for path in (folder / "examples").glob("*.md")}
    assert pages_there <= listed
