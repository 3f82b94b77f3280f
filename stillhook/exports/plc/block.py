"""A function block before it is text: its variables and its body, of which ST and XML are written.

law --> block_of --> Block --> text (name.st), plcopen.py (name.xml)
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from models.sensing import Measurement, Recursion

from ..signals import SIGNALS, STATUS_TEXTS
from .code import WIDTH, code_of, literal, wrapped
from .graph import counted, graph_of

_NAME = 31  # longest name that every controller takes
_FLAG = "-"  # unit of a signal that is 0 or 1: BOOL
_TRUE = ("encoder.valid", "load_cell.valid")  # of a drive that has no such flag
_OLD = 1000.0  # age of what never came [s]


@dataclass(frozen=True, kw_only=True)
class Variable:
    """One declared variable."""

    name: str
    kind: str  #: ``BOOL``, ``INT``, ``REAL`` or ``LREAL``.
    initial: tuple[str, ...] = ()  #: Literals; of an array all of them, otherwise one or none.
    array: bool = False
    comment: str = ""

    def lines(self) -> list[str]:
        """Return its declaration, the comment before it."""
        size = len(self.initial)
        kind = f"ARRAY[0..{size - 1}] OF {self.kind}" if self.array else self.kind
        given = ", ".join(self.initial)
        start = f" := [{given}]" if self.array else f" := {given}" if given else ""
        return [*comment(self.comment, "    "), *wrapped(f"{self.name} : {kind}{start};", "    ")]


@dataclass(frozen=True, kw_only=True)
class Block:
    """A FUNCTION_BLOCK."""

    name: str
    about: str  #: Comment at its head.
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    states: tuple[Variable, ...]  #: Kept from one call to the next.
    work: tuple[Variable, ...]  #: Forgotten after each call.
    body: str  #: Its statements.

    def sections(self) -> Iterator[tuple[str, tuple[Variable, ...]]]:
        """Yield each section's keyword with its variables, where there are any."""
        for keyword, variables in (
            ("VAR_INPUT", self.inputs),
            ("VAR_OUTPUT", self.outputs),
            ("VAR", self.states),
            ("VAR_TEMP", self.work),
        ):
            if variables:
                yield keyword, variables

    @property
    def text(self) -> str:
        """It as structured text."""
        lines = [*comment(self.about, ""), f"FUNCTION_BLOCK {self.name}"]
        for keyword, variables in self.sections():
            lines.append(keyword)
            if keyword == "VAR_TEMP":
                lines += _listed(variables)
            else:
                lines += [line for variable in variables for line in variable.lines()]
            lines.append("END_VAR")
        return "\n".join([*lines, "", self.body, "END_FUNCTION_BLOCK", ""])


def block_name(name: str) -> str:
    """Return the name of the function block of a law."""
    return f"Stillhook_{name}"[:_NAME].rstrip("_")


def block_of(
    recursion: Recursion, name: str, kind: str, *, about: str, unit: str, rest: Measurement
) -> Block:
    """Return the function block of a recursion.

    Parameters
    ----------
    recursion
        The law.
    name
        Of the law, an identifier.
    kind
        ``LREAL`` or ``REAL``, in which it calculates.
    about
        Comment at its head, paragraphs apart by an empty line.
    unit
        Of the command.
    rest
        What is measured where nothing moves: the inputs' initial values.

    Raises
    ------
    InputError
        If the law has an operation or a constant that structured text, or REAL, has not.
    """
    flags = [i for i, signal in enumerate(SIGNALS) if signal.unit == _FLAG]
    graph = graph_of(recursion.function, flags)
    if kind == "REAL":
        graph = counted(graph)
    notes = {
        i: f"counts the steps of {step:.6g} of a clock from 0 to 1"
        for i, (_, step) in graph.clocks.items()
    }
    if recursion.status is not None:
        notes[recursion.status] = "the status"
    code = code_of(graph, [signal.identifier for signal in SIGNALS], kind, notes)
    heard = {
        int(node.value) for node in map(graph.nodes.__getitem__, graph.reached()) if node.heard
    }
    inputs = tuple(
        Variable(
            name=signal.identifier,
            kind="BOOL" if i in flags else kind,
            initial=(_initial(signal.name, i in flags, rest, kind),),
            comment=("" if i in flags else f"[{signal.unit or unit}] ")
            + _said(signal.meaning)
            + ("" if i in heard else " (this law does not use it)"),
        )
        for i, signal in enumerate(SIGNALS)
    )
    command = literal(float(rest["drive.applied"]), kind)
    statuses = "\n\n".join(f"{i} {text}: {why}" for i, (text, why) in enumerate(STATUS_TEXTS))
    outputs = (
        Variable(name="command", kind=kind, initial=(command,), comment=f"[{unit}] to the drive"),
        Variable(name="status", kind="INT", initial=("0",), comment=statuses),
    )
    first = tuple(
        literal(value * graph.clocks[i][0] if i in graph.clocks else value, kind)
        for i, value in enumerate(recursion.initial.tolist())
    )
    states = (
        (Variable(name="state", kind=kind, initial=first, array=True, comment=_of(recursion)),)
        if first
        else ()
    )
    status = "0" if recursion.status is None else f"{kind}_TO_INT(state[{recursion.status}])"
    return Block(
        name=block_name(name),
        about=about,
        inputs=inputs,
        outputs=outputs,
        states=states,
        work=(
            *(Variable(name=each, kind=kind) for each in code.numbers),
            *(Variable(name=each, kind="BOOL") for each in code.conditions),
        ),
        body="\n".join([*code.lines, f"status := {status};"]),
    )


def comment(text: str, indent: str) -> list[str]:
    """Return a text as comments, each paragraph one, or one a line; none of an empty text."""
    lines = []
    for paragraph in text.split("\n\n"):
        lines += [
            f"{indent}(* {line} *)" for line in textwrap.wrap(paragraph, WIDTH - 6 - len(indent))
        ]
    return lines


def _listed(variables: Sequence[Variable]) -> list[str]:
    """Return the declarations of many variables, those of one kind together."""
    lines = []
    for kind in dict.fromkeys(variable.kind for variable in variables):
        names = ", ".join(variable.name for variable in variables if variable.kind == kind)
        lines += wrapped(f"{names} : {kind};", "    ")
    return lines


def _initial(name: str, flag: bool, rest: Measurement, kind: str) -> str:
    """Return what an input is until the program gives it: rest, and no sensor that is not wired."""
    if flag:
        return "TRUE" if name in _TRUE else "FALSE"
    return literal(_OLD if name == "payload.age" else float(rest[name]), kind)


def _said(meaning: str) -> str:
    """Return the meaning of a flag or a signal, TRUE and FALSE in the place of 1 and 0."""
    if meaning.startswith("1 "):
        return meaning.replace("1 ", "TRUE ", 1).replace("else 0", "else FALSE")
    return meaning


def _of(recursion: Recursion) -> str:
    """Return what the states are."""
    last = recursion.status
    if last is None or last + 1 >= recursion.initial.size:
        return "of the operator's interface and of the law"
    return f"0 to {last} of the operator's interface, {last + 1} and on of the law itself"
