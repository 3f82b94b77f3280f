"""The resolvent by modes and by back-substitution against dense solves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from plant_numbers import MODERN
from scipy.linalg import matrix_balance

from models.plant import LinearPlant, build_plant
from models.plant.resolvent import Resolvent

POINTS = np.concatenate([1j * np.geomspace(1e-2, 1e3, 60), [0.3 + 2.0j, -0.4 + 1e-3j, -0.05j]])


def dense(A: np.ndarray, C: np.ndarray, B: np.ndarray) -> np.ndarray:
    return np.array([C @ np.linalg.solve(s * np.eye(len(A)) - A, B) for s in POINTS])


def chain(masses: int, damping: float = 1e-3) -> np.ndarray:
    """Masses on springs of 1 N/m, the first one tied to a wall: lightly damped pairs."""
    K = 2.0 * np.eye(masses) - np.eye(masses, k=1) - np.eye(masses, k=-1)
    K[-1, -1] = 1.0
    return np.block([[np.zeros((masses, masses)), np.eye(masses)], [-100.0 * K, -damping * K]])


def branched(masses: int, corners: tuple[float, ...] = (2.0, 20.0, 200.0, 2000.0)) -> np.ndarray:
    """The chain with springs that relax: states that hear the masses, and not each other."""
    A, count = chain(masses, 0.0), len(corners)
    eye, held = np.eye(masses), np.kron(np.ones((1, count)), A[masses:, :masses])
    return np.block(
        [
            [
                A + np.kron([[0.0, 0.0], [4e-3, 0.0]], A[masses:, :masses]),
                np.vstack([0 * held, -1e-3 * held]),
            ],
            [
                np.kron(np.diag(corners) @ np.ones((count, 1)), np.hstack([eye, 0 * eye])),
                np.kron(-np.diag(corners), eye),
            ],
        ]
    )


def signals(n: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(3)
    return rng.normal(size=(3, n)), rng.normal(size=(n, 2))


@pytest.mark.parametrize(
    "A",
    [
        np.random.default_rng(5).normal(size=(9, 9)) - 4.0 * np.eye(9),
        chain(15),
        branched(15),
        np.diag([-1.0, -2.0, -3.0]) + 0.1,
        np.array([[0.0, 1.0], [-4.0, 0.0]]),
        np.diag([0.0, -1.0]),
    ],
    ids=["random", "chain", "branched", "real", "undamped", "integrator"],
)
def test_modes_give_what_a_solve_gives(A: np.ndarray) -> None:
    C, B = signals(len(A))
    resolvent = Resolvent(A)
    assert resolvent.modes is not None
    found = resolvent.between(C, B)(POINTS.astype(complex))
    assert found is not None
    want = dense(A, C, B)
    np.testing.assert_allclose(found, want, rtol=0.0, atol=1e-11 * np.abs(want).max())


@pytest.mark.parametrize(
    "A",
    [
        np.array([[0.0, 1.0], [0.0, 0.0]]),
        np.array([[-1.0, 1.0, 0.0], [1e-9, -1.0, 0.0], [0.0, 0.0, -3.0]]),
        np.diag(-np.ones(5)) + np.diag(np.ones(4), 1),
    ],
    ids=["two integrators", "nearly defective", "Jordan block"],
)
def test_eigenvectors_nearly_parallel_are_not_trusted(A: np.ndarray) -> None:
    C, B = signals(len(A))
    resolvent = Resolvent(A)
    assert resolvent.modes is None
    found = resolvent.between(C, B)(POINTS.astype(complex))
    assert found is not None
    np.testing.assert_allclose(found, dense(A, C, B), rtol=1e-11)


@pytest.mark.parametrize("A", [np.array([[0.0, 2.0], [-2.0, 0.0]]), np.diag([0.0, 0.0], 0)])
def test_a_pole_has_no_resolvent(A: np.ndarray) -> None:
    C, B = signals(2)
    transfer = Resolvent(A).between(C, B)
    assert transfer(np.array([1.0j, 2.0j, 0.0j])) is None
    assert transfer(np.array([1.0j])) is not None


def test_no_states_have_no_response() -> None:
    found = Resolvent(np.zeros((0, 0))).between(np.zeros((2, 0)), np.zeros((0, 3)))(POINTS)
    assert found is not None
    assert found.shape == (POINTS.size, 2, 3)
    assert not found.any()


def test_plants_with_the_same_poles_share_one_decomposition() -> None:
    C, B = signals(30)
    plant = LinearPlant(A=chain(15), B=B[:, :1], E=B[:, 1:], C=C[:2], Cz=C)
    some = plant.select(outputs=["z3"], measurements=["y2"])
    assert some.resolvent is plant.resolvent
    assert plant.with_element("z1", "w1", 0.5).resolvent is not plant.resolvent
    omega = np.geomspace(0.1, 100.0, 30)
    both = plant.response(omega)
    np.testing.assert_allclose(some.response(omega).zw, both.zw[:, 2:], rtol=1e-13)
    np.testing.assert_allclose(some.response(omega).yu, both.yu[:, 1:], rtol=1e-13)


def test_a_hysteretic_rope_answers_as_the_dense_resolvent_does() -> None:
    """Sixty branches: nearly as many real poles, in four heaps."""
    rope = replace(MODERN, damping_law="hysteretic", damping_ratio=0.002, masses=15)
    plant = build_plant(rope).linearise(drag=1e4)
    assert np.count_nonzero(plant.poles().imag == 0.0) >= 60
    C, B = np.vstack([plant.C, plant.Cz]), np.hstack([plant.B, plant.E])
    found = plant.resolvent.between(C, B)(POINTS.astype(complex))
    assert found is not None
    A, (scale, _) = matrix_balance(plant.A, permute=False, separate=True)
    want = dense(A, C * scale, B / scale[:, None])  # a solve wants equal units
    # Towards zero, where the drum's angle integrates, neither has that many digits.
    found, want = found[np.abs(POINTS) > 0.1], want[np.abs(POINTS) > 0.1]
    assert np.all(np.abs(found - want) <= 1e-9 * np.abs(want).max(axis=0))


def test_what_is_not_connected_is_not_heard_at_all() -> None:
    """A filter on one side of the plant: its states are not moved by the plant's input."""
    A = np.block(
        [[chain(4), np.ones((8, 2))], [np.zeros((2, 8)), np.array([[-1.0, 2.0], [-2.0, -1.5]])]]
    )
    C, B = np.eye(10), np.eye(10)[:, [0, 9]]
    resolvent = Resolvent(A)
    for _ in range(2):
        found = resolvent.between(C, B)(POINTS.astype(complex))
        assert found is not None
        assert not found[:, 8:, 0].any()
        assert found[:, 8:, 1].all()
        assert found[:, :8].all()
        resolvent.__dict__["modes"] = None  # the same by back-substitution
