from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.basics import GRAVITY, wave_frequency, wave_number

DEPTHS = st.one_of(st.just(math.inf), st.floats(0.5, 5000.0))


@given(omega=st.floats(1e-3, 20.0), depth=DEPTHS)
def test_wave_numbers_and_frequencies_undo_each_other(omega: float, depth: float) -> None:
    k = wave_number(omega, depth)
    assert wave_frequency(k, depth) == pytest.approx(omega, rel=1e-12)


def test_long_waves_in_shallow_water_all_travel_alike() -> None:
    k = np.array([1e-5, 2e-5])
    assert wave_frequency(k, 10.0) / k == pytest.approx(math.sqrt(10.0 * GRAVITY), rel=1e-6)
