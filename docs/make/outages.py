"""What a lost sensor costs: `python docs/make/outages.py [CASE ...] [--seeds N] [--only LOST]`.

Predictive control loses telemetry, reference unit or load cell, alone or in pairs, for 5 to 300 s,
twenty times a run; the payload's rms is taken over each outage and the minute after it.  Beside it,
in the same seas and windows, is every verified law that does without those sensors: the drum held,
constant tension, feed-forward, and the case's best designs (`docs/data/outages_designs.csv`).  The
stillest of those is the rival; asked is that predictive control leaves less than 1.2 times as much
after 60 and 300 s, 1.5 times after 5 and 20 s, at the upper end of the 90 % interval, paired by
outage, on a log scale.

What is stored in `docs/data/outages.csv` is kept, and the study goes on with what is missing of
what is asked for, by default all bundled cases and three seeds, hours; ``--only telemetry,mru``
runs outages of those alone or together.  The section of `docs/mpc.md` is then written anew, and
says what has not been run.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import math
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from itertools import product
from pathlib import Path

import numpy as np
from landing import design_rows, parameters_of
from stored import DOCS, docs_folder, put_between, read_rows, study_parser, write_rows

import stillhook as sh
from models import PhysicsWarning
from models.basics import Interval, pooled_interval
from models.operation import scenario_named
from models.sensing import Controller
from synth.question import controller_for

CASES = ("subsea-crane", "landing", "thesis-1975-rope", "thesis-1975")
LENGTHS = (60.0, 20.0, 5.0, 300.0)  # s, in the order in which they are run
ASKED: Mapping[float, float] = {5.0: 1.5, 20.0: 1.5, 60.0: 1.2, 300.0: 1.2}
#: What is lost, and what the scenario calls that.
LOST: Mapping[str, tuple[str, ...]] = {
    "telemetry": ("telemetry_outages",),
    "mru": ("mru_outages",),
    "load cell": ("load_cell_outages",),
    "telemetry, load cell": ("telemetry_outages", "load_cell_outages"),
    "mru, load cell": ("mru_outages", "load_cell_outages"),
    "telemetry, mru": ("telemetry_outages", "mru_outages"),
}
SEEDS, OUTAGES = 3, 20
BEGINS, AFTER, BETWEEN = 90.0, 60.0, 30.0  # the first outage; counted after one; until the next [s]
CONFIDENCE = 0.9
#: The best designs of a case, and the sensors besides the encoder that they need.
DESIGNS: Mapping[str, frozenset[str]] = {
    "feed-forward, designed": frozenset({"mru"}),
    "drum-feedback": frozenset({"telemetry"}),
    "payload-feedback": frozenset({"telemetry"}),
    "payload-feedback-rolloff": frozenset({"telemetry"}),
    "combined": frozenset({"telemetry", "mru"}),
}
#: All laws that predictive control is held against.
NEEDS: Mapping[str, frozenset[str]] = {
    "none": frozenset(),
    "constant-tension": frozenset({"load cell"}),
    "feed-forward": frozenset({"mru"}),
    "feed-forward-full": frozenset({"mru"}),
    **DESIGNS,
}
COLUMNS = ("case", "seed", "lost", "length", "law", "rms")
NOTE = "SI units; rms of the payload over each outage and the minute after, in order of time."
PAGE = DOCS / "mpc.md"

Row = Mapping[str, str]
Key = tuple[str, int, str, float, str]


def begins(length: float, count: int) -> list[float]:
    """Return when the outages of a run begin [s]."""
    return [BEGINS + k * (length + AFTER + BETWEEN) for k in range(count)]


def windows(run: sh.Run, length: float, count: int) -> list[float]:
    """Return the payload's rms over each outage and the minute after [m]; infinite once it fell."""
    moved = run["payload.displacement"]
    found = []
    for begin in begins(length, count):
        part = moved[(run.time > begin) & (run.time <= begin + length + AFTER)]
        whole = run.time[-1] >= begin + length + AFTER - 1.0
        found.append(float(np.sqrt(np.mean(part**2))) if whole else math.inf)
    return found


def designs_of(case: str, folder: Path) -> Mapping[str, Mapping[str, float]]:
    """Return the verified designs of a case by structure, found once and kept in a file."""
    path = folder / "outages_designs.csv"
    rows = read_rows(path) if path.exists() else []
    if not any(row["case"] == case for row in rows):
        new = {row["structure"]: row for row in design_rows(sh.load_case(case))}
        rows += [{"case": case} | row for row in new.values()]
        write_rows(path, list(rows[-1]), rows, "SI units.")
    own = [row for row in rows if row["case"] == case and row["ok"] == "yes"]
    return {row["structure"]: parameters_of(row) for row in own}


def laws(case: str, folder: Path) -> dict[str, Controller | str]:
    """Return the laws that predictive control is held against, those that the case has."""
    made = sh.load_case(case)
    found: dict[str, Controller | str] = {name: name for name in NEEDS if name not in DESIGNS}
    for structure, parameters in designs_of(case, folder).items():
        name = "feed-forward, designed" if structure == "feed-forward" else structure
        if name in DESIGNS:
            law = controller_for(made, structure, parameters)
            found[name] = sh.LinearFeedback(made, law)
    return found


@cache
def predictive(case: str) -> Controller:
    """Return the controller of a case."""
    return sh.LinearMPC(sh.load_case(case))


def simulated(
    case: str, controller: Controller | str, seed: int, lost: str, length: float, count: int
) -> list[float]:
    """Return the rms of the windows of one run; without outages if nothing is lost."""
    own = sh.load_case(case)
    ends = begins(length, count)[-1] + length + AFTER
    periods = [(begin, begin + length) for begin in begins(length, count)]
    changes = dict.fromkeys(LOST.get(lost, ()), tuple(periods))
    hold = replace(scenario_named("hold", own), **changes)
    (run,) = sh.simulate(
        own, controller, scenario=hold, seeds=[seed], duration=ends + 1.0, store_step=0.05
    )
    return windows(run, length, count)


def tasks(cases: Sequence[str], seeds: int, lost: Iterable[str]) -> Iterator[Key]:
    """Yield what is to be run, a seed of all outages first: case, seed, lost, length, law."""
    for case, seed in product(cases, range(seeds)):
        for length, law in product(LENGTHS, NEEDS):
            yield case, seed, "", length, law
        for length, which in product(LENGTHS, lost):
            yield case, seed, which, length, "mpc"


def key_of(row: Row) -> Key:
    """Return what a stored row is about."""
    return row["case"], int(row["seed"]), row["lost"], float(row["length"]), row["law"]


def values(row: Row) -> list[float]:
    """Return the rms of the windows of a row."""
    return [float(value) for value in row["rms"].split()]


def study(wanted: Iterable[Key], path: Path, count: int) -> list[Row]:
    """Run what is not there yet, each row kept as soon as it is made; return all rows."""
    rows: list[Row] = list(read_rows(path)) if path.exists() else []
    there = {key_of(row) for row in rows}
    known = cache(partial(laws, folder=path.parent))
    for key in wanted:
        case, seed, lost, length, law = key
        if key in there or (law != "mpc" and law not in known(case)):
            continue
        controller = predictive(case) if law == "mpc" else known(case)[law]
        found = simulated(case, controller, seed, lost, length, count)
        shown = " ".join(f"{value:.4g}" for value in found)
        rows.append(dict(zip(COLUMNS, (*map(str, key), shown), strict=True)))
        write_rows(path, COLUMNS, rows, NOTE)
        print(*key, f"{1e3 * float(pooled_interval(found).mean):.1f} mm", flush=True)
    return rows


def able(lost: str) -> list[str]:
    """Return the laws that do without the sensors that are lost."""
    gone = set(lost.split(", "))
    return [law for law, needs in NEEDS.items() if not needs & gone]


def ratio(
    rows: Sequence[Row], case: str, lost: str, length: float
) -> tuple[Interval, Interval, str, Interval] | None:
    """Return what predictive control leaves, the rival and its name, and the ratio; None if unrun.

    Rows are paired by seed and outage; the rival is the law that leaves least over all of them.
    """
    pooled: dict[str, dict[int, list[float]]] = {}
    for row in rows:
        own, seed, which, long, law = key_of(row)
        if (own, long) == (case, length) and which in ("", lost):
            pooled.setdefault(law, {})[seed] = values(row)
    ours = pooled.pop("mpc", {})
    seeds = [seed for seed in sorted(ours) if all(seed in own for own in pooled.values())]
    rivals = {law: np.concatenate([own[s] for s in seeds]) for law, own in pooled.items() if seeds}
    rivals = {law: own for law, own in rivals.items() if law in able(lost)}
    if not rivals:
        return None
    left = np.concatenate([ours[seed] for seed in seeds])
    law = min(rivals, key=lambda name: float(np.mean(rivals[name] ** 2)))
    pool = partial(pooled_interval, confidence=CONFIDENCE)
    return pool(left), pool(rivals[law]), law, pool(left, rivals[law])


def section(rows: Sequence[Row]) -> str:
    """Return the section of the page: a table of what was run, and what was not."""
    body, missing, kept, asked, few = [], [], 0, 0, 0
    for case in CASES:
        for lost, length in product(LOST, sorted(LENGTHS)):
            found = ratio(rows, case, lost, length)
            asked += 1
            if found is None:
                missing.append((case, lost, length))
                continue
            ours, theirs, law, over = found
            holds = over.high < ASKED[length]
            kept += holds
            few += ours.count < SEEDS * OUTAGES
            cells = (
                *(case, lost, f"{length:g} s", f"{ours.count}"),
                *(f"{1e3 * each.mean:.3g}" for each in (ours, theirs)),
                *(law, f"{over.mean:.2f} ({over.low:.2f} to {over.high:.2f})"),
                "yes" if holds else "no",
            )
            body.append(f"| {' | '.join(cells)} |")
    head = "| case | lost | for | outages | MPC [mm] | rival [mm] | rival | ratio | as asked |"
    lines = [head, f"|{' --- |' * 9}", *body]
    ran = asked - len(missing)
    told = f"{kept} of {ran} that were run are as asked"
    if few:
        told += f"; {few} of them with fewer than {SEEDS} seeds of {OUTAGES} outages"
    if missing:
        by_case = [
            f"{case} {sum(m[0] == case for m in missing)} of {len(LOST) * len(LENGTHS)}"
            for case in CASES
            if any(m[0] == case for m in missing)
        ]
        told += f"; not run yet: {', '.join(by_case)}"
    return "\n".join([f"{told}.", "", *lines])


def main(argv: Sequence[str] | None = None) -> None:
    """Go on with the study and write the section anew."""
    parser = study_parser(__doc__)
    parser.add_argument("cases", nargs="*", metavar="CASE", help="bundled cases (default: all)")
    parser.add_argument("--seeds", type=int, default=SEEDS, help="seeds (default: three)")
    parser.add_argument("--only", help="sensors lost, alone or together, with commas")
    given = parser.parse_args(argv)
    warnings.simplefilter("ignore", PhysicsWarning)
    names = set(",".join([given.only or ",".join(LOST)]).replace(", ", ",").split(","))
    lost = [which for which in LOST if set(which.split(", ")) <= names]
    path = docs_folder(given.quick) / "data" / "outages.csv"
    if given.quick:
        wanted = [key for key in tasks(CASES[:1], 1, ["mru"]) if key[3] == 5.0]
        study(wanted, path, 2)
        return
    rows = study(tasks(given.cases or CASES, given.seeds, lost), path, OUTAGES)
    put_between(PAGE, "outages", section(rows))


if __name__ == "__main__":
    main()
