"""Tip, rope, hook block and slings in series: closed forms, matrices by hand, and time."""

from __future__ import annotations

import math
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
import scipy.linalg
from former_cases import load_case
from plant_numbers import MODERN, THESIS

from models import Case, InputError
from models.plant import DrumTravel, PlantData, build_plant, line_response, rope_transfers

RIG = {"tip_stiffness": 3e6, "sling_stiffness": 5e6, "block_mass": 4e3, "block_weight": 34e3}
RIGS = {
    "tip": {"tip_stiffness": 3e6},
    "slings": {"sling_stiffness": 5e6},
    "block": {"block_mass": 4e3, "block_weight": 34e3},
    "all": RIG,
    "soft, heavy block": {**RIG, "sling_stiffness": 4e5, "block_mass": 3e4},
}
every_rig = pytest.mark.parametrize("rig", RIGS.values(), ids=RIGS.keys())


@every_rig
@pytest.mark.parametrize("length", [100.0, 1000.0])
def test_exact_modes_are_those_of_matrices_by_hand(rig: dict[str, float], length: float) -> None:
    data = replace(MODERN, rope_length=length, **rig)
    n = 400  # pieces of rope between n + 1 nodes, the first on the tip, the last the block
    K, M = np.zeros((n + 2, n + 2)), np.zeros((n + 2, n + 2))

    def spring(i: int, j: int, stiffness: float) -> None:
        K[np.ix_([i, j], [i, j])] += stiffness * np.array([[1.0, -1.0], [-1.0, 1.0]])

    for i in range(n):
        spring(i, i + 1, data.stiffness * n)
        share = data.rope_mass / n / 6.0
        M[np.ix_([i, i + 1], [i, i + 1])] += share * np.array([[2.0, 1.0], [1.0, 2.0]])
    M[n, n] += data.block_mass
    M[n + 1, n + 1] += data.payload_mass
    if math.isinf(data.sling_stiffness):  # one node
        M[n, n] += data.payload_mass
        K, M = K[:-1, :-1], M[:-1, :-1]
    else:
        spring(n, n + 1, data.sling_stiffness)
    if math.isinf(data.tip_stiffness):  # held
        K, M = K[1:, 1:], M[1:, 1:]
    else:
        K[0, 0] += data.tip_stiffness
    expected = np.sqrt(scipy.linalg.eigh(K, M, eigvals_only=True, subset_by_index=[0, 3]))
    np.testing.assert_allclose(data.axial_modes(4), expected, rtol=2e-4)


@every_rig
def test_a_light_rope_swings_as_springs_in_series(rig: dict[str, float]) -> None:
    data = replace(MODERN, mass_per_length=0.0, masses=1, **{**rig, "block_mass": 0.0})
    series = 1.0 / (
        1.0 / data.tip_stiffness
        + data.rope_length / data.axial_stiffness
        + 1.0 / data.sling_stiffness
    )
    expected = math.sqrt(series / data.payload_mass)
    assert data.axial_modes(3) == pytest.approx([expected], rel=1e-12)
    assert data.chain_compliance == pytest.approx(1.0 / series, rel=1e-12)
    light = replace(data, mass_per_length=0.01)
    assert light.axial_modes(1)[0] == pytest.approx(expected, rel=1e-4)


@every_rig
@pytest.mark.parametrize("law", ["kelvin-voigt", "hysteretic"])
def test_a_slow_force_meets_all_of_them(rig: dict[str, float], law: str) -> None:
    data = replace(MODERN, damping_law=law, damping_ratio=0.02, rope_weight=0.0, **rig)
    P_F = rope_transfers(data, np.array([1e-5j]), 0.0)[1][0]
    assert P_F.real == pytest.approx(data.chain_compliance, rel=1e-6)
    plant = build_plant(data, 5)
    rest = plant.operating_point()
    pulled = plant.operating_point({"payload.submerged_weight": data.payload_weight})
    np.testing.assert_allclose(rest.x, pulled.x, atol=1e-9)
    # The stretch of the static chain, from the tip's foot down, is what the operating point has.
    compliance = sum(1.0 / link.series for link in plant.chain)
    assert compliance == pytest.approx(data.chain_compliance, rel=1e-12)


@every_rig
@pytest.mark.parametrize("law", ["kelvin-voigt", "hysteretic"])
def test_poles_lose_what_the_rope_loses(rig: dict[str, float], law: str) -> None:
    data = replace(MODERN, rope_length=400.0, damping_law=law, damping_ratio=0.005, **rig)
    plant = build_plant(replace(data, inertia=1e15, masses=30)).linearise(drag=0.0)
    # The drum's own states are out: nothing moves it.
    keep = [i for i, name in enumerate(plant.states) if name.split(".")[0] in ("rope", "payload")]
    poles = np.linalg.eigvals(plant.A[np.ix_(keep, keep)])
    for expected in replace(data, masses=30).damped_modes(2):
        found = poles[np.argmin(np.abs(poles - expected))]
        assert abs(found.imag) == pytest.approx(expected.imag, rel=5e-3)
        assert found.real == pytest.approx(expected.real, rel=0.05)


@pytest.mark.parametrize("masses", [1, 4, 12])
def test_let_go_it_swings_at_its_first_mode_and_keeps_its_energy(masses: int) -> None:
    data = replace(
        MODERN, **RIG, inertia=1e15, damping_ratio=0.0, quadratic_drag=0.0, viscous_friction=0.0
    )
    plant = build_plant(data, masses)
    assert len(plant.displacements) == masses + 1
    rest = plant.operating_point({"winch.gear_direction": 0.0})
    start, names = np.array(rest.x), plant.displacements
    at = [plant.states.index(name) for name in names]
    compliances = np.array([1.0 / link.series for link in plant.chain])
    start[at] += 0.3 * np.cumsum(compliances) / compliances.sum()  # about the first mode
    first = plant.data.lumped_axial_modes(masses)[0]
    step = 1.5e-3
    x = ca.SX.sym("x", len(plant.states))

    def rhs(state: ca.SX) -> ca.SX:
        return plant.function(state, rest.command, np.zeros(4), rest.p)[0]

    k1 = rhs(x)
    k2 = rhs(x + 0.5 * step * k1)
    k3 = rhs(x + 0.5 * step * k2)
    k4 = rhs(x + step * k3)
    advance = ca.Function("step", [x], [x + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)])
    found = np.asarray(advance.mapaccum(math.ceil(10.0 * 2.0 * math.pi / first / step))(start))
    payload = found[at[-1]]
    down = np.flatnonzero((payload[:-1] > 0.0) & (payload[1:] <= 0.0))
    crossings = down + payload[down] / (payload[down] - payload[down + 1])
    # Higher modes shake single crossings; nine periods between the outer ones.
    period = step * (crossings[-1] - crossings[0]) / (len(crossings) - 1)
    assert 2.0 * math.pi / period == pytest.approx(first, rel=3e-3)
    moving = [plant.states.index(name.replace("displacement", "velocity")) for name in names]
    mass = np.array([link.mass for link in plant.chain])
    mass[-1] += data.payload_mass
    stretch = -np.diff(np.vstack([np.zeros(found.shape[1]), found[at]]), axis=0)
    k = np.array([link.series for link in plant.chain])
    energy = 0.5 * (mass @ found[moving] ** 2 + k @ stretch**2)
    assert np.ptp(energy) < 1e-6 * energy[0]


def test_slack_slings_carry_nothing_and_the_block_hangs_on() -> None:
    plant = build_plant(replace(MODERN, **RIG), 3)
    rest = plant.operating_point()
    state = np.array(rest.x)
    state[plant.states.index("payload.displacement")] += 1.0
    _, _, z = (np.asarray(v).ravel() for v in plant.function(state, rest.u, np.zeros(4), rest.p))
    values = dict(zip(plant.outputs, z, strict=True))
    assert values["rope.lower_tension"] == 0.0
    assert values["rope.tension"] == pytest.approx(rest.tension, rel=1e-6)


def test_the_tip_sinks_under_the_tension_and_no_more() -> None:
    data = replace(THESIS, tip_stiffness=1e6)
    s = np.array([0.4j, 1.3j, 2.9j])
    P_Y, P_F, T_Y, T_F = rope_transfers(data, s, 2e3)
    rigid = rope_transfers(replace(data, tip_stiffness=math.inf), s, 2e3)
    top = 1.0 - T_Y / 1e6  # the sheave, per metre of the foot
    np.testing.assert_allclose(P_Y, rigid[0] * top, rtol=1e-12)
    np.testing.assert_allclose(T_Y, rigid[2] * top, rtol=1e-12)
    np.testing.assert_allclose(T_F, -P_Y, rtol=1e-12)
    np.testing.assert_allclose(P_F, rigid[1] - rigid[0] * T_F / 1e6, rtol=1e-12)


def test_a_case_says_them_and_warns_of_very_soft_ones() -> None:
    case = load_case("subsea-crane").replace(
        {"crane.tip_stiffness": "3 MN/m", "rigging.stiffness": 5e6, "rigging.block_mass": "2 t"}
    )
    data = PlantData.from_case(case)
    assert (data.tip_stiffness, data.sling_stiffness, data.block_mass) == (3e6, 5e6, 2e3)
    assert case.static_tension == pytest.approx(data.static_tension, rel=1e-12)
    assert data.block_weight == pytest.approx(2e3 * 9.80665 * (1.0 - 1025.0 / 7850.0), rel=1e-3)
    assert 1.0 / case.chain_stiffness == pytest.approx(
        1 / 3e6 + 1 / 5e6 + 1 / case.rope.stiffness, rel=1e-12
    )
    for path in ("crane.tip_stiffness", "rigging.stiffness"):
        with pytest.warns(UserWarning, match=f"{path}: 1e\\+04 N/m is 0.0"):
            load_case("subsea-crane").replace({path: 1e4, "limits.drive": "report"})


# ---- falls


def two_falls_and_one_line(**changes: object) -> tuple[Case, Case]:
    """The crane with two falls, and with one line of twice everything on half the drum."""
    case = load_case("subsea-crane").replace({"limits.drive": "report", **changes})
    rope, layers = case.rope, case.winch.drum.lays(case.rope.diameter)
    held = [3000.0 - paid_out for paid_out, _ in layers]
    drum = case.winch.drum.model_dump() | {"geometry": None, "rope_on_drum_total": 3000.0}

    def wound(share: float) -> dict[str, object]:
        rows = [
            {"pitch_diameter": 2.0 * share * r, "rope_on_drum": share * length}
            for (_, r), length in zip(layers, held, strict=True)
        ]
        return drum | {"layers": rows, "rope_on_drum_total": share * 3000.0}

    weight = rope.submerged_weight / rope.length
    one = {
        "rope.axial_stiffness": 2.0 * rope.ea,
        "rope.mass_per_length": 2.0 * rope.mass_per_length,
        "rope.submerged_weight_per_length": 2.0 * weight,
        "rope.skin_drag_coefficient": 2.0 * rope.skin_drag_coefficient,
        "winch.drum": wound(0.5),
    }
    peak = case.limits.rope_tension_peak
    assert peak is not None
    one["limits.rope_tension_peak"] = 2.0 * peak
    return case.replace({"rope.falls": 2, "winch.drum": wound(1.0)}), case.replace(one)


def test_two_falls_are_one_line_of_twice_everything_on_half_the_drum() -> None:
    two, one = two_falls_and_one_line(
        **{"rigging.block_mass": 3e3, "rope.sheaves": 2, "rope.skin_drag_coefficient": 0.01}
    )
    a, b = PlantData.from_case(two), PlantData.from_case(one)
    assert replace(a, falls=1.0) == replace(b, delay=a.delay)
    assert two.static_torque == pytest.approx(one.static_torque, rel=1e-12)
    assert 2.0 * two.static_tension == pytest.approx(one.static_tension, rel=1e-12)
    assert two.static_tension == pytest.approx(a.static_tension, rel=1e-12)
    plants = [build_plant(data, 4) for data in (a, b)]
    rests = [plant.operating_point() for plant in plants]
    assert rests[0].torque == pytest.approx(rests[1].torque, rel=1e-12)
    assert 2.0 * rests[0].tension == pytest.approx(rests[1].tension, rel=1e-12)
    omega = np.array([0.1, 0.9, 4.0, 17.0])
    linear = [plant.linearise(drag=5e3).response(omega) for plant in plants]
    for found, other in (linear, [line_response(d, 1j * omega, drag=5e3) for d in (a, b)]):
        for name, z, same in zip(
            found.outputs, found.zw.transpose(1, 0, 2), other.zw.transpose(1, 0, 2), strict=True
        ):
            of_one = 2.0 if name in ("rope.tension", "rope.upper_tension") else 1.0
            np.testing.assert_allclose(of_one * z, same, rtol=1e-9, err_msg=name)


def test_a_drum_that_lowers_on_two_falls_changes_layer_where_one_line_would() -> None:
    two, one = two_falls_and_one_line()
    travels = [DrumTravel.from_case(case) for case in (two, one)]
    for ends in ("outward", "inward"):
        found, expected = (getattr(travel, ends) for travel in travels)
        np.testing.assert_allclose(np.array(found), np.array(expected), rtol=1e-12)


@pytest.mark.parametrize("falls", [0, 2.5, 41])
def test_falls_are_whole(falls: float) -> None:
    with pytest.raises(InputError, match=r"rope\.falls: must be a whole number in \[1, 40\]"):
        load_case("subsea-crane").replace({"rope.falls": falls})


def test_a_drum_that_has_not_the_rope_for_all_falls_is_refused() -> None:
    with pytest.raises(InputError, match="1500 m of rope, less than the 2000 m paid out"):
        load_case("subsea-crane").replace({"rope.falls": 2})
