"""How often the 1975 thesis's gains fall into a limit cycle at a torque limit, over H_s.

One spring, quadratic drag, perfect sensors, and a torque of at most twice the rating; every
other limit of the drive is off.  A run has fallen when the payload is half a metre off its place:
while the loop holds, that is a hundred times what it does.

    python docs/make/saturation.py

writes `docs/data/saturation.csv`; the notebook `notebooks/02-saturation.ipynb` shows it, and
repeats the first seeds.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from stored import docs_folder, read_rows, study_parser, write_rows

import stillhook as sh
from models.basics import FallTime, Share, fall_time, share
from models.plant import DriveLimits

ROOT = Path(__file__).resolve().parents[2]
CSV = ROOT / "docs" / "data" / "saturation.csv"

TORQUE = 11_880.0  # twice the rating [N m]
FALLEN = 0.5  # off its place [m]
WATCHED = 1200.0  # [s]
GROWING = 30.0  # in which the sea grows out of rest, before the watch [s]
SAMPLE_TIME = 0.005  # of the feedback [s]
SEEDS = 100
HEIGHTS = (0.6, 0.75, 0.9, 1.0, 1.1, 1.25, 1.5, 1.9, 2.4)  # H_s [m]
# Once more with a shorter sample time [s], to see what the sampling does: at these H_s [m].
FINER = 0.001
FINER_AT = {"hold": 0.75, "hold to 3 rad/s": 1.0, "zero": 1.25}

COLUMNS = ("falls", "held_rms", "fell_at")

# How the heave operator goes on beyond its table, which ends at 1.46 rad/s with 0.32 m/m.
CONTINUATIONS: Mapping[str, str] = {
    "hold": "its last value held",
    "hold to 3 rad/s": "held up to 3 rad/s, zero beyond",
    "zero": "zero beyond",
}


@dataclass(frozen=True, kw_only=True)
class Sea:
    """What the runs of one row have in common."""

    continuation: str
    height: float
    sample_time: float = SAMPLE_TIME


@dataclass(frozen=True, kw_only=True, eq=False)
class Falls:
    """What became of the seeds 0 to n - 1 in one sea."""

    sea: Sea
    fell_at: tuple[float, ...]
    """Time from the beginning of the watch to the fall, inf for a run that held [s]."""
    held_rms: float
    """Mean of the payload's rms over the runs that held, NaN without one [m]."""

    @property
    def share(self) -> Share:
        """Share of the runs that fell, with Clopper and Pearson's interval."""
        return share(sum(math.isfinite(t) for t in self.fell_at), len(self.fell_at))

    @property
    def time(self) -> FallTime:
        """Time to fall, with the chi-square interval of its rate."""
        times = np.array(self.fell_at)
        return fall_time(np.minimum(times, WATCHED), np.isfinite(times))


def case_for(sea: Sea | None = None) -> sh.Case:
    """Return the thesis's case without an overspeed switch, in a sea if one is given.

    The switch would end a fall by setting the brake, within seconds.
    """
    changes: dict[str, object] = {"winch.drive.speed": 1000.0, "winch.drive.voltage": None}
    case = sh.load_case("thesis-1975")
    if sea is not None:
        changes["sea.significant_height"] = sea.height
        changes["vessel.beyond"] = "hold" if sea.continuation == "hold" else "zero"
    if sea is not None and sea.continuation == "hold to 3 rad/s":
        table = case.vessel.heave_rao
        assert table is not None  # the thesis's is a table
        changes["vessel.heave_rao.omega"] = [*table.omega, 3.0]
        changes["vessel.heave_rao.amplitude"] = [*table.amplitude, table.amplitude[-1]]
    return case.replace(changes)


def runs_in(sea: Sea, seeds: int | Sequence[int], **options: object) -> sh.Runs:
    """Return runs of the thesis's gains in a sea; options are those of `sh.simulate`."""
    wanted: dict[str, object] = {
        "seeds": seeds,
        "duration": GROWING + WATCHED,
        "settle": GROWING,
        "lock_limit": FALLEN,
        "sample_time": sea.sample_time,
        "limits": DriveLimits(torque=TORQUE),
        "traces": "worst",
        "store_step": 0.1,
    }
    return sh.simulate(case_for(sea), "feedback", **(wanted | options))


def falls_in(sea: Sea, seeds: int) -> Falls:
    """Return what becomes of the seeds 0 to n - 1."""
    statistics = [run.statistics for run in runs_in(sea, seeds)]
    at = [s.value("lost lock at") - GROWING for s in statistics]
    held = [s.value("payload rms") for s, t in zip(statistics, at, strict=True) if math.isnan(t)]
    return Falls(
        sea=sea,
        fell_at=tuple(math.inf if math.isnan(t) else t for t in at),
        held_rms=float(np.mean(held)) if held else math.nan,
    )


def seas() -> list[Sea]:
    """Return all rows of the study."""
    found = [Sea(continuation=name, height=h) for name in CONTINUATIONS for h in HEIGHTS]
    finer = [Sea(continuation=n, height=h, sample_time=FINER) for n, h in FINER_AT.items()]
    return found + finer


def load() -> list[Falls]:
    """Return the rows that are stored in `docs/data/saturation.csv`."""
    return [
        Falls(
            sea=Sea(
                continuation=row["continuation"],
                height=float(row["H_s"]),
                sample_time=float(row["sample_time"]),
            ),
            fell_at=tuple(float(text) for text in row["fell_at"].split()),
            held_rms=float(row["held_rms"]),
        )
        for row in read_rows(CSV)
    ]


def pick(rows: Sequence[Falls], continuation: str, height: float, T: float = SAMPLE_TIME) -> Falls:
    """Return the one row of a sea."""
    sea = Sea(continuation=continuation, height=height, sample_time=T)
    (found,) = (row for row in rows if row.sea == sea)
    return found


def write(rows: Sequence[Falls], path: Path = CSV) -> None:
    """Write the data file."""
    told = [
        {
            "continuation": row.sea.continuation,
            "H_s": row.sea.height,
            "sample_time": row.sea.sample_time,
            "runs": row.share.total,
            "falls": row.share.count,
            "held_rms": f"{row.held_rms:.6g}",
            "fell_at": " ".join("inf" if math.isinf(t) else f"{t:.3f}" for t in row.fell_at),
        }
        for row in rows
    ]
    write_rows(path, list(told[0]), told, "SI units; fell_at of seeds 0, 1, 2, ...")


def main(argv: Sequence[str] | None = None) -> None:
    """Run the study and write it."""
    quick = study_parser(__doc__).parse_args(argv).quick
    path = docs_folder(quick) / "data" / CSV.name
    rows: list[Falls] = []
    for sea in seas()[:2] if quick else seas():
        start = time.perf_counter()
        rows.append(falls_in(sea, 2 if quick else SEEDS))
        counted = rows[-1].share
        print(
            f"{sea}: {counted.count} of {counted.total} fell, "
            f"{1e3 * rows[-1].held_rms:.2f} mm while held ({time.perf_counter() - start:.0f} s)",
            flush=True,
        )
        write(rows, path)


if __name__ == "__main__":
    main()
