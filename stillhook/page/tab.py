"""One tab of the page: its state, its warm desk, its workers, and what a click does.

    slider --> State --> Latest --> Desk.look --> Layout.show
    button --> Worker --> State or file --> Layout

Each tab has its own of everything but the thread that looks are made in.
"""

from __future__ import annotations

import asyncio
import math
import re
import shutil
import tempfile
from collections.abc import Mapping
from concurrent.futures import Executor
from typing import TYPE_CHECKING, Any, TypeVar

from models.basics import InputError, StillhookError
from models.case import Case, bundled_cases
from synth.design import Design

from ..designs import LIMITS
from ..text import folder_name, number, percent, quantity
from .charts import capability_chart
from .curves import prices_of
from .desk import Desk, Drawn, Question
from .files import StartFolder
from .jobs import Capability
from .latest import Latest
from .state import State, usual_structure
from .strip import strip_html
from .worker import CancelledError, Worker

if TYPE_CHECKING:
    from collections.abc import Callable

    from .layout import Layout

T = TypeVar("T")

_STARTS = 8  # of a search
_FEW = 1  # of the search for first gains
_PAUSE = 0.8  # after the last change, before the capability is computed anew [s]
_LONGEST = 150  # characters of a status in the list
_KEPT = 12  # designs that are listed


class Tab:
    """What one tab does; see `stillhook.page.layout.Actions`."""

    def __init__(
        self,
        folder: StartFolder,
        executor: Executor,
        build: Callable[[Tab], Layout],
        download: Callable[[bytes, str], None],
    ) -> None:
        self._folder, self._executor, self._download = folder, executor, download
        self._desk = Desk()
        self._latest: Latest[Question, Drawn] = Latest(
            executor, self._desk.look, self._looked, self._failed
        )
        self._worker, self._behind = Worker(), Worker()
        self._state: State | None = None
        self._verified: tuple[State, str] | None = None
        self._prices: dict[str, float] = {}
        self._designs: list[Design] = []
        self._capability: tuple[State, Capability] | None = None
        self._waiting: asyncio.Task[None] | None = None  # for the capability of what is wanted
        self._wanted: State | None = None
        self._sea = 0.0, 0.0  # T_p [s] and H_s [m] of the last look
        self._name = ""  # under which the case was opened
        self._layout = build(self)
        self._layout.show_designs([], None)

    @property
    def state(self) -> State | None:
        """What stands on the page, once a case is open."""
        return self._state

    def end(self) -> None:
        """End everything: the tab was closed."""
        self._latest.end()
        if self._waiting is not None:
            self._waiting.cancel()
        for worker in (self._worker, self._behind):
            worker.cancel()
            worker.end()

    def case_names(self) -> Mapping[str, str]:
        """Return the cases that can be opened, each with what is shown."""
        bundled = {name: f"{name} (bundled)" for name, _ in bundled_cases()}
        return {**bundled, **{name: name for name in self._folder.cases()}}

    async def open(self, name: str, changes: Mapping[str, Any] | None = None) -> None:
        """Open a case; where it cannot be, say why and leave the page as it is."""
        self._worker.cancel()
        try:
            case, remarks = await self._beside(self._folder.open_case, name)
            if changes:
                case = case.replace(dict(changes))
            state = await self._made(case, usual_structure(case))
        except InputError as error:
            self._refused(str(error))
            return
        self._designs, self._prices = [], {}
        self._layout.say(" ".join(remarks[:1]))
        self._layout.show_designs([], None)
        self._layout.show_strip("")
        self._take(state, name)
        await self._first_gains(state)

    async def choose_structure(self, name: str) -> None:
        """Take another structure, and find first gains for it."""
        before = self._state
        if before is None or name == before.structure:
            return
        self._worker.cancel()
        try:
            state = await self._made(before.case, name, before.changes)
        except InputError as error:
            self._refused(str(error))
            return
        self._prices = {}
        self._take(state, self._name)
        await self._first_gains(state)

    def changed(self, key: str, text: str) -> None:
        """Take another value of a control, in the unit that it shows."""
        if self._state is None:
            return
        try:
            self._state = self._state.with_text(key, text)
        except InputError as error:
            self._layout.say(_sentence(error))
            return
        self._ask()

    async def optimise(self, *, every: bool) -> None:
        """Find the best gains, in the worker, and take them."""
        state = self._state
        if state is None:
            return
        structure = None if every else state.structure
        await self._search(state, structure, _STARTS)

    def cancel(self) -> None:
        """Cancel what the worker does."""
        self._worker.cancel()

    async def choose(self, index: int) -> None:
        """Take one of the designs that were found, in its own sea and on its own rope."""
        if 0 <= index < len(self._designs):
            await self._adopt(self._designs[index])

    async def save(self, name: str, *, replace: bool) -> None:
        """Check design and case by code that the search does not use, and save both."""
        state = self._state
        if state is None:
            return
        found = await self._job("Checking", "verified", *_asked(state))
        if found is None:
            return
        self._mark(state, found)
        try:
            paths = self._folder.save(name, state.case_now, found, replace=replace)
        except InputError as error:
            self._layout.say(_sentence(error))
            return
        self._layout.note(f"Saved {' and '.join(path.name for path in paths)}: {found.status}.")

    async def report(self) -> None:
        """Make the report in a folder of its own here, and hand it to the browser."""
        state = self._state
        if state is None:
            return
        try:
            place = tempfile.mkdtemp(prefix=".stillhook-page-", dir=self._folder.root)
        except OSError as error:
            self._layout.say(f"The report cannot be written here: {error.strerror}.")
            return
        try:
            found = await self._job("Report", "report", *_asked(state), place)
        finally:
            shutil.rmtree(place, ignore_errors=True)
        if found is not None:
            self._download(found, f"{folder_name(state.case.name)}-report.html")
            self._layout.note("The report was handed to the browser.")

    async def play(self) -> None:
        """Simulate a minute with these gains and with predictive control, and show it."""
        state = self._state
        if state is None:
            return
        found = await self._job("Simulating", "moving", *_asked(state))
        if found is not None:
            self._layout.show_strip(strip_html(found))

    # Steps of the above.

    async def _made(
        self, case: Case, structure: str, changes: Mapping[str, float] | None = None
    ) -> State:
        return await self._beside(self._desk.state, case, structure, changes)

    async def _beside(self, work: Callable[..., T], *arguments: Any) -> T:
        """Do something in the looking thread."""
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(self._executor, work, *arguments)

    def _take(self, state: State, name: str) -> None:
        """Show another case or structure."""
        self._state, self._name = state, name
        case = state.case
        about = " ".join(case.description.split())
        title = folder_name(case.name)
        self._layout.show_case(name, title, about, state.structure, state.structures)
        self._layout.show_controls(state.controls())
        self._capability = None
        self._layout.show_capability(capability_chart(None, self._sea, old=False))
        self._ask()

    async def _first_gains(self, state: State) -> None:
        """Look for gains where the case has none in use."""
        if not any(state.parameters[one.name] for one in state.law if math.isinf(one.low)):
            await self._search(state, state.structure, _FEW)

    async def _search(self, state: State, structure: str | None, starts: int) -> None:
        what = "Comparing structures" if structure is None else f"Searching {structure}"
        known = state.parameters if structure is not None and starts > _FEW else None
        found = await self._job(what, "optimise", state.case_now, structure, known, starts)
        if found is None:
            return
        every = [one for one in (found, *found.alternatives) if one.parameters]
        self._designs = [*every, *self._designs][:_KEPT]
        if not found.parameters:
            self._layout.say(f"No gains were found: {found.status}.")
        now = self._state
        if now is None or now.case is not state.case:
            return
        if found.parameters:
            await self._adopt(found)

    async def _adopt(self, design: Design) -> None:
        """Take the parameters of a design, and its case where that is another."""
        before = self._state
        assert before is not None
        changes = {
            path: value
            for path in before.changes
            if (value := _number_at(design.case, path)) is not None
        }
        if design.structure == before.structure:
            state = State.of(before.case, before.structure, before.law, design.parameters, changes)
            self._state = state
            self._layout.set_controls(state.controls())
        else:
            made = await self._made(before.case, design.structure, changes)
            self._take(made.with_parameters(design.parameters), self._name)
            state = self._state or made
        self._prices = prices_of(design)
        self._mark(state, design)
        self._list_designs(design)
        self._layout.say("" if design.ok else f"{design.status[:1].upper()}{design.status[1:]}.")
        self._ask(quiet=True)

    def _mark(self, state: State, design: Design) -> None:
        """Note that a state was checked, if it was and passed."""
        if design.verification is not None and design.verification.ok:
            self._verified = state, design.verification.status
        if self._state is state:
            self._ask(quiet=True)

    def _list_designs(self, now: Design | None) -> None:
        rows = [
            (
                one.structure,
                quantity(one.payload_rms, "m"),
                percent(one.residual),
                "-" if one.margins is None else number(one.margins.max_sensitivity),
                _short(one.status),
            )
            for one in self._designs
        ]
        at = next((k for k, one in enumerate(self._designs) if one is now), None)
        self._layout.show_designs(rows, at)

    def _ask(self, *, quiet: bool = False) -> None:
        """Ask for a look at what stands on the page."""
        assert self._state is not None
        if not quiet:
            self._layout.say("")
        self._latest.ask(Question(state=self._state, prices=self._prices))

    def _looked(self, question: Question, drawn: Drawn) -> None:
        """Show a look."""
        state = question.state
        if self._state is None or state.case is not self._state.case:
            return
        if state.structure != self._state.structure:
            return
        self._sea = drawn.picture.sea
        checked = self._verified is not None and self._verified[0] is state
        self._layout.show(drawn, self._verified[1] if checked and self._verified else "")
        self._show_capability(state)
        self._schedule(state)

    def _failed(self, question: Question, error: Exception) -> None:
        del question
        self._layout.say(_sentence(error))

    def _show_capability(self, state: State) -> None:
        if self._capability is not None:
            made, found = self._capability
            old = not self._as_capable(made, state)
            chart = capability_chart(found, self._sea, old=old)
            self._layout.show_capability(chart)

    def _schedule(self, state: State) -> None:
        """See to it that the capability of a state is known, or is being computed, once."""
        if self._capability is not None and self._as_capable(self._capability[0], state):
            return
        if self._waiting is not None and not self._waiting.done():
            if self._wanted is not None and self._as_capable(self._wanted, state):
                return
            self._waiting.cancel()
        self._wanted = state
        self._waiting = asyncio.get_running_loop().create_task(self._later(state))

    async def _later(self, state: State) -> None:
        """Compute the capability once nothing has changed for a while."""
        await asyncio.sleep(_PAUSE)
        if self._worker.busy:  # two cores have enough to do; `_job` asks again
            return
        try:
            found = await self._behind.run("capability", *_asked(state))
        except CancelledError:
            return
        except StillhookError as error:
            found = Capability(periods=(), heights=(), held=(), binding=(), note=_sentence(error))
        self._capability = state, found
        if self._state is not None and self._state.case is state.case:
            self._show_capability(self._state)

    @staticmethod
    def _as_capable(one: State, other: State) -> bool:
        """Return whether two states have the same capability: all but the height of the sea."""
        heights = ("sea.significant_height", "limits.max_sensitivity")
        kept = [
            {path: value for path, value in state.changes.items() if path not in heights}
            for state in (one, other)
        ]
        alike = one.case is other.case and one.structure == other.structure
        return alike and one.parameters == other.parameters and kept[0] == kept[1]

    async def _job(self, what: str, name: str, *arguments: Any) -> Any:
        """Do a job in the worker with its progress on the page; None where it came to nothing."""
        while self._worker.busy:  # one that is being cancelled
            await asyncio.sleep(0.02)
        self._layout.working(f"{what} ...", None)

        def told(stage: str, done: int, total: int) -> None:
            share = done / total if total else 0.0
            self._layout.working(f"{what}: {stage}, {done} of {total}", share)

        try:
            return await self._worker.run(name, *arguments, told=told)
        except CancelledError:
            return None
        except Exception as error:  # whatever it is, the page goes on
            self._layout.say(_sentence(error))
            return None
        finally:
            self._layout.working("", None)
            if self._state is not None:
                self._schedule(self._state)

    def _refused(self, why: str) -> None:
        """Say why a case was not opened, and show the one that is open."""
        self._layout.say(why)
        state = self._state
        if state is not None:
            about, title = " ".join(state.case.description.split()), folder_name(state.case.name)
            self._layout.show_case(self._name, title, about, state.structure, state.structures)


def _asked(state: State) -> tuple[Case, str, Mapping[str, float]]:
    return state.case_now, state.structure, dict(state.parameters)


def _number_at(case: Case, path: str) -> float | None:
    found: Any = case
    for name in path.split("."):
        found = getattr(found, name, None)
    return float(found) if isinstance(found, int | float) else None


def _short(status: str) -> str:
    """Return a status with the limits by their labels, as long as a row has room for."""
    for name, (label, _) in LIMITS.items():
        status = re.sub(rf"\b{re.escape(name)}\b", label, status)
    return status if len(status) <= _LONGEST else f"{status[: _LONGEST - 4].rstrip()} ..."


def _sentence(error: Exception) -> str:
    """Return an error in words; of one that is no error of ours, its kind too."""
    if isinstance(error, StillhookError):
        return str(error)
    return f"Unexpected error, {type(error).__name__}: {error}".partition("\n")[0]
