"""A Python process of our own, and the messages to and from it.

    started("package.module") --(length, pickle)--> served(), in that process --(length, pickle)-->

It is started with the path of its parent and nothing else: neither the parent's memory nor its main
script, so that it works the same on every system, from a script without a main guard, from a
notebook and from the command line.  It starts isolated (``-I``), and of the path it has the folders
that are named in full: a ``json.py`` beside somebody's case files is not run.  It has one thread of
linear algebra and a session of its own: Ctrl-C reaches the parent alone, which ends it.
"""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import signal
import struct
import subprocess
import sys
from collections.abc import Iterable
from typing import IO, Any

_START = (
    "import json, sys; from importlib import import_module; sys.path[:] = json.loads(sys.argv[1]); "
    "import_module(sys.argv[2]).serve()"
)
_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
_LENGTH = struct.Struct(">Q")


def started(module: str, errors: int | IO[bytes]) -> subprocess.Popen[bytes]:
    """Start a process that runs ``serve()`` of a module; what it says of errors goes there."""
    return subprocess.Popen(
        [sys.executable, "-I", "-c", _START, json.dumps(full_paths(sys.path)), module],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=errors,
        env={**os.environ, **dict.fromkeys(_THREADS, "1")},
        start_new_session=True,
    )


def served() -> tuple[IO[bytes], IO[bytes]]:
    """Return what such a process is sent, and where its answers go; called by it first."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides what Ctrl-C means
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a controller prints must not come among the answers
    return sys.stdin.buffer, answers


def send(stream: IO[bytes], data: bytes) -> None:
    """Send what was pickled."""
    stream.write(_LENGTH.pack(len(data)) + data)
    stream.flush()


def receive(stream: IO[bytes]) -> Any:
    """Return what was sent by `send`, unpickled.

    Raises EOFError if the other end is gone.
    """
    head = stream.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        raise EOFError
    (length,) = _LENGTH.unpack(head)
    data = stream.read(length)
    if len(data) < length:
        raise EOFError
    return pickle.loads(data)


def close(process: subprocess.Popen[bytes]) -> None:
    """Close what leads to a process that has ended."""
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            with contextlib.suppress(OSError, ValueError):
                stream.close()


def how_it_ended(code: int) -> str:
    """Return how a process ended, from its status, in words."""
    if code < 0:
        with contextlib.suppress(ValueError):
            return f"was ended by {signal.Signals(-code).name}"
    return f"ended with status {code}"


def full_paths(paths: Iterable[str]) -> list[str]:
    """Return the folders that are named in full: not the current one, nor what starts from it."""
    return [path for path in paths if os.path.isabs(path)]
