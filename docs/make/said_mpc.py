"""Figures in the sentences of `docs/mpc.md`: `python docs/make/said_mpc.py [--quick]`.

After `comparison.py` and `benchmarks/mpc_speed.py`, from whose stored rows some of them come.  The
others are runs of minutes in which sensors, waves or the horizon are not what the controller should
have: the case that is simulated is not always the one that it was made for.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import math
import time
import warnings
from collections.abc import Mapping, Sequence
from functools import cache

import comparison
import numpy as np
from said import Effort, Saying, sayings_parser, tell
from stored import DOCS, read_rows

import stillhook as sh
from models import PhysicsWarning
from models.basics import FloatArray
from models.plant import MEASUREMENTS
from models.sensing import HEARD, Measurement
from mpc.forecast import AdaptiveAR
from mpc.linear import path_of_sea
from mpc.nonlinear import NonlinearMPC

PAGE, FILE = "mpc.md", "said_mpc.csv"
UNIT = {"noise_floor": 0.0, "noise_fraction": 0.01, "noise_bandwidth": 11.31}
THESIS = {"A": 200.0, "a": 50.0, "a1": 100.0, "a2": 100.0}
LEADS = (3.0, 5.0, 8.0)  # s
SETTLE = 60.0  # from which a run is under way [s]
START = 30.0  # the first half minute


@cache
def winch(height: float = 1.25, name: str = "thesis-1975") -> sh.Case:
    """Return the winch with its white unit in a sea."""
    return sh.load_case(name).replace({"sensors.mru": UNIT, "sea.significant_height": height})


@cache
def weights() -> sh.Weights:
    """Return what is tuned for the thesis's sea, and serves from 0.3 to 3.75 m."""
    return sh.tune_weights(winch(2.43))


def left(case: sh.Case, controller: object, effort: Effort, first: float = SETTLE) -> float:
    """Return the payload's rms from then on, over all seeds [mm]; infinite if a run broke off."""
    seconds = max(effort.seconds, first + 10.0)
    squares = []
    for run in sh.simulate(case, controller, seeds=effort.seeds, duration=seconds):
        if not run.completed:
            return math.inf
        motion = run["payload.displacement"][run.time > first]
        squares.append(float((motion**2).mean()))
    return 1e3 * math.sqrt(sum(squares) / len(squares))


def mpc(case: sh.Case, **options: object) -> sh.LinearMPC:
    """Return the controller made for a case."""
    return sh.LinearMPC(case, **{"weights": weights(), **options})


HEIGHTS = {"a": 1.25, "b": 1.9, "c": 2.43, "d": 3.75}  # m
#: Drives that are not as told: inertia at the motor and torque limit, over those told.
DRIVES = {"heavy": (1.3, 1.0), "light": (0.7, 1.0), "weak": (1.0, 0.8)}


def with_drive(case: sh.Case, inertia: float, torque: float) -> sh.Case:
    """Return a case with another motor; a DC motor's current goes with its torque."""
    own = case.winch
    return case.replace(
        {
            "winch.motor.inertia": inertia * own.motor.inertia,
            "winch.gearbox.inertia": inertia * own.gearbox.inertia,
            "winch.drive.torque_peak": torque * own.drive.torque_peak,
            "winch.drive.current_peak": torque * (own.drive.current_peak or math.nan),
        }
    )


def believing(case: sh.Case) -> sh.LinearMPC:
    """Return a controller that learns nothing of its drive."""
    controller = mpc(case)
    controller.window.follow = lambda *heard: False  # type: ignore[method-assign]
    controller.inertia.update = lambda *heard: None  # type: ignore[method-assign]
    return controller


def drives(effort: Effort) -> Mapping[str, float]:
    """Drives that are not as told: who learns nothing, who learns, and who is told [mm]."""
    found = {}
    for at, height in HEIGHTS.items():
        case = winch(height)
        found[f"told_{at}"] = left(case, mpc(case), effort)
        for name, other in DRIVES.items():
            true = with_drive(case, *other)
            found[f"{name}_{at}1"] = left(true, believing(case), effort)
            found[f"{name}_{at}2"] = left(true, mpc(case), effort)
            found[f"{name}_{at}3"] = left(true, mpc(true), effort)
    return found


def _drives_table() -> str:
    """Return the template of the table of `drives`."""
    rows = {"inertia +30 %": "heavy", "inertia -30 %": "light", "torque -20 %": "weak"}
    cells = {"as told": [f"{{told_{at}}}" for at in HEIGHTS]}
    for label, name in rows.items():
        cells[label] = [", ".join(f"{{{name}_{at}{k}}}" for k in (1, 2, 3)) for at in HEIGHTS]
    lines = ["| drive | " + " | ".join(f"{height:g} m" for height in HEIGHTS.values()) + " |"]
    lines.append("| --- |" + " --- |" * len(HEIGHTS))
    return "\n".join([*lines, *(f"| {name} | {' | '.join(of)} |" for name, of in cells.items())])


class Deaf:
    """A controller that some sensors tell nothing, or nothing true, for a minute out of two.

    What is lost shows no number or is said not to be valid, what stands shows what it showed at
    the beginning of the minute, and what jumps is off by so much in one sample of five.
    """

    def __init__(
        self,
        own: sh.LinearMPC,
        *lost: str,
        stands: Sequence[str] = (),
        jumps: Mapping[str, float] | None = None,
    ) -> None:
        self.name, self.sample_time, self._own, self._lost = "deaf", own.sample_time, own, lost
        self._stands = [HEARD.index(name) for name in stands]
        self._jumps = {HEARD.index(name): by for name, by in (jumps or {}).items()}
        self._before, self._samples = np.zeros(len(HEARD)), 0

    def reset(self) -> None:
        """Forget."""
        self._own.reset()
        self._samples = 0

    def step(self, measurement: Measurement, time: float) -> float:
        """Do as always with what is left."""
        self._samples += 1
        if not gone(time):
            self._before = measurement.values.copy()
            return self._own.step(measurement, time)
        shown = measurement.values.copy()
        for name in self._lost:
            shown[HEARD.index(name)] = 0.0 if name.endswith(".valid") else math.nan
        shown[self._stands] = self._before[self._stands]
        for at, by in self._jumps.items():
            shown[at] += by if self._samples % 5 == 0 else 0.0
        return self._own.step(Measurement(shown), time)


def gone(time: float | FloatArray) -> bool | FloatArray:
    """Return whether sensors are gone: the second minute, the fourth and so on."""
    return (time // 60.0) % 2 == 1


def outages(effort: Effort) -> dict[str, float]:
    """Return what is left of the payload's rms while sensors of the crane are gone [mm]."""
    case = sh.load_case("subsea-crane")
    own = sh.LinearMPC(case)
    telegram, cell, unit = "payload.valid", "rope.tension", "mru.valid"

    def lost(controller: object, at: bool = True) -> float:
        runs = sh.simulate(
            case, controller, seeds=effort.seeds, duration=max(360.0, effort.seconds)
        )
        squares = []
        for run in runs:
            during = gone(run.time) == at
            squares.append(
                float((run["payload.displacement"][during & (run.time > 60)] ** 2).mean())
            )
        return 1e3 * math.sqrt(sum(squares) / len(squares))

    return {
        "none": lost(Deaf(own), at=False),
        "telegram": lost(Deaf(own, telegram)),
        "unit": lost(Deaf(own, unit)),
        "cell": lost(Deaf(own, cell)),
        "both": lost(Deaf(own, telegram, cell)),
        "forward": lost(sh.VelocityFeedForward(case, share=1.0)),
        "stuck": lost(Deaf(own, stands=MEASUREMENTS)),
        "held_cell": lost(Deaf(own, stands=("rope.tension",))),
        "heave": lost(Deaf(own, jumps={"mru.heave": 3.0})),
        "depth": lost(Deaf(own, jumps={"payload.displacement": 5.0})),
    }


def steps(effort: Effort) -> dict[str, float]:
    """Return median times of a step, from `mpc_steps.csv` [us]."""
    del effort
    rows = read_rows(DOCS / "data" / "mpc_steps.csv")
    times = [float(row["median"]) for row in rows if row["name"] == "LinearMPC"]
    return {"least": min(times), "most": max(times)}


def tuning(effort: Effort) -> dict[str, float]:
    """Return how long weights take to be tuned, by case [s of the processor]."""
    del effort
    found = {}
    for name in ("thesis-1975", "thesis-1975-rope", "subsea-crane"):
        case = sh.load_case(name)
        began = time.process_time()
        sh.tune_weights(case)
        found[name.replace("-", "_")] = time.process_time() - began
    return {"least": min(found.values()), "most": max(found.values()), **found}


class Listening(sh.LinearMPC):
    """Keeps what the unit shows and what the controller thinks of the sea."""

    def reset(self) -> None:
        """Forget."""
        super().reset()
        self.shown: list[tuple[float, float]] = []
        self.sea: list[FloatArray] = []
        self.foretold: list[FloatArray] = []

    def step(self, measurement: Measurement, time: float) -> float:
        """Do as always, and take notes."""
        command = super().step(measurement, time)
        self.shown.append((measurement["mru.heave"], measurement["mru.heave_rate"]))
        self.sea.append(self.estimator.state[self.model.sea_at].copy())
        if self.predictor is not None:
            self.foretold.append(self.predictor.forecast().displacement)
        return command


@cache
def forecasts(effort: Effort) -> dict[str, float]:
    """Return by how much of the hook's rms the forecasts err [%], by predictor and lead."""
    case, told = winch(), {}
    for name in ("bank", "kalman"):
        listening = Listening(case, weights=weights(), predictor=name)
        (run,) = sh.simulate(case, listening, seeds=1, duration=max(2.0 * effort.seconds, 150.0))
        told[name] = np.array(listening.foretold)
    hook, step = run["hook.heave"], listening.sample_time
    last = round(max(LEADS) / step)
    learning, rows = AdaptiveAR(sample_time=step, horizon=max(LEADS)), []
    for heave, rate in listening.shown:
        learning.update(heave, rate, True, 0.0)
        rows.append(learning.forecast().displacement.copy())
    told["kalman"] = np.array(listening.sea) @ path_of_sea(listening.model, last)[::2].T
    told["ar"] = np.array(rows)
    # From two minutes on: the AR model has learnt by then.
    now = np.arange(round(120.0 / step), hook.size - last)
    found = {}
    for name, paths in told.items():
        for lead in LEADS:
            ahead = round(lead / step)
            error = paths[now, ahead] - hook[now + ahead]
            found[f"{name}{lead:g}"] = 100.0 * float(error.std() / hook.std())
    return found


def pooled(contender: str, height: float, among: str | None = None) -> float:
    """Return a contender's rms in `comparison.csv` [mm], for the seeds of another."""
    rows = comparison.load()
    own = comparison.some(rows, "thesis-1975", contender, height=height)
    keys = comparison.some(rows, "thesis-1975", among or contender, height=height)
    return comparison.pooled(own[key] for key in keys)


def nominal(effort: Effort) -> dict[str, float]:
    """Return what the held drum and MPC leave at 1.25 m."""
    del effort
    return {"held": 1e-3 * pooled("none", 1.25), "mpc": pooled("mpc", 1.25)}


def unit(effort: Effort) -> dict[str, float]:
    """Return what is left where the unit errs by 5 cm and the case says 1 % [mm]."""
    believed = winch()
    slow = {"sensors.mru": {"noise_floor": 0.0, "noise_fraction": 0.0, "drift": 0.05}}
    fast = {"sensors.mru.noise_floor": 0.05}
    return {
        "told": left(believed, mpc(believed), effort),
        "slow": left(believed.replace(slow), mpc(believed), effort),
        "fast": left(believed.replace(fast), mpc(believed), effort),
    }


def delay(effort: Effort) -> dict[str, float]:
    """Return what is left with telemetry that is late [mm], untold and told."""
    believed = winch()

    def late(seconds: float) -> sh.Case:
        return believed.replace({"sensors.telemetry.delay": seconds})

    return {
        "late50": left(late(0.05), mpc(believed), effort),
        "late100": 1e-3 * left(late(0.1), mpc(believed), effort),
        "told100": left(late(0.1), sh.LinearMPC(late(0.1)), effort),
        "told300": left(late(0.3), sh.LinearMPC(late(0.3)), effort),
    }


@cache
def waves(effort: Effort) -> dict[str, float]:
    """Return what is left in waves of another period than it was told [mm]."""
    believed = winch()
    long = believed.replace({"sea.significant_period": 11.0})
    short = believed.replace({"sea.significant_period": 6.5})
    largest = max(
        float(np.abs(run["payload.displacement"][run.time < START]).max())
        for run in sh.simulate(long, mpc(believed), seeds=effort.seeds, duration=START)
    )
    return {
        "told": believed.sea.significant_period,
        "long": left(long, mpc(believed), effort),
        "start": 1e3 * largest,
        "short": left(short, mpc(believed), effort),
        # It has its first model after 45 s, and is good after two minutes.
        "ar": left(long, mpc(believed, predictor="ar"), effort, first=120.0),
        "ar_told": left(believed, mpc(believed, predictor="ar"), effort, first=120.0),
        "bank_told": left(believed, mpc(believed), effort, first=120.0),
    }


@cache
def calm(effort: Effort) -> dict[str, float]:
    """Return what the thesis's gains and MPC leave at 0.6 m [mm], and MPC on the crane."""
    small = winch(0.6)
    crane = sh.load_case("subsea-crane")
    best = sh.optimise_gains(crane, "combined", starts=effort.starts)
    linear = sh.LinearMPC(crane)
    return {
        "thesis": left(small, sh.LinearFeedback(small, THESIS), effort),
        "mpc": left(small, mpc(small), effort),
        "held": left(crane, "none", effort),
        "combined": left(crane, best, effort),
        "crane": left(crane, linear, effort),
        "nonlinear": left(crane, NonlinearMPC(crane, weights=linear.weights), effort),
    }


def high(effort: Effort) -> dict[str, float]:
    """Return what is left at 3.75 m [m], and from which height the torque is above the rating."""
    del effort
    rating = sh.load_case("thesis-1975").winch.drive.torque_continuous
    rows = comparison.load()
    above = []
    for height in comparison.HEIGHTS:
        own = comparison.some(rows, "thesis-1975", "mpc", height=height).values()
        torque = math.sqrt(sum(float(row["torque_rms"]) ** 2 for row in own) / len(own))
        above += [height] if torque > rating else []
    return {
        "mpc": 1e-3 * pooled("mpc", 3.75),
        "floor": 1e-3 * pooled("clairvoyant", 3.75),
        "height": min(above, default=math.nan),
    }


def horizon(effort: Effort) -> dict[str, float]:
    """Return what is left at 2.43 m by the horizon [mm; m with one second]."""
    case = winch(2.43)
    found = {
        f"of{ahead:g}": left(case, mpc(case, horizon=ahead), effort)
        for ahead in (1.0, 2.0, 3.0, 8.0)
    }
    return {**found, "of1": 1e-3 * found["of1"], "of2": 1e-3 * found["of2"]}


def moves(effort: Effort) -> dict[str, float]:
    """Return what the nonlinear and the linear programme leave at 2.43 m, same seeds [mm]."""
    del effort
    return {
        "nonlinear": pooled("nonlinear-mpc", 2.43),
        "linear": pooled("mpc", 2.43, among="nonlinear-mpc"),
    }


SAYINGS = [
    Saying(
        page=PAGE,
        name="steps",
        template="step takes {least:.0f} to {most:.0f} microseconds in Python",
        work=steps,
    ),
    Saying(
        page=PAGE,
        name="tuning",
        template="which takes {least:.0f} to {most:.0f} seconds,",
        work=tuning,
    ),
    Saying(
        page=PAGE,
        name="forecasts",
        template="""| `predictor=` | what it knows | three seconds ahead it errs by |
| --- | --- | --- |
| `"bank"` | the spectrum and a hundred others, all sensors, the errors made | \
{bank3:.0f} % of the hook's rms |
| `"kalman"` | the sea's spectrum, all sensors | {kalman3:.0f} % |
| `"ar"` | the record so far, nothing else | {ar3:.0f} % |""",
        work=forecasts,
    ),
    Saying(
        page=PAGE,
        name="farther",
        template="""
            At 5 s it is {bank5:.0f}, {kalman5:.0f} and {ar5:.0f} %, at 8 s {bank8:.0f},
            {kalman8:.0f} and {ar8:.0f} %:
        """,
        work=forecasts,
    ),
    Saying(
        page=PAGE,
        name="nominal",
        template="(the drum held leaves {held:2} m, MPC {mpc:2} mm)",
        work=nominal,
    ),
    Saying(
        page=PAGE,
        name="unit",
        template="""
            A unit that drifts by 5 cm where the case says 1 % of noise leaves {slow:2} mm instead
            of {told:2} mm; one with *fast* noise of 5 cm {fast:2} mm.
        """,
        work=unit,
    ),
    Saying(
        page=PAGE,
        name="delay",
        template="""
            Telemetry that is 50 ms later than the case says leaves {late50:2} mm; 100 ms later,
            with a case that says none, and the loop is unstable ({late100:2} m). Enter what it
            may be: designed for 100 ms it leaves {told100:2} mm, for 300 ms {told300:2} mm.
        """,
        work=delay,
    ),
    Saying(
        page=PAGE,
        name="waves",
        template="""
            In waves of 11 s, told {told:2} s, it leaves {long:2} mm once it is under way, but
            up to {start:2} mm in the first half minute; in waves of 6.5 s {short:2} mm. With
            `"ar"` the 11 s leave {ar:2} mm, once it has learnt.
        """,
        work=waves,
    ),
    Saying(
        page=PAGE,
        name="learnt",
        template="{ar_told:2} mm where the spectrum is as told, for {bank_told:2} mm",
        work=waves,
    ),
    Saying(
        page=PAGE,
        name="calm",
        template="""
            At 0.6 m the thesis's gains leave {thesis:2} mm on this winch, MPC {mpc:2} mm: both
            are nothing. On `subsea-crane`, whose motor is strong enough, MPC leaves {crane:2} mm
            of {held:.0f} mm where the best linear structure leaves {combined:2} mm:
        """,
        work=calm,
    ),
    Saying(
        page=PAGE,
        name="high",
        template="""
            At 3.75 m it leaves {mpc:2} m, and the floor is {floor:2} m. The torque's rms is
            above the rating from {height:.3g} m on:
        """,
        work=high,
    ),
    Saying(
        page=PAGE,
        name="horizon",
        template="""
            With a second of it {of1:2} m are left at 2.43 m, with two {of2:2} m, with three
            {of3:2} mm, with eight {of8:2} mm: below some three seconds
        """,
        work=horizon,
    ),
    Saying(
        page=PAGE,
        name="moves",
        template="({nonlinear} and {linear} mm at 2.43 m)",
        work=moves,
    ),
    Saying(
        page=PAGE,
        name="drives",
        template=_drives_table(),
        work=drives,
    ),
    Saying(
        page=PAGE,
        name="outages",
        template="""
            On `subsea-crane` a minute without telemetry leaves {telegram:2} mm, one without
            reference unit {unit:2}, without load cell {cell:2}, without telemetry and load cell
            {both:2}, where {none:2} mm are left with all of them and feed-forward leaves
            {forward:2}. Payload sensors that stand still leave {stuck:2} mm, a load cell that does
            {held_cell:2}, a heave that is 3 m off in one sample of five {heave:2}, and a depth that
            is 5 m off {depth:2}.
        """,
        work=outages,
    ),
    Saying(
        page=PAGE,
        name="crane-moves",
        template="""
            on `subsea-crane` they leave {nonlinear:2} mm where this leaves {crane:2}.
        """,
        work=calm,
    ),
]


def main(argv: Sequence[str] | None = None) -> int:
    """Find them and put them into the page."""
    warnings.simplefilter("ignore", PhysicsWarning)
    return tell(SAYINGS, FILE, sayings_parser(__doc__).parse_args(argv))


if __name__ == "__main__":
    raise SystemExit(main())
