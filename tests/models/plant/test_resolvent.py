"""The resolvent by modes and by back-substitution against dense solves."""

from __future__ import annotations

import numpy as np
import pytest

from models.plant import LinearPlant
from models.plant.resolvent import Resolvent

POINTS = np.concatenate([1j * np.geomspace(1e-2, 1e3, 60), [0.3 + 2.0j, -0.4 + 1e-3j, -0.05j]])


def dense(A: np.ndarray, C: np.ndarray, B: np.ndarray) -> np.ndarray:
    return np.array([C @ np.linalg.solve(s * np.eye(len(A)) - A, B) for s in POINTS])


def chain(masses: int, damping: float = 1e-3) -> np.ndarray:
    """Masses on springs of 1 N/m, the first one tied to a wall: lightly damped pairs."""
    K = 2.0 * np.eye(masses) - np.eye(masses, k=1) - np.eye(masses, k=-1)
    K[-1, -1] = 1.0
    return np.block([[np.zeros((masses, masses)), np.eye(masses)], [-100.0 * K, -damping * K]])


def signals(n: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(3)
    return rng.normal(size=(3, n)), rng.normal(size=(n, 2))


@pytest.mark.parametrize(
    "A",
    [
        np.random.default_rng(5).normal(size=(9, 9)) - 4.0 * np.eye(9),
        chain(15),
        np.diag([-1.0, -2.0, -3.0]) + 0.1,
        np.array([[0.0, 1.0], [-4.0, 0.0]]),
        np.diag([0.0, -1.0]),
    ],
    ids=["random", "chain", "real", "undamped", "integrator"],
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
