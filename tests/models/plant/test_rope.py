"""The rope's modes against their equation, and the lumped rope against the exact one."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from plant_numbers import MODERN, THESIS
from scipy.integrate import quad

from models.basics import InputError
from models.plant import (
    PlantData,
    first_root,
    fixed_top_modes,
    lump_rope,
    lumped_modes,
    masses_for_bandwidth,
    skin_drag_share,
)
from models.plant.plant_data import MODE_TOLERANCE

ROPE = (1.6e8, 2000.0, 8.1, 73_688.0)  # the 1975 thesis: EA, L, mass per length, M_1
BASE = replace(THESIS, lumping="distributed", masses=None)


# ---- exact modes


@given(
    stiffness=st.floats(1e6, 1e10),
    length=st.floats(10.0, 6000.0),
    line=st.floats(0.5, 200.0),
    payload=st.floats(1e3, 1e6),
)
def test_modes_solve_their_equation_one_in_each_interval(
    stiffness: float, length: float, line: float, payload: float
) -> None:
    omega = fixed_top_modes(stiffness, length, line, payload, 8)
    nu = omega * length / math.sqrt(stiffness / line)
    j = np.arange(8)
    assert np.all((nu > j * math.pi) & (nu < (j + 0.5) * math.pi))
    np.testing.assert_allclose(
        nu * np.sin(nu), line * length / payload * np.cos(nu), atol=1e-8 * (1.0 + nu.max())
    )


def test_modes_of_the_thesis_rope() -> None:
    """Second mode at 7.13 rad/s, on top of the loop's crossover at 7.7 rad/s."""
    assert fixed_top_modes(*ROPE, 2)[1] == pytest.approx(7.13, abs=0.005)


@pytest.mark.parametrize(
    ("payload", "diameter", "length", "period"),
    [
        (14e3, 0.030, 1000.0, 2.66),
        (100e3, 0.050, 1000.0, 4.12),
        (100e3, 0.050, 3000.0, 7.44),
        (400e3, 0.088, 2000.0, 6.70),
        (600e3, 0.100, 100.0, 1.56),
    ],
)
def test_first_period_of_steel_wire_ropes(
    payload: float, diameter: float, length: float, period: float
) -> None:
    """Wire rope of MoorPy's library, 5293 d^2 kg/m and EA = 97.1e9 d^2 N."""
    first = fixed_top_modes(97.1e9 * diameter**2, length, 5293.0 * diameter**2, payload, 1)[0]
    assert 2.0 * math.pi / first == pytest.approx(period, abs=0.006)


def test_modes_in_the_limits_of_a_light_and_a_heavy_rope() -> None:
    light = fixed_top_modes(1e8, 1000.0, 0.01, 1e5, 1)[0]
    third = math.sqrt(1e5 / (1e5 + 0.01 * 1000.0 / 3.0))  # K = 1e5 N/m
    assert light == pytest.approx(third, rel=1e-9)
    heavy = fixed_top_modes(1e8, 1000.0, 100.0, 1e-3, 3)  # a free lower end
    quarter = (np.arange(3) + 0.5) * math.pi / 1000.0 * 1000.0
    np.testing.assert_allclose(heavy, quarter, rtol=1e-6)
    massless = fixed_top_modes(1e8, 1000.0, 0.0, 1e5, 1)
    np.testing.assert_allclose(massless, [1.0])
    with pytest.raises(InputError, match="a massless rope has one axial mode, got count 2"):
        fixed_top_modes(1e8, 1000.0, 0.0, 1e5, 2)


@pytest.mark.parametrize("eps", [1e-6, 0.03, 0.5, 4.0, 300.0])
def test_skin_drag_at_the_load_is_the_cube_of_the_mode(eps: float) -> None:
    (nu,) = first_root(np.array([eps]))
    (exact,) = fixed_top_modes(1.0, 1.0, eps, 1.0, 1) * math.sqrt(eps)
    assert nu == pytest.approx(exact, rel=1e-12)
    shape, _ = quad(lambda x: (math.sin(nu * x) / math.sin(nu)) ** 3, 0.0, 1.0, epsabs=1e-13)
    assert skin_drag_share(np.array([eps])) == pytest.approx([shape], rel=1e-10)
    if eps < 1e-5:
        assert shape == pytest.approx(0.25, rel=1e-5)


def test_damping_time_is_that_of_the_first_mode() -> None:
    first = fixed_top_modes(*ROPE, 1)[0]
    assert replace(BASE, damping_ratio=0.03).damping_time == pytest.approx(0.06 / first)


# ---- lumping


@pytest.mark.parametrize("lumping", ["distributed", "thesis"])
@pytest.mark.parametrize("masses", [1, 2, 3, 17, 40])
def test_no_rope_is_lost(masses: int, lumping: str) -> None:
    lumps = lump_rope(masses, lumping)
    assert lumps.springs.size == lumps.masses.size == masses
    assert lumps.springs.sum() == pytest.approx(1.0)
    assert lumps.masses.sum() + lumps.at_drum == pytest.approx(1.0)
    assert lumps.hanging[0] + lumps.at_drum == pytest.approx(1.0)
    np.testing.assert_allclose(lumps.hanging[-1], lumps.masses[-1])


def test_one_mass_takes_a_third_of_the_rope_or_all_of_it() -> None:
    assert lump_rope(1).masses[0] == pytest.approx(1.0 / 3.0)
    assert lump_rope(1).at_drum == pytest.approx(2.0 / 3.0)
    assert lump_rope(1, "thesis").masses[0] == 1.0


def test_masses_sit_in_the_middle_of_their_pieces() -> None:
    lumps = lump_rope(6)
    depth = np.cumsum(lumps.springs)
    upper = np.append(0.0, np.cumsum(lumps.masses)[:-1])
    np.testing.assert_allclose(depth[:-1], (upper + 0.5 * lumps.masses)[:-1])
    assert depth[-1] == pytest.approx(1.0)


def errors(lumping: str, masses: list[int], mode: int) -> list[float]:
    exact = fixed_top_modes(*ROPE, mode + 1)[mode]
    return [abs(lumped_modes(lump_rope(n, lumping), *ROPE)[mode] / exact - 1.0) for n in masses]


@pytest.mark.parametrize("mode", [0, 1, 2])
def test_frequencies_converge_with_the_square_of_the_piece(mode: int) -> None:
    coarse, fine = errors("distributed", [20, 40], mode)
    assert coarse / fine == pytest.approx((39.5 / 19.5) ** 2, rel=0.02)


def test_thesis_lumping_makes_the_payload_heavier_and_converges_slowly() -> None:
    coarse, fine = errors("thesis", [20, 40], 0)
    assert coarse / fine == pytest.approx(2.0, rel=0.02)
    assert coarse > 10.0 * errors("distributed", [20], 0)[0]


def test_third_of_the_rope_is_right_to_a_percent() -> None:
    assert errors("distributed", [1], 0)[0] < 2e-3


# ---- how many masses


def holds(data: PlantData, masses: int, omega_max: float) -> bool:
    rope = (data.axial_stiffness, data.rope_length, data.mass_per_length, data.payload_mass)
    exact = fixed_top_modes(*rope, 60)
    exact = exact[exact < omega_max]
    lumped = lumped_modes(lump_rope(masses), *rope)[: exact.size]
    return lumped.size == exact.size and bool(
        np.all(np.abs(lumped / exact - 1.0) <= MODE_TOLERANCE)
    )


@pytest.mark.parametrize("data", [BASE, MODERN, replace(MODERN, rope_length=3000.0)])
@pytest.mark.parametrize("omega_max", [2.0, 8.0, 22.0, 45.0])
def test_masses_are_the_fewest_that_hold_every_mode(data: PlantData, omega_max: float) -> None:
    n = masses_for_bandwidth(data, omega_max)
    assert n >= 2
    assert holds(data, n, omega_max)
    assert n == 2 or not holds(data, n - 1, omega_max)


def test_more_bandwidth_never_needs_fewer_masses() -> None:
    counts = [masses_for_bandwidth(BASE, w) for w in np.linspace(1.0, 95.0, 60)]
    assert counts == sorted(counts)
    assert counts[-1] > 30


def test_short_and_massless_ropes_need_two() -> None:
    assert masses_for_bandwidth(replace(BASE, rope_length=50.0), 40.0) == 2
    assert masses_for_bandwidth(replace(BASE, mass_per_length=0.0), 1e4) == 2


def test_thesis_lumping_stays_as_it_is() -> None:
    assert masses_for_bandwidth(THESIS, 500.0) == 1


@pytest.mark.parametrize("omega_max", [110.0, 5000.0])
def test_too_much_bandwidth_is_said(omega_max: float) -> None:
    with pytest.raises(
        InputError, match=r"40 masses do not hold the .* axial modes .* 2000 m of rope"
    ):
        masses_for_bandwidth(BASE, omega_max)
