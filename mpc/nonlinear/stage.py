r"""One sample of the nonlinear winch, `Stage`: the exact linear part, and forces beside it.

.. math::

    x_{j+1} &= A x_j + B d_j + \Gamma_w w_j + \Gamma_c c + F n_j, \\
    y_j &= C x_j + D d_j + C_w w_j + C_c c + O n_j + y_{rest}, \qquad n_j = \varphi(y_j) .

A rope of fifteen masses has axial modes up to 60 rad/s, and yet next to nothing of it is nonlinear:
the drag of the payload, the tension of a rope that goes slack, the losses of the gear
(`mpc.nonlinear.nonlinear_forces`).  So the linear plant is sampled exactly, by its matrix
exponential, and the forces n that it lacks are held over a share of a sample at their value in its
middle, where the few numbers y decide on them: the implicit midpoint rule for the nonlinear part
alone, of second order and stable however stiff the rope is.  phi with its derivative is one CasADi
function that is mapped over the horizon and compiled where there is a compiler.

What is approximated: springs between the first and the last can push, unless asked for; a rope
does not get longer or heavier by the layers of its drum; losses change sides over 2 rad/s of the
motor; and what the drive cuts within a sample does not change its mean torque
(`mpc.nonlinear.mean_torque`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
import scipy.linalg

from models.basics import FloatArray, InputError, ReadOnlyArrays, SolverError, check_range
from models.plant import DrumTravel, zero_order_hold
from models.simulation import Kernel

from ..programme import hermite_within
from ..winch import SampledWinch
from .mean_torque import Drift, mean_torque
from .nonlinear_forces import ForceLaw, force_law

_OWNER = "nonlinear predictive control"
_NEWTON = 50  # iterations for the forces of one sample
_EXACT = 1e-12  # of those forces, over the static tension
_NOTHING = np.zeros(0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Stage(ReadOnlyArrays):
    """One sample of M sub-steps, m forces and my arguments; `make_stage` makes it.

    Attributes
    ----------
    winch
        The sampled linear winch, whose input is the mean torque of a sample if so asked for.
    drift
        The torque at the start over that mean.
    law
        The forces.
    pairs
        Which force depends on which argument, positions in n and y.
    rest
        y of a load that hangs at rest, (my,).
    substeps
        M.
    from_forces
        F, (n, M m).
    C, D, C_hook, C_constants, own
        y in the middle of each sub-step, less that at rest, of the state at the start of the
        sample, the input, the hook's (z, z') at both ends of the sample, the constants and the
        forces of the sample: (M my, n), (M my,), (M my, 4), (M my, 2), (M my, M m).
    kernel
        What evaluates forces and derivatives.
    """

    winch: SampledWinch
    drift: Drift
    law: ForceLaw
    pairs: tuple[tuple[int, int], ...]
    rest: FloatArray
    substeps: int
    from_forces: FloatArray
    C: FloatArray
    D: FloatArray
    C_hook: FloatArray
    C_constants: FloatArray
    own: FloatArray
    kernel: Kernel

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the forces."""
        return tuple(self.law.columns)

    @property
    def arguments(self) -> tuple[str, ...]:
        """Names of what they depend on."""
        return tuple(self.law.arguments)

    def forces(self, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return forces [N or N m] and derivatives at nodes, (K, m) and (K, m, my).

        Parameters
        ----------
        y
            Arguments, (K, my).
        """
        m = len(self.channels)
        _, out = self.kernel.run(_NOTHING, y, _NOTHING)
        return out[:, :m], out[:, m:].reshape(len(y), m, len(self.arguments))

    def advance(self, x: FloatArray, d: float, ends: FloatArray, c: FloatArray) -> FloatArray:
        """Return the state a sample later, the forces found by Newton's method.

        Parameters
        ----------
        x
            State, (n,).
        d
            Input [N m].
        ends
            z, z' of the hook at the start and at the end of the sample, (4,).
        c
            Constants, (2,).

        Raises
        ------
        SolverError
            If the forces are not found.
        """
        M, winch = self.substeps, self.winch
        ahead = winch.A @ x + winch.B[:, 0] * d + winch.from_hook @ ends + winch.from_constants @ c
        if not self.channels:
            return np.asarray(ahead)
        known = self.C @ x + self.D * d + self.C_hook @ ends + self.C_constants @ c
        known += np.tile(self.rest, M)
        n = np.zeros(self.own.shape[1])
        for _ in range(_NEWTON):
            found, J = self.forces((known + self.own @ n).reshape(M, -1))
            slope = scipy.linalg.block_diag(*J)
            step = np.linalg.solve(np.eye(n.size) - slope @ self.own, found.ravel() - n)
            n += step
            if np.abs(step).max() <= _EXACT * winch.rest_tension:
                return np.asarray(ahead + self.from_forces @ n)
        raise SolverError(f"{_OWNER}: the forces of a sample were not found")


def make_stage(
    winch: SampledWinch,
    *,
    substeps: int = 1,
    drag: bool = True,
    slack: Sequence[int] | None = None,
    losses: bool = False,
    travel: DrumTravel | None = None,
    mean: bool = True,
    compiled: bool | None = None,
) -> Stage:
    """Return one sample of a winch with what is nonlinear in it.

    Parameters
    ----------
    winch
        The sampled winch.
    substeps
        Shares of a sample over each of which the forces are held.
    drag
        Whether the payload's drag is quadratic.
    slack
        Springs, counted from the drum, that can go slack; by default the first and the last.
    losses
        Whether the gear's losses and the Coulomb friction are there, if the case has any.
    travel
        Layers of the drum; by default its radius does not change.
    mean
        Whether the input is the mean torque of a sample (`mpc.nonlinear.mean_torque`), else that at
        its start.
    compiled
        As for `models.simulation.kernel.Kernel`.

    Raises
    ------
    InputError
        If a number is out of its range.
    SolverError
        If C was demanded and there is no compiler.
    """
    M = int(check_range(_OWNER, "substeps", substeps, low=1, high=50))
    springs = (0, winch.masses - 1) if slack is None else tuple(slack)
    if any(k not in range(winch.masses) for k in springs):
        raise InputError(
            f"{_OWNER}: slack must be springs from 0 to {winch.masses - 1}, got {springs}"
        )
    data = winch.data
    law = force_law(
        winch,
        drag=drag and data.quadratic_drag != winch.drag,
        slack=springs,
        losses=losses and (data.gear_efficiency < 1.0 or data.coulomb_friction > 0.0),
        travel=travel,
    )
    y = ca.SX.sym("y", len(law.arguments))
    n = law.function(y)
    J = ca.jacobian(n, y)
    # Most forces depend on one argument or two: the horizon is solved by those pairs only.
    pattern = np.asarray(ca.DM(J.sparsity(), 1.0)).reshape(len(law.columns), len(law.arguments))
    out = ca.vertcat(n, ca.reshape(ca.densify(J).T, -1, 1))
    none = [ca.SX.sym("s", 0), ca.SX.sym("p", 0)]
    mapped = ca.Function("forces", [none[0], y, none[1]], [none[0], out])
    changed, drift = mean_torque(winch) if mean else (winch, Drift.none(winch.size))
    return Stage(
        winch=changed,
        drift=drift,
        law=law,
        pairs=tuple((int(a), int(b)) for a, b in np.argwhere(pattern != 0.0)),
        rest=np.array([argument.rest for argument in law.arguments.values()]),
        substeps=M,
        kernel=Kernel(mapped, compiled=compiled),
        **_sampled(winch, law, drift, M),
    )


def _sampled(winch: SampledWinch, law: ForceLaw, drift: Drift, M: int) -> dict[str, FloatArray]:
    """Return the matrices of one sample of M sub-steps."""
    plant, T, n = winch.plant, winch.sample_time, winch.size
    h, m, my = T / M, len(law.columns), len(law.arguments)
    known = {name: k for k, name in enumerate(plant.disturbances)}
    columns = np.column_stack([np.zeros((n, 0)), *law.columns.values()])
    rows = np.vstack([np.zeros((0, n)), *(a.row for a in law.arguments.values())])
    felt = np.vstack([np.zeros((0, 2)), *(a.hook for a in law.arguments.values())])
    held = np.column_stack([plant.B[:, 0], plant.E[:, known["payload.force"]], columns])
    motion = plant.E[:, [known["hook.heave"], known["hook.heave_rate"]]]

    def pushed(age: float, length: float) -> FloatArray:
        """Return the effect of forces that were there for a time and end so long ago, (n, m)."""
        over, added = zero_order_hold(plant.A, held, length)
        del over
        return np.asarray(scipy.linalg.expm(plant.A * age) @ added[:, 2:])

    C, D = np.zeros((M * my, n)), np.zeros(M * my)
    C_hook, C_constants = np.zeros((M * my, 4)), np.zeros((M * my, 2))
    own = np.zeros((M * my, M * m))
    for i in range(M):
        at = (i + 0.5) * h
        here = slice(i * my, (i + 1) * my)
        over, added = zero_order_hold(plant.A, held, at)
        # The command is held at u = back omega(start) + d / gain.
        C[here] = rows @ (over + winch.back * np.outer(added[:, 0], winch.speed))
        D[here] = rows @ added[:, 0] / winch.gain
        C_constants[here] = rows @ np.column_stack([added[:, 1], added[:, 0] / winch.gain])
        moved, hook = hermite_within(plant.A, motion, T, at)
        C_hook[here] = rows @ moved + felt @ hook
        for k in range(i):
            own[here, k * m : (k + 1) * m] = rows @ pushed(at - (k + 1) * h, h)
        own[here, i * m : (i + 1) * m] = rows @ pushed(0.0, 0.5 * h)
    # The command that gives the input: the mean torque, and what the start is over it.
    C += np.outer(D, drift.state)
    C_hook += np.outer(D, drift.hook)
    C_constants += np.outer(D, drift.constants)
    D = D * (1.0 + drift.mean)
    forced = [pushed(T - (i + 1) * h, h) for i in range(M)]
    return {
        "from_forces": np.column_stack([np.zeros((n, 0)), *forced]),
        "C": C,
        "D": D,
        "C_hook": C_hook,
        "C_constants": C_constants,
        "own": own,
    }
