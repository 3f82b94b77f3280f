"""One set of gains for a family of plants and seas: what it promises, and what it says."""

from __future__ import annotations

import pytest

from models import load_case
from models.basics import InputError
from stillhook.cli import main
from synth.robust import Family, optimise_robust
from synth.robust.worst_case import exact_figures


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
    values = design.plants.nominal.values(design.parameters)
    for member in design.family.draw(25, seed=11):
        figures = exact_figures(design.plants, values, member)
        assert figures.stable
        assert figures.payload_rms <= design.worst.design.payload_rms * (1.0 + 3e-3)
        assert figures.use <= 1.0 + 3e-3


def test_the_worst_case_table_holds_the_margins_of_each_loop(design):
    from synth import evaluate_gains

    worst = design.worst
    single = evaluate_gains(design.family.case_at(worst.member), design.parameters)
    assert single.payload_rms == pytest.approx(worst.design.payload_rms, rel=1e-4)
    assert single.margins is not None
    assert single.margins.delay == pytest.approx(worst.margins.delay, rel=1e-4)
    assert single.margins.disk == pytest.approx(worst.margins.disk, rel=1e-4)
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
    case = load_case("thesis-1975")
    with pytest.raises(InputError, match="must be one of worst, mean, regret, got 'best'"):
        optimise_robust(case, Family.of(case, {"depth": [900.0, 1000.0]}), "best")


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
