"""The drive's torque over speed: hand-written points, and the clip of the armature's voltage."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest
from former_cases import load_case

from models import Case, InputError
from models.plant import DriveLimits, PlantData
from models.plant.drive import motor_equations

# 1000 N m for hours, 2000 N m at the most, 150 kW; base speed 100 rad/s, 300 rad/s at the most.
SPEEDS = (0.0, 50.0, 75.0, 100.0, 150.0, 200.0, 250.0)
CURVE = {
    # 150 kW / omega from 75 rad/s on; 2.5 x 1000 (100/omega)^2 from 166.7 rad/s on
    "induction": (2000.0, 2000.0, 2000.0, 1500.0, 1000.0, 625.0, 400.0),
    "permanent-magnet": (2000.0, 2000.0, 2000.0, 1500.0, 1000.0, 750.0, 600.0),
    None: (2000.0, 2000.0, 2000.0, 1500.0, 1000.0, 750.0, 600.0),
}


def motor_of(kind: str | None) -> Case:
    changes = {
        "winch.motor.kind": kind,
        "winch.motor.base_speed": 100.0,
        "winch.motor.maximum_speed": 300.0,
        "winch.motor.speed_gain": 0.0,
        "winch.drive": {"torque_continuous": 1000.0, "torque_peak": 2000.0, "power": 150e3},
        "limits.drive": "report",
    }
    return load_case("subsea-crane").variant(changes)


@pytest.mark.parametrize("kind", CURVE)
def test_torque_over_speed_is_the_curve_of_the_motor(kind: str | None) -> None:
    case = motor_of(kind)
    limits, data = DriveLimits.from_case(case), PlantData.from_case(case)
    assert limits.top(SPEEDS, 2000.0) == pytest.approx(CURVE[kind], rel=1e-12)
    speed, command = ca.SX.sym("speed"), ca.SX.sym("command")
    p = {name: ca.SX(value) for name, value in limits.parameters.items()}
    p |= {"motor.torque_bandwidth": ca.SX(data.torque_bandwidth)}
    x = {"motor.speed": speed, "motor.torque": ca.SX(0.0)}
    found = motor_equations(data, p, x, command)
    demand = ca.Function("demand", [speed, command], [found.applied])
    for at, most in zip(SPEEDS, CURVE[kind], strict=True):
        for sign in (1.0, -1.0):
            assert float(demand(sign * at, 1e6)) == pytest.approx(most, rel=1e-12)
            assert float(demand(sign * at, -1e6)) == pytest.approx(-most, rel=1e-12)
            assert float(demand(sign * at, 0.9 * most)) == pytest.approx(0.9 * most, rel=1e-12)


def test_only_an_induction_motor_has_a_breakdown_torque() -> None:
    assert motor_of("induction").winch.breakdown_limit == 2.5 * 1000.0 * 100.0**2
    assert motor_of("permanent-magnet").winch.breakdown_limit == math.inf
    assert [motor_of(kind).winch.cooled_speed for kind in CURVE] == [100.0, 100.0, math.inf]
    assert "drive.breakdown_limit" not in DriveLimits.from_case(motor_of(None)).parameters
    with pytest.raises(InputError, match="induction"):
        motor_of("steam")


def test_the_curve_of_a_drive_without_limits_is_its_peak() -> None:
    assert np.all(DriveLimits().top([0.0, 1e3], 5.0) == 5.0)
