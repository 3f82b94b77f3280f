"""The problem of a whole record, `RecordProblem`, and its solution, `RecordSolution`.

    RecordPlant, hook record --> RecordProblem --> `mpc.floor.qp` --> RecordSolution

Motions are deviations from the one that holds the payload still, in which zero is the answer
wherever no limit binds.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from models.basics import FloatArray

from .plant import RecordPlant

RHO = 1e-8  # of inputs in peak torques [m2]
RHO_START = 1e-6  # of the first state: its fast rope modes do next to nothing


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordProblem:
    """A plant, a record of the hook, and what counts."""

    plant: RecordPlant  #: The sampled plant.
    #: The hook's motion at the samples, (N+1,) [m, m/s, m/s2].
    heave: FloatArray
    rate: FloatArray
    acceleration: FloatArray
    first: int  #: First sample whose payload displacement counts.
    minimum_tension: float  #: What tensions must not fall below [N]; -inf for no such limit.
    #: State at the first sample, (n,); None: free, which no controller can beat.
    start: FloatArray | None

    @cached_property
    def _held(self) -> tuple[FloatArray, FloatArray]:
        return self.plant.still(self.heave, self.rate, self.acceleration)

    @property
    def still(self) -> FloatArray:
        """States that hold the payload still, as well as one can, (N+1, n)."""
        return self._held[0]

    @property
    def still_inputs(self) -> FloatArray:
        """Their inputs, (N, m)."""
        return self._held[1]

    @cached_property
    def residue(self) -> FloatArray:
        """What they miss of the plant's motion over each sample, (N, n)."""
        x, inputs = self._held
        r = x[:-1] @ self.plant.Phi.T + inputs @ self.plant.Gamma.T - x[1:]
        return np.asarray(r + self.plant.hook_terms(self.heave, self.rate))

    @property
    def samples(self) -> int:
        """Number of samples N over which an input acts."""
        return len(self.heave) - 1

    @property
    def counted(self) -> int:
        """Number of samples whose payload displacement counts."""
        return self.samples + 1 - self.first

    def still_tensions(self) -> FloatArray:
        """Return the tensions of the still payload, (N, nt) [N]."""
        p, N = self.plant, self.samples
        hook = np.stack([self.heave[:N], self.rate[:N]], axis=1)
        moved = self.still[:N] @ p.tensions.T + hook @ p.tension_feed.T
        return np.asarray(p.static_tensions + moved)


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordSolution:
    """A solver's answer, by samples."""

    #: y[0], (n,), and e, (N, m).
    start: FloatArray
    inputs: FloatArray
    #: Multiplier of the upper less that of the lower side of each window row, (N, 2, nwin).
    window_prices: FloatArray
    tension_prices: FloatArray  #: Multipliers of the tension rows, (N, nt).
    iterations: int  #: The solver's.
