"""What a look at a design shows: headline numbers, limits as bars, and curves as arrays.

    Look [, prices] -> Picture: numbers in words, rows of limits, curves

Made beside the event loop; `stillhook.page.charts` draws it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from models.basics import ComplexArray, FloatArray, most_probable_maximum
from models.hook import HookMotion
from synth.design import Design, LimitUse, Look
from synth.question import difference_text, locked_response

from ..designs import AT_LEAST, label_of
from ..text import decibels, largest_in, listed, number, percent, quantity

_POINTS = 240  # of a curve; a screen shows no more
_SHOWN = (0.03, 20.0)  # frequencies of |P/Z| [rad/s]
_NEAR = 20.0  # |L| and 1/|L| beyond which the Nyquist chart shows nothing
_FINER = 6  # points of the Nyquist curve for each node
_PRICED = 1e-5  # of the load's rms; a price below is noise of the solver


@dataclass(frozen=True, kw_only=True)
class LimitRow:
    """A limit, as its bar shows it."""

    name: str
    label: str
    value: str
    bound: str  #: With its sign, at most or at least.
    use: float  #: Share of the limit that is used.
    kept: bool
    enforced: bool
    price: str  #: What a bound one percent looser is worth; empty where nothing, or not known.


@dataclass(frozen=True, kw_only=True, eq=False)
class Curves:
    """The curves of a stable loop."""

    omega: FloatArray  #: Frequencies (k,) [rad/s].
    response: FloatArray  #: |P/Z| (k,).
    held: FloatArray  #: The same with the drum held (k,).
    density: FloatArray  #: One-sided density of the load's motion (k,) [m2 s/rad].
    hook: FloatArray  #: That of the hook's (k,) [m2 s/rad].
    loop_gain: ComplexArray  #: L(i omega) on nodes of its own, ascending (n,).
    band: tuple[float, float]  #: Where nine tenths of the hook's motion are [rad/s].


@dataclass(frozen=True, kw_only=True, eq=False)
class Picture:
    """All that the page says of one look."""

    stable: bool
    kept: bool  #: Stable, and every enforced limit kept, in every member.
    verdict: str  #: One sentence: what breaks, if anything does.
    #: Headline figures: the load's rms, its share of the hook's, the same in dB.
    rms: str
    share: str
    change: str
    largest: str  #: The load's most probable largest motion, and in what time.
    largest_of: str
    hook: str  #: The hook's rms.
    held: str  #: The load's with the drum held.
    sensitivity: str  #: M_s.
    delay: str  #: Delay margin.
    max_sensitivity: float  #: Limit of M_s, for the disc.
    sea: tuple[float, float]  #: T_p [s] and H_s [m].
    limits: tuple[LimitRow, ...]
    curves: Curves | None  #: None where the loop is not stable.


def picture_of(look: Look, prices: Mapping[str, float] | None = None) -> Picture:
    """Return what the page says of a look; `prices` are those last known [m per percent]."""
    margins, limits = look.margins, look.case.limits
    stable = look.stable
    finite = margins is not None and math.isfinite(look.payload_rms)
    largest = "-"
    if finite:
        time = limits.equivalent_exposure
        found = most_probable_maximum(look.payload_rms, _mean_period(look), time)
        largest = quantity(found, "m")
    return Picture(
        stable=stable,
        kept=stable and not any(_broken(one) for one in (look, *look.members)),
        verdict=_verdict(look),
        rms=quantity(look.payload_rms, "m") if finite else "-",
        share=percent(look.residual) if finite else "-",
        change=decibels(look.residual) if finite else "-",
        largest=largest,
        largest_of=largest_in(limits),
        hook=quantity(look.hook_rms, "m"),
        held=quantity(look.payload_rms_before, "m"),
        sensitivity=number(margins.max_sensitivity) if margins is not None else "-",
        delay=margins.delay_text if margins is not None else "-",
        max_sensitivity=limits.max_sensitivity,
        sea=(look.case.sea.spectral_peak_period, look.case.sea.significant_height),
        limits=tuple(_row(look, use, prices or {}) for use in look.limits.values()),
        curves=_curves(look) if finite else None,
    )


def prices_of(design: Design) -> dict[str, float]:
    """Return what a percent of each limit is worth at an optimum, by name [m]; the dear ones."""
    least = _PRICED * design.payload_rms
    return {use.name: use.price for use in design.limits.values() if use.price > least}


def _broken(design: Design) -> list[str]:
    """Return the labels of the enforced limits that a design breaks."""
    return [label_of(design, u.name) for u in design.limits.values() if u.enforced and not u.kept]


def _verdict(look: Look) -> str:
    """Return whether it is stable and what it breaks, in every member, as a sentence."""
    said = []
    for one in (look, *look.members):
        where = "" if one is look else f"with {difference_text(look.case, one.case)}: "
        if one.margins is None:
            growth = getattr(one, "growth", 0.0)
            pace = f", grows by a factor e every {1.0 / growth:.3g} s" if growth > 0.0 else ""
            said.append(f"{where}unstable{pace}")
        elif broken := _broken(one):
            said.append(f"{where}breaks {listed(broken)}")
    text = "; ".join(said) or "Keeps every enforced limit"
    return f"{text[0].upper()}{text[1:]}."


def _mean_period(look: Look) -> float:
    """Return the mean zero-crossing period of the load's motion [s], on the nodes of the look."""
    m0 = np.trapezoid(look.spectrum, look.omega)
    m2 = np.trapezoid(look.spectrum * look.omega**2, look.omega)
    return float(2.0 * np.pi * np.sqrt(m0 / m2)) if m0 > 0.0 and m2 > 0.0 else 1.0


def _row(look: Look, use: LimitUse, prices: Mapping[str, float]) -> LimitRow:
    price = prices.get(use.name, 0.0)
    sign = "at least" if use.name in AT_LEAST else "at most"
    return LimitRow(
        name=use.name,
        label=label_of(look, use.name),
        value=_measured(use, use.value),
        bound=f"{sign} {_measured(use, use.bound)}",
        use=use.use,
        kept=use.kept,
        enforced=use.enforced,
        price=quantity(price, "m", 2) if price > 0.0 and use.enforced else "",
    )


def _measured(use: LimitUse, value: float) -> str:
    """Return a figure of a limit with its unit, on the scale of its bound."""
    if math.isinf(value):
        return "no bound"
    if use.name.startswith("gain_margin"):
        return f"x {number(value)}"
    unit = "rpm" if use.name.startswith("motor.speed") else use.unit
    size = use.bound if abs(value) > 1e-3 * abs(use.bound) else None
    return quantity(value, unit, size=size)


def _curves(look: Look) -> Curves:
    """Return the curves of a stable look, thinned to what a screen shows."""
    hook = HookMotion.from_case(look.case, warn=False)
    low, high = hook.energetic_band
    # The nodes of the look see every peak of the loop, an even grid the rest.
    omega = np.unique(np.concatenate([look.omega, np.geomspace(*_SHOWN, _POINTS)]))
    omega = omega[(omega >= _SHOWN[0]) & (omega <= _SHOWN[1])]
    return Curves(
        omega=omega,
        response=_between(omega, look.omega, np.abs(look.response)),
        held=np.abs(locked_response(look.case, omega, look.drag_before)),
        density=_between(omega, look.omega, look.spectrum),
        hook=hook.density(omega),
        loop_gain=_smooth(look.loop_gain, look.omega),
        band=(low, high),
    )


def _smooth(gain: ComplexArray, omega: FloatArray) -> ComplexArray:
    """Return the points of a loop gain and points between them, on a curve without corners.

    Between nodes magnitude and phase go as monotone cubics over log frequency; what is too small
    or too large for the chart is left as it is.
    """
    near = (np.abs(gain) < _NEAR) & (np.abs(gain) > 1.0 / _NEAR)
    if np.count_nonzero(near) < 4:
        return gain
    at = np.log(omega)
    fine = np.concatenate([at[:-1] + k / _FINER * np.diff(at) for k in range(_FINER)])
    inside = np.repeat((near[1:] | near[:-1])[None, :], _FINER, axis=0).ravel()
    fine = np.unique(np.concatenate([at, fine[inside]]))
    size = PchipInterpolator(at, np.log(np.maximum(np.abs(gain), 1e-30)))(fine)
    turn = PchipInterpolator(at, np.unwrap(np.angle(gain)))(fine)
    return np.asarray(np.exp(size + 1j * turn))


def _between(omega: FloatArray, nodes: FloatArray, values: FloatArray) -> FloatArray:
    """Return positive values between nodes, straight on logarithmic axes."""
    tiny = 1e-30
    logs = np.interp(np.log(omega), np.log(nodes), np.log(np.maximum(values, tiny)))
    return np.asarray(np.exp(logs))
