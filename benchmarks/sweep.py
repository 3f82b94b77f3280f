"""How fast sweeps in the frequency domain are: `python benchmarks/sweep.py [--quick] [--figures]`.

One core throughout.  The spring is the thesis's fourth-order loop, the rope a crane's with fifteen
masses, delay, low-pass, noise of the sensors and drag that agrees with each response.  The spring's
cases go through a loop over python-control objects on the same nodes too, and the numbers have to
agree; and through this toolkit's own evaluation of one case at a time.  The medians go to
docs/data/sweep.csv and into docs/sweeps.md;
`--figures` draws that page's figures.

Exit code 1 if the numbers disagree.
"""

from __future__ import annotations

import os

# Before NumPy is loaded: one thread for all alike.
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["OMP_NUM_THREADS"] = "1"
os.environ["MKL_NUM_THREADS"] = "1"

import argparse
import platform
import statistics
import sys
import time
import tracemalloc
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import control as ct
import numpy as np
import numpy.typing as npt

from models import load_case
from models.basics import PhysicsWarning
from models.spread import LogNormal, Normal, Spread, Uniform
from synth import Design, evaluate_gains
from synth.question import pose
from synth.sweeps import FrequencyEngine

FloatArray = npt.NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "sweeps.md"
DATA = PAGE.parent / "data" / "sweep.csv"
IMAGES = PAGE.parent / "images"
BEGIN, END = "<!-- benchmark: begin -->", "<!-- benchmark: end -->"

THESIS = {"A": 200.0, "a": 50.0, "a1": 100.0, "a2": 100.0}
CRANE = {"A": 1.0, "a": 16.0, "a1": 44.0, "a2": 6.4}
COMBINED = {
    "payload.acceleration_gain": 0.98162,
    "payload.velocity_gain": 1.6166,
    "payload.position_gain": 2.8879,
    "drum.position_gain": 0.65588,
    "heave.gain": 0.93224,
    "rolloff.corner": 20.741,
    "rolloff.damping": 1.0217,
    "heave.lead": 0.028445,
    "heave.bandwidth": 7.3838,
}
SPRING = Spread(
    {
        "payload.mass": "20 %",
        "rope.axial_stiffness": Normal(sd="10 %"),
        "payload.drag.coefficient": LogNormal(sigma=0.3),
        "gains.a": "15 %",
        "gains.a1": "15 %",
        "gains.a2": "15 %",
    }
)
ROPE = Spread(
    {
        "payload.mass": "30 %",
        "rope.axial_stiffness": "20 %",
        "payload.drag_coefficient": "50 %",
        "sensors.telemetry.delay": Uniform("20 ms", "60 ms"),
    }
)
SIGMAS = ("payload_rms", "torque_rms", "speed_rms")
AGREE = 1e-7  # blocks lose digits when their polynomials are multiplied and reduced


@dataclass(frozen=True, kw_only=True)
class Row:
    """One measured line: what, how many cases, their seconds, what each costs."""

    what: str
    cases: int
    seconds: float
    runs: int

    @property
    def each(self) -> float:
        """Microseconds a case."""
        return 1e6 * self.seconds / self.cases


def measured(what: str, cases: int, runs: int, work: Callable[[], object]) -> Row:
    """Return the median of some runs' processor time: others may use the machine too."""
    times = []
    for _ in range(runs):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    row = Row(what=what, cases=cases, seconds=statistics.median(times), runs=runs)
    print(f"{row.what}: {row.cases} cases in {row.seconds:.3g} s, {row.each:.3g} us each")
    return row


def each_of(work: Callable[[FloatArray], object], rows: FloatArray) -> None:
    """Do the work row by row."""
    for row in rows:
        work(row)


class PythonControl:
    """The thesis's loop out of python-control objects, one case at a time."""

    def __init__(self, engine: FrequencyEngine) -> None:
        self.engine = engine
        nodes = engine.rows.level_nodes()
        self.omega, self.weight = nodes.omega, nodes.sea[0]

    def blocks(self, row: FloatArray) -> tuple[bool, float]:
        """Return stability and rms, the loop closed from blocks as one draws them."""
        drum, rope, law = self._parts(row)
        one = ct.tf([1.0], [1.0])
        # Tension k (h angle + heave - P) turns the motor back and lifts the payload.
        M, C, K = rope
        lift = ct.tf([K], [M, C, K])
        pull = ct.tf([K * M, K * C, 0.0], [M, C, K])
        h, load, phi, W = drum
        angle = ct.feedback(ct.tf([1.0], W), load * h * pull)
        controller = ct.tf(law, [1.0])
        loop = h * phi * angle * lift * controller
        before = lift * (one - h * load * angle * pull)
        closed = ct.minreal(before * ct.feedback(one, loop), 1e-7, verbose=False)
        return self._answer(closed)

    def written_out(self, row: FloatArray) -> tuple[bool, float]:
        """Return the same with the closed loop's two polynomials written out beforehand."""
        (h, load, phi, W), (M, C, K), law = self._parts(row)
        whole = np.polyadd(np.polymul(W, [M, C, K]), load * h * K * np.array([M, C, 0.0]))
        whole = np.polyadd(whole, h * phi * K * np.array(law))
        return self._answer(ct.tf(K * np.array(W), whole))

    def _answer(self, closed: Any) -> tuple[bool, float]:
        stable = bool(np.all(closed.poles().real < 0.0))
        response = np.abs(closed(1j * self.omega)) ** 2
        return stable, float(np.sqrt(response @ self.weight))

    def _parts(self, row: FloatArray) -> tuple[Any, Any, list[float]]:
        named = dict(zip(self.engine.spread.paths, row, strict=True))
        case = self.engine.case
        mass = named["payload.mass"] * 2.0 + case.rope.mass  # the added mass grows with it
        stiffness = named["rope.axial_stiffness"] / case.rope.length
        winch = case.winch
        motor: Any = winch.motor  # a DC motor
        phi = motor.torque_constant / motor.resistance
        friction = winch.viscous_friction + phi * motor.back_emf_constant
        h = case.drum_radius / winch.gearbox.ratio
        law = [200.0 * named[f"gains.{name}"] for name in ("a", "a1", "a2")]
        drag = named["payload.drag.coefficient"]
        return (h, h, phi, [winch.inertia, friction, 0.0]), (mass, drag, stiffness), law


def disagreement(engine: FrequencyEngine, peer: PythonControl, rows: FloatArray) -> float:
    """Return the largest relative difference of payload rms; infinite if stability differs."""
    found = engine.evaluate(rows)
    worst = 0.0
    for k, row in enumerate(rows):
        for stable, rms in (peer.blocks(row), peer.written_out(row)):
            if stable != bool(found["stable"][k]):
                return np.inf
            if stable:
                worst = max(worst, abs(rms / float(found["payload_rms"][k]) - 1.0))
    return worst


def peak_memory(design: Design, count: int) -> float:
    """Return the most memory of a sweep that keeps nothing but the chunk at hand [MB]."""
    engine = FrequencyEngine(design, SPRING, metrics=["payload_rms"])
    list(engine.chunks(samples=64))  # modules, caches
    tracemalloc.start()
    for _ in engine.chunks(samples=count):
        pass
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 1e6


def run(quick: bool) -> tuple[list[Row], dict[str, float]]:
    """Return the measured lines, and other figures by name."""
    many, some, runs = (20_000, 200, 1) if quick else (1_000_000, 4_000, 3)
    spring = evaluate_gains(load_case("thesis-1975"), THESIS)
    # The gains are those of a Kelvin-Voigt rope; on a hysteretic one they are unstable.
    case = load_case("subsea-crane").replace(
        {"rope.masses": 15, "rope.damping_law": "kelvin-voigt"}
    )
    three = evaluate_gains(case, CRANE)
    combined = evaluate_gains(case, COMBINED, "combined")
    rows = []

    def line(
        what: str, design: Design, spread: Spread, count: int, metrics: list[str]
    ) -> FrequencyEngine:
        engine = FrequencyEngine(design, spread, metrics=metrics)
        table = engine.spread.sample(count)
        engine.evaluate(table[:100])  # nodes and caches
        rows.append(measured(what, count, runs, lambda: engine.evaluate(table)))
        return engine

    rms = ["payload_rms"]
    sigmas = [*SIGMAS, "max_sensitivity"]
    every = [*sigmas, "torque_peak", "speed_peak", "tension_peak", "tension_least"]
    engine = line("spring: stability, payload rms", spring, SPRING, many, rms)
    line("... and torque and speed rms, M_s", spring, SPRING, many // 5, sigmas)
    line("rope of 15 masses, three gains: stability, payload rms", three, ROPE, some, rms)
    line("... and torque and speed rms, M_s, four extremes", three, ROPE, some, every)
    line("`combined` on it: stability, payload rms", combined, ROPE, some, rms)
    runs = 1
    line("... and all of these", combined, ROPE, some * 25, every)

    peer = PythonControl(engine)
    table = engine.spread.sample(100 if quick else 300, seed=1)
    worst = disagreement(engine, peer, table[:100])
    for what, work in (
        ("python-control, loop from blocks: stability, payload rms", peer.blocks),
        ("python-control, closed form written out: the same", peer.written_out),
    ):
        rows.append(measured(what, len(table), rows[0].runs, partial(each_of, work, table)))

    single = engine.spread.sample(4 if quick else 20, seed=2)

    def one_by_one() -> None:
        for row in single:
            gains = {**THESIS, **engine.spread.gains(row)}
            view = pose(engine.spread.case_at(row)).assess(gains)
            assert view.stable or view.poles.size
            view.sigma("payload.displacement")

    rows.append(measured("this toolkit, a case at a time: the same", len(single), 1, one_by_one))
    figures = {
        "nodes": len(engine.rows.level_nodes()),
        "disagreement": worst,
        "faster": rows[6].each / rows[0].each,
        "faster_written_out": rows[7].each / rows[0].each,
        "combined": rows[5].each / rows[3].each,
    }
    for count in (many // 5, many):
        figures[f"memory_{count}"] = peak_memory(spring, count)
        print(f"memory of {count} cases in chunks: {figures[f'memory_{count}']:.3g} MB")
    return rows, figures


def plain(value: float) -> str:
    """Return three digits without an exponent."""
    return f"{value:,.0f}" if value >= 1000.0 else f"{value:.3g}"


def write(rows: list[Row], figures: dict[str, float]) -> None:
    """Write the CSV file, and the table into the page."""
    sys.path.insert(0, str(ROOT / "docs" / "make"))
    from stored import write_rows

    columns = ("what", "cases", "runs", "median [s]", "per case [us]")
    told = ((r.what, r.cases, r.runs, f"{r.seconds:.4g}", f"{r.each:.4g}") for r in rows)
    write_rows(DATA, columns, (dict(zip(columns, one, strict=True)) for one in told))
    table = [
        "| what | cases | processor time [s] | per case [us] |",
        "| --- | ---: | ---: | ---: |",
    ]
    table += [f"| {r.what} | {r.cases:,} | {r.seconds:.3g} | {plain(r.each)} |" for r in rows]
    memory = [(k.removeprefix("memory_"), v) for k, v in figures.items() if k.startswith("memory")]
    told = " and ".join(f"{v:.0f} MB for {int(k):,} cases" for k, v in memory)
    text = [
        *table,
        "",
        f"In the same run and on the same {figures['nodes']:.0f} nodes the sweep was "
        f"{figures['faster']:.0f} times faster than a loop over python-control objects "
        f"({figures['faster_written_out']:.0f} times where the closed loop's polynomials are "
        f"written out by hand first), and agreed with them to {figures['disagreement']:.1g}; a "
        f"case of `combined` costs {figures['combined']:.2g} times one of three gains.  Kept in "
        f"chunks, it took {told} (NumPy's own count).",
        f"Python {platform.python_version()}, NumPy {np.__version__}, one core; processor time, "
        f"median of {rows[0].runs} runs.",
    ]
    page = PAGE.read_text(encoding="utf-8")
    before, _, rest = page.partition(BEGIN)
    _, _, after = rest.partition(END)
    PAGE.write_text("\n".join([before + BEGIN, "", *text, "", END + after]), encoding="utf-8")


def draw() -> None:
    """Draw the figures of docs/sweeps.md."""
    from stillhook.sweeps.figures import cumulative_share, nyquist_cloud, scatter_matrix, violins
    from stillhook.text import picture
    from synth.sweeps import frequency_sweep

    design = evaluate_gains(load_case("thesis-1975"), THESIS)
    wide = Spread({**SPRING.distributions, **{f"gains.{n}": "30 %" for n in ("a", "a1", "a2")}})
    result = frequency_sweep(design, wide, samples=20_000)
    names = ["payload.mass", "gains.a", "gains.a1", "gains.a2", "payload_rms", "max_sensitivity"]
    for name, figure in {
        "sweep-scatter": scatter_matrix(result, names),
        "sweep-nyquist": nyquist_cloud(result, design),
        "sweep-violins": violins(result, design),
        "sweep-share": cumulative_share(result, design=design),
    }.items():
        (IMAGES / f"{name}.png").write_bytes(picture(figure, "png"))


def main() -> int:
    """Measure, write, and say whether the numbers agree."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few cases, nothing is written")
    parser.add_argument("--figures", action="store_true", help="draw the page's figures only")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", PhysicsWarning)
    if arguments.figures:
        draw()
        return 0
    rows, figures = run(arguments.quick)
    print(", ".join(f"{name} {value:.3g}" for name, value in figures.items()))
    if not arguments.quick:
        write(rows, figures)
    return 0 if figures["disagreement"] < AGREE else 1


if __name__ == "__main__":
    sys.exit(main())
