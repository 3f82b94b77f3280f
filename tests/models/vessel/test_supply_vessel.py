"""The MSS supply vessel: what its crane's hook does, met through a case from the vessel's file.

The table was computed from the same file by other code, that interpolates the complex operator
linearly between the file's few frequencies; waves amidships turn it by up to two radians from row
to row, and the chord then cuts the corner.  With that interpolation, ours gives every figure of it
to the last digit; with our own (amplitude and phase apart, against the wave at the hook) short
waves come out a little higher.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from former_cases import load_case
from scipy.interpolate import CubicSpline

from models.basics import peak_factor
from models.hook import HookDemand, HookMotion, hook_motion
from models.vessel import heave_operators, vessel_raos

FILE = Path(__file__).parents[4] / "shared" / "data" / "mss" / "supply.mat"
pytestmark = pytest.mark.skipif(
    not FILE.exists(), reason=f"the vessel's file {FILE.name} is absent"
)

# Heading [deg], y of the hook [m], T_p [s]; sigma of z, v, a; T_z; largest z, v, a in 3 h, all
# three with the displacement's T_z.  JONSWAP, gamma 3.3, H_s 2.5 m, x = -25 m.
TABLE = [
    (180, 15, 7, 0.357, 0.313, 0.286, 7.16, 1.36, 1.20, 1.09),
    (180, 15, 9, 0.516, 0.372, 0.283, 8.71, 1.95, 1.40, 1.07),
    (180, 15, 13, 0.602, 0.327, 0.197, 11.6, 2.22, 1.21, 0.73),
    (150, 15, 9, 0.419, 0.317, 0.250, 8.31, 1.59, 1.20, 0.95),
    (150, -15, 9, 0.691, 0.494, 0.371, 8.80, 2.61, 1.86, 1.40),
    (90, 15, 9, 0.385, 0.324, 0.291, 7.47, 1.47, 1.23, 1.11),
    (90, -15, 9, 0.967, 0.714, 0.564, 8.51, 3.66, 2.70, 2.13),
]
KEYS = [f"{heading} deg, y {y:+} m, {period} s" for heading, y, period, *_ in TABLE]


def case_of(heading, y, period):
    return load_case("subsea-crane").replace(
        {
            "sea.significant_height": 2.5,
            "sea.peak_period": float(period),
            "vessel.raos": str(FILE),
            "vessel.hook": {"x": -25.0, "y": float(y), "z": 20.0},
            "vessel.heading": math.radians(heading),
        }
    )


def by_spline(heading, y, period):
    """Sigmas with a smooth curve through the operator against the wave at the hook."""
    case = case_of(heading, y, period)
    raos = vessel_raos(case.vessel)
    place = (-25.0, float(y), 20.0)
    operator = heave_operators(raos, place, np.radians([float(heading)]))[:, 0]
    omega = np.linspace(raos.omega[0], raos.omega[-1], 20_001)
    density = np.abs(CubicSpline(raos.omega, operator)(omega)) ** 2
    density *= HookMotion.from_case(case).sea.density(omega)
    return [math.sqrt(np.trapezoid(density * omega ** (2 * n), omega)) for n in range(3)]


@pytest.mark.parametrize("row", TABLE, ids=KEYS)
def test_the_table_is_met(row):
    heading, y, period, *wanted = row
    demand = HookDemand.from_case(case_of(heading, y, period))
    sigmas = [m.rms for m in demand.motions]
    t_z = demand.displacement.zero_crossing_period
    largest = [sigma * peak_factor(t_z) for sigma in sigmas]
    assert demand.displacement.most_probable_maximum(demand.duration) == pytest.approx(largest[0])
    found = np.array([*sigmas, t_z, *largest])
    if (heading, period) == (180, 7):
        # In short head waves the table's chords cost it 2 to 4 %, see the module: ours is above.
        spline = by_spline(heading, y, period)
        assert np.all(np.array(spline) > 1.02 * np.array(wanted[:3]))
        np.testing.assert_allclose(sigmas, spline, rtol=0.002)
        np.testing.assert_allclose(t_z, wanted[3], rtol=0.02)
    else:
        np.testing.assert_allclose(found, wanted, rtol=0.02)


@pytest.mark.parametrize("row", TABLE, ids=KEYS)
def test_the_table_is_met_to_its_digits_with_its_interpolation(row):
    heading, y, period, *wanted = row
    case = case_of(heading, y, period)
    raos = vessel_raos(case.vessel)
    operator = raos.heave_at((-25.0, float(y), 20.0), math.radians(heading))  # wave amidships
    omega = np.linspace(raos.omega[0], raos.omega[-1], 20_001)
    chord = np.interp(omega, raos.omega, operator.real) ** 2
    chord += np.interp(omega, raos.omega, operator.imag) ** 2
    density = chord * HookMotion.from_case(case).sea.density(omega)
    sigmas = [math.sqrt(np.trapezoid(density * omega ** (2 * n), omega)) for n in range(3)]
    t_z = 2.0 * math.pi * sigmas[0] / sigmas[1]
    largest = [sigma * peak_factor(t_z) for sigma in sigmas]
    np.testing.assert_allclose([*sigmas, t_z], wanted[:4], rtol=0.005)
    np.testing.assert_allclose(largest, wanted[4:], atol=0.0101)


def test_the_side_matters_as_much_as_the_sea():
    survey = hook_motion(
        case_of(90, -15, 9), headings=[0.0, 90.0, 180.0, 270.0], peak_periods=[9.0]
    )
    speed = survey.rms("velocity")[:, :, 0]
    assert speed[0, 1] / speed[1, 1] == pytest.approx(0.714 / 0.324, rel=0.02)
    # The ship is alike on both sides: the other side in the other waves is the same.
    assert speed[0, 1] == pytest.approx(speed[1, 3], rel=1e-6)
    assert speed[0, 2] == pytest.approx(speed[1, 2], rel=1e-6)
    widths = [survey.figures(s, h, 0).displacement.width for s in range(2) for h in range(4)]
    assert 0.09 < min(widths) < max(widths) < 0.36
