"""One BLAS thread while many small problems are solved.

Synthesis multiplies matrices of twenty rows, thousands of times.  Left alone, BLAS spreads
each product over all cores and spends its time waiting for them: on two busy cores a design
took 50 s instead of 8 s.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import threadpool_limits


@contextmanager
def one_thread() -> Iterator[None]:
    """Run a block with one BLAS thread."""
    with threadpool_limits(limits=1, user_api="blas"):
        yield
