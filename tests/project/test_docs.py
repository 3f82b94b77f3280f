"""What the documentation says is done: its code runs, its commands work, its links lead somewhere.

In README.md and docs/*.md every fenced `python` block is executed, all blocks of a file in one
namespace, and so is every `stillhook` command in a `console` or `sh` block, all in one scratch
folder per file.  An HTML comment directly above a block changes that:

    <!-- not run: reason -->
    <!-- exit status: 1 -->
"""

from __future__ import annotations

import contextlib
import doctest
import re
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DOCS = sorted([*(ROOT / "docs").glob("*.md"), *(ROOT / "docs" / "examples").glob("*.md")])
PAGES = [path for path in [ROOT / "README.md", *DOCS] if path.exists()]
#: Pages that run studies of seconds: CI's.
STUDIES = {
    "compare",
    "own-vessel",
    "quickstart",
    "robust",
    "simulation",
    "sizing",
    "structures",
    "sweeps",
    "tune_any_plant",
}
FENCE = re.compile(r"^(?P<fence>```+)(?P<language>[^`\s]*)[^`]*$")
REMARK = re.compile(r"^<!-- (?P<what>not run|exit status): (?P<value>.+?) -->$")
LINK = re.compile(r"!?\[[^\]]*\]\((?P<target>[^)\s]+)\)")
SHELL = re.compile(r"[|<>;&`$*]")


@dataclass(frozen=True, kw_only=True)
class Block:
    """One fenced block: its language, its lines, where its first line stands, its remarks."""

    language: str
    lines: tuple[str, ...]
    first_line: int
    remarks: dict[str, str]

    @property
    def runs(self) -> bool:
        if "not run" in self.remarks:
            return False
        return self.language == "python" or any(
            command.startswith("stillhook ") for _, command in self.commands()
        )

    def commands(self) -> list[tuple[int, str]]:
        """The commands of a console or sh block, each with the number of its first line."""
        if self.language not in ("console", "sh"):
            return []
        found: list[tuple[int, str]] = []
        continued = False
        for number, line in enumerate(self.lines, self.first_line):
            text = line.strip()
            if continued:
                start, before = found.pop()
                found.append((start, f"{before} {text.removeprefix('> ').strip()}"))
            elif self.language == "console":
                if not text.startswith("$ "):
                    continue  # what the command prints
                found.append((number, text[2:]))
            elif text and not text.startswith("#"):
                found.append((number, text.removeprefix("$ ")))
            else:
                continue
            start, command = found.pop()
            continued = command.endswith("\\")
            found.append((start, command.removesuffix("\\").strip()))
        return [(number, command.partition(" #")[0].strip()) for number, command in found]


def blocks(text: str) -> list[Block]:
    found: list[Block] = []
    lines = text.splitlines()
    number = 0
    while number < len(lines):
        opening = FENCE.match(lines[number])
        if opening is None:
            number += 1
            continue
        remarks: dict[str, str] = {}
        above = number - 1
        while above >= 0 and (remark := REMARK.match(lines[above])):
            remarks[remark["what"]] = remark["value"]
            above -= 1
        end = next(i for i in range(number + 1, len(lines)) if lines[i].strip() == opening["fence"])
        found.append(
            Block(
                language=opening["language"],
                lines=tuple(lines[number + 1 : end]),
                first_line=number + 2,
                remarks=remarks,
            )
        )
        number = end + 1
    return found


def run_python(block: Block, path: Path, namespace: dict[str, object]) -> None:
    source = "\n".join(block.lines)
    if source.startswith(">>> "):
        test = doctest.DocTestParser().get_doctest(
            source, {}, path.name, str(path), block.first_line - 1
        )
        test.globs = namespace
        report: list[str] = []
        flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
        doctest.DocTestRunner(optionflags=flags).run(test, out=report.append, clear_globs=False)
        assert not report, "".join(report)
    else:
        # The blank lines make a traceback show the page's own line numbers.
        source = "\n" * (block.first_line - 1) + source + "\n"
        exec(compile(source, str(path), "exec"), namespace)


def run_commands(block: Block, path: Path) -> None:
    for number, command in block.commands():
        where = f"{path.name}:{number}: {command}"
        words = shlex.split(command)
        if words[0] == "make":
            targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
            assert set(words[1:]) <= set(targets), f"{where}: no such target in the Makefile"
            continue
        assert words[0] == "stillhook", f"{where}: mark the block with <!-- not run: reason -->"
        assert not SHELL.search(command), f"{where}: only plain commands can be run"
        from stillhook.cli import main

        status: object = None
        try:
            status = main(words[1:])
        except SystemExit as stop:
            status = stop.code
        wanted = int(block.remarks.get("exit status", "0"))
        assert (status or 0) == wanted, f"{where}: exit status {status}, not {wanted}"


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, marks=[pytest.mark.ci] if path.stem in STUDIES else [], id=path.name)
        for path in PAGES
    ],
)
def test_page_does_what_it_says(path, tmp_path):
    namespace: dict[str, object] = {"__name__": "__main__"}
    with contextlib.chdir(tmp_path):
        for block in blocks(path.read_text(encoding="utf-8")):
            if "not run" in block.remarks:
                continue
            if block.language == "python":
                run_python(block, path, namespace)
            else:
                run_commands(block, path)


def test_readme_shows_something_that_runs():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert any(block.runs for block in blocks(text))


@pytest.mark.parametrize("name", ["README.md", "CONTRIBUTING.md", "CHANGELOG.md"])
def test_relative_links_lead_somewhere(name):
    page = ROOT / name
    targets = [match["target"] for match in LINK.finditer(page.read_text(encoding="utf-8"))]
    local = [t.partition("#")[0] for t in targets if not re.match(r"[a-z]+:|#", t)]
    assert [target for target in local if not (ROOT / target).exists()] == []


def test_the_map_of_the_rooms_is_todays():
    path = ROOT / "docs" / "make" / "rooms.py"
    run = subprocess.run(
        [sys.executable, str(path), "--quick"], capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr[-2000:]
    drawn = (ROOT / "out" / "quick" / "CONTRIBUTING.md").read_text(encoding="utf-8")
    assert (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8") == drawn
    assert len(drawn.splitlines()) <= 120


PAGE = """\
Text.

```python
x = 2
```

<!-- not run: needs a ship -->
```console
$ stillhook optimise my.yaml
```

```console
$ make demo
installing
$ stillhook new \\
>   my.yaml   # a template
```

<!-- exit status: 1 -->
```sh
stillhook check missing.yaml
```

```{toctree}
theory
```
"""


def test_blocks_are_found_with_their_lines_and_remarks():
    found = blocks(PAGE)
    assert [block.language for block in found] == [
        "python",
        "console",
        "console",
        "sh",
        "{toctree}",
    ]
    assert [block.runs for block in found] == [True, False, True, True, False]
    assert found[0].first_line == 4
    assert found[1].remarks == {"not run": "needs a ship"}
    assert found[2].commands() == [(13, "make demo"), (15, "stillhook new my.yaml")]
    assert found[3].remarks == {"exit status": "1"}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("```python\nx = 1\nassert x == 2, 'x is one'\n```", "x is one"),
        ("```python\n>>> 1 + 1\n3\n```", "Expected"),
        ("```console\n$ make coffee\n```", "no such target"),
        ("```console\n$ rm -r out\n```", "mark the block"),
        ("```console\n$ stillhook cases | head\n```", "only plain commands"),
    ],
)
def test_a_page_that_lies_is_caught(text, message, tmp_path):
    page = tmp_path / "page.md"
    page.write_text(text)
    with pytest.raises(AssertionError, match=message):
        test_page_does_what_it_says(page, tmp_path)


def test_a_failing_command_is_caught(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("```sh\nstillhook check missing.yaml\n```")
    with pytest.raises(AssertionError, match=r"page.md:2: .*exit status"):
        test_page_does_what_it_says(page, tmp_path)
    page.write_text("<!-- exit status: 2 -->\n```sh\nstillhook no-such-command\n```")
    test_page_does_what_it_says(page, tmp_path)
