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
    """A plant with a controller around it, known by their responses.

    Attributes
    ----------
    plant
        The plant, its drag in it and its delays exact.
    law
        The controller's matrices, for u = +C y.
    marks
        Poles [1/s] near which something happens: of the open and of the closed loop.
    exact
        Points s -> the plant's blocks, where they are not those of `plant` (a distributed rope).
    shown
        What the reference unit shows of the hook's motion over what it should, its gain and phase
        error [-].
    """

    plant: LinearPlant
    law: LawMatrices
    marks: ComplexArray
    exact: Callable[[ComplexArray], PlantResponse] | None = None
    shown: complex = 1.0
    _known: dict[bytes, tuple[PlantResponse, ComplexArray]] = field(default_factory=dict)

    def blocks(self, s: ComplexArray) -> PlantResponse:
        """Return the plant's four blocks at points s [1/s]."""
        return self.plant.response_at(s) if self.exact is None else self.exact(s)

    def difference(self, s: ComplexArray) -> ComplexArray:
        """Return det(I - C P_yu), (k,)."""
        return np.asarray(np.linalg.det(self._matrix(s, self.blocks(s))), dtype=np.complex128)

    def broken(self, index: int) -> Function:
        """Return 1 + L of loop `index`, all others closed, as a function of s."""

        def difference(s: ComplexArray) -> ComplexArray:
            matrix = self._matrix(s, self.blocks(s))
            if matrix.shape[1] == 1:
                return matrix[:, 0, 0]
            return np.asarray(1.0 / np.linalg.inv(matrix)[:, index, index])

        return difference

    def transfer(
        self, s: ComplexArray, outputs: Sequence[str], disturbances: Sequence[str]
    ) -> ComplexArray:
        """Return the closed-loop responses, (k, outputs, disturbances)."""
        whole, inner = self._closed(s)
        blocks = whole.select(outputs=outputs, disturbances=disturbances)
        seen = np.array(blocks.yw)
        if self.shown != 1.0:
            unit = [k for k, y in enumerate(blocks.measurements) if y.startswith("mru.")]
            hook = [k for k, w in enumerate(blocks.disturbances) if w == HOOK]
            seen[np.ix_(range(len(s)), unit, hook)] *= self.shown
        return np.asarray(blocks.zw + blocks.zu @ (inner @ seen), dtype=np.complex128)

    def _closed(self, s: ComplexArray) -> tuple[PlantResponse, ComplexArray]:
        """Return the plant's blocks and (I - C P_yu)^-1 C, (k, nu, ny).

        They are kept: other outputs, and other signs of the unit's errors, ask for the same points.
        """
        key = s.tobytes()
        if key not in self._known:
            blocks = self.blocks(s)
            if len(self._known) >= _KEPT:
                self._known.clear()
            inner = np.linalg.solve(self._matrix(s, blocks), self.law(s)).astype(np.complex128)
            self._known[key] = blocks, inner
        return self._known[key]

    def _matrix(self, s: ComplexArray, blocks: PlantResponse) -> ComplexArray:
        through = self.law(s) @ blocks.yu
        return np.asarray(np.eye(through.shape[1]) - through, dtype=np.complex128)


@dataclass(frozen=True, kw_only=True, eq=False)
class Source:
    """One disturbance: name, one-sided density per rad/s, band [rad/s] or None, kinks [rad/s]."""

    name: str
    density: Callable[[FloatArray], FloatArray]
    band: tuple[float, float] | None
    splits: tuple[float, ...] = ()


def correlation(
    loop: Loop,
    pair: Sequence[str],
    sizes: Sequence[float],
    sources: Sequence[SpectralSource],
    *,
    delay: float = 0.0,
) -> float:
    """Return the correlation of two closed-loop outputs, from the variance of their sum.

    Parameters
    ----------
    loop, sources, delay
        As `moments` takes them.
    pair, sizes
        The outputs, and their standard deviations, by which they are divided first.
    """
    mixed = np.array([[1.0 / size for size in sizes]])
    both = _integrals(loop, pair, sources, mixed, orders=(0,), rtol=1e-8, delay=delay)
    return float(np.clip(0.5 * both[0, 0] - 1.0, -1.0, 1.0))


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
        The moments' orders.
    rtol
        Relative accuracy.
    delay
        Longest delay in the loop [s], which makes integrals over the half line ring for ever.

    Raises
    ------
    SolverError
        If it does not converge: the integral does not exist, or a spectrum is wild.
    """
    plain = np.eye(len(outputs))
    rows = _integrals(loop, outputs, sources, plain, orders=orders, rtol=rtol, delay=delay)
    return {name: tuple(float(v) for v in row) for name, row in zip(outputs, rows, strict=True)}


def _integrals(
    loop: Loop,
    outputs: Sequence[str],
    sources: Sequence[SpectralSource],
    mixed: FloatArray,
    *,
    orders: Sequence[int],
    rtol: float,
    delay: float,
) -> FloatArray:
    """Return the moments of sums of outputs with the weights `mixed`, (sums, outputs)."""
    names = [source.name for source in sources]
    powers = np.asarray(orders, dtype=np.float64)[:, None]
    low, high, splits, half_line = _band(sources, loop.marks)
    longest, tail = np.inf, _SMOOTH_TAIL
    if half_line and delay > 0.0:
        longest, tail = 4.0 * np.pi / delay, _RINGING_TAIL
        high = max(high, _RUNG_OUT / delay)
    edges = panels(low, high, splits, loop.marks, longest)

    def density(omega: FloatArray) -> FloatArray:
        """Return omega^n S of every output, (outputs * orders, k)."""
        gains = np.abs(mixed @ loop.transfer(imaginary(omega), outputs, names)) ** 2
        shaken = np.stack([source.density(omega) for source in sources])
        spectra = np.einsum("kzw,wk->zk", gains, shaken)
        return np.asarray((spectra[:, None] * omega**powers).reshape(-1, omega.size))

    found = integrate(density, edges, rtol=rtol, tail_panels=tail if half_line else 0)
    return found.reshape(len(mixed), -1)


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

    Parameters
    ----------
    plant
        The plant, its delays replaced by rational models.
    law
        The controller.
    sources
        By name of a disturbance: a shaping filter, or the intensity of white noise.  Infinite
        variances (white noise straight through to an output) come out as infinity.

    Raises
    ------
    SolverError
        If a disturbance is white and the plant wants its rate as well.
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
