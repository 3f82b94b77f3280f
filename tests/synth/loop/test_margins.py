"""Margins against closed forms, against python-control and against their definitions."""

from __future__ import annotations

import control
import numpy as np
import pytest
from loop_numbers import loop_response, stable_with, two_carts

from synth.loop import LinearController, Margins, loop_margins, refine_minima
from synth.loop.margins import worst_margins

GRID = np.geomspace(1e-4, 1e4, 1500)


def margins_of(numerator: list[float], denominator: list[float], delay: float = 0.0) -> Margins:
    def loop(omega):
        s = 1j * omega
        return np.polyval(numerator, s) / np.polyval(denominator, s) * np.exp(-s * delay)

    return loop_margins(loop, GRID, loop(GRID))


def test_third_order_lag_has_the_textbook_margins() -> None:
    # 4/(s+1)^3 crosses the axis at sqrt(3) with -1/2, and |L| = 1 where 1 + w^2 = 4^(2/3)
    m = margins_of([4.0], [1.0, 3.0, 3.0, 1.0])
    crossover = np.sqrt(4.0 ** (2.0 / 3.0) - 1.0)
    phase = np.pi - 3.0 * np.arctan(crossover)
    assert m.gain == pytest.approx(2.0, rel=1e-9)
    assert m.real_axis_crossings == pytest.approx([np.sqrt(3.0)], rel=1e-9)
    assert m.crossovers == pytest.approx([crossover], rel=1e-9)
    assert m.phase == pytest.approx(phase, rel=1e-9)
    assert m.delay == pytest.approx(phase / crossover, rel=1e-9)
    assert m.gain_down == 0.0


def test_delayed_integrator_has_the_closed_form() -> None:
    k, tau = 2.0, 0.3
    m = margins_of([k], [1.0, 0.0], tau)
    assert m.gain == pytest.approx(np.pi / (2.0 * k * tau), rel=1e-9)
    assert m.delay == pytest.approx(np.pi / (2.0 * k) - tau, rel=1e-9)
    assert m.phase == pytest.approx(np.pi / 2.0 - k * tau, rel=1e-9)


@pytest.mark.parametrize(("k", "text"), [(2.0, "785.4 ms"), (0.001, "-"), (0.0, "-")])
def test_a_delay_margin_that_no_plant_has_is_a_dash(k: float, text: str) -> None:
    """An integrator k/s stands pi/(2 k): 1571 s mean nothing."""
    m = margins_of([k], [1.0, 0.0]) if k else margins_of([0.5], [1.0, 1.0])
    assert m.delay_text == text
    assert f"delay {text}\n" in str(m)


def test_first_order_lag_has_margins_without_bound() -> None:
    # gain 0.5: |L| < 1 throughout
    m = margins_of([0.5], [1.0, 1.0])
    assert m.gain == np.inf
    assert m.gain_down == 0.0
    assert m.phase == np.inf
    assert m.delay == np.inf
    assert m.max_sensitivity == pytest.approx(1.0, abs=1e-6)
    assert m.crossovers.size == 0


def test_sensitivity_peak_of_a_second_order_loop_is_the_closed_form() -> None:
    # L = 1/(s (s + 2 zeta)): S = s (s + 2 zeta) / (s^2 + 2 zeta s + 1); with x = w^2,
    # |S|^2 = (x^2 + 4 z^2 x) / (x^2 + (4 z^2 - 2) x + 1), stationary at a polynomial's root
    zeta = 0.2
    a, b = 4.0 * zeta**2, 4.0 * zeta**2 - 2.0
    # d/dx: (2x + a)(x^2 + b x + 1) - (x^2 + a x)(2x + b) = 0
    stationary = np.polysub(
        np.polymul([2.0, a], [1.0, b, 1.0]), np.polymul([1.0, a, 0.0], [2.0, b])
    )
    x = max(r.real for r in np.roots(stationary) if abs(r.imag) < 1e-12)
    m = margins_of([1.0], [1.0, 2.0 * zeta, 0.0])
    assert m.peak == pytest.approx(np.sqrt(x), rel=1e-5)
    assert m.max_sensitivity == pytest.approx(
        np.sqrt((x**2 + a * x) / (x**2 + b * x + 1.0)), rel=1e-10
    )


@pytest.mark.parametrize(
    ("numerator", "denominator"),
    [
        ([2.0], [1.0, 3.0, 2.0, 0.0]),
        ([1.0, 1.0], [1.0, 2.0, 4.0, 0.0]),
        ([30.0, 60.0, 30.0], [1.0, 9.0, 20.0, 0.0, 0.0]),
        ([0.3, 0.01, 0.3], [1.0, 0.4, 1.5, 0.2]),
    ],
)
def test_python_control_agrees(numerator: list[float], denominator: list[float]) -> None:
    m = margins_of(numerator, denominator)
    L = control.tf(numerator, denominator)
    closed = control.feedback(L, 1)
    assert np.all(closed.poles().real < 0.0)
    gains, phases, _, _, crossovers, _ = control.stability_margins(L, returnall=True)
    up, down = [g for g in gains if g > 1.0], [g for g in gains if g < 1.0]
    assert m.gain == pytest.approx(min(up, default=np.inf), rel=1e-6)
    assert m.gain_down == pytest.approx(max(down, default=0.0), rel=1e-6, abs=1e-6)
    if len(phases):
        assert m.phase == pytest.approx(np.radians(np.abs(phases).min()), rel=1e-6)
        assert m.crossovers == pytest.approx(np.sort(crossovers), rel=1e-6)
    dense = np.unique(np.concatenate([np.geomspace(1e-3, 1e3, 40001), m.crossovers]))
    assert m.disk == pytest.approx(control.disk_margins(L, dense, skew=0.0)[0], rel=1e-4)


def test_conditionally_stable_loop_has_a_lower_gain_margin() -> None:
    # k (s + 1)^2 / s^3 is stable for k > 1/2 (Routh: k * 2k > k)
    m = margins_of([2.0, 4.0, 2.0], [1.0, 0.0, 0.0, 0.0])
    assert m.gain_down == pytest.approx(0.25, rel=1e-6)
    assert m.gain == np.inf


def test_loop_that_needs_its_gain_at_zero_frequency_has_a_lower_gain_margin() -> None:
    # 3/(s - 1): stable for a gain above 1/3; L starts on the negative axis at -3
    m = margins_of([3.0], [1.0, -1.0])
    assert m.gain_down == pytest.approx(1.0 / 3.0, rel=1e-6)


def test_delay_margin_counts_every_crossover() -> None:
    # A resonance above the first crossover makes three of them; the first has delay to spare.
    denominator = np.polymul([1.0, 0.2], [1.0, 0.1, 9.0])
    m = margins_of([5.0], denominator.tolist())
    at = m.crossovers
    assert at.size == 3
    L = 5.0 / np.polyval(denominator, 1j * at)
    left = np.mod(np.angle(-L), 2.0 * np.pi) / at
    assert m.delay == pytest.approx(left.min(), rel=1e-9)
    assert left.min() < 0.5 * left[np.argmin(at)]


def test_crossing_that_falls_on_a_grid_point_is_seen() -> None:
    # 1/(s (1 + s)^2) touches the axis at exactly 1 rad/s, 1/s has |L| = 1 there
    grid = np.array([0.01, 0.1, 0.5, 1.0, 2.0, 10.0, 100.0])

    def lag(omega):
        return 1.0 / (1j * omega * (1.0 + 1j * omega) ** 2)

    def integral(omega):
        return 1.0 / (1j * omega)

    assert loop_margins(lag, grid, lag(grid)).gain == pytest.approx(2.0, rel=1e-9)
    m = loop_margins(integral, grid, integral(grid))
    assert m.crossovers == pytest.approx([1.0], rel=1e-9)
    assert m.delay == pytest.approx(np.pi / 2.0, rel=1e-9)


def test_two_crossings_between_two_grid_points_are_seen() -> None:
    # Im L = -((ln w)^2 - 0.09)/w: zero at exp(-0.3) and exp(0.3), and no grid point between them.
    grid = np.array([0.1, 0.2, 0.4, 0.7, 1.4, 3.0, 10.0])

    def loop(omega):
        return (-3.0 + omega - 1j * (np.log(omega) ** 2 - 0.09)) / omega

    m = loop_margins(loop, grid, loop(grid))
    assert m.real_axis_crossings == pytest.approx(np.exp([-0.3, 0.3]), rel=1e-9)
    assert m.gain_down == pytest.approx(1.0 / (3.0 * np.exp(-0.3) - 1.0), rel=1e-9)


def test_two_crossings_under_a_lopsided_crest_between_uneven_points_are_seen() -> None:
    """The parabola through the three points about the crest has no zero: one look is not enough."""

    def loop(omega):
        u = np.log(omega / 1.675)
        height = 1.2e-3 - np.where(u < 0.0, 150.0, 90.0) * u**2
        return -2.75 + 6.0 * u + 1j * np.maximum(height, -3.0)

    grid = np.array([1.0, 1.44, 1.52, 1.612, 1.619, 1.709, 1.728, 1.81, 1.91, 2.03, 3.0])
    margins = loop_margins(loop, grid, loop(grid))
    rim = 1.675 * np.exp([-np.sqrt(1.2e-3 / 150.0), np.sqrt(1.2e-3 / 90.0)])
    assert margins.real_axis_crossings == pytest.approx(rim, rel=1e-9)
    assert margins.gain_down == pytest.approx(1.0 / (2.75 - 6.0 * np.log(rim[1] / 1.675)))


def test_narrow_peak_between_grid_points_is_found() -> None:
    grid = np.geomspace(0.01, 100.0, 60)

    def distance(w):
        return 1.0 - 0.9 / (1.0 + (np.log(w / 3.3) / 0.2) ** 2)

    at, value = refine_minima(distance, grid, distance(grid))
    best = np.argmin(value)
    assert at[best] == pytest.approx(3.3, rel=1e-5)
    assert value[best] == pytest.approx(0.1, abs=1e-9)


def test_monotone_function_has_its_least_value_at_an_end() -> None:
    grid = np.geomspace(1.0, 10.0, 20)
    at, value = refine_minima(lambda w: w, grid, grid)
    assert at.tolist() == [1.0, 10.0]
    assert value.tolist() == [1.0, 10.0]


def test_several_loops_report_the_worst_of_each() -> None:
    a = margins_of([4.0], [1.0, 3.0, 3.0, 1.0])
    b = margins_of([2.0, 4.0, 2.0], [1.0, 0.0, 0.0, 0.0])
    both = worst_margins([a, b])
    assert both.gain == a.gain
    assert both.gain_down == b.gain_down
    assert both.max_sensitivity == max(a.max_sensitivity, b.max_sensitivity)
    assert both.disk == min(a.disk, b.disk)
    assert both.delay == min(a.delay, b.delay)
    assert worst_margins([a]) is a


def test_margins_of_a_plant_bound_the_gain_at_which_it_goes_unstable() -> None:
    plant = two_carts()
    controller = LinearController(
        A=[[-6.0, 1.0], [-12.0, 0.0]],
        B=[[-12.0], [-15.0]],
        C=[[1.0, 0.0]],
        D=[[0.0]],
        measurements=("y1",),
        inputs=("u1",),
    )
    assert stable_with(plant, controller, 1.0)
    loop, grid = loop_response(plant, controller), np.geomspace(1e-3, 1e3, 3000)
    m = loop_margins(loop, grid, loop(grid))
    assert 1.0 < m.gain < 20.0
    assert stable_with(plant, controller, m.gain * (1.0 - 1e-4))
    assert not stable_with(plant, controller, m.gain * (1.0 + 1e-4))


def test_margins_print_as_a_tree() -> None:
    assert "M_s" in str(margins_of([4.0], [1.0, 3.0, 3.0, 1.0]))
    assert "├ gain x 0 to x 2\n" in str(margins_of([4.0], [1.0, 3.0, 3.0, 1.0]))
    assert "├ gain x 0 to without bound\n" in str(margins_of([0.5], [1.0, 1.0]))


def test_three_nodes_all_but_on_a_line_bend_no_parabola():
    def narrow(omega):
        return np.where(np.abs(omega - 0.95) < 0.02, 0.0, np.maximum(2.0 - omega, 1e-310))

    grid = np.array([0.0, 0.95, 2.0])
    at, value = refine_minima(narrow, grid, narrow(grid))
    assert value.min() == 0.0
    assert at[np.argmin(value)] == 0.95
