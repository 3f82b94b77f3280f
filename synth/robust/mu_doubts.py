"""What is uncertain about a case: which numbers, how far, and the true plant at any of them.

case, shares -> Doubts -> deltas, each of -1 to 1 -> case changed -> plant with all sensors
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from models.basics import InputError, PhysicsWarning, check_range
from models.case import Case
from models.plant import LinearPlant, PlantData
from models.sensing import sensed_plant
from models.spread import ALIASES

from .family import Axis, Family, Member

#: Paths of delays, and the measurements that they make late.
DELAYS: Mapping[str, str] = {"sensors.telemetry.delay": "payload.", "sensors.mru.delay": "mru."}
DRAG = "drag"
_MOST = 6  # real parameters at once: 64 corners


@dataclass(frozen=True, kw_only=True)
class Doubt:
    """One uncertain number: its path, its value in the case, how far it may be off.

    ``drag`` is the linear drag coefficient of the design [N s/m]; the others are fields of the
    case.
    """

    path: str
    nominal: float
    half: float

    def at(self, delta: float) -> float:
        """Return the value at delta; 1 is the upper end of the range, -1 the lower one."""
        return self.nominal + self.half * delta

    @property
    def delay(self) -> bool:
        """Whether it is a delay, and so a disc."""
        return self.path in DELAYS

    @property
    def least(self) -> float:
        """The least delta: a delay of nothing can only grow."""
        return 0.0 if self.delay and self.nominal == 0.0 else -1.0

    @property
    def furthest(self) -> float:
        """The delta of either sign at which the value would be zero."""
        return self.nominal / self.half if self.nominal > 0.0 else np.inf


def doubts_of(case: Case, drag: float, uncertainty: Mapping[str, Any]) -> tuple[Doubt, ...]:
    """Return what is uncertain about a case.

    Parameters
    ----------
    case
        The case.
    drag
        Linear drag coefficient of the design [N s/m].
    uncertainty
        By path (or an alias of `synth.robust.family`, or ``drag``): a share of the value, as 0.3
        for 30 % either way, or a text with a unit, as "20 ms" either way.

    Raises
    ------
    InputError
        If there is nothing, a path is unknown or no number, or a share is out of its range.
    """
    if not uncertainty:
        raise InputError("robustness: uncertainty must name what may be off, got nothing")
    found = []
    for name, width in uncertainty.items():
        path = ALIASES.get(name, name)
        own = drag if path == DRAG else _number(case, path)
        if isinstance(width, str):
            half = _number(case.replace({path: width}), path)
        else:
            share = check_range("robustness", f"uncertainty[{name}]", width, low=0.0, open_low=True)
            half = share * own
        if half <= 0.0:
            raise InputError(
                f"robustness: {path} is {own:g} in this case, so a share of it is nothing; give "
                'a value with its unit, as "20 ms"'
            )
        if half >= own and path != DRAG and path not in DELAYS:
            raise InputError(
                f"robustness: {path} must be less uncertain than its value {own:g}, got {half:g}"
            )
        found.append(Doubt(path=path, nominal=own, half=half))
    if len({d.path for d in found}) < len(found):
        raise InputError("robustness: a path is given twice")
    if sum(not d.delay for d in found) > _MOST:
        raise InputError(f"robustness: at most {_MOST} parameters besides delays at once")
    return tuple(found)


def plant_of(
    case: Case, doubts: Sequence[Doubt], delta: Sequence[float], masses: int, drag: float
) -> LinearPlant:
    """Return the true plant at some deltas; the rope's damping time stays the nominal one."""
    values = {d.path: d.at(float(x)) for d, x in zip(doubts, delta, strict=True)}
    drag = values.pop(DRAG, drag)
    axes = tuple(Axis(path=p, values=(v,), continuous=True) for p, v in values.items())
    family = Family(case=case, axes=axes, seas=Family.of(case, {}).seas)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PhysicsWarning)  # the nominal case has told its own
        changed = family.case_at(Member(point=tuple(values.values())))
        data, nominal = PlantData.from_case(changed), PlantData.from_case(case)
        if data.damping_time > 0.0:
            ratio = data.damping_ratio * nominal.damping_time / data.damping_time
            data = replace(data, damping_ratio=min(ratio, 1.0))
        return sensed_plant(data, masses=masses, drag=drag, sensors=changed.sensors)


def _number(case: Case, path: str) -> float:
    """Return the number at a path of the case."""
    found: Any = case
    for part in path.split("."):
        found = getattr(found, part, None)
    if path == "payload.added_mass" and found is None:
        found = case.payload.hydrodynamic_mass
    if isinstance(found, bool) or not isinstance(found, int | float):
        raise InputError(f"robustness: there is no number at {path!r} in this case, got {found!r}")
    return float(found)
