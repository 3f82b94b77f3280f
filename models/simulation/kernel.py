"""The recursion of a simulation, run over many samples at full speed.

    (s, r, p) -> (s_next, out)     s state, r one row of exogenous numbers, p parameters

Everything that happens in one control sample is one symbolic function; `Kernel` runs it over
rows of numbers.  If there is a C compiler, CasADi writes the function as C, a loop around it
is compiled with it (`models.simulation.compiler`) and called through ctypes; otherwise CasADi's
virtual machine runs it, with the same numbers and about a tenth of the speed.
"""

import ctypes
import functools
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt
from typing_extensions import override

from ..basics import FloatArray, InputError, SolverError
from .compiler import find_compiler, load_library

# Python sees an interrupt only between blocks; even slow recursions take a block in a second.
BLOCK = 8192  # rows handed to the compiled loop at once
VM_BLOCKS = (256, 16, 1)  # rows handed to the virtual machine at once, largest first
_NAME = "stillhook_recursion"

_DRIVER = """
#include <stdlib.h>
#include <string.h>
#if defined(_WIN32)
__declspec(dllexport)
#else
__attribute__((visibility("default")))
#endif
long long stillhook_drive(long long n, double *state, const double *rows, const double *p,
                          double *out) {{
  const double *arg[{sz_arg}] = {{0}};
  double *res[{sz_res}] = {{0}};
  double *work = malloc(sizeof(double) * {sz_w} + sizeof(casadi_int) * {sz_iw});
  if (!work) return -2;
  casadi_int *iw = (casadi_int *)(work + {sz_w});
  double *next = work + {next};
  long long k = 0, failed = -1;
  for (; k < n; k++) {{
    arg[0] = state; arg[1] = rows + {nr} * k; arg[2] = p;
    res[0] = next; res[1] = out + {nout} * k;
    if ({name}(arg, res, iw, work, 0)) {{ failed = k; break; }}
    memcpy(state, next, sizeof(double) * {ns});
  }}
  free(work);
  return failed;
}}
"""


class Kernel:
    """A recursion that can be run over many rows.

    Parameters
    ----------
    function
        casadi.Function (s, r, p) -> (s_next, out), all column vectors; r and p may be empty.
    compiled
        True: as C; False: in CasADi's virtual machine; None: as C if that is possible.

    Attributes
    ----------
    compiled
        Whether it runs as C.
    note
        Why it does not though it might have, else empty.

    Raises
    ------
    InputError
        If the function's inputs or outputs are not of that form.
    SolverError
        If C was demanded and there is no compiler, or it fails.

    Notes
    -----
    What repeats within a sample, such as an integration step, is best a function of its own
    that an MX graph calls: unrolled, 13 steps of a rope of 40 masses take 15 times as long to
    compile and three times as long to run.
    """

    compiled: bool
    note: str

    def __init__(self, function: ca.Function, *, compiled: bool | None = None) -> None:
        self._given = function
        self._asked = compiled
        self._function = _in_form(function)
        self.states = int(self._function.numel_in(0))
        self.row_size = int(self._function.numel_in(1))
        self.parameters = int(self._function.numel_in(2))
        self.outputs = int(self._function.numel_out(1))
        self._engine, self.note = _engine(self._function, compiled)
        self.compiled = isinstance(self._engine, _Compiled)

    def run(
        self, state: npt.ArrayLike, rows: npt.ArrayLike, parameters: npt.ArrayLike
    ) -> tuple[FloatArray, FloatArray]:
        """Run the recursion over rows r (n, nr), n may be zero, one after the other, from s (ns,).

        p (np,) is the same for all rows.  The state after the last comes back, and what came out at
        each row (n, nout), new arrays.

        Raises InputError if a shape is wrong; SolverError if the function itself reports that it
        failed.

        Notes
        -----
        NaN and infinity are passed on.  An interrupt is seen within some thousand rows.
        """
        moving = np.array(state, dtype=np.float64)  # a copy: it is changed in place
        given = np.asarray(rows, dtype=np.float64, order="C")
        p = np.asarray(parameters, dtype=np.float64, order="C")
        shapes = moving.shape, given.shape[1:], p.shape
        if given.ndim != 2 or shapes != ((self.states,), (self.row_size,), (self.parameters,)):
            raise InputError(
                f"kernel: state, row and parameters must have {self.states}, {self.row_size} and "
                f"{self.parameters} numbers, got shapes {moving.shape}, {given.shape} and {p.shape}"
            )
        out = np.empty((len(given), self.outputs))
        self._engine.run(moving, given, p, out)
        return moving, out

    def step(
        self, state: npt.ArrayLike, row: npt.ArrayLike, parameters: npt.ArrayLike
    ) -> tuple[FloatArray, FloatArray]:
        """Run the recursion over one row (nr,); otherwise as `run`, with `out` (nout,)."""
        after, out = self.run(state, np.asarray(row)[np.newaxis], parameters)
        return after, out[0]

    @override
    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the function and the wish; the library is found again where it is opened."""
        return functools.partial(Kernel, compiled=self._asked), (self._given,)


class _Compiled:
    """The recursion as C; it works in place: `state` is changed, `out` filled."""

    def __init__(self, library: ctypes.CDLL) -> None:
        self._drive = library.stillhook_drive
        self._drive.restype = ctypes.c_longlong
        self._drive.argtypes = (ctypes.c_longlong, *[ctypes.c_void_p] * 4)

    def run(self, state: FloatArray, rows: FloatArray, p: FloatArray, out: FloatArray) -> None:
        held, given = state.ctypes.data, p.ctypes.data
        for first in range(0, len(rows), BLOCK):
            some, its = rows[first : first + BLOCK], out[first : first + BLOCK]
            # Block by block, so that Python gets a chance to see Ctrl-C in between.
            failed = self._drive(len(some), held, some.ctypes.data, given, its.ctypes.data)
            if failed != -1:
                raise _failed(first + max(0, failed))


class _Interpreted:
    """The recursion in CasADi's virtual machine, in place too, many rows to a call."""

    def __init__(self, function: ca.Function) -> None:
        self._accumulated = functools.cache(lambda size: function.mapaccum("rows", size))

    def run(self, state: FloatArray, rows: FloatArray, p: FloatArray, out: FloatArray) -> None:
        # A call from Python costs more than a sample: long stretches go in one call, the rest in
        # shorter ones.
        first = 0
        for size in VM_BLOCKS:
            if len(rows) - first < size:
                continue
            # A C-contiguous (n, nr) is CasADi's column-major (nr, n): nothing is copied.
            states, repeated = np.empty((size, state.size)), np.tile(p, (size, 1))
            several: Any = self._accumulated(size)  # CasADi's stubs know buffers only in C++
            buffer, evaluate = several.buffer()
            buffer.set_arg(0, state.data)
            buffer.set_arg(2, repeated.data)
            buffer.set_res(0, states.data)
            while len(rows) - first >= size:
                buffer.set_arg(1, rows[first : first + size].data)
                buffer.set_res(1, out[first : first + size].data)
                try:
                    evaluate()
                except RuntimeError as error:
                    raise _failed(first) from error
                if buffer.ret():
                    raise _failed(first)
                state[:] = states[-1]
                first += size


def _in_form(function: ca.Function) -> ca.Function:
    """Return the function under our name, its outputs dense."""
    inputs = [function.sparsity_in(i) for i in range(function.n_in())]
    outputs = [function.sparsity_out(i) for i in range(function.n_out())]
    columns = all(size.size2() == 1 or not size.numel() for size in inputs + outputs)
    dense = all(size.is_dense() for size in inputs)
    counted = len(inputs) == 3 and len(outputs) == 2
    if not (counted and columns and dense and inputs[0].numel() == outputs[0].numel()):
        raise InputError(
            "kernel: the recursion must be a function (s, r, p) -> (s_next, out) of dense columns, "
            f"s_next as long as s, got {function}"
        )
    kind: Any = ca.SX if function.is_a("SXFunction") else ca.MX
    symbols = [kind.sym(name, size) for name, size in zip("srp", inputs, strict=True)]
    results = [ca.densify(result) for result in function.call(symbols)]
    return ca.Function(_NAME, symbols, results, ["s", "r", "p"], ["s_next", "out"])


def _engine(function: ca.Function, compiled: bool | None) -> tuple[_Compiled | _Interpreted, str]:
    """Return what runs the function, and why that is not C though it might have been."""
    if compiled is False:
        return _Interpreted(function), ""
    compiler = find_compiler()
    try:
        if compiler is None:
            raise SolverError(
                "kernel: no C compiler is to be had: set CC or put cc, gcc or clang on the PATH, "
                "and do not set STILLHOOK_COMPILE to 0"
            )
        library = load_library(_source(function), compiler)
    except SolverError as error:
        if compiled:
            raise
        return _Interpreted(function), str(error)
    return _Compiled(library), ""


def _source(function: ca.Function) -> str:
    generator = ca.CodeGenerator("stillhook_kernel.c", {"with_header": False})
    generator.add(function)
    ns = function.numel_in(0)
    driver = _DRIVER.format(
        name=_NAME,
        sz_arg=max(3, function.sz_arg()),
        sz_res=max(2, function.sz_res()),
        sz_iw=function.sz_iw() + 1,
        sz_w=function.sz_w() + ns + 1,
        next=function.sz_w(),
        ns=ns,
        nr=function.numel_in(1),
        nout=function.numel_out(1),
    )
    return str(generator.dump()) + driver


def _failed(row: int) -> SolverError:
    return SolverError(f"kernel: the recursion failed at row {row} or soon after it")
