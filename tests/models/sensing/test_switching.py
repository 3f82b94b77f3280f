"""The noise of losses that switch: against the signs of a drawn record, and by its variance."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.signal import welch

from models import HookMotion, load_case
from models.plant import PlantData
from models.sensing import SwitchingNoise, sensed_plant


def noise_of(**changes):
    case = load_case("subsea-crane").replace(changes)
    return SwitchingNoise.of(PlantData.from_case(case), HookMotion.from_case(case))


def test_its_density_is_that_of_the_signs_of_a_record():
    noise = noise_of()
    record = noise.hook.record(duration=40_000.0, step=0.02, seed=5)
    speed = noise.per_heave * record.velocity
    sigma = noise.per_heave * noise.hook.velocity.rms
    switched = np.tanh(speed)
    b = math.sqrt(2.0 / math.pi) / math.sqrt(sigma**2 + 2.0 / math.pi)
    frequency, density = welch(switched - b * speed, 50.0, nperseg=2**15)
    omega = 2.0 * math.pi * frequency
    torque = noise.density(omega) / (1.0 + (noise.lag * omega) ** 2)
    torque *= (noise.gain / noise.torque) ** 2
    for low, high in ((0.01, 0.3), (0.3, 1.0), (1.0, 2.0), (2.0, 5.0), (5.0, 12.0)):
        at = (omega >= low) & (omega < high)
        seen = density[at].mean() / (2.0 * math.pi)
        assert torque[at].mean() == pytest.approx(seen, rel=0.06), (low, high)


def test_its_variance_is_what_no_friction_stands_for():
    noise = noise_of()
    omega = np.linspace(1e-4, 100.0, 400_001)
    shape = noise.density(omega) / (1.0 + (noise.lag * omega) ** 2)
    variance = np.trapezoid(shape, omega) * noise.gain**2
    assert variance == pytest.approx((1.0 - 2.0 / math.pi) * noise.torque**2, rel=0.08)


def test_without_losses_there_is_none():
    assert noise_of(**{"winch.gearbox.efficiency": 1.0, "rope.sheave_efficiency": 1.0}) is None


def test_shapes_between_speeds_are_those_at_them():
    shape = noise_of().shape
    omega, speeds = np.geomspace(1e-5, 10.0, 200), np.array([4.1, 17.3, 31.5, 88.8])
    alone = np.array([shape.at(omega, float(speed)) for speed in speeds])
    np.testing.assert_allclose(shape.rows(omega, speeds), alone, rtol=1e-7)


def test_its_torque_is_the_loss_of_the_plant_on_any_falls():
    case = load_case("subsea-crane").replace({"rope.falls": 2, "rope.length": 700.0})
    data = PlantData.from_case(case)
    noise = SwitchingNoise.of(data, HookMotion.from_case(case))
    wanted = sensed_plant(case, drag=0.0).loss["motor.torque"]
    assert noise.torque == pytest.approx(wanted, rel=1e-12)
    assert noise.per_heave == case.winch.gearbox.ratio / case.haul_radius
