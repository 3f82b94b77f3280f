r"""Multiple shooting of the nonlinear winch over the horizon, and its Gauss-Newton condensing.

    arguments y of the last plan --> linearise --> Linearisation: H, rows  (before the measurement)
    chi --> known --> Shooting.free --> gradient, free response            (after it)

What is nonlinear are the forces n at K nodes, phi of the arguments y there; all else is linear in
them, in the moves v and in what is known (`mpc.nonlinear.stage`):

.. math::

    y = y_0 + Y v + G n, \qquad o = o_0 + O v + \Theta n .

So the values that the shooting lifts out are y, not whole states: states of a plant whose
linear part is exact follow from them without a gap, and one Newton step on

.. math::

    n = \bar n + J (y - \bar y) \;\Rightarrow\; (I - J G) n = \bar n - J \bar y + J (y_0 + Y v)

is the Newton step of multiple shooting with all states (J. Albersmeyer and M. Diehl, "The lifted
Newton method and its application in optimization", SIAM J. Optim. 20, 2010), at a cost that does
not grow with the masses of the rope.  J is block diagonal, G block lower triangular, because a
force acts on what comes after it.

The cost is a sum of squares, so that its Gauss-Newton Hessian is that of the linearised
outputs; with the forces' slope zero, all is that of `mpc.programme.horizon`.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg.blas import dtrsm

from models.basics import FloatArray, read_only

from ..linear import Products, by_chi, path_of_sea, sea_at_end
from ..programme import Condensed, LQRegulator
from ..winch import PredictionModel
from .responses import forced_response, linear_response
from .stage import Stage

IntArray = npt.NDArray[np.int64]

_FAINT = 1e-5  # slope of a slack spring's force below which it counts as held


@dataclass(frozen=True, eq=False, slots=True)
class Known:
    """What a sample knows: arguments and outputs without moves and forces, what lies beyond."""

    y: FloatArray
    o: FloatArray
    beyond: FloatArray
    weight: FloatArray


@dataclass(frozen=True, eq=False, slots=True)
class Linearisation:
    """The horizon linearised about a plan, ready for what is known; `Shooting.linearise` makes it.

    The Hessian H is (nb, nb), the outputs' derivatives (no, nb).
    """

    H: FloatArray
    outputs: FloatArray
    moved: FloatArray  # arguments by v, (K my, nb)
    forced: FloatArray  # active forces by v, (na, nb)
    acting: tuple[FloatArray, FloatArray]  # arguments and outputs by active forces
    solve: _Solver
    offset: FloatArray  # n - J y of the active forces at the linearisation
    y: FloatArray  # arguments and outputs by forces that are held
    o: FloatArray


class Shooting:
    """Matrices of a horizon.

    Parameters
    ----------
    model
        The prediction model.
    weights
        The regulator, whose value function ends the horizon.
    programme
        The linear programme, whose blocks and units are taken over.
    products
        Its products, whose rows are taken over.
    stage
        One sample.
    covariance
        As for `Products.of`: None where the hook's path is that of the model's own sea.
    believed
        As for `Products.of`.

    Attributes
    ----------
    payload, end, speeds, rows
        Where among the outputs: the payload at samples 1 .. N - 1, the state at the end, the motor
        speed at the start of each block, the rows of the programme.
    """

    def __init__(
        self,
        model: PredictionModel,
        weights: LQRegulator,
        programme: Condensed,
        products: Products,
        stage: Stage,
        covariance: FloatArray | None,
        believed: PredictionModel,
    ) -> None:
        p, winch = programme, model.winch
        self.stage, self.programme = stage, p
        N, nb, n, nr = p.steps, len(p.blocks), winch.size, len(p.at)
        self.nodes, self._my = N, len(stage.arguments)
        self._m = len(stage.channels)
        ends = np.cumsum([0, N - 1, n, nb, nr]).tolist()
        parts = [slice(a, b) for a, b in itertools.pairwise(ends)]
        self.payload, self.end, self.speeds, self.rows = parts
        self.rest = read_only(np.tile(stage.rest, self.nodes))
        y, o = linear_response(p, stage)
        G, Theta = forced_response(p, stage, p.scale)

        # What is known comes as chi, and as a path if that is not of chi's own sea.
        path = p.horizon.path
        both, size = np.vstack([y, o]), model.size
        of = slice(model.constants_at.start, model.constants_at.start + 2)
        chi = by_chi(model, p.horizon, both)
        nh = model.sea.order
        beyond = np.zeros((n, size))
        beyond[:, of] = weights.N[:, nh:]
        if covariance is None:
            ahead = np.linalg.matrix_power(model.A[model.sea_at, model.sea_at], N)
            chi[:, model.sea_at] = both[:, path] @ path_of_sea(model, N)
            end_of_path = np.zeros((nh, 2 * (N + 1)))
        else:
            end_of_path, ahead = sea_at_end(model, N, covariance)
        beyond[:, model.sea_at] = weights.N[:, :nh] @ ahead
        weight = np.zeros((nb, size))
        lengths = np.array(p.blocks, dtype=np.float64)
        weight[:, of] = -weights.weights[1] * p.unit * np.outer(lengths, winch.steady)
        rows = products.matrix[products.size + products.moves :]
        self._matrix = np.ascontiguousarray(np.vstack([believed.A, chi, rows, beyond, weight]))
        self._parts = np.cumsum([size, len(y), len(o) + nr, n])
        along = [both[:, path], products.path_free, weights.N[:, :nh] @ end_of_path]
        self._along = np.ascontiguousarray(np.vstack(along))
        # All but the motor's speed and the command are counted from where the load is to be.
        self._relative = np.vstack([o[:, :n] @ winch.moved, products.moved_free])
        self._relative[self.speeds] = 0.0

        self._Y, self._O = y[:, -nb:].copy(), np.vstack([o[:, -nb:], p.qp.rows])
        self._G, self._Theta = G, Theta
        # Forces that always have a slope, and those of slack springs, which seldom do.
        slack = [name.startswith("slack.") for name in stage.channels]
        self._always = [c for c, rare in enumerate(slack) if not rare]
        self._rare = [c for c, rare in enumerate(slack) if rare]
        m, K = self._m, self.nodes
        self._always_at = (np.arange(K)[:, None] * m + self._always).ravel().astype(np.int64)
        self._rare_at = (np.arange(K)[:, None] * m + self._rare).ravel().astype(np.int64)
        self._steady_G = np.ascontiguousarray(G[:, self._always_at])
        self._steady_Theta = np.ascontiguousarray(Theta[:, self._always_at])
        self._held_G = np.ascontiguousarray(np.vstack([G, Theta])[:, self._rare_at])
        self._by_argument = {a: G[a :: self._my] for a in range(self._my)}
        self._steady_by = {
            a: np.ascontiguousarray(g[:, self._always_at]) for a, g in self._by_argument.items()
        }
        self._Y_by = {a: np.ascontiguousarray(self._Y[a :: self._my]) for a in range(self._my)}
        self._P = weights.P
        self._bend = np.diag(2.0 * weights.weights[1] * p.unit**2 * lengths / p.cost)

    def known(self, chi: FloatArray) -> tuple[FloatArray, Known]:
        """Return A chi, and what chi tells of the horizon."""
        product = self._matrix @ chi
        a, b, c, d = self._parts
        y = product[a:b] + self.rest
        return product[:a], Known(y, product[b:c], product[c:d], product[d:])

    def along(self, known: Known, displacement: FloatArray, velocity: FloatArray) -> Known:
        """Return what is known with the hook on a path, (N + 1) each."""
        path = np.empty(2 * len(displacement))
        path[0::2], path[1::2] = displacement, velocity
        more = self._along @ path
        b, c = len(known.y), len(known.y) + len(known.o)
        return Known(known.y + more[:b], known.o + more[b:c], known.beyond + more[c:], known.weight)

    def shifted(self, known: Known, reference: FloatArray) -> Known:
        """Return what is known about a place [m] and a speed [m/s], (2,)."""
        o = known.o - self._relative @ reference
        return Known(known.y, o, known.beyond, known.weight)

    def linearise(self, y: FloatArray, *, exact: bool = False) -> Linearisation:
        """Return the linearisation at arguments (K my,).

        Unless it is to be exact, springs far from slack count as linear: it saves most of the time
        and moves the converged answer by some 1e-5 of the peak torque where the rope is slack.
        """
        K, my = self.nodes, self._my
        n, J = self.stage.forces(y.reshape(K, my))
        # Each active force costs a column of G, an equation and a row of the Hessian's factors.
        # Drag has a slope at every node; a spring has one only where it is about to go slack.
        rare = np.zeros(0, dtype=np.int64)
        if self._rare:
            steep = np.abs(J[:, self._rare, :]).max(axis=2).ravel() > (0.0 if exact else _FAINT)
            if steep.any():
                rare = self._rare_at[steep]
        flat = n.ravel()
        # Slack springs that are far from it: a force that is held.
        calm = flat[self._rare_at]
        if rare.size:
            calm = np.where(np.isin(self._rare_at, rare), 0.0, calm)
        held = self._held_G @ calm if self._rare else np.zeros(K * my + len(self._O))
        always = self._always_at
        G, Theta = self._steady_G, self._steady_Theta
        if rare.size:
            G = np.hstack([G, self._G[:, rare]])
            Theta = np.hstack([Theta, self._Theta[:, rare]])
        solve = _Solver(self, J, rare)
        active = np.concatenate([always, rare]) if rare.size else always
        offset = flat[active] - solve.times(y)
        forced = solve(solve.sloped(self._Y, self._Y_by))
        # Moves act by themselves (O v) and through the forces that they change (Theta n).
        outputs = self._O + Theta @ forced
        # Gauss-Newton: a sum of squares of outputs, the forces' curvature left out.
        p, end = outputs[self.payload], outputs[self.end]
        H = (2.0 / self.programme.cost) * (p.T @ p + end.T @ (self._P @ end)) + self._bend
        return Linearisation(
            H=0.5 * (H + H.T),
            outputs=outputs,
            moved=self._Y,
            forced=forced,
            acting=(G, Theta),
            solve=solve,
            offset=offset,
            y=held[: K * my],
            o=held[K * my :],
        )

    def free(
        self, prepared: Linearisation, known: Known
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return gradient (nb,), outputs (no,) and active forces (na,) at moves of zero."""
        n = prepared.solve(prepared.offset + prepared.solve.times(known.y + prepared.y))
        o = known.o + prepared.o + prepared.acting[1] @ n
        S = prepared.outputs
        pull = self._P @ o[self.end] + known.beyond
        gradient = S[self.payload].T @ o[self.payload] + S[self.end].T @ pull + known.weight
        return (2.0 / self.programme.cost) * gradient, o, n

    def arguments(
        self, prepared: Linearisation, known: Known, n: FloatArray, v: FloatArray
    ) -> FloatArray:
        """Return the arguments (K my,) of moves v, with the free active forces n."""
        acting = prepared.acting[0] @ (n + prepared.forced @ v)
        return np.asarray(known.y + prepared.y + prepared.moved @ v + acting)

    def later(self, y: FloatArray) -> FloatArray:
        """Return the arguments a sample later, those of the last sample twice."""
        return np.concatenate([y[self._my :], y[-self._my :]])


class _Solver:
    """(I - J G) n = b for the active forces: those always there, then the slack springs."""

    def __init__(self, shooting: Shooting, J: FloatArray, rare: IntArray) -> None:
        # In blocks, the forces that are always there first and the slack springs last,
        #     [ M      right  ] [first]   [b_1]
        #     [ below  corner ] [last ] = [b_2] ,
        # M is block lower triangular (a force acts on what comes after it) and solved in place; the
        # springs that are slack are few, and their Schur complement is small.
        s, self._J, self._rare = shooting, J, rare
        self._s = s
        K, ma = s.nodes, len(s._always)
        M = np.zeros((K, ma, K * ma))
        for row, c in enumerate(s._always):
            for a in _arguments_of(s.stage, c):
                M[:, row] -= J[:, c, a, None] * s._steady_by[a]
        if ma > 0:
            k = np.arange(K)[:, None] * ma + np.arange(ma)
            diagonal = M[np.arange(K)[:, None, None], np.arange(ma)[None, :, None], k[:, None, :]]
            diagonal = diagonal + np.eye(ma)
            # Every node's own block made one, so that what is left is unit lower triangular.
            if ma == 1:
                self._own = 1.0 / diagonal
                M *= self._own
            else:
                self._own = np.linalg.inv(diagonal)
                M = np.matmul(self._own, M)
        self._M = M.reshape(K * ma, K * ma)
        if rare.size:
            node, channel = np.divmod(rare, s._m)
            right = np.zeros((K, ma, rare.size))
            for row, c in enumerate(s._always):
                for a in _arguments_of(s.stage, c):
                    right[:, row] -= J[:, c, a, None] * s._by_argument[a][:, rare]
            below = np.zeros((rare.size, s._m * K))
            for a in range(s._my):
                below -= J[node, channel, a, None] * s._by_argument[a][node]
            self._below = below[:, s._always_at]
            self._right = self._triangular(right.reshape(K * ma, rare.size))
            self._corner = np.eye(rare.size) + below[:, rare] - self._below @ self._right

    def __call__(self, b: FloatArray) -> FloatArray:
        """Return n for right-hand sides (na,) or (na, k)."""
        if self._rare.size == 0:
            return self._triangular(b)
        first = self._triangular(b[: len(self._M)])
        last = np.linalg.solve(self._corner, b[len(self._M) :] - self._below @ first)
        return np.concatenate([first - self._right @ last, last])

    def _triangular(self, b: FloatArray) -> FloatArray:
        """Solve with the forces that are always there."""
        if not len(self._M):
            return b
        K, ma = self._s.nodes, len(self._s._always)
        columns = b.reshape(len(b), -1)
        if ma == 1:
            scaled = self._own[:, :, 0] * columns
        else:
            scaled = np.matmul(self._own, columns.reshape(K, ma, -1)).reshape(len(b), -1)
        # Row-major arrays are column-major ones transposed.
        found = dtrsm(1.0, self._M.T, scaled.T, side=1, lower=0, trans_a=0, diag=1)
        return np.asarray(found).T.reshape(b.shape)

    def times(self, y: FloatArray) -> FloatArray:
        """Return J y of the active forces, for arguments (K my,)."""
        s, J = self._s, self._J
        each = y.reshape(s.nodes, s._my)
        product = np.zeros((s.nodes, s._m))
        for c, a in s.stage.pairs:
            product[:, c] += J[:, c, a] * each[:, a]
        flat = product.ravel()
        if s._m == len(s._always):
            return flat
        first = product[:, s._always].ravel()
        return np.concatenate([first, flat[self._rare]]) if self._rare.size else first

    def sloped(self, Y: FloatArray, by: dict[int, FloatArray]) -> FloatArray:
        """Return J Y of the active forces, for the arguments' derivatives (K my, nb)."""
        s, J = self._s, self._J
        product = np.zeros((s.nodes, len(s._always), Y.shape[1]))
        for row, c in enumerate(s._always):
            for a in _arguments_of(s.stage, c):
                product[:, row] += J[:, c, a, None] * by[a]
        first = product.reshape(-1, Y.shape[1])
        if not self._rare.size:
            return first
        node, channel = np.divmod(self._rare, s._m)
        last = np.zeros((self._rare.size, Y.shape[1]))
        for a in range(s._my):
            last += J[node, channel, a, None] * by[a][node]
        return np.concatenate([first, last])


def _arguments_of(stage: Stage, channel: int) -> list[int]:
    return [a for c, a in stage.pairs if c == channel]
