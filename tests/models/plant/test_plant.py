"""The nonlinear plant: statics, Jacobians, power balance, and the 1975 thesis's closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from former_cases import load_case
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from plant_numbers import (
    MODERN,
    THESIS,
    THESIS_DRAG,
    THESIS_FEEDBACK,
    THESIS_GAINS,
    closed_loop,
    closed_loop_poles,
    thesis_numbers,
    thesis_transfer,
)

from models import bundled_cases
from models.basics import InputError, SolverError
from models.plant import PlantData, build_plant, fixed_top_modes
from models.plant.plant_data import as_plant_data
from models.sensing import with_sensors

OMEGA = np.geomspace(0.05, 30.0, 60)
ROPE = replace(THESIS, lumping="distributed", masses=5, damping_ratio=0.01)
RIG = {"tip_stiffness": 3e6, "sling_stiffness": 5e6, "block_mass": 4e3, "block_weight": 34e3}
VARIANTS = {
    "thesis": THESIS,
    "rope": ROPE,
    "one third": replace(ROPE, masses=1),
    "dc with inductance": replace(ROPE, inductance=0.004, sensor_bandwidth=30.0),
    "modern": MODERN,
    "sheaves": replace(MODERN, sheaves_efficiency=0.9),
    "torque mode": replace(MODERN, speed_gain=0.0, telemetry_bandwidth=math.inf),
    "ideal drive": replace(MODERN, torque_bandwidth=math.inf, sensor_bandwidth=math.inf),
    "tip": replace(MODERN, tip_stiffness=3e6),
    "rig": replace(MODERN, **RIG),
    "rig, hysteretic": replace(MODERN, **RIG, damping_law="hysteretic", damping_ratio=0.02),
    "rig, one mass": replace(THESIS, **RIG),
}
every_variant = pytest.mark.parametrize("data", VARIANTS.values(), ids=VARIANTS.keys())


def numbers(values: object) -> list[np.ndarray]:
    return [np.asarray(v, dtype=float) for v in values]  # type: ignore[attr-defined]


# ---- at rest


@every_variant
def test_operating_point_holds_the_load(data: PlantData) -> None:
    plant = build_plant(data)
    rest = plant.operating_point()
    tension = data.payload_weight + data.block_weight + data.rope_weight * data.rope_length
    assert rest.residual < 1e-12
    assert rest.tension == pytest.approx(tension, rel=1e-9)
    tension /= data.sheaves_efficiency  # hauled over the sheaves
    assert rest.outputs["rope.tension"] == pytest.approx(tension, rel=1e-9)
    torque = tension * data.drum_radius / (data.gear_ratio * data.gear_efficiency)
    assert rest.torque == pytest.approx(torque, rel=1e-9)
    if data.motor == "dc":
        command = torque / data.torque_constant * data.resistance
    else:
        command = torque / data.speed_gain if data.speed_gain else torque
    assert rest.command == pytest.approx(command, rel=1e-9)
    own_state = [n for n in ("motor.current", "motor.torque") if n in plant.states]
    still = [i for i, name in enumerate(plant.states) if name not in own_state]
    np.testing.assert_allclose(rest.x[still], 0.0, atol=1e-9)


def test_static_elongation_tends_to_that_of_a_hanging_rope() -> None:
    exact = (
        THESIS.payload_weight * THESIS.rope_length + 0.5 * THESIS.rope_weight * 2000.0**2
    ) / THESIS.axial_stiffness
    errors = []
    for n in (5, 10, 20):
        lumps = build_plant(replace(ROPE, masses=n)).lumps
        carried = THESIS.payload_weight + THESIS.rope_weight * 2000.0 * lumps.hanging
        elongations = carried * 2000.0 * lumps.springs / THESIS.axial_stiffness
        assert elongations.shape == (n,)
        errors.append(abs(elongations.sum() - exact))
    # pieces of rope are 1/(n - 1/2) long, and the rule is of second order
    assert errors[0] / errors[1] == pytest.approx((9.5 / 4.5) ** 2, rel=0.01)
    assert errors[1] / errors[2] == pytest.approx((19.5 / 9.5) ** 2, rel=0.01)


def test_gear_helps_to_lower_and_hinders_to_haul() -> None:
    plant = build_plant(MODERN)
    torque = {
        d: plant.operating_point({"winch.gear_direction": d}).torque for d in (-1.0, 0.0, 1.0)
    }
    ideal = MODERN.static_tension * MODERN.drum_radius / MODERN.gear_ratio
    assert torque[1.0] == pytest.approx(ideal / 0.925)
    assert torque[-1.0] == pytest.approx(ideal * 0.925)
    assert torque[0.0] == pytest.approx(ideal * MODERN.mean_gear_factor)


def test_sheaves_carry_to_the_drum_what_switches_with_the_gear() -> None:
    data = replace(MODERN, sheaves_efficiency=0.97**4)
    plant, ideal = build_plant(data), MODERN.static_tension
    turned = MODERN.drum_radius / MODERN.gear_ratio
    for direction, over in ((1.0, 0.97**-4), (-1.0, 0.97**4)):
        rest = plant.operating_point({"winch.gear_direction": direction})
        assert rest.tension == pytest.approx(ideal)
        assert rest.outputs["rope.tension"] == pytest.approx(ideal * over)
        assert rest.torque == pytest.approx(ideal * over * turned * 0.925**-direction)
        assert rest.outputs["rope.lower_tension"] == pytest.approx(MODERN.payload_weight)
    linear, eta = plant.linearise(drag=1e4), 0.925 * 0.97**4
    assert linear.static["rope.tension"] == pytest.approx(ideal * (0.97**4 + 0.97**-4) / 2)
    assert linear.loss["rope.tension"] == pytest.approx(ideal * (0.97**-4 - 0.97**4) / 2)
    assert linear.static["motor.torque"] == pytest.approx(ideal * turned * (eta + 1 / eta) / 2)
    assert linear.loss["motor.torque"] == pytest.approx(ideal * turned * (1 / eta - eta) / 2)


def test_every_piece_of_rope_has_its_own_skin_drag() -> None:
    per_length = 0.8
    data = replace(MODERN, skin_drag=per_length)
    lumped = replace(data, quadratic_drag=MODERN.quadratic_drag + data.lumped_skin_drag)
    assert lumped.payload_drag == pytest.approx(MODERN.quadratic_drag, rel=1e-12)
    plain, plant, rng = build_plant(MODERN), build_plant(lumped), np.random.default_rng(1)
    x = plain.operating_point().x + 0.1 * rng.standard_normal(len(plain.states))
    shares = plain.lumps.masses * data.rope_length
    masses = data.mass_per_length * shares
    masses[-1] += data.payload_mass
    still = np.zeros(4)
    a, b = (
        np.asarray(p.function(x, 0.0, still, p.parameter_vector())[0]).ravel()
        for p in (plain, plant)
    )
    found = dict(zip(plain.states, b - a, strict=True))
    names = [*(f"rope.{j + 1}.velocity" for j in range(data.masses - 1)), "payload.velocity"]
    for name, share, mass in zip(names, shares, masses, strict=True):
        v = x[plain.states.index(name)]
        force = -per_length * share * abs(v) * v
        assert found.pop(name) == pytest.approx(force / mass, rel=1e-9)
    assert max(map(abs, found.values())) == 0.0
    # At rest its slope is nothing: a linear plant has it in the coefficient that it is given.
    with_skin, without = (p.linearise(drag=1e4).A for p in (plant, plain))
    np.testing.assert_allclose(with_skin, without, rtol=1e-12)


def test_gear_direction_can_follow_the_motor() -> None:
    plant = build_plant(MODERN)
    p = plant.parameter_vector({"winch.gear_switching": 50.0})
    speed = plant.states.index("motor.speed")
    ideal = MODERN.static_tension * MODERN.drum_radius / MODERN.gear_ratio
    for turn, factor in ((1.0, 1.0 / 0.925), (-1.0, 0.925)):
        x = plant.operating_point().x.copy()
        x[speed] = turn
        # without it the turning drum would add the rope's damping force to the static one
        p[list(plant.parameters).index("rope.damping_time")] = 0.0
        x[plant.states.index("motor.torque")] = 0.0
        xdot = np.asarray(plant.function(x, 0.0, np.zeros(4), p)[0]).ravel()
        load = -xdot[speed] * MODERN.inertia - MODERN.viscous_friction * turn
        assert load == pytest.approx(ideal * factor, rel=1e-9)


def test_static_values_travel_with_the_linear_plant() -> None:
    plant = build_plant(MODERN).linearise(drag=1e4)
    assert plant.static["rope.tension"] == pytest.approx(MODERN.static_tension)
    ideal = MODERN.static_tension * MODERN.drum_radius / MODERN.gear_ratio
    mean, loss = 0.5 * ideal * (1.0 / 0.925 + 0.925), 0.5 * ideal * (1.0 / 0.925 - 0.925)
    assert plant.static["motor.torque"] == pytest.approx(mean)
    assert plant.static["drive.command"] == pytest.approx(mean / MODERN.speed_gain)
    assert dict(plant.loss) == pytest.approx({"motor.torque": loss, "motor.current": loss})
    heard = with_sensors(plant, load_case("subsea-crane").sensors, 0.0)
    assert heard.select(outputs=["motor.torque"]).loss == {
        "motor.torque": plant.loss["motor.torque"]
    }
    dry = build_plant(replace(MODERN, coulomb_friction=60.0)).linearise(drag=1e4)
    assert dry.static == pytest.approx(plant.static)
    assert dry.loss["motor.torque"] == pytest.approx(loss + 60.0)
    before = build_plant(replace(MODERN, coulomb_friction=60.0, switching=False))
    assert before.linearise(drag=1e4).static["motor.torque"] == pytest.approx(ideal / 0.925)
    assert not before.linearise(drag=1e4).loss
    assert plant.units["rope.tension"] == "N"
    assert plant.units["drive.command"] == "rad/s"
    assert set(plant.units) >= {*plant.states, *plant.inputs, *plant.outputs}
    assert plant.delays == (0.03,) * 3


def test_an_impossible_operating_point_is_said() -> None:
    plant = build_plant(THESIS)
    with pytest.raises(SolverError, match="operating point was found: nothing holds the load"):
        plant.operating_point({"motor.torque_constant": 0.0})


# ---- derivatives


@every_variant
def test_jacobians_agree_with_central_differences(data: PlantData) -> None:
    plant = build_plant(data)
    rng = np.random.default_rng(3)
    rest = plant.operating_point()
    p = plant.parameter_vector({"payload.linear_drag": 800.0, "winch.gear_switching": 0.3})
    for point in (rest.x, rest.x + 0.05 * rng.normal(size=rest.x.size)):
        at = [point, rest.u, 0.01 * rng.normal(size=4)]
        blocks = numbers(plant.jacobians(*at, p))
        for k in range(3):  # with respect to x, u, w
            for j in range(at[k].size):
                step = 1e-5  # |v|v at rest: the difference quotient is off by q step / M
                ends = []
                for sign in (1.0, -1.0):
                    moved = [v.copy() for v in at]
                    moved[k][j] += sign * step
                    ends.append([v.ravel() for v in numbers(plant.function(*moved, p))])
                for row, (up, down) in enumerate(zip(*ends, strict=True)):
                    wanted = (up - down) / (2.0 * step)
                    scale = max(1.0, np.abs(blocks[3 * row + k]).max())
                    np.testing.assert_allclose(blocks[3 * row + k][:, j], wanted, atol=4e-6 * scale)


def test_sensitivity_to_a_parameter_comes_by_automatic_differentiation() -> None:
    plant = build_plant(MODERN)
    x, u, w, p = (
        ca.SX.sym(c, n)
        for c, n in (("x", len(plant.states)), ("u", 1), ("w", 4), ("p", len(plant.parameters)))
    )
    A = plant.jacobians(x, u, w, p)[0]
    slope = ca.Function("slope", [x, u, w, p], [ca.jacobian(ca.vec(A), p)])
    rest = plant.operating_point()
    j = list(plant.parameters).index("rope.axial_stiffness")
    value = plant.parameters["rope.axial_stiffness"]
    got = np.asarray(slope(rest.x, rest.u, np.zeros(4), rest.p))[:, j]
    n = len(plant.states)
    up, down = (
        plant.linearise(drag=0.0, parameters={"rope.axial_stiffness": value * (1 + h)}).A
        for h in (1e-4, -1e-4)
    )
    # the parameter vector of the operating point has the gear hauling; rows of the motor's
    # speed differ by that factor and are left out
    keep = [i for i in range(n) if i != plant.states.index("motor.speed")]
    wanted = (up - down)[keep] / (2e-4 * value)
    got_matrix = got.reshape((n, n), order="F")[keep]
    np.testing.assert_allclose(got_matrix, wanted, atol=1e-6 * np.abs(wanted).max())


def test_linear_drag_enters_as_a_damper() -> None:
    plant = build_plant(ROPE)
    v = plant.states.index("payload.velocity")
    more = plant.linearise(drag=2000.0).A - plant.linearise(drag=0.0).A
    mass = ROPE.payload_mass + ROPE.rope_mass * plant.lumps.masses[-1]
    assert more[v, v] == pytest.approx(-2000.0 / mass)
    more[v, v] = 0.0
    np.testing.assert_allclose(more, 0.0, atol=1e-12)


# ---- power


@pytest.mark.parametrize("masses", [1, 2, 7])
def test_power_in_is_energy_stored_plus_losses(masses: int) -> None:
    """Kinetic, elastic and gravity energy against every force that does work (ideal gear)."""
    data = replace(ROPE, masses=masses, damping_ratio=0.05)
    plant = build_plant(data)
    lumps, n = plant.lumps, masses
    rng = np.random.default_rng(11)
    for _ in range(5):
        x = 0.2 * rng.normal(size=len(plant.states))
        u, w = rng.normal(size=1), np.array([0.3, 0.2, 900.0, 0.5]) * rng.normal(size=4)
        xdot, _, z = numbers(plant.function(x, u, w, plant.parameter_vector()))
        rates, out = dict(zip(plant.states, xdot.ravel(), strict=True)), {}
        out = dict(zip(plant.outputs, z.ravel(), strict=True))
        h = data.drum_radius / data.gear_ratio
        omega = x[1]
        pos = np.append(h * x[0] + w[0], x[2 : 2 + n])
        vel = np.append(h * omega + w[1], x[2 + n : 2 + 2 * n])
        acc = [rates[name] for name in plant.states[2 + n : 2 + 2 * n]]
        mass = data.rope_mass * lumps.masses + np.eye(n)[-1] * data.payload_mass
        weight = data.rope_weight * data.rope_length * lumps.masses
        weight[-1] += data.payload_weight
        k = data.stiffness / lumps.springs
        static = data.payload_weight + data.rope_weight * data.rope_length * lumps.hanging
        stretch, stretching = pos[:-1] - pos[1:], vel[:-1] - vel[1:]
        loss = k * data.damping_time * stretching**2
        stored = (
            data.inertia * omega * rates["motor.speed"]
            + np.sum(mass * vel[1:] * acc)
            + np.sum((static + k * stretch) * stretching)
            + np.sum(weight * vel[1:])
            + data.rope_weight * data.rope_length * lumps.at_drum * vel[0]
        )
        v = vel[-1]
        power = (
            out["motor.torque"] * omega
            - data.viscous_friction * omega**2
            + out["rope.tension"] * w[1]
            + w[2] * v
            - data.quadratic_drag * abs(v) * v**2
            - loss.sum()
        )
        assert stored == pytest.approx(power, rel=1e-9)


def test_drag_opposes_motion_either_way() -> None:
    plant = build_plant(THESIS)
    mass = THESIS.payload_mass + THESIS.rope_mass
    for v in (0.5, -0.5):
        x = np.array([0.0, 0.0, 0.0, v])
        xdot = np.asarray(plant.function(x, 0.0, np.zeros(4), plant.parameter_vector())[0])
        assert float(xdot[3, 0]) == pytest.approx(-10_500.0 * abs(v) * v / mass)


def test_rope_goes_slack_and_never_pushes() -> None:
    plant = build_plant(ROPE)
    tension = plant.outputs.index("rope.tension")
    p = plant.parameter_vector()
    x = np.zeros(len(plant.states))
    for drop in (-2.0, -5.0):  # the upper end falls by more than the rope's stretch at rest
        xdot, _, z = numbers(plant.function(x, 0.0, [drop, 0.0, 0.0, 0.0], p))
        assert z[tension, 0] == 0.0
    # the uppermost mass then falls under what hangs below it, the payload does not know yet
    fall = dict(zip(plant.states, xdot.ravel(), strict=True))
    assert fall["rope.1.velocity"] < -50.0
    assert fall["payload.velocity"] == pytest.approx(0.0, abs=1e-9)
    lifted = [plant.states.index(f"rope.{j}.displacement") for j in (1, 2, 3, 4)]
    x[[*lifted, plant.states.index("payload.displacement")]] = [5.0, 10.0, 15.0, 20.0, 25.0]
    xdot, _, z = numbers(plant.function(x, 0.0, np.zeros(4), p))
    mass = ROPE.payload_mass + ROPE.rope_mass * plant.lumps.masses[-1]
    weight = ROPE.payload_weight + 69.06 * 2000.0 * plant.lumps.masses[-1]
    assert xdot[plant.states.index("payload.velocity"), 0] == pytest.approx(-weight / mass)


# ---- signals


def test_names_are_the_public_ones() -> None:
    plant = build_plant(MODERN).linearise(drag=0.0)
    assert plant.inputs == ("drive.command",)
    assert plant.disturbances == (
        "hook.heave",
        "hook.heave_rate",
        "payload.force",
        "drive.set_point",
    )
    assert plant.measurements == (
        "payload.acceleration",
        "payload.velocity",
        "payload.displacement",
    )
    assert plant.outputs == (
        "payload.displacement",
        "payload.velocity",
        "payload.acceleration",
        "drum.haul",
        "motor.torque",
        "motor.speed",
        "motor.current",
        "rope.tension",
        "rope.lower_tension",
    )
    assert build_plant(THESIS).outputs[-1] == "motor.voltage"
    np.testing.assert_array_equal(plant.E[:, 3], plant.B[:, 0])


@every_variant
def test_derivatives_of_signals_are_consistent(data: PlantData) -> None:
    r = build_plant(data).linearise(drag=3e3).response(OMEGA)
    s = 1j * OMEGA[:, None]
    z = {name: r.zw[:, i] for i, name in enumerate(r.outputs)}
    np.testing.assert_allclose(z["payload.velocity"], s * z["payload.displacement"], rtol=1e-7)
    np.testing.assert_allclose(
        z["payload.acceleration"], s**2 * z["payload.displacement"], rtol=1e-6
    )
    haul = data.drum_radius / data.gear_ratio * z["motor.speed"]
    np.testing.assert_allclose(haul, s * z["drum.haul"], rtol=1e-7)


def test_sensors_are_butterworth_filters_and_a_delay() -> None:
    r = build_plant(MODERN).linearise(drag=3e3).response(OMEGA)
    s = 1j * OMEGA
    shown = np.exp(-0.03 * s)
    for b in (MODERN.sensor_bandwidth, MODERN.telemetry_bandwidth):
        shown = shown * b**2 / (s**2 + math.sqrt(2.0) * b * s + b**2)
    for i, name in enumerate(r.measurements):
        row = r.outputs.index(name)
        np.testing.assert_allclose(r.yw[:, i], shown[:, None] * r.zw[:, row], rtol=1e-6)
        np.testing.assert_allclose(r.yu[:, i], shown[:, None] * r.zu[:, row], rtol=1e-6)


def test_small_inductance_is_none_at_low_frequency() -> None:
    plain = build_plant(ROPE).linearise(drag=3e3).response(OMEGA)
    coil = build_plant(replace(ROPE, inductance=1e-7)).linearise(drag=3e3).response(OMEGA)
    np.testing.assert_allclose(coil.zu, plain.zu, rtol=1e-3)
    assert (
        len(build_plant(replace(ROPE, inductance=1e-7)).states) == len(build_plant(ROPE).states) + 1
    )


def test_speed_mode_follows_its_reference_slowly_enough() -> None:
    plant = build_plant(replace(MODERN, speed_gain=1e6)).linearise(drag=3e3)
    r = plant.response([0.5])
    assert r.zu[0, r.outputs.index("motor.speed"), 0] == pytest.approx(1.0, abs=2e-3)


def test_drum_locked_the_plant_has_the_modes_of_the_rope() -> None:
    data = replace(ROPE, masses=20, inertia=1e15, damping_ratio=0.03)
    poles = build_plant(data).linearise(drag=0.0).poles()
    ringing = poles[np.argsort(np.abs(poles))]
    first = ringing[ringing.imag > 1e-3][0]
    exact = fixed_top_modes(1.6e8, 2000.0, 8.1, THESIS.payload_mass, 2)
    assert abs(first) == pytest.approx(exact[0], rel=1e-3)
    assert -first.real / abs(first) == pytest.approx(0.03, rel=1e-3)
    second = ringing[ringing.imag > 1e-3][1]
    assert abs(second) == pytest.approx(exact[1], rel=3e-3)
    assert -second.real / abs(second) == pytest.approx(0.03 * exact[1] / exact[0], rel=1e-2)


# ---- the 1975 thesis


def test_thesis_lumping_is_the_closed_form() -> None:
    plant = build_plant(THESIS).linearise(drag=THESIS_DRAG)
    got = closed_loop(plant, THESIS_FEEDBACK, OMEGA)
    wanted = thesis_transfer(OMEGA, **thesis_numbers(THESIS, THESIS_DRAG), **THESIS_GAINS)
    np.testing.assert_allclose(got["payload.displacement/hook.heave"], wanted["T"], rtol=1e-9)
    np.testing.assert_allclose(got["drum.haul/hook.heave"], wanted["T_2"], rtol=1e-9)
    # T_1 is to the command ahead of the amplifier, the set-point comes after it
    set_point = 200.0 * got["payload.displacement/drive.set_point"]
    np.testing.assert_allclose(set_point, wanted["T_1"], rtol=1e-9)


@given(
    damping=st.floats(0.0, 0.3),
    A=st.floats(1.0, 400.0),
    a=st.floats(-20.0, 80.0),
    a1=st.floats(-50.0, 200.0),
    a2=st.floats(0.1, 300.0),
    radius=st.floats(0.2, 2.0),
    stiffness=st.floats(0.2, 5.0),
    inertia=st.floats(20.0, 500.0),
)
@hypothesis_settings(max_examples=25)
def test_thesis_closed_form_holds_for_any_numbers(
    damping: float,
    A: float,
    a: float,
    a1: float,
    a2: float,
    radius: float,
    stiffness: float,
    inertia: float,
) -> None:
    data = replace(THESIS, drum_radius=radius, axial_stiffness=1.6e8 * stiffness, inertia=inertia)
    drag = 2.0 * damping * math.sqrt(data.stiffness * 89_888.0)
    plant = build_plant(data).linearise(drag=drag)
    omega = np.array([0.1, 0.7, 3.0, 11.0])
    gains = {"A": A, "a": a, "a1": a1, "a2": a2}
    got = closed_loop(plant, -A * np.array([[a, a1, a2]]), omega)
    wanted = thesis_transfer(omega, **thesis_numbers(data, drag), **gains)
    T, T_2 = got["payload.displacement/hook.heave"], got["drum.haul/hook.heave"]
    # near a closed-loop pole both are large and rounding is amplified alike
    scale = 1.0 + np.abs(wanted["T_2"])
    np.testing.assert_allclose(T / scale, wanted["T"] / scale, atol=1e-8)
    np.testing.assert_allclose(T_2 / scale, wanted["T_2"] / scale, atol=1e-8)
    np.testing.assert_allclose(T_2 / scale, (T / wanted["G"] - 1.0) / scale, atol=1e-8)


def test_identity_of_drum_and_payload() -> None:
    plant = build_plant(THESIS).linearise(drag=THESIS_DRAG)
    got = closed_loop(plant, THESIS_FEEDBACK, OMEGA)
    G = thesis_transfer(OMEGA, **thesis_numbers(THESIS, THESIS_DRAG))["G"]
    T, T_2 = got["payload.displacement/hook.heave"], got["drum.haul/hook.heave"]
    np.testing.assert_allclose(T_2, T / G - 1.0, rtol=1e-9, atol=1e-9)


def test_thesis_gains_at_rest() -> None:
    """A slow heave leaves the payload where it is; a slow set-point moves it by 1/a2."""
    plant = build_plant(THESIS).linearise(drag=THESIS_DRAG)
    got = closed_loop(plant, THESIS_FEEDBACK, [1e-7])
    assert abs(got["payload.displacement/hook.heave"][0]) < 1e-8
    assert got["drum.haul/hook.heave"][0] == pytest.approx(-1.0, abs=1e-6)
    assert 200.0 * got["payload.displacement/drive.set_point"][0] == pytest.approx(0.01, rel=1e-6)


def test_thesis_peaks() -> None:
    """|P/Z| 0.078 at 7.65 rad/s and |X/Z| 5.08 at 7.67 rad/s, by eq. 32 and 34."""
    plant = build_plant(THESIS).linearise(drag=THESIS_DRAG)
    omega = np.arange(7.0, 8.5, 1e-3)
    got = closed_loop(plant, THESIS_FEEDBACK, omega)
    P, X = (np.abs(got[f"{name}/hook.heave"]) for name in ("payload.displacement", "drum.haul"))
    assert P.max() == pytest.approx(0.078, abs=5e-4)
    assert omega[P.argmax()] == pytest.approx(7.65, abs=0.01)
    assert X.max() == pytest.approx(5.08, abs=5e-3)
    assert omega[X.argmax()] == pytest.approx(7.67, abs=0.01)


def test_thesis_table_7() -> None:
    """1975 thesis, Table 7: |P/Z| with the loop closed, read off a Bode plot."""
    omega = [0.1, 0.2, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 1.5, 2.0, 5.8, 7.6, 10.0]
    table = [26, 53, 110, 130, 150, 180, 200, 230, 250, 260, 270, 280, 290, 290, 360, 730, 230]
    plant = build_plant(THESIS).linearise(drag=THESIS_DRAG)
    T = np.abs(closed_loop(plant, THESIS_FEEDBACK, omega)["payload.displacement/hook.heave"])
    np.testing.assert_allclose(T, 1e-4 * np.array(table), rtol=0.07)


@pytest.mark.parametrize(("masses", "growth"), [(2, 3.68), (5, 4.50), (10, 4.61), (20, 4.645)])
def test_thesis_loop_is_unstable_on_a_rope_lumped_downwards(masses: int, growth: float) -> None:
    data = replace(THESIS, masses=masses)
    poles = closed_loop_poles(build_plant(data).linearise(drag=THESIS_DRAG), THESIS_FEEDBACK)
    assert poles.real.max() == pytest.approx(growth, abs=0.005)


@pytest.mark.parametrize(
    ("masses", "growth"), [(2, 3.7), (5, 4.5), (10, 4.6), (20, 4.65), (40, 4.66)]
)
def test_thesis_loop_is_unstable_on_a_distributed_rope(masses: int, growth: float) -> None:
    data = replace(THESIS, masses=masses, lumping="distributed")
    poles = closed_loop_poles(build_plant(data).linearise(drag=THESIS_DRAG), THESIS_FEEDBACK)
    assert poles.real.max() == pytest.approx(growth, abs=0.05)


def test_thesis_loop_is_stable_on_one_spring() -> None:
    for data in (THESIS, replace(THESIS, lumping="distributed")):
        poles = closed_loop_poles(build_plant(data).linearise(drag=THESIS_DRAG), THESIS_FEEDBACK)
        assert poles.real.max() < -0.5


# ---- at the door


@pytest.mark.parametrize("name", [name for name, _ in bundled_cases()])
def test_bundled_cases_make_a_plant(name: str) -> None:
    case = load_case(name)
    data = PlantData.from_case(case)
    assert data.stiffness == pytest.approx(case.rope.stiffness)
    assert data.rope_mass == pytest.approx(case.rope.mass)
    assert data.static_tension == pytest.approx(
        case.payload.submerged_weight + case.rope.submerged_weight
    )
    plant = build_plant(case)
    assert plant.operating_point().residual < 1e-10
    linear = plant.linearise(drag=case.payload.fixed_drag or 5e3)
    assert linear.delays == (case.sensors.telemetry.delay,) * 3
    assert np.isfinite(linear.response(OMEGA).zw).all()
    assert as_plant_data(case) == as_plant_data(data)


def test_thesis_case_has_the_thesis_numbers() -> None:
    data = PlantData.from_case(load_case("thesis-1975"))
    assert data.stiffness == pytest.approx(80e3)
    assert (data.masses, data.lumping, data.motor) == (1, "thesis", "dc")
    assert build_plant(data).operating_point().torque == pytest.approx(5.05e3, rel=2e-3)
    plant = build_plant(load_case("thesis-1975")).linearise(drag=THESIS_DRAG)
    got = closed_loop(plant, THESIS_FEEDBACK, [7.67])
    assert abs(got["drum.haul/hook.heave"][0]) == pytest.approx(5.08, abs=0.01)


def test_telemetry_and_sensors_come_from_the_case() -> None:
    case = load_case("subsea-crane").replace(
        {
            "sensors.payload.bandwidth": "perfect",
            "sensors.telemetry.bandwidth": 25.0,
            "sensors.telemetry.delay": 0.2,
        }
    )
    data = PlantData.from_case(case)
    assert (data.sensor_bandwidth, data.telemetry_bandwidth) == (math.inf, 25.0)
    linear = build_plant(case).linearise(drag=1e3)
    assert "telemetry.velocity" in linear.states
    assert "sensor.velocity" not in linear.states
    assert linear.delays == (0.2,) * 3


def test_masses_are_chosen_or_given() -> None:
    auto = replace(ROPE, masses=None)
    assert build_plant(auto).masses == auto.chosen_masses() > 10
    assert build_plant(auto, masses=3).masses == 3
    assert build_plant(THESIS).masses == 1
    with pytest.raises(InputError, match=r"masses must be in \[1, 40\], got 41"):
        build_plant(auto, masses=41)


def test_unknown_parameters_and_negative_drag_are_refused() -> None:
    plant = build_plant(THESIS)
    with pytest.raises(InputError, match=r"no parameter 'rope\.stifness'; there are: rope\.axial"):
        plant.linearise(drag=0.0, parameters={"rope.stifness": 1.0})
    with pytest.raises(InputError, match=r"drag must be at least 0 N s/m, got -1"):
        plant.linearise(drag=-1.0)
    with pytest.raises(InputError, match=r"payload\.virtual_mass must be a finite number, got nan"):
        plant.operating_point({"payload.virtual_mass": math.nan})


@pytest.mark.parametrize("path", ["sensors.payload.bandwidth", "sensors.telemetry.bandwidth"])
def test_the_fastest_filter_of_a_case_leaves_an_operating_point(path: str) -> None:
    """A filter of 10 000 rad/s makes of rounding a rate of 5e-9 m/s2, which is no residual."""
    case = load_case("thesis-1975").replace({path: 1e4})
    assert build_plant(PlantData.from_case(case)).operating_point().residual < 1e-10
