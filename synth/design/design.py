"""`Design`: a controller structure with its parameters for a case, what it does, and its check.

A design is plain numbers: the case, the structure's name, its parameters, what they achieve and
what they cost.  From case and parameters alone everything else can be derived again: the plant, the
closed loop, the spectra (`Design.assessment`), the controller as `LinearFeedback` takes it, and the
independent check (`Design.verify`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from models.basics import InputError, attenuation, residual_text
from models.case import Case
from models.sensing import SET_POINT

from ..loop import Assessment, LinearController, Margins
from ..question import GAINS, HOOK, DesignQuestion, controller_for, difference_text, pose
from ..search import Start
from ..structures import structure_named
from ..verify import Verification, verify_design
from .switched import DRAG_STEP, SwitchedLoop
from .tuning import LimitUse, verified_members

if TYPE_CHECKING:
    from ..bound import BestPossible

#: What shares call the losses of gear and dry friction, which switch with the direction.
SWITCHING_LOSS = "switching.loss"
#: What disturbances are called in reports; others by their own names.
SOURCE_NAMES: Mapping[str, str] = {
    HOOK: "the sea",
    "mru.error": "the reference unit",
    SET_POINT: "losses of gear and dry friction",
}
_PRICED = 1e-5  # a price below this share of the payload's rms is noise of the solver


@dataclass(frozen=True, kw_only=True, eq=False)
class Design:
    """A controller for a case, and everything it does.

    Attributes
    ----------
    case, structure
        The case asked about, and the name of the structure (`synth.structures.structure_names`).
    parameters, units
        The structure's parameters and their units by name; of payload feedback the thesis's
        ``A, a, a1, a2`` of u = -A (a P'' + a1 P' + a2 P), where with a DC motor u is a voltage
        [V], with an AC motor a speed [rad/s] or a torque [N m].  Empty if none were found.
    ok
        Stable, every enforced limit kept in the sea asked for, and verified.
    status
        The sentence for the user.
    significant_height
        H_s that the figures hold for [m]: the case's own, or the largest feasible one.
    payload_rms, payload_rms_before
        Standard deviation of the payload's motion with this controller and with the drum held
        [m].
    hook_rms
        Standard deviation of the hook's motion [m].
    shares
        By signal (the payload's motion and whatever the limits speak of), by disturbance (the sea
        ``hook.heave``, the reference unit ``mru.error``, each sensor's ``.._noise``, in the drive
        the ``switching.loss`` of gear and dry friction, and what of it shakes the loop and is no
        friction, noise on the ``drive.set_point``): the standard deviation that this one alone
        makes; the squares add up to the signal's variance.
    margins
        Stability margins of the loop broken at the command; None if it is unstable.
    limits
        Use and price of every limit by name.
    drag, drag_before
        Linear drag coefficient with and without compensation [N s/m].
    friction
        What losses that switch with the direction come to as viscous friction at the motor
        [N m s/rad].
    masses
        Rope masses of the design plant.
    starts, agreed
        The search's starts, and how many agreed on the best answer; empty for given parameters.
    required
        What the limits that break would have to be in the sea asked for, by name.
    drive_kept
        Whether the limits of the drive were part of the search; else they cannot be kept in any
        sea, and the figures are those of a drive that is large enough.
    verification
        The independent check made before the design was handed over.
    alternatives
        Designs of other structures that were looked at besides.
    members, objective
        What the same controller does in each further member of the family that it was made for,
        and what was made small over all of them (``worst``, ``mean`` or ``regret``).
    exhibit
        What it does with the least damping that the rope may have, where that is reported only:
        of a case whose rope follows Kelvin and Voigt's law.  It is not verified.
    fixed
        Names of the parameters that were held.
    built_for
        The case whose motor and drum the controller is built for, where that is another.
    """

    case: Case
    structure: str
    parameters: Mapping[str, float]
    units: Mapping[str, str]
    ok: bool
    status: str
    significant_height: float
    payload_rms: float
    payload_rms_before: float
    hook_rms: float
    shares: Mapping[str, Mapping[str, float]]
    margins: Margins | None
    limits: Mapping[str, LimitUse]
    drag: float
    drag_before: float
    masses: int
    starts: tuple[Start, ...] = ()
    agreed: int = 0
    required: Mapping[str, float] = field(default_factory=dict)
    drive_kept: bool = True
    verification: Verification | None = None
    alternatives: tuple[Design, ...] = ()
    members: tuple[Design, ...] = ()
    objective: str = "worst"
    exhibit: Design | None = None
    fixed: tuple[str, ...] = ()
    built_for: Case | None = None
    friction: float = 0.0

    @property
    def feasible(self) -> bool:
        """Whether the figures hold for the sea that the case asks about."""
        return bool(np.isclose(self.significant_height, self.case.sea.significant_height))

    @property
    def family_rms(self) -> float:
        """Payload's rms over all members: the worst, or for the mean the root mean square [m]."""
        every = [one.payload_rms for one in (self, *self.members)]
        return float(np.sqrt(np.mean(np.square(every)))) if self.objective == "mean" else max(every)

    @property
    def payload_significant(self) -> float:
        """Significant double amplitude of the payload's motion, 4 sigma [m]."""
        return 4.0 * self.payload_rms

    @property
    def residual(self) -> float:
        """Payload's motion over the hook's."""
        return self.payload_rms / self.hook_rms

    @property
    def residual_held(self) -> float:
        """Payload's motion over that with the drum held."""
        return self.payload_rms / self.payload_rms_before

    @property
    def attenuation(self) -> float:
        """Hook's motion over the payload's [dB]."""
        return attenuation(self.residual)

    @property
    def attenuation_held(self) -> float:
        """Payload's motion with the drum held over that with this controller [dB]."""
        return attenuation(self.residual_held)

    @property
    def gains(self) -> Mapping[str, float]:
        """The gains ``A, a, a1, a2`` where the structure has them, else nothing."""
        return {name: self.parameters[name] for name in GAINS if name in self.parameters}

    @property
    def sea_case(self) -> Case:
        """The case in the sea that the figures hold for."""
        if self.feasible:
            return self.case
        return self.case.replace({"sea.significant_height": self.significant_height})

    @cached_property
    def question(self) -> DesignQuestion:
        """The question in the sea that the figures hold for."""
        return pose(self.sea_case, self.structure, self.masses, built_for=self.built_for)

    @cached_property
    def controller(self) -> LinearController:
        """The controller in state space, u = +C y, as `LinearFeedback` takes it.

        Raises InputError if no controller was found.
        """
        return controller_for(self.built_for or self.case, self.structure, self._known)

    @property
    def _known(self) -> Mapping[str, float]:
        if not self.parameters:
            raise InputError(f"{self.structure}: the design has no controller: {self.status}")
        return self.parameters

    @property
    def measurements(self) -> tuple[str, ...]:
        """What the structure hears."""
        return structure_named(self.structure, self.built_for or self.case).measurements

    @cached_property
    def assessment(self) -> Assessment:
        """The closed loop in numbers: spectra, responses, margins, poles.

        Raises InputError if no controller was found.
        """
        known = self.question.coefficients_of(self.drag, self.friction)
        return self.question.assess(self._known, known)

    @cached_property
    def switched(self) -> SwitchedLoop:
        """Deviations and most probable extremes, with the losses in them that switch.

        The limits have the loss in full beside k sigma and are on the safe side of these.
        """
        dragged = self.question.coefficients_of(DRAG_STEP * self.drag, self.friction)
        return SwitchedLoop(
            loop=self.assessment,
            dragged=self.question.assess(self._known, dragged),
            question=self.question,
            friction=self.friction,
        )

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
        """Names of the limits that have a price, the highest first."""
        used = [u for u in self.limits.values() if u.price > _PRICED * self.payload_rms]
        return tuple(u.name for u in sorted(used, key=lambda u: -u.price))

    @property
    def at_bounds(self) -> tuple[str, ...]:
        """Names of the parameters that stand at a bound, where the answer would go on."""
        found: list[str] = []
        law = self.question.law
        values = self.question.values(self.parameters) if self.parameters else ()
        for p, value in zip(law.parameters if values else (), values, strict=True):
            room = 1e-4 * (p.high - p.low) if np.isfinite(p.high - p.low) else 0.0
            if p.low > 0.0 and np.isfinite(p.high):
                at = min(value / p.low - 1.0, 1.0 - value / p.high) < 2e-3
            else:
                at = min(value - p.low, p.high - value) < room
            found += [p.name] if at else []
        return tuple(found)

    def verify(self) -> Verification:
        """Check all that is claimed, in every member, by code that the optimiser did not use."""
        stable = [one for one in (self, *self.members) if one.margins is not None]
        return verified_members([verify_design(one) for one in stable or [self]])

    def __str__(self) -> str:
        """Return the result as a small tree."""
        lines = [
            f"Design {self.structure} for {self.case.name}: {self.status}",
            f"├ H_s {self.significant_height:.3g} m: payload {1e3 * self.payload_rms:.4g} mm rms, "
            f"hook {1e3 * self.hook_rms:.4g} mm, with the drum held "
            f"{1e3 * self.payload_rms_before:.4g} mm",
            f"├ {residual_text(self.residual, self.residual_held)}",
        ]
        lines += [f"├ {k} = {v:.6g} {self.units.get(k, '')}" for k, v in self.parameters.items()]
        if self.margins is not None:
            m = self.margins
            lines.append(
                f"├ M_s {m.max_sensitivity:.3g}, phase {np.degrees(m.phase):.1f} deg, "
                f"gain x {m.gain_down:.3g} to {m.most_gain}, delay {m.delay_text}"
            )
        for u in self.limits.values():
            kind = "" if u.enforced else " (reported only)"
            lines.append(f"├ {u.name}: {100 * u.use:.1f} % of {u.bound:.4g} {u.unit}{kind}")
        for member in (*self.members, *([self.exhibit] if self.exhibit is not None else [])):
            told = difference_text(self.case, member.case)
            figures = f"payload {1e3 * member.payload_rms:.4g} mm rms"
            if member.margins is None:
                figures = member.status
            else:
                figures += f", M_s {member.margins.max_sensitivity:.3g}"
            kind = " (reported only)" if member is self.exhibit else ""
            lines.append(f"├ {told}: {figures}{kind}")
        lines[-1] = "└" + lines[-1][1:]
        return "\n".join(line.rstrip() for line in lines)
