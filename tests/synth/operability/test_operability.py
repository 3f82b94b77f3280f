"""Operability: limiting seas against single evaluations, closed forms, and sums by hand."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, ClassVar

import numpy as np
import pytest
from designs import THESIS_GAINS, thesis_design, unstable_design
from former_cases import load_case
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from models import Case, InputError
from models.basics import Quadrature, peak_factor
from models.hook import HookMotion
from models.plant import PlantData
from models.sensing import MruModel
from synth import Design, evaluate_gains, optimise_gains
from synth.design.optimise import NESTED
from synth.limits import Limit
from synth.loop import Assessment
from synth.operability import operability
from synth.operability.capability import capability
from synth.operability.columns import SeaColumn, sea_column
from synth.operability.criteria import case_criteria, payload_criteria
from synth.operability.depths import drum_layer
from synth.operability.limiting import SeaStates, limiting_heights
from synth.operability.pose import pose_operability
from synth.operability.recheck import evaluate_in
from synth.operability.responses import SeaMoments
from synth.question import PAYLOAD, pose, uncompensated
from synth.structures import structures_aboard

pytestmark = pytest.mark.filterwarnings("ignore::models.basics.checks.PhysicsWarning")

T_S = 0.54**0.25 / 0.9  # significant over peak period of the 1975 spectrum
MILD = {"A": 200.0, "a": 20.0, "a1": 12.0, "a2": 60.0}


@cache
def one_heading():
    """The subsea crane with the heave of its hook as a table: no headings to choose from."""
    omega = [0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.4, 1.6]
    heave = [1.0, 1.0, 1.0, 1.02, 1.05, 1.05, 0.98, 0.82, 0.62, 0.43, 0.28, 0.12, 0.05]
    table = {"omega": omega, "amplitude": heave}
    return load_case("subsea-crane").replace({"vessel.heave_rao": table})


def dragged() -> Design:
    """The thesis's winch with drag that agrees with the motion, so not linear in H_s."""
    changes = {"payload.drag": {"method": "stochastic"}, "limits.drive": "report"}
    return evaluate_gains(load_case("thesis-1975").replace(changes), MILD)


FORWARD = {
    "drum.position_gain": 0.001,
    "heave.gain": 0.97845,
    "heave.lead": 0.65903,
    "heave.bandwidth": 1.4173,
}


@cache
def vessel_case() -> Case:
    """The thesis's winch over the starboard side of a supply vessel."""
    return load_case("thesis-1975").replace(
        {
            "vessel.raos": "osv-83m",
            "vessel.hook": {"x": -25.0, "y": -15.0, "z": 20.0},
            "vessel.heading": "150 deg",
            "payload.drag": {"method": "stochastic"},
        }
    )


def bisected(design: Design, limit: Limit, low: float, high: float) -> float:
    """The H_s at T_p = 11 s at which single evaluations change sides, by halving."""

    def broken(height: float) -> bool:
        sea = {"sea.significant_height": height, "sea.significant_period": T_S * 11.0}
        value = limit.measure(evaluate_in(design, design.case.replace(sea)))
        return value < limit.bound if limit.at_least else value > limit.bound

    assert not broken(low)
    assert broken(high)
    while high / low > 1.0 + 1e-6:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if broken(middle) else (middle, high)
    return low


@pytest.mark.ci
def test_the_contour_is_where_single_evaluations_change_sides() -> None:
    study = operability(thesis_design(), periods=[7.0, 11.0], payload_rms=0.05, payload_max="10 cm")
    contour = study.depths[0].contours["loop"]
    compared = 0
    for criterion, heights in zip(contour.criteria, contour.heights[:, 0], strict=True):
        if criterion.outputs and 0.0 < heights[1] < np.inf:
            found = bisected(thesis_design(), criterion, 0.01, 30.0)
            assert heights[1] == pytest.approx(found, rel=1e-6)
            compared += 1
    assert compared == 8


@pytest.mark.ci
@pytest.mark.parametrize("name", ["payload.rms", "motor.torque.peak"])
def test_so_it_is_where_the_drag_changes_with_the_sea(name: str) -> None:
    study = operability(dragged(), periods=[11.0], payload_rms=0.2)
    contour = study.depths[0].contours["loop"]
    at = [c.name for c in contour.criteria].index(name)
    height = float(contour.heights[at, 0, 0])
    found = bisected(dragged(), contour.criteria[at], 0.999 * height, 1.001 * height)
    assert height == pytest.approx(found, rel=1e-6)


def test_the_response_is_not_linear_in_the_height_where_the_drag_is_not() -> None:
    asked = pose_operability(dragged(), ())
    states = SeaStates(system=asked.held, column=sea_column(asked.case, 7.0))
    moments, C = states.moments_at(np.array([0.5, 2.0]), np.array([0, 0]))
    assert C[1] > 1.5 * C[0]
    sigma = np.sqrt(moments.m0["payload.displacement"])
    assert sigma[1] < 3.0 * sigma[0]


@pytest.mark.ci
@settings(max_examples=15, deadline=None)
@given(st.floats(0.0, 3e5), st.floats(0.4, 9.0))
def test_responses_at_any_drag_are_those_of_the_plant_with_that_drag(C: float, w: float) -> None:
    asked = pose_operability(dragged(), ())
    assert asked.loop is not None
    omega = np.array([w])
    base = asked.loop.responses(Quadrature(omega=omega, weights=np.ones(1)))
    view = Assessment(
        asked.loop.plant,
        asked.loop.controller,
        (),
        elements=(asked.loop.drag,),
        coefficients=[C],
    )
    for k, output in enumerate(base.outputs):
        expected = abs(view.response(output, "hook.heave", omega)[0]) ** 2
        assert base.gains([C])[k, 0, 0] == pytest.approx(expected, rel=1e-8)


def test_the_held_drum_is_that_of_the_uncompensated_payload() -> None:
    for case in (dragged().case, one_heading()):
        study = operability(case, periods=[9.0], payload_rms=0.3)
        height = float(study.dataset.height_limit_held.sel(limit="payload.rms").item())
        key, period = ("sea.peak_period", 9.0)
        if case.sea.spectrum == "bretschneider-1975":
            key, period = "sea.significant_period", 9.0 * T_S
        sea = case.replace({key: period, "sea.significant_height": height})
        hook = HookMotion.from_case(sea, warn=False)
        assert uncompensated(sea, PlantData.from_case(sea), hook)[1] == pytest.approx(0.3, rel=1e-8)


def test_the_tension_of_the_held_drum_carries_mass_and_drag_of_the_payload() -> None:
    # One spring: what the rope pulls with is what the load's inertia and drag ask for.
    asked = pose_operability(thesis_design(), ())
    omega = np.array([0.5, 0.94, 2.0])
    base = asked.held.responses(Quadrature(omega=omega, weights=np.ones(3)))
    data = asked.held.data
    rows = dict(zip(base.outputs, base.table[:-1, 0], strict=True))
    mass = data.payload_mass + data.rope_mass
    s = 1j * omega
    pulled = (mass * s**2 + asked.held.reference * s) * rows["payload.displacement"]
    assert rows["rope.tension"] == pytest.approx(pulled, rel=1e-9)
    own = pulled - data.rope_mass * s**2 * rows["payload.displacement"]  # the rope is above it
    assert rows["rope.lower_tension"] == pytest.approx(own, rel=1e-9)


def test_the_makers_lines_are_those_of_the_sheet() -> None:
    # H = v T / pi and H = a T^2 / (2 pi^2), with no friction to speak of.
    case = one_heading().replace({"winch.motor.viscous_friction": 0.0})
    asked = pose_operability(case, ())
    T = np.array([5.0, 8.0, 14.0])
    lines = capability(asked.perfect, asked.criteria["perfect"], T)
    rows = {c.name: h for c, h in zip(lines.criteria, lines.heights, strict=True)}
    r, n = case.drum_radius, case.winch.gearbox.ratio
    v = case.winch.speed_limit * r / n
    assert rows["motor.speed.peak"] == pytest.approx(v * T / math.pi, rel=1e-12)
    plant = pose(case).plant
    mean, loss = plant.static["motor.torque"], plant.loss["motor.torque"]
    a = (case.winch.drive.torque_peak - mean - loss) * r / (n * case.winch.inertia)
    assert rows["motor.torque.peak"] == pytest.approx(a * T**2 / (2.0 * math.pi**2), rel=1e-12)
    b = math.sqrt(2.0 * (case.winch.drive.torque_continuous**2 - mean**2 - loss**2)) * r
    b /= n * case.winch.inertia
    continuous = rows["motor.torque.continuous"]
    assert continuous == pytest.approx(b * T**2 / (2.0 * math.pi**2), rel=1e-12)
    # At the line of the power, the peaks' product is the power.
    A, w = 0.5 * rows["motor.power.peak"], 2.0 * math.pi / T
    torque = mean + loss + case.winch.inertia * n / r * A * w**2
    power = torque * n / r * A * w
    assert power == pytest.approx(np.full(3, case.winch.power_limit), rel=1e-12)


def test_the_makers_lines_of_an_induction_motor_are_below_its_breakdown_torque() -> None:
    changes = {"winch.motor.viscous_friction": 0.0, "winch.motor.base_speed": 60.0}
    case = one_heading().replace(changes)
    T = np.array([5.0, 8.0, 14.0])
    rows = {}
    for kind in (None, "induction"):
        asked = pose_operability(case.variant({"winch.motor.kind": kind}), ())
        lines = capability(asked.perfect, asked.criteria["perfect"], T)
        names = [c.name for c in lines.criteria]
        rows[kind] = dict(zip(names, lines.heights, strict=True))
    plant = pose(case).plant
    static = plant.static["motor.torque"] + plant.loss["motor.torque"]
    n, r = case.winch.gearbox.ratio, case.drum_radius
    A, w = 0.5 * rows["induction"]["motor.torque.breakdown"], 2.0 * math.pi / T
    torque = static + case.winch.inertia * n / r * A * w**2
    left = 2.5 * case.winch.drive.torque_continuous / (n / r * A * w / 60.0) ** 2
    assert torque == pytest.approx(left, rel=1e-9)
    thermal = rows["induction"]["motor.torque.continuous"]
    assert np.all(thermal < rows[None]["motor.torque.continuous"])
    assert "motor.torque.breakdown" not in rows[None]


def test_a_perfect_winch_follows_the_hooks_own_speed() -> None:
    case = one_heading()
    study = operability(case, periods=[6.0, 12.0])
    limit = study.dataset.height_limit_perfect.sel(limit="motor.speed.peak").values
    for period, height in zip((6.0, 12.0), limit, strict=True):
        sea = case.replace({"sea.peak_period": period, "sea.significant_height": float(height)})
        speed = HookMotion.from_case(sea, warn=False).velocity
        line = speed.rms * peak_factor(speed.zero_crossing_period, case.limits.exposure_time)
        top = case.winch.speed_limit * case.drum_radius / case.winch.gearbox.ratio
        assert line == pytest.approx(top, rel=1e-6)


def test_with_fixed_drag_the_limit_grows_as_the_bound() -> None:
    heights = [
        float(operability(thesis_design(), periods=[8.0], payload_rms=b).dataset.height_limit[1, 0])
        for b in (0.002, 0.004)
    ]
    assert heights[1] == pytest.approx(2.0 * heights[0], rel=1e-8)


@pytest.mark.ci
@settings(max_examples=8, deadline=None)
@given(st.floats(0.02, 1.0), st.floats(1.01, 3.0), st.floats(5.0, 14.0))
def test_a_wider_bound_never_lowers_the_limit(bound: float, factor: float, period: float) -> None:
    asked = pose_operability(dragged(), ())
    assert asked.loop is not None
    states = SeaStates(system=asked.loop, column=sea_column(asked.case, period))
    narrow, wide = (
        payload_criteria(asked.case, rms=b, maximum=4.0 * b, speed=2.0 * b)
        for b in (bound, factor * bound)
    )
    low = limiting_heights(states, narrow)[0]
    high = limiting_heights(states, wide)[0]
    assert np.all(high >= low)
    assert np.all(high[np.isfinite(low) & (low > 0.0)] > low[np.isfinite(low) & (low > 0.0)])


@pytest.mark.ci
@settings(max_examples=10, deadline=None)
@given(st.floats(5.0, 14.0), st.floats(0.05, 8.0), st.floats(1.05, 4.0))
def test_a_higher_sea_moves_everything_more(period: float, height: float, factor: float) -> None:
    asked = pose_operability(dragged(), ())
    for system in asked.systems.values():
        states = SeaStates(system=system, column=sea_column(asked.case, period))
        both = np.array([height, factor * height])
        moments, C = states.moments_at(both, np.array([0, 0]))
        for name in moments.m0:
            assert moments.m0[name][1] > moments.m0[name][0]
        assert np.all(np.isfinite(C))


def test_significant_and_rms_are_one_limit_and_the_largest_another() -> None:
    study = operability(
        dragged(), periods=[8.0], payload_rms=0.1, payload_significant="400 mm", payload_max=0.5
    )
    limit = study.dataset.height_limit.squeeze()
    assert float(limit.sel(limit="payload.rms")) == pytest.approx(
        float(limit.sel(limit="payload.significant")), rel=1e-9
    )
    case = dragged().case.replace(
        {
            "sea.significant_height": float(limit.sel(limit="payload.max")),
            "sea.significant_period": 8.0 * T_S,
        }
    )
    view = evaluate_in(dragged(), case)
    assert view.peak("payload.displacement", 10800.0) == pytest.approx(0.5, rel=1e-7)


def test_arrays_of_moments_have_the_peaks_of_the_single_formula() -> None:
    m0, m2 = np.array([4.0, 0.0, 1e-6]), np.array([1.0, 0.0, 1e-16])
    found = SeaMoments(m0={"x": m0}, m2={"x": m2}).peak("x", 10800.0)
    assert found[0] == pytest.approx(2.0 * peak_factor(4.0 * math.pi, 10800.0), rel=1e-12)
    assert found[1] == 0.0
    assert found[2] == pytest.approx(1e-3)  # fewer than e^(1/2) crossings: one sigma


def test_a_spectrum_that_cannot_be_scaled_is_built_anew_at_each_height() -> None:
    asked = pose_operability(dragged(), payload_criteria(dragged().case, rms=0.1))
    assert asked.loop is not None
    column = sea_column(asked.case, 9.0)
    assert column.scalable
    rebuilt: SeaColumn = replace(column, scalable=False)
    criteria = asked.criteria["loop"]
    found = [
        limiting_heights(SeaStates(system=asked.loop, column=c), criteria, highest=6.0)[0]
        for c in (column, rebuilt)
    ]
    assert found[0] == pytest.approx(found[1], rel=1e-8)


def test_torsethaugen_has_its_limits_at_the_shape_of_that_height() -> None:
    case = one_heading().replace({"sea.spectrum": "torsethaugen"})
    column = sea_column(case, 9.0)
    assert not column.scalable
    # So it is with a peak enhancement that follows the height, in steep seas only.
    own_gamma = one_heading().replace({"sea.gamma": "auto"})
    assert not sea_column(own_gamma, 9.0).scalable
    assert sea_column(one_heading(), 9.0).scalable
    assert 0.0 < column.floor < 0.3
    study = operability(case, periods=[9.0], payload_rms=0.3, highest=8.0)
    height = float(study.dataset.height_limit_held.sel(limit="payload.rms").item())
    sea = case.replace({"sea.significant_height": height})
    hook = HookMotion.from_case(sea, warn=False)
    assert uncompensated(sea, PlantData.from_case(sea), hook)[1] == pytest.approx(0.3, rel=1e-7)


def test_a_sea_without_a_period_has_one_limit_in_its_own_shape() -> None:
    tree = one_heading().to_dict()
    for sea in (
        {"spectrum": "pierson-moskowitz", "significant_height": 2.5},
        {"spectrum": "measured", "table": {"omega": [0.3, 0.6, 1.5], "density": [0.1, 1.2, 0.0]}},
    ):
        case = Case.from_dict({**tree, "sea": sea})
        study = operability(case, payload_rms=0.3, highest=8.0)
        height = float(study.dataset.height_held.item())
        at = case.replace({"sea.significant_height": height})
        hook = HookMotion.from_case(at, warn=False)
        assert uncompensated(at, PlantData.from_case(at), hook)[1] == pytest.approx(0.3, rel=1e-7)
        with pytest.raises(InputError, match="has no peak_period"):
            operability(case, periods=[8.0])
        with pytest.raises(InputError, match="cannot be set against a scatter diagram"):
            operability(case, scatter="example")


def test_each_heading_is_the_case_in_that_heading() -> None:
    gains = evaluate_gains(vessel_case(), MILD)
    angles = [math.radians(a) for a in (60.0, 180.0, 270.0)]
    study = operability(gains, periods=[9.0], headings=angles, payload_rms=0.1)
    assert study.dataset.height.dims == ("heading", "peak_period")
    heights = study.dataset.height_limit.sel(limit="payload.rms").values[:, 0]
    for angle, height in zip(angles, heights, strict=True):
        sea = {
            "vessel.heading": angle,
            "sea.significant_height": float(height),
            "sea.significant_period": 9.0 * T_S,
        }
        sigma = evaluate_in(gains, gains.case.replace(sea)).sigma("payload.displacement")
        assert sigma == pytest.approx(0.1, rel=1e-7)


def test_a_hook_on_the_centre_line_knows_no_port_or_starboard() -> None:
    case = vessel_case().replace({"vessel.hook.y": 0.0})
    angles = [math.radians(a) for a in (45.0, 120.0, 240.0, 315.0)]
    study = operability(case, periods=[8.0], headings=angles, payload_rms=0.3)
    height = study.dataset.height_held.values[:, 0]
    assert height[0] == pytest.approx(height[3], rel=1e-6)
    assert height[1] == pytest.approx(height[2], rel=1e-6)
    off = operability(vessel_case(), periods=[8.0], headings=angles, payload_rms=0.3)
    assert off.dataset.height_held.values[1, 0] < 0.95 * height[1]


def test_a_rope_length_takes_its_layer_with_it() -> None:
    case = one_heading()
    study = operability(case, periods=[9.0], payload_rms=0.3, depths=[200.0, 1000.0, 1400.0])
    layers = [at.layer for at in study.depths]
    assert layers == [5, 2, 1]
    assert [at.layers for at in study.depths] == [5, 5, 5]
    lays = case.winch.drum.lays(case.rope.diameter)
    assert [at.case.drum_radius for at in study.depths] == [lays[k - 1][1] for k in layers]
    data = study.dataset
    assert data.height_held.dims == ("rope_length", "peak_period")
    alone = operability(case.replace({"rope.length": 1400.0}), periods=[9.0], payload_rms=0.3)
    assert data.height_held.values[2] == pytest.approx(alone.dataset.height_held.values, rel=1e-10)
    assert float(data.static_torque[2]) == pytest.approx(
        case.replace({"rope.length": 1400.0}).static_torque_budget
    )
    # A radius that is given knows no layers.
    assert drum_layer(load_case("thesis-1975")) == (0, 0)


@pytest.mark.ci
def test_gains_stay_when_the_rope_gets_longer() -> None:
    study = operability(dragged(), periods=[9.0], payload_rms=0.2, depths=[1500.0, 2500.0])
    assert study.depths[0].max_sensitivity != pytest.approx(study.depths[1].max_sensitivity)
    for at in study.depths:
        height = float(at.contours["loop"].heights[1, 0, 0])
        case = dragged().case.replace(
            {
                "rope.length": at.length,
                "sea.significant_height": height,
                "sea.significant_period": 9.0 * T_S,
            }
        )
        view = evaluate_in(dragged(), case)
        assert view.sigma("payload.displacement") == pytest.approx(0.2, rel=1e-7)
        view = evaluate_in(dragged(), dragged().case.replace({"rope.length": at.length}))
        assert at.max_sensitivity == pytest.approx(view.margins.max_sensitivity, rel=1e-6)


def agreed(case: Case, structure: str) -> None:
    """Assert that operability says of a design's limits what `optimise_gains` says of them."""
    design = optimise_gains(case, structure, starts=2)
    assert design.margins is not None
    heading = getattr(case.vessel, "heading", None)
    headings = [heading] if getattr(case.vessel, "raos", None) else None
    study = operability(design, periods=[case.sea.spectral_peak_period], headings=headings)
    (at,) = study.depths
    assert at.masses == design.masses
    if design.feasible:
        assert at.max_sensitivity == pytest.approx(design.margins.max_sensitivity, rel=1e-7)
        for name, use in design.limits.items():
            if name in {criterion.name for criterion in at.contours["loop"].criteria}:
                assert (name in at.own.broken) == (not use.kept), (structure, name)
    if design.ok:
        assert "within its limit" in study.margin_text(at)
        assert study.ok or case.limits.drive == "report", (structure, study.status)


@pytest.mark.ci
def test_what_is_ok_is_workable_in_its_own_sea() -> None:
    # At the limiting sea, 6.7 m, the drag is another and M_s 2.015; the own sea counts.
    agreed(load_case("subsea-crane").replace({"rope.length": 1000.0}), "payload-feedback")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "length"),
    [
        ("thesis-1975", None),
        ("landing", None),
        ("subsea-crane", 100.0),
        ("subsea-crane", 300.0),
        ("subsea-crane", 1000.0),
    ],
)
def test_what_is_ok_is_workable_for_every_case_structure_and_depth(
    name: str, length: float | None
) -> None:
    case = load_case(name)
    for structure in structures_aboard(case, NESTED):
        agreed(case if length is None else case.replace({"rope.length": length}), structure)


@pytest.mark.ci
def test_at_another_depth_the_loop_is_that_of_an_evaluation_there() -> None:
    gains = {"A": 1.0, "a": 16.02, "a1": 44.36, "a2": 6.416}
    design = evaluate_gains(load_case("subsea-crane"), gains)
    study = operability(design, periods=[9.0], headings=[2.9], depths=[700.0])
    there = evaluate_gains(design.case.replace({"rope.length": 700.0}), design.parameters)
    assert study.depths[0].masses == there.masses
    assert there.margins is not None
    assert study.depths[0].max_sensitivity == pytest.approx(there.margins.max_sensitivity, rel=1e-9)


@dataclass(frozen=True, kw_only=True)
class Bumpy(Limit):
    """Broken about one height, and for good above another: the excess as a function of ln H_s."""

    at: float
    width: float
    drive: ClassVar[bool] = True
    output: str = "payload.displacement"

    def rows(self, symbols: Any, bound: float) -> Any:
        size = 0.5 * np.log(np.asarray(symbols.moment(self.output, 0)))
        bump = 0.45 * np.exp(-0.5 * ((size - np.log(self.at)) / self.width) ** 2)
        return -0.2 + bump + np.clip(0.05 * (size - np.log(self.bound)), -0.1, np.inf)

    def measure(self, loop: Assessment) -> float:
        raise NotImplementedError


@pytest.mark.parametrize("at", [1.05, 1.1, 1.2, 1.3, 1.42])
def test_a_limit_that_breaks_and_holds_again_between_two_heights_is_found(at: float) -> None:
    # With fixed drag sigma is H_s times a constant; the coarse grid's heights are 40 % apart.
    case = one_heading().variant({"payload.drag": {"method": "given", "coefficient": 2e4}})
    question = pose_operability(case, ())
    states = SeaStates(system=question.held, column=sea_column(case, 9.0))
    unit = np.sqrt(states.moments_at(np.ones(1), np.zeros(1, dtype=int))[0].moment(PAYLOAD, 0))[0]
    bumpy = Bumpy(bound=20.0 * unit, at=at * unit, width=0.1, name="bumpy")
    found = float(limiting_heights(states, [bumpy])[0][0, 0])

    def excess(height: float) -> float:
        return (
            -0.2
            + 0.45 * math.exp(-0.5 * (math.log(height / at) / 0.1) ** 2)
            + max(0.05 * math.log(height / 20.0), -0.1)
        )

    grid = np.geomspace(0.01, at, 4000)
    first = next(h for h in grid if excess(h) > 0.0)
    assert found == pytest.approx(brentq(excess, 0.97 * first, first), rel=1e-8)
    assert excess(1.5 * found) < 0.0


@pytest.mark.ci
def test_an_unstable_loop_works_in_no_sea() -> None:
    with pytest.raises(InputError, match="no stabilising controller"):
        operability(unstable_design(), periods=[8.0])
    asked = pose_operability(dragged(), payload_criteria(dragged().case, rms=1.0))
    assert asked.loop is not None
    bad = pose(dragged().case).assess({**MILD, "A": -200.0}, [0.0]).controller
    loop = replace(asked.loop, controller=bad)
    assert loop.stable_range == (np.inf, 0.0)
    heights, _ = limiting_heights(
        SeaStates(system=loop, column=sea_column(asked.case, 8.0)), asked.criteria["loop"]
    )
    assert np.all(heights == 0.0)


def test_a_loop_that_needs_drag_to_be_stable_works_in_no_sea() -> None:
    # Quadratic drag vanishes in small motion, so that such a loop swings by itself.
    asked = pose_operability(dragged(), ())
    assert asked.loop is not None

    class Edge(type(asked.loop)):  # type: ignore[misc]
        def poles(self, coefficient: float) -> np.ndarray:
            return np.array([complex(1.0 - coefficient / 5e4, 0.3)])

    loop = Edge(**{name: getattr(asked.loop, name) for name in _fields(asked.loop)})
    low, high = loop.stable_range
    assert low == pytest.approx(5e4, rel=1e-9)
    assert high == np.inf
    assert loop.swings
    assert not asked.loop.swings
    heights, _ = limiting_heights(
        SeaStates(system=loop, column=sea_column(asked.case, 8.0)), asked.criteria["loop"]
    )
    assert np.all(heights == 0.0)


def test_a_loop_that_too_much_drag_destabilises_works_below_that() -> None:
    asked = pose_operability(dragged(), payload_criteria(dragged().case, rms=0.1))
    assert asked.loop is not None

    class Edge(type(asked.loop)):  # type: ignore[misc]
        def poles(self, coefficient: float) -> np.ndarray:
            return np.array([complex(coefficient / 4e3 - 1.0, 0.3)])

    loop = Edge(**{name: getattr(asked.loop, name) for name in _fields(asked.loop)})
    assert loop.stable_range == (0.0, pytest.approx(4e3, rel=1e-9))
    column = sea_column(asked.case, 8.0)
    for system in (loop, asked.loop):
        found, _ = limiting_heights(SeaStates(system=system, column=column), asked.criteria["loop"])
        if system is loop:
            edged = found
    assert edged[1] == pytest.approx(found[1], rel=1e-8)
    # Stability is lost where the drag of the motion reaches the edge, and not before.
    height = float(edged[0, 0])
    assert height > float(edged[1, 0])
    states = SeaStates(system=asked.loop, column=column)
    assert states.moments_at(np.array([height]), np.array([0]))[1][0] == pytest.approx(
        4e3, rel=1e-6
    )


def _fields(system: object) -> list[str]:
    from dataclasses import fields

    return [f.name for f in fields(system)]  # type: ignore[arg-type]


def test_a_load_that_breaks_a_limit_at_rest_has_no_sea() -> None:
    case = load_case("thesis-1975").replace(
        {"winch.drive.torque_continuous": 4000.0, "winch.drive.torque_peak": 4900.0}
    )
    study = operability(evaluate_gains(case, THESIS_GAINS), periods=[8.0])
    row = study.dataset.height_limit.squeeze()
    assert float(row.sel(limit="motor.torque.peak")) == 0.0
    assert float(study.dataset.height.squeeze()) == 0.0
    assert not study.ok


def test_every_limit_of_the_case_is_among_the_criteria_and_slack_always() -> None:
    case = load_case("thesis-1975")
    names = {c.name for c in case_criteria(case, pose(case).plant)}
    assert {"motor.torque.peak", "motor.voltage.peak", "rope.tension.least"} <= names
    ends = [c for c in case_criteria(case, pose(case).plant) if c.name.endswith("least")]
    assert [c.outputs for c in ends] == [("rope.tension",), ("rope.lower_tension",)]
    assert [c.bound for c in ends] == [pytest.approx(0.095 * case.payload.submerged_weight)] * 2
    old = case.replace({"limits.tension_ends": "drum"})
    (slack,) = [c for c in case_criteria(old, pose(old).plant) if c.name.endswith("least")]
    assert (slack.outputs, slack.bound) == (("rope.tension",), 0.0)


def combined_design() -> Design:
    """Feedback and feed-forward together: a loop that hears the reference unit."""
    case = one_heading()
    parameters = {
        "payload.acceleration_gain": 0.971228,
        "payload.velocity_gain": 1.61572,
        "payload.position_gain": 2.85487,
        "drum.position_gain": 0.679489,
        "heave.gain": 0.929099,
        "rolloff.corner": 19.6841,
        "rolloff.damping": 0.97761,
        "heave.lead": 0.0263462,
        "heave.bandwidth": 7.56484,
    }
    return evaluate_gains(case, parameters, "combined")


def test_noise_of_the_reference_unit_grows_with_the_heave_and_has_a_floor() -> None:
    asked = pose_operability(combined_design(), ())
    loop, unit = asked.loop, asked.case.sensors.mru
    assert loop is not None
    assert unit is not None
    states = SeaStates(system=loop, column=sea_column(asked.case, 9.0))
    densities = states.densities(np.array([0.5, 2.0, 6.0, 9.0]), np.zeros(4, dtype=np.intp))
    weights = states.responses.nodes.weights
    heave = np.sqrt(densities[0] @ weights)
    # 5 cm or 5 % of the heave, whichever is greater
    expected = [MruModel(unit, 0.05, float(rms), 0).error_rms for rms in heave]
    assert expected[0] == expected[1] == unit.noise_floor < expected[2] < expected[3]
    at = [noise.name for noise in loop.noises].index("mru.error") + 1
    found = np.sqrt(densities[at] @ weights)
    np.testing.assert_allclose(found / found[0], np.divide(expected, expected[0]), rtol=1e-9)


@pytest.mark.ci
def test_errors_of_the_reference_unit_grow_with_the_sea() -> None:
    design = combined_design()
    case = design.case
    # Above and below H_s = 4.3 m, where 5 % of the heave is as much as the floor of 5 cm.
    for bound in (0.021, 0.06):
        study = operability(design, periods=[9.0], payload_rms=bound)
        limit = study.dataset.height_limit.squeeze()
        height = float(limit.sel(limit="payload.rms"))
        view = evaluate_in(design, case.replace({"sea.significant_height": height}))
        assert view.sigma("payload.displacement") == pytest.approx(bound, rel=1e-6)
    assert height > 4.5


@pytest.mark.slow
def test_gains_found_anew_never_do_worse_than_gains_within_the_same_margins() -> None:
    case = load_case("thesis-1975").replace(
        {"limits.drive": "enforce", "sea.significant_height": 0.5}
    )
    design = evaluate_gains(case, {"A": 200.0, "a": 21.908422, "a1": 12.003924, "a2": 68.339717})
    study = operability(design, periods=[6.0, 8.0], payload_rms="60 mm", reoptimise=True)
    fixed, anew = study.dataset.height.values, study.dataset.height_reoptimised.values
    assert np.all(anew >= fixed * (1.0 - 1e-3))
    assert anew[0] > 1.02 * fixed[0]  # gains of one sea are not those of another


def test_what_cannot_be_asked_is_refused() -> None:
    case = load_case("thesis-1975")
    with pytest.raises(InputError, match="has no headings"):
        operability(case, headings=[0.0, 1.0])
    with pytest.raises(InputError, match="payload_rms"):
        operability(case, payload_rms="50 kN")
    with pytest.raises(InputError, match="payload_rms must be above 0"):
        operability(case, payload_rms=0.0)
    with pytest.raises(InputError, match="periods must be strictly ascending"):
        operability(case, periods=[8.0, 7.0])
    with pytest.raises(
        InputError, match=r"operability: periods must be in \[0.5, 60\] s, got 1e-09"
    ):
        operability(case, periods=[1e-9, 7.0])
    with pytest.raises(InputError, match="reoptimise begins at a design"):
        operability(case, reoptimise=True)
    with pytest.raises(InputError, match="less than the 9000 m paid out"):
        operability(one_heading(), periods=[8.0], depths=[9000.0])
    with pytest.raises(InputError, match="highest must be in"):
        operability(case, highest=80.0)


@pytest.mark.parametrize(
    "unit",
    [
        {"noise_floor": 0.01, "noise_fraction": 0.2},
        {"gain_error": 0.2, "phase_error": 0.1, "drift": 0.02, "noise": 1e-4},
    ],
)
def test_the_error_of_the_reference_unit_grows_as_it_is_stated(unit):
    case = one_heading().replace({"sensors.mru": unit, "limits.drive": "report"})
    design = evaluate_gains(case, FORWARD, "feed-forward")
    study = operability(design, periods=[11.0], payload_rms=0.1)
    contour = study.depths[0].contours["loop"]
    at = [c.name for c in contour.criteria].index("payload.rms")
    sea = {"sea.significant_height": float(contour.heights[at, 0, 0]), "sea.peak_period": 11.0}
    found = contour.criteria[at].worst(evaluate_in(design, case.replace(sea)))
    assert found == pytest.approx(0.1, rel=1e-5)
    # An error that did not grow, or grew with the sea where it is a length, would be another.
    shares = evaluate_in(design, case.replace(sea)).shares("payload.displacement")
    assert shares["mru.error"] > 0.01
