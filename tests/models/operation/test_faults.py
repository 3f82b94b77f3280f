"""Faults in mid-run: messages that are late for a while, sensors that are off, limits cut."""

from __future__ import annotations

import numpy as np
import pytest
from former_cases import load_case
from hypothesis import given
from hypothesis import strategies as st

from models.basics import KINDS, InputError
from models.operation import FAULTS, PREFIX, Scenario, fault_of, scenario_named, with_faults
from models.rig import MRU, Telemetry
from models.sensing import MruModel, SensorModel, TelemetrySchedule
from models.spread import Spread, Uniform
from stillhook.runs import simulate
from stillhook.sweeps import fault_spread, usual_spread
from stillhook.sweeps.usual import FAULT_SPREADS

CASE = load_case("subsea-crane")
HOLD = scenario_named("hold", CASE)


def known(schedule, count, chunk):
    """When what is known at each sample was sent [sample]; NaN before anything has come."""
    sent = np.full(count, np.nan)
    held = np.nan
    lags = np.array(list(schedule.lags))
    for start in range(0, count, chunk):
        block = schedule.block(start, min(chunk, count - start))
        for k, (weights, fresh) in enumerate(zip(block.weights, block.fresh, strict=True)):
            if fresh:
                held = start + k - float(weights @ lags)
            sent[start + k] = held
    return sent


@given(
    delay=st.floats(0.0, 0.08),
    extra=st.floats(0.0, 0.2),
    start=st.integers(10, 40),
    length=st.integers(1, 60),
    chunk=st.integers(1, 200),
)
def test_messages_sent_in_the_period_are_late_by_so_much_more(delay, extra, start, length, chunk):
    step, n = 0.01, 150
    late = ((start * step, (start + length) * step, extra),)
    schedule = TelemetrySchedule(Telemetry(delay=delay), step, seed=1, late=late)
    # By the definition: of the messages that have arrived, the newest counts.
    wanted = np.full(n, -np.inf)
    for j in range(-schedule.lags.stop, n):
        transit = delay / step + (extra / step if start <= j < start + length else 0.0)
        nearest = round(transit)
        transit = float(nearest) if abs(transit - nearest) < 1e-6 else transit
        arrival = j + int(np.ceil(transit))
        if arrival < n:
            first = max(arrival, 0)
            wanted[first:] = np.maximum(wanted[first:], arrival - transit)
    found = known(schedule, n, chunk)
    assert np.abs(found - wanted)[schedule.lags.stop + 1 :].max() < 1e-6


def test_the_sensors_remember_as_many_messages_as_the_latest_needs():
    late = ((5.0, 6.0, 0.1),)
    model = SensorModel.from_case(CASE, 0.02, late)
    link = TelemetrySchedule(CASE.sensors.telemetry, 0.02, seed=0, late=late)
    assert model.lags == link.lags
    assert model.lags.stop > SensorModel.from_case(CASE, 0.02).lags.stop


@pytest.mark.parametrize("mru", [None, MRU(delay=0.05, heave_filter_period=20.0)])
def test_a_biased_reference_unit_shows_so_much_too_much_while_it_lasts(mru):
    step = 0.1
    t = step * np.arange(400)
    z, v = np.sin(0.8 * t), 0.8 * np.cos(0.8 * t)
    biases = ((10.0, 20.0, 0.2, -0.05), (15.0, 30.0, 0.1, 0.0))
    shown = []
    for own in ((), biases):
        unit = MruModel(mru, step, 0.7, 3, biases=own, heave_frequency=0.8)
        state, parts = unit.initial(0.0, 0.8), []
        for part in (slice(0, 137), slice(137, 400)):
            block, state = unit.block(state, z[part], v[part])
            parts.append((block.heave, block.heave_rate))
        shown.append(np.concatenate([np.stack(p) for p in parts], axis=1))
    heave, rate = shown[1] - shown[0]
    one, two = (t >= 9.999) & (t < 19.999), (t >= 14.999) & (t < 29.999)
    assert np.abs(heave - 0.2 * one - 0.1 * two).max() < 1e-12
    assert np.abs(rate + 0.05 * one).max() < 1e-12


def test_nothing_fails_where_nothing_is_asked():
    assert with_faults(HOLD, {}, CASE, 100.0) is HOLD
    nominal = {PREFIX + name: field.nominal for name, field in FAULTS.items()}
    assert with_faults(HOLD, {**nominal, "fault.at": 5.0}, CASE, 100.0) is HOLD


def test_every_fault_becomes_part_of_the_scenario():
    sizes = {"at": 10.0, "lasting": 20.0, "telemetry_outage": 3.0, "sensor_outage": 4.0}
    sizes |= {"stuck_readings": 2.0, "mru_spike": 1.5}
    sizes |= {"encoder_outage": 7.0, "load_cell_outage": 8.0}
    sizes |= {"mru_outage": 5.0, "brake_trip": 6.0, "delay_step": 0.1}
    sizes |= {"mru_heave_bias": 0.2, "mru_rate_bias": -0.1, "torque_limit": 0.6, "power_limit": 0.5}
    assert set(sizes) == set(FAULTS)
    found = with_faults(HOLD, {PREFIX + n: v for n, v in sizes.items()}, CASE, 100.0)
    assert found.telemetry_outages == ((10.0, 13.0),)
    assert found.sensor_failures == ((10.0, 14.0),)
    assert found.mru_outages == ((10.0, 15.0),)
    assert found.brake_trips == ((10.0, 16.0),)
    assert found.encoder_outages == ((10.0, 17.0),)
    assert found.load_cell_outages == ((10.0, 18.0),)
    assert found.telemetry_delays == ((10.0, 30.0, 0.1),)
    assert found.stuck_readings == ((10.0, 12.0),)
    bias, *spikes = found.mru_biases
    assert bias == (10.0, 30.0, 0.2, -0.1)
    assert [spike[0] for spike in spikes] == [10.0 + 2.0 * k for k in range(10)]
    assert {spike[2:] for spike in spikes} == {(1.5, 0.0)}
    cut, back = found.parameter_changes[10.0], found.parameter_changes[30.0]
    assert cut["drive.torque_limit"] == 0.6 * CASE.winch.drive.torque_peak
    assert cut["drive.power_limit"] == 0.5 * CASE.winch.power_limit
    assert set(cut) == set(back)
    assert set(back.values()) == {None}
    texts = [text for _, _, text in found.events]
    assert "the link from the payload is late by 0.1 s more until 30 s" in texts
    assert "the motion reference unit is off by 0.2 m and -0.1 m/s until 30 s" in texts


def test_a_drive_without_a_limit_of_its_power_gets_one_to_be_cut():
    free = CASE.replace({"winch.drive.power": None})
    unlimited = np.isinf(free.winch.power_limit)
    found = with_faults(HOLD, {"fault.power_limit": 0.5, "fault.at": 1.0}, free, 100.0)
    power = found.parameter_changes[1.0]["drive.power_limit"]
    assert power > 0.0
    assert ("winch.drive.power" in found.case_changes) == unlimited


def test_the_torque_stays_below_the_limit_that_is_left():
    faults = {"fault.at": 60.0, "fault.lasting": 30.0, "fault.torque_limit": 0.75}
    scenario = with_faults(HOLD, faults, CASE, 120.0)
    (free,) = simulate(CASE, "feed-forward", seeds=[4], duration=120.0)
    (cut,) = simulate(CASE, "feed-forward", scenario=scenario, seeds=[4], duration=120.0)
    during = (cut.time > 60.5) & (cut.time < 90.0)
    limit = 0.75 * CASE.winch.drive.torque_peak
    assert np.abs(cut["motor.torque"][during]).max() <= limit * (1.0 + 1e-6)
    assert np.array_equal(
        cut["motor.torque"][cut.time < 60.0], free["motor.torque"][free.time < 60.0]
    )


def test_a_biased_heave_rate_lets_feed_forward_creep():
    faults = {"fault.at": 40.0, "fault.lasting": 40.0, "fault.mru_rate_bias": 0.02}
    scenario = with_faults(HOLD, faults, CASE, 100.0)
    runs = [
        simulate(CASE, "feed-forward", scenario=s, seeds=[4], duration=100.0)[0]
        for s in (HOLD, scenario)
    ]
    crept = runs[1]["drum.haul"] - runs[0]["drum.haul"]
    assert np.abs(crept[runs[0].time < 40.0]).max() == 0.0
    # It pays out 0.9 of what it believes to be the hook's rise, less what its position loop takes.
    assert crept[-1] < -0.05


@pytest.mark.parametrize(
    ("faults", "message"),
    [
        ({"fault.delay_stop": 1.0}, "fault.delay_stop is unknown; .*delay_step"),
        ({"delay_step": 1.0}, "delay_step is unknown"),
        ({"fault.torque_limit": 1.5}, r"fault.torque_limit must be in \[0.001, 1\], got 1.5"),
        ({"fault.at": 100.0}, "must be before the end of the run, 100 s, got 100 s"),
    ],
)
def test_a_fault_that_cannot_be_is_refused(faults, message):
    with pytest.raises(InputError, match=message):
        with_faults(HOLD, faults, CASE, 100.0)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("telemetry_delays", ((5.0, 4.0, 0.1),), "telemetry delays must be pairs"),
        ("telemetry_delays", ((5.0, 6.0, -0.1),), r"must be in \[0, 60\] s, got -0.1"),
        ("mru_biases", ((5.0, 6.0, 1e3, 0.0),), r"heave of MRU biases must be in \[-100, 100\] m"),
        ("mru_biases", ((6.0, 6.0, 0.0, 0.0),), "MRU biases must be pairs"),
    ],
)
def test_a_scenario_with_an_impossible_fault_is_refused(field, value, message):
    with pytest.raises(InputError, match=message):
        Scenario(name="x", description="", duration=10.0, **{field: value})


def test_the_kinds_of_faults_are_spreads_that_a_case_takes():
    for name in FAULT_SPREADS:
        spread = fault_spread(name).on(CASE)
        assert spread.sample(4).shape == (4, len(spread.paths))
    every = fault_spread(*FAULT_SPREADS)
    assert len(every.paths) == sum(len(own) for own in FAULT_SPREADS.values())
    with pytest.raises(InputError, match="earthquake"):
        fault_spread("earthquake")


def test_a_fault_is_a_number_of_a_spread_and_none_of_the_case():
    spread = Spread({"fault.delay_step": Uniform("20 ms", "80 ms"), "payload.mass": "10 %"})
    own = spread.on(CASE)
    assert own.units["fault.delay_step"] == "s"
    assert own.nominal["fault.delay_step"] == 0.0
    row = own.sample(1)[0]
    assert 0.02 <= row[0] <= 0.08
    assert not any(path.startswith(PREFIX) for path in own.changes(row))
    for field in FAULTS.values():
        assert field.kind in KINDS
        assert field.low <= field.nominal <= field.high
    assert fault_of("fault.delay_step") is FAULTS["delay_step"]


@pytest.mark.parametrize("mode", ["frequency", "time"])
def test_the_usual_spread_is_that_of_the_margins(mode):
    spread = usual_spread(CASE, mode).on(CASE, drag=1000.0)
    low, high = spread.distributions["payload.mass"].support
    mass, delay = CASE.payload.mass, CASE.sensors.telemetry.delay
    assert (low, high) == pytest.approx((0.7 * mass, 1.3 * mass))
    support = spread.distributions["sensors.telemetry.delay"].support
    assert support == pytest.approx((delay, delay + 0.02))
    low, high = spread.distributions["rope.axial_stiffness"].support
    assert (low, high) == pytest.approx((0.8 * CASE.rope.ea, 1.2 * CASE.rope.ea))
    drag = "drag" if mode == "frequency" else "payload.drag_coefficient"
    assert drag in spread.paths
