"""What the simulation's benchmark found, as tables and as a verdict.

`simulation.py` measures; this file holds the results and words them, for the terminal and for the
page of the documentation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np

__all__ = [
    "PART_NAMES",
    "REST",
    "Comparison",
    "Memory",
    "Speed",
    "missed",
    "report",
    "results_of",
    "rows_of",
    "write_into",
]

BEGIN, END = "<!-- simulation: begin -->", "<!-- simulation: end -->"
WANTED_RATIO = 100.0  # over solve_ivp that does the same work
WANTED_MEMORY = 200.0  # for a day [MB]
AGREED = 1e-3  # relative difference from solve_ivp beyond which the work was not the same
REST = "rest"
PART_NAMES = ("hook's record", "rows", "kernel", "controller", "statistics", REST)


@dataclass(frozen=True, kw_only=True)
class Speed:
    """One question, compiled or not; times in seconds of the processor.

    `whole` is the median time of whole runs, `parts` that of one more run by what it was spent
    on, the kernel among them.
    """

    name: str
    compiled: bool
    wanted: float
    duration: float
    steps: int
    samples: int
    whole: float
    parts: Mapping[str, float]
    payload_rms: float
    status: str

    @property
    def real_time(self) -> float:
        """How many times faster than real time a whole run is."""
        return self.duration / self.whole

    @property
    def kernel_steps(self) -> float:
        """Integration steps in a second, of the kernel alone."""
        return self.steps / self.parts["kernel"]

    @property
    def kernel_real_time(self) -> float:
        """How many times faster than real time the kernel alone is."""
        return self.duration / self.parts["kernel"]

    @property
    def kept(self) -> bool:
        """Whether it is as fast as wanted; nothing is asked of the virtual machine."""
        return self.status == "completed" and (not self.compiled or self.real_time >= self.wanted)


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """One way to use `solve_ivp` against ours; `difference` of the payload's motion, over its rms.

    `real_time` and `ours` are how many times faster than real time it and our whole run are.
    """

    name: str
    same_work: bool
    real_time: float
    evaluations: float  # for a simulated second
    ours: float
    kernel: float
    difference: float

    @property
    def ratio(self) -> float:
        """How many times faster our whole run is for a simulated second."""
        return self.ours / self.real_time

    @property
    def kept(self) -> bool:
        """Whether it is as much faster as wanted, and the same was computed."""
        if not self.same_work:
            return True
        return self.ratio >= WANTED_RATIO and self.difference <= AGREED


@dataclass(frozen=True, kw_only=True)
class Memory:
    """Largest memory [MB] of a process that simulated so many hours, and that after its imports."""

    hours: float
    imported: float
    peak: float

    @property
    def kept(self) -> bool:
        """Whether it is as little as wanted."""
        return self.peak <= WANTED_MEMORY


def speed_table(speeds: Sequence[Speed]) -> list[list[str]]:
    """Return how fast each question is answered, the head first."""
    head = ["question", "run by", "steps/s, kernel", "x real time, kernel", "steps/s, whole run"]
    head += ["x real time, whole run", "wanted", "payload rms [mm]"]
    body = []
    for speed in speeds:
        body.append(
            [
                speed.name,
                "C" if speed.compiled else "VM",
                _rounded(speed.kernel_steps),
                _rounded(speed.kernel_real_time),
                _rounded(speed.steps / speed.whole),
                _rounded(speed.real_time),
                _rounded(speed.wanted) if speed.compiled else "",
                f"{1e3 * speed.payload_rms:.3g}",
            ]
        )
    return [head, *body]


def parts_table(speeds: Sequence[Speed]) -> list[list[str]]:
    """Return where the time of compiled runs goes, in microseconds for a sample."""
    shown = [speed for speed in speeds if speed.compiled]
    names = [name for name in PART_NAMES if any(name in speed.parts for speed in shown)]
    head = ["question", *(f"{name} [us]" for name in names), "sum [us]"]
    body = []
    for speed in shown:
        each = [1e6 * speed.parts.get(name, 0.0) / speed.samples for name in names]
        body.append([speed.name, *(f"{value:.2f}" for value in (*each, sum(each)))])
    return [head, *body]


def peer_table(found: Sequence[Comparison]) -> list[list[str]]:
    """Return how `solve_ivp` compares, the head first."""
    head = ["solve_ivp, RK45, rtol 1e-6", "evaluations/s", "x real time", "ours over it"]
    head += ["our kernel over it", "largest difference"]
    body = []
    for one in found:
        body.append(
            [
                one.name,
                _rounded(one.evaluations),
                _rounded(one.real_time),
                _rounded(one.ratio),
                _rounded(one.kernel / one.real_time),
                f"{one.difference:.1e} of the rms" if one.same_work else "other controller",
            ]
        )
    return [head, *body]


def report(
    speeds: Sequence[Speed],
    found: Sequence[Comparison],
    memory: Memory,
    draw: Callable[[Sequence[Sequence[str]]], str],
) -> str:
    """Return everything that was measured."""
    # It brings solvers that are no part of a simulation, whose memory is measured.
    from synthesis import machine

    return (
        f"Measured on {machine()}; processor times.\n\n{draw(speed_table(speeds))}\n\n"
        f"Where the time of a compiled run goes, for one control sample:\n\n"
        f"{draw(parts_table(speeds))}\n\n"
        f"Against `solve_ivp` on one spring, for a simulated second:\n\n"
        f"{draw(peer_table(found))}\n\n"
        f"{memory.hours:g} hours took {memory.peak:.0f} MB at most, {memory.imported:.0f} MB of "
        f"which were there before the run (wanted: {WANTED_MEMORY:.0f} MB)."
    )


def rows_of(
    speeds: Sequence[Speed], found: Sequence[Comparison], memory: Memory
) -> list[dict[str, str]]:
    """Return everything that was measured as rows of text: its kind, its fields."""
    rows = []
    for one in (*speeds, *found, memory):
        cells: list[str] = []
        for key, value in asdict(one).items():
            inner = value if isinstance(value, dict) else {"": value}
            for name, number in inner.items():
                text = f"{number:.7g}" if isinstance(number, float) else str(number)
                cells.append(f"{key}{'.' * bool(name)}{name}={text}")
        rows.append({"kind": type(one).__name__, "fields": ";".join(cells)})
    return rows


def results_of(rows: Sequence[Mapping[str, str]]) -> tuple[list[Speed], list[Comparison], Memory]:
    """Return what rows say."""
    kinds: dict[str, type[Speed | Comparison | Memory]] = {
        kind.__name__: kind for kind in (Speed, Comparison, Memory)
    }
    read: dict[str, Callable[[str], object]] = {
        "str": str, "bool": "True".__eq__, "int": int, "float": float
    }  # fmt: skip
    found: list[Speed | Comparison | Memory] = []
    for row in rows:
        kind, cells = kinds[row["kind"]], dict(c.split("=") for c in row["fields"].split(";"))
        types = {field.name: str(field.type) for field in fields(kind)}
        values = {name: read[t](cells[name]) for name, t in types.items() if t in read}
        if "parts" in types:
            values["parts"] = {k[6:]: float(v) for k, v in cells.items() if k[:6] == "parts."}
        found.append(kind(**values))  # type: ignore[arg-type]
    (memory,) = (one for one in found if isinstance(one, Memory))
    return (
        [one for one in found if isinstance(one, Speed)],
        [one for one in found if isinstance(one, Comparison)],
        memory,
    )


def write_into(path: Path, text: str) -> None:
    """Replace what stands between the two marks in a page.

    Raises
    ------
    ValueError
        If the page does not hold the marks.
    """
    page = path.read_text(encoding="utf-8")
    if page.count(BEGIN) != 1 or page.count(END) != 1:
        raise ValueError(f"{path}: must hold {BEGIN} and {END} once each")
    before, rest = page.split(BEGIN)
    _, after = rest.split(END)
    path.write_text(f"{before}{BEGIN}\n\n{text}\n\n{END}{after}", encoding="utf-8")


def missed(speeds: Sequence[Speed], found: Sequence[Comparison], memory: Memory) -> tuple[str, ...]:
    """Return what is not as wanted, in words."""
    slow = [
        f"{s.name}: {s.status}, {_rounded(s.real_time)} x real time, wanted {_rounded(s.wanted)}"
        for s in speeds
        if not s.kept
    ]
    slow += [
        f"solve_ivp, {c.name}: {_rounded(c.ratio)} times, wanted {WANTED_RATIO:g}; differs by "
        f"{c.difference:.1e} of the rms"
        for c in found
        if not c.kept
    ]
    if not memory.kept:
        slow.append(f"{memory.peak:.0f} MB, wanted {WANTED_MEMORY:.0f} MB")
    return tuple(slow)


def _rounded(value: float) -> str:
    """Return a number to three digits, thousands apart."""
    digits = max(0, 2 - int(np.floor(np.log10(abs(value))))) if value else 0
    step = 10.0 ** max(0, int(np.floor(np.log10(abs(value)))) - 2) if value else 1.0
    return f"{step * round(value / step):,.{digits}f}".replace(",", " ")
