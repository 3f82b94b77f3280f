r"""One sample of the nonlinear winch, `Stage`: the exact linear part, and forces beside it.

.. math::

    x_{j+1} &= A x_j + B d_j + \Gamma_w w_j + \Gamma_c c + F n_j, \\
    y_j &= C x_j + D d_j + C_w w_j + C_c c + O n_j + y_{rest}, \qquad n_j = \varphi(y_j) .

A rope of fifteen masses has axial modes up to 60 rad/s, and yet next to nothing of it is nonlinear:
the drag of the payload, the tension of a rope that goes slack, the layers of the drum
(`force_law`).  So the linear plant is sampled exactly, by its matrix exponential, and the forces n
that it lacks are held over a sample at their value in its middle, where the few numbers y decide on
them: the implicit midpoint rule for the nonlinear part alone, of second order and stable however
stiff the rope is.  phi with its derivative is one CasADi function that is mapped over the horizon
and compiled where there is a compiler.

What is approximated: springs between the first and the last can push, unless asked for; a rope
does not get longer or heavier by the layers of its drum; the gear has the mean of its losses, and
the motor no dry friction; and what the drive cuts within a sample does not change its mean torque
(`mpc.nonlinear.mean_torque`).

Each force acts through one column on the state's derivative and depends on a few linear functions
of the state, its arguments.  At rest every force is zero and so is its effect.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from models.basics import FloatArray, InputError, ReadOnlyArrays
from models.plant import DrumTravel, build_plant, hermite_hold, zero_order_hold
from models.simulation import Kernel

from ..winch import SampledWinch, by_command
from .mean_torque import Drift, mean_torque

_OWNER = "nonlinear predictive control"
_NOTHING = np.zeros(0)

_SMOOTH = 0.002  # eps of a tension, over that at rest
_VELOCITY, _SPEED, _ANGLE = "payload.velocity", "motor.speed", "motor.angle"


@dataclass(frozen=True, kw_only=True, eq=False)
class Stage(ReadOnlyArrays):
    """One sample with m forces and my arguments; `make_stage` makes it."""

    #: The sampled linear winch, whose input is the mean torque of a sample if so asked for.
    winch: SampledWinch
    drift: Drift  #: The torque at the start over that mean.
    law: ForceLaw  #: The forces.
    #: Which force depends on which argument, positions in n and y.
    pairs: tuple[tuple[int, int], ...]
    rest: FloatArray  #: y of a load that hangs at rest, (my,).
    from_forces: FloatArray  #: F, (n, m).
    #: y in the middle of the sample, less that at rest, of the state at its start, the input, the
    #: hook's (z, z') at both ends, the constants and the forces: (my, n), (my,), (my, 4), (my, 2),
    #: (my, m).
    C: FloatArray
    D: FloatArray
    C_hook: FloatArray
    C_constants: FloatArray
    own: FloatArray
    kernel: Kernel  #: What evaluates forces and derivatives.

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the forces."""
        return tuple(self.law.columns)

    @property
    def arguments(self) -> tuple[str, ...]:
        """Names of what they depend on."""
        return tuple(self.law.arguments)

    def forces(self, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return forces [N or N m] (K, m) and derivatives (K, m, my) at nodes, of y (K, my)."""
        m = len(self.channels)
        _, out = self.kernel.run(_NOTHING, y, _NOTHING)
        return out[:, :m], out[:, m:].reshape(len(y), m, len(self.arguments))


def make_stage(
    winch: SampledWinch, law: ForceLaw, *, mean: bool = True, compiled: bool | None = None
) -> Stage:
    """Return one sample of a winch with what is nonlinear in it.

    The input is the `mean` torque of a sample (`mpc.nonlinear.mean_torque`), else that at its
    start.

    Raises SolverError if C was demanded and there is no compiler.
    """
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
        kernel=Kernel(mapped, compiled=compiled),
        **_sampled(winch, law, drift),
    )


def _sampled(winch: SampledWinch, law: ForceLaw, drift: Drift) -> dict[str, FloatArray]:
    """Return the matrices of one sample."""
    plant, T, n = winch.plant, winch.sample_time, len(winch.plant.states)
    known = {name: k for k, name in enumerate(plant.disturbances)}
    columns = np.column_stack([np.zeros((n, 0)), *law.columns.values()])
    rows = np.vstack([np.zeros((0, n)), *(a.row for a in law.arguments.values())])
    felt = np.vstack([np.zeros((0, 2)), *(a.hook for a in law.arguments.values())])
    held = np.column_stack([plant.B[:, 0], plant.E[:, known["payload.force"]], columns])
    motion = plant.E[:, [known["hook.heave"], known["hook.heave_rate"]]]
    over, added = zero_order_hold(plant.A, held, 0.5 * T)
    moved, hook = hermite_hold(plant.A, motion, T, 0.5 * T)
    # The command is held at u = back omega(start) + d / gain, with d what gives the input: the mean
    # torque, and what the start is over it.
    late = winch.data.command_delay / T
    commands = by_command(plant, added[:, 0], 0.5 * T, T, late)
    state = np.hstack([over, commands[:, 1:]])
    D = rows @ commands[:, 0] / winch.gain
    constants = np.column_stack([added[:, 1], added[:, 0] / winch.gain])
    return {
        "from_forces": np.pad(
            zero_order_hold(plant.A, held, T)[1][:, 2:], [(0, winch.waiting), (0, 0)]
        ),
        "C": rows @ (state + winch.back * np.outer(commands[:, 0], winch.reckoned))
        + np.outer(D, drift.state),
        "D": D * (1.0 + drift.mean),
        "C_hook": rows @ moved + felt @ hook + np.outer(D, drift.hook),
        "C_constants": rows @ constants + np.outer(D, drift.constants),
        "own": rows @ added[:, 2:],
    }


@dataclass(frozen=True, kw_only=True, eq=False)
class Argument:
    """y = row x + hook (z, z') + rest."""

    row: FloatArray
    hook: FloatArray
    rest: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class ForceLaw:
    """Forces n of arguments y; `force_law` makes it."""

    arguments: Mapping[str, Argument]  #: By name, in the order of y, (my).
    #: Effect of each force on the state's derivative, by name, in the order of n, (m).
    columns: Mapping[str, FloatArray]
    function: ca.Function  #: casadi.Function y -> n.


def force_law(
    winch: SampledWinch,
    *,
    drag: bool = True,
    slack: Sequence[int] | None = None,
    travel: DrumTravel | None = None,
) -> ForceLaw:
    """Return the forces of a winch: quadratic drag, slack of springs, layers of the drum.

    Springs that can go slack are counted from the drum, by default the first and the last; without
    `travel` the drum's radius does not change.

    Raises InputError if there is no such spring.
    """
    data, rope = winch.data, _Rope(winch)
    last = len(rope.hanging) - 1
    springs = (0, last) if slack is None else tuple(slack)
    if any(k not in range(last + 1) for k in springs):
        raise InputError(f"{_OWNER}: slack must be springs from 0 to {last}, got {springs}")
    arguments: dict[str, Argument] = {}
    columns: dict[str, FloatArray] = {}
    forces: list[ca.SX] = []
    symbols: dict[str, ca.SX] = {}
    still = np.zeros(2)

    def of(name: str) -> ca.SX:
        """Return the symbol of an argument, which then is one."""
        if name not in symbols:
            symbols[name] = ca.SX.sym(name.replace(".", "_"))
            if name.startswith("spring."):
                arguments[name] = rope.tension(int(name.removeprefix("spring.")))
            else:
                arguments[name] = Argument(row=rope.unit(name), hook=still)
        return symbols[name]

    def smooth(k: int, tension: ca.SX) -> ca.SX:
        eps = _SMOOTH * rope.hanging[k]
        whole: ca.SX = 0.5 * (tension + ca.sqrt(tension**2 + eps**2))
        return whole

    def act(name: str, column: FloatArray, force: ca.SX) -> None:
        columns[name] = column
        forces.append(force)

    if drag and data.quadratic_drag != winch.drag:
        v = of(_VELOCITY)
        act("drag", rope.on_payload, winch.drag * v - data.quadratic_drag * ca.fabs(v) * v)
    held: dict[int, ca.SX] = {}  # tensions as they are
    changes = ca.SX(0), ca.SX(1)  # of the haul [m], and of the radius as a factor
    if travel is not None:
        angle, ratio, radius = of(_ANGLE), data.gear_ratio, data.drum_radius
        haul, now = travel.haul(angle, ca.SX(radius), ca.SX(ratio))
        changes = haul - radius / ratio * angle, now / radius
    for k in sorted({*springs, *((0,) if travel is not None else ())}):
        linear = of(f"spring.{k}")
        whole = linear
        if k == 0 and travel is not None:
            more = (changes[1] - 1.0) * rope.haul_per_angle * of(_SPEED)
            whole = linear + rope.stiffness[0] * (changes[0] + rope.damping_time[0] * more)
        at_rest = smooth(k, ca.SX(rope.hanging[k])) - rope.hanging[k]
        held[k] = smooth(k, whole) - at_rest if k in springs else whole
        act(f"slack.{k}", rope.column(k), held[k] - linear)
    if travel is not None:
        top = held[0]
        lever = rope.haul_per_angle * data.mean_gear_factor * (changes[1] - 1.0)
        act("motor", rope.unit(_SPEED) / data.inertia, -lever * (top + rope.at_drum))
    y = ca.vertcat(*symbols.values()) if symbols else ca.SX(0, 1)
    n = ca.vertcat(*forces) if forces else ca.SX(0, 1)
    return ForceLaw(
        arguments=arguments, columns=columns, function=ca.Function("law", [y], [n], ["y"], ["n"])
    )


class _Rope:
    """Springs and masses as rows and columns of the winch's state."""

    def __init__(self, winch: SampledWinch) -> None:
        symbolic = build_plant(winch.data, winch.masses)
        p, lumps, self._winch = symbolic.parameters, symbolic.lumps, winch
        chain = symbolic.chain
        self._states = winch.plant.states
        names = symbolic.displacements
        self._shifts = [self.unit(name) for name in names]
        self._moves = [self.unit(name.replace("displacement", "velocity")) for name in names]
        length = p["rope.length"]
        self.stiffness = np.array([link.series for link in chain])
        self.damping_time = np.array([link.series_time for link in chain])
        self.hanging = np.array([link.carried for link in chain])
        self.at_drum = p["rope.submerged_weight_per_length"] * length * lumps.at_drum
        self._masses = np.array([link.mass for link in chain])
        self._masses[-1] += p["payload.virtual_mass"]
        self.haul_per_angle = p["winch.drum_radius"] / p["winch.gear_ratio"]

    def unit(self, name: str) -> FloatArray:
        """Return the row or column that is one at a state."""
        return np.asarray(np.eye(len(self._states))[self._states.index(name)])

    @property
    def on_payload(self) -> FloatArray:
        """Effect of a force on the payload."""
        return np.asarray(self._moves[-1] / self._masses[-1])

    def tension(self, k: int) -> Argument:
        """Return the tension of a spring that can push."""
        if k == 0:
            above = self.haul_per_angle * self.unit(_ANGLE), self.haul_per_angle * self.unit(_SPEED)
            hook = np.array([1.0, self.damping_time[0]])
        else:
            above, hook = (self._shifts[k - 1], self._moves[k - 1]), np.zeros(2)
        stretch, rate = above[0] - self._shifts[k], above[1] - self._moves[k]
        stiffness = float(self.stiffness[k])
        return Argument(
            row=stiffness * (stretch + self.damping_time[k] * rate),
            hook=stiffness * hook,
            rest=float(self.hanging[k]),
        )

    def column(self, k: int) -> FloatArray:
        """Return the effect of a spring's tension on the state's derivative."""
        data = self._winch.data
        column = self._moves[k] / self._masses[k]
        if k > 0:
            return np.asarray(column - self._moves[k - 1] / self._masses[k - 1])
        column = (
            column - self.unit(_SPEED) * data.mean_gear_factor * self.haul_per_angle / data.inertia
        )
        if "load_cell.tension" in self._states:
            cell = self._winch.case.sensors.load_cell
            bandwidth = 0.0 if cell is None else cell.bandwidth
            column = column + bandwidth / data.falls * self.unit("load_cell.tension")
        return np.asarray(column)
