r"""Lower bound on a variance for any linear controller, by LQG duality: `Bound`, `lqg_bound`.

    plant + spectra + weights + rms limits -> filters for the sea, Pade models for the delays
      -> multipliers that make the LQG optimum highest (`synth.bound.dual`)
      -> the same on the true spectra and exact delays, less what the models missed
         (`synth.bound.truth`) -> Bound

No controller that hears these sensors, with this noise, and keeps these rms limits does better:
of any order, with any margins or none.  It is the yardstick that goes with every design.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from models.basics import FloatArray, InputError, White, check_range, one_thread, pick
from models.plant import LinearPlant, ShapingFilter

from ..loop import Disturbance, LinearController, disturbances
from ..structures import reduced
from .dual import Dual, DualPoint, shaped_plant, with_input_outputs
from .spectral_factor import SpectralFactor, spectral_factor
from .truth import TrueCost, refitted, truth_of

_ENOUGH = 1e-3  # of the bound's variance: less need not be won by fitting again
_BROKEN = 1.01  # a limit that is exceeded by more, at the highest multipliers, cannot be kept


@dataclass(frozen=True, kw_only=True, eq=False)
class Bound:
    """A lower bound, with the question that it answers and the controller that comes next to it."""

    plant: LinearPlant  #: The plant with its exact delays.
    sources: tuple[Disturbance, ...]  #: The disturbances and their true spectra.
    minimise: Mapping[str, float]  #: Weights on variances.
    limits: Mapping[str, float]  #: Limits on rms values by name of an output or input.
    #: No linear controller that keeps the limits has a smaller root of the weighted variance;
    #: infinity if none can keep them.
    value: float
    multipliers: Mapping[str, float]  #: Of the limits by name, per squared unit.
    #: The share of the bound's variance that one percent on the limit's rms is worth, times 100.
    prices: Mapping[str, float]
    #: Root of the weighted variance of the controller found, on the true spectra and delays.
    attained: float
    rms: Mapping[str, float]  #: Of what is limited, with that controller.
    gap: float  #: Duality gap of the model over its variance.
    missed: float  #: What fit and Pade model cost the bound, over the attained variance.
    fits: Mapping[str, float]  #: L1 error of each fitted spectrum over its variance.
    controller: LinearController  #: The LQG controller of the model, full order, u = +C y.
    pade: int
    assumptions: tuple[str, ...]  #: What the figure holds for, in words.
    point: DualPoint = field(repr=False)  #: The optimum of the rational model.
    dual: Dual = field(repr=False)
    filters: Mapping[str, ShapingFilter | float] = field(repr=False)

    @property
    def feasible(self) -> bool:
        """Whether any linear controller at all can keep the limits."""
        return math.isfinite(self.value)

    @property
    def order(self) -> int:
        """Number of states of the controller."""
        return len(self.controller.A)

    def __str__(self) -> str:
        """Return a small tree."""
        whole = ", ".join(n if w == 1.0 else f"{w:g} {n}" for n, w in self.minimise.items())
        unit = (
            self.plant.units.get(next(iter(self.minimise)), "") if len(self.minimise) == 1 else ""
        )
        lines = [
            f"Bound: no linear controller has less than {self.value:.5g} {unit} rms of {whole}"
            if self.feasible
            else "Bound: no linear controller keeps the limits",
            f"├ attained {self.attained:.5g} {unit} by LQG of order {self.order}",
            f"├ duality gap {self.gap:.1e}, fit and delay model {self.missed:.1e} of the variance",
        ]
        for name, bound in self.limits.items():
            lines.append(
                f"├ {name}: {100.0 * self.rms[name] / bound:.1f} % of {bound:.4g} rms, "
                f"price {self.prices[name]:.2g}"
            )
        lines += [f"├ {text}" for text in self.assumptions]
        lines[-1] = "└" + lines[-1][1:]
        return "\n".join(lines)


@one_thread()
def lqg_bound(
    plant: LinearPlant,
    spectra: Mapping[str, Any],
    minimise: Mapping[str, float],
    limits: Mapping[str, float] | None = None,
    *,
    pade: int = 2,
    order: int = 8,
    refits: int = 2,
    assumptions: tuple[str, ...] = (),
    begin: Mapping[str, float] | None = None,
) -> Bound:
    """Return a lower bound on a weighted variance for every linear controller.

    Parameters
    ----------
    plant
        Any linear plant; what the controller may hear are its measurements, with their delays.
        Its poles lie left of the imaginary axis or at zero.
    spectra
        One-sided spectra of disturbances by name, as `synth.design.tuning` takes them.  Every
        measurement needs white noise.  A spectrum with a band is zero outside it.
    minimise
        Weights on the variances of outputs by name.
    limits
        Limits on the rms of outputs, or of inputs, by name.  Together with `minimise` they have
        to charge every input.
    pade
        Order of the delay models, 1 to 6.
    order
        States of the filter of a spectrum that is not rational: even, 2 to 12.
    refits
        How often these are fitted again, to what counts in the loop.
    assumptions
        Further remarks that the bound carries.
    begin
        Multipliers to begin with, as those of a bound with other sensors.

    Raises
    ------
    InputError
        If a name is unknown, a limit is not above zero, an input is free of charge, a
        measurement has no noise, or the plant is unstable other than by integrators.
    SolverError
        If a Riccati equation has no stabilising solution.
    """
    limits = dict(limits or {})
    plant = with_input_outputs(plant, list(limits))
    _check(plant, minimise, limits)
    sources = disturbances(spectra, plant.independent_disturbances)
    check_range("bound", "pade", pade, low=1, high=6)
    model = plant.without_delays(pade, at="measurements")
    fitted: dict[str, SpectralFactor | ShapingFilter | float] = {}
    for s, value in zip(sources, spectra.values(), strict=True):
        if isinstance(value, White):
            fitted[s.name] = value.intensity
        else:  # what is rational already needs no fit
            known = isinstance(value, ShapingFilter)
            fitted[s.name] = value if known else spectral_factor(s, order)
    start: FloatArray | None = None
    if begin is not None and all(begin.get(name, 0.0) > 0.0 for name in limits):
        start = np.array([begin[name] for name in limits])
    squares = np.array(list(limits.values()), dtype=np.float64) ** 2
    asked = np.ones(len(limits))
    best: tuple[float, Dual, DualPoint, TrueCost, dict[str, ShapingFilter | float]] | None = None
    # Whatever the fit, each round's figure is a lower bound (see `truth`), so the highest is kept;
    # a further round only has to make the model better where the loop feels it.
    for attempt in range(max(0, refits) + 1):
        filters = {n: f.filter if isinstance(f, SpectralFactor) else f for n, f in fitted.items()}
        dual = Dual(shaped_plant(model, filters), minimise, limits)
        dual.squares = squares * asked
        point = dual.maximise(start)
        start = point.multipliers
        truth, X = truth_of(plant, model, sources, filters, dual, point)
        loop = truth.judge(X, dual.charge(point.multipliers))
        found = loop.cost - loop.missed - float(point.multipliers @ squares)
        if best is None or found > best[0]:
            best = (found, dual, point, loop, filters)
        rms2 = np.array([loop.variances[name] for name in limits])
        off = float(point.multipliers @ np.abs(rms2 - squares)) if limits else 0.0
        if max(loop.missed, off) <= _ENOUGH * max(found, 0.0) or attempt == refits:
            break
        # What the model has to keep for the true loop to keep its limits.
        asked = np.clip(point.variances[dual.rows] / np.maximum(rms2, 1e-300), 0.25, 4.0)
        if loop.missed > _ENOUGH * max(found, 0.0):
            fitted = refitted(fitted, sources, truth, X, dual.charge(point.multipliers))
    assert best is not None
    return _bound(plant, sources, minimise, limits, pade, best, assumptions)


def _bound(
    plant: LinearPlant,
    sources: tuple[Disturbance, ...],
    minimise: Mapping[str, float],
    limits: Mapping[str, float],
    pade: int,
    best: tuple[float, Dual, DualPoint, TrueCost, dict[str, ShapingFilter | float]],
    assumptions: tuple[str, ...],
) -> Bound:
    found, dual, point, loop, filters = best
    rms = {name: math.sqrt(loop.variances[name]) for name in limits}
    attained = sum(w * loop.variances[name] for name, w in minimise.items())
    prices = point.multipliers * np.array(list(limits.values())) ** 2
    kept = all(rms[name] <= _BROKEN * bound for name, bound in limits.items())
    # Multipliers that grow without end while a limit stays broken: the dual is unbounded.  They are
    # held against the model's own cost: the true loop of a controller that spares nothing to keep
    # the limits may be a thousand times as bad.
    hopeless = not kept and float(prices.max()) > 1e3 * max(dual.primal(point), 1e-300)
    late = {
        f"{1e3 * d:g} ms": [
            n for n, t in zip(plant.measurements, plant.delays, strict=True) if t == d
        ]
        for d in sorted(set(plant.delays))
    }
    heard = "; ".join(
        ", ".join(names) + (f" {delay} late" if delay != "0 ms" else "")
        for delay, names in late.items()
    )
    fitted = {n: f for n, f in filters.items() if isinstance(f, ShapingFilter)}
    said = [
        f"sensors: {heard}",
        "shaken by " + ", ".join(s.name for s in sources),
        *(
            f"{n}: factor of order {f.order}, fit error {f.shape_error:.2g}"
            for n, f in fitted.items()
        ),
    ]
    return Bound(
        plant=plant,
        sources=sources,
        minimise=dict(minimise),
        limits=dict(limits),
        value=math.inf if hopeless else math.sqrt(max(found, 0.0)),
        multipliers=dict(zip(limits, point.multipliers.tolist(), strict=True)),
        prices=dict(zip(limits, (2.0 * prices / max(found, 1e-300)).tolist(), strict=True)),
        attained=math.sqrt(attained),
        rms=rms,
        gap=dual.gap(point),
        missed=loop.missed / max(attained, 1e-300),
        fits={n: f.shape_error for n, f in fitted.items()},
        controller=reduced(dual.plant, point.regulator, dual.estimator, len(dual.plant.states)),
        pade=pade,
        assumptions=(*said, *assumptions),
        point=point,
        dual=dual,
        filters=filters,
    )


def _check(plant: LinearPlant, minimise: Mapping[str, float], limits: Mapping[str, float]) -> None:
    pick("bound: minimise", "output", plant.outputs, list(minimise))
    pick("bound: limits", "output", plant.outputs, list(limits))
    for name, weight in minimise.items():
        check_range("bound", f"minimise[{name}]", weight, low=0.0)
    for name, bound in limits.items():
        check_range("bound", f"limits[{name}]", bound, low=0.0, open_low=True)
    if not any(weight > 0.0 for weight in minimise.values()):
        raise InputError("bound: minimise must give at least one output a weight above 0")
    poles = plant.poles()
    size = float(np.abs(poles).max(initial=1.0))
    bad = poles[
        (poles.real > 1e-9 * size)
        | ((np.abs(poles.real) <= 1e-9 * size) & (np.abs(poles) > 1e-6 * size))
    ]
    if any(plant.delays) and bad.size:
        raise InputError(
            "bound: a plant with delays must have its poles left of the imaginary axis or at "
            f"zero, got {bad[0]:.4g} 1/s"
        )
