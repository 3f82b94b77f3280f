"""What the benchmark of predictive control found: tables, files, a figure and a verdict.

`mpc_speed.py` measures; this file holds the results and words them, for the terminal and for the
documentation.
"""

from __future__ import annotations

import dataclasses
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from synthesis import machine
from tables import markdown, plain

__all__ = ["Minutes", "Results", "Timing", "missed", "report", "solver_figure", "write_files"]

BEGIN, END = "<!-- mpc: begin -->", "<!-- mpc: end -->"
OURS = "LinearMPC"
WANTED_STEP = (60.0, 250.0)  # median and p99 of a step at 6 s, with blocking [us]
WANTED_NONLINEAR = (600.0, 1200.0)
WANTED_DO_MPC = 100.0  # times faster
WANTED_NONLINEAR_DO_MPC = 40.0
WANTED_MINUTES = 10.0  # for twenty of them [s]
PLAIN = ", no blocking"


@dataclass(frozen=True, kw_only=True)
class Timing:
    """How long somebody took, in microseconds of the processor; NaN if there is no answer.

    Attributes
    ----------
    name, statement, version
        Who, on which statement of the programme.
    sea, horizon, moves
        What was asked.
    median, p99, largest
        Over the questions, each the median of its repetitions.
    wall
        Median of the wall time [us].
    error, usual_error
        Of the first move, over the peak torque: largest and median.
    failed
        How many answers are none, or off by more than a hundredth.
    questions, repetitions
        How many.
    trouble
        What went wrong, if anything did.
    """

    name: str
    sea: str
    horizon: float
    moves: int
    statement: str = ""
    version: str = ""
    median: float = math.nan
    p99: float = math.nan
    largest: float = math.nan
    wall: float = math.nan
    error: float = math.nan
    usual_error: float = math.nan
    failed: int = 0
    questions: int = 0
    repetitions: int = 0
    trouble: str = ""


@dataclass(frozen=True, kw_only=True)
class Minutes:
    """How long simulated minutes took [s]."""

    sea: str
    minutes: float
    setup: float
    processor: float
    wall: float


@dataclass(frozen=True, kw_only=True)
class Results:
    """Everything that was measured; `limited` is the share of questions in which a limit is met."""

    solvers: tuple[Timing, ...]
    steps: tuple[Timing, ...]
    nonlinear: tuple[Timing, ...]
    minutes: tuple[Minutes, ...]
    limited: Mapping[str, float]
    load: tuple[float, float]
    absent: tuple[str, ...] = ()

    def step(self, name: str, sea: str, horizon: float) -> Timing | None:
        """Return whose step, in which sea, over which horizon; None if there is none."""
        return _find(self.steps, name, sea, horizon)


def _find(found: Sequence[Timing], name: str, sea: str, horizon: float) -> Timing | None:
    for one in found:
        if one.name == name and one.sea == sea and one.horizon == horizon:
            return one if one.median == one.median else None
    return None


def solver_table(solvers: Sequence[Timing], sea: str, moves: int) -> list[list[str]]:
    """Return the solvers on one recording, the fastest first, the head before them."""
    head = ["solver", "statement", "median [us]", "p99 [us]", "largest [us]", "over the first"]
    head += ["largest error", "failed"]
    chosen = [one for one in solvers if one.sea == sea and one.moves == moves]
    chosen.sort(key=lambda one: (math.isnan(one.median), one.median))
    body = []
    for one in chosen:
        times = [_micro(value) for value in (one.median, one.p99, one.largest)]
        ratio = _micro(one.median / chosen[0].median) if one.median == one.median else ""
        failed = f"{one.failed} of {one.questions}" if one.questions else one.trouble
        body.append([one.name, one.statement, *times, ratio, _small(one.error), failed])
    return [head, *body]


def step_table(results: Results) -> list[list[str]]:
    """Return whole steps by sea and horizon."""
    peers = ("CVXPY, Clarabel", "CasADi, IPOPT", "do-mpc")
    head = ["sea", "horizon [s]", "moves", "ours: median", "p99", "largest"]
    head += ["CVXPY", "IPOPT", "do-mpc", "do-mpc over ours"]
    body = []
    for ours in (one for one in results.steps if one.name == OURS):
        of = [results.step(name, ours.sea, ours.horizon) for name in peers]
        cells = [ours.sea, f"{ours.horizon:g}", str(ours.moves)]
        cells += [_micro(value) for value in (ours.median, ours.p99, ours.largest)]
        cells += [_median(one) for one in of] + [_over(of[-1], ours)]
        body.append(cells)
    return [head, *body]


def plain_table(results: Results) -> list[list[str]]:
    """Return whole steps with a move for every sample, as acados has them."""
    peers = ("acados, SQP_RTI", "acados, solution alone", "do-mpc" + PLAIN)
    head = ["sea", "horizon [s]", "moves", "ours: median", "p99", "largest"]
    head += ["acados: solution alone", "p99", "with handing over", "do-mpc"]
    head += ["acados alone over ours", "do-mpc over ours"]
    body = []
    for ours in (one for one in results.steps if one.name == OURS + PLAIN):
        whole, alone, other = (results.step(name, ours.sea, ours.horizon) for name in peers)
        cells = [ours.sea, f"{ours.horizon:g}", str(ours.moves)]
        cells += [_micro(value) for value in (ours.median, ours.p99, ours.largest)]
        cells += [_median(alone), "" if alone is None else _micro(alone.p99), _median(whole)]
        cells += [_median(other), _over(alone, ours), _over(other, ours)]
        body.append(cells)
    return [head, *body]


def _median(one: Timing | None) -> str:
    return "" if one is None else _micro(one.median)


def _over(one: Timing | None, ours: Timing) -> str:
    return "" if one is None else _micro(one.median / ours.median)


def nonlinear_table(found: Sequence[Timing]) -> list[list[str]]:
    """Return whole nonlinear steps by sea."""
    head = ["sea", "controller", "moves", "median [us]", "p99 [us]", "largest [us]", "over ours"]
    head += ["usual error", "largest error"]
    body = []
    for one in found:
        ours = _find(found, "NonlinearMPC" + _tail(one), one.sea, one.horizon)
        times = [_micro(value) for value in (one.median, one.p99, one.largest)]
        errors = [_small(one.usual_error), _small(one.error)]
        ratio = "" if ours is None else _over(one, ours)
        body.append([one.sea, one.name.removesuffix(PLAIN), str(one.moves), *times, ratio, *errors])
    return [head, *body]


def _tail(one: Timing) -> str:
    return PLAIN if one.name.endswith(PLAIN) else ""


def minutes_table(found: Sequence[Minutes]) -> list[list[str]]:
    """Return how long simulations took."""
    head = ["sea", "simulated [min]", "set-up [s]", "processor [s]", "wall [s]"]
    body = [
        [m.sea, f"{m.minutes:g}", f"{m.setup:.2f}", f"{m.processor:.2f}", f"{m.wall:.2f}"]
        for m in found
    ]
    return [head, *body]


def report(results: Results, *, plain_text: bool = False) -> str:
    """Return everything that was measured."""
    draw: Callable[[Sequence[Sequence[str]]], str] = plain if plain_text else markdown
    versions = {one.name.split(",")[0]: one.version for one in (*results.solvers, *results.steps)}
    said = ", ".join(
        f"{name} {version}"
        for name, version in sorted(versions.items(), key=lambda item: item[0].lower())
        if version and not name.startswith(OURS) and " by " not in name
    )
    low, high = results.load
    shares = ", ".join(f"{sea} {100 * share:.0f} %" for sea, share in results.limited.items())
    parts = [
        f"Measured on {machine()}; load average {low:.1f} to {high:.1f}. Processor times. {said}."
        + (f" Not installed: {', '.join(results.absent)}." if results.absent else ""),
        f"Questions in whose answer a limit is met: {shares}.",
    ]
    asked = sorted({(one.sea, one.moves) for one in results.solvers}, key=lambda a: (a[1], a[0]))
    for sea, moves in asked:
        parts.append(f"Programmes of the {sea} sea, 6 s, {moves} moves:")
        parts.append(draw(solver_table(results.solvers, sea, moves)))
    parts += ["Whole steps, medians where nothing is said [us]:", draw(step_table(results))]
    parts += ["With a move for every sample:", draw(plain_table(results))]
    parts += ["Nonlinear steps, 6 s:", draw(nonlinear_table(results.nonlinear))]
    parts += ["Simulations with a controller of 6 s:", draw(minutes_table(results.minutes))]
    return "\n\n".join(parts)


def rows_of(found: Sequence[Timing]) -> list[dict[str, object]]:
    """Return timings as rows of text by column."""
    names = [field.name for field in dataclasses.fields(Timing)]
    told = ({name: getattr(one, name) for name in names} for one in found)
    return [{k: f"{v:.5g}" if isinstance(v, float) else v for k, v in row.items()} for row in told]


def solver_figure(solvers: Sequence[Timing], sea: str, moves: int) -> str:
    """Return a figure of the solvers on one recording, as SVG."""
    from stillhook.text import AFTER, BEFORE, REFERENCE, new_figure, picture, styled

    chosen = [one for one in solvers if one.sea == sea and one.moves == moves]
    chosen = sorted((one for one in chosen if one.median == one.median), key=lambda a: -a.median)
    with styled():
        figure = new_figure(7.2, 0.6 + 0.3 * len(chosen))
        axes = figure.add_subplot()
        for at, one in enumerate(chosen):
            colour = AFTER if one.failed == 0 else BEFORE
            axes.plot([one.median, one.p99], [at, at], color=colour, linewidth=2.5, alpha=0.5)
            axes.plot(one.median, at, "o", color=colour)
            axes.plot(one.p99, at, "o", color=colour, markerfacecolor="white")
        axes.set_xscale("log")
        axes.set_yticks(
            range(len(chosen)),
            [f"{one.name} ({one.statement})" for one in chosen],
        )
        axes.grid(visible=False, axis="y")
        axes.set_xlabel("processor time [us]: median, 99 % open")
        title = f"One programme of {moves} moves in the {sea} sea, where limits are met"
        figure.suptitle(title, x=0.012, ha="left", fontsize=11.0, fontweight="bold")
        axes.set_title(
            "orange: some answers off by more than a hundredth of the torque",
            loc="right",
            fontsize=9.5,
            color=REFERENCE,
        )
        return picture(figure, "svg").decode("utf-8")


def write_files(docs: Path, results: Results) -> None:
    """Renew the page, its data and its figure in the folder of the documentation."""
    page = docs / "performance.md"
    text = page.read_text(encoding="utf-8")
    page.write_text(between(text, report(results)), encoding="utf-8")
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "docs" / "make"))
    from stored import write_rows

    names = [field.name for field in dataclasses.fields(Timing)]
    steps = (*results.steps, *results.nonlinear)
    for name, found in (("mpc_solvers.csv", results.solvers), ("mpc_steps.csv", steps)):
        write_rows(docs / "data" / name, names, rows_of(found))
    fewest = min((one.moves for one in results.solvers if one.sea == "rough"), default=0)
    drawn = solver_figure(results.solvers, "rough", fewest)
    (docs / "images" / "mpc-speed.svg").write_text(drawn, encoding="utf-8")


def between(page: str, text: str) -> str:
    """Return a page with another text between its two marks.

    Raises
    ------
    ValueError
        If the page does not hold the marks.
    """
    if page.count(BEGIN) != 1 or page.count(END) != 1:
        raise ValueError(f"the page must hold {BEGIN} and {END} once each")
    before, rest = page.split(BEGIN)
    _, after = rest.split(END)
    return f"{before}{BEGIN}\n\n{text}\n\n{END}{after}"


def missed(results: Results) -> tuple[str, ...]:
    """Return what is not as wanted, in words."""
    words = []
    for one in results.steps:
        if one.name == OURS and one.horizon == 6.0:
            words += _slow(f"a step in the {one.sea} sea", one, WANTED_STEP)
        if one.name.startswith(OURS):
            for name, wanted in (
                ("do-mpc" + _tail(one), WANTED_DO_MPC),
                ("acados, solution alone" if _tail(one) else "", 1.0),
            ):
                peer = results.step(name, one.sea, one.horizon)
                words += _behind(f"{name}, {one.sea}, {one.horizon:g} s", one, peer, wanted)
    for one in results.nonlinear:
        if one.name == "NonlinearMPC":
            words += _slow(f"a nonlinear step in the {one.sea} sea", one, WANTED_NONLINEAR)
            peer = _find(results.nonlinear, "do-mpc", one.sea, one.horizon)
            words += _behind(f"do-mpc, nonlinear, {one.sea}", one, peer, WANTED_NONLINEAR_DO_MPC)
    for run in results.minutes:
        if run.processor > WANTED_MINUTES * run.minutes / 20.0:
            words.append(f"{run.minutes:g} min of the {run.sea} sea took {run.processor:.1f} s")
    return tuple(words)


def _slow(what: str, one: Timing, wanted: tuple[float, float]) -> list[str]:
    if one.median <= wanted[0] and one.p99 <= wanted[1]:
        return []
    times = f"{_micro(one.median)} us, p99 {_micro(one.p99)} us"
    return [f"{what}: {times}, wanted {wanted[0]:g} and {wanted[1]:g}"]


def _behind(what: str, ours: Timing, peer: Timing | None, wanted: float) -> list[str]:
    if peer is None or peer.median >= wanted * ours.median:
        return []
    return [f"{what}: {peer.median / ours.median:.3g} times as long, wanted {wanted:g}"]


def _micro(value: float) -> str:
    """Return a number to three digits, thousands apart; nothing for NaN."""
    if math.isnan(value):
        return ""
    if value <= 0.0:
        return "0"
    rounded = round(value, 2 - math.floor(math.log10(value)))
    digits = max(0, 2 - math.floor(math.log10(rounded)))
    return f"{rounded:,.{digits}f}".replace(",", " ")


def _small(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.0e}"
