"""How good and how fast the synthesis is: `python benchmarks/synthesis.py [--quick]`.

Two questions on `subsea-crane`, three gains and `combined`: the least payload rms within all limits
of the case.  Each is answered by `synth.optimise_gains`, its check included, and by SciPy's
differential evolution with ten seeds on the exact rope, whole generations at once; three gains also
by SLSQP on python-control objects.  Whatever they find is measured by the same fine sampling of
the exact rope.  Each answer goes to docs/data/synthesis.csv as it comes, the tables into
docs/performance.md.

Exit code 1 if ours is worse than the best of the peers by more than a part in a thousand.
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
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from peers import Answer, ControlLoops, SampledLine, evolve, slsqp

from models import load_case
from synth import optimise_gains
from synth.question import DesignQuestion, pose

FloatArray = npt.NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[1]
CASE = "subsea-crane"
#: Peers know no friction of losses that switch, nor their noise, nor the family of a hysteretic
#: rope: all solve the question without.
PLAIN = {"winch.losses": "hauling", "rope.damping_law": "kelvin-voigt"}
#: Ends of the box that differential evolution searches: both signs of what has no sign of its own,
#: one and a half to fifteen times the optimum; what lies between two numbers, between these.
BOXES: Mapping[str, FloatArray] = {
    "payload-feedback": np.array([[-100.0, 100.0], [-300.0, 300.0], [-100.0, 100.0]]),
    "combined": np.array(
        [
            [-80.0, 80.0],
            [-80.0, 80.0],
            [-200.0, 200.0],
            [1e-3, 7.5],
            [0.0, 2.0],
            [1.0, 500.0],
            [0.2, 2.0],
            [0.0, 2.0],
            [1.0, 100.0],
        ]
    ),
}
WORSE = 1e-3  # relative, beyond which a result counts as worse
LEAK = 2e-4  # relative excess over a limit of a seed that is sought again with tighter margins
OURS, EVOLUTION, AGAIN, SLSQP = "ours", "evolution", "evolution, again", "SLSQP"
BEGIN, END = "<!-- benchmark: begin -->", "<!-- benchmark: end -->"
COLUMNS = (
    "question",
    "by",
    "seed",
    "processor time [s]",
    "loops",
    "payload rms [mm]",
    "over the tightest limit",
    "starts",
    "parameters",
)


@dataclass(frozen=True, kw_only=True)
class Effort:
    """How much is run."""

    runs: int = 3
    seeds: Mapping[str, int]
    slsqp_starts: int = 2
    slsqp_iterations: int = 100
    popsize: int = 10
    generations: int = 1500
    starts: int = 16


FULL = Effort(seeds={"payload-feedback": 10, "combined": 10})
QUICK = Effort(
    runs=1,
    seeds={"payload-feedback": 1},
    slsqp_starts=1,
    slsqp_iterations=2,
    popsize=5,
    generations=8,
    starts=4,
)


@dataclass(frozen=True, kw_only=True)
class Row:
    """One answer: to what, by whom, its processor time [s], and what it does on the exact rope.

    `excess` is the largest relative excess over a limit, below zero if all are kept; `starts` how
    many our search began at.
    """

    question: str
    by: str
    seed: int
    seconds: float
    loops: int
    rms: float
    excess: float
    starts: int
    parameters: tuple[float, ...]

    def cells(self) -> dict[str, object]:
        """Return the row as it is stored."""
        told = (self.question, self.by, self.seed, f"{self.seconds:.4g}", self.loops)
        numbers = (f"{1e3 * self.rms:.6g}", f"{self.excess:.2e}", self.starts)
        values = " ".join(f"{value:.8g}" for value in self.parameters)
        return dict(zip(COLUMNS, (*told, *numbers, values), strict=True))

    @staticmethod
    def of(cells: Mapping[str, str]) -> Row:
        """Return a stored row."""
        question, by, seed, seconds, loops, rms, excess, starts, values = (
            cells[name] for name in COLUMNS
        )
        return Row(
            question=question,
            by=by,
            seed=int(seed),
            seconds=float(seconds),
            loops=int(loops),
            rms=1e-3 * float(rms),
            excess=float(excess),
            starts=int(starts),
            parameters=tuple(float(value) for value in values.split()),
        )


class Study:
    """The answers to one question, told and stored as they come."""

    def __init__(self, structure: str, folder: Path, rows: list[Row]) -> None:
        self.structure, self.rows, self._folder = structure, rows, folder
        self.question: DesignQuestion = pose(load_case(CASE).replace(PLAIN), structure)
        self._fine = SampledLine(self.question, per_panel=10, per_decade=3000)

    def add(self, by: str, seed: int, answer: Answer, starts: int = 0) -> Row:
        """Measure an answer, tell it and store it."""
        found = self._fine.measure(np.array([answer.values]))
        row = Row(
            question=self.structure,
            by=by,
            seed=seed,
            seconds=answer.seconds,
            loops=answer.evaluations,
            rms=float(np.exp(found.log_rms[0])) if found.stable[0] else np.inf,
            excess=float(np.expm1(found.excess[:, 0].max())),
            starts=starts,
            parameters=tuple(float(value) for value in answer.values),
        )
        self.rows.append(row)
        print(
            f"{row.question}, {row.by} {row.seed}: {1e3 * row.rms:.4f} mm, over limits by "
            f"{row.excess:.1e}, {row.loops} loops in {row.seconds:.2f} s",
            flush=True,
        )
        store(self.rows, self._folder)
        return row

    def ours(self, effort: Effort) -> list[FloatArray]:
        """Answer it by the toolkit some times; return where its search began."""
        begins: list[FloatArray] = []
        for run in range(effort.runs):
            begin = time.process_time()
            design = optimise_gains(
                load_case(CASE).replace(PLAIN), self.structure, starts=effort.starts
            )
            answer = Answer(
                values=np.array(self.question.values(design.parameters)),
                seconds=time.process_time() - begin,
                evaluations=0,
                objective=float(np.log(design.payload_rms)),
            )
            begins = [np.array(start.begin) for start in design.starts]
            self.add(OURS, run, answer, len(begins))
        return begins

    def evolution(self, effort: Effort) -> None:
        """Answer it by differential evolution, the best once more if it leaks between points."""
        box, line = BOXES[self.structure], SampledLine(self.question)
        pace = {"popsize": effort.popsize, "generations": effort.generations}
        answers: list[tuple[float, Row]] = []
        for seed in range(effort.seeds[self.structure]):
            answer = evolve(line, box, seed, **pace)
            answers.append((answer.objective, self.add(EVOLUTION, seed, answer)))
        best = min(answers, key=lambda pair: pair[0])[1]
        if best.excess > LEAK:
            tight = SampledLine(self.question, tighter=best.excess)
            self.add(AGAIN, best.seed, evolve(tight, box, best.seed, **pace))

    def by_hand(self, effort: Effort, begins: Sequence[FloatArray]) -> None:
        """Answer it by SLSQP on python-control objects, from some of our starts."""
        loops = ControlLoops(self.question)
        chosen = range(0, len(begins), max(1, len(begins) // effort.slsqp_starts))
        for k in list(chosen)[: effort.slsqp_starts]:
            answer = slsqp(loops.measure, begins[k], iterations=effort.slsqp_iterations)
            self.add(SLSQP, k, answer)


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """What the rows of one question say; times in seconds.

    `ten_seeds` and `all_starts` are those of ten seeds and of as many starts as our search had,
    from those that were run.
    """

    question: str
    ours: Row
    best: Row
    there: int
    seeds: int
    slsqp: Row | None
    seconds: float
    seed: float
    ten_seeds: float
    start: float
    all_starts: float

    @staticmethod
    def of(question: str, rows: Sequence[Row]) -> Verdict:
        """Return the verdict on a question."""
        by = {
            name: [row for row in rows if row.question == question and row.by == name]
            for name in (OURS, EVOLUTION, AGAIN, SLSQP)
        }
        ours, seeds, hand = by[OURS], by[EVOLUTION], by[SLSQP]
        kept = [row for row in [*seeds, *by[AGAIN]] if row.excess <= WORSE] or seeds
        best = min(kept, key=lambda row: row.rms)
        every_start = [row.seconds for row in hand]
        start = statistics.median(every_start) if hand else np.nan
        return Verdict(
            question=question,
            ours=max(ours, key=lambda row: row.rms),
            best=best,
            there=sum(abs(row.rms / best.rms - 1.0) <= 2.0 * WORSE for row in seeds),
            seeds=len(seeds),
            slsqp=min(
                (row for row in hand if row.excess <= 10.0 * WORSE),
                key=lambda row: row.rms,
                default=None,
            ),
            seconds=statistics.median(row.seconds for row in ours),
            seed=statistics.median(row.seconds for row in seeds),
            ten_seeds=10.0 * statistics.mean(row.seconds for row in seeds),
            start=start,
            all_starts=start * ours[0].starts,
        )

    @property
    def worse(self) -> float:
        """How much worse ours is than the best of the peers, relatively; negative if better."""
        peers = [self.best.rms] + ([] if self.slsqp is None else [self.slsqp.rms])
        return self.ours.rms / min(peers) - 1.0


def tables(rows: Sequence[Row]) -> str:
    """Return both tables for the docs."""
    verdicts = [Verdict.of(name, rows) for name in dict.fromkeys(row.question for row in rows)]
    quality = ["| question | ours [mm] | over a limit by | best of DE [mm] | over a limit by |"]
    quality[0] += " seeds there | ours over best | SLSQP [mm] |"
    quality.append("| --- |" + " ---: |" * 7)
    times = ["| question | ours [s] | DE, one seed [s] | ten seeds [s] | over ours |"]
    times[0] += " SLSQP, one start [s] | all our starts [s] | over ours |"
    times.append("| --- |" + " ---: |" * 7)
    for one in verdicts:
        hand = "" if np.isnan(one.start) else "none"
        if one.slsqp is not None:
            hand = f"{1e3 * one.slsqp.rms:.3f}"
        cells = [f"{1e3 * one.ours.rms:.3f}", f"{max(one.ours.excess, 0.0):.1e}"]
        cells += [f"{1e3 * one.best.rms:.3f}", f"{max(one.best.excess, 0.0):.1e}"]
        cells += [f"{one.there} of {one.seeds}", f"{100 * one.worse:+.3f} %", hand]
        quality.append(f"| {one.question} | " + " | ".join(cells) + " |")
        cells = [f"{one.seconds:.2f}", f"{one.seed:.1f}", f"{one.ten_seeds:.1f}"]
        cells.append(f"{one.ten_seeds / one.seconds:.1f}")
        if np.isnan(one.start):
            cells += ["", "", ""]
        else:
            cells += [f"{one.start:.1f}", f"{one.all_starts:.0f}"]
            cells.append(f"{one.all_starts / one.seconds:.1f}")
        times.append(f"| {one.question} | " + " | ".join(cells) + " |")
    return "\n".join([*quality, "", "Processor times:", "", *times])


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


def store(rows: Sequence[Row], folder: Path) -> None:
    """Write the answers so far."""
    from stored import write_rows

    write_rows(folder / "data" / "synthesis.csv", COLUMNS, (row.cells() for row in rows))


def run(effort: Effort, folder: Path) -> list[Row]:
    """Return every answer of a run."""
    rows: list[Row] = []
    for structure in effort.seeds:
        study = Study(structure, folder, rows)
        begins = study.ours(effort)
        if structure == "payload-feedback":
            study.by_hand(effort, begins)
        study.evolution(effort)
    return rows


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, write, and say whether ours is as good as the best."""
    sys.path.insert(0, str(ROOT / "docs" / "make"))
    from stored import docs_folder, study_parser

    parser: argparse.ArgumentParser = study_parser(__doc__)
    parser.add_argument("--seeds", type=int, help="seeds of differential evolution on `combined`")
    given = parser.parse_args(arguments)
    effort = QUICK if given.quick else FULL
    if given.seeds is not None:
        effort = Effort(seeds={**FULL.seeds, "combined": given.seeds})
    folder = docs_folder(given.quick)
    found = run(effort, folder)
    rows = [Row.of({k: str(v) for k, v in row.cells().items()}) for row in found]  # as stored
    text = f"Measured on {machine()}.\n\n{tables(rows)}"
    print(f"\n{text}")
    if not given.quick:
        write_into(folder / "performance.md", text)
    verdicts = [Verdict.of(name, rows) for name in effort.seeds]
    missed = [one.question for one in verdicts if one.worse > WORSE]
    if missed and not given.quick:
        print(f"\nworse than a peer: {'; '.join(missed)}")
    return int(bool(missed) and not given.quick)


if __name__ == "__main__":
    raise SystemExit(main())
