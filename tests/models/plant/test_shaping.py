"""Shaping filters, and integrals and Lyapunov equations of the verification, in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from models.basics import InputError, SolverError
from models.plant import LinearPlant, fit_shaping_filter
from models.sea import SeaSpectrum
from synth.verify import LawMatrices, Loop, Source, lyapunov_variances, moments, panels
from synth.verify.integrals import integrate


def oscillator(zeta: float, **options: object) -> LinearPlant:
    """x'' + 2 zeta x' + x = w + u, measured x; outputs x, x' and u."""
    return LinearPlant(
        A=[[0.0, 1.0], [-1.0, -2.0 * zeta]],
        B=[[0.0], [1.0]],
        E=[[0.0], [1.0]],
        C=[[1.0, 0.0]],
        Cz=[[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]],
        Dz=[[0.0], [0.0], [1.0]],
        disturbances=("w",),
        outputs=("x", "v", "u"),
        **options,  # type: ignore[arg-type]
    )


def no_law(plant: LinearPlant) -> LawMatrices:
    return LawMatrices(
        A=np.zeros((0, 0)), B=np.zeros((0, 1)), C=np.zeros((1, 0)), D=np.zeros((1, 1))
    )


def test_fit_of_a_spectrum_that_is_a_filter_is_exact() -> None:
    # (2 zeta w0 g)^2 w^2 / |...|^2, twice over: a filter of order four with two zeros.
    def density(omega):  # type: ignore[no-untyped-def]
        first = omega**2 / ((0.6**2 - omega**2) ** 2 + (2 * 0.2 * 0.6 * omega) ** 2)
        second = omega**2 / ((0.9**2 - omega**2) ** 2 + (2 * 0.3 * 0.9 * omega) ** 2)
        return 0.3 * first * second

    found = fit_shaping_filter(density, (0.05, 20.0), order=4)
    assert found.order == 4
    assert abs(found.variance_error) < 1e-6
    assert found.shape_error < 1e-5
    omega = np.geomspace(0.05, 20.0, 50)
    np.testing.assert_allclose(found.density(omega), density(omega), rtol=1e-4)
    sizes = np.sort(np.abs(found.poles))
    np.testing.assert_allclose(sizes, [0.6, 0.6, 0.9, 0.9], rtol=1e-5)


@pytest.mark.parametrize(("order", "shape_error"), [(4, 0.15), (6, 0.08), (8, 0.04)])
def test_fit_of_a_sea(order: int, shape_error: float) -> None:
    sea = SeaSpectrum(kind="jonswap", significant_height=2.0, peak_period=9.0)
    found = fit_shaping_filter(sea.density, sea.band, order)
    assert np.all(found.poles.real < 0.0)
    assert abs(found.variance_error) < 0.02
    assert found.shape_error < shape_error
    # The errors it states are those of its own density.
    low, high = sea.band
    variance = quad(sea.density, low, high, points=[0.6, 0.7, 0.8, 2.0], limit=400)[0]
    fitted = quad(found.density, low, high, points=[0.6, 0.7, 0.8, 2.0], limit=400)[0]
    assert fitted / variance - 1.0 == pytest.approx(found.variance_error, abs=2e-4)


def test_the_signal_and_its_derivative_are_proper() -> None:
    sea = SeaSpectrum(kind="jonswap", significant_height=2.0, peak_period=9.0)
    found = fit_shaping_filter(sea.density, sea.band)
    np.testing.assert_array_equal(found.C @ found.B, [[0.0]])
    # variance and velocity variance by Lyapunov equation against the spectrum's own integral
    variance = quad(found.density, 0.0, np.inf, limit=400)[0]
    plant = LinearPlant(
        A=[[-1.0]],
        B=[[0.0]],
        E=[[0.0, 0.0]],
        C=[[1.0]],
        Cz=[[0.0], [0.0]],
        Fz=np.eye(2),
        disturbances=("heave", "rate"),
        outputs=("z", "v"),
        rates={"rate": "heave"},
    )
    by_time = lyapunov_variances(plant, no_law(plant), {"heave": found})
    assert by_time["z"] == pytest.approx(variance, rel=1e-7)
    velocity = quad(lambda w: float(w**2 * found.density(w)), 0.0, np.inf, limit=400)[0]
    # both columns of one source are folded: z' = heave' comes in as its rate
    assert by_time["v"] == pytest.approx(velocity, rel=1e-6)


def test_bad_requests_are_refused() -> None:
    with pytest.raises(InputError, match="must hold variance, got 0"):
        fit_shaping_filter(np.zeros_like, (0.1, 1.0))


@pytest.mark.parametrize("zeta", [0.3, 1e-3, 1e-6])
def test_white_noise_through_an_oscillator(zeta: float) -> None:
    # E w w = delta: sigma_x^2 = sigma_v^2 = 1/(4 zeta)
    plant = oscillator(zeta)
    law = no_law(plant)
    by_time = lyapunov_variances(plant, law, {"w": 1.0})
    assert by_time["x"] == pytest.approx(0.25 / zeta, rel=1e-9)
    assert by_time["v"] == pytest.approx(0.25 / zeta, rel=1e-9)
    source = Source(name="w", density=lambda w: np.full(w.shape, 1 / np.pi), band=None)
    loop = Loop(plant=plant, law=law, marks=plant.poles())
    found = moments(loop, ["x", "v"], [source], orders=(0,))
    assert found["x"][0] == pytest.approx(0.25 / zeta, rel=1e-7)
    assert found["v"][0] == pytest.approx(0.25 / zeta, rel=1e-7)
    # m2 of the displacement is m0 of the velocity
    assert moments(loop, ["x"], [source])["x"][1] == pytest.approx(0.25 / zeta, rel=1e-7)


def test_delay_in_the_loop_agrees_with_its_pade_model() -> None:
    plant = oscillator(0.05, delays=(0.4,))
    law = LawMatrices(
        A=np.array([[-2.0]]), B=np.array([[1.0]]), C=np.array([[1.5]]), D=np.array([[-0.3]])
    )
    source = Source(name="w", density=lambda w: np.full(w.shape, 2 / np.pi), band=None)
    loop = Loop(plant=plant, law=law, marks=plant.poles())
    spectral = moments(loop, ["x", "u"], [source], orders=(0,), delay=0.4)
    rational = plant.without_delays(10, at="measurements")
    by_time = lyapunov_variances(rational, law, {"w": 2.0})
    assert by_time["x"] == pytest.approx(spectral["x"][0], rel=1e-6)
    assert by_time["u"] == pytest.approx(spectral["u"][0], rel=1e-5)


def test_white_noise_straight_through_has_no_variance() -> None:
    plant = LinearPlant(
        A=[[-1.0]],
        B=[[1.0]],
        E=[[1.0]],
        C=[[1.0]],
        Cz=[[1.0], [0.0]],
        Fz=[[0.0], [1.0]],
        outputs=("x", "n"),
    )
    found = lyapunov_variances(plant, no_law(plant), {"w1": 3.0})
    assert found["x"] == pytest.approx(1.5)
    assert found["n"] == np.inf
    source = Source(name="w1", density=np.ones_like, band=None)
    loop = Loop(plant=plant, law=no_law(plant), marks=plant.poles())
    with pytest.raises(SolverError, match="does not converge"):
        moments(loop, ["n"], [source], orders=(0,))


def test_the_rate_of_white_noise_is_refused() -> None:
    plant = LinearPlant(
        A=[[-1.0]],
        B=[[1.0]],
        E=[[0.0, 1.0]],
        C=[[1.0]],
        Cz=[[1.0]],
        disturbances=("w", "rate"),
        rates={"rate": "w"},
    )
    with pytest.raises(SolverError, match="the rate of w is wanted"):
        lyapunov_variances(plant, no_law(plant), {"w": 1.0})


def test_integrals_over_a_band_with_a_kink_and_a_sharp_peak() -> None:
    width = 1e-5

    def density(omega):  # type: ignore[no-untyped-def]
        return np.stack([np.abs(omega - 0.7), width / (width**2 + (omega - 2.0) ** 2)])

    edges = panels(0.1, 5.0, [0.7], np.array([complex(-width, 2.0)]))
    kink, peak = integrate(density, edges, rtol=1e-10)
    assert kink == pytest.approx((0.6**2 + 4.3**2) / 2, rel=1e-12)
    assert peak == pytest.approx(np.arctan(3.0 / width) + np.arctan(1.9 / width), rel=1e-9)


def test_integrals_over_the_half_line() -> None:
    def density(omega):  # type: ignore[no-untyped-def]
        return np.stack([1 / (1 + omega**2), (1 - np.cos(3.0 * omega)) / omega**2])

    edges = panels(0.1, 2000.0, [], np.array([-1.0 + 0j]), longest=4.0)
    found = integrate(density, edges, rtol=1e-8, tail_panels=1000)
    # The second rings for ever, with a value of 3 pi/2 (Dirichlet).
    assert found[0] == pytest.approx(np.pi / 2, rel=1e-8)
    assert found[1] == pytest.approx(1.5 * np.pi, rel=1e-6)
