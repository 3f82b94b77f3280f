"""The comparison of structures as one figure: how still the payload is, and what is in the way.

Bars of the payload's rms, split by where its variance comes from, and M_s and delay margin
beside them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from models.basics import InputError

from ..text import (
    AFTER,
    BEFORE,
    DRUM,
    HOOK,
    REFERENCE,
    bound_figures,
    new_figure,
    quantity,
    styled,
    typeset,
)
from .structure_table import SHARES, share_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from synth.design import StructureDesign

_COLOURS = {"sea": AFTER, "MRU": "#e69f00", "noise": "#cc79a7"}
_MARKS: Mapping[str, Mapping[str, Any]] = {
    "best with its sensors": {"marker": "|", "color": "black", "ms": 15.0, "mew": 2.2},
    "best with all sensors": {"marker": "|", "color": "0.45", "ms": 15.0, "mew": 1.2},
}
_LABELS = {"sea": "from the sea", "MRU": "from the reference unit", "noise": "from other sensors"}


def structures(designs: Sequence[StructureDesign], *, bound: bool = True) -> Figure:
    """Return the comparison of some structures on a case.

    Parameters
    ----------
    designs
        Designs of one case; those without a stable controller get an empty row.
    bound
        Whether to compute and to mark the bounds beside them.

    Returns
    -------
    matplotlib.figure.Figure
        Left: payload rms on a logarithmic axis, coloured by shares of its variance, hatched
        where the design is not ok; a mark at the least that any linear controller leaves with
        the same sensors, a lighter one with all sensors of the case.  Right: M_s.

    Raises
    ------
    InputError
        If there is no design, or none of them is stable.
    """
    stable = [design for design in designs if math.isfinite(design.payload_rms)]
    if not stable:
        raise InputError("structures: there is no stable design to draw")
    before, hook = 1e3 * stable[0].payload_rms_before, 1e3 * stable[0].hook_rms
    values = [1e3 * design.payload_rms for design in stable]
    marks = {d.structure: bound_figures(d) if bound else (math.nan, math.nan) for d in stable}
    least = [1e3 * value for pair in marks.values() for value in pair if math.isfinite(value)]
    low = 0.5 * min([*values, *least, hook])
    high = 3.0 * max([*values, before])
    with styled():
        figure = new_figure(9.2, 1.9 + 0.38 * len(designs))
        left, right = figure.subplots(1, 2, sharey=True, width_ratios=(3.2, 1.0))
        seen: set[str] = set()
        for place, design in enumerate(designs):
            rms = 1e3 * design.payload_rms
            if not math.isfinite(rms):
                left.text(1.1 * low, place, "no stable controller", va="center", fontsize=9.0)
                continue
            # Shares of the variance as shares of the bar's length on the page.
            span, at = math.log(rms / low), 0.0
            for name in SHARES:
                share = share_of(design, name)
                if share <= 0.0:
                    continue
                begin, end = (low * math.exp(span * edge) for edge in (at, at + share))
                left.barh(
                    place,
                    end - begin,
                    left=begin,
                    height=0.62,
                    color=_COLOURS[name],
                    alpha=1.0 if design.ok else 0.45,
                    hatch=None if design.ok else "///",
                    edgecolor="white",
                    linewidth=0.0,
                    label=_LABELS[name] if name not in seen else None,
                )
                seen.add(name)
                at += share
            left.text(
                1.06 * rms,
                place,
                quantity(1e-3 * rms, "m"),
                va="center",
                fontsize=9.0,
                bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0},
            )
            for value, (text, style) in zip(marks[design.structure], _MARKS.items(), strict=True):
                if math.isfinite(value):
                    shown = text if text not in seen else None
                    left.plot([1e3 * value], [place], linestyle="none", label=shown, **style)
                    seen.add(text)
            if design.margins is not None:
                right.plot(design.margins.max_sensitivity, place, "o", color=DRUM)
        for value, colour, text in ((before, BEFORE, "drum held"), (hook, HOOK, "hook")):
            left.axvline(value, color=colour, linewidth=1.2, label=text)
        _frame(left, right, designs, (low, high))
        best = min(stable, key=lambda design: (not design.ok, design.payload_rms))
        held = quantity(best.payload_rms, "m")
        finding = f"{best.structure} holds the payload stillest: {held} rms"
        figure.suptitle(typeset(finding), x=0.012, ha="left", fontsize=11.0, fontweight="bold")
    return figure


def _frame(
    left: Axes,
    right: Axes,
    designs: Sequence[StructureDesign],
    span: tuple[float, float],
) -> None:
    left.set_xscale("log")
    left.set_xlim(*span)
    left.set_yticks(range(len(designs)), [design.structure for design in designs])
    left.invert_yaxis()
    left.grid(visible=False, axis="y")
    left.set_xlabel("payload motion [mm rms]   (hatched: not ok)")
    left.legend(loc="upper center", bbox_to_anchor=(0.5, -0.22), ncols=4, frameon=False)
    bounds = [d.limits["max_sensitivity"].bound for d in designs if "max_sensitivity" in d.limits]
    if bounds:
        right.axvline(bounds[0], color=REFERENCE, linewidth=1.2)
    right.set_xlim(0.9, 1.05 * max([right.get_xlim()[1], *bounds]))
    right.set_xlabel(typeset("M_s"))
