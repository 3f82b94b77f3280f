"""The loop of a simulation with a controller that knows its C, run at full speed: `NativeLoop`.

    (s, r, p) -> measure -> (s', m)      m -> controller -> u, status
    (s', [r, u], p) -> advance -> (s'', log)

Both halves of a sample are compiled together with the controller's C (`models.sensing.NativeLaw`),
so that no sample goes through Python.  What the controller remembers is carried at the end of the
state, as bytes: a run can be begun anew from any sample.
"""

from __future__ import annotations

import ctypes
import functools
import hashlib
from typing import Any

import casadi as ca
import numpy as np
from typing_extensions import override

from ..basics import FloatArray, SolverError
from ..sensing import NativeLaw, function_as_c
from .compiler import find_compiler, load_library
from .kernel import BLOCK

HELD = 1000  # what a status is more where the command was no number, and the one before was held

_DRIVER = """
#define _POSIX_C_SOURCE 199309L
#include <math.h>
#include <stddef.h>
#include <string.h>
#include <time.h>

#include "{law}.h"

{measure_declaration}
{advance_declaration}

#if defined(_WIN32)
#define SEEN __declspec(dllexport)
#else
#define SEEN __attribute__((visibility("default")))
#endif

typedef struct {{
  double last;  /* the command before, which stands in for one that is no number */
  {law}_memory law;
}} kept;

static double now(void) {{
#if defined(CLOCK_MONOTONIC)
  struct timespec at;
  clock_gettime(CLOCK_MONOTONIC, &at);
  return (double)at.tv_sec + 1e-9 * (double)at.tv_nsec;
#else
  return NAN;
#endif
}}

{tables}

SEEN long long stillhook_size(void) {{ return (long long)sizeof(kept); }}

SEEN void stillhook_reset(void *memory, double command) {{
  kept *own = memory;
  own->last = command;
  {law}_reset(&own->law);
}}

SEEN void stillhook_loop(long long n, double *state, void *memory, const double *rows,
                         const double *p, double *out) {{
  static const size_t nr = {nr}, ns = {ns}, nout = {nout};
  kept *own = memory;
  long long k;
  for (k = 0; k < n; k++) {{
    const double *row = rows + nr * (size_t)k;
    double next[{ns}], measured[{nm}], asked[{nr} + 2], *log = out + (nout + 2) * (size_t)k;
    double began, command;
    int status;
    {measure_call}
    memcpy(state, next, ns * sizeof(double));
    began = now();
    command = {law}_step(&own->law, measured);
    log[nout + 1] = now() - began;
    status = {law}_status(&own->law);
    log[nout] = status + (isfinite(command) ? 0 : {held});
    own->last = isfinite(command) ? command : own->last;
    memcpy(asked, row, nr * sizeof(double));
    asked[nr] = own->last;
    asked[nr + 1] = status;
    {advance_call}
    memcpy(state, next, ns * sizeof(double));
  }}
}}
"""


class NativeLoop:
    """Two halves of a sample with a controller's C in between, as `Kernel` is one of a whole.

    Parameters
    ----------
    measure, advance
        casadi.Function (s, r, p) -> (s', m) and (s, [r, u] or [r, u, status], p) -> (s', log).
    law
        The controller's C.
    command
        What is commanded where its first command is no number.

    Attributes
    ----------
    states, outputs
        Numbers of s; of the log, after which come status and seconds of the controller's step.

    Raises
    ------
    SolverError
        If there is no compiler, or it fails.
    """

    compiled = True
    note = ""

    def __init__(
        self, measure: ca.Function, advance: ca.Function, law: NativeLaw, *, command: float
    ) -> None:
        compiler = find_compiler()
        if compiler is None:
            raise SolverError("kernel: no C compiler is to be had")
        self._halves, self._law, self._command = (measure, advance), law, command
        self.states, self.outputs = measure.numel_in(0), advance.numel_out(1)
        self._rows, self._parameters = measure.numel_in(1), measure.numel_in(2)
        first = function_as_c(measure, "stillhook_measure")
        second = function_as_c(advance, "stillhook_advance")
        driver = _DRIVER.format(
            tables=_tables(law),
            law=law.prefix,
            nr=self._rows,
            ns=self.states,
            nout=self.outputs,
            nm=measure.numel_out(1),
            held=HELD,
            measure_declaration=first.declaration,
            advance_declaration=second.declaration,
            measure_call=first.call(["state", "row", "p"], ["next", "measured"]),
            advance_call=second.call(["state", "asked", "p"], ["next", "log"]),
        )
        # Where the tables lie, which the library is told before each use; they are part of what it
        # is known by, as all who have it share it.
        parts = [part for table in law.tables.values() for part in table]
        self._tables = (ctypes.c_void_p * len(parts))(*(part.ctypes.data for part in parts))
        told = "".join(hashlib.sha256(part.tobytes()).hexdigest() for part in parts)
        driver += f"/* {told} */\n"
        sources = {"loop.c": driver, "measure.c": first.source, "advance.c": second.source}
        self._library = library = load_library({**law.files, **sources}, compiler, law)
        library.stillhook_size.restype = ctypes.c_longlong
        library.stillhook_reset.argtypes = (ctypes.c_void_p, ctypes.c_double)
        library.stillhook_loop.argtypes = (ctypes.c_longlong, *[ctypes.c_void_p] * 5)
        library.stillhook_loop.restype = None

    @override
    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle what it is made of; the library is found again where it is opened."""
        make = functools.partial(NativeLoop, command=self._command)
        return make, (*self._halves, self._law)

    def start(self) -> FloatArray:
        """Return what a controller that was reset remembers, as the end of a state."""
        self._library.stillhook_tables(self._tables)
        memory = np.zeros(-(-self._library.stillhook_size() // 8))
        self._library.stillhook_reset(memory.ctypes.data, self._command)
        return memory

    def run(
        self, state: FloatArray, rows: FloatArray, parameters: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Run over rows, (n, nr), from a state with the controller's memory at its end.

        Return state and memory after them, and the log with status and seconds, (n, outputs + 2).
        """
        moving, memory = state[: self.states].copy(), state[self.states :].copy()
        given = np.asarray(rows, dtype=np.float64, order="C")
        p = np.asarray(parameters, dtype=np.float64, order="C")
        assert given.shape[1:] == (self._rows,)
        assert p.shape == (self._parameters,)
        out = np.empty((len(given), self.outputs + 2))
        self._library.stillhook_tables(self._tables)
        for first in range(0, len(given), BLOCK):  # so that Python gets a chance to see Ctrl-C
            some, its = given[first : first + BLOCK], out[first : first + BLOCK]
            self._library.stillhook_loop(
                len(some),
                moving.ctypes.data,
                memory.ctypes.data,
                some.ctypes.data,
                p.ctypes.data,
                its.ctypes.data,
            )
        return np.concatenate([moving, memory]), out


def _tables(law: NativeLaw) -> str:
    """Return the C that defines a law's tables, and takes where they lie."""
    defined = [f"const double *{name}[{len(parts)}];" for name, parts in law.tables.items()]
    taken = [
        f"  for (k = 0; k < {len(parts)}; k++) {name}[k] = *all++;"
        for name, parts in law.tables.items()
    ]
    lines = ["SEEN void stillhook_tables(const double *const *all) {", "  int k;", *taken]
    return "\n".join([*defined, *lines, "  (void)all; (void)k;", "}"])
