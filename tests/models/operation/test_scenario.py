"""Scenarios: moves within their limits, schedules that do not depend on chunks, the library."""

from __future__ import annotations

import itertools
import math
import re
import warnings

import numpy as np
import pytest
from former_cases import load_case
from hypothesis import assume, given
from hypothesis import strategies as st
from still_motion import StillMotion

from models import InputError, PhysicsWarning, build_plant
from models.operation import (
    Scenario,
    Schedule,
    SineMotion,
    TouchDown,
    scenario_named,
    scenario_names,
    scenario_options,
)
from models.operation.profile import Move, Profile
from models.plant import Deck, PlantData, Seabed, Surroundings
from models.sensing.telemetry import during

CASES = ("thesis-1975", "thesis-1975-rope", "subsea-crane", "landing")
COLUMNS = ("time", "reference", "engage", "brake")


@pytest.fixture(scope="module")
def crane():
    return load_case("subsea-crane")


def scenario(**fields):
    return Scenario(**{"name": "mine", "description": "a test", "duration": 100.0, **fields})


MOVES = st.builds(
    Move,
    start=st.floats(0.0, 50.0),
    distance=st.floats(1e-3, 30.0) | st.floats(-30.0, -1e-3) | st.just(0.0),
    speed=st.floats(0.05, 2.0),
    acceleration=st.floats(0.02, 1.0),
)


RIG = {"crane.tip_stiffness": 3e6, "rigging.stiffness": 5e6, "rigging.block_mass": 1e2}


class TestMoves:
    @given(move=MOVES)
    def test_a_move_keeps_its_limits_and_arrives(self, move):
        time = np.linspace(0.0, move.end + 5.0, 4001)
        z, v, a = move.at(time).T
        assert np.max(np.abs(v)) <= move.speed * (1.0 + 1e-12)
        assert set(np.abs(a)) <= {0.0, move.acceleration}
        assert np.all(z[time <= move.start] == 0.0)
        assert np.all(z[time >= move.end] == move.distance)
        assert np.all(v[time >= move.end] == 0.0)
        assert np.all(np.diff(z) * math.copysign(1.0, move.distance) >= -1e-12)

    @given(move=MOVES)
    def test_velocity_and_displacement_are_integrals(self, move):
        time = np.linspace(0.0, move.end + 5.0, 4001)
        z, v, _ = move.at(time).T
        h = time[1]
        # Trapezoids: exact within a phase, off by the corners' share where phases meet.
        grown = 0.5 * h * (v[1:] + v[:-1])
        np.testing.assert_allclose(np.diff(z), grown, atol=0.25 * move.acceleration * h**2 + 1e-9)
        assert np.max(np.abs(np.diff(v))) <= move.acceleration * h * (1.0 + 1e-9) + 1e-9

    @given(move=MOVES)
    def test_how_long_it_takes(self, move):
        assume(move.distance != 0.0)
        length, v, a = abs(move.distance), move.speed, move.acceleration
        expected = length / v + v / a if length > v**2 / a else 2.0 * math.sqrt(length / a)
        assert move.end - move.start == pytest.approx(expected, rel=1e-9)

    def test_moves_add_up(self):
        one = Move(start=0.0, distance=2.0, speed=0.5, acceleration=0.5)
        two = Move(start=3.0, distance=-1.0, speed=0.5, acceleration=0.5)
        profile = Profile(moves=(one, two))
        time = np.linspace(0.0, 10.0, 101)
        np.testing.assert_array_equal(profile.at(time), one.at(time) + two.at(time))
        assert profile.end == two.end == 6.0
        assert Profile().end == 0.0
        np.testing.assert_array_equal(Profile().at(time), np.zeros((101, 3)))

    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            ({"start": -1.0}, "move: start must be at least 0 s, got -1.0"),
            ({"speed": 0.0}, "move: speed must be above 0 m/s, got 0.0"),
            ({"acceleration": -1.0}, "move: acceleration must be above 0 m/s2, got -1.0"),
            ({"distance": math.inf}, "move: distance must be a finite number in m, got inf"),
        ],
    )
    def test_bad_moves(self, changes, message):
        fields = {"start": 0.0, "distance": 1.0, "speed": 1.0, "acceleration": 1.0}
        with pytest.raises(InputError, match=message):
            Move(**{**fields, **changes})


BUSY = scenario(
    profile=Profile(moves=(Move(start=20.0, distance=-3.0, speed=0.5, acceleration=0.2),)),
    warm_up=5.0,
    ramp=4.0,
    disengage_at=80.0,
    brake_trips=((30.0, 35.0), (60.0, 61.0)),
    telemetry_outages=((10.0, 20.0),),
    sensor_failures=((12.0, 13.0), (15.0, 16.0)),
    mru_outages=((40.0, 50.0),),
)


class TestSchedule:
    @given(
        cuts=st.sets(st.integers(1, 1999), max_size=8),
        sample_time=st.sampled_from([0.05, 0.01, 1.0 / 30.0]),
    )
    def test_chunks_make_no_difference(self, cuts, sample_time):
        schedule = Schedule(scenario=BUSY, sample_time=sample_time)
        whole = schedule.block(0, 2000)
        parts = [schedule.block(a, b - a) for a, b in itertools.pairwise([0, *sorted(cuts), 2000])]
        for name in COLUMNS:
            joined = np.concatenate([getattr(part, name) for part in parts])
            np.testing.assert_array_equal(joined, getattr(whole, name))

    def test_from_warm_up_to_the_brake_at_the_end(self):
        schedule = Schedule(scenario=BUSY, sample_time=0.1)
        rows = schedule.block(0, 1001)
        at = {round(float(t), 1): i for i, t in enumerate(rows.time)}

        def state(time):
            return rows.engage[at[time]], rows.brake[at[time]]

        assert state(4.9) == (0.0, 1.0)
        assert state(5.0) == (pytest.approx(0.0, abs=1e-12), 0.0)
        assert state(7.0) == (pytest.approx(0.5), 0.0)
        assert state(6.0) == (pytest.approx(0.5 * (1.0 - math.cos(0.25 * math.pi))), 0.0)
        assert state(9.0) == state(29.9) == (1.0, 0.0)
        # A trip is at once, and engaging again takes the ramp.
        assert state(30.0) == state(34.9) == (0.0, 1.0)
        assert state(37.0) == (pytest.approx(0.5), 0.0)
        assert state(39.0) == (1.0, 0.0)
        assert state(82.0) == (pytest.approx(0.5), 0.0)
        assert state(83.9)[1] == 0.0
        assert state(84.0) == state(100.0) == (0.0, 1.0)

    def test_a_trip_while_ramping_out_is_the_end(self):
        rows = Schedule(
            scenario=scenario(ramp=4.0, disengage_at=80.0, brake_trips=((81.0, 82.0),)),
            sample_time=0.1,
        )
        after = rows.block(810, 190)
        assert np.all(after.brake == 1.0)
        assert np.all(after.engage == 0.0)
        assert rows.block(809, 1).brake[0] == 0.0

    def test_without_a_ramp_it_is_engaged_at_once(self):
        rows = Schedule(scenario=scenario(), sample_time=0.1).block(0, 10)
        assert np.all(rows.engage == 1.0)
        assert np.all(rows.brake == 0.0)

    @pytest.mark.parametrize("sample_time", [0.1, 0.05, 0.02])
    def test_what_fails_fails_from_the_first_sample_to_the_last(self, sample_time):
        # Multiples of these are not exact in binary; no sample may slip over an edge.
        samples = np.arange(round(100.0 / sample_time))
        per_second = round(1.0 / sample_time)
        for intervals, lost in (
            (BUSY.telemetry_outages, 10),
            (BUSY.sensor_failures, 2),
            (BUSY.mru_outages, 10),
        ):
            assert np.sum(during(intervals, samples, sample_time)) == lost * per_second
        gone = during(BUSY.telemetry_outages, samples, sample_time)
        assert np.flatnonzero(gone)[0] == 10 * per_second

    @pytest.mark.parametrize(
        ("field", "column"), [("encoder_outages", 2), ("load_cell_outages", 3)]
    )
    def test_encoder_and_load_cell_answer_but_in_their_outages(self, field, column):
        one = scenario(**{field: ((1.1, 2.3), (5.0, 5.5))})
        rows = Schedule(scenario=one, sample_time=0.1).block(0, 100).switches
        assert np.flatnonzero(rows[:, column] == 0.0).tolist() == [*range(11, 23), *range(50, 55)]
        assert np.all(np.delete(rows, column, axis=1) == [1.0, 0.0, 1.0])

    def test_a_touch_down_phase_cannot_do_without_encoder_and_load_cell(self):
        for field in ("encoder_outages", "load_cell_outages"):
            with pytest.raises(InputError, match="a touch-down phase needs encoder and load cell"):
                scenario(touch_down=TouchDown(), **{field: ((1.0, 2.0),)})

    def test_the_reference_is_the_profile(self):
        rows = Schedule(scenario=BUSY, sample_time=0.25).block(60, 100)
        np.testing.assert_array_equal(rows.reference, BUSY.profile.at(rows.time))

    def test_parameters_change_and_come_back(self):
        one = scenario(
            parameter_changes={
                10.0: {"drive.power_limit": 1e5, "payload.quadratic_drag": 3.0},
                20.0: {"drive.power_limit": 2e5},
                30.03: {"drive.power_limit": None},
            }
        )
        schedule = Schedule(scenario=one, sample_time=0.1)
        assert schedule.breaks == (100, 200, 301)
        assert schedule.parameters_at(99) == {}
        drag = {"payload.quadratic_drag": 3.0}
        assert schedule.parameters_at(100) == {"drive.power_limit": 1e5, **drag}
        assert schedule.parameters_at(200) == {"drive.power_limit": 2e5, **drag}
        assert schedule.parameters_at(300) == {"drive.power_limit": 2e5, **drag}
        assert schedule.parameters_at(301) == drag


class TestScenario:
    def test_events_say_what_happens(self):
        found = Scenario(
            name="x",
            description="",
            duration=10.0,
            warm_up=1.0,
            disengage_at=9.0,
            brake_trips=((2.0, 3.0),),
            telemetry_outages=((4.0, 5.0),),
            profile=Profile(moves=(Move(start=6.0, distance=-2.0, speed=0.5, acceleration=1.0),)),
            parameter_changes={
                7.0: {"drive.power_limit": 1000.0},
                8.0: {"drive.power_limit": None},
            },
        ).events
        assert found == (
            (1.0, "engaged", "the brake opens and the controller engages"),
            (2.0, "brake", "the brake trips until 3 s"),
            (4.0, "telemetry", "the link from the payload is lost until 5 s"),
            (6.0, "reference", "lower by 2 m at 0.5 m/s"),
            (7.0, "parameter", "drive.power_limit is 1000 from now on"),
            (8.0, "parameter", "drive.power_limit is as before"),
            (9.0, "disengaged", "the controller ramps out"),
        )

    @pytest.mark.parametrize(
        ("fields", "message"),
        [
            ({"duration": 0.0}, "scenario mine: duration must be above 0 s, got 0.0"),
            ({"warm_up": -1.0}, "scenario mine: warm_up must be at least 0 s, got -1.0"),
            (
                {"warm_up": 5.0, "disengage_at": 4.0},
                "scenario mine: disengage_at must be at least 5 s, got 4.0",
            ),
            (
                {"brake_trips": ((5.0, 5.0),)},
                "scenario mine: brake trips must be pairs (start, end) in s with start < end",
            ),
            (
                {"telemetry_outages": ((5.0, 7.0), (1.0, 6.0))},
                "scenario mine: telemetry outages must not overlap, got 1 s to 6 s and 5 s to 7 s",
            ),
            (
                {"parameter_changes": {1.0: {"a": math.nan}}},
                "scenario mine: a at 1 s must be a finite number, got nan",
            ),
            (
                {"surroundings": Surroundings(ground=Deck(below=1.0))},
                "scenario mine: its surroundings need the motions deck, got none",
            ),
            (
                {"motions": {"deck": StillMotion()}},
                "scenario mine: its surroundings need the motions none, got deck",
            ),
        ],
    )
    def test_bad_scenarios(self, fields, message):
        with pytest.raises(InputError, match=re.escape(message)):
            scenario(**fields)

    def test_a_case_that_cannot_be_in_air(self, crane):
        lift = scenario_named("lift-off", crane.replace({"rope.length": 400}))
        weak = crane.replace(
            {"winch.drive.torque_continuous": "6.1 kN m", "winch.drive.torque_peak": "6.1 kN m"}
        )
        with pytest.raises(InputError, match=r"scenario lift-off: .*torque_continuous: must be "):
            lift.case_for(weak)


class TestLibrary:
    @pytest.mark.filterwarnings("ignore:.*phase is missing")
    @pytest.mark.parametrize("name", scenario_names())
    @pytest.mark.parametrize("case_name", CASES)
    def test_every_scenario_fits_every_case(self, case_name, name):
        case = load_case(case_name)
        found = scenario_named(name, case)
        changed = found.case_for(case)
        assert found.name == name
        assert found.profile.end < found.duration
        assert found.settle < found.duration
        rows = Schedule(scenario=found, sample_time=0.1).block(0, round(found.duration / 0.1))
        assert rows.engage.max() == 1.0
        assert np.isfinite(rows.reference).all()
        # Whatever it pays out is on the drum.
        out = changed.rope.length - min(0.0, found.initial_haul) - rows.reference[:, 0].min()
        assert out < changed.winch.drum.total(changed.rope.diameter)
        for source in found.motions.values():
            assert source.motion(10.0, 0.1, 1).rows == 101
        speed = np.abs(rows.reference[:, 1]).max()
        fastest = changed.winch.speed_limit * changed.drum_radius / changed.winch.gearbox.ratio
        assert speed <= 0.5 * fastest

    @pytest.mark.filterwarnings("ignore:.*phase is missing")
    @pytest.mark.parametrize("masses", [1, 4])
    @pytest.mark.parametrize("name", ["lift-off", "set-down", "splash", "landing"])
    @pytest.mark.parametrize("case_name", ["subsea-crane", "landing"])
    @pytest.mark.parametrize("rig", [{}, RIG], ids=["rope", "rig"])
    def test_the_start_is_at_rest(self, case_name, name, masses, rig):
        case = load_case(case_name).replace(rig)
        found = scenario_named(name, case)
        case = found.case_for(case)
        plant = build_plant(case, masses, surroundings=found.surroundings)
        p = dict(plant.parameters)
        at = found.initial_displacements([1.0 / link.series for link in plant.chain])
        x = dict.fromkeys(plant.states, 0.0)
        x["motor.angle"] = found.initial_haul * p["winch.gear_ratio"] / p["winch.drum_radius"]
        names = [n for n in plant.states if n.endswith("displacement") and "sensor" not in n]
        x |= dict(zip(names, at, strict=True))
        state, w = np.array(list(x.values())), np.zeros(len(plant.disturbances))
        xdot, _, z = plant.function(state, 0.0, w, plant.parameter_vector())
        outputs = dict(zip(plant.outputs, np.asarray(z).ravel(), strict=True))
        weight = case.payload.submerged_weight if name == "landing" else case.payload.mass * 9.80665
        share = p["rope.submerged_weight_per_length"] * p["rope.length"] * plant.lumps.hanging[-1]
        lower = 0.0 if name == "lift-off" else weight
        assert outputs["rope.lower_tension"] == pytest.approx(lower, rel=1e-9)
        # Forces, not accelerations: the part of the rope that is lumped at a payload that stands
        # is not carried by the masses above it any more.
        allowed = share if name == "lift-off" else 1e-9 * weight
        inertias = np.array([link.mass for link in plant.chain])
        inertias[-1] += p["payload.virtual_mass"]
        rates = dict(zip(plant.states, np.asarray(xdot).ravel(), strict=True))
        moving = [n for n in plant.states if n.endswith("velocity") and "sensor" not in n]
        assert moving[-1] == "payload.velocity"
        for mass, moved in zip(inertias, moving, strict=True):
            assert abs(mass * rates[moved]) <= 1.001 * allowed + 1e-6

    def test_landing_is_the_assignments(self, crane):
        found = scenario_named("landing", crane, wait="30 s", speed="500 mm/s", slack=0.5)
        assert found.surroundings == Surroundings(ground=Seabed(below=7.5))
        down, touch = found.profile.moves
        assert (down.start, down.distance) == (32.0, -2.5)
        assert (touch.start, touch.distance) == (down.end + 30.0, -5.5)
        assert touch.speed < down.speed
        without = scenario_named("landing", crane, touchdown="none")
        assert without.touch_down is None
        assert without.disengage_at == without.profile.moves[1].end

    def test_a_touch_down_is_released_kept_taut_or_neither(self, crane):
        found = scenario_named("landing", crane, slack=0.5, unloaded=0.4, release_speed=0.25)
        phase = found.touch_down
        assert (phase.mode, phase.slack, phase.unloaded, phase.speed) == ("release", 0.5, 0.4, 0.25)
        assert phase.armed_below == -2.5  # where it waits above the seabed
        # Slack and stretch are paid out when the brake is set.
        stretch = crane.payload.submerged_weight * PlantData.from_case(crane).chain_compliance
        touch = found.profile.moves[1]
        assert found.disengage_at == pytest.approx(touch.end + (0.5 + stretch) / 0.25)
        taut = scenario_named("set-down", crane, touchdown="tension", kept_tension=0.2)
        assert (taut.touch_down.mode, taut.touch_down.kept_tension) == ("tension", 0.2)
        assert taut.disengage_at is None
        boat, platform = (scenario_named("set-down", crane, deck=d) for d in ("boat", "platform"))
        assert boat.touch_down.slack == 2.0 * platform.touch_down.slack

    def test_figures_of_a_touch_down_have_ranges(self, crane):
        with pytest.raises(InputError, match=r"landing: touchdown must be one of release, tension"):
            scenario_named("landing", crane, touchdown="drop")
        with pytest.raises(InputError, match=r"landing: unloaded must be .*, got 1.5"):
            scenario_named("landing", crane, unloaded=1.5)
        with pytest.raises(InputError, match="touch-down: mode must be one of release, tension"):
            TouchDown(mode="none")
        for name in ("unloaded", "kept_tension", "slack", "speed"):
            with pytest.raises(InputError, match=f"touch-down: {name} must be"):
                TouchDown(**{name: 0.0})
        with pytest.raises(InputError, match="touch-down: unloaded_for must be"):
            TouchDown(unloaded_for=-1.0)

    def test_a_deck_can_be_a_boat_a_platform_or_a_motion(self, crane):
        boat = scenario_named("set-down", crane)
        assert boat.surroundings.ground.moving
        assert boat.motions["deck"].description == "jonswap sea, H_s 2 m, T_p 9 s"
        platform = scenario_named("set-down", crane, deck="platform")
        assert not platform.surroundings.ground.moving
        assert not platform.motions
        sine = SineMotion(amplitude=1.0, period=8.0)
        assert scenario_named("set-down", crane, deck=sine).motions["deck"] is sine
        with pytest.raises(
            InputError,
            match="scenario set-down: deck must be one of boat, platform or a source of motion, ",
        ):
            scenario_named("set-down", crane, deck="raft")

    def test_what_is_lost_is_chosen(self, crane):
        for lost, field in (
            ("telemetry", "telemetry_outages"),
            ("sensor", "sensor_failures"),
            ("stuck", "stuck_readings"),
            ("mru", "mru_outages"),
            ("encoder", "encoder_outages"),
            ("load-cell", "load_cell_outages"),
        ):
            found = scenario_named("sensor-loss", crane, lost=lost, lasting="3 s", wait=50)
            assert getattr(found, field) == ((50.0, 53.0),)
            assert found.operated == (lost in ("encoder", "load-cell"))
        told = "lost must be one of telemetry, sensor, stuck, mru, encoder, load-cell, got 'x'"
        with pytest.raises(InputError, match=told):
            scenario_named("sensor-loss", crane, lost="x")

    def test_the_brake_trips_at_the_worst_moment_or_at_a_stated_one(self, crane):
        found = scenario_named("brake-trip", crane)
        assert (found.worst_trip, found.brake_trips) == ((10.0, 610.0, 30.0), ())
        stated = scenario_named("brake-trip", crane, moment="stated", wait="2 min", lasting=20)
        assert (stated.worst_trip, stated.brake_trips) == (None, ((130.0, 150.0),))
        assert stated.duration == 390.0
        # No time to look for a worst moment in.
        assert scenario_named("brake-trip", crane, wait=0).brake_trips == ((10.0, 40.0),)
        with pytest.raises(InputError, match=r"end of worst_trip must be above 5 s, got 5.0"):
            Scenario(name="x", description="", duration=9.0, worst_trip=(5.0, 5.0, 1.0))

    def test_a_heave_rao_without_phases_is_told_where_the_surface_moves_too(self, crane):
        table = {"omega": [0.3, 1.0], "amplitude": [1.0, 0.5]}
        changes = {"vessel.raos": None, "vessel.hook": None, "vessel.heading": None}
        bare = crane.replace({**changes, "vessel.heave_rao": table})
        with pytest.warns(PhysicsWarning, match=r"heave_rao: phase is missing and taken as zero"):
            scenario_named("splash", bare)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            scenario_named("landing", bare)
            scenario_named("set-down", bare)  # the boat has waves of its own
            scenario_named("splash", crane)
            phased = {**table, "phase": [0.0, 0.0]}
            scenario_named("splash", bare.replace({"vessel.heave_rao": phased}))

    def test_power_falls_and_comes_back(self, crane):
        found = scenario_named("power-limit", crane, power="50 %")
        assert found.parameter_changes == {
            120.0: {"drive.power_limit": 0.6e6},
            240.0: {"drive.power_limit": None},
        }
        assert not found.case_changes
        # A drive without a limit gets one, so that the plant has the parameter.
        thesis = load_case("thesis-1975")
        assert math.isinf(thesis.winch.power_limit)
        limited = scenario_named("power-limit", thesis)
        assert limited.case_for(thesis).winch.power_limit == pytest.approx(
            11880.0 * 125.66, rel=1e-4
        )

    def test_options_have_units_and_ranges(self, crane):
        assert scenario_named("lower", crane, distance="30 ft").profile.moves[0].distance == (
            pytest.approx(-9.144)
        )
        assert scenario_named("hold", crane, warm_up="1 min").warm_up == 60.0
        assert scenario_named("lower", crane, speed=None).profile.moves[0].speed == pytest.approx(
            0.2 * crane.winch.speed_limit * crane.drum_radius / 100.0
        )

    @pytest.mark.parametrize(
        ("name", "options", "message"),
        [
            (
                "landig",
                {},
                "scenario: there is no 'landig'; did you mean 'landing'?",
            ),
            (
                "hold",
                {"speed": 1.0},
                "scenario hold: there is no option 'speed'; there are: engage, disengage, reset, ",
            ),
            (
                "lower",
                {"distance": "5 s"},
                "scenario lower: distance must be a length in (0, 5000] m, got '5 s', which is a",
            ),
            (
                "lower",
                {"speed": -0.1},
                "scenario lower: speed must be a speed in (0, 20] m/s, got -0.1",
            ),
            (
                "landing",
                {"stop": "8 m"},
                "scenario landing: stop must be below height, 7.5 m, got 8 m",
            ),
        ],
    )
    def test_bad_choices(self, name, options, message, crane):
        with pytest.raises(InputError, match=re.escape(message)):
            scenario_named(name, crane, **options)

    def test_every_option_says_what_it_is(self):
        for name, text in scenario_names().items():
            assert 10 < len(text) < 80
            for option in scenario_options(name).values():
                assert option.text
