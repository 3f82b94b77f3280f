"""Stored studies of the docs: where their rows stand, and which code made them.

A study's rows are slow to make, so they are kept in `docs/data`; pages and figures are drawn from
them.  The first line of each file names the script and the digest of the code that it ran
(`stillhook.keeper.code_digest`); the tests' summary lists the files whose code is another now.
With ``--quick`` a script makes little effort and writes to `out/quick`, never to the docs.
"""

from __future__ import annotations

import argparse
import csv
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
#: The script that makes each file of `docs/data`.
SCRIPTS: Mapping[str, str] = {
    "comparison.csv": "docs/make/comparison.py",
    "faults.csv": "docs/make/faults.py",
    "headline.csv": "docs/make/headline.py",
    "holds.csv": "docs/make/holds.py",
    "landing.csv": "docs/make/landing.py",
    "landing_designs.csv": "docs/make/landing.py",
    "mpc_solvers.csv": "benchmarks/mpc_speed.py",
    "mpc_steps.csv": "benchmarks/mpc_speed.py",
    "mpc_in_c.csv": "benchmarks/mpc_in_c.py",
    "other_seas.csv": "docs/make/other_seas.py",
    "outages.csv": "docs/make/outages.py",
    "outages_designs.csv": "docs/make/outages.py",
    "pareto.csv": "docs/make/robust.py",
    "preview.csv": "docs/make/preview.py",
    "random_starts.csv": "docs/make/random_starts.py",
    "robust.csv": "docs/make/robust.py",
    "said_mpc.csv": "docs/make/said_mpc.py",
    "said_operability.csv": "docs/make/operability_figures.py",
    "said_structures.csv": "docs/make/said_structures.py",
    "said_windows.csv": "docs/make/windows_figures.py",
    "saturation.csv": "docs/make/saturation.py",
    "sea_reading.csv": "benchmarks/sea_reading.py",
    "simulation.csv": "benchmarks/simulation.py",
    "structure_bounds.csv": "docs/make/robust.py",
    "structures.csv": "docs/make/structures.py",
    "sweep.csv": "benchmarks/sweep.py",
    "sweep_workers.csv": "benchmarks/sweep_workers.py",
    "synthesis.csv": "benchmarks/synthesis.py",
    "validation.csv": "docs/make/validation.py",
}
_MADE = re.compile(r"^# Written by (?P<script>\S+) with code (?P<code>[0-9a-f]+)\.")


def study_parser(doc: str | None) -> argparse.ArgumentParser:
    """Return the parser of a script, with ``--quick``; its help is the script's first line."""
    parser = argparse.ArgumentParser(description=(doc or "").partition("\n")[0], allow_abbrev=False)
    parser.add_argument(
        "--quick",
        action="store_true",
        help="little effort, within a minute; written to out/quick, not to the docs",
    )
    return parser


def docs_folder(quick: bool) -> Path:
    """Return the folder whose `data`, `images` and pages a script writes."""
    folder = ROOT / "out" / "quick" if quick else DOCS
    for part in ("data", "images"):
        (folder / part).mkdir(parents=True, exist_ok=True)
    return folder


def read_rows(path: Path) -> list[dict[str, str]]:
    """Return the rows of a stored study, as text by column."""
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def digest_of(script: str) -> str:
    """Return the digest of the code that a script runs, scripts that it imports among it.

    This file counts for none: where rows are kept changes no number.
    """
    from stillhook.keeper import code_digest

    path = ROOT / script
    beside = {other.stem for other in path.parent.glob("*.py")} - {Path(__file__).stem}
    sys.path.insert(0, str(path.parent))
    try:
        return code_digest(path.stem, frozenset(beside))
    finally:
        sys.path.remove(str(path.parent))


def write_rows(
    path: Path, columns: Sequence[str], rows: Iterable[Mapping[str, object]], note: str = ""
) -> None:
    """Write the rows of a study at once, under a line that says which code made them."""
    script = SCRIPTS[path.name]
    scratch = path.with_suffix(".part")
    with scratch.open("w", encoding="utf-8", newline="") as file:
        file.write(f"# Written by {script} with code {digest_of(script)}. {note}".rstrip())
        file.write("\n")
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    scratch.replace(path)


def put_between(page: Path, name: str, text: str) -> None:
    """Write a text into a page between the marks `<!-- name: begin -->` and `... end -->`."""
    begin, end = (f"<!-- {name}: {which} -->" for which in ("begin", "end"))
    head, rest = page.read_text(encoding="utf-8").split(begin)
    _, tail = rest.split(end)
    page.write_text(f"{head}{begin}\n\n{text}\n\n{end}{tail}", encoding="utf-8")


def older_than_their_code(folder: Path = DOCS / "data") -> list[str]:
    """Return a sentence for each stored study that other code than today's has made."""
    now: dict[str, str] = {}
    found = []
    for path in sorted(folder.glob("*.csv")):
        if path.name not in SCRIPTS:
            found.append(f"{path.name}: no script is known that makes it")
            continue
        script = SCRIPTS[path.name]
        with path.open(encoding="utf-8") as file:
            made = _MADE.match(file.readline())
        if made is None:
            found.append(f"{path.name}: does not say which code made it ({script})")
            continue
        if script not in now:
            now[script] = digest_of(script)
        if made["code"] != now[script]:
            found.append(f"{path.name}: made by code {made['code']}, {script} is {now[script]} now")
            continue
        # Of a study that goes on where it stopped each row says what made it.
        rows = read_rows(path)
        older = sum(row.get("code", made["code"]) != made["code"] for row in rows)
        if older:
            found.append(
                f"{path.name}: {older} of {len(rows)} rows made by other code than today's"
            )
    return found
