"""The sea, as a section of the case file.

The section holds what the user gave; `models.sea.sea.SeaSpectrum`, which `Sea.to_spectrum` makes,
is what everything downstream asks.  Fields that follow from the others (the height of a measured
sea, the periods of a sea by its wind) are filled in on validation, so that every sea has a
`significant_height` and a peak, and are left out again where the case is written.
"""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field, model_validator

from ..basics import GRAVITY, InputError
from ..casefile import DataFile, Quantity, Section, problems
from .kinds import FIELDS
from .shapes import fully_developed_period, jonswap_gamma
from .wind import fully_arisen

if TYPE_CHECKING:
    from .sea import SeaSpectrum

_BY_WIND = ("bretschneider-1975", "bretschneider", "pierson-moskowitz")
_MEASURED = ("table", "file", "record", "beyond")
_MOST_PARTS = 10
# T_p of the 1975 form over its T_S: see `SeaPart.spectral_peak_period`.
_PEAK_OF_SIGNIFICANT = 0.9 / math.sqrt(math.sqrt(0.54))


class SeaTable(Section):
    """A spectrum as a table, linear between its rows."""

    omega: Annotated[
        tuple[Annotated[float, Quantity("frequency", 0.0, 60.0)], ...],
        Field(min_length=3, max_length=1000),
    ]
    """Frequencies, strictly ascending."""
    density: tuple[Annotated[float, Quantity("spectral density", 0.0, 1e6)], ...]
    """Variance density of the elevation at each frequency."""


class SeaSpreading(Section):
    """How the energy of a short-crested sea divides over headings."""

    kind: Literal["cos-2s", "cos-n"]
    """The law: cos^2s of half the angle from the mean heading, or cos^n of that angle."""
    exponent: Annotated[float, Quantity("number", 0.0, 500.0)]
    """s or n: wind seas have s of 5 to 15 or n of 2 to 6, swell s of 30 and more."""


class SeaPart(Section):
    """A sea that is no sum: what stands under `parts`, and most of what stands under `sea`."""

    spectrum: Literal[
        "bretschneider-1975",
        "bretschneider",
        "jonswap",
        "torsethaugen",
        "ochi-hubble",
        "pierson-moskowitz",
        "tma",
        "gaussian-swell",
        "measured",
        "sum",
    ]
    """Shape of the wave spectrum; `bretschneider-1975` in the variables of the 1975 thesis,
    `pierson-moskowitz` fully developed, `tma` in shallow water, `measured` a table or a record of
    a file, `sum` the sum of `parts`."""
    significant_height: Annotated[float, Quantity("length", 0.0, 30.0, open_low=True)] = Field(
        default_factory=lambda: math.nan
    )
    """Significant wave height H_s (4 standard deviations of the surface elevation; the 1975
    form takes H_mean = 0.625 H_s). May be left out where `wind_speed`, the measured spectrum or
    the parts have it; they are scaled to it where it is given."""
    peak_period: Annotated[float, Quantity("time", 0.0, 60.0, open_low=True)] | None = None
    """Period of the spectrum's peak; not for `bretschneider-1975`, `pierson-moskowitz`,
    `measured` and `sum`."""
    significant_period: Annotated[float, Quantity("time", 0.0, 60.0, open_low=True)] | None = None
    """Significant period T_S, for `bretschneider-1975` only (T_mean = 0.9 T_S)."""
    wind_speed: Annotated[float, Quantity("speed", 0.0, 100.0, open_low=True)] | None = None
    """Wind of a fully arisen sea, 18 to 24.5 knots (1975 thesis, Table 3), instead of a height
    and a period, for `bretschneider-1975`, `bretschneider` and `pierson-moskowitz`."""
    gamma: Annotated[float | Literal["auto"], Quantity("ratio", 1.0, 7.0, word="auto")] = 3.3
    """Peak enhancement of `jonswap` and `tma`; `auto` takes it from T_p and H_s (DNV-RP-C205).
    The other spectra do not use it."""
    order: Annotated[float, Quantity("ratio", 0.5, 20.0)] = 2.0
    """Shape parameter of `ochi-hubble`; 1 gives `bretschneider`. The other spectra do not use
    it."""
    depth: Annotated[float, Quantity("length", 0.0, 12e3, open_low=True)] | None = None
    """Water depth, for `tma` only."""
    width: Annotated[float, Quantity("frequency", 0.0, 10.0, open_low=True)] | None = None
    """Standard deviation of the frequency of `gaussian-swell`, 1/200 to 1/6 of the peak's."""
    table: SeaTable | None = None
    """Table of a `measured` spectrum, or give `file`."""
    file: Annotated[str, DataFile(what="a file of wave spectra")] | None = None
    """File of a `measured` spectrum (NDBC, Spotter, SWAN, WAVEWATCH III, ERA5 and more),
    relative to the case file; `stillhook sea FILE` shows its records."""
    record: Annotated[int, Quantity("count", 0, 10_000_000)] | None = None
    """Which record of `file`, counted from 0 in order of time; by default 0."""
    beyond: Literal["decay", "zero"] | None = None
    """What a `measured` spectrum is above its last row: `decay` falls as 1/omega^5, `zero` is 0.
    Default decay."""

    alternatives = (("peak_period", "significant_period", "wind_speed"), ("table", "file"))

    @model_validator(mode="after")
    def _check(self) -> SeaPart:
        found = self._misplaced()
        if found:
            raise problems(*found)
        found = self._filled()
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

    def to_spectrum(self) -> SeaSpectrum:
        """Return the spectrum.

        Raises
        ------
        InputError
            If the form is not defined for these values, or a file of spectra cannot be read.
        """
        return _spectrum(self, _stamps(self))

    def _misplaced(self) -> list[tuple[str, str]]:
        """Return which fields are missing, and which are not for the spectrum."""
        kind, found = self.spectrum, []
        if kind == "sum" and "parts" not in type(self).model_fields:
            return [("spectrum", "must not be a sum itself")]
        measured, by_wind = kind == "measured", self.wind_speed is not None
        if by_wind and kind not in _BY_WIND:
            text = f"is not for the {kind} spectrum: it is for {', '.join(_BY_WIND)}"
            return [("wind_speed", text)]
        wanted = [name for name in FIELDS[kind] if name not in ("table", "parts")]
        for name in wanted:
            period = name.endswith("period")
            if getattr(self, name) is None and not (by_wind and period):
                found.append((name, f"is missing: the {kind} spectrum needs it"))
            elif by_wind and period and getattr(self, name) is not None:
                found.append((name, "is not for a sea by its wind_speed, which gives the period"))
        if math.isnan(self.significant_height) and not (by_wind or kind in ("measured", "sum")):
            text = f"is missing: the {kind} spectrum needs it"
            found.append(("significant_height", text))
        takes = " and ".join(wanted) or {"measured": "a table or a file", "sum": "parts"}.get(
            kind, "no period"
        )
        for name in ("peak_period", "significant_period", "depth", "width"):
            if getattr(self, name) is not None and name not in wanted:
                found.append((name, f"is not for the {kind} spectrum, which takes {takes}"))
        for name in _MEASURED:
            if getattr(self, name) is not None and not measured:
                found.append((name, f"is not for the {kind} spectrum, which takes {takes}"))
        if measured and (self.table is None) == (self.file is None):
            text = "is missing: the measured spectrum needs a table or a file"
            found.append(("table", text if self.table is None else "must be left out, or file"))
        if measured and self.file is None and self.record is not None:
            found.append(("record", "is for a file of spectra, and none is given"))
        return found

    def _filled(self) -> list[tuple[str, str]]:
        """Fill in what follows from the other fields; return what is wrong."""
        values: dict[str, Any] = {}
        asked = None if math.isnan(self.significant_height) else self.significant_height
        if self.wind_speed is not None:
            try:
                height, period = fully_arisen(self.wind_speed)
            except InputError as error:
                return [("wind_speed", str(error))]
            values["significant_height"] = asked or height
            if self.spectrum == "bretschneider-1975":
                values["significant_period"] = period
            elif self.spectrum == "bretschneider":
                values["peak_period"] = _PEAK_OF_SIGNIFICANT * period
            else:
                values["peak_period"] = fully_developed_period(height)
        elif self.spectrum == "pierson-moskowitz":
            values["peak_period"] = fully_developed_period(self.significant_height)
        # The fields are set past pydantic's lock: from here on the section is as good as frozen.
        derived = frozenset(values) - ({"significant_height"} if asked else set())
        self.__dict__.update(values)
        self._derived = derived
        if self.spectrum not in ("measured", "sum", "gaussian-swell"):
            return []  # the fields' own ranges are all there is to check
        try:
            spectrum = self.to_spectrum()
        except InputError as error:
            return [self._blame(str(error))]
        if self.spectrum in ("measured", "sum"):
            self.__dict__["significant_height"] = spectrum.significant_height
            self.__dict__["peak_period"] = 2.0 * math.pi / spectrum.peak_frequency
            derived = frozenset({"peak_period"} if asked else {"peak_period", "significant_height"})
            if spectrum.significant_height > 30.0:
                text = f"must be in (0, 30] m, got {spectrum.significant_height:.4g} from the data"
                return [("significant_height", text)]
            self._derived = derived
        return []

    def _blame(self, message: str) -> tuple[str, str]:
        """Return the field that an error of the spectrum is about, and its sentence."""
        text = message.removeprefix("sea: ")
        if self.spectrum == "measured":
            if self.file is not None:
                return "record" if text.startswith("record ") else "file", text
            text = text.removeprefix("measured spectrum: ")
            name, _, rest = text.partition(" ")
            return (f"table.{name}", rest) if name in ("omega", "density") else ("table", text)
        name, _, rest = text.partition(" ")
        return (
            (name, rest) if name in type(self).model_fields and name != "spectrum" else ("", text)
        )


class Sea(SeaPart):
    """The sea state."""

    parts: tuple[SeaPart, ...] | None = None
    """The seas of `sum`, such as a wind sea and a swell: each with a `spectrum` and its fields."""
    spreading: SeaSpreading | None = None
    """Spreading of the energy over headings; without it the sea is long-crested."""

    def _misplaced(self) -> list[tuple[str, str]]:
        found = super()._misplaced()
        if self.spectrum == "sum":
            if self.parts is None:
                found.append(("parts", "is missing: the sum spectrum needs it"))
            elif not 1 <= len(self.parts) <= _MOST_PARTS:
                text = f"must have 1 to {_MOST_PARTS} seas, got {len(self.parts)}"
                found.append(("parts", text))
        elif self.parts is not None:
            found.append(("parts", f"is not for the {self.spectrum} spectrum, but for sum"))
        return found


def _stamps(section: SeaPart) -> tuple[tuple[int, int], ...]:
    """Return time and size of the section's files: a file may change under its name."""
    parts: tuple[SeaPart, ...] = getattr(section, "parts", None) or ()
    found = []
    for file in (section.file, *(part.file for part in parts)):
        if file is not None:
            try:
                about = Path(file).stat()
            except OSError:
                continue  # whoever reads it will say so
            found.append((about.st_mtime_ns, about.st_size))
    return tuple(found)


@lru_cache(maxsize=64)
def _spectrum(section: SeaPart, stamps: tuple[tuple[int, int], ...]) -> SeaSpectrum:
    del stamps  # a part of the cache's key only
    # Here, so that reading a case does not load scipy.
    from .sea import SeaSpectrum
    from .spreading import Spreading

    spread = getattr(section, "spreading", None)
    spreading = None if spread is None else Spreading(kind=spread.kind, exponent=spread.exponent)
    height = section.significant_height
    if section.spectrum == "sum":
        parts: tuple[SeaPart, ...] = getattr(section, "parts", None) or ()
        return SeaSpectrum(
            kind="sum",
            significant_height=height,
            parts=tuple(part.to_spectrum() for part in parts),
            spreading=spreading,
        )
    if section.spectrum == "measured":
        beyond = section.beyond or "decay"
        if section.table is None:
            from .records import read_seas

            sea = read_seas(section.file or "").sea(section.record or 0, beyond=beyond)
            table = sea.table
        else:
            from .table import SpectrumTable

            table = SpectrumTable(
                omega=section.table.omega, density=section.table.density, beyond=beyond
            )
        return SeaSpectrum(
            kind="measured", significant_height=height, table=table, spreading=spreading
        )
    kind, gamma, shape_height = section.spectrum, section.gamma, None
    if kind == "pierson-moskowitz":
        shape_height = _height_of_period(section.peak_period or math.nan)
    if gamma == "auto":
        gamma = jonswap_gamma(section.spectral_peak_period, height)
    return SeaSpectrum(
        kind=kind,
        significant_height=height,
        peak_period=None if kind == "pierson-moskowitz" else section.peak_period,
        significant_period=section.significant_period,
        gamma=gamma,
        order=section.order,
        depth=section.depth,
        width=section.width,
        shape_height=shape_height,
        spreading=spreading,
    )


def _height_of_period(period: float) -> float:
    """Return the H_s whose fully developed sea has this peak period [m]."""
    return (period / fully_developed_period(1.0)) ** 2
