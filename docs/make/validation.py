"""What is compared with what, and how near the two come: `docs/data/validation.csv`.

    python docs/make/validation.py

A row says what was reached in two ways, where the other way comes from, how far the two are apart,
how far they may be, and which test holds them to it (`validation_checks.py`).  What takes moments
is computed; the study of designs in simulation is read from its stored rows; what needs files,
programs or minutes that not everybody has is named with the accuracy that its test asks for.  The
table stands in `docs/validation.md` between two marks.
"""

from __future__ import annotations

import os

# Before NumPy is loaded: one thread for small matrices.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import subprocess
import time
import warnings
from collections.abc import Iterable, Mapping, Sequence

from stored import DOCS, ROOT, docs_folder, put_between, study_parser, write_rows
from validation_checks import CHECKS, COMPUTED, RELATIVE, STORED, TESTED

from models.basics import PhysicsWarning

CSV = DOCS / "data" / "validation.csv"
PAGE = DOCS / "validation.md"
COLUMNS = (
    "subject",
    "quantity",
    "unit",
    "ours",
    "other",
    "source",
    "measure",
    "difference",
    "accepted",
    "how",
    "commit",
    "test",
)


def missed(row: Mapping[str, str]) -> bool:
    """Return whether a row is further off than is accepted."""
    return bool(row["difference"]) and float(row["difference"]) > float(row["accepted"]) * (
        1 + 1e-9
    )


def commit() -> str:
    """Return the commit that the code stands on; empty outside of a repository."""
    try:
        words = ["git", "rev-parse", "--short=8", "HEAD"]
        found = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return ""
    return found.stdout.strip()


def _amount(row: Mapping[str, str], text: str) -> str:
    """Return a difference with its unit."""
    if not text:
        return ""
    value = float(text)
    if row["measure"] == RELATIVE:
        return f"{100.0 * value:.2g} %" if value >= 1e-5 else f"{value:.0e}"
    return f"{value:.2g} {row['unit']}".rstrip()


def _value(row: Mapping[str, str], name: str) -> str:
    return f"{float(row[name]):.5g} {row['unit']}".rstrip() if row[name] else ""


def table(rows: Iterable[Mapping[str, str]]) -> str:
    """Return the tables of all subjects, as Markdown."""
    parts, subject = [], ""
    for row in rows:
        if row["subject"] != subject:
            subject = row["subject"]
            parts.append(
                f"\n### {subject}\n\n| quantity | Stillhook | held against | difference | accepted "
                "| test |\n|" + " --- |" * 6
            )
        value, other = _value(row, "ours"), _value(row, "other")
        against = f"{row['source']}" + (f": {other}" if other else "")
        apart = "by its test" if row["how"] == TESTED else _amount(row, row["difference"])
        apart += " **missed**" if missed(row) else ""
        path, _, name = row["test"].partition("::")
        cells = (row["quantity"], value, against, apart, _amount(row, row["accepted"]))
        told = [cell.replace("|", "\\|") for cell in cells]
        parts.append(f"| {' | '.join(told)} | `{path.rpartition('/')[2]}::{name}` |")
    return "\n".join(parts).strip()


def summary(rows: Sequence[Mapping[str, str]]) -> str:
    """Return in a sentence what the table says."""
    counts = {how: sum(row["how"] == how for row in rows) for how in (COMPUTED, STORED, TESTED)}
    number = sum(missed(row) for row in rows)
    (made,) = {row["commit"] for row in rows}
    return (
        f"{len(rows)} comparisons: {counts[COMPUTED]} computed for this page, {counts[STORED]} "
        f"from stored studies, {counts[TESTED]} by their tests alone; {number} are further off "
        f"than was asked for, and say so. Made on commit `{made}`."
    )


def section(rows: Sequence[Mapping[str, str]]) -> str:
    """Return what stands between the marks of the page."""
    return f"{summary(rows)}\n\n{table(rows)}"


def main() -> None:
    arguments = study_parser(__doc__).parse_args()
    folder = docs_folder(arguments.quick)
    made, rows = commit(), []
    for check in CHECKS:
        if arguments.quick and not check.quick:
            continue
        began = time.perf_counter()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", PhysicsWarning)
            row = check.row()
        rows.append({**row, "commit": made})
        if check.work is not None:
            print(f"{time.perf_counter() - began:6.1f} s  {check.quantity}: {row['difference']}")
    write_rows(folder / "data" / CSV.name, COLUMNS, rows, "SI units; see docs/validation.md.")
    if not arguments.quick:
        put_between(PAGE, "validation", section(rows))


if __name__ == "__main__":
    main()
