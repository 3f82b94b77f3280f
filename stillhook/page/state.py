"""What stands on the page: the case, the structure, its parameters, and what was changed.

    case, structure, law -> State -> controls() -> sliders
                                  -> with_value(key, shown) -> State

All of it is plain and frozen: each tab has its own, and a test needs no browser.  Values are SI;
a `Control` has them in the unit that people read.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from models.basics import InputError, check_range
from models.case import Case
from synth.structures import Parameter, structures_aboard

_REACH = 2.5  # of a gain, how far its slider goes
_SPREAD = 5.0  # of a corner or a bandwidth, whose range is wide
_WIDE = 20.0  # ratio of bounds beyond which a range is wide
_STEPS = 200.0  # of a slider


@dataclass(frozen=True, kw_only=True)
class Control:
    """One slider with its number: what it is, and where it stands, in the unit shown."""

    key: str  #: Name of the parameter, or dotted path in the case.
    label: str
    unit: str  #: As shown; nothing for a plain number.
    value: float
    #: Ends and step of the slider; a number may be typed beyond them.
    low: float
    high: float
    step: float
    help: str  #: What it is, in a sentence.
    gain: bool  #: Whether it is a parameter of the controller, and not of the case.

    @property
    def name(self) -> str:
        """Label and unit, as a reader of the page hears them."""
        return f"{self.label} [{self.unit}]" if self.unit else self.label


@dataclass(frozen=True, kw_only=True)
class _Field:
    """A number of the case that has a slider: in SI, `factor` to one of the unit shown."""

    path: str
    label: str
    unit: str
    factor: float
    low: float
    high: float
    step: float
    help: str


_FIELDS = (
    _Field(
        path="sea.significant_height",
        label="Wave height H_s",
        unit="m",
        factor=1.0,
        low=0.5,
        high=6.0,
        step=0.05,
        help="Significant height of the waves: mean of the highest third, crest to trough.",
    ),
    _Field(
        path="sea.peak_period",
        label="Peak period T_p",
        unit="s",
        factor=1.0,
        low=4.0,
        high=18.0,
        step=0.1,
        help="Period at which the spectrum of the waves has its peak.",
    ),
    _Field(
        path="sea.significant_period",
        label="Significant period T_S",
        unit="s",
        factor=1.0,
        low=4.0,
        high=16.0,
        step=0.1,
        help="Mean period of the highest third of the waves, by which this spectrum is named.",
    ),
    _Field(
        path="vessel.heading",
        label="Heading of the waves",
        unit="deg",
        factor=math.pi / 180.0,
        low=0.0,
        high=360.0,
        step=5.0,
        help="Where the waves travel to, from the bow: 180 is a head sea, 90 comes from starboard.",
    ),
    _Field(
        path="rope.length",
        label="Depth (rope paid out)",
        unit="m",
        factor=1.0,
        low=50.0,
        high=3000.0,
        step=10.0,
        help="Length of rope between the drum and the load.",
    ),
    _Field(
        path="sensors.telemetry.delay",
        label="Telemetry delay",
        unit="ms",
        factor=1e-3,
        low=0.0,
        high=250.0,
        step=1.0,
        help="How late the load's sensors are heard: sampling, cable or modem, field bus.",
    ),
    _Field(
        path="limits.max_sensitivity",
        label="Limit of M_s",
        unit="",
        factor=1.0,
        low=1.2,
        high=4.0,
        step=0.05,
        help="Largest peak of the sensitivity that is allowed; 2 keeps L half a unit from -1.",
    ),
)

_WORDS = {
    "a": "Gain a, on the load's acceleration",
    "a1": "Gain a1, on the load's velocity",
    "a2": "Gain a2, on the load's displacement",
    "payload.acceleration_gain": "Load acceleration gain",
    "payload.velocity_gain": "Load velocity gain",
    "payload.position_gain": "Load position gain",
    "payload.integral_gain": "Load integral gain",
    "drum.position_gain": "Drum position gain",
    "heave.gain": "Heave feed-forward gain",
    "heave.lead": "Heave lead time",
    "heave.bandwidth": "Heave filter bandwidth",
    "rolloff.corner": "Roll-off corner",
    "rolloff.damping": "Roll-off damping",
    "notch.corner": "Notch frequency",
    "notch.width": "Notch width",
    "notch.depth": "Notch depth",
    "lead.zero": "Lead: zero",
    "lead.pole": "Lead: pole",
}


@dataclass(frozen=True, kw_only=True, eq=False)
class State:
    """What one tab shows."""

    case: Case  #: As it was opened.
    structure: str
    law: tuple[Parameter, ...]  #: The structure's parameters.
    parameters: Mapping[str, float]  #: Their values, the fixed amplifier among them.
    #: Numbers of the case that were changed, by dotted path, SI.
    changes: Mapping[str, float] = field(default_factory=dict)
    #: Ends of the parameters' sliders.
    spans: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        case: Case,
        structure: str,
        law: Sequence[Parameter],
        parameters: Mapping[str, float] | None = None,
        changes: Mapping[str, float] | None = None,
    ) -> State:
        """Return the state of a case with a structure, at rest unless parameters are given.

        Raises InputError if a parameter is missing or no number.
        """
        found = at_rest(law) if parameters is None else dict(parameters)
        for one in law:
            if one.name not in found:
                raise InputError(f"{structure}: the parameter {one.name} is missing")
        spans = {one.name: _span(one, found[one.name]) for one in law}
        return cls(
            case=case,
            structure=structure,
            law=tuple(law),
            parameters=found,
            changes=dict(changes or {}),
            spans=spans,
        )

    @cached_property
    def case_now(self) -> Case:
        """The case with what was changed.

        Raises InputError if that is no case.
        """
        return self.case.replace(dict(self.changes)) if self.changes else self.case

    @cached_property
    def structures(self) -> tuple[str, ...]:
        """Names of the structures whose sensors the case names."""
        return structures_aboard(self.case)

    def controls(self) -> tuple[Control, ...]:
        """Return the sliders: the structure's parameters, then the numbers of the case."""
        found = [self._gain(one) for one in self.law]
        for one in _FIELDS:
            value = self.value_of(one.path)
            if value is not None:
                found.append(self._control(one, value / one.factor))
        return tuple(found)

    def control(self, key: str) -> Control:
        """Return one slider by its key.

        Raises InputError if there is none.
        """
        for one in self.controls():
            if one.key == key:
                return one
        raise InputError(f"page: there is no control {key!r}")

    def value_of(self, path: str) -> float | None:
        """Return a number of the case by its path, SI; None where the case has none."""
        if path in self.changes:
            return self.changes[path]
        found: Any = self.case
        for name in path.split("."):
            found = getattr(found, name, None)
        return float(found) if isinstance(found, int | float) else None

    def with_value(self, key: str, shown: object) -> State:
        """Return the state with another value of a control, in the unit that it shows.

        Raises InputError if it is no number, or out of the range of what it is; what the case says
        to it is known when it is looked at.
        """
        control = self.control(key)
        value = check_range("page", control.label, shown)
        if control.gain:
            parameter = next(one for one in self.law if one.name == key)
            value = check_range("page", control.label, value, low=parameter.low)
            spans = dict(self.spans)
            if not spans[key][0] <= value <= spans[key][1]:
                spans[key] = _span(parameter, value)
            return replace(self, parameters={**self.parameters, key: value}, spans=spans)
        place = next(one for one in _FIELDS if one.path == key)
        return replace(self, changes={**self.changes, key: value * place.factor})

    def with_text(self, key: str, text: str) -> State:
        """Return the state with what was typed for a control; a comma may be a decimal point.

        Raises InputError as `with_value`.
        """
        try:
            value = float(text.strip().replace(",", ".").replace("\u2212", "-"))
        except ValueError:
            label = self.control(key).label
            raise InputError(f"page: {label} must be a number, got {text!r:.40}") from None
        return self.with_value(key, value)

    def with_parameters(self, parameters: Mapping[str, float]) -> State:
        """Return the state with all parameters of its structure, its sliders about them.

        Raises InputError if one is missing.
        """
        return State.of(self.case, self.structure, self.law, parameters, self.changes)

    def _gain(self, one: Parameter) -> Control:
        low, high = self.spans[one.name]
        unit = one.unit.replace("(", "").replace(")", "") if one.unit != "-" else ""
        if one.unit.count("(") == 2:  # (rad/s)/(m/s2)
            unit = one.unit.replace("/(m)", "/m")
        end = "" if math.isinf(one.high) else f", {one.low:g} to {one.high:g}"
        return Control(
            key=one.name,
            label=_WORDS.get(one.name, one.name),
            unit=unit,
            value=self.parameters[one.name],
            low=low,
            high=high,
            step=_step(high - low),
            help=f"Parameter {one.name} of {self.structure}{end}.",
            gain=True,
        )

    def _control(self, one: _Field, value: float) -> Control:
        """Return the slider of a number of the case, long enough for where it stands."""
        low, high = one.low, one.high
        if one.path == "rope.length":
            opened = self.case.rope.length
            high = 10.0 * math.ceil(0.15 * max(opened, 200.0))
            stored = self.case.winch.drum.rope_on_drum_total
            if stored is not None and stored > opened:
                high = min(high, stored)
        return Control(
            key=one.path,
            label=one.label,
            unit=one.unit,
            value=value,
            low=min(low, value),
            high=max(high, value),
            step=one.step,
            help=one.help,
            gain=False,
        )


def at_rest(law: Sequence[Parameter]) -> dict[str, float]:
    """Return values with which a structure does as good as nothing: gains zero, corners usual."""
    return {
        one.name: 0.0 if math.isinf(one.low) else float(min(max(one.scale, one.low), one.high))
        for one in law
    }


def usual_structure(case: Case) -> str:
    """Return the structure that a case is opened with: that of its gains in use, or a drum loop."""
    aboard = structures_aboard(case)
    wanted = "payload-feedback" if case.gains is not None else "drum-feedback"
    return wanted if wanted in aboard else aboard[0]


def gains_in_use(case: Case, structure: str) -> dict[str, float] | None:
    """Return the gains that a case has in use, if they are of that structure."""
    if case.gains is None or structure != "payload-feedback":
        return None
    return {name: getattr(case.gains, name) for name in ("A", "a", "a1", "a2")}


def _span(one: Parameter, value: float) -> tuple[float, float]:
    """Return the ends of a parameter's slider about a value."""
    bounded = math.isfinite(one.low) and math.isfinite(one.high)
    if bounded and (one.low <= 0.0 or one.high < _WIDE * one.low or one.high < 10.0):
        return min(one.low, value), max(one.high, value)
    if one.low >= 0.0:
        return max(one.low, value / _SPREAD), min(one.high, _SPREAD * max(value, one.scale * 1e-3))
    reach = _REACH * abs(value) if value else one.scale
    return (0.0, reach) if value >= 0.0 else (-reach, 0.0)


def _step(span: float) -> float:
    """Return a round step for a slider of some length."""
    rough = span / _STEPS
    power = 10.0 ** math.floor(math.log10(rough))
    return power * next((k for k in (1.0, 2.0, 5.0) if rough <= k * power * (1.0 + 1e-9)), 10.0)
