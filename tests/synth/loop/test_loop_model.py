"""A plant in few states: loops around it have the poles that they have around all of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import qmc

from models.case import load_case
from models.plant import LinearPlant
from synth.loop import LinearController, LoopModel, closed_loop_poles, with_elements
from synth.question import Problem, pose

OMEGA = np.geomspace(0.1, 20.0, 64)


def problem_of(structure: str, law: str) -> Problem:
    case = load_case("subsea-crane").replace({"rope.damping_law": law})
    return pose(case, structure).problem


def loops(problem: Problem, count: int) -> list[list[float]]:
    law = problem.law
    points = qmc.Sobol(law.dimensions, seed=1).random_base2(count)
    yu = problem.plant.response_at((1e-3 + 1j) * OMEGA).yu
    return [row.tolist() for row in law.draw(points, OMEGA, yu)]


def same(found: np.ndarray, exact: np.ndarray) -> bool:
    """Whether the lively poles of two loops are the same."""
    apart = np.abs(found[:, None] - exact)
    lively = [poles.real > -0.3 * np.abs(poles) for poles in (found, exact)]
    least = apart.min(axis=1)[lively[0]], apart.min(axis=0)[lively[1]]
    return bool(np.concatenate(least).max(initial=0.0) < 1e-9 * np.abs(exact).max())


@pytest.mark.parametrize(
    ("structure", "law", "most"),
    [
        ("payload-feedback", "kelvin-voigt", 36),
        ("combined", "kelvin-voigt", 40),
        ("combined", "hysteretic", 50),
        ("low-order-3", "hysteretic", 50),
    ],
)
def test_lively_poles_are_those_of_the_whole_loop(structure: str, law: str, most: int) -> None:
    problem = problem_of(structure, law)
    whole = problem.modelled[0]
    verdicts = []
    for values in loops(problem, 5):
        controller = problem.law.controller(values)
        asked = [problem.begin, problem.still(problem.begin), problem.nothing]
        for known, found in zip(asked, problem.lively_poles(values, *asked), strict=True):
            exact = closed_loop_poles(with_elements(whole, problem.elements, known), controller)
            assert len(found) <= most
            verdicts.append(exact.real.max() < 0.0)
            assert (found.real.max() < 0.0) == verdicts[-1]
            # A loop that bursts has poles of its own size, and of their rounding.
            assert not verdicts[-1] or same(found, exact)
    assert {*verdicts} == {True, False}


def test_what_no_loop_moves_stays_unless_it_decays() -> None:
    # Two masses side by side: the loop is closed around the first alone.
    def beside(pole: float) -> LoopModel:
        A = np.diag([0.0, 0.0, pole, -3.0])
        A[0, 1], A[1, 0] = 1.0, -4.0
        B = np.array([[0.0], [1.0], [0.0], [1.0]])
        C = np.array([[1.0, 0.0, 1.0, 0.0]])
        return LoopModel.of(LinearPlant(A=A, B=B, E=B, C=C))

    assert len(beside(-0.5).A) == 2
    assert len(beside(0.5).A) == 3
    assert len(beside(0.0).A) == 3
    loop = LinearController.static([[-1.0]], ("y1",), ("u1",))
    poles = np.linalg.eigvals(beside(0.5).closed(loop, []))
    assert np.sort(poles.real) == pytest.approx([0.0, 0.0, 0.5], abs=1e-12)
    assert np.abs(poles.imag).max() == pytest.approx(5.0**0.5)


def test_gains_and_direct_terms_close_as_a_larger_controller() -> None:
    rng = np.random.default_rng(3)
    A, B, C, D = (rng.normal(size=shape) for shape in ((6, 6), (6, 2), (3, 6), (3, 2)))
    plant = LinearPlant(A=A, B=B, E=B, C=C, D=D)
    own = LinearController(
        A=[[-2.0]],
        B=[[1.0, 0.5]],
        C=[[0.7]],
        D=[[0.3, -0.2]],
        measurements=("y1", "y2"),
        inputs=("u1",),
    )
    every = LinearController(
        A=[[-2.0]],
        B=[[1.0, 0.5, 0.0]],
        C=[[0.7], [0.0]],
        D=[[0.3, -0.2, 0.0], [0.0, 0.0, 0.4]],
        measurements=plant.measurements,
        inputs=plant.inputs,
    )
    found = np.linalg.eigvals(LoopModel.of(plant).closed(own, [0.4]))
    exact = closed_loop_poles(plant, every)
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(exact), rel=1e-9)


def test_a_model_that_answers_otherwise_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    plant = LinearPlant(A=np.diag([0.0, -1.0]), B=np.eye(2), E=np.eye(2), C=np.ones((1, 2)))
    assert len(LoopModel.of(plant).A) == 2
    for off, good in ((1e-4, False), (1e-8, True)):

        def other(model: LoopModel, off: float = off) -> LoopModel:
            return replace(model, B=(1.0 + off) * model.B)

        monkeypatch.setattr(LoopModel, "_reduced", other)
        assert bool(LoopModel.of(plant).B[0, 0] != 1.0) is good
