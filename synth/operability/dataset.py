"""Operability contours as an xarray Dataset and as a table of text: `dataset_of`, `table_text`."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from models.case import Case

from .contour import Contour
from .depths import STAGES, AtDepth

if TYPE_CHECKING:
    import xarray as xr

_SUFFIX = {"loop": "", "held": "_held", "perfect": "_perfect", "reoptimised": "_reoptimised"}
# Of a rope: variable, attribute of `RopeState`, unit, words.
_ROPE = (
    ("rope_length", "length", "m", "rope paid out"),
    ("drum_layer", "layer", "1", "layer of the drum, 1 the bare drum; 0 not known"),
    ("drum_radius", "radius", "m", "pitch radius of the drum"),
    ("static_torque", "torque", "N m", "motor torque at rest, with losses"),
    ("static_tension", "tension", "N", "rope tension at the winch at rest"),
    ("stiffness", "stiffness", "N/m", "stiffness of the rope"),
)


def dataset_of(case: Case, depths: Sequence[AtDepth], status: str) -> xr.Dataset:
    """Return the contours of a case, at each length of rope asked for, as a Dataset.

    Dimensions are ``rope_length`` (where lengths were asked for), ``limit``, ``heading`` (where the
    vessel has headings) and ``peak_period``.  A limit that a system does not have is NaN; one that
    is kept up to the highest H_s looked at is infinite.
    """
    import xarray as xr

    names = _names(depths)
    main = depths[0].main
    many = len(depths) > 1
    turns = main.headings is not None
    tail = (*(("heading",) if turns else ()), "peak_period")
    lead = ("rope_length",) if many else ()
    variables: dict[str, Any] = {}
    for system, words in STAGES.items():
        if system not in depths[0].contours:
            continue
        contours = [at.contours[system] for at in depths]
        every = np.array([_by_limit(contour, names) for contour in contours])
        lowest = np.array([contour.limit for contour in contours])
        binding = np.array([contour.binding for contour in contours]).astype(object)
        drag = np.array([contour.drag for contour in contours])
        end = _SUFFIX[system]
        text = f"limiting significant wave height {words}"
        for name, values, dims, unit, long_name in (
            ("height_limit", every, ("limit", *tail), "m", f"{text}, by limit"),
            ("height", lowest, tail, "m", text),
            ("binding", binding, tail, "", f"limit that binds {words}"),
            ("drag", drag, tail, "N s/m", f"drag coefficient at the limit {words}"),
        ):
            shown = values if turns else values.squeeze(axis=-2)
            notes = ({"units": unit} if unit else {}) | {"long_name": long_name}
            variables[f"{name}{end}"] = ((*lead, *dims), shown if many else shown[0], notes)
    if "loop" in depths[0].contours:
        peaks = np.array([at.max_sensitivity for at in depths])
        about = {"units": "1", "long_name": "sensitivity peak M_s of the design's loop"}
        variables["max_sensitivity"] = (lead, peaks if many else peaks[0], about)
    variables |= _shares(depths, lead)
    first = {c.name: c for n in depths[0].contours.values() for c in n.criteria}
    coordinates: dict[str, Any] = {
        "limit": ("limit", names, {"long_name": "limit"}),
        "bound": ("limit", [first[n].bound for n in names], {"long_name": "bound, in `unit`"}),
        "unit": ("limit", [first[n].unit for n in names], {"long_name": "unit of the bound"}),
    }
    about = {"units": "s", "long_name": "peak period T_p"}
    coordinates["peak_period"] = ("peak_period", main.periods, about)
    if main.headings is not None:
        about = {
            "units": "degree",
            "long_name": "heading: where the waves travel to, counter-clockwise from the bow",
        }
        coordinates["heading"] = ("heading", np.degrees(main.headings), about)
    coordinates |= _ropes(depths, many)
    attributes = {
        "title": f"Operability of {case.name}",
        "case": case.to_yaml(),
        "sea": case.sea.spectrum,
        "exposure_time": case.limits.exposure_time,
        "highest_height": main.highest,
        "status": status,
    }
    if not turns:
        attributes["headings"] = "none: the vessel is given by the heave of its hook alone"
    return xr.Dataset(variables, coords=coordinates, attrs=attributes)


def table_text(depths: Sequence[AtDepth]) -> str:
    """Return contours as CSV: a line for each length of rope, system, heading and period."""
    names = _names(depths)
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    head = "rope_length_m drum_layer system heading_deg peak_period_s height_m binding"
    writer.writerow([*head.split(), *(f"{name}_height_m" for name in names)])
    for at in depths:
        for system, contour in at.contours.items():
            every = _by_limit(contour, names)
            headings = np.degrees([] if contour.headings is None else contour.headings)
            for h in range(contour.limit.shape[0]):
                heading = f"{headings[h]:.6g}" if headings.size else ""
                for p, period in enumerate(contour.periods):
                    row = [f"{at.rope.length:g}", at.rope.layer or "", system, heading]
                    row += [f"{period:.6g}", _figure(contour.limit[h, p])]
                    row += [str(contour.binding[h, p])]
                    writer.writerow([*row, *(_figure(v) for v in every[:, h, p])])
    return out.getvalue()


def _figure(value: float) -> str:
    return "" if np.isnan(value) else f"{value:.6g}"


def _by_limit(contour: Contour, names: list[str]) -> Any:
    """Return the heights of a contour by all names (l, h, p), NaN where it has no such limit."""
    rows = {c.name: contour.heights[k] for k, c in enumerate(contour.criteria)}
    nothing = np.full(contour.limit.shape, np.nan)
    return np.array([rows.get(name, nothing) for name in names])


def _ropes(depths: Sequence[AtDepth], many: bool) -> dict[str, Any]:
    return {
        name: (
            ("rope_length",) if many else (),
            [getattr(at.rope, field) for at in depths] if many else getattr(depths[0].rope, field),
            {"units": unit, "long_name": text},
        )
        for name, field, unit, text in _ROPE
    }


def _names(depths: Sequence[AtDepth]) -> list[str]:
    """Return the names of all criteria, each once."""
    found = (c.name for at in depths for n in at.contours.values() for c in n.criteria)
    return list(dict.fromkeys(found))


def _shares(depths: Sequence[AtDepth], lead: tuple[str, ...]) -> dict[str, Any]:
    """Return the workable shares as variables; none without a scatter diagram."""
    found: dict[str, Any] = {}
    for system, words in STAGES.items():
        if system not in depths[0].workable:
            continue
        shares = [at.workable[system] for at in depths]
        end = _SUFFIX[system]
        about = {"units": "1", "long_name": f"share of the time workable {words}"}

        def put(name: str, dims: tuple[str, ...], values: list[Any], about: dict[str, str]) -> None:
            found[name] = ((*lead, *dims), values if lead else values[0], about)

        put(f"workable{end}", (), [s.share for s in shares], about)
        if shares[0].best_heading is not None:
            text = {**about, "long_name": f"{about['long_name']}, best heading in each sea"}
            put(f"workable_best_heading{end}", (), [s.best_heading for s in shares], text)
            values = [list(s.by_heading.values()) for s in shares]
            text = {**about, "long_name": f"{about['long_name']}, one heading all year"}
            put(f"workable_by_heading{end}", ("heading",), values, text)
        if shares[0].by_month:
            values = [[s.by_month.get(m, np.nan) for m in range(1, 13)] for s in shares]
            text = {**about, "long_name": f"{about['long_name']}, by month"}
            put(f"workable_by_month{end}", ("month",), values, text)
    return found
