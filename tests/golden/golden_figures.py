"""The golden figures, group by group: what the toolkit computes from the frozen cases.

Each group is a function that fills a `Figures`.  Cases come from `cases/`, never from the bundled
ones, gains and parameters stand here as numbers, so that a later search that ends elsewhere moves
no evaluation.  `figures.csv` and `commands.csv` hold what they were, `make.py` compares.
"""

from __future__ import annotations

import math
import sys
import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from other_conventions import first_column, headings, written

import stillhook as sh
from models import HookMotion, SeaSpectrum, build_plant, fixed_top_modes, line_response
from models.basics.metrics import most_probable_maximum, peak_factor
from models.basics.quadrature import spectral_nodes
from models.operation.excitation import SpectrumMotion
from models.plant.drag import consistent_drag, stochastic_equivalent
from models.plant.plant import MEAN_LOSSES
from models.rig import energy_equivalent
from models.run.extremes import gumbel_maximum
from models.sea.spreading import Spreading
from models.sensing import MEASURED
from models.vessel.convention import Convention
from stillhook.controllers.named import controller_by_name
from synth.loop.assess import Assessment
from synth.question.question import pose

HERE = Path(__file__).parent

#: Relative tolerances by kind: an evaluation, a series of commands, an optimum's cost, a text.
TOLERANCES = {"evaluation": 1e-9, "command": 1e-9, "optimum": 1e-6, "text": 0.0}

PAYLOAD, HAUL, HOOK = "payload.displacement", "drum.haul", "hook.heave"
THESIS_GAINS = {"A": 200.0, "a": 50.0, "a1": 100.0, "a2": 100.0}
CRANE_GAINS = {"A": 1.0, "a": 16.02, "a1": 44.36, "a2": 6.416}
ROPE_GAINS = {"A": 200.0, "a": 3.0, "a1": -0.6, "a2": 0.05}
LATE_GAINS = {"A": 1.0, "a": 4394.0, "a1": 2393.0, "a2": 13691.0}
NOISY_UNIT = {"noise_floor": 0.0, "noise_fraction": 0.01, "noise_bandwidth": 11.31}
WEIGHTS = {
    "thesis-1975": {
        "torque": 0.03,
        "noise": {"force": 0.06, "torque": 0.01, "rope": 0.5, "sensors": 2e-4},
    },
    "subsea-crane": {
        "torque": 0.03,
        "noise": {"force": 0.06, "torque": 0.02, "rope": 0.7, "sensors": 3e-4},
    },
}


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A figure: a number or a text, how closely it must be met, and a note.

    `elsewhere` is the tolerance where the BLAS has other kernels than those that the golden
    figures were made with: some figures lie behind an ill-conditioned fit.
    """

    value: float | str
    kind: str = "evaluation"
    tolerance: float = TOLERANCES["evaluation"]
    elsewhere: float = TOLERANCES["evaluation"]
    note: str = ""


@dataclass
class Figures:
    """Figures by name, and series of equal length by name."""

    rows: dict[str, Figure] = field(default_factory=dict)
    series: dict[str, np.ndarray] = field(default_factory=dict)

    def put(
        self,
        name: str,
        value: Any,
        kind: str = "evaluation",
        *,
        tolerance: float | None = None,
        elsewhere: float | None = None,
        note: str = "",
    ) -> None:
        """Add a figure."""
        if name in self.rows:
            raise ValueError(f"two figures are called {name}")
        tolerance = TOLERANCES[kind] if tolerance is None else tolerance
        self.rows[name] = Figure(
            value=str(value) if kind == "text" else float(value),
            kind=kind,
            tolerance=tolerance,
            elsewhere=tolerance if elsewhere is None else elsewhere,
            note=note,
        )

    def all(self, prefix: str, values: Mapping[str, Any], kind: str = "evaluation") -> None:
        """Add the numbers of a mapping."""
        for name, value in values.items():
            self.put(f"{prefix}.{name}", value, kind)


@dataclass(frozen=True, kw_only=True)
class Group:
    """A function that computes figures, and whether it takes long."""

    name: str
    fill: Callable[[Figures], None]
    slow: bool

    def figures(self) -> Figures:
        """Return the figures; that a case is at the edge of its physics is no matter here."""
        found = Figures()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", sh.PhysicsWarning)
            self.fill(found)
        return found


GROUPS: dict[str, Group] = {}


def group(*, slow: bool = False) -> Callable[[Callable[[Figures], None]], Any]:
    """Make a function a group; its name is the first word of its figures' names."""

    def keep(fill: Callable[[Figures], None]) -> Callable[[Figures], None]:
        name = fill.__name__
        GROUPS[name] = Group(name=name, fill=fill, slow=slow)
        return fill

    return keep


@cache
def case(name: str) -> sh.Case:
    """Return a frozen case."""
    return sh.load_case(HERE / "cases" / f"{name}.yaml")


def changed(name: str, **changes: object) -> sh.Case:
    """Return a frozen case with fields changed; `__` stands for a dot."""
    return case(name).replace({path.replace("__", "."): v for path, v in changes.items()})


def thesis_design() -> sh.Design:
    """Return the thesis's gains on its own model."""
    return sh.evaluate_gains(case("thesis-1975"), THESIS_GAINS)


def magnitudes(found: Figures, prefix: str, labels: Iterable[object], values: Any) -> None:
    """Add absolute values, one figure each."""
    for label, value in zip(labels, np.abs(values), strict=True):
        found.put(f"{prefix}.{label}", value)


def sized(values: Any) -> Iterable[float]:
    """Return complex numbers' absolute values in ascending order, conjugates once."""
    z = np.asarray(values)
    return sorted(float(abs(v)) for v in z if v.imag >= 0.0)


# --- the thesis ---------------------------------------------------------------------------------


@group()
def thesis(found: Figures) -> None:
    """Tables 5 and 7 to 9, Figure 32 and what was found since."""
    one = case("thesis-1975")
    hook, design = HookMotion.from_case(one), thesis_design()
    loop, question = design.assessment, pose(one)
    omega7 = np.array([0.1, 0.4, 0.8, 1.2, 2.0, 5.8, 7.6, 10.0])
    magnitudes(found, "thesis.table_7", omega7, loop.response(PAYLOAD, HOOK, omega7))
    magnitudes(found, "thesis.haul_ratio", omega7, loop.response(HAUL, HOOK, omega7))
    omega9 = np.array([0.43, 0.65, 0.94, 1.46])
    magnitudes(found, "thesis.table_9", omega9, loop.response(PAYLOAD, HOOK, omega9) ** 2)
    held = line_response(one, 1j * omega9, drag=one.payload.fixed_drag)
    lumped = build_plant(one).linearise(drag=one.payload.fixed_drag).response(omega9)
    at = lumped.outputs.index(PAYLOAD), lumped.disturbances.index(HOOK)
    magnitudes(found, "thesis.table_8", omega9, lumped.zw[:, at[0], at[1]] ** 2)
    at = held.outputs.index(PAYLOAD), held.disturbances.index(HOOK)
    magnitudes(found, "thesis.exact_rope", omega9, held.zw[:, at[0], at[1]])
    magnitudes(found, "thesis.table_5_height", omega9, 8.0 * hook.sea.density(omega9))
    magnitudes(found, "thesis.table_5_heave", omega9, hook.rao.response(omega9))
    force = loop.response(PAYLOAD, "payload.force", np.array([1e-4, 0.944]))
    magnitudes(found, "thesis.compliance", ["1e-4", "0.944"], force)
    moved = loop.response(PAYLOAD, "drive.set_point", np.array([2.0]))
    magnitudes(found, "thesis.set_point", ["2.0"], moved)

    def band_rms(view: Assessment, output: str, high: float) -> float:
        poles = [p for p in view.poles if abs(p.real) > 1e-9]
        nodes = spectral_nodes(0.2, high, splits=hook.splits, poles=poles)
        return math.sqrt(nodes.integrate(view.spectrum(output, nodes.omega)))

    found.put("thesis.stiffness", one.rope.stiffness)
    found.put("thesis.moving_mass", one.moving_mass)
    found.put("thesis.drum_radius", one.drum_radius)
    found.put("thesis.static_tension", one.static_tension)
    found.put("thesis.static_torque", one.static_torque)
    found.put("thesis.payload_before", question.payload_rms_before)
    found.put("thesis.torque_to_3", band_rms(loop, "motor.torque", 3.0))
    found.put("thesis.speed_to_3", band_rms(loop, "motor.speed", 3.0))
    found.put("thesis.torque", loop.sigma("motor.torque"))
    found.put("thesis.speed", loop.sigma("motor.speed"))
    found.put("thesis.torque_peak", loop.peak("motor.torque", 10800.0))
    found.put("thesis.payload_period", loop.mean_period(PAYLOAD))
    crossing = next(w for w in loop.margins.real_axis_crossings if 1.5 < w < 3.0)
    found.put("thesis.crossing", crossing)
    found.put("thesis.loop_gain_there", loop.loop_gain(np.array([crossing]))[0].real)
    for name in ("a", "a1", "a2"):
        view = question.assess({**THESIS_GAINS, name: 1.1 * THESIS_GAINS[name]})
        found.put(f"thesis.figure_32.{name}", view.sigma(PAYLOAD))
        found.put(f"thesis.figure_32.{name}.max_sensitivity", view.margins.max_sensitivity)
    own = pose(changed("thesis-1975", payload__drag={"method": "stochastic"}))
    found.put("thesis.own_drag_before", own.drag_before)
    found.put("thesis.own_payload_before", own.payload_rms_before)
    sys.path.insert(0, str(HERE.parents[1] / "notebooks"))
    from cables import cable_study

    study = cable_study(one)
    for number, cable in enumerate(study.cables):
        found.put(f"thesis.cables.{number}.stiffness", cable.case.rope.stiffness)
        found.put(f"thesis.cables.{number}.mass", cable.case.moving_mass)


# --- gains evaluated ----------------------------------------------------------------------------


def _evaluated(found: Figures, prefix: str, design: Any) -> None:
    found.put(f"{prefix}.payload_rms", design.payload_rms)
    found.put(f"{prefix}.payload_rms_before", design.payload_rms_before)
    found.put(f"{prefix}.hook_rms", design.hook_rms)
    found.put(f"{prefix}.drag", design.drag)
    found.put(f"{prefix}.drag_before", design.drag_before)
    found.put(f"{prefix}.masses", design.masses)
    found.put(f"{prefix}.status", design.status, "text")
    margins = design.margins
    if margins is not None:
        for name in ("max_sensitivity", "gain", "gain_down", "phase", "delay", "disk"):
            found.put(f"{prefix}.margins.{name}", getattr(margins, name))
        note = "where a smooth curve is highest is known to half the digits"
        found.put(f"{prefix}.margins.peak", margins.peak, elsewhere=1e-6, note=note)
    for name, use in design.limits.items():
        found.put(f"{prefix}.use.{name}", use.use)
    if design.verification is not None:
        found.put(f"{prefix}.verification", design.verification.status, "text")
        for check in design.verification.checks:
            if check.name in ("payload rms", "sensitivity peak M_s"):
                found.put(f"{prefix}.check.{check.name}", check.found)


@group()
def evaluation(found: Figures) -> None:
    """`sh.evaluate_gains` on four cases."""
    _evaluated(found, "evaluation.thesis", thesis_design())
    rope = sh.evaluate_gains(case("thesis-1975-rope"), ROPE_GAINS)
    _evaluated(found, "evaluation.rope", rope)
    crane = sh.evaluate_gains(case("subsea-crane"), CRANE_GAINS)
    _evaluated(found, "evaluation.crane", crane)
    landing = case("landing")
    gains = {"A": 1.0, "a": 0.0, "a1": 1.0, "a2": 0.1}
    _evaluated(found, "evaluation.landing", sh.evaluate_gains(landing, gains))
    late = changed("thesis-1975", sensors__telemetry__delay=0.02)
    _evaluated(found, "evaluation.late", sh.evaluate_gains(late, LATE_GAINS))


# --- structures evaluated -----------------------------------------------------------------------

_LATE_NOISY = {
    "sensors.telemetry.delay": "25 ms",
    "sensors.mru": {"noise_floor": 0.0, "noise_fraction": 0.02},
}

STRUCTURES: dict[tuple[str, str], dict[str, float]] = {
    ("thesis-1975", "payload-feedback"): {
        "a": 13.979,
        "a1": 7.4993,
        "a2": 31.034,
    },
    ("thesis-1975", "payload-feedback-rolloff"): {
        "a": 13.835,
        "a1": 7.4058,
        "a2": 30.46,
        "rolloff.corner": 500.0,
        "rolloff.damping": 0.2,
    },
    ("thesis-1975", "payload-feedback-lead"): {
        "a": 120.24,
        "a1": 428.21,
        "a2": 5868.6,
        "lead.zero": 8.4597,
        "lead.pole": 200.0,
    },
    ("thesis-1975", "payload-feedback-notch"): {
        "a": 268.17,
        "a1": 130.34,
        "a2": 2419.8,
        "notch.frequency": 6.2971,
        "notch.width": 2.0,
        "notch.depth": 0.23236,
        "rolloff.corner": 500.0,
        "rolloff.damping": 0.2,
    },
    ("thesis-1975", "payload-feedback-integral"): {
        "a": 13.835,
        "a1": 7.3804,
        "a2": 30.407,
        "integral.corner": 0.002,
        "rolloff.corner": 500.0,
        "rolloff.damping": 0.2,
    },
    ("thesis-1975", "drum-feedback"): {
        "payload.acceleration_gain": 22.312,
        "payload.velocity_gain": 88.905,
        "payload.position_gain": 1203.4,
        "drum.speed_gain": 32.47,
        "drum.position_gain": 0.091134,
        "rolloff.corner": 500.0,
        "rolloff.damping": 0.2,
    },
    ("thesis-1975", "feed-forward"): {
        "drum.speed_gain": 0.053289,
        "drum.position_gain": 12.5,
        "heave.gain": 0.96839,
        "heave.lead": 0.27573,
        "heave.bandwidth": 100.0,
    },
    ("thesis-1975", "combined"): {
        "payload.acceleration_gain": 21.139,
        "payload.velocity_gain": 95.729,
        "payload.position_gain": 1120.4,
        "drum.speed_gain": 32.47,
        "drum.position_gain": 0.23555,
        "heave.gain": 0.98998,
        "rolloff.corner": 500.0,
        "rolloff.damping": 0.2,
        "heave.lead": 0.049255,
        "heave.bandwidth": 100.0,
    },
    ("thesis-1975", "constant-tension"): {
        "drum.speed_gain": 32.47,
        "drum.position_gain": 0.0036087,
        "tension.gain": 0.0003125,
    },
    ("thesis-1975", "low-order-2"): {
        "alpha1[1]": -8.1645,
        "alpha0[1]": 147750.0,
        "B[1.1,payload.acceleration]": -313410000.0,
        "B[1.1,payload.velocity]": -10873000000.0,
        "B[1.1,payload.displacement]": -15264000000000.0,
        "B[1.2,payload.acceleration]": 7646900000.0,
        "B[1.2,payload.velocity]": 15249000000000.0,
        "B[1.2,payload.displacement]": -62728000000.0,
    },
    ("subsea-crane", "feed-forward"): {
        "drum.position_gain": 0.001,
        "heave.gain": 0.97845,
        "heave.lead": 0.65903,
        "heave.bandwidth": 1.4173,
    },
    ("subsea-crane", "combined"): {
        "payload.acceleration_gain": 0.98162,
        "payload.velocity_gain": 1.6166,
        "payload.position_gain": 2.8879,
        "drum.position_gain": 0.65588,
        "heave.gain": 0.93224,
        "rolloff.corner": 20.741,
        "rolloff.damping": 1.0217,
        "heave.lead": 0.028445,
        "heave.bandwidth": 7.3838,
    },
    ("subsea-crane", "constant-tension"): {
        "drum.position_gain": 0.0052691,
        "tension.gain": 8.491e-06,
    },
}


def structure_case(name: str, structure: str = "") -> sh.Case:
    """Return the case that a structure is looked at on."""
    if name != "thesis-1975":
        return case(name)
    cell = {"sensors.load_cell": {"bandwidth": 1e5}} if structure == "constant-tension" else {}
    return case(name).replace({**_LATE_NOISY, **cell})


@group()
def structures(found: Figures) -> None:
    """Every structure with parameters that stand here."""
    for (name, structure), parameters in STRUCTURES.items():
        posed = pose(structure_case(name, structure), structure)
        controller = posed.controller(parameters)
        problem = posed.problem
        view = Assessment(posed.plant, controller, problem.disturbances, elements=problem.elements)
        prefix = f"structures.{name}.{structure}"
        found.put(f"{prefix}.payload_rms", view.sigma(PAYLOAD))
        found.put(f"{prefix}.torque_rms", view.sigma("motor.torque"))
        # Peak and crossing of a free controller are refined where its loop gain cancels.
        fine = structure.startswith("low-order")
        elsewhere = 1e-8 if fine else None
        note = "the refined peak moves with the BLAS's kernels" if fine else ""
        for word, value in (
            ("max_sensitivity", view.max_sensitivity),
            ("delay_margin", view.margins.delay),
        ):
            found.put(f"{prefix}.{word}", value, elsewhere=elsewhere, note=note)
        for limit in (*posed.limits, *posed.reported):
            if limit.name != "max_sensitivity":
                found.put(f"{prefix}.{limit.name}", limit.measure(view))


# --- plant, rope, drum --------------------------------------------------------------------------


@group()
def plant(found: Figures) -> None:
    """Eigenvalues, operating points, rope modes, drum, drag."""
    for name in ("thesis-1975", "thesis-1975-rope", "subsea-crane", "landing"):
        one = case(name)
        built = build_plant(one)
        linear = built.linearise(drag=5e3)
        poles = [p for p in np.linalg.eigvals(linear.A) if abs(p) > 1e-6]
        sizes = list(sized(poles))
        found.put(f"plant.{name}.states", len(linear.states))
        for number in sorted({0, 1, min(2, len(sizes) - 1), len(sizes) - 1}):
            found.put(f"plant.{name}.pole.{number}", sizes[number])
        found.put(f"plant.{name}.damping", -sum(p.real for p in poles))
        rest = built.operating_point(MEAN_LOSSES)
        found.put(f"plant.{name}.rest.tension", rest.tension)
        found.put(f"plant.{name}.rest.torque", rest.torque)
        found.put(f"plant.{name}.rest.command", rest.command)
        found.put(f"plant.{name}.radius", one.drum_radius)
        found.put(f"plant.{name}.static_torque_budget", one.static_torque_budget)
        omega = np.array([0.3, 1.0, 3.0, 9.0])
        exact, lumped = line_response(one, 1j * omega, drag=5e3), linear.response(omega)
        for block in ("zw", "zu", "yw", "yu"):
            for label, r in (("exact", exact), ("lumped", lumped)):
                size = np.linalg.norm(getattr(r, block))
                found.put(f"plant.{name}.{label}.{block}", size)
    crane = case("subsea-crane")
    drum = crane.winch.drum
    for paid_out in (0.0, 500.0, 1000.0, 1400.0):
        radius = drum.radius_at(paid_out, crane.rope.diameter)
        found.put(f"plant.drum.radius_at.{paid_out:g}", radius)
    found.put("plant.drum.total", drum.total(crane.rope.diameter))
    modes = fixed_top_modes(
        axial_stiffness=crane.rope.axial_stiffness,
        length=crane.rope.length,
        mass_per_length=crane.rope.mass_per_length,
        payload_mass=crane.payload.mass + crane.payload.added_mass,
        count=3,
    )
    for number, mode in enumerate(modes):
        found.put(f"plant.rope_mode.{number}", mode)
    found.put("plant.drag.energy", energy_equivalent(10_500.0, 0.7, 1.1))
    found.put("plant.drag.stochastic", stochastic_equivalent(10_500.0, 0.4))
    consistent = consistent_drag(10_500.0, lambda C: 2000.0 / (C + 1000.0))
    found.put("plant.drag.consistent", consistent)


# --- sea and vessel -----------------------------------------------------------------------------

SITE = """H_s [m] \\ T_p [s], 5-6, 6-7, 8-9, sum
0-1, 30, 5, 1, 36
1-2, 12, 10, 4, 26
2-3, 0, 3, 8, 11
"""


@group()
def sea(found: Figures) -> None:
    """Spectra, their statistics, spreading, extremes, a scatter diagram."""
    table = np.array([[0.3, 0.0], [0.5, 1.2], [0.7, 2.0], [1.0, 0.8], [1.6, 0.1]])
    wind = SeaSpectrum(kind="jonswap", significant_height=1.5, peak_period=7.0, gamma=2.0)
    swell = SeaSpectrum(kind="gaussian-swell", significant_height=1.0, peak_period=14.0, width=0.05)
    seas = {
        "thesis": SeaSpectrum(
            kind="bretschneider-1975", significant_height=2.4384, significant_period=8.1
        ),
        "bretschneider": SeaSpectrum(kind="bretschneider", significant_height=2, peak_period=9),
        "moskowitz": SeaSpectrum(kind="pierson-moskowitz", significant_height=2.0),
        "jonswap": SeaSpectrum(kind="jonswap", significant_height=2.0, peak_period=9.0),
        "tma": SeaSpectrum(kind="tma", significant_height=2.0, peak_period=9.0, depth=20.0),
        "torsethaugen": SeaSpectrum(kind="torsethaugen", significant_height=3, peak_period=9),
        "ochi_hubble": SeaSpectrum(
            kind="ochi-hubble", significant_height=2.0, peak_period=9.0, order=2.0
        ),
        "swell": swell,
        "sum": SeaSpectrum(kind="sum", parts=(wind, swell)),
        "measured": SeaSpectrum.from_table(table[:, 0], table[:, 1]),
    }
    omega = np.array([0.4, 0.7, 1.0, 2.0])
    for name, one in seas.items():
        s = one.statistics
        values = {"m0": s.m0, "m2": s.m2, "t_z": s.zero_crossing_period, "t_1": s.mean_period}
        found.all(f"sea.{name}", values)
        found.put(f"sea.{name}.most_probable_maximum", s.most_probable_maximum(10800.0))
        for w, value in zip(omega, one.density(omega), strict=True):
            found.put(f"sea.{name}.density.{w}", value)
    found.put("sea.peak_factor", peak_factor(8.0))
    found.put("sea.largest", most_probable_maximum(0.5, 8.0, 3600.0))
    for kind in ("cos-2s", "cos-n"):
        _, weights = Spreading(kind=kind, exponent=4.0).nodes(0.3)
        found.put(f"sea.spreading.{kind}", np.linalg.norm(weights))
    rng = np.random.default_rng(5)
    maxima = 3.0 + 0.4 * rng.gumbel(size=120)
    estimate = gumbel_maximum(maxima, block=1200.0, duration=10800.0)
    found.put("sea.extremes.gumbel", estimate.value, tolerance=1e-6, note="a fit by iteration")
    record = SpectrumMotion.from_case(case("subsea-crane")).motion(60.0, 0.5, 11)
    z, v, a = record.block(0, record.rows)
    for label, values in (("z", z), ("v", v), ("a", a)):
        found.put(f"sea.record.{label}", np.linalg.norm(values))
        found.put(f"sea.record.{label}.17", values[17])


def scatter_of(folder: Path) -> sh.Scatter:
    """Return the scatter diagram of a small site."""
    path = folder / "site.csv"
    path.write_text(SITE, encoding="utf-8")
    return sh.read_scatter(path)


@group()
def vessel(found: Figures) -> None:
    """RAOs in other programs' conventions, the hook of the bundled vessel, a scatter diagram."""
    raos = sh.read_raos("osv-83m")
    for number, mode in enumerate(("surge", "sway", "heave", "roll", "pitch", "yaw")):
        found.put(f"vessel.raos.{mode}", np.linalg.norm(raos.values[:, :, number]))
    slope = raos.wave_number(raos.omega)[:, None] * np.ones(raos.heading.size)
    conventions = {
        "orcaflex": Convention(waves="period (s)", phase="lags", rotations="deg/m"),
        "wamit": Convention(waves="period (s)", phase="lags", phase_unit="radians"),
        "turned": Convention(
            phase_relative_to="zero down-crossing",
            rotations="wave steepness",
            heave="down",
            sway="starboard",
            headings="from",
            turning="clockwise",
            heading_zero=90.0,
        ),
    }
    for name, convention in conventions.items():
        amplitude, phase, numbers = written(convention, raos.values, slope)
        found.put(f"vessel.{name}.amplitude", np.linalg.norm(amplitude))
        found.put(f"vessel.{name}.phase", np.linalg.norm(phase[40, 5]))
        found.put(f"vessel.{name}.real", numbers[40, 5, 2].real)
        found.put(f"vessel.{name}.heading", headings(convention, raos.heading)[5])
        found.put(f"vessel.{name}.column", first_column(convention, raos.omega)[40])
    moved = raos.with_phase_origin((10.0, -3.0))
    found.put("vessel.phase_origin", moved.values[40, 5, 2].real)
    for label, one in (
        ("crane", case("subsea-crane")),
        ("landing", case("landing")),
        ("spread", changed("subsea-crane", sea__spreading={"kind": "cos-2s", "exponent": 4.0})),
        ("speed", changed("subsea-crane", vessel__speed="2 m/s")),
    ):
        demand = sh.HookDemand.from_case(one)
        for name in ("displacement", "velocity", "acceleration"):
            motion = getattr(demand, name)
            found.put(f"vessel.{label}.{name}.rms", motion.rms)
            found.put(f"vessel.{label}.{name}.period", motion.zero_crossing_period)
            width = f"vessel.{label}.{name}.width"
            found.put(width, motion.width, tolerance=1e-8, note="a difference of moments")
            largest = motion.most_probable_maximum(demand.duration)
            found.put(f"vessel.{label}.{name}.largest", largest)
        found.put(f"vessel.{label}.peak_power", demand.peak_power)
        found.put(f"vessel.{label}.fractile_power", demand.fractile_power)
    survey = sh.hook_motion(
        case("subsea-crane"), headings=(0.0, 90.0, 135.0, 180.0), peak_periods=(7.0, 9.0, 13.0)
    )
    for motion in ("displacement", "velocity", "acceleration"):
        rms = survey.rms(motion)
        found.put(f"vessel.survey.{motion}", np.linalg.norm(rms))
        for side, heading, period in ((0, 0, 0), (0, 2, 1), (1, 1, 2), (1, 3, 1)):
            found.put(f"vessel.survey.{motion}.{side}{heading}{period}", rms[side, heading, period])


# --- optima -------------------------------------------------------------------------------------


@group()
def optimum(found: Figures) -> None:
    """Costs of small searches on one spring."""
    design = sh.optimise_gains(case("thesis-1975"), "payload-feedback", starts=3)
    found.put("optimum.thesis.payload_rms", design.payload_rms, "optimum")
    found.put("optimum.thesis.status", design.status, "text")
    late = case("thesis-1975").replace(_LATE_NOISY)
    forward = sh.optimise_gains(late, "feed-forward", starts=2)
    found.put("optimum.feed_forward.payload_rms", forward.payload_rms, "optimum")
    found.put("optimum.feed_forward.status", forward.status, "text")
    feedback = sh.optimise_gains(late, "payload-feedback", starts=2)
    found.put("optimum.payload_feedback.payload_rms", feedback.payload_rms, "optimum")
    one = case("thesis-1975")
    robust = sh.optimise_robust(
        one, sh.Family.of(one, {"rope.length": (1500.0, 2000.0)}), starts=1, draws=50
    )
    worst = max(s.design.payload_rms for s in robust.scenarios)
    found.put("optimum.robust.payload_rms", worst, "optimum")
    found.put("optimum.robust.status", robust.status, "text")


@group(slow=True)
def optimum_crane(found: Figures) -> None:
    """The README's design, and a combined structure."""
    design = sh.optimise_gains(case("subsea-crane"), "payload-feedback", starts=2)
    found.put("optimum_crane.payload_rms", design.payload_rms, "optimum")
    found.put("optimum_crane.status", design.status, "text")
    for name, use in design.limits.items():
        if use.price > 1e-6:
            found.put(f"optimum_crane.price.{name}", use.price, "optimum", tolerance=1e-3)
    late = case("thesis-1975").replace(_LATE_NOISY)
    combined = sh.optimise_gains(late, "combined", starts=2)
    found.put("optimum_crane.combined.payload_rms", combined.payload_rms, "optimum")


@group(slow=True)
def studies(found: Figures) -> None:
    """Pareto front, sizing, co-design, worth, gain schedule, weights."""
    one, calm = case("thesis-1975"), changed("thesis-1975", sea__significant_height=1.0)
    for number, point in enumerate(sh.pareto_front(one, "torque", points=2, checks=1).points):
        found.put(f"studies.pareto.{number}.bound", point.bound, "optimum")
        found.put(f"studies.pareto.{number}.payload_rms", point.payload_rms, "optimum")
    sizing = sh.size_winch(calm, target=0.15, gear=(24.0, 31.0), points=3, starts=1)
    for point in sizing.points:
        found.put(f"studies.size.{point.gear:g}.scale", point.scale, "optimum", tolerance=1e-4)
    found.put("studies.size.unlimited_rms", sizing.unlimited_rms, "optimum")
    found.put("studies.size.given_rms", sizing.given_rms, "optimum")
    found.put("studies.size.highest", sizing.highest_height, "optimum", tolerance=1e-4)
    together = sh.co_design(calm, gear=(24.0, 31.0), starts=1)
    found.put("studies.co_design.payload_rms", together.payload_rms, "optimum")
    found.put("studies.co_design.given_rms", together.given_rms, "optimum")
    worth = sh.worth(one, starts=1)
    found.put("studies.worth.payload_rms", worth.payload_rms, "optimum")
    for row in worth.rows:
        if row.item.value > 0.0:
            name, note = f"studies.worth.{row.item.name}", "gains optimised again"
            found.put(name, row.elasticity, "optimum", tolerance=1e-3, note=note)
    schedule = sh.schedule_gains(one, (1500.0, 2000.0))
    for point in (schedule.points[0], schedule.points[-1]):
        found.put(
            f"studies.schedule.{point.length:g}", point.payload_rms, "optimum", tolerance=1e-5
        )
    weights = sh.tune_weights(one)
    found.put("studies.weights.torque", weights.torque, "optimum")
    found.put("studies.weights.max_sensitivity", weights.max_sensitivity, "optimum")


# --- bounds and robustness ----------------------------------------------------------------------


@group()
def bound(found: Figures) -> None:
    """The best of all linear controllers, the clairvoyant floor, the nearest unstable plant."""
    late = changed("thesis-1975", sensors__telemetry__delay=0.02)
    best = sh.bound_for(late, measurements=MEASURED).free
    found.put("bound.thesis.value", best.value, "optimum")
    note = "what the realised controller does: it hangs on the fit of the shaping filter"
    found.put("bound.thesis.attained", best.attained, "optimum", elsewhere=1e-2, note=note)
    noisy = sh.bound_for(case("thesis-1975").replace(_LATE_NOISY), measurements=MEASURED).free
    found.put("bound.noisy.value", noisy.value, "optimum")
    high = changed("thesis-1975", sea__significant_height=3.75)
    record = SpectrumMotion.from_case(high).motion(20.0, 0.05, 3)
    floor = sh.clairvoyant(high, record, drag=500.0)
    found.put("bound.clairvoyant.payload_rms", floor.payload_rms, "optimum")
    found.put("bound.clairvoyant.hook_rms", floor.hook_rms)
    note = "of the interior-point solver's certificate"
    lower = floor.lower_bound
    found.put("bound.clairvoyant.lower", lower, "optimum", tolerance=1e-5, note=note)
    note = "the optimum is flat in the torque"
    torque = floor.torque_rms
    found.put("bound.clairvoyant.torque_rms", torque, "optimum", elsewhere=1e-2, note=note)
    design = sh.evaluate_gains(late, LATE_GAINS)
    doubts = {"payload.mass": 0.3, "stiffness": 0.2, "drag": 0.5}
    worst = sh.robustness(design, doubts, draws=50)
    note = "a search to a tolerance of its own"
    found.put("bound.robustness.found", worst.found, "optimum", tolerance=1e-5, note=note)
    assert worst.gain_radius is not None
    found.put("bound.robustness.gain_ball", worst.gain_radius.ball, "optimum")
    found.put("bound.robustness.gain_box", worst.gain_radius.box, "optimum")
    off = sh.robustness(thesis_design(), {"gains": 0.1}, draws=200)
    found.put("bound.robustness.gains", off.found, "optimum")
    found.put("bound.robustness.worst_rms", off.worst_rms, "optimum")


@group(slow=True)
def bound_crane(found: Figures) -> None:
    """The bound of the crane with its own sensors, which has many states."""
    best = sh.bound_for(case("subsea-crane")).free
    found.put("bound_crane.value", best.value, "optimum")


# --- sensitivities and sweeps -------------------------------------------------------------------


@group()
def sensitivity(found: Figures) -> None:
    """Elasticities, Sobol's indices, Morris's screening."""
    design = thesis_design()
    result = sh.sensitivity(design)
    note = "slopes that are exact, of figures by quadrature"
    for row in result.elasticities:
        if abs(row.payload_rms) > 1e-3:
            name = f"sensitivity.{row.path}"
            found.put(f"{name}.payload_rms", row.payload_rms, tolerance=1e-8, note=note)
            if abs(row.max_sensitivity) > 1e-3:
                name = f"{name}.max_sensitivity"
                found.put(name, row.max_sensitivity, tolerance=1e-8, note=note)
            name = f"sensitivity.{row.path}.torque_rms"
            found.put(name, row.torque_rms, tolerance=1e-8, note=note)
    narrow = sh.Spread(
        {
            "payload.mass": sh.Uniform("5 %"),
            "rope.axial_stiffness": sh.Uniform("5 %"),
            "winch.motor.resistance": sh.Uniform("10 %"),
        }
    )
    sobol = sh.sobol_indices(design, narrow, samples=32)
    morris = sh.morris_screening(design, narrow, trajectories=4)
    for number, path in enumerate(narrow.paths):
        found.put(f"sensitivity.sobol.{path}.first", sobol.first[number], tolerance=1e-8)
        found.put(f"sensitivity.sobol.{path}.total", sobol.total[number], tolerance=1e-8)
        found.put(f"sensitivity.morris.{path}.size", morris.mean_size[number])
        found.put(f"sensitivity.morris.{path}.spread", morris.spread[number], tolerance=1e-8)


@group()
def sweep(found: Figures) -> None:
    """Quantiles of a sweep of loops, of one of a structure, and runs in time."""
    design = thesis_design()
    result = sh.sweep(design, sh.usual_spread(design.case, "frequency"), samples=64)
    crane = sh.evaluate_gains(case("subsea-crane"), CRANE_GAINS)
    modern = sh.sweep(crane, {"payload.mass": sh.Uniform("20 %")}, samples=16)
    for label, one in (("frequency", result), ("crane", modern)):
        summary = one.sweep.summary()
        found.put(f"sweep.{label}.stable", summary.stable.count)
        for name, quantiles in summary.quantiles.items():
            for number, value in enumerate(quantiles):
                found.put(f"sweep.{label}.{name}.{number}", value)
    calm = changed("thesis-1975", sea__significant_height=0.3)
    gains = sh.evaluate_gains(calm, {**THESIS_GAINS, "a": 20.0, "a1": 12.0, "a2": 60.0})
    runs = sh.sweep(gains, samples=2, mode="time", duration="30 s", jobs=1, compiled=False)
    for name in ("payload_rms", "payload_largest", "torque_rms", "tension_largest"):
        if name in runs:
            for number, value in enumerate(runs[name].to_numpy()):
                found.put(f"sweep.time.{name}.{number}", value)


@group()
def operability(found: Figures) -> None:
    """Limiting heights of the crane over two periods and two headings, and of the thesis."""
    crane = sh.evaluate_gains(case("subsea-crane"), CRANE_GAINS)
    study = sh.operability(
        crane, periods=(8.0, 12.0), headings=(0.5 * math.pi, math.pi), payload_rms=0.3
    )
    depth = study.depths[0]
    note = "a root, to the solver's tolerance"
    for system, contour in depth.contours.items():
        for number, criterion in enumerate(contour.criteria):
            name = f"operability.crane.{system}.{criterion.name}"
            for (h, p), height in np.ndenumerate(contour.heights[number]):
                found.put(f"{name}.{h}{p}", height, tolerance=1e-8, note=note)
    found.put("operability.crane.max_sensitivity", depth.max_sensitivity)
    found.put("operability.crane.capability", np.linalg.norm(depth.capability.heights))
    thesis_study = sh.operability(thesis_design(), periods=(7.0, 11.0), payload_rms=0.05)
    for system, contour in thesis_study.depths[0].contours.items():
        for number, height in enumerate(contour.limit[0]):
            found.put(f"operability.thesis.{system}.{number}", height, tolerance=1e-8, note=note)


# --- in time ------------------------------------------------------------------------------------


class Recorder:
    """A controller that passes another's commands on and keeps them."""

    def __init__(self, inner: Any) -> None:
        self.inner = inner
        self.name, self.sample_time = inner.name, inner.sample_time
        self.commands: list[float] = []

    def reset(self) -> None:
        """Forget what was kept."""
        self.commands.clear()
        self.inner.reset()

    def step(self, measurement: Any, time: float) -> float:
        """Return the other's command."""
        command = self.inner.step(measurement, time)
        self.commands.append(float(command))
        return command

    def __getattr__(self, name: str) -> Any:
        # What some controllers have besides: `brake`, `foresee`.  Without a recursion of its own
        # it is called sample by sample.
        if name in ("inner", "recursion"):
            raise AttributeError(name)
        return getattr(self.inner, name)


def _law(name: str, structure: str) -> Any:
    return pose(structure_case(name), structure).controller(STRUCTURES[name, structure])


def _controllers(name: str) -> dict[str, tuple[sh.Case, Any]]:
    one = case(name).replace({"sensors.mru": NOISY_UNIT} if name == "thesis-1975" else {})
    calm = one.replace({"sea.significant_height": 0.5})
    gains = THESIS_GAINS if name == "thesis-1975" else CRANE_GAINS
    designed = structure_case(name).replace({"sea.significant_height": 0.5})
    stored = WEIGHTS[name]
    weights = sh.Weights(torque=stored["torque"], noise=sh.ProcessNoise(**stored["noise"]))
    made = {
        "feedback": (calm, sh.LinearFeedback(calm, gains)),
        "combined": (
            designed,
            sh.LinearFeedback(designed, _law(name, "combined"), name="combined"),
        ),
        "feed-forward-law": (designed, sh.LinearFeedback(designed, _law(name, "feed-forward"))),
        "feed-forward": (one, sh.VelocityFeedForward(one)),
        "feed-forward-lead": (one, controller_by_name("feed-forward-lead", one)),
        "constant-tension": (one, sh.ConstantTension(one)),
        "none": (one, sh.BrakeOn(one)),
        "mpc": (one, sh.LinearMPC(one, weights=weights, horizon=3.0)),
        "mpc-ar": (one, sh.LinearMPC(one, weights=weights, horizon=3.0, predictor="ar")),
        "mpc-preview": (one, sh.LinearMPC(one, weights=weights, horizon=3.0, predictor="preview")),
        "nonlinear-mpc": (
            one,
            sh.NonlinearMPC(one, weights=weights, horizon=2.0, compiled=False),
        ),
    }
    return made


def _commands(found: Figures, prefix: str, name: str) -> None:
    """Keep 100 commands of every controller in its own loop, one in 40 or 50 ms."""
    for label, (one, controller) in _controllers(name).items():
        recorder = Recorder(controller)
        runs = sh.simulate(
            one, recorder, seeds=[7], duration=5.0, settle=0.0, compiled=False, store_step=0.05
        )
        every = round(0.05 / controller.sample_time)
        series = np.asarray(recorder.commands)[::every][:100]
        found.series[f"{prefix}.{label}"] = series
        predicts = "mpc" in label
        # On one machine the same code gives either of two answers, 2e-3 apart.
        tolerance = 1e-2 if predicts else None
        note = "the fitted filter of the sea moves with the BLAS's rounding" if predicts else ""
        for name, value in (
            ("norm", np.linalg.norm(series)),
            ("payload", runs[0][PAYLOAD].std()),
        ):
            found.put(f"{prefix}.{label}.{name}", value, "command", tolerance=tolerance, note=note)


@group()
def commands_thesis(found: Figures) -> None:
    """Commands of every controller on the thesis's winch."""
    _commands(found, "commands_thesis", "thesis-1975")


@group()
def commands_crane(found: Figures) -> None:
    """Commands of every controller on the crane."""
    _commands(found, "commands_crane", "subsea-crane")


@group()
def simulation(found: Figures) -> None:
    """Statistics of short runs."""
    calm = changed("thesis-1975", sea__significant_height=0.5)
    runs = {
        "hold": sh.simulate(calm, "feedback", duration="1 min", settle=10.0, compiled=False),
        "engage": sh.simulate(
            case("thesis-1975"),
            "feed-forward",
            scenario="engage",
            options={"hold": "20 s"},
            compiled=False,
        ),
        "landing": sh.simulate(
            case("landing"), "feed-forward", scenario="landing", duration="1 min", compiled=False
        ),
    }
    for label, one in runs.items():
        statistics = one[0].statistics
        for name, quantity in statistics.quantities.items():
            found.put(f"simulation.{label}.{name}", quantity.value)
        found.put(f"simulation.{label}.events", len(one[0].events))
        found.put(f"simulation.{label}.status", one[0].status, "text")
    fast = sh.simulate(calm, "feedback", duration="1 min", settle=10.0)
    found.put("simulation.compiled.payload", fast[0].statistics.value("payload rms"))


@group()
def comparison(found: Figures) -> None:
    """One cell of a comparison for four contenders."""
    calm = changed("thesis-1975", sea__significant_height=1.25)
    result = sh.compare(
        calm,
        ["none", "feed-forward", "constant-tension", "clairvoyant"],
        seeds=1,
        duration="40 s",
        jobs=1,
        compiled=False,
        traces=False,
    )
    for cell in result.cells:
        kind = "optimum" if cell.contender == "clairvoyant" else "evaluation"
        tolerance = 1e-5 if cell.contender == "clairvoyant" else None
        for name in ("payload rms", "tracking error rms", "motor torque rms"):
            if name in cell.quantities:
                label = f"comparison.{cell.contender}.{name}"
                found.put(label, cell.quantities[name], kind, tolerance=tolerance)
        found.put(f"comparison.{cell.contender}.status", cell.status, "text")
