"""Quadratic drag as an equivalent linear element of the loop.

Stochastic linearisation replaces the force q |v| v of a Gaussian velocity by C v,
C = q sqrt(8/pi) sigma_v (Caughey 1963; Roberts and Spanos, *Random Vibration and Statistical
Linearization*, 1990, ch. 5).  sigma_v is the closed loop's own, so C is solved together with the
gains: one more variable and one equality in the programme, a fixed point elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.basics import check_range
from models.plant import LinearPlant


@dataclass(frozen=True, kw_only=True)
class DragElement:
    """Quadratic drag as force = -C velocity, C = quadratic sqrt(8/pi) sigma of the velocity.

    Parameters
    ----------
    quadratic
        q of the drag force q |v| v [N s2/m2].
    velocity
        Name of the velocity among the plant's outputs.
    force
        Name of the force among the plant's disturbances.
    reference
        The coefficient that the plant already holds [N s/m]; the element adds C minus this.
    """

    quadratic: float
    velocity: str = "payload.velocity"
    force: str = "payload.force"
    reference: float = 0.0

    def __post_init__(self) -> None:
        check_range("DragElement", "quadratic", self.quadratic, low=0.0, unit="N s2/m2")
        check_range("DragElement", "reference", self.reference, low=0.0, unit="N s/m")

    @property
    def slope(self) -> float:
        """C per sigma of the velocity [N s2/m2]."""
        return self.quadratic * float(np.sqrt(8.0 / np.pi))


def with_drag(plant: LinearPlant, element: DragElement, coefficient: float) -> LinearPlant:
    """Return the plant with the element's drag at `coefficient` [N s/m].

    Raises
    ------
    InputError
        If a name is unknown or the velocity is no pure state of the plant (has a direct term).
    """
    gain = element.reference - coefficient
    if gain == 0.0:
        return plant
    return plant.with_element(element.velocity, element.force, gain)
