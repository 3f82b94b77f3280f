"""Predictive control against linear feedback on the 1975 winch, in the same seas.

    python benchmarks/comparison.py [--out DIR] [--seeds 6] [--cases thesis-1975,thesis-1975-rope]

Torque of at most twice the rating, quadratic drag, and a reference unit whose error is white noise
of 1 % of the heave's rms sampled at 4 Hz.  Runs of 20 minutes; one that was stopped goes on.
It takes an hour or two on two cores, the designs and the floors on the rope most of it.  Writes
`docs/data/comparison.csv`, a row for each run, and prints the table of `docs/compare.md`.
"""

from __future__ import annotations

import argparse
import csv
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import stillhook as sh
from stillhook.compare_cell import Cell

ROOT = Path(__file__).resolve().parents[1]
CSV = ROOT / "docs" / "data" / "comparison.csv"
HEIGHTS = (1.0, 1.25, 1.9, 2.43, 3.75)  # H_s [m]
UNIT = {"noise_floor": 0.0, "noise_fraction": 0.01, "noise_bandwidth": 11.31}
CONTENDERS: Mapping[str, tuple[str, ...]] = {
    "thesis-1975": (
        *("none", "thesis", "feedback", "feedback-half", "combined", "combined-half"),
        *("mpc", "mpc-preview", "nonlinear-mpc", "clairvoyant"),
    ),
    "thesis-1975-rope": ("none", "combined-half", "combined-eager", "mpc", "mpc-preview"),
}
COLUMNS = ("case", "contender", "height", "seed", "rms", "largest", "torque_rms", "lost")


def case_of(name: str) -> sh.Case:
    """Return a case with its noisy reference unit."""
    return sh.load_case(name).replace({"sensors.mru": UNIT})


def rows_of(name: str, cells: Iterable[Cell]) -> list[dict[str, object]]:
    """Return rows of the data file from the cells of a comparison, as it keeps them."""
    found = []
    for cell in cells:
        numbers = cell.quantities
        lost = numbers.get("lost lock at", math.nan)
        found.append(
            {
                "case": name,
                "contender": cell.contender,
                "height": cell.height,
                "seed": cell.seed,
                "rms": numbers.get("payload rms", math.nan),
                "largest": numbers.get("payload largest", math.nan),
                "torque_rms": numbers.get("motor torque rms", math.nan),
                "lost": int(not math.isnan(lost)),
            }
        )
    return found


def write(rows: Sequence[Mapping[str, object]]) -> None:
    """Write the data file."""
    with CSV.open("w", encoding="utf-8", newline="") as file:
        file.write("# Written by benchmarks/comparison.py. SI units; a row for each run.\n")
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        for row in rows:
            writer.writerow({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()})


def load() -> list[dict[str, str]]:
    """Return the rows of the data file."""
    with CSV.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def pooled(rows: Iterable[Mapping[str, str]], case: str, contender: str, height: float) -> float:
    """Return the root of the mean square over the seeds [m]; NaN without one."""
    values = [
        float(row["rms"])
        for row in rows
        if (row["case"], row["contender"]) == (case, contender)
        and math.isclose(float(row["height"]), height)
    ]
    return math.sqrt(sum(v * v for v in values) / len(values)) if values else math.nan


def table(rows: Sequence[Mapping[str, str]]) -> str:
    """Return the table of the documentation, in Markdown: pooled rms in millimetres."""
    lines = ["| case | controller | " + " | ".join(f"{h:g} m" for h in HEIGHTS) + " | lost |"]
    lines.append("| --- | --- |" + " --- |" * (len(HEIGHTS) + 1))
    for case, names in CONTENDERS.items():
        for name in names:
            own = [row for row in rows if (row["case"], row["contender"]) == (case, name)]
            if not own:
                continue
            cells = []
            for height in HEIGHTS:
                value = 1e3 * pooled(rows, case, name, height)
                cells.append("-" if math.isnan(value) else f"{value:.3g}")
            lost = sum(int(row["lost"]) for row in own)
            floor = "" if name == "clairvoyant" else f"{lost} of {len(own)}"
            lines.append(f"| {case} | `{name}` | " + " | ".join(cells) + f" | {floor} |")
    return "\n".join(lines)


def main(argv: Sequence[str] | None = None) -> None:
    """Run the study, write its data and print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "comparison")
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--cases", default=",".join(CONTENDERS))
    given = parser.parse_args(argv)
    rows: list[dict[str, object]] = []
    for name in given.cases.split(","):
        comparison = sh.compare(
            case_of(name),
            CONTENDERS[name],
            seeds=given.seeds,
            duration="20 min",
            heights=HEIGHTS,
            out=given.out / name,
            traces=False,
            starts=4,
        )
        print(comparison)
        rows += rows_of(name, comparison.cells)
    write(rows)
    print(table(load()))


if __name__ == "__main__":
    main()
