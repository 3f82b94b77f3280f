"""What a click does, without a browser: a tab whose elements only remember what they were told."""

from __future__ import annotations

import asyncio
import dataclasses
from concurrent.futures import ThreadPoolExecutor
from functools import cache

import pytest

import stillhook as sh
from models import InputError
from stillhook.page import StartFolder
from stillhook.page.jobs import Capability
from stillhook.page.tab import Tab
from stillhook.page.worker import CancelledError, WorkerDiedError

GAINS = {"A": 200, "a": 50, "a1": 100, "a2": 100}
NONE = Capability(periods=(), heights=(), held=(), binding=(), note="none")


class Remembering:
    """A layout that keeps, by the name of each method, what it was called with last."""

    def __init__(self, tab):
        self.tab, self.last, self.all = tab, {}, []

    def __getattr__(self, name):
        def told(*arguments):
            self.last[name] = arguments
            self.all.append((name, arguments))

        return told

    @property
    def rms(self):
        return self.last["show"][0].picture.rms

    @property
    def verified(self):
        return self.last["show"][1]


class Told:
    """A worker that answers from a table, at once."""

    def __init__(self, answers):
        self.busy, self.asked, self._answers = False, [], answers

    async def run(self, name, *arguments, told=None):
        self.asked.append((name, arguments))
        if told is not None:
            told("stage", 1, 4)
        found = self._answers.get(name, NONE)
        if isinstance(found, Exception):
            raise found
        return found

    def cancel(self):
        self.asked.append(("cancel", ()))

    def end(self):
        self.asked.append(("end", ()))


@cache
def design(**gains):
    return sh.evaluate_gains(sh.load_case("thesis-1975"), {**GAINS, **gains})


def played(tmp_path, script, **answers):
    """Run a script on a tab; return its layout and what its worker was asked."""
    downloads = []

    async def main():
        with ThreadPoolExecutor(1) as executor:
            tab = Tab(
                StartFolder(tmp_path.resolve()),
                executor,
                Remembering,
                lambda content, name: downloads.append((content, name)),
            )
            worker = Told(answers)
            tab._worker, tab._behind = worker, Told({})
            await tab.open("thesis-1975")
            await tab._latest.idle()
            await script(tab)
            await tab._latest.idle()
            tab.end()
            return tab._layout, worker.asked

    return *asyncio.run(main()), downloads


def test_a_case_with_gains_is_shown_at_once(tmp_path):
    async def nothing(tab):
        assert tab.state.structure == "payload-feedback"
        assert "thesis-1975 (bundled)" in tab.case_names().values()

    layout, asked, _ = played(tmp_path, nothing)
    assert layout.rms == "11.7 mm"
    assert layout.verified == ""
    assert [name for name, _ in asked] == ["cancel", "cancel", "end"]


def test_the_best_gains_are_taken_verified_until_something_moves(tmp_path):
    best = design(a1=110)
    assert best.verification.ok

    async def script(tab):
        await tab.optimise(every=False)
        await tab._latest.idle()
        layout = tab._layout
        assert tab.state.parameters["a1"] == 110
        assert layout.verified == best.verification.status
        assert ("working", ("Searching payload-feedback: stage, 1 of 4", 0.25)) in layout.all
        assert layout.last["working"] == ("", None)
        rows, now = layout.last["show_designs"]
        assert (rows[0][0], now) == ("payload-feedback", 0)
        tab.changed("a1", "100")
        await tab._latest.idle()
        assert layout.verified == ""
        await tab.choose(0)
        await tab._latest.idle()
        assert tab.state.parameters["a1"] == 110
        assert layout.verified
        await tab.choose(7)

    _, asked, _ = played(tmp_path, script, optimise=best)
    name, (_, structure, known, starts) = asked[1]
    assert (name, structure, known["a1"], starts) == ("optimise", "payload-feedback", 100.0, 8)


def test_alternatives_are_listed_and_taken_with_their_structure(tmp_path):
    law = sh.prepare(sh.load_case("thesis-1975"), "drum-feedback").posed.first.law
    other = sh.evaluate_gains(
        sh.load_case("thesis-1975"),
        {p.name: max(p.low, 0.0) or 0.0 for p in law.parameters} | {"drum.position_gain": 1.0}
        | {"rolloff.corner": 20.0, "rolloff.damping": 0.7},
        "drum-feedback",
    )  # fmt: skip
    best = dataclasses.replace(design(), alternatives=(other,))

    async def script(tab):
        await tab.optimise(every=True)
        rows, _ = tab._layout.last["show_designs"]
        assert [row[0] for row in rows] == ["payload-feedback", "drum-feedback"]
        await tab.choose(1)
        await tab._latest.idle()
        assert tab.state.structure == "drum-feedback"
        assert tab._layout.last["show_case"][3] == "drum-feedback"
        assert "rolloff.corner" in {c.key for c in tab._layout.last["show_controls"][0]}

    _, asked, _ = played(tmp_path, script, optimise=best)
    assert asked[1][1][1] is None


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (CancelledError("cancelled"), ""),
        (WorkerDiedError("the worker process was ended by SIGKILL; try again"), "SIGKILL"),
        (InputError("limits: must be kinder"), "limits: must be kinder"),
        (ZeroDivisionError("by zero\nand more"), "Unexpected error, ZeroDivisionError: by zero"),
    ],
)
def test_what_fails_is_a_sentence_and_the_page_goes_on(tmp_path, error, said):
    async def script(tab):
        await tab.optimise(every=False)
        told = tab._layout.last["say"][0]
        assert said in told
        assert "and more" not in told
        assert bool(told) == bool(said)
        assert tab._layout.last["working"] == ("", None)
        tab.changed("a1", "90")
        await tab._latest.idle()
        assert tab._layout.last["say"] == ("",)

    layout, _, _ = played(tmp_path, script, optimise=error)
    assert layout.rms != "11.7 mm"


def test_a_bad_value_and_a_bad_case_leave_the_page_as_it_is(tmp_path):
    (tmp_path / "bad.yaml").write_text("sea: {}\nwinch: {}\npayload: {}\n", encoding="utf-8")

    async def script(tab):
        before = tab.state
        tab.changed("a1", "much")
        assert "must be a number" in tab._layout.last["say"][0]
        assert tab.state is before
        await tab.open("bad.yaml")
        assert "bad.yaml" in tab._layout.last["say"][0]
        assert tab._layout.last["show_case"][0] == "thesis-1975"
        assert tab.state is before
        await tab.choose_structure("combined")
        tab.changed("rope.length", "-5")
        await tab._latest.idle()
        assert "rope.length" in tab._layout.last["say"][0]

    played(tmp_path, script)


def test_a_save_is_checked_first_and_marks_the_design(tmp_path):
    async def script(tab):
        await tab.save("mine", replace=False)
        await tab._latest.idle()
        assert "Saved mine-case.yaml and mine-design.yaml" in tab._layout.last["note"][0]
        assert tab._layout.verified
        await tab.save("mine", replace=False)
        assert "is there already" in tab._layout.last["say"][0]

    _, asked, _ = played(tmp_path, script, verified=design())
    assert asked[1][0] == "verified"
    assert sh.load_design(tmp_path / "mine-design.yaml").gains["a1"] == 100.0


def test_a_report_is_made_in_a_folder_of_its_own_that_goes(tmp_path):
    async def script(tab):
        await tab.report()

    layout, asked, downloads = played(tmp_path, script, report=b"<html>")
    assert downloads == [(b"<html>", "thesis-1975-report.html")]
    assert asked[1][1][3].startswith(str(tmp_path.resolve()))
    assert list(tmp_path.iterdir()) == []
    assert layout.last["note"]


def test_the_capability_follows_once_nothing_moves(tmp_path, monkeypatch):
    monkeypatch.setattr("stillhook.page.tab._PAUSE", 0.0)

    async def script(tab):
        async def settled():
            await tab._latest.idle()
            await tab._waiting

        behind = tab._behind
        await settled()
        behind.asked.clear()
        tab.changed("a1", "90")
        await settled()
        assert [name for name, _ in behind.asked if name != "cancel"] == ["capability"]
        assert "none" in tab._layout.last["show_capability"][0]
        tab.changed("sea.significant_height", "1.5")  # the same winch in a calmer sea
        await settled()
        assert [name for name, _ in behind.asked if name != "cancel"] == ["capability"]
        tab.changed("rope.length", "1500")
        await settled()
        assert [name for name, _ in behind.asked if name != "cancel"] == ["capability"] * 2

    played(tmp_path, script)
