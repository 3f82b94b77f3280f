"""The tornado: what one per cent more of every number does to a design, the largest on top."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from synth.sensitivity import Sensitivity

from ..text import AFTER, BEFORE, new_figure, quantity, styled, typeset

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BARS = 16
_SMALL = 0.01  # elasticity below which nobody looks


def tornado_figure(study: Sensitivity, *, bars: int = _BARS) -> Figure:
    """Return bars of the elasticities of the payload's rms and of M_s.

    Parameters
    ----------
    study
        A sensitivity study.
    bars
        How many numbers to show at most; those that move neither by 0.01 % are left out.
    """

    def size(k: int) -> float:
        entry = study.elasticities[k]
        return max(abs(entry.payload_rms), abs(entry.max_sensitivity))

    order = sorted(range(len(study.elasticities)), key=size, reverse=True)
    shown = [study.elasticities[k] for k in order if size(k) >= _SMALL][:bars]
    shown.sort(key=lambda e: abs(e.payload_rms))
    place = np.arange(float(len(shown)))
    with styled():
        figure = new_figure(height=1.7 + 0.26 * max(len(shown), 4))
        axes = figure.add_subplot()
        for offset, name, colour, label in (
            (0.2, "payload_rms", AFTER, "rms of the payload"),
            (-0.2, "max_sensitivity", BEFORE, "M_s, the sensitivity's peak"),
        ):
            values = [getattr(entry, name) for entry in shown]
            axes.barh(place + offset, values, height=0.4, color=colour, label=typeset(label))
        axes.set_yticks(place, [entry.path for entry in shown])
        axes.axvline(0.0, color="#666666", linewidth=0.8)
        axes.grid(visible=False, axis="y")
        axes.set_xlabel("change for one per cent more [%]")
        figure.legend(loc="outside lower center", ncols=2)
        figure.suptitle(finding(study), x=0.012, ha="left", fontsize=11.0, weight="bold")
        about = (
            f"{study.design.case.name}: payload {quantity(study.payload_rms, 'm')} rms, "
            f"M_s {study.max_sensitivity:.3g}"
        )
        axes.set_title(typeset(about), fontsize=9.5, color="#555555", pad=6.0)
    return figure


def finding(study: Sensitivity) -> str:
    """Return what the study says, in a sentence."""
    physical = [e for e in study.elasticities if not e.path.startswith(("gains.", "sea."))]
    if not physical or abs(physical[0].payload_rms) < _SMALL:
        return "no number of the plant moves the payload's rms by 0.01 % for a per cent"
    first = physical[0]
    return f"{first.path} matters most of the plant: {first.payload_rms:+.2f} % rms a per cent"
