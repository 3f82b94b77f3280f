r"""Velocity feed-forward, the industry's heave compensation: pay out as the hook rises.

::

    MRU heave rate --> lead --> x share ---+
    MRU heave -------> lead --> x share --+ |
    haul --(+)---------------------------(+)--> trim --(-)--(+)--> drum-speed loop
            ^- reference displacement      reference velocity +

The speed of the rope is v_ref - share Z'(t + lead) - g (X - X_ref), with X_ref = x_ref - share Z
where the drum should be by now.  The last term is a slow trim: a rate alone, integrated by the
drum, lets it drift.  With the measured heave in X_ref the trim has nothing to say about the
waves themselves, which otherwise it would take for drift (a phase error of g/omega).

No more than about 0.9 of the heave rate is fed forward in practice: the payload of a stiff rope
then moves 1 - share of the hook.  Nothing here knows what the payload does; a rope whose payload
is in resonance with the waves makes the rest larger, and a residual of 0.1 at the hook may be
more than none at the payload.

What is measured is late: the MRU's delay, half a sample in which a command is held on average,
and the lag of the drum.  `lead` looks that far ahead by extrapolation, Z'(t) + lead Z''(t), the
acceleration being the filtered difference of the rate.

With the MRU's signal lost the feed-forward fades out over `fade`, and back in when it returns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import casadi as ca

from models.basics import SynthesisError, check_range
from models.case import Case
from models.hook import HookMotion
from models.plant import build_plant

from ..structures import DrumSpeedLoop, RecursiveController, Signals, sampled_loop

_OWNER = "feed-forward"
_BANDWIDTH = 8.0  # of the acceleration: well above the waves, below the MRU's noise [rad/s]


@dataclass(frozen=True, kw_only=True, eq=False, init=False)
class VelocityFeedForward(RecursiveController):
    """Velocity feed-forward of the MRU's heave rate into the drum-speed loop.

    Parameters
    ----------
    case
        The case; its motion reference unit is taken as perfect if it has none.
    share
        Share of the heave rate that is fed forward, 0 to 1.
    lead
        How far ahead the heave rate is extrapolated [s].
    position_gain
        Rate at which the drum returns to where it should be, g [1/s].
    fade
        Time over which the feed-forward goes when the MRU's signal is lost [s].
    sample_time
        T [s].
    bandwidth
        That of the drum-speed loop [rad/s], see `DrumSpeedLoop.from_case`.
    name
        What it is called; by default ``feed-forward``, or ``feed-forward-lead`` with a lead.

    Raises
    ------
    InputError
        If a number is out of its range.
    SynthesisError
        If the loop of drum speed and position is not stable on the linear plant.
    """

    share: float
    lead: float
    position_gain: float
    fade: float
    loop: DrumSpeedLoop

    def __init__(
        self,
        case: Case,
        *,
        share: float = 0.9,
        lead: float = 0.0,
        position_gain: float = 0.05,
        fade: float = 2.0,
        sample_time: float = 0.02,
        bandwidth: float | None = None,
        name: str | None = None,
    ) -> None:
        plant = build_plant(case)
        loop = DrumSpeedLoop.from_case(
            case, sample_time=sample_time, bandwidth=bandwidth, plant=plant
        )
        self._set(
            share=check_range(_OWNER, "share", share, low=0.0, high=1.0),
            lead=check_range(_OWNER, "lead", lead, low=0.0, high=10.0, unit="s"),
            position_gain=check_range(
                _OWNER, "position_gain", position_gain, low=0.0, high=1.0, unit="1/s"
            ),
            fade=check_range(_OWNER, "fade", fade, low=0.0, high=60.0, unit="s"),
            loop=loop,
        )
        called = name or ("feed-forward-lead" if lead > 0.0 else "feed-forward")
        # Drum-speed loop (2), strength, rate before, acceleration, is it known.
        initial = [*self.loop.initial, 1.0, 0.0, 0.0, 0.0]
        self._adopt(called, sample_time, initial, self._law)
        found = sampled_loop(case, plant, self.recursion, sample_time)
        if not found.stable:
            raise SynthesisError(
                f"{_OWNER}: with a position gain of {position_gain:g} 1/s at a sample time of "
                f"{sample_time:g} s the drum is not stable on the linear plant; ask for less"
            )

    @classmethod
    def with_lead(cls, case: Case, *, sample_time: float = 0.02) -> VelocityFeedForward:
        """Return the controller with the lead that the delays of the case ask for, `lead_of`."""
        return cls(case, lead=lead_of(case, sample_time=sample_time), sample_time=sample_time)

    def _law(self, xc: ca.SX, m: Signals) -> tuple[ca.SX, ca.SX]:
        T = self.loop.sample_time
        inner, strength, before, acceleration, known = ca.vertsplit(xc, [0, 2, 3, 4, 5, 6])
        step = 2.0 if self.fade == 0.0 else T / self.fade
        wanted = ca.if_else(m["mru.valid"] > 0.5, 1.0, 0.0)
        strength = ca.fmin(ca.fmax(wanted, strength - step), strength + step)
        heave, rate = m["mru.heave"], m["mru.heave_rate"]
        # Before the first sample there is no difference to take.  A first-order filter,
        # sampled exactly.
        change = known * (rate - before) / T
        acceleration = acceleration + (1.0 - math.exp(-_BANDWIDTH * T)) * (change - acceleration)
        heave_ahead, rate_ahead = heave + self.lead * rate, rate + self.lead * acceleration
        place = m["reference.displacement"] - strength * self.share * heave_ahead
        rope_speed = (
            m["reference.velocity"]
            - strength * self.share * rate_ahead
            - self.position_gain * (m["drum.haul"] - place)
        )
        inner, command = self.loop.command(inner, rope_speed, m)
        return ca.vertcat(inner, strength, rate, acceleration, 1.0), command


def lead_of(case: Case, *, sample_time: float = 0.02) -> float:
    """Return the lead that makes up for every delay of a feed-forward [s].

    The MRU's delay, and that of the drum-speed loop (half a sample of hold included) at the
    zero-crossing frequency of the hook's velocity.
    """
    hook = HookMotion.from_case(case, warn=False)
    omega = 2.0 * math.pi / hook.velocity.zero_crossing_period
    loop = DrumSpeedLoop.from_case(case, sample_time=sample_time)
    late = case.sensors.mru.delay if case.sensors.mru else 0.0
    return late + max(0.0, loop.delay_at(omega))
