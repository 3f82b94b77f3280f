"""A linear controller in state space, and the closed loop that it makes with a plant.

What `synth.design.tuning` hands over and what every check of a design starts from: plain matrices
with the names of the signals that they connect.  The sign convention is u = +C(s) y, so the
loop gain broken at the plant's input is L = -C P_yu.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np
import numpy.typing as npt

from models.basics import ComplexArray, FloatArray, InputError, check_finite, read_only
from models.plant import LinearPlant, Resolvent, Transfer

if TYPE_CHECKING:
    import control


class StateSpace(Protocol):
    """Whatever has the matrices of x' = A x + B u, y = C x + D u: a plant, or a controller."""

    @property
    def A(self) -> FloatArray:
        """From states to their rates, (n, n)."""

    @property
    def B(self) -> FloatArray:
        """From inputs to the rates of states, (n, nu)."""

    @property
    def C(self) -> FloatArray:
        """From states to measurements, (ny, n)."""

    @property
    def D(self) -> FloatArray:
        """From inputs to measurements, (ny, nu)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LinearController:
    """A controller x' = A x + B y, u = C x + D y.

    Raises InputError if the shapes disagree or a number is not finite.
    """

    #: Matrices, (n, n), (n, ny), (nu, n), (nu, ny); n may be 0.
    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray
    #: Names of y (what the controller hears) and u (what it commands).
    measurements: tuple[str, ...]
    inputs: tuple[str, ...]

    def __post_init__(self) -> None:
        ny, nu = len(self.measurements), len(self.inputs)
        n = np.asarray(self.A).shape[0]
        for name, shape in (("A", (n, n)), ("B", (n, ny)), ("C", (nu, n)), ("D", (nu, ny))):
            matrix = check_finite("controller", name, getattr(self, name))
            if matrix.shape != shape:
                raise InputError(f"controller: {name} must have shape {shape}, got {matrix.shape}")
            object.__setattr__(self, name, read_only(matrix))

    @staticmethod
    def static(
        gain: npt.ArrayLike, measurements: Sequence[str], inputs: Sequence[str]
    ) -> LinearController:
        """Return the controller u = gain y, gain of shape (nu, ny)."""
        D = np.asarray(gain, dtype=np.float64)
        nu, ny = D.shape
        return LinearController(
            A=np.zeros((0, 0)),
            B=np.zeros((0, ny)),
            C=np.zeros((nu, 0)),
            D=D,
            measurements=tuple(measurements),
            inputs=tuple(inputs),
        )

    def response_at(self, s: npt.ArrayLike) -> ComplexArray:
        """Return C(s) at points `s` [1/s], (k, nu, ny).

        Raises InputError if a point is a pole of the controller.
        """
        found = self._transfer(np.asarray(s, dtype=np.complex128).reshape(-1))
        if found is None:
            raise InputError("controller: the response is asked for at one of its own poles")
        return found + self.D

    @cached_property
    def _transfer(self) -> Transfer:
        return Resolvent(self.A).between(self.C, self.B)

    def to_control(self) -> control.StateSpace:
        """Return a python-control system from the measurements to the inputs."""
        import control

        return control.ss(
            self.A,
            self.B,
            self.C,
            self.D,
            inputs=[name.replace(".", "_") for name in self.measurements],
            outputs=[name.replace(".", "_") for name in self.inputs],
        )


def closed_loop_plant(plant: LinearPlant, controller: LinearController) -> LinearPlant:
    """Return plant and controller in a loop, as a plant of the same signals.

    Delays of the plant are ignored: replace them first (`LinearPlant.without_delays`).
    """
    plain = plant.without_delays(0)
    return plain.with_feedback(controller.A, controller.B, controller.C, controller.D)


def closed_loop_matrix(plant: StateSpace, controller: StateSpace) -> FloatArray:
    """Return the state matrix of plant and controller in a loop, (n + nk, n + nk).

    Delays of the plant are ignored: replace them first (`LinearPlant.without_delays`).
    """
    inverse = np.linalg.inv(np.eye(plant.D.shape[1]) - controller.D @ plant.D)
    on_plant, on_states = inverse @ controller.D @ plant.C, inverse @ controller.C
    n = len(plant.A)
    found = np.empty((n + len(controller.A),) * 2)  # np.block takes as long as all products
    found[:n, :n] = plant.A + plant.B @ on_plant
    found[:n, n:] = plant.B @ on_states
    found[n:, :n] = controller.B @ (plant.C + plant.D @ on_plant)
    found[n:, n:] = controller.A + controller.B @ plant.D @ on_states
    return found


def closed_loop_poles(plant: LinearPlant, controller: LinearController) -> ComplexArray:
    """Return the poles of the closed loop [1/s]; delays are ignored."""
    return np.asarray(np.linalg.eigvals(closed_loop_matrix(plant, controller)), dtype=np.complex128)
