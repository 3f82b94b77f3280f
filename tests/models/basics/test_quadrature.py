"""Quadrature nodes against closed forms and scipy."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from models.basics import InputError, Quadrature, SolverError, adaptive_nodes, spectral_nodes


def oscillator(zeta: float, omega0: float):
    """|H|^2 of x'' + 2 zeta w0 x' + w0^2 x = f, its poles, and its closed-form integrals.

    Under a one-sided density of 1 the variances are pi/(4 zeta w0^3) of x and pi/(4 zeta w0) of x'
    (half of the two-sided pi S0/(2 zeta w0^3) over the whole line).
    """
    root = cmath.sqrt(zeta**2 - 1.0)
    poles = (omega0 * (-zeta + root), omega0 * (-zeta - root))

    def gain(omega):
        return 1.0 / ((omega0**2 - omega**2) ** 2 + (2.0 * zeta * omega0 * omega) ** 2)

    return gain, poles, math.pi / (4.0 * zeta * omega0**3), math.pi / (4.0 * zeta * omega0)


log_zeta = st.floats(-4.0, 0.3).map(lambda x: 10.0**x)
log_omega = st.floats(-1.0, 1.5).map(lambda x: 10.0**x)


@given(zeta=log_zeta, omega0=log_omega)
def test_white_noise_through_an_oscillator_by_its_poles(zeta, omega0):
    gain, poles, displacement, velocity = oscillator(zeta, omega0)
    q = spectral_nodes(0.02, 200.0, poles=poles, half_line=True)
    assert q.integrate(gain(q.omega)) == pytest.approx(displacement, rel=1e-8)
    assert q.integrate(q.omega**2 * gain(q.omega)) == pytest.approx(velocity, rel=1e-8)
    assert len(q) < 700


@given(zeta=log_zeta, omega0=log_omega)
def test_white_noise_through_an_oscillator_adaptively(zeta, omega0):
    gain, poles, displacement, velocity = oscillator(zeta, omega0)

    def both(omega):
        return np.array([gain(omega), omega**2 * gain(omega)])

    q = adaptive_nodes(both, 0.02, 200.0, poles=poles, rtol=1e-6, half_line=True)
    np.testing.assert_allclose(q.integrate(both(q.omega)), [displacement, velocity], rtol=1e-6)


@pytest.mark.parametrize("zeta", [1e-4, 0.003, 0.2, 1.0])
def test_adaptive_finds_a_resonance_that_it_was_not_told_of(zeta):
    gain, _, displacement, _ = oscillator(zeta, 0.944)
    q = adaptive_nodes(gain, 0.1, 10.0, rtol=1e-9, half_line=True)
    assert q.integrate(gain(q.omega)) == pytest.approx(displacement, rel=1e-9)


def test_a_pole_is_not_overlooked_however_narrow():
    zeta = 1e-9
    gain, poles, displacement, _ = oscillator(zeta, 1.234)
    q = adaptive_nodes(gain, 0.1, 10.0, poles=poles, rtol=1e-6, half_line=True)
    assert q.integrate(gain(q.omega)) == pytest.approx(displacement, rel=1e-6)


@pytest.mark.parametrize("pole_at", [0.02, 5.0, 300.0])
def test_half_line_with_a_pole_outside_the_logarithmic_part(pole_at):
    gain, poles, displacement, _ = oscillator(0.01, pole_at)
    q = spectral_nodes(0.1, 100.0, poles=poles, half_line=True)
    assert q.integrate(gain(q.omega)) == pytest.approx(displacement, rel=1e-8)


@given(power=st.floats(-5.0, 3.0), low=st.floats(0.01, 1.0), decades=st.floats(0.1, 4.0))
def test_powers_of_omega(power, low, decades):
    high = low * 10.0**decades
    exact = (
        math.log(high / low)
        if abs(power + 1.0) < 1e-9
        else low ** (power + 1.0) * math.expm1((power + 1.0) * math.log(high / low)) / (power + 1.0)
    )
    q = spectral_nodes(low, high)
    assert q.integrate(q.omega**power) == pytest.approx(exact, rel=1e-9)
    assert np.all(np.diff(q.omega) > 0.0)
    assert np.all(q.weights > 0.0)
    assert q.omega[0] > low
    assert q.omega[-1] < high


def test_splits_restore_the_accuracy_at_a_kink():
    def kink(omega):
        return np.abs(omega - 1.3) * np.exp(-omega)

    # Integrals of (w - c) e^-w from its antiderivative -(w - c + 1) e^-w.
    def primitive(omega):
        return -(omega - 1.3 + 1.0) * math.exp(-omega)

    exact = (primitive(8.0) - primitive(1.3)) - (primitive(1.3) - primitive(0.1))
    with_split = spectral_nodes(0.1, 8.0, splits=[1.3])
    without = spectral_nodes(0.1, 8.0)
    assert with_split.integrate(kink(with_split.omega)) == pytest.approx(exact, rel=1e-12)
    assert abs(without.integrate(kink(without.omega)) / exact - 1.0) > 1e-6
    adaptive = adaptive_nodes(kink, 0.1, 8.0, rtol=1e-6)
    assert adaptive.integrate(kink(adaptive.omega)) == pytest.approx(exact, rel=1e-6)
    announced = adaptive_nodes(kink, 0.1, 8.0, splits=[1.3], rtol=1e-6)
    assert len(announced) < len(adaptive)


def test_every_integrand_is_accurate_whatever_its_size():
    def integrands(omega):
        big = 1e12 / ((omega - 30.0) ** 2 + 0.5**2)
        small = 1e-12 / ((omega - 0.7) ** 2 + 0.002**2)
        return np.array([big, small, np.zeros_like(omega), np.sin(omega)])

    q = adaptive_nodes(integrands, 0.1, 60.0, rtol=1e-9)
    big, small, nothing, signed = q.integrate(integrands(q.omega))
    atan = math.atan
    assert big == pytest.approx(1e12 / 0.5 * (atan(30.0 / 0.5) + atan(29.9 / 0.5)), rel=1e-9)
    exact = 1e-12 / 0.002 * (atan(59.3 / 0.002) + atan(0.6 / 0.002))
    assert small == pytest.approx(exact, rel=1e-9)
    assert nothing == 0.0
    assert signed == pytest.approx(math.cos(0.1) - math.cos(60.0), abs=1e-7)


def test_agrees_with_quadpack_on_a_peaked_spectrum():
    def spectrum(omega):
        sigma = np.where(omega <= 0.6, 0.07, 0.09)
        hump = np.exp(-0.5 * ((omega / 0.6 - 1.0) / sigma) ** 2)
        return omega**-5 * np.exp(-1.25 * (0.6 / omega) ** 4) * 3.3**hump

    expected = sum(
        quad(lambda w: float(spectrum(np.array(w))), a, b, epsabs=0.0, epsrel=1e-12, limit=200)[0]
        for a, b in ((0.2, 0.6), (0.6, 1.0), (1.0, 20.0))
    )
    adaptive = adaptive_nodes(spectrum, 0.2, 20.0, splits=[0.6], rtol=1e-10)
    assert adaptive.integrate(spectrum(adaptive.omega)) == pytest.approx(expected, rel=1e-10)
    # The hump is no pole, but its half-width may be given as if it were one.
    known = spectral_nodes(0.2, 20.0, splits=[0.6], poles=[complex(-0.06, 0.6)])
    assert known.integrate(spectrum(known.omega)) == pytest.approx(expected, rel=1e-9)
    assert len(known) <= 160


def test_short_panels_get_few_nodes():
    rows = np.linspace(0.34, 1.46, 18)
    q = spectral_nodes(0.25, 60.0, splits=rows)
    assert len(q) < 200
    assert len(spectral_nodes(0.25, 60.0, splits=rows, per_panel=8)) < len(q)


def test_a_heap_of_poles_far_from_the_axis_costs_as_many_nodes_as_one():
    """The real poles of a hysteretic rope's pieces, fifteen about each of a few corners."""
    one, light = [-0.5, -5.0, -50.0], complex(-0.05, 5.0)
    heaps = [p * (1.0 + 1e-3 * k) for p in one for k in range(15)]
    few = spectral_nodes(0.25, 60.0, poles=[*one, light])
    many = spectral_nodes(0.25, 60.0, poles=[*heaps, light])
    assert len(many) == len(few)
    want = 5.0 * (np.arctan(60.0 / 5.0) - np.arctan(0.25 / 5.0))
    assert many.integrate(1.0 / (1.0 + (many.omega / 5.0) ** 2)) == pytest.approx(want, rel=1e-9)
    assert len(few) > len(spectral_nodes(0.25, 60.0, poles=one))


def test_splits_on_and_beyond_the_ends_are_harmless():
    plain = spectral_nodes(0.5, 2.0)
    odd = spectral_nodes(0.5, 2.0, splits=[0.0, 0.5, 2.0, 7.0, 0.1])
    np.testing.assert_array_equal(plain.omega, odd.omega)
    near = spectral_nodes(0.5, 2.0, splits=[2.0 * (1 - 1e-13), 0.5 * (1 + 1e-13)], half_line=True)
    assert near.integrate(1.0 / (1.0 + near.omega**2)) == pytest.approx(math.pi / 2.0, rel=1e-9)


def test_integrate_takes_any_axis():
    q = spectral_nodes(0.1, 10.0)
    values = np.array([q.omega**0, q.omega])
    np.testing.assert_allclose(q.integrate(values), [9.9, 49.995], rtol=1e-12)
    np.testing.assert_allclose(q.integrate(values.T, axis=0), [9.9, 49.995], rtol=1e-12)
    with pytest.raises(InputError, match="must be real, got complex values"):
        q.integrate(1j * values)


def test_nodes_are_read_only():
    q = spectral_nodes(0.1, 10.0)
    with pytest.raises(ValueError, match="read-only"):
        q.omega[0] = 1.0
    with pytest.raises(InputError, match="equally long"):
        Quadrature(omega=np.zeros(3), weights=np.zeros(4))


def test_a_pole_on_the_axis_is_refused():
    with pytest.raises(InputError, match="off the imaginary axis"):
        spectral_nodes(0.1, 10.0, poles=[2.0j])


def test_an_integrator_is_no_obstacle():
    with_integrator = spectral_nodes(0.1, 10.0, poles=[0.0])
    np.testing.assert_array_equal(with_integrator.omega, spectral_nodes(0.1, 10.0).omega)


def test_what_cannot_be_integrated_is_said():
    with pytest.raises(SolverError, match="hardest near 1 rad/s"):
        adaptive_nodes(lambda omega: 1.0 / np.abs(omega - 1.0), 0.1, 10.0)
    with pytest.raises(InputError, match=r"must be finite, got nan at 0\.1\d* rad/s"):
        adaptive_nodes(lambda omega: omega * np.nan, 0.1, 10.0)
    with pytest.raises(InputError, match="must be real, got complex values"):
        adaptive_nodes(lambda omega: 1j * omega, 0.1, 10.0)
    with pytest.raises(InputError, match="got shape"):
        adaptive_nodes(lambda omega: omega[:-1], 0.1, 10.0)


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"low": 0.0}, "low must be above 0 rad/s, got 0.0"),
        ({"high": 0.05}, "high must be above 0.1 rad/s, got 0.05"),
        ({"rtol": 1e-14}, r"rtol must be in \[1e-12, 0.1\], got 1e-14"),
        ({"panels_per_decade": 0.1}, "panels_per_decade must be in"),
        ({"splits": [math.nan]}, "splits must be"),
    ],
)
def test_bad_arguments(keywords, message):
    arguments = {"low": 0.1, "high": 10.0, **keywords}
    with pytest.raises(InputError, match=message):
        adaptive_nodes(lambda omega: omega, **arguments)


def test_per_panel_has_a_least_value():
    with pytest.raises(InputError, match="per_panel must be at least 2, got 1"):
        spectral_nodes(0.1, 10.0, per_panel=1)
