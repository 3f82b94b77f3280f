"""Frequency responses of a plant, as plain complex arrays at given frequencies.

Synthesis, margins and verification work on these numbers and nothing else, so a plant may
be of any order, carry exact delays, or be no finite-dimensional model at all (the exact
distributed rope of `models.plant.line` gives the same type).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from ..basics import ComplexArray, FloatArray, pick


@dataclass(frozen=True, kw_only=True, eq=False)
class PlantResponse:
    """The four blocks of a plant at k points s, delays and rates included.

    ``z = zw w + zu u`` and ``y = yw w + yu u``; with u = C y the closed loop is
    ``zw + zu C (I - yu C)^-1 yw``.
    """

    s: ComplexArray  #: The points in the complex plane [1/s], (k,).
    #: Blocks, (k, nz, nw), (k, nz, nu), (k, ny, nw), (k, ny, nu), complex.  Disturbances that are
    #: the rate of another one are folded into it, so nw counts independent ones.
    zw: ComplexArray
    zu: ComplexArray
    yw: ComplexArray
    yu: ComplexArray
    #: Names along the axes.
    inputs: tuple[str, ...]
    disturbances: tuple[str, ...]
    measurements: tuple[str, ...]
    outputs: tuple[str, ...]

    def __post_init__(self) -> None:
        for array in (self.s, self.zw, self.zu, self.yw, self.yu):
            array.setflags(write=False)

    @cached_property
    def omega(self) -> FloatArray:
        """Frequencies, the imaginary parts of the points [rad/s], (k,)."""
        return self.s.imag.copy()

    def column(self, output: str, disturbance: str) -> ComplexArray:
        """Return the open-loop response of `output` to `disturbance`, (k,).

        Raises InputError if a name is unknown.
        """
        row = pick("plant response", "output", self.outputs, [output])[0]
        column = pick("plant response", "disturbance", self.disturbances, [disturbance])[0]
        return self.zw[:, row, column]

    def select(
        self,
        *,
        outputs: Sequence[str] | None = None,
        disturbances: Sequence[str] | None = None,
        measurements: Sequence[str] | None = None,
    ) -> PlantResponse:
        """Return the response of some signals only, in the order given.

        Raises InputError if a name is unknown.
        """
        if outputs is not None:
            z = pick("plant response", "output", self.outputs, outputs)
            self = replace(self, zw=self.zw[:, z], zu=self.zu[:, z], outputs=tuple(outputs))
        if disturbances is not None:
            w = pick("plant response", "disturbance", self.disturbances, disturbances)
            zw, yw = self.zw[:, :, w], self.yw[:, :, w]
            self = replace(self, zw=zw, yw=yw, disturbances=tuple(disturbances))
        if measurements is not None:
            y = pick("plant response", "measurement", self.measurements, measurements)
            yw, yu = self.yw[:, y], self.yu[:, y]
            self = replace(self, yw=yw, yu=yu, measurements=tuple(measurements))
        return self
