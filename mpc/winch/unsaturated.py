r"""The linear loop of a predictive controller away from its limits: poles, margins, rms.

    sensors y --> Kalman filter --> regulator --> u --> drive, winch, rope --> y
                                              (broken here)

Without an active limit the controller is linear: u = C(z) y.  This builds C, closes the loop on
the same or on another plant (a heavier load, a softer rope), and gives its poles, its highest
sensitivity M_s on the frequencies up to half the sample rate, and the rms of the payload in the
modelled sea.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from models.basics import ComplexArray, FloatArray, solve_discrete_lyapunov

from ..programme import LQRegulator
from .prediction import PredictionModel
from .regulation import feedback_row

_NODES = 160
_LOWEST = 1e-3  # [rad/s]


@dataclass(frozen=True, kw_only=True, eq=False)
class Unsaturated:
    """Filter and regulator as one linear controller."""

    model: PredictionModel
    regulator: LQRegulator

    @cached_property
    def _feedback(self) -> FloatArray:
        """Row F of d = -F chi, (n,)."""
        return feedback_row(self.regulator, self.model)

    @cached_property
    def _kept(self) -> FloatArray:
        """I - L C: what of the prediction is left in the estimate, (n, n)."""
        return np.asarray(np.eye(self.model.size) - self.model.gain @ self.model.C)

    @cached_property
    def controller(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return (A, B, C, D) of u = C(z) y, with x the one-step prediction."""
        return self._throttled(1.0)

    def _throttled(self, share: float) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return that of a drive which gives a share of the torque asked for, and says so."""
        model, winch = self.model, self.model.winch
        row, kept = share * self._feedback, self._kept
        ahead = model.A - model.B @ row[None, :]
        command = -row / winch.gain
        command[: winch.size] += winch.back * winch.reckoned
        gain = model.gain
        return ahead @ kept, ahead @ gain, (command @ kept)[None, :], command[None] @ gain

    def poles(self, plant: PredictionModel | None = None, *, share: float = 1.0) -> ComplexArray:
        """Return the poles of the closed loop on a plant, by default that of the model.

        The drive gives a share of the torque that is asked for, below one where it saturates (the
        gain of its describing function; A. Gelb and W. E. Vander Velde, *Multiple-Input Describing
        Functions and Nonlinear System Design*, 1968, sec. 2.3).  The filter is told.
        """
        A, B, C = _plant(self.model if plant is None else plant)
        Ac, Bc, Cc, Dc = self.controller if share == 1.0 else self._throttled(share)
        top = np.hstack([A + B @ Dc @ C, B @ Cc])
        closed = np.vstack([top, np.hstack([Bc @ C, Ac])])
        return np.asarray(np.linalg.eigvals(closed), dtype=np.complex128)

    def growth(self, plant: PredictionModel | None = None, *, share: float = 1.0) -> float:
        """Return the largest modulus of the poles, below one where the loop is stable."""
        return float(np.abs(self.poles(plant, share=share)).max())

    def sensitivity(self, omega: FloatArray, plant: PredictionModel | None = None) -> ComplexArray:
        """Return S = 1/(1 + L), the loop broken at the torque, below half the sample rate, (k,).

        The drive's back-EMF, or its speed regulator, is part of the plant's own behaviour, which
        the controller compensates.  The plant is by default that of the model.
        """
        true = self.model if plant is None else plant
        z = np.exp(1j * np.asarray(omega, dtype=np.float64) * self.model.winch.sample_time)
        # The model's own input: what the back-EMF takes away is part of its A.
        kept = _reached(true)
        A, B, C = true.A[np.ix_(kept, kept)], true.B[kept], true.C[:, kept]
        Ac, Bc, _, _ = self.controller
        row = -self._feedback
        Cc, Dc = (row @ self._kept)[None, :], (row @ self.model.gain)[None, :]
        through = C @ np.linalg.solve(_pencil(A, z), np.broadcast_to(B, (z.size, *B.shape)))
        back = Cc @ np.linalg.solve(_pencil(Ac, z), np.broadcast_to(Bc, (z.size, *Bc.shape))) + Dc
        return np.asarray(1.0 / (1.0 - (back @ through)[:, 0, 0]))

    def max_sensitivity(self) -> float:
        """Return M_s = max |S|, broken at the torque; infinite if the loop is not stable."""
        if self.growth() >= 1.0:
            return np.inf
        nyquist = np.pi / self.model.winch.sample_time
        omega = np.geomspace(_LOWEST, nyquist, _NODES)
        return float(np.abs(self.sensitivity(omega)).max())

    def forecast_error(self, ahead: float) -> float:
        """Return the standard deviation of the hook's forecast, `ahead` [s] from now [m]."""
        model, at = self.model, self.model.sea_at
        P = model.sea_covariance
        over, added = model.A[at, at], (model.G @ model.G.T)[at, at]
        for _ in range(round(ahead / model.winch.sample_time)):
            P = over @ P @ over.T + added
        row = model.hook[0, at]
        return math.sqrt(max(float(row @ P @ row), 0.0))

    def rms_under(self, truth: PredictionModel) -> tuple[float, float]:
        """Return the rms of payload [m] and input d [N m] with the noises of another model.

        It is one of the same winch; both are infinite if the loop is not stable.
        """
        Ac, Bc, Cc, Dc = self.controller
        A, B, C = truth.A, truth.B, truth.C
        winch = truth.winch
        # The true input d follows from the command and the true speed.
        to_input = np.zeros(truth.size)
        to_input[: winch.size] = -winch.back * winch.gain * winch.reckoned
        into = B * winch.gain
        own = A + B @ to_input[None, :]
        closed = np.block([[own + into @ Dc @ C, into @ Cc], [Bc @ C, Ac]])
        n, m = truth.size, len(Ac)
        noise = np.zeros((n + m, truth.G.shape[1] + len(truth.R)))
        noise[:n, : truth.G.shape[1]] = truth.G
        root = np.diag(np.sqrt(truth.R))
        noise[:n, truth.G.shape[1] :] = into @ Dc @ root
        noise[n:, truth.G.shape[1] :] = Bc @ root
        at = truth.constants_at
        noise[at] = 0.0  # constants stay where they are
        closed[at, at] = 0.0
        covariance = solve_discrete_lyapunov(closed, noise @ noise.T)
        if covariance is None:
            return np.inf, np.inf
        row = np.zeros(n + m)
        row[: winch.size] = winch.payload
        asked = np.concatenate([to_input, np.zeros(m)])
        asked += winch.gain * np.concatenate([(Dc @ C)[0], Cc[0]])
        payload, torque = (float(r @ covariance @ r) for r in (row, asked))
        return math.sqrt(max(payload, 0.0)), math.sqrt(max(torque, 0.0))


def _plant(model: PredictionModel) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (A, B, C) from command to measurements: the winch and what is on its way."""
    winch = model.winch
    A = np.array(model.A)
    A[: winch.size, : winch.size] -= (
        winch.back * winch.gain * np.outer(model.B[: winch.size, 0], winch.reckoned)
    )
    kept = _reached(model)
    return A[np.ix_(kept, kept)], model.B[kept] * winch.gain, model.C[:, kept]


def _reached(model: PredictionModel) -> npt.NDArray[np.int64]:
    """Return the states that the command reaches: not the sea, the errors and the constants."""
    waiting = np.arange(model.constants_at.stop, model.size)
    return np.concatenate([np.arange(model.winch.size), waiting])


def _pencil(A: FloatArray, z: ComplexArray) -> ComplexArray:
    """Return z I - A, (k, n, n)."""
    return np.asarray(z[:, None, None] * np.eye(len(A)) - A)
