"""Protocols of the claims that are checked: a problem's answer, a design and its figures.

`synth.design` keeps them.  The check thus knows none of the code that it checks, not even its
types.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from models.case import Case
from models.plant import LinearPlant

from .recompute import ControllerMatrices, SpectralSource


class LimitClaim(Protocol):
    """The use of a limit: value, bound, and whether the design had to keep it."""

    @property
    def value(self) -> float:
        """The value that is claimed."""

    @property
    def bound(self) -> float:
        """Its bound."""

    @property
    def enforced(self) -> bool:
        """Whether the bound binds the design."""


class StatedLimit(Protocol):
    """A limit of a problem; `limit_demand` reads its further fields by its class."""

    @property
    def name(self) -> str:
        """As in reports."""

    @property
    def bound(self) -> float:
        """The bound."""

    @property
    def outputs(self) -> tuple[str, ...]:
        """The signals that it is about."""


class QuadraticDrag(Protocol):
    """Quadratic drag force = -C velocity, C = quadratic sqrt(8/pi) sigma of the velocity."""

    @property
    def quadratic(self) -> float:
        """Q of the drag force q |v| v [N s2/m2]."""

    @property
    def velocity(self) -> str:
        """Name of the velocity among the plant's outputs."""

    @property
    def force(self) -> str:
        """Name of the force among the plant's disturbances."""

    @property
    def reference(self) -> float:
        """The coefficient that the plant already holds [N s/m]."""


class NamedParameter(Protocol):
    """A parameter of a structure."""

    @property
    def name(self) -> str:
        """Its name."""


class ControllerLaw(Protocol):
    """A structure on its plant: from its parameters to the controller."""

    @property
    def parameters(self) -> Sequence[NamedParameter]:
        """The parameters in their order."""

    def controller(self, values: Sequence[float]) -> ControllerMatrices:
        """Return the controller of parameter values."""


class TunedProblem(Protocol):
    """The question that a tuning answers."""

    @property
    def plant(self) -> LinearPlant:
        """The plant, its drag that before compensation."""

    @property
    def law(self) -> ControllerLaw:
        """The structure on it."""

    @property
    def disturbances(self) -> Sequence[SpectralSource]:
        """What shakes it."""

    @property
    def minimise(self) -> Mapping[str, float]:
        """Weights on the variances of its outputs, by name."""

    @property
    def limits(self) -> Sequence[StatedLimit]:
        """The limits that bind."""

    @property
    def drag(self) -> QuadraticDrag | None:
        """Drag to be linearised with the response."""


class TuningClaims(Protocol):
    """The answer to a problem, see `synth.design.Tuning`."""

    @property
    def problem(self) -> TunedProblem:
        """The question."""

    @property
    def ok(self) -> bool:
        """Whether it counts as good."""

    @property
    def cost(self) -> float:
        """Square root of the weighted variance."""

    @property
    def parameters(self) -> Mapping[str, float]:
        """Parameters of the structure by name."""

    @property
    def controller(self) -> ControllerMatrices | None:
        """The controller that they make."""

    @property
    def margins(self) -> object | None:
        """Stability margins, with the names of `CurveMargins`."""

    @property
    def limits(self) -> Mapping[str, LimitClaim]:
        """Use of each limit by name."""

    @property
    def coefficient(self) -> float | None:
        """Drag coefficient that agrees with the response [N s/m]."""


class DesignClaims(Protocol):
    """What every design of a winch says, see `synth.design.GainDesign`."""

    @property
    def case(self) -> Case:
        """The case asked about."""

    @property
    def masses(self) -> int:
        """Rope masses of the design plant."""

    @property
    def payload_rms(self) -> float:
        """Standard deviation of the payload's motion [m]."""

    @property
    def payload_rms_before(self) -> float:
        """The same with the drum held [m]."""

    @property
    def hook_rms(self) -> float:
        """Standard deviation of the hook's motion [m]."""

    @property
    def limits(self) -> Mapping[str, LimitClaim]:
        """Use of every limit by name."""

    @property
    def drag(self) -> float:
        """Linear drag coefficient [N s/m]."""

    @property
    def drag_before(self) -> float:
        """The same with the drum held [N s/m]."""


class GainClaims(DesignClaims, Protocol):
    """Gains of the payload feedback and what they do, see `synth.design.GainDesign`."""

    @property
    def ok(self) -> bool:
        """Whether it counts as good."""

    @property
    def sea_case(self) -> Case:
        """The case in the sea that the figures hold for."""

    @property
    def gains(self) -> Mapping[str, float]:
        """``A, a, a1, a2`` of u = -A (a P'' + a1 P' + a2 P)."""

    @property
    def margins(self) -> object | None:
        """Stability margins, with the names of `CurveMargins`."""


class StructureClaims(DesignClaims, Protocol):
    """A structure's controller and what it does, see `synth.design.StructureDesign`."""

    @property
    def measurements(self) -> tuple[str, ...]:
        """What the structure hears."""

    @property
    def parts(self) -> Mapping[str, float]:
        """What each disturbance alone leaves of the payload's motion [m]."""

    def tuning(self) -> TuningClaims:
        """Return the answer to its problem."""
