"""The page on landing a module, from the rows of `landing.py`: `python docs/make/landing_page.py`.

Every figure in its sentences, and who keeps within the tolerance, come from the rows.  Writes
`docs/landing.md` and `docs/images/landing.svg`.
"""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import landing
from landing import CONTROLLERS, LIMITS, SETTLED, TOLERANCE, Row, mean, values
from stored import docs_folder, read_rows, study_parser

import stillhook as sh
from models.basics import Interval
from models.operation import Scenario, scenario_named

PAGE = Path(__file__).resolve().parents[1] / "landing.md"
FIGURE = PAGE.parent / "images" / "landing.svg"
LIFTED = 0.01  # off the seabed by more than this is a module that was lifted again [m]


def _table(head: Sequence[str], body: Iterable[Sequence[str]]) -> str:
    lines = [f"| {' | '.join(head)} |", f"|{' --- |' * len(head)}"]
    return "\n".join([*lines, *(f"| {' | '.join(cells)} |" for cells in body)])


def _text(found: Interval, scale: float, digits: int = 0) -> str:
    if not found.count:
        return "-"
    mean, low, high = (
        _digits(scale * value, digits) for value in (found.mean, found.low, found.high)
    )
    return f"{mean} ({low} to {high})"


def _digits(value: float, digits: int) -> str:
    """Return a number, without the sign of a zero."""
    return f"{round(value, digits) + 0.0:.{digits}f}"


def _filled(text: str) -> str:
    """Return Markdown whose prose is filled up again where figures were put in."""
    parts = []
    for part in text.split("\n\n"):
        prose = "```" not in part and not part.startswith(("#", "|", "!"))
        items = re.split(r"\n(?=\* )", part) if prose else []
        filled = (
            textwrap.fill(
                " ".join(item.split()),
                100,
                subsequent_indent="  " if item.startswith("* ") else "",
                break_long_words=False,
                break_on_hyphens=False,
            )
            for item in items
        )
        parts.append("\n".join(filled) if prose else part)
    return "\n\n".join(parts) + "\n"


def mm(rows: Iterable[Row], name: str) -> str:
    """Return how still a controller holds the payload, in words."""
    value = 1e3 * mean(rows, name, "rms").mean
    return f"{value:.0f} mm" if value >= 9.95 else f"{value:.1f} mm"


def inside(rows: Iterable[Row], name: str) -> str:
    """Return in how many of its runs a controller never leaves the tolerance, in words."""
    largest = values(rows, name, "largest")
    return f"{sum(v <= TOLERANCE for v in largest)} of {len(largest)}"


def by_stillness(rows: Iterable[Row]) -> list[str]:
    """Return the controllers, the stillest first."""
    return sorted(CONTROLLERS, key=lambda name: mean(rows, name, "rms").mean)


def keepers(rows: Iterable[Row]) -> list[str]:
    """Return the controllers that keep within the tolerance in every run."""
    return [name for name in CONTROLLERS if max(values(rows, name, "largest")) <= TOLERANCE]


def landers(rows: Iterable[Row]) -> list[str]:
    """Return the controllers that set the module down."""
    every = [name for name in CONTROLLERS if mean(rows, name, "touchdown_speed").count]
    return [name for name in by_stillness(rows) if name in every]


def beyond(rows: Iterable[Row], name: str, scenario: Scenario) -> float:
    """Return how much more rope than asked is out when the brake is set, the mean over runs [m]."""
    asked = -sum(move.distance for move in scenario.profile.moves)
    return -mean(rows, name, "end_haul").mean - asked


def held_table(rows: Sequence[Row], names: Iterable[str]) -> str:
    """Return how still the payload is held, as Markdown."""
    head = ["controller", "time within 4 cm [%]", "rms [mm]", "largest [mm]", "never beyond 4 cm"]
    return _table(
        head,
        (
            [
                name,
                _text(mean(rows, name, "within"), 100.0),
                _text(mean(rows, name, "rms"), 1e3, 1),
                _text(mean(rows, name, "largest"), 1e3),
                inside(rows, name),
            ]
            for name in names
        ),
    )


def designs_table(rows: Sequence[Row], designs: Iterable[Mapping[str, str]]) -> str:
    """Return what the designs promise and what the runs show, as Markdown."""
    head = ["structure", "ok", "by design, rms [mm]", "simulated, rms [mm]", "what binds"]
    body = []
    for row in designs:
        name = row["structure"]
        simulated = name if name != "feed-forward" else "feed-forward, designed"
        binds = row["status"].partition("; ")[2].removesuffix(" bind").removesuffix(" binds")
        promised = f"{1e3 * float(row['payload_rms']):.1f}"
        found = _text(mean(rows, simulated, "rms"), 1e3, 1)
        body.append([f"`{name}`", row["ok"], promised, found, binds])
    return _table(head, body)


def landed_table(rows: Sequence[Row], scenario: Scenario) -> str:
    """Return how the payload lands, as Markdown."""
    head = ["controller", "touchdown speed [mm/s]", "fastest [mm/s]", "off again [mm]"]
    head += ["rope beyond what is asked [m]", "lifted on the brake", "hardest [mm/s]"]
    head += ["slack events", "runs with a snap", "largest snap load [kN]"]
    body = []
    for name in landers(rows):
        snaps = [v for v in values(rows, name, "snap_load") if not math.isnan(v)]
        speeds = values(rows, name, "touchdown_speed")
        body.append(
            [
                name,
                _text(mean(rows, name, "touchdown_speed"), 1e3),
                f"{1e3 * max(speeds):.0f}",
                _text(mean(rows, name, "bounce"), 1e3),
                _digits(beyond(rows, name, scenario), 1),
                lifted(rows, name),
                f"{1e3 * max(values(rows, name, 'hardest')):.0f}",
                f"{mean(rows, name, 'slack_events').mean:.1f}",
                f"{len(snaps)} of {len(speeds)}",
                f"{max(snaps) / 1e3:.0f}" if snaps else "-",
            ]
        )
    return _table(head, body)


def lifted(rows: Sequence[Row], name: str) -> str:
    """Return in how many runs the module is lifted again after the controller, in words."""
    heights = values(rows, name, "lifted")
    return f"{sum(v > LIFTED for v in heights)} of {len(heights)}"


def verdict(rows: Sequence[Row]) -> str:
    """Return who keeps within the tolerance, and who comes next."""
    best, second = by_stillness(rows)[:2]
    kept = keepers(rows)
    if kept:
        names = ", ".join(f"`{name}`" for name in kept)
        first = f"**Within 4 cm all the time, in every run: {names}.**"
    else:
        first = "**None of them keeps within 4 cm** all the time."
    return (
        f"{first} `{best}` is the stillest with {mm(rows, best)} rms and at most "
        f"{1e3 * max(values(rows, best, 'largest')):.0f} mm. Next is `{second}` with "
        f"{mm(rows, second)}, within 4 cm for {100.0 * mean(rows, second, 'within').mean:.0f} % "
        f"of the time (all of it in {inside(rows, second)} runs)."
    )


def page(rows: Sequence[Row], designs: Sequence[Mapping[str, str]]) -> str:
    """Return the page of the documentation."""
    case = sh.load_case("landing")
    scenario = scenario_named("landing", case)
    down, touch = scenario.profile.moves
    below = scenario.surroundings.ground.below
    spare = -(down.distance + touch.distance) - below
    answer = designs[-1]["structure"]
    seeds = len(values(rows, "mpc", "rms"))

    def left(name: str) -> str:
        return mm(rows, name)

    def rope(name: str) -> str:
        more = beyond(rows, name, scenario)
        return f"{abs(more):.1f} m {'more' if more > 0.0 else 'less'}"

    def most(name: str, number: str) -> float:
        return max(v for v in values(rows, name, number) if not math.isnan(v))

    return _filled(f"""# Landing a module within 4 cm

Written by `docs/make/landing.py` and `landing_page.py`; `docs/data/landing.csv` has a row for each
run, `docs/data/landing_designs.csv` the designs.

The bundled case `landing` sets a module of {case.payload.mass / 1e3:.0f} t down on the seabed at
{case.rope.length:.0f} m, in $H_s$ = {case.sea.significant_height:g} m and waves of
{case.sea.peak_period:g} s; its positioning is wanted within 4 cm. The job is that of a crane
assignment of the University of Agder (MAS409); vessel, rope and winch are ours, and so is what is
measured: the payload's motion up to 20 Hz, 20 ms late and with noise; the hook's by a motion
reference unit (MRU) of 5 cm, read as noise in the band of the waves. The scenario holds the module
{below:g} m above the seabed for a minute, lowers it to {below + down.distance:g} m, holds it for
another minute and sets it down.

```python
import stillhook as sh

case = sh.load_case("landing")
runs = sh.simulate(case, "feed-forward", scenario="landing", seeds=2)
print(runs)
```

Below are all controllers, {seeds} seeds each: means over the seeds, with their 95 % intervals.
`mpc` is `sh.LinearMPC(case)`. `sh.optimise_gains(case)` answers with `{answer}`; the other
structures that it looks at are here too, `feed-forward, designed` among them. `feed-forward` itself
pays out 0.9 of the hook's speed, and *lowered without compensation* nothing of it.

## Holding it above the seabed

Counted while the set-point rests, from {SETTLED:.0f} s on: some hundred seconds of each run.
The closed brake (`none`) is asked to stay at {below:g} m.

{held_table(rows, by_stillness(rows))}

![How far the module is from where it should be](images/landing.svg)

{verdict(rows)}

What the designs promise, and which limits bind in them:

{designs_table(rows, designs)}

What stands in the way, the gains as they are:

{held_table(rows, LIMITS)}

* *MPC* hears the sensors that `{answer}` hears, and knows the sea's spectrum besides. `mpc-ar`,
  which knows nothing of the sea and learns as it goes, has less than three minutes for that here:
  {left("mpc-ar")}.
* *Feedback and feed-forward together* (`combined`): {left("combined")}, with a perfect MRU
  {left("combined, perfect MRU")}, with perfect sensors at the payload
  {left("combined, perfect payload sensors")}.
* *Payload feedback* alone is limited by its own loop. Three gains that keep every limit leave
  {left("payload-feedback")} of {left("lowered without compensation")}, with a roll-off
  {left("payload-feedback-rolloff")}, and with perfect sensors at the payload
  {left("payload-feedback-rolloff, perfect payload sensors")}.
* *Feed-forward* is limited by what it is told. A share of 0.9 leaves
  {left("feed-forward of 0.9, perfect MRU")} with a perfect MRU. An MRU of 5 cm passes its error on
  to the module: {left("feed-forward of 1")} at a share of 1, against
  {left("feed-forward of 1, perfect MRU")} with a perfect one. That hangs on how the 5 cm are read:
  as a slow drift they leave {left("feed-forward of 1, MRU that drifts by 5 cm")}. An MRU of 1 cm
  leaves {left("feed-forward of 1, MRU of 1 cm")} and keeps within 4 cm in
  {inside(rows, "feed-forward of 1, MRU of 1 cm")} runs. With a perfect MRU and the lead that makes
  up for the drum's lag, {left("feed-forward of 1 with lead, perfect MRU")}, that is
  {inside(rows, "feed-forward of 1 with lead, perfect MRU")} runs. `feed-forward-lead` leaves
  {left("feed-forward-lead")} where `feed-forward` leaves {left("feed-forward")}, as the MRU's heave
  filter, of 200 s, is ahead already.
* *Constant tension* leaves {left("constant-tension")}, lowering without compensation
  {left("lowered without compensation")}: it does nothing for a module that is to stay in its place.

## Setting it down

{landed_table(rows, scenario)}

The set-point goes down at {1e3 * touch.speed:.0f} mm/s, to {spare:g} m of rope more than reach the
seabed. There the controller is ramped out and the brake set. *Off again* is how far the module
leaves the seabed before that, and *lifted on the brake* counts the runs in which the hook takes it
up afterwards; the *hardest* touchdown is of any of these. Slack comes with the rope that is paid
out on top; a second slack event is the hook taking the rope up again, and the snap load is what
follows, blunted by the few masses of the rope.

No controller here knows of the seabed.

* *Feedback* has to be switched off at touchdown. It goes on lowering a module that cannot go lower:
  when the brake is set `{answer}` has paid out {rope(answer)} rope than it is asked to,
  `payload-feedback-rolloff` {rope("payload-feedback-rolloff")}.
* *MPC* puts the module down at {1e3 * mean(rows, "mpc", "touchdown_speed").mean:.0f} mm/s and at
  most {1e3 * most("mpc", "touchdown_speed"):.0f}, but what follows is not for it. It goes on
  following the hook, the rope is slack {mean(rows, "mpc", "slack_events").mean:.0f} times a run,
  and when the brake is set there is {rope("mpc")} rope out than it is asked for. The hook then
  lifts the module again in {lifted(rows, "mpc")} runs, by up to {most("mpc", "lifted"):.1f} m, and
  sets it down at up to {most("mpc", "hardest"):.1f} m/s; snap loads go up to
  {most("mpc", "snap_load") / 1e3:.0f} kN, where the module weighs
  {case.payload.submerged_weight / 1e3:.0f} kN.""")


def figure(kind: str = "svg", seed: int = 0) -> bytes:
    """Return the figure of the page as a file of a kind, `svg` or `png`."""
    from stillhook.text import AFTER, BEFORE, DRUM, HOOK, REFERENCE, new_figure, picture, styled

    shown = {
        "mpc": AFTER,
        "combined": DRUM,
        "feed-forward": HOOK,
        "lowered without compensation": BEFORE,
    }
    with styled():
        drawn = new_figure(9.0, 3.8)
        holding, touching = drawn.subplots(1, 2)
        for name, colour in reversed(shown.items()):
            (run,) = landing.runs_of(name, [seed])
            error = 1e3 * (run["payload.displacement"] - run["reference.displacement"])
            kept = (run.time >= 75.0) & (run.time <= 133.0)
            if colour != BEFORE:  # that is ten times as much
                holding.plot(run.time[kept][::5], error[kept][::5], color=colour, lw=1.3)
            near = (run.time >= 150.0) & (run.time <= 200.0)
            height = run["contact.gap"][near]
            touching.plot(run.time[near], height, color=colour, lw=1.3, label=name)
        for edge in (-1e3 * TOLERANCE, 1e3 * TOLERANCE):
            holding.axhline(edge, color=REFERENCE, lw=0.8, ls="--")
        holding.set(xlabel="time [s]", ylabel="error [mm]", title="Held 5 m above the seabed")
        holding.annotate(
            "4 cm", (75.0, 1e3 * TOLERANCE), (0.0, 3.0), textcoords="offset points", fontsize=9.0
        )
        touching.axhline(0.0, color=REFERENCE, lw=0.8)
        touching.set(xlabel="time [s]", ylabel="above the seabed [m]", title="Set down")
        drawn.legend(loc="outside lower center", ncols=len(shown))
    return picture(drawn, kind)


def main(argv: Sequence[str] | None = None) -> None:
    """Write the figure and the page."""
    docs = docs_folder(study_parser(__doc__).parse_args(argv).quick)
    (docs / "images" / FIGURE.name).write_bytes(figure())
    # From what was stored, so that page and data cannot differ in a rounded digit.
    told = page(landing.load(docs / "data" / landing.CSV.name), read_rows(landing.DESIGNS))
    (docs / PAGE.name).write_text(told, encoding="utf-8")


if __name__ == "__main__":
    main()
