"""Figures in the sentences of `docs/structures.md`: `docs/make/said_structures.py [--quick]`.

After `structures.py` and `robust.py`, from whose stored rows some of them come.  Others are designs
of their own: structures that the table leaves out, a reference unit that errs within the band of
the waves, and what the unit, the sensors and the bound are to the designs of the crane.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import math
import warnings
from collections.abc import Mapping, Sequence
from functools import cache

from said import Effort, Saying, sayings_parser, tell
from stored import DOCS, read_rows
from structures import DELAYS, LENGTHS, OUTPUT, Row, answered, case_of, guesses, read

import stillhook as sh
from models import PhysicsWarning
from synth.question import PAYLOAD

PAGE, FILE = "structures.md", "said_structures.csv"
CRANE = {
    "payload-feedback": "feedback",
    "payload-feedback-rolloff": "rolloff",
    "feed-forward": "forward",
    "constant-tension": "tension",
    "combined": "combined",
}
BESIDE = {
    "payload-feedback-lead": "lead",
    "payload-feedback-notch": "notch",
    "payload-feedback-integral": "integral",
    "low-order-4": "free",
}
WAVES_UNIT = {"noise_floor": 0.05, "noise_fraction": 0.05, "noise_bandwidth": 1.0}
_EXACT = dict.fromkeys(
    ("noise_floor", "noise_fraction", "noise", "gain_error", "phase_error", "drift"), 0.0
)
#: How the error of the crane's reference unit may be read; as its case states it first.
READINGS: Mapping[str, Mapping[str, object]] = {
    "stated": {},
    "perfect": _EXACT,
    "gain": {**_EXACT, "gain_error": 0.05},
    "noise": {**_EXACT, **WAVES_UNIT},
}


def table_rows() -> Mapping[tuple[str, str, str, float], Row]:
    """Return the rows of the table."""
    return read(OUTPUT)


def deep(structure: str, delay: float, link: str = "given") -> Row:
    """Return the table's row at 2000 m."""
    return table_rows()["2000", structure, link, round(delay, 6)]


def held(effort: Effort) -> dict[str, float]:
    """Return what is left with the drum held at 2000 m, and by structures beside the table [mm]."""
    rows = table_rows()
    found = {"held": 1e3 * deep("feed-forward", 0.0, "any").drum_held}
    for structure, name in BESIDE.items():
        asked = Row(rope="2000", structure=structure, delay=0.05, link="given")
        row = answered(asked, guesses(asked, rows), effort.starts)
        found[name] = 1e3 * row.payload_rms if row.ok else math.nan
    return found


def combination(effort: Effort) -> dict[str, float]:
    """Return what feed-forward and the combination leave at 2000 m [mm], and its torque."""
    del effort
    row = deep("combined", 0.05)
    return {
        "forward": 1e3 * deep("feed-forward", 0.0, "any").payload_rms,
        "combined": 1e3 * row.payload_rms,
        "sea": 1e3 * row.from_sea,
        "acoustic": 1e3 * deep("combined", 2000.0 / 1500.0, "acoustic").payload_rms,
        "torque": row.torque_peak_use,
    }


def waves_unit(effort: Effort) -> dict[str, float]:
    """Return what is left at 2000 m with a unit that errs within the band of the waves [mm]."""
    found = {}
    for name, structure, delay in (
        ("late", "combined", 0.05),
        ("prompt", "combined", 0.0),
        ("forward", "feed-forward", 0.0),
    ):
        row = Row(rope="2000", structure=structure, delay=delay, link="given")
        case = case_of(row).replace({"sensors.mru": WAVES_UNIT})
        near = deep(structure, delay, "any" if structure == "feed-forward" else "given").parameters
        design = sh.optimise_gains(case, structure, starts=effort.starts, guesses=[dict(near)])
        found[name] = 1e3 * design.payload_rms
    return found


def drum_loop(effort: Effort) -> dict[str, float]:
    """Return what the drum loop under the payload feedback is worth: over it rolled off."""
    del effort
    rows = table_rows()

    def worth(ropes: Sequence[float]) -> list[float]:
        return [
            rows[f"{rope:g}", "payload-feedback-rolloff", "given", delay].payload_rms
            / rows[f"{rope:g}", "drum-feedback", "given", delay].payload_rms
            for rope in ropes
            for delay in DELAYS
        ]

    far, near = worth(LENGTHS[:1]), worth(LENGTHS[2:])
    return {"far": min(far), "farther": max(far), "near": min(near), "nearer": max(near)}


@cache
def crane_design(structure: str, starts: int, reading: str = "stated") -> sh.Design:
    """Return a structure's design for the crane, its unit's error read one way or another."""
    changes = {f"sensors.mru.{name}": value for name, value in READINGS[reading].items()}
    case = sh.load_case("subsea-crane").replace(changes)
    return sh.optimise_gains(case, structure, starts=starts)


def crane(effort: Effort) -> dict[str, float]:
    """Return what each structure leaves on the crane [mm], and the parts of the combination."""
    designs = {name: crane_design(structure, effort.starts) for structure, name in CRANE.items()}
    found = {name: 1e3 * design.payload_rms for name, design in designs.items()}
    best = designs["combined"]
    parts = {name: 1e3 * value for name, value in best.shares[PAYLOAD].items()}
    noise = [value for name, value in parts.items() if name.endswith("_noise")]
    found["held"] = 1e3 * best.payload_rms_before
    found["sea"], found["unit"] = parts["hook.heave"], parts["mru.error"]
    found["noise"] = math.hypot(*noise)
    return found


def reading(effort: Effort) -> dict[str, float]:
    """Return what feed-forward leaves by the reading of the unit's error, and simulated [mm]."""
    found = {}
    for name in READINGS:
        design = crane_design("feed-forward", effort.starts, name)
        found[name] = 1e3 * design.payload_rms
        runs = sh.simulate(
            design.case, "feed-forward", seeds=effort.seeds, duration=12.0 * effort.seconds
        )
        found[f"{name}_run"] = simulated(runs)
    found["unit"] = 1e3 * crane_design("feed-forward", effort.starts).shares[PAYLOAD]["mru.error"]
    return found


def simulated(runs: sh.Runs, after: float = 60.0) -> float:
    """Return the payload's rms over all runs once they are under way [mm]."""
    squares = []
    for run in runs:
        if not run.completed:
            return math.inf
        motion = run["payload.displacement"][run.time > after]
        squares.append(float((motion**2).mean()))
    return 1e3 * math.sqrt(sum(squares) / len(squares))


def bounds(effort: Effort) -> dict[str, float]:
    """Return each structure's payload rms [mm] and its bounds, from `structure_bounds.csv`."""
    del effort
    found = {}
    for row in read_rows(DOCS / "data" / "structure_bounds.csv"):
        name = row["structure"].replace("-", "_")
        found[name] = 1e3 * float(row["payload_rms"])
        found[f"{name}_own"] = 1e3 * float(row["bound_same_sensors"])
        found[f"{name}_over"] = float(row["payload_rms"]) / float(row["bound_same_sensors"])
        found[f"{name}_all"] = 1e3 * float(row["bound_all_sensors"])
    return found


def bounds_table() -> str:
    """Return the template of the table of bounds."""
    lines = [
        "| structure | payload rms | best with its sensors | over it | best with all |",
        "| --- | --- | --- | --- | --- |",
    ]
    for row in read_rows(DOCS / "data" / "structure_bounds.csv"):
        name = row["structure"].replace("-", "_")
        rms = f"{{{name}}} mm" if row["ok"] == "yes" else f"({{{name}}} mm)"
        lines.append(
            f"| `{row['structure']}` | {rms} | {{{name}_own}} mm | x {{{name}_over}} "
            f"| {{{name}_all}} mm |"
        )
    return "\n".join(lines)


def margins(effort: Effort) -> dict[str, float]:
    """Return what the best controllers with the sensors of `combined` are like."""
    best = sh.bound_for(crane_design("combined", effort.starts))
    found = best.found
    if isinstance(found, str):
        raise SystemExit(found)
    return {
        "lqg": best.free_sensitivity,
        "order": found.order,
        "rms": 1e3 * found.rms,
        "ms": best.max_sensitivity,
        "delay": 1e3 * found.margins.delay,
    }


def high_order(effort: Effort) -> dict[str, float]:
    """Return what the structure `high-order` leaves on paper and in a simulation [mm]."""
    case = sh.load_case("subsea-crane")
    found: dict[str, float] = {}
    for name, design in (
        ("high", sh.optimise_gains(case, "high-order")),
        ("combined", crane_design("combined", effort.starts)),
    ):
        runs = sh.simulate(case, design, seeds=effort.seeds, duration=4.0 * effort.seconds)
        found[f"{name}_run"] = simulated(runs)
        if name == "high":
            found["rms"] = 1e3 * design.payload_rms
            found["states"] = len(design.controller.A)
    return found


def sensors(effort: Effort) -> dict[str, float]:
    """Return by how much the payload sensors' noise changes the motion under three gains [%]."""
    found = {}
    for name in ("subsea-crane", "landing"):
        case = sh.load_case(name)
        design = sh.optimise_gains(case, "payload-feedback", starts=effort.starts)
        parts = design.shares[PAYLOAD]
        noise = sum(v**2 for k, v in parts.items() if k.endswith("_noise"))
        whole = sum(v**2 for v in parts.values())
        found[name.replace("-", "_")] = 100.0 * (1.0 - math.sqrt(1.0 - noise / whole))
    return found


SAYINGS = [
    Saying(
        page=PAGE,
        name="held",
        template="""
            the payload moves {held} mm at 2000 m. Not in the table, at 2000 m and 50 ms: lead or
            lag {lead}, notch {notch}, integral action {integral}, a free controller of order 4
            {free} mm.
        """,
        work=held,
    ),
    Saying(
        page=PAGE,
        name="combination",
        template="""
            leaves {forward} mm there, combined with payload feedback {combined} mm, of which
            {sea:.2f} mm come from the sea: it is the reference unit that limits. Even the 1.3 s of
            an acoustic link leave the combination at {acoustic} mm
        """,
        work=combination,
    ),
    Saying(
        page=PAGE,
        name="waves-unit",
        template="""
            the combination leaves {late} mm at 50 ms and {prompt} mm at no delay, feed-forward
            alone {forward} mm
        """,
        work=waves_unit,
    ),
    Saying(
        page=PAGE,
        name="drum-loop",
        template="""
            is worth a factor of {far:.1f} to {farther:.1f} at 2000 m, and of {near:.1f} to
            {nearer:.0f} at 300 and 100 m
        """,
        work=drum_loop,
    ),
    Saying(
        page=PAGE,
        name="torque",
        template="asks for {torque:.0f} times the peak torque at 2000 m",
        work=combination,
    ),
    Saying(
        page=PAGE,
        name="crane",
        template="""
            payload feedback {feedback} mm (more than its limits allow, whatever the drive), rolled
            off {rolloff} mm, feed-forward {forward} mm, constant tension {tension} mm, combined
            {combined} mm, of {held} mm with the drum held.
            ({sea} mm of the combination's come from the sea, {unit} mm from the reference unit,
            {noise} mm from the noise of the payload's sensors, which the others hardly notice.)
        """,
        work=crane,
    ),
    Saying(
        page=PAGE,
        name="reading",
        template="""
            {unit} of its {stated} mm are that error. Designed anew it leaves {perfect} mm with a
            perfect unit, {gain} mm with nothing but a gain error of 5 %, and {noise} mm where "5 cm
            or 5 %" is noise in the band of the waves, on the rope's resonance; in simulations of 2
            x 1 h the `feed-forward` controller (a share of 0.9) leaves {stated_run}, {perfect_run},
            {gain_run} and {noise_run} mm.
        """,
        work=reading,
    ),
    Saying(page=PAGE, name="bounds", template=bounds_table(), work=bounds),
    Saying(
        page=PAGE,
        name="margins",
        template="""
            has an $M_s$ of {lqg:.0f} with the sensors of `combined`. But $M_s$ is not what costs:
            with the same sensors a controller of {order:.0f} states leaves {rms} mm at $M_s$
            {ms:2}, on the exact line. It hears the encoder as finely as the terms of the bound
            allow and has {delay:.0f} ms of delay to spare;
        """,
        work=margins,
    ),
    Saying(
        page=PAGE,
        name="high-order",
        template="""
            it has {states:.0f} states, leaves {rms} mm within every limit and stands on the exact
            line, at twice the gain too. But its controller is unstable by itself, and a linear
            plant does not know that the loss of the gear switches with the direction: in a
            simulation that leaves {high_run} mm, and `combined` {combined_run} mm.
        """,
        work=high_order,
    ),
    Saying(
        page=PAGE,
        name="sensors",
        template="""
            by {subsea_crane:1} % on `subsea-crane` and by {landing:1} % on `landing`.
        """,
        work=sensors,
    ),
]


def main(argv: Sequence[str] | None = None) -> int:
    """Find them and put them into the page."""
    warnings.simplefilter("ignore", PhysicsWarning)
    return tell(SAYINGS, FILE, sayings_parser(__doc__).parse_args(argv))


if __name__ == "__main__":
    raise SystemExit(main())
