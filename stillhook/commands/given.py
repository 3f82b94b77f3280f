"""The case of a command with its changes, gains as text, and both as words of a command again."""

from __future__ import annotations

import argparse
import shlex
import warnings
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from models.basics import InputError, PhysicsWarning, check_range

from ..text import OutputFolder, told_once

if TYPE_CHECKING:
    from models import Case

_NAMES = ("A", "a", "a1", "a2")
#: What of a plant may be off unless told otherwise, and by which share either way.
USUALLY_OFF = {"payload.mass": 0.3, "stiffness": 0.2, "drag": 0.5}


def given_case(arguments: argparse.Namespace) -> Case:
    """Return the case that the arguments name, with their changes; tell what is implausible.

    Everything about the case that there is to warn of is told here, each thing once, and then
    no more: a search looks at seas and drives that nobody has asked for.

    Raises InputError if the case is wrong, or a change is.
    """
    from models import load_case
    from models.hook import HookMotion

    with told_once():
        case = load_case(arguments.case)
        changes = parse_changes(arguments.set)
        if changes:
            case = case.replace(changes)
        HookMotion.from_case(case)  # warns of a sea beyond the RAO's table
    warnings.simplefilter("ignore", PhysicsWarning)
    return case


def parse_changes(texts: Sequence[str]) -> dict[str, Any]:
    """Return changes by dotted path from texts PATH=VALUE, VALUE as in a case file.

    Raises InputError if a text is not of that form, or a path comes twice.

    Examples
    --------
    >>> parse_changes(["rope.length=800 m", "limits.roll_off=null", "vessel.below=zero"])
    {'rope.length': '800 m', 'limits.roll_off': None, 'vessel.below': 'zero'}
    """
    return read_pairs("--set", "PATH=VALUE, as in rope.length=800", texts)


def parse_members(texts: Sequence[str]) -> list[dict[str, Any]]:
    """Return changes by dotted path from texts PATH=VALUE[;PATH=VALUE..], one for each member.

    Raises InputError if a text is not of that form, or a path comes twice in one.

    Examples
    --------
    >>> parse_members(["rope.damping_ratio=2e-4", "rope.length=800 m; payload.mass=40 t"])
    [{'rope.damping_ratio': 0.0002}, {'rope.length': '800 m', 'payload.mass': '40 t'}]
    """
    form = "PATH=VALUE[;PATH=VALUE..], as in rope.damping_ratio=0.0002"
    return [read_pairs("--member", form, text.split(";")) for text in texts]


def parse_fixed(texts: Sequence[str]) -> dict[str, float]:
    """Return parameters by name from texts NAME=NUMBER.

    Raises InputError if a text is not of that form, a value is no number, or a name comes twice.
    """
    pairs = read_pairs("--fix", "NAME=NUMBER, as in a=0", texts)
    return {name: check_range("--fix", name, value) for name, value in pairs.items()}


def split_pairs(
    option: str, form: str, texts: Sequence[str], *, empty: bool = False
) -> dict[str, str]:
    """Return texts by name from texts NAME=TEXT; `empty` ones if nothing may stand after the sign.

    Messages say the option and its form.

    Raises InputError if a text is not of that form, or a name comes twice.
    """
    found: dict[str, str] = {}
    for text in texts:
        name, sign, value = (part.strip() for part in text.partition("="))
        if not (sign and name and (value or empty)):
            raise InputError(f"{option}: must be {form}, got {text!r}")
        if name in found:
            raise InputError(f"{option}: {name} is given twice")
        found[name] = value
    return found


def read_pairs(option: str, form: str, texts: Sequence[str]) -> dict[str, Any]:
    """Return values by name as `split_pairs` does, each read as in a case file."""
    from models.casefile import read_yaml

    pairs = split_pairs(option, form, texts, empty=True)
    return {name: read_yaml(text, f"{option} {name}")[0] for name, text in pairs.items()}


def parse_gains(text: str, structure: str = "payload-feedback") -> dict[str, float]:
    """Return gains, or the parameters of another structure, by name from a text.

    Raises InputError if one is not a finite number or given twice; if it is unknown or missing
    among the gains of payload feedback, of which `A` may be missing.

    Examples
    --------
    >>> parse_gains("A=200, a=50, a1=100, a2=1e2")
    {'A': 200.0, 'a': 50.0, 'a1': 100.0, 'a2': 100.0}
    """
    plain = structure == "payload-feedback"
    form = "numbers for A, a, a1 and a2, as in A=1,a=0,a1=0,a2=0.5" if plain else "NAME=NUMBER,.."
    pairs: dict[str, Any] = split_pairs("--gains", form, text.split(","), empty=True)
    odd = [f"{name}={value}" for name, value in pairs.items() if plain and name not in _NAMES]
    if odd:
        raise InputError(f"--gains: must be {form}, got {odd[0]!r}")
    gains = {name: check_range("--gains", name, value) for name, value in pairs.items()}
    missing = [name for name in _NAMES[1:] if plain and name not in gains]
    if missing:
        raise InputError(f"--gains: {' and '.join(missing)} must be given too, got {text!r}")
    return gains


def parse_options(texts: Sequence[str]) -> dict[str, Any]:
    """Return options of a scenario from texts KEY=VALUE.

    Raises InputError if a text is not of that form, or a key comes twice.

    Examples
    --------
    >>> parse_options(["height=6 m", "count=3", "lost=mru"])
    {'height': '6 m', 'count': 3, 'lost': 'mru'}
    """
    parts = [text.partition("=") for text in texts]
    plain = [f"{key.replace('-', '_') if sign else key}{sign}{value}" for key, sign, value in parts]
    return read_pairs("--option", "KEY=VALUE, as in 'height=6 m'", plain)


def gains_text(gains: Mapping[str, float]) -> str:
    """Return gains as `parse_gains` reads them, to eight digits: enough to keep the limits."""
    return ",".join(f"{name}={value:.8g}" for name, value in gains.items())


def case_words(arguments: argparse.Namespace, folder: OutputFolder | None = None) -> str:
    """Return the case as words of a command: its name, or with its changes where they are kept.

    `folder` is the output folder that holds the case file, if there is one.
    """
    if not arguments.set:
        return shlex.quote(arguments.case)
    if folder is not None:
        return shlex.quote(str(folder.path / "case.yaml"))
    sets = [f"--set {shlex.quote(change)}" for change in arguments.set]
    return " ".join([shlex.quote(arguments.case), *sets])
