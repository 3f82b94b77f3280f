"""Motions of a vessel in waves, six complex operators over frequency and heading: `VesselRaos`.

What every reader of a RAO file returns and what the hook's motion is made of.  Convention, fixed:

* vessel frame: x forward, y to port, z up.  Angles by the right-hand rule: positive roll lifts
  the port side, positive pitch lowers the bow, positive yaw turns the bow to port;
* time factor e^{+i omega t}; a positive phase leads the wave;
* heading b: where the waves travel towards, counter-clockwise seen from above relative to the
  bow: 0 following, 90 deg towards port (coming from starboard), 180 deg head sea;
* wave elevation at (x, y):  Re[a exp(i (omega t - k (x cos b + y sin b)))], so that long waves
  give heave -> 1, pitch -> +i k cos b, roll -> -i k sin b at the point of zero phase;
* small angles: the point at (x, y, z) from the origin heaves heave - x pitch + y roll.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from waveresponse import RAO

from ..basics import (
    ComplexArray,
    FloatArray,
    InputError,
    ReadOnlyArrays,
    check_ascending,
    check_finite,
    check_range,
    wave_number,
)
from .crane import transport

MODES = ("surge", "sway", "heave", "roll", "pitch", "yaw")
"""The six motions, in the order of the last axis of every table."""

MIRRORED = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
"""Sign of each motion in a mirror that swaps port and starboard."""

WIDEST_GAP = math.pi / 2.0
"""Widest gap between two headings of a table that is filled by interpolation [rad]."""

WIDEST_STEP = math.pi / 6.0
"""Widest step of evenly spaced headings that are read as a Fourier series [rad]."""

_HEAVE = 2
_ANGLES = (3, 4, 5)


@dataclass(frozen=True, kw_only=True, eq=False)
class VesselRaos(ReadOnlyArrays):
    """Response amplitude operators (RAOs) of a vessel's six motions.

    Raises InputError if a table is unsorted, out of range, NaN or of another shape than the two
    axes ask for.

    Examples
    --------
    >>> buoy = VesselRaos(name="raft", omega=[0.5, 1.0], heading=[0.0, math.pi],
    ...                   values=np.tile([0, 0, 1, 0, 0, 0], (2, 2, 1)))
    >>> complex(buoy.response(0.7, math.pi)[2])
    (1+0j)
    """

    name: str  #: What the vessel is called.
    #: Wave frequencies as felt by a vessel at rest, strictly ascending, above zero (k,) [rad/s].
    omega: FloatArray
    #: Where the waves travel towards, strictly ascending in [0, 2 pi) (h,) [rad].
    heading: FloatArray
    #: Motion per wave amplitude (k, h, 6), modes in the order of :data:`MODES` [m/m, rad/m].
    values: ComplexArray
    #: The point whose motions these are, in the vessel frame of the file [m].
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    phase_origin: tuple[float, float] = (0.0, 0.0)  #: Where in plan the wave has zero phase [m].
    depth: float = math.inf  #: Water depth, infinite for deep water [m].
    speed: float = 0.0  #: Forward speed at which the operators hold [m/s].
    source: str = ""  #: The file or program they come from.
    notes: tuple[str, ...] = ()  #: What the reader found and converted, a sentence each.

    def __post_init__(self) -> None:
        """Check the tables and make them read-only."""
        owner = self.source or self.name or "RAOs"
        omega = np.atleast_1d(check_ascending(owner, "omega", self.omega))
        heading = np.atleast_1d(check_ascending(owner, "heading", self.heading))
        if omega.ndim != 1 or omega.size < 2:
            raise InputError(f"{owner}: omega must have at least 2 rows, got {omega.size}")
        if heading.ndim != 1 or heading.size < 1:
            raise InputError(f"{owner}: heading must have at least 1 row, got {heading.size}")
        check_range(owner, "omega", omega[0], low=0.0, open_low=True, unit="rad/s")
        check_range(owner, "heading", heading[0], low=0.0, unit="rad")
        check_range(
            owner, "heading", heading[-1], low=0.0, high=2.0 * math.pi, open_high=True, unit="rad"
        )
        values = np.asarray(self.values, dtype=np.complex128)
        wanted = (omega.size, heading.size, len(MODES))
        if values.shape != wanted:
            raise InputError(
                f"{owner}: values must have the shape (frequencies, headings, 6) = {wanted}, "
                f"got {values.shape}"
            )
        bad = np.argwhere(~np.isfinite(values))
        if bad.size:
            row, column, mode = (int(i) for i in bad[0])
            raise InputError(
                f"{owner}: values must be finite numbers, got {values[row, column, mode]} for "
                f"{MODES[mode]} at {omega[row]:g} rad/s, heading "
                f"{math.degrees(heading[column]):g} deg"
            )
        for name, size in (("origin", 3), ("phase_origin", 2)):
            point = check_finite(owner, name, getattr(self, name))
            if point.shape != (size,):
                raise InputError(
                    f"{owner}: {name} must be {size} numbers [m], got {point.tolist()}"
                )
            object.__setattr__(self, name, tuple(float(x) for x in point))
        if not (math.isinf(self.depth) and self.depth > 0.0):
            check_range(owner, "depth", self.depth, low=0.0, open_low=True, unit="m")
        check_range(owner, "speed", self.speed, low=-50.0, high=50.0, unit="m/s")
        object.__setattr__(self, "omega", omega)
        object.__setattr__(self, "heading", heading)
        object.__setattr__(self, "notes", tuple(self.notes))
        super().__post_init__()

    @property
    def heading_deg(self) -> FloatArray:
        """The headings (h,) [deg]."""
        return np.degrees(self.heading)

    def mode(self, name: str) -> ComplexArray:
        """Return one motion at the table's rows (k, h) [m/m or rad/m].

        Raises InputError if there is no such motion.
        """
        if name not in MODES:
            raise InputError(f"{self.name}: a motion is one of {', '.join(MODES)}; got {name!r}")
        found: ComplexArray = self.values[:, :, MODES.index(name)]
        return found

    def wave_number(self, omega: npt.ArrayLike) -> FloatArray:
        """Return the wave number at the water depth of the table, same shape [rad/m]."""
        return wave_number(omega, self.depth)

    @property
    def even(self) -> bool:
        """Whether the headings go round the circle in equal steps of at most 30 degrees."""
        count = self.heading.size
        steps = np.diff(self.heading, append=self.heading[0] + 2.0 * math.pi)
        step = 2.0 * math.pi / count
        return step <= WIDEST_STEP * (1.0 + 1e-9) and bool(np.all(np.abs(steps - step) < 1e-6))

    def response(
        self, omega: npt.ArrayLike, heading: npt.ArrayLike, *, smooth: bool = False
    ) -> ComplexArray:
        """Return the six operators (..., 6) [m/m, rad/m] at any frequency and heading.

        Between two frequencies amplitude and unwrapped phase are each linear, as in
        :class:`models.vessel.vessel.HeaveRao` and for its reasons.  Between two headings the
        complex number is interpolated, round the circle: in heading a motion such as roll passes
        *through* zero, where amplitude and phase have a cusp and a jump and the complex number is
        smooth.  Evenly spaced headings are the samples of a Fourier series (:attr:`even`), in
        which a symmetric vessel has cosines of heave and sines of roll alone; others are joined
        by straight lines, which are low where the motion is largest.  What turns the complex
        number with heading is the wave's own phase between the point of zero phase and the
        origin, k d cos(b - b0); it is taken out before and put back after. At the rows the table
        comes back exactly.

        Below the table heave tends linearly to 1 with zero phase, the angles keep their ratio to
        the wave slope, the other motions their first value; above, amplitudes fall with omega^-2.

        Frequencies [rad/s] are at least zero; they and the headings [rad] are broadcast.  If
        `smooth`, headings that straight lines join are joined by a periodic cubic spline instead:
        the difference tells how far the lines are off.

        Raises InputError if a heading lies in a gap of the table wider than a quarter of the
        circle: nobody has computed the vessel there.
        """
        frequency, direction = np.broadcast_arrays(
            np.asarray(omega, dtype=np.float64), np.asarray(heading, dtype=np.float64)
        )
        owner = self.source or self.name
        frequency = check_finite(owner, "omega", frequency)
        direction = check_finite(owner, "heading", direction)
        shape = frequency.shape
        frequency, direction = frequency.ravel(), direction.ravel()
        centred = self.values / self._wave_phase(self.omega[:, None], self.heading)[..., None]
        rows, back = np.unique(frequency, return_inverse=True)
        table = _between_rows(self.omega, centred, rows, self.wave_number)
        headings, column = np.unique(np.mod(direction, 2.0 * math.pi), return_inverse=True)
        weights = self._heading_weights(owner, headings, smooth)
        found = np.empty((frequency.size, len(MODES)), dtype=np.complex128)
        for i, share in enumerate(weights):
            points, used = np.flatnonzero(column == i), np.flatnonzero(share)
            chosen = table[back[points][:, None], used]
            found[points] = np.einsum("h,mhc->mc", share[used], chosen)
        found = found * self._wave_phase(frequency, direction)[:, None]
        return found.reshape(*shape, len(MODES))

    def at(self, point: Sequence[float]) -> VesselRaos:
        """Return the motions of another point (3,) [m] of the rigid vessel, in the same frame.

        Small angles; complex, so that every motion keeps its phase.  The point of zero wave
        phase stays where it is.

        Raises InputError if the point is not three finite numbers.
        """
        target = check_finite(self.name, "point", list(point))
        if target.shape != (3,):
            raise InputError(f"{self.name}: point must be 3 numbers [m], got {target.tolist()}")
        x, y, z = (np.asarray(self.origin) - target).tolist()
        place = (float(target[0]), float(target[1]), float(target[2]))
        return replace(self, values=self.values @ transport((x, y, z)).T, origin=place)

    def heave_at(self, point: Sequence[float], heading: float) -> ComplexArray:
        """Return the heave of a point (3,) [m] at the table's frequencies (k,) [m/m].

        In waves that travel towards a heading [rad].
        """
        moved: ComplexArray = self.at(point).response(self.omega, heading)[:, 2]
        return moved

    def with_phase_origin(self, place: Sequence[float]) -> VesselRaos:
        """Return the same motions against a wave of zero phase at another place in plan (2,) [m].

        Elevation at P1 over that at P0 is exp(-i k (P1 - P0) . (cos b, sin b)); motion per
        elevation is divided by it.
        """
        new = (float(place[0]), float(place[1]))
        dx, dy = new[0] - self.phase_origin[0], new[1] - self.phase_origin[1]
        along = dx * np.cos(self.heading) + dy * np.sin(self.heading)
        turn = np.exp(1j * self.wave_number(self.omega)[:, None] * along)
        return replace(self, values=self.values * turn[..., None], phase_origin=new)

    def to_waveresponse(self) -> dict[str, RAO]:
        """Return the six motions as :class:`waveresponse.RAO` objects, named by :data:`MODES`."""
        from waveresponse import RAO

        return {
            mode: RAO(
                self.omega,
                self.heading,
                self.values[:, :, i],
                freq_hz=False,
                degrees=False,
                clockwise=False,
                waves_coming_from=False,
            )
            for i, mode in enumerate(MODES)
        }

    @classmethod
    def from_waveresponse(
        cls, raos: Mapping[str, RAO], *, name: str = "vessel", depth: float = math.inf
    ) -> VesselRaos:
        """Return six :class:`waveresponse.RAO` objects as one table.

        There is one for each motion, under the names of :data:`MODES`; what is missing is zero.
        Their own wave conventions are read from them.  `name` is what the vessel is called, `depth`
        that of the water [m].

        Raises InputError if a motion is unknown, or two of them have different frequencies or
        headings.
        """
        strange = sorted(set(raos) - set(MODES))
        if strange or not raos:
            raise InputError(
                f"{name}: the motions are {', '.join(MODES)}; got {', '.join(strange) or 'none'}"
            )
        grids = {}
        for mode, rao in raos.items():
            # The library lets each motion have a convention of its own.
            ours = rao.copy()
            ours.set_wave_convention(clockwise=False, waves_coming_from=False)
            grids[mode] = ours.grid(freq_hz=False, degrees=False)
        omega, heading, _ = next(iter(grids.values()))
        values = np.zeros((omega.size, heading.size, len(MODES)), dtype=np.complex128)
        for mode, (frequency, direction, grid) in grids.items():
            if (
                omega.shape != frequency.shape
                or heading.shape != direction.shape
                or not (np.allclose(omega, frequency) and np.allclose(heading, direction))
            ):
                raise InputError(
                    f"{name}: {mode} has other frequencies or headings than the first RAO"
                )
            values[:, :, MODES.index(mode)] = grid
        return cls(
            name=name, omega=omega, heading=heading, values=values, depth=depth,
            source="waveresponse",
        )  # fmt: skip

    def _heading_weights(self, owner: str, wanted: FloatArray, smooth: bool) -> FloatArray:
        """Return what each heading of the table counts for at headings in [0, 2 pi) (u, h)."""
        away = np.abs(wanted[:, None] - self.heading)
        # Rounding (180 deg in radians, 359.9999..) must not ask for a neighbour far away.
        same = np.minimum(away, 2.0 * math.pi - away) < 1e-9
        between = ~same.any(axis=1)
        weights = same.astype(np.float64)
        if self.even:
            weights[between] = _fourier_weights(self.heading, wanted[between])
        else:
            # Lines first in any case: they refuse the gaps.
            weights[between] = _linear_weights(owner, self.heading, wanted[between])
            if smooth:
                weights[between] = _spline_weights(self.heading, wanted[between])
        return weights

    def _wave_phase(self, omega: FloatArray, heading: FloatArray) -> ComplexArray:
        """Return the elevation at the origin over that at the phase origin (...,)."""
        dx = self.origin[0] - self.phase_origin[0]
        dy = self.origin[1] - self.phase_origin[1]
        along = dx * np.cos(heading) + dy * np.sin(heading)
        phase: ComplexArray = np.exp(-1j * self.wave_number(omega) * along)
        return phase


def _between_rows(
    omega: FloatArray,
    values: ComplexArray,
    wanted: FloatArray,
    wave_number: Callable[[npt.ArrayLike], FloatArray],
) -> ComplexArray:
    """Interpolate a table (k, h, 6) along its frequencies, to `wanted` (n,), at least zero [rad/s].

    The wave number is for the angles below the table.
    """
    check_range("RAOs", "omega", float(wanted.min(initial=0.0)), low=0.0, unit="rad/s")
    inside = np.clip(wanted, omega[0], omega[-1])
    left = np.clip(np.searchsorted(omega, inside, side="right") - 1, 0, omega.size - 2)
    part = ((inside - omega[left]) / (omega[left + 1] - omega[left]))[:, None, None]
    # The phase step of each panel to the nearer side: the same as unwrapping the column.
    a, b = values[left], values[left + 1]
    before, after = np.abs(a), np.abs(b)
    turn = np.angle(b * np.conj(a))
    # A row of exactly zero has no phase of its own; it takes that of its neighbour.
    first = np.where(before > 0.0, np.angle(a), np.angle(b))
    turn = np.where((before > 0.0) & (after > 0.0), turn, 0.0)
    amplitude = before + part * (after - before)
    found = amplitude * np.exp(1j * (first + part * turn))
    # Exactly the table's own numbers at its rows.
    found = np.where(part == 0.0, a, np.where(part == 1.0, b, found))

    under, over = wanted < omega[0], wanted > omega[-1]
    if np.any(under):
        # Long waves: heave as the water does; the angles as its slope.
        share = (wanted[under] / omega[0])[:, None]
        start = values[0, :, _HEAVE]
        level = 1.0 + (np.abs(start) - 1.0) * share
        found[under, :, _HEAVE] = level * np.exp(1j * np.angle(start) * share)
        slope = wave_number(wanted[under]) / wave_number(omega[0])
        for mode in _ANGLES:
            found[under, :, mode] = values[0, :, mode] * slope[:, None]
    if np.any(over):
        found[over] *= ((omega[-1] / wanted[over]) ** 2)[:, None, None]
    return found


def _fourier_weights(heading: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return the weights (u, h) of evenly spaced headings in their Fourier series (Dirichlet)."""
    n = heading.size
    half = 0.5 * (wanted[:, None] - heading)
    below = np.tan(half) if n % 2 == 0 else np.sin(half)
    weights: FloatArray = np.sin(n * half) / (n * np.where(below == 0.0, 1.0, below))
    return weights


def _spline_weights(heading: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return the weights (u, h) of headings in a periodic cubic spline through them."""
    from scipy.interpolate import CubicSpline

    knots = np.append(heading, heading[0] + 2.0 * math.pi)
    unit = np.eye(heading.size)
    curve = CubicSpline(knots, np.vstack([unit, unit[:1]]), bc_type="periodic")
    return np.asarray(curve(heading[0] + np.mod(wanted - heading[0], 2.0 * math.pi)))


def _linear_weights(owner: str, heading: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return the weights (u, h) of the two headings beside each, round the circle.

    Raises InputError if a heading lies in a gap wider than :data:`WIDEST_GAP`.
    """
    turn = 2.0 * math.pi
    left = np.searchsorted(heading, wanted, side="right") - 1  # -1: between the last and the first
    right = np.mod(left + 1, heading.size)
    start = heading[left] - np.where(left < 0, turn, 0.0)
    gap = np.mod(heading[right] - heading[left], turn)
    gap = np.where(gap == 0.0, turn, gap)
    lost = gap > WIDEST_GAP * (1.0 + 1e-9)
    if np.any(lost):
        i = int(np.argmax(lost))
        raise InputError(
            f"{owner}: no RAO for waves towards {math.degrees(wanted[i]):.4g} deg: the table has "
            f"no heading between {math.degrees(heading[left[i]]):.4g} and "
            f"{math.degrees(heading[right[i]]):.4g} deg, a gap wider than "
            f"{math.degrees(WIDEST_GAP):g} deg"
        )
    part = (wanted - start) / gap
    weights = np.zeros((wanted.size, heading.size))
    each = np.arange(wanted.size)
    weights[each, left] = 1.0 - part
    weights[each, right] += part
    return weights
