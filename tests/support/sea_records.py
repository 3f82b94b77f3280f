"""Seas, reference units and records that the tests of the predictors share."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import numpy.typing as npt
from former_cases import load_case

import models
from models.case import Case
from models.hook import HookMotion
from models.operation import SpectrumMotion
from models.rig import MRU
from models.sensing import MruModel
from mpc.forecast import Predictor

FloatArray = npt.NDArray[np.float64]

TS = 0.05
LEADS = np.array([0.0, 0.5, 1.0, 2.0, 4.0, 6.0, 8.0])
AT = np.round(LEADS / TS).astype(int)


@dataclass(frozen=True)
class Sea:
    """A case, its hook and its unit."""

    case: Case
    hook: HookMotion
    unit: MruModel

    @property
    def rms(self) -> FloatArray:
        return np.array([self.hook.displacement.rms, self.hook.velocity.rms])

    def record(self, seed: int, duration: float) -> tuple[FloatArray, FloatArray]:
        """True displacement and velocity (2, n), and what the unit shows of them (2, n)."""
        motion = SpectrumMotion(hook=self.hook).motion(duration, TS, seed)
        z, v, _ = motion.block(0, motion.rows)
        unit = replace(self.unit, seed=seed)
        block, _ = unit.block(unit.initial(z[0], v[0]), z, v)
        return np.array([z, v]), np.array([block.heave, block.heave_rate])


def white(share: float) -> MRU:
    """White noise sampled at 4 Hz, as far as the unit's error model can be that."""
    return MRU(noise_floor=0.0, noise_fraction=share, noise_bandwidth=11.31)


@cache
def sea(name: str) -> Sea:
    """The thesis's sea with 1 % or 5 % of noise, or with no unit, and the subsea crane's."""
    with warnings.catch_warnings():
        # That the spectrum reaches beyond the table of the vessel is not the matter here.
        warnings.simplefilter("ignore", models.PhysicsWarning)
        case = load_case("subsea-crane" if name == "crane" else "thesis-1975")
        hook = HookMotion.from_case(case)
    if name in ("1 %", "5 %"):
        sensors = case.sensors.model_copy(update={"mru": white(0.01 if name == "1 %" else 0.05)})
        case = case.model_copy(update={"sensors": sensors})
    rms = hook.displacement.rms
    unit = MruModel(case.sensors.mru, TS, rms, 0, heave_frequency=hook.velocity.rms / rms)
    return Sea(case, hook, unit)


def errors_of(
    predictor: Predictor,
    records: Sequence[tuple[FloatArray, FloatArray]],
    start: float,
    every: int = 5,
    at: npt.NDArray[np.int64] = AT,
    watch: Callable[[int], None] | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Rms error of displacement and velocity at leads, and rms of the stated deviations."""
    square = np.zeros((2, at.size))
    stated = np.zeros((2, at.size))
    count = 0
    for true, shown in records:
        predictor.reset()
        for k, (heave, rate) in enumerate(shown.T.tolist()):
            if k + at[-1] >= true.shape[1]:
                break
            predictor.update(heave, rate, True, k * TS)
            if watch is not None:
                watch(k)
            if k * TS >= start and k % every == 0:
                f = predictor.forecast()
                made = np.array([f.displacement[at], f.velocity[at]])
                square += (made - true[:, k + at]) ** 2
                stated += np.array([f.displacement_std[at], f.velocity_std[at]]) ** 2
                count += 1
    return np.sqrt(square / count), np.sqrt(stated / count)
