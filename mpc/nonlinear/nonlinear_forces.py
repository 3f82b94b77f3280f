r"""Forces that the linear winch lacks: drag, slack rope, losses, layers of the drum.

Each force acts through one column on the state's derivative and depends on a few linear functions
of the state, its arguments.  At rest every force is zero and so is its effect.
`mpc.nonlinear.stage` holds them over shares of a sample, and its head says what is approximated.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from models.basics import FloatArray
from models.plant import DrumTravel, build_plant, displacement_names

from ..winch import SampledWinch

_SMOOTH = 0.002  # eps of a tension, over that at rest
_TURN = 2.0  # motor speed over which gear's losses and friction change sides [rad/s]
_VELOCITY, _SPEED, _ANGLE = "payload.velocity", "motor.speed", "motor.angle"


@dataclass(frozen=True, kw_only=True, eq=False)
class Argument:
    """y = row x + hook (z, z') + rest."""

    row: FloatArray
    hook: FloatArray
    rest: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class ForceLaw:
    """Forces n of arguments y; `force_law` makes it.

    Attributes
    ----------
    arguments
        By name, in the order of y, (my).
    columns
        Effect of each force on the state's derivative, by name, in the order of n, (m).
    function
        casadi.Function y -> n.
    """

    arguments: Mapping[str, Argument]
    columns: Mapping[str, FloatArray]
    function: ca.Function


def force_law(
    winch: SampledWinch,
    *,
    drag: bool,
    slack: tuple[int, ...],
    losses: bool,
    travel: DrumTravel | None,
) -> ForceLaw:
    """Return the forces of a winch.

    Parameters
    ----------
    winch
        The sampled winch.
    drag
        Whether the payload's drag is quadratic.
    slack
        Springs, counted from the drum, that can go slack.
    losses
        Whether the gear has losses that follow its direction, and the motor Coulomb friction.
    travel
        Layers of the drum; None for a drum of one radius.
    """
    data, rope = winch.data, _Rope(winch)
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
                rows = {_VELOCITY: winch.velocity, _SPEED: winch.speed, _ANGLE: rope.unit(_ANGLE)}
                arguments[name] = Argument(row=rows[name], hook=still)
        return symbols[name]

    def smooth(k: int, tension: ca.SX) -> ca.SX:
        eps = _SMOOTH * rope.hanging[k]
        whole: ca.SX = 0.5 * (tension + ca.sqrt(tension**2 + eps**2))
        return whole

    def act(name: str, column: FloatArray, force: ca.SX) -> None:
        columns[name] = column
        forces.append(force)

    if drag:
        v = of(_VELOCITY)
        act("drag", rope.on_payload, winch.drag * v - data.quadratic_drag * ca.fabs(v) * v)
    held: dict[int, ca.SX] = {}  # tensions as they are
    changes = ca.SX(0), ca.SX(1)  # of the haul [m], and of the radius as a factor
    if travel is not None:
        angle, ratio, radius = of(_ANGLE), data.gear_ratio, data.drum_radius
        haul, now = travel.haul(angle, ca.SX(radius), ca.SX(ratio))
        changes = haul - radius / ratio * angle, now / radius
    for k in sorted({*slack, *((0,) if travel is not None else ())}):
        linear = of(f"spring.{k}")
        whole = linear
        if k == 0 and travel is not None:
            more = (changes[1] - 1.0) * rope.haul_per_angle * of(_SPEED)
            whole = linear + rope.stiffness[0] * (changes[0] + rope.damping_time * more)
        at_rest = smooth(k, ca.SX(rope.hanging[k])) - rope.hanging[k]
        held[k] = smooth(k, whole) - at_rest if k in slack else whole
        act(f"slack.{k}", rope.column(k), held[k] - linear)
    if losses or travel is not None:
        speed, force = of(_SPEED), ca.SX(0)
        top = held[0] if 0 in held else of("spring.0")
        mean = data.mean_gear_factor
        gear: ca.SX = ca.SX(mean)
        if losses:
            way = ca.tanh(speed / _TURN)
            gear = gear + 0.5 * way * (1.0 / data.gear_efficiency - data.gear_efficiency)
            force = -data.coulomb_friction * ca.tanh(speed / max(data.friction_speed, _TURN))
        lever = rope.haul_per_angle * (gear * changes[1] - mean)
        act("motor", rope.unit(_SPEED) / data.inertia, force - lever * (top + rope.at_drum))
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
        self._states = winch.plant.states
        names = displacement_names(winch.masses)
        self._shifts = [self.unit(name) for name in names]
        self._moves = [self.unit(name.replace("displacement", "velocity")) for name in names]
        length = p["rope.length"]
        self.stiffness = p["rope.axial_stiffness"] / (length * lumps.springs)
        self.damping_time = p["rope.damping_time"]
        self.hanging = (
            p["payload.submerged_weight"]
            + p["rope.submerged_weight_per_length"] * length * lumps.hanging
        )
        self.at_drum = p["rope.submerged_weight_per_length"] * length * lumps.at_drum
        self._masses = p["rope.mass_per_length"] * length * lumps.masses
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
            hook = np.array([1.0, self.damping_time])
        else:
            above, hook = (self._shifts[k - 1], self._moves[k - 1]), np.zeros(2)
        stretch, rate = above[0] - self._shifts[k], above[1] - self._moves[k]
        stiffness = float(self.stiffness[k])
        return Argument(
            row=stiffness * (stretch + self.damping_time * rate),
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
            column = column + bandwidth * self.unit("load_cell.tension")
        return np.asarray(column)
