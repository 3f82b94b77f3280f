"""Integrals of the verification against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from models.basics import SolverError
from synth.verify.integrals import integrate, panels


def resonance(omega: np.ndarray, at: float, zeta: float) -> np.ndarray:
    return np.asarray(np.abs(1.0 / (1.0 - (omega / at) ** 2 + 2j * zeta * omega / at)) ** 2)


def test_a_resonance_that_no_pole_marks_costs_points_beside_itself_only() -> None:
    """pi zeta^-1 omega_0 / 4 over the half line; a rope's modes are not those of its masses."""
    zeta, asked = 2e-4, 0

    def density(omega: np.ndarray) -> np.ndarray:
        nonlocal asked
        asked += omega.size
        return resonance(omega, 7.0, zeta)[None]

    edges = panels(1e-2, 1e3, [], np.array([-0.02 + 6.8j, -1.0 + 0.0j]))
    found = integrate(density, edges, rtol=1e-8, tail_panels=20)
    assert found[0] == pytest.approx(np.pi / (4.0 * zeta) * 7.0, rel=1e-6)
    assert asked < 4 * 22 * len(edges)


def test_integrands_of_any_size_are_as_accurate() -> None:
    edges = panels(0.5, 8.0, [], np.zeros(0, np.complex128))
    found = integrate(lambda w: np.array([w**2, 1e-12 / w]), edges, rtol=1e-10)
    want = [(8.0**3 - 0.5**3) / 3.0, 1e-12 * np.log(16.0)]
    np.testing.assert_allclose(found, want, rtol=1e-10)


def test_what_has_no_integral_is_said() -> None:
    with pytest.raises(SolverError, match="does not converge"):
        integrate(lambda w: 1.0 / (w - 2.0)[None] ** 2, np.array([1.0, 3.3]), rtol=1e-8)
