"""`GainSchedule`: gains as smooth functions of the rope's length, and the files they go to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from models.basics import FloatArray, InputError, check_range, read_only
from models.case import Case

LENGTH = "rope.length"
KEPT_BETWEEN = 1e-3  # relative excess over a limit that counts as kept between the nodes


@dataclass(frozen=True, kw_only=True)
class SchedulePoint:
    """The schedule at one length: what it does there, and what the best gains would do [m]."""

    length: float
    payload_rms: float
    best_rms: float
    max_sensitivity: float
    use: float
    limit: str
    growth: float

    @property
    def ok(self) -> bool:
        """Whether the loop is stable and every limit is kept, to a part in a thousand."""
        return self.growth < 0.0 and self.use <= 1.0 + KEPT_BETWEEN


@dataclass(frozen=True, kw_only=True, eq=False)
class GainSchedule:
    """Gains over the rope's length.

    Attributes
    ----------
    case
        The case.
    lengths, gains
        Nodes [m], ascending (k,), and the gains there, (k, number of gains).
    names, amplifier
        Names of the gains, and the fixed gain A.
    ok, status
        Whether it holds at every length that was looked at; in words.
    points
        What it does at many lengths.
    verified
        How many lengths were checked by other code and passed, of how many.
    """

    case: Case
    lengths: FloatArray
    gains: FloatArray
    names: tuple[str, ...]
    amplifier: float = 1.0
    ok: bool = False
    status: str = ""
    points: tuple[SchedulePoint, ...] = ()
    verified: tuple[int, int] = (0, 0)

    def __post_init__(self) -> None:
        lengths = np.asarray(self.lengths, dtype=np.float64)
        gains = np.asarray(self.gains, dtype=np.float64)
        if lengths.ndim != 1 or lengths.size < 1 or gains.shape != (lengths.size, len(self.names)):
            raise InputError(
                f"gain schedule: must have one row of {len(self.names)} gains for each length, got "
                f"{gains.shape} for {lengths.shape}"
            )
        if np.any(np.diff(lengths) <= 0.0) or lengths[0] <= 0.0 or not np.isfinite(gains).all():
            raise InputError("gain schedule: lengths must ascend from above 0, gains be finite")
        object.__setattr__(self, "lengths", read_only(lengths))
        object.__setattr__(self, "gains", read_only(gains))

    def at(self, length: float) -> dict[str, float]:
        """Return the gains ``A`` and by name at a length [m].

        Raises
        ------
        InputError
            If the length lies beyond the nodes: a spline is not to be extrapolated.
        """
        low, high = float(self.lengths[0]), float(self.lengths[-1])
        check_range("gain schedule", "length", length, low=low, high=high, unit="m")
        values = blend_of(self.lengths, length) @ self.gains
        return {"A": self.amplifier, **dict(zip(self.names, map(float, values), strict=True))}

    def to_csv(self, count: int = 0) -> str:
        """Return the schedule as CSV: its nodes, or `count` lengths for a drive's own table."""
        lengths = self.lengths
        if count:
            lengths = np.geomspace(self.lengths[0], self.lengths[-1], count)
            lengths[0], lengths[-1] = self.lengths[0], self.lengths[-1]
        lines = [f"rope.length,A,{','.join(self.names)}"]
        for length in lengths:
            values = self.at(float(length)).values()
            lines.append(",".join(f"{v:.10g}" for v in (length, *values)))
        return "\n".join(lines) + "\n"

    def to_yaml(self) -> str:
        """Return the schedule as YAML; `from_yaml` reads it again."""
        from models.casefile import yaml_text

        rows = [[float(v) for v in row] for row in self.gains]
        return yaml_text(
            {
                "stillhook_schedule": 1,
                "case": self.case.name,
                "over": LENGTH,
                "interpolation": "cubic spline in log(length), linear between two nodes",
                "amplifier": float(self.amplifier),
                "lengths": [float(v) for v in self.lengths],
                "gains": {name: [r[k] for r in rows] for k, name in enumerate(self.names)},
            }
        )

    @classmethod
    def from_yaml(cls, text: str, case: Case, source: str = "schedule") -> GainSchedule:
        """Return a schedule from its YAML text; what it does has to be looked at again.

        Raises
        ------
        InputError
            If the text is not a schedule.
        """
        from models.casefile import read_yaml

        data, _ = read_yaml(text, source)
        try:
            names = tuple(data["gains"])
            return cls(
                case=case,
                lengths=np.array(data["lengths"], dtype=np.float64),
                gains=np.array([data["gains"][n] for n in names], dtype=np.float64).T,
                names=names,
                amplifier=float(data["amplifier"]),
                status="read from a file; not checked",
            )
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"{source}: is not a gain schedule: {error}") from error

    def __str__(self) -> str:
        """Return a small tree."""
        lines = [f"GainSchedule for {self.case.name}: {self.status}"]
        for length in self.lengths:
            gains = self.at(float(length))
            text = ", ".join(f"{n} = {v:.5g}" for n, v in gains.items())
            lines.append(f"├ {length:.0f} m: {text}")
        worst = max((p.payload_rms for p in self.points), default=float("nan"))
        lines.append(f"└ {len(self.points)} lengths looked at, {1e3 * worst:.4g} mm at most")
        return "\n".join(lines)


def blend_of(nodes: npt.ArrayLike, length: float) -> FloatArray:
    """Return the weights of the nodes' values in the spline at a length, (k,).

    A cubic spline over log L with the not-a-knot ends, a parabola of three nodes, a line of
    two: each is linear in its values, so it is the splines of the unit vectors.
    """
    lengths = np.asarray(nodes, dtype=np.float64)
    count = lengths.size
    if count == 1:
        return np.ones(1)
    return np.asarray(CubicSpline(np.log(lengths), np.eye(count))(np.log(length)))
