r"""The sampled loop of a recursive controller on the linear plant: its poles.

::

    +--> linear plant, load cell --> sampled every T --> recursion --> late u, held over T --+
    |                                                                                        |
    +----------------------------------------------------------------------------------------+

The plant moves on between samples, the controller does not.  With plant, delays, the load
cell's filter and the controller's Jacobian at rest in one matrix, the loop is stable if its
eigenvalues lie within the unit circle (K. J. Astrom and B. Wittenmark, Computer-Controlled
Systems, 3rd ed., chapter 2).

Controllers are checked with it when they are made.  Noise and limits are for the simulation.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import casadi as ca
import numpy as np
import scipy.linalg

from models.basics import ComplexArray, FloatArray, InputError, SynthesisError
from models.case import Case
from models.plant import MEAN_LOSSES, MEASUREMENTS, LinearPlant, Plant, zero_order_hold
from models.sensing import HEARD, LOAD, Measurement, Recursion, with_loads, with_sensors

from ..loop import LinearController
from .recursive import at_rest

WINCH = ("drum.haul", "motor.speed", "motor.torque", "rope.tension")
ON_CIRCLE = 1e-9  # an eigenvalue this far outside is a drum that integrates, not instability


@dataclass(frozen=True, kw_only=True, eq=False)
class SampledLoop:
    """The loop of a linear plant and a recursion; `sampled_loop` makes it from a case.

    Notes
    -----
    Delays of the payload's signals and of the command are rounded up to whole samples each.
    """

    #: The plant; it measures the payload's three signals and has the winch's outputs.
    plant: LinearPlant
    recursion: Recursion  #: The controller; it is at rest after one sample of `rest`.
    rest: Measurement  #: What is measured at rest.
    sample_time: float  #: T [s].
    #: First-order bandwidth of the tension signal [rad/s], inf for none.
    load_cell_bandwidth: float = math.inf
    #: Delay of the command [s], which the plant has in those of its measurements.
    command_delay: float = 0.0

    @cached_property
    def matrix(self) -> FloatArray:
        """What one sample does to (the world's states, the controller's)."""
        w, c = self.world, self.controller
        return np.block(
            [
                [w.A + w.B @ c.on_measured @ w.H, w.B @ c.on_state],
                [c.into_measured @ w.H, c.into_state],
            ]
        )

    def poles(self) -> ComplexArray:
        """Return the eigenvalues over one sample [-], inside the unit circle when stable."""
        return np.asarray(np.linalg.eigvals(self.matrix), dtype=np.complex128)

    @property
    def stable(self) -> bool:
        """Whether nothing grows; a drum whose position nobody holds may stay where it is."""
        return bool(np.abs(self.poles()).max() <= 1.0 + ON_CIRCLE)

    @cached_property
    def controller(self) -> Jacobians:
        """The controller linearised at rest."""
        f = self.recursion.function
        xc, m = ca.SX.sym("xc", f.numel_in(0)), ca.SX.sym("m", f.numel_in(1))
        following, command = f(xc, m)
        # One sample at rest, as a controller may do without what it has not seen yet.
        settled = f(self.recursion.initial, self.rest.values)[0]
        blocks = [ca.jacobian(out, by) for out in (following, command) for by in (xc, m)]
        found = ca.Function("jacobians", [xc, m], blocks).call([settled, ca.DM(self.rest.values)])
        return Jacobians(*(np.asarray(block.full(), dtype=np.float64) for block in found))

    @cached_property
    def world(self) -> World:
        """Plant, load cell, late measurements and the last command, over one sample."""
        p, T = self.plant, self.sample_time
        winch = [p.outputs.index(name) for name in WINCH]
        tension, cell = winch[-1], self.load_cell_bandwidth
        n = p.A.shape[0]
        A, B = p.A, p.B
        if math.isfinite(cell):  # one state more: the tension that the load cell shows
            A = np.block([[A, np.zeros((n, 1))], [cell * p.Cz[[tension]], np.array([[-cell]])]])
            B = np.vstack([B, cell * p.Dz[[tension]]])
        Ad, Bd = zero_order_hold(A, B, T)
        waits = self._samples(self.command_delay)
        late = {
            name: self._samples(delay - self.command_delay)
            for name, delay in zip(p.measurements, p.delays, strict=True)
            if name in MEASUREMENTS
        }
        # States, as many values of each signal and of the command as are on their way, and u.
        ends = np.cumsum([len(A), *late.values(), waits, 1]).tolist()
        size = ends[-1]
        world = World(
            continuous=A,
            A=np.zeros((size, size)),
            B=np.zeros((size, 1)),
            H=np.zeros((len(HEARD), size)),
        )
        world.A[: len(A), : len(A)] = Ad
        for start, end in itertools.pairwise(ends[:-1]):
            world.A[range(start + 1, end), range(start, end - 1)] = 1.0
        world.B[ends[-3]] = 1.0  # the command enters what is on its way, or is u at once
        if waits:
            world.A[-1, size - 2], world.A[: len(A), size - 2] = 1.0, Bd[:, 0]
        else:
            world.B[: len(A)] = Bd
        place = {name: HEARD.index(name) for name in HEARD}
        world.H[place["drive.applied"], ends[-3] if waits else -1] = 1.0  # the one asked for last
        for name, row in zip(WINCH, winch, strict=True):
            if name == "rope.tension" and math.isfinite(cell):
                world.H[place[name], n] = 1.0
                continue
            world.H[place[name], :n], world.H[place[name], -1] = p.Cz[row], p.Dz[row, 0]
        for i, (name, count) in enumerate(late.items()):
            row, into, at = p.measurements.index(name), world.H, place[name]
            if count:
                world.H[at, ends[i + 1] - 1] = 1.0
                into, at = world.A, ends[i]
            into[at, :n], into[at, -1] = p.C[row], p.D[row, 0]
        return world

    def _samples(self, delay: float) -> int:
        return math.ceil(delay / self.sample_time - 1e-9)


class Jacobians(NamedTuple):
    """xc_next = into_state xc + into_measured m; u = on_state xc + on_measured m."""

    into_state: FloatArray
    into_measured: FloatArray
    on_state: FloatArray
    on_measured: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class World:
    """v_next = A v + B u, m = H v; `continuous` is the matrix of plant and load cell."""

    continuous: FloatArray
    A: FloatArray
    B: FloatArray
    H: FloatArray


def sampled_loop(
    case: Case,
    plant: Plant,
    recursion: Recursion,
    sample_time: float,
    *,
    drag: float = 0.0,
    friction: float = 0.0,
) -> SampledLoop:
    """Return the loop of a recursion on the linearised plant of a case.

    The recursion is the controller, of sample time T [s]; the case gives the sensors.  `drag` is
    the linear drag of the payload [N s/m]; none is the harder test of stability.  `friction` is
    viscous friction at the motor, beside its own [N m s/rad].
    """
    cell, waits = case.sensors.load_cell, case.winch.drive.command_delay
    linear = plant.linearise(drag=drag)
    if friction > 0.0:
        linear = with_loads(linear, plant.data).with_element("motor.speed", LOAD, -friction)
    sensed = with_sensors(linear, case.sensors, waits)
    return SampledLoop(
        plant=sensed.select(measurements=MEASUREMENTS).with_held_states(),
        recursion=recursion,
        rest=at_rest(plant.operating_point(MEAN_LOSSES)),
        sample_time=sample_time,
        load_cell_bandwidth=cell.bandwidth if cell else math.inf,
        command_delay=waits,
    )


Matrices = tuple[FloatArray, FloatArray, FloatArray, FloatArray]

_OWNER = "linear feedback"
_SLOWEST = 0.5  # frequencies above which a controller's gains are compared [rad/s]


def sampled(controller: LinearController, sample_time: float) -> Matrices:
    """Return (A, B, C, D) of a controller sampled every `sample_time` T [s].

    By Tustin's rule, s = k (z - 1)/(z + 1) with k = 2/T.  The controller is x' = A x + B y, u = C x
    + D y.

    Raises InputError if k is an eigenvalue of its A.
    """
    A, B, C, D = controller.A, controller.B, controller.C, controller.D
    n = len(A)
    k = 2.0 / sample_time
    if n and np.abs(np.linalg.eigvals(A) - k).min() < 1e-9 * k:
        raise InputError(
            f"{_OWNER}: sample_time must be another one: the controller has "
            f"a pole at {k:.6g} 1/s, which Tustin's rule maps to infinity"
        )
    inverse = np.linalg.inv(np.eye(n) - A / k)
    Bd = sample_time * inverse @ B
    return inverse @ (np.eye(n) + A / k), Bd, C @ inverse, D + 0.5 * C @ Bd


def tracking_gain(matrices: Matrices, sample_time: float) -> FloatArray:
    """Return the gain K_b, (n, 1), of anti-windup by back-calculation.

    x+ = A x + B e + K_b (u_applied - u_asked), u_asked = C x + D e: while the drive has its own
    way A - K_b C rules.  K_b is the gain of a Kalman filter, hence that matrix is stable for
    every controller whose lasting states reach its output.  The noise of each e is one that, on
    its own, moves u by one unit above 0.5 rad/s, and that of the drive's answer is one unit.

    `matrices` are A, B, C, D of the controller with one output, sampled every `sample_time` [s].

    Raises SynthesisError if a state that does not decay is not seen at the output or not reached
    from e.
    """
    A, B, C, D = matrices
    n = len(A)
    omega = np.geomspace(min(_SLOWEST, 0.5 * math.pi / sample_time), math.pi / sample_time, 60)
    z = np.exp(1j * omega * sample_time)
    try:
        inside = z[:, None, None] * np.eye(n) - A
        inner = np.linalg.solve(inside, np.broadcast_to(B, (z.size, *B.shape)))
        size = np.abs(C @ inner + D).max(axis=(0, 1))
        noise = B / np.where(size > 0.0, size, 1.0)
        P = scipy.linalg.solve_discrete_are(A.T, C.T, noise @ noise.T, np.eye(1))
        gain = A @ P @ C.T / (1.0 + C @ P @ C.T)
        if not float(np.abs(np.linalg.eigvals(A - gain @ C)).max()) < 1.0:
            raise np.linalg.LinAlgError("the gain does not stabilise")
    except (np.linalg.LinAlgError, ValueError) as error:
        raise SynthesisError(
            f"{_OWNER}: no anti-windup holds this controller: a state that does not decay is not "
            "seen at its output or not reached by what it hears; leave such states out, or set "
            "anti_windup to False"
        ) from error
    return np.asarray(gain, dtype=np.float64)
