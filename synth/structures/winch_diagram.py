r"""A winch's controller as a diagram: payload feedback, drum loop, feed-forward, tension.

::

    payload --> a, a1, a2 --> filters ------------------------------+
                                                                    v
    MRU -----> gain, lead --+--> drum: position, speed --> [PI] --(+)--> command
    encoder ---------------(-)

A drive that takes a torque or a voltage holds the drum by a loop of its own,

    u = -k [w + (n/r) g X + ((n/r) g G Z + (1 + d) (n/r) G Z')],    G = f (1 + tau s)/(1 + s/w_b),

with X the haul and Z the hook's heave as the reference unit shows it: the drum is asked to be at
-f Z(t + tau) and to move at its derivative.  d is what a steady speed costs in command (back-EMF
and friction over k), known and fed forward.  A drive with a speed regulator of its own takes the
speed itself, u = -(n/r) [g (X + G Z) + G Z'].

Payload feedback alone is the 1975 thesis's eq. 30, u = -A (a P'' + a1 P' + a2 P), behind a
roll-off, a lead, a notch or integral action.  On top of a drum loop the payload asks for a speed
of the drum, -(ca P'' + cv P' + cp P) behind a roll-off: ca [s] makes the haul follow the payload's
speed and so damps the rope's resonance, cv [-] makes the rope stiffer, cp [1/s] takes drift out.

`synth.structures.winch_structures` gives each of them for a case by its name.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.stats import qmc

from models.basics import ComplexArray, FloatArray, InputError, check_range, pick
from models.plant import MEASUREMENTS, LinearPlant
from models.sensing import MEASURED

from .blocks import FilterSection, lead_time
from .diagram import Branch, DiagramLaw, Weight
from .drum_speed import SteadyMotion
from .structure import (
    Bounds,
    GeneralisedPlant,
    Parameter,
    ParametrisedController,
    Structure,
    gain_scales,
    gain_unit,
)

SAMPLE_TIME = 0.01  # that the drum loop must leave room for [s]
TRANSPARENT = 500.0  # a roll-off with this corner is hardly there [rad/s]
_LEAST_BANDWIDTH = 0.3  # of the drum loop [rad/s]
_TENSION = "rope.tension"
_HAUL, _SPEED, _HEAVE, _HEAVE_RATE = "drum.haul", "motor.speed", "mru.heave", "mru.heave_rate"
_GAINS = ("a", "a1", "a2")
#: What the payload asks of the drum: speed per acceleration [s], velocity [-], position [1/s].
ASKED = ("payload.acceleration_gain", "payload.velocity_gain", "payload.position_gain")
_NODES = np.geomspace(0.05, 20.0, 240)  # at which a feed-forward is fitted [rad/s]
_LEAST_FED, _SINGULAR = 0.05, 1e-12  # gain that counts as one; relative size of no effect
_TOP = 3.0  # candidates' loop gains reach this at their crossover


@dataclass(frozen=True, kw_only=True)
class WinchStructure(Structure):
    """A structure put together from payload feedback, drum loop, feed-forward and tension."""

    name: str  #: What it is called.
    motor: SteadyMotion  #: The motor as the drum loop sees it.
    amplifier: float = 1.0  #: The fixed gain A of payload feedback.
    #: Frequency of the rope's first axial mode [rad/s], which sizes what the payload asks for.
    pace: float = 1.0
    filters: tuple[FilterSection, ...] = ()  #: Sections behind the payload's gains.
    #: Whether there is payload feedback, a drum loop, feed-forward of the heave.
    hears_payload: bool = True
    drum: bool = False
    heave: bool = False
    #: Stiffness of the rope [N/m] if the drum loop follows its tension, else None.
    tension: float | None = None
    #: Bounds by parameter name, in the parameter's unit.
    bounds: Bounds = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_range("structure", "amplifier", self.amplifier, low=0.0, open_low=True)
        if not (self.hears_payload or self.drum):
            raise InputError("structure: it must hear the payload or have a drum loop")

    @property
    def measurements(self) -> tuple[str, ...]:
        """Names of what it hears, in the order of the sensed plant."""
        heard = {y for branch in self.branches() for y in branch.weights}
        return tuple(name for name in MEASURED if name in heard)

    def bind(self, plant: LinearPlant) -> ParametrisedController:
        """Return the law; see `Structure.bind`."""
        pick(self.name, "measurement", plant.measurements, self.measurements)
        if len(plant.inputs) != 1:
            raise InputError(f"{self.name}: the plant must have one input, got {plant.inputs}")
        return WinchLaw(plant, self)

    @property
    def widest(self) -> float:
        """Bandwidth of the drum loop that sampling and the drive leave room for [rad/s]."""
        return self.motor.widest(SAMPLE_TIME)

    def speed_gain(self, bandwidth: float) -> float:
        """Return k for a bandwidth of the drum loop, without rope and load."""
        wanted = self.motor.inertia * bandwidth - self.motor.damping
        floor = 0.02 * self.motor.inertia * _LEAST_BANDWIDTH
        return max(wanted, floor) / self.motor.torque_gain

    def gains(self, plant: LinearPlant) -> list[Parameter]:
        """Return the parameters that are not those of sections."""
        found: list[Parameter] = []

        def add(
            name: str, unit: str, scale: float, low: float = -np.inf, high: float = np.inf
        ) -> None:
            found.append(Parameter(name=name, scale=scale, low=low, high=high, unit=unit))

        if self.hears_payload and self.drum:
            for k, (name, unit) in enumerate(zip(ASKED, ("s", "-", "1/s"), strict=True)):
                add(name, unit, 0.3 * self.pace ** (k - 1))
        elif self.hears_payload:
            columns = [plant.measurements.index(name) for name in MEASUREMENTS]
            scales = gain_scales(plant, [(0, j) for j in columns]) / self.amplifier
            for name, y, scale in zip(_GAINS, MEASUREMENTS, scales, strict=True):
                add(name, gain_unit(plant, plant.inputs[0], y), float(scale))
        if self.drum and not self.motor.regulated:
            low, high = self.speed_gain(0.0), self.speed_gain(self.widest)
            command = plant.units.get(plant.inputs[0], "-")
            add("drum.speed_gain", f"{command} s/rad", 0.3 * high, low, high)
        if self.drum:
            scale = 0.02 if self.tension is not None else 1.0
            add("drum.position_gain", "1/s", scale, 1e-3, 0.5 * self.widest)
        if self.heave:
            add("heave.gain", "-", 0.1, 0.0, 2.0)
        if self.tension is not None:
            most = self.widest / self.tension
            add("tension.gain", "m/s/N", 0.1 * most, 0.0, most)
        return found

    def branches(self) -> list[Branch]:
        """Return the diagram."""
        names = zip(MEASUREMENTS, ASKED if self.drum else _GAINS, strict=True)
        if not self.drum:
            weights = {y: _product(-self.amplifier, name) for y, name in names}
            return [Branch(weights=weights, sections=self.filters)]
        ratio, loop = self.motor.per_rope_speed, "drum.speed_gain"
        # A regulated drive is told the speed of the motor itself.
        gains = () if self.motor.regulated else (loop,)

        def asked(name: str) -> Weight:
            """Return the weight of a signal that asks for so much speed of the rope."""
            plain = _product(-ratio, name)
            return plain if not gains else lambda p: plain(p) * (p[loop] + self.motor.feed)

        drum = {_HAUL: _product(-ratio, *gains, "drum.position_gain")}
        if gains:
            drum[_SPEED] = _product(-1.0, loop)
        if self.tension is not None:
            drum[_TENSION] = asked("tension.gain")
        found = [Branch(weights=drum)]
        if self.hears_payload:
            payload = {y: asked(name) for y, name in names}
            found.append(Branch(weights=payload, sections=self.filters))
        if self.heave:
            place = _product(-ratio, *gains, "drum.position_gain", "heave.gain")
            heave = {_HEAVE: place, _HEAVE_RATE: asked("heave.gain")}
            lead = lead_time("heave", bandwidth=(1.0, 100.0))
            found.append(Branch(weights=heave, sections=(lead,)))
        return found


class WinchLaw(DiagramLaw):
    """The law of a winch's structure: where good gains lie."""

    def __init__(self, plant: LinearPlant, structure: WinchStructure) -> None:
        super().__init__(plant, structure.branches(), structure.gains(plant), structure.bounds)
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
            if not structure.motor.regulated:
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
                self._spread(values[::2], points[::2], omega, yu)
        elif structure.hears_payload:
            self._spread(values, points, omega, yu)
        return self.clipped(values)

    def _spread(
        self, values: FloatArray, points: FloatArray, omega: FloatArray, yu: ComplexArray
    ) -> None:
        """Set the payload's gains for loop gains at a crossover, behind filters and drum loop."""
        drum = self._structure.drum
        decades, chosen = (2.0, points[:, -2]) if drum else (3.0, points[:, -1])
        at = np.minimum((chosen * omega.size).astype(int), omega.size - 1)
        columns = [self.index(name) for name in (ASKED if drum else _GAINS)]
        heard = [self._columns[name] for name in MEASUREMENTS]
        for k, row in enumerate(values):
            row[columns] = 1.0
            own = self.response(list(row), 1j * omega[at[k] : at[k] + 1])[0]
            through = np.array([np.ravel(c)[0] for c in own]) * yu[at[k], :, 0]
            inner = 1.0 - (through.sum() - through[heard].sum())
            for column, j in zip(columns, heard, strict=True):
                signed = 2.0 * points[k, column] - 1.0
                if drum and column == columns[0] and points[k, column] < 0.4:
                    signed = -signed  # most with the sign that damps
                size = _TOP * 10.0 ** (decades * (abs(signed) - 1.0)) * abs(inner)
                row[column] = np.sign(signed) * size / max(abs(through[j]), 1e-12)

    def guesses(self, problem: GeneralisedPlant, omega: FloatArray) -> FloatArray:
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
        return self.clipped(self._fed(drawn, problem))

    def fed(self, values: Sequence[float], problem: GeneralisedPlant) -> list[list[float]]:
        """Return parameters with the feed-forward that suits the rest best, if there is one."""
        if not self._structure.heave:
            return []
        rows = np.array([values], dtype=np.float64)
        return [[float(v) for v in self.clipped(self._fed(rows, problem))[0]]]

    def _fed(self, rows: FloatArray, problem: GeneralisedPlant) -> FloatArray:
        """Return candidates, (b, n), with gain and lead of the feed-forward best for the rest."""
        gain, lead = self.index("heave.gain"), self.index("heave.lead")
        response = problem.plant.response(_NODES)
        columns = list(rows.T[:, :, None])

        def commanded(g: float, tau: float) -> list[Any]:
            values = [*columns]
            values[gain], values[lead] = np.array([[g]]), np.array([[tau]])
            return self.response(values, 1j * response.omega)[0]

        none, one, ahead = commanded(0.0, 0.0), commanded(1.0, 0.0), commanded(1.0, 1.0)
        loop = 1.0 - sum(c * response.yu[:, j, 0] for j, c in enumerate(none))
        # Normal equations of each candidate: of what gain, and gain times lead, make of the motion.
        matrix, right = np.zeros((len(rows), 2, 2)), np.zeros((len(rows), 2, 1))
        shaken = _shaken(problem, response.omega)
        for output, weight in problem.minimise.items():
            z = response.outputs.index(output)
            through = response.zu[:, z, 0] / loop
            for name, variances in shaken.items():
                w, size = response.disturbances.index(name), np.sqrt(weight * variances)
                before, after, later = (
                    through * sum(c * response.yw[:, j, w] for j, c in enumerate(law)) * size
                    for law in (none, one, ahead)
                )
                base = response.zw[:, z, w] * size + before
                parts = np.stack([after - before, later - after], axis=1).conj()
                matrix += (parts @ parts.conj().swapaxes(1, 2)).real
                right -= (parts @ base[:, :, None]).real
        best = (np.linalg.pinv(matrix, rcond=_SINGULAR, hermitian=True) @ right)[:, :, 0]
        found, helps = rows.copy(), best[:, 0] > _LEAST_FED
        found[helps, gain] = best[helps, 0]
        found[helps, lead] = np.maximum(0.0, best[helps, 1] / best[helps, 0])
        return found


def _shaken(problem: GeneralisedPlant, omega: FloatArray) -> dict[str, FloatArray]:
    """Return the variance of each disturbance about some frequencies [rad/s], by name."""
    found = {}
    for disturbance in problem.disturbances:
        low, high = disturbance.band or (-np.inf, np.inf)
        density = disturbance.density(omega) * ((omega >= low) & (omega <= high))
        found[disturbance.name] = np.asarray(density * np.gradient(omega))
    return found


def _product(factor: float, *names: str) -> Weight:
    """Return the weight that is a number times parameters."""

    def weight(p: Mapping[str, Any]) -> Any:
        result: Any = factor
        for name in names:
            result = p[name] * result
        return result

    return weight
