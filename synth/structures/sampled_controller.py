"""Sampling of a linear controller, and its anti-windup.

`synth.controllers.linear_feedback` is made of these matrices; they know nothing of a case.
"""

import math

import numpy as np
import scipy.linalg

from models.basics import FloatArray, InputError, SynthesisError

from ..loop import LinearController

Matrices = tuple[FloatArray, FloatArray, FloatArray, FloatArray]

_OWNER = "linear feedback"
_SLOWEST = 0.5  # frequencies above which a controller's gains are compared [rad/s]


def sampled(controller: LinearController, sample_time: float) -> Matrices:
    """Return (A, B, C, D) of a controller sampled every `sample_time` T [s].

    By Tustin's rule, s = k (z - 1)/(z + 1) with k = 2/T.  The controller is x' = A x + B y, u = C x
    + D y.

    Raises InputError if k is an eigenvalue of its A.
    """
    A, B, C, D = controller.A, controller.B, controller.C, controller.D
    n = len(A)
    k = 2.0 / sample_time
    if n and np.abs(np.linalg.eigvals(A) - k).min() < 1e-9 * k:
        raise InputError(
            f"{_OWNER}: sample_time must be another one: the controller has "
            f"a pole at {k:.6g} 1/s, which Tustin's rule maps to infinity"
        )
    inverse = np.linalg.inv(np.eye(n) - A / k)
    Bd = sample_time * inverse @ B
    return inverse @ (np.eye(n) + A / k), Bd, C @ inverse, D + 0.5 * C @ Bd


def tracking_gain(matrices: Matrices, sample_time: float) -> FloatArray:
    """Return the gain K_b, (n, 1), of anti-windup by back-calculation.

    x+ = A x + B e + K_b (u_applied - u_asked), u_asked = C x + D e: while the drive has its own
    way A - K_b C rules.  K_b is the gain of a Kalman filter, hence that matrix is stable for
    every controller whose lasting states reach its output.  The noise of each e is one that, on
    its own, moves u by one unit above 0.5 rad/s, and that of the drive's answer is one unit.

    `matrices` are A, B, C, D of the controller with one output, sampled every `sample_time` [s].

    Raises SynthesisError if a state that does not decay is not seen at the output or not reached
    from e.
    """
    A, B, C, D = matrices
    n = len(A)
    omega = np.geomspace(min(_SLOWEST, 0.5 * math.pi / sample_time), math.pi / sample_time, 60)
    z = np.exp(1j * omega * sample_time)
    try:
        inside = z[:, None, None] * np.eye(n) - A
        inner = np.linalg.solve(inside, np.broadcast_to(B, (z.size, *B.shape)))
        size = np.abs(C @ inner + D).max(axis=(0, 1))
        noise = B / np.where(size > 0.0, size, 1.0)
        P = scipy.linalg.solve_discrete_are(A.T, C.T, noise @ noise.T, np.eye(1))
        gain = A @ P @ C.T / (1.0 + C @ P @ C.T)
        if not float(np.abs(np.linalg.eigvals(A - gain @ C)).max()) < 1.0:
            raise np.linalg.LinAlgError("the gain does not stabilise")
    except (np.linalg.LinAlgError, ValueError) as error:
        raise SynthesisError(
            f"{_OWNER}: no anti-windup holds this controller: a state that does not decay is not "
            "seen at its output or not reached by what it hears; leave such states out, or set "
            "anti_windup to False"
        ) from error
    return np.asarray(gain, dtype=np.float64)
