"""Spectra in all their forms become one: densities, bands, kinks, and refusals."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad

from models.basics import InputError, White
from synth.loop import Disturbance, disturbances

OMEGA = np.geomspace(0.1, 10.0, 9)


def one(value: object) -> Disturbance:
    (found,) = disturbances({"w": value}, ("w", "v"))
    return found


def test_white_noise_has_the_one_sided_density_of_its_intensity() -> None:
    found = one(White(3.0))
    assert found.band is None
    assert found.splits == ()
    assert found.density(OMEGA) == pytest.approx(np.full(9, 3.0 / np.pi), rel=1e-15)
    # through x' = -a x + w: the integral of |1/(i w + a)|^2 S is intensity / (2 a)
    variance = quad(lambda w: float(found.density(np.array([w]))[0]) / (w**2 + 4.0), 0, np.inf)[0]
    assert variance == pytest.approx(3.0 / 4.0, rel=1e-9)


def test_intensity_is_one_by_default_and_may_be_nothing() -> None:
    assert White().intensity == 1.0
    assert not np.any(White(0.0).density(OMEGA))


def test_callable_is_taken_on_the_half_line() -> None:
    found = one(lambda omega: 1.0 / (1.0 + omega**2))
    assert found.band is None
    assert found.density(OMEGA) == pytest.approx(1.0 / (1.0 + OMEGA**2), rel=1e-15)


def test_spectrum_object_brings_its_band_and_its_kinks() -> None:
    found = one(SimpleNamespace(density=lambda w: w**2, band=(0.2, 4.0), splits=(0.7,)))
    assert found.band == (0.2, 4.0)
    assert found.splits == (0.7,)
    assert found.density(OMEGA) == pytest.approx(OMEGA**2, rel=1e-15)
    plain = one(SimpleNamespace(density=lambda w: w**2, band=[0.2, 4.0]))
    assert plain.band == (0.2, 4.0)
    assert plain.splits == ()


def test_table_is_linear_in_between_and_zero_outside() -> None:
    found = one(([0.5, 1.0, 2.0, 4.0], [0.0, 3.0, 1.0, 1.0]))
    assert found.band == (0.5, 4.0)
    assert found.splits == (1.0, 2.0)
    at = np.array([0.4, 0.5, 0.75, 1.0, 1.5, 3.0, 4.0, 4.1])
    assert found.density(at) == pytest.approx([0.0, 0.0, 1.5, 3.0, 2.0, 1.0, 1.0, 0.0])


def test_table_from_zero_keeps_its_first_cell() -> None:
    found = one(([0.0, 1.0, 2.0], [4.0, 2.0, 0.0]))
    assert found.band is not None
    low, high = found.band
    assert 0.0 < low < 1e-5
    assert high == 2.0
    total = quad(lambda w: float(found.density(np.array([w]))[0]), low, high, points=[1.0])[0]
    assert total == pytest.approx(4.0, rel=1e-5)
    assert found.splits == (1.0,)


def test_order_of_the_mapping_is_kept() -> None:
    found = disturbances({"v": White(2.0), "w": White(1.0)}, ("w", "v"))
    assert [d.name for d in found] == ["v", "w"]


@pytest.mark.parametrize(
    ("spectrum", "message"),
    [
        ({}, "spectrum must name at least one disturbance, got none"),
        ({"x": White()}, "there is no disturbance 'x'; there are: w, v"),
        ({"w": 3.0}, "spectrum of w must be a callable of omega, a table .* or White, got float"),
        ({"w": ([1.0, 2.0],)}, "a table .* or White, got tuple"),
        ({"w": ([1.0, 1.0], [0.0, 1.0])}, "spectrum of w: omega must be strictly ascending"),
        ({"w": ([1.0, 2.0], [0.0, np.nan])}, "density must be finite numbers, got nan"),
        ({"w": ([1.0, 2.0], [0.0, -1.0])}, "omega and density must be at least 0"),
        ({"w": ([-1.0, 2.0], [0.0, 1.0])}, "omega and density must be at least 0"),
        ({"w": ([1.0, 2.0, 3.0], [0.0, 1.0])}, "equally long, at least 2, got"),
        ({"w": ([1.0], [1.0])}, "equally long, at least 2, got"),
    ],
)
def test_spectra_that_are_none_are_refused(spectrum, message: str) -> None:
    with pytest.raises(InputError, match=message):
        disturbances(spectrum, ("w", "v"))


@pytest.mark.parametrize(
    ("density", "message"),
    [
        (lambda omega: -omega, "finite density of at least 0 .* least value of -10"),
        (lambda omega: omega * np.nan, "finite density of at least 0"),
        (lambda omega: 1.0, r"got an array of shape \(\)"),
    ],
)
def test_densities_are_checked_when_they_are_asked(density, message: str) -> None:
    found = one(density)
    with pytest.raises(InputError, match=message):
        found.density(OMEGA)


@pytest.mark.parametrize("intensity", [-1.0, np.inf, np.nan])
def test_intensity_must_be_a_size(intensity: float) -> None:
    with pytest.raises(InputError, match=r"White: intensity must be at least 0, got"):
        White(intensity)
