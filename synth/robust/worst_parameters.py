"""Least errors of a design's world that make its loop unstable: `robustness`.

    design + ranges -> boxes of growing size, their corners and faces -> the first that holds an
    unstable loop -> nearer ones looked for around it -> the true plant there, by other code
                    -> random draws inside -> Robustness

The answer is a factor on the ranges: at `found` times them there is a combination of values at
which the loop is unstable, and a search over corners and faces saw none nearer.  That is a search
over real parameters and exact delays, and no proof; the draws say how sure it is.  All loops are
closed by the engine of sweeps.  Errors of the gains alone have a radius that is exact: it stands
beside.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

from models.basics import (
    BoolArray,
    FloatArray,
    InputError,
    Share,
    check_range,
    one_thread,
    parse_quantity,
    share,
    shows_progress,
)
from models.sensing import sensed_plant
from models.spread import DRAG, GAINS, Samples, Spread, Uniform, field_of

from ..design import Design
from ..loop import Margins, closed_loop_poles
from ..search import Progress
from ..sweeps import FrequencyEngine
from ..verify import LawMatrices, winding_of_plant
from .perturbation import GainRadius, gain_radius

FURTHEST = 20.0  # times the ranges: beyond it nothing is asked
_LEVELS = np.geomspace(0.02, FURTHEST, 60)  # sizes of the boxes that are looked at
_POINTS = 8  # logarithm to base 2 of the points on the faces of a box
_WIDTHS = (1.0, 0.3, 0.1, 0.03, 0.01, 0.003)  # of what is looked at around the nearest, by turns
_HALVINGS = 40
_NEARER = 1e-6  # relative, from which a nearer one counts
_LEAST = 1e-3  # of its value, below which nothing falls that cannot be negative
_PAST = 1e-3  # relative step beyond the boundary, at which the true plant has to be unstable
_INSIDE = 0.999  # of the factor found, within which draws are made
_PADE = 8


@dataclass(frozen=True, kw_only=True, eq=False)
class Robustness:
    """What uncertain parameters do to a design's stability."""

    #: What is uncertain, by path: least and largest value.
    ranges: Mapping[str, tuple[float, float]]
    #: The least factor on the ranges at which unstable parameters were found; infinity if there
    #: were none up to `asked`.
    found: float
    #: The largest factor looked at: `FURTHEST`, or less where values beyond it make no case.
    asked: float
    critical: Mapping[str, float]  #: Those parameters by path; empty if none were found.
    omega: float  #: Where the pole crosses the axis [rad/s].
    growth: float  #: Its real part just beyond [1/s].
    #: Whether the true plant, built anew and with exact delays, is unstable just beyond them, by
    #: its poles and by the winding number; None if none were found.
    confirmed: bool | None
    #: Share of random draws within the least of `found` and 1 times the ranges, every other one in
    #: a corner, that is stable; None without draws.
    stable: Share | None
    payload_rms: float  #: Of the design [m].
    worst_rms: float  #: The largest of the stable draws [m].
    #: How far the gains themselves may be off, exactly; None where the loop is not affine in them.
    gain_radius: GainRadius | None
    margins: Margins  #: Of the nominal loop.

    @property
    def ok(self) -> bool:
        """Whether nothing unstable was found over all of the ranges."""
        return self.found > 1.0 and (self.stable is None or self.stable.value == 1.0)

    @property
    def status(self) -> str:
        """The sentence for the user."""
        if self.found <= 1.0:
            return f"unstable within the ranges, from {self.found:.3g} times them on"
        if not self.ok:
            assert self.stable is not None
            lost = self.stable.total - self.stable.count
            return f"{lost} of {self.stable.total} random draws in the ranges are unstable"
        if math.isinf(self.found):
            return f"stable over the ranges, and up to {self.asked:.3g} times them"
        return f"stable over the ranges; the nearest unstable are {self.found:.3g} times as far off"

    def __str__(self) -> str:
        """Return a small tree."""
        lines = [f"Robustness: {self.status}"]
        lines += [f"├ {path}: {low:.6g} to {high:.6g}" for path, (low, high) in self.ranges.items()]
        if self.critical:
            worst = ", ".join(f"{path} = {value:.5g}" for path, value in self.critical.items())
            sure = "confirmed" if self.confirmed else "NOT confirmed"
            lines.append(f"├ at {self.found:.4g} times the ranges a pole is on the axis: {worst}")
            lines.append(
                f"├ {sure} on the true plant: grows with {self.growth:.2g} 1/s beyond it, "
                f"at {self.omega:.4g} rad/s"
            )
        if self.stable is not None:
            lines.append(
                f"├ {self.stable.count} of {self.stable.total} random draws inside are stable "
                f"(95 % confidence: at least {100.0 * self.stable.low:.2f} %)"
            )
            rise = 100.0 * (self.worst_rms / self.payload_rms - 1.0)
            lines.append(
                f"├ payload {1e3 * self.payload_rms:.4g} mm rms, at most "
                f"{1e3 * self.worst_rms:.4g} mm among them ({rise:+.2g} %)"
            )
        if self.gain_radius is not None:
            lines.append(f"├ gains: {self.gain_radius}")
        m = self.margins
        lines.append(
            f"└ disk margin {m.disk:.3g}, gain x {m.gain_down:.3g} to {m.most_gain}, "
            f"further delay {m.delay_text}"
        )
        return "\n".join(lines)


@one_thread()
@shows_progress("looking for what hurts most")
def robustness(
    design: Design,
    uncertainty: Mapping[str, float | str],
    *,
    draws: int = 1000,
    seed: int = 0,
    progress: Progress | None = None,
) -> Robustness:
    """Return how far the numbers about a design may be off at once before it is unstable.

    Parameters
    ----------
    design
        A stable design.
    uncertainty
        By dotted path of the case (or `payload`, `stiffness`, `delay`, ..), ``gains.`` and the
        name of a gain, ``gains`` for all in which the loop is affine, or ``drag`` for the linear
        drag coefficient of the design, which is held if it is not named: a share of the value as
        0.3 for 30 % either way, or a text with its unit as "20 ms" either way.  As in a family,
        added mass and submerged weight grow with ``payload.mass`` unless they are uncertain
        themselves.
    draws
        Random draws to check the answer with; 0 for none.
    seed
        Of the search and the draws.
    progress
        Called as progress(stage, done, total).

    Raises
    ------
    InputError
        If the design is unstable, or a range is not valid.
    """
    check_range("robustness", "draws", draws, low=0)
    if design.margins is None:
        raise InputError("robustness: the design must be stable")
    named, radius = dict(uncertainty), None
    try:
        values = design.question.values(design.parameters)
        radius = gain_radius(design.assessment.plant, design.question.law, values)
    except InputError:  # several inputs, or a structure that is not affine in its gains
        if "gains" in named:
            raise
    if radius is not None and "gains" in named:
        width = named.pop("gains")
        named |= {f"{GAINS}{name}": width for name in radius.names}
    tell = progress or (lambda stage, done, total: None)
    box = _Box(design, named)
    found, worst, asked = _nearest(box, seed, tell)
    confirmed, pole = None, complex(math.nan, math.nan)
    if worst is not None:
        confirmed, pole = _beyond(box, (1.0 + _PAST) * found * worst)
    inside = np.random.default_rng(seed).uniform(-1.0, 1.0, (draws, len(box.paths)))
    # Every other one in a corner, where it hurts more often than inside.
    inside[1::2] = np.sign(inside[1::2])
    drawn = FrequencyEngine(design, box.spread, metrics=["payload_rms"]).evaluate(
        box.rows(_INSIDE * min(found, 1.0) * inside),
        lambda _, done, total: tell("draws", done, total),
    )
    stable = drawn["stable"].astype(bool)
    return Robustness(
        ranges=box.ranges,
        found=found,
        asked=asked,
        critical={} if worst is None else box.named(found * worst),
        omega=abs(pole.imag),
        growth=pole.real,
        confirmed=confirmed,
        stable=share(int(stable.sum()), draws) if draws else None,
        payload_rms=float(design.payload_rms),
        worst_rms=float(drawn["payload_rms"][stable].max(initial=0.0)),
        gain_radius=radius,
        margins=design.margins,
    )


class _Box:
    """The ranges as a box: a point has a number from -1 to 1 for each, more beyond its range.

    Raises InputError if there is nothing, a path is unknown or given twice, or a width makes no
    sense.
    """

    def __init__(self, design: Design, uncertainty: Mapping[str, float | str]) -> None:
        if not uncertainty:
            raise InputError("robustness: uncertainty must name what may be off, got nothing")
        fields, halves = [], []
        for name, width in uncertainty.items():
            if not isinstance(width, str):
                what = f"uncertainty[{name}]"
                check_range("robustness", what, width, low=0.0, high=1.0, open_low=True)
            try:
                field = field_of(design.sea_case, name, design.parameters, design.drag)
                half = (
                    parse_quantity(width, field.kind)
                    if isinstance(width, str)
                    else width * abs(field.nominal)
                )
            except InputError as error:
                raise InputError(f"robustness: {name}: {error}") from None
            if half <= 0.0:
                raise InputError(
                    f"robustness: {field.path} is {field.nominal:g} in this case, so a share of it "
                    'is nothing; give a value with its unit, as "20 ms"'
                )
            fields.append(field)
            halves.append(half)
        self.design = design
        self.paths = [field.path for field in fields]
        if len(set(self.paths)) < len(fields):
            raise InputError("robustness: a path is given twice")
        self._nominal, self._halves = np.array([f.nominal for f in fields]), np.array(halves)
        # What cannot be negative does not vanish either.
        least = [max(f.low, _LEAST * f.nominal) if f.low >= 0.0 else f.low for f in fields]
        self._limits = np.array(least), np.array([f.high for f in fields])
        one = np.ones(len(fields))
        low, high = self._values(-one).tolist(), self._values(one).tolist()
        self.ranges = dict(zip(self.paths, zip(low, high, strict=True), strict=True))
        drag = {} if DRAG in self.paths else {DRAG: Samples([design.drag])}
        own = {path: Uniform(*ends) for path, ends in self.ranges.items()}
        self.spread = Spread({**own, **drag}).on(design.sea_case, design.parameters, design.drag)

    def _values(self, points: FloatArray) -> FloatArray:
        return np.asarray(np.clip(self._nominal + points * self._halves, *self._limits))

    def rows(self, points: FloatArray) -> FloatArray:
        """Return the rows of the spread at points, (n, p) -> (n, d): held drag comes last."""
        held = np.full((len(points), len(self.spread.paths) - len(self.paths)), self.design.drag)
        return np.hstack([self._values(points), held])

    def named(self, point: FloatArray) -> dict[str, float]:
        """Return the values at a point by path."""
        return dict(zip(self.paths, self._values(point).tolist(), strict=True))


def _nearest(box: _Box, seed: int, tell: Progress) -> tuple[float, FloatArray | None, float]:
    """Return the least factor found, the point of the box that it is for, and the last one asked.

    Infinity and None stand for nothing found.
    """
    engine = FrequencyEngine(box.design, box.spread, metrics=[])

    def unstable(points: FloatArray) -> BoolArray:
        return ~engine.evaluate(box.rows(points))["stable"].astype(bool)

    def first(points: FloatArray, high: float) -> tuple[float, FloatArray]:
        """Return the least factor of points that are unstable at `high` times, and whose it is."""
        low = 0.0
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            out = unstable(middle * points)
            if out.any():
                points, high = points[out], middle
            else:
                low = middle
        return high, points[0]

    cube = 2.0 * qmc.Sobol(len(box.paths), seed=seed).random_base2(_POINTS) - 1.0
    faces = cube / np.abs(cube).max(axis=1, keepdims=True)
    points = np.vstack([np.unique(np.sign(cube), axis=0), faces])
    asked = 0.0
    for k, level in enumerate(_LEVELS):
        tell("growing boxes", k, len(_LEVELS))
        try:
            out = unstable(level * points)
        except InputError:  # values so far off make no case
            return math.inf, None, asked
        asked = float(level)
        if out.any():
            break
    else:
        return math.inf, None, asked
    found, worst = first(points[out], asked)
    rng = np.random.default_rng(seed)
    for k, width in enumerate(_WIDTHS):
        tell("nearer ones", k, len(_WIDTHS))
        around = np.clip(worst + width * rng.uniform(-1.0, 1.0, points.shape), -1.0, 1.0)
        out = unstable((1.0 - _NEARER) * found * around)
        if out.any():
            found, worst = first(around[out], (1.0 - _NEARER) * found)
    return found, worst, asked


def _beyond(box: _Box, point: FloatArray) -> tuple[bool, complex]:
    """Return whether the true plant at a point is unstable, by poles and winding number.

    Its rightmost pole comes with it.
    """
    design, row = box.design, box.rows(point[None])[0]
    drag = box.spread.drag(row)
    assert drag is not None
    controller = design.question.controller({**design.parameters, **box.spread.gains(row)})
    plant = sensed_plant(box.spread.case_at(row), masses=design.masses, drag=drag)
    plant = plant.select(measurements=controller.measurements, outputs=())
    poles = closed_loop_poles(plant.without_delays(_PADE), controller)
    pole = complex(poles[np.argmax(poles.real)])
    winding = winding_of_plant(plant, LawMatrices.of(controller, plant), poles)
    return pole.real > 0.0 and winding.unstable > 0, pole
