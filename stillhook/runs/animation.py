"""A run as a moving picture: ship, drum, rope and payload, and what hook and payload did lately.

The frames are those of `stillhook.runs.strip`, one station at a time, as an animated GIF of a
megabyte or so: it plays in every browser and every talk.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np

from models.operation import Scenario
from models.run import Run

from ..text import AFTER, HOOK, REFERENCE, number, styled
from .strip import Scene, draw_station, height_axis
from .window import Window, moves, whole_of, window_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.artist import Artist

_FEWEST, _MOST = 120, 300  # frames
_RATE = 12.0  # frames per second
_FASTER = 4.0  # than it is, if that many frames will do
_LATELY = 0.4  # part of the picture's time that is shown behind the present
_COLOURS = 48
_DOTS = 84.0  # per inch
_GROUND, _SEA = "#8c6d46", "#56b4e9"


def animation(
    run: Run,
    scenario: Scenario | None = None,
    window: Window | None = None,
    progress: Callable[[float], None] | None = None,
) -> bytes:
    """Return a run as the contents of an animated GIF.

    Parameters
    ----------
    run
        The run, with its traces.
    scenario
        What was asked of it: says where the water's surface is.
    window
        What to show; by default a minute about the worst moment, or all of an operation.
    progress
        Called with the share that is done.

    Raises
    ------
    InputError
        If the run has no stored samples.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from PIL import Image

    if window is None:
        window = whole_of(run) if moves(run) else window_of(run)
    scene = Scene.of(run, window, scenario)
    span = window.end - window.start
    frames = round(min(max(span * _RATE / _FASTER, _FEWEST), _MOST))
    pictures: list[Any] = []
    with styled():
        figure = Figure(figsize=(7.2, 4.2), dpi=_DOTS)
        canvas: Any = FigureCanvasAgg(figure)  # whose methods have no types
        left, right = figure.subplots(1, 2, sharey=True, width_ratios=(1.0, 2.2))
        figure.subplots_adjust(left=0.095, right=0.985, top=0.88, bottom=0.125, wspace=0.04)
        for axes in (left, right):
            axes.grid(visible=False)
            for height in (0.0, scene.offset):
                axes.axhline(height, color=REFERENCE, linewidth=0.8, alpha=0.6)
        left.set_xlim(-0.75, 0.45)
        left.set_xticks([])
        height_axis(left, scene)
        right.tick_params(axis="y", length=0)
        right.set_xlim(-_LATELY * span, 0.02 * span)
        right.set_xlabel("time before now [s]")
        faster = span * _RATE / frames
        about = f"{run.case.name}, {run.scenario}, {run.controller}"
        left.set_title(f"{about}, {number(faster, 2)} times as fast as it is", fontsize=9.5)
        clock = right.set_title("", loc="right", fontsize=9.5)
        moments = np.linspace(float(scene.time[0]), float(scene.time[-1]), frames)
        before: list[Artist] = []
        for done, moment in enumerate(moments):
            at = int(np.searchsorted(scene.time, moment))
            for artist in before:
                artist.remove()
            before = draw_station(left, 0.0, scene, at)
            first = int(np.searchsorted(scene.time, moment - _LATELY * span))
            part = slice(first, at + 1)
            ago = scene.time[part] - scene.time[at]
            curves = [(scene.hook, HOOK, 1.5), (scene.payload, AFTER, 1.8)]
            if np.ptp(scene.asked) > 0.0:
                curves.append((scene.asked, REFERENCE, 0.9))
            for values, colour, width in curves:
                before += right.plot(ago, values[part], color=colour, linewidth=width)
            for surface, colour in ((scene.ground, _GROUND), (scene.water, _SEA)):
                if surface is None:
                    continue
                level = float(surface[at])
                before.append(left.axhspan(scene.bottom, level, color=colour, alpha=0.35, zorder=0))
                before += right.plot(ago, surface[part], color=colour, linewidth=1.5)
            clock.set_text(f"{moment:.1f} s")
            canvas.draw()
            picture = Image.frombuffer("RGBA", canvas.get_width_height(), canvas.buffer_rgba())
            picture = picture.convert("RGB")
            # One palette for all: a colour that changed from frame to frame would flicker.
            palette = pictures[0] if pictures else picture.quantize(_COLOURS)
            pictures.append(picture.quantize(palette=palette, dither=Image.Dither.NONE))
            if progress is not None:
                progress((done + 1) / frames)
    target = io.BytesIO()
    pictures[0].save(
        target,
        format="GIF",
        save_all=True,
        append_images=pictures[1:],
        duration=round(1000.0 / _RATE),
        loop=0,
    )
    return target.getvalue()
