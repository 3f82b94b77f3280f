"""`Assessment` where the open loop has no finite response, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov
from scipy.optimize import minimize_scalar

from models.basics import SolverError
from models.plant import LinearPlant
from synth import White
from synth.loop import (
    Assessment,
    DragElement,
    LinearController,
    closed_loop_matrix,
    disturbances,
)

STIFFNESS, DAMPING = 1.5, 0.8  # of the controller u = -STIFFNESS x - DAMPING v


def mass(stiffness: float = 4.0, delay: float = 0.0, damping: float = 0.0) -> LinearPlant:
    """x'' + damping x' + stiffness x = u + f; x and its velocity measured."""
    return LinearPlant(
        A=[[0.0, 1.0], [-stiffness, -damping]],
        B=[[0.0], [1.0]],
        E=[[0.0], [1.0]],
        C=np.eye(2),
        Cz=[[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]],
        Dz=[[0.0], [0.0], [1.0]],
        inputs=("u",),
        disturbances=("f",),
        measurements=("x", "v"),
        outputs=("place", "speed", "effort"),
        delays=(delay, delay),
    )


def spring_and_damper(slow: float = 0.0) -> LinearController:
    """The static law; with `slow` a slow lag (s + 2 slow)/(s + slow) in series."""
    law = np.array([[-STIFFNESS, -DAMPING]])
    if not slow:
        return LinearController.static(law, ("x", "v"), ("u",))
    return LinearController(
        A=np.array([[-slow]]),
        B=law,
        C=np.array([[slow]]),
        D=law,
        measurements=("x", "v"),
        inputs=("u",),
    )


def assessed(plant: LinearPlant, controller: LinearController, **more: object) -> Assessment:
    return Assessment(plant, controller, disturbances({"f": White(1.0)}, ("f",)), **more)  # type: ignore[arg-type]


@pytest.mark.parametrize("delay", [0.0, 0.1])
def test_closed_loop_is_finite_at_an_undamped_pole_of_the_plant(delay: float) -> None:
    """A mass on a spring answers with 1/(4 - w^2 + (K + i w c) e^(-i w tau)), at 2 rad/s too."""
    view = assessed(mass(delay=delay), spring_and_damper())
    omega = np.array([0.5, 2.0, 2.0 + 1e-10, 3.0])
    law = (STIFFNESS + 1j * omega * DAMPING) * np.exp(-1j * omega * delay)
    found = view.response("place", "f", omega)
    np.testing.assert_allclose(found, 1.0 / (4.0 - omega**2 + law), rtol=5e-8)
    assert np.abs(view.loop_gain(np.array([2.0]))).min() > 1e7


def test_variances_of_a_mass_on_a_spring_are_the_closed_form() -> None:
    view = assessed(mass(), spring_and_damper())
    assert view.stable
    assert view.sigma("place") ** 2 == pytest.approx(0.5 / (DAMPING * (4.0 + STIFFNESS)), rel=1e-10)
    assert view.sigma("speed") ** 2 == pytest.approx(0.5 / DAMPING, rel=1e-8)


def test_margins_of_a_mass_on_a_spring_are_those_of_its_formula() -> None:
    m = assessed(mass(), spring_and_damper()).margins

    def sensitivity(w: float) -> float:  # |S| = |4 - w^2| / |4 + K - w^2 + i w c|
        return abs((4.0 - w**2) / (4.0 + STIFFNESS - w**2 + 1j * w * DAMPING))

    best = minimize_scalar(lambda w: -sensitivity(w), bounds=(2.0, 6.0), options={"xatol": 1e-10})
    assert m.max_sensitivity == pytest.approx(-best.fun, rel=1e-9)
    assert m.peak == pytest.approx(best.x, rel=1e-5)
    assert m.gain == np.inf
    # |L| = 1: (4 - w^2)^2 = K^2 + w^2 c^2
    squares = np.roots([1.0, -8.0 - DAMPING**2, 16.0 - STIFFNESS**2])
    assert m.crossovers == pytest.approx(np.sort(np.sqrt(squares)), rel=1e-9)


@pytest.mark.parametrize("slow", [1e-3, 1e-5, 1e-7])
def test_two_integrators_and_a_slow_pole_have_the_variance_of_lyapunov(slow: float) -> None:
    """Below the slow pole 1/s^2 of the open loop has swamped what the closed one lets through."""
    plant, controller = mass(stiffness=0.0), spring_and_damper(slow)
    view = assessed(plant, controller)
    A = closed_loop_matrix(plant, controller)
    E = np.vstack([plant.E, np.zeros((1, 1))])
    exact = solve_continuous_lyapunov(A, -E @ E.T)
    assert view.sigma("place") == pytest.approx(np.sqrt(exact[0, 0]), rel=1e-8)
    assert view.sigma("speed") == pytest.approx(np.sqrt(exact[1, 1]), rel=1e-8)


@pytest.mark.parametrize("delay", [0.0, 0.05])
def test_drag_agrees_with_the_motion_that_it_leads_to(delay: float) -> None:
    """C = q sqrt(8/pi) sigma_v(C); without a delay sigma_v^2 = 1/(2 (c + C))."""
    drag = DragElement(quadratic=2.0, velocity="speed", force="f")
    view = assessed(mass(delay=delay), spring_and_damper(), elements=[drag])
    (C,) = view.coefficients
    again = assessed(mass(delay=delay), spring_and_damper(), elements=[drag], coefficients=[C])
    assert pytest.approx(drag.slope * again.sigma("speed"), rel=1e-8) == C
    if not delay:
        assert pytest.approx(drag.slope * np.sqrt(0.5 / (DAMPING + C)), rel=1e-9) == C


def test_drag_that_a_loop_needs_to_be_stable_is_found() -> None:
    """Negative damping of 3 N s/m less the controller's: stable only from C = 2.2 on."""
    drag = DragElement(quadratic=2.0, velocity="speed", force="f")
    view = assessed(mass(damping=-3.0), spring_and_damper(), elements=[drag])
    (C,) = view.coefficients
    assert C > 3.0 - DAMPING
    assert pytest.approx(drag.slope * np.sqrt(0.5 / (DAMPING + C - 3.0)), rel=1e-8) == C
    assert view.stable


def test_loop_that_no_drag_calms_has_none() -> None:
    drag = DragElement(quadratic=2.0, velocity="speed", force="f")
    pushing = LinearController.static([[10.0, 0.0]], ("x", "v"), ("u",))  # a negative spring
    with pytest.raises(SolverError, match="no linear drag coefficient agrees"):
        assert assessed(mass(), pushing, elements=[drag]).coefficients
