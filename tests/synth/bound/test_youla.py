"""Youla designs: above the bound, closer with more functions, and what they claim when realised."""

from __future__ import annotations

from dataclasses import replace

import cvxpy
import numpy as np
import pytest
from bound_check import weighted_rms
from scipy.linalg import solve_continuous_lyapunov

from models.basics import FloatArray, InputError, SolverError, SynthesisError, White
from models.plant import LinearPlant
from models.sea import SeaSpectrum
from synth.bound import Bound
from synth.bound.bound import lqg_bound
from synth.bound.high_order import high_order, roots, truncated
from synth.bound.youla import Truth, basis, poles_of_functions, realised_basis, youla_design
from synth.limits import RollOff
from synth.loop import Assessment, LinearController, closed_loop_poles
from synth.verify import LawMatrices, lyapunov_variances

SEA = SeaSpectrum(kind="jonswap", significant_height=2.0, peak_period=9.0)


def winch(spring: float = 0.9) -> LinearPlant:
    """A payload on a spring below a hook, with a late measurement and a drum of one lag."""
    return LinearPlant(
        A=[[0.0, 1.0, 0.0], [-spring, -0.1, spring], [0.0, 0.0, -1.0]],
        B=[[0.0], [0.0], [1.0]],
        E=[[0.0, 0.0], [spring, 0.0], [0.0, 0.0]],
        C=[[1.0, 0.0, 0.0]],
        F=[[0.0, 1.0]],
        Cz=[[1.0, 0.0, 0.0]],
        inputs=("command",),
        disturbances=("hook", "noise"),
        measurements=("place",),
        outputs=("payload",),
        delays=(0.1,),
    )


@pytest.fixture(scope="module")
def bound() -> Bound:
    spectra = {"hook": SEA, "noise": White(1e-4)}
    return lqg_bound(winch(), spectra, {"payload": 1.0}, {"command": 0.6})


def sensitivity(plant: LinearPlant, controller: LinearController) -> FloatArray:
    """Return |S| on a dense grid and at every pole, by solving the loop at each frequency."""
    poles = closed_loop_poles(plant.without_delays(6), controller)
    near = np.concatenate([poles, plant.poles()]).imag
    omega = np.concatenate([np.geomspace(1e-4, 1e3, 20_000), near[near > 0.0]])
    n = len(controller.A)
    found = []
    for w, yu in zip(omega, plant.response(omega).yu, strict=True):
        inside = np.linalg.solve(1j * w * np.eye(n) - controller.A, controller.B)
        found.append(1.0 / abs(1.0 - (controller.C @ inside @ yu)[0, 0]))
    return np.array(found)


def test_functions_are_orthonormal() -> None:
    poles = poles_of_functions(0.5, 20.0, 5)
    A, B = realised_basis(poles, 1)
    # <phi_i, phi_j> from the controllability Gramian of the common input
    np.testing.assert_allclose(solve_continuous_lyapunov(A, -B @ B.T), np.eye(5), atol=1e-12)
    omega = np.array([0.3, 1.3, 40.0])
    direct = [np.linalg.solve(1j * w * np.eye(5) - A, B)[:, 0] for w in omega]
    np.testing.assert_allclose(basis(omega, poles), direct, rtol=1e-12)
    # With one pole for all they are Laguerre's.
    s = 1.3j
    laguerre = np.sqrt(4.0) / (s + 2.0) * ((s - 2.0) / (s + 2.0)) ** np.arange(5)
    np.testing.assert_allclose(basis(np.array([1.3]), np.full(5, 2.0))[0], laguerre, rtol=1e-12)
    # More functions are those and others.
    np.testing.assert_array_equal(poles_of_functions(0.5, 20.0, 9)[:5], poles)
    assert np.all((poles > 0.5) & (poles < 20.0))
    assert len(realised_basis(poles, 3)[0]) == 15


def test_without_margins_it_comes_down_to_the_bound(bound: Bound) -> None:
    found = [youla_design(bound, functions=n).value for n in (1, 4, 8)]
    assert found[0] >= found[1] >= found[2] >= bound.value
    assert found[2] < 1.03 * bound.value


@pytest.mark.parametrize("most", [1.3, 1.6, 2.5])
def test_monotone_and_never_below_the_bound(bound: Bound, most: float) -> None:
    values = [youla_design(bound, max_sensitivity=most, functions=n).value for n in (16, 20, 24)]
    assert values[0] * (1.0 + 1e-5) >= values[1]
    assert values[1] * (1.0 + 1e-5) >= values[2] > bound.value


def test_with_a_limit_on_sensitivity(bound: Bound) -> None:
    design = youla_design(bound, max_sensitivity=1.6, functions=16)
    assert design.rms["command"] <= 0.6
    controller = design.controller
    rational = bound.plant.without_delays(6)
    assert closed_loop_poles(rational, controller).real.max() < 0.0
    # The variance by a Lyapunov equation on the fitted sea, and by an integral on the true one.
    law = LawMatrices.of(controller, rational)
    by_time = np.sqrt(lyapunov_variances(rational, law, bound.filters)["payload"])
    assert by_time == pytest.approx(design.value, rel=0.03 + max(bound.fits.values()))
    assert weighted_rms(bound, controller) == pytest.approx(design.value, rel=1e-3)
    assert sensitivity(bound.plant, controller).max() <= 1.6 * 1.001


def test_roll_off_holds_beyond_its_frequency(bound: Bound) -> None:
    design = youla_design(
        bound, max_sensitivity=2.0, shapes=[RollOff(bound=0.3, above=6.0)], functions=12
    )
    view = Assessment(bound.plant, design.controller, bound.sources)
    assert view.stable
    assert RollOff(bound=0.3, above=6.0).measure(view) <= 0.3 * 1.01
    free = youla_design(bound, max_sensitivity=2.0, functions=12)
    assert design.value >= free.value * (1.0 - 1e-6)


def test_truncation_is_a_controller_of_low_order(bound: Bound) -> None:
    design = youla_design(bound, max_sensitivity=1.95, functions=10)
    found = high_order(design, 2.0)
    assert found.order < 0.6 * len(design.controller.A)
    assert bound.value <= found.rms <= 1.02 * design.value
    assert found.rms == pytest.approx(weighted_rms(bound, found.controller))
    dense = sensitivity(bound.plant, found.controller).max()
    assert dense <= 2.0 * 1.002
    assert found.margins.max_sensitivity == pytest.approx(dense, rel=1e-4)
    # All the states are the controller itself.
    same = truncated(design, len(design.controller.A), roots(design))
    assert weighted_rms(bound, same) == pytest.approx(design.value, rel=1e-3)


def test_it_holds_on_another_plant_that_it_is_told_of(bound: Bound) -> None:
    off = winch(spring=0.95)
    blind = youla_design(bound, max_sensitivity=1.6, functions=20)
    wise = youla_design(bound, max_sensitivity=1.6, functions=20, truth=Truth(plant=off))
    assert sensitivity(off, blind.controller).max() > 1.65
    assert sensitivity(off, wise.controller).max() <= 1.6 * 1.001
    assert closed_loop_poles(off.without_delays(6), wise.controller).real.max() < 0.0
    assert wise.value > blind.value


def test_a_programme_without_an_answer_says_nothing_of_how_to_call_the_solver(
    bound: Bound, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*words: object, **more: object) -> None:
        raise cvxpy.error.SolverError("Try another solver, or solve with verbose=True")

    monkeypatch.setattr(cvxpy.Problem, "solve", fails)
    with pytest.raises(SolverError, match=r"^Youla: Clarabel found no answer, for want of digits$"):
        youla_design(bound, max_sensitivity=2.0, functions=1)


def test_what_cannot_be_kept_is_told(bound: Bound) -> None:
    with pytest.raises(SynthesisError, match="keeps the limits"):
        youla_design(bound, max_sensitivity=1.001, functions=1)
    with pytest.raises(InputError, match="max_sensitivity must be above 1"):
        youla_design(bound, max_sensitivity=0.9)
    design = youla_design(bound, max_sensitivity=2.0, functions=12)
    with pytest.raises(SynthesisError, match="no truncation"):
        high_order(replace(design, value=0.1 * design.value), 2.0)
