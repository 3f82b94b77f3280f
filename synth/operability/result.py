"""Result of an operability study, with the question it answers: `Operability`.

Its contours are there as an xarray Dataset and as a table of text too.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from models.basics import FloatArray, digits_apart
from models.case import Case
from models.sea import Scatter, breaking_height

from ..design import Design
from ..limits import Limit
from ..search import KEPT
from .contour import Contour
from .depths import STAGES, AtDepth
from .recheck import ContourCheck, recheck

if TYPE_CHECKING:
    import xarray as xr

_CHECKS = 3


@dataclass(frozen=True, kw_only=True, eq=False)
class Operability:
    """Limiting significant heights over peak period and heading."""

    case: Case  #: What was asked about.
    design: Design | None  #: None where a case was.
    #: The contours at each length of rope asked for, or at the case's own alone.
    depths: tuple[AtDepth, ...]
    scatter: Scatter | None  #: The scatter diagram, if there is one.
    #: The criteria on the payload's motion; without any the limits are those of the drive and the
    #: rope alone.
    wanted: tuple[Limit, ...]

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
        return min(self.depths, key=lambda d: abs(d.length - self.case.rope.length))

    @property
    def ok(self) -> bool:
        """Whether every criterion is kept in the case's own sea, at its own length of rope.

        The nearest length that was asked for stands for it.  A design is asked as it was made, by
        the same rule and tolerance, so that what is `ok` there is so here.
        """
        return not self.own_depth.own.broken

    @property
    def status(self) -> str:
        """The sentence for the user."""
        at = self.own_depth
        own, limit, period = at.own, at.own.limit, self.case.sea.spectral_peak_period
        sea = f"H_s {self.case.sea.significant_height:.3g} m, T_p {period:.3g} s"
        if self.ok and limit >= at.main.highest:
            return f"nothing binds in the case's own sea, {sea}, nor in any looked at"
        if self.ok and limit >= breaking_height(np.array(period)):
            return f"nothing binds in the case's own sea, {sea}, nor below the steepest seas"
        verdict = "lies within the limit" if self.ok else "is beyond the limit"
        name = own.binding or ", ".join(own.broken)
        return f"the case's own sea, {sea}, {verdict}, H_s {limit:.3g} m, set by {name}"

    @cached_property
    def dataset(self) -> xr.Dataset:
        """Everything as an xarray Dataset, with units and long names; `to_netcdf` writes it.

        Dimensions are ``rope_length`` (where lengths were asked for), ``limit``, ``heading`` (where
        the vessel has headings) and ``peak_period``.  A limit that a system does not have is NaN;
        one that is kept up to the highest H_s looked at is infinite.
        """
        import xarray as xr

        names, main = _names(self.depths), self.depths[0].main
        parts = []
        for at in self.depths:
            parts.append(xr.Dataset(_variables(at, names), coords=_rope(at)))
        found = parts[0]
        if len(parts) > 1:
            own = [name for name in _rope(self.depths[0]) if name != "rope_length"]
            found = xr.concat(parts, "rope_length", data_vars="all", coords=own, join="exact")
        first = {c.name: c for n in self.depths[0].contours.values() for c in n.criteria}
        coordinates: dict[str, Any] = {
            "limit": ("limit", names, {"long_name": "limit"}),
            "bound": ("limit", [first[n].bound for n in names], {"long_name": "bound, in `unit`"}),
            "unit": ("limit", [first[n].unit for n in names], {"long_name": "unit of the bound"}),
        }
        about = {"units": "s", "long_name": "peak period T_p"}
        coordinates["peak_period"] = ("peak_period", main.periods, about)
        attributes = {
            "title": f"Operability of {self.case.name}",
            "case": self.case.to_yaml(),
            "sea": self.case.sea.spectrum,
            "exposure_time": self.case.limits.exposure_time,
            "exceedance": self.case.limits.exceedance,
            "highest_height": main.highest,
            "status": self.status,
        }
        if main.headings is None:
            attributes["headings"] = "none: the vessel is given by the heave of its hook alone"
        else:
            about = {
                "units": "degree",
                "long_name": "heading: where the waves travel to, counter-clockwise from the bow",
            }
            coordinates["heading"] = ("heading", np.degrees(main.headings), about)
        return found.assign_coords(coordinates).assign_attrs(attributes)

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
        over = at.max_sensitivity > bound * (1.0 + KEPT)
        value = f"{at.max_sensitivity:.{digits_apart(at.max_sensitivity, bound)}g}"
        return f"M_s {value}, {'above' if over else 'within'} its limit {bound:g}"

    def verify(self, count: int = _CHECKS) -> tuple[ContourCheck, ...]:
        """Evaluate the design at points of its contour once more, so many at each length of rope.

        Each is `ok` where the binding limit is met to 1e-6; without a design there are none.
        """
        if self.design is None:
            return ()
        found: list[ContourCheck] = []
        for at in self.depths:
            found += recheck(self.design, at, count)
        return tuple(found)

    def to_csv(self) -> str:
        """Return the contours as CSV: a line for each length of rope, system, heading and period.

        It has the limiting H_s, what binds, and the limiting H_s by every limit.
        """
        names = _names(self.depths)
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        head = "rope_length_m drum_layer system heading_deg peak_period_s height_m binding"
        writer.writerow([*head.split(), *(f"{name}_height_m" for name in names)])
        headings = [""]
        if self.headings is not None:
            headings = [f"{degrees:.6g}" for degrees in np.degrees(self.headings)]
        for at in self.depths:
            for system, contour in at.contours.items():
                every = _by_limit(contour, names)
                for h, heading in enumerate(headings):
                    for p, period in enumerate(contour.periods):
                        row = [f"{at.length:g}", at.layer or "", system, heading]
                        row += [f"{period:.6g}", _figure(contour.limit[h, p])]
                        row += [str(contour.binding[h, p])]
                        writer.writerow([*row, *(_figure(v) for v in every[:, h, p])])
        return out.getvalue()

    def __str__(self) -> str:
        """Return a small tree."""
        what = "with the drum held" if self.design is None else "with a design"
        lines = [f"Operability of {self.case.name}, {what}: {self.status}"]
        if self.headings is None:
            lines.append("no headings: the vessel is given by the heave of its hook alone")
        for at in self.depths:
            lines.append(f"rope {at}")
            lines += [f"  {STAGES[n]}: {_range_text(c)}" for n, c in at.contours.items()]
            if self.design is not None:
                lines.append(f"  {self.margin_text(at)}")
            for name, share in at.workable.items():
                turned = (
                    f", {100.0 * share.best_heading:.1f} % in the best heading"
                    if share.best_heading is not None
                    else ""
                )
                lines.append(f"  workable {STAGES[name]}: {100.0 * share.share:.1f} %{turned}")
        marks = ["", *["├ "] * (len(lines) - 2), "└ "]
        return "\n".join(mark + line for mark, line in zip(marks, lines, strict=True))


def _range_text(contour: Contour) -> str:
    """Return the range of a contour, and what binds it."""
    if not np.isfinite(contour.limit).any():
        return f"nothing binds up to H_s {contour.highest:g} m"
    # Limits above the steepest seas bind nothing.
    real = np.isfinite(contour.limit) & (contour.limit < breaking_height(contour.periods))
    if not real.any():
        return "nothing binds below the steepest seas"
    limit = contour.limit[real]
    names, counts = np.unique(contour.binding[real], return_counts=True)
    by = ", ".join(str(names[k]) for k in np.argsort(-counts))
    high = f"{limit.max():.3g} m" if real.all() else "the steepest seas"
    return f"H_s {limit.min():.3g} m to {high}, set by {by}"


def _figure(value: float) -> str:
    return "" if np.isnan(value) else f"{value:.6g}"


def _by_limit(contour: Contour, names: list[str]) -> Any:
    """Return the heights of a contour by all names (l, h, p), NaN where it has no such limit."""
    rows = {c.name: contour.heights[k] for k, c in enumerate(contour.criteria)}
    nothing = np.full(contour.limit.shape, np.nan)
    return np.array([rows.get(name, nothing) for name in names])


def _names(depths: Sequence[AtDepth]) -> list[str]:
    """Return the names of all criteria, each once."""
    found = (c.name for at in depths for n in at.contours.values() for c in n.criteria)
    return list(dict.fromkeys(found))


def _rope(at: AtDepth) -> dict[str, Any]:
    """Return the state of rope and drum as coordinates."""
    case = at.case
    rows: tuple[tuple[str, float, str, str], ...] = (
        ("rope_length", at.length, "m", "rope paid out"),
        ("drum_layer", at.layer, "1", "layer of the drum, 1 the bare drum; 0 not known"),
        ("drum_radius", case.drum_radius, "m", "pitch radius of the drum"),
        ("static_torque", case.static_torque_budget, "N m", "motor torque at rest, with losses"),
        ("static_tension", case.static_tension, "N", "rope tension at the winch at rest"),
        ("stiffness", case.rope.stiffness, "N/m", "stiffness of the rope"),
    )
    return {
        name: ((), value, {"units": unit, "long_name": text}) for name, value, unit, text in rows
    }


def _suffix(system: str) -> str:
    """Return what stands behind the names of a system's variables; nothing for the design's."""
    return "" if system == "loop" else f"_{system}"


def _variables(at: AtDepth, names: list[str]) -> dict[str, Any]:
    """Return the contours and the workable shares with one length of rope as variables."""
    found: dict[str, Any] = {}

    def put(name: str, dims: tuple[str, ...], values: Any, unit: str, long_name: str) -> None:
        found[name] = (dims, values, {"units": unit, "long_name": long_name})

    turns = at.main.headings is not None
    plane = (*(("heading",) if turns else ()), "peak_period")
    for system in (name for name in STAGES if name in at.contours):
        contour, end, words = at.contours[system], _suffix(system), STAGES[system]
        text = f"limiting significant wave height {words}"

        def over(values: Any) -> Any:
            return values if turns else values.squeeze(axis=-2)

        by_limit = over(_by_limit(contour, names))
        put(f"height_limit{end}", ("limit", *plane), by_limit, "m", f"{text}, by limit")
        put(f"height{end}", plane, over(contour.limit), "m", text)
        about = {"long_name": f"limit that binds {words}"}
        found[f"binding{end}"] = (plane, over(contour.binding.astype(object)), about)
        text = f"drag coefficient at the limit {words}"
        put(f"drag{end}", plane, over(contour.drag), "N s/m", text)
    if "loop" in at.contours:
        text = "sensitivity peak M_s of the design's loop"
        put("max_sensitivity", (), at.max_sensitivity, "1", text)
    for system in (name for name in STAGES if name in at.workable):
        share, end = at.workable[system], _suffix(system)
        text = f"share of the time workable {STAGES[system]}"
        put(f"workable{end}", (), share.share, "1", text)
        if share.best_heading is not None:
            name, values = f"workable_best_heading{end}", list(share.by_heading.values())
            put(name, (), share.best_heading, "1", f"{text}, best heading in each sea")
            name = f"workable_by_heading{end}"
            put(name, ("heading",), values, "1", f"{text}, one heading all year")
        if share.by_month:
            values = [share.by_month.get(m, np.nan) for m in range(1, 13)]
            put(f"workable_by_month{end}", ("month",), values, "1", f"{text}, by month")
    return found
