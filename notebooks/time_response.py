"""What a linear plant does in time when a signal steps or begins to swing.

The plant is at rest until t = 0; then one or more of its inputs and disturbances follow a `Step`
or a `Sine`.  Such a signal is itself the output of a small linear system, so plant and signals
together are x' = N x, and every sample follows from the one before by exp(N dt): exact at the
samples, whatever their distance.  A closed loop is a plant too (`feedback`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.linalg

from models.basics import check_range, pick, read_only
from models.plant import LinearPlant

__all__ = ["Sine", "Step", "TimeResponse", "time_response"]

FloatArray = npt.NDArray[np.float64]
_OWNER = "time response"


@dataclass(frozen=True, kw_only=True)
class Step:
    """A signal that is `size` from t = 0 on; its rate is an impulse."""

    size: float = 1.0


@dataclass(frozen=True, kw_only=True)
class Sine:
    """A signal amplitude * sin(omega t) from t = 0 on, `omega` in rad/s."""

    amplitude: float = 1.0
    omega: float


@dataclass(frozen=True, kw_only=True, eq=False)
class TimeResponse:
    """Outputs over time.

    Attributes
    ----------
    time
        Times (k,) [s].
    values
        Outputs (nz, k), in the order of `outputs`.
    outputs
        Their names.
    """

    time: FloatArray
    values: FloatArray
    outputs: tuple[str, ...]

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        object.__setattr__(self, "time", read_only(self.time))
        object.__setattr__(self, "values", read_only(self.values))

    def __getitem__(self, output: str) -> FloatArray:
        """Return one output by its name, (k,).

        Raises
        ------
        InputError
            If the name is unknown.
        """
        row: FloatArray = self.values[pick(_OWNER, "output", self.outputs, [output])[0]]
        return row


def time_response(
    plant: LinearPlant, signals: Mapping[str, Step | Sine], *, duration: float, step: float
) -> TimeResponse:
    """Return the plant's performance outputs from rest.

    Parameters
    ----------
    plant
        The plant; delays of its measurements play no part, as nothing listens to them.
    signals
        What inputs and disturbances do, by name; all others stay zero.  A disturbance that is
        the rate of another one follows of itself.
    duration, step
        Length of the response and time between samples [s].

    Returns
    -------
    TimeResponse
        Samples at 0, step, ... up to `duration`.  The one at t = 0 is that just after a step.

    Raises
    ------
    InputError
        If a name is unknown or is that of a rate, or a number is out of range.

    Examples
    --------
    A mass on a spring and a damper, pushed by one newton: it comes to rest at 1/k.

    >>> oscillator = LinearPlant(A=[[0, 1], [-4, -2]], B=[[0], [1]], E=[[0], [0]], C=[[1, 0]],
    ...     Cz=[[1, 0]], inputs=["force"], outputs=["place"])
    >>> run = time_response(oscillator, {"force": Step()}, duration=20.0, step=0.5)
    >>> float(run["place"][-1].round(6))
    0.25
    """
    check_range(_OWNER, "step", step, low=0.0, unit="s", open_low=True)
    check_range(_OWNER, "duration", duration, low=step, unit="s")
    independent = (*plant.inputs, *plant.independent_disturbances)
    pick(_OWNER, "input or disturbance", independent, list(signals))
    into, through = _columns(plant)
    n = plant.A.shape[0]
    size = n + 2 * len(signals)
    system = np.zeros((size, size))
    system[:n, :n] = plant.A
    readout = np.zeros((plant.Cz.shape[0], size))
    readout[:, :n] = plant.Cz
    state = np.zeros(size)
    for k, (name, signal) in enumerate(signals.items()):
        # Two states s, r of each signal: its value, and what its rate is omega times.
        at = n + 2 * k
        value, rate = into[name]
        direct, direct_rate = through[name]
        if isinstance(signal, Step):
            check_range(_OWNER, f"size of the step of {name}", signal.size)
            omega, state[at] = 0.0, signal.size
            # The rate's impulse moves the state at once; one in an output cannot be sampled.
            state[:n] += rate * signal.size
        else:
            check_range(_OWNER, f"amplitude of the sine of {name}", signal.amplitude)
            omega = check_range(
                _OWNER, f"omega of the sine of {name}", signal.omega, low=0.0, unit="rad/s"
            )
            state[at + 1] = signal.amplitude
        system[at, at + 1], system[at + 1, at] = omega, -omega
        system[:n, at], system[:n, at + 1] = value, rate * omega
        readout[:, at], readout[:, at + 1] = direct, direct_rate * omega
    count = math.floor(duration / step + 1e-9) + 1
    transition = scipy.linalg.expm(system * step)
    values = np.empty((readout.shape[0], count))
    for i in range(count):
        values[:, i] = readout @ state
        state = transition @ state
    return TimeResponse(time=step * np.arange(float(count)), values=values, outputs=plant.outputs)


def _columns(
    plant: LinearPlant,
) -> tuple[dict[str, tuple[FloatArray, FloatArray]], dict[str, tuple[FloatArray, FloatArray]]]:
    """Return how each independent signal and its rate act on the states and on the outputs."""
    n, nz = plant.A.shape[0], plant.Cz.shape[0]
    into = {u: (plant.B[:, i], np.zeros(n)) for i, u in enumerate(plant.inputs)}
    through = {u: (plant.Dz[:, i], np.zeros(nz)) for i, u in enumerate(plant.inputs)}
    index = {w: i for i, w in enumerate(plant.disturbances)}
    rate_of = {base: index[rate] for rate, base in plant.rates.items()}
    for w in plant.independent_disturbances:
        i, j = index[w], rate_of.get(w)
        into[w] = plant.E[:, i], np.zeros(n) if j is None else plant.E[:, j]
        through[w] = plant.Fz[:, i], np.zeros(nz) if j is None else plant.Fz[:, j]
    return into, through
