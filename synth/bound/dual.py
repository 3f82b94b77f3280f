r"""LQG under rms limits by its dual: multipliers whose every value is a lower bound.

For multipliers of at least zero, the best controller for the weighted sum of what is minimised
and of what is limited costs no more than any controller that keeps the limits,

.. math::

    d(\lambda) = \min_K \Big[ J_0(K) + \sum_i \lambda_i (J_i(K) - b_i^2) \Big]
    \le \min_{J_i(K) \le b_i^2} J_0(K) ,

and the inner minimum is plain LQG (Boyd and Barratt, *Linear Controller Design*, 1991, ch. 14;
Zhu, Rotea and Skelton 1997).  d is concave, with the gradient J_i - b_i^2; the filter's Riccati
equation does not depend on the multipliers and is solved once.

Both Riccati equations need a plant whose disturbances are white and of intensity one:
`shaped_plant` takes the sea's filter into the plant, `with_input_outputs` makes a command that is
charged or limited an output as any other.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import minimize

from models.basics import FloatArray, InputError, SolverError, solve_lyapunov
from models.plant import LinearPlant, ShapingFilter

from ..structures import LqgEstimator, LqgRegulator, estimator, regulator, shaped, weighing

_LEAST = 1e-6  # of a multiplier, as a price: lambda b^2 over the cost
_MOST = 1e6
_SETTLED = 1e-7  # gap at which no further step is made
_STEPS = 12
_NEAR = 0.3  # gap from which Newton's method is tried first ...
_ARRIVED = 1e-6  # ... and at which its answer is taken
_HAIR = 0.5  # in the logarithm of a multiplier that is at most a millionth of the cost


def shaped_plant(plant: LinearPlant, sources: Mapping[str, ShapingFilter | float]) -> LinearPlant:
    """Return `synth.structures.shaped`, its white noises checked.

    Raises InputError if a white noise has a rate that acts on the plant too.
    """
    for name, source in sources.items():
        rates = [plant.disturbances.index(r) for r, of in plant.rates.items() if of == name]
        through_rate = any(np.any(m[:, rates]) for m in (plant.E, plant.F, plant.Fz))
        if through_rate and not isinstance(source, ShapingFilter):
            raise InputError(
                f"bound: {name} acts through its rate too, so its spectrum must fall off; "
                "got white noise"
            )
    return shaped(plant, sources)


def with_input_outputs(plant: LinearPlant, names: Sequence[str]) -> LinearPlant:
    """Return the plant with those of its inputs that are named among its outputs, too."""
    wanted = [n for n in dict.fromkeys(names) if n in plant.inputs and n not in plant.outputs]
    if not wanted:
        return plant
    rows = np.eye(len(plant.inputs))[[plant.inputs.index(name) for name in wanted]]
    more = len(wanted)
    return replace(
        plant,
        Cz=np.vstack([plant.Cz, np.zeros((more, len(plant.states)))]),
        Dz=np.vstack([plant.Dz, rows]),
        Fz=np.vstack([plant.Fz, np.zeros((more, len(plant.disturbances)))]),
        outputs=(*plant.outputs, *wanted),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class DualPoint:
    """The LQG optimum for given multipliers."""

    multipliers: FloatArray  #: In the order of the limits, (m,).
    regulator: LqgRegulator  #: The state feedback.
    cost: float  #: Optimum of J0 + sum lambda J.
    variances: FloatArray  #: Of every output of the plant with this controller, (nz,).


class Dual:
    """LQG on a plant whose disturbances are white and of intensity one.

    The plant is as of `shaped_plant`, without delays and rates.  `minimise` are weights on the
    variances of outputs, `limits` bounds on the rms of outputs, by name.

    Raises
    ------
    InputError
        If an input is free of charge or a measurement free of noise.
    SolverError
        If the filter's Riccati equation has no stabilising solution.
    """

    def __init__(
        self, plant: LinearPlant, minimise: Mapping[str, float], limits: Mapping[str, float]
    ) -> None:
        self.plant = plant
        self.weights = np.array([minimise.get(name, 0.0) for name in plant.outputs])
        self.rows = [plant.outputs.index(name) for name in limits]
        self.squares = np.array(list(limits.values()), dtype=np.float64) ** 2
        charged = self.weights.copy()
        charged[self.rows] = 1.0
        for k, name in enumerate(plant.inputs):
            if not np.any(plant.Dz[charged > 0.0, k]):
                raise InputError(
                    f"bound: {name} is free of charge, so the best controller would use it "
                    "without end; limit it, or an output that it reaches directly"
                )
        for k, name in enumerate(plant.outputs):
            if charged[k] > 0.0 and np.any(plant.Fz[k]):
                raise InputError(
                    f"bound: {name} hears white noise directly, so its variance has no end; "
                    "leave one of them out"
                )
        for k, name in enumerate(plant.measurements):
            if not np.any(plant.F[k]):
                raise InputError(
                    f"bound: {name} must have noise of its own, got none; give it a white one "
                    "or leave it out"
                )

    @cached_property
    def estimator(self) -> LqgEstimator:
        """The Kalman filter, the same for all multipliers."""
        E, F = self.plant.E, self.plant.F
        try:
            return estimator(self.plant, E @ E.T, F @ F.T, E @ F.T)
        except SolverError as error:
            raise SolverError(
                "bound: the filter's Riccati equation has no stabilising solution: every "
                "measurement needs white noise, and every undamped mode something that shakes it"
            ) from error

    def at(self, multipliers: FloatArray) -> DualPoint:
        """Return the LQG optimum for multipliers, (m,).

        Raises SolverError if the regulator's Riccati equation has no stabilising solution, or
        rounding has left a variance below zero.
        """
        plant, kalman = self.plant, self.estimator
        charge = self.charge(multipliers)
        feedback = regulator(plant, *weighing(plant.Cz, plant.Dz, charge))
        K = feedback.gain
        cost = np.sum(plant.E * (feedback.X @ plant.E)) + np.sum((K.T @ feedback.R @ K) * kalman.Y)
        # The estimate is shaken by the innovations; the error is independent of it.
        L = kalman.gain
        estimate = solve_lyapunov(plant.A + plant.B @ K, L @ kalman.V @ L.T)
        moved = plant.Cz + plant.Dz @ K
        variances = np.sum((moved @ estimate) * moved, axis=1)
        variances += np.sum((plant.Cz @ kalman.Y) * plant.Cz, axis=1)
        if not np.all(variances >= 0.0):
            # As the price of a limit that cannot be kept grows without end.
            raise SolverError("bound: no digits are left of the variances at these multipliers")
        return DualPoint(
            multipliers=multipliers,
            regulator=feedback,
            cost=float(cost),
            variances=np.asarray(variances, dtype=np.float64),
        )

    def charge(self, multipliers: FloatArray) -> FloatArray:
        """Return the weights of all outputs, (nz,)."""
        charge = self.weights.copy()
        np.add.at(charge, self.rows, multipliers)
        return charge

    def value(self, point: DualPoint) -> float:
        """Return d, the lower bound on the cost J0."""
        return point.cost - float(point.multipliers @ self.squares)

    def primal(self, point: DualPoint) -> float:
        """Return J0 of the point's controller."""
        return float(self.weights @ point.variances)

    def gap(self, point: DualPoint) -> float:
        """Return what is left between the bound and a controller that keeps the limits, over J0.

        sum lambda |J - b^2|, with the excess over a limit counted at its price.
        """
        return self._open(point, np.full(len(self.rows), -np.inf))

    def maximise(self, start: FloatArray | None = None) -> DualPoint:
        """Return the multipliers of the highest bound."""
        if not self.rows:
            return self.at(np.zeros(0))
        point = self._begin() if start is None else self.at(start)
        scale = max(self.primal(point), 1e-300)
        low = np.log(_LEAST * scale / self.squares)
        high = np.log(_MOST * scale / self.squares)
        if start is not None and self.gap(point) < _NEAR:
            # From close by, Newton's method alone arrives in a few steps.
            point = self._polished(point, low, high)
            if self._open(point, low) < _ARRIVED:
                return point
        # d is concave in lambda but not in its logarithm, which keeps the multipliers positive and
        # of one size: the search keeps the best point by itself.
        best = point

        def negative(theta: FloatArray) -> tuple[float, FloatArray]:
            nonlocal best
            try:
                here = self.at(np.exp(theta))
            except SolverError:
                return 1e6, np.zeros(theta.size)
            if self.value(here) > self.value(best):
                best = here
            slope = here.multipliers * (here.variances[self.rows] - self.squares)
            return -self.value(here) / scale, -slope / scale

        minimize(
            negative,
            np.clip(np.log(point.multipliers), low, high),
            jac=True,
            method="L-BFGS-B",
            bounds=list(zip(low, high, strict=True)),
            options={"maxiter": 60, "ftol": 1e-10, "gtol": 1e-6},
        )
        return self._polished(best, low, high)

    def _open(self, point: DualPoint, low: FloatArray) -> float:
        """Return the gap without that of slack limits, whose multipliers are as low as they go."""
        excess = point.variances[self.rows] - self.squares
        above = (np.log(point.multipliers) > low + 1e-9) | (excess > 0.0)
        slack = point.multipliers * np.abs(excess) * above
        return float(np.sum(slack) / max(self.primal(point), 1e-300))

    def _begin(self) -> DualPoint:
        """Return multipliers of about the right size."""
        size = 1.0
        for _ in range(30):
            point = self.at(size / self.squares)
            wanted = 0.1 * self.primal(point) / len(self.rows)
            if 0.1 < wanted / size < 10.0:
                break
            size = float(np.clip(wanted, 1e-4 * size, 1e4 * size))
        return point

    def _polished(self, point: DualPoint, low: FloatArray, high: FloatArray) -> DualPoint:
        """Return a point by Newton's method on log J = log b^2, in log lambda."""
        # A slack limit whose multiplier stopped a hair above its least is slack all the same; taken
        # for an active one it would lead the steps astray.
        theta = np.log(point.multipliers)
        slack = (theta < low + _HAIR) & (point.variances[self.rows] < self.squares)
        if np.any(slack & (theta > low)):
            point = self.at(np.exp(np.where(slack, low, theta)))
        for _ in range(_STEPS):
            if self._open(point, low) < _SETTLED:
                break
            theta = np.log(point.multipliers)
            excess = np.log(point.variances[self.rows] / self.squares)
            active = (theta > low + 1e-9) | (excess > 0.0)
            active &= (theta < high - 1e-9) | (excess < 0.0)
            if not active.any():
                break
            columns = []
            try:
                for i in np.flatnonzero(active):
                    moved = theta.copy()
                    moved[i] += 1e-4
                    there = self.at(np.exp(moved))
                    columns.append(np.log(there.variances[self.rows] / self.squares) - excess)
            except SolverError:
                break  # every point is a lower bound: the best so far stays
            jacobian = np.array(columns).T[active] / 1e-4
            step = np.zeros(theta.size)
            step[active] = np.linalg.lstsq(jacobian, -excess[active], rcond=1e-12)[0]
            step = np.clip(step, -2.0, 2.0)
            for shrink in (1.0, 0.3, 0.1, 0.03):
                try:
                    trial = self.at(np.exp(np.clip(theta + shrink * step, low, high)))
                except SolverError:
                    continue
                if self.value(trial) > self.value(point) or self.gap(trial) < self.gap(point):
                    break
            else:
                break
            point = trial
        return point
