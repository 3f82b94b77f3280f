"""The plant with all its sensors: each signal against the model that the simulation uses."""

from __future__ import annotations

import numpy as np
import pytest
from former_cases import load_case

from models import Case
from models.basics import InputError, White
from models.hook import HookMotion
from models.plant import PlantData, build_plant
from models.sensing import HEARD as SIMULATED
from models.sensing import (
    MEASURED,
    MruModel,
    SensorModel,
    sensed_plant,
    sensed_spectra,
    unit_response,
)
from models.sensing.plant import NOISES
from synth.loop import disturbances

OMEGA = np.array([0.05, 0.3, 1.0, 4.0, 11.0])
DRAG = 12_000.0


@pytest.fixture(scope="module")
def crane() -> Case:
    return load_case("subsea-crane").replace({"sensors.mru.heave_filter_period": 30.0})


def test_the_plant_inside_is_that_of_the_payload_sensors(crane: Case) -> None:
    plant, bare = sensed_plant(crane, drag=DRAG), build_plant(crane).linearise(drag=DRAG)
    n, w, y = len(bare.states), len(bare.disturbances), len(bare.measurements)
    assert plant.states[:n] == bare.states
    assert plant.outputs == bare.outputs
    for name, rows, columns in (
        ("A", n, n),
        ("B", n, 1),
        ("E", n, w),
        ("C", y, n),
        ("D", y, 1),
        ("F", y, w),
        ("Cz", len(bare.outputs), n),
        ("Dz", len(bare.outputs), 1),
        ("Fz", len(bare.outputs), w),
    ):
        inside = getattr(plant, name)[:rows]
        assert np.array_equal(inside[:, :columns], getattr(bare, name)), name
        if name in ("A", "C", "Cz"):
            assert not inside[:, columns:].any(), name  # no sensor acts on the plant
    assert plant.delays[:y] == bare.delays


def test_measurements_have_the_names_of_a_simulation() -> None:
    assert set(MEASURED) <= set(SIMULATED)


def test_reference_unit_shows_what_its_model_shows(crane: Case) -> None:
    response = sensed_plant(crane, drag=DRAG).response(OMEGA)
    unit = MruModel(mru=crane.sensors.mru, sample_time=0.01, heave_rms=0.5, seed=0)
    column = response.disturbances.index("hook.heave")
    heave, rate = (response.measurements.index(f"mru.{n}") for n in ("heave", "heave_rate"))
    wanted = unit_response(unit.mru, 1j * OMEGA)
    assert response.yw[:, heave, column] == pytest.approx(wanted, rel=1e-10)
    assert response.yw[:, rate, column] == pytest.approx(1j * OMEGA * wanted, rel=1e-10)
    assert np.abs(response.yu[:, [heave, rate]]).max() == 0.0  # the winch does not move the ship


def test_reference_unit_without_data_is_perfect() -> None:
    plant = sensed_plant(load_case("thesis-1975"), drag=DRAG)
    response = plant.response(OMEGA)
    column = response.disturbances.index("hook.heave")
    heave = plant.measurements.index("mru.heave")
    assert response.yw[:, heave, column] == pytest.approx(np.ones(OMEGA.size))


def test_each_noise_adds_to_its_own_measurement(crane: Case) -> None:
    response = sensed_plant(crane, drag=DRAG).response(OMEGA)
    late = dict(zip(response.measurements, sensed_plant(crane, drag=DRAG).delays, strict=True))
    for name in ("payload.velocity", "rope.tension"):
        column = response.disturbances.index(f"{name}_noise")
        row = response.measurements.index(name)
        only = np.exp(-1j * OMEGA * late[name])
        assert response.yw[:, row, column] == pytest.approx(only)
        others = np.delete(response.yw[:, :, column], row, axis=1)
        assert np.abs(others).max() == 0.0
    error = response.disturbances.index("mru.error")
    rate = response.measurements.index("mru.heave_rate")
    assert np.abs(response.yw[:, rate, error]) == pytest.approx(OMEGA)
    assert np.abs(response.zw[:, :, error]).max() == 0.0
    assert set(NOISES) - {"mru.error_rate"} <= set(response.disturbances)


def test_encoder_and_load_cell_show_the_outputs(crane: Case) -> None:
    response = sensed_plant(crane, drag=DRAG).response(OMEGA)
    assert crane.sensors.load_cell is not None
    b = crane.sensors.load_cell.bandwidth
    for name, law in (
        ("drum.haul", 1.0),
        ("motor.speed", 1.0),
        ("rope.tension", b / (1j * OMEGA + b)),
    ):
        y, z = response.measurements.index(name), response.outputs.index(name)
        assert response.yu[:, y, 0] == pytest.approx(response.zu[:, z, 0] * law, rel=1e-9)
        assert response.yw[:, y, 0] == pytest.approx(response.zw[:, z, 0] * law, rel=1e-9)


def test_tension_without_a_load_cell_is_the_output() -> None:
    response = sensed_plant(load_case("thesis-1975"), drag=DRAG).response(OMEGA)
    y, z = (names.index("rope.tension") for names in (response.measurements, response.outputs))
    assert response.yu[:, y, 0] == pytest.approx(response.zu[:, z, 0])


def test_plant_numbers_alone_take_the_sensors_as_given(crane: Case) -> None:
    data = PlantData.from_case(crane)
    same = sensed_plant(data, drag=DRAG, sensors=crane.sensors)
    assert same.delays == sensed_plant(crane, drag=DRAG).delays
    perfect = sensed_plant(data, drag=DRAG)
    assert perfect.delays[MEASURED.index("mru.heave")] == 0.0


def test_spectra_are_those_of_the_sensors() -> None:
    case = load_case("subsea-crane").replace(
        {"sensors.payload": {"bandwidth": "10 Hz", "velocity_noise": 0.002}}
    )
    hook = HookMotion.from_case(case)
    spectra = sensed_spectra(case, hook, sample_time=0.02)
    assert set(spectra) == {
        "drive.set_point",
        "hook.heave",
        "mru.error",
        "payload.velocity_noise",
        "rope.tension_noise",
    }
    # White noise of density N per root hertz behind the low-pass has the variance that the
    # simulation draws, N^2 b/(4 sqrt 2), whatever the sample time.
    omega = np.geomspace(1e-4, 1e5, 200_001)
    density = spectra["payload.velocity_noise"].density(omega)
    corner = 20.0 * np.pi
    assert density[0] == pytest.approx(0.002**2 / (2.0 * np.pi))
    assert np.allclose(density, density[0] / (1.0 + (omega / corner) ** 4), rtol=1e-9)
    variance = 0.002**2 * corner / (4.0 * np.sqrt(2.0))
    assert np.trapezoid(density, omega) == pytest.approx(variance, rel=1e-3)
    for sample_time in (0.005, 0.02):
        sensors = SensorModel.from_case(case, sample_time)
        assert sensors.noise_rms("velocity") ** 2 == pytest.approx(variance)
    tension = spectra["rope.tension_noise"].intensity / 0.02
    assert tension == pytest.approx((0.01 * case.static_tension) ** 2)
    omega = np.geomspace(1e-4, 1e3, 20_001)
    error = np.trapezoid(spectra["mru.error"](omega), omega)
    assert error == pytest.approx(0.05**2, rel=1e-3)  # 5 cm are more than 5 % of this heave
    plant = sensed_plant(case, drag=DRAG)
    assert len(disturbances(spectra, plant.independent_disturbances)) == 5


def test_noise_behind_the_low_pass_is_that_of_samples() -> None:
    case = load_case("subsea-crane").replace({"sensors.payload.noise_enters": "after-filter"})
    white = sensed_spectra(case, HookMotion.from_case(case))["payload.velocity_noise"]
    assert isinstance(white, White)
    variance = white.intensity / np.pi * (np.pi / 0.02)
    sensors = SensorModel.from_case(case, 0.02)
    assert variance == pytest.approx(sensors.noise_rms("velocity") ** 2)


def test_perfect_sensors_disturb_nothing() -> None:
    case = load_case("thesis-1975")
    assert list(sensed_spectra(case, HookMotion.from_case(case))) == ["hook.heave"]


def test_negative_drag_is_refused(crane: Case) -> None:
    with pytest.raises(InputError, match="drag"):
        sensed_plant(crane, drag=-1.0)
