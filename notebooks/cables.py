"""Which rope length and which payload are the hard ones: the cable study.

    case x lengths x payloads -> K, M, C, omega_n, peak |G|, payload rms -> the worst case

Before a winch is designed somebody has to say for which load and depth.  With the drum held the
ship's motion reaches the payload as G = P/Y; its resonance moves with length and mass, through
the sea's spectrum.  The 1975 thesis looked at six such cables (Figures 6 to 11) and designed for
the worst.

The worst is the one that moves most in the case's own sea.  The height of |G| alone would not
tell: with a given C its peak, about sqrt(K M)/C, is highest on the shortest rope, whose resonance
no wave meets.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.basics import InputError
from models.case import Case
from models.hook import HookMotion
from models.plant import PlantData, fixed_top_modes
from synth.loop import refine_minima
from synth.question import locked_response, uncompensated

__all__ = ["Cable", "CableStudy", "cable_study"]


@dataclass(frozen=True, kw_only=True)
class Cable:
    """One rope with its payload, the drum held.

    Attributes
    ----------
    case
        The case of this rope and payload.
    length, payload_mass
        Length paid out [m]; mass in air [kg].
    stiffness, moving_mass
        K [N/m] and M, the payload with its added mass and the rope's share [kg].
    drag
        C by the case's own rule [N s/m].
    natural_frequency
        First axial mode, undamped [rad/s].
    peak, peak_frequency
        Largest |G| = |P/Y| [-], and where [rad/s]; infinite without damping.
    payload_rms
        Standard deviation of the payload's motion in the case's sea [m].
    """

    case: Case
    length: float
    payload_mass: float
    stiffness: float
    moving_mass: float
    drag: float
    natural_frequency: float
    peak: float
    peak_frequency: float
    payload_rms: float


@dataclass(frozen=True, kw_only=True)
class CableStudy:
    """All cables of a study; printed as a table, the worst one marked.

    Attributes
    ----------
    case
        The case that lengths and payloads were put into.
    cables
        One for each length and payload, lengths varying slowest.
    """

    case: Case
    cables: tuple[Cable, ...]

    @property
    def worst(self) -> Cable:
        """The cable whose payload moves most in the case's sea."""
        return max(self.cables, key=lambda cable: cable.payload_rms)

    def __str__(self) -> str:
        """Return the table."""
        lines = [
            "  length  payload        K        M        C  omega_n  peak |G|  payload rms",
            "     [m]      [t]   [kN/m]      [t] [N s/m]  [rad/s]       [-]          [m]",
        ]
        for cable in self.cables:
            lines.append(
                f"{cable.length:8.0f} {cable.payload_mass / 1e3:8.1f} "
                f"{cable.stiffness / 1e3:8.1f} {cable.moving_mass / 1e3:8.1f} "
                f"{cable.drag:7.0f} {cable.natural_frequency:8.3f} {cable.peak:9.2f} "
                f"{cable.payload_rms:12.3f}{'  <- worst' if cable is self.worst else ''}"
            )
        return "\n".join(lines)


def cable_study(
    case: Case,
    lengths: Sequence[float] | None = None,
    payloads: Sequence[float] | None = None,
) -> CableStudy:
    """Return how rope length and payload change what the ship's motion does to the load.

    Parameters
    ----------
    case
        Sea, vessel, rope and payload; its `payload.drag` says how C is found, its
        `rope.lumping` whether the rope is one spring or has axial modes.
    lengths
        Lengths paid out [m]; the case's own if left out.
    payloads
        Masses in air [kg]; the case's own if left out.  Added mass and submerged weight
        change in proportion, the area stays.

    Raises
    ------
    InputError
        If there is nothing to study, or a length or a mass is not valid in the case.
    """
    lengths = [case.rope.length] if lengths is None else list(lengths)
    payloads = [case.payload.mass] if payloads is None else list(payloads)
    if not lengths or not payloads:
        raise InputError("cable study: lengths and payloads must have at least one value each")
    hook = HookMotion.from_case(case)
    cables = tuple(
        _cable(_with(case, length, mass), hook) for length in lengths for mass in payloads
    )
    return CableStudy(case=case, cables=cables)


def _with(case: Case, length: float, mass: float) -> Case:
    payload = case.payload
    share = mass / payload.mass
    return case.replace(
        {
            "rope.length": length,
            "payload.mass": mass,
            "payload.added_mass": share * payload.hydrodynamic_mass,
            "payload.submerged_weight": share * payload.submerged_weight,
        }
    )


def _cable(case: Case, hook: HookMotion) -> Cable:
    data = PlantData.from_case(case)
    drag, rms = uncompensated(case, data, hook)
    natural = _first_mode(case, data)
    peak, at = _peak(case, drag, natural)
    return Cable(
        case=case,
        length=case.rope.length,
        payload_mass=case.payload.mass,
        stiffness=case.rope.stiffness,
        moving_mass=case.moving_mass,
        drag=drag,
        natural_frequency=natural,
        peak=peak,
        peak_frequency=at,
        payload_rms=rms,
    )


def _first_mode(case: Case, data: PlantData) -> float:
    """Return the first axial mode [rad/s]: of the one spring, or of the exact rope."""
    if data.lumping == "thesis":
        return math.sqrt(data.stiffness / case.moving_mass)
    rope = (data.axial_stiffness, data.rope_length, data.mass_per_length)
    return float(fixed_top_modes(*rope, data.payload_mass, 1)[0])


def _peak(case: Case, drag: float, natural: float) -> tuple[float, float]:
    """Return the largest |G| and where it is: by the first mode, or at rest if overdamped."""
    if drag == 0.0 and case.rope.damping_ratio == 0.0:
        return np.inf, natural
    # Dense at the mode, whose width may be a thousandth of its frequency.
    offsets = np.concatenate([[0.0], np.geomspace(1e-8, 0.5, 300)])
    grid = natural * np.unique(np.concatenate([[1e-6], 1.0 - offsets, 1.0 + offsets]))
    at, least = refine_minima(
        lambda omega: 1.0 / np.abs(locked_response(case, omega, drag)),
        grid,
        1.0 / np.abs(locked_response(case, grid, drag)),
    )
    best = int(np.argmin(least))
    return float(1.0 / least[best]), float(at[best])
