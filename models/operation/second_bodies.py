"""What moves beside the hook: a supply boat's deck and the water's surface, in the sea of a case.

Motions of the surroundings of a scenario (`models.plant.surroundings`,
`models.operation.scenarios`), by the same means as the hook's own: a spectrum times an RAO, drawn
from a seed.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..basics import GRAVITY
from ..hook import Encounter, HookMotion
from ..vessel import HeaveRao
from .excitation import HOOK, SECOND_BODY, SpectrumMotion

if TYPE_CHECKING:
    from ..case import Case


def boat_motion(case: Case, cut_off: float = 0.9) -> SpectrumMotion:
    """Return the heave of a supply boat's deck in the sea of a case.

    An illustrative small boat: it follows waves that are long against it and not those that are
    short, |RAO| = 1/sqrt(1 + (omega/omega_c)^8).  Its waves have the spectrum of the case but are
    drawn by themselves: how far it lies from the vessel is not known.

    Parameters
    ----------
    case
        Its sea.
    cut_off
        omega_c [rad/s]; 0.9 rad/s is a wave of 76 m, the length of a supply boat.
    """
    omega = np.linspace(0.1, 4.0, 40) * cut_off
    amplitude = 1.0 / np.sqrt(1.0 + (omega / cut_off) ** 8)
    rao = HeaveRao(omega=omega, amplitude=amplitude, below="unity", beyond="decay")
    return SpectrumMotion(hook=_in_the_sea_of(case, rao), purpose=SECOND_BODY)


def surface_motion(case: Case, side: float) -> SpectrumMotion:
    """Return the water's surface under the hook, averaged over the payload's plan.

    Its waves are those that move the hook, whose RAO refers to the wave at the hook.  Long-crested
    waves of wave number k over a side a average to sin(ka/2)/(ka/2); from the first zero on there
    is nothing left of them.

    Parameters
    ----------
    case
        Its sea.
    side
        Side a of the payload's plan along the waves [m].
    """
    half = np.linspace(0.0, math.pi, 64)[1:]
    omega = np.sqrt(2.0 * GRAVITY * half / side)
    amplitude = np.maximum(np.sinc(half / math.pi), 0.0)
    rao = HeaveRao(omega=omega, amplitude=amplitude, below="unity", beyond="zero")
    return SpectrumMotion(hook=_in_the_sea_of(case, rao), purpose=HOOK)


def _in_the_sea_of(case: Case, rao: HeaveRao) -> HookMotion:
    """Return a motion in the waves of a case, as they are met where its vessel is."""
    met = Encounter.from_case(case, hook=False)
    return HookMotion(sea=case.sea.to_spectrum(), rao=rao, encounter=met)
