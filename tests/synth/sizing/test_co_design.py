"""Co-design: gear and gains together, against brute force and against finite differences."""

from __future__ import annotations

import math

import numpy as np
import pytest
from former_cases import load_case

import stillhook as sh
from models.basics import InputError
from synth.sizing import CoDesign
from synth.sizing.codesign import gear_changes
from synth.sizing.follow import Answer, asked_by, follow, posed

pytestmark = pytest.mark.ci  # whole optimisations in fixtures

STRUCTURE = "payload-feedback"


def answer(case: sh.Case, near: Answer | None = None) -> Answer:
    problem = asked_by(case, posed(case, STRUCTURE, 1))
    if near is None:
        design = sh.optimise_gains(case, STRUCTURE, starts=2)
        found = follow(problem, [np.array(design.question.values(design.parameters))])
    else:
        found = follow(problem, [near])
    assert found is not None
    return found


@pytest.fixture(scope="module")
def case() -> sh.Case:
    changes = {"sea.significant_height": 1.0, "limits.drive": "enforce"}
    return load_case("thesis-1975").replace(changes)


@pytest.fixture(scope="module")
def best(case: sh.Case) -> CoDesign:
    return sh.co_design(case, gear=(26.0, 46.0), starts=2)


@pytest.mark.slow
def test_no_gear_of_a_grid_does_better(case: sh.Case, best: CoDesign) -> None:
    assert best.ok, best.status
    found = {}
    for gear in (32.2, best.gear, 33.5, 37.0):
        changed = case.replace({"winch.gearbox.ratio": gear})
        design = sh.optimise_gains(changed, STRUCTURE, starts=2)
        found[gear] = design.payload_rms if design.ok else math.inf
    assert min(found, key=lambda g: found[g]) == best.gear
    # The same figure by a search that knows nothing of its neighbours.
    assert best.payload_rms == pytest.approx(found[best.gear], rel=1e-3)
    assert best.given_rms == pytest.approx(found[37.0], rel=1e-3)
    assert best.payload_rms < 0.95 * best.given_rms


def test_the_best_gear_stands_where_one_limit_hands_over_to_another(best: CoDesign) -> None:
    assert "corner" in best.status
    assert best.design is not None
    assert best.design.verification is not None
    assert best.design.verification.ok
    assert best.to_csv().count("\n") == len(best.points) + 1


def test_with_a_drum_that_weighs_nothing_only_gear_over_radius_counts(case: sh.Case) -> None:
    one = answer(case)
    twice = answer(case.replace(gear_changes(case, 74.0, 0.826)), one)
    assert twice.payload_rms == pytest.approx(one.payload_rms, rel=1e-4)


@pytest.mark.slow
def test_a_drum_that_gains_nothing_stays_as_it_is(case: sh.Case, best: CoDesign) -> None:
    wide = sh.co_design(case, gear=(26.0, 46.0), radius=(0.38, 0.45), starts=2)
    assert wide.radius == case.drum_radius
    assert wide.payload_rms == pytest.approx(best.payload_rms, rel=1e-3)


def test_a_larger_drum_is_heavier_with_the_cube() -> None:
    case = load_case("subsea-crane")
    changes = gear_changes(case, 90.0, 2.0 * case.drum_radius)
    assert changes["winch.drum.inertia"] == pytest.approx(8.0 * case.winch.drum.inertia)
    assert gear_changes(case, 90.0) == {"winch.gearbox.ratio": 90.0}


def test_ranges_that_fall_are_refused(case: sh.Case) -> None:
    with pytest.raises(InputError, match="gear"):
        sh.co_design(case, gear=(40.0, 30.0))
    with pytest.raises(InputError, match="radius"):
        sh.co_design(case, radius=(0.5, 0.4))
