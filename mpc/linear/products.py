"""Products of a step that do not change, made once: `Products`.

    chi --> [A chi; gradient; free response of the rows] in one matrix product

The free response is over the limits of the rows, as the programme has it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.basics import FloatArray

from ..forecast import Forecast
from ..programme import Condensed
from ..winch import PredictionModel
from .winch_programme import by_chi, path_of_sea, sea_at_end


@dataclass(frozen=True, kw_only=True, eq=False)
class Products:
    """Matrices of one step; `of` makes them."""

    size: int
    moves: int
    matrix: FloatArray
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
        covariance: FloatArray | None,
        believed: PredictionModel,
    ) -> Products:
        """Return the products of a programme on a model.

        The covariance is None where the hook's path is that of the model's own sea; where it comes
        with each step, that of the sea's estimate, (nh, nh), whose A is that of the model
        `believed`.
        """
        p, h, winch, nb = programme, programme.horizon, model.winch, len(programme.blocks)
        names = [p.signals.names[k] for k in p.kind]
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
                free[k, model.constants_at.start + 3] = p.scale[k]
        speed_known = by_chi(model, h, p.traced)
        speed_known[:, model.sea_at] = p.traced[:, h.path] @ to_path
        # A load that is to be elsewhere, or to move: everything is counted from there, but the
        # limits on speed and command are not.
        moved_free = p.rows[:, h.state] @ winch.moved
        own = {"speed": winch.speed, "command": winch.back * winch.reckoned}
        for k, name in enumerate(names):
            if name in own:
                moved_free[k] -= p.scale[k] * (own[name] @ winch.moved)
        return cls(
            size=model.size,
            moves=nb,
            matrix=np.ascontiguousarray(np.vstack([believed.A, gradient, free])),
            path_gradient=np.ascontiguousarray(path_gradient),
            path_free=np.ascontiguousarray(p.rows[:, h.path]),
            moved_gradient=p.gradient[:, h.state] @ winch.moved,
            moved_free=moved_free,
            speed_known=speed_known,
            speed_moves=np.ascontiguousarray(p.traced[:, -nb:]),
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

    def speeds(self, chi: FloatArray, moves: FloatArray) -> FloatArray:
        """Return the motor speed at the start of each move [rad/s], by the model's own sea."""
        return np.asarray(self.speed_known @ chi + self.speed_moves @ moves)
