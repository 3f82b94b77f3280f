"""The clairvoyant floor of a comparison, in the form of a controller's run (`prepare`).

    question, Contender, H_s --> prepare --> Prepared (a controller) or Floor --> run(seed) --> Cell

It sees the same motion of the hook as all contenders and is judged over the same time; its plant
is linear, and every command within the drive's limits is open to it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from models.basics import FloatArray, InputError, StillhookError
from models.operation import SpectrumMotion
from models.simulation import EASE, Progress

from ..controllers import Contender, StoredDesign
from .cell import WINDOW, Cell, CommonSea, ComparisonQuestion, Prepared, Trace

_SAMPLE = 0.05  # of the demand, which may bend in any way from one to the next [s]


class Floor:
    """The clairvoyant floor in one sea: no controller, and no nonlinear plant."""

    def __init__(self, question: ComparisonQuestion, contender: Contender, height: float) -> None:
        self._name, self._height, self._question = contender.name, height, question
        self._case = question.true(height)
        self._hook = SpectrumMotion.from_case(self._case).hook

    def run(self, seed: int, progress: Progress | None = None) -> Cell:
        """Return the floor of one seed."""
        del progress
        found, time, payload = self._found(seed)
        counted = payload[time >= self._question.settle - 1e-9]
        quantities = {
            "tracking error rms": float(np.sqrt(np.mean(counted**2))),
            "tracking error largest": float(np.abs(counted).max()),
            "payload rms": float(counted.std()),
            "payload significant": 4.0 * float(counted.std()),
        }
        return Cell(
            contender=self._name,
            height=self._height,
            seed=seed,
            status="completed",
            message=str(getattr(found, "status", "")),
            quantities=quantities,
            worst=float(time[int(np.argmax(np.abs(payload)))]),
        )

    def trace(self, seed: int, moment: float, progress: Progress | None = None) -> Trace:
        """Return the payload's motion around a moment [s]."""
        del progress
        _, time, payload = self._found(seed)
        near = np.abs(time - moment) <= 0.5 * WINDOW
        signals = {"payload.displacement": payload[near]}
        return Trace(contender=self._name, time=time[near], signals=signals)

    def _found(self, seed: int) -> tuple[Any, FloatArray, FloatArray]:
        """Return the answer, its times (n,) [s], and the payload's displacement (n,) [m]."""
        sea = CommonSea(hook=self._hook, lasting=self._question.duration, ease=EASE)
        motion = sea.motion(self._question.duration, _SAMPLE, seed)
        from mpc.floor import clairvoyant

        found = clairvoyant(
            self._case,
            motion,
            sample_time=_SAMPLE,
            settle=self._question.settle,
            masses=self._question.masses,
        )
        time = np.asarray(found.time, dtype=np.float64)
        payload = np.asarray(found.payload, dtype=np.float64)
        return found, time, payload


def prepare(
    question: ComparisonQuestion, contender: Contender, height: float, law: StoredDesign | None
) -> Prepared | Floor:
    """Return a contender in one sea, ready to run.

    Raises
    ------
    InputError
        With the reason, if it cannot take part: no gains, no design, not stable, no such thing.
    """
    try:
        if contender.recipe is None:
            return Floor(question, contender, height)
        return Prepared(question, contender, height, law)
    except StillhookError:
        raise
    except Exception as error:  # a contender of the user's own may fail in any way
        raise InputError(f"{type(error).__name__}: {error}") from error
