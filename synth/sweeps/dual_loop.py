"""One loop's figures with their slopes: `Dual` numbers through the recursion of thousands.

What a loop is made of (`columns_of`, the law's parameters, drag, the hook's density) goes in with
slopes by any variables; the logarithms of standard deviations and of peaks of |S| come out with
theirs, exactly.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from models.basics import FloatArray, Quadrature
from models.plant import RopeLumps

from ..loop import Dual, log, sqrt, value_of, where
from ..structures import ParametrisedController
from .chain import Chain, ChainLoops, Shaken, abs2
from .law_rows import LawColumns
from .numbers import Numbers
from .sweep_nodes import SweepNodes


def dual_figures(
    numbers: Numbers,
    law: ParametrisedController,
    measurements: Sequence[str],
    values: Sequence[Any],
    drag: Any,
    *,
    lumps: RopeLumps,
    nodes: Quadrature,
    density: Any,
    outputs: Sequence[str],
    peaks: FloatArray,
    switching: Any = None,
) -> tuple[Mapping[str, Dual], Dual]:
    """Return ln sigma of each output, (1,), and ln |S| at some frequencies, (1, p).

    |S| is the larger one of that with the losses and without.  All that is `Any`, and the numbers,
    may be arrays or `Dual`.

    Parameters
    ----------
    numbers
        The plant's, (1,) each, see `columns_of`.
    law, measurements, values
        The structure bound to its plant, what it hears, and its parameters, (1,) each.
    drag
        Linear drag coefficient of the payload, (1,) [N s/m].
    lumps
        How the rope is lumped.
    nodes, density
        Nodes (k,), and the density of the hook's motion at them, (1, k) [m2 s/rad].
    outputs
        Names of outputs.
    peaks
        The frequencies, (p,) [rad/s].
    switching
        Density at the nodes of losses that switch, (1, k), as `Shaken` has it.
    """
    own = LawColumns(
        law=law,
        measurements=tuple(measurements),
        values=tuple(values),
        poles=np.zeros((1, 0), dtype=np.complex128),
    )
    loops = ChainLoops(count=1, numbers=numbers, law=own, drag=drag, lumps=lumps)
    row = np.zeros(1, dtype=np.intp)
    s = [np.asarray(1j * omega, dtype=np.complex128) for omega in (nodes.omega, peaks)]
    along = Chain(loops, row, s[0])
    sides = [loops]
    if isinstance(numbers["friction"], Dual) or np.any(numbers["friction"]):
        sides.append(loops.with_drag(drag, np.zeros(1)))
    shaken = Shaken(
        factors=np.ones(1),
        ratios=density,
        heave_rms=sqrt(density @ nodes.weights),
        noisy=True,
        switching=switching,
    )
    moments = along.moments(outputs, SweepNodes.of(nodes, np.ones_like), shaken, drag)
    heights: Any = None
    for side in sides:
        at_peaks = Chain(side, row, s[1])
        y, f = at_peaks.ends(drag[:, None])
        free = at_peaks.W * y + at_peaks.pull * f
        own = 0.5 * (log(abs2(free)) - log(abs2(at_peaks.closed(y, f))))
        if heights is not None:
            # Where there is no friction yet the worst is what more of it makes of them: its slope
            # is the last.
            less = value_of(own) - value_of(heights)
            own = where((less > 0.0) | ((less == 0.0) & (heights.slope[-1] < 0.0)), own, heights)
        heights = own
    return {name: 0.5 * log(both[..., 0]) for name, both in moments.items()}, heights
