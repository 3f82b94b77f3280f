"""A run in pictures: hook, drum, rope and payload at some moments, against the earth.

Time runs to the right, height is drawn to one scale: a hook that heaves by a metre above a payload
that stays within millimetres looks like just that.  The rope is too long to be drawn; its middle
is left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import numpy.typing as npt

from models.basics import FloatArray, InputError
from models.operation import Scenario
from models.run import Run

from ..text import (
    AFTER,
    BROKEN,
    DASHED,
    DRUM,
    HOOK,
    REFERENCE,
    Axes,
    Figure,
    drawn,
    headline,
    panel,
    quantity,
)
from .window import Window, moves, whole_of, window_of

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.transforms import Affine2DBase, Transform

_SHOTS = 8
_WAVES = 2.2  # periods of the hook's motion that a strip of a payload at rest shows
_SLACK = 1.0  # [N]
_HULL, _SEA, _GROUND = "#b8bec4", "#56b4e9", "#8c6d46"
# Of the drawing of the ship [inch].
_WIDTH, _RADIUS, _BOX = 0.62, 0.15, 0.2


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """Where everything is over a part of a run, in the heights of one drawing [m]."""

    time: FloatArray  #: Times (n,) [s].
    #: Heights of both (n,); the hook's place at rest is at `offset`, the payload's at 0.
    hook: FloatArray
    payload: FloatArray
    angle: FloatArray  #: Angle that the drum has turned, hauling in positive (n,) [rad].
    tension: FloatArray  #: Tension at the drum (n,) [N].
    slack: npt.NDArray[np.bool_]  #: Whether the rope is slack (n,).
    #: Heights of a seabed or deck, and of the water's surface (n,); None where there is none.
    ground: FloatArray | None
    water: FloatArray | None
    asked: FloatArray  #: Height that is asked of the payload (n,).
    offset: float  #: Height at which the hook is drawn at rest.

    @classmethod
    def of(cls, run: Run, window: Window, scenario: Scenario | None = None) -> Scene:
        """Return the scene of a part of a run; the scenario says where the water is.

        Raises InputError if the run has no stored samples in that part.
        """
        rows = window.rows(run.time)
        time = run.time[rows]
        if time.size < 2:
            raise InputError(f"strip: the run with seed {run.seed} has no time traces to draw")

        def of_run(name: str) -> FloatArray:
            values = run[name][rows] if name in run else np.zeros(time.size)
            return np.where(np.isfinite(values), values, 0.0)

        heave, payload = of_run("hook.heave"), of_run("payload.displacement")
        ground = payload - of_run("contact.gap") if "contact.gap" in run else None
        water = None
        surroundings = scenario.surroundings if scenario is not None else None
        if surroundings is not None and surroundings.water is not None:
            water = of_run("water.surface") - surroundings.water.below
        lowest = min(float(a.min()) for a in (payload, ground, water) if a is not None)
        highest = max(float(a.max()) for a in (payload, ground, water) if a is not None)
        room = 0.35 * max(highest - lowest, float(np.ptp(heave)), 1e-3)
        return cls(
            time=time,
            hook=heave + highest - float(heave.min()) + room,
            payload=payload,
            angle=of_run("drum.haul") / run.case.haul_radius,
            tension=of_run("rope.tension"),
            slack=of_run("rope.minimum_tension") <= _SLACK,
            ground=ground,
            water=water,
            asked=of_run("reference.displacement"),
            offset=highest - float(heave.min()) + room,
        )

    @property
    def bottom(self) -> float:
        """The lowest height of the drawing [m]."""
        lowest = min(
            float(a.min()) for a in (self.payload, self.ground, self.water) if a is not None
        )
        return lowest - 0.18 * (self.top - lowest)

    @property
    def top(self) -> float:
        """The highest height of the drawing [m], with room for the ship."""
        lowest = min(float(self.payload.min()), 0.0)
        return float(self.hook.max()) + 0.12 * (float(self.hook.max()) - lowest)


@drawn
def strip(run: Run, scenario: Scenario | None = None) -> Figure:
    """Return pictures of a run at some moments, side by side.

    They are of some waves about the worst moment, or of all of an operation.  Heights [m] over time
    [s]; the scenario says where the water's surface is.

    Raises InputError if the run has no stored samples.
    """
    period = run.statistics["hook.heave"].period
    waves = max(_WAVES * (10.0 if math.isnan(period) else period), 5.0)
    window = whole_of(run) if moves(run) else window_of(run, length=waves)
    scene = Scene.of(run, window, scenario)
    figure, axes = panel(10.4, 5.0)
    _background(axes, scene)
    time = scene.time
    axes.plot(time, scene.hook, color=HOOK, linewidth=1.0, alpha=0.7)
    axes.plot(time, scene.payload, color=AFTER, linewidth=1.2, alpha=0.7)
    if np.ptp(scene.asked) > 0.0:
        axes.plot(time, scene.asked, color=REFERENCE, linewidth=1.0, linestyle=DASHED)
    span = float(time[-1] - time[0])
    # Half a picture of room at both ends: the ship is to the left of its rope.
    shots = np.linspace(time[0] + 0.09 * span, time[-1] - 0.02 * span, _SHOTS)
    for at in np.searchsorted(time, shots):
        _station(axes, float(time[at]), scene, int(at))
        label = quantity(float(scene.tension[at]), "N")
        # Clear of the box, of the ship, and of the place where the rope is broken.
        middle = 0.4 * float(scene.hook[at]) + 0.6 * float(scene.payload[at])
        axes.annotate(
            "slack" if scene.slack[at] else label,
            (time[at], middle),
            xytext=(5, 0),
            textcoords="offset points",
            fontsize=9.0,
            color=BROKEN if scene.slack[at] else REFERENCE,
            verticalalignment="center",
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 1.0},
            zorder=6,
        )
    axes.set_xlim(float(time[0]), float(time[-1]) + 0.03 * span)
    _height_axis(axes, scene)
    axes.set_xlabel("time [s]")
    about = f"{run.case.name}, {run.scenario}, {run.controller}, seed {run.seed}"
    return headline(figure, _finding(scene), f"{about}: {window.why}")


def _station(axes: Axes, x: float, scene: Scene, at: int) -> None:
    """Draw ship, drum, rope and payload at a moment, the rope at `x`."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Circle, Polygon, Rectangle
    from matplotlib.transforms import Affine2D, ScaledTranslation

    inches = axes.figure.dpi_scale_trans

    def at_height(height: float) -> Transform:
        # In inches from a point of the drawing: the ship keeps its shape at any scale of time.
        place = ScaledTranslation(x, height, cast("Affine2DBase", axes.transData))
        transform: Transform = Affine2D() + inches + place
        return transform

    hook, payload = float(scene.hook[at]), float(scene.payload[at])
    slack, turned = bool(scene.slack[at]), float(scene.angle[at])
    ship, load = at_height(hook), at_height(payload)
    broken = at_height(0.55 * hook + 0.45 * payload)
    centre = (-0.5 * _WIDTH, -0.12 + _RADIUS)
    deck = -0.12
    hull = [(-_WIDTH - 0.06, deck), (-0.08, deck), (-0.14, deck - 0.13), (-_WIDTH, deck - 0.13)]
    rope: dict[str, Any] = {
        "color": BROKEN if slack else REFERENCE,
        "linestyle": ":" if slack else "-",
    }
    spokes = [turned + k * 2.0 * math.pi / 3.0 for k in range(3)]

    def line(
        ends: tuple[float, ...], heights: tuple[float, ...], width: float, order: int, **style: Any
    ) -> Line2D:
        placed = {"transform": ship} | style
        return Line2D(ends, heights, linewidth=width, zorder=order, **placed)

    top = centre[1] + _RADIUS
    wheel: Any = {"facecolor": "white", "edgecolor": DRUM, "linewidth": 1.8, "zorder": 5}
    box: Any = {"facecolor": AFTER, "edgecolor": "white", "linewidth": 0.6, "zorder": 5}
    plates: Any = {"facecolor": _HULL, "edgecolor": REFERENCE, "linewidth": 0.8, "zorder": 4}
    cut: Any = {"color": REFERENCE, "transform": broken}
    artists: list[Artist] = [
        Line2D([x, x], [hook, payload], linewidth=1.2, zorder=3, **rope),
        # The rope is too long to be drawn: a gap between two strokes.
        Rectangle((-0.05, -0.03), 0.1, 0.06, color="white", transform=broken, zorder=3),
        *(line((-0.05, 0.05), (y - 0.02, y + 0.02), 0.9, 3, **cut) for y in (-0.03, 0.03)),
        Polygon(hull, transform=ship, **plates),
        line((-0.2, 0.0), (deck, 0.0), 1.8, 4, color=REFERENCE),
        line((centre[0], 0.0), (top, 0.0), 1.2, 4, **rope),
        Circle(centre, _RADIUS, transform=ship, **wheel),
        *(
            line(
                (centre[0], centre[0] + _RADIUS * math.cos(angle)),
                (centre[1], centre[1] + _RADIUS * math.sin(angle)),
                1.0 if k else 2.2,  # the thick spoke shows how far the drum has turned
                5,
                color=DRUM,
            )
            for k, angle in enumerate(spokes)
        ),
        Rectangle((-0.5 * _BOX, 0.0), _BOX, _BOX, transform=load, **box),
    ]
    for artist in artists:
        axes.add_artist(artist)
        artist.set_clip_on(False)


def _height_axis(axes: Axes, scene: Scene) -> None:
    """Set the limits of a drawing's height, and mark those of the payload and of the hook."""
    from matplotlib.ticker import MaxNLocator

    axes.set_ylim(scene.bottom, scene.top)
    step = MaxNLocator(nbins=8, steps=[1, 2, 5, 10]).tick_values(scene.bottom, scene.top)
    each = float(step[1] - step[0])
    places, labels = [], []
    for values, offset in ((scene.payload, 0.0), (scene.hook, scene.offset)):
        low = min(0, round((float(values.min()) - offset) / each))
        high = max(0, round((float(values.max()) - offset) / each))
        for mark in range(low, high + 1):
            places.append(mark * each + offset)
            labels.append(f"{mark * each:.6g}".replace("-", "\u2212"))
    axes.set_yticks(places, labels)
    axes.set_ylabel("payload, and hook above it [m]")


def _background(axes: Axes, scene: Scene) -> None:
    """Draw what stands still: the places at rest, the ground, the water."""
    for height in (0.0, scene.offset):
        axes.axhline(height, color=REFERENCE, linewidth=0.8, alpha=0.6)
    if scene.water is not None:
        axes.fill_between(
            scene.time, scene.water, scene.bottom, color=_SEA, alpha=0.25, linewidth=0
        )
        axes.plot(scene.time, scene.water, color=_SEA, linewidth=1.2)
    if scene.ground is not None:
        axes.fill_between(
            scene.time, scene.ground, scene.bottom, color=_GROUND, alpha=0.35, linewidth=0.0
        )
        axes.plot(scene.time, scene.ground, color=_GROUND, linewidth=1.5)
    axes.grid(visible=False)


def _finding(scene: Scene) -> str:
    hook, payload = float(np.ptp(scene.hook)), float(np.ptp(scene.payload - scene.asked))
    text = f"The hook moves over {quantity(hook, 'm')}, the payload strays over"
    if np.ptp(scene.asked) > 0.0:
        return f"{text} {quantity(payload, 'm')} about what is asked"
    return f"{text} {quantity(payload, 'm')}"
