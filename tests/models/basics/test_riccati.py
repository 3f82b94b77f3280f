"""Riccati equations hold, whatever the units, and agree with those of other codes."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st

from models.basics import (
    SolverError,
    solve_discrete_lyapunov,
    solve_discrete_riccati,
    solve_lyapunov,
    solve_riccati,
)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), decades=st.floats(0.0, 6.0))
def test_riccati_equations_hold_whatever_the_units(seed: int, decades: float) -> None:
    rng = np.random.default_rng(seed)
    n, m = 5, 2
    unit = 10.0 ** rng.uniform(-decades, decades, n)
    A = (rng.normal(size=(n, n)) / unit[:, None]) * unit
    B = rng.normal(size=(n, m)) / unit[:, None]
    root = rng.normal(size=(n + m, n + m)) * np.append(unit, np.ones(m))
    weight = root.T @ root
    Q, S, R = weight[:n, :n], weight[:n, n:], weight[n:, n:]
    found = solve_riccati(A, B, Q, R, S)
    X = found.X * np.outer(1 / unit, 1 / unit)  # back to even units
    A, B, Q, S = (
        A * unit[:, None] / unit,
        B * unit[:, None],
        Q / np.outer(unit, unit),
        S / unit[:, None],
    )
    left = X @ B + S
    residual = A.T @ X + X @ A - left @ np.linalg.solve(R, left.T) + Q
    size = np.linalg.norm(Q) + 2 * np.linalg.norm(A) * np.linalg.norm(X)
    assert np.linalg.norm(residual) < 1e-8 * size
    gain = found.gain / unit
    assert np.linalg.eigvals(A + B @ gain).real.max() < 0.0


def test_doubling_agrees_with_a_schur_form_and_says_when_there_is_no_solution():
    rng = np.random.default_rng(4)
    A, C, Q = 1.2 * rng.normal(size=(6, 6)) / 2.5, rng.normal(size=(2, 6)), np.eye(6)
    found = solve_discrete_riccati(A, C, Q)
    assert found == pytest.approx(scipy.linalg.solve_discrete_are(A.T, C.T, Q, np.eye(2)))
    stable = A / np.abs(np.linalg.eigvals(A)).max() * 0.95
    exact = scipy.linalg.solve_discrete_lyapunov(stable, Q)
    assert solve_discrete_lyapunov(stable, Q) == pytest.approx(exact)
    assert solve_discrete_lyapunov(stable / 0.9, Q) is None
    with pytest.raises(SolverError, match="no stabilising solution"):
        solve_discrete_riccati(2.0 * np.eye(2), np.array([[1.0, 0.0]]), np.eye(2))


def test_lyapunov_equation_has_the_closed_form() -> None:
    A = np.array([[0.0, 1.0], [-4.0, -0.2]])
    found = solve_lyapunov(A, np.diag([0.0, 2.0]))
    # x'' + 0.2 x' + 4 x = w of intensity 2: sigma_v^2 = 2/0.4, sigma_x^2 = sigma_v^2/4
    np.testing.assert_allclose(found, np.diag([1.25, 5.0]), atol=1e-12)
