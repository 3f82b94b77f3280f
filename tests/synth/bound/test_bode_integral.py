"""Bode's integral of loops in closed form, and the disk margin of a textbook loop."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from models.basics import adaptive_nodes
from models.plant import LinearPlant
from models.sea import SeaSpectrum
from synth.bound.bode_integral import BodeEstimate, bode_estimate
from synth.loop import Assessment, LinearController, disturbances, loop_margins

FloatArray = npt.NDArray[np.float64]


def bode_integral(
    log_sensitivity: Callable[[FloatArray], FloatArray], poles: npt.NDArray[np.complex128]
) -> float:
    """Return the integral of ln|S| over the half line [rad/s]; `poles` are those of the loop."""
    sizes = np.abs(poles)
    low, high = 1e-4 * float(sizes.min()), 1e4 * float(sizes.max())
    # ln|S| changes its sign, so the nodes are chosen by its size.
    nodes = adaptive_nodes(
        lambda w: np.abs(log_sensitivity(w)) ** 2 + 1e-300,
        low,
        high,
        poles=[complex(p) for p in poles if p.imag > 0.0 and p.real < 0.0],
        rtol=1e-9,
    )
    inside = float(nodes.integrate(log_sensitivity(nodes.omega)))
    ends = log_sensitivity(np.array([low, high]))
    # Even below; above, as 1/omega^2.
    return inside + low * float(ends[0]) + high * float(ends[1])


def test_bode_integral_of_a_stable_loop_is_zero() -> None:
    # L = 2/(s+1)^2: ln|S| = ln|(s+1)^2/((s+1)^2 + 2)|
    def log_sensitivity(omega: FloatArray) -> FloatArray:
        s = 1j * omega
        return np.asarray(np.log(np.abs((s + 1) ** 2 / ((s + 1) ** 2 + 2.0))))

    poles = np.array([-1.0, -1.0, -1.0 + 1.41421j])
    assert bode_integral(log_sensitivity, poles) == pytest.approx(0.0, abs=1e-4)

    def unstable(omega: FloatArray) -> FloatArray:
        # L = 6/((s-1)(s+3)): closed s^2 + 2 s + 3, one unstable pole at 1
        s = 1j * omega
        return np.asarray(np.log(np.abs((s - 1) * (s + 3) / (s**2 + 2 * s + 3))))

    found = bode_integral(unstable, np.array([1.0, -3.0, -1.0 + 1.41421j]))
    assert found == pytest.approx(np.pi, rel=1e-4)


def test_least_sensitivity_trades_area_for_area() -> None:
    # ln 2 over 9 rad/s above pays for 9 ln 2 over 1 rad/s below
    paid = BodeEstimate(band=1.0, available=10.0, max_sensitivity=2.0, achieved=1.0)
    assert paid.least == pytest.approx(2.0**-9)
    assert replace(paid, available=1.0, band=2.0).least == 1.0


def test_estimate_of_a_loop_is_one_line() -> None:
    # A payload that a speed command moves, late: L = 1.2 e^{-0.2 s}/(s (1 + 0.2 s))
    plant = LinearPlant(
        A=[[0.0, 1.0], [0.0, -5.0]],
        B=[[0.0], [5.0]],
        E=[[0.0], [1.0]],
        C=[[1.0, 0.0]],
        Cz=[[1.0, 0.0]],
        delays=(0.2,),
        disturbances=("hook",),
    )
    sea = SeaSpectrum(kind="jonswap", significant_height=2.0, peak_period=9.0)
    sources = disturbances({"hook": sea}, ("hook",))
    view = Assessment(plant, LinearController.static([[-1.2]], ("y1",), ("u1",)), sources)
    assert view.stable
    found = bode_estimate(view)
    assert 0.0 < found.least < found.achieved < found.max_sensitivity
    assert "\n" not in str(found)
    assert found.limits_band == ("this loop's is" in str(found))
    assert "this loop's is" in str(replace(found, available=2.0 * found.band))
    # More bandwidth, more to trade.
    assert replace(found, available=50.0).least < replace(found, available=5.0).least


def ringing(gain: float) -> Assessment:
    """A resonance at 1 rad/s that rate feedback damps, and one at 8 that it hears too late."""
    plant = LinearPlant(
        A=[
            [0.0, 1.0, 0.0, 0.0],
            [-1.0, -0.06, 0.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
            [0.0, 0.0, -64.0, -0.48],
        ],
        B=[[0.0], [1.0], [0.0], [0.4]],
        E=[[0.0], [1.0], [0.0], [0.0]],
        C=[[0.0, 1.0, 0.0, 1.0]],
        Cz=[[1.0, 0.0, 0.0, 0.0]],
        delays=(0.35,),
        disturbances=("hook",),
    )
    sea = SeaSpectrum(kind="jonswap", significant_height=2.0, peak_period=6.5)
    sources = disturbances({"hook": sea}, ("hook",))
    return Assessment(plant, LinearController.static([[-gain]], ("y1",), ("u1",)), sources)


def test_a_resonance_pays_for_what_the_band_wins() -> None:
    view = ringing(0.5)
    assert view.stable
    found = bode_estimate(view)
    assert found.resonance == pytest.approx(8.0, rel=0.05)
    assert found.damping < found.open_damping == pytest.approx(0.03, rel=1e-6)
    S = 1.0 / (1.0 + view.loop_gain(np.array([found.resonance])))
    assert found.resonant == pytest.approx(float(np.abs(S)[0]))
    assert found.pays_at_resonance
    assert "cannot be damped without paying elsewhere" in str(found)
    # With the other sign the same delay lets the loop damp it, and shake the band.
    assert not bode_estimate(ringing(-0.02)).pays_at_resonance


def test_disk_margin_of_the_textbook_loop() -> None:
    # Seiler, Packard and Gahinet, "An introduction to disk margins" (2020)
    def loop(omega: FloatArray) -> npt.NDArray[np.complex128]:
        s = 1j * omega
        return np.asarray(25.0 / (s**3 + 10.0 * s**2 + 10.0 * s + 10.0))

    grid = np.geomspace(1e-3, 1e3, 2000)
    alpha = loop_margins(loop, grid, loop(grid)).disk
    assert alpha == pytest.approx(0.458, abs=1e-3)
    gain = (1.0 + alpha / 2.0) / (1.0 - alpha / 2.0)
    assert 20.0 * np.log10(gain) == pytest.approx(4.05, abs=0.01)
    assert np.degrees(2.0 * np.arctan(alpha / 2.0)) == pytest.approx(25.8, abs=0.1)
