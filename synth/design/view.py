"""A prepared question that is asked again and again: `prepare`, `View` and its quick `Look`.

    case, structure -> View -> evaluate(gains) -> Look, not verified
                            -> replace({...})  -> View, what did not change is kept
                            -> optimise(start) -> Design, by one descent from the start

What a slider, a notebook and a script that asks a thousand times share.  Responses and margins
are those of `synth.loop`, on nodes that are made from the poles of the loop at hand; the drag
begins where the last one agreed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
from typing_extensions import override

from models.basics import (
    ComplexArray,
    FloatArray,
    InputError,
    Quadrature,
    SolverError,
    one_thread,
)
from models.case import Case
from models.plant import MAX_MASSES, LinearPlant, consistent_drag

from ..loop import Assessment, Margins, loop_margins, refine_minima, worst_margins
from ..question import (
    HOOK,
    PAYLOAD,
    Closing,
    DesignQuestion,
    LoopBlocks,
    LoopResponses,
    Point,
    Problem,
    masses_for,
    pose,
    with_masses,
)
from ..search import KEPT, Solution, cost_nodes, margin_nodes, settle
from .design import Design
from .optimise import checked_parameters, every_use, recorded, verified
from .tuning import LimitUse

_PER_DECADE = 40  # margin frequencies; peaks and crossings between them are refined
_ROUNDS = 30  # of a drag that agrees with the motion
_SAME_NODES = 0.05  # relative change of the drag for which the same nodes do
_PRICED = 1e-5  # of the cost, a price that counts


@dataclass(frozen=True, kw_only=True, eq=False)
class Look:
    """What given parameters do, at a glance: nothing in it is verified.

    Attributes
    ----------
    structure, parameters
        The structure and its parameters by name.
    stable, growth
        Whether the loop is stable, and the largest real part of a pole [1/s].  Where it is not
        stable, everything below is infinite, None or empty.
    payload_rms, hook_rms
        Standard deviations of the payload's and the hook's motion [m].
    drag
        Linear drag coefficient that agrees with the motion [N s/m].
    limits
        Value, bound, use and unit of each limit by name; prices are 0.
    margins
        Stability margins of the loop broken at the command.
    omega
        Frequencies of the curves [rad/s], (k,).
    response
        P/Z, payload over hook, (k,).
    spectrum
        One-sided density of the payload's motion [m2 s/rad], (k,).
    loop_gain
        L of the loop broken at the command (the Nyquist curve), (k,).
    masses
        Rope masses of the plant.
    verified
        False: `Design.verify` and `evaluate_gains` check by other code.
    """

    structure: str
    parameters: Mapping[str, float]
    stable: bool
    growth: float
    payload_rms: float
    hook_rms: float
    drag: float
    limits: Mapping[str, LimitUse]
    margins: Margins | None
    omega: FloatArray
    response: ComplexArray
    spectrum: FloatArray
    loop_gain: ComplexArray
    masses: int
    verified: bool = False

    @property
    def residual(self) -> float:
        """Payload's motion over the hook's."""
        return self.payload_rms / self.hook_rms

    @property
    def ok(self) -> bool:
        """Whether the loop is stable and keeps every limit that binds; not verified."""
        return self.stable and all(u.kept for u in self.limits.values() if u.enforced)


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
        self._posed = {question.masses: (question, _whole(question))}

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
        if loop is None:
            nothing = np.zeros(0)
            curves: dict[str, Any] = {
                "omega": nothing,
                "response": nothing.astype(np.complex128),
                "spectrum": nothing,
                "loop_gain": nothing.astype(np.complex128),
            }
        else:
            curves = {
                "omega": loop.grid,
                "response": loop.payload_response,
                "spectrum": loop.payload_spectrum,
                "loop_gain": loop.gains[0],
            }
        return Look(
            structure=self.structure,
            parameters=parameters,
            stable=loop is not None,
            growth=growth,
            payload_rms=np.inf if loop is None else loop.sigma(PAYLOAD),
            hook_rms=self._hook_rms,
            drag=question.drag_before if loop is None else _drag_of(question, loop),
            limits={} if loop is None else every_use(question, loop, {}),
            margins=None if loop is None else loop.margins,
            masses=question.masses,
            **curves,
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
            finer, whole = self._on(wanted)
            again = self._settled(whole, reference)
            if again is not None:
                question, begin = finer, again
                solved, ended = self._descent(question, solved.values, reference, ended)
        found, prices = begin, dict[str, float]()
        kept_before = all(u.kept for u in every_use(question, begin, {}).values() if u.enforced)
        status = "the descent did not converge: the start as it was"
        if ended is not None:
            kept = all(u.kept for u in every_use(question, ended, {}).values() if u.enforced)
            better = ended.sigma(PAYLOAD) <= begin.sigma(PAYLOAD) * (1.0 + KEPT)
            if (kept and (better or not kept_before)) or not (kept or kept_before):
                found, parameters = ended, question.named([float(v) for v in solved.values])
                rms = ended.sigma(PAYLOAD)
                prices = {k: 0.01 * abs(p) * rms for k, p in solved.prices[0].items()}
                status = "one descent from the start"
        uses = every_use(question, found, prices)
        broken = [u.name for u in uses.values() if u.enforced and not u.kept]
        binding = [u.name for u in uses.values() if u.price > _PRICED * found.sigma(PAYLOAD)]
        status += f"; breaks {', '.join(broken)}" if broken else "; keeps every limit"
        status += f", at {', '.join(binding)}" if binding else ""
        if question.drag is not None:
            self._drag = found.coefficient
        design = recorded(question, parameters, found, uses, ok=not broken, status=status)
        return verified(design, None, question) if verify else design

    def _descent(
        self, question: DesignQuestion, values: FloatArray, reference: FloatArray, near: _Loop
    ) -> tuple[Solution, _Loop | None]:
        """Return where a descent from some values ends, and the loop there if it is stable."""
        problem = question.problem
        drags = None if problem.drag is None else (near.coefficient,)
        solved = settle(problem, values, drags, reference=reference, fine=True)
        end = solved.coefficient
        if not np.isfinite(solved.objective) or not problem.stable(solved.values, end):
            return solved, None
        whole = self._posed[question.masses][1]
        return solved, _Loop(whole, solved.values, end, _Nodes.of(whole, solved.values, end))

    @cached_property
    def _hook_rms(self) -> float:
        return float(self.question.hook.displacement.rms)

    def _on(self, masses: int) -> tuple[DesignQuestion, Problem]:
        """Return the question on some rope masses and its problem, made once."""
        if masses not in self._posed:
            question = with_masses(self.question, masses)
            self._posed[masses] = question, _whole(question)
        return self._posed[masses]

    def _loop(self, parameters: Mapping[str, float]) -> tuple[DesignQuestion, _Loop | None, float]:
        """Return the question on the masses that suit a loop, the loop (or None), its growth."""
        question, problem = self._on(self.question.masses)
        values = np.array(question.values(parameters))
        growth = problem.growth(values)
        if growth > 0.0 and question.masses < MAX_MASSES and question.data.masses is None:
            finer, finest = self._on(MAX_MASSES)
            if (there := finest.growth(values)) <= 0.0:
                question, problem, growth = finer, finest, there
        if growth > 0.0:
            return question, None, growth
        loop = self._settled(problem, values)
        if loop is not None:
            masses = masses_for(question, loop)
            if masses > question.masses:
                question, problem = self._on(masses)
                if (growth := problem.growth(values)) > 0.0:
                    return question, None, growth
                loop = self._settled(problem, values)
        if loop is None:
            return question, None, growth
        return question, loop, float(loop.poles.real.max())

    def _settled(self, problem: Problem, values: FloatArray) -> _Loop | None:
        """Return a loop with the drag that agrees with its motion; None where none does."""
        drag = problem.drag
        if drag is None:
            return _Loop(problem, values, None, _Nodes.of(problem, values, None))
        current = self._drag or drag.reference
        for _ in range(_ROUNDS):
            nodes = _Nodes.of(problem, values, current)
            try:
                found = consistent_drag(drag.quadratic, nodes.velocity(values))
            except SolverError:
                current *= 4.0  # more drag damps the motion, so that it can be integrated
                continue
            if abs(found - current) <= _SAME_NODES * found:
                break
            current = found
        else:
            return None
        if not problem.stable(values, found):
            return None
        self._drag = found
        return _Loop(problem, values, found, nodes)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Nodes:
    """Nodes that suit the loop at one drag coefficient [N s/m], and the plant's blocks there."""

    problem: Problem
    coefficient: float | None
    quadrature: Quadrature
    blocks: LoopBlocks
    growth: float

    @classmethod
    def of(cls, problem: Problem, values: FloatArray, coefficient: float | None) -> _Nodes:
        poles = problem.loop_poles(values, coefficient)
        quadrature = cost_nodes(problem, poles)
        return cls(
            problem=problem,
            coefficient=coefficient,
            quadrature=quadrature,
            blocks=_blocks(problem, quadrature.omega, problem.outputs),
            growth=float(poles.real.max()),
        )

    def velocity(self, values: FloatArray) -> Callable[[float], float]:
        """Return rms velocity [m/s] by drag coefficient [N s/m], infinite where it is unstable.

        The drag is the last loop around the plant: more of it changes its return difference
        1 + (C - C_0) G alone, and that is linear in C.
        """
        problem, drag, coefficient = self.problem, self.problem.drag, self.coefficient
        assert drag is not None
        assert coefficient is not None
        base, much = drag.reference, 2.0 * max(drag.reference, coefficient)
        point = Point(values=[float(v) for v in values], drag=much)
        loop = LoopResponses(self.blocks, Closing.of(problem, self.blocks.s, point))
        row = problem.outputs.index(drag.velocity)
        difference = np.asarray(loop.difference(-1))
        felt = (difference - 1.0) / (much - base)
        parts = [
            np.abs(loop.response(row, i) * difference) ** 2 * d.density(self.quadrature.omega)
            for i, d in enumerate(problem.disturbances)
        ]
        weights = np.sum(parts, axis=0) * self.quadrature.weights
        calm = coefficient if self.growth < 0.0 else np.inf

        def velocity(other: float) -> float:
            nonlocal calm  # the least drag known to do
            if other < calm:
                if not problem.stable(values, other):
                    return np.inf
                calm = other
            return float(np.sqrt(np.abs(1.0 + (other - base) * felt) ** -2 @ weights))

        return velocity


class _Loop(Assessment):
    """A closed loop on nodes that are made from its poles, and its margins refined between them."""

    def __init__(
        self, problem: Problem, values: FloatArray, coefficient: float | None, nodes: _Nodes
    ) -> None:
        point = Point(values=[float(v) for v in values], drag=coefficient)
        super().__init__(
            problem.plant,
            problem.law.controller(point.values),
            problem.disturbances,
            drag=problem.drag,
            coefficient=coefficient,
        )
        self._problem, self._point, self._nodes = problem, point, nodes.quadrature
        closing = Closing.of(problem, nodes.blocks.s, point)
        self._cost = LoopResponses(nodes.blocks, closing)
        self._margin = self._at(self.grid, *problem.outputs)
        self._density = [d.density(self._nodes.omega) for d in problem.disturbances]

    @cached_property
    def poles(self) -> ComplexArray:
        """Poles of the closed loop [1/s], delays as Pade models."""
        return self._problem.loop_poles(self._point.values, self._point.drag)

    @cached_property
    def grid(self) -> FloatArray:
        """The margin frequencies [rad/s]."""
        return margin_nodes(self._problem, self.poles, _PER_DECADE)

    @cached_property
    def gains(self) -> list[ComplexArray]:
        """L of each loop on the grid, (k,) each."""
        loops = range(len(self._problem.plant.inputs))
        return [np.asarray(self._margin.difference(i) - 1.0) for i in loops]

    @cached_property
    def margins(self) -> Margins:
        """Margins of the loops broken at the inputs."""
        return worst_margins(
            [
                loop_margins(partial(self.loop_gain, index=i), self.grid, gain)
                for i, gain in enumerate(self.gains)
            ]
        )

    @property
    @override
    def max_sensitivity(self) -> float:
        return self.margins.max_sensitivity

    @override
    def loop_gain(self, omega: FloatArray, index: int = 0) -> ComplexArray:
        return np.asarray(self._at(omega).difference(index) - 1.0)

    @override
    def response(self, output: str, disturbance: str, omega: FloatArray) -> ComplexArray:
        found = self._at(omega, output)
        return np.asarray(found.response(0, self._column(disturbance)))

    @cached_property
    def payload_response(self) -> ComplexArray:
        """P/Z on the grid, (k,)."""
        row = self._problem.outputs.index(PAYLOAD)
        return np.asarray(self._margin.response(row, self._column(HOOK)))

    @cached_property
    def payload_spectrum(self) -> FloatArray:
        """One-sided density of the payload's motion on the grid [m2 s/rad], (k,)."""
        row = self._problem.outputs.index(PAYLOAD)
        parts = [
            np.abs(self._margin.response(row, i)) ** 2 * d.density(self.grid)
            for i, d in enumerate(self._problem.disturbances)
        ]
        return np.asarray(np.sum(parts, axis=0))

    @override
    def sigma(self, output: str) -> float:
        return float(np.sqrt(self._parts(output)[0].sum()))

    @override
    def shares(self, output: str) -> dict[str, float]:
        found = np.sqrt(self._parts(output)[0])
        return {d.name: float(v) for d, v in zip(self._problem.disturbances, found, strict=True)}

    @override
    def mean_period(self, output: str) -> float:
        m0, m2 = (part.sum() for part in self._parts(output))
        return float(2.0 * np.pi * np.sqrt(m0 / m2)) if m2 > 0.0 else np.inf

    @override
    def largest_loop_gain(self, above: float) -> float:
        every = range(len(self._problem.plant.inputs))

        def small(omega: FloatArray) -> FloatArray:
            found = self._at(omega)
            sizes = [np.abs(found.difference(i) - 1.0) for i in every]
            return -np.asarray(np.max(sizes, axis=0), dtype=np.float64)

        grid = np.unique(np.append(self.grid[self.grid > above], [above, 10.0 * self.grid[-1]]))
        return float(-refine_minima(small, grid, small(grid))[1].min())

    @override
    def largest_response(
        self,
        output: str,
        disturbance: str,
        weight: Callable[[FloatArray], FloatArray],
        edges: Sequence[float] = (),
    ) -> float:
        def small(omega: FloatArray) -> FloatArray:
            return np.asarray(-np.abs(self.response(output, disturbance, omega)) * weight(omega))

        ends = [share * edge for edge in edges for share in (1e-4, 1.0)]
        grid = np.unique(np.append(self.grid, ends))
        found = small(grid)
        # Where the weight is zero no peak is looked for.
        return float(-refine_minima(small, grid, found, found < 0.0)[1].min())

    def _parts(self, output: str) -> tuple[FloatArray, FloatArray]:
        """Return what each disturbance adds to the moments m_0 and m_2 of an output, (nw,)."""
        if output not in self._kept:
            row = self._problem.outputs.index(output)
            weighted = np.array(
                [
                    np.abs(self._cost.response(row, i)) ** 2 * density * self._nodes.weights
                    for i, density in enumerate(self._density)
                ]
            )
            self._kept[output] = weighted.sum(axis=1), weighted @ self._nodes.omega**2
        return self._kept[output]

    @cached_property
    def _kept(self) -> dict[str, tuple[FloatArray, FloatArray]]:
        return {}

    def _column(self, disturbance: str) -> int:
        return [d.name for d in self._problem.disturbances].index(disturbance)

    @cached_property
    def _heard(self) -> LinearPlant:
        """The plant without the outputs that no loop gain needs."""
        drag = self._problem.drag
        return self._problem.plant.select(outputs=() if drag is None else (drag.velocity,))

    def _at(self, omega: FloatArray, *outputs: str) -> LoopResponses:
        plant = self._problem.plant if outputs else self._heard
        blocks = _blocks(self._problem, np.asarray(omega, dtype=np.float64), outputs, plant)
        return LoopResponses(blocks, Closing.of(self._problem, blocks.s, self._point))


def _whole(question: DesignQuestion) -> Problem:
    """Return the problem of a question with the limits that are reported too."""
    return question.problem_with((*question.limits, *question.reported))


def _blocks(
    problem: Problem,
    omega: FloatArray,
    outputs: tuple[str, ...],
    plant: LinearPlant | None = None,
) -> LoopBlocks:
    plant = plant or problem.plant
    return LoopBlocks.of(problem, plant.response(plant.beside_poles(omega)), outputs)


def _drag_of(question: DesignQuestion, loop: _Loop) -> float:
    if question.drag is None:
        return float(question.case.payload.fixed_drag or 0.0)
    return loop.coefficient
