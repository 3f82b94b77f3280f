"""One BLAS thread while many small problems are solved.

Synthesis multiplies matrices of twenty rows, thousands of times.  Left alone, BLAS spreads
each product over all cores and spends its time waiting for them: on two busy cores a design
took 50 s instead of 8 s.
"""

import importlib
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

from threadpoolctl import ThreadpoolController


@contextmanager
def one_thread() -> Iterator[None]:
    """Run a block with one BLAS thread."""
    with _libraries().limit(limits=1, user_api="blas"):
        yield


@cache
def _libraries() -> ThreadpoolController:
    """Return the BLAS libraries that are loaded, looked for once, as that takes a millisecond."""
    importlib.import_module("scipy.linalg")  # it brings one of its own
    return ThreadpoolController()
