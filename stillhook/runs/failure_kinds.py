"""What may fail of a winch, one thing at a time (`KINDS`): each as faults, and what guards it.

    FailureKind, case, lasting --> sizes by fault path --> models.operation.with_faults --> Scenario

A kind says in words what fails, how, and which signal tells of it at once; what the controller at
hand does about it is in `safeguard`, a sentence for each family of laws.  Nothing here is simulated
(`stillhook.runs.failures` does that).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

from models.case import Case
from models.operation import Scenario, scenario_named, with_faults
from models.plant import MEASUREMENTS
from models.sensing import Controller, holds_brake, recursion_of
from synth.controllers import FADE, STOPPING, ConstantTension, LinearFeedback, VelocityFeedForward

from ..text import quantity

Family = Literal["feedback", "feed-forward", "constant-tension", "mpc", "other"]

RAMP = 10.0  #: Time in which the command is ramped in once a tripped brake opens [s].
LATER, TIMES = 0.1, 3.0  # a later link: by so much [s], or so many times as late if that is more
BIAS, RATE_BIAS = 0.2, 0.05  # what a biased reference unit shows too much [m, m/s]
SPIKE = 3.0  # by how much its heave is off for 0.05 s of every 2 s [m]
HALF = 0.5  # of the drive's torque, or of its power, that is left
_OFF = 1e-3  # of its torque that a drive has which is off: the least that a fault may leave
_FOR_EVER = 86400.0  # [s]


@dataclass(frozen=True, kw_only=True, eq=False)
class FailureKind:
    """One thing that may fail, and how."""

    identifier: str  #: A word for programs, such as ``mru-lost``.
    item: str  #: What fails.
    failure: str  #: How it fails, in words; `told` fills in what hangs on the case.
    flag: str  #: Which signal tells of it at once, or that none does.
    #: Sizes by the names of `models.operation.FAULTS`, of a case and a time that it lasts [s].
    faults: Callable[[Case, float], Mapping[str, float]]
    #: What a controller hears that this takes from it or spoils; empty: it concerns all of them.
    spoils: frozenset[str] = frozenset()
    ends: bool = True  #: Whether it ends, and the controller is at work again.

    def told(self, case: Case) -> str:
        """Return how it fails in a case, in words."""
        return self.failure.format(later=quantity(later(case), "s"))

    def scenario(self, case: Case, at: float, lasting: float, duration: float) -> Scenario:
        """Return the load held in its place, and this failing at a time, for so long [s].

        Raises InputError if the times do not fit into the duration.
        """
        sizes = {f"fault.{name}": size for name, size in self.faults(case, lasting).items()}
        long = {"fault.at": at, "fault.lasting": lasting if self.ends else _FOR_EVER}
        ramp = RAMP if self.ends and "fault.brake_trip" in sizes else 0.0
        hold = scenario_named("hold", case, ramp=ramp)
        return with_faults(hold, {**long, **sizes}, case, duration)


def later(case: Case) -> float:
    """Return by how much the messages of a link that is late are later [s]."""
    return max(LATER, (TIMES - 1.0) * float(case.sensors.telemetry.delay))


_PAYLOAD, _UNIT = frozenset(MEASUREMENTS), frozenset({"mru.heave", "mru.heave_rate"})
_CELL = frozenset({"rope.tension"})
_SILENT = "payload.valid is 0, and payload.age grows"
_SHORT = "drive.applied falls short of the command"
_UNSEEN = "no flag tells of it"


def _for(name: str) -> Callable[[Case, float], Mapping[str, float]]:
    """Return a fault whose size is how long it lasts."""
    return lambda case, lasting: {name: lasting}


KINDS: tuple[FailureKind, ...] = (
    FailureKind(
        identifier="payload-lost",
        item="payload unit",
        failure="gives no numbers",
        flag=_SILENT,
        faults=_for("sensor_outage"),
        spoils=_PAYLOAD,
    ),
    FailureKind(
        identifier="payload-stuck",
        item="payload unit",
        failure="shows the same numbers for ever, as if they were true",
        flag=_UNSEEN,
        faults=_for("stuck_readings"),
        spoils=_PAYLOAD,
    ),
    FailureKind(
        identifier="mru-lost",
        item="motion reference unit",
        failure="gives no numbers",
        flag="mru.valid is 0",
        faults=_for("mru_outage"),
        spoils=_UNIT,
    ),
    FailureKind(
        identifier="mru-biased",
        item="motion reference unit",
        failure=f"shows {quantity(BIAS, 'm')} and {quantity(RATE_BIAS, 'm/s')} too much",
        flag=_UNSEEN,
        faults=lambda case, lasting: {"mru_heave_bias": BIAS, "mru_rate_bias": RATE_BIAS},
        spoils=_UNIT,
    ),
    FailureKind(
        identifier="mru-spikes",
        item="motion reference unit",
        failure=f"heave off by {quantity(SPIKE, 'm')} for 50 ms of every 2 s",
        flag=_UNSEEN,
        faults=lambda case, lasting: {"mru_spike": SPIKE},
        spoils=_UNIT,
    ),
    FailureKind(
        identifier="encoder-lost",
        item="drum encoder",
        failure="gives no numbers",
        flag="encoder.valid is 0",
        faults=_for("encoder_outage"),
        ends=False,  # the brake stays
    ),
    FailureKind(
        identifier="load-cell-lost",
        item="load cell",
        failure="gives no numbers",
        flag="load_cell.valid is 0",
        faults=_for("load_cell_outage"),
        spoils=_CELL,
    ),
    FailureKind(
        identifier="telemetry-lost",
        item="telemetry",
        failure="no message comes from the payload",
        flag=_SILENT,
        faults=_for("telemetry_outage"),
        spoils=_PAYLOAD,
    ),
    FailureKind(
        identifier="telemetry-late",
        item="telemetry",
        failure="messages later by {later}",
        flag="payload.age grows by as much",
        faults=lambda case, lasting: {"delay_step": later(case)},
        spoils=_PAYLOAD,
    ),
    FailureKind(
        identifier="torque-halved",
        item="drive",
        failure="torque and current limited to half",
        flag=_SHORT,
        faults=lambda case, lasting: {"torque_limit": HALF},
    ),
    FailureKind(
        identifier="drive-off",
        item="drive",
        failure="off: no torque, the brake is set for good",
        flag="the drive tells of it, and the brake is on",
        faults=lambda case, lasting: {"torque_limit": _OFF, "brake_trip": _FOR_EVER},
        ends=False,
    ),
    FailureKind(
        identifier="power-halved",
        item="vessel's power",
        failure="half of the drive's power is left",
        flag=_SHORT,
        faults=lambda case, lasting: {"power_limit": HALF},
    ),
    FailureKind(
        identifier="brake-trip",
        item="brake",
        failure="trips, and opens again",
        flag="the brake is on",
        faults=_for("brake_trip"),
    ),
)
"""What may fail: sensors, link, drive, power, brake, in the order of the table."""


def concerns(kind: FailureKind, controller: Controller, heard: frozenset[str]) -> str:
    """Return why a failure is nothing to a controller that hears so much; empty if it is."""
    if holds_brake(controller):
        return "the drum is held by its brake, and the drive is off"
    if kind.spoils and not kind.spoils & heard:
        return "not heard by this controller"
    return ""


def family_of(controller: Controller) -> Family:
    """Return which of our laws a controller is, if any."""
    if isinstance(controller, LinearFeedback):
        return "feedback"
    if isinstance(controller, VelocityFeedForward):
        return "feed-forward"
    if isinstance(controller, ConstantTension):
        return "constant-tension"
    if recursion_of(controller) is None:
        from mpc.linear import WinchMPC  # brings a solver along: only where it may be one

        if isinstance(controller, WinchMPC):
            return "mpc"
    return "other"


_NONE = "none: what comes in time is believed"
_LEFT_OUT = "the estimator does without, by its model and the other sensors"
_DISAGREES = "the gate refuses heave that disagrees with its own rate, until both agree again"
_OVERSPEED = "at overspeed the brake is set"
_SAID = {  # families of laws whose answer to a failure is their own; "other" where they have none
    "payload-lost": {
        "feedback": "values older than {hold} fade out of the command within {fade}",
        "mpc": _LEFT_OUT,
    },
    "payload-stuck": {
        "feedback": _NONE,
        "mpc": "the gate refuses a reading that does not change while the load should move",
    },
    "mru-lost": {
        "feedback": "the unit's signals count as nothing at once",
        "feed-forward": "the feed-forward fades out within {fade}, and the drum is held",
        "mpc": _LEFT_OUT,
    },
    "mru-biased": {
        "feedback": _NONE,
        "feed-forward": "a slow trim ({trim:g} 1/s) ends the drum's drift",
        "mpc": _DISAGREES,
    },
    "mru-spikes": {
        "feedback": _NONE,
        "feed-forward": "the heave acts by the slow trim alone ({trim:g} 1/s)",
        "mpc": _DISAGREES,
    },
    "encoder-lost": {
        "other": "the drum is stopped within {stopping} from the speed seen last; then the brake "
        "is set, until a reset",
    },
    "load-cell-lost": {
        "feedback": "the tension counts as nothing at once",
        "constant-tension": "the tension counts as nothing at once, and the drum is centred slowly",
        "mpc": _LEFT_OUT,
    },
    "telemetry-late": {
        "feedback": "up to an age of {hold} none but the loop's own delay margin",
        "mpc": "a telegram is compared with what was on its way at the age that it tells",
    },
    "torque-halved": {
        "feedback": "{windup}; " + _OVERSPEED,
        "feed-forward": "the integral of the drum-speed loop follows the drive; " + _OVERSPEED,
        "constant-tension": "the integral of the drum-speed loop follows the drive; " + _OVERSPEED,
        "mpc": "the torque that is planned with follows what the drive gives; " + _OVERSPEED,
        "other": _OVERSPEED,
    },
    "drive-off": {"other": "the brake closes, and holds the drum"},
    "brake-trip": {
        "other": f"the brake holds the drum; once it opens the command is ramped in in {RAMP:g} s"
    },
}
_LIKE = {"telemetry-lost": "payload-lost", "power-halved": "torque-halved"}


def safeguard(kind: FailureKind, controller: Controller) -> str:
    """Return what our own logic does about a failure, in a sentence."""
    family = family_of(controller)
    said = _SAID[_LIKE.get(kind.identifier, kind.identifier)]
    text = said.get(family, said.get("other", "none that is known of this controller"))
    numbers: dict[str, object] = {"stopping": quantity(STOPPING, "s")}
    if isinstance(controller, LinearFeedback):
        follows = "the law's states follow what the drive gives"
        numbers |= {
            "hold": quantity(controller.hold_for, "s"),
            "fade": quantity(FADE, "s"),
            "windup": follows if controller.anti_windup else "static gains have nothing to wind up",
        }
    if isinstance(controller, VelocityFeedForward):
        fade = quantity(controller.fade, "s")
        numbers |= {"fade": fade, "trim": controller.position_gain}
    return text.format(**numbers)
