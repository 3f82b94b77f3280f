"""What payload signals become on their way: filtered noise, held readings, late commands."""

from __future__ import annotations

import math

import control
import numpy as np
import pytest
from former_cases import load_case

from models import Case, InputError
from models.plant import LinearPlant
from models.sensing import (
    HEARD,
    MEASURED,
    MruModel,
    SensorModel,
    TelemetrySchedule,
    sensed_line_at,
    sensed_plant,
)
from models.sensing.sensing import RAW

OMEGA = np.array([0.05, 0.5, 1.5, 4.0])
NAMES = ("acceleration", "velocity", "displacement")
READ = {
    "sensors.payload.velocity_rate": "5 Hz",
    "sensors.payload.displacement_latency": "40 ms",
    "winch.drive.command_delay": "15 ms",
}


def shown(case: Case, sample_time: float, raw: np.ndarray, seed: int = 0) -> dict[str, np.ndarray]:
    """What a controller sees of raw signals (n, 8), by name."""
    model, n = SensorModel.from_case(case, sample_time), len(raw)
    link = TelemetrySchedule(case.sensors.telemetry, sample_time, seed)
    unit, still = MruModel(None, sample_time, 0.5, seed), np.zeros(n)
    block, _ = unit.block(unit.initial(0.0, 0.0), still, still)
    rows = model.rows(model.noise(seed, 0, n), link.block(0, n), block, np.zeros((n, 3)))
    series = model.function.mapaccum("series", n, 1)
    seen = series(model.initial(raw[0]), raw.T, rows.T, np.zeros((1, n)))[1]
    return dict(zip(HEARD, np.asarray(seen), strict=True))


@pytest.mark.parametrize("link", [None, "4 Hz"])
@pytest.mark.parametrize("sample_time", [0.005, 0.01, 0.02])
def test_noise_has_the_covariances_of_its_low_passes(sample_time: float, link: str | None) -> None:
    changes = {"sensors.telemetry.bandwidth": link, "sensors.encoder": None}
    case = load_case("subsea-crane").replace(changes)
    n = 60_000
    seen = shown(case, sample_time, np.zeros((n, len(RAW))))
    omega = np.linspace(0.0, 4000.0, 400_001)
    corners = [20.0 * np.pi, *([8.0 * np.pi] if link else [])]
    shape = np.prod([1.0 / (1.0 + (omega / corner) ** 4) for corner in corners], axis=0)
    for name in NAMES:
        values = seen[f"payload.{name}"][500:]
        density = getattr(case.sensors.payload, f"{name}_noise") ** 2 / (2.0 * np.pi) * shape
        for lag in (0, 1, 3):
            covariance = np.trapezoid(density * np.cos(omega * lag * sample_time), omega)
            size = np.trapezoid(density, omega)
            found = float(np.mean(values[lag:] * values[: len(values) - lag]))
            # A few samples are independent in each correlation time.
            error = size * math.sqrt(2.0 / (n * min(1.0, sample_time * corners[-1])))
            assert abs(found - covariance) < 4.0 * error, (name, lag)
        model = SensorModel.from_case(case, sample_time)
        assert model.noise_rms(name) ** 2 == pytest.approx(np.trapezoid(density, omega), rel=1e-4)


def test_a_reading_is_held_until_the_next_and_is_late_by_its_latency() -> None:
    silent = {f"sensors.payload.{name}_noise": 0.0 for name in NAMES}
    changes = {"sensors.telemetry.delay": 0.0, **silent, **READ}
    case = load_case("subsea-crane").replace(changes)
    raw, T = np.zeros((200, len(RAW))), 0.016
    t = T * np.arange(200)
    for i in range(3):
        raw[:, i] = 1.0 + t  # a ramp: it shows how old a value is
    seen = shown(case, T, raw)
    age = {name: 1.0 + t - seen[f"payload.{name}"] for name in NAMES}
    assert np.allclose(age["acceleration"], 0.0)
    assert np.allclose(age["displacement"][10:], 0.04)  # two and a half samples
    # Five readings a second, at the first sample from each fifth of a second on.
    taken = np.flatnonzero(age["velocity"] < 1e-9)
    assert taken.tolist() == [math.ceil(0.2 * k / T - 1e-9) for k in range(len(taken))]
    assert age["velocity"].max() < 0.2
    assert age["velocity"][13:188].mean() == pytest.approx(0.5 * (0.2 - T), abs=0.5 * T)


def test_noise_of_readings_is_that_of_their_rate() -> None:
    case = load_case("subsea-crane").replace(
        {"sensors.payload.velocity_rate": "5 Hz", "sensors.telemetry.delay": "40 ms"}
    )
    seen = shown(case, 0.02, np.zeros((50_000, len(RAW))))["payload.velocity"]
    # Independent readings of density N per root hertz up to half their rate: N^2 5/2.
    assert np.std(seen) == pytest.approx(0.002 * math.sqrt(2.5), rel=0.03)
    changes = np.flatnonzero(np.diff(seen))
    assert np.diff(changes).min() >= 10


def test_responses_are_those_of_a_hold_and_its_delays() -> None:
    case = load_case("subsea-crane")
    plain, late = (sensed_plant(c, drag=1e4).response(OMEGA) for c in (case, case.replace(READ)))
    s = 1j * OMEGA
    hold = (1.0 - np.exp(-0.2 * s)) / (0.2 * s)
    further = {"payload.velocity": hold, "payload.displacement": np.exp(-0.04 * s)}
    for name in MEASURED:
        k = MEASURED.index(name)
        factor = (np.exp(-0.015 * s) * further.get(name, 1.0))[:, None]
        assert np.allclose(late.yu[:, k], plain.yu[:, k] * factor, rtol=1e-12, atol=0.0)
        assert np.allclose(late.yw[:, k], plain.yw[:, k] * factor, rtol=1e-12, atol=1e-15)
    assert np.array_equal(late.zu, plain.zu)


def test_the_exact_line_has_the_same_holds_and_delays() -> None:
    case = load_case("subsea-crane")
    first, second = (sensed_line_at(c, 1j * OMEGA, drag=1e4) for c in (case, case.replace(READ)))
    plain, late = (sensed_plant(c, drag=1e4).response(OMEGA) for c in (case, case.replace(READ)))
    for k in range(len(MEASURED)):
        heave = (slice(None), k, 0)
        if np.all(plain.yw[heave]):
            factor = late.yw[heave] / plain.yw[heave]
            assert np.allclose(second.yw[heave], first.yw[heave] * factor, rtol=1e-12)
    noise = second.disturbances.index("payload.velocity_noise")
    ratio = second.yw[:, 1, noise] / first.yw[:, 1, noise]
    assert np.allclose(ratio, late.yw[:, 1, 0] / plain.yw[:, 1, 0], rtol=1e-12)


def test_margins_with_a_rational_hold_are_those_of_the_exact_one() -> None:
    # An integrator behind a reading of 5 a second: python-control on the rational model against
    # the exact curve -k e^{-0.03 s} (1 - e^{-0.2 s})/(0.2 s^2).
    plant = LinearPlant(A=[[0.0]], B=[[1.0]], E=[[0.0]], C=[[1.0]], delays=[0.13], holds=[0.2])
    rational = plant.to_control(pade_order=6)[0, 0]
    gain, phase, at, _ = control.margin(2.0 * rational)
    omega = np.linspace(1.0, 20.0, 1_900_001)
    curve = plant.response(omega).yu[:, 0, 0]
    turned = np.unwrap(np.angle(curve))
    crossing = int(np.argmin(np.abs(turned + np.pi)))
    assert omega[crossing] == pytest.approx(at, rel=2e-3)
    assert gain == pytest.approx(0.5 / abs(curve[crossing]), rel=3e-3)
    level = int(np.argmin(np.abs(np.abs(2.0 * curve) - 1.0)))
    assert phase == pytest.approx(180.0 + np.degrees(turned[level]), abs=0.01)
    # Its phase is that of a delay of half the period: 2 * 0.13 rad at about 2 rad/s.
    assert turned[level] == pytest.approx(-0.5 * np.pi - 0.13 * omega[level], rel=1e-9)


def test_a_hold_longer_than_twice_the_delay_is_refused() -> None:
    with pytest.raises(InputError, match=r"delay of y1 must be at least 0\.1"):
        LinearPlant(A=[[0.0]], B=[[1.0]], E=[[0.0]], C=[[1.0]], delays=[0.05], holds=[0.2])
