"""Spectral factors: exact where a spectrum is rational, stable and minimum-phase always."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import quad
from scipy.linalg import solve_continuous_lyapunov

from models.basics import InputError
from models.sea import SeaSpectrum
from synth.bound.spectral_factor import fit_spectral_factor, spectral_factor
from synth.loop import disturbances

FloatArray = npt.NDArray[np.float64]
SEA = SeaSpectrum(kind="jonswap", significant_height=2.0, peak_period=9.0)


def low_pass(omega: npt.ArrayLike) -> FloatArray:
    """Error of a reference unit: 5 cm behind a second-order Butterworth filter at 2 rad/s."""
    w = np.asarray(omega, dtype=np.float64)
    return np.asarray(0.05**2 * 2.0 * np.sqrt(2.0) / np.pi * 2.0**3 / (w**4 + 2.0**4))


def test_low_pass_needs_two_states_and_is_exact() -> None:
    source = disturbances({"error": low_pass}, ("error",))[0]
    found = spectral_factor(source).filter
    assert found.order == 2
    omega = np.geomspace(1e-3, 1e3, 60)
    np.testing.assert_allclose(found.density(omega), low_pass(omega), rtol=1e-6)
    # The white noise of intensity one behind it has the variance by Lyapunov, too.
    P = solve_continuous_lyapunov(found.A, -found.B @ found.B.T)
    assert (found.C @ P @ found.C.T)[0, 0] == pytest.approx(0.05**2, rel=1e-6)


@pytest.mark.parametrize(("order", "error"), [(4, 0.12), (6, 0.04), (8, 0.025), (10, 0.025)])
def test_sea(order: int, error: float) -> None:
    found = fit_spectral_factor(SEA.density, SEA.band, order).filter
    assert found.order == order
    assert found.poles.real.max() < 0.0
    assert found.shape_error < error
    # The derivative is proper: C B = 0.
    assert abs((found.C @ found.B)[0, 0]) < 1e-12 * np.linalg.norm(found.C) * np.linalg.norm(
        found.B
    )
    # The errors it states are those of its own density.
    low, high = SEA.band
    marks = [0.5, 0.6, 0.698, 0.75, 0.9, 1.5, 5.0]
    variance = quad(lambda w: float(SEA.density(w)), low, high, points=marks, limit=400)[0]
    missed = quad(
        lambda w: abs(float(found.density(w)) - float(SEA.density(w))),
        low,
        high,
        points=marks,
        limit=800,
    )[0]
    assert missed / variance == pytest.approx(found.shape_error, rel=0.05)


def test_zeros_lie_left_of_the_axis() -> None:
    found = fit_spectral_factor(SEA.density, SEA.band, 8).filter
    # Controllable form: the numerator is C, lowest power first.
    zeros = np.roots(found.C[0, ::-1][np.argmax(found.C[0, ::-1] != 0.0) :])
    assert zeros.real.max(initial=0.0) <= 1e-12


def test_refit_lowers_what_it_is_asked_to_lower() -> None:
    first = fit_spectral_factor(SEA.density, SEA.band, 6)
    omega = np.geomspace(*SEA.band, 400)
    target = SEA.density(omega)
    weights = np.gradient(omega) * np.where(omega > 2.0, 1e4, 1.0)

    def loss(factor) -> float:  # type: ignore[no-untyped-def]
        return float(weights @ (factor.filter.density(omega) - target) ** 2)

    again = first.refitted(omega, target, weights)
    assert loss(again) < 0.5 * loss(first)
    assert again.filter.poles.real.max() < 0.0


def test_bad_requests_are_refused() -> None:
    with pytest.raises(InputError, match="order must be even, 2 to 12, got 5"):
        fit_spectral_factor(np.ones_like, (0.1, 1.0), order=5)
    with pytest.raises(InputError, match="must hold variance, got 0"):
        fit_spectral_factor(np.zeros_like, (0.1, 1.0))
    nothing = disturbances({"error": np.zeros_like}, ("error",))[0]
    with pytest.raises(InputError, match="error must hold variance, got none"):
        spectral_factor(nothing)
