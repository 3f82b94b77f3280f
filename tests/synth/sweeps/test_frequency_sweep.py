"""The vectorised engine: every number of it is that of one loop looked at alone."""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest
from designs import thesis_design, unstable_design
from former_cases import load_case
from solved_loops import solved_variance

from models.basics import InputError, Quadrature, spectral_nodes
from models.case import Case
from models.hook import HookMotion
from models.plant import PlantData, consistent_drag
from models.spread import LogNormal, Samples, Spread, Uniform
from synth import Design, evaluate_gains
from synth.design import optimise_gains
from synth.loop import Assessment
from synth.question import DesignQuestion, pose
from synth.robust import robustness
from synth.sweeps import (
    METRICS,
    FrequencyEngine,
    case_of,
    frequency_sweep,
    law_of,
    spread_of,
)
from synth.sweeps.metrics import DEFAULT
from synth.sweeps.numbers import BRANCH_GAINS, BRANCH_TIMES, numbers_of

FloatArray = npt.NDArray[np.float64]

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
ROPE = Spread(
    {
        "payload.mass": "30 %",
        "stiffness": "20 %",
        "payload.drag_coefficient": "50 %",
        "delay": Uniform("20 ms", "60 ms"),
        "gains.a": "60 %",
        "gains.a1": "60 %",
    }
)
GAINS_ON_ROPE = {"A": 1.0, "a": 16.0, "a1": 44.0, "a2": 6.4}
OUTPUTS = {
    "payload_rms": "payload.displacement",
    "velocity_rms": "payload.velocity",
    "torque_rms": "motor.torque",
    "speed_rms": "motor.speed",
    "haul_rms": "drum.haul",
    "tension_rms": "rope.tension",
    "lower_tension_rms": "rope.lower_tension",
    "current_rms": "motor.current",
}


RIG = {"crane.tip_stiffness": 1e6, "rigging.stiffness": 2e6, "rigging.block_mass": 3e3}
OF_RIG = {"crane.tip_stiffness": "20 %", "rigging.stiffness": "30 %", "rigging.block_mass": "9 %"}
EXACT = {f"sensors.payload.{n}_noise": 0.0 for n in ("acceleration", "velocity", "displacement")}


@pytest.fixture(scope="module")
def rope_design() -> Design:
    """Some gains on the crane's rope as six masses, its sensors exact, drag solved with it."""
    case = load_case("subsea-crane").replace({"rope.masses": 6, **EXACT})
    return replace(evaluate_gains(case, GAINS_ON_ROPE), verification=None)


@pytest.fixture(scope="module")
def hysteretic_design() -> Design:
    """The same gains with a damping that keeps them stable in every mode."""
    law = {"rope.damping_law": "hysteretic", "rope.damping_ratio": 0.02}
    case = load_case("subsea-crane").replace({"rope.masses": 6, **EXACT, **law})
    return replace(evaluate_gains(case, GAINS_ON_ROPE), verification=None)


@pytest.fixture(scope="module")
def rigged_design() -> Design:
    """The first gains below a boom and above slings that give."""
    more = {"rope.damping_ratio": 0.01, "limits.drive": "report", **RIG}
    more |= {"rope.falls": 2, "winch.drum.radius": 1.07, "rope.sheaves": 3}
    case = load_case("subsea-crane").replace({"rope.masses": 6, **EXACT, **more})
    return replace(evaluate_gains(case, GAINS_ON_ROPE), verification=None)


@pytest.fixture(scope="module")
def hysteretic_rigged_design(hysteretic_design: Design) -> Design:
    case = hysteretic_design.case.replace({"limits.drive": "report", **RIG})
    return replace(evaluate_gains(case, GAINS_ON_ROPE), verification=None)


def few_nodes(case: Case) -> Quadrature:
    hook = HookMotion.from_case(case)
    return spectral_nodes(*hook.band, splits=hook.splits, per_panel=6)


def alone(
    engine: FrequencyEngine,
    row: FloatArray,
    drag: float | None = None,
    nodes: Quadrature | None = None,
) -> Assessment:
    """The same case through `synth.question.question` and `synth.loop.assess`."""
    own = {**engine.design.parameters, **engine.spread.gains(row)}  # type: ignore[union-attr]
    question = posed(engine, tuple(row))
    if drag is None or question.loss is None:
        return question.assess(own, None if drag is None else [drag])
    given = {"payload.drag": {"method": "given", "coefficient": drag}}
    posed_so = pose(question.case.replace(given), masses=question.masses)
    problem = posed_so.problem
    return Assessment(
        problem.plant,
        posed_so.controller(own),
        problem.disturbances,
        elements=problem.elements,
        nodes=None if nodes is None else lambda _: nodes,
    )


@cache
def posed(engine: FrequencyEngine, row: tuple[float, ...]) -> DesignQuestion:
    return pose(engine.spread.case_at(row), masses=engine.design.masses)


def variance(view: Assessment, output: str, nodes: Quadrature) -> float:
    return float(nodes.integrate(view.spectrum(output, nodes.omega)))


def test_columns_of_numbers_are_those_of_the_checked_cases() -> None:
    common = {
        "payload.mass": "20 %",
        "stiffness": "30 %",
        "rope.length": Uniform("-20 %", "0 %"),
        "rope.mass_per_length": "5 %",
        "rope.damping_ratio": Uniform(0.0, 0.05),
        "payload.drag_coefficient": "30 %",
        "payload.water_density": "2 %",
        "winch.gearbox.ratio": "5 %",
        "winch.drum.inertia": Uniform(0.0, 1e4),
        "delay": Uniform("0 ms", "50 ms"),
        **OF_RIG,
    }
    own = {
        "thesis-1975": {"winch.motor.resistance": "5 %", "winch.motor.back_emf_constant": "5 %"},
        "subsea-crane": {"winch.motor.speed_gain": "9 %", "winch.gearbox.efficiency": "3 %"},
        "landing": {"sensors.payload.bandwidth": "20 %", "winch.motor.torque_bandwidth": "9 %"},
    }
    laws = "kelvin-voigt", "hysteretic"
    for (name, more), law in itertools.product(own.items(), laws):
        case = load_case(name).replace({"rope.damping_law": law, **RIG, "rigging.block_mass": 99.0})
        if name == "subsea-crane":
            case = case.replace({"rope.falls": 2, "rope.length": 700.0})
        spread = Spread({**common, **more}).on(case)
        rows = spread.sample(24)
        numbers, columns = numbers_of(case, spread, rows)
        assert columns
        for k, row in enumerate(rows):
            data = PlantData.from_case(spread.case_at(row))
            for field, values in numbers.items():
                expected, found = getattr(data, field, None), values[k % values.size]
                if expected is not None:
                    assert found == pytest.approx(expected, rel=1e-12, nan_ok=True), field
            slow, gains, times = data.branches
            held = {"slow": slow, **dict(zip(BRANCH_GAINS, gains, strict=False))}
            held |= dict(zip(BRANCH_TIMES, times, strict=False))
            for field, expected in held.items():
                found = numbers[field][k % numbers[field].size]
                assert found == pytest.approx(expected, rel=1e-12), field


def test_path_without_columns_goes_through_its_cases() -> None:
    spread = Spread({"rope.diameter": "2 %", "payload.mass": "5 %"})
    design = replace(evaluate_gains(load_case("landing"), GAINS_ON_ROPE), verification=None)
    engine = FrequencyEngine(design, spread, metrics=["static_torque"])
    rows = engine.spread.sample(6)
    found = engine.evaluate(rows)["static_torque"]
    assert engine.rows.columns is False
    for row, torque in zip(rows, found, strict=True):
        assert torque == pytest.approx(engine.spread.case_at(row).static_torque_budget, rel=1e-12)


def test_spring_sweep_is_one_by_one_evaluation_on_the_same_nodes() -> None:
    design = thesis_design()
    nodes = few_nodes(design.case)
    engine = FrequencyEngine(
        design, SPRING, metrics=[*OUTPUTS, "voltage_rms", "payload_period"], nodes=nodes
    )
    rows = engine.spread.sample(24)
    found = engine.evaluate(rows)
    assert 5 < found["stable"].sum() < 24
    for k, row in enumerate(rows):
        view = alone(engine, row)
        assert bool(found["stable"][k]) == view.stable
        if not view.stable:
            assert np.isnan(found["payload_rms"][k])
            continue
        for name, output in {**OUTPUTS, "voltage_rms": "motor.voltage"}.items():
            expected = np.sqrt(variance(view, output, nodes))
            assert found[name][k] == pytest.approx(expected, rel=1e-10), name
        spectrum = view.spectrum("payload.displacement", nodes.omega)
        ratio = nodes.integrate(spectrum) / nodes.integrate(spectrum * nodes.omega**2)
        assert found["payload_period"][k] == pytest.approx(2 * np.pi * np.sqrt(ratio), rel=1e-10)


@pytest.mark.parametrize(
    "fixture", ["rope_design", "hysteretic_design", "rigged_design", "hysteretic_rigged_design"]
)
def test_rope_sweep_is_one_by_one_evaluation_on_the_same_nodes(
    fixture: str, request: pytest.FixtureRequest
) -> None:
    design: Design = request.getfixturevalue(fixture)
    nodes = few_nodes(design.case)
    rig = OF_RIG if design.case.crane.tip_stiffness else {}
    spread = Spread({**ROPE.distributions, **rig})
    engine = FrequencyEngine(design, spread, metrics=[*OUTPUTS, "drag"], nodes=nodes)
    rows = engine.spread.sample(6)
    found = engine.evaluate(rows)
    assert found["stable"].sum() > 3
    for k, row in enumerate(rows):
        case = engine.spread.case_at(row)

        def velocity(C: float, row: FloatArray = row) -> float:
            return float(np.sqrt(variance(alone(engine, row, C, nodes), "payload.velocity", nodes)))

        C = consistent_drag(case.payload.quadratic_drag, velocity, tolerance=1e-13)
        assert bool(found["stable"][k]) == alone(engine, row, C, nodes).stable
        if found["stable"][k]:
            assert found["drag"][k] == pytest.approx(C, rel=1e-10)
            view = alone(engine, row, float(found["drag"][k]), nodes)
            for name, output in OUTPUTS.items():
                expected = np.sqrt(solved_variance(view, output, nodes))
                assert found[name][k] == pytest.approx(expected, rel=1e-10), name


@pytest.mark.parametrize("latest", [0.0, 0.06])
def test_nodes_of_its_own_are_as_good_as_an_adaptive_integral(latest: float) -> None:
    late = {"delay": Uniform(0.0, latest)} if latest else {}
    engine = FrequencyEngine(thesis_design(), Spread({**SPRING.distributions, **late}))
    rows = engine.spread.sample(300)
    found = engine.evaluate(rows)
    assert engine.rows.refined > 0
    # The loops nearest to the edge are the hard ones.
    stable = np.flatnonzero(found["stable"])
    hardest = stable[np.argsort(found["max_sensitivity"][stable])[-4:]]
    for k in [*hardest, *stable[:3]]:
        view = alone(engine, rows[k])
        assert found["payload_rms"][k] == pytest.approx(
            view.sigma("payload.displacement"), rel=1e-6
        )
        assert found["torque_rms"][k] == pytest.approx(view.sigma("motor.torque"), rel=1e-6)
        assert found["max_sensitivity"][k] == pytest.approx(view.max_sensitivity, rel=1e-8)


def test_peaks_are_those_of_the_assessment(rope_design: Design) -> None:
    names = ["torque_peak", "speed_peak", "tension_peak", "tension_least", "static_torque"]
    engine = FrequencyEngine(rope_design, Spread({"payload.mass": "10 %"}), metrics=names)
    row = np.array([[engine.spread.nominal["payload.mass"]]])
    found = {name: float(values[0]) for name, values in engine.evaluate(row).items()}
    view = rope_design.assessment
    time, static = engine.case.limits.exposure_time, view.plant.static
    torque = static["motor.torque"] + view.plant.loss["motor.torque"]
    tension = static["rope.tension"]
    assert found["static_torque"] == pytest.approx(torque, rel=1e-9)
    assert found["torque_peak"] == pytest.approx(torque + view.peak("motor.torque", time), rel=1e-6)
    assert found["speed_peak"] == pytest.approx(view.peak("motor.speed", time), rel=1e-6)
    swing = view.peak("rope.tension", time)
    assert found["tension_peak"] == pytest.approx(tension + swing, rel=1e-6)
    assert found["tension_least"] == pytest.approx(tension - swing, rel=1e-6)


def test_nominal_row_is_the_design_itself(rope_design: Design) -> None:
    for design in (thesis_design(), rope_design):
        engine = FrequencyEngine(design, Spread({"payload.mass": "5 %"}))
        found = engine.evaluate(np.array([[engine.spread.nominal["payload.mass"]]]))
        assert design.margins is not None
        assert found["payload_rms"][0] == pytest.approx(design.payload_rms, rel=1e-6)
        assert found["max_sensitivity"][0] == pytest.approx(
            design.margins.max_sensitivity, rel=1e-6
        )


def test_chunks_and_order_do_not_matter(rope_design: Design) -> None:
    for design, spread in ((thesis_design(), SPRING), (rope_design, ROPE)):
        whole = frequency_sweep(design, spread, samples=60, seed=3)
        pieces = frequency_sweep(design, spread, samples=60, seed=3, chunk=7)
        for name in whole.variables:
            np.testing.assert_allclose(pieces[name], whole[name], rtol=1e-9, equal_nan=True)
        last = list(FrequencyEngine(design, spread).chunks(samples=60, seed=3, start=50))[-1]
        assert last["case"].values.tolist() == list(range(50, 60))
        np.testing.assert_allclose(last["payload_rms"], whole["payload_rms"][50:], rtol=1e-9)


def test_dataset_says_what_it_holds_and_unstable_cases_have_no_numbers() -> None:
    result = frequency_sweep(thesis_design(), SPRING, samples=300, metrics=[*METRICS])
    assert result.sizes == {"case": 300}
    assert list(result.coords) == ["case", *SPRING.paths]
    assert result["payload.mass"].attrs["units"] == "kg"
    assert result["torque_rms"].attrs["units"] == "N m"
    assert result["command_rms"].attrs["units"] == "V"
    unstable = ~result["stable"].values
    assert 0 < unstable.sum() < 300
    for name in METRICS:
        assert result[name].attrs["long_name"]
        assert np.array_equal(np.isnan(result[name].values), unstable), name
    assert law_of(result, 0)[0] == "payload-feedback"
    np.testing.assert_allclose(
        spread_of(result).sample(300), np.stack([result[p] for p in SPRING.paths], axis=1)
    )


@pytest.mark.parametrize("metrics", [[], ["max_sensitivity"]])
def test_sweep_needs_no_variances(metrics: list[str]) -> None:
    alone = frequency_sweep(thesis_design(), SPRING, samples=32, metrics=metrics)
    whole = frequency_sweep(thesis_design(), SPRING, samples=32)
    for name in ("stable", *metrics):
        np.testing.assert_array_equal(alone[name], whole[name])


def test_worst_case_runs_again_alone_with_the_same_numbers() -> None:
    result = frequency_sweep(thesis_design(), SPRING, samples=200)
    worst = int(result["case"][int(np.nanargmax(result["payload_rms"].values))])
    case = case_of(result, worst)
    parameters = law_of(result, worst)[1]
    assert parameters == {name: getattr(case.gains, name) for name in ("A", "a", "a1", "a2")}
    assert parameters["a"] == result["gains.a"][worst]
    again = evaluate_gains(case, {n: getattr(case.gains, n) for n in ("A", "a", "a1", "a2")})
    assert again.payload_rms == pytest.approx(float(result["payload_rms"][worst]), rel=1e-6)
    assert Case.from_dict(case.to_dict()) == case
    with pytest.raises(InputError, match="no case number 200"):
        case_of(result, 200)


@pytest.mark.ci
@pytest.mark.parametrize(
    ("name", "vary"),
    [
        ("subsea-crane", {"sea.peak_period": Uniform(6.0, 12.0), "sea.significant_height": "30 %"}),
        ("thesis-1975", {"sea.significant_period": Uniform(6.0, 10.0)}),
        ("subsea-crane", {"sea.gamma": Uniform(1.0, 6.0)}),
        ("subsea-crane", {"vessel.heading": "5 %", "sea.peak_period": "5 %"}),
    ],
)
def test_sea_of_every_row_is_its_own(name: str, vary: dict[str, object]) -> None:
    case = load_case(name)
    if name != "thesis-1975":
        case = case.replace(
            {"rope.masses": 2, "payload.drag": {"method": "given", "coefficient": 2e4}}
        )
        design = replace(evaluate_gains(case, GAINS_ON_ROPE), verification=None)
    else:
        design = thesis_design()
    engine = FrequencyEngine(design, Spread(vary), metrics=["payload_rms", "torque_rms"])
    rows = engine.spread.sample(4, "random", seed=1)
    found = engine.evaluate(rows)
    for k, row in enumerate(rows):
        view = alone(engine, row)
        assert found["payload_rms"][k] == pytest.approx(
            view.sigma("payload.displacement"), rel=5e-6
        )
        assert found["torque_rms"][k] == pytest.approx(view.sigma("motor.torque"), rel=5e-6)


def test_drag_can_be_varied_itself(rope_design: Design) -> None:
    engine = FrequencyEngine(rope_design, Spread({"drag": "50 %"}), metrics=["payload_rms", "drag"])
    rows = engine.spread.sample(None, "corners")
    found = engine.evaluate(rows)
    np.testing.assert_allclose(found["drag"], [0.5 * rope_design.drag, 1.5 * rope_design.drag])
    for k in range(2):
        view = alone(engine, rows[k], float(rows[k, 0]))
        assert found["payload_rms"][k] == pytest.approx(
            view.sigma("payload.displacement"), rel=1e-6
        )


def test_loops_that_need_their_drag_have_the_drag_that_agrees() -> None:
    case = load_case("subsea-crane").replace({"rope.masses": 2, "payload.area": 300.0, **EXACT})
    design = replace(evaluate_gains(case, GAINS_ON_ROPE), verification=None)
    spread = Spread({"gains.a1": Uniform("-150 %", "50 %"), "gains.a": Uniform("-100 %", "50 %")})
    engine = FrequencyEngine(design, spread, metrics=["payload_rms", "drag"])
    rows = engine.spread.sample(12, seed=6)
    found = engine.evaluate(rows)
    needing = 0
    for k, row in enumerate(rows):
        if not found["stable"][k]:
            continue
        C = float(found["drag"][k])
        view = alone(engine, row, C)
        assert view.stable
        agreed = case.payload.quadratic_drag * np.sqrt(8.0 / np.pi) * view.sigma("payload.velocity")
        assert pytest.approx(agreed, rel=1e-6) == C
        needing += not alone(engine, row, 0.0).stable
    assert needing > 0


def test_unstable_design_has_unstable_cases() -> None:
    result = frequency_sweep(unstable_design(), Spread({"payload.mass": "5 %"}), samples=8)
    assert not result["stable"].any()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"metrics": ["payload"]}, "metric 'payload' is unknown; did you mean 'payload_rms'"),
        ({"samples": 0}, "samples must be at least 1"),
        ({"chunk": -1}, "chunk must be at least 1"),
        ({"spread": Spread({"rope.masses": Samples([1.0])})}, r"rope\.masses cannot vary"),
        ({"spread": Spread({"fault.delay_step": Samples([0.1])})}, "use mode 'time'"),
        ({"design": "mpc"}, "must be a Design, got str"),
    ],
)
def test_wrong_questions_are_refused(changes: dict[str, object], message: str) -> None:
    arguments = {"design": thesis_design(), "spread": SPRING, "samples": 4, **changes}
    with pytest.raises(InputError, match=message):
        frequency_sweep(**arguments)  # type: ignore[arg-type]


def test_rows_of_another_width_are_refused() -> None:
    engine = FrequencyEngine(thesis_design(), SPRING)
    with pytest.raises(InputError, match="rows must have 7 columns, got 3"):
        engine.evaluate(np.ones((2, 3)))


def test_rows_that_are_no_case_are_refused() -> None:
    engine = FrequencyEngine(thesis_design(), Spread({"payload.mass": "5 %", "gains.a": "5 %"}))
    mass, gain = (engine.spread.nominal[path] for path in engine.spread.paths)
    assert engine.evaluate(np.array([[mass, -gain]]))["stable"].size == 1
    with pytest.raises(InputError, match=r"payload\.mass must be"):
        engine.evaluate(np.array([[mass, gain], [-mass, gain]]))


def test_progress_ends_with_all_cases() -> None:
    told: list[tuple[str, int, int]] = []

    def tell(stage: str, done: int, total: int) -> None:
        told.append((stage, done, total))

    frequency_sweep(thesis_design(), SPRING, samples=30, chunk=8, progress=tell)
    assert told[-1] == ("cases", 30, 30)
    assert [done for _, done, _ in told] == sorted(done for _, done, _ in told)


@pytest.mark.slow
def test_design_of_a_search_has_its_own_figures_in_a_sweep() -> None:
    case = load_case("thesis-1975").replace({"sensors.telemetry.delay": 0.03})
    design = optimise_gains(case, "payload-feedback-rolloff", starts=2)
    gain = "a"
    spread = Spread({"payload.mass": "5 %", f"gains.{gain}": "4 %"})
    engine = FrequencyEngine(design, spread, metrics=[*DEFAULT, "torque_peak", "drag"])
    nominal = [engine.spread.nominal[path] for path in engine.spread.paths]
    found = engine.evaluate(np.array([nominal, [nominal[0], 1.04 * nominal[1]]]))
    assert design.margins is not None
    assert found["stable"].all()
    assert found["payload_rms"][0] == pytest.approx(design.payload_rms, rel=1e-7)
    assert found["max_sensitivity"][0] == pytest.approx(design.margins.max_sensitivity, rel=1e-7)
    assert found["torque_peak"][0] > found["torque_rms"][0]
    assert found["drag"][0] == design.drag
    other = {**design.parameters, gain: 1.04 * design.parameters[gain]}
    moved = replace(design, parameters=other).assessment
    assert found["payload_rms"][1] == pytest.approx(moved.sigma("payload.displacement"), rel=1e-7)
    off = robustness(design, {"gains": 0.02}, draws=4)
    assert off.ok
    assert off.stable is not None
    assert off.stable.count == 4
