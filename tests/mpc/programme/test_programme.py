"""The programme of any linear plant: horizon, regulator, condensing, filter and solver."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from models.basics import InputError
from mpc.programme import (
    Horizon,
    SoftQP,
    condense,
    corrected,
    default_blocking,
    end_of_record,
    free_outputs,
    kalman_gain,
    kkt_residual,
    lq_regulator,
    prediction_covariance,
)

N, NX, NW, NC, NH = 9, 3, 2, 2, 4
BLOCKS = (1, 2, 2, 4)
WEIGHT, UNIT, SCALE = 0.3, 2.5, 0.7


def matrix(rng, *shape):
    return rng.normal(size=shape)


def stable(rng, n):
    A = matrix(rng, n, n)
    return 0.95 * A / np.abs(np.linalg.eigvals(A)).max()


@pytest.fixture
def rng():
    return np.random.default_rng(7)


@pytest.fixture
def horizon(rng):
    return Horizon(
        A=stable(rng, NX),
        B=matrix(rng, NX, 1),
        from_path=matrix(rng, NX, 2 * NW),
        from_constants=matrix(rng, NX, NC),
        blocks=BLOCKS,
        unit=UNIT,
    )


@pytest.fixture
def output(rng):
    return matrix(rng, NX)


@pytest.fixture
def sea(rng):
    """A disturbance's own model and what it shows, (NH, NH) and (NW, NH)."""
    return stable(rng, NH), matrix(rng, NW, NH)


@pytest.fixture
def regulator(horizon, output, sea):
    A, B = np.asarray(horizon.A), np.asarray(horizon.B)
    Phi, shown = sea
    over = scipy.linalg.block_diag(Phi, np.eye(NC))
    moved = horizon.from_path[:, :NW] @ shown + horizon.from_path[:, NW:] @ shown @ Phi
    # The input that holds the output against each constant.
    system = np.block([[A - np.eye(NX), B], [output[None, :], np.zeros((1, 1))]])
    held = np.linalg.solve(system, np.vstack([-horizon.from_constants, np.zeros((1, NC))]))
    return lq_regulator(
        A,
        B,
        output,
        weight=WEIGHT,
        scale=np.array([1.0, 10.0, 0.1]),
        Gamma=np.hstack([moved, horizon.from_constants]),
        Phi=over,
        steady=np.concatenate([np.zeros(NH), held[-1]]),
    )


def rows(j, S):
    """Two signals at every second sample."""
    return [(0, S[0]), (1, S[1] - S[2])] if j % 2 == 0 else []


def motion(horizon, x, path, c, v):
    """The states x_0 .. x_N, step by step."""
    states = [x]
    for j, k in enumerate(np.repeat(np.arange(len(BLOCKS)), BLOCKS)):
        push = horizon.from_path @ np.concatenate([path[j], path[j + 1]])
        push = push + horizon.from_constants @ c + horizon.B[:, 0] * UNIT * v[k]
        states.append(horizon.A @ states[-1] + push)
    return np.array(states)


def cost(horizon, regulator, output, x, path, c, v, end):
    states = motion(horizon, x, path, c, v)
    d = UNIT * np.repeat(v, BLOCKS) - regulator.steady[NH:] @ c
    zeta, last = np.concatenate([end, c]), states[-1]
    value = ((states[1:-1] @ output) ** 2).sum() + WEIGHT * (d**2).sum()
    return value + last @ regulator.P @ last + 2.0 * last @ regulator.N @ zeta


def condensed(horizon, regulator, output):
    return condense(
        horizon, regulator, output=output, scale=SCALE, speed=np.eye(NX)[1], signals=rows
    )


def test_the_states_of_a_horizon_are_those_of_the_plant(horizon, rng):
    x, path, c = matrix(rng, NX), matrix(rng, N + 1, NW), matrix(rng, NC)
    v = matrix(rng, len(BLOCKS))
    columns = np.concatenate([x, path.ravel(), c, v])
    found = [S @ columns for S in horizon.states()]
    np.testing.assert_allclose(found, motion(horizon, x, path, c, v), atol=1e-12)


def test_the_programme_is_the_cost_summed_along_the_motion(horizon, regulator, output, rng):
    p = condensed(horizon, regulator, output)
    x, path, c, end = (matrix(rng, *n) for n in ((NX,), (N + 1, NW), (NC,), (NH,)))
    f = p.gradient @ np.concatenate([x, path.ravel(), c]) + p.from_end @ end
    asked = horizon, regulator, output, x, path, c
    for v in matrix(rng, 5, len(BLOCKS)):
        more = cost(*asked, v, end) - cost(*asked, np.zeros(len(BLOCKS)), end)
        assert N * SCALE * (0.5 * v @ p.H @ v + f @ v) == pytest.approx(more, rel=1e-10)


def test_its_rows_are_the_signals_and_its_speeds_those_at_the_blocks(
    horizon, regulator, output, rng
):
    p = condensed(horizon, regulator, output)
    x, path, c = matrix(rng, NX), matrix(rng, N + 1, NW), matrix(rng, NC)
    v = matrix(rng, len(BLOCKS))
    states = motion(horizon, x, path, c, v)
    found = p.rows @ np.concatenate([x, path.ravel(), c, v])
    signals = np.column_stack([states[:, 0], states[:, 1] - states[:, 2]])
    np.testing.assert_allclose(found, signals[p.at, p.kind], atol=1e-12)
    assert p.at.tolist() == [0, 0, 2, 2, 4, 4, 6, 6, 8, 8]
    columns = np.concatenate([x, path.ravel(), c, v])
    np.testing.assert_allclose(p.speeds @ columns, states[[0, 1, 3, 5], 1], atol=1e-12)


def test_without_blocks_and_limits_its_first_move_is_the_regulators(
    horizon, regulator, output, sea, rng
):
    free = replace(horizon, blocks=(1,) * N)
    p = condensed(free, regulator, output)
    x, c, h = matrix(rng, NX), matrix(rng, NC), matrix(rng, NH)
    path = free_outputs(*sea, N) @ h
    end = np.linalg.matrix_power(sea[0], N) @ h
    f = p.gradient @ np.concatenate([x, path, c]) + p.from_end @ end
    v = -np.linalg.solve(p.H, f)
    wanted = -regulator.K @ x - regulator.K_disturbance @ np.concatenate([h, c])
    assert UNIT * v[0] == pytest.approx(wanted, rel=1e-9)


def test_the_regulators_value_function_is_that_of_the_riccati_equation(horizon, regulator, output):
    A, B = np.asarray(horizon.A), np.asarray(horizon.B)
    P = scipy.linalg.solve_discrete_are(A, B, np.outer(output, output), [[WEIGHT]])
    np.testing.assert_allclose(regulator.P, P, rtol=1e-9, atol=1e-9 * np.abs(P).max())


def test_blocks_grow_and_fill_the_horizon():
    for horizon in (0.2, 1.0, 3.0, 6.0, 8.0, 10.0, 20.0):
        blocks = default_blocking("test", horizon, 0.05)
        assert sum(blocks) == round(horizon / 0.05)
        assert blocks[0] == 1
    assert len(default_blocking("test", 8.0, 0.05)) < 35
    with pytest.raises(InputError, match=r"test: horizon must be in \[0.2, 100\] s, got 0.1"):
        default_blocking("test", 0.1, 0.05)


def test_the_end_of_a_record_is_the_mean_given_all_of_it(rng):
    A, C, steps = stable(rng, NH), matrix(rng, NW, NH), 5
    root, start = matrix(rng, NH, NH), matrix(rng, NH, NH)
    Q, R, P = root @ root.T, np.array([0.1, 0.4]), start @ start.T
    # All noises as one Gaussian vector, and states and outputs as what it gives.
    state = np.hstack([start, np.zeros((NH, NH * steps))])
    states = [state]
    for k in range(steps):
        state = A @ state
        state[:, NH * (k + 1) : NH * (k + 2)] += root
        states.append(state)
    shown = np.vstack([C @ each for each in states])
    covariance = shown @ shown.T + np.diag(np.tile(R, steps + 1))
    gain = np.linalg.solve(covariance, shown @ states[-1].T).T
    expected = np.vstack([C @ np.linalg.matrix_power(A, k) for k in range(steps + 1)])
    from_record, from_estimate = end_of_record(A, C, Q, R, P, steps)
    np.testing.assert_allclose(from_record, gain, atol=1e-10)
    rest = np.linalg.matrix_power(A, steps) - gain @ expected
    np.testing.assert_allclose(from_estimate, rest, atol=1e-10)


def test_the_covariance_of_the_prediction_is_that_of_the_recursion(rng):
    A, C, G, R = stable(rng, NX), matrix(rng, 2, NX), matrix(rng, NX, 2), np.array([0.2, 3.0])
    P = np.eye(NX)
    for _ in range(2000):
        P = A @ corrected(P, C, R, kalman_gain(C, R, P)) @ A.T + G @ G.T
    found = prediction_covariance(A, C, G, R, np.array([1.0, 30.0, 0.2]))
    np.testing.assert_allclose(found, P, rtol=1e-9, atol=1e-9 * np.abs(P).max())


def test_what_is_missing_has_no_gain_and_leaves_that_of_the_others(rng):
    C, R = matrix(rng, 3, NX), np.array([0.5, 1e-6, 2.0])
    root = matrix(rng, NX, NX)
    P, there = root @ root.T, np.array([True, False, True])
    gain = kalman_gain(C, R, P, there)
    assert not gain[:, 1].any()
    np.testing.assert_allclose(gain[:, there], kalman_gain(C[there], R[there], P))
    whole = kalman_gain(C, R, P)
    after = corrected(P, C, R, whole)
    np.testing.assert_allclose(after, P - whole @ C @ P, atol=1e-10)
    # The gain that leaves least: any other leaves more.
    for other in (gain, 1.1 * whole):
        assert np.trace(corrected(P, C, R, other)) > np.trace(after)


def test_a_changed_programme_is_solved_as_one_that_is_new(rng):
    root, R, S = matrix(rng, 4, 4), matrix(rng, 2, 4), matrix(rng, 1, 4)
    options = {"quadratic": 50.0, "linear": 5.0, "hard": S}
    qp = SoftQP(np.eye(4), R, **options)
    wide = np.concatenate([np.full(4, 0.4), [0.1], np.full(2, 0.05)])
    qp.solve(matrix(rng, 4), -wide, wide)
    H, rows, f = root @ root.T + np.eye(4), matrix(rng, 2, 4), 5.0 * matrix(rng, 4)
    assert qp.change(H, rows)
    new = SoftQP(H, rows, **options).solve(f, -wide, wide)
    for _ in range(2):
        changed = qp.solve(f, -wide, wide)
        np.testing.assert_allclose(changed.v, new.v, atol=1e-9)
        assert kkt_residual(qp, f, -wide, wide, changed) < 1e-8
        qp.reset()  # from the beginning it is the same programme still
    assert not qp.change(np.full((4, 4), np.nan), rows)
    np.testing.assert_allclose(qp.solve(f, -wide, wide).v, new.v, atol=1e-9)
