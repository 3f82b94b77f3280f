"""The headline of the project: one winch, one spring or a rope, four depths, three delays.

The 1975 thesis's winch is redesigned by `optimise_gains` for M_s <= 2, on the thesis's own model
of the rope (one spring) and on a rope with its axial modes.  Writes `docs/headline.md`, the
tables, and `docs/data/headline.csv`, every figure:

    python docs/make/headline.py

The notebook `notebooks/01-thesis-1975.ipynb` shows the tables and repeats some of the rows.
"""

from __future__ import annotations

import platform
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from stored import docs_folder, read_rows, study_parser, write_rows

import stillhook as sh
from synth.question import pose

ROOT = Path(__file__).resolve().parents[2]
CSV = ROOT / "docs" / "data" / "headline.csv"
PAGE = ROOT / "docs" / "headline.md"

LENGTHS = (2000.0, 1000.0, 300.0, 100.0)  # [m]
DELAYS = (0.0, 0.05, 0.1)  # [s]
MODELS = ("spring", "rope")
# Low-passes on the payload's signals, tried where the rope's second mode stands in the way [rad/s].
FILTERS = {2000.0: 12.0, 1000.0: 24.0}
MARGINS = ("max_sensitivity", "phase", "gain", "gain_down", "delay", "disk")
DRIVE = ("motor.torque.peak", "motor.torque.continuous", "motor.speed.peak")

Row = dict[str, str | float]


def key_of(kind: str, model: str, length: float, delay: float = 0.0, bandwidth: float = 0.0) -> Row:
    """Return what names a row.

    Parameters
    ----------
    kind
        `thesis`: the thesis's own gains; `redesign`; `transplant`: the gains found on one spring
        put on the rope; `filter`: a redesign with a low-pass.
    model
        `spring`: all rope mass at the payload, as in the thesis; `rope`: with axial modes.
    length, delay
        Rope paid out [m], telemetry delay [s].
    bandwidth
        Of a second-order Butterworth low-pass on the payload's signals [rad/s]; 0 for none.
    """
    return {"kind": kind, "model": model, "length": length, "delay": delay, "bandwidth": bandwidth}


def case_for(key: Row) -> sh.Case:
    """Return the case of a row.

    Everything but the rope's model, its length, the delay and the low-pass is the same in all
    rows: drag that agrees with the payload's own motion, the bare drum's radius, M_s <= 2, |P/Z|
    at most 0.1 up to 0.01 rad/s, and drive limits that are reported and not enforced.
    """
    changes: dict[str, object] = {
        "rope.length": key["length"],
        "sensors.telemetry.delay": key["delay"],
        "limits.drive": "report",
        "limits.max_sensitivity": 2.0,
        "limits.low_frequency.below": 0.01,
        "limits.low_frequency.ratio": 0.1,
    }
    if key["model"] == "spring":
        changes |= {"rope.masses": 1, "rope.lumping": "thesis"}
    if key["bandwidth"]:
        changes["sensors.payload.bandwidth"] = key["bandwidth"]
    return sh.load_case("thesis-1975-rope").replace(changes)


def row_of(key: Row, design: sh.Design) -> Row:
    """Return the figures of a design, in SI units."""
    return {
        **key,
        "ok": float(design.ok),
        "hook_rms": design.hook_rms,
        "payload_rms_before": design.payload_rms_before,
        "payload_rms": design.payload_rms,
        "growth_rate": 0.0,
        "masses": design.masses,
        **products(design.gains),
        **{f"margin.{name}": getattr(design.margins, name, np.nan) for name in MARGINS},
        **{
            f"{name}.use": design.limits[name].use if name in design.limits else np.nan
            for name in DRIVE
        },
    }


def given_row(key: Row, case: sh.Case, gains: Mapping[str, float]) -> Row:
    """Return the figures of given gains; of an unstable loop, how fast it grows.

    Growth is that of a swing as large as the payload's motion with the drum held: more drag
    than that changes it little, see the notebook.
    """
    question = pose(case)
    known = question.coefficients_of(question.drag_before, 0.0)
    view = question.assess(gains, known)
    growth = float(view.poles.real.max())
    if growth <= 0.0:
        return row_of(key, sh.evaluate_gains(case, gains))
    row: Row = {
        **key,
        "ok": 0.0,
        "hook_rms": float(question.hook.displacement.rms),
        "payload_rms_before": question.payload_rms_before,
        "payload_rms": np.inf,
        "growth_rate": growth,
        "masses": question.masses,
        **products(gains),
    }
    missing = [*(f"margin.{name}" for name in MARGINS), *(f"{name}.use" for name in DRIVE)]
    return row | dict.fromkeys(missing, np.nan)


def products(gains: Mapping[str, float]) -> dict[str, float]:
    """Return A a, A a1 and A a2, which alone act on the plant."""
    return {f"A {name}": gains["A"] * gains[name] for name in ("a", "a1", "a2")}


def redesign(key: Row) -> sh.Design:
    """Return the design of one row."""
    return sh.optimise_gains(case_for(key), "payload-feedback")


def study(
    tell: Callable[[str], None] = lambda text: None,
    lengths: Sequence[float] = LENGTHS,
    delays: Sequence[float] = DELAYS,
    filters: Mapping[float, float] = FILTERS,
) -> tuple[list[Row], list[float]]:
    """Return all rows, and the seconds that each redesign took."""
    rows: list[Row] = []
    seconds: list[float] = []

    def timed(key: Row) -> sh.Design:
        start = time.perf_counter()
        design = redesign(key)
        seconds.append(time.perf_counter() - start)
        rows.append(row_of(key, design))
        tell(
            f"{', '.join(str(v) for v in key.values())}: {1e3 * design.payload_rms:.1f} mm, "
            f"{design.status} ({seconds[-1]:.1f} s)"
        )
        return design

    for length in lengths:
        for model in MODELS:
            key = key_of("thesis", model, length)
            case = case_for(key)
            assert case.gains is not None
            rows.append(given_row(key, case, case.gains.model_dump()))
    for length in lengths:
        for delay in delays:
            spring = timed(key_of("redesign", "spring", length, delay))
            key = key_of("transplant", "rope", length, delay)
            rows.append(given_row(key, case_for(key), spring.gains))
            timed(key_of("redesign", "rope", length, delay))
    for length, bandwidth in filters.items():
        timed(key_of("filter", "rope", length, 0.0, bandwidth))
    return rows, seconds


def load(path: Path = CSV) -> list[Row]:
    """Return the rows that are stored in `docs/data/headline.csv`."""
    return [
        {k: v if k in ("kind", "model") else float(v) for k, v in row.items()}
        for row in read_rows(path)
    ]


def pick(rows: Iterable[Row], **wanted: str | float) -> Row:
    """Return the one row with the wanted keys."""
    found = [row for row in rows if all(row[k] == v for k, v in wanted.items())]
    if len(found) != 1:
        raise KeyError(f"{len(found)} rows have {wanted}")
    return found[0]


def _mm(row: Row) -> str:
    return f"{1e3 * float(row['payload_rms']):.0f} mm"


def _outcome(row: Row) -> str:
    if float(row["growth_rate"]) > 0.0:
        return f"unstable, e-fold in {1.0 / float(row['growth_rate']):.2g} s"
    return f"{_mm(row)}, M_s {float(row['margin.max_sensitivity']):.2f}"


def _table(head: Sequence[str], body: Iterable[Sequence[str]]) -> str:
    lines = [f"| {' | '.join(head)} |", f"|{' --- |' * len(head)}"]
    return "\n".join([*lines, *(f"| {' | '.join(cells)} |" for cells in body)])


def thesis_table(rows: Sequence[Row]) -> str:
    """Return what the thesis's own gains do at each depth, as Markdown."""
    body = []
    for length in LENGTHS:
        spring = pick(rows, kind="thesis", model="spring", length=length)
        rope = pick(rows, kind="thesis", model="rope", length=length)
        body.append([f"{length:.0f} m", _outcome(spring), _outcome(rope)])
    return _table(["rope", "as one spring", "with its axial modes"], body)


def redesign_table(rows: Sequence[Row]) -> str:
    """Return the redesigns for M_s <= 2, as Markdown."""
    head = ["rope", "delay", "drum held", "redesigned on one spring", "... and put on the rope"]
    head += ["redesigned on the rope", "delay margin", "torque peak", "speed peak"]
    body = []
    for length in LENGTHS:
        for delay in DELAYS:
            key = {"length": length, "delay": delay}
            spring = pick(rows, kind="redesign", model="spring", **key)
            put = pick(rows, kind="transplant", **key)
            rope = pick(rows, kind="redesign", model="rope", **key)
            body.append(
                [
                    f"{length:.0f} m",
                    f"{1e3 * delay:.0f} ms",
                    f"{1e3 * float(rope['payload_rms_before']):.0f} mm",
                    _mm(spring) if spring["ok"] else "none found",
                    _outcome(put),
                    f"**{_mm(rope)}**" if rope["ok"] else "none found",
                    f"{1e3 * float(rope['margin.delay']):.0f} ms",
                    f"{100.0 * float(rope['motor.torque.peak.use']):.0f} %",
                    f"{100.0 * float(rope['motor.speed.peak.use']):.0f} %",
                ]
            )
    return _table(head, body)


def filter_table(rows: Sequence[Row]) -> str:
    """Return what a low-pass brings where the rope's second mode stands in the way, as Markdown."""
    body = []
    for length, bandwidth in FILTERS.items():
        bare = pick(rows, kind="redesign", model="rope", length=length, delay=0.0)
        filtered = pick(rows, kind="filter", length=length)
        body.append([f"{length:.0f} m", _mm(bare), f"{bandwidth:g} rad/s", _mm(filtered)])
    return _table(["rope", "three gains, no delay", "low-pass", "with it"], body)


def page(rows: Sequence[Row], seconds: Sequence[float]) -> str:
    """Return the page of the documentation."""
    hook = 1e3 * float(rows[0]["hook_rms"])
    designs = [row for row in rows if row["kind"] in ("redesign", "filter")]
    failed = [row for row in designs if not row["ok"]]
    none_failed = "Every one of them kept its limits and passed the independent check."
    some_failed = f"{len(failed)} of them are not ok; `ok` in the data file says which."
    return f"""# Headline: the 1975 winch, honestly

Written by `docs/make/headline.py`; every figure is in `docs/data/headline.csv`.

The winch of the 1975 thesis in its own design sea: $H_s$ = 2.44 m, in which the hook heaves
{hook:.0f} mm rms. All figures in mm are standard deviations of the payload's motion.

## The thesis's gains

On the model that they were chosen on they are stable at any depth, with thin margins. A rope that
has axial modes tells another story:

{thesis_table(rows)}

## The same winch, redesigned

By `optimise_gains` for $M_s \\le 2$: three gains, on the payload's acceleration, velocity and
displacement, with telemetry delays of 0, 50 and 100 ms. *One spring* is the thesis's model, all
rope mass at the payload. *Rope* has as many masses as the loop's bandwidth asks for, and the
result is checked on the exact distributed rope with the exact delay.

{redesign_table(rows)}

The same in all rows: drag that agrees with the payload's own motion ($C_D$ = 1.05, 20 m²), the
drum's bare radius of 0.413 m, perfect sensors, and $|P/Z| \\le 0.1$ up to 0.01 rad/s, so that
the load does not drift with the tide. Torque and speed are three-hour peaks, the static torque
included, in per cent of what the drive gives (11.88 kN m, 1200 rpm). They are reported and not
enforced: where one is above 100 % **this winch cannot do it in this sea**.

What to read from it:

* Depth decides. At 100 m the rope is a spring and payload feedback works; at 2000 m three gains can
  do little more than damp the resonance, and the load moves about as much as the hook.
* One spring is no model of deep water: at 2000 m every design made on it is unstable on the rope,
  at 1000 m the fastest one is. At 300 m and less the two models agree within a few per cent.
* On a long rope *more* delay can help. Three gains have no lag of their own, and what limits them
  is the rope's second axial mode (7.1 rad/s at 2000 m, 14 rad/s at 1000 m), which the phase of a
  delay happens to serve. So does a filter's; a controller may also simply wait, so the figure of a
  longer delay is open to the quicker link too. Without delay, a second-order low-pass on the
  payload's signals:

{filter_table(rows)}

{len(designs)} designs took {sum(seconds):.0f} s, {min(seconds):.1f} to {max(seconds):.1f} s each,
with their checks, on a core of {_machine()}. {some_failed if failed else none_failed}
"""


def _machine() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
        names = [ln.partition(":")[2].strip() for ln in text.splitlines() if "model name" in ln]
    except OSError:
        names = []
    return names[0] if names else platform.machine()


def write(rows: Sequence[Row], path: Path = CSV) -> None:
    """Write the data file."""
    told = ({k: v if isinstance(v, str) else f"{v:.6g}" for k, v in row.items()} for row in rows)
    write_rows(path, list(rows[0]), told, "SI units; margin.phase in rad.")


def main(argv: Sequence[str] | None = None) -> None:
    """Run the study; write the data file and the page."""
    quick = study_parser(__doc__).parse_args(argv).quick
    docs = docs_folder(quick)
    path = docs / "data" / CSV.name

    def tell(text: str) -> None:
        print(text, flush=True)

    if quick:  # one depth and no delay: too little for the page, which compares them
        write(study(tell, LENGTHS[-1:], DELAYS[:1], {})[0], path)
        return
    rows, seconds = study(tell)
    write(rows, path)
    # From what was stored, so that page and data cannot differ in a rounded digit.
    (docs / PAGE.name).write_text(page(load(path), seconds), encoding="utf-8")


if __name__ == "__main__":
    main()
