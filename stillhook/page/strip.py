"""A minute of a run as the page plays it: hook, drum and load, tenth by tenth of a second.

    Run -> Moving -> JSON in the page, which `page.js` draws

Both controllers of a strip have the same sea and the same scale, so that what they leave of the
hook's motion can be compared by eye.
"""

from __future__ import annotations

import html
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.run import Run

from ..text import quantity

LASTING = 60.0  #: [s]


@dataclass(frozen=True, kw_only=True)
class Moving:
    """The last minute of a run; or why there is none."""

    name: str
    step: float  #: Between samples [s].
    hook: tuple[float, ...]  #: Heave of the hook (n,) [m].
    load: tuple[float, ...]  #: Displacement of the load (n,) [m].
    turn: tuple[float, ...]  #: Angle of the drum, hauling in positive (n,) [rad].
    rms: float  #: Of the load in this minute [m].
    note: str = ""  #: What happened, if it did not come to its end.

    @classmethod
    def missing(cls, name: str, why: str) -> Moving:
        """Return a run that there is none of."""
        return cls(name=name, step=0.1, hook=(), load=(), turn=(), rms=math.nan, note=why)


def moving_of(name: str, run: Run) -> Moving:
    """Return the last minute of a run."""
    rows = run.time >= run.time[-1] - LASTING
    time = run.time[rows]
    hook, load, haul = (
        np.nan_to_num(run[signal][rows])
        for signal in ("hook.heave", "payload.displacement", "drum.haul")
    )
    return Moving(
        name=name,
        step=float(time[1] - time[0]),
        hook=tuple(np.round(hook, 4).tolist()),
        load=tuple(np.round(load, 4).tolist()),
        turn=tuple(np.round(haul / run.case.haul_radius, 4).tolist()),
        rms=float(np.std(load)),
        note="" if run.status == "completed" else f"the run {run.status}: {run.message}",
    )


def strip_html(found: Sequence[Moving]) -> str:
    """Return the places of the scenes, with what moves in them as data beside them."""
    scenes = []
    for one in found:
        said = one.note or f"load {quantity(one.rms, 'm')} rms in this minute"
        place = '<svg class="scene" viewBox="0 0 320 300" role="img" '
        place += f'aria-label="Hook, drum and load moving: {html.escape(one.name)}"></svg>'
        scenes.append(
            f'<figure class="station"><figcaption><b>{html.escape(one.name)}</b> '
            f"{html.escape(said)}</figcaption>{place if one.hook else ''}</figure>"
        )
    data = [
        {"step": one.step, "hook": one.hook, "load": one.load, "turn": one.turn}
        for one in found
        if one.hook
    ]
    text = html.escape(json.dumps(data, allow_nan=False))
    return (
        f'<div class="stations">{"".join(scenes)}</div>'
        f'<span class="strip-data" hidden>{text}</span>'
    )
