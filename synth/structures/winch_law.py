"""The law of a winch's structure: where good gains lie, before any search.

Candidates are drawn as an engineer would choose them: a drum loop of some bandwidth, payload gains
that suit it, and a feed-forward that is the best there is for the rest, by least squares.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import qmc

from models.basics import ComplexArray, FloatArray
from models.plant import LinearPlant, PlantResponse

from .diagram import DiagramLaw
from .structure import PAYLOAD_MEASUREMENTS

if TYPE_CHECKING:
    from ..question import Problem
    from .winch_diagram import WinchStructure


#: What the payload asks of the drum: speed per acceleration [s], velocity [-], position [1/s].
ASKED = ("payload.acceleration_gain", "payload.velocity_gain", "payload.position_gain")
_TOP = 3.0  # candidates' loop gains reach this at their crossover


class WinchLaw(DiagramLaw):
    """The law of a winch's structure: where good gains lie."""

    def __init__(self, plant: LinearPlant, structure: WinchStructure) -> None:
        super().__init__(plant, structure.groups(), structure.gains(plant), structure.bounds)
        self._structure = structure
        self._names = [p.name for p in self.parameters]

    def draw(self, points: FloatArray, omega: FloatArray, yu: ComplexArray) -> FloatArray:
        """Return candidates: a drum loop of some bandwidth, and payload gains that suit it."""
        count = len(self.parameters)
        values = self.with_sections(np.zeros((len(points), count)), points[:, :count])
        uniform = dict(zip(self._names, points.T, strict=False))
        structure = self._structure

        def put(name: str, column: FloatArray) -> None:
            values[:, self.index(name)] = column

        if structure.drum:
            bandwidth = structure.widest * 10.0 ** (-1.5 * points[:, -1])
            if not structure.regulated:
                put("drum.speed_gain", np.array([structure.speed_gain(b) for b in bandwidth]))
            share = 0.5 * 10.0 ** (-2.0 * uniform["drum.position_gain"])
            put("drum.position_gain", bandwidth * share)
        if structure.heave:
            put("heave.gain", 0.8 + 0.4 * uniform["heave.gain"])
            put("heave.lead", 0.5 * uniform["heave.lead"])
        if structure.tension is not None:
            most = 0.5 * structure.widest / structure.tension
            put("tension.gain", most * 10.0 ** (-3.0 * uniform["tension.gain"]))
            put("drum.position_gain", 0.1 * 10.0 ** (-2.0 * uniform["drum.position_gain"]))
        if structure.hears_payload and structure.drum:
            for k, name in enumerate(ASKED):
                signed = 2.0 * uniform[name] - 1.0
                size = np.sign(signed) * 10.0 ** (2.0 * (np.abs(signed) - 1.0))
                # Most with the sign that damps: the haul follows the payload's speed.
                size = np.where((k == 0) & (uniform[name] < 0.4), -size, size)
                put(name, size * structure.pace ** (k - 1))
            if yu.size:
                # With good sensors far larger gains do: as large as some crossover allows.
                self._ask(values[::2], points[::2], omega, yu)
        elif structure.hears_payload:
            self._spread(values, points, omega, yu)
        return self.clipped(values)

    def _spread(
        self, values: FloatArray, points: FloatArray, omega: FloatArray, yu: ComplexArray
    ) -> None:
        """Set the gains for loop gains of any sign and size at a crossover behind the filters."""
        signed = 2.0 * points[:, :3] - 1.0
        loop_gain = np.sign(signed) * _TOP * 10.0 ** (3.0 * (np.abs(signed) - 1.0))
        at = np.minimum((points[:, -1] * omega.size).astype(int), omega.size - 1)
        for k, row in enumerate(values):
            row[:3] = 1.0
            own = self.response(list(row), 1j * omega[at[k] : at[k] + 1])[0]
            for i, name in enumerate(PAYLOAD_MEASUREMENTS):
                j = self._columns[name]
                size = float(np.abs(own[j] * yu[at[k], j, 0]).max())
                row[i] = loop_gain[k, i] / max(size, 1e-12)

    def _ask(
        self, values: FloatArray, points: FloatArray, omega: FloatArray, yu: ComplexArray
    ) -> None:
        """Set what the payload asks for by loop gains at a crossover, around the drum loop."""
        at = np.minimum((points[:, -2] * omega.size).astype(int), omega.size - 1)
        columns = [self.index(name) for name in ASKED]
        heard = [self._columns[name] for name in PAYLOAD_MEASUREMENTS]
        for k, row in enumerate(values):
            row[columns] = 1.0
            own = self.response(list(row), 1j * omega[at[k] : at[k] + 1])[0]
            through = np.array([np.ravel(c)[0] for c in own]) * yu[at[k], :, 0]
            inner = 1.0 - (through.sum() - through[heard].sum())
            for i, (column, j) in enumerate(zip(columns, heard, strict=True)):
                signed = 2.0 * points[k, column] - 1.0
                if i == 0 and points[k, column] < 0.4:
                    signed = -signed
                size = _TOP * 10.0 ** (2.0 * (abs(signed) - 1.0)) * abs(inner)
                row[column] = np.sign(signed) * size / max(abs(through[j]), 1e-12)

    def guesses(self, problem: Problem, omega: FloatArray) -> FloatArray:
        """Return drum loops whose feed-forward is the best for the question, by least squares.

        With everything else given, the payload's motion is linear in the feed-forward's gain and
        in gain times lead; the search then begins where these two are right.
        """
        if not self._structure.drum:
            return np.zeros((0, len(self.parameters)))
        points = qmc.Sobol(self.dimensions, seed=1).random_base2(8)
        drawn = self.draw(points, omega, problem.plant.response_at((1e-3 + 1j) * omega).yu)
        if self._structure.hears_payload:
            # A quarter of them hardly hears the payload.
            columns = [self.index(name) for name in ASKED]
            drawn[::4, columns] *= 0.02
        if not self._structure.heave:
            return drawn
        nodes = np.geomspace(0.05, 20.0, 240)
        response = problem.plant.response(nodes)
        weights = np.gradient(nodes)
        for row in drawn:
            self._feed(row, problem, response, weights)
        return self.clipped(drawn)

    def fed(self, values: Sequence[float], problem: Problem) -> list[list[float]]:
        """Return parameters with the feed-forward that suits the rest best, if there is one."""
        if not self._structure.heave:
            return []
        nodes = np.geomspace(0.05, 20.0, 240)
        row = np.array(values, dtype=np.float64)
        self._feed(row, problem, problem.plant.response(nodes), np.gradient(nodes))
        return [[float(v) for v in self.clipped(row[None])[0]]]

    def _feed(
        self, row: FloatArray, problem: Problem, response: PlantResponse, weights: FloatArray
    ) -> None:
        """Set gain and lead of the feed-forward to the best for the rest of a candidate."""
        gain, lead = self.index("heave.gain"), self.index("heave.lead")

        def heard(g: float, tau: float) -> Any:
            values = row.copy()
            values[gain], values[lead] = g, tau
            return self.response(list(values), 1j * response.omega)[0]

        none, one, ahead = heard(0.0, 0.0), heard(1.0, 0.0), heard(1.0, 1.0)
        loop = 1.0 - sum(c * response.yu[:, j, 0] for j, c in enumerate(none))
        rows, right = [], []
        for output, weight in problem.minimise.items():
            z = response.outputs.index(output)
            through = response.zu[:, z, 0] / loop
            for disturbance in problem.disturbances:
                w = response.disturbances.index(disturbance.name)
                density = disturbance.density(response.omega)
                if disturbance.band is not None:
                    low, high = disturbance.band
                    density = density * ((response.omega >= low) & (response.omega <= high))
                size = np.sqrt(weight * density * weights)

                def caused(law: Any, w: int = w, through: Any = through) -> Any:
                    return through * sum(c * response.yw[:, j, w] for j, c in enumerate(law))

                base = response.zw[:, z, w] + caused(none)
                first = caused(one) - caused(none)
                second = caused(ahead) - caused(one)
                rows.append(np.column_stack([first, second]) * size[:, None])
                right.append(-base * size)
        matrix, b = np.vstack(rows), np.concatenate(right)
        both = np.vstack([matrix.real, matrix.imag])
        found = np.linalg.lstsq(both, np.concatenate([b.real, b.imag]), rcond=1e-10)[0]
        if found[0] > 0.05:
            row[gain], row[lead] = found[0], max(0.0, found[1] / found[0])
