"""Cases on a dask cluster: workers on other machines, or several processes on this one.

    TimeQuestion (pickled once, kept by the scheduler) + CaseTask --> worker --> CaseResult

A worker that is killed loses nothing: the scheduler gives its cases to others, and starts anew
what they need.  At most a few cases for each thread are under way at once, so that a million of
them burden no scheduler.  Needs the extra ``stillhook[cluster]``.
"""

from __future__ import annotations

import contextlib
import functools
import pickle
import queue
import threading
import uuid
from collections import Counter
from collections.abc import Iterator
from typing import Any

from typing_extensions import override

from models.basics import InputError, SolverError, check_range

from ..keeper import Died, code_digest
from .engines import RETRIES, Answers, Engine, Todo, died
from .time_cases import CaseResult, CaseTask, TimeBench, TimeQuestion

_POLL = 0.2  # between two looks at Ctrl-C [s]
_AHEAD = 3  # cases under way for each thread of the cluster
_PATIENCE = 60.0  # for a scheduler to answer and to have a worker [s]


class Cluster(Engine):
    """A dask cluster.

    Parameters
    ----------
    address
        ``local:N`` for N processes on this machine, started and ended with the sweep; or the
        address of a scheduler, such as ``tcp://10.0.0.1:8786``, whose workers have the same
        Stillhook installed.
    client
        A `distributed.Client` to use instead; it is left open.

    Raises
    ------
    InputError
        If the address is none, or the extra is not installed.
    """

    name = "cluster"

    def __init__(self, address: str = "", *, client: Any = None) -> None:
        self._address, self._client = address, client
        self._size = 0
        if client is None and address.startswith("local:"):
            text = address.removeprefix("local:")
            size = int(text) if text.isdigit() else 0
            owner = f"sweep: cluster {address!r}"
            self._size = int(check_range(owner, "number of processes", size, low=1, high=512))
        elif client is None and "://" not in address:
            raise InputError(
                "sweep: cluster must be local:N or the address of a dask scheduler such as "
                f"tcp://10.0.0.1:8786; got {address!r}"
            )
        self.jobs = self._size or 1
        _distributed()

    @override
    def run(self, question: TimeQuestion, tasks: Iterator[CaseTask], count: int) -> Answers:
        if count == 0:
            return
        with self._connected() as client:
            yield from self._run(client, question, tasks)

    def _run(self, client: Any, question: TimeQuestion, tasks: Iterator[CaseTask]) -> Answers:
        distributed = _distributed()
        name = f"stillhook-{uuid.uuid4().hex[:12]}"
        # A task of its own and no scattered data: should all its copies be lost with a worker,
        # the scheduler makes it again.
        setup = client.submit(bytes, pickle.dumps(question), key=f"{name}-question", pure=False)
        done: queue.Queue[Any] = queue.Queue()
        todo, deaths = Todo(tasks), Counter[int]()
        under_way: dict[Any, CaseTask] = {}
        attempt = 0
        try:
            while todo or under_way:
                self.jobs = max(1, sum(client.nthreads().values()))
                while todo and len(under_way) < _AHEAD * self.jobs:
                    task = todo.take()
                    attempt += 1
                    key = f"{name}-{task.index}-{attempt}"
                    future = client.submit(do_case, setup, task, code_digest(), key=key, pure=False)
                    under_way[future] = task
                    future.add_done_callback(done.put)
                for future in _arrived(done):
                    task = under_way.pop(future)
                    answer = self._answer(distributed, question, task, future)
                    if isinstance(answer, Died):
                        deaths[task.index] += 1
                        if deaths[task.index] <= RETRIES:
                            todo.put_back(task)
                            continue
                        answer = died(question, task, answer.reason)
                    yield task, answer
                yield None
        finally:
            with contextlib.suppress(Exception):  # the scheduler may be what is gone
                client.cancel([*under_way, setup], force=True)

    def _answer(
        self, distributed: Any, question: TimeQuestion, task: CaseTask, future: Any
    ) -> CaseResult | Died:
        """Return what a future holds.

        Raises
        ------
        InputError
            If a worker has other code.
        SolverError
            If the cluster is gone, or cannot run the case at all.
        """
        del question
        if future.status == "finished":
            result: CaseResult = future.result()
            return result
        if future.status == "error":
            error = future.exception()
            if isinstance(error, distributed.KilledWorker):
                return Died(reason="its worker was killed")
            if isinstance(error, InputError):
                raise error
            raise SolverError(f"cluster: case {task.index} could not be run: {error!r}") from error
        raise SolverError(
            f"cluster: case {task.index} was lost ({future.status}): the scheduler at "
            f"{self._address or 'the address given'} is gone; what was done is kept"
        )

    @contextlib.contextmanager
    def _connected(self) -> Iterator[Any]:
        """Connect to the cluster, or start one; both end with the block."""
        if self._client is not None:
            yield self._client
            return
        distributed = _distributed()
        with contextlib.ExitStack() as stack:
            address = self._address
            if self._size:
                address = stack.enter_context(
                    distributed.LocalCluster(
                        n_workers=self._size,
                        threads_per_worker=1,
                        processes=True,
                        dashboard_address="127.0.0.1:0",
                        silence_logs=50,  # only what is critical: killed workers are no news
                    )
                )
            try:
                client = distributed.Client(address, timeout=_PATIENCE)
            except (OSError, TimeoutError, ValueError) as error:
                raise InputError(
                    f"sweep: no dask scheduler answers at {self._address}: {error}"
                ) from None
            stack.enter_context(client)
            try:
                client.wait_for_workers(1, timeout=_PATIENCE)
            except TimeoutError:
                raise InputError(
                    f"sweep: the dask scheduler at {self._address} has no workers; start some "
                    "with `dask worker ADDRESS --nthreads 1`"
                ) from None
            yield client


def do_case(question: bytes, task: CaseTask, code: str) -> CaseResult:
    """Run a case on a worker.

    Parameters
    ----------
    question
        The question, pickled.
    task
        The case.
    code
        Digest of the driver's code.

    Raises
    ------
    InputError
        If the worker has other code: its numbers would not belong to the others.
    """
    if code != code_digest():
        raise InputError(
            "sweep: a worker of the cluster has another version of Stillhook than this process; "
            "install the same everywhere"
        )
    bench, alone = _bench(question)
    with alone:  # threads of one worker take turns: a controller has a memory
        return bench.do(task)


@functools.lru_cache(maxsize=2)
def _bench(question: bytes) -> tuple[TimeBench, threading.Lock]:
    found: TimeQuestion = pickle.loads(question)
    return found.bench(), threading.Lock()


def _arrived(done: queue.Queue[Any]) -> list[Any]:
    """Return what is done, after waiting a little for the first."""
    found = []
    with contextlib.suppress(queue.Empty):
        found.append(done.get(timeout=_POLL))
        while True:
            found.append(done.get_nowait())
    return found


def _distributed() -> Any:
    """Return dask.distributed.

    Raises
    ------
    InputError
        If it is not installed.
    """
    try:
        import distributed
    except ImportError:
        raise InputError(
            "sweep: a cluster needs dask.distributed: pip install 'stillhook[cluster]'"
        ) from None
    return distributed
