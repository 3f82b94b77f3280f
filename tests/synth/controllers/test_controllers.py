"""What every controller owes to whoever runs it, whatever it does with it."""

from __future__ import annotations

import copy
import math
import pickle
from functools import cache

import casadi as ca
import numpy as np
import pytest
from former_cases import load_case
from hypothesis import given
from hypothesis import strategies as st

from models.basics import InputError
from models.plant import MEAN_LOSSES, build_plant
from models.sensing import (
    HEARD,
    Controller,
    Measurement,
    Recursion,
    heard_by,
    holds_brake,
    recursion_of,
)
from models.simulation import Kernel
from synth.controllers import (
    BrakeOn,
    ConstantTension,
    LinearFeedback,
    VelocityFeedForward,
)
from synth.loop import LinearController as StateSpace
from synth.structures import RecursiveController
from synth.structures.recursive import at_rest

CASES = ("thesis-1975", "thesis-1975-rope", "subsea-crane")
# A design with an integrator and a lag stands for what `tune` hands over.
DYNAMIC = StateSpace(
    A=[[0.0, 0.0], [0.0, -3.0]],
    B=[[0.0, 0.0, -0.1], [1.0, 2.0, 0.0]],
    C=[[1.0, -4.0]],
    D=[[-1.0, 0.0, -2.0]],
    measurements=("payload.acceleration", "payload.velocity", "payload.displacement"),
    inputs=("drive.command",),
)
MAKERS = {
    "feedback": lambda case: LinearFeedback(case, {"a": 1.0, "a1": 5.0, "a2": 3.0}),
    "feedback with states": lambda case: LinearFeedback(case, DYNAMIC),
    "feedback-no-antiwindup": lambda case: LinearFeedback(
        case, DYNAMIC, anti_windup=False, name="feedback-no-antiwindup"
    ),
    "feed-forward": VelocityFeedForward,
    "feed-forward-lead": VelocityFeedForward.with_lead,
    "constant-tension": ConstantTension,
    "none": BrakeOn,
}
KINDS = tuple(MAKERS)
EVERY = [(name, kind) for name in CASES for kind in KINDS]
every = pytest.mark.parametrize(("name", "kind"), EVERY)


@cache
def made(name: str, kind: str) -> RecursiveController:
    return MAKERS[kind](load_case(name))


@cache
def rest(name: str) -> Measurement:
    return at_rest(build_plant(load_case(name)).operating_point(MEAN_LOSSES))


def seen_things(name: str, n: int, seed: int) -> list[Measurement]:
    """Measurements about those at rest, of the size of a rough sea, flags and ages included."""
    random, still = np.random.default_rng(seed), rest(name).values
    sizes = np.maximum(0.2 * np.abs(still), 1.0)
    found = still + sizes * random.standard_normal((n, len(HEARD)))
    for flag in ("payload.valid", "mru.valid"):
        found[:, HEARD.index(flag)] = random.random(n) > 0.3
    age = HEARD.index("payload.age")
    found[:, age] = 2.0 * random.random(n)
    return [Measurement(row) for row in found]


def commands(controller: Controller, seen: list[Measurement]) -> list[float]:
    controller.reset()
    return [controller.step(m, k * controller.sample_time) for k, m in enumerate(seen)]


@every
def test_obeys_the_protocol(name: str, kind: str) -> None:
    controller = made(name, kind)
    assert isinstance(controller, Controller)
    assert controller.sample_time > 0.0
    assert controller.name == ("feedback" if kind == "feedback with states" else kind)
    assert isinstance(recursion_of(controller), Recursion)
    assert holds_brake(controller) is (kind == "none")


@every
def test_reset_gives_the_same_commands_again(name: str, kind: str) -> None:
    controller, seen = made(name, kind), seen_things(name, 50, seed=1)
    first = commands(controller, seen)
    assert commands(controller, seen) == first
    controller.step(Measurement(np.full(len(HEARD), 7.0)), 99.0)
    assert commands(controller, seen) == first


@every
def test_step_and_recursion_agree(name: str, kind: str) -> None:
    controller, seen = made(name, kind), seen_things(name, 200, seed=2)
    recursion = controller.recursion
    state, expected = ca.DM(recursion.initial), []
    for m in seen:
        state, command = recursion.function(state, m.values)
        expected.append(float(command))
    assert commands(controller, seen) == pytest.approx(expected, rel=1e-12, abs=0.0)


@pytest.mark.parametrize("kind", KINDS)
def test_step_and_compiled_recursion_agree(kind: str) -> None:
    controller, seen = made("thesis-1975", kind), seen_things("thesis-1975", 200, seed=3)
    f = controller.recursion.function
    xc, m = ca.SX.sym("xc", f.numel_in(0)), ca.SX.sym("m", f.numel_in(1))
    following, command = f(xc, m)
    kernel = Kernel(ca.Function("alone", [xc, m, ca.SX.sym("p", 0)], [following, command]))
    rows = np.array([m.values for m in seen])
    _, out = kernel.run(controller.recursion.initial, rows, np.zeros(0))
    assert out[:, 0] == pytest.approx(commands(controller, seen), rel=1e-12, abs=0.0)


@every
def test_at_rest_the_command_is_the_static_one_exactly(name: str, kind: str) -> None:
    static = build_plant(load_case(name)).operating_point(MEAN_LOSSES).command
    assert static != 0.0
    if kind == "none":  # the brake holds the load, the drive is off
        static = 0.0
    assert commands(made(name, kind), [rest(name)] * 100) == [static] * 100


@pytest.mark.parametrize("kind", KINDS)
@given(
    st.lists(
        st.lists(st.floats(-1e6, 1e6, allow_nan=False), min_size=len(HEARD), max_size=len(HEARD)),
        min_size=1,
        max_size=20,
    )
)
def test_finite_measurements_make_finite_commands(kind: str, rows: list[list[float]]) -> None:
    seen = [Measurement(np.array(row)) for row in rows]
    assert np.isfinite(commands(made("subsea-crane", kind), seen)).all()


@every
def test_what_is_not_a_number_is_forgotten_at_a_reset(name: str, kind: str) -> None:
    controller, seen = made(name, kind), seen_things(name, 30, seed=4)
    clean = commands(controller, seen)
    for poison in (math.nan, math.inf):
        controller.step(Measurement(np.full(len(HEARD), poison)), 0.0)
        assert commands(controller, seen) == clean


@every
def test_the_measurement_is_not_changed(name: str, kind: str) -> None:
    m = seen_things(name, 1, seed=5)[0]
    before = m.values.copy()
    m.values.setflags(write=False)
    made(name, kind).step(m, 0.0)
    assert (m.values == before).all()


@every
def test_a_copy_goes_on_where_the_original_stood_and_by_itself(name: str, kind: str) -> None:
    controller, seen = made(name, kind), seen_things(name, 40, seed=6)
    whole = commands(controller, seen)
    commands(controller, seen[:20])
    for twin in (pickle.loads(pickle.dumps(controller)), copy.deepcopy(controller)):
        assert [twin.step(m, 0.0) for m in seen[20:]] == whole[20:]
        assert commands(twin, seen) == whole
        assert twin.name == controller.name
    assert [controller.step(m, 0.0) for m in seen[20:]] == whole[20:]


@every
def test_an_order_that_the_drive_has_not_followed_does_not_run_away(name: str, kind: str) -> None:
    # A payload 1 m off for ten minutes with the drive stuck at its static command: only a
    # controller without anti-windup asks for more and more.  (The slowest one here follows the
    # drive in some 25 s, about the time constant of its own integrator.)
    controller = made(name, kind)
    off = {"payload.displacement": 1.0, "drum.haul": 1.0, "motor.speed": 5.0}
    stuck = rest(name).values.copy()
    for signal, value in off.items():
        stuck[HEARD.index(signal)] += value
    samples = round(600.0 / controller.sample_time)
    asked = commands(controller, [Measurement(stuck)] * (samples + 1))
    middle, end = asked[len(asked) // 2], asked[-1]
    if kind == "feedback-no-antiwindup":
        assert abs(end - middle) == pytest.approx(0.1 * 300.0, rel=1e-6)
    else:
        assert end == pytest.approx(middle, abs=1e-3)


@every
def test_it_cannot_be_changed(name: str, kind: str) -> None:
    with pytest.raises(AttributeError):
        made(name, kind).sample_time = 1.0  # type: ignore[misc]


@pytest.mark.parametrize(
    "make",
    [
        lambda case, T: LinearFeedback(case, {"a": 0, "a1": 0, "a2": 1}, sample_time=T),
        lambda case, T: VelocityFeedForward(case, sample_time=T),
        lambda case, T: ConstantTension(case, sample_time=T),
        lambda case, T: BrakeOn(case, sample_time=T),
    ],
)
@pytest.mark.parametrize("wrong", [0.0, -0.01, 11.0, math.nan])
def test_a_sample_time_out_of_range_is_told(make: object, wrong: float) -> None:
    with pytest.raises(InputError, match=r"sample_time must be in \[0\.0001, 10\] s, got"):
        make(load_case("thesis-1975"), wrong)


def test_measurements_go_by_their_names() -> None:
    m = Measurement(np.arange(float(len(HEARD))))
    assert [m[name] for name in HEARD] == list(range(len(HEARD)))
    with pytest.raises(InputError, match=r"no signal 'payload'; there are: payload\.acc"):
        m["payload"]
    with pytest.raises(InputError, match="no signal 'heave'"):
        Measurement.of({"heave": 1.0})


def test_a_recursion_of_another_shape_is_told() -> None:
    xc, m = ca.SX.sym("xc", 2), ca.SX.sym("m", 15)
    f = ca.Function("f", [xc, m], [xc, xc[0]])
    text = rf"must take \[2, {len(HEARD)}\] and return \[2, 1\] numbers .* got \[2, 15\] and"
    with pytest.raises(InputError, match=text):
        Recursion(function=f, initial=np.zeros(2))
    m = ca.SX.sym("m", len(HEARD))
    with pytest.raises(InputError, match="initial must be finite numbers, got nan at index 1"):
        Recursion(function=ca.Function("f", [xc, m], [xc, xc[0]]), initial=[0.0, math.nan])


def test_a_plain_object_with_reset_and_step_is_a_controller() -> None:
    class Own:
        name, sample_time = "own", 0.1

        def reset(self) -> None: ...

        def step(self, measurement: Measurement, time: float) -> float:
            return measurement["drive.applied"] + time

    own = Own()
    assert isinstance(own, Controller)
    assert recursion_of(own) is None
    assert not holds_brake(own)


@every
def test_what_a_law_hears_is_what_its_command_hangs_on(name: str, kind: str) -> None:
    heard, law = heard_by(made(name, kind)), made(name, kind)
    told = {
        "feedback": {"payload.acceleration", "payload.velocity", "payload.displacement"},
        "feed-forward": {"mru.heave", "mru.heave_rate", "drum.haul"},
        "constant-tension": {"rope.tension", "drum.haul"},
        "none": set(),
    }
    family = next(k for k in told if kind.startswith(k))
    assert told[family] <= heard
    assert bool(heard) == bool(told[family])
    for other in ("payload.velocity", "mru.heave_rate", "rope.tension"):
        if other not in heard:
            rows = seen_things(name, 40, seed=5)
            changed = [row.values.copy() for row in rows]
            for values in changed:
                values[HEARD.index(other)] += 1.0
            law.reset()
            before = [law.step(row, 0.0) for row in rows]
            law.reset()
            assert [law.step(Measurement(values), 0.0) for values in changed] == before


def test_a_controller_in_python_may_hear_everything() -> None:
    class Own:
        name, sample_time = "own", 0.05

        def reset(self) -> None: ...

        def step(self, measurement: Measurement, time: float) -> float:
            return 0.0

    assert heard_by(Own()) == frozenset(HEARD)
