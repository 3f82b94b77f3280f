"""`StructureDesign`: the best controller of a structure for a case, with figures and check.

`synth.design.structure_search` makes it; it can be checked again, saved
(`stillhook.designs.design_file`) and simulated: its controller is what
`synth.controllers.linear_feedback.LinearFeedback` takes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from models.case import Case

from ..loop import LinearController, Margins
from ..question import HOOK, StructureQuestion, pose_structure
from ..search import Found
from ..verify import Verification, verify_structure
from .tuning import LimitUse, Tuning

if TYPE_CHECKING:
    from ..bound import BestPossible

#: What disturbances are called in reports; others by their own names.
SOURCE_NAMES: Mapping[str, str] = {HOOK: "the sea", "mru.error": "the reference unit"}


@dataclass(frozen=True, kw_only=True, eq=False)
class StructureDesign:
    """The best controller of a structure for a case, and everything it does.

    Attributes
    ----------
    case, structure
        The case, and the name of the structure.
    ok
        Stable, every enforced limit kept, and verified.
    status
        The sentence for the user.
    parameters, units
        The structure's parameters and their units by name.
    payload_rms, payload_rms_before, hook_rms
        Standard deviation of the payload's motion, of that with the drum held, and of the
        hook's motion [m].
    parts
        What each disturbance alone leaves of the payload's motion [m]; the squares add up to
        that of `payload_rms`.
    margins, limits
        Margins of the loop broken at the command; use of every limit by name.
    drag, drag_before
        Linear drag coefficient with and without compensation [N s/m].
    masses
        Rope masses of the design plant.
    starts, agreed
        How many starts the search had, and how many agreed on the answer.
    drive_kept
        Whether the limits of the drive were part of the search (else: they cannot be kept, and
        the figures are those of a drive that is large enough).
    verification
        The independent check made before the design was handed over.
    """

    case: Case
    structure: str
    ok: bool
    status: str
    parameters: Mapping[str, float]
    units: Mapping[str, str]
    payload_rms: float
    payload_rms_before: float
    hook_rms: float
    parts: Mapping[str, float]
    margins: Margins | None
    limits: Mapping[str, LimitUse]
    drag: float
    drag_before: float
    masses: int
    starts: int = 0
    agreed: int = 0
    drive_kept: bool = True
    verification: Verification | None = None

    @cached_property
    def posed(self) -> StructureQuestion:
        """The question that it answers."""
        return pose_structure(self.case, self.structure, self.masses)

    @property
    def sea_case(self) -> Case:
        """The case in the sea that the figures hold for."""
        return self.case

    @property
    def controller(self) -> LinearController:
        """The controller in state space, u = +C y, as `LinearFeedback` takes it.

        Raises
        ------
        KeyError
            If no controller was found.
        """
        law = self.posed.law
        return law.controller([self.parameters[p.name] for p in law.parameters])

    @property
    def measurements(self) -> tuple[str, ...]:
        """What the structure hears."""
        return self.posed.plant.measurements

    @cached_property
    def bound(self) -> BestPossible:
        """The best that any linear controller could do, computed when it is asked for.

        Raises
        ------
        InputError
            If the loop is unstable.
        SolverError
            If there is no bound.
        """
        from ..bound import bound_for

        return bound_for(self)

    @property
    def binding(self) -> tuple[str, ...]:
        """Names of the limits that have a price, dearest first."""
        used = [u for u in self.limits.values() if u.price > 1e-5 * self.payload_rms]
        return tuple(u.name for u in sorted(used, key=lambda u: -u.price))

    @property
    def at_bounds(self) -> tuple[str, ...]:
        """Names of the parameters that stand at a bound, where the answer would go on."""
        found = []
        for p in self.posed.law.parameters if self.parameters else ():
            room = 1e-4 * (p.high - p.low) if np.isfinite(p.high - p.low) else 0.0
            value = self.parameters[p.name]
            if p.low > 0.0 and np.isfinite(p.high):
                at = min(value / p.low - 1.0, 1.0 - value / p.high) < 2e-3
            else:
                at = min(value - p.low, p.high - value) < room
            found += [p.name] if at else []
        return tuple(found)

    def tuning(self) -> Tuning:
        """Return the answer as one of `synth.design.tuning`, for checks and for simulations."""
        posed = self.posed
        enforced = [*posed.limits, *(posed.drive if self.drive_kept else ())]
        problem = posed.problem(enforced)
        return Tuning(
            problem=problem,
            ok=self.ok,
            status=self.status,
            cost=self.payload_rms,
            parameters=self.parameters,
            controller=self.controller if self.parameters else None,
            margins=self.margins,
            limits=self.limits,
            coefficient=self.drag if problem.drag is not None else None,
            assessment=None,
            found=Found(solved=None, excess=0.0),
        )

    def verify(self) -> Verification:
        """Check everything claimed by other code, and the loop on twice the rope masses.

        Returns
        -------
        synth.verify.verification.Verification
        """
        return verify_structure(self)

    def __str__(self) -> str:
        """Return a small tree."""
        lines = [
            f"StructureDesign {self.structure} for {self.case.name}: {self.status}",
            f"├ payload {1e3 * self.payload_rms:.4g} mm rms, with the drum held "
            f"{1e3 * self.payload_rms_before:.4g} mm, hook {1e3 * self.hook_rms:.4g} mm",
        ]
        lines += [
            f"├ from {SOURCE_NAMES.get(name, name)}: {1e3 * rms:.4g} mm"
            for name, rms in self.parts.items()
        ]
        lines += [f"├ {k} = {v:.6g} {self.units.get(k, '')}" for k, v in self.parameters.items()]
        for use in self.limits.values():
            kind = "" if use.enforced else " (reported only)"
            lines.append(f"├ {use.name}: {100 * use.use:.1f} % of {use.bound:.4g} {use.unit}{kind}")
        if self.margins is not None:
            m = self.margins
            lines.append(f"├ M_s {m.max_sensitivity:.3f}, delay margin {m.delay:.4g} s")
        lines[-1] = "└" + lines[-1][1:]
        return "\n".join(lines)
