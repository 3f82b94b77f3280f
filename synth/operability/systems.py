"""Systems whose limiting seas are sought: a loop, the hook with the drum held, a perfect winch.

All three answer the same two questions, so that one search serves them: what are the responses on
nodes with the drag as a variable (`responses.DragResponses`), and with which drag are they stable.

    design, case -> LoopSystem      the payload with the design's gains
    case         -> HeldSystem      the payload with the brake on, on the exact distributed rope
    case         -> PerfectSystem   what any winch must do to hold the upper end still
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.optimize import brentq
from typing_extensions import override

from models.basics import ComplexArray, FloatArray, Quadrature
from models.plant import LinearPlant, PlantData
from models.rig import MRU
from models.sensing import SwitchingNoise, coherent_error

from ..loop import (
    Assessment,
    Disturbance,
    DragElement,
    Element,
    LinearController,
    LoopResponses,
    LossElement,
)
from ..question import HOOK, held_poles, held_responses
from .responses import DragResponses

VELOCITY, FORCE = "payload.velocity", "payload.force"
_COEFFICIENTS = np.concatenate([[0.0], np.geomspace(1e-6, 1e2, 33)])  # over the slope [m/s]
_USUAL = 0.1  # rms speed of a payload whose drag the edge of friction is looked for with [m/s]
_SHARES = np.geomspace(1e-3, 1.0, 25)  # of the friction at rest, at which it is looked for
_EDGE = 1e-18  # how well the edge of stability is known, over the slope [m/s]
_DECAY = 1e-9  # growth over the size of the largest pole that is none
_HIGHEST = 60.0  # where seas end [rad/s]


@dataclass(frozen=True, kw_only=True, eq=False)
class System(ABC):
    """What is moved by the sea."""

    outputs: tuple[str, ...]  #: The signals that are looked at.
    #: Drag coefficient per standard deviation of the payload's velocity [N s2/m2]; 0 where the
    #: coefficient is fixed.
    slope: float
    #: Drag coefficient that the responses are computed with [N s/m]: the fixed one, or one of the
    #: size that is to be expected.
    reference: float
    noises: tuple[Disturbance, ...] = field(default=())  #: What disturbs besides the sea.
    #: The motion reference unit whose error, which grows with the sea, is among the noises.
    mru: MRU | None = None
    #: The noise of losses that switch, which is among them too and hangs on the sea.
    switching: SwitchingNoise | None = None
    #: Losses that switch with the motor's direction, if there are some.
    loss: LossElement | None = None

    @abstractmethod
    def transfers(self, omega: FloatArray) -> ComplexArray:
        """Return the responses at frequencies (n,) [rad/s], as `DragResponses.table` has them."""

    def responses(self, nodes: Quadrature) -> DragResponses:
        """Return the responses on nodes, with the drag as a variable."""
        names = [noise.name for noise in self.noises]
        unit = self.mru if "mru.error" in names else None
        return DragResponses(
            nodes=nodes,
            outputs=self.outputs,
            table=self.transfers(nodes.omega),
            reference=self.reference,
            losses=self.loss is not None,
            shares=None if unit is None else coherent_error(unit, nodes.omega),
            error=0 if unit is None else 1 + names.index("mru.error"),
        )

    @abstractmethod
    def poles(self, coefficient: float, friction: float = 0.0) -> ComplexArray:
        """Return the poles [1/s] for a drag coefficient [N s/m]; those above the real axis do.

        `friction` is that of losses [N m s/rad].
        """

    @cached_property
    def friction_edge(self) -> float:
        """Friction of losses from which on the system swings [N m s/rad]; that at rest for none.

        In a sea that hardly moves it the drum sticks and slips, and moves on average as much as
        leaves it less friction than this.
        """
        assert self.loss is not None
        most = float(self.loss.coefficient(0.0))
        low, high = self.stable_range
        drag = min(max(self.slope * _USUAL, 1.05 * low), 0.95 * high) or self.reference
        before = 0.0
        for share in _SHARES:
            if float(self.poles(drag, share * most).real.max(initial=-np.inf)) >= 0.0:
                return float(
                    brentq(
                        lambda b: self.poles(drag, b).real.max(),
                        before * most,
                        share * most,
                        rtol=1e-6,
                    )
                )
            before = share
        return most

    @cached_property
    def stable_range(self) -> tuple[float, float]:
        """Drag coefficients for which the system is stable [N s/m]; (inf, 0) if none is.

        Where stability comes and goes it is the last range that begins at or below a coefficient
        of usual size.
        """
        if self.slope == 0.0:
            return (0.0, np.inf) if self._growth(self.reference) < 0.0 else (np.inf, 0.0)
        values = self.slope * _COEFFICIENTS
        kept = [self._growth(float(v)) < 0.0 for v in values]
        if all(kept):
            return 0.0, np.inf
        if not any(kept):
            return np.inf, 0.0
        first = kept.index(True)
        last = next((k for k in range(first, len(kept)) if not kept[k]), len(kept))
        low, high = 0.0, np.inf
        if first > 0:
            low = brentq(self._growth, values[first - 1], values[first], xtol=_EDGE * self.slope)
        if last < len(kept):
            high = brentq(self._growth, values[last - 1], values[last], xtol=_EDGE * self.slope)
        return low, high

    @cached_property
    def swings(self) -> bool:
        """Whether it swings by itself: unstable without drag, as quadratic drag is in small motion.

        Whatever the sea, its motion is then at least the one that gives it drag enough.
        """
        if self.slope == 0.0:
            return False
        poles = self.poles(0.0)
        # A mode that nothing damps stays where it is.
        return self._growth(0.0) > _DECAY * float(np.abs(poles).max(initial=1.0))

    def _growth(self, coefficient: float) -> float:
        """Return the growth rate of the motion without a sea [1/s]; below zero it is stable."""
        return float(self.poles(coefficient).real.max(initial=-np.inf))


@dataclass(frozen=True, kw_only=True, eq=False)
class LoopSystem(System):
    """A plant that holds the drag `DragElement.reference`, with a linear controller around it.

    `drag` is quadratic, or None where the plant holds a fixed coefficient.  Of losses it holds
    none: what is stable without them counts as stable.
    """

    plant: LinearPlant
    controller: LinearController
    drag: DragElement | None

    @override
    def transfers(self, omega: FloatArray) -> ComplexArray:
        causes = [HOOK, *(noise.name for noise in self.noises), FORCE]
        shown = [*self.outputs, VELOCITY]
        if self.loss is not None:
            causes, shown = [*causes, self.loss.force], [*shown, self.loss.velocity]
        found = LoopResponses.of(self.plant.response(omega), self.controller)
        return np.array([[found.response(z, w) for w in causes] for z in shown])

    @override
    def poles(self, coefficient: float, friction: float = 0.0) -> ComplexArray:
        drag: tuple[Element, ...] = () if self.drag is None else (self.drag,)
        known = [coefficient][: len(drag)]
        if self.loss is not None and friction:
            drag, known = (*drag, self.loss), [*known, friction]
        return Assessment(self.plant, self.controller, (), elements=drag, coefficients=known).poles


@dataclass(frozen=True, kw_only=True, eq=False)
class HeldSystem(System):
    """Rope and payload with the drum held by its brake, from the rope's closed form."""

    data: PlantData

    @override
    def transfers(self, omega: FloatArray) -> ComplexArray:
        s = 1j * omega.astype(np.complex128)
        rows = held_responses(self.data, s, self.reference)
        return np.array([rows[z] for z in (*self.outputs, VELOCITY)])

    @override
    def poles(self, coefficient: float, friction: float = 0.0) -> ComplexArray:
        # Those of the payload on its rope: what a quadrature has to look for, and no more.
        return held_poles(self.data, coefficient, _HIGHEST)

    @override
    def _growth(self, coefficient: float) -> float:
        # Nothing drives the rope's own modes; the first, undamped, would have no variance.
        return float(self.poles(coefficient)[0].real)


@dataclass(frozen=True, kw_only=True, eq=False)
class PerfectSystem(System):
    """A winch that holds the rope's upper end still: X = -Z, the tension constant.

    Motor torque is then that of the inertia alone, T = (I s^2 + B s) theta with theta = -n Z / r:
    what every winch pays whose load is to stand still, whatever its controller.
    """

    data: PlantData

    @override
    def transfers(self, omega: FloatArray) -> ComplexArray:
        data, s = self.data, 1j * omega
        angle = -data.gear_ratio / data.drum_radius + 0.0 * s
        torque = (data.inertia * s**2 + data.viscous_friction * s) * angle
        current = torque / data.torque_constant
        moved = {"motor.torque": torque, "motor.speed": s * angle, "motor.current": current}
        if data.motor == "dc":
            coil = data.resistance + data.inductance * s
            moved["motor.voltage"] = coil * current + data.back_emf_constant * s * angle
        # The payload, which stands still, and what no force on it moves.
        nothing = np.zeros_like(s)
        rows = [(moved[z], nothing) for z in self.outputs]
        return np.array([*rows, (nothing, nothing)])

    @override
    def poles(self, coefficient: float, friction: float = 0.0) -> ComplexArray:
        del coefficient, friction
        return np.zeros(0, dtype=np.complex128)
