"""Common parts of the figures of operability: colours of limits, the steepest seas, axes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from models.basics import GRAVITY, FloatArray
from synth.operability import AtDepth, Criterion, Operability

from ..text import REFERENCE, headline, quantity

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from synth.operability import Contour


# Colour and dashes of each limit: the same in every figure.
_LINES: dict[str, tuple[str, Any]] = {
    "payload": ("#0072b2", "-"),
    "motor.torque.peak": ("#e69f00", "-"),
    "motor.torque.continuous": ("#e69f00", (0, (5, 2))),
    "motor.speed.peak": ("#009e73", "-"),
    "motor.voltage.peak": ("#56b4e9", "-"),
    "motor.current.peak": ("#b8860b", (0, (1, 1.2))),
    "motor.current.continuous": ("#b8860b", (0, (5, 2, 1, 2))),
    "motor.power.peak": ("#cc79a7", "-"),
    "rope.tension.peak": ("#444444", "-"),
    "rope.tension.least": ("#444444", (0, (5, 2))),
    "stability": ("#000000", (0, (1, 1))),
}
_STEEP = "#9a9a9a"
SHADE = "#cfe3f1"
DEGREES = 180.0 / math.pi
_FAR = 3.0  # times what can be reached: beyond, a limit is not shown


def limit_text(criterion: Criterion) -> str:
    """Return a limit with its bound, as ``motor speed 2000 rpm``."""
    if criterion.limit is None:
        return criterion.label
    bound = (
        quantity(criterion.bound, "rpm")
        if criterion.unit == "rad/s"
        else quantity(criterion.bound, criterion.unit)
    )
    kind = {"payload.rms": " rms", "payload.significant": " sign.", "payload.max": " max."}
    return f"{criterion.label} {bound}{kind.get(criterion.name, '')}"


def line_of(name: str) -> tuple[str, Any]:
    """Return the colour and the dashes of a limit's line."""
    return _LINES.get(name) or _LINES.get(name.partition(".")[0]) or (REFERENCE, "-")


def pale(name: str) -> tuple[float, float, float]:
    """Return the colour of a limit, lighter where its line is dashed, to fill areas with."""
    from matplotlib.colors import to_rgb

    colour, dashes = line_of(name) if name else ("#f0f0f0", "-")
    red, green, blue = to_rgb(colour)
    mixed = 0.15 if dashes == "-" else 0.5
    return tuple(c + (1.0 - c) * mixed for c in (red, green, blue))  # type: ignore[return-value]


def own_heading(study: Operability, contour: Contour) -> int:
    """Return the row of the case's own heading, or of the nearest."""
    heading = getattr(study.case.vessel, "heading", None)
    if contour.headings is None or heading is None:
        return 0
    return int(np.abs(np.angle(np.exp(1j * (contour.headings - heading)))).argmin())


def steepest(periods: FloatArray) -> FloatArray:
    """Return the H_s above which seas of a period are not observed [m] (DNV-RP-C205, 3.5.4)."""
    share = np.clip((periods - 8.0) / 7.0, 0.0, 1.0)
    slope = 1.0 / 15.0 + share * (1.0 / 25.0 - 1.0 / 15.0)
    return np.asarray(slope * GRAVITY * periods**2 / (2.0 * math.pi))


def top_of(
    periods: FloatArray, envelopes: list[FloatArray], others: FloatArray | None = None
) -> float:
    """Return the upper end of an axis of H_s: room above what can be reached, and no more.

    The next limit above is shown too, if it is not far away.
    """
    reached = max(float(np.minimum(e, steepest(periods)).max()) for e in envelopes)
    room = 1.5 * reached
    if others is not None:
        near = np.where(others < steepest(periods), others, np.inf).min(axis=1)
        above = np.sort(near[near > room])
        if above.size and above[0] < _FAR * reached:
            room = 1.15 * float(above[0])
    return max(room, 0.1)


def shade(axes: Axes, periods: FloatArray, limit: FloatArray) -> None:
    """Shade the seas that are workable: below the limit, and not steeper than seas are."""
    if periods.size > 1:
        T = np.linspace(periods[0], periods[-1], 400)
        # Lines that leave for infinity do so between two periods.
        below = np.interp(T, periods, np.minimum(limit, 1e3))
        axes.fill_between(T, 0.0, np.minimum(below, steepest(T)), color=SHADE, linewidth=0.0)


def limit_line(
    axes: Axes, periods: FloatArray, heights: FloatArray, top: float, colour: Any, **style: Any
) -> None:
    """Draw a limit of H_s over the period, up to somewhat above the figure's `top`."""
    axes.plot(periods, np.minimum(heights, 2.0 * top), color=colour, **style)


def draw_steepest(axes: Axes, periods: FloatArray, top: float) -> None:
    """Draw the steepest seas of each period."""
    T = np.linspace(periods[0], periods[-1], 100)
    if steepest(T).min() < top:
        axes.plot(T, steepest(T), color=_STEEP, linestyle=":", linewidth=1.2, label="steepest seas")


def periods_axis(axes: Axes, periods: FloatArray) -> None:
    """Make the x axis that of peak periods."""
    axes.set_xlabel(r"peak period $T_p$ [s]")
    if periods.size > 1:
        axes.set_xlim(periods[0], periods[-1])


def titled(figure: Figure, study: Operability, at: AtDepth | None, finding: str) -> Figure:
    """Set what the figure found as its title, and what it is about in small below; return it.

    `at` is the length of rope; None where the figure shows several.
    """
    gamma = f", gamma {study.case.sea.gamma}" if study.case.sea.spectrum == "jonswap" else ""
    about = f"{study.case.name}: {study.case.sea.spectrum}{gamma}"
    if at is not None:
        about += f", {at.rope.length:g} m of rope"
    if study.headings is not None:
        h = own_heading(study, study.depths[0].main)
        about += f", heading {float(study.headings[h]) * DEGREES:.0f} deg"
    return headline(figure, finding, about)
