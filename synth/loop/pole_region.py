"""Where the poles of a closed loop lie: decay, damping and frequency, for limits on them.

A late loop has poles without end, all of them far left but for a few; the models that stand for
its delays put as many of their own there as their order is.  So each takes the pole nearest to it
away, of the decaying ones; where damping is asked for, of those only that are too fast for the
models to be right.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from models.basics import BoolArray, ComplexArray
from models.plant import LinearPlant

_PADE = 6  # order of the delay models that the poles are those of
_LATE, _LATE_PADE = 0.2, 12  # delay beyond which that is too little [s], and the order it takes
_AS_FAST = 0.8  # of the slowest model's pole: up to there a delay model is as good as the delay


@dataclass(frozen=True, kw_only=True)
class PoleRegion:
    """The smallest region of the left half plane that holds a loop's poles."""

    #: Least decay rate, -Re s of the rightmost pole [1/s]; negative for an unstable loop.
    decay: float
    #: Least damping ratio, -Re s/|s| [-]; 1 where no pole swings, 0 or less on the axis and beyond
    #: it.
    damping: float
    frequency: float  #: Highest frequency, |s| of the fastest pole [rad/s].

    @staticmethod
    def of(poles: ComplexArray, models: ComplexArray | None = None) -> PoleRegion:
        """Return the region of a loop's poles [1/s].

        They are all poles of the closed loop; `models` are those of the delay models alone, which
        are among them.
        """
        known = np.zeros(0, dtype=np.complex128) if models is None else models
        swinging, all_left = (poles[counted] for counted in counted_poles(poles, known))
        sizes = np.abs(swinging)
        ratios = -swinging.real / np.where(sizes > 0.0, sizes, 1.0)
        return PoleRegion(
            decay=float((-poles.real).min(initial=np.inf)),
            damping=float(ratios.min(initial=1.0)),
            frequency=float(np.abs(all_left).max(initial=0.0)),
        )


def with_delay_models(plant: LinearPlant) -> tuple[LinearPlant, ComplexArray]:
    """Return a plant with Pade models for its delays, and the poles of these alone [1/s]."""
    late = max(plant.delays, default=0.0) > _LATE
    modelled = plant.without_delays(_LATE_PADE if late else _PADE)
    own = len(plant.states)  # those of the models come after them
    models = modelled.A[own:, own:]
    return modelled, _poles(models.tobytes(), len(models))


@lru_cache(maxsize=64)
def _poles(matrix: bytes, size: int) -> ComplexArray:
    """Return the eigenvalues of delay models, (size,): a loop is closed many times with one."""
    found = np.linalg.eigvals(np.frombuffer(matrix).reshape(size, size)).astype(np.complex128)
    found.setflags(write=False)
    return found


def counted_poles(poles: ComplexArray, models: ComplexArray) -> tuple[BoolArray, BoolArray]:
    """Return which poles a damping ratio and which a highest frequency are about, (n,) each."""
    too_fast = np.abs(poles) > _AS_FAST * np.abs(models).min(initial=np.inf)
    return _without(poles, models, too_fast), _without(poles, models)


def _without(
    poles: ComplexArray, models: ComplexArray, among: BoolArray | bool = True
) -> BoolArray:
    decaying = (poles.real < 0.0) & among
    left = poles.real < np.inf
    for model in models[: np.count_nonzero(decaying)]:
        away = np.where(decaying & left, np.abs(poles - model), np.inf)
        left[np.argmin(away)] = False
    return left
