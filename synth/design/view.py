"""A prepared question that is asked again and again: `prepare`, `View` and its quick `Look`.

    case, structure -> View -> evaluate(gains) -> Look, not verified
                            -> replace({...})  -> View, what did not change is kept
                            -> optimise(start) -> Design, by one descent from the start

What a slider, a notebook and a script that asks a thousand times share.  Responses and margins
are those of `synth.loop`, on nodes that are made from the poles of the loop at hand; the drag
begins where the last one agreed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

import numpy as np

from models.basics import ComplexArray, FloatArray, InputError, Quadrature, SolverError, one_thread
from models.case import Case

from ..loop import Assessment, consistent_coefficient
from ..question import (
    HOOK,
    PAYLOAD,
    DesignQuestion,
    Values,
    masses_for,
    on_enough_masses,
    pose,
    with_masses,
)
from ..search import KEPT, Solution, cost_nodes, margin_nodes, settle
from .design import Design
from .optimise import checked_parameters, evaluated, verified

_PER_DECADE = 40  # margin frequencies; peaks and crossings between them are refined


@dataclass(frozen=True, kw_only=True, eq=False)
class Look(Design):
    """What given parameters do, at a glance: a design with its curves, not verified.

    Attributes
    ----------
    growth
        Largest real part of a pole, with the drag before compensation [1/s].
    omega
        Frequencies of the curves [rad/s], (k,); none where the loop is not stable.
    response
        P/Z, payload over hook, (k,).
    spectrum
        One-sided density of the payload's motion [m2 s/rad], (k,).
    loop_gain
        L of the loop broken at the command (the Nyquist curve), (k,).
    """

    growth: float
    omega: FloatArray
    response: ComplexArray
    spectrum: FloatArray
    loop_gain: ComplexArray

    @property
    def stable(self) -> bool:
        """Whether the loop is stable; where it is not, figures are infinite, None or empty."""
        return self.margins is not None


@one_thread()
def prepare(case: Case, structure: str = "payload-feedback") -> View:
    """Return the question of a case and a structure, posed once and kept warm.

    Parameters
    ----------
    case
        The case.
    structure
        Name of the structure, see `synth.structures.structure_names`.

    Raises
    ------
    InputError
        If there is no such structure, or the case lacks what a design needs.
    """
    return View(pose(case, structure))


class View:
    """A case and a structure, prepared for many looks.

    Parameters
    ----------
    question
        The question, on the rope masses that the case asks for.
    drag
        Drag coefficient to begin with [N s/m].
    """

    def __init__(self, question: DesignQuestion, drag: float | None = None) -> None:
        self.question = question
        self._drag = drag
        self._posed = {question.masses: question}

    @property
    def case(self) -> Case:
        """The case."""
        return self.question.case

    @property
    def structure(self) -> str:
        """Name of the structure."""
        return self.question.structure.name

    @one_thread()
    def evaluate(self, gains: object) -> Look:
        """Return what given parameters do, by the code of the search alone.

        Parameters
        ----------
        gains
            As `evaluate_gains` takes them.

        Raises
        ------
        InputError
            If a parameter is missing, unknown or out of its range.
        """
        parameters = checked_parameters(self.question, gains)
        question, loop, growth = self._loop(parameters)
        design = evaluated(question, parameters, loop, growth=growth)
        omega = spectrum = np.zeros(0)
        response = loop_gain = omega.astype(np.complex128)
        if loop is not None:
            omega, loop_gain = loop.grid, loop.gains[0]
            response = loop.response(PAYLOAD, HOOK, omega)
            spectrum = loop.spectrum(PAYLOAD, omega)
        return Look(
            **{field.name: getattr(design, field.name) for field in fields(design)},
            growth=growth,
            omega=omega,
            response=response,
            spectrum=spectrum,
            loop_gain=loop_gain,
        )

    @one_thread()
    def replace(self, changes: Mapping[str, Any]) -> View:
        """Return the view of the case with changes by dotted path; see `Case.replace`.

        Sea, plant and the drum held are kept where the changes leave them as they are.

        Raises
        ------
        InputError
            If a change is not valid.
        """
        case = self.case.replace(dict(changes))
        return View(pose(case, self.structure, known=self.question), self._drag)

    @one_thread()
    def optimise(self, start: object = None, *, verify: bool = False) -> Design:
        """Return the optimum that one descent reaches from given parameters.

        It is never worse than a start that keeps the limits; there may be a better one elsewhere,
        which `optimise_gains` looks for.

        Parameters
        ----------
        start
            As `evaluate_gains` takes them; by default the gains that the case has in use.
        verify
            Whether the design is checked as one by `optimise_gains` is.

        Raises
        ------
        InputError
            If a parameter is missing, unknown or out of its range, or the start is unstable.
        """
        given = self.case.gains if start is None else start
        parameters = checked_parameters(self.question, given)
        question, begin, growth = self._loop(parameters)
        if begin is None:
            raise InputError(
                f"start: must be gains of a stable loop, got one that grows by {growth:.3g} 1/s"
            )
        reference = np.array(question.values(parameters))
        solved, ended = self._descent(question, reference, reference, begin)
        if ended is not None and (wanted := masses_for(question, ended)) > question.masses:
            # What a descent arrives at may need more masses than where it began.
            finer = self._on(question, wanted)
            again = self._assessed(finer, reference)
            if again is not None:
                question, begin = finer, again
                solved, ended = self._descent(question, solved.values, reference, ended)
        how = "the descent did not converge: the start as it was"
        design = evaluated(question, parameters, begin, how=how)
        if ended is not None:
            there, rms = question.named([float(v) for v in solved.values]), ended.sigma(PAYLOAD)
            prices = {name: 0.01 * abs(p) * rms for name, p in solved.prices[0].items()}
            end = evaluated(question, there, ended, prices, how="one descent from the start")
            better = end.payload_rms <= design.payload_rms * (1.0 + KEPT)
            if (end.ok and (better or not design.ok)) or not (end.ok or design.ok):
                design = end
        if design.binding:
            design = replace(design, status=f"{design.status}, at {', '.join(design.binding)}")
        if question.drag is not None:
            self._drag = design.drag
        return verified(design, None, question) if verify else design

    def _descent(
        self, question: DesignQuestion, values: FloatArray, reference: FloatArray, near: Assessment
    ) -> tuple[Solution, Assessment | None]:
        """Return where a descent from some values ends, and the loop there if it is stable."""
        problem = question.problem
        drags = None if problem.drag is None else (near.coefficient,)
        solved = settle(problem, values, drags, reference=reference, fine=True)
        end = solved.coefficient
        if not np.isfinite(solved.objective) or not problem.stable(solved.values, end):
            return solved, None
        return solved, self._assessed(question, solved.values, end)

    def _loop(
        self, parameters: Mapping[str, float]
    ) -> tuple[DesignQuestion, Assessment | None, float]:
        """Return the question on the masses that suit a loop, the loop (or None), its growth."""
        return on_enough_masses(self.question, parameters, self._assessed, self._on)

    def _on(self, question: DesignQuestion, masses: int) -> DesignQuestion:
        """Return the question on some rope masses, posed once."""
        if masses not in self._posed:
            self._posed[masses] = with_masses(question, masses)
        return self._posed[masses]

    def _assessed(
        self, question: DesignQuestion, values: Values, coefficient: float | None = None
    ) -> Assessment | None:
        """Return a loop on nodes that are made from its poles; None where no drag agrees with it.

        The drag begins where the last one agreed.
        """
        problem = question.problem
        controller = problem.law.controller([float(v) for v in values])
        loop = problem.plant, controller, problem.disturbances
        last: list[Quadrature] = []

        def nodes(poles: ComplexArray) -> Quadrature:
            last.append(cost_nodes(problem, poles))
            return last[-1]

        if problem.drag is not None and coefficient is None:
            try:
                coefficient = self._drag = consistent_coefficient(
                    *loop, problem.drag, start=self._drag, nodes=nodes
                )
            except SolverError:
                return None
        grid = partial(margin_nodes, problem, per_decade=_PER_DECADE)
        same = (lambda _: last[-1]) if last else nodes  # what the drag was found on does
        return Assessment(*loop, drag=problem.drag, coefficient=coefficient, nodes=same, grid=grid)
