"""The loop's formulas against closed loops in state space."""

from __future__ import annotations

import numpy as np
import pytest
from loop_numbers import ComplexArray, FloatArray, closed_matrices, loop_response

from models.plant import LinearPlant
from synth.loop import (
    LinearController,
    LoopResponses,
    closed_loop_matrix,
    closed_loop_poles,
)

OMEGA = np.geomspace(0.05, 30.0, 25)


def random_plant(nu: int = 2, ny: int = 3, seed: int = 3) -> LinearPlant:
    rng = np.random.default_rng(seed)
    n, nw, nz = 5, 2, 2
    return LinearPlant(
        A=rng.normal(size=(n, n)) - 3.0 * np.eye(n),
        B=rng.normal(size=(n, nu)),
        E=rng.normal(size=(n, nw)),
        C=rng.normal(size=(ny, n)),
        D=0.2 * rng.normal(size=(ny, nu)),
        F=rng.normal(size=(ny, nw)),
        Cz=rng.normal(size=(nz, n)),
        Dz=rng.normal(size=(nz, nu)),
        Fz=rng.normal(size=(nz, nw)),
    )


def random_controller(plant: LinearPlant, order: int = 2, seed: int = 5) -> LinearController:
    rng = np.random.default_rng(seed)
    nu, ny = len(plant.inputs), len(plant.measurements)
    return LinearController(
        A=rng.normal(size=(order, order)) - 2.0 * np.eye(order),
        B=rng.normal(size=(order, ny)),
        C=rng.normal(size=(nu, order)),
        D=rng.normal(size=(nu, ny)),
        measurements=plant.measurements,
        inputs=plant.inputs,
    )


def state_space(A: FloatArray, B: FloatArray, C: FloatArray, D: FloatArray) -> ComplexArray:
    inner = [np.linalg.solve(1j * w * np.eye(len(A)) - A, B) for w in OMEGA]
    return np.array([C @ x + D for x in inner])


@pytest.mark.parametrize(("nu", "ny"), [(1, 1), (1, 3), (2, 2), (3, 2)])
def test_closed_loop_is_that_of_the_state_space(nu: int, ny: int) -> None:
    plant = random_plant(nu, ny)
    controller = random_controller(plant)
    exact = state_space(*closed_matrices(plant, controller))
    found = LoopResponses.of(plant.response(OMEGA), controller)
    for i, z in enumerate(plant.outputs):
        for j, w in enumerate(plant.disturbances):
            assert found.response(z, w) == pytest.approx(exact[:, i, j], rel=1e-10)


@pytest.mark.parametrize(("nu", "ny"), [(1, 2), (2, 2), (3, 3)])
def test_return_differences_are_those_of_one_loop_broken(nu: int, ny: int) -> None:
    plant = random_plant(nu, ny)
    controller = random_controller(plant)
    found = LoopResponses.of(plant.response(OMEGA), controller)
    for i in range(nu):
        exact = 1.0 + loop_response(plant, controller, i)(OMEGA)
        assert found.difference(i) == pytest.approx(exact, rel=1e-9)


def test_closed_loop_matrix_is_the_hand_written_one() -> None:
    plant = random_plant()
    controller = random_controller(plant)
    exact = closed_matrices(plant, controller)[0]
    assert closed_loop_matrix(plant, controller) == pytest.approx(exact, rel=1e-12)
    ours, theirs = np.sort_complex(closed_loop_poles(plant, controller)), np.linalg.eigvals(exact)
    assert ours == pytest.approx(np.sort_complex(theirs), rel=1e-9)


def test_controller_as_a_python_control_system_is_the_same_controller() -> None:
    plant = random_plant()
    controller = random_controller(plant)
    system = controller.to_control()
    assert system.input_labels == ["y1", "y2", "y3"]
    assert system(1.3j) == pytest.approx(controller.response_at([1.3j])[0], rel=1e-12)


def test_delays_turn_the_loop_gain_and_nothing_else() -> None:
    plant = random_plant(1, 1)
    late = LinearPlant(
        A=plant.A, B=plant.B, E=plant.E, C=plant.C, D=plant.D, F=plant.F, delays=(0.4,)
    )
    controller = random_controller(plant)

    def loop(plant: LinearPlant) -> ComplexArray:
        return np.asarray(LoopResponses.of(plant.response(OMEGA), controller).difference(0)) - 1.0

    assert loop(late) == pytest.approx(loop(plant) * np.exp(-0.4j * OMEGA), rel=1e-12)
