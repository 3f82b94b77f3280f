r"""Nodes on which the variances of all loops of a sweep are integrated, with an error of each.

Nodes made for one loop (`models.basics.quadrature.adaptive_nodes`) do not suit a thousand others.
So every panel gets a Gauss-Kronrod pair: the nodes of the longer rule hold those of the shorter
one, and a second column of weights tells for each loop how far the two differ, at no further
evaluation.  Loops for which that is too far (a resonance narrower than the panels) go on to the
next level, of panels half as long.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from models.basics import (
    FloatArray,
    FrequencyAxis,
    Quadrature,
    ReadOnlyArrays,
    cut_panels,
    longest_panel,
)

_SHORT = 0.12  # panels shorter than this, in ln omega, get the 7-point rule
_PER_DECADE = 3.0

# Kronrod's extensions of the 3- and the 7-point Gauss rules (Kronrod 1964; QUADPACK's qk15): nodes
# from the outermost to the middle, their weights, and Gauss's weights of every other one.
_RULES = {
    7: (
        (0.960491268708020283423507092629080, 0.774596669241483377035853079956480,
         0.434243749346802558002071502844628, 0.0),
        (0.104656226026467265193823857192073, 0.268488089868333440728569280666710,
         0.401397414775962222905051818618432, 0.450916538658474142345110087045571),
        (0.0, 5.0 / 9.0, 0.0, 8.0 / 9.0),
    ),
    15: (
        (0.991455371120812639206854697526329, 0.949107912342758524526189684047851,
         0.864864423359769072789712788640926, 0.741531185599394439863864773280788,
         0.586087235467691130294144691693040, 0.405845151377397166906606412076961,
         0.207784955007898467600689403773245, 0.0),
        (0.022935322010529224963732008058970, 0.063092092629978553290700663189204,
         0.104790010322250183839876322541518, 0.140653259715525918745189590510238,
         0.169004726639267902826583426598550, 0.190350578064785409913256402421014,
         0.204432940075298892414161999234649, 0.209482141084727828012999174891714),
        (0.0, 0.129484966168869693270611432679082, 0.0, 0.279705391489276667901467771423780,
         0.0, 0.381830050505118944950369775488975, 0.0, 0.417959183673469387755102040816327),
    ),
}  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class SweepNodes(ReadOnlyArrays):
    """Nodes with two rules on them.

    Attributes
    ----------
    omega
        Nodes, ascending (k,) [rad/s].
    weights
        The rules, (2, k) [rad/s]: the one that counts, and the shorter one; (1, k) if there is
        none to compare with.
    """

    omega: FloatArray
    weights: FloatArray

    def __len__(self) -> int:
        return int(self.omega.size)

    @classmethod
    def of(cls, nodes: Quadrature) -> SweepNodes:
        """Return given nodes, of which no error is known."""
        return cls(omega=nodes.omega, weights=nodes.weights[None])

    @property
    def quadrature(self) -> Quadrature:
        """The rule that counts."""
        return Quadrature(omega=self.omega, weights=self.weights[0])


def sweep_nodes(
    low: float,
    high: float,
    splits: Sequence[float],
    *,
    level: int = 0,
    marks: Sequence[complex] = (),
    clearance: float = 1.5,
) -> SweepNodes:
    """Return nodes from `low` to `high` [rad/s].

    Parameters
    ----------
    low, high
        The band.
    splits
        Kinks of the density [rad/s], where panels end.
    level
        Panels are shorter by 2 to this power.
    marks
        Poles s [1/s] that most loops have something like; panels near them are shorter.
    clearance
        Half of a panel over its distance from each pole, at most.
    """
    axis = FrequencyAxis(low, high, half_line=False)
    longest = longest_panel(_PER_DECADE * 2.0**level)
    near = axis.poles(p for p in marks if p.real != 0.0)
    omega, fine, rough = [], [], []
    for a, b in cut_panels(axis, splits, near, longest, clearance):
        x, kronrod, gauss = _rule(7 if b - a < _SHORT * 0.5**level else 15)
        at = axis.low * np.exp(0.5 * (a + b) + 0.5 * (b - a) * x)
        omega.append(at)
        fine.append(0.5 * (b - a) * kronrod * at)
        rough.append(0.5 * (b - a) * gauss * at)
    weights = np.stack([np.concatenate(fine), np.concatenate(rough)])
    return SweepNodes(omega=np.concatenate(omega), weights=weights)


@lru_cache(maxsize=4)
def _rule(count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return nodes on [-1, 1], Kronrod's weights and Gauss's."""
    x, kronrod, gauss = (np.array(part) for part in _RULES[count])
    return (
        np.concatenate([-x, x[-2::-1]]),
        np.concatenate([kronrod, kronrod[-2::-1]]),
        np.concatenate([gauss, gauss[-2::-1]]),
    )
