"""Digests of code: what counts of a file, and which files count."""

from __future__ import annotations

import time

import pytest

from stillhook.keeper import code_digest, digest, versions

FILES = {
    "__init__.py": "",
    "entry.py": '''
"""Something to do."""

from typing import TYPE_CHECKING

from . import constants
from .room import number

if TYPE_CHECKING:
    from .typed import Kind


def work(kind: "Kind") -> float:
    """Return a number."""
    from .late import more  # as heavy as a solver

    return number() + constants.LEAST + more()
''',
    "constants.py": "LEAST = 2.0\n",
    "late.py": "def more():\n    return 3.0\n",
    "typed.py": "class Kind:\n    pass\n",
    "alone.py": "OTHER = 4.0\n",
    "room/__init__.py": """
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .numbers import number as number
    from .others import other as other
""",
    "room/numbers.py": """
from ..constants import LEAST

def number():
    '''Return it.'''
    return 1.0 + LEAST
""",
    "room/others.py": "def other():\n    return 5.0\n",
}


@pytest.fixture
def tree(tmp_path, monkeypatch):
    """A package of its own, and its digest after changes to a file."""
    home = tmp_path / "small_house"
    for name, text in FILES.items():
        path = home / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    monkeypatch.syspath_prepend(tmp_path)

    def after(name=None, old="", new=""):
        if name is not None:
            path = home / name
            assert old in path.read_text()
            path.write_text(path.read_text().replace(old, new))
        code_digest.cache_clear()
        return code_digest("small_house.entry")

    return after


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("entry.py", "Something to do.", "Something else to do."),
        ("entry.py", "as heavy as a solver", "not that heavy"),
        ("room/numbers.py", "Return it.", "Return the number."),
        ("room/numbers.py", "1.0 + LEAST", "(  # in two lines\n        1.0 + LEAST\n    )"),
        ("typed.py", "pass", "kind = 1"),  # for type checkers alone
        ("alone.py", "4.0", "5.0"),  # nobody imports it
        ("room/others.py", "5.0", "6.0"),  # from the same face, but not asked for
    ],
)
def test_words_and_files_that_are_not_reached_do_not_count(tree, name, old, new):
    assert tree(name, old, new) == tree()
    before = tree()
    assert tree(name, new, old) == before


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("entry.py", "number() +", "number() -"),
        ("constants.py", "2.0", "2.5"),
        ("late.py", "3.0", "3"),
        ("room/numbers.py", "1.0", "1.5"),
        ("room/__init__.py", "from .numbers import", "from .others import"),
    ],
)
def test_what_can_change_a_number_counts(tree, name, old, new):
    before = tree()
    assert tree(name, old, new) != before
    assert tree(name, new, old) == before


@pytest.mark.parametrize(("use", "counts"), [("room.number()", False), ("work(room)", True)])
def test_of_a_face_that_is_imported_whole_what_is_used_counts(tree, monkeypatch, use, counts):
    monkeypatch.setattr(digest, "_PACKAGES", ("small_house",))
    tree("entry.py", "from .room import number", "import small_house.room as room")
    before = tree("entry.py", "return number()", f"return {use}")
    assert tree("room/numbers.py", "1.0", "1.5") != before
    tree("room/numbers.py", "1.5", "1.0")
    assert (tree("room/others.py", "5.0", "6.0") != before) == counts


def test_a_module_beside_counts_if_it_is_named(tmp_path, monkeypatch):
    (tmp_path / "a_study.py").write_text("from helpers_of_studies import LEAST\n")
    helper = tmp_path / "helpers_of_studies.py"
    monkeypatch.syspath_prepend(tmp_path)
    found = []
    for number in (1, 2):
        helper.write_text(f"LEAST = {number}{'  # more' * number}\n")
        code_digest.cache_clear()
        beside = frozenset({"helpers_of_studies"})
        found.append((code_digest("a_study"), code_digest("a_study", beside)))
    (alone, first), (same, second) = found
    assert alone == same
    assert first != second


def test_the_versions_of_the_libraries_count(tree, monkeypatch):
    before = tree()
    real = digest.version
    monkeypatch.setattr(digest, "version", lambda n: "0.0" if n == "daqp" else real(n))
    assert tree() != before


def test_the_code_of_a_study_is_read_in_less_than_a_second():
    code_digest.cache_clear()
    began = time.process_time()
    found = code_digest("stillhook.sweeps.time_cases")
    assert time.process_time() - began < 1.0
    assert len(found) == 16


def test_what_a_run_needs_is_reached_through_faces_and_functions():
    from stillhook.comparison.bench import CellBench

    reached = digest._Reached(CellBench.__module__).contents
    for module in (
        "models.plant.linear",
        "models.simulation.kernel",
        "mpc.linear.linear",
        "mpc.nonlinear.nonlinear",
        "mpc.floor.clairvoyance",
        "synth.controllers.linear_feedback",
    ):
        assert module in reached, module
    assert not [module for module in reached if module.startswith(("synth.sizing", "tests"))]
    assert (
        versions(CellBench)["code"] == code_digest(CellBench.__module__) == code_digest(CellBench)
    )
