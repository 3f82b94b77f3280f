"""The two ways of each comparison in `docs/make/validation_checks.py`, as functions.

Each returns both values, or the largest difference of many.
"""

from __future__ import annotations

import importlib
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import casadi as ca
import holds
import holds_page
import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import gamma, gammaincc
from stored import DOCS, ROOT, read_rows

import mpc
from models import HookMotion, LinearPlant, PlantData, build_plant, load_case
from models.basics import peak_factor, share, solve_riccati, spectral_nodes
from models.basics.metrics import moments
from models.plant import fixed_top_modes, lump_rope, lumped_modes, stochastic_equivalent
from models.sea import SeaSpectrum
from models.simulation.integrate import hermite_midpoint, rk4_step
from models.spread import Spread, Uniform
from models.vessel.hull import box_hull
from models.vessel.hull.hydrostatics import Waterplane
from models.vessel.readers import check_long_waves, read_raos
from mpc.programme import prediction_covariance
from synth import LowOrder, MaxSensitivity, StaticGain, White, closed_loop_poles, tune
from synth.bound.bound import lqg_bound
from synth.loop import Assessment, LinearController, loop_margins
from synth.question import pose
from synth.sensitivity.global_indices import indices_of

FloatArray = npt.NDArray[np.float64]
Pair = tuple[float, float]

_PAYLOAD, _HOOK = "payload.displacement", "hook.heave"


def _module(folder: str, name: str) -> Any:
    """Return a module of a folder of the repository."""
    path = str(ROOT / folder)
    if path not in sys.path:
        sys.path.append(path)
    return importlib.import_module(name)


# The thesis of 1975 -------------------------------------------------------------------------------


@cache
def thesis() -> tuple[Any, Any, Assessment, HookMotion, Any]:
    """Return case, question, loop with the thesis's gains, hook, and the printed tables."""
    case = load_case("thesis-1975")
    question = pose(case)
    gains = _module("tests/support", "plant_numbers").THESIS_GAINS
    tables = _module("notebooks", "thesis_tables")
    return case, question, question.assess(gains), HookMotion.from_case(case), tables


def _closed_forms(omega: FloatArray, *, gains: bool) -> Mapping[str, npt.NDArray[np.complex128]]:
    case, *_ = thesis()
    numbers = _module("tests/support", "plant_numbers")
    own = numbers.thesis_numbers(PlantData.from_case(case), case.payload.fixed_drag)
    found: Mapping[str, npt.NDArray[np.complex128]] = numbers.thesis_transfer(
        omega, **own, **(numbers.THESIS_GAINS if gains else {})
    )
    return found


def spectrum_of_table_5() -> float:
    _, _, _, hook, tables = thesis()
    nu = tables.SHAPE[:17, 0]
    ours = 8.0 * hook.sea.density(2.0 * math.pi * nu / 7.29)
    right = ~np.isin(nu, [0.55, 0.65, 0.75])  # three rows of the print are slips
    return float(np.abs(ours / tables.HEAVE[1:, 2] - 1.0)[right].max())


def table_7() -> float:
    _, _, loop, _, tables = thesis()
    omega, printed = tables.PAYLOAD_RATIO.T
    return float(np.abs(np.abs(loop.response(_PAYLOAD, _HOOK, omega)) / printed - 1.0).max())


def table_8() -> float:
    *_, tables = thesis()
    omega, printed, _, _ = tables.BEFORE.T
    ours = np.abs(_closed_forms(omega, gains=False)["G"]) ** 2
    steady = ~np.isin(omega, [0.86, 1.03])  # beside the resonance a hair of frequency is 10 %
    return float(np.abs(ours / printed - 1.0)[steady].max())


def table_9() -> float:
    _, _, loop, _, tables = thesis()
    omega, printed, _, _ = tables.AFTER.T
    ours = 1e4 * np.abs(loop.response(_PAYLOAD, _HOOK, omega)) ** 2
    return float(np.abs(ours / printed - 1.0)[omega > 0.43].max())  # below, one digit is printed


def equation_32() -> float:
    _, _, loop, _, _ = thesis()
    omega = np.geomspace(0.01, 50.0, 200)
    ours, theirs = loop.response(_PAYLOAD, _HOOK, omega), _closed_forms(omega, gains=True)["T"]
    return float(np.abs(ours / theirs - 1.0).max())


def growth_on_a_rope() -> Pair:
    numbers = _module("tests/support", "plant_numbers")
    data = replace(numbers.THESIS, masses=20, lumping="thesis")
    law = LinearController.static(
        [[-1e4, -2e4, -2e4]],
        ("payload.acceleration", "payload.velocity", "payload.displacement"),
        ("drive.command",),
    )
    plant = build_plant(data).linearise(drag=thesis()[0].payload.fixed_drag)
    return float(closed_loop_poles(plant, law).real.max()), 4.6


# Closed forms -------------------------------------------------------------------------------------


def rope_modes() -> float:
    """Return how far eight modes of four ropes are from nu tan nu = m L / M, by bisection."""
    off = 0.0
    for ea, length, line, load in (
        (1.6e8, 2000.0, 8.1, 73_688.0),
        (2.4e8, 1000.0, 13.2, 1e5),
        (1e8, 6000.0, 40.0, 5e3),
        (1e9, 50.0, 20.0, 4e5),
    ):
        share_of_rope = line * length / load
        found = fixed_top_modes(ea, length, line, load, 8) * length / math.sqrt(ea / line)
        for j, nu in enumerate(found.tolist()):
            exact = brentq(
                lambda x, e=share_of_rope: x * math.sin(x) - e * math.cos(x),
                j * math.pi,
                (j + 0.5) * math.pi,
                xtol=1e-15,
            )
            off = max(off, abs(nu / exact - 1.0))
    return off


def wire_ropes() -> float:
    off = 0.0
    for load, d, length, period in (
        (14e3, 0.030, 1000.0, 2.66),
        (100e3, 0.050, 1000.0, 4.12),
        (100e3, 0.050, 3000.0, 7.44),
        (400e3, 0.088, 2000.0, 6.70),
        (600e3, 0.100, 100.0, 1.56),
    ):
        first = fixed_top_modes(97.1e9 * d**2, length, 5293.0 * d**2, load, 1)[0]
        off = max(off, abs(2.0 * math.pi / first - period))
    return off


def lumped_rope() -> Pair:
    """Return by how much twice the masses lower the error of the second mode."""
    rope = (1.6e8, 2000.0, 8.1, 73_688.0)
    exact = fixed_top_modes(*rope, 2)[1]
    coarse, fine = (
        abs(float(lumped_modes(lump_rope(masses), *rope)[1] - exact)) for masses in (20, 40)
    )
    return coarse / fine, (39.5 / 19.5) ** 2


def bretschneider() -> float:
    height, period = 3.0, 9.0
    sea = SeaSpectrum(kind="bretschneider", significant_height=height, peak_period=period)
    peak, s = 2.0 * math.pi / period, sea.statistics
    a, b = 5.0 / 16.0 * height**2 * peak**4, 1.25 * peak**4
    off = 0.0
    for n, found in ((0, s.m0), (1, s.m1), (2, s.m2)):
        order = 1.0 - n / 4.0
        tail = gammaincc(order, b / sea.band[1] ** 4) * gamma(order)
        off = max(off, abs(found / (a / 4.0 * b ** (n / 4.0 - 1.0) * tail) - 1.0))
    return off


def jonswap() -> float:
    height, peak, off = 4.0, 2.0 * math.pi / 10.0, 0.0
    omega = np.linspace(0.3, 6.0, 400)
    for peakedness in (1.0, 2.0, 3.3, 5.0):
        sea = SeaSpectrum(
            kind="jonswap", significant_height=height, peak_period=10.0, gamma=peakedness
        )
        pm = 0.3125 * height**2 * peak**4 * omega**-5 * np.exp(-1.25 * (peak / omega) ** 4)
        sigma = np.where(omega <= peak, 0.07, 0.09)
        hump = np.exp(-0.5 * ((omega - peak) / (sigma * peak)) ** 2)
        standard = (1.0 - 0.287 * math.log(peakedness)) * pm * peakedness**hump
        off = max(off, float(np.abs(sea.density(omega) / standard - 1.0).max()))
    return off


def jonswap_height() -> Pair:
    sea = SeaSpectrum(kind="jonswap", significant_height=4.0, peak_period=10.0, gamma=3.3)
    return float(sea.statistics.significant_height), 4.0


def flat_band() -> float:
    q, low, high = spectral_nodes(0.3, 2.9), 0.3, 2.9
    found = moments(q, np.full(len(q), 2.0))
    exact = [2.0 * (high ** (n + 1) - low ** (n + 1)) / (n + 1) for n in (0, 1, 2, 4)]
    return float(np.abs(np.array(found) / exact - 1.0).max())


def largest_of_a_time() -> Pair:
    k = peak_factor(8.0, 10_800.0)
    return 1350.0 * math.exp(-0.5 * k**2), 1.0


def _loop(num: Sequence[float], den: Sequence[float], delay: float = 0.0) -> Any:
    grid = np.geomspace(1e-4, 1e4, 1500)

    def gain(omega: FloatArray) -> npt.NDArray[np.complex128]:
        s = 1j * omega
        return np.asarray(np.polyval(num, s) / np.polyval(den, s) * np.exp(-s * delay))

    return loop_margins(gain, grid, gain(grid))


def third_order_lag() -> float:
    m, crossover = _loop([4.0], [1.0, 3.0, 3.0, 1.0]), math.sqrt(4.0 ** (2.0 / 3.0) - 1.0)
    phase = math.pi - 3.0 * math.atan(crossover)
    return max(
        abs(m.gain / 2.0 - 1.0), abs(m.phase / phase - 1.0), abs(m.delay * crossover / phase - 1.0)
    )


def late_integrator() -> float:
    k, late = 2.0, 0.3
    m = _loop([k], [1.0, 0.0], late)
    return max(
        abs(m.gain * 2.0 * k * late / math.pi - 1.0),
        abs(m.delay / (math.pi / (2.0 * k) - late) - 1.0),
    )


def drag() -> Pair:
    v = 0.4 * np.random.default_rng(1975).standard_normal(1_000_000)
    return stochastic_equivalent(100.0, 0.4), float(np.mean(100.0 * np.abs(v) * v**2)) / 0.16


def regulator() -> float:
    """Return how far the double integrator's gains are from 1/sqrt(rho), sqrt(2)/rho^(1/4)."""
    rho = 0.1
    found = solve_riccati(
        np.array([[0.0, 1.0], [0.0, 0.0]]),
        np.array([[0.0], [1.0]]),
        np.diag([1.0, 0.0]),
        np.array([[rho]]),
        np.zeros((2, 1)),
    )
    exact = -np.array([rho**-0.5, math.sqrt(2.0) * rho**-0.25])
    return float(np.abs(found.gain[0] / exact - 1.0).max())


def random_walk() -> Pair:
    one = np.ones((1, 1))
    P = prediction_covariance(one, one, one, np.ones(1), np.ones(1))
    return float(P[0, 0]), 0.5 * (1.0 + math.sqrt(5.0))


def dottie() -> Pair:
    late = 0.3
    plant = LinearPlant(
        A=[[0.0]], B=[[1.0]], E=[[1.0]], C=[[1.0]], Cz=[[1.0]], inputs=("u",),
        measurements=("y",), disturbances=("w",), outputs=("x",), delays=(late,),
    )  # fmt: skip
    found = tune(
        plant, StaticGain(), spectrum={"w": White(1.0)}, minimise={"x": 1.0}, starts=4
    ).controller
    assert found is not None
    return -float(found.D[0, 0]) * late, float(brentq(lambda u: math.cos(u) - u, 0.0, 1.0))


def ishigami() -> float:
    a, b = 7.0, 0.1
    one = 0.5 * (1.0 + b * math.pi**4 / 5.0) ** 2
    two, both = a**2 / 8.0, b**2 * math.pi**8 * (1.0 / 18.0 - 1.0 / 50.0)
    ranges = Spread({name: Uniform(-math.pi, math.pi) for name in ("x1", "x2", "x3")})

    def function(rows: FloatArray) -> FloatArray:
        x, y, z = rows.T
        return np.asarray(np.sin(x) + a * np.sin(y) ** 2 + b * z**4 * np.sin(x))

    found = indices_of(function, ranges, samples=4096, seed=1, resamples=9)
    whole = one + two + both
    exact = np.array([one, two, 0.0]) / whole
    total = np.array([one + both, two, both]) / whole
    off = np.abs(np.concatenate([found.first - exact, found.total - total]))
    return float(off.max())


def clopper_pearson() -> float:
    # No failure in n trials: the upper end is 1 - (alpha/2)^(1/n).
    return max(abs(share(0, n).high / (1.0 - 0.025 ** (1.0 / n)) - 1.0) for n in (25, 200, 1000))


# Published problems of synthesis ------------------------------------------------------------------


def published() -> Any:
    return _module("tests/support", "published_problems")


@cache
def pi(name: str) -> Pair:
    """Return gain and integral time of the best PI controller."""
    p = published().PI_DESIGNS[name]
    found = tune(
        p.plant,
        StaticGain(),
        spectrum={"load": p.slow},
        minimise={"y": 1.0},
        limits=[MaxSensitivity(bound=p.max_sensitivity)],
        starts=6,
    )
    if not found.ok or found.controller is None:
        raise ValueError(found.status)
    gain, integral = (-float(k) for k in found.controller.D[0])
    return gain, gain / integral


def _white_cost(
    plant: LinearPlant, minimise: Mapping[str, float], noise: Mapping[str, float]
) -> float:
    found = tune(
        plant,
        LowOrder(len(plant.states)),
        spectrum={name: White(value) for name, value in noise.items()},
        minimise=minimise,
        starts=4,
    )
    if not found.ok:
        raise ValueError(found.status)
    return found.cost


def lqg(name: str) -> Pair:
    p = getattr(published(), name)()
    A, B, C, D = p.controller
    law = LinearController(
        A=A, B=B, C=C, D=D, measurements=p.plant.measurements, inputs=p.plant.inputs
    )
    noise = {k: White(v) for k, v in p.noise.items()}
    cost = _module("tests/support", "loop_numbers").lyapunov_cost(p.plant, law, noise, p.minimise)
    return _white_cost(p.plant, p.minimise, p.noise), float(cost)


def servo_gains() -> float:
    p = published().position_servo()
    found = solve_riccati(
        p.plant.A, p.plant.B, np.diag([1.0, 0.0]), np.array([[2e-5]]), np.zeros((2, 1))
    )
    seen = solve_riccati(
        p.plant.A.T, p.plant.C.T, np.diag([0.0, 0.1]), np.array([[1e-7]]), np.zeros((2, 1))
    )
    off = np.concatenate([-found.gain[0] / p.F - 1.0, -seen.gain[0] / p.K - 1.0])
    return float(np.abs(off).max())


def h2(which: str) -> Pair:
    p = published()
    plant, minimise, optimum = p.h2_example() if which == "zhou" else p.scherer(which)
    return _white_cost(plant, minimise, dict.fromkeys(plant.disturbances, 1.0)), optimum


def h2_bound() -> Pair:
    plant, minimise, optimum = published().h2_example()
    white = {name: White(1.0) for name in plant.disturbances}
    return float(lqg_bound(plant, white, minimise).value), optimum


# Published problems of predictive control ---------------------------------------------------------

#: The optimum from the source's own initial state, by CVXPY and Clarabel.
OPTIMA: Mapping[str, float] = {
    "mass chain": 24.223509666843,
    "oscillating masses": 57.944607046460,
    "quadcopter": 28.033028041590,
}


def mpc_cost(name: str) -> Pair:
    p = published().PROBLEMS[name]()
    outputs = [signal for signal in p.costs if signal.startswith("x")]
    programme = mpc.Programme(
        p.plant,
        period=p.period,
        horizon=p.steps * p.period,
        costs=p.costs,
        constraints=[
            mpc.Constraint(signal=signal, low=low, high=high, samples=at)
            for signal, low, high, at in p.limits
        ],
        references=[*outputs, *(signal for signal in p.costs if signal.startswith("u"))],
        terminal=p.terminal,
    )
    aims = {f"x{i}": float(r) for i, r in enumerate(p.xr) if f"x{i}" in p.costs}
    return programme.solve(p.x0, references=aims).cost, OPTIMA[name]


# Vessels, the time domain, designs in simulation --------------------------------------------------


def long_waves() -> Pair:
    raos = read_raos("osv-83m")
    return float(abs(raos.response(raos.omega[0], math.pi)[2])), 1.0


def long_wave_error() -> Pair:
    return float(check_long_waves(read_raos("osv-83m")).error), 0.0


def box() -> float:
    L, B, T = 100.0, 30.0, 4.0
    found = Waterplane.of(box_hull(L, B, T, panels=200))
    ours = np.array([found.volume, found.area, *found.metacentric_radii])
    exact = np.array([L * B * T, L * B, B**2 / 12.0 / T, L**2 / 12.0 / T])
    return float(np.abs(ours / exact - 1.0).max())


def against_scipy() -> float:
    """Return how far a minute of the nonlinear plant is from SciPy's DOP853, any state."""
    plant = build_plant(load_case("thesis-1975"))
    rest, h, duration = plant.operating_point(), 0.01, 60.0
    start = np.array(rest.x)

    def sine(t: FloatArray) -> FloatArray:
        z, w = 0.5, 0.7
        return np.array([z * np.sin(w * t), z * w * np.cos(w * t), -z * w**2 * np.sin(w * t)])

    x, row = ca.SX.sym("x", len(plant.states)), ca.SX.sym("row", 6)
    z0, v0, a0, z1, v1, a1 = ca.vertsplit(row)

    def rate(state: ca.SX, motions: Sequence[tuple[ca.SX, ca.SX]]) -> ca.SX:
        (z, v) = motions[0]
        return plant.function(state, rest.command, ca.vertcat(z, v, 0, 0), rest.p)[0]

    middle = hermite_midpoint(z0, v0, a0, z1, v1, a1, h)
    after = rk4_step(rate, x, [(z0, v0)], [middle], [(z1, v1)], h)
    n = round(duration / h)
    motion = sine(np.arange(n + 1) * h)
    run = ca.Function("step", [x, row], [after]).mapaccum("run", n)
    ours = np.asarray(run(start, np.vstack([motion[:, :-1], motion[:, 1:]])))[:, -1]

    def slope(t: float, state: FloatArray) -> FloatArray:
        z, v, _ = sine(np.array(t))
        w = np.array([z, v, 0.0, 0.0])
        return np.asarray(plant.function(state, rest.command, w, rest.p)[0]).ravel()

    theirs = solve_ivp(slope, (0.0, duration), start, method="DOP853", rtol=1e-11, atol=1e-12)
    return float(np.abs(ours - theirs.y[:, -1]).max())


@cache
def held() -> list[dict[str, str]]:
    """Return the designs that were simulated."""
    return holds_page.simulated(read_rows(holds.CSV))


def count_of_held(broken: Callable[[dict[str, str]], bool]) -> Pair:
    """Return how many of the designs that were simulated break something, and none."""
    return float(sum(broken(row) for row in held())), 0.0


def off(row: dict[str, str]) -> bool:
    """Return whether a standard deviation is further off than is asked."""
    return any(abs(off) > may for off, may in holds_page.deviations(row).values())


def grows(row: dict[str, str]) -> bool:
    """Return whether a design grows at the least damping of its rope."""
    return holds_page.grows(row)


def far(row: dict[str, str]) -> bool:
    """Return whether a dynamic part of an extreme is far above the printed one."""
    return any(max(one.ratios) > holds_page.FARTHEST for one in holds_page.extremes(row))


def by_chance() -> float:
    """Return how many dynamic parts would be as far above by chance alone."""
    return holds_page.far_by_chance(held())


def slack(row: dict[str, str]) -> bool:
    """Return whether the rope goes slack."""
    return float(row["slack"]) > 0.0


def payload_deviation(level: float) -> float:
    """Return by how much the payload's rms is off at most, in such a share of the designs."""
    off_by = [abs(holds_page.deviations(row)["payload"][0]) for row in held()]
    return float(np.quantile(off_by, level))


def kinds() -> list[str]:
    """Return the kinds of extremes that were counted."""
    return [one.name for one in holds_page.kinds(held())]


def exceeded(kind: str) -> Pair:
    (found,) = (one for one in holds_page.kinds(held()) if one.name == kind)
    return found.share, 1.0 - math.exp(-1.0)


def random_starts() -> Pair:
    rows = [r for r in read_rows(DOCS / "data" / "random_starts.csv") if r["accepted"] == "yes"]
    return float(sum(int(row["unstable"]) > 0 for row in rows)), 0.0
