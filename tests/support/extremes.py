"""Extreme but legal cases, and a program that asks commands about them with a limit on the time.

`ASK` runs each line in a process of its own, forked from one that has imported everything, under
the system's limit on processor time, and keeps how it ended.
"""

from __future__ import annotations

import itertools
import math
import pickle
import random
import subprocess
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from endings import Ending

import stillhook as sh

G = 9.80665


@dataclass(frozen=True, kw_only=True)
class Extreme:
    """Changes of a case of one kind, and how many times larger a drive they need."""

    kind: str
    changes: dict[str, Any]
    drive: float = 1.0


def _load(mass: float) -> dict[str, float]:
    """A load of the same shape as the crane's module, seven eighths of its weight in water."""
    size = (mass / 50e3) ** (1.0 / 3.0)
    return {
        "payload.mass": mass,
        "payload.added_mass": mass,
        "payload.submerged_weight": 0.87 * mass * G,
        "payload.area": max(16.0 * size**2, 1e-3),
    }


EXTREMES = {
    "rope of 1 m": Extreme(kind="rope", changes={"rope.length": 1.0}),
    "rope of 10 km": Extreme(kind="rope", changes={"rope.length": 10e3}, drive=4.0),
    "load of 1 kg": Extreme(kind="load", changes=_load(1.0)),
    "load of 5000 t": Extreme(kind="load", changes=_load(5e6), drive=150.0),
    "H_s of 1 cm": Extreme(kind="sea", changes={"sea.significant_height": 0.01}),
    "H_s of 20 m": Extreme(kind="sea", changes={"sea.significant_height": 20.0}),
    "no delay": Extreme(kind="delay", changes={"sensors.telemetry.delay": 0.0}),
    "delay of 5 s": Extreme(kind="delay", changes={"sensors.telemetry.delay": 5.0}),
    "no damping": Extreme(kind="damping", changes={"rope.damping_ratio": 0.0}),
    "gear of 1": Extreme(kind="gear", changes={"winch.gearbox.ratio": 1.0}, drive=150.0),
    "gear of 10000": Extreme(kind="gear", changes={"winch.gearbox.ratio": 1e4}),
}


def pairs(count: int, seed: int = 17) -> list[str]:
    """Draw names of pairs of extremes of two kinds."""
    every = itertools.combinations(EXTREMES, 2)
    apart = [(a, b) for a, b in every if EXTREMES[a].kind != EXTREMES[b].kind]
    return [" and ".join(pair) for pair in random.Random(seed).sample(apart, count)]


def extreme_case(base: str, name: str) -> sh.Case:
    """Return a bundled case at extremes, with a drum and a drive that can hold its load.

    Raises InputError if it is not legal.
    """
    case = sh.load_case(base)
    taken = [EXTREMES[part] for part in name.split(" and ")]
    changes: dict[str, Any] = {"name": "extreme"}
    for extreme in taken:
        changes |= extreme.changes
    times = math.prod(extreme.drive for extreme in taken)
    drive = case.winch.drive.model_dump(exclude_none=True)
    changes |= {
        f"winch.drive.{key}": min(times * value, 1e5) if key == "voltage" else times * value
        for key, value in drive.items()
        if key != "speed"
    }
    if case.limits.rope_tension_peak is not None:
        changes["limits.rope_tension_peak"] = times * case.limits.rope_tension_peak
    if case.winch.drum.geometry is not None and changes.get("rope.length", 0.0) > 1e3:
        changes |= {"winch.drum.rope_on_drum_total": 12e3, "winch.drum.geometry.layers": 60}
    return case.replace(changes)


ASK = """
import os, pickle, resource, shlex, sys, traceback
import stillhook as sh
import matplotlib.figure, rich.table, scipy.optimize, scipy.signal, xarray
from stillhook.cli import main

case = sh.load_case("thesis-1975")  # everything that a first design imports
sh.evaluate_gains(case, {name: getattr(case.gains, name) for name in ("A", "a", "a1", "a2")})


def asked(line, seconds):
    said = [os.memfd_create("said"), os.memfd_create("told")]
    child = os.fork()
    if not child:
        status = 99
        try:
            for number, file in zip((1, 2), said):
                os.dup2(file, number)
            resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
            status = main(shlex.split(line))
        except SystemExit as stop:
            status = int(stop.code or 0)
        except BaseException:
            traceback.print_exc()
        finally:
            for stream in (sys.stdout, sys.stderr):
                stream.flush()
            os._exit(status)
    _, ending, used = os.wait4(child, 0)
    texts = []
    for file in said:
        os.lseek(file, 0, os.SEEK_SET)
        with os.fdopen(file, "rb") as stream:
            texts.append(stream.read().decode())
    return os.waitstatus_to_exitcode(ending), *texts, used.ru_utime + used.ru_stime


found = [asked(line, int(sys.argv[2])) for line in sys.argv[3:]]
with open(sys.argv[1], "wb") as file:
    pickle.dump(found, file)
"""


def asked(lines: Iterable[str], folder: Path, *, seconds: int) -> list[tuple[str, Ending, float]]:
    """Run lines of the command line in a folder; return each with its ending and its time [s].

    One that takes more than so many seconds of processor time is ended by the system, by SIGKILL
    or SIGXCPU, and has that as a negative status.
    """
    lines = list(lines)
    script, said = folder / "ask.py", folder / "said.pickle"
    script.write_text(ASK)
    command = [sys.executable, str(script), str(said), str(seconds), *lines]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    found: Sequence[tuple[int, str, str, float]] = pickle.loads(said.read_bytes())
    return [
        (line, Ending(status=status, out=out, err=err), used)
        for line, (status, out, err, used) in zip(lines, found, strict=True)
    ]
