"""Results of local sensitivity: elasticities, largest first, and designs moved in full.

`elasticity.sensitivity` computes them; figures and commands show them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from models.basics import InputError

from ..design import Design
from ..question import PAYLOAD
from .fixed_design import FixedDesign

FIGURES = ("payload_rms", "max_sensitivity", "torque_rms", "speed_rms")
"""The figures of a design that have elasticities."""


@dataclass(frozen=True, kw_only=True)
class Elasticity:
    """How a design answers to one number."""

    path: str  #: Dotted path of the number in the case, or ``gains.`` and the name of a gain.
    #: What it is now [in its unit, SI]; of a table's column the factor 1.
    value: float
    unit: str
    #: d ln(figure) / d ln(number) [-].  An optimal design often has several peaks of |S| at its
    #: limit; then M_s has a kink, and the slope is that of the peak which moves most.
    payload_rms: float
    max_sensitivity: float
    torque_rms: float
    speed_rms: float
    #: d2 ln(payload_rms) / d ln(number)2 [-]; None where it was not asked for.
    curvature: float | None = None
    #: ``below`` or ``above`` where the number stands at the corner of a table, as a heading at a
    #: row of the vessel's operators: what a smaller or a larger value does; else empty.
    side: str = ""

    @property
    def label(self) -> str:
        """The path, with the side where there are two."""
        return f"{self.path} ({self.side} its corner)" if self.side else self.path

    def predicted(self, share: float) -> float:
        """Return the factor on the payload's rms if the number grows by a share [-]."""
        x = np.log1p(share)
        return float(np.exp(self.payload_rms * x + 0.5 * (self.curvature or 0.0) * x * x))


@dataclass(frozen=True, kw_only=True)
class Moved:
    """A design with one number moved, recomputed in full."""

    #: The number, and the share by which it was moved.
    path: str
    share: float
    payload_rms: float  #: The payload's rms then [m]; infinite if the loop is unstable.
    max_sensitivity: float  #: M_s then [-]; infinite if the loop is unstable.


@dataclass(frozen=True, kw_only=True, eq=False)
class Sensitivity:
    """What matters most to a design; `sensitivity` makes it."""

    design: Design  #: The design asked about.
    payload_rms: float  #: Its figures: [m]
    max_sensitivity: float  #: [-]
    torque_rms: float  #: [N m]
    speed_rms: float  #: [rad/s]
    #: One for every number that has any effect (two at a corner, one for each side), that with the
    #: largest effect on the payload's rms first.
    elasticities: tuple[Elasticity, ...]
    without_effect: tuple[str, ...]  #: Paths of the numbers that do nothing to these figures.
    #: Paths of numbers at which something steps, as the drum's radius does where one more turn of a
    #: thinner rope fits into a layer: they have no elasticity there.
    stepping: tuple[str, ...] = ()

    def __getitem__(self, path: str) -> Elasticity:
        """Return the elasticity of a number by its path; at a corner the larger of the two.

        Raises InputError if there is none.
        """
        for entry in self.elasticities:
            if entry.path == path:
                return entry
        raise InputError(f"sensitivity: {path!r} has no elasticity here")

    @cached_property
    def _fixed(self) -> FixedDesign:
        return FixedDesign.of(self.design)

    def moved(self, share: float = 0.1, paths: Sequence[str] | None = None) -> tuple[Moved, ...]:
        """Recompute the design with numbers, by default the gains, moved one at a time by a share.

        The thesis's Figure 32 has 0.1.

        Raises InputError if a path is unknown, or the number is at the end of its range.
        """
        wanted = [e.path for e in self.elasticities if e.path.startswith("gains.")]
        found = []
        for path in wanted if paths is None else paths:
            moved = self._fixed.with_number(path, 1.0 + share)
            if moved is None:
                raise InputError(f"sensitivity: {path} cannot be moved by {100.0 * share:g} %")
            assessment = moved.assessment()
            rms, peak = np.inf, np.inf
            if assessment is not None:
                rms, peak = assessment.sigma(PAYLOAD), assessment.max_sensitivity
            found.append(Moved(path=path, share=share, payload_rms=rms, max_sensitivity=peak))
        return tuple(found)

    def to_csv(self) -> str:
        """Return all elasticities as a table, one row for each number; zeros included."""
        lines = ["path,value,unit," + ",".join(f"dln({n})/dln(path)" for n in FIGURES)]
        lines[0] += ",d2ln(payload_rms)/dln(path)2,note"
        for e in self.elasticities:
            cells = [repr(float(getattr(e, name))) for name in ("value", *FIGURES)]
            curvature = "" if e.curvature is None else repr(e.curvature)
            note = f"corner: {e.side} its value" if e.side else ""
            lines.append(",".join([e.path, cells[0], e.unit, *cells[1:], curvature, note]))
        lines += [f"{path},,,0,0,0,0,,no effect" for path in self.without_effect]
        lines += [f"{path},,,,,,,,steps at its value" for path in self.stepping]
        return "\n".join(lines) + "\n"

    def __str__(self) -> str:
        """Return a small tree, the largest first."""
        lines = [
            f"Sensitivity of {self.design.case.name}: payload {1e3 * self.payload_rms:.4g} mm rms,"
            f" M_s {self.max_sensitivity:.3g}"
        ]
        shown = [e for e in self.elasticities if abs(e.payload_rms) >= 0.01][:12]
        lines += [f"├ {e.label}: {e.payload_rms:+.3f} % per cent" for e in shown]
        rest = len(self.elasticities) - len(shown)
        lines += [f"├ {path}: steps here, no elasticity" for path in self.stepping]
        lines.append(f"└ {rest} more with less, {len(self.without_effect)} without any")
        return "\n".join(lines)
