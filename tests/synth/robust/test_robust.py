"""One set of gains for many loops: against brute force, and against what it promises."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from loop_numbers import lyapunov_cost, oscillator, with_full_state
from scipy.optimize import minimize

from models import load_case
from models.basics import InputError
from stillhook.cli import main
from synth import MaxSensitivity, StaticGain, White
from synth.loop import LinearController, disturbances
from synth.question import FamilyLoop, FamilyProblem, Objective, Problem
from synth.robust import Family, optimise_robust
from synth.robust.robust import tune_family
from synth.robust.worst_case import exact_figures

WEIGHTS = {"x": 1.0, "effort": 1e-2}
STIFFNESS = (1.0, 4.0, 9.0)


def scenarios(limits=(), weights=(1.0, 1.0, 1.0)) -> list[FamilyLoop]:
    found: list[FamilyLoop] = []
    law = None
    for stiffness, weight in zip(STIFFNESS, weights, strict=True):
        plant = with_full_state(oscillator(stiffness))
        law = law or StaticGain().bind(plant)
        noise = {name: White(1.0) for name in plant.independent_disturbances}
        problem = Problem(
            plant=plant,
            law=law,
            disturbances=disturbances(noise, plant.independent_disturbances),
            minimise=WEIGHTS,
            limits=tuple(limits),
        )
        found.append(FamilyLoop(name=f"k = {stiffness}", problem=problem, weight=weight))
    return found


def costs_of(gains) -> np.ndarray:
    found = []
    for stiffness in STIFFNESS:
        plant = with_full_state(oscillator(stiffness))
        controller = LinearController.static([list(gains)], plant.measurements, plant.inputs)
        noise = dict.fromkeys(plant.independent_disturbances, White(1.0))
        try:
            found.append(lyapunov_cost(plant, controller, noise, WEIGHTS))
        except ValueError:
            found.append(np.inf)
    return np.array(found)


def brute(total) -> float:
    """The least of a function of the three costs, by Nelder and Mead from several starts."""

    def value(gains) -> float:
        found = costs_of(gains)
        return float(total(found)) if np.isfinite(found).all() else 1e6

    starts = [(-1.0, -1.0), (-10.0, -5.0), (-3.0, -10.0)]
    options = {"xatol": 1e-9, "fatol": 1e-12, "maxiter": 4000, "maxfev": 4000}
    return min(minimize(value, s, method="Nelder-Mead", options=options).fun for s in starts)


@pytest.mark.parametrize("name", ["worst", "mean", "regret"])
def test_the_objective_is_as_low_as_brute_force_finds_it(name):
    weights = (1.0, 2.0, 5.0)
    family_scenarios = scenarios(weights=weights)
    bests = np.array([brute(lambda c, i=i: c[i]) for i in range(3)])
    family_scenarios = [
        replace(s, best=float(b)) for s, b in zip(family_scenarios, bests, strict=True)
    ]
    family, found = tune_family(family_scenarios, objective=name, starts=4)
    totals = {
        "worst": lambda c: c.max(),
        "mean": lambda c: np.sqrt(np.dot(weights, c**2) / sum(weights)),
        "regret": lambda c: (c / bests).max(),
    }
    assert found.solved is not None
    mine = totals[name](costs_of(found.solved.values))
    assert mine == pytest.approx(brute(totals[name]), rel=1e-5)
    assert family.total(found.solved.costs) == pytest.approx(mine, rel=1e-6)


def test_the_mean_is_not_above_the_worst_and_the_worst_not_above_the_means():
    worst = tune_family(scenarios(), objective="worst", starts=3)[1].solved
    mean = tune_family(scenarios(), objective="mean", starts=3)[1].solved
    assert worst is not None
    assert mean is not None
    assert worst.costs.max() <= mean.costs.max() * (1.0 + 1e-6)
    assert np.mean(mean.costs**2) <= np.mean(worst.costs**2) * (1.0 + 1e-6)


def test_every_loop_keeps_the_margin():
    _, found = tune_family(scenarios([MaxSensitivity(bound=1.05)]), starts=4)
    assert found.excess <= 1e-5
    assert max(view.max_sensitivity for view in found.assessments) <= 1.05 * (1.0 + 1e-5)


def test_pressure_lies_on_the_scenarios_that_decide():
    solved = tune_family(scenarios(), objective="worst", starts=3)[1].solved
    assert solved is not None
    assert solved.pressure.sum() == pytest.approx(1.0)
    for cost, pressure in zip(solved.costs, solved.pressure, strict=True):
        assert pressure < 1e-3 or cost == pytest.approx(solved.costs.max(), rel=1e-4)


def test_seas_on_one_plant_share_their_loop():
    case = load_case("thesis-1975")
    from synth.robust.family_plants import FamilyPlants

    plants = FamilyPlants(Family.of(case, {"depth": [1500, 2000]}, seas=[(1.5, 8.0), (2.0, 9.0)]))
    family = FamilyProblem(
        scenarios=tuple(plants.scenario(m) for m in plants.family.grid()),
        objective=Objective.WORST,
    )
    assert sorted(len(group) for group in family.groups) == [2, 2]


@pytest.fixture(scope="module")
def design():
    case = load_case("thesis-1975")
    family = Family.of(case, {"depth": [1500, 2000], "payload": ["34 t", "38 t"]})
    return optimise_robust(case, family, starts=4, draws=400)


def test_a_robust_design_is_verified_and_no_draw_is_unstable(design):
    assert design.ok, design.status
    assert design.check is not None
    assert design.check.stable == design.check.count == 400
    assert all(s.verified for s in design.scenarios[:4])


def test_no_member_in_the_ranges_is_worse_than_the_set(design):
    values = list(design.parameters.values())
    for member in design.family.draw(25, seed=11):
        figures = exact_figures(design.plants, values, member)
        assert figures.stable
        assert figures.payload_rms <= design.worst.payload_rms * (1.0 + 3e-3)
        assert figures.use <= 1.0 + 3e-3


def test_the_worst_case_table_holds_the_margins_of_each_loop(design):
    from synth import evaluate_gains

    worst = design.worst
    single = evaluate_gains(design.family.case_at(worst.member), design.gains)
    assert single.payload_rms == pytest.approx(worst.payload_rms, rel=1e-4)
    assert single.margins is not None
    assert single.margins.delay == pytest.approx(worst.delay, rel=1e-4)
    assert single.margins.disk == pytest.approx(worst.disk, rel=1e-4)
    assert worst.radius is not None
    assert 0.0 < worst.radius.box < 1.0


def test_the_search_adds_a_member_between_the_ends_where_one_hurts_more(monkeypatch):
    import synth.robust.robust as robust
    from synth.robust.family import Member

    case = load_case("thesis-1975")
    family = Family.of(case, {"depth": [1500.0, 2000.0]})
    # Begun at one end only, the search has to find the other by itself.
    monkeypatch.setattr(robust, "_first", lambda family: [Member(point=(1500.0,))])
    found = robust.optimise_robust(case, family, starts=3, draws=0)
    assert found.added >= 1
    assert max(s.member.point[0] for s in found.scenarios) == pytest.approx(2000.0, rel=0.02)
    assert found.ok, found.status


def test_a_family_of_another_case_is_refused():
    case = load_case("thesis-1975")
    other = case.replace({"rope.length": 1000.0})
    with pytest.raises(InputError, match="must be one of this case"):
        optimise_robust(case, Family.of(other, {"depth": [900.0, 1000.0]}))


def test_unknown_objectives_are_refused():
    with pytest.raises(InputError, match="must be one of worst, mean, regret, got 'best'"):
        tune_family(scenarios(), objective="best")


def test_the_command_writes_tables_and_figures(tmp_path, capsys):
    words = ["robust", "thesis-1975", "--vary", "depth=1800..2000", "--starts", "3"]
    words += ["--draws", "200", "--out", str(tmp_path)]
    assert main(words) == 0
    text = capsys.readouterr().out
    assert "200 of 200 random draws are stable" in text
    assert "stillhook evaluate" in text
    names = {path.name for path in tmp_path.iterdir()}
    assert {"scenarios.csv", "robust.svg", "robust.png", "worst.yaml", "case.yaml"} <= names


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "nothing varies"),
        (["--vary", "depth"], "must be PATH=LOW..HIGH"),
        (["--vary", "depth=1..2", "--vary", "depth=1..2"], "given twice"),
        (["--seas", "1.5"], "must be H_s/T_p"),
        (["--schedule", "100"], "must be LOW..HIGH"),
        (["--schedule", "100..200", "--vary", "depth=1..2"], "alone"),
    ],
)
def test_the_command_says_what_is_wrong(words, message, capsys, tmp_path):
    assert main(["robust", "thesis-1975", *words, "--out", str(tmp_path)]) == 2
    assert message in capsys.readouterr().err
