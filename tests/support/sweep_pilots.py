"""Controllers for tests of sweeps that other processes can import: awkward ones among them."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Any

from synth.controllers import LinearFeedback


def linear(case: Any) -> LinearFeedback:
    own = {name: getattr(case.gains, name) for name in ("A", "a", "a1", "a2")}
    return LinearFeedback(case, own, sample_time=0.02, name="linear")


def told(case: Any) -> LinearFeedback:
    """Says by its name what payload it was made for."""
    own = {name: getattr(case.gains, name) for name in ("A", "a", "a1", "a2")}
    return LinearFeedback(case, own, sample_time=0.02, name=f"made for {case.payload.mass:.6g} kg")


class Killer:
    """Static gains, called from Python; kills its process where the payload is heavy.

    The environment may spare it (``SPARED=1``), as more memory would.
    """

    name, sample_time = "killer", 0.05

    def __init__(self, deadly: bool) -> None:
        self.deadly = deadly

    def reset(self) -> None:
        pass

    def step(self, measurement: Any, time: float) -> float:
        del measurement
        if self.deadly and time > 1.0 and not os.environ.get("SPARED"):
            os.kill(os.getpid(), signal.SIGKILL)
        return 0.0


def killer(case: Any) -> Killer:
    return Killer(case.payload.mass > 40e3)


class Sleeper(Killer):
    """Takes its time, as a controller that thinks does."""

    name = "sleeper"

    def __init__(self) -> None:
        super().__init__(deadly=False)

    def reset(self) -> None:
        time.sleep(0.15)


def sleeper(case: Any) -> Sleeper:
    del case
    return Sleeper()


class Breaker(Killer):
    """Fails in a way that nobody foresaw."""

    def step(self, measurement: Any, time: float) -> float:
        raise KeyError("a controller of one's own")


def breaker(case: Any) -> Breaker:
    del case
    return Breaker(deadly=False)


def writes(path: Path) -> bool:
    """Whether a journal has a result."""
    return path.exists() and '"key"' in path.read_text()
