"""A dask cluster as a pool: workers on other machines, or several processes on this one.

    bench (pickled once, kept by the scheduler) + task --> worker --> answer

A worker that is killed loses nothing: the scheduler gives its tasks to others, and starts anew
what they need.  At most a few tasks for each thread are under way at once, so that a million of
them burden no scheduler.  Needs the extra ``cluster``.
"""

import contextlib
import functools
import os
import pickle
import queue
import sys
import threading
import time as clock
import uuid
from collections.abc import Iterator
from typing import Any

from typing_extensions import override

from models.basics import InputError, SolverError, check_range, how_to_install

from .channel import full_paths
from .digest import code_digest
from .pool import POLL, Bench, Died, Pool, Task

_AHEAD = 3  # tasks under way for each thread of the cluster
_PATIENCE = 60.0  # for a scheduler to answer and to have a worker [s]


class Cluster(Pool):
    """A dask cluster.

    Its address is ``local:N`` for N processes on this machine, started and ended with the work; or
    that of a scheduler, such as ``tcp://10.0.0.1:8786``, whose workers have the same Stillhook
    installed.  A `distributed.Client` may be used instead; it is left open.

    Raises InputError if the address is none, or the extra is not installed.
    """

    name = "cluster"

    def __init__(self, address: str = "", *, client: Any = None) -> None:
        self._address, self._client = address, client
        self._size = 0
        if client is None and address.startswith("local:"):
            text = address.removeprefix("local:")
            size = int(text) if text.isdigit() else 0
            owner = f"cluster {address!r}"
            self._size = int(check_range(owner, "number of processes", size, low=1, high=512))
        elif client is None and "://" not in address:
            raise InputError(
                "cluster: must be local:N or the address of a dask scheduler such as "
                f"tcp://10.0.0.1:8786; got {address!r}"
            )
        self.jobs = self._size or 1
        _distributed()

    @property
    @override
    def idle(self) -> int:
        return max(0, _AHEAD * self.jobs - len(self._under_way))

    @property
    @override
    def busy(self) -> int:
        return len(self._under_way)

    @override
    def submit(self, task: Task) -> None:
        self._count += 1  # a task that is done again must not be taken for the one before
        future = self._running.submit(
            _do, self._bench, task, self._code, key=f"{self._mark}-{self._count}", pure=False
        )
        self._under_way[future] = task
        future.add_done_callback(self._done.put)

    @override
    def end(self) -> None:
        with contextlib.suppress(Exception):  # the scheduler may be what is gone
            self._running.cancel([*self._under_way, self._bench], force=True)
        self._stack.close()

    @override
    def _start(self, bench: Bench, count: int) -> None:
        self._done: queue.Queue[Any] = queue.Queue()
        self._under_way: dict[Any, Task] = {}
        self._count, self._mark = 0, f"stillhook-{uuid.uuid4().hex[:12]}"
        self._stack = contextlib.ExitStack()
        self._running = self._stack.enter_context(self._connected())
        self._code = code_digest(type(bench))
        self._count_threads()
        # A task of its own and no scattered data: should all its copies be lost with a worker,
        # the scheduler makes it again.
        self._bench = self._running.submit(
            bytes, pickle.dumps(bench), key=f"{self._mark}-bench", pure=False
        )

    @override
    def _answer(self, timeout: float) -> tuple[Any, Any] | None:
        """Return a task and what its future holds.

        Raises InputError if a worker has other code; SolverError if the cluster is gone, or cannot
        do the task at all.
        """
        if clock.monotonic() - self._counted > POLL:
            self._count_threads()
        try:
            future = self._done.get(timeout=timeout)
        except queue.Empty:
            return None
        task = self._under_way.pop(future)
        if future.status == "finished":
            return task, future.result()
        if future.status == "error":
            error = future.exception()
            if isinstance(error, _distributed().KilledWorker):
                return task, Died(reason="its worker was killed")
            if isinstance(error, InputError):
                raise error
            raise SolverError(f"cluster: {task} could not be run: {error!r}") from error
        raise SolverError(
            f"cluster: {task} was lost ({future.status}): the scheduler at "
            f"{self._address or 'the address given'} is gone; what was done is kept"
        )

    def _count_threads(self) -> None:
        """Ask the scheduler how many workers there are now: a journey, so not for every task."""
        self.jobs = max(1, sum(self._running.nthreads().values()))
        self._counted = clock.monotonic()

    def _started(self) -> Any:
        """Return a cluster on this machine.

        Raises InputError if its processes do not start.
        """
        try:
            return _distributed().LocalCluster(
                n_workers=self._size,
                threads_per_worker=1,
                processes=True,
                dashboard_address="127.0.0.1:0",
                silence_logs=50,  # only what is critical: killed workers are no news
            )
        except (RuntimeError, OSError, TimeoutError) as error:
            raise InputError(
                f"cluster {self._address!r}: its processes did not start ({error}); is there "
                "memory for so many? What was done is kept: the same command goes on"
            ) from error

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
                stack.enter_context(_isolated())
                address = stack.enter_context(self._started())
            try:
                client = distributed.Client(address, timeout=_PATIENCE)
            except (OSError, TimeoutError, ValueError) as error:
                raise InputError(
                    f"cluster: no dask scheduler answers at {self._address}: {error}"
                ) from None
            stack.enter_context(client)
            try:
                client.wait_for_workers(1, timeout=_PATIENCE)
            except TimeoutError:
                raise InputError(
                    f"cluster: the dask scheduler at {self._address} has no workers; start some "
                    "with `dask worker ADDRESS --nthreads 1`"
                ) from None
            yield client


@contextlib.contextmanager
def _isolated() -> Iterator[None]:
    """Let Python processes that start meanwhile find nothing in the current folder.

    Those of `multiprocessing` are sent the path of this one, in which the current folder is an
    empty text at a prompt and in a notebook; it is taken out for as long, because a worker that
    was killed is started anew.
    """
    before = {name: os.environ.get(name) for name in ("PYTHONSAFEPATH", "PYTHONPATH")}
    found = full_paths((before["PYTHONPATH"] or "").split(os.pathsep))
    os.environ.update(PYTHONSAFEPATH="1", PYTHONPATH=os.pathsep.join(found))
    path = sys.path[:]
    sys.path[:] = full_paths(path)
    try:
        yield
    finally:
        more = [entry for entry in sys.path if entry not in path]  # which others have put there
        sys.path[:] = [*path, *more]
        for name, value in before.items():
            os.environ.pop(name)
            if value is not None:
                os.environ[name] = value


def _do(pickled: bytes, task: Task, code: str) -> Any:
    """Do a task on a worker, whose code must be the driver's: numbers of others do not belong."""
    bench, own, alone = _bench(pickled)
    if code != own:
        raise InputError(
            "cluster: a worker has another version of Stillhook than this process; install the "
            "same everywhere"
        )
    with alone:  # threads of one worker take turns: a controller has a memory
        return bench.do(task)


@functools.lru_cache(maxsize=2)
def _bench(pickled: bytes) -> tuple[Bench, str, threading.Lock]:
    found: Bench = pickle.loads(pickled)
    return found, code_digest(type(found)), threading.Lock()


def _distributed() -> Any:
    """Return dask.distributed.

    Raises InputError if it is not installed.
    """
    try:
        import distributed
    except ImportError:
        raise InputError(f"a cluster needs dask.distributed: {how_to_install('cluster')}") from None
    return distributed
