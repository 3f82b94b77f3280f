r"""Sobol's indices: the share of a figure's variance that each number is to blame for.

    ranges -> two Sobol designs A, B and their crossings -> one sweep -> indices with intervals

The first-order index of a number is the share of the figure's variance that knowing it alone
would take away, the total index the share that is left when all others are known (Sobol, Math.
Comput. Simul. 55, 2001; estimator: Saltelli et al., Comput. Phys. Commun. 181, 2010, as in
`scipy.stats.sobol_indices`).  What is unstable has no rms: a base point of which any crossing is
unstable is left out with all its crossings, counted, and never averaged in; the indices are then
those of the stable part.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from models.basics import FloatArray, InputError, ReadOnlyArrays, check_range, shows_progress
from models.spread import Spread

from ..design import Design
from ..search import Progress

Evaluate = Callable[[FloatArray], FloatArray]

_FEWEST = 32  # base points without which an index means nothing


def evaluate_rows(
    design: Design, spread: Spread, figure: str, progress: Progress | None
) -> tuple[Spread, Evaluate]:
    """Return the spread on the design's case in SI, and a function from rows (n, d) to a figure.

    That is (n,), NaN where the loop is unstable.  The figure is a variable of
    `synth.sweeps.frequency.frequency_sweep`, or ``modulus_margin``, 1/M_s: near the edge of
    stability M_s is all tail, and its variance that of a few cases.

    Raises InputError if the spread does not fit the case, or there is no such figure.
    """
    from ..sweeps import FrequencyEngine

    inverse = figure == "modulus_margin"
    metric = "max_sensitivity" if inverse else figure
    engine = FrequencyEngine(design, spread, metrics=[metric])

    def evaluate(rows: FloatArray) -> FloatArray:
        found = engine.evaluate(rows, progress)
        values = np.where(found["stable"], np.asarray(found[metric], dtype=np.float64), np.nan)
        return 1.0 / values if inverse else values

    return engine.spread, evaluate


@dataclass(frozen=True, kw_only=True, eq=False)
class SobolIndices(ReadOnlyArrays):
    """Sobol's indices of one figure."""

    figure: str  #: The figure.
    paths: tuple[str, ...]  #: The numbers that vary, (d,).
    #: First-order and total indices (d,) [-].
    first: FloatArray
    total: FloatArray
    #: Their bootstrap intervals (d, 2) [-].
    first_interval: FloatArray
    total_interval: FloatArray
    confidence: float  #: Level of the intervals [-].
    #: Base points drawn, and those used: the largest power of two of which all crossings are
    #: stable.
    samples: int
    kept: int
    #: Cases computed, and those of them that are unstable.
    evaluations: int
    unstable: int

    def __str__(self) -> str:
        """Return a small tree, the largest total first."""
        order = np.argsort(-self.total)
        lines = [
            f"SobolIndices of {self.figure}: {self.evaluations} cases, "
            f"{self.unstable} of them unstable and left out"
        ]
        for k in order:
            low, high = self.total_interval[k]
            lines.append(
                f"├ {self.paths[k]}: first {self.first[k]:.3f}, total {self.total[k]:.3f} "
                f"({low:.3f} to {high:.3f})"
            )
        lines[-1] = "└" + lines[-1][1:]
        return "\n".join(lines)


@shows_progress("Sobol indices")
def sobol_indices(
    design: Design,
    spread: Spread,
    *,
    samples: int = 1024,
    figure: str = "payload_rms",
    seed: int = 0,
    confidence: float = 0.95,
    progress: Progress | None = None,
) -> SobolIndices:
    """Return Sobol's indices of a figure of a design over a spread.

    Parameters
    ----------
    design
        The design; its controller is fixed.
    spread
        Independent ranges.
    samples
        Base points, a power of two; the sweep has samples times (numbers + 2) cases.
    figure
        A variable of `synth.sweeps.frequency.frequency_sweep`, or ``modulus_margin``, 1/M_s.
    seed, confidence
        Seed of the design and of the bootstrap; level of the intervals.
    progress
        Called with a word, the cases done and their count.

    Raises
    ------
    InputError
        If the spread has correlations, or hardly any case is stable.
    """
    ready, evaluate = evaluate_rows(design, spread, figure, progress)
    return indices_of(
        evaluate, ready, samples=samples, figure=figure, seed=seed, confidence=confidence
    )


def indices_of(
    evaluate: Evaluate,
    spread: Spread,
    *,
    samples: int,
    figure: str = "figure",
    seed: int = 0,
    confidence: float = 0.95,
    resamples: int = 199,
) -> SobolIndices:
    """Return Sobol's indices of any function of a spread's rows, (n, d) to (n,), NaN for none.

    The ranges are independent, in plain numbers (`Spread.on`); the bootstrap draws so many
    resamples, and the rest is as in `sobol_indices`.

    Raises InputError as in `sobol_indices`.
    """
    from scipy.stats import bootstrap

    check_range("sensitivity", "confidence", confidence, low=0.5, high=0.9999)
    check_range("sensitivity", "samples", samples, low=_FEWEST, high=2**22)
    if samples & (samples - 1):
        raise InputError(f"sensitivity: samples must be a power of two, got {samples}")
    if spread.correlations:
        raise InputError("sensitivity: Sobol's indices need independent ranges, got correlations")
    A, B = _pair(spread, samples, seed)
    d = A.shape[1]
    # Radial sampling: A with column k of B differs from A by that number alone, and from B by all
    # the others, which is what first-order and total indices compare.
    crossed = []
    for k in range(d):
        rows = A.copy()
        rows[:, k] = B[:, k]
        crossed.append(rows)
    values = evaluate(np.concatenate([A, B, *crossed])).reshape(d + 2, samples)
    good = np.isfinite(values).all(axis=0)
    unstable = int(np.count_nonzero(~np.isfinite(values)))
    if np.count_nonzero(good) < _FEWEST:
        raise InputError(
            f"sensitivity: only {np.count_nonzero(good)} of {samples} base points are stable with "
            f"all their crossings, {_FEWEST} are needed: narrow the ranges"
        )
    # The estimator wants a power of two; the first so many of a Sobol sequence are balanced too.
    kept = values[:, good][:, : 2 ** int(np.log2(np.count_nonzero(good)))]
    spreads = np.ptp(kept)
    if spreads <= 1e-12 * np.abs(kept).max():
        raise InputError(f"sensitivity: {figure} does not move over these ranges")
    centred = kept - kept[:2].mean()
    first, total = _indices(centred)
    # SciPy's own bootstrap of the indices takes no seed.
    ends = bootstrap(
        [np.arange(kept.shape[1])],
        lambda columns: np.stack(_indices(centred[:, columns])),
        n_resamples=resamples,
        confidence_level=confidence,
        method="BCa",
        rng=np.random.default_rng(seed),
    ).confidence_interval
    intervals = np.stack([ends.low, ends.high], axis=-1)
    return SobolIndices(
        figure=figure,
        paths=spread.paths,
        first=first,
        total=total,
        first_interval=intervals[0],
        total_interval=intervals[1],
        confidence=confidence,
        samples=samples,
        kept=int(kept.shape[1]),
        evaluations=values.size,
        unstable=unstable,
    )


def _pair(spread: Spread, samples: int, seed: int) -> tuple[FloatArray, FloatArray]:
    """Return two independent designs: the halves of one Sobol sequence of twice the dimension."""
    from scipy.stats import qmc

    d = len(spread.paths)
    points = qmc.Sobol(2 * d, seed=np.random.default_rng(seed)).random(samples)
    points = np.clip(points, 1e-12, 1.0 - 1e-12)  # a normal distribution has no ends
    return on_ranges(spread, points[:, :d]), on_ranges(spread, points[:, d:])


def on_ranges(spread: Spread, points: FloatArray) -> FloatArray:
    """Return rows of values from points of the unit cube, (n, d)."""
    pairs = zip(spread.distributions.values(), points.T, strict=True)
    return np.stack([distribution.quantile(share) for distribution, share in pairs], axis=1)


def _indices(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return indices of first and of total order (Saltelli and others 2010, Table 2 (b) and (f)).

    Rows are the values at A, at B and at the crossings, less their common mean.
    """
    at_a, at_b, crossed = values[0], values[1], values[2:]
    variance = np.var(values[:2])
    first = np.mean(at_b * (crossed - at_a), axis=-1) / variance
    return first, 0.5 * np.mean((at_a - crossed) ** 2, axis=-1) / variance
