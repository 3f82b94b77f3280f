"""The rope masses that a loop asks for, by its gain on the rope as it is.

Few masses have their higher modes in the wrong place.  What they place within a few percent is
enough where the loop is weak; but a mode far above all crossovers may carry the peak of S, and
then what is kept on the masses is broken on the rope.  Resonances of rope are narrower than any
grid: they are looked for at the poles of the rope, with the loop open and closed.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from models.basics import ComplexArray, FloatArray, InputError
from models.plant import MAX_MASSES, masses_for_bandwidth
from models.sensing import sensed_line_at

from ..limits import DelayMargin, GainMargin, GainMarginDown, Limit, MaxSensitivity
from ..loop import (
    Assessment,
    LoopResponses,
    Margins,
    least_distances,
    lively_poles,
    loop_margins,
)
from .problem import Values
from .question import DesignQuestion, with_masses

_PER_DECADE = 40  # frequencies apart from the poles
_BESIDE = (-4.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 4.0)  # ... and beside a pole, in its widths
_NARROW = 1e-7  # relative width of a pole that has none
_CLOSE = 1.05  # of the peak of |S| on those frequencies, at which margins are refined
_FAR = 0.1  # relative length of the longest step
_FELT = 0.15  # loop gain below which no margin is looked for
_WEAK = 0.5  # loop gain below which S is at most 2, wherever a mode stands
_NEAR = 0.1  # relative distance of peaks that are the same on masses and rope
_READ = 1e-6  # relative error of the margins on the rope
_KEPT = 1e-3  # relative excess on the rope as it is over a limit that its masses keep
_RESERVED = 0.03  # ... that a limit may hold in reserve
_NEARER = 0.8  # share of the step before, of a long one that is worth another
_STEPS = 8  # of Newton's method towards a pole
_FINE = 1e-7  # relative difference for a slope
_SAME = 1e-6  # relative distance of poles that are one
_PLACED = 0.3  # of a pole's width, after a step of which it has its place
_UNFELT = 0.05  # peak of the loop gain below which a pole is not looked for
_LIGHT = 0.3  # damping ratio above which a pole is no resonance


def masses_for(question: DesignQuestion, loop: Assessment) -> int:
    """Return the rope masses that a stable loop asks for, where the case leaves them open.

    Every mode up to the frequency above which the loop gain on the distributed rope stays below a
    half has its place, and the margins that are kept are kept on that rope too, to a thousandth.
    Never fewer than the question's own.
    """
    if question.masses == MAX_MASSES:
        return MAX_MASSES
    return _masses(question, loop, _KEPT)[0]


def masses_and_reserve(
    question: DesignQuestion, loop: Assessment
) -> tuple[int, Mapping[str, float]]:
    """Return the rope masses that a stable loop asks for, and what its limits hold in reserve.

    As `masses_for`, but a search need not have more masses where a margin is broken on the
    distributed rope by a few percent: it holds that margin with as much in reserve.  The reserve
    is, by name of the limit, its relative excess on the distributed rope.
    """
    masses, excess = _masses(question, loop, _RESERVED)
    return masses, {name: over for name, over in excess.items() if over > _KEPT}


def _masses(
    question: DesignQuestion, loop: Assessment, most: float
) -> tuple[int, Mapping[str, float]]:
    """Return the masses with which no margin's excess on the rope is above `most`, and those.

    The excess is negative of a margin that is broken, or binds, on the masses only.
    """
    data = question.data
    if data.masses is not None or data.lumping == "thesis":
        return question.masses, {}
    line = _OnTheRope(question, loop)
    try:
        wanted = masses_for_bandwidth(data, line.reach)
    except InputError:
        wanted = MAX_MASSES
    if wanted > question.masses:
        return wanted, {}
    excess = line.excess
    # For given gains it matters as well that none binds on the masses that the rope keeps.
    apart = excess.values() if most > _KEPT else map(abs, excess.values())
    if (largest := max(apart, default=0.0)) > most:
        # The error of a lumped rope's modes falls with the square of its masses.
        finer = math.ceil(question.masses * math.sqrt(largest / most))
        return min(max(finer, question.masses + 1), MAX_MASSES), excess
    return question.masses, excess


@dataclass(frozen=True, kw_only=True, eq=False)
class _Seen:
    """The margins of a loop on the rope as limits see it (`synth.limits.limits.Limit.measure`)."""

    max_sensitivity: float
    margins: Margins


class _OnTheRope:
    """The loop of a question on the distributed rope, instead of on its masses."""

    def __init__(self, question: DesignQuestion, loop: Assessment) -> None:
        self.question, self.loop = question, loop
        self.drag, friction = question.equivalents(loop.coefficients)
        self.frictions = tuple(dict.fromkeys([friction, 0.0]))  # nothing may hang on the losses
        lumped = np.concatenate([question.plant.poles(), loop.poles])
        lumped = lumped[(lumped.imag > 0.0) & (-lumped.real < _LIGHT * np.abs(lumped))]
        self.begins: ComplexArray = np.concatenate([question.data.damped_modes(MAX_MASSES), lumped])
        poles = self._poles()
        omega, width = poles.imag, np.maximum(-poles.real, _NARROW * poles.imag)
        near = omega[:, None] + width[:, None] * np.array(_BESIDE)
        low, high = 1e-3 * self.begins.imag.min(), 2.0 * self.begins.imag.max()
        even = np.geomspace(low, high, int(_PER_DECADE * math.log10(high / low)))
        self.grid = np.unique(np.concatenate([even, near[near > 0.0]]))
        self.gains = self._gains(1j * self.grid)

    @property
    def reach(self) -> float:
        """Frequency above which the loop gain stays below a half [rad/s]."""
        strong = np.flatnonzero(np.abs(self.gains).max(axis=0) >= _WEAK)
        return float(self.grid[strong[-1]]) if strong.size else 0.0

    @property
    def excess(self) -> dict[str, float]:
        """What each margin is broken by on the rope more than on the masses, relatively.

        Nothing where it is broken on both; negative where the masses alone break it or bind by it.
        """
        margins = MaxSensitivity | GainMargin | GainMarginDown | DelayMargin
        limits = [limit for limit in self.question.loop if isinstance(limit, margins)]
        lumped = {limit.name: limit.use(limit.measure(self.loop)) for limit in limits}
        binding = any(use > 1.0 - _KEPT for use in lumped.values())
        found, apart = dict.fromkeys(lumped, 0.0), 0.0
        felt = np.abs(self.gains).max(axis=0) > _FELT
        peak = _CLOSE / float(np.abs(1.0 + self.gains).min())
        kept = all(limit.use(_least(limit, peak)) <= 1.0 for limit in limits)
        if (binding or not kept) and felt.any():
            grid, gains = self.grid[felt], self.gains[:, felt]
            minima = least_distances(self._loops, grid, gains, _READ)
            own = loop_margins(self._loops, grid, gains, minima, _READ)
            seen = _Seen(max_sensitivity=own.max_sensitivity, margins=own)
            for limit in limits:
                found[limit.name] = limit.use(limit.measure(seen))  # type: ignore[arg-type]
                if isinstance(limit, MaxSensitivity):
                    each = enumerate(minima)
                    apart = max(self._missed(i, limit.bound, *least) for i, (least, _) in each)
        for limit in limits:
            name = limit.name
            rope, masses = found[name], lumped[name]
            if min(rope, masses) > 1.0 + _KEPT:
                found[name] = 0.0
            elif masses > 1.0 - _KEPT and rope < masses:
                found[name] = rope - masses
            else:
                found[name] = max(rope - 1.0, 0.0)
            if isinstance(limit, MaxSensitivity) and apart > abs(found[name]):
                found[name] = -apart
        return found

    def _missed(self, index: int, bound: float, places: FloatArray, least: FloatArray) -> float:
        """Return what the rope has less of |S| than the masses at a peak that binds, relatively.

        From the places and values of the minima of |1 + L| on the rope.
        """
        at = self.loop.sensitivity_peaks((1.0 - _KEPT) * bound)
        size = 1.0 / np.abs(1.0 + self.loop.loop_gain(at, index))
        near = np.abs(places - at[:, None]) < _NEAR * at[:, None]
        rope = np.max(np.where(near, 1.0 / least, 0.0), axis=1, initial=0.0)
        binds = (size > (1.0 - _KEPT) * bound) & (size < (1.0 + _KEPT) * bound) & (rope > 0.0)
        return float(np.max((size - rope)[binds] / bound, initial=0.0))

    def _loops(self, omega: FloatArray) -> ComplexArray:
        """Return L with each friction at frequencies [rad/s], (frictions, k)."""
        return self._gains(np.asarray(1j * omega, dtype=np.complex128))

    def _gains(self, s: ComplexArray) -> ComplexArray:
        """Return L with each friction at points [1/s], (frictions, k)."""
        gain, turned = self._still(s)
        return np.array([gain / (1.0 + friction * turned) for friction in self.frictions])

    def _still(self, s: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Return L without losses, and the motor's speed by a torque on its shaft, (k,) each."""
        data, controller = self.question.data, self.loop.controller
        line = sensed_line_at(
            self.question.case,
            s,
            drag=self.drag,
            data=data,
            measurements=controller.measurements,
            disturbances=(),
        )
        speed = line.zu[:, line.outputs.index("motor.speed"), 0] / data.torque_per_command(s)
        return np.asarray(LoopResponses.of(line, controller).difference(0) - 1.0), speed

    def _poles(self) -> ComplexArray:
        """Return the light poles of the rope with the loop open and closed [1/s], where L is felt.

        Where they are looked for from is among them.
        """
        # Not at a pole that the controller has for itself, where its response has no value.
        s = self.begins * (1.0 + _SAME)
        # With each friction the open loop, and the closed one.
        frictions = np.repeat(self.frictions, 2)[:, None]
        closed = np.tile([0.0, 1.0], len(self.frictions))[:, None]
        with np.errstate(all="ignore"):
            move, slope = self._towards(s, frictions, closed)
            # L has 1/slope for a residue there, and so much of a peak on the axis.
            apart, width = move[::2], np.abs((s - move[::2]).real)
            felt = (np.abs(slope[::2]) * width < 1.0 / _UNFELT) | (np.abs(apart) > _FAR * np.abs(s))
            some = felt.any(axis=0)
            arrived, move = [s[some]], move[:, some].ravel()
            s, friction, closed = (
                part.ravel() for part in np.broadcast_arrays(s[some], frictions, closed)
            )
            before = np.full(s.size, np.inf)
            for _ in range(_STEPS):
                size, whole = np.abs(move), np.abs(s)
                s = s - move * np.minimum(1.0, _FAR * whole / size)
                light = np.isfinite(s) & (s.imag > 0.0) & (np.abs(s.real) < _LIGHT * np.abs(s))
                done = size < np.maximum(_SAME * np.abs(s), _PLACED * np.abs(s.real))
                arrived.append(s[light & done])
                # What is far and comes no nearer leads to a pole elsewhere, or to none.
                left = light & ~done & ((size <= _FAR * whole) | (size < _NEARER * before))
                if not left.any():
                    break
                before = size[left]
                s, friction, closed = s[left], friction[left], closed[left]
                move, _ = self._towards(s, friction, closed)
        found = np.concatenate(arrived)
        # Points about a pole that is there twice would lie apart by rounding only.
        same = np.abs(found[:, None] - found) < _SAME * np.abs(found)
        return np.asarray(found[~np.tril(same, -1).any(axis=1)])

    def _towards(
        self, s: ComplexArray, friction: FloatArray, closed: FloatArray
    ) -> tuple[ComplexArray, ComplexArray]:
        """Return Newton's step back to where 1/L, plus 1 where closed, vanishes, and its slope.

        These are smooth where L has a pole.
        """
        step = _FINE * np.abs(s)
        gain, turned = self._still(np.concatenate([s, s + step]))
        value, beside = (
            (1.0 + friction * turned[part]) / gain[part] + closed
            for part in (slice(s.size), slice(s.size, None))
        )
        slope = (beside - value) / step
        return value / slope, slope


def on_enough_masses(
    question: DesignQuestion,
    parameters: Mapping[str, float],
    assess: Callable[[DesignQuestion, Values], Assessment | None],
    finer: Callable[[DesignQuestion, int], DesignQuestion] = with_masses,
) -> tuple[DesignQuestion, Assessment | None, float]:
    """Return a question on the masses that given parameters ask for, their loop and its growth.

    The parameters are the structure's, by name.  `assess` leads from a question and the law's
    parameters to the loop, None where no drag agrees with it; `finer` from the question to that on
    more masses.  The loop returned is None where it is not stable; its growth is the largest real
    part of its poles [1/s] with the drag before compensation.
    """
    values = question.values(parameters)
    growth = _growth(question, values)
    if growth > 0.0 and question.masses < MAX_MASSES and question.data.masses is None:
        # Few masses do not have their modes where the rope does: made on it, a loop may hold there.
        most = finer(question, MAX_MASSES)
        if (there := _growth(most, values)) <= 0.0:
            question, growth = most, there
    while growth <= 0.0:
        loop = assess(question, values)
        if loop is None or not loop.held:
            break
        if (masses := masses_for(question, loop)) <= question.masses:
            return question, loop, growth
        question = finer(question, masses)
        growth = _growth(question, values)
    return question, None, growth


def _growth(question: DesignQuestion, values: Values) -> float:
    """Return the largest real part of a pole that the loop moves [1/s], with the drag before."""
    references = tuple(element.reference for element in question.elements)
    controller = question.law.controller([float(v) for v in values])
    poles = lively_poles(question.plant, controller, question.elements, references)
    return float(poles.real.max(initial=-np.inf))


def on_common_masses(
    looks: Sequence[Callable[[int], tuple[DesignQuestion, Assessment | None, float]]],
    least: int = 0,
) -> list[tuple[DesignQuestion, Assessment | None, float]]:
    """Return the loops of a family on the masses that the most demanding of them asks for.

    For each member, the case's own first, a look leads from the least number of masses, at least
    `least`, to what `on_enough_masses` returns.
    """
    found: dict[int, tuple[DesignQuestion, Assessment | None, float]] = {}
    asked = dict.fromkeys(range(len(looks)), -1)
    while any(masses < least for masses in asked.values()) or not found:
        # The last have the least damping, and ask for most.
        for i in reversed(range(len(looks))):
            if asked[i] < least or i not in found:
                asked[i] = least
                found[i] = looks[i](least)
                question, loop, _ = found[i]
                if loop is not None and question.data.masses is None:
                    asked[i] = least = max(least, question.masses)
    return [found[i] for i in range(len(looks))]


def _least(limit: Limit, peak: float) -> float:
    """Return the least that a margin can be where |S| stays below a value, 0 where nothing is."""
    if isinstance(limit, MaxSensitivity):
        return peak
    reach = peak / (peak - 1.0) if peak > 1.0 else math.inf
    if isinstance(limit, GainMargin):
        return reach
    return peak / (peak + 1.0) if isinstance(limit, GainMarginDown) else 0.0
