r"""A linear predictive controller as C99: `native_mpc`.

    LinearMPC --> Tables --> mpc_data, and mpc_*.c beside them --> NativeLaw

The C does what `LinearMPC.step` does, with the same numbers: commands differ by rounding, which is
less than a billionth of the peak torque but where the Python's own is more.  That is so while gains
are on their way from an interrupted start, and where soft limits are far out of reach.

Its programme is solved by DAQP, of which CasADi's wheel has a library for this machine, headers and
licence; they are handed on with the law.  For another machine its sources are built there.

The bank of seas makes the law large: 2.6 million numbers for a horizon of eight seconds, some fifty
megabytes of C.  A controller with ``predictor="kalman"`` has none of them.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import casadi

from models.basics import InputError, SolverError
from models.sensing import NativeLaw, checked_prefix, interface_header

from ..forecast import SeaBank
from ..linear import LinearMPC
from .estimator_data import add_drive, add_estimator
from .forecast_data import add_forecast
from .programme_data import add_programme
from .tables import Tables

_OWNER = "native law"
_SOURCES = Path(__file__).parent / "c"
_LIBRARY = "daqp/libdaqpstat.a"
_HEADERS = ("auxiliary.h", "constants.h", "daqp.h", "factorization.h", "types.h")


def native_mpc(controller: LinearMPC, prefix: str = "mpc") -> NativeLaw:
    """Return the C of a linear predictive controller.

    Without what is around it: its interface to the operator is another law's.  Neither `counts` nor
    proofs of the answers are in it.

    Parameters
    ----------
    controller
        A `LinearMPC` with the predictor ``bank`` or ``kalman``, without preview, fallback or
        deadline.
    prefix
        What all names begin with.

    Raises
    ------
    InputError
        If the controller has what the C has not, or the prefix is no identifier of C.
    SolverError
        If the library of the solver is not there.

    Examples
    --------
    >>> from models import load_case
    >>> from mpc.linear import LinearMPC
    >>> from mpc.winch import ProcessNoise, Weights
    >>> weights = Weights(torque=0.02, noise=ProcessNoise(force=0.1, torque=0.05, rope=0.1))
    >>> case = load_case("thesis-1975")
    >>> law = native_mpc(LinearMPC(case, weights=weights, predictor="kalman"), "winch")
    >>> law.sources[0], law.links, law.commanded
    ('winch.c', ('daqp/libdaqpstat.a',), True)
    """
    checked_prefix(prefix)
    _check(controller)
    copied = solver_files()
    tables = Tables()
    add_estimator(tables, controller)
    add_drive(tables, controller)
    add_programme(tables, controller)
    add_forecast(tables, controller)
    written = {path.name: path.read_text(encoding="utf-8") for path in sorted(_SOURCES.iterdir())}
    files = {
        _named(name, prefix): _named(text, prefix)
        for name, text in (written | tables.files).items()
    }
    header = interface_header(prefix, f'#include "{prefix}_memory.h"', commanded=True)
    return NativeLaw(
        prefix=prefix,
        files={f"{prefix}.h": header, **files},
        copied=copied,
        links=(_LIBRARY,),
        tables={_named(name, prefix): parts for name, parts in tables.tables.items()},
        commanded=True,
    )


def solver_files() -> dict[str, Path]:
    """Return DAQP as CasADi's wheel has it: library, headers and licence, by path in the export.

    Raises SolverError if the wheel has it not.
    """
    root = Path(casadi.__file__).parent
    found = {f"daqp/{name}": root / "include" / "daqp" / name for name in _HEADERS}
    found[_LIBRARY] = root / "libdaqpstat.a"
    found["daqp/LICENSE"] = root / "include" / "licenses" / "daqp-external" / "LICENSE"
    missing = [str(path) for path in found.values() if not path.is_file()]
    if missing:
        raise SolverError(
            f"{_OWNER}: this installation of CasADi must have the library of DAQP, but has no "
            f"{missing[0]}"
        )
    return found


def _check(controller: LinearMPC) -> None:
    """Refuse a controller that does what the C does not."""
    if type(controller) is not LinearMPC:
        raise InputError(
            f"{_OWNER}: controller must be a LinearMPC itself, got a {type(controller).__name__}"
        )
    source = controller.predictor
    if source is not None and type(source) is not SeaBank:
        raise InputError(
            f"{_OWNER}: predictor must be bank or kalman, got a {type(source).__name__}"
        )
    for what, there in (
        ("preview", controller.preview is not None),
        ("fallback", controller._fallback is not None),
        ("deadline", controller._deadline < math.inf),
    ):
        if there:
            raise InputError(f"{_OWNER}: {what} must be none, as its C would not have it")


def _named(text: str, prefix: str) -> str:
    """Return text whose names begin with a prefix instead of ``mpc``."""
    lower = re.sub(r"\bmpc(?=[_.][A-Za-z])", prefix, text)
    return re.sub(r"\bMPC(?=_)", prefix.upper(), lower)
