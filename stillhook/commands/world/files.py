"""`stillhook cases`, `stillhook new` and `stillhook schema`: what comes with the toolkit."""

from __future__ import annotations

import argparse
import json
import shlex
from pathlib import Path

from models import bundled_cases, case_schema, template_text, write_text_atomically
from models.basics import InputError

from ...text import commands, console, pairs, show


def run(arguments: argparse.Namespace) -> int:
    """Run the command that the arguments name; return 0."""
    {"cases": _cases, "new": _new, "schema": _schema}[arguments.command](arguments)
    return 0


def _cases(arguments: argparse.Namespace) -> None:
    del arguments
    show(pairs(bundled_cases()), console())


def _new(arguments: argparse.Namespace) -> None:
    path = _write(arguments, template_text())
    out = console()
    out.print(
        f"{path}: a case that runs as it is; change what is different on your vessel",
        soft_wrap=True,
    )
    file = shlex.quote(str(path))
    commands(
        [
            ("every error at once, with its line", f"stillhook check {file}"),
            ("the gains", f"stillhook optimise {file}"),
        ],
        out,
    )


def _schema(arguments: argparse.Namespace) -> None:
    text = json.dumps(case_schema(), indent=2, ensure_ascii=False) + "\n"
    if arguments.file is None:
        # Not through rich, which would break its long lines.
        import sys

        sys.stdout.write(text)
        return
    path = _write(arguments, text)
    console().print(
        f"{path}: begin a case file with `# yaml-language-server: $schema={path}`", soft_wrap=True
    )


def _write(arguments: argparse.Namespace, text: str) -> Path:
    path = Path(arguments.file)
    if path.exists() and not arguments.force:
        raise InputError(f"{path}: exists already; --force overwrites it")
    return write_text_atomically(path, text)
