r"""Morris's screening: which of many numbers can be forgotten, by elementary effects.

    ranges -> r trajectories through a grid, one number moved at a time -> one sweep -> effects

An elementary effect is the change of ln(figure) for one number moved through the ranges' unit
cube, per range.  Its mean size mu* says how much the number matters, its spread sigma how much
that hangs on the others or on where it stands (Morris, Technometrics 33, 1991; mu*: Campolongo et
al., Environ. Model. Softw. 22, 2007).  It costs r (d + 1) cases, far fewer than Sobol's indices.
An effect with an unstable end is left out and counted.
"""

from dataclasses import dataclass

import numpy as np

from models.basics import FloatArray, ReadOnlyArrays, check_range, shows_progress
from models.spread import Spread

from ..design import Design
from ..search import Progress
from .global_indices import Evaluate, evaluate_rows, on_ranges

_LEVELS = 4
_ENDS = 0.01  # a normal distribution has no ends: the cube is cut there


@dataclass(frozen=True, kw_only=True, eq=False)
class Screening(ReadOnlyArrays):
    """Elementary effects of every number on the logarithm of one figure."""

    #: The figure, and the numbers that vary (d,).
    figure: str
    paths: tuple[str, ...]
    #: mu*, mu and sigma of the effects (d,) [-], in ln(figure) per range.
    mean_size: FloatArray
    mean: FloatArray
    spread: FloatArray
    #: Trajectories, cases computed, and how many of them are unstable.
    trajectories: int
    evaluations: int
    unstable: int
    lost: FloatArray  #: Effects of each number that are left out for that, (d,).

    def __str__(self) -> str:
        """Return a small tree, the largest first."""
        lines = [f"Screening of {self.figure}: {self.evaluations} cases, {self.unstable} unstable"]
        for k in np.argsort(-np.nan_to_num(self.mean_size, nan=-1.0)):
            lines.append(
                f"├ {self.paths[k]}: mu* {self.mean_size[k]:.3f}, mu {self.mean[k]:+.3f}, "
                f"sigma {self.spread[k]:.3f}"
            )
        lines[-1] = "└" + lines[-1][1:]
        return "\n".join(lines)


@shows_progress("screening")
def morris_screening(
    design: Design,
    spread: Spread,
    *,
    trajectories: int = 32,
    figure: str = "payload_rms",
    seed: int = 0,
    progress: Progress | None = None,
) -> Screening:
    """Return the elementary effects of a spread's numbers on a figure of a design.

    Parameters
    ----------
    design, spread
        The design, whose controller is fixed, and the ranges.
    trajectories
        How many trajectories, each of one case more than there are numbers.
    figure
        A variable of `synth.sweeps.frequency.frequency_sweep`.
    seed, progress
        Seed of the trajectories; called with a word, the cases done and their count.

    Raises
    ------
    InputError
        If the spread does not fit the case.
    """
    ready, evaluate = evaluate_rows(design, spread, figure, progress)
    return effects_of(evaluate, ready, trajectories=trajectories, figure=figure, seed=seed)


def effects_of(
    evaluate: Evaluate, spread: Spread, *, trajectories: int, figure: str = "figure", seed: int = 0
) -> Screening:
    """Return the elementary effects of any positive function of a spread's rows, (n, d) to (n,).

    It is NaN where there is none.  The ranges are in plain numbers (`Spread.on`); the rest is as in
    `morris_screening`.
    """
    check_range("sensitivity", "trajectories", trajectories, low=2, high=100_000)
    d = len(spread.paths)
    rng = np.random.default_rng(seed)
    points = np.empty((trajectories, d + 1, d))
    order = np.empty((trajectories, d), dtype=np.intp)
    jump = _LEVELS / (2.0 * (_LEVELS - 1.0))
    for r in range(trajectories):
        # A corner of the lower half of the grid, each number then up or down by the same jump.
        start = rng.integers(0, _LEVELS // 2, d) / (_LEVELS - 1.0)
        down = rng.random(d) < 0.5
        points[r, 0] = np.where(down, start + jump, start)
        order[r] = rng.permutation(d)
        for k, j in enumerate(order[r]):
            points[r, k + 1] = points[r, k]
            points[r, k + 1, j] += -jump if down[j] else jump
    cube = _ENDS + (1.0 - 2.0 * _ENDS) * points.reshape(-1, d)
    values = np.log(evaluate(on_ranges(spread, cube))).reshape(trajectories, d + 1)
    steps = np.diff(values, axis=1)
    effects = np.empty((trajectories, d))
    for r in range(trajectories):
        moved = np.diff(points[r], axis=0)[np.arange(d), order[r]]
        effects[r, order[r]] = steps[r] / moved
    known = np.isfinite(effects)
    count = known.sum(axis=0)
    safe = np.where(known, effects, 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = safe.sum(axis=0) / count
        size = np.abs(safe).sum(axis=0) / count
        square = np.where(known, (effects - mean) ** 2, 0.0).sum(axis=0) / (count - 1)
    return Screening(
        figure=figure,
        paths=spread.paths,
        mean_size=size,
        mean=mean,
        spread=np.sqrt(square),
        trajectories=trajectories,
        evaluations=values.size,
        unstable=int(np.count_nonzero(~np.isfinite(values))),
        lost=(trajectories - count).astype(np.float64),
    )
