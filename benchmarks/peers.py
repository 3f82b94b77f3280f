r"""The peers of the gain synthesis: what an engineer would reach for without it.

Both answer the question that `synth.design.tuning` answers, the least payload variance within the
limits, for the feedback u = -(k_2 P'' + k_1 P' + k_0 P):

* `differential_evolution`, on an objective that is written for speed: everything that does not
  depend on the gains is computed once, and a whole generation is evaluated by array operations.
* `slsqp`, on python-control objects: the way it is done by hand.

They share with `synth` the plant's matrices and its frequency responses, not the closed loop:
1 + L, the variances, the drag and the peaks are computed here, by formulas of their own.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import scipy.optimize

from models.basics import Quadrature, spectral_nodes
from models.hook import HookMotion
from models.plant import LinearPlant
from synth.limits import Limit, LowFrequency, MaxSensitivity
from synth.loop import Assessment, DragElement, LinearController, disturbances
from synth.structures import PayloadFeedback

if TYPE_CHECKING:
    import control

__all__ = ["Answer", "Exact", "PythonControlLoop", "SampledLoop", "Task", "evolve", "slsqp"]

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

HOOK, PAYLOAD = "hook.heave", "payload.displacement"
VELOCITY, FORCE = "payload.velocity", "payload.force"
PADE = 5  # order of the delay model in the stability test
_PENALTY = 20.0  # on the logarithm of an excess; the limits' prices are of the order of one
_UNSTABLE = 1e3
_BOTTOM, _TOP = 1e-3, 300.0  # of the sensitivity grid [rad/s]
_LIVELY = (0.3, 60.0)  # where loops around a payload on a rope move
_THIN = 15  # points per decade elsewhere
_LIGHT = 0.05  # damping below which an open-loop resonance is narrower than that grid
_ABOUT = np.linspace(-5.0, 5.0, 41)  # ... and gets points of its own, in units of its decay
_VALLEYS = 3
_STEPS = np.array([-0.5, 0.0, 0.5])  # from a pole's frequency, in units of its decay


@dataclass(frozen=True, kw_only=True, eq=False)
class Task:
    """One question for all three.

    Parameters
    ----------
    name
        How the table calls it.
    plant, hook, structure
        What `synth.question.question.pose` makes of a case.
    limits
        Of these kinds: `MaxSensitivity` (always there) and `LowFrequency`.
    box
        Half-width of the search box of each of the gains A a, A a_1, A a_2; the box is
        symmetric, so that it holds both signs of each.
    drag
        Quadratic drag that has to agree with the motion, or None to keep the plant's own.
    """

    name: str
    plant: LinearPlant
    hook: HookMotion
    structure: PayloadFeedback
    limits: tuple[Limit, ...]
    box: tuple[float, float, float]
    drag: DragElement | None = None

    @property
    def max_sensitivity(self) -> float:
        """The bound on M_s."""
        return next(lim.bound for lim in self.limits if isinstance(lim, MaxSensitivity))

    @property
    def low_frequency(self) -> LowFrequency | None:
        """The limit on slow motion, if there is one."""
        return next((lim for lim in self.limits if isinstance(lim, LowFrequency)), None)

    def exact(self, gains: Sequence[float] | FloatArray) -> Exact:
        """Return what gains really do: adaptive quadrature, peaks refined off any grid."""
        law = self.structure.measurements
        gain = [[-float(gains[law.index(name)]) for name in self.plant.measurements]]
        loop = Assessment(
            self.plant,
            LinearController.static(gain, self.plant.measurements, self.plant.inputs),
            disturbances({HOOK: self.hook}, self.plant.independent_disturbances),
            drag=self.drag,
        )
        if self.drag is None and not loop.stable:
            return Exact(rms=np.inf, max_sensitivity=np.inf, excess=np.inf)
        uses = [limit.use(limit.measure(loop)) for limit in self.limits]
        return Exact(
            rms=loop.sigma(PAYLOAD),
            max_sensitivity=loop.margins.max_sensitivity,
            excess=max(uses) - 1.0,
        )


@dataclass(frozen=True, kw_only=True)
class Exact:
    """A design measured without grids: rms [m], M_s, largest relative excess over a limit."""

    rms: float
    max_sensitivity: float
    excess: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Answer:
    """What a peer found: gains A a, A a_1, A a_2, time [s] and evaluations of its objective."""

    gains: FloatArray
    seconds: float
    evaluations: int
    objective: float


class SampledLoop:
    """The closed loop of many gains at once, on frequencies that are fixed beforehand.

    Parameters
    ----------
    task
        The question.
    per_panel
        Quadrature nodes on a panel; panels end at every kink of the RAO's table.
    per_decade
        Points of the sensitivity grid, which is denser at the open loop's resonances.  Each
        loop's highest peaks are looked at between the points too, and so is the neighbourhood
        of its poles: on a plain grid the search finds the gains whose peak it does not see.
    """

    def __init__(self, task: Task, *, per_panel: int = 8, per_decade: int = 120) -> None:
        self.task = task
        plant = task.plant
        poles = plant.poles()
        light = poles[(poles.imag > 0.0) & (np.abs(poles.real) < _LIGHT * poles.imag)]
        self.nodes = quadrature(task, per_panel)
        self.grid = _grid(light, per_decade)
        self._density = task.hook.density(self.nodes.omega) * self.nodes.weights
        self._at_nodes = _Sampled(task, self.nodes.omega)
        self._at_grid = _Sampled(task, self.grid)
        self._rational = plant.without_delays(PADE)
        self._fed_back = self._rational.C[_columns(task)]
        self._force = self._rational.disturbances.index(FORCE)
        self._velocity = self._rational.outputs.index(VELOCITY)
        low = task.low_frequency
        self._at_low = (
            None if low is None else _Sampled(task, np.geomspace(1e-3 * low.below, low.below, 12))
        )

    def objective(self, gains: FloatArray, max_sensitivity: float) -> FloatArray:
        """Return log rms plus penalties for a bound on M_s, of gains (3, m) or (3,)."""
        columns = gains.reshape(3, -1)
        log_rms, peaks, decay, slow = self.measure(columns)
        value = log_rms + _PENALTY * np.maximum(0.0, np.log(peaks / max_sensitivity))
        low = self.task.low_frequency
        if low is not None:
            value += _PENALTY * np.maximum(0.0, np.log(slow / low.bound))
        result = np.where(decay < 0.0, value, _UNSTABLE * (1.0 + np.maximum(decay, 0.0)))
        return np.asarray(result if gains.ndim > 1 else result[0], dtype=np.float64)

    def measure(self, gains: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return log rms, M_s, spectral abscissa and the slow motion's ratio of gains (3, m).

        Where no drag agrees with the motion the abscissa is infinite.
        """
        loop = self._at_nodes.close(gains)
        power = loop.motion.real**2 + loop.motion.imag**2
        added = np.zeros(gains.shape[1])
        found = np.ones(gains.shape[1], dtype=np.bool_)
        if self.task.drag is not None:
            added, found = self._consistent(power, loop.velocity, self.task.drag)
            damped = 1.0 + added * loop.velocity
            power /= damped.real**2 + damped.imag**2
        poles = self._poles(gains, added)
        peaks = self._peaks(gains, added, poles)
        slow = np.zeros(gains.shape[1])
        if self._at_low is not None:
            at_low = self._at_low.close(gains)
            slow = np.abs(at_low.motion / (1.0 + added * at_low.velocity)).max(axis=0)
        decay = np.where(found, poles.real.max(axis=1), np.inf)
        return 0.5 * np.log(self._density @ power), peaks, decay, slow

    def _consistent(
        self, power: FloatArray, velocity: ComplexArray, drag: DragElement
    ) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
        """Return the drag coefficient less the plant's own, and whether there is one.

        Newton's method on log C = log(slope sigma_v(C)), from well above, for all at once.
        """
        squared = (self.nodes.omega**2 * self._density)[:, None] * power
        log_c = np.full(power.shape[1], np.log(3.0 * drag.reference))
        step = np.full_like(log_c, np.inf)
        for _ in range(25):
            c = np.exp(log_c)
            damped = 1.0 + (c - drag.reference) * velocity
            density = squared / (damped.real**2 + damped.imag**2)
            variance = density.sum(axis=0)
            excess = log_c - np.log(drag.slope) - 0.5 * np.log(variance)
            slope = 1.0 + (density * (c * velocity / damped).real).sum(axis=0) / variance
            step = np.clip(-excess / np.maximum(slope, 0.3), -0.5, 0.5)
            log_c = log_c + step
            if float(np.max(np.abs(step))) < 1e-8:
                break
        return np.exp(log_c) - drag.reference, np.abs(step) < 1e-5

    def _poles(self, gains: FloatArray, added: FloatArray) -> ComplexArray:
        """Return the closed loop's poles, (m, n), with Pade models for the delays."""
        plant = self._rational
        matrices = plant.A - np.einsum("i,jm,jk->mik", plant.B[:, 0], gains, self._fed_back)
        if self.task.drag is not None:
            # What the drag does to the payload, and what of it the accelerometer feels at once.
            felt = plant.F[_columns(self.task), self._force] @ gains
            push = plant.E[:, self._force] - felt[:, None] * plant.B[:, 0]
            velocity = plant.Cz[self._velocity]
            matrices = matrices - (added[:, None] * push)[:, :, None] * velocity
        return np.asarray(np.linalg.eigvals(matrices), dtype=np.complex128)

    def _peaks(self, gains: FloatArray, added: FloatArray, poles: ComplexArray) -> FloatArray:
        """Return M_s, (m,): the grid, tops of parabolas on it, and beside the loop's poles."""
        at_grid = self._at_grid.close(gains).difference(added)
        depth = np.log(at_grid.real**2 + at_grid.imag**2)
        half = poles.shape[1] // 2
        upper = np.take_along_axis(poles, np.argsort(-poles.imag, axis=1)[:, :half], axis=1)
        beside = upper.imag[:, :, None] + np.abs(upper.real)[:, :, None] * _STEPS
        omega = np.hstack([self._tops(depth), beside.reshape(len(poles), -1)])
        omega = np.clip(omega, _BOTTOM, _TOP)
        sampled = _Sampled(self.task, omega.ravel(), omega.shape)
        near = sampled.close(gains[:, :, None]).difference(added[:, None])
        largest = np.maximum(np.exp(-0.5 * depth.min(axis=0)), 1.0 / np.abs(near).min(axis=1))
        return np.asarray(largest, dtype=np.float64)

    def _tops(self, depth: FloatArray) -> FloatArray:
        """Return where parabolas through the deepest valleys on the grid have their bottom, (m, 3).

        A peak of |S| between two points of the grid is a place that a search will find.
        """
        x = np.log(self.grid)[:, None]
        left = (depth[1:-1] - depth[:-2]) / (x[1:-1] - x[:-2])
        right = (depth[2:] - depth[1:-1]) / (x[2:] - x[1:-1])
        curvature = (right - left) / (x[2:] - x[:-2])
        slope = left + curvature * (x[1:-1] - x[:-2])
        valley = (left < 0.0) & (right > 0.0)
        deepest = np.argsort(np.where(valley, depth[1:-1], np.inf), axis=0)[:_VALLEYS]
        with np.errstate(divide="ignore", invalid="ignore"):
            bottom = np.where(valley, x[1:-1] - 0.5 * slope / curvature, x[1:-1])
        return np.asarray(np.exp(np.take_along_axis(bottom, deepest, axis=0)).T, dtype=np.float64)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Closed:
    """Closed loops with the plant's own drag: 1 + L, P/Z, and payload velocity per force.

    `open_velocity` is that of the plant alone.  More drag by c turns P/Z into P/Z over
    1 + c velocity, and 1 + L into (1 + L)(1 + c velocity)/(1 + c open_velocity).
    """

    plain: ComplexArray
    motion: ComplexArray
    velocity: ComplexArray
    open_velocity: ComplexArray

    def difference(self, added: FloatArray) -> ComplexArray:
        """Return 1 + L with the drag coefficient raised by `added`."""
        ratio = (1.0 + added * self.velocity) / (1.0 + added * self.open_velocity)
        return np.asarray(self.plain * ratio, dtype=np.complex128)


class _Sampled:
    """The plant at given frequencies: once (k,) for all loops, or a row (m, k) for each."""

    def __init__(self, task: Task, omega: FloatArray, rows: tuple[int, int] | None = None) -> None:
        plant = task.plant.select(outputs=[PAYLOAD, VELOCITY])
        response = plant.response(omega)
        hook, force = (response.disturbances.index(name) for name in (HOOK, FORCE))
        shape = (omega.size, 1) if rows is None else rows
        self._many = rows is not None
        columns = _columns(task)
        self._yu = self._stacked(response.yu[:, columns, 0], shape)
        self._y_hook = self._stacked(response.yw[:, columns, hook], shape)
        self._y_force = self._stacked(response.yw[:, columns, force], shape)
        self._p_hook = response.zw[:, 0, hook].reshape(shape)
        self._p_u = response.zu[:, 0, 0].reshape(shape)
        self._v_force = response.zw[:, 1, force].reshape(shape)
        self._v_u = response.zu[:, 1, 0].reshape(shape)

    def close(self, gains: FloatArray) -> _Closed:
        """Return the loops of `gains`, (3, m), or (3, m, 1) where each has its own frequencies."""
        difference = 1.0 + self._dot(self._yu, gains)
        return _Closed(
            plain=difference,
            motion=self._p_hook - self._p_u * self._dot(self._y_hook, gains) / difference,
            velocity=self._v_force - self._v_u * self._dot(self._y_force, gains) / difference,
            open_velocity=self._v_force,
        )

    def _stacked(self, block: ComplexArray, shape: tuple[int, int]) -> ComplexArray:
        return block.T.reshape(3, *shape) if self._many else np.ascontiguousarray(block)

    def _dot(self, block: ComplexArray, gains: FloatArray) -> ComplexArray:
        if self._many:
            return np.asarray((block * gains).sum(axis=0), dtype=np.complex128)
        return np.asarray(block @ gains, dtype=np.complex128)


class PythonControlLoop:
    """The same loop as python-control objects: feedback, frequency responses, poles."""

    def __init__(self, task: Task, *, per_panel: int = 8, per_decade: int = 60) -> None:
        import control

        self.task = task
        self._control = control
        plant = task.plant
        self.system: control.StateSpace = plant.without_delays(PADE).to_control(pade_order=0)
        inputs, outputs = self.system.input_labels, self.system.output_labels
        measured = [f"measured_{n}" if n in plant.outputs else n for n in plant.measurements]
        self._measured = [outputs.index(measured[j].replace(".", "_")) for j in _columns(task)]
        self._input = {name: inputs.index(name.replace(".", "_")) for name in plant.disturbances}
        self._output = {name: outputs.index(name.replace(".", "_")) for name in (PAYLOAD, VELOCITY)}
        poles = plant.poles()
        light = poles[(poles.imag > 0.0) & (np.abs(poles.real) < _LIGHT * poles.imag)]
        self.nodes = quadrature(task, per_panel)
        self.grid = _grid(light, per_decade)
        self._density = task.hook.density(self.nodes.omega) * self.nodes.weights

    def measure(self, gains: FloatArray) -> tuple[float, FloatArray, float, float]:
        """Return log rms, |1 + L| on the grid, spectral abscissa, slow motion's ratio of (3,)."""
        added = 0.0
        if self.task.drag is not None:
            drag = self.task.drag
            c = scipy.optimize.newton(
                lambda log_c: (
                    log_c
                    - np.log(
                        drag.slope * self._sigma(gains, np.exp(log_c) - drag.reference, VELOCITY)
                    )
                ),
                np.log(drag.reference),
                tol=1e-6,
                disp=False,
            )
            added = float(np.exp(c)) - drag.reference
        closed = self.closed(gains, added)
        low = self.task.low_frequency
        slow = 0.0
        if low is not None:
            omega = np.geomspace(1e-3 * low.below, low.below, 12)
            slow = float(np.abs(self._motion(closed, omega, PAYLOAD)).max())
        sigma = self._sigma(gains, added, PAYLOAD, closed)
        with_drag = self.closed(np.zeros(3), added)
        feedback = self._control.ss([], [], [], [list(gains)])
        loop = self._control.series(with_drag[self._measured, 0], feedback)
        distance = np.abs(1.0 + np.ravel(loop(1j * self.grid)))
        return float(np.log(sigma)), distance, float(closed.poles().real.max()), slow

    def closed(self, gains: FloatArray, added: float) -> control.StateSpace:
        """Return the plant with the gains and a further drag coefficient fed back."""
        law = np.zeros((self.system.ninputs, self.system.noutputs))
        law[0, self._measured] = -gains
        law[self._input[FORCE], self._output[VELOCITY]] = -added
        return self._control.feedback(self.system, self._control.ss([], [], [], law), sign=1)

    def _motion(self, system: control.StateSpace, omega: FloatArray, output: str) -> ComplexArray:
        row = self._output[output]
        columns = [self._input[HOOK]]
        columns += [self._input[rate] for rate in self.task.plant.rates]
        response = system[row, columns](1j * omega)[0]
        result = response[0] + (1j * omega * response[1:]).sum(axis=0)
        return np.asarray(result, dtype=np.complex128)

    def _sigma(
        self,
        gains: FloatArray,
        added: float,
        output: str,
        closed: control.StateSpace | None = None,
    ) -> float:
        system = self.closed(gains, added) if closed is None else closed
        motion = self._motion(system, self.nodes.omega, output)
        return float(np.sqrt(self._density @ np.abs(motion) ** 2))


def evolve(
    loop: SampledLoop,
    seed: int,
    *,
    vectorised: bool = True,
    max_sensitivity: float | None = None,
    popsize: int = 15,
    generations: int = 300,
) -> Answer:
    """Return SciPy's differential evolution from a seed, on the sampled loop.

    Its population agrees to 1e-4 in log rms at the end.  No polish: SciPy's is L-BFGS-B,
    which the kink of the penalty stops.
    """
    bound = loop.task.max_sensitivity if max_sensitivity is None else max_sensitivity

    def objective(gains: FloatArray) -> Any:
        return loop.objective(gains, bound)

    begin = time.perf_counter()
    found = scipy.optimize.differential_evolution(
        objective,
        scipy.optimize.Bounds(-np.array(loop.task.box), np.array(loop.task.box)),
        rng=seed,
        vectorized=vectorised,
        updating="deferred" if vectorised else "immediate",
        popsize=popsize,
        maxiter=generations,
        tol=0.0,
        atol=1e-4,
        polish=False,
    )
    seconds = time.perf_counter() - begin
    per_call = 3 * popsize if vectorised else 1
    return Answer(
        gains=np.asarray(found.x, dtype=np.float64),
        seconds=seconds,
        evaluations=int(found.nfev) if not vectorised else int(found.nfev) * per_call,
        objective=float(found.fun),
    )


def slsqp(
    loop: PythonControlLoop,
    start: FloatArray,
    *,
    iterations: int = 100,
    max_sensitivity: float | None = None,
) -> Answer:
    """Return SciPy's SLSQP from starting gains, gradients by differences.

    |1 + L| at every frequency of the grid, the slow motion and the spectral abscissa are
    inequalities.  Points are remembered, so that objective and constraints share them.
    """
    scale = np.maximum(np.abs(start), 1e-3 * float(np.abs(start).max()))
    known: dict[bytes, tuple[float, FloatArray, float, float]] = {}

    def at(x: FloatArray) -> tuple[float, FloatArray, float, float]:
        key = np.asarray(x, dtype=np.float64).tobytes()
        if key not in known:
            known[key] = loop.measure(np.asarray(x) * scale)
        return known[key]

    bound = loop.task.max_sensitivity if max_sensitivity is None else max_sensitivity
    low = loop.task.low_frequency

    def rows(x: FloatArray) -> FloatArray:
        _, distance, decay, slow = at(x)
        further = [-decay] if low is None else [-decay, np.log(low.bound / slow)]
        return np.append(np.log(bound * distance), further)

    minimise: Any = scipy.optimize.minimize  # its overloads tell no lambda from another
    begin = time.perf_counter()
    try:
        with np.errstate(all="ignore"):  # of trial points far outside
            found = minimise(
                lambda x: at(x)[0],
                start / scale,
                method="SLSQP",
                constraints={"type": "ineq", "fun": rows},
                options={"maxiter": iterations, "ftol": 1e-8},
            )
    except (ValueError, RuntimeError, np.linalg.LinAlgError):
        # It strayed to where python-control or the drag has no answer: a start that failed.
        return Answer(
            gains=np.asarray(start, dtype=np.float64),
            seconds=time.perf_counter() - begin,
            evaluations=len(known),
            objective=np.inf,
        )
    return Answer(
        gains=np.asarray(found.x * scale, dtype=np.float64),
        seconds=time.perf_counter() - begin,
        evaluations=len(known),
        objective=float(found.fun) if found.success else np.inf,
    )


def quadrature(task: Task, per_panel: int) -> Quadrature:
    """Return fixed nodes for the payload's variance."""
    poles = task.plant.poles()
    swinging = poles[(poles.imag > 0.0) & (np.abs(poles.real) > 1e-9 * np.abs(poles))]
    return spectral_nodes(
        *task.hook.band,
        splits=task.hook.splits,
        poles=[complex(p) for p in swinging],
        per_panel=per_panel,
        panels_per_decade=8.0,
    )


def _columns(task: Task) -> list[int]:
    """Return where P'', P', P stand among the plant's measurements."""
    return [task.plant.measurements.index(name) for name in task.structure.measurements]


def _grid(light: ComplexArray, per_decade: int) -> FloatArray:
    """Return frequencies [rad/s], denser where loops move and at the plant's light poles."""
    low, high = _LIVELY
    pieces = [
        (light.imag[:, None] + np.abs(light.real)[:, None] * _ABOUT).ravel(),
        np.geomspace(_BOTTOM, _TOP, int(_THIN * np.log10(_TOP / _BOTTOM))),
        np.geomspace(low, high, int(per_decade * np.log10(high / low))),
    ]
    grid = np.concatenate(pieces)
    return np.unique(grid[(grid >= _BOTTOM) & (grid <= _TOP)])
