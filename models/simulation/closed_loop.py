r"""One sample of plant, sensors, drive and brake as one recursion, in CasADi symbols.

                 row: motions, noise, telemetry, engage, brake
                                  |
    state s --> sensors --> m --> controller --> u --> drive, plant: n steps --> state s'
                                  |                        |
                          (or from Python)                 +--> log

Everything that feeds back within a sample is in here, so that compiled code and CasADi's virtual
machine compute the same numbers; everything that does not (the motion of the hook, noise, which
message of the telemetry arrives) is drawn in advance and comes in as a row
(`models.simulation.rows`). `models.simulation.simulate` runs the recursion.

The controller either is part of it, or is called in between: then the recursion falls in two,
`measure` and `advance`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import casadi as ca
import numpy as np

from ..basics import FloatArray
from ..case import Case
from ..plant import MOTION, Plant, late_hold
from ..sensing import Recursion, SensorModel
from .integrate import StepChoice, braked_step, disturbances
from .rows import FLAGS

HOOK = "hook"
STATUS = "controller.status"
_SATURATED = 1e-9  # relative difference of asked and applied command that is no rounding [-]
_OWN = (
    "drive.hold",
    "brake.torque",
    "motor.continuous_torque",
    "motor.cooled_speed",
    "motor.rated_rise",
    "motor.share",
)
_NEVER = 1e12  # a speed that no motor reaches [rad/s]
_FROM_ROW = {
    "payload.age": "telemetry.age",
    "payload.valid": "telemetry.valid",
    "reference.displacement": "reference.displacement",
}
_UNITS = {
    "hook.heave": "m",
    "hook.heave_rate": "m/s",
    "motor.power": "W",
    "motor.temperature": "K",
    "payload.age": "s",
    "reference.displacement": "m",
}


@dataclass(frozen=True, kw_only=True, eq=False)
class LoopRecursion:
    """The recursion of a closed loop and the names of all that goes through it."""

    #: (s, r, p) -> (s', log), with the controller inside; or, for a controller in Python, (s, r, p)
    #: -> (s', m) and (s, [r, u], p) -> (s', log), one after the other a sample.
    functions: tuple[ca.Function, ...]
    #: Names of s and the log.
    states: tuple[str, ...]
    signals: tuple[str, ...]
    #: Names of what moves, the hook first; of each the row holds displacement, velocity and
    #: acceleration at the ends of every integration step.
    motions: tuple[str, ...]
    units: Mapping[str, str]  #: Unit of each signal of the log.
    parameters: Mapping[str, float]  #: Names and values of p.
    step: StepChoice  #: The integration step and what set it.
    sample_time: float  #: The controller's [s].
    initial: FloatArray  #: State at rest.


def build_closed_loop(
    case: Case,
    plant: Plant,
    sensors: SensorModel,
    *,
    step: StepChoice,
    parameters: Mapping[str, float],
    start: FloatArray,
    hold: float,
    recursion: Recursion | None = None,
    with_status: bool = False,
) -> LoopRecursion:
    """Return the recursion of one control sample.

    Parameters
    ----------
    case
        For the thermal and the brake's data.
    plant
        The plant with its drive limits; its first disturbances are hook.heave and
        hook.heave_rate.
    sensors
        What the controller sees of it.
    step
        Integration step; its sample time is the controller's.
    parameters
        Values of the plant's parameters by name.
    start
        State of the plant at rest (nx,).
    hold
        Command that holds the load at rest, which an engaging controller is ramped in from.
    recursion
        The controller, if it is one.
    with_status
        Whether the log has the controller's status: one from Python gives it after its command.
    """
    waiting, share = late_hold(case.winch.drive.command_delay / step.sample_time)
    sends = waiting + 1 if waiting else 0  # what is remembered: up to what acted last
    motions = (HOOK, *dict.fromkeys(name.split(".")[0] for name in plant.disturbances[4:]))
    nx, ns = len(plant.states), len(sensors.states)
    begin = np.zeros(0) if recursion is None else recursion.initial
    names = (
        *(f"plant.{name}" for name in plant.states),
        *(f"sensor.{name}" for name in sensors.states),
        *(f"drive.command.{j}" for j in range(sends)),
        "drive.last_command",
        "motor.temperature",
        *(f"controller.{i}" for i in range(begin.size)),
    )
    width = 3 * len(motions)
    ends = width * (step.substeps + 1)  # numbers of all motions at the ends of every step
    columns = ends + len(sensors.row) + len(FLAGS)
    values = {**parameters, **own_parameters(case, step.sample_time, hold)}

    # Many steps as calls of one function compile many times faster than written out, and run
    # faster too; one or two are faster written out.
    # (The two kinds of symbol have the same methods; the type of one stands for both.)
    kind = cast("type[ca.SX]", ca.SX if step.substeps <= 2 else ca.MX)
    s, r = kind.sym("s", len(names)), kind.sym("r", columns)
    p, asked = kind.sym("p", len(values)), kind.sym("u", 1 + with_status)
    drive = nx + ns + sends  # where the last command is that the drive was told
    x, of_sensors, of_controller = s[:nx], s[nx : nx + ns], s[drive + 2 :]
    on_the_way, last, rise = s[nx + ns : drive], s[drive], s[drive + 1]
    moved, sensed, flags = r[:width], r[ends : ends + len(sensors.row)], r[-len(FLAGS) :]

    look = _look(plant, sensors, tuple(values), len(motions))
    logged, signals = _log(plant, sensors, tuple(values), len(motions))
    signals = (*signals, STATUS) if with_status else signals
    one_step = braked_step(plant, tuple(values), len(motions), step.step)
    raw, applied = look(x, last, moved, p)

    def arriving(sent: Sequence[ca.SX] | ca.SX) -> ca.SX:
        """Return the mean of what arrives within a sample, of commands up to it, newest first."""
        return share * sent[waiting] + (1.0 - share) * sent[waiting - 1]

    # What the drive has left out of a command that was on its way is told of the one asked for
    # last: a controller that compares the two must not take the delay for a limit.
    # (A drive that is not engaged follows none: it has left out all.)
    late = on_the_way[0] - arriving(on_the_way) if waiting else 0.0
    seen, m = sensors.function(of_sensors, raw, sensed, applied + late)

    def sample(asked: ca.SX, seen: ca.SX, controller: ca.SX) -> list[ca.SX]:
        """Return the state after the sample and the log at its start."""
        command = asked[0]
        sent = [command, *(ca.vertsplit(on_the_way) if waiting else ())]
        told = arriving(sent) if waiting else command
        u, warmer, log = logged(x, told, rise, moved, sensed, flags, p)
        after = x
        for j in range(step.substeps):
            both = r[j * width : (j + 2) * width]
            after = one_step(after, u, both, flags[FLAGS.index("brake")], p)
        state = ca.vertcat(after, seen, *sent[:sends], u, warmer, controller)
        return [state, ca.vertcat(log, asked[1]) if with_status else log]

    # With the controller inside nothing leaves the recursion in a sample; otherwise it is cut where
    # the measurement goes out and the command comes in.
    functions: tuple[ca.Function, ...]
    if recursion is not None:
        # The sensors see the plant before the command: a command acts on the sample it is made in.
        following, command = recursion.function(of_controller, m)
        if with_status and recursion.status is not None:
            command = ca.vertcat(command, following[recursion.status])
        functions = (_function("sample", [s, r, p], sample(command, seen, following)),)
    else:
        given = [s, ca.vertcat(r, asked), p]
        functions = (
            _function("measure", [s, r, p], [ca.vertcat(x, seen, s[nx + ns :]), m]),
            _function("advance", given, sample(asked, of_sensors, of_controller)),
        )
    numbers = np.array(list(values.values()))
    at_rest = look(start, hold, np.zeros(width), numbers)[0]
    units = {**plant.units, **_UNITS, "drive.command": plant.units["drive.command"]}
    return LoopRecursion(
        functions=functions,
        states=names,
        signals=signals,
        motions=motions,
        units={name: units.get(name, "-") for name in signals},
        parameters=values,
        step=step,
        sample_time=step.sample_time,
        initial=np.concatenate(
            [
                start,
                sensors.initial(np.asarray(at_rest).ravel()),
                [*(hold,) * sends, hold, 0.0],
                begin,
            ]
        ),
    )


def _look(plant: Plant, sensors: SensorModel, names: Sequence[str], motions: int) -> ca.Function:
    """Return (x, u, moved, p) -> what the sensors take from the plant, and the command applied.

    The motor is still at the last command when the next is thought about.
    """
    x, u = ca.SX.sym("x", len(plant.states)), ca.SX.sym("u")
    moved, p = ca.SX.sym("moved", 3 * motions), ca.SX.sym("p", len(names))
    _, y, z = plant.function(x, u, disturbances(moved), p[: len(plant.parameters)])
    signals = _named(plant.outputs, z) | {"motor.angle": x[plant.states.index("motor.angle")]}
    signals |= {f"measured.{end}": y[i] for i, end in enumerate(reversed(MOTION))}
    raw, applied = ca.cse([sensors.raw(signals), signals["drive.applied"]])
    return ca.Function("look", [x, u, moved, p], [ca.densify(raw), ca.densify(applied)])


def _log(
    plant: Plant, sensors: SensorModel, names: Sequence[str], motions: int
) -> tuple[ca.Function, tuple[str, ...]]:
    """Return (x, asked, rise, moved, sensed, flags, p) -> (u, warmer, log), and the log's names.

    What the drive is told, the motor's temperature after the sample, and what is worth knowing
    at the sample's start.
    """
    x, asked, rise = ca.SX.sym("x", len(plant.states)), ca.SX.sym("asked"), ca.SX.sym("rise")
    moved, p = ca.SX.sym("moved", 3 * motions), ca.SX.sym("p", len(names))
    sensed, flags = ca.SX.sym("sensed", len(sensors.row)), ca.SX.sym("flags", len(FLAGS))
    p_of, flag = _named(names, p), _named(FLAGS, flags)
    u = p_of["drive.hold"] + flag["engaged"] * (asked - p_of["drive.hold"])
    _, _, z = plant.function(x, u, disturbances(moved), p[: len(plant.parameters)])
    now = _named(plant.outputs, z)
    # The continuous torque falls as 1/speed above the speed up to which it holds.
    fast = ca.fmax(1.0, ca.fabs(now["motor.speed"]) / p_of["motor.cooled_speed"])
    loss = (fast * now["motor.torque"] / p_of["motor.continuous_torque"]) ** 2
    warmer = rise + p_of["motor.share"] * (p_of["motor.rated_rise"] * loss - rise)
    cut = ca.fabs(u - now["drive.applied"])
    log = {
        "hook.heave": moved[0],
        "hook.heave_rate": moved[1],
        **now,
        "drive.command": u,
        "drive.saturated": cut > _SATURATED * (ca.fabs(u) + ca.fabs(now["drive.applied"])),
        "motor.power": now["motor.torque"] * now["motor.speed"],
        "motor.temperature": rise,
        **{name: sensed[sensors.row.index(column)] for name, column in _FROM_ROW.items()},
        "brake.on": flag["brake"],
        "engaged": flag["engaged"] * sensed[sensors.row.index("operator.enable")],
    }
    outputs = [ca.densify(v) for v in ca.cse([u, warmer, ca.vertcat(*log.values())])]
    return ca.Function("log", [x, asked, rise, moved, sensed, flags, p], outputs), tuple(log)


def _named(names: Sequence[str], values: ca.SX) -> dict[str, ca.SX]:
    return dict(zip(names, ca.vertsplit(values), strict=True))


def _function(name: str, inputs: list[ca.SX], outputs: list[ca.SX]) -> ca.Function:
    """Return the function with common subexpressions computed once, all outputs dense."""
    dense = [ca.densify(value) for value in ca.cse(outputs)]
    return ca.Function(name, inputs, dense, ["s", "r", "p"], ["s_next", "out"])


def own_parameters(case: Case, sample_time: float, hold: float) -> dict[str, float]:
    """Return the parameters of command, brake and motor that come after the plant's, by name."""
    motor, brake = case.winch.motor, case.winch.brake
    capacity = None if brake is None else brake.torque
    # "holds whatever comes": ten times the largest torque that motor or static load can make
    strongest = max(case.winch.drive.torque_peak, case.static_torque)
    values = (
        hold,
        10.0 * strongest if capacity is None else capacity,
        case.winch.drive.torque_continuous,
        min(case.winch.cooled_speed, _NEVER),
        motor.temperature_rise,
        -np.expm1(-sample_time / motor.thermal_time_constant),
    )
    return dict(zip(_OWN, (float(value) for value in values), strict=True))
