"""The project's own papers agree with each other, and what is built holds what it should."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from models.basics import how_to_install

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PACKAGES = ("stillhook", "models", "synth", "mpc")


def pins() -> dict[str, str]:
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pairs = [line.split("==") for line in lines if line and not line.startswith("#")]
    return {canonicalize_name(name): version for name, version in pairs}


def requirements() -> list[Requirement]:
    texts = [*PROJECT["dependencies"]]
    for extra in PROJECT["optional-dependencies"].values():
        texts += extra
    found = [Requirement(text) for text in texts]
    # An extra may name others of our own.
    return [requirement for requirement in found if requirement.name != PROJECT["name"]]


@pytest.mark.parametrize("requirement", requirements(), ids=lambda r: r.name)
def test_every_requirement_is_pinned_within_its_range(requirement):
    assert requirement.specifier.contains(pins()[canonicalize_name(requirement.name)])
    assert [s.operator for s in requirement.specifier] == [">="], "a lower bound, and no more"


def test_constraints_are_plain_versions_that_install_anywhere():
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    plain = re.compile(r"[A-Za-z0-9._-]+==[0-9][A-Za-z0-9.]*")
    assert [x for x in lines if not x.startswith("#") and not plain.fullmatch(x)] == []
    assert {"stillhook", "pip", "setuptools"} & set(pins()) == set()


def test_the_wheel_is_kept_off_package_indexes():
    # `models`, `synth` and `mpc` are names that nobody may claim for everybody.
    assert "Private :: Do Not Upload" in PROJECT["classifiers"]


def test_citation_names_this_version_and_licence():
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {PROJECT['version']}\n" in citation
    assert f"\nlicense: {PROJECT['license']}\n" in citation


def test_changelog_has_a_place_for_the_next_change():
    assert "\n## [Unreleased]\n" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_no_package_hides_behind_the_tests():
    # tests/models/__init__.py would shadow the package in every test run.
    assert list((ROOT / "tests").rglob("__init__.py")) == []


def told_to_users() -> list[Path]:
    """Return docs, README, notebooks, scripts and sources."""
    folders = (*PACKAGES, "docs", "notebooks", "benchmarks")
    found = [path for folder in folders for path in (ROOT / folder).rglob("*")]
    kept = [p for p in found if p.suffix in (".py", ".md", ".ipynb", ".yaml") and p.is_file()]
    return [*kept, ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "Makefile"]


def test_nobody_is_told_to_install_a_name_that_anybody_may_take():
    # No index has Stillhook: whoever takes its name there would run code on the user's machine.
    named = re.compile(
        r"stillhook\[|pip3? install [^\n]*(?<![\w-])(stillhook|models|synth|mpc)(?![\w/-])"
    )
    texts = {path: path.read_text(encoding="utf-8") for path in told_to_users()}
    assert len(texts) > 400
    assert {str(path): m[0] for path, text in texts.items() if (m := named.search(text))} == {}


@pytest.mark.parametrize("extra", sorted({*PROJECT["optional-dependencies"]} - {"dev", "docs"}))
def test_every_extra_has_a_chore_that_its_message_names(extra):
    assert f"`make {extra}`" in how_to_install(extra)
    said = subprocess.run(["make", "--dry-run", extra], cwd=ROOT, capture_output=True, text=True)
    assert f"-e '.[{extra}]'" in said.stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """A wheel and an sdist, built from a copy so that the checkout stays as it is."""
    source = tmp_path_factory.mktemp("source") / "checkout"
    ignored = shutil.ignore_patterns(
        ".git", ".venv", "out", "dist", "_build", ".*_cache", "__pycache__"
    )
    shutil.copytree(ROOT, source, ignore=ignored)
    out = tmp_path_factory.mktemp("dist")
    run = subprocess.run(
        [sys.executable, "-m", "build", "--outdir", str(out), str(source)],
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert run.returncode == 0, run.stdout[-3000:] + run.stderr[-3000:]
    return out


@pytest.mark.slow
def test_wheel_holds_the_packages_with_their_cases_and_nothing_else(built):
    (wheel,) = built.glob("*.whl")
    names = set(zipfile.ZipFile(wheel).namelist())
    info = f"stillhook-{PROJECT['version']}.dist-info"
    assert {name.split("/")[0] for name in names} == {*PACKAGES, info}
    expected = {
        str(path.relative_to(ROOT))
        for package in PACKAGES
        for path in (ROOT / package).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert {name for name in names if not name.startswith(info)} == expected
    assert any(name.startswith("models/cases/") and name.endswith(".yaml") for name in names)
    assert {f"{package}/py.typed" for package in PACKAGES} <= names
    assert f"{info}/licenses/LICENSE" in names


@pytest.mark.slow
def test_wheel_works_away_from_the_checkout(built, tmp_path):
    (wheel,) = built.glob("*.whl")
    site = tmp_path / "site"
    zipfile.ZipFile(wheel).extractall(site)
    script = (
        "import sys; sys.path.insert(0, sys.argv[1]); import stillhook as sh; "
        "print(sh.load_case('subsea-crane').name); print(sh.__file__)"
    )
    run = subprocess.run(
        [sys.executable, "-I", "-c", script, str(site)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert run.returncode == 0, run.stderr[-2000:]
    name, file = run.stdout.splitlines()
    assert name == "subsea-crane"
    assert Path(file).is_relative_to(site)


@pytest.mark.slow
def test_sdist_holds_what_the_tests_need(built):
    (sdist,) = built.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    wanted = {"LICENSE", "README.md", "Makefile", "constraints.txt", "tests/test_packaging.py"}
    assert wanted <= names
    assert not any(name.startswith((".venv", "out/")) for name in names)
