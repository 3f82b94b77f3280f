"""State space on file: read back and closed again by other code, it has the design's numbers."""

from __future__ import annotations

import contextlib
import io
import json
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest
import scipy.io
from designs import structure_design, thesis_design

from models import load_case
from models.basics import InputError
from models.sensing import HEARD
from stillhook.exports.law import Law, law_of
from stillhook.exports.linear_facts import FLAGS, SCHEMA, contents, sampled_controller
from stillhook.exports.state_space import TOLERANCE, as_json, as_mat, to_python_control
from synth.design import Design
from synth.loop import closed_loop_poles
from synth.structures import sampled, sampled_loop

LAG = {"A": 200.0, "a": 21.46482856592854, "a1": 11.780195816339823, "a2": 65.99084527053604,
       "rolloff.corner": 40.0, "rolloff.damping": 0.7}  # fmt: skip
CRANE = {"A": 1.0, "a": 1.9131323291168159, "a1": 16.978631537992428, "a2": 3.337765584000905}


@pytest.fixture(scope="module")
def design() -> Design:
    return structure_design(load_case("thesis-1975"), "payload-feedback-rolloff", LAG)


@pytest.fixture(scope="module")
def law(design: Design) -> Law:
    return law_of(design)


@pytest.fixture(scope="module")
def late() -> Law:
    """Behind telemetry, with held readings, friction and noise."""
    rates = {"velocity": "5 Hz", "displacement": "10 Hz"}
    case = load_case("subsea-crane").replace(
        {f"sensors.payload.{name}_rate": rate for name, rate in rates.items()}
    )
    return law_of(structure_design(case, "payload-feedback", CRANE, 1))


def json_of(law: Law) -> dict[str, Any]:
    (text,) = as_json(law).files.values()
    found: dict[str, Any] = json.loads(text)
    return found


def mat_of(law: Law) -> dict[str, Any]:
    ((name, data),) = as_mat(law).files.items()
    assert isinstance(data, bytes)
    found: dict[str, Any] = scipy.io.loadmat(io.BytesIO(data), simplify_cells=True)  # type: ignore[arg-type]
    return dict(found[Path(name).stem])


@pytest.mark.parametrize("which", ["law", "late"])
@pytest.mark.parametrize("make", [as_json, as_mat])
def test_what_is_read_back_has_the_numbers_of_the_design(
    which: str, make: Any, request: pytest.FixtureRequest
) -> None:
    exported = make(request.getfixturevalue(which))
    assert exported.proved, exported.proof
    assert exported.proof.startswith("The file was read back and held against the law itself over")
    assert "poles to" in exported.proof
    numbers = [float(part.rstrip(",;")) for part in exported.proof.split() if "e-" in part]
    assert all(number < TOLERANCE for number in numbers)


def test_readings_that_are_held_are_told_with_their_delays(late: Law) -> None:
    read = json_of(late)["plant"]
    assert read["measurements"][1:] == ["payload.velocity", "payload.displacement"]
    assert read["holds"][1:] == pytest.approx([0.2, 0.1])
    assert read["delays"][1] == pytest.approx(read["delays"][2] + 0.05)


def test_numbers_are_exact_in_both_files(law: Law) -> None:
    tree, text, mat = contents(law), json_of(law), mat_of(law)
    assert text["schema"] == mat["schema"] == SCHEMA
    assert text["case_digest"] == mat["case_digest"] == law.case.digest
    for part in ("plant", "controller", "sampled_controller"):
        for name in ("A", "B", "C", "D"):
            expected = tree[part][name]
            for read in (text, mat):
                found = np.asarray(read[part][name], dtype=np.float64).reshape(expected.shape)
                np.testing.assert_array_equal(found, expected)
    for name in ("E", "F", "Cz", "Dz", "Fz"):
        np.testing.assert_array_equal(np.array(text["plant"][name]), tree["plant"][name])
    assert list(mat["plant"]["states"]) == text["plant"]["states"]
    assert list(mat["plant"]["outputs"]) == list(tree["plant"]["outputs"])
    assert text["parameters"] == dict(law.design.parameters)  # type: ignore[union-attr]
    assert list(mat["parameters"]["names"]) == list(text["parameters"])
    np.testing.assert_array_equal(mat["parameters"]["values"], list(text["parameters"].values()))
    assert text["margins"]["continuous"]["max_sensitivity"] == pytest.approx(
        law.design.margins.max_sensitivity  # type: ignore[union-attr]
    )
    assert text["margins"]["sampled"]["delay"] < text["margins"]["continuous"]["delay"]


def test_loop_of_the_file_closed_by_hand_has_the_poles_of_the_design(
    law: Law, design: Design
) -> None:
    read = json_of(law)
    p, c = read["plant"], read["controller"]
    assert not any(p["delays"])
    plant = control.ss(p["A"], p["B"], p["C"], p["D"])
    poles = control.feedback(plant, control.ss(c["A"], c["B"], c["C"], c["D"]), sign=1).poles()
    expected = closed_loop_poles(design.assessment.plant, design.controller)
    np.testing.assert_allclose(np.sort_complex(poles), np.sort_complex(expected), rtol=1e-9)


def test_sampled_loop_of_the_file_has_the_poles_of_the_sampled_loop(law: Law) -> None:
    """Anti-windup is silent: plant by python-control's hold, law of the file, one sample late."""
    read, T = json_of(law), law.sample_time
    p, c = read["plant"], read["sampled_controller"]
    assert c["sample_time"] == T
    plant = control.ss(p["A"], p["B"], p["C"], np.zeros((3, 1))).sample(T)
    assert not np.any(p["D"])
    closed = control.feedback(plant, control.ss(c["A"], c["B"], c["C"], c["D"], T), sign=1)
    from models.plant import build_plant

    own = sampled_loop(
        law.case,
        build_plant(law.case),
        law.inner.recursion,
        T,
        drag=law.design.drag,  # type: ignore[union-attr]
    ).poles()
    for pole in closed.poles():
        assert np.abs(own - pole).min() < 1e-9


def test_python_of_the_readme_prints_the_numbers_of_the_design(
    late: Law, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    exported = as_json(late)
    for name, text in exported.files.items():
        assert isinstance(text, str)
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    program = exported.about.split("```python\n")[1].split("```")[0]
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        exec(compile(program, "readme", "exec"), {})
    design = late.design
    assert design is not None
    rms, peak = said.getvalue().split(" m, M_s ")
    assert float(rms.removeprefix("payload rms ")) == pytest.approx(
        design.assessment.sigma("payload.displacement"), rel=1e-5
    )
    # With friction, as the plant of the file is.
    L = design.assessment.loop_gain(np.geomspace(1e-3, 1e3, 20000))
    assert float(peak) == pytest.approx(np.abs(1.0 / (1.0 + L)).max(), abs=6e-5)


def test_mat_file_is_the_same_each_time_and_without_a_date(law: Law) -> None:
    (first,), (second,) = as_mat(law).files.values(), as_mat(law).files.values()
    assert first == second
    assert isinstance(first, bytes)
    assert first.startswith(b"MATLAB 5.0 MAT-file, Stillhook")
    assert b"Created" not in first[:116]
    assert "matlab" in as_mat(law).about


def test_sampled_coefficients_are_to_be_had_at_any_sample_time(law: Law, design: Design) -> None:
    found = sampled_controller(law, 0.03)
    expected = sampled(design.controller, 0.03)
    for name, matrix in zip("ABCD", expected, strict=True):
        np.testing.assert_array_equal(found[name], matrix)
    assert np.abs(np.linalg.eigvals(found["A"] - found["K_b"] @ found["C"])).max() < 1.0
    systems = to_python_control(law, 0.03)
    assert systems.sampled.dt == 0.03
    assert systems.continuous is not None
    assert systems.continuous.dt == 0
    assert systems.sampled.input_labels == [
        name.replace(".", "_") for name in design.controller.measurements
    ]
    slow = np.array([0.5, 1.0])
    np.testing.assert_allclose(
        systems.sampled(np.exp(1j * slow * 0.03)), systems.continuous(1j * slow), rtol=1e-3
    )
    assert to_python_control(law).sampled.dt == law.sample_time


def test_python_control_closes_plant_and_law(law: Law, design: Design) -> None:
    systems = to_python_control(law)
    ny = len(design.controller.measurements)
    closed = control.feedback(systems.plant[:ny, :1], systems.continuous, sign=1)
    assert closed.poles().real.max() == pytest.approx(design.assessment.poles.real.max(), rel=1e-9)


@pytest.mark.parametrize("name", ["feed-forward", "constant-tension"])
def test_other_laws_are_their_jacobians_at_rest(name: str) -> None:
    law = law_of(load_case("subsea-crane"), controller=name)
    exported = as_json(law)
    assert exported.proved, exported.proof
    assert "the design" not in exported.proof
    read = json_of(law)
    assert "controller" not in read
    assert "The sampled controller is the Jacobian of the law at rest." in read["notes"]
    inputs = read["sampled_controller"]["inputs"]
    assert "drive.applied" in inputs
    assert not set(inputs) & set(FLAGS)
    assert ("rope.tension" in inputs) == (name == "constant-tension")
    if name == "constant-tension":
        assert "without the dead band of" in " ".join(read["notes"])
    other = to_python_control(law, 0.01)
    assert other.sampled.dt == 0.01
    assert other.continuous is None
    assert as_mat(law).proved


def test_notes_tell_of_what_is_not_linear(law: Law) -> None:
    read = json_of(law)
    notes = " ".join(read["notes"])
    assert "u = +C(s) y" in notes
    assert "older than 1 s fade out" in notes
    assert "K_b" in notes
    assert read["command_at_rest"] == law.rest["drive.applied"]
    assert set(read["rest"]) == set(HEARD) - set(FLAGS)
    static = json_of(law_of(load_case("thesis-1975"), controller="feedback", gains={
        "A": 200.0, "a": 50.0, "a1": 100.0, "a2": 100.0}))  # fmt: skip
    assert "Without a design there is no drag in the plant." in static["notes"]
    assert "spectra" not in static
    assert "K_b" not in " ".join(static["notes"])


def test_a_number_without_bound_is_null_in_json() -> None:
    read = json_of(law_of(thesis_design()))
    assert read["margins"]["continuous"]["gain"] is None
    assert mat_of(law_of(thesis_design()))["margins"]["continuous"]["gain"] == np.inf


@pytest.mark.ci
def test_predictive_control_has_no_state_space() -> None:
    law = law_of(load_case("thesis-1975"), controller="mpc")
    for make in (as_json, as_mat, to_python_control):
        with pytest.raises(InputError, match="not linear and time invariant, so that it has no"):
            make(law)


def test_a_sample_time_must_be_positive(law: Law) -> None:
    with pytest.raises(InputError, match="sample_time"):
        to_python_control(law, 0.0)


def test_a_file_of_another_law_is_not_proved(law: Law, monkeypatch: pytest.MonkeyPatch) -> None:
    from stillhook.exports import state_space

    def other(value: Law) -> dict[str, Any]:
        tree = contents(value)
        tree["controller"]["D"] = 1.001 * tree["controller"]["D"]
        tree["controller"]["C"] = 1.001 * tree["controller"]["C"]
        return tree

    monkeypatch.setattr(state_space, "contents", other)
    assert not as_json(law).proved
