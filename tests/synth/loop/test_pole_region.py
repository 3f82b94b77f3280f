"""The region of a loop's poles against formulas."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from models.plant import LinearPlant
from synth import White
from synth.loop import Assessment, LinearController, PoleRegion, disturbances


def loop(plant: LinearPlant, gain: list[list[float]]) -> Assessment:
    controller = LinearController.static(gain, plant.measurements, plant.inputs)
    name = plant.disturbances[0]
    return Assessment(plant, controller, disturbances({name: White(1.0)}, (name,)))


def mass(delay: float = 0.0) -> LinearPlant:
    return LinearPlant(
        A=[[0.0, 1.0], [0.0, 0.0]],
        B=[[0.0], [1.0]],
        E=[[0.0], [1.0]],
        C=np.eye(2),
        Cz=[[1.0, 0.0]],
        delays=(delay, delay),
    )


@pytest.mark.parametrize("zeta", [0.05, 0.7, 1.5])
def test_region_of_a_second_order_loop_is_its_damping_and_frequency(zeta: float) -> None:
    """s^2 + 2 zeta w s + w^2, w = 3 rad/s."""
    found = loop(mass(), [[-9.0, -6.0 * zeta]]).pole_region
    root = np.sqrt(complex(zeta**2 - 1.0))
    assert found.decay == pytest.approx(3.0 * (zeta - root.real), rel=1e-9)
    assert found.damping == pytest.approx(min(zeta, 1.0), rel=1e-9)
    assert found.frequency == pytest.approx(3.0 * (max(zeta, 1.0) + root.real), rel=1e-9)


@pytest.mark.parametrize("share", [0.5, 1.5, 4.0])
def test_region_of_a_delayed_integrator_leaves_the_delay_model_out(share: float) -> None:
    """s + k exp(-s tau) = 0: the rightmost roots by Newton's equation, not the model's poles."""
    tau, gain = 0.05, share / 0.05 * np.exp(-1.0)  # share 1: two real roots meet at -1/tau
    plant = LinearPlant(A=[[0.0]], B=[[1.0]], E=[[1.0]], C=[[1.0]], Cz=[[1.0]], delays=(tau,))
    found = loop(plant, [[-gain]]).pole_region
    if share < 1.0:
        slow = brentq(lambda s: s + gain * np.exp(-s * tau), -1.0 / tau, 0.0, xtol=1e-14)
        assert found.decay == pytest.approx(-slow, rel=1e-6)
        assert found.damping == 1.0
        return
    s = complex(-0.3, 1.0) / tau
    for _ in range(60):
        s -= (s + gain * np.exp(-s * tau)) / (1.0 - gain * tau * np.exp(-s * tau))
    assert s.imag > 0.0
    assert found.decay == pytest.approx(-s.real, rel=1e-4)
    assert found.damping == pytest.approx(-s.real / abs(s), rel=1e-4)


def test_frequency_is_the_loops_and_not_the_delay_models() -> None:
    late = loop(mass(delay=0.01), [[-9.0, -3.0]]).pole_region
    prompt = loop(mass(), [[-9.0, -3.0]]).pole_region
    assert late.frequency == pytest.approx(prompt.frequency, rel=0.05)
    assert late.damping == pytest.approx(prompt.damping, rel=0.1)


def test_a_growing_pole_counts_wherever_it_lies() -> None:
    unstable = loop(mass(delay=0.01), [[-9.0, 3.0]]).pole_region
    assert unstable.decay < 0.0
    assert unstable.damping < 0.0
    poles = np.array([-1.0, 2.0 + 5.0j, 2.0 - 5.0j])
    region = PoleRegion.of(poles, poles[1:])
    assert region.decay == -2.0
    assert region.frequency == pytest.approx(np.hypot(2.0, 5.0))


def test_no_poles_are_no_limit() -> None:
    region = PoleRegion.of(np.zeros(0, dtype=np.complex128))
    assert (region.decay, region.damping, region.frequency) == (np.inf, 1.0, 0.0)
    still = PoleRegion.of(np.array([0.0 + 0.0j, -2.0]))
    assert (still.decay, still.damping) == (0.0, 0.0)
