"""`sh.compare`: contenders in the same seas, on the same plant, with the same noise.

    case, contenders, H_s, seeds --> designs --> cells, in several processes --> Comparison

Every result is kept as soon as it is there (`stillhook.comparison.store`), and a comparison that
was stopped goes on where it was.  What a contender cannot do is part of the answer and no error: it
says why it did not take part.

`Campaign` says which task comes next, and what becomes of its answer.

    question, contenders --> Campaign.work (in processes, and here) --> Comparison

A first answer comes first: one run of everybody who is made at once.  Then designs, since runs wait
for them, and what is left; floors come last, where the others have shown that they say anything.
A process is given what it has prepared already, as long as there is any.
"""

import contextlib
import math
import sys
import time as clock
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from models.basics import InputError, check_choice, check_range, shows_progress
from models.case import Case
from models.simulation import EASE

from ..controllers import Contender, StoredDesign, contenders_of, line_up
from ..keeper import POLL, Alone, Died, Pool, Processes, usable_cores
from ..runs import seconds_of, seeds_of
from ..text import Progress
from .bench import CellBench, CellTask, Refused
from .cell import Cell, ComparisonQuestion, Trace
from .comparison import Comparison
from .mismatch import Mismatch
from .store import STORE, Store

_LONGEST = 1e6  # run [s]
_FLOORS = 3  # seeds of which the floor is computed by default: it takes longer than all others
_FULL = 0.1  # of the time [%]: less is as good as a drive without limits


@shows_progress("comparing")
def compare(
    case: Case,
    controllers: Sequence[object] | Literal["all"] | None = None,
    *,
    design: object = None,
    seeds: int | Sequence[int] = 6,
    duration: float | str = "5 min",
    heights: Sequence[float] | None = None,
    mismatch: str | Mapping[str, object] | None = None,
    masses: int | None = None,
    settle: float | str | None = None,
    design_at: str = "each",
    starts: int | None = None,
    compiled: bool | None = None,
    jobs: int | None = None,
    out: str | Path | None = None,
    traces: bool = True,
    progress: Progress | None = None,
    told: Callable[[Comparison], None] | None = None,
) -> Comparison:
    """Compare controllers in the same seas, on the same nonlinear plant with its limits.

    Unless others are named, each kind takes part once, which takes under three minutes of processor
    time on the bundled cases: the design is then searched from one start, and the floor is that
    of the first three seeds.

    Parameters
    ----------
    case
        Vessel, sea, rope, payload, winch and sensors.
    controllers
        Names of `stillhook.controllers.CONTENDERS`, designs, controllers, and pairs of a
        name and one of these or of a function of the case that returns a controller; by default
        `stillhook.controllers.DEFAULTS`, or everybody for "all".
    design
        A design, or a pair of a name and one, that takes the place of `combined`, the one that is
        looked for, where no controllers are named.
    seeds
        How many seas of each height, or their seeds.  The same seed is the same motion of the
        hook for every contender, and the same noise for those with the same sample time.
    duration
        Length of a run [s], or a text such as ``"20 min"``.
    heights
        Significant heights [m]; by default that of the case.
    mismatch
        What of the plant is not as the controllers are told, such as
        ``"payload=+30%,delay=+50ms"`` (`stillhook.comparison.mismatch`).
    masses, compiled
        Of the simulated plant, as for `sh.simulate`.
    settle
        Time from which statistics count [s]; by default 30 s in which the hook's motion grows
        and ten peak periods, at most a tenth of the run but not less than these 30 s, or half of
        a run that is shorter than a minute.
    design_at
        "each": linear laws are designed anew for every height, which is fairest to them;
        "case": once, in the sea of the case.  Those within the drive's limits keep them whether
        the case enforces them or not; the eager ones ignore them (the plant does not).
    starts
        Starts of the searches for designs; by default 1 where no controllers are named, else 8.
    jobs
        Processes that share the work; by default one for each core.  Contenders that cannot be
        sent to another process run in this one.
    out
        Folder in which every result is kept as soon as it is there; the same call goes on with
        what it finds.
    traces
        Whether to run once more around the worst moment of the best linear law, for a figure.
    progress
        Called as progress(what, done, total), in runs.
    told
        Called after every run with the comparison so far.

    Returns
    -------
    Comparison
        After Ctrl-C with the runs that there are.

    Raises
    ------
    InputError
        If an argument is out of range, a name is unknown, or `out` holds another comparison.

    Examples
    --------
    >>> import stillhook as sh
    >>> found = sh.compare(sh.load_case("thesis-1975"), ["none", "feed-forward"], seeds=2,
    ...     duration="1 min", jobs=1, traces=False)
    >>> found.table["runs"].tolist(), found.complete
    ([2, 2], True)
    """
    brief = controllers is None
    if brief or controllers == "all":
        controllers = line_up(case, every=not brief, design=design)
    elif design is not None:
        raise InputError("compare: design is for the usual contenders; name it among yours")
    contenders = contenders_of(controllers)
    numbers = seeds_of("compare", seeds)
    lasting = seconds_of("compare: duration", duration, high=_LONGEST)
    check_choice("compare", "design_at", design_at, ("each", "case"))
    starts = (1 if brief else 8) if starts is None else starts
    check_range("compare", "starts", starts, low=1, high=4096)
    if jobs is not None:
        check_range("compare", "jobs", jobs, low=1, high=512)
    waves = EASE + 10.0 * case.sea.spectral_peak_period
    start = max(min(waves, 0.1 * lasting), min(EASE, 0.5 * lasting))
    if settle is not None:
        start = seconds_of("compare: settle", settle, high=_LONGEST, positive=False)
    question = ComparisonQuestion(
        case=case,
        duration=lasting,
        settle=start,
        mismatch=Mismatch.read(mismatch),
        masses=masses,
        compiled=compiled,
        design_at=design_at,
        starts=int(starts),
    )
    check_range("compare", "settle", question.settle, low=0.0, high=0.9 * lasting, unit="s")
    levels = _heights(case, heights)
    for height in levels:
        question.true(height)  # what is wrong with a sea or a mismatch is said at once
    workers = min(int(jobs or usable_cores()), len(contenders) * len(levels) * len(numbers))
    began = clock.perf_counter()
    with contextlib.ExitStack() as stack:
        store = None
        if out is not None:
            from ..text import OutputFolder

            store = Store(OutputFolder.prepare(out).at(STORE), question)
            stack.enter_context(store.journal)
        campaign = Campaign(
            question=question,
            contenders=contenders,
            heights=levels,
            seeds=numbers,
            store=store,
            floors=numbers[:_FLOORS] if brief else numbers,
            progress=progress or (lambda what, done, total: None),
            told=told,
        )
        complete = True
        try:
            if workers > 1 and sys.executable:
                bench = CellBench(question, [each for each in contenders if each.portable])
                campaign.work(stack.enter_context(Processes(workers).begin(bench, workers)))
            bench = CellBench(question, contenders)
            campaign.work(Alone(campaign.tell).begin(bench, 1))
            if traces:
                campaign.look_closely(bench)
        except KeyboardInterrupt:
            complete = False
        return campaign.comparison(complete=complete, seconds=clock.perf_counter() - began)


def _heights(case: Case, heights: Sequence[float] | None) -> tuple[float, ...]:
    if heights is None:
        return (float(case.sea.significant_height),)
    found = tuple(
        check_range("compare", "heights", each, low=0.0, high=30.0, unit="m", open_low=True)
        for each in heights
    )
    if not found or len(set(found)) != len(found):
        raise InputError(f"compare: heights must be distinct, at least one, got {list(found)}")
    return tuple(sorted(found))


@dataclass(kw_only=True)
class Campaign:
    """Designs and runs of a comparison that are to be done, and what came of those that are."""

    #: What all are asked, who takes part, in seas of which height [m], with which seeds.
    question: ComparisonQuestion
    contenders: tuple[Contender, ...]
    heights: tuple[float, ...]
    seeds: tuple[int, ...]
    store: Store | None  #: Where results are kept; None for nowhere.
    floors: tuple[int, ...]  #: Seeds of which the floor is computed.
    progress: Progress  #: Called as progress(what, done, total), in runs.
    #: Called after every run with what there is.
    told: Callable[[Comparison], None] | None = None
    laws: dict[tuple[str, float], StoredDesign] = field(default_factory=dict)
    refused: dict[tuple[str, float], str] = field(default_factory=dict)
    cells: dict[tuple[str, float, int], Cell] = field(default_factory=dict)
    traces: tuple[Trace, ...] = ()
    no_design: dict[tuple[str, float], str] = field(default_factory=dict)
    under_way: set[CellTask] = field(default_factory=set)
    _names: dict[str, Contender] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Take what the store has."""
        self._names = {each.name: each for each in self.contenders}
        if self.store is None:
            return
        wanted = {task.group for task in self._designs()}
        self.laws |= {at: law for at, law in self.store.laws.items() if at in wanted}
        for task in self._runs():
            contender = self._names[task.name]
            if self._waits(task) or not contender.portable:
                continue
            cell = self.store.cell(contender, self._law(task), task.height, task.seed)
            if cell is not None:
                self.cells[task.name, task.height, task.seed] = cell

    def work(self, pool: Pool) -> None:
        """Do everything that a pool can: in other processes not what cannot be sent there."""
        here = isinstance(pool, Alone)
        while True:
            todo = [
                task
                for task in self._todo()
                if task not in self.under_way
                and (here or task.kind == "design" or self._names[task.name].portable)
            ]
            while pool.idle and todo:
                task = self._next(pool, todo)
                todo.remove(task)
                self.under_way.add(task)
                pool.submit(self._full(task))
            self.tell()
            if not pool.busy:
                return
            answered = pool.wait(POLL)
            if answered is not None:
                task, answer = answered
                self.under_way.discard(task)
                self._take(task, answer)

    def look_closely(self, bench: CellBench) -> None:
        """Run the worst moment of the best linear law once more, for everybody."""
        found = self.comparison(complete=True, seconds=0.0).worst_moment
        if found is None:
            return
        height, seed, moment = found
        traces = []
        for contender in self.contenders:
            cell = self.cells.get((contender.name, height, seed))
            if cell is None or contender.recipe is None or cell.status in ("failed", "died"):
                continue
            name = contender.name
            task = CellTask(kind="trace", name=name, height=height, seed=seed, moment=moment)
            self.under_way = {task}
            trace = bench.do(self._full(task), self.tell)
            if isinstance(trace, Trace):
                traces.append(trace)
        self.traces = tuple(traces)

    def comparison(self, *, complete: bool, seconds: float) -> Comparison:
        """Return what there is."""
        order = [(c.name, h, s) for c in self.contenders for h in self.heights for s in self.seeds]
        return Comparison(
            case=self.question.case,
            contenders=self.contenders,
            heights=self.heights,
            seeds=self.seeds,
            question=self.question,
            cells=tuple(self.cells[key] for key in order if key in self.cells),
            refused=dict(self.refused),
            laws={
                (c.name, h): law
                for c in self.contenders
                for h in self.heights
                if (law := self._law_of(c, h)) is not None
            },
            traces=self.traces,
            complete=complete,
            seconds=seconds,
        )

    def _designs(self) -> list[CellTask]:
        wanted = {
            CellTask(
                kind="design", name=each.needs, height=self.question.design_height(height)
            ): None
            for height in self.heights
            for each in self.contenders
            if each.needs
        }
        # The longest first, so that nobody waits for it at the end.
        return sorted(wanted, key=lambda task: not task.name.startswith("combined"))

    def _runs(self) -> list[CellTask]:
        return [
            CellTask(kind="run", name=each.name, height=height, seed=seed)
            for each in self.contenders
            for height in self.heights
            for seed in (self.seeds if each.recipe is not None else self.floors)
        ]

    def _todo(self) -> list[CellTask]:
        """Return what can be done now: first runs, designs, then runs whose design is there."""
        known = {**self.laws, **self.no_design}
        designs = [task for task in self._designs() if task.group not in known]
        left = [
            task for task in self._runs() if (task.name, task.height, task.seed) not in self.cells
        ]
        floors = [task for task in left if self._names[task.name].recipe is None]
        runs = [
            task
            for task in left
            if task not in floors and task.group not in self.refused and not self._waits(task)
        ]
        quick = [task for task in runs if task.seed == self.seeds[0] and self._quick(task)]
        now = quick + designs + [task for task in runs if task not in quick]
        if now or not self.under_way.issubset(floors):
            return now
        return [task for task in floors if self._worth_it(task.group)]

    def _quick(self, task: CellTask) -> bool:
        """Return whether a run's controller is made at once."""
        contender = self._names[task.name]
        return contender.group in ("brake", "linear") and not contender.needs

    def _worth_it(self, group: tuple[str, float]) -> bool:
        """Return whether a floor says anything; note why if it does not."""
        _, height = group
        full = [
            cell.quantities.get("saturated share", 0.0)
            for cell in self.cells.values()
            if cell.height == height
            and not cell.lost
            and self._names[cell.contender].group not in ("brake", "floor")
        ]
        if not full or max(full) > _FULL:
            return True
        self.refused[group] = (
            f"no drive is at its limits for over {_FULL:g} % of the time where the load is held, "
            "and without limits everything known in advance leaves nothing"
        )
        return False

    def _next(self, pool: Pool, todo: list[CellTask]) -> CellTask:
        """Return what fits best: what an idle process has prepared, then what nobody has."""
        if todo[0].kind == "design":
            return todo[0]
        prepared = pool.lasts
        known = next((task for task in todo if task.group in prepared), None)
        if known is not None:
            return known
        taken = {task.group for task in self.under_way}
        return next((task for task in todo if task.group not in taken), todo[0])

    def _waits(self, task: CellTask) -> bool:
        """Return whether a run's design is still to come; note a run that will have none."""
        needs = self._names[task.name].needs
        if not needs:
            return False
        at = (needs, self.question.design_height(task.height))
        if at in self.no_design:
            self.refused[task.group] = self.no_design[at]
        return at not in self.laws

    def _law(self, task: CellTask) -> StoredDesign | None:
        return self._law_of(self._names[task.name], task.height)

    def _law_of(self, contender: Contender, height: float) -> StoredDesign | None:
        return self.laws.get((contender.needs, self.question.design_height(height)))

    def _full(self, task: CellTask) -> CellTask:
        """Return a task with the law that it takes."""
        law = None if task.kind == "design" else self._law(task)
        return task if law is None else replace(task, law=law)

    def _take(self, task: CellTask, answer: Any) -> None:
        """Keep an answer."""
        key = (task.name, task.height, task.seed)
        if isinstance(answer, Died | Refused):
            if task.kind == "design":
                self.no_design[task.group] = f"no design: {answer.reason}"
            elif isinstance(answer, Refused) and answer.always:
                self.refused[task.group] = answer.reason
            else:
                self.cells[key] = Cell(
                    contender=task.name,
                    height=task.height,
                    seed=task.seed,
                    status="died" if isinstance(answer, Died) else "failed",
                    message=answer.reason,
                )
        elif isinstance(answer, StoredDesign):
            self.laws[task.group] = answer
            if self.store is not None:
                self.store.add_law(task.name, task.height, answer)
        else:
            self.cells[key] = answer
            if self.store is not None:
                self.store.add_cell(self._names[task.name], self._law(task), answer)
        if task.kind == "run" and self.told is not None:
            self.told(self.comparison(complete=False, seconds=math.nan))

    def tell(self, *part: object) -> None:
        """Say what is under way, and how many runs there are; not how far each of them is."""
        del part
        total = sum(task.group not in self.refused for task in self._runs())
        what = _words(next(iter(self.under_way))) if self.under_way else ""
        self.progress(what, len(self.cells), max(total, len(self.cells)))


def _words(task: CellTask) -> str:
    if task.kind == "design":
        return f"designing {task.name}, H_s {task.height:.4g} m"
    return f"{task.name}, H_s {task.height:.4g} m, seed {task.seed}"
