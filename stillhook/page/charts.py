"""The charts of the page: |P/Z|, spectra, Nyquist curve, capability, and the bars of the limits.

    Picture or Capability -> SVG or HTML text

What a colour means is what it means in every figure of the toolkit (`stillhook.text.style`).
"""

from __future__ import annotations

import html
import math
from collections.abc import Mapping, Sequence

import numpy as np

from models.basics import FloatArray

from ..designs import LIMITS
from ..text import AFTER, BEFORE, BROKEN, DRUM, HOOK, REFERENCE
from .curves import Curves, LimitRow, Picture
from .jobs import Capability
from .limit_words import WHAT_LIMITS_ARE
from .svg import Axis, Chart

_WEIGHT = 0.995  # share of a variance that a spectrum's axis holds
_LOWEST = 1e-4  # of the highest density, where a spectrum's axis ends
_ENDLESS = 20.0  # H_s that is as good as no limit [m]
_LONGEST = 1.5  # use of a limit at which its bar is cut off

#: Colours by name, on white and on a dark ground, where Okabe and Ito's blue and black are too dark
#: to be seen and have to be their lighter ones.
COLOURS: Mapping[str, tuple[str, str]] = {
    "hook": (HOOK, "#a6a6a6"),
    "before": (BEFORE, "#f0803c"),
    "after": (AFTER, "#56b4e9"),
    "drum": (DRUM, "#2fc79a"),
    "reference": (REFERENCE, "#e4e6e8"),
    "broken": (BROKEN, "#f0803c"),
}


def colour_rules() -> str:
    """Return the colours as CSS variables, for light and for dark."""
    light = "".join(f"--{name}:{pair[0]};" for name, pair in COLOURS.items())
    dark = "".join(f"--{name}:{pair[1]};" for name, pair in COLOURS.items())
    return f":root{{{light}}}body.body--dark{{{dark}}}"


def response_chart(picture: Picture) -> str:
    """Return |P/Z| over frequency, with the gains and with the drum held."""
    curves = picture.curves
    if curves is None:
        return _nothing("no stable loop, so there is no |P/Z|")
    both = np.concatenate([curves.response, curves.held])
    top = 10.0 ** math.ceil(math.log10(min(float(both.max()), 1e3)))
    low = max(float(curves.response.min()), 1e-4 * top)
    chart = Chart(
        x=Axis(label="frequency [rad/s]", low=0.03, high=20.0, log=True),
        y=Axis(
            label="|P/Z| [m/m]",
            low=10.0 ** math.floor(math.log10(low)),
            high=top,
            log=True,
        ),
        about="Load over hook against frequency, with these gains and with the drum held",
    )
    return chart.drawn(
        chart.band(*curves.band, "hook"),
        chart.line([0.01, 100.0], [1.0, 1.0], "reference dashed thin"),
        chart.line(curves.omega, curves.held, "before"),
        chart.line(curves.omega, curves.response, "after"),
    )


def spectrum_chart(picture: Picture) -> str:
    """Return the spectra of hook and load."""
    curves = picture.curves
    if curves is None:
        return _nothing("no stable loop, so the load's motion has no spectrum")
    held = curves.held**2 * curves.hook
    right = max(_reach(curves, curves.hook), _reach(curves, curves.density), 1.0)
    right = 0.25 * math.ceil(4.0 * min(right, 8.0))
    shown = curves.omega <= right
    peaks = [float(np.max(d[shown])) for d in (curves.hook, curves.density)]
    top = 10.0 ** math.ceil(math.log10(max(*peaks, 1e-12) * 1.3))
    low = 10.0 ** math.floor(math.log10(max(min(peaks) * 1e-2, top * _LOWEST * 1e-2)))
    chart = Chart(
        x=Axis(label="frequency [rad/s]", low=0.0, high=right),
        y=Axis(label="variance density [m2 s/rad]", low=low, high=top, log=True),
        about="Spectra of the hook's and the load's motion, drum held and with these gains",
    )
    omega = curves.omega[shown]
    return chart.drawn(
        chart.area(omega, curves.density[shown], "after"),
        chart.line(omega, curves.hook[shown], "hook"),
        chart.line(omega, held[shown], "before"),
        chart.line(omega, curves.density[shown], "after"),
    )


def nyquist_chart(picture: Picture) -> str:
    """Return the Nyquist curve near -1, with the disc that M_s forbids."""
    curves = picture.curves
    chart = Chart(
        x=Axis(label="Re L", low=-3.3, high=1.8),
        y=Axis(label="Im L", low=-1.34, high=1.34),
        about=f"Nyquist curve of the loop gain, with the disc of M_s {picture.max_sensitivity:g}",
    )
    pieces = [
        chart.circle(0.0, 0.0, 1.0, "unit"),
        chart.circle(-1.0, 0.0, 1.0 / picture.max_sensitivity, "disc"),
    ]
    if curves is not None:
        gain = curves.loop_gain
        pieces += [
            chart.line(gain.real, -gain.imag, "after thin dashed"),
            chart.line(gain.real, gain.imag, "after"),
        ]
    pieces.append(chart.dot(-1.0, 0.0, "reference", 3.0))
    return chart.drawn(*pieces)


def capability_chart(found: Capability | None, now: tuple[float, float], *, old: bool) -> str:
    """Return the limiting H_s over T_p with the sea of the page; `old` where the gains moved on."""
    period, height = now
    if found is None:
        return _nothing("computed in the background ...")
    if not found.periods:
        return _nothing(found.note)
    periods = np.array(found.periods)
    limits = np.array(found.heights)
    finite = limits[np.isfinite(limits)]
    # What nobody sails in is not shown: the axis ends somewhat above the sea asked about.
    top = min(max(1.3 * height, 1.1 * float(finite.max(initial=0.0)), 2.0), max(12.0, 1.3 * height))
    chart = Chart(
        x=Axis(
            label="peak period T_p [s]",
            low=min(float(periods[0]), period),
            high=max(float(periods[-1]), period),
        ),
        y=Axis(label="limiting wave height H_s [m]", low=0.0, high=float(math.ceil(top))),
        about="Limiting significant wave height over peak period, and the sea of this page",
    )
    capped = np.minimum(limits, 4.0 * chart.y.high)
    look = "drum old" if old else "drum"
    pieces = [chart.area(periods, capped, look), chart.line(periods, capped, look)]
    held = np.array(found.held)
    if held.size:
        line = chart.line(periods, np.minimum(held, 4.0 * chart.y.high), "before dashed thin")
        pieces.append(line)
    pieces += [chart.dot(p, h, look, 2.5) for p, h in zip(periods, capped, strict=True)]
    pieces.append(chart.dot(period, height, "reference"))
    words = "" if old else f'<div class="hint">{html.escape(_capable(found, period))}</div>'
    return chart.drawn(*pieces) + words


def limit_bars(rows: Sequence[LimitRow]) -> str:
    """Return the limits as bars, each with its figure, its bound, and what it costs."""
    if not rows:
        return _nothing("no stable loop, so there is no use of limits")
    parts = ['<div class="bars" role="table" aria-label="Use of the limits">']
    for row in rows:
        broken = not row.kept
        kind = "reported" if not row.enforced else "broken" if broken else "kept"
        width = 100.0 * min(max(row.use, 0.0), _LONGEST) / _LONGEST
        share = f"{100.0 * row.use:.0f} %" if math.isfinite(row.use) else "-"
        label = html.escape(row.label[:1].upper() + row.label[1:])
        if row.name in WHAT_LIMITS_ARE:
            label = f'<a href="#limit-{row.name}">{label}</a>'
        words = "broken" if broken else f"1 % looser: {row.price} less" if row.price else ""
        words = f"reported{', exceeded' if broken else ''}" if not row.enforced else words
        parts.append(
            f'<div class="bar {kind}" role="row"><span class="what" role="cell">{label}</span>'
            f'<span class="figure" role="cell">{html.escape(row.value)}</span>'
            f'<span class="bound" role="cell">{html.escape(row.bound)}</span>'
            f'<span class="track" role="cell" aria-label="{share} used"><i style="width:'
            f'{width:.1f}%"></i></span><span class="use" role="cell">{share}</span>'
            f'<span class="price" role="cell">{html.escape(words)}</span></div>'
        )
    return "".join([*parts, "</div>"])


def legend(*entries: tuple[str, str]) -> str:
    """Return the legend of a chart from pairs of a look and its words."""
    marks = (f'<span class="entry"><i class="{look}"></i>{words}</span>' for look, words in entries)
    return f'<span class="legend">{"".join(marks)}</span>'


def _capable(found: Capability, period: float) -> str:
    """Return what the capability is at a period, and what limits it, in a sentence."""
    height = float(np.interp(period, found.periods, np.minimum(found.heights, _ENDLESS)))
    nearest = int(np.argmin(np.abs(np.array(found.periods) - period)))
    if height >= _ENDLESS:
        return f"At T_p {period:.3g} s nothing binds up to H_s {_ENDLESS:g} m."
    name = found.binding[nearest]
    label = LIMITS[name][0] if name in LIMITS else name.replace(".", " ").replace("_", " ")
    return f"At T_p {period:.3g} s up to H_s {height:.3g} m: then {label} binds."


def _reach(curves: Curves, density: FloatArray) -> float:
    """Return the frequency below which nearly all of a variance lies [rad/s]."""
    slices = 0.5 * (density[1:] + density[:-1]) * np.diff(curves.omega)
    total = np.cumsum(slices)
    if not total[-1] > 0.0:
        return 1.0
    return float(curves.omega[1 + np.searchsorted(total, _WEIGHT * total[-1])])


def _nothing(why: str) -> str:
    return f'<div class="nothing">{html.escape(why)}</div>'
