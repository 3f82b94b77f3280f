"""Statements of structured text, written from the graph of a law.

Every number that is used once stands where it is used; the others have work variables, ``w1``,
``w2``, .. of numbers and ``b1``, ``b2``, .. of conditions.  SEL evaluates both of its numbers, as
CasADi does.  What could end a program on a controller, such as a division by zero, stands in an IF
wherever only one side of a choice asks for it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from models.basics import InputError

from .graph import Graph, Node

WIDTH = 100  #: Longest line.
_LONGEST = 150  # of an expression before it gets a variable of its own
_LARGEST, _SMALLEST = float(np.finfo(np.float32).max), float(np.finfo(np.float32).tiny)

# How strongly each operator binds in IEC 61131-3, the strongest highest.
_OR, _AND, _EQUAL, _LESS, _SUM, _PRODUCT, _SIGN, _WHOLE = range(1, 9)
_BINDS = {
    "OR": _OR,
    "AND": _AND,
    "=": _EQUAL,
    "<>": _EQUAL,
    "<": _LESS,
    "<=": _LESS,
    "+": _SUM,
    "-": _SUM,
    "*": _PRODUCT,
    "/": _PRODUCT,
}

Guards = frozenset[tuple[int, bool]]


@dataclass(frozen=True, kw_only=True)
class Code:
    """The body of a function block."""

    lines: tuple[str, ...]
    numbers: tuple[str, ...]  #: Its work variables that are numbers,
    conditions: tuple[str, ...]  #: and those that are BOOL.


def literal(value: float, kind: str) -> str:
    """Return a number as IEC 61131-3 writes it, with the digits that read back to the same one.

    Raises InputError if it is out of the range of REAL, where that is the kind.
    """
    if kind == "REAL" and value and not _SMALLEST <= abs(value) <= _LARGEST:
        raise InputError(f"structured text: the law has {value!r}, which REAL does not reach")
    text = str(np.float32(value)) if kind == "REAL" else repr(float(value))
    digits, _, power = text.partition("e")
    digits += "" if "." in digits else ".0"
    return f"{digits}E{int(power)}" if power else digits


def code_of(
    graph: Graph, inputs: Sequence[str], kind: str, notes: Mapping[int, str] | None = None
) -> Code:
    """Return the statements of a graph.

    Parameters
    ----------
    graph
        The law; its states are ``state[0]``, ``state[1]``, ..
    inputs
        Name of every input.
    kind
        ``LREAL`` or ``REAL``.
    notes
        What a state is, by its number.

    Raises
    ------
    InputError
        If a number of the law is out of the range of REAL.
    """
    writer = _Writer(graph, inputs, kind)
    writer.write()
    ends = []
    for i, root in enumerate(graph.following):
        if graph.nodes[root] != Node("state", (), float(i)):
            note = (notes or {}).get(i)
            line = f"state[{i}] := {writer.text(root, 0)};"
            ends.append(f"{line}  (* {note} *)" if note else line)
    return Code(
        lines=(*writer.lines, *wrapped(f"command := {writer.text(graph.command, 0)};"), *ends),
        numbers=tuple(name for name in writer.names.values() if name[0] == "w"),
        conditions=tuple(name for name in writer.names.values() if name[0] == "b"),
    )


class _Writer:
    """What has been written of a graph so far."""

    def __init__(self, graph: Graph, inputs: Sequence[str], kind: str) -> None:
        self._graph, self._inputs, self._kind = graph, inputs, kind
        self._reached = graph.reached()
        self._guards = _guards(graph, self._reached)
        self.lines: list[str] = []
        self.names: dict[int, str] = {}
        self._texts: dict[int, tuple[str, int]] = {}
        uses = dict.fromkeys(self._reached, 0)
        for i in self._reached:
            for j in graph.nodes[i].args:
                uses[j] += 1
        # A next state is kept until all are known, since the others are still made of this one.
        self._kept = {i for i, n in uses.items() if n > 1 and not graph.nodes[i].plain}
        self._kept |= {i for i in graph.roots if graph.nodes[i].op not in ("number", "input")}
        self._kept -= {
            root
            for i, root in enumerate(graph.following)
            if graph.nodes[root] == Node("state", (), float(i))
        }

    def write(self) -> None:
        """Write every work variable, each after those that it is made of."""
        done: set[int] = set()
        for root in self._graph.roots:
            left = [root]
            while left:
                i = left[-1]
                if i in done:
                    left.pop()
                    continue
                guards = self._guards.get(i, frozenset())
                needs = [*self._graph.nodes[i].args, *(c for c, _ in sorted(guards))]
                waits = [j for j in reversed(needs) if j not in done]
                if waits:
                    left += waits
                    continue
                left.pop()
                done.add(i)
                self._write(i, guards)

    def text(self, i: int, binds: int) -> str:
        """Return a node within an operator that binds so strongly."""
        if i in self.names:
            return self.names[i]
        text, own = self._texts[i]
        return text if own > binds else f"({text})"

    def _write(self, i: int, guards: Guards) -> None:
        node = self._graph.nodes[i]
        text, binds = self._expression(node)
        self._texts[i] = text, binds
        if not (i in self._kept or guards or (len(text) > _LONGEST and not node.plain)):
            return
        letter = "b" if node.logical else "w"
        name = f"{letter}{sum(other[0] == letter for other in self.names.values()) + 1}"
        statement = f"{name} := {text};"
        if guards:
            tests = [
                self.text(c, _AND) if so else f"NOT {self.text(c, _SIGN)}"
                for c, so in sorted(guards)
            ]
            self.lines += wrapped(f"IF {' AND '.join(tests)} THEN")
            self.lines += wrapped(statement, "  ")
            nothing = "FALSE" if node.logical else "0.0"
            self.lines += ["ELSE", f"  {name} := {nothing};  (* is not used *)", "END_IF;"]
        else:
            self.lines += wrapped(statement)
        self.names[i] = name

    def _expression(self, node: Node) -> tuple[str, int]:
        """Return the text of an operation, and how strongly it binds."""
        op, args = node.op, node.args
        if op == "number":
            text = literal(node.value, self._kind)
            return text, _SUM if text.startswith("-") else _WHOLE
        if op == "truth":
            return ("TRUE" if node.value else "FALSE"), _WHOLE
        if op == "state":
            return f"state[{int(node.value)}]", _WHOLE
        if op in ("input", "flag"):
            return self._inputs[int(node.value)], _WHOLE
        if op == "neg":
            return f"-{self.text(args[0], _SIGN)}", _SUM
        if op == "NOT":
            return f"NOT {self.text(args[0], _SIGN)}", _SIGN
        if op in _BINDS:
            binds = _BINDS[op]
            if binds <= _AND:
                left, right = (self._condition(j, op) for j in args)
            elif binds <= _LESS:
                left, right = (self.text(j, _LESS) for j in args)
            else:  # of the same strength the left one comes first
                left, right = self.text(args[0], binds - 1), self.text(args[1], binds)
            return f"{left} {op} {right}", binds
        if op == "one":
            return f"SEL({self.text(args[0], 0)}, 0.0, 1.0)", _WHOLE
        if op == "select":
            return f"SEL({', '.join(self.text(j, 0) for j in args)})", _WHOLE
        return f"{op}({', '.join(self.text(j, 0) for j in args)})", _WHOLE

    def _condition(self, i: int, op: str) -> str:
        """Return a condition within AND or OR; of another than itself each stands in brackets."""
        same = self._graph.nodes[i].op == op
        return self.text(i, 0 if same else _LESS)


def _guards(graph: Graph, reached: Sequence[int]) -> dict[int, Guards]:
    """Return of every node that could end a program the choices that all its uses stand in."""
    found: dict[int, Guards] = dict.fromkeys(graph.roots, frozenset())
    for i in reversed(reached):
        node, own = graph.nodes[i], found[i]
        for k, j in enumerate(node.args):
            within = own
            if node.op == "select" and k > 0:
                within = own | {(node.args[0], k == 2)}
            found[j] = found[j] & within if j in found else within
    return {i: g for i, g in found.items() if g and may_stop(graph, i)}


def may_stop(graph: Graph, i: int) -> bool:
    """Return whether an operation has no number to give for some arguments."""
    node = graph.nodes[i]
    if node.op == "/":
        divisor = graph.nodes[node.args[1]]
        return divisor.op != "number" or divisor.value == 0.0
    return node.op in ("SQRT", "LN", "EXP", "TAN")


def wrapped(text: str, indent: str = "") -> list[str]:
    """Return a statement in lines of at most `WIDTH`, broken between its words."""
    lines, line = [], indent
    for word in text.split(" "):
        if len(line) + len(word) + 1 > WIDTH - 4 and line.strip():
            lines.append(line.rstrip())
            line = indent + "    "
        line += word + " "
    return [*lines, line.rstrip()]
