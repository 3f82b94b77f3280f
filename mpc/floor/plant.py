r"""The plant of a whole record: linear, sampled, in the coordinates of a payload held still.

    case --> linear plant --> one sample, exactly --> RecordPlant --> `mpc.floor.qp`

What the controllers command and what the drive makes of it differ by the drive's limits, so the
plant's input here is the torque that the drive is asked for (the demand), where the limits are
straight lines.  Two ways to hold it over a sample:

* ``line``: the demand is any straight line over each sample, with jumps between them.  That holds
  everything that a drive can do with commands held per sample, saturated or not, but for a bend
  within a sample, so the optimum is a floor;
* ``command``: the command (voltage, speed or torque) is held and the limits are kept at both ends
  of the sample.  A drive can follow it to the letter, but a saturated one can do more: a held
  voltage loses torque as the motor speeds up, and the drive at its limit does not.

The hook moves between samples by cubic Hermite interpolation of displacement and velocity, for
which the sampled plant is exact.

The limits are those of `models.plant.drive`, and convex as they stand: peak torque and current,
armature voltage (a line in torque and speed), and the band below the highest speed in which the
driving torque closes.  Only constant power, |torque| <= power/|speed|, is not: the hyperbola is
replaced by its chord from the base speed to the end of the speed band, the convex hull, which
allows more.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy.linalg

from models.basics import FloatArray, InputError, ReadOnlyArrays
from models.case import Case
from models.plant import (
    MEAN_LOSSES,
    SPEED_BAND,
    DriveLimits,
    LinearPlant,
    Plant,
    PlantData,
    build_plant,
)

from ..winch import command_law

Hold = Literal["line", "command"]
HOLDS: tuple[Hold, ...] = ("line", "command")

_OWNER = "clairvoyant"
_SENSORS = ("sensor", "telemetry")  # their states move nothing


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordPlant(ReadOnlyArrays):
    r"""x[k+1] = Phi x[k] + Gamma i[k] + Psi (z, z', at k and k+1), and rows that limit it.

    The demand d is the whole one, the static part included, in units of the peak torque; states
    are deviations from rest, drum and motor as haul [m] and haul rate [m/s], the rest in metres,
    metres a second and peak torques.
    """

    sample_time: float  #: [s].
    #: What an input is: ``line``, demand at both ends of the sample (m = 2), or ``command``, the
    #: command's deviation that is held (m = 1, in units of demand at rest).
    hold: Hold
    #: Names, (n,); matrices (n, n), (n, m), (n, 4).
    states: tuple[str, ...]
    Phi: FloatArray
    Gamma: FloatArray
    Psi: FloatArray
    scale: FloatArray  #: State of `models.plant.linear.LinearPlant` = scale * state here, (n,).
    feedback: FloatArray  #: Of ``command``: demand = static demand + input - feedback . x, (n,).
    command_gain: float  #: Demand per command, [N m per unit of the command].
    #: Command per state at a given demand, (n,), and the same for both holds.
    command_feedback: FloatArray
    #: Rows that give payload displacement [m] and motor speed [rad/s], (n,).
    payload: FloatArray
    speed: FloatArray
    #: (coefficient of the demand, row of states (n,)) of the motor's torque in peak torques.
    torque: tuple[float, FloatArray]
    #: Rows (on demand, on motor speed) with \|.\| <= 1, (nwin, 2): torque, speed, power, breakdown,
    #: voltage.
    windows: FloatArray
    window_names: tuple[str, ...]
    #: Rows of the tensions that must not vanish, (nt, n), and of (z, z'), (nt, 2) [N].
    tensions: FloatArray
    tension_feed: FloatArray
    static_tensions: FloatArray  #: Those at rest, (nt,) [N].
    peak: float  #: Peak torque [N m].
    #: Demand [peak torques] and command at rest.
    static_demand: float
    static_command: float
    #: Index of a motor's own state (current or torque of a drive that is not at once), or -1.
    motor_state: int
    #: Motor state that moves the drum with the hook's (z, z', z''), (3,), zero without one.
    needed: FloatArray
    drag: float  #: Linear drag coefficient [N s/m].

    @property
    def inputs(self) -> int:
        """Number of inputs of a sample."""
        return int(self.Gamma.shape[1])

    def still(self, z: FloatArray, v: FloatArray, a: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return states (N+1, n) and inputs (N, m) that hold the payload still.

        The drum moves against the hook, and the inputs are those that do it best over each
        sample.  What is left is friction, which bends the demand, and a motor's lag.
        """
        x = np.zeros((len(z), len(self.states)))
        x[:, self.states.index("motor.angle")] = -z
        x[:, self.states.index("motor.speed")] = -v
        if self.motor_state >= 0:
            x[:, self.motor_state] = np.stack([z, v, a], axis=1) @ self.needed
        missing = x[1:] - x[:-1] @ self.Phi.T - self.hook_terms(z, v)
        return x, missing @ np.linalg.pinv(self.Gamma).T

    def hook_terms(self, z: FloatArray, v: FloatArray) -> FloatArray:
        """Return what the hook adds over each sample, (N, n), from its motion (N+1,)."""
        ends = np.stack([z[:-1], v[:-1], z[1:], v[1:]], axis=1)
        return np.asarray(ends @ self.Psi.T)

    def demand(self, states: FloatArray, inputs: FloatArray, end: int) -> FloatArray:
        """Return the demand at the start (0) or the end (1) of every sample, (N,)."""
        if self.hold == "line":
            return self.static_demand + inputs[:, end]
        at = states[end : end + len(inputs)]
        return np.asarray(self.static_demand + inputs[:, 0] - at @ self.feedback)

    def levels(self, states: FloatArray, inputs: FloatArray) -> FloatArray:
        """Return the window rows' values at both ends of every sample, (N, 2, nwin)."""
        speed, N = states @ self.speed, len(inputs)
        ends = [
            np.stack([self.demand(states, inputs, end), speed[end : end + N]], axis=1)
            for end in (0, 1)
        ]
        return np.asarray(np.stack(ends, axis=1) @ self.windows.T)

    def commands(self, states: FloatArray, demand: FloatArray) -> FloatArray:
        """Return the drive's command [its unit] that asks for a demand in a state."""
        asked = (demand - self.static_demand) * self.peak / self.command_gain
        return np.asarray(self.static_command + asked + states @ self.command_feedback)


def record_plant(
    case: Case,
    *,
    sample_time: float,
    drag: float,
    masses: int | None = None,
    limits: DriveLimits | None = None,
    hold: Hold = "line",
) -> RecordPlant:
    """Return the sampled plant of a case, its rope as `PlantData.viscous`.

    Times are in s, the payload's linear drag coefficient in N s/m.

    Raises InputError if the drive has no finite peak torque or cannot hold the load.
    """
    limits = DriveLimits.from_case(case) if limits is None else limits
    plant = build_plant(PlantData.from_case(case).viscous, masses)
    linear, rest, data = plant.linearise(drag=drag), plant.operating_point(MEAN_LOSSES), plant.data
    peak = min(limits.torque, data.torque_constant * limits.current)
    if not math.isfinite(peak):
        raise InputError(f"{_OWNER}: the drive must have a finite peak torque or current")
    if abs(rest.torque) > peak:
        raise InputError(
            f"{_OWNER}: the peak torque must be at least the static torque, "
            f"{abs(rest.torque):.4g} N m, got {peak:.4g} N m: the motor cannot hold the load"
        )
    keep = [i for i, name in enumerate(linear.states) if name.partition(".")[0] not in _SENSORS]
    names = tuple(linear.states[i] for i in keep)
    hook = [linear.disturbances.index(name) for name in ("hook.heave", "hook.heave_rate")]
    n, per_haul = len(keep), data.gear_ratio / data.drum_radius
    scale = np.ones(n)
    scale[[names.index("motor.angle"), names.index("motor.speed")]] = per_haul
    lag = next((names.index(s) for s in ("motor.current", "motor.torque") if s in names), -1)
    if lag >= 0:
        scale[lag] = peak / data.torque_constant
    # command = demand/gain + feedback . state, whatever the motor
    gain, slope = command_law(plant)
    regulated = np.zeros(n)
    regulated[names.index("motor.speed")] = slope * per_haul
    A = linear.A[np.ix_(keep, keep)] * scale / scale[:, None]
    B = linear.B[keep, 0] / scale * peak / gain
    E = linear.E[np.ix_(keep, hook)] / scale[:, None]
    back = regulated * gain / peak
    # A held command lets the demand fall with the speed, which is in A; a demand that is a straight
    # line whatever the speed does has that taken out.
    Phi, Gamma, Psi = _sampled(
        A + np.outer(B, back) if hold == "line" else A, B, E, sample_time, hold
    )
    speed = np.zeros(n)
    speed[names.index("motor.speed")] = per_haul
    payload = np.zeros(n)
    payload[names.index("payload.displacement")] = 1.0
    tensions, feed, static = _tensions(plant, linear, keep, hook, scale, rest.tension)
    windows = _windows(plant, limits, peak)
    needed, torque = np.zeros(3), (1.0, np.zeros(n))
    if lag >= 0:
        row, push = A[names.index("motor.speed")], A[names.index("motor.speed"), lag]
        moved = E[names.index("motor.speed")]
        needed = -np.array([moved[0] - row[0], moved[1] - row[1], 1.0]) / push
        torque = (0.0, np.eye(n)[lag])
    return RecordPlant(
        sample_time=sample_time,
        hold=hold,
        states=names,
        Phi=Phi,
        Gamma=Gamma,
        Psi=Psi,
        scale=scale,
        feedback=back,
        command_gain=gain,
        command_feedback=regulated,
        payload=payload,
        speed=speed,
        torque=torque,
        windows=np.array([row for _, row in windows]),
        window_names=tuple(name for name, _ in windows),
        tensions=tensions,
        tension_feed=feed,
        static_tensions=static,
        peak=peak,
        static_demand=rest.torque / peak,
        static_command=rest.command,
        motor_state=lag,
        needed=needed,
        drag=drag,
    )


def _sampled(
    A: FloatArray, B: FloatArray, E: FloatArray, dt: float, hold: Hold
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return Phi, Gamma and Psi by one exponential, input and hook as chains of integrators."""
    n, m = len(A), 2 if hold == "line" else 1
    M = np.zeros((n + m + 4, n + m + 4))
    M[:n, :n], M[:n, n] = A, B
    if hold == "line":
        M[n, n + 1] = 1.0 / dt
    hook = n + m
    M[:n, hook : hook + 2] = E  # heave and its rate: the first two of the chain z, z', z'', z'''
    M[range(hook, hook + 3), range(hook + 1, hook + 4)] = 1.0
    X = scipy.linalg.expm(M * dt)
    Gamma = X[:n, n:hook]
    if hold == "line":  # from (start, rise) to (start, end)
        Gamma = np.stack([Gamma[:, 0] - Gamma[:, 1], Gamma[:, 1]], axis=1)
    ends = np.array(
        [[1, 0, 0, 0], [0, 1, 0, 0], [1, dt, dt**2 / 2, dt**3 / 6], [0, 1, dt, dt**2 / 2]]
    )
    return X[:n, :n], Gamma, X[:n, hook:] @ np.linalg.inv(ends)


def _windows(
    plant: Plant, limits: DriveLimits, peak: float
) -> list[tuple[str, tuple[float, float]]]:
    """Return rows (on demand in peaks, on motor speed) whose size is at most one, by name."""
    data = plant.data
    rows = [("torque", (1.0, 0.0))]
    if math.isfinite(limits.speed):
        band = SPEED_BAND * limits.speed
        # |d + speed/band| <= top/band: the driving side closes over the band
        rows.append(("speed", (band / limits.speed, 1.0 / limits.speed)))
        end, base = limits.speed + band, limits.power / peak
        chords = [("power", base, limits.power / end)]
        chords.append(("breakdown", math.sqrt(limits.breakdown / peak), limits.breakdown / end**2))
        for name, start, least in chords:
            if start < end:  # the curve from `start` on is convex, so it lies below its chord
                slope = (1.0 - least / peak) / (end - start)
                reach = 1.0 + slope * start  # |d| + slope |speed| <= reach
                rows += [(name, (1.0 / reach, sign * slope / reach)) for sign in (1.0, -1.0)]
    if data.motor == "dc" and math.isfinite(limits.voltage):
        drop = data.resistance / data.torque_constant * peak
        row = (drop / limits.voltage, data.back_emf_constant / limits.voltage)
        rows.append(("voltage", row))
    return rows


def _tensions(
    plant: Plant,
    linear: LinearPlant,
    keep: list[int],
    hook: list[int],
    scale: FloatArray,
    top_at_rest: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return rows of the lowest spring's tension and of that at the drum, of all falls [N]."""
    top, falls = linear.outputs.index("rope.tension"), plant.data.falls
    row, feed = falls * linear.Cz[top, keep] * scale, falls * linear.Fz[top, hook]
    chain, shifts = plant.chain, plant.displacements
    lowest = chain[-1]
    if len(chain) == 1:  # one spring: what it carries is less than at the drum by a constant
        carried = plant.data.mean_sheaves_factor * float(lowest.carried)
        return row[None], feed[None], np.array([carried])
    names = [linear.states[i] for i in keep]
    k, tau = float(lowest.stiffness), float(lowest.damping_time)
    lower = np.zeros(len(keep))
    for name, sign in ((shifts[-2], 1.0), (shifts[-1], -1.0)):
        lower[names.index(name)] = k * sign
        lower[names.index(name.replace("displacement", "velocity"))] = k * tau * sign
    static = np.array([float(lowest.carried), falls * top_at_rest])
    return np.stack([lower, row]), np.stack([np.zeros(2), feed]), static
