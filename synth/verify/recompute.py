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
from functools import partial
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
_KEPT = 8  # sets of points whose responses are kept
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
        """Return C(s) at points s [1/s], (k, nu, ny)."""
        inverse = np.linalg.inv(s[:, None, None] * np.eye(len(self.A)) - self.A)
        return np.asarray(self.D + self.C @ inverse @ self.B, dtype=np.complex128)


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
    _known: dict[Any, tuple[PlantResponse, ComplexArray]] = field(default_factory=dict)
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
        return np.asarray(np.linalg.det(matrix), dtype=np.complex128)

    def broken(self, index: int) -> Function:
        """Return 1 + L of loop `index`, all others closed, as a function of s."""

        def difference(s: ComplexArray) -> ComplexArray:
            matrix = self._matrix(self.law(s), self.blocks(s))
            if matrix.shape[1] == 1:
                return matrix[:, 0, 0]
            return np.asarray(1.0 / np.linalg.inv(matrix)[:, index, index])

        return difference

    def transfer(
        self, s: ComplexArray, outputs: Sequence[str], disturbances: Sequence[str]
    ) -> ComplexArray:
        """Return the closed-loop responses, (k, outputs, disturbances)."""
        return self.transfers(s, outputs, disturbances, (1.0,))[0]

    def transfers(
        self,
        s: ComplexArray,
        outputs: Sequence[str],
        disturbances: Sequence[str],
        shown: Sequence[complex],
    ) -> list[ComplexArray]:
        """Return `transfer` by what the reference unit shows of the hook's motion.

        That is over what it should show, with its gain and phase error [-].
        """
        key = s.tobytes(), tuple(outputs), tuple(disturbances)
        if key not in self._known:
            blocks, law = self.blocks(s, outputs, disturbances), self.law(s)
            if len(self._known) >= _KEPT:
                self._known.clear()
            inner = np.linalg.solve(self._matrix(law, blocks), law)
            self._known[key] = blocks, np.asarray(blocks.zu @ inner, dtype=np.complex128)
        blocks, through = self._known[key]
        unit = [k for k, y in enumerate(blocks.measurements) if y.startswith("mru.")]
        found = []
        for one in shown:
            seen = blocks.yw
            if one != 1.0 and HOOK in disturbances:
                seen = np.array(seen)
                seen[:, unit, list(disturbances).index(HOOK)] *= one
            found.append(np.asarray(blocks.zw + through @ seen, dtype=np.complex128))
        return found

    @staticmethod
    def _matrix(law: ComplexArray, blocks: PlantResponse) -> ComplexArray:
        through = law @ blocks.yu
        return np.asarray(np.eye(through.shape[1]) - through, dtype=np.complex128)


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
    pairs: Mapping[str, Sequence[str]] | None = None,
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
    pairs
        Outputs whose correlation is wanted, two by its name, from the variance of their sum.
    rtol
        Relative accuracy.
    delay
        Longest delay in the loop [s], which makes integrals over the half line ring for ever.

    Raises
    ------
    SolverError
        If it does not converge: the integral does not exist, or a spectrum is wild.
    """
    how = partial(signed_moments, orders=orders, rtol=rtol, delay=delay)
    return how(loop, outputs, sources, (1.0,), pairs=pairs or {})[0]


def signed_moments(
    loop: Loop,
    outputs: Sequence[str],
    sources: Sequence[SpectralSource],
    shown: Sequence[complex],
    *,
    pairs: Mapping[str, Sequence[str]],
    orders: Sequence[int] = (0, 2),
    rtol: float = 1e-8,
    delay: float = 0.0,
) -> list[dict[str, tuple[float, ...]]]:
    """Return `moments` by what the reference unit shows, see `Loop.transfers`."""
    names = [source.name for source in sources]
    powers = np.asarray(orders, dtype=np.float64)[:, None]
    low, high, splits, half_line = _band(sources, loop.marks)
    longest, tail = np.inf, _SMOOTH_TAIL
    if half_line and delay > 0.0:
        longest, tail = 4.0 * np.pi / delay, _RINGING_TAIL
        high = max(high, _RUNG_OUT / delay)
    edges = panels(low, high, splits, loop.marks, longest)
    couples = [[outputs.index(name) for name in pair] for pair in pairs.values()]
    mixed = np.eye(len(outputs))

    def density(omega: FloatArray) -> FloatArray:
        """Return omega^n S of every sum of outputs, (shown * sums * orders, k)."""
        shaken = np.stack([source.density(omega) for source in sources])
        each = loop.transfers(imaginary(omega), outputs, names, shown)
        spectra = [np.einsum("kzw,wk->zk", np.abs(mixed @ one) ** 2, shaken) for one in each]
        return np.asarray((np.stack(spectra)[:, :, None] * omega**powers).reshape(-1, omega.size))

    if couples:
        # Of outputs of about the same size, whatever their units.
        rough = density(edges).reshape(len(shown), len(outputs), len(orders), -1)[0, :, 0]
        size = np.sqrt(np.trapezoid(rough, edges))
        weights = np.array([[i in couple for i in range(len(outputs))] for couple in couples])
        mixed = np.vstack([mixed, weights / np.where(size > 0.0, size, 1.0)])
    found = integrate(density, edges, rtol=rtol, tail_panels=tail if half_line else 0)
    rows = found.reshape(len(shown), len(mixed), len(orders))
    every = []
    for own in rows.tolist():
        one = {name: tuple(row) for name, row in zip(outputs, own, strict=False)}
        for k, (name, couple) in enumerate(zip(pairs, couples, strict=True), len(outputs)):
            parts = mixed[k, couple] * np.sqrt([own[i][0] for i in couple])
            rho = (own[k][0] - parts @ parts) / (2.0 * parts.prod()) if parts.all() else 0.0
            one[name] = (float(np.clip(rho, -1.0, 1.0)),)
        every.append(one)
    return every


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
