"""A run's motion of the winch as time series for programs of hydrodynamics.

::

    haul and motor speed at samples --> one cubic an interval --> length, its rate --> files
    heave and heave rate of the hook -> one cubic an interval --> heave, its rate  -->

Between two samples the haul is the cubic through both values with both speeds (Hermite), so that
the rate is the derivative of the length at every time, and whoever integrates the one finds the
other.  Hauling in is positive in a run; here **paying out is positive**::

    payout = -X,    length = L_0 - X,    at the drum: payout = -falls X

with the haul X over the falls: the length is that of each of the falls, from the crane's tip to the
load, of a rope that stands for all of them.  Where the drum has changed its layer, so that motor
speed times radius is not the rate of the haul, the slopes are those of a spline through the haul.

Sources: for OrcaFlex, Orcina's help on time history data and on line feeding (paying out, hauling
in), www.orcina.com/webhelp/OrcaFlex; for MoorDyn, `MoorDyn_SetLineUnstretchedLength` and
`MoorDyn_SetLineUnstretchedLengthVel` of MoorDyn-C 2 (source/Line.h), and the inputs DeltaL and
DeltaLdot of the Fortran module in OpenFAST.  MoorDyn-C 2.7.2 was run once with these files, the
others were not.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from models.basics import FloatArray, InputError, check_range, pick
from models.run import Run

from .exported import Exported

SERIES_KINDS: tuple[str, ...] = ("orcaflex", "moordyn", "csv")
"""Programs, and plain CSV, that a run's motion can be written for."""

_AGREES = 0.05  # of the way of a sample at the fastest: haul and motor speed belong together
_PLACES = 2000  # times at which a file is looked at between its rows
_EPSILON = 1e-6  # of an interval, over which a length is differenced
TOLERANCE = 1e-6
"""Largest difference of rate and derivative, over the largest rate, that counts as none."""


@dataclass(frozen=True, kw_only=True, eq=False)
class WinchMotion:
    """A winch's motion and its hook's, continuous in time; `winch_motion` makes it of a run."""

    start: float  #: First time [s].
    end: float  #: Last time [s].
    initial_length: float  #: L_0 of each fall, at rest [m].
    falls: int  #: Parallel parts of rope.
    by_speed: bool  #: Whether the slopes are the motor's speed; else those of a spline.
    haul: CubicHermiteSpline  #: X over time [m].
    heave: CubicHermiteSpline  #: Z of the hook over time, up positive [m].

    def length(self, time: FloatArray) -> FloatArray:
        """Return the length of each fall [m], (n,)."""
        return np.asarray(self.initial_length - self.haul(time))

    def payout(self, time: FloatArray) -> FloatArray:
        """Return the rope paid out over the falls [m], (n,)."""
        return np.asarray(-self.haul(time))

    def payout_rate(self, time: FloatArray) -> FloatArray:
        """Return the rate of length and payout [m/s], (n,)."""
        return np.asarray(-self.haul(time, 1))


def winch_motion(run: Run, *, length: float | None = None) -> WinchMotion:
    """Return the motion of the winch in a run.

    Parameters
    ----------
    run
        A run, as of `stillhook.simulate`.
    length
        L_0, length of each fall where the haul is zero [m]; by default the rope's of the case.

    Raises
    ------
    InputError
        If the run has fewer than two samples, or a number that is none, as where it diverged; or
        the length is not positive, or less than what is hauled in.
    """
    case, time = run.case, run.time
    initial = case.rope.length if length is None else length
    check_range("series", "length", initial, low=0.0, unit="m", open_low=True)
    names = ("drum.haul", "motor.speed", "hook.heave", "hook.heave_rate")
    haul, speed, heave, heave_rate = (run[name] for name in names)
    if time.size < 2:
        raise InputError("series: the run must have two samples at least")
    if not np.isfinite([haul, speed, heave, heave_rate]).all():
        raise InputError(f"series: the run has samples without numbers: it is {run.status}")
    if haul.max() >= initial:
        raise InputError(
            f"series: {haul.max():.4g} m are hauled in of a rope of {initial:.4g} m: "
            "say how long it is, length=..."
        )
    rate: FloatArray = case.haul_radius / case.winch.gearbox.ratio * speed
    steps = np.diff(time)
    off = np.diff(haul) - 0.5 * steps * (rate[:-1] + rate[1:])
    fastest = float(np.abs(rate).max())
    by_speed = bool(np.abs(off).max() <= _AGREES * fastest * float(steps.max()) + 1e-12)
    if not by_speed:
        rate = CubicSpline(time, haul)(time, 1).astype(np.float64, copy=False)
    return WinchMotion(
        start=float(time[0]),
        end=float(time[-1]),
        initial_length=float(initial),
        falls=case.rope.falls,
        by_speed=by_speed,
        haul=CubicHermiteSpline(time, haul, rate),
        heave=CubicHermiteSpline(time, heave, heave_rate),
    )


def as_series(
    run: Run, kind: str, *, step: float | None = None, length: float | None = None
) -> Exported:
    """Return a run's motion of winch and hook as files for a program.

    Parameters
    ----------
    run
        A run, as of `stillhook.simulate`.
    kind
        One of `SERIES_KINDS`.
    step
        Time between rows [s]; by default those of the run.
    length
        L_0, length of each fall where the haul is zero [m]; by default the rope's of the case.

    Raises
    ------
    InputError
        If there is no such kind, a number is out of its range, or the run has none.
    """
    pick("series", "kind", SERIES_KINDS, [kind])
    motion = winch_motion(run, length=length)
    time = run.time
    if step is not None:
        check_range("series", "step", step, low=1e-4, high=0.5 * (motion.end - motion.start))
        count = math.floor((motion.end - motion.start) / step + 1e-9) + 1
        time = np.asarray(motion.start + step * np.arange(count), dtype=np.float64)
    files, title, about = {"orcaflex": _orcaflex, "moordyn": _moordyn, "csv": _csv}[kind](
        motion, time
    )
    said, proved = _proof(motion, files, kind)
    whence = f"{run.case.name}, {run.controller}, {run.scenario}, seed {run.seed}"
    slopes = _BY_SPEED if motion.by_speed else _BY_SPLINE
    return Exported(
        kind=kind,
        title=title,
        files=files,
        about=f"The run: {whence}.\n\n{about}\n{_SIGNS.format(falls=motion.falls)}\n{slopes}\n",
        proof=said,
        proved=proved,
    )


_Made = tuple[dict[str, str | bytes], str, str]


def _orcaflex(motion: WinchMotion, time: FloatArray) -> _Made:
    winch = {
        "Time": time,
        "Payout": motion.payout(time),
        "Payout rate": motion.payout_rate(time),
        "Length": motion.length(time),
    }
    hook = {"Time": time, "Heave": motion.heave(time), "Heave rate": motion.heave(time, 1)}
    files: dict[str, str | bytes] = {
        "orcaflex_winch.txt": _table(winch, "\t"),
        "orcaflex_hook.txt": _table(hook, "\t"),
    }
    return files, "Winch and hook for OrcaFlex", _ABOUT_ORCAFLEX


def _moordyn(motion: WinchMotion, time: FloatArray) -> _Made:
    length = motion.length(time)
    columns = {
        "time_s": time,
        "L_m": length,
        "Ldot_m_per_s": motion.payout_rate(time),
        "DeltaL_m": motion.payout(time),
    }
    text = "# " + _table(columns, " ")
    hook = {
        "time_s": time,
        "heave_m": motion.heave(time),
        "heave_rate_m_per_s": motion.heave(time, 1),
    }
    files: dict[str, str | bytes] = {
        "moordyn_line.txt": text,
        "moordyn_hook.txt": "# " + _table(hook, " "),
    }
    return files, "Line length for MoorDyn", _ABOUT_MOORDYN


def _csv(motion: WinchMotion, time: FloatArray) -> _Made:
    columns = {
        "time [s]": time,
        "payout [m]": motion.payout(time),
        "payout rate [m/s]": motion.payout_rate(time),
        "length [m]": motion.length(time),
        "payout at the drum [m]": motion.falls * motion.payout(time),
        "heave of the hook [m]": motion.heave(time),
        "heave rate of the hook [m/s]": motion.heave(time, 1),
    }
    return {"winch.csv": _table(columns, ",")}, "Winch and hook as CSV", _ABOUT_CSV


def _table(columns: Mapping[str, FloatArray], between: str) -> str:
    """Return a line of names, then rows of numbers that read back to the last bit."""
    rows = np.column_stack(list(columns.values())).tolist()
    lines = [between.join(columns), *(between.join(map(repr, row)) for row in rows)]
    return "\n".join(lines) + "\n"


def read_table(text: str, between: str) -> dict[str, FloatArray]:
    """Return the columns of a table of these files by name."""
    head, *rows = text.removeprefix("# ").splitlines()
    values = np.array([[float(cell) for cell in row.split(between)] for row in rows])
    return dict(zip(head.split(between), values.T, strict=True))


# File, separator, and names of time, value and rate.
_PAIRS: Mapping[str, Sequence[tuple[str, str, str, str, str]]] = {
    "orcaflex": (
        ("orcaflex_winch.txt", "\t", "Time", "Length", "Payout rate"),
        ("orcaflex_winch.txt", "\t", "Time", "Payout", "Payout rate"),
        ("orcaflex_hook.txt", "\t", "Time", "Heave", "Heave rate"),
    ),
    "moordyn": (
        ("moordyn_line.txt", " ", "time_s", "L_m", "Ldot_m_per_s"),
        ("moordyn_line.txt", " ", "time_s", "DeltaL_m", "Ldot_m_per_s"),
        ("moordyn_hook.txt", " ", "time_s", "heave_m", "heave_rate_m_per_s"),
    ),
    "csv": (
        ("winch.csv", ",", "time [s]", "length [m]", "payout rate [m/s]"),
        ("winch.csv", ",", "time [s]", "payout [m]", "payout rate [m/s]"),
        ("winch.csv", ",", "time [s]", "heave of the hook [m]", "heave rate of the hook [m/s]"),
    ),
}


def _proof(motion: WinchMotion, files: Mapping[str, str | bytes], kind: str) -> tuple[str, bool]:
    """Return what the files, read back, have shown of lengths and rates, and if they agree."""
    rng = np.random.default_rng(0)
    within, between = 0.0, 0.0
    for file, mark, at, value, rate in _PAIRS[kind]:
        table = read_table(str(files[file]), mark)
        time, values, rates = table[at], table[value], table[rate]
        own = motion.heave if "eave" in value else motion.haul
        sign = 1.0 if "eave" in value else -1.0
        most = float(np.abs(rates).max()) or 1.0
        # The rates told, against the difference of the length about each row.
        h = _EPSILON * float(np.diff(time).min())
        inner = time[(time > motion.start + h) & (time < motion.end - h)]
        slopes = sign * (own(inner + h) - own(inner - h)) / (2.0 * h)
        kept = np.isin(time, inner)
        within = max(within, float(np.abs(slopes - rates[kept]).max()) / most)
        # And what a reader makes of the rows, between them, against the run.
        again = CubicHermiteSpline(time, values, rates)
        places = rng.uniform(time[0], time[-1], _PLACES)
        off = np.abs(again(places, 1) - sign * own(places, 1)).max()
        between = max(between, float(off) / most)
    said = (
        f"The files were read back: each rate is the derivative of its length to {within:.1e} of "
        f"the fastest, and the cubic through the rows moves as the run does to {between:.1e} of it."
    )
    return said, bool(within <= TOLERANCE)


_SIGNS = """\
Paying out is positive. Payout and length are over the falls, of which there are {falls}: the \
length is that of each, from the crane's tip to the load, for a line that stands for all of \
them; the drum pays out {falls} times as much. Length is payout and that at rest. Heave of the \
hook is up positive. SI units.
"""
_BY_SPEED = (
    "Between two rows the length is the cubic through both lengths with both rates; in the run the "
    "rate is the motor's speed times the drum's radius over the gear's ratio."
)
_BY_SPLINE = (
    "The drum has changed its layer in this run: lengths are a cubic spline through those of the "
    "run, and the rates its derivative."
)
_ABOUT_ORCAFLEX = """\
`orcaflex_winch.txt` and `orcaflex_hook.txt` are tables of text with tabs and a line of names, as \
OrcaFlex's time histories are; it has not been opened there. Payout, length or payout rate of a \
winch, or the payout rate of a line that is fed, is a value over time: give the column that the \
data item asks for. Take no rate together with a length: either makes the other.
"""
_ABOUT_MOORDYN = """\
`moordyn_line.txt` has the unstretched length of a line, its rate and the difference from rest; \
`moordyn_hook.txt` is the motion of the point that the line hangs on. MoorDyn takes length and \
rate before each of its steps, over which it integrates the rate (MoorDyn-C 2.7.2 in steps of \
20 ms: its length after each was the one told to 0.1 mm):

```python
import numpy as np, moordyn
from scipy.interpolate import CubicHermiteSpline
t, L, Ldot = np.loadtxt("moordyn_line.txt", unpack=True, usecols=(0, 1, 2))
length = CubicHermiteSpline(t, L, Ldot)

def set_length(line, time):
    moordyn.SetLineUnstretchedLength(line, float(length(time)))
    moordyn.SetLineUnstretchedLengthVel(line, float(length(time, 1)))
```

In OpenFAST the Fortran module takes the difference and the rate as DeltaL and DeltaLdot of the \
line's control channel.
"""
_ABOUT_CSV = "`winch.csv` is plain CSV with the unit of each column in its header.\n"
