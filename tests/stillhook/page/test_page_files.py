"""The folder that the page was started in: nothing outside is read or written."""

from __future__ import annotations

import pytest

import stillhook as sh
from models import InputError
from models.case import template_text
from stillhook.page import StartFolder

OUTSIDE = [
    "../secret.yaml",
    "../../etc/passwd",
    "/etc/passwd",
    "sub/../../secret.yaml",
    "link/secret.yaml",
    "link.yaml",
    "",
    ".",
    ".hidden.yaml",
    "sub/.git/config",
    "a\0b",
]


@pytest.fixture
def folder(tmp_path):
    """A start folder with a case, beside what nobody may see."""
    home = tmp_path / "home"
    (home / "sub").mkdir(parents=True)
    (tmp_path / "secret.yaml").write_text(template_text(), encoding="utf-8")
    (home / "case.yaml").write_text(template_text(), encoding="utf-8")
    (home / "sub" / "below.yaml").write_text(template_text(), encoding="utf-8")
    (home / ".hidden.yaml").write_text(template_text(), encoding="utf-8")
    (home / "notes.yaml").write_text("hello: world\n", encoding="utf-8")
    (home / "link").symlink_to(tmp_path)
    (home / "link.yaml").symlink_to(tmp_path / "secret.yaml")
    return StartFolder(home.resolve())


def design(case):
    return sh.evaluate_gains(case, {"A": 200, "a": 50, "a1": 100, "a2": 100})


@pytest.mark.parametrize("name", OUTSIDE)
def test_what_leads_out_is_refused(folder, name):
    with pytest.raises(InputError):
        folder.path(name)
    with pytest.raises(InputError):
        folder.open_case(name)


def test_cases_of_the_folder_are_listed_and_opened(folder):
    assert folder.cases() == ["case.yaml", "sub/below.yaml"]
    case, _ = folder.open_case("sub/below.yaml")
    assert case.rope.length > 0.0
    assert folder.open_case("thesis-1975")[0].name == "thesis-1975"


def test_remarks_on_a_case_are_handed_on(folder):
    text = template_text().replace("significant_height: 2 m", "significant_height: 14 m")
    (folder.root / "steep.yaml").write_text(text, encoding="utf-8")
    assert "significant_height: 14 m" in text
    assert any("steep" in remark for remark in folder.open_case("steep.yaml")[1])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("vessel: {raos: ../secret.rao}\n", "vessel.raos: names '../secret.rao'"),
        ("vessel: {raos: /etc/passwd}\n", "vessel.raos: names '/etc/passwd'"),
        ("sea: {file: link/buoy.spec}\n", "sea.file: names 'link/buoy.spec'"),
    ],
)
def test_a_case_that_names_a_file_outside_is_refused_before_that_is_read(folder, text, said):
    (folder.root / "bad.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as refused:
        folder.open_case("bad.yaml")
    assert said in str(refused.value)
    assert "not in the folder that the page was started in" in str(refused.value)


@pytest.mark.parametrize(("name", "text"), [("bad.toml", "= 1"), ("bad.yaml", "a: [")])
def test_a_case_with_errors_says_so(folder, name, text):
    (folder.root / name).write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=f"^{name}"):
        folder.open_case(name)


def test_design_and_case_are_saved_and_load_again(folder):
    case = sh.load_case("thesis-1975")
    paths = folder.save("mine", case, design(case))
    assert [path.name for path in paths] == ["mine-case.yaml", "mine-design.yaml"]
    assert sh.load_case(paths[0]) == case
    assert sh.load_design(paths[1]).gains["a1"] == 100.0
    assert folder.cases() == ["case.yaml", "mine-case.yaml", "sub/below.yaml"]
    with pytest.raises(InputError, match="is there already"):
        folder.save("mine", case, design(case))
    assert folder.save("mine", case, design(case), replace=True) == paths


@pytest.mark.parametrize("name", ["../mine", "sub/mine", "a\\b", " ", ".mine", "link"])
def test_a_name_to_save_under_is_plain(folder, name):
    case = sh.load_case("thesis-1975")
    if name == "link":
        (folder.root / "link-case.yaml").symlink_to(folder.root.parent / "secret.yaml")
    with pytest.raises(InputError):
        folder.save(name, case, design(case), replace=True)
    assert (folder.root.parent / "secret.yaml").read_text(encoding="utf-8") == template_text()
    assert not list(folder.root.parent.glob("mine*"))


def test_both_files_are_saved_or_neither(folder, monkeypatch):
    case = sh.load_case("thesis-1975")
    found = design(case)
    (folder.root / "mine-case.yaml").write_text("as it was", encoding="utf-8")
    from stillhook.page import files

    whole = files._write

    def broken(path, data):
        if path.name.endswith("-design.yaml"):
            raise InputError("the disk is full")
        whole(path, data)

    monkeypatch.setattr(files, "_write", broken)
    with pytest.raises(InputError, match="the disk is full"):
        folder.save("mine", case, found, replace=True)
    with pytest.raises(InputError, match="the disk is full"):
        folder.save("other", case, found)
    assert (folder.root / "mine-case.yaml").read_text(encoding="utf-8") == "as it was"
    assert not list(folder.root.glob("*-design.yaml"))
    assert not list(folder.root.glob("other*"))
