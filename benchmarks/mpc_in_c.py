"""What predictive control as C is worth at home: `python benchmarks/mpc_in_c.py [--write]`.

The same run of 20 minutes with linear predictive control stepped from Python, which is the peer,
and as C within the compiled loop; three runs each in turn, processor times, medians.  What both
find for the load is compared.  What is paid once, writing and compiling the C, is told apart.  With
--write the rows go to docs/data/mpc_in_c.csv and the table to docs/performance.md.
"""

from __future__ import annotations

import os

# Before NumPy is loaded: one thread.
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["OMP_NUM_THREADS"] = "1"
os.environ["MKL_NUM_THREADS"] = "1"

import argparse
import statistics
import sys
import tempfile
import time as clock
from dataclasses import asdict, dataclass
from pathlib import Path

from synthesis import machine
from tables import markdown, plain

import stillhook as sh
from models.sensing import Controller
from models.simulation import SimulationOptions, prepare, run_simulation
from stillhook.controllers import with_c

ROOT = Path(__file__).parents[1]
DATA, PAGE = ROOT / "docs" / "data" / "mpc_in_c.csv", ROOT / "docs" / "performance.md"
CASES = ("thesis-1975", "thesis-1975-rope", "subsea-crane")
DURATION = 1200.0  # [s]
HEADINGS = ("case", "H_s [m]", "Python [s]", "C [s]", "ratio", "once [s]", "off [-]")


@dataclass(frozen=True, kw_only=True)
class Row:
    """One case in one sea: processor times of a run [s], and how far apart the loads are."""

    case: str
    height: float
    python: float
    in_c: float
    once: float  #: Writing and compiling, wall time [s].
    off: float  #: Of the payload's rms, relative.


def measured(name: str, height: float, repeats: int) -> Row:
    """Return the times of a case in a sea."""
    case = sh.load_case(name).replace({"sea.significant_height": height})
    controller: Controller = sh.LinearMPC(case)
    options = SimulationOptions(duration=DURATION)
    began = clock.perf_counter()
    loops = [prepare(case, with_c(controller), options=options)]
    once = clock.perf_counter() - began
    loops.insert(0, prepare(case, controller, options=options))
    times: tuple[list[float], list[float]] = ([], [])
    rms = [0.0, 0.0]
    for _ in range(repeats):
        for k, loop in enumerate(loops):
            began = clock.process_time()
            run = run_simulation(loop)
            times[k].append(clock.process_time() - began)
            rms[k] = run.statistics.value("payload rms")
    return Row(
        case=name,
        height=height,
        python=statistics.median(times[0]),
        in_c=statistics.median(times[1]),
        once=once,
        off=abs(rms[1] / rms[0] - 1.0),
    )


def main(arguments: list[str] | None = None) -> int:
    """Measure, print, and write if asked to; return 0."""
    parser = argparse.ArgumentParser(description=__doc__.partition(":")[0])
    parser.add_argument("--quick", action="store_true", help="one run each of the first case")
    parser.add_argument("--repeats", type=int, default=3, help="runs each (default: 3)")
    parser.add_argument("--write", action="store_true", help="write rows and table to the docs")
    asked = parser.parse_args(arguments)
    names, repeats = (CASES[:1], 1) if asked.quick else (CASES, asked.repeats)
    rows = []
    with tempfile.TemporaryDirectory() as cache:  # so that the compiler is asked
        os.environ["STILLHOOK_CACHE"] = cache
        for name in names:
            usual = float(sh.load_case(name).sea.significant_height)
            rows += [measured(name, height, repeats) for height in (usual, 2.5 * usual)]
    cells = [
        (
            row.case,
            f"{row.height:.3g}",
            f"{row.python:.2f}",
            f"{row.in_c:.2f}",
            f"{row.python / row.in_c:.1f}",
            f"{row.once:.1f}",
            f"{row.off:.0e}",
        )
        for row in rows
    ]
    print(plain([HEADINGS, *cells]))
    if asked.write:
        sys.path.insert(0, str(ROOT / "docs" / "make"))
        from stored import put_between, write_rows

        told = [asdict(row) for row in rows]
        write_rows(DATA, list(told[0]), told, "Processor times of a run of 20 min in s.")
        text = f"Measured on {machine()}.\n\n{markdown([HEADINGS, *cells])}"
        put_between(PAGE, "mpc-in-c", text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
