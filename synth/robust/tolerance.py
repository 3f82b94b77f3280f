"""Tolerance of gains by their components', against the exact radius of stability.

A sweep of gains shows what errors do to the motion; whether any of them is unstable needs no
samples at all: `gain_radius` knows the least errors that are, exactly.  Here the two
are put side by side, on the design's own plant and drag.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.basics import InputError, Share, check_range, share
from models.spread import DRAG, GAINS, Samples, Spread, Uniform

from ..design import Design
from ..sweeps import FrequencyEngine
from .perturbation import GainRadius, gain_radius

_OUTSIDE = 1.001  # times the radius, where the nearest unstable gains have to be unstable
_FACES = 0.5  # share of the draws that are put on the faces of the box


@dataclass(frozen=True, kw_only=True, eq=False)
class GainTolerance:
    """What a tolerance of the gains does.

    Attributes
    ----------
    tolerance
        How far every gain may be off, as a share of itself.
    radius
        The exact radius of stability.
    stable
        Share of the drawn gains that is stable.
    payload_rms, worst_rms
        Payload rms of the design, and the largest of the stable draws [m].
    beyond
        Whether gains just beyond the radius, in the worst direction, were found unstable; None
        if the radius is infinite.
    """

    tolerance: float
    radius: GainRadius
    stable: Share
    payload_rms: float
    worst_rms: float
    beyond: bool | None

    @property
    def ok(self) -> bool:
        """Whether every combination of errors within the tolerance is stable, by the radius."""
        return self.tolerance < self.radius.box

    def __str__(self) -> str:
        """Return a small tree."""
        verdict = "stable with" if self.ok else "NOT stable with all"
        rise = 100.0 * (self.worst_rms / self.payload_rms - 1.0)
        return (
            f"GainTolerance: {verdict} gains off by {100.0 * self.tolerance:.3g} %\n"
            f"├ exact: {self.radius}\n"
            f"├ {self.stable.count} of {self.stable.total} draws are stable\n"
            f"└ payload {1e3 * self.payload_rms:.4g} mm rms, at most "
            f"{1e3 * self.worst_rms:.4g} mm among them ({rise:+.2g} %)"
        )


def gain_tolerance(
    design: Design,
    tolerance: float,
    *,
    samples: int = 2000,
    seed: int = 0,
) -> GainTolerance:
    """Return what gains do that are off by up to a share of themselves.

    Parameters
    ----------
    design
        A stable design whose loop is affine in some of its gains.
    tolerance
        Share by which each of those may be off, either way.
    samples, seed
        Number of draws and their seed; half of them lie on the faces of the box, where it is
        left first.

    Raises
    ------
    InputError
        If the design is unstable, affine in no gain, or the tolerance is out of range.
    """
    check_range("gain tolerance", "tolerance", tolerance, low=0.0, high=1.0, open_low=True)
    check_range("gain tolerance", "samples", samples, low=1)
    if design.margins is None:
        raise InputError("gain tolerance: the design must be stable")
    question = design.question
    values = question.values(design.parameters)
    radius = gain_radius(design.assessment.plant, question.law, values)
    widths = {f"{GAINS}{name}": Uniform(f"{100.0 * tolerance:.12g} %") for name in radius.names}
    engine = FrequencyEngine(design, _held(design, widths), metrics=["payload_rms"])
    rows = engine.spread.sample(samples, seed=seed)
    rng = np.random.default_rng(seed)
    own = [engine.spread.paths.index(path) for path in widths]
    for row in rows[: int(_FACES * samples)]:
        j = own[int(rng.integers(len(own)))]
        row[j] = engine.spread.distributions[engine.spread.paths[j]].ends[int(rng.integers(2))]
    found = engine.evaluate(rows)
    stable = found["stable"].astype(bool)
    rms = found["payload_rms"][stable]
    beyond = None
    if np.isfinite(radius.ball):
        beyond = not _stable_at(engine, radius, _OUTSIDE)
    return GainTolerance(
        tolerance=tolerance,
        radius=radius,
        stable=share(int(stable.sum()), samples),
        payload_rms=float(design.payload_rms),
        worst_rms=float(rms.max()) if rms.size else float("inf"),
        beyond=beyond,
    )


def _held(design: Design, widths: dict[str, Uniform]) -> Spread:
    """Return a spread of gains with the drag held at the design's, as the radius has it."""
    if design.sea_case.payload.fixed_drag is None:
        return Spread({**widths, DRAG: Samples([design.drag])})
    return Spread(widths)


def _stable_at(engine: FrequencyEngine, radius: GainRadius, times: float) -> bool:
    """Return whether gains `times` the way to the nearest unstable ones are stable."""
    amplifier = engine.design.question.amplifier
    # The law's gains go with its own A, which may not be the design's.
    scale = 1.0 if amplifier is None else amplifier / engine.design.parameters["A"]
    there = dict(engine.spread.nominal)
    for name in radius.names:
        own = there[f"{GAINS}{name}"]
        there[f"{GAINS}{name}"] = own + times * (radius.worst[name] * scale - own)
    return bool(engine.evaluate(np.array([[*there.values()]]))["stable"][0])
