"""What varies about a case: distributions, correlations, files, and rows that anyone can redraw."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from former_cases import load_case
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from models.basics import InputError
from models.case import Case
from models.spread import (
    METHODS,
    Distribution,
    LogNormal,
    Normal,
    Samples,
    Spread,
    Triangular,
    Uniform,
)

FloatArray = npt.NDArray[np.float64]

SHARES = np.linspace(0.001, 0.999, 57)


@pytest.fixture(scope="module")
def case() -> Case:
    return load_case("thesis-1975")


@pytest.mark.parametrize(
    ("own", "theirs"),
    [
        (Uniform(2.0, 5.0), stats.uniform(2.0, 3.0)),
        (Normal(3.0, 0.5), stats.norm(3.0, 0.5)),
        (Normal(3.0, 0.5, 2.8, 4.0), stats.truncnorm(-0.4, 2.0, loc=3.0, scale=0.5)),
        (LogNormal(4.0, 0.3), stats.lognorm(0.3, scale=4.0)),
        (Triangular(1.0, 5.0, 2.0), stats.triang(0.25, loc=1.0, scale=4.0)),
    ],
)
def test_quantiles_are_those_of_scipys_distributions(own: Distribution, theirs: object) -> None:
    expected = theirs.ppf(SHARES)  # type: ignore[attr-defined]
    np.testing.assert_allclose(own.quantile(SHARES), expected, rtol=1e-12)


def test_truncated_lognormal_is_the_conditional_distribution() -> None:
    whole, cut = stats.lognorm(0.4, scale=2.0), LogNormal(2.0, 0.4, 1.5, 3.0)
    low, high = whole.cdf([1.5, 3.0])
    np.testing.assert_allclose(
        cut.quantile(SHARES), whole.ppf(low + (high - low) * SHARES), rtol=1e-11
    )


@given(
    mean=st.floats(-5.0, 5.0),
    sd=st.floats(0.01, 3.0),
    width=st.floats(0.1, 4.0),
    shares=st.lists(st.floats(1e-9, 1.0 - 1e-9), min_size=2, max_size=6),
)
def test_values_rise_with_their_share_and_stay_within_the_cuts(
    mean: float, sd: float, width: float, shares: list[float]
) -> None:
    cut = Normal(mean, sd, mean - width, mean + 0.5 * width)
    values = cut.quantile(np.sort(np.array(shares)))
    assert np.all(np.diff(values) >= 0.0)
    assert np.all((values >= mean - width) & (values <= mean + 0.5 * width))


def test_samples_are_drawn_again_and_never_in_between() -> None:
    drawn = Samples([3.0, 1.0, 2.0, 2.0]).quantile((np.arange(1000) + 0.5) / 1000)
    values, counts = np.unique(drawn, return_counts=True)
    assert values.tolist() == [1.0, 2.0, 3.0]
    assert counts.tolist() == [250, 500, 250]


def test_percentages_and_units_are_of_the_cases_own_value(case: Case) -> None:
    spread = Spread(
        {
            "payload.mass": "10 %",
            "delay": Uniform("5 ms", "50 ms"),
            "stiffness": Normal(sd="20 %"),
            "gains.a1": Triangular("-10 %", "+20 %"),
            "rope.length": Uniform("-100 m", "+0 %"),
        }
    )
    with pytest.raises(InputError, match=r"rope\.length must stay in \[1, 12000\] m, got -100"):
        spread.on(case)
    own = Spread({k: v for k, v in spread.distributions.items() if k != "rope.length"}).on(case)
    mass, delay, stiffness, a1 = own.distributions.values()
    assert mass.support == pytest.approx((0.9 * 36844.0, 1.1 * 36844.0))
    assert delay.support == (0.005, 0.05)
    assert isinstance(stiffness, Normal)
    assert (stiffness.mean, stiffness.sd) == (160e6, 32e6)
    assert a1.support == pytest.approx((90.0, 120.0))
    assert own.units["sensors.telemetry.delay"] == "s"
    assert own.nominal["rope.axial_stiffness"] == 160e6


def test_a_bell_is_cut_where_the_field_ends(case: Case) -> None:
    own = Spread({"delay": Normal("20 ms", "20 ms")}).on(case)
    assert own.sample(2000)[:, 0].min() >= 0.0
    assert own.distributions["sensors.telemetry.delay"].support == (0.0, 60.0)


@pytest.mark.parametrize("method", ["sobol", "lhs", "random", "grid", "corners"])
def test_any_piece_of_a_design_is_the_same_as_the_whole(case: Case, method: str) -> None:
    own = Spread(
        {"payload.mass": "20 %", "delay": Uniform("0 s", "50 ms"), "stiffness": Normal(sd="5 %")},
        {("payload.mass", "stiffness"): 0.5},
    ).on(case)
    whole = own.sample(300, method, seed=4)
    pieces = [own.sample(300, method, seed=4, start=k, stop=k + 7) for k in range(0, 300, 7)]
    np.testing.assert_array_equal(np.concatenate(pieces), whole)
    assert len(whole) == {"grid": 216, "corners": 8}.get(method, 300)


@pytest.mark.parametrize("method", ["sobol", "random"])
def test_row_does_not_depend_on_how_many_are_asked_for(case: Case, method: str) -> None:
    own = Spread({"payload.mass": "20 %", "stiffness": "5 %"}).on(case)
    np.testing.assert_array_equal(own.sample(10, method, 3), own.sample(5000, method, 3)[:10])
    assert not np.array_equal(own.sample(10, method, 3), own.sample(10, method, 4))


def test_latin_hypercube_takes_every_stratum_once() -> None:
    rows = Spread({"payload.mass": Uniform(0.0, 1.0), "rope.length": Uniform(0.0, 1.0)}).sample(
        128, "lhs", 5
    )
    for column in rows.T:
        assert sorted((column * 128).astype(int).tolist()) == list(range(128))


@pytest.mark.parametrize("method", ["sobol", "lhs", "random"])
@pytest.mark.parametrize("rank", [-0.7, 0.3, 0.9])
def test_rank_correlation_is_that_asked_for(method: str, rank: float) -> None:
    spread = Spread(
        {"payload.mass": Uniform(0.0, 1.0), "rope.length": LogNormal(3.0, 0.8)},
        {("payload.mass", "rope.length"): rank},
    )
    rows = spread.sample(1 << 13, method, seed=1)
    found = stats.spearmanr(rows[:, 0], rows[:, 1]).statistic
    # Its standard error is about 1/sqrt(n) = 0.011 at most.
    assert found == pytest.approx(rank, abs=0.035)


def test_correlated_columns_keep_their_distributions() -> None:
    spread = Spread(
        {"payload.mass": Uniform(0.0, 1.0), "rope.length": Triangular(0.0, 4.0, 1.0)},
        {("payload.mass", "rope.length"): -0.8},
    )
    rows = spread.sample(1 << 13, seed=2)
    assert stats.kstest(rows[:, 0], "uniform").statistic < 0.005
    assert stats.kstest(rows[:, 1], stats.triang(0.25, scale=4.0).cdf).statistic < 0.005


def test_correlations_that_contradict_each_other_are_refused() -> None:
    paths = {name: Uniform(0.0, 1.0) for name in ("payload.mass", "rope.length", "payload.area")}
    pairs = {("payload.mass", "rope.length"): 0.6, ("rope.length", "payload.area"): 0.6}
    Spread(paths, pairs)
    with pytest.raises(InputError, match="contradict each other"):
        Spread(paths, {**pairs, ("payload.mass", "payload.area"): -0.9})


def test_corners_of_a_bell_lie_at_three_standard_deviations(case: Case) -> None:
    own = Spread({"payload.mass": Normal(sd="1 %"), "stiffness": LogNormal(sigma=0.1)}).on(case)
    rows = own.sample(None, "corners")
    assert rows.shape == (4, 2)
    np.testing.assert_allclose(rows[0], [36844.0 * 0.97, 160e6 * np.exp(-0.3)], rtol=1e-4)
    np.testing.assert_allclose(rows[-1], [36844.0 * 1.03, 160e6 * np.exp(0.3)], rtol=1e-4)


def test_given_samples_are_taken_row_by_row(case: Case) -> None:
    own = Spread({"payload.mass": Samples([30e3, "-5 %"]), "delay": Samples([0.0, "20 ms"])})
    rows = own.on(case).sample(None, "given")
    np.testing.assert_allclose(rows, [[30e3, 0.0], [0.95 * 36844.0, 0.02]])
    uneven = Spread({"payload.mass": Samples([1.0]), "delay": Samples([0.0, 0.1])})
    with pytest.raises(InputError, match="equally long"):
        uneven.sample(None, "given")


def test_added_mass_and_weight_grow_with_the_payload_unless_they_vary(case: Case) -> None:
    alone = Spread({"payload": "10 %"}).on(case)
    changes = alone.changes([1.1 * 36844.0])
    assert changes["payload.added_mass"] == pytest.approx(1.1 * 36844.0)
    assert changes["payload.submerged_weight"] == pytest.approx(1.1 * 314.1e3)
    both = Spread({"payload": "10 %", "added_mass": "5 %"}).on(case)
    assert both.changes([40e3, 36e3])["payload.added_mass"] == 36e3
    assert both.case_at([40e3, 36e3]).payload.virtual_mass == 76e3


def test_gains_and_drag_are_no_part_of_the_case(case: Case) -> None:
    own = Spread({"gains.a": "5 %", "drag": "50 %", "payload.mass": "1 %"}).on(
        case, {"a": 3.0}, drag=1000.0
    )
    row = own.sample(None, "corners")[0]
    assert own.gains(row) == pytest.approx({"a": 2.85})
    assert own.drag(row) == 500.0
    assert set(own.changes(row)) == {
        "payload.mass",
        "payload.added_mass",
        "payload.submerged_weight",
    }


FILE = """
vary:
  payload.mass: 20 %
  sensors.telemetry.delay: [10 ms, 60 ms]
  rope.axial_stiffness: {normal: {sd: 10 %}}
  payload.drag_coefficient: {lognormal: 0.2}
  winch.gearbox.efficiency: {triangular: [0.85, 0.95, 0.9]}
  sea.significant_height: {samples: [1.2 m, 1.5 m, 2.1 m]}
correlations:
  - [payload.mass, rope.axial_stiffness, 0.4]
"""


def test_file_becomes_a_spread_and_text_again(tmp_path: Path) -> None:
    path = tmp_path / "spread.yaml"
    path.write_text(FILE, encoding="utf-8")
    spread = Spread.from_yaml(path)
    case = load_case("subsea-crane")
    rows = spread.on(case).sample(64, seed=7)
    assert rows.shape == (64, 6)
    again = tmp_path / "again.yaml"
    again.write_text(spread.on(case).to_yaml(), encoding="utf-8")
    np.testing.assert_allclose(Spread.from_yaml(again).on(case).sample(64, seed=7), rows)
    assert "rank correlation of payload.mass and rope.axial_stiffness: 0.4" in str(spread)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("payload.mass: 1", "must hold a section `vary:`"),
        ("vary:\n  payload.mass: {gauss: 1}", r"spread\.yaml:2: vary\.payload\.mass: 'gauss' is"),
        ("vary:\n  payload.mass: {normal: {mean: 3}}", "sd is missing"),
        ("vary:\n  payload.mass: [1, 2, 3]", r"\[low, high\] or"),
        ("vary:\n  payload.mass: {uniform: {lo: 1}}", "lo is unknown; did you mean 'low'"),
        ("vary:\n  delay: 5 %\ncorrelations:\n  - [a, b]", r":4: correlations\[0\]: must be"),
        ("vary:\n  payload.mass: 5 %\ncorelations: 1", "did you mean 'correlations'"),
    ],
)
def test_errors_of_a_file_name_the_line(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "spread.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=message):
        Spread.from_yaml(path)


@pytest.mark.parametrize(
    ("vary", "message"),
    [
        ({"payload.mas": "1 %"}, r"payload\.mas is unknown; did you mean 'mass'"),
        ({"payload.mass": "30 kN"}, "must be a mass .* which is a force"),
        ({"delay": "10 %"}, "is 0 in this case, so 10 % of it is nothing"),
        ({"payload.mass": "150 %"}, r"payload\.mass must stay in \[1, 1e\+08\] kg"),
        ({"rope.lumping": 2.0}, "there is no number at 'rope.lumping'"),
        ({"gains.q": "5 %"}, r"gains\.q is unknown"),
        ({"drag": "5 %"}, "drag is a number of a design"),
        ({"vessel.heave_rao.amplitude.99": 0.1}, "entries go from 0 to 17"),
        ({"rope.length": Uniform(2000.0, 3000.0)}, "the drum holds"),
    ],
)
def test_what_does_not_fit_the_case_is_told(
    case: Case, vary: dict[str, Distribution], message: str
) -> None:
    drum = {"winch.drum": {"layers": "american-hoist-1000", "inertia": 0.0}}
    with pytest.raises(InputError, match=message):
        Spread(vary).on(case.replace(drum))


def test_units_before_a_case_is_met_are_refused() -> None:
    spread = Spread({"payload.mass": "10 %"})
    with pytest.raises(InputError, match=r"call Spread\.on\(case\) first"):
        spread.sample(3)
    with pytest.raises(InputError, match="has met no case"):
        _ = spread.units


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0, "sobol", 0), "samples must be at least 1"),
        ((5, "dice", 0), f"method must be one of {', '.join(METHODS)}"),
        ((5, "sobol", -1), "seed must be at least 0"),
        ((None, "sobol", 0), "needs a number of samples"),
        ((5, "given", 0), "wants lists of numbers"),
    ],
)
def test_wrong_questions_are_answered_with_what_is_allowed(
    arguments: tuple[int | None, str, int], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        Spread({"payload.mass": Uniform(1.0, 2.0)}).sample(*arguments)


def test_wrong_distributions_are_refused() -> None:
    for wrong in (
        lambda: Uniform(2.0, 1.0),
        lambda: Normal(1.0),
        lambda: Normal(1.0, -0.1),
        lambda: Normal(0.0, 0.1, 50.0, 60.0),
        lambda: LogNormal(-1.0, 0.2),
        lambda: Triangular(0.0, 1.0, 2.0),
        lambda: Samples([]),
        lambda: Samples([float("nan")]),
        lambda: Spread({}),
        lambda: Spread({"payload": 1.0, "payload.mass": 1.0}),
        lambda: Spread({"payload": 1.0}, {("payload", "depth"): 0.5}),
    ):
        with pytest.raises(InputError):
            wrong()
