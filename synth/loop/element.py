"""Equivalent linear elements: a memoryless nonlinearity as a gain that depends on the response.

Stochastic linearisation replaces the quadratic drag q |v| v of a Gaussian velocity by C v,
C = q sqrt(8/pi) sigma_v (Caughey 1963; Roberts and Spanos, *Random Vibration and
Statistical Linearization*, 1990, ch. 5).  sigma_v is the closed loop's own, so C is solved
together with the gains: one more variable and one equality in the programme, a fixed point
elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from models.basics import InputError, check_range, pick
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
        If the velocity is not a pure state of the plant (it has a direct term).
    """
    v = pick("drag element", "output", plant.outputs, [element.velocity])[0]
    f = pick("drag element", "disturbance", plant.disturbances, [element.force])[0]
    if np.any(plant.Dz[v]) or np.any(plant.Fz[v]):
        raise InputError(f"drag element: {element.velocity} must have no direct term")
    gain = -(coefficient - element.reference)
    row = plant.Cz[v][None, :]
    return replace(
        plant,
        A=plant.A + gain * plant.E[:, f : f + 1] @ row,
        C=plant.C + gain * plant.F[:, f : f + 1] @ row,
        Cz=plant.Cz + gain * plant.Fz[:, f : f + 1] @ row,
    )
