"""Frequency responses of a plant, as plain complex arrays at given frequencies.

Synthesis, margins and verification work on these numbers and nothing else, so a plant may
be of any order, carry exact delays, or be no finite-dimensional model at all (the exact
distributed rope of `models.plant.line` gives the same type).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from ..basics import ComplexArray, InputError, pick


@dataclass(frozen=True, kw_only=True, eq=False)
class PlantResponse:
    """The four blocks of a plant at k points s, delays and rates included.

    ``z = zw w + zu u`` and ``y = yw w + yu u``; with u = C y the closed loop is
    ``zw + zu C (I - yu C)^-1 yw``.

    Parameters
    ----------
    omega
        Frequencies, the imaginary parts of s [rad/s], (k,).
    zw, zu, yw, yu
        Blocks, (k, nz, nw), (k, nz, nu), (k, ny, nw), (k, ny, nu), complex.  Disturbances
        that are the rate of another one are folded into it, so nw counts independent ones.
    inputs, disturbances, measurements, outputs
        Names along the axes.
    s
        The points in the complex plane [1/s], (k,); i omega unless given.
    """

    omega: npt.NDArray[np.float64]
    zw: ComplexArray
    zu: ComplexArray
    yw: ComplexArray
    yu: ComplexArray
    inputs: tuple[str, ...]
    disturbances: tuple[str, ...]
    measurements: tuple[str, ...]
    outputs: tuple[str, ...]
    s: ComplexArray = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        omega = np.array(self.omega, dtype=np.float64).reshape(-1)
        s = 1j * omega if self.s is None else np.array(self.s, dtype=np.complex128)
        nz, nw = len(self.outputs), len(self.disturbances)
        ny, nu = len(self.measurements), len(self.inputs)
        arrays = {"omega": omega, "s": s}
        for name, rows, columns in (
            ("zw", nz, nw),
            ("zu", nz, nu),
            ("yw", ny, nw),
            ("yu", ny, nu),
        ):
            block = np.array(getattr(self, name), dtype=np.complex128)
            if block.shape != (omega.size, rows, columns):
                raise InputError(
                    f"plant response: {name} must have the shape {(omega.size, rows, columns)} "
                    f"of its frequencies and names, got {block.shape}"
                )
            arrays[name] = block
        for name, array in arrays.items():
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def column(self, output: str, disturbance: str) -> ComplexArray:
        """Return the open-loop response of `output` to `disturbance`, (k,).

        Raises
        ------
        InputError
            If a name is unknown.
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

        Raises
        ------
        InputError
            If a name is unknown.
        """
        outputs = self.outputs if outputs is None else tuple(outputs)
        disturbances = self.disturbances if disturbances is None else tuple(disturbances)
        measurements = self.measurements if measurements is None else tuple(measurements)
        z = pick("plant response", "output", self.outputs, outputs)
        w = pick("plant response", "disturbance", self.disturbances, disturbances)
        y = pick("plant response", "measurement", self.measurements, measurements)
        return replace(
            self,
            zw=self.zw[:, z][:, :, w],
            zu=self.zu[:, z],
            yw=self.yw[:, y][:, :, w],
            yu=self.yu[:, y],
            outputs=tuple(outputs),
            disturbances=tuple(disturbances),
            measurements=tuple(measurements),
        )
