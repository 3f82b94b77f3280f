"""How long reading a vessel takes: `python benchmarks/rao_reading.py [FILE ..]`.

Times the bundled vessel, the same vessel as CSV and as NetCDF, and every RAO file that is given
(WAMIT .4, OrcaFlex .yml, Capytaine .nc, MSS .mat, ShipX .re1): the first read in a process of its
own, imports and all, and the median of later ones, check of long waves included.  Then what is
done with a table: the transfer to a hook, against that of waveresponse, and the operators at many
frequencies and headings.  Processor time.  Exit code 1 if a read after the first takes a second.

`--picture docs/images/osv-83m.svg` draws the picture of the docs.
"""

from __future__ import annotations

import os

os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["OMP_NUM_THREADS"] = "1"

import argparse
import statistics
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from models.basics import PhysicsWarning
from models.vessel import MODES, VesselRaos
from models.vessel.readers import read_raos, write_raos

LIMIT = 1.0  # s

_FIRST = """
import sys, time
start = time.process_time()
from models.vessel.readers import read_raos
read_raos(sys.argv[1])
print(time.process_time() - start)
"""


def median(run: Callable[[], object], repeats: int) -> float:
    """Median processor time of a call [s]."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        run()
        times.append(time.process_time() - start)
    return statistics.median(times)


def first(path: str) -> float:
    """Processor time of the first read in a process of its own [s]."""
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", _FIRST, path], capture_output=True, text=True
    )
    return float(done.stdout) if done.returncode == 0 else float("nan")


def reading(paths: Sequence[str], repeats: int) -> bool:
    """Print a row for each file; return whether all are read within the limit."""
    print(f"{'file':28} {'table':>16} {'first read':>11} {'later':>9}")
    fast = True
    for path in paths:
        raos = read_raos(path)
        later = median(lambda path=path: read_raos(path), repeats)  # type: ignore[misc]
        fast = fast and later < LIMIT
        size = f"{raos.omega.size} x {raos.heading.size}"
        name = Path(path).name
        print(f"{name:28} {size:>16} {1e3 * first(path):8.0f} ms {1e3 * later:6.1f} ms")
    return fast


def using(raos: VesselRaos, repeats: int) -> None:
    """Print what is done with a table, and what waveresponse takes for the same."""
    import waveresponse as wr

    point = (-25.0, 15.0, 20.0)
    theirs = raos.to_waveresponse()
    omega = np.linspace(0.1, 3.0, 500)[:, None]
    heading = np.linspace(0.0, 2.0 * np.pi, 36, endpoint=False)
    size = f"{raos.omega.size} x {raos.heading.size}"
    rows: list[tuple[str, Callable[[], object]]] = [
        (f"six motions to the hook, {size}", lambda: raos.at(point)),
        (
            "the same by waveresponse",
            lambda: wr.rigid_transform(np.array(point), *(theirs[mode] for mode in MODES)),
        ),
        ("heave at a hook, one heading", lambda: raos.heave_at(point, np.pi)),
        ("six operators, 500 x 36 points", lambda: raos.response(omega, heading)),
    ]
    print()
    for label, run in rows:
        print(f"{label:40} {1e3 * median(run, repeats):8.2f} ms")


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0], allow_abbrev=False)
    parser.add_argument("files", nargs="*")
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--quick", action="store_true", help="each read twice")
    parser.add_argument("--picture", metavar="FILE", help="draw the bundled vessel (.svg, .png)")
    given = parser.parse_args(argv)
    if given.quick:
        given.repeats = 2
    warnings.simplefilter("ignore", PhysicsWarning)
    vessel = read_raos("osv-83m")
    with tempfile.TemporaryDirectory() as folder:
        own = [str(write_raos(Path(folder) / f"osv-83m{end}", vessel)) for end in (".csv", ".nc")]
        fast = reading(["osv-83m", *own, *given.files], given.repeats)
    using(vessel, given.repeats)
    if given.picture:
        from stillhook.seas import rao_figure
        from stillhook.text import picture

        place = Path(given.picture)
        place.write_bytes(picture(rao_figure(vessel), place.suffix.removeprefix(".")))
    return 0 if fast else 1


if __name__ == "__main__":
    raise SystemExit(main())
