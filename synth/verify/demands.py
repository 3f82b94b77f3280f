"""Demands on a design, listed and measured a second time for the verification.

A winch's limits are read from its case again, so that one which got lost on the way into the
optimiser is missed; those of a `synth.design.tuning` problem are read off its limit objects.  Each
becomes a `Demand`, and `Demand.measured` says what a recomputed loop makes of it.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from models.basics import ComplexArray, FloatArray, SolverError, peak_factor, zero_crossing_period
from models.case import Case
from models.plant import LinearPlant, PlantData

from .claims import StatedLimit
from .nyquist import CurveMargins, largest
from .recompute import HOOK, Loop, imaginary

Moments = Mapping[str, tuple[float, ...]]

PAYLOAD = "payload.displacement"
VELOCITY = "payload.velocity"

_TORQUE, _SPEED, _TENSION = "motor.torque", "motor.speed", "rope.tension"
_AT_LOAD = "rope.lower_tension"
_TAUT = 0.1  # of the least weight, where no least tension is stated
_POWER = "motor.power.peak"
_MARGINS = ("max_sensitivity", "gain", "gain_down", "delay", "disk")
_POLES = ("decay", "damping", "frequency")
_AS_FAST = 0.8  # of the slowest pole of a delay model: it is as good as the delay up to there
_WITH_PERIOD = ("peak", "least", "power", "breakdown")
_MODELLED = 0.05  # a lumped mode within this share of the exact one counts as modelled
_KINDS = {  # by class of `synth.limits.margin_limits` and `synth.limits.signal_limits`
    "MaxSensitivity": "max_sensitivity",
    "GainMargin": "gain",
    "GainMarginDown": "gain_down",
    "DelayMargin": "delay",
    "DiskMargin": "disk",
    "LeastDecay": "decay",
    "LeastDamping": "damping",
    "HighestFrequency": "frequency",
    "WeightedResponse": "weighted",
    "LowFrequency": "low_frequency",
    "RollOff": "roll_off",
    "Rms": "rms",
    "Continuous": "continuous",
    "Peak": "peak",
    "Minimum": "least",
    "Power": "power",
    "Thermal": "thermal",
    "Breakdown": "breakdown",
}


@dataclass(frozen=True, kw_only=True)
class Demand:
    """One limit."""

    name: str  #: As in reports.
    #: A margin (``max_sensitivity``, ``gain``, ``gain_down``, ``delay``, ``disk``), a gain
    #: (``low_frequency``, ``roll_off``, ``weighted``), a figure of the poles (``decay``,
    #: ``damping``, ``frequency``) or a size (``rms``, ``continuous``, ``peak``, ``least``,
    #: ``power``, ``thermal``, ``breakdown``).
    kind: str
    bound: float  #: The bound.
    enforced: bool = True  #: Whether it binds the design.
    outputs: tuple[str, ...] = ()  #: The signals that it is about.
    disturbance: str = ""  #: The other end of a ``low_frequency`` or ``weighted`` gain.
    #: Value at rest of the (first) signal, and what losses that switch carry it to either side.
    static: float = 0.0
    loss: float = 0.0
    #: Up to which (``low_frequency``) or from which (``roll_off``) it holds [rad/s].
    frequency: float = math.nan
    duration: float = math.nan  #: Exposure time of a peak [s].
    #: Of a ``weighted`` gain, from frequencies [rad/s].
    weights: Callable[[FloatArray], FloatArray] = np.ones_like
    #: Of ``thermal`` and ``breakdown``, from which the motor's torque falls [rad/s].
    base_speed: float = math.nan

    @property
    def at_least(self) -> bool:
        """Whether the bound is a lower one."""
        return self.kind in ("gain", "delay", "least", "disk", "decay", "damping")

    @property
    def drive(self) -> bool:
        """Whether it is about motor, drive or rope, and not about the loop."""
        return self.kind in ("continuous", "thermal", "peak", "least", "power", "breakdown")

    @property
    def orders(self) -> dict[str, tuple[int, ...]]:
        """Orders of the spectral moments that it needs, by output."""
        if self.kind in (*_MARGINS, *_POLES, "low_frequency", "roll_off", "weighted"):
            return {}
        return dict.fromkeys(self.outputs, (0, 2) if self.kind in _WITH_PERIOD else (0,))

    @property
    def together(self) -> str:
        """Under which name among moments it wants the correlation of its outputs, if it does."""
        return "*".join(self.outputs) if self.kind == "thermal" else ""

    def kept(self, value: float, tolerance: float) -> bool:
        """Return whether a value keeps the limit, to a relative tolerance."""
        room = tolerance * abs(self.bound)
        return value >= self.bound - room if self.at_least else value <= self.bound + room

    def measured(
        self,
        loop: Loop,
        margins: CurveMargins,
        region: Callable[[], tuple[ComplexArray, ComplexArray]],
        moments: Moments,
    ) -> float:
        """Return what a loop, its margins, its poles and its m0 (and m2) make of the limit.

        The poles are those of `CheckedLoop.region`, which few limits ask for.
        """
        if self.kind in _MARGINS:
            return float(getattr(margins, self.kind))
        if self.kind in _POLES:
            return _pole_figure(self.kind, *region())
        if self.kind in ("low_frequency", "weighted"):

            def drift(omega: FloatArray) -> FloatArray:
                found, _ = loop.transfers(imaginary(omega), self.outputs, [self.disturbance])
                sizes = np.abs(found[:, 0, 0]) * self.weights(omega)
                return np.asarray(sizes, dtype=np.float64)

            if self.kind == "low_frequency":
                return largest(drift, 1e-4 * self.frequency, self.frequency, loop.marks)
            marks = np.abs(loop.marks)
            ends = min(1e-4, 0.01 * float(marks.min())), 100.0 * float(marks.max())
            return largest(drift, *ends, loop.marks)
        if self.kind == "roll_off":
            loops = [loop.broken(i) for i in range(len(loop.plant.inputs))]

            def gain(omega: FloatArray) -> FloatArray:
                s = imaginary(omega)
                sizes = [np.abs(difference(s) - 1.0) for difference in loops]
                return np.asarray(np.max(sizes, axis=0), dtype=np.float64)

            end = 100.0 * max(self.frequency, float(np.abs(loop.marks).max(initial=0.0)))
            return largest(gain, self.frequency, end, loop.marks)
        sizes = [math.sqrt(moments[name][0]) for name in self.outputs]
        if self.kind == "rms":
            return sizes[0]
        if self.kind == "continuous":
            return math.hypot(self.static, self.loss, sizes[0])
        if self.kind == "thermal":
            torque, speed = sizes
            rest, rho = math.hypot(self.static, self.loss), moments[self.together][0]
            return _heating(rest, torque, speed, rho, self.base_speed)
        peaks = [
            size * peak_factor(zero_crossing_period(*moments[name]), self.duration)
            if all(map(math.isfinite, moments[name]))
            else math.inf
            for size, name in zip(sizes, self.outputs, strict=True)
        ]
        if self.kind == "least":
            return self.static - self.loss - peaks[0]
        if self.kind == "breakdown":
            corner = abs(self.static) + self.loss + peaks[0]
            return corner * (peaks[1] / self.base_speed) ** 2
        # Power: the corner of the box that the peaks of torque and speed span.
        return (abs(self.static) + self.loss + peaks[0]) * (
            peaks[1] if self.kind == "power" else 1.0
        )


def limit_demand(limit: StatedLimit, enforced: bool = True) -> Demand:
    """Return a limit of `synth.design.tuning` as a demand.

    Raises SolverError if there is no independent way to measure that kind.
    """
    kind = _KINDS.get(type(limit).__name__)
    if kind is None:
        raise SolverError(
            f"verification: limit {limit.name} is a {type(limit).__name__}, which there is no "
            "independent measure for"
        )
    outputs: tuple[str, ...] = limit.outputs
    if kind in ("low_frequency", "weighted"):
        outputs = (getattr(limit, "output"),)  # noqa: B009
    frequency = getattr(limit, "below", getattr(limit, "above", math.nan))
    return Demand(
        name=limit.name,
        kind=kind,
        bound=limit.bound,
        enforced=enforced,
        outputs=outputs,
        disturbance=getattr(limit, "disturbance", ""),
        static=getattr(limit, "static", 0.0),
        loss=getattr(limit, "loss", 0.0),
        frequency=frequency,
        duration=getattr(limit, "duration", math.nan),
        weights=getattr(limit, "weights", np.ones_like),
        base_speed=getattr(limit, "base_speed", math.nan),
    )


def case_demands(case: Case, data: PlantData, plant: LinearPlant, masses: int) -> dict[str, Demand]:
    """Return every limit that a case states, by name.

    The plant is the design's, for the static values; the roll-off begins beyond the modes that its
    rope masses hold.
    """
    wanted, drive, winch = case.limits, case.winch.drive, case.winch
    found = [Demand(name="max_sensitivity", kind="max_sensitivity", bound=wanted.max_sensitivity)]
    for name, kind, bound in (
        ("gain_margin_up", "gain", wanted.gain_margin_up),
        ("gain_margin_down", "gain_down", wanted.gain_margin_down),
        ("delay_margin", "delay", wanted.delay_margin or None),
    ):
        if bound is not None:
            found.append(Demand(name=name, kind=kind, bound=bound))
    if wanted.low_frequency is not None:
        found.append(
            Demand(
                name="low_frequency",
                kind="low_frequency",
                bound=wanted.low_frequency.ratio,
                outputs=(PAYLOAD,),
                disturbance=HOOK,
                frequency=wanted.low_frequency.below,
            )
        )
    above = _first_unmodelled(data, masses)
    if wanted.roll_off is not None and math.isfinite(above):
        found.append(
            Demand(name="roll_off", kind="roll_off", bound=wanted.roll_off, frequency=above)
        )
    dc = winch.motor.type == "dc"
    thermal = f"{_TORQUE}.continuous" if math.isfinite(winch.cooled_speed) else ""
    breakdown = f"{_TORQUE}.breakdown"
    special = {_POWER: "power", thermal: "thermal", breakdown: "breakdown"}
    least, both = wanted.minimum_tension, wanted.tension_ends == "both"
    lightest = (1.0 - case.payload.weight_uncertainty) * case.payload.submerged_weight
    if both and least is None:
        least = _TAUT * lightest
    bounds = {
        f"{_TORQUE}.peak": drive.torque_peak,
        f"{_TORQUE}.continuous": drive.torque_continuous,
        f"{_SPEED}.peak": winch.speed_limit,
        "motor.voltage.peak": drive.voltage if dc else None,
        "motor.current.peak": drive.current_peak if dc else None,
        "motor.current.continuous": drive.current_continuous if dc else None,
        _POWER: winch.power_limit,
        breakdown: winch.breakdown_limit / winch.cooled_speed**2,
        f"{_TENSION}.peak": wanted.rope_tension_peak,
        f"{_TENSION}.least": None if least is None else least / case.rope.falls,
        f"{_AT_LOAD}.least": least if both else None,
    }
    # k = sqrt(2 ln(N / -ln(1 - p))) is the most probable maximum of T / -ln(1 - p).
    exposure = -wanted.exposure_time / math.log(1.0 - wanted.exceedance)
    losses = switching_losses(case)
    for name, bound in bounds.items():
        if bound is None or not math.isfinite(bound):
            continue
        signal, _, kind = name.rpartition(".")
        outputs = (_TORQUE, _SPEED) if name in special else (signal,)
        found.append(
            Demand(
                name=name,
                kind=special.get(name, kind),
                bound=bound,
                enforced=wanted.drive == "enforce",
                outputs=outputs,
                static=lightest if signal == _AT_LOAD else float(plant.static[outputs[0]]),
                loss=losses.get(outputs[0], 0.0),
                duration=exposure,
                base_speed=winch.cooled_speed,
            )
        )
    return {demand.name: demand for demand in found}


def _heating(static: float, torque: float, speed: float, rho: float, base: float) -> float:
    """Return the root mean square of a torque over what holds for hours at each speed [N m].

    By a sum over the Gaussian speed in steps of a thousandth of its standard deviation, at each of
    which the torque is Gaussian about rho times as many of its own.
    """
    u = np.linspace(-12.0, 12.0, 24001)
    chance = np.exp(-0.5 * u * u)
    chance /= chance.sum()
    heat = np.maximum(1.0, (u * speed / base) ** 2)
    square = static**2 + torque**2 * ((rho * u) ** 2 + 1.0 - rho**2)
    return math.sqrt(float((square * heat * chance).sum()))


def switching_losses(case: Case) -> dict[str, float]:
    """Return how far losses that switch with the direction carry signals to either side, by name.

    Half of what hauling and paying out differ by, T_0 (1/eta - eta)/2, and dry friction.  Behind
    the sheaves the rope's tension does so too.
    """
    winch, motor = case.winch, case.winch.motor
    if winch.losses == "hauling":
        return {}
    over = case.rope.sheave_efficiency**case.rope.sheaves
    eta = winch.gearbox.efficiency * over
    torque = 0.5 * case.static_torque * (1.0 / eta - eta) + motor.coulomb_friction
    found = {_TORQUE: torque, "motor.current": torque / winch.torque_constant}
    if motor.type == "dc":
        found["motor.voltage"] = found["motor.current"] * motor.resistance
    if over < 1.0:
        found[_TENSION] = 0.5 * case.static_tension * (1.0 / over - over)
    return found


def _pole_figure(kind: str, poles: ComplexArray, models: ComplexArray) -> float:
    """Return a figure of a loop's poles [1/s], those that delay models bring with them left out.

    Each model's pole stands for the nearest decaying one: of a damping ratio for those alone that
    are too fast for the models to be right.
    """
    left = sorted(poles, key=lambda s: s.real)
    if kind == "decay":
        return -float(left[-1].real)
    slowest = _AS_FAST * float(np.abs(models).min(initial=np.inf))
    for model in models:
        near = [s for s in left if s.real < 0.0 and (kind == "frequency" or abs(s) > slowest)]
        if near:
            left.remove(min(near, key=lambda s: abs(s - model)))
    if kind == "frequency":
        return float(max(abs(s) for s in left))
    return float(min((-s.real / abs(s) for s in left), default=1.0))


def _first_unmodelled(data: PlantData, masses: int) -> float:
    """Return the first axial mode that a lumped rope does not hold [rad/s]."""
    if data.one_spring:
        return math.inf
    lumped = data.lumped_axial_modes(masses)
    exact = data.axial_modes(lumped.size + 1)
    for mode, approximate in zip(exact, lumped, strict=False):
        if abs(approximate / mode - 1.0) > _MODELLED:
            return float(mode)
    return float(exact[-1])
