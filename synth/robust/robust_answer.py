"""From what a search over a family found to a `RobustDesign`: results, checks, the verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from models.basics import InputError
from models.case import Case

from ..design import limit_uses, tuning_of
from ..question import FamilyProblem, Objective
from ..search import KEPT, FamilyFound, Found
from .family import Family, Member
from .family_plants import FamilyPlants
from .perturbation import gain_radius
from .robust_result import RobustDesign, ScenarioResult
from .worst_case import DrawCheck, draw_check

Progress = Callable[[str, int, int], None]

_BINDS = 1e-3  # multiplier of log(bound) from which a limit is said to bind
_VERIFIED = 8  # scenarios, the hardest first, that are verified one by one


def answer_of(
    case: Case,
    family: Family,
    objective: Objective,
    plants: FamilyPlants,
    problem: FamilyProblem,
    members: Sequence[Member],
    found: FamilyFound,
    records: FamilyFound,
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
    structure = plants.structure if isinstance(plants.structure, str) else "structure"
    solved = found.solved
    results = [] if solved is None else _results(plants, problem, members, found)
    kept = solved is not None and solved.converged and found.excess <= KEPT
    notes: list[str] = []
    if kept:
        results = _verified(problem, found, results, notes, progress)
    check = None
    if solved is not None and draws and problem.stable(solved.values, solved.coefficients):
        check = draw_check(plants, [float(v) for v in solved.values], draws, seed + 1, progress)
    all_stable = check is None or check.stable == check.count
    ok = bool(kept and quiet and all_stable and not notes)
    results.sort(key=lambda r: -r.payload_rms)
    return RobustDesign(
        case=case,
        family=family,
        objective=objective,
        structure=structure,
        ok=ok,
        status=_status(objective, results, found, kept, quiet, check, notes),
        parameters={} if solved is None else plants.law.named([float(v) for v in solved.values]),
        controller=None
        if solved is None
        else plants.law.controller([float(v) for v in solved.values]),
        scenarios=tuple(results),
        added=len(members) - given,
        check=check,
        plants=plants,
        starts=len(records.starts),
        agreed=records.agreed,
        notes=tuple(notes),
    )


def _results(
    plants: FamilyPlants, problem: FamilyProblem, members: Sequence[Member], found: FamilyFound
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
    found: FamilyFound,
    results: Sequence[ScenarioResult],
    notes: list[str],
    progress: Progress | None,
) -> list[ScenarioResult]:
    """Return the results, the hardest of them checked by code that no search uses."""
    assert found.solved is not None
    ranked = sorted(
        range(len(results)), key=lambda i: (-results[i].pressure, -results[i].max_sensitivity)
    )
    checked = list(results)
    chosen = ranked[:_VERIFIED]
    for k, i in enumerate(chosen):
        if progress is not None:
            progress("verify", k, len(chosen))
        scenario = problem.scenarios[i]
        own = found.solved.of(i, scenario)
        single = Found(solved=own, assessment=found.assessments[i], excess=found.excess)
        verdict = tuning_of(scenario.problem, single).verify()
        checked[i] = replace(checked[i], verified=verdict.ok)
        if not verdict.ok:
            notes.append(f"{scenario.name}: {verdict.status}")
    if progress is not None:
        progress("verify", len(chosen), len(chosen))
    return checked


def _status(
    objective: Objective,
    results: Sequence[ScenarioResult],
    found: FamilyFound,
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
