r"""A controller as C99: `NativeLaw`, and that of a recursion, `recursion_as_c`.

    Recursion --> C sources --> drive, PLC, FMU, or the compiled loop of the simulation

Whatever a controller is made of, its C has one interface.  With a prefix p, ``p.h`` declares

.. code-block:: c

    typedef struct { ... } p_memory;                     /* all that it remembers */
    void   p_reset(p_memory *memory);                    /* forget every earlier measurement */
    double p_step(p_memory *memory, const double *measured);   /* a sample: the command */
    int    p_status(const p_memory *memory);             /* of the last step, as in STATUSES */

and, of a law that compares its command with what the drive follows, while another command may go
there instead (``commanded``),

.. code-block:: c

    void   p_commanded(p_memory *memory, double command);

``measured`` has the numbers of `HEARD` in its order.  Nothing is allocated; the memory may be
copied as bytes; no function has any other state.
"""

from __future__ import annotations

import keyword
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import cast

import casadi as ca

from ..basics import FloatArray, InputError
from .control import (
    HEARD,
    Controller,
    ControllerAround,
    Measurement,
    Recursion,
    recursion_of,
)

_ROW = 6  # numbers on a line of a table
_INCLUDED = """\
#ifndef {guard}
#define {guard}

#ifdef __cplusplus
extern "C" {{
#endif
{body}
#ifdef __cplusplus
}}
#endif

#endif
"""


@dataclass(frozen=True, kw_only=True, eq=False)
class NativeLaw:
    """The C of a controller, as the interface above."""

    prefix: str  #: Of every name in it, an identifier of C.
    files: Mapping[str, str]  #: Text of each source and header by its name, ``prefix.h`` with them.
    #: Files that are copied as they are, by their path beside the sources: libraries and headers
    #: of others with their licences.
    copied: Mapping[str, Path] = field(default_factory=dict)
    links: tuple[str, ...] = ()  #: Which of those are linked.
    #: Tables that are long, by name, each of so many parts: a header of the files declares
    #: ``extern const double *name[parts];``.  `written` defines them; a loop that is compiled here
    #: hands them over as they are, as it would take a compiler long to read them.
    tables: Mapping[str, tuple[FloatArray, ...]] = field(default_factory=dict)
    #: Whether `p_commanded` is there.
    commanded: bool = False

    @property
    def sources(self) -> tuple[str, ...]:
        """Names of the files that are compiled."""
        return tuple(name for name in self.files if name.endswith(".c"))

    @property
    def written(self) -> NativeLaw:
        """The law with its tables as sources too, each part in one of its own."""
        files = dict(self.files)
        for name, parts in self.tables.items():
            names = [f"{name}_{k}" for k in range(len(parts))]
            for one, part in zip(names, parts, strict=True):
                files[f"{one}.c"] = (
                    f"extern const double {one}[{part.size}];\n"
                    f"const double {one}[{part.size}] = {{\n{_lines(part)}}};\n"
                )
            declared = "\n".join(f"extern const double {one}[];" for one in names)
            files[f"{name}.c"] = (
                f"{declared}\nextern const double *{name}[{len(parts)}];\n"
                f"const double *{name}[{len(parts)}] = {{{', '.join(names)}}};\n"
            )
        return replace(self, files=files, tables={})


class WithC(ControllerAround):
    """A controller in Python that knows its C, of which `make` writes that of a prefix."""

    def __init__(self, controller: Controller, make: Callable[[str], NativeLaw]) -> None:
        super().__init__(controller)
        self._make = make

    def as_c(self, prefix: str) -> NativeLaw:
        """Return the C that does what `step` does."""
        return self._make(prefix)

    def step(self, measurement: Measurement, time: float) -> float:
        """Return what the controller within commands [V, rad/s or N m]."""
        return self._controller.step(measurement, time)


def native_of(controller: Controller, prefix: str) -> NativeLaw | None:
    """Return the C of a prefix that does what a controller does, None if there is none.

    A recursion has one, and so has a controller with a method ``as_c(prefix)`` that says so.

    Raises InputError if the prefix is no identifier of C.
    """
    recursion = recursion_of(controller)
    if recursion is not None:
        return recursion_as_c(recursion, prefix)
    make = getattr(controller, "as_c", None)
    return None if make is None else make(checked_prefix(prefix))


def recursion_as_c(recursion: Recursion, prefix: str) -> NativeLaw:
    """Return the C of a recursion, written by CasADi from the function that is simulated.

    Raises InputError if the prefix is no identifier of C.
    """
    size, f = recursion.initial.size, recursion.function
    step = function_as_c(f, f"{checked_prefix(prefix)}_law")
    status = f"(int)memory->state[{recursion.status}]" if recursion.status is not None else "0"
    memory = f"typedef struct {{\n  double state[{max(size, 1)}];\n}} {prefix}_memory;"
    source = f"""\
#include <string.h>

#include "{prefix}.h"

{step.declaration}

static const double at_first[{max(size, 1)}] = {{{numbers(recursion.initial)}}};

void {prefix}_reset({prefix}_memory *memory) {{
  memcpy(memory->state, at_first, sizeof at_first);
}}

double {prefix}_step({prefix}_memory *memory, const double *measured) {{
  double next[{max(size, 1)}] = {{0.0}}, command = 0.0;
  {step.call(["memory->state", "measured"], ["next", "&command"])}
  memcpy(memory->state, next, sizeof next);
  return command;
}}

int {prefix}_status(const {prefix}_memory *memory) {{
  {"" if recursion.status is not None else "(void)memory;"}
  return {status};
}}
"""
    files = {
        f"{prefix}.h": interface_header(prefix, memory),
        f"{prefix}.c": source,
        f"{prefix}_law.c": step.source,
    }
    return NativeLaw(prefix=prefix, files=files)


@dataclass(frozen=True, kw_only=True)
class FunctionInC:
    """A CasADi function as C: its own source, and how another source calls it."""

    name: str
    source: str
    sizes: tuple[int, int, int, int]  #: Of CasADi's argument, result, index and work arrays.

    @property
    def declaration(self) -> str:
        """The prototype."""
        return (
            f"int {self.name}(const double **arg, double **res, long long int *iw, double *w,\n"
            f"{' ' * (5 + len(self.name))}int mem);"
        )

    def call(self, given: Iterable[str], made: Iterable[str]) -> str:
        """Return the statement that calls it, of pointers to what is given and made."""
        n_arg, n_res, n_iw, n_w = self.sizes
        return f"""{{
    const double *arg[{n_arg}] = {{{", ".join(given)}}};
    double *res[{n_res}] = {{{", ".join(made)}}};
    long long int iw[{n_iw + 1}];
    double w[{n_w + 1}];
    {self.name}(arg, res, iw, w, 0);
  }}"""


def function_as_c(function: ca.Function, name: str) -> FunctionInC:
    """Return a function of dense columns as C under a name."""
    # What is made of calls stays so: written out it would be many times as long.
    kind = cast("type[ca.SX]", ca.SX if function.is_a("SXFunction") else ca.MX)
    symbols = [kind.sym(f"a{i}", function.numel_in(i)) for i in range(function.n_in())]
    named = ca.Function(name, symbols, [ca.densify(out) for out in function.call(symbols)])
    generator = ca.CodeGenerator(f"{name}.c", {"with_header": False})
    generator.add(named)
    sizes = (named.sz_arg(), named.sz_res(), named.sz_iw(), named.sz_w())
    return FunctionInC(name=name, source=str(generator.dump()), sizes=sizes)


def interface_header(prefix: str, memory: str, *, about: str = "", commanded: bool = False) -> str:
    """Return the header of a native law, whose memory is declared so.

    `about` is a comment that it begins with, `memory` the typedef of ``prefix_memory``.
    """
    told = f"\nvoid {prefix}_commanded({prefix}_memory *memory, double command);"
    body = f"""
#define {prefix.upper()}_INPUTS {len(HEARD)}

{memory}

void {prefix}_reset({prefix}_memory *memory);
double {prefix}_step({prefix}_memory *memory, const double *measured);
int {prefix}_status(const {prefix}_memory *memory);{told if commanded else ""}
"""
    return about + _INCLUDED.format(guard=f"{prefix.upper()}_H", body=body)


def numbers(values: Iterable[float]) -> str:
    """Return numbers as C that reads them back to the last bit."""
    return ", ".join(repr(float(value)) for value in values) or "0.0"


def _lines(values: FloatArray) -> str:
    flat = values.ravel().tolist()
    return ",\n".join(numbers(flat[k : k + _ROW]) for k in range(0, len(flat), _ROW))


def checked_prefix(prefix: str) -> str:
    """Return a prefix that is an identifier of C.

    Raises InputError if it is none.
    """
    if not re.fullmatch(r"[a-z][a-z0-9_]{0,40}", prefix) or keyword.iskeyword(prefix):
        raise InputError(
            "native law: prefix must be up to 41 lower-case letters, digits and underscores, a "
            f"letter first, got {prefix!r}"
        )
    return prefix
