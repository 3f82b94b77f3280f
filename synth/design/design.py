"""`GainDesign`: gains of the payload feedback for a case, with their figures and their check.

A design is plain numbers: the case, the gains, what they achieve and what they cost.  From
case and gains alone everything else can be derived again: the plant, the closed loop, the
spectra (`GainDesign.assessment`), and the independent check (`GainDesign.verify`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from models.case import Case
from models.plant import MEASUREMENTS

from ..loop import Assessment, LinearController, Margins
from ..question import assess_gains
from ..search import Start
from ..verify import Verification, verify_design
from .tuning import LimitUse

if TYPE_CHECKING:
    from ..bound import BestPossible


@dataclass(frozen=True, kw_only=True, eq=False)
class GainDesign:
    """Gains of the payload feedback for a case, and everything they do.

    Attributes
    ----------
    case
        The case asked about.
    gains
        ``A, a, a1, a2`` of u = -A (a P'' + a1 P' + a2 P); with a DC motor u is a voltage [V],
        with an AC motor a speed [rad/s] or a torque [N m].
    ok
        Stable, every enforced limit kept in the sea asked for, and verified.
    status
        The sentence for the user.
    significant_height
        H_s that the figures hold for [m]: the case's own, or the largest feasible one.
    payload_rms, payload_rms_before
        Standard deviation of the payload's motion with these gains and with the drum held [m].
    hook_rms
        Standard deviation of the hook's motion [m].
    margins
        Stability margins of the loop; None if it is unstable.
    limits
        Use of every limit by name.
    drag, drag_before
        Linear drag coefficient with and without compensation [N s/m].
    masses
        Rope masses of the design plant.
    starts, agreed
        The search's starts, and how many agreed on the best answer; empty for given gains.
    required
        What the limits that break would have to be in the sea asked for, by name.
    verification
        The independent check made before the design was handed over.
    """

    case: Case
    gains: Mapping[str, float]
    ok: bool
    status: str
    significant_height: float
    payload_rms: float
    payload_rms_before: float
    hook_rms: float
    margins: Margins | None
    limits: Mapping[str, LimitUse]
    drag: float
    drag_before: float
    masses: int
    starts: tuple[Start, ...] = ()
    agreed: int = 0
    required: Mapping[str, float] = field(default_factory=dict)
    verification: Verification | None = None

    @property
    def feasible(self) -> bool:
        """Whether the figures hold for the sea that the case asks about."""
        return bool(np.isclose(self.significant_height, self.case.sea.significant_height))

    @property
    def payload_significant(self) -> float:
        """Significant double amplitude of the payload's motion, 4 sigma [m]."""
        return 4.0 * self.payload_rms

    @property
    def compensation_db(self) -> float:
        """Payload motion before over after [dB]."""
        return float(20.0 * np.log10(self.payload_rms_before / self.payload_rms))

    @property
    def sea_case(self) -> Case:
        """The case in the sea that the figures hold for."""
        if self.feasible:
            return self.case
        return self.case.replace({"sea.significant_height": self.significant_height})

    @cached_property
    def assessment(self) -> Assessment:
        """The closed loop in numbers: spectra, responses, margins, poles."""
        return assess_gains(self.sea_case, self.gains, masses=self.masses, drag=self.drag)

    @property
    def controller(self) -> LinearController:
        """The gains as a controller, u = +C y."""
        return self.assessment.controller

    @property
    def measurements(self) -> tuple[str, ...]:
        """What the gains hear."""
        return MEASUREMENTS

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

    def verify(self) -> Verification:
        """Check everything that is claimed by code that the optimiser did not use."""
        return verify_design(self)

    def __str__(self) -> str:
        """Return the result as a small tree."""
        gains = ", ".join(f"{name} = {value:.6g}" for name, value in self.gains.items())
        lines = [
            f"GainDesign for {self.case.name}: {self.status}",
            f"├ gains: {gains}",
            f"├ H_s {self.significant_height:.3g} m: payload {1e3 * self.payload_rms:.3g} mm rms, "
            f"{1e3 * self.payload_rms_before:.4g} mm before ({self.compensation_db:.1f} dB)",
        ]
        if self.margins is not None:
            m = self.margins
            lines.append(
                f"├ M_s {m.max_sensitivity:.3g}, phase {np.degrees(m.phase):.1f} deg, "
                f"gain x {m.gain_down:.3g} to x {m.gain:.3g}, delay {1e3 * m.delay:.1f} ms"
            )
        names = list(self.limits)
        for name in names:
            u = self.limits[name]
            mark = "└" if name == names[-1] else "├"
            kind = "" if u.enforced else " (reported only)"
            lines.append(
                f"{mark} {name}: {100 * u.use:.1f} % of {u.bound:.4g} {u.unit}{kind}".rstrip()
            )
        return "\n".join(lines)
