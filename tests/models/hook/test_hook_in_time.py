"""Six motions in time against the hook's spectrum, and long records against both.

The motions are drawn here by summing waves of many headings on the barge's closed formulas, each
met at its own frequency of encounter, and taken to the crane's tip in time (`tip_heave`): no
table, no operator of the hook, no mapped spectrum on the way.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from barge import barge_case, motions
from standard_error import spectral_standard_error

from models.basics import wave_number
from models.hook import HookMotion
from models.hook.encounter import speed_along
from models.operation import RecordMotion, tip_heave
from models.sea import Spreading

SPREAD = {"kind": "cos-2s", "exponent": 6.0}
CASES = {
    "long-crested, at rest": {},
    "short-crested, at rest": {"sea__spreading": SPREAD},
    "short-crested, head sea at 5.5 knots": {
        "sea__spreading": SPREAD,
        "vessel_heading": math.pi,
        "vessel_speed": "5.5 knots",
    },
    "short-crested, overtaken": {
        "sea__spreading": SPREAD,
        "vessel_heading": math.radians(20.0),
        "vessel_speed": "5.5 knots",
    },
    "long-crested, from astern in a current": {
        "vessel_heading": 0.0,
        "vessel_current": {"speed": 1.5, "heading": math.pi},
    },
}
DURATION, STEP = 2400.0, 0.3
PER_HEADING = 160


def tip_record(case, seed):
    """Displacement and velocity of the crane's tip, summed from waves."""
    rng = np.random.default_rng(seed)
    sea = HookMotion.from_case(case).sea
    mean = case.vessel.heading
    headings, weights = np.array([mean]), np.array([1.0])
    if case.sea.spreading is not None:
        headings, weights = Spreading(**SPREAD).nodes(mean)
    fine = np.geomspace(sea.band[0], 12.0, 20_000)
    energy = np.concatenate([[0.0], np.cumsum(sea.density(fine)[1:] * np.diff(fine))])
    many = PER_HEADING * (1 if headings.size > 1 else 20)
    time = STEP * np.arange(round(DURATION / STEP) + 1.0)
    size = 4 * (time.size - 1)  # the lines of a transform are fine enough to move a wave to
    spacing = 2.0 * math.pi / (size * STEP)
    lines = np.zeros((3, size // 2 + 1), dtype=complex)
    for heading, weight in zip(headings, weights, strict=True):
        # Waves of equal energy, each somewhere in its share of the spectrum.
        parts = (np.arange(many) + rng.random(many)) / many
        omega = np.interp(parts * energy[-1], energy, fine)
        sigma = math.sqrt(weight * energy[-1] / many)
        wave = sigma * (rng.standard_normal(many) - 1j * rng.standard_normal(many))
        met = omega - wave_number(omega) * float(speed_along(case, heading))
        about = wave[:, None] * motions(omega, np.full(many, heading))[:, 2:5]
        # Re[h e^{i w t}] of a wave that is overtaken, w < 0, is that of its conjugate at |w|.
        about = np.where(met[:, None] < 0.0, about.conj(), about)
        at = np.round(np.abs(met) / spacing).astype(int)
        slow = at < size // 2  # what is faster is of waves that no barge feels
        for mode in range(3):
            np.add.at(lines[mode], at[slow], about[slow, mode])
    heave, roll, pitch = np.fft.irfft(0.5 * size * lines, size)[:, : time.size]
    z = tip_heave(heave, roll, pitch, tip=case.vessel.hook_point)
    tip = RecordMotion.from_arrays(time, z, detrend="none")
    motion = tip.motion(DURATION, STEP, seed=0)
    displacement, velocity, _ = motion.block(0, motion.rows)
    return displacement, velocity


@pytest.mark.parametrize("name", CASES)
def test_six_motions_in_time_have_the_variance_of_the_hooks_spectrum(tmp_path, name):
    case = barge_case(tmp_path, headings=72, **CASES[name])
    hook = HookMotion.from_case(case)
    records = [tip_record(case, seed) for seed in (1, 2, 3)]
    for order, statistics in ((0, hook.displacement), (1, hook.velocity)):
        nodes = hook.quadrature
        density = nodes.omega ** (2 * order) * hook.density(nodes.omega)
        error = spectral_standard_error(nodes, density, DURATION)
        scores = [(np.var(record[order]) - statistics.m0) / error for record in records]
        assert max(map(abs, scores)) < 3.0, scores
        assert abs(sum(scores)) / math.sqrt(3.0) < 2.6, scores


@pytest.mark.parametrize("name", CASES)
def test_a_long_record_has_the_variance_of_its_spectrum(tmp_path, name):
    hook = HookMotion.from_case(barge_case(tmp_path, **CASES[name]))
    duration = 10800.0
    records = [hook.record(duration, step=0.2, seed=seed) for seed in (11, 12, 13, 14)]
    nodes = hook.quadrature
    for order, what in enumerate(("displacement", "velocity", "acceleration")):
        density = nodes.omega ** (2 * order) * hook.density(nodes.omega)
        error = spectral_standard_error(nodes, density, duration)
        found = [np.var(getattr(record, what)) for record in records]
        scores = [(value - getattr(hook, what).m0) / error for value in found]
        assert max(map(abs, scores)) < 3.0, (what, scores)
        assert abs(sum(scores)) / 2.0 < 2.6, (what, scores)
