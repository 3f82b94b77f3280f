r"""Velocity feed-forward, the industry's heave compensation: pay out as the hook rises.

::

    MRU heave rate --> restore --> lead --> x share ---+
    MRU heave -------> restore --> lead --> x share --+ |
    haul --(+)---------------------------------------(+)--> trim --(-)--(+)--> drum-speed loop
            ^- reference displacement                  reference velocity +

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

An MRU's heave has passed a high-pass, which turns slow waves by sqrt(2) omega_0/omega: with a
period of 30 s more than 0.4 rad at 9 s, far more than any delay.  As the filter is known,
`restore` takes it back and puts one of a `restore` times longer period in its place,

    G(s) = (s^2 + sqrt(2) omega_0 s + omega_0^2)/(s^2 + sqrt(2) omega_1 s + omega_1^2),

omega_1 = omega_0/restore.  The price is the MRU's error at low frequencies, which grows by
restore^2.

With the MRU's signal lost the feed-forward fades out over `fade`, and back in when it returns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import casadi as ca
import numpy as np

from models.basics import SynthesisError, check_range
from models.case import Case
from models.hook import HookMotion
from models.plant import build_plant, zero_order_hold

from ..structures import DrumSpeedLoop, RecursiveController, Signals, sampled_loop

_OWNER = "feed-forward"
LEAD_BANDWIDTH = 8.0  # of the acceleration: well above the waves, below the MRU's noise [rad/s]


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
    restore
        By what factor the period of the MRU's heave filter is made longer, 1 (not at all) to 20.
    position_gain
        Rate at which the drum returns to where it should be, g [1/s].
    fade
        Time over which the feed-forward goes when the MRU's signal is lost [s].
    lead_bandwidth
        Bandwidth of the acceleration in the extrapolation [rad/s].
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
    restore: float
    position_gain: float
    fade: float
    lead_bandwidth: float
    loop: DrumSpeedLoop
    _corner: float

    def __init__(
        self,
        case: Case,
        *,
        share: float = 0.9,
        lead: float = 0.0,
        restore: float = 1.0,
        position_gain: float = 0.05,
        fade: float = 2.0,
        lead_bandwidth: float = LEAD_BANDWIDTH,
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
            restore=check_range(_OWNER, "restore", restore, low=1.0, high=20.0),
            position_gain=check_range(
                _OWNER, "position_gain", position_gain, low=0.0, high=1.0, unit="1/s"
            ),
            fade=check_range(_OWNER, "fade", fade, low=0.0, high=60.0, unit="s"),
            lead_bandwidth=check_range(
                _OWNER, "lead_bandwidth", lead_bandwidth, low=0.0, unit="rad/s", open_low=True
            ),
            loop=loop,
        )
        period = case.sensors.mru.heave_filter_period if case.sensors.mru else None
        self._set(_corner=0.0 if period is None else 2.0 * math.pi / period)
        called = name or ("feed-forward-lead" if lead > 0.0 else "feed-forward")
        # Drum-speed loop (2), strength, rate before, acceleration, is it known, filter (2, 0).
        own = np.zeros(2 if self._corner > 0.0 and self.restore > 1.0 else 0)
        initial = np.concatenate([self.loop.initial, [1.0, 0.0, 0.0, 0.0], own])
        self._adopt(called, sample_time, initial, self._law)
        found = sampled_loop(case, plant, self.recursion, sample_time)
        if not found.stable:
            raise SynthesisError(
                f"{_OWNER}: with a position gain of {position_gain:g} 1/s at a sample time of "
                f"{sample_time:g} s the drum is not stable on the linear plant; ask for less"
            )

    @classmethod
    def with_lead(cls, case: Case, *, sample_time: float = 0.02) -> VelocityFeedForward:
        """Return the controller with the lead that the delays of the case ask for, `lead_of`.

        The MRU's heave filter is left as it is: `restore` takes back some of its phase, and lets
        in more of the MRU's slow error.
        """
        return cls(case, lead=lead_of(case, sample_time=sample_time), sample_time=sample_time)

    def _law(self, xc: ca.SX, m: Signals) -> tuple[ca.SX, ca.SX]:
        T = self.loop.sample_time
        inner, strength, before, acceleration, known, own = ca.vertsplit(
            xc, [0, 2, 3, 4, 5, 6, xc.numel()]
        )
        step = 2.0 if self.fade == 0.0 else T / self.fade
        wanted = ca.if_else(m["mru.valid"] > 0.5, 1.0, 0.0)
        strength = ca.fmin(ca.fmax(wanted, strength - step), strength + step)
        heave, rate = m["mru.heave"], m["mru.heave_rate"]
        if own.numel():
            heave, rate, own = self._restored(own, heave, rate)
        # Before the first sample there is no difference to take.  A first-order filter,
        # sampled exactly.
        change = known * (rate - before) / T
        acceleration = acceleration + (1.0 - math.exp(-self.lead_bandwidth * T)) * (
            change - acceleration
        )
        heave_ahead, rate_ahead = heave + self.lead * rate, rate + self.lead * acceleration
        place = m["reference.displacement"] - strength * self.share * heave_ahead
        rope_speed = (
            m["reference.velocity"]
            - strength * self.share * rate_ahead
            - self.position_gain * (m["drum.haul"] - place)
        )
        inner, command = self.loop.command(inner, rope_speed, m)
        return ca.vertcat(inner, strength, rate, acceleration, 1.0, own), command

    def _restored(self, q: ca.SX, heave: ca.SX, rate: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Return heave and heave rate behind G, and the next state of its filter.

        q'' + sqrt(2) omega_1 q' + omega_1^2 q = heave; then G heave = heave + sqrt(2) (omega_0 -
        omega_1) q' + (omega_0^2 - omega_1^2) q, and the rate is its derivative.
        """
        old, new = self._corner, self._corner / self.restore
        A = np.array([[0.0, 1.0], [-(new**2), -math.sqrt(2.0) * new]])
        step, drive = zero_order_hold(A, np.array([[0.0], [1.0]]), self.loop.sample_time)
        fast, slow = math.sqrt(2.0) * (old - new), old**2 - new**2
        bend = heave + ca.DM(A[[1]]) @ q
        following = ca.DM(step) @ q + ca.DM(drive) @ heave
        return heave + fast * q[1] + slow * q[0], rate + fast * bend + slow * q[1], following


def lead_of(case: Case, *, sample_time: float = 0.02, bandwidth: float | None = None) -> float:
    """Return the lead that makes up for every delay of a feed-forward [s].

    The MRU's delay, and that of the drum-speed loop (half a sample of hold included) at the
    zero-crossing frequency of the hook's velocity.
    """
    hook = HookMotion.from_case(case, warn=False)
    omega = 2.0 * math.pi / hook.velocity.zero_crossing_period
    loop = DrumSpeedLoop.from_case(case, sample_time=sample_time, bandwidth=bandwidth)
    late = case.sensors.mru.delay if case.sensors.mru else 0.0
    return late + max(0.0, loop.delay_at(omega))
