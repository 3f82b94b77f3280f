"""Forces of seabed, deck and splash zone, against a second statement and against physics."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest
from former_cases import load_case
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from models import InputError, build_plant
from models.plant import Deck, Seabed, SplashZone, Surroundings

NAMES = ("force", "mass", "drag_factor", "relative_velocity")
ZONE = SplashZone(
    below=1.0,
    height=4.0,
    buoyancy=7e4,
    added_mass=5e4,
    slamming_area=16.0,
    wave_number=0.05,
)
OFFSETS = st.floats(-3.0, 3.0)
SPEEDS = st.floats(-3.0, 3.0)
TRIPLES = st.tuples(OFFSETS, SPEEDS, st.floats(-2.0, 2.0))


@pytest.fixture(scope="module")
def plants():
    case = load_case("subsea-crane")
    deep = SplashZone(below=-500.0, height=4.0, buoyancy=7e4, added_mass=5e4)
    return build_plant(case, 3), build_plant(case, 3, surroundings=Surroundings(water=deep))


def function_of(surroundings, **symbols):
    """(P, V, motions...) -> force, mass change, drag factor, relative velocity, outputs."""
    P, V = ca.SX.sym("P"), ca.SX.sym("V")
    motions = {
        name: tuple(ca.SX.sym(f"{name}{i}") for i in range(3)) for name in surroundings.motions
    }
    built = surroundings.build(P, V, motions, symbols or None)
    assert tuple(built.outputs) == tuple(surroundings.output_units)
    inputs = [P, V, *(end for triple in motions.values() for end in triple), *symbols.values()]
    outputs = [
        built.force,
        built.virtual_mass_change,
        built.drag_factor,
        built.relative_velocity,
        *built.outputs.values(),
    ]
    function = ca.Function("surroundings", inputs, [ca.vertcat(*outputs)])
    names = (*NAMES, *built.outputs)

    def values(*arguments):
        found = np.asarray(function(*arguments)).ravel()
        return dict(zip(names, (float(value) for value in found), strict=True))

    values.function = function
    return values


SEABED = function_of(Surroundings(ground=Seabed(below=2.0)))
DECK = function_of(Surroundings(ground=Deck(below=-0.1, stiffness=4e6, damping=1e6)))
SPLASH = function_of(Surroundings(water=ZONE))


class TestContact:
    @given(P=OFFSETS, V=SPEEDS)
    def test_the_seabed_by_a_second_statement(self, P, V):
        d, rate = -(P + 2.0), -V
        force = max(0.0, 1.8e6 * d + 6.5e5 * rate * math.sqrt(d)) if d > 0.0 else 0.0
        found = SEABED(P, V)
        assert found["force"] == pytest.approx(force, rel=1e-6, abs=1e-3)
        assert found["contact.force"] == found["force"]
        assert found["contact.gap"] == pytest.approx(P + 2.0)
        assert found["contact.closing_speed"] == rate
        assert (found["mass"], found["drag_factor"], found["relative_velocity"]) == (0.0, 1.0, V)

    @given(P=OFFSETS, V=SPEEDS, deck=TRIPLES)
    def test_a_deck_counts_from_where_it_is(self, P, V, deck):
        d, rate = deck[0] - P + 0.1, deck[1] - V
        force = max(0.0, 4e6 * d + 1e6 * rate * math.sqrt(d)) if d > 0.0 else 0.0
        found = DECK(P, V, *deck)
        assert found["force"] == pytest.approx(force, rel=1e-6, abs=1e-3)
        assert found["contact.gap"] == pytest.approx(P - 0.1 - deck[0])
        assert found["contact.closing_speed"] == pytest.approx(rate)
        assert (found["deck.displacement"], found["deck.velocity"]) == deck[:2]

    def test_a_platform_needs_no_motion(self):
        surroundings = Surroundings(ground=Deck(below=1.0, moving=False))
        assert surroundings.motions == ()
        found = function_of(surroundings)(-1.1, 0.0)
        assert found["force"] == pytest.approx(0.1 * 5e6)
        assert found["deck.displacement"] == 0.0

    @given(P=st.floats(-3.0, -1.0), V=st.floats(-5.0, 5.0))
    def test_it_never_pulls(self, P, V):
        assert SEABED(P, V)["force"] >= 0.0

    @given(V=st.floats(-5.0, 5.0), depth=st.floats(0.0, 1e-6))
    def test_touchdown_has_no_jump(self, V, depth):
        # k d + b V sqrt(d): after a micron no more than 2 N and 3250 N.
        assert SEABED(-2.0 + depth, V)["force"] == 0.0
        largest = 1.8e6 * depth + 6.5e5 * abs(V) * math.sqrt(depth)
        assert SEABED(-2.0 - depth, V)["force"] <= largest * (1.0 + 1e-9) + 1e-6

    def test_its_slope_is_a_number_everywhere(self):
        P, V = ca.SX.sym("P"), ca.SX.sym("V")
        force = Surroundings(ground=Seabed(below=0.0)).build(P, V, {}).force
        slope = ca.Function("slope", [P, V], [ca.jacobian(force, ca.vertcat(P, V))])
        for at in (0.0, 1e-9, -1e-9, -1e-13, -0.3):
            assert np.isfinite(np.asarray(slope(at, -1.0))).all()
        # Static stiffness well inside.
        assert float(slope(-0.3, 0.0)[0]) == pytest.approx(-1.8e6)

    @pytest.mark.parametrize(
        ("damping", "kept"),
        [(0.0, (0.9999, 1.0001)), (5e4, (0.3, 0.9)), (6.5e5, (-1e-9, 0.05))],
    )
    def test_a_bounce_loses_energy_by_the_damper_alone(self, damping, kept):
        mass, weight, speed = 12e3, 12e3 * 9.80665, 1.0
        contact = function_of(Surroundings(ground=Seabed(below=0.0, damping=damping))).function

        def rhs(t, state):
            force = float(contact(state[0], state[1])[0])
            return [state[1], (force - weight) / mass]

        def leaves(t, state):
            return state[0]

        leaves.terminal, leaves.direction = True, 1.0
        run = solve_ivp(
            rhs, (0.0, 3.0), [-1e-9, -speed], rtol=1e-8, atol=1e-10, max_step=0.01, events=leaves
        )
        energy = 0.5 * mass * run.y[1] ** 2 + weight * run.y[0]
        spring = 0.5 * 1.8e6 * np.minimum(run.y[0], 0.0) ** 2
        total = energy + spring + weight**2 / (2.0 * 1.8e6)  # above that of resting on the spring
        assert kept[0] <= total[-1] / total[0] <= kept[1]
        # Never any gain on the way.
        assert np.max(np.diff(total)) < 1e-6 * total[0]

    def test_the_rates_hold_for_a_hard_landing(self):
        mass = 12e3
        rate, damped = Surroundings(ground=Seabed(below=0.0)).stiffness_rates(mass)
        assert rate == pytest.approx(math.sqrt(1.8e6 / mass))
        # Without the damper a landing at 2 m/s goes deepest; energy balance.
        k, W = 1.8e6, mass * 9.80665
        deepest = np.max(np.roots([0.5 * k, -W, -0.5 * mass * 2.0**2]))
        assert damped == pytest.approx(6.5e5 * math.sqrt(deepest) / mass)
        slope = ca.Function(
            "slope", *(lambda P, V: ([P, V], [_by_velocity(P, V)]))(ca.SX.sym("P"), ca.SX.sym("V"))
        )
        assert float(-slope(-deepest, 0.0)) / mass == pytest.approx(damped, rel=1e-9)
        assert Surroundings(water=ZONE).stiffness_rates(mass) == ()


def _by_velocity(P, V):
    return ca.jacobian(Surroundings(ground=Seabed(below=0.0)).build(P, V, {}).force, V)


def rounded_share(x):
    """Submerged share of a prism with rounded corners, by integrating its slope."""

    def ramp(y):
        if y <= -0.05:
            return 0.0
        if y >= 0.05:
            return y
        return 0.5 * (y + 0.05) * (y + 0.05) / 0.1

    return ramp(x) - ramp(x - 1.0), ramp(x)


def entering_mass(x):
    """Added mass and its growth per metre: 41 t/m, half of 1025 kg/m3 x 5 x 16 m2, up to 50 t."""

    def slope(y):
        return min(1.0, max(0.0, 10.0 * (y + 0.05)))

    def mass(y):
        return 41e3 * 4.0 * rounded_share(y)[1]

    until = 5e4 / 41e3 / 4.0
    return mass(x) - mass(x - until), 41e3 * (slope(x) - slope(x - until))


class TestSplashZone:
    @given(P=st.floats(-9.0, 2.0), V=SPEEDS, surface=TRIPLES)
    def test_by_a_second_statement(self, P, V, surface):
        w, w_rate, w_acc = surface
        s, wet = rounded_share((w - P - 1.0) / 4.0)
        decay = math.exp(-0.05 * 4.0 * (wet - 0.5 * s))
        entering = max(0.0, w_rate - V)
        added, growth = entering_mass((w - P - 1.0) / 4.0)
        slam = growth * entering**2
        waves = (s * 7e4 / 9.80665 + added) * decay * w_acc
        found = SPLASH(P, V, *surface)
        assert found["force"] == pytest.approx(-(1.0 - s) * 7e4 + waves + slam, abs=1e-3)
        assert found["mass"] == pytest.approx(added - 5e4, abs=1e-6)
        assert found["drag_factor"] == pytest.approx(s, abs=1e-12)
        assert found["relative_velocity"] == pytest.approx(V - decay * w_rate)
        assert found["water.force"] == pytest.approx(s * 7e4 + waves + slam, abs=1e-3)
        assert found["water.submergence"] == pytest.approx(s, abs=1e-12)
        assert found["water.surface"] == w

    @given(P=st.floats(-0.79, 5.0), V=SPEEDS)
    def test_above_the_water_there_is_weight_in_air_and_no_drag(self, P, V):
        # Rounded corners reach 5 % of 4 m above the surface.
        found = SPLASH(P, V, 0.0, 0.0, 0.0)
        assert found["force"] == -7e4
        assert found["mass"] == -5e4
        assert found["drag_factor"] == found["water.submergence"] == found["water.force"] == 0.0

    @given(P=st.floats(-60.0, -5.3), V=SPEEDS)
    def test_in_still_water_a_submerged_payload_is_the_plants_own(self, P, V):
        found = SPLASH(P, V, 0.0, 0.0, 0.0)
        assert found["force"] == pytest.approx(0.0, abs=1e-6)
        assert found["mass"] == pytest.approx(0.0, abs=1e-6)
        assert found["drag_factor"] == pytest.approx(1.0, abs=1e-12)
        assert found["relative_velocity"] == V
        assert found["water.force"] == pytest.approx(7e4)

    @given(
        state=st.lists(st.floats(-1.0, 1.0), min_size=40, max_size=40),
        command=st.floats(-100.0, 100.0),
    )
    def test_the_plant_under_water_is_the_plant(self, plants, state, command):
        plain, around = plants
        nx = len(plain.states)
        x = 0.05 * np.array(state[:nx])
        p = plain.parameter_vector({"payload.quadratic_drag": 2e4})
        q = around.parameter_vector({"payload.quadratic_drag": 2e4})
        w = np.array([0.3, -0.2, 0.0, 0.0])
        one = np.asarray(plain.function(x, command, w, p)[0]).ravel()
        two = np.asarray(around.function(x, command, np.append(w, np.zeros(3)), q)[0]).ravel()
        np.testing.assert_allclose(two, one, rtol=1e-12, atol=1e-10)

    @pytest.mark.parametrize("V", [-3.0, 0.0, 2.0])
    @pytest.mark.parametrize("surface", [(0.0, 0.0, 0.0), (0.7, 2.0, -1.5)])
    def test_nothing_jumps_on_the_way_down(self, V, surface):
        P = np.linspace(1.0, -7.0, 80001)  # every 0.1 mm
        states = np.vstack([P, np.broadcast_to([[V], *np.transpose([surface])], (4, P.size))])
        force = np.asarray(SPLASH.function.map(P.size)(*states))[0]
        # By slopes: buoyancy 18 kN/m, waves 57 t times 1.5 m/s2 over 1.2 m, and slamming of 41 kN
        # s2/m2 times (5 m/s)^2, which comes and goes within a tenth of 4 m.
        slope = 18e3 + 57e3 * 1.5 / 1.2 + 41e3 * 25.0 / 0.4
        assert np.max(np.abs(np.diff(force))) < 1.1 * slope * 1e-4

    def test_archimedes(self):
        # Half of the prism under still water carries half of the buoyancy.
        assert SPLASH(-3.0, 0.0, 0.0, 0.0, 0.0)["water.force"] == pytest.approx(3.5e4)

    def test_slamming_only_while_entering(self):
        rest = SPLASH(-1.8, 0.0, 0.0, 0.0, 0.0)["force"]
        into = SPLASH(-1.8, -1.5, 0.0, 0.0, 0.0)["force"] - rest
        assert into == pytest.approx(0.5 * 1025.0 * 5.0 * 16.0 * 1.5**2)
        wave = SPLASH(-1.8, 0.0, 0.0, 1.5, 0.0)["force"] - rest
        assert wave == pytest.approx(into)
        assert SPLASH(-1.8, 1.5, 0.0, 0.0, 0.0)["force"] == rest
        # Beyond 1.22 m and the rounded corner all of the added mass moves: no slam in deeper water.
        assert SPLASH(-2.5, -1.5, 0.0, 0.0, 0.0)["mass"] == pytest.approx(0.0, abs=1e-6)
        for P in (-2.5, -3.0, -6.0):
            still = SPLASH(P, 0.0, 0.0, 0.0, 0.0)["force"]
            assert SPLASH(P, -1.5, 0.0, 0.0, 0.0)["force"] == pytest.approx(still, abs=1e-6)
        assert SPLASH(0.0, -1.5, 0.0, 0.0, 0.0)["force"] == -7e4

    @pytest.mark.parametrize(("coefficient", "time"), [(0, 0.6), (1, 0.6), (5, 0.5), (20, 0.9)])
    def test_a_free_payload_shares_its_momentum_with_the_water(self, coefficient, time):
        # M v0 = (M + A33) v with A33 the mass that moves so far (von Karman's impact).
        zone = SplashZone(
            below=0.3, height=4.0, buoyancy=0.0, added_mass=5e4,
            slamming_area=16.0, slamming_coefficient=coefficient,
        )  # fmt: skip
        values = function_of(Surroundings(water=zone))
        mass, start = 8e4, 2.0

        def rates(_, state):
            found = values(*state, 0.0, 0.0, 0.0)
            return [state[1], found["force"] / (mass + 5e4 + found["mass"])]

        def at(end):
            run = solve_ivp(rates, (0.0, end), [0.0, -start], rtol=1e-9, atol=1e-9, max_step=0.01)
            return run.y[:, -1]

        _, speed = at(4.0)
        assert -speed == pytest.approx(start * mass / (mass + 5e4), rel=1e-6)
        # On the way, in the straight part, by the closed form with A33 = rate h.
        P, speed = at(time)
        rate = max(0.5 * 1025.0 * coefficient * 16.0, 5e4 / 4.0)
        added = min(5e4, rate * (-P - 0.3))
        assert -speed == pytest.approx(start * mass / (mass + added), rel=1e-6)

    def test_out_of_the_water_no_momentum_is_taken(self):
        force = [SPLASH(P, 2.0, 0.0, 0.0, 0.0)["force"] for P in (-1.2, -1.8, -2.4)]
        still = [SPLASH(P, 0.0, 0.0, 0.0, 0.0)["force"] for P in (-1.2, -1.8, -2.4)]
        assert force == still

    def test_waves_decay_with_depth(self):
        shallow = SPLASH(-5.5, 0.0, 0.0, 0.0, 1.0)["force"]
        deep = SPLASH(-25.5, 0.0, 0.0, 0.0, 1.0)["force"]
        assert deep / shallow == pytest.approx(math.exp(-0.05 * 20.0))
        # Middle of the prism 2.5 m down.
        assert shallow == pytest.approx((7e4 / 9.80665 + 5e4) * math.exp(-0.05 * 2.5))


class TestWhole:
    def test_seabed_and_splash_zone_add_up(self):
        both = function_of(Surroundings(ground=Seabed(below=2.0), water=ZONE))
        at = (-2.2, -0.5)
        surface = (0.1, 0.2, 0.3)
        total = both(*at, *surface)
        assert total["force"] == pytest.approx(
            SEABED(*at)["force"] + SPLASH(*at, *surface)["force"]
        )

    def test_nothing_around(self):
        nothing = Surroundings()
        assert nothing.motions == () == nothing.stiffness_rates(1e4)
        assert not nothing.parameters
        assert nothing.rest_force == 0.0
        found = function_of(nothing)(0.3, 0.4)
        assert found == {
            "force": 0.0, "mass": 0.0, "drag_factor": 1.0, "relative_velocity": 0.4
        }  # fmt: skip

    def test_motions_and_units(self):
        surroundings = Surroundings(ground=Deck(below=1.0), water=ZONE)
        assert surroundings.motions == ("deck", "surface")
        assert surroundings.output_units == {
            "contact.force": "N",
            "contact.gap": "m",
            "contact.closing_speed": "m/s",
            "deck.displacement": "m",
            "deck.velocity": "m/s",
            "water.force": "N",
            "water.surface": "m",
            "water.submergence": "-",
        }

    def test_symbols_take_the_place_of_numbers(self):
        surroundings = Surroundings(ground=Seabed(below=2.0))
        assert surroundings.parameters == {
            "seabed.below": 2.0, "seabed.stiffness": 1.8e6, "seabed.damping": 6.5e5
        }  # fmt: skip
        symbolic = function_of(surroundings, **{"seabed.stiffness": ca.SX.sym("k")})
        assert symbolic(-2.1, 0.0, 1.8e6) == SEABED(-2.1, 0.0)
        assert symbolic(-2.1, 0.0, 3.6e6)["force"] == pytest.approx(3.6e5)

    def test_force_at_the_start(self):
        assert Surroundings(ground=Deck(below=-0.1, stiffness=4e6)).rest_force == pytest.approx(4e5)
        assert Surroundings(water=ZONE).rest_force == -7e4
        assert Surroundings(ground=Seabed(below=2.0)).rest_force == 0.0

    @pytest.mark.parametrize(
        ("make", "message"),
        [
            (lambda: Seabed(below=-1.0), "seabed: below must be at least 0 m, got -1.0"),
            (lambda: Seabed(below=1.0, stiffness=0.0), "seabed: stiffness must be above 0 N/m, "),
            (lambda: Deck(below=math.nan), "deck: below must be a finite number in m, got nan"),
            (lambda: Deck(below=0.0, damping=-1.0), "deck: damping must be at least 0 N s/m.1.5, "),
            (
                lambda: SplashZone(below=0.0, height=0.0, buoyancy=1.0),
                "splash zone: height must be above 0 m, got 0.0",
            ),
            (
                lambda: SplashZone(below=0.0, height=1.0, buoyancy=-1.0),
                "splash zone: buoyancy must be at least 0 N, got -1.0",
            ),
        ],
    )
    def test_bad_numbers(self, make, message):
        with pytest.raises(InputError, match=message):
            make()
