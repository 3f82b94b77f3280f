r"""Conventions of RAO files, and the one conversion out of them: `Convention`.

Every program has its own; what one may mean by "roll 1.2, phase 90, heading 30" is told by the
thirteen fields of a :class:`Convention`.  A reader says which holds for its file, and
:meth:`Convention.values`, :meth:`Convention.omega` and :meth:`Convention.directions` convert; this
is the only place in the toolkit where a sign, a conjugate or a pi/180 is applied to a RAO.

With the phase :math:`\varphi` as a lead in radians, the operator in the project's convention is

.. math:: H = s A \, e^{i (\varphi + \varphi_0)}, \qquad
          \varphi_0 = 0, -\pi, +\pi/2, -\pi/2

for phases relative to the wave's crest, trough, zero up-crossing and zero down-crossing, and
:math:`s = \pm 1` for the positive direction of the motion.  The names are those of OrcaFlex
(Orcina, *Vessel types: Conventions*), which states them all.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from ..basics import ComplexArray, FloatArray, InputError, check_choice

CHOICES: dict[str, tuple[str, ...]] = {
    "waves": ("frequency (rad/s)", "frequency (Hz)", "period (s)"),
    "phase": ("leads", "lags"),
    "phase_unit": ("degrees", "radians"),
    "phase_relative_to": ("crest", "trough", "zero up-crossing", "zero down-crossing"),
    "rotations": ("rad/m", "deg/m", "max wave slope", "wave steepness"),
    "surge": ("forward", "aft"),
    "sway": ("port", "starboard"),
    "heave": ("up", "down"),
    "roll": ("starboard down", "starboard up"),
    "pitch": ("bow down", "bow up"),
    "yaw": ("bow to port", "bow to starboard"),
    "headings": ("towards", "from"),
    "turning": ("counter-clockwise", "clockwise"),
}
"""What each field of a :class:`Convention` may be; the first is the project's own."""

_LEAD = {"crest": 0.0, "trough": -math.pi, "zero up-crossing": 0.5 * math.pi,
         "zero down-crossing": -0.5 * math.pi}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Convention:
    """What the numbers of a RAO file mean; the defaults are the project's own convention.

    Raises InputError if a field is none of its :data:`CHOICES`.

    Examples
    --------
    >>> ned = Convention(heave="down", sway="starboard", pitch="bow up", yaw="bow to starboard",
    ...                  turning="clockwise")
    >>> ned.words()
    'sway starboard, heave down, pitch bow up, yaw bow to starboard, turning clockwise'
    """

    waves: str = "frequency (rad/s)"  #: What the first column of the table is.
    #: Of the phases: whether they lead or lag, in what unit, and relative to what of the wave.
    #: Complex numbers with the time factor e^{-i omega t} are `lags`.
    phase: str = "leads"
    phase_unit: str = "degrees"
    phase_relative_to: str = "crest"
    #: Unit of roll, pitch and yaw: per metre of wave amplitude, or over the wave's largest slope k
    #: a, or over its steepness (height over length, k a/pi).
    rotations: str = "rad/m"
    #: The positive direction of each motion.
    surge: str = "forward"
    sway: str = "port"
    heave: str = "up"
    roll: str = "starboard down"
    pitch: str = "bow down"
    yaw: str = "bow to port"
    #: Whether a heading is where the waves travel towards, or where they come from.
    headings: str = "towards"
    turning: str = "counter-clockwise"  #: Which way headings grow, seen from above.
    #: Where heading zero points, from the bow, counter-clockwise seen from above [deg].
    heading_zero: float = 0.0

    def __post_init__(self) -> None:
        """Check the choices."""
        for name, choices in CHOICES.items():
            check_choice("convention", name, getattr(self, name), choices)

    def words(self) -> str:
        """Return what differs from the project's convention, or say that nothing does."""
        own = Convention()
        found = [
            f"{item.name.replace('_', ' ')} {getattr(self, item.name)}"
            for item in fields(self)
            if getattr(self, item.name) != getattr(own, item.name)
        ]
        return ", ".join(found) if found else "the project's own convention"

    @property
    def signs(self) -> FloatArray:
        """The sign of each motion (6,)."""
        modes = ("surge", "sway", "heave", "roll", "pitch", "yaw")
        return np.array([1.0 if getattr(self, m) == CHOICES[m][0] else -1.0 for m in modes])

    def omega(self, waves: npt.ArrayLike) -> FloatArray:
        """Return the frequencies [rad/s] of the table's first column, same shape."""
        column = np.asarray(waves, dtype=np.float64)
        if self.waves == "period (s)":
            return 2.0 * math.pi / column
        return column if self.waves == "frequency (rad/s)" else 2.0 * math.pi * column

    def directions(self, headings: npt.ArrayLike) -> FloatArray:
        """Return where waves of these headings [deg] travel towards, in [0, 2 pi) [rad]."""
        turn = 1.0 if self.turning == "counter-clockwise" else -1.0
        flip = 180.0 if self.headings == "from" else 0.0
        ours = self.heading_zero + flip + turn * np.asarray(headings, dtype=np.float64)
        # Modulo in degrees: 360 is exactly 0, and 180 exactly pi.  A tiny negative angle comes
        # out as 360 itself.
        wrapped = np.mod(ours, 360.0)
        return np.radians(np.where(wrapped >= 360.0, 0.0, wrapped))

    def values(
        self, amplitude: npt.ArrayLike, phase: npt.ArrayLike, slope: npt.ArrayLike
    ) -> ComplexArray:
        """Return operators given as amplitudes and phases as in the file (..., 6).

        The wave slope per metre of amplitude, the wave number that the file's program goes by
        (...,) [rad/m], counts where rotations are over the slope or the steepness.
        """
        turn = math.pi / 180.0 if self.phase_unit == "degrees" else 1.0
        angle = np.asarray(phase, dtype=np.float64) * turn
        # The complex number as the file would write it; `complex_values` knows about lags.
        return self.complex_values(np.asarray(amplitude) * np.exp(1j * angle), slope)

    def complex_values(self, values: npt.ArrayLike, slope: npt.ArrayLike) -> ComplexArray:
        """Return operators given as complex numbers (..., 6); `slope` as in :meth:`values`."""
        found = np.asarray(values, dtype=np.complex128)
        if self.phase == "lags":
            found = np.conj(found)
        found = found * (np.exp(1j * _LEAD[self.phase_relative_to]) * self.signs)
        result: ComplexArray = found * self._rotation_units(slope)
        return result

    def _rotation_units(self, slope: npt.ArrayLike) -> FloatArray:
        """Return the factors from the file's units to m/m and rad/m (..., 6)."""
        rise = np.asarray(slope, dtype=np.float64)
        factor: dict[str, FloatArray] = {
            "rad/m": np.ones_like(rise),
            "deg/m": np.full_like(rise, math.pi / 180.0),
            "max wave slope": rise,
            "wave steepness": rise / math.pi,
        }
        angles = factor[self.rotations]
        ones = np.ones_like(angles)
        return np.stack([ones, ones, ones, angles, angles, angles], axis=-1)


def one_of(owner: str, name: str, value: object, choices: Sequence[str]) -> str:
    """Return a text that must be one of a few, whatever its capitals.

    Raises InputError if it is none of them; the owner, the name and the choices are told.
    """
    text = " ".join(str(value).split()).lower()
    for choice in choices:
        if text == choice.lower():
            return choice
    raise InputError(f"{owner}: {name} must be one of {', '.join(choices)}; got {value!r}")
