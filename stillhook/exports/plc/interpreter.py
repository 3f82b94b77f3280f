"""Structured text run: an interpreter of ours, strict where controllers differ.

    text --> st_syntax.py --> Program: Python, made once --> Instance.step, sample by sample

LREAL is double precision, REAL single: the result of every operation is rounded to it.  Types are
kept strictly: no number is a condition, and none is narrowed unless the text says so; a literal
takes the type of what it stands with.  SEL, AND and OR evaluate all of their arguments.  What
ends a program on some controllers ends it here: a division by zero, a root or a logarithm of what
has none, a number too large for its type, a result that is no number.
"""

from __future__ import annotations

import math
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import CodeType
from typing import Any

import numpy as np

from models.basics import FloatArray, InputError

from .syntax import (
    NUMBERS,
    TYPES,
    Assignment,
    Call,
    Choice,
    Declared,
    Expression,
    Number,
    Operation,
    Place,
    Statement,
    Truth,
    Unit,
    fault,
    units_in,
)

_REALS, _WHOLES = ("REAL", "LREAL"), ("INT", "DINT")
_RANGE = {"INT": 2**15, "DINT": 2**31}
_ORDERED = {"<": "<", ">": ">", "<=": "<=", ">=": ">=", "=": "==", "<>": "!="}
_FILE = "<structured text>"


def _sel(choice: bool, otherwise: Any, then: Any) -> Any:
    return then if choice else otherwise


def _least(*values: Any) -> Any:
    return min(values)


def _largest(*values: Any) -> Any:
    return max(values)


def _limit(low: Any, value: Any, high: Any) -> Any:
    return min(max(value, low), high)


def _quotient(a: int, b: int) -> int:
    return int(math.copysign(1, a) * math.copysign(1, b)) * (abs(a) // abs(b))


def _whole(kind: str) -> Callable[[Any], int]:
    """Return what rounds to a whole number, half to even, and knows the range."""

    def rounded(value: Any) -> int:
        found, most = round(float(value)), _RANGE[kind]
        if not -most <= found < most:
            raise OverflowError(f"{found} is out of the range of {kind}")
        return found

    return rounded


# Functions of one REAL or LREAL: in double precision those of the C library, as CasADi calls them.
_OF_REAL: dict[str, tuple[Callable[[float], float], Callable[[Any], Any]]] = {
    "SQRT": (math.sqrt, np.sqrt),
    "SIN": (math.sin, np.sin),
    "COS": (math.cos, np.cos),
    "TAN": (math.tan, np.tan),
    "EXP": (math.exp, np.exp),
    "LN": (math.log, np.log),
}
_CHOOSING: dict[str, tuple[tuple[str, ...], Callable[..., Any]]] = {
    "MIN": (("IN1", "IN2"), _least),
    "MAX": (("IN1", "IN2"), _largest),
    "LIMIT": (("MN", "IN", "MX"), _limit),
    "SEL": (("G", "IN0", "IN1"), _sel),
}
_CAST: dict[str, Callable[[Any], Any]] = {
    "BOOL": bool,
    "INT": _whole("INT"),
    "DINT": _whole("DINT"),
    "REAL": np.float32,
    "LREAL": float,
}
_ZERO: dict[str, Any] = {"BOOL": False, "INT": 0, "DINT": 0, "REAL": np.float32(0.0), "LREAL": 0.0}


@dataclass(frozen=True, slots=True)
class _Value:
    """An expression as Python, with its type.

    What is made of literals alone has no type until it meets another: it can be written `loose`.
    """

    code: str
    kind: str
    literal: float | None = None  #: The number that it is.
    loose: Callable[[str], str] | None = None  #: Its code by the type wanted.

    @property
    def whole(self) -> bool:
        """Whether it is a whole number, if it is a literal."""
        return self.kind in _WHOLES


@dataclass(frozen=True, kw_only=True, eq=False)
class Program:
    """A FUNCTION_BLOCK or a PROGRAM that can be run; `read` makes it."""

    name: str
    inputs: Mapping[str, str]  #: Type of every input by its name, in capitals.
    outputs: Mapping[str, str]  #: And of every output.
    _initial: Mapping[str, Any]
    _within: Mapping[str, Program]  # instances of other function blocks
    _code: CodeType
    _names: Mapping[str, Any]
    _lines: tuple[int, ...]  # of the text, for every line of Python

    @classmethod
    def read(cls, text: str, *, name: str | None = None) -> Program:
        """Return the program of a text.

        Parameters
        ----------
        text
            Structured text; each function block before those that use it.
        name
            Which one is meant; by default the last.

        Raises
        ------
        InputError
            With the line, if it is not of the subset that is known here, or a type is wrong.
        """
        known: dict[str, Program] = {}
        last = ""
        for unit in units_in(text):
            last = unit.name
            known[last] = _Compiler(unit, known).program()
        wanted = last if name is None else name.upper()
        if wanted not in known:
            raise InputError(f"structured text: there is no {name}, only {', '.join(known)}")
        return known[wanted]

    def instance(self) -> Instance:
        """Return one with a memory of its own."""
        return Instance(self)

    def run(self, samples: Mapping[str, Sequence[float] | FloatArray]) -> dict[str, FloatArray]:
        """Return the outputs of a new instance, sample by sample, (n,) each.

        Raises InputError as `Instance.step`.
        """
        instance = self.instance()
        columns = {name: np.asarray(values).tolist() for name, values in samples.items()}
        made = [
            instance.step(**dict(zip(columns, row, strict=True)))
            for row in zip(*columns.values(), strict=True)
        ]
        return {
            name: np.array([float(row[name]) for row in made], dtype=np.float64)
            for name in self.outputs
        }


class Instance:
    """A program with its memory."""

    def __init__(self, program: Program) -> None:
        self.program = program
        self._memory: dict[str, Any] = {
            name: list(value) if isinstance(value, list) else value
            for name, value in program._initial.items()
        }
        self._memory |= {name: Instance(block) for name, block in program._within.items()}
        names: dict[str, Any] = dict(program._names)
        exec(program._code, names)
        self._step = names["step"]

    def step(self, **inputs: float) -> dict[str, float]:
        """Return the outputs, by their names in capitals; an input not given keeps its value.

        Raises InputError if an input is unknown or no finite number, or where the program stops.
        """
        kinds, memory = self.program.inputs, self._memory
        for name, value in inputs.items():
            key = name.upper()
            if key not in kinds:
                raise InputError(f"structured text: {self.program.name} has no input {name}")
            if not math.isfinite(value):
                raise InputError(f"structured text: {name} is no finite number: {value}")
            memory[key] = _CAST[kinds[key]](value)
        self.call()
        return {name: memory[name] for name in self.program.outputs}

    def call(self) -> None:
        """Run it once with its inputs as they are."""
        try:
            with np.errstate(divide="raise", over="raise", invalid="raise"):
                self._step(self._memory)
        except (ArithmeticError, ValueError, IndexError) as error:
            raise fault(self._line(error), f"{self.program.name} stops: {error}") from error

    def _line(self, error: Exception) -> int:
        frames = [f for f in traceback.extract_tb(error.__traceback__) if f.filename == _FILE]
        return self.program._lines[(frames[-1].lineno or 1) - 1]


def _checked(value: Any) -> Any:
    """Return a number that is one.

    Raises ArithmeticError if it is not.
    """
    if not math.isfinite(value):
        raise ArithmeticError("a result is no finite number")
    return value


class _Compiler:
    """From the tree of a unit to Python, one line for every statement."""

    def __init__(self, unit: Unit, known: Mapping[str, Program]) -> None:
        self._unit, self._known = unit, known
        self._variables = {v.name: v for v in unit.variables}
        self._lines: list[str] = ["def step(memory):"]
        self._from: list[int] = [1]
        self._names: dict[str, Any] = {"checked": _checked}
        self._names |= {"quotient": _quotient, "fmod": math.fmod}
        self._names |= {f"to_{kind}": cast for kind, cast in _CAST.items()}

    def program(self) -> Program:
        """Return the program."""
        initial: dict[str, Any] = {}
        within: dict[str, Program] = {}
        kept = [v for v in self._unit.variables if v.section != "VAR_TEMP"]
        for v in self._unit.variables:
            if v.kind in TYPES:
                value = self._initial(v)
                if v.section == "VAR_TEMP":
                    self._names[f"i_{v.name}"] = value
                    copied = f"list(i_{v.name})" if v.size is not None else f"i_{v.name}"
                    self._line(1, f"v_{v.name} = {copied}", v.line)
                else:
                    initial[v.name] = value
            elif v.kind in self._known:
                within[v.name] = self._known[v.kind]
            else:
                raise fault(v.line, f"there is no type {v.kind}")
        for v in kept:
            self._line(1, f"v_{v.name} = memory[{v.name!r}]", v.line)
        self._statements(self._unit.body, 1)
        for v in kept:
            if v.kind in TYPES and v.section != "VAR_INPUT":
                self._line(1, f"memory[{v.name!r}] = v_{v.name}", v.line)
        code = compile("\n".join(self._lines), _FILE, "exec")
        found = {section: self._section(section) for section in ("VAR_INPUT", "VAR_OUTPUT")}
        return Program(
            name=self._unit.name,
            inputs=found["VAR_INPUT"],
            outputs=found["VAR_OUTPUT"],
            _initial=initial,
            _within=within,
            _code=code,
            _names=self._names,
            _lines=tuple(self._from),
        )

    def _section(self, section: str) -> dict[str, str]:
        found = {}
        for v in self._unit.variables:
            if v.section == section:
                if v.size is not None or v.kind not in TYPES:
                    raise fault(v.line, f"{v.name} must be one number or one BOOL")
                found[v.name] = v.kind
        return found

    def _initial(self, v: Declared) -> Any:
        values = []
        for given in v.initial:
            value = self._value(given)
            if not isinstance(given, Truth) and value.literal is None:
                raise fault(v.line, f"the initial value of {v.name} must be a literal")
            value = self._fit(value, v.kind, v.line)
            values.append(eval(value.code, dict(self._names)))
        if v.size is not None:
            return values or [_ZERO[v.kind]] * v.size
        return values[0] if values else _ZERO[v.kind]

    def _line(self, depth: int, code: str, line: int) -> None:
        self._lines.append("    " * depth + code)
        self._from.append(line)

    def _statements(self, statements: Sequence[Statement], depth: int) -> None:
        for statement in statements:
            if isinstance(statement, Assignment):
                self._assign(statement, depth)
            elif isinstance(statement, Call):
                self._invoke(statement, depth)
            else:
                self._choose(statement, depth)

    def _assign(self, it: Assignment, depth: int) -> None:
        to = self._place(it.to)
        if it.to.member is not None or self._variables[it.to.name].section == "VAR_INPUT":
            raise fault(it.line, f"{it.to.name} cannot be assigned")
        code = self._fit(self._value(it.value), to.kind, it.line).code
        self._line(
            depth, f"{to.code} = {f'checked({code})' if to.kind in _REALS else code}", it.line
        )

    def _invoke(self, it: Call, depth: int) -> None:
        kind = self._variables[it.name].kind if it.name in self._variables else ""
        if kind not in self._known:
            raise fault(it.line, f"{it.name} is no instance of a function block")
        inputs = self._known[kind].inputs
        for name, given in it.args:
            if name is None or name not in inputs:
                raise fault(it.line, f"{kind} has no input {name or 'without a name'}")
            code = self._fit(self._value(given), inputs[name], it.line).code
            self._line(depth, f"v_{it.name}._memory[{name!r}] = {code}", it.line)
        self._line(depth, f"v_{it.name}.call()", it.line)

    def _choose(self, it: Choice, depth: int) -> None:
        for k, (condition, statements) in enumerate(it.branches):
            test = self._fit(self._value(condition), "BOOL", it.line)
            self._line(depth, f"{'elif' if k else 'if'} {test.code}:", it.line)
            self._statements(statements, depth + 1)
            self._line(depth + 1, "pass", it.line)
        self._line(depth, "else:", it.line)
        self._statements(it.otherwise, depth + 1)
        self._line(depth + 1, "pass", it.line)

    def _place(self, it: Place) -> _Value:
        if it.name not in self._variables:
            raise fault(it.line, f"{it.name} is not declared")
        v = self._variables[it.name]
        if it.member is not None:
            outputs = self._known[v.kind].outputs if v.kind in self._known else {}
            if it.member not in outputs:
                raise fault(it.line, f"{it.name} has no output {it.member}")
            return _Value(f"v_{it.name}._memory[{it.member!r}]", outputs[it.member])
        if (v.size is None) != (it.index is None):
            raise fault(it.line, f"{it.name} is {'no' if v.size is None else 'an'} array")
        if it.index is None:
            if v.kind not in TYPES:
                raise fault(it.line, f"{it.name} is an instance, and has no value of its own")
            return _Value(f"v_{it.name}", v.kind)
        index = self._value(it.index)
        if index.literal is None or not index.whole:
            raise fault(it.line, "an index must be a whole number")
        if not 0 <= index.literal < (v.size or 0):
            raise fault(it.line, f"{it.name}[{index.literal:g}] is out of 0..{(v.size or 0) - 1}")
        return _Value(f"v_{it.name}[{int(index.literal)}]", v.kind)

    def _value(self, it: Expression) -> _Value:
        if isinstance(it, Number):
            return self._literal(it.value, "INT" if it.whole else "LREAL", it.line)
        if isinstance(it, Truth):
            return _Value(str(it.value), "BOOL")
        if isinstance(it, Place):
            return self._place(it)
        return self._function(it) if isinstance(it, Call) else self._operation(it)

    def _operation(self, it: Operation) -> _Value:
        args = [self._value(arg) for arg in it.args]
        if it.op in ("AND", "OR", "XOR", "NOT"):
            codes = [self._fit(arg, "BOOL", it.line).code for arg in args]
            if it.op == "NOT":
                return _Value(f"(not {codes[0]})", "BOOL")
            mark = {"AND": "&", "OR": "|", "XOR": "!="}[it.op]
            return _Value(f"({codes[0]} {mark} {codes[1]})", "BOOL")
        self._check(args[0], NUMBERS if it.op not in ("=", "<>") else TYPES, it.line, it.op)
        if it.op == "neg":
            if args[0].literal is not None:
                return self._literal(-args[0].literal, args[0].kind, it.line)
            return self._made(args, lambda a, _: f"(-{a})", it.line)
        if it.op in _ORDERED:
            left, right = self._alike(args, it.line)
            return _Value(f"({left.code} {_ORDERED[it.op]} {right.code})", "BOOL")

        def arithmetic(a: str, b: str, kind: str) -> str:
            if kind in _WHOLES and it.op != "**":
                calls = {"/": f"quotient({a}, {b})", "MOD": f"int(fmod({a}, {b}))"}
                return f"to_{kind}({calls.get(it.op, f'({a} {it.op} {b})')})"
            if it.op == "MOD" or kind in _WHOLES:
                raise fault(it.line, f"{it.op} is not of {kind}")
            return f"({a} {it.op} {b})"

        return self._made(args, arithmetic, it.line)

    def _literal(self, number: float, kind: str, line: int) -> _Value:
        """Return a literal."""
        whole = kind in _WHOLES

        def constant(wanted: str) -> str:
            if whole != (wanted in _WHOLES):
                raise fault(line, f"{number:g} is no literal of {wanted}")
            with np.errstate(over="ignore"):
                value = _CAST[wanted](number)
            if not math.isfinite(value) or (value == 0) != (number == 0.0):
                raise fault(line, f"{number:g} is out of the range of {wanted}")
            name = f"c{len(self._names)}"
            self._names[name] = value
            return name

        return _Value(constant(kind), kind, number, constant)

    def _made(self, args: Sequence[_Value], write: Callable[..., str], line: int) -> _Value:
        """Return what is written of the codes of one or more values of one type, and the type."""
        if all(arg.loose is not None for arg in args) and len({arg.whole for arg in args}) == 1:

            def loose(kind: str) -> str:
                return write(*(arg.loose(kind) for arg in args if arg.loose is not None), kind)

            kind = args[0].kind
            return _Value(loose(kind), kind, None, loose)
        alike = self._alike(args, line)
        return _Value(write(*(arg.code for arg in alike), alike[0].kind), alike[0].kind)

    def _function(self, it: Call) -> _Value:
        source, _, target = it.name.partition("_TO_")
        if source in TYPES and target in TYPES:
            arg = self._fit(self._value(self._given(it, ("IN",))[0]), source, it.line)
            if target == "BOOL":
                return _Value(f"({arg.code} != 0)", "BOOL")
            return _Value(f"to_{target}({arg.code})", target)
        if it.name in _CHOOSING:
            names, function = _CHOOSING[it.name]
            self._names[it.name] = function
            args = [self._value(arg) for arg in self._given(it, names)]
            first = [self._fit(args.pop(0), "BOOL", it.line).code] if it.name == "SEL" else []
            if it.name != "SEL":
                self._check(args[0], NUMBERS, it.line, it.name)
            return self._made(
                args, lambda *given: f"{it.name}({', '.join([*first, *given[:-1]])})", it.line
            )
        if it.name not in (*_OF_REAL, "ABS", "TRUNC"):
            raise fault(it.line, f"{it.name} is no function that is known here")
        arg = self._value(self._given(it, ("IN",))[0])
        if it.name == "ABS":
            self._check(arg, NUMBERS, it.line, it.name)
            return self._made([arg], lambda a, _: f"abs({a})", it.line)
        self._check(arg, _REALS, it.line, it.name)
        if it.name == "TRUNC":
            return _Value(f"to_DINT(int({arg.code}))", "DINT")
        self._names |= {
            f"{it.name}_{kind}": function
            for kind, function in zip(("LREAL", "REAL"), _OF_REAL[it.name], strict=True)
        }
        return self._made([arg], lambda a, kind: f"{it.name}_{kind}({a})", it.line)

    def _given(self, it: Call, names: tuple[str, ...]) -> list[Expression]:
        """Return the arguments of a call in their order, whether they have names or not."""
        if len(it.args) != len(names):
            raise fault(it.line, f"{it.name} takes {len(names)} arguments, got {len(it.args)}")
        if all(name is None for name, _ in it.args):
            return [given for _, given in it.args]
        by_name = dict(it.args)
        if set(by_name) != set(names):
            raise fault(it.line, f"{it.name} takes {', '.join(names)}")
        return [by_name[name] for name in names]

    def _alike(self, values: Sequence[_Value], line: int) -> list[_Value]:
        """Return values of one type: literals take that of the others, REAL grows to LREAL."""
        kinds = {value.kind for value in values if value.loose is None}
        if not kinds:
            kinds = {value.kind for value in values}
        if kinds in ({"REAL", "LREAL"}, {"INT", "DINT"}):
            kinds = {"LREAL" if "LREAL" in kinds else "DINT"}
        if len(kinds) > 1:
            raise fault(line, f"{' and '.join(sorted(kinds))} do not go together")
        (kind,) = kinds
        return [self._fit(value, kind, line) for value in values]

    def _fit(self, value: _Value, kind: str, line: int) -> _Value:
        """Return a value as one of a type.

        Raises InputError if it is of another, and would have to be narrowed.
        """
        if value.loose is not None and kind in NUMBERS:
            return _Value(value.loose(kind), kind)
        if value.kind == kind:
            return value
        if (value.kind, kind) in (("REAL", "LREAL"), ("INT", "DINT")):
            return _Value(f"to_{kind}({value.code})", kind)
        raise fault(line, f"{value.kind} is given where {kind} is wanted")

    @staticmethod
    def _check(value: _Value, kinds: Sequence[str], line: int, what: str) -> None:
        if value.kind not in kinds:
            raise fault(line, f"{what} is of {' or '.join(kinds)}, not of {value.kind}")
