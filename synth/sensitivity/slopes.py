r"""How the figures of a fixed design move with all that its loop is made of: `LoopSlopes`.

::

    number of the case -> the loop's numbers, density of the sea    differences of fourth order
    these, gains, drag -> figures                                   dual numbers, exact

What stands before the loop are short formulas; the loop itself, its rope's recursion and the
integral over the spectrum are differentiated automatically (`synth.sweeps.dual_figures`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from models.basics import FloatArray, Quadrature
from models.case import Case
from models.hook import HookMotion
from models.plant import lump_rope

from ..loop import Dual
from ..sweeps import columns_of, dual_figures
from .differences import derivative
from .fields import Number
from .fixed_design import FixedDesign

_SHAKING = ("sea.", "vessel.")  # sections that the hook's motion depends on


class LoopSlopes:
    """Slopes of a loop's figures in variables that are added one by one, and in its drag.

    Parameters
    ----------
    fixed
        The design on its case.
    drag
        The linear drag coefficient in its loop [N s/m].
    nodes
        Nodes of all integrals.
    """

    def __init__(self, fixed: FixedDesign, drag: float, nodes: Quadrature) -> None:
        self._fixed, self._drag, self._nodes = fixed, drag, nodes
        self._numbers = columns_of(fixed.case)
        self._there = [name for name, value in self._numbers.items() if np.isfinite(value[0])]
        # One row for every variable.
        self._of_numbers: list[FloatArray] = []
        self._of_density: list[FloatArray] = []
        self._of_gains: list[FloatArray] = []

    def add_number(self, number: Number) -> None:
        """Add a number of the case.

        Raises
        ------
        StepError
            If something steps at its value.
        """
        case = self._fixed.case

        def numbers(value: float) -> FloatArray:
            columns = columns_of(changed(case, number, value))
            return np.concatenate([columns[name] for name in self._there])

        def density(value: float) -> FloatArray:
            return self._density(changed(case, number, value))

        own = np.asarray(derivative(numbers, number.value), dtype=np.float64)
        shaken = np.zeros(self._nodes.omega.size)
        if number.path.startswith(_SHAKING):
            shaken = np.asarray(derivative(density, number.value, common=True), dtype=np.float64)
        self._add(own, shaken, np.zeros(len(self._fixed.values)))

    def add_gain(self, index: int) -> None:
        """Add a parameter of the controller."""
        unit = np.zeros(len(self._fixed.values))
        unit[index] = 1.0
        self._add(np.zeros(len(self._there)), np.zeros(self._nodes.omega.size), unit)

    def figures(self, outputs: Sequence[str], peaks: FloatArray) -> tuple[Mapping[str, Dual], Dual]:
        """Return ln sigma of outputs, (1,), and ln |S| at frequencies [rad/s], (1, p).

        Their slopes are by the variables added, in that order, and by the drag coefficient where
        nothing else moves.
        """
        fixed = self._fixed
        by_name = dict(zip(self._there, np.array(self._of_numbers).T, strict=True))
        numbers = {
            name: _dual(value, by_name[name]) if name in by_name else value
            for name, value in self._numbers.items()
        }
        drag_slope = by_name.get("fixed_drag", np.zeros(len(self._of_numbers)))
        gains = np.array(self._of_gains).T
        density = np.array([*self._of_density, np.zeros(self._nodes.omega.size)])
        return dual_figures(
            numbers,
            fixed.law,
            fixed.design.measurements,
            [_dual(np.array([v]), own) for v, own in zip(fixed.values, gains, strict=True)],
            Dual(np.array([self._drag]), np.append(drag_slope, 1.0)[:, None]),
            lumps=lump_rope(fixed.design.masses, fixed.case.rope.lumping),
            nodes=self._nodes,
            density=Dual(self._density(fixed.case)[None], density[:, None]),
            outputs=outputs,
            peaks=peaks,
        )

    def quadratic_drag(self) -> FloatArray:
        """Return the slopes of ln q, q of the drag force q |v| v, by the variables added, (n,)."""
        at = self._there.index("quadratic_drag")
        return np.array([own[at] for own in self._of_numbers]) / self._numbers["quadratic_drag"]

    def _add(self, numbers: FloatArray, density: FloatArray, gains: FloatArray) -> None:
        self._of_numbers.append(numbers)
        self._of_density.append(density)
        self._of_gains.append(gains)

    def _density(self, case: Case) -> FloatArray:
        return np.asarray(HookMotion.from_case(case, warn=False).density(self._nodes.omega))


def changed(case: Case, number: Number, value: float) -> Case:
    """Return the case with another value of a number; implausible values are not remarked on."""
    return case.variant(number.change(value))


def _dual(value: FloatArray, slopes: FloatArray) -> Any:
    """Return a number, (1,), with its slopes by the variables and by the drag, if it has any."""
    return Dual(value, np.append(slopes, 0.0)[:, None]) if slopes.any() else value
