"""How fast the simulation is: `python benchmarks/simulation.py [--quick]`.

Linear feedback on the nonlinear plant, three hours at 10 ms: on one spring, on ropes of ten
masses, and called from Python at 50 ms; as compiled C and in CasADi's virtual machine.  SciPy's
`solve_ivp` (`simulation_peers`) does the same work on a shorter stretch of the same run, and what
both find for the payload is compared.  Last, a day is simulated in a process of its own, whose
memory is measured.

Times are processor times, medians of several runs: nothing here runs on more than one core, and
other work on the machine must not count.  Exit code 1 if a wanted figure is missed.
"""

from __future__ import annotations

import os

# Before NumPy is loaded: one thread, for us and the peer alike.
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["OMP_NUM_THREADS"] = "1"
os.environ["MKL_NUM_THREADS"] = "1"

import argparse
import contextlib
import json
import statistics
import subprocess
import sys
import time as clock
import unittest.mock
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from simulation_peers import Answer, Peer
from simulation_report import (
    REST,
    Comparison,
    Memory,
    Speed,
    missed,
    report,
    rows_of,
    write_into,
)
from tables import markdown, plain

from models import load_case
from models.hook import HookMotion
from models.run import Accumulator, Run
from models.sensing import Measurement
from models.simulation import Kernel, Simulation, SimulationOptions, prepare, run_simulation
from models.simulation.rows import RowMaker
from synth.controllers import LinearFeedback


@dataclass(frozen=True, kw_only=True)
class Question:
    """What is simulated, and how many times faster than real time it should be.

    `gains` are A a, A a_1 and A a_2; those of the ropes are what `optimise_gains` finds.
    """

    name: str
    case: str
    gains: tuple[float, float, float]
    wanted: float
    changes: Mapping[str, float | str] = field(default_factory=dict)
    masses: int | None = None
    sample_time: float = 0.01
    in_python: bool = False

    def prepared(self, *, compiled: bool | None = None) -> Simulation:
        """Return the simulation, ready to run."""
        case = load_case(self.case).replace(self.changes)
        law = dict(zip(("a", "a1", "a2"), self.gains, strict=True)) | {"A": 1.0}
        feedback = LinearFeedback(case, law, sample_time=self.sample_time)
        controller = StepsOnly(feedback) if self.in_python else feedback
        return prepare(
            case, controller, options=SimulationOptions(masses=self.masses, compiled=compiled)
        )


class StepsOnly:
    """A controller whose recursion is hidden, so that it has to be called from Python."""

    def __init__(self, controller: LinearFeedback) -> None:
        self._controller = controller
        self.name, self.sample_time = controller.name, controller.sample_time

    def reset(self) -> None:
        """Forget every earlier measurement."""
        self._controller.reset()

    def step(self, measurement: Measurement, time: float) -> float:
        """Return the drive command."""
        return self._controller.step(measurement, time)


SPRING = Question(
    name="one spring",
    case="thesis-1975",
    gains=(10000.0, 20000.0, 20000.0),
    wanted=10_000.0,
    changes={"sea.significant_height": 0.5},  # in which the thesis's loop holds
)
QUESTIONS = (
    SPRING,
    Question(
        name="thesis's rope, 10 masses",
        case="thesis-1975-rope",
        gains=(642.8, 212.5, 5129.0),
        wanted=1000.0,
        # 300 m, where three gains do more than damp the resonance
        changes={"sea.significant_height": 0.5, "rope.length": 300.0},
        masses=10,
    ),
    Question(
        name="subsea crane, 10 masses",
        case="subsea-crane",
        gains=(16.03, 44.47, 6.41),
        wanted=1000.0,
        changes={"rope.damping_law": "kelvin-voigt"},  # on a hysteretic rope they are unstable
        masses=10,
    ),
    Question(
        name="one spring, controller in Python",
        case="thesis-1975",
        gains=(2115.9, 1077.5, 3797.0),  # which leave room for the 50 ms
        wanted=200.0,
        changes={"sea.significant_height": 0.5},
        sample_time=0.05,
        in_python=True,
    ),
)


@dataclass(frozen=True, kw_only=True)
class Effort:
    """How much is run; durations in seconds."""

    runs: int = 5
    duration: float = 10_800.0
    on_machine: float = 1800.0  # in CasADi's virtual machine
    peer_runs: int = 3
    peer_duration: float = 60.0
    hours: float = 24.0  # of the run whose memory is measured


@dataclass(eq=False)
class Stopwatch:
    """Adds up the processor's time in watched methods, each without those it calls."""

    seconds: dict[str, float] = field(default_factory=dict)
    _inner: list[float] = field(default_factory=lambda: [0.0])

    @contextlib.contextmanager
    def watching(self, methods: Mapping[tuple[type, str], str]) -> Iterator[None]:
        """Watch methods of classes, each under a name, within a with-block."""
        with contextlib.ExitStack() as stack:
            for (owner, method), name in methods.items():
                watched = self._watched(getattr(owner, method), name)
                stack.enter_context(unittest.mock.patch.object(owner, method, watched))
            yield

    def _watched(self, method: Callable[..., Any], name: str) -> Callable[..., Any]:
        def watched(*given: Any, **named: Any) -> Any:
            self._inner.append(0.0)
            began = clock.process_time()
            try:
                return method(*given, **named)
            finally:
                taken = clock.process_time() - began
                own = taken - self._inner.pop()
                self._inner[-1] += taken
                self.seconds[name] = self.seconds.get(name, 0.0) + own

        return watched


PARTS: Mapping[tuple[type, str], str] = {
    (HookMotion, "record"): "hook's record",
    (RowMaker, "block"): "rows",
    (Kernel, "run"): "kernel",
    (Kernel, "step"): "kernel",
    (StepsOnly, "step"): "controller",
    (Accumulator, "update"): "statistics",
    (Accumulator, "result"): "statistics",
}


def timed(work: Callable[[], Run]) -> tuple[float, Run]:
    """Return the processor's time of a piece of work [s], and what it made."""
    began = clock.process_time()
    made = work()
    return clock.process_time() - began, made


def speed_of(question: Question, effort: Effort, *, compiled: bool) -> Speed:
    """Return how fast a question is answered, each run with a seed of its own."""
    simulation = question.prepared(compiled=compiled)
    duration = effort.duration if compiled else min(effort.on_machine, effort.duration)

    def run(seed: int) -> Run:
        return run_simulation(simulation.with_options(duration=duration), seed=seed)

    run(0)  # whatever is only done once
    times = [timed(partial(run, seed))[0] for seed in range(1, effort.runs + 1)]
    watch = Stopwatch()
    with watch.watching(PARTS):
        whole, one = timed(partial(run, effort.runs + 1))
    parts = watch.seconds | {REST: whole - sum(watch.seconds.values())}
    return Speed(
        name=question.name,
        compiled=simulation.compiled,
        wanted=question.wanted,
        duration=duration,
        steps=one.timings.steps,
        samples=simulation.samples(duration),
        whole=statistics.median(times),
        parts=parts,
        payload_rms=one.statistics["payload.displacement"].standard_deviation,
        status=one.status,
    )


def comparisons(question: Question, effort: Effort, ours: Speed) -> list[Comparison]:
    """Return how fast `solve_ivp` answers a question, against our own whole run and kernel."""
    simulation, seed, duration = question.prepared(), 1, effort.peer_duration
    dt = simulation.loop.sample_time
    run = run_simulation(simulation.with_options(duration=duration, store_step=dt), seed=seed)
    payload = run["payload.displacement"]
    peer = Peer(simulation, seed=seed, duration=duration)
    ways: list[tuple[str, bool, Callable[[], Answer]]] = [
        ("sample by sample, plain calls", True, lambda: peer.sampled(plain=True)),
        ("sample by sample, bound calls", True, peer.sampled),
        ("controller continuous, one call", False, peer.continuous),
    ]
    found = []
    for name, same_work, way in ways:
        answers = [way() for _ in range(effort.peer_runs)]
        apart = np.abs(answers[0].payload - payload).max() / payload.std()
        found.append(
            Comparison(
                name=name,
                same_work=same_work,
                real_time=statistics.median(answer.speed for answer in answers),
                evaluations=answers[0].evaluations / duration,
                ours=ours.real_time,
                kernel=ours.kernel_real_time,
                difference=float(apart),
            )
        )
    return found


def memory_of(hours: float) -> Memory:
    """Return the memory of a process of its own that simulates so long."""
    command = [sys.executable, __file__, "--memory", f"{hours:g}"]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return Memory(hours=hours, **json.loads(said))


def simulate_and_tell(hours: float) -> None:
    """Simulate so long on one spring, and print the memory as `memory_of` reads it."""
    imported = largest_memory()
    run_simulation(SPRING.prepared().with_options(duration=3600.0 * hours), seed=1)
    print(json.dumps({"imported": imported, "peak": largest_memory()}))


def largest_memory() -> float:
    """Return the largest memory that this process has had [MB]."""
    # `getrusage` counts what the parent had before the program was loaded, so it comes second.
    status = Path("/proc/self/status")
    if status.exists():
        for line in status.read_text(encoding="utf-8").splitlines():
            if line.startswith("VmHWM:"):
                return 1024.0 * float(line.split()[1]) / 1e6
    import resource  # not on Windows

    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return used / 1e6 if sys.platform == "darwin" else 1024.0 * used / 1e6


def measured(
    effort: Effort,
    questions: Sequence[Question] = QUESTIONS,
    tell: Callable[[str], None] = lambda text: None,
) -> tuple[list[Speed], list[Comparison], Memory]:
    """Return all measurements."""
    speeds = []
    for question in questions:
        for compiled in (True, False):
            tell(f"{question.name}, {'C' if compiled else 'virtual machine'}")
            speeds.append(speed_of(question, effort, compiled=compiled))
    tell("solve_ivp")
    found = comparisons(SPRING, effort, speeds[0])
    tell("memory")
    return speeds, found, memory_of(effort.hours)


def store(path: Path, results: tuple[list[Speed], list[Comparison], Memory]) -> None:
    """Write the rows of everything that was measured."""
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "docs" / "make"))
    from stored import write_rows

    write_rows(path, ("kind", "fields"), rows_of(*results))


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--quick", action="store_true", help="short runs, each once")
    parser.add_argument("--write", type=Path, help="page whose tables are to be replaced")
    parser.add_argument("--memory", type=float, help=argparse.SUPPRESS, metavar="HOURS")
    given = parser.parse_args(arguments)
    if given.memory is not None:
        simulate_and_tell(given.memory)
        return 0
    effort = Effort()
    if given.quick:
        effort = Effort(runs=1, on_machine=300.0, peer_runs=1, peer_duration=10.0, hours=3.0)

    def tell(text: str) -> None:
        if sys.stderr.isatty():
            print(f"\r\033[K{text}", end="", file=sys.stderr)

    results = measured(effort, tell=tell)
    tell("")
    print(report(*results, plain))
    if given.write is not None:
        write_into(given.write, report(*results, markdown))
        store(given.write.parent / "data" / "simulation.csv", results)
    words = missed(*results)
    if words:
        print("\nmissed: " + "; ".join(words))
    return int(bool(words))


if __name__ == "__main__":
    raise SystemExit(main())
