r"""How the figures of a fixed design move with all that its loop is made of: `LoopSlopes`.

::

    number of the case -> the loop's numbers    differences of fourth order
    these, gains, drag -> figures               dual numbers, exact
    number of the sea, the vessel -> figures    differences of the integrals, of fourth order

What stands before the loop are short formulas; the loop itself and its rope's recursion are
differentiated automatically (`synth.sweeps.dual_figures`).  What moves the hook is not: a density
has kinks that move with a number (the peak of JONSWAP's, where its width changes; the fold of a
following sea), and its integral has none.  So the integral is differentiated, each time over nodes
of its own that begin new panels at the kinks, with the loop and its drag as they are.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from models.basics import FloatArray, Quadrature
from models.case import Case
from models.hook import HookMotion
from models.plant import lump_rope
from models.sensing import SwitchingShape

from ..loop import Coefficients, Dual, log
from ..sweeps import at_rest, columns_of, dual_figures
from .differences import derivative, sided_derivatives
from .fields import Number
from .fixed_design import FixedDesign

_SHAKING = ("sea.", "vessel.")  # sections that the hook's motion depends on
_STEP = 1e-3  # of the logarithm of the motor's speed


class LoopSlopes:
    """Slopes of a loop's figures in variables that are added one by one, and in its drag.

    `fixed` is the design on its case, and `known` the coefficients of the elements in its loop, as
    `FixedDesign.known`; `drag` and `friction` are the same as linear drag [N s/m] and friction of
    losses [N m s/rad].  The figures are the standard deviations of the outputs; all integrals have
    the same nodes.
    """

    def __init__(
        self,
        fixed: FixedDesign,
        known: Coefficients,
        drag: float,
        friction: float,
        outputs: Sequence[str],
        nodes: Quadrature,
    ) -> None:
        self._fixed, self._outputs, self._nodes = fixed, tuple(outputs), nodes
        self._drag, self._friction = drag, friction
        self._numbers = {**columns_of(fixed.case), "friction": np.array([friction])}
        self._there = [name for name, value in self._numbers.items() if np.isfinite(value[0])]
        self._still = replace(fixed, known=known)  # the loop, in whatever sea
        # One row for every variable.
        self._of_numbers: list[FloatArray] = []
        self._of_motion: list[FloatArray] = []  # of ln sigma of the outputs
        self._of_gains: list[FloatArray] = []

    def add_number(self, number: Number) -> tuple[str, ...]:
        """Add a number of the case; return the sides of its value that have been added.

        They are ``("",)``, or ``below`` and ``above`` where it stands at the corner of a table.

        Raises StepError if something steps at its value.
        """
        case = self._fixed.case

        def numbers(value: float) -> FloatArray:
            columns = columns_of(changed(case, number, value))
            columns["losses"] = at_rest(columns)[1]["motor.torque"]
            return np.concatenate([columns[name] for name in [*self._there, "losses"]])

        own = np.asarray(derivative(numbers, number.value), dtype=np.float64)
        no_gain = np.zeros(len(self._fixed.values))
        if not number.path.startswith(_SHAKING):
            self._add(own, np.zeros(len(self._outputs)), no_gain)
            return ("",)
        below, above = sided_derivatives(
            lambda value: self._motion(changed(case, number, value)), number.value
        )
        if np.array_equal(below, above):
            self._add(own, below, no_gain)
            return ("",)
        self._add(own, below, no_gain)
        self._add(own, above, no_gain)
        return ("below", "above")

    def add_gain(self, index: int) -> None:
        """Add a parameter of the controller."""
        unit = np.zeros(len(self._fixed.values))
        unit[index] = 1.0
        self._add(np.zeros(len(self._there) + 1), np.zeros(len(self._outputs)), unit)

    def figures(self, peaks: FloatArray) -> tuple[Mapping[str, Dual], Dual]:
        """Return ln sigma of the outputs, (1,), and ln |S| at frequencies [rad/s], (1, p).

        Their slopes are by the variables added, in that order, and by drag and friction where
        nothing else moves.
        """
        fixed = self._fixed
        by_name = dict(zip([*self._there, "losses"], np.array(self._of_numbers).T, strict=True))
        numbers = {
            name: _dual(value, by_name[name]) if name in by_name else value
            for name, value in self._numbers.items()
        }
        more = np.zeros(len(self._of_numbers))
        numbers["friction"] = Dual(self._numbers["friction"], np.append(more, [0.0, 1.0])[:, None])
        drag_slope = by_name.get("fixed_drag", np.zeros(len(self._of_numbers)))
        gains = np.array(self._of_gains).T
        hook = HookMotion.from_case(fixed.case, warn=False)
        sigmas, heights = dual_figures(
            numbers,
            fixed.law,
            fixed.design.measurements,
            [_dual(np.array([v]), own) for v, own in zip(fixed.values, gains, strict=True)],
            Dual(np.array([self._drag]), np.append(drag_slope, [1.0, 0.0])[:, None]),
            lumps=lump_rope(fixed.design.masses, fixed.case.rope.lumping),
            nodes=self._nodes,
            density=hook.density(self._nodes.omega)[None],
            outputs=self._outputs,
            peaks=peaks,
            switching=self._switching(hook, numbers["haul"]),
        )
        moved = np.vstack([*self._of_motion, np.zeros((2, len(self._outputs)))])[:, :, None]
        return {
            name: Dual(sigmas[name].value, sigmas[name].slope + moved[:, k])
            for k, name in enumerate(self._outputs)
        }, heights

    def _switching(self, hook: HookMotion, haul: Any) -> Any:
        """Return the density of losses that switch, (1, k), with its slopes."""
        if self.losses()[0] == 0.0:
            return None
        shape, speed = SwitchingShape(hook), float(hook.velocity.rms / self._numbers["haul"][0])
        found = shape.at(self._nodes.omega, speed)[None]
        if not isinstance(haul, Dual):
            return found
        ends = [shape.at(self._nodes.omega, speed * math.exp(k * _STEP)) for k in (-1.0, 1.0)]
        faster = (ends[1] - ends[0])[None] / (2.0 * _STEP)
        return found - faster * (log(haul) - log(haul.value))[:, None]

    def quadratic_drag(self) -> FloatArray:
        """Return the slopes of ln q, q of the drag force q |v| v, by the variables added, (n,)."""
        at = self._there.index("quadratic_drag")
        slopes = np.array([own[at] for own in self._of_numbers])
        return np.asarray(slopes / self._numbers["quadratic_drag"])

    def losses(self) -> tuple[float, FloatArray]:
        """Return the losses [N m], and their slopes by the variables added, (n,)."""
        torque = float(at_rest(self._numbers)[1]["motor.torque"][0])
        return torque, np.array([own[-1] for own in self._of_numbers])

    def _add(self, numbers: FloatArray, motion: FloatArray, gains: FloatArray) -> None:
        self._of_numbers.append(numbers)
        self._of_motion.append(motion)
        self._of_gains.append(gains)

    def _motion(self, shaken: Case) -> FloatArray:
        """Return ln sigma of the outputs in the sea of a case, the loop and its drag unmoved."""
        loop = self._still.assessment(shaken)
        assert loop is not None  # it is stable as it is
        return np.log([loop.sigma(output) for output in self._outputs])


def changed(case: Case, number: Number, value: float) -> Case:
    """Return the case with another value of a number; implausible values are not remarked on."""
    return case.variant(number.change(value))


def _dual(value: FloatArray, slopes: FloatArray) -> Any:
    """Return a number, (1,), with its slopes by variables, drag and friction, if it has any."""
    return Dual(value, np.append(slopes, [0.0, 0.0])[:, None]) if slopes.any() else value
