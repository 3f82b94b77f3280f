"""What a controller sees: sensors and telemetry as a recursion, against what they should show."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest
import scipy.integrate
import scipy.stats
from former_cases import load_case
from hypothesis import given, settings
from hypothesis import strategies as st

from models import InputError
from models.rig import MRU, Encoder, LoadCell, PayloadSensor, Telemetry
from models.sensing import HEARD, NOISE, MruModel, SensorModel, TelemetrySchedule
from models.sensing.sensing import RAW
from models.sensing.telemetry import during

TS = 0.02
SENT = ("acceleration", "velocity", "displacement")
COUNTS = 4096


def sensors(payload=None, telemetry=None, encoder=None, load_cell=None):
    """A model with these sensors, and its link."""
    link = telemetry or Telemetry()
    model = SensorModel(
        sample_time=TS,
        payload=payload or PayloadSensor(),
        lags=TelemetrySchedule(link, TS, 0).lags,
        encoder=encoder,
        load_cell=load_cell,
        haul_per_angle=0.01,
        static_tension=5e5,
    )
    return model, link


def see(model, schedule, raw, *, seed=0, mru=None, applied=0.0, references=0.0, start=None):
    """Run the recursion over raw signals (n, 8); return what is seen, by name."""
    n = len(raw)
    unit = MruModel(mru, TS, 0.5, seed)
    still = np.zeros(n)
    shown, _ = unit.block(unit.initial(0.0, 0.0), still, still)
    rows = model.rows(
        model.noise(seed, 0, n), schedule.block(0, n), shown, np.broadcast_to(references, (n, 3))
    )
    state = model.initial(raw[0] if start is None else start)
    series = model.function.mapaccum("series", n, 1)
    _, seen = series(state, raw.T, rows.T, np.full((1, n), applied))
    return dict(zip(HEARD, np.asarray(seen), strict=True))


def moving(n, omega=2.0):
    """Raw signals of a plant in a sine, (n, 8)."""
    t = TS * np.arange(n)
    shift = 0.3 * np.sin(omega * t)
    rate = 0.3 * omega * np.cos(omega * t)
    return np.column_stack(
        (
            -(omega**2) * shift,
            rate,
            shift,
            40 * shift,
            0.4 * shift,
            40 * rate,
            3000 + 500 * shift,
            5e5 + 1e4 * shift,
        )
    )


def at_rest(n, **values):
    raw = np.zeros((n, len(RAW)))
    for name, value in values.items():
        raw[:, RAW.index(name.replace("__", "."))] = value
    return raw


class TestPerfect:
    def test_sensors_show_the_truth_at_once(self):
        model, link = sensors()
        raw = moving(200)
        references = np.column_stack([np.linspace(0, i, 200) for i in (1, 2, 3)])
        seen = see(model, TelemetrySchedule(link, TS, 0), raw, applied=7.0, references=references)
        for name in SENT:
            true = raw[:, RAW.index(f"measured.{name}")]
            assert np.array_equal(seen[f"payload.{name}"], true)
        for name in ("drum.haul", "motor.speed", "motor.torque", "rope.tension"):
            assert np.array_equal(seen[name], raw[:, RAW.index(name)])
        assert np.array_equal(seen["payload.age"], np.zeros(200))
        assert np.array_equal(seen["payload.valid"], np.ones(200))
        assert np.array_equal(seen["mru.valid"], np.ones(200))
        assert np.array_equal(seen["drive.applied"], np.full(200, 7.0))
        for i, name in enumerate(("displacement", "velocity", "acceleration")):
            assert np.array_equal(seen[f"reference.{name}"], references[:, i])

    def test_a_perfect_model_holds_nothing_but_the_last_values(self):
        model, _ = sensors()
        assert model.states == tuple(f"held.{name}" for name in SENT)

    def test_a_bundled_case_gives_its_own_sensors(self):
        case = load_case("subsea-crane")
        model = SensorModel.from_case(case, 0.05)
        assert list(model.lags) == [0, 1]  # 30 ms
        assert model.haul_per_angle == case.drum_radius / 100
        assert model.static_tension == case.static_tension
        assert model.load_cell == case.sensors.load_cell
        assert "load_cell.tension" in model.states
        f = model.function
        assert f.size_in(0)[0] == len(model.states) == f.size_out(0)[0]
        assert f.size_in(2)[0] == len(model.row)
        assert f.size_out(1)[0] == len(HEARD)
        assert f.sparsity_out(0).is_dense()
        assert f.sparsity_out(1).is_dense()

    def test_raw_is_picked_by_name(self):
        signals = {name: ca.SX(i) for i, name in enumerate(reversed(RAW))}
        picked = ca.evalf(SensorModel.raw(signals | {"other": ca.SX(99)}))
        assert np.asarray(picked).ravel().tolist() == [7, 6, 5, 4, 3, 2, 1, 0]


class TestDelay:
    def test_of_two_and_a_half_samples_delays_a_sine_by_as_much(self):
        model, link = sensors(telemetry=Telemetry(delay=2.5 * TS))
        omega, n = 3.0, 2000
        raw = moving(n, omega)
        seen = see(model, TelemetrySchedule(link, TS, 0), raw)
        t = TS * np.arange(n)
        late = slice(10, None)
        wanted = 0.3 * np.sin(omega * (t - 2.5 * TS))
        off = np.abs(seen["payload.displacement"] - wanted)[late].max()
        # Half-way between samples a sine loses 1 - cos(omega Ts/2) of its amplitude.
        lost = 0.3 * (1.0 - math.cos(omega * TS / 2))
        assert off == pytest.approx(lost, rel=1e-3)
        assert lost < 0.3 * (omega * TS) ** 2 / 8
        np.testing.assert_allclose(seen["payload.age"], 2.5 * TS, rtol=1e-12)

    def test_starts_with_the_value_at_rest(self):
        model, link = sensors(telemetry=Telemetry(delay=0.1))
        raw = at_rest(20, measured__displacement=1.0)
        raw[0] = 0.0
        seen = see(model, TelemetrySchedule(link, TS, 0), raw)
        assert np.array_equal(seen["payload.displacement"], np.arange(20) > 5)

    @settings(max_examples=25)
    @given(
        st.floats(0.0, 0.2),
        st.floats(0.0, 0.2),
        st.sampled_from([0.0, 0.3]),
        st.integers(0, 20),
    )
    def test_what_is_seen_is_as_old_as_its_age_says(self, delay, jitter, dropout, seed):
        # On a line interpolation is exact: the value itself tells the time that it is from.
        model, link = sensors(telemetry=Telemetry(delay=delay, jitter=jitter, dropout=dropout))
        n = 300
        t = TS * np.arange(n)
        raw = at_rest(n, measured__displacement=t, measured__velocity=-2.0 * t)
        seen = see(model, TelemetrySchedule(link, TS, seed), raw)
        known = seen["payload.age"] <= t  # before, it is from before the run
        assert known.sum() > 200
        np.testing.assert_allclose(
            (t - seen["payload.age"])[known], positions(seen)[known], atol=1e-9
        )
        np.testing.assert_allclose(seen["payload.velocity"], -2.0 * positions(seen), atol=1e-9)
        assert (positions(seen) <= t + 1e-12).all()


class TestLoss:
    def test_the_last_value_is_held_and_marked(self):
        model, link = sensors()
        schedule = TelemetrySchedule(link, TS, 0, outages=[(1.0, 2.0)])
        raw = moving(200)
        seen = see(model, schedule, raw)
        true = raw[:, RAW.index("measured.velocity")]
        assert np.array_equal(np.flatnonzero(seen["payload.valid"] == 0.0), np.arange(50, 100))
        assert np.array_equal(seen["payload.velocity"][50:100], np.full(50, true[49]))
        assert np.array_equal(seen["payload.velocity"][100:], true[100:])
        np.testing.assert_allclose(seen["payload.age"][50:100], TS * np.arange(1, 51), rtol=1e-9)

    @settings(max_examples=25)
    @given(
        st.floats(0.0, 0.2),
        st.sampled_from([0.0, 0.01, 0.1]),
        st.lists(
            st.tuples(st.floats(0.0, 4.0), st.floats(1.5 * TS, 2.0)).map(lambda p: (p[0], sum(p))),
            min_size=1,
            max_size=3,
        ),
    )
    def test_a_broken_sensor_never_delivers_its_nan(self, delay, jitter, broken):
        model, link = sensors(
            PayloadSensor(velocity_noise=0.01, displacement_resolution=0.01),
            Telemetry(delay=delay, jitter=jitter, dropout=0.1),
        )
        schedule = TelemetrySchedule(link, TS, 1, broken=broken)
        raw = moving(400)
        raw[np.ix_(during(broken, np.arange(400), TS), [0, 1, 2])] = math.nan
        assert np.isnan(raw).any()
        seen = see(model, schedule, raw, start=moving(1)[0])
        for name, values in seen.items():
            assert np.isfinite(values).all(), name


class TestPayload:
    def test_noise_has_the_variance_of_its_density(self):
        densities = {"acceleration": 1e-3, "velocity": 2e-3, "displacement": 5e-4}
        model, link = sensors(PayloadSensor(**{f"{k}_noise": v for k, v in densities.items()}))
        n = 20_000
        seen = see(model, TelemetrySchedule(link, TS, 0), at_rest(n), seed=3)
        shown = np.array([seen[f"payload.{name}"] for name in SENT])
        for name, values in zip(SENT, shown, strict=True):
            # A one-sided density N^2 over the band up to 1/(2 Ts) hertz.
            variance = densities[name] ** 2 / (2 * TS)
            assert model.noise_rms(name) == pytest.approx(math.sqrt(variance))
            assert abs(np.mean(values**2) / variance - 1.0) < 3.0 * math.sqrt(2.0 / n)
            assert abs(np.mean(values)) < 3.0 * math.sqrt(variance / n)
            assert abs(np.mean(values[1:] * values[:-1])) < 3.0 * variance / math.sqrt(n)
        cross = np.corrcoef(shown)[np.triu_indices(3, 1)]
        assert np.abs(cross).max() < 3.0 / math.sqrt(n)

    def test_bias_is_added(self):
        payload = PayloadSensor(
            acceleration_bias="2 mg", velocity_bias=-0.01, displacement_bias="5 cm"
        )
        model, link = sensors(payload, Telemetry(delay=0.05))
        raw = at_rest(30)
        seen = see(model, TelemetrySchedule(link, TS, 0), raw)
        for name, bias in (
            ("acceleration", 0.0196133),
            ("velocity", -0.01),
            ("displacement", 0.05),
        ):
            np.testing.assert_allclose(seen[f"payload.{name}"], bias, rtol=1e-12)

    def test_rounding_is_off_by_half_a_step_at_most(self):
        payload = PayloadSensor(velocity_resolution=0.013, displacement_resolution=0.05)
        model, link = sensors(payload)
        raw = moving(5000, 0.37)
        seen = see(model, TelemetrySchedule(link, TS, 0), raw)
        for name, step in (("velocity", 0.013), ("displacement", 0.05)):
            shown = seen[f"payload.{name}"]
            off = shown - raw[:, RAW.index(f"measured.{name}")]
            assert 0.49 * step < np.abs(off).max() <= 0.5 * step * (1.0 + 1e-9)
            np.testing.assert_allclose(shown / step, np.round(shown / step), atol=1e-9)
        acceleration = raw[:, RAW.index("measured.acceleration")]
        assert np.array_equal(seen["payload.acceleration"], acceleration)

    def test_bias_and_noise_come_before_the_rounding(self):
        payload = PayloadSensor(
            displacement_bias=0.3, displacement_noise=0.02, displacement_resolution=0.25
        )
        model, link = sensors(payload)
        seen = see(model, TelemetrySchedule(link, TS, 0), at_rest(4000), seed=2)
        shown = seen["payload.displacement"]
        np.testing.assert_allclose(shown / 0.25, np.round(shown / 0.25), atol=1e-12)
        # P(0.25) is that of bias and noise within [0.125, 0.375).
        law = scipy.stats.norm(0.3, 0.02 / math.sqrt(2 * TS))
        share = law.cdf(0.375) - law.cdf(0.125)
        error = math.sqrt(share * (1.0 - share) / 4000)
        assert abs(np.mean(shown == 0.25) - share) < 3.0 * error

    def test_a_message_keeps_the_noise_that_it_was_sent_with(self):
        payload = PayloadSensor(displacement_noise=0.02)
        at_once, link = sensors(payload)
        later, slow = sensors(payload, Telemetry(delay=3 * TS))
        first = see(at_once, TelemetrySchedule(link, TS, 0), at_rest(100), seed=5)
        second = see(later, TelemetrySchedule(slow, TS, 0), at_rest(100), seed=5)
        assert np.array_equal(
            second["payload.displacement"][3:], first["payload.displacement"][:-3]
        )


class TestWinch:
    def test_encoder_rounds_to_counts(self):
        model, link = sensors(encoder=Encoder(counts_per_turn=COUNTS))
        raw = moving(5000, 0.37)
        seen = see(model, TelemetrySchedule(link, TS, 0), raw)
        count = 2 * math.pi / COUNTS
        off = seen["drum.haul"] - raw[:, RAW.index("drum.haul")]
        half = 0.01 * count / 2
        assert 0.98 * half < np.abs(off).max() <= half * (1.0 + 1e-9)
        # haul/angle of the plant above is 0.01 too: what is shown is a whole number of counts.
        counts = seen["drum.haul"] / (0.01 * count)
        np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)

    def test_speed_is_rounded_to_a_count_in_ten_milliseconds(self):
        model, link = sensors(encoder=Encoder(counts_per_turn=COUNTS))
        raw = moving(5000, 0.37)
        seen = see(model, TelemetrySchedule(link, TS, 0), raw)
        step = 2 * math.pi / COUNTS / 0.01
        assert step == pytest.approx(0.1534, rel=1e-3)
        off = seen["motor.speed"] - raw[:, RAW.index("motor.speed")]
        assert 0.98 * step / 2 < np.abs(off).max() <= step / 2 * (1.0 + 1e-9)

    def test_load_cell_agrees_with_an_ode_solver(self):
        bandwidth = 5.0
        model, link = sensors(load_cell=LoadCell(bandwidth=bandwidth))
        n = 150
        t = TS * np.arange(n)
        tension = 5e5 + 1e5 * (np.interp(t, [0.2, 0.4, 1.0, 3.0], [0.0, 1.0, -1.0, 0.5]))
        seen = see(model, TelemetrySchedule(link, TS, 0), at_rest(n, rope__tension=tension))
        solution = scipy.integrate.solve_ivp(
            lambda x, y: bandwidth * (np.interp(x, t, tension) - y),
            (0.0, t[-1]),
            [tension[0]],
            t_eval=t,
            rtol=1e-10,
            max_step=TS / 2,
        )
        np.testing.assert_allclose(seen["rope.tension"], solution.y[0], rtol=1e-7)

    def test_load_cell_noise_is_a_fraction_of_the_static_tension(self):
        model, link = sensors(load_cell=LoadCell(bandwidth=30.0, noise_fraction=0.01))
        n = 20_000
        seen = see(model, TelemetrySchedule(link, TS, 0), at_rest(n, rope__tension=4e5), seed=6)
        off = seen["rope.tension"] - 4e5
        assert abs(np.mean(off**2) / 5e3**2 - 1.0) < 3.0 * math.sqrt(2.0 / n)

    def test_torque_is_the_drives_own(self):
        model, link = sensors(
            encoder=Encoder(counts_per_turn=10), load_cell=LoadCell(bandwidth=1.0)
        )
        raw = moving(100)
        seen = see(model, TelemetrySchedule(link, TS, 0), raw)
        assert np.array_equal(seen["motor.torque"], raw[:, RAW.index("motor.torque")])


class TestRows:
    def test_sensors_that_have_long_seen_the_plant_at_rest_stay_there(self):
        model, _ = sensors(
            PayloadSensor(displacement_bias=0.1, displacement_resolution=0.03),
            Telemetry(delay=0.05, jitter=0.03),
            load_cell=LoadCell(bandwidth=5.0),
        )
        raw = at_rest(1, measured__displacement=0.2, rope__tension=4e5)
        start = model.initial(raw[0])
        row = np.zeros(len(model.row))
        row[[model.row.index(f"{name}.valid") for name in ("encoder", "load_cell")]] = 1.0
        after, seen = model.function(start, raw[0], row, 0.0)
        np.testing.assert_allclose(np.asarray(after).ravel(), start, rtol=1e-15)
        named = dict(zip(HEARD, np.asarray(seen).ravel(), strict=True))
        assert named["payload.displacement"] == pytest.approx(0.3)
        assert named["rope.tension"] == pytest.approx(4e5)

    def test_the_reference_unit_goes_through(self):
        model, link = sensors()
        mru = MRU(noise_floor=0.05, delay=0.1)
        seen = see(model, TelemetrySchedule(link, TS, 0), at_rest(50), mru=mru, seed=9)
        unit = MruModel(mru, TS, 0.5, 9)
        shown, _ = unit.block(unit.initial(0.0, 0.0), np.zeros(50), np.zeros(50))
        assert np.array_equal(seen["mru.heave"], shown.heave)
        assert np.array_equal(seen["mru.heave_rate"], shown.heave_rate)
        assert shown.heave.any()

    @settings(max_examples=20)
    @given(st.integers(0, 200_000), st.integers(1, 500), st.integers(0, 5))
    def test_noise_does_not_depend_on_the_chunks(self, start, count, seed):
        whole = SensorModel.noise(seed, start, count)
        assert whole.shape == (count, len(NOISE))
        middle = count // 2
        parts = [
            SensorModel.noise(seed, start, middle),
            SensorModel.noise(seed, start + middle, count - middle),
        ]
        assert np.array_equal(whole, np.vstack(parts))

    def test_purposes_and_seeds_have_numbers_of_their_own(self):
        noise = SensorModel.noise(3, 0, 100)
        assert np.array_equal(noise, SensorModel.noise(3, 0, 100))
        others = [SensorModel.noise(4, 0, 100), SensorModel.noise(3, 65536, 100)]
        others.append(np.random.default_rng([3, 1]).standard_normal((100, 4)))
        for other in others:
            assert abs(np.corrcoef(noise.ravel(), other.ravel())[0, 1]) < 3.0 / math.sqrt(400)

    def test_what_makes_no_sense_is_refused(self):
        model, _ = sensors()
        with pytest.raises(InputError, match="sensors: seed must be a whole number"):
            model.noise(-1, 0, 5)


def positions(seen):
    return seen["payload.displacement"]
