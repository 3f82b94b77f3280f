"""The programme of any linear plant: horizon, regulator, condensing, filter and solver."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from models.basics import InputError
from mpc.programme import (
    Condensed,
    Constraint,
    Horizon,
    Signals,
    SoftQP,
    corrected,
    default_blocking,
    end_of_record,
    free_outputs,
    kalman_gain,
    kkt_residual,
    lq_regulator,
    prediction_covariance,
)
from mpc.programme.kalman import known

N, NX, NW, NC, NH = 9, 3, 2, 2, 4
BLOCKS = (1, 2, 2, 4)
WEIGHTS, UNITS, SCALE = np.array([1.0, 0.3, 0.1]), np.array([2.5, 0.4]), 0.7
NU = len(UNITS)


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
        B=matrix(rng, NX, NU),
        from_path=matrix(rng, NX, 2 * NW),
        from_constants=matrix(rng, NX, NC),
        blocks=BLOCKS,
        units=UNITS,
    )


@pytest.fixture
def costs(rng):
    """Three signals that cost: of state, inputs, path at both ends and constants."""
    return Signals(
        names=("a", "b", "c"),
        C=matrix(rng, 3, NX),
        D=matrix(rng, 3, NU),
        F=matrix(rng, 3, 2 * NW),
        G=matrix(rng, 3, NC),
    )


@pytest.fixture
def sea(rng):
    """A disturbance's own model and what it shows, (NH, NH) and (NW, NH)."""
    return stable(rng, NH), matrix(rng, NW, NH)


@pytest.fixture
def regulator(horizon, costs, sea):
    Phi, shown = sea

    def of_sea(rows):
        return rows[:, :NW] @ shown + rows[:, NW:] @ shown @ Phi

    return lq_regulator(
        horizon.A,
        horizon.B,
        costs.C,
        costs.D,
        weights=WEIGHTS,
        scale=np.array([1.0, 10.0, 0.1]),
        Gamma=np.hstack([of_sea(horizon.from_path), horizon.from_constants]),
        Phi=scipy.linalg.block_diag(Phi, np.eye(NC)),
        M=np.hstack([of_sea(costs.F), costs.G]),
    )


@pytest.fixture
def signals():
    """Two signals of the state, which have limits at every second sample."""
    C = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, -1.0]])
    return Signals(
        names=("first", "other"),
        C=C,
        D=np.zeros((2, NU)),
        F=np.zeros((2, 2 * NW)),
        G=np.zeros((2, NC)),
    )


def motion(horizon, x, path, c, v):
    """The states x_0 .. x_N, step by step."""
    states = [x]
    for j, k in enumerate(np.repeat(np.arange(len(BLOCKS)), BLOCKS)):
        push = horizon.from_path @ np.concatenate([path[j], path[j + 1]])
        push = push + horizon.from_constants @ c + horizon.B @ (UNITS * v[k])
        states.append(horizon.A @ states[-1] + push)
    return np.array(states)


def cost(horizon, regulator, costs, x, path, c, v, end):
    states, d = motion(horizon, x, path, c, v), UNITS * np.repeat(v, BLOCKS, axis=0)
    value = 0.0
    for j in range(N):
        s = costs.C @ states[j] + costs.D @ d[j] + costs.G @ c
        s = s + costs.F @ np.concatenate([path[j], path[j + 1]])
        value += WEIGHTS @ s**2
    zeta, last = np.concatenate([end, c]), states[-1]
    return value + last @ regulator.P @ last + 2.0 * last @ regulator.N @ zeta


def condensed(horizon, regulator, costs, signals):
    every_second = frozenset(range(0, N + 1, 2))
    return Condensed(
        horizon,
        signals=signals,
        cost=costs,
        end=regulator,
        constraints=[
            Constraint(signal="first", low=-2.0, soft=True, samples=every_second),
            Constraint(signal="other", low=-0.5, high=4.0, samples=every_second),
        ],
        inputs=("u", "v"),
        rest={},
        scale=SCALE,
        traced="first",
    )


def asked(rng):
    """State, path, constants, and the disturbance's state at the end."""
    return (matrix(rng, *n) for n in ((NX,), (N + 1, NW), (NC,), (NH,)))


def test_the_states_of_a_horizon_are_those_of_the_plant(horizon, rng):
    x, path, c = matrix(rng, NX), matrix(rng, N + 1, NW), matrix(rng, NC)
    v = matrix(rng, len(BLOCKS), NU)
    columns = np.concatenate([x, path.ravel(), c, v.ravel()])
    found = [S @ columns for S in horizon.states()]
    np.testing.assert_allclose(found, motion(horizon, x, path, c, v), atol=1e-12)


def test_the_programme_is_the_cost_summed_along_the_motion(horizon, regulator, costs, signals, rng):
    p = condensed(horizon, regulator, costs, signals)
    x, path, c, end = asked(rng)
    f = p.gradient @ np.concatenate([x, path.ravel(), c]) + p.from_end @ end
    known = horizon, regulator, costs, x, path, c
    none = np.zeros((len(BLOCKS), NU))
    for v in matrix(rng, 5, len(BLOCKS), NU):
        more = cost(*known, v, end) - cost(*known, none, end)
        moves = v.ravel()
        assert SCALE * (0.5 * moves @ p.H @ moves + f @ moves) == pytest.approx(more, rel=1e-10)


def test_its_rows_are_the_signals_over_their_limits(horizon, regulator, costs, signals, rng):
    p = condensed(horizon, regulator, costs, signals)
    x, path, c, _ = asked(rng)
    v = matrix(rng, len(BLOCKS), NU)
    states = motion(horizon, x, path, c, v)
    columns = np.concatenate([x, path.ravel(), c, v.ravel()])
    shown = states @ signals.C.T
    np.testing.assert_allclose(p.rows @ columns, shown[p.at, p.kind] * p.scale, rtol=1e-10)
    # Hard ones first; the first sample is past.
    assert p.at.tolist() == [2, 4, 6, 8, 2, 4, 6, 8]
    assert p.kind.tolist() == [1] * 4 + [0] * 4
    # Soft ones over their limits; hard ones such that the solver takes none for nothing.
    assert p.scale[4:].tolist() == [0.5] * 4
    moved = p.rows[:4, p.horizon.moves]
    reach = np.einsum("ij,ji->i", moved, np.linalg.solve(p.H, moved.T))
    np.testing.assert_allclose(reach, 1.0, rtol=1e-9)
    np.testing.assert_allclose(p.row_low, np.r_[-0.5 * p.scale[:4], [-1.0] * 4], rtol=1e-12)
    np.testing.assert_allclose(p.row_high, np.r_[4.0 * p.scale[:4], [1e20] * 4], rtol=1e-12)
    np.testing.assert_allclose(p.traced @ columns, states[[0, 1, 3, 5], 0], atol=1e-12)


def test_without_blocks_and_limits_its_first_move_is_the_regulators(
    horizon, regulator, costs, signals, sea, rng
):
    free = replace(horizon, blocks=(1,) * N)
    p = condensed(free, regulator, costs, signals)
    x, c, h = matrix(rng, NX), matrix(rng, NC), matrix(rng, NH)
    path = free_outputs(*sea, N) @ h
    end = np.linalg.matrix_power(sea[0], N) @ h
    f = p.gradient @ np.concatenate([x, path, c]) + p.from_end @ end
    wanted = -regulator.K @ x - regulator.K_disturbance @ np.concatenate([h, c])
    np.testing.assert_allclose(UNITS * (p.law @ f), wanted, rtol=1e-9)


def test_the_regulators_value_function_is_that_of_the_riccati_equation(horizon, regulator, costs):
    C, D = costs.C, costs.D
    P = scipy.linalg.solve_discrete_are(
        horizon.A,
        horizon.B,
        C.T * WEIGHTS @ C,
        D.T * WEIGHTS @ D,
        s=C.T * WEIGHTS @ D,
    )
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


def test_what_is_certain_has_a_size_of_one_though_rounding_left_less_than_nothing() -> None:
    assert known(np.diag([4.0, 0.0, -1e-25])).tolist() == [2.0, 1.0, 1.0]


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
