"""Families: which members there are, and what thousands of them at once come to."""

from __future__ import annotations

import numpy as np
import pytest
from former_cases import load_case

from models.basics import InputError
from models.sea import Scatter, read_scatter
from synth.loop import Assessment
from synth.robust import DiscreteValues, Family, sea_states
from synth.robust.family import Member
from synth.robust.family_plants import FamilyPlants
from synth.robust.worst_case import draw_check, exact_figures, figures_of

GAINS = (5.0, 2.0, 3.0)


@pytest.fixture(scope="module")
def case():
    return load_case("thesis-1975")


@pytest.fixture(scope="module")
def family(case):
    vary = {"depth": [1500.0, 2000.0], "payload": ["35 t", "40 t"], "delay": [0.0, 0.02]}
    return Family.of(case, vary, seas=[(1.5, 8.0), (2.4, 9.0, 3.0)])


@pytest.fixture(scope="module")
def crane():
    vary = {"rope.length": [800.0, 1200.0], "payload.mass": ["48 t", "55 t"]}
    return Family.of(load_case("subsea-crane"), vary)


def test_corners_and_grid_are_all_combinations_in_every_sea(case):
    family = Family.of(
        case, {"depth": [1000, 1500, 2000], "winch.drum.radius": DiscreteValues(0.4, 0.41)}
    )
    assert len(family.corners()) == 4
    assert len(family.grid()) == 6
    family = Family.of(case, {"depth": [1000, 1500, 2000]}, seas=[(1.5, 8.0), (2.0, 9.0)])
    assert len(family.grid()) == 6


def test_added_mass_and_weight_grow_with_the_payload(family, case):
    heavy = family.case_at(Member(point=(2000.0, 0.9 * case.payload.mass, 0.0)))
    assert heavy.payload.hydrodynamic_mass == pytest.approx(0.9 * case.payload.hydrodynamic_mass)
    assert heavy.payload.submerged_weight == pytest.approx(0.9 * case.payload.submerged_weight)


def test_added_mass_that_is_varied_itself_stays_what_it_is(case):
    family = Family.of(case, {"payload": [36e3, 40e3], "added_mass": [20e3, 50e3]})
    assert family.case_at(Member(point=(40e3, 20e3))).payload.hydrodynamic_mass == 20e3


def test_units_are_read_as_in_a_case_file(family):
    assert family.axes[1].values == (35e3, 40e3)


def test_a_sea_is_given_in_the_variables_of_the_cases_spectrum(family):
    member = family.nominal()[1]
    assert family.case_at(member).sea.spectral_peak_period == pytest.approx(9.0)


def test_draws_stay_in_the_ranges_and_meet_the_seas_by_their_occurrence(family):
    members = family.draw(4000, seed=5)
    points = np.array([m.point for m in members])
    for column, axis in zip(points.T, family.axes, strict=True):
        assert axis.low <= column.min()
        assert column.max() <= axis.high
        assert column.mean() == pytest.approx(0.5 * (axis.low + axis.high), rel=0.03)
    assert np.mean([m.sea for m in members]) == pytest.approx(0.75, abs=0.03)
    assert members == family.draw(4000, seed=5)


def test_stacked_loops_agree_with_loops_one_by_one(family):
    plants = FamilyPlants(family)
    members = family.draw(12, seed=2)
    for figures in figures_of(plants, GAINS, members):
        exact = exact_figures(plants, GAINS, figures.member)
        assert figures.stable == exact.stable
        assert figures.payload_rms == pytest.approx(exact.payload_rms, rel=1e-6)
        assert figures.max_sensitivity == pytest.approx(exact.max_sensitivity, rel=1e-4)


@pytest.mark.ci
def test_stacked_loops_agree_where_the_drag_follows_the_response(crane):
    plants = FamilyPlants(crane)
    plants.nominal  # noqa: B018  # sets the number of rope masses
    masses = max(plants.question(m).masses for m in crane.corners())
    plants = FamilyPlants(crane, masses=masses)
    for figures in figures_of(plants, (16.0, 44.0, 6.4), crane.draw(4, seed=2)):
        problem = plants.scenario(figures.member).problem
        controller = problem.law.controller([16.0, 44.0, 6.4])
        view = Assessment(
            problem.plant, controller, problem.disturbances, elements=problem.elements
        )
        assert figures.payload_rms == pytest.approx(view.sigma("payload.displacement"), rel=1e-5)
        assert figures.max_sensitivity == pytest.approx(view.max_sensitivity, rel=1e-4)
        drive = [lim for lim in problem.limits if lim.drive]
        uses = {lim.name: lim.use(lim.measure(view)) for lim in drive}
        uses["max_sensitivity"] = view.max_sensitivity / 2.0
        assert figures.use == pytest.approx(max(uses.values()), rel=1e-3)
        assert figures.limit == max(uses, key=lambda name: uses[name])


def test_members_of_several_kinds_are_told_apart(crane):
    radii = {"rope.length": [800.0, 1200.0], "winch.drum.radius": DiscreteValues(0.5, 0.6)}
    family = Family.of(crane.case, radii, seas=[(1.5, 8.0), (2.4, 9.0, 3.0)])
    plants, gains = FamilyPlants(family), (16.0, 44.0, 6.4)
    members = family.draw(4, seed=2)
    assert len({family.kind(m) for m in members}) == 2
    together = figures_of(plants, gains, members)
    assert [figures.member for figures in together] == members
    for figures in together:
        alone = figures_of(plants, gains, [figures.member])[0]
        assert figures.payload_rms == pytest.approx(alone.payload_rms, rel=1e-9)
    exact = exact_figures(plants, gains, members[-1])
    assert together[-1].payload_rms == pytest.approx(exact.payload_rms, rel=1e-3)


def test_unstable_draws_are_counted(case):
    late = Family.of(case, {"delay": [0.0, 0.05]})
    plants = FamilyPlants(late)
    check = draw_check(plants, (50.0, 100.0, 100.0), 400, seed=1)
    # The thesis's loop has a delay margin of 25.7 ms: a little over half of the range.
    share = 25.7 / 50.0
    assert check.stable / check.count == pytest.approx(share, abs=0.05)
    assert check.interval[0] < share < check.interval[1]
    assert not check.worst_rms.stable


def test_a_scatter_table_is_read(tmp_path):
    path = tmp_path / "scatter.csv"
    path.write_text("significant_height,peak_period,occurrence\n1.5,8,30\n2.5,9,0\n3,10,5\n")
    states = sea_states(read_scatter(path))
    assert [s.occurrence for s in states] == pytest.approx([30.0 / 35.0, 5.0 / 35.0])
    assert (states[1].significant_height, states[1].peak_period) == (3.0, 10.0)


def test_the_months_of_a_scatter_table_are_one_sea():
    columns = {"significant_height": [1.5, 3.0, 1.5], "peak_period": [8.0, 10.0, 8.0]}
    states = sea_states(Scatter(**columns, occurrence=[2, 4, 2], month=[1, 1, 2]))
    assert [(s.significant_height, s.occurrence) for s in states] == [(1.5, 0.5), (3.0, 0.5)]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("significant_height,occurrence\n1,1\n", "peak_period .* is missing"),
        (
            "significant_height,peak_period,occurrence\n1,a,1\n",
            ":2: peak_period must be a finite number",
        ),
        ("significant_height,peak_period,occurrence\n1,8,0\n", "occurrence"),
    ],
)
def test_a_scatter_table_that_is_wrong_is_told(tmp_path, text, message):
    path = tmp_path / "scatter.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        sea_states(read_scatter(path))


@pytest.mark.parametrize(
    ("vary", "message"),
    [
        ({"rope.lenght": [1.0, 2.0]}, "rope.lenght"),
        ({"rope.length": []}, "at least one value"),
        ({"sea.significant_height": [1.0, 2.0]}, "sea states are given as seas"),
        ({"depth": [1000.0], "rope.length": [1000.0]}, "given twice"),
    ],
)
def test_what_cannot_be_varied_is_told(case, vary, message):
    with pytest.raises(InputError, match=message):
        Family.of(case, vary)
