"""Structured text of laws: the same numbers as CasADi, to the last bit in LREAL."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from functools import cache

import casadi as ca
import numpy as np
import pytest
from former_cases import load_case
from hypothesis import given, settings
from hypothesis import strategies as st

import stillhook as sh
from models.basics import FloatArray, InputError, SolverError
from models.sensing import HEARD, Measurement, Recursion
from stillhook.exports.law import Law, law_of
from stillhook.exports.plc import structured_text
from stillhook.exports.plc.block import Block, block_of
from stillhook.exports.plc.code import WIDTH, literal
from stillhook.exports.plc.example import time_literal
from stillhook.exports.plc.graph import counted, graph_of
from stillhook.exports.plc.interpreter import Program
from stillhook.exports.plc.structured_text import EXACT, SINGLE, as_structured_text, replay
from stillhook.exports.plc.syntax import tasks_in, units_in
from stillhook.exports.recording import Recording, record
from stillhook.exports.signals import SIGNALS, STATUS_TEXTS
from synth.structures import structures_aboard

CASE = load_case("subsea-crane")
GAINS = {"A": 1.0, "a": 16.02, "a1": 44.36, "a2": 6.416}
KINDS = ("feedback", "feed-forward", "constant-tension")
FLAGS = [i for i, signal in enumerate(SIGNALS) if signal.unit == "-"]
REST = Measurement.of({})


@cache
def _law(kind: str, case: str = "subsea-crane") -> Law:
    gains = GAINS if kind == "feedback" else None
    return law_of(load_case(case), controller=kind, gains=gains)


@cache
def _recording(kind: str, case: str = "subsea-crane") -> Recording:
    return record(_law(kind, case))


def _block(recursion: Recursion, kind: str = "LREAL") -> Block:
    return block_of(recursion, "law", kind, about="a law", unit="V", rest=REST)


def _recursion(state: ca.SX, heard: ca.SX, following: ca.SX, command: ca.SX) -> Recursion:
    function = ca.Function("f", [state, heard], [ca.densify(following), ca.densify(command)])
    return Recursion(function=function, initial=np.zeros(state.numel()))


def _of(expression: ca.SX, heard: ca.SX) -> Recursion:
    """Return a law without a memory."""
    return _recursion(ca.SX.sym("x", 1), heard, ca.SX.zeros(1), ca.SX(expression))


def _statements(text: str) -> str:
    """Return the statements of a block on one line."""
    return re.sub(r"\s+", " ", text.split("END_VAR")[-1])


def _commands(block: Block, rows: FloatArray) -> FloatArray:
    samples = {signal.identifier: rows[:, i] for i, signal in enumerate(SIGNALS)}
    return Program.read(block.text).run(samples)["COMMAND"]


@pytest.mark.parametrize("case", ["subsea-crane", "thesis-1975"])
@pytest.mark.parametrize("kind", ["feed-forward", "constant-tension"])
def test_a_law_is_the_same_to_the_last_bit_in_lreal_and_close_in_real(kind: str, case: str) -> None:
    law, recording = _law(kind, case), _recording(kind, case)
    exported = as_structured_text(law, recording)
    name = law.name
    assert (exported.kind, exported.proved) == ("st", True)
    assert set(exported.files) == {
        f"{name}.st",
        f"{name}_real.st",
        f"{name}.xml",
        f"{name}_real.xml",
        "example.st",
        "vector.csv",
    }
    for variant, tolerance in (("", EXACT), ("_real", SINGLE)):
        text = str(exported.files[f"{name}{variant}.st"])
        made = Program.read(text).run(
            {s.identifier: recording.measured[:, i] for i, s in enumerate(SIGNALS)}
        )
        assert np.abs(made["COMMAND"] - recording.commands).max() <= tolerance * law.span
        other = made["STATUS"] != recording.statuses
        # In REAL whether a drive was at a limit hangs on the last digit.
        assert not other.any() or (variant and set(recording.statuses[other]) <= {0.0, 1.0})
    assert "differs by nothing at all" in exported.proof
    assert f"{len(recording.commands)} samples" in exported.proof
    assert "no compiler of a controller has seen them" in exported.proof
    assert "divides by constants alone" in exported.about
    assert "T#20ms" in exported.about


def test_twelve_thousand_samples_of_a_feedback_at_5_ms() -> None:
    law, recording = _law("feedback"), _recording("feedback")
    double = _of_law(law, "LREAL")
    found = replay(double, recording, law.span)
    assert found.difference == 0.0
    assert found.statuses == 0
    single = replay(_of_law(law, "REAL"), recording, law.span)
    assert single.difference < 1e-6
    assert single.statuses > single.modes == 0


def test_a_mode_that_comes_at_another_time_is_told() -> None:
    law, recording = _law("constant-tension"), _recording("constant-tension")
    statuses = recording.statuses.copy()
    assert STATUS_TEXTS[int(statuses[0])][0] == "held"
    statuses[:3] = 0.0
    found = replay(_of_law(law, "REAL"), replace(recording, statuses=statuses), law.span)
    assert found.modes == 3
    assert found.statuses >= 3


def _of_law(law: Law, kind: str) -> Block:
    assert law.recursion is not None
    return block_of(law.recursion, law.name, kind, about="", unit=law.unit, rest=law.rest)


_WIDE = {"payload-feedback-lead", "payload-feedback-notch", "drum-feedback", "low-order-4"}
"""Laws of thesis-1975 that REAL does not keep within `SINGLE`."""


@pytest.mark.ci
@pytest.mark.parametrize(
    ("case", "structure"),
    [("subsea-crane", "combined"), ("thesis-1975", "payload-feedback-lead")],
)
def test_a_designed_law_is_the_same_and_close_or_not_there(case: str, structure: str) -> None:
    _check_design(case, structure)


@pytest.mark.slow
@pytest.mark.parametrize("case", ["subsea-crane", "thesis-1975"])
def test_every_structure_of_a_case_is_the_same_and_close_or_not_there(case: str) -> None:
    for structure in structures_aboard(sh.load_case(case)):
        _check_design(case, structure)


def _check_design(case: str, structure: str) -> None:
    law = law_of(sh.optimise_gains(sh.load_case(case), structure))
    exported = as_structured_text(law, record(law))
    assert "differs by nothing at all" in exported.proof
    there = f"{law.name}_real.st" in exported.files
    assert there or (case == "thesis-1975" and structure in _WIDE)
    assert there == ("There is none in REAL" not in exported.proof)
    assert there == (f"{law.name}_real" in exported.about)


def test_clocks_count_in_real_and_single_precision_without_it_is_not_enough(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    law, recording = _law("feedback"), _recording("feedback")
    block = _of_law(law, "REAL")
    assert block.text.count("a clock from 0 to 1") == 3
    monkeypatch.setattr("stillhook.exports.plc.block.counted", lambda graph: graph)
    found = replay(_of_law(law, "REAL"), recording, law.span)
    assert found.difference > SINGLE
    exported = as_structured_text(law, recording)
    assert not any("real" in path for path in exported.files)
    assert "There is none in REAL: it would differ by" in exported.proof
    assert "_real" not in exported.about


def test_a_block_that_does_something_else_is_no_export() -> None:
    law, recording = _law("constant-tension"), _recording("constant-tension")
    other = replace(recording, commands=recording.commands + 1e-9 * law.span)
    with pytest.raises(SolverError, match=r"off by up to 1e-09 of the command's range"):
        as_structured_text(law, other)
    other = replace(recording, statuses=recording.statuses + 1.0)
    with pytest.raises(SolverError, match="in 3001 samples by its status"):
        as_structured_text(law, other)


def test_predictive_control_is_no_structured_text() -> None:
    law = replace(_law("constant-tension"), recursion=None)
    with pytest.raises(InputError, match=r"solves a programme .* export it as C or as an FMU"):
        as_structured_text(law, _recording("constant-tension"))


def test_a_number_that_is_none_is_fed_as_the_one_before() -> None:
    law, recording = _law("constant-tension"), _recording("constant-tension")
    measured = recording.measured.copy()
    at = HEARD.index("payload.velocity")  # which this law does not hear
    measured[[0, 5, 6], at] = np.nan
    assert replay(
        _of_law(law, "LREAL"), replace(recording, measured=measured), law.span
    ).difference == (0.0)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("variant", ["LREAL", "REAL"])
def test_nothing_stops_a_law(kind: str, variant: str) -> None:
    instance = Program.read(_of_law(_law(kind), variant).text).instance()
    rng = np.random.default_rng(1)
    sizes = np.array([0.0, 0.0, 1e-30, 1.0, -1.0, 1e3, 1e12, -1e12])
    for _ in range(300):
        row = np.where(rng.random(21) < 0.5, rng.choice(sizes, 21), rng.normal(0.0, 5.0, 21))
        row[FLAGS] = rng.integers(0, 2, len(FLAGS))
        made = instance.step(**{s.identifier: row[i] for i, s in enumerate(SIGNALS)})
        assert np.isfinite(made["COMMAND"])


def test_the_text_keeps_to_the_standard_and_to_its_width() -> None:
    for kind in KINDS:
        for variant in ("LREAL", "REAL"):
            text = _of_law(_law(kind), variant).text
            assert text.isascii()
            assert max(map(len, text.splitlines())) <= WIDTH
            assert len(text.splitlines()) < 300
            (unit,) = units_in(text)  # which knows the reserved words
            assert all(len(v.name) <= 31 for v in unit.variables)
            assert len(unit.name) <= 31
            assert text.count("LREAL") == (0 if variant == "REAL" else text.count("REAL"))
            for number, (status, _) in enumerate(STATUS_TEXTS):
                assert f"(* {number} {status}:" in text


def test_inputs_are_at_rest_and_the_controller_is_off_until_it_is_wired() -> None:
    law = _law("feed-forward")
    text = _of_law(law, "LREAL").text
    for line in (
        "operator_enable : BOOL := FALSE;",
        "payload_valid : BOOL := FALSE;",
        "mru_valid : BOOL := FALSE;",
        "encoder_valid : BOOL := TRUE;",
        "load_cell_valid : BOOL := TRUE;",
        "payload_age : LREAL := 1000.0;",
        f"rope_tension : LREAL := {literal(law.rest['rope.tension'], 'LREAL')};",
        "(* [m] heave of the hook (the crane tip), up positive *)",
    ):
        assert line in text
    made = Program.read(text).instance().step()
    assert made["COMMAND"] == pytest.approx(law.rest["drive.applied"], rel=1e-9)
    assert STATUS_TEXTS[int(made["STATUS"])][0] == "held"
    assert "payload_velocity" in text
    assert "(this law does not use it)" in text


def test_the_example_runs_in_its_task_and_commands_what_the_block_does() -> None:
    law = _law("feed-forward")
    block = _of_law(law, "LREAL")
    exported = as_structured_text(law, _recording("feed-forward"))
    example = str(exported.files["example.st"])
    assert "payload_age := age," in example
    assert "payload_valid := message," in example
    text = block.text + example
    (task,) = tasks_in(text)
    assert (task.interval, task.programs) == (pytest.approx(law.sample_time), ("WINCH",))
    program, alone = Program.read(text).instance(), Program.read(block.text).instance()
    for k in range(80):
        wired = {"operator_enable": 1.0, "mru_heave_rate": 0.1, "encoder_valid": float(k < 20)}
        made = program.step(**wired)
        own = alone.step(**wired)
        assert made["DRIVE_COMMAND"] == own["COMMAND"]
        assert made["SET_BRAKE"] == (STATUS_TEXTS[int(own["STATUS"])][0] == "braked")
    assert made["SET_BRAKE"]


def test_a_law_called_example_is_not_overwritten_by_the_example() -> None:
    law = replace(_law("feed-forward"), name="example")
    files = as_structured_text(law, _recording("feed-forward")).files
    assert str(files["example.st"]).count("FUNCTION_BLOCK Stillhook_example") == 1
    assert "PROGRAM Winch" in str(files["example_task.st"])


def test_how_numbers_and_times_are_written() -> None:
    assert literal(1.0, "LREAL") == "1.0"
    assert literal(1e-5, "LREAL") == "1.0E-5"
    assert literal(0.1, "REAL") == "0.1"
    assert literal(-2.5e12, "LREAL") == "-2500000000000.0"
    assert literal(1e12, "REAL") == "1.0E12"
    assert float(literal(1 / 3, "LREAL")) == 1 / 3
    assert np.float32(literal(1 / 3, "REAL")) == np.float32(1 / 3)
    assert time_literal(0.005) == "T#5ms"
    assert time_literal(0.0025) == "T#2.5ms"
    for value in (1e39, 1e-300):
        with pytest.raises(InputError, match="which REAL does not reach"):
            literal(value, "REAL")


def test_a_law_with_a_number_beyond_real_has_lreal_alone() -> None:
    law, recording = _law("constant-tension"), _recording("constant-tension")
    assert law.recursion is not None
    f = law.recursion.function
    state, heard = ca.SX.sym("x", f.numel_in(0)), ca.SX.sym("m", f.numel_in(1))
    following, command = f(state, heard)
    tiny = ca.if_else(heard[0] > 1e200, 1e-300 * heard[1], command)
    wide = replace(
        law.recursion, function=ca.Function("f", [state, heard], [following, ca.densify(tiny)])
    )
    exported = as_structured_text(replace(law, recursion=wide), recording)
    assert "which REAL does not reach" in exported.proof
    assert not any("real" in path for path in exported.files)


def test_an_operation_that_structured_text_has_not_is_a_sentence() -> None:
    heard = ca.SX.sym("m", len(HEARD))
    with pytest.raises(InputError, match=r"takes erf\(\) of a number, .* export it as C"):
        _block(_of(ca.erf(heard[0]), heard))
    with pytest.raises(InputError, match="a constant that is no finite number: inf"):
        _block(_of(heard[0] + ca.inf, heard))


def test_a_choice_is_sel_with_the_number_for_false_first() -> None:
    heard = ca.SX.sym("m", len(HEARD))
    enable, reset = HEARD.index("operator.enable"), HEARD.index("operator.reset")
    block = _block(_of(ca.if_else(heard[enable] > 0.5, 7.0, heard[0]), heard))
    assert "SEL(operator_enable, payload_acceleration, 7.0)" in block.body
    block = _block(_of(ca.if_else(heard[reset] < 0.5, 7.0, heard[0]), heard))
    assert "SEL(operator_reset, 7.0, payload_acceleration)" in block.body
    block = _block(_of(2.0 * heard[enable], heard))
    assert "2.0 * SEL(operator_enable, 0.0, 1.0)" in block.body


def test_brackets_are_where_the_order_needs_them() -> None:
    m = ca.SX.sym("m", len(HEARD))
    a, b, c = (SIGNALS[i].identifier for i in (0, 1, 2))
    for expression, text in (
        (m[0] - (m[1] - m[2]), f"{a} - ({b} - {c})"),
        ((m[0] - m[1]) - m[2], f"{a} - {b} - {c}"),
        (m[0] + (m[1] + m[2]), f"{a} + ({b} + {c})"),
        (m[0] * (m[1] + m[2]), f"{a} * ({b} + {c})"),
        (m[0] * m[1] + m[2], f"{a} * {b} + {c}"),
        (m[0] / (m[1] * m[2]), f"{a} / ({b} * {c})"),
        (m[0] / m[1] / m[2], f"{a} / {b} / {c}"),
        (m[0] - (-2.5), f"{a} - (-2.5)"),
        (-(m[0] + m[1]), f"-({a} + {b})"),
        (ca.logic_not(m[0] < m[1]), f"SEL({a} < {b}, 1.0, 0.0)"),
        (
            ca.if_else(ca.logic_or(ca.logic_and(m[0] < 1, m[1] < 1), m[2] < 1), m[0], 2),
            f"SEL((({a} < 1.0) AND ({b} < 1.0)) OR ({c} < 1.0), 2.0, {a})",
        ),
    ):
        found = _statements(_block(_of(expression, m)).text)
        assert text in found or text == f"SEL({a} < {b}, 1.0, 0.0)", found


def test_a_division_that_one_side_asks_for_is_not_made_on_the_other() -> None:
    m = ca.SX.sym("m", len(HEARD))
    wide = ca.fabs(m[1]) > 0.5
    law = ca.if_else(wide, ca.sqrt(m[0] / m[1] + 3.0), 1.0) + ca.if_else(wide, 1.0 / m[1], 0.0)
    block = _block(_of(law, m))
    assert block.body.count("IF b1 THEN") == block.body.count("END_IF;") == 3
    rows = np.zeros((3, len(HEARD)))
    rows[:, :2] = [[1.0, 2.0], [1.0, 0.0], [-5.0, 1e-3]]
    assert _commands(block, rows).tolist() == [np.sqrt(3.5) + 0.5, 1.0, 1.0]
    # Asked for in any case it ends the program, as it does on a controller.
    with pytest.raises(InputError, match="stops: float division by zero"):
        _commands(_block(_of(m[0] / m[1] + ca.if_else(wide, m[0] / m[1], 0.0), m)), rows)


def test_no_state_is_overwritten_before_all_that_is_made_of_it() -> None:
    x, m = ca.SX.sym("x", 3), ca.SX.sym("m", len(HEARD))
    block = _block(_recursion(x, m, ca.vertcat(x[1], x[2], x[0] + m[0]), x[0]))
    instance = Program.read(block.text).instance()
    made = [instance.step(payload_acceleration=k)["COMMAND"] for k in (1.0, 2.0, 3.0, 0.0, 0.0)]
    assert made == [0.0, 0.0, 0.0, 1.0, 2.0]
    swap = _block(_recursion(x, m, ca.vertcat(x[1] + m[0], x[0], x[2]), x[1] + x[2]))
    instance = Program.read(swap.text).instance()
    made = [instance.step(payload_acceleration=k)["COMMAND"] for k in (1.0, 5.0, 0.0, 0.0)]
    assert made == [0.0, 0.0, 1.0, 5.0]


def test_a_clock_is_a_state_that_steps_between_0_and_1_and_no_other() -> None:
    x, m = ca.SX.sym("x", 4), ca.SX.sym("m", len(HEARD))
    on = m[HEARD.index("operator.enable")] > 0.5
    back = ca.fmax(0.0, ca.fmin(1.0, x[0] + ca.if_else(on, 0.004, -0.004)))
    once = ca.if_else(on, ca.fmin(1.0, x[1] + 0.003), 0.0)
    uneven = ca.fmax(0.0, ca.fmin(1.0, x[2] + ca.if_else(on, 0.004, -0.003)))
    integral = x[3] + 0.01 * m[0]
    law = _recursion(x, m, ca.vertcat(back, once, uneven, integral), back + once + uneven)
    graph = counted(graph_of(law.function, FLAGS))
    assert graph.clocks == {0: (250.0, 0.004), 1: (1.0 / 0.003, 0.003)}
    double, single = (Program.read(_block(law, kind).text).instance() for kind in ("LREAL", "REAL"))
    for k in range(1400):
        enable = float(k < 700 or k > 1000)
        commands = [i.step(operator_enable=enable)["COMMAND"] for i in (double, single)]
        assert commands[1] == pytest.approx(commands[0], abs=1e-4), k
        if k in (400, 699):
            assert commands[1] == 3.0


def test_a_clock_in_real_reaches_1_where_the_product_of_its_steps_would_not() -> None:
    steps = next(n for n in range(2, 999) if np.float32(n) * np.float32(1.0 / n) < 1.0)
    x, m = ca.SX.sym("x", 1), ca.SX.sym("m", len(HEARD))
    clock = ca.fmin(1.0, x + 1.0 / steps)
    instance = Program.read(_block(_recursion(x, m, clock, clock), "REAL").text).instance()
    made = [instance.step()["COMMAND"] for _ in range(steps + 3)]
    assert made[steps - 2] < 1.0
    assert set(made[steps - 1 :]) == {1.0}


def test_a_drive_that_reports_in_real_is_not_at_its_limit() -> None:
    law = _law("feed-forward")
    double, single = (_of_law(law, kind) for kind in ("LREAL", "REAL"))
    assert double.body.count("1.0E-9 * (ABS(") == single.body.count("1.0E-6 * (ABS(") == 2
    instance = Program.read(single.text).instance()
    made = {"COMMAND": law.rest["drive.applied"]}
    statuses = set()
    for k in range(400):
        made = instance.step(
            operator_enable=1.0,
            mru_valid=1.0,
            mru_heave_rate=0.1 * math.sin(0.02 * k),
            drive_applied=made["COMMAND"] * (1.0 + 2e-7),
        )
        statuses.add(STATUS_TEXTS[int(made["STATUS"])][0])
    assert statuses == {"blending", "engaged"}


_UNARY = (
    lambda a: -a,
    ca.fabs,
    lambda a: ca.sin(a) ** 2,
    lambda a: 2 * a,
    ca.sin,
    ca.cos,
    ca.sign,
    ca.logic_not,
    lambda a: ca.sqrt(ca.fabs(a)),
    lambda a: ca.exp(ca.fmin(3.0, a)),
    lambda a: ca.if_else(a > 0.1, ca.log(a), a),
    lambda a: ca.if_else(ca.fabs(a) > 0.1, 1 / a, 2.0),
    lambda a: ca.tan(ca.sin(a)),
)
_BINARY = (
    lambda a, b: a + b,
    lambda a, b: a - b,
    lambda a, b: ca.sin(a) * b,
    ca.fmin,
    ca.fmax,
    lambda a, b: a < b,
    lambda a, b: a <= b,
    lambda a, b: a == b,
    lambda a, b: a != b,
    ca.logic_and,
    ca.logic_or,
    lambda a, b: ca.if_else(ca.fabs(b) > 0.5, a / b, ca.if_else(a < b, b, 1.0)),
)
_STEP = st.tuples(st.integers(0, 99), *[st.integers(0, 40)] * 3)


_EXPRESSIONS = given(st.lists(_STEP, min_size=1, max_size=25), st.integers(0, 2**32 - 1))


@settings(max_examples=60)
@_EXPRESSIONS
def test_any_expression_is_the_same_to_the_last_bit(
    steps: list[tuple[int, int, int, int]], seed: int
) -> None:
    _check_expression(steps, seed)


@pytest.mark.ci
@settings(max_examples=1500)
@_EXPRESSIONS
def test_many_expressions_are_the_same_to_the_last_bit(
    steps: list[tuple[int, int, int, int]], seed: int
) -> None:
    _check_expression(steps, seed)


def _check_expression(steps: list[tuple[int, int, int, int]], seed: int) -> None:
    x, m = ca.SX.sym("x", 2), ca.SX.sym("m", len(HEARD))
    made = [x[0], x[1], m[0], m[1], m[FLAGS[2]], m[FLAGS[3]], ca.SX(0.75), ca.SX(0.0), ca.SX(1.0)]
    for op, *at in steps:
        a, b, c = (made[i % len(made)] for i in at)
        kind = op % (len(_UNARY) + len(_BINARY) + 1)
        if kind < len(_UNARY):
            made.append(_UNARY[kind](a))
        elif kind < len(_UNARY) + len(_BINARY):
            made.append(_BINARY[kind - len(_UNARY)](a, b))
        else:
            made.append(ca.if_else(a, b, c))
    law = _recursion(x, m, ca.vertcat(ca.sin(made[-1]), ca.cos(made[len(made) // 2])), made[-1])
    for kind in ("LREAL", "REAL"):
        instance = Program.read(_block(law, kind).text).instance()
        rng, state = np.random.default_rng(seed), np.zeros(2)
        for _ in range(4):
            row = rng.choice([0.0, 1.0, -1.0, rng.normal()], len(HEARD))
            row[FLAGS] = rng.integers(0, 2, len(FLAGS))
            found = instance.step(**{s.identifier: row[i] for i, s in enumerate(SIGNALS)})
            following, command = law.function(state, row)
            state = np.array(following).ravel()
            if kind == "LREAL":
                assert found["COMMAND"] == float(command)


def test_the_tolerances_are_those_that_are_told() -> None:
    assert (structured_text.EXACT, structured_text.SINGLE) == (1e-12, 1e-4)
