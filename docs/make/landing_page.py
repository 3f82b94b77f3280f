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
from landing import CONTROLLERS, FEWER, LIMITS, PHASES, SETTLED, TOLERANCE, Row, mean, values
from stored import docs_folder, read_rows, study_parser

import stillhook as sh
from models.basics import Interval
from models.operation import scenario_named
from models.plant import PlantData

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


def landed_table(rows: Sequence[Row], names: Iterable[str]) -> str:
    """Return how the payload lands, as Markdown."""
    head = ["controller", "minute before, rms [mm]", "touchdown speed [mm/s]", "fastest [mm/s]"]
    head += ["touchdowns", "hardest [mm/s]", "off again [mm]", "slack events"]
    head += ["runs with a snap", "largest load after slack [kN]"]
    body = []
    for name in names:
        loads = [v for v in values(rows, name, "snap_load") if not math.isnan(v)]
        speeds = values(rows, name, "touchdown_speed")
        body.append(
            [
                name,
                _text(mean(rows, name, "minute_before"), 1e3, 1),
                _text(mean(rows, name, "touchdown_speed"), 1e3),
                f"{1e3 * max(speeds):.0f}",
                f"{mean(rows, name, 'touchdowns').mean:.1f}",
                f"{1e3 * max(values(rows, name, 'hardest')):.0f}",
                f"{1e3 * most_off(rows, name):.0f}",
                f"{mean(rows, name, 'slack_events').mean:.1f}",
                f"{snaps(rows, name)} of {len(speeds)}",
                f"{max(loads) / 1e3:.0f}" if loads else "-",
            ]
        )
    return _table(head, body)


def snaps(rows: Iterable[Row], name: str) -> int:
    """Return in how many runs a rope that was slack takes more than the load at rest."""
    static = sh.load_case("landing").static_tension
    return sum(load > static for load in values(rows, name, "snap_load"))


def most_off(rows: Sequence[Row], name: str) -> float:
    """Return how far a payload that had touched down was off the seabed again, at most [m]."""
    heights = [*values(rows, name, "bounce"), *values(rows, name, "lifted")]
    return max((height for height in heights if not math.isnan(height)), default=0.0)


def with_phases() -> list[str]:
    """Return the names of `PHASES`, each controller's together and with the default in its row."""
    own = dict.fromkeys(name.partition(", touchdown ")[0] for name in PHASES)
    return [
        name
        for each in own
        for name in (f"{each}, touchdown none", each, f"{each}, touchdown tension")
    ]


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
    phase = scenario.touch_down
    without, nonlinear = (f"{name}, touchdown none" for name in ("mpc", "nonlinear-mpc"))
    taut = [name for name in PHASES if name.endswith("tension")]
    fewer = ", ".join(f"{len(values(rows, name, 'rms'))} seeds of `{name}`" for name in FEWER)
    sigma = case.sensors.mru.noise_floor / PlantData.from_case(case).chain_compliance

    def left(name: str) -> str:
        return mm(rows, name)

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

Below are all controllers, {seeds} seeds each ({fewer}): means over the seeds, with their 95 %
intervals. `mpc` is `sh.LinearMPC(case)`, `nonlinear-mpc` is `sh.NonlinearMPC(case)`.
`sh.optimise_gains(case)` answers with `{answer}`; the other structures that it looks at are here
too, `feed-forward, designed` among them. `feed-forward` itself pays out 0.9 of the hook's speed,
and *lowered without compensation* nothing of it.

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

The set-point goes down at {1e3 * touch.speed:.0f} mm/s, to {spare:g} m of rope more than reach the
seabed. No controller knows of the seabed; the touch-down phase of the scenario does. Once the
tension at the drum lacks {phase.unloaded:g} of the load's weight for {phase.unloaded_for:g} s, with
the set-point on its last way down, the winch no longer does what the controller wants:

* `touchdown=release`, the default: it pays out at {phase.speed:.2f} m/s until the rope is slack by
  {phase.slack:g} m with the hook in the middle of its motion. There the drum stands still, and the
  brake is set.
* `touchdown=tension`: it pays out as the hook rises and keeps {phase.kept_tension:g} of the weight
  in the rope by constant tension, as far from slack as from lifting, as long as it runs.
* `touchdown=none`: the controller goes on until the set-point is down, then the brake is set.

```console
$ stillhook simulate landing --scenario landing --controller feed-forward --option touchdown=tension
```

`unloaded`, `unloaded_for`, `kept_tension`, `release_speed` and `slack` are options too; `set-down`
has them for a deck. The command has no bump where the phase begins, and until then nothing is
changed by it. `synth.controllers.touching_down` puts it around any controller.

All controllers with the default phase:

{landed_table(rows, landers(rows))}

*Off again* is how far the module leaves the seabed once it has touched it, the *hardest* touchdown
is of all. A *snap* is a tension above the {case.static_tension / 1e3:.0f} kN of the load at rest
in a rope that was slack, blunted by the few masses of the rope.

With and without the phase ({fewer}):

{landed_table(rows, with_phases())}

* *Without the phase* MPC puts the module down at
  {1e3 * mean(rows, "mpc", "touchdown_speed").mean:.0f} mm/s, but what follows is not for it: it
  goes on following the hook, the rope is slack
  {mean(rows, without, "slack_events").mean:.0f} times a run, the hook lifts the module again by
  up to {most_off(rows, without):.1f} m and sets it down at up to
  {most(without, "hardest"):.1f} m/s; tension goes up to {most(without, "snap_load") / 1e3:.0f} kN.
  Nonlinear MPC: {most(nonlinear, "snap_load") / 1e3:.0f} kN.
* *Released*, there is a snap in {sum(snaps(rows, name) for name in landers(rows))} of
  {sum(len(values(rows, name, "snap_load")) for name in landers(rows))} runs of all controllers. The
  first touchdown is as hard as before, for it is what begins the phase.
* *Kept taut*, there is a snap in {sum(snaps(rows, name) for name in taut)} of
  {sum(len(values(rows, name, "snap_load")) for name in taut)} runs. What is left of the tension's
  variation is the error of the motion reference unit, which a rope of 350 m turns into
  some {sigma / 1e3:.0f} kN.""")


def figure(kind: str = "svg", seed: int = 0) -> bytes:
    """Return the figure of the page as a file of a kind, `svg` or `png`."""
    from stillhook.text import AFTER, BEFORE, DRUM, HOOK, REFERENCE, new_figure, picture, styled

    shown = {
        "mpc": AFTER,
        "combined": DRUM,
        "feed-forward": HOOK,
    }
    phases = {"none": BEFORE, "release": AFTER, "tension": DRUM}
    with styled():
        drawn = new_figure(9.0, 3.8)
        holding, touching = drawn.subplots(1, 2)
        for name, colour in reversed(shown.items()):
            (run,) = landing.runs_of(name, [seed])
            error = 1e3 * (run["payload.displacement"] - run["reference.displacement"])
            kept = (run.time >= 75.0) & (run.time <= 133.0)
            holding.plot(run.time[kept][::5], error[kept][::5], color=colour, lw=1.3, label=name)
        for edge in (-1e3 * TOLERANCE, 1e3 * TOLERANCE):
            holding.axhline(edge, color=REFERENCE, lw=0.8, ls="--")
        holding.set(xlabel="time [s]", ylabel="error [mm]", ylim=(-225.0, 190.0))
        holding.set_title("Held 5 m above the seabed")
        holding.annotate(
            "4 cm", (75.0, 1e3 * TOLERANCE), (0.0, 3.0), textcoords="offset points", fontsize=9.0
        )
        for mode, colour in phases.items():
            name = "mpc" if mode == "release" else f"mpc, touchdown {mode}"
            (run,) = landing.runs_of(name, [seed])
            near = (run.time >= 155.0) & (run.time <= 215.0)
            tension = run["rope.tension"][near] / 1e3
            touching.plot(run.time[near], tension, color=colour, lw=1.0, label=mode)
        touching.set(
            xlabel="time [s]",
            ylabel="tension at the drum [kN]",
            title="Set down by mpc",
            ylim=(-7.0, 165.0),
        )
        holding.legend(loc="lower center", ncols=len(shown), fontsize=8.0)
        touching.legend(loc="upper right", ncols=len(phases), fontsize=8.0)
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
