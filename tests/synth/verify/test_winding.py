"""The winding number against loops whose stability is known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from models import load_case
from models.plant import LinearPlant, PlantData, build_plant, line_response
from synth.verify import LawMatrices, Loop, closed_matrices, winding_of_plant
from synth.verify.nyquist import curve_margins, largest
from synth.verify.recheck import closed_loop_marks
from synth.verify.winding import count_unstable, lively, open_loop_poles, trace, turn


@pytest.mark.parametrize(
    ("gain", "unstable"),
    # k e^{-s}/s is stable up to k = pi/2; each further pair crosses at k = pi/2 + 2 pi n.
    [(0.1, 0), (1.5, 0), (1.5705, 0), (1.5712, 2), (7.85, 2), (7.86, 4), (14.2, 6)],
)
def test_integrator_with_delay(gain: float, unstable: int) -> None:
    found = count_unstable(lambda s: 1 + gain * np.exp(-s) / s, poles=[0.0])
    assert not found.failure
    assert (found.unstable, found.marginal, found.open_loop) == (unstable, 0, 0)
    assert found.stable == (unstable == 0)


@pytest.mark.parametrize(("gain", "unstable"), [(1.99, 0), (2.01, 2)])
def test_third_order_loop_of_hurwitz(gain: float, unstable: int) -> None:
    # s^3 + 2 s^2 + s + k: stable for 0 < k < 2
    found = count_unstable(lambda s: 1 + gain / (s * (s + 1) ** 2), poles=[0.0, -1.0, -1.0])
    assert found.unstable == unstable


@pytest.mark.parametrize(("gain", "unstable"), [(0.99, 1), (1.01, 0), (50.0, 0)])
def test_unstable_open_loop_needs_an_encirclement(gain: float, unstable: int) -> None:
    found = count_unstable(lambda s: 1 + gain / (s - 1), poles=[1.0])
    assert (found.open_loop, found.unstable) == (1, unstable)


@pytest.mark.parametrize(("sign", "unstable"), [(1.0, 0), (-1.0, 2)])
def test_undamped_oscillator_is_indented(sign: float, unstable: int) -> None:
    # s^2 + 1 + sign (s + 1/10)
    found = count_unstable(lambda s: 1 + sign * (s + 0.1) / (s**2 + 1), poles=[1j, -1j])
    assert (found.unstable, found.marginal) == (unstable, 0)


def test_double_integrator_with_lead_is_stable() -> None:
    assert count_unstable(lambda s: 1 + (s + 1) / s**2, poles=[0.0, 0.0]).stable


def test_poles_on_the_axis_are_no_success() -> None:
    # s^2 + 1 = 0 from a double integrator; (s^2 + 4)/(s + 1)^2 has zeros at +-2i.
    for function, poles in (
        (lambda s: 1 + 1 / s**2, [0.0, 0.0]),
        (lambda s: (s**2 + 4) / (s + 1) ** 2, [-1.0, -1.0]),
    ):
        found = count_unstable(function, poles=poles)
        assert "lies on the contour" in found.failure
        assert not found.stable


def test_an_integrator_that_the_loop_does_not_see_stays() -> None:
    found = count_unstable(lambda s: 1 + 1 / (s + 1), poles=[0.0, -1.0])
    assert (found.unstable, found.marginal) == (0, 1)
    assert not found.stable


def test_an_unstable_mode_that_the_loop_does_not_see_stays() -> None:
    found = count_unstable(lambda s: 1 + 1 / (s + 1), poles=[0.3, -1.0])
    assert found.unstable == 1


def test_delayed_direct_path() -> None:
    # 1 + k e^{-s}: neutral, stable for k < 1; for k > 1 poles without end, and no count.
    assert count_unstable(lambda s: 1 + 0.5 * np.exp(-s), poles=[-1.0]).stable
    found = count_unstable(lambda s: 1 + 1.5 * np.exp(-s), poles=[-1.0])
    assert "does not fall off" in found.failure
    assert not found.stable


def test_undelayed_direct_path_ends_at_its_own_limit() -> None:
    # D = 1 + 5 (s + 2)/(s + 1) -> 6, stable; D = 1 - 5 (s + 2)/(s + 1) -> -4, zero at -9/4.
    up = count_unstable(lambda s: 1 + 5 * (s + 2) / (s + 1), poles=[-1.0], at_infinity=6.0)
    down = count_unstable(lambda s: 1 - 5 * (s + 2) / (s + 1), poles=[-1.0], at_infinity=-4.0)
    assert up.stable
    assert down.stable
    assert (
        count_unstable(
            lambda s: 1 - 0.9 * (s + 2) / (s + 1), poles=[-1.0], at_infinity=0.1
        ).unstable
        == 1
    )  # zero at s = 8


@pytest.mark.parametrize("width", [1e-3, 1e-6])
def test_a_narrow_resonance_is_not_stepped_over(width: float) -> None:
    # A mode at 3 rad/s in antiphase: unstable as soon as its residue is above its damping.
    def loop(residue: float):  # type: ignore[no-untyped-def]
        return lambda s: 1 - residue * s / (s**2 + 2 * width * s + 9.0) + 0.1 / (s + 1)

    poles = [complex(-width, 3.0), complex(-width, -3.0), -1.0]
    assert count_unstable(loop(1.7 * width), poles=poles).unstable == 0
    assert count_unstable(loop(2.3 * width), poles=poles).unstable == 2


def test_chains_of_integrators_come_out_as_exact_zeros() -> None:
    rng = np.random.default_rng(3)
    A = np.zeros((7, 7))
    A[0, 1] = A[1, 2] = A[2, 3] = 1.0  # three integrators that feed one another,
    A[3, 3] = -2.0  # driven by a lag,
    A[4, 5], A[5, 4] = 1.0, -9.0  # and an oscillator and a slow pole
    A[6, 6] = -1e-3
    turn = rng.standard_normal((7, 7))
    poles = open_loop_poles(turn @ A @ np.linalg.inv(turn))
    assert np.sum(poles == 0.0) == 3
    others = np.sort_complex(poles[poles != 0.0])
    np.testing.assert_allclose(others, [-2.0, -1e-3, -3j, 3j], atol=1e-9)
    # An eigenvalue solver by itself scatters them over both half planes.
    plain = np.linalg.eigvals(turn @ A @ np.linalg.inv(turn))
    assert np.sum(np.abs(plain) < 1e-12) < 3


def test_the_count_agrees_with_eigenvalues_on_random_loops() -> None:
    rng = np.random.default_rng(11)
    counts = []
    for _ in range(40):
        n, nu, ny = 5, int(rng.integers(1, 3)), 2
        A = rng.standard_normal((n, n)) - 0.5 * np.eye(n)
        plant = LinearPlant(
            A=A,
            B=rng.standard_normal((n, nu)),
            E=np.zeros((n, 1)),
            C=rng.standard_normal((ny, n)),
            delays=tuple(rng.uniform(0.0, 0.3, ny)),
        )
        law = LawMatrices(
            A=-np.eye(1) * rng.uniform(0.0, 2.0),
            B=rng.standard_normal((1, ny)),
            C=rng.standard_normal((nu, 1)),
            D=rng.standard_normal((nu, ny)),
        )
        found = winding_of_plant(plant, law)
        rational = plant.without_delays(12, at="measurements")
        poles = np.linalg.eigvals(closed_matrices(rational, law)[0])
        assert not found.failure
        assert found.unstable == int(np.sum(poles.real > 0.0))
        counts.append(found.unstable)
    assert len(set(counts)) >= 4  # a set that could not tell anything apart would prove nothing


def test_the_distributed_rope_is_counted_as_its_masses_are() -> None:
    case = load_case("thesis-1975-rope").replace({"rope.length": 500.0})
    data = PlantData.from_case(case)
    plant = build_plant(data, 30).linearise(drag=5000.0)
    poles = open_loop_poles(plant.A)
    assert np.sum(poles == 0.0) == 1  # the drum's angle
    counts = []
    for scale in (0.02, 0.3, 1.0):
        gains = scale * np.array([[10000.0, 20000.0, 20000.0]])
        law = LawMatrices(A=np.zeros((0, 0)), B=np.zeros((0, 3)), C=np.zeros((1, 0)), D=-gains)
        marks = closed_loop_marks(plant, law)
        rope = Loop(
            plant=plant,
            exact=lambda s, names: line_response(data, s, drag=5000.0, disturbances=names),
            law=law,
            marks=marks,
        )
        found = count_unstable(rope.difference, poles=[0.0], marks=marks)
        closed = np.linalg.eigvals(closed_matrices(plant, law)[0])
        assert found.unstable == int(np.sum(closed.real > 0.0))
        counts.append(found.unstable)
    assert counts[0] == 0
    assert counts[-1] > 0


def test_trace_follows_a_phase_through_many_turns() -> None:
    path = lambda s: np.exp(-40.0 * s), lambda t: 1j * t, np.array([0.0, 1.0])
    _, values = trace(*path)
    # Two points 40 rad apart look like 40 - 12 pi; every interval is cut, so nothing is lost.
    assert turn(*path) == pytest.approx(-40.0, abs=1e-9)
    assert np.all(np.abs(np.angle(values[1:] / values[:-1])) <= 0.5)


def test_trace_follows_a_small_loop_gain_too() -> None:
    # D = 1 + L never turns by 0.1 rad while L turns by 40; below the floor L may turn unseen.
    def path(t):  # type: ignore[no-untyped-def]
        return 1j * t

    for size, turned in ((0.05, True), (0.0005, False)):
        _, values = trace(
            lambda s, size=size: 1.0 + size * np.exp(-40.0 * s),
            path,
            np.linspace(0.0, 1.0, 5),
            loop_floor=1e-3,
        )
        steps = np.angle((values[1:] - 1.0) / (values[:-1] - 1.0))
        assert (np.abs(steps).max() <= 0.5) == turned
        assert (abs(steps.sum() + 40.0) < 1e-9) == turned


def test_gain_margin_of_a_small_loop_gain_that_turns_fast() -> None:
    # Around its peak of 0.3 at 10 rad/s the gain goes round the origin thirty times a decade.
    def loop(s):  # type: ignore[no-untyped-def]
        return 0.06 * s * np.exp(-40.0 * s) / (0.1 * s + 1.0) ** 2

    omega = np.linspace(5.0, 20.0, 600001)
    turned = loop(1j * omega)
    on_axis = (np.diff(np.sign(turned.imag)) != 0.0) & (turned.real[:-1] < 0.0)
    expected = 1.0 / np.abs(turned[:-1][on_axis]).max()
    margins = curve_margins(lambda s: 1.0 + loop(s), np.array([-10.0 + 0j]))
    assert margins.gain == pytest.approx(expected, rel=1e-6)


def test_lively_has_points_inside_every_resonance() -> None:
    omega = lively(0.01, 100.0, [complex(-1e-4, 2.0), complex(-1e-3, -7.0)])
    assert omega[0] == 0.01
    assert omega[-1] == 100.0
    assert np.all(np.diff(omega) > 0.0)
    for at, half_width in ((2.0, 1e-4), (7.0, 1e-3)):
        assert np.sum(np.abs(omega - at) <= half_width) >= 5


def test_a_faint_loop_has_a_gain_margin_too() -> None:
    # k/(s + 1)^3 crosses the axis at sqrt(3) rad/s, at -k/8.
    margins = curve_margins(lambda s: 1 + 8.0 / 3000.0 / (s + 1) ** 3, np.array([-1.0 + 0j]))
    assert margins.gain == pytest.approx(3000.0, rel=1e-9)


def test_margins_of_a_textbook_loop() -> None:
    # L = 1/(s (s + 1)^2): phase -180 deg at 1 rad/s, where |L| = 1/2.
    margins = curve_margins(lambda s: 1 + 1 / (s * (s + 1) ** 2), np.array([-1.0 + 0j]))
    assert margins.gain == pytest.approx(2.0, rel=1e-9)
    assert margins.gain_down == 0.0
    # |L| = 1 where w (1 + w^2) = 1
    crossover = 0.6823278038280193
    phase = np.pi / 2 - 2 * np.arctan(crossover)
    assert margins.phase == pytest.approx(phase, rel=1e-9)
    assert margins.delay == pytest.approx(phase / crossover, rel=1e-9)
    omega = np.linspace(0.4, 1.2, 200001)
    loop = 1 / (1j * omega * (1j * omega + 1) ** 2)
    assert margins.max_sensitivity == pytest.approx((1 / np.abs(1 + loop)).max(), rel=1e-8)
    assert margins.disk == pytest.approx(1 / np.abs(1 / (1 + loop) - 0.5).max(), rel=1e-8)


def test_margins_of_a_conditionally_stable_loop() -> None:
    # k (s + 1)^2/s^3 closes to s^3 + k (s + 1)^2, stable for k > 1/2: lower gain margin 1/(2k).
    margins = curve_margins(lambda s: 1 + 3 * (s + 1) ** 2 / s**3, np.array([-1.0 + 0j]))
    assert margins.gain == np.inf
    assert margins.gain_down == pytest.approx(1 / 6, rel=1e-9)


def test_a_resonance_that_just_crosses_unity_is_seen() -> None:
    width = 1e-4
    height = 1.0000001 * 2 * width

    def difference(s):  # type: ignore[no-untyped-def]
        return 1 + height * s / (s**2 + 2 * width * s + 1.0)

    poles = np.array([complex(-width, 1.0)])
    # |L| is above one in the hair's breadth around its peak of 1.0000001, where L is +1.
    assert curve_margins(difference, poles).phase == pytest.approx(np.pi, abs=2e-3)
    assert curve_margins(lambda s: 1 + (difference(s) - 1) * 0.9999, poles).phase == np.inf


@pytest.mark.parametrize("delay", [0.0, 0.1])
def test_curve_goes_through_infinity_at_undamped_poles(delay: float) -> None:
    """A spring and a damper around a mass on a spring: |S| = |4 - w^2| over the closed loop's."""

    def law(s):  # type: ignore[no-untyped-def]
        return (1.5 + 0.8 * s) * np.exp(-s * delay)

    poles = np.array([2.0j, -2.0j, -0.4 + 2.3j, -0.4 - 2.3j])
    margins = curve_margins(lambda s: 1 + law(s) / (s**2 + 4.0), poles)
    omega = np.linspace(0.01, 20.0, 400001)
    s = 1j * omega
    sensitivity = np.abs((4.0 - omega**2) / (4.0 - omega**2 + law(s)))
    assert margins.max_sensitivity == pytest.approx(sensitivity.max(), rel=1e-8)
    at = omega[:-1][np.diff(np.sign(np.abs(law(s)) - np.abs(4.0 - omega**2))) != 0.0]
    turn = np.angle(-law(1j * at) / (4.0 - at**2))
    assert margins.phase == pytest.approx(np.abs(turn).min(), abs=1e-4)
    assert margins.gain_down < 1e-6


def test_largest_finds_a_resonance_peak() -> None:
    zeta = 1e-3
    pole = complex(-zeta, np.sqrt(1 - zeta**2))

    def size(omega):  # type: ignore[no-untyped-def]
        return 1 / np.abs(1 - omega**2 + 2j * zeta * omega)

    peak = 1 / (2 * zeta * np.sqrt(1 - zeta**2))
    assert largest(size, 1e-3, 10.0, np.array([pole])) == pytest.approx(peak, rel=1e-10)
    assert largest(size, 1e-3, 0.5, np.array([pole])) == pytest.approx(size(0.5), rel=1e-12)
