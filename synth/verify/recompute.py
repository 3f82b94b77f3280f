r"""A closed loop computed a second time, by other formulas than those that designed it.

The optimiser closes the loop by hand-written elimination on its nodes and integrates with
`models.basics.quadrature`.  Here the loop is closed by LAPACK on stacked matrices, spectra are
integrated by other rules on other panels (`synth.verify.integrals`), and white noise goes through a
Lyapunov equation.  Only the plant's own responses and matrices are common to both.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.linalg

from models.basics import ComplexArray, FloatArray, SolverError
from models.plant import LinearPlant, PlantResponse, ShapingFilter

from .claims import ControllerMatrices, SpectralSource
from .integrals import integrate, panels
from .winding import Function

HOOK = "hook.heave"
_SMOOTH_TAIL, _RINGING_TAIL = 20, 1000  # panels of 1/omega above all poles
_RUNG_OUT = 3000.0  # omega times delay where the ringing is too small to matter


def imaginary(omega: npt.ArrayLike) -> ComplexArray:
    """Return i omega, (k,) [1/s]."""
    return np.asarray(1j * np.asarray(omega, dtype=np.float64), dtype=np.complex128)


@dataclass(frozen=True, kw_only=True, eq=False)
class LawMatrices:
    """A controller's matrices in the order of the plant's measurements and inputs."""

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray

    @classmethod
    def of(cls, controller: ControllerMatrices, plant: LinearPlant) -> LawMatrices:
        """Return a controller's matrices, with zeros for what it does not hear or move."""
        y = [plant.measurements.index(name) for name in controller.measurements]
        u = [plant.inputs.index(name) for name in controller.inputs]
        n, ny, nu = len(controller.A), len(plant.measurements), len(plant.inputs)
        B, C, D = np.zeros((n, ny)), np.zeros((nu, n)), np.zeros((nu, ny))
        B[:, y] = controller.B
        C[u] = controller.C
        D[np.ix_(u, y)] = controller.D
        return cls(A=np.array(controller.A), B=B, C=C, D=D)

    def __call__(self, s: ComplexArray) -> ComplexArray:
        """Return C(s) at points s [1/s], (k, nu, ny), not finite at a pole."""
        T, into, out_of = self._triangular
        rows = np.empty((len(T), len(self.C), s.size), dtype=np.complex128)  # of C (s I - A)^-1
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            for j, column in enumerate(T.T):
                known = np.tensordot(column[:j], rows[:j], axes=1)
                rows[j] = (out_of[:, j, None] + known) / (s - T[j, j])
            return np.asarray(self.D + np.tensordot(rows, into, axes=(0, 0)).transpose(1, 0, 2))

    @cached_property
    def _triangular(self) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """T, upper triangular, and B and C in its coordinates."""
        balanced, (scale, _) = scipy.linalg.matrix_balance(self.A, permute=False, separate=True)
        T, turned = scipy.linalg.schur(balanced, output="complex")
        return T, turned.conj().T @ (self.B / scale[:, None]), (self.C * scale) @ turned


@dataclass(frozen=True, kw_only=True, eq=False)
class Loop:
    """A plant with a controller around it, known by their responses."""

    plant: LinearPlant  #: The plant, its drag in it and its delays exact.
    law: LawMatrices  #: The controller's matrices, for u = +C y.
    #: Poles [1/s] near which something happens: of the open and of the closed loop.
    marks: ComplexArray
    #: Points s and names of disturbances -> the plant's blocks, where they are not those of `plant`
    #: (a distributed rope).
    exact: Callable[[ComplexArray, Sequence[str]], PlantResponse] | None = None
    _parts: dict[Any, LinearPlant] = field(default_factory=dict)

    def blocks(
        self, s: ComplexArray, outputs: Sequence[str] = (), disturbances: Sequence[str] = ()
    ) -> PlantResponse:
        """Return the plant's four blocks at points s [1/s], of as many signals as are wanted."""
        if self.exact is not None:
            return self.exact(s, disturbances).select(outputs=outputs, disturbances=disturbances)
        key = tuple(outputs), tuple(disturbances)
        if key not in self._parts:
            self._parts[key] = self.plant.select(outputs=outputs, disturbances=disturbances)
        return self._parts[key].response_at(s)

    def difference(self, s: ComplexArray) -> ComplexArray:
        """Return det(I - C P_yu), (k,)."""
        matrix = self._matrix(self.law(s), self.blocks(s))
        if matrix.shape[1] == 1:
            return matrix[:, 0, 0]
        return np.asarray(np.linalg.det(matrix), dtype=np.complex128)

    def broken(self, index: int) -> Function:
        """Return 1 + L of loop `index`, all others closed, as a function of s."""
        if len(self.plant.inputs) == 1:
            return self.difference

        def difference(s: ComplexArray) -> ComplexArray:
            matrix = self._matrix(self.law(s), self.blocks(s))
            return np.asarray(1.0 / np.linalg.inv(matrix)[:, index, index])

        return difference

    def transfers(
        self,
        s: ComplexArray,
        outputs: Sequence[str],
        disturbances: Sequence[str],
        shown: Sequence[complex] = (),
    ) -> tuple[ComplexArray, list[ComplexArray]]:
        """Return the closed-loop responses, (k, outputs, disturbances), and some to the hook.

        Those are columns (k, outputs) by what the reference unit shows of the hook's heave, over
        what it should, with its gain and phase error [-]; none if the hook is no disturbance.
        """
        blocks, law = self.blocks(s, outputs, disturbances), self.law(s)
        matrix = self._matrix(law, blocks)
        alone = matrix.shape[1] == 1
        inner = np.asarray(law / matrix if alone else np.linalg.solve(matrix, law))
        found = np.asarray(blocks.zw + _product(blocks.zu, _product(inner, blocks.yw)))
        if HOOK not in disturbances:
            return found, []
        hook = list(disturbances).index(HOOK)
        unit = [k for k, y in enumerate(blocks.measurements) if y.startswith("mru.")]
        moved = _product(inner[:, :, unit], blocks.yw[:, unit, hook, None])
        by_unit = _product(blocks.zu, moved)[:, :, 0]
        return found, [found[:, :, hook] + (one - 1.0) * by_unit for one in shown]

    @staticmethod
    def _matrix(law: ComplexArray, blocks: PlantResponse) -> ComplexArray:
        through = _product(law, blocks.yu)
        return np.asarray(np.eye(through.shape[1]) - through, dtype=np.complex128)


def _product(left: ComplexArray, right: ComplexArray) -> ComplexArray:
    """Return products of small matrices, (k, n, m) and (k, m, l): LAPACK is slow with many."""
    return np.asarray(np.einsum("knm,kml->knl", left, right), dtype=np.complex128)


@dataclass(frozen=True, kw_only=True, eq=False)
class Source:
    """One disturbance: name, one-sided density per rad/s, band [rad/s] or None, kinks [rad/s]."""

    name: str
    density: Callable[[FloatArray], FloatArray]
    band: tuple[float, float] | None
    splits: tuple[float, ...] = ()


def moments(
    loop: Loop,
    outputs: Sequence[str],
    sources: Sequence[SpectralSource],
    *,
    orders: Sequence[int] = (0, 2),
    rtol: float = 1e-8,
    delay: float = 0.0,
) -> dict[str, tuple[float, ...]]:
    """Return spectral moments of closed-loop outputs, m_n = integral of omega^n S.

    The band is cut into panels, none longer than twice its distance from a pole; see
    `synth.verify.integrals`.

    Parameters
    ----------
    loop
        The closed loop, stable.
    outputs
        Performance outputs.
    sources
        What shakes it; one without a band makes the integral run over the half line.
    orders
        The moments' orders, 0 the first.
    rtol
        Relative accuracy.
    delay
        Longest delay in the loop [s], which makes integrals over the half line ring for ever.

    Raises
    ------
    SolverError
        If it does not converge: the integral does not exist, or a spectrum is wild.
    """
    views = [(1.0 + 0.0j, sources)]
    return moments_of_views(loop, outputs, views, orders=orders, rtol=rtol, delay=delay)[0]


def moments_of_views(
    loop: Loop,
    outputs: Sequence[str],
    views: Sequence[tuple[complex, Sequence[SpectralSource]]],
    *,
    pairs: Mapping[str, Sequence[str]] = MappingProxyType({}),
    orders: Sequence[int] = (0, 2),
    rtol: float = 1e-8,
    delay: float = 0.0,
) -> list[dict[str, tuple[float, ...]]]:
    """Return `moments` for each of several views of what shakes a loop, all in one go.

    A view is what the reference unit shows, see `Loop.transfers`, and the sources; these have the
    same names in all views.  With `pairs`, two outputs by a name, it tells their correlation too,
    by the variance of their sum.
    """
    every = {id(source): source for _, sources in views for source in sources}
    names = [source.name for source in views[0][1]]
    powers = np.asarray(orders, dtype=np.float64)[:, None]
    low, high, splits, half_line = _band([*every.values()], loop.marks)
    longest, tail = np.inf, _SMOOTH_TAIL
    if half_line and delay > 0.0:
        longest, tail = 4.0 * np.pi / delay, _RINGING_TAIL
        high = max(high, _RUNG_OUT / delay)
    edges = panels(low, high, splits, loop.marks, longest)
    couples = [[outputs.index(name) for name in pair] for pair in pairs.values()]
    mixed = np.zeros((len(couples), len(outputs)))

    def squared(transfer: ComplexArray) -> FloatArray:
        """Return the squared sizes of responses and of sums of them, (k, sums, ...)."""
        if len(mixed):
            sums = np.einsum("cz,kz...->kc...", mixed, transfer)
            transfer = np.concatenate([transfer, sums], axis=1)
        return np.asarray(transfer.real**2 + transfer.imag**2)

    def density(omega: FloatArray) -> FloatArray:
        """Return omega^n S of every sum of outputs, (views * sums * orders, k)."""
        shaken = {key: source.density(omega) for key, source in every.items()}
        shown = [one for one, _ in views]
        found, columns = loop.transfers(imaginary(omega), outputs, names, shown)
        sizes, spectra = squared(found), []
        for k, (_, sources) in enumerate(views):
            if columns:
                sizes[:, :, names.index(HOOK)] = squared(columns[k])
            own = np.stack([shaken[id(source)] for source in sources])
            spectra.append(np.einsum("kzw,wk->zk", sizes, own))
        return np.asarray((np.stack(spectra)[:, :, None] * omega**powers).reshape(-1, omega.size))

    if couples:
        # Of outputs of about the same size, whatever their units.
        rough = density(edges).reshape(len(views), -1, len(orders), edges.size)[0, :, 0]
        size = np.sqrt(np.trapezoid(rough[: len(outputs)], edges))
        weights = np.array([[i in couple for i in range(len(outputs))] for couple in couples])
        mixed = weights / np.where(size > 0.0, size, 1.0)
    found = integrate(density, edges, rtol=rtol, tail_panels=tail if half_line else 0)
    rows = found.reshape(len(views), -1, len(orders))
    told = []
    for own in rows.tolist():
        one = {name: tuple(row) for name, row in zip(outputs, own, strict=False)}
        for k, (name, couple) in enumerate(zip(pairs, couples, strict=True)):
            parts = mixed[k, couple] * np.sqrt([own[i][0] for i in couple])
            whole = own[len(outputs) + k][0]
            rho = (whole - parts @ parts) / (2.0 * parts.prod()) if parts.all() else 0.0
            one[name] = (float(np.clip(rho, -1.0, 1.0)),)
        told.append(one)
    return told


def closed_matrices(
    plant: LinearPlant, law: LawMatrices
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return A, E, Cz, Fz of the closed loop, its states those of plant and controller.

    E and Fz have a column for every disturbance, rates included.  Delays are ignored: replace
    them first.
    """
    inner = np.linalg.inv(np.eye(len(plant.inputs)) - law.D @ plant.D)
    # u = on_plant x + on_law x_k + direct w
    on_plant, on_law, direct = inner @ law.D @ plant.C, inner @ law.C, inner @ law.D @ plant.F
    heard = np.hstack([plant.C + plant.D @ on_plant, plant.D @ on_law])
    A = np.vstack(
        [
            np.hstack([plant.A + plant.B @ on_plant, plant.B @ on_law]),
            law.B @ heard + np.hstack([np.zeros((len(law.A), len(plant.A))), law.A]),
        ]
    )
    E = np.vstack([plant.E + plant.B @ direct, law.B @ (plant.F + plant.D @ direct)])
    Cz = np.hstack([plant.Cz + plant.Dz @ on_plant, plant.Dz @ on_law])
    return A, E, Cz, np.asarray(plant.Fz + plant.Dz @ direct)


def lyapunov_variances(
    plant: LinearPlant, law: LawMatrices, sources: Mapping[str, ShapingFilter | float]
) -> dict[str, float]:
    """Return the variance of every output from a Lyapunov equation; the loop must be stable.

    The plant's delays are replaced by rational models, and the law is the controller's.  A source
    is, by name of a disturbance, a shaping filter, or the intensity of white noise.  Infinite
    variances (white noise straight through to an output) come out as infinity.

    Raises SolverError if a disturbance is white and the plant wants its rate as well.
    """
    A, E, Cz, Fz = closed_matrices(plant, law)
    noise = len(sources)
    drive, direct = np.zeros((len(A), noise)), np.zeros((len(Cz), noise))
    for j, (name, source) in enumerate(sources.items()):
        base = plant.disturbances.index(name)
        rates = [plant.disturbances.index(r) for r, of in plant.rates.items() if of == name]
        if not isinstance(source, ShapingFilter):
            if rates and np.any(E[:, rates]):
                raise SolverError(f"verification: the rate of {name} is wanted, which is white")
            drive[: len(E), j] = np.sqrt(source) * E[:, base]
            direct[:, j] = np.sqrt(source) * Fz[:, base]
            continue
        # w = C_f x_f and, for its rate, C_f A_f x_f
        row, rate = source.C, source.C @ source.A
        into = E[:, [base]] @ row + sum(E[:, [r]] @ rate for r in rates)
        seen = Fz[:, [base]] @ row + sum(Fz[:, [r]] @ rate for r in rates)
        n, m = len(A), source.order
        into = np.vstack([into, np.zeros((n - len(E), m))])
        A = np.block([[A, into], [np.zeros((m, n)), source.A]])
        Cz = np.hstack([Cz, seen])
        drive = np.vstack([drive, np.zeros((m, noise))])
        drive[n:, j] = source.B[:, 0]
    # Balanced, as angles, volts and filter states differ by many orders of size.
    balanced, scales = scipy.linalg.matrix_balance(A, permute=False, separate=True)
    scale = np.asarray(scales[0], dtype=np.float64)
    drive, seen_by = drive / scale[:, None], Cz * scale
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", scipy.linalg.LinAlgWarning)
        covariance = scipy.linalg.solve_continuous_lyapunov(balanced, -drive @ drive.T)
    variances = np.einsum("zi,ij,zj->z", seen_by, covariance, seen_by)
    variances = np.where(np.any(direct != 0.0, axis=1), np.inf, variances)
    return dict(zip(plant.outputs, (float(v) for v in variances), strict=True))


def _band(
    sources: Sequence[SpectralSource], marks: ComplexArray
) -> tuple[float, float, list[float], bool]:
    """Return the band [rad/s], the kinks in it, and whether to go on to zero and infinity."""
    splits = [w for source in sources for w in source.splits]
    bands = [source.band for source in sources if source.band is not None]
    if len(bands) == len(sources):
        return min(b[0] for b in bands), max(b[1] for b in bands), splits, False
    sizes = np.abs(marks)
    sizes = sizes[sizes > 1e-9 * sizes.max(initial=0.0)]
    ends = [w for band in bands for w in band] + splits
    low = min([0.1 * float(sizes.min(initial=1.0)), *ends])
    high = max([10.0 * float(sizes.max(initial=1.0)), *ends])
    return low, high, [*splits, *ends], True
