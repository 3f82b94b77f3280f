"""Plants of an engineer's drawer, and what a closed loop does, computed by other means.

Nothing here uses the code that synthesis uses: closed loops are matrices written out by hand,
variances come from Lyapunov equations, margins from dense grids and from the definition (the
gain or delay at which the loop stops being stable).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt
import scipy.linalg

from models.basics import White
from models.plant import LinearPlant
from synth.loop import LinearController

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]


def double_integrator(**changes: object) -> LinearPlant:
    """x'' = u + f; x is measured with the noise n; outputs x, u."""
    numbers: dict[str, object] = {
        "A": [[0.0, 1.0], [0.0, 0.0]],
        "B": [[0.0], [1.0]],
        "E": [[0.0, 0.0], [1.0, 0.0]],
        "C": [[1.0, 0.0]],
        "F": [[0.0, 1.0]],
        "Cz": [[1.0, 0.0], [0.0, 0.0]],
        "Dz": [[0.0], [1.0]],
        "inputs": ("u",),
        "measurements": ("y",),
        "disturbances": ("f", "n"),
        "outputs": ("x", "effort"),
    }
    return LinearPlant(**{**numbers, **changes})  # type: ignore[arg-type]


def oscillator(stiffness: float = 4.0, damping: float = 0.04) -> LinearPlant:
    """x'' + damping x' + stiffness x = u + f; an unstable pole for a negative stiffness."""
    return double_integrator(A=[[0.0, 1.0], [-stiffness, -damping]])


def two_carts(count: int = 1) -> LinearPlant:
    """Two carts on lightly damped springs, pushed at the first (and the second, stronger).

    Measured at the first (and second), disturbed at the second; outputs their places and the
    efforts.
    """
    K = np.array([[3.0, -2.0], [-2.0, 2.0]])
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-K, -0.02 * K]])
    C = np.eye(2, 4)[:count]
    return LinearPlant(
        A=A,
        B=np.vstack([np.zeros((2, 2)), np.diag([1.0, 2.0])])[:, :count],
        E=np.hstack([[[0.0], [0.0], [0.5], [1.0]], np.zeros((4, count))]),
        C=C,
        F=np.hstack([np.zeros((count, 1)), np.eye(count)]),
        Cz=np.vstack([np.eye(2, 4), np.zeros((count, 4))]),
        Dz=np.vstack([np.zeros((2, count)), np.eye(count)]),
        inputs=("u1", "u2")[:count],
        measurements=("y1", "y2")[:count],
        disturbances=("f", "n1", "n2")[: count + 1],
        outputs=("x1", "x2", "effort1", "effort2")[: 2 + count],
    )


def integrator(delay: float) -> LinearPlant:
    """x' = u + w, x measured late: the loop with a closed form."""
    return LinearPlant(
        A=[[0.0]],
        B=[[1.0]],
        E=[[1.0]],
        C=[[1.0]],
        Cz=[[1.0], [0.0]],
        Dz=[[0.0], [1.0]],
        inputs=("u",),
        measurements=("y",),
        disturbances=("w",),
        outputs=("x", "effort"),
        delays=(delay,),
    )


def with_full_state(plant: LinearPlant) -> LinearPlant:
    """The plant with its state measured, without noise, and only what shakes the state."""
    n = len(plant.states)
    acts = [k for k in range(len(plant.disturbances)) if np.any(plant.E[:, k])]
    return LinearPlant(
        A=plant.A,
        B=plant.B,
        E=plant.E[:, acts],
        C=np.eye(n),
        Cz=plant.Cz,
        Dz=plant.Dz,
        inputs=plant.inputs,
        measurements=tuple(f"m{i + 1}" for i in range(n)),
        disturbances=tuple(plant.disturbances[k] for k in acts),
        outputs=plant.outputs,
    )


def closed_matrices(
    plant: LinearPlant, controller: LinearController
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """A, E, C, F of the closed loop from w to z, without delays.

    From u = Ck xk + Dk (C x + D u + F w), solved for u as (u; y) = T^-1 (...).
    """
    n, nk = len(plant.states), len(controller.A)
    nu, ny = len(plant.inputs), len(plant.measurements)
    # [I  -Dk; -D  I] [u; y] = [Ck xk; C x + F w]
    knot = np.block([[np.eye(nu), -controller.D], [-plant.D, np.eye(ny)]])
    right = np.block(
        [
            [np.zeros((nu, n)), controller.C, np.zeros((nu, plant.E.shape[1]))],
            [plant.C, np.zeros((ny, nk)), plant.F],
        ]
    )
    signals = np.linalg.solve(knot, right)
    u, y = signals[:nu], signals[nu:]
    m = n + nk
    A = scipy.linalg.block_diag(plant.A, controller.A)
    A[:n] += plant.B @ u[:, :m]
    A[n:] += controller.B @ y[:, :m]
    E = np.vstack([plant.E + plant.B @ u[:, m:], controller.B @ y[:, m:]])
    C = np.hstack([plant.Cz, np.zeros((len(plant.Cz), nk))]) + plant.Dz @ u[:, :m]
    return A, E, C, plant.Fz + plant.Dz @ u[:, m:]


def lyapunov_variances(
    plant: LinearPlant, controller: LinearController, spectrum: Mapping[str, White]
) -> dict[str, float]:
    """Variances of all outputs under white noises; infinite where the loop is unstable."""
    A, E, C, F = closed_matrices(plant, controller)
    sizes = [spectrum[d].intensity if d in spectrum else 0.0 for d in plant.disturbances]
    if np.linalg.eigvals(A).real.max() >= 0.0:
        return dict.fromkeys(plant.outputs, np.inf)
    covariance = scipy.linalg.solve_continuous_lyapunov(A, -(E * sizes) @ E.T)
    found = np.diag(C @ covariance @ C.T)
    direct = np.diag((F * sizes) @ F.T)
    return {
        name: float(v) if d == 0.0 else np.inf
        for name, v, d in zip(plant.outputs, found, direct, strict=True)
    }


def lyapunov_cost(
    plant: LinearPlant,
    controller: LinearController,
    spectrum: Mapping[str, White],
    minimise: Mapping[str, float],
) -> float:
    """Square root of the weighted variance."""
    found = lyapunov_variances(plant, controller, spectrum)
    return float(np.sqrt(sum(w * found[name] for name, w in minimise.items())))


def loop_response(
    plant: LinearPlant, controller: LinearController, broken: int = 0
) -> Callable[[FloatArray], ComplexArray]:
    """The loop gain L at one input, all other loops closed, delays exact."""

    def transfer(A: FloatArray, B: FloatArray, C: FloatArray, s: ComplexArray) -> ComplexArray:
        inner = np.linalg.solve(s * np.eye(len(A)) - A, np.broadcast_to(B, (len(s), *B.shape)))
        return np.asarray(C @ inner)

    def loop(omega: FloatArray) -> ComplexArray:
        s = 1j * np.reshape(omega, (-1, 1, 1))
        G = transfer(plant.A, plant.B, plant.C, s) + plant.D
        G = np.exp(-s * np.reshape(plant.delays, (1, -1, 1))) * G
        K = np.broadcast_to(controller.D, (len(s), *controller.D.shape)).astype(complex)
        if len(controller.A):
            K = K + transfer(controller.A, controller.B, controller.C, s)
        L = -K @ G
        others = [i for i in range(L.shape[1]) if i != broken]
        rest = np.eye(len(others)) + L[:, others][:, :, others]
        turn = L[:, [broken]][:, :, others] @ np.linalg.solve(rest, L[:, others][:, :, [broken]])
        return np.asarray(L[:, broken, broken] - turn[:, 0, 0])

    return loop


def dense_grid(plant: LinearPlant, controller: LinearController, count: int = 6000) -> FloatArray:
    """Frequencies from far below to far above the closed loop's poles [rad/s]."""
    sizes = np.abs(np.linalg.eigvals(closed_matrices(plant, controller)[0]))
    return np.geomspace(1e-3 * sizes.min(), 1e2 * sizes.max(), count)


def stable_with(plant: LinearPlant, controller: LinearController, factor: float) -> bool:
    """Whether the loop is stable with its gain times `factor`, delays dropped."""
    scaled = LinearController(
        A=controller.A,
        B=controller.B,
        C=factor * controller.C,
        D=factor * controller.D,
        measurements=controller.measurements,
        inputs=controller.inputs,
    )
    return bool(np.linalg.eigvals(closed_matrices(plant, scaled)[0]).real.max() < 0.0)
