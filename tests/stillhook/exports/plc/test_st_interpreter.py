"""The interpreter of structured text: its grammar, its types, and what it stops at."""

from __future__ import annotations

import math

import numpy as np
import pytest

from models.basics import InputError
from stillhook.exports.plc.interpreter import Program
from stillhook.exports.plc.syntax import tasks_in


def _made(expression: str, kind: str = "LREAL", **inputs: float) -> float:
    text = f"""\
FUNCTION_BLOCK Try
VAR_INPUT a, b, c : LREAL; p, q : BOOL; r : REAL; i : INT; END_VAR
VAR_OUTPUT y : {kind}; END_VAR
y := {expression};
END_FUNCTION_BLOCK"""
    return Program.read(text).instance().step(**inputs)["Y"]


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("2.0 + 3.0 * 4.0", 14.0),
        ("(2.0 + 3.0) * 4.0", 20.0),
        ("10.0 - 3.0 - 2.0", 5.0),
        ("8.0 / 4.0 / 2.0", 1.0),
        ("-2.0 ** 2.0", 4.0),  # the sign binds more strongly than the power
        ("2.0 * 3.0 ** 2.0", 18.0),
        ("-3.0 + 1.0", -2.0),
        ("2.0 - -3.0", 5.0),
        ("1.0E-2 + 2.5e1", 25.01),
        ("1_000.5", 1000.5),
        ("SEL(TRUE, 1.0, 2.0)", 2.0),
        ("SEL(FALSE, 1.0, 2.0)", 1.0),
        ("SEL(G := TRUE, IN1 := 5.0, IN0 := 4.0)", 5.0),
        ("MIN(2.0, 1.0) + MAX(2.0, 1.0)", 3.0),
        ("LIMIT(0.0, 3.0, 2.0)", 2.0),
        ("LIMIT(MX := 2.0, MN := 1.0, IN := -1.0)", 1.0),
        ("ABS(-2.0)", 2.0),
        ("SQRT(a) + SIN(b) + COS(b) + TAN(b) + EXP(b) + LN(a)", 4.0 + math.log(4.0)),
        ("BOOL_TO_LREAL(p) + INT_TO_LREAL(i)", 1.0 + 7.0),
        ("INT_TO_LREAL(i MOD 4) + INT_TO_LREAL(-7 / 2)", 0.0),
        ("REAL_TO_LREAL(r)", float(np.float32(0.1))),
        ("r", float(np.float32(0.1))),  # which loses nothing
        ("1.0 (* a comment; y := 2.0 *) + (* * *) 1.0 // and one more", 2.0),
    ],
)
def test_numbers(expression: str, value: float) -> None:
    ending = "\n" if "//" in expression else ""
    found = _made(expression + ending, a=4.0, b=0.0, p=1.0, r=0.1, i=7.0)
    assert found == value


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("TRUE OR FALSE AND FALSE", True),  # AND binds more strongly than OR
        ("NOT FALSE AND FALSE", False),  # NOT more strongly than AND
        ("TRUE XOR TRUE AND FALSE", True),
        ("TRUE OR TRUE XOR TRUE", True),
        ("a < b = c < b", False),  # a comparison more strongly than an equality
        ("a < b & p", True),
        ("a + 1.0 <= b", True),
        ("a <> b", True),
        ("p = q", False),
        ("a >= b OR a > b", False),
        ("NOT (a > b)", True),
        ("INT_TO_BOOL(2) AND LREAL_TO_BOOL(0.5)", True),
        ("SEL(p, FALSE, TRUE)", True),
    ],
)
def test_conditions(expression: str, value: bool) -> None:
    assert _made(expression, "BOOL", a=1.0, b=2.0, c=3.0, p=1.0, q=0.0) is value


def test_whole_numbers_are_rounded_half_to_even_and_trunc_towards_zero() -> None:
    assert [_made("LREAL_TO_INT(a)", "INT", a=v) for v in (0.5, 1.5, -2.5, 2.6)] == [0, 2, -2, 3]
    assert [_made("TRUNC(a)", "DINT", a=v) for v in (2.7, -2.7)] == [2, -2]
    assert _made("7 / 2 + 7 MOD 2", "INT") == 4
    with pytest.raises(InputError, match="40000 is out of the range of INT"):
        _made("LREAL_TO_INT(a)", "INT", a=4e4)
    with pytest.raises(InputError, match="out of the range of INT"):
        _made("i * 2", "INT", i=3e4)


def test_real_is_single_precision_after_every_operation() -> None:
    text = """\
FUNCTION_BLOCK Once
VAR_INPUT a, b : REAL; END_VAR
VAR_OUTPUT y : REAL; z : LREAL; END_VAR
y := a * b + 0.1;
z := REAL_TO_LREAL(a) * REAL_TO_LREAL(b);
END_FUNCTION_BLOCK"""
    made = Program.read(text).instance().step(a=0.1, b=0.3)
    a, b = np.float32(0.1), np.float32(0.3)
    assert made["Y"] == a * b + np.float32(0.1)
    assert made["Y"] != np.float32(0.1 * 0.3 + 0.1) or made["Z"] != float(a * b)
    assert made["Z"] == float(a) * float(b)


def test_states_are_kept_and_work_variables_are_not() -> None:
    text = """\
function_block Counter  (* keywords in any case *)
var_input up : bool := true; end_var
var_output count : int; again : int; end_var
var state : array[0..1] of lreal := [1.0, -2.0]; end_var
var_temp w : lreal; t : array[0..1] of int; end_var
IF up THEN
    state[0] := State[0] + 1.0;
ELSIF state[1] < 0.0 THEN
    state[1] := 0.0;
ELSE
    state[0] := 0.0;
END_IF;
w := w + state[0];
t[1] := t[1] + 1;
count := LREAL_TO_INT(w);
again := t[1];
END_FUNCTION_BLOCK"""
    program = Program.read(text)
    assert program.name == "COUNTER"
    assert dict(program.inputs) == {"UP": "BOOL"}
    one, other = program.instance(), program.instance()
    assert [one.step()["COUNT"] for _ in range(3)] == [2, 3, 4]
    assert one.step(up=0.0)["COUNT"] == 4
    assert one.step()["COUNT"] == 0  # an input keeps its value
    assert other.step(up=1.0) == {"COUNT": 2, "AGAIN": 1}
    made = program.run({"up": [1.0, 1.0, 0.0]})
    assert made["COUNT"].tolist() == [2.0, 3.0, 3.0]


def test_a_program_calls_instances_of_blocks() -> None:
    text = """\
FUNCTION_BLOCK Sum
VAR_INPUT add : LREAL; END_VAR
VAR_OUTPUT total : LREAL; END_VAR
total := total + add;
END_FUNCTION_BLOCK
PROGRAM Main
VAR_INPUT one_more : LREAL := 1.0; END_VAR
VAR_OUTPUT y : LREAL; END_VAR
VAR one, two : Sum; END_VAR
one(add := one_more);
two(add := 2.0 * one.total);
two();
y := two.total;
END_PROGRAM
CONFIGURATION Plant
RESOURCE Cpu ON Plc
TASK Fast(INTERVAL := T#2.5ms, PRIORITY := 0);
PROGRAM Run WITH Fast : Main;
END_RESOURCE
END_CONFIGURATION"""
    instance = Program.read(text).instance()
    assert [instance.step()["Y"] for _ in range(2)] == [4.0, 12.0]
    (task,) = tasks_in(text)
    assert (task.name, task.interval, task.programs) == ("FAST", 0.0025, ("MAIN",))
    assert Program.read(text, name="Sum").instance().step(add=3.0) == {"TOTAL": 3.0}
    with pytest.raises(InputError, match="there is no Other, only SUM, MAIN"):
        Program.read(text, name="Other")
    for old, new, why in (
        ("WITH Fast", "WITH Slow", "line 18: there is no SLOW"),
        (": Main;", ": Other;", "line 18: there is no OTHER"),
        ("T#2.5ms", "2.5", "line 17: expected a time such as T#5ms"),
        ("END_CONFIGURATION", "END_CONFIGURATION x", "line 20: the end is expected"),
        ("one(add := one_more);", "one(sub := one_more);", "line 10: SUM has no input SUB"),
        ("one(add := one_more);", "one(one_more);", "line 10: SUM has no input without a name"),
        ("one(add := one_more);", "y(add := one_more);", "line 10: Y is no instance"),
        ("one.total", "one.rest", "line 11: ONE has no output REST"),
        ("y := two.total", "two.total := y", "line 13: TWO cannot be assigned"),
        ("y := two.total", "y := two", "line 13: TWO is an instance"),
        (": Sum;", ": Mean;", "line 9: there is no type MEAN"),
    ):
        with pytest.raises(InputError, match=f"structured text, {why}"):
            _tasks_of(text.replace(old, new))


def _tasks_of(text: str) -> int:
    Program.read(text)
    return len(tasks_in(text))


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("y := 1.0", "expected ;, found 'END_FUNCTION_BLOCK'"),
        ("y = 1.0;", "expected :=, found '='"),
        ("y := (1.0;", r"expected \), found ';'"),
        ("y := 1.0 + ;", "expected a name, found ';'"),
        ("y := z;", "Z is not declared"),
        ("y := a[0];", "A is no array"),
        ("y := x;", "X is an array"),
        ("y := x[2];", r"X\[2\] is out of 0..1"),
        ("y := x[i];", "an index must be a whole number"),
        ("y := p;", "BOOL is given where LREAL is wanted"),
        ("y := i;", "INT is given where LREAL is wanted"),
        ("y := 1;", "1 is no literal of LREAL"),
        ("p1 := a;", "LREAL is given where BOOL is wanted"),
        ("s := a;", "LREAL is given where REAL is wanted"),
        ("s := s * a;", "LREAL is given where REAL is wanted"),
        ("s := 1.0E39;", r"1e\+39 is out of the range of REAL"),
        ("s := 1.0E-300;", "1e-300 is out of the range of REAL"),
        ("y := a + p;", "BOOL and LREAL do not go together"),
        ("y := a * 2;", "2 is no literal of LREAL"),
        ("y := SEL(a, 1.0, 2.0);", "LREAL is given where BOOL is wanted"),
        ("y := SEL(p, 1.0);", "SEL takes 3 arguments, got 2"),
        ("y := SEL(G := p, IN1 := 1.0, IN2 := 1.0);", "SEL takes G, IN0, IN1"),
        ("y := MIN(p, p);", "MIN is of INT or DINT or REAL or LREAL, not of BOOL"),
        ("y := SQRT(i);", "SQRT is of REAL or LREAL, not of INT"),
        ("y := FLOOR(a);", "FLOOR is no function"),
        ("y := a MOD 2.0;", "MOD is not of LREAL"),
        ("p1 := a < b < c;", "< is of INT or DINT or REAL or LREAL, not of BOOL"),
        ("p1 := p < p;", "< is of INT or DINT or REAL or LREAL, not of BOOL"),
        ("p1 := NOT a;", "LREAL is given where BOOL is wanted"),
        ("p1 := a AND p;", "LREAL is given where BOOL is wanted"),
        ("IF a THEN y := 1.0; END_IF;", "LREAL is given where BOOL is wanted"),
        ("a := 1.0;", "A cannot be assigned"),
        ("IF p THEN y := 1.0;", "ELSIF or ELSE or END_IF is missing"),
        ("y := 1.0; (* open", "a comment does not end"),
        ("y := 1.0 ! 2.0;", "'!' is not read"),
        ("if := 1.0;", "expected a name, found ':='"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(line: str, why: str) -> None:
    text = f"""\
FUNCTION_BLOCK Wrong
VAR_INPUT a, b, c : LREAL; p : BOOL; i : INT; END_VAR
VAR_OUTPUT y : LREAL; s : REAL; p1 : BOOL; END_VAR
VAR x : ARRAY[0..1] OF LREAL; END_VAR
{line}
END_FUNCTION_BLOCK"""
    with pytest.raises(InputError, match=rf"structured text, line [56]: .*({why})"):
        Program.read(text)


@pytest.mark.parametrize(
    ("declared", "why"),
    [
        ("VAR_IN_OUT a : LREAL; END_VAR", "expected a name|is a reserved word|expected"),
        ("VAR a : STRING; END_VAR", "STRING is a reserved word"),
        ("VAR a : LREAL := b; END_VAR", "B is not declared|must be a literal"),
        ("VAR a : LREAL := 1.0 + 1.0; END_VAR", "the initial value of A must be a literal"),
        ("VAR a : LREAL := TRUE; END_VAR", "BOOL is given where LREAL is wanted"),
        ("VAR a, A : LREAL; END_VAR", "A is declared twice"),
        ("VAR a : ARRAY[1..2] OF LREAL; END_VAR", "an array begins at 0"),
        ("VAR a : ARRAY[0..2] OF LREAL := [1.0]; END_VAR", "1 values for an array of 3"),
        ("VAR_INPUT a : ARRAY[0..2] OF LREAL; END_VAR", "A must be one number or one BOOL"),
        ("VAR sin : LREAL; END_VAR", "SIN is a reserved word"),
        ("VAR 3 : LREAL; END_VAR", "expected a name, found '3'"),
        ("VAR a : ARRAY[0..n] OF LREAL; END_VAR", "expected a whole number"),
    ],
)
def test_wrong_declarations(declared: str, why: str) -> None:
    with pytest.raises(InputError, match=f"structured text, line 2: .*({why})"):
        Program.read(f"FUNCTION_BLOCK Wrong\n{declared}\nEND_FUNCTION_BLOCK")


def test_a_text_without_a_block() -> None:
    with pytest.raises(InputError, match="line 1: there is no FUNCTION_BLOCK"):
        Program.read("(* nothing *)")
    with pytest.raises(InputError, match="line 1: expected FUNCTION_BLOCK or PROGRAM"):
        Program.read("VAR a : LREAL; END_VAR")


@pytest.mark.parametrize(
    ("expression", "why"),
    [
        ("a / b", "division by zero"),
        ("SEL(b <> 0.0, 1.0, a / b)", "division by zero"),  # SEL evaluates both
        ("SQRT(-a)", "math domain error|nonnegative"),
        ("LN(b)", "math domain error|positive"),
        ("EXP(1000.0 * a)", "math range error"),
        ("1.0E200 * a * 1.0E200", "no finite number"),
    ],
)
@pytest.mark.parametrize("kind", ["LREAL", "REAL"])
def test_what_ends_a_program_on_a_controller_ends_it_here(
    expression: str, why: str, kind: str
) -> None:
    body = expression.replace("1.0E200", "1.0E30") if kind == "REAL" else expression
    text = f"""\
FUNCTION_BLOCK Stops
VAR_INPUT a : {kind} := 1.0; b : {kind}; END_VAR
VAR_OUTPUT y : {kind}; END_VAR

IF a > 0.0 THEN
    y := {body};
END_IF;
END_FUNCTION_BLOCK"""
    words = f"{why}|divide by zero|invalid value|overflow"
    with pytest.raises(InputError, match=f"line 6: STOPS stops: .*({words})"):
        Program.read(text).instance().step()


def test_inputs_are_known_and_finite() -> None:
    text = "FUNCTION_BLOCK F\nVAR_INPUT a : LREAL; END_VAR\nEND_FUNCTION_BLOCK"
    instance = Program.read(text).instance()
    with pytest.raises(InputError, match="F has no input other"):
        instance.step(other=1.0)
    with pytest.raises(InputError, match="a is no finite number: nan"):
        instance.step(a=math.nan)
