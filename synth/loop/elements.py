r"""Quadratic drag and losses that switch, as equivalent linear elements of the loop.

Stochastic linearisation replaces a force that is no linear function of a Gaussian velocity by the
line of least mean square error (Caughey 1963; Roberts and Spanos, *Random Vibration and Statistical
Linearization*, 1990, ch. 5): drag q |v| v by C v, C = q sqrt(8/pi) sigma_v, and a loss that
switches with the direction, Delta sign(omega), by b omega, b = sqrt(2/pi) Delta / sigma_omega.
sigma is the closed loop's own, so each coefficient is solved together with the gains: one more
variable and one equality in the programme, a fixed point elsewhere.

Of a loss b would grow without end as the motion dies.  What a drive does at rest no line tells; but
the switch of a simulation is tanh(omega/omega_0), steepest at Delta/omega_0, and so is this:
b = sqrt(2/pi) Delta / sqrt(sigma^2 + (2/pi) omega_0^2), omega_0 = 1 rad/s at the motor.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from typing_extensions import override

from models.basics import check_range
from models.plant import LinearPlant

from .dual import log

Coefficients = Sequence[float]
"""What a loop's elements are replaced by, one number each."""

_TURN = np.sqrt(2.0 / np.pi)  # of a motor's speed, over which a loss changes its side [rad/s]


@dataclass(frozen=True, kw_only=True)
class Element(ABC):
    """Something of the plant as force = -c velocity, c by the velocity's standard deviation."""

    velocity: str  #: Name of the velocity among the plant's outputs.
    force: str  #: Name of the force among the plant's disturbances.
    #: The coefficient that the plant already holds; the element adds c minus this.
    reference: float = 0.0

    #: Whether it is always there.  A loss counts for less the more the drum moves and is no damping
    #: to rely on: stability and margins hold without it too.
    lasting: ClassVar[bool] = True

    @property
    def begin(self) -> float:
        """A coefficient of usual size."""
        return self.reference

    @abstractmethod
    def coefficient(self, variance: Any) -> Any:
        """Return c for a variance of the velocity, of any shape."""

    @abstractmethod
    def log_coefficient(self, variance: Any) -> Any:
        """Return log c for a variance of the velocity, an array or a `Dual`."""


@dataclass(frozen=True, kw_only=True)
class DragElement(Element):
    """Quadratic drag as force = -C velocity, C = quadratic sqrt(8/pi) sigma of the velocity.

    The reference is in N s/m.
    """

    velocity: str = "payload.velocity"
    force: str = "payload.force"
    quadratic: float  #: q of the drag force q |v| v [N s2/m2].

    def __post_init__(self) -> None:
        check_range("DragElement", "quadratic", self.quadratic, low=0.0, unit="N s2/m2")
        check_range("DragElement", "reference", self.reference, low=0.0, unit="N s/m")

    @property
    def slope(self) -> float:
        """C per sigma of the velocity [N s2/m2]."""
        return self.quadratic * float(np.sqrt(8.0 / np.pi))

    @override
    def coefficient(self, variance: Any) -> Any:
        return self.slope * np.sqrt(variance)

    @override
    def log_coefficient(self, variance: Any) -> Any:
        return log(variance) * 0.5 + np.log(self.slope)


@dataclass(frozen=True, kw_only=True)
class LossElement(Element):
    """A loss that switches as torque = -b speed, b = sqrt(2/pi) torque / sigma of the speed.

    The reference is in N m s/rad.
    """

    velocity: str = "motor.speed"
    force: str = "motor.load"
    torque: float  #: What the loss comes to either way [N m].
    usual: float = 0.0  #: Standard deviation of the speed that is to be expected [rad/s].
    lasting: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_range("LossElement", "torque", self.torque, low=0.0, open_low=True, unit="N m")
        check_range("LossElement", "usual", self.usual, low=0.0, unit="rad/s")

    @property
    @override
    def begin(self) -> float:
        return float(self.coefficient(self.usual**2))

    @override
    def coefficient(self, variance: Any) -> Any:
        return switching_friction(self.torque, variance)

    @override
    def log_coefficient(self, variance: Any) -> Any:
        return np.log(np.sqrt(2.0 / np.pi) * self.torque) - log(variance + _TURN**2) * 0.5


def switching_friction(torque: Any, variance: Any) -> Any:
    """Return b [N m s/rad] of losses [N m] that switch, by the variance of the motor's speed."""
    return np.sqrt(2.0 / np.pi) * torque / np.sqrt(variance + _TURN**2)


def with_elements(
    plant: LinearPlant, elements: Sequence[Element], coefficients: Coefficients
) -> LinearPlant:
    """Return the plant with elements at their coefficients.

    Raises InputError if a name is unknown or a velocity is no pure state of the plant (has a direct
    term).
    """
    for element, coefficient in zip(elements, coefficients, strict=True):
        if gain := element.reference - coefficient:
            plant = plant.with_element(element.velocity, element.force, gain)
    return plant


def without_losses(elements: Sequence[Element], coefficients: Coefficients) -> list[float]:
    """Return the coefficients with zero for what is no damping to count on."""
    pairs = zip(elements, coefficients, strict=True)
    return [c if element.lasting else 0.0 for element, c in pairs]
