"""The winch, its rope and its load: one nonlinear plant, symbolic in CasADi.

    command u --> motor --> gear, drum --(haul X)--+
                                                    +--> rope: springs and masses --> payload P
    hook heave Z, heave rate Z' --------------------+

Where the crane's tip gives, it is a spring in series with the uppermost rope, its foot moved by
Z; with slings the hook block is a mass of its own above the payload.

Everything moves in the vertical, positive up.  Displacements are measured from the static
equilibrium, in which the state is zero but for the motor's current or torque.  Forces are
whole, not deviations: every spring carries its share of the submerged weight and goes slack
when its tension would fall below zero, and the motor holds the static load.

`build_plant` makes it from a case; `Plant.operating_point` solves for rest,
`Plant.linearise` differentiates there and gives the `LinearPlant` that synthesis works on.
Limits of the drive, a rope that grows, a seabed or a deck are no part of it unless asked for:
`build_plant` takes them for the simulation and for nonlinear prediction.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from types import MappingProxyType
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from ..basics import FloatArray, SolverError, check_range, pick, read_only
from .equations import (
    RATES,
    Equations,
    build_equations,
    displacement_names,
    parameter_values,
    state_names,
    weighed_tension,
)
from .linear import LinearPlant
from .plant_data import PlantData, as_plant_data
from .rope import Link, chain_of, lump_rope

if TYPE_CHECKING:
    from ..case import Case
    from .drive import DriveLimits
    from .payout import DrumTravel
    from .surroundings import Surroundings


#: Parameters of a load that truly hangs at rest, neither hauled nor lowered: the gear has the mean
#: of its two losses.  It is where a simulation starts and what a controller's command begins from;
#: the torque to set against a rating is that of hauling, without them.
MEAN_LOSSES: Mapping[str, float] = MappingProxyType({"winch.gear_direction": 0.0})

RESIDUAL_TOLERANCE = 1e-9  # of the terms that cancel at rest [-]
_QUIET = {"error_on_fail": False, "show_eval_warnings": False}  # we look at the residual


@dataclass(frozen=True, kw_only=True, eq=False)
class OperatingPoint:
    """The plant at rest."""

    #: State, input and parameters, (nx,), (1,), (np,); the disturbances are zero.
    x: FloatArray
    u: FloatArray
    p: FloatArray
    command: float  #: Drive command that holds the load [V, rad/s or N m].
    torque: float  #: Motor torque [N m].
    tension: float  #: Rope tension at its upper end, below the sheaves [N].
    outputs: Mapping[str, float]  #: Every performance output by name.
    residual: float  #: Largest derivative that is left, over the terms that cancel in it [-].


@dataclass(frozen=True, kw_only=True, eq=False)
class Plant(Equations):
    """The symbolic plant; `build_plant` makes it, `Equations` says what is in it.

    Notes
    -----
    Parameters that choose rather than measure: ``payload.linear_drag`` is added to the
    quadratic drag, whose own slope at rest is zero, and stands for it in a linear plant.
    ``winch.gear_direction`` in [-1, 1] is +1 when the motor drives the load (it feels 1/eta
    of its torque), -1 when the load drives the motor (eta), 0 the mean of both factors; with
    ``winch.gear_switching`` [s/rad] above zero the direction follows the motor's speed, as
    tanh(switching * speed).  The sheaves' losses go with the gear's.
    """

    @property
    def masses(self) -> int:
        """Number of masses along the rope, the payload's or the hook block's included."""
        return len(self.lumps.masses)

    @property
    def displacements(self) -> list[str]:
        """Names of the displacements of the chain's masses, from the drum down."""
        return displacement_names(self.data, self.masses)

    @property
    def chain(self) -> list[Link]:
        """The chain of springs and masses at rest, from the drum down."""
        return chain_of(self.parameters, self.lumps, self.parameters["rope.length"])

    def parameter_vector(self, changes: Mapping[str, float] | None = None) -> FloatArray:
        """Return p, some of its entries replaced by name.

        Raises InputError if a name is unknown or a value is not finite.
        """
        changes = changes or {}
        pick("plant", "parameter", tuple(self.parameters), tuple(changes))
        values = {k: check_range("plant", k, v) for k, v in changes.items()}
        return np.array([values.get(name, value) for name, value in self.parameters.items()])

    def operating_point(self, parameters: Mapping[str, float] | None = None) -> OperatingPoint:
        """Solve for the state and the command that hold the load at rest.

        The drum's angle is free at rest and set to zero.  Newton's method starts at a rope
        with half of its static stretch, so that the answer is found, not handed in.  The
        motor holds the load as if hauling it (gear direction +1) unless `parameters` say
        otherwise: that torque is the one to set against a rating.

        Raises SolverError if the solve leaves a residual.
        """
        p = self.parameter_vector({"winch.gear_direction": 1.0, **(parameters or {})})
        values = dict(zip(self.parameters, p, strict=True))
        nx = len(self.states)
        solver = _at_rest(self.function)
        links = chain_of(values, self.lumps, values["rope.length"])
        stretch = np.array([link.carried / link.series for link in links])
        start = np.zeros(nx)
        first = self.states.index(self.displacements[0]) - 1
        start[first : first + len(links)] = 0.5 * np.cumsum(stretch)
        relaxed = [i for i, name in enumerate(self.states) if name.endswith(".stretch")]
        # The branches of a hysteretic rope, piece by piece, have followed.
        start[np.array(relaxed, dtype=np.intp) - 1] = np.repeat(
            -0.5 * stretch[: self.masses], len(relaxed) // self.masses
        )
        try:
            found = np.asarray(solver(x0=start, p=p)["x"], dtype=np.float64).ravel()
        except RuntimeError as error:  # whatever CasADi says, ours is the error the user sees
            raise SolverError(f"plant: no static operating point was found: {error}") from error
        if not np.isfinite(found).all():
            raise SolverError("plant: no static operating point was found: nothing holds the load")
        state, u, w = np.append(0.0, found[:-1]), found[-1:], np.zeros(len(self.disturbances))
        derivative, _, z = (np.asarray(v).ravel() for v in self.function(state, u, w, p))
        A, B, *_ = (np.asarray(block) for block in self.jacobians(state, u, w, p))
        terms = np.abs(A) @ np.abs(state) + np.abs(B) @ np.abs(u)
        # A fast filter makes a rate of the rounding of what it hears: its own rate measures it.
        least = np.maximum(1.0, np.abs(np.diag(A)))
        residual = float(np.max(np.abs(derivative) / np.maximum(least, terms)))
        if not residual <= RESIDUAL_TOLERANCE:
            raise SolverError(
                f"plant: no static operating point was found, relative residual {residual:.3g} "
                f"(allowed {RESIDUAL_TOLERANCE:g})"
            )
        outputs = dict(zip(self.outputs, (float(v) for v in z), strict=True))
        return OperatingPoint(
            x=read_only(state),
            u=read_only(u),
            p=read_only(p),
            command=float(u[0]),
            torque=outputs["motor.torque"],
            tension=outputs[weighed_tension(outputs)],
            outputs=outputs,
            residual=residual,
        )

    def linearise(
        self, *, drag: float, parameters: Mapping[str, float] | None = None
    ) -> LinearPlant:
        """Return the plant linearised at rest, low-passes and delays included.

        The command's own delay is in those of the measurements: the loop is the same.

        Derivatives are automatic.  Gear and sheaves have the mean of their two factors, (1/eta +
        eta)/2, and ``static`` is rest with it; ``loss`` is what hauling takes above that, and dry
        friction.  Where the losses do not switch (`PlantData.switching`) ``static`` is rest with
        the motor hauling and there is no ``loss``.  The payload's equivalent linear drag
        coefficient is C [N s/m]; `parameters` changes others by name.

        Raises InputError if `drag` is negative or a parameter is unknown; SolverError if there is
        no static operating point.
        """
        check_range("plant", "drag", drag, low=0.0, unit="N s/m")
        changes = {**(parameters or {}), "payload.linear_drag": drag}
        rest = self.operating_point({**changes, **MEAN_LOSSES})
        hauling = self.operating_point(changes)
        held, loss = hauling, {}
        if self.data.switching:
            held, torque = rest, hauling.torque - rest.torque + self.data.coulomb_friction
            loss = {name: torque * per for name, per in self.data.per_torque.items()}
            if self.data.sheaves_efficiency < 1.0:
                drum = "rope.tension"
                loss[drum] = hauling.outputs[drum] - rest.outputs[drum]
        w = np.zeros(len(self.disturbances))
        names = ("A", "B", "E", "C", "D", "F", "Cz", "Dz", "Fz")
        blocks = zip(names, self.jacobians(rest.x, rest.u, w, rest.p), strict=True)
        return LinearPlant(
            **{name: np.asarray(block) for name, block in blocks},
            states=self.states,
            inputs=self.inputs,
            disturbances=self.disturbances,
            measurements=self.measurements,
            outputs=self.outputs,
            delays=(self.data.delay + self.data.command_delay,) * len(self.measurements),
            holds=(),
            rates=RATES,
            units=self.units,
            static={**held.outputs, "drive.command": held.command},
            loss=loss,
        )


def build_plant(
    source: Case | PlantData,
    masses: int | None = None,
    *,
    limits: DriveLimits | None = None,
    travel: DrumTravel | None = None,
    surroundings: Surroundings | None = None,
) -> Plant:
    """Return the symbolic plant of a case.

    Parameters
    ----------
    source
        A case, or the plant's numbers themselves.
    masses
        Masses along the rope, 1 to 40; by default those of the case, and where it says
        ``auto`` as many as hold the axial modes below 40 rad/s.
    limits
        Limits of the drive; by default the motor has none.
    travel
        Layers of the drum, for a rope that is paid out and hauled in by much; by default the
        rope keeps its length and the drum its radius.
    surroundings
        Seabed, deck or water surface; by default the payload hangs in still water.

    Raises
    ------
    InputError
        If `masses` is out of range, or the drum does not hold the rope that is paid out.
    """
    data = as_plant_data(source)
    masses, values = data.chosen_masses(masses), parameter_values(data)
    if limits is None and travel is None and surroundings is None:
        names = tuple(values), state_names(data, masses)
        alike = masses, data.lumping, *names, data.falls, data.friction_speed
        made = replace(_equations(_Kind(alike=alike, data=data)), data=data, parameters=values)
    else:
        lumps = lump_rope(masses, data.lumping)
        made = build_equations(data, lumps, limits=limits, travel=travel, surroundings=surroundings)
    return Plant(**vars(made))


@dataclass(frozen=True, kw_only=True)
class _Kind:
    """What plants have in common whose equations differ in the values of parameters only."""

    #: Masses, names of parameters and states, and the numbers that are in the equations.
    alike: tuple[object, ...]
    data: PlantData = field(compare=False)


@lru_cache(maxsize=32)
def _equations(kind: _Kind) -> Equations:
    """Return the equations of plants of a kind, with the numbers of the first that asked."""
    data, (masses, *_) = kind.data, kind.alike
    assert isinstance(masses, int)
    return build_equations(data, lump_rope(masses, data.lumping))


@lru_cache(maxsize=32)
def _at_rest(function: ca.Function) -> ca.Function:
    """Return Newton's method for a plant's state but for its angle, and the command, at rest."""
    nx, _, nw, size = (function.size1_in(i) for i in range(4))
    unknown, symbols = ca.SX.sym("unknown", nx), ca.SX.sym("p", size)
    x = ca.vertcat(0, unknown[: nx - 1])
    xdot = function(x, unknown[nx - 1], np.zeros(nw), symbols)[0]
    # The angle's own equation says that the speed is zero; all nx are kept.
    system = {"x": unknown, "p": symbols, "g": xdot}
    return ca.rootfinder("static", "newton", system, _QUIET)
