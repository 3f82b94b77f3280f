"""Result of an operability study, with the question it answers: `Operability`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from models.basics import FloatArray, InputError
from models.case import Case
from models.sea import Scatter

from ..design import Design
from .contour import Contour
from .criteria import Criterion
from .dataset import dataset_of, table_text
from .depths import STAGES, AtDepth
from .recheck import ContourCheck, recheck
from .workable import Rule, rule_shares

if TYPE_CHECKING:
    import xarray as xr


_CHECKS = 3
_PRESSES = 1e-4  # of a limit: a design that was made to press against it is within


@dataclass(frozen=True, kw_only=True, eq=False)
class Operability:
    """Limiting significant heights over peak period and heading.

    Attributes
    ----------
    case, design
        What was asked about; no design where a case was.
    depths
        The contours at each length of rope asked for, or at the case's own alone.
    scatter
        The scatter diagram, if there is one.
    wanted
        The criteria on the payload's motion; without any the limits are those of the drive and
        the rope alone.
    """

    case: Case
    design: Design | None
    depths: tuple[AtDepth, ...]
    scatter: Scatter | None
    wanted: tuple[Criterion, ...]

    @property
    def periods(self) -> FloatArray:
        """Peak periods (p,) [s]."""
        return self.depths[0].main.periods

    @property
    def headings(self) -> FloatArray | None:
        """Headings (h,) [rad], or None where the vessel has none."""
        return self.depths[0].main.headings

    @property
    def own_depth(self) -> AtDepth:
        """The contours at the length of rope nearest the case's own."""
        return min(self.depths, key=lambda d: abs(d.rope.length - self.case.rope.length))

    @property
    def ok(self) -> bool:
        """Whether the case's own sea lies below the contour, at the case's own length of rope.

        The nearest length that was asked for stands for it, and the nearest heading.
        """
        limit = self._own_limit(self.own_depth.main)
        return bool(self.case.sea.significant_height <= limit * (1.0 + _PRESSES))

    @property
    def status(self) -> str:
        """The sentence for the user."""
        at = self.own_depth
        own, limit = self.case.sea.significant_height, self._own_limit(at.main)
        period = self.case.sea.spectral_peak_period
        sea = f"H_s {own:.3g} m, T_p {period:.3g} s"
        if math.isnan(limit):
            return f"the case's own sea, {sea}, lies outside the contour"
        if limit >= at.main.highest:
            return f"nothing binds in the case's own sea, {sea}, nor in any looked at"
        p = int(np.abs(at.main.periods - period).argmin())
        name = str(at.main.binding[self.own_heading(at.main), p]) or "nothing"
        verdict = "lies within the limit" if self.ok else "is beyond the limit"
        return f"the case's own sea, {sea}, {verdict}, H_s {limit:.3g} m, set by {name}"

    @cached_property
    def dataset(self) -> xr.Dataset:
        """Everything as an xarray Dataset, with units and long names; `to_netcdf` writes it."""
        return dataset_of(self.case, self.depths, self.status)

    def own_heading(self, contour: Contour) -> int:
        """Return the row of the case's own heading, or of the nearest."""
        heading = getattr(self.case.vessel, "heading", None)
        if contour.headings is None or heading is None:
            return 0
        return int(np.abs(np.angle(np.exp(1j * (contour.headings - heading)))).argmin())

    def margin_text(self, at: AtDepth) -> str:
        """Return the sensitivity of the design's loop with a rope, against its limit, in words."""
        bound = self.case.limits.max_sensitivity
        if not math.isfinite(at.max_sensitivity):
            return "the loop is unstable with this rope, at least in small motion"
        over = at.max_sensitivity > bound * (1.0 + 1e-3)
        return f"M_s {at.max_sensitivity:.3g}, {'above' if over else 'within'} its limit {bound:g}"

    def rules(self) -> list[tuple[Rule, float, float]]:
        """Return the operations of the thesis's Table 2, with the shares safe and marginal.

        Raises
        ------
        InputError
            If there is no scatter diagram.
        """
        if self.scatter is None:
            raise InputError("operability: the shares of the rules need a scatter diagram")
        return rule_shares(self.scatter)

    def verify(self, count: int = _CHECKS) -> tuple[ContourCheck, ...]:
        """Evaluate the design at points of its contour once more, by single evaluations.

        Parameters
        ----------
        count
            Points at each length of rope.

        Returns
        -------
        tuple
            Each `ok` where the binding limit is met to 1e-6; empty without a design.
        """
        if self.design is None:
            return ()
        found: list[ContourCheck] = []
        for at in self.depths:
            found += recheck(self.design, at.contours["loop"], at.columns, count)
        return tuple(found)

    def to_csv(self) -> str:
        """Return the contours as a table, a line for each sea: what binds and every limit."""
        return table_text(self.depths)

    def __str__(self) -> str:
        """Return a small tree."""
        what = "the drum held" if self.design is None else type(self.design).__name__
        lines = [f"Operability of {self.case.name}, {what}: {self.status}"]
        if self.headings is None:
            lines.append("├ no headings: the vessel is given by the heave of its hook alone")
        for at in self.depths:
            lines.append(f"├ rope {at.rope}")
            inner = [f"{STAGES[n]}: {_range_text(c)}" for n, c in at.contours.items()]
            if self.design is not None:
                inner.append(self.margin_text(at))
            for name, share in at.workable.items():
                turned = (
                    f", {100.0 * share.best_heading:.1f} % in the best heading"
                    if share.best_heading is not None
                    else ""
                )
                inner.append(f"workable {STAGES[name]}: {100.0 * share.share:.1f} %{turned}")
            last = at is self.depths[-1]
            if last:
                lines[-1] = "└" + lines[-1][1:]
            bar = " " if last else "│"
            lines += [
                f"{bar} {'└' if k == len(inner) - 1 else '├'} {t}" for k, t in enumerate(inner)
            ]
        return "\n".join(lines)

    def _own_limit(self, contour: Contour) -> float:
        """Return the limit in the case's own sea and heading [m]; NaN off the contour."""
        period = self.case.sea.spectral_peak_period
        if contour.periods.size == 1:
            period = float(contour.periods[0])  # a sea without a period to change has its own
        heading = getattr(self.case.vessel, "heading", None)
        if contour.headings is None or heading is None:
            return float(contour.at([period])[0])
        if contour.headings.size == 1:
            heading = float(contour.headings[0])
        try:
            return float(contour.at([period], [heading])[0])
        except InputError:
            return math.nan


def _range_text(contour: Contour) -> str:
    """Return the range of a contour, and what binds it."""
    finite = contour.limit[np.isfinite(contour.limit)]
    if not finite.size:
        return f"nothing binds up to H_s {contour.highest:g} m"
    names, counts = np.unique(contour.binding[contour.binding != ""], return_counts=True)
    by = ", ".join(str(names[k]) for k in np.argsort(-counts))
    high = f"{finite.max():.3g} m" if finite.size == contour.limit.size else "no limit"
    return f"H_s {finite.min():.3g} m to {high}, set by {by}"
