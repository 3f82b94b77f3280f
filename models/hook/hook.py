r"""The hook's motion: sea times vessel, as spectra, as numbers and as a time series.

Third room in the data's way: what the hook does before any winch acts on it.  The displacement's
spectrum is |RAO|^2 S; velocity and acceleration follow by omega^2 and omega^4.  All three use the
same band, and so does the time series, so that statistics of a long record meet the spectrum's.
Sea and RAO are functions of the waves' own frequency; on a vessel that moves through the water the
hook's spectra are functions of the frequency at which it meets them (`models.hook.encounter`).

A record is a sum of harmonics with random amplitude, that is independent Gaussian cosine and sine
parts of variance S(omega) d omega each (Rice 1944; Tucker, Challenor and Carter 1984): the record
is then an exact sample of the Gaussian process, groups and extremes included, which harmonics of
fixed amplitude and random phase are not.  Their spacing is 2 pi over a period of at least twice
the record's length, so the record does not repeat itself.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from ..basics import (
    FloatArray,
    InputError,
    PhysicsWarning,
    Quadrature,
    ReadOnlyArrays,
    SpectrumStatistics,
    adaptive_nodes,
    check_range,
    read_only,
)
from ..case import Case
from ..sea import SeaSpectrum, highest_of
from ..vessel import HeaveRao, heading_remark, hook_rao, speed_remark
from .encounter import Encounter, MetSpectrum

ORDERS = np.arange(9.0)[:, np.newaxis]
"""Orders of the displacement's moments that the statistics of all three motions are made of."""

# A Fourier transform whose length has a larger prime factor takes up to twenty times as long.
_LARGEST_FACTOR = 300

_BAND_POINTS = 4000  # at which the energetic band is looked for

# Above this share of the displacement variance from outside the RAO's table the user is told.
_SHARE_TO_WARN = 0.05


@dataclass(frozen=True, kw_only=True, eq=False)
class HookRecord(ReadOnlyArrays):
    """A time series of the hook's vertical motion, positive up."""

    time: FloatArray  #: Times from zero in equal steps (n,) [s].
    #: The motion and its exact derivatives (n,) [m], [m/s], [m/s2].
    displacement: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    seed: int  #: The seed that it was drawn with.

    @property
    def step(self) -> float:
        """Time step [s]."""
        return float(self.time[1] - self.time[0])

    @property
    def duration(self) -> float:
        """Time from the first sample to the last [s]."""
        return float(self.time[-1] - self.time[0])


@dataclass(frozen=True, kw_only=True, eq=False)
class HookMotion:
    """Vertical motion of the hook in a sea.

    Examples
    --------
    >>> sea = SeaSpectrum(kind="bretschneider-1975", significant_height=2.0, significant_period=8.0)
    >>> still = HeaveRao(omega=[0.3, 2.0], amplitude=[0.5, 0.5], beyond="hold", below="hold")
    >>> motion = HookMotion(sea=sea, rao=still)
    >>> round(motion.displacement.rms / sea.statistics.rms, 9)
    0.5
    """

    sea: SeaSpectrum  #: The sea's spectrum.
    rao: HeaveRao  #: Heave of the hook per metre of wave.
    #: How the waves are met on a vessel that moves through the water, if it does.
    encounter: Encounter | None = None

    @classmethod
    def from_case(cls, case: Case, *, warn: bool = True) -> HookMotion:
        """Return the hook motion of a case; warn if much of it lies outside the RAO's table.

        Not where the case's user has been told before, and never of a quiet case (`Case.variant`).
        """
        sea = case.sea.to_spectrum()
        motion = cls(
            sea=sea,
            rao=hook_rao(case.vessel, sea.spreading, case.label),
            encounter=Encounter.from_case(case),
        )
        if warn and not case.quiet:
            for remark in (
                speed_remark(case.vessel, case.label),
                heading_remark(case.vessel, sea, case.label),
            ):
                if remark is not None:
                    warnings.warn(f"{case.label}: {remark}", PhysicsWarning, stacklevel=2)
            motion.warn_if_outside()
        return motion

    def scaled(self, significant_height: float) -> HookMotion:
        """Return the motion in the same sea at another H_s [m]."""
        return replace(self, sea=self.sea.scaled(significant_height))

    def density(self, omega: npt.ArrayLike) -> FloatArray:
        """Return the displacement's one-sided variance density [m^2 s/rad] at `omega` [rad/s]."""
        if self.met is not None:
            return self.met.density(omega)
        result: FloatArray = self.rao.gain(omega) ** 2 * self.sea.density(omega)
        return result

    def __call__(self, omega: npt.ArrayLike) -> FloatArray:
        """Return :meth:`density`."""
        return self.density(omega)

    @cached_property
    def met(self) -> MetSpectrum | None:
        """The displacement's spectrum over the frequency of encounter; None on a vessel at rest."""
        if self.encounter is None:
            return None
        return self.encounter.met(self.sea.density, self.sea.band, self.rao, self._wave_splits)

    @property
    def band(self) -> tuple[float, float]:
        """Band of the spectra and of the time series: the sea's, or what is met of it [rad/s]."""
        return self.sea.band if self.met is None else self.met.band

    @property
    def splits(self) -> tuple[float, ...]:
        """Frequencies at which a quadrature has to begin a new panel [rad/s]."""
        return self._wave_splits if self.met is None else self.met.splits

    @property
    def _wave_splits(self) -> tuple[float, ...]:
        low, high = self.sea.band
        return tuple(sorted(w for w in {*self.sea.splits, *self.rao.splits} if low < w < high))

    @cached_property
    def quadrature(self) -> Quadrature:
        """Nodes on which the moments of all three motions are accurate to 1e-9."""
        powers = np.array([[0.0], [1.0], [2.0], [3.0], [4.0], [5.0], [6.0], [8.0]])
        return adaptive_nodes(
            lambda omega: omega**powers * self.density(omega),
            *self.band,
            splits=self.splits,
            rtol=1e-9,
        )

    @cached_property
    def moments(self) -> FloatArray:
        """Spectral moments of order 0 to 8 of the displacement (9,) [m^2 (rad/s)^n]."""
        nodes = self.quadrature
        return read_only(nodes.integrate(nodes.omega**ORDERS * self.density(nodes.omega)))

    @property
    def displacement(self) -> SpectrumStatistics:
        """Statistics of the displacement [m]."""
        return motion_statistics(self.moments)[0]

    @property
    def velocity(self) -> SpectrumStatistics:
        """Statistics of the velocity [m/s]."""
        return motion_statistics(self.moments)[1]

    @property
    def acceleration(self) -> SpectrumStatistics:
        """Statistics of the acceleration [m/s2].

        Its periods are set by the band's upper end where the RAO does not fall off beyond its
        table: the omega^-5 tail of a sea leaves an acceleration spectrum that falls with 1/omega.
        """
        return motion_statistics(self.moments)[2]

    @cached_property
    def energetic_band(self) -> tuple[float, float]:
        """Frequencies between which 90 % of the displacement's variance lies [rad/s]."""
        omega = np.geomspace(*self.band, _BAND_POINTS)
        density = self.density(omega)
        parts = np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(omega))
        low, high = np.interp([0.05 * parts[-1], 0.95 * parts[-1]], parts, omega[1:])
        return float(low), float(high)

    @cached_property
    def peak_frequency(self) -> float:
        """Frequency at which the displacement's density is highest [rad/s]."""
        if self.met is not None:
            return highest_of(self.density, [self.met.peak_frequency])
        return highest_of(self.density, [self.sea.peak_frequency, *self.splits])

    def warn_if_outside(self) -> None:
        """Warn with a :class:`PhysicsWarning` if over 5 % of the variance is outside the table."""
        share = self.rao.share_outside(self.sea)
        if share.total <= _SHARE_TO_WARN:
            return
        first, last = self.rao.splits[0], self.rao.splits[-1]
        parts = [
            f"{part:.1%} {side} {edge:g} rad/s is "
            + ("cut" if choice == "zero" else f"extrapolated ({choice})")
            for part, side, edge, choice in (
                (share.below, "below", first, self.rao.below),
                (share.beyond, "above", last, self.rao.beyond),
            )
            if part >= 0.0005
        ]
        warnings.warn(
            f"{self.rao.owner}: {share.total:.1%} of the hook's displacement variance lies outside "
            f"the table ({first:g} to {last:g} rad/s): {'; '.join(parts)}",
            PhysicsWarning,
            stacklevel=3,
        )

    def record(self, duration: float, *, step: float = 0.05, seed: int) -> HookRecord:
        """Draw a time series of the motion from 0 to `duration` [s], every `step` [s].

        The same seed gives the same waves on every vessel, the same motion at every step that
        divides ten seconds, and the same beginning at every duration up to 100 peak periods.  The
        samples are those of the continuous motion whatever the step: nothing of the band is lost or
        folded.

        Raises InputError if the duration is shorter than a step, or the seed is negative.
        """
        check_range("hook record", "step", step, low=0.0, unit="s", open_low=True)
        check_range("hook record", "duration", duration, low=step, unit="s")
        if seed < 0:
            raise InputError(f"hook record: seed must be at least 0, got {seed!r}")
        # Twice the length, so that it does not repeat; 200 lines below the peak resolve its shape.
        peak = self.sea.peak_frequency if self.met is None else self.met.peak_frequency
        wanted = max(2.0 * duration, 200.0 * 2.0 * math.pi / peak)
        steps = math.ceil(10.0 * _transformable(math.ceil(wanted / 10.0)) / step - 1e-6)
        # The transform's own step has to resolve the band's upper end.
        finer = math.floor(self.band[1] * step / math.pi) + 1
        spacing = 2.0 * math.pi / (steps * step)
        lines = math.floor(self.band[1] / spacing)
        omega = spacing * np.arange(1.0, lines + 1.0)
        # As many lines whatever the step, which the transform below may make finer: so every step
        # samples the same motion.
        parts = np.random.default_rng(seed).standard_normal((lines, 2))
        noise = parts[:, 0] - 1j * parts[:, 1]
        if self.encounter is None:
            wave = np.sqrt(self.sea.density(omega) * spacing) * noise
            heave = self.rao.response(omega) * wave
        else:
            # Several waves are met at one frequency: amplitudes come from the spectrum, the phase
            # is that of the longest, so that the motion stays related to the waves at the ship.
            phase = np.angle(self.rao.response(self.encounter.wave_frequency(omega)))
            heave = np.sqrt(self.density(omega) * spacing) * np.exp(1j * phase) * noise
        count = math.floor(duration / step + 1e-9) + 1

        def series(derivative: int) -> FloatArray:
            size = steps * finer
            half = np.zeros(lines + 1, dtype=np.complex128)  # above the band there is nothing
            half[1:] = 0.5 * size * heave * (1j * omega) ** derivative
            # A copy, so that the rest of the period is not kept.
            return np.fft.irfft(half, size)[: count * finer : finer].copy()

        return HookRecord(
            time=step * np.arange(float(count)),
            displacement=series(0),
            velocity=series(1),
            acceleration=series(2),
            seed=seed,
        )


def motion_statistics(moments: FloatArray) -> tuple[SpectrumStatistics, ...]:
    """Return the statistics of displacement, velocity and acceleration.

    The moments are those of order 0 to 8 of the displacement (9,) [m^2 (rad/s)^n]: those of a
    derivative are two orders further on.
    """
    m = [float(moment) for moment in moments]
    return tuple(
        SpectrumStatistics(m0=m[n], m1=m[n + 1], m2=m[n + 2], m4=m[n + 4]) for n in (0, 2, 4)
    )


def _transformable(length: int) -> int:
    """Return the next length, itself included, that has no prime factor above the largest."""
    while True:
        rest = length
        for factor in range(2, _LARGEST_FACTOR + 1):
            while rest % factor == 0:
                rest //= factor
        if rest == 1:
            return length
        length += 1
