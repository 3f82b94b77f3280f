r"""Elasticities of a design: by how many per cent its figures move for one per cent of a number.

    design -> closed loop at its own drag -> slopes along every number -> Sensitivity

The gains are fixed, the world moves: rope, payload, winch, sensors and sea, and the gains
themselves.  Where the payload's drag is linearised with the response, C = q sqrt(8/pi) sigma_v, it
moves with every number too.  With theta the number and all slopes logarithmic,

.. math::

    \frac{d \ln\sigma}{d\theta} = \frac{\partial\ln\sigma}{\partial\theta}
        + \frac{\partial\ln\sigma}{\partial C}\,\frac{dC}{d\theta}, \qquad
    \frac{dC}{d\theta} = C\,\frac{\partial_\theta\ln q + \partial_\theta\ln\sigma_v}
        {1 - C\,\partial_C \ln\sigma_v}

(implicit differentiation of the fixed point).  Losses Delta that switch have such an equation too,
b = sqrt(2/pi) Delta / sigma_omega, and both are then solved together.  Figure 32 of the 1975 thesis
is the preset `Sensitivity.moved`: its gains 10 % up, one at a time, the response recomputed in
full.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from models.basics import InputError, shows_progress

from ..design import Design
from ..loop import switching_friction
from ..question import PAYLOAD
from ..search import Progress
from .differences import StepError
from .fields import numbers_of
from .fixed_design import FixedDesign
from .slopes import LoopSlopes

FIGURES = ("payload_rms", "max_sensitivity", "torque_rms", "speed_rms")
"""The figures of a design that have elasticities."""


@dataclass(frozen=True, kw_only=True)
class Elasticity:
    """How a design answers to one number."""

    path: str  #: Dotted path of the number in the case, or ``gains.`` and the name of a gain.
    #: What it is now [in its unit, SI]; of a table's column the factor 1.
    value: float
    unit: str
    #: d ln(figure) / d ln(number) [-].  An optimal design often has several peaks of |S| at its
    #: limit; then M_s has a kink, and the slope is that of the peak which moves most.
    payload_rms: float
    max_sensitivity: float
    torque_rms: float
    speed_rms: float
    #: d2 ln(payload_rms) / d ln(number)2 [-]; None where it was not asked for.
    curvature: float | None = None
    #: ``below`` or ``above`` where the number stands at the corner of a table, as a heading at a
    #: row of the vessel's operators: what a smaller or a larger value does; else empty.
    side: str = ""

    @property
    def label(self) -> str:
        """The path, with the side where there are two."""
        return f"{self.path} ({self.side} its corner)" if self.side else self.path

    def predicted(self, share: float) -> float:
        """Return the factor on the payload's rms if the number grows by a share [-]."""
        x = np.log1p(share)
        return float(np.exp(self.payload_rms * x + 0.5 * (self.curvature or 0.0) * x * x))


@dataclass(frozen=True, kw_only=True)
class Moved:
    """A design with one number moved, recomputed in full."""

    #: The number, and the share by which it was moved.
    path: str
    share: float
    payload_rms: float  #: The payload's rms then [m]; infinite if the loop is unstable.
    max_sensitivity: float  #: M_s then [-]; infinite if the loop is unstable.


@dataclass(frozen=True, kw_only=True, eq=False)
class Sensitivity:
    """What matters most to a design; `sensitivity` makes it."""

    design: Design  #: The design asked about.
    payload_rms: float  #: Its figures: [m]
    max_sensitivity: float  #: [-]
    torque_rms: float  #: [N m]
    speed_rms: float  #: [rad/s]
    #: One for every number that has any effect (two at a corner, one for each side), that with the
    #: largest effect on the payload's rms first.
    elasticities: tuple[Elasticity, ...]
    without_effect: tuple[str, ...]  #: Paths of the numbers that do nothing to these figures.
    #: Paths of numbers at which something steps, as the drum's radius does where one more turn of a
    #: thinner rope fits into a layer: they have no elasticity there.
    stepping: tuple[str, ...] = ()

    def __getitem__(self, path: str) -> Elasticity:
        """Return the elasticity of a number by its path; at a corner the larger of the two.

        Raises InputError if there is none.
        """
        for entry in self.elasticities:
            if entry.path == path:
                return entry
        raise InputError(f"sensitivity: {path!r} has no elasticity here")

    @cached_property
    def _fixed(self) -> FixedDesign:
        return FixedDesign.of(self.design)

    def moved(self, share: float = 0.1, paths: Sequence[str] | None = None) -> tuple[Moved, ...]:
        """Recompute the design with numbers, by default the gains, moved one at a time by a share.

        The thesis's Figure 32 has 0.1.

        Raises InputError if a path is unknown, or the number is at the end of its range.
        """
        wanted = [e.path for e in self.elasticities if e.path.startswith("gains.")]
        found = []
        for path in wanted if paths is None else paths:
            moved = self._fixed.with_number(path, 1.0 + share)
            if moved is None:
                raise InputError(f"sensitivity: {path} cannot be moved by {100.0 * share:g} %")
            assessment = moved.assessment()
            rms, peak = np.inf, np.inf
            if assessment is not None:
                rms, peak = assessment.sigma(PAYLOAD), assessment.max_sensitivity
            found.append(Moved(path=path, share=share, payload_rms=rms, max_sensitivity=peak))
        return tuple(found)

    def to_csv(self) -> str:
        """Return all elasticities as a table, one row for each number; zeros included."""
        lines = ["path,value,unit," + ",".join(f"dln({n})/dln(path)" for n in FIGURES)]
        lines[0] += ",d2ln(payload_rms)/dln(path)2,note"
        for e in self.elasticities:
            cells = [repr(float(getattr(e, name))) for name in ("value", *FIGURES)]
            curvature = "" if e.curvature is None else repr(e.curvature)
            note = f"corner: {e.side} its value" if e.side else ""
            lines.append(",".join([e.path, cells[0], e.unit, *cells[1:], curvature, note]))
        lines += [f"{path},,,0,0,0,0,,no effect" for path in self.without_effect]
        lines += [f"{path},,,,,,,,steps at its value" for path in self.stepping]
        return "\n".join(lines) + "\n"

    def __str__(self) -> str:
        """Return a small tree, the largest first."""
        lines = [
            f"Sensitivity of {self.design.case.name}: payload {1e3 * self.payload_rms:.4g} mm rms,"
            f" M_s {self.max_sensitivity:.3g}"
        ]
        shown = [e for e in self.elasticities if abs(e.payload_rms) >= 0.01][:12]
        lines += [f"├ {e.label}: {e.payload_rms:+.3f} % per cent" for e in shown]
        rest = len(self.elasticities) - len(shown)
        lines += [f"├ {path}: steps here, no elasticity" for path in self.stepping]
        lines.append(f"└ {rest} more with less, {len(self.without_effect)} without any")
        return "\n".join(lines)


_OUTPUTS = {"payload_rms": PAYLOAD, "torque_rms": "motor.torque", "speed_rms": "motor.speed"}
_TIE = 0.999  # peaks of this share of the largest count as tied
_SECOND = 0.01  # share of a number for its second derivative


@shows_progress("sensitivities")
def sensitivity(
    design: Design, *, second: int = 0, progress: Progress | None = None
) -> Sensitivity:
    """Return the elasticities of a design in every number of its case and in every gain.

    Parameters
    ----------
    design
        A stable design: gains, or any structure.
    second
        For how many of the numbers with the largest effect the second derivative is computed too.
    progress
        Called with a word, the numbers done and their count.

    Raises
    ------
    InputError
        If the loop is unstable.
    """
    if design.margins is None:
        raise InputError("sensitivity: the loop must be stable; an unstable one has no rms")
    fixed = FixedDesign.of(design)
    figures, found, idle, steps = _first(fixed, progress)
    found.sort(key=lambda e: -abs(e.payload_rms))
    for k in range(min(second, len(found))):
        if progress is not None:
            progress("second derivatives", k, min(second, len(found)))
        found[k] = _with_curvature(fixed, found[k])
    return Sensitivity(
        design=design,
        elasticities=tuple(found),
        without_effect=tuple(idle),
        stepping=tuple(steps),
        **figures,
    )


def _first(
    fixed: FixedDesign, progress: Progress | None, only: str | None = None
) -> tuple[dict[str, float], list[Elasticity], list[str], list[str]]:
    """Return the figures, the elasticities, the paths without effect, and those that step."""
    assessment = fixed.assessment()
    if assessment is None:
        raise InputError("sensitivity: the loop must be stable; an unstable one has no rms")
    coefficients = assessment.coefficients
    drag, friction = fixed.design.question.equivalents(coefficients)
    drag = drag if fixed.stochastic else fixed.fixed_drag
    outputs = {**_OUTPUTS, "velocity": "payload.velocity"}
    signals = tuple(outputs.values())
    nodes = assessment.quadrature(signals)
    slopes = LoopSlopes(fixed, coefficients, drag, friction, signals, nodes)
    known: list[tuple[str, float, str, str]] = []  # paths, values, units, sides
    steps: list[str] = []
    numbers = [n for n in numbers_of(fixed.case) if only is None or n.path == only]
    for k, number in enumerate(numbers):
        if progress is not None:
            progress("numbers of the case", k, len(numbers))
        try:
            sides = slopes.add_number(number)
        except StepError:
            steps.append(number.path)
        else:
            known += [(number.path, number.value, number.unit, side) for side in sides]
    for k, (name, value) in enumerate(zip(fixed.names, fixed.values, strict=True)):
        if value != 0.0 and only in (None, f"gains.{name}"):
            slopes.add_gain(k)
            known.append((f"gains.{name}", value, fixed.design.units.get(name, ""), ""))
    if not known:
        return {}, [], [], steps
    peaks = assessment.sensitivity_peaks(_TIE * assessment.max_sensitivity)
    sigmas, heights = slopes.figures(peaks)
    figures = {name: float(np.exp(sigmas[output].value[0])) for name, output in _OUTPUTS.items()}
    figures["max_sensitivity"] = assessment.max_sensitivity
    # By every variable, and last by drag and friction; then with these two moving along.
    own = {name: sigmas[output].slope[:, 0] for name, output in outputs.items()}
    moved = np.zeros((2, len(known)))
    if fixed.stochastic:
        velocity, of_drag = own["velocity"][:-2], own["velocity"][-2]
        moved[0] = drag * (velocity + slopes.quadratic_drag()) / (1.0 - drag * of_drag)
    by_torque = slopes.losses()[1]
    if friction > 0.0 or by_torque.any():
        # d b = g d Delta - b sigma^2/(sigma^2 + turn^2) d ln sigma of the capped gain b = g Delta:
        # a gear that loses nothing may begin to.
        gain = float(switching_friction(1.0, figures["speed_rms"] ** 2))
        share = 1.0 - gain**2  # [(rad/s)^2], of omega_0 = 1 rad/s
        speed = own["speed_rms"]
        matrix = np.eye(2)
        matrix[1] += friction * share * speed[-2:]
        right = np.array([np.zeros(len(known)), gain * by_torque - friction * share * speed[:-2]])
        if fixed.stochastic:
            matrix[0] -= drag * own["velocity"][-2:]
            right[0] = drag * (own["velocity"][:-2] + slopes.quadratic_drag())
        moved = np.linalg.solve(matrix, right)
    scale = np.array([value for _, value, _, _ in known])
    whole = {name: scale * (own[name][:-2] + own[name][-2:] @ moved) for name in _OUTPUTS}
    of_peaks = scale * (heights.slope[:-2, 0].T + heights.slope[-2:, 0].T @ moved)
    most = np.abs(of_peaks).argmax(axis=0)
    whole["max_sensitivity"] = of_peaks[most, np.arange(len(known))]
    found, idle = [], []
    for k, (path, value, unit, side) in enumerate(known):
        entry = {name: float(column[k]) for name, column in whole.items()}
        if any(entry.values()):
            found.append(Elasticity(path=path, value=value, unit=unit, side=side, **entry))
        elif path not in idle:
            idle.append(path)
    return figures, found, idle, steps


def _with_curvature(fixed: FixedDesign, entry: Elasticity) -> Elasticity:
    """Return the elasticity with its own slope, by differences of first derivatives.

    At a corner it has none.
    """
    if entry.side:
        return entry
    ends = []
    for sign in (1.0, -1.0):
        other = fixed.with_number(entry.path, np.exp(sign * _SECOND))
        found = _first(other, None, entry.path)[1] if other is not None else []
        ends.append(found[0].payload_rms if found else np.nan)
    curvature = float((ends[0] - ends[1]) / (2.0 * _SECOND))
    return replace(entry, curvature=curvature if np.isfinite(curvature) else None)
