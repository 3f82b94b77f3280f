"""Bounds against textbooks, against semidefinite programmes, and below everything tried."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cvxpy
import numpy as np
import numpy.typing as npt
import pytest
from bound_check import verify_bound, weighted_rms
from former_cases import load_case
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from models.basics import InputError, SynthesisError, White
from models.plant import LinearPlant
from models.sea import SeaSpectrum
from models.sensing import MEASURED
from synth.bound import Bound, bound_for
from synth.bound.bound import lqg_bound
from synth.bound.case import rms_limits
from synth.bound.dual import Dual
from synth.design import evaluate_gains, tune
from synth.limits import Continuous, Minimum, Peak, Power, Rms
from synth.loop import LinearController
from synth.structures import StaticGain, reduced, shaped

FloatArray = npt.NDArray[np.float64]
cp: Any = cvxpy  # its signatures are not typed
SEA = SeaSpectrum(kind="jonswap", significant_height=2.0, peak_period=9.0)


def zhou() -> LinearPlant:
    """Zhou and Doyle, Essentials of Robust Control, H2 example, as in RobustAndOptimalControl.jl.

    Its published optimum is 8.9582.
    """
    return LinearPlant(
        A=[[-1.0, 0.0, 4.0], [0.0, 2.0, 0.0], [0.0, 0.0, -3.0]],
        B=np.ones((3, 1)),
        E=[[0.0, 0.0], [1.0, 0.0], [0.0, 0.0]],
        C=np.ones((1, 3)),
        F=[[0.0, 1.0]],
        Cz=[[0.0, 1.0, 0.0], [0.0, 0.0, 0.0]],
        Dz=[[0.0], [1.0]],
        disturbances=("w", "n"),
        outputs=("z", "u"),
        inputs=("command",),
    )


def scherer(outputs: list[list[float]]) -> LinearPlant:
    """Scherer, Gahinet and Chilali (IEEE TAC 42, 1997), example 7, outputs [x1 x2 x3 u]."""
    rows = np.array(outputs)
    return LinearPlant(
        A=[[0.0, 10.0, 2.0], [-1.0, 1.0, 0.0], [0.0, 2.0, -5.0]],
        B=[[0.0], [1.0], [0.0]],
        E=[[1.0], [0.0], [1.0]],
        C=[[0.0, 1.0, 0.0]],
        F=[[2.0]],
        Cz=rows[:, :3],
        Dz=rows[:, 3:],
    )


def spring(**options: object) -> LinearPlant:
    """A payload on a spring below a drum that follows its speed command with a lag.

    States: payload's place and speed, drum's place and speed; the hook moves the top.
    """
    k, c, lag = 0.9, 0.05, 3.0
    return LinearPlant(
        A=[
            [0.0, 1.0, 0.0, 0.0],
            [-k, -c, k, 0.0],
            [0.0, 0.0, 0.0, 1.0],
            [0.0, 0.0, 0.0, -lag],
        ],
        B=[[0.0], [0.0], [0.0], [lag]],
        E=np.array([[0, 0, 0, 0, 0], [k, 1, 0, 0, 0], [0, 0, 0, 0, 0], [0, 0, 0, 0, 1]]),
        C=[[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]],
        F=[[0, 0, 1, 0, 0], [0, 0, 0, 1, 0]],
        Cz=[[1, 0, 0, 0], [0, 0, 0, 1]],
        inputs=("command",),
        disturbances=("hook", "force", "noise.place", "noise.speed", "slip"),
        measurements=("place", "speed"),
        outputs=("payload", "drum"),
        **options,  # type: ignore[arg-type]
    )


SPECTRA = {
    "hook": SEA,
    "force": White(1e-5),
    "noise.place": White(1e-4),
    "noise.speed": White(1e-4),
    "slip": White(1e-6),
}


@pytest.fixture(scope="module")
def late() -> Bound:
    return lqg_bound(
        spring(delays=(0.15, 0.15)), SPECTRA, {"payload": 1.0}, {"command": 0.8, "drum": 0.5}
    )


def test_textbook_optima() -> None:
    white = {"w": White(1.0), "n": White(1.0)}
    assert lqg_bound(zhou(), white, {"z": 1.0, "u": 1.0}).value == pytest.approx(8.9582, abs=5e-5)
    for outputs, value in (
        ([[1.0, 0, 0, 0], [0, 0, 0, 1.0]], 13.0752),
        ([[0, 1.0, 0, 0], [0, 0, 1.0, 0], [0, 0, 0, 1.0]], 7.7484),
    ):
        plant = scherer(outputs)
        bound = lqg_bound(plant, {"w1": White(1.0)}, dict.fromkeys(plant.outputs, 1.0))
        assert bound.value == pytest.approx(value, abs=5e-5)
        # White noise and no delay: the models are exact, so nothing is missed.
        assert bound.missed < 1e-9
        assert bound.attained == pytest.approx(bound.value, rel=1e-6)


def h2_by_semidefinite_programme(plant: LinearPlant) -> float:
    """Return the optimal H2 norm by Scherer's change of variables, no Riccati equation in it."""
    A, B, C, E, F, Cz, Dz = (
        np.asarray(m) for m in (plant.A, plant.B, plant.C, plant.E, plant.F, plant.Cz, plant.Dz)
    )
    n, (nu, ny) = len(A), (B.shape[1], len(C))
    X, Y = cp.Variable((n, n), symmetric=True), cp.Variable((n, n), symmetric=True)
    a, b, c = cp.Variable((n, n)), cp.Variable((n, ny)), cp.Variable((nu, n))
    W = cp.Variable((len(Cz), len(Cz)), symmetric=True)
    eye = np.eye(n)
    top = A @ X + B @ c
    low = Y @ A + b @ C
    lyapunov = cp.bmat(
        [
            [top + top.T, a.T + A, E],
            [a + A.T, low + low.T, Y @ E + b @ F],
            [E.T, (Y @ E + b @ F).T, -np.eye(E.shape[1])],
        ]
    )
    moved = Cz @ X + Dz @ c
    trace = cp.bmat([[W, moved, Cz], [moved.T, X, eye], [Cz.T, eye, Y]])
    problem = cp.Problem(
        cp.Minimize(cp.trace(W)), [(lyapunov + lyapunov.T) / 2 << 0, (trace + trace.T) / 2 >> 0]
    )
    problem.solve(solver=cp.CLARABEL)
    return float(np.sqrt(problem.value))


@pytest.mark.parametrize("seed", [2, 3, 4])
def test_bound_of_a_random_plant_is_that_of_a_semidefinite_programme(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = 3
    plant = LinearPlant(
        A=rng.normal(size=(n, n)),
        B=rng.normal(size=(n, 1)),
        E=np.hstack([rng.normal(size=(n, 2)), np.zeros((n, 1))]),
        C=rng.normal(size=(1, n)),
        F=[[0.0, 0.0, 0.7]],
        Cz=np.vstack([rng.normal(size=(1, n)), np.zeros((1, n))]),
        Dz=[[0.0], [0.5]],
    )
    spectra = {name: White(1.0) for name in plant.disturbances}
    found = lqg_bound(plant, spectra, {"z1": 1.0, "z2": 1.0})
    assert found.value == pytest.approx(h2_by_semidefinite_programme(plant), rel=2e-4)


def test_sea_and_delay_verify_and_keep_their_limits(late: Bound) -> None:
    assert late.gap < 1e-4
    assert late.missed < 0.03
    assert late.value < late.attained
    assert late.attained == pytest.approx(late.value, rel=0.03)
    for name, bound in late.limits.items():
        assert late.rms[name] <= 1.02 * bound
    assert late.prices["command"] > 0.0
    checked = verify_bound(late)
    assert checked.ok, str(checked)


def test_price_is_what_a_looser_limit_wins(late: Bound) -> None:
    looser = {name: 1.02 * bound for name, bound in late.limits.items()}
    other = lqg_bound(late.plant, SPECTRA, {"payload": 1.0}, looser)
    won = 1.0 - other.dual.value(other.point) / late.dual.value(late.point)
    assert won == pytest.approx(0.02 * sum(late.prices.values()), rel=0.1)


def test_worse_models_lower_the_bound_but_never_break_it() -> None:
    plant = spring(delays=(0.15, 0.15))
    ask = ({"payload": 1.0}, {"command": 0.8})
    found = [
        lqg_bound(plant, SPECTRA, *ask, order=order, pade=pade, refits=refits)
        for order, pade, refits in ((4, 1, 0), (4, 1, 2), (8, 3, 2), (10, 4, 3))
    ]
    least_attained = min(b.attained for b in found)
    # Every bound is below every controller, whatever the models were; better models, higher bound.
    assert all(b.value <= least_attained for b in found)
    assert found[0].value < found[1].value < found[3].value
    assert found[3].value > 0.985 * least_attained


def test_bound_of_exact_models_does_not_depend_on_the_pade_order() -> None:
    plant = spring(delays=(0.1, 0.2))
    spectra = {name: White(1e-3) for name in SPECTRA}
    two, four = (
        lqg_bound(plant, spectra, {"payload": 1.0}, {"command": 0.1}, pade=p) for p in (2, 4)
    )
    assert two.value == pytest.approx(four.value, rel=1e-4)
    assert two.missed > four.missed


@settings(
    max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(seed=st.integers(0, 10_000))
def test_no_controller_of_any_kind_is_below(late: Bound, seed: int) -> None:
    # LQG controllers of other weights and noises, judged by the bound's own Lagrangian.
    rng = np.random.default_rng(seed)
    filters = {
        name: source * 10 ** rng.uniform(-1, 1) if isinstance(source, float) else source
        for name, source in late.filters.items()
    }
    model = shaped(late.plant.without_delays(late.pade, at="measurements"), filters)
    other = Dual(model, late.minimise, late.limits)
    point = other.at(late.point.multipliers * 10 ** rng.uniform(-1.5, 1.5, 2))
    rival = reduced(model, point.regulator, other.estimator, len(model.states))
    weights = {**late.minimise, **late.multipliers}
    lagrangian = weighted_rms(replace(late, minimise=weights), rival) ** 2
    spent = sum(
        m * b**2 for m, b in zip(late.multipliers.values(), late.limits.values(), strict=True)
    )
    assert lagrangian - spent >= late.value**2


def test_designs_of_a_structure_are_above() -> None:
    plant = spring()
    limit = Rms(output="drum", bound=0.5)
    bound = lqg_bound(plant, SPECTRA, {"payload": 1.0}, {"drum": 0.5, "command": 50.0})
    design = tune(
        plant, StaticGain(), spectrum=SPECTRA, minimise={"payload": 1.0}, limits=[limit], starts=4
    )
    assert design.ok
    assert design.controller is not None
    assert bound.value <= design.cost
    # The same controller on the bound's terms: what lies outside the sea's band is left out.
    assert bound.value <= weighted_rms(bound, design.controller) <= design.cost * (1.0 + 1e-6)


def test_limits_that_nothing_can_keep_are_told() -> None:
    # The noise alone moves the payload, so a limit on it far below cannot be kept.
    bound = lqg_bound(spring(), SPECTRA, {"drum": 1.0}, {"payload": 1e-3, "command": 1.0})
    assert not bound.feasible
    assert bound.value == np.inf
    assert "no linear controller keeps the limits" in str(bound)


def test_questions_without_an_answer_are_refused() -> None:
    plant = spring()
    with pytest.raises(InputError, match="command is free of charge"):
        lqg_bound(plant, SPECTRA, {"payload": 1.0})
    quiet = {k: v for k, v in SPECTRA.items() if k != "noise.speed"}
    with pytest.raises(InputError, match="speed must have noise of its own"):
        lqg_bound(plant, quiet, {"payload": 1.0}, {"command": 1.0})
    with pytest.raises(InputError, match="there is no output 'nothing'"):
        lqg_bound(plant, SPECTRA, {"nothing": 1.0}, {"command": 1.0})
    with pytest.raises(InputError, match=r"limits\[command\] must be above 0"):
        lqg_bound(plant, SPECTRA, {"payload": 1.0}, {"command": 0.0})


def test_an_unstable_controller_is_refused(late: Bound) -> None:
    gain = LinearController.static([[50.0, 0.0]], ("place", "speed"), ("command",))
    with pytest.raises(SynthesisError, match="loop is unstable"):
        weighted_rms(late, gain)


def test_limits_on_peaks_as_rms() -> None:
    limits = [
        Peak(bound=10.0, output="a", static=-4.0, duration=10800.0),
        Continuous(bound=5.0, output="a", static=4.0),
        Minimum(bound=1.0, output="b", static=9.0, duration=10800.0),
        Power(bound=1.0, torque="a", speed="b"),
    ]
    k = np.sqrt(2.0 * np.log(10800.0 / 12.0))
    assert rms_limits(limits, 12.0) == pytest.approx({"a": min(6.0 / k, 3.0), "b": 8.0 / k})


@pytest.mark.parametrize("name", ["thesis-1975", "subsea-crane"])
def test_bound_of_a_case_with_all_its_sensors(name: str) -> None:
    # An error of 5 mm, and the like, every quarter of a second.
    noise = {
        f"sensors.payload.{signal}_noise": 0.005 * np.sqrt(2.0 * 0.25)
        for signal in ("acceleration", "velocity", "displacement")
    }
    bound = bound_for(load_case(name).replace(noise), measurements=MEASURED).free
    assert bound.gap < 1e-4
    assert 0.0 < bound.value <= bound.attained < 1.1 * bound.value
    assert any("peaks as rms with T_z" in text for text in bound.assumptions)
    checked = verify_bound(bound)
    assert checked.ok, str(checked)


def test_bound_is_below_the_gains_of_a_case() -> None:
    case = load_case("thesis-1975")
    gains = {"A": 1.0, "a": 4394.0, "a1": 2393.0, "a2": 13691.0}  # the best at M_s <= 2
    design = evaluate_gains(case, gains)
    bound = bound_for(design)
    assert bound.free.value < design.payload_rms
