"""How seldom the largest values of a case are exceeded."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.basics import peak_factor
from models.rig import Limits


def test_by_default_it_is_the_most_probable_maximum():
    assert Limits().equivalent_exposure == Limits().exposure_time


@given(t_z=st.floats(2.0, 20.0), p=st.floats(0.001, 0.95))
def test_the_largest_of_many_rayleigh_maxima_is_exceeded_as_often_as_asked(t_z, p):
    limits = Limits(exposure_time=3600.0, exceedance=p)
    k = peak_factor(t_z, limits.equivalent_exposure)
    waves = limits.exposure_time / t_z
    assert k == pytest.approx(math.sqrt(2.0 * math.log(-waves / math.log(1.0 - p))))
    assert (1.0 - math.exp(-0.5 * k * k)) ** waves == pytest.approx(1.0 - p, abs=0.03)
