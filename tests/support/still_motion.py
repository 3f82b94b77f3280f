"""`StillMotion`: a hook that does not move, for what a run does by itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.operation.excitation import Motion, MotionBlock


@dataclass(frozen=True, kw_only=True)
class StillMotion:
    """No motion at all."""

    description: str = "still"

    def motion(self, duration: float, step: float, seed: int) -> Motion:
        """Return zeros; the seed plays no part."""
        del seed

        def evaluate(start: int, count: int) -> MotionBlock:
            del start
            return np.zeros(count), np.zeros(count), np.zeros(count)

        return Motion(source=self.description, duration=duration, step=step, evaluate=evaluate)
