"""Checks that a verified winch and a verified tuning share: `CheckedLoop` and what it is asked."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce

import numpy as np
import numpy.typing as npt

from models.basics import ComplexArray, SolverError, StillhookError
from models.plant import LinearPlant

from .claims import ControllerMatrices, LoopClaims, SpectralSource
from .demands import Demand
from .nyquist import CurveMargins, curve_margins
from .recompute import LawMatrices, Loop, closed_matrices, moments, moments_of_views
from .verification import Check, Verification, agreement, failure
from .winding import Winding, count_unstable, open_loop_poles

PADE = 8  # order of the delay models: those of the optimiser have five or six
_COUNTED_PADE = 6  # order of the delay models that say which poles a limit on poles counts
_LATE, _LATE_PADE = 0.2, 12  # delay beyond which that is too little [s], and the order it takes
_STEP, _SECANTS = 1e-6, 12  # first relative step of the secant method, and how many it takes
_FARTHEST, _ARRIVED = 0.1, 1e-7  # its relative steps: at most, and at a root
TIGHT = 1e-4  # of margins, drag and limits on the design's own plant


def looked_at(steps: Mapping[str, Callable[[], list[Check]]], on: str) -> Verification:
    """Return the verification of checks by name, those that cannot be computed among the failed.

    `on` is what the loop was found stable on; without that, by the first checks, the others mean
    nothing and are not made.
    """
    checks: list[Check] = []
    for name, make in steps.items():
        try:
            checks += make()
        except (StillhookError, np.linalg.LinAlgError, ValueError, ArithmeticError, KeyError) as e:
            checks.append(failure(name, f"could not be computed: {e}"))
        if name == "stability" and not all(check.ok for check in checks):
            break
    count = sum(check.counts for check in checks)
    return Verification.of(checks, f"verified{on}, {count} checks passed")


def winding_of_plant(plant: LinearPlant, law: LawMatrices, marks: npt.ArrayLike = ()) -> Winding:
    """Count the unstable poles of a loop on a linear plant, delays exact.

    The law is that of the controller around the plant, u = +C y.  `marks` are further points [1/s]
    near which the loop is lively, such as its closed-loop poles.
    """
    poles = _open_poles(plant, law)
    loop = Loop(plant=plant, law=law, marks=poles)
    # A direct path that is late turns for ever; one that is not ends at a number.
    through = np.eye(len(plant.inputs)) - law.D @ plant.D
    limit = 1.0 if any(plant.delays) else float(np.linalg.det(through))
    if limit == 0.0:
        return Winding(failure="the loop is not well posed: I - D_c D is singular")
    return count_unstable(loop.difference, poles=poles, marks=marks, at_infinity=limit)


def winding_check(winding: Winding, on: str) -> Check:
    """Return the check that a winding number says "stable"."""
    if winding.failure:
        return failure("winding number", f"on {on}: {winding.failure}")
    note = f"unstable poles on {on}, exact delay; {winding.points} points up to |s| = "
    note += f"{winding.radius:.3g} 1/s, beyond it |L| < {max(winding.tail, 1e-9):.2g}"
    if winding.open_loop:
        note += f"; {winding.open_loop} open-loop poles are unstable"
    if winding.marginal:
        note += f"; {winding.marginal} closed-loop poles lie on the imaginary axis"
    return Check(
        name="winding number",
        ok=winding.stable,
        claimed=0.0,
        found=float(winding.unstable + winding.marginal),
        note=note,
    )


def pade_order(plant: LinearPlant, usual: int = PADE) -> int:
    """Return the order of delay models that tells a loop's poles, rope and all."""
    return _LATE_PADE if max(plant.delays, default=0.0) > _LATE else usual


def closed_poles(plant: LinearPlant, law: LawMatrices, usual: int = PADE) -> ComplexArray:
    """Return the poles of a loop with Pade delays of `pade_order`, (n,) [1/s]."""
    rational = plant.without_delays(pade_order(plant, usual))
    return np.asarray(np.linalg.eigvals(closed_matrices(rational, law)[0]), dtype=np.complex128)


def pole_check(
    name: str, plant: LinearPlant, poles: ComplexArray, on: str, slowest: float
) -> Check:
    """Return the check that the `closed_poles` on a plant lie left of -slowest [1/s]."""
    order = pade_order(plant)
    growth = float(poles.real.max(initial=-np.inf))
    return Check(
        name=name,
        ok=growth < -slowest,
        found=growth,
        note=f"largest real part [1/s] of {poles.size} poles on {on}, Pade order {order}",
    )


def closed_loop_marks(plant: LinearPlant, law: LawMatrices) -> ComplexArray:
    """Return the poles [1/s] of open and closed loop, without integrators."""
    return _marks(_open_poles(plant, law), closed_poles(plant, law))


def _open_poles(plant: LinearPlant, law: LawMatrices) -> ComplexArray:
    return np.concatenate([open_loop_poles(plant.A), open_loop_poles(law.A)])


def _marks(*poles: ComplexArray) -> ComplexArray:
    found = np.concatenate(poles)
    return np.asarray(found[np.abs(found) > 0.0], dtype=np.complex128)


def roots_near(
    function: Callable[[ComplexArray], ComplexArray], begins: ComplexArray
) -> ComplexArray:
    """Return roots [1/s] of an analytic function that the secant method finds near some points."""
    # Not at the points themselves: where a controller has a pole its response has no value.
    before, s = begins * (1.0 - _STEP), begins * (1.0 + _STEP)
    with np.errstate(all="ignore"):
        last = function(before)
        for _ in range(_SECANTS):
            value = function(s)
            move = value * (s - before) / (value - last)
            move = np.where(np.isfinite(move) & (value != 0.0), move, 0.0)
            before, last = s, value
            s = s - move * np.minimum(1.0, _FARTHEST * np.abs(s) / np.abs(move))
    arrived = np.abs(s - before) < _ARRIVED * np.abs(s)
    return np.asarray(s[arrived & (s.imag > 0.0)])


@dataclass(frozen=True, kw_only=True, eq=False)
class CheckedLoop(Loop):
    """A loop put together again, what shakes it, and what is asked of it."""

    sources: Sequence[SpectralSource]  #: What shakes it.
    demands: Mapping[str, Demand]  #: What is demanded of it, by name.
    open_poles: ComplexArray  #: Poles [1/s] of plant and controller, integrators as exact zeros.
    closed_poles: ComplexArray  #: `closed_poles` of the loop [1/s].
    own: Iterable[str]  #: Outputs whose variances are wanted besides.
    #: The loop without losses that switch, whose margins count too; None where it has none.
    still: CheckedLoop | None = None
    #: What the reference unit shows with each combination of signs of its errors, if it has some.
    signs: Sequence[complex] = ()
    rest: Sequence[SpectralSource] = ()  #: What shakes the loop beside those errors.

    @classmethod
    def of(
        cls,
        plant: LinearPlant,
        controller: ControllerMatrices,
        sources: Sequence[SpectralSource],
        demands: Mapping[str, Demand],
        own: Iterable[str],
    ) -> CheckedLoop:
        """Return the loop of a controller around a plant."""
        law = LawMatrices.of(controller, plant)
        opened, closed = _open_poles(plant, law), closed_poles(plant, law)
        return cls(
            plant=plant,
            law=law,
            marks=_marks(opened, closed),
            open_poles=opened,
            closed_poles=closed,
            sources=sources,
            demands=demands,
            own=own,
        )

    @cached_property
    def region(self) -> tuple[ComplexArray, ComplexArray]:
        """Poles [1/s] of the closed loop and of its delay models, where limits on them hold."""
        rational = self.plant.without_delays(pade_order(self.plant, _COUNTED_PADE))
        own = len(self.plant.states)
        models = np.linalg.eigvals(rational.A[own:, own:]).astype(np.complex128)
        return closed_poles(self.plant, self.law, _COUNTED_PADE), models

    @cached_property
    def margins(self) -> CurveMargins:
        """Its margins, root by root: the worst over all loops broken at an input."""
        count = len(self.plant.inputs)
        pieces = [curve_margins(self.broken(i), self.marks) for i in range(count)]
        if self.still is not None:
            pieces.append(self.still.margins)
        return reduce(CurveMargins.worse, pieces)

    @cached_property
    def moments(self) -> dict[str, tuple[float, ...]]:
        """Spectral moments of all that is asked for, by output; none of higher order than needed.

        Integrals to infinity may be infinite, each on its own.
        """
        return self._views[0]

    @cached_property
    def _views(self) -> list[dict[str, tuple[float, ...]]]:
        """`moments`, and those with each combination of signs of the unit's errors."""
        demands = [*self.demands.values()]
        orders: dict[str, tuple[int, ...]] = dict.fromkeys(self.own, (0,))
        for demand in demands:
            for name, own in demand.orders.items():
                orders[name] = max(orders.get(name, ()), own, key=len)
        if any(source.band is None for source in self.sources):
            found = {
                n: tuple(self._endless(n, order) for order in own) for n, own in orders.items()
            }
            # Where it cannot be told they are taken as going together, the worst they can do.
            return [found | {d.together: (1.0,) for d in demands if d.together}]
        pairs = {demand.together: demand.outputs for demand in demands if demand.together}
        views = [(1.0 + 0.0j, self.sources), *((sign, self.rest) for sign in self.signs)]
        most = max(orders.values(), key=len, default=(0,))
        return moments_of_views(self, sorted(orders), views, orders=most, pairs=pairs)

    def _endless(self, output: str, order: int) -> float:
        delay = max(self.plant.delays, default=0.0)
        try:
            return moments(self, [output], self.sources, orders=(order,), delay=delay)[output][0]
        except SolverError:
            return math.inf

    def rms(self, output: str) -> float:
        """Return the standard deviation of an output."""
        return math.sqrt(self.moments[output][0])

    def measured(self, demand: Demand) -> float:
        """Return what the loop makes of a demand, with the worst signs of the unit's errors."""
        each = self._views[1:] if demand.orders and self.signs else [self.moments]
        found = [demand.measured(self, self.margins, lambda: self.region, one) for one in each]
        if self.still is not None and not demand.orders:
            still = self.still
            found.append(demand.measured(still, self.margins, lambda: still.region, self.moments))
        return min(found) if demand.at_least else max(found)

    def margin_checks(self, claimed: object | None) -> list[Check]:
        """Return the checks of a `synth.loop.margins.Margins` against those found root by root."""
        if claimed is None:
            return [failure("margins", "the loop is stable but no margins are claimed")]

        def of(name: str) -> tuple[float, float]:
            return float(getattr(claimed, name)), float(getattr(self.margins, name))

        return [
            agreement("margins.max_sensitivity", *of("max_sensitivity"), TIGHT),
            inverse_agreement("margins.gain", *of("gain")),
            agreement("margins.gain_down", *of("gain_down"), TIGHT, scale=1.0),
            agreement("margins.phase", *of("phase"), TIGHT, "[rad]", scale=0.1),
            agreement("margins.delay", *of("delay"), TIGHT, "[s]", scale=1e-3),
            agreement("margins.disk", *of("disk"), TIGHT),
        ]

    def limit_checks(self, answer: LoopClaims, by: str, on: str) -> list[Check]:
        """Return a check of each limit that is stated, and of strangers.

        `by` is what states the limits, and `on` what the answer is called.
        """
        checks, claims = [], answer.limits
        for name, demand in self.demands.items():
            use = claims.get(name)
            if use is None:
                note = f"the {by} states it, the {on} does not"
                checks.append(failure(f"limits.{name}", note))
                continue
            value = self.measured(demand)
            if demand.kind == "gain":
                check = inverse_agreement(f"limits.{name}", use.value, value)
            else:
                check = agreement(f"limits.{name}", use.value, value, TIGHT)
            note = ""
            if not math.isclose(use.bound, demand.bound, rel_tol=1e-9):
                note = f"the bound is {use.bound:.6g} but the {by} says {demand.bound:.6g}"
            elif use.enforced != demand.enforced:
                note = f"the {by} says otherwise whether it is enforced"
            elif answer.ok and demand.enforced and not demand.kept(value, TIGHT):
                note = f"the {on} counts as good but breaks the bound {demand.bound:.6g}"
            checks.append(replace(check, ok=False, note=note) if note else check)
        for name in sorted(set(claims) - set(self.demands)):
            checks.append(failure(f"limits.{name}", f"the {by} has no such limit"))
        return checks


def inverse_agreement(name: str, claimed: float, found: float) -> Check:
    """Return the check that two gain margins agree: thousands and no bound are the same."""
    same = abs(1.0 / claimed - 1.0 / found) <= TIGHT
    check = agreement(name, claimed, found, TIGHT, "difference of 1/gain")
    return replace(check, ok=bool(same))
