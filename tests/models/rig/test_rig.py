"""Rope, payload, winch, sensors: what follows from the fields, against closed forms and tables."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models import InputError
from models.basics import GRAVITY
from models.rig import MRU, ACMotor, GainBounds, Gains, Payload, Rope, Sensors, Winch
from models.rig.payload import StochasticDrag
from models.rig.tables import (
    ADDED_MASS_PRISM,
    DRAG_COEFFICIENTS,
    DRUM_LAYERS,
    prism_added_mass,
)
from models.rig.winch import Drum
from models.sea.sea_section import Bretschneider1975Sea, JonswapSea
from models.vessel import HeaveTable

ROPE = {"diameter": "44 mm", "mass_per_length": 8.1, "length": 2000}
PAYLOAD = {
    "mass": "36.8 t",
    "added_mass": "36.8 t",
    "area": 20,
    "drag_coefficient": 1.05,
    "water_density": 1000,
    "submerged_weight": "314 kN",
}
AC = {
    "type": "ac",
    "torque_bandwidth": 150,
    "inertia": 20,
    "base_speed": "1000 rpm",
    "maximum_speed": "2000 rpm",
}
DC = {
    "type": "dc",
    "resistance": 0.074,
    "torque_constant": 5.8,
    "back_emf_constant": 5.8,
    "inertia": 98,
    "viscous_friction": 0.47,
}
DRIVE = {"torque_continuous": 8000, "torque_peak": "14.4 kN m"}


def winch(motor=AC, drive=DRIVE, **changes):
    parts = {
        "drum": {"radius": 1.0, "inertia": "40 t m2"},
        "gearbox": {"ratio": 100, "inertia": 2, "efficiency": 0.925},
        "motor": motor,
        "drive": drive,
    }
    return Winch.model_validate(parts | changes)


class TestRope:
    def test_modulus_and_axial_stiffness_are_two_ways_to_one_number(self):
        by_modulus = Rope(**ROPE, modulus="105 GPa")
        area = math.pi * 0.022**2
        assert by_modulus.ea == pytest.approx(105e9 * area)
        assert Rope(**ROPE, axial_stiffness=105e9 * area).ea == pytest.approx(by_modulus.ea)
        # The digest of the 1975 thesis: E A = 1.6e8 N is 105 GPa on the nominal circle.
        assert by_modulus.ea == pytest.approx(1.6e8, rel=0.01)

    def test_derived(self):
        rope = Rope(**ROPE, axial_stiffness="160 MN", submerged_weight_per_length=69.0)
        assert rope.stiffness == pytest.approx(80e3)
        assert rope.mass == pytest.approx(16.2e3)
        assert rope.submerged_weight == pytest.approx(138e3)
        # The digest's section 7: an axial wave takes 0.45 s over 2000 m.
        assert rope.travel_time == pytest.approx(0.45, abs=0.005)
        assert rope.wave_speed * rope.travel_time == pytest.approx(2000.0)

    def test_submerged_weight_defaults_to_steel_in_sea_water(self):
        rope = Rope(**ROPE, axial_stiffness=1.6e8)
        volume = 16.2e3 / 7850
        assert rope.submerged_weight == pytest.approx(GRAVITY * (16.2e3 - 1025 * volume))

    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            ({}, "Rope: give either modulus or axial_stiffness, got neither"),
            (
                {"modulus": 1e11, "axial_stiffness": 1e8},
                "Rope: give either modulus or axial_stiffness, got both",
            ),
            (
                {"modulus": 1e11, "lumping": "thesis", "masses": 3},
                "Rope: lumping: 'thesis' puts all of the rope at the payload: needs masses 1, "
                "got 3",
            ),
            (
                {"modulus": 1e11, "submerged_weight_per_length": 81},
                "Rope: submerged_weight_per_length: must be at most the weight in air, 79.43 N/m "
                "(8.1 kg/m), got 81 N/m",
            ),
        ],
    )
    def test_refused(self, changes, message):
        with pytest.raises(InputError) as caught:
            Rope(**ROPE, **changes)
        assert str(caught.value) == message


class TestPayload:
    def test_derived(self):
        payload = Payload(**PAYLOAD)
        assert payload.virtual_mass == pytest.approx(73.6e3)
        assert payload.quadratic_drag == pytest.approx(0.5 * 1000 * 1.05 * 20)
        assert payload.drag == StochasticDrag()
        assert payload.fixed_drag is None

    def test_drag_shape_is_table_4(self):
        fields = {key: value for key, value in PAYLOAD.items() if key != "drag_coefficient"}
        for shape, coefficient in DRAG_COEFFICIENTS.items():
            assert Payload(**fields, drag_shape=shape).c_d == coefficient
        assert sorted(DRAG_COEFFICIENTS.values()) == [0.38, 1.05, 1.17, 1.20, 1.42, 2.05, 2.30]

    def test_prism_is_table_a1(self):
        fields = {key: value for key, value in PAYLOAD.items() if key != "added_mass"}
        payload = Payload(**fields, shape={"prism_side": 2.0, "prism_height": 6.0})
        assert payload.hydrodynamic_mass == pytest.approx(0.62 * 1000 * 4 * 6)
        assert payload.virtual_mass == pytest.approx(36.8e3 + 0.62 * 1000 * 4 * 6)

    def test_both_and_neither_are_refused_together(self):
        fields = PAYLOAD | {"drag_shape": "disc"}
        del fields["added_mass"]
        with pytest.raises(InputError) as caught:
            Payload(**fields)
        assert str(caught.value).splitlines() == [
            "Payload: give either added_mass or shape, got neither",
            "Payload: give either drag_coefficient or drag_shape, got both",
        ]

    def test_mass_in_tonnes_without_unit_is_caught_by_the_weight(self):
        with pytest.raises(InputError) as caught:
            Payload(**PAYLOAD | {"mass": 36.8})
        assert str(caught.value) == (
            "Payload: submerged_weight: must be at most the weight in air, 360.9 N (36.8 kg), "
            "got 314000 N"
        )

    def test_prism_outside_the_table_is_refused(self):
        fields = {key: value for key, value in PAYLOAD.items() if key != "added_mass"}
        with pytest.raises(
            InputError, match=r"shape: prism_height / prism_side must be in \[1, 10"
        ):
            Payload(**fields, shape={"prism_side": 4, "prism_height": 3})


class TestDrag:
    def test_energy_drag_is_the_thesis_formula(self):
        payload = Payload(
            **PAYLOAD, drag={"method": "energy", "amplitude": "0.12 m", "frequency": "1.1 rad/s"}
        )
        formula = 4 / (3 * math.pi) * 1000 * 1.05 * 20 * 1.1 * 0.12
        assert payload.fixed_drag == pytest.approx(formula)
        # The digest, section 7: the C of the tables (zeta = 0.0070) belongs to 0.12 m.
        assert formula == pytest.approx(0.014 * math.sqrt(80e3 * 89.888e3), rel=0.02)

    def test_given_drag(self):
        payload = Payload(**PAYLOAD, drag={"method": "given", "coefficient": "1.2 kN s/m"})
        assert payload.fixed_drag == 1200.0


class TestTables:
    def test_added_mass_meets_every_entry(self):
        for ratio, factor in ADDED_MASS_PRISM:
            assert prism_added_mass(1.0, ratio, 1000.0) == pytest.approx(factor * 1000 * ratio)

    @given(st.floats(1.0, 10.0), st.floats(1.0, 10.0))
    def test_added_mass_factor_falls_with_slenderness(self, one, other):
        low, high = sorted((one, other))
        factors = [prism_added_mass(1.0, ratio, 1.0) / ratio for ratio in (low, high)]
        assert factors[1] <= factors[0] * (1 + 1e-12)
        assert 0.10 * (1 - 1e-9) <= factors[1] <= 2.32 * (1 + 1e-9)

    @pytest.mark.parametrize("ratio", [0.99, 10.1, math.nan])
    def test_added_mass_is_not_extrapolated(self, ratio):
        with pytest.raises(InputError, match=r"prism: height / side must be in \[1, 10\]"):
            prism_added_mass(1.0, ratio, 1000.0)


class TestDrum:
    def test_table_6_by_name(self):
        drum = Drum(layers="american-hoist-1000")
        # The digest, section 5: with 166 m left on the drum the rope lies in layer 2, 0.475 m.
        assert drum.radius_at(2000.0, 0.044) == pytest.approx(0.475)
        assert drum.radius_at(0.0, 0.044) == pytest.approx(0.89)
        assert drum.radius_at(2166.0, 0.044) == pytest.approx(0.435)
        # At the edge between two layers the inner one is full.
        assert drum.radius_at(2166.0 - 109.0, 0.044) == pytest.approx(0.435)
        assert drum.radius_at(2166.0 - 109.1, 0.044) == pytest.approx(0.475)

    def test_radius_overrides(self):
        drum = Drum(layers="american-hoist-1000", radius="0.413 m")
        assert drum.radius_at(2000.0, 0.044) == 0.413

    def test_geometry_reproduces_table_6(self):
        # Bare drum 0.826 m, 1.89 m long (the digest, section 5); 40 wraps are what Table 6
        # has, two less than fit.
        drum = Drum(geometry={"core_diameter": 0.826, "width": 1.89, "layers": 13, "wraps": 40})
        layers = drum.geometry.table(0.044)
        for layer, (pitch, length) in zip(layers, DRUM_LAYERS["american-hoist-1000"], strict=True):
            assert layer.pitch_diameter == pytest.approx(pitch, abs=0.006)
            assert layer.rope_on_drum == pytest.approx(length, rel=0.01)

    def test_geometry_fits_as_many_wraps_as_the_width_has_diameters(self):
        drum = Drum(geometry={"core_diameter": 1, "width": 2.2, "layers": 1})
        assert drum.geometry.table(0.05)[0].rope_on_drum == pytest.approx(math.pi * 1.05 * 44)

    def test_less_rope_than_the_layers_hold(self):
        drum = Drum(layers="american-hoist-1000", rope_on_drum_total=600)
        assert drum.radius_at(0.0, 0.044) == pytest.approx(1.17 / 2)
        assert drum.radius_at(500.0, 0.044) == pytest.approx(0.435)

    @given(st.floats(0, 2166), st.floats(0, 2166))
    def test_radius_never_grows_as_rope_is_paid_out(self, one, other):
        drum = Drum(layers="american-hoist-1000")
        few, many = sorted((one, other))
        assert drum.radius_at(many, 0.044) <= drum.radius_at(few, 0.044)

    def test_refused(self):
        drum = Drum(layers="american-hoist-1000")
        with pytest.raises(InputError) as caught:
            drum.radius_at(2500.0, 0.044)
        assert str(caught.value) == "the drum holds 2166 m of rope, less than the 2500 m paid out"
        with pytest.raises(
            InputError, match="must be at most what 13 layers hold, 2166 m, got 3000"
        ):
            Drum(layers="american-hoist-1000", rope_on_drum_total=3000).radius_at(1.0, 0.044)
        with pytest.raises(InputError, match=r"width must be at least the rope's diameter, 0\.3 m"):
            Drum(geometry={"core_diameter": 1, "width": 0.2, "layers": 2}).radius_at(1.0, 0.3)
        with pytest.raises(InputError, match="Drum: give one of radius, layers and geometry"):
            Drum(inertia=3)
        with pytest.raises(InputError, match="Drum: give either layers or geometry, got both"):
            Drum(
                layers="american-hoist-1000",
                geometry={"core_diameter": 1, "width": 2, "layers": 2},
            )
        with pytest.raises(
            InputError, match="Drum: layers: must be a list of layers or one of 'am"
        ):
            Drum(layers="american-hoist-2000")
        with pytest.raises(InputError, match="Drum: layers: must have at least 1 entry, got 0"):
            Drum(layers=[])

    def test_layers_must_grow(self):
        rows = [(1.0, 100), (1.1, 90), (1.1, 300)]
        layers = [{"pitch_diameter": d, "rope_on_drum": length} for d, length in rows]
        with pytest.raises(InputError) as caught:
            Drum(layers=layers)
        assert str(caught.value).splitlines() == [
            "Drum: layers[2].pitch_diameter: must grow from layer to layer, got 1.1 m then 1.1 m",
            "Drum: layers[1].rope_on_drum: must grow from layer to layer, got 100 m then 90 m",
        ]


class TestWinch:
    def test_inertia_and_friction_at_the_motor(self):
        assert winch().inertia == pytest.approx(20 + 2 + 40e3 / 100**2)
        assert winch(motor=DC, drive=DRIVE | {"speed": 100}).viscous_friction == 0.47

    def test_ac_limits(self):
        made = winch()
        assert made.torque_constant == 1.0
        assert made.speed_limit == pytest.approx(2000 * 2 * math.pi / 60)
        assert made.power_limit == pytest.approx(14400 * 1000 * 2 * math.pi / 60)
        stated = winch(drive=DRIVE | {"power": "1 MW", "speed": "1500 rpm"})
        assert stated.power_limit == 1e6
        assert stated.speed_limit == pytest.approx(50 * math.pi)

    def test_dc_limits(self):
        made = winch(motor=DC, drive=DRIVE | {"speed": "1200 rpm", "voltage": "805 V"})
        assert made.torque_constant == 5.8
        assert made.speed_limit == pytest.approx(40 * math.pi)
        assert made.power_limit == math.inf

    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            (
                {"motor": DC},
                "Winch: drive.speed: is missing: a DC motor needs its highest speed",
            ),
            (
                {"drive": DRIVE | {"speed": "3000 rpm"}},
                "Winch: drive.speed: must be at most the motor's maximum_speed, 209.44 rad/s, "
                "got 314.159 rad/s",
            ),
            (
                {"drive": DRIVE | {"voltage": 805, "current_peak": 3}},
                "Winch: drive.voltage: is for a DC motor only; an AC motor has none\n"
                "Winch: drive.current_peak: is for a DC motor only; an AC motor has none",
            ),
            (
                {"drive": {"torque_continuous": "8 kN m", "torque_peak": "7 kN m"}},
                "Winch: drive.torque_peak: must be at least torque_continuous, 8000 N m, "
                "got 7000 N m",
            ),
            (
                {"drive": DRIVE | {"current_continuous": 9, "current_peak": 8}},
                "Winch: drive.current_peak: must be at least current_continuous, 9 A, got 8 A",
            ),
            (
                {"motor": AC | {"maximum_speed": "900 rpm"}},
                "Winch: motor.maximum_speed: must be at least base_speed, 104.72 rad/s, "
                "got 94.2478 rad/s",
            ),
        ],
    )
    def test_refused(self, changes, message):
        fields = {
            "drum": {"radius": 1.0},
            "gearbox": {"ratio": 100},
            "motor": AC,
            "drive": DRIVE,
        }
        with pytest.raises(InputError) as caught:
            Winch(**fields | changes)
        assert str(caught.value) == message

    def test_ac_motor_by_itself(self):
        assert ACMotor(**AC).speed_gain == 0.0


class TestOtherSections:
    def test_thesis_peak_period_is_where_its_spectrum_peaks(self):
        sea = Bretschneider1975Sea(
            spectrum="bretschneider-1975", significant_height=2.43, significant_period=8.1
        )
        mean_period = 0.9 * 8.1
        nu = np.linspace(0.5, 1.5, 200001)
        spectrum = nu**-5 * np.exp(-0.675 * nu**-4)
        assert sea.spectral_peak_period == pytest.approx(
            mean_period / nu[np.argmax(spectrum)], rel=1e-4
        )

    def test_steepness(self):
        sea = JonswapSea(spectrum="jonswap", significant_height=4, peak_period=8)
        assert sea.steepness == pytest.approx(4 / (9.80665 * 64 / (2 * math.pi)))
        assert sea.breaking_steepness == pytest.approx(1 / 15)
        longer = JonswapSea(spectrum="jonswap", significant_height=4, peak_period=15)
        assert longer.breaking_steepness == pytest.approx(1 / 25)

    def test_rao_takes_mixed_units(self):
        rao = HeaveTable(omega=[0.5, "0.1 Hz"], amplitude=[1.0, "80 %"], phase=[0.1, "-90 deg"])
        assert rao.omega == (0.5, pytest.approx(0.2 * math.pi))
        assert rao.amplitude == (1.0, 0.8)
        assert rao.phase == (0.1, pytest.approx(-math.pi / 2))

    def test_gain_products(self):
        assert Gains(A=200, a=50, a1=100, a2=-1).products == (10000.0, 20000.0, -200.0)
        assert Gains(a=1, a1=2, a2=3).A == 1.0

    def test_gain_bounds(self):
        assert GainBounds(a=[-1, 1]).a == (-1.0, 1.0)
        with pytest.raises(InputError, match=r"GainBounds: a1: must be \[low, high\] with low < h"):
            GainBounds(a1=[1, 1])

    def test_sensors_default_to_perfect(self):
        sensors = Sensors()
        assert sensors.payload.bandwidth == "perfect"
        assert sensors.telemetry.delay == 0.0
        assert sensors.mru is None
        for section in (sensors.payload, sensors.telemetry):
            numbers = [value for value in dict(section).values() if isinstance(value, float)]
            assert len(numbers) >= 4
            assert set(numbers) == {0.0}


class TestReferenceUnit:
    def test_an_error_in_the_band_of_the_waves_keeps_its_meaning(self):
        assert (MRU().noise_floor, MRU().noise_fraction, MRU().coherent) == (0.05, 0.05, 0.0)
        assert MRU(noise_floor=0.02).noise_fraction == 0.05

    @given(
        gain=st.floats(0.0, 0.5),
        phase=st.floats(0.0, 0.5),
        drift=st.floats(0.0, 10.0),
        noise=st.floats(0.0, 1.0),
    )
    def test_a_stated_error_takes_the_place_of_the_other(self, gain, phase, drift, noise):
        given = {"gain_error": gain, "phase_error": phase, "drift": drift, "noise": noise}
        unit = MRU(**given)
        assert (unit.noise_floor, unit.noise_fraction) == (0.0, 0.0)
        assert unit.coherent == pytest.approx(abs(complex(gain, phase)))
        for name, value in given.items():
            assert MRU(**{name: value}).noise_floor == 0.0
            if value > 0.0:
                with pytest.raises(InputError, match=r"stated either .* got both$"):
                    MRU(**{name: value, "noise_floor": 0.05})

    @pytest.mark.parametrize(
        ("field", "value", "text"),
        [
            ("gain_error", "60 %", r"MRU: gain_error: must be a ratio in \[0, 0.5\], got '60 %'"),
            ("phase_error", "30 deg", r"must be an angle in \[0, 0.5\] rad, got '30 deg'"),
            ("phase_error", -0.01, r"must be an angle in \[0, 0.5\] rad, got -0.01"),
            ("drift", "11 m", r"must be a length in \[0, 10\] m, got '11 m'"),
            ("drift_period", 5, r"must be a time in \[10, 1000\] s, got 5"),
            ("noise", "1 m", r"must be a displacement noise density in \[0, 1\] m/sqrt\(Hz\)"),
            ("bandwidth", 0.5, r"must be a frequency in \[1, 1000\] rad/s, got 0.5"),
        ],
    )
    def test_refuses_in_one_sentence(self, field, value, text):
        with pytest.raises(InputError, match=text) as error:
            MRU(**{field: value})
        assert len(str(error.value).splitlines()) == 1
