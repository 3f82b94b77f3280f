r"""Nodes on which the variances of all loops of a sweep are integrated, with an error of each.

Nodes made for one loop (`models.basics.quadrature.adaptive_nodes`) do not suit a thousand others.
So every panel gets a Gauss-Kronrod pair: the nodes of the longer rule hold those of the shorter
one, and a second column of weights tells for each loop how far the two differ, at no further
evaluation.  Loops for which that is too far (a resonance narrower than the panels) go on to the
next level, of panels half as long.  The first panels are halved where some pilots of the sweep ask
for it, and those on which all of them are smooth make do with a pair of fewer nodes.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander
from scipy.linalg import block_diag

from models.basics import (
    FloatArray,
    FrequencyAxis,
    Quadrature,
    ReadOnlyArrays,
    cut_panels,
    longest_panel,
)

Density = Callable[[FloatArray], FloatArray]
Panel = tuple[float, float]

_PER_DECADE = 1.5
_CLEARANCE = 0.6  # half of a panel over its distance from each pole of a loop, at most
_FINE, _FINE_RULE = 0.1, 16  # pieces on which a density itself is integrated, and nodes of each

# Kronrod's extensions of the Gauss rules with 7 and with 5 points (Kronrod 1964; the longer is
# QUADPACK's qk15): nodes from the outermost to the middle, and their weights.
_NODES = (
    0.991455371120812639206854697526329, 0.949107912342758524526189684047851,
    0.864864423359769072789712788640926, 0.741531185599394439863864773280788,
    0.586087235467691130294144691693040, 0.405845151377397166906606412076961,
    0.207784955007898467600689403773245, 0.0,
)  # fmt: skip
_KRONROD = (
    0.022935322010529224963732008058970, 0.063092092629978553290700663189204,
    0.104790010322250183839876322541518, 0.140653259715525918745189590510238,
    0.169004726639267902826583426598550, 0.190350578064785409913256402421014,
    0.204432940075298892414161999234649, 0.209482141084727828012999174891714,
)  # fmt: skip
_SHORT_NODES = (
    0.984085360094842464496172934636139, 0.906179845938663992797626878299393,
    0.754166726570849220440817166946116, 0.538469310105683091036314420700209,
    0.279630413161783193413466522748977, 0.0,
)  # fmt: skip
_SHORT_KRONROD = (
    0.042582036751081832864509450847670, 0.115233316622473394024626845880574,
    0.186800796556492657467800026878486, 0.241040339228647586699942611223262,
    0.272849801912558922340993264484456, 0.282987417857491213204255601371106,
)  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class SweepNodes(ReadOnlyArrays):
    """Nodes with two rules on them."""

    omega: FloatArray  #: Nodes, ascending (k,) [rad/s].
    #: The rules, (rules, k) [rad/s]: the one that counts, and the shorter one; the one alone if
    #: there is none to compare with.
    weights: FloatArray
    #: The rules with the common density of the hook's motion in their weights, likewise [m2].
    sea: FloatArray

    def __len__(self) -> int:
        return int(self.omega.size)

    @classmethod
    def of(cls, nodes: Quadrature, density: Density) -> SweepNodes:
        """Return given nodes, of which no error is known."""
        weights = nodes.weights[None]
        return cls(omega=nodes.omega, weights=weights, sea=weights * density(nodes.omega))


def sweep_panels(
    axis: FrequencyAxis, splits: Sequence[float], marks: Sequence[complex] | None = None
) -> list[Panel]:
    """Return panels of an axis, as their ends on it; some end at the splits [rad/s].

    Where they are for one loop, of poles `marks` [1/s], all are a quarter as long, and shorter yet
    near these.
    """
    longest = longest_panel(_PER_DECADE * (1.0 if marks is None else 4.0))
    near = axis.poles(p for p in marks or () if p.real != 0.0)
    return cut_panels(axis, splits, near, longest, _CLEARANCE)


def halved(panels: Sequence[Panel]) -> list[Panel]:
    """Return the halves of panels."""
    return [half for a, b in panels for half in ((a, 0.5 * (a + b)), (0.5 * (a + b), b))]


def sweep_nodes(
    axis: FrequencyAxis,
    panels: Sequence[Panel],
    density: Density,
    *,
    kinks: Sequence[float] = (),
    short: Collection[Panel] = (),
    apart: bool = False,
) -> SweepNodes:
    """Return nodes on panels of an axis, for the density of the hook's motion, of omega [rad/s].

    Kinks of that density [rad/s] that lie within panels then stand in the weights (product
    integration: what is integrated with the density is the polynomial through the nodes), and
    panels need to be no shorter than the responses ask for.  Panels that are among `short` get the
    pair with fewer nodes.  `apart` is whether the difference of the two rules on each panel is
    wanted instead of the shorter rule, as many more rules.
    """
    cuts = axis.cut(np.array(kinks, dtype=np.complex128)).real.tolist()
    omega, weights, sea = [], [], []
    for a, b in panels:
        x, *rules = _rule((a, b) in short)
        (at,), (slope,) = axis.at((0.5 * (a + b) + 0.5 * (b - a) * x)[None])
        own = np.stack([0.5 * (b - a) * rule * slope for rule in rules])
        omega.append(at)
        weights.append(own)
        sea.append(_product(axis, a, b, x, cuts, density) if cuts else own * density(at))
    return SweepNodes(
        omega=np.concatenate(omega), weights=_rules_of(weights, apart), sea=_rules_of(sea, apart)
    )


def _rules_of(pairs: Sequence[FloatArray], apart: bool) -> FloatArray:
    both = np.concatenate(pairs, axis=1)
    if not apart:
        return both
    differences = block_diag(*(pair[:1] - pair[1:] for pair in pairs))
    return np.concatenate([both[:1], differences])


def _product(
    axis: FrequencyAxis, a: float, b: float, x: FloatArray, cuts: list[float], density: Density
) -> FloatArray:
    """Return the weights of both rules of a panel for the integral with a density, (2, k)."""
    inner = sorted({a, b, *(t for t in cuts if a < t < b)})
    edges = [
        np.linspace(one, two, int((two - one) / _FINE) + 2)[:-1] for one, two in pairwise(inner)
    ]
    at, weights = axis.rules(list(pairwise([*np.concatenate(edges), b])), _FINE_RULE)
    fine = weights * density(at)
    t = axis.cut(at.astype(np.complex128)).real
    points = (2.0 * t - a - b) / (b - a)
    found = np.zeros((2, x.size))
    for row, step in ((0, 1), (1, 2)):
        # Gauss's nodes are every other one of Kronrod's.
        chosen = np.arange(step - 1, x.size, step)
        moments = fine @ legvander(points, chosen.size - 1)
        found[row, chosen] = np.linalg.solve(legvander(x[chosen], chosen.size - 1).T, moments)
    return found


@lru_cache(maxsize=2)
def _rule(short: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return nodes on [-1, 1], Kronrod's weights and Gauss's."""
    half = (_SHORT_NODES, _SHORT_KRONROD) if short else (_NODES, _KRONROD)
    x, kronrod = (np.array(part) for part in half)
    gauss = np.zeros(2 * x.size - 1)
    gauss[1::2] = leggauss(x.size - 1)[1]  # every other node is one of Gauss's
    return np.concatenate([-x, x[-2::-1]]), np.concatenate([kronrod, kronrod[-2::-1]]), gauss
