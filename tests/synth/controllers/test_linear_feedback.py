"""Linear feedback, sampled: against scipy's discretisation, the design, and a stuck drive."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.signal
from former_cases import load_case
from hypothesis import given
from hypothesis import strategies as st
from linear_runs import linear_run, still
from sampled_response import sampled_response

from models.basics import InputError, SynthesisError
from models.plant import MEAN_LOSSES, PlantData, build_plant
from models.sensing import Measurement
from models.simulation import SimulationOptions, prepare
from synth import LowOrder, MaxSensitivity, White, evaluate_gains, tune
from synth.controllers import LinearFeedback
from synth.loop import LinearController
from synth.structures import sampled, sampled_loop, tracking_gain

PAYLOAD = ("payload.acceleration", "payload.velocity", "payload.displacement")
COMMAND = ("drive.command",)
GAINS = {"A": 200.0, "a": 50.0, "a1": 100.0, "a2": 100.0}
LIGHT = {"A": 1.0, "a": 2.0, "a1": 3.0, "a2": 4.0}
INTEGRAL = LinearController(  # u = -2 P' - 3 P - 1.5 int P
    A=[[0.0]],
    B=[[0.0, 0.0, 1.0]],
    C=[[-1.5]],
    D=[[0.0, -2.0, -3.0]],
    measurements=PAYLOAD,
    inputs=COMMAND,
)


def random_controller(n: int, seed: int, ny: int = 2) -> LinearController:
    random = np.random.default_rng(seed)
    return LinearController(
        A=2.0 * random.standard_normal((n, n)) - 2.0 * np.eye(n),
        B=random.standard_normal((n, ny)),
        C=random.standard_normal((1, n)),
        D=random.standard_normal((1, ny)),
        measurements=PAYLOAD[:ny],
        inputs=COMMAND,
    )


def static(name: str) -> float:
    return build_plant(load_case(name)).operating_point(MEAN_LOSSES).command


def seen(name: str = "thesis-1975", **values: float) -> Measurement:
    """A fresh measurement; underscores stand for the first dot of a name."""
    named = {key.replace("_", ".", 1): value for key, value in values.items()}
    return Measurement.of({"drive.applied": static(name), "payload.valid": 1.0, **named})


def test_gains_make_the_thesis_law() -> None:
    law = LinearFeedback(load_case("thesis-1975"), GAINS)
    m = seen(payload_acceleration=0.01, payload_velocity=-0.02, payload_displacement=0.03)
    expected = static("thesis-1975") - 200.0 * (50.0 * 0.01 - 100.0 * 0.02 + 100.0 * 0.03)
    assert law.step(m, 0.0) == pytest.approx(expected, rel=1e-14)
    assert not law.dynamic
    assert not law.anti_windup  # nothing can wind up


def test_amplifier_is_that_of_the_case_unless_given() -> None:
    case = load_case("thesis-1975")
    gains = {"a": 0.0, "a1": 0.0, "a2": 1.0}
    m = seen(payload_displacement=0.1)
    assert LinearFeedback(case, gains).step(m, 0.0) == pytest.approx(static(case.name) - 20.0)
    free = load_case("subsea-crane")
    m = seen("subsea-crane", payload_displacement=0.1)
    assert LinearFeedback(free, gains).step(m, 0.0) == pytest.approx(static(free.name) - 0.1)


def test_deviations_count_from_the_reference() -> None:
    law = LinearFeedback(load_case("thesis-1975"), LIGHT)
    m = seen(
        payload_acceleration=0.3,
        payload_velocity=0.2,
        payload_displacement=5.1,
        reference_acceleration=0.1,
        reference_velocity=0.0,
        reference_displacement=5.0,
    )
    expected = static("thesis-1975") - (2.0 * 0.2 + 3.0 * 0.2 + 4.0 * 0.1)
    assert law.step(m, 0.0) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("name", ["thesis-1975", "subsea-crane"])
def test_reference_speed_is_fed_forward_at_what_a_steady_speed_costs(name: str) -> None:
    case, drag = load_case(name), 1e5
    law = LinearFeedback(case, {"a": 0.0, "a1": 0.0, "a2": 0.0})  # nothing but the feed-forward
    data = build_plant(case).data
    if data.motor == "dc":  # E = K_omega omega + R i, with the current that friction takes
        friction = data.viscous_friction * data.resistance / data.torque_constant
        expected = data.back_emf_constant + friction
        damping = data.viscous_friction + (
            data.torque_constant * data.back_emf_constant / data.resistance
        )
    else:
        expected = 1.0 + data.viscous_friction / data.speed_gain
        damping = data.viscous_friction + data.speed_gain
    speed = 0.2 * data.gear_ratio / data.drum_radius
    asked = law.step(seen(name, reference_velocity=0.2), 0.0)
    assert asked == pytest.approx(static(name) + expected * speed, rel=1e-12)
    # Open loop the drum turns as fast as that, but for what the payload's drag takes.
    run = linear_run(case, law, still, reference=lambda t: (0.2 * t, 0.2), duration=60.0, drag=drag)
    reached = (run["drum.haul"][-1] - run["drum.haul"][-501]) / (500 * law.sample_time)
    load = data.mean_gear_factor * drag * (data.drum_radius / data.gear_ratio) ** 2
    assert reached == pytest.approx(0.2 / (1.0 + load / damping), rel=1e-4)


@given(st.integers(1, 4), st.integers(0, 10**6), st.floats(0.005, 0.2))
def test_sampling_agrees_with_scipy(n: int, seed: int, T: float) -> None:
    c = random_controller(n, seed)
    A, B, C, D, _ = scipy.signal.cont2discrete((c.A, c.B, c.C, c.D), T, method="bilinear")
    z = np.exp(1j * np.array([0.3, 1.0, 2.5]))

    def response(A, B, C, D):  # realisations may differ, responses must not
        return np.array([C @ np.linalg.solve(at * np.eye(n) - A, B) + D for at in z])

    ours = response(*sampled(c, T))
    theirs = response(A, B, C, D)
    assert np.abs(ours - theirs).max() <= 1e-8 * (1.0 + np.abs(theirs).max())


def test_steps_of_a_dynamic_controller_are_those_of_scipy() -> None:
    T, random = 0.02, np.random.default_rng(5)
    c = random_controller(3, 7, ny=3)
    case = load_case("subsea-crane")
    law = LinearFeedback(case, c, sample_time=T, anti_windup=False)
    y = random.standard_normal((80, 3))
    system = scipy.signal.cont2discrete((c.A, c.B, c.C, c.D), T, method="bilinear")
    _, expected, _ = scipy.signal.dlsim(system, y)
    found = [law.step(Measurement.of(dict(zip(PAYLOAD, row, strict=True))), 0.0) for row in y]
    assert np.array(found) - static(case.name) == pytest.approx(expected[:, 0], rel=1e-9, abs=1e-9)


def test_anti_windup_changes_nothing_while_the_drive_obeys() -> None:
    case = load_case("thesis-1975")
    y = np.random.default_rng(1).standard_normal((300, 3))
    both = []
    for anti_windup in (True, False):
        law = LinearFeedback(case, INTEGRAL, anti_windup=anti_windup)
        applied, found = static(case.name), []
        for row in y:
            named = dict(zip(PAYLOAD, row, strict=True)) | {"drive.applied": applied}
            applied = law.step(Measurement.of(named), 0.0)
            found.append(applied)
        both.append(found)
    assert both[0] == pytest.approx(both[1], rel=1e-13)


def test_with_anti_windup_a_saturated_loop_comes_back_sooner() -> None:
    # A payload 0.5 m too low, and a drive that may turn slowly only: the integral has far too
    # long to grow.
    case = load_case("subsea-crane")
    strong = LinearController(
        A=[[0.0]],
        B=[[0.0, 0.0, 1.0]],
        C=[[-20.0]],
        D=[[0.0, -10.0, -60.0]],
        measurements=PAYLOAD,
        inputs=COMMAND,
    )
    overshoot = {}
    for anti_windup in (True, False):
        law = LinearFeedback(case, strong, anti_windup=anti_windup)
        run = linear_run(
            case,
            law,
            still,
            reference=lambda t: (0.5, 0.0),
            duration=40.0,
            drag=1e5,
            limits=(-6.0, 6.0),
        )
        overshoot[anti_windup] = run["payload.displacement"].max() - 0.5
        assert run["payload.displacement"][-1] == pytest.approx(0.5, abs=0.05)
    assert overshoot[False] > 0.15
    assert overshoot[True] < 0.5 * overshoot[False]


@given(st.integers(1, 5), st.integers(0, 10**6), st.floats(0.005, 0.5))
def test_tracking_holds_every_state_while_the_drive_has_its_way(
    n: int, seed: int, T: float
) -> None:
    c = random_controller(n, seed)
    try:
        matrices = sampled(c, T)
        gain = tracking_gain(matrices, T)
    except (InputError, SynthesisError):
        return  # a pole where Tustin's rule has none to give, or out of reach numerically
    A, _, C, _ = matrices
    assert np.abs(np.linalg.eigvals(A - gain @ C)).max() < 1.0


def test_tracking_holds_an_integrator_and_an_unstable_controller() -> None:
    for pole in (0.0, 0.5):
        c = LinearController(
            A=[[pole]], B=[[1.0]], C=[[-1.0]], D=[[-2.0]], measurements=("payload.velocity",),
            inputs=COMMAND,
        )  # fmt: skip
        A, B, C, D = sampled(c, 0.01)
        gain = tracking_gain((A, B, C, D), 0.01)
        assert abs(A) >= 1.0
        assert 0.9 < float((A - gain @ C)[0, 0]) < 1.0


def test_a_lasting_state_that_is_not_seen_cannot_be_held() -> None:
    hidden = LinearController(
        A=[[0.0, 0.0], [0.0, -1.0]],
        B=[[1.0], [1.0]],
        C=[[0.0, 1.0]],
        D=[[0.0]],
        measurements=("payload.velocity",),
        inputs=COMMAND,
    )
    with pytest.raises(SynthesisError, match="no anti-windup holds this controller"):
        LinearFeedback(load_case("thesis-1975"), hidden)
    LinearFeedback(load_case("thesis-1975"), hidden, anti_windup=False)


def test_old_values_fade_out() -> None:
    case = load_case("subsea-crane")  # telemetry is 30 ms late
    law, rest = LinearFeedback(case, LIGHT), static("subsea-crane")
    m = {"payload_displacement": 0.5, "drive_applied": rest}
    for age, share in ((0.0, 1.0), (1.03, 1.0), (1.53, 0.5), (2.03, 0.0), (50.0, 0.0)):
        asked = law.step(seen("subsea-crane", payload_age=age, **m), 0.0) - rest
        assert asked == pytest.approx(-2.0 * share, rel=1e-9, abs=1e-12)
    patient = LinearFeedback(case, LIGHT, hold_for=60.0)
    m |= {"payload_age": 50.0}
    assert patient.step(seen("subsea-crane", **m), 0.0) == pytest.approx(rest - 2.0)


def test_signals_of_the_winch_may_be_heard_about_their_rest() -> None:
    case = load_case("thesis-1975")
    c = LinearController.static(
        [[1e-4, 3.0, 7.0]], ("rope.tension", "motor.speed", "drum.haul"), COMMAND
    )
    law, point = LinearFeedback(case, c), build_plant(case).operating_point(MEAN_LOSSES)
    speed = law.motor.per_rope_speed
    m = seen(
        rope_tension=point.tension + 1e4,
        motor_speed=speed * 0.2 + 0.5,
        drum_haul=3.2,
        reference_displacement=3.0,
        reference_velocity=0.2,
    )
    moving = law.motor.feed * speed * 0.2
    expected = point.command + moving + 1.0 + 3.0 * 0.5 + 7.0 * 0.2
    assert law.step(m, 0.0) == pytest.approx(expected, rel=1e-12)


def test_from_design_takes_gains_and_case() -> None:
    case = load_case("thesis-1975")
    law = LinearFeedback.from_design(evaluate_gains(case, GAINS), sample_time=0.02, name="mine")
    assert law.name == "mine"
    assert law.sample_time == 0.02
    assert law.case == case
    assert law.controller.D.tolist() == [[-1e4, -2e4, -2e4]]


def test_a_tuned_low_order_controller_is_as_good_sampled_as_it_is_designed() -> None:
    case = load_case("thesis-1975")
    plant = build_plant(case)
    lin = plant.linearise(drag=2e4)
    tuning = tune(
        lin,
        LowOrder(2),
        spectrum={"payload.force": White(1e8)},
        minimise={"payload.displacement": 1.0, "motor.torque": 1e-6},
        limits=[MaxSensitivity(bound=2.0)],
        starts=2,
    )
    assert tuning.ok, tuning.status
    law = LinearFeedback.from_design(tuning, case=case, sample_time=0.002)
    assert law.dynamic
    assert law.anti_windup
    loop = sampled_loop(case, plant, law.recursion, 0.002, drag=2e4)
    assert loop.stable
    # P over Z of the continuous loop from its blocks: zw + zu C (1 - yu C)^-1 yw.
    omega = np.array([0.4, 0.8, 1.6])
    r, C = lin.response(omega), tuning.controller.response_at(1j * omega)
    inner = np.linalg.solve(np.eye(3) - r.yu @ C, r.yw)
    row, column = r.outputs.index("payload.displacement"), r.disturbances.index("hook.heave")
    expected = (r.zw + r.zu @ C @ inner)[:, row, column]
    found = sampled_response(case, loop, ["payload.displacement"], omega)["payload.displacement"]
    assert np.abs(found - expected).max() < 0.01 * np.abs(expected).max()
    with pytest.raises(InputError, match="a Tuning does not know its case"):
        LinearFeedback.from_design(tuning)


@pytest.mark.parametrize(
    ("law", "changes", "text"),
    [
        ({"a": 1.0, "a1": 1.0}, {}, "gains: must be a, a1, a2 and optionally A, got a, a1"),
        ({"a": 1.0, "a1": 1.0, "a2": 1.0, "k": 1.0}, {}, "got a, a1, a2, k"),
        ({"a": 1.0, "a1": math.nan, "a2": 1.0}, {}, "gains: a1 must be a finite number"),
        (LIGHT, {"hold_for": -1.0}, "hold_for must be at least 0 s, got -1.0"),
        (
            LinearController.static([[1.0]], ("hook.heave",), COMMAND),
            {},
            "no measurement 'hook.heave'; there are: payload.acceleration, ",
        ),
        (
            LinearController.static([[1.0], [1.0]], ("drum.haul",), ("one", "two")),
            {},
            "must have one input, the drive's command, got one, two",
        ),
        (
            LinearController(
                A=[[400.0]], B=[[1.0]], C=[[1.0]], D=[[0.0]],
                measurements=("drum.haul",), inputs=COMMAND,
            ),
            {},
            "has a pole at 400 1/s, which Tustin's rule maps to infinity",
        ),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told(law: object, changes: dict[str, object], text: str) -> None:
    with pytest.raises(InputError, match=text):
        LinearFeedback(load_case("thesis-1975"), law, **changes)


def test_a_design_without_a_controller_is_told() -> None:
    class Nothing:
        controller, status = None, "no stable design was found"

    with pytest.raises(InputError, match="has no controller: no stable design was found"):
        LinearFeedback.from_design(Nothing(), case=load_case("thesis-1975"))


_SOME = {"A": 1.0, "a": 0.1, "a1": 0.1, "a2": 0.1}


def test_a_design_is_simulated_on_as_many_masses_as_it_was_found_to_hold_on():
    """With gains that reach its higher modes the coarser rope swings where the rope does not."""
    case = load_case("thesis-1975-rope")
    ropes = {}
    for masses in (0, 3, 33):
        controller = LinearFeedback(case, _SOME, masses=masses)
        for asked in (None, 6):
            loop = prepare(case, controller, options=SimulationOptions(masses=asked)).loop
            states = [name for name in loop.states if name.startswith("plant.rope.")]
            ropes[masses, asked] = sum(name.endswith("velocity") for name in states)
    usual = ropes[0, None]
    assert ropes[33, None] - usual == 33 - PlantData.from_case(case).chosen_masses()
    assert ropes[3, None] == usual
    assert ropes[0, 6] == ropes[33, 6] == ropes[3, 6]
    told = case.replace({"rope.masses": 5})
    loop = prepare(told, LinearFeedback(told, _SOME, masses=33)).loop
    assert sum(n.startswith("plant.rope.") and n.endswith("velocity") for n in loop.states) == 4


def test_the_feedback_of_a_design_knows_its_masses():
    case = load_case("thesis-1975-rope")
    design = evaluate_gains(case, case.gains)
    assert design.masses > 1
    assert LinearFeedback.from_design(design).masses == design.masses
    assert LinearFeedback.from_design(design, masses=0).masses == 0
