"""Frequency responses of a plant, as plain complex arrays at given frequencies.

Synthesis, margins and verification work on these numbers and nothing else, so a plant may
be of any order, carry exact delays, or be no finite-dimensional model at all (the exact
distributed rope of `models.plant.line` gives the same type).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import scipy.linalg

from ..basics import ComplexArray, FloatArray, InputError, check_finite, pick

if TYPE_CHECKING:
    from .linear import LinearPlant

_OWNER = "linear plant"
_CHUNK = 512  # points solved at a time: keeps the stacked (n, k, columns) states in the cache


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


def state_space_response(plant: LinearPlant, s: npt.ArrayLike) -> PlantResponse:
    """Return the response of a linear plant at points `s` [1/s], (k,); see its methods.

    Raises
    ------
    InputError
        If a point is not finite or is a pole of the plant.
    """
    points = np.array(s, dtype=np.complex128).reshape(-1)
    check_finite(_OWNER, "s", points.view(np.float64))
    n, nu = plant.A.shape[0], plant.B.shape[1]
    if n and np.any(points == 0.0) and _integrates(plant.A):
        raise InputError(
            f"{_OWNER}: the response is asked for at s = 0, where the plant has a pole "
            "(an integrator); ask above zero"
        )
    keep = pick(_OWNER, "disturbance", plant.disturbances, plant.independent_disturbances)
    forced = np.hstack([plant.B, plant.E[:, keep], np.zeros_like(plant.E[:, keep])])
    direct_y = np.hstack([plant.D, plant.F[:, keep], np.zeros_like(plant.F[:, keep])])
    direct_z = np.hstack([plant.Dz, plant.Fz[:, keep], np.zeros_like(plant.Fz[:, keep])])
    nw = len(keep)
    for rate, base in plant.rates.items():  # the last nw columns are the ones times s
        i, j = plant.disturbances.index(rate), keep.index(plant.disturbances.index(base))
        forced[:, nu + nw + j] += plant.E[:, i]
        direct_y[:, nu + nw + j] += plant.F[:, i]
        direct_z[:, nu + nw + j] += plant.Fz[:, i]
    y = np.empty((points.size, plant.C.shape[0], nu + nw), dtype=np.complex128)
    z = np.empty((points.size, plant.Cz.shape[0], nu + nw), dtype=np.complex128)
    T, into, out_of = plant.triangular
    for start in range(0, points.size, _CHUNK):
        part = points[start : start + _CHUNK, None, None]
        x = _back_substituted(T, _fold(into @ forced, nu, nw, part), part[:, 0, 0])
        if x is None:
            raise InputError(
                f"{_OWNER}: the response is asked for at a pole of the plant, s = "
                f"{_nearest(plant.poles(), part.ravel()):.6g} 1/s"
            )
        y[start : start + _CHUNK] = (plant.C @ out_of) @ x + _fold(direct_y, nu, nw, part)
        z[start : start + _CHUNK] = (plant.Cz @ out_of) @ x + _fold(direct_z, nu, nw, part)
    y *= np.exp(-points[:, None] * np.array(plant.delays))[:, :, None]
    return PlantResponse(
        omega=points.imag,
        s=points,
        zw=z[:, :, nu:],
        zu=z[:, :, :nu],
        yw=y[:, :, nu:],
        yu=y[:, :, :nu],
        inputs=plant.inputs,
        disturbances=plant.independent_disturbances,
        measurements=plant.measurements,
        outputs=plant.outputs,
    )


def _back_substituted(T: ComplexArray, right: ComplexArray, s: ComplexArray) -> ComplexArray | None:
    """Solve (s I - T) x = right for every point s, (k, n, columns); None at an eigenvalue."""
    n = len(T)
    x = np.empty((n, right.shape[0], right.shape[2]), dtype=np.complex128)
    for i in range(n - 1, -1, -1):
        pivot = s - T[i, i]
        if not np.all(pivot):
            return None
        above = np.tensordot(T[i, i + 1 :], x[i + 1 :], axes=1)
        x[i] = (right[:, i] + above) / pivot[:, None]
    return x.transpose(1, 0, 2)


def _fold(columns: FloatArray | ComplexArray, nu: int, nw: int, s: ComplexArray) -> ComplexArray:
    """Return [inputs, disturbances + s rates] for every point s, (k, rows, nu + nw)."""
    folded: ComplexArray = np.repeat(
        columns[None, :, : nu + nw].astype(np.complex128), len(s), axis=0
    )
    folded[:, :, nu:] += s * columns[None, :, nu + nw :]
    return folded


def _integrates(A: FloatArray) -> bool:
    """Tell whether A is singular; LU hides it behind a pivot of rounding size."""
    values = np.linalg.svd(scipy.linalg.matrix_balance(A, permute=False)[0], compute_uv=False)
    return bool(values[-1] <= 1e-14 * values[0])


def _nearest(poles: ComplexArray, points: ComplexArray) -> complex:
    distance = np.abs(poles[:, None] - points[None, :]).min(axis=1)
    return complex(poles[int(np.argmin(distance))])
