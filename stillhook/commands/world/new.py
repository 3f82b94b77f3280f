"""`stillhook new`: a commented case file that runs as it is."""

import argparse
import os
import shlex
from pathlib import Path

from ...text import Report
from ..declare import options
from ..working import conclude

ARGUMENTS = (options("file  the file to write"),)
EXAMPLES = (
    ("stillhook new my.yaml", "a case of your own to begin with, a comment beside each field"),
)


def run(arguments: argparse.Namespace) -> int:
    """Write the template; return 0."""
    from models import template_text

    path = written(arguments, template_text())
    file = shlex.quote(str(path))
    following = [
        ("every error at once, with its line", f"stillhook check {file}"),
        ("the gains", f"stillhook optimise {file}"),
    ]
    status = "a case that runs as it is; change what is different on your vessel"
    return conclude(Report(name=str(path), status=status), arguments, following=following)


def written(arguments: argparse.Namespace, text: str) -> Path:
    """Write a text into the file that was named, and return its path.

    Raises InputError if it exists and is not to be overwritten.
    """
    from models import write_text_atomically
    from models.basics import InputError

    path = Path(arguments.file)
    if os.path.exists(path) and not arguments.force:
        raise InputError(f"{path}: exists already; --force overwrites it")
    return write_text_atomically(path, text)
