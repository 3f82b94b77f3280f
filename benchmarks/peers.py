r"""The peers of the gain synthesis: what an engineer would reach for without it.

Both look for the least rms of the payload's motion within all limits of a case:

* `evolve`, SciPy's differential evolution, on an objective that is written for speed: the exact
  rope's responses are sampled once, and a whole generation is evaluated by array operations;
* `slsqp`, SciPy's, on python-control objects: the way it is done by hand, the rope in masses.

They take the plant's responses, the spectra, the limits' figures and the structure's transfer
functions from the toolkit; how the loop is closed, its stability, the drag that agrees with the
motion, variances, peaks and margins are computed here, by formulas of their own.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.optimize

from models.basics import spectral_nodes
from models.sensing import sensed_line_at
from synth.limits import (
    Breakdown,
    Continuous,
    GainMargin,
    GainMarginDown,
    Limit,
    LowFrequency,
    MaxSensitivity,
    Minimum,
    Peak,
    Power,
)
from synth.question import DesignQuestion, held_poles

__all__ = ["Answer", "ControlLoops", "Measured", "SampledLine", "evolve", "slsqp"]

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

HOOK, PAYLOAD = "hook.heave", "payload.displacement"
VELOCITY, FORCE = "payload.velocity", "payload.force"
PADE = 5  # order of the delay model of python-control
_PENALTY = 20.0  # on the logarithm of an excess; the limits' prices are of the order of one
_UNSTABLE = 1e3
_BOTTOM, _TOP = 1e-3, 300.0  # of the sensitivity grid [rad/s]
_LIVELY = (0.3, 60.0)  # where loops around a payload on a rope move
_THIN = 15  # points per decade elsewhere
_LIGHT = 0.1  # damping below which a resonance of the plant gets points of its own
_ABOUT = np.linspace(-3.0, 3.0, 13)  # ... in units of its decay
_SLOW = 12  # frequencies at which the slow motion is looked at
_FAINT = 1e-9  # use of a margin whose axis no loop crosses
_AT_ONCE = 48  # candidates whose arrays fit the processor's cache


@dataclass(frozen=True, kw_only=True, eq=False)
class Measured:
    """What loops do, (b,) each: log rms, log of use over bound by limit, how far from stable.

    `turns` is zero for a stable loop with a drag of its own, else how far 1 + L goes round.
    """

    log_rms: FloatArray
    excess: FloatArray  # (limits, b)
    turns: FloatArray

    @property
    def stable(self) -> npt.NDArray[np.bool_]:
        """Whether a loop is stable."""
        return np.asarray(self.turns == 0.0)

    @property
    def objective(self) -> FloatArray:
        """The logarithm of the rms, and penalties; of unstable loops, how unstable they are."""
        value = self.log_rms + _PENALTY * np.maximum(self.excess, 0.0).sum(axis=0)
        return np.where(self.stable & np.isfinite(value), value, _UNSTABLE * (1.0 + self.turns))


@dataclass(frozen=True, kw_only=True, eq=False)
class Answer:
    """What a peer found: the law's parameters, processor time [s], loops evaluated."""

    values: FloatArray
    seconds: float
    evaluations: int
    objective: float


class _Places:
    """Where a case's loops are looked at: quadrature nodes and a grid for the margins [rad/s]."""

    def __init__(self, question: DesignQuestion, *, per_panel: int, per_decade: int) -> None:
        sources = question.problem.disturbances
        bands = [source.band for source in sources if source.band is not None]
        low, high = min(band[0] for band in bands), max(band[1] for band in bands)
        held = held_poles(question.data, question.drag_before, _LIVELY[1])
        poles = np.concatenate([question.plant.poles(), held])
        lively = (poles.imag > 0.0) & (poles.imag < _LIVELY[1]) & (poles.real < 0.0)
        poles = poles[lively]
        self.nodes = spectral_nodes(
            max(low, 1e-2 * _BOTTOM),
            high,
            splits=[omega for source in sources for omega in source.splits],
            poles=[complex(pole) for pole in poles],
            per_panel=per_panel,
            panels_per_decade=4.0,
        )
        light = poles[np.abs(poles.real) < _LIGHT * poles.imag]
        pieces = [
            (light.imag[:, None] + np.abs(light.real)[:, None] * _ABOUT).ravel(),
            np.geomspace(_BOTTOM, _TOP, int(_THIN * np.log10(_TOP / _BOTTOM))),
            np.geomspace(*_LIVELY, int(per_decade * np.log10(_LIVELY[1] / _LIVELY[0]))),
        ]
        grid = np.unique(np.concatenate(pieces))
        self.grid = grid[(grid >= _BOTTOM) & (grid <= _TOP)]
        slow = [limit for limit in question.limits if isinstance(limit, LowFrequency)]
        self.slow = np.geomspace(1e-2, 1.0, _SLOW) * (slow[0].below if slow else 1.0)
        self.density = np.array([s.density(self.nodes.omega) for s in sources]) * self.nodes.weights


class SampledLine:
    """Loops of many parameter vectors at once, on the exact rope at frequencies fixed beforehand.

    Parameters
    ----------
    question
        The case and the structure.
    per_panel
        Quadrature nodes on a panel; panels shrink towards the poles of plant and rope and end at
        every kink of the RAO's table.
    per_decade
        Points of the margin grid where loops move.
    tighter
        By what share the limit on M_s is tightened, for peaks between two points.
    """

    def __init__(
        self,
        question: DesignQuestion,
        *,
        per_panel: int = 4,
        per_decade: int = 80,
        tighter: float = 0.0,
    ) -> None:
        self.question, self.tighter = question, tighter
        self.places = places = _Places(question, per_panel=per_panel, per_decade=per_decade)
        self._at_nodes = _Sampled(question, places.nodes.omega)
        self._at_grid = _Sampled(question, places.grid)
        self._at_slow = _Sampled(question, places.slow)

    def measure(self, values: FloatArray) -> Measured:
        """Return what the loops of parameter vectors (b, n) do."""
        parts = [self._measure(values[k : k + _AT_ONCE]) for k in range(0, len(values), _AT_ONCE)]
        return Measured(
            log_rms=np.concatenate([part.log_rms for part in parts]),
            excess=np.concatenate([part.excess for part in parts], axis=1),
            turns=np.concatenate([part.turns for part in parts]),
        )

    def _measure(self, values: FloatArray) -> Measured:
        with np.errstate(all="ignore"):  # of candidates far outside
            loops = self._at_nodes.close(values)
            added, found = self._drag(loops)
            moments = self._moments(loops, added)
            difference = self._at_grid.close(values).difference(added)
            slow = np.abs(self._at_slow.close(values).moved(PAYLOAD, added)[0]).max(axis=1)
            rows = [
                np.log(_use(limit, moments, difference, slow, self.places.grid))
                + (self.tighter if isinstance(limit, MaxSensitivity) else 0.0)
                for limit in self.question.limits
            ]
            log_rms = 0.5 * np.log(moments[PAYLOAD][0])
            turns = _turns(difference)
        return Measured(
            log_rms=log_rms,
            excess=np.array(rows),
            turns=np.where(found, turns, 1.0 + np.nan_to_num(turns, nan=10.0)),
        )

    def _drag(self, loops: _Closed) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
        """Return the drag coefficient less the plant's own, and whether there is one, (b,).

        Newton's method on log C = log(slope sigma_v(C)) for all at once.
        """
        drag = self.question.drag
        assert drag is not None
        hook, noise = loops.powers(VELOCITY, np.zeros(len(loops.plain)), self.places.density)
        omega = loops.force[VELOCITY]
        power = hook + noise
        log_c = np.full(len(power), np.log(drag.reference))
        step = np.full_like(log_c, np.inf)
        for _ in range(25):
            c = np.exp(log_c)[:, None]
            damped = 1.0 + (c - drag.reference) * omega
            density = power / (damped.real**2 + damped.imag**2)
            variance = density.sum(axis=1)
            off = log_c - np.log(drag.slope) - 0.5 * np.log(variance)
            slope = 1.0 + (density * (c * omega / damped).real).sum(axis=1) / variance
            step = np.clip(np.nan_to_num(-off / np.maximum(slope, 0.3)), -0.5, 0.5)
            log_c = log_c + step
            if float(np.max(np.abs(step))) < 1e-7:
                break
        return np.exp(log_c) - drag.reference, np.abs(step) < 1e-5

    def _moments(self, loops: _Closed, added: FloatArray) -> dict[str, tuple[FloatArray, ...]]:
        """Return the moments m_0 and m_2 of every output that cost and limits speak of."""
        omega = self.places.nodes.omega
        found: dict[str, tuple[FloatArray, ...]] = {}
        for name in loops.force:
            sea, noise = loops.powers(name, added, self.places.density)
            power = sea + noise
            found[name] = (power.sum(axis=1), power @ omega**2)
        return found


@dataclass(frozen=True, kw_only=True, eq=False)
class _Closed:
    """Closed loops with the plant's own drag at k points; (b, k) each.

    1 + L; responses to the hook and to a force on the payload by output; commands to each noise,
    and the plant's response to a command.  More drag by c is a force -c v: it turns a response z
    into z - z_F c v / (1 + c v_F), and 1 + L into (1 + L)(1 + c v_F)/(1 + c v_F, open).
    """

    plain: ComplexArray
    hook: dict[str, ComplexArray]
    force: dict[str, ComplexArray]
    commanded: dict[str, ComplexArray]
    noises: list[ComplexArray]
    open_velocity: ComplexArray

    def moved(self, name: str, added: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Return the responses of an output to the hook and to a command's noise."""
        c = added[:, None]
        held = c * self.force[name] / (1.0 + c * self.force[VELOCITY])
        return (
            self.hook[name] - held * self.hook[VELOCITY],
            self.commanded[name] - held * self.commanded[VELOCITY],
        )

    def powers(
        self, name: str, added: FloatArray, density: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return what the sea and what all noises add to an output's variance at each node."""
        hook, command = self.moved(name, added)
        noise = sum(
            ((g.real**2 + g.imag**2) * d for g, d in zip(self.noises, density[1:], strict=True)),
            np.zeros(1),
        )
        return (
            (hook.real**2 + hook.imag**2) * density[0],
            (command.real**2 + command.imag**2) * noise,
        )

    def difference(self, added: FloatArray) -> ComplexArray:
        """Return 1 + L with the drag coefficient raised by `added`."""
        c = added[:, None]
        ratio = (1.0 + c * self.force[VELOCITY]) / (1.0 + c * self.open_velocity)
        return np.asarray(self.plain * ratio, dtype=np.complex128)


class _Sampled:
    """The exact rope, its drive and its sensors at given frequencies [rad/s]."""

    def __init__(self, question: DesignQuestion, omega: FloatArray) -> None:
        problem = question.problem
        self._law, self._s = problem.law, 1j * omega
        line = sensed_line_at(question.case, self._s, drag=question.drag_before, data=question.data)
        heard = [line.measurements.index(name) for name in question.plant.measurements]
        names = [d.name for d in problem.disturbances]
        assert names[0] == HOOK
        w = [line.disturbances.index(name) for name in names]
        force = line.disturbances.index(FORCE)
        self._yu = np.ascontiguousarray(line.yu[:, heard, 0].T)
        self._yw = [np.ascontiguousarray(line.yw[:, heard, k].T) for k in (*w, force)]
        z = {name: line.outputs.index(name) for name in problem.outputs}
        self._zu = {name: line.zu[:, k, 0] for name, k in z.items()}
        self._zh = {name: line.zw[:, k, w[0]] for name, k in z.items()}
        self._zf = {name: line.zw[:, k, force] for name, k in z.items()}

    def close(self, values: FloatArray) -> _Closed:
        """Return the loops of parameter vectors, (b, n)."""
        (entries,) = self._law.response([column[:, None] for column in values.T], self._s)
        shape = (len(values), self._s.size)

        def heard(of: ComplexArray) -> ComplexArray:
            parts = (law * y for law, y in zip(entries, of, strict=True) if np.any(y))
            return np.asarray(np.broadcast_to(sum(parts), shape), dtype=np.complex128)

        # u = C y, and so u = C y_w w / (1 - C y_u).
        plain = 1.0 - heard(self._yu)
        hook, *noises, force = (heard(block) / plain for block in self._yw)
        return _Closed(
            plain=plain,
            hook={name: self._zh[name] + zu * hook for name, zu in self._zu.items()},
            force={name: self._zf[name] + zu * force for name, zu in self._zu.items()},
            commanded={name: zu / 1.0 for name, zu in self._zu.items()},
            noises=noises,
            open_velocity=self._zf[VELOCITY],
        )


def _use(
    limit: Limit,
    moments: Mapping[str, tuple[FloatArray, ...]],
    difference: ComplexArray,
    slow: FloatArray,
    omega: FloatArray,
) -> FloatArray:
    """Return what is used of a limit, (b,): at most one where it is kept.

    Raises
    ------
    TypeError
        If the limit is of a kind that these peers do not know.
    """

    def peak(output: str, duration: float) -> FloatArray:
        m_0, m_2 = moments[output]
        cycles = duration / (2.0 * np.pi) * np.sqrt(m_2 / m_0)
        return np.asarray(np.sqrt(2.0 * np.log(np.maximum(cycles, np.exp(0.5))) * m_0))

    if isinstance(limit, MaxSensitivity):
        return _largest_sensitivity(difference, omega) / limit.bound
    if isinstance(limit, GainMargin):
        x = _on_axis(difference)
        x = np.where(x > -1.0, x, 0.0)
        return np.asarray(np.maximum(-limit.bound * x.min(axis=1), _FAINT))
    if isinstance(limit, GainMarginDown):
        x = _on_axis(difference)
        x = np.where(x < -1.0, x, -np.inf)
        return np.asarray(np.maximum(-1.0 / (limit.bound * x.max(axis=1)), _FAINT))
    if isinstance(limit, LowFrequency):
        return slow / limit.bound
    if isinstance(limit, Peak):
        steady = abs(limit.static) + limit.loss
        return (steady + peak(limit.output, limit.duration)) / limit.bound
    if isinstance(limit, Continuous):
        steady = limit.static**2 + limit.loss**2
        return np.sqrt(steady + moments[limit.output][0]) / limit.bound
    if isinstance(limit, Minimum):
        reach = limit.loss + peak(limit.output, limit.duration)
        return reach / (limit.static - limit.bound)
    if isinstance(limit, Power):
        torque = abs(limit.static) + limit.loss + peak(limit.torque, limit.duration)
        speed = peak(limit.speed, limit.duration)
        fast = (speed / limit.base_speed) ** 2 if isinstance(limit, Breakdown) else speed
        return torque * fast / limit.bound
    raise TypeError(f"no peer knows the limit {limit.name}")


def _largest_sensitivity(difference: ComplexArray, omega: FloatArray) -> FloatArray:
    """Return M_s, (b,): on the grid, and at the tops of parabolas through three of its points."""
    depth = np.log(difference.real**2 + difference.imag**2)
    x = np.log(omega)
    left = (depth[:, 1:-1] - depth[:, :-2]) / (x[1:-1] - x[:-2])
    right = (depth[:, 2:] - depth[:, 1:-1]) / (x[2:] - x[1:-1])
    curvature = (right - left) / (x[2:] - x[:-2])
    slope = left + curvature * (x[1:-1] - x[:-2])
    valley = (left < 0.0) & (right > 0.0)
    bottom = np.where(valley, depth[:, 1:-1] - 0.25 * slope**2 / curvature, np.inf)
    deepest = np.minimum(depth.min(axis=1), bottom.min(axis=1))
    return np.asarray(np.exp(-0.5 * deepest), dtype=np.float64)


def _on_axis(difference: ComplexArray) -> FloatArray:
    """Return L where it crosses the negative real axis, 0 elsewhere, (b, k - 1)."""
    loop = difference - 1.0
    below, above = loop[:, :-1], loop[:, 1:]
    share = below.imag / (below.imag - above.imag)
    crossing = below.real + share * (above.real - below.real)
    crosses = (below.imag * above.imag < 0.0) & (crossing < 0.0)
    return np.asarray(np.where(crosses, crossing, 0.0), dtype=np.float64)


def _turns(difference: ComplexArray) -> FloatArray:
    """Return how far 1 + L goes round, (b,): zero if stable, by the argument principle.

    On the exact rope the plant has one pole at zero and none to the right of it.  1 + L then comes
    up from -i infinity and must end at one without having gone round: its argument turns back to
    zero.
    """
    start = np.angle(difference[:, 0])
    end = start + np.angle(difference[:, 1:] / difference[:, :-1]).sum(axis=1)
    stable = (start < 0.3) & (np.abs(end) < 0.5 * np.pi)
    return np.where(stable, 0.0, 0.1 + np.abs(end) / (2.0 * np.pi) + np.maximum(start, 0.0))


class ControlLoops:
    """The same loops as python-control objects on rope masses, one at a time; static laws only."""

    def __init__(
        self, question: DesignQuestion, *, per_panel: int = 4, per_decade: int = 60
    ) -> None:
        import control

        self.question = question
        self._control = control
        plant, problem = question.plant, question.problem
        self.system: control.StateSpace = plant.without_delays(PADE).to_control(pade_order=0)
        inputs, outputs = self.system.input_labels, self.system.output_labels
        at = {name: name.replace(".", "_") for name in (*plant.outputs, *plant.measurements)}
        heard = [
            at[n] if n not in plant.outputs else f"measured_{at[n]}" for n in plant.measurements
        ]
        self._heard = [outputs.index(name) for name in heard]
        self._rows = [outputs.index(at[name]) for name in problem.outputs]
        self._velocity = outputs.index(at[VELOCITY])
        self._force = inputs.index(FORCE.replace(".", "_"))
        # A disturbance, and its rate where the plant has that as an input of its own.
        self._sources = [
            [
                inputs.index(name.replace(".", "_"))
                for name in (d.name, f"{d.name}_rate")
                if name in plant.disturbances
            ]
            for d in problem.disturbances
        ]
        self.places = _Places(question, per_panel=per_panel, per_decade=per_decade)

    def measure(self, values: FloatArray) -> tuple[float, FloatArray]:
        """Return log rms, and rows that are at least zero where a limit is kept."""
        question, places = self.question, self.places
        drag = question.drag
        assert drag is not None
        rows_of = dict(zip(question.problem.outputs, self._rows, strict=True))

        def off(log_c: float) -> float:
            closed = self.closed(values, float(np.exp(log_c)) - drag.reference)
            power = self._power(closed, [rows_of[VELOCITY]])[0]
            return float(log_c - np.log(drag.slope) - 0.5 * np.log(power.sum()))

        log_c = scipy.optimize.newton(off, np.log(drag.reference), tol=1e-6, disp=False)
        added = float(np.exp(log_c)) - drag.reference
        closed = self.closed(values, added)
        power = self._power(closed, self._rows)
        moments: dict[str, tuple[FloatArray, ...]] = {
            name: (row.sum()[None], (row @ places.nodes.omega**2)[None])
            for name, row in zip(question.problem.outputs, power, strict=True)
        }
        slow = np.abs(self._motion(closed, places.slow, [rows_of[PAYLOAD]], self._sources[0])).max()
        with_drag = self.closed(np.zeros_like(values), added)
        law = self._control.ss([], [], [], [self._law(values)])
        loop = self._control.series(with_drag[self._heard, 0], law)
        difference = np.asarray(1.0 - np.ravel(loop(1j * places.grid))[None], dtype=np.complex128)
        rows = [-float(closed.poles().real.max())]
        for limit in question.limits:
            if isinstance(limit, MaxSensitivity):
                rows += list(np.log(limit.bound * np.abs(difference[0])))
            else:
                use = _use(limit, moments, difference, np.array([slow]), places.grid)
                rows.append(-float(np.log(use[0])))
        return 0.5 * float(np.log(moments[PAYLOAD][0][0])), np.array(rows)

    def closed(self, values: FloatArray, added: float) -> Any:
        """Return the plant with the law and a further drag coefficient fed back."""
        law = np.zeros((self.system.ninputs, self.system.noutputs))
        law[0, self._heard] = self._law(values)
        law[self._force, self._velocity] = -added
        return self._control.feedback(self.system, self._control.ss([], [], [], law), sign=1)

    def _law(self, values: FloatArray) -> FloatArray:
        (entries,) = self.question.law.response(list(values), np.array([1j]))
        return np.array([float(np.real(np.ravel(entry)[0])) for entry in entries])

    def _motion(
        self, system: Any, omega: FloatArray, rows: list[int], source: list[int]
    ) -> ComplexArray:
        response = system[rows, source](1j * omega, squeeze=False)
        return np.asarray(sum(response[:, k] * (1j * omega) ** k for k in range(len(source))))

    def _power(self, system: Any, rows: list[int]) -> FloatArray:
        """Return what each node adds to the variances of outputs, (rows, k)."""
        every = [k for source in self._sources for k in source]
        omega = self.places.nodes.omega
        response = system[rows, every](1j * omega, squeeze=False)
        power, first = np.zeros((len(rows), omega.size)), 0
        for source, density in zip(self._sources, self.places.density, strict=True):
            parts = response[:, first : first + len(source)]
            motion = sum(parts[:, k] * (1j * omega) ** k for k in range(len(source)))
            power += np.abs(motion) ** 2 * density
            first += len(source)
        return power


def evolve(
    line: SampledLine,
    box: FloatArray,
    seed: int,
    *,
    popsize: int = 15,
    generations: int = 1000,
    agree: float = 1e-5,
) -> Answer:
    """Return SciPy's differential evolution from a seed, whole generations at once.

    Parameters
    ----------
    line
        The loops.
    box
        Ends of every parameter, (n, 2); searched on a logarithm where both are above zero.
    seed
        Of the population, which is a Sobol set at the beginning.
    popsize, generations
        Members for each parameter, and the most generations.
    agree
        Standard deviation of the population's log rms at which it ends.
    """
    logarithmic = box[:, 0] > 0.0

    def values(x: FloatArray) -> FloatArray:
        return np.where(logarithmic, np.exp(np.where(logarithmic, x, 0.0)), x)

    count = 0

    def objective(x: FloatArray) -> Any:
        nonlocal count
        count += x.shape[1]
        return line.measure(values(x.T)).objective

    ends = np.where(logarithmic[:, None], np.log(np.where(box > 0.0, box, 1.0)), box)
    begin = time.process_time()
    found = scipy.optimize.differential_evolution(
        objective,
        scipy.optimize.Bounds(ends[:, 0], ends[:, 1]),
        rng=seed,
        init="sobol",
        vectorized=True,
        updating="deferred",
        popsize=popsize,
        maxiter=generations,
        tol=0.0,
        atol=agree,
        polish=False,  # SciPy's is L-BFGS-B, which the kink of a penalty stops
    )
    return Answer(
        values=values(np.asarray(found.x)),
        seconds=time.process_time() - begin,
        evaluations=count,
        objective=float(found.fun),
    )


def slsqp(
    measure: Callable[[FloatArray], tuple[float, FloatArray]],
    start: FloatArray,
    *,
    iterations: int = 100,
) -> Answer:
    """Return SciPy's SLSQP from a start, gradients by differences, infinite where it failed.

    Every limit, |1 + L| at every frequency of the grid and the spectral abscissa are inequalities.
    Points are remembered, so that objective and constraints share them.
    """
    scale = np.maximum(np.abs(start), 1e-3 * float(np.abs(start).max()))
    known: dict[bytes, tuple[float, FloatArray]] = {}

    def at(x: FloatArray) -> tuple[float, FloatArray]:
        key = np.asarray(x, dtype=np.float64).tobytes()
        if key not in known:
            known[key] = measure(np.asarray(x) * scale)
        return known[key]

    minimise: Any = scipy.optimize.minimize  # its overloads tell no lambda from another
    values, objective = np.asarray(start, dtype=np.float64), np.inf
    begin = time.process_time()
    try:
        with np.errstate(all="ignore"):  # of trial points far outside
            found = minimise(
                lambda x: at(x)[0],
                start / scale,
                method="SLSQP",
                constraints={"type": "ineq", "fun": lambda x: at(x)[1]},
                options={"maxiter": iterations, "ftol": 1e-8},
            )
        values = np.asarray(found.x * scale, dtype=np.float64)
        objective = float(found.fun) if found.success else np.inf
    except (ValueError, RuntimeError, np.linalg.LinAlgError):
        pass  # it strayed to where python-control or the drag has no answer
    return Answer(
        values=values,
        seconds=time.process_time() - begin,
        evaluations=len(known),
        objective=objective,
    )
