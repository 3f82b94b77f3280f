"""Descents: the last digits, where a step fails because values round, and what is not looked at."""

from __future__ import annotations

import numpy as np
import pytest

from models.basics import FloatArray
from synth.search.sqp import UNFINISHED, Descent, Evaluation, descend

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


def along_a_valley(asked: list[FloatArray], **options: float | bool) -> Descent:
    """Return how x[0] falls from 0 to -6 along a bent valley, with a row that holds x[1] off 9."""

    def evaluate(x: FloatArray) -> Evaluation:
        off = x[1] - np.sin(2.0 * x[0])
        along = np.array([-2.0 * np.cos(2.0 * x[0]), 1.0])
        return Evaluation(
            objective=0.1 * (x[0] + 6.0) ** 2 + 5.0 * off**2,
            slope=np.array([0.2 * (x[0] + 6.0), 0.0]) + 10.0 * off * along,
            rows=np.array([x[1] - 9.0]),
            jacobian=np.array([[0.0, 1.0]]),
            firm=np.zeros(1, dtype=np.bool_),
            equations=np.zeros(0),
            equation_slopes=np.zeros((0, 2)),
            curvature=np.diag([0.2, 0.0]) + 10.0 * np.outer(along, along),
        )

    def stable(x: FloatArray) -> bool:
        asked.append(x)
        return True

    return descend(
        evaluate,
        evaluate,
        stable,
        np.zeros(2),
        np.array([-10.0, -10.0]),
        np.array([10.0, 10.0]),
        logarithmic=np.ones(2, dtype=np.bool_),
        **options,  # type: ignore[arg-type]
    )


def test_a_descent_that_is_not_worth_it_is_given_up() -> None:
    whole = along_a_valley([])
    assert whole.converged
    assert whole.steps > 16
    given_up = along_a_valley([], worth=-1.0)
    assert given_up.message == UNFINISHED
    assert given_up.at.objective > whole.at.objective + 0.1
    assert along_a_valley([], worth=10.0).x == pytest.approx(whole.x, abs=1e-12)


def test_short_steps_between_points_that_keep_guarding_rows_need_no_poles() -> None:
    every: list[FloatArray] = []
    few: list[FloatArray] = []
    whole = along_a_valley(every)
    assert along_a_valley(few, guarded=True).x == pytest.approx(whole.x, abs=1e-12)
    steps = np.abs(np.diff(every, axis=0)).max(axis=1)
    assert np.any(steps > 0.3)
    assert np.count_nonzero(steps < 0.1) > 5
    assert len(every) - np.count_nonzero(steps < 0.3) <= len(few) < len(every) - 5
