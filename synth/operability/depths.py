"""What a length of rope changes: the drum's layer, the torque at rest, the rope's stiffness."""

from __future__ import annotations

from dataclasses import dataclass

from models.case import Case


@dataclass(frozen=True, kw_only=True)
class RopeState:
    """Rope and drum with a length paid out.

    Attributes
    ----------
    length
        Rope paid out [m].
    layer, layers
        Layer of the drum from which the rope leaves, 1 the bare drum, and how many the full drum
        has; 0 where the case gives a radius instead of layers.
    radius
        Pitch radius of the drum [m].
    tension, torque
        Rope tension at the winch [N] and motor torque with the gear's losses [N m], at rest.
    stiffness
        EA/L [N/m].
    """

    length: float
    layer: int
    layers: int
    radius: float
    tension: float
    torque: float
    stiffness: float

    def __str__(self) -> str:
        """Return the state in a line."""
        layer = f"layer {self.layer} of {self.layers}, " if self.layers else ""
        return (
            f"{self.length:g} m: {layer}drum radius {self.radius:.4g} m, torque at rest "
            f"{1e-3 * self.torque:.3g} kN m, stiffness {1e-3 * self.stiffness:.3g} kN/m"
        )


def rope_state(case: Case) -> RopeState:
    """Return the state of rope and drum in a case.

    Raises
    ------
    InputError
        If the drum does not hold so much rope.
    """
    drum, length = case.winch.drum, case.rope.length
    radius = case.drum_radius
    layer = layers = 0
    if drum.radius is None:
        lays = drum.lays(case.rope.diameter)  # the bare drum first
        # Layers that never hold rope, because the drum is not full, do not count.
        layers = sum(1 for k in range(len(lays)) if k == 0 or lays[k - 1][0] > 0.0)
        layer = 1 + next((k for k, (start, _) in enumerate(lays) if length >= start), len(lays) - 1)
    return RopeState(
        length=length,
        layer=layer,
        layers=layers,
        radius=radius,
        tension=case.static_tension,
        torque=case.static_torque_budget,
        stiffness=case.rope.stiffness,
    )
