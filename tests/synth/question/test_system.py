"""What follows from a case, in numbers: against the plant at rest, and sums over the spectrum."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from models import PhysicsWarning, load_case
from models.hook import HookMotion
from models.plant import PlantData, build_plant
from models.plant.equations import parameter_values
from models.plant.rope import chain_of, lump_rope
from synth.question import system_facts

#: Rigs of every kind, as changes of the crane.
RIGS = {
    "crane": {},
    "two falls": {"rope.falls": 2, "rope.length": 700.0},
    "slings and block": {"rigging": {"stiffness": "8 MN/m", "block_mass": "3 t"}},
    "no sheaves": {"rope.sheaves": 0},
}


def crane(rig: str, **changes):
    return load_case("subsea-crane").variant({"limits.drive": "report", **RIGS[rig], **changes})


@pytest.mark.parametrize("rig", RIGS)
def test_rest_is_that_of_the_plant(rig):
    """Hauling, paying out the lightest load, and the mean of both ways, by the plant's statics."""
    case = crane(rig)
    facts = system_facts(case).winch
    plant = build_plant(case)
    hauling = plant.operating_point({"winch.gear_direction": 1.0})
    assert facts.drum_tension_hauling == pytest.approx(hauling.outputs["rope.tension"], rel=1e-9)
    assert facts.static_torque == pytest.approx(hauling.torque, rel=1e-9)
    mean = plant.operating_point({"winch.gear_direction": 0.0})
    assert facts.drum_tension == pytest.approx(mean.outputs["rope.tension"], rel=1e-9)
    assert facts.load_tension == pytest.approx(mean.outputs["rope.lower_tension"], rel=1e-9)
    light = {"payload.submerged_weight": case.payload.least_weight}
    paying_out = plant.operating_point({"winch.gear_direction": -1.0, **light})
    assert facts.drum_tension_least == pytest.approx(paying_out.outputs["rope.tension"], rel=1e-9)
    lower = paying_out.outputs["rope.lower_tension"]
    assert facts.load_tension_least == pytest.approx(lower, rel=1e-9)
    assert facts.rating_share == facts.static_torque / case.winch.drive.torque_continuous
    assert facts.peak_share == facts.static_torque / case.winch.drive.torque_peak
    assert facts.tension_share == facts.drum_tension_hauling / 850e3
    assert facts.tension_to_stay == pytest.approx(0.1 * case.payload.least_weight)


@pytest.mark.parametrize("rig", RIGS)
def test_the_chain_stretches_by_what_hangs_on_each_spring(rig):
    """Against 40 springs, each stretched by the weight below its top."""
    case = crane(rig)
    rope = system_facts(case).rope
    values = parameter_values(PlantData.from_case(case))
    values["rope.axial_stiffness"] = case.rope.falls * case.rope.ea  # not that of a slow pull
    links = chain_of(values, lump_rope(40), case.rope.length)
    stretch = sum(link.carried / link.series for link in links)
    assert rope.stretch == pytest.approx(stretch, rel=3e-4)
    assert rope.stretch == rope.rope_stretch + rope.tip_stretch + rope.sling_stretch
    assert rope.tip_stretch == case.hung_weight / 3e6


@pytest.mark.parametrize("rig", RIGS)
def test_the_chain_is_a_row_of_springs_and_masses(rig):
    case = crane(rig)
    rope, data = system_facts(case).rope, PlantData.from_case(case)
    springs = (rope.stiffness, rope.tip_stiffness, rope.sling_stiffness)
    assert 1.0 / rope.series_stiffness == pytest.approx(sum(1.0 / k for k in springs), rel=1e-12)
    assert rope.tip_share == pytest.approx(rope.series_stiffness / 3e6, rel=1e-12)
    assert rope.sling_share == rope.series_stiffness / rope.sling_stiffness
    assert rope.stiffness == rope.falls * rope.axial_stiffness / case.rope.length
    assert rope.rope_share == 1.0 / 3.0
    masses = rope.payload_mass + rope.added_mass + rope.block_mass + rope.rope_mass / 3.0
    assert rope.moving_mass == pytest.approx(masses, rel=1e-12)
    assert rope.moving_mass == pytest.approx(data.hung_mass, rel=1e-12)
    # One spring of all of it has about the period of the first mode.
    omega = math.sqrt(rope.series_stiffness / rope.moving_mass)
    assert system_facts(case).modes[0].frequency == pytest.approx(omega, rel=0.02)


def test_axial_waves_need_a_quarter_of_the_period_of_a_rope_that_hangs_free():
    light = {"payload.mass": 20.0, "payload.added_mass": 0.0, "payload.submerged_weight": 100.0}
    facts = system_facts(crane("crane", **light, **{"crane.tip_stiffness": 1e12}))
    assert facts.modes[0].period == pytest.approx(4.0 * facts.rope.travel_time, rel=0.01)
    assert facts.modes[1].period == pytest.approx(4.0 / 3.0 * facts.rope.travel_time, rel=0.01)


def test_the_winch_turns_what_the_rope_and_the_hook_ask_for():
    case = crane("two falls")
    facts, hook = system_facts(case), HookMotion.from_case(case)
    radius, ratio = case.drum_radius, case.winch.gearbox.ratio
    speed = hook.velocity.most_probable_maximum(case.limits.exposure_time)
    assert facts.winch.hook_speed == speed
    assert facts.winch.rope_speed == pytest.approx(case.winch.speed_limit * radius / ratio)
    # Two falls take in two metres of rope a metre.
    assert facts.winch.speed_share == pytest.approx(2.0 * speed / facts.winch.rope_speed)
    # As much kinetic energy at the same speed of the load.
    turning = 0.5 * case.winch.inertia * (2.0 * ratio / radius) ** 2
    assert 0.5 * facts.winch.equivalent_mass == pytest.approx(turning, rel=1e-12)
    power = facts.winch.static_torque * 2.0 * speed * ratio / radius
    assert facts.winch.following_power == pytest.approx(power, rel=1e-9)


@pytest.mark.parametrize(
    "sea",
    [
        {},
        {"sea.peak_period": 16.0, "sea.significant_height": 3.0},
        {"vessel.speed": 2.0},
        {"vessel.heading": 1.0},
    ],
    ids=["its own", "swell", "under way", "following"],
)
def test_nine_tenths_of_the_hook_lie_in_the_band(sea):
    case = crane("crane", **sea)
    facts, hook = system_facts(case), HookMotion.from_case(case)
    omega = np.linspace(*hook.band, 400_001)
    density = hook.density(omega)
    parts = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(omega))])
    below, within = np.interp([facts.waves.low, facts.waves.high], omega, parts) / parts[-1]
    assert (below, within) == pytest.approx((0.05, 0.95), abs=2e-3)
    peak = omega[np.argmax(density)]
    # Where the spectrum is a sum over headings and knots its top is flat.
    assert hook.density(facts.waves.peak) == pytest.approx(density.max(), rel=5e-3)
    assert facts.waves.peak == pytest.approx(peak, rel=0.02)


@pytest.mark.parametrize(
    ("added_mass", "place"), [(400e3, "below"), (150e3, "in"), (50e3, "above"), (1e3, "above")]
)
def test_a_mode_has_its_place_among_the_waves(added_mass, place):
    case = crane("crane", **{"payload.added_mass": added_mass})
    facts, hook = system_facts(case), HookMotion.from_case(case)
    first, *others = facts.modes
    assert first.place == place
    assert (facts.waves.low > first.frequency) == (place == "below")
    assert (facts.waves.high < first.frequency) == (place == "above")
    assert [mode.place for mode in others] == ["above", "above"]
    assert [mode.number for mode in facts.modes] == [1, 2, 3]
    density = hook.density(np.array([first.frequency, facts.waves.peak]))
    assert first.relative_density == pytest.approx(density[0] / density[1], rel=1e-12)
    assert 0.0 < first.relative_density <= 1.0 + 1e-9
    assert all(mode.relative_density < 1e-3 for mode in others)


def test_modes_have_periods_and_damping():
    """Half a per cent of drag, and the rope's own; the payload hardly moves in the higher modes."""
    case = crane("crane", **{"payload.drag": {"method": "given", "coefficient": 1000.0}})
    facts = system_facts(case)
    for mode in facts.modes:
        assert mode.period * mode.frequency == pytest.approx(2.0 * math.pi, rel=1e-12)
    first, second, third = facts.modes
    drag = 1000.0 / (2.0 * facts.rope.moving_mass * first.frequency)
    assert first.damping_ratio == pytest.approx(drag + 0.002, rel=0.03)
    # 0.2 % in every mode; the tip, which has no damping, takes part of their energy.
    assert 0.0015 < third.damping_ratio < second.damping_ratio < 0.0021
    assert facts.held.drag == 1000.0
    assert facts.held.drag_method == "given"


def test_drag_damps_the_first_mode_in_the_sea_that_it_was_found_in():
    calm, rough = (
        system_facts(crane("crane", **{"sea.significant_height": height})) for height in (0.5, 2.5)
    )
    assert calm.held.drag_method == rough.held.drag_method == "stochastic"
    assert calm.held.drag < rough.held.drag
    assert calm.modes[0].damping_ratio < rough.modes[0].damping_ratio
    assert calm.held.factor > rough.held.factor
    for facts in (calm, rough):
        assert facts.held.factor == facts.held.payload_rms / facts.held.hook_rms


def test_a_mode_that_does_not_swing_has_all_of_critical_damping():
    case = load_case("thesis-1975").variant({"payload.drag.coefficient": 1e6})
    (mode,) = system_facts(case).modes
    assert mode.damping_ratio == 1.0
    assert mode.frequency == pytest.approx(math.sqrt(80e3 / 89888.0), rel=1e-4)


def test_nothing_that_damps_leaves_no_bound():
    facts = system_facts(load_case("thesis-1975").variant({"payload.drag.coefficient": 0.0}))
    assert facts.held.payload_rms == facts.held.factor == math.inf
    assert facts.modes[0].damping_ratio == 0.0


def test_a_hook_that_stands_has_no_factor():
    case = load_case("thesis-1975")
    still = [0.0] * len(case.vessel.heave_rao.amplitude)
    changes = {"vessel.heave_rao.amplitude": still, "vessel.below": "zero"}
    facts = system_facts(case.variant(changes))
    assert facts.held.payload_rms == 0.0
    assert math.isnan(facts.held.factor)
    assert facts.modes[0].relative_density == 0.0


def test_a_hook_that_is_known_is_taken():
    case = load_case("subsea-crane")
    hook = HookMotion.from_case(case)
    known, own = system_facts(case, hook.scaled(1.0)), system_facts(case)
    assert known.held.hook_rms == pytest.approx(0.5 * own.held.hook_rms)
    assert known.winch.hook_speed == pytest.approx(0.5 * own.winch.hook_speed)
    assert known.waves.low == pytest.approx(own.waves.low)


def test_the_user_is_told_of_a_sea_outside_the_table():
    changes = {
        "sea.significant_period": 3.5,
        "vessel.beyond": "zero",
        "sea.significant_height": 0.5,
    }
    with pytest.warns(PhysicsWarning, match="lies outside the table"):
        system_facts(load_case("thesis-1975").replace(changes))


def test_facts_are_frozen_numbers():
    facts = system_facts(load_case("thesis-1975"))
    with pytest.raises(dataclasses.FrozenInstanceError):
        facts.rope.stiffness = 1.0
    for part in (facts.rope, facts.waves, facts.held, facts.winch, *facts.modes):
        for field in dataclasses.fields(part):
            assert type(getattr(part, field.name)) in (int, float, str, type(None)), field.name
