"""Loops by the thousand: their poles, peaks and nodes against one loop at a time."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import numpy.typing as npt
import pytest
from designs import thesis_design
from former_cases import load_case

from models.basics import FrequencyAxis
from models.plant import build_plant, lump_rope
from models.spread import LogNormal, Normal, Spread
from synth import evaluate_gains
from synth.loop import closed_loop_poles
from synth.question import pose
from synth.structures import PayloadFeedback
from synth.sweeps import FrequencyEngine
from synth.sweeps.chain import ChainLoops
from synth.sweeps.kernel import hurwitz
from synth.sweeps.law_rows import DesignLaw
from synth.sweeps.numbers import numbers_of
from synth.sweeps.sweep_nodes import sweep_nodes, sweep_panels
from synth.sweeps.winding_count import calming_drag, survey
from synth.verify import LawMatrices
from synth.verify.winding import count_unstable as wind_one

FloatArray = npt.NDArray[np.float64]

GAINS_ON_ROPE = {"A": 1.0, "a": 16.0, "a1": 44.0, "a2": 6.4}
SPRING = Spread(
    {
        "payload.mass": "20 %",
        "stiffness": "30 %",
        "winch.motor.inertia": "10 %",
        "payload.drag.coefficient": LogNormal(sigma=0.3),
        "gains.a": "50 %",
        "gains.a1": "60 %",
        "gains.a2": "80 %",
    }
)


def closed_poles(engine: FrequencyEngine, row: FloatArray) -> npt.NDArray[np.complex128]:
    """Poles of a loop without delay, from the state space; its drag is given."""
    case = engine.spread.case_at(row)
    plant = build_plant(case, engine.design.masses).linearise(drag=case.payload.fixed_drag or 0.0)
    own = engine.spread.gains(row)
    law = PayloadFeedback().bind(plant).controller([own[name] for name in ("a", "a1", "a2")])
    return closed_loop_poles(plant, law)


def chains(
    masses: int, count: int, seed: int, delay: float, law: str = "kelvin-voigt"
) -> tuple[FrequencyEngine, ChainLoops]:
    """Loops of random gains of either sign around the crane's rope, lightly damped."""
    case = load_case("subsea-crane").replace(
        {
            "rope.masses": masses,
            "rope.damping_ratio": 0.003,
            "rope.damping_law": law,
            "payload.drag": {"method": "given", "coefficient": 3000.0},
            "sensors.telemetry.delay": delay,
        }
    )
    wide = {
        f"gains.{name}": Normal(0.0, size) for name, size in (("a", 25), ("a1", 60), ("a2", 40))
    }
    design = replace(evaluate_gains(case, GAINS_ON_ROPE), verification=None)
    engine = FrequencyEngine(design, Spread({**wide, "payload.mass": "40 %", "depth": "-0 %"}))
    rows = engine.spread.sample(count, seed=seed)
    numbers, _ = numbers_of(case, engine.spread, rows)
    columns = DesignLaw(design.question, design.parameters).columns(engine.spread, rows)
    loops = ChainLoops(
        count=count,
        numbers=numbers,
        law=columns,
        drag=numbers["fixed_drag"],
        lumps=lump_rope(masses),
    )
    return engine, loops


@pytest.mark.parametrize("degree", range(1, 10))
def test_rouths_array_knows_stable_polynomials(degree: int) -> None:
    rng = np.random.default_rng(degree)
    # Roots on both sides, over four decades of size: half of the polynomials are stable.
    count = 3000
    columns = np.empty((count, degree + 1))
    stable = np.empty(count, dtype=bool)
    for k in range(count):
        sizes = 10.0 ** rng.uniform(-2.0, 2.0, degree)
        chance = 0.5 ** (1.0 / degree)
        roots: list[complex] = []
        while len(roots) < degree:
            left = -1.0 if rng.uniform() < chance else 1.0
            size = sizes[len(roots)]
            if degree - len(roots) > 1 and rng.uniform() < 0.6:
                turn = rng.uniform(0.02, 1.55)
                root = size * complex(left * np.sin(turn), np.cos(turn))
                roots += [root, root.conjugate()]
            else:
                roots.append(left * size)
        columns[k] = rng.uniform(-3.0, 3.0) * np.poly(roots)[::-1].real
        stable[k] = all(root.real < 0.0 for root in roots)
    found = hurwitz([np.ascontiguousarray(c) for c in columns.T])
    np.testing.assert_array_equal(found, stable)
    assert 0.1 < stable.mean() < 0.9


@pytest.mark.parametrize(
    ("masses", "law"),
    [
        (1, "kelvin-voigt"),
        (3, "kelvin-voigt"),
        (10, "kelvin-voigt"),
        (1, "hysteretic"),
        (4, "hysteretic"),
    ],
)
def test_winding_number_counts_the_eigenvalues(masses: int, law: str) -> None:
    engine, loops = chains(masses, 60, seed=masses, delay=0.0, law=law)
    rows = engine.spread.sample(60, seed=masses)
    counts = survey(loops)[0]
    expected = [int((closed_poles(engine, row).real > 0.0).sum()) for row in rows]
    assert counts.tolist() == expected
    # Hysteretic modes that are not damped by their frequency seldom stand such gains.
    least = 0 if law == "hysteretic" and masses > 1 else 5
    assert least < sum(n == 0 for n in expected) < 55


def test_winding_number_with_delay_is_that_of_one_loop_followed_alone() -> None:
    engine, loops = chains(8, 10, seed=5, delay=0.25)
    rows = engine.spread.sample(10, seed=5)
    counts = survey(loops)[0]
    expected = []
    for row in rows:
        question = pose(engine.spread.case_at(row), masses=engine.design.masses)
        view = question.assess({"A": 1.0, **engine.spread.gains(row)})
        law = LawMatrices.of(view.controller, view.plant)

        def difference(s: npt.NDArray[np.complex128], view=view, law=law):  # type: ignore[no-untyped-def]
            through = law(s) @ view.plant.response_at(s).yu
            return 1.0 - through[:, 0, 0]

        poles = view.plant.poles()
        poles = np.where(np.abs(poles) < 1e-9, 0.0, poles)
        expected.append(
            wind_one(difference, poles=poles, marks=view.poles, per_decade=200).unstable
        )
    assert counts.tolist() == expected
    assert len(set(expected)) > 1


def test_peak_sensitivity_is_that_of_a_dense_search() -> None:
    engine, loops = chains(6, 40, seed=2, delay=0.03)
    rows = engine.spread.sample(40, seed=2)
    peaks = survey(loops)[1]
    for k, row in enumerate(rows[:12]):
        poles = closed_poles(engine, row)  # without the delay: near enough to look around
        omega = np.geomspace(1e-3, 1e3, 60_001)
        near = [abs(p.imag) + abs(p.real) * np.linspace(-6.0, 6.0, 4001) for p in poles]
        omega = np.concatenate([omega, *near])
        omega = omega[omega > 0.0]
        closed, free = loops.responses(np.array([k]), np.asarray(1j * omega))
        sizes = np.abs(closed / free)[0]
        centre = float(omega[np.argmin(sizes)])
        width = 1e-2 * centre
        for _ in range(12):
            fine = centre + width * np.linspace(-1.0, 1.0, 201)
            closed, free = loops.responses(np.array([k]), np.asarray(1j * fine))
            sizes = np.abs(closed / free)[0]
            centre, width = float(fine[np.argmin(sizes)]), 0.1 * width
        assert peaks[k] == pytest.approx(1.0 / sizes.min(), rel=1e-9)


class _Spiked:
    """One loop with smooth closed poles whose sensitivity has a resonance a hair wide."""

    masses, law = 1, SimpleNamespace(swiftest=0.0)
    mode_spacing = np.array([7.0])

    def __len__(self) -> int:
        return 1

    def responses(self, rows: npt.NDArray[np.intp], s: npt.NDArray[np.complex128]):  # type: ignore[no-untyped-def]
        s = np.atleast_2d(s) + np.zeros((rows.size, 1))
        closed = (s + 1.0) ** 3
        return closed, closed * self.sensitivity(s)

    @staticmethod
    def sensitivity(s: npt.NDArray[np.complex128]) -> npt.NDArray[np.complex128]:
        return np.asarray((s * s + 2.0 * s + 4.0) / (s * s + 2e-5 * s + 3.123**2))


def test_a_peak_of_the_sensitivity_between_two_points_is_followed() -> None:
    count, peak = survey(cast("ChainLoops", _Spiked()))
    assert count[0] == 0
    near = 1j * (3.123 + np.linspace(-1e-5, 1e-5, 20001))
    assert peak[0] == pytest.approx(np.abs(_Spiked.sensitivity(near)).max(), rel=1e-6)


def test_spring_and_chain_agree_where_both_are_possible() -> None:
    engine = FrequencyEngine(thesis_design(), SPRING)
    rows = engine.spread.sample(500, seed=3)
    found = engine.evaluate(rows)
    numbers, _ = numbers_of(engine.case, engine.spread, rows)
    law = engine.rows.law.columns(engine.spread, rows)
    loops = ChainLoops(
        count=len(rows),
        numbers=numbers,
        law=law,
        drag=numbers["fixed_drag"],
        lumps=lump_rope(1, "thesis"),
    )
    stable = found["stable"].astype(bool)
    np.testing.assert_array_equal(survey(loops)[0] == 0, stable)
    chosen = np.flatnonzero(stable)
    np.testing.assert_allclose(
        survey(loops, chosen)[1], found["max_sensitivity"][chosen], rtol=1e-8
    )


def test_drag_from_which_a_loop_is_stable_is_where_the_axis_is_crossed() -> None:
    engine, loops = chains(4, 12, seed=9, delay=0.05)
    del engine
    edge = calming_drag(loops)
    rows = np.flatnonzero((edge > 0.0) & np.isfinite(edge))
    assert rows.size > 3
    never = np.flatnonzero(np.isinf(edge))
    assert never.size > 0
    assert np.all(survey(loops.with_drag(np.array([1e12])), never)[0] == 1)
    edge = np.where(np.isinf(edge), 0.0, edge)
    calm = np.setdiff1d(np.arange(12), [*rows, *never])
    above = survey(loops.with_drag(edge * 1.0001), rows)[0]
    below = survey(loops.with_drag(edge * 0.9999), rows)[0]
    assert np.all(above == 0)
    assert np.all(below > 0)
    assert np.all(survey(loops.with_drag(np.zeros(1)), calm)[0] == 0)


@pytest.mark.parametrize(("short", "degrees"), [(False, (22, 13)), (True, (16, 9))])
def test_gauss_kronrod_pair_is_exact_to_its_degree(short: bool, degrees: tuple[int, int]) -> None:
    # Polynomials in ln omega on one panel: weights hold the omega of d omega.
    axis = FrequencyAxis(1.0, 2.0, half_line=False)
    panels = sweep_panels(axis, [])
    nodes = sweep_nodes(axis, panels, np.ones_like, short=panels if short else ())
    t, top = np.log(nodes.omega), np.log(2.0)
    for rule, most in zip(nodes.weights, degrees, strict=True):
        for power in range(most + 1):
            found = float((rule / nodes.omega) @ (t / top) ** power)
            assert found == pytest.approx(top / (power + 1.0), rel=1e-13)


@pytest.mark.parametrize("half_line", [False, True])
def test_density_with_kinks_stands_in_the_weights(half_line: bool) -> None:
    def density(omega: FloatArray) -> FloatArray:
        return np.interp(omega, [1.0, 1.3, 2.2, 4.0], [1.0, 5.0, 0.5, 2.0], right=0.0)

    axis = FrequencyAxis(1.0, 5.0, half_line)
    panels = sweep_panels(axis, [])
    smooth = sweep_nodes(axis, panels, density, kinks=[1.3, 2.2, 4.0])
    cut = sweep_nodes(axis, sweep_panels(axis, [1.3, 2.2, 4.0]), density)
    assert len(smooth) < len(cut)

    def response(omega: FloatArray) -> FloatArray:
        return 1.0 / ((1.0 - 0.3 * omega**2) ** 2 + omega**2)

    for rule, accuracy in zip((0, 1), (1e-9, 1e-4), strict=True):
        found = response(smooth.omega) @ smooth.sea[rule]
        assert found == pytest.approx(response(cut.omega) @ cut.sea[0], rel=accuracy)
    # On its own panels the difference of the two rules is the whole's.
    apart = sweep_nodes(axis, panels, density, kinks=[1.3, 2.2, 4.0], apart=True)
    difference = response(smooth.omega) @ (smooth.sea[0] - smooth.sea[1])
    assert (response(apart.omega) @ apart.sea[1:].T).sum() == pytest.approx(difference, rel=1e-9)
