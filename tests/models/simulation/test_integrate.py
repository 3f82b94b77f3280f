from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np
import numpy.typing as npt
import pytest
from former_cases import load_case
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from models import InputError, Plant, PlantData, build_plant
from models.simulation.integrate import (
    StepChoice,
    choose_step,
    hermite_midpoint,
    rk4_step,
)

FloatArray = npt.NDArray[np.float64]
AMPLITUDE, OMEGA = 0.5, 0.7  # of the hook [m], [rad/s]


def sine(t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    return (
        AMPLITUDE * np.sin(OMEGA * t),
        AMPLITUDE * OMEGA * np.cos(OMEGA * t),
        -AMPLITUDE * OMEGA**2 * np.sin(OMEGA * t),
    )


def accumulate(
    plant: Plant, parameters: dict[str, float], h: float, start: FloatArray, duration: float
) -> FloatArray:
    """Run Runge-Kutta steps of length h over the sine and return all states, (nx, n)."""
    rest = plant.operating_point(parameters)
    x, row = ca.SX.sym("x", len(plant.states)), ca.SX.sym("row", 6)
    z0, v0, a0, z1, v1, a1 = ca.vertsplit(row)

    def rhs(state: ca.SX, motions: list[tuple[ca.SX, ca.SX]]) -> ca.SX:
        (z, v) = motions[0]
        return plant.function(state, rest.command, ca.vertcat(z, v, 0, 0), rest.p)[0]

    middle = hermite_midpoint(z0, v0, a0, z1, v1, a1, h)
    after = rk4_step(rhs, x, [(z0, v0)], [middle], [(z1, v1)], h)
    n = round(duration / h)
    run = ca.Function("step", [x, row], [after]).mapaccum("run", n)
    motion = np.array(sine(np.arange(n + 1) * h))
    return np.asarray(run(start, np.vstack([motion[:, :-1], motion[:, 1:]])))


def exact(
    plant: Plant, parameters: dict[str, float], start: FloatArray, duration: float
) -> FloatArray:
    rest = plant.operating_point(parameters)

    def rhs(t: float, x: FloatArray) -> FloatArray:
        z, v, _ = sine(np.array(t))
        w = np.array([z, v, 0.0, 0.0])
        return np.asarray(plant.function(x, rest.command, w, rest.p)[0]).ravel()

    found = solve_ivp(rhs, (0.0, duration), start, method="DOP853", rtol=1e-11, atol=1e-12)
    return np.asarray(found.y[:, -1])


def test_runge_kutta_has_order_four_on_the_plant_under_a_sine() -> None:
    plant = build_plant(load_case("thesis-1975"))
    # Linear drag: the quadratic law has a kink in its slope, which no method steps over at
    # full order.
    parameters = {"payload.quadratic_drag": 0.0, "payload.linear_drag": 2000.0}
    start = np.array(plant.operating_point(parameters).x)
    truth = exact(plant, parameters, start, 60.0)
    steps = (0.1, 0.05, 0.025)
    errors = [
        np.linalg.norm(accumulate(plant, parameters, h, start, 60.0)[:, -1] - truth) for h in steps
    ]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx([4.0, 4.0], abs=0.1)


def test_whole_plant_with_quadratic_drag_agrees_with_scipy() -> None:
    plant = build_plant(load_case("thesis-1975"))
    start = np.array(plant.operating_point().x)
    truth = exact(plant, {}, start, 60.0)
    assert truth[plant.states.index("payload.displacement")] != pytest.approx(0.0, abs=0.01)
    coarse, fine = (
        np.abs(accumulate(plant, {}, h, start, 60.0)[:, -1] - truth).max() for h in (0.04, 0.01)
    )
    assert fine < 1e-8
    assert fine < coarse / 30.0


def lossless() -> PlantData:
    return replace(
        PlantData.from_case(load_case("subsea-crane")),
        damping_ratio=0.0,
        quadratic_drag=0.0,
        gear_efficiency=1.0,
        viscous_friction=0.0,
        motor="ac",
        torque_bandwidth=math.inf,
        speed_gain=0.0,
        sensor_bandwidth=math.inf,
        telemetry_bandwidth=math.inf,
        delay=0.0,
        masses=3,
    )


def energy(plant: Plant, torque: float, x: FloatArray) -> FloatArray:
    """Motion, stretch, weight and the held motor torque, which is a potential too [J]."""
    data, lumps = plant.data, plant.lumps
    value = dict(zip(plant.states, x, strict=True))
    names = ["rope.1", "rope.2", "payload"]
    shift = [value[f"{name}.displacement"] for name in names]
    moving = [value[f"{name}.velocity"] for name in names]
    mass = data.mass_per_length * data.rope_length * lumps.masses + [0, 0, data.payload_mass]
    weight = data.rope_weight * data.rope_length * lumps.masses + [0, 0, data.payload_weight]
    stiffness = data.axial_stiffness / (data.rope_length * lumps.springs)
    top = value["motor.angle"] * data.drum_radius / data.gear_ratio
    total = 0.5 * data.inertia * value["motor.speed"] ** 2 - torque * value["motor.angle"]
    for j in range(3):
        stretch = (top if j == 0 else shift[j - 1]) - shift[j]
        below = weight[j:].sum()
        total = total + 0.5 * mass[j] * moving[j] ** 2 + weight[j] * shift[j]
        total = total + below * stretch + 0.5 * stiffness[j] * stretch**2
    return np.asarray(total)


def test_energy_of_a_rope_without_losses_drifts_as_the_fifth_power_of_the_step() -> None:
    # |R(i h w)|^2 = 1 - (h w)^6/72 in each of T/h steps.
    plant = build_plant(lossless())
    rest = plant.operating_point()
    x = ca.SX.sym("x", len(plant.states))

    def rhs(state: ca.SX, motions: object) -> ca.SX:
        return plant.function(state, rest.command, np.zeros(4), rest.p)[0]

    start = np.array(rest.x)
    start[plant.states.index("payload.velocity")] = 0.2
    still = energy(plant, rest.command, rest.x)
    drifts = []
    for h in (0.004, 0.002, 0.001):
        step = ca.Function("step", [x], [rk4_step(rhs, x, [], [], [], h)])
        states = np.asarray(step.mapaccum("run", round(40.0 / h))(start))
        outputs = np.asarray(plant.function(states, rest.command, np.zeros(4), rest.p)[2])
        # taut throughout: the energy below knows no slack rope
        assert outputs[plant.outputs.index("rope.tension")].min() > 0.0
        course = energy(plant, rest.command, np.column_stack([start, states])) - still
        assert course[0] == pytest.approx(0.5 * plant_mass(plant) * 0.2**2, rel=1e-9)
        assert np.all(np.diff(course[:: round(1.0 / h)]) <= 0.0)
        drifts.append(1.0 - course[-1] / course[0])
    assert drifts[1] < 1e-4
    assert np.log2(np.array(drifts[:-1]) / drifts[1:]) == pytest.approx([5.0, 5.0], abs=0.1)


def plant_mass(plant: Plant) -> float:
    rope = plant.data.mass_per_length * plant.data.rope_length * plant.lumps.masses[-1]
    return float(plant.data.payload_mass + rope)


@given(
    st.lists(st.floats(-10.0, 10.0), min_size=4, max_size=4),
    st.floats(-5.0, 5.0),
    st.floats(1e-3, 1.0),
)
def test_midpoint_is_exact_for_every_cubic(
    coefficients: list[float], start: float, h: float
) -> None:
    z = np.polynomial.Polynomial(coefficients)
    v, a = z.deriv(), z.deriv(2)
    ends = [f(t) for t in (start, start + h) for f in (z, v, a)]
    middle = start + 0.5 * h
    found = hermite_midpoint(*ends, h)
    assert found == pytest.approx((z(middle), v(middle)), rel=1e-9, abs=1e-9)


def growth(A: FloatArray, h: float) -> float:
    """Return the largest growth in one step of x' = A x, by taking the step."""
    rhs: Callable[[FloatArray, object], FloatArray] = lambda x, _: A @ x  # noqa: E731
    step = rk4_step(rhs, np.eye(len(A)), [], [], [], h)
    return float(np.abs(np.linalg.eigvals(step)).max())


@given(st.floats(0.5001 * math.pi, math.pi), st.floats(0.1, 1e4), st.floats(0.01, 1.0))
def test_what_decays_in_truth_decays_in_an_allowed_step(
    angle: float, size: float, part: float
) -> None:
    value = complex(size * math.cos(angle), size * math.sin(angle))
    A = np.array([[value.real, -value.imag], [value.imag, value.real]])
    assert growth(A, part * choose_step(A, 1e3 / size).largest) < 1.0


def oscillator(omega: float) -> FloatArray:
    return np.array([[0.0, 1.0], [-(omega**2), 0.0]])


def test_default_step_is_the_longest_that_divides_the_sample() -> None:
    choice = choose_step(oscillator(35.0), 0.1)
    assert isinstance(choice, StepChoice)
    assert choice.substeps == 4
    assert choice.step == 0.025
    assert choice.largest == pytest.approx(1.0 / 35.0)
    assert choice.fastest == pytest.approx(35.0)
    # h w = 1 to rounding is still one step, not two
    assert choose_step(oscillator(10.0), 0.1).substeps == 1
    assert choose_step(oscillator(10.001), 0.1).substeps == 2


def test_slow_plant_takes_one_step_to_a_sample() -> None:
    assert choose_step(np.zeros((2, 2)), 0.1).substeps == 1
    choice = choose_step(oscillator(2.0), 0.1, 0.02)
    assert (choice.substeps, choice.largest, choice.fastest) == (5, 0.1, pytest.approx(2.0))


def test_fastest_of_several_plants_and_rates_sets_the_step() -> None:
    several = np.stack([oscillator(5.0), oscillator(50.0), oscillator(20.0)])
    assert choose_step(several, 0.1).fastest == pytest.approx(50.0)
    assert choose_step(several, 0.1, extra_rates=(80.0, 3.0)).fastest == 80.0
    assert choose_step(several, 0.1, extra_rates=(80.0, 3.0)).substeps == 8


def test_unstable_plant_is_held_to_accuracy_too() -> None:
    assert choose_step([[4.0]], 1.0).largest == pytest.approx(0.25)


def test_the_step_damps_and_slows_the_fastest_mode_as_its_notes_say() -> None:
    rhs: Callable[[FloatArray, object], FloatArray] = lambda x, _: oscillator(40.0) @ x  # noqa: E731

    def added(step: float | None) -> tuple[float, float]:
        """Return damping ratio and share of the frequency that are added and lost."""
        h = choose_step(oscillator(40.0), 0.1, step).step
        # as a continuous mode: log(R)/h = -zeta w + i w'
        mode = np.log(np.linalg.eigvals(rk4_step(rhs, np.eye(2), [], [], [], h))[0]) / h
        return -mode.real / 40.0, 1.0 - abs(mode.imag) / 40.0

    assert added(None) == pytest.approx((0.0061, 0.0056), abs=5e-5)
    assert added(0.005) == pytest.approx((0.2**5 / 144.0, 0.2**4 / 120.0), rel=0.05)  # h w = 0.2


@given(st.floats(0.01, 500.0), st.floats(0.005, 1.0))
def test_chosen_step_divides_the_sample_and_is_allowed(omega: float, sample_time: float) -> None:
    choice = choose_step(oscillator(omega), sample_time)
    assert choice.step * choice.substeps == pytest.approx(sample_time, rel=1e-15)
    assert choice.step <= choice.largest * (1.0 + 1e-8)
    if choice.substeps > 1:
        assert sample_time / (choice.substeps - 1) > choice.largest
    again = choose_step(oscillator(omega), sample_time, choice.step)
    assert again.substeps == choice.substeps


def test_bundled_plants_get_a_step() -> None:
    for name, substeps in (("thesis-1975", 1), ("subsea-crane", 13)):
        plant = build_plant(load_case(name))
        assert choose_step(plant.linearise(drag=0.0).A, 0.1).substeps == substeps


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            {"step": 0.05},
            "integration: step must be at most 0.02857 s, which the plant's fastest mode, at "
            "35 rad/s, allows, got 0.05",
        ),
        (
            {"step": 0.015},
            "integration: step must divide the sample time 0.1 s into a whole number of steps "
            "and be at most 0.02857 s, which the plant's fastest mode, at 35 rad/s, allows, "
            "got 0.015",
        ),
        ({"step": 0.0}, "integration: step must be above 0 s, got 0.0"),
        ({"step": math.nan}, "integration: step must be above 0 s, got nan"),
        (
            {"extra_rates": (1e5,)},
            "integration: a sample of 0.1 s would take 10000 steps, at most 1000 are allowed; "
            "the plant's fastest mode is at 1e+05 rad/s and allows 1e-05 s a step",
        ),
    ],
)
def test_wrong_input_is_told_in_one_sentence(arguments: dict[str, object], said: str) -> None:
    given_arguments = {"A": oscillator(35.0), "sample_time": 0.1, **arguments}
    with pytest.raises(InputError) as caught:
        choose_step(**given_arguments)
    assert str(caught.value) == said


def test_step_longer_than_the_sample_of_a_slow_plant_names_the_sample() -> None:
    with pytest.raises(InputError, match=r"at most 0\.1 s, which the sample time allows"):
        choose_step(np.zeros((1, 1)), 0.1, 0.2)
