"""The version, in a file of its own: whoever tells it needs nothing else of the face."""

import json
import re
from pathlib import Path

__version__ = "0.1.0"

_DIGITS = 8  # of a commit: enough to find it


def commit(home: Path | None = None) -> str | None:
    """Return the commit that this code is of, in short; None where neither place tells.

    That is the checkout that the packages stand in, whose changes since then are told by nobody,
    or what was installed from a repository.  `home` is another folder that holds the packages.
    """
    home = Path(__file__).resolve().parent.parent if home is None else home
    try:
        git = home / ".git"
        found = _checked_out(git) if git.exists() else _installed(home)
    except (OSError, ValueError):  # not there, or not as we know it
        return None
    return found[:_DIGITS] if re.fullmatch("[0-9a-f]{40,64}", found) else None


def _checked_out(git: Path) -> str:
    """Return the commit of a checkout from its `.git`, without running git."""
    if git.is_file():  # of a worktree: says where it is kept
        git = git.parent / git.read_text(encoding="utf-8").removeprefix("gitdir:").strip()
    head = git.joinpath("HEAD").read_text(encoding="utf-8").strip()
    if not head.startswith("ref: "):
        return head
    name, common = head.removeprefix("ref: "), git / "commondir"
    shared = git / common.read_text(encoding="utf-8").strip() if common.is_file() else git
    for place in (git / name, shared / name):
        if place.is_file():
            return place.read_text(encoding="utf-8").strip()
    packed = shared.joinpath("packed-refs").read_text(encoding="utf-8")
    return next(
        (line[: -len(name)].strip() for line in packed.splitlines() if line.endswith(f" {name}")),
        "",
    )


def _installed(home: Path) -> str:
    """Return the commit that pip was sent to (PEP 610)."""
    from importlib.metadata import PackageNotFoundError, distribution

    try:
        ours = distribution("stillhook")
    except PackageNotFoundError:
        return ""
    told = ours.read_text("direct_url.json")
    if told is None or Path(str(ours.locate_file(""))).resolve() != home:
        return ""
    return str(json.loads(told).get("vcs_info", {}).get("commit_id", ""))
