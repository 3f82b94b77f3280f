"""One-sided spectra of the disturbances, in one common form.

`synth.design.tuning` takes a callable, a table, a spectrum object of `models` (sea, hook motion) or
`White`; here each becomes a `Disturbance` with a density, the band that holds its variance
and the frequencies where it is not smooth.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from models.basics import (
    ComplexArray,
    FloatArray,
    InputError,
    White,
    check_ascending,
    check_finite,
)
from models.plant import ShapingFilter


@dataclass(frozen=True, kw_only=True)
class Disturbance:
    """One disturbance."""

    #: Its name, and its one-sided density per rad/s.
    name: str
    density: Callable[[FloatArray], FloatArray]
    #: The band that holds it [rad/s], None for the half line, and kinks in it [rad/s].
    band: tuple[float, float] | None
    splits: tuple[float, ...] = ()
    #: Of an error that is in part a share of another disturbance, of signs that nobody knows: the
    #: name of that one, and from frequencies (k,) [rad/s] to the shares, (e, k).  The density holds
    #: them with the mean square over their signs.
    source: str = ""
    shares: Callable[[FloatArray], ComplexArray] | None = None

    def scaled(self, amplitude: float) -> Disturbance:
        """Return the disturbance with its amplitude times `amplitude`."""
        plain, factor = self.density, amplitude**2

        def density(omega: FloatArray) -> FloatArray:
            return factor * plain(omega)

        return self if amplitude == 1.0 else replace(self, density=density)


@dataclass(frozen=True, kw_only=True)
class CoherentError:
    """What a pair of disturbances have in common, see `Disturbance.shares`."""

    #: Places of the error and of what it is a share of.
    error: int
    source: int
    #: From frequencies (k,) [rad/s] to the shares, (e, k).
    shares: Callable[[FloatArray], ComplexArray]

    @classmethod
    def among(cls, every: Sequence[Disturbance]) -> CoherentError | None:
        """Return the first of its kind among disturbances; None where there is none."""
        names = [d.name for d in every]
        for i, d in enumerate(every):
            if d.shares is not None and d.source in names and len(d.shares(np.ones(1))):
                return cls(error=i, source=names.index(d.source), shares=d.shares)
        return None

    @property
    def signs(self) -> list[tuple[float, ...]]:
        """Every combination of signs of the shares."""
        return [*product((1.0, -1.0), repeat=len(self.shares(np.ones(1))))]


def disturbances(spectrum: Mapping[str, Any], known: tuple[str, ...]) -> tuple[Disturbance, ...]:
    """Return the disturbances of a mapping from their names to their spectra.

    A spectrum is a `White` or a `ShapingFilter`, an object with ``density``, ``band`` and
    ``splits`` (`models.basics.quadrature.SpectralDensity`), a callable of omega [rad/s], or a table
    (omega, density), linear in between and zero outside.  `known` are the names of the plant's
    independent disturbances.

    Raises InputError if there is none, a name is unknown, or a spectrum is none of these or is
    negative.
    """
    if not spectrum:
        raise InputError("tune: spectrum must name at least one disturbance, got none")
    result = []
    for name, value in spectrum.items():
        if name not in known:
            raise InputError(
                f"tune: spectrum: there is no disturbance {name!r}; there are: "
                f"{', '.join(known) or 'none'}"
            )
        result.append(_disturbance(name, value))
    return tuple(result)


def _disturbance(name: str, value: Any) -> Disturbance:
    if isinstance(value, White | ShapingFilter):
        return Disturbance(name=name, density=value.density, band=None)
    if hasattr(value, "density") and hasattr(value, "band"):
        return Disturbance(
            name=name,
            density=_checked(name, value.density),
            band=tuple(value.band),
            splits=tuple(getattr(value, "splits", ())),
            source=getattr(value, "source", ""),
            shares=getattr(value, "shares", None),
        )
    if callable(value):
        return Disturbance(name=name, density=_checked(name, value), band=None)
    try:
        omega, density = value
    except (TypeError, ValueError):
        raise InputError(
            f"tune: spectrum of {name} must be a callable of omega, a table (omega, density) "
            f"or White, got {type(value).__name__}"
        ) from None
    owner = f"tune: spectrum of {name}"
    nodes = check_ascending(owner, "omega", omega)
    values = check_finite(owner, "density", density)
    if nodes.shape != values.shape or nodes.size < 2:
        raise InputError(
            f"{owner}: omega and density must be equally long, at least 2, got "
            f"{nodes.shape} and {values.shape}"
        )
    if nodes[0] < 0.0 or float(values.min()) < 0.0:
        raise InputError(f"{owner}: omega and density must be at least 0")

    def table(omega: FloatArray) -> FloatArray:
        return np.interp(omega, nodes, values, left=0.0, right=0.0)

    low = float(nodes[0]) if nodes[0] > 0.0 else min(float(nodes[1]), 1e-3 * float(nodes[-1]))
    # A table that begins at zero keeps its first cell: the band starts a little above zero,
    # where a finite density holds nothing that matters.
    if nodes[0] == 0.0:
        low = 1e-6 * float(nodes[-1])
    inner = tuple(float(w) for w in nodes[1:-1] if w > low)
    return Disturbance(name=name, density=table, band=(low, float(nodes[-1])), splits=inner)


def _checked(name: str, density: Callable[[Any], Any]) -> Callable[[FloatArray], FloatArray]:
    def checked(omega: FloatArray) -> FloatArray:
        values = np.asarray(density(omega), dtype=np.float64)
        if values.shape != np.shape(omega) or not np.all(np.isfinite(values)) or np.any(values < 0):
            raise InputError(
                f"tune: spectrum of {name} must return a finite density of at least 0 for every "
                f"omega, got an array of shape {values.shape}"
                + (f" with a least value of {values.min():g}" if values.size else "")
            )
        return values

    return checked
