"""The drum: its pitch radius for the rope that is still on it.

Rope lies on the drum in layers.  The more is paid out, the fewer layers are left and the smaller
is the radius at which the rope pulls; the motor's torque and speed hang on it.  The layers come
from a table (pitch diameter, and rope on the drum up to that layer) or from the drum's geometry;
a fixed `radius` overrides both.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from ..basics import InputError
from ..casefile import Quantity, Section, custom_error
from .tables import DRUM_LAYERS


class DrumLayer(Section):
    """One layer of rope on the drum."""

    pitch_diameter: Annotated[float, Quantity("length", 0.05, 50.0)]
    """Diameter of the circle on which the rope's centre lies in this layer."""
    rope_on_drum: Annotated[float, Quantity("length", 0.1, 50000.0)]
    """Rope on the drum when it is full up to this layer (cumulative)."""


class DrumGeometry(Section):
    """A drum by its dimensions."""

    core_diameter: Annotated[float, Quantity("length", 0.05, 50.0)]
    """Diameter of the bare drum."""
    width: Annotated[float, Quantity("length", 0.05, 50.0)]
    """Width between the flanges."""
    layers: Annotated[int, Quantity("count", 1, 60)]
    """Number of layers that fit under the flanges."""
    wraps: Annotated[int, Quantity("count", 1, 1000)] | None = None
    """Wraps in a layer; by default as many rope diameters as fit in the width."""
    layer_step: Annotated[float, Quantity("ratio", 0.5, 1.0)] = math.sqrt(3.0) / 2.0
    """Height of a layer over the rope's diameter; by default that of rope nested in the
    grooves of the layer below, sin 60 deg."""

    def table(self, rope_diameter: float) -> tuple[DrumLayer, ...]:
        """Return the layers for a rope diameter [m], from the bare drum outwards.

        Raises
        ------
        InputError
            If the rope is wider than the drum.
        """
        wraps = self.wraps or math.floor(self.width / rope_diameter * (1.0 + 1e-12))
        if wraps < 1:
            raise InputError(
                f"width must be at least the rope's diameter, {rope_diameter:g} m, "
                f"got {self.width:g} m"
            )
        layers, length = [], 0.0
        for i in range(self.layers):
            pitch = self.core_diameter + (1.0 + 2.0 * i * self.layer_step) * rope_diameter
            length += math.pi * pitch * wraps
            layers.append(DrumLayer(pitch_diameter=pitch, rope_on_drum=length))
        return tuple(layers)


def _named_layers(value: Any) -> Any:
    """Replace the name of a table by its layers."""
    if not isinstance(value, str):
        return value
    if value not in DRUM_LAYERS:
        raise custom_error(
            f"must be a list of layers or one of {', '.join(map(repr, DRUM_LAYERS))}, got {value!r}"
        )
    return [
        {"pitch_diameter": pitch, "rope_on_drum": length} for pitch, length in DRUM_LAYERS[value]
    ]


_Layers = Annotated[
    tuple[DrumLayer, ...],
    Field(min_length=1),
    BeforeValidator(_named_layers, json_schema_input_type=str | tuple[DrumLayer, ...]),
]


class Drum(Section):
    """The drum and the rope on it."""

    alternatives = (("layers", "geometry"),)

    radius: Annotated[float, Quantity("length", 0.02, 25.0)] | None = None
    """Radius from the drum's axis to the rope's centre; overrides layers and geometry."""
    layers: _Layers | None = None
    """Layers of rope from the bare drum outwards, or the name of a table:
    `american-hoist-1000` (1975 thesis, Table 6)."""
    geometry: DrumGeometry | None = None
    """The drum's dimensions, from which the layers are computed."""
    rope_on_drum_total: Annotated[float, Quantity("length", 1.0, 50000.0)] | None = None
    """Rope on the drum when none is paid out; by default as much as the layers hold."""
    inertia: Annotated[float, Quantity("inertia", 0.0, 1e9)] = 0.0
    """Moment of inertia of the drum with the rope on it, about the drum's axis."""

    def _faults(self) -> Iterator[tuple[str, str]]:
        if self.layers is not None and self.geometry is not None:
            yield ("", "give either layers or geometry, got both")
        elif self.radius is None and self.layers is None and self.geometry is None:
            yield ("", "give one of radius, layers and geometry, got none")
        if self.layers is not None:
            for name in ("pitch_diameter", "rope_on_drum"):
                values = [getattr(layer, name) for layer in self.layers]
                for i, (inner, outer) in enumerate(itertools.pairwise(values), 1):
                    if outer <= inner:
                        text = f"must grow from layer to layer, got {inner:g} m then {outer:g} m"
                        yield (f"layers.{i}.{name}", text)

    def radius_at(self, paid_out: float, rope_diameter: float) -> float:
        """Return the pitch radius with a length of rope paid out.

        Parameters
        ----------
        paid_out
            Rope paid out [m].
        rope_diameter
            Nominal diameter of the rope [m]; matters for a drum given by its geometry.

        Returns
        -------
        float
            Radius from the drum's axis to the centre of the rope's topmost layer [m].

        Raises
        ------
        InputError
            If more rope is paid out than the drum has, or more is on it than its layers hold.
        """
        if self.radius is not None:
            return self.radius
        lays, total = self.lays(rope_diameter), self.total(rope_diameter)
        if paid_out > total:
            raise InputError(
                f"the drum holds {total:.4g} m of rope, less than the {paid_out:g} m paid out"
            )
        return next((radius for start, radius in lays if paid_out >= start), lays[-1][1])

    def total(self, rope_diameter: float) -> float:
        """Return the rope on the drum when none is paid out [m]; infinite where not known."""
        if self.rope_on_drum_total is not None:
            return self.rope_on_drum_total
        layers = self._table(rope_diameter)
        return layers[-1].rope_on_drum if layers else math.inf

    def lays(self, rope_diameter: float) -> tuple[tuple[float, float], ...]:
        """Return (rope paid out from which a radius holds, that radius) [m], innermost first.

        The innermost layer holds from there to the end of the rope, every other one to the
        start of the one before it.

        Raises
        ------
        InputError
            If more rope is on the drum than its layers hold.
        """
        if self.radius is not None:
            return ((0.0, self.radius),)
        layers, total = self._table(rope_diameter), self.total(rope_diameter)
        capacity = layers[-1].rope_on_drum
        if total > capacity * (1.0 + 1e-9):
            raise InputError(
                f"rope_on_drum_total must be at most what {len(layers)} layers hold, "
                f"{capacity:.4g} m, got {total:g} m"
            )
        return tuple((total - layer.rope_on_drum, layer.pitch_diameter / 2.0) for layer in layers)

    def _table(self, rope_diameter: float) -> tuple[DrumLayer, ...]:
        return self.layers or (self.geometry.table(rope_diameter) if self.geometry else ())
