"""How often a fault loses the load: `python docs/make/faults.py [CASE] [--controller NAME]`.

A sweep in time for each kind of `stillhook.sweeps.fault_spread`: 25 runs of two minutes, in each of
which something fails after 40 to 50 s, as badly as that kind does.  A load is lost where the plant
diverged, the brake had to stop the drum, or the load moved more than the hook with the drive
saturated until the end.  Prints the share that was lost, by kind and of all, with the 95 % interval
of Clopper and Pearson, keeps a row for each run in `docs/data/faults.csv`, and puts what it prints
into `docs/mpc.md`.  A kind that is stored for the case and controller is not run again;
``--kinds A,B`` runs only those.

One kind alone: ``stillhook sweep subsea-crane --mode time --controller mpc --faults outages``.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import warnings
from collections.abc import Iterator, Mapping, Sequence

from stored import DOCS, docs_folder, put_between, read_rows, study_parser, write_rows

import stillhook as sh
from models import PhysicsWarning
from models.basics import share
from models.spread import Spread, Uniform
from stillhook.sweeps import STATUS, fault_spread
from stillhook.sweeps.usual import FAULT_SPREADS

CASES, DURATION, AT = 25, 120.0, (40.0, 50.0)  # of a kind; of a run, and when something fails [s]
COLUMNS = ("case", "controller", "kind", "number", "status", "payload_rms", "hook_rms", "faults")
PAGE = DOCS / "mpc.md"
NOTE = "SI units; rms over each run; status as that of a sweep, all but completed lost the load."

Row = Mapping[str, str]


def rows_of(case: sh.Case, controller: str, kind: str, count: int) -> Iterator[Row]:
    """Yield a row for each run of a kind."""
    spread = Spread(dict(fault_spread(kind).distributions) | {"fault.at": Uniform(*AT)})
    found = sh.sweep(
        controller, spread, case=case, mode="time", samples=count, duration=DURATION, jobs=1
    )
    names = {code: name for name, code in STATUS.items()}
    for number in range(count):
        row = found.isel(case=number)
        sizes = (f"{path}={float(row[path]):.4g}" for path in spread.paths)
        yield {
            **{"case": case.name, "controller": controller, "kind": kind, "number": str(number)},
            "status": names[int(row["status"])],
            **{name: f"{float(row[name]):.4g}" for name in ("payload_rms", "hook_rms")},
            "faults": ";".join(sizes),
        }


def told(rows: Sequence[Row], case: str, controller: str) -> list[str]:
    """Return a line for each kind that was run and one of all: who lost the load."""
    own = [row for row in rows if (row["case"], row["controller"]) == (case, controller)]
    kinds = [kind for kind in FAULT_SPREADS if any(row["kind"] == kind for row in own)]
    lines = []
    for kind in (*kinds, "all"):
        those = [row for row in own if kind in (row["kind"], "all")]
        lost = [row["status"] for row in those if row["status"] != "completed"]
        if not those:
            continue
        found = share(len(lost), len(those))
        ends = f"{100.0 * found.low:.1f} to {100.0 * found.high:.1f} %"
        how = f": {', '.join(sorted(set(lost)))}" if lost else ""
        lines.append(f"{kind}: {found.count} of {found.total} lost the load ({ends}){how}")
    missing = [kind for kind in FAULT_SPREADS if kind not in kinds]
    return lines + ([f"not run: {', '.join(missing)}"] if missing else [])


def section(rows: Sequence[Row]) -> str:
    """Return what the page tells: a list for each case and controller that was run."""
    who = dict.fromkeys((row["case"], row["controller"]) for row in rows)
    return "\n\n".join(
        "\n".join(
            [f"`{controller}` on `{case}`:", "", *(f"- {x}" for x in told(rows, case, controller))]
        )
        for case, controller in who
    )


def main(argv: Sequence[str] | None = None) -> None:
    """Run the kinds that are not stored, keep their rows, and say who lost the load."""
    parser = study_parser(__doc__)
    parser.add_argument("case", nargs="?", default="subsea-crane", help="a bundled case")
    parser.add_argument("--controller", default="mpc", help="by its name (default: mpc)")
    parser.add_argument("--kinds", default=",".join(FAULT_SPREADS), help="kinds (default: all)")
    given = parser.parse_args(argv)
    warnings.simplefilter("ignore", PhysicsWarning)
    path = docs_folder(given.quick) / "data" / "faults.csv"
    rows: list[Row] = list(read_rows(path)) if path.exists() else []
    case, count = sh.load_case(given.case), 2 if given.quick else CASES
    for kind in given.kinds.split(",")[: 1 if given.quick else None]:
        if any(
            (row["case"], row["controller"], row["kind"]) == (case.name, given.controller, kind)
            for row in rows
        ):
            continue
        rows += rows_of(case, given.controller, kind, count)
        write_rows(path, COLUMNS, rows, NOTE)
        those = [row for row in rows if row["kind"] == kind]
        print(told(those, case.name, given.controller)[0], flush=True)
    print(*told(rows, case.name, given.controller), sep="\n")
    if not given.quick:
        put_between(PAGE, "faults", section(rows))


if __name__ == "__main__":
    main()
