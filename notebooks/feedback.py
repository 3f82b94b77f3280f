r"""A plant with a feedback closed around it: a plant again.

::

    command r --->(+)---> u ---> plant ---> y ---+---> z
                   ^                             |
                   +------ C, any linear system <+

With it a closed loop can be looked at by everything that looks at a plant: its poles, its
responses over frequency, and those in time (`time_response`).  Which feedback it is, is
not this room's business.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np
import numpy.typing as npt

from models.basics import InputError, pick
from models.plant import LinearPlant

__all__ = ["Feedback", "with_feedback"]

FloatArray = npt.NDArray[np.float64]


class Feedback(Protocol):
    """A linear system x' = A x + B y, u = C x + D y, y and u by name; A may be (0, 0)."""

    @property
    def A(self) -> FloatArray:
        """State matrix, (n, n)."""
        ...

    @property
    def B(self) -> FloatArray:
        """From the measurements, (n, ny)."""
        ...

    @property
    def C(self) -> FloatArray:
        """To the inputs, (nu, n)."""
        ...

    @property
    def D(self) -> FloatArray:
        """From the measurements to the inputs, (nu, ny)."""
        ...

    @property
    def measurements(self) -> tuple[str, ...]:
        """Names of what it hears."""
        ...

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of what it commands."""
        ...


def with_feedback(plant: LinearPlant, feedback: Feedback, *, pade_order: int = 6) -> LinearPlant:
    """Return the closed loop of a plant and a feedback u = r + C(s) y.

    Its inputs are the commands r that are added to the feedback's; disturbances, measurements
    and outputs are the plant's.

    Parameters
    ----------
    plant
        The plant.
    feedback
        What is closed around it; it may hear and command some of the plant's signals only.
    pade_order
        Order of the Pade models that take the place of measurement delays, as a closed loop with
        exact delays has no finite state.

    Raises
    ------
    InputError
        If a signal is unknown, or the loop has no solution at infinite frequency.
    """
    open_loop = plant.without_delays(pade_order, at="measurements")
    heard = pick("feedback", "measurement", plant.measurements, feedback.measurements)
    driven = pick("feedback", "input", plant.inputs, feedback.inputs)
    n, nk = open_loop.A.shape[0], feedback.A.shape[0]
    # The feedback on all the plant's signals: u = r + Ck xk + Dk y, xk' = Ak xk + Bk y.
    Ck = np.zeros((len(plant.inputs), nk))
    Dk = np.zeros((len(plant.inputs), len(plant.measurements)))
    Bk = np.zeros((nk, len(plant.measurements)))
    Ck[driven] = feedback.C
    Dk[np.ix_(driven, heard)] = feedback.D
    Bk[:, heard] = feedback.B
    difference = np.eye(len(plant.inputs)) - Dk @ open_loop.D
    if abs(np.linalg.det(difference)) < 1e-12:
        raise InputError("feedback: the loop is not well posed, I - C D of plant and feedback is 0")
    M = np.linalg.inv(difference)
    # u = M r + [M Dk C, M Ck] (x, xk) + M Dk F w; A B E, C D F and Cz Dz Fz all follow from it.
    of_x = np.hstack([M @ Dk @ open_loop.C, M @ Ck])
    of_w = M @ Dk @ open_loop.F

    def closed(
        rows: FloatArray, direct: FloatArray, noise: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        wide = np.hstack([rows, np.zeros((rows.shape[0], nk))])
        return wide + direct @ of_x, direct @ M, noise + direct @ of_w

    A, B, E = closed(open_loop.A, open_loop.B, open_loop.E)
    C, D, F = closed(open_loop.C, open_loop.D, open_loop.F)
    Cz, Dz, Fz = closed(open_loop.Cz, open_loop.Dz, open_loop.Fz)
    own = np.hstack([np.zeros((nk, n)), feedback.A])
    return replace(
        open_loop,
        A=np.vstack([A, own + Bk @ C]),
        B=np.vstack([B, Bk @ D]),
        E=np.vstack([E, Bk @ F]),
        C=C,
        D=D,
        F=F,
        Cz=Cz,
        Dz=Dz,
        Fz=Fz,
        states=(*open_loop.states, *(f"feedback.x{i + 1}" for i in range(nk))),
    )
