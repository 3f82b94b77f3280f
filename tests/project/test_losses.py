"""Losses that switch with the motor's direction, as a design counts them, against three hours.

The simulation takes the loss as it is, Delta tanh(omega); a design has friction b omega and noise r
on the command that stand for it.  A signal is then g + s (b omega + r), g what a design tells of it
beside the loss and s what a torque on the motor's shaft makes of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pytest

import stillhook as sh

NEAR, ERRORS = 0.03, 3.0  # how far a deviation may be off, or so many standard errors
SETTLE, EXPOSURE = 600.0, 10_800.0  # [s]
SIGNALS = ("payload.displacement", "motor.torque", "motor.speed", "rope.tension")
NOISE = "drive.set_point"

DESIGNS: Mapping[str, Mapping[str, float]] = {
    "payload-feedback": {"A": 1.0, "a": 12.0, "a1": 29.7, "a2": 8.0},
    "feed-forward": {
        "drum.position_gain": 0.05,
        "heave.gain": 0.9976,
        "heave.lead": 0.6588,
        "heave.bandwidth": 1.42,
    },
}


def told(design: sh.Design, signal: str, *, noise: bool = True) -> tuple[float, float]:
    """Standard deviation of a signal with the loss in it, and its relative standard error."""
    loop, data = design.assessment, design.question.data
    loss = design.question.plant.loss
    share = loss.get(signal, 0.0) / loss["motor.torque"]
    nodes = loop.quadrature([signal, "motor.speed"])
    omega = nodes.omega
    density = np.zeros(omega.size)
    for source in loop.disturbances:
        if source.name == NOISE and not noise:
            continue
        found = loop.response(signal, source.name, omega)
        found = found + share * design.friction * loop.response("motor.speed", source.name, omega)
        if source.name == NOISE:
            found = found - share * data.torque_per_command(1j * omega)
        density += np.abs(found) ** 2 * source.density(omega)
    variance, power = nodes.integrate(density), nodes.integrate(density**2)
    # var(s^2) = (2 pi/T) int S^2 domega (Bartlett)
    error = 0.5 * math.sqrt(2.0 * math.pi * power / EXPOSURE) / variance
    return math.sqrt(variance), error


@pytest.mark.ci
@pytest.mark.parametrize("structure", DESIGNS)
def test_deviations_are_those_of_three_hours_with_losses_that_switch(structure: str) -> None:
    # Coherent errors have signs that stay for a run, and what is printed is the mean over them.
    steady = {"sensors.mru.gain_error": 0.0, "sensors.mru.phase_error": 0.0}
    case = sh.load_case("subsea-crane").replace({**steady, "limits.drive": "report"})
    design = sh.evaluate_gains(case, DESIGNS[structure], structure=structure)
    assert design.friction > 0.0
    (run,) = sh.simulate(
        case,
        design,
        seeds=[0],
        duration=SETTLE + EXPOSURE,
        settle=SETTLE,
        traces="worst",
        store_step=10.0,
    )
    for signal in SIGNALS:
        wanted, error = told(design, signal)
        found = run.statistics[signal].standard_deviation
        assert abs(found / wanted - 1.0) < max(NEAR, ERRORS * error), signal
        # What is printed is not below it: loss and motion are taken for unrelated.
        printed = math.hypot(
            design.question.plant.loss.get(signal, 0.0), design.assessment.sigma(signal)
        )
        assert printed > (1.0 - NEAR) * wanted, signal
    if structure == "feed-forward":
        # Friction alone would leave most of what moves the load's end of the rope untold.
        signal = "rope.lower_tension"
        wanted, error = told(design, signal)
        found = run.statistics[signal].standard_deviation
        assert abs(found / wanted - 1.0) < max(NEAR, ERRORS * error)
        assert told(design, signal, noise=False)[0] < 0.9 * found
