r"""Margins of a sampled loop, with every delay as long as it is.

::

    u, held over T --> plant, load cell --> late by D_i --> sampled every T --> recursion --> u
                  ^
                  broken here: L = -C(z) W(z), z = exp(i omega T)

A signal that is late by D = (n - share) T shows at a sample what the plant did a share of a sample
after an earlier one, n samples ago.  From one sample to that place the plant goes by its own matrix
exponential, so that no delay is rounded and what sampling folds is in W: the modified z-transform
(K. J. Astrom and B. Wittenmark, Computer-Controlled Systems, 3rd ed., section 2.7).  Readings that
are held between messages are the plant's rational model of that, `LinearPlant.with_held_states`.

The loop is broken between command and drive.  What the recursion hears as `drive.applied` stays
the command asked for at the sample before, as the drive is taken to follow: anti-windup is silent,
and the margins can be held against those of the continuous loop.

Poles and gain are exact for the linear plant with its rational model of held readings, and so are
M_s and the gain margins.  The delay margin is exact for further delays of whole samples; of a share
of a sample what sampling folds would differ.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from models.basics import ComplexArray, FloatArray, InputError
from models.case import Case
from models.plant import (
    MEASUREMENTS,
    Resolvent,
    Transfer,
    build_plant,
    late_hold,
    zero_order_hold,
)
from models.sensing import HEARD, Recursion

from ..loop import Margins, frequency_grid, loop_margins
from .sampling import ON_CIRCLE, WINCH, SampledLoop, sampled_loop

_APPLIED = HEARD.index("drive.applied")
_GONE = 1e-12  # size of an eigenvalue that is a delay's, which has no frequency
_REAL = 1e-9  # angle of an eigenvalue that is real
# Points of a grid: to a decade, to a turn of the latest signal by one radian, and on even places.
_PER_DECADE, _PER_RIPPLE, _FEWEST, _MOST = 100, 3, 100, 20000


@dataclass(frozen=True, kw_only=True, eq=False)
class BrokenLoop:
    """A sampled loop broken at its command."""

    loop: SampledLoop
    more_delay: float = 0.0  #: Further delay of the command [s], as of a step of co-simulation.

    def gain(self, omega: FloatArray) -> ComplexArray:
        """Return L at frequencies up to half the sampling rate [rad/s], (k,)."""
        z = np.exp(1j * np.asarray(omega, dtype=np.float64) * self.loop.sample_time)
        of_plant, of_law = self._transfers
        shown, heard = of_plant(z), of_law(z)
        if shown is None or heard is None:
            raise InputError("sampled loop: the gain is asked for at a pole of plant or controller")
        direct = [row.on_command + row.on_last / z for row in self._rows]
        late = [z ** (-row.samples) for row in self._rows]
        shown = (shown[:, :, 0].T + direct) * late if self._rows else shown[:, :, 0].T
        return np.asarray(-np.sum((heard[:, 0] + self._law[3][0]).T * shown, axis=0))

    @cached_property
    def _transfers(self) -> tuple[Transfer, Transfer]:
        """From z to what the plant's states show of a command, and the law's command of that."""
        Phi, Gamma = self._plant[:2]
        A, B, C, _ = self._law
        rows = np.array([row.on_state for row in self._rows]).reshape(-1, len(Phi))
        return Resolvent(Phi).between(rows, Gamma), Resolvent(A).between(C, B)

    @cached_property
    def poles(self) -> ComplexArray:
        """Eigenvalues of the closed loop over one sample [-]."""
        return np.asarray(np.linalg.eigvals(self.matrix), dtype=np.complex128)

    @property
    def stable(self) -> bool:
        """Whether nothing grows; a drum whose position nobody holds may stay where it is."""
        return bool(np.abs(self.poles).max() <= 1.0 + ON_CIRCLE)

    @cached_property
    def margins(self) -> Margins | None:
        """Its margins, as of `margins_of`."""
        return margins_of([self])

    @property
    def hears(self) -> bool:
        """Whether the recursion hears anything of what its command does."""
        return bool(self._rows)

    @cached_property
    def matrix(self) -> FloatArray:
        """What one sample does to (plant, last command, signals and command on their way, law)."""
        Phi, Gamma = self._plant[:2]
        A, B, C, D = self._law
        n, rows = len(Phi), self._rows
        # What all signals are late by, the command may be instead: fewer numbers are on their way.
        common = min((row.samples for row in rows), default=0)
        first = n + 1 + np.cumsum([0, *(row.samples - common for row in rows)])
        inner = int(first[-1])
        size = inner + common
        over, by, shown = np.zeros((size, size)), np.zeros((size, 1)), np.zeros((len(rows), size))
        enters = np.zeros((size, 1))  # the command that the plant sees
        enters[:n], enters[n], over[:n, :n] = Gamma, 1.0, Phi
        for i, row in enumerate(rows):
            start, end = int(first[i]), int(first[i + 1])
            if start == end and row.on_command == 0.0:
                shown[i, :n], shown[i, n] = row.on_state, row.on_last
            elif start == end:  # seen once the command is there, which is on its way itself
                shown[i, :n], shown[i, size - 1] = row.on_state, row.on_command
            else:
                over[start, :n], over[start, n], enters[start] = (
                    row.on_state,
                    row.on_last,
                    row.on_command,
                )
                over[range(start + 1, end), range(start, end - 1)] = 1.0
                shown[i, end - 1] = 1.0
        if common:
            over[:, [size - 1]] += enters
            over[range(inner + 1, size), range(inner, size - 1)] = 1.0
            by[inner] = 1.0
        else:
            by = enters
        return np.block([[over + by @ D @ shown, by @ C], [B @ shown, A]])

    @cached_property
    def _plant(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Plant and load cell over one sample, and in continuous time: (n, n), (n, 1) twice."""
        p, bandwidth = self.loop.plant, self.loop.load_cell_bandwidth
        A, B = np.asarray(p.A), np.asarray(p.B)
        if math.isfinite(bandwidth):
            row = p.outputs.index("rope.tension")
            own = np.array([[-bandwidth]])
            A = np.block([[A, np.zeros((len(A), 1))], [bandwidth * p.Cz[[row]], own]])
            B = np.vstack([B, bandwidth * p.Dz[[row]]])
        return *zero_order_hold(A, B, self.loop.sample_time), A, B

    @cached_property
    def _rows(self) -> list[_Row]:
        """What the recursion hears of the plant, signal by signal."""
        p, loop = self.loop.plant, self.loop
        J = loop.controller
        found = []
        for name in (*MEASUREMENTS, *WINCH):
            k = HEARD.index(name)
            if not (J.into_measured[:, k].any() or J.on_measured[:, k].any()):
                continue
            at_load = name in MEASUREMENTS
            names, C, D = (p.measurements, p.C, p.D) if at_load else (p.outputs, p.Cz, p.Dz)
            i = names.index(name)
            c, d = np.append(C[i], np.zeros(len(self._plant[2]) - len(p.A))), float(D[i, 0])
            if name == "rope.tension" and len(c) > len(p.A):
                c, d = np.zeros(len(c)), 0.0
                c[-1] = 1.0
            late = p.delays[i] if at_load else loop.command_delay
            found.append(self._row(k, c, d, late + self.more_delay))
        return found

    def _row(self, heard: int, c: FloatArray, d: float, late: float) -> _Row:
        """Return a signal that is so late [s], of x and u in continuous time, (n,) and a number."""
        T = self.loop.sample_time
        samples, oldest = late_hold(late / T)
        share = 1.0 - oldest if samples else 0.0
        if share * T <= ON_CIRCLE * T:  # read just before a command takes effect
            return _Row(heard=heard, samples=samples, on_state=c, on_last=d, on_command=0.0)
        Phi, Gamma = zero_order_hold(*self._plant[2:], share * T)
        on_command = d + float(c @ Gamma[:, 0])
        return _Row(
            heard=heard, samples=samples, on_state=c @ Phi, on_last=0.0, on_command=on_command
        )

    @cached_property
    def _law(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """The recursion as A, B, C, D from `_rows` to the command, whose last value is a state."""
        J, heard = self.loop.controller, [row.heard for row in self._rows]
        A = np.block(
            [
                [J.into_state, J.into_measured[:, [_APPLIED]]],
                [J.on_state, J.on_measured[:, [_APPLIED]]],
            ]
        )
        B = np.vstack([J.into_measured[:, heard], J.on_measured[:, heard]])
        return A, B, np.hstack([J.on_state, J.on_measured[:, [_APPLIED]]]), J.on_measured[:, heard]

    @cached_property
    def grid(self) -> FloatArray:
        """Frequencies dense enough to see every peak and crossing [rad/s]."""
        T = self.loop.sample_time
        top = math.pi / T
        latest = T * (1 + max((row.samples for row in self._rows), default=0))
        own = [self.poles, *(np.linalg.eigvals(M) for M in (self._plant[0], self._law[0]))]
        z = np.concatenate(own).astype(np.complex128)
        poles = np.asarray(np.log(z[np.abs(z) > _GONE]) / T, dtype=np.complex128)
        # What decays within the delays is one of their many ripples: those an even grid sees.
        slow = poles[(np.abs(poles.real) * latest < 1.0) | (np.abs(poles.imag) < _REAL / T)]
        grid = frequency_grid(slow)
        count = min(_MOST, max(_FEWEST, int(top * latest * _PER_RIPPLE)))
        even = np.concatenate(
            [
                np.geomspace(grid[0], top, int(_PER_DECADE * math.log10(top / grid[0])) + 2),
                np.linspace(top / count, top, count),
            ]
        )
        below = np.concatenate([grid, even])
        return np.append(np.unique(below[below < top * (1.0 - ON_CIRCLE)]), top)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Row:
    """A signal at a sample: of state, last command and new command so many samples ago."""

    heard: int  #: Its place in `HEARD`.
    samples: int
    on_state: FloatArray  # (n,)
    on_last: float
    on_command: float


def sampled_margins(
    case: Case,
    recursion: Recursion,
    sample_time: float,
    *,
    masses: int | None = None,
    drag: float = 0.0,
    friction: float = 0.0,
    more_delay: float = 0.0,
) -> Margins | None:
    """Return the margins of a recursion's loop on a case; None if it is unstable.

    Parameters
    ----------
    case
        The case: plant and sensors.
    recursion
        The controller, of one sample time.
    sample_time
        T [s].
    masses
        Masses along the rope; by default those of the case.
    drag
        Linear drag of the payload [N s/m].
    friction
        What losses that switch come to as viscous friction at the motor [N m s/rad].  With some,
        the margins are the worse of those with it and without, as the drum may stick or slip.
    more_delay
        Further delay of the command [s].
    """
    plant = build_plant(case, masses)
    loops = [
        BrokenLoop(
            loop=sampled_loop(case, plant, recursion, sample_time, drag=drag, friction=own),
            more_delay=more_delay,
        )
        for own in ((friction, 0.0) if friction > 0.0 else (0.0,))
    ]
    return margins_of(loops)


def margins_of(loops: Sequence[BrokenLoop]) -> Margins | None:
    """Return the margins of loops of one sample time, the worst of each; None if one is unstable.

    They go up to half the sampling rate.  The delay margin is exact for further delays of whole
    samples.  Of a loop that hears nothing of its plant L is zero, and M_s is 1.
    """
    if not all(loop.stable for loop in loops):
        return None

    def gains(omega: FloatArray) -> ComplexArray:
        return np.array([loop.gain(omega) for loop in loops])

    grid = np.unique(np.concatenate([loop.grid for loop in loops]))
    return loop_margins(gains, grid, gains(grid))
