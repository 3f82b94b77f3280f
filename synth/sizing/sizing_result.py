"""The answer of a sizing: the curve, the chosen winch with its gains, and what the old one does."""

from __future__ import annotations

from dataclasses import dataclass

from models.case import Case

from ..design import StructureDesign
from .catalogue import Choice
from .point import SizePoint


@dataclass(frozen=True, kw_only=True, eq=False)
class Sizing:
    """The answer of `size_winch`.

    Attributes
    ----------
    case, structure
        The case in the sea asked for, its own motor in it, and the controller structure.
    target, hook_rms
        What the payload may move, and what the hook does (rms) [m].
    ok, status
        Whether a motor was found and verified; the sentence for the user.
    unlimited_rms
        What the loop's margins and the sensors alone leave, with a motor without limits [m].
    points
        The smallest motor behind each gear, by ratio.
    chosen, sized_case, design
        The smallest of all; the case with it, its limits enforced; its gains, verified.
    given_rms
        What the payload moves with the case's own motor and gear in that sea [m]; infinite if
        they cannot keep their limits.
    highest_height
        H_s up to which the case's own winch meets the target [m]; 0 if in none that was looked
        at.
    choice
        The motor out of the catalogue, if there is one.
    """

    case: Case
    structure: str
    target: float
    hook_rms: float
    ok: bool
    status: str
    unlimited_rms: float
    points: tuple[SizePoint, ...]
    chosen: SizePoint | None
    sized_case: Case | None
    design: StructureDesign | None
    given_rms: float
    highest_height: float
    choice: Choice | None = None

    def to_csv(self) -> str:
        """Return the smallest motor over the gear as CSV, SI units."""
        lines = ["gear,scale,torque_continuous,torque_peak,power,inertia,payload_rms,limited_by"]
        for p in self.points:
            m = p.motor
            figures = (
                [m.torque_continuous, m.torque_peak, m.power, m.inertia, p.payload_rms]
                if m is not None
                else []
            )
            cells = [f"{v:.8g}" for v in (p.gear, p.scale, *figures)] + [""] * (5 - len(figures))
            lines.append(",".join([*cells, " ".join(p.binding).replace(",", "")]))
        return "\n".join(lines) + "\n"
