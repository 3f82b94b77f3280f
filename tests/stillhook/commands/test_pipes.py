"""What is printed, in pipes: a reader that goes, encodings that lack characters."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys

import pytest

from stillhook.text import take_any_text, write_json

#: Starts what tests run as a user's shell does, with nothing of the current folder on the path.
STILLHOOK = (sys.executable, "-P", "-m", "stillhook")


def piped(*words: str, errors: bool = False, **environment: str) -> tuple[int, str]:
    """Run a command whose reader takes nothing; return its exit status, and standard error."""
    read, write = os.pipe()
    os.close(read)
    try:
        done = subprocess.run(
            [*STILLHOOK, *words],
            stdout=write,
            stderr=write if errors else subprocess.PIPE,
            env={**os.environ, **environment},
            text=True,
        )
    finally:
        os.close(write)
    return done.returncode, done.stderr or ""


@pytest.mark.skipif(os.name != "posix", reason="pipes of POSIX")
@pytest.mark.parametrize("words", ["cases", "cases --json", "schema", "--version", "check --help"])
def test_a_reader_that_goes_is_no_failure(words):
    assert piped(*words.split()) == (0, "")


@pytest.mark.skipif(os.name != "posix", reason="pipes of POSIX")
@pytest.mark.parametrize("words", ["check no-such-case", "cases --nonsense"])
def test_what_is_wrong_is_told_by_the_status_though_nobody_reads(words):
    assert piped(*words.split(), errors=True) == (2, "")


class Stream(io.TextIOWrapper):
    """Standard output in an encoding, whose bytes can be looked at."""

    def __init__(self, encoding: str, errors: str = "strict") -> None:
        super().__init__(io.BytesIO(), encoding=encoding, errors=errors, write_through=True)

    @property
    def said(self) -> str:
        return self.buffer.getvalue().decode(self.encoding)


@pytest.mark.parametrize(
    ("encoding", "said"),
    [
        ("utf-8", "\u2588\u2264 Kr\u00e4n \u00bd 10\u207b\u00b3 \u8d77 \\xff"),
        ("cp1252", "#<= Kr\u00e4n \u00bd 10-\u00b3 ? \\xff"),
        ("latin-1", "#<= Kr\u00e4n \u00bd 10-\u00b3 ? \\xff"),
        ("cp437", "\u2588\u2264 Kr\u00e4n \u00bd 10-3 ? \\xff"),
        ("ascii", "#<= Kran 1/2 10-3 ? \\xff"),
    ],
)
def test_what_has_no_character_is_written_in_ascii(monkeypatch, encoding, said):
    monkeypatch.setattr(sys, "stdout", Stream(encoding))
    take_any_text()
    print("\u2588\u2264 Kr\u00e4n \u00bd 10\u207b\u00b3 \u8d77 \udcff", end="")
    assert sys.stdout.said == said


def test_what_the_environment_says_of_characters_holds(monkeypatch):
    monkeypatch.setattr(sys, "stdout", Stream("ascii", "replace"))
    take_any_text()
    print("Kr\u00e4n", end="")
    assert sys.stdout.said == "Kr?n"


@pytest.mark.parametrize("encoding", ["utf-8", "cp1252", "ascii"])
def test_json_is_the_same_in_every_encoding(monkeypatch, encoding):
    monkeypatch.setattr(sys, "stdout", Stream(encoding))
    take_any_text()
    text = "Kr\u00e4n \u8d77 \udcff"
    write_json(json.dumps({"name": text}, ensure_ascii=False))
    assert json.loads(sys.stdout.said) == {"name": text}


def test_optimize_is_optimise(run):
    found = run("optimize", "no-such-case")
    assert (found.status, found.err) == (2, run("optimise", "no-such-case").err)
    assert run("--debug", "optimize", "--help").out.startswith("usage: stillhook optimise")
    assert run("check", "optimize").err.startswith("optimize: ")  # a case may be called so
