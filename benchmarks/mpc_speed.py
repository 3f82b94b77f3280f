"""How fast a step of predictive control is: `python benchmarks/mpc_speed.py [--quick]`.

A closed loop is recorded, and everybody answers the same questions (`mpc_questions`): quadratic
programmes by themselves (`mpc_solvers`); whole steps, against do-mpc, acados and CVXPY on the same
problem (`mpc_peers`); nonlinear steps, against do-mpc and IPOPT.  Last, twenty minutes are
simulated.

Each has a process of its own, on one core and with one thread, and they take turns: one goes
through all questions, then the next, several times round, so that whatever else the machine does
hits all alike.  Times are processor times: that of a question is the median of its repetitions,
and the tables hold median, 99 % quantile and largest over questions.  Exit code 1 if a wanted
figure is missed.

Peers are no dependencies.  What is not installed is named as absent; to have them all, in an
environment of their own, `pip install do-mpc proxsuite qpsolvers qoco comma-deps-acados`, then
`pip install --force-reinstall --no-deps casadi`, which the last one overwrites with a part of it.

(It cannot be called `mpc.py`: scripts of this folder would import it for the package.)
"""

from __future__ import annotations

import os

# Before NumPy is loaded: one thread, for us and the peers alike.
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["OMP_NUM_THREADS"] = "1"
os.environ["MKL_NUM_THREADS"] = "1"

import argparse
import math
import statistics
import sys
import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from mpc_horizon import Horizon
from mpc_peers import Peer, acados_peer, do_mpc_peer, ipopt_peer
from mpc_questions import SAMPLE_TIME, WEIGHTS, Recording, record, sea_case
from mpc_reference import reference
from mpc_report import Minutes, Results, missed, report, write_files
from mpc_solvers import SOLVERS, version_of
from mpc_turns import Replay, Task, measure, nothing, timed
from mpc_wrappers import cvxpy_oracle

from models.simulation import SimulationOptions, prepare, run_simulation
from mpc.linear import LinearMPC
from mpc.nonlinear import NonlinearMPC

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Effort:
    """How much is run."""

    steps: int = 500
    slow_questions: int = 200  # of solvers that take milliseconds
    slow_steps: int = 60  # of whole controllers that do
    repetitions: int = 7
    enough: float = 3.0  # processor time after which a question is not repeated again [s]
    horizons: tuple[float, ...] = (3.0, 6.0, 8.0, 10.0)
    seas: tuple[str, ...] = ("calm", "rough", "extreme")
    solver_seas: tuple[str, ...] = ("rough", "calm")
    minutes: float = 20.0


def solver_replay(
    prepare_solver: Callable[[Recording], Any], recording: Recording, count: int
) -> Replay:
    """Return a solver's way through the first programmes."""
    ask = prepare_solver(recording)
    return lambda: timed(count, ask, nothing)


def own_replay(recording: Recording) -> Replay:
    """Return our own way: measurement in, command out, estimation included.

    It must give the commands of the recording again; the moves returned are the first.
    """
    controller = recording.controller
    first = len(recording.times) - recording.steps

    def replay() -> Any:
        controller.reset()
        given = list(zip(recording.measurements, recording.times, strict=True))
        for k in range(first):
            controller.step(*given[k])
        commands = np.zeros(recording.steps)

        def ask(k: int) -> float:
            commands[k] = controller.step(*given[first + k])
            return 0.0

        cpu, wall, _ = timed(recording.steps, ask, nothing)
        if not np.array_equal(commands, recording.commands[first:]):
            raise ValueError("the recording cannot be repeated")
        return cpu, wall, recording.moves

    return replay


def peer_replay(
    make: Callable[[Horizon], Peer], recording: Recording, count: int, *, alone: bool = False
) -> Replay:
    """Return a peer's way; `alone` counts the solution only, not what is handed over before."""
    peer = make(Horizon(recording.controller))
    n = len(recording.controller.programme.blocks)
    asked = [(low[:n], high[:n]) for _, low, high in recording.questions]

    def give(k: int) -> None:
        peer.give(recording.states[k], *asked[k])

    def both(k: int) -> float:
        give(k)
        return peer.solve()

    if alone:
        return lambda: timed(count, lambda k: peer.solve(), give)
    return lambda: timed(count, both, nothing)


def recorded(
    sea: str,
    horizon: float,
    steps: int,
    *,
    blocked: bool,
    kind: type[LinearMPC] = LinearMPC,
    settle: float = 40.0,
) -> Recording:
    """Return a recording of a controller with or without move blocking.

    The peers' problem has the filter's own sea in its model, and so has what is recorded.
    """
    blocking = None if blocked else (1,) * round(horizon / SAMPLE_TIME)
    controller = kind(
        sea_case(sea), weights=WEIGHTS, horizon=horizon, blocking=blocking, predictor="kalman"
    )
    return record(sea, controller, steps=steps, settle=settle)


def _task(recording: Recording, begin: Callable[[], Replay], right: FloatArray, **own: Any) -> Task:
    return Task(
        sea=recording.sea,
        horizon=recording.controller.horizon,
        moves=len(recording.controller.programme.blocks),
        begin=begin,
        reference=right,
        **{"statement": "", "package": "stillhook", **own},
    )


def solver_tasks(recording: Recording, effort: Effort) -> list[Task]:
    """Return the solvers that are installed, on a recording."""
    return [
        _task(
            recording,
            partial(
                solver_replay,
                solver.prepare,
                recording,
                min(effort.slow_questions, recording.steps) if solver.slow else recording.steps,
            ),
            reference(recording),
            name=solver.name,
            statement=solver.statement,
            package=solver.package,
        )
        for solver in SOLVERS
        if version_of(solver.package) is not None
    ]


def step_tasks(blocked: Recording, plain: Recording, effort: Effort) -> list[Task]:
    """Return our steps with and without move blocking, and the peers on the latter."""
    few = min(effort.slow_steps, plain.steps)
    tasks = [
        _task(one, partial(own_replay, one), reference(one), name=name)
        for one, name in ((blocked, "LinearMPC"), (plain, "LinearMPC, no blocking"))
    ]
    acados = partial(peer_replay, acados_peer, plain, few)
    peers: list[tuple[str, str, Recording, Callable[[], Replay]]] = [
        ("acados, SQP_RTI", "comma-deps-acados", plain, acados),
        ("acados, solution alone", "comma-deps-acados", plain, partial(acados, alone=True)),
        ("do-mpc", "do-mpc", blocked, partial(peer_replay, do_mpc_peer, blocked, few)),
        ("do-mpc, no blocking", "do-mpc", plain, partial(peer_replay, do_mpc_peer, plain, few)),
        ("CasADi, IPOPT", "casadi", blocked, partial(peer_replay, ipopt_peer, blocked, few)),
        ("CVXPY, Clarabel", "cvxpy", blocked, partial(_cvxpy_replay, blocked, few)),
    ]
    tasks += [
        _task(one, begin, reference(one), name=name, package=package)
        for name, package, one, begin in peers
        if version_of(package) is not None
    ]
    return tasks


def _cvxpy_replay(recording: Recording, count: int) -> Replay:
    ask = cvxpy_oracle(recording)
    return lambda: timed(count, ask, nothing)


def nonlinear_tasks(sea: str, effort: Effort) -> list[Task]:
    """Return our nonlinear steps and the peers, all against IPOPT's answers."""
    few, tasks = min(effort.slow_steps, effort.steps), []
    for blocked, more in ((True, ""), (False, ", no blocking")):
        one = recorded(sea, 6.0, effort.steps, blocked=blocked, kind=NonlinearMPC)
        # What lies beyond the questions that IPOPT is asked has no reference.
        right = np.full(effort.steps, math.nan)
        right[:few] = peer_replay(partial(ipopt_peer, tight=True), one, few)()[2]
        tasks.append(_task(one, partial(own_replay, one), right, name=f"NonlinearMPC{more}"))
        for name, package, make in (
            ("do-mpc", "do-mpc", do_mpc_peer),
            ("CasADi, IPOPT", "casadi", ipopt_peer),
        ):
            if version_of(package) is not None:
                begin = partial(peer_replay, make, one, few)
                tasks.append(_task(one, begin, right, name=f"{name}{more}", package=package))
    return tasks


def minutes_of(sea: str, minutes: float) -> Minutes:
    """Return how long a simulation of so many minutes takes, the controller in it."""
    began, at = clock.perf_counter(), clock.process_time()
    controller = LinearMPC(sea_case(sea), weights=WEIGHTS, horizon=6.0)
    options = SimulationOptions(duration=60.0 * minutes)
    simulation = prepare(controller.case, controller, options=options)
    setup = clock.process_time() - at
    times = []
    for seed in (1, 2, 3):
        began, at = clock.perf_counter(), clock.process_time()
        run = run_simulation(simulation, seed=seed)
        times.append((clock.process_time() - at, clock.perf_counter() - began))
        if run.status != "completed":
            raise ValueError(f"simulation: {run.status}")
    return Minutes(
        sea=sea,
        minutes=minutes,
        setup=setup,
        processor=statistics.median(time for time, _ in times),
        wall=statistics.median(time for _, time in times),
    )


def measured(effort: Effort, tell: Callable[[str], None]) -> Results:
    """Return all measurements."""
    turns = partial(measure, repetitions=effort.repetitions, enough=effort.enough, tell=tell)
    load = [os.getloadavg()[0]]
    solvers, limited = [], {}
    for sea in effort.solver_seas:
        for blocked in (True, False):
            one = recorded(sea, 6.0, effort.steps, blocked=blocked)
            limited[sea] = one.limited
            solvers += turns(solver_tasks(one, effort))
    steps, nonlinear = [], []
    for sea in effort.seas:
        for horizon in effort.horizons:
            pair = [recorded(sea, horizon, effort.steps, blocked=b) for b in (True, False)]
            limited[sea] = pair[0].limited
            steps += turns(step_tasks(pair[0], pair[1], effort))
        nonlinear += turns(nonlinear_tasks(sea, effort))
    tell("simulation")
    minutes = [minutes_of(sea, effort.minutes) for sea in effort.solver_seas]
    load.append(os.getloadavg()[0])
    packages = {solver.package for solver in SOLVERS} | {"do-mpc", "comma-deps-acados"}
    return Results(
        solvers=tuple(solvers),
        steps=tuple(steps),
        nonlinear=tuple(nonlinear),
        minutes=tuple(minutes),
        limited=limited,
        load=(min(load), max(load)),
        absent=tuple(sorted(name for name in packages if version_of(name) is None)),
    )


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--quick", action="store_true", help="few questions, each twice")
    parser.add_argument("--write", type=Path, help="folder of the documentation to be renewed")
    given = parser.parse_args(arguments)
    effort = Effort()
    if given.quick:
        effort = Effort(
            steps=60, slow_steps=10, repetitions=2, enough=1.0, horizons=(6.0,), minutes=1.0
        )

    def tell(text: str) -> None:
        if sys.stderr.isatty():
            print(f"\r\033[K{text}", end="", file=sys.stderr)

    results = measured(effort, tell)
    tell("")
    print(report(results, plain_text=True))
    if given.write is not None:
        write_files(given.write, results)
    words = missed(results)
    if words:
        print("\nmissed: " + "; ".join(words))
    return int(bool(words))


if __name__ == "__main__":
    raise SystemExit(main())
