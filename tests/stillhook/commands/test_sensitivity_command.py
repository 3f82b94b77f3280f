from __future__ import annotations

import pandas as pd
import pytest
from designs import thesis_design
from matplotlib.backends.backend_agg import FigureCanvasAgg

from stillhook.cli import main
from stillhook.commands.working import kept_in
from stillhook.designs import sensitivity_report
from stillhook.designs.sensitivity import tornado_figure
from stillhook.text import picture
from synth.sensitivity import sensitivity


@pytest.fixture(scope="module")
def study():
    return sensitivity(thesis_design())


def test_a_study_ends_well_and_fills_its_folder(tmp_path, monkeypatch, capsys, study):
    monkeypatch.chdir(tmp_path)
    assert main(["sensitivity", "thesis-1975", "--second", "1"]) == 0
    said = capsys.readouterr().out
    assert "winch.gearbox.ratio" in said
    assert "stillhook margins thesis-1975" in said
    folder = tmp_path / "out" / "thesis-1975-sensitivity"
    assert {*kept_in(folder)} == {
        "sensitivity.csv",
        "moved.csv",
        "tornado.svg",
        "tornado.png",
    }
    table = pd.read_csv(folder / "sensitivity.csv", float_precision="round_trip")
    by_path = table.set_index("path")["dln(payload_rms)/dln(path)"]
    for entry in study.elasticities:
        assert by_path[entry.path] == pytest.approx(entry.payload_rms, rel=1e-9)
    assert (by_path[list(study.without_effect)] == 0.0).all()


@pytest.mark.ci
def test_ranges_are_studied_too(tmp_path, capsys):
    words = ["--vary", "payload.mass=30%", "--vary", "gains.a1=10%", "--samples", "64"]
    assert main(["sensitivity", "thesis-1975", *words, "--out", str(tmp_path / "out")]) == 0
    assert "0 of 256 cases are unstable" in capsys.readouterr().out
    table = pd.read_csv(tmp_path / "out" / "indices.csv")
    rms = table[table.figure == "payload_rms"].set_index("path")
    assert rms.total["gains.a1"] > 0.9 > rms.total["payload.mass"]
    assert set(table.figure) == {"payload_rms", "modulus_margin"}
    assert (tmp_path / "out" / "indices.png").stat().st_size > 1000


@pytest.mark.ci
def test_one_number_alone_is_studied_too(tmp_path, capsys):
    words = ["--vary", "payload.mass=5%", "--samples", "32", "--quiet"]
    assert main(["sensitivity", "thesis-1975", *words, "--out", str(tmp_path / "out")]) == 0
    table = pd.read_csv(tmp_path / "out" / "indices.csv")
    assert set(table.path) == {"payload.mass"}
    assert table.total.to_numpy() == pytest.approx(1.0, abs=0.2)


@pytest.mark.ci
def test_quietly_it_says_one_sentence(tmp_path, capsys, study):
    assert (
        main(["sensitivity", "thesis-1975", "--quiet", "--second", "0", "--out", str(tmp_path)])
        == 0
    )
    assert (
        capsys.readouterr().out.strip()
        == f"thesis-1975: {sensitivity_report(study, (), None).status}"
    )


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["thesis-1975", "--plus", "much"], "--plus must be a share, as in '10 %'"),
        (["thesis-1975", "--plus", "-2"], "--plus must be in [-0.9, 10], got -2"),
        (["thesis-1975", "--second", "-1"], "--second must be at least 0, got -1"),
        (["thesis-1975", "--gains", "A=1,a=0,a1=0,a2=0", "--design", "x"], "not both"),
    ],
)
def test_bad_input_is_one_sentence(tmp_path, capsys, words, sentence):
    assert main(["sensitivity", *words, "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert sentence in said
    assert said.count("\n") == 1


def test_the_largest_bar_is_on_top_and_no_text_leaves_the_figure(study):
    figure = tornado_figure(study, bars=5)
    axes = figure.axes[0]
    labels = [text.get_text() for text in axes.get_yticklabels()]
    assert len(labels) == 5
    sizes = [abs(study[path].payload_rms) for path in labels]
    assert sizes == sorted(sizes)
    assert picture(figure, "png")[:4] == b"\x89PNG"
    FigureCanvasAgg(figure).draw()
    shown = [figure._suptitle, axes.title, *axes.get_yticklabels()]
    for box in (text.get_window_extent() for text in shown):
        assert box.x0 >= figure.bbox.x0 - 1.0
        assert box.x1 <= figure.bbox.x1 + 1.0
