"""What a filter may believe: numbers that lie are turned away, a world that differs is not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpc_cases import WEIGHTS, case_of

import models
import stillhook as sh
from models.sensing import HEARD, MEASURED, Measurement
from mpc.linear import LinearMPC
from mpc.winch import SignalGate, prediction_model, sampled_winch, with_noise

T = 0.05
SIGNAL = {name: k for k, name in enumerate(MEASURED)}
AT = {name: k for k, name in enumerate(HEARD)}
PAYLOAD = ["payload.acceleration", "payload.velocity", "payload.displacement"]
UNIT, DRUM = ["mru.heave", "mru.heave_rate"], ["drum.haul", "motor.speed"]


@pytest.fixture(scope="module")
def model():
    case = case_of("thesis-1975-rope")
    return with_noise(
        prediction_model(sampled_winch(case, sample_time=T)), WEIGHTS["thesis-1975-rope"].noise
    )


class Calm:
    """A hook and a load that swing, told of by sensors with small errors to a filter that knows."""

    def __init__(self, model, seed=1):
        self.gate, self._rng, self._k = SignalGate(model), np.random.default_rng(seed), 0
        shift = model.winch.plant.C @ model.winch.moved[: len(model.winch.plant.A)]
        self._turns = shift[SIGNAL["motor.speed"], 1] / shift[SIGNAL["drum.haul"], 0]
        self._error = 0.3 * np.sqrt(model.R)  # a robust filter trusts its sensors less
        self._spread = 4.0 * model.R

    def truth(self, time):
        values = np.zeros(len(MEASURED))
        for names, size, omega in ((PAYLOAD[::-1], 0.05, 0.9), (UNIT, 0.5, 0.6), (DRUM, 0.4, 0.7)):
            swing = np.array([np.sin(omega * time), np.cos(omega * time), -np.sin(omega * time)])
            for name, value, power in zip(names, swing, range(3), strict=False):
                values[SIGNAL[name]] = size * omega**power * value
        values[SIGNAL["motor.speed"]] *= self._turns
        values[SIGNAL["rope.tension"]] = 4e4 * np.sin(0.8 * time)
        return values

    def sample(self, *, there=None, hold=None, known=None, **added):
        """Return what of a sample is believed, by name; what is added is added to the reading."""
        self._k += 1
        expected = self.truth(self._k * T)
        reading = expected + self._error * self._rng.normal(size=len(MEASURED))
        for name, value in added.items():
            reading[SIGNAL[name.replace("__", ".")]] += value
        if hold is not None:
            names, values = hold
            reading[[SIGNAL[name] for name in names]] = values
        if known is not None:
            expected = expected + known
        fresh = np.ones(len(MEASURED), dtype=np.bool_) if there is None else there
        self.reading = reading
        args = reading, expected, reading - expected, self._spread, fresh
        return dict(zip(MEASURED, self.gate.passes(*args), strict=True))

    def settle(self, seconds=40.0):
        for _ in range(round(seconds / T)):
            self.sample()
        return self


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**16))
def test_sensors_that_tell_the_truth_are_believed(model, seed):
    calm = Calm(model, seed)
    assert all(all(calm.sample().values()) for _ in range(1500))


@pytest.mark.parametrize(
    ("name", "size"),
    [
        ("payload.acceleration", 20.0),
        ("payload.velocity", -3.0),
        ("payload.displacement", 2.0),
        ("mru.heave", 3.0),
        ("mru.heave_rate", -5.0),
        ("drum.haul", 1.0),
        ("motor.speed", 90.0),
        ("rope.tension", -2e5),
    ],
)
def test_a_number_that_jumps_away_is_turned_away_and_the_next_is_believed(model, name, size):
    calm = Calm(model).settle()
    found = calm.sample(**{name.replace(".", "__"): size})
    pair = next((pair for pair in (UNIT, DRUM) if name in pair), [name])
    assert [one for one, believed in found.items() if not believed] == pair
    assert all(calm.sample().values())


def test_spikes_at_every_sample_are_never_believed(model):
    calm = Calm(model).settle()
    for k in range(400):
        found = calm.sample(
            payload__displacement=5.0 * (-1) ** (k // 3), mru__heave=2.0 * (-1) ** k
        )
        assert not found["payload.displacement"]
        assert not found["mru.heave"]
        assert found["payload.velocity"]
        assert found["drum.haul"]
    for _ in range(40):
        calm.sample()
    assert all(calm.sample().values())


def test_a_bias_of_the_load_stays_away_and_one_of_the_unit_is_followed_after_a_second(model):
    """Where the hook is, nobody else knows; the load's place is known from all the others."""
    calm = Calm(model).settle()
    believed = [calm.sample(payload__displacement=0.5, mru__heave=0.5) for _ in range(100)]
    assert not any(found["payload.displacement"] for found in believed)
    begun = [found["mru.heave"] for found in believed].index(True)
    assert 20 <= begun <= 25
    assert all(found["mru.heave"] for found in believed[begun:])


@pytest.mark.parametrize("names", [PAYLOAD, UNIT, DRUM, ["rope.tension"]])
def test_what_stands_still_while_it_should_move_is_stuck_until_it_changes(model, names):
    calm = Calm(model).settle()
    calm.sample()
    held = names, calm.reading[[SIGNAL[name] for name in names]].copy()
    found = [calm.sample(hold=held) for _ in range(200)]
    late = found[80:]
    assert not any(one[name] for one in late for name in names)
    assert all(one[name] for one in late for name in MEASURED if name not in names)
    for _ in range(40):
        calm.sample()
    assert all(calm.sample().values())


def test_an_accelerometer_that_is_off_stays_away_until_it_is_near_again(model):
    calm = Calm(model).settle()
    found = [calm.sample(payload__acceleration=2.0) for _ in range(100)]
    assert not any(one["payload.acceleration"] for one in found)
    assert all(one["payload.velocity"] for one in found)
    assert all(calm.sample().values())


def test_a_signal_that_stands_still_takes_those_of_its_device_with_it(model):
    """The accelerometer's noise may hide that it stands still; it comes with the same telegram."""
    calm = Calm(model).settle()
    calm._spread = calm._spread.copy()
    calm._spread[SIGNAL["payload.acceleration"]] = 100.0
    calm.sample()
    held = PAYLOAD, calm.reading[[SIGNAL[name] for name in PAYLOAD]].copy()
    found = [calm.sample(hold=held) for _ in range(100)]
    assert not any(one["payload.acceleration"] for one in found[80:])


def test_a_telegram_that_comes_now_and_then_is_not_stuck(model):
    calm = Calm(model).settle()
    for k in range(400):
        there = np.ones(len(MEASURED), dtype=np.bool_)
        there[:3] = k % 4 == 0
        found = calm.sample(there=there)
        assert [found[name] for name in MEASURED] == list(there)


def test_a_reading_that_is_taken_now_and_then_is_not_stuck_before_the_next():
    case = case_of("thesis-1975-rope").replace({"sensors.payload.displacement_rate": "5 Hz"})
    gate = SignalGate(prediction_model(sampled_winch(case, sample_time=T)))
    every = np.ones(len(MEASURED), dtype=np.bool_)
    at, small = SIGNAL["payload.displacement"], np.full(len(MEASURED), 1e-6)
    rng, believed = np.random.default_rng(2), []
    for k in range(1200):
        expected = 1e-4 * rng.normal(size=len(MEASURED))
        expected[at] = 0.1 * k * T
        reading = expected.copy()
        reading[at] = 0.1 * (k - k % 4 if k < 1000 else 1000) * T
        believed.append(gate.passes(reading, expected, reading - expected, small, every)[at])
    assert all(believed[500:1000])
    assert not any(believed[1010:])


def test_a_load_at_rest_is_not_stuck(model):
    """Coarse sensors show the same number for long where next to nothing moves."""
    gate, still = SignalGate(model), np.zeros(len(MEASURED))
    every = np.ones(len(MEASURED), dtype=np.bool_)
    for k in range(800):
        expected = np.sqrt(model.R) * np.sin(0.3 * k)
        assert gate.passes(still, expected, still - expected, model.R, every).all()


def test_signals_that_agree_with_each_other_are_believed_whatever_was_expected(model):
    """A plant that is not as told, not a sensor that lies."""
    calm = Calm(model).settle()
    known = np.zeros(len(MEASURED))
    known[SIGNAL["payload.displacement"]] = 1.0
    known[SIGNAL["payload.velocity"]] = 1.0
    known[SIGNAL["rope.tension"]] = 1e5
    assert all(all(calm.sample(known=known).values()) for _ in range(100))
    # Alone the load cell is the one that is wrong.
    known[:3] = 0.0
    calm = Calm(model).settle()
    assert not calm.sample(known=known)["rope.tension"]


@pytest.fixture(scope="module")
def controllers():
    crane = models.load_case("subsea-crane")
    return {
        "subsea-crane": LinearMPC(crane, weights=WEIGHTS["subsea-crane"]),
        "thesis-1975": LinearMPC(case_of("thesis-1975"), weights=WEIGHTS["thesis-1975"]),
    }


def held(*names):
    """Return a fault: these signals show what they showed at its beginning."""

    def fault(values, first, rng):
        del rng
        at = [AT[name] for name in names]
        values[at] = first[at]

    return fault


def spikes(name, size):
    def fault(values, first, rng):
        del first
        if rng.random() < 0.2:
            values[AT[name]] += size * rng.choice([-1.0, 1.0])

    return fault


def zero(*names):
    def fault(values, first, rng):
        del first, rng
        values[[AT[name] for name in names]] = 0.0

    return fault


FAULTS = {
    "payload stuck": held(*PAYLOAD),
    "payload at zero": zero(*PAYLOAD),
    "load cell at zero": zero("rope.tension"),
    "displacement": spikes("payload.displacement", 5.0),
    "acceleration": spikes("payload.acceleration", 20.0),
    "heave": spikes("mru.heave", 3.0),
    "haul": spikes("drum.haul", 1.0),
}


class Faulty:
    """A controller to which sensors lie from 60 to 80 s."""

    def __init__(self, controller, fault):
        self.name, self.sample_time = controller.name, controller.sample_time
        self._controller, self._fault = controller, fault

    def reset(self):
        self._controller.reset()
        self._first, self._rng = None, np.random.default_rng(16)

    def step(self, measurement, time):
        values = measurement.values.copy()
        if 60.0 <= time < 80.0:
            if self._first is None:
                self._first = values.copy()
            self._fault(values, self._first, self._rng)
        return self._controller.step(Measurement(values), time)


@pytest.mark.parametrize(
    ("name", "seeds"), [("thesis-1975", (100, 106, 117)), ("subsea-crane", (0,))]
)
def test_a_unit_is_believed_from_its_first_steep_wave_to_the_end_of_the_run(name, seeds):
    """A calm of twenty seconds is no measure of it; and what it hears does not jump at the end."""
    case = models.load_case(name)
    controller = LinearMPC(case, weights=WEIGHTS[name])
    for seed in seeds:
        sh.simulate(case, controller, seeds=[seed], duration=30.0)
        assert controller.counts["gated"] == 0, seed


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("name", ["subsea-crane", "thesis-1975"])
def test_sensors_that_lie_do_not_move_the_load(controllers, name, fault):
    """Without the gate a load cell at zero hauls the load by 20 m, and spikes move it by metres."""
    controller = controllers[name]
    faulty = Faulty(controller, FAULTS[fault])
    run = sh.simulate(controller.case, faulty, seeds=[1], duration=110.0, settle=40.0).runs[0]
    moved = run["payload.displacement"]
    before, after = ((run.time > a) & (run.time < b) for a, b in ((40.0, 60.0), (60.0, 110.0)))
    usual = max(float(np.abs(moved[before]).max()), 0.1)
    assert float(np.abs(moved[after]).max()) < 6.0 * usual
