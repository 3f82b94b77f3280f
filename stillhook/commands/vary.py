"""Ranges, lists, choices and seas as text on the command line.

--vary rope.length=500..1500     the range, tried at its ends and in between
--vary payload.mass=40t,50t,60t  the range, tried at these values
--vary 'rope.masses=4|8'         these values and nothing between
--seas '1.5/8, 2.5/9:0.3'        H_s/T_p, and after a colon the occurrence
"""

from collections.abc import Sequence
from typing import Any

from models.basics import InputError
from models.casefile import read_yaml
from models.sea import read_scatter
from synth.robust import DiscreteValues, SeaState, sea_states

from .given import split_pairs


def parse_vary(texts: Sequence[str]) -> dict[str, list[Any] | DiscreteValues]:
    """Return values by path from texts PATH=LOW..HIGH, PATH=A,B,.. or PATH=A|B|..

    Raises InputError if a text has none of these forms, or a path comes twice.

    Examples
    --------
    >>> parse_vary(["depth=500..1500", "payload=40 t, 60 t"])
    {'depth': [500, 1500], 'payload': ['40 t', '60 t']}
    """
    found: dict[str, list[Any] | DiscreteValues] = {}
    form = "PATH=LOW..HIGH or PATH=A,B,C, as in rope.length=500..1500"
    for path, value in split_pairs("--vary", form, texts).items():
        if "|" in value:
            found[path] = DiscreteValues(*(_read(part, path) for part in value.split("|")))
        elif ".." in value:
            found[path] = [_read(part, path) for part in value.split("..")]
            if len(value.split("..")) != 2:
                raise InputError(f"--vary: {path} must be LOW..HIGH, got {value!r}")
        else:
            found[path] = [_read(part, path) for part in value.split(",")]
    return found


def parse_seas(text: str | None, scatter: str | None) -> list[SeaState] | None:
    """Return sea states from a text or a scatter table; None for the case's own sea.

    Raises InputError if both are given, or one of them cannot be read.

    Examples
    --------
    >>> [str(sea) for sea in parse_seas("1.5/8, 2.5/9:0.3", None)]
    ['H_s 1.5 m, T_p 8 s', 'H_s 2.5 m, T_p 9 s']
    """
    if text is not None and scatter is not None:
        raise InputError("--seas and --scatter: must be one or the other, got both")
    if scatter is not None:
        return sea_states(read_scatter(scatter))
    if text is None:
        return None
    states = []
    for part in text.split(","):
        sea, _, share = part.partition(":")
        height, _, period = sea.partition("/")
        try:
            states.append(
                SeaState(
                    significant_height=float(height),
                    peak_period=float(period),
                    occurrence=float(share) if share.strip() else 1.0,
                )
            )
        except ValueError as error:
            if isinstance(error, InputError):
                raise
            raise InputError(
                f"--seas: must be H_s/T_p[:occurrence], as in 1.5/8:0.4, got {part.strip()!r}"
            ) from None
    return states


def _read(text: str, path: str) -> Any:
    value, _ = read_yaml(text.strip(), f"--vary {path}")
    return value
