r"""Robustness of a design by the structured singular value: its plant off in all numbers at once.

    design + ranges -> M-Delta form -> mu from above (scalings) and from below (a pole found on
    the axis) -> the worst parameters, tried on the true plant -> random draws -> Robustness

The answer is a factor on the ranges: up to `proved` times them, in any combination, the loop
is stable; at `found` times them there is a combination at which it is not.  Beside it stand
what was known before: the margins of the loop and the radius of errors of the gains.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from models.basics import InputError, check_range, one_thread

from ..design import Design
from ..loop import Margins, closed_loop_poles
from ..search import Progress
from ..verify import LawMatrices, winding_of_plant
from .mu_plant import UncertainLoop, UncertainNumber, uncertain_loop, uncertain_numbers
from .mu_search import critical_point, furthest, grid_of, proved_bound
from .perturbation import GainRadius, gain_radius

_PAST = 1e-3  # relative step beyond the boundary, at which the true plant has to be unstable
_INSIDE = 0.999  # of the proved factor, within which draws are made
_WRONG = 0.02  # error of the M-Delta form from which it is no answer
_PADE = 8


@dataclass(frozen=True, kw_only=True, eq=False)
class Robustness:
    """What uncertain parameters do to a design's stability.

    Attributes
    ----------
    doubts
        What is uncertain: path, value, half of the range.
    proved
        The loop is stable for all parameters within this many times their ranges.
    found
        The least factor at which unstable parameters were found; infinity if none were.
    omega
        Where the pole crosses the axis, or where `proved` is decided [rad/s].
    critical
        Those parameters by path; empty if none were found.
    confirmed
        Whether the true plant, built anew and with exact delays, is unstable just beyond them,
        by its poles and by the winding number; None if none were found.
    growth
        Largest real part of its poles there [1/s].
    asked
        Factor beyond which nothing was asked: a value would change its sign there.
    error
        Of the M-Delta form against true plants, over |1 + L|.
    draws, unstable
        Random plants within the least of `proved` and 1 times the ranges, every other one in a
        corner, and how many of them are unstable.
    gain_radius, margins
        How far the gains themselves may be off (None where the loop is not affine in them), and
        the margins of the nominal loop.
    """

    doubts: tuple[UncertainNumber, ...]
    proved: float
    found: float
    omega: float
    critical: Mapping[str, float]
    confirmed: bool | None
    growth: float
    asked: float
    error: float
    draws: int
    unstable: int
    gain_radius: GainRadius | None
    margins: Margins

    @property
    def mu(self) -> tuple[float, float]:
        """The structured singular value of the ranges: lower and upper bound of its peak."""
        return (0.0 if math.isinf(self.found) else 1.0 / self.found), 1.0 / self.proved

    @property
    def ok(self) -> bool:
        """Whether the loop is stable over all of the ranges."""
        return self.proved >= 1.0 and self.unstable == 0 and self.error < _WRONG

    @property
    def status(self) -> str:
        """The sentence for the user."""
        if self.error >= _WRONG:
            return (
                f"no answer: the plant's form is {100.0 * self.error:.2g} % off over these ranges; "
                "narrow them"
            )
        if self.unstable:
            return f"{self.unstable} of {self.draws} random plants in the ranges are unstable"
        if self.proved >= 1.0:
            return f"stable over the ranges, and up to {self.proved:.3g} times them"
        if self.found <= 1.0:
            return f"unstable within the ranges: stable up to {self.proved:.3g} times them only"
        return (
            f"not proved stable over the ranges: proved up to {self.proved:.3g} times them, "
            f"unstable at {self.found:.3g} times"
        )

    def __str__(self) -> str:
        """Return a small tree."""
        low, high = self.mu
        lines = [f"Robustness: {self.status}"]
        lines += [
            f"├ {d.path}: {d.nominal:.6g}, off by {d.half:.4g} either way" for d in self.doubts
        ]
        lines.append(f"├ mu between {low:.4g} and {high:.4g}, at {self.omega:.4g} rad/s")
        if self.critical:
            worst = ", ".join(f"{path} = {value:.5g}" for path, value in self.critical.items())
            sure = "confirmed" if self.confirmed else "NOT confirmed"
            lines.append(f"├ at {self.found:.4g} times the ranges a pole is on the axis: {worst}")
            lines.append(f"├ {sure} on the true plant: grows with {self.growth:.2g} 1/s beyond it")
        else:
            lines.append(f"├ no unstable parameters found up to {self.asked:.3g} times the ranges")
        lines.append(f"├ {self.unstable} of {self.draws} random plants inside are unstable")
        if self.gain_radius is not None:
            lines.append(f"├ gains: {self.gain_radius}")
        m = self.margins
        lines.append(
            f"└ disk margin {m.disk:.3g}, gain x {m.gain_down:.3g} to x {m.gain:.3g}, "
            f"further delay {1e3 * m.delay:.4g} ms"
        )
        return "\n".join(lines)


@one_thread()
def robustness(
    design: Design,
    uncertainty: Mapping[str, Any],
    *,
    masses: int | None = None,
    draws: int = 1000,
    seed: int = 0,
    progress: Progress | None = None,
) -> Robustness:
    """Return how far the plant's numbers may be off at once before a design is unstable.

    Parameters
    ----------
    design
        A stable design.
    uncertainty
        By dotted path of the case (or `payload`, `stiffness`, `delay`, ..), or ``drag`` for the
        linear drag coefficient of the design: a share of the value as 0.3 for 30 % either way,
        or a text with its unit as "20 ms" either way.  As in a family, added mass and
        submerged weight grow with ``payload.mass`` unless they are uncertain themselves.
    masses
        Rope masses; by default those of the design.
    draws
        Random plants to check the answer with.
    seed
        Of the draws.
    progress
        Called as progress(stage, done, total).

    Returns
    -------
    Robustness

    Raises
    ------
    InputError
        If the design is unstable, or a range is not valid.
    """
    check_range("robustness", "draws", draws, low=0)
    if design.margins is None:
        raise InputError("robustness: the design must be stable")
    tell = progress or (lambda stage, done, total: None)
    case, controller, question = design.sea_case, design.controller, design.question
    doubts = uncertain_numbers(case, design.drag, uncertainty)
    count = design.masses if masses is None else masses
    loop = uncertain_loop(case, controller, doubts, masses=count, drag=design.drag, seed=seed)
    nominal = loop.plant_at([0.0] * len(loop.doubts))
    if closed_loop_poles(nominal.without_delays(_PADE), controller).real.max() >= 0.0:
        raise InputError(f"robustness: the design is unstable on {count} rope masses")
    grid = grid_of(loop)
    asked = furthest(loop)
    tell("critical", 0, 2)
    worst = critical_point(loop, grid)
    tell("critical", 1, 2)
    near = [] if worst is None else [worst.omega]
    found = math.inf if worst is None else worst.size
    upper, at = proved_bound(loop, grid, near, 1.0 / (asked if worst is None else found))
    proved = 1.0 / upper
    confirmed, growth = None, math.nan
    if worst is not None:
        confirmed, growth = _unstable(loop, [(1.0 + _PAST) * d for d in worst.delta])
    tell("draws", 0, draws)
    unstable = 0
    rng = np.random.default_rng(seed)
    reach = _INSIDE * min(proved, 1.0)
    for k in range(draws):
        delta = [float(rng.uniform(d.least, 1.0)) for d in loop.doubts]
        if k % 2:
            delta = [float(np.sign(x)) for x in delta]
        # Every other one in a corner, where it hurts more often than inside.
        plant = loop.quick([reach * x for x in delta])
        poles = closed_loop_poles(plant.without_delays(_PADE), controller)
        unstable += bool(poles.real.max() >= 0.0)
        if k % 50 == 49:
            tell("draws", k + 1, draws)
    try:
        radius = gain_radius(nominal, question.law, question.values(design.parameters))
    except InputError:  # a structure that is not affine in its gains
        radius = None
    pairs = () if worst is None else zip(loop.doubts, worst.delta, strict=True)
    return Robustness(
        doubts=loop.doubts,
        proved=proved,
        found=found,
        omega=worst.omega if worst is not None else at,
        critical=MappingProxyType({d.path: d.at(x) for d, x in pairs}),
        confirmed=confirmed,
        growth=growth,
        asked=asked,
        error=loop.error,
        draws=draws,
        unstable=unstable,
        gain_radius=radius,
        margins=design.margins,
    )


def _unstable(loop: UncertainLoop, delta: Sequence[float]) -> tuple[bool, float]:
    """Return whether the true plant is unstable, by poles and winding number; and its growth."""
    plant = loop.plant_at(delta)
    poles = closed_loop_poles(plant.without_delays(_PADE), loop.controller)
    growth = float(poles.real.max())
    winding = winding_of_plant(plant, LawMatrices.of(loop.controller, plant), poles)
    return growth > 0.0 and winding.unstable > 0, growth
