"""Structured text read: tokens, and the tree of a FUNCTION_BLOCK or a PROGRAM.

    text --> units_in --> Unit (its variables and statements) --> st_interpreter.py

A subset of IEC 61131-3: what an exported law and its example need.  Binding of operators, from the
strongest: brackets and calls; - and NOT; **; * / MOD; + -; < > <= >=; = <>; AND &; XOR; OR; those
of the same strength from left to right.  Nothing here knows of the code that writes the text.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection
from dataclasses import dataclass

from models.basics import InputError

NUMBERS = ("INT", "DINT", "REAL", "LREAL")
TYPES = ("BOOL", *NUMBERS)

_WORDS = """
ABS ACOS ACTION AND ARRAY ASIN AT ATAN BOOL BY BYTE CASE CONCAT CONFIGURATION CONSTANT COS DATE
DINT DIV DO DWORD ELSE ELSIF EN END_CASE END_FOR END_FUNCTION END_FUNCTION_BLOCK END_IF
END_PROGRAM END_REPEAT END_STRUCT END_TYPE END_VAR END_WHILE ENO EQ EXIT EXP EXPT FALSE FOR
FUNCTION FUNCTION_BLOCK GE GT IF INT LE LEN LIMIT LINT LN LOG LREAL LT LWORD MAX MIN MOD MOVE
MUL MUX NE NOT OF ON OR PRIORITY PROGRAM READ_ONLY READ_WRITE REAL REPEAT RESOURCE RETAIN RETURN
ROL ROR SEL SHL SHR SIN SINGLE SINT SQRT STEP STRING STRUCT SUB TAN TASK THEN TIME TO TRANSITION
TRUE TRUNC TYPE UDINT UINT ULINT UNTIL USINT VAR VAR_ACCESS VAR_CONFIG VAR_EXTERNAL VAR_GLOBAL
VAR_INPUT VAR_IN_OUT VAR_OUTPUT VAR_TEMP WHILE WITH WORD WSTRING XOR
"""
_RESERVED = frozenset(_WORDS.split())

_TOKEN = re.compile(
    r"""(?P<space>\s+|\(\*.*?\*\)|//[^\n]*)
      | (?P<real>\d[\d_]*\.\d[\d_]*([eE][+-]?\d+)?)
      | (?P<whole>\d[\d_]*)
      | (?P<time>T\#\d+(\.\d+)?ms)
      | (?P<name>[A-Za-z_]\w*)
      | (?P<mark>:=|=>|\*\*|<=|>=|<>|\.\.|[-+*/<>=&()\[\],;:.])""",
    re.VERBOSE | re.DOTALL,
)


@dataclass(frozen=True, slots=True)
class Token:
    """A word, a number or a mark of the text."""

    kind: str  #: ``real``, ``whole``, ``time``, ``name``, ``mark``, or ``end`` after the last.
    text: str  #: As it stands; names in capitals, as IEC 61131-3 does not tell them apart.
    line: int


@dataclass(frozen=True, slots=True)
class Number:
    """A literal."""

    value: float
    whole: bool
    line: int


@dataclass(frozen=True, slots=True)
class Truth:
    """TRUE or FALSE."""

    value: bool
    line: int


@dataclass(frozen=True, slots=True)
class Place:
    """A variable, a place in an array, or an output of an instance."""

    name: str
    index: Expression | None
    member: str | None
    line: int


@dataclass(frozen=True, slots=True)
class Operation:
    """An operator with its one or two operands."""

    op: str
    args: tuple[Expression, ...]
    line: int


@dataclass(frozen=True, slots=True)
class Call:
    """A function, or an instance of a function block, with what it is given, by name or not."""

    name: str
    args: tuple[tuple[str | None, Expression], ...]
    line: int


Expression = Number | Truth | Place | Operation | Call


@dataclass(frozen=True, slots=True)
class Assignment:
    """A place gets a value."""

    to: Place
    value: Expression
    line: int


@dataclass(frozen=True, slots=True)
class Choice:
    """IF, ELSIF, ELSE: conditions with their statements, and the statements otherwise."""

    branches: tuple[tuple[Expression, tuple[Statement, ...]], ...]
    otherwise: tuple[Statement, ...]
    line: int


Statement = Assignment | Choice | Call


@dataclass(frozen=True, slots=True)
class Declared:
    """A variable as it was declared."""

    name: str
    kind: str  #: One of `TYPES`, or the name of a function block.
    section: str  #: ``VAR_INPUT``, ``VAR_OUTPUT``, ``VAR`` or ``VAR_TEMP``.
    size: int | None  #: Of an array.
    initial: tuple[Expression, ...]
    line: int


@dataclass(frozen=True, slots=True)
class Unit:
    """A FUNCTION_BLOCK or a PROGRAM."""

    name: str
    variables: tuple[Declared, ...]
    body: tuple[Statement, ...]


@dataclass(frozen=True, slots=True)
class Task:
    """A cyclic task of a CONFIGURATION."""

    name: str
    interval: float  #: [s]
    programs: tuple[str, ...]  #: Which it runs.


def fault(line: int, why: str) -> InputError:
    """Return the error at a line of the text."""
    return InputError(f"structured text, line {line}: {why}")


def units_in(text: str) -> tuple[Unit, ...]:
    """Return the function blocks and programs of a text; a CONFIGURATION ends it.

    Raises InputError, with the line, where it is not of the subset.
    """
    units, _ = _read(text)
    return units


def tasks_in(text: str) -> tuple[Task, ...]:
    """Return the tasks of the CONFIGURATION that a text ends with; none if it has none.

    Raises InputError as `units_in`, or if a task runs a program that is not there.
    """
    _, tasks = _read(text)
    return tasks


def _read(text: str) -> tuple[tuple[Unit, ...], tuple[Task, ...]]:
    reader, units = _Reader(_tokens(text)), list[Unit]()
    while not reader.at("CONFIGURATION") and reader.token.kind != "end":
        units.append(reader.unit())
    if not units:
        raise fault(1, "there is no FUNCTION_BLOCK and no PROGRAM")
    if reader.token.kind == "end":
        return tuple(units), ()
    return tuple(units), reader.configuration({unit.name for unit in units})


def _tokens(text: str) -> list[Token]:
    found, at, line = [], 0, 1
    while at < len(text):
        match = _TOKEN.match(text, at)
        if match is None:
            raise fault(line, f"{text[at]!r} is not read")
        kind, word = str(match.lastgroup), match.group()
        if kind == "mark" and text.startswith("(*", at):
            raise fault(line, "a comment does not end")
        if kind != "space":
            found.append(Token(kind, word.upper() if kind == "name" else word, line))
        line += word.count("\n")
        at = match.end()
    return [*found, Token("end", "the end", line)]


class _Reader:
    """A recursive-descent parser over the tokens."""

    def __init__(self, tokens: list[Token]) -> None:
        self._tokens, self._at = tokens, 0

    @property
    def token(self) -> Token:
        """What comes next."""
        return self._tokens[self._at]

    def at(self, *texts: str) -> bool:
        """Return whether one of these words or marks comes next."""
        return self.token.kind in ("name", "mark") and self.token.text in texts

    def take(self, *texts: str) -> Token:
        """Return what comes next, one of these.

        Raises InputError if it is something else.
        """
        if not self.at(*texts):
            raise fault(
                self.token.line, f"expected {' or '.join(texts)}, found {self.token.text!r}"
            )
        return self._next()

    def name(self) -> str:
        """Return a name that somebody gave."""
        token = self._next()
        if token.kind != "name":
            raise fault(token.line, f"expected a name, found {token.text!r}")
        if token.text in _RESERVED:
            raise fault(token.line, f"{token.text} is a reserved word")
        return token.text

    def unit(self) -> Unit:
        """Return the function block or program that comes next."""
        keyword = self.take("FUNCTION_BLOCK", "PROGRAM").text
        name = self.name()
        variables: list[Declared] = []
        while self.at("VAR_INPUT", "VAR_OUTPUT", "VAR", "VAR_TEMP"):
            section = self._next().text
            while not self.at("END_VAR"):
                variables += self._declared(section)
            self._next()
        names: set[str] = set()
        for variable in variables:
            if variable.name in names:
                raise fault(variable.line, f"{variable.name} is declared twice")
            names.add(variable.name)
        body = self._statements(f"END_{keyword}")
        self._next()
        return Unit(name, tuple(variables), body)

    def configuration(self, known: Collection[str]) -> tuple[Task, ...]:
        """Return the tasks of the configuration that comes next: one resource, and then the end."""
        self.take("CONFIGURATION")
        self.name()
        self.take("RESOURCE")
        self.name()
        self.take("ON")
        self.name()
        tasks: dict[str, float] = {}
        while self.at("TASK"):
            self._next()
            name = self.name()
            for word in ("(", "INTERVAL", ":="):
                self.take(word)
            tasks[name] = self._time()
            for word in (",", "PRIORITY", ":="):
                self.take(word)
            self._whole()
            self.take(")")
            self.take(";")
        runs: dict[str, list[str]] = {name: [] for name in tasks}
        while self.at("PROGRAM"):
            self._next()
            self.name()
            self.take("WITH")
            task, line = self.name(), self.token.line
            self.take(":")
            program = self.name()
            self.take(";")
            if task not in tasks or program not in known:
                raise fault(line, f"there is no {program if task in tasks else task}")
            runs[task].append(program)
        self.take("END_RESOURCE")
        self.take("END_CONFIGURATION")
        if self.token.kind != "end":
            raise fault(self.token.line, f"the end is expected, not {self.token.text!r}")
        return tuple(Task(name, tasks[name], tuple(runs[name])) for name in tasks)

    def _time(self) -> float:
        token = self._next()
        if token.kind != "time":
            raise fault(token.line, f"expected a time such as T#5ms, found {token.text!r}")
        return float(token.text[2:-2]) / 1e3

    def _next(self) -> Token:
        token = self.token
        self._at += token.kind != "end"
        return token

    def _declared(self, section: str) -> list[Declared]:
        line, names = self.token.line, [self.name()]
        while self.at(","):
            self._next()
            names.append(self.name())
        self.take(":")
        size = None
        if self.at("ARRAY"):
            self._next()
            self.take("[")
            if self._whole() != 0:
                raise fault(line, "an array begins at 0")
            self.take("..")
            size = self._whole() + 1
            self.take("]")
            self.take("OF")
        kind = self._next().text if self.at(*TYPES) else self.name()
        initial: list[Expression] = []
        if self.at(":="):
            self._next()
            if size is None:
                initial.append(self.expression())
            else:
                self.take("[")
                initial.append(self.expression())
                while self.at(","):
                    self._next()
                    initial.append(self.expression())
                self.take("]")
                if len(initial) != size:
                    raise fault(line, f"{len(initial)} values for an array of {size}")
        self.take(";")
        return [Declared(name, kind, section, size, tuple(initial), line) for name in names]

    def _whole(self) -> int:
        token = self._next()
        if token.kind != "whole":
            raise fault(token.line, f"expected a whole number, found {token.text!r}")
        return int(token.text)

    def _statements(self, *ends: str) -> tuple[Statement, ...]:
        found: list[Statement] = []
        while not self.at(*ends):
            if self.token.kind == "end" or self.token.text.startswith("END_"):
                raise fault(self.token.line, f"{' or '.join(ends)} is missing")
            found.append(self._statement())
        return tuple(found)

    def _statement(self) -> Statement:
        line = self.token.line
        if self.at("IF"):
            return self._choice()
        if self._tokens[self._at + 1].text == "(":
            name = self.name()
            call = Call(name, self._arguments(), line)
            self.take(";")
            return call
        to = self._place()
        self.take(":=")
        value = self.expression()
        self.take(";")
        return Assignment(to, value, line)

    def _choice(self) -> Choice:
        line, branches = self.token.line, []
        otherwise: tuple[Statement, ...] = ()
        self.take("IF")
        while True:
            condition = self.expression()
            self.take("THEN")
            branches.append((condition, self._statements("ELSIF", "ELSE", "END_IF")))
            word = self._next().text
            if word == "ELSE":
                otherwise = self._statements("END_IF")
                self._next()
            if word != "ELSIF":
                break
        self.take(";")
        return Choice(tuple(branches), otherwise, line)

    def expression(self) -> Expression:
        """Return the expression that comes next."""
        return self._binary(
            ("OR",),
            lambda: self._binary(
                ("XOR",),
                lambda: self._binary(
                    ("AND", "&"),
                    lambda: self._binary(
                        ("=", "<>"),
                        lambda: self._binary(("<", ">", "<=", ">="), self._sum),
                    ),
                ),
            ),
        )

    def _sum(self) -> Expression:
        return self._binary(("+", "-"), lambda: self._binary(("*", "/", "MOD"), self._power))

    def _power(self) -> Expression:
        return self._binary(("**",), self._unary)

    def _binary(self, marks: tuple[str, ...], part: Callable[[], Expression]) -> Expression:
        left = part()
        while self.at(*marks):
            token = self._next()
            op = "AND" if token.text == "&" else token.text
            left = Operation(op, (left, part()), token.line)
        return left

    def _unary(self) -> Expression:
        if self.at("-", "NOT"):
            token = self._next()
            return Operation("neg" if token.text == "-" else "NOT", (self._primary(),), token.line)
        return self._primary()

    def _primary(self) -> Expression:
        token = self.token
        if token.kind in ("real", "whole"):
            self._next()
            return Number(float(token.text.replace("_", "")), token.kind == "whole", token.line)
        if self.at("TRUE", "FALSE"):
            return Truth(self._next().text == "TRUE", token.line)
        if self.at("("):
            self._next()
            inner = self.expression()
            self.take(")")
            return inner
        if token.kind == "name" and self._tokens[self._at + 1].text == "(":
            self._next()  # functions are reserved words themselves
            return Call(token.text, self._arguments(), token.line)
        return self._place()

    def _place(self) -> Place:
        line, name = self.token.line, self.name()
        index = member = None
        if self.at("["):
            self._next()
            index = self.expression()
            self.take("]")
        elif self.at("."):
            self._next()
            member = self.name()
        return Place(name, index, member, line)

    def _arguments(self) -> tuple[tuple[str | None, Expression], ...]:
        self.take("(")
        given: list[tuple[str | None, Expression]] = []
        while not self.at(")"):
            name = None
            if self.token.kind == "name" and self._tokens[self._at + 1].text == ":=":
                name = self._next().text
                self._next()
            given.append((name, self.expression()))
            if not self.at(")"):
                self.take(",")
        self._next()
        return tuple(given)
