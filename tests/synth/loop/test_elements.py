"""Equivalent elements: coefficients in closed form, their cap, and long simulations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq, fsolve

from models.basics import White
from models.plant import LinearPlant
from synth.loop import (
    Assessment,
    DragElement,
    LinearController,
    LossElement,
    disturbances,
    switching_friction,
)

DAMPING, STIFFNESS = 0.8, 1.5  # of the controller u = -STIFFNESS x - DAMPING v
TORQUE, QUADRATIC = 0.4, 0.7


def mass(damping: float = 0.0) -> LinearPlant:
    """x'' + damping x' + 4 x = u + f; x and its velocity measured."""
    return LinearPlant(
        A=[[0.0, 1.0], [-4.0, -damping]],
        B=[[0.0], [1.0]],
        E=[[0.0], [1.0]],
        C=np.eye(2),
        Cz=np.eye(2),
        inputs=("u",),
        disturbances=("f",),
        measurements=("x", "v"),
        outputs=("place", "speed"),
    )


def assessed(plant: LinearPlant, elements: list[DragElement | LossElement]) -> Assessment:
    law = LinearController.static([[-STIFFNESS, -DAMPING]], ("x", "v"), ("u",))
    return Assessment(plant, law, disturbances({"f": White(1.0)}, ("f",)), elements=elements)


def loss(torque: float = TORQUE) -> LossElement:
    return LossElement(torque=torque, usual=1.0, velocity="speed", force="f")


def drag() -> DragElement:
    return DragElement(quadratic=QUADRATIC, velocity="speed", force="f")


def friction(variance: float) -> float:
    """sqrt(2/pi) Delta / sigma, its steepest that of tanh(v)."""
    return TORQUE / math.sqrt(1.0 + 0.5 * math.pi * variance)


def test_losses_agree_with_the_motion_that_they_lead_to() -> None:
    """White noise of intensity one moves the mass with sigma_v^2 = 1/(2 (c + b))."""
    (found,) = assessed(mass(), [loss()]).coefficients
    exact = brentq(lambda b: b - friction(0.5 / (DAMPING + b)), 0.0, TORQUE, xtol=1e-14)
    assert found == pytest.approx(exact, rel=1e-8)


def test_drag_and_losses_are_found_together() -> None:
    view = assessed(mass(), [drag(), loss()])

    def surplus(both: np.ndarray) -> np.ndarray:
        variance = 0.5 / (DAMPING + both.sum())
        needed = [QUADRATIC * math.sqrt(8.0 / math.pi * variance), friction(variance)]
        return np.asarray(both - needed)

    exact = fsolve(surplus, [0.5, 0.2], xtol=1e-13)
    np.testing.assert_allclose(view.coefficients, exact, rtol=1e-8)
    assert view.sigma("speed") ** 2 == pytest.approx(0.5 / (DAMPING + exact.sum()), rel=1e-8)


def test_a_switch_is_never_steeper_than_at_rest() -> None:
    assert switching_friction(TORQUE, 0.0) == pytest.approx(TORQUE, rel=1e-12)
    # The mean slope of tanh in a Gaussian motion is nearly that: 1.2 % at most.
    slope = [
        np.mean(1.0 / np.cosh(sigma * np.random.default_rng(1).standard_normal(400_000)) ** 2)
        for sigma in (0.1, 0.5, 1.0, 3.0)
    ]
    capped = switching_friction(1.0, np.array([0.1, 0.5, 1.0, 3.0]) ** 2)
    np.testing.assert_allclose(capped, slope, rtol=0.03)


def test_what_only_its_losses_calm_is_not_stable() -> None:
    """Without losses the damping is -1 + 0.8: they calm it, but no limit counts on it."""
    view = assessed(mass(damping=-1.0), [loss(1.0)])
    assert view.poles.real.max() < 0.0
    assert not view.stable


def test_what_losses_do_not_calm_moves_without_end() -> None:
    view = assessed(mass(damping=-3.0), [loss(1.0)])
    assert view.coefficients == (0.0,)
    assert not view.stable


def test_margins_are_the_worst_with_losses_and_without() -> None:
    """A damper in the plant turns L: its peak of |S| is another with b than without."""
    plant, found = mass(damping=0.05), []
    view = assessed(plant, [loss()])
    (b,) = view.coefficients
    for damping in (0.05, 0.05 + b):
        s = 1j * np.geomspace(1e-2, 1e2, 200_001)
        L = (STIFFNESS + DAMPING * s) / (s * s + damping * s + 4.0)
        found.append((np.abs(1.0 / (1.0 + L)).max(), np.angle(1.0 + 1.0 / L)))
    assert view.max_sensitivity == pytest.approx(max(peak for peak, _ in found), rel=1e-6)
    assert view.margins.max_sensitivity == view.max_sensitivity
    assert abs(found[0][0] / found[1][0] - 1.0) > 0.01


@pytest.mark.ci
def test_the_rms_is_that_of_a_long_simulation_with_the_switch() -> None:
    """v' = -4 x - K x - c v - Delta sign(v) + w, by Euler and Maruyama, 400 times 400 s."""
    view = assessed(mass(), [loss()])
    rng, step = np.random.default_rng(7), 2e-3
    x, v = np.zeros(400), np.zeros(400)
    total, count = np.zeros(400), 0
    for k in range(200_000):
        kick = rng.standard_normal(400) * math.sqrt(step)
        v += step * (-(4.0 + STIFFNESS) * x - DAMPING * v - TORQUE * np.tanh(v)) + kick
        x += step * v
        if k > 20_000:
            total += v * v
            count += 1
    variances = total / count
    sigma, error = (
        math.sqrt(variances.mean()),
        0.5 * variances.std() / math.sqrt(400 * variances.mean()),
    )
    assert view.sigma("speed") == pytest.approx(sigma, abs=3.0 * error + 0.01 * sigma)
    without = assessed(mass(), []).sigma("speed")
    assert without > 1.05 * sigma
