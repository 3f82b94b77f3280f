"""Where the poles of a closed loop lie: decay, damping and frequency, for limits on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.basics import BoolArray, ComplexArray

_AS_FAST = 0.8  # of the slowest model's pole: up to there a delay model is as good as the delay


@dataclass(frozen=True, kw_only=True)
class PoleRegion:
    """The smallest region of the left half plane that holds a loop's poles.

    Attributes
    ----------
    decay
        Least decay rate, -Re s of the rightmost pole [1/s]; negative for an unstable loop.
    damping
        Least damping ratio, -Re s/|s| [-]; 1 where no pole swings, 0 or less on the axis and
        beyond it.
    frequency
        Highest frequency, |s| of the fastest pole [rad/s].
    """

    decay: float
    damping: float
    frequency: float

    @staticmethod
    def of(poles: ComplexArray, models: ComplexArray | None = None) -> PoleRegion:
        """Return the region of a loop's poles [1/s].

        Parameters
        ----------
        poles
            The closed loop's poles, those that delay models bring with them among them.
        models
            Poles of the delay models alone.  A late loop has poles without end, all of them
            far left but for a few; the models put as many of their own there as their order
            is.  So each takes the pole nearest to it away, of the decaying ones; where damping
            is asked for, of those only that are too fast for the models to be right.
        """
        known = np.zeros(0, dtype=np.complex128) if models is None else models
        too_fast = np.abs(poles) > _AS_FAST * np.abs(known).min(initial=np.inf)
        swinging, all_left = _without(poles, known, too_fast), _without(poles, known)
        sizes = np.abs(swinging)
        ratios = -swinging.real / np.where(sizes > 0.0, sizes, 1.0)
        return PoleRegion(
            decay=float((-poles.real).min(initial=np.inf)),
            damping=float(ratios.min(initial=1.0)),
            frequency=float(np.abs(all_left).max(initial=0.0)),
        )


def _without(
    poles: ComplexArray, models: ComplexArray, among: BoolArray | bool = True
) -> ComplexArray:
    decaying = (poles.real < 0.0) & among
    left, others = poles[decaying], poles[~decaying]
    for model in models[: left.size]:
        left = np.delete(left, np.argmin(np.abs(left - model)))
    return np.concatenate([left, others])
