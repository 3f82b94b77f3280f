r"""The Kalman filter of any linear plant, for signals that come and go: `KalmanFilter`.

    x+ = A x + B (u + c_u) + E (w + c_w) + noise,    y = what is measured, late as it is, + noise

The constants c are unknown inputs and disturbances that drift slowly: the integrators of
offset-free control (K. R. Muske and T. A. Badgwell, "Disturbance modeling for offset-free linear
model predictive control", J. Process Control 12, 2002).  Late measurements are compared with
earlier values that the state remembers; between two samples these are taken as linear.
"""

import math
from collections.abc import Iterable, Mapping

import numpy as np

from models.basics import FloatArray, InputError, SolverError, check_range, pick
from models.plant import LinearPlant

from .horizon import lasting, sampled
from .kalman import SampledFilter, prediction_covariance
from .regulator import pole_text, unreached

_OWNER = "Kalman filter"


class KalmanFilter:
    """The filter's state, and what moves it.  Signals are told as they are, not as deviations.

    Parameters
    ----------
    plant
        The plant.
    period
        Sample time T [s].
    noise
        Standard deviations by name: of the error of every measurement, at each sample; of what
        inputs and disturbances have more than is told, held over a sample; of what a sample adds to
        a state.
    constants
        Inputs and disturbances to which something unknown is added that lasts, by how far it
        wanders in a second.

    Raises
    ------
    InputError
        If an argument is out of its range, a name is unknown, a measurement has no noise, or
        measurements and noise leave a mode of the plant to itself that does not settle.
    """

    def __init__(
        self,
        plant: LinearPlant,
        *,
        period: float,
        noise: Mapping[str, float],
        constants: Mapping[str, float] | None = None,
    ) -> None:
        self.plant = plant
        self.period = T = check_range(_OWNER, "period", period, low=0.0, unit="s", open_low=True)
        driven, wander = (*plant.inputs, *plant.disturbances), dict(constants or {})
        pick(_OWNER, "input or disturbance (in constants)", driven, list(wander))
        known = (*plant.measurements, *driven, *plant.states)
        pick(_OWNER, "measurement, input, disturbance or state (in noise)", known, list(noise))
        for name in plant.measurements:
            check_range(_OWNER, f"noise of {name}", noise.get(name), low=0.0, open_low=True)
        for kind, named in (("noise", noise), ("drift", wander)):
            for name, size in named.items():
                check_range(_OWNER, f"{kind} of {name}", size, low=0.0)
        n, nu, nw = len(plant.A), len(plant.inputs), len(plant.disturbances)
        A, B, self._from_path = sampled(plant, T)
        held = np.hstack([B, lasting(self._from_path, np.ones(nw))])
        at = [driven.index(name) for name in wander]
        self._names, self._at = tuple(wander), slice(n, n + len(at))
        late = ages(plant, T)
        depth = np.ceil(late - 1e-6).astype(np.int64)
        first = np.cumsum([self._at.stop, *depth]).tolist()
        size = first.pop()
        self._direct = np.hstack([plant.D, plant.F])
        now = np.zeros((len(late), size))
        now[:, :n], now[:, self._at] = plant.C, self._direct[:, at]
        self._A = np.zeros((size, size))
        self._A[:n, :n], self._A[:n, self._at] = A, held[:, at]
        self._A[self._at, self._at] = np.eye(len(at))
        remember(self._A, now, first, depth)
        rows = [late_row(*one) for one in zip(now, first, depth, late, strict=True)]
        self._C = C = np.array(rows).reshape(now.shape)
        # What acts at once is shown at once, and enters the registers of what is late.
        self._fresh, self._enters = np.clip(1.0 - late, 0.0, 1.0), np.zeros(now.T.shape)
        waits = np.flatnonzero(depth)
        self._enters[np.array(first)[waits], waits] = 1.0
        self._B = np.zeros((size, nu))
        self._B[:n] = B
        sizes = np.array([noise.get(name, 0.0) for name in driven])
        G = np.zeros((size, len(driven) + n + len(at)))
        G[:n, : len(driven)] = held * sizes
        G[:n, len(driven) : len(driven) + n] = np.diag(
            [noise.get(name, 0.0) for name in plant.states]
        )
        G[self._at, len(driven) + n :] = np.diag([wander[k] * math.sqrt(T) for k in wander])
        R = np.array([noise[name] for name in plant.measurements]) ** 2
        for what, (matrix, seen) in {
            f"measurements ({', '.join(plant.measurements)}) must tell of": (self._A.T, C.T),
            "noise must reach": (self._A, G),
        }.items():
            mode = unreached(matrix, seen)
            if mode is not None:
                raise InputError(
                    f"{_OWNER}: {what} every mode of plant and constants that does not settle by "
                    f"itself; there is one at {pole_text(mode, T)}"
                )
        try:
            P = prediction_covariance(self._A, C, G, R, np.ones(size))
        except SolverError as error:
            raise InputError(f"{_OWNER}: noise and measurements must fit ({error})") from error
        self._filter = SampledFilter(self._A, C, G, R, P, {np.ones(len(R), np.bool_).tobytes(): G})
        static = plant.static
        self._rest_y = np.array([static.get(name, 0.0) for name in plant.measurements])
        self._rest_u = np.array([static.get(name, 0.0) for name in plant.inputs])
        self._rest_w = np.array([static.get(name, 0.0) for name in plant.disturbances])
        self.reset()

    def reset(self) -> None:
        """Forget everything: the plant is at rest."""
        self._shown: tuple[FloatArray, FloatArray] | None = None
        self._filter.reset()

    @property
    def state(self) -> FloatArray:
        """Estimate of the plant's state, a deviation from rest, (n,)."""
        return self._filter.state[: self._at.start]

    @property
    def blind(self) -> int:
        """For how many samples nothing was heard."""
        return int(self._filter.unheard.min())

    @property
    def constants(self) -> Mapping[str, float]:
        """Estimates of what is added to inputs and disturbances, by name."""
        return dict(zip(self._names, self._filter.state[self._at].tolist(), strict=True))

    def step(
        self,
        measurements: Mapping[str, float],
        inputs: Mapping[str, float] | None = None,
        disturbances: Mapping[str, float] | None = None,
    ) -> FloatArray:
        """Return the estimate of the state at this sample, (n,).

        Parameters
        ----------
        measurements
            What is shown now; what is absent or not finite was not heard.
        inputs
            What acted over the sample before; by default the inputs at rest.
        disturbances
            What is known of them now; by default at rest.

        Raises
        ------
        InputError
            If a name is unknown, or an input or a disturbance is not finite.
        """
        plant = self.plant
        pick(_OWNER, "measurement", plant.measurements, list(measurements))
        u = _vector("input", plant.inputs, inputs, self._rest_u)
        w = _vector("disturbance", plant.disturbances, disturbances, self._rest_w)
        ahead, direct = self._filter.state, self._direct @ np.concatenate([u, w])
        if self._shown is not None:
            before, path = self._shown
            ahead = self._A @ ahead + self._B @ u + self._enters @ before
            ahead[: self._at.start] += self._from_path @ np.concatenate([path, w])
        self._shown = direct, w
        reading = np.array([measurements.get(name, math.nan) for name in plant.measurements])
        error = reading - self._rest_y - self._C @ ahead - self._fresh * direct
        self._filter.correct(ahead, error, np.isfinite(reading))
        return self.state


def ages(plant: LinearPlant, period: float) -> FloatArray:
    """Return how old measurements usually are, in samples, (ny,); one that is held, in the mean.

    Of a reading that is taken at a sample there is none within that sample: half of it less than
    the mean age of a hold in continuous time.
    """
    return (np.array(plant.delays) - 0.5 * np.minimum(plant.holds, period)) / period


def remember(A: FloatArray, now: FloatArray, first: Iterable[int], depth: Iterable[int]) -> None:
    """Put registers of late signals into A: the present value enters, the others move on.

    Of each signal: the row of the present value, where its register begins and how long it is.
    """
    for row, here, own in zip(now, first, depth, strict=True):
        if own:
            A[here] = row
            A[here + 1 : here + own, here : here + own - 1] = np.eye(own - 1)


def late_row(now: FloatArray, first: int, depth: int, samples: float) -> FloatArray:
    """Return the row of a signal that is so many samples late, (n,): linear in between.

    Its present row (n,), where its register begins and how long it is, the oldest that there is.
    """
    samples = min(max(samples, 0.0), float(depth))
    whole = math.floor(samples + 1e-6)
    share = max(samples - whole, 0.0)
    row = np.zeros(len(now))
    for back, weight in ((whole, 1.0 - share), (whole + 1, share)):
        if weight > 1e-9 and back == 0:
            row += weight * now
        elif weight > 1e-9:
            row[first + back - 1] += weight
    return row


def _vector(
    kind: str, names: tuple[str, ...], given: Mapping[str, float] | None, rest: FloatArray
) -> FloatArray:
    """Return values as deviations from rest, zero where none is given."""
    found = np.zeros(len(names))
    for name, value in (given or {}).items():
        k = pick(_OWNER, kind, names, [name])[0]
        found[k] = check_range(_OWNER, f"{kind} {name}", value) - rest[k]
    return found
