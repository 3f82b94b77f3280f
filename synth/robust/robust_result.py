"""`RobustDesign`: one set of gains for a family, with everything that was asked of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from models.basics import InputError
from models.case import Case

from ..design import LimitUse
from ..loop import LinearController
from ..question import Objective
from .family import Family, Member
from .family_plants import PAYLOAD_FEEDBACK, FamilyPlants
from .perturbation import GainRadius
from .worst_case import DrawCheck


@dataclass(frozen=True, kw_only=True, eq=False)
class ScenarioResult:
    """What the gains do in one scenario.

    Attributes
    ----------
    name, member
        Which it is.
    weight
        Occurrence of its sea.
    payload_rms, payload_rms_before, best_rms
        With these gains, with the drum held, and (for the regret) with gains of its own [m].
    max_sensitivity, gain_down, gain, phase, delay, disk
        Margins of its loop, `synth.loop.margins.Margins`.
    radius
        How far every gain may be off at once [-], and the nearest unstable gains; None for
        structures that are not affine in their gains.
    limits
        Use of every limit by name.
    pressure
        How much of the objective hangs on the scenario; all of them add up to 1.
    verified
        Whether other code confirmed it; None if it was not asked.
    """

    name: str
    member: Member
    weight: float
    payload_rms: float
    payload_rms_before: float
    best_rms: float | None
    max_sensitivity: float
    gain_down: float
    gain: float
    phase: float
    delay: float
    disk: float
    radius: GainRadius | None
    limits: Mapping[str, LimitUse]
    pressure: float
    verified: bool | None = None

    @property
    def tightest(self) -> LimitUse | None:
        """The enforced limit that is used most."""
        enforced = [u for u in self.limits.values() if u.enforced]
        return max(enforced, key=lambda u: u.use, default=None)


@dataclass(frozen=True, kw_only=True, eq=False)
class RobustDesign:
    """One set of gains for a family, with everything that was asked of it.

    Attributes
    ----------
    case, family, objective, structure
        The question.
    ok, status
        Every scenario keeps its limits, nothing in the ranges hurts more, no random draw is
        unstable, and the hardest scenarios were verified; in words.
    parameters
        The gains by name.
    controller
        u = +C y.
    scenarios
        The set of members that was designed for, the worst payload motion first.
    added
        How many of them the search for the worst member added.
    check
        What random draws say.
    plants
        The family as it was posed.
    starts, agreed
        The starts of the first search, and how many arrived at its best answer.
    notes
        What a verification had to say against it.
    """

    case: Case
    family: Family
    objective: Objective
    structure: str
    ok: bool
    status: str
    parameters: Mapping[str, float]
    controller: LinearController | None
    scenarios: tuple[ScenarioResult, ...]
    added: int
    check: DrawCheck | None
    plants: FamilyPlants
    starts: int
    agreed: int
    notes: tuple[str, ...] = ()

    @property
    def gains(self) -> Mapping[str, float]:
        """The gains as `synth.evaluate_gains` takes them, for payload feedback."""
        if self.structure != PAYLOAD_FEEDBACK:
            raise InputError(f"gains: a {self.structure} has parameters, see `parameters`")
        return {"A": self.plants.nominal.amplifier, **self.parameters}

    @property
    def worst(self) -> ScenarioResult:
        """The scenario with the largest payload motion."""
        return self.scenarios[0]

    @property
    def mean_rms(self) -> float:
        """Root of the occurrence-weighted mean square of the payload's motion [m]."""
        squares = np.array([s.payload_rms**2 for s in self.scenarios])
        weights = np.array([s.weight for s in self.scenarios])
        return float(np.sqrt(weights @ squares / weights.sum()))

    def __str__(self) -> str:
        """Return a small tree."""
        gains = ", ".join(f"{name} = {value:.6g}" for name, value in self.parameters.items())
        lines = [f"RobustDesign for {self.case.name}: {self.status}", f"├ {gains}"]
        for s in self.scenarios[:6]:
            lines.append(f"├ {s.name}: {1e3 * s.payload_rms:.4g} mm, M_s {s.max_sensitivity:.3f}")
        if len(self.scenarios) > 6:
            lines.append(f"├ and {len(self.scenarios) - 6} more scenarios")
        lines.append(f"└ {self.check}" if self.check is not None else "└ no random draws")
        return "\n".join(lines)
