"""Structures: what their parameters mean, how large they are, and what a search begins with."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from loop_numbers import double_integrator, integrator, two_carts, with_full_state
from scipy.linalg import solve_continuous_are
from scipy.stats import qmc

from models.basics import InputError, White
from models.plant import LinearPlant
from synth.loop import disturbances
from synth.question import FamilyProblem, Problem
from synth.search.starts import candidates, crossover_grid, pick_spread, stabilise
from synth.structures import ParametrisedController, PayloadFeedback, StaticGain
from synth.structures.structure import gain_scales


def problem(
    plant: LinearPlant, law: ParametrisedController, minimise: dict[str, float] | None = None
) -> Problem:
    white = {name: White(1.0) for name in plant.independent_disturbances}
    return Problem(
        plant=plant,
        law=law,
        disturbances=disturbances(white, plant.independent_disturbances),
        minimise=minimise or dict.fromkeys(plant.outputs, 1.0),
        limits=(),
    )


def payload_plant() -> LinearPlant:
    """Order of the measurements is not the structure's."""
    return LinearPlant(
        A=[[0.0, 1.0], [-1.0, -0.1]],
        B=[[0.0], [1.0]],
        E=[[0.0], [1.0]],
        C=[[1.0, 0.0], [-1.0, -0.1], [0.0, 1.0]],
        D=[[0.0], [1.0], [0.0]],
        measurements=("payload.displacement", "payload.acceleration", "payload.velocity"),
        inputs=("drive.command",),
    )


def test_static_gain_has_one_parameter_for_every_path() -> None:
    law = StaticGain().bind(with_full_state(two_carts(2)))
    assert len(law.parameters) == 8
    assert law.parameters[0].name == "K[u1,m1]"
    assert law.parameters[-1].name == "K[u2,m4]"


def test_mask_leaves_entries_out() -> None:
    law = StaticGain(mask=((True, False), (False, True))).bind(two_carts(2))
    assert [p.name for p in law.parameters] == ["K[u1,y1]", "K[u2,y2]"]
    assert law.controller([3.0, 4.0]).D.tolist() == [[3.0, 0.0], [0.0, 4.0]]
    assert law.named([3.0, 4.0]) == {"K[u1,y1]": 3.0, "K[u2,y2]": 4.0}


def test_payload_feedback_has_the_thesis_sign_and_finds_its_measurements() -> None:
    law = PayloadFeedback(amplifier=10.0).bind(payload_plant())
    assert [p.name for p in law.parameters] == ["a", "a1", "a2"]
    # u = -A (a P'' + a1 P' + a2 P), on (P, P'', P')
    controller = law.controller([1.0, 2.0, 3.0])
    assert controller.D.tolist() == [[-30.0, -10.0, -20.0]]
    assert controller.measurements[1] == "payload.acceleration"


def test_scale_of_a_gain_makes_a_loop_gain_of_about_one() -> None:
    plant = with_full_state(double_integrator(A=[[0.0, 1.0], [-9.0, -0.3]]))
    scales = gain_scales(plant, [(0, 0), (0, 1)])
    # x / u is 1/9 below 3 rad/s and less above; x' / u is about 3 times that
    assert scales[0] == pytest.approx(9.0, rel=0.5)
    assert scales[0] / scales[1] == pytest.approx(3.0, rel=0.1)


def test_scales_follow_the_units_of_a_measurement() -> None:
    plant = with_full_state(two_carts(2))
    factors = np.array([1.0, 1e3, 1.0, 1e-6])
    changed = dataclasses.replace(plant, C=factors[:, None] * plant.C)
    entries = [(i, j) for i in range(2) for j in range(4)]
    ratio = gain_scales(plant, entries) / gain_scales(changed, entries)
    assert ratio == pytest.approx(np.tile(factors, 2), rel=1e-9)


def test_path_that_the_plant_lacks_gets_the_scale_of_its_neighbours() -> None:
    plant = LinearPlant(
        A=np.diag([-1.0, -2.0]), B=np.diag([1.0, 5.0]), E=np.ones((2, 1)), C=np.eye(2)
    )
    scales = gain_scales(plant, [(0, 0), (0, 1), (1, 0), (1, 1)])
    assert scales.max() / scales.min() < 100.0
    drawn = (
        StaticGain()
        .bind(plant)
        .draw(
            qmc.Sobol(5, seed=0).random_base2(7),
            np.geomspace(0.1, 10.0, 8),
            plant.response(np.geomspace(0.1, 10.0, 8)).yu,
        )
    )
    assert np.abs(drawn).max() < 1e4


def test_plant_that_no_input_reaches_has_scales_all_the_same() -> None:
    plant = LinearPlant(A=[[-1.0]], B=[[0.0]], E=[[1.0]], C=[[1.0]])
    assert gain_scales(plant, [(0, 0)]).tolist() == [1.0]


def test_candidates_take_both_signs_many_sizes_and_keep_bounds() -> None:
    plant = with_full_state(double_integrator())
    law = StaticGain(bounds={"K[u,m1]": (-5.0, 0.0), "K[u,m2]": (-np.inf, 2.0)}).bind(plant)
    found = candidates(problem(plant, law, {"x": 1.0, "effort": 0.1}), 256, seed=1)
    assert found[:, 0].min() >= -5.0
    assert found[:, 0].max() <= 0.0
    assert found[:, 1].max() == 2.0
    free = StaticGain().bind(plant)
    found = candidates(problem(plant, free, {"x": 1.0, "effort": 0.1}), 256, seed=1)
    for column in found.T:
        assert 0.4 < np.mean(column > 0.0) < 0.6
        assert np.ptp(np.log10(np.abs(column))) > 3.0


@pytest.mark.parametrize("count", [1, 2])
def test_guess_for_a_measured_state_is_the_linear_quadratic_regulator(count: int) -> None:
    plant = with_full_state(two_carts(count))
    minimise = {"x1": 1.0, "x2": 2.0, "effort1": 0.1, "effort2": 0.3}
    minimise = {name: w for name, w in minimise.items() if name in plant.outputs}
    law = StaticGain().bind(plant)
    question = problem(plant, law, minimise)
    guess = law.guesses(question, crossover_grid(question))[0]
    weights = [minimise[name] for name in plant.outputs]
    Q, R = (plant.Cz.T * weights) @ plant.Cz, (plant.Dz.T * weights) @ plant.Dz
    exact = -np.linalg.solve(R, plant.B.T @ solve_continuous_are(plant.A, plant.B, Q, R))
    assert guess == pytest.approx(exact.ravel(), rel=1e-6)


def test_guesses_respect_the_mask_and_the_sign_of_the_amplifier() -> None:
    plant = with_full_state(two_carts())
    law = StaticGain(mask=((True, False, True, False),)).bind(plant)
    question = problem(plant, law, {"x2": 1.0, "effort1": 0.1})
    found = law.guesses(question, crossover_grid(question))
    assert found.shape[1] == 2
    stable = [question.stable(values) for values in found]
    assert np.mean(stable) > 0.7


def test_least_unstable_candidates_are_made_stable() -> None:
    plant = with_full_state(double_integrator())
    law = StaticGain().bind(plant)
    question = problem(plant, law, {"x": 1.0})
    wrong = np.array([[1.0, 1.0], [3.0, -1.0], [-1.0, 0.5]])
    assert not any(question.stable(values) for values in wrong)
    growths = np.array([question.abscissa(v) for v in wrong])
    found = stabilise(FamilyProblem.of(question), wrong, growths, 3)
    assert len(found) == 3
    assert all(question.stable(values) for values in found)


def test_nothing_is_made_stable_that_cannot_be() -> None:
    # x'' = u with position alone: no static gain damps it
    plant = double_integrator()
    law = StaticGain().bind(plant)
    question = problem(plant, law, {"x": 1.0})
    family, points = FamilyProblem.of(question), np.array([[1.0], [-1.0]])
    assert stabilise(family, points, np.array([0.5, 0.0]), 2) == []


def test_starts_are_spread_best_first() -> None:
    points = np.array([[1.0], [1.001], [-1.0], [30.0]])
    merit = np.array([0.0, 0.1, 2.0, 1.0])
    assert pick_spread(points, merit, np.ones(1), 3) == [0, 3, 2]
    assert pick_spread(points, merit, np.ones(1), 4) == [0, 3, 2, 1]
    assert pick_spread(points, np.array([np.inf, 0.0, np.inf, np.inf]), np.ones(1), 4) == [1]


def test_crossover_candidates_stop_where_the_delay_does() -> None:
    law = StaticGain().bind(integrator(0.5))
    late = crossover_grid(problem(integrator(0.5), law))
    assert late[-1] <= 10.0
    assert crossover_grid(problem(two_carts(), law))[-1] > 10.0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: StaticGain(mask=((True, True),)).bind(two_carts(2)),
            r"mask must have the shape \(2, 2\), got \(1, 2\)",
        ),
        (
            lambda: StaticGain(bounds={"K[u1,y9]": (0.0, 1.0)}).bind(two_carts()),
            r"no parameter 'K\[u1,y9\]' to bound; there are: K\[u1,y1\]",
        ),
        (
            lambda: PayloadFeedback().bind(two_carts()),
            r"PayloadFeedback: .*payload\.acceleration",
        ),
        (
            lambda: PayloadFeedback(measurements=("y1", "y2", "y1")).bind(two_carts(2)),
            "must have one input, got 2",
        ),
        (
            lambda: PayloadFeedback(amplifier=0.0).bind(payload_plant()),
            "amplifier must be above 0, got 0.0",
        ),
    ],
)
def test_what_does_not_fit_the_plant_is_refused(make, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()
