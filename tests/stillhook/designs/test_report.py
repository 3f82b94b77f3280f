"""The report and the words in it: files whole, figures embedded, every number from the design."""

from __future__ import annotations

import dataclasses
import math
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from designs import (
    infeasible_design,
    loopless_design,
    structure_design,
    thesis_design,
    unstable_design,
)
from former_cases import load_case

import stillhook as sh
from models import InputError
from stillhook.designs.report import design_report
from stillhook.designs.summary import (
    command_text,
    effect,
    expected_table,
    facts,
    limit_table,
    margin_table,
    member_table,
    motion_table,
    parameter_table,
    required_table,
    share_table,
    unit_notes,
)
from stillhook.text import json_data, markdown
from stillhook.text.folder import LIST
from synth.design.tuning import LimitUse
from synth.search import Start

FIGURES = ("payload_spectrum", "responses", "nyquist", "limits")
ALL = {"case.yaml", "design.yaml", "summary.md"} | {
    f"{name}.{kind}" for name in FIGURES for kind in ("svg", "png")
}


def summary_text(design) -> str:
    return markdown(design_report(design))


def figures_of(design) -> list[str]:
    return [drawing.name for drawing in design_report(design, bound=False).drawings]


def texts_of(table) -> list[list[str]]:
    return [table.cells(k) for k in range(len(table.rows))]


def names(folder) -> set[str]:
    return {path.name for path in folder.iterdir()} - {LIST}


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report") / "deep" / "out"
    written = sh.write_design(folder, design=thesis_design())
    return folder, written


def test_everything_is_written_and_listed(report):
    folder, written = report
    assert names(folder) == ALL
    assert {path.name for path in written} == ALL
    assert all(path.parent == folder for path in written)


def test_the_parts_load_again(report):
    folder, _ = report
    assert load_case(folder / "case.yaml") == thesis_design().case
    assert sh.load_design(folder / "design.yaml").payload_rms == thesis_design().payload_rms
    for name in FIGURES:
        assert ET.parse(folder / f"{name}.svg").getroot().tag.endswith("svg")
        assert (folder / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_summary_embeds_the_figures_beside_it(report):
    folder, _ = report
    text = (folder / "summary.md").read_text(encoding="utf-8")
    embedded = re.findall(r"!\[.+?\]\((.+?)\)", text)
    assert embedded == [f"{name}.svg" for name in FIGURES]
    assert all((folder / name).exists() for name in embedded)


def test_summary_holds_the_figures_of_the_thesis():
    text = summary_text(thesis_design())
    for figure in ("11.7 mm", "5.99 m", "594 mm", "5.15", "11.3 deg", "25.7 ms", "x 0.0919"):
        assert figure in text  # digest of the 1975 thesis
    assert text.startswith("# thesis-1975\n\nThe 1975 thesis's winch in 2000 m")
    assert "**Not ok**: stable; breaks max_sensitivity." in text
    assert "| motor torque, peak | 43.7 kN m | ≤ 11.9 kN m | 368 % | reported |" in text


def test_tables_of_the_summary_are_tables():
    for table in re.findall(r"(?:^\|.*\n)+", summary_text(thesis_design()), re.MULTILINE):
        columns = {len(re.findall(r"(?<!\\)\|", line)) for line in table.splitlines()}
        assert len(columns) == 1


@pytest.fixture
def quick_pictures(monkeypatch):
    monkeypatch.setattr("stillhook.text.images.picture", lambda figure, kind, **_: kind.encode())


@pytest.mark.usefixtures("quick_pictures")
def test_an_unstable_design_takes_figures_of_an_earlier_run_away(tmp_path):
    for name in ("limits.svg", "limits.png", "notes.txt"):
        (tmp_path / name).touch()
    (tmp_path / LIST).write_text("limits.svg\nlimits.png\n")
    written = sh.write_design(tmp_path, design=unstable_design())
    assert names(tmp_path) == ALL - {"limits.svg", "limits.png"} | {"notes.txt"}
    assert len(written) == len(ALL) - 2
    text = (tmp_path / "summary.md").read_text(encoding="utf-8")
    assert "No stable loop: the payload's motion has no standard deviation." in text
    assert "limits.svg" not in text


def test_figures_that_a_design_has():
    assert figures_of(thesis_design()) == list(FIGURES)
    assert figures_of(unstable_design()) == ["payload_spectrum", "responses", "nyquist"]
    assert figures_of(loopless_design()) == ["payload_spectrum", "responses"]
    assert "## Gains" not in summary_text(loopless_design())


def test_an_infeasible_design_says_what_it_would_take():
    text = summary_text(infeasible_design())
    assert "| limit that breaks | is | needed in H_s 2.44 m |" in text
    assert "| motor torque, peak | 11.9 kN m | 13.0 kN m |" in text
    assert "All figures below are those in H_s 0.5 m." in text
    assert "| sea | H_s 500 mm, T_S 8.10 s (asked for: H_s 2.44 m), bretschneider-1975 |" in text


@pytest.mark.usefixtures("quick_pictures")
def test_progress_is_told(tmp_path):
    told = []
    sh.write_design(tmp_path, design=loopless_design(), progress=lambda *step: told.append(step))
    assert told == [("figures", done, 2) for done in range(2)]  # there is no loop to draw


@pytest.mark.parametrize("below", ["", "more/"])
def test_a_file_in_the_way_of_the_folder_is_named(below, tmp_path):
    (tmp_path / "out").touch()
    reason = "part of the path is a file" if below else "a file is there"
    with pytest.raises(InputError, match=f"the output folder cannot be made: {reason}$"):
        sh.write_design(f"{tmp_path}/out/{below}", design=thesis_design())


@pytest.mark.usefixtures("quick_pictures")
def test_a_full_disk_leaves_whole_files_only(tmp_path, monkeypatch):
    folder = tmp_path / "out"
    sh.write_design(folder, design=loopless_design())
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    (folder / "summary.md").write_text("old")
    from pathlib import Path

    write = Path.write_bytes

    def full(path, data):
        if "summary" in path.name:
            write(path, data[: len(data) // 2])
            raise OSError(28, "No space left on device")
        return write(path, data)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(InputError, match=r"summary\.md: cannot be written: No space left on dev"):
        sh.write_design(folder, design=loopless_design())
    after = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert after == before | {"summary.md": b"old"}


def test_motions_are_four_sigma_and_most_probable_maxima():
    hook, before, after = texts_of(motion_table(thesis_design()))
    assert hook[:3] == ["hook", "594 mm", "2.38 m"]
    assert before[1:3] == ["5.99 m", "24.0 m"]
    assert after[1:] == ["11.7 mm", "46.9 mm", "44.8 mm"]
    assert len(motion_table(unstable_design()).rows) == 2


def test_the_effect_is_said_whichever_way_it_goes():
    design = thesis_design()
    assert effect(design) == (
        "residual 2.0 % of the hook's motion (34.1 dB), 0.2 % of the payload's with the drum held "
        "(54.2 dB)"
    )
    worse = dataclasses.replace(design, payload_rms=1.1 * design.payload_rms_before)
    assert effect(worse).endswith(", 110 % of the payload's with the drum held (-0.8 dB)")
    undamped = dataclasses.replace(design, payload_rms_before=math.inf)
    assert (
        effect(undamped)
        == "residual 2.0 % of the hook's motion (34.1 dB); with the drum held the payload resonates"
    )


def test_gains_carry_the_units_of_the_drive():
    assert texts_of(parameter_table(thesis_design())) == [
        ["A", "200.000", ""],
        ["a", "50.0000", "(V)/(m/s2)"],
        ["a1", "100.000", "(V)/(m/s)"],
        ["a2", "100.000", "(V)/(m)"],
    ]
    assert command_text(thesis_design()).startswith("armature voltage [V] = -A (a P''")
    crane = dataclasses.replace(thesis_design(), case=load_case("subsea-crane"))
    torque = crane.case.replace({"winch.motor.speed_gain": 0})
    other = dataclasses.replace(crane, case=torque)
    assert command_text(other).startswith("motor torque [N m] = ")
    assert command_text(crane).startswith("motor speed [rad/s] = ")


def test_shares_of_every_signal_are_told_where_more_than_the_sea_shakes_it():
    assert share_table(thesis_design()) is None
    crane = sh.evaluate_gains(load_case("subsea-crane"), {"a": 16.0, "a1": 44.0, "a2": 6.4})
    rows = share_table(crane).rows
    assert [row[0] for row in rows][:2] == ["payload displacement", "motor torque"]
    for row in rows:
        assert sum(row[1:]) == pytest.approx(1.0)
    payload, torque = rows[:2]
    assert torque[3] > 9.0 * torque[1]  # the noise of the payload's velocity, amplified
    assert torque[2] == 0.0  # the reference unit is not heard
    assert torque[4] > torque[3]  # the gear's loss, which the sea does not make
    assert 0.0 < payload[4] < 1e-3  # which their noise alone moves


def test_what_signals_most_probably_reach_is_told_with_their_value_at_rest():
    thesis = expected_table(thesis_design())
    assert not thesis.notes  # no losses that switch: what is expected is what the limits hold
    rows = {row[0]: [cell.value for cell in row[1:]] for row in thesis.rows}
    rest, rms, largest, least = rows["motor torque"]
    assert largest == pytest.approx(thesis_design().limits["motor.torque.peak"].value)
    assert rms == pytest.approx(thesis_design().assessment.sigma("motor.torque"))
    assert least == pytest.approx(2.0 * rest - largest)
    assert rows["payload displacement"][0] == 0.0
    crane = sh.evaluate_gains(load_case("subsea-crane"), {"a": 16.0, "a1": 44.0, "a2": 6.4})
    lossy = expected_table(crane)
    assert lossy.notes == ("limits hold the losses in full: they are on the safe side",)
    torque = next(row[3].value for row in lossy.rows if row[0] == "motor torque")
    assert torque < crane.limits["motor.torque.peak"].value
    assert expected_table(unstable_design()) is None
    assert expected_table(loopless_design()) is None
    # With another probability of exceedance they are still what the limits hold.
    gains = {"A": 200, "a": 50, "a1": 100, "a2": 100}
    rare = sh.evaluate_gains(load_case("thesis-1975").replace({"limits.exceedance": 0.1}), gains)
    table = expected_table(rare)
    assert table.headings[0] == "expected in 3 h, exceeded in 10.0 % of them"
    torque = next(row[3].value for row in table.rows if row[0] == "motor torque")
    assert torque == pytest.approx(rare.limits["motor.torque.peak"].value)


def test_margins_in_words():
    assert [row[:2] for row in margin_table(thesis_design()).rows] == [
        ("sensitivity peak M_s", "5.15"),
        ("gain may grow", "without bound"),
        ("gain may fall", "x 0.0919"),
        ("phase", "11.3 deg"),
        ("further delay", "25.7 ms"),
        ("disk margin", "0.198"),
    ]
    margins = thesis_design().margins
    assert margins is not None
    slow = dataclasses.replace(margins, gain=4.0, gain_down=0.0, phase=math.inf, delay=math.inf)
    rows = margin_table(dataclasses.replace(thesis_design(), margins=slow)).rows
    assert rows[1] == ("gain may grow", "x 4.00", "by 12.0 dB")
    assert rows[2] == ("gain may fall", "to nothing", "")
    assert rows[3] == ("phase, delay", "without bound", "|L| stays below 1")
    assert margin_table(unstable_design()) is None


def test_limits_say_which_way_they_bind_and_what_they_cost():
    design = thesis_design()
    table = limit_table(design)
    rows = {row[0]: row for row in texts_of(table)}
    assert rows["sensitivity peak M_s"][-1] == "broken"
    assert rows["motor speed, peak"][-1] == "reported"
    assert "|P/Z| up to 0.01 rad/s" in rows
    assert [row[3].enforced for row in table.rows] == [True] * 2 + [False] * 8
    use = dataclasses.replace(design.limits["max_sensitivity"], use=1.0, value=2.0, price=4.16e-4)
    least = dataclasses.replace(
        use, name="rope.tension.least", value=50e3, bound=42e3, unit="N", use=0.9, price=1e-9
    )
    both = dataclasses.replace(design, limits={use.name: use, least.name: least})
    dear, tension = texts_of(limit_table(both))
    assert dear[-1] == "0.42 mm"
    assert tension == ["rope tension at drum, least", "50.0 kN", "≥ 42.0 kN", "90.0 %", ""]
    priced = [row["price"] for row in json_data(limit_table(both))["rows"]]
    assert priced == [4.16e-4, None]  # a price of a nanometre is noise


def test_facts_name_what_the_figures_rest_on():
    rows = dict(facts(thesis_design()))
    assert rows["rope"] == "one spring with all of the rope's mass at the payload"
    assert rows["drag"] == "1.19 kN s/m, fixed by the case"
    assert rows["check"].startswith("verified on")
    assert "search" not in rows
    assert required_table(thesis_design()) is None


def test_members_and_held_parameters_are_told():
    design = thesis_design()
    case = design.case.replace({"rope.length": 1500.0})
    member = dataclasses.replace(design, case=case, payload_rms=0.5)
    made = dataclasses.replace(design, members=(member,), fixed=("a",))
    text = markdown(design_report(made, bound=False))
    assert "rope.length 1500" in text
    assert "made small: the worst of them" in text
    assert "a is held" in text
    assert "made small" not in markdown(design_report(design, bound=False))


@pytest.mark.parametrize(
    ("agreed", "words"),
    [(4, "4 of 5 starts agree"), (3, "only 3 of 5 starts reached it; more starts or another seed")],
)
def test_an_answer_that_few_starts_reached_is_remarked_upon(agreed: int, words: str) -> None:
    start = Start(
        begin=np.zeros(3), end=np.ones(3), cost=0.5, converged=True, stable=True, message="",
        iterations=9,
    )  # fmt: skip
    design = dataclasses.replace(thesis_design(), starts=(start,) * 5, agreed=agreed)
    assert dict(facts(design, bound=False))["search"].startswith(words)


@pytest.mark.parametrize(
    ("value", "texts"),
    [
        (2.0005, ["2.0005", "≤ 2.0000"]),
        (1.96, ["1.96", "≤ 2.00"]),
        (2.0 * (1.0 + 1e-7), ["2.00", "≤ 2.00"]),
    ],
)
def test_a_value_has_the_digits_that_tell_it_from_its_bound(value: float, texts: list[str]) -> None:
    design = thesis_design()
    peak = LimitUse(name="max_sensitivity", value=value, bound=2.0, use=value / 2.0)
    only = dataclasses.replace(design, limits={"max_sensitivity": peak})
    assert texts_of(limit_table(only))[0][1:3] == texts
    needed = dataclasses.replace(only, required={"max_sensitivity": value})
    table = required_table(needed)
    assert table is not None
    assert texts_of(table)[0][1:] == [texts[1].removeprefix("≤ "), texts[0]]


@pytest.mark.parametrize(
    ("unit", "said"),
    [({"noise_floor": 0.05}, True), ({"gain_error": 0.05}, False)],
)
def test_feed_forward_says_what_hangs_on_how_the_error_of_its_unit_is_read(unit, said):
    case = load_case("subsea-crane").replace({"sensors.mru": unit})
    forward = {"drum.position_gain": 0.001, "heave.gain": 1.0}
    forward |= {"heave.lead": 0.66, "heave.bandwidth": 1.4}
    design = structure_design(case, "feed-forward", forward)
    design = dataclasses.replace(
        design, shares={"payload.displacement": {"hook.heave": 0.03, "mru.error": 0.1}}
    )
    found = unit_notes([design, dataclasses.replace(design, structure="combined")])
    assert len(found) == said
    if said:
        assert "without it these gains leave 30.0 mm" in found[0]
        assert unit_notes([dataclasses.replace(design, ok=False)]) == ()


def test_a_rope_that_rings_without_its_damping_is_told_beside_the_design() -> None:
    case = load_case("subsea-crane")
    gains = {"A": 1.0, "a": 16.022725, "a1": 44.360682, "a2": 6.4163101}
    table = member_table(sh.evaluate_gains(case, gains))
    assert table is not None
    (_, own, *_), (name, least, *_) = table.rows
    assert own > 0.0
    assert name.startswith("a tenth of the rope's damping")
    assert least is None
    (note,) = table.notes
    assert "not asked of a Kelvin-Voigt rope; there it is unstable" in note
