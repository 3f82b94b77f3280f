"""Measured motions: a column of displacements over time, from a CSV file or from arrays.

The displacement is what counts: through its samples goes a spline of fifth degree, whose first and
second derivatives are velocity and acceleration.  Between two samples that spline is the quintic
that `models.operation.hermite` draws through displacement, velocity and acceleration at both, so
that reading the motion at any time step gives the spline itself, with derivatives that are
consistent. Measured velocities and accelerations, where the file has them, are compared with it and
are otherwise left alone.

Files are text with a header line, columns separated by commas, semicolons or tabs:

    time, displacement
    0.0, 0.132
    0.1, 0.148

A column is in SI unless its header says otherwise, as in `displacement [cm]`.  Lines that start
with `#` and further columns are passed over.  Of a vessel's six degrees of freedom the columns are
time, heave, roll and pitch, from which the motion of the crane's tip follows
(`models.operation.six_dof`).
"""

from __future__ import annotations

import csv
import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt

from ..basics import (
    FloatArray,
    InputError,
    PhysicsWarning,
    check_choice,
    check_finite,
    check_range,
    parse_quantity,
    read_only,
    read_text,
)
from .excitation import Motion
from .hermite import interpolated
from .six_dof import tip_heave

_FEWEST = 8  # samples: what a spline of fifth degree needs to be one
_SHORT = 60.0  # s: some waves
_UNEVEN = 0.05  # of the mean step that a sample may be early or late
_DISAGREEMENT = 0.2  # of a measured velocity's rms that may not be the displacement's derivative

_KINDS = {
    "time": "time",
    "displacement": "length",
    "velocity": "speed",
    "acceleration": "acceleration",
}
_SIX_DOF = {"time": "time", "heave": "length", "roll": "angle", "pitch": "angle"}


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordMotion:
    """A motion known by its displacement at equal time steps; `read` and `from_arrays` make it."""

    displacement: FloatArray  #: At the samples (n,), n >= 8 [m].
    velocity: FloatArray  #: [m/s]
    acceleration: FloatArray  #: [m/s2]
    step: float  #: Time between samples [s].
    description: str  #: Where it comes from.

    @classmethod
    def read(
        cls,
        path: str | Path,
        *,
        tip: Sequence[float] | None = None,
        exact: bool = False,
        detrend: Literal["none", "mean"] = "mean",
    ) -> RecordMotion:
        """Read a file with the columns time and displacement; velocity, acceleration may be there.

        Parameters
        ----------
        path
            The file.
        tip, exact
            Of a file with the columns time, heave, roll and pitch, as in
            `models.operation.six_dof.tip_heave`: the crane's tip moves.
        detrend
            As in `from_arrays`.

        Raises
        ------
        InputError
            If the file cannot be read, lacks a column, or holds what is no number; if its time
            steps are not equal or its samples are fewer than 8; if the tip is not three numbers.

        Warns
        -----
        PhysicsWarning
            If a measured velocity or acceleration is not the displacement's derivative, or an
            angle is so large that it is probably in degrees; if the record is shorter than a
            minute.
        """
        source = Path(path).name
        if tip is None:
            columns = read_columns(path, _KINDS, required=("time", "displacement"))
            return _long_enough(cls.from_arrays(**columns, detrend=detrend, source=source))
        motions = read_columns(path, _SIX_DOF, required=tuple(_SIX_DOF))
        time = motions.pop("time")
        z = tip_heave(**motions, tip=tip, exact=exact, source=source)
        found = _long_enough(cls.from_arrays(time, z, detrend=detrend, source=source))
        place = ", ".join(f"{value:g}" for value in tip)
        return replace(found, description=f"{found.description}, tip at ({place}) m")

    @classmethod
    def from_arrays(
        cls,
        time: npt.ArrayLike,
        displacement: npt.ArrayLike,
        velocity: npt.ArrayLike | None = None,
        acceleration: npt.ArrayLike | None = None,
        *,
        detrend: Literal["none", "mean"] = "mean",
        source: str = "record",
    ) -> RecordMotion:
        """Return the motion of a record.

        Parameters
        ----------
        time
            Times in equal steps (n,), n >= 8 [s]; the first becomes zero.
        displacement
            Displacement, up positive (n,) [m].
        velocity, acceleration
            Only compared with the displacement's derivatives (n,) [m/s], [m/s2].
        detrend
            What is taken off first: nothing or the mean.
        source
            What to call it in messages.

        Raises
        ------
        InputError
            If the arrays do not fit, hold NaN, are too short, or the time steps are not equal.

        Warns
        -----
        PhysicsWarning
            If a measured velocity or acceleration is not the displacement's derivative.
        """
        times = check_finite(source, "time", time)
        given = {"displacement": displacement, "velocity": velocity, "acceleration": acceleration}
        values = {k: check_finite(source, k, v) for k, v in given.items() if v is not None}
        for name, column in values.items():
            if column.shape != times.shape or times.ndim != 1:
                raise InputError(
                    f"{source}: {name} must have as many samples as time ({times.size}), "
                    f"got {column.size}"
                )
        step = even_step(source, times)
        check_choice(source, "detrend", detrend, ("none", "mean"))
        z = values["displacement"]
        if detrend == "mean":
            z = z - z.mean()
        from scipy.interpolate import make_interp_spline

        clock = step * np.arange(float(times.size))
        spline = make_interp_spline(clock, z, k=5)
        shown = {"velocity": spline(clock, 1), "acceleration": spline(clock, 2)}
        for name, of_spline in shown.items():
            if name in values:
                _compare(source, name, values[name], of_spline)
        return cls(
            displacement=read_only(z),
            velocity=read_only(shown["velocity"]),
            acceleration=read_only(shown["acceleration"]),
            step=step,
            description=f"{source}, {clock[-1]:.6g} s at {step:.6g} s",
        )

    @property
    def duration(self) -> float:
        """Time from the first sample to the last [s]."""
        return (self.displacement.size - 1) * self.step

    def motion(self, duration: float, step: float, seed: int) -> Motion:
        """Return the record's beginning; the seed plays no part.

        Raises InputError if the record is shorter than the duration: it is not repeated.
        """
        del seed
        last = self.displacement.size - 1
        if duration > self.duration * (1.0 + 1e-9):
            raise InputError(
                f"{self.description}: lasts {self.duration:.6g} s, less than the {duration:.6g} s "
                "of the run; a record is not repeated"
            )
        table = np.stack([self.displacement, self.velocity, self.acceleration], axis=1)

        def nodes(start: int, count: int) -> FloatArray:
            return table[start : start + count]

        return Motion(
            source=self.description,
            duration=duration,
            step=step,
            evaluate=interpolated(nodes, last, self.step, step),
        )


def _long_enough(record: RecordMotion) -> RecordMotion:
    """Return a record, with a warning if it has but a few waves."""
    if record.duration < _SHORT:
        warnings.warn(
            f"{record.description}: is shorter than {_SHORT:g} s, a few waves: statistics and "
            "extremes of a run say next to nothing",
            PhysicsWarning,
            stacklevel=3,
        )
    return record


def even_step(owner: str, time: FloatArray) -> float:
    """Return the time step of a record [s], of times (n,) [s]; rounded ones, as in files, will do.

    Raises InputError if they are fewer than 8, not ascending or not evenly spaced.
    """
    if time.size < _FEWEST:
        raise InputError(f"{owner}: time must have at least {_FEWEST} samples, got {time.size}")
    step = float(time[-1] - time[0]) / (time.size - 1)
    if step > 0.0:
        late = (time - time[0]) / step - np.arange(time.size)
        wrong = np.abs(late) > _UNEVEN
    else:
        wrong = np.concatenate([[False], np.diff(time) <= 0.0])
    if wrong.any():
        # The grid between first and last sample is off everywhere if there is one gap; what the
        # user wants to see is the gap.
        steps = np.diff(time)
        i = int(np.argmax(np.abs(steps - np.median(steps))))
        raise InputError(
            f"{owner}: time must be in equal steps, got {time[i]:.6g} s followed by "
            f"{time[i + 1]:.6g} s (sample {i + 1}), most steps are {np.median(steps):.6g} s"
        )
    return step


def read_columns(
    path: str | Path, kinds: Mapping[str, str], required: Sequence[str]
) -> dict[str, FloatArray]:
    """Read the columns of a text file by their names, in SI.

    `kinds` are those of quantities (`models.basics.units.KINDS`) by column; the required must be
    there.

    Raises InputError if the file cannot be read, lacks a column or holds what is no number; the
    line is named.
    """
    rows = [
        (number, line)
        for number, line in enumerate(read_text(path).splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not rows:
        raise InputError(f"{path}: is empty; a header line and numbers are wanted")
    delimiter = next((mark for mark in ";\t" if mark in rows[0][1]), ",")
    cells = csv.reader((line for _, line in rows), delimiter=delimiter, skipinitialspace=True)
    places: dict[str, tuple[int, float]] = {}
    for i, head in enumerate(next(cells)):
        match = re.fullmatch(r"\s*([^\[(]*?)\s*(?:[\[(](.*)[\])])?\s*", head)
        name, unit = (match[1].lower(), match[2]) if match else (head, None)
        if name in kinds:
            try:
                places[name] = i, parse_quantity(f"1 {unit}", kinds[name]) if unit else 1.0
            except InputError as error:
                raise InputError(f"{path}:{rows[0][0]}: unit of {name} {error}") from None
    missing = [name for name in required if name not in places]
    if missing:
        raise InputError(
            f"{path}: the header must name the columns {', '.join(required)}; "
            f"{', '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing, "
            f"got {rows[0][1].strip()!r:.80}"
        )
    columns: dict[str, list[float]] = {name: [] for name in places}
    for (number, _), row in zip(rows[1:], cells, strict=True):
        for name, (i, factor) in places.items():
            text = row[i].strip() if i < len(row) else ""
            columns[name].append(factor * check_range(f"{path}:{number}", name, text))
    return {name: np.array(column) for name, column in columns.items()}


def _compare(source: str, name: str, measured: FloatArray, of_spline: FloatArray) -> None:
    scale = float(np.sqrt(np.mean(measured**2)))
    off = float(np.sqrt(np.mean((measured - of_spline) ** 2)))
    if off > _DISAGREEMENT * scale:
        warnings.warn(
            f"{source}: {name} is not the displacement's derivative (their difference is "
            f"{off:.3g} rms, {name} itself {scale:.3g}): the displacement is used",
            PhysicsWarning,
            stacklevel=4,
        )
