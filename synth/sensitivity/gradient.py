r"""Gradients of a closed loop's figures in all that they are made of, by the adjoint method.

A closed-loop response F = z/w at s = i omega, u = kappa y with kappa = C(s) e^{-s tau}, moves with
the plant's matrices and the controller as

.. math::

    \delta F = \lambda_x (\delta A\, x + \delta B\, u + \delta E)
             + \lambda_y (\delta C\, x + \delta D\, u + \delta F_w)
             + \delta C_z\, x + \delta D_z\, u + \delta F_z
             + \lambda_u\, \delta C(s)\, e^{-s\tau} y
             - \sum_j \lambda_{y,j}\, s\, \delta\tau_j\, y_j

where x, u, y answer a unit disturbance, and lambda_x, lambda_y, lambda_u are the output's answers
to a unit push at the state equation, the measurements and the command.  One forward and one
adjoint solution at each node so give the slopes of a variance, the integral of |F|^2 S, in every
entry of every matrix at once: reverse-mode differentiation, written out.  The same holds for
1 + L at the frequency of the sensitivity's peak, where the peak's own motion counts for nothing
(the envelope theorem).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.basics import ComplexArray, FloatArray
from models.plant import LinearPlant

from ..loop import Disturbance, LinearController
from .slopes import BLOCKS, MatrixSlope


@dataclass(frozen=True, kw_only=True, eq=False)
class Gradient:
    """Slopes of the logarithm of one figure.

    Attributes
    ----------
    value
        The figure: a standard deviation, or M_s.
    blocks
        Slopes of its logarithm in the entries of the plant's matrices, each in its shape.
    delays
        Slopes in the delays, (ny,) [1/s].
    s, law
        Points (k,) and slopes in the controller's response at them, (k, nu, ny), complex: the
        logarithm moves by Re sum(law * delta C).
    omega, densities
        Nodes (k,), and by disturbance what the logarithm moves by for a change of its density
        at each: sum(densities * delta S).
    """

    value: float
    blocks: dict[str, FloatArray]
    delays: FloatArray
    s: ComplexArray
    law: ComplexArray
    omega: FloatArray
    densities: dict[str, FloatArray]

    def along(self, slope: MatrixSlope) -> float:
        """Return the slope of the logarithm along a motion of the plant's matrices."""
        total = sum(float(np.vdot(self.blocks[name], slope.blocks[name])) for name in BLOCKS)
        return total + float(self.delays @ slope.delays)

    def along_law(self, slope: ComplexArray) -> float:
        """Return the slope of the logarithm along a motion of C(s), (k, nu, ny)."""
        return float(np.sum(self.law * slope).real)

    def along_densities(self, slopes: dict[str, FloatArray]) -> float:
        """Return the slope of the logarithm along a motion of the densities at `omega`."""
        known = {name: slope for name, slope in slopes.items() if name in self.densities}
        return sum(float(self.densities[name] @ slope) for name, slope in known.items())


class _Loop:
    """Closed-loop vectors at points s, (k, ...)."""

    def __init__(self, plant: LinearPlant, controller: LinearController, s: ComplexArray) -> None:
        n = len(plant.states)
        self.plant, self.s = plant, s
        self.pencil = s[:, None, None] * np.eye(n) - plant.A
        self.late = np.exp(-s[:, None] * np.array(plant.delays))
        self.kappa = controller.response_at(s)[:, 0, :] * self.late  # (k, ny), one command
        self.RB = np.linalg.solve(
            self.pencil, np.broadcast_to(plant.B.astype(complex), (s.size, *plant.B.shape))
        )[:, :, 0]
        self.heard = self.RB @ plant.C.T + plant.D[:, 0]  # answer of y to u
        self.difference = 1.0 - (self.kappa * self.heard).sum(axis=1)  # 1 + L

    def disturbed(self, name: str) -> tuple[ComplexArray, ComplexArray, ComplexArray, list[int]]:
        """Return x, u, y and the columns of the disturbance (itself, then its rate)."""
        plant, s = self.plant, self.s
        columns = [plant.disturbances.index(name)]
        columns += [plant.disturbances.index(r) for r, of in plant.rates.items() if of == name]
        powers = np.stack([np.ones_like(s), s][: len(columns)], axis=1)
        into_x, into_y = powers @ plant.E[:, columns].T, powers @ plant.F[:, columns].T
        x = np.linalg.solve(self.pencil, into_x[:, :, None])[:, :, 0]
        y = x @ plant.C.T + into_y
        u = (self.kappa * y).sum(axis=1) / self.difference
        return x + self.RB * u[:, None], u, y + self.heard * u[:, None], columns

    def adjoint(self, row: int) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Return the answers of an output to pushes at x', y and u."""
        plant = self.plant
        to_u = (self.RB @ plant.Cz[row] + plant.Dz[row, 0]) / self.difference
        to_y = to_u[:, None] * self.kappa
        rows = plant.Cz[row] + to_y @ plant.C
        to_x = np.linalg.solve(self.pencil.transpose(0, 2, 1), rows[:, :, None])[:, :, 0]
        return np.asarray(to_x, dtype=np.complex128), to_y, to_u


def variance_gradient(
    plant: LinearPlant,
    controller: LinearController,
    disturbances: Sequence[Disturbance],
    output: str,
    omega: FloatArray,
    weights: FloatArray,
) -> Gradient:
    """Return the gradient of the logarithm of an output's standard deviation.

    Parameters
    ----------
    plant, controller, disturbances
        The closed loop, of one command, and what shakes it.
    output
        Name of the output.
    omega, weights
        Quadrature nodes and weights, (k,) [rad/s].
    """
    s = np.asarray(1j * omega, dtype=np.complex128)
    loop = _Loop(plant, controller, s)
    row = plant.outputs.index(output)
    # One adjoint solution serves all disturbances; each brings a forward solution of its own, and
    # the slope in every entry of a matrix is a product of the two sides.
    to_x, to_y, to_u = loop.adjoint(row)
    blocks = {name: np.zeros(getattr(plant, name).shape) for name in BLOCKS}
    delays = np.zeros(len(plant.delays))
    law = np.zeros((s.size, 1, len(plant.measurements)), dtype=np.complex128)
    total, densities = 0.0, {}
    for source in disturbances:
        x, u, y, columns = loop.disturbed(source.name)
        powers = np.stack([np.ones_like(s), s][: len(columns)], axis=1)
        F = x @ plant.Cz[row] + plant.Dz[row, 0] * u + powers @ plant.Fz[row, columns]
        density = source.density(omega)
        total += float(weights @ (np.abs(F) ** 2 * density))
        densities[source.name] = weights * np.abs(F) ** 2
        g = 2.0 * weights * density * F.conj()
        _gather(blocks, loop, g, (to_x, to_y), (x, u, powers, columns), row)
        delays += np.real(-(g * s)[:, None] * to_y * y).sum(axis=0)
        law[:, 0, :] += (g * to_u)[:, None] * loop.late * y
    # d ln sigma = dm0 / (2 m0)
    half = 0.5 / total
    return Gradient(
        value=float(np.sqrt(total)),
        blocks={name: half * block for name, block in blocks.items()},
        delays=half * delays,
        s=s,
        law=half * law,
        omega=omega,
        densities={name: half * values for name, values in densities.items()},
    )


def sensitivity_gradient(
    plant: LinearPlant, controller: LinearController, omega: float
) -> Gradient:
    """Return the gradient of ln M_s, the sensitivity having its peak at `omega` [rad/s]."""
    s = np.array([1j * omega], dtype=np.complex128)
    loop = _Loop(plant, controller, s)
    # 1 + L = 1 - kappa (C R B + D): x = R B answers u = 1, lambda_x = kappa C R.
    rows = loop.kappa @ plant.C
    to_x = np.linalg.solve(loop.pencil.transpose(0, 2, 1), rows[:, :, None])[:, :, 0]
    blocks = {name: np.zeros(getattr(plant, name).shape) for name in BLOCKS}
    g = 1.0 / loop.difference  # ln M_s = -ln |1 + L|, and L = -kappa P
    for name, left, right in (
        ("A", to_x, loop.RB),
        ("B", to_x, np.ones((1, 1))),
        ("C", loop.kappa, loop.RB),
        ("D", loop.kappa, np.ones((1, 1))),
    ):
        blocks[name] = np.real(np.einsum("k,ki,kj->ij", g, left, right))
    return Gradient(
        value=float(1.0 / np.abs(loop.difference[0])),
        blocks=blocks,
        delays=np.real(-(g * s)[:, None] * loop.kappa * loop.heard).sum(axis=0),
        s=s,
        law=(g[:, None] * loop.late * loop.heard)[:, None, :],
        omega=np.array([omega]),
        densities={},
    )


def _gather(
    blocks: dict[str, FloatArray],
    loop: _Loop,
    g: ComplexArray,
    adjoint: tuple[ComplexArray, ComplexArray],
    forward: tuple[ComplexArray, ComplexArray, ComplexArray, list[int]],
    row: int,
) -> None:
    """Add what one disturbance contributes to the slopes in every matrix."""
    to_x, to_y = (g[:, None] * side for side in adjoint)
    x, u, powers, columns = forward
    command = u[:, None]
    blocks["A"] += np.real(to_x.T @ x)
    blocks["B"] += np.real(to_x.T @ command)
    blocks["E"][:, columns] += np.real(to_x.T @ powers)
    blocks["C"] += np.real(to_y.T @ x)
    blocks["D"] += np.real(to_y.T @ command)
    blocks["F"][:, columns] += np.real(to_y.T @ powers)
    blocks["Cz"][row] += np.real(g @ x)
    blocks["Dz"][row] += np.real(g @ command)
    blocks["Fz"][row, columns] += np.real(g @ powers)
