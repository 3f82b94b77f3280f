"""The best possible beside a design: never above it, and told where it means something."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from bound_check import verify_bound
from former_cases import load_case

import stillhook as sh
from models.basics import InputError, SolverError, SynthesisError
from models.case import Case
from models.plant import MEASUREMENTS, PlantData, line_response
from models.sensing import MEASURED, aboard, sensed_plant
from stillhook.designs import bound_rows, structures_table
from stillhook.designs.bound_text import bound_cell, bound_figure, bounds_note
from stillhook.designs.structures import structures
from stillhook.designs.summary import facts
from stillhook.text import markdown
from synth.bound import BestPossible, HighOrder, bound_for, exact_sensors
from synth.loop import Assessment, LinearController, Margins, closed_loop_poles
from synth.question import pose

CRANE_GAINS = {"A": 1.0, "a": 16.03, "a1": 44.47, "a2": 6.410}
NOISY_MRU = {"sensors.mru": {"noise_floor": "1 cm", "noise_fraction": 0.02}}

# What `sh.optimise_gains` finds on subsea-crane, to a few digits.
CRANE: Mapping[str, Mapping[str, float]] = {
    "payload-feedback": {"a": 15.948, "a1": 44.248, "a2": 6.4222},
    "payload-feedback-rolloff": {
        "a": 109.77,
        "a1": 82.817,
        "a2": 318.11,
        "rolloff.corner": 33.427,
        "rolloff.damping": 2.0,
    },
    "payload-feedback-lead": {
        "a": 130.92,
        "a1": 58.313,
        "a2": 365.36,
        "lead.zero": 29.496,
        "lead.pole": 4.8332,
    },
    "payload-feedback-notch": {
        "a": 113.66,
        "a1": 115.34,
        "a2": 354.03,
        "notch.frequency": 27.273,
        "notch.width": 1.3505,
        "notch.depth": 0.32236,
        "rolloff.corner": 168.84,
        "rolloff.damping": 2.0,
    },
    "payload-feedback-integral": {
        "a": 109.73,
        "a1": 82.766,
        "a2": 317.84,
        "integral.corner": 0.002,
        "rolloff.corner": 33.437,
        "rolloff.damping": 2.0,
    },
    "drum-feedback": {
        "payload.acceleration_gain": 1.1952,
        "payload.velocity_gain": 0.87776,
        "payload.position_gain": 3.6201,
        "drum.position_gain": 0.27504,
        "rolloff.corner": 32.476,
        "rolloff.damping": 2.0,
    },
    "feed-forward": {
        "drum.position_gain": 0.001,
        "heave.gain": 0.97792,
        "heave.lead": 0.73684,
        "heave.bandwidth": 1.2854,
    },
    "combined": {
        "payload.acceleration_gain": 0.97123,
        "payload.velocity_gain": 1.6157,
        "payload.position_gain": 2.8549,
        "drum.position_gain": 0.67949,
        "heave.gain": 0.9291,
        "rolloff.corner": 19.684,
        "rolloff.damping": 0.97761,
        "heave.lead": 0.026346,
        "heave.bandwidth": 7.5648,
    },
    "constant-tension": {"drum.position_gain": 0.0052164, "tension.gain": 8.3954e-06},
}
TIGHT = {"winch.drive.torque_continuous": "6.4 kN m", "winch.drive.torque_peak": "7 kN m"}
QUICK = ("payload-feedback", "combined")


@cache
def crane() -> sh.Design:
    return sh.evaluate_gains(load_case("subsea-crane"), CRANE_GAINS)


@cache
def forward() -> sh.Design:
    case = load_case("thesis-1975").replace(NOISY_MRU)
    return sh.optimise_gains(case, "feed-forward", starts=2)


@dataclass(frozen=True, kw_only=True)
class Known:
    """A design of the crane, as far as its bound is concerned."""

    sea_case: Case
    controller: LinearController
    margins: Margins
    masses: int
    drag: float
    friction: float
    payload_rms: float


@cache
def crane_design(name: str) -> Known:
    values = CRANE[name]
    case = load_case("subsea-crane")
    posed = pose(case, name)
    view = posed.problem_with(posed.loop).assess(posed.values(values))
    drag, friction = posed.equivalents(view.coefficients)
    return Known(
        sea_case=case,
        controller=view.controller,
        margins=view.margins,
        masses=posed.masses,
        drag=drag,
        friction=friction,
        payload_rms=without_losses(view.shares("payload.displacement")),
    )


def without_losses(shares: Mapping[str, float]) -> float:
    """What is left of a motion without the noise of losses, which a bound leaves out."""
    return math.hypot(*(own for name, own in shares.items() if name != "drive.set_point"))


def holds(found: BestPossible) -> None:
    assert found.rms is not None
    assert 0.0 < found.free.value < found.rms
    assert found.free.gap < 1e-4


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=pytest.mark.ci if n in QUICK else pytest.mark.slow) for n in CRANE],
)
def test_bound_is_below_every_structure_of_the_crane(name: str) -> None:
    design = crane_design(name)
    found = bound_for(design)
    holds(found)
    assert not found.exact
    assert set(found.free.plant.measurements) == {
        *design.controller.measurements,
        "drum.haul",
        "motor.speed",
    }
    assert found.rms is not None
    # By the quadrature of the search, without what is faint.
    assert found.rms == pytest.approx(design.payload_rms, rel=1e-3)
    # More sensors, with the same limits: the controller beside the one bound may hear all of them
    # and ignore most, so its motion, with what it uses beyond the limits at their price, is above.
    every = bound_for(design, measurements=aboard(design.sea_case)).free
    price = sum(
        every.multipliers[name] * (found.free.rms[name] ** 2 - limit**2)
        for name, limit in every.limits.items()
    )
    assert found.free.attained**2 + price >= every.value**2 * (1.0 - 1e-6)


@pytest.mark.ci
@pytest.mark.parametrize(
    "name", ["combined", pytest.param("payload-feedback-rolloff", marks=pytest.mark.slow)]
)
def test_best_found_stands_on_the_exact_rope(name: str) -> None:
    design = crane_design(name)
    best = bound_for(design)
    found = best.found
    assert isinstance(found, HighOrder)
    assert not best.is_own
    assert best.rms is not None
    assert best.free.value < found.rms < 0.5 * best.rms
    # On ropes that it was not made on, all poles; on the exact line, M_s at every mode and between.
    names = found.controller.measurements
    for masses in (2 * design.masses, 30, 40):
        plant = sensed_plant(
            design.sea_case, masses=masses, drag=design.drag, friction=design.friction
        )
        plant = plant.select(measurements=names)
        poles = closed_loop_poles(plant.without_delays(8), found.controller)
        assert poles.real.max() < 0.0
    near = np.concatenate([poles, plant.poles()]).imag
    omega = np.unique(np.concatenate([np.geomspace(1e-4, 1e3, 20_000), near[near > 0.0]]))
    data = PlantData.from_case(design.sea_case)
    data = replace(data, viscous_friction=data.viscous_friction + design.friction)
    line = line_response(data, 1j * omega, drag=design.drag)
    heard = dict(zip(line.measurements, line.yu[:, :, 0].T, strict=True))
    heard |= {n: line.zu[:, line.outputs.index(n), 0] for n in ("drum.haul", "motor.speed")}
    C = found.controller.response_at(1j * omega)[:, 0]
    gain = sum(C[:, k] * heard[n] for k, n in enumerate(names) if n in heard)  # no MRU in L
    most = float(np.max(1.0 / np.abs(1.0 - gain)))
    assert most <= 1.01 * best.max_sensitivity
    assert best.max_sensitivity == pytest.approx(2.0, rel=1e-3)
    assert found.margins.max_sensitivity == pytest.approx(most, rel=0.01)
    # And its motion by a quadrature of its own, on the rope it was judged on and on another.
    view = Assessment(
        plant.select(measurements=names),
        found.controller,
        [s for s in best.free.sources if "faint" not in s.name and s.name != "payload.force"],
    )
    assert view.sigma("payload.displacement") == pytest.approx(found.rms, rel=0.03)
    text = str(best)
    assert "whatever its margins (its LQG has M_s" in text
    assert f"the best found at M_s 2 with order {found.order}: " in text
    assert "times the best found" in text


@pytest.mark.ci
def test_lqg_beside_the_bound_has_the_sensitivity_that_is_told() -> None:
    late = load_case("subsea-crane").replace({"sensors.telemetry.delay": "0.25 s"})
    for best in (
        bound_for(crane_design("combined")),
        bound_for(late, measurements=MEASUREMENTS),
    ):
        view = Assessment(best.free.plant, best.free.controller, best.free.sources)
        assert best.free_sensitivity == pytest.approx(view.max_sensitivity, rel=1e-3)
        assert best.free_sensitivity > 4.0


@pytest.mark.ci
def test_the_design_itself_where_nothing_better_was_found(monkeypatch: pytest.MonkeyPatch) -> None:
    best = bound_for(crane_design("combined"))
    assert best.rms is not None
    worse = HighOrder(
        rms=1.2 * best.rms,
        controller=best.free.controller,
        margins=crane_design("combined").margins,
    )
    monkeypatch.setattr("synth.bound.case.high_order", lambda *words, **more: worse)
    monkeypatch.setattr("synth.bound.case.youla_design", lambda *words, **more: None)
    assert best.is_own
    assert f"is the design itself: {1e3 * best.rms:.3g} mm" in str(best)

    def fails(*words: object, **more: object) -> None:
        raise SynthesisError("no controller keeps the limits")

    monkeypatch.setattr("synth.bound.case.youla_design", fails)
    assert replace(best).is_own
    case = bound_for(load_case("subsea-crane"))
    assert case.found == "no controller keeps the limits"
    assert "none found within M_s 2: no controller keeps the limits" in str(case)
    blind = replace(case, free=replace(case.free, value=0.0))
    assert blind.sentences[0].startswith("nothing is known of the best")


@pytest.mark.ci
@pytest.mark.filterwarnings("ignore::models.PhysicsWarning")
def test_a_sea_in_which_nothing_keeps_the_drives_limits_has_no_bound() -> None:
    # The dual grows without end, and the true loop of its last controller loses the load: 8.6 km
    # came of that for a bound.
    best = bound_for(load_case("subsea-crane").replace({"sea.significant_height": 20.0}))
    assert best.free.value == math.inf
    assert best.sentences == ("no linear controller keeps the limits",)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["thesis-1975", "thesis-1975-rope"])
@pytest.mark.parametrize("structure", ["payload-feedback-rolloff", "feed-forward", "combined"])
def test_bound_is_below_the_thesis_winch_with_a_noisy_reference(name: str, structure: str) -> None:
    case = load_case(name).replace({**NOISY_MRU, "limits.drive": "report"})
    design = sh.optimise_gains(case, structure, starts=2)
    holds(design.bound)


@pytest.mark.ci
def test_both_numbers_stand_on_the_terms_of_the_design() -> None:
    design = crane()
    found = design.bound
    holds(found)
    assert design.bound is found  # computed once
    # The gains are designed without the noise of the payload's sensors, which hardly counts.
    assert found.rms is not None
    own = without_losses(design.shares["payload.displacement"])
    assert own < found.rms < 1.001 * own
    assert own < design.payload_rms
    assert verify_bound(found.free).ok


@pytest.mark.slow
def test_rms_by_another_quadrature() -> None:
    design = crane()
    found = design.bound
    plant = found.free.plant.select(measurements=design.measurements)
    sources = [s for s in found.free.sources if s.name in plant.disturbances]
    heard = [s for s in sources if not s.name.startswith(("drum.", "motor."))]
    other = Assessment(plant, design.assessment.controller, heard)
    assert other.sigma("payload.displacement") == pytest.approx(found.rms, rel=1e-4)


@pytest.mark.ci
def test_no_limit_of_the_bound_is_tighter_than_what_the_design_uses() -> None:
    tight = crane().case.replace(TIGHT)
    design = sh.evaluate_gains(tight, CRANE_GAINS)
    loose = crane().bound.free.limits
    bound = design.bound
    assert bound.free.limits["motor.torque"] < loose["motor.torque"]
    assert bound.free.value > crane().bound.free.value
    holds(bound)


@pytest.mark.ci
def test_words_of_a_bound() -> None:
    found = crane().bound
    assert found.rms is not None
    assert found.factor == pytest.approx(found.rms / found.free.value)
    text = str(found)
    assert "duality gap" in text
    assert "no limits on margins or power" in text
    # Its resonance at 13 rad/s rings more than without the loop.
    assert "cannot be damped without paying elsewhere" in text
    rows = dict(facts(crane()))
    assert "no linear controller does better than 1.15 mm whatever its margins" in rows["bound"]
    assert "the best found at M_s 2 with order" in rows["bound"]
    assert "the resonance at 13.3 rad/s" in rows["feedback"]
    assert not {"bound", "feedback"} & dict(facts(crane(), bound=False)).keys()


def test_exact_sensors_have_no_meaningful_bound() -> None:
    thesis = load_case("thesis-1975")
    assert set(exact_sensors(thesis, aboard(thesis))) == {
        "payload.acceleration",
        "payload.velocity",
        "payload.displacement",
    }
    assert aboard(thesis) == (*MEASUREMENTS, "drum.haul", "motor.speed")
    assert aboard(load_case("subsea-crane")) == MEASURED
    for name in ("subsea-crane", "landing"):
        assert exact_sensors(load_case(name), MEASURED) == ()
    design = sh.evaluate_gains(thesis, {"A": 200, "a": 50, "a1": 100, "a2": 100})
    assert bound_rows(design)[0][1].endswith("no meaningful bound")
    assert "bound" not in design.__dict__  # nor is it computed
    assert design.bound.rms == pytest.approx(design.payload_rms, rel=1e-2)
    assert not design.bound.meaningful
    assert "payload.displacement exact" in str(replace(design.bound, max_sensitivity=1.0001))


def test_a_structure_that_hears_noisy_sensors_only_has_one() -> None:
    design = forward()
    found = design.bound
    assert found.exact == ()
    holds(found)
    assert found.meaningful
    assert bound_figure(design) == found.free.value
    assert "payload.velocity" in bound_for(design, measurements=aboard(design.case)).exact


def test_table_and_figure_show_the_bound() -> None:
    design = forward()
    lost = replace(design, structure="lost", payload_rms=np.inf, margins=None, ok=False)
    table, plain = structures_table([design, lost]), structures_table([design], bound=False)
    column = table.headings.index("over best")
    assert table.cells(0)[column] == bound_cell(design) != "-"
    assert table.cells(1)[column] == "-"
    assert plain.cells(0)[column] == "-"
    assert bounds_note() in markdown(structures_table([design]))
    assert "over best:" not in markdown(plain)
    marks = [
        line
        for line in structures([design, lost]).axes[0].lines
        if line.get_label() == "best with its sensors"
    ]
    assert len(marks) == 1
    assert marks[0].get_xdata()[0] == pytest.approx(1e3 * design.bound.free.value)
    lines = structures([design], bound=False).axes[0].lines
    assert all(line.get_label() != "best with its sensors" for line in lines)


def test_what_cannot_be_computed_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    unstable = sh.evaluate_gains(crane().case, {**CRANE_GAINS, "A": -1.0})
    assert bound_rows(unstable) == []
    with pytest.raises(InputError, match="must be stable"):
        _ = unstable.bound

    def fails(*words: object, **more: object) -> BestPossible:
        raise SolverError("no stabilising solution")

    monkeypatch.setattr("synth.bound.bound_for", fails)
    again = replace(crane())
    assert bound_rows(again) == [("bound", "not computed: no stabilising solution")]
    structure = replace(forward())
    assert bound_cell(structure) == "-"


@pytest.mark.ci
def test_a_speed_that_is_hardly_enough_leaves_a_bound() -> None:
    # Its price grows until rounding leaves variances below zero: the last good point is a bound.
    case = load_case("subsea-crane").replace({"rope.falls": 2, "rope.length": "500 m"})
    bound = sh.evaluate_gains(case, {"A": 1.0, "a": 0.0, "a1": 20.0, "a2": 3.0}).bound.free
    assert bound.feasible
    assert 0.03 < bound.value < 0.1
    assert verify_bound(bound).ok


@pytest.mark.ci
def test_a_drift_that_is_modelled_with_slow_poles_leaves_the_bound_its_digits() -> None:
    # The fitted factor of the unit's drift has poles at 1e-5 rad/s, below which what a force does
    # to the payload and what the controller does against it cancel to a dozen digits.
    bound = bound_for(sh.load_case("subsea-crane")).free
    assert bound.value < bound.attained < 2.0 * math.sqrt(bound.point.variances[0])
