"""`stillhook vessel`: RAOs from a file or from a hull, and those that come with the toolkit."""

from __future__ import annotations

import argparse
from importlib import import_module

from ...text import commands, console, pairs, show


def run(arguments: argparse.Namespace) -> int:
    """Run the sub-command, and return its exit status."""
    if arguments.vessel_command == "list":
        return _list()
    status: int = import_module(f".vessel_{arguments.vessel_command}", __package__).run(arguments)
    return status


def _list() -> int:
    from models.vessel.readers import bundled_vessels

    out = console()
    found = bundled_vessels()
    show(pairs(found), out)
    rows = [("look at one", f"stillhook vessel import {name}") for name, _ in found[:1]]
    rows.append(("a vessel from its main dimensions", "stillhook vessel hull --help"))
    commands(rows, out)
    return 0
