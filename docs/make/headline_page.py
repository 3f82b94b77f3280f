"""The page of `docs/make/headline.py`: from `docs/data/headline.csv` to `docs/headline.md`.

    python docs/make/headline_page.py

A short table stands in `docs/thesis.md` between two marks.  What the page's sentences count and
compare is taken from the rows; a test holds the rest against them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path

from headline import DELAYS, HYSTERETIC, KELVIN_VOIGT, LAWS, LENGTHS, Row, load, pick
from stored import docs_folder, study_parser

MOST = 0.85  # of the motion with the drum held, of which designs that leave more are counted
PAGE = Path(__file__).resolve().parents[1] / "headline.md"
SHORT = PAGE.with_name("thesis.md")
BEGIN, END = "<!-- headline: begin -->", "<!-- headline: end -->"


def three_gains(
    rows: Iterable[Row], model: str = "rope", law: str = KELVIN_VOIGT
) -> dict[tuple[float, float], Row]:
    """Return the redesigns on one model of the rope, by one law; by depth [m] and delay [s]."""
    own = {"kind": "redesign", "model": model, "law": law}
    found = [row for row in rows if all(row[k] == v for k, v in own.items())]
    return {(float(row["length"]), float(row["delay"])): row for row in found}


def payload(row: Row) -> float:
    """Return the payload's rms [mm]."""
    return 1e3 * float(row["payload_rms"])


def span(values: Iterable[float], digits: int = 0) -> str:
    """Return the least and the largest value, as ``1 to 2``."""
    every = sorted(values)
    least, most = (f"{value:.{digits}f}" for value in (every[0], every[-1]))
    return least if least == most else f"{least} to {most}"


def where(rows: Sequence[Row]) -> str:
    """Return the depths of some rows and of how many delays each, as ``1000 m (2 of 3)``."""
    counts = {length: sum(row["length"] == length for row in rows) for length in LENGTHS}
    told = [
        f"{length:.0f} m ({count} of {len(DELAYS)})" for length, count in counts.items() if count
    ]
    return " and ".join(filter(None, [", ".join(told[:-1]), *told[-1:]])) or "no depth"


def _found(row: Row, mark: str = "") -> str:
    return f"{mark}{payload(row):.0f} mm{mark}" if row["ok"] else "none"


def _outcome(row: Row) -> str:
    if float(row["growth_rate"]) > 0.0:
        return f"unstable, e-fold in {1.0 / float(row['growth_rate']):.2g} s"
    if not math.isfinite(float(row["payload_rms"])):
        return "unstable"
    return f"{payload(row):.0f} mm, M_s {_peak(row):.2f}"


def _peak(row: Row) -> float:
    """Return M_s, of a hysteretic rope that at a tenth of its damping if it is larger."""
    return max(v for k in ("margin", "least") if (v := float(row[f"{k}.max_sensitivity"])) >= 1.0)


def _uses(rows: Sequence[Row], name: str) -> str:
    each = [f"{100.0 * float(row[f'{name}.use']):.0f}" if row["ok"] else "-" for row in rows]
    return f"{' / '.join(each)} %"


def _table(head: Sequence[str], body: Iterable[Sequence[str]]) -> str:
    lines = [f"| {' | '.join(head)} |", f"|{' --- |' * len(head)}"]
    return "\n".join([*lines, *(f"| {' | '.join(cells)} |" for cells in body)])


def thesis_table(rows: Sequence[Row]) -> str:
    """Return what the thesis's own gains do at each depth, as Markdown."""
    body = []
    for length in LENGTHS:
        spring = pick(rows, kind="thesis", model="spring", length=length)
        ropes = [pick(rows, kind="thesis", model="rope", law=law, length=length) for law in LAWS]
        body.append([f"{length:.0f} m", *map(_outcome, (spring, *ropes))])
    return _table(["rope", "as one spring", "Kelvin-Voigt rope", "hysteretic rope"], body)


def redesign_table(rows: Sequence[Row]) -> str:
    """Return the redesigns for M_s <= 2, as Markdown."""
    head = ["rope", "delay", "drum held", "on one spring", "... put on the Kelvin-Voigt rope"]
    head += ["on the Kelvin-Voigt rope", "... put on the hysteretic rope", "on the hysteretic rope"]
    head += ["torque peak", "speed peak"]
    springs = three_gains(rows, "spring")
    designs = [three_gains(rows, law=law) for law in LAWS]
    body = []
    for length in LENGTHS:
        for delay in DELAYS:
            key = {"length": length, "delay": delay}
            ropes = easy, hard = [found[length, delay] for found in designs]
            body.append(
                [
                    f"{length:.0f} m",
                    f"{1e3 * delay:.0f} ms",
                    f"{1e3 * float(easy['payload_rms_before']):.0f} mm",
                    _found(springs[length, delay]),
                    _outcome(pick(rows, kind="transplant", **key)),
                    _found(easy, "**"),
                    _outcome(pick(rows, kind="kept", **key)),
                    _found(hard, "**"),
                    _uses(ropes, "motor.torque.peak"),
                    _uses(ropes, "motor.speed.peak"),
                ]
            )
    return _table(head, body)


def rolloff_table(rows: Sequence[Row]) -> str:
    """Return what a roll-off behind the three gains brings by each law, as Markdown."""
    head = ["rope"]
    for law in LAWS:
        name = {KELVIN_VOIGT: "Kelvin-Voigt", HYSTERETIC: "hysteretic"}[law]
        head += [f"{name} rope: three gains", "with a roll-off", "its corner"]
    body = []
    for length in LENGTHS:
        cells = [f"{length:.0f} m"]
        for law in LAWS:
            rolled = pick(rows, kind="rolloff", law=law, length=length)
            cells.append(_found(three_gains(rows, law=law)[length, 0.0]))
            cells += [_found(rolled, "**"), f"{float(rolled['corner']):.3g} rad/s"]
        body.append(cells)
    return _table(head, body)


def short_table(rows: Sequence[Row]) -> str:
    """Return the payload's rms of all redesigns in mm, a line a depth, as Markdown."""
    head = ["depth", "drum held", "on one spring", "those gains on the rope"]
    head += ["designed on the rope", "on a hysteretic rope"]
    easy, hard = (three_gains(rows, law=law) for law in LAWS)
    spring = three_gains(rows, "spring")
    put = {key: pick(rows, kind="transplant", length=key[0], delay=key[1]) for key in easy}
    body = []
    for length in LENGTHS:
        keys = [(length, delay) for delay in DELAYS]
        moved = [
            f"{payload(put[k]):.0f}" if not put[k]["growth_rate"] else "unstable" for k in keys
        ]
        cells = [
            moved if found is put else [_found(found[k]).removesuffix(" mm") for k in keys]
            for found in (spring, put, easy, hard)
        ]
        held = f"{1e3 * float(easy[keys[0]]['payload_rms_before']):.0f}"
        body.append([f"{length:.0f} m", held, *map(" / ".join, cells)])
    return _table(head, body)


def page(rows: Sequence[Row]) -> str:
    """Return the page of the documentation."""
    hook = 1e3 * float(rows[0]["hook_rms"])
    easy, hard = (three_gains(rows, law=law) for law in LAWS)
    put = [row for row in rows if row["kind"] == "transplant"]
    kept = [row for row in rows if row["kind"] == "kept"]
    rolled = [row for row in rows if row["kind"] == "rolloff" and row["law"] == HYSTERETIC]
    deep = [payload(easy[LENGTHS[0], delay]) for delay in DELAYS]
    lost = [row for row in put if row["growth_rate"]]
    awry = [row for row in kept if row["growth_rate"]]
    woken = [_peak(row) for row in kept if not row["growth_rate"]]
    none = [row for row in hard.values() if not row["ok"]]
    left = [payload(row) / payload(easy[key]) for key, row in hard.items() if row["ok"]]
    idle = [
        row
        for row in hard.values()
        if row["ok"] and float(row["payload_rms"]) > MOST * float(row["payload_rms_before"])
    ]
    calmed = [
        payload(row) / payload(easy[float(row["length"]), 0.0]) for row in rolled if row["ok"]
    ]
    spring = three_gains(rows, "spring")
    apart = [
        abs(payload(easy[key]) / payload(row) - 1.0)
        for key, row in spring.items()
        if key[0] <= 300.0
    ]
    others = f"the other {len(woken)} have M_s of {span(woken, 1)}" if woken else "none is stable"
    seconds = [float(row["seconds"]) for row in rows if row["kind"] in ("redesign", "rolloff")]
    return f"""# Headline: the 1975 winch, honestly

Made by `docs/make/headline.py` and `headline_page.py`; every figure is in `docs/data/headline.csv`.

The winch of the 1975 thesis in its own design sea: $H_s$ = 2.44 m, in which the hook heaves
{hook:.0f} mm rms. All figures in mm are standard deviations of the payload's motion.

Nobody has measured the rope's damping; 0.2 % of critical in the first axial mode is assumed. By
*Kelvin and Voigt's* law the higher modes have more, in proportion to their frequency; of a
*hysteretic* rope all have the same, and a design must hold at a tenth of it too
([theory](theory.md)).

## The thesis's gains

On the model that they were chosen on they are stable at any depth, with thin margins. A rope that
has axial modes tells another story, here and below a hysteretic one at the worse of its dampings:

{thesis_table(rows)}

## The same winch, redesigned

By `optimise_gains` for $M_s \\le 2$: three gains, on the payload's acceleration, velocity and
displacement, with telemetry delays of 0, 50 and 100 ms. *One spring* is the thesis's model, all
rope mass at the payload. *Rope* has as many masses as the loop's bandwidth asks for, and the
result is checked on the exact distributed rope with the exact delay.

{redesign_table(rows)}

In all rows drag agrees with the payload's own motion ($C_D$ = 1.05, 20 m²), the drum has its bare
radius of 0.413 m, sensors are perfect, and $|P/Z| \\le 0.1$ up to 0.01 rad/s (tide). Torque and
speed are three-hour peaks of the two designs on the rope, the static torque included, in per cent
of what the drive gives (11.88 kN m, 1200 rpm), reported and not enforced: above 100 % **this winch
cannot do it in this sea**.

What to read from it:

* By Kelvin and Voigt's law depth decides. At 100 m the rope is a spring and payload feedback works;
  at 2000 m three gains do little more than damp the resonance, and leave {span(deep)} mm.
* One spring is no model of deep water: on the rope those of its designs are unstable that were
  made at {where(lost)}. At 300 m and less the two models
  agree within {100.0 * max(apart):.0f} %.
* These figures hang on damping that nobody has measured. Of the {len(kept)} designs for the
  Kelvin-Voigt rope {len(awry)} are unstable on the hysteretic one; {others}. Designed on
  it, three gains have no ok design at {where(none)}; elsewhere they leave
  {span(left, 1)} times what Kelvin and Voigt's law promises, in {len(idle)} of those {len(left)}
  rows more than {100.0 * MOST:.0f} % of what moves with the drum held.
* By that law *more* delay can help at 2000 m: its phase happens to serve the rope's second mode.
* A roll-off behind the gains, its corner found with them (up to 500 rad/s), takes the higher modes
  out of the loop. Without delay it leaves, on the hysteretic rope, {span(calmed, 1)} times what
  three gains promise by Kelvin and Voigt's law:

{rolloff_table(rows)}

{len(seconds)} designs took {sum(seconds):.0f} s of processor time, {span(seconds)} s each,
with their checks. Searches on the hysteretic rope and of a roll-off began at scaled gains for the
Kelvin-Voigt rope too; of a roll-off the better of two searches is told.
"""


def main(argv: Sequence[str] | None = None) -> None:
    """Write the page."""
    docs = docs_folder(study_parser(__doc__).parse_args(argv).quick)
    rows = load()
    (docs / PAGE.name).write_text(page(rows), encoding="utf-8")
    before, _, rest = SHORT.read_text(encoding="utf-8").partition(BEGIN)
    after = rest.partition(END)[2]
    text = f"{before}{BEGIN}\n\n{short_table(rows)}\n\n{END}{after}"
    (docs / SHORT.name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
