r"""The sampled loop of a recursive controller on the linear plant: its poles and its response.

::

    hook heave --> linear plant, load cell --> sampled every T --> recursion --> u, held over T --+
                        ^                                                                          |
                        +--------------------------------------------------------------------------+

The plant moves on between samples, the controller does not.  With plant, delays, the load
cell's filter and the controller's Jacobian at rest in one matrix, the loop is stable if its
eigenvalues lie within the unit circle.  Its answer to a sine is exact at the samples: only the
command is held, the hook's motion is not (K. J. Astrom and B. Wittenmark, Computer-Controlled
Systems, 3rd ed., chapter 2).

Controllers are checked with it when they are made.  Noise and limits are for the simulation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
import numpy.typing as npt
import scipy.linalg

from models.basics import ComplexArray, FloatArray, check_finite, pick
from models.case import Case
from models.plant import MEAN_LOSSES, LinearPlant, Plant, zero_order_hold
from models.sensing import HEARD, Measurement, Recursion

from .recursive import at_rest

PAYLOAD = ("payload.acceleration", "payload.velocity", "payload.displacement")
WINCH = ("drum.haul", "motor.speed", "motor.torque", "rope.tension")
REFERENCE = ("reference.displacement", "reference.velocity", "reference.acceleration")
HOOK = ("hook.heave", "hook.heave_rate")
SOURCES = ("hook.heave", "reference.displacement")
ON_CIRCLE = 1e-9  # an eigenvalue this far outside is a drum that integrates, not instability


@dataclass(frozen=True, kw_only=True, eq=False)
class SampledLoop:
    """The loop of a linear plant and a recursion; `sampled_loop` makes it from a case.

    Parameters
    ----------
    plant
        The plant; it measures the payload's three signals and has the winch's outputs.
    recursion
        The controller; it is at rest after one sample of `rest`.
    rest
        What is measured at rest.
    sample_time
        T [s].
    load_cell_bandwidth
        First-order bandwidth of the tension signal [rad/s], inf for none.
    mru_delay
        Delay of the hook's measured heave [s].
    mru_corner
        Corner of the second-order Butterworth high-pass on it [rad/s], 0 for none.

    Notes
    -----
    Delays of the payload's signals are rounded up to whole samples.
    """

    plant: LinearPlant
    recursion: Recursion
    rest: Measurement
    sample_time: float
    load_cell_bandwidth: float = math.inf
    mru_delay: float = 0.0
    mru_corner: float = 0.0

    @cached_property
    def matrix(self) -> FloatArray:
        """What one sample does to (the world's states, the controller's)."""
        w, c = self._world, self._controller
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

    def response(
        self, source: str, outputs: Sequence[str], omega: npt.ArrayLike
    ) -> dict[str, ComplexArray]:
        """Return outputs at the samples per unit of a sine, (k,) each, by name.

        Parameters
        ----------
        source
            ``hook.heave`` or ``reference.displacement``; its rates follow of themselves.
        outputs
            Performance outputs of the plant by name.
        omega
            Angular frequencies, (k,) [rad/s].

        Raises
        ------
        InputError
            If a name is unknown.
        """
        pick("sampled loop", "source", SOURCES, (source,))
        rows = pick("sampled loop", "output", self.plant.outputs, list(outputs))
        points = check_finite("sampled loop", "omega", omega).reshape(-1)
        found = np.array([self._answer(source, rows, 1j * w) for w in points])
        return {name: found[:, i] for i, name in enumerate(outputs)}

    def _answer(self, source: str, rows: list[int], s: complex) -> ComplexArray:
        """Solve e^{sT} v = matrix v + what the sine e^{st} puts in during one sample."""
        w, c, T = self._world, self._controller, self.sample_time
        hook = np.array([1.0, s]) if source == "hook.heave" else np.zeros(2, dtype=np.complex128)
        measured = w.hook_measured @ hook
        corner = self.mru_corner
        shown = np.exp(-s * self.mru_delay)
        if corner > 0.0:
            shown *= s**2 / (s**2 + math.sqrt(2.0) * corner * s + corner**2)
        for name, value in zip(("mru.heave", "mru.heave_rate"), hook, strict=True):
            measured[HEARD.index(name)] = value * shown
        if source != "hook.heave":
            for power, name in enumerate(REFERENCE):
                measured[HEARD.index(name)] = s**power
        # The integral of exp(A (T - t)) E hook e^{st} dt, by one exponential.
        n = w.continuous.shape[0]
        driven = np.zeros((n + 1, n + 1), dtype=np.complex128)
        driven[:n, :n], driven[:n, n], driven[n, n] = w.continuous, w.E @ hook, s
        moved = w.hook_late @ hook + w.B[:, 0] * (c.on_measured @ measured)
        moved[:n] += scipy.linalg.expm(driven * T)[:n, n]
        into = np.concatenate([moved, c.into_measured @ measured])
        state = np.linalg.solve(np.exp(s * T) * np.eye(into.size) - self.matrix, into)
        x, last_command = state[: self.plant.A.shape[0]], state[w.A.shape[0] - 1]
        p = self.plant
        hook_on = [p.disturbances.index(name) for name in HOOK]
        result = p.Cz[rows] @ x + p.Dz[rows, 0] * last_command + p.Fz[np.ix_(rows, hook_on)] @ hook
        return np.asarray(result, dtype=np.complex128)

    @cached_property
    def _controller(self) -> _Jacobians:
        """The controller linearised at rest."""
        f = self.recursion.function
        xc, m = ca.SX.sym("xc", f.numel_in(0)), ca.SX.sym("m", f.numel_in(1))
        following, command = f(xc, m)
        # One sample at rest, as a controller may do without what it has not seen yet.
        settled = f(self.recursion.initial, self.rest.values)[0]
        blocks = [ca.jacobian(out, by) for out in (following, command) for by in (xc, m)]
        found = ca.Function("jacobians", [xc, m], blocks).call([settled, ca.DM(self.rest.values)])
        into_state, into_measured, on_state, on_measured = (
            np.asarray(block.full(), dtype=np.float64) for block in found
        )
        return _Jacobians(
            into_state=into_state,
            into_measured=into_measured,
            on_state=on_state,
            on_measured=on_measured,
        )

    @cached_property
    def _world(self) -> _World:
        """Plant, load cell, late measurements and the last command, over one sample."""
        p, T = self.plant, self.sample_time
        hook = [p.disturbances.index(name) for name in HOOK]
        winch = pick("sampled loop", "output", p.outputs, WINCH)
        payload = pick("sampled loop", "measurement", p.measurements, PAYLOAD)
        tension, cell = winch[-1], self.load_cell_bandwidth
        n = p.A.shape[0]
        A, B, E = p.A, p.B, p.E[:, hook]
        if math.isfinite(cell):  # one state more: the tension that the load cell shows
            A = np.block([[A, np.zeros((n, 1))], [cell * p.Cz[[tension]], np.array([[-cell]])]])
            B = np.vstack([B, cell * p.Dz[[tension]]])
            E = np.vstack([E, cell * p.Fz[np.ix_([tension], hook)]])
        Ad, Bd = zero_order_hold(A, B, T)
        late = math.ceil(max(p.delays, default=0.0) / T - 1e-9)
        size = len(A) + 3 * late + 1  # states, three signals for each sample of delay, u
        world = _World(
            continuous=A,
            E=E,
            A=scipy.linalg.block_diag(Ad, np.eye(3 * late, k=-3), np.zeros((1, 1))),
            B=np.vstack([Bd, np.zeros((3 * late, 1)), np.ones((1, 1))]),
            H=np.zeros((len(HEARD), size)),
            hook_measured=np.zeros((len(HEARD), 2), dtype=np.complex128),
            hook_late=np.zeros((size, 2), dtype=np.complex128),
        )
        place = {name: HEARD.index(name) for name in HEARD}
        world.H[place["drive.applied"], -1] = 1.0
        for name, row in zip(WINCH, winch, strict=True):
            if name == "rope.tension" and math.isfinite(cell):
                world.H[place[name], n] = 1.0
                continue
            world.H[place[name], :n], world.H[place[name], -1] = p.Cz[row], p.Dz[row, 0]
            world.hook_measured[place[name]] = p.Fz[row, hook]
        for i, (name, row) in enumerate(zip(PAYLOAD, payload, strict=True)):
            into, of_hook, at = (world.H, world.hook_measured, place[name])
            if late:
                world.H[at, len(A) + 3 * (late - 1) + i] = 1.0
                into, of_hook, at = world.A, world.hook_late, len(A) + i
            into[at, :n], into[at, -1], of_hook[at] = p.C[row], p.D[row, 0], p.F[row, hook]
        return world


@dataclass(frozen=True, kw_only=True, eq=False)
class _Jacobians:
    """xc_next = into_state xc + into_measured m; u = on_state xc + on_measured m."""

    into_state: FloatArray
    into_measured: FloatArray
    on_state: FloatArray
    on_measured: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class _World:
    """v_next = A v + B u and what the hook does; m = H v + hook_measured hook."""

    continuous: FloatArray
    E: FloatArray
    A: FloatArray
    B: FloatArray
    H: FloatArray
    hook_measured: ComplexArray
    hook_late: ComplexArray


def sampled_loop(
    case: Case,
    plant: Plant,
    recursion: Recursion,
    sample_time: float,
    *,
    drag: float = 0.0,
) -> SampledLoop:
    """Return the loop of a recursion on the linearised plant of a case.

    Parameters
    ----------
    case
        For load cell and motion reference unit.
    plant
        Its plant.
    recursion, sample_time
        The controller, and its T [s].
    drag
        Linear drag of the payload [N s/m]; none is the harder test of stability.
    """
    cell, mru = case.sensors.load_cell, case.sensors.mru
    period = mru.heave_filter_period if mru else None
    return SampledLoop(
        plant=plant.linearise(drag=drag),
        recursion=recursion,
        rest=at_rest(plant.operating_point(MEAN_LOSSES)),
        sample_time=sample_time,
        load_cell_bandwidth=cell.bandwidth if cell else math.inf,
        mru_delay=mru.delay if mru else 0.0,
        mru_corner=2.0 * math.pi / period if period else 0.0,
    )
