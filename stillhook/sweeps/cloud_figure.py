"""The Nyquist curves of many cases: how near a spread brings the loop to -1."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..text import AFTER, BROKEN, HOOK, REFERENCE, new_figure, number, styled
from .figure_parts import numbers_in, shown, stable_of, title

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from synth.design import GainDesign, StructureDesign

_CURVES = 150
_BAND = (0.02, 200.0, 5000)  # ends [rad/s] and points: circles of light rope modes look round
_AT_ONCE = 16  # curves


def nyquist_cloud(result: xr.Dataset, design: GainDesign | StructureDesign) -> Figure:
    """Return the Nyquist curves of many cases around -1, the design's own on top.

    Parameters
    ----------
    result
        What a sweep in the frequency domain returned.
    design
        The design.
    """
    from synth.sweeps import FrequencyEngine, spread_of

    engine = FrequencyEngine(design, spread_of(result), metrics=[])
    at = shown(stable_of(result), _CURVES)
    paths = engine.spread.paths
    rows = np.stack([numbers_in(result, p)[at] for p in paths], axis=1)
    nominal = np.array([[engine.spread.nominal[p] for p in paths]])
    omega = np.geomspace(*_BAND)
    parts = [engine.loop_gain(rows[k : k + _AT_ONCE], omega) for k in range(0, len(rows), _AT_ONCE)]
    gains = np.concatenate(parts)
    own = engine.loop_gain(nominal, omega)[0]
    stable = stable_of(result)[at]
    bound = engine.case.limits.max_sensitivity
    half = 2.2
    with styled():
        figure = new_figure(6.4, 5.9)
        axes = figure.add_subplot()
        for gain, sound in zip(gains, stable, strict=True):
            hidden = np.where(np.abs(gain) > 8.0 * half, np.nan, gain)
            axes.plot(
                hidden.real,
                hidden.imag,
                color=AFTER if sound else BROKEN,
                alpha=0.18 if sound else 0.6,
                linewidth=0.8,
            )
        hidden = np.where(np.abs(own) > 8.0 * half, np.nan, own)
        axes.plot(hidden.real, hidden.imag, color=REFERENCE, linewidth=2.0, label="the design")
        axes.plot([], [], color=AFTER, label=f"{int(stable.sum())} stable cases")
        if not stable.all():
            axes.plot([], [], color=BROKEN, label=f"{int((~stable).sum())} that are not")
        turn = np.linspace(0.0, 2.0 * np.pi, 361)
        axes.plot(
            -1.0 + np.cos(turn) / bound, np.sin(turn) / bound, color=HOOK, linewidth=1.2,
            linestyle="--", label=f"M_s = {bound:.3g}".replace("M_s", "$M_s$"),
        )  # fmt: skip
        axes.plot([-1.0], [0.0], marker="+", color=REFERENCE, markersize=11, markeredgewidth=2.0)
        axes.set_xlim(-1.0 - 0.8 * half, -1.0 + 1.2 * half)
        axes.set_ylim(-half, half)
        axes.set_aspect("equal")
        axes.set_xlabel("real part of L(iω)")
        axes.set_ylabel("imaginary part of L(iω)")
        axes.legend(loc="lower right", fontsize=8.5)
        near = float(np.nanmin(np.abs(1.0 + gains[stable]))) if stable.any() else 0.0
        finding = f"The curves that are stable stay {number(near)} away from -1"
        title(figure, axes, result, finding if stable.any() else "No curve is stable")
    return figure
