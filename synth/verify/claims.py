"""Protocols of the claims that are checked: a problem's answer, a design and its figures.

The check knows none of the code that it checks, not even its types: what the members mean is
said where they are kept, in `synth.design` and in what that is made of.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

from models.basics import FloatArray
from models.case import Case
from models.plant import LinearPlant


class ControllerMatrices(Protocol):
    """A controller x' = A x + B y, u = C x + D y with names for y and u."""

    @property
    def A(self) -> FloatArray: ...
    @property
    def B(self) -> FloatArray: ...
    @property
    def C(self) -> FloatArray: ...
    @property
    def D(self) -> FloatArray: ...
    @property
    def measurements(self) -> tuple[str, ...]: ...
    @property
    def inputs(self) -> tuple[str, ...]: ...


class SpectralSource(Protocol):
    """One disturbance of a loop; `Source` is one."""

    @property
    def name(self) -> str: ...
    @property
    def density(self) -> Callable[[FloatArray], FloatArray]: ...
    @property
    def band(self) -> tuple[float, float] | None: ...
    @property
    def splits(self) -> tuple[float, ...]: ...


class LimitClaim(Protocol):
    """The use of a limit: value, bound, and whether the design had to keep it."""

    @property
    def value(self) -> float: ...
    @property
    def bound(self) -> float: ...
    @property
    def enforced(self) -> bool: ...


class StatedLimit(Protocol):
    """A limit of a problem; `limit_demand` reads its further fields by its class."""

    @property
    def name(self) -> str: ...
    @property
    def bound(self) -> float: ...
    @property
    def outputs(self) -> tuple[str, ...]: ...


class EquivalentElement(Protocol):
    """An element of the loop as force = -c velocity, c by the velocity's variance."""

    @property
    def velocity(self) -> str: ...
    @property
    def force(self) -> str: ...
    @property
    def reference(self) -> float: ...


class NamedParameter(Protocol):
    """A parameter of a structure."""

    @property
    def name(self) -> str: ...


class ControllerLaw(Protocol):
    """A structure on its plant: from its parameters to the controller."""

    @property
    def parameters(self) -> Sequence[NamedParameter]: ...
    def controller(self, values: Sequence[float]) -> ControllerMatrices: ...


class TunedProblem(Protocol):
    """The question that a tuning answers."""

    @property
    def plant(self) -> LinearPlant: ...
    @property
    def law(self) -> ControllerLaw: ...
    @property
    def disturbances(self) -> Sequence[SpectralSource]: ...
    @property
    def minimise(self) -> Mapping[str, float]: ...
    @property
    def limits(self) -> Sequence[StatedLimit]: ...
    @property
    def elements(self) -> Sequence[EquivalentElement]: ...


class LoopClaims(Protocol):
    """What both say of their loop."""

    @property
    def ok(self) -> bool: ...
    @property
    def parameters(self) -> Mapping[str, float]: ...
    @property
    def limits(self) -> Mapping[str, LimitClaim]: ...
    @property
    def margins(self) -> object | None: ...


class TuningClaims(LoopClaims, Protocol):
    """The answer to a problem, see `synth.design.Tuning`."""

    @property
    def problem(self) -> TunedProblem: ...
    @property
    def cost(self) -> float: ...
    @property
    def controller(self) -> ControllerMatrices | None: ...
    @property
    def coefficients(self) -> Sequence[float]: ...


class DesignClaims(LoopClaims, Protocol):
    """What a design of a winch says, see `synth.design.Design`."""

    @property
    def case(self) -> Case: ...
    @property
    def sea_case(self) -> Case: ...
    @property
    def controller(self) -> ControllerMatrices: ...
    @property
    def masses(self) -> int: ...
    @property
    def payload_rms(self) -> float: ...
    @property
    def payload_rms_before(self) -> float: ...
    @property
    def hook_rms(self) -> float: ...
    @property
    def shares(self) -> Mapping[str, Mapping[str, float]]: ...
    @property
    def drive_kept(self) -> bool: ...
    @property
    def drag(self) -> float: ...
    @property
    def drag_before(self) -> float: ...
    @property
    def friction(self) -> float: ...
