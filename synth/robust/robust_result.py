"""Result of a robust design, with the checks and the verdict on it: `RobustDesign`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.basics import InputError
from models.case import Case

from ..design import LimitUse, limit_uses, tuning_of
from ..loop import LinearController
from ..question import PAYLOAD_FEEDBACK, FamilyProblem, Objective
from ..search import KEPT, Found, Progress
from .family import Family, Member
from .family_plants import FamilyPlants
from .perturbation import GainRadius, gain_radius
from .worst_case import DrawCheck, draw_check

_BINDS = 1e-3  # multiplier of log(bound) from which a limit is said to bind
_VERIFIED = 8  # scenarios, the hardest first, that are verified one by one


@dataclass(frozen=True, kw_only=True, eq=False)
class ScenarioResult:
    """What the gains do in one scenario.

    Attributes
    ----------
    name, member
        Which it is.
    weight
        Occurrence of its sea.
    payload_rms, payload_rms_before, best_rms
        With these gains, with the drum held, and (for the regret) with gains of its own [m].
    max_sensitivity, gain_down, gain, phase, delay, disk
        Margins of its loop, `synth.loop.margins.Margins`.
    radius
        How far every gain may be off at once [-], and the nearest unstable gains; None for
        structures that are not affine in their gains.
    limits
        Use of every limit by name.
    pressure
        How much of the objective hangs on the scenario; all of them add up to 1.
    verified
        Whether other code confirmed it; None if it was not asked.
    """

    name: str
    member: Member
    weight: float
    payload_rms: float
    payload_rms_before: float
    best_rms: float | None
    max_sensitivity: float
    gain_down: float
    gain: float
    phase: float
    delay: float
    disk: float
    radius: GainRadius | None
    limits: Mapping[str, LimitUse]
    pressure: float
    verified: bool | None = None

    @property
    def tightest(self) -> LimitUse | None:
        """The enforced limit that is used most."""
        enforced = [u for u in self.limits.values() if u.enforced]
        return max(enforced, key=lambda u: u.use, default=None)


@dataclass(frozen=True, kw_only=True, eq=False)
class RobustDesign:
    """One set of gains for a family, with everything that was asked of it.

    Attributes
    ----------
    case, family, objective, structure
        The question.
    ok, status
        Every scenario keeps its limits, nothing in the ranges hurts more, no random draw is
        unstable, and the hardest scenarios were verified; in words.
    parameters
        The gains by name.
    controller
        u = +C y.
    scenarios
        The set of members that was designed for, the worst payload motion first.
    added
        How many of them the search for the worst member added.
    check
        What random draws say.
    plants
        The family as it was posed.
    starts, agreed
        The starts of the first search, and how many arrived at its best answer.
    notes
        What a verification had to say against it.
    """

    case: Case
    family: Family
    objective: Objective
    structure: str
    ok: bool
    status: str
    parameters: Mapping[str, float]
    controller: LinearController | None
    scenarios: tuple[ScenarioResult, ...]
    added: int
    check: DrawCheck | None
    plants: FamilyPlants
    starts: int
    agreed: int
    notes: tuple[str, ...] = ()

    @property
    def gains(self) -> Mapping[str, float]:
        """The gains as `synth.evaluate_gains` takes them, for payload feedback."""
        if self.structure != PAYLOAD_FEEDBACK:
            raise InputError(f"gains: a {self.structure} has parameters, see `parameters`")
        return self.plants.nominal.named(list(self.parameters.values()))

    @property
    def worst(self) -> ScenarioResult:
        """The scenario with the largest payload motion."""
        return self.scenarios[0]

    @property
    def mean_rms(self) -> float:
        """Root of the occurrence-weighted mean square of the payload's motion [m]."""
        squares = np.array([s.payload_rms**2 for s in self.scenarios])
        weights = np.array([s.weight for s in self.scenarios])
        return float(np.sqrt(weights @ squares / weights.sum()))

    def __str__(self) -> str:
        """Return a small tree."""
        gains = ", ".join(f"{name} = {value:.6g}" for name, value in self.parameters.items())
        lines = [f"RobustDesign for {self.case.name}: {self.status}", f"├ {gains}"]
        for s in self.scenarios[:6]:
            lines.append(f"├ {s.name}: {1e3 * s.payload_rms:.4g} mm, M_s {s.max_sensitivity:.3f}")
        if len(self.scenarios) > 6:
            lines.append(f"├ and {len(self.scenarios) - 6} more scenarios")
        lines.append(f"└ {self.check}" if self.check is not None else "└ no random draws")
        return "\n".join(lines)


def answer_of(
    case: Case,
    family: Family,
    objective: Objective,
    plants: FamilyPlants,
    problem: FamilyProblem,
    members: Sequence[Member],
    found: Found,
    records: Found,
    *,
    given: int,
    quiet: bool,
    draws: int,
    seed: int,
    progress: Progress | None,
) -> RobustDesign:
    """Return the answer in numbers and words, checked by draws and by other code.

    `given` members were there before the search for the worst added any, and `quiet` says
    whether it came to an end.
    """
    solved = found.solved
    values = [] if solved is None else [float(v) for v in solved.values]
    results = [] if solved is None else _results(plants, problem, members, found)
    kept = solved is not None and solved.converged and found.excess <= KEPT
    notes: list[str] = []
    if kept:
        results = _verified(problem, found, results, notes, progress)
    check = None
    if solved is not None and draws and problem.stable(solved.values, solved.coefficients):
        check = draw_check(plants, values, draws, seed + 1, progress)
    all_stable = check is None or check.stable == check.count
    ok = bool(kept and quiet and all_stable and not notes)
    results.sort(key=lambda r: -r.payload_rms)
    return RobustDesign(
        case=case,
        family=family,
        objective=objective,
        structure=plants.structure,
        ok=ok,
        status=_status(objective, results, found, kept, quiet, check, notes),
        parameters={} if solved is None else plants.law.named(values),
        controller=None if solved is None else plants.law.controller(values),
        scenarios=tuple(results),
        added=len(members) - given,
        check=check,
        plants=plants,
        starts=len(records.starts),
        agreed=records.agreed,
        notes=tuple(notes),
    )


def _results(
    plants: FamilyPlants, problem: FamilyProblem, members: Sequence[Member], found: Found
) -> list[ScenarioResult]:
    solved = found.solved
    assert solved is not None
    results = []
    for i, (member, scenario) in enumerate(zip(members, problem.scenarios, strict=True)):
        assessment, question = found.assessments[i], plants.question(member)
        if not assessment.stable:
            continue
        values = [float(v) for v in scenario.values(solved.values)]
        try:
            radius = gain_radius(assessment.plant, scenario.problem.law, values)
        except InputError:  # several inputs, or a structure that is not affine in its gains
            radius = None
        margins = assessment.margins
        rms = assessment.sigma("payload.displacement")
        # As everywhere: what the payload's rms would lose if the bound were 1 % looser.
        prices = {
            name: 0.01 * abs(p) * rms if abs(p) > _BINDS else 0.0
            for name, p in solved.prices[i].items()
        }
        uses = limit_uses(question.limits, assessment, prices)
        uses |= limit_uses(question.reported, assessment, {}, enforced=False)
        regret = problem.objective is Objective.REGRET
        results.append(
            ScenarioResult(
                name=scenario.name,
                member=member,
                weight=scenario.weight,
                payload_rms=rms,
                payload_rms_before=question.payload_rms_before,
                best_rms=scenario.best if regret else None,
                max_sensitivity=margins.max_sensitivity,
                gain_down=margins.gain_down,
                gain=margins.gain,
                phase=margins.phase,
                delay=margins.delay,
                disk=margins.disk,
                radius=radius,
                limits=uses,
                pressure=float(solved.pressure[i]),
            )
        )
    return results


def _verified(
    problem: FamilyProblem,
    found: Found,
    results: Sequence[ScenarioResult],
    notes: list[str],
    progress: Progress | None,
) -> list[ScenarioResult]:
    """Return the results, the hardest of them checked by code that no search uses."""
    ranked = sorted(
        range(len(results)), key=lambda i: (-results[i].pressure, -results[i].max_sensitivity)
    )
    checked = list(results)
    chosen = ranked[:_VERIFIED]
    for k, i in enumerate(chosen):
        if progress is not None:
            progress("verify", k, len(chosen))
        scenario = problem.scenarios[i]
        verdict = tuning_of(scenario.problem, found.member(i, scenario)).verify()
        checked[i] = replace(checked[i], verified=verdict.ok)
        if not verdict.ok:
            notes.append(f"{scenario.name}: {verdict.status}")
    if progress is not None:
        progress("verify", len(chosen), len(chosen))
    return checked


def _status(
    objective: Objective,
    results: Sequence[ScenarioResult],
    found: Found,
    kept: bool,
    quiet: bool,
    check: DrawCheck | None,
    notes: Sequence[str],
) -> str:
    if found.solved is None:
        return "no gains were found that stabilise every member of the family"
    if not kept:
        broken = [(u.use, u.name, r.name) for r in results for u in r.limits.values() if u.enforced]
        use, name, where = max(broken, default=(np.inf, "stability", "every scenario"))
        if use <= 1.0 + KEPT:
            return "the solver did not converge"
        return f"no gains keep the limits of all scenarios; {name} is hardest, in {where}"
    if notes:
        return f"not verified: {notes[0]}"
    if check is not None and check.stable < check.count:
        return f"{check.count - check.stable} of {check.count} random draws are unstable"
    if not quiet:
        return "the search for the worst member did not come to an end"
    goal = {
        Objective.WORST: "least worst payload motion",
        Objective.MEAN: "least mean payload motion",
        Objective.REGRET: "least worst regret",
    }[objective]
    leading = max(results, key=lambda r: r.pressure)
    binds = sorted({u.name for r in results for u in r.limits.values() if u.price > 0.0})
    text = f"{goal} over {len(results)} scenarios, decided by {leading.name}"
    return f"{text}; {', '.join(binds)} bind{'s' * (len(binds) == 1)}" if binds else text
