"""Products of a step that do not change, made once: `Products`.

    chi --> [A chi; gradient; free response of the rows] in one matrix product

The rows come scaled to their limits, so that a violation of one per cent costs the same whatever
is limited.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from models.basics import FloatArray, read_only

from ..forecast import Forecast
from ..programme import Condensed
from ..winch import PredictionModel
from .winch_programme import WATCHED, by_chi, path_of_sea, sea_at_end

_NONE = np.zeros(0)
_WIDE = 1e20  # no limit, for the solver


@dataclass(frozen=True, kw_only=True, eq=False)
class Products:
    """Matrices of one step: rows R (nr, nb), and what each is scaled by, (nr,); `of` makes them."""

    size: int
    moves: int
    matrix: FloatArray
    rows: FloatArray
    scale: FloatArray
    low: FloatArray
    high: FloatArray
    path_gradient: FloatArray
    path_free: FloatArray
    moved_gradient: FloatArray
    moved_free: FloatArray
    speed_known: FloatArray
    speed_moves: FloatArray

    @classmethod
    def of(
        cls,
        model: PredictionModel,
        programme: Condensed,
        limits: Mapping[str, tuple[float, float]],
        covariance: FloatArray | None,
        believed: PredictionModel,
    ) -> Products:
        """Return the products of a programme on a model, within deviations of each watched signal.

        The covariance is None where the hook's path is that of the model's own sea; where it comes
        with each step, that of the sea's estimate, (nh, nh), whose A is that of the model
        `believed`.
        """
        p, h, winch, nb = programme, programme.horizon, model.winch, len(programme.blocks)
        # A violation of one per cent is to cost the same whatever is limited: rows in units of
        # their larger bound.
        names = [WATCHED[k] for k in p.kind]
        bounds = np.array([limits[name] for name in names]).reshape(len(names), 2)
        size = np.where(np.isfinite(bounds), np.abs(bounds), 0.0).max(axis=1, initial=0.0)
        scale = 1.0 / np.maximum(size, 1e-9)
        to_path = path_of_sea(model, p.steps)
        ahead = np.linalg.matrix_power(model.A[model.sea_at, model.sea_at], p.steps)
        gradient, free = by_chi(model, h, p.gradient), by_chi(model, h, p.rows)
        path_gradient = p.gradient[:, h.path]
        if covariance is not None:
            from_path, from_sea = sea_at_end(model, p.steps, covariance)
            path_gradient = path_gradient + p.from_end @ from_path
            gradient[:, model.sea_at] = p.from_end @ from_sea
        else:
            gradient[:, model.sea_at] = path_gradient @ to_path + p.from_end @ ahead
            free[:, model.sea_at] = p.rows[:, h.path] @ to_path
        # A heavier load has stretched the rope before the payload's zero was set: what the tension
        # then has over the case's is its estimated bias (`mpc.winch.prediction`).
        for k, name in enumerate(names):
            if name == "tension":
                free[k, model.constants_at.start + 3] = 1.0
        speed_known = by_chi(model, h, p.speeds)
        speed_known[:, model.sea_at] = p.speeds[:, h.path] @ to_path
        # A load that is to be elsewhere, or to move: everything is counted from there, but the
        # limits on speed and command are not.
        moved_free = p.rows[:, h.state] @ winch.moved
        own = {"speed": winch.speed, "command": winch.back * winch.reckoned}
        for k, name in enumerate(names):
            if name in own:
                moved_free[k] -= own[name] @ winch.moved
        return cls(
            size=model.size,
            moves=nb,
            matrix=np.ascontiguousarray(np.vstack([believed.A, gradient, free * scale[:, None]])),
            rows=np.ascontiguousarray(p.rows[:, h.moves] * scale[:, None]),
            scale=read_only(scale),
            low=read_only(np.maximum(bounds[:, 0] * scale, -_WIDE)),
            high=read_only(np.minimum(bounds[:, 1] * scale, _WIDE)),
            path_gradient=np.ascontiguousarray(path_gradient),
            path_free=np.ascontiguousarray(p.rows[:, h.path] * scale[:, None]),
            moved_gradient=p.gradient[:, h.state] @ winch.moved,
            moved_free=moved_free * scale[:, None],
            speed_known=speed_known,
            speed_moves=np.ascontiguousarray(p.speeds[:, -nb:]),
        )

    def known(self, chi: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return A chi, the gradient and the free response, of chi alone."""
        product = self.matrix @ chi
        n, m = self.size, self.size + self.moves
        return product[:n], product[n:m], product[m:]

    def shifted(
        self, gradient: FloatArray, free: FloatArray, reference: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return gradient and free response about a place [m] and a speed [m/s], (2,)."""
        return gradient - self.moved_gradient @ reference, free - self.moved_free @ reference

    def along(
        self, gradient: FloatArray, free: FloatArray, forecast: Forecast
    ) -> tuple[FloatArray, FloatArray]:
        """Return gradient and free response with the hook on a path that is forecast."""
        path = np.empty(2 * len(forecast.displacement))
        path[0::2], path[1::2] = forecast.displacement, forecast.velocity
        return gradient + self.path_gradient @ path, free + self.path_free @ path

    def question(
        self,
        gradient: FloatArray,
        free: FloatArray,
        low: FloatArray,
        high: FloatArray,
        hard: tuple[FloatArray, FloatArray] = (_NONE, _NONE),
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return gradient, lower and upper bounds for the solver; `hard`: of its hard rows."""
        lower = np.concatenate((low, hard[0], self.low - free))
        upper = np.concatenate((high, hard[1], self.high - free))
        return gradient, lower, upper

    def speeds(self, chi: FloatArray, moves: FloatArray) -> FloatArray:
        """Return the motor speed at the start of each move [rad/s], by the model's own sea."""
        return np.asarray(self.speed_known @ chi + self.speed_moves @ moves)
