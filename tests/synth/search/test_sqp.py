"""Descents at the last digits, where a step fails because values round."""

from __future__ import annotations

import numpy as np
import pytest

from models.basics import FloatArray
from synth.search.sqp import Evaluation, descend

PRICE = 0.6


@pytest.mark.parametrize("beside", [1e-6, 1e-7, 1e-8])
def test_an_answer_keeps_its_prices_where_values_round(beside: float) -> None:
    """The least of -0.6 x + 0.1 (y - 2)^2 with x + (y - 2)^2 / 2 <= 1: (1, 2), the row at 0.6.

    Wherever the descent did not begin the row is 1e-9 off, more than there is to gain: steps fail,
    the box shrinks to 1e-7 and less, and the row must still be seen within it.
    """
    start = np.array([1.0 - 1e-12, 2.0 + beside])

    def evaluate(x: FloatArray) -> Evaluation:
        away = x[1] - 2.0
        rounding = 0.0 if np.array_equal(x, start) else 1e-9
        return Evaluation(
            objective=-PRICE * x[0] + 0.1 * away**2,
            slope=np.array([-PRICE, 0.2 * away]),
            rows=np.array([x[0] + 0.5 * away**2 - 1.0 + rounding]),
            jacobian=np.array([[1.0, away]]),
            firm=np.zeros(1, dtype=np.bool_),
            equations=np.zeros(0),
            equation_slopes=np.zeros((0, 2)),
            curvature=np.diag([1e-3, 0.2]),
        )

    found = descend(
        evaluate,
        evaluate,
        lambda x: True,
        start,
        np.array([-10.0, -10.0]),
        np.array([10.0, 10.0]),
        logarithmic=np.zeros(2, dtype=np.bool_),
        tolerance=1e-13,
    )
    assert found.converged
    assert found.at.broken <= 1e-8
    assert found.prices == pytest.approx([PRICE], rel=1e-4)
    assert found.x == pytest.approx([1.0, 2.0], abs=1e-8 + beside)
