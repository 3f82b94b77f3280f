"""The highest sea in which a winch as it is meets a target.

target, case -> least factor on target and drive (`sea_factor`) -> root over log H_s
"""

from __future__ import annotations

import math

from models.case import Case
from models.hook import HookMotion

from ..search import Progress
from .follow import Answer
from .motor import changed
from .point import sea_factor, target_of

_SEA_STEPS, _SEA_FINE = 8, 2e-3  # of the search
_LOWEST, _HIGHEST = 0.05, 6.0  # of the sea asked for, that are looked at


def highest_sea(
    case: Case,
    structure: str,
    target: float | str,
    *,
    masses: int,
    near: Answer,
    tell: Progress,
) -> float:
    """Return the highest H_s in which the winch of a case meets a target [m]; 0 if none does.

    Parameters
    ----------
    case, structure, target
        The case in the sea asked for, the structure, and the target as `target_of` reads it.
    masses, near
        Rope masses, and an answer to begin from.
    tell
        Called as tell(stage, done, total).
    """
    asked = case.sea.significant_height
    known: list[tuple[float, float]] = []  # logarithms of H_s and of the factor that is missing
    size, answer = 0.0, near
    for k in range(_SEA_STEPS):
        tell("the highest sea for the winch as it is", k, _SEA_STEPS)
        height = asked * math.exp(size)
        sea = changed(case, {"sea.significant_height": height})
        aim = target_of(target, float(HookMotion.from_case(sea).displacement.rms))
        found = sea_factor(case, structure, height, aim, masses=masses, near=answer)
        if found is None:
            if size <= math.log(_LOWEST):
                break
            known.append((size, 10.0))
        else:
            answer = found
            known.append((size, found.solved.extra))
            if abs(found.solved.extra) < _SEA_FINE:
                break
        kept = [s for s, f in known if f <= 0.0]
        below, above = (
            max(kept, default=-math.inf),
            min((s for s, f in known if f > 0.0), default=math.inf),
        )
        over = known[-1][1]
        guess = size - max(-1.0, min(1.0, 1.2 * over))
        if len(known) > 1 and known[-1][1] != known[-2][1]:
            tilt = (known[-1][1] - known[-2][1]) / (known[-1][0] - known[-2][0])
            guess = size - over / tilt if tilt > 0.0 else guess
        if not below < guess < above:
            guess = (
                0.5 * (below + above)
                if math.isfinite(above - below)
                else (above - 1.0 if math.isfinite(above) else below + 1.0)
            )
        size = max(math.log(_LOWEST), min(math.log(_HIGHEST), guess))
        if any(abs(size - s) < 1e-4 for s, _ in known):
            break
    kept = [s for s, f in known if f <= _SEA_FINE]
    return asked * math.exp(max(kept)) if kept else 0.0
