"""The payload before and after compensation: spectra and statistics, ready to be shown.

    Design -> hook, payload with the drum held, payload with the gains -> figures, summary

Everything is in the sea that the design's figures hold for: the case's own, or the largest
feasible one.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from models.basics import ComplexArray, FloatArray, most_probable_maximum
from models.hook import HookMotion
from models.plant import PlantData
from synth.design import Design
from synth.question import held_motion, locked_response

PAYLOAD = "payload.displacement"
DRUM = "drum.haul"
HOOK = "hook.heave"


@dataclass(frozen=True, eq=False)
class MotionView:
    """Hook and payload of a design, as spectra and as numbers."""

    design: Design

    @cached_property
    def hook(self) -> HookMotion:
        """Motion of the hook; its user has been warned of it already."""
        return HookMotion.from_case(self.design.sea_case, warn=False)

    @property
    def compensated(self) -> bool:
        """Whether there is a compensated payload to speak of: a loop that is stable."""
        return self.design.margins is not None

    def held_response(self, omega: FloatArray) -> ComplexArray:
        """Return P/Z with the drum held, (k,)."""
        return locked_response(self.design.case, omega, self.design.drag_before)

    def held_density(self, omega: FloatArray) -> FloatArray:
        """Return the payload's density with the drum held [m^2 s/rad], (k,)."""
        return np.asarray(np.abs(self.held_response(omega)) ** 2 * self.hook.density(omega))

    def payload_density(self, omega: FloatArray) -> FloatArray:
        """Return the payload's density with the gains [m^2 s/rad], (k,)."""
        return self.design.assessment.spectrum(PAYLOAD, omega)

    @cached_property
    def frequencies(self) -> FloatArray:
        """Frequencies [rad/s] over the sea's band, close enough to show every peak."""
        low, high = self.hook.band
        grid = [np.geomspace(low, high, 900), np.array(self.hook.splits)]
        if self.compensated:
            grid.append(self.design.assessment.grid)
        peak, damping = self._resonance
        grid.append(peak + damping * np.linspace(-8.0, 8.0, 81))
        every = np.unique(np.concatenate(grid))
        return every[(every >= low) & (every <= high)]

    @cached_property
    def held_period(self) -> float:
        """Mean zero-crossing period of the payload with the drum held [s]."""
        design = self.design
        held = held_motion(PlantData.from_case(design.case), self.hook, design.drag_before)
        return held.mean_period(PAYLOAD)

    def motions(self) -> list[tuple[str, float, float, float]]:
        """Return hook and payload, before and after: rms, 4 rms, largest [m].

        The largest is that of the exposure time and its exceedance; what resonates without
        damping has no end.
        """
        design, hook = self.design, self.hook.displacement
        time = design.case.limits.equivalent_exposure
        found = [("hook", hook.rms, hook.most_probable_maximum(time))]
        held = design.payload_rms_before
        largest = math.inf
        if math.isfinite(held):
            largest = most_probable_maximum(held, self.held_period, time)
        found.append(("payload, drum held", held, largest))
        if self.compensated:
            period = design.assessment.mean_period(PAYLOAD)
            largest = most_probable_maximum(design.payload_rms, period, time)
            found.append(("payload, compensated", design.payload_rms, largest))
        return [(name, rms, 4.0 * rms, top) for name, rms, top in found]

    @cached_property
    def _resonance(self) -> tuple[float, float]:
        """Frequency and decay rate of the payload's resonance with the drum held [rad/s]."""
        low, high = self.hook.band
        peak = highest(lambda omega: np.abs(self.held_response(omega)), low, high)
        height = float(np.abs(self.held_response(np.array([peak])))[0])
        # A resonance of height h has a damping ratio of about 1/(2 h).
        return peak, peak / (2.0 * max(height, 1.0))


def highest(function: Callable[[FloatArray], FloatArray], low: float, high: float) -> float:
    """Return where a function of frequency [rad/s] is largest, by zooming into a grid."""
    for _ in range(9):
        grid = np.geomspace(low, high, 400)
        at = int(np.argmax(function(grid)))
        low, high = grid[max(at - 2, 0)], grid[min(at + 2, grid.size - 1)]
    return float(np.sqrt(low * high))
