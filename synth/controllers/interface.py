r"""The interface of a controller: what the operator has in hand, the same for every law.

::

    set point --> rate --> + what the load is off at first --> law --+
                                                                     v
    enable -----------------------------------------------------> share --> value, rate --> command
                                                                     ^                  --> status
                                 drum-speed loop that holds the drum +

`operated` puts it about any controller.  Of a recursion it makes another, which the simulation
compiles and an export writes; any other object it steps from Python, by the same formulas.

While `operator.enable` is 0, and where the law has no number to give, a drum-speed loop holds the
drum where it stands.  Each time it begins with the drum's speed, which then goes, and with the
integral that makes its first command the one that the drive has followed: there is no step.

Without the drum's encoder nobody knows how the drum turns, and no law commands it.  From the speed
that was seen last, the motor's equation of motion says which command stops the drum in `STOPPING`
seconds; the command goes over to that from the one that the drive followed, and then the brake is
asked for.  It stays until the operator resets the controller, or disables it and the encoder is
back; an encoder that is back before is a fresh start of the law.

The law runs all the time, and hears what the drive really did (`drive.applied`), so that estimators
are settled and integrators have followed it.  Enabled, it takes the command over in `ramp` seconds,
by 3 s^2 - 2 s^3.  Until then its set point is where the load is, with its speed and acceleration,
so that it has nothing to make up for; these go in `ramp` seconds too, by the polynomial of fifth
degree.  Where the load is, a law that hears the payload takes from there, another from the drum,
and the hook if it hears of that.

What the operator asks starts from where the drum stands and moves at the operator's rate; a set
point that is no number keeps its place.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from typing_extensions import override

from models.basics import check_range
from models.case import Case
from models.plant import DriveLimits
from models.sensing import (
    HEARD,
    STATUSES,
    Controller,
    ControllerAround,
    Measurement,
    NativeLaw,
    Recursion,
    function_as_c,
    heard_by,
    holds_brake,
    interface_header,
    native_of,
    recursion_of,
)

from ..structures import (
    DrumSpeedLoop,
    RecursiveController,
    Signals,
    SteadyMotion,
    Stepper,
    make_recursion,
    signals_of,
)

_OWNER = "interface"
_CODE = {name: float(code) for code, name in enumerate(STATUSES)}
_USUAL = ("engaged", "limited", "blending")
_REFERENCE = ("reference.displacement", "reference.velocity", "reference.acceleration")
_MOVES = tuple(name.replace("reference", "payload") for name in _REFERENCE)
_AT = slice(HEARD.index(_REFERENCE[0]), HEARD.index(_REFERENCE[0]) + 3)
_SHOWN_BY = {
    HEARD.index("encoder.valid"): [HEARD.index("drum.haul"), HEARD.index("motor.speed")],
    HEARD.index("load_cell.valid"): [HEARD.index("rope.tension")],
}
_RESET = HEARD.index("operator.reset")
STOPPING = 1.0  #: Time in which a drum without encoder is stopped [s].
_TRIM = 0.05  # rate at which the drum returns to its place, of the loop's bandwidth
_STOPS = 0.2  # of the ramp: time constant with which a drum that turns at first is stopped
_HUGE = 1e12
_ROUNDING = 1e-9
_WHOLE = 1.0 - _ROUNDING


def operated(
    controller: Controller,
    case: Case,
    *,
    ramp: float = 5.0,
    rate: float = math.inf,
    slew: float = math.inf,
) -> Controller:
    """Return a controller with the operator's interface about it.

    The drum held by its brake, and a controller that has the interface, come back as they are.

    Parameters
    ----------
    controller, case
        Any controller, and the case that it runs on.
    ramp
        Time in which the command goes over to the law, and back [s].
    rate
        The operator's highest rate of the set point [m/s].
    slew
        Highest rate of the command [V, rad/s or N m, per s].

    Raises
    ------
    InputError
        If a number is out of its range.
    SynthesisError
        If the loop that holds the drum is not stable on the linear plant.
    """
    check_range(_OWNER, "ramp", ramp, low=0.0, high=600.0, unit="s")
    for name, value in (("rate", rate), ("slew", slew)):
        if value != math.inf:
            check_range(_OWNER, name, value, low=0.0, open_low=True)
    recursion = recursion_of(controller)
    if holds_brake(controller) or getattr(controller, "operated", False):
        return controller
    loop = DrumSpeedLoop.from_case(case, sample_time=controller.sample_time)
    hears = heard_by(controller)
    deaf = case.sensors.telemetry.delay + 1.0 if hears & set(_MOVES) else math.inf
    if recursion is None and hasattr(controller, "status"):  # which knows it itself
        deaf = math.inf
    parts = _Interface(
        loop=loop,
        most=highest_command(loop.motor, DriveLimits.from_case(case)),
        ramp=ramp,
        rate=rate,
        slew=slew * controller.sample_time,
        deaf=deaf,
        hears=hears,
    )
    if recursion is None:
        return _Operated(controller, parts)
    return OperatedLaw(
        name=controller.name,
        sample_time=controller.sample_time,
        recursion=_around(recursion, parts),
        masses=int(getattr(controller, "masses", 0)),
    )


def highest_command(motor: SteadyMotion, limits: DriveLimits) -> float:
    """Return the size of the command beyond which no drive within the limits gives more."""
    peak = min(limits.torque, motor.torque_constant * limits.current)
    return min(peak / motor.torque_gain + motor.own_gain * limits.speed, limits.voltage)


@dataclass(frozen=True, kw_only=True, eq=False)
class OperatedLaw(RecursiveController):
    """A recursive law with the interface about it; `operated` makes it."""

    operated = True
    masses: int = 0  #: Masses along the rope on which the law was found to hold.


class _Operated(ControllerAround):
    """A controller in Python with the interface about it."""

    operated = True

    def __init__(self, controller: Controller, parts: _Interface) -> None:
        super().__init__(controller)
        self._parts = parts
        before, after = parts.functions()
        self._asked = Stepper(before, np.zeros(parts.ASKED))
        self._given = Stepper(after, np.zeros(parts.GIVEN))

    def as_c(self, prefix: str) -> NativeLaw | None:
        """Return the C that does what `step` does, None where that of the law within is unknown."""
        within = native_of(self._controller, f"{prefix}_within")
        return None if within is None else _native_around(within, self._parts, prefix)

    @property
    def status(self) -> str:
        """What the last step was; what the law says of itself counts before the drive's part."""
        name = tuple(STATUSES)[int(self._given.state[-1])]
        own = str(getattr(self._controller, "status", "engaged"))
        return own if name in _USUAL and own not in _USUAL else name

    @override
    def reset(self) -> None:
        """Forget every earlier measurement."""
        super().reset()
        for part in (self._asked, self._given):
            part.reset()

    def step(self, measurement: Measurement, time: float) -> float:
        seen = measurement.values
        if seen[_RESET] > 0.5:
            self.reset()
        shown = seen.copy()
        shown[_AT] = self._asked.run(np.append(seen, self._given.state[-1]))
        for flag, of in _SHOWN_BY.items():
            if not seen[flag] > 0.5:  # no number is what an estimator does without
                shown[of] = math.nan
        wanted = self._controller.step(Measurement(shown), time)
        command = float(self._given.run(np.append(seen, wanted))[0])
        commanded = getattr(self._controller, "commanded", None)
        if commanded is not None:  # a law that compares it with what the drive follows
            commanded(command)
        return command


def _native_around(law: NativeLaw, parts: _Interface, prefix: str) -> NativeLaw:
    """Return the C of a law with the interface about it, by the steps of `_Operated`."""
    within = law.prefix
    before, after = (
        function_as_c(function, f"{prefix}_{name}")
        for function, name in zip(parts.functions(), ("asked", "given"), strict=True)
    )
    memory = f"""\
#include "{within}.h"

typedef struct {{
  double asked[{parts.ASKED}], given[{parts.GIVEN}];
  {within}_memory within;
}} {prefix}_memory;"""
    unseen = "\n".join(
        f"  if (!(measured[{flag}] > 0.5)) {' = '.join(f'shown[{i}]' for i in of)} = NAN;"
        for flag, of in _SHOWN_BY.items()
    )
    usual = " || ".join(f"status == {int(_CODE[name])}" for name in _USUAL)
    told = f"\n  {within}_commanded(&memory->within, command);" if law.commanded else ""
    count = len(HEARD)
    source = f"""\
#include <math.h>
#include <string.h>

#include "{prefix}.h"

{before.declaration}
{after.declaration}

void {prefix}_reset({prefix}_memory *memory) {{
  memset(memory->asked, 0, sizeof memory->asked);
  memset(memory->given, 0, sizeof memory->given);
  {within}_reset(&memory->within);
}}

double {prefix}_step({prefix}_memory *memory, const double *measured) {{
  double seen[{count + 1}], shown[{count}], next[{max(parts.ASKED, parts.GIVEN)}], reference[3];
  double command = 0.0;
  if (measured[{_RESET}] > 0.5) {prefix}_reset(memory);
  memcpy(seen, measured, {count} * sizeof(double));
  memcpy(shown, measured, {count} * sizeof(double));
  seen[{count}] = memory->given[{parts.GIVEN - 1}];
  {before.call(["memory->asked", "seen"], ["next", "reference"])}
  memcpy(memory->asked, next, sizeof memory->asked);
  memcpy(shown + {_AT.start}, reference, sizeof reference);
  /* No number is what an estimator does without. */
{unseen}
  seen[{count}] = {within}_step(&memory->within, shown);
  {after.call(["memory->given", "seen"], ["next", "&command"])}
  memcpy(memory->given, next, sizeof memory->given);{told}
  return command;
}}

int {prefix}_status(const {prefix}_memory *memory) {{
  /* What the law says of itself counts before the drive's part. */
  int own = {within}_status(&memory->within), status = (int)memory->given[{parts.GIVEN - 1}];
  if ({usual}) {{
    status = ({usual.replace("status", "own")}) ? status : own;
  }}
  return status;
}}
"""
    files = {
        f"{prefix}.h": interface_header(prefix, memory),
        f"{prefix}.c": source,
        f"{before.name}.c": before.source,
        f"{after.name}.c": after.source,
        **law.files,
    }
    return replace(law, prefix=prefix, files=files, commanded=False)


def _around(recursion: Recursion, parts: _Interface) -> Recursion:
    """Return the recursion of a law with the interface about it."""
    sizes = np.cumsum([0, parts.ASKED, parts.GIVEN, recursion.initial.size]).tolist()

    def law(state: ca.SX, m: Signals) -> tuple[ca.SX, ca.SX]:
        reset = m["operator.reset"] > 0.5
        front, back, own = ca.vertsplit(ca.if_else(reset, initial, state), sizes)
        front, asked = parts.set_point(front, m, back[-1])
        shown = {**m, **dict(zip(_REFERENCE, ca.vertsplit(asked), strict=True))}
        following, wanted = recursion.function(own, ca.vertcat(*shown.values()))
        # What is no number does not get into the law's state.
        good = _finite(wanted + ca.sum1(following))
        following = ca.if_else(good, following, own)
        back, command = parts.command(back, m, ca.if_else(good, wanted, 2.0 * _HUGE))
        return ca.vertcat(front, back, following), command

    initial = np.concatenate([np.zeros(sizes[2]), recursion.initial])
    return make_recursion(initial, law, status=sizes[2] - 1)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Interface:
    """The formulas on both sides of a law: `set_point` before it, `command` after it."""

    ASKED = 6  # states of `set_point`, all zero at first
    GIVEN = 11  # states of `command`, the last of them the status

    loop: DrumSpeedLoop
    most: float  #: Beyond it no drive gives more [command].
    ramp: float  #: Time in which the law takes over [s].
    rate: float  #: Highest rate of the set point [m/s].
    slew: float  #: Highest change of the command over a sample.
    deaf: float  #: Age of the payload's signals from which the law is blind [s].
    hears: frozenset[str]  #: What the law hears.

    def set_point(self, state: ca.SX, m: Signals, status: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Return the next state and what is asked: displacement, velocity and acceleration.

        The status is that of the sample before.
        """
        begun, before, since, *left = ca.vertsplit(state)
        on = ca.logic_and(begun, m["operator.enable"] > 0.5)
        commands = ca.logic_and(on, ca.logic_not(_holds(status)))
        # What the operator asks, from where the drum stands and at the rate.
        turns = ca.logic_and(_finite(m["drum.haul"]), m["encoder.valid"] > 0.5)
        before = ca.if_else(ca.logic_and(ca.logic_not(on), turns), m["drum.haul"], before)
        asked, rest = ca.vertcat(*(m[name] for name in _REFERENCE)), ca.vertcat(before, 0.0, 0.0)
        asked = ca.if_else(_finite(ca.sum1(asked)), asked, rest)
        if self.rate < math.inf:
            most, far = self.rate * self.loop.sample_time, asked[0] - before
            speed = ca.fmax(-self.rate, ca.fmin(self.rate, asked[1]))
            near = ca.vertcat(asked[0], speed, asked[2])
            way = ca.vertcat(before + ca.sign(far) * most, ca.sign(far) * self.rate, 0.0)
            asked = ca.if_else(ca.fabs(far) <= most * (1.0 + _ROUNDING), near, way)
            asked = ca.if_else(on, asked, rest)
        # And how far the load is off, as the law reckons it: that goes once the law commands.
        off = self._load(m) - asked
        off = ca.if_else(_finite(ca.sum1(off)), off, 0.0)
        start = ca.if_else(commands, ca.vertcat(*left), off)
        since = ca.if_else(commands, ca.fmin(1.0, since + self._more), 0.0)
        off = ca.if_else(since < 1.0, _gone(since, start, self._lasts), 0.0)
        return ca.vertcat(1.0, asked[0], since, start), asked + off

    def command(self, state: ca.SX, m: Signals, wanted: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Return the next state, whose last is the status, and the command for what a law wants."""
        loop, T = self.loop, self.loop.sample_time
        begun, place, there, speed, integral, held, since, last, *stop, status = ca.vertsplit(state)
        good, enabled = _finite(wanted), m["operator.enable"] > 0.5
        turns = ca.logic_and(m["encoder.valid"] > 0.5, _finite(m["motor.speed"] + m["drum.haul"]))
        # How fast the drum turned when that was seen last, and how far it has been stopped since.
        turned, stopped = ca.if_else(turns, m["motor.speed"], stop[0]), stop[1]
        freed = ca.logic_and(turns, ca.logic_or(ca.logic_not(enabled), stopped < _WHOLE))
        more = ca.if_else(freed, -T / STOPPING, T / STOPPING)
        stopped = ca.fmax(0.0, ca.fmin(1.0, stopped + more))
        on = ca.logic_and(ca.logic_and(enabled, good), freed)
        was_on = ca.logic_and(begun, ca.logic_not(_holds(status)))
        known = ca.if_else(begun, last, loop.static)
        applied = ca.if_else(_finite(m["drive.applied"]), m["drive.applied"], known)
        now = ca.if_else(turns, turned, ca.if_else(was_on, turned, speed))
        haul = ca.if_else(turns, m["drum.haul"], ca.if_else(begun, there, 0.0))
        # The drum begins to be held with the speed it has and the command that the drive follows.
        begins = ca.logic_or(ca.logic_not(begun), ca.logic_and(was_on, ca.logic_not(on)))
        speed = ca.if_else(begins, now, math.exp(-T / max(_STOPS * self.ramp, T)) * speed)
        place = ca.if_else(begins, haul, place + ca.if_else(was_on, haul - there, 0.0))
        integral = ca.if_else(begins, applied - loop.static - loop.motor.feed * speed, integral)
        rope_speed = speed / loop.motor.per_rope_speed
        # A drum that nobody sees is taken to do as asked: held against the haul that was seen last,
        # or a speed of then, it would run away.
        off, now = ca.if_else(turns, place - haul, 0.0), ca.if_else(turns, now, speed)
        drum, hold = loop.command(
            ca.vertcat(integral, ca.if_else(begins, applied, held)),
            rope_speed + _TRIM * loop.bandwidth * off,
            {"motor.speed": now, "drive.applied": applied},
        )
        since = ca.if_else(was_on, ca.fmin(1.0, since + self._more), 0.0)
        share = since * since * (3.0 - 2.0 * since)
        blended = ca.if_else(since < 1.0, hold + share * (wanted - hold), wanted)
        asked = ca.if_else(on, blended, hold)
        share = stopped * stopped * (3.0 - 2.0 * stopped)
        slows = 6.0 * stopped * (1.0 - stopped) / STOPPING
        motor = loop.motor
        stops = motor.feed * (1.0 - share) - motor.inertia / motor.torque_gain * slows
        stops = loop.static + turned * stops
        asked = ca.if_else(stopped > 0.0, asked + share * (stops - asked), asked)
        command = ca.fmax(-self.most, ca.fmin(self.most, asked))
        if self.slew < math.inf:
            before = ca.if_else(begun, last, applied)
            command = ca.fmax(before - self.slew, ca.fmin(before + self.slew, command))
        limited = ca.logic_or(_other(command, asked), ca.logic_and(begun, _other(applied, last)))
        status = ca.if_else(limited, _CODE["limited"], _CODE["engaged"])
        for name, so in (
            ("blending", since < 1.0),
            ("blind", m["payload.age"] > min(self.deaf, _HUGE)),
            ("fallback", ca.logic_not(good)),
            ("held", ca.logic_not(enabled)),
            ("stopping", stopped > 0.0),
            ("braked", stopped >= _WHOLE),
        ):
            status = ca.if_else(so, _CODE[name], status)
        place = place + rope_speed * T
        stop = [turned, stopped]
        return ca.vertcat(1.0, place, haul, speed, drum, since, command, *stop, status), command

    def functions(self) -> tuple[ca.Function, ca.Function]:
        """Return both as functions of state, and of measurement with status or with command."""
        x, y = ca.SX.sym("x", self.ASKED), ca.SX.sym("y", self.GIVEN)
        both = ca.SX.sym("m", len(HEARD) + 1)
        m, more = signals_of(both), both[len(HEARD)]
        before = ca.Function("before", [x, both], list(self.set_point(x, m, more)))
        return before, ca.Function("after", [y, both], list(self.command(y, m, more)))

    @property
    def _lasts(self) -> float:
        return max(self.ramp, self.loop.sample_time)

    @property
    def _more(self) -> float:
        return self.loop.sample_time / self._lasts

    def _load(self, m: Signals) -> ca.SX:
        """Return displacement, velocity and acceleration of the load as the law reckons them."""
        if self.hears & set(_MOVES):
            return ca.vertcat(*(m[name] for name in _MOVES))
        moves = ca.vertcat(m["drum.haul"], m["motor.speed"] / self.loop.motor.per_rope_speed, 0.0)
        if self.hears & {"mru.heave", "mru.heave_rate"}:
            moves = moves + ca.vertcat(m["mru.heave"], m["mru.heave_rate"], 0.0)
        return moves


def _holds(status: ca.SX) -> ca.SX:
    """Return whether the drum was held."""
    held = (status == _CODE[name] for name in ("held", "fallback", "stopping", "braked"))
    return functools.reduce(ca.logic_or, held)


def _gone(s: ca.SX, start: ca.SX, lasts: float) -> ca.SX:
    """Return displacement, velocity and acceleration on the way from those at s = 0 to none at 1.

    The polynomial of fifth degree; `lasts` is the time from 0 to 1 [s].
    """
    t = ca.SX.sym("t")
    x, v, a = (start[i] * lasts**i for i in range(3))
    path = (
        x * (1.0 - t**3 * (10.0 - 15.0 * t + 6.0 * t**2))
        + v * (t - t**3 * (6.0 - 8.0 * t + 3.0 * t**2))
        + a * 0.5 * t**2 * (1.0 - t) ** 3
    )
    rate = ca.jacobian(path, t) / lasts
    moved = ca.vertcat(path, rate, ca.jacobian(rate, t) / lasts)
    return ca.substitute(moved, t, s)


def _finite(value: ca.SX) -> ca.SX:
    return ca.fabs(value) < _HUGE


def _other(one: ca.SX, other: ca.SX) -> ca.SX:
    return ca.fabs(one - other) > _ROUNDING * (ca.fabs(one) + ca.fabs(other))
