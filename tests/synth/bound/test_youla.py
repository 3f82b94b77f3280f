"""Youla designs: above the bound, closer with more functions, and what they claim when realised."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov

from models.basics import InputError, SynthesisError, White
from models.plant import LinearPlant
from models.sea import SeaSpectrum
from synth.bound import Bound, weighted_rms
from synth.bound.bound import lqg_bound
from synth.bound.youla import laguerre, youla_design
from synth.loop import Assessment

SEA = SeaSpectrum(kind="jonswap", significant_height=2.0, peak_period=9.0)


@pytest.fixture(scope="module")
def bound() -> Bound:
    """A payload on a spring below a hook, with a late measurement and a drum of one lag."""
    plant = LinearPlant(
        A=[[0.0, 1.0, 0.0], [-0.9, -0.1, 0.9], [0.0, 0.0, -1.0]],
        B=[[0.0], [0.0], [1.0]],
        E=[[0.0, 0.0], [0.9, 0.0], [0.0, 0.0]],
        C=[[1.0, 0.0, 0.0]],
        F=[[0.0, 1.0]],
        Cz=[[1.0, 0.0, 0.0]],
        inputs=("command",),
        disturbances=("hook", "noise"),
        measurements=("place",),
        outputs=("payload",),
        delays=(0.1,),
    )
    spectra = {"hook": SEA, "noise": White(1e-4)}
    return lqg_bound(plant, spectra, {"payload": 1.0}, {"command": 0.6})


def test_functions_are_orthonormal() -> None:
    A, B, C = laguerre(2.0, 5, 1)
    # <phi_i, phi_j> from the controllability Gramian of the common input
    np.testing.assert_allclose(solve_continuous_lyapunov(A, -B @ B.T), np.eye(5), atol=1e-12)
    s = 1.3j
    direct = np.sqrt(4.0) / (s + 2.0) * ((s - 2.0) / (s + 2.0)) ** np.arange(5)
    np.testing.assert_allclose(np.linalg.solve(s * np.eye(5) - A, B)[:, 0], direct, rtol=1e-12)
    assert C.shape == (1, 5)


def test_without_margins_it_comes_down_to_the_bound(bound: Bound) -> None:
    found = [youla_design(bound, functions=n).value for n in (1, 4, 8)]
    assert found[0] >= found[1] >= found[2] >= bound.value
    assert found[2] < 1.03 * bound.value


@pytest.mark.ci
def test_with_a_limit_on_sensitivity(bound: Bound) -> None:
    found = [youla_design(bound, max_sensitivity=1.6, functions=n) for n in (12, 16, 24)]
    values = [design.value for design in found]
    assert values[0] >= values[1] >= values[2] > bound.value
    last = found[2]
    assert last.margins.max_sensitivity <= 1.6 * 1.005
    assert last.rms["command"] <= 0.6
    checked = last.verify()
    assert checked.ok, str(checked)
    assert "best possible with these sensors" in str(last)


def test_roll_off_holds_beyond_its_frequency(bound: Bound) -> None:
    design = youla_design(bound, max_sensitivity=2.0, roll_off=(0.3, 6.0), functions=12)
    view = Assessment(bound.plant, design.controller, bound.sources)
    assert view.stable
    assert view.largest_loop_gain(6.0)[0] <= 0.3 * 1.01
    free = youla_design(bound, max_sensitivity=2.0, functions=12)
    assert design.value >= free.value * (1.0 - 1e-6)


def test_truncation_is_a_controller_of_low_order(bound: Bound) -> None:
    design = youla_design(bound, max_sensitivity=2.0, functions=10)
    low = design.lowest(within=0.1)
    assert len(low.A) < 0.6 * len(design.controller.A)
    assert bound.value <= weighted_rms(bound, low) <= 1.1 * design.value
    # All the states are the controller itself.
    same = design.reduced(len(design.controller.A))
    assert weighted_rms(bound, same) == pytest.approx(design.value, rel=1e-3)


def test_what_cannot_be_kept_is_told(bound: Bound) -> None:
    with pytest.raises(SynthesisError, match="keeps the limits"):
        youla_design(bound, max_sensitivity=1.001, functions=1)
    with pytest.raises(InputError, match="max_sensitivity must be above 1"):
        youla_design(bound, max_sensitivity=0.9)
