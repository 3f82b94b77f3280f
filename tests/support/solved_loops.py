"""Closed loops by one linear solve a node: no Schur form, modes or residues lose digits of them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from models.basics import Quadrature
from synth.loop import Assessment


def solved_variance(view: Assessment, output: str, nodes: Quadrature) -> float:
    """Variance of an output of a loop with one command, from its state space.

    `view.spectrum` loses ten digits of a torque that is a small difference, as extended precision
    shows.
    """
    p, s = view.plant, 1j * nodes.omega
    z = p.outputs.index(output)
    law = view.controller.response_at(s)[:, 0]

    def columns(state: npt.NDArray[np.float64], *, of: str) -> npt.NDArray[np.complex128]:
        """One column of E, F or Fz at every node, that of its rate with it."""
        found = np.outer(np.ones_like(s), state[:, p.disturbances.index(of)])
        for rate, base in p.rates.items():
            if base == of:
                found = found + np.outer(s, state[:, p.disturbances.index(rate)])
        return found

    total = 0.0
    late = np.exp(-s[:, None] * np.array(p.delays))
    for d in view.disturbances:
        shaken = columns(p.E, of=d.name)
        matrix = s[:, None, None] * np.eye(len(p.A)) - p.A
        right = np.stack([shaken, np.broadcast_to(p.B[:, 0], shaken.shape)], axis=2)
        x = np.linalg.solve(matrix, right.astype(np.complex128))
        direct = np.stack([columns(p.F, of=d.name), np.outer(np.ones_like(s), p.D[:, 0])], axis=2)
        heard = (p.C @ x + direct) * late[:, :, None]
        feedback = np.einsum("kj,kjc->kc", law, heard)
        command = feedback[:, 0] / (1.0 - feedback[:, 1])
        seen = p.Cz[z] @ x
        through = columns(p.Fz[z : z + 1], of=d.name)[:, 0]
        motion = seen[:, 0] + through + (seen[:, 1] + p.Dz[z, 0]) * command
        total += float(nodes.integrate(np.abs(motion) ** 2 * d.density(nodes.omega)))
    return total
