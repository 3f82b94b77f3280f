"""The page on whether ok holds, from the rows of `holds.py`: `python docs/make/holds_page.py`.

Judges each row and all of them together, and writes `docs/holds.md`, which lists every case.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import holds
from holds import ERRORS, NEAR, SIGNALS
from stored import docs_folder, read_rows, study_parser

PAGE = Path(__file__).resolve().parents[1] / "holds.md"
MARK = "<!-- rows of docs/data/holds.csv -->"

SATURATED = 0.1  # of the pooled time [%]
EXCEEDED = (0.55, 0.70)  # share of the runs in which the most probable extreme is exceeded
FARTHEST = 1.4  # largest dynamic part over the printed one

Row = Mapping[str, str]


@dataclass(frozen=True, kw_only=True)
class Extreme:
    """Dynamic parts of the extremes of one signal one way, over the printed one."""

    signal: str
    way: str
    ratios: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class Kind:
    """What all runs say of one kind of extreme."""

    name: str
    trials: int
    exceeded: int
    farthest: float

    @property
    def share(self) -> float:
        """Share of the runs in which it was exceeded."""
        return self.exceeded / self.trials if self.trials else math.nan

    @property
    def kept(self) -> bool:
        """Whether it is exceeded as often as is asked, and never by far."""
        low, high = EXCEEDED
        return low <= self.share <= high and self.farthest <= FARTHEST


def simulated(rows: Iterable[Row]) -> list[Row]:
    """Return the rows that were simulated."""
    return [row for row in rows if row["runs"]]


def deviations(row: Row) -> dict[str, tuple[float, float]]:
    """Return by signal by how much its deviation is off, and by how much it may be, relative."""
    found = {}
    for signal in SIGNALS:
        if row[f"{signal}.sigma"]:
            off = float(row[f"{signal}.found"]) / float(row[f"{signal}.sigma"]) - 1.0
            found[signal] = off, max(NEAR, ERRORS * float(row[f"{signal}.error"]))
    return found


def extremes(row: Row) -> Iterator[Extreme]:
    """Yield the extremes of a row, both ways."""
    for signal in (*SIGNALS, "power"):
        for way in ("up", "down"):
            if row.get(f"{signal}.{way}"):
                printed = float(row[f"{signal}.{way}"])
                ratios = tuple(float(one) / printed for one in row[f"{signal}.{way}s"].split())
                yield Extreme(signal=signal, way=way, ratios=ratios)


def growth(row: Row) -> float:
    """Return the larger growth of the two laws at the rope's least damping [1/s]."""
    return max(float(row["growth_hysteretic"]), float(row["growth_kelvin-voigt"]))


def grows(row: Row) -> bool:
    """Return whether it grows where it was asked not to: a rope by Kelvin and Voigt is an exhibit.

    Such a design is asked with the damping of its case alone; with the least it is told.
    """
    return row["law"] != "kelvin-voigt" and growth(row) >= 0.0


def faults(row: Row) -> list[str]:
    """Return what a simulated row breaks."""
    found = []
    for signal, (off, may) in deviations(row).items():
        if abs(off) > may:
            found.append(f"deviation of {signal} {100.0 * off:+.1f} % ({100.0 * may:.1f})")
    for one in extremes(row):
        if (most := max(one.ratios)) > FARTHEST:
            found.append(f"{one.signal} {one.way} {most:.2f} times the printed")
    if float(row["slack"]) > 0.0:
        found.append(f"slack for {float(row['slack']):.2g} % of the time")
    if int(row["trips"]):
        found.append(f"{row['trips']} runs ended early")
    if float(row["saturated"]) > SATURATED:
        found.append(f"saturated for {float(row['saturated']):.2g} % of the time")
    if grows(row):
        found.append(f"grows at {growth(row):.2g} 1/s at the least damping")
    return found


def pooled_saturation(rows: Iterable[Row]) -> float:
    """Return the share of all time simulated for which the drive was saturated [%]."""
    told = [
        (float(row["saturated"]), int(row["runs"]) + int(row["again"])) for row in simulated(rows)
    ]
    total = sum(runs for _, runs in told)
    return sum(share * runs for share, runs in told) / total if total else math.nan


def far_by_chance(rows: Iterable[Row]) -> float:
    """Return how many dynamic parts of Gaussian signals lie beyond `FARTHEST` times the printed.

    Of N cycles the largest exceeds f sqrt(2 ln N) sigma with the probability 1 - exp(-N^(1 - f^2));
    N is that of the sea's peak period.
    """
    total = 0.0
    for row in simulated(rows):
        cycles = holds.EXPOSURE / float(row["T_p"])
        trials = sum(len(one.ratios) for one in extremes(row) if one.signal != "power")
        total += trials * -math.expm1(-(cycles ** (1.0 - FARTHEST**2)))
    return total


def kinds(rows: Iterable[Row]) -> list[Kind]:
    """Return what all runs say of each kind of extreme; power is a bound and no kind.

    Of a reference unit with gain and phase errors the worst signs are printed, and a run may have
    any: such rows are not counted.
    """
    gathered: dict[str, list[float]] = {}
    for row in simulated(rows):
        for one in extremes(row) if row["coherent"] == "no" else ():
            name = one.signal if one.signal in _BOTH_WAYS else f"{one.signal} {one.way}"
            if one.signal != "power":
                gathered.setdefault(name, []).extend(one.ratios)
    return [
        Kind(
            name=name,
            trials=len(ratios),
            exceeded=sum(ratio > 1.0 for ratio in ratios),
            farthest=max(ratios),
        )
        for name, ratios in gathered.items()
    ]


_BOTH_WAYS = ("payload", "speed", "voltage")  # as likely up as down, and counted each way


def _line(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _table(head: Sequence[str], body: Iterable[Sequence[str]]) -> str:
    return "\n".join([_line(head), f"|{' --- |' * len(head)}", *map(_line, body)])


def summary(rows: Sequence[Row]) -> str:
    """Return what was asked and what was found, as Markdown."""
    done = simulated(rows)
    broken = [row for row in done if faults(row)]
    runs = sum(int(row["runs"]) + int(row["again"]) for row in done)
    off = sum(any(abs(o) > may for o, may in deviations(row).values()) for row in done)
    far = sum(any(max(one.ratios) > FARTHEST for one in extremes(row)) for row in done)
    chance = f"about {far_by_chance(done):.0f} by chance alone"
    body = [
        (
            "saturated, of the pooled time",
            f"below {SATURATED} %",
            f"{pooled_saturation(rows):.3g} %",
        ),
        (
            "designs with a standard deviation further off than "
            f"{100.0 * NEAR:.0f} % and {ERRORS:.0f} standard errors",
            "0",
            str(off),
        ),
        (
            f"designs with a dynamic part above {FARTHEST} times the printed",
            "0",
            f"{far}; {chance}",
        ),
        ("designs that go slack", "0", str(sum(float(row["slack"]) > 0.0 for row in done))),
        (
            "designs that grow at the rope's least damping, under either law",
            "0",
            f"{sum(map(grows, done))}; {sum(growth(row) >= 0.0 for row in done)} with exhibits",
        ),
        ("runs that ended early", "0", str(sum(int(row["trips"]) for row in done))),
    ]
    questions = len({row["question"] for row in rows})
    text = (
        f"{len(rows)} designs for {questions} of {holds.COUNT} cases, {len(done)} of them ok and "
        f"simulated, {runs} runs of 3 h; {len(broken)} break something."
    )
    return f"{text}\n\n{_table(('', 'asked', 'found'), body)}"


def kinds_table(rows: Sequence[Row]) -> str:
    """Return how often each kind of extreme is exceeded, as Markdown."""
    low, high = EXCEEDED
    head = ["extreme", "runs", f"exceeded ({100 * low:.0f} to {100 * high:.0f} %)", "farthest", ""]
    body = [
        [
            kind.name,
            str(kind.trials),
            f"{100.0 * kind.share:.1f} %",
            f"{kind.farthest:.2f}",
            "" if kind.kept else "missed",
        ]
        for kind in kinds(rows)
    ]
    return _table(head, body)


def case_table(rows: Sequence[Row]) -> str:
    """Return every design of every case, as Markdown."""
    head = ["", "case", "load", "sea", "structure", "printed", "simulated", "worst", "verdict"]
    body = []
    for row in rows:
        load = f"{float(row['mass']) / 1e3:.3g} t at " if row["mass"] else ""
        cells = [row["question"], row["case"], f"{load}{float(row['depth']):.0f} m"]
        cells += [f"{row['H_s']} m, {row['T_p']} s" if row["H_s"] else "", row["structure"]]
        if row["runs"]:
            offs = deviations(row)
            worst = max(offs, key=lambda signal: abs(offs[signal][0]) / offs[signal][1])
            cells += [f"{1e3 * float(row[f'payload.{one}']):.3g} mm" for one in ("sigma", "found")]
            cells += [f"{worst} {100.0 * offs[worst][0]:+.1f} %", "; ".join(faults(row)) or "holds"]
        else:
            why = row["status"].replace("|", "\\|")
            cells += ["", "", "", f"not ok: {why}" if row["ok"] == "no" else why]
        body.append(cells)
    return _table(head, body)


def tables(rows: Sequence[Row]) -> str:
    """Return all that the page tells from the rows."""
    parts = (summary(rows), kinds_table(rows), "## Every case", case_table(rows))
    return "\n\n".join(parts)


def write(page: Path, rows: Sequence[Row]) -> None:
    """Replace what follows the mark of the page by what the rows say."""
    before, mark, _ = PAGE.read_text(encoding="utf-8").partition(MARK)
    if not mark:
        raise ValueError(f"{PAGE} must hold {MARK}")
    page.write_text(f"{before}{MARK}\n\n{tables(rows)}\n", encoding="utf-8")


def main(argv: Sequence[str] | None = None) -> None:
    """Write the page."""
    docs = docs_folder(study_parser(__doc__).parse_args(argv).quick)
    write(docs / PAGE.name, read_rows(docs / "data" / holds.CSV.name))


if __name__ == "__main__":
    main()
