"""The motion reference unit: the hook's heave through a high-pass, with an error and a delay.

Nothing that the winch does comes back to the hook, so what the unit shows is computed before the
run, a chunk after the other, from the true motion of the hook:

    heave Z --> (1 + e) --> high-pass --> delay --> + error --> reported heave and heave rate

The high-pass takes the drift out of an integrated acceleration and puts a phase lead into slow
heave.  Makers state what is left as a gain error dg and a phase error dphi, a slow drift and white
noise.  Gain and phase error are coherent: the unit hears (1 + e) Z with e = +-dg +- i dphi, of
signs that nobody knows but that stay as they are.  With F0 + e F1 from heave to any signal, the
mean over both signs of both is |F0|^2 + (dg^2 + dphi^2) |F1|^2: for moments the coherent error is
one more disturbance, of density (dg^2 + dphi^2) S_Z (`error_density`); one pair of signs adds
2 Re(F0* e F1) S_Z (`coherent_error`), and limits are held with the worst.  "5 cm or 5 %, whichever
is greater" may instead be read as one noise in the band of the waves, the drift's law with its own
bandwidth.

Its low-passes, of the second order after Butterworth, are one complex number each.  The filter
q'' + sqrt(2) w q' + w^2 q = input has the poles w (-1 +- i)/sqrt(2).  Its two real states are the
real and imaginary part of one mode, m = q' - conj(pole) q, which obeys m' = pole m + input.  A long
series then needs one recursion of the first order, which runs at the speed of compiled code, and
can be cut anywhere.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from ..basics import ComplexArray, FloatArray, ReadOnlyArrays, read_only
from ..plant import hermite_hold, noisy_hold
from ..rig import MRU
from .draws import MRU_DRIFT, MRU_ERROR, MRU_NOISE, MRU_SIGNS, draw
from .telemetry import Interval, Size, during

PERFECT = MRU(noise_floor=0.0, noise_fraction=0.0)
"""A unit that shows the hook's motion as it is: that of a case which says nothing of one."""

Bias = tuple[float, float, float, float]

BIAS: tuple[Size, ...] = (("heave", -100.0, 100.0, "m"), ("heave rate", -100.0, 100.0, "m/s"))
"""What stands behind start and end of an interval in which the unit shows too much."""

Read = Callable[[int, int], tuple[FloatArray, FloatArray]]

_HILBERT = 60.0  # reach of the kernel that turns the phase, either way [s]


@dataclass(frozen=True, kw_only=True, eq=False)
class MruBlock(ReadOnlyArrays):
    """What the unit shows in a stretch of samples, (n,): heave [m] and heave rate [m/s].

    They are held where `valid`, else 1, is 0; `age` is how old they are [s].
    """

    heave: FloatArray
    heave_rate: FloatArray
    valid: FloatArray
    age: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class MruState:
    """What one chunk hands to the next; `MruModel.initial` makes the first."""

    sample: int  #: Number of the next sample.
    last: FloatArray  #: Displacement and velocity at the sample before [m], [m/s], (2,).
    #: Modes of the high-pass and of the errors, complex.
    filter: complex
    errors: tuple[complex, ...]
    #: Earlier heave and heave rate, oldest first, that are still on their way (lag, 2).
    past: FloatArray
    held: FloatArray  #: Heave and heave rate shown last (2,).
    silent: int = 0  #: For how many samples they have been held.


@dataclass(frozen=True, kw_only=True)
class ErrorProcess:
    """One error of the heave: white noise behind a second-order Butterworth low-pass.

    Notes
    -----
    What a unit shows as the error of its rate is the derivative of the error of the heave, but
    white noise reaches so far that samples of its derivative would fold: there it is the mean
    over a sample, the difference of the heave's errors.
    """

    rms: float  #: Standard deviation [m].
    corner: float  #: Corner frequency of the low-pass [rad/s].
    purpose: int  #: Its table of draws.

    @property
    def white(self) -> bool:
        """Whether it reaches far beyond the waves."""
        return self.purpose == MRU_NOISE

    def start(self, seed: int) -> complex:
        """Return the mode at sample 0."""
        # The first row of the table of draws begins the process; the others drive it.
        n, rate = draw(seed, self.purpose, 0, 1, 2)[0] * self.rms
        return complex(to_mode(n, self.corner * rate, low_pass_pole(self.corner)))

    def block(
        self, mode: complex, seed: int, step: float, start: int, n: int
    ) -> tuple[FloatArray, complex]:
        """Return the errors of heave and rate at n samples (n, 2), and the mode at the last.

        The mode given is that at the sample before, or at sample 0; samples are `step` apart [s].
        """
        pole = low_pass_pole(self.corner)
        _, added = low_pass_noise(self.corner, step)
        root = self.rms * np.linalg.cholesky(added)
        # Sample 0 is the beginning itself, so that row k of the draws drives sample k.
        first = max(start, 1)
        pushes = draw(seed, self.purpose, first, start + n - first, 2) @ root.T
        drive = to_mode(pushes[:, 0], pushes[:, 1], pole)
        modes = mode_recursion(complex(np.exp(pole * step)), mode, drive)
        value, rate = from_mode(modes, pole)
        if self.white:
            rate[1:] = np.diff(value) / step
        errors = np.column_stack((value, rate))
        return errors if start == 0 else errors[1:], complex(modes[-1])


@dataclass(frozen=True, eq=False)
class MruModel:
    """A motion reference unit; sample k is at k `sample_time`.

    Notes
    -----
    High-pass: second-order Butterworth, s^2/(s^2 + sqrt(2) w s + w^2) with w = 2 pi over the
    filter period, on displacement and velocity; exact for a motion that is the cubic between
    samples with the given displacements and velocities (Hermite), so that the reported rate is
    the derivative of the reported heave.

    Error: stationary Gaussian processes, white noise behind a second-order Butterworth low-pass,
    whose derivative exists and is the error of the rate; sampled exactly (Van Loan 1978).

    Gain and phase error: the signs are drawn once in a run, each by itself (`signs`).  The heave
    turned by 90 degrees, that of a motion which is known to its end, is its Hilbert transform over
    a minute either way (`heard`).

    Delay: linear interpolation between samples, so that it is exact on average.

    A filter that begins with the run has not seen the waves before it.  With `heave_frequency`
    it begins as if they had been a sine of that frequency that fits the first sample, without
    as if the hook had come out of rest in its mean position.  Either way the rest of the
    transient decays with exp(-w t/sqrt(2)): a hundredth of it is left after about one filter
    period.
    """

    mru: MRU | None  #: Its data; None for a perfect unit, which shows the hook's motion as it is.
    sample_time: float  #: Time between samples [s].
    heave_rms: float  #: Standard deviation of the hook's heave [m], which the relative error is of.
    seed: int  #: Seed of the run.
    #: Intervals (start, end) [s] in which the unit is gone; it shows its last values, not valid.
    outages: Sequence[Interval] = ()
    #: Mean frequency of the hook's heave [rad/s], such as rms velocity over rms displacement; None
    #: if it is not known.
    heave_frequency: float | None = None
    #: (start, end, heave, rate): what it shows too much in an interval [s], [m], [m/s].
    biases: Sequence[Bias] = ()

    @property
    def delay(self) -> float:
        """Delay from the motion to the signal [s]."""
        return self._unit.delay

    @cached_property
    def processes(self) -> tuple[ErrorProcess, ...]:
        """The errors besides those of gain and phase."""
        purposes = MRU_ERROR, MRU_DRIFT, MRU_NOISE
        found = zip(_independent(self._unit, self.heave_rms), purposes, strict=True)
        return tuple(
            ErrorProcess(rms=float(rms), corner=corner, purpose=purpose)
            for (rms, corner), purpose in found
            if rms > 0.0
        )

    @property
    def error_rms(self) -> float:
        """Standard deviation of the error of the heave, but for gain and phase [m]."""
        return math.hypot(*(process.rms for process in self.processes))

    @property
    def coherent(self) -> bool:
        """Whether there is a gain or phase error, so that the unit takes in what is `heard`."""
        return self._unit.coherent > 0.0

    @property
    def signs(self) -> tuple[float, float]:
        """Signs of gain and phase error in this run."""
        gain, phase = draw(self.seed, MRU_SIGNS, 0, 1, 2)[0]
        return math.copysign(1.0, gain), math.copysign(1.0, phase)

    def noise_density(self, omega: npt.ArrayLike) -> FloatArray:
        """Return the one-sided variance density of that error [m2 s/rad].

        That of the heave rate's error is `omega` squared times as large.
        """
        frequency = np.asarray(omega, dtype=np.float64)
        return error_density(self.mru, frequency, np.zeros(frequency.shape), self.heave_rms)

    def heard(self, read: Read, start: int, count: int) -> tuple[FloatArray, FloatArray]:
        """Return heave and heave rate with gain and phase error, (count,) each.

        `read` gives heave [m] and heave rate [m/s] at so many samples from one on, also of before
        the run and after it.
        """
        gain, phase = self.signs[0] * self._unit.gain_error, self.signs[1] * self._unit.phase_error
        if phase == 0.0:
            z, v = read(start, count)
            return ((1.0 + gain) * z, (1.0 + gain) * v) if gain else (z, v)
        from scipy.signal import fftconvolve

        reach = len(self._quarter) // 2
        wide = read(start - reach, count + 2 * reach)
        turned = (fftconvolve(values, self._quarter, mode="valid") for values in wide)
        pairs = zip(wide, turned, strict=True)
        z, v = ((1.0 + gain) * x[reach : reach + count] + phase * y for x, y in pairs)
        return z, v

    def initial(self, displacement: float, velocity: float) -> MruState:
        """Return the state before sample 0, given the hook's motion at it [m], [m/s]."""
        wave = 0.0 + 0.0j  # complex amplitude at sample 0: Re(wave e^{i omega t})
        omega = self.heave_frequency or 0.0
        if omega > 0.0:
            wave = complex(displacement, -velocity / omega)
        mode = 0.0 + 0.0j
        if self._corner is not None and omega > 0.0:
            s, pole = 1j * omega, low_pass_pole(self._corner)
            low = wave / (s**2 + math.sqrt(2.0) * self._corner * s + self._corner**2)
            mode = complex(to_mode(low.real, (s * low).real, pole))
        heave, rate = self._filtered(
            np.array([mode]), np.array([displacement]), np.array([velocity])
        ).T
        # What is on its way at the start: the sine of the waves before, or the first value.
        back = self.sample_time * np.arange(-len(self._delay_weights) + 1, 0)
        cos, sin = np.cos(omega * back), np.sin(omega * back)
        past = np.column_stack(
            (
                heave * cos + (rate / omega * sin if omega > 0.0 else 0.0),
                rate * cos - heave * omega * sin,
            )
        )
        return MruState(
            sample=0,
            last=read_only([displacement, velocity]),
            filter=mode,
            errors=tuple(process.start(self.seed) for process in self.processes),
            past=read_only(past),
            held=read_only([0.0, 0.0]),
        )

    def block(
        self, state: MruState, displacement: npt.ArrayLike, velocity: npt.ArrayLike
    ) -> tuple[MruBlock, MruState]:
        """Return what the unit shows over the samples that follow a state, and the next state.

        The true motion of the hook at the samples is [m], [m/s], (n,), n > 0; the state, of
        `initial` or of the block before, is not changed.
        """
        true = np.column_stack((displacement, velocity))
        n, start = len(true), state.sample
        mode, modes_after = state.filter, []
        shown = true
        if self._corner is not None:
            path = true if start == 0 else np.vstack((state.last, true))
            modes = self._advance(mode, path)
            mode = complex(modes[-1])
            shown = self._filtered(modes[-n:], *true.T)
        delayed, past = self._delayed(np.vstack((state.past, shown)), n)
        for process, before in zip(self.processes, state.errors, strict=True):
            errors, reached = process.block(before, self.seed, self.sample_time, start, n)
            modes_after.append(reached)
            delayed = delayed + errors
        for since, until, *offset in self.biases:
            inside = during([(since, until)], start + np.arange(n), self.sample_time)
            delayed = delayed + inside[:, np.newaxis] * np.array(offset)
        gone = during(self.outages, start + np.arange(n), self.sample_time)
        last = np.maximum.accumulate(np.where(gone, 0, np.arange(1, n + 1)))
        reported = np.vstack((state.held, delayed))[last]
        silent = np.arange(1, n + 1) - np.where(last == 0, -state.silent, last)
        after = MruState(
            sample=start + n,
            last=read_only(true[-1]),
            filter=mode,
            errors=tuple(modes_after),
            past=read_only(past),
            held=read_only(reported[-1]),
            silent=int(silent[-1]),
        )
        valid = np.where(gone, 0.0, 1.0)
        age = self.delay + self.sample_time * silent.astype(np.float64)
        heave, rate = reported[:, 0], reported[:, 1]
        return MruBlock(heave=heave, heave_rate=rate, valid=valid, age=age), after

    @property
    def _unit(self) -> MRU:
        return self.mru or PERFECT

    @property
    def _corner(self) -> float | None:
        """Corner frequency of the high-pass [rad/s]; None for no high-pass."""
        period = self._unit.heave_filter_period
        return None if period is None else 2.0 * math.pi / period

    @cached_property
    def _delay_weights(self) -> FloatArray:
        """Weights of the values from the oldest still on its way to the present one."""
        samples = self.delay / self.sample_time
        whole = math.floor(samples + 1e-6)
        share = max(samples - whole, 0.0)
        weights = np.zeros(whole + 2)
        weights[0], weights[1] = share, 1.0 - share
        return weights if share > 1e-6 else read_only([1.0, *np.zeros(whole)])

    def _delayed(self, values: FloatArray, n: int) -> tuple[FloatArray, FloatArray]:
        """Return the last n values late by the delay, and those still on their way."""
        weights = self._delay_weights
        late = weights[0] * values[:n]
        if len(weights) > 1 and weights[1] > 0.0:
            late = late + weights[1] * values[1 : n + 1]
        return late, values[n:]

    def _filtered(self, modes: ComplexArray, z: FloatArray, v: FloatArray) -> FloatArray:
        """Return high-passed displacement and velocity (n, 2) from the filter's modes."""
        if self._corner is None:
            return np.column_stack((z, v))
        w = self._corner
        low, low_rate = from_mode(modes, low_pass_pole(w))
        heave = z - math.sqrt(2.0) * w * low_rate - w**2 * low
        rate = v - math.sqrt(2.0) * w * heave - w**2 * low_rate
        return np.column_stack((heave, rate))

    @cached_property
    def _filter_step(self) -> tuple[complex, ComplexArray]:
        """Factor of the mode over a sample, and gains of z, v before and z, v after it."""
        T, corner = self.sample_time, self._corner or 1.0
        pole, driven = low_pass_pole(corner), np.array([[0.0, 0.0], [1.0, 0.0]])
        (low, rate), _ = hermite_hold(low_pass(corner), driven, T, T)
        return complex(np.exp(pole * T)), to_mode(low, rate, pole)

    def _advance(self, mode: complex, path: FloatArray) -> ComplexArray:
        """Return the filter's mode at every sample of a path, given that at the first."""
        factor, gains = self._filter_step
        drive = path[:-1] @ gains[:2] + path[1:] @ gains[2:]
        return mode_recursion(factor, mode, drive)

    @cached_property
    def _quarter(self) -> FloatArray:
        """Kernel (odd length) that turns every harmonic ahead by 90 degrees.

        -1/(pi t), the odd samples doubled and the even ones zero as for sampled signals, under a
        Blackman window.
        """
        reach = math.ceil(_HILBERT / self.sample_time)
        k = np.arange(-reach, reach + 1)
        odd = k % 2 != 0
        kernel = np.zeros(k.size)
        kernel[odd] = -2.0 / (np.pi * k[odd])
        return read_only(kernel * np.blackman(k.size))


def error_density(
    unit: MRU | None, omega: FloatArray, heave: FloatArray, heave_rms: FloatArray | float
) -> FloatArray:
    """Return the one-sided density of the heave's error [m2 s/rad] before the unit's delay.

    Gain and phase error are in it with their root mean square over both signs.  Without a unit it
    is a perfect one.  The heave's own density at the frequencies (n,) [rad/s] is (.., n) [m2
    s/rad], its standard deviation (.., 1) or a number [m].
    """
    unit = unit or PERFECT
    found = np.zeros_like(heave)
    if unit.coherent > 0.0:
        found = unit.coherent**2 * np.abs(unit_response(unit, 1j * omega)) ** 2 * heave
    for rms, w in _independent(unit, heave_rms):
        shape = 2.0 * math.sqrt(2.0) / math.pi * w**3 / (omega**4 + w**4)
        found = found + rms**2 * shape
    return found


def coherent_error(unit: MRU, omega: FloatArray) -> ComplexArray:
    """Return gain and phase error over the heave before the unit's delay, (0 to 2, n).

    A row for each that there is, of its positive sign: what the unit's high-pass leaves of it.
    """
    s = 1j * omega
    passed = unit_response(unit, s) * np.exp(s * unit.delay)
    errors = [e for e in (unit.gain_error, 1j * unit.phase_error) if e != 0.0]
    return np.asarray(np.array(errors, dtype=np.complex128)[:, None] * passed)


def _independent(
    unit: MRU, heave_rms: FloatArray | float
) -> tuple[tuple[FloatArray | float, float], ...]:
    """Return rms [m] and corner [rad/s] of what the unit shows too much: in band, drift, noise."""
    in_band = np.maximum(unit.noise_floor, unit.noise_fraction * heave_rms)
    # White noise N a root hertz behind the low-pass has the variance N^2 w/(4 sqrt(2)).
    white = unit.noise * math.sqrt(unit.bandwidth / (4.0 * math.sqrt(2.0)))
    slow = 2.0 * math.pi / unit.drift_period
    return (in_band, unit.noise_bandwidth), (unit.drift, slow), (white, unit.bandwidth)


def unit_response(unit: MRU | None, s: npt.ArrayLike) -> ComplexArray:
    """Return reported heave over heave [-] of a unit at points s [1/s], without the error."""
    unit, points = unit or PERFECT, np.asarray(s, dtype=np.complex128)
    response = np.exp(-points * unit.delay)
    if unit.heave_filter_period is not None:
        w = 2.0 * math.pi / unit.heave_filter_period
        response = response * (points**2 / (points**2 + math.sqrt(2.0) * w * points + w**2))
    return np.asarray(response)


def low_pass_pole(corner: float) -> complex:
    """Return the pole in the upper half plane [rad/s] of a low-pass with this corner [rad/s]."""
    return corner * complex(-1.0, 1.0) / math.sqrt(2.0)


def to_mode(value: npt.ArrayLike, rate: npt.ArrayLike, pole: complex) -> ComplexArray:
    """Return the mode of a filter's value and its derivative."""
    v, r = np.asarray(value, dtype=np.float64), np.asarray(rate, dtype=np.float64)
    return np.asarray(r - pole.conjugate() * v, dtype=np.complex128)


def from_mode(modes: ComplexArray, pole: complex) -> tuple[FloatArray, FloatArray]:
    """Return the filter's value and its derivative from its mode."""
    value = modes.imag / pole.imag
    return value, modes.real + pole.real * value


def mode_recursion(factor: complex, first: complex, drive: ComplexArray) -> ComplexArray:
    """Return x[0] = first, x[k + 1] = factor x[k] + drive[k]."""
    from scipy.signal import lfilter

    driven = np.concatenate(([first], drive)).astype(np.complex128)
    return np.asarray(lfilter([1.0], [1.0, -factor], driven), dtype=np.complex128)


def low_pass_noise(corner: float, step: float, rms: float = 1.0) -> tuple[FloatArray, FloatArray]:
    """Return what becomes of white noise behind the low-pass, a corner in rad/s, over a step [s].

    It is the value and derivative after the step by those before it, (2, 2), and the covariance of
    what they gain, (2, 2), for so much rms of the value in all.
    """
    over, added = noisy_hold(low_pass(corner), np.array([[0.0], [1.0]]), step)
    # Variance of the value under white noise of intensity one: 1/(2 sqrt(2) corner^3).
    return over, added * rms**2 * 2.0 * math.sqrt(2.0) * corner**3


def low_pass(corner: float) -> FloatArray:
    """Return A of value and derivative of a second-order Butterworth low-pass, (2, 2)."""
    return np.array([[0.0, 1.0], [-(corner**2), -math.sqrt(2.0) * corner]])
