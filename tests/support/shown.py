"""What the terminal shows of a report or a table, as text."""

import io

from rich.console import Console

from stillhook.text import show


def terminal_text(item, width=80):
    """Return what `show` writes, without colour."""
    target = io.StringIO()
    plain = {"markup": False, "highlight": False, "emoji": False, "no_color": True}
    show(item, Console(file=target, width=width, **plain))
    return target.getvalue()
