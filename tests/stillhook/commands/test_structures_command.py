"""`stillhook structures` and `optimise --structure`, the file of a structure, table and figure."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

import stillhook as sh
from models.basics import InputError
from stillhook.cli import main
from stillhook.commands.working import kept_in
from stillhook.designs import design_text, load_design, save_design, structures_table
from stillhook.designs.structures import share_of, structures
from stillhook.text import markdown, picture
from synth.question import PAYLOAD

UNIT = "sensors.mru={noise_floor: 0, noise_fraction: 0.02}"
FAST = ["--set", UNIT, "--set", "sensors.telemetry.delay=25 ms", "--starts", "2"]
NOISY = {"sensors.mru": {"noise_floor": 0.0, "noise_fraction": 0.02}}


@pytest.fixture(scope="module")
def forward() -> sh.Design:
    case = sh.load_case("thesis-1975").replace(NOISY)
    return sh.optimise_gains(case, "feed-forward", starts=2)


@pytest.fixture(scope="module")
def feedback() -> sh.Design:
    case = sh.load_case("thesis-1975").replace(NOISY)
    return sh.optimise_gains(case, "payload-feedback", starts=2)


def test_saved_design_loads_to_the_last_digit_and_verifies(
    forward: sh.Design, tmp_path: Path
) -> None:
    path = save_design(forward, tmp_path / "design.yaml")
    again = load_design(path)
    assert design_text(again) == design_text(forward)
    assert dict(again.parameters) == dict(forward.parameters)
    assert again.margins is not None
    assert forward.margins is not None
    assert again.margins.delay == forward.margins.delay
    assert again.verify().ok


def test_a_file_that_is_something_else_is_refused(tmp_path: Path) -> None:
    other = tmp_path / "other.yaml"
    other.write_text("stillhook_case: 1\n")
    with pytest.raises(InputError, match="no key `stillhook_design`"):
        load_design(other)
    other.write_text("stillhook_structure: 99\n")
    with pytest.raises(InputError, match="99"):
        load_design(other)
    with pytest.raises(InputError, match="no such"):
        load_design(tmp_path / "missing.yaml")


def test_shares_of_the_variance_add_up(forward: sh.Design, feedback: sh.Design) -> None:
    assert sum(share_of(forward, name) for name in ("sea", "MRU", "noise")) == pytest.approx(1.0)
    expected = (forward.shares[PAYLOAD]["mru.error"] / forward.payload_rms) ** 2
    assert share_of(forward, "MRU") == pytest.approx(expected, rel=1e-6)
    assert share_of(feedback, "sea") == 1.0
    parts = {"hook.heave": 3.0, "payload.velocity_noise": 4.0}
    noisy = replace(feedback, shares={PAYLOAD: parts})
    assert share_of(noisy, "noise") == pytest.approx(16.0 / 25.0)


def test_table_says_what_limits(forward: sh.Design, feedback: sh.Design) -> None:
    table = structures_table([forward, feedback])
    first, second = table.cells(0), table.cells(1)
    assert "max_sensitivity" in second[-1]
    assert first[table.headings.index("MRU")].endswith("%")
    text = markdown(structures_table([forward, feedback], bound=False))
    assert text.count("\n") == 4
    assert markdown(table).count("\n") == 6  # and what "over best" means
    assert "payload-feedback" in text
    broken = replace(forward, ok=False, status="the drive is too small: much")
    assert structures_table([broken]).rows[0][-1] == "the drive is too small"


def test_figure_shows_every_design(forward: sh.Design, feedback: sh.Design) -> None:
    lost = replace(forward, structure="lost", payload_rms=math.inf, margins=None, ok=False)
    figure = structures([forward, feedback, lost])
    axes = figure.axes[0]
    names = [label.get_text() for label in axes.get_yticklabels()]
    assert names == ["feed-forward", "payload-feedback", "lost"]
    # The bar of a design ends at its rms, however its shares divide it.
    ends = [bar.get_x() + bar.get_width() for bar in axes.patches]
    for design in (forward, feedback):
        assert min(abs(end - 1e3 * design.payload_rms) for end in ends) < 1e-6 * max(ends)
    assert picture(figure, "svg").startswith(b"<?xml")
    with pytest.raises(InputError, match="stable"):
        structures([lost])


def test_structures_command_compares_and_writes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    names = "payload-feedback,feed-forward,payload-feedback"
    status = main(["structures", "thesis-1975", *FAST, "--structures", names, "--out", str(out)])
    said = capsys.readouterr().out
    assert status == 0
    assert "2 structures" in said
    assert "feed-forward" in said
    written = {*kept_in(out)}
    assert {
        "case.yaml",
        "feed-forward.yaml",
        "payload-feedback.yaml",
        "structures.md",
        "structures.png",
        "structures.svg",
    } == written
    assert load_design(out / "feed-forward.yaml").ok


def test_optimise_takes_a_structure(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    line = ["optimise", "thesis-1975", *FAST, "--structure", "feed-forward", "--out", str(out)]
    assert main(line) == 0
    said = capsys.readouterr().out
    assert "heave.gain" in said
    assert "heave.lead" in said
    assert load_design(out / "design.yaml").structure == "feed-forward"
    assert main([*line, "--quiet"]) == 0
    assert capsys.readouterr().out.startswith("thesis-1975: feed-forward: ")


@pytest.mark.parametrize(
    ("line", "named"),
    [
        (["structures", "thesis-1975", "--structures", "combind"], "combind"),
        (["structures", "thesis-1975", "--structures", ","], "--structures"),
        (["structures", "thesis-1975", "--starts", "0"], "--starts"),
        (["optimise", "thesis-1975", "--structure", "nonsense"], "nonsense"),
        (["optimise", "thesis-1975", "--structure", "combined", "--seed", "-1"], "--seed"),
    ],
)
def test_bad_input_is_told_in_a_sentence(
    line: list[str], named: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(line) == 2
    assert named in capsys.readouterr().err


def test_a_drive_that_is_too_small_is_told_what_it_would_take(tmp_path: Path) -> None:
    design = sh.optimise_gains(
        sh.load_case("thesis-1975").replace({**NOISY, "limits.drive": "enforce"}),
        "feed-forward",
        starts=1,
    )
    assert not design.ok
    assert design.drive_kept
    assert 0.0 < design.significant_height < design.case.sea.significant_height
    assert "breaks first; feasible up to H_s" in design.status
    assert "instead of" in design.status
    assert all(use.kept for use in design.limits.values() if use.enforced)
    assert design.verification.ok
    assert load_design(save_design(design, tmp_path / "d.yaml")).status == design.status
