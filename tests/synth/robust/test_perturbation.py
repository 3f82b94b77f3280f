"""The exact radius of gain errors, against closed forms, eigenvalues and python-control."""

from __future__ import annotations

import control
import numpy as np
import pytest
from designs import thesis_design
from loop_numbers import double_integrator, integrator, two_carts, with_full_state

from models import load_case
from models.basics import InputError
from synth import PayloadFeedback, StaticGain, Structure
from synth.loop import LinearController, closed_loop_poles
from synth.question import pose
from synth.robust import gain_radius, robustness
from synth.structures import Parameter, ParametrisedController

GAINS = (50.0, 100.0, 100.0)


def growth(plant, law, values) -> float:
    rational = plant.without_delays(8)
    return float(closed_loop_poles(rational, law.controller(list(values))).real.max())


@pytest.fixture(scope="module", params=[0.0, 0.005])
def thesis(request):
    case = load_case("thesis-1975").replace({"sensors.telemetry.delay": request.param})
    question = pose(case)
    law = PayloadFeedback(amplifier=question.amplifier).bind(question.plant)
    return question.plant, law, gain_radius(question.plant, law, GAINS)


def test_the_nearest_unstable_gains_have_a_pole_on_the_axis(thesis):
    plant, law, radius = thesis
    for worst in (radius.worst, radius.worst_box):
        assert growth(plant, law, worst.values()) == pytest.approx(0.0, abs=1e-8)


def test_the_nearest_unstable_gains_lie_at_the_radius(thesis):
    _, _, radius = thesis
    errors = np.array(list(radius.worst.values())) / GAINS - 1.0
    boxed = np.array(list(radius.worst_box.values())) / GAINS - 1.0
    assert np.linalg.norm(errors) == pytest.approx(radius.ball, rel=1e-9)
    assert np.abs(boxed).max() == pytest.approx(radius.box, rel=1e-6)


def test_no_random_gains_within_the_radius_are_unstable(thesis):
    plant, law, radius = thesis
    rng = np.random.default_rng(3)
    for _ in range(300):
        direction = rng.normal(size=3)
        within = 0.999 * radius.ball * direction / np.linalg.norm(direction)
        assert growth(plant, law, np.array(GAINS) * (1.0 + within)) < 0.0
        corner = 0.999 * radius.box * rng.uniform(-1.0, 1.0, 3)
        assert growth(plant, law, np.array(GAINS) * (1.0 + corner)) < 0.0


def test_the_box_lies_between_the_ball_and_its_shadow(thesis):
    _, _, radius = thesis
    assert radius.ball / np.sqrt(3.0) <= radius.box * (1.0 + 1e-9)
    assert radius.box <= radius.ball * (1.0 + 1e-9)


def test_one_gain_alone_has_the_gain_margins_of_python_control():
    plant = integrator(0.1)
    law = StaticGain().bind(plant)
    gain = -2.0
    assert growth(plant, law, [gain]) < 0.0
    radius = gain_radius(plant, law, [gain])
    # L = 2 exp(-0.1 s)/s: the gain may grow by pi/2/(0.1 * 2), and fall to zero.
    up = np.pi / 2.0 / 0.2
    assert radius.box == pytest.approx(min(up - 1.0, 1.0), rel=1e-6)


def test_a_double_integrator_with_two_gains_is_unstable_where_either_is_zero():
    plant = with_full_state(double_integrator())
    law = StaticGain().bind(plant)
    gains = [-2.0, -3.0]
    radius = gain_radius(plant, law, gains)
    # s^2 + k2 s + k1: stable as long as both are positive, so either alone may lose itself.
    assert radius.ball == pytest.approx(1.0, rel=1e-6)
    assert radius.box == pytest.approx(1.0, rel=1e-6)
    margins = control.stability_margins(control.tf([3.0, 2.0], [1.0, 0.0, 0.0]))
    assert margins[0] == np.inf


def test_an_unstable_loop_has_no_radius():
    plant = with_full_state(double_integrator())
    law = StaticGain().bind(plant)
    with pytest.raises(InputError, match="the loop must be stable"):
        gain_radius(plant, law, [2.0, 3.0])


def test_several_inputs_are_refused():
    plant = with_full_state(two_carts(2))
    law = StaticGain().bind(plant)
    with pytest.raises(InputError, match="the plant must have one input, got 2"):
        gain_radius(plant, law, [1.0] * len(law.parameters))


class _Filtered(Structure):
    """u = g y/(1 + T s): affine in g, not in T."""

    def bind(self, plant):
        del plant
        return _FilteredLaw()


class _FilteredLaw(ParametrisedController):
    parameters = (Parameter(name="g", scale=1.0), Parameter(name="T", scale=1.0))
    dimensions = 2

    def response(self, values, s):
        return [[values[0] / (1.0 + values[1] * s)]]

    def controller(self, values):
        g, T = values
        return LinearController(
            A=[[-1.0 / T]],
            B=[[1.0]],
            C=[[g / T]],
            D=[[0.0]],
            measurements=("y",),
            inputs=("u",),
        )

    def draw(self, points, omega, yu):
        raise NotImplementedError


def test_only_gains_in_which_the_loop_is_affine_count():
    plant, law = integrator(0.0), _Filtered().bind(None)
    assert gain_radius(plant, law, [-2.0, 0.1]).names == ("g",)


def test_a_filtered_loop_has_the_gain_margin_of_its_characteristic_polynomial():
    # s (1 + T s) exp(0.1 s) + k: by python-control's margin of the same loop, delay by Pade.
    plant, law = integrator(0.1), _Filtered().bind(None)
    radius = gain_radius(plant, law, [-2.0, 0.2])
    numerator, denominator = control.pade(0.1, 12)
    loop = control.tf([2.0], [0.2, 1.0, 0.0]) * control.tf(numerator, denominator)
    up = control.stability_margins(loop)[0]
    assert radius.box == pytest.approx(min(up - 1.0, 1.0), rel=1e-6)


@pytest.mark.ci
def test_gains_within_the_exact_radius_are_stable_and_just_beyond_not() -> None:
    inside = robustness(thesis_design(), {"gains": 0.05})
    assert inside.ok
    assert inside.confirmed
    assert inside.found == pytest.approx(inside.gain_radius.box / 0.05, rel=1e-6)
    at_edge = robustness(thesis_design(), {"gains": 0.999 * inside.gain_radius.box}, draws=4000)
    assert at_edge.ok
    assert at_edge.stable.count == 4000
    outside = robustness(thesis_design(), {"gains": 1.15 * inside.gain_radius.box})
    assert not outside.ok
    assert "unstable within the ranges" in str(outside)
