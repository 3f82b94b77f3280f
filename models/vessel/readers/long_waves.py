r"""The check of a RAO table against the limits of long waves.

A vessel that is small against the wave goes with the water: it heaves as the surface does, pitches
and rolls with its slope, surges and sways with the water's own sweep:

.. math:: \eta_3 \to 1, \quad \eta_5 \to i k \cos\beta, \quad \eta_4 \to -i k \sin\beta, \quad
          \eta_1 \to -i \cos\beta \coth k d, \quad \eta_2 \to -i \sin\beta \coth k d.

These limits know every convention: a frame with z down has heave at -1, degrees are 57 times too
large, a lag for a lead turns pitch round, a mirrored heading roll.  So the lowest frequency of a
table is held against them, as it is and as it would be if one of the usual mistakes were undone.
If undoing one makes it fit, that is the mistake, and the file is refused with its name.  A table
that fits neither way is left alone with a warning: a semi-submersible, a moored vessel, or a table
that begins at waves that are not long need not keep the limits (Orcina, *Checking RAOs*, takes
the same care).
"""

import math
from dataclasses import dataclass

import numpy as np

from ...basics import ComplexArray, FloatArray
from ..raos import VesselRaos

_COLUMNS = (0, 1, 2, 3, 4)  # surge, sway, heave, roll, pitch
_WEIGHTS = np.array([0.5, 0.5, 1.0, 1.0, 1.0])
_WORTH = 0.3  # least size of a limit that says anything: cos or sin of the heading
_WORST = 2.0  # an error counts for no more: a sign that is wrong
_FITS = 0.2  # mean error of a table that keeps the limits
_DOUBTFUL = 0.35
_GROSS = 0.3  # mean error beyond which a mistake is looked for
_BETTER = 2.0  # times nearer to the limits that undoing a mistake must bring a table
_SOFT = 0.3  # power of an amplitude's ratio that counts
_DEGREES = (45.0, 75.0)  # times the wave slope: 57.3, and what a resonance makes of it
_AGREE = 4.0  # factor between angles and wave slope that no resonance makes
_LONGEST = 0.5  # rad/s: waves of 250 m, about where those that are not long begin
_NOTHING = 0.05  # of a limit: a motion that is not there
_TURNED = 45.0  # deg
_SIZE = 2.5  # times the limit: more than a resonance makes of it in long waves

# What each mistake does to (surge, sway, heave, roll, pitch); the last says: also conjugate.
_ONE: tuple[complex, ...] = (1, 1, 1, 1, 1)
_MISTAKES: tuple[tuple[str, ComplexArray, bool], ...] = tuple(
    (name, np.array(factors, dtype=np.complex128), conjugate)
    for name, factors, conjugate in (
        ("", _ONE, False),
        ("lag for lead (or headings where the waves come from)", _ONE, True),
        ("z down", (1, 1, -1, -1, -1), False),
        ("heave positive down", (1, 1, -1, 1, 1), False),
        ("phases relative to the trough", (-1, -1, -1, -1, -1), False),
        ("mirrored headings (clockwise), or y to starboard", (1, -1, 1, -1, 1), False),
        ("pitch positive bow up", (1, 1, 1, 1, -1), False),
        ("roll positive port down", (1, 1, 1, -1, 1), False),
        ("z down, and lag for lead", (1, 1, -1, -1, -1), True),
        ("mirrored headings, and lag for lead", (1, -1, 1, -1, 1), True),
        ("phases relative to the zero up-crossing", (1j, 1j, 1j, 1j, 1j), False),
        ("phases relative to the zero down-crossing", (-1j, -1j, -1j, -1j, -1j), False),
    )
)


@dataclass(frozen=True, kw_only=True)
class LongWaveRow:
    """One motion at one heading in the longest waves of a table."""

    motion: str  #: Its name; angles are over the wave slope.
    heading_deg: float  #: Where the waves travel towards [deg].
    #: The operator and its limit [-].
    found: complex
    expected: complex

    @property
    def error(self) -> float:
        """Distance of the two over the limit [-]."""
        return abs(self.found / self.expected - 1.0)

    @property
    def verdict(self) -> str:
        """Whether it is right, and if not, whether size or phase is wrong."""
        ratio = self.found / self.expected
        size, turn = abs(ratio), abs(math.degrees(math.atan2(ratio.imag, ratio.real)))
        if size < _NOTHING:
            return "next to none"
        if turn > _TURNED:
            return "wrong sign" if turn > 180.0 - _TURNED else "wrong phase"
        if not 1.0 / _SIZE < size < _SIZE:
            return f"{size:.2g} times too large" if size > 1.0 else "too small"
        return "ok"


@dataclass(frozen=True, kw_only=True)
class LongWaveCheck:
    """A table against the limits of long waves."""

    omega: float  #: The lowest frequency [rad/s].
    wave_length: float  #: Length of its waves [m].
    rows: tuple[LongWaveRow, ...]  #: Motions at headings near 0, 45, 90, 135 and 180 deg.
    #: Weighted mean distance from the limits [-]; a wrong sign counts as 2, a wrong size little.
    error: float
    #: The mistake that would explain the table; empty if it keeps the limits, or if nothing that is
    #: known does.
    mistake: str
    remarks: tuple[str, ...]  #: What a user should know, a sentence each.

    @property
    def long(self) -> bool:
        """Whether the waves are long enough for the limits to say much."""
        return self.omega <= _LONGEST

    @property
    def ok(self) -> bool:
        """Whether the table has long waves, and keeps their limits."""
        return self.long and self.error <= _DOUBTFUL and not self.mistake


def check_long_waves(raos: VesselRaos) -> LongWaveCheck:
    """Hold the lowest frequency of a table in our convention against the limits of long waves.

    The answer has what was found and expected, and which mistake would explain the difference.
    """
    centred = raos.with_phase_origin(raos.origin[:2])
    omega = float(raos.omega[0])
    k = float(raos.wave_number(omega))
    found = centred.values[0][:, list(_COLUMNS)].copy()
    found[:, 3:] /= k
    wanted = _limits(raos, k)
    weights = np.where(np.abs(wanted) >= _WORTH, _WEIGHTS, 0.0)
    # A motion that is nowhere was not given, or was held.
    weights[:, ~np.any(raos.values[:, :, list(_COLUMNS)], axis=(0, 1))] = 0.0
    if raos.speed != 0.0:
        weights[:, :2] = 0.0  # a vessel under way is not swept along as one at rest
    scale = _angle_scale(found, wanted, weights)
    tries = [
        (_error((np.conj(found) if turned else found) * factors, wanted, weights, size), name, size)
        for size in ((1.0,) if scale == 1.0 else (1.0, scale))
        for name, factors, turned in _MISTAKES
    ]
    own = tries[0][0]
    # The first of those that fit about equally well: the simplest.
    best, name, size = min(tries, key=lambda tried: round(tried[0], 2))
    mistake = ""
    remarks = []
    if own > _GROSS and best < min(_FITS, own / _BETTER):
        mistake = ", and ".join(text for text in (name, _size_text(size, k)) if text)
    elif omega > _LONGEST:
        remarks.append(
            f"the table begins at {omega:.3g} rad/s, waves of {2.0 * math.pi / k:.0f} m: too short "
            "for the check of long waves to say much"
        )
    elif own > _DOUBTFUL:
        remarks.append(
            f"at {omega:.3g} rad/s the motions are not those of a free-floating vessel in long "
            f"waves (mean error {own:.2f}), and no usual mistake of convention explains it"
        )
    elif scale != 1.0:
        remarks.append(_size_text(scale, k))
    return LongWaveCheck(
        omega=omega,
        wave_length=2.0 * math.pi / k,
        rows=_rows(raos, found, wanted, weights),
        error=own,
        mistake=mistake,
        remarks=tuple(remarks),
    )


def _limits(raos: VesselRaos, k: float) -> ComplexArray:
    """Return the limits of surge, sway, heave, roll/k and pitch/k (h, 5)."""
    c, s = np.cos(raos.heading), np.sin(raos.heading)
    sweep = 1.0 if math.isinf(raos.depth) else 1.0 / math.tanh(k * raos.depth)
    return np.stack(
        [-1j * sweep * c, -1j * sweep * s, np.ones_like(c) + 0j, -1j * s, 1j * c], axis=-1
    )


def _angle_scale(found: ComplexArray, wanted: ComplexArray, weights: FloatArray) -> float:
    """Return how many times too large the angles are, 1 if they are about right.

    Pitch tells it, as roll may be near its resonance; but roll must not contradict.
    """
    ratios = []
    for mode in (4, 3):
        use = weights[:, mode] > 0.0
        if np.any(use):
            ratios.append(float(np.median(np.abs(found[use, mode] / wanted[use, mode]))))
    if not ratios or min(ratios) <= 0.0:
        return 1.0
    agree = abs(math.log(ratios[0] / ratios[-1])) < math.log(_AGREE)
    wrong = ratios[0] > _AGREE or _within(1.0 / ratios[0], _DEGREES)
    return ratios[0] if agree and wrong else 1.0


def _error(tried: ComplexArray, wanted: ComplexArray, weights: FloatArray, size: float) -> float:
    """Return the weighted mean distance from the limits, angles divided by `size`."""
    scaled = tried.copy()
    scaled[:, 3:] /= size
    ratio = np.divide(scaled, wanted, out=np.ones_like(scaled), where=weights > 0.0)
    # Mistakes are in the phase; an amplitude of two, near a resonance, is none.
    softened = np.abs(ratio) ** _SOFT * np.exp(1j * np.angle(ratio))
    away = np.minimum(np.abs(softened - 1.0), _WORST)
    # Each motion counts once, however many headings tell of it.
    per = weights.sum(axis=0)
    kept = per > 0.0
    mean = (away * weights).sum(axis=0)[kept] / per[kept]
    share = _WEIGHTS[kept]
    return float((mean * share).sum() / share.sum())


def _within(value: float, limits: tuple[float, float]) -> bool:
    return limits[0] < value < limits[1]


def _size_text(size: float, k: float) -> str:
    if size == 1.0:
        return ""
    if _within(size, _DEGREES):
        return f"angles in degrees per metre (they are {size:.3g} times the wave slope)"
    if _within(1.0 / size, _DEGREES):
        return f"angles in radians taken for degrees (they are {size:.3g} times the wave slope)"
    if 0.5 < size * k < 2.0:
        return (
            "angles over the wave slope instead of per metre (or over a length of "
            f"{size:.3g} m, WAMIT's ULEN)"
        )
    return (
        f"angles {size:.3g} times the wave slope: made non-dimensional by a length of {size:.3g} m "
        "(WAMIT's ULEN)?"
    )


def _rows(
    raos: VesselRaos, found: ComplexArray, wanted: ComplexArray, weights: FloatArray
) -> tuple[LongWaveRow, ...]:
    """Return the motions that matter at the headings nearest 0, 45, .. 180 deg."""
    names = ("surge", "sway", "heave", "roll", "pitch")
    rows = []
    seen = set()
    for degrees in (0.0, 45.0, 90.0, 135.0, 180.0):
        away = np.angle(np.exp(1j * (raos.heading - math.radians(degrees))))
        at = int(np.argmin(np.abs(away)))
        if at in seen or abs(away[at]) > math.radians(22.6):
            continue
        seen.add(at)
        rows += [
            LongWaveRow(
                motion=name,
                heading_deg=float(np.degrees(raos.heading[at])),
                found=complex(found[at, i]),
                expected=complex(wanted[at, i]),
            )
            for i, name in enumerate(names)
            if weights[at, i] > 0.0
        ]
    return tuple(rows)
