r"""The Kalman filter of any linear plant, for signals that come and go: `KalmanFilter`.

    x+ = A x + B (u + c_u) + E (w + c_w) + noise,    y = what is measured, late as it is, + noise

The constants c are unknown inputs and disturbances that drift slowly: the integrators of
offset-free control (K. R. Muske and T. A. Badgwell, "Disturbance modeling for offset-free linear
model predictive control", J. Process Control 12, 2002).  Late measurements are compared with
earlier values that the state remembers; between two samples these are taken as linear.
"""

import math
from collections.abc import Mapping

import numpy as np

from models.basics import FloatArray, InputError, SolverError, check_range, pick
from models.plant import LinearPlant

from .horizon import lasting, sampled
from .kalman import ChangingGains, prediction_covariance
from .regulator import pole_text, unreached

_OWNER = "Kalman filter"
_LOST = 1e12  # times what is usually not known, beyond which it is begun anew


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

    Attributes
    ----------
    state
        Estimate of the plant's state, a deviation from rest, (n,).
    blind
        For how many samples nothing was heard.

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
        ages = [
            (delay - 0.5 * min(hold, T)) / T
            for delay, hold in zip(plant.delays, plant.holds, strict=True)
        ]
        depth = [math.ceil(age - 1e-6) for age in ages]
        first = np.cumsum([self._at.stop, *depth])
        size = int(first[-1])
        self._direct = np.hstack([plant.D, plant.F])
        now = np.zeros((len(ages), size))
        now[:, :n], now[:, self._at] = plant.C, self._direct[:, at]
        self._A, self._C = np.zeros((size, size)), np.zeros_like(now)
        self._A[:n, :n], self._A[:n, self._at] = A, held[:, at]
        self._A[self._at, self._at] = np.eye(len(at))
        # A register of each late measurement: what is there now enters, the others move on.
        self._fresh, self._enters = np.zeros(len(ages)), np.zeros((size, len(ages)))
        for k, (age, own) in enumerate(zip(ages, depth, strict=True)):
            here = int(first[k])
            if own:
                self._A[here], self._enters[here, k] = now[k], 1.0
                self._A[here + 1 : here + own, here : here + own - 1] = np.eye(own - 1)
            whole, share = divmod(max(age, 0.0) + 1e-9, 1.0)
            for back, weight in ((int(whole), 1.0 - share), (int(whole) + 1, share)):
                if back == 0:
                    self._C[k] += weight * now[k]
                    self._fresh[k] = weight
                elif back <= own:
                    self._C[k, here + back - 1] += weight
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
            f"measurements ({', '.join(plant.measurements)}) must tell of": (self._A.T, self._C.T),
            "noise must reach": (self._A, G),
        }.items():
            mode = unreached(matrix, seen)
            if mode is not None:
                raise InputError(
                    f"{_OWNER}: {what} every mode of plant and constants that does not settle by "
                    f"itself; there is one at {pole_text(mode, T)}"
                )
        try:
            P = prediction_covariance(self._A, self._C, G, R, np.ones(size))
            P = prediction_covariance(self._A, self._C, G, R, _sizes(P))
        except SolverError as error:
            raise InputError(f"{_OWNER}: noise and measurements must fit ({error})") from error
        self._P, everything = P, np.ones(len(R), dtype=np.bool_)
        steady = {everything.tobytes(): (G @ G.T, P)}
        self._gains = ChangingGains(self._A, self._C, G @ G.T, R, steady, _sizes(P))
        static = plant.static
        self._rest_y = np.array([static.get(name, 0.0) for name in plant.measurements])
        self._rest_u = np.array([static.get(name, 0.0) for name in plant.inputs])
        self._rest_w = np.array([static.get(name, 0.0) for name in plant.disturbances])
        self.reset()

    def reset(self) -> None:
        """Forget everything: the plant is at rest."""
        self._chi = np.zeros(len(self._A))
        self._shown: tuple[FloatArray, FloatArray] | None = None
        self._gains.begin(self._P)
        self.blind = 0

    @property
    def state(self) -> FloatArray:
        """Estimate of the plant's state, a deviation from rest, (n,)."""
        return self._chi[: self._at.start]

    @property
    def constants(self) -> Mapping[str, float]:
        """Estimates of what is added to inputs and disturbances, by name."""
        return dict(zip(self._names, self._chi[self._at].tolist(), strict=True))

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
        ahead, direct = self._chi, self._direct @ np.concatenate([u, w])
        if self._shown is not None:
            before, path = self._shown
            ahead = self._A @ ahead + self._B @ u + self._enters @ before
            ahead[: self._at.start] += self._from_path @ np.concatenate([path, w])
        self._shown = direct, w
        reading = np.array([measurements.get(name, math.nan) for name in plant.measurements])
        there = np.isfinite(reading)
        error = reading - self._rest_y - self._C @ ahead - self._fresh * direct
        gain = self._gains.at(there)
        self._chi = ahead + gain @ np.where(there, error, 0.0)
        self.blind = 0 if there.any() else self.blind + 1
        # What has not been heard of for so long that nothing is known of it is begun anew.
        if not np.all(np.diag(self._gains.covariance) <= _LOST * _sizes(self._P) ** 2):
            self._gains.begin(self._P)
        return self.state


def _sizes(P: FloatArray) -> FloatArray:
    """Return the standard deviations of a covariance, one where there is none."""
    known = np.sqrt(np.diag(P))
    return np.where(known > 0.0, known, 1.0)


def _vector(
    kind: str, names: tuple[str, ...], given: Mapping[str, float] | None, rest: FloatArray
) -> FloatArray:
    """Return values as deviations from rest, zero where none is given."""
    found = np.zeros(len(names))
    for name, value in (given or {}).items():
        k = pick(_OWNER, kind, names, [name])[0]
        found[k] = check_range(_OWNER, f"{kind} {name}", value) - rest[k]
    return found
