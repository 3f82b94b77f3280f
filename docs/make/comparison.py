"""Predictive control against linear feedback on the 1975 winch, in the same seas.

    python docs/make/comparison.py [--out DIR] [--only PART,...] [--until HH:MM]

Torque of at most twice the rating, quadratic drag, and a reference unit whose error is white noise
of 1 or 5 % of the heave's rms sampled at 4 Hz.  Runs of 20 minutes.  It takes some hours on two
cores, in parts that are named in `PARTS`: one that was stopped goes on, and rows of other parts
stay as they are.  Writes `docs/data/comparison.csv`, a row for each run, and the tables of
`docs/compare.md`.
"""

from __future__ import annotations

import datetime
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from stored import docs_folder, read_rows, study_parser, write_rows

import stillhook as sh
from stillhook.comparison.cell import Cell

ROOT = Path(__file__).resolve().parents[2]
CSV = ROOT / "docs" / "data" / "comparison.csv"
PAGE = ROOT / "docs" / "compare.md"
HEIGHTS = (1.0, 1.25, 1.9, 2.43, 3.75)  # H_s [m]
CALM = (0.5, 1.0)  # H_s where next to nothing saturates [m]
INDUSTRY = ("constant-tension", "feed-forward", "feed-forward-full")
LINEAR = ("none", *INDUSTRY, "thesis", "feedback", "feedback-half", "combined", "combined-half")
EAGER = "combined-eager"
PREDICTIVE = ("mpc", "mpc-preview", "nonlinear-mpc")
FLOOR = "clairvoyant"
FILTER = "mpc-clipped"
ORDER = (*LINEAR, "feedback-eager", EAGER, FILTER, *PREDICTIVE, FLOOR)
CASES = ("thesis-1975", "thesis-1975-rope")
COLUMNS = (
    *("case", "noise", "mismatch", "contender", "height", "seed", "rms", "largest"),
    *("torque_rms", "lost", "broken"),
)
KEY = COLUMNS[:6]
MISMATCHES = (
    *("payload=-30%", "payload=+30%", "weight=-20%", "E=-30%", "E=+30%"),
    *("delay=+50ms", "period=+20%", "spectrum=jonswap"),
)
TWICE = 2.0  # what a mismatch may cost, over the nominal rms


@dataclass(frozen=True, kw_only=True)
class Part:
    """One call of `sh.compare`."""

    case: str
    contenders: tuple[str, ...]
    seeds: int
    heights: tuple[float, ...] = HEIGHTS
    noise: float = 0.01
    mismatch: str = ""
    duration: str = "20 min"


_ONE, _ROPE = CASES
PARTS: Mapping[str, Part] = {
    "one-mpc": Part(case=_ONE, contenders=("mpc",), seeds=10),
    "one-preview": Part(case=_ONE, contenders=("mpc-preview",), seeds=10),
    "rope-preview": Part(case=_ROPE, contenders=("mpc-preview",), seeds=6),
    **{
        f"{case}-{text}": Part(
            case=case, contenders=("mpc",), seeds=6, heights=(1.25, 2.43), mismatch=text
        )
        for case in CASES
        for text in MISMATCHES
    },
    "one-5": Part(case=_ONE, contenders=("mpc",), seeds=6, noise=0.05),
    "rope-5": Part(case=_ROPE, contenders=("mpc",), seeds=6, noise=0.05),
    "one-half": Part(
        case=_ONE, contenders=("feedback-half", "combined-half"), seeds=6, heights=HEIGHTS[:4]
    ),
    "rope-half": Part(case=_ROPE, contenders=("combined-half",), seeds=6, heights=HEIGHTS[:2]),
    "one-nonlinear": Part(
        case=_ONE, contenders=("nonlinear-mpc",), seeds=3, heights=(1.25, 1.9, 2.43)
    ),
    "one-floor": Part(case=_ONE, contenders=(FLOOR,), seeds=10),
    "rope-mpc-10": Part(case=_ROPE, contenders=("mpc",), seeds=10),
    "one-calm": Part(
        case=_ONE, contenders=("thesis", "feedback-eager", EAGER, "mpc"), seeds=6, heights=CALM
    ),
    "rope-calm": Part(case=_ROPE, contenders=(EAGER, "mpc"), seeds=3, heights=CALM[:1]),
    "one-industry": Part(case=_ONE, contenders=INDUSTRY, seeds=10, heights=(CALM[0], *HEIGHTS)),
    "rope-industry": Part(case=_ROPE, contenders=INDUSTRY, seeds=6, heights=(CALM[0], *HEIGHTS)),
    "one-filter": Part(case=_ONE, contenders=(FILTER,), seeds=6, heights=HEIGHTS[:4]),
    "one-linear": Part(case=_ONE, contenders=("none", "thesis", "feedback", "combined"), seeds=10),
    "rope-linear": Part(case=_ROPE, contenders=("none", EAGER), seeds=6),
    "rope-combined": Part(case=_ROPE, contenders=("combined",), seeds=6, heights=(0.5, *HEIGHTS)),
}


def case_of(name: str, noise: float) -> sh.Case:
    """Return a case with its noisy reference unit."""
    unit = {"noise_floor": 0.0, "noise_fraction": noise, "noise_bandwidth": 11.31}
    return sh.load_case(name).replace({"sensors.mru": unit})


def rows_of(part: Part, cells: Iterable[Cell]) -> list[dict[str, str]]:
    """Return rows of the data file from the cells of a comparison, as it keeps them."""
    found = []
    for cell in cells:
        numbers = cell.quantities
        row: dict[str, object] = {
            "case": part.case,
            "noise": part.noise,
            "mismatch": part.mismatch,
            "contender": cell.contender,
            "height": cell.height,
            "seed": cell.seed,
            "rms": numbers.get("payload rms", math.nan),
            "largest": numbers.get("tracking error largest", math.nan),
            "torque_rms": numbers.get("motor torque rms", math.nan),
            "lost": int(not math.isnan(numbers.get("lost lock at", math.nan))),
            "broken": max(cell.broken.values(), default=math.nan),
        }
        found.append({k: f"{v:.6g}" if isinstance(v, float) else str(v) for k, v in row.items()})
    return found


def write(rows: Iterable[Mapping[str, str]], path: Path = CSV) -> None:
    """Write the data file, with those of its rows that are not told anew."""
    kept: dict[tuple[str, ...], Mapping[str, str]] = {}
    for row in [*(load(path) if path.exists() else ()), *rows]:
        kept[tuple(row[k] for k in KEY)] = row

    def place(row: Mapping[str, str]) -> tuple[object, ...]:
        who = ORDER.index(row["contender"])
        first = (CASES.index(row["case"]), float(row["noise"]), row["mismatch"])
        return (*first, who, float(row["height"]), int(row["seed"]))

    write_rows(path, COLUMNS, sorted(kept.values(), key=place), "SI units; a row for each run.")


def load(path: Path = CSV) -> list[dict[str, str]]:
    """Return the rows of the data file."""
    return read_rows(path)


def some(
    rows: Iterable[Mapping[str, str]],
    case: str,
    contender: str,
    *,
    noise: float = 0.01,
    mismatch: str = "",
    height: float | None = None,
) -> dict[tuple[float, int], Mapping[str, str]]:
    """Return the rows of a contender by height and seed."""
    return {
        (float(row["height"]), int(row["seed"])): row
        for row in rows
        if (row["case"], row["contender"], row["mismatch"]) == (case, contender, mismatch)
        and math.isclose(float(row["noise"]), noise)
        and (height is None or math.isclose(float(row["height"]), height))
    }


def pooled(rows: Iterable[Mapping[str, str]]) -> float:
    """Return the root of the mean square over runs [mm]; NaN without one."""
    values = [float(row["rms"]) for row in rows]
    return 1e3 * math.sqrt(sum(v * v for v in values) / len(values)) if values else math.nan


def table(rows: Sequence[Mapping[str, str]]) -> str:
    """Return the table of who leaves what, in Markdown: pooled rms in millimetres."""
    heads = " | ".join(f"{h:g} m" for h in HEIGHTS)
    lines = [f"| case | controller | {heads} | seeds | lost |"]
    lines.append("| --- | --- |" + " --- |" * (len(HEIGHTS) + 2))
    for case in CASES:
        for noise, name in [*((0.01, name) for name in ORDER), (0.05, "mpc")]:
            own = {
                k: row for k, row in some(rows, case, name, noise=noise).items() if k[0] in HEIGHTS
            }
            if not own:
                continue
            cells = [
                _number(pooled(row for (h, _), row in own.items() if h == height))
                for height in HEIGHTS
            ]
            counts = {sum(1 for h, _ in own if h == height) for height in HEIGHTS} - {0}
            seeds = "-".join(str(count) for count in sorted({min(counts), max(counts)}))
            lost = sum(int(row["lost"]) for row in own.values())
            last = "" if name == FLOOR else f"{lost} of {len(own)}"
            who = f"`{name}`" + (", 5 % noise" if noise > 0.01 else "")
            lines.append(f"| {case} | {who} | " + " | ".join(cells) + f" | {seeds} | {last} |")
    return "\n".join(lines)


def floor_table(rows: Sequence[Mapping[str, str]]) -> str:
    """Return the table of mean squares over the floor's, in Markdown; same seeds."""
    lines = ["| controller | quantity | " + " | ".join(f"{h:g} m" for h in HEIGHTS) + " |"]
    lines.append("| --- | --- |" + " --- |" * len(HEIGHTS))
    floor = some(rows, _ONE, FLOOR)
    for name, noise, factor in (
        *(("mpc-preview", 0.01, 4.0), ("mpc", 0.01, 4.0), ("mpc", 0.05, 6.0)),
        ("nonlinear-mpc", 0.01, 4.0),
    ):
        own = some(rows, _ONE, name, noise=noise)
        both = sorted(set(own) & set(floor))
        if not both:
            continue
        ratios, worst = [], []
        for height in HEIGHTS:
            here = [key for key in both if key[0] == height]
            if not here:
                ratios.append("-")
                worst.append("-")
                continue
            ours, least = pooled(own[key] for key in here), pooled(floor[key] for key in here)
            # A floor of micrometres makes ratios that say nothing.
            ratios.append(_number((ours / least) ** 2) if least >= 1.0 else "-")
            within = sum(
                float(own[key]["rms"]) <= factor * float(floor[key]["rms"]) + 0.02 for key in here
            )
            worst.append(f"{within} of {len(here)}")
        who = f"`{name}`" + (f", {100 * noise:g} % noise" if name == "mpc" else "")
        lines.append(f"| {who} | mean square over the floor's | " + " | ".join(ratios) + " |")
        lines.append(f"| | seeds within {factor:g} x floor + 20 mm | " + " | ".join(worst) + " |")
    return "\n".join(lines)


def mismatch_table(rows: Sequence[Mapping[str, str]]) -> str:
    """Return the table of plants that are not as they are believed to be, in Markdown."""
    heights = (1.25, 2.43)
    lines = ["| plant | " + " | ".join(f"{c}, {h:g} m" for c in CASES for h in heights) + " |"]
    lines.append("| --- |" + " --- |" * (len(CASES) * len(heights)))
    for text in ("", *MISMATCHES):
        cells = []
        for case in CASES:
            for height in heights:
                own = some(rows, case, "mpc", mismatch=text, height=height)
                as_told = some(rows, case, "mpc", height=height)
                if not own:
                    cells.append("-")
                    continue
                value = pooled(own.values())
                nominal = pooled(row for key, row in as_told.items() if key in own)
                lost = sum(int(row["lost"]) for row in own.values())
                cell = _number(value) + ("" if text == "" else f" ({value / nominal:.2g} x)")
                cells.append(cell + (f", {lost} of {len(own)} lost" if lost else ""))
        lines.append(f"| {f'`{text}`' if text else 'as told'} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def calm_table(rows: Sequence[Mapping[str, str]]) -> str:
    """Return the table of calm seas: the best linear law of each height against MPC."""
    lines = ["| case | $H_s$ | best linear law | leaves | `mpc` leaves |", "| --- |" + " --- |" * 4]
    linear = [name for name in ORDER if name not in (FILTER, *PREDICTIVE, FLOOR)]
    for case in CASES:
        for height in CALM:
            found = {
                name: pooled(some(rows, case, name, height=height).values()) for name in linear
            }
            there = [name for name, value in found.items() if not math.isnan(value)]
            if not there:
                continue
            name = min(there, key=found.__getitem__)
            mpc = pooled(some(rows, case, "mpc", height=height).values())
            cells = f"`{name}` | {_number(found[name])} | {_number(mpc)}"
            lines.append(f"| {case} | {height:g} m | {cells} |")
    return "\n".join(lines)


def _number(value: float) -> str:
    """Return three digits without powers of ten."""
    if math.isnan(value):
        return "-"
    if value >= 1000.0:
        return f"{value:.0f}" if value < 1e5 else f"{value:.2g}"
    return f"{value:.3g}"


TABLES = {"study": table, "floor": floor_table, "mismatch": mismatch_table, "calm": calm_table}


def main(argv: Sequence[str] | None = None) -> None:
    """Run the study, write its data and print the tables."""
    parser = study_parser(__doc__)
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "comparison")
    parser.add_argument("--only", default=",".join(PARTS))
    parser.add_argument("--until", help="time of day after which no other part is begun")
    parser.add_argument("--jobs", type=int)
    given = parser.parse_args(argv)
    path = docs_folder(given.quick) / "data" / CSV.name
    if given.quick:
        part = PARTS["one-mpc"]
        found = sh.compare(
            case_of(part.case, part.noise), part.contenders, seeds=1, duration=60.0,
            heights=part.heights[:1], traces=False, starts=1, jobs=1,
        )  # fmt: skip
        write(rows_of(part, found.cells), path)
        return
    for name in given.only.split(",") if given.only else ():
        if given.until and datetime.datetime.now().strftime("%H:%M") >= given.until:
            break
        part = PARTS[name]
        found = sh.compare(
            case_of(part.case, part.noise),
            part.contenders,
            seeds=part.seeds,
            duration=part.duration,
            heights=part.heights,
            mismatch=part.mismatch or None,
            out=given.out / name,
            traces=False,
            starts=4,
            jobs=given.jobs,
        )
        print(name, datetime.datetime.now().strftime("%H:%M"), flush=True)
        write(rows_of(part, found.cells), path)
    page = PAGE.read_text(encoding="utf-8")
    for name, make in TABLES.items():
        begin, end = f"<!-- {name}: begin -->\n", f"\n<!-- {name}: end -->"
        before, _, rest = page.partition(begin)
        page = before + begin + make(load()) + end + rest.partition(end)[2]
    PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
