"""Deviations and extremes of signals with a loss that switches, against drawn Gaussian records."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter, welch

import stillhook as sh
from models import load_case
from models.basics import Quadrature
from models.sensing import density_of, velocity_correlation
from synth.design.switched import (
    SwitchedSignal,
    crest,
    image_frequencies,
    remnant_of_drag,
    swing,
)
from synth.loop import DragElement

_PEAK, _WIDE = 0.8, 0.25  # of the disturbance's density [rad/s]
_LAG = 0.5  # of the loop's answer to a loss [s]


def signal(
    *, loss: float, carried: float = 0.0, phase: float = 0.6, answer: float = 0.0
) -> SwitchedSignal:
    """Return a signal and a speed that hear a narrow sea and a wide noise, in part the same.

    The loop answers to the loss with so much of it, behind a lag of `_LAG`.
    """
    x, w = np.polynomial.legendre.leggauss(200)
    omega, weights = 1.5 + 1.45 * x, 1.45 * w
    sea = np.exp(-0.5 * ((omega - _PEAK) / _WIDE) ** 2)
    noise = 0.3 * np.exp(-0.5 * ((omega - 1.9) / 0.4) ** 2)
    even = np.ones_like(omega)
    linear = np.stack([np.exp(1j * phase) * even, 0.8 * even])
    speed = np.stack([1j * omega, 0.2 * even])
    odd = np.arange(1, 400, 2)
    reaction = np.zeros(400 if answer else 0, dtype=np.complex128)
    if answer:
        variance, bend = (
            (np.abs(speed) ** 2 * [sea, noise] * omega**n * weights).sum() for n in (0, 2)
        )
        lag = 1.0 + 1j * odd * math.sqrt(bend / variance) * _LAG
        reaction[odd] = -answer * 2.0 / (1j * math.pi * odd) / lag
    return SwitchedSignal(
        nodes=Quadrature(omega=omega, weights=weights),
        densities=np.stack([sea, noise]),
        linear=linear,
        carried=carried * linear * np.exp(0.3j),
        speed=speed,
        loss=loss,
        reaction=reaction,
        turn=1e-3,
    )


def record(one: SwitchedSignal, *, answer: float = 0.0, step: float = 0.02, seed: int = 11):
    """Return A + s (Delta + B) + Q of a record of two million samples, a sum of random waves."""
    rng, count = np.random.default_rng(seed), 2**21
    omega = 2.0 * math.pi * np.fft.rfftfreq(count, step)
    inside = (omega > one.nodes.omega[0]) & (omega < one.nodes.omega[-1])
    parts = np.zeros((3, omega.size), dtype=np.complex128)
    for i, density in enumerate(one.densities):
        size = 0.5 * np.sqrt(omega[1] * np.interp(omega[inside], one.nodes.omega, density))
        drawn = rng.standard_normal((2, size.size))
        wave = size * (drawn[0] + 1j * drawn[1])
        for j, responses in enumerate((one.linear, one.carried, one.speed)):
            parts[j, inside] += wave * np.interp(omega[inside], one.nodes.omega, responses[i])
    A, B, speed = np.fft.irfft(parts, count) * count
    lagged = np.fft.irfft(np.fft.rfft(np.sign(speed)) / (1.0 + 1j * omega * _LAG), count)
    return A + np.sign(speed) * (one.loss + B) - answer * lagged


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("phase", [0.1, 1.5, 2.8])
@pytest.mark.parametrize(("loss", "carried"), [(0.0, 0.0), (0.4, 0.0), (1.0, 0.0), (0.6, 0.15)])
def test_levels_are_crossed_as_often_as_in_a_drawn_record(loss, carried, phase, way):
    one = signal(loss=loss, carried=carried, phase=phase)
    drawn = way * record(one)
    duration = 0.02 * drawn.size
    for level in np.std(drawn) * np.array([1.0, 2.0, 2.7]):
        seen = np.count_nonzero((drawn[:-1] < level) & (drawn[1:] >= level)) / duration
        error = 3.5 / math.sqrt(seen * duration) + 0.03  # crossings come in groups
        assert one.rate(level, way) == pytest.approx(seen, rel=error), (level, seen)


@pytest.mark.parametrize("phase", [0.1, 1.5, 2.8])
@pytest.mark.parametrize(("loss", "answer"), [(0.0, 0.8), (0.7, 0.5), (0.7, -0.6)])
def test_what_a_loop_makes_of_a_loss_is_no_noise(loss, answer, phase):
    one = signal(loss=loss, phase=phase, answer=answer)
    drawn = record(one, answer=answer)
    duration = 0.02 * drawn.size
    for level in np.quantile(drawn, [0.9, 0.99, 0.9995]):
        seen = np.count_nonzero((drawn[:-1] < level) & (drawn[1:] >= level)) / duration
        # Of a period that is the mean one, where those of the drawn motion scatter.
        error = 3.5 / math.sqrt(seen * duration) + 0.08
        assert one.rate(level) == pytest.approx(seen, rel=error), (level, seen)


@pytest.mark.parametrize("way", [1, -1])
def test_the_most_probable_extreme_is_crossed_once(way):
    one = signal(loss=0.7, carried=0.1)
    assert one.rate(one.extreme(10_800.0, way), way) == pytest.approx(1.0 / 10_800.0, rel=1e-6)


def test_without_a_loss_it_is_k_sigma():
    one = signal(loss=0.0)
    extreme = one.extreme(10_800.0)
    assert one.rate(extreme) == pytest.approx(1.0 / 10_800.0, rel=1e-6)
    assert extreme == pytest.approx(one.extreme(10_800.0, -1), rel=1e-12)


def test_a_loss_that_turns_at_the_peaks_adds_less_than_one_that_goes_with_them():
    """In a narrow band; what turns as the signal peaks adds its loss right after, to less."""
    along, beside = (signal(loss=0.7, phase=phase) for phase in (0.5 * math.pi, 0.0))
    still = signal(loss=0.0).extreme(10_800.0)
    assert still < beside.extreme(10_800.0) < along.extreme(10_800.0)
    assert along.extreme(10_800.0) == pytest.approx(still + 0.7, rel=1e-3)


def test_images_are_most_where_a_staircase_of_lagged_readings_jumps():
    """Against a sine that is read every 0.2 s and held, its rate behind two lags, step by step."""
    hold, slow, lag, count = 0.2, 0.8, 0.02, 2000
    time = np.arange(400 * count) * hold / count
    read = np.repeat(np.arange(400) * hold, count)
    smooth = np.sinc(slow * hold / (2.0 * math.pi)) * np.sin(slow * (time - 0.5 * hold))
    error = np.sin(slow * read) - smooth
    keep = math.exp(-hold / count / lag)
    once = lfilter([1.0 - keep], [1.0, -keep], error)
    twice = lfilter([1.0 - keep], [1.0, -keep], once)
    power = np.mean(((once - twice) / lag).reshape(-1, count)[10:] ** 2, axis=0)

    omega = image_frequencies(np.full(12, slow), hold)
    half = 0.5 * omega * hold
    held = np.sin(half) / half * np.exp(-1j * half)
    (found,) = crest((held * 1j * omega / (1.0 + 1j * omega * lag) ** 2)[np.newaxis])
    assert found == pytest.approx(math.sqrt(power.max() / power.mean()), rel=0.03)


@pytest.mark.parametrize("share", [0.5, 1.0])
def test_drag_keeps_the_largest_swings_of_a_resonance_down(share):
    """Against 600 oscillators with quadratic drag and linear damping, shaken by white noise."""
    rng, step, count, runs = np.random.default_rng(7), 0.05, 40_000, 600
    ratio, slope = 0.03, math.sqrt(8.0 / math.pi)
    linear = 2.0 * ratio * np.array([[1.0 - share], [1.0]])
    quadratic = 2.0 * ratio * np.array([[share], [0.0]]) / slope
    kick = math.sqrt(4.0 * ratio * step)  # of white noise that leaves a deviation of one
    x, v = rng.standard_normal((2, 2, runs))
    largest = np.zeros((2, runs))
    for k in range(count):
        v += step * (-x - (linear + quadratic * np.abs(v)) * v) + kick * rng.standard_normal(runs)
        x += step * v
        if k * step > 100.0:
            np.maximum(largest, np.abs(x), out=largest)
    dragged, gaussian = largest.mean(axis=1)
    assert dragged / gaussian == pytest.approx(swing(share, gaussian), rel=0.015)
    assert swing(share, gaussian) < 0.96


@pytest.mark.parametrize("rho", [1.0, 0.9, 0.3, -0.6])
def test_what_is_no_friction_of_drag_has_the_covariance_of_gaussian_pairs(rho):
    # |v| v has a kink in its slope: a fine rule by hand, as Gauss and Hermite's converges slowly.
    x = np.linspace(-8.0, 8.0, 1601)
    weights = np.exp(-0.5 * x**2) / math.sqrt(2.0 * math.pi) * (x[1] - x[0])

    def left(v):
        return np.abs(v) * v - math.sqrt(8.0 / math.pi) * v

    other = left(rho * x[:, np.newaxis] + math.sqrt(1.0 - rho**2) * x) @ weights
    found = remnant_of_drag(np.array([rho]))[0]
    assert found == pytest.approx((left(x) * other) @ weights, abs=1e-5)


def test_drag_that_is_no_friction_shakes_at_three_times_the_waves():
    """Of a drawn record of a narrow sea, by its periodograms."""
    rng, step, size = np.random.default_rng(3), 0.1, 2**13
    omega = 2.0 * math.pi * np.fft.rfftfreq(256 * size, step)
    density = np.exp(-0.5 * ((omega - 0.8) / 0.15) ** 2)
    density /= density.sum() * omega[1]
    drawn = rng.standard_normal((2, omega.size)).T @ [1.0, 1j]
    v = np.fft.irfft(drawn * np.sqrt(0.25 * density * omega[1]) * 256 * size)
    left = np.abs(v) * v - math.sqrt(8.0 / math.pi) * v
    frequency, power = welch(left, fs=1.0 / step, nperseg=size)
    at, found = density_of(remnant_of_drag(velocity_correlation(Moving(omega, density))))
    for low, high in ((0.5, 1.2), (1.8, 3.0), (3.2, 4.8)):
        seen = (2.0 * math.pi * frequency > low) & (2.0 * math.pi * frequency < high)
        told = (at > low) & (at < high)
        share = power[seen].sum() * frequency[1]
        assert found[told].sum() * at[1] == pytest.approx(share, rel=0.06)


class Moving:
    def __init__(self, omega, velocity):
        self._omega, self._velocity = omega, velocity

    def density(self, omega):
        return np.interp(omega, self._omega, self._velocity) / omega**2


def test_a_design_hears_its_own_drag(monkeypatch):
    case = load_case("subsea-crane").replace(
        {"sea.significant_height": 3.0, "payload.drag_coefficient": 3.0}
    )
    design = sh.evaluate_gains(case, {"a": 0.0, "a1": 0.1, "a2": 0.1}, "payload-feedback")
    element = next(one for one in design.assessment.elements if isinstance(one, DragElement))
    sigma = design.assessment.sigma(element.velocity)
    at, density = design.switched._drag_remnant
    whole = (3.0 - 8.0 / math.pi) * (element.quadratic * sigma**2) ** 2
    assert density.sum() * at[1] == pytest.approx(whole, rel=0.01)
    moved = design.switched.deviation("payload.displacement")
    monkeypatch.setattr("synth.design.switched.remnant_of_drag", np.zeros_like)
    still = replace(design).switched.deviation("payload.displacement")
    assert 1.002 < moved / still < 1.1
