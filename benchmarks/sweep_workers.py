"""What a case of a sweep in time costs, and what more workers gain.

`python benchmarks/sweep_workers.py [--cases N] [--write]`.  Three tables.  Cost: one case, prepared
and run in one process, for several controllers.  Overhead: cases that take no time at all, on every
engine, and what is written for each.  Workers: the same cases on one and two processes of the pool
and of a local dask cluster; and, as the machine has two cores, cases that sleep instead of
computing on up to sixteen workers, which shows what driver and engine lose when the cores are
there.  Efficiency is that of steady work, from the first result to the last: cases a second over n
times those of one worker, or over n divided by the sleep.  Starting is told apart.

Costs are processor times, medians; all else are wall times, as processes that wait for each other
are what is measured.  With --write they go to docs/data/sweep_workers.csv and docs/scaling.md.
"""

from __future__ import annotations

import os

# Before NumPy is loaded: one thread, here and in every worker.
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["OMP_NUM_THREADS"] = "1"
os.environ["MKL_NUM_THREADS"] = "1"

import argparse
import statistics
import sys
import tempfile
import time as clock
import warnings
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from synthesis import machine, write_into
from tables import markdown, plain

import stillhook as sh
from models.case import Case
from models.spread import Spread
from stillhook.controllers import recipe_of
from stillhook.sweeps import sweep, usual_spread
from stillhook.sweeps.store import Draw
from stillhook.sweeps.time_cases import CaseResult, CaseTask, TimeQuestion
from stillhook.sweeps.time_metrics import METRICS
from stillhook.sweeps.time_sweep import run_sweep

ROOT = Path(__file__).parents[1]
DATA, PAGE = ROOT / "docs" / "data" / "sweep_workers.csv", ROOT / "docs" / "scaling.md"
SLEEP = 0.5  # of a case that sleeps [s]
DURATION = 600.0  # of a run [s]


@dataclass(frozen=True, kw_only=True)
class Row:
    """One measurement."""

    table: str
    what: str
    workers: int
    cases: int
    seconds: float
    each: float
    efficiency: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Idle(TimeQuestion):
    """A question that takes so long and no processor."""

    sleep: float = 0.0

    def do(self, task: CaseTask, progress: Any = None) -> CaseResult:
        """Return numbers that stand for those of a case."""
        clock.sleep(self.sleep)
        values = dict.fromkeys(self.metrics, float(task.index))
        return CaseResult(index=task.index, status="completed", values=values, wall=self.sleep)


def case() -> Case:
    return sh.load_case("subsea-crane")


def costs(count: int) -> list[Row]:
    """Return what a case costs in one process, by controller."""
    nominal, rows = case(), []
    thesis = sh.load_case("thesis-1975").replace({"sea.significant_height": 0.3})
    gains = {name: getattr(thesis.gains, name) for name in ("A", "a", "a1", "a2")}
    one = sh.evaluate_gains(thesis, gains)
    asked: list[tuple[str, Case, object, float, int]] = [
        ("gains, one mass, 10 min", thesis, one, DURATION, count),
        ("feed-forward, rope of many masses, 10 min", nominal, "feed-forward", DURATION, count),
        (
            "feed-forward, rope of many masses, 3 h",
            nominal,
            "feed-forward",
            10800.0,
            max(2, count // 4),
        ),
        ("mpc, rope of many masses, 10 min", nominal, "mpc", DURATION, max(2, count // 4)),
    ]
    for name, own, wanted, duration, cases in asked:
        spread = usual_spread(own, "time").on(own)
        question = TimeQuestion(
            case=own, recipe=recipe_of(wanted, "sweep"), metrics=tuple(METRICS), duration=duration
        )
        table = spread.sample(cases)
        for repeat in range(2):  # the first compiles what is not in the cache yet
            walls = []
            for index, row in enumerate(table):
                task = CaseTask(index=index, seed=index, changes=spread.changes(row))
                began = clock.process_time()
                question.do(task)
                walls.append(clock.process_time() - began)
            each = statistics.median(walls)
            what = f"{name}{', compiling' if repeat == 0 else ''}"
            rows.append(
                Row(
                    table="cost",
                    what=what,
                    workers=1,
                    cases=cases,
                    seconds=sum(walls),
                    each=statistics.mean(walls) if repeat == 0 else each,
                    efficiency=1.0,
                )
            )
    return rows


class Watch:
    """Notes when results come."""

    def __init__(self) -> None:
        self.began, self.times = clock.perf_counter(), list[float]()

    def __call__(self, what: str, done: int, total: int) -> None:
        """Note that so many are done."""
        del what, total
        now = clock.perf_counter() - self.began
        self.times += [now] * (done - len(self.times))

    @property
    def rate(self) -> float:
        """Results a second, from the first to the last."""
        return (len(self.times) - 1) / (self.times[-1] - self.times[0])


def idle(
    engine: str, jobs: int | None, cases: int, sleep: float, store: bool
) -> tuple[float, Watch]:
    """Return how long cases take that only sleep [s], and when their results came."""
    import sweep_workers  # by its own name, so that workers find it

    nominal = case()
    spread = Spread({"payload.mass": "10 %"}).on(nominal)
    question = sweep_workers.Idle(
        case=nominal,
        recipe=recipe_of("feed-forward", "sweep"),
        metrics=tuple(METRICS),
        duration=DURATION,
        sleep=sleep,
    )
    draw = Draw(spread=spread, samples=cases, sampling="sobol", seed=0, common_seed=False)
    with tempfile.TemporaryDirectory() as folder:
        watch = Watch()
        found = run_sweep(
            question,
            draw,
            engine=engine,
            jobs=jobs,
            store=Path(folder) / "s" if store else None,
            progress=watch,
        )
        seconds = clock.perf_counter() - watch.began
    assert found.attrs["complete"] == 1
    return seconds, watch


def overheads() -> list[Row]:
    """Return what a case costs besides being run."""
    rows = []
    for what, engine, jobs, cases, store in (
        ("serial, in memory", "serial", 1, 2000, False),
        ("serial, store on disk", "serial", 1, 2000, True),
        ("pool of 2", "processes", 2, 2000, False),
        ("dask, local:2", "local:2", 2, 1000, False),
    ):
        seconds, watch = idle(engine, jobs, cases, 0.0, store)
        row = Row(
            table="overhead",
            what=what,
            workers=jobs,
            cases=cases,
            seconds=seconds - (watch.times[-1] - watch.times[0]),
            each=1.0 / watch.rate,
            efficiency=1.0,
        )
        rows.append(row)
    return rows


def workers(count: int) -> list[Row]:
    """Return what more workers gain."""
    rows = []
    for name, template in (("pool", "processes"), ("dask", "local:{}")):
        alone = 0.0
        for n in (1, 2):
            seconds, watch = crane(template.format(n), n, count)
            alone = alone or watch.rate
            rows.append(worker_row(f"{name}, computing", n, count, seconds, watch, alone))
    for name, template in (("pool", "processes"), ("dask", "local:{}")):
        for n in (1, 2, 4, 8):
            cases = 20 * n  # each worker has the same to do
            seconds, watch = idle(template.format(n), n, cases, SLEEP, True)
            # The first results of all workers come together, then one wave after the other.
            ideal = (cases - 1) / (SLEEP * (cases / n - 1.0))
            what = f"{name}, sleeping"
            rows.append(worker_row(what, n, cases, seconds, watch, ideal / n))
    return rows


def crane(engine: str, jobs: int, count: int) -> tuple[float, Watch]:
    """Return how long real cases take on an engine [s], and when their results came."""
    watch = Watch()
    found = sweep(
        "feed-forward",
        usual_spread(case(), "time"),
        case=case(),
        samples=count,
        mode="time",
        duration=DURATION,
        engine=engine,
        jobs=jobs,
        progress=watch,
    )
    assert found.attrs["complete"] == 1
    return clock.perf_counter() - watch.began, watch


def worker_row(what: str, n: int, cases: int, seconds: float, watch: Watch, alone: float) -> Row:
    """Return the row of n workers; `alone` is the rate of one."""
    return Row(
        table="workers",
        what=what,
        workers=n,
        cases=cases,
        seconds=seconds,
        each=1.0 / watch.rate,
        efficiency=watch.rate / (n * alone),
    )


def tables(rows: list[Row]) -> dict[str, list[list[str]]]:
    """Return the tables as texts."""
    return {
        "cost": [
            ["one case, one core", "cases", "processor s a case"],
            *([r.what, str(r.cases), f"{r.each:.3f}"] for r in rows if r.table == "cost"),
        ],
        "overhead": [
            ["cases that take no time", "to begin and end [s]", "ms a case"],
            *(
                [r.what, f"{r.seconds:.1f}", f"{1e3 * r.each:.2f}"]
                for r in rows
                if r.table == "overhead"
            ),
        ],
        "workers": [
            ["engine", "workers", "cases", "s in all", "cases a second", "efficiency"],
            *(
                [
                    r.what,
                    str(r.workers),
                    str(r.cases),
                    f"{r.seconds:.1f}",
                    f"{1.0 / r.each:.1f}",
                    f"{100 * r.efficiency:.0f} %",
                ]
                for r in rows
                if r.table == "workers"
            ),
        ],
    }


def write_data(rows: list[Row]) -> None:
    sys.path.insert(0, str(ROOT / "docs" / "make"))
    from stored import write_rows

    told = [
        {k: f"{v:.6g}" if isinstance(v, float) else v for k, v in asdict(row).items()}
        for row in rows
    ]
    write_rows(DATA, list(told[0]), told, "Times in s, of cost processor times.")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition(":")[0])
    parser.add_argument("--cases", type=int, default=64, help="computing cases (default: 64)")
    parser.add_argument("--quick", action="store_true", help="few cases, nothing is written")
    parser.add_argument("--write", action="store_true", help="write data and docs/scaling.md")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    if arguments.quick:
        print(plain(tables(costs(2))["cost"]))
        return 0
    rows = [*costs(max(4, arguments.cases // 8)), *overheads(), *workers(arguments.cases)]
    found = tables(rows)
    for table in found.values():
        print(plain(table), end="\n\n")
    if arguments.write:
        write_data(rows)
        text = "\n\n".join(markdown(table) for table in found.values())
        about = f"Measured on {machine()}."
        write_into(PAGE, f"{about}\n\n{text}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
