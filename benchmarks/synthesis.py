"""How good and how fast the gain synthesis is: `python benchmarks/synthesis.py [--quick]`.

One question at a time (`peers.Task`: least payload rms within the same limits) is answered by
`synth.design.tuning` with 16 starts, by SciPy's differential evolution with ten seeds, and by SLSQP
on python-control objects from the same 16 starts.  Whatever they find is measured by the same
`synth.Assessment`, which has no grid that a peak could hide in.

Exit code 1 if the tuning is worse than the best of the peers by more than a part in a thousand.
"""

from __future__ import annotations

import os

# Before NumPy is loaded: one thread for matrices of twenty rows, for all three alike.
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["OMP_NUM_THREADS"] = "1"
os.environ["MKL_NUM_THREADS"] = "1"

import argparse
import platform
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from peers import HOOK, PAYLOAD, Answer, Exact, PythonControlLoop, SampledLoop, Task, evolve, slsqp

from models import load_case
from synth import LowFrequency, MaxSensitivity, Tuning, tune
from synth.question import pose

FloatArray = npt.NDArray[np.float64]

SPRING, ROPE = "thesis-1975", "thesis-1975-rope"
# Half-widths of the search box for A a, A a_1, A a_2: both signs, two to twenty times the optimum.
SPRING_BOX, ROPE_BOX = (1e4, 1e4, 3e4), (3e3, 3e3, 9e3)
WORSE = 1e-3  # relative, beyond which a result counts as worse
LEAK = 1e-5  # relative excess over a limit that the measuring forgives
NEAR = 0.05  # ... up to which an answer of SLSQP is worth mending
BEGIN, END = "<!-- benchmark: begin -->", "<!-- benchmark: end -->"


@dataclass(frozen=True, kw_only=True)
class Effort:
    """How much is run; `single` seeds one evaluation at a time, fewer SLSQP starts on the rope."""

    runs: int = 5
    starts: int = 16
    seeds: int = 10
    single: int = 1
    slsqp_starts: int = 16
    slsqp_starts_on_rope: int = 2
    slsqp_iterations: int = 100
    popsize: int = 15
    generations: int = 300
    verify: bool = True


@dataclass(frozen=True, kw_only=True, eq=False)
class Row:
    """One question and what the three made of it; times in seconds.

    `evolution` is the time of all seeds with whole generations evaluated at once, `single` that
    of as many seeds with one evaluation at a time, from those that were run.  `slsqp` is the
    time of as many starts as ours, from those that were run; `slsqp_found` the best of them
    that can be made to keep the limits to 1e-4.
    """

    name: str
    ours: Exact
    gains: FloatArray
    seconds: float
    agreed: int
    verification: float
    found: Exact
    found_gains: FloatArray
    hits: int
    seeds: int
    evolution: float
    single: float
    slsqp_found: float = np.inf
    slsqp: float = np.nan
    slsqp_run: int = 0

    @property
    def worse(self) -> float:
        """How much worse ours is than the best of the peers, relatively; negative if better."""
        return self.ours.rms / min(self.found.rms, self.slsqp_found) - 1.0

    @property
    def kept(self) -> bool:
        """Whether ours keeps the limits and is not worse."""
        return self.ours.excess <= 2.0 * LEAK and self.worse <= WORSE


def question(
    name: str,
    case_name: str,
    delay: float,
    box: tuple[float, float, float],
    *,
    slow_motion: bool,
    drag: bool = True,
) -> Task:
    """Return the question of a bundled case with another delay [s]; drive limits left out."""
    asked = pose(load_case(case_name).replace({"sensors.telemetry.delay": delay}))
    kinds = (MaxSensitivity, LowFrequency) if slow_motion else (MaxSensitivity,)
    return Task(
        name=name,
        plant=asked.plant,
        hook=asked.hook,
        structure=asked.structure,
        limits=tuple(limit for limit in asked.limits if isinstance(limit, kinds)),
        box=box,
        drag=asked.drag if drag else None,
    )


def questions() -> list[tuple[Task, bool]]:
    """Return the questions, and whether SLSQP answers each too (it takes minutes)."""
    spring = [
        (
            question(f"one spring, {ms} ms", SPRING, 1e-3 * ms, SPRING_BOX, slow_motion=False),
            ms in (0, 50),
        )
        for ms in (0, 25, 50, 100)
    ]
    slow = question("one spring, 100 ms, slow", SPRING, 0.1, SPRING_BOX, slow_motion=True)
    fixed = question("rope, 50 ms, fixed C", ROPE, 0.05, ROPE_BOX, slow_motion=True, drag=False)
    rope = [
        (question(f"rope, {ms} ms", ROPE, 1e-3 * ms, ROPE_BOX, slow_motion=True), ms == 0)
        for ms in (0, 50, 100)
    ]
    return [*spring, (slow, False), (fixed, True), *rope]


def ours(task: Task, starts: int = 16, seed: int = 0) -> Tuning:
    """Return our answer, from Sobol starts alone: the case's own gains are no hint here."""
    return tune(
        task.plant,
        task.structure,
        spectrum={HOOK: task.hook},
        minimise={PAYLOAD: 1.0},
        limits=task.limits,
        starts=starts,
        seed=seed,
        drag=task.drag,
    )


def products(task: Task, tuning: Tuning) -> FloatArray:
    """Return A a, A a_1, A a_2."""
    return task.structure.amplifier * np.array([tuning.parameters[n] for n in ("a", "a1", "a2")])


def compare(
    task: Task, effort: Effort, *, by_hand: bool, tell: Callable[[str], None] = lambda text: None
) -> Row:
    """Return a row of the table."""
    tell("ours")
    tuning, times = ours(task, effort.starts), []
    for _ in range(effort.runs):
        begin = time.perf_counter()
        tuning = ours(task, effort.starts)
        times.append(time.perf_counter() - begin)
    gains = products(task, tuning)
    begin = time.perf_counter()
    if effort.verify:
        tuning.verify()
    verification = time.perf_counter() - begin

    loop = SampledLoop(task)
    answers = []
    for seed in range(effort.seeds):
        tell(f"differential evolution, seed {seed}")
        answers.append(evolve(loop, seed, popsize=effort.popsize, generations=effort.generations))
    best = min(answers, key=lambda a: a.objective)
    tell("differential evolution, leaks closed")
    seed_of_best = answers.index(best)
    found_gains, found = _leaks_closed(
        task,
        best,
        lambda bound: evolve(
            loop,
            seed_of_best,
            max_sensitivity=bound,
            popsize=effort.popsize,
            generations=effort.generations,
        ),
    )
    single = 0.0
    for seed in range(effort.single):
        tell("differential evolution, one evaluation at a time")
        answer = evolve(
            loop, seed, vectorised=False, popsize=effort.popsize, generations=effort.generations
        )
        single += answer.seconds * effort.seeds / effort.single

    slsqp_found, slsqp_time, run = np.inf, np.nan, 0
    if by_hand:
        run = effort.slsqp_starts if task.drag is None else effort.slsqp_starts_on_rope
        if len(task.plant.states) > 10:
            run = effort.slsqp_starts_on_rope
        begins = [task.structure.amplifier * s.begin for s in tuning.starts]
        chosen = begins[:: max(1, len(begins) // run)][:run]
        run, spent, by_control = len(chosen), 0.0, PythonControlLoop(task)
        ends = []
        for k, start in enumerate(chosen):
            tell(f"SLSQP, start {k}")
            answer = slsqp(by_control, start, iterations=effort.slsqp_iterations)
            spent += answer.seconds
            if np.isfinite(answer.objective):
                ends.append((answer, task.exact(answer.gains)))
        near = [(exact.rms, end) for end, exact in ends if exact.excess < NEAR]
        if near:
            tell("SLSQP, leaks closed")
            end = min(near, key=lambda pair: pair[0])[1]

            def again(bound: float) -> Answer:
                return slsqp(
                    by_control,
                    end.gains,
                    iterations=effort.slsqp_iterations,
                    max_sensitivity=bound,
                )

            exact = _leaks_closed(task, end, again)[1]
            slsqp_found = exact.rms if exact.excess <= 10.0 * LEAK else np.inf
        slsqp_time = spent * effort.starts / run
    return Row(
        name=task.name,
        ours=task.exact(gains),
        gains=gains,
        seconds=statistics.median(times),
        agreed=tuning.agreed,
        verification=verification,
        found=found,
        found_gains=found_gains,
        hits=sum(a.objective < best.objective + WORSE for a in answers),
        seeds=effort.seeds,
        evolution=sum(a.seconds for a in answers),
        single=single,
        slsqp_found=slsqp_found,
        slsqp=slsqp_time,
        slsqp_run=run,
    )


def _leaks_closed(
    task: Task, best: Answer, again: Callable[[float], Answer]
) -> tuple[FloatArray, Exact]:
    """Return a peer's best answer, sought again with a tighter bound while it breaks a limit.

    Its grid is fine but still a grid.  This time is not counted.
    """
    exact, bound = task.exact(best.gains), task.max_sensitivity
    for _ in range(4):
        if exact.excess <= LEAK:
            break
        bound *= task.max_sensitivity / max(exact.max_sensitivity, task.max_sensitivity)
        bound *= 1.0 - 0.5 * LEAK
        best = again(bound)
        exact = task.exact(best.gains)
    return best.gains, exact


def quality_table(rows: Sequence[Row]) -> list[list[str]]:
    """Return the table of results, its head first."""
    head = ["question", "ours [mm]", "M_s", "starts agreed", "best of DE [mm]", "DE seeds there"]
    head += ["SLSQP [mm]", "ours over best", "A a", "A a_1", "A a_2"]
    body = []
    for row in rows:
        by_hand = f"{1e3 * row.slsqp_found:.2f}" if np.isfinite(row.slsqp_found) else "none"
        body.append(
            [
                row.name,
                f"{1e3 * row.ours.rms:.2f}",
                f"{row.ours.max_sensitivity:.4f}",
                str(row.agreed),
                f"{1e3 * row.found.rms:.2f}",
                f"{row.hits} of {row.seeds}",
                by_hand if row.slsqp_run else "",
                f"{100 * row.worse:+.3f} %",
                *(f"{gain:.1f}" for gain in row.gains),
            ]
        )
    return [head, *body]


def time_table(rows: Sequence[Row]) -> list[list[str]]:
    """Return the table of times [s] and of their ratios to ours, its head first."""
    head = ["question", "ours", "check", "DE, one seed", "DE, all seeds", "over ours"]
    head += ["DE, one by one", "over ours", "SLSQP", "over ours"]
    body = []
    for row in rows:
        cells = [row.name, f"{row.seconds:.2f}", f"{row.verification:.2f}"]
        cells.append(f"{row.evolution / row.seeds:.2f}")
        for seconds in (row.evolution, row.single, row.slsqp):
            known = np.isfinite(seconds) and seconds > 0.0
            ratio = seconds / row.seconds
            cells.append(f"{seconds:.1f}" if known else "")
            cells.append(f"{ratio:.{0 if ratio >= 9.95 else 1}f}" if known else "")
        body.append(cells)
    return [head, *body]


def plain(table: Sequence[Sequence[str]]) -> str:
    """Return a table for the terminal."""
    widths = [max(len(line[k]) for line in table) for k in range(len(table[0]))]
    lines = []
    for first, *others in table:
        right = [cell.rjust(width) for cell, width in zip(others, widths[1:], strict=True)]
        lines.append("  ".join([first.ljust(widths[0]), *right]))
    return "\n".join([lines[0], "-" * len(lines[0]), *lines[1:]])


def markdown(table: Sequence[Sequence[str]]) -> str:
    """Return a table for the docs."""
    rule = ["---", *["---:"] * (len(table[0]) - 1)]
    return "\n".join("| " + " | ".join(line) + " |" for line in [table[0], rule, *table[1:]])


def machine() -> str:
    """Return the machine's kind in a phrase, without its name."""
    return (
        f"{os.cpu_count()} cores, {platform.machine()}, {platform.system()}, "
        f"Python {platform.python_version()}, one BLAS thread"
    )


def write_into(path: Path, text: str) -> None:
    """Replace what stands between the two marks in a page.

    Raises
    ------
    ValueError
        If the page does not hold the marks.
    """
    page = path.read_text(encoding="utf-8")
    if page.count(BEGIN) != 1 or page.count(END) != 1:
        raise ValueError(f"{path}: must hold {BEGIN} and {END} once each")
    before, rest = page.split(BEGIN)
    _, after = rest.split(END)
    path.write_text(f"{before}{BEGIN}\n\n{text}\n\n{END}{after}", encoding="utf-8")


def report(rows: Sequence[Row], draw: Callable[[Sequence[Sequence[str]]], str]) -> str:
    """Return both tables."""
    return (
        f"Measured on {machine()}.\n\n{draw(quality_table(rows))}\n\n"
        f"Times in seconds:\n\n{draw(time_table(rows))}"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--quick", action="store_true", help="two questions, little effort")
    parser.add_argument("--only", default="", help="questions whose name holds this text")
    parser.add_argument("--write", type=Path, help="page whose tables are to be replaced")
    given = parser.parse_args(arguments)
    effort, asked = Effort(), questions()
    if given.quick:
        effort = Effort(runs=1, seeds=2, slsqp_starts=1, slsqp_starts_on_rope=1)
        asked = [(task, task.name.endswith("0 ms") and not task.drag) for task, _ in asked[:3:2]]
    rows = []
    for task, by_hand in asked:
        if given.only not in task.name:
            continue

        def tell(text: str, name: str = task.name) -> None:
            if sys.stderr.isatty():
                print(f"\r\033[K{name}: {text}", end="", file=sys.stderr)

        rows.append(compare(task, effort, by_hand=by_hand, tell=tell))
        tell("done")
    print("\n" + report(rows, plain))
    if given.write is not None:
        write_into(given.write, report(rows, markdown))
    missed = [row.name for row in rows if not row.kept]
    if missed:
        print(f"\nworse than a peer, or a limit is broken: {'; '.join(missed)}")
    return int(bool(missed))


if __name__ == "__main__":
    raise SystemExit(main())
