"""The best design of a case (`best_design`) for whoever names none: found once, and kept.

    case [, structure] --> best_design --> cache, or optimise_gains --> Design

Several commands ask the same of the same case, and a search takes half a minute.  Its answer is
kept in the user's cache folder, as a design file under a digest of all that it depends on: the
case, the structure and the code.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from models.basics import InputError, cache_folder, keep_latest
from models.case import Case
from synth.design import Design

from ..keeper import versions
from .design_file import load_design, save_design

if TYPE_CHECKING:
    from ..text import Progress

KEPT = 64  #: How many designs are kept; those longest unused go first.


def best_design(
    case: Case, structure: str | None = None, *, progress: Progress | None = None
) -> Design:
    """Return what `synth.optimise_gains` answers for a case: from the cache, where it is there.

    Without a structure's name it is of those that the case's sensors allow.

    Raises InputError as by `synth.optimise_gains`.
    """
    from synth import optimise_gains

    place = _place(case, structure)
    with contextlib.suppress(InputError):  # none there, or not whole
        found = replace(load_design(place), case=case)
        with contextlib.suppress(OSError):
            os.utime(place)
        return found
    found = optimise_gains(case, structure, progress=progress)
    keep_best(found, case, structure)
    return found


def keep_best(found: Design, case: Case, structure: str | None) -> None:
    """Keep what `synth.optimise_gains` answered for a case and a structure, asked as by default."""
    place = _place(case, structure)
    with contextlib.suppress(OSError, InputError):
        place.parent.mkdir(parents=True, exist_ok=True)
        save_design(found, place)
        keep_latest(place.parent, "*.yaml", KEPT)


def _place(case: Case, structure: str | None) -> Path:
    about = {
        "case": case.to_dict(),
        "structure": structure,
        "versions": versions("synth.design.optimise"),
    }
    digest = hashlib.sha256(json.dumps(about, sort_keys=True).encode()).hexdigest()[:40]
    return cache_folder() / "designs" / f"{digest}.yaml"
