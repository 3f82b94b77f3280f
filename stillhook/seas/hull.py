"""A hull as figure and report: its panels from three sides, how it floats and moves."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..text import (
    AFTER,
    BEFORE,
    DRUM,
    REFERENCE,
    Drawing,
    Report,
    ReportSection,
    drawn,
    headline,
    new_figure,
    number,
    pairs,
    percent,
    quantity,
    remarks,
)
from .raos import largest_motions, long_wave_verdict, long_waves, rao_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from models.basics import FloatArray
    from models.vessel.hull import HullVessel
    from models.vessel.readers import LongWaveCheck


@drawn
def hull_figure(vessel: HullVessel) -> Figure:
    """Return the panels of a hull in three views, with its centres.

    Parameters
    ----------
    vessel
        A hull and its loading.
    """
    panels = vessel.hull.panels
    middle = 0.5 * (panels[..., 0].max() + panels[..., 0].min())
    fore = panels[..., 0].mean(axis=1) > middle
    gravity, plane = vessel.loading.centre, vessel.waterplane
    buoyancy = plane.centre_of_buoyancy
    height = gravity[2] + vessel.metacentric_heights[0]
    figure = new_figure(9.6, 5.6)
    grid = figure.add_gridspec(2, 2, width_ratios=[1.0, 2.3])
    ends = figure.add_subplot(grid[0, 0])
    side = figure.add_subplot(grid[0, 1])
    below = figure.add_subplot(grid[1, 1])
    # As on a body plan: the bow on the right, the stern on the left.
    centred = panels[..., 1].mean(axis=1)
    _draw(ends, panels[fore & (centred <= 0.0)] * (1.0, -1.0, 1.0), 1, 2)
    _draw(ends, panels[~fore & (centred >= 0.0)] * (1.0, -1.0, 1.0), 1, 2)
    port = centred >= 0.0
    _draw(side, panels[port], 0, 2)
    _draw(below, panels, 0, 1)
    for axes, column in ((ends, 1), (side, 0)):
        axes.axhline(0.0, color=AFTER, linewidth=1.0)
        for point, colour, mark, name in (
            (gravity, BEFORE, "o", "centre of gravity"),
            (buoyancy, AFTER, "s", "centre of buoyancy"),
        ):
            axes.plot(point[column], point[2], mark, color=colour, markersize=5.0, label=name)
    ends.plot(0.0, height, "^", color=DRUM, markersize=6.0, label="metacentre")
    ends.set_title("stern | bow", fontsize=9.5, color="#555555")
    side.set_title("from port", fontsize=9.5, color="#555555")
    below.set_title("from below", fontsize=9.5, color="#555555")
    ends.set_xlabel("y [m]")
    ends.set_ylabel("z [m]")
    below.set_xlabel("x forward [m]")
    below.set_ylabel("y [m]")
    side.set_ylabel("z [m]")
    for axes in (ends, side, below):
        axes.set_aspect("equal", adjustable="datalim")
        axes.grid(visible=False)
    handles, labels = ends.get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower left", frameon=False)
    finding = (
        f"{vessel.raos.name}: {vessel.loading.mass / 1e3:.0f} t, GM "
        f"{vessel.metacentric_heights[0]:.2f} m, rolls in "
        f"{vessel.natural_periods.roll:.1f} s, {vessel.hull.count} panels"
    )
    return headline(figure, finding)


def hull_report(vessel: HullVessel, check: LongWaveCheck, *, stem: str = "raos") -> Report:
    """Return how a hull floats and moves, and whether its motions can be true.

    `stem` is the name of the figure of its RAOs.
    """
    name = "hull" if stem == "raos" else f"{stem}-hull"
    drawings = [
        Drawing(stem, "RAOs", lambda: rao_figure(vessel.raos)),
        Drawing(name, "The hull", lambda: hull_figure(vessel)),
    ]
    afloat, motions = remarks("afloat", _afloat(vessel)), remarks("motions", _motions(vessel))
    return Report(
        name=vessel.raos.name,
        about=vessel.raos.source,
        status=long_wave_verdict(check),
        mark="ok" if check.ok else "DOUBTFUL",
        sections=[
            ReportSection("", [afloat, motions, pairs(_about(vessel)), *drawings]),
            long_waves(check),
            ReportSection("", [f"note: {warning}" for warning in vessel.warnings]),
        ],
    )


def _afloat(vessel: HullVessel) -> list[tuple[str, str, str]]:
    plane, load = vessel.waterplane, vessel.loading
    keel = plane.draught
    roll, pitch = vessel.metacentric_heights
    buoyancy = plane.centre_of_buoyancy
    return [
        ("displacement", quantity(load.mass, "kg", 4), f"{number(plane.volume, 4)} m3"),
        (
            "length x beam x draught",
            f"{number(plane.length)} x {number(plane.beam)} x {number(plane.draught)} m",
            f"block coefficient {number(plane.block)}",
        ),
        ("waterplane", f"{number(plane.area, 4)} m2", ""),
        (
            "centre of gravity, KG",
            f"{load.centre[2] + keel:.2f} m",
            f"x {load.centre[0]:+.2f} m, above the centre of buoyancy",
        ),
        ("KB + BM", f"{buoyancy[2] + keel:.2f} + {plane.metacentric_radii[0]:.2f} m", ""),
        ("metacentric height, GM", f"{roll:.2f} m", f"of pitch {pitch:.0f} m"),
        (
            "radii of gyration",
            ", ".join(f"{r:.2f}" for r in load.radii) + " m",
            "roll, pitch, yaw",
        ),
    ]


def _motions(vessel: HullVessel) -> list[tuple[str, str, str]]:
    periods = vessel.natural_periods
    omega = vessel.body.hydrodynamics.omega
    rows = []
    for name in ("heave", "roll", "pitch"):
        period = getattr(periods, name)
        inside = omega[0] <= 2.0 * math.pi / period <= omega[-1]
        rows.append(
            (
                f"natural period of {name}",
                quantity(period, "s"),
                "" if inside else "beyond the frequencies computed",
            )
        )
    rows.append(
        (
            "damping of roll added",
            percent(vessel.body.roll_damping),
            f"of critical, {vessel.body.critical_roll_damping / 1e6:.4g} MN m s",
        )
    )
    return rows


def _about(vessel: HullVessel) -> list[tuple[str, str]]:
    raos, body = vessel.raos, vessel.body
    error = body.hydrodynamics.energy_error(body.roll_damping * body.critical_roll_damping)
    found = [
        (
            "table",
            f"{raos.omega.size} frequencies, {raos.omega[0]:.3g} to {raos.omega[-1]:.3g} rad/s, "
            f"{raos.heading.size} headings",
        ),
        (
            "panels",
            f"{vessel.hull.count}" + (", kept from an earlier run" if vessel.kept else ""),
        ),
        ("largest heave, roll, pitch", largest_motions(raos)),
    ]
    if math.isfinite(error):
        found.insert(2, ("waves made and felt", f"agree within {percent(error)}"))
    return found


def _draw(axes: Axes, panels: FloatArray, horizontal: int, vertical: int) -> None:
    """Draw the edges of panels seen along an axis."""
    from matplotlib.collections import PolyCollection

    shape = np.asarray(panels)[..., [horizontal, vertical]]
    axes.add_collection(
        PolyCollection(
            list(shape), facecolors="#e8eef4", edgecolors=REFERENCE, linewidths=0.35, zorder=1
        )
    )
    axes.autoscale_view()
