from __future__ import annotations

import numpy as np
import pytest
from nonlinear_floor import Refinement, refine
from one_run import simulate

import stillhook as sh
from models.operation import Motion, SpectrumMotion
from mpc.floor import Clairvoyant, clairvoyant

SETTLE = 30.0


def sea(case: sh.Case) -> SpectrumMotion:
    return SpectrumMotion.from_case(case)


def eased(case: sh.Case, duration: float, seed: int) -> Motion:
    return sea(case).motion(duration, 0.05, seed).eased(SETTLE)


def refined(height: float, duration: float, seed: int) -> Refinement:
    case = sh.load_case("thesis-1975").replace({"sea.significant_height": height})
    floor = clairvoyant(
        case, eased(case, duration, seed), settle=SETTLE, hold="command", start="hook"
    )
    return refine(floor)


def replayed(refinement: Refinement, seed: int) -> np.ndarray:
    case = refinement.floor.case
    run = simulate(
        case,
        refinement.controller,
        hook=sea(case),
        duration=float(refinement.time[-1]),
        seed=seed,
        store_step=0.05,
    )
    assert run.status == "completed"
    return np.asarray(run.values[:, run.signals.index("payload.displacement")])


@pytest.fixture(scope="module")
def saturated() -> Refinement:
    return refined(1.9, 90.0, 1)


@pytest.mark.ci
def test_the_nonlinear_optimum_is_close_to_the_linear_floor(saturated: Refinement) -> None:
    assert saturated.floor.shares["torque"] > 0.1
    assert saturated.payload_rms > 2e-3
    assert abs(saturated.difference) < 1e-3
    assert saturated.payload_rms <= saturated.warm_rms


def test_demands_free_within_a_sample_are_a_floor_of_the_nonlinear_optimum(
    saturated: Refinement,
) -> None:
    case = saturated.floor.case
    free = clairvoyant(case, eased(case, 90.0, 1), settle=SETTLE)
    assert free.payload_rms < saturated.payload_rms


def test_the_simulator_reproduces_the_optimum(saturated: Refinement) -> None:
    shown = replayed(saturated, 1)
    assert len(shown) == len(saturated.payload)
    assert np.abs(shown - saturated.payload).max() < 1e-6
    counted = shown[saturated.time >= SETTLE]
    assert np.sqrt(np.mean(counted**2)) == pytest.approx(saturated.payload_rms, rel=1e-5)


def test_the_demand_keeps_the_peak(saturated: Refinement) -> None:
    peak = saturated.floor.problem.plant.peak
    assert 0.999 * peak < saturated.torque_peak < 1.00001 * peak


def test_the_refinement_prints_as_a_tree(saturated: Refinement) -> None:
    text = str(saturated)
    assert "on the nonlinear plant" in text
    assert text.count("\n") == 3


@pytest.mark.slow
def test_drag_matters_by_a_per_cent_where_the_load_cannot_be_held() -> None:
    rough = refined(3.75, 120.0, 1)
    assert rough.payload_rms > 0.1
    assert abs(rough.difference) < 0.02
    assert np.abs(replayed(rough, 1) - rough.payload).max() < 1e-4


def test_a_floor_that_does_not_hold_its_commands_is_refused() -> None:
    case = sh.load_case("thesis-1975")
    floor: Clairvoyant = clairvoyant(case, sea(case).motion(5.0, 0.05, 0), drag=0.0)
    with pytest.raises(sh.InputError, match="must be made with hold='command'"):
        refine(floor)
