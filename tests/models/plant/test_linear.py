"""The linear plant against scipy, python-control and closed forms."""

from __future__ import annotations

import dataclasses
import math

import control
import numpy as np
import pytest
import scipy.signal
from hypothesis import given
from hypothesis import strategies as st

from models.basics import InputError
from models.plant import LinearPlant, pade_bank, zero_order_hold
from models.plant.pade import pade_state_space

OMEGA = np.geomspace(0.05, 20.0, 40)


def random_plant(seed: int = 7, **changes: object) -> LinearPlant:
    rng = np.random.default_rng(seed)
    n, nu, nw, ny, nz = 5, 2, 3, 3, 2
    numbers: dict[str, object] = {
        "A": rng.normal(size=(n, n)) - 3.0 * np.eye(n),
        "B": rng.normal(size=(n, nu)),
        "E": rng.normal(size=(n, nw)),
        "C": rng.normal(size=(ny, n)),
        "D": rng.normal(size=(ny, nu)),
        "F": rng.normal(size=(ny, nw)),
        "Cz": rng.normal(size=(nz, n)),
        "Dz": rng.normal(size=(nz, nu)),
        "Fz": rng.normal(size=(nz, nw)),
        "disturbances": ("heave", "heave_rate", "force"),
        "outputs": ("position", "effort"),
    }
    return LinearPlant(**{**numbers, **changes})  # type: ignore[arg-type]


def oscillator(delay: float = 0.0) -> LinearPlant:
    """x'' + 0.2 x' + 4 x = u + Y + 0.05 Y', x measured with its velocity."""
    return LinearPlant(
        A=[[0.0, 1.0], [-4.0, -0.2]],
        B=[[0.0], [1.0]],
        E=[[0.0, 0.0], [1.0, 0.05]],
        C=[[1.0, 0.0], [0.0, 1.0]],
        Cz=[[1.0, 0.0]],
        disturbances=("base", "base_rate"),
        rates={"base_rate": "base"},
        outputs=("x",),
        delays=(delay, delay),
    )


def test_response_of_an_oscillator_is_the_closed_form() -> None:
    r = oscillator(delay=0.3).response(OMEGA)
    s = 1j * OMEGA
    inverse = 1.0 / (s**2 + 0.2 * s + 4.0)
    np.testing.assert_allclose(r.column("x", "base"), (1 + 0.05 * s) * inverse, rtol=1e-12)
    np.testing.assert_allclose(r.zu[:, 0, 0], inverse, rtol=1e-12)
    late = np.exp(-0.3 * s)
    np.testing.assert_allclose(r.yu[:, 1, 0], s * inverse * late, rtol=1e-12)
    np.testing.assert_allclose(r.yw[:, 0, 0], (1 + 0.05 * s) * inverse * late, rtol=1e-12)
    assert r.disturbances == ("base",)
    assert r.zw.shape == (40, 1, 1)
    assert r.yu.shape == (40, 2, 1)


def test_response_agrees_with_scipy_for_every_block() -> None:
    plant = random_plant()
    r = plant.response(OMEGA)
    for block, B, C, D in (
        ("zw", plant.E, plant.Cz, plant.Fz),
        ("zu", plant.B, plant.Cz, plant.Dz),
        ("yw", plant.E, plant.C, plant.F),
        ("yu", plant.B, plant.C, plant.D),
    ):
        for j in range(B.shape[1]):
            for i in range(C.shape[0]):
                system = (plant.A, B[:, [j]], C[[i]], D[[i], j : j + 1])
                _, wanted = scipy.signal.freqresp(system, OMEGA)
                np.testing.assert_allclose(getattr(r, block)[:, i, j], wanted, rtol=1e-9)


def test_response_of_many_points_is_that_of_each() -> None:
    plant = random_plant()  # more points than are solved at a time
    omega = np.linspace(0.1, 9.0, 700)
    many = plant.response(omega)
    for i in (0, 255, 256, 511, 512, 699):
        one = plant.response([omega[i]])
        np.testing.assert_allclose(many.zw[i], one.zw[0], rtol=1e-12)


def test_what_is_a_derivative_has_the_digits_of_what_it_is_one_of() -> None:
    """Two masses and two springs behind a drum: forces next to cancel in slow motion.

    Row by row against displacements, whose responses lose nothing, and noise that is in one
    measurement alone.
    """
    k, m, c = 1e6, np.array([3.0, 50e3]), 10.0
    A = np.zeros((5, 5))
    A[[0, 1], [2, 3]] = 1.0
    A[2] = np.array([-2.0 * k, k, -c, 0.0, k]) / m[0]
    A[3] = np.array([k, -k, 0.0, -c, 0.0]) / m[1]
    shaken = np.array([[0.0], [0.0], [0.0], [1.0 / m[1]], [0.0]])
    plant = LinearPlant(
        A=A,
        B=np.eye(5)[:, [4]],
        E=np.hstack([shaken, np.zeros((5, 1))]),
        C=np.array([A[3], np.eye(5)[3], np.eye(5)[1]]),
        D=np.zeros((3, 1)),
        F=[[1.0 / m[1], 0.0], [0.0, 1.0], [0.0, 0.0]],
        disturbances=["force", "noise of the velocity"],
    )
    s = 1j * np.geomspace(1e-7, 1e3, 31)
    acceleration, velocity, displacement = plant.response_at(s).yu[:, :, 0].T
    assert velocity == pytest.approx(s * displacement, rel=1e-12, abs=0.0)
    assert acceleration == pytest.approx(s * s * displacement, rel=1e-12, abs=0.0)
    # By the stiffness of both springs in series with each mass, which cancels nothing.
    near = m * s[:, None] ** 2 + c * s[:, None]
    two = k / ((near[:, 0] + k) * (near[:, 1] + k) + k * near[:, 1]) * k / s
    assert displacement == pytest.approx(two, rel=1e-9)
    acceleration, velocity, displacement = plant.response_at(s).yw[:, :, 0].T
    assert acceleration == pytest.approx(s * velocity, rel=1e-12, abs=0.0)
    assert displacement == pytest.approx(
        (near[:, 0] + 2.0 * k) / ((near[:, 0] + k) * (near[:, 1] + k) + k * near[:, 1]), rel=1e-9
    )
    assert np.array_equal(plant.response_at(s).yw[:, :, 1].T, [0.0 * s, 0.0 * s + 1.0, 0.0 * s])


@given(st.integers(0, 2**32 - 1), st.booleans())
def test_derivatives_of_any_plant_are_its_responses(seed: int, turning: bool) -> None:
    """Against solving at each point; also where signals are derivatives of each other."""
    rng = np.random.default_rng(seed)
    A, B, E = rng.normal(size=(4, 4)), rng.normal(size=(4, 2)), rng.normal(size=(4, 2))
    if turning:  # A squared is -I: every signal is minus the derivative of its derivative
        A = np.kron(np.eye(2), [[0.0, 1.0], [-1.0, 0.0]])
    row = rng.normal(size=(1, 4)).round(1)
    C = np.vstack([row @ A @ A @ A, row @ A @ A, row @ A, row])
    other = rng.normal(size=(1, 4))  # its derivative but for what comes at once
    Cz = np.vstack([other @ A, other])
    D = np.vstack([C[1:] @ B, rng.normal(size=(1, 2))])
    F = np.vstack([C[1:] @ E, np.zeros((1, 2))])
    F[0, 1] += 1.0
    plant = LinearPlant(A=A, B=B, E=E, C=C, D=D, F=F, Cz=Cz)
    points = np.array([0.3j, 2.0 + 1.0j, 7.0j])
    found = plant.response_at(points)
    for k, s in enumerate(points):
        inside = np.linalg.inv(s * np.eye(4) - A)
        assert found.yu[k] == pytest.approx(C @ inside @ B + D, rel=1e-7, abs=1e-7)
        assert found.yw[k] == pytest.approx(C @ inside @ E + F, rel=1e-7, abs=1e-7)
        assert found.zu[k] == pytest.approx(Cz @ inside @ B, rel=1e-7, abs=1e-7)


def test_rates_are_folded_in_with_their_feedthrough() -> None:
    plain = random_plant()
    folded = random_plant(rates={"heave_rate": "heave"})
    a, b = plain.response(OMEGA), folded.response(OMEGA)
    s = 1j * OMEGA[:, None]
    assert b.disturbances == ("heave", "force")
    for block in ("zw", "yw"):
        wanted = getattr(a, block)[:, :, 0] + s * getattr(a, block)[:, :, 1]
        np.testing.assert_allclose(getattr(b, block)[:, :, 0], wanted, rtol=1e-10)
        np.testing.assert_allclose(
            getattr(b, block)[:, :, 1], getattr(a, block)[:, :, 2], rtol=1e-10
        )


def test_response_at_complex_points_is_the_transfer_function() -> None:
    s = np.array([0.3 + 2.0j, 1.0, 5.0 - 1.0j])
    r = oscillator(delay=0.1).response_at(s)
    wanted = np.exp(-0.1 * s) / (s**2 + 0.2 * s + 4.0)
    np.testing.assert_allclose(r.yu[:, 0, 0], wanted, rtol=1e-12)
    np.testing.assert_allclose(r.omega, s.imag)
    np.testing.assert_allclose(r.s, s)


def test_a_static_plant_has_a_response() -> None:
    plant = LinearPlant(
        A=np.zeros((0, 0)), B=np.zeros((0, 1)), E=np.zeros((0, 1)), C=np.zeros((1, 0)), D=[[2.0]]
    )
    assert plant.response([0.0, 1.0]).yu[:, 0, 0] == pytest.approx([2.0, 2.0])


def test_an_integrator_has_no_response_at_zero() -> None:
    plant = LinearPlant(A=[[0.0, 1.0], [0.0, -0.3]], B=[[0.0], [1.0]], E=[[0], [1]], C=[[1, 0]])
    with pytest.raises(InputError, match="s = 0, where the plant has a pole"):
        plant.response([0.0])
    with pytest.raises(InputError, match=r"at a pole of the plant, s = -0\.3"):
        plant.response_at([-0.3])
    assert np.isfinite(plant.response([1e-6]).yu).all()


def test_poles() -> None:
    poles = np.sort_complex(oscillator().poles())
    damped = math.sqrt(4.0 - 0.01)
    np.testing.assert_allclose(poles, [-0.1 - 1j * damped, -0.1 + 1j * damped], rtol=1e-12)


@given(
    delay=st.floats(1e-3, 5.0),
    order=st.integers(1, 12),
    turn=st.floats(0.01, 2.0),
)
def test_pade_is_all_pass_stable_and_late_by_the_delay(
    delay: float, order: int, turn: float
) -> None:
    A, B, C, D = pade_state_space(delay, order)
    assert A.shape == (order, order)
    assert np.linalg.eigvals(A).real.max() < 0.0
    s = 1j * turn / delay
    value = (C @ np.linalg.solve(s * np.eye(order) - A, B) + D)[0, 0]
    assert abs(value) == pytest.approx(1.0, abs=1e-9)
    error = (
        turn ** (2 * order + 1)
        * (math.factorial(order) / math.factorial(2 * order)) ** 2
        / (2 * order + 1)
    )
    assert abs(value - np.exp(-1j * turn)) <= 4.0 * error + 1e-9


@pytest.mark.parametrize("order", [1, 2, 3, 6])
def test_pade_is_that_of_python_control(order: int) -> None:
    num, den = control.pade(0.4, order)
    A, B, C, D = pade_state_space(0.4, order)
    for s in (0.7j, 3j, 1.0 + 9j):
        value = (C @ np.linalg.solve(s * np.eye(order) - A, B) + D)[0, 0]
        assert value == pytest.approx(np.polyval(num, s) / np.polyval(den, s), rel=1e-9)


def test_pade_bank_lets_a_zero_delay_through() -> None:
    A, B, C, D = pade_bank([0.0, 0.2, 0.0], 3)
    assert A.shape == (3, 3)
    np.testing.assert_array_equal(D, np.diag([1.0, -1.0, 1.0]))  # odd order: -1 at infinity
    assert not B[:, [0, 2]].any()
    assert not C[[0, 2]].any()


@pytest.mark.parametrize("order", [7, 8])  # an odd model passes high frequencies with -1
def test_without_delays_at_the_measurements_keeps_all_blocks(order: int) -> None:
    plant = random_plant(delays={"y1": 0.05, "y3": 0.12}, rates={"heave_rate": "heave"})
    late = plant.without_delays(order)
    assert late.delays == (0.0, 0.0, 0.0)
    assert len(late.states) == 5 + 2 * order
    omega = np.linspace(0.1, 10.0, 30)
    a, b = plant.response(omega), late.response(omega)
    for block in ("zw", "zu", "yw", "yu"):
        np.testing.assert_allclose(getattr(b, block), getattr(a, block), rtol=1e-8, atol=1e-10)


@pytest.mark.parametrize("order", [7, 8])
def test_without_delays_at_the_inputs_keeps_the_loop(order: int) -> None:
    plant = random_plant(delays=(0.08, 0.08, 0.08))
    late = plant.without_delays(order)
    assert len(late.states) == 5 + 2 * order  # two inputs, fewer than three measurements
    assert len(plant.without_delays(order, at="measurements").states) == 5 + 3 * order
    omega = np.linspace(0.1, 10.0, 30)
    a, b = plant.response(omega), late.response(omega)
    np.testing.assert_allclose(b.yu, a.yu, rtol=1e-8, atol=1e-10)
    K = np.array([[0.1, -0.2, 0.05], [0.0, 0.1, 0.2]])
    closed = [r.zw + r.zu @ K @ np.linalg.solve(np.eye(3) - r.yu @ K, r.yw) for r in (a, b)]
    np.testing.assert_allclose(closed[1], closed[0], rtol=1e-8, atol=1e-10)


def test_without_delays_can_drop_them() -> None:
    plant = oscillator(delay=0.3)
    dropped = plant.without_delays(0)
    assert dropped.delays == (0.0, 0.0)
    assert len(dropped.states) == 2
    assert len(oscillator().without_delays(6).states) == 2


def test_without_delays_says_what_it_cannot_do() -> None:
    plant = random_plant(delays=(0.1, 0.2, 0.3))
    with pytest.raises(InputError, match="at must be one of auto, measurements; got 'outputs'"):
        plant.without_delays(4, at="outputs")
    with pytest.raises(InputError, match=r"pade_order must be in \[0, 12\], got 13"):
        plant.without_delays(13)


@pytest.mark.parametrize("dt", [0.01, 0.1, 1.0])
def test_a_sampled_plant_agrees_with_scipy(dt: float) -> None:
    plant = random_plant()
    BE = np.hstack([plant.B, plant.E])
    Ad, BEd = zero_order_hold(plant.A, BE, dt)
    DF = np.hstack([plant.D, plant.F])
    wanted = scipy.signal.cont2discrete((plant.A, BE, plant.C, DF), dt, method="zoh")
    np.testing.assert_allclose(Ad, wanted[0], atol=1e-12)
    np.testing.assert_allclose(BEd, wanted[1], atol=1e-12)


def test_a_double_integrator_is_sampled_exactly() -> None:
    Ad, Bd = zero_order_hold(np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]]), 0.2)
    np.testing.assert_allclose(Ad, [[1.0, 0.2], [0.0, 1.0]], atol=1e-15)
    np.testing.assert_allclose(Bd, [[0.02], [0.2]], atol=1e-15)


def test_to_control_has_names_and_the_same_response() -> None:
    plant = random_plant(
        delays=(0.02, 0.0, 0.02),
        states=("drum.angle", "drum.speed", "s3", "s4", "s5"),
        measurements=("position", "speed", "pay.load"),
    )
    system = plant.to_control(6)
    assert system.input_labels == ["u1", "u2", "heave", "heave_rate", "force"]
    wanted = ["measured_position", "speed", "pay_load", "position", "effort"]
    assert system.output_labels == wanted
    assert system.state_labels[:2] == ["drum_angle", "drum_speed"]
    r = plant.response(OMEGA)
    whole = np.block([[r.yu, r.yw], [r.zu, r.zw]])
    theirs = np.moveaxis(system(1j * OMEGA), 2, 0)
    np.testing.assert_allclose(theirs, whole, rtol=1e-8, atol=1e-10)


def test_select_keeps_what_belongs_together() -> None:
    plant = random_plant(
        delays=(0.1, 0.2, 0.3),
        units={"position": "m", "effort": "N", "y2": "m"},
        static={"effort": 5.0, "position": 0.0},
    )
    some = plant.select(outputs=["effort"], measurements=["y3", "y2"])
    assert some.outputs == ("effort",)
    assert some.delays == (0.3, 0.2)
    assert dict(some.units) == {"effort": "N", "y2": "m"}
    assert dict(some.static) == {"effort": 5.0}
    a, b = plant.response(OMEGA), some.response(OMEGA)
    np.testing.assert_allclose(b.zw[:, 0], a.zw[:, 1], rtol=1e-12)
    np.testing.assert_allclose(b.yu, a.yu[:, [2, 1]], rtol=1e-12)
    with pytest.raises(InputError, match="no output 'effrt'; there are: position, effort"):
        plant.select(outputs=["effrt"])


def test_response_selects_by_name() -> None:
    r = random_plant().response(OMEGA)
    some = r.select(outputs=["effort"], disturbances=["force", "heave"], measurements=["y2"])
    np.testing.assert_array_equal(some.zw[:, 0, 0], r.column("effort", "force"))
    np.testing.assert_array_equal(some.zw[:, 0, 1], r.column("effort", "heave"))
    np.testing.assert_array_equal(some.yw[:, 0, 0], r.yw[:, 1, 2])
    assert some.yu.shape == (40, 1, 2)
    with pytest.raises(InputError, match="no disturbance 'wind'; there are: heave"):
        r.column("effort", "wind")


def test_arrays_cannot_be_written_to() -> None:
    A = np.eye(2) * -1.0
    plant = LinearPlant(A=A, B=np.ones((2, 1)), E=np.ones((2, 1)), C=np.ones((1, 2)))
    A[0, 0] = 5.0
    assert plant.A[0, 0] == -1.0
    with pytest.raises(ValueError, match="read-only"):
        plant.A[0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        plant.response([1.0]).zw[...] = 0.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        plant.A = A  # type: ignore[misc]
    with pytest.raises(TypeError):
        plant.static["x1"] = 1.0  # type: ignore[index]


def test_names_and_matrices_have_defaults() -> None:
    plant = LinearPlant(A=-np.eye(2), B=np.ones((2, 1)), E=np.ones((2, 3)), C=np.ones((2, 2)))
    assert plant.states == ("x1", "x2")
    assert plant.inputs == ("u1",)
    assert plant.disturbances == ("w1", "w2", "w3")
    assert plant.measurements == ("y1", "y2")
    assert plant.outputs == ()
    assert plant.delays == (0.0, 0.0)
    assert plant.F.shape == (2, 3)
    assert plant.Fz.shape == (0, 3)
    assert plant.response([1.0]).zw.shape == (1, 0, 3)


GOOD = {"A": -np.eye(2), "B": np.ones((2, 1)), "E": np.ones((2, 1)), "C": np.ones((1, 2))}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"A": np.ones((2, 3))}, r"A must have the shape \(2, 2\).*got \(2, 3\)"),
        ({"B": np.ones((3, 1))}, r"B must have the shape \(2, 1\).*got \(3, 1\)"),
        ({"C": np.ones((1, 3))}, r"C must have the shape \(1, 2\).*got \(1, 3\)"),
        ({"F": np.ones((1, 2))}, r"F must have the shape \(1, 1\).*got \(1, 2\)"),
        ({"Dz": np.ones((1, 1))}, r"Dz must have the shape \(0, 1\).*got \(1, 1\)"),
        ({"B": np.ones(2)}, "B must be a matrix, got an array of 1 axes"),
        ({"A": [[1.0, math.nan], [0.0, 1.0]]}, "A must be finite numbers, got nan at index 0, 1"),
        ({"A": [["a", "b"], ["c", "d"]]}, "A must be numbers"),
        ({"states": ("x",)}, "states must be 2 names, got 1"),
        ({"states": ("x", "x")}, "states must have names that differ, got 'x' twice"),
        ({"inputs": ("f",), "disturbances": ("f",)}, "inputs and disturbances must differ"),
        ({"delays": (0.1, 0.2)}, "delays must be 1 numbers, one for each measurement, got 2"),
        ({"delays": (-0.1,)}, r"delay of y1 must be at least 0 s, got -0\.1"),
        ({"delays": {"y9": 0.1}}, r"no measurement \(in delays\) 'y9'; there are: y1"),
        ({"rates": {"w1": "w9"}}, r"no disturbance \(in rates\) 'w9'"),
        ({"rates": {"w1": "w1"}}, "got 'w1' as the rate of 'w1', which is a rate too"),
        ({"units": {"q": "m"}}, r"no signal \(in units\) 'q'"),
        ({"static": {"x1": math.inf}}, "static x1 must be a finite number, got inf"),
    ],
)
def test_bad_input_is_named(changes: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        LinearPlant(**{**GOOD, **changes})  # type: ignore[arg-type]


def test_response_refuses_what_is_no_frequency() -> None:
    with pytest.raises(InputError, match="omega must be finite numbers, got nan at index 1"):
        oscillator().response([1.0, math.nan])


def test_prints_as_a_small_tree() -> None:
    assert str(oscillator(delay=0.05)) == (
        "LinearPlant with 2 states\n"
        "├ inputs: u1\n"
        "├ disturbances: base\n"
        "├ measurements: y1 (50 ms late), y2 (50 ms late)\n"
        "└ outputs: x"
    )


def test_an_element_closed_around_a_plant_is_a_rank_one_update() -> None:
    """P_ab + P_af g P_vb / (1 - g P_vf), Woodbury's formula for the feedback w_f += g z_v."""
    plant = dataclasses.replace(random_plant(), Dz=None, Fz=None, outputs=("position", "effort"))
    gain = -0.7
    closed = plant.with_element("effort", "force", gain).response(OMEGA)
    r = plant.response(OMEGA)
    factor = gain / (1.0 - gain * r.zw[:, 1, 2])[:, None, None]
    for block, out, into in (
        ("zw", r.zw, r.zw),
        ("zu", r.zw, r.zu),
        ("yw", r.yw, r.zw),
        ("yu", r.yw, r.zu),
    ):
        update = factor * out[:, :, 2:] * into[:, 1:2]
        want = getattr(r, block) + update
        np.testing.assert_allclose(getattr(closed, block), want, rtol=1e-10, atol=1e-13)


def test_an_element_closed_around_a_plant_needs_a_pure_state() -> None:
    plant = random_plant()
    with pytest.raises(InputError, match="effort must have no direct term"):
        plant.with_element("effort", "force", 1.0)
    with pytest.raises(InputError, match="there is no output 'speed'"):
        plant.with_element("speed", "force", 1.0)


@pytest.mark.parametrize("order", [0, 2])
def test_controller_closed_around_a_plant_is_the_loop_of_its_responses(order: int) -> None:
    """[z; y] = G [v; w] with u = K y + v: z = zw w + zu (I - K yu)^-1 (K yw w + v)."""
    plant, rng = random_plant(), np.random.default_rng(1)
    matrices = [rng.normal(size=shape) for shape in ((order,) * 2, (order, 3), (2, order), (2, 3))]
    A, B, C, D = matrices
    closed = plant.with_feedback(A, B, C, D).response(OMEGA)
    r = plant.response(OMEGA)
    s = 1j * OMEGA[:, None, None]
    K = C @ np.linalg.solve(s * np.eye(order) - A, np.broadcast_to(B, (OMEGA.size, order, 3))) + D
    inverse = np.linalg.inv(np.eye(2) - K @ r.yu)
    for found, want in (
        (closed.zw, r.zw + r.zu @ inverse @ K @ r.yw),
        (closed.zu, r.zu @ inverse),
        (closed.yw, r.yw + r.yu @ inverse @ K @ r.yw),
        (closed.yu, r.yu @ inverse),
    ):
        np.testing.assert_allclose(found, want, rtol=1e-9, atol=1e-12)
    assert len(plant.with_feedback(A, B, C, D).states) == 5 + order


def test_controller_is_not_closed_around_delays() -> None:
    with pytest.raises(InputError, match="no rational loop can be closed with delays"):
        random_plant(delays=(0.1, 0.0, 0.0)).with_feedback(
            np.zeros((0, 0)), np.zeros((0, 3)), np.zeros((2, 0)), np.zeros((2, 3))
        )


def test_frequencies_at_an_undamped_pole_are_moved_a_hair_off_it() -> None:
    plant = LinearPlant(
        A=scipy.linalg.block_diag([[0.0, 2.0], [-2.0, 0.0]], [[0.0, 5.0], [-5.0, -0.1]]),
        B=np.ones((4, 1)),
        E=np.ones((4, 1)),
        C=np.ones((1, 4)),
    )
    omega = np.array([1.0, 2.0, 2.0 + 1e-12, 2.0 - 1e-12, 5.0, 7.0])
    moved = plant.beside_poles(omega)
    assert moved == pytest.approx(omega, rel=2e-8)
    assert moved[[0, 4, 5]].tolist() == [1.0, 5.0, 7.0]
    assert np.abs(moved[1:4] - 2.0).min() > 1e-9
    assert moved[2] > moved[3]
    assert np.isfinite(plant.response(moved).yu).all()
