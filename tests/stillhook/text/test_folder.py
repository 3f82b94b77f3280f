"""Folders of results: they are Stillhook's own, or asked for by name."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from designs import thesis_design

import stillhook as sh
from models.basics import InputError
from stillhook.cli import main
from stillhook.text import OutputFolder
from stillhook.text.folder import LIST, check_own

EVALUATE = ("sea", "thesis-1975", "--no-figures", "--quiet", "--out")
MOTION = ("motion", "thesis-1975", "--tp", "8", "--no-figures", "--quiet", "--out")


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    home = tmp_path / "home" / "somebody"
    home.mkdir(parents=True)
    monkeypatch.setattr(Path, "home", lambda: home)
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")


def test_a_folder_that_is_new_or_empty_or_the_commands_own_is_written_to():
    Path("empty").mkdir()
    for folder in ("new/er", "empty"):
        for _ in range(2):
            assert main([*MOTION, folder]) == 0
        assert sorted(path.name for path in Path(folder).iterdir()) == [
            LIST,
            "case.yaml",
            "motion.csv",
        ]
    # Another command's own, one that holds such folders, and what systems leave everywhere.
    assert main(["evaluate", "thesis-1975", "--no-bound", "--no-figures", "--out", "empty"]) == 1
    Path("new/er/.DS_Store").touch()
    Path("new/nobodys").mkdir()
    assert main([*MOTION, "new"]) == 0
    assert main([*MOTION, "new/er"]) == 0


@pytest.mark.parametrize("name", ["notes.txt", ".git/config", "out/report.pdf", "case.yaml"])
def test_results_do_not_land_among_the_files_of_others_unasked(capsys, name):
    other = Path("mine") / name
    other.parent.mkdir(parents=True)
    other.write_text("precious")
    assert main([*MOTION, "mine"]) == 2
    assert capsys.readouterr().err == (
        f"mine: holds what Stillhook has not written ({Path(name).parts[0]}); name a new folder, "
        "or say --force to write among it\n"
    )
    assert [path for path in Path("mine").rglob("*") if path.is_file()] == [other]
    assert main([*MOTION, "mine", "--force"]) == 0
    assert (other.read_text() == "precious") is (name != "case.yaml")
    # What was forced once is not taken for Stillhook's own, unless it was written over.
    assert main([*MOTION, "mine"]) == (0 if name == "case.yaml" else 2)


@pytest.mark.parametrize(
    "words",
    [
        "optimise thesis-1975",
        "structures thesis-1975",
        "evaluate thesis-1975",
        "robust thesis-1975 --vary payload.mass=30t..40t",
        "sensitivity thesis-1975",
        "operability thesis-1975 --held",
        "pareto thesis-1975",
        "size thesis-1975 --co-design",
        "worth thesis-1975",
        "simulate thesis-1975",
        "compare thesis-1975",
        "sweep thesis-1975",
        "sweep thesis-1975 --mode time",
        "sea thesis-1975",
        "motion thesis-1975 --tp 8",
        "vessel import osv-83m",
        "vessel hull --shape box --length 80 --beam 20 --draught 4 --kg 4",
    ],
)
def test_no_command_writes_among_the_files_of_others(capsys, words):
    Path("mine").mkdir()
    Path("mine/notes.txt").touch()
    assert main([*words.split(), "--out", "mine"]) == 2
    assert "mine: holds what Stillhook has not written (notes.txt)" in capsys.readouterr().err
    assert [path.name for path in Path("mine").iterdir()] == ["notes.txt"]


@pytest.mark.parametrize(
    ("place", "message"),
    [
        ("/", "/: is the root of the file system; name a folder for the results"),
        ("{home}", "{home}: is a home folder; name a folder in it, or say --force"),
        ("{home}/../somebody", "{home}/../somebody: is a home folder"),
        ("/home/another", "/home/another: is a home folder"),
        ("/root", "/root: is a home folder"),
    ],
)
def test_neither_the_root_nor_a_home_is_a_folder_for_results(place, message):
    home = str(Path.home())
    with pytest.raises(InputError, match=f"^{re.escape(message.format(home=home))}"):
        check_own(Path(place.format(home=home)))


def test_a_run_that_was_killed_knows_its_files_again(tmp_path):
    folder = OutputFolder.prepare(tmp_path / "out")
    folder.at("half.csv").write_text("written by another, and never counted")
    folder.at("runs/one.csv").touch()
    (tmp_path / "out" / ".case.yaml.123.tmp").touch()
    check_own(tmp_path / "out")


def test_a_folder_that_is_removed_in_mid_run_is_made_again(tmp_path, capsys, monkeypatch):
    def evaluated(*words):
        shutil.rmtree(tmp_path / "out")
        return thesis_design()

    monkeypatch.setattr("synth.evaluate_gains", evaluated)
    words = ["evaluate", "thesis-1975", "--out", str(tmp_path / "out" / "it")]
    assert main([*words, "--no-figures", "--no-bound"]) == 1  # the thesis's gains break a limit
    assert capsys.readouterr().err == ""
    assert sh.load_design(tmp_path / "out" / "it" / "design.yaml").parameters["a"] == 50.0
    check_own(tmp_path / "out" / "it")


def test_two_writers_of_one_folder_leave_whole_files_of_either(tmp_path):
    one, other = (OutputFolder.prepare(tmp_path / "out") for _ in range(2))
    for number in range(20):
        one.write(f"{number}.txt", "1" * 10_000)
        other.write(f"{number}.txt", "2" * 20_000)
        one.write("both.txt", "1" * 10_000)
    assert (tmp_path / "out" / "7.txt").read_text() == "2" * 20_000
    assert (tmp_path / "out" / "both.txt").read_text() == "1" * 10_000
    assert len((tmp_path / "out" / LIST).read_text().splitlines()) == 21
    check_own(tmp_path / "out")


def test_only_what_is_listed_is_tidied_away(tmp_path):
    folder = OutputFolder.prepare(tmp_path / "out")
    (folder.path / "worst-of-all.yaml").touch()
    folder.write("worst.yaml", "")
    OutputFolder.prepare(folder.path).discard("worst*.yaml")
    assert [path.name for path in folder.path.glob("*.yaml")] == ["worst-of-all.yaml"]


def test_a_file_that_is_named_may_lie_among_others(capsys):
    Path("notes.txt").touch()
    for _ in range(2):
        assert main(["vessel", "import", "osv-83m", "--quiet", "--out", "mine.csv"]) == 0
    names = sorted(path.name for path in Path().iterdir())
    assert names == ["mine.csv", "mine.png", "mine.svg", "notes.txt"]


def test_a_name_that_the_file_system_cannot_hold_is_a_sentence(tmp_path, monkeypatch):
    def refuse(path, *rest, **more):
        raise UnicodeEncodeError("ascii", str(path), 0, 1, "ordinal not in range(128)")

    monkeypatch.setattr(Path, "mkdir", refuse)
    with pytest.raises(InputError, match="names of files are in ascii here; name another with"):
        OutputFolder.prepare(tmp_path / "Kr\u00e4n")
