"""The design page as users start it: in a process and a folder of its own."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

_TIMEOUT = 60.0  # for a start on a busy machine [s]


@dataclass(frozen=True)
class Served:
    """A page that is being served."""

    url: str
    folder: Path
    process: subprocess.Popen[str]

    @property
    def port(self) -> int:
        return int(self.url.split(":")[2].partition("/")[0])

    @property
    def workers(self) -> list[int]:
        """Processes that the server has started."""
        listed = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children")
        children = {int(pid) for pid in listed.read_text().split()}
        for task in Path(f"/proc/{self.process.pid}/task").iterdir():
            children |= {int(pid) for pid in (task / "children").read_text().split()}
        return sorted(children)


def serve(folder: Path, *words: str) -> Served:
    """Start the page in a folder."""
    process = subprocess.Popen(
        [sys.executable, "-m", "stillhook", "page", "--no-open", *words],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1", "OPENBLAS_NUM_THREADS": "1"},
    )
    assert process.stdout is not None
    line = process.stdout.readline()
    found = re.search(r"http://\S+", line)
    if found is None:
        process.kill()
        raise AssertionError(f"no page: {line}{process.stdout.read()}")
    return Served(url=found[0], folder=folder, process=process)


def stop(served: Served) -> tuple[int, str]:
    """End the page as Ctrl-C does; return its exit status, and what it said since it began."""
    served.process.send_signal(signal.SIGINT)
    begun = time.monotonic()
    while served.process.poll() is None and time.monotonic() - begun < _TIMEOUT:
        time.sleep(0.05)
    served.process.kill()
    assert served.process.stdout is not None
    with served.process.stdout as stream:
        said = stream.read()
    return served.process.wait(), said
