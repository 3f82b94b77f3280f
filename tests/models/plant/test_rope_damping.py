"""The hysteretic rope: one damping law in frequency, in state space and in time."""

from __future__ import annotations

import math
from dataclasses import replace

import casadi as ca
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from plant_numbers import MODERN

from models.plant import (
    MAX_BRANCHES,
    Plant,
    PlantData,
    build_plant,
    fixed_top_modes,
    rope_transfers,
    zener_branches,
)

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

ROPE = replace(MODERN, damping_law="hysteretic", damping_ratio=0.002, masses=None)
RIG = {"tip_stiffness": 3e6, "sling_stiffness": 5e6, "block_mass": 4e3, "block_weight": 34e3}
HELD = 40.0  # [rad/s]: the modes that a rope of automatic masses holds
LENGTHS = (100.0, 300.0, 1000.0, 3000.0)
RATIOS = (0.0004, 0.002, 0.01)


def exact_modes(data: PlantData, count: int = 12) -> FloatArray:
    rope = (data.axial_stiffness, data.rope_length, data.mass_per_length)
    modes = fixed_top_modes(*rope, data.payload_mass, count)
    return modes[modes < max(HELD, 1.001 * modes[0])]


def held(data: PlantData, masses: int) -> tuple[Plant, FloatArray, list[int]]:
    """The plant, its matrix with the drum held, and which states those are."""
    plant = build_plant(data, masses)
    linear = plant.linearise(drag=0.0)
    keep = [i for i, name in enumerate(plant.states) if name.startswith(("rope.", "payload."))]
    return plant, linear.A[np.ix_(keep, keep)], keep


def ringing(A: FloatArray) -> ComplexArray:
    poles = np.linalg.eigvals(A)
    poles = poles[poles.imag > 1e-6]
    return np.asarray(poles[np.argsort(np.abs(poles))])


def line_mode(data: PlantData, start: complex) -> complex:
    """A mode of the exact line with its upper end held, by the secant rule on 1/(P/Y)."""

    def denominator(s: complex) -> complex:
        return complex(1.0 / rope_transfers(data, np.array([s]), 0.0)[0][0])

    one, other = start, start * (1.0 - 1e-4)
    at_one, at_other = denominator(one), denominator(other)
    for _ in range(60):
        step = at_other * (other - one) / (at_other - at_one)
        one, at_one, other = other, at_other, other - step
        if abs(step) < 1e-13 * abs(other):
            return other
        at_other = denominator(other)
    raise AssertionError("the secant rule found no mode")


# ---- the law itself


@given(
    ratio=st.floats(1e-5, 0.5),
    first=st.floats(0.05, 30.0),
    span=st.floats(1.0, 4000.0),
)
def test_the_law_is_passive_and_its_loss_factor_holds(
    ratio: float, first: float, span: float
) -> None:
    slow, gains, times = zener_branches(ratio, first, first * span)
    assert gains.shape == times.shape == (MAX_BRANCHES, 1)
    there = gains[:, 0] > 0.0
    assert np.all(times[there, 0] > 0.0)
    assert not np.any(gains[~there, 0])
    omega = np.geomspace(0.5, 2.0 * span, 400) * first
    x = 1j * omega * times
    modulus = slow[0] + (gains * x / (1.0 + x)).sum(axis=0)
    off = np.abs(modulus.imag / modulus.real / (2.0 * ratio) - 1.0)
    assert off.max() < (0.05 if ratio <= 0.1 else 0.13)
    # passive everywhere, in the band and out of it
    x = 1j * np.geomspace(1e-4, 1e6, 300) * first * times
    assert np.all((slow[0] + (gains * x / (1.0 + x)).sum(axis=0)).imag > 0.0)


def test_three_branches_do_two_decades_and_five_do_three() -> None:
    for decades, most in ((2.0, 3), (3.0, 5)):
        gains = zener_branches(0.002, 1.0, 10.0**decades / 4.0)[1]
        assert (gains > 0.0).sum() <= most


@pytest.mark.parametrize("ratio", [0.0004, 0.002, 0.05, 0.3])
def test_stiffness_and_ratio_are_those_given_at_the_first_mode(ratio: float) -> None:
    data = replace(ROPE, damping_ratio=ratio)
    modulus = data.rope_modulus(np.array([1j * data.first_mode]))[0]
    assert modulus.real == pytest.approx(data.axial_stiffness, rel=1e-12)
    assert modulus.imag / modulus.real == pytest.approx(2.0 * ratio, rel=0.08 * ratio**2 + 1e-5)
    assert data.slow_stiffness == pytest.approx(data.rope_modulus(np.zeros(1, complex))[0].real)


def test_many_ropes_at_once_are_one_at_a_time() -> None:
    rng = np.random.default_rng(3)
    ratios, firsts = rng.uniform(0.0, 0.1, 40), 10.0 ** rng.uniform(-1.0, 1.0, 40)
    ratios[7] = 0.0
    spans = firsts * 10.0 ** rng.uniform(0.0, 3.0, 40)
    together = zener_branches(ratios, firsts, spans)
    for k in range(40):
        alone = zener_branches(ratios[k], firsts[k], spans[k])
        for all_of_it, one in zip(together, alone, strict=True):
            np.testing.assert_array_equal(all_of_it[..., k], one[..., 0])
    assert not together[1][:, 7].any()
    assert together[0][7] == 1.0


def test_kelvin_voigt_has_no_branches_and_neither_has_an_undamped_rope() -> None:
    viscous = ROPE.viscous
    s = 1j * np.linspace(0.1, 50.0, 40)
    np.testing.assert_array_equal(
        viscous.rope_modulus(s), viscous.axial_stiffness * (1.0 + s * viscous.damping_time)
    )
    for data in (viscous, replace(ROPE, damping_ratio=0.0)):
        assert data.slow_stiffness == data.axial_stiffness
        assert not any("branch" in name for name in build_plant(data, 4).states)
    np.testing.assert_array_equal(replace(ROPE, damping_ratio=0.0).rope_modulus(s).imag, 0.0)


# ---- every mode's damping ratio


@pytest.mark.parametrize("length", LENGTHS)
@pytest.mark.parametrize("ratio", RATIOS)
def test_every_mode_of_the_exact_line_has_the_ratio(length: float, ratio: float) -> None:
    data = replace(ROPE, rope_length=length, damping_ratio=ratio)
    modes = exact_modes(data)
    for mode, near in zip(modes, data.damped_modes(modes.size), strict=True):
        s = line_mode(data, complex(near))
        assert -s.real / abs(s) == pytest.approx(ratio, rel=0.05)
        assert s == pytest.approx(near, rel=1e-6)  # what quadratures expect to be there
        # EA (1 + 2 i zeta) with the same loss in every mode, which no causal rope has
        oracle = 1j * mode * np.sqrt(1.0 + 2j * ratio)
        assert -s.real / abs(s) == pytest.approx(-oracle.real / abs(oracle), rel=0.05)
        # causal: stiffer where it is faster, by (2/pi) eta ln(omega/omega_1)
        grown = (abs(s) / mode) ** 2 - 1.0
        rule = 4.0 * ratio / math.pi * math.log(mode / data.first_mode)
        assert grown == pytest.approx(rule, rel=0.1, abs=0.2 * ratio)


@pytest.mark.parametrize("length", LENGTHS)
@pytest.mark.parametrize("ratio", RATIOS)
def test_every_mode_of_the_lumped_rope_has_the_ratio(length: float, ratio: float) -> None:
    data = replace(ROPE, rope_length=length, damping_ratio=ratio)
    modes = exact_modes(data)
    poles = ringing(held(data, data.chosen_masses())[1])[: modes.size]
    np.testing.assert_allclose(np.abs(poles), modes, rtol=0.05 + 6.0 * ratio)
    np.testing.assert_allclose(-poles.real / np.abs(poles), ratio, rtol=0.05)


def test_masses_that_are_given_hold_the_ratio_of_their_modes_too() -> None:
    data = replace(ROPE, masses=40)
    modes = fixed_top_modes(
        data.axial_stiffness, data.rope_length, data.mass_per_length, data.payload_mass, 40
    )
    poles = ringing(held(data, 40)[1])
    good = np.abs(np.abs(poles) / modes - 1.0) < 0.05
    assert good.sum() > 11  # far above 40 rad/s
    np.testing.assert_allclose(-poles[good].real / np.abs(poles[good]), 0.002, rtol=0.05)


@pytest.mark.parametrize("mode", [0, 1, 2])
def test_a_mode_decays_in_time_as_the_ratio_says(mode: int) -> None:
    data = replace(ROPE, inertia=1e15, damping_ratio=0.004)  # a drum that nothing moves
    plant, A, keep = held(data, 12)
    values, vectors = np.linalg.eig(A)
    order = np.argsort(np.where(values.imag > 1e-6, np.abs(values), np.inf))
    # The shape of the mode alone: the dampers of the branches begin where the stretch is.
    names = plant.displacements
    places = [[plant.states[i] for i in keep].index(name) for name in names]
    shape = (vectors[:, order[mode]] / vectors[places[-1], order[mode]]).real
    rest = plant.operating_point({"winch.gear_direction": 0.0})
    start = np.array(rest.x)
    for name, place in zip(names, places, strict=True):
        start[plant.states.index(name)] += 1e-3 * shape[place] / np.abs(shape[places]).max()
    stretches = -np.diff(np.append(0.0, [start[plant.states.index(name)] for name in names]))
    for j, stretch in enumerate(stretches):
        for i, name in enumerate(plant.states):
            if name.startswith(f"rope.{j + 1}.branch_"):
                start[i] = stretch

    period = 2.0 * math.pi / abs(values[order[mode]])
    cycles, steps = 24, max(400, math.ceil(period / 2e-3))
    step = period / steps
    x = ca.SX.sym("x", len(plant.states))
    changed = np.array(rest.p)
    changed[list(plant.parameters).index("payload.quadratic_drag")] = 0.0

    def rhs(at: ca.SX) -> ca.SX:
        return plant.function(at, rest.command, np.zeros(4), changed)[0]

    k1 = rhs(x)
    k2 = rhs(x + 0.5 * step * k1)
    k3 = rhs(x + 0.5 * step * k2)
    k4 = rhs(x + step * k3)
    after = x + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    run = ca.Function("step", [x], [after]).mapaccum(steps * cycles)
    found = np.asarray(run(start))[[plant.states.index(name) for name in names]]
    # what of the motion is the mode: the pieces' masses as weights
    weights = np.array(plant.lumps.masses) * data.rope_mass
    weights[-1] += data.payload_mass
    motion = (weights * shape[places]) @ found
    motion = motion - motion[-steps:].mean()
    peaks = np.abs(motion).reshape(cycles, steps).max(axis=1)
    fall = np.log(peaks[4] / peaks[-4]) / (cycles - 8)
    assert fall / (2.0 * math.pi) == pytest.approx(0.004, rel=0.05)


# ---- slack, and energy


def static_stretches(plant: Plant) -> FloatArray:
    """Stretch of each piece of the rope at rest, (N,) [m]."""
    return np.array([link.carried * (1.0 + link.give) / link.stiffness for link in plant.chain])


def mechanical_energy(plant: Plant, state: FloatArray) -> float:
    """Kinetic energy, that of weights, of the springs and of the branches' springs [J]."""
    p, chain, names = plant.parameters, plant.chain, plant.displacements
    at = [plant.states.index(name) for name in names]
    moving = [plant.states.index(name.replace("displacement", "velocity")) for name in names]
    masses, weights = (np.array([getattr(c, own) for c in chain]) for own in ("mass", "weight"))
    masses[-1] += p["payload.virtual_mass"]
    weights[-1] += p["payload.submerged_weight"]
    hanging = np.cumsum(weights[::-1])[::-1]
    total = 0.5 * masses @ state[moving] ** 2 + weights @ state[at]
    stretch = -np.diff(np.append(0.0, state[at]))
    branches = sum(name.endswith(".gain") for name in p)
    gains = np.array([p[f"rope.branch_{b + 1}.gain"] for b in range(branches)])
    for j, link in enumerate(chain):
        k, g = link.stiffness, gains if link.is_rope else gains[:0]
        q = state[[i for i, s in enumerate(plant.states) if s.startswith(f"rope.{j + 1}.branch_")]]
        # the strain of the material: of a slack piece that without tension
        free = (g @ q - hanging[j] / k) / (1.0 + g.sum())
        of_both = stretch[j] + link.give * (g @ q)
        e = max(float(of_both) / (1.0 + link.give * (1.0 + g.sum())), free)
        total += hanging[j] * e + 0.5 * k * (e**2 + g @ (e - q) ** 2)
        if link.give:  # what the tip has stored
            pull, tip = k * ((1.0 + g.sum()) * e - g @ q), k / link.give
            total += (hanging[j] + 0.5 * pull) * pull / tip
    return float(total)


@pytest.mark.parametrize("rig", [{}, RIG], ids=["rope", "rig"])
@pytest.mark.parametrize("ratio", [0.002, 0.1])
def test_no_energy_comes_out_of_a_rope_that_goes_slack_and_snaps(
    ratio: float, rig: dict[str, float]
) -> None:
    data = replace(ROPE, inertia=1e15, damping_ratio=ratio, quadratic_drag=0.0, **rig)
    plant = build_plant(data, 5)
    rest = plant.operating_point({"winch.gear_direction": 0.0})
    start, names = np.array(rest.x), plant.displacements
    lifted = 2.5 * np.cumsum(static_stretches(plant))
    for name, more in zip(names, lifted, strict=True):
        start[plant.states.index(name)] += more
    x = ca.SX.sym("x", len(plant.states))
    step = 5e-4

    def rhs(at: ca.SX) -> ca.SX:
        return plant.function(at, rest.command, np.zeros(4), rest.p)[0]

    k1 = rhs(x)
    k2 = rhs(x + 0.5 * step * k1)
    k3 = rhs(x + 0.5 * step * k2)
    k4 = rhs(x + step * k3)
    advance = ca.Function("step", [x], [x + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)])
    found = np.asarray(advance.mapaccum(24_000)(start))
    energy = np.array([mechanical_energy(plant, column) for column in found.T[::10]])
    least = plant.outputs.index("rope.tension")
    tension = np.array(
        [
            float(plant.function(c, rest.command, np.zeros(4), rest.p)[2][least])
            for c in found.T[::50]
        ]
    )
    assert tension.min() == 0.0
    assert tension.max() > 1.5 * rest.tension  # it snaps
    assert energy[-1] < energy[0]
    # Runge-Kutta steps over the corner of a rope that goes slack: a hair of the whole
    assert np.diff(energy).max() < 1e-5 * abs(energy[0])
    assert np.all(energy <= energy[0] * (1.0 + 1e-6))


def test_a_slack_piece_carries_no_tension_and_forgets_its_branches() -> None:
    plant = build_plant(replace(ROPE, damping_ratio=0.05), 2)
    rest = plant.operating_point()
    state = np.array(rest.x)
    state[plant.states.index("payload.displacement")] = 50.0  # far above what hangs it
    rates, *_ = (np.asarray(v).ravel() for v in plant.function(state, rest.u, np.zeros(4), rest.p))
    p = plant.parameters
    weight = p["payload.submerged_weight"] + p["rope.submerged_weight_per_length"] * p[
        "rope.length"
    ] * float(plant.lumps.masses[-1])
    mass = p["payload.virtual_mass"] + p["rope.mass_per_length"] * p["rope.length"] * float(
        plant.lumps.masses[-1]
    )
    falling = rates[plant.states.index("payload.velocity")]
    assert falling == pytest.approx(-weight / mass, rel=1e-12)
    own = static_stretches(plant)[1]
    # its dampers follow the material, which has lost the stretch of its load and not 50 m
    q = rates[plant.states.index("rope.2.branch_1.stretch")] * p["rope.branch_1.time"]
    assert -2.0 * own < q < -0.1 * own


def test_a_slow_force_meets_the_slow_stiffness() -> None:
    data = replace(ROPE, damping_ratio=0.05, rope_weight=0.0)
    s = np.array([1e-5j])
    compliance = rope_transfers(data, s, 0.0)[1][0]
    assert compliance.real == pytest.approx(data.rope_length / data.slow_stiffness, rel=1e-6)
    assert data.slow_stiffness < 0.95 * data.axial_stiffness
    plant, A, keep = held(data, 6)
    force = plant.linearise(drag=0.0).E[keep, plant.disturbances.index("payload.force")]
    at = [plant.states[i] for i in keep].index("payload.displacement")
    lumped = -np.linalg.solve(A, force)[at]
    assert lumped == pytest.approx(compliance.real, rel=1e-6)
