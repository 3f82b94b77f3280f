from __future__ import annotations

import numpy as np
import pytest

from models.basics import InputError
from models.spread import Spread, Uniform
from synth.sensitivity.global_indices import indices_of
from synth.sensitivity.screening import effects_of

ISHIGAMI = Spread({name: Uniform(-np.pi, np.pi) for name in ("x1", "x2", "x3")})


def ishigami(rows):
    x, y, z = rows.T
    return np.sin(x) + 7.0 * np.sin(y) ** 2 + 0.1 * z**4 * np.sin(x)


def test_indices_of_ishigamis_function():
    # Ishigami and Homma 1990, a = 7, b = 0.1: V1, V2, V13 in closed form.
    a, b = 7.0, 0.1
    one = 0.5 * (1.0 + b * np.pi**4 / 5.0) ** 2
    two, both = a**2 / 8.0, b**2 * np.pi**8 * (1.0 / 18.0 - 1.0 / 50.0)
    whole = one + two + both
    found = indices_of(ishigami, ISHIGAMI, samples=4096, seed=1, resamples=49)
    assert found.first == pytest.approx([one / whole, two / whole, 0.0], abs=0.015)
    assert found.total == pytest.approx(
        [(one + both) / whole, two / whole, both / whole], abs=0.015
    )
    for index, interval in (
        (found.first, found.first_interval),
        (found.total, found.total_interval),
    ):
        assert np.all(interval[:, 0] <= index)
        assert np.all(index <= interval[:, 1])
    assert found.evaluations == 4096 * 5
    assert found.unstable == 0


def test_the_same_seed_gives_the_same_intervals_and_another_seed_others():
    def found(seed):
        return indices_of(ishigami, ISHIGAMI, samples=256, seed=seed, resamples=49)

    assert np.array_equal(found(3).first_interval, found(3).first_interval)
    assert np.array_equal(found(3).total_interval, found(3).total_interval)
    assert not np.array_equal(found(3).first_interval, found(4).first_interval)


def test_one_number_alone_is_to_blame_for_everything():
    one = Spread({"x": Uniform(0.0, 1.0)})
    found = indices_of(lambda rows: rows[:, 0] ** 2, one, samples=1024, resamples=49)
    assert found.paths == ("x",)
    for index, interval in (
        (found.first, found.first_interval),
        (found.total, found.total_interval),
    ):
        assert index == pytest.approx([1.0], abs=0.02)
        assert interval.shape == (1, 2)
        assert interval[0, 0] <= index[0] <= interval[0, 1]
    assert found.evaluations == 1024 * 3


def test_the_intervals_hold_the_truth_about_as_often_as_they_say():
    held = []
    for seed in range(20):
        found = indices_of(
            lambda rows: rows @ [1.0, 2.0, 3.0], ISHIGAMI, samples=256, seed=seed, confidence=0.95
        )
        truth = np.array([1.0, 4.0, 9.0]) / 14.0
        held.append((found.total_interval[:, 0] <= truth) & (truth <= found.total_interval[:, 1]))
    assert np.mean(held) > 0.85


def test_what_is_unstable_is_counted_and_never_averaged_in():
    def lost(rows):
        values = rows @ [1.0, 2.0, 3.0]
        return np.where(rows[:, 0] > 3.0, np.nan, values)

    found = indices_of(lost, ISHIGAMI, samples=1024, seed=2)
    share = (np.pi - 3.0) / (2.0 * np.pi)
    assert found.unstable / found.evaluations == pytest.approx(share, abs=0.01)
    # Kept are base points whose x1 is stable in both designs: the others' shares grow a little.
    x1 = (np.pi + 3.0) ** 2 / 12.0
    others = np.array([4.0, 9.0]) * np.pi**2 / 3.0
    assert found.first[1:] == pytest.approx(others / (x1 + others.sum()), abs=0.02)
    assert found.kept < 1024


def test_indices_refuse_what_they_cannot_tell():
    with pytest.raises(InputError, match="power of two, got 1000"):
        indices_of(ishigami, ISHIGAMI, samples=1000)
    with pytest.raises(InputError, match="does not move"):
        indices_of(lambda rows: np.ones(len(rows)), ISHIGAMI, samples=64)
    with pytest.raises(InputError, match="narrow the ranges"):
        indices_of(lambda rows: np.full(len(rows), np.nan), ISHIGAMI, samples=64)


def test_screening_of_a_power_law_gives_its_exponents():
    # ln f = sum e_j x_j: every effect of x_j is e_j times its range, wherever it stands.
    exponents = np.array([0.5, -1.0, 0.0])
    found = effects_of(lambda rows: np.exp(rows @ exponents), ISHIGAMI, trajectories=10)
    scale = 2.0 * np.pi * 0.98
    assert found.mean == pytest.approx(exponents * scale, rel=1e-9, abs=1e-9)
    assert found.mean_size == pytest.approx(np.abs(exponents) * scale, rel=1e-9, abs=1e-9)
    assert found.spread == pytest.approx(np.zeros(3), abs=1e-9)
    assert found.evaluations == 10 * 4


def test_screening_counts_what_is_lost():
    found = effects_of(
        lambda rows: np.where(rows[:, 0] > 3.0, np.nan, np.exp(rows[:, 1])),
        ISHIGAMI,
        trajectories=40,
        seed=3,
    )
    assert found.unstable > 0
    assert found.lost[0] > 0
    assert found.mean[1] == pytest.approx(2.0 * np.pi * 0.98, rel=1e-9)
