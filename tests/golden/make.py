"""Compare the golden figures with what the toolkit computes, or renew them.

    python tests/golden/make.py                  which rows differ (exit status 1 if any does)
    python tests/golden/make.py thesis sea       of these groups only
    python tests/golden/make.py --write          renew them, and say what they were

`figures.csv` holds two tolerances: that with the BLAS kernels of `machine.txt`, and that elsewhere.
The figures are those of `golden_figures.py`, the faces those of `golden_faces.py`.  A changed
golden value is a commit of its own, with old value, new value and reason.
"""

from __future__ import annotations

import argparse
import csv
import importlib.util
import json
import math
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
os.environ.setdefault("MPLBACKEND", "Agg")

import numpy as np  # noqa: E402

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "support"))  # as pytest has it
FIGURES, COMMANDS, FACES = HERE / "figures.csv", HERE / "commands.csv", HERE / "faces.json"
MACHINE = HERE / "machine.txt"
COLUMNS = ("name", "value", "tolerance", "elsewhere", "kind", "note")


def sibling(name: str) -> ModuleType:
    """Return a module of this folder, however this one was imported."""
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, HERE / f"{name}.py")
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module  # dataclasses look their module up
        spec.loader.exec_module(module)
    return sys.modules[name]


def group_of(name: str) -> str:
    """Return the group of a figure or series."""
    return name.partition(".")[0]


def text_of(value: float | str) -> str:
    """Return a value as the files hold it: all digits."""
    return value if isinstance(value, str) else repr(float(value))


def kernels() -> str:
    """Return the kind of processor that numpy's BLAS computes for."""
    from threadpoolctl import threadpool_info

    found = (str(pool.get("architecture", "unknown")) for pool in threadpool_info())
    return next((name for name in found if name != "unknown"), "unknown")


def at_home() -> bool:
    """Return whether the golden figures were made with these kernels."""
    return not MACHINE.is_file() or MACHINE.read_text(encoding="utf-8").strip() == kernels()


# --- the files ----------------------------------------------------------------------------------


def read_rows() -> dict[str, dict[str, str]]:
    """Return the rows of `figures.csv` by name."""
    if not FIGURES.is_file():
        return {}
    with FIGURES.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    names = [row["name"] for row in rows]
    if len(set(names)) < len(names):
        raise ValueError(f"{FIGURES.name}: a name stands there twice")
    return dict(zip(names, rows, strict=True))


def read_series() -> dict[str, np.ndarray]:
    """Return the columns of `commands.csv` by name."""
    if not COMMANDS.is_file():
        return {}
    with COMMANDS.open(encoding="utf-8", newline="") as file:
        head, *rows = list(csv.reader(file))
    return {name: np.array([float(row[i]) for row in rows]) for i, name in enumerate(head)}


def read_faces() -> dict[str, Any]:
    """Return the faces by group."""
    if not FACES.is_file():
        return {}
    return dict(json.loads(FACES.read_text(encoding="utf-8")))


# --- what differs -------------------------------------------------------------------------------


def differs(old: str, new: float | str, tolerance: float, kind: str) -> bool:
    """Return whether a figure is not the one that is written."""
    if kind == "text":
        return old != new
    a, b = float(old), float(new)
    if math.isnan(a) or math.isnan(b):
        return math.isnan(a) != math.isnan(b)
    if math.isinf(a) or math.isinf(b):
        return a != b
    return abs(a - b) > tolerance * abs(a)


def figure_differences(
    found: Any, rows: dict[str, dict[str, str]], series: dict[str, np.ndarray], group: str
) -> list[str]:
    """Return a line for each figure and series of a group that is not as written."""
    lines = []
    column = "tolerance" if at_home() else "elsewhere"
    known = {name: row for name, row in rows.items() if group_of(name) == group}
    for name, figure in found.rows.items():
        if name not in known:
            lines.append(f"{name}: has no row; it is {text_of(figure.value)}")
            continue
        row, new = known.pop(name), text_of(figure.value)
        said = (float(row["tolerance"]), float(row["elsewhere"]), row["kind"], row["note"])
        if said != (figure.tolerance, figure.elsewhere, figure.kind, figure.note):
            lines.append(f"{name}: the row has another tolerance, kind or note")
        tolerance = getattr(figure, column)
        if differs(row["value"], figure.value, tolerance, figure.kind):
            off = ""
            if figure.kind != "text" and float(row["value"]):
                share = float(new) / float(row["value"]) - 1.0
                off = f", by {share:.1e} against {tolerance:.0e}"
            lines.append(f"{name}: was {row['value']}, is {new}{off}")
    lines += [f"{name}: a row without a figure" for name in known]
    columns = {name: values for name, values in series.items() if group_of(name) == group}
    for name, values in found.series.items():
        if name not in columns:
            lines.append(f"{name}: is not in {COMMANDS.name}")
            continue
        old = columns.pop(name)
        if old.shape != values.shape:
            lines.append(f"{name}: was {old.size} commands, is {values.size}")
            continue
        size = float(np.abs(old).max())
        off = float(np.abs(values - old).max())
        # Its norm is a figure, with the tolerance of the whole series.
        if not off <= getattr(found.rows[f"{name}.norm"], column) * size:
            at = int(np.argmax(np.abs(values - old)))
            lines.append(f"{name}: command {at} was {float(old[at])!r}, is {float(values[at])!r}")
    lines += [f"{name}: a column without a series" for name in columns]
    return lines


def face_differences(found: dict[str, Any], stored: dict[str, Any]) -> list[str]:
    """Return a line for each face of a group that is not as written."""
    lines = [f"{name}: is not in {FACES.name}" for name in found if name not in stored]
    lines += [f"{name}: stands in {FACES.name} only" for name in stored if name not in found]
    for name, value in found.items():
        if name in stored and stored[name] != value:
            lines.append(f"{name}: was {stored[name]!r}, is {value!r}")
    return lines


# --- the command --------------------------------------------------------------------------------


def write(found: dict[str, Any], faces: dict[str, Any]) -> None:
    """Write the files, with those groups renewed; groups that are gone leave."""
    figures = sibling("golden_figures")
    rows, series = read_rows(), read_series()
    table: list[dict[str, str]] = []
    columns: dict[str, np.ndarray] = {}
    for group in figures.GROUPS:
        if group in found:
            for name, figure in found[group].rows.items():
                table.append(
                    {
                        "name": name,
                        "value": text_of(figure.value),
                        "tolerance": repr(figure.tolerance),
                        "elsewhere": repr(figure.elsewhere),
                        "kind": figure.kind,
                        "note": figure.note,
                    }
                )
            columns.update(found[group].series)
        else:
            table += [row for name, row in rows.items() if group_of(name) == group]
            columns.update({n: v for n, v in series.items() if group_of(n) == group})
    with FIGURES.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(table)
    with COMMANDS.open("w", encoding="utf-8", newline="") as file:
        lines = csv.writer(file, lineterminator="\n")
        lines.writerow(columns)
        lines.writerows(
            [[repr(float(v)) for v in row] for row in zip(*columns.values(), strict=True)]
        )
    MACHINE.write_text(f"{kernels()}\n", encoding="utf-8")
    kept = {**read_faces(), **faces}
    known = sibling("golden_faces").GROUPS
    kept = {name: value for name, value in kept.items() if name in known}
    FACES.write_text(
        json.dumps(kept, indent=1, sort_keys=True, ensure_ascii=False) + "\n", encoding="utf-8"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare, or renew; return the exit status."""
    figures, faces = sibling("golden_figures"), sibling("golden_faces")
    every = [*figures.GROUPS, *faces.GROUPS]
    parser = argparse.ArgumentParser(
        description="Compare the golden figures with what the toolkit computes, or renew them.",
        epilog=f"groups: {', '.join(every)}",
    )
    parser.add_argument("groups", nargs="*", metavar="GROUP", help="which (default: all)")
    parser.add_argument("--write", action="store_true", help="renew what differs, and say so")
    given = parser.parse_args(arguments)
    wrong = sorted(set(given.groups) - set(every))
    if wrong:
        parser.error(f"no group {', '.join(wrong)}; there are {', '.join(every)}")
    if given.write and given.groups and not at_home():
        parser.error("these are other BLAS kernels than the golden ones: renew all groups at once")
    rows, series, stored = read_rows(), read_series(), read_faces()
    computed: dict[str, Any] = {}
    shown: dict[str, Any] = {}
    differences: list[str] = []
    for name in given.groups or every:
        began = time.process_time()
        if name in figures.GROUPS:
            computed[name] = figures.GROUPS[name].figures()
            lines = figure_differences(computed[name], rows, series, name)
        else:
            shown[name] = faces.GROUPS[name].faces()
            lines = face_differences(shown[name], stored.get(name, {}))
        seconds = time.process_time() - began
        print(f"{name}: {len(lines)} of its rows differ ({seconds:.1f} s)", flush=True)
        for line in lines:
            print(f"  {line}")
        differences += lines
    if given.write and differences:
        write(computed, shown)
        print(f"{len(differences)} rows renewed")
        return 0
    return 1 if differences else 0


if __name__ == "__main__":
    sys.exit(main())
