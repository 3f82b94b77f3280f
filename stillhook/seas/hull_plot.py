"""The picture of a hull: its panels from ahead and astern, from the side and from below."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..text import AFTER, BEFORE, DRUM, REFERENCE, new_figure, styled, typeset

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from models.basics import FloatArray
    from models.vessel.hull import HullVessel


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
    with styled():
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
        figure.suptitle(typeset(finding), x=0.012, ha="left", fontsize=11.0, weight="bold")
    return figure


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
