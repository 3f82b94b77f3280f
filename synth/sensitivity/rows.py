"""Figures of a design at given rows of a spread: what global sensitivity asks of the sweep."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from models.basics import FloatArray
from models.spread import Spread

if TYPE_CHECKING:
    from ..design import GainDesign, StructureDesign

Progress = Callable[[str, int, int], None]


def evaluate_rows(
    design: GainDesign | StructureDesign, spread: Spread, figure: str, progress: Progress | None
) -> tuple[Spread, Callable[[FloatArray], FloatArray]]:
    """Return the spread in plain numbers, and a function from rows to a figure.

    Parameters
    ----------
    design, spread
        The design and the ranges.
    figure
        A variable of `synth.sweeps.frequency.frequency_sweep`, or ``modulus_margin``, 1/M_s: near
        the edge of stability M_s is all tail, and its variance that of a few cases.
    progress
        Called with a word, the cases done and their count.

    Returns
    -------
    Spread
        The spread on the design's case.
    Callable
        From rows (n, d) to the figure (n,), NaN where the loop is unstable.

    Raises
    ------
    InputError
        If the spread does not fit the case, or there is no such figure.
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
