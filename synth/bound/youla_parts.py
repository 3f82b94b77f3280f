r"""Closed-loop responses that are affine in Youla's Q, with Q in a Laguerre basis.

    u = K x^ + v,  v = Q (y - C x^ - D u):  X = [K (s - A - BK)^-1 L + M Q] N

x^ is the observer's state, M = I + K (s - A - BK)^-1 B, N = I - C (s - A + LC)^-1 L, and X the
response from noise on the measurements to the command.  What `synth.bound.youla` optimises.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag

from models.basics import ComplexArray, FloatArray
from models.plant import LinearPlant

from ..loop import Controller

if TYPE_CHECKING:
    from .bound import Bound


def laguerre(a: float, count: int, channels: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return A, B of Laguerre functions sqrt(2a)/(s+a) ((s-a)/(s+a))^k of every channel, C of ones.

    The states are the functions themselves, channel by channel.
    """
    A = -a * np.eye(count) - 2.0 * a * np.tril(np.ones((count, count)), -1)
    B = math.sqrt(2.0 * a) * np.ones((count, 1))
    return block_diag(*[A] * channels), block_diag(*[B] * channels), np.ones((1, count * channels))


class AffineLoop:
    """Responses of the closed loop that are affine in Q."""

    def __init__(self, bound: Bound) -> None:
        plant = bound.dual.plant
        K, L = bound.point.regulator.gain, bound.dual.estimator.gain
        AK, AL = plant.A + plant.B @ K, plant.A - L @ plant.C
        ny, nu = len(plant.measurements), len(plant.inputs)
        self.marks = np.concatenate(
            [np.linalg.eigvals(AK), np.linalg.eigvals(AL), bound.plant.poles()]
        )
        self.plant = bound.plant
        self.shaking = [source.name for source in bound.sources]

        def system(A: FloatArray, B: FloatArray, C: FloatArray, D: FloatArray) -> LinearPlant:
            return LinearPlant(A=A, B=B, E=np.zeros((len(A), 0)), C=C, D=D)

        self.from_innovations = system(AK, L, K, np.zeros((nu, ny)))
        self.from_command = system(AK, plant.B, K, np.eye(nu))
        self.innovations = system(AL, L, -plant.C, np.eye(ny))

    def response(
        self, omega: FloatArray, columns: ComplexArray
    ) -> tuple[ComplexArray, ComplexArray]:
        """Return X at Q = 0, (k, ny), and its columns, (k, q, ny)."""
        N = self.innovations.response(omega).yu
        X = (self.from_innovations.response(omega).yu @ N)[:, 0]
        M = self.from_command.response(omega).yu[:, 0, 0]
        # Function k of channel j: M phi_k N[j, :]
        each = M[:, None, None, None] * columns[:, None, :, None] * N[:, :, None, :]
        return X, each.reshape(len(omega), -1, N.shape[2])

    def outputs(
        self, omega: FloatArray, columns: ComplexArray
    ) -> tuple[ComplexArray, ComplexArray]:
        """Return F at Q = 0, (k, nz, nw), and its columns, (k, nz, q, nw)."""
        X, each = self.response(omega, columns)
        blocks = self.plant.response(omega).select(disturbances=self.shaking)
        constant = blocks.zw + blocks.zu @ (X[:, None] @ blocks.yw)
        slope = blocks.zu[:, :, 0, None, None] * (each @ blocks.yw)[:, None]
        return constant, slope

    def sensitivity(
        self, omega: FloatArray, columns: ComplexArray
    ) -> tuple[ComplexArray, ComplexArray]:
        """Return S = 1 + X P_yu at Q = 0, (k,), and its columns, (k, q)."""
        X, each = self.response(omega, columns)
        yu = self.plant.response(omega).yu[:, :, 0]
        return 1.0 + np.einsum("ky,ky->k", X, yu), np.einsum("kqy,ky->kq", each, yu)


def basis(omega: FloatArray, a: float, count: int) -> ComplexArray:
    """Return the Laguerre functions at frequencies, (k, count)."""
    s = 1j * omega[:, None]
    return np.asarray(math.sqrt(2.0 * a) / (s + a) * ((s - a) / (s + a)) ** np.arange(count))


def compressed(
    constant: ComplexArray, slope: ComplexArray, spectra: FloatArray, row: int
) -> tuple[FloatArray, FloatArray]:
    """Return R, r with ||R q + r||^2 the variance of an output; few rows for many nodes."""
    weight = spectra.T  # (k, nw)
    r = (constant[:, row] * weight).ravel()
    R = np.moveaxis(slope[:, row] * weight[:, None], 1, 2).reshape(r.size, -1)
    stacked = np.column_stack([R, r])
    triangle: FloatArray = np.linalg.qr(np.vstack([stacked.real, stacked.imag]))[1]
    return triangle[:, :-1], triangle[:, -1]


def realised(
    plant: LinearPlant, K: FloatArray, L: FloatArray, Aq: FloatArray, Bq: FloatArray, Cq: FloatArray
) -> Controller:
    """Return the observer with Q as one controller."""
    A, B, C, D = plant.A, plant.B, plant.C, plant.D
    seen = C + D @ K
    return Controller(
        A=np.block([[A + B @ K - L @ seen, (B - L @ D) @ Cq], [-Bq @ seen, Aq - Bq @ D @ Cq]]),
        B=np.vstack([L, Bq]),
        C=np.hstack([K, Cq]),
        D=np.zeros((len(plant.inputs), len(plant.measurements))),
        measurements=plant.measurements,
        inputs=plant.inputs,
    )
