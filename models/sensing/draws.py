"""Random numbers that can be read from anywhere in a run.

What disturbs a simulation is drawn before it: noise, lost messages, errors of the reference unit.
A day at 10 ms has millions of samples, so the numbers come in blocks of a fixed size, each with a
seed of its own, and any stretch of them is the same however the run is cut into chunks.
"""

from functools import lru_cache
from typing import Literal

import numpy as np

from ..basics import FloatArray

_Law = Literal["normal", "uniform"]

SENSOR_NOISE, TELEMETRY, MRU_ERROR = 1, 2, 3  # purposes: second entry of the seed
MRU_SIGNS, MRU_DRIFT, MRU_NOISE = 7, 8, 9  # 4 to 6 are of motions

_BLOCK = 65536


def draw(
    seed: int, purpose: int, start: int, count: int, columns: int, law: _Law = "normal"
) -> FloatArray:
    """Return rows `start` to `start + count` of an endless table of independent numbers.

    Each seed and purpose has a table of its own.  A ``normal`` number has mean 0 and variance 1, a
    ``uniform`` one is in [0, 1).
    """
    table = np.empty((count, columns))
    for block in range(start // _BLOCK, -(-(start + count) // _BLOCK)):
        first = block * _BLOCK
        low, high = max(start, first), min(start + count, first + _BLOCK)
        rows = _block(seed, purpose, block, columns, law)[low - first : high - first]
        table[low - start : high - start] = rows
    return table


@lru_cache(maxsize=6)
def _block(seed: int, purpose: int, block: int, columns: int, law: _Law) -> FloatArray:
    # numpy fills short seeds up with zeros: [seed, purpose, 0] would be [seed, purpose] again.
    generator = np.random.default_rng(np.random.SeedSequence([seed, purpose, block + 1]))
    size = (_BLOCK, columns)
    table = generator.standard_normal(size) if law == "normal" else generator.random(size)
    table.setflags(write=False)
    return table
