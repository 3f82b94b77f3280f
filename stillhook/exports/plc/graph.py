"""A law as a graph of operations, between CasADi and the structured text of a controller.

    casadi.Function (SX) --> graph_of --> Graph --> st_code.py
                                            `--> counted: its clocks count samples (for REAL)

CasADi knows numbers alone: a condition is 0 or 1, and a choice is the sum of two products.  Here
conditions are BOOL and a choice is one node, as a reader of structured text expects.  Nothing is
reordered: every number is made of the same operations as in CasADi, so that it is the same number
to the last bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from models.basics import InputError

_OWNER = "structured text"

COMPARISONS = ("<", "<=", "=", "<>")
_LOGIC = ("AND", "OR", "NOT", "flag", "truth", *COMPARISONS)

_TWO = {
    ca.OP_ADD: "+",
    ca.OP_SUB: "-",
    ca.OP_MUL: "*",
    ca.OP_DIV: "/",
    ca.OP_FMIN: "MIN",
    ca.OP_FMAX: "MAX",
    ca.OP_LT: "<",
    ca.OP_LE: "<=",
    ca.OP_EQ: "=",
    ca.OP_NE: "<>",
    ca.OP_AND: "AND",
    ca.OP_OR: "OR",
}
_ONE = {
    ca.OP_NEG: "neg",
    ca.OP_FABS: "ABS",
    ca.OP_SQRT: "SQRT",
    ca.OP_SIN: "SIN",
    ca.OP_COS: "COS",
    ca.OP_TAN: "TAN",
    ca.OP_EXP: "EXP",
    ca.OP_LOG: "LN",
    ca.OP_NOT: "NOT",
}
_NAMES = {
    getattr(ca, name): name.removeprefix("OP_").lower() for name in dir(ca) if name[:3] == "OP_"
}

_STEPS = 1e-6  # how far from a whole number the steps of a clock may be, as a share
_SAME = 1e-12  # by how much two steps of one clock may differ, as a share
_TOLERANCE = 1e-6  # of REAL: some ten units in the last place


@dataclass(frozen=True, slots=True)
class Node:
    """One operation.

    `op` is an operator or a function of structured text, or one of these: ``number`` (`value`),
    ``truth`` (`value` 0 or 1), ``state`` and ``input`` and ``flag`` (`value` is which), ``neg``,
    ``one`` (1 where a condition holds, else 0), ``select`` (a condition, the number where it does
    not hold, that where it does).
    """

    op: str
    args: tuple[int, ...] = ()
    value: float = 0.0

    @property
    def logical(self) -> bool:
        """Whether it is a BOOL."""
        return self.op in _LOGIC

    @property
    def heard(self) -> bool:
        """Whether it is a measurement."""
        return self.op in ("input", "flag")

    @property
    def plain(self) -> bool:
        """Whether it costs nothing to name it again."""
        return self.op in ("number", "truth", "state", "input", "flag")


@dataclass(eq=False)
class Graph:
    """Nodes, each after those that it is made of, and the next states and the command."""

    nodes: list[Node] = field(default_factory=list)
    following: list[int] = field(default_factory=list)  #: Node of every next state.
    command: int = -1
    #: Number of steps from 0 to 1 of every state that is a clock, and the length of a step.
    clocks: dict[int, tuple[float, float]] = field(default_factory=dict)
    _known: dict[Node, int] = field(default_factory=dict)

    def add(self, op: str, *args: int, value: float = 0.0) -> int:
        """Return the node, made if it is not there yet."""
        node = Node(op, args, value)
        if node not in self._known:
            self._known[node] = len(self.nodes)
            self.nodes.append(node)
        return self._known[node]

    def number(self, value: float) -> int:
        """Return a constant.

        Raises InputError if it is not finite.
        """
        if not math.isfinite(value):
            raise InputError(f"{_OWNER}: the law has a constant that is no finite number: {value}")
        return self.add("number", value=value)

    def truth(self, value: bool) -> int:
        """Return TRUE or FALSE."""
        return self.add("truth", value=float(value))

    def logical(self, i: int) -> int:
        """Return a node as a BOOL: true where its number is not 0."""
        node = self.nodes[i]
        if node.logical:
            return i
        if node.op == "one":
            return node.args[0]
        if node.op == "number":
            return self.truth(node.value != 0.0)
        return self.add("<>", i, self.number(0.0))

    def numeric(self, i: int) -> int:
        """Return a node as a number: 1 where its condition holds, else 0."""
        node = self.nodes[i]
        if node.op == "truth":
            return self.number(node.value)
        return self.add("one", i) if node.logical else i

    def negation(self, i: int) -> int:
        """Return NOT a node."""
        i = self.logical(i)
        node = self.nodes[i]
        if node.op == "NOT":
            return node.args[0]
        return self.truth(node.value == 0.0) if node.op == "truth" else self.add("NOT", i)

    def select(self, condition: int, otherwise: int, then: int) -> int:
        """Return `then` where a condition holds, else `otherwise`."""
        condition = self.logical(condition)
        otherwise, then = self.numeric(otherwise), self.numeric(then)
        node = self.nodes[condition]
        if node.op == "NOT":
            return self.select(node.args[0], then, otherwise)
        if node.op == "truth":
            return then if node.value else otherwise
        if otherwise == then:
            return then
        if self._is(otherwise, 0.0) and self._is(then, 1.0):
            return self.add("one", condition)
        if self._is(otherwise, 1.0) and self._is(then, 0.0):
            return self.add("one", self.negation(condition))
        return self.add("select", condition, otherwise, then)

    def compare(self, op: str, a: int, b: int) -> int:
        """Return a comparison; of a condition's 0 or 1 with a constant, the condition itself."""
        a, b = self.numeric(a), self.numeric(b)
        for one, other, turned in ((a, b, False), (b, a, True)):
            if self.nodes[one].op == "one" and self.nodes[other].op == "number":
                limit, condition = self.nodes[other].value, self.nodes[one].args[0]
                pairs = ((limit, x) if turned else (x, limit) for x in (0.0, 1.0))
                no, yes = (_HOLDS[op](*pair) for pair in pairs)
                if no == yes:
                    return self.truth(yes)
                return condition if yes else self.negation(condition)
        return self.add(op, a, b)

    def sum(self, a: int, b: int) -> int:
        """Return a + b; the two halves of a choice, of which one is always 0, as the choice."""
        a, b = self.numeric(a), self.numeric(b)
        one, other = self._halves(a), self._halves(b)
        if one is not None and other is not None and one[0] == other[0]:
            if self._is(one[1], 0.0) and self._is(other[2], 0.0):
                return self.select(one[0], other[1], one[2])
            if self._is(one[2], 0.0) and self._is(other[1], 0.0):
                return self.select(one[0], one[1], other[2])
        return self.add("+", a, b)

    def _halves(self, i: int) -> tuple[int, int, int] | None:
        """Return (condition, number where it does not hold, and where it does), if it is that."""
        node = self.nodes[i]
        if node.op == "select":
            return node.args[0], node.args[1], node.args[2]
        if node.op != "one":
            return None
        condition, zero, one = node.args[0], self.number(0.0), self.number(1.0)
        if self.nodes[condition].op == "NOT":
            return self.nodes[condition].args[0], one, zero
        return condition, zero, one

    def _is(self, i: int, value: float) -> bool:
        return self.nodes[i] == Node("number", (), value)

    @property
    def roots(self) -> list[int]:
        """The next states and the command."""
        return [*self.following, self.command]

    def reached(self) -> list[int]:
        """Return every node that is needed, ascending."""
        found: set[int] = set()
        left = list(self.roots)
        while left:
            i = left.pop()
            if i not in found:
                found.add(i)
                left += self.nodes[i].args
        return sorted(found)


_HOLDS: dict[str, Callable[[float, float], bool]] = {
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    "=": lambda a, b: a == b,
    "<>": lambda a, b: a != b,
}


def graph_of(function: ca.Function, flags: Collection[int] = ()) -> Graph:
    """Return the graph of a recursion's function, (state, measured) -> (next state, command).

    Parameters
    ----------
    function
        An SX function, or one that can be expanded to it.
    flags
        Which of the measurements are 0 or 1 and nothing else: BOOL.

    Raises
    ------
    InputError
        If it has an operation that structured text has not, or a constant that is not finite.
    """
    f = function if function.is_a("SXFunction") else function.expand()
    graph = Graph()
    graph.following = [graph.number(0.0)] * f.numel_out(0)
    at: dict[int, int] = {}  # what stands in every place of CasADi's work array
    for k in range(f.n_instructions()):
        op, given, made = f.instruction_id(k), f.instruction_input(k), f.instruction_output(k)
        if op == ca.OP_OUTPUT:
            value = graph.numeric(at[given[0]])
            if made[0] == 0:
                graph.following[made[1]] = value
            else:
                graph.command = value
        elif op == ca.OP_INPUT:
            flag = given[0] == 1 and given[1] in flags
            kind = "state" if given[0] == 0 else "flag" if flag else "input"
            at[made[0]] = graph.add(kind, value=float(given[1]))
        elif op == ca.OP_CONST:
            at[made[0]] = graph.number(float(f.instruction_constant(k)))
        else:
            at[made[0]] = _operation(graph, op, [at[i] for i in given])
    return graph


def _operation(graph: Graph, op: int, args: Sequence[int]) -> int:
    """Return the node of one instruction of CasADi."""
    if op == ca.OP_ASSIGN:
        return args[0]
    if op == ca.OP_NOT:
        return graph.negation(args[0])
    if op == ca.OP_IF_ELSE_ZERO:
        return graph.select(args[0], graph.number(0.0), args[1])
    name = _TWO.get(op, "")
    if name in ("AND", "OR"):
        return graph.add(name, *map(graph.logical, args))
    if name in COMPARISONS:
        return graph.compare(name, *args)
    if name == "+":
        return graph.sum(*args)
    numbers = [graph.numeric(i) for i in args]
    a = numbers[0]
    if name or op in _ONE:
        return graph.add(name or _ONE[op], *numbers)
    if op == ca.OP_SQ:
        return graph.add("*", a, a)
    if op == ca.OP_TWICE:
        return graph.add("*", graph.number(2.0), a)
    if op == ca.OP_INV:
        return graph.add("/", graph.number(1.0), a)
    if op == ca.OP_SIGN:
        zero = graph.number(0.0)
        below = graph.select(graph.compare("<", a, zero), zero, graph.number(-1.0))
        return graph.select(graph.compare("<", zero, a), below, graph.number(1.0))
    raise InputError(
        f"{_OWNER}: the law takes {_NAMES.get(op, op)}() of a number, which is not written as "
        "structured text; export it as C or as an FMU"
    )


def counted(graph: Graph) -> Graph:
    """Return a graph for single precision: its clocks count, and its tolerances are wider.

    A clock is a state that goes from 0 to 1 and back in equal steps.  The sum of a thousand steps
    in single precision reaches 1 some samples early or late, and does not come back to 0, and at
    both ends the law branches.  So the state becomes the number of steps, which is exact, and the
    clock is that number times the length of a step.  Two numbers that differ by less than a
    relative tolerance are taken as equal; a tolerance finer than single precision becomes 1E-6.
    """
    new = Graph()
    found = {i: step for i in range(len(graph.following)) if (step := _step_of(graph, i))}
    became: dict[int, int] = {}  # what every node has become
    counts: dict[int, dict[int, int]] = {i: {} for i in found}  # and a clock's, as a count
    for i, node in enumerate(graph.nodes):
        for state, step in found.items():
            count = _count(graph, new, i, (state, step), became, counts[state])
            if count is None:
                continue
            counts[state][i] = count
            if node.op != "number":
                scaled = new.add("*", count, new.number(_length(step)))
                # Before it is held within its ends a clock may be beyond them.
                free = node.op == "+"
                became[i] = scaled if free else new.add("MIN", scaled, new.number(1.0))
        if i not in became:
            args = [became[j] for j in node.args]
            if _is_tolerance(graph, i):
                sizes = new.nodes[args[0]].args[1]
                args[0] = new.add("*", new.number(_TOLERANCE), sizes)
            became[i] = new.add(node.op, *args, value=node.value)
    for i, root in enumerate(graph.following):
        new.following.append(counts[i][root] if i in found else became[root])
    new.command = became[graph.command]
    new.clocks = {i: (_highest(step), step) for i, step in found.items()}
    return new


def _step_of(graph: Graph, state: int) -> float | None:
    """Return the length of the step, if a state is a clock; None if it is not."""
    steps: set[float] = set()
    left, seen = [graph.following[state]], set[int]()
    while left:
        i = left.pop()
        if i in seen:
            continue
        seen.add(i)
        node = graph.nodes[i]
        if node.op == "number" and node.value in (0.0, 1.0):
            continue
        if node == Node("state", (), float(state)):
            continue
        if node.op == "select":
            left += node.args[1:]
        elif node.op in ("MIN", "MAX"):
            left += node.args
        elif node.op == "+":
            moved = [_moves(graph, j) for j in node.args]
            if (moved[0] is None) == (moved[1] is None):
                return None
            at = 0 if moved[1] is not None else 1
            steps |= moved[1 - at] or set()
            left.append(node.args[at])
        else:
            return None
    sizes = {abs(step) for step in steps}
    step = max(sizes, default=0.0)
    return step if step > 0.0 and step - min(sizes) <= _SAME * step and step < 1.0 else None


def _moves(graph: Graph, i: int) -> set[float] | None:
    """Return the constants that a node chooses from; None if it is not that."""
    node = graph.nodes[i]
    if node.op == "number":
        return {node.value}
    if node.op != "select":
        return None
    both = [_moves(graph, j) for j in node.args[1:]]
    return None if both[0] is None or both[1] is None else both[0] | both[1]


def _count(
    graph: Graph,
    new: Graph,
    i: int,
    clock: tuple[int, float],
    became: dict[int, int],
    counts: dict[int, int],
) -> int | None:
    """Return the count of steps that a clock's number stands for; None if it is no such number.

    The clock is its state and the length of its step.
    """
    state, step = clock
    node = graph.nodes[i]
    if node.op == "number" and node.value in (0.0, 1.0):
        return new.number(node.value * _highest(step))
    if node == Node("state", (), float(state)):
        return new.add("state", value=node.value)
    parts = node.args[1:] if node.op == "select" else node.args
    if not any(j in counts and graph.nodes[j].op != "number" for j in parts):
        return None
    if node.op == "+":
        moves = [_moves(graph, j) for j in parts]
        if (moves[0] is None) == (moves[1] is None):
            return None
        at = 0 if moves[1] is not None else 1
        return new.add("+", counts[parts[at]], _in_steps(graph, new, parts[1 - at], became))
    if node.op not in ("select", "MIN", "MAX") or not all(j in counts for j in parts):
        return None
    a, b = (counts[j] for j in parts)
    return new.select(became[node.args[0]], a, b) if node.op == "select" else new.add(node.op, a, b)


def _in_steps(graph: Graph, new: Graph, i: int, became: dict[int, int]) -> int:
    """Return a constant, or a choice of constants, as a number of steps."""
    node = graph.nodes[i]
    if node.op == "number":
        return new.number(math.copysign(1.0, node.value) if node.value else 0.0)
    no, yes = (_in_steps(graph, new, j, became) for j in node.args[1:])
    return new.select(became[node.args[0]], no, yes)


def _highest(step: float) -> float:
    """Return how many steps there are from 0 to 1."""
    steps = 1.0 / step
    return float(round(steps)) if abs(steps - round(steps)) < _STEPS * steps else steps


def _length(step: float) -> float:
    """Return the length of a step in REAL, such that the highest count makes 1 or more."""
    length, steps = np.float32(step), np.float32(_highest(step))
    while steps * length < np.float32(1.0):
        length = np.nextafter(length, np.float32(1.0))
    return float(length)


def _is_tolerance(graph: Graph, i: int) -> bool:
    """Return whether a node is c (|a| + |b|) < |a - b| with a c finer than single precision."""
    node = graph.nodes[i]
    if node.op != "<":
        return False
    left, right = (graph.nodes[j] for j in node.args)
    if left.op != "*" or right.op != "ABS" or graph.nodes[left.args[0]].op != "number":
        return False
    factor, total, difference = (
        graph.nodes[left.args[0]].value,
        graph.nodes[left.args[1]],
        graph.nodes[right.args[0]],
    )
    if total.op != "+" or difference.op != "-" or not 0.0 < factor < _TOLERANCE:
        return False
    sizes = [graph.nodes[j] for j in total.args]
    return all(s.op == "ABS" for s in sizes) and {s.args[0] for s in sizes} == set(difference.args)
