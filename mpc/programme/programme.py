r"""The programme of predictive control, for any linear plant: `Programme`.

    LinearPlant, costs, limits --> Programme          once
    state, references, disturbances to come --> Plan     every sample

The plant is sampled, the inputs before are appended to its state, and what costs becomes rows: an
output as it differs from its reference, an input as it differs from its own or from what holds the
outputs at theirs (the target of offset-free control: U. Maeder, F. Borrelli and M. Morari, "Linear
offset-free Model Predictive Control", Automatica 45, 2009), a rate as it is.  The rest is
`mpc.programme.condensed`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
import scipy.linalg

from models.basics import FloatArray, InputError, SolverError, check_finite, check_range, pick
from models.plant import LinearPlant

from .condensed import Condensed, Constraint, Question
from .horizon import Horizon, Signals, lasting, sampled
from .qp import ITERATIONS, QPSolution, kkt_residual
from .regulator import LQRegulator, lq_regulator, pole_text, steady_inputs, unreached

Known = Mapping[str, float] | Mapping[str, npt.ArrayLike]
_OWNER = "programme"
_GROWTH = 1e8  # of an unstable plant over the horizon, which eight digits outlive
_LONGEST = 2000  # samples of a horizon
_NONE = np.zeros(0)


@dataclass(frozen=True, eq=False)
class Plan:
    """What a programme answers; everything is told as it is, not as deviations."""

    programme: Programme
    known: FloatArray  #: Columns of state, path and constants.
    question: Question  #: What the solver was asked.
    solved: QPSolution

    @property
    def ok(self) -> bool:
        """Whether it is the optimum."""
        return self.solved.ok and bool(np.isfinite(self.solved.v).all())

    @property
    def status(self) -> str:
        """What came of it, in words."""
        if self.ok:
            return "optimal" if not self.slack.any() else "optimal, beyond soft limits"
        if self.solved.infeasible:
            return "infeasible: the hard limits exclude each other for this state"
        return "no answer within the iterations or the time that are allowed"

    @cached_property
    def inputs(self) -> Mapping[str, FloatArray]:
        """Each input over the samples, (N,)."""
        p = self.programme
        return {n: p.rest.get(n, 0.0) + self._moves[:-1, i] for i, n in enumerate(p.inputs)}

    @cached_property
    def states(self) -> FloatArray:
        """The state at each sample, with the inputs before behind it, (N + 1, n)."""
        h = self.programme.horizon
        pushed = self._moves @ h.B.T + self._path @ h.from_path.T
        x = [self.known[h.state]]
        for push in pushed[:-1] + h.from_constants @ self.known[h.constants]:
            x.append(h.A @ x[-1] + push)
        return np.array(x)

    @cached_property
    def outputs(self) -> Mapping[str, FloatArray]:
        """Outputs, inputs and rates, (N + 1,); NaN at the end for what depends on an input."""
        p = self.programme
        found = self._shown(p.signals)
        found[-1, ~p.signals.at_end] = math.nan
        return {n: p.rest.get(n, 0.0) + found[:, i] for i, n in enumerate(p.signals.names)}

    @cached_property
    def cost(self) -> float:
        """The cost, soft limits included; with a value function but for what no move changes."""
        p, x = self.programme, self.states[-1]
        zeta = np.concatenate([self.known[p.last], self.known[p.horizon.constants]])
        square = (self._shown(p.cost_rows)[:-1] ** 2 @ p.end.weights).sum()
        square += x @ (p.end.P @ x + 2.0 * p.end.N @ zeta) + zeta @ p.end_known @ zeta
        slack = self.slack[len(self.slack) - len(p.qp.rows) :]
        price = p.qp.linear * slack + 0.5 * p.qp.quadratic * slack**2
        return float(square + p.cost * price.sum())

    @cached_property
    def slack(self) -> FloatArray:
        """Violation of each row over its limit, hard rows first, (nr,)."""
        _, lower, upper = self.question
        p, n = self.programme, len(self.solved.v)
        value = np.vstack([p.qp.hard, p.qp.rows]) @ self.solved.v
        over = np.maximum(value - upper[n:], lower[n:] - value)
        return np.where(over > 1e-9, over, 0.0)

    @cached_property
    def multipliers(self) -> Mapping[str, FloatArray]:
        """What a unit more of each limit would take off the cost, (N + 1,); below: negative."""
        p, h, lam = self.programme, self.programme.horizon, self.solved.multipliers
        found = {name: np.zeros(h.steps + 1) for name in p.signals.names}
        moves = lam[: len(self.solved.v)].reshape(len(h.blocks), -1) / h.units
        for i, name in enumerate(p.inputs):
            found[name][list(h.starts)] += p.cost * moves[:, i]
        rows = lam[len(self.solved.v) :] * p.scale
        for j, kind, push in zip(p.at, p.kind, rows, strict=True):
            found[p.signals.names[kind]][j] += p.cost * push
        return found

    @cached_property
    def residual(self) -> float:
        """Residual of the conditions of optimality (`kkt_residual`)."""
        return kkt_residual(self.programme.qp, *self.question, self.solved)

    @cached_property
    def _moves(self) -> FloatArray:
        """Deviations of the inputs at each sample, none at the end, (N + 1, nu)."""
        h = self.programme.horizon
        held = (self.solved.v.reshape(len(h.blocks), -1) * h.units)[h.block]
        return np.vstack([held, np.zeros_like(held[:1])])

    @cached_property
    def _path(self) -> FloatArray:
        """The path at both ends of each sample, (N + 1, 2 nw)."""
        h = self.programme.horizon
        path = self.known[h.path].reshape(h.steps + 1, -1)
        return np.hstack([path, np.vstack([path[1:], np.zeros_like(path[:1])])])

    def _shown(self, s: Signals) -> FloatArray:
        """Return signals at each sample, (N + 1, ns)."""
        known = self._moves @ s.D.T + self._path @ s.F.T
        constants = self.known[self.programme.horizon.constants]
        return np.asarray(self.states @ s.C.T + known + s.G @ constants)


class Programme(Condensed):
    """The programme of a plant: costs, limits, references, disturbances that are known ahead.

    The plant's state is followed by the inputs before, so that rates of inputs are signals like any
    other.  Signals are told as they are; what `LinearPlant.static` says of them is taken off and
    put back here.

    Parameters
    ----------
    plant
        The plant.  Its inputs are free; its disturbances are known, now or ahead.
    period
        Sample time T [s].
    horizon
        Length of the prediction [s], a whole number of periods.
    costs
        What the square of each output, input, or ``rate of`` an input costs at each sample.  Every
        input has to cost something, itself or by its rate.
    constraints
        Limits.  Hard ones on inputs are always kept; hard ones on outputs may leave no answer.
    references
        Outputs and inputs whose cost is that of the distance from a reference; by default all
        outputs that cost.  An input without is counted from what holds these outputs in their
        places, so that nothing is left over.
    blocking
        Length of each block of moves in samples; their sum is the horizon.  By default each is one.
    terminal
        What outputs cost at the end of the horizon, by name; by default it is all that comes after
        it without limits, references and disturbances staying where they then are.
    sizes
        Size of inputs, for the numerics; by default the larger of their limits, or one.
    iterations, time_limit
        How many the solver may take, and how long [s]; zero for no end.

    Raises
    ------
    InputError
        If an argument is out of its range, a name is unknown, an input costs nothing, or inputs and
        costs leave a pole of the plant to itself that does not settle.

    Examples
    --------
    >>> from models import LinearPlant
    >>> cart = LinearPlant(
    ...     A=[[0, 1], [0, 0]], B=[[0], [1]], E=[[0], [1]], C=[[1, 0]], Cz=[[1, 0]],
    ...     inputs=["push"], disturbances=["wind"], measurements=["place"], outputs=["place"],
    ... )
    >>> programme = Programme(
    ...     cart, period=0.1, horizon=2.0, costs={"place": 1.0, "push": 0.01},
    ...     constraints=[Constraint(signal="push", low=-1.0, high=1.0)],
    ... )
    >>> plan = programme.solve([1.0, 0.0])
    >>> plan.status, round(float(plan.inputs["push"][0]), 6)
    ('optimal', -1.0)
    """

    def __init__(
        self,
        plant: LinearPlant,
        *,
        period: float,
        horizon: float,
        costs: Mapping[str, float],
        constraints: Sequence[Constraint] = (),
        references: Sequence[str] | None = None,
        blocking: Sequence[int] | None = None,
        terminal: Mapping[str, float] | None = None,
        sizes: Mapping[str, float] | None = None,
        iterations: int = ITERATIONS,
        time_limit: float = 0.0,
    ) -> None:
        T = check_range(_OWNER, "period", period, low=0.0, unit="s", open_low=True)
        check_range(_OWNER, "horizon", horizon, low=T, high=_LONGEST * T, unit="s")
        steps = round(horizon / T)
        if not math.isclose(steps * T, horizon, rel_tol=1e-6):
            raise InputError(
                f"{_OWNER}: horizon must be a whole number of periods of {T:g} s, got {horizon:g} s"
            )
        blocks = (1,) * steps if blocking is None else tuple(blocking)
        if not blocks or sum(blocks) != steps or any(b != int(b) or b < 1 for b in blocks):
            raise InputError(
                f"{_OWNER}: blocking must be whole numbers of at least 1 with the sum {steps}, got "
                f"{blocks}"
            )
        self.plant, self.period = plant, T
        inputs, self._nx = plant.inputs, len(plant.A)
        signals, over = _signals(plant, T), _sampled(plant, T)
        costs = {k: check_range(_OWNER, f"cost of {k}", v, low=0.0) for k, v in costs.items()}
        at = pick(_OWNER, "output, input or rate", signals.names, list(costs))
        outs = [k for k, name in enumerate(costs) if name in plant.outputs and name not in inputs]
        asked = [[*costs][k] for k in outs] if references is None else references
        pick(_OWNER, "output or input with a cost", [*costs], asked)
        self.references, self.disturbances = tuple(asked), plant.disturbances
        nd, nr = len(plant.disturbances), len(asked)
        # The path holds disturbances and references: w is both, and a reference moves nothing.
        cost = signals.C[at], signals.D[at], _wider(signals.F[at], nr), signals.G[at].copy()
        C, D, F, G = cost
        for k, name in enumerate(costs):
            if name in asked:
                F[k, nd + self.references.index(name)] -= 1.0
        A, B, from_path = over[0], over[1], _wider(over[2], nr)
        beside = B.copy()
        beside[self._nx :] = 0.0  # what acts beside an input is not the input before
        lasts = np.ones(nd + nr)
        lasts[pick(_OWNER, "disturbance", plant.disturbances, list(plant.rates))] = 0.0
        Gamma = np.hstack([lasting(from_path, lasts), beside])
        weights = np.array(list(costs.values()))
        n = self._nx
        if outs:  # what does not last is not held
            held = steady_inputs(
                A[:n, :n],
                B[:n],
                C[outs][:, :n],
                D[outs],
                weights=weights[outs],
                Gamma=Gamma[:n],
                M=np.hstack([lasting(F[outs], lasts), G[outs]]),
            )
            for k, name in enumerate(costs):
                if name in inputs and name not in asked:
                    F[k, : nd + nr] -= held[inputs.index(name), : nd + nr] * lasts
                    G[k] -= held[inputs.index(name), nd + nr :]
        M = np.hstack([lasting(F, lasts), G])
        self._check(A, B, C, D, costs, steps, ends=terminal is None)
        Phi = scipy.linalg.block_diag(np.diag(lasts), np.eye(len(inputs)))
        end_known = np.zeros((len(Phi), len(Phi)))
        if terminal is None:
            try:
                end = lq_regulator(
                    A, B, C, D, weights=weights, scale=np.ones(len(A)), Gamma=Gamma, Phi=Phi, M=M
                )
            except SolverError as error:
                raise InputError(
                    f"{_OWNER}: terminal must be given, as nobody can tell what comes after the "
                    f"horizon ({error})"
                ) from error
        else:
            end, end_known = _weighed_end(terminal, [*costs], weights, C, D, M)
        units = dict.fromkeys(inputs, 1.0)
        for limit in constraints:
            if limit.signal in units:
                ends = [abs(e) for e in (limit.low, limit.high) if math.isfinite(e)]
                units[limit.signal] = max(ends) or 1.0
        pick(_OWNER, "input (in sizes)", inputs, list(sizes or {}))
        super().__init__(
            Horizon(
                A=A,
                B=B,
                from_path=from_path,
                from_constants=beside,
                blocks=blocks,
                units=np.array(list((units | dict(sizes or {})).values())),
            ),
            signals=replace(signals, F=_wider(signals.F, nr)),
            cost=Signals(names=tuple(costs), C=C, D=D, F=F, G=G),
            end=end,
            constraints=constraints,
            inputs=inputs,
            rest=plant.static,
            iterations=iterations,
            time_limit=time_limit,
        )
        self.end_known = end_known
        self.gradient[:, self.last] += self.from_end
        self._matrix = np.ascontiguousarray(
            np.vstack([self.gradient, self.rows[:, : self.horizon.moves.start]])
        )
        self._rates = [
            (self._column(rate), self._column(base)) for rate, base in plant.rates.items()
        ]

    def solve(
        self,
        state: npt.ArrayLike,
        *,
        previous: Known | None = None,
        references: Known | None = None,
        disturbances: Known | None = None,
        offsets: Known | None = None,
    ) -> Plan:
        """Return the plan for a state (n,), a deviation from rest.

        Parameters
        ----------
        state
            The plant's state now.
        previous
            Inputs over the sample before, by name; by default at rest.
        references, disturbances
            By name, a number for all of the horizon or its values at the samples 0, 1, .., of which
            the last one holds on; by default at rest.
        offsets
            What acts besides each input, such as an estimated constant, by name.

        Raises
        ------
        InputError
            If a name is unknown, or a number is not finite.
        """
        h, n = self.horizon, self._nx
        known = np.zeros(h.moves.start)
        given = check_finite(_OWNER, "state", state)
        if given.shape != (n,):
            raise InputError(f"{_OWNER}: state must be {n} numbers, got {given.shape}")
        known[:n] = given
        for at, kind, named in ((n, "previous", previous), (h.constants.start, "offsets", offsets)):
            for name, value in (named or {}).items():
                k = pick(_OWNER, f"input (in {kind})", self.inputs, [name])[0]
                off = self.rest.get(name, 0.0) if kind == "previous" else 0.0
                known[at + k] = check_range(_OWNER, f"{kind} {name}", value) - off
        path = known[h.path].reshape(h.steps + 1, -1)
        for names, kind, named, first in (
            (self.disturbances, "disturbance", disturbances, 0),
            (self.references, "reference", references, len(self.disturbances)),
        ):
            for name, values in (named or {}).items():
                k = first + pick(_OWNER, kind, names, [name])[0]
                line = check_finite(_OWNER, f"{kind} {name}", values).reshape(-1)[: len(path)]
                if not line.size:
                    raise InputError(f"{_OWNER}: {kind} {name} must be at least one number")
                path[:, k] = line[-1]
                path[: line.size, k] = line
                path[:, k] -= self.rest.get(name, 0.0)
        for rate, base in self._rates:
            if not path[:, rate].any():
                path[:, rate] = np.gradient(path[:, base], self.period)
        known[h.path] = path.reshape(-1)
        product = self._matrix @ known
        moves = len(self.H)
        asked = self.question(product[:moves], product[moves:], self.low, self.high)
        solved = self.qp.solve(*asked)
        if not solved.ok:
            self.qp.reset()
        return Plan(self, known, asked, solved)

    def _column(self, name: str) -> int:
        return self.disturbances.index(name)

    def _check(
        self,
        A: FloatArray,
        B: FloatArray,
        C: FloatArray,
        D: FloatArray,
        costs: Mapping[str, float],
        steps: int,
        *,
        ends: bool,
    ) -> None:
        """Refuse what has no good answer; `ends`: whether it is asked what follows the horizon."""
        weights = np.array(list(costs.values()))
        bend = D.T * weights @ D
        free = [n for n, size in zip(self.plant.inputs, np.diag(bend), strict=True) if size <= 0.0]
        if free or np.linalg.matrix_rank(bend) < len(bend):
            raise InputError(
                f"{_OWNER}: costs must weigh every input or its rate, got none for "
                f"{', '.join(free) or 'some mixture of them'}"
            )
        taken = np.linalg.solve(bend, D.T * weights @ C)
        seen = unreached((A - B @ taken).T, ((C - D @ taken).T * weights)) if ends else None
        for what, at in (
            (f"inputs ({', '.join(self.plant.inputs)}) must reach", unreached(A, B)),
            ("without a terminal cost costs must tell of", seen),
        ):
            if at is not None:
                raise InputError(
                    f"{_OWNER}: {what} every mode of the plant that does not settle by itself; "
                    f"there is one at {pole_text(at, self.period)}"
                )
        grows = float(np.abs(np.linalg.eigvals(A)).max(initial=0.0))
        if steps * math.log(max(grows, 1e-9)) > math.log(_GROWTH):
            most = math.log(_GROWTH) / math.log(grows) * self.period
            raise InputError(
                f"{_OWNER}: horizon must be at most {most:.3g} s, over which the unstable plant "
                f"grows {_GROWTH:g} times, got {steps * self.period:g} s"
            )


def _weighed_end(
    terminal: Mapping[str, float],
    names: Sequence[str],
    weights: FloatArray,
    C: FloatArray,
    D: FloatArray,
    M: FloatArray,
) -> tuple[LQRegulator, FloatArray]:
    """Return the value of an end at which outputs cost, and what zeta alone has of it."""
    at = pick(_OWNER, "output with a cost (in terminal)", names, list(terminal))
    for k in at:
        if D[k].any():
            raise InputError(
                f"{_OWNER}: terminal must name outputs that no input acts on at once, got "
                f"{names[k]!r}"
            )
    heavy = [check_range(_OWNER, f"terminal {k}", v, low=0.0) for k, v in terminal.items()]
    P, N = (C[at].T * heavy @ rows[at] for rows in (C, M))
    value = LQRegulator(weights=weights, P=P, N=N, K=_NONE, K_disturbance=_NONE)
    return value, np.asarray(M[at].T * heavy @ M[at])


def _wider(rows: FloatArray, more: int) -> FloatArray:
    """Return columns of a path, (., 2 nw), with those of references beside them."""
    return np.asarray(np.hstack([np.pad(half, ((0, 0), (0, more))) for half in np.hsplit(rows, 2)]))


def _sampled(plant: LinearPlant, T: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return A, B and from_path of the plant's state and the inputs before."""
    A, B, from_path = sampled(plant, T)
    nu = B.shape[1]
    return (
        np.asarray(scipy.linalg.block_diag(A, np.zeros((nu, nu)))),
        np.vstack([B, np.eye(nu)]),
        np.vstack([from_path, np.zeros((nu, from_path.shape[1]))]),
    )


def _signals(plant: LinearPlant, T: float) -> Signals:
    """Return outputs, inputs and rates of inputs, of the plant's state and the inputs before."""
    n, nu, nd = len(plant.A), len(plant.inputs), len(plant.disturbances)
    own = [k for k, name in enumerate(plant.outputs) if name not in plant.inputs]
    nz, eye = len(own), np.eye(nu)
    C = np.zeros((nz + 2 * nu, n + nu))
    C[:nz, :n], C[nz + nu :, n:] = plant.Cz[own], -eye / T
    F, G = np.zeros((len(C), 2 * nd)), np.zeros((len(C), nu))
    F[:nz, :nd], G[:nz] = plant.Fz[own], plant.Dz[own]
    names = [plant.outputs[k] for k in own]
    return Signals(
        names=(*names, *plant.inputs, *(f"rate of {name}" for name in plant.inputs)),
        C=C,
        D=np.vstack([plant.Dz[own], eye, eye / T]),
        F=F,
        G=G,
    )
