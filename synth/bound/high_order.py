r"""Best controller found within an M_s, of as low an order as will do: `high_order`.

    YoulaDesign of many states -> balanced truncation, order by order -> checked on the true plant
      -> HighOrder

What counts of a controller's state is how far the loop drives it, by what shakes the plant and by
a noise on the command, and what it does in the loop, to what is minimised and limited and to the
command.  Both Gramians are integrals over frequency on the exact responses,

.. math::
    W_r = \int |(i\omega - A_c)^{-1} B_c\, y|^2 d\omega , \qquad
    W_o = \int |w\, S C_c (i\omega - A_c)^{-1}|^2 d\omega ,

their square roots the responses at the nodes themselves (Enns, "Model reduction with balanced
realizations", CDC 1984; by quadrature: Phillips and Silveira, IEEE Trans. CAD 24, 2005), so that
nothing is lost to squares of small numbers.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from models.basics import ComplexArray, FloatArray, SynthesisError, one_thread, truncation_of_roots

from ..loop import LinearController, Margins, closed_loop_poles, loop_margins
from .truth import controller_rms, densities, filter_plant, frequencies
from .youla import Truth, YoulaDesign, margin_grid, realised_basis, upper_triangle

_LOST = 0.02  # of the rms, by the truncation
SPARE = 0.97  # of the M_s above one, asked of the full order
_EXCESS = 1.002  # over a limit on an rms, for its rounding
_NOISE = 0.3  # of the command's own rms, on it, over all frequencies
_LEAST = 2  # states
_PADE = 6  # of the delays, where poles are looked at


@dataclass(frozen=True, kw_only=True, eq=False)
class HighOrder:
    """A controller within an M_s, found and not proved to be the best."""

    #: Root of the weighted variance on the bound's plant, with its true spectra and delays.
    rms: float
    controller: LinearController  #: u = +C y.
    margins: Margins  #: On the true plant.

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.controller.A)


def roots(design: YoulaDesign) -> tuple[FloatArray, FloatArray]:
    """Return square roots of what the states are heard and reached by, (n, n): W = root' root."""
    loop, bound = design.loop, design.bound
    ny = loop.L.shape[1]
    omega, weights = frequencies(bound.sources, loop.marks)
    omega, weights = omega[1:], np.sqrt(weights[1:])
    blocks = loop.at(omega)
    plant = bound.plant.response(omega).select(disturbances=[s.name for s in bound.sources])
    gains = design.weights.reshape(ny, -1)
    Q = blocks.functions @ gains.T
    shaken = plant.yw * np.sqrt(densities(bound.sources, omega)).T[:, None]
    X = blocks.X + blocks.M[:, None] * (Q[:, None] @ blocks.N)[:, 0]
    command = (X[:, None] @ shaken)[:, 0] * weights[:, None]
    moved = float(np.linalg.norm(command))

    # The innovations, by what shakes the plant and by a noise that is even over the decades.
    noise = _NOISE * moved / np.sqrt(omega)[:, None, None] * blocks.yu[:, :, None]
    heard = blocks.N @ np.concatenate([shaken, noise], axis=2) * weights[:, None, None]
    observed = (blocks.estimated + blocks.pushed[:, :, None] * Q[:, None]) @ heard
    functions = blocks.functions[:, None, :, None] * heard[:, :, None]
    reached = np.concatenate([observed, functions.reshape(len(omega), -1, heard.shape[2])], axis=1)

    # What a state does to the command, with all that the loop makes of it.
    through = blocks.estimated.swapaxes(1, 2) @ loop.K[0] + blocks.M[:, None] * Q
    of_observer = loop.feedback.response(omega).yu[:, 0] + (through[:, None] @ blocks.error)[:, 0]
    count = loop.poles.size
    A, _ = realised_basis(loop.poles, 1)
    inside = filter_plant(A, np.eye(count), np.eye(count), np.zeros((count, count)))
    of_functions = gains @ inside.response(omega).yu * blocks.M[:, None, None]
    row = np.concatenate([of_observer, of_functions.reshape(len(omega), -1)], axis=1)
    charge = bound.dual.charge(bound.point.multipliers)[
        [bound.dual.plant.outputs.index(name) for name in plant.outputs]
    ]
    does = np.abs(plant.zu[:, :, 0]) ** 2 @ charge + (design.value / moved) ** 2
    acted = row * (np.sqrt(does) * weights)[:, None]
    driven = np.moveaxis(reached, 1, 2).reshape(-1, row.shape[1])
    return upper_triangle(acted), upper_triangle(driven)


def truncated(
    design: YoulaDesign, order: int, found: tuple[FloatArray, FloatArray]
) -> LinearController:
    """Return a design's controller on at most `order` states; it need not be stabilising.

    `found` are its `roots`.
    """
    left, right = truncation_of_roots(*found, order)
    given = design.controller
    return replace(given, A=left @ given.A @ right, B=left @ given.B, C=given.C @ right)


@one_thread()
def high_order(
    design: YoulaDesign,
    max_sensitivity: float,
    truth: Truth | None = None,
    *,
    states: int | None = None,
) -> HighOrder:
    """Return a design's controller on the fewest states that lose little.

    It is stable on the true plant with its exact delays and on the bound's own, keeps M_s on the
    true one and the limits on the bound's, and loses at most two per cent.  The design is of full
    order, for somewhat less than `max_sensitivity`; the answer has at most so many `states`.

    Raises SynthesisError if no truncation does.
    """
    bound = design.bound
    true = truth or Truth(plant=bound.plant)
    both = [true.plant] if true.plant is bound.plant else [true.plant, bound.plant]
    plants = [plant.without_delays(_PADE, at="measurements") for plant in both]
    grid = margin_grid(np.concatenate([design.loop.marks, true.plant.poles()]))
    yu = true.yu(grid)
    names = list(dict.fromkeys([*bound.minimise, *bound.limits]))
    found = roots(design)
    most = len(design.controller.A) if states is None else states
    for order in range(min(_LEAST, most), most + 1):
        controller = truncated(design, order, found)
        if len(controller.A) < order:
            break
        gain = -np.sum(_response(controller, grid) * yu, axis=1)
        if np.min(np.abs(1.0 + gain)) * max_sensitivity < 1.0:
            continue
        if any(closed_loop_poles(p, controller).real.max() >= 0.0 for p in plants):
            continue
        made = controller_rms(bound.plant, bound.sources, controller, names)
        rms = math.sqrt(sum(w * made[name] ** 2 for name, w in bound.minimise.items()))
        kept = all(made[name] <= _EXCESS * limit for name, limit in bound.limits.items())
        if rms > (1.0 + _LOST) * design.value or not kept:
            continue

        def loop_gain(omega: FloatArray, controller: LinearController = controller) -> ComplexArray:
            return np.asarray(-np.sum(_response(controller, omega) * true.yu(omega), axis=1))

        margins = loop_margins(loop_gain, grid, gain)
        if margins.max_sensitivity <= _EXCESS * max_sensitivity:
            return HighOrder(rms=rms, controller=controller, margins=margins)
    raise SynthesisError(f"Youla: no truncation to {most} states keeps M_s {max_sensitivity:.3g}")


def _response(controller: LinearController, omega: FloatArray) -> ComplexArray:
    """Return C(i omega) of a controller with one output, (k, ny)."""
    plant = filter_plant(controller.A, controller.B, controller.C, controller.D)
    return np.asarray(plant.response(omega).yu[:, 0])
