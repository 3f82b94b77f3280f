"""Any structure's design on rows of a spread, one case at a time.

Slower than the columns of `synth.sweeps.gain_rows` by three orders of magnitude, but with no
assumption about structure, sensors or disturbances: the question of every case is posed anew and
assessed as `synth.design.structure_design` does, with the design's own parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from models.basics import (
    BoolArray,
    ComplexArray,
    FloatArray,
    InputError,
    SolverError,
    peak_factor,
)
from models.spread import Spread

from ..design import StructureDesign
from ..loop import Assessment
from ..question import pose_structure
from .metrics import FrequencyMetric


class StructureRows:
    """A structure's design, asked about rows of a spread.

    Parameters
    ----------
    design, spread, metrics
        The design, the spread on its case, and what is wanted.
    """

    block = 16  # rows between two words of progress
    refined = 0
    unresolved = 0
    columns = False

    def __init__(
        self, design: StructureDesign, spread: Spread, metrics: Sequence[FrequencyMetric]
    ) -> None:
        if not design.parameters:
            raise InputError(f"sweep: the design has no controller: {design.status}")
        self.design, self.spread, self.metrics = design, spread, tuple(metrics)

    def evaluate(self, rows: FloatArray) -> dict[str, FloatArray | BoolArray]:
        """Return ``stable`` and the metrics of rows, (n,) each.

        Raises
        ------
        InputError
            If a row is no valid case.
        """
        found: dict[str, Any] = {m.name: np.full(len(rows), np.nan) for m in self.metrics}
        found["stable"] = np.zeros(len(rows), dtype=bool)
        for k, row in enumerate(rows):
            assessment = self._assessment(row)
            try:
                stable = assessment.stable
            except SolverError:  # no drag makes it stable
                stable = False
            found["stable"][k] = stable
            if stable:
                for metric in self.metrics:
                    found[metric.name][k] = self._measure(metric, assessment, row)
        return found

    def loop_gain(self, rows: FloatArray, omega: FloatArray) -> ComplexArray:
        """Return L(i omega) of rows, (n, k), at frequencies above zero [rad/s]."""
        return np.stack([self._assessment(row).loop_gain(omega) for row in rows])

    def _assessment(self, row: FloatArray) -> Assessment:
        case = self.spread.case_at(row)
        posed = pose_structure(case, self.design.structure, self.design.masses)
        own = {**self.design.parameters, **self.spread.gains(row)}
        values = [own[p.name] for p in posed.law.parameters]
        return posed.problem(()).assess(values, self.spread.drag(row))

    def _measure(self, metric: FrequencyMetric, assessment: Assessment, row: FloatArray) -> float:
        static = assessment.plant.static
        if metric.name == "max_sensitivity":
            return assessment.max_sensitivity
        if metric.name == "drag":
            fixed = self.spread.case_at(row).payload.fixed_drag
            return assessment.coefficient if fixed is None else fixed
        if metric.kind == "static":
            return static["motor.torque" if metric.name == "static_torque" else "rope.tension"]
        output = metric.output
        if output == "drive.command" and output not in assessment.plant.outputs:
            output = "motor.voltage"
        if output not in assessment.plant.outputs:
            raise InputError(f"sweep: {metric.name} is not known of this plant")
        if metric.kind == "rms":
            return assessment.sigma(output)
        if metric.kind == "period":
            return assessment.mean_period(output)
        time = self.spread.case_at(row).limits.exposure_time
        swing = peak_factor(assessment.mean_period(output), time) * assessment.sigma(output)
        rest = static.get(output, 0.0)
        return abs(rest) + swing if metric.kind == "peak" else rest - swing
