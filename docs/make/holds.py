"""What the toolkit calls ok, simulated: `make holds`, or this script with ``--rows A:B``.

Every design that is ok on the bundled cases (four depths, three seas) and on 200 random ones is
simulated for 3 h with noise, losses, friction and limits on, a tenth of the random ones ten times.
The bundled cases are asked for the five structures that are tried by default, each random one for
one of these in turn.
What the design prints and what the simulation shows stand side by side in `docs/data/holds.csv`, a
row a design; `holds_page.py` judges them and writes `docs/holds.md`.

It takes hours, and can be stopped at any time: rows that are there and that the same code has made
are not made again, older ones last of all.  Where only what a design prints has changed, and not
the design, ``--printed`` tells that anew beside the runs that are there, in minutes.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import math
import time
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from stored import digest_of, docs_folder, read_rows, study_parser, write_rows

import stillhook as sh
from models import Case, load_case
from models.basics import (
    GRAVITY,
    FloatArray,
    InputError,
    PhysicsWarning,
    StillhookError,
)
from models.hook import HookDemand
from models.plant import MAX_MASSES, PlantData
from models.rig.winch import DrumGeometry
from models.run.summary import Statistics
from models.sensing import MruModel
from stillhook.keeper import Died, Processes, usable_cores
from synth.design import Design
from synth.limits import PAYLOAD
from synth.question import pose

SCRIPT = "docs/make/holds.py"
CSV = Path(__file__).resolve().parents[1] / "data" / "holds.csv"

NESTED = (
    "payload-feedback",
    "payload-feedback-rolloff",
    "drum-feedback",
    "feed-forward",
    "combined",
)
BUNDLED = ("subsea-crane", "landing", "thesis-1975-rope", "thesis-1975")
DEPTHS = (100.0, 300.0, 1000.0, 2000.0)  # [m]
SEAS = ((0.6, 0.85), (1.0, 1.0), (1.4, 1.15))  # shares of the case's own H_s and period
RANDOM = 200
TENTH = 10  # one random case in so many is simulated as many times
NEAR, ERRORS = 0.03, 3.0  # a deviation may be off by so much, or by so many standard errors
#: Rope masses that a simulation is tried with, beside those that the case asks for, and by how much
#: what is printed may be another on them than on the design's own.
MASSES, SAME = (8, 12, 16, 24), 0.002
AGAIN = 3  # times as many runs where one is further off, so that chance is told from a defect
FIRST_RANDOM = len(BUNDLED) * len(DEPTHS) * len(SEAS)
COUNT = FIRST_RANDOM + RANDOM
STRIDE = 89  # from one question to the next: a study that was stopped says something of every kind

EXPOSURE = 10_800.0  # [s]
SETTLE = 600.0  # three periods of the reference unit's filter [s]
SPARE = 500.0  # rope left on the drum of a random winch [m]
STEEPEST = 0.05  # 2 pi H_s/(g T_p^2) of a random sea; seas break near 0.067
BREAKING = 1022e6  # breaking load of wire rope over its diameter squared [Pa] (MoorPy)
MASS = 5293.0  # its mass [kg/m] ...
WEIGHT = 40_920.0  # ... and its weight in the water [N/m], over the same

#: Signals by the words that head their columns: in the plant, and the limits on their extremes.
SIGNALS: Mapping[str, tuple[str, str, str]] = {
    "payload": (PAYLOAD, "", ""),
    "torque": ("motor.torque", "motor.torque.peak", ""),
    "speed": ("motor.speed", "motor.speed.peak", ""),
    "voltage": ("motor.voltage", "motor.voltage.peak", ""),
    "current": ("motor.current", "motor.current.peak", ""),
    "tension": ("rope.tension", "rope.tension.peak", "rope.tension.least"),
    "lower": ("rope.lower_tension", "", "rope.lower_tension.least"),
}
#: What is printed and what is found of a signal: deviations, the relative standard error of the
#: one that is found, and dynamic parts of the extremes, above and below what is static.
FIGURES = ("sigma", "found", "error", "up", "ups", "down", "downs")
POWER = ("power.up", "power.ups")
KEYS = ("question", "case", "law", "depth", "mass", "delay", "H_s", "T_p", "structure")
COLUMNS = (
    *KEYS,
    "ok",
    "status",
    "masses",
    "runs",
    "again",
    "coherent",
    "saturated",
    "slack",
    "trips",
    "growth_hysteretic",
    "growth_kelvin-voigt",
    *(f"{signal}.{figure}" for signal in SIGNALS for figure in FIGURES),
    *POWER,
    "parameters",
    "seconds",
    "code",
)

Row = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Question:
    """A case that designs are asked for; it can be hashed and pickled.

    Attributes
    ----------
    number
        From 0: first the bundled cases, then the random ones.
    name
        The bundled case, or `random`.
    """

    number: int
    name: str

    @property
    def group(self) -> None:
        """Nothing is prepared for several of them."""
        return None

    @property
    def structure(self) -> str | None:
        """The structure that is asked for; None for all that are tried by default."""
        if self.number < FIRST_RANDOM:
            return None
        return NESTED[(self.number + self.number // TENTH) % len(NESTED)]

    @property
    def asked(self) -> tuple[float, float, float]:
        """Depth [m], and shares of H_s and period of the bundled case; NaN of a random one."""
        if self.number >= FIRST_RANDOM:
            return math.nan, math.nan, math.nan
        place = self.number % (len(DEPTHS) * len(SEAS))
        return DEPTHS[place // len(SEAS)], *SEAS[place % len(SEAS)]

    @property
    def case(self) -> Case:
        """The case.

        Raises
        ------
        InputError
            If there is no such case: a load at rest that its winch cannot hold.
        """
        if self.number >= FIRST_RANDOM:
            return random_case(self.number)
        case, (depth, height, period) = load_case(self.name), self.asked
        field = "sea.significant_period" if "thesis" in self.name else "sea.peak_period"
        own = getattr(case.sea, field.removeprefix("sea."))
        changes: dict[str, Any] = {
            "limits.drive": "enforce",
            "rope.length": depth,
            "sea.significant_height": height * case.sea.significant_height,
            field: period * own,
        }
        if case.winch.drum.radius is None:
            geometry = case.winch.drum.geometry
            assert geometry is not None
            rope = case.winch.drum.rope_on_drum_total or 0.0
            total = max(rope, depth + rope - case.rope.length)
            size = geometry.core_diameter, geometry.width
            layers = max(geometry.layers, layers_for(*size, case.rope.diameter, total))
            changes |= _rope_on(total, layers)
        return case.replace(changes)


def questions(rows: range | None = None) -> list[Question]:
    """Return the questions with some numbers, by default all."""
    depths = len(DEPTHS) * len(SEAS)
    names = [name for name in BUNDLED for _ in range(depths)] + ["random"] * RANDOM
    return [Question(number=k, name=names[k]) for k in rows or range(COUNT)]


def layers_for(core: float, width: float, diameter: float, total: float) -> int:
    """Return how many layers of rope of a diameter a drum needs to hold so much [m]."""
    for layers in range(1, 61):
        drum = DrumGeometry(core_diameter=core, width=width, layers=layers)
        if drum.table(diameter)[-1].rope_on_drum >= total:
            return layers
    raise InputError(f"a drum of {core:.3g} m cannot hold {total:.5g} m of rope")


def _rope_on(total: float, layers: int) -> dict[str, Any]:
    return {"winch.drum.rope_on_drum_total": total, "winch.drum.geometry.layers": layers}


def random_case(number: int) -> Case:
    """Return a random case, the same for the same number whatever else has been drawn.

    Depth, load and sea come first, then the rope for the load, and a winch for rope and sea; the
    ranges and their reasons are on the page.
    """
    rng = np.random.default_rng([15, number])

    def within(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    def among(low: float, high: float) -> float:
        return math.exp(within(math.log(low), math.log(high)))

    depth, mass = among(50.0, 3000.0), among(5e3, 200e3)
    height, period = 4.0, 5.0
    while 2.0 * math.pi * height / (GRAVITY * period**2) > STEEPEST:
        height, period = within(1.0, 4.0), within(5.0, 14.0)
    weight = within(0.6, 0.87) * mass * GRAVITY
    side = (mass / among(300.0, 1500.0)) ** (1.0 / 3.0)
    changes: dict[str, Any] = {
        "name": f"random-{number}",
        "sea.significant_height": height,
        "sea.peak_period": period,
        "sea.gamma": within(1.0, 5.0),
        "vessel.hook": {"x": within(-35.0, 0.0), "y": within(-14.0, 14.0), "z": within(12.0, 25.0)},
        "vessel.heading": math.radians(
            within(120.0, 240.0) if rng.random() < 0.8 else within(0.0, 360.0)
        ),
        "payload.mass": mass,
        "payload.added_mass": within(0.3, 0.7) * 1025.0 * side**3,
        "payload.area": within(0.5, 1.0) * side**2,
        "payload.drag_coefficient": within(1.2, 2.5),
        "payload.submerged_weight": weight,
    }
    safety = within(4.0, 6.0)
    diameter = math.sqrt(safety * weight / (BREAKING - safety * WEIGHT * depth))
    core, width = within(25.0, 40.0) * diameter, within(30.0, 50.0) * diameter
    total = depth + SPARE
    changes |= {
        "rope.diameter": diameter,
        "rope.axial_stiffness": within(50e9, 85e9) * math.pi / 4.0 * diameter**2,
        "rope.mass_per_length": MASS * diameter**2,
        "rope.submerged_weight_per_length": WEIGHT * diameter**2,
        "rope.length": depth,
        "rope.damping_ratio": among(0.001, 0.01),
        "rope.sheaves": int(rng.integers(1, 4)),
        "rope.sheave_efficiency": within(0.96, 0.99),
        "rope.skin_drag_coefficient": within(0.0, 0.015),
        "crane.tip_stiffness": among(1e6, 2e7),
        "rigging.stiffness": weight / within(0.01, 0.05) if rng.random() < 0.5 else None,
        "rigging.block_mass": within(0.0, 0.05) * mass,
        "limits.rope_tension_peak": BREAKING * diameter**2 / 3.0,
        "winch.drum.geometry.core_diameter": core,
        "winch.drum.geometry.width": width,
        **_rope_on(total, layers_for(core, width, diameter, total)),
        **_sensors(rng, within, among),
        "limits.drive": "report",  # until there is a winch
    }
    return _with_winch(load_case("subsea-crane").replace(changes), within)


def _sensors(rng: np.random.Generator, within: Any, among: Any) -> dict[str, Any]:
    """Return sensors and delays: as makers state them, half of the reference units as a noise."""
    found: dict[str, Any] = {
        "sensors.payload.bandwidth": 2.0 * math.pi * within(5.0, 20.0),
        "sensors.payload.acceleration_noise": among(20e-6, 100e-6) * GRAVITY,
        "sensors.payload.velocity_noise": among(1e-3, 4e-3),
        "sensors.payload.displacement_noise": among(1e-3, 4e-3),
        "sensors.telemetry.delay": among(0.01, 0.3),
        "sensors.mru.heave_filter_period": within(100.0, 300.0),
        "sensors.mru.delay": within(0.0, 0.04),
        "winch.drive.command_delay": within(0.0, 0.02),
    }
    if rng.random() < 1.0 / 3.0:
        found["sensors.payload.velocity_rate"] = 2.0 * math.pi * float(rng.choice([5.0, 10.0]))
        found["sensors.payload.displacement_rate"] = 2.0 * math.pi * 10.0
    stated, drawn = rng.random() < 0.5, [within(0.0, high) for high in (0.035, 2.0, 0.05, 1e-4)]
    return found | {
        "sensors.mru.noise_floor": 0.0 if stated else 0.05,
        "sensors.mru.noise_fraction": 0.0 if stated else 0.05,
        "sensors.mru.gain_error": stated * drawn[0],
        "sensors.mru.phase_error": stated * math.radians(drawn[1]),
        "sensors.mru.drift": stated * drawn[2],
        "sensors.mru.drift_period": 100.0,
        "sensors.mru.noise": stated * drawn[3],
    }


def _with_winch(case: Case, within: Any) -> Case:
    """Return a case with a winch of the size that its load and its hook's speed ask for."""
    fastest = HookDemand.from_case(case).velocity.most_probable_maximum(EXPOSURE)
    radius, pull = case.drum_radius, case.static_tension
    efficiency = within(0.88, 0.95)
    losses = efficiency * case.rope.sheaves_efficiency
    base, most = within(1000.0, 1500.0) * math.pi / 30.0, within(1.4, 2.0)
    rope_speed = max(within(1.2, 1.7) * fastest, 0.5)
    ratio = most * base * radius / rope_speed
    held = pull * radius / (ratio * losses)
    rating = within(1.2, 1.5) * held
    inertia = within(0.6, 1.4) * 20.0 * (rating / 8e3) ** 1.4
    drum = within(0.5, 1.5) * 40e3 * pull / 524e3 * (radius / 1.07) ** 2
    return case.replace(
        {
            "limits.drive": "enforce",
            "winch.drum.inertia": drum,
            "winch.gearbox.ratio": ratio,
            "winch.gearbox.efficiency": efficiency,
            "winch.gearbox.inertia": 0.1 * inertia,
            "winch.motor.kind": "induction" if within(0.0, 1.0) < 0.5 else "permanent-magnet",
            "winch.motor.base_speed": base,
            "winch.motor.maximum_speed": most * base,
            "winch.motor.inertia": inertia,
            "winch.motor.torque_bandwidth": within(100.0, 300.0),
            "winch.motor.speed_gain": within(15.0, 25.0) * (1.1 * inertia + drum / ratio**2),
            "winch.motor.viscous_friction": 0.01 * rating / base,
            "winch.motor.coulomb_friction": within(0.0, 0.02) * rating,
            "winch.drive.torque_continuous": rating,
            "winch.drive.torque_peak": within(1.6, 2.2) * rating,
            "winch.drive.power": within(1.3, 2.0) * held * fastest * ratio / radius,
        }
    )


class Bench:
    """Answers questions, in a process of its own.

    Parameters
    ----------
    starts
        Of each search.
    hours
        Of each simulation.
    """

    def __init__(self, starts: int = 16, hours: float = 3.0) -> None:
        self._starts, self._exposure = starts, 3600.0 * hours

    def do(self, question: Question, progress: object = None) -> list[Row]:
        """Return the rows of a question: of every structure that it was answered with."""
        del progress
        warnings.simplefilter("ignore", PhysicsWarning)
        key: Row = {"question": question.number, "case": question.name}
        try:
            case = question.case
            key |= _key_of(case) | {"structure": question.structure or ""}
            began = time.process_time()
            # Each of several structures has half of the starts.
            starts = self._starts if question.structure is None else -(-self._starts // 2)
            found = sh.optimise_gains(case, question.structure, starts=starts)
        except StillhookError as error:
            depth = f"{question.asked[0]:.5g}"
            return [{"depth": depth} | key | {"ok": "no", "status": str(error)}]
        designs = (found, *found.alternatives)
        each = (time.process_time() - began) / len(designs)
        return [
            key | self._row(question, case, design, each)
            for design in sorted(designs, key=lambda one: one.structure)
        ]

    def _row(self, question: Question, case: Case, design: Design, seconds: float) -> Row:
        began = time.process_time()
        row: Row = {
            "structure": design.structure,
            "ok": "yes" if design.ok else "no",
            "status": design.status,
            "parameters": " ".join(f"{k}={v:.9g}" for k, v in design.parameters.items()),
        }
        if design.ok:
            try:
                row |= growths(design)
                row |= simulated(design, seeds_of(question, case, design.structure), self._exposure)
            except StillhookError as error:
                row["status"] = f"not simulated: {error}"
        return row | {"seconds": f"{seconds + time.process_time() - began:.1f}"}


def _key_of(case: Case) -> Row:
    return {
        "law": case.rope.damping_law,
        "depth": f"{case.rope.length:.5g}",
        "mass": f"{case.payload.mass:.5g}",
        "delay": f"{case.sensors.telemetry.delay + case.winch.drive.command_delay:.4g}",
        "H_s": f"{case.sea.significant_height:.4g}",
        "T_p": f"{case.sea.spectral_peak_period:.4g}",
    }


def seeds_of(question: Question, case: Case, structure: str) -> list[int]:
    """Return the seeds of the runs of a design: one, ten, or one for each pair of signs.

    Every structure has its own, so that the largest waves of one sea do not count five times.

    A reference unit's gain and phase error have signs that stay for a run, and what is printed is
    the root mean square over them: so such a case is simulated with each pair of signs.
    """
    first = 10_000 * question.number + 1000 * NESTED.index(structure)
    ten = question.number >= FIRST_RANDOM and question.number % TENTH == 0
    mru = case.sensors.mru
    if mru is None or mru.coherent == 0.0:
        return list(range(first, first + (10 if ten else 1)))
    found: dict[tuple[float, float], list[int]] = {}
    each = 3 if ten else 1
    for seed in range(first, first + 1000):
        own = found.setdefault(MruModel(mru, 1.0, 1.0, seed).signs, [])
        if len(own) < each:
            own.append(seed)
        if len(found) == 4 and all(len(seeds) == each for seeds in found.values()):
            break
    return sorted(chain.from_iterable(found.values()))


def growths(design: Design) -> Row:
    """Return the growth of the slowest mode at the rope's least damping, under both laws [1/s].

    Drag is that of the design, and losses do not damp.
    """
    found = {}
    for law in ("hysteretic", "kelvin-voigt"):
        case = design.case.replace(
            {
                "rope.damping_law": law,
                "rope.damping_ratio": design.case.rope.least_damping_ratio,
                "payload.drag": {"method": "given", "coefficient": design.drag},
            }
        )
        masses = design.masses if case.rope.lumping == "thesis" else 2 * design.masses
        posed = pose(case, design.structure, min(masses, MAX_MASSES), built_for=design.case)
        found[f"growth_{law}"] = f"{posed.problem.growth(posed.values(design.parameters)):.4g}"
    return found


def simulated(design: Design, seeds: Sequence[int], exposure: float = EXPOSURE) -> Row:
    """Return what a design prints and what runs of it show.

    Where a standard deviation is further off than `NEAR` and `ERRORS` allow, three times as many
    runs follow, and deviations are those of all; extremes are of the first runs, or those that
    were looked at twice would count more.
    """
    settle = min(SETTLE, exposure)
    # A drag that a case gives is that of its plant, and no coefficient of the shape besides.
    given = design.case.payload.fixed_drag
    drag = {} if given is None else {"payload.linear_drag": given, "payload.quadratic_drag": 0.0}
    masses = fewest_masses(design)

    def told(seeds: Sequence[int]) -> tuple[list[Statistics], int]:
        runs = sh.simulate(
            design.case,
            design,
            seeds=seeds,
            duration=settle + exposure,
            settle=settle,
            traces="worst",
            store_step=10.0,
            parameters=drag,
            masses=masses,
        )
        return (
            [run.statistics for run in runs],
            sum(run.status != "completed" for run in runs) + runs.tripped,
        )

    first, trips = told(seeds)
    found = deviations(design, first)
    again: list[Statistics] = []
    if any(abs(off) > may for off, may in found.values()):
        for round_ in range(1, AGAIN + 1):
            more, broken = told([seed + 100 * round_ for seed in seeds])
            again, trips = again + more, trips + broken
    mru = design.case.sensors.mru
    row: Row = {
        "masses": masses,
        "runs": len(first),
        "again": len(again),
        "coherent": "yes" if mru is not None and mru.coherent > 0.0 else "no",
        "saturated": f"{np.mean([one.value('saturated share') for one in first + again]):.4g}",
        "slack": f"{np.mean([one.value('slack share') for one in first + again]):.4g}",
        "trips": trips,
    }
    for word in signals_in(design, first[0]):
        signal = SIGNALS[word][0]
        printed, sigma = design.switched.deviation(signal), found_sigma(first + again, signal)
        row |= {f"{word}.sigma": f"{printed:.5g}", f"{word}.found": f"{sigma:.5g}"}
        length = sum(one.duration for one in first + again)
        row[f"{word}.error"] = f"{relative_error(design, signal, length):.3g}"
        for way, (most, values) in extremes_of(design, word, first, exposure).items():
            row |= {
                f"{word}.{way}": f"{most:.5g}",
                f"{word}.{way}s": " ".join(f"{value:.4g}" for value in values),
            }
    if "motor.power.peak" in design.limits:
        largest = (one["motor.power"].largest for one in first)
        row |= {
            "power.up": f"{design.limits['motor.power.peak'].value:.5g}",
            "power.ups": " ".join(f"{value:.4g}" for value in largest),
        }
    return row


def printed(row: Row) -> Row:
    """Return a row with what its design prints today, beside the runs that are there."""
    parts = (part.split("=") for part in row["parameters"].split())
    (question,) = questions(range(int(row["question"]), int(row["question"]) + 1))
    gains = {name: float(value) for name, value in parts}
    design = sh.evaluate_gains(question.case, gains, row["structure"])
    length = EXPOSURE * (int(row["runs"]) + int(row["again"]))
    found = dict(row)
    for word in (word for word in SIGNALS if row[f"{word}.sigma"]):
        signal = SIGNALS[word][0]
        found[f"{word}.sigma"] = f"{design.switched.deviation(signal):.5g}"
        found[f"{word}.error"] = f"{relative_error(design, signal, length):.3g}"
        for way, (most, _) in extremes_of(design, word, []).items():
            found[f"{word}.{way}"] = f"{most:.5g}"
    return found


def signals_in(design: Design, told: Statistics) -> list[str]:
    """Return the words of the signals that are looked at: the payload's, and what is limited."""
    return [
        word
        for word, (signal, peak, least) in SIGNALS.items()
        if signal in told.signals
        and (signal == PAYLOAD or peak in design.limits or least in design.limits)
    ]


def fewest_masses(design: Design) -> int:
    """Return the fewest rope masses on which deviations and M_s are those of the design's own.

    They are no fewer than a simulation has by itself.  It takes the square of their number in
    time, and most of those that a loop is made on hold modes far above all that moves.
    """
    own, least = design.question.masses, PlantData.from_case(design.case).chosen_masses()
    signals = [
        PAYLOAD,
        *(one for one, peak, least in SIGNALS.values() if {peak, least} & {*design.limits}),
    ]

    def printed(design: Design) -> FloatArray:
        margins = design.assessment.margins
        return np.array([margins.max_sensitivity, *map(design.switched.deviation, signals)])

    wanted = printed(design)
    for masses in (least, *(more for more in MASSES if least < more < own)):
        found = replace(design, masses=masses)
        if np.all(np.abs(printed(found) / wanted - 1.0) <= SAME):
            return masses
    return own


def found_sigma(told: Sequence[Statistics], signal: str) -> float:
    """Return the standard deviation of a signal in runs, about the mean of each."""
    return math.sqrt(np.mean([one[signal].standard_deviation ** 2 for one in told]))


def deviations(design: Design, told: Sequence[Statistics]) -> dict[str, tuple[float, float]]:
    """Return by how much each standard deviation is off, and by how much it may be, relative."""
    found, length = {}, sum(one.duration for one in told)
    for word in signals_in(design, told[0]):
        signal = SIGNALS[word][0]
        off = found_sigma(told, signal) / design.switched.deviation(signal) - 1.0
        found[word] = off, max(NEAR, ERRORS * relative_error(design, signal, length))
    return found


def extremes_of(
    design: Design, word: str, told: Sequence[Statistics], exposure: float = EXPOSURE
) -> dict[str, tuple[float, list[float]]]:
    """Return the dynamic parts of extremes up and down: the printed one, and those of the runs.

    A limit has the loss that switches in full; printed is what is most probable, which is less.
    A signal that is at rest at zero has one limit, and goes as far either way.  Of a reference unit
    with gain and phase errors it is as much more as the limit's worst signs are.
    """
    signal, peak, least = SIGNALS[word]
    rest = design.question.plant.static.get(signal, 0.0) if signal != PAYLOAD else 0.0
    still = peak in design.limits and abs(rest) < 1e-9 * design.limits[peak].value
    limits = {one.name: one for one in (*design.question.limits, *design.question.reported)}
    found = {}
    for way, name in (("up", peak), ("down", peak if still else least)):
        sign = 1 if way == "up" else -1
        ends = (one[signal].maximum if way == "up" else one[signal].minimum for one in told)
        values = [sign * (end - rest) for end in ends]
        if signal == PAYLOAD or name in design.limits:
            most = design.switched.extreme(signal, exposure, sign)
            if name in design.limits:
                limit, loop = limits[name], design.assessment
                own = abs(getattr(limit, "static", 0.0))
                most *= (limit.worst(loop) - own) / (limit.measure(loop) - own)
            found[way] = most, values
    return found


def relative_error(design: Design, signal: str, duration: float) -> float:
    """Return the relative standard error of a standard deviation from so long a record [s].

    Of a Gaussian signal of the printed spectrum, var(s^2) = (2 pi/T) int S^2 domega (Bartlett).
    """
    nodes, density = design.switched.spectrum(signal)
    power = nodes.integrate(density**2)
    return float(0.5 * math.sqrt(2.0 * math.pi * power / duration) / nodes.integrate(density))


class Book:
    """The rows of the study, on disk after every question.

    Parameters
    ----------
    path
        The file.
    code
        Digest of the code that makes rows now.
    """

    def __init__(self, path: Path, code: str) -> None:
        self.path, self.code = path, code
        rows = read_rows(path) if path.exists() else []
        self.rows: dict[int, list[Row]] = {}
        for row in rows:
            self.rows.setdefault(int(row["question"]), []).append(row)

    def left(self, asked: Iterable[Question]) -> list[Question]:
        """Return what is to be done: what is not there first, then what other code made."""
        asked = sorted(asked, key=lambda q: q.number * STRIDE % COUNT)
        missing = [q for q in asked if q.number not in self.rows]
        older = [
            q
            for q in asked
            if q.number in self.rows
            and any(row["code"] != self.code for row in self.rows[q.number])
        ]
        return [*missing, *older]

    def keep(self, question: Question, rows: Sequence[Row]) -> None:
        """Take the rows of a question, and write all."""
        self.rows[question.number] = [{"code": self.code, **row} for row in rows]
        self.write()

    def write(self) -> None:
        """Write all."""
        told = chain.from_iterable(self.rows[k] for k in sorted(self.rows))
        write_rows(self.path, COLUMNS, told, "SI units; see docs/holds.md.")


def work(book: Book, asked: Sequence[Question], bench: Bench, jobs: int) -> None:
    """Answer questions in processes, and keep the rows of each as they come."""
    todo = book.left(asked)
    print(f"{len(todo)} of {len(asked)} questions to do, {jobs} processes", flush=True)
    if not todo:
        return
    began = time.perf_counter()
    with Processes(jobs).begin(bench, len(todo)) as pool:
        for done, got in enumerate(filter(None, pool.answers(iter(todo))), 1):
            question, rows = got
            if isinstance(rows, Died):
                rows = [
                    {"question": question.number, "case": question.name}
                    | {"ok": "no", "status": f"died: {rows.reason}"}
                ]
            book.keep(question, rows)
            seconds = time.perf_counter() - began
            ok = sum(row["ok"] == "yes" for row in rows)
            print(
                f"{question.number} {question.name}: {ok} of {len(rows)} ok "
                f"({done} of {len(todo)}, {seconds / 60.0:.1f} min)",
                flush=True,
            )


def print_anew(book: Book, numbers: Iterable[int]) -> None:
    """Renew what the designs of a book print."""
    warnings.simplefilter("ignore", PhysicsWarning)
    for number in sorted(set(numbers) & set(book.rows)):
        rows = book.rows[number]
        anew = [printed(row) if row["runs"] else row for row in rows]
        book.rows[number] = [{**row, "code": book.code} if row["runs"] else row for row in anew]
        print(f"{number} {rows[0]['case']}", flush=True)
    book.write()


def main(argv: Sequence[str] | None = None) -> None:
    """Run what is left of the study, then write its page."""
    parser = study_parser(__doc__)
    parser.add_argument("--rows", default="", help="A:B, questions from number A to before B")
    parser.add_argument("--printed", action="store_true", help="what designs print, and no runs")
    parser.add_argument("--jobs", type=int, default=usable_cores(), help="processes")
    given = parser.parse_args(argv)
    path = docs_folder(given.quick) / "data" / CSV.name
    chosen = range(COUNT)
    if given.rows:
        first, _, last = given.rows.partition(":")
        chosen = range(int(first or 0), min(int(last or COUNT), COUNT))
    elif given.quick:
        chosen = range(4, 5)
    if given.printed:
        print_anew(Book(path, digest_of(SCRIPT)), chosen)
        return
    bench = Bench(starts=4, hours=0.5) if given.quick else Bench()
    try:
        work(Book(path, digest_of(SCRIPT)), questions(chosen), bench, given.jobs)
    except KeyboardInterrupt:
        print("stopped; the same command goes on", flush=True)
        raise SystemExit(130) from None
    except InputError as error:
        raise SystemExit(str(error)) from None


if __name__ == "__main__":
    import holds  # by name, so that other processes find it

    holds.main()
