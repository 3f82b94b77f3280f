r"""Linear feedback in the time domain: a design, sampled.

::

    reference velocity ----> feed --------------------+
                                                       v
    measured --(+)--> fresh? ----> C(z): A, B, C, D ---(+)--> command, static included
                ^- reference         ^
                                     K_b
                                     +--- drive.applied - command asked for

From gains, C is static: the 1975 thesis's u = -A (a P'' + a1 P' + a2 P) (its eq. 30), about the
reference.  It has nothing that could wind up, so anti-windup changes nothing.

A controller with states (from `synth.design.tuning`) is sampled by Tustin's rule, which keeps every
stable pole stable.  Anti-windup is by back-calculation in the observer's form (K. J. Astrom and
B. Wittenmark, Computer-Controlled Systems, 3rd ed., chapter 9): while the drive does not do what
it is asked, the states follow what it does,

    x+ = A x + B e + K_b (u_applied - u_asked),

with K_b by `synth.structures.sampling.tracking_gain`, so that A - K_b C is stable, an
integrator included.

What comes up from the payload may stop coming.  Values older than `hold_for` fade out, until
after another second only the static command and the reference are left: a voltage that goes
on from an old measurement would drive the drum away.  So would the last heave rate of a motion
reference unit that is lost; it counts as nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from models.basics import InputError, check_range, pick
from models.case import Case
from models.plant import MEAN_LOSSES, MEASUREMENTS, build_plant

from ..design import Design, Tuning
from ..loop import LinearController
from ..structures import (
    Matrices,
    RecursiveController,
    Signals,
    SteadyMotion,
    checked_sample_time,
    sampled,
    tracking_gain,
)

_OWNER = "linear feedback"
HOOK = ("mru.heave", "mru.heave_rate")
HEARD = (*MEASUREMENTS, *HOOK, "drum.haul", "motor.speed", "motor.torque", "rope.tension")
# Between samples [s].  Held for T, a command is late by half of it and weaker by sinc(omega T/2).
# At 10 ms that is 9 degrees at 30 rad/s, where loops that hear noise are busy, and 2 degrees at a
# resonance of 6 rad/s that gains leave with M_s = 2, whose torque is then 5 % more than designed.
_SAMPLE = 0.005
FADE = 1.0  # in which an old measurement loses its weight [s]


@dataclass(frozen=True, kw_only=True, eq=False, init=False)
class LinearFeedback(RecursiveController):
    """u = u_static + feed-forward of the reference + C(z) (y - y_reference).

    Parameters
    ----------
    case
        The case.
    law
        Gains ``a, a1, a2`` and optionally ``A`` (by default that of the case, else 1), or a
        controller u = +C(s) y with one input, which may hear what is measured at the payload
        and at the winch.
    sample_time
        T [s]; by default 5 ms, with which it does in samples what it does in continuous time.
    anti_windup
        Whether the states of a dynamic controller follow the drive where it has limits.
    hold_for
        Age up to which the payload's values count in full [s]; by default a second more than
        the telemetry's delay.
    name
        What it is called; by default ``feedback``.
    masses
        Masses along the rope on which the law was found to hold: a simulation has at least as many.

    Raises
    ------
    InputError
        If the gains are incomplete, a number is out of its range, or the controller hears or
        commands something that there is not.
    SynthesisError
        If the controller has an unstable state that its output does not show, which no
        anti-windup can hold.
    """

    case: Case
    controller: LinearController
    anti_windup: bool
    hold_for: float
    motor: SteadyMotion
    masses: int

    def __init__(
        self,
        case: Case,
        law: Mapping[str, float] | LinearController,
        *,
        sample_time: float = _SAMPLE,
        anti_windup: bool = True,
        hold_for: float | None = None,
        name: str = "feedback",
        masses: int = 0,
    ) -> None:
        checked_sample_time(_OWNER, sample_time)
        plant = build_plant(case)
        point, late = plant.operating_point(MEAN_LOSSES), case.sensors.telemetry.delay
        controller = law if isinstance(law, LinearController) else _from_gains(case, law)
        _check_signals(controller)
        hold = late + 1.0 if hold_for is None else hold_for
        check_range(_OWNER, "hold_for", hold, low=0.0, unit="s")
        C = sampled(controller, sample_time)
        self._set(
            case=case,
            controller=controller,
            anti_windup=anti_windup and len(C[0]) > 0,
            hold_for=float(hold),
            deaf_after=float(hold)
            if set(MEASUREMENTS) & set(controller.measurements)
            else math.inf,
            motor=SteadyMotion.of(plant.data),
            masses=masses,
        )
        back = tracking_gain(C, sample_time) if self.anti_windup else np.zeros((len(C[0]), 1))
        static = {"rope.tension": point.tension, "motor.torque": point.torque}
        own = len(C[0])

        def respond(xc: ca.SX, m: Signals) -> tuple[ca.SX, ca.SX]:
            # Not by slices: an empty slice of a column of two is a row in CasADi.
            x, asked = ca.vertsplit(xc, [0, own, xc.numel()])
            if self.anti_windup:  # what the drive really did over the last sample
                x = x + back @ (m["drive.applied"] - asked)
            following, feedback = _advance(C, x, self._deviations(m, static))
            speed = self.motor.per_rope_speed * m["reference.velocity"]
            command = point.command + (self.motor.feed * speed + feedback)
            if self.anti_windup:
                following = ca.vertcat(following, command)
            return following, command

        last = [point.command] if self.anti_windup else []
        self._adopt(name, sample_time, [*np.zeros(own), *last], respond)

    @classmethod
    def from_design(
        cls, design: Design | Tuning, *, case: Case | None = None, **options: Any
    ) -> LinearFeedback:
        """Return the feedback of a design.

        Parameters
        ----------
        design
            A `Design`, or a `Tuning` of any structure on the plant of a case.
        case
            The case that it is to run on; by default the design's own.  A `Tuning` knows of
            none.
        options
            As of the class.

        Raises
        ------
        InputError
            If a `Tuning` comes without a case or has no controller; otherwise as the class.
        """
        law = design.controller
        masses = design.masses if isinstance(design, Design) else 0
        if law is None:
            raise InputError(f"{_OWNER}: the design has no controller: {design.status}")
        if case is None and isinstance(design, Design):
            case = design.case
        if case is None:
            raise InputError(f"{_OWNER}: a Tuning does not know its case: say case=...")
        return cls(case, law, **{"masses": masses, **options})

    @property
    def dynamic(self) -> bool:
        """Whether the controller has states of its own, which may wind up."""
        return len(self.controller.A) > 0

    def _deviations(self, m: Signals, static: Mapping[str, float]) -> ca.SX:
        """Return y - y_reference of what the controller hears, (ny, 1)."""
        fresh = ca.fmin(1.0, ca.fmax(0.0, (self.hold_for + FADE - m["payload.age"]) / FADE))
        wanted: dict[str, ca.SX | float] = {
            "drum.haul": m["reference.displacement"],
            "motor.speed": self.motor.per_rope_speed * m["reference.velocity"],
            **static,
        }
        wanted |= {name: m[name.replace("payload", "reference")] for name in MEASUREMENTS}
        # A reference unit that is lost shows its last values: a heave rate that goes on for ever.
        trust = {**dict.fromkeys(MEASUREMENTS, fresh), **dict.fromkeys(HOOK, m["mru.valid"])}
        trust |= dict.fromkeys(("drum.haul", "motor.speed"), m["encoder.valid"])
        trust["rope.tension"] = m["load_cell.valid"]
        rows = []
        for name in self.controller.measurements:
            deviation = m[name] - wanted.get(name, 0.0)
            rows.append(trust[name] * deviation if name in trust else deviation)
        return ca.vertcat(*rows)


def _from_gains(case: Case, gains: Mapping[str, float]) -> LinearController:
    """Return u = -A (a P'' + a1 P' + a2 P)."""
    unknown = set(gains) - {"A", "a", "a1", "a2"}
    if unknown or not {"a", "a1", "a2"} <= set(gains):
        raise InputError(
            "gains: must be a, a1, a2 and optionally A, got " + (", ".join(gains) or "none")
        )
    own = case.gains.A if case.gains is not None else 1.0
    values = {name: check_range("gains", name, v) for name, v in {"A": own, **gains}.items()}
    products = [-values["A"] * values[name] for name in ("a", "a1", "a2")]
    return LinearController.static([products], MEASUREMENTS, ("drive.command",))


def _check_signals(controller: LinearController) -> None:
    if len(controller.inputs) != 1:
        raise InputError(
            f"{_OWNER}: the controller must have one input, the drive's command, got "
            f"{', '.join(controller.inputs) or 'none'}"
        )
    pick(_OWNER, "measurement", HEARD, controller.measurements)


def _advance(matrices: Matrices, x: ca.SX, y: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return (A x + B y, C x + D y)."""
    A, B, C, D = (ca.DM(matrix) for matrix in matrices)
    return A @ x + B @ y, C @ x + D @ y
