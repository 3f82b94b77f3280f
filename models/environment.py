"""Sea and vessel, as sections of the case file: what moves the hook.

A section only holds the data; the spectra are computed from it in `models.sea`, the motion of the
hook in `models.hook`.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from .checks import InputError, check_ascending
from .quantity import Quantity
from .section import Section, problems
from .tables import GRAVITY

__all__ = ["HeaveRAO", "Sea", "Vessel"]


class Sea(Section):
    """The sea state."""

    alternatives = (("peak_period", "significant_period"),)

    spectrum: Literal[
        "bretschneider-1975", "bretschneider", "jonswap", "torsethaugen", "ochi-hubble"
    ]
    """Shape of the wave spectrum; `bretschneider-1975` in the variables of the 1975 thesis."""
    significant_height: Annotated[float, Quantity("length", 0.0, 30.0, open_low=True)]
    """Significant wave height H_s (4 standard deviations of the surface elevation; the 1975
    form takes H_mean = 0.625 H_s)."""
    peak_period: Annotated[float, Quantity("time", 0.0, 60.0, open_low=True)] | None = None
    """Period of the spectrum's peak, for all but `bretschneider-1975`."""
    significant_period: Annotated[float, Quantity("time", 0.0, 60.0, open_low=True)] | None = None
    """Significant period T_S, for `bretschneider-1975` only (T_mean = 0.9 T_S)."""
    gamma: Annotated[float, Quantity("ratio", 1.0, 7.0)] = 3.3
    """Peak enhancement of `jonswap`; the other spectra do not use it."""

    @model_validator(mode="after")
    def _check(self) -> Sea:
        wanted, other = "peak_period", "significant_period"
        if self.spectrum == "bretschneider-1975":
            wanted, other = other, wanted
        found = []
        if getattr(self, wanted) is None:
            found.append((wanted, f"is missing: the {self.spectrum} spectrum needs it"))
        if getattr(self, other) is not None:
            text = f"is not for the {self.spectrum} spectrum, which takes {wanted}"
            found.append((other, text))
        if found:
            raise problems(*found)
        return self

    @property
    def spectral_peak_period(self) -> float:
        """Period of the spectrum's peak [s], also where it is not a field.

        The 1975 form peaks at f T_mean = 0.54^(1/4) with T_mean = 0.9 T_S: setting to zero the
        derivative of nu^-5 exp(-0.675 nu^-4) (1975 thesis, Appendix B).
        """
        if self.significant_period is not None:
            return 0.9 * self.significant_period / math.sqrt(math.sqrt(0.54))
        return self.peak_period or math.nan

    @property
    def steepness(self) -> float:
        """Significant steepness, H_s over the deep-water length of the peak's wave [-]."""
        length: float = GRAVITY * self.spectral_peak_period**2 / (2.0 * math.pi)
        return self.significant_height / length

    @property
    def breaking_steepness(self) -> float:
        """Significant steepness above which seas are not observed [-] (DNV-RP-C205).

        1/15 for peak periods up to 8 s, 1/25 from 15 s, linear in between.
        """
        share = min(max((self.spectral_peak_period - 8.0) / 7.0, 0.0), 1.0)
        return 1.0 / 15.0 + share * (1.0 / 25.0 - 1.0 / 15.0)


class HeaveRAO(Section):
    """Heave of the hook per wave amplitude, as a table over frequency."""

    omega: Annotated[
        tuple[Annotated[float, Quantity("frequency", 0.0, 20.0)], ...],
        Field(min_length=2),
    ]
    """Frequencies, strictly ascending."""
    amplitude: tuple[Annotated[float, Quantity("ratio", 0.0, 50.0, unit="m/m")], ...]
    """Heave amplitude over wave amplitude at each frequency."""
    phase: tuple[Annotated[float, Quantity("angle", -1000.0, 1000.0)], ...] | None = None
    """How far the heave is ahead of the wave at the hook, at each frequency (e^{+i omega t}); by
    default 0."""

    @model_validator(mode="after")
    def _check(self) -> HeaveRAO:
        found = []
        try:
            check_ascending("rao", "omega", self.omega)
        except InputError as error:
            found.append(("omega", str(error).removeprefix("rao: omega ")))
        for name in ("amplitude", "phase"):
            values = getattr(self, name)
            if values is not None and len(values) != len(self.omega):
                text = f"must have as many entries as omega, {len(self.omega)}, got {len(values)}"
                found.append((name, text))
        if found:
            raise problems(*found)
        return self


class Vessel(Section):
    """The vessel, by the heave of its hook."""

    heave_rao: HeaveRAO
    """Heave of the hook per wave amplitude."""
    below: Literal["unity", "hold", "zero"] = "unity"
    """What the RAO is below its table: `unity` goes linearly to 1 at zero frequency (in long
    waves a vessel follows the sea), `hold` keeps the first value, `zero` is 0."""
    beyond: Literal["hold", "zero", "decay"] = "decay"
    """What the RAO is above its table: `hold` keeps the last value, `zero` is 0, `decay` falls
    as 1/omega^2."""
