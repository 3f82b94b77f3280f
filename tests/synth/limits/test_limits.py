"""Every limit, made to bind: kept by independent measure, dearer when tighter, priced right."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from types import SimpleNamespace

import control
import numpy as np
import pytest
import scipy.optimize
import scipy.signal
from former_cases import load_case
from loop_numbers import (
    closed_matrices,
    dense_grid,
    double_integrator,
    loop_response,
    lyapunov_variances,
    oscillator,
    stable_with,
    two_carts,
    with_full_state,
)
from scipy.linalg import solve_continuous_lyapunov

from models.basics import InputError, peak_factor
from models.plant import LinearPlant, PlantData
from synth import (
    Continuous,
    DelayMargin,
    DiskMargin,
    GainMargin,
    GainMarginDown,
    HighestFrequency,
    LeastDamping,
    LeastDecay,
    LowFrequency,
    LowOrder,
    MaxSensitivity,
    Minimum,
    Peak,
    Power,
    Rms,
    RollOff,
    StaticGain,
    WeightedResponse,
    White,
    tune,
)
from synth.limits import Breakdown, Limit, Thermal, loop_limits, modelled_bandwidth
from synth.loop import Assessment, Dual, LinearController, disturbances
from synth.verify.demands import limit_demand

WHITE = {"f": White(1.0), "n": White(0.01)}
WEIGHTS = {"x": 1.0, "effort": 0.05}


def servo() -> LinearPlant:
    """A mass with a slow motor behind it, unstable without control, and its motor's speed.

    x'' = 1.5 x + m + f, m' = 4 (u - m); outputs x, its rate, the motor's force and the command.
    """
    return LinearPlant(
        A=[[0.0, 1.0, 0.0], [1.5, 0.0, 1.0], [0.0, 0.0, -4.0]],
        B=[[0.0], [0.0], [4.0]],
        E=[[0.0], [1.0], [0.0]],
        C=np.eye(3),
        Cz=[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]],
        Dz=[[0.0], [0.0], [0.0], [1.0]],
        inputs=("u",),
        measurements=("x", "v", "m"),
        disturbances=("f",),
        outputs=("x", "v", "m", "u_sent"),
    )


def late_servo() -> LinearPlant:
    return dataclasses.replace(servo(), delays=(0.1, 0.1, 0.1))


SERVO_QUESTION = {
    "spectrum": {"f": White(1.0)},
    "minimise": {"x": 1.0, "u_sent": 0.02},
    "starts": 3,
}
CART_QUESTION = {
    "spectrum": {"f": White(1.0), "n1": White(0.01)},
    "minimise": {"x2": 1.0, "effort1": 0.1},
    "starts": 3,
}
MASS_QUESTION = {"spectrum": WHITE, "minimise": WEIGHTS, "starts": 6}


# -------------------------------------------------- measures by other means


def sensitivity_peak(plant: LinearPlant, controller: LinearController) -> float:
    grid = dense_grid(plant, controller)
    return float(np.abs(1.0 / (1.0 + loop_response(plant, controller)(grid))).max())


def gain_reserve(plant: LinearPlant, controller: LinearController, towards: float) -> float:
    """The gain factor, seen from 1 `towards` a factor, at which the loop stops being stable."""
    plant = plant.without_delays(10)
    factors = np.geomspace(1.0, towards, 400)
    lost = [k for k in range(400) if not stable_with(plant, controller, factors[k])]
    if not lost:
        return towards
    inside, outside = factors[lost[0] - 1], factors[lost[0]]
    for _ in range(40):
        middle = np.sqrt(inside * outside)
        if stable_with(plant, controller, middle):
            inside = middle
        else:
            outside = middle
    return float(inside)


def delay_reserve(plant: LinearPlant, controller: LinearController) -> float:
    """The least delay that turns L into -1, from crossovers on a dense grid."""
    grid, loop = dense_grid(plant, controller, 20000), loop_response(plant, controller)
    size = np.abs(loop(grid))
    at = np.flatnonzero((size[:-1] - 1.0) * (size[1:] - 1.0) < 0.0)
    share = (1.0 - size[at]) / (size[at + 1] - size[at])
    omega = grid[at] + share * (grid[at + 1] - grid[at])
    return float((np.mod(np.angle(-loop(omega)), 2.0 * np.pi) / omega).min())


def sigma(plant: LinearPlant, controller: LinearController, output: str) -> float:
    noises = {name: noise for name, noise in WHITE.items() if name in plant.disturbances}
    noises |= {"n1": White(0.01)} if "n1" in plant.disturbances else {}
    return float(np.sqrt(lyapunov_variances(plant, controller, noises)[output]))


def peak(plant: LinearPlant, controller: LinearController, output: str, duration: float) -> float:
    """Most probable maximum, with the rate's variance from the state equations."""
    A, E, C, _ = closed_matrices(plant, controller)
    covariance = solve_continuous_lyapunov(A, -E @ E.T)
    row = C[plant.outputs.index(output)]
    m0, m2 = row @ covariance @ row, row @ A @ covariance @ A.T @ row
    period = 2.0 * np.pi * np.sqrt(m0 / m2)
    return float(np.sqrt(2.0 * np.log(duration / period) * m0))


def disk(plant: LinearPlant, controller: LinearController) -> float:
    sensitivity = 1.0 / (1.0 + loop_response(plant, controller)(dense_grid(plant, controller)))
    return float(1.0 / np.abs(sensitivity - 0.5).max())


def poles(plant: LinearPlant, controller: LinearController) -> np.ndarray:
    return np.linalg.eigvals(closed_matrices(plant, controller)[0])


def lead() -> control.TransferFunction:
    return control.tf([1.0, 0.0], [0.3, 1.0])


def weighted_effort(plant: LinearPlant, controller: LinearController) -> float:
    """Largest |W F| from the disturbance to the command, by python-control."""
    A, E, C, F = closed_matrices(plant, controller)
    row = plant.outputs.index("u_sent")
    loop = control.ss(A, E, C[[row]], F[[row]])
    return largest_gain(control.ss(lead()) * loop)


def largest_gain(system: control.StateSpace) -> float:
    """Largest gain of a system of one input and one output, on a dense grid and then by Brent."""
    grid = np.geomspace(1e-3, 1e4, 20001)
    k = int(np.argmax(np.abs(system(1j * grid))))
    found = scipy.optimize.minimize_scalar(
        lambda w: -abs(system(1j * w)),
        bounds=(grid[max(0, k - 1)], grid[min(k + 1, grid.size - 1)]),
        method="bounded",
        options={"xatol": 1e-9},
    )
    return max(-float(found.fun), float(np.abs(system(1j * grid[k]))))


Measure = Callable[[LinearPlant, LinearController], float]
HOUR = 3600.0

# Plant, structure and question; the limit and a bound at which it binds; its measure by
# other code; how far inside its bound an optimum may stay (margins keep off with discs).
BINDING = {
    "max_sensitivity": (
        late_servo(),
        StaticGain(),
        SERVO_QUESTION,
        lambda bound: MaxSensitivity(bound=bound),
        1.4,
        sensitivity_peak,
        1e-3,
    ),
    "gain_margin_up": (
        late_servo(),
        StaticGain(),
        SERVO_QUESTION,
        lambda bound: GainMargin(bound=bound),
        5.0,
        lambda p, c: gain_reserve(p, c, 100.0),
        0.1,
    ),
    "gain_margin_down": (
        late_servo(),
        StaticGain(),
        SERVO_QUESTION,
        lambda bound: GainMarginDown(bound=bound),
        0.2,
        lambda p, c: gain_reserve(p, c, 1e-3),
        0.1,
    ),
    "delay_margin": (
        late_servo(),
        StaticGain(),
        SERVO_QUESTION,
        lambda bound: DelayMargin(bound=bound),
        0.265,
        delay_reserve,
        0.1,
    ),
    "disk_margin": (
        late_servo(),
        StaticGain(),
        SERVO_QUESTION,
        lambda bound: DiskMargin(bound=bound),
        0.9,
        disk,
        1e-3,
    ),
    "decay": (
        servo(),
        StaticGain(),
        SERVO_QUESTION,
        lambda bound: LeastDecay(bound=bound),
        2.2,
        lambda p, c: float(-poles(p, c).real.max()),
        1e-6,
    ),
    "damping": (
        servo(),
        StaticGain(),
        SERVO_QUESTION,
        lambda bound: LeastDamping(bound=bound),
        0.9,
        lambda p, c: float((-poles(p, c).real / np.abs(poles(p, c))).min()),
        1e-6,
    ),
    "frequency": (
        servo(),
        StaticGain(),
        SERVO_QUESTION,
        lambda bound: HighestFrequency(bound=bound),
        3.0,
        lambda p, c: float(np.abs(poles(p, c)).max()),
        1e-6,
    ),
    "weighted": (
        servo(),
        StaticGain(),
        SERVO_QUESTION,
        lambda bound: WeightedResponse(
            output="u_sent", disturbance="f", weight=lead(), bound=bound
        ),
        3.5,
        weighted_effort,
        1e-4,
    ),
    "roll_off": (
        two_carts(),
        LowOrder(2),
        CART_QUESTION,
        lambda bound: RollOff(bound=bound, above=5.0),
        0.05,
        lambda p, c: float(np.abs(loop_response(p, c)(np.geomspace(5.0, 500.0, 4000))).max()),
        1e-3,
    ),
    "low_frequency": (
        with_full_state(oscillator()),
        StaticGain(),
        {**MASS_QUESTION, "spectrum": {"f": White(1.0)}},
        lambda bound: LowFrequency(bound=bound, output="x", disturbance="f", below=0.5),
        0.1,
        lambda p, c: float(
            np.abs(
                [
                    closed_matrices(p, c)[2][0]
                    @ np.linalg.solve(
                        1j * w * np.eye(2) - closed_matrices(p, c)[0], closed_matrices(p, c)[1]
                    )
                    for w in np.linspace(1e-4, 0.5, 400)
                ]
            ).max()
        ),
        1e-3,
    ),
    "rms": (
        servo(),
        StaticGain(),
        SERVO_QUESTION,
        lambda bound: Rms(output="u_sent", bound=bound),
        2.48,
        lambda p, c: sigma(p, c, "u_sent"),
        1e-4,
    ),
    "continuous": (
        servo(),
        StaticGain(),
        SERVO_QUESTION,
        lambda bound: Continuous(output="m", static=-2.0, bound=bound),
        2.7,
        lambda p, c: float(np.hypot(2.0, sigma(p, c, "m"))),
        1e-4,
    ),
    "peak": (
        servo(),
        StaticGain(),
        SERVO_QUESTION,
        lambda bound: Peak(output="m", static=-2.0, bound=bound, duration=HOUR),
        9.0,
        lambda p, c: 2.0 + peak(p, c, "m", HOUR),
        1e-4,
    ),
    "least": (
        servo(),
        StaticGain(),
        SERVO_QUESTION,
        lambda bound: Minimum(output="m", static=10.0, bound=bound, duration=HOUR),
        2.9,
        lambda p, c: 10.0 - peak(p, c, "m", HOUR),
        1e-4,
    ),
    "power": (
        servo(),
        StaticGain(),
        SERVO_QUESTION,
        lambda bound: Power(torque="m", speed="x", static=2.0, bound=bound, duration=HOUR),
        8.0,
        lambda p, c: (2.0 + peak(p, c, "m", HOUR)) * peak(p, c, "x", HOUR),
        1e-4,
    ),
}


def again(kind: str, bound: float, found) -> float:
    """The best cost at another bound nearby, from the answer at this one."""
    plant, structure, question, make, *_ = BINDING[kind]
    near = [list(found.parameters.values())]
    question = {**question, "starts": 2, "guesses": near}
    other = tune(plant, structure, limits=[make(bound)], **question)
    assert other.ok, other.status
    return other.cost


@pytest.mark.parametrize("kind", list(BINDING))
def test_limit_binds_and_is_kept_and_is_dearer_when_tighter(kind: str) -> None:
    plant, structure, question, make, bound, measure, clear = BINDING[kind]
    free = tune(plant, structure, **question)
    limit = make(bound)
    found = tune(plant, structure, limits=[limit], **question)
    assert found.ok, found.status
    assert limit.name in found.status
    use = found.limits[limit.name]
    assert use.kept
    assert use.price > 0.0
    # kept by a measure that shares no code with the optimiser, and near the bound
    value = measure(plant, found.controller)
    assert value == pytest.approx(use.value, rel=2e-3)
    slack = (value / bound - 1.0) * (1.0 if limit.at_least else -1.0)
    assert -1e-4 < slack < clear
    tighter = again(kind, bound * (1.01 if limit.at_least else 0.99), found)
    assert free.cost < found.cost < tighter


@pytest.mark.parametrize("kind", list(BINDING))
def test_price_is_the_slope_of_the_best_cost(kind: str) -> None:
    plant, structure, question, make, bound, _, _ = BINDING[kind]
    limit = make(bound)
    found = tune(plant, structure, limits=[limit], **question)
    low, high = (again(kind, bound * factor, found) for factor in (0.998, 1.002))
    slope = (high - low) * (1.0 if limit.at_least else -1.0) / 0.4
    assert found.limits[limit.name].price == pytest.approx(slope, rel=0.03)


def test_limit_that_does_not_bind_changes_nothing_and_costs_nothing() -> None:
    limits = [MaxSensitivity(bound=5.0), Rms(output="effort", bound=100.0), GainMargin(bound=1.1)]
    free = tune(double_integrator(), LowOrder(2), **MASS_QUESTION)
    found = tune(double_integrator(), LowOrder(2), limits=limits, **MASS_QUESTION)
    assert found.cost == pytest.approx(free.cost, rel=1e-7)
    assert "no limit binds" in found.status
    for use in found.limits.values():
        assert use.kept
        assert use.use < 1.0
        assert use.price < 1e-6 * free.cost


@pytest.mark.ci
def test_limits_that_exclude_each_other_are_a_failure_that_names_them() -> None:
    # x'' = 1.5 x + ...: without a certain effort the mass cannot be held at all.
    limits = [Rms(output="u_sent", bound=0.5), MaxSensitivity(bound=2.0)]
    found = tune(servo(), StaticGain(), limits=limits, **SERVO_QUESTION)
    assert not found.ok
    assert "u_sent.rms" in found.status
    assert found.limits["u_sent.rms"].use > 1.0
    assert found.assessment.stable
    assert not found.limits["u_sent.rms"].kept


def test_several_limits_at_once_are_all_kept() -> None:
    limits = [
        MaxSensitivity(bound=1.6),
        RollOff(bound=0.15, above=20.0),
        Rms(output="effort", bound=0.9),
        DelayMargin(bound=0.3),
    ]
    found = tune(double_integrator(), LowOrder(3), limits=limits, **MASS_QUESTION)
    assert found.ok, found.status
    plant, controller = double_integrator(), found.controller
    assert sensitivity_peak(plant, controller) < 1.6 * (1.0 + 1e-4)
    assert sigma(plant, controller, "effort") < 0.9 * (1.0 + 1e-4)
    assert delay_reserve(plant, controller) > 0.3 * (1.0 - 1e-4)
    high = np.abs(loop_response(plant, controller)(np.geomspace(20.0, 2000.0, 3000)))
    assert high.max() < 0.15 * (1.0 + 1e-4)


@pytest.mark.ci
def test_margins_hold_for_every_loop_of_a_plant_with_two_inputs() -> None:
    plant = with_full_state(two_carts(2))
    # The regulator of a measured state has M_s = 1; a delay spoils it.
    late = dataclasses.replace(
        plant, delays=(0.15,) * 4, E=plant.B, disturbances=("f1", "f2"), Fz=None, F=None
    )
    question = {
        "spectrum": {"f1": White(1.0), "f2": White(1.0)},
        "minimise": {"x1": 1.0, "x2": 2.0, "effort1": 0.01, "effort2": 0.02},
        "starts": 4,
    }
    free = tune(late, StaticGain(), **question)
    bound = 0.5 * (1.0 + free.margins.max_sensitivity)
    found = tune(late, StaticGain(), limits=[MaxSensitivity(bound=bound)], **question)
    assert found.ok
    assert found.cost > free.cost
    grid = np.geomspace(0.01, 100.0, 3000)
    peaks = [
        np.abs(1.0 / (1.0 + loop_response(late, found.controller, i)(grid))).max() for i in (0, 1)
    ]
    assert max(peaks) == pytest.approx(bound, rel=1e-3)


# ------------------------------------------------------------ rows in detail


def rows(limit: Limit, loop_gains, omega=None, module_margin: float = 0.0) -> np.ndarray:
    """Largest row of each point of a Nyquist curve."""
    points = np.array(loop_gains, dtype=complex)
    omega = np.ones(points.size) if omega is None else np.broadcast_to(omega, points.shape)
    symbols = SimpleNamespace(
        differences=[1.0 + points],
        curves=lambda limit: [(np.array(omega, dtype=float), 1.0 + points)],
        on_axis=None,
        turning_delays=None,
        omega=np.array(omega, dtype=float),
        module_margin=module_margin,
    )
    with np.errstate(divide="ignore"):  # at -1 itself
        flat = np.ravel(limit.rows(symbols, limit.bound))
    return flat.reshape(-1, points.size).max(axis=0) if flat.size % points.size == 0 else flat


def test_sensitivity_forbids_a_disc() -> None:
    limit = MaxSensitivity(bound=2.0)
    assert np.all(rows(limit, [-1.0, -0.51, -1.0 + 0.49j, -1.49]) > 0.0)
    assert np.all(rows(limit, [-0.49, -1.0 + 0.51j, -1.51, 0.0, 1e6, 1e6j]) < 0.0)


def test_gain_margin_forbids_the_way_to_minus_one() -> None:
    limit = GainMargin(bound=4.0)
    assert np.all(rows(limit, [-0.2501, -0.5, -0.75, -0.999]) > 0.0)
    assert np.all(rows(limit, [-0.2499, 0.0, 0.5, -1.3, -7.0, -0.5 + 0.3j, 10.0j]) < 0.0)


def test_gain_margin_down_forbids_the_way_from_minus_one() -> None:
    limit = GainMarginDown(bound=0.25)
    assert np.all(rows(limit, [-3.999, -2.0, -1.5, -1.001]) > 0.0)
    assert np.all(rows(limit, [-4.001, -0.7, 0.0, -2.0 + 1.2j, -1e5, 10.0j]) < 0.0)


def test_delay_margin_forbids_the_arc_that_the_delay_carries_to_minus_one() -> None:
    for turn in (0.1, 0.8, 2.0, 3.5, 6.0):  # omega tau
        limit = DelayMargin(bound=turn)
        inside = np.exp(1j * (np.pi + turn * np.array([0.02, 0.3, 0.52, 0.98])))
        assert np.all(rows(limit, inside) > 0.0)
        # the band about the arc is 0.03 thick, or a quarter of what is short
        assert np.all(rows(limit, (1.03 + 0.2 * turn) * inside) < 0.0)
        if turn < 6.0:
            beyond = np.exp(1j * (np.pi + np.array([turn + 1e-3, -0.15 * turn])))
            assert np.all(rows(limit, beyond) < 0.0)
    # a longer delay than a whole turn forbids the whole circle
    circle = np.exp(1j * np.linspace(0.01, 6.2, 9))
    assert np.all(rows(DelayMargin(bound=10.0), circle) > 0.0)


@pytest.mark.parametrize(
    "limit", [GainMargin(bound=4.0), GainMarginDown(bound=0.25), DelayMargin(bound=1.0)]
)
def test_forbidden_set_has_no_hole_that_a_curve_slips_through_between_two_nodes(limit) -> None:
    share = np.linspace(0.02, 0.98, 2001)
    if isinstance(limit, DelayMargin):  # at omega = 1
        points = np.concatenate([r * np.exp(1j * (np.pi + share)) for r in (0.995, 1.005)])
    else:
        along = (1.0 / limit.bound) ** share
        points = np.concatenate([-along * (1.0 + 0.005j), -along * (1.0 - 0.005j)])
    assert rows(limit, points).min() > 0.0


def test_roll_off_looks_only_above_its_frequency() -> None:
    limit = RollOff(bound=0.1, above=5.0)
    assert rows(limit, [0.11j], 6.0)[0] > 0.0
    assert rows(limit, [0.09j], 6.0)[0] < 0.0
    assert rows(limit, [0.09j, 9.0], [6.0, 4.0]).max() < 0.0


def test_a_cases_roll_off_is_held_above_the_modes_that_its_masses_hold() -> None:
    case = load_case("subsea-crane").replace({"limits.roll_off": 0.4})
    data = PlantData.from_case(case)
    limits = [lim for lim in loop_limits(case, data, 5) if isinstance(lim, RollOff)]
    assert [(lim.bound, lim.above) for lim in limits] == [(0.4, modelled_bandwidth(data, 5))]
    without = case.replace({"limits.roll_off": None})
    assert not any(isinstance(lim, RollOff) for lim in loop_limits(without, data, 5))


def test_disk_margin_forbids_a_disc_about_what_is_beyond_minus_one() -> None:
    limit = DiskMargin(bound=1.0)  # gain from 1/3 to 3: from -3 to -1/3 on the axis
    assert np.all(rows(limit, [-2.99, -1.0 + 0.01j, -0.34]) > 0.0)
    assert np.all(rows(limit, [-3.01, -0.33, 0.0, 1.0, 1e6j, 1e6, -1.0 + 1.4j]) < 0.0)


def test_weight_may_be_a_callable_a_table_or_a_transfer_function() -> None:
    omega = np.geomspace(1e-2, 1e2, 400)
    exact = np.abs(1j * omega / (0.3j * omega + 1.0))
    for weight in (
        lambda w: 1j * w / (0.3j * w + 1.0),
        (omega, exact),
        scipy.signal.lti([1.0, 0.0], [0.3, 1.0]),
        scipy.signal.StateSpace([[-1.0 / 0.3]], [[1.0]], [[-1.0 / 0.09]], [[1.0 / 0.3]]),
        lead(),
        control.ss(lead()),
    ):
        limit = WeightedResponse(output="x", disturbance="f", weight=weight)
        assert limit.weights(omega) == pytest.approx(exact, rel=1e-9)
        assert limit.name == "x/f.weighted"
        assert limit.bound == 1.0
    table = WeightedResponse(output="x", disturbance="f", weight=([1.0, 100.0], [2.0, 200.0]))
    assert table.weights(np.array([0.5, 10.0, 101.0])) == pytest.approx([0.0, 20.0, 0.0])


def test_low_frequency_is_a_weight_of_one_up_to_its_end() -> None:
    question = {**MASS_QUESTION, "spectrum": {"f": White(1.0)}}
    plant = with_full_state(oscillator())
    old = LowFrequency(bound=0.1, output="x", disturbance="f", below=0.5)
    new = WeightedResponse(bound=0.1, output="x", disturbance="f", weight=([1e-6, 0.5], [1.0, 1.0]))
    found = [tune(plant, StaticGain(), limits=[limit], **question) for limit in (old, new)]
    assert all(f.ok for f in found)
    assert found[0].cost == pytest.approx(found[1].cost, rel=1e-7)


def test_weighted_limit_may_be_on_a_disturbance_without_a_spectrum() -> None:
    # From the place's noise to the command, of which the spectrum says nothing.
    question = {"spectrum": {"f": White(1.0)}, "minimise": {"x": 1.0, "effort": 0.05}, "starts": 3}
    law = StaticGain(bounds={"K[u,y]": (-30.0, 30.0)})
    plant = oscillator(damping=2.0)
    free = tune(plant, law, **question)
    limit = WeightedResponse(output="effort", disturbance="n", weight=lambda w: 1.0 + 0.0 * w)
    use = limit.measure(free.assessment)
    found = tune(plant, law, limits=[dataclasses.replace(limit, bound=0.9 * use)], **question)
    assert found.ok, found.status
    A, E, C, F = closed_matrices(plant, found.controller)
    peak_gain = largest_gain(control.ss(A, E[:, [1]], C[[1]], F[[1]][:, [1]]))
    assert peak_gain == pytest.approx(0.9 * use, rel=1e-4)
    assert found.verify().ok


def test_peak_between_the_nodes_is_followed_and_held() -> None:
    # A narrow weight about one frequency, which no grid knows of, at the loop's own peak.
    def notch(omega):
        return 1.0 / np.abs(1.0 + 1j * 400.0 * (omega / 2.0 - 2.0 / omega))

    limit = WeightedResponse(output="u_sent", disturbance="f", weight=notch)
    free = tune(servo(), StaticGain(), **SERVO_QUESTION)
    grid = np.linspace(1.9, 2.1, 40001)
    A, E, C, _ = closed_matrices(servo(), free.controller)
    exact = max(
        abs(C[3] @ np.linalg.solve(1j * w * np.eye(3) - A, E[:, 0])) * notch(w) for w in grid[::20]
    )
    with_edge = dataclasses.replace(limit, weight=_Edged(notch))
    assert with_edge.measure(free.assessment) == pytest.approx(exact, rel=1e-6)


class _Edged:
    """A weight that says where it is lively, as a transfer function does by its poles."""

    poles = (2.0,)

    def __init__(self, function) -> None:
        self.function = function

    def __call__(self, omega):
        return self.function(omega)


@pytest.mark.parametrize(
    ("limits", "double"),
    [
        ([LeastDamping(bound=1.0)], None),
        ([LeastDecay(bound=3.0), HighestFrequency(bound=3.05)], 3.0),
        ([LeastDecay(bound=2.5), LeastDamping(bound=1.0)], 2.5),
        ([HighestFrequency(bound=1.0)], 1.0),
    ],
    ids=["damping", "decay and frequency", "decay and damping", "frequency"],
)
def test_double_pole_at_the_optimum_does_not_break_the_search(limits, double) -> None:
    # x'' = u + f, u = -k x - c v: the regulator's poles are -1.495 +- 1.495i; these limits make
    # them one double pole, s = -p, which moves infinitely fast with k.
    plant = with_full_state(double_integrator())
    question = {"spectrum": {"f": White(1.0)}, "minimise": {"x": 1.0, "effort": 0.05}}
    found = tune(plant, StaticGain(), limits=limits, starts=4, **question)
    assert found.ok, found.status

    def cost(p: float) -> float:
        controller = LinearController.static([[-(p**2), -2.0 * p]], plant.measurements, ("u",))
        noise = {"f": White(1.0)}
        variances = lyapunov_variances(plant, controller, noise)
        return float(np.sqrt(variances["x"] + 0.05 * variances["effort"]))

    if double is None:
        double = scipy.optimize.minimize_scalar(cost, bounds=(0.3, 10.0), method="bounded").x
    assert found.cost == pytest.approx(cost(double), rel=1e-4)
    assert found.assessment.poles == pytest.approx([-double, -double], rel=2e-3)


def test_use_is_one_at_the_bound_and_grows_beyond_it() -> None:
    cases: list[tuple[Limit, float, float]] = [
        (MaxSensitivity(bound=2.0), 2.0, 2.2),
        (GainMargin(bound=2.0), 2.0, 1.8),
        (GainMarginDown(bound=0.5), 0.5, 0.6),
        (DelayMargin(bound=0.1), 0.1, 0.05),
        (RollOff(bound=0.2, above=1.0), 0.2, 0.3),
        (DiskMargin(bound=0.7), 0.7, 0.6),
        (LeastDecay(bound=0.2), 0.2, 0.1),
        (LeastDamping(bound=0.5), 0.5, 0.3),
        (HighestFrequency(bound=20.0), 20.0, 30.0),
        (Rms(output="x", bound=3.0), 3.0, 4.0),
        (Peak(output="x", bound=3.0), 3.0, 4.0),
        (Continuous(output="x", bound=3.0), 3.0, 4.0),
        (Minimum(output="x", static=10.0, bound=2.0), 2.0, 1.0),
    ]
    for limit, at, beyond in cases:
        assert limit.use(at) == pytest.approx(1.0)
        assert limit.use(beyond) > 1.0
        assert limit.use(at + 0.5 * (at - beyond)) < 1.0
    assert GainMargin(bound=2.0).use(np.inf) == 0.0
    assert GainMargin(bound=2.0).use(0.0) == np.inf
    assert Minimum(output="x", static=1.0, bound=2.0).use(0.5) == np.inf


def test_least_and_peak_are_mirror_images() -> None:
    plant, controller = (
        servo(),
        LinearController.static([[-8.0, -5.0, -1.0]], ("x", "v", "m"), ("u",)),
    )
    view = Assessment(plant, controller, disturbances({"f": White(1.0)}, ("f",)))
    up = Peak(output="m", static=3.0, bound=1.0, duration=HOUR).measure(view)
    down = Minimum(output="m", static=3.0, bound=1.0, duration=HOUR).measure(view)
    assert up - 3.0 == pytest.approx(3.0 - down, rel=1e-12)
    assert up - 3.0 == pytest.approx(peak(plant, controller, "m", HOUR), rel=1e-6)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: MaxSensitivity(bound=1.0), "MaxSensitivity: bound must be above 1, got 1.0"),
        (lambda: MaxSensitivity(bound=np.nan), "MaxSensitivity: bound must be above 1, got nan"),
        (lambda: GainMargin(bound=0.5), "GainMargin: bound must be above 1, got 0.5"),
        (lambda: GainMarginDown(bound=1.0), r"GainMarginDown: bound must be in \[0, 1\), got 1.0"),
        (lambda: DelayMargin(bound=0.0), "DelayMargin: bound must be above 0 s, got 0.0"),
        (lambda: DiskMargin(bound=2.0), r"DiskMargin: bound must be in \(0, 2\), got 2.0"),
        (lambda: LeastDecay(bound=0.0), "LeastDecay: bound must be above 0 1/s, got 0.0"),
        (lambda: LeastDamping(bound=1.1), r"LeastDamping: bound must be in \(0, 1\], got 1.1"),
        (lambda: HighestFrequency(bound=-1.0), "HighestFrequency: bound must be above 0 rad/s"),
        (
            lambda: WeightedResponse(output="x", disturbance="f", weight=([1.0, 2.0], [0.0, 1.0])),
            "WeightedResponse: weight must be a callable, a transfer function or a table",
        ),
        (
            lambda: WeightedResponse(
                output="x", disturbance="f", weight=scipy.signal.dlti([1.0], [1.0, 0.5])
            ),
            "WeightedResponse: weight must be continuous in time, got a sampled one",
        ),
        (lambda: Rms(output="x", bound=-1.0), "Rms: bound must be above 0, got -1.0"),
        (
            lambda: Peak(output="x", bound=1.0, duration=0.0),
            "Peak: duration must be above 0 s, got 0.0",
        ),
    ],
)
def test_bounds_out_of_range_are_refused(make, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()


class _Known:
    """A Gaussian torque and speed, as limits see them."""

    def __init__(self, torque: float, speed: float, correlation: float = 0.0) -> None:
        self.sizes = {"motor.torque": torque, "motor.speed": speed}
        self.correlation = correlation

    def covariance(self, one: str, other: str) -> float:
        return self.correlation * self.sizes[one] * self.sizes[other]

    def sigma(self, output: str) -> float:
        return self.sizes[output]

    def peak(self, output: str, duration: float) -> float:
        return 3.7 * self.sizes[output]

    def moment(self, output: str, order: int) -> np.ndarray:
        assert order == 0
        return np.array([self.sizes[output] ** 2])


@pytest.mark.parametrize("correlation", [0.0, 0.6, -0.6, 1.0])
@pytest.mark.parametrize("speed", [20.0, 80.0, 130.0])
def test_thermal_rule_is_the_mean_heat_of_a_motor_that_cools_less_above_base_speed(
    speed: float, correlation: float
) -> None:
    mean, torque, base, rating = 600.0, 500.0, 100.0, 1000.0
    limit = Thermal(output="motor.torque", bound=rating, static=mean, base_speed=base)
    known = _Known(torque, speed, correlation)
    value = limit.measure(known)  # type: ignore[arg-type]
    rng = np.random.default_rng(7)
    u, other = rng.standard_normal((2, 4_000_000))
    moved = correlation * u + math.sqrt(1.0 - correlation**2) * other
    held = rating * np.minimum(1.0, base / np.maximum(np.abs(speed * u), 1e-9))
    heat = float(np.mean(((mean + torque * moved) / held) ** 2))
    assert (value / rating) ** 2 == pytest.approx(heat, rel=4e-3)
    row = limit.rows(known, rating)  # type: ignore[arg-type]
    assert row[0] == pytest.approx((value / rating) ** 2 - 1.0, rel=1e-12)
    demand = limit_demand(limit)
    moments = {"motor.torque": (torque**2,), "motor.speed": (speed**2,)}
    moments[demand.together] = (correlation,)
    found = demand.measured(None, None, None, moments)  # type: ignore[arg-type]
    assert found == pytest.approx(value, rel=1e-6)


def test_thermal_rule_is_the_plain_one_where_the_speed_stays_below_the_base_speed() -> None:
    plain = Continuous(output="motor.torque", bound=1000.0, static=600.0)
    limit = Thermal(output="motor.torque", bound=1000.0, static=600.0, base_speed=100.0)
    slow = _Known(500.0, 12.0)
    assert limit.measure(slow) == pytest.approx(plain.measure(slow), rel=1e-12)
    still = _Known(500.0, 0.0)
    assert limit.measure(still) == pytest.approx(plain.measure(still), rel=1e-15)


@pytest.mark.parametrize("size", [0.0, 0.05, 0.4, 1.0, 3.0])
def test_slopes_of_the_thermal_rule_are_those_of_its_values(size: float) -> None:
    limit = Thermal(output="motor.torque", bound=1000.0, static=600.0, base_speed=100.0)

    class Moving:
        def __init__(self, share: object) -> None:
            self.share = share

        def covariance(self, one: str, other: str) -> object:
            return self.share * 1e4  # torque and speed grow with the share, the first by its root

        def moment(self, output: str, order: int) -> object:
            return self.share * 1e4 if output == "motor.speed" else np.array([250e3])  # type: ignore[operator]

    def row(share: float) -> float:
        return float(limit.rows(Moving(np.array([share])), 1000.0)[0])  # type: ignore[arg-type]

    dual = limit.rows(Moving(Dual(np.array([size]), np.ones((1, 1)))), 1000.0)  # type: ignore[arg-type]
    step = 1e-6
    low = max(size - step, 0.0)
    expected = (row(size + step) - row(low)) / (size + step - low)
    assert dual.value[0] == pytest.approx(row(size), rel=1e-15)
    assert dual.slope[0, 0] == pytest.approx(expected, rel=1e-4, abs=1e-9)


def test_breakdown_torque_is_held_at_the_corner_of_the_box() -> None:
    limit = Breakdown(
        bound=2500.0,
        torque="motor.torque",
        speed="motor.speed",
        static=-600.0,
        base_speed=100.0,
        unit="N m",
    )
    loop = _Known(100.0, 50.0)
    # 970 N m at 185 rad/s, where 2500 (100/185)^2 = 730 N m are left
    expected = 970.0 * 1.85**2
    assert limit.measure(loop) == pytest.approx(expected, rel=1e-12)  # type: ignore[arg-type]
    moments = {"motor.torque": (1e4, 1e4), "motor.speed": (2500.0, 2500.0)}
    found = limit_demand(limit).measured(None, None, None, moments)  # type: ignore[arg-type]
    period = 2.0 * math.pi
    k = peak_factor(period, limit.duration)
    assert found == pytest.approx((600.0 + 100.0 * k) * (0.5 * k) ** 2, rel=1e-12)
